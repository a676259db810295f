"""The command line: results complete or not at all, one line and exit code 2 for every mistake."""

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from tools.bench import rating_sweep
from tools.common import paths
from tune_support import FOR_ANOTHER_BOARD, HURST, command, motor_path


class Result(unittest.TestCase):
    """The whole result of one motor, plots included."""

    @classmethod
    def setUpClass(cls) -> None:
        folder = cls.enterClassContext(tempfile.TemporaryDirectory())
        cls.folder = Path(folder) / "result"
        cls.code, cls.out, cls.error = command("tune", HURST, "--out", str(cls.folder))
        cls.page = (cls.folder / "report.html").read_text(encoding="utf-8")

    def test_a_motor_becomes_a_header_a_page_and_numbers(self):
        self.assertEqual((self.code, self.error), (0, ""))
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), ["report.html", "summary.json", "tuning.json", "userparams.h"])
        self.assertIn("phase margin", self.out)
        self.assertIn("NORM_RS 14470", self.out)
        numbers = json.loads((self.folder / "tuning.json").read_text(encoding="utf-8"))
        self.assertEqual(numbers["params"]["MOTOR_RS_OHM"], "2.67")
        self.assertGreaterEqual(numbers["loops"]["speed"]["worst"]["phase_deg"], 60.0)

    def test_the_page_needs_nothing_else_and_shows_everything(self):
        self.assertEqual(self.page.count("<svg"), 5)
        for words in ("src=", "href=\"http", "<script"):
            self.assertNotIn(words, self.page)
        for words in ("Current loop", "Speed loop", "Start", "Parameters", "Constants", "Inputs", "NORM_RS", "AN1292"):
            self.assertIn(words, self.page)
        for cell in ("7.24 V peak line-to-line/krpm", "2.67 ohm", "2800 rpm", "24 V"):
            self.assertIn(f'<td class="n">{cell}</td>', self.page)

    def test_kphi_is_told_in_the_forms_that_sheets_give(self):
        for words in ("= 0.06914 V s/rad line-to-line =", "= 0.05987 N m/A peak = 0.08468 N m/A rms ="):
            self.assertIn(words, self.out)
            self.assertIn(words, self.page)

    def test_the_result_of_the_same_input_is_the_same(self):
        before = {path.name: path.read_bytes() for path in self.folder.iterdir()}
        command("tune", HURST, "--out", str(self.folder))
        self.assertEqual({path.name: path.read_bytes() for path in self.folder.iterdir()}, before)


class Tune(unittest.TestCase):
    def setUp(self) -> None:
        self.out = Path(self.enterContext(tempfile.TemporaryDirectory())) / "result"
        self.enterContext(mock.patch("tuning.plots.draw", lambda design: dict.fromkeys(("current_loop", "speed_loop", "start", "torque", "current"), "")))

    def refused(self, *arguments: str, says: str) -> None:
        code, out, error = command(*arguments)
        self.assertEqual((code, out, error.count("\n")), (2, "", 1), error)
        self.assertTrue(error.startswith("foc33: "), error)
        self.assertIn(says, error)

    def test_a_motor_by_its_name_or_path_and_the_command_that_makes_the_result_again(self):
        with motor_path() as path:
            for motor in (HURST, str(path)):
                code, _, error = command("tune", motor, "--out", str(self.out))
                self.assertEqual((code, error), (0, ""))
                for name in ("report.html", "userparams.h"):
                    self.assertIn(f"make tune MOTOR={motor}", (self.out / name).read_text(encoding="utf-8"), name)

    def test_an_unchanged_header_keeps_its_time(self):
        command("tune", HURST, "--out", str(self.out), "--brief")
        os.utime(self.out / "userparams.h", (1e9, 1e9))
        command("tune", HURST, "--out", str(self.out), "--brief")
        self.assertEqual((self.out / "userparams.h").stat().st_mtime, 1e9)
        (self.out / "userparams.h").write_text("old", encoding="utf-8")
        command("tune", HURST, "--out", str(self.out), "--brief")
        self.assertGreater((self.out / "userparams.h").stat().st_mtime, 1.5e9)

    def test_brief_is_a_line_and_the_warnings(self):
        _, out, _ = command("tune", "anaheim_bly172s_24v_4000", "--out", str(self.out), "--brief")
        lines = out.splitlines()
        self.assertTrue(lines[0].startswith("anaheim_bly172s_24v_4000: "))
        self.assertTrue(all(line.startswith("  warning: ") for line in lines[1:]))

    def test_a_refusal_writes_nothing_and_keeps_an_older_result(self):
        with motor_path(("value = 2500", "value = 4000")) as path:
            self.refused("tune", str(path), "--out", str(self.out), says="are too low for 4000 rpm")
            self.assertFalse(self.out.exists())
        command("tune", HURST, "--out", str(self.out), "--brief")
        before = sorted(self.out.iterdir())
        with motor_path(("value = 2500", "value = 4000")) as path:
            self.refused("tune", str(path), "--out", str(self.out), says="are too low for 4000 rpm")
        self.assertEqual(sorted(self.out.iterdir()), before)
        self.assertEqual(len(list(self.out.parent.iterdir())), 1)

    def test_a_folder_that_is_something_else_is_not_replaced(self):
        self.out.mkdir()
        (self.out / "precious").write_text("mine", encoding="utf-8")
        self.refused("tune", HURST, "--out", str(self.out), says="is not a result folder")
        self.assertTrue((self.out / "precious").is_file())

    def test_mistakes_on_the_command_line(self):
        for arguments, says in ((("tune", "hurst"), "no motor 'hurst'"), (("tune", "nowhere/motor.toml"), "no motor file"), (("tune", HURST, "--board", "mclw"), "mclv"),
                                (("tune",), "name one, or write --all"), (("tune", HURST, "--all"), "either a motor or --all"),
                                (("tune", "--all", "--out", str(self.out)), "one folder for several motors"), (("tun",), "command line"),
                                (("tune", "--all", "--board", "mclw"), "mclv"), (("motors", "--board", "mclw"), "mclv")):
            self.refused(*arguments, says=says)

    def test_one_motor_that_is_for_another_board_does_not_stop_the_others(self):
        with self.several_motors():
            for arguments in (("tune", "--all", "--brief"), ("tune", "--all")):
                code, out, error = command(*arguments)
                self.assertEqual((code, error.count("\n")), (2, 1), error)
                self.assertRegex(error, r"\Afoc33: half the rated torque needs .*b_large\.toml")
                for name in ("a_first", "c_last"):
                    self.assertIn(name, out)
                    self.assertTrue((paths.TUNED / name / "userparams.h").is_file(), name)
            self.assertFalse((paths.TUNED / "b_large").exists())

    def test_make_motors_runs_those_that_got_a_header(self):
        for result, expected in ((0, 2), (1, 2)):
            with self.several_motors(), mock.patch.object(rating_sweep, "command", return_value=result) as runs:
                code, _, error = command("motors", "--out", str(self.out), "--quiet")
            (options,) = runs.call_args.args
            self.assertEqual((code, options.motor, options.out, options.board, error.count("\n")), (expected, ["a_first", "c_last"], self.out, "mclv", 1))
        with self.several_motors() as folder, mock.patch.object(rating_sweep, "command", return_value=1):
            (folder / "b_large.toml").unlink()
            self.assertEqual(command("motors", "--out", str(self.out))[0], 1)

    def test_without_any_motor_that_fits_nothing_runs(self):
        with self.several_motors() as folder, mock.patch.object(rating_sweep, "command") as runs:
            for name in ("a_first", "c_last"):
                (folder / f"{name}.toml").unlink()
            self.refused("motors", says="half the rated torque needs")
        runs.assert_not_called()

    @contextlib.contextmanager
    def several_motors(self):
        """A folder of three motors; the one in the middle is for another board."""
        with tempfile.TemporaryDirectory() as root, motor_path() as good, motor_path(*FOR_ANOTHER_BOARD) as large:
            folder = Path(root) / "motors"
            folder.mkdir()
            for name, source in (("a_first", good), ("b_large", large), ("c_last", good)):
                shutil.copy(source, folder / f"{name}.toml")
            with mock.patch.object(paths, "MOTORS", folder), mock.patch.object(paths, "TUNED", Path(root) / "tune"):
                yield folder

    def test_the_header_alone(self):
        code, out, _ = command("header", HURST)
        self.assertEqual(code, 0)
        self.assertTrue(out.startswith("/* Everything a user edits"))
        self.assertTrue(out.endswith("#endif\n"))

    def test_make_help_names_the_motor_that_is_taken_without_motor(self):
        makefile = (paths.ROOT / "Makefile").read_text(encoding="utf-8")
        default = re.search(r"tune_motor = .*\$\(or \$\(MOTOR\),(\w+)\)", makefile)[1]
        text = subprocess.run(["make", "help"], cwd=paths.ROOT, capture_output=True, text=True, check=True).stdout
        self.assertRegex(text, rf"make tune +.*\[MOTOR={default}\b")
        for name in ("tune-fw", "identify", "userparams"):
            self.assertRegex(text, rf"make {name} +.*\[MOTOR=")

    def test_as_a_program(self):
        done = subprocess.run([sys.executable, "-m", "tuning", "tune", "no_such_motor"], cwd=paths.ROOT, capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("foc33: no motor 'no_such_motor'", done.stderr)
