/* Unity's options where int has 16 bits: no double, results to the simulator. */
#ifndef UNITY_CONFIG_H
#define UNITY_CONFIG_H

void console_put(int c);

#define UNITY_OUTPUT_CHAR(c) console_put(c)
#define UNITY_POINTER_WIDTH 16
#define UNITY_LINE_TYPE unsigned int
#define UNITY_EXCLUDE_DOUBLE
#define UNITY_EXCLUDE_MATH_H
#define UNITY_EXCLUDE_SETJMP_H /* a test goes on after its first failure, but only that one is printed */

#endif
