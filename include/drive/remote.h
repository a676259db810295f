/* What a client on the serial line asks of the drive: nothing where SCOPE is 0. */
#ifndef DRIVE_REMOTE_H
#define DRIVE_REMOTE_H

#include "control/qmath.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

/** A client's command. It writes the first five: mode, target and lease, then run; lease_ms again before it runs out. */
struct remote {
    uint16_t mode;        /**< who is in command, REMOTE_MODE_TABLE */
    uint16_t run;         /**< changed to 1: start; 0: stop in order */
    int16_t target_erpm;  /**< speed target, signed, electrical rpm (counts of SPEED_UNIT of them); TORQUE_MODE: q current, Q13 */
    uint16_t clear_fault; /**< 1: one request */
    uint16_t lease_ms;    /**< how long all this holds, 5000 at most; counts down, and at 0 the panel is in command again */
    uint16_t is_taken;    /**< 1: the client is in command */
    uint16_t seen_run;    /**< run a pass before */
    uint16_t has_started; /**< 1: the run is the client's */
};

/** Member of asked_t. */
#if SCOPE
#define REMOTE_INPUT remote_t *remote; /**< what a client asks for */
#else
#define REMOTE_INPUT
#endif

#define REMOTE_LEASE_MOST_MS 5000u

/** X(number, name, meaning): who is in command. */
#define REMOTE_MODE_TABLE(X) \
    X(0, PANEL, "buttons and potentiometer") \
    X(1, TARGET, "the client starts, stops and sets the target") \
    X(2, START, "the client starts and stops, the potentiometer sets the target")

#define REMOTE_MODE(number, name, meaning) REMOTE_##name = (number),

enum { REMOTE_MODE_TABLE(REMOTE_MODE) REMOTE_MODE_COUNT };

#if SCOPE
/** The panel is in command. */
void remote_init(remote_t *r);

/** 1 while a client is in command. */
uint16_t remote_is_in_command(const remote_t *r);

/** Somebody has pressed S2: the panel is in command again, and what it wishes holds. */
void remote_give_up(remote_t *r);

/** A pass of the background, after the buttons: their wishes become the client's. At the lease's end the panel is in command again; a run that the
 *  client has started then ends in order. */
void remote_tick(remote_t *r, request_t *request, drive_t *d, uint16_t elapsed_ms);

/** The target in command, of any size. @param of_panel the application's */
int16_t remote_target(const remote_t *r, int16_t of_panel);
#else
#define remote_give_up(r) ((void)0)
#define remote_tick(r, request, d, elapsed_ms) ((void)0)
#define remote_target(r, of_panel) (of_panel)
#define remote_is_in_command(r) (0)
#endif

#endif
