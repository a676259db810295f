"""The soak: what is drawn stays within what a motor can do, and what counts as a trip, a drift and a lost lock."""

import numpy as np
import pytest
from support import FAULTS, LIBRARY, STATES, command, refused, trace

from tools.bench import soak, trial
from tools.bench.board import Library
from tools.bench.run import Run
from tools.common import board_file, motor_file

HURST = "hurst_dmb0224c10002"


@pytest.fixture(name="benches", scope="module")
def _benches():
    """The one-way firmware stands for both modes: the draw alone is looked at."""
    bench = trial.Bench(motor_file.part(HURST), board_file.part("mclv"), Library(LIBRARY), [])
    return {(HURST, ""): bench, (HURST, soak.BIDIRECTIONAL): bench}


def test_a_number_always_draws_the_same_segment_and_another_number_or_seed_another(benches):
    assert soak.draw(1, 3, benches) == soak.draw(1, 3, benches)
    assert soak.draw(1, 3, benches) != soak.draw(1, 4, benches) and soak.draw(1, 3, benches).scenario != soak.draw(2, 3, benches).scenario


def test_the_segments_have_all_that_may_happen_and_stay_within_the_rating(benches):
    segments = [soak.draw(1, number, benches) for number in range(1, 41)]
    events = [event for segment in segments for event in segment.scenario.events]
    keys = {key for event in events for key in event.keys}
    assert keys == {"load.constant_nm", "load.pulse1_nm", "load.pulse1_order", "supply.voltage_v", "motor.rs_ohm", "motor.psi_vs"} and {event.kind for event in events} == {"set", "speed_rpm", "press"}
    params = benches[HURST, ""].library.params
    speeds = [event.value for event in events if event.kind == "speed_rpm"]
    assert max(speeds) > params["NOMINAL_SPEED_RPM"] and min(speeds) < 0.0 # field weakening, and the other direction where the mode has it
    assert all(params["MINIMUM_SPEED_RPM"] <= abs(rpm) <= params["MAXIMUM_SPEED_RPM"] for rpm in speeds)
    loads = [event.keys["load.constant_nm"] for event in events if "load.constant_nm" in event.keys]
    most_nm = params["MAXIMUM_CURRENT_A"] * 1.5 * 5.0 * 7.983e-3
    held = [torque_nm for torque_nm in loads if torque_nm > most_nm]
    assert len(held) == sum(segment.holds for segment in segments) > 20 and 1.3 * most_nm <= min(held) and max(held) <= 3.0 * most_nm + 0.6 * motor_file.load(HURST).rated_torque_nm
    loads = [torque_nm for torque_nm in loads if torque_nm <= most_nm]
    assert min(loads) >= 0.0 and 0.03 < max(loads) <= 0.6 * motor_file.load(HURST).rated_torque_nm
    assert sum(segment.starts for segment in segments) > 60 and sum(len(segment.rests) for segment in segments) > 200


def test_a_load_that_pulses_never_pushes_swings_the_speed_by_a_share_at_most_and_ends(benches):
    seen = 0
    for number in range(1, 101):
        rpm, load_nm, pulse_nm = 0.0, 0.0, 0.0
        for event in soak.draw(1, number, benches).scenario.events:
            assert pulse_nm == 0.0 or set(event.keys) == {"load.pulse1_nm"}, (number, event)
            rpm = abs(event.value) if event.kind == "speed_rpm" else rpm
            load_nm = event.keys.get("load.constant_nm", load_nm)
            pulse_nm = event.keys.get("load.pulse1_nm", pulse_nm)
            if pulse_nm > 0.0:
                seen += 1
                omega = rpm * np.pi / 30.0
                assert pulse_nm <= load_nm and pulse_nm <= 0.1501 * 5.5e-6 * event.keys["load.pulse1_order"] * omega ** 2
    assert seen > 40


def test_the_true_motor_is_off_its_header(benches):
    plants = [soak.draw(1, number, benches).scenario.plant.values for number in range(1, 61)]
    for key, own, low, high in (("motor.rs_ohm", 2.67, 0.7, 1.4), ("motor.psi_vs", 7.983e-3, 0.8, 1.2), ("motor.ld_h", 1.92e-3, 0.75, 1.25)):
        factors = [plant[key] / own for plant in plants]
        assert low <= min(factors) < low + 0.1 and high - 0.1 < max(factors) <= high, key
    assert all(plant["motor.ld_h"] == plant["motor.lq_h"] for plant in plants)


def test_winding_and_magnets_change_no_faster_than_copper_warms(benches):
    seen = []
    for number in range(1, 61):
        scenario = soak.draw(1, number, benches).scenario
        now = scenario.plant.values
        for event in scenario.events:
            for key in {"motor.rs_ohm", "motor.psi_vs"} & set(event.keys):
                own, low, high = {"motor.rs_ohm": (2.67, 0.7, 1.4), "motor.psi_vs": (7.983e-3, 0.8, 1.2)}[key]
                assert low - 1e-3 <= event.keys[key] / own <= high + 1e-3, (number, event) # 7.983 is rounded
                ratio = abs(np.log(event.keys[key] / now[key]))
                assert ratio <= 0.05 * event.over_s + 1e-9, (number, event)
                seen.append(ratio)
                now = now | {key: event.keys[key]}
    assert len(seen) > 60 and max(seen) > 0.15


def test_loads_at_low_speed_leave_an_estimator_something_to_see(benches):
    """Half of E = P w psi for what R may be off, and half of w for what a load takes in an electrical period; of the Hurst, by hand."""
    seen = 0
    for number in range(1, 801):
        rpm, load_nm = 0.0, 0.0
        for event in soak.draw(1, number, benches).scenario.events:
            rpm = abs(event.value) if event.kind == "speed_rpm" else rpm
            if "load.constant_nm" in event.keys:
                change_nm, load_nm = event.keys["load.constant_nm"] - load_nm, event.keys["load.constant_nm"]
                omega = rpm * 2.0 * np.pi / 60.0
                if event.at_s > 5.0 and 0.0 < omega < 40.0 and change_nm > 0.005 and event.over_s > 0.05:
                    current_a = (load_nm + 0.004 + 15.3e-6 * omega) / (0.8 * 0.05987)
                    seen += 1
                    assert 2.67 * 0.4 * current_a <= 0.51 * 5.0 * omega * 7.983e-3 * 0.8
                    assert change_nm / event.over_s / (2.0 * 5.5e-6 * (5.0 * rpm / 60.0) ** 2) <= 0.51 * omega
    assert seen > 20


def test_nothing_changes_in_a_stretch_that_is_judged(benches):
    for number in range(1, 21):
        segment = soak.draw(1, number, benches)
        for from_s, to_s, _ in segment.rests:
            assert to_s - from_s >= soak.REST_S - 1e-3
            assert not [event for event in segment.scenario.events if from_s - 0.05 < event.at_s < to_s - 0.11], (number, from_s)


# ---- what counts as wrong --------------------------------------------------------------------------------------------------
def found(rests, held=(), **signals):
    recorded = trace(2.0, **{"plant__speed_rpm": 1000.0, "fw__speed_ref_rpm": 1000.0, "fw__state": 5.0, "pwm__outputs_seen": 63.0} | signals)
    segment = soak.Segment(1, HURST, "", None, rests, held=list(held))
    return soak.row_of(segment, Run(None, recorded, states=STATES, faults=FAULTS, motor_s=2.0), 2800.0)


REST = [(1.0, 1.5, 1000.0)]


def test_a_run_at_its_reference_is_fine():
    row = found(REST)
    assert row["verdict"] == soak.OK and row["stretches"] == 1


def test_a_trip_is_named_with_its_time():
    assert found(REST, fw__fault=lambda time_s: np.where(time_s > 1.2, 6.0, 0.0))["verdict"] == "trips: STALL at 1.200 s"


def test_a_drift_is_wrong_unless_the_drive_names_a_limit():
    slow = {"plant__speed_rpm": 985.0}
    assert "speed -1.50 % off" in found(REST, **slow)["verdict"]
    limited = found(REST, fw__limits=1.0, **slow)
    assert limited["verdict"] == soak.OK and limited["stretches"] == 0
    assert found([], **slow)["verdict"] == soak.OK # between the stretches the speed is on its way


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_speed_that_swings_once_a_turn_has_the_mean_of_whole_turns(direction):
    swings = lambda time_s: direction * (600.0 + 120.0 * np.sin(2.0 * np.pi * 10.0 * (time_s - 1.0))) # noqa: E731 # of half a turn the mean is 3 % off
    row = found([(1.0, 1.45, direction * 600.0)], plant__speed_rpm=swings, fw__speed_ref_rpm=direction * 600.0)
    assert row["verdict"] == soak.OK and row["worst_speed_error_percent"] < 0.1


def test_a_lost_lock_is_an_angle_that_stays_off_in_closed_loop():
    off = lambda for_s: lambda time_s: np.where((time_s > 1.2) & (time_s < 1.2 + for_s), 90.0, 0.0) # noqa: E731
    assert "loses its lock" in found(REST, fw__theta_est_deg=off(0.06))["verdict"]
    assert found(REST, fw__theta_est_deg=off(0.04))["verdict"] == soak.OK
    assert found(REST, fw__theta_est_deg=off(0.06), fw__state=4.0)["verdict"] == soak.OK


def test_a_rotor_that_a_hand_holds_shows_no_angle_and_may_stop_the_drive_by_name():
    hand = [(1.1, 1.5)]
    off = {"fw__theta_est_deg": lambda time_s: np.where((time_s > 1.2) & (time_s < 1.45), 90.0, 0.0)}
    assert found([], hand, **off)["verdict"] == soak.OK and "loses its lock" in found([], [(1.3, 1.5)], **off)["verdict"]
    trip = {"fw__fault": lambda time_s: np.where(time_s > 1.2, 6.0, 0.0)}
    assert found([], hand, **trip)["verdict"] == "stopped by a hand: STALL at 1.200 s" and found([], [(1.0, 1.1)], **trip)["verdict"].startswith("trips")


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_rotor_that_is_thrown_backwards_as_the_hand_lets_go_is_wrong(direction):
    def held(back_rpm):
        return found([], [(1.1, 1.5)], fw__speed_ref_rpm=1000.0 * direction, plant__speed_rpm=lambda time_s: direction * np.where(abs(time_s - 1.3) < 0.01, -back_rpm, 900.0))

    assert held(111.0)["verdict"] == soak.OK and held(113.0)["verdict"] == "thrown backwards: 113 rpm after 1.100 s" # 4 % of 2800 rpm


def test_segments_that_fail_with_a_held_shaft_are_counted_apart(benches):
    rows = [found(REST) | {"holds": holds, "verdict": verdict} for holds, verdict in ((0, "ok"), (2, "ok"), (1, "trips: STALL"), (0, "trips: STALL"), (1, "stopped by a hand: STALL"))]
    series = soak.Soak(1, benches)
    told = series.page(rows)[0]
    assert (told["wrong"], told["held"], told["wrong_held"], told["passed"]) == (2, 3, 1, False)
    assert series.text(rows).endswith("2 wrong, 1 of them with a held shaft, 1 stopped by a hand\n3 of 5 segments are well")


# ---- the command -------------------------------------------------------------------------------------------------------------
def test_one_segment_alone_gives_its_whole_report(benches, monkeypatch, tmp_path):
    monkeypatch.setattr(soak, "prepared", lambda names: {(HURST, ""): benches[HURST, ""]})
    monkeypatch.setattr(soak, "MODES", ("",))
    monkeypatch.setattr(soak, "SEGMENT_S", 4.0)
    code, out, error = command("soak", "--case", "3", "--quiet", "--out", str(tmp_path / "out"))
    assert code == 0 and "segment 3" in out and "closed loop" in out, error
    assert (tmp_path / "out" / "index.html").is_file() and (tmp_path / "out" / "trace.csv").is_file()


def test_an_interrupted_soak_goes_on_with_the_segments_that_are_missing(benches, monkeypatch, tmp_path):
    monkeypatch.setattr(soak, "prepared", lambda names: {(HURST, ""): benches[HURST, ""]})
    monkeypatch.setattr(soak, "MODES", ("",))
    monkeypatch.setattr(soak, "SEGMENT_S", 3.0)
    whole = soak.run

    def broken(segment, benches, tell):
        if segment.number == 4:
            raise soak.UserError("interrupted", "test")
        return whole(segment, benches, tell)
    arguments = ("soak", "--case", "1", "2", "3", "4", "--quiet", "--out", str(tmp_path / "out"))
    monkeypatch.setattr(soak, "run", broken)
    assert command(*arguments)[0] == 2 and not (tmp_path / "out").exists()
    monkeypatch.setattr(soak, "run", whole)
    code, out, _ = command(*arguments)
    assert code == 0 and "of 4 segments are there already" in out and "4 of 4" in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("arguments, says", [(["--hours", "0"], "--hours"), (["--hours", "nan"], "--hours"), (["--case", "0"], "--case"),
                                             (["--hours", "long"], "--hours"), (["--motor", "nosuch"], "nosuch")])
def test_bad_input_is_refused_in_one_line(arguments, says):
    refused(command("soak", *arguments), says)
