"""The field-weakening tuner on the virtual board: a short search, a motor that saturates, one that does not start, Ctrl-C."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from pytest import approx
from tune_support import HURST, command

from tools.common import paths
from tuning import fw_tables


@pytest.fixture
def path(tmp_path):
    return tmp_path / "tables.toml"


@pytest.fixture
def places(path):
    return ("--tables", str(path), "--out", str(path.parent / "out"))


def test_two_entries_of_the_hurst(path, places):
    code, out, error = command("tune-fw", HURST, "--entries", "3", *places)
    assert code == 1 and "maximum speed 5500 rpm is not reached" in error # two entries end at 3000 rpm
    found = fw_tables.load(path)
    assert found.start_speed_rpm == approx(2650.0, abs=60.0)
    assert [entry.idref_a for entry in found.entries[1:3]] == approx([-0.27, -0.53], abs=0.06)
    for row in found.rows[1:]:
        assert 95.5 < row["use_percent"] <= 97.2 and abs(row["angle_deg"]) < 3.0 and row["torque_nm"] > row["load_nm"]
    assert re.search(r"simulated \d+ s of motor time", out)
    assert {file.name for file in (path.parent / "out").iterdir()} == {"summary.json", "entries.csv", "figure8.png", "over_speed.png"}
    text = path.read_text(encoding="utf-8")
    command("tune-fw", HURST, "--entries", "3", "--no-plots", *places)
    assert path.read_text(encoding="utf-8") == text


def test_a_motor_that_saturates_keeps_its_angle(path, places):
    """The adaptation takes back what a falling L does to the angle, so the search has no Ls to change."""
    changes = ("motor.sat_ld_ratio=0.35", "motor.sat_lq_ratio=0.35", "motor.sat_current_a=1.5")
    options = [word for change in changes for word in ("--set", change)]
    assert command("tune-fw", HURST, "--entries", "6", "--no-plots", "--torque-share", "0.1", *places, *options)[0] == 1
    found = fw_tables.load(path)
    assert found.entries[found.last_index].idref_a < -1.5
    assert all(abs(row["angle_free_deg"]) <= 2.5 for row in found.rows[1:])


@pytest.mark.parametrize("options, told", [
    (("--set", "load.locked=1"), r"hurst_\w+: the motor does not start \(\w+ in state FAULT.*Q_CURRENT_REF_OPENLOOP"),
    (("--torque-share", "2"), "torque-share = 2 is impossible"), (("--torque-share", "nan"), "impossible"),
    (("--entries", "1"), "entries = 1 is impossible"), (("--set", "motor.nothing=1"), "motor.nothing"),
    (("--set", "motor.rs_ohm"), "is no change")])
def test_a_motor_that_does_not_start_and_impossible_options_are_one_line(path, places, options, told):
    code, out, error = command("tune-fw", HURST, *places, *options)
    assert (code, out, error.count("\n")) == (2, "", 1) and re.match(f"foc33: .*{told}", error), error
    assert list(path.parent.iterdir()) == []


def test_ctrl_c_leaves_nothing(path, places):
    """Also where the caller ignores SIGINT, as a shell does for its background jobs."""
    path.write_text("old", encoding="utf-8")
    process = subprocess.Popen([sys.executable, "-m", "tuning", "tune-fw", HURST, *places], cwd=paths.ROOT, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True, start_new_session=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    time.sleep(3.0)
    os.killpg(process.pid, signal.SIGINT)
    out, error = process.communicate(timeout=20)
    assert (process.returncode, out, error) == (130, "", "foc33: interrupted, nothing was written\n")
    assert [(file.name, file.read_text(encoding="utf-8")) for file in path.parent.iterdir()] == [(path.name, "old")]
