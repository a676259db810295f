"""Expectations: each kind holds when it should, and a failed one names its row and the numbers."""

import unittest

from support import PERIOD_S, run, step

from tools.bench import report

S2 = "[[event]]\nat_s = 0.1\npress = \"S2\"\n"
MEASURE = "[[measure]]\nname = \"row\"\nfrom_s = 0.5\nto_s = 1.0\nreference_rpm = 1000\n"
ON = {"pwm__outputs_on": 21, "pwm__outputs_seen": 63}


def expect(kind: str, **keys) -> str:
    def toml(value) -> str:
        return str(value).lower() if isinstance(value, bool) else f"\"{value}\"" if isinstance(value, str) else str(value)
    return f"[[expect]]\nkind = \"{kind}\"\n" + "".join(f"{key} = {toml(value)}\n" for key, value in keys.items())


def off_from(at_s: float) -> dict:
    """Outputs that are on up to a moment; "seen" tells of the period before."""
    return {"pwm__outputs_on": step((0, 21), (at_s, 0)), "pwm__outputs_seen": step((0, 63), (at_s + 2 * PERIOD_S, 0))}


class Expectations(unittest.TestCase):
    def outcomes(self, text: str, **signals):
        return report.check(run(text, **signals))

    def holds(self, text: str, **signals) -> None:
        for outcome in self.outcomes(text, **signals):
            self.assertTrue(outcome.ok, outcome)

    def fails(self, text: str, row: str, got: str, **signals) -> None:
        """Exactly one row fails, with this name and number."""
        failed = [outcome for outcome in self.outcomes(text, **signals) if not outcome.ok]
        self.assertEqual([outcome.row for outcome in failed], [row], failed)
        self.assertIn(got, failed[0].got)

    def test_a_measure_within_its_bounds_holds(self):
        self.holds(MEASURE + expect("measure", measure="row", value="speed_error_percent", min=-0.5, max=0.5), plant__speed_rpm=1004)

    def test_a_measure_outside_its_bounds_names_the_row_and_the_value(self):
        text = MEASURE + expect("measure", measure="row", value="speed_error_percent", min=-0.5, max=0.5)
        self.fails(text, "row: speed_error_percent", "0.6", plant__speed_rpm=1006)
        self.fails(text, "row: speed_error_percent", "-0.6", plant__speed_rpm=994)

    def test_one_expectation_for_several_measures_has_a_row_for_each(self):
        text = MEASURE + MEASURE.replace("row", "later").replace("0.5", "0.8") + expect("measure", measure=["row", "later"], value="speed_rpm", min=1000)
        self.fails(text, "later: speed_rpm", "990", plant__speed_rpm=step((0, 1100), (0.8, 990)))

    def test_a_measure_of_an_estimate_while_the_bridge_is_off_fails(self):
        self.fails(MEASURE + expect("measure", measure="row", value="estimated_rpm", min=0), "row: estimated_rpm", "nothing")

    def test_a_hand_over_in_time_holds(self):
        self.holds(S2 + expect("hand_over", within_s=0.8, overshoot_percent=10, no_reverse_motion=True),
                   fw__state=step((0, 4), (0.8, 5)), plant__speed_rpm=step((0, 0), (0.7, 1000)), fw__speed_ref_rpm=1000)

    def test_a_late_hand_over_fails(self):
        self.fails(S2 + expect("hand_over", within_s=0.6), "hand-over: closed loop", "0.700 s", fw__state=step((0, 4), (0.8, 5)),
                   fw__speed_ref_rpm=1000)

    def test_no_hand_over_fails(self):
        self.fails(S2 + expect("hand_over", within_s=0.6), "hand-over: closed loop", "never", fw__state=4)

    def test_a_hand_over_before_s2_does_not_count(self):
        self.fails("[[event]]\nat_s = 1.0\npress = \"S2\"\n" + expect("hand_over", within_s=0.6), "hand-over: closed loop", "never",
                   fw__state=step((0, 4), (0.8, 5)), fw__speed_ref_rpm=1000)

    def test_overshoot_counts_in_the_second_after_the_hand_over(self):
        text = S2 + expect("hand_over", within_s=0.8, overshoot_percent=10)
        state = step((0, 4), (0.8, 5))
        self.fails(text, "hand-over: overshoot", "12.0 %", fw__state=state, fw__speed_ref_rpm=1000,
                   plant__speed_rpm=step((0, 1000), (1.0, 1120), (1.01, 1000)))
        self.holds(text, fw__state=state, fw__speed_ref_rpm=1000, plant__speed_rpm=step((0, 1000), (1.9, 1120)))

    def test_reverse_motion_around_the_hand_over_fails_in_both_directions_of_rotation(self):
        text = S2 + expect("hand_over", within_s=0.8, no_reverse_motion=True)
        for sign in (1, -1):
            with self.subTest(sign):
                self.fails(text, "hand-over: no reverse motion", "-30 rpm", fw__state=step((0, 4), (0.8, 5)),
                           fw__speed_ref_rpm=sign * 1000, plant__speed_rpm=step((0, sign * 1000), (0.76, sign * -30), (0.77, sign * 1000)))

    def test_a_stop_in_time_and_slow_enough_holds(self):
        self.holds(expect("stop", after_s=1.0, within_s=0.5, speed_max_rpm=600), **off_from(1.4),
                   plant__speed_rpm=step((0, 1000), (1.3, 400)))

    def test_a_stop_that_drops_the_motor_at_speed_fails(self):
        self.fails(expect("stop", after_s=1.0, within_s=0.5, speed_max_rpm=600), "stop: speed when the outputs go off", "1000 rpm",
                   **off_from(1.4), plant__speed_rpm=1000)

    def test_a_late_stop_and_one_that_does_not_last_fail(self):
        text = expect("stop", after_s=1.0, within_s=0.3)
        self.fails(text, "stop: outputs off", "0.400 s", **off_from(1.4))
        self.fails(text, "stop: outputs off", "never", **ON)
        self.fails(text, "stop: outputs off", "on again later", pwm__outputs_on=step((0, 21), (1.2, 0), (1.5, 21)),
                   pwm__outputs_seen=step((0, 63), (1.2, 0), (1.5, 63)))

    def test_outputs_that_must_be_off_name_the_moment_of_the_first_pulse(self):
        text = expect("outputs_off", from_s=1.0, to_s=2.0)
        self.holds(text, pwm__outputs_seen=step((0, 63), (0.9, 0)))
        self.fails(text, "outputs off 1 .. 2 s", "1.5000 s", pwm__outputs_seen=step((0, 0), (1.5, 63), (1.5001, 0)))

    def test_bus_voltage_is_checked_at_both_ends(self):
        text = expect("bus_voltage", min=20, max=30)
        self.holds(text, bus__voltage_v=24)
        self.fails(text, "bus voltage 0 .. 2 s", "24.00 .. 31.00 V", bus__voltage_v=step((0, 24), (1.0, 31), (1.0001, 24)))
        self.fails(text, "bus voltage 0 .. 2 s", "19.00 .. 24.00 V", bus__voltage_v=step((0, 24), (1.0, 19), (1.0001, 24)))

    def test_bus_voltage_in_percent_is_of_the_headers_nominal_bus(self):
        item = run(expect("bus_voltage", percent=True, max=125), bus__voltage_v=step((0, 24), (1.0, 30.5), (1.0001, 24)))
        for nominal_v, ok in ((24.0, False), (25.0, True)):
            item.params["NOMINAL_BUS_V"] = nominal_v
            self.assertEqual(report.check(item)[0].ok, ok, nominal_v)

    def test_each_statistic_of_a_signal(self):
        half = step((0, -3), (1.0, 1)) # half of the time each
        for statistic, value in (("min", -3), ("max", 1), ("mean", -1), ("span", 4), ("peak", 3), ("last", 1), ("rms", 5 ** 0.5),
                                 ("distinct", 2)):
            with self.subTest(statistic):
                bounds = {"min": value - 0.01, "max": value + 0.01}
                self.holds(expect("signal", signal="fw.i_q_a", statistic=statistic, **bounds), fw__i_q_a=half)

    def test_a_signal_outside_its_bounds_fails_only_within_the_window(self):
        signal = step((0, 0), (1.5, 7), (1.6, 0))
        self.holds(expect("signal", signal="fw.i_q_a", statistic="max", max=5, to_s=1.5), fw__i_q_a=signal)
        self.fails(expect("signal", signal="fw.i_q_a", statistic="max", max=5), "fw.i_q_a max 0 .. 2 s", "7", fw__i_q_a=signal)

    def test_a_state_at_a_moment(self):
        signal = step((0, 1), (1.0, 5))
        self.holds(expect("state", name="STOPPED", at_s=0.5) + expect("state", name="CLOSED", at_s=1.5), fw__state=signal)
        self.fails(expect("state", name="STOPPED", at_s=1.5), "state at 1.5 s", "CLOSED", fw__state=signal)

    def test_a_state_over_time_must_hold_all_the_time(self):
        self.fails(expect("state", name="STOPPED", from_s=0.5, to_s=1.5), "state 0.5 .. 1.5 s", "STOPPED CLOSED",
                   fw__state=step((0, 1), (1.0, 5)))

    def test_a_state_that_must_never_come(self):
        text = expect("state", name="CLOSED", never=True)
        self.holds(text, fw__state=4)
        self.fails(text, "state never CLOSED 0 .. 2 s", "RAMP CLOSED", fw__state=step((0, 4), (1.0, 5), (1.0001, 4)))

    def test_a_fault_in_time_with_outputs_off_a_period_later_holds(self):
        self.holds(expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1, kept_to_s=1.5, cleared_from_s=1.7),
                   fw__fault=step((0, 0), (1.05, 3), (1.6, 0)), **off_from(1.05 + PERIOD_S))

    def test_another_or_a_late_or_no_fault_fails(self):
        text = expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1)
        row = "fault OVERVOLTAGE: raised"
        self.fails(text, row, "STALL at 1.05", fw__fault=step((0, 0), (1.05, 6)), **off_from(1.05))
        self.fails(text, row, "OVERVOLTAGE at 1.2", fw__fault=step((0, 0), (1.2, 3)), **off_from(1.2))
        self.fails(text, row, "OVERVOLTAGE at 0.9", fw__fault=step((0, 0), (0.9, 3)), **off_from(0.9))
        self.fails(text, row, "no fault", fw__fault=0)

    def test_outputs_that_go_off_late_after_a_fault_fail_with_the_number_of_periods(self):
        text = expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1)
        self.fails(text, "fault OVERVOLTAGE: outputs off", "2 periods", fw__fault=step((0, 0), (1.05, 3)), **off_from(1.05 + 2 * PERIOD_S))
        self.fails(text, "fault OVERVOLTAGE: outputs off", "never", fw__fault=step((0, 0), (1.05, 3)), **ON)

    def test_hardware_must_act_after_the_cause_not_after_the_code(self):
        text = expect("fault", name="OVERCURRENT_HW", after_s=1.0, within_s=0.1, from_cause=True)
        code = step((0, 0), (1.01, 1))
        self.holds(text, fw__fault=code, **off_from(1.0 + PERIOD_S))
        self.fails(text, "fault OVERCURRENT_HW: outputs off", "periods", fw__fault=code, **off_from(1.01))

    def test_a_code_that_vanishes_by_itself_fails(self):
        text = expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1, kept_to_s=1.5)
        self.fails(text, "fault OVERVOLTAGE: kept to 1.5 s", "NONE", fw__fault=step((0, 0), (1.05, 3), (1.2, 0)), **off_from(1.05))

    def test_a_code_that_s2_does_not_clear_fails(self):
        text = expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1, cleared_from_s=1.5)
        self.fails(text, "fault OVERVOLTAGE: cleared from 1.5 s", "OVERVOLTAGE", fw__fault=step((0, 0), (1.05, 3)), **off_from(1.05))

    def test_no_fault_names_the_fault_that_came(self):
        text = expect("no_fault", to_s=1.0)
        self.holds(text, fw__fault=step((0, 0), (1.5, 6)))
        self.fails(text, "no fault 0 .. 1 s", "STALL at 0.5", fw__fault=step((0, 0), (0.5, 6)))

    def test_no_warnings_names_the_first_warning(self):
        item = run(expect("no_warnings"))
        self.assertTrue(report.check(item)[0].ok)
        item.warnings = ["P1DTCON1: dead time is 0"]
        self.assertEqual((report.check(item)[0].ok, report.check(item)[0].got), (False, "P1DTCON1: dead time is 0"))

    def test_a_firmware_variable_is_checked_over_its_elements(self):
        item = run(expect("variable", name="SnapBuf1", count=3, statistic="span", min=5))
        item.variables = {"SnapBuf1": [1, 2, 9, 100]}
        self.assertEqual((report.check(item)[0].ok, report.check(item)[0].got), (True, "8"))
        item.variables = {"SnapBuf1": [1, 1, 2, 100]}
        self.assertFalse(report.check(item)[0].ok)

    def test_an_empty_window_never_holds(self):
        for text in (expect("no_fault", from_s=2.0, to_s=2.0), expect("outputs_off", from_s=2.0, to_s=2.0),
                     expect("bus_voltage", max=30, from_s=2.0, to_s=2.0),
                     expect("signal", signal="fw.i_q_a", statistic="max", max=5, from_s=2.0, to_s=2.0)):
            with self.subTest(text):
                item = run(text)
                item.trace = item.trace.part(0.0, 1.0)
                self.assertFalse(report.check(item)[0].ok)
