/* IDENTIFY, the interrupt's part: one PWM period of holding, injecting or turning a vector, or of following the rotor, and of adding up. */
#ifndef DRIVE_MODES_IDENTIFY_TICK_H
#define DRIVE_MODES_IDENTIFY_TICK_H

#include "drive/state.h"

#ifdef IDENTIFY

#define IDENTIFY_START_ANGLE_Q32 0xD5555555ul                                          /**< -60 degrees: all three phases carry current */
#define IDENTIFY_SWEEP_Q32 ((uint32_t)(715827882.0F / (0.5F / PARAM_F(LOOPTIME_SEC)))) /**< to phase A within half a second */

/** Largest voltage that holds a current: the rest is for the square voltage. */
QM_INLINE voltage_q14_t identify_most(const voltage_circle_t *circle)
{
    return (int16_t)(circle->limit_q14 - (circle->limit_q14 >> 2));
}

/** Filtered bus, Q16 of full scale. */
QM_INLINE uint16_t identify_bus(const drive_t *d)
{
    return (uint16_t)((uint32_t)d->bus_q31 >> 15);
}

/** Current along the axis of the square voltage, in counts that both axes share: phase A, or A + 2 B = sqrt(3) beta. */
QM_INLINE int16_t identify_current(const drive_t *d)
{
    return (int16_t)(d->run.identify.on_q ? d->phases_q13.a + 2 * d->phases_q13.b : d->phases_q13.a);
}

/** Duties along the same axis: three times the alpha voltage, or sqrt(3) times three times the beta voltage, over the bus. */
QM_INLINE int16_t identify_duty(const identify_t *id, const duties_t *duty)
{
    int16_t b = (int16_t)duty->b, c = (int16_t)duty->c;
    return (int16_t)(id->on_q ? 3 * (b - c) : 2 * (int16_t)duty->a - b - c);
}

/** Moves the frame along with the rotor. As in the estimator (Equation 2), the sum of both components is the speed; a frame that leads has
 *  a negative speed of its own. The voltage that was commanded a period ago is centred on this sample, whose frame this still is. */
QM_INLINE void identify_follow(drive_t *d)
{
    identify_t *id = &d->run.identify;
    int32_t emf = (int32_t)d->run.control.v_q14.q - id->drop_q_q14 - d->run.control.v_q14.d - id->drop_d_q14;
    id->emf_q22 += (emf * 256 - id->emf_q22) >> 2; /* 0.9 kHz */
    emf = id->emf_q22 >> 8;
    emf = (emf < 0) ? 0 : (emf > 32767) ? 32767
                                        : emf;
    d->forced.speed_q10 = (int32_t)(qm_muluu((uint16_t)emf, id->speed_per_emf_q5) >> 5);
    d->forced.angle_q32 = qm_turn_add(d->forced.angle_q32, (uint32_t)d->forced.speed_q10 << 6);
}

/** Moves the frame. @return 1 when it stands or has reached its speed */
QM_INLINE uint16_t identify_turn(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    uint16_t settled = 1;
    if (id->mode == (uint16_t)IDENTIFY_TURN) {
        forced_angle_params_t to = p->forced;
        to.end_speed_q10 >>= id->halvings;
        if (d->state == (uint16_t)DRIVE_ALIGN) {
            drive_enter(d, DRIVE_RAMP);
        }
        settled = (uint16_t)forced_angle_accelerate(&d->forced, &to, 1, 1);
        forced_angle_move(&d->forced);
    } else if (id->mode == (uint16_t)IDENTIFY_FOLLOW) {
        identify_follow(d);
    } else if (id->sweep) {
        d->forced.angle_q32 = qm_turn_add(d->forced.angle_q32, IDENTIFY_SWEEP_Q32);
        settled = 0;
        if (d->forced.angle_q32 < IDENTIFY_START_ANGLE_Q32) {
            d->forced.angle_q32 = 0;
            id->sweep = 0;
        }
    }
    return settled;
}

/** Sign of the square voltage in the next period. */
QM_INLINE int16_t identify_square(identify_t *id)
{
    int16_t sign = (int16_t)((id->sign < 0) ? -1 : 1);
    if (id->half_left == 0u) {
        id->half_left = id->half;
        sign = (int16_t)-sign;
    }
    id->half_left--;
    return sign;
}

/** Next voltage in the frame. @param sign of the square voltage */
QM_INLINE dq_t identify_voltage(drive_t *d, int16_t sign)
{
    identify_t *id = &d->run.identify;
    drive_control_t *c = &d->run.control;
    pi_gains_t gains_d, gains_q;

    if (id->mode == (uint16_t)IDENTIFY_INJECT) {
        dq_t v;
        v.d = id->bias_q14;
        v.q = 0;
        if (id->on_q) {
            v.q = (int16_t)(sign * id->square_q14);
        } else {
            v.d = (int16_t)(v.d + sign * id->square_q14);
        }
        return v;
    }
    if (id->mode == (uint16_t)IDENTIFY_GROW && !id->ready && (d->ticks & 15u) == 0u) {
        c->pi_d.sum += c->pi_d.sum >> 7;
    }
    gains_d.kp = id->kp_d;
    gains_d.ki = id->ki_d;
    gains_d.kc = Q15(0.999);
    gains_d.shift = id->shift;
    gains_q = gains_d;
    gains_q.kp = id->kp_q;
    gains_q.ki = id->ki_q;
    return current_control(&c->pi_d, &gains_d, &c->pi_q, &gains_q, c->ref_q13, c->i_q13, &d->circle, &c->vq_limit_q14);
}

/** One period of sums.
 *
 *  Standing: duties along phase A less the dead-time compensation in them, current of phase A, of phase B, and the bus.
 *  Square voltage: with the sign s as instrument, duties, currents and current differences. A voltage commanded at sample n acts for
 *  one period from the boundary after it, half of it before sample n+1 and half after; so between the last two samples acted
 *  the mean of the vectors commanded one and two periods before this one; where their signs differ it says nothing, else both are
 *  alike.
 *  Turning: voltage d and q (centred on the sample, as commanded a period ago), current d and q.
 *  Following: speed, q current. */
QM_INLINE void identify_add(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    int16_t i_q13 = identify_current(d);
    if (id->mode == (uint16_t)IDENTIFY_TURN) {
        id->sum[0] += d->run.control.v_q14.d;
        id->sum[1] += d->run.control.v_q14.q;
        id->sum[2] += d->run.control.i_q13.d;
        id->sum[3] += d->run.control.i_q13.q;
    } else if (id->mode == (uint16_t)IDENTIFY_FOLLOW) {
        id->sum[0] += d->forced.speed_q10;
        id->sum[1] += d->run.control.i_q13.q;
    } else if (id->mode != (uint16_t)IDENTIFY_INJECT) {
        id->sum[0] += id->duty - 4 * p->svm.dead_time;
        id->sum[1] += i_q13;
        id->sum[2] += d->phases_q13.b;
        id->sum[3] += identify_bus(d);
    } else if (id->sign == id->sign_before) {
        int16_t s = id->sign;
        int32_t duties = 2 * (int32_t)id->duty;
        id->sum[0] += s * duties;
        id->sum[1] += s * ((int32_t)i_q13 + id->i_before_q13);
        id->sum[2] += s * ((int32_t)i_q13 - id->i_before_q13);
    } else {
        /* the mean is no square voltage */
    }
}

/** Waits, then adds up, then hands over to the background. @param settled the frame stands or has its speed */
QM_INLINE void identify_record(drive_t *d, const drive_params_t *p, uint16_t settled)
{
    identify_t *id = &d->run.identify;
    uint16_t done = 0;
    if (id->ready || !settled) {
        return;
    }
    if (id->mode == (uint16_t)IDENTIFY_GROW) {
        done = (uint16_t)(d->run.control.i_q13.d >= id->rise_q13 || d->run.control.v_q14.d >= identify_most(&d->circle));
    } else if (id->wait != 0u) {
        id->wait--;
    } else {
        identify_add(d, p);
        id->left--;
        done = (uint16_t)(id->left == 0u);
    }
    if (done) {
        id->bus_q16 = identify_bus(d);
        id->at = d->ticks;
        id->ready = 1;
    }
}

/** Modulation. Dead time is compensated for the currents that are asked for at the centre of the pulse, not for the measured ones:
 *  those are a period older, and compensation that follows them makes a phase's current stick at zero for a while. Turning, that
 *  costs up to 0.3 V across the current, which is where the back-EMF is; standing, the first current would come with a jump. */
QM_INLINE void identify_duties(const drive_t *d, const drive_params_t *p, duties_t *duty)
{
    phases_t asked = phases_of(d->run.control.ref_q13, d->frame);
    dead_duties_t dead;
    svm_compensation(&p->svm, asked, &dead);
    svm(&p->svm, inverse_park(d->run.control.v_q14, d->frame), d->duty_per_volt_q16, &dead, &asked, duty);
}

/** A period with the bridge switching; S2 stops at once. */
NOINLINE void identify_run(drive_t *d, const drive_params_t *p, duties_t *duty)
{
    identify_t *id = &d->run.identify;
    drive_control_t *c = &d->run.control;
    int16_t sign;

    c->i_q13 = park(clarke(d->phases_q13.a, d->phases_q13.b), d->frame);
    identify_record(d, p, identify_turn(d, p));
    sign = identify_square(id);
    c->v_q14 = identify_voltage(d, sign);
    d->angle = forced_angle(&d->forced);
    d->frame = trig_sincos(d->angle);
    identify_duties(d, p, duty);
    id->sign_before = id->sign;
    id->sign = sign;
    id->duty = identify_duty(id, duty);
    id->i_before_q13 = identify_current(d);
    if (!d->command.run) {
        drive_enter(d, DRIVE_STOPPED);
    }
}

/** Prepares the first step. */
void identify_start(drive_t *d, const drive_params_t *p);

/** The background's part: evaluates a finished step and asks for the next one. Once a millisecond.
 *  @return 1 when the procedure is not running: the bridge is to be off */
uint16_t identify_background(drive_t *d, const drive_params_t *p);

#endif

/** A pass of the background. @return 1 when the motor is to stop */
QM_INLINE uint16_t mode_background(drive_t *d, const drive_params_t *p)
{
#ifdef IDENTIFY
    return identify_background(d, p);
#else
    (void)d;
    (void)p;
    return 0;
#endif
}

#endif
