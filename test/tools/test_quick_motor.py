"""A motor beyond 32000 electrical rpm: a spindle with 7 pole pairs starts, turns at 10 000 rpm (1167 Hz) with and without load, and stops."""

import json

import pytest
import tune_support
from support import command

from tools.common import motor_file

SPINDLE = "spindle_7pp_24v_10000"
RATED_RPM = 10000.0
SCENARIO = f"""
title = "a quick motor up to its rated speed"
motor = "{SPINDLE}"
board = "mclv"
duration_s = 10.5

[[event]]
at_s = 0.1
start_rpm = 2000

[[event]]
at_s = 2.2
speed_rpm = {RATED_RPM:.0f}

[[event]]
at_s = 5.2
torque_percent = 100
over_s = 0.3

[[event]]
at_s = 6.6
torque_percent = 0
over_s = 0.3

[[event]]
at_s = 7.2
press = "S2"

[[measure]]
name = "no load"
from_s = 4.7
to_s = 5.2
reference_rpm = {RATED_RPM:.0f}

[[measure]]
name = "rated torque"
from_s = 6.1
to_s = 6.6
reference_rpm = {RATED_RPM:.0f}

[[expect]]
kind = "hand_over"
overshoot_percent = 10
no_reverse_motion = true

[[expect]]
kind = "speed"

[[expect]]
kind = "stop"
after_s = 7.2
within_s = 3.0

[[expect]]
kind = "clean"
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The finished run's folder; what it printed is shown where something fails."""
    folder = tmp_path_factory.mktemp("quick")
    (folder / "quick.toml").write_text(SCENARIO, encoding="utf-8")
    code, out, error = tune_support.command("tune", SPINDLE, "--out", str(folder / "tune"), "--brief")
    assert code == 0, out + error
    code, out, error = command("run", str(folder / "quick.toml"), "--motor", SPINDLE, "--userparams", str(folder / "tune"), "--out", str(folder / "out"), "--no-plots", "--quiet")
    assert code == 0, out + error
    return folder / "out"


def test_it_turns_at_1167_Hz_with_its_angle_within_5_degrees_rms(run):
    motor = motor_file.load(SPINDLE)
    assert motor.pole_pairs * RATED_RPM == 70000.0
    rows = {row["name"]: row for row in json.loads((run / "summary.json").read_text(encoding="utf-8"))["measures"]}
    for row in rows.values():
        assert row["speed_rpm"] == pytest.approx(RATED_RPM, rel=0.002), row
        assert row["angle_error_rms_deg"] < 5.0, row
        assert row["inv_kphi_rpm_per_v"] == pytest.approx(1000.0 / motor.kphi_v_per_krpm, rel=0.04), row # 1/Kphi is counted in the unit of speed
    assert rows["rated torque"]["torque_nm"] == pytest.approx(motor.rated_torque_nm, rel=0.2)
