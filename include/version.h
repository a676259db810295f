/* The version of foc33, the newest one in CHANGELOG.md; UART1's first line says it. */
#ifndef VERSION_H
#define VERSION_H
#define FOC33_VERSION "0.10.0"

#endif
