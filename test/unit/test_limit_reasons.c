/* Why the drive gives less than it is asked for: each reason alone, at its edge, in both directions. */
#include "drive_rig.h"

#include "drive/limits.h"

static int16_t way;

/** In closed loop at 10000 erpm with current, voltage and d current to spare. */
static void set_free(int16_t direction)
{
    drive_control_t *c = &drive.run.control;
    way = direction;
    rig_closed(direction, (int16_t)(direction * 10000));
    voltage_circle_of(&drive.circle, 12800);
    c->v_q14.d = 0;
    c->v_q14.q = (int16_t)(direction * 6000);
    c->vq_limit_q14 = 12800;
    c->ref_q13.q = (int16_t)(direction * 1000);
    c->iq_limit_q13 = 5120;
    c->brake_limit_q13 = 5120;
    drive.run.fieldweak.table_q13 = 0;
    drive.run.fieldweak.trim_q13 = 0;
}

void setUp(void)
{
    set_free(1);
}

static void expect(uint16_t reasons, const char *what)
{
    TEST_ASSERT_EQUAL_HEX16_MESSAGE(reasons, limits_reasons(&drive, &params), what);
}

/** The same after a step of the reference, which says whether it waits. */
static void expect_after_step(uint16_t reasons, const char *what)
{
    speed_reference_step(&drive, &params);
    expect(reasons, what);
}

/** Both directions, each anew. */
#define EACH_FREE for (int16_t way_ = -1; way_ <= 1 && (set_free(way_), 1); way_ = (int16_t)(way_ + 2))

void test_reasons_are_bits_of_their_own(void)
{
    uint16_t all = 0;
#define ADD(bit, name, cause, remedy) \
    TEST_ASSERT_EQUAL_HEX16(0, all & (bit)); \
    TEST_ASSERT_EQUAL_HEX16(LIMIT_##name, (bit)); \
    all |= (bit);
    DRIVE_LIMIT_TABLE(ADD)
    TEST_ASSERT_EQUAL_HEX16(16383, all);
}

void test_drive_that_has_what_it_asks_for_has_no_reason(void)
{
    EACH_FREE {
        expect(LIMIT_NONE, "closed loop");
    }
}

void test_voltage_is_the_reason_from_one_32nd_below_the_circle_on_each_axis(void)
{
    EACH_FREE {
        drive.run.control.v_q14.q = (int16_t)(way * 12399);
        expect(LIMIT_NONE, "q below");
        drive.run.control.v_q14.q = (int16_t)(way * 12400);
        expect(LIMIT_VOLTAGE, "q at");
        drive.run.control.v_q14.q = 0;
        drive.run.control.v_q14.d = (int16_t)(way * 12012); /* 31/32 of 31/32 of the circle, less one */
        expect(LIMIT_NONE, "d below");
        drive.run.control.v_q14.d = (int16_t)(way * 12013);
        expect(LIMIT_VOLTAGE, "d at");
    }
}

void test_current_is_the_reason_from_one_32nd_below_its_limit(void)
{
    EACH_FREE {
        drive.run.control.iq_limit_q13 = 3200;
        drive.run.control.ref_q13.q = (int16_t)(way * 3099);
        expect(LIMIT_NONE, "below");
        drive.run.control.ref_q13.q = (int16_t)(way * 3100);
        expect(LIMIT_CURRENT, "driving");
        drive.run.control.ref_q13.q = (int16_t)(way * -3100);
        expect(LIMIT_CURRENT, "braking, and the bus would take more");
        drive.run.control.brake_limit_q13 = 3200;
        expect(LIMIT_CURRENT, "the bus takes as much");
        drive.run.control.iq_limit_q13 = params.current_max_q13;
        drive.run.control.brake_limit_q13 = limits_asked_most(&params); /* below the circle, for braking never asks for more */
        drive.run.control.ref_q13.q = (int16_t)(-way * limits_asked_most(&params));
        expect(LIMIT_CURRENT, "the bus takes all that is asked of it");
    }
}

void test_supply_is_the_reason_in_place_of_the_current_while_it_narrows_the_limit(void)
{
    drive_params_t supplied = params;
    supplied.supply_limit_q13 = 1000;
    EACH_FREE {
        drive.run.control.iq_limit_q13 = 3200;
        drive.run.control.ref_q13.q = (int16_t)(way * 3100);
        drive.run.control.limited_by = LIMIT_SUPPLY;
        TEST_ASSERT_EQUAL_HEX16(LIMIT_SUPPLY, limits_reasons(&drive, &supplied));
        drive.run.control.ref_q13.q = (int16_t)(way * 3099);
        TEST_ASSERT_EQUAL_HEX16(LIMIT_NONE, limits_reasons(&drive, &supplied));
        drive.run.control.ref_q13.q = (int16_t)(way * 3100);
        drive.run.control.limited_by = LIMIT_NONE;
        TEST_ASSERT_EQUAL_HEX16(LIMIT_CURRENT, limits_reasons(&drive, &supplied));
    }
}

void test_bus_is_the_reason_while_it_holds_the_braking_current_also_at_none(void)
{
    EACH_FREE {
        drive.run.control.brake_limit_q13 = 640;
        drive.run.control.ref_q13.q = (int16_t)(way * -619);
        expect(LIMIT_NONE, "below");
        drive.run.control.ref_q13.q = (int16_t)(way * -620);
        expect(LIMIT_BRAKE, "at");
        drive.run.control.ref_q13.q = (int16_t)(way * 640);
        expect(LIMIT_NONE, "driving");
        drive.run.control.brake_limit_q13 = 0;
        drive.run.control.ref_q13.q = 0;
        expect(LIMIT_BRAKE, "no braking current at all");
        drive.run.control.ref_q13.q = (int16_t)way;
        expect(LIMIT_NONE, "it drives a little");
        drive.run.control.brake_limit_q13 = 640;
        drive.run.control.ref_q13.q = 0;
        expect(LIMIT_NONE, "no current with one to spare");
    }
}

void test_ramp_is_the_reason_while_the_reference_is_two_steps_or_more_from_its_target(void)
{
    EACH_FREE {
        drive.command.target_erpm = (int16_t)(way * (10000 + 15));
        expect(LIMIT_NONE, "the next step reaches it");
        drive.command.target_erpm = (int16_t)(way * (10000 + 16));
        expect(LIMIT_RAMP, "up");
        drive.command.target_erpm = (int16_t)(way * (10000 - 16));
        expect(LIMIT_RAMP, "down");
        drive.command.target_erpm = (int16_t)(way * 10000);
        drive.state = (uint16_t)DRIVE_STOPPING;
        expect(LIMIT_RAMP, "a stop");
        drive.run.control.reference_erpm = (int16_t)(way * 1875);
        rig_speed((int16_t)(way * 1875));
        expect(LIMIT_NONE, "the stop's end");
    }
}

void test_ramp_down_is_the_reason_until_two_steps_of_its_own_slope_are_left(void)
{
    drive_params_t gentle = params;
    gentle.speed_decel_q16 = 2 * 65536;
    EACH_FREE {
        drive.command.target_erpm = (int16_t)(way * (10000 - 4));
        TEST_ASSERT_EQUAL_HEX16(LIMIT_RAMP, limits_reasons(&drive, &gentle));
        drive.command.target_erpm = (int16_t)(way * (10000 - 3));
        TEST_ASSERT_EQUAL_HEX16(LIMIT_NONE, limits_reasons(&drive, &gentle));
    }
}

void test_ramp_waits_for_the_motor_at_any_distance_and_at_its_target_it_does_not_wait(void)
{
    EACH_FREE {
        rig_speed((int16_t)(way * 8000));
        expect_after_step(LIMIT_NONE, "behind at the target");
        drive.command.target_erpm = (int16_t)(way * (10000 + 1));
        expect_after_step(LIMIT_RAMP | LIMIT_RAMP_WAITS, "behind");
        drive.command.target_erpm = (int16_t)(way * 5000);
        expect_after_step(LIMIT_RAMP, "behind on the way down");
        rig_speed((int16_t)(way * 12000));
        expect_after_step(LIMIT_RAMP | LIMIT_RAMP_WAITS, "ahead on the way down");
    }
}

void test_field_weakening_is_the_reason_with_a_d_current_of_table_or_trim(void)
{
    EACH_FREE {
        drive.run.fieldweak.table_q13 = -1;
        expect(LIMIT_FIELD_WEAKENING, "table");
        drive.run.fieldweak.table_q13 = 0;
        drive.run.fieldweak.trim_q13 = -1;
        expect(LIMIT_FIELD_WEAKENING, "trim");
        drive.run.control.ref_q13.q = (int16_t)(way * 5120);
        drive.run.control.v_q14.q = (int16_t)(way * 12800);
        drive.command.target_erpm = (int16_t)(way * 20000);
        rig_speed(0);
        expect_after_step(LIMIT_VOLTAGE | LIMIT_CURRENT | LIMIT_RAMP | LIMIT_RAMP_WAITS | LIMIT_FIELD_WEAKENING, "several at once");
    }
}

void test_bridge_that_is_off_has_no_reason_and_a_forced_angle_only_the_voltage(void)
{
    static const struct {
        drive_state_t state;
        uint16_t reasons;
    } cases[] = {
        { DRIVE_CALIBRATE, 0 }, { DRIVE_STOPPED, 0 }, { DRIVE_BOOTSTRAP, 0 }, { DRIVE_FAULT, 0 }, { DRIVE_ALIGN, LIMIT_VOLTAGE },
        { DRIVE_RAMP, LIMIT_VOLTAGE }, { DRIVE_CLOSED, LIMIT_VOLTAGE | LIMIT_CURRENT | LIMIT_RAMP },
    };
    drive.run.control.v_q14.q = 12800;
    drive.run.control.ref_q13.q = 5120;
    drive.command.target_erpm = 11000;
    EACH(n, cases) {
        drive.state = (uint16_t)cases[n].state;
        expect(cases[n].reasons, golden_row(n));
    }
}

void test_a_start_that_waits_for_a_fast_rotor_or_a_high_bus_says_so_and_a_pause_between_two_looks_does_not(void)
{
    static const struct {
        catch_phase_t phase;
        uint16_t reasons;
    } cases[] = { { CATCH_BUS_HIGH, LIMIT_TOO_FAST }, { CATCH_TOO_FAST, LIMIT_TOO_FAST }, { CATCH_PAUSE, 0 }, { CATCH_SEEN, 0 } };
    drive.state = (uint16_t)DRIVE_CATCH;
    EACH(n, cases) {
        drive.run.catching.phase = (uint16_t)cases[n].phase;
        expect(cases[n].reasons, golden_row(n));
    }
}

void test_d_current_that_burns_the_rotors_energy_is_a_reason(void)
{
    EACH_FREE {
        drive.run.control.flux_brake_q13 = 1;
        expect(LIMIT_FLUX_BRAKING, "burns");
        drive.run.control.flux_brake_q13 = 0;
        expect(LIMIT_NONE, "does not");
    }
}

/** In RAMP at this forced speed, seen by the estimator as off by this in the mean. */
static void set_ramp(int16_t direction, float forced_erpm, int16_t ahead_erpm)
{
    set_free(direction);
    drive.state = (uint16_t)DRIVE_RAMP;
    drive.forced.speed_q10 = (int32_t)(forced_erpm * 67108864.0F / 60.0F * PARAM_F(LOOPTIME_SEC));
    rig_agreed(0);
    drive.run.handover.ahead_erpm = ahead_erpm;
}

void test_a_start_that_is_right_in_the_mean_but_not_for_long_enough_swings(void)
{
    static const struct {
        float forced_erpm;
        int16_t ahead_erpm;
        uint16_t agreed_steps, state, reasons;
    } cases[] = {
        { 4800.0F, 0, 0, DRIVE_RAMP, LIMIT_SWING }, { 4800.0F, 590, 49, DRIVE_RAMP, LIMIT_SWING }, { 4800.0F, -590, 0, DRIVE_RAMP, LIMIT_SWING },
        { 4800.0F, 610, 0, DRIVE_RAMP, 0 }, { 4800.0F, -610, 0, DRIVE_RAMP, 0 }, /* a wrong constant, or a rotor that stands */
        { 4600.0F, 0, 0, DRIVE_RAMP, 0 },  /* it may still agree in time: 1.5 times 3125 erpm */
        { 4800.0F, 0, 50, DRIVE_RAMP, 0 }, /* it has agreed */
        { 4800.0F, 0, 0, DRIVE_ALIGN, 0 }, { 4800.0F, 0, 0, DRIVE_CLOSED, 0 },
    };
    EACH_DIRECTION(direction) {
        EACH(n, cases) {
            set_ramp(direction, cases[n].forced_erpm, cases[n].ahead_erpm);
            rig_agreed(cases[n].agreed_steps);
            drive.state = cases[n].state;
            expect(cases[n].reasons, golden_row(n));
        }
    }
}

void test_asking_changes_nothing(void)
{
    drive_t before = drive;
    (void)limits_reasons(&drive, &params);
    TEST_ASSERT_EQUAL_MEMORY(&before, &drive, sizeof drive);
}
