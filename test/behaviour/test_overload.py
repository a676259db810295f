"""I2t on the virtual board: more than the winding's current trips when the heat of what flowed says so, and less never."""

import re

import numpy as np
import pytest

from tools.bench import command_common, simulate
from tools.bench.scenario import BRAKE, Event, Scenario
from tools.common import board_file, motor_file, paths

HURST = "hurst_dmb0224c10002"
RATED_A, TIME_S = 1.0, 4.0
LOOKS_EVERY_S = 0.512


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The board with a header that has I2t."""
    text = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
    for name, value in (("I2T_CURRENT_A", RATED_A), ("I2T_TIME_SEC", TIME_S)):
        text, found = re.subn(rf"(?m)^(#define {name} +)\S+", rf"\g<1>{value}", text)
        assert found == 1
    folder = tmp_path_factory.mktemp("header")
    (folder / "userparams.h").write_text(text, encoding="utf-8")
    return command_common.library_for([], None, folder)


def run(library, brake_nm: float, seconds: float):
    """1500 rpm with a brake from three seconds on."""
    events = [Event(0.0, "speed_rpm", "test", value=1500.0), Event(0.1, "press", "test", button="S2", hold_s=0.1),
              Event(3.0, "set", "test", keys={BRAKE: brake_nm}, over_s=0.2)]
    scenario = Scenario("overload", "", "", "", "", seconds, events=events)
    return simulate.simulate(simulate.prepare(scenario, library, motor_file.part(HURST), board_file.part("mclv")), lambda s: None)


def heat_a2(trace) -> np.ndarray:
    """What the law makes of the current that flowed in the motor."""
    i2 = trace.column("plant.i_d").astype(float) ** 2 + trace.column("plant.i_q").astype(float) ** 2
    steps, heat = np.diff(trace.time_s.astype(float), prepend=0.0), np.zeros(len(i2))
    for n in range(1, len(i2)):
        heat[n] = heat[n - 1] + steps[n] / TIME_S * (i2[n] - heat[n - 1])
    return heat


def test_overload_trips_when_the_heat_of_the_current_that_flowed_is_the_rated_one_s(library):
    trace = run(library, 0.08, 9.0).trace
    fault = trace.column("fw.fault")
    trip = np.argmax(fault != 0)
    assert fault[trip] == 19 and 3.5 < trace.time_s[trip] < 8.0
    heat, look = heat_a2(trace), np.argmax(trace.time_s >= trace.time_s[trip] - LOOKS_EVERY_S)
    assert heat[trip] > 0.98 * RATED_A ** 2 and heat[look] < 1.02 * RATED_A ** 2, "the drive looks every half second"
    assert np.hypot(trace.column("plant.i_d"), trace.column("plant.i_q"))[-1] == 0.0


def test_a_load_that_the_winding_stands_never_trips(library):
    result = run(library, 0.045, 25.0)
    assert result.trace.column("fw.fault").max() == 0
    assert 0.5 < heat_a2(result.trace)[-1] < RATED_A ** 2
