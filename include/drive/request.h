/* What is wished of the drive: by the application, or by a client of the serial line in its place; the retry wishes again what a fault has ended. */
#ifndef DRIVE_REQUEST_H
#define DRIVE_REQUEST_H

#include "control/qmath.h"
#include "drive/forward.h"
#include "drive/param_scaling.h"

/* ---- What a client on the serial line asks: nothing where SCOPE is 0 ---- */

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

/* ---- What the application, or the client in its place, wishes of the drive ---- */

/** What the application asks for in a pass. */
typedef struct {
    int16_t run;           /**< 1: run; 0: stop in order */
    int16_t target_erpm;   /**< speed target, signed, electrical rpm (counts of SPEED_UNIT of them); TORQUE_MODE: q current, Q13 */
    uint16_t clear_fault;  /**< 1: one request */
    uint16_t take_command; /**< 1: from a client of the serial line */
    uint16_t elapsed_ms;   /**< since the last pass, 1 or more */
    REMOTE_INPUT
} asked_t;

/** What is wished. */
struct request {
    int16_t wish_run;    /**< the motor is to run */
    int16_t interrupted; /**< a fault has ended a run that is still wished. For the retry: 0 without */
    int16_t asked_run;   /**< what the application asked for a pass before */
    uint16_t kept;       /**< complement of wish_run: a flipped bit would start the motor */
};

/** Nothing is wished. */
void request_init(request_t *request);

/** 1 if the wish is as it was written. The self-test of VARIABLES asks. */
uint16_t request_holds(const request_t *request);

/** 1 while a run is wished, also one that a fault has ended and the retry will begin again. */
int16_t request_stands(const request_t *request);

/** A pass of the background: what is asked becomes the drive's command. A start is a change of run from 0 to 1 without a fault. */
void request_tick(request_t *request, drive_t *d, const drive_params_t *p, const asked_t *asked);

/* ---- the retry: a run that a passing fault has ended starts again by itself, after a pause and a stated number of times ---- */

/** State of the retry. */
typedef struct {
    uint16_t left;      /**< retries left before a fault stays */
    uint16_t first;     /**< drive_fault_t that began it; FAULT_NONE: nothing to tell */
    uint16_t fault;     /**< the one that the pause is for */
    uint16_t asked;     /**< 1: the fault has been asked to go */
    uint32_t waited_ms; /**< in the pause, or in closed loop since the last fault */
} retry_t;

/** 1 for a fault that may pass by itself (drive/faults.h). */
uint16_t retry_may_pass(uint16_t fault);

/** All retries left. */
void retry_init(retry_t *r);

/** A pass of the background, after request_tick(): it clears a fault and wishes a run again. RETRY_COUNT 0: never. */
void retry_tick(retry_t *r, request_t *request, drive_t *d, uint16_t elapsed_ms);

#endif
