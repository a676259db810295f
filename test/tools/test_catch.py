"""Flying starts and stops without a sink: what is drawn, what is measured of a run, and what makes a row fail."""

from dataclasses import replace

import numpy as np
import pytest
from support import LIBRARY, run, small_sweep, step, trace

from tools.bench import catch_sweep
from tools.bench.board import Library
from tools.bench.catch_sweep import Case
from tools.common import board_file, motor_file, paths

HURST, LINIX = "hurst_dmb0224c10002", "linix_45zwn24_40"
TABLE = catch_sweep.Table.read(paths.TABLES / "catch.toml")
STATES = {"STOPPED": 1.0, "RAMP": 4.0, "CLOSED": 5.0}


# ---- what is asked -------------------------------------------------------------------------------------------------------
def test_sixty_speeds_and_angles_are_drawn_by_the_seed_with_each_inertia_in_turn():
    draws = TABLE.draws()
    speeds, angles, factors = zip(*draws)
    assert len(draws) == 60 and draws == TABLE.draws() and draws != replace(TABLE, seed=18.0).draws()
    assert -2500 <= min(speeds) < -2000 and 3000 < max(speeds) <= 3500 and 0 <= min(angles) and max(angles) <= 360
    assert factors[:4] == (1.0, 9.0, 36.0, 1.0) and len(set(zip(speeds, angles))) == 60


def test_another_motor_gets_the_same_shares_of_its_rated_speed_and_no_limit_for_the_time_of_a_stop():
    hurst, linix = motor_file.load(HURST), motor_file.load(LINIX)
    other = TABLE.for_motor(linix, {"MINIMUM_SPEED_RPM": 200.0, "MAXIMUM_SPEED_RPM": 4000.0})
    share = linix.rated_speed_rpm / hurst.rated_speed_rpm
    assert (other.lowest_rpm, other.speed_rpm) == pytest.approx((-2500.0 * share, 1500.0 * share), rel=0.01)
    assert (other.highest_rpm, other.stop_s) == (4000.0, [0.0, 0.0, 0.0])


def test_a_motor_whose_winding_takes_longer_for_the_rotor_s_energy_gets_that_time():
    hurst = motor_file.load(HURST)
    heavy = TABLE.for_motor(replace(hurst, inertia_kgm2=20.0 * hurst.inertia_kgm2), {"MINIMUM_SPEED_RPM": 200.0, "MAXIMUM_SPEED_RPM": 5500.0})
    energy_j, most_w = 0.5 * 36.0 * hurst.inertia_kgm2 * (2500.0 * 2.0 * np.pi / 60.0) ** 2, 1.5 * hurst.rs_ohm * hurst.maximum_current_a ** 2
    assert TABLE.for_motor(hurst, {"MINIMUM_SPEED_RPM": 200.0, "MAXIMUM_SPEED_RPM": 5500.0}).settle_s == TABLE.settle_s
    assert heavy.settle_s == pytest.approx(TABLE.settle_s + 19.0 * energy_j / most_w, rel=0.02)


CATCH = catch_sweep.Catch(TABLE, motor_file.part(HURST), board_file.part("mclv"), Library(LIBRARY))


def cases(rpm=2000.0, inertia=9.0):
    """A start and a stop of the project's own motor."""
    return Case(rpm, 40.0, inertia), Case(5500.0, None, inertia, 1.66)


def test_the_rotor_turns_just_before_the_button_counts_on_a_supply_that_takes_nothing_back():
    start, stop = cases()
    turned = [(action.at_s, action.keys) for action in CATCH.job(start).actions if "state.speed_rpm" in action.keys]
    assert turned == [(pytest.approx(0.128), {"state.speed_rpm": 2000.0, "state.theta_e_deg": 40.0})]
    for item in (start, stop):
        assert CATCH.job(item).values["supply.sinks"] == 0.0
        assert CATCH.job(item).values["mech.inertia_kgm2"] == pytest.approx(9.0 * motor_file.load(HURST).inertia_kgm2)
    assert CATCH.most_a == pytest.approx(1.1 * 2.75) and (CATCH.bus_v(start), CATCH.bus_v(stop)) == (34.0, 30.0)
    assert [item.rpm for item in CATCH.cases()[60:]] == [5500.0] * 3


def test_a_rotor_heavier_than_the_header_s_turns_at_the_start_of_a_stop_and_the_bare_one_stands():
    for inertia, turned in ((1.0, []), (9.0, [(pytest.approx(0.128), {"state.speed_rpm": 1500.0})])):
        assert [(action.at_s, action.keys) for action in CATCH.job(cases(inertia=inertia)[1]).actions if "state.speed_rpm" in action.keys] == turned


# ---- what is measured ----------------------------------------------------------------------------------------------------
def test_the_moment_of_control_its_speed_and_the_angle_when_it_must_be_right():
    recorded = trace(2.0, **{"fw.state": step((0.0, 1.0), (0.55, 5.0), (0.69, 4.0)), "plant.speed_rpm": 1234.0, "fw.theta_est_deg": 50.0,
                             "plant.theta_e_deg": 46.0, "plant.i_q": 1.0, "plant.i_d": 1.0})
    found = catch_sweep.taken_over(recorded, run(recorded=recorded), 0.5, 0.2)
    assert (found["how"], found["speed_then_rpm"]) == ("CLOSED", pytest.approx(1234.0))
    assert found["control_s"] == pytest.approx(0.05, abs=1e-4)
    assert (found["angle_error_deg"], found["pull_deg"]) == pytest.approx((4.0, 45.0), abs=1e-3)
    closed = trace(2.0, **{"fw.state": 5.0, "plant.speed_rpm": 0.0, "fw.theta_est_deg": 359.0, "plant.theta_e_deg": 1.0, "plant.i_q": 1.0, "plant.i_d": 0.0})
    found = catch_sweep.taken_over(closed, run(recorded=closed), 0.5, 0.2)
    assert (found["angle_error_deg"], found["pull_deg"]) == (pytest.approx(2.0), None)
    assert catch_sweep.taken_over(trace(2.0, **{"fw.state": 1.0}), run(), 0.5, 0.2) == {}


def test_the_current_of_the_loop_before_is_no_pull_of_the_forced_angle():
    recorded = trace(2.0, **{"fw.state": step((0.0, 6.0), (0.69, 4.0)), "plant.i_q": 1.0, "plant.i_d": step((0.0, -1.0), (0.6915, 1.0))})
    assert catch_sweep.taken_over(recorded, run(recorded=recorded), 0.5, 0.2)["pull_deg"] == pytest.approx(45.0, abs=1e-3)
    slow = trace(2.0, **{"fw.state": step((0.0, 6.0), (0.69, 4.0)), "plant.i_q": 1.0, "plant.i_d": step((0.0, -1.0), (0.693, 1.0))})
    assert catch_sweep.taken_over(slow, run(recorded=slow), 0.5, 0.2)["pull_deg"] == pytest.approx(135.0, abs=1e-3)


def test_a_stop_takes_until_the_outputs_are_off_or_has_no_time():
    recorded = trace(2.0, **{"fw.state": step((0.0, 5.0), (1.3, 1.0))})
    assert catch_sweep.stopped(recorded, run(recorded=recorded), 0.5)["stop_s"] == pytest.approx(0.8, abs=1e-4)
    assert catch_sweep.stopped(trace(2.0, **{"fw.state": 5.0}), run(), 0.5) == {"stop_s": None}


ROW = {"fault": None, "current_max_a": 2.0, "bus_max_v": 29.0, "stop_s": 1.5, "control_s": 0.03, "how": "CLOSED", "speed_then_rpm": 2000.0,
       "angle_error_deg": 3.0, "pull_deg": None, "speed_error_percent": 0.1}


@pytest.mark.parametrize("stop, changes, text", [
    (False, {}, "ok"), (True, {}, "ok"), (False, {"fault": "STALL"}, "fault STALL"), (True, {"current_max_a": 3.1}, "current 3.10 A"),
    (True, {"bus_max_v": 30.1}, "bus 30.1 V"), (False, {"bus_max_v": 30.1}, "ok"), (False, {"bus_max_v": 34.1}, "bus 34.1 V"),
    (True, {"stop_s": None}, "never stopped"), (True, {"stop_s": 1.7}, "slow"), (False, {"control_s": None}, "never in control"),
    (False, {"control_s": 0.21}, "late"), (False, {"how": "ALIGN", "angle_error_deg": 90.0}, "aligned while it turned"),
    (False, {"how": "ALIGN", "speed_then_rpm": -50.0, "angle_error_deg": 90.0}, "ok"), (False, {"angle_error_deg": 10.1}, "angle"),
    (False, {"how": "RAMP", "angle_error_deg": None, "pull_deg": 61.0}, "angle"), (False, {"how": "RAMP", "angle_error_deg": None, "pull_deg": 59.0}, "ok"),
    (False, {"speed_error_percent": -1.1}, "speed")])
def test_each_way_to_fail_is_named(stop, changes, text):
    item, row = cases()[stop], ROW | changes
    assert CATCH.verdict(item, row) == text
    outcome, = CATCH.check(item, row | {"verdict": text})
    assert outcome.ok == (text == "ok") and outcome.got.startswith(text)
    assert outcome.row == ("stop from 5500 rpm, inertia x9" if stop else "start at 2000 rpm, inertia x9")


# ---- for the user --------------------------------------------------------------------------------------------------------
def test_some_starts_and_a_stop_in_full(tmp_path, monkeypatch):
    code, out, error, data, rows = small_sweep(tmp_path, monkeypatch, "catch", count="4", inertia_factors="[9]", stop_factors="[9]", stop_s="[1.66]")
    assert (code, error) == (0, ""), out
    assert data["passed"] and [row["verdict"] for row in rows] == ["ok"] * 5
    assert np.max([float(row["control_s"]) for row in rows[:4]]) < 0.1 and rows[4]["control_s"] == "" and 1.0 < float(rows[4]["stop_s"]) < 1.66
