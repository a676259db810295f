/* Lines of text on the serial line. An application that includes this file has the line: it is told what it hears and asks what to say (told->heard,
 * asks->say), and the status lines stay away. Two digits behind '*' check a line: "run*69", the exclusive-or of the characters before, as in NMEA 0183.
 *
 * Each app_line_put writes from `at` on and returns where the next text goes; an answer fits APP_LINE_SIZE with its checksum. */
#ifndef APP_LINE_H
#define APP_LINE_H

#include "app/app.h"

/** 1 if the line ends in its checksum, which is then cut off; 0 without one, or with a wrong one. */
uint16_t app_line_is_right(char *line) APP_CALLS;

/** 1 if the line is this word. */
uint16_t app_line_is(const char *line, const char *word) APP_CALLS;

/** 1 if the line is this word, a blank, and a whole number within -32767..32767, which goes to `number`. */
uint16_t app_line_number(const char *line, const char *word, int16_t *number) APP_CALLS;

/** A text. */
char *app_line_put(char *at, const char *text) APP_CALLS;

/** A text and a number behind it. */
char *app_line_put_number(char *at, const char *text, int16_t number) APP_CALLS;

/** A text and the fault's name behind it: "fault STALL". */
char *app_line_put_fault(char *at, const char *text, uint16_t fault) APP_CALLS;

/** The checksum behind a line. @param line its begin @param end where the last app_line_put has left off */
void app_line_end(const char *line, char *end) APP_CALLS;

#endif
