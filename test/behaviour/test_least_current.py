"""A salient motor takes the least current that its torque needs, below and in field weakening, and its angle stays right."""

import numpy as np
import pytest

from tools.bench import build, command_common, reach, simulate
from tools.bench.scenario import BRAKE, Event, Scenario
from tools.common import board_file, motor_file
from tools.common.trace import wrapped_deg
from tuning import design, header, limits

SALIENT = "ipm_4pp_24v_2000"
MEASURE_S = 0.5
ROWS = {"half torque at 20 % of rated speed": (400.0, 0.5), "rated torque at 20 % of rated speed": (400.0, 1.0), "rated torque at 50 %": (1000.0, 1.0),
        "rated torque at rated speed": (2000.0, 1.0), "rated torque in field weakening": (2400.0, 1.0), "half torque in field weakening": (2800.0, 0.5)}
"""Speed in rpm, share of the rated torque; one after the other."""
START_S, STEP_S = 2.6, 2.5


@pytest.fixture(scope="module")
def motor() -> motor_file.Motor:
    return motor_file.load(SALIENT)


@pytest.fixture(scope="module")
def library(motor, tmp_path_factory):
    folder = tmp_path_factory.mktemp("header")
    (folder / build.HEADER).write_text(header.write(design.design(motor, board_file.load("mclv"))), encoding="utf-8")
    return command_common.library_for([], None, folder)


@pytest.fixture(scope="module")
def parts(motor, library):
    """The end of each row: the trace there."""
    events = [Event(0.0, "speed_rpm", "test", value=1000.0), Event(0.1, "press", "test", button="S2", hold_s=0.1)]
    for n, (rpm, share) in enumerate(ROWS.values()):
        at_s = START_S + n * STEP_S
        events += [Event(at_s, "speed_rpm", "test", value=rpm, finds_range=True),
                   Event(at_s + 0.5, "set", "test", keys={BRAKE: share * motor.rated_torque_nm}, over_s=0.3)]
    scenario = Scenario("least current", "", "", "", "", START_S + len(ROWS) * STEP_S, events=events)
    result = simulate.simulate(simulate.prepare(scenario, library, motor_file.part(SALIENT), board_file.part("mclv")), lambda s: None)
    assert result.trace.column("fw.fault").max() == 0
    ends = [START_S + (n + 1) * STEP_S for n in range(len(ROWS))]
    return {name: result.trace.part(end_s - MEASURE_S, end_s) for name, end_s in zip(ROWS, ends)}


@pytest.mark.parametrize("name", ROWS)
def test_current_is_within_1_percent_of_the_least_for_the_torque(name, motor, parts):
    part, (rpm, share) = parts[name], ROWS[name]
    speed, i_d, i_q, torque = (part.column(f"plant.{key}").astype(float).mean() for key in ("speed_rpm", "i_d", "i_q", "torque_nm"))
    limit_v = part.column("fw.v_limit_v").astype(float).mean() * (1.0 if share == 1.0 else limits.FULL_SHARE) # control keeps the rest
    assert speed == pytest.approx(rpm, rel=0.005)
    least = reach.least_current(motor.plant_values().values, speed, torque, limit_v)
    assert np.hypot(i_d, i_q) / least.current_a < 1.01, (i_d, i_q, least)
    if rpm <= motor.rated_speed_rpm and share == 1.0:
        without_a = torque / motor.kt_nm_per_a # without d current the same torque takes 3 % more
        assert without_a - np.hypot(i_d, i_q) > 0.95 * (without_a - least.current_a) > 0.025 * without_a


@pytest.mark.parametrize("name", ROWS)
def test_angle_is_within_5_degrees_rms(name, parts):
    error = wrapped_deg(parts[name].column("fw.theta_est_deg").astype(float) - parts[name].column("plant.theta_e_deg").astype(float))
    assert np.sqrt(np.mean(error * error)) < 5.0
