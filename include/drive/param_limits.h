/* Every parameter of userparams.h, one row each, and what must hold between them. */
#ifndef DRIVE_PARAM_LIMITS_H
#define DRIVE_PARAM_LIMITS_H

/* Rows on lines of their own: clang-format would stagger them. */
/* clang-format off */

/** X(name, unit, minimum, maximum, default, meaning): one row a parameter. The build checks the range; userparams.h, the tuner,
 *  the spreadsheet and docs/parameters.md are made from the same rows. The default of a value that follows from something else says
 *  from what: FROM_MOTOR and FROM_BOARD (files in tuning/), FROM_TUNER. Tools read the rows as text: keep a row on a line. */
#define PARAM_TABLE(X) PARAM_MOTOR(X) PARAM_BOARD(X) PARAM_SPEEDS(X) PARAM_START(X) PARAM_LIMITS(X) PARAM_LOOPS(X) PARAM_FILTERS(X) \
    PARAM_FIELD_WEAKENING(X) PARAM_STOP(X) PARAM_SIGNALS(X) PARAM_CHOPPER(X) PARAM_SNAPSHOT(X) PARAM_RECORDER(X) PARAM_SCOPE(X) PARAM_RETRY(X) PARAM_HEAT(X)

#define PARAM_MOTOR(X) /* Motor, values per phase of the star */ \
    X(NOPOLESPAIRS, "pairs", 1, 50, FROM_MOTOR, "pole pairs") \
    X(MOTOR_RS_OHM, "ohm", 0.01, 40, FROM_MOTOR, "phase resistance: half of line to line") \
    X(MOTOR_LS_MH, "mH", 0.01, 30, FROM_MOTOR, "phase inductance: half of line to line") \
    X(MOTOR_SALIENCY_UH, "uH", 0, 20000, 0, "Lq - Ld of a salient motor, whose MOTOR_LS_MH is Lq: least current for the torque (MTPA); 0: not salient") \
    X(MOTOR_KPHI_V_PER_KRPM, "V peak/krpm", 0.2, 2000, FROM_MOTOR, "line-to-line back-EMF per 1000 mechanical rpm") \
    X(MOTOR_INERTIA_KGM2, "kg m2", 1e-8, 10, FROM_MOTOR, "rotor and whatever turns with it; scales the speed loop")

#define PARAM_BOARD(X) /* Supply and board */ \
    X(NOMINAL_BUS_V, "V", 8, 60, FROM_BOARD, "supply; the unit of voltage follows from it") \
    X(LOOPTIME_SEC, "s", 0.000025, 0.00014, FROM_BOARD, "PWM and control period") \
    X(DEADTIME_SEC, "s", 0.0000005, 0.000003, FROM_BOARD, "dead time of the bridge") \
    X(NORM_CURRENT_CONST, "A/count", 0.000001, 0.01, FROM_BOARD, "current of one count, full scale / 32768; calibrate with a probe") \
    X(KCURRA, "1", -0.6, 0.6, FROM_BOARD, "gain of phase A's current, 0.5 = 1; negative: shunt in the low leg") \
    X(KCURRB, "1", -0.6, 0.6, FROM_BOARD, "gain of phase B's current") \
    X(BUS_FULL_SCALE_V, "V", 10, 330, FROM_BOARD, "bus voltage that gives full scale at the converter") \
    X(SAMPLE_WINDOW_SEC, "s", 0.0000015, 0.000004, FROM_BOARD, "at the highest duty low sides on for this long on each side of the middle of their on time") \
    X(FAULT_INPUT_USED, "switch", 0, 1, 1, "1: FLTA1 low switches the outputs off; 0: a board without it, where only OVER_CURRENT_THRESHOLD_A protects")

#define PARAM_SPEEDS(X) /* Speeds */ \
    X(MINIMUM_SPEED_RPM, "rpm", 2, 10000, FROM_TUNER, "potentiometer at zero") \
    X(NOMINAL_SPEED_RPM, "rpm", 20, 30000, FROM_TUNER, "potentiometer at full scale, S3 off; the estimator's derivative changes here") \
    X(MAXIMUM_SPEED_RPM, "rpm", 20, 32000, FROM_MOTOR, "potentiometer at full scale, S3 on") \
    X(SPEEDREFRAMP_RPM_PER_S, "rpm/s", 1, 60000, FROM_TUNER, "slope of the speed reference") \
    X(SPEEDREF_DECEL_RPM_PER_S, "rpm/s", 0, 60000, 0, "slope of the speed reference towards standstill, in a stop too; 0: SPEEDREFRAMP_RPM_PER_S") \
    X(TUNING_DELAY_RAMPUP, "periods", 0, 4095, 0xF, "TUNING: one electrical rpm every TUNING_DELAY_RAMPUP + 1 periods") \
    X(POT_LIVE_ZERO, "1", 0, 0.2, 0.0, "dead end at each side of the potentiometer's travel: a signal in its outer half is a broken wire; 0: none")

#define PARAM_START(X) /* Start: align, ramp, hand-over */ \
    X(LOCK_TIME, "periods", 2000, 64000, FROM_TUNER, "the start's current grows from nothing while it turns five times") \
    X(END_SPEED_RPM, "rpm", 2, 10000, FROM_TUNER, "end of the ramp, where the estimator takes over") \
    X(OPENLOOP_RAMPSPEED_INCREASERATE, "count/1024/period", 1, 2000, FROM_TUNER, "acceleration of the ramp") \
    X(Q_CURRENT_REF_OPENLOOP, "A peak", 0.05, 20, FROM_TUNER, "current of align and ramp") \
    X(FLYING_START, "switch", 0, 1, 1, "1: a rotor that turns is caught at its speed; 0: every start aligns it")

#define PARAM_LIMITS(X) /* Limits and protections */ \
    X(MAXIMUM_CURRENT_A, "A peak", 0.1, 20, FROM_MOTOR, "length of the current vector that the drive may ask for") \
    X(OVER_CURRENT_THRESHOLD_A, "A peak", 0.1, 40, FROM_TUNER, "any phase above trips at once; must lie inside the converter's range") \
    X(OVER_VOLTAGE_V, "V", 9, 100, FROM_BOARD, "bus above trips") \
    X(UNDER_VOLTAGE_V, "V", 3, 55, FROM_BOARD, "bus below trips while running") \
    X(DERATE_BELOW_V, "V", 0, 60, 0, "bus below which the driving current is reduced, to a fifth of MAXIMUM_CURRENT_A at UNDER_VOLTAGE_V; 0: not") \
    X(REGEN_LIMIT_V, "V", 8, 90, FROM_BOARD, "braking current is reduced from here, to nothing 2 V higher") \
    X(I2T_CURRENT_A, "A peak", 0, 20, FROM_MOTOR, "current that the winding stands for ever; more only for a while; 0: no I2t") \
    X(I2T_TIME_SEC, "s", 2, 1000, FROM_MOTOR, "the winding's thermal time constant") \
    X(SUPPLY_CURRENT_LIMIT_A, "A", 0, 20, 0, "what the running motor may draw from the supply, in the mean; 0: no limit of its own")

#define PARAM_LOOPS(X) /* Control loops: bandwidths; AN1292's D_CURRCNTR_PTERM ... may be defined instead, see drive/scaling/controllers.h */ \
    X(CURRENT_BANDWIDTH_HZ, "Hz", 20, 2000, FROM_TUNER, "both current loops") \
    X(SPEED_BANDWIDTH_HZ, "Hz", 0.2, 60, FROM_TUNER, "speed loop") \
    X(LOAD_BANDWIDTH_HZ, "Hz", 1, 200, FROM_TUNER, "load observer after a load step; slower under a steady load, slowest without one")

#define PARAM_FILTERS(X) /* Filters, Equation 7: K in Q15 per period */ \
    X(KFILTER_ESDQ, "Q15", 10, 8000, FROM_TUNER, "back-EMF up to FW_START_SPEED_RPM") \
    X(KFILTER_ESDQ_FW, "Q15", 10, 8000, FROM_TUNER, "back-EMF above") \
    X(KFILTER_VELESTIM, "Q15", 10, 8000, FROM_TUNER, "speed for thresholds and display")

#define PARAM_FIELD_WEAKENING(X) /* Field weakening: a table entry every 1024 electrical rpm of speed reference */ \
    X(FW_START_SPEED_RPM, "rpm", 20, 30000, FROM_TUNER, "speed reference of entry 0") \
    X(FW_TRIM_CURRENT_A, "A", 0, 20, FROM_TUNER, "most that the voltage feedback may add to the table's d current") \
    PARAM_ENTRIES(X, IDREF_SPEED, "A", -20, 0, FROM_TUNER, "d current of each entry") \
    PARAM_ENTRIES(X, INVKFI_SPEED, "Q15/2", 1024, 32767, NORM_INVKFIBASE, "1/Kphi of each entry") \
    PARAM_ENTRIES(X, LS_OVER2LS0_SPEED, "1", 0.1, 0.6, 0.5, "Ls / (2 Ls0) of each entry; 0.5 = no change")

#define PARAM_STOP(X) /* Stop: what follows when a stop is requested in closed loop */ \
    X(STOP_MODE, "mode", 0, 2, 0, "0: ramp down, then let go; 1: coast, outputs off at once; 2: ramp down to where a short circuit of the winding fits, then short it until the rotor stands")

#define PARAM_SIGNALS(X) /* Inputs and outputs of a product: their pins and levels are rows of include/board/mclv.h */ \
    X(DIRECTION_INPUT_USED, "switch", 0, 1, 0, "1: an input turns the direction round; 0: its pin stays free") \
    X(FAULT_OUTPUT_USED, "switch", 0, 1, 0, "1: an output for a relay tells of a fault; 0: its pin stays free") \
    X(RUNNING_OUTPUT_USED, "switch", 0, 1, 0, "1: an output for a relay is on while the bridge conducts; 0: its pin stays free")

#define PARAM_CHOPPER(X) /* Brake chopper: an output switches a resistor onto the bus. It must come before REGEN_LIMIT_V */ \
    X(BRAKE_CHOPPER_V, "V", 0, 88, 0, "bus at which the brake resistor is switched on, off again 2 % below; 0: no brake resistor") \
    X(BRAKE_CHOPPER_SHARE, "1", 0.01, 1, 0.1, "share of time that the brake resistor bears in the mean of BRAKE_CHOPPER_SEC; 1: always") \
    X(BRAKE_CHOPPER_SEC, "s", 1, 60, 10, "time of that mean: a cold resistor is on for BRAKE_CHOPPER_SHARE of it at once")

#define PARAM_SNAPSHOT(X) /* Snapshot */ \
    X(SNAPDELAY, "periods", 1, 32000, 5, "one row every SNAPDELAY periods") \
    X(DATA_BUFFER_SIZE, "rows", 2, 150, 50, "rows of each of the four arrays")

#define PARAM_RECORDER(X) /* Fault recorder: 48 rows before a fault, 16 from it on */ \
    X(RECORDER_PERIODS, "periods", 0, 64, 4, "one row every RECORDER_PERIODS periods, a power of two; 0: no recorder")

#define PARAM_SCOPE(X) /* Scope: watch, record and tune by the serial line (docs/scope.md) */ \
    X(SCOPE, "switch", 0, 1, 0, "1: the serial line answers X2C-Scope clients, their trace buffer takes the fault recorder's place; 0: status line only") \
    X(PARAMS_KEPT, "switch", 0, 1, 0, "1: with PARAMS_IN_RAM parameters can be kept over a reset, in two pages of flash (docs/kept.md); 0: not")

#define PARAM_RETRY(X) /* Retry: a run that a passing fault has ended starts again by itself. Only where nobody can come to harm by it */ \
    X(RETRY_COUNT, "times", 0, 20, 0, "retries before a fault stays; 0: never, appliances usually have 3") \
    X(RETRY_PAUSE_SEC, "s", 0.5, 600, 2, "outputs off before each retry; S2 ends it") \
    X(RETRY_FORGET_SEC, "s", 1, 3600, 10, "in closed loop without a fault gives the retries back")

#define PARAM_HEAT(X) /* Temperatures: an NTC thermistor from its input to ground, a resistor from there to 3.3 V */ \
    X(MOTOR_NTC_USED, "switch", 0, 1, 0, "1: there is one in the motor; 0: none, and the rows about it mean nothing") \
    X(MOTOR_NTC_OHM, "ohm", 100, 1000000, 10000, "its resistance at 25 degrees Celsius") \
    X(MOTOR_NTC_BETA_K, "K", 2000, 5000, 3435, "its B: R = MOTOR_NTC_OHM exp(B (1/T - 1/298.15 K))") \
    X(MOTOR_NTC_DIVIDER_OHM, "ohm", 100, 1000000, 10000, "the resistor to 3.3 V") \
    X(MOTOR_DERATE_C, "C", 0, 145, 110, "motor warmer than this has its driving current reduced, to a fifth of MAXIMUM_CURRENT_A at MOTOR_TRIP_C") \
    X(MOTOR_TRIP_C, "C", 20, 150, 130, "motor that warm trips, and stays off until it is 10 K cooler") \
    X(BRIDGE_NTC_USED, "switch", 0, 1, 0, "1: there is one at the bridge; 0: none, and the rows about it mean nothing") \
    X(BRIDGE_NTC_OHM, "ohm", 100, 1000000, 10000, "its resistance at 25 degrees Celsius") \
    X(BRIDGE_NTC_BETA_K, "K", 2000, 5000, 3435, "its B") \
    X(BRIDGE_NTC_DIVIDER_OHM, "ohm", 100, 1000000, 10000, "the resistor to 3.3 V") \
    X(BRIDGE_DERATE_C, "C", 0, 145, 80, "bridge warmer than this has the driving current reduced, to a fifth of MAXIMUM_CURRENT_A at BRIDGE_TRIP_C") \
    X(BRIDGE_TRIP_C, "C", 20, 150, 100, "bridge that warm trips, and stays off until it is 10 K cooler")

/** The 18 parameters of a table: stem0 .. stem17. */
#define PARAM_ENTRIES(X, stem, ...) \
    X(stem##0, __VA_ARGS__) X(stem##1, __VA_ARGS__) X(stem##2, __VA_ARGS__) X(stem##3, __VA_ARGS__) X(stem##4, __VA_ARGS__) \
    X(stem##5, __VA_ARGS__) X(stem##6, __VA_ARGS__) X(stem##7, __VA_ARGS__) X(stem##8, __VA_ARGS__) X(stem##9, __VA_ARGS__) \
    X(stem##10, __VA_ARGS__) X(stem##11, __VA_ARGS__) X(stem##12, __VA_ARGS__) X(stem##13, __VA_ARGS__) X(stem##14, __VA_ARGS__) \
    X(stem##15, __VA_ARGS__) X(stem##16, __VA_ARGS__) X(stem##17, __VA_ARGS__)

/* Ends that the tuner keeps to as well: electrical rpm, beyond SPEED_UNIT_ERPM also turns a period * 60; rated ones a count of SPEED_UNIT; the trip level's
 * share of the current range; what a count of current accelerates. */
#define PARAM_LARGEST_ERPM 75000
#define PARAM_LARGEST_TURN 3.75
#define PARAM_LARGEST_NOMINAL_ERPM 27000
#define PARAM_TRIP_SHARE 0.865
#define PARAM_ACCEL_MOST 1.0
#define PARAM_ACCEL_LEAST 0.0000152587890625

/** A parameter's value for a message, where a userparams.h is in use: " = 150". */
#ifdef DRIVE_PARAM_SCALING_H
#define PARAM_IS(value) " = " PARAM_TEXT(value)
#else
#define PARAM_IS(value)
#endif
#define PARAM_TEXT(...) PARAM_TEXT_(__VA_ARGS__) /* of the value, also if it has a comma */
#define PARAM_TEXT_(...) #__VA_ARGS__
/** A parameter and its value, in a message: "NOPOLESPAIRS = 5". */
#define PARAM_NAMED(name) #name PARAM_IS(name)

/** Whether userparams.h defines a name: the preprocessor leaves any other as it is. */
#define PARAM_GIVEN(name) (__builtin_strcmp(#name, PARAM_TEXT(name)) != 0)
#define PARAM_SAME(name, other) (__builtin_strcmp(PARAM_TEXT(name), PARAM_TEXT(other)) == 0) /* one is the other's value */

/** X(name): what userparams.h may define, too; otherwise drive/scaling/ computes it. */
#define PARAM_OPTIONAL(X) \
    X(BRIDGE_RS_OHM) X(D_CURRCNTR_PTERM) X(D_CURRCNTR_ITERM) X(D_CURRCNTR_CTERM) \
    X(Q_CURRCNTR_PTERM) X(Q_CURRCNTR_ITERM) X(Q_CURRCNTR_CTERM) X(SPEEDCNTR_PTERM)

/** Parameters in these units are whole numbers. */
#define PARAM_COUNTED(unit) \
    (__builtin_strcmp(unit, "pairs") == 0 || __builtin_strcmp(unit, "periods") == 0 || __builtin_strcmp(unit, "rows") == 0 || __builtin_strcmp(unit, "times") == 0 || __builtin_strcmp(unit, "switch") == 0 \
     || __builtin_strcmp(unit, "mode") == 0 \
     || __builtin_strcmp(unit, "uH") == 0 || __builtin_strcmp(unit, "Q15") == 0 || __builtin_strcmp(unit, "count/1024/period") == 0)

/** X(condition, message): what must hold between parameters, and what to change when it does not. Of a group in which one wrong value breaks
 *  several, the compiler tells the first; PARAM_RELATION_REST is asked only where the groups before it hold. The build chooses better (messages.awk). */
#define PARAM_RELATION_TABLE(X) PARAM_RELATION_ALONE(X) PARAM_RELATION_SPEEDS(X) PARAM_RELATION_CURRENTS(X) PARAM_RELATION_BUS(X) PARAM_RELATION_REST(X) \
    PARAM_RELATION_ENTRIES(X)

#define PARAM_RELATION_ALONE(X) \
    X(PARAM_PWM_REST < 0.01F, \
      PARAM_NAMED(LOOPTIME_SEC) " must be a multiple of 50 ns, as 0.00005 is: the PWM counts up and down in steps of 25 ns") \
    PARAM_RELATION_GAIN(X, KCURRA) PARAM_RELATION_GAIN(X, KCURRB) \
    X(PARAM_F(SPEEDREF_DECEL_RPM_PER_S) <= 0.0F || PARAM_F(SPEEDREF_DECEL_RPM_PER_S) >= 1.0F, \
      PARAM_NAMED(SPEEDREF_DECEL_RPM_PER_S) " must be 0, for SPEEDREFRAMP_RPM_PER_S, or at least 1") \
    X(RECORDER_PERIODS != 1 && ((int)(RECORDER_PERIODS) & ((int)(RECORDER_PERIODS) - 1)) == 0, \
      PARAM_NAMED(RECORDER_PERIODS) " must be 0, 2, 4, 8, 16, 32 or 64: the periods are counted in bits") \
    X(PARAM_F(BRIDGE_RS_OHM) >= 0.0F && PARAM_F(BRIDGE_RS_OHM) <= 1.0F, \
      PARAM_NAMED(BRIDGE_RS_OHM) " must be 0 .. 1 ohm: the on-resistance of a transistor and half of the shunt's") \
    X(PARAM_F(D_CURRCNTR_CTERM) >= 0.9F && PARAM_F(D_CURRCNTR_CTERM) < 1.0F, \
      PARAM_NAMED(D_CURRCNTR_CTERM) " must be 0.9 .. 0.9999: it keeps the integrator in its limits") \
    X(PARAM_F(Q_CURRCNTR_CTERM) >= 0.9F && PARAM_F(Q_CURRCNTR_CTERM) < 1.0F, \
      PARAM_NAMED(Q_CURRCNTR_CTERM) " must be 0.9 .. 0.9999: it keeps the integrator in its limits") \
    X(PARAM_F(D_CURRCNTR_PTERM) > 0.0F, PARAM_NAMED(D_CURRCNTR_PTERM) " must be positive") \
    X(PARAM_F(SPEEDCNTR_PTERM) > 0.0F, PARAM_NAMED(SPEEDCNTR_PTERM) " must be positive") \
    X(PARAM_F(Q_CURRCNTR_PTERM) > 0.0F || PARAM_SAME(Q_CURRCNTR_PTERM, D_CURRCNTR_PTERM), PARAM_NAMED(Q_CURRCNTR_PTERM) " must be positive") \
    X(PARAM_F(D_CURRCNTR_ITERM) >= 0.0F, PARAM_NAMED(D_CURRCNTR_ITERM) " must not be negative") \
    X(PARAM_F(Q_CURRCNTR_ITERM) >= 0.0F || PARAM_SAME(Q_CURRCNTR_ITERM, D_CURRCNTR_ITERM), PARAM_NAMED(Q_CURRCNTR_ITERM) " must not be negative") \
    X(PARAM_F(KCURRA) * PARAM_F(KCURRB) >= 0.0F || PARAM_GIVEN(KCURR_SIGNS_DIFFER), \
      PARAM_NAMED(KCURRB) " must have the sign of " PARAM_NAMED(KCURRA) ": the amplifiers are alike; if BRINGUP found one inverted, add " \
      "#define KCURR_SIGNS_DIFFER")

#define PARAM_RELATION_SPEEDS(X) \
    X(NOMINAL_SPEED_RPM > MINIMUM_SPEED_RPM, PARAM_NAMED(NOMINAL_SPEED_RPM) " must be above " PARAM_NAMED(MINIMUM_SPEED_RPM)) \
    X(MAXIMUM_SPEED_RPM >= NOMINAL_SPEED_RPM, PARAM_NAMED(MAXIMUM_SPEED_RPM) " must be at least " PARAM_NAMED(NOMINAL_SPEED_RPM)) \
    X(FW_START_SPEED_RPM < MAXIMUM_SPEED_RPM, PARAM_NAMED(FW_START_SPEED_RPM) " must be below " PARAM_NAMED(MAXIMUM_SPEED_RPM)) \
    X(END_SPEED_RPM <= NOMINAL_SPEED_RPM, PARAM_NAMED(END_SPEED_RPM) " must be at most " PARAM_NAMED(NOMINAL_SPEED_RPM))

#define PARAM_RELATION_CURRENTS(X) \
    X(MAXIMUM_CURRENT_A < OVER_CURRENT_THRESHOLD_A, \
      PARAM_NAMED(MAXIMUM_CURRENT_A) " must be below " PARAM_NAMED(OVER_CURRENT_THRESHOLD_A)) \
    X(Q_CURRENT_REF_OPENLOOP <= MAXIMUM_CURRENT_A, PARAM_NAMED(Q_CURRENT_REF_OPENLOOP) " must not exceed " PARAM_NAMED(MAXIMUM_CURRENT_A)) \
    X(PARAM_F(I2T_CURRENT_A) <= PARAM_F(MAXIMUM_CURRENT_A), \
      PARAM_NAMED(I2T_CURRENT_A) " must not exceed " PARAM_NAMED(MAXIMUM_CURRENT_A) ": a larger one never trips; 0: no I2t") \
    X(PARAM_F(SUPPLY_CURRENT_LIMIT_A) <= 0.0F || (PARAM_F(SUPPLY_CURRENT_LIMIT_A) >= 0.015625F * PARAM_F(MAXIMUM_CURRENT_A) \
                                                  && PARAM_F(SUPPLY_CURRENT_LIMIT_A) <= PARAM_F(MAXIMUM_CURRENT_A)), \
      PARAM_NAMED(SUPPLY_CURRENT_LIMIT_A) " must be 0, for no limit, or 1/64 to 1 of " PARAM_NAMED(MAXIMUM_CURRENT_A) ": the supply gives at most 0.87 of it") \
    X(PARAM_F(FW_TRIM_CURRENT_A) <= PARAM_F(MAXIMUM_CURRENT_A), \
      PARAM_NAMED(FW_TRIM_CURRENT_A) " must not exceed " PARAM_NAMED(MAXIMUM_CURRENT_A)) \
    PARAM_RELATION_IDREF(X, 0) PARAM_RELATION_IDREF(X, 1) PARAM_RELATION_IDREF(X, 2) PARAM_RELATION_IDREF(X, 3) \
    PARAM_RELATION_IDREF(X, 4) PARAM_RELATION_IDREF(X, 5) PARAM_RELATION_IDREF(X, 6) PARAM_RELATION_IDREF(X, 7) \
    PARAM_RELATION_IDREF(X, 8) PARAM_RELATION_IDREF(X, 9) PARAM_RELATION_IDREF(X, 10) PARAM_RELATION_IDREF(X, 11) \
    PARAM_RELATION_IDREF(X, 12) PARAM_RELATION_IDREF(X, 13) PARAM_RELATION_IDREF(X, 14) PARAM_RELATION_IDREF(X, 15) \
    PARAM_RELATION_IDREF(X, 16) PARAM_RELATION_IDREF(X, 17)

#define PARAM_RELATION_BUS(X) \
    X(OVER_VOLTAGE_V > NOMINAL_BUS_V, PARAM_NAMED(OVER_VOLTAGE_V) " must be above " PARAM_NAMED(NOMINAL_BUS_V)) \
    X(UNDER_VOLTAGE_V < NOMINAL_BUS_V, PARAM_NAMED(UNDER_VOLTAGE_V) " must be below " PARAM_NAMED(NOMINAL_BUS_V)) \
    X(PARAM_F(DERATE_BELOW_V) <= 0.0F || PARAM_F(DERATE_BELOW_V) >= PARAM_F(UNDER_VOLTAGE_V) + 1.0F, \
      PARAM_NAMED(DERATE_BELOW_V) " must be 0, for no derating, or at least " PARAM_NAMED(UNDER_VOLTAGE_V) " + 1 V") \
    X(PARAM_F(DERATE_BELOW_V) <= PARAM_F(NOMINAL_BUS_V), PARAM_NAMED(DERATE_BELOW_V) " must be at most " PARAM_NAMED(NOMINAL_BUS_V)) \
    X(REGEN_LIMIT_V > NOMINAL_BUS_V, PARAM_NAMED(REGEN_LIMIT_V) " must be above " PARAM_NAMED(NOMINAL_BUS_V)) \
    X(PARAM_F(REGEN_LIMIT_V) + PARAM_F(BRAKE_BAND_V) <= PARAM_F(OVER_VOLTAGE_V), \
      PARAM_NAMED(REGEN_LIMIT_V) " + 2 V must be at most " PARAM_NAMED(OVER_VOLTAGE_V)) \
    X(PARAM_F(BRAKE_CHOPPER_V) <= 0.0F || PARAM_F(BRAKE_CHOPPER_V) >= 1.05F * PARAM_F(NOMINAL_BUS_V), \
      PARAM_NAMED(BRAKE_CHOPPER_V) " must be 0, for no brake resistor, or at least 1.05 * " PARAM_NAMED(NOMINAL_BUS_V) ": it would burn what the supply gives") \
    X(PARAM_F(BRAKE_CHOPPER_V) <= 0.0F || PARAM_F(REGEN_LIMIT_V) >= 1.02F * PARAM_F(BRAKE_CHOPPER_V), \
      PARAM_NAMED(REGEN_LIMIT_V) " must be at least 1.02 * " PARAM_NAMED(BRAKE_CHOPPER_V) ": the brake resistor comes first, braking is reduced above it")

#define PARAM_RELATION_HEAT(X, stem) \
    X(!(stem##_NTC_USED) || PARAM_F(stem##_DERATE_C) + 5.0F <= PARAM_F(stem##_TRIP_C), \
      PARAM_NAMED(stem##_DERATE_C) " must be at least 5 below " PARAM_NAMED(stem##_TRIP_C)) \
    X(!(stem##_NTC_USED) || PARAM_NTC_SHARE(stem, NTC_LEAST_C) <= 0.985F, \
      PARAM_NAMED(stem##_NTC_DIVIDER_OHM) " must be at least 1/65 of the NTC's resistance at -40 degrees Celsius: cold is not to be told from a broken wire") \
    X(!(stem##_NTC_USED) || PARAM_NTC_SHARE(stem, NTC_MOST_C) >= 0.0115F, \
      PARAM_NAMED(stem##_NTC_DIVIDER_OHM) " must be at most 85 times the NTC's resistance at 152 degrees Celsius: hot is not to be told from a short circuit")

#define PARAM_RELATION_REST(X) \
    PARAM_RELATION_HEAT(X, MOTOR) PARAM_RELATION_HEAT(X, BRIDGE) \
    X(!DEFER_DUTIES || (SCOPE) == 0, \
      PARAM_NAMED(LOOPTIME_SEC) " must be at least 0.00004 with SCOPE, for which a shorter period has no time: leave SCOPE 0, or use a longer period") \
    X(PARAM_TOP_ERPM <= PARAM_F(PARAM_LARGEST_ERPM), \
      PARAM_NAMED(MAXIMUM_SPEED_RPM) " times " PARAM_NAMED(NOPOLESPAIRS) " must be at most 75000 electrical rpm: lower MAXIMUM_SPEED_RPM, or write pole pairs, " \
      "half the number of poles") \
    X(PARAM_TOP_ERPM <= PARAM_F(SPEED_UNIT_ERPM) || PARAM_TOP_ERPM * PARAM_F(LOOPTIME_SEC) <= 1.0001F * PARAM_F(PARAM_LARGEST_TURN), \
      PARAM_NAMED(MAXIMUM_SPEED_RPM) " times NOPOLESPAIRS must be at most 3.75 / LOOPTIME_SEC above 32000 electrical rpm, a sixteenth of a turn " \
      "a period: lower it, or shorten LOOPTIME_SEC") \
    X(PARAM_F(NOMINAL_SPEED_RPM) * PARAM_F(NOPOLESPAIRS) <= PARAM_F(PARAM_LARGEST_NOMINAL_ERPM) * PARAM_F(SPEED_UNIT), \
      "NOMINAL_SPEED_RPM * NOPOLESPAIRS must be at most 27000 (54000 where MAXIMUM_SPEED_RPM is above 32000 electrical rpm): lower NOMINAL_SPEED_RPM, " \
      "the one-sample derivative then starts earlier") \
    X(PARAM_RS_FULL < 524287.0F, \
      PARAM_NAMED(MOTOR_RS_OHM) " does not fit its Q format: raise NORM_CURRENT_CONST's inverse, i.e. use a smaller current range") \
    X(PARAM_LS_FULL * PARAM_LS_RAISED < 524287.0F, \
      PARAM_NAMED(MOTOR_LS_MH) " does not fit its Q format: use a smaller current range (NORM_CURRENT_CONST) or a longer LOOPTIME_SEC") \
    X(PARAM_RS_FULL >= 100.0F, PARAM_NAMED(MOTOR_RS_OHM) " rounds by more than 0.5 %: the current range is too small for this motor") \
    X(PARAM_INVKFI >= 1024.0F && PARAM_INVKFI < 32767.0F, \
      PARAM_NAMED(MOTOR_KPHI_V_PER_KRPM) " does not fit 1/Kphi's Q format (1024 .. 32767): check its unit, V peak line to line per " \
      "1000 rpm") \
    X(PARAM_INVKFI >= 32767.0F || PARAM_INVKFI_FITS(0), \
      PARAM_NAMED(INVKFI_SPEED0) " must be 0.6 .. 1.6 of NORM_INVKFIBASE: write that; a table for another motor, or for another side of 32000 or " \
      "64000 electrical rpm of MAXIMUM_SPEED_RPM, counts otherwise") \
    X(MOTOR_SALIENCY_UH == 0 || PARAM_F(MOTOR_SALIENCY_UH) < 950.0F * PARAM_F(MOTOR_LS_MH), \
      PARAM_NAMED(MOTOR_SALIENCY_UH) " must be below 950 * MOTOR_LS_MH: it is Lq - Ld, and MOTOR_LS_MH is Lq") \
    X(MOTOR_SALIENCY_UH == 0 || (PARAM_SALIENCE_Q13 >= PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A)) \
                                 && PARAM_SALIENCE_Q13 <= PARAM_F(PARAM_SALIENT_FROM) * PARAM_F(CURRENT_Q13(MAXIMUM_CURRENT_A))), \
      PARAM_NAMED(MOTOR_SALIENCY_UH) " times MAXIMUM_CURRENT_A must be 1/8 to 1 of MOTOR_KPHI_V_PER_KRPM * 5513 / NOPOLESPAIRS, the magnets' flux: " \
      "less is not worth it (0), with more the start's current does not align the rotor") \
    X(PARAM_F(OVER_CURRENT_THRESHOLD_A) <= PARAM_F(PARAM_TRIP_SHARE) * 32768.0F * PARAM_F(NORM_CURRENT_CONST), \
      PARAM_NAMED(OVER_CURRENT_THRESHOLD_A) " must be at most 86.5 % of the range NORM_CURRENT_CONST * 32768, or it never trips") \
    X(PARAM_F(MAXIMUM_CURRENT_A) >= 0.063F * 32768.0F * PARAM_F(NORM_CURRENT_CONST), \
      PARAM_NAMED(MAXIMUM_CURRENT_A) " must be at least 6.3 % of the range NORM_CURRENT_CONST * 32768") \
    X(PARAM_EMF_MAX_V < 0.99F * 131068.0F * NORM_VOLTAGE_CONST, \
      "the back-EMF's format overflows: check " PARAM_NAMED(NOPOLESPAIRS) ", half the number of poles, or lower OVER_VOLTAGE_V, OVER_CURRENT_THRESHOLD_A " \
      "or MAXIMUM_SPEED_RPM") \
    X(PARAM_VOLTAGE_PER_BUS < 4.0F * 65535.0F, PARAM_NAMED(BUS_FULL_SCALE_V) " is too large for NOMINAL_BUS_V: their ratio must be at most 16") \
    X(PARAM_F(OVER_VOLTAGE_V) <= 0.98F * PARAM_F(BUS_FULL_SCALE_V), \
      PARAM_NAMED(OVER_VOLTAGE_V) " must be inside BUS_FULL_SCALE_V, or it never trips") \
    X(PARAM_F(OVER_VOLTAGE_V) <= 1.9F * PARAM_F(NOMINAL_BUS_V), \
      PARAM_NAMED(OVER_VOLTAGE_V) " must be at most 1.9 * NOMINAL_BUS_V: the voltage's Q format ends there") \
    X(PARAM_F(UNDER_VOLTAGE_V) >= 0.3F * PARAM_F(NOMINAL_BUS_V), \
      PARAM_NAMED(UNDER_VOLTAGE_V) " must be at least 0.3 * NOMINAL_BUS_V: the voltage circle's reciprocal ends there") \
    X(PARAM_F(DUTY_PER_VOLT_NUMERATOR) / 65536.0F < PARAM_F(BUS_Q15(UNDER_VOLTAGE_V)) * 2.0F, \
      PARAM_NAMED(UNDER_VOLTAGE_V) " is too low for the modulator's division") \
    X(PARAM_F(SAMPLE_WINDOW_SEC) + PARAM_F(SAMPLE_DELAY_CLOCKS) * PWM_TICK_SEC >= PARAM_F(DEADTIME_SEC) + 0.000000999F, \
      PARAM_NAMED(SAMPLE_WINDOW_SEC) " must be at least DEADTIME_SEC + 1 us less the SAMPLE_DELAY_CLOCKS, 25 ns each: " \
      "the low sides then conduct for 1 us before the sample") \
    X(PARAM_F(SAMPLE_WINDOW_SEC) + 0.000000001F >= PARAM_F(SAMPLE_DELAY_CLOCKS) * PWM_TICK_SEC, \
      PARAM_NAMED(SAMPLE_WINDOW_SEC) " must be at least the SAMPLE_DELAY_CLOCKS, 25 ns each: the low sides then still conduct at the sample") \
    PARAM_RELATION_GAIN_FITS(X, 0, D_CURRCNTR_PTERM, 1, CURRENT_BANDWIDTH_HZ) PARAM_RELATION_GAIN_FITS(X, 0, D_CURRCNTR_ITERM, 15.9, CURRENT_BANDWIDTH_HZ) \
    PARAM_RELATION_GAIN_FITS(X, PARAM_SAME(Q_CURRCNTR_PTERM, D_CURRCNTR_PTERM), Q_CURRCNTR_PTERM, 1, CURRENT_BANDWIDTH_HZ) \
    PARAM_RELATION_GAIN_FITS(X, PARAM_SAME(Q_CURRCNTR_ITERM, D_CURRCNTR_ITERM), Q_CURRCNTR_ITERM, 15.9, CURRENT_BANDWIDTH_HZ) \
    PARAM_RELATION_GAIN_FITS(X, 0, SPEEDCNTR_PTERM, 1, SPEED_BANDWIDTH_HZ) \
    X(PARAM_ACCEL < PARAM_F(PARAM_ACCEL_MOST) && PARAM_ACCEL >= PARAM_F(PARAM_ACCEL_LEAST), \
      PARAM_NAMED(MOTOR_INERTIA_KGM2) " does not fit the load observer's format (of a motor file, [mechanical] or [load] inertia): " \
      "check its unit") \
    X((STOP_MODE) != 2 || PARAM_BRAKE_COUNTS >= 1.5F * SPEED_COUNTS(MINIMUM_SPEED_ERPM), \
      PARAM_NAMED(STOP_MODE) " must be 0 or 1 where MAXIMUM_CURRENT_A * MOTOR_RS_OHM is less than 0.000866 * MINIMUM_SPEED_RPM * MOTOR_KPHI_V_PER_KRPM: " \
      "the winding's short circuit would take more current where the ramp has ended") \
    X(PARAM_QUICK_Q16 <= 24576.0F, "LOAD_BANDWIDTH_HZ * LOOPTIME_SEC must be at most 0.0074, or 0.0037 with a LOOPTIME_SEC below 0.00004: the observer's step is eight or sixteen periods") \
    PARAM_RELATION_HELD(X, END_SPEED_RPM) PARAM_RELATION_HELD(X, MINIMUM_SPEED_RPM) \
    X(PARAM_F(SPEED_BANDWIDTH_HZ) <= PARAM_CALM_HZ, \
      PARAM_NAMED(SPEED_BANDWIDTH_HZ) " must be at most 0.148 * LOAD_BANDWIDTH_HZ, or 0.4 of the electrical frequency at " \
      PARAM_NAMED(MINIMUM_SPEED_RPM) " if that is more: lower it, or the speed hunts without load")

/* Where entry 0 fits the motor each is told; else entry 0 is. */
#define PARAM_RELATION_ENTRIES(X) \
    PARAM_RELATION_INVKFI(X, 1) PARAM_RELATION_INVKFI(X, 2) PARAM_RELATION_INVKFI(X, 3) PARAM_RELATION_INVKFI(X, 4) \
    PARAM_RELATION_INVKFI(X, 5) PARAM_RELATION_INVKFI(X, 6) PARAM_RELATION_INVKFI(X, 7) PARAM_RELATION_INVKFI(X, 8) \
    PARAM_RELATION_INVKFI(X, 9) PARAM_RELATION_INVKFI(X, 10) PARAM_RELATION_INVKFI(X, 11) PARAM_RELATION_INVKFI(X, 12) \
    PARAM_RELATION_INVKFI(X, 13) PARAM_RELATION_INVKFI(X, 14) PARAM_RELATION_INVKFI(X, 15) PARAM_RELATION_INVKFI(X, 16) \
    PARAM_RELATION_INVKFI(X, 17)

#define PARAM_INVKFI_LEAST 0.6 /* what an entry may be of the motor's own 1/Kphi; make import reads both */
#define PARAM_INVKFI_MOST 1.6
#define PARAM_INVKFI_FITS(i) \
    (__builtin_fabsf(2.0F * PARAM_F(INVKFI_SPEED##i) / PARAM_INVKFI - PARAM_F(PARAM_INVKFI_MOST) - PARAM_F(PARAM_INVKFI_LEAST)) \
     <= PARAM_F(PARAM_INVKFI_MOST) - PARAM_F(PARAM_INVKFI_LEAST))
#define PARAM_RELATION_INVKFI(X, i) \
    X(PARAM_INVKFI_FITS(i), PARAM_NAMED(INVKFI_SPEED##i) " must be 0.6 .. 1.6 of NORM_INVKFIBASE: write that, or make tune-fw")

#define PARAM_RELATION_IDREF(X, i) \
    X(PARAM_F(IDREF_SPEED##i) >= -PARAM_F(MAXIMUM_CURRENT_A), \
      PARAM_NAMED(IDREF_SPEED##i) " must not exceed " PARAM_NAMED(MAXIMUM_CURRENT_A))

#define PARAM_RELATION_GAIN(X, name) \
    X(PARAM_F(name) >= 0.1F || PARAM_F(name) <= -0.1F, \
      #name PARAM_IS(name) " must be 0.1 .. 0.6 or -0.6 .. -0.1: 0.5 is a gain of 1, and without one no current is measured")

#define PARAM_RELATION_GAIN_FITS(X, unless, name, most, bandwidth) \
    X((unless) || PARAM_F(name) < PARAM_F(most), #name " must be below " #most ", its Q format: lower it where a line defines it, else " #bandwidth PARAM_IS(bandwidth))
#define PARAM_RELATION_HELD(X, name) \
    X(PARAM_F(name) * PARAM_F(NOPOLESPAIRS) >= PARAM_LOWEST_ERPM, \
      #name PARAM_IS(name) " must be at least 1126 * NOMINAL_BUS_V * DEADTIME_SEC / LOOPTIME_SEC / MOTOR_KPHI_V_PER_KRPM: raise it, " \
      "below the rotor is not held against what dead time leaves")

/* ---- How the build refuses a parameter: a call that constant folding does not remove stops the compiler with its message ----
 *
 * gcc 4.5, the chip's compiler, has no _Static_assert. With one function a parameter the compiler's other messages name the parameter,
 * too ("In function 'range_of_..."). The functions are empty in the end, and the linker drops them. */

/** Head of a function that is there to be compiled. */
#define PARAM_CHECK(function) \
    void function(void); \
    void function(void)

/** A block that refuses; `function` is a name that nothing else has. */
#define PARAM_REFUSE(function, ...) \
    { \
        extern void function(void) __attribute__((error("userparams.h: " __VA_ARGS__))); \
        function(); \
    }

/** What a parameter may be, in a message: "0.01 .. 40 ohm (phase resistance)". */
#define PARAM_RANGE(unit, min, max, meaning) #min " .. " #max " " unit " (" meaning ")"

#endif
