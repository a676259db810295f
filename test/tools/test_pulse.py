"""A load that pulses with the angle: what is asked of a motor, what is out of its reach, what is measured, and what makes a row fail."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support import LIBRARY, run, small_sweep, step, trace

from tools.bench import pulse_sweep, reach
from tools.bench.board import Library
from tools.bench.pulse_sweep import Case, Pulse, Table
from tools.common import board_file, motor_file, paths

HURST, LINIX = "hurst_dmb0224c10002", "linix_45zwn24_40"
TABLE = Table.read(paths.TABLES / "pulse.toml")


def sweep(**changes):
    return Pulse(replace(TABLE, **changes), motor_file.part(HURST), board_file.part("mclv"), Library(LIBRARY))


# ---- what is asked -------------------------------------------------------------------------------------------------------
def test_loads_of_the_whole_mean_up_and_down_are_asked_for_from_a_fifth_of_rated_speed_up_and_another_motor_gets_the_same_shares():
    hurst, linix = motor_file.load(HURST), motor_file.load(LINIX)
    assert {500.0, 1190.0, 2500.0, 0.2 * hurst.rated_speed_rpm} <= set(TABLE.speeds_rpm) and {0.03, 0.04} <= set(TABLE.torques_nm)
    assert (TABLE.error_percent, TABLE.swing_percent, TABLE.swing_inertia, TABLE.swing_from_percent) == (0.5, 50.0, 3.0, 20.0)
    other = TABLE.for_motor(linix, {"MINIMUM_SPEED_RPM": 1000.0, "MAXIMUM_SPEED_RPM": 3000.0})
    assert other.speeds_rpm == [1000.0, 1140.0, pytest.approx(1190.0 / hurst.rated_speed_rpm * linix.rated_speed_rpm, rel=0.005), 3000.0]
    assert other.torques_nm == pytest.approx([linix.rated_torque_nm / hurst.rated_torque_nm * torque for torque in TABLE.torques_nm], rel=0.005)


def test_inertia_and_load_come_when_the_motor_turns_and_the_peak_is_twice_the_mean():
    job, motor = sweep().job(Case(1190.0, 0.04, 3.0, 2.0)), motor_file.load(HURST)
    assert job.values["load.pulse1_order"] == 2.0 and "load.pulse1_nm" not in job.values
    changes = [action for action in job.actions if "load.pulse1_nm" in action.keys]
    inertia, = (action for action in job.actions if "mech.inertia_kgm2" in action.keys)
    assert inertia.keys["mech.inertia_kgm2"] == pytest.approx(3.0 * motor.inertia_kgm2) and inertia.at_s <= changes[0].at_s
    assert changes[-1].keys == {"load.constant_nm": 0.04, "load.pulse1_nm": 0.04}
    measure, = job.scenario.measures
    assert measure.from_s == pytest.approx(changes[-1].at_s + TABLE.settle_s) and measure.to_s - measure.from_s == pytest.approx(TABLE.measure_s)
    most_nm = 0.85 * 2.75 * reach.torque_per_amp(sweep().motor.values.values) # a peak that the current gives
    found = sorted({item.torque_nm for item in sweep(torques_nm=[0.1, 0.2]).cases()})
    assert found == pytest.approx([0.25 * most_nm, 0.5 * most_nm], rel=0.005)


# ---- the law and what is out of reach ------------------------------------------------------------------------------------
def test_at_constant_current_a_turn_swings_by_twice_the_torque_over_inertia_and_speed():
    omega = 1190.0 * math.pi / 30.0
    assert pulse_sweep.constant_current_rpm(1.65e-5, 1190.0, 0.04, 1.0) == pytest.approx(2.0 * 0.04 / (1.65e-5 * omega) * 30.0 / math.pi)
    assert pulse_sweep.constant_current_rpm(1.65e-5, 1190.0, 0.04, 2.0) == pytest.approx(0.04 / (1.65e-5 * omega) * 30.0 / math.pi)


@pytest.mark.parametrize("rpm, torque_nm, constant_rpm, text", [
    (1190.0, 0.04, 5000.0, ""), (2500.0, 0.055, 500.0, ""), (2500.0, 0.055, 1251.0, "peak needs 1"), (1190.0, 0.1, 5000.0, "peak needs 3"),
    (1190.0, 0.2, 1.0, "mean needs 3"), (4500.0, 0.08, 1.0, "mean needs 1")])
def test_a_load_is_carried_whose_peak_is_within_the_limits_or_whose_mean_is_while_the_rotor_bridges_the_rest(rpm, torque_nm, constant_rpm, text):
    bench = sweep()
    found = bench.beyond(bench.motor.values.values, Case(rpm, torque_nm, 1.0, 1.0), 13.0, constant_rpm)
    assert found.startswith(text) and (found == "") == (text == ""), found


@pytest.mark.parametrize("rpm, inertia, pulses, counts", [(560.0, 3.0, 1.0, True), (559.0, 3.0, 1.0, False), (2500.0, 1.0, 1.0, False),
                                                          (2500.0, 9.0, 1.0, False), (2500.0, 3.0, 2.0, False)])
def test_the_swing_counts_for_three_times_the_inertia_from_a_fifth_of_rated_speed_up(rpm, inertia, pulses, counts):
    assert sweep().swing_counts(Case(rpm, 0.03, inertia, pulses)) is counts


def test_no_swing_is_asked_for_where_half_of_the_amplitude_is_beyond_the_voltage_and_that_is_told():
    bench, item = sweep(), Case(2500.0, 0.055, 3.0, 1.0)
    job, measured = bench.job(item), {"asked_rpm": 2500.0, "mean_rpm": 2500.0, "swing_rpm": 300.0, "fault": None}
    row = bench.row(item, job, measured | {"voltage_limit_v": 12.8})
    assert row["swing_limit"] == "-" and row["beyond"] == "" and row["swing_beyond"].startswith("needs 1")
    shown = {"lowest_rpm": 1.0, "highest_rpm": 2.0, "current_max_a": 1.0, "verdict": "ok"}
    assert "half of the swing is out of reach" in bench.text([row | shown])
    assert bench.row(item, job, measured | {"voltage_limit_v": 15.0})["swing_limit"] == "0.50"


# ---- what is measured ----------------------------------------------------------------------------------------------------
def test_only_whole_turns_are_measured():
    speed = lambda time_s: 600.0 + 300.0 * np.sin(2.0 * np.pi * 10.0 * time_s) # a turn takes a tenth of a second
    for direction in (1.0, -1.0):
        part = pulse_sweep.whole_turns(trace(0.975, plant__speed_rpm=lambda time_s, sign=direction: sign * speed(time_s)))
        assert part.time_s[-1] == pytest.approx(0.9, abs=2e-4) and part.column("plant.speed_rpm").mean() == pytest.approx(direction * 600.0, abs=0.5)
    slow = trace(0.5, plant__speed_rpm=60.0)
    assert len(pulse_sweep.whole_turns(slow)) == len(slow)


def test_mean_swing_current_and_what_ended_it_are_read_from_the_run():
    item, times = Case(600.0, 0.04, 3.0, 1.0), {"settle_s": 0.4, "torque_over_s": 0.1}
    recorded = run('[[measure]]\nname = "measured"\nfrom_s = 1.0\nto_s = 2.0\nreference_rpm = 600\n', fw__speed_ref_rpm=600.0, plant__i_q=1.5,
                   fw__state=step((0, 4), (0.2, 5)), fw__v_limit_v=13.0, plant__speed_rpm=lambda time_s: 606.0 + 50.0 * np.sin(2.0 * np.pi * 10.1 * time_s))
    found = Pulse(replace(TABLE, **times)).measured(recorded, item)
    assert [found[key] for key in ("mean_rpm", "swing_rpm", "current_max_a", "voltage_limit_v", "asked_rpm")] == pytest.approx(
        [606.0, 100.0, 1.5, 13.0, 600.0], rel=1e-3)
    assert (found["fault"], found["closed"]) == (None, True)
    stopped = run('[[measure]]\nname = "measured"\nfrom_s = 1.0\nto_s = 2.0\nreference_rpm = 600\n', fw__fault=step((0, 0), (0.75, 6)))
    found = Pulse(replace(TABLE, **times)).measured(stopped, item)
    assert (found["fault"], found["fault_after_s"], found["swing_rpm"]) == ("STALL", pytest.approx(0.25, abs=1e-3), None)


# ---- verdicts ------------------------------------------------------------------------------------------------------------
def row(**more):
    return {"name": "x", "closed": True, "fault": None, "fault_after_s": None, "speed_error_percent": 0.2, "swing_rpm": 40.0, "constant_rpm": 100.0,
            "swing_share": 0.4, "swing_limit": "0.50", "beyond": "", "limited_percent": {}} | more


@pytest.mark.parametrize("values, text", [
    ({}, "ok"), ({"closed": False}, "no start: never in closed loop"), ({"fault": "CURRENT_SENSOR", "fault_after_s": 0.25}, "fault CURRENT_SENSOR after 0.25 s"),
    ({"speed_error_percent": 0.51}, "speed +0.5 %"), ({"swing_share": 0.51}, "swing"), ({"swing_share": 0.51, "swing_limit": "-"}, "ok"),
    ({"beyond": "mean needs", "speed_error_percent": -9.0}, "out of reach"), ({"beyond": "mean needs", "fault": "STALL", "fault_after_s": 1.0}, "out of reach"),
    ({"beyond": "mean needs"}, "ok")])
def test_each_way_to_fail_is_named_and_what_is_out_of_reach_does_not_fail(values, text):
    bench, item, found = sweep(), Case(1190.0, 0.04, 3.0, 1.0), row(**values)
    assert bench.verdict(item, found) == text
    outcome, = bench.check(item, found | {"verdict": text})
    assert outcome.ok == (text in ("ok", "out of reach")) and ("swing 50 %" in outcome.allowed) == (found["swing_limit"] != "-")


# ---- for the user --------------------------------------------------------------------------------------------------------
def test_a_pulse_in_full_a_heavy_rotor_keeps_its_mean_speed_and_swings(tmp_path, monkeypatch):
    code, out, error, data, rows = small_sweep(tmp_path, monkeypatch, "pulse", speeds_rpm="[1190]", torques_nm="[0.02]", inertia_factors="[9]",
                                               pulses_per_turn="[1]")
    assert (code, error, [item["verdict"] for item in rows]) == (0, "", ["ok"]), out
    assert 20.0 < float(rows[0]["swing_rpm"]) < 150.0 and float(rows[0]["constant_rpm"]) == pytest.approx(61.9, abs=0.1) and data["passed"]
