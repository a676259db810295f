"""make response: the loops of a running motor as they are, over the tuner's model, and what it says where it cannot measure."""

import json
import os
import pty
import subprocess
import sys
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from tools.common import motor_file, paths
from tools.common.errors import UserError
from tools.live import response, response_command, response_model, step
from tuning import loops

COMMAND = [sys.executable, "-m", "tools.live.response_command"]


def run(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run([*COMMAND, *arguments], cwd=paths.ROOT, capture_output=True, text=True, check=False)


def measured(folder: Path, *arguments: str) -> tuple[subprocess.CompletedProcess, dict]:
    done = run("--out", str(folder), *arguments)
    return done, json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def test_both_loops_of_the_hurst_have_the_margins_of_the_model_and_its_steps(tmp_path):
    done, found = measured(tmp_path / "result")
    assert done.returncode == 0 and "2 of 2 expectations hold" in done.stdout
    rows = {row["loop"]: row for row in found["rows"]}
    assert abs(rows["current"]["measured_deg"] - rows["current"]["model_deg"]) < 2.0 and abs(rows["speed"]["measured_deg"] - rows["speed"]["model_deg"]) < 3.0
    assert abs(rows["current"]["measured_hz"] / rows["current"]["model_hz"] - 1.0) < 0.1 and 900.0 < rows["current"]["measured_hz"] < 1100.0
    assert abs(rows["speed"]["measured_hz"] / rows["speed"]["model_hz"] - 1.0) < 0.1 and 20.0 < rows["speed"]["measured_hz"] < 30.0
    steps = {row["step"]: row for row in found["steps"]}
    for name in ("current", "speed"):
        assert abs(steps[name]["measured"]["rise_s"] / steps[name]["model"]["rise_s"] - 1.0) < 0.25
    # the model has the quick rate from the first moment; the innovation's gate opens up to a millisecond later, in which this load takes 55 rpm
    dip, expected = (steps["load"][name]["peak"] for name in ("measured", "model"))
    assert 0.95 * expected < dip < expected + 55.0 / 1400.0 and expected > 0.05
    assert {path.name for path in (tmp_path / "result").iterdir()} == {f"{name}.{kind}" for name in ("current", "speed", "step_current", "step_speed", "step_load")
                                                                      for kind in ("png", "csv")} | {"summary.json", "summary.txt"}


def test_a_loop_that_is_not_the_models_is_marked_and_the_command_fails(tmp_path):
    header = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
    (tmp_path / "userparams.h").write_text(header.replace("#define LOAD_BANDWIDTH_HZ", "#define SPEEDCNTR_PTERM 0.2\n#define LOAD_BANDWIDTH_HZ"), encoding="utf-8")
    motor = (paths.MOTORS / "hurst_dmb0224c10002.toml").read_text(encoding="utf-8").replace("[rating]", "load_inertia = { value = 5e-6, unit = \"kg m2\", source = \"a disc\" }\n\n[rating]", 1)
    (tmp_path / "with_disc.toml").write_text(motor + '\n[plant]\n"mech.inertia_kgm2" = { factor = 1.0 }\n', encoding="utf-8")
    done, found = measured(tmp_path / "result", "--loop", "speed", "--userparams", str(tmp_path), "--load", "0.0")
    assert done.returncode == 1 and "! more than 3" in done.stdout and "0 of 1 expectations hold" in done.stdout
    assert abs(found["rows"][0]["measured_deg"] - found["rows"][0]["model_deg"]) > 3.0


@pytest.mark.parametrize(("arguments", "says"), [
    (("--loop", "sped"), "invalid choice: 'sped'"),
    (("--loop", "speed", "--speed", "20"), "instead of 20 after 20 s, response: name a speed that it reaches"),
    (("--loop", "speed", "--defines=-DSCOPE=0"), "the firmware has no sine for its loops, response: build it with SCOPE 1"),
    (("--speed", "nan"), "'nan' is no number"), (("--load", "much"), "'much' is no number"), (("--speed", "0"), "0 rpm, SPEED: name the speed"),
    (("--loop", "speed", "--load", "1e9"), "is outside 0..100 N.m, LOAD"), (("--load", "1", "--port", "/dev/none"), "only the virtual board has a brake, LOAD"),
    (("--cpu", "33f", "--port", "/dev/none"), "a board has its own processor, CPU"),
    (("--loop", "current", "--speed", "500"), "the current loop is measured at END_SPEED_RPM without load, SPEED, LOAD: leave them out"),
    (("--port", "/dev/none", "--elf", "build/host-scope-1/foc33.elf"), "cannot open the port")])
def test_what_cannot_be_measured_is_told_in_one_line(tmp_path, arguments, says):
    done = run("--out", str(tmp_path / "result"), *arguments)
    told = [line for line in done.stderr.splitlines() if line.startswith("foc33: ")]
    assert done.returncode == 2 and len(told) == 1 and says in told[0]
    assert not (tmp_path / "result").exists()


PLANT = loops.Plant(0.5, 1e-3, 1e-3, 0.01, 4, 1e-5)
IPM = {"NOPOLESPAIRS": 4.0, "MOTOR_LS_MH": 2.2, "MOTOR_SALIENCY_UH": 1100.0, "MOTOR_KPHI_V_PER_KRPM": 7.255, "MOTOR_RS_OHM": 0.8, "MOTOR_INERTIA_KGM2": 1.6e-5,
       "COUNT_SPEED_RPM": 0.25, "COUNT_CURRENT_A": 5e-4, "COUNT_VOLTAGE_V": 8e-4, "CURRENT_KP_D": 6.9, "CURRENT_KP_Q": 13.8, "CURRENT_KI": 0.25}
GAINS = loops.Gains(6.0, 6.0, 0.16, 0.0, 0.0, 0.06, 5e-5)


def test_q_axis_loop_is_what_both_axes_together_leave_of_it():
    omega_e = 2500.0
    for hz in (150.0, 600.0, 2500.0):
        there, back = loops.current_loop(np.array([hz, -hz]), PLANT, GAINS, omega_e)
        along, across = 0.5 * (there + np.conj(back)), -0.5j * (there - np.conj(back))
        opened = np.array([[along, -across], [across, along]]) # d and q
        closed = np.linalg.solve(np.eye(2) + opened, opened)[1, 1]
        assert response_model.of_q_current(np.array([hz]), PLANT, GAINS, omega_e)[0] == pytest.approx(closed / (1.0 - closed), rel=1e-9)


def test_the_bridge_s_resistance_counts_in_both_models():
    motor, params = motor_file.load("ipm_4pp_24v_2000"), IPM | {"MOTOR_RS_OHM": 0.5, "BRIDGE_RS_OHM": 0.3}
    assert [plant.rs for plant in response_model.plants(params, motor)] == pytest.approx([motor.rs_ohm + 0.3, 0.8])


@pytest.mark.parametrize(("state", "inductance"), [("CLOSED", "lq_h"), ("RAMP", "ld_h")])
def test_along_the_forced_current_lies_the_inductance_of_the_d_axis(state, inductance):
    motor = motor_file.load("ipm_4pp_24v_2000")
    bench = mock.Mock(params=IPM, period_s=5e-5)
    bench.firmware.symbols.variables, bench.firmware.get.return_value = {}, 1000
    bench.state.return_value, bench.speed_rpm.return_value = state, 500.0
    hz = 1000.0 # the winding is all inductance, and a period is short
    found = response_model.model_of("current", bench, motor)(np.array([hz]))[0]
    assert abs(found) == pytest.approx(13.8 / (2.0 * np.pi * hz * getattr(motor, inductance)), rel=0.03)


def test_a_loop_whose_gain_never_crosses_one_has_shown_no_margin():
    def measured_as(loop):
        return response_model.Result.of("speed", [response.Point(hz, complex(loop(hz)), 0.0) for hz in (1.0, 1.5, 3.0, 4.0)], loop, 1000.0).holds
    assert measured_as(lambda hz: -2j / hz) and not measured_as(lambda hz: -0.2j / hz)


def test_a_motor_that_does_not_come_to_its_speed_is_stopped():
    bench = mock.Mock(params={"NOMINAL_SPEED_RPM": 1000.0, "MINIMUM_SPEED_RPM": 100.0})
    bench.start.side_effect = UserError("no speed", "response", "another one")
    with pytest.raises(UserError, match="no speed"):
        response_command.measured(response_command.Place(bench, None, None, "", ""), "speed", mock.Mock(speed=None))
    bench.stop.assert_called_once_with()


def test_a_silent_port_is_told(tmp_path):
    ours, theirs = pty.openpty()
    try:
        done = run("--port", os.ttyname(theirs), "--elf", str(paths.ROOT / "build/host-scope-1/foc33.elf"))
    finally:
        os.close(ours)
        os.close(theirs)
    assert done.returncode == 2 and "is its firmware built with SCOPE 1?" in done.stderr and "Traceback" not in done.stderr


def test_a_wave_is_found_under_a_mean_and_a_drift_and_is_not_another_ones():
    angle = (np.arange(96) * 65536 // 24) % 65536
    turn = 2.0 * np.pi * angle / 65536.0
    values = 3.0 * np.sin(turn) - 4.0 * np.cos(turn) + 100.0 + np.linspace(0.0, 50.0, 96)
    assert abs(response.wave(values, angle) - complex(3.0, -4.0)) < 1e-9
    assert abs(response.wave(np.sin(2.0 * turn), angle)) < 0.02


def test_turns_that_wrap_between_rows_are_counted():
    true = np.cumsum(np.full(50, 2.37) + 0.1 * np.sin(np.arange(50)))
    left = response.unwrapped(true % 1.0, 2.37)
    assert np.abs(np.diff(left) - np.diff(true) + 2.37).max() < 1e-9


def test_figures_of_a_first_order_answer():
    time_s = np.linspace(-0.1, 1.0, 1101)
    found = step.figures("speed", time_s, np.where(time_s < 0.0, 0.0, 1.0 - np.exp(-np.maximum(time_s, 0.0) / 0.1)))
    assert found.rise_s == pytest.approx(0.1 * np.log(9.0), rel=0.02) and found.peak < 0.0 and found.settled_s == pytest.approx(0.23, abs=0.005)


def test_figures_of_an_overshoot_and_of_a_load_that_is_not_made_good():
    time_s = np.linspace(0.0, 1.0, 1001)
    found = step.figures("current", time_s, 1.0 - np.exp(-20.0 * time_s) * (np.cos(40.0 * time_s) + 0.5 * np.sin(40.0 * time_s)))
    assert found.peak == pytest.approx(np.exp(-0.5 * np.pi), rel=0.01)
    lost = step.figures("load", time_s, np.full(1001, -0.2))
    assert lost.rise_s is None and lost.peak == pytest.approx(0.2) and lost.settled_s is None


def test_answer_of_a_delay_is_a_step_after_it():
    k = np.arange(65)
    answer = step.answer_of(np.exp(-2j * np.pi * k * 5 / 128))
    assert abs(answer[3]) < 0.1 and abs(answer[7] - 1.0) < 0.1
