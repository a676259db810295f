/* defines: -DAPP_PULSE=1 -DPULSE_DUTY=1 */
/* The application rc with a PWM: range of duties and frequencies, odd ones, and lines that stand still. */
#include "firmware/app/rc.c"

#include "app_rig.h"

/** Milliseconds of a signal, of which a period is heard in each; longer ones when they are over. */
static void signal(uint16_t count_ms, float duty, float period_us)
{
    uint16_t n, every_ms = (uint16_t)((period_us > 1000.0F) ? period_us / 1000.0F : 1.0F);
    for (n = 0; n < count_ms; n++) {
        told.period_200ns = (uint16_t)((period_us > 12000.0F) ? 65535.0F : 5.0F * period_us);
        told.pulse_200ns = (uint16_t)((n % every_ms == 0u) ? 5.0F * duty * period_us + 0.5F : 0.0F);
        rig_ms();
    }
}

static void running(float duty)
{
    signal(600, 0.05F, 1000.0F);
    signal(10, duty, 1000.0F);
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
    told.is_running = 1;
}

void setUp(void)
{
    rig_fresh();
}

void tearDown(void)
{
}

void test_five_to_ninety_five_per_cent_are_minimum_to_maximum_speed_at_every_frequency(void)
{
    static const struct {
        float duty;
        int16_t speed;
    } at[] = { { 0.122F, 500 }, { 0.329F, 1375 }, { 0.536F, 2250 }, { 0.743F, 3125 }, { 0.95F, 4000 }, { 0.965F, 4000 } };
    static const float periods_us[] = { 100.0F, 101.4F, 333.3F, 1000.0F, 2500.0F, 10000.0F, 11111.0F };
    running(0.3F);
    EACH(n, at) {
        EACH(k, periods_us) {
            signal(50, at[n].duty, periods_us[k]);
            TEST_ASSERT_INT16_WITHIN(12, at[n].speed, asks.target_erpm); /* a count of 500 in a period */
        }
    }
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_thresholds_have_a_hysteresis(void)
{
    static const struct {
        float duty;
        int16_t run;
    } steps[] = { { 0.05F, 0 }, { 0.115F, 0 }, { 0.121F, 0 }, { 0.123F, 1 }, { 0.1F, 1 }, { 0.096F, 1 }, { 0.094F, 0 }, { 0.12F, 0 } };
    signal(600, 0.05F, 1000.0F);
    EACH(n, steps) {
        signal(3, steps[n].duty, 1000.0F);
        TEST_ASSERT_EQUAL_INT16(steps[n].run, asks.run);
    }
}

void test_an_odd_one_alone_changes_nothing(void)
{
    static const float odd[] = { 0.01F, 0.2F, 0.9F, 0.99F };
    int16_t target;
    running(0.5F);
    target = asks.target_erpm;
    EACH(n, odd) {
        signal(1, odd[n], 1000.0F);
        TEST_ASSERT_EQUAL_INT16(target, asks.target_erpm);
        signal(5, 0.5F, 1000.0F);
        TEST_ASSERT_EQUAL_INT16(target, asks.target_erpm);
    }
    TEST_ASSERT_EQUAL_INT16(1, asks.run);
}

void test_a_duty_or_a_frequency_that_cannot_be_is_lost(void)
{
    static const struct {
        float duty, period_us;
    } wrong[] = { { 0.02F, 1000.0F }, { 0.98F, 1000.0F }, { 0.5F, 80.0F }, { 0.5F, 12500.0F }, { 0.5F, 11800.0F }, { 0.0F, 1000.0F } };
    EACH(n, wrong) {
        rig_fresh();
        running(0.5F);
        signal(PULSE_LOST_MS - 10u, wrong[n].duty, wrong[n].period_us);
        TEST_ASSERT_EQUAL_INT16(1, asks.run);
        signal(20, wrong[n].duty, wrong[n].period_us);
        TEST_ASSERT_EQUAL_INT16_MESSAGE(0, asks.run, "lost");
    }
}
