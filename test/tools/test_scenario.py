"""Scenario files: what they may say, and the line that each mistake gets."""

import unittest

from support import SCENARIO, document, scenario

from tools.foc33 import places
from tools.foc33.errors import UserError
from tools.foc33.scenario import load, read

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
    "expectation of an unknown value": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\nvalue = \"sped_rpm\"\nmin = 1",
                                        ["'sped_rpm' is no value", "did you mean 'speed_rpm'?"]),
    "expectation without bounds": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\nvalue = \"speed_rpm\"",
                                   ["neither 'min' nor 'max'"]),
    "bounds in the wrong order": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\nvalue = \"speed_rpm\"\nmin = 2\nmax = 1",
                                  ["min = 2 is above max = 1"]),
    "speed error without a reference": (MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = \"m\"\n"
                                        "value = \"speed_error_percent\"\nmax = 1", ["'m' has no speed error", "add reference_rpm"]),
    "expectation with a key of another kind": ("[[expect]]\nkind = \"no_fault\"\nwithin_s = 1", ["unknown key 'within_s'"]),
    "define that is no macro": ("[firmware]\ndefines = [\"TUNING; rm\"]", ["'TUNING; rm' is no macro"]),
    "define that is no text": ("[firmware]\ndefines = \"TUNING\"", ["'defines' is not a list of texts"]),
    "unknown key of [start]": ("[start]\nrotor = 1", ["unknown key 'rotor'", "did you mean 'rotor_deg'?"]),
}


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
        for name in places.names(places.SCENARIOS):
            with self.subTest(name):
                self.assertTrue(load(name).expectations)

    def test_there_is_a_scenario_for_each_mode_and_each_fault(self):
        defines = {define for name in places.names(places.SCENARIOS) for define in load(name).defines}
        self.assertEqual(defines, {"OPEN_LOOP_FUNCTIONING", "TUNING", "TORQUE_MODE", "BIDIRECTIONAL_SPEED", "SNAPSHOT"})
        faults = {expectation.name for name in places.names(places.SCENARIOS) for expectation in load(name).expectations
                  if type(expectation).__name__ == "FaultExpectation"}
        self.assertLessEqual({"OVERCURRENT_HW", "OVERCURRENT_SW", "OVERVOLTAGE", "UNDERVOLTAGE", "START_FAILED", "STALL", "LOST_LOCK",
                              "ISR_OVERRUN"}, faults)


if __name__ == "__main__":
    unittest.main()
