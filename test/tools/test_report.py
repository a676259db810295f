"""Reports: table, protocol, data for programs, plots."""

import json
import tempfile
import unittest
from pathlib import Path

import numpy as np
from support import run, step

from tools.bench import plots, report

TEXT = """
[[event]]
at_s = 0.1
press = "S2"
[[measure]]
name = "1000 rpm"
from_s = 1.0
to_s = 2.0
reference_rpm = 1000
[[measure]]
name = "end"
from_s = 1.5
to_s = 2.0
[[expect]]
kind = "hand_over"
within_s = 0.5
"""


def example(**more):
    signals = {"fw__state": step((0, 4), (0.8, 5)), "plant__speed_rpm": 1001, "fw__speed_ref_rpm": 1000, "fw__speed_est_rpm": 1002,
               "pwm__outputs_seen": 63, "fw__v_q_v": 4, "fw__v_limit_v": 13} | more
    return run(TEXT, **signals)


class Texts(unittest.TestCase):
    def test_the_table_has_a_row_for_each_measure_and_dashes_for_what_is_unknown(self):
        data = report.summary(example(), [], "motor", "board")
        lines = report.table(data["measures"]).splitlines()
        self.assertEqual(len(lines), 5)
        self.assertRegex(lines[3], r"^1000 rpm +1000 +1001\.0 +1002\.0 +\+0\.10 ")
        self.assertRegex(lines[4], r"^end +- +1001\.0 +1002\.0 +- ")

    def test_all_lines_of_the_table_are_aligned(self):
        lines = report.table(report.summary(example(), [], "", "")["measures"]).splitlines()
        self.assertEqual(len({len(line) for line in lines}), 1)

    def test_the_protocol_tells_when_the_loop_closed(self):
        entries = [(round(at_s, 3), text) for at_s, text in report.protocol(example())]
        self.assertIn((0.8, "closed loop 0.70 s after S2, overshoot 0.1 %"), entries)

    def test_the_protocol_names_a_fault_and_its_end(self):
        texts = [text for _, text in report.protocol(example(fw__fault=step((0, 0), (1.0, 6), (1.5, 0))))]
        self.assertIn("fault STALL", texts)
        self.assertIn("fault cleared", texts)

    def test_a_run_without_a_fault_has_none_in_its_protocol(self):
        self.assertFalse([text for _, text in report.protocol(example()) if "fault" in text])

    def test_failed_expectations_are_marked(self):
        item = example()
        text = report.outcomes_text(report.check(item))
        self.assertTrue(text.startswith("FAIL  hand-over: closed loop  0.700 s  (allowed: at most 0.5 s after S2)"), text)

    def test_warnings_of_the_board_are_printed(self):
        item = example()
        item.warnings = ["P1DTCON1: dead time is 0"]
        self.assertIn("warning of the board: P1DTCON1: dead time is 0", report.text(item, [], report.summary(item, [], "", "")))


    def test_motor_and_header_are_told_and_a_note_if_they_do_not_fit(self):
        item, used = example(), {"motor": "m.toml", "motor_title": "M", "header": "userparams.h", "note": ""}
        text = report.text(item, [], report.summary(item, [], "", "") | used)
        self.assertIn("motor   m.toml: M\nheader  userparams.h\n\n", text)
        self.assertIn("\nnote    another\n", report.text(item, [], report.summary(item, [], "", "") | used | {"note": "another"}))


class Data(unittest.TestCase):
    def test_a_summary_is_valid_json_even_with_numbers_that_json_lacks(self):
        item = example(plant__torque_nm=np.inf)
        data = report.summary(item, report.check(item), "motor", "board")
        self.assertIsNone(data["measures"][0]["torque_nm"])
        self.assertEqual(json.loads(json.dumps(data, allow_nan=False))["measures"][0]["name"], "1000 rpm")

    def test_passed_tells_whether_every_expectation_holds(self):
        item = example()
        self.assertFalse(report.summary(item, report.check(item), "", "")["passed"])
        self.assertTrue(report.summary(item, [], "", "")["passed"])


class Plots(unittest.TestCase):
    def names(self, item) -> set[str]:
        with tempfile.TemporaryDirectory() as folder:
            files = plots.write_all(item, Path(folder))
            self.assertEqual({path.name for path in Path(folder).iterdir()}, set(files))
            for path in Path(folder).iterdir():
                self.assertEqual(path.read_bytes()[:4], b"\x89PNG")
            return set(files)

    def test_a_run_without_hand_over_has_the_four_basic_plots(self):
        self.assertEqual(self.names(example(fw__state=4)), {"speed.png", "currents.png", "voltages.png", "angle_error.png"})

    def test_hand_over_field_weakening_and_arrays_get_their_own_plots(self):
        item = example(fw__fw_index=step((0, 0), (1.5, 3)), fw__inv_kphi=7956)
        item.variables = {"SnapBuf1": [1, 2, 3]}
        self.assertLessEqual({"hand_over.png", "field_weakening.png", "variables.png"}, self.names(item))
