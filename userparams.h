/* Everything a user edits, in engineering units: the motor, the supply, limits, start, control loops and field weakening.
 *
 * Each line states unit, range and meaning; a value outside its range fails the build by name. No number here is computed:
 * the Q15 constants of AN1292 (NORM_RS, NORM_LSDTBASE, NORM_INVKFIBASE, NORM_DELTAT, D_ILIMIT_HS ...) follow from these
 * in include/drive/params.h. A motor's values come from tuning/motors/; change them here to tune. */
#ifndef USERPARAMS_H
#define USERPARAMS_H

/* ---- Modes: remove the comment marks, or build with -D ------------------------------------------------------------ */
/* #define OPEN_LOOP_FUNCTIONING */ /* stay on the forced angle at END_SPEED_RPM; the estimator runs along and can be watched */
/* #define TUNING */                /* the speed reference ramps slowly from END_SPEED_RPM to MAXIMUM_SPEED_RPM by itself */
/* #define TORQUE_MODE */           /* the potentiometer commands the q current; MAXIMUM_SPEED_RPM still limits the speed */
/* #define BIDIRECTIONAL_SPEED */   /* the potentiometer's middle is zero; S3 has no function */
/* #define SNAPSHOT */              /* record SnapBuf1..4 */

/* ---- Motor: Hurst DMB0224C10002 (NT Dynamo), star, values per phase ------------------------------------------------ */
#define NOPOLESPAIRS 5              /* [pairs]         1 .. 50        pole pairs */
#define MOTOR_RS_OHM 2.67           /* [ohm]           0.01 .. 40     phase resistance: half of line to line */
#define MOTOR_LS_MH 1.92            /* [mH]            0.01 .. 30     phase inductance: half of line to line */
#define MOTOR_KPHI_V_PER_KRPM 7.24  /* [V peak/krpm]   0.2 .. 200     line-to-line back-EMF per 1000 mechanical rpm */
#define MOTOR_INERTIA_KGM2 5.5e-6   /* [kg m2]         1e-8 .. 0.1    rotor and whatever turns with it; scales the speed loop */

/* ---- Supply and board ---------------------------------------------------------------------------------------------- */
#define NOMINAL_BUS_V 24.0          /* [V]             10 .. 48       supply; the unit of voltage follows from it */
#define LOOPTIME_SEC 0.00005        /* [s]             0.00004 .. 0.00014  PWM and control period */
#define DEADTIME_SEC 0.000002       /* [s]             0.0000005 .. 0.000003  dead time of the bridge */
#define NORM_CURRENT_CONST 0.0001342773 /* [A/count]   0.00001 .. 0.002  current of one count: full scale / 32768 (MCLV: 4.4 A); calibrate with a probe */
#define KCURRA -0.5                 /* [1]             -0.6 .. 0.6     gain of phase A's current, 0.5 = 1; negative: shunt in the low leg */
#define KCURRB -0.5                 /* [1]             -0.6 .. 0.6     gain of phase B's current */
#define BUS_FULL_SCALE_V 52.8       /* [V]             20 .. 200      bus voltage that gives 3.3 V at the converter (divider 1:16) */
#define SAMPLE_WINDOW_SEC 0.0000016 /* [s]             0.0000015 .. 0.000004  low sides on for this long on each side of the sample's centre */

/* ---- Speeds ---------------------------------------------------------------------------------------------------------- */
#define MINIMUM_SPEED_RPM 500       /* [rpm]           50 .. 10000    potentiometer at zero */
#define NOMINAL_SPEED_RPM 2800      /* [rpm]           100 .. 20000   potentiometer at full scale, S3 off; the estimator's derivative changes here */
#define MAXIMUM_SPEED_RPM 5500      /* [rpm]           100 .. 30000   potentiometer at full scale, S3 on */
#define SPEEDREFRAMP_RPM_PER_S 4000 /* [rpm/s]         1 .. 60000     slope of the speed reference */
#define TUNING_DELAY_RAMPUP 0xF     /* [periods]       0 .. 4095      TUNING: one electrical rpm every TUNING_DELAY_RAMPUP + 1 periods */

/* ---- Start: lock, ramp, hand-over ------------------------------------------------------------------------------------- */
#define LOCK_TIME 4000              /* [periods]       200 .. 32000   rotor held at a fixed angle (two directions, half the time each) */
#define END_SPEED_RPM 1000          /* [rpm]           50 .. 5000     end of the ramp, where the estimator takes over */
#define OPENLOOP_RAMPSPEED_INCREASERATE 10 /* [count/1024/period] 1 .. 2000  acceleration of the ramp; 10 = 715 rpm/s with 5 pole pairs */
#define Q_CURRENT_REF_OPENLOOP 1.41 /* [A peak]        0.05 .. 20     current of lock and ramp */

/* ---- Limits and protections ------------------------------------------------------------------------------------------- */
#define MAXIMUM_CURRENT_A 2.75      /* [A peak]        0.1 .. 20      length of the current vector that the drive may ask for */
#define OVER_CURRENT_THRESHOLD_A 3.8 /* [A peak]       0.1 .. 40      any phase above trips at once; must lie inside the converter's range */
#define OVER_VOLTAGE_V 34.0         /* [V]             12 .. 100      bus above trips */
#define UNDER_VOLTAGE_V 12.0        /* [V]             5 .. 45        bus below trips while running */
#define REGEN_LIMIT_V 27.0          /* [V]             11 .. 90       braking current is reduced from here, to nothing 2 V higher */

/* ---- Control loops: bandwidths; the note's D_CURRCNTR_PTERM ... can be given directly instead, see drive/params.h ------ */
#define CURRENT_BANDWIDTH_HZ 800    /* [Hz]            20 .. 2000     both current loops */
#define SPEED_BANDWIDTH_HZ 18       /* [Hz]            0.2 .. 60      speed loop; the estimator is slower the slower the motor turns, so above 20 the speed hunts below 1000 rpm */

/* ---- Filters, Equation 7: K in Q15 per period ---------------------------------------------------------------------------- */
#define KFILTER_ESDQ 1200           /* [Q15]           10 .. 8000     back-EMF up to FW_START_SPEED_RPM; 1200 = 118 Hz */
#define KFILTER_ESDQ_FW 1200        /* [Q15]           10 .. 8000     back-EMF above */
#define KFILTER_VELESTIM 748        /* [Q15]           10 .. 8000     speed for loop, thresholds and display; 748 = 73 Hz */

/* ---- Field weakening: one entry every 1024 electrical rpm (204.8 rpm with 5 pole pairs) of speed reference ----------------- */
#define FW_START_SPEED_RPM 2600     /* [rpm]           100 .. 20000   speed reference of entry 0 */
#define FW_TRIM_CURRENT_A 0.8       /* [A]             0 .. 20        most that the voltage feedback may add to the table's d current */

#define IDREF_SPEED0     0.00          /* [A]            -20 .. 0        d current of each entry */
#define IDREF_SPEED1     0.00
#define IDREF_SPEED2    -0.20
#define IDREF_SPEED3    -0.47
#define IDREF_SPEED4    -0.73
#define IDREF_SPEED5    -0.98
#define IDREF_SPEED6    -1.20
#define IDREF_SPEED7    -1.42
#define IDREF_SPEED8    -1.60
#define IDREF_SPEED9    -1.78
#define IDREF_SPEED10   -1.95
#define IDREF_SPEED11   -2.10
#define IDREF_SPEED12   -2.25
#define IDREF_SPEED13   -2.38
#define IDREF_SPEED14   -2.50
#define IDREF_SPEED15   -2.60
#define IDREF_SPEED16   -2.65
#define IDREF_SPEED17   -2.65

/* 1/Kphi of each entry, in the note's counts. The back-EMF keeps its size above base speed here (it has the range), so a
 * constant Kphi is the right start; the note's rising table made up for a clipped one. More turns the control angle ahead. */
#define INVKFI_SPEED0  NORM_INVKFIBASE   /* [Q15/2]         2048 .. 32767  1/Kphi of each entry */
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

#define LS_OVER2LS0_SPEED0  0.5     /* [1]             0.1 .. 0.6     Ls / (2 Ls0) of each entry; 0.5 = no change */
#define LS_OVER2LS0_SPEED1  0.5
#define LS_OVER2LS0_SPEED2  0.5
#define LS_OVER2LS0_SPEED3  0.5
#define LS_OVER2LS0_SPEED4  0.5
#define LS_OVER2LS0_SPEED5  0.5
#define LS_OVER2LS0_SPEED6  0.5
#define LS_OVER2LS0_SPEED7  0.5
#define LS_OVER2LS0_SPEED8  0.5
#define LS_OVER2LS0_SPEED9  0.5
#define LS_OVER2LS0_SPEED10 0.5
#define LS_OVER2LS0_SPEED11 0.5
#define LS_OVER2LS0_SPEED12 0.5
#define LS_OVER2LS0_SPEED13 0.5
#define LS_OVER2LS0_SPEED14 0.5
#define LS_OVER2LS0_SPEED15 0.5
#define LS_OVER2LS0_SPEED16 0.5
#define LS_OVER2LS0_SPEED17 0.5

/* ---- Snapshot ------------------------------------------------------------------------------------------------------------- */
#define SNAPDELAY 5                 /* [periods]       1 .. 32000     one row every SNAPDELAY periods */
#define DATA_BUFFER_SIZE 50         /* [rows]          2 .. 150       rows of each of the four arrays */

#endif
