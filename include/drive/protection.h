/* Protection: the conditions that the control interrupt finds itself and that end in a fault. */
#ifndef DRIVE_PROTECTION_H
#define DRIVE_PROTECTION_H

#include "control/qmath.h"
#include "drive/forward.h"

/** Over-current of any phase, every period with the bridge on. @return 1 then: the law must not run */
uint16_t protection_check_current(drive_t *d, const drive_params_t *p);

/** Over-voltage at once, under-voltage filtered, both while anything is on: at rest a rotor may charge the bus, but no further than what can be
 *  measured. Slots 1, 5, 9, 13. @param now_q15 unfiltered @param bus_q15 filtered */
void protection_check_bus(drive_t *d, const drive_params_t *p, int16_t now_q15, int16_t bus_q15);

/** 1 where no flux within the header's tolerances explains the q back-EMF: what dead time, and R and L within theirs, may put into it is taken off first.
 *  With E = Eq as the model sees it, k the change of 1/Kphi, F the most flux and V_dead what dead time makes of it:
 *  E - V_dead - (R's part) - (L's part) > F E (1 + k), here divided by F, with a fifth more of the three parts.
 *  Where the motor brakes R i lowers the voltage, and the least R counts. */
uint16_t protection_flux_is_impossible(const drive_run_t *run, const drive_params_t *p);

/** What the motor has shown against the header must be possible: the flux within its tolerance, and a winding that has gained 60 % of its
 *  resistance is too hot. Slot 14 in closed loop. */
void protection_check_model(drive_t *d, const drive_params_t *p);

/** 1 where a resistance within the header's tolerance and dead time would explain the whole back-EMF: the rotor may stand, for a voltage in phase
 *  with the current is both. */
uint16_t protection_rotor_is_doubtful(const drive_run_t *run, const drive_params_t *p);

/** Speed along the direction below which the rotor counts as stalled: half the reference, or of a low one half the minimum speed. */
speed_erpm_t protection_least_speed(const drive_run_t *run, const drive_params_t *p);

/** The probe whether the rotor turns. */
typedef enum {
    PROBE_WAIT, /**< until the rotor may stand though it seems to turn */
    PROBE_TEST, /**< d current flows: a standing rotor's estimate falls */
    PROBE_PAUSE /**< until the next one */
} probe_phase_t;

/** The most d current of a probe: it leaves the q current that flows, but for a tenth of the largest. A salient motor needs more q current beside
 *  it: half of each step's change is taken, which comes to the current that fits. */
current_q13_t protection_probe_most(const drive_run_t *run, const drive_params_t *p);

/** Where the rotor may stand, as much d current as q current: a standing rotor's estimate, (Eq - Ed)/Kphi of what R i leaves, falls to
 *  nothing and is a stall; a turning one does not care. It begins when the rotor seems to turn, waits for the stall while E has the
 *  current's direction, and comes again: soon after a dip of the speed. Slot 6 in closed loop. */
void protection_probe_rotor(drive_t *d, const drive_params_t *p);

/** Stall and lost lock: conditions that must not last. Slots 7, 15 in closed loop. */
void protection_check_rotor(drive_t *d, const drive_params_t *p);

/* ---- I2t: the heat that the current leaves in the winding, for motors whose sheet gives a thermal time constant ----
 *
 *     dh/dt = (i_d^2 + i_q^2 - h) / I2T_TIME_SEC,  too hot from h = I2T_CURRENT_A^2
 *
 * A cold winding stands k times the current for -T ln(1 - 1/k^2). The resistance that the drive learns tells the same more slowly and of any
 * motor; it sees the housing, too. */

#define OVERLOAD_STEP_MS 512u /**< a mean over so long makes a step of the heat */

/** Heat of the winding. Zero is a valid start: a cold motor. A reset forgets it. */
typedef struct {
    int32_t heat_q25; /**< square of the current that would keep the winding as hot, Q13 counts^2 / 2 */
    uint32_t sum;     /**< of the step: i^2 / 1024 times ms */
    uint16_t ms;      /**< of the step */
} overload_t;

/** A pass of the background. Between runs the winding cools. @param ms since the last pass @return 1 while a running motor is too hot */
uint16_t overload_tick(overload_t *o, const drive_t *d, const drive_params_t *p, uint16_t ms);

#endif
