"""What is read from a trace: measures, hand-over, changes; checked on signals whose values are known."""

import numpy as np
import pytest
from support import PERIOD_S, run, step, trace

from tools.bench.metrics import MEASURE_VALUES, Measure, limited_percent, measure_values
from tools.common.trace import wrapped_deg

ROW = Measure("row", 0.5, 1.5, 1000.0)
S2 = "[[event]]\nat_s = 0.1\npress = \"S2\"\n"


def values(**signals):
    return measure_values(trace(**{"pwm__outputs_seen": 63} | signals).part(ROW.from_s, ROW.to_s), ROW)


def test_every_value_is_described_and_none_is_known_of_an_empty_window():
    assert set(values()) == set(MEASURE_VALUES)
    assert set(measure_values(trace(0.1).part(1.0, 1.5), ROW).values()) == {None}


@pytest.mark.parametrize("signals, expected, within", [
    ({"plant__speed_rpm": step((0, 5), (0.5, 990), (1.0, 1000), (1.5, 7))}, # only the window counts
     {"speed_rpm": 995, "speed_error_percent": -0.5, "speed_min_rpm": 990, "speed_max_rpm": 1000}, 0.01),
    ({"plant__i_d": -3, "plant__i_q": 4}, {"current_rms_a": 5 / 2 ** 0.5}, 1e-5), # the RMS of the vector
    ({"fw__theta_est_deg": 1.0, "plant__theta_e_deg": 359.0}, # across the turn
     {"angle_error_mean_deg": 2.0, "angle_error_rms_deg": 2.0}, 1e-3),
    ({"fw__theta_est_deg": lambda t: np.where(np.arange(len(t)) % 2, 10.0, 350.0)}, # the RMS includes what the mean hides
     {"angle_error_mean_deg": 0.0, "angle_error_rms_deg": 10.0}, 1e-3),
    ({"fw__v_d_v": -3, "fw__v_q_v": 4, "fw__v_limit_v": step((0, 10), (1.0, 5))},
     {"voltage_v": 5.0, "voltage_percent": 75.0}, 0.1),
    ({"fw__inv_kphi_rpm_per_v": step((0, 140), (1.0, 130))}, {"inv_kphi_rpm_per_v": 135.0}, 0.1),
    ({"fw__speed_est_rpm": 1000, "pwm__outputs_seen": 0}, # a bridge that is off has no estimate
     {"estimated_rpm": None, "angle_error_rms_deg": None, "voltage_v": None, "speed_rpm": 0.0}, 0.0)])
def test_measures(signals, expected, within):
    found = values(**signals)
    for name, value in expected.items():
        assert found[name] == (None if value is None else pytest.approx(value, abs=within)), name


def test_each_reason_for_a_limit_counts_for_its_share_of_the_time_with_the_bridge_on():
    part = trace(fw__limits=step((0, 3), (0.5, 8), (1.0, 1), (1.5, 0)), pwm__outputs_seen=step((0, 63), (1.0, 0), (1.5, 63)))
    assert limited_percent(part) == pytest.approx({"VOLTAGE": 100 / 3, "CURRENT": 100 / 3, "RAMP": 100 / 3}, abs=0.1)
    assert limited_percent(trace(fw__limits=3)) == {} # the bridge was never on
    assert limited_percent(trace(0.1).part(1.0, 1.5)) == {}


@pytest.mark.parametrize("step_rpm, reference, percent", [(0.0, 1004.0, 1.0), (5.0, 1004.0, 0.598), (5.0, 1006.0, 1.0), (5.0, 996.0, 1.406)])
def test_the_potentiometers_step_is_no_error_of_the_speed_and_a_reference_further_off_is_one(step_rpm, reference, percent):
    found = measure_values(trace(plant__speed_rpm=1010, fw__speed_ref_rpm=reference), Measure("row", 0.0, 2.0, 1000.0, step_rpm=step_rpm))
    assert found["speed_error_percent"] == pytest.approx(percent, abs=1e-3)


def test_backward_speed_that_is_too_fast_is_a_positive_error():
    found = measure_values(trace(plant__speed_rpm=-1010), Measure("row", 0.0, 2.0, -1000.0))
    assert found["speed_error_percent"] == pytest.approx(1.0)


@pytest.mark.parametrize("params, percent", [({}, None), ({"MAXIMUM_CURRENT_A": 2.0}, pytest.approx(50.0, abs=1e-3))])
def test_current_is_compared_with_the_header_s_maximum_by_its_amplitude(params, percent):
    item = run("[[measure]]\nname = \"row\"\nfrom_s = 0.5\nto_s = 1.0\n", plant__i_d=-0.6, plant__i_q=0.8)
    item.params = params
    assert item.measures["row"]["current_of_maximum_percent"] == percent


def test_hand_over_is_timed_from_the_last_s2_before_it():
    found = run(S2 + S2.replace("0.1", "0.5"), fw__state=step((0, 1), (0.6, 4), (0.8, 5)), fw__speed_ref_rpm=1000).hand_overs()
    assert [item.after_s2_s for item in found] == [pytest.approx(0.3, abs=2 * PERIOD_S)]


def test_a_hand_over_that_needed_no_s2_says_no_time_after_it():
    signals = {"fw__state": step((0, 4), (0.8, 5)), "fw__speed_ref_rpm": 1000, "plant__speed_rpm": 1000}
    (remote,), (pressed,) = (run(text, **signals).hand_overs() for text in ("", S2))
    assert (remote.after_s2_s, remote.text, pressed.text) == (None, "closed loop", "closed loop 0.70 s after S2")
    lines = [line for _, line in run("", **signals).protocol()]
    assert "closed loop, overshoot 0.0 %" in lines and not any("nan" in line for line in lines)


def ramp(time_s: np.ndarray) -> np.ndarray:
    return 1000 + 500 * np.maximum(time_s - 0.8, 0)


@pytest.mark.parametrize("state, reference, speed", [
    (step((0, 4), (0.8, 5)), ramp, ramp), # it follows a ramped reference
    (step((0, 4), (0.8, 5), (1.0, 7)), 1000, step((0, 1000), (1.1, 1500)))]) # and ends with closed loop
def test_there_is_no_overshoot(state, reference, speed):
    item = run(S2, fw__state=state, fw__speed_ref_rpm=reference, plant__speed_rpm=speed)
    assert item.hand_overs()[0].overshoot_percent == pytest.approx(0.0, abs=1e-3)


def test_fault_and_state_changes_carry_names_and_an_unknown_code_its_number_and_speed_factor_is_motor_time_per_wall_time():
    item = run(fw__state=step((0, 1), (1.0, 7)), fw__fault=step((0, 0), (1.0, 3), (1.5, 99)))
    assert [name for _, _, name in item.state_changes()] == ["STOPPED", "FAULT"]
    assert [name for _, _, name in item.fault_changes()] == ["NONE", "OVERVOLTAGE", "code 99"]
    assert run().speed_factor == pytest.approx(20.0)


def test_a_part_includes_its_start_and_not_its_end_and_thinning_keeps_every_nth_row():
    part = trace(1.0).part(0.1, 0.2)
    assert (len(part), float(part.time_s[0])) == (2000, pytest.approx(0.1))
    assert list(trace(1.0, fw__i_q_a=lambda t: np.arange(len(t))).thinned(10).column("fw.i_q_a")[:3]) == [0, 10, 20]


def test_angles_wrap_to_half_a_turn():
    assert np.allclose(wrapped_deg(np.array([350.0, -350.0, 90.0, 720.0])), [-10.0, 10.0, 90.0, 0.0])
