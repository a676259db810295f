/* The braking limit that the parameters give in the drive, for every current range. */
#include "drive_rig.h"
#include "unity.h"

#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 1.0
static const drive_params_t at_1_A = DRIVE_PARAMS_INIT;
#undef MAXIMUM_CURRENT_A
#define MAXIMUM_CURRENT_A 0.6
static const drive_params_t at_600_mA = DRIVE_PARAMS_INIT;

static int16_t brake_limit(const drive_params_t *p, float above_v)
{
    rig_closed(1, 8000);
    drive.bus_q31 = (int32_t)((PARAM_F(REGEN_LIMIT_V) + above_v) / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F) * 65536;
    limits_braking(&drive.run, p, qm_hi(drive.bus_q31));
    return drive.run.control.brake_limit_q13;
}

static void expect_braking_to_end_2_V_above(const drive_params_t *p)
{
    int16_t full = p->current_max_q13;
    TEST_ASSERT_INT16_WITHIN(full / 20, full, brake_limit(p, 0.0F));
    TEST_ASSERT_INT16_WITHIN(full / 20, full / 2, brake_limit(p, 1.0F));
    TEST_ASSERT_INT16_WITHIN(full / 20, 0, brake_limit(p, 2.0F));
}

void test_braking_current_ends_2_V_above_REGEN_LIMIT_for_every_current_range(void)
{
    expect_braking_to_end_2_V_above(&params);
    expect_braking_to_end_2_V_above(&at_1_A);
    expect_braking_to_end_2_V_above(&at_600_mA);
}
