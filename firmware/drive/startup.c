/* The start without the estimator: average the current offsets, charge the drivers, take the rotor along, accelerate it by the forced angle. */
#include "drive/startup.h"

#include "control/tuned.h"
#include "drive/drive.h"
#include "drive/held.h"
#include "drive/protection.h"

drive_state_t calibration_step(drive_t *d, const drive_params_t *p, int16_t i_a, int16_t i_b)
{
    calibration_t *c = &d->calibration;
    c->sum_a += i_a;
    c->sum_b += i_b;
    d->periods++;
    if (d->periods == (1u << CALIBRATION_LOG2)) {
        int16_t a_q13 = qm_mulhi((int16_t)(c->sum_a >> CALIBRATION_LOG2), p->kcurr_a);
        int16_t b_q13 = qm_mulhi((int16_t)(c->sum_b >> CALIBRATION_LOG2), p->kcurr_b);
        if (qm_beyond(a_q13, p->offset_max_q13) || qm_beyond(b_q13, p->offset_max_q13)) {
            drive_raise(d, FAULT_OFFSET);
        } else {
            c->offset_a_q13 = a_q13;
            c->offset_b_q13 = b_q13;
            SELFTEST_KEEP(d, offset_a, a_q13);
            SELFTEST_KEEP(d, offset_b, b_q13);
            c->done = 1;
            return DRIVE_STOPPED;
        }
    }
    return DRIVE_CALIBRATE;
}

void calibration_restart(calibration_t *c)
{
    c->sum_a = 0;
    c->sum_b = 0;
}

drive_state_t startup_bootstrap(drive_t *d, const drive_params_t *p)
{
    (void)protection_check_current(d, p); /* a fault that it raises keeps every state out */
    d->periods++;
    if (!d->command.run) {
        return DRIVE_STOPPED;
    }
    return (d->periods >= p->bootstrap_periods) ? DRIVE_ALIGN : DRIVE_BOOTSTRAP;
}

void startup_ramp_from_here(drive_t *d, const drive_params_t *p)
{
    drive_run_t *run = &d->run;
    drive_control_t *c = &run->control;
    angle_t quarter = (angle_t)along_direction(d, 0x4000), estimated = estimator_next_angle(&run->estimator);
    angle_t forced = (angle_t)(estimated - quarter);
    dq_t v = c->v_q14;
    held_forget(&run->held); /* the ramp's estimator must see the rotor */
    run->handover.agreed_steps = 0;
    run->handover.at_end = 0;
    run->handover.ahead_erpm = 0;
    run->handover.offset = 0;
    run->handover.id_q13 = 0;
    c->flux_brake_q13 = 0;
    d->forced.speed_q10 = qm_mulss(along_direction(d, run->estimator.omega_erpm), p->estimator.deltat_q32) >> 6;
    d->forced.angle_q32 = (uint32_t)forced << 16;
    d->forced.increase_q10 = p->forced.increase_rate_q10;
    c->v_q14.d = along_direction(d, (int16_t)-v.q); /* the same vector in a frame a quarter turn behind */
    c->v_q14.q = along_direction(d, v.d);
    c->ref_q13.d = 0;
    c->ref_q13.q = along_direction(d, p->open_loop_q13);
    handover_preset(d, p, forced);
    handover_enter(&run->handover, START_RAMP);
    drive_enter(d, DRIVE_RAMP);
}

/** A turn of ALIGN is over: its mean, and the rise to it. */
static void align_turn_ends(align_t *a)
{
    uint16_t mean = ((uint16_t)(a->sum_q14 >> 16) < a->steps) ? qm_divud(a->sum_q14, a->steps) : 0u;
    int16_t rise = (int16_t)((int16_t)(mean & 0x7FFFu) - a->mean_q14); /* the mean of positive words */
    if (a->turns == 1u) {                                              /* the first turn rose from nothing */
        a->least_q14 = INT16_MAX;
        a->second_q14 = INT16_MAX;
    }
    a->second_q14 = qm_clamp(rise, a->least_q14, a->second_q14);
    a->least_q14 = (rise < a->least_q14) ? rise : a->least_q14;
    a->mean_q14 = (int16_t)(mean & 0x7FFFu);
    a->turns++;
    a->sum_q14 = 0;
    a->steps = 0;
}

/** A step of the measure of R. */
static void align_measure(drive_t *d)
{
    align_t *a = &d->run.align;
    angle_t turned = (angle_t)((d->direction > 0) ? d->angle : 65536ul - d->angle);
    int16_t v = along_direction(d, d->run.control.v_q14.q);
    if (turned < a->turned) {
        align_turn_ends(a);
    }
    a->turned = turned;
    a->steps++;
    if (v > 0) { /* before the first period with the law there is neither voltage nor limit */
        a->sum_q14 += (uint16_t)v;
        a->is_limited |= (uint16_t)(v >= d->run.control.vq_limit_q14);
    }
}

/** All turns are over: R of the estimator follows, within the bounds of what may be learnt. */
static void align_teaches(drive_run_t *run, const drive_params_t *p)
{
    align_t *a = &run->align;
    uint16_t header = (uint16_t)p->align_rise_q14, rise, off;
    align_turn_ends(a);
    rise = (uint16_t)a->second_q14;
    if (header == 0u || a->is_limited || a->turns < PARAM_ALIGN_TURNS || a->second_q14 <= 0) {
        return;
    }
    off = (uint16_t)((rise < header) ? header - rise : rise - header);
    off = (uint16_t)((off < header) ? qm_share(off, header) : INT16_MAX);
    run->adaptation.rs_q31 = qm_clamp_hi((int32_t)((rise < header) ? -(int16_t)off : (int16_t)off) * 65536, p->adaptation.rs_least, p->adaptation.rs_most);
}

void startup_align(drive_t *d, const drive_params_t *p)
{
    int16_t current = p->open_loop_q13;
    d->periods = (uint16_t)(d->periods + SLOW_PERIODS);
    if (d->periods < p->align_periods) {
        align_measure(d);
        current = (int16_t)(qm_muluu(d->periods, p->align_rate_q12) >> 12);
    } else {
        align_teaches(&d->run, p);
        d->forced.increase_q10 = p->forced.increase_rate_q10;
        handover_enter(&d->run.handover, START_RAMP);
        drive_enter(d, DRIVE_RAMP);
    }
    d->run.control.ref_q13.q = along_direction(d, current);
}
