/* What the firmware makes of a userparams.h, a line each: every constant with the value that it stands for, and what the build refuses. */
#include <math.h>
#include <stdio.h>

#include "drive/param_init.h"
#include "drive/param_limits.h"

static const drive_params_t p = DRIVE_PARAMS_INIT;

/** `one` is the worth of one count in the value's unit; the rounding error follows from it. 0: a whole number, no rounding. */
static void constant(const char *name, long long count, double value, const char *unit, double one, const char *format, const char *meaning)
{
    double error = (one == 0.0 || value == 0.0) ? 0.0 : 100.0 * ((double)count / (value / one) - 1.0);
    printf("constant|%s|%.17g|%s|%s|%lld|%.17g|%s\n", name, value, unit, format, count, error, meaning);
}

#define PI 3.14159265358979323846
#define GROUP(name) puts("group|" name)
#define FIELD(path, ...) constant(#path, (long long)p.path, __VA_ARGS__)
#define MACRO(name, ...) constant(#name, (long long)(name), __VA_ARGS__)

/* The worth of one count, in double precision */
static const double ampere = NORM_CURRENT_CONST, period = LOOPTIME_SEC, pairs = NOPOLESPAIRS;
static double volt, ohm, q13_a, erpm, slots; /* erpm: mechanical rpm of a count of speed */
static const char *const q16_divided[] = { "Q16 / 1", "Q16 / 2", "Q16 / 4", "Q16 / 8" };

static double at_most(double value, double largest)
{
    return (value < largest) ? value : largest;
}

static double filter_hz(double k_q15)
{
    return -log(1.0 - k_q15 / 32768.0) / (2.0 * PI * period);
}

static void motor(void)
{
    double rs = MOTOR_RS_OHM + BRIDGE_RS_OHM, ls = MOTOR_LS_MH, kphi = MOTOR_KPHI_V_PER_KRPM, one_ls = ohm * period * 1000.0;
    GROUP("motor");
    MACRO(NORM_RS, rs, "ohm", rs / at_most(rs / ohm * 16384.0, 32767.0), "Q15 / 2", "Equation 5, AN1292's constant, at most 32767");
    MACRO(NORM_LSDTBASE, ls, "mH", ls / at_most(ls / one_ls * 128.0, 32767.0), "Q15 / 256", "Equation 5, AN1292's constant, at most 32767");
#if MOTOR_SALIENCY_UH
    FIELD(salience_q13, kphi * 60.0 / (2.0 * PI * sqrt(3.0) * 1000.0 * pairs) / (MOTOR_SALIENCY_UH * 1e-6), "A", q13_a, "Q13 A",
          "-i_d that doubles the flux, psi/(Lq - Ld)");
#endif
    MACRO(NORM_INVKFIBASE, kphi, "V/krpm", kphi * kphi / (sqrt(3.0) * 1000.0 * pairs * volt * 16384.0) * SPEED_UNIT, "Q15 / 2, 1/Kphi", "Equation 6");
    MACRO(NORM_DELTAT, period, "s", 60.0 / 2147483648.0 / SPEED_UNIT, "Q15 of a turn/erpm", "Equation 1, AN1292's constant");
    FIELD(adaptation.rs_base_q16, rs, "ohm", ohm / 32768.0 * (1 << p.estimator.rs_exp), q16_divided[p.estimator.rs_exp], "R of the estimator");
    FIELD(estimator.rs_exp, 1 << p.estimator.rs_exp, "1", 0.0, "count", "the product is shifted left by it");
    FIELD(fieldweak.ls_base_q16, ls, "mH", one_ls / 4096.0 * (1 << p.estimator.ls_exp), q16_divided[p.estimator.ls_exp],
          "L of the estimator, eight samples");
    FIELD(estimator.ls_exp, 1 << p.estimator.ls_exp, "1", 0.0, "count", "the product is shifted left by it");
}

static void estimator(void)
{
    double least = 8.0 * PARAM_DI(EIGHT_SAMPLES_ERPM / PARAM_F(NOPOLESPAIRS)), most = PARAM_DI(MAXIMUM_SPEED_RPM), q14_a = 2.0 * ampere;
    double least_left = at_most(PARAM_LDI_LS_SHARE * least, 16383.0), most_left = at_most(PARAM_LDI_SHARE * most, 4095.0);
    GROUP("estimator");
    FIELD(estimator.deltat_q32, period, "s", 60.0 / 4294967296.0 / SPEED_UNIT, "Q32 of a turn/erpm", "angle a period");
    FIELD(estimator.half_step_q16_rad, period / 2.0, "s", 60.0 / (2.0 * PI) / 4294967296.0 / SPEED_UNIT, "Q16 rad/erpm", "half of it");
    FIELD(estimator.d_ilimit_ls_q14, least_left * q14_a, "A", least_left * q14_a / at_most(least_left, 16382.5), "Q14 A",
          "change in eight periods: D_ILIMIT_LS, or what the format leaves of it");
    FIELD(estimator.d_ilimit_hs_q14, most_left * q14_a, "A", most_left * q14_a / at_most(most_left, 4094.5), "Q14 A",
          "change in a period: D_ILIMIT_HS, or what the format leaves of it");
    MACRO(D_ILIMIT_LS, at_most(least, 16383.0) * q14_a, "A", 0.0, "Q15 A", "the same in AN1292's format");
    MACRO(D_ILIMIT_HS, at_most(most, 4095.0) * q14_a, "A", 0.0, "Q15 A", "the same in AN1292's format");
    FIELD(fieldweak.kfilter_esdq_q16, filter_hz(KFILTER_ESDQ), "Hz", 0.0, "Q16 a period", "Equation 7");
    FIELD(fieldweak.kfilter_esdq_fw_q16, filter_hz(KFILTER_ESDQ_FW), "Hz", 0.0, "Q16 a period", "Equation 7");
    FIELD(estimator.kfilter_velestim_q16, filter_hz(KFILTER_VELESTIM), "Hz", 0.0, "Q16 a period", "Equation 7");
}

static void speeds(void)
{
    GROUP("speeds");
    MACRO(SPEED_UNIT, SPEED_UNIT, "1", 0.0, "count", "electrical rpm of a count of speed: of what `erpm` stands for in this table");
    FIELD(minimum_erpm, MINIMUM_SPEED_RPM, "rpm", erpm, "erpm", "potentiometer at zero");
    FIELD(pot_zero_q16, POT_LIVE_ZERO, "1", 1.0 / 65536.0, "Q16", "dead end of its travel");
    FIELD(pot_scale_q15, 1.0 / (1.0 - 2.0 * POT_LIVE_ZERO), "1", 1.0 / 32768.0, "Q15", "what is left of it is all");
    FIELD(nominal_erpm, NOMINAL_SPEED_RPM, "rpm", erpm, "erpm", "potentiometer at full scale, S3 off");
    FIELD(maximum_erpm, MAXIMUM_SPEED_RPM, "rpm", erpm, "erpm", "potentiometer at full scale, S3 on");
    FIELD(end_erpm, END_SPEED_RPM, "rpm", erpm, "erpm", "end of the ramp");
    FIELD(fieldweak.on_speed_erpm, FW_START_SPEED_RPM, "rpm", erpm, "erpm", "field weakening starts");
    FIELD(estimator.nominal_erpm, EIGHT_SAMPLES_ERPM / PARAM_F(NOPOLESPAIRS), "rpm", erpm, "erpm", "one-sample derivative above");
    FIELD(estimator.decimate_erpm, NOMINAL_SPEED_RPM / 10.0, "rpm", erpm, "erpm", "sign of Equation 2 from the filtered speed below");
    FIELD(speed_ramp_q16, SPEEDREFRAMP_RPM_PER_S, "rpm/s", erpm / slots / 65536.0, "Q16 erpm every 8 periods", "slope of the reference");
    FIELD(speed_decel_q16, SPEEDREF_DECEL_RPM_PER_S ? SPEEDREF_DECEL_RPM_PER_S : SPEEDREFRAMP_RPM_PER_S, "rpm/s", erpm / slots / 65536.0, "Q16 erpm every 8 periods",
          "the same towards standstill");
    FIELD(tuning_step_q16, TUNING_DELAY_RAMPUP, "periods", TUNING_DELAY_RAMPUP / (65536.0 * SLOW_PERIODS / SPEED_UNIT / (TUNING_DELAY_RAMPUP + 1.0)), "Q16 erpm every 8 periods",
          "slope in TUNING");
    FIELD(ramp_hold_erpm, NOMINAL_SPEED_RPM / 8.0, "rpm", erpm, "erpm", "the ramp waits when the motor is further behind");
    FIELD(overspeed_erpm, at_most(MAXIMUM_SPEED_RPM * 1.25, 32700.0 * erpm), "rpm", erpm, "erpm", "lost lock above");
}

static void controllers(void)
{
    double q15_16 = 16.0 / 32768.0;
    GROUP("current and speed controllers");
#define CURRENT_LOOP(pi, AXIS) \
    FIELD(pi.kp, AXIS##_CURRCNTR_PTERM * 16.0 * ohm, "V/A", q15_16 * ohm, "Q15 / 16", "proportional gain"); \
    FIELD(pi.ki, AXIS##_CURRCNTR_ITERM * ohm / period, "V/(A s)", ohm / period / 2048.0, "Q11 a period", "integral gain"); \
    FIELD(pi.kc, AXIS##_CURRCNTR_CTERM, "1", 1.0 / 32768.0, "Q15", "anti-windup")
    CURRENT_LOOP(pi_d, D);
    CURRENT_LOOP(pi_q, Q);
    FIELD(speed_kp_q13, SPEEDCNTR_PTERM * 16.0 * ampere / erpm, "A/rpm", q15_16 * ampere / erpm, "Q15 / 16", "proportional gain");
    FIELD(speed_kp_fast_q13, at_most(SPEEDCNTR_PTERM * PARAM_FAST_GAIN, 32767.0 / 32768.0) * 16.0 * ampere / erpm, "A/rpm",
          q15_16 * ampere / erpm, "Q15 / 16", "after a large innovation");
}

static void observer(void)
{
    double unit = 1.0 / (1 << p.observer.shift), lost = PARAM_LOST_CURRENT_Q13;
    double rate = 1.0 / (2.0 * PI * slots * 65536.0), learns = 1.0 / (SLOW_ROUND_STEPS * slots * 65536.0);
    GROUP("load observer, adaptation and low speed");
    FIELD(observer.deltat_q32, slots / 8.0, "s", 60.0 / 4294967296.0 / SPEED_UNIT, "Q32 of a turn/erpm", "angle in an eighth of a step");
    FIELD(observer.per_turn_q12, 65536.0 / 4294967296.0 * 60.0 / slots / pairs, "rpm", erpm / 4096.0, "Q12 erpm", "2^16 counts of the angle in a step");
    FIELD(observer.shift, p.observer.shift, "1", 0.0, "count", "2^this of its units of acceleration are an erpm a step");
    FIELD(observer.per_current_q16, PARAM_ACCEL * erpm / slots / q13_a, "rpm/s/A", unit * erpm / slots / q13_a / 65536.0, "Q16 unit/Q13 A", "Kt/J");
    FIELD(observer.per_unit_q15, 1.0 / (PARAM_ACCEL * erpm / slots / q13_a), "A s/rpm", slots * q13_a / (unit * erpm) / 32768.0, "Q15 Q13 A/unit",
          "J/Kt");
    FIELD(observer.innovation_max_erpm, p.observer.innovation_max_erpm * erpm, "rpm", 0.0, "erpm", "innovation counts up to here");
    FIELD(observer.load_max, p.observer.load_max / PARAM_ACCEL_UNITS * q13_a, "A", 0.0, "units", "largest load");
    FIELD(observer.quiet_q16, PARAM_MIN(PARAM_QUIET_RATIO * SPEED_BANDWIDTH_HZ, PARAM_LOADED_SHARE * LOAD_BANDWIDTH_HZ), "Hz", rate, "Q16 a step",
          "rate without load");
    FIELD(observer.loaded_q16, PARAM_LOADED_SHARE * LOAD_BANDWIDTH_HZ, "Hz", rate, "Q16 a step", "rate under load");
    FIELD(observer.fast_q16, LOAD_BANDWIDTH_HZ, "Hz", rate, "Q16 a step", "rate after a large innovation");
    FIELD(observer.full_erpm, 60.0 / PARAM_FULL_RATIO * LOAD_BANDWIDTH_HZ / pairs, "rpm", erpm, "erpm", "speed reference from which rates and gain are these");
    FIELD(observer.load_from, PARAM_LOAD_FROM_LOST * lost * q13_a, "A", q13_a / PARAM_ACCEL_UNITS, "units", "load that begins to count");
    FIELD(observer.load_width, PARAM_LOAD_FROM_LOST * lost * q13_a, "A", q13_a / PARAM_ACCEL_UNITS, "units", "over what more it counts");
    FIELD(observer.load_slope_q15, 1.0 / (PARAM_LOAD_FROM_LOST * lost * q13_a), "1/A", PARAM_ACCEL_UNITS / q13_a / 32767.0, "Q15 a unit", "one over it");
    FIELD(observer.gate_erpm, PARAM_LARGE_ERPM / pairs, "rpm", erpm, "erpm", "large innovation without load");
    FIELD(observer.gate_loaded_erpm, PARAM_LARGE_LOADED_ERPM / pairs, "rpm", erpm, "erpm", "and under load");
    FIELD(adaptation.rate_q16, 6.0, "1/s", learns, "Q16 a step", "flux and R follow");
    FIELD(adaptation.kfi_least, -0.30, "1", 1.0 / 32768.0, "Q15", "least change of 1/Kphi");
    FIELD(adaptation.kfi_most, 0.35, "1", 1.0 / 32768.0, "Q15", "largest");
    FIELD(adaptation.rs_least, -0.4, "1", 1.0 / 32768.0, "Q15", "least change of R");
    FIELD(adaptation.rs_most, PARAM_RS_RISES, "1", 1.0 / 32768.0, "Q15", "largest");
    FIELD(adaptation.emf_least_q12, 0.2 * PARAM_DEAD_TIME_V, "V", 8.0 * volt, "Q12 V", "back-EMF from which it learns");
    FIELD(adaptation.turned_q12, PARAM_TURNED_V, "V", 8.0 * volt, "Q12 V", "back-EMFs of 16 periods that are a turn by HELD_TURNED_RAD");
    FIELD(sample_shift_q16, 60 * 25e-9 / (PARAM_ERPM_PER_V * MOTOR_LS_MH * 0.001) * pairs, "A/rpm", q13_a / erpm / 65536.0, "Q16 Q13 A/erpm",
          "q current that the sample misses");
    FIELD(fieldweak.esdq_per_erpm_q13, PARAM_ESDQ_RATIO / 60.0 * pairs, "Hz/rpm", 1.0 / (2.0 * PI * period * 65536.0 * 8192.0) / erpm, "Q13 of Q16",
          "corner of the back-EMF filter at low speed");
}

static void start(void)
{
    GROUP("start");
    FIELD(forced.end_speed_q10, END_SPEED_RPM, "rpm", 60.0 / pairs / period / 67108864.0, "Q10 angle counts a period", "end of the ramp");
    FIELD(forced.increase_rate_q10, OPENLOOP_RAMPSPEED_INCREASERATE / 67108864.0 / (period * period) * 60.0 / pairs, "rpm/s", 0.0,
          "Q10 counts/period^2", "acceleration");
    FIELD(flying_start, FLYING_START, "1", 1.0, "flag", "1: a rotor that turns is caught");
    FIELD(align_periods, LOCK_TIME * period, "s", 0.0, "periods", "lock");
    FIELD(align_rate_q12, Q_CURRENT_REF_OPENLOOP / (LOCK_TIME * period), "A/s", q13_a / period / 4096.0, "Q12 of Q13 A a period", "growth of the lock's current");
    FIELD(align_rise_q14, PARAM_ALIGN_TEACHES ? PARAM_ALIGN_RI_V / PARAM_ALIGN_TURNS : 0.0, "V", 2.0 * volt, "Q14 V", "what R takes more from turn to turn of the lock; 0: R is not measured");
    FIELD(align_speed_q10, PARAM_ALIGN_TURNS * 60.0 / (LOCK_TIME * period) / pairs, "rpm", 60.0 / pairs / period / 67108864.0, "Q10 angle counts a period", "speed of the lock");
    FIELD(open_loop_q13, Q_CURRENT_REF_OPENLOOP, "A", q13_a, "Q13 A", "current of lock and ramp");
    FIELD(early_erpm, PARAM_EARLY_ERPM / pairs, "rpm", erpm, "erpm", "the hand-over may come from here on");
    FIELD(bootstrap_periods, 0.010, "s", period, "periods", "low sides on before the start");
    FIELD(agree_steps, 0.02, "s", slots, "8 periods", "agreement before the hand-over");
    FIELD(wait_periods, 0.2, "s", period, "periods", "and how long it may take at the end of the ramp");
}

static void limits(void)
{
    double bus = BUS_FULL_SCALE_V / 32768.0, most = MAXIMUM_CURRENT_A;
    GROUP("limits");
    MACRO(PARAM_BRAKE_COUNTS, at_most(most * (MOTOR_RS_OHM + BRIDGE_RS_OHM) * PARAM_ERPM_PER_V / pairs, 32767.0 * erpm), "rpm", erpm, "erpm", "the short-circuited winding takes no more current below");
    FIELD(current_max_q13, most, "A", q13_a, "Q13 A", "current vector that is asked for");
#if MOTOR_SALIENCY_UH
    FIELD(salience_q13, MOTOR_KPHI_V_PER_KRPM / sqrt(3.0) * 60.0 / (2.0 * PI * 1000.0 * pairs) / (MOTOR_SALIENCY_UH * 1e-6), "A", q13_a, "Q13 A",
          "-i_d that doubles the flux");
#endif
    FIELD(overcurrent_q13, OVER_CURRENT_THRESHOLD_A, "A", q13_a, "Q13 A", "phase current that trips");
    FIELD(i2t_most_q25, (double)I2T_CURRENT_A * I2T_CURRENT_A, "A^2", 2.0 * q13_a * q13_a, "Q25 A^2", "heat that trips");
    FIELD(i2t_rate_q16, 0.512 / I2T_TIME_SEC, "1", 1.0 / 65536.0, "Q16 a step", "what the heat follows in 512 ms");
    FIELD(supply_limit_q13, PARAM_SUPPLY_Q13, "A", q13_a, "Q13 A", "what the supply gives, as a q current at the voltage circle; 0: no limit");
    FIELD(derate_per_bus_q8, DERATE_BELOW_V ? 0.8 * most / (DERATE_BELOW_V - UNDER_VOLTAGE_V) : 0.0, "A/V", q13_a / bus / 256.0, "Q8", "driving current taken off a volt; 0: none");
    FIELD(fieldweak.trim_max_q13, FW_TRIM_CURRENT_A, "A", q13_a, "Q13 A", "most that the voltage feedback adds");
    FIELD(flux_brake_most_q13, PARAM_FLUX_BRAKES ? most * 31.0 / 32.0 : 0.0, "A", q13_a, "Q13 A", "most d current that burns the rotor's energy");
    FIELD(current_max_reciprocal, most, "A", most / (33554432.0 / (most / q13_a)), "2^25 / Q13", "its reciprocal");
    FIELD(bus_over_q15, OVER_VOLTAGE_V, "V", bus, "Q15 of full scale", "trips");
    FIELD(bus_under_q15, UNDER_VOLTAGE_V, "V", bus, "Q15 of full scale", "trips");
    FIELD(bus_used_q15, PARAM_USED_BUS_V, "V", bus, "Q15 of full scale", "most that the voltage circle makes use of");
    FIELD(bus_regen_q15, REGEN_LIMIT_V, "V", bus, "Q15 of full scale", "braking is reduced from here");
    FIELD(bus_nominal_q15, NOMINAL_BUS_V, "V", bus, "Q15 of full scale", "supply");
    FIELD(brake_per_bus_q8, most / 2.0, "A/V", most / 2.0 / (256.0 * p.current_max_q13 / BUS_Q15(2.0F)), "Q8", "braking current taken off a volt");
    FIELD(stall_steps, PARAM_STALL_SEC, "s", 2.0 * slots, "16 periods", "stall");
    FIELD(lost_lock_steps, 0.06, "s", 2.0 * slots, "16 periods", "lost lock");
    FIELD(wrong_steps, 0.1, "s", slots, "8 periods", "voltages and currents do not fit the motor");
    FIELD(load_erpm, at_most(PARAM_KT / MOTOR_INERTIA_KGM2 * MAXIMUM_CURRENT_A * PARAM_LOAD_MEAN / (2.0 * PARAM_PI * PARAM_LOADED_SHARE * LOAD_BANDWIDTH_HZ)
                             * 60.0 / (2.0 * PARAM_PI), 32767.0 * erpm), "rpm", erpm, "erpm", "mean innovation that no load makes");
    FIELD(impossible_steps, 0.25, "s", SLOW_ROUND_STEPS * slots, "32 periods", "flux or resistance impossible");
    FIELD(kfi_impossible, 1.0 / PARAM_FLUX_MOST - 1.0, "1", 1.0 / 32768.0, "Q15", "change of 1/Kphi that no magnet gives");
    FIELD(id_off_q13, most / 32.0 + fmax(0.2 * PARAM_DEAD_TIME_V * PARAM_IU / (16.0 * D_CURRCNTR_PTERM),
                                          0.65 * NOMINAL_BUS_V / sqrt(3.0) * LOOPTIME_SEC / (16.0 * 0.001 * MOTOR_LS_MH)), "A", q13_a, "Q13 A", "d current's mean deviation");
    FIELD(rs_impossible, (PARAM_RS_RISES > 0.99 * PARAM_RS_MOST) ? PARAM_RS_RISES : 1.0, "1", 1.0 / 32768.0, "Q15", "change of R that no winding survives, 1: not told");
    FIELD(rs_off_least, PARAM_R_LEAST - 1.0, "1", 1.0 / 32768.0, "Q15", "so far may R be off");
    FIELD(rs_off_most, PARAM_R_MOST - 1.0, "1", 1.0 / 32768.0, "Q15", "upwards");
    FIELD(ls_off, PARAM_L_OFF, "1", 1.0 / 32768.0, "Q15", "and L");
    FIELD(dead_emf_q12, PARAM_DEAD_TIME_V, "V", 8.0 * volt, "Q12 V", "what dead time may put into the back-EMF");
}

/* Temperatures: nothing without a sensor. */
#if HEAT_USED
#define NTC_SHARE(stem, n) \
    (1.0 / (1.0 + stem##_NTC_DIVIDER_OHM / (stem##_NTC_OHM * exp(stem##_NTC_BETA_K * (1.0 / (273.15 + NTC_LEAST_C + NTC_STEP_C * (n)) - 1.0 / 298.15)))))
#define NTC(field, stem) \
    FIELD(field.derate_q4, stem##_DERATE_C, "C", 1.0 / 16.0, "Q4 C", "driving current is reduced from here"); \
    FIELD(field.trip_q4, stem##_TRIP_C, "C", 1.0 / 16.0, "Q4 C", "trips"); \
    FIELD(field.derate_per_q4_q8, 0.8 * MAXIMUM_CURRENT_A / (stem##_TRIP_C - stem##_DERATE_C), "A/K", q13_a * 16.0 / 256.0, "Q8", "driving current taken off a kelvin"); \
    NTC_NODE(field, stem, 0); NTC_NODE(field, stem, 1); NTC_NODE(field, stem, 2); NTC_NODE(field, stem, 3); NTC_NODE(field, stem, 4); \
    NTC_NODE(field, stem, 5); NTC_NODE(field, stem, 6); NTC_NODE(field, stem, 7); NTC_NODE(field, stem, 8); NTC_NODE(field, stem, 9); \
    NTC_NODE(field, stem, 10); NTC_NODE(field, stem, 11); NTC_NODE(field, stem, 12)
#define NTC_NODE(field, stem, n) FIELD(field.share_q16[n], NTC_SHARE(stem, n), "1", 1.0 / 65536.0, "Q16", "share of 3.3 V, 16 K from one to the next, -40 degrees the first")
#endif

static void temperatures(void)
{
#if HEAT_USED
    GROUP("temperatures");
#endif
#if MOTOR_NTC_USED
    NTC(motor_ntc, MOTOR);
#endif
#if BRIDGE_NTC_USED
    NTC(bridge_ntc, BRIDGE);
#endif
}

static void modulator(void)
{
    double top = (double)p.svm.top / p.svm.full;
    GROUP("modulator and bus");
    FIELD(svm.full, period * 1e6, "us", 0.025, "25 ns", "duty of 100 %");
    FIELD(svm.top, 100.0 * top, "%", 0.0, "duty", "highest duty: sampling window");
    FIELD(svm.dead_time, DEADTIME_SEC * 1e6, "us", 0.025, "25 ns", "dead-time compensation");
    FIELD(svm.knee_q13, p.svm.knee_q13 * q13_a, "A", 0.0, "Q13 A", "current from which it is full");
    FIELD(svm.dead_slope_q8, (double)p.svm.dead_time / p.svm.knee_q13, "1", 1.0 / 256.0, "Q8", "duty per current");
    FIELD(svm.turn_q13, PARAM_DI(MAXIMUM_SPEED_RPM) * 2.0 * ampere, "A", 0.0, "Q13 A", "most that a current turns in a period");
    FIELD(bus_shift, 1 << p.bus_shift, "1", 0.0, "count", "the bus is shifted left by it");
    FIELD(voltage_limit_per_bus_q16, top / sqrt(3.0), "V/V", volt * (1 << p.bus_shift) / BUS_FULL_SCALE_V, "Q14 V per Q16 bus", "voltage circle");
    FIELD(duty_per_volt_numerator, BUS_FULL_SCALE_V, "V", BUS_FULL_SCALE_V / (p.svm.full * 4.0 * volt / BUS_FULL_SCALE_V * 4294967296.0), "Q32",
          "duty per volt at bus 1");
    FIELD(kcurr_a, KCURRA, "1", 1.0 / 32768.0, "Q15", "gain of the samples");
    FIELD(kcurr_b, KCURRB, "1", 1.0 / 32768.0, "Q15", "gain of the samples");
}

static void field_weakening(void)
{
    double kphi = MOTOR_KPHI_V_PER_KRPM * PARAM_INVKFI;
    GROUP("field weakening");
    FIELD(fieldweak.index_per_count_q16, 1024.0 / pairs, "rpm", 0.0, "Q16 entries/erpm", "entries are so far apart");
    FIELD(fieldweak.trim_speed_erpm, FW_START_SPEED_RPM * 0.6, "rpm", erpm, "erpm", "speed from which it acts");
#define ENTRY(i) \
    FIELD(fieldweak.idref_q13[i], IDREF_SPEED##i, "A", q13_a, "Q13 A", "d current"); \
    FIELD(fieldweak.inv_kfi[i], kphi / p.fieldweak.inv_kfi[i], "V/krpm", 0.0, "Q15 / 2, 1/Kphi", "1/Kphi"); \
    FIELD(fieldweak.ls_over2ls0_q15[i], LS_OVER2LS0_SPEED##i, "1", 1.0 / 32768.0, "Q15", "Ls/(2 Ls0)")
    ENTRY(0); ENTRY(1); ENTRY(2); ENTRY(3); ENTRY(4); ENTRY(5); ENTRY(6); ENTRY(7); ENTRY(8);
    ENTRY(9); ENTRY(10); ENTRY(11); ENTRY(12); ENTRY(13); ENTRY(14); ENTRY(15); ENTRY(16); ENTRY(17);
}

#define RELATION(condition, message) if (!(condition)) { puts("relation|" message); }
#define RANGE(name, unit, min, max, value, meaning) if (!(PARAM_F(name) >= PARAM_F(min) && PARAM_F(name) <= PARAM_F(max))) { puts("range|" #name); }

int main(void)
{
    volt = NOMINAL_BUS_V / sqrt(3.0) * (1.0 - DEADTIME_SEC / LOOPTIME_SEC) / 32768.0;
    ohm = volt / ampere;
    q13_a = 4.0 * ampere;
    erpm = SPEED_UNIT / pairs;
    slots = SLOW_PERIODS * period;
    motor();
    estimator();
    speeds();
    controllers();
    observer();
    start();
    limits();
    temperatures();
    modulator();
    field_weakening();
    PARAM_RELATION_TABLE(RELATION)
    PARAM_TABLE(RANGE)
    return 0;
}
