/* Unity's options on the AVR: 16-bit int, no double, results over the UART. */
#ifndef UNITY_CONFIG_H
#define UNITY_CONFIG_H

void console_put(int c);

#define UNITY_OUTPUT_CHAR(c) console_put(c)
#define UNITY_SUPPORT_64
#define UNITY_EXCLUDE_DOUBLE

#endif
