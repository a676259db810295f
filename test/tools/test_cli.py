"""The command line with the real virtual board: exit codes, one line for each mistake, results complete or absent."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from support import LIBRARY, SCENARIO, command

from tools.bench import build, command_common
from tools.common import motor_file, paths
from tools.bench.board import Library

START = """
[[event]]
at_s = 0.0
speed_rpm = 1000
[[event]]
at_s = 0.1
press = "S2"
[[measure]]
name = "waiting"
from_s = 1.9
to_s = 2.0
reference_rpm = 1000
[[expect]]
kind = "measure"
measure = "waiting"
value = "speed_rpm"
min = 900
"""

BAD = {
    "unknown plant key": ("[plant]\n\"motor.rs_om\" = 2\n", "unknown key 'motor.rs_om'", "did you mean 'motor.rs_ohm'?"),
    "impossible plant value": ("[plant]\n\"motor.rs_ohm\" = -2\n", "'motor.rs_ohm' = -2 is impossible", "choose"),
    "unknown key in an event": ("[[event]]\nat_s = 0.5\nset = { \"load.constnt_nm\" = 1 }\n", "unknown key 'load.constnt_nm'",
                                "load.constant_nm"),
    "impossible value in an event": ("[[event]]\nat_s = 0.5\nset = { \"input.pot\" = 2 }\n", "'input.pot' = 2 is impossible",
                                     "0 .. 1"),
    "speed that needs S3": ("[[event]]\nat_s = 0.5\nspeed_rpm = 5000\n", "speed_rpm = 5000 is impossible", "press S3"),
    "unknown signal": ("[[expect]]\nkind = \"signal\"\nsignal = \"fw.sped_est_rpm\"\nstatistic = \"max\"\nmax = 1\n",
                       "no signal 'fw.sped_est_rpm'", "did you mean 'fw.speed_est_rpm'?"),
    "unknown fault": ("[[expect]]\nkind = \"fault\"\nname = \"OVERVOLTS\"\nafter_s = 1\nwithin_s = 1\n", "no fault 'OVERVOLTS'",
                      "did you mean 'OVERVOLTAGE'?"),
    "unknown state": ("[[expect]]\nkind = \"state\"\nname = \"CLOSE\"\nat_s = 1\n", "no state 'CLOSE'", "did you mean 'CLOSED'?"),
    "speed in per cent beyond the header's": ("[[event]]\nat_s = 0.5\nspeed_percent = 5\n", "speed_percent = 5 (140 rpm) is impossible",
                                              "the header's speeds are 500 .. 5500 rpm"),
    "syntax": ("x = = 1\n", "TOML syntax", "line 6"),
}


class CommandLine(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        self.out = self.root / "out"

    def run_text(self, text: str, *more: str) -> tuple[int, str, str]:
        path = self.root / "test.toml"
        path.write_text(SCENARIO + text, encoding="utf-8")
        return command("run", str(path), "--out", str(self.out), "--library", str(LIBRARY), "--no-plots", "--quiet", *more)

    def refused(self, result: tuple[int, str, str], *parts: str) -> None:
        code, out, error = result
        self.assertEqual((code, out), (2, ""), error)
        self.assertRegex(error, r"\Afoc33: [^\n]+\n\Z")
        for part in parts:
            self.assertIn(part, error)
        self.assertFalse(self.out.exists())
        self.assertEqual([path.name for path in self.root.iterdir() if path.name.startswith(".")], [])

    def test_every_mistake_in_a_scenario_is_one_line_and_leaves_no_result(self):
        for name, (text, *parts) in BAD.items():
            with self.subTest(name):
                self.refused(self.run_text(text), *parts, "line ")

    def test_a_missing_scenario_motor_board_or_library_is_refused(self):
        self.refused(command("run", "no_such", "--out", str(self.out)), "no scenario 'no_such'")
        self.refused(command("run", "no/such.toml", "--out", str(self.out)), "no scenario file 'no/such.toml'")
        self.refused(self.run_text("", "--motor", "no_such"), "no motor 'no_such'", "--motor")
        self.refused(self.run_text("", "--board", "no_such"), "no board 'no_such'", "--board")
        self.refused(command("run", "demo", "--out", str(self.out), "--library", "no.so"), "no library 'no.so'")

    def test_a_library_that_is_none_is_refused(self):
        path = self.root / "wrong.so"
        path.write_text("no library", encoding="utf-8")
        self.refused(command("run", "demo", "--out", str(self.out), "--library", str(path)), "cannot load the virtual board")

    def test_an_output_folder_that_cannot_be_written_is_refused(self):
        (self.root / "file").write_text("x", encoding="utf-8")
        self.out = self.root / "file" / "out"
        self.refused(self.run_text(""), "cannot write to", "--out")

    def test_a_folder_that_holds_something_else_is_left_alone(self):
        self.out.mkdir()
        (self.out / "mine.txt").write_text("x", encoding="utf-8")
        code, _, error = self.run_text("")
        self.assertEqual(code, 2)
        self.assertIn("is not a result folder", error)
        self.assertEqual([path.name for path in self.out.iterdir()], ["mine.txt"])

    def test_wrong_options_are_one_line(self):
        self.refused(command("walk"), "invalid choice: 'walk'")
        self.refused(command("run", "--speed"), "unrecognized arguments: --speed")
        self.refused(self.run_text("", "--set", "motor.rs_ohm"), "'motor.rs_ohm' is no change", "--set")
        self.refused(self.run_text("", "--set", "motor.rs_ohm=big"), "'motor.rs_ohm=big' is no change")
        self.refused(command("starts", "--every-deg", "0", "--library", str(LIBRARY)), "every-deg = 0 is impossible")

    def test_a_good_run_ends_with_zero_and_complete_results(self):
        code, out, error = self.run_text(START)
        self.assertEqual((code, error), (0, ""))
        self.assertIn("1 of 1 expectations hold", out)
        self.assertRegex(out, r"simulated 2\.00 s of motor time in \d+\.\d+ s on one core \(\d+\.\d+ s of processor time\): \d+\.\d times real time")
        data = json.loads((self.out / "summary.json").read_text(encoding="utf-8"))
        self.assertTrue(data["passed"])
        self.assertEqual(data["measures"][0]["reference_rpm"], 1000)
        self.assertGreater(len((self.out / "trace.csv").read_text(encoding="utf-8").splitlines()), 3900)
        self.assertEqual([path.name for path in self.root.iterdir() if path.name.startswith(".")], [])

    def test_a_failed_expectation_ends_with_one_and_names_the_row_and_the_numbers(self):
        code, out, error = self.run_text(START.replace("min = 900", "min = 5000"))
        self.assertEqual(code, 1)
        self.assertRegex(error, r"\Afoc33: test: waiting: speed_rpm: got \d+, allowed at least 5000\n\Z")
        self.assertIn("FAIL  waiting: speed_rpm", out)
        self.assertFalse(json.loads((self.out / "summary.json").read_text(encoding="utf-8"))["passed"])

    def test_a_wrong_motor_makes_the_expectation_fail_by_name(self):
        code, _, error = self.run_text(START, "--set", "motor.psi_vs=x0.1")
        self.assertEqual(code, 1)
        self.assertIn("waiting: speed_rpm", error)

    def test_two_runs_of_a_scenario_are_the_same_to_the_last_digit(self):
        self.run_text(START)
        first = (self.out / "trace.csv").read_bytes()
        self.run_text(START)
        self.assertEqual((self.out / "trace.csv").read_bytes(), first)

    def test_the_report_tells_motor_and_header_and_says_if_they_do_not_belong_together(self):
        own = self.root / "other"
        own.mkdir()
        text = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
        (own / "userparams.h").write_text(re.sub(r"(#define MOTOR_RS_OHM) \S+", r"\1 2.0", text), encoding="utf-8")
        path = self.root / "test.toml"
        path.write_text(SCENARIO + START, encoding="utf-8")
        arguments = ["run", str(path), "--out", str(self.out), "--no-plots", "--quiet"]
        try:
            code, out, error = command(*arguments, "--userparams", str(own))
        finally:
            shutil.rmtree(paths.ROOT / "build" / f"host-{build.variant_name([], own)}", ignore_errors=True)
        self.assertEqual((code, error), (0, ""))
        data = json.loads((self.out / "summary.json").read_text(encoding="utf-8"))
        self.assertIn(f"\nheader  {own}/userparams.h\nnote    the header is for another motor: MOTOR_RS_OHM is 2 ohm", out)
        self.assertEqual((data["header"], data["motor"]), (f"{own}/userparams.h", "tuning/motors/hurst_dmb0224c10002.toml"))
        code, out, _ = command(*arguments)
        self.assertIn("\nheader  userparams.h\n\n", out)

    def test_a_header_that_is_not_there_or_comes_twice_is_refused(self):
        path = self.root / "test.toml"
        path.write_text(SCENARIO + START, encoding="utf-8")
        for name in ("run", "table2", "starts"):
            first = [name, str(path)] if name == "run" else [name]
            self.refused(command(*first, "--out", str(self.out), "--userparams", "no/where"), "no userparams.h in 'no/where'", "--userparams")
            self.refused(command(*first, "--out", str(self.out), "--userparams", ".", "--library", str(LIBRARY)), "leave out --library or")

    def test_a_scenario_in_per_cent_follows_the_motor_file(self):
        text = START.replace("speed_rpm = 1000", "speed_percent = 50", 1).replace("reference_rpm = 1000", "reference_percent = 50")
        code, out, error = self.run_text(text)
        self.assertEqual((code, error), (0, ""))
        self.assertEqual(json.loads((self.out / "summary.json").read_text(encoding="utf-8"))["measures"][0]["reference_rpm"],
                         0.5 * motor_file.load("hurst_dmb0224c10002").rated_speed_rpm)

    def test_an_ended_run_leaves_neither_results_nor_processes(self):
        path = self.root / "long.toml"
        path.write_text(SCENARIO.replace("2.0", "120.0"), encoding="utf-8")
        line = [sys.executable, "-m", "tools.bench", "run", str(path), "--out", str(self.out), "--library", str(LIBRARY)]
        process = subprocess.Popen(line, cwd=paths.ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   start_new_session=True)
        deadline = time.monotonic() + 20.0
        while time.monotonic() < deadline and not any(item.name.startswith(".out-unfinished") for item in self.root.iterdir()):
            time.sleep(0.02)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=20)
        self.assertEqual((process.returncode, error), (130, "foc33: interrupted, nothing was written\n"))
        self.assertEqual([item.name for item in self.root.iterdir()], ["long.toml"])
        with self.assertRaises(ProcessLookupError):
            os.killpg(process.pid, 0)

    def test_the_list_of_scenarios_has_a_line_for_each(self):
        code, out, _ = command("scenarios")
        self.assertEqual((code, [line.split()[0] for line in out.splitlines()]), (0, paths.names(paths.SCENARIOS)))

    def test_every_command_explains_itself(self):
        for name in ("run", "table2", "starts", "rated", "robust", "scenarios", "motors", "keys"):
            result = subprocess.run([sys.executable, "-m", "tools.bench", name, "--help"], cwd=paths.ROOT, capture_output=True,
                                    text=True, check=False)
            self.assertEqual((result.returncode, result.stderr), (0, ""), name)
            self.assertIn("usage:", result.stdout)

    def test_keys_lists_unit_and_range_of_the_board_s_keys(self):
        code, out, _ = command("keys", "--library", str(LIBRARY))
        self.assertEqual(code, 0)
        self.assertRegex(out, r"(?m)^motor\.rs_ohm +ohm +\S+ \.\. \S+ +\w")


class HeaderNote(unittest.TestCase):
    VALUES = {"motor.pole_pairs": 5.0, "motor.rs_ohm": 2.67, "motor.ld_h": 1.8e-3, "motor.lq_h": 2.0e-3, "motor.psi_vs": 7.983e-3}
    PARAMS = {"NOPOLESPAIRS": 5.0, "MOTOR_RS_OHM": 2.67, "MOTOR_LS_MH": 1.92, "MOTOR_KPHI_V_PER_KRPM": 7.24}

    def test_a_header_for_this_motor_has_none(self):
        self.assertEqual(command_common.header_note(self.VALUES, self.PARAMS), "")

    def test_a_header_of_a_salient_motor_may_hold_either_inductance(self):
        for ls_mh in (1.8, 2.0):
            self.assertEqual(command_common.header_note(self.VALUES, self.PARAMS | {"MOTOR_LS_MH": ls_mh}), "")

    def test_each_number_of_another_motor_is_named(self):
        for name, value, text in (("NOPOLESPAIRS", 4.0, "NOPOLESPAIRS is 4 pairs, the motor's is 5"),
                                  ("MOTOR_RS_OHM", 2.6, "MOTOR_RS_OHM is 2.6 ohm, the motor's is 2.67"),
                                  ("MOTOR_LS_MH", 2.1, "MOTOR_LS_MH is 2.1 mH, the motor's is 1.9"),
                                  ("MOTOR_KPHI_V_PER_KRPM", 7.0, "MOTOR_KPHI_V_PER_KRPM is 7 V peak/krpm, the motor's is 7.24")):
            self.assertEqual(command_common.header_note(self.VALUES, self.PARAMS | {name: value}), f"the header is for another motor: {text}")

    def test_two_numbers_are_both_named(self):
        note = command_common.header_note(self.VALUES, self.PARAMS | {"NOPOLESPAIRS": 2.0, "MOTOR_RS_OHM": 1.0})
        self.assertIn("NOPOLESPAIRS is 2 pairs, the motor's is 5; MOTOR_RS_OHM is 1 ohm", note)


class RealLibrary(unittest.TestCase):
    def test_the_firmware_tells_parameters_states_and_faults(self):
        library = Library(LIBRARY)
        self.assertEqual(library.faults[0], "NONE")
        self.assertLessEqual({"RAMP", "CLOSED", "STOPPING", "STOPPED", "FAULT"}, set(library.states.values()))
        self.assertGreater(library.params["NOMINAL_SPEED_RPM"], library.params["MINIMUM_SPEED_RPM"])

    def test_every_usual_signal_exists(self):
        from tools.bench.simulate import SIGNALS
        self.assertLessEqual(set(SIGNALS), set(Library(LIBRARY).keys))
