/* Unity's options for every test of the project: 64-bit integers and double comparisons on the PC. */
#ifndef UNITY_CONFIG_H
#define UNITY_CONFIG_H

#define UNITY_SUPPORT_64
#define UNITY_INCLUDE_DOUBLE

#endif
