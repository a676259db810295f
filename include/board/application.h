/* The seam between the application's room and the drive: what it is told, what it asks, and how long it may take. And what it calls, as the board sees it:
 * the serial line of one that has it (app/line.h), the pulses of one that is told of them (app/pulse.h); nothing where APP_SERIAL and APP_PULSE are 0. */
#ifndef BOARD_APPLICATION_H
#define BOARD_APPLICATION_H

#include "app/app.h"

/** The potentiometer. */
extern pot_t board_pot;

/** After a reset. */
void application_init(void);

/** A pass of the background: the application decides. Its lights are on their pins afterwards. */
void application_tick(uint16_t elapsed_ms);

/** Each pass of the slow work: an application that does not return is late after APP_LATE_MS. Then the drive stops in order, for APPLICATION_STOP_SEC at most, and
 *  then the fault is APPLICATION, also where it has returned meanwhile. If it does not, the watchdog, which has been served until then, resets the processor. */
void application_watch(void);

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

#if APP_PULSE
/** Timer 3 and the captures of both edges, after pins_init(). */
void app_pulse_init(void);

/** Each pass of the background: an edge that has come. @param ticks of the drive */
void app_pulse_look(uint16_t ticks);

/** What the application is told: the last pulse since the call before. */
void app_pulse_take(app_told_t *told);
#else
#define app_pulse_init() ((void)0)
#define app_pulse_look(ticks) ((void)0)
#define app_pulse_take(told) ((void)0)
#endif

#endif
