/* Unity's options for every test on the PC: 64-bit integers, double, and each result written at once, before a crash can swallow it. */
#ifndef UNITY_CONFIG_H
#define UNITY_CONFIG_H

#define UNITY_SUPPORT_64
#define UNITY_INCLUDE_DOUBLE
#define UNITY_USE_FLUSH_STDOUT

#endif
