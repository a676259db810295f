"""Scenario files: what they may say, and the line that each mistake gets."""

import unittest

from support import SCENARIO, document, scenario

from tools.common import paths
from tools.common.errors import UserError
from tools.bench.scenario import Rating, asks_for_rating, in_numbers
from tools.bench.scenario_file import load, read

EVENT = "[[event]]\nat_s = 1.0\n"
MEASURE = "[[measure]]\nname = \"m\"\nfrom_s = 0.5\nto_s = 1.0\n"

MISTAKES = {
    "unknown key": ("colour = \"red\"", ["unknown key 'colour'"]),
    "misspelt key": ("descripton = \"x\"", ["unknown key 'descripton'", "did you mean 'description'?"]),
    "event without a time": ("[[event]]\npress = \"S2\"", ["'at_s' is missing"]),
    "event without an action": (EVENT, ["nothing to do", "press, speed_rpm"]),
    "event with two actions": (EVENT + "press = \"S2\"\npot = 0.5", ["'press' and 'pot' together"]),
    "unknown button": (EVENT + "press = \"S4\"", ["'S4' is no press"]),
    "event after the end": ("[[event]]\nat_s = 2.5\npress = \"S2\"", ["at_s = 2.5 is after the end", "0 .. duration_s = 2"]),
    "event before the start": ("[[event]]\nat_s = -1\npress = \"S2\"", ["'at_s' = -1 is impossible"]),
    "potentiometer beyond its end": (EVENT + "pot = 1.2", ["'pot' = 1.2 is impossible", "0 .. 1"]),
    "holding a potentiometer": (EVENT + "pot = 0.2\nhold_s = 1", ["'hold_s' with 'pot'"]),
    "pressing slowly": (EVENT + "press = \"S2\"\nover_s = 1", ["'over_s' with 'press'"]),
    "text as a plant value": (EVENT + "set = { \"load.constant_nm\" = \"big\" }", ["'load.constant_nm' is not a number"]),
    "variable beyond 16 bits": (EVENT + "debug = { SnapStart = 70000 }", ["'SnapStart' = 70000 is impossible"]),
    "measure backwards": ("[[measure]]\nname = \"m\"\nfrom_s = 1.0\nto_s = 0.5", ["to_s = 0.5 is not after from_s = 1"]),
    "measure after the end": ("[[measure]]\nname = \"m\"\nfrom_s = 1.0\nto_s = 3.0", ["'to_s' = 3 is impossible"]),
    "measure of no speed": (MEASURE + "reference_rpm = 0", ["'reference_rpm' = 0 is impossible"]),
    "two measures of one name": (MEASURE + MEASURE, ["two measures are called 'm'"]),
    "unknown kind of expectation": ("[[expect]]\nkind = \"hope\"", ["'hope' is no kind"]),
    "expectation of an unknown measure": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"n\"\nvalue = \"speed_rpm\"\nmin = 1",
                                          ["'n' is no measure", "use one of m"]),
    "expectation of several measures, one unknown": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = [\"m\", \"n\"]\nvalue = \"speed_rpm\"\nmin = 1",
                                                     ["'n' is no measure", "use one of m"]),
    "expectation of an unknown value": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\nvalue = \"sped_rpm\"\nmin = 1",
                                        ["'sped_rpm' is no value", "did you mean 'speed_rpm'?"]),
    "expectation without bounds": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\nvalue = \"speed_rpm\"",
                                   ["neither 'min' nor 'max'"]),
    "bounds in the wrong order": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\nvalue = \"speed_rpm\"\nmin = 2\nmax = 1",
                                  ["min = 2 is above max = 1"]),
    "speed error without a reference": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\n"
                                        "value = \"speed_error_percent\"\nmax = 1", ["'m' has no speed error", "add reference_rpm"]),
    "expectation with a key of another kind": ("[[expect]]\nkind = \"no_fault\"\nwithin_s = 1", ["unknown key 'within_s'"]),
    "per cent of a speed as a text": (EVENT + "speed_percent = \"half\"", ["'speed_percent' is not a number", "line 8"]),
    "torque that drives": (EVENT + "torque_percent = -50", ["'torque_percent' = -50 is impossible", "0 .. 1000", "line 8"]),
    "absurd per cent of a speed": (EVENT + "speed_percent = 5000", ["'speed_percent' = 5000 is impossible"]),
    "speed by an unknown name": (EVENT + "speed = \"fast\"", ["'fast' is no speed", "maximum, minimum, nominal"]),
    "speed in rpm and in per cent": (EVENT + "speed_rpm = 1000\nspeed_percent = 20", ["'speed_rpm' and 'speed_percent' together"]),
    "holding a speed": (EVENT + "speed_percent = 50\nhold_s = 1", ["'hold_s' with 'speed_percent'"]),
    "measure with two references": (MEASURE + "reference_rpm = 1000\nreference_percent = 50",
                                    ["'reference_rpm' and 'reference_percent' together", "line 11"]),
    "measure of no per cent": (MEASURE + "reference_percent = 0", ["'reference_percent' = 0 is impossible", "line 10"]),
    "measure of an unknown speed": (MEASURE + "reference = \"top\"", ["'top' is no reference"]),
    "define that is no macro": ("[firmware]\ndefines = [\"TUNING; rm\"]", ["'TUNING; rm' is no macro"]),
    "define that is no text": ("[firmware]\ndefines = \"TUNING\"", ["'defines' is not a list of texts"]),
    "unknown key of [start]": ("[start]\nrotor = 1", ["unknown key 'rotor'", "did you mean 'rotor_deg'?"]),
}


PERCENT = """
[[event]]
at_s = 0.5
speed_percent = 40
[[event]]
at_s = 0.6
torque_percent = 25
over_s = 0.5
[[event]]
at_s = 1.0
speed = "maximum"
[[measure]]
name = "40 %"
from_s = 0.5
to_s = 1.0
reference_percent = 40
[[measure]]
name = "top"
from_s = 1.5
to_s = 2.0
reference = "maximum"
[[expect]]
kind = "measure"
measure = "40 %"
value = "speed_error_percent"
max = 1
"""


class PerCent(unittest.TestCase):
    def test_per_cents_become_numbers_of_the_motor_and_names_those_of_the_header(self):
        item = in_numbers(scenario(PERCENT), Rating(2500.0, 0.08), {"MAXIMUM_SPEED_RPM": 5500.0})
        self.assertEqual([(event.kind, event.keys or event.value) for event in item.events],
                         [("speed_rpm", 1000.0), ("set", {"load.constant_nm": 0.02}), ("speed_rpm", 5500.0)])
        self.assertEqual(item.events[1].over_s, 0.5)
        self.assertEqual([measure.reference_rpm for measure in item.measures], [1000.0, 5500.0])

    def test_only_per_cents_need_a_rating(self):
        self.assertTrue(asks_for_rating(scenario(PERCENT)))
        for text in ("[[event]]\nat_s = 0\nspeed_percent = 20\n", "[[event]]\nat_s = 0\ntorque_percent = 20\n",
                     MEASURE + "reference_percent = 20\n"):
            self.assertTrue(asks_for_rating(scenario(text)), text)
        self.assertFalse(asks_for_rating(scenario(MEASURE + "reference_rpm = 1000\n" + EVENT + "speed = \"maximum\"\n")))

    def test_a_scenario_in_numbers_stays_as_it_is(self):
        item = scenario(MEASURE + "reference_rpm = 1000\n" + EVENT + "speed_rpm = 1000\n")
        self.assertEqual(in_numbers(item, None, {}), item)

    def test_a_header_that_does_not_tell_its_speeds_is_refused(self):
        with self.assertRaisesRegex(UserError, "does not tell MAXIMUM_SPEED_RPM"):
            in_numbers(scenario(PERCENT), Rating(2500.0, 0.08), {})

    def test_the_rated_scenario_asks_for_20_50_and_100_per_cent_at_half_torque(self):
        item = load("rated")
        torque, at = 0.0, {}
        for event in item.events: # the brake at the end of each measure
            at |= {measure.reference_percent or measure.reference: torque for measure in item.measures
                   if measure.name not in at and measure.to_s <= event.at_s and (measure.reference_percent or measure.reference) not in at}
            torque = event.value if event.kind == "torque_percent" else torque
        self.assertEqual(at, {20.0: 50.0, 50.0: 50.0, 100.0: 50.0, "maximum": 0.0})


class ScenarioFile(unittest.TestCase):
    def test_every_mistake_gets_one_line_with_its_place(self):
        for name, (text, parts) in MISTAKES.items():
            with self.subTest(name), self.assertRaises(UserError) as caught:
                scenario(text)
            line = str(caught.exception)
            self.assertNotIn("\n", line, name)
            self.assertIn("test.toml line ", line, name)
            for part in parts:
                self.assertIn(part, line, name)

    def test_each_required_key_is_missed_by_name(self):
        for key in ("title", "motor", "board", "duration_s"):
            text = "".join(line + "\n" for line in SCENARIO.splitlines() if not line.startswith(key))
            with self.subTest(key), self.assertRaisesRegex(UserError, f"'{key}' is missing"):
                read(document(text))

    def test_an_endless_or_empty_run_is_impossible(self):
        for duration in (0, -1, 1e6):
            with self.subTest(duration), self.assertRaisesRegex(UserError, "'duration_s' = .* is impossible"):
                read(document(SCENARIO.replace("2.0", str(duration))))

    def test_events_come_in_order_of_time(self):
        found = scenario("[[event]]\nat_s = 1.5\npot = 1\n[[event]]\nat_s = 0.5\npot = 0\n").events
        self.assertEqual([event.at_s for event in found], [0.5, 1.5])

    def test_a_button_is_held_for_a_tenth_of_a_second_if_nothing_is_said(self):
        self.assertEqual(scenario(EVENT + "press = \"S2\"").events[0].hold_s, 0.1)

    def test_an_unknown_scenario_gets_the_nearest_name(self):
        with self.assertRaisesRegex(UserError, "no scenario 'dmeo', .*: did you mean 'demo'"):
            load("dmeo")

    def test_every_scenario_of_the_project_is_valid_and_expects_something(self):
        for name in paths.names(paths.SCENARIOS):
            with self.subTest(name):
                self.assertTrue(load(name).expectations)

    def test_there_is_a_scenario_for_each_mode_and_each_fault(self):
        defines = {define for name in paths.names(paths.SCENARIOS) for define in load(name).defines}
        self.assertEqual(defines, {"OPEN_LOOP_FUNCTIONING", "TUNING", "TORQUE_MODE", "BIDIRECTIONAL_SPEED", "SNAPSHOT"})
        faults = {expectation.name for name in paths.names(paths.SCENARIOS) for expectation in load(name).expectations
                  if type(expectation).__name__ == "FaultExpectation"}
        self.assertLessEqual({"OVERCURRENT_HW", "OVERCURRENT_SW", "OVERVOLTAGE", "UNDERVOLTAGE", "START_FAILED", "STALL", "LOST_LOCK",
                              "ISR_OVERRUN"}, faults)
