/* The one table of modes, and what they ask of parameters and memory: it feeds userparams.h, the build's check of DEFINES, the static checks and the tests. */
#ifndef DRIVE_MODES_MODE_TABLE_H
#define DRIVE_MODES_MODE_TABLE_H

#include "drive/param_scaling.h" /* userparams.h may define the mode */

/** X(name, meaning): a macro that userparams.h or DEFINES switches on; what it does is in modes.h. */
#define MODE_TABLE(X) \
    X(OPEN_LOOP_FUNCTIONING, "stay on the forced angle at END_SPEED_RPM; the estimator runs along and can be watched") \
    X(TUNING, "the speed reference ramps slowly from the hand-over to MAXIMUM_SPEED_RPM by itself") \
    X(TORQUE_MODE, "the potentiometer commands the q current; MAXIMUM_SPEED_RPM still limits the speed") \
    X(BIDIRECTIONAL_SPEED, "the potentiometer's sides are the two directions, its middle is MINIMUM_SPEED_RPM; S3 has no function") \
    X(TORQUE_PROFILE, "learn the current that a load pulsing with the shaft's turn takes: piston pumps, compressors") \
    X(SNAPSHOT, "record SnapBuf1..4") \
    X(IDENTIFY, "measure R, L, Kphi, inertia and friction of the motor instead of running it (docs/tuning.md)") \
    X(BRINGUP, "check a new board step by step with little current instead of running the motor (docs/bringup.md)") \
    X(PARAMS_IN_RAM, "a debugger can change every parameter while the motor turns; TUNING does it too") \
    X(SELFTEST_OFF, "leave out the self-tests in the manner of IEC 60730 Class B (docs/selftest.md)")

/* ---- What a mode asks of the parameters beyond their own table ---- */

/** X(condition, message): as PARAM_RELATION_TABLE, for the mode that is switched on. */
#ifdef BRINGUP
#define MODE_RELATION_BRINGUP(X) \
    X(PARAM_F(NORM_CURRENT_CONST) <= 0.0039F, \
      PARAM_NAMED(NORM_CURRENT_CONST) " must be at most 0.0039 with BRINGUP, which counts milliamperes in 16 bits: leave BRINGUP out")
#else
#define MODE_RELATION_BRINGUP(X)
#endif

/* Those that add to each period's work, or look at what follows a duty at once. */
#if defined(SNAPSHOT)
#define MODE_WITHOUT_TIME "SNAPSHOT"
#elif defined(IDENTIFY)
#define MODE_WITHOUT_TIME "IDENTIFY"
#elif defined(BRINGUP)
#define MODE_WITHOUT_TIME "BRINGUP"
#endif
#ifdef MODE_WITHOUT_TIME
#define MODE_RELATION_DEFERRED(X) \
    X(!DEFER_DUTIES, \
      PARAM_NAMED(LOOPTIME_SEC) " must be at least 0.00004 with " MODE_WITHOUT_TIME ", for which a shorter period has no time: leave it out, or use a longer period")
#else
#define MODE_RELATION_DEFERRED(X)
#endif

/* Parameters that are constants have no value to be kept. */
#if defined(TUNING) || defined(PARAMS_IN_RAM)
#define MODE_RELATION_KEPT(X)
#else
#define MODE_RELATION_KEPT(X) \
    X((PARAMS_KEPT) == 0, PARAM_NAMED(PARAMS_KEPT) " must be 0 without PARAMS_IN_RAM: add #define PARAMS_IN_RAM, or -DPARAMS_IN_RAM to DEFINES")
#endif

#define MODE_RELATION_TABLE(X) MODE_RELATION_DEFERRED(X) MODE_RELATION_BRINGUP(X) MODE_RELATION_KEPT(X)

/* ---- PARAMS_IN_RAM: a debugger can change the parameters while the motor turns; TUNING needs it too ---- */

/** In RAM each parameter is read anew in the next period, e.g. board_params.fieldweak.idref_q13[3], and nobody checks its range.
 *  Otherwise parameters are constants in the interrupt's instructions. */
#if defined(TUNING) || defined(PARAMS_IN_RAM)
#define MODE_PARAMS_PLACE
#else
#define MODE_PARAMS_PLACE const
#endif

/* ---- Which modes take the fault recorder's place in RAM ---- */

/** Its name, where it has variables in the recorder's place. */
#if defined(SNAPSHOT)
#define MODE_WITHOUT_RECORDER "SNAPSHOT"
#elif defined(TUNING)
#define MODE_WITHOUT_RECORDER "TUNING"
#elif defined(PARAMS_IN_RAM)
#define MODE_WITHOUT_RECORDER "PARAMS_IN_RAM"
#elif defined(IDENTIFY)
#define MODE_WITHOUT_RECORDER "IDENTIFY"
#elif defined(BRINGUP)
#define MODE_WITHOUT_RECORDER "BRINGUP"
#endif

#endif
