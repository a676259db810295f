/* What an application calls, as the board sees it: the serial line of one that has it (app/line.h). Nothing where APP_SERIAL is 0. */
#ifndef BOARD_APP_CALLS_H
#define BOARD_APP_CALLS_H

#include "app/app.h"

#if APP_SERIAL
/** Nothing heard, nothing to say. */
void app_line_init(void);

/** Each pass of the background: a character that has come. A complete line waits for the application; meanwhile the receiver keeps four characters. */
void app_line_hear(void);

/** What the application hears: a complete line without its end, or 0. */
char *app_line_heard(void);

/** After its call: the line heard is used up, and this one is to be said; 0: none. */
void app_line_say(const char *text);

/** The line to be sent, copied to `line` with its end; nothing without one. @return the text's end */
char *app_line_next(char *line);
#else
#define app_line_init() ((void)0)
#define app_line_hear() ((void)0)
#define app_line_next(line) (line)
#endif

#endif
