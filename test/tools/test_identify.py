"""The `identify` command: the neutral header, one motor on the virtual board, its report, and what it refuses."""

import json
import re
import tempfile
import unittest
from dataclasses import replace
from pathlib import Path

from tools.common import board_file, board_keys, motor_file, paths
from tools.common.errors import UserError
from tune_support import HURST, command, motors
from tuning import constants, identify, identify_result


class Tables(unittest.TestCase):
    def test_results_have_name_cause_and_remedy(self):
        results = identify_result.results()
        self.assertEqual(sorted(results), list(range(len(results))))
        self.assertEqual(results[2].name, "DONE")
        self.assertEqual(results[8].name, "NOT_TURNING")
        for result in results.values():
            self.assertRegex(result.name, r"^[A-Z_]+$")
            self.assertGreater(len(result.cause), 10)
            self.assertGreater(len(result.remedy), 5)
            self.assertNotIn('"', result.cause + result.remedy)

    def test_steps_begin_with_idle_and_end_with_full_speed(self):
        self.assertEqual(identify_result.step_names()[0], "IDLE")
        self.assertEqual(identify_result.step_names()[-1], "SPIN_FULL")


class Header(unittest.TestCase):
    def setUp(self):
        self.board = board_file.load("mclv")
        self.motor = motor_file.load(HURST)

    def define(self, text: str, name: str) -> str:
        return re.search(rf"^#define {name} (\S+)$", text, re.MULTILINE)[1]

    def test_knows_pole_pairs_current_and_speed_of_the_rating(self):
        text = identify.header(identify_result.Known.of(self.motor, self.board), self.board)
        self.assertEqual(self.define(text, "NOPOLESPAIRS"), "5")
        self.assertEqual(self.define(text, "Q_CURRENT_REF_OPENLOOP"), "1.53")
        self.assertEqual(self.define(text, "END_SPEED_RPM"), "1120")

    def test_a_board_for_large_currents_builds_too(self):
        """33 A and 48 A of range: with the placeholders of the MCLV the back-EMF's number format would overflow."""
        for full_scale_a in (33.0, 46.0):
            text = identify.header(identify_result.Known(4, 17.0, 1400.0), replace(self.board, current_full_scale_a=full_scale_a))
            values = {name: value for name, value in re.findall(r"^#define (\w+) (\S+)$", text, re.MULTILINE) if name != "USERPARAMS_H"}
            self.assertEqual(constants.header(values).wrong, [])
        self.assertEqual(self.define(identify.header(identify_result.Known(4, 1.0, 1400.0), self.board), "MOTOR_RS_OHM"), "1")

    def test_knows_nothing_of_what_is_to_be_measured(self):
        """Motors that differ in everything else have the same header."""
        known = identify_result.Known(5, 1.0, 1000.0)
        text = identify.header(known, self.board)
        for number in ("2.67", "1.92", "7.24", "5.5e-06"):
            self.assertNotIn(f" {number}\n", text)
        self.assertEqual(text, identify.header(identify_result.Known(5, 1.0, 1000.0), self.board))

    def test_current_stays_below_the_boards_trip(self):
        for name in motors():
            known = identify_result.Known.of(motor_file.load(name), self.board)
            text = identify.header(known, self.board)
            self.assertLess(1.2 * known.current_a, float(self.define(text, "OVER_CURRENT_THRESHOLD_A")))

    def test_a_bus_below_the_rating_lowers_the_speed(self):
        high = replace(self.motor, rated_voltage_v=48.0)
        self.assertAlmostEqual(identify_result.Known.of(high, self.board).speed_rpm, 560.0)

    def test_current_and_speed_can_be_given(self):
        known = identify_result.Known.of(self.motor, self.board, 0.7, 800.0)
        self.assertEqual((known.current_a, known.speed_rpm), (0.7, 800.0))


class Run(unittest.TestCase):
    """One run for all of these."""

    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.temporary.name) / "result"
        cls.code, cls.out, cls.error = command("identify", HURST, "--quiet", "--out", str(cls.folder))
        cls.summary = json.loads((cls.folder / "summary.json").read_text(encoding="utf-8"))

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def test_ends_well(self):
        self.assertEqual((self.code, self.error), (0, ""))
        self.assertEqual(self.summary["result"], "DONE")

    def test_every_value_is_within_its_limit_and_close_to_the_truth(self):
        limits = {row["name"].split()[0]: row for row in self.summary["rows"][1:]}
        self.assertEqual(sorted(limits), ["Kphi", "Ld", "Lq", "R"])
        self.assertEqual({name: row["limit_percent"] for name, row in limits.items()}, {"R": 3.0, "Ld": 5.0, "Lq": 5.0, "Kphi": 2.0})
        for row in limits.values():
            self.assertLess(abs(row["error_percent"]), 1.0, row)

    def test_table_shows_loop_and_winding(self):
        self.assertRegex(self.out, r"R loop \[mohm\] +269\d +2692\.5")
        self.assertRegex(self.out, r"R winding \[mohm\] +26[67]\d\.5 +2670\.0 +[+-]0\.\d\d +3 +PASS")

    def test_every_step_is_in_the_protocol_once(self):
        seen = [step["step"] for step in self.summary["steps"]]
        self.assertEqual(seen[1:-1], identify_result.step_names()[1:])

    def test_the_lines_to_paste_are_a_motor_file(self):
        lines = (self.folder / "electrical.toml").read_text(encoding="utf-8")
        self.assertIn(lines.strip(), self.out)
        text = (paths.MOTORS / f"{HURST}.toml").read_text(encoding="utf-8")
        pasted = re.sub(r"\[electrical\].*?(?=^\[mechanical\])", lambda _: lines + "\n", text, flags=re.DOTALL | re.MULTILINE)
        path = self.folder / "pasted.toml"
        path.write_text(pasted, encoding="utf-8")
        found, true = motor_file.load(str(path)), motor_file.load(HURST)
        self.assertAlmostEqual(found.rs_ohm / true.rs_ohm, 1.0, delta=0.01)
        self.assertAlmostEqual(found.ld_h / true.ld_h, 1.0, delta=0.01)
        self.assertAlmostEqual(found.kphi_v_per_krpm / true.kphi_v_per_krpm, 1.0, delta=0.01)
        self.assertFalse(found.salient)

    def test_plots_and_header_are_there(self):
        for name in ("resistance.png", "inductance.png", "back_emf.png"):
            self.assertGreater((self.folder / name).stat().st_size, 10000, name)
        self.assertIn("#define NOPOLESPAIRS 5\n", (self.folder / "userparams.h").read_text(encoding="utf-8"))


class Verdict(unittest.TestCase):
    """Made-up measurements: the comparison itself."""

    def item(self, watch: dict, fault: str = "NONE", **changes) -> identify_result.Identified:
        board, motor = board_file.load("mclv"), motor_file.load(HURST)
        values = {"motor.rs_ohm": 2.67, "motor.ld_h": 1.92e-3, "motor.lq_h": 1.92e-3, "motor.psi_vs": 7.983e-3, "motor.pole_pairs": 5,
                  "motor.r_tempco": 0.0039, "motor.psi_tempco": -0.002} | changes
        full = {"step": 0, "result": 2, "Rs_mohm": 2692, "Ld_uH": 1920, "Lq_uH": 1920, "Kphi_mV_per_krpm": 7240} | watch
        measured = identify_result.Measured(full, fault, [(0.0, 0)], None)
        return identify_result.Identified(motor, board, identify_result.Known(5, 1.5, 1000.0), "", values, measured)

    def test_true_values_pass(self):
        self.assertEqual(self.item({}).problems(), [])

    def test_each_limit_is_kept(self):
        for name, just, beyond in (("Rs_mohm", 2692 + 80, 2692 + 81), ("Ld_uH", 2015, 2017), ("Lq_uH", 1825, 1823),
                                   ("Kphi_mV_per_krpm", 7384, 7386)):
            self.assertEqual(self.item({name: just}).problems(), [], name)
            self.assertEqual(len(self.item({name: beyond}).problems()), 1, name)

    def test_a_hot_motor_has_other_true_values(self):
        self.assertEqual(len(self.item({}, **{"motor.temp_c": 75.0}).problems()), 2)
        hot = {"Rs_mohm": round(2670 * 1.195 + 22.5), "Kphi_mV_per_krpm": round(7240 * 0.9)}
        self.assertEqual(self.item(hot, **{"motor.temp_c": 75.0}).problems(), [])

    def test_salient_motors_get_both_inductances(self):
        self.assertIn('inductance = { value = 3.86, unit = "mH line-to-line"', self.item({"Lq_uH": 1940}).paste())
        lines = self.item({"Lq_uH": 2500}).paste()
        self.assertIn("inductance_d = { value = 3.84,", lines)
        self.assertIn("inductance_q = { value = 5,", lines)

    def test_the_lines_to_paste_suit_a_star_and_a_delta(self):
        text = (paths.MOTORS / f"{HURST}.toml").read_text(encoding="utf-8")
        for connection in ("Y", "delta"):
            for watch in ({}, {"Lq_uH": 2500}):
                with self.subTest(connection, watch=watch), tempfile.TemporaryDirectory() as folder:
                    path = Path(folder) / "pasted.toml"
                    lines = self.item(watch).paste()
                    pasted = re.sub(r"\[electrical\].*?(?=^\[mechanical\])", lambda _: lines + "\n", text, flags=re.DOTALL | re.MULTILINE)
                    path.write_text(pasted.replace('"Y"', f'"{connection}"').split("[spread]")[0], encoding="utf-8")
                    motor = motor_file.load(str(path))
                    self.assertAlmostEqual(motor.rs_ohm, 2.6695, delta=1e-3)
                    self.assertAlmostEqual(motor.ld_h, 1.92e-3, delta=1e-6)

    def test_another_end_is_one_line_with_the_remedy(self):
        (line,) = self.item({"result": 9}).problems()
        self.assertIn("VOLTAGE_LIMIT", line)
        self.assertIn("lower END_SPEED_RPM", line)
        (line,) = self.item({"result": 3}, "OVERCURRENT_SW").problems()
        self.assertIn("fault OVERCURRENT_SW", line)


class Refused(unittest.TestCase):
    def refused(self, *arguments: str) -> str:
        code, out, error = command("identify", *arguments)
        self.assertEqual((code, out), (2, ""))
        self.assertEqual(error.count("\n"), 1)
        return error

    def test_mistakes_on_the_command_line(self):
        for arguments, says in (((), "which motor?"), ((HURST, "--all"), "which motor?"), (("hurst",), "no motor 'hurst'"),
                                ((HURST, "--current", "0.01"), "current = 0.01 is impossible"), ((HURST, "--speed", "9000"), "speed = 9000 is impossible"),
                                (("--all", "--out", "x"), "one folder"), ((HURST, "--set", "load.lock=1"), "unknown key 'load.lock'")):
            self.assertIn(says, self.refused(*arguments))
        with self.assertRaises(UserError):
            identify.identify([motor_file.load(HURST)], "mclv", board_keys.Values({"no.key": 1.0}, {}))

    def test_a_current_beyond_the_board_is_named_by_the_build(self):
        self.assertIn("MAXIMUM_CURRENT_A must be below OVER_CURRENT_THRESHOLD_A", self.refused(HURST, "--current", "4.2"))


if __name__ == "__main__":
    unittest.main()
