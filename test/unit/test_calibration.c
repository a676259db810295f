/* Calibration: the mean of 1024 samples with the bridge off, what is plausible, and what a fault does to it. */
#include "drive_rig.h"

void setUp(void)
{
    rig_power_up();
}

static void calibrate(int16_t a_q13, int16_t b_q13)
{
    rig_currents(a_q13, b_q13);
    rig_tick(1024);
}

/** A fault, whatever it is, is cleared: the calibration begins anew and takes its 1024 samples. */
static void clear_and_calibrate(int16_t a_q13, int16_t b_q13)
{
    rig_currents(a_q13, b_q13);
    drive.command.clear_fault = 1;
    rig_tick(1);
    EXPECT_DRIVE(DRIVE_CALIBRATE, FAULT_NONE, "cleared");
    TEST_ASSERT_EQUAL_INT32(0, drive.calibration.sum_a);
    TEST_ASSERT_EQUAL_INT32(0, drive.calibration.sum_b);
    rig_tick(1023);
    EXPECT_DRIVE(DRIVE_CALIBRATE, FAULT_NONE, "1023 samples");
    rig_tick(1);
}

void test_takes_1024_samples_of_equal_weight_and_removes_their_mean(void)
{
    uint16_t n;
    for (n = 0; n < 1024u; n++) {
        int16_t noise = (int16_t)((n & 1u) ? 64 : -64), late = (int16_t)((n < 512u) ? 0 : 800);
        rig_currents((int16_t)(100 + noise + late), (int16_t)(150 - noise - late));
        EXPECT_DRIVE(DRIVE_CALIBRATE, FAULT_NONE, golden_row(n));
        TEST_ASSERT_EQUAL_INT16(0, drive.calibration.done);
        rig_tick(1);
    }
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "calibrated");
    TEST_ASSERT_EQUAL_INT16(1, drive.calibration.done);
    TEST_ASSERT_EQUAL_INT16(500, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(-250, drive.calibration.offset_b_q13);
    samples.i_a = -4 * (500 + 1000); /* amplifier below its middle: current into the motor */
    samples.i_b = -4 * (-250 + 300);
    rig_tick(1);
    TEST_ASSERT_EQUAL_INT16(1000, drive.phases_q13.a);
    TEST_ASSERT_EQUAL_INT16(300, drive.phases_q13.b);
    TEST_ASSERT_EQUAL_INT16(-1300, drive.phases_q13.c);
}

void test_offsets_up_to_an_eighth_of_full_scale_are_plausible(void)
{
    static const struct {
        int16_t a_q13, b_q13;
        uint16_t fault;
    } cases[] = {
        { 1024, -1024, FAULT_NONE }, { -1024, 1024, FAULT_NONE },
        { 1025, 0, FAULT_OFFSET }, { -1025, 0, FAULT_OFFSET }, { 0, 1025, FAULT_OFFSET }, { 0, -1025, FAULT_OFFSET },
        { 8000, -8000, FAULT_OFFSET },
    };
    EACH(n, cases) {
        uint16_t good = (uint16_t)(cases[n].fault == (uint16_t)FAULT_NONE);
        rig_power_up();
        calibrate(cases[n].a_q13, cases[n].b_q13);
        EXPECT_DRIVE(good ? DRIVE_STOPPED : DRIVE_FAULT, cases[n].fault, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(good, drive.calibration.done, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(good ? cases[n].a_q13 : 0, drive.calibration.offset_a_q13, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(good ? cases[n].b_q13 : 0, drive.calibration.offset_b_q13, golden_row(n));
    }
    drive_start(&drive, &params, 1);
    TEST_ASSERT_EQUAL_INT16(0, drive.command.run);
    rig_tick(3000);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OFFSET, "no start with an implausible offset");
}

void test_an_offset_fault_calibrates_anew_when_cleared_and_comes_back_while_its_cause_remains(void)
{
    calibrate(2000, -1500);
    clear_and_calibrate(2000, 0);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OFFSET, "still implausible");
    clear_and_calibrate(100, 50);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "plausible now");
    TEST_ASSERT_EQUAL_INT16(100, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(50, drive.calibration.offset_b_q13);
}

void test_a_fault_during_calibration_calibrates_anew_when_cleared(void)
{
    rig_currents(900, 900);
    rig_tick(500);
    drive_raise(&drive, FAULT_OVERCURRENT_HW);
    rig_tick(2000);
    EXPECT_DRIVE(DRIVE_FAULT, FAULT_OVERCURRENT_HW, "not yet cleared");
    clear_and_calibrate(100, 50);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "calibrated");
    TEST_ASSERT_EQUAL_INT16(100, drive.calibration.offset_a_q13);
    TEST_ASSERT_EQUAL_INT16(50, drive.calibration.offset_b_q13);
}

void test_a_fault_after_calibration_keeps_the_offsets(void)
{
    calibrate(200, 100);
    drive_raise(&drive, FAULT_STALL);
    rig_tick(1);
    drive.command.clear_fault = 1;
    rig_tick(1);
    EXPECT_DRIVE(DRIVE_STOPPED, FAULT_NONE, "cleared");
    TEST_ASSERT_EQUAL_INT16(200, drive.calibration.offset_a_q13);
}
