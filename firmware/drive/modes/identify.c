/* IDENTIFY: the drive measures R, Ld, Lq, Kphi, inertia and friction of an unknown motor. */
#include "drive/modes/identify.h"

#include "control/transforms.h"
#include "drive/drive.h"
#include "drive/states.h"

#ifdef IDENTIFY

#define SETTLE_PERIODS PARAM_PERIODS(0.4F) /* ten time constants of the slow current controller */
#define SLOW_LOOP_RAD_S 25.0F              /* slow enough for R/L from 10 rad/s up, fast enough for SETTLE_PERIODS */
#define LEAST_CURRENT_Q13 64               /* of the division by a current: above the factor 25 rad/s LOOPTIME 2^14, which is below 58 */
#define SLOW_SHIFT 14u
#define LOOP_RAD_S (2.0F * PARAM_PI * 200.0F)                                                       /* current loops while turning */
#define LOOP_Q10 ((uint32_t)(LOOP_RAD_S / (2.0F * PARAM_PI) * PARAM_F(LOOPTIME_SEC) * 67108864.0F)) /* as speed, 1/1024 angle counts a period */
#define LOOP_SHIFT 10u
#define MEAN_LOG2 12 /* periods of a mean at standstill */
#define TRY_HALVES 64u
#define INDUCTANCE_PERIODS 8192u
#define HALF_FIRST 4u /* periods of half a square wave: short, so that the rotor does not answer */
#define HALF_LAST 64u
#define BLOCK_LOG2 5  /* periods of a stretch of back-EMF: short against the rotor's swinging */
#define BLOCKS_LOG2 8 /* stretches: many swings */
#define BLOCKS 256u
#define FOLLOW_LOG2 5          /* periods of a stretch while accelerating and coasting, first */
#define FOLLOW_MOST 9u         /* and of a rotor that takes long: its speed hardly changes within one */
#define LONGER_EVERY 512u      /* stretches */
#define LONGER_BELOW 0x100000l /* of the top speed: the sum of a stretch fits into 32 bits */
#define FOLLOW_SETTLE 6u       /* first stretches after a change of current: the frame's angle changes by what dead time takes */
#define SETTLE_MOST 192u       /* an eighth of how long such a phase lasts, up to 0.3 s: the bus, too, is another one then */
#define DOUBLE_UNITS 200u      /* first stretches, a third of a second, after which the current is doubled: much current outweighs what samples miss */
#define PUSH_UNITS 1250u       /* and 2 s, in which all of it must bring 1/128 of the top speed */
#define PUSH_LEAST 20u         /* stretches: fewer, and less current pushes the next time */
#define GENTLER_MOST 16u       /* times: to a hundredth of the current */
#define COAST_UNITS 6250u      /* 10 s: a rotor without friction coasts for ever */
#define UNITS_MOST 60000u      /* a minute and a half */
#define PART_UNITS 4096        /* more count half: the sums fit into 32 bits */
#define PASSAGE_MOST 64u       /* stretches of one line: its sums fit into 32 bits */
#define CYCLES_LEAST 5u
#define CYCLES_MOST 32u
#define LEAST_UOHM 5000u
#define MOST_UOHM 40000000ul
#define LEAST_NH 5000u
#define MOST_NH 60000000ul
#define LEAST_UV 100000ul
#define MOST_UV 2000000000ul
#define RIPPLE_PER_MISSED 5                                                                                                                      /* half of the ripple, E (1 - m) T / (4 L), over what a sample misses, at m = 0.4 */
#define DEAD_EMF_Q14 ((uint16_t)(2.0F / PARAM_PI * PARAM_F(NOMINAL_BUS_V) * PARAM_F(DEADTIME_SEC) / PARAM_F(LOOPTIME_SEC) / NORM_VOLTAGE_CONST)) /* what it takes */
#define LEAST_INERTIA 50u
#define MOST_INERTIA 2000000000ul
#define MOST_FRICTION 300000000l
#define COAST_PERIODS PARAM_PERIODS(1.0F)                                               /* enough, with CYCLES_LEAST; four times as many with two */
#define REST_MOST 300u                                                                  /* means until the rotor counts as resting: a minute */
#define SWING_LOG2 6                                                                    /* periods of the filter of the back-EMF along the current, 3 ms */
#define SWING_MEAN_LOG2 13                                                              /* and of its mean, 0.4 s: heavy rotors swing with 2 rad/s and more */
#define SWING_GAIN 2                                                                    /* speed by voltage: damps with 20 rad/s where the back-EMF is 0.4 of the circle, as END_SPEED_RPM is to be chosen */
#define RAMP_END_SHIFT 11                                                               /* of what is left of a ramp: its end takes a tenth of a second, and longer as the ramps become slower */
#define RAMPS_MOST 4u                                                                   /* each with a quarter of the acceleration of the one before */
#define FASTEST_Q10 ((int32_t)(30000.0F * PARAM_F(LOOPTIME_SEC) / 60.0F * 67108864.0F)) /* electrical rpm that every format holds */

/* ---- Constants from the board's parameters ---- */
#define TS_US (PARAM_F(LOOPTIME_SEC) * 1000000.0F)

/* uohm for a bus of 1 (Q16) and one duty count along phase A per current count. */
#define UOHM_PER_RATIO (1000000.0F * PARAM_F(BUS_FULL_SCALE_V) / (65536.0F * 3.0F * (float)PWM_FULL_DUTY * 4.0F * PARAM_F(NORM_CURRENT_CONST)))
#define C_RESISTANCE soft_float_scaled((uint32_t)(UOHM_PER_RATIO * 65536.0F), 16)

/* The sums of duties are sums of two. */
#define C_INDUCTANCE soft_float_scaled((uint32_t)(UOHM_PER_RATIO * TS_US / 2000.0F * 1048576.0F), 20)
#define C_TS soft_float_scaled((uint32_t)(TS_US / 1000.0F * 16777216.0F), 24) /* nH per uohm */
#define C_KP soft_float_scaled((uint32_t)(LOOP_RAD_S * 0.000000001F * 2.0F * PARAM_IU * (float)(1u << LOOP_SHIFT) * 17179869184.0F), 34)
#define C_KI soft_float_scaled((uint32_t)(LOOP_RAD_S * 0.000001F * PARAM_F(LOOPTIME_SEC) * 2.0F * PARAM_IU * (float)(1u << LOOP_SHIFT) * 274877906944.0F), 38)
#define C_OHMIC soft_float_scaled((uint32_t)(0.000001F * 2.0F * PARAM_IU * 4398046511104.0F), 42) /* Q13 current to Q14 voltage per uohm */

/* The same per nH and 1/1024 angle count a period. */
#define C_REACTIVE soft_float_scaled((uint32_t)(0.000000001F * 2.0F * PARAM_PI / 67108864.0F / PARAM_F(LOOPTIME_SEC) * 2.0F * PARAM_IU * 73786976294838206464.0F), 66)

/* uV line to line per 1000 rpm, from Q14 voltage over 1/1024 angle counts a period. */
#define C_KPHI soft_float_scaled((uint32_t)(PARAM_SQRT3 * 2.0F * NORM_VOLTAGE_CONST * 1000000.0F * 67108864.0F * PARAM_F(LOOPTIME_SEC) \
                                            * PARAM_F(NOPOLESPAIRS) / 60.0F * 62.5F), \
                                 -4)

/* Torque of one count of q current for a Kphi of 1 uV/krpm, 10^-8 N m: 3/2 psi P i. */
#define TORQUE_PER_COUNT (100.0F * 1.5F * 60.0F / (2000.0F * PARAM_PI * PARAM_SQRT3) * 4.0F * PARAM_F(NORM_CURRENT_CONST))

/* Mechanical rad/s of 1/1024 angle count a period. */
#define RAD_S_PER_COUNT (2.0F * PARAM_PI / 67108864.0F / PARAM_F(LOOPTIME_SEC) / PARAM_F(NOPOLESPAIRS))

/* Currents are means * 2^FOLLOW_LOG2, accelerations counts a period * RATE_SCALE, speeds / 16. */
#define RATE_SCALE 32768.0F
#define C_TORQUE soft_float_scaled((uint32_t)(TORQUE_PER_COUNT / (float)(1u << FOLLOW_LOG2) * 1099511627776.0F), 40)
#define C_INERTIA soft_float_scaled((uint32_t)(TORQUE_PER_COUNT / (float)(1u << FOLLOW_LOG2) * 10.0F * RATE_SCALE * PARAM_F(LOOPTIME_SEC) \
                                               / RAD_S_PER_COUNT * 1048576.0F), \
                                    20)

#define C_DRAG soft_float_scaled((uint32_t)(RAD_S_PER_COUNT / PARAM_F(LOOPTIME_SEC) / RATE_SCALE / 10.0F * 1099511627776.0F), 40)
#define C_VISCOUS soft_float_scaled((uint32_t)(10.0F / (16.0F * RAD_S_PER_COUNT) * 256.0F), 8)

/* Sums of current over a stretch for a back-EMF of 1 uV/krpm, a speed / 16 and 1/nH that a sample misses which is taken so much late. */
#define MISSED(late_sec) \
    ((float)(16u << FOLLOW_LOG2) * RAD_S_PER_COUNT * 60000.0F / (2000.0F * PARAM_PI * PARAM_SQRT3) * (late_sec) \
     / (4.0F * PARAM_F(NORM_CURRENT_CONST)))

#define SAMPLE_LATE_SEC (PARAM_F(SAMPLE_DELAY_CLOCKS) * PWM_TICK_SEC)
#define C_MISSED_COASTING soft_float_scaled((uint32_t)(MISSED(SAMPLE_LATE_SEC) * 16777216.0F), 24)

/* With current, dead time delays one edge of every pulse, whatever the current's sign: its centre moves towards the sample. */
#define C_MISSED_PUSHING soft_float_scaled((uint32_t)(MISSED(PARAM_MAX(SAMPLE_LATE_SEC - 0.5F * PARAM_F(DEADTIME_SEC), 0.0F)) * 16777216.0F), 24)

/* ---- Requests to the interrupt ---- */

/** Sums anew: `periods` of them after `wait`. The last word of every step: from here on the interrupt owns the state. */
static NOINLINE void go(identify_t *id, identify_step_t step, uint16_t wait, uint16_t periods)
{
    int16_t n;
    for (n = 0; n < 4; n++) {
        id->sum[n] = 0;
    }
    id->wait = wait;
    id->left = periods;
    id->step = (uint16_t)step;
    id->ready = 0;
}

static NOINLINE void finish(drive_t *d, identify_result_t result)
{
    d->run.identify.result = (uint16_t)result;
    d->run.identify.step = (uint16_t)IDENTIFY_IDLE;
    d->command.run = 0;
}

void identify_start(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    id->result = (uint16_t)IDENTIFY_RESULT_BUSY;
    id->mode = (uint16_t)IDENTIFY_GROW;
    id->shift = SLOW_SHIFT;
    id->half = HALF_FIRST;
    id->half_left = HALF_FIRST / 2u;
    id->rise_q13 = (int16_t)(p->open_loop_q13 >> 1);
    d->run.control.pi_d.sum = (int32_t)16 << SLOW_SHIFT; /* about ten millivolts */
    d->run.control.ref_q13.d = id->rise_q13;
    d->run.control.ref_q13.q = 0;
    d->forced.speed_q10 = 0;
    d->forced.increase_q10 = p->forced.increase_rate_q10;
    d->forced.angle_q32 = IDENTIFY_START_ANGLE_Q32;
    d->angle = forced_angle(&d->forced);
    d->frame = trig_sincos(d->angle);
    go(id, IDENTIFY_RISE, 0, 1);
}

/* ---- Resistance ---- */

/** Voltage and current at the end of RISE give R well enough for a slow integral controller of any motor. */
static void rise_done(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    int16_t i_q13 = d->run.control.i_q13.d, v_q14 = d->run.control.v_q14.d;
    uint16_t ki;
    if (v_q14 >= identify_most(&d->circle)) {
        finish(d, (i_q13 < (p->open_loop_q13 >> 3)) ? IDENTIFY_RESULT_NO_CURRENT : IDENTIFY_RESULT_CURRENT_NOT_REACHED);
        return;
    }
    if (i_q13 < (id->rise_q13 >> 1)) {
        i_q13 = (int16_t)(id->rise_q13 >> 1); /* a current that breaks down now is found in the next step */
    }
    if (i_q13 < LEAST_CURRENT_Q13) {
        i_q13 = LEAST_CURRENT_Q13;
    }
    ki = qm_divud(qm_muluu((uint16_t)v_q14, (uint16_t)(SLOW_LOOP_RAD_S * PARAM_F(LOOPTIME_SEC) * 16384.0F + 0.5F)), (uint16_t)i_q13);
    id->ki_slow = (int16_t)((ki == 0u) ? 1u : ki); /* at most the voltage: what divides is larger than the factor */
    id->ki_d = id->ki_slow;
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    go(id, IDENTIFY_CONNECT, SETTLE_PERIODS, 1u << MEAN_LOG2);
}

/** 1 if the current is within an eighth of what was asked for; else the end of the procedure. @param mean_q13 along the frame's d axis */
static NOINLINE uint16_t current_reached(drive_t *d, int16_t mean_q13)
{
    int16_t ref_q13 = d->run.control.ref_q13.d;
    if (mean_q13 < (ref_q13 >> 2)) {
        finish(d, IDENTIFY_RESULT_NO_CURRENT);
        return 0;
    }
    if (mean_q13 < ref_q13 - (ref_q13 >> 3) || d->run.control.v_q14.d >= identify_most(&d->circle)) {
        finish(d, IDENTIFY_RESULT_CURRENT_NOT_REACHED);
        return 0;
    }
    return 1;
}

/** A heavy rotor swings for long, and its back-EMF is in current and voltage. 1 when the current across the axis is none or has not changed
 *  since the last mean; else the step's mean is taken anew. @param across sum of sqrt(3) times that current */
static NOINLINE uint16_t rests(drive_t *d, int32_t across)
{
    identify_t *id = &d->run.identify;
    int16_t now_q13 = (int16_t)(across >> MEAN_LOG2), before_q13 = id->across_q13;
    int16_t little_q13 = (int16_t)((d->run.control.ref_q13.d >> 9) + 4); /* half a step of the converter */
    id->across_q13 = now_q13;
    id->unrest++;
    if (qm_abs(now_q13) > little_q13 && qm_abs((int16_t)(now_q13 - before_q13)) > little_q13 && id->unrest < REST_MOST) {
        id->swung = (uint16_t)(id->swung | (id->unrest > 1u));
        go(id, (identify_step_t)id->step, 0, 1u << MEAN_LOG2);
        return 0;
    }
    id->across_q13 = 0;
    id->unrest = 0;
    return 1;
}

/** At -60 degrees phase B carries all of the current and A and C half of it each. */
static void connect_done(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    int16_t a_q13 = (int16_t)(id->sum[1] >> MEAN_LOG2), b_q13 = (int16_t)(id->sum[2] >> MEAN_LOG2);
    if (!rests(d, 2 * id->sum[1] + id->sum[2])) {
        return;
    }
    if (!current_reached(d, (int16_t)-b_q13)) {
        return;
    }
    if (qm_abs((int16_t)(2 * a_q13 + b_q13)) > (d->run.control.ref_q13.d >> 1)) {
        finish(d, IDENTIFY_RESULT_NO_CURRENT);
        return;
    }
    d->run.control.ref_q13.d = p->open_loop_q13;
    id->sweep = 1;
    go(id, IDENTIFY_ALIGN, SETTLE_PERIODS, 1u << MEAN_LOG2);
}

static void align_done(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    if (!rests(d, id->sum[1] + 2 * id->sum[2])) {
        return;
    }
    if (current_reached(d, (int16_t)(id->sum[1] >> MEAN_LOG2))) {
        id->duty_first = id->sum[0];
        id->i_first = id->sum[1];
        id->bus_first = id->sum[3];
        d->run.control.ref_q13.d = (int16_t)(p->open_loop_q13 >> 1);
        go(id, IDENTIFY_RESISTANCE, SETTLE_PERIODS, 1u << MEAN_LOG2);
    }
}

/** R from two levels: what dead time and the diodes take is the same in both, for no phase current comes near zero. The first
 *  level's duties are brought to the bus of the second. */
static void resistance_done(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    soft_float_t bus = soft_float_div(soft_float_of((uint32_t)id->bus_first), soft_float_of((uint32_t)id->sum[3]));
    int32_t duty_first = soft_float_times(id->duty_first, bus), duty = duty_first - id->sum[0], i = id->i_first - id->sum[1];
    if (!rests(d, id->sum[1] + 2 * id->sum[2])) {
        return;
    }
    if (duty <= 0 || i <= 0) {
        finish(d, IDENTIFY_RESULT_R_RANGE);
        return;
    }
    id->duty_per_amp = soft_float_div(soft_float_of((uint32_t)duty), soft_float_of((uint32_t)i));
    /* Standing, one phase carries it and the other two their halves: 4/3 of a leg's voltage; turning, 4/pi. */
    id->dead_q13 = soft_float_times((soft_float_times(duty_first, soft_float_div(soft_float_of(1), id->duty_per_amp)) - id->i_first) >> MEAN_LOG2,
                                    soft_float_scaled((uint32_t)(3.0F / PARAM_PI * 65536.0F), 16));
    id->values.rs_uohm = soft_float_to_uint32(soft_float_mul(soft_float_mul(id->duty_per_amp, soft_float_of((uint32_t)(id->sum[3] >> MEAN_LOG2))), C_RESISTANCE));
    if (id->values.rs_uohm < LEAST_UOHM || id->values.rs_uohm > MOST_UOHM) {
        finish(d, IDENTIFY_RESULT_R_RANGE);
        return;
    }
    d->run.control.ref_q13.d = (int16_t)(p->open_loop_q13 - (p->open_loop_q13 >> 2));
    go(id, IDENTIFY_BIAS, SETTLE_PERIODS, 1);
}

/* ---- Inductance ---- */

/** Largest square voltage: what the bias leaves of seven eighths of the circle. */
static int16_t square_most(const drive_t *d)
{
    return (int16_t)(d->circle.limit_q14 - (d->circle.limit_q14 >> 3) - d->run.identify.bias_q14);
}

static void bias_done(drive_t *d)
{
    identify_t *id = &d->run.identify;
    id->bias_q14 = d->run.control.v_q14.d;
    id->square_q14 = (int16_t)(d->circle.limit_q14 >> 7);
    id->mode = (uint16_t)IDENTIFY_INJECT;
    go(id, IDENTIFY_TRY_D, 4u * HALF_FIRST, TRY_HALVES * HALF_FIRST);
}

/** More voltage, then longer halves, until the current changes by 1/6 to 1/3 of Q_CURRENT_REF_OPENLOOP from peak to peak; with a bias of
 *  3/4 of it no phase current reaches zero on either axis. @param next step of the measurement proper */
static void try_done(drive_t *d, const drive_params_t *p, identify_step_t next)
{
    identify_t *id = &d->run.identify;
    uint16_t half = id->half;
    /* phase A, or sqrt(3) beta */
    int32_t wanted = (int32_t)(id->on_q ? p->open_loop_q13 - (p->open_loop_q13 >> 2) : p->open_loop_q13 >> 1) * (int32_t)(TRY_HALVES / 3u);
    int32_t seen = id->sum[2];
    int16_t most = square_most(d);
    if (seen >= wanted) {
        go(id, next, 4u * half, INDUCTANCE_PERIODS);
        return;
    }
    if (id->square_q14 < most) {
        id->square_q14 = (int16_t)((id->square_q14 > (most >> 1)) ? most : 2 * id->square_q14);
    } else if (half < HALF_LAST) {
        half = (uint16_t)(2u * half);
        id->half = half;
    } else {
        finish(d, IDENTIFY_RESULT_L_RANGE);
        return;
    }
    go(id, (identify_step_t)id->step, (uint16_t)(4u * half), (uint16_t)(TRY_HALVES * half));
}

/** L = Ts sum((v - R i) s) / sum(di s), less what R/L does within a period: voltages come as pulses a quarter period from the
 *  samples, which makes this L too large by 3/8 (Ts R / (2 L))^2. @return nH, or 0 when it cannot be */
static uint32_t inductance(const identify_t *id)
{
    int32_t volts = id->sum[0] - soft_float_times(id->sum[1], id->duty_per_amp);
    soft_float_t l, rt;
    uint32_t l_nh, less_nh;
    if (volts <= 0 || id->sum[2] <= 0) {
        return 0;
    }
    l = soft_float_div(soft_float_of((uint32_t)volts), soft_float_of((uint32_t)id->sum[2]));
    l = soft_float_mul(soft_float_mul(l, soft_float_of(id->bus_q16)), C_INDUCTANCE);
    rt = soft_float_mul(soft_float_of(id->values.rs_uohm), C_TS);
    less_nh = soft_float_to_uint32(soft_float_div(soft_float_mul(soft_float_mul(rt, rt), soft_float_scaled(3, 5)), l));
    l_nh = soft_float_to_uint32(l);
    return (l_nh >= LEAST_NH && l_nh <= MOST_NH && less_nh < l_nh >> 1) ? l_nh - less_nh : 0u;
}

static void inductance_d_done(drive_t *d)
{
    identify_t *id = &d->run.identify;
    id->values.ld_nh = inductance(id);
    if (id->values.ld_nh == 0u) {
        finish(d, IDENTIFY_RESULT_L_RANGE);
        return;
    }
    id->on_q = 1;
    id->square_q14 = (int16_t)(id->square_q14 >> 1);
    go(id, IDENTIFY_TRY_Q, (uint16_t)(4u * id->half), (uint16_t)(TRY_HALVES * id->half));
}

/* ---- Back-EMF ---- */

static int16_t gain_of(soft_float_t x)
{
    uint16_t g = soft_float_to_uint16(x);
    if (g > 32767u) {
        return 32767;
    }
    return (int16_t)((g == 0u) ? 1u : g);
}

static void forget_emf(identify_t *id)
{
    id->blocks = 0;
    id->emf_sum = 0;
    id->emf_d_sum = 0;
    id->emf_q_sum = 0;
}

/** R and L known: fast current controllers, then the vector turns. It starts along the rotor, so nothing jumps. */
static void inductance_q_done(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    pi_gains_t gains = { 0, 0, 0, LOOP_SHIFT };
    id->values.lq_nh = inductance(id);
    if (id->values.lq_nh == 0u) {
        finish(d, IDENTIFY_RESULT_L_RANGE);
        return;
    }
    id->kp_d = gain_of(soft_float_mul(soft_float_of(id->values.ld_nh), C_KP));
    id->kp_q = gain_of(soft_float_mul(soft_float_of(id->values.lq_nh), C_KP));
    id->ki_d = gain_of(soft_float_mul(soft_float_of(id->values.rs_uohm), C_KI));
    id->ki_q = id->ki_d;
    id->shift = LOOP_SHIFT;
    id->halvings = 1;
    pi_preset(&d->run.control.pi_d, &gains, 0, id->bias_q14);
    pi_preset(&d->run.control.pi_q, &gains, 0, 0);
    d->run.control.ref_q13.d = p->open_loop_q13;
    id->mode = (uint16_t)IDENTIFY_TURN;
    id->swing = (int32_t)id->bias_q14 * (1 << SWING_LOG2);
    id->swing_mean = (int32_t)id->bias_q14 * (1 << SWING_MEAN_LOG2);
    forget_emf(id);
    go(id, IDENTIFY_SPIN_HALF, SETTLE_PERIODS, 1u << BLOCK_LOG2);
}

/** Speed of the vector in 1/1024 angle counts a period. */
static uint32_t turn_speed(const drive_t *d, const drive_params_t *p)
{
    return (uint32_t)p->forced.end_speed_q10 >> d->run.identify.halvings;
}

/** Mean of a stretch, within what root_length() can square. */
static int16_t emf_mean(int32_t sum)
{
    return qm_within(sum >> BLOCK_LOG2, -23170, 23170);
}

/** Means of one stretch, back-EMF e = v - R i - j w Ld i: with the current along the rotor, as without load, Lq has no say. The
 *  voltage that dead time takes has the current's direction. */
static void emf_block(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    soft_float_t ohmic = soft_float_mul(soft_float_of(id->values.rs_uohm), C_OHMIC);
    soft_float_t reactive = soft_float_mul(soft_float_mul(soft_float_of(id->values.ld_nh), soft_float_of(turn_speed(d, p))), C_REACTIVE);
    int16_t e_d = emf_mean(id->sum[0] - soft_float_times(id->sum[2] + id->dead_q13 * (1 << BLOCK_LOG2), ohmic) + soft_float_times(id->sum[3], reactive));
    int16_t e_q = emf_mean(id->sum[1] - soft_float_times(id->sum[3], ohmic) - soft_float_times(id->sum[2], reactive));
    id->blocks++;
    id->emf_sum += root_length(e_d, e_q);
    id->emf_d_sum += e_d;
    id->emf_q_sum += e_q;
}

/** uV per 1000 rpm: the mean length, so that swinging of the rotor, which turns the vector to and fro, does not shorten it. */
static uint32_t kphi(const drive_t *d, const drive_params_t *p)
{
    soft_float_t mean = soft_float_of(d->run.identify.emf_sum);
    mean.e = (int16_t)(mean.e - BLOCKS_LOG2);
    return soft_float_to_uint32(soft_float_mul(soft_float_div(mean, soft_float_of(turn_speed(d, p))), C_KPHI));
}

/** 1 if the stretches agree in direction: a rotor that slips has them everywhere. */
static uint16_t coherent(const identify_t *id)
{
    uint16_t mean = (uint16_t)(id->emf_sum >> BLOCKS_LOG2);
    return (uint16_t)(root_length((int16_t)(id->emf_d_sum >> BLOCKS_LOG2), (int16_t)(id->emf_q_sum >> BLOCKS_LOG2)) > mean - (mean >> 2));
}

/** 1 where the back-EMF is no more than what an error of L may leave of a current that turns. */
static uint16_t hardly_emf(const drive_t *d, const drive_params_t *p)
{
    const identify_t *id = &d->run.identify;
    soft_float_t reactive = soft_float_mul(soft_float_mul(soft_float_of(id->values.ld_nh), soft_float_of(turn_speed(d, p))), C_REACTIVE);
    return (uint16_t)((int32_t)(id->emf_sum >> (BLOCKS_LOG2 - 3)) < soft_float_times(p->open_loop_q13, reactive));
}

/* ---- Inertia and friction ---- */

#define RATE_OF_SLOPE ((int32_t)(6.0F * 16.0F * RATE_SCALE))

enum { PART_PUSH,
       PART_FAST,
       PART_SLOW };

/** x * part / whole, within 2^30. @param whole above 0 */
static NOINLINE int32_t share_of(int32_t x, int32_t part, int32_t whole)
{
    uint32_t size = (uint32_t)((part < 0) ? -part : part);
    int32_t share = soft_float_times(x, soft_float_div(soft_float_of(size), soft_float_of((uint32_t)whole)));
    return (part < 0) ? -share : share;
}

/** Halves sums that have grown long: all of them, so that means and rates stay as they are. */
static void part_shrink(identify_part_t *part)
{
    if (part->units > PART_UNITS) {
        part->units >>= 1;
        part->current /= 2;
        part->speed >>= 1;
        part->slope /= 2;
        part->weight >>= 1;
        part->steps >>= 1;
        part->periods >>= 1;
    }
}

/** The least-squares line through a passage: its slope times its weight, so that passages can be added. */
static void passage_end(identify_t *id)
{
    if (id->part != 0u && id->passed > 1u) {
        identify_part_t *to = &id->parts[id->part - 1u];
        int32_t n = (int32_t)id->passed;
        uint16_t longer = (uint16_t)(id->follow_log2 - FOLLOW_LOG2);
        to->slope += 2 * id->rise_moment - (n - 1) * id->rise;
        to->weight += (n * (n * n - 1)) << longer;
        to->steps += (n - 1) << longer;
        to->periods += (uint16_t)(id->ended_at - id->began_at);
        part_shrink(to);
    }
    id->part = 0;
}

/** Another q current. */
static NOINLINE void mechanics_current(drive_t *d, current_q13_t iq_q13)
{
    identify_t *id = &d->run.identify;
    d->run.control.ref_q13.q = iq_q13;
    passage_end(id);
    id->phase_blocks = 0;
    id->phase_units = 0;
    id->look_units = DOUBLE_UNITS;
    id->look_q10 = 0;
    id->follow_log2 = FOLLOW_LOG2;
}

/** What the samples of a stretch miss of the current at a speed / 16: after the low sides' centre the back-EMF has taken some of it off. */
static NOINLINE int32_t missed(const identify_t *id, int32_t speed, soft_float_t factor)
{
    return soft_float_times(speed, soft_float_mul(factor, soft_float_div(soft_float_of(id->values.kphi_uv_per_krpm), soft_float_of(id->values.lq_nh))));
}

/** What the q current takes of the voltage is not the rotor's. */
static void mechanics_drops(drive_t *d, int32_t speed_q10)
{
    identify_t *id = &d->run.identify;
    soft_float_t w = soft_float_of((uint32_t)speed_q10);
    int16_t iq_q13;
    if (id->coasting) { /* no current, not none at the samples: that would push a rotor of little inductance */
        d->run.control.ref_q13.q = (int16_t) - (missed(id, speed_q10 >> 4, C_MISSED_COASTING) >> FOLLOW_LOG2);
    }
    iq_q13 = d->run.control.ref_q13.q;
    id->drop_q_q14 = (int16_t)soft_float_times(iq_q13, soft_float_mul(soft_float_of(id->values.rs_uohm), C_OHMIC));
    id->drop_d_q14 = (int16_t)soft_float_times(iq_q13, soft_float_mul(soft_float_mul(soft_float_of(id->values.lq_nh), w), C_REACTIVE));
}

static const identify_part_t no_part = { .units = 0 };

static NOINLINE void forget_parts(identify_t *id)
{
    int16_t n;
    for (n = 0; n < 3; n++) {
        id->parts[n] = no_part;
    }
    id->part = 0; /* the passage under way is forgotten, too */
    id->cycles = 0;
}

static int16_t identify_twice(int16_t x)
{
    return (int16_t)((x > 16383) ? 32767 : 2 * x);
}

/** What damps with 0.5 where R is small. A rotor that turns as fast as the controllers are needs them twice as fast, for the frame follows it by
 *  their voltage. The back-EMF falls fast while the rotor coasts: four times what cancels R/L. */
static void follow_gains(identify_t *id, uint32_t speed_q10)
{
    uint16_t damps = 4;
    if (speed_q10 > LOOP_Q10) {
        id->kp_d = identify_twice(id->kp_d);
        id->kp_q = identify_twice(id->kp_q);
        damps = 3;
    }
    id->ki_q = identify_twice(identify_twice(id->ki_q));
    if (id->ki_q < (id->kp_q >> damps)) {
        id->ki_q = (int16_t)(id->kp_q >> damps);
    }
    if (id->ki_d < (id->kp_d >> damps)) {
        id->ki_d = (int16_t)(id->kp_d >> damps);
    }
}

/** The current leaves the d axis, and the frame follows the rotor. What pushes first is the current that the friction takes, which is
 *  seen in the back-EMF's angle, and a sixteenth more. Up to twice END_SPEED_RPM as far as seven eighths of the voltage allow it with half of the current. */
static void mechanics_start(drive_t *d, const drive_params_t *p)
{
    static const pi_gains_t gains = { 0, 0, 0, LOOP_SHIFT };
    identify_t *id = &d->run.identify;
    uint32_t speed = turn_speed(d, p);
    uint16_t emf_q14 = (uint16_t)(id->emf_sum >> BLOCKS_LOG2);
    int32_t ohmic = soft_float_times(p->open_loop_q13 >> 1, soft_float_mul(soft_float_of(id->values.rs_uohm), C_OHMIC));
    int32_t most = d->circle.limit_q14 - (d->circle.limit_q14 >> 3) - ohmic;
    int16_t lag_q12;
    id->speed_per_emf_q5 = soft_float_to_uint16(soft_float_div(soft_float_of(speed << 5), soft_float_of(emf_q14)));
    id->emf_q22 = (int32_t)emf_q14 * 256;
    id->top_q10 = (int32_t)(qm_muluu((uint16_t)((most > (int32_t)emf_q14) ? most : emf_q14), id->speed_per_emf_q5) >> 5);
    if (id->top_q10 > (int32_t)(2u * speed)) {
        id->top_q10 = (int32_t)(2u * speed);
    }
    if (id->top_q10 > FASTEST_Q10) {
        id->top_q10 = FASTEST_Q10;
    }
    lag_q12 = qm_clamp((int16_t)share_of(id->emf_d_sum >> BLOCKS_LOG2, 4096, (int32_t)emf_q14), 0, 3840);
    id->push_q13 = (int16_t)((qm_mulss(p->open_loop_q13, lag_q12) >> 12) + (p->open_loop_q13 >> 4));
    follow_gains(id, speed);
    forget_parts(id);
    id->settle[0] = FOLLOW_SETTLE;
    id->settle[1] = FOLLOW_SETTLE;
    d->run.control.ref_q13.d = 0;
    if (emf_q14 > DEAD_EMF_Q14) { /* the frame follows by voltage: R i of the d axis would look like a slower rotor */
        pi_preset(&d->run.control.pi_d, &gains, 0, 0);
        pi_preset(&d->run.control.pi_q, &gains, 0, (int16_t)emf_q14);
    }
    mechanics_current(d, id->push_q13);
    id->seen_q10 = (int32_t)speed;
    mechanics_drops(d, (int32_t)speed);
    id->mode = (uint16_t)IDENTIFY_FOLLOW;
    go(id, IDENTIFY_MECHANICS, 0, 1u << FOLLOW_LOG2);
}

/** Adds a stretch to a part. */
static void part_add(identify_t *id, uint16_t part, int32_t speed_q10)
{
    identify_part_t *to = &id->parts[part];
    uint16_t longer;
    int32_t rise;
    if (id->part != part + 1u || id->passed == PASSAGE_MOST) {
        passage_end(id);
        id->part = (uint16_t)(part + 1u);
        id->passed = 0;
        id->began_at = id->at;
        id->from_q10 = speed_q10;
        id->rise = 0;
        id->rise_moment = 0;
    }
    longer = (uint16_t)(id->follow_log2 - FOLLOW_LOG2);
    rise = (speed_q10 - id->from_q10) >> 4;
    id->rise += rise;
    id->rise_moment += rise * (int32_t)id->passed;
    id->passed++;
    id->ended_at = id->at;
    to->units += (int32_t)1 << longer;
    to->current += id->sum[1];
    to->speed += (speed_q10 >> 4) * ((int32_t)1 << longer);
}

static int32_t part_speed(const identify_part_t *part)
{
    return share_of(part->speed, 1, part->units);
}

/** Mean q current, with what the samples miss. A current below the ripple, some five times of that, changes its sign within the period, and
 *  dead time delays nothing. */
static NOINLINE int32_t part_current(const identify_t *id, uint16_t part)
{
    const identify_part_t *of = &id->parts[part];
    int32_t current = share_of(of->current, 1, of->units), late = missed(id, part_speed(of), C_MISSED_COASTING);
    if (part == (uint16_t)PART_PUSH && current > RIPPLE_PER_MISSED * late) {
        late = missed(id, part_speed(of), C_MISSED_PUSHING);
    }
    return current + late;
}

/** Change of speed, counts a period * RATE_SCALE. */
static int32_t part_rate(const identify_part_t *part)
{
    uint32_t slope = (uint32_t)((part->slope < 0) ? -part->slope : part->slope);
    soft_float_t rate = soft_float_div(soft_float_mul(soft_float_of(slope), soft_float_of((uint32_t)part->steps)),
                                       soft_float_mul(soft_float_of((uint32_t)part->weight), soft_float_of((uint32_t)part->periods)));
    return soft_float_times((part->slope < 0) ? -RATE_OF_SLOPE : RATE_OF_SLOPE, rate);
}

/** J dw/dt = Kt i - friction, accelerating and coasting at the same mean speed. @return 10^-9 kg m2; 0 when it cannot be */
static uint32_t inertia(const identify_t *id)
{
    const identify_part_t *push = &id->parts[PART_PUSH], *fast = &id->parts[PART_FAST], *slow = &id->parts[PART_SLOW];
    int32_t slow_rate = part_rate(slow), slow_current = part_current(id, PART_SLOW);
    int32_t rate = part_rate(push) - slow_rate, current = part_current(id, PART_PUSH) - slow_current;
    int32_t span = part_speed(fast) - part_speed(slow), pushed = part_speed(push) - part_speed(slow);
    soft_float_t j;
    if (span > 0) {
        rate -= share_of(part_rate(fast) - slow_rate, pushed, span);
        current -= share_of(part_current(id, PART_FAST) - slow_current, pushed, span);
    }
    if (rate <= 0 || current <= 0) {
        return 0;
    }
    j = soft_float_mul(soft_float_mul(soft_float_of((uint32_t)current), soft_float_of(id->values.kphi_uv_per_krpm)), C_INERTIA);
    return soft_float_to_uint32(soft_float_div(j, soft_float_of((uint32_t)rate)));
}

/** Torque that brakes a coasting rotor, 10^-8 N m. */
static int32_t drag(const identify_t *id, uint16_t part)
{
    int32_t braked = -soft_float_times(part_rate(&id->parts[part]), soft_float_mul(soft_float_of(id->values.inertia_1e9_kgm2), C_DRAG));
    return braked + soft_float_times(part_current(id, part), soft_float_mul(soft_float_of(id->values.kphi_uv_per_krpm), C_TORQUE));
}

static uint32_t not_negative(int32_t x)
{
    return (uint32_t)((x < 0) ? 0 : x);
}

/** Friction from coasting at two speeds. */
static void friction_done(drive_t *d)
{
    identify_t *id = &d->run.identify;
    const identify_part_t *fast = &id->parts[PART_FAST], *slow = &id->parts[PART_SLOW];
    int32_t fast_nm = drag(id, PART_FAST), slow_nm = drag(id, PART_SLOW), apart = part_speed(fast) - part_speed(slow);
    int32_t grows = (apart > 0) ? fast_nm - slow_nm : 0;
    if (fast_nm > MOST_FRICTION || slow_nm > MOST_FRICTION) {
        finish(d, IDENTIFY_RESULT_FRICTION_RANGE);
        return;
    }
    if (grows <= 0) { /* none of it grows, or hardly: their mean */
        grows = 0;
        slow_nm = (slow_nm >> 1) + (fast_nm >> 1);
    } else if (share_of(grows, part_speed(slow), apart) > slow_nm) { /* all of it grows */
        grows = fast_nm;
        apart = part_speed(fast);
        slow_nm = 0;
    } else {
        slow_nm -= share_of(grows, part_speed(slow), apart);
    }
    if (apart > 0) {
        grows = soft_float_times(grows, soft_float_div(C_VISCOUS, soft_float_of((uint32_t)apart)));
    }
    id->values.coulomb_1e8_nm = not_negative(slow_nm);
    id->values.viscous_1e9_nms = not_negative(grows);
    finish(d, IDENTIFY_RESULT_DONE);
}

static void mechanics_done(drive_t *d)
{
    identify_t *id = &d->run.identify;
    identify_part_t *fast = &id->parts[PART_FAST], *slow = &id->parts[PART_SLOW];
    passage_end(id);
    if (slow->periods == 0) { /* one speed only: the friction counts as constant */
        *slow = *fast;
    } else if (fast->periods == 0) {
        *fast = *slow;
    } else {
        /* both */
    }
    if (id->parts[PART_PUSH].periods == 0 || fast->periods == 0) {
        finish(d, IDENTIFY_RESULT_NOT_ACCELERATING);
        return;
    }
    id->values.inertia_1e9_kgm2 = inertia(id);
    if (id->values.inertia_1e9_kgm2 < LEAST_INERTIA || id->values.inertia_1e9_kgm2 > MOST_INERTIA) {
        id->values.inertia_1e9_kgm2 = 0;
        finish(d, IDENTIFY_RESULT_INERTIA_RANGE);
    } else {
        friction_done(d);
    }
}

static int32_t bottom_of(const identify_t *id)
{
    return (id->top_q10 >> 2) + (id->top_q10 >> 3);
}

/** Speed at which a push ends. The first one is half as long: a rotor that coasts for minutes is seen at a low speed, then at the top. */
static int32_t goal_of(const identify_t *id)
{
    return (id->cycles != 0u) ? id->top_q10 : id->top_q10 - bottom_of(id);
}

/** How long the next phase of this kind settles. */
static uint16_t settle_of(const identify_t *id)
{
    uint16_t units = (uint16_t)(id->phase_units >> 3);
    return (uint16_t)((units > SETTLE_MOST) ? SETTLE_MOST : (units < FOLLOW_SETTLE) ? FOLLOW_SETTLE
                                                                                    : units);
}

/** It is as fast as it shall be: what is left is to coast. */
static void push_ends(drive_t *d)
{
    identify_t *id = &d->run.identify;
    uint16_t least = (uint16_t)((id->cycles != 0u) ? PUSH_LEAST : PUSH_LEAST / 2u);
    if (id->phase_blocks < least && id->first_q10 < bottom_of(id) && id->gentler < GENTLER_MOST) { /* too quick to be seen: it counts no more */
        id->push_q13 = (int16_t)(id->push_q13 - (id->push_q13 >> 2));
        id->gentler++;
        forget_parts(id);
    }
    id->settle[0] = settle_of(id);
    id->coasting = 1;
    mechanics_current(d, 0);
}

/** It does not get faster: twice the current, or the end. */
static void push_harder(drive_t *d, const drive_params_t *p, uint16_t follows)
{
    identify_t *id = &d->run.identify;
    if (id->push_q13 >= p->open_loop_q13 || !follows) {
        finish(d, IDENTIFY_RESULT_NOT_ACCELERATING);
        return;
    }
    forget_parts(id);
    id->push_q13 = (int16_t)((id->push_q13 > (p->open_loop_q13 >> 1)) ? p->open_loop_q13 : 2 * id->push_q13);
    mechanics_current(d, id->push_q13);
}

/** 1 where the push has lasted long and more current, or the end, is due: with all of it a heavy rotor goes on as long as it gets faster. */
static uint16_t push_is_overdue(identify_t *id, const drive_params_t *p, int32_t speed_q10)
{
    int32_t before_q10 = id->look_q10;
    if (id->phase_units < id->look_units) {
        return 0;
    }
    id->look_units = (uint16_t)(id->look_units + PUSH_UNITS);
    id->look_q10 = speed_q10;
    return (uint16_t)(id->push_q13 < p->open_loop_q13 || id->look_units > UNITS_MOST || speed_q10 - before_q10 < (id->top_q10 >> 7));
}

/** A stretch with current. */
static void push_block(drive_t *d, const drive_params_t *p, int32_t speed_q10)
{
    identify_t *id = &d->run.identify;
    int32_t bottom_q10 = bottom_of(id), goal_q10 = goal_of(id);
    uint16_t settled = (uint16_t)(id->phase_units > id->settle[0]);
    if (id->phase_blocks == 1u) { /* the step of current disturbs what is seen of it */
        id->first_q10 = (speed_q10 < id->seen_q10) ? speed_q10 : id->seen_q10;
        id->first_q10 -= id->first_q10 >> 3;
    }
    if (settled && speed_q10 >= bottom_q10 && speed_q10 <= goal_q10) {
        part_add(id, PART_PUSH, speed_q10);
    }
    if (speed_q10 > goal_q10 + (goal_q10 >> 5)) {
        push_ends(d);
    } else if ((settled && speed_q10 < id->first_q10) || push_is_overdue(id, p, speed_q10)) {
        push_harder(d, p, (uint16_t)(speed_q10 >= (bottom_q10 >> 1)));
    } else {
        /* it accelerates */
    }
}

/** 1 when the rotor has coasted often or long enough. */
static uint16_t coasted_enough(const identify_t *id, uint16_t late)
{
    int32_t periods = id->parts[PART_FAST].periods + id->parts[PART_SLOW].periods;
    return (uint16_t)(id->cycles >= CYCLES_MOST || (id->cycles >= 2u && (late || periods > 4 * (int32_t)COAST_PERIODS))
                      || (id->cycles >= CYCLES_LEAST && periods > (int32_t)COAST_PERIODS));
}

/** The first cycle has shown how long to settle: what it has seen itself does not count, where there will be more. */
static void first_cycle_done(identify_t *id, int32_t speed_q10)
{
    passage_end(id);
    if (speed_q10 < id->top_q10 - (id->top_q10 >> 2)) {
        id->parts[PART_PUSH] = no_part;
    }
    if (!id->heavy) {
        id->parts[PART_FAST] = no_part;
        id->parts[PART_SLOW] = no_part;
    }
}

/** A stretch without. */
static void coast_block(drive_t *d, int32_t speed_q10)
{
    identify_t *id = &d->run.identify;
    int32_t bottom_q10 = bottom_of(id), middle_q10 = (id->top_q10 + bottom_q10) >> 1;
    uint16_t late = (uint16_t)(id->phase_units > ((id->cycles != 0u && id->parts[PART_PUSH].periods == 0) ? UNITS_MOST : COAST_UNITS));
    if (id->phase_units > id->settle[1] && speed_q10 >= bottom_q10) {
        part_add(id, (speed_q10 > middle_q10) ? PART_FAST : PART_SLOW, speed_q10);
    }
    if (speed_q10 < bottom_q10 || late) {
        id->cycles++;
        id->settle[1] = settle_of(id);
        if (id->cycles == 1u) {
            first_cycle_done(id, speed_q10);
        }
        if (coasted_enough(id, late)) {
            mechanics_done(d);
            return;
        }
        id->coasting = 0;
        mechanics_current(d, id->push_q13);
    }
}

/** Longer stretches. The first time that a rotor coasts so long, what the shorter ones have seen of it counts no more. */
static void lengthen(identify_t *id)
{
    passage_end(id);
    if (id->coasting && !id->heavy) {
        id->heavy = 1;
        id->settle[1] = SETTLE_MOST;
        id->parts[PART_FAST] = no_part;
        id->parts[PART_SLOW] = no_part;
    }
    if (id->follow_log2 < FOLLOW_MOST && id->top_q10 < LONGER_BELOW) {
        id->follow_log2 = (uint16_t)(id->follow_log2 + 2u);
    }
}

static void mechanics_block(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    int32_t speed_q10 = id->sum[0] >> id->follow_log2;
    id->phase_blocks++;
    id->phase_units = (uint16_t)(id->phase_units + (1u << (id->follow_log2 - FOLLOW_LOG2)));
    if (id->coasting) {
        coast_block(d, speed_q10);
    } else {
        push_block(d, p, speed_q10);
    }
    if (id->step == (uint16_t)IDENTIFY_MECHANICS) {
        id->seen_q10 = speed_q10;
        mechanics_drops(d, speed_q10);
        if ((id->phase_blocks & (LONGER_EVERY - 1u)) == 0u && id->phase_blocks != 0u) {
            lengthen(id);
        }
        go(id, IDENTIFY_MECHANICS, 0, (uint16_t)(1u << id->follow_log2));
    }
}

/** The rotor slipped. One that swung while it was aligned is too heavy for the ramp, others are not free: what stood at the beginning stands again, and a ramp
 *  with a quarter of the acceleration follows. @return 1 when that is worth a try, and no back-EMF would drive more current than was asked for */
static uint16_t ramp_slower(drive_t *d, const drive_params_t *p)
{
    static const pi_gains_t gains = { 0, 0, 0, SLOW_SHIFT };
    identify_t *id = &d->run.identify;
    int32_t ohmic = soft_float_times(p->open_loop_q13, soft_float_mul(soft_float_of(id->values.rs_uohm), C_OHMIC));
    id->ramps++;
    if (!id->swung || id->ramps >= RAMPS_MOST || (int32_t)(id->emf_sum >> BLOCKS_LOG2) > ohmic) {
        return 0;
    }
    id->kp_d = 0;
    id->kp_q = 0;
    id->ki_d = id->ki_slow;
    id->ki_q = 0;
    id->shift = SLOW_SHIFT;
    pi_preset(&d->run.control.pi_d, &gains, 0, (int16_t)(id->bias_q14 + id->bias_q14 / 3));
    pi_preset(&d->run.control.pi_q, &gains, 0, 0);
    d->forced.speed_q10 = 0;
    d->forced.angle_q32 = IDENTIFY_START_ANGLE_Q32;
    id->sweep = 1;
    id->on_q = 0;
    id->half = HALF_FIRST;
    id->mode = (uint16_t)IDENTIFY_CURRENT;
    go(id, IDENTIFY_ALIGN, SETTLE_PERIODS, 1u << MEAN_LOG2);
    return 1;
}

static void spin_done(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    uint32_t uv;
    dq_t v;
    v.d = (int16_t)(id->sum[0] >> BLOCK_LOG2);
    v.q = (int16_t)(id->sum[1] >> BLOCK_LOG2);
    if (root_length(v.d, v.q) > (uint16_t)(d->circle.limit_q14 - (d->circle.limit_q14 >> 3))) {
        finish(d, IDENTIFY_RESULT_VOLTAGE_LIMIT);
        return;
    }
    emf_block(d, p);
    if (id->blocks < BLOCKS) {
        go(id, (identify_step_t)id->step, 0, 1u << BLOCK_LOG2);
        return;
    }
    uv = kphi(d, p);
    if (!coherent(id) || uv < LEAST_UV || hardly_emf(d, p)) {
        if (!ramp_slower(d, p)) {
            finish(d, IDENTIFY_RESULT_NOT_TURNING);
        }
    } else if (uv > MOST_UV) {
        finish(d, IDENTIFY_RESULT_KPHI_RANGE);
    } else if (id->step == (uint16_t)IDENTIFY_SPIN_HALF && 2 * v.q + qm_abs(v.d) / 2 > d->circle.limit_q14 - (d->circle.limit_q14 >> 4)) {
        finish(d, IDENTIFY_RESULT_VOLTAGE_LIMIT); /* twice the speed takes nearly twice the voltage */
    } else if (id->step == (uint16_t)IDENTIFY_SPIN_HALF) {
        id->kphi_half = uv;
        id->halvings = 0;
        forget_emf(id);
        go(id, IDENTIFY_SPIN_FULL, SETTLE_PERIODS, 1u << BLOCK_LOG2);
    } else if (((uv > id->kphi_half) ? uv - id->kphi_half : id->kphi_half - uv) > uv >> 3) {
        finish(d, IDENTIFY_RESULT_NOT_TURNING);
    } else {
        id->values.kphi_uv_per_krpm = uv;
        mechanics_start(d, p);
    }
}

uint16_t identify_background(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    if (id->step != (uint16_t)IDENTIFY_IDLE && !d->command.run) { /* S2 or a fault */
        finish(d, IDENTIFY_RESULT_STOPPED);
    }
    if (id->step != (uint16_t)IDENTIFY_IDLE && id->ready) {
        switch (id->step) {
        case IDENTIFY_RISE: rise_done(d, p); break;
        case IDENTIFY_CONNECT: connect_done(d, p); break;
        case IDENTIFY_ALIGN: align_done(d, p); break;
        case IDENTIFY_RESISTANCE: resistance_done(d, p); break;
        case IDENTIFY_BIAS: bias_done(d); break;
        case IDENTIFY_TRY_D: try_done(d, p, IDENTIFY_INDUCTANCE_D); break;
        case IDENTIFY_INDUCTANCE_D: inductance_d_done(d); break;
        case IDENTIFY_TRY_Q: try_done(d, p, IDENTIFY_INDUCTANCE_Q); break;
        case IDENTIFY_INDUCTANCE_Q: inductance_q_done(d, p); break;
        case IDENTIFY_MECHANICS: mechanics_block(d, p); break;
        default: spin_done(d, p); break;
        }
    }
    return (uint16_t)(id->step == (uint16_t)IDENTIFY_IDLE);
}

#endif

/* ---- IDENTIFY, the interrupt's part: one PWM period of holding, injecting or turning a vector, or of following the rotor, and of adding up ---- */

#ifdef IDENTIFY

#define IDENTIFY_SWEEP_Q32 ((uint32_t)(715827882.0F / (0.5F / PARAM_F(LOOPTIME_SEC)))) /**< to phase A within half a second */

voltage_q14_t identify_most(const voltage_circle_t *circle)
{
    return (int16_t)(circle->limit_q14 - (circle->limit_q14 >> 2));
}

/** Filtered bus, Q16 of full scale. */
static uint16_t identify_bus(const drive_t *d)
{
    return (uint16_t)((uint32_t)d->bus_q31 >> 15);
}

int16_t identify_current(const drive_t *d)
{
    return (int16_t)(d->run.identify.on_q ? d->phases_q13.a + 2 * d->phases_q13.b : d->phases_q13.a);
}

/** Duties along the same axis: three times the alpha voltage, or sqrt(3) times three times the beta voltage, over the bus. */
static int16_t identify_duty(const identify_t *id, const duties_t *duty)
{
    int16_t b = (int16_t)duty->b, c = (int16_t)duty->c;
    return (int16_t)(id->on_q ? 3 * (b - c) : 2 * (int16_t)duty->a - b - c);
}

void identify_follow(drive_t *d)
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

void identify_damp(drive_t *d)
{
    identify_t *id = &d->run.identify;
    int16_t v_q14 = d->run.control.v_q14.d, ahead_q14;
    id->swing += v_q14 - (id->swing >> SWING_LOG2);
    id->swing_mean += v_q14 - (id->swing_mean >> SWING_MEAN_LOG2);
    ahead_q14 = (int16_t)((id->swing >> SWING_LOG2) - (id->swing_mean >> SWING_MEAN_LOG2));
    d->forced.step_q32 = qm_turn_sub(d->forced.step_q32, (uint32_t)((int32_t)ahead_q14 * SWING_GAIN * 64));
}

uint16_t identify_turn(drive_t *d, const drive_params_t *p)
{
    identify_t *id = &d->run.identify;
    uint16_t settled = 1;
    if (id->mode == (uint16_t)IDENTIFY_TURN) {
        forced_angle_params_t to = p->forced;
        int32_t less_q10;
        to.end_speed_q10 >>= id->halvings;
        less_q10 = (to.end_speed_q10 - d->forced.speed_q10) >> RAMP_END_SHIFT; /* a heavy rotor that overshoots charges the bus */
        d->forced.increase_q10 = (less_q10 < p->forced.increase_rate_q10) ? (int16_t)(less_q10 + 1) : p->forced.increase_rate_q10;
        if (d->state == (uint16_t)DRIVE_ALIGN) {
            drive_enter(d, DRIVE_RAMP);
        }
        settled = (uint16_t)forced_angle_accelerate(&d->forced, &to, 1, (uint16_t)((d->ticks & ((1u << 2u * id->ramps) - 1u)) == 0u));
        identify_damp(d);
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

int16_t identify_square(identify_t *id)
{
    int16_t sign = (int16_t)((id->sign < 0) ? -1 : 1);
    if (id->half_left == 0u) {
        id->half_left = id->half;
        sign = (int16_t)-sign;
    }
    id->half_left--;
    return sign;
}

dq_t identify_voltage(drive_t *d, int16_t sign)
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
    gains_d.kc = PARAM_Q15(0.999);
    gains_d.shift = id->shift;
    gains_q = gains_d;
    gains_q.kp = id->kp_q;
    gains_q.ki = id->ki_q;
    return current_control(&c->pi_d, &gains_d, &c->pi_q, &gains_q, c->ref_q13, c->i_q13, &d->circle, &c->vq_limit_q14);
}

void identify_add(drive_t *d, const drive_params_t *p)
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

void identify_record(drive_t *d, const drive_params_t *p, uint16_t settled)
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
static void identify_duties(const drive_t *d, const drive_params_t *p, duties_t *duty)
{
    static const dq_t none = { 0, 0 }; /* a rotor that coasts: what is asked for is what the samples miss */
    phases_t asked = phases_of(d->run.identify.coasting ? none : d->run.control.ref_q13, d->frame);
    dead_duties_t dead;
    svm_compensation(&p->svm, asked, &dead);
    svm(&p->svm, inverse_park(d->run.control.v_q14, d->frame), d->duty_per_volt_q16, &dead, &asked, duty);
}

void identify_run(drive_t *d, const drive_params_t *p, duties_t *duty)
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

#endif

uint16_t mode_background(drive_t *d UNUSED, const drive_params_t *p UNUSED)
{
#ifdef IDENTIFY
    return identify_background(d, p);
#else
    return 0;
#endif
}
