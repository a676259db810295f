/* The current circle: the d reference of table, trim and hand-over, and what sqrt(Imax^2 - Id^2) leaves to q. */
#include "drive/param_scaling.h"

#include "drive/tick.h"
#include "golden.h"
#include "golden_current_limit.h"
#include "unity.h"

static drive_t drive;
static drive_params_t params;

void setUp(void)
{
    static const drive_t zero;
    static const drive_params_t no_params;
    drive = zero;
    params = no_params;
    params.current_max_q13 = 5120;
    params.current_max_reciprocal = 6554;
}

void tearDown(void)
{
}

void test_limits_equal_the_reference(void)
{
    uint32_t n;
    for (n = 0; n < GOLDEN_CURRENT_LIMIT_ROWS; n++) {
        golden_current_limit_t v = golden_current_limit_row(n);
        params.current_max_q13 = v.maximum;
        params.current_max_reciprocal = v.reciprocal;
        drive.run.handover.id_q13 = v.wanted_d;
        limits_current(&drive.run, &params);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.ref_d, drive.run.control.ref_q13.d, golden_row(n));
        TEST_ASSERT_EQUAL_INT16_MESSAGE(v.iq_limit, drive.run.control.iq_limit_q13, golden_row(n));
    }
}

void test_current_vector_is_at_most_the_maximum(void)
{
    int16_t i_d;
    for (i_d = -5120; i_d <= 5120; i_d++) {
        int32_t square;
        drive.run.handover.id_q13 = i_d;
        limits_current(&drive.run, &params);
        square = qm_mulss(drive.run.control.ref_q13.d, drive.run.control.ref_q13.d)
                 + qm_mulss(drive.run.control.iq_limit_q13, drive.run.control.iq_limit_q13);
        TEST_ASSERT_TRUE_MESSAGE(square <= INT32_C(5122) * 5122, golden_row((uint32_t)(i_d + 5120)));
        TEST_ASSERT_TRUE_MESSAGE(square >= INT32_C(5090) * 5090, golden_row((uint32_t)(i_d + 5120)));
    }
}

void test_no_d_current_leaves_the_whole_maximum_to_q(void)
{
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.ref_q13.d);
    TEST_ASSERT_INT16_WITHIN(1, 5120, drive.run.control.iq_limit_q13);
}

void test_d_current_of_0_6_leaves_0_8_to_q_for_both_signs(void)
{
    drive.run.handover.id_q13 = 3072;
    limits_current(&drive.run, &params);
    TEST_ASSERT_INT16_WITHIN(3, 4096, drive.run.control.iq_limit_q13);
    drive.run.handover.id_q13 = -3072;
    limits_current(&drive.run, &params);
    TEST_ASSERT_INT16_WITHIN(3, 4096, drive.run.control.iq_limit_q13);
}

void test_d_reference_is_the_sum_of_hand_over_table_and_trim(void)
{
    params.fieldweak.trim_max_q13 = 1000;
    params.fieldweak.trim_step_q13 = 2;
    params.fieldweak.margin_q14 = 300;
    drive.run.handover.id_q13 = 50;
    drive.run.fieldweak.table_q13 = -700;
    drive.run.fieldweak.trim_q13 = -30;
    drive.run.control.vq_limit_q14 = 9000; /* voltage is free: the trim is given back by 2 */
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(50 - 700 - 28, drive.run.control.ref_q13.d);
}

void test_trim_sees_the_voltage_that_q_leaves_unused(void)
{
    params.fieldweak.trim_max_q13 = 1000;
    params.fieldweak.trim_step_q13 = 2;
    params.fieldweak.margin_q14 = 300;
    params.fieldweak.trim_speed_erpm = 8000;
    drive.run.estimator.omega_filtered_q16 = INT32_C(20000) * 65536;
    drive.run.control.vq_limit_q14 = 9000;
    drive.run.control.v_q14.q = -8701;
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(-2, drive.run.control.ref_q13.d);
    drive.run.control.v_q14.q = -8700;
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(0, drive.run.control.ref_q13.d);
}

void test_d_reference_is_limited_to_31_of_32_parts_of_the_maximum(void)
{
    drive.run.fieldweak.table_q13 = -8000;
    limits_current(&drive.run, &params);
    TEST_ASSERT_EQUAL_INT16(-4960, drive.run.control.ref_q13.d);
    TEST_ASSERT_INT16_WITHIN(25, 1250, drive.run.control.iq_limit_q13); /* sqrt(1 - (31/32)^2) = 0.248 */
}
