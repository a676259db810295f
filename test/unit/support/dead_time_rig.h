/* What a compensation of dead time for each of two pulses must be, with duties in time and with late ones. */
#ifndef TEST_DEAD_TIME_RIG_H
#define TEST_DEAD_TIME_RIG_H

#include "drive_rig.h"

#define FAST_HALF_STEP 3000 /* 2.6 degrees */
#define COUNTS_PER_RAD 10430L

/** A closed loop in which a half step of the angle shows. */
static inline void dead_time_closed(int16_t direction, angle_t angle)
{
    rig_closed(direction, (int16_t)(direction * 8000));
    drive.run.control.ref_q13.d = -480;
    drive.run.control.ref_q13.q = (int16_t)(direction * 640);
    drive.run.estimator.half_step_q16_rad = (int16_t)(direction * FAST_HALF_STEP);
    drive.angle = angle;
    drive.frame = trig_sincos(angle);
}

/** That of the asked currents so many half steps ahead of the frame. Two tangents make 800 counts longer by 1.7 %, the turns and the phases are rounded by 4:
 *  18 of current, 3 of the duty; a half step is 37 and 6. */
static inline void dead_time_expect(const drive_params_t *p, int16_t half_steps, const dead_duties_t *actual, uint16_t row)
{
    uint16_t ahead = (uint16_t)(drive.direction * half_steps * FAST_HALF_STEP * COUNTS_PER_RAD / 65536);
    dead_duties_t expected;
    svm_compensation(&p->svm, phases_of(drive.run.control.ref_q13, trig_sincos((angle_t)(drive.angle + ahead))), &expected);
    TEST_ASSERT_INT16_WITHIN_MESSAGE(3, expected.a, actual->a, golden_row(row));
    TEST_ASSERT_INT16_WITHIN_MESSAGE(3, expected.b, actual->b, golden_row(row));
    TEST_ASSERT_INT16_WITHIN_MESSAGE(3, expected.c, actual->c, golden_row(row));
}

/** Both pulses' at every angle, in both directions. @param half_steps from the frame to the centre of the first */
static inline void dead_time_expect_each(int16_t half_steps)
{
    drive_params_t p = params;
    p.svm.knee_q13 = 810; /* beyond the current: so that the compensation is the current, 40 counts for 256 */
    p.svm.dead_slope_q8 = 40;
    EACH_DIRECTION(direction) {
        for (uint16_t n = 0; n < 40u; n++) {
            dead_time_closed(direction, (angle_t)(n * 1638u));
            drive_prepare(&drive, &p);
            dead_time_expect(&p, half_steps, &drive.dead, n);
            dead_time_expect(&p, (int16_t)(half_steps + 2), &drive.dead_second, n);
        }
    }
}

#endif
