"""The operator: potentiometer positions for speeds and currents, buttons, ramps."""

import unittest

from support import scenario

from tools.common.errors import UserError
from tools.bench.panel import DEBOUNCE_S, HOLD_S, Ranges, plan
from tools.bench.scenario import Rating, in_numbers

PARAMS = {"MINIMUM_SPEED_RPM": 500.0, "NOMINAL_SPEED_RPM": 2800.0, "MAXIMUM_SPEED_RPM": 5500.0, "MAXIMUM_CURRENT_A": 2.75}
STEP = 1.0 / 1024.0


def actions(text: str, defines=(), start=None):
    return plan(scenario(text), Ranges.of(PARAMS, list(defines)), start or {})


def percent(text: str, defines=(), params=None):
    """actions() of a motor with 2500 rpm and 0.08 N m; it is started at 0.2 s."""
    params = PARAMS | (params or {})
    item = in_numbers(scenario(event(0.2, "press = \"S2\"") + text), Rating(2500.0, 0.08), params)
    return plan(item, Ranges.of(params, list(defines)), {"load.constant_nm": 0.0})


def presses(found, key: str) -> list[float]:
    return [action.at_s for action in found if action.keys.get(key) == 1.0]


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


class PerCent(unittest.TestCase):
    def rpm(self, found, fast: bool) -> list[float]:
        low, high = (2800.0, 5500.0) if fast else (500.0, 2800.0)
        return [low + (high - low) * position for position in pots(found)]

    def test_a_speed_of_the_normal_range_needs_the_potentiometer_only(self):
        found = percent(event(0.5, "speed_percent = 40"))
        self.assertAlmostEqual(self.rpm(found, False)[0], 1000.0, delta=2.0)
        self.assertEqual(presses(found, "input.s3"), [])

    def test_a_speed_beyond_it_is_reached_by_s3_and_the_potentiometer_moves_when_the_button_acts(self):
        found = percent(event(0.5, "speed_percent = 160"))
        self.assertEqual(presses(found, "input.s3"), [0.5])
        self.assertIn((0.5 + HOLD_S, 0.0), [(action.at_s, action.keys.get("input.s3")) for action in found])
        turned = [action for action in found if "input.pot" in action.keys]
        self.assertEqual([round(action.at_s, 6) for action in turned], [0.5 + DEBOUNCE_S])
        self.assertAlmostEqual(self.rpm(found, True)[-1], 4000.0, delta=2.0)

    def test_the_way_back_takes_s3_again(self):
        found = percent(event(0.5, "speed_percent = 160") + event(1.5, "speed_percent = 40"))
        self.assertEqual(presses(found, "input.s3"), [0.5, 1.5])
        self.assertAlmostEqual(self.rpm(found, False)[-1], 1000.0, delta=2.0)

    def test_within_the_fast_range_s3_is_left_alone(self):
        found = percent(event(0.5, "speed_percent = 160") + event(1.5, "speed_percent = 200") + event(1.7, "speed = \"maximum\""))
        self.assertEqual(presses(found, "input.s3"), [0.5])
        self.assertAlmostEqual(self.rpm(found, True)[1], 5000.0, delta=2.0)

    def test_the_border_belongs_to_both_ranges(self):
        found = percent(event(0.5, "speed = \"nominal\"") + event(0.7, "speed_percent = 160") + event(1.7, "speed = \"nominal\""))
        self.assertEqual(presses(found, "input.s3"), [0.7])

    def test_a_slow_turn_goes_through_the_border_at_its_share_of_the_time(self):
        found = percent(event(0.5, "speed = \"minimum\"") + event(0.6, "speed_percent = 160\nover_s = 0.7"))
        at_s = presses(found, "input.s3")[0]
        self.assertAlmostEqual(at_s, 0.6 + 0.7 * 2300.0 / 3500.0, delta=0.002)
        before = [action.keys["input.pot"] for action in found if "input.pot" in action.keys and 0.6 <= action.at_s <= at_s]
        after = [action.keys["input.pot"] for action in found if "input.pot" in action.keys and action.at_s > at_s]
        self.assertEqual((before, after), (sorted(before), sorted(after)))
        self.assertAlmostEqual(before[-1], 1.0, delta=STEP)
        self.assertAlmostEqual(after[0], 0.0, delta=STEP)
        self.assertAlmostEqual(after[-1], 1200.0 / 2700.0, delta=STEP)
        self.assertAlmostEqual(max(action.at_s for action in found if "input.pot" in action.keys), 1.3 + DEBOUNCE_S, delta=0.002)

    def test_a_slow_turn_back_goes_down_in_both_ranges(self):
        found = percent(event(0.3, "speed = \"maximum\"") + event(0.6, "speed_percent = 40\nover_s = 0.9"))
        at_s = presses(found, "input.s3")[1]
        self.assertAlmostEqual(at_s, 0.6 + 0.9 * 2700.0 / 4500.0, delta=0.002)
        after = [action.keys["input.pot"] for action in found if "input.pot" in action.keys and action.at_s > at_s]
        self.assertEqual(after, sorted(after, reverse=True))
        self.assertAlmostEqual(after[0], 1.0, delta=STEP)
        self.assertAlmostEqual(after[-1], 500.0 / 2300.0, delta=STEP)

    def test_a_button_that_is_still_down_is_let_go_before_it_is_pressed_again(self):
        first, second = presses(percent(event(0.5, "speed_percent = 160") + event(0.52, "speed_percent = 40")), "input.s3")
        self.assertGreaterEqual(second, first + HOLD_S + DEBOUNCE_S)

    def test_s3_does_nothing_before_the_start_so_its_range_is_refused_there(self):
        item = in_numbers(scenario(event(0.0, "speed_percent = 160")), Rating(2500.0, 0.08), PARAMS)
        with self.assertRaisesRegex(UserError, r"speed_percent = 160 \(4000 rpm\) is impossible, .*line 8: .*before S2; start the motor first"):
            plan(item, Ranges.of(PARAMS, []), {})

    def test_a_speed_that_the_header_does_not_allow_is_refused_with_its_rpm_and_its_line(self):
        for share, rpm in ((10, 250), (230, 5750), (-40, -1000)):
            with self.assertRaisesRegex(UserError, rf"speed_percent = {share} \({rpm} rpm\) is impossible, .*line 11: "
                                                   "the header's speeds are 500 .. 5500 rpm"):
                percent(event(0.5, f"speed_percent = {share}"))

    def test_a_header_without_a_fast_range_has_its_end_at_the_nominal_speed(self):
        self.assertEqual(presses(percent(event(0.5, "speed = \"maximum\""), params={"MAXIMUM_SPEED_RPM": 2800.0}), "input.s3"), [])
        with self.assertRaisesRegex(UserError, "500 .. 2800 rpm"):
            percent(event(0.5, "speed_percent = 160"), params={"MAXIMUM_SPEED_RPM": 2800.0})

    def test_backwards_is_possible_where_the_potentiometer_has_a_middle(self):
        found = percent(event(0.5, "speed_percent = 66") + event(1.0, "speed_percent = -66"), ["BIDIRECTIONAL_SPEED"])
        self.assertAlmostEqual(pots(found)[0], 0.75)
        self.assertAlmostEqual(pots(found)[1], 0.25)
        with self.assertRaisesRegex(UserError, "500 .. 2800 rpm"):
            percent(event(0.5, "speed_percent = 160"), ["BIDIRECTIONAL_SPEED"])

    def test_torque_is_a_brake_in_per_cent_of_the_rated_one(self):
        found = percent(event(0.5, "torque_percent = 50\nover_s = 0.1"))
        values = [action.keys["load.constant_nm"] for action in found if "load.constant_nm" in action.keys]
        self.assertEqual((values[-1], values), (0.04, sorted(values)))
        self.assertIn("brake to 50 % of the rated torque: 0.04 N m", [action.text for action in found])

    def test_the_protocol_tells_speed_and_button(self):
        texts = [action.text for action in percent(event(0.5, "speed_percent = 160\nover_s = 0.5")) if action.text]
        self.assertEqual(texts, ["S2 pressed", "potentiometer to 4000 rpm", "S3 pressed"])


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
