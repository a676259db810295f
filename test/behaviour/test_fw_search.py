"""The field-weakening tuner on the virtual board: a short search, a motor that saturates, one that does not start, Ctrl-C."""

import contextlib
import io
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from tools.common import paths
from tuning import cli, fw_tables

HURST = "hurst_dmb0224c10002"


def tune(*arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of `tune-fw`."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = cli.main(["tune-fw", HURST, "--userparams", str(paths.ROOT), *arguments])
    return code, out.getvalue(), error.getvalue()


class OnTheBoard(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory()))
        self.path = self.folder / "tables.toml"
        self.places = ["--tables", str(self.path), "--out", str(self.folder / "out")]

    def test_two_entries_of_the_hurst(self):
        code, out, error = tune("--entries", "3", *self.places)
        self.assertIn("maximum speed 5500 rpm is not reached", error) # two entries end at 3000 rpm
        self.assertEqual(code, 1)
        found = fw_tables.load(self.path)
        self.assertAlmostEqual(found.start_speed_rpm, 2650.0, delta=60.0)
        self.assertAlmostEqual(found.entries[1].idref_a, -0.27, delta=0.06)
        self.assertAlmostEqual(found.entries[2].idref_a, -0.53, delta=0.06)
        for row in found.rows[1:]:
            self.assertLessEqual(row["use_percent"], 97.2)
            self.assertGreater(row["use_percent"], 95.5)
            self.assertLess(abs(row["angle_deg"]), 3.0)
            self.assertGreater(row["torque_nm"], row["load_nm"])
        self.assertRegex(out, r"simulated \d+ s of motor time")
        self.assertEqual({file.name for file in (self.folder / "out").iterdir()}, {"summary.json", "entries.csv", "figure8.png", "over_speed.png"})
        again = self.folder / "again.toml"
        tune("--entries", "3", "--no-plots", "--tables", str(again), "--out", str(self.folder / "out2"))
        self.assertEqual(again.read_text(encoding="utf-8"), self.path.read_text(encoding="utf-8"))

    def test_a_motor_that_saturates_gets_another_ls(self):
        code, _, _ = tune("--entries", "6", "--no-plots", "--torque-share", "0.1", *self.places, "--set", "motor.sat_ld_ratio=0.35",
                          "--set", "motor.sat_lq_ratio=0.35", "--set", "motor.sat_current_a=1.5")
        self.assertEqual(code, 1)
        found = fw_tables.load(self.path)
        entry = found.entries[found.last_index]
        self.assertLess(entry.ls_ratio, 0.47)
        true = 0.5 * (1.0 - 0.35 * min(1.0, (entry.idref_a / 1.5) ** 2))
        self.assertAlmostEqual(entry.ls_ratio, true, delta=0.06)
        for row in found.rows[1:]:
            self.assertLessEqual(abs(row["angle_free_deg"]), 3.3)

    def test_a_motor_that_does_not_start_is_one_line(self):
        code, out, error = tune("--set", "load.locked=1", *self.places)
        self.assertEqual((code, out), (2, ""))
        self.assertRegex(error, r"^foc33: hurst_\w+: the motor does not start \(\w+ in state FAULT.*Q_CURRENT_REF_OPENLOOP.*\n$")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_impossible_options_are_one_line(self):
        for wrong in (("--torque-share", "2"), ("--torque-share", "nan"), ("--entries", "1"), ("--set", "motor.nothing=1"), ("--set", "motor.rs_ohm"), ("--userparams", "/nowhere")):
            code, out, error = tune(*self.places, *wrong)
            self.assertEqual((code, out, error.count("\n")), (2, "", 1), wrong)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_ctrl_c_leaves_nothing(self):
        """Also where the caller ignores SIGINT, as a shell does for its background jobs."""
        self.path.write_text("old", encoding="utf-8")
        command = [sys.executable, "-m", "tuning", "tune-fw", HURST, "--userparams", str(paths.ROOT), *self.places]
        process = subprocess.Popen(command, cwd=paths.ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
                                   preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
        time.sleep(3.0)
        os.killpg(process.pid, signal.SIGINT)
        out, error = process.communicate(timeout=20)
        self.assertEqual((process.returncode, out), (130, ""), error)
        self.assertEqual(error, "foc33: interrupted, nothing was written\n")
        self.assertEqual([file.name for file in self.folder.iterdir()], [self.path.name])
        self.assertEqual(self.path.read_text(encoding="utf-8"), "old")
