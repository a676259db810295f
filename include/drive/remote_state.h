/* What a client on the serial line asks of the drive: nothing where SCOPE is 0. */
#ifndef DRIVE_REMOTE_STATE_H
#define DRIVE_REMOTE_STATE_H

#include "drive/param_scaling.h" /* SCOPE */

/** A client's command. It writes the first five: mode, target and lease, then run; lease_ms again before it runs out. */
typedef struct {
    uint16_t mode;        /**< who is in command, REMOTE_MODE_TABLE */
    uint16_t run;         /**< changed to 1: start; 0: stop in order */
    int16_t target_erpm;  /**< speed target, signed, electrical rpm (counts of SPEED_UNIT of them); TORQUE_MODE: q current, Q13 */
    uint16_t clear_fault; /**< 1: one request */
    uint16_t lease_ms;    /**< how long all this holds, 5000 at most; counts down, and at 0 the panel is in command again */
    uint16_t is_taken;    /**< 1: the client is in command */
    uint16_t seen_run;    /**< run a pass before */
    uint16_t has_started; /**< 1: the run is the client's */
} remote_t;

/** Member of panel_inputs_t. */
#if SCOPE
#define REMOTE_INPUT remote_t *remote; /**< what a client asks for */
#else
#define REMOTE_INPUT
#endif

#endif
