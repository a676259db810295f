/* The one table of modes: it feeds userparams.h, the build's check of DEFINES, the static checks and the tests. */
#ifndef DRIVE_MODES_MODE_TABLE_H
#define DRIVE_MODES_MODE_TABLE_H

/** X(name, meaning): a macro that userparams.h or DEFINES switches on; what it does is in modes.h. */
#define MODE_TABLE(X) \
    X(OPEN_LOOP_FUNCTIONING, "stay on the forced angle at END_SPEED_RPM; the estimator runs along and can be watched") \
    X(TUNING, "the speed reference ramps slowly from the hand-over to MAXIMUM_SPEED_RPM by itself") \
    X(TORQUE_MODE, "the potentiometer commands the q current; MAXIMUM_SPEED_RPM still limits the speed") \
    X(BIDIRECTIONAL_SPEED, "the potentiometer's sides are the two directions, its middle is MINIMUM_SPEED_RPM; S3 has no function") \
    X(SNAPSHOT, "record SnapBuf1..4") \
    X(IDENTIFY, "measure R, L, Kphi, inertia and friction of the motor instead of running it (docs/tuning.md)") \
    X(BRINGUP, "check a new board step by step with little current instead of running the motor (docs/bringup.md)") \
    X(PARAMS_IN_RAM, "a debugger can change every parameter while the motor turns; TUNING does it too") \
    X(SELFTEST_OFF, "leave out the self-tests in the manner of IEC 60730 Class B (docs/selftest.md)")

#endif
