"""The operator: potentiometer positions for speeds and currents, buttons, ramps."""

import unittest

from support import scenario

from tools.foc33.errors import UserError
from tools.foc33.panel import Ranges, plan

PARAMS = {"MINIMUM_SPEED_RPM": 500.0, "NOMINAL_SPEED_RPM": 2800.0, "MAXIMUM_SPEED_RPM": 5500.0, "MAXIMUM_CURRENT_A": 2.75}
STEP = 1.0 / 1024.0


def actions(text: str, defines=(), start=None):
    return plan(scenario(text), Ranges.of(PARAMS, list(defines)), start or {})


def event(at_s: float, action: str) -> str:
    return f"[[event]]\nat_s = {at_s}\n{action}\n"


def pots(found) -> list[float]:
    return [action.keys["input.pot"] for action in found if "input.pot" in action.keys]


class Potentiometer(unittest.TestCase):
    def test_normal_range_goes_from_minimum_to_nominal_speed(self):
        low, middle, high = pots(actions(event(0, "speed_rpm = 500") + event(0.1, "speed_rpm = 1650") + event(0.2, "speed_rpm = 2800")))
        self.assertAlmostEqual(low, 0.0, delta=STEP)
        self.assertAlmostEqual(middle, 0.5, delta=STEP)
        self.assertAlmostEqual(high, 1.0, delta=STEP)

    def test_the_position_is_the_middle_of_a_converter_step(self):
        position = pots(actions(event(0, "speed_rpm = 1000")))[0] / STEP
        self.assertAlmostEqual(position % 1.0, 0.5)

    def test_the_chosen_step_is_the_nearest_to_the_speed(self):
        ranges = Ranges.of(PARAMS, [])
        for rpm in range(500, 2801, 7):
            self.assertLessEqual(abs(500 + ranges.pot_for_speed(rpm, False) * 2300 - rpm), 2300 * STEP * 0.5 + 1e-9, rpm)

    def test_after_s3_the_range_goes_from_nominal_to_maximum_speed(self):
        found = pots(actions(event(0, "press = \"S3\"") + event(0.1, "speed_rpm = 4150")))
        self.assertAlmostEqual(found[0], 0.5, delta=STEP)

    def test_a_second_s3_goes_back_to_the_normal_range(self):
        found = pots(actions(event(0, "press = \"S3\"") + event(0.3, "press = \"S3\"") + event(0.6, "speed_rpm = 1650")))
        self.assertAlmostEqual(found[0], 0.5, delta=STEP)

    def test_s2_goes_back_to_the_normal_range(self):
        found = pots(actions(event(0, "press = \"S3\"") + event(0.3, "press = \"S2\"") + event(0.6, "speed_rpm = 1650")))
        self.assertAlmostEqual(found[0], 0.5, delta=STEP)

    def test_a_speed_of_the_fast_range_asks_for_s3(self):
        with self.assertRaisesRegex(UserError, "speed_rpm = 4000 is impossible, .*line.*500 .. 2800 rpm.*press S3"):
            actions(event(0, "speed_rpm = 4000"))

    def test_a_speed_below_the_fast_range_is_refused(self):
        with self.assertRaisesRegex(UserError, "2800 .. 5500 rpm"):
            actions(event(0, "press = \"S3\"") + event(0.1, "speed_rpm = 1000"))

    def test_a_speed_beyond_every_range_does_not_ask_for_s3(self):
        with self.assertRaises(UserError) as caught:
            actions(event(0, "speed_rpm = 9000"))
        self.assertNotIn("S3", str(caught.exception))

    def test_bidirectional_speed_has_zero_in_the_middle(self):
        forward, backward = pots(actions(event(0, "speed_rpm = 1650") + event(0.1, "speed_rpm = -1650"), ["BIDIRECTIONAL_SPEED"]))
        self.assertAlmostEqual(forward, 0.75)
        self.assertAlmostEqual(backward, 0.25)

    def test_bidirectional_minimum_speed_keeps_its_direction(self):
        forward, backward = pots(actions(event(0, "speed_rpm = 500") + event(0.1, "speed_rpm = -500"), ["BIDIRECTIONAL_SPEED"]))
        self.assertGreater(forward, 0.515)
        self.assertLess(backward, 0.485)

    def test_torque_mode_takes_currents_and_no_speeds(self):
        self.assertAlmostEqual(pots(actions(event(0, "current_a = 1.375"), ["TORQUE_MODE"]))[0], 0.5, delta=STEP)
        with self.assertRaisesRegex(UserError, "TORQUE_MODE has no speed command"):
            actions(event(0, "speed_rpm = 1000"), ["TORQUE_MODE"])
        with self.assertRaisesRegex(UserError, "only TORQUE_MODE has a current command"):
            actions(event(0, "current_a = 1"))

    def test_a_firmware_that_hides_its_ranges_is_refused(self):
        with self.assertRaisesRegex(UserError, "NOMINAL_SPEED_RPM"):
            Ranges.of({"MINIMUM_SPEED_RPM": 500.0}, [])


class Actions(unittest.TestCase):
    def test_a_press_is_released_after_its_time(self):
        found = actions(event(0.5, "press = \"S2\"\nhold_s = 0.25"))
        self.assertEqual([(action.at_s, action.keys) for action in found], [(0.5, {"input.s2": 1.0}), (0.75, {"input.s2": 0.0})])

    def test_a_ramp_starts_at_the_present_value_and_ends_exactly_at_the_goal(self):
        found = actions(event(0.5, "set = { \"load.constant_nm\" = 0.05 }\nover_s = 0.1"), start={"load.constant_nm": 0.01})
        values = [action.keys["load.constant_nm"] for action in found]
        self.assertEqual(values[-1], 0.05)
        self.assertAlmostEqual(found[-1].at_s, 0.6)
        self.assertEqual(values, sorted(values))
        self.assertTrue(0.01 < values[0] < 0.012)

    def test_a_ramp_appears_once_in_the_protocol(self):
        found = actions(event(0.5, "set = { \"load.constant_nm\" = 0.05 }\nover_s = 0.1"))
        self.assertEqual(sum(bool(action.text) for action in found), 1)

    def test_a_note_replaces_the_protocol_text(self):
        self.assertEqual(actions(event(0, "pot = 0.5\nnote = \"left\""))[0].text, "left")

    def test_variables_are_written_as_given(self):
        self.assertEqual(actions(event(0, "debug = { SnapStart = 1 }"))[0].variables, {"SnapStart": 1})

    def test_actions_come_in_order_of_time(self):
        found = actions(event(0.5, "press = \"S2\"\nhold_s = 1.0") + event(0.7, "pot = 0.1"))
        self.assertEqual([action.at_s for action in found], [0.5, 0.7, 1.5])


if __name__ == "__main__":
    unittest.main()
