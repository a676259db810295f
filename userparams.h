/* Everything a user edits, in engineering units: the motor, the supply, limits, start, control loops and field weakening.
 *
 * Made from tuning/motors/hurst_dmb0224c10002.toml and tuning/boards/mclv.toml by: make tune MOTOR=hurst_dmb0224c10002
 * (make userparams MOTOR=hurst_dmb0224c10002 writes it to userparams.h). Field weakening: tuning/tables/hurst_dmb0224c10002.toml, found on the virtual board by make tune-fw.
 *
 * Each line states unit, range and meaning; a value outside its range fails the build by name. Change a number here to try it; to keep
 * it, write it into the motor file's [tune] and make the header again. The Q15 constants of AN1292 (NORM_RS, NORM_LSDTBASE,
 * NORM_INVKFIBASE, NORM_DELTAT, D_ILIMIT_HS ...) follow from these in include/drive/scaling/; the table at the end shows them.
 *
 * Note: 24 V are too low for the rated torque at rated speed: about 0.063 N m of 0.08 N m at 2800 rpm; raise the supply voltage,
 * or lower the rated speed to 2300 rpm */
#ifndef USERPARAMS_H
#define USERPARAMS_H

/* ---- Modes: remove the comment marks, or build with -D ------------------------------------------------------------ */
/* #define OPEN_LOOP_FUNCTIONING */ /* stay on the forced angle at END_SPEED_RPM; the estimator runs along and can be watched */
/* #define TUNING */                /* the speed reference ramps slowly from the hand-over to MAXIMUM_SPEED_RPM by itself */
/* #define TORQUE_MODE */           /* the potentiometer commands the q current; MAXIMUM_SPEED_RPM still limits the speed */
/* #define BIDIRECTIONAL_SPEED */   /* the potentiometer's sides are the two directions, its middle is MINIMUM_SPEED_RPM; S3 has no function */
/* #define TORQUE_PROFILE */        /* learn the current that a load pulsing with the shaft's turn takes: piston pumps, compressors */
/* #define SNAPSHOT */              /* record SnapBuf1..4 */
/* #define IDENTIFY */              /* measure R, L, Kphi, inertia and friction of the motor instead of running it (docs/tuning.md) */
/* #define BRINGUP */               /* check a new board step by step with little current instead of running the motor (docs/bringup.md) */
/* #define PARAMS_IN_RAM */         /* a debugger can change every parameter while the motor turns; TUNING does it too */
/* #define SELFTEST_OFF */          /* leave out the self-tests in the manner of IEC 60730 Class B (docs/selftest.md) */

/* ---- Motor, values per phase of the star: Hurst DMB0224C10002, star ----------------------------------------------- */
#define NOPOLESPAIRS 5              /* [pairs]         1 .. 50        pole pairs */
#define MOTOR_RS_OHM 2.67           /* [ohm]           0.01 .. 40     phase resistance: half of line to line */
#define MOTOR_LS_MH 1.92            /* [mH]            0.01 .. 30     phase inductance: half of line to line */
#define MOTOR_SALIENCY_UH 0         /* [uH]            0 .. 20000     Lq - Ld of a salient motor, whose MOTOR_LS_MH is Lq: least current for the torque (MTPA); 0: not salient */
#define MOTOR_KPHI_V_PER_KRPM 7.24  /* [V peak/krpm]   0.2 .. 2000    line-to-line back-EMF per 1000 mechanical rpm */
#define MOTOR_INERTIA_KGM2 5.5e-6   /* [kg m2]         1e-8 .. 10     rotor and whatever turns with it; scales the speed loop */

/* ---- Supply and board: dsPICDEM MCLV, 24 V supply ----------------------------------------------------------------- */
#define NOMINAL_BUS_V 24.0          /* [V]             8 .. 60        supply; the unit of voltage follows from it */
#define LOOPTIME_SEC 0.00005        /* [s]             0.000025 .. 0.00014 PWM and control period */
#define DEADTIME_SEC 0.000002       /* [s]             0.0000005 .. 0.000003 dead time of the bridge */
#define NORM_CURRENT_CONST 0.0001342773 /* [A/count]       0.000001 .. 0.01 current of one count, full scale / 32768; calibrate with a probe: 4.4 A full scale */
#define KCURRA -0.5                 /* [1]             -0.6 .. 0.6    gain of phase A's current, 0.5 = 1; negative: shunt in the low leg */
#define KCURRB -0.5                 /* [1]             -0.6 .. 0.6    gain of phase B's current */
#define BUS_FULL_SCALE_V 52.8       /* [V]             10 .. 330      bus voltage that gives full scale at the converter */
#define SAMPLE_WINDOW_SEC 0.0000016 /* [s]             0.0000015 .. 0.000004 at the highest duty low sides on for this long on each side of the middle of their on time */
#define FAULT_INPUT_USED 1          /* [switch]        0 .. 1         1: FLTA1 low switches the outputs off; 0: a board without it, where only OVER_CURRENT_THRESHOLD_A protects */

/* ---- Speeds ------------------------------------------------------------------------------------------------------- */
#define MINIMUM_SPEED_RPM 150       /* [rpm]           2 .. 10000     potentiometer at zero */
#define NOMINAL_SPEED_RPM 2800      /* [rpm]           20 .. 30000    potentiometer at full scale, S3 off; the estimator's derivative changes here */
#define MAXIMUM_SPEED_RPM 5500      /* [rpm]           20 .. 32000    potentiometer at full scale, S3 on */
#define SPEEDREFRAMP_RPM_PER_S 4000 /* [rpm/s]         1 .. 60000     slope of the speed reference */
#define SPEEDREF_DECEL_RPM_PER_S 0  /* [rpm/s]         0 .. 60000     slope of the speed reference towards standstill, in a stop too; 0: SPEEDREFRAMP_RPM_PER_S */
#define TUNING_DELAY_RAMPUP 0xF     /* [periods]       0 .. 4095      TUNING: one electrical rpm every TUNING_DELAY_RAMPUP + 1 periods */
#define POT_LIVE_ZERO 0.0           /* [1]             0 .. 0.2       dead end at each side of the potentiometer's travel: a signal in its outer half is a broken wire; 0: none */

/* ---- Start: align, ramp, hand-over -------------------------------------------------------------------------------- */
#define LOCK_TIME 18750             /* [periods]       2000 .. 64000  the start's current grows from nothing while it turns five times: 0.938 s */
#define END_SPEED_RPM 1000          /* [rpm]           2 .. 10000     end of the ramp, where the estimator takes over: back-EMF 4.18 V */
#define OPENLOOP_RAMPSPEED_INCREASERATE 10 /* [count/1024/period] 1 .. 2000      acceleration of the ramp: 715 rpm/s, 1.40 s to the end */
#define Q_CURRENT_REF_OPENLOOP 1.41 /* [A peak]        0.05 .. 20     current of align and ramp: pull-out torque 0.0844 N m */
#define FLYING_START 1              /* [switch]        0 .. 1         1: a rotor that turns is caught at its speed; 0: every start aligns it */

/* ---- Limits and protections --------------------------------------------------------------------------------------- */
#define MAXIMUM_CURRENT_A 2.75      /* [A peak]        0.1 .. 20      length of the current vector that the drive may ask for */
#define OVER_CURRENT_THRESHOLD_A 3.8 /* [A peak]        0.1 .. 40      any phase above trips at once; must lie inside the converter's range */
#define OVER_VOLTAGE_V 34.0         /* [V]             9 .. 100       bus above trips */
#define UNDER_VOLTAGE_V 12.0        /* [V]             3 .. 55        bus below trips while running */
#define DERATE_BELOW_V 0            /* [V]             0 .. 60        bus below which the driving current is reduced, to a fifth of MAXIMUM_CURRENT_A at UNDER_VOLTAGE_V; 0: not */
#define REGEN_LIMIT_V 27.0          /* [V]             8 .. 90        braking current is reduced from here, to nothing 2 V higher */
#define I2T_CURRENT_A 0             /* [A peak]        0 .. 20        current that the winding stands for ever; more only for a while; 0: no I2t */
#define I2T_TIME_SEC 60             /* [s]             2 .. 1000      the winding's thermal time constant */
#define SUPPLY_CURRENT_LIMIT_A 0    /* [A]             0 .. 20        what the running motor may draw from the supply, in the mean; 0: no limit of its own */

/* ---- Control loops: bandwidths; AN1292's D_CURRCNTR_PTERM ... may be defined instead, see drive/scaling/controllers.h  */
#define CURRENT_BANDWIDTH_HZ 1000   /* [Hz]            20 .. 2000     both current loops: phase margin 72 degrees, 61 over the parameter set */
#define SPEED_BANDWIDTH_HZ 12.6     /* [Hz]            0.2 .. 60      speed loop: phase margin 52 degrees, 51 over the parameter set */
#define LOAD_BANDWIDTH_HZ 107       /* [Hz]            1 .. 200       load observer after a load step; slower under a steady load, slowest without one: phase margin 18 degrees after a load step, 42 under load */

/* ---- Filters, Equation 7: K in Q15 per period --------------------------------------------------------------------- */
#define KFILTER_ESDQ 2000           /* [Q15]           10 .. 8000     back-EMF up to FW_START_SPEED_RPM: 200 Hz */
#define KFILTER_ESDQ_FW 2000        /* [Q15]           10 .. 8000     back-EMF above: 200 Hz */
#define KFILTER_VELESTIM 748        /* [Q15]           10 .. 8000     speed for thresholds and display: 74 Hz */

/* ---- Field weakening: a table entry every 1024 electrical rpm of speed reference, 204.8 rpm with 5 pole pairs ----- */
#define FW_START_SPEED_RPM 2640     /* [rpm]           20 .. 30000    speed reference of entry 0 */
#define FW_TRIM_CURRENT_A 1.5       /* [A]             0 .. 20        most that the voltage feedback may add to the table's d current */

#define IDREF_SPEED0   0.00               /* [A]             -20 .. 0       d current of each entry */
#define IDREF_SPEED1  -0.29
#define IDREF_SPEED2  -0.55
#define IDREF_SPEED3  -0.81
#define IDREF_SPEED4  -1.05
#define IDREF_SPEED5  -1.28
#define IDREF_SPEED6  -1.51
#define IDREF_SPEED7  -1.53
#define IDREF_SPEED8  -1.62
#define IDREF_SPEED9  -1.78
#define IDREF_SPEED10 -1.95
#define IDREF_SPEED11 -2.10
#define IDREF_SPEED12 -2.25
#define IDREF_SPEED13 -2.39
#define IDREF_SPEED14 -2.52
#define IDREF_SPEED15 -2.63
#define IDREF_SPEED16 -2.66
#define IDREF_SPEED17 -2.66

/* 1/Kphi of each entry, in AN1292's counts; NORM_INVKFIBASE is the motor's own. More turns the control angle ahead. */
#define INVKFI_SPEED0  NORM_INVKFIBASE    /* [Q15/2]         1024 .. 32767  1/Kphi of each entry */
#define INVKFI_SPEED1  NORM_INVKFIBASE
#define INVKFI_SPEED2  NORM_INVKFIBASE
#define INVKFI_SPEED3  NORM_INVKFIBASE
#define INVKFI_SPEED4  NORM_INVKFIBASE
#define INVKFI_SPEED5  NORM_INVKFIBASE
#define INVKFI_SPEED6  NORM_INVKFIBASE
#define INVKFI_SPEED7  NORM_INVKFIBASE
#define INVKFI_SPEED8  NORM_INVKFIBASE
#define INVKFI_SPEED9  NORM_INVKFIBASE
#define INVKFI_SPEED10 NORM_INVKFIBASE
#define INVKFI_SPEED11 NORM_INVKFIBASE
#define INVKFI_SPEED12 NORM_INVKFIBASE
#define INVKFI_SPEED13 NORM_INVKFIBASE
#define INVKFI_SPEED14 NORM_INVKFIBASE
#define INVKFI_SPEED15 NORM_INVKFIBASE
#define INVKFI_SPEED16 NORM_INVKFIBASE
#define INVKFI_SPEED17 NORM_INVKFIBASE

#define LS_OVER2LS0_SPEED0   0.5          /* [1]             0.1 .. 0.6     Ls / (2 Ls0) of each entry; 0.5 = no change */
#define LS_OVER2LS0_SPEED1   0.5
#define LS_OVER2LS0_SPEED2   0.5
#define LS_OVER2LS0_SPEED3   0.5
#define LS_OVER2LS0_SPEED4   0.5
#define LS_OVER2LS0_SPEED5   0.5
#define LS_OVER2LS0_SPEED6   0.5
#define LS_OVER2LS0_SPEED7   0.5
#define LS_OVER2LS0_SPEED8   0.5
#define LS_OVER2LS0_SPEED9   0.5
#define LS_OVER2LS0_SPEED10  0.5
#define LS_OVER2LS0_SPEED11  0.5
#define LS_OVER2LS0_SPEED12  0.5
#define LS_OVER2LS0_SPEED13  0.5
#define LS_OVER2LS0_SPEED14  0.5
#define LS_OVER2LS0_SPEED15  0.5
#define LS_OVER2LS0_SPEED16  0.5
#define LS_OVER2LS0_SPEED17  0.5

/* ---- Stop: what follows when a stop is requested in closed loop --------------------------------------------------- */
#define STOP_MODE 0                 /* [mode]          0 .. 2         0: ramp down, then let go; 1: coast, outputs off at once; 2: ramp down to where a short circuit of the winding fits, then short it until the rotor stands */

/* ---- Inputs and outputs of a product: their pins and levels are rows of include/board/mclv.h ---------------------- */
#ifndef DIRECTION_INPUT_USED /* or build with -DDIRECTION_INPUT_USED=1 */
#define DIRECTION_INPUT_USED 0      /* [switch]        0 .. 1         1: an input turns the direction round; 0: its pin stays free */
#endif
#ifndef FAULT_OUTPUT_USED /* or build with -DFAULT_OUTPUT_USED=1 */
#define FAULT_OUTPUT_USED 0         /* [switch]        0 .. 1         1: an output for a relay tells of a fault; 0: its pin stays free */
#endif
#ifndef RUNNING_OUTPUT_USED /* or build with -DRUNNING_OUTPUT_USED=1 */
#define RUNNING_OUTPUT_USED 0       /* [switch]        0 .. 1         1: an output for a relay is on while the bridge conducts; 0: its pin stays free */
#endif

/* ---- Brake chopper: an output switches a resistor onto the bus. It must come before REGEN_LIMIT_V ----------------- */
#ifndef BRAKE_CHOPPER_V /* or build with -DBRAKE_CHOPPER_V=0..88 */
#define BRAKE_CHOPPER_V 0           /* [V]             0 .. 88        bus at which the brake resistor is switched on, off again 2 % below; 0: no brake resistor */
#endif
#ifndef BRAKE_CHOPPER_SHARE /* or build with -DBRAKE_CHOPPER_SHARE=0.01..1 */
#define BRAKE_CHOPPER_SHARE 0.1     /* [1]             0.01 .. 1      share of time that the brake resistor bears in the mean of BRAKE_CHOPPER_SEC; 1: always */
#endif
#ifndef BRAKE_CHOPPER_SEC /* or build with -DBRAKE_CHOPPER_SEC=1..60 */
#define BRAKE_CHOPPER_SEC 10        /* [s]             1 .. 60        time of that mean: a cold resistor is on for BRAKE_CHOPPER_SHARE of it at once */
#endif

/* ---- Snapshot ----------------------------------------------------------------------------------------------------- */
#define SNAPDELAY 5                 /* [periods]       1 .. 32000     one row every SNAPDELAY periods */
#define DATA_BUFFER_SIZE 50         /* [rows]          2 .. 150       rows of each of the four arrays */

/* ---- Fault recorder: 48 rows before a fault, 16 from it on -------------------------------------------------------- */
#define RECORDER_PERIODS 4          /* [periods]       0 .. 64        one row every RECORDER_PERIODS periods, a power of two; 0: no recorder */

/* ---- Scope: watch, record and tune by the serial line (docs/scope.md) --------------------------------------------- */
#ifndef SCOPE /* or build with -DSCOPE=1 */
#define SCOPE 0                     /* [switch]        0 .. 1         1: the serial line answers X2C-Scope clients, their trace buffer takes the fault recorder's place; 0: status line only */
#endif
#ifndef PARAMS_KEPT /* or build with -DPARAMS_KEPT=1 */
#define PARAMS_KEPT 0               /* [switch]        0 .. 1         1: with PARAMS_IN_RAM parameters can be kept over a reset, in two pages of flash (docs/kept.md); 0: not */
#endif

/* ---- Retry: a run that a passing fault has ended starts again by itself. Only where nobody can come to harm by it - */
#define RETRY_COUNT 0               /* [times]         0 .. 20        retries before a fault stays; 0: never, appliances usually have 3 */
#define RETRY_PAUSE_SEC 2           /* [s]             0.5 .. 600     outputs off before each retry; S2 ends it */
#define RETRY_FORGET_SEC 10         /* [s]             1 .. 3600      in closed loop without a fault gives the retries back */

/* ---- Temperatures: an NTC thermistor from its input to ground, a resistor from there to 3.3 V --------------------- */
#ifndef MOTOR_NTC_USED /* or build with -DMOTOR_NTC_USED=1 */
#define MOTOR_NTC_USED 0            /* [switch]        0 .. 1         1: there is one in the motor; 0: none, and the rows about it mean nothing */
#endif
#define MOTOR_NTC_OHM 10000         /* [ohm]           100 .. 1000000 its resistance at 25 degrees Celsius */
#define MOTOR_NTC_BETA_K 3435       /* [K]             2000 .. 5000   its B: R = MOTOR_NTC_OHM exp(B (1/T - 1/298.15 K)) */
#define MOTOR_NTC_DIVIDER_OHM 10000 /* [ohm]           100 .. 1000000 the resistor to 3.3 V */
#define MOTOR_DERATE_C 110          /* [C]             0 .. 145       motor warmer than this has its driving current reduced, to a fifth of MAXIMUM_CURRENT_A at MOTOR_TRIP_C */
#define MOTOR_TRIP_C 130            /* [C]             20 .. 150      motor that warm trips, and stays off until it is 10 K cooler */
#ifndef BRIDGE_NTC_USED /* or build with -DBRIDGE_NTC_USED=1 */
#define BRIDGE_NTC_USED 0           /* [switch]        0 .. 1         1: there is one at the bridge; 0: none, and the rows about it mean nothing */
#endif
#define BRIDGE_NTC_OHM 10000        /* [ohm]           100 .. 1000000 its resistance at 25 degrees Celsius */
#define BRIDGE_NTC_BETA_K 3435      /* [K]             2000 .. 5000   its B */
#define BRIDGE_NTC_DIVIDER_OHM 10000 /* [ohm]           100 .. 1000000 the resistor to 3.3 V */
#define BRIDGE_DERATE_C 80          /* [C]             0 .. 145       bridge warmer than this has the driving current reduced, to a fifth of MAXIMUM_CURRENT_A at BRIDGE_TRIP_C */
#define BRIDGE_TRIP_C 100           /* [C]             20 .. 150      bridge that warm trips, and stays off until it is 10 K cooler */

/* ---- What the firmware makes of these numbers: engineering value, its count, and how much rounding changes it -----
 * U0 = 0.000405949 V and I0 = 0.000134277 A per count of Q15 (full scale 13.3 V, 4.4 A)
 *
 * motor
 *   NORM_RS                              2.67 ohm             14470  Q15 / 2                     +0.002 %  Equation 5, AN1292's constant, at most 32767
 *   NORM_LSDTBASE                        1.92 mH               1626  Q15 / 256                   +0.011 %  Equation 5, AN1292's constant, at most 32767
 *   NORM_INVKFIBASE                      7.24 V/krpm           7956  Q15 / 2, 1/Kphi             +0.002 %  Equation 6
 *   NORM_DELTAT                         5e-05 s                1790  Q15 of a turn/erpm          +0.024 %  Equation 1, AN1292's constant
 *   adaptation.rs_base_q16               2.67 ohm             28940  Q16 / 1                     +0.002 %  R of the estimator
 *   estimator.rs_exp                        1 1                   0  count                          exact  the product is shifted left by it
 *   fieldweak.ls_base_q16                1.92 mH              52026  Q16 / 1                     -0.000 %  L of the estimator, eight samples
 *   estimator.ls_exp                        1 1                   0  count                          exact  the product is shifted left by it
 *
 * estimator
 *   estimator.deltat_q32                5e-05 s                3579  Q32 of a turn/erpm          -0.004 %  angle a period
 *   estimator.half_step_q16_rad       2.5e-05 s               11244  Q16 rad/erpm                -0.002 %  half of it
 *   estimator.d_ilimit_ls_q14          1.6127 A                6005  Q14 A                       -0.001 %  change in eight periods: D_ILIMIT_LS, or what the format leaves of it
 *   estimator.d_ilimit_hs_q14          0.3489 A                1299  Q14 A                       -0.014 %  change in a period: D_ILIMIT_HS, or what the format leaves of it
 *   D_ILIMIT_LS                        1.6127 A               12010  Q15 A                          exact  the same in AN1292's format
 *   D_ILIMIT_HS                       0.39597 A                2948  Q15 A                          exact  the same in AN1292's format
 *   fieldweak.kfilter_esdq_q16         200.46 Hz               4000  Q16 a period                   exact  Equation 7
 *   fieldweak.kfilter_esdq_fw_q16      200.46 Hz               4000  Q16 a period                   exact  Equation 7
 *   estimator.kfilter_velestim_q16     73.503 Hz               2958  Q16 a period                   exact  Equation 7
 *
 * speeds
 *   SPEED_UNIT                              1 1                   1  count                          exact  electrical rpm of a count of speed: of what `erpm` stands for in this table
 *   minimum_erpm                          150 rpm               750  erpm                           exact  potentiometer at zero
 *   pot_zero_q16                            0 1                   0  Q16                            exact  dead end of its travel
 *   pot_scale_q15                           1 1               32768  Q15                            exact  what is left of it is all
 *   nominal_erpm                         2800 rpm             14000  erpm                           exact  potentiometer at full scale, S3 off
 *   maximum_erpm                         5500 rpm             27500  erpm                           exact  potentiometer at full scale, S3 on
 *   end_erpm                             1000 rpm              5000  erpm                           exact  end of the ramp
 *   fieldweak.on_speed_erpm              2640 rpm             13200  erpm                           exact  field weakening starts
 *   estimator.nominal_erpm               2800 rpm             14000  erpm                           exact  one-sample derivative above
 *   estimator.decimate_erpm               280 rpm              1400  erpm                           exact  sign of Equation 2 from the filtered speed below
 *   speed_ramp_q16                       4000 rpm/s          524288  Q16 erpm every 8 periods       exact  slope of the reference
 *   speed_decel_q16                      4000 rpm/s          524288  Q16 erpm every 8 periods       exact  the same towards standstill
 *   tuning_step_q16                        15 periods         32768  Q16 erpm every 8 periods       exact  slope in TUNING
 *   ramp_hold_erpm                        350 rpm              1750  erpm                           exact  the ramp waits when the motor is further behind
 *   overspeed_erpm                       6540 rpm             32700  erpm                           exact  lost lock above
 *
 * current and speed controllers
 *   pi_d.kp                            12.064 V/A              8172  Q15 / 16                    -0.003 %  proportional gain
 *   pi_d.ki                             16776 V/(A s)           568  Q11 a period                -0.040 %  integral gain
 *   pi_d.kc                             0.999 1               32734  Q15                         -0.004 %  anti-windup
 *   pi_q.kp                            12.064 V/A              8172  Q15 / 16                    -0.003 %  proportional gain
 *   pi_q.ki                             16776 V/(A s)           568  Q11 a period                -0.040 %  integral gain
 *   pi_q.kc                             0.999 1               32734  Q15                         -0.004 %  anti-windup
 *   speed_kp_q13                   0.00076155 A/rpm            2323  Q15 / 16                    -0.002 %  proportional gain
 *   speed_kp_fast_q13               0.0013708 A/rpm            4181  Q15 / 16                    -0.012 %  after a large innovation
 *
 * load observer, adaptation and low speed
 *   observer.deltat_q32                 5e-05 s                3579  Q32 of a turn/erpm          -0.004 %  angle in an eighth of a step
 *   observer.per_turn_q12             0.45776 rpm              9375  Q12 erpm                       exact  2^16 counts of the angle in a step
 *   observer.shift                          3 1                   3  count                          exact  2^this of its units of acceleration are an erpm a step
 *   observer.per_current_q16       1.0396e+05 rpm/s/A         58548  Q16 unit/Q13 A              +0.000 %  Kt/J
 *   observer.per_unit_q15          9.6195e-06 A s/rpm         36679  Q15 Q13 A/unit              -0.000 %  J/Kt
 *   observer.innovation_max_erpm       3276.6 rpm             16383  erpm                           exact  innovation counts up to here
 *   observer.load_max                    2.75 A                4574  units                          exact  largest load
 *   observer.quiet_q16                 15.372 Hz               2531  Q16 a step                  -0.036 %  rate without load
 *   observer.loaded_q16                  32.1 Hz               5287  Q16 a step                  -0.004 %  rate under load
 *   observer.fast_q16                     107 Hz              17623  Q16 a step                  -0.005 %  rate after a large innovation
 *   observer.full_erpm                 475.56 rpm              2377  erpm                        -0.033 %  speed reference from which rates and gain are these
 *   observer.load_from                 0.0625 A                 103  units                       -0.920 %  load that begins to count
 *   observer.load_width                0.0625 A                 103  units                       -0.920 %  over what more it counts
 *   observer.load_slope_q15                16 1/A               315  Q15 a unit                  -0.064 %  one over it
 *   observer.gate_erpm                 29.856 rpm               149  erpm                        -0.189 %  large innovation without load
 *   observer.gate_loaded_erpm          6.8899 rpm                34  erpm                        -1.305 %  and under load
 *   adaptation.rate_q16                     6 1/s               629  Q16 a step                  -0.023 %  flux and R follow
 *   adaptation.kfi_least                 -0.3 1               -9830  Q15                         -0.004 %  least change of 1/Kphi
 *   adaptation.kfi_most                  0.35 1               11468  Q15                         -0.007 %  largest
 *   adaptation.rs_least                  -0.4 1              -13107  Q15                         -0.002 %  least change of R
 *   adaptation.rs_most                    0.6 1               19660  Q15                         -0.004 %  largest
 *   adaptation.emf_least_q12            0.192 V                  59  Q12 V                       -0.204 %  back-EMF from which it learns
 *   adaptation.turned_q12              1.7463 V                 537  Q12 V                       -0.136 %  back-EMFs of 16 periods that are a turn by HELD_TURNED_RAD
 *   sample_shift_q16               3.2656e-06 A/rpm              80  Q16 Q13 A/erpm              +0.386 %  q current that the sample misses
 *   fieldweak.esdq_per_erpm_q13       0.41667 Hz/rpm          14055  Q13 of Q16                  -0.002 %  corner of the back-EMF filter at low speed
 *
 * start
 *   forced.end_speed_q10                 1000 rpm            279620  Q10 angle counts a period   -0.000 %  end of the ramp
 *   forced.increase_rate_q10           715.26 rpm/s              10  Q10 counts/period^2            exact  acceleration
 *   flying_start                            1 1                   1  flag                           exact  1: a rotor that turns is caught
 *   align_periods                      0.9375 s               18750  periods                        exact  lock
 *   align_rate_q12                      1.504 A/s               573  Q12 of Q13 A a period       -0.083 %  growth of the lock's current
 *   align_rise_q14                    0.75294 V                 927  Q14 V                       -0.041 %  what R takes more from turn to turn of the lock; 0: R is not measured
 *   align_speed_q10                        64 rpm             17896  Q10 angle counts a period   +0.002 %  speed of the lock
 *   open_loop_q13                        1.41 A                2625  Q13 A                       -0.006 %  current of lock and ramp
 *   early_erpm                            240 rpm              1200  erpm                           exact  the hand-over may come from here on
 *   bootstrap_periods                    0.01 s                 200  periods                        exact  low sides on before the start
 *   agree_steps                          0.02 s                  50  8 periods                      exact  agreement before the hand-over
 *   wait_periods                          0.2 s                4000  periods                        exact  and how long it may take at the end of the ramp
 *
 * limits
 *   PARAM_BRAKE_COUNTS                 1756.6 rpm              8782  erpm                        -0.010 %  the short-circuited winding takes no more current below
 *   current_max_q13                      2.75 A                5120  Q13 A                       -0.000 %  current vector that is asked for
 *   overcurrent_q13                       3.8 A                7075  Q13 A                       +0.001 %  phase current that trips
 *   i2t_most_q25                            0 A^2                 0  Q25 A^2                        exact  heat that trips
 *   i2t_rate_q16                    0.0085333 1                 559  Q16 a step                  -0.043 %  what the heat follows in 512 ms
 *   supply_limit_q13                        0 A                   0  Q13 A                          exact  what the supply gives, as a q current at the voltage circle; 0: no limit
 *   derate_per_bus_q8                       0 A/V                 0  Q8                             exact  driving current taken off a volt; 0: none
 *   fieldweak.trim_max_q13                1.5 A                2793  Q13 A                       +0.010 %  most that the voltage feedback adds
 *   flux_brake_most_q13                2.6641 A                4960  Q13 A                       -0.000 %  most d current that burns the rotor's energy
 *   current_max_reciprocal               2.75 A                6554  2^25 / Q13                  +0.006 %  its reciprocal
 *   bus_over_q15                           34 V               21101  Q15 of full scale           +0.002 %  trips
 *   bus_under_q15                          12 V                7447  Q15 of full scale           -0.004 %  trips
 *   bus_used_q15                           30 V               18618  Q15 of full scale           -0.001 %  most that the voltage circle makes use of
 *   bus_regen_q15                          27 V               16756  Q15 of full scale           -0.002 %  braking is reduced from here
 *   bus_nominal_q15                        24 V               14895  Q15 of full scale           +0.003 %  supply
 *   brake_per_bus_q8                    1.375 A/V              1056  Q8                          -0.017 %  braking current taken off a volt
 *   stall_steps                          0.23 s                 288  16 periods                  +0.174 %  stall
 *   lost_lock_steps                      0.06 s                  75  16 periods                     exact  lost lock
 *   wrong_steps                           0.1 s                 250  8 periods                      exact  voltages and currents do not fit the motor
 *   load_erpm                          225.59 rpm              1128  erpm                        +0.005 %  mean innovation that no load makes
 *   impossible_steps                     0.25 s                 156  32 periods                  -0.160 %  flux or resistance impossible
 *   kfi_impossible                       -0.2 1               -6554  Q15                         +0.006 %  change of 1/Kphi that no magnet gives
 *   id_off_q13                        0.10185 A                 190  Q13 A                       +0.194 %  d current's mean deviation
 *   rs_impossible                         0.6 1               19660  Q15                         -0.004 %  change of R that no winding survives, 1: not told
 *   rs_off_least                         -0.3 1               -9830  Q15                         -0.004 %  so far may R be off
 *   rs_off_most                           0.5 1               16384  Q15                            exact  upwards
 *   ls_off                                0.3 1                9830  Q15                         -0.004 %  and L
 *   dead_emf_q12                         0.96 V                 296  Q12 V                       +0.134 %  what dead time may put into the back-EMF
 *
 * modulator and bus
 *   svm.full                               50 us               2000  25 ns                          exact  duty of 100 %
 *   svm.top                              93.6 %                1872  duty                           exact  highest duty: sampling window
 *   svm.dead_time                           2 us                 80  25 ns                          exact  dead-time compensation
 *   svm.knee_q13                    0.0032227 A                   6  Q13 A                          exact  current from which it is full
 *   svm.dead_slope_q8                  13.333 1                3413  Q8                          -0.010 %  duty per current
 *   svm.turn_q13                      0.39597 A                 737  Q13 A                          exact  most that a current turns in a period
 *   bus_shift                               2 1                   1  count                          exact  the bus is shifted left by it
 *   voltage_limit_per_bus_q16          0.5404 V/V             35143  Q14 V per Q16 bus           -0.002 %  voltage circle
 *   duty_per_volt_numerator              52.8 V           264172656  Q32                         +0.000 %  duty per volt at bus 1
 *   kcurr_a                              -0.5 1              -16384  Q15                            exact  gain of the samples
 *   kcurr_b                              -0.5 1              -16384  Q15                            exact  gain of the samples
 *
 * field weakening
 *   fieldweak.index_per_count_q16       204.8 rpm                64  Q16 entries/erpm               exact  entries are so far apart
 *   fieldweak.trim_speed_erpm            1584 rpm              7920  erpm                           exact  speed from which it acts
 */

#endif
