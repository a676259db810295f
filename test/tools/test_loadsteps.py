"""Load steps and low speed: what is asked of a motor, what is out of its reach, and what makes a row fail."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support import LIBRARY, run, small_sweep, step

from tools.bench import case, loadsteps, lowspeed, plots, reach, search, simulate
from tools.bench.board import Library
from tools.bench.build import library
from tools.common import board_file, motor_file, paths, workers
from tools.common.errors import UserError

HURST, LINIX = "hurst_dmb0224c10002", "linix_45zwn24_40"
STEPS, SLOW = (room.Table.read(paths.TABLES / f"{name}.toml") for room, name in ((loadsteps, "loadsteps"), (lowspeed, "lowspeed")))
PLANT = {"motor.pole_pairs": 5.0, "motor.psi_vs": 8e-3, "motor.rs_ohm": 2.5, "motor.ld_h": 2e-3, "motor.lq_h": 2e-3}


# ---- what is in reach ----------------------------------------------------------------------------------------------------
def test_the_least_voltage_is_that_of_the_best_d_current_and_friction_counts():
    need = reach.least(PLANT, 2500.0, 0.06, 2.75)
    omega = 2500.0 * math.pi / 30.0 * 5.0
    assert need.iq_a == pytest.approx(0.06 / 0.06) and reach.torque_per_amp(PLANT) == pytest.approx(0.06)

    def volts(i_d):
        return math.hypot(2.5 * i_d - omega * 2e-3 * need.iq_a, 2.5 * need.iq_a + omega * (2e-3 * i_d + 8e-3))
    assert need.voltage_v == pytest.approx(volts(need.id_a)) and need.id_a < 0.0
    assert need.voltage_v <= min(volts(need.id_a - 0.01), volts(need.id_a + 0.01), volts(0.0))
    more = reach.least(PLANT | {"mech.coulomb_nm": 0.006, "mech.viscous_nms": 0.006 / (2500.0 * math.pi / 30.0)}, 2500.0, 0.06, 2.75)
    assert more.iq_a == pytest.approx(1.2)
    salient = reach.least(PLANT | {"motor.lq_h": 4e-3}, 2500.0, 0.06, 2.75) # Ld < Lq: a negative d current adds torque
    assert salient.iq_a < 1.0


@pytest.mark.parametrize("rpm, torque_nm, limit_v, text", [
    (500.0, 0.06, 13.0, ""), (500.0, 0.06, None, ""), (4500.0, 0.1, 13.0, "needs 1"), (500.0, 0.24, 13.0, "needs 4.00 A of 2.75 A")])
def test_what_is_out_of_reach_is_said_with_its_number(rpm, torque_nm, limit_v, text):
    found = reach.out_of_reach(reach.least(PLANT, rpm, torque_nm, 2.75), 2.75, limit_v)
    assert found.startswith(text) and (found == "") == (text == ""), found


def test_a_load_that_stops_the_rotor_before_the_drive_can_answer_is_too_quick():
    """2.4e-6 kg m2 from 714 rpm under 0.0625 N m and friction; 0.8 ms of filter, 0.16 of current loop, 0.4 a step, 1.52 of observer."""
    values = {"mech.inertia_kgm2": 2.4e-6, "mech.coulomb_nm": 0.002, "mech.viscous_nms": 0.0}
    params = {"LOOPTIME_SEC": 50e-6, "KFILTER_ESDQ": 2000.0, "CURRENT_BANDWIDTH_HZ": 1000.0, "LOAD_BANDWIDTH_HZ": 105.0}
    stops, answers = reach.stops_s(values, 714.0, 0.0625), reach.answer_s(params)
    assert (stops, answers) == pytest.approx((2.782e-3, 2.869e-3), abs=2e-6)
    assert reach.too_quick(stops, answers) == "the load stops the rotor in 2.78 ms, the drive answers in 2.87 ms"
    assert reach.too_quick(answers, stops) == "" == reach.too_quick(reach.stops_s(values | {"mech.coulomb_nm": 0.0}, 714.0, 0.0), answers)


# ---- load steps ----------------------------------------------------------------------------------------------------------
def test_27_steps_are_asked_for_and_another_motor_gets_the_same_shares_of_its_rating_within_its_header():
    assert (STEPS.speeds_rpm, STEPS.torques_nm, STEPS.kphi_factors) == ([500.0, 1190.0, 2500.0], [0.03, 0.05, 0.08], [0.8, 1.0, 1.2])
    hurst, linix = motor_file.load(HURST), motor_file.load(LINIX)
    other = STEPS.for_motor(linix, {"MINIMUM_SPEED_RPM": 1000.0, "MAXIMUM_SPEED_RPM": 3000.0, "SPEED_BANDWIDTH_HZ": 12.0})
    assert other.speeds_rpm == [1000.0, pytest.approx(1190.0 / hurst.rated_speed_rpm * linix.rated_speed_rpm, rel=0.005), 3000.0]
    share = linix.rated_torque_nm / hurst.rated_torque_nm
    assert other.torques_nm == pytest.approx([share * torque for torque in (0.03, 0.05, 0.08)], rel=0.005)
    assert (other.dip_percent, other.unloaded_rpm, other.back_s) == ([], [], STEPS.back_s)


def test_a_slow_speed_loop_gets_the_time_in_which_it_ends_a_dip():
    linix = motor_file.load(LINIX)
    slow = STEPS.for_motor(linix, {"MINIMUM_SPEED_RPM": 1000.0, "MAXIMUM_SPEED_RPM": 3000.0, "SPEED_BANDWIDTH_HZ": 0.5})
    assert slow.back_s == pytest.approx(3.912 / (2.0 * math.pi * 0.5), rel=1e-3) # exp(-3.912) = 2 %
    assert slow.hold_s / STEPS.hold_s == slow.settle_s / STEPS.settle_s == slow.unloaded_s / STEPS.unloaded_s == pytest.approx(slow.back_s / 0.3)


def steps(**changes):
    return loadsteps.LoadSteps(replace(STEPS, **changes), motor_file.part(HURST), board_file.part("mclv"), Library(LIBRARY))


def test_the_brake_closes_and_opens_in_one_step_on_a_plant_whose_flux_the_header_does_not_know():
    job, motor = steps().job(loadsteps.Case(1190.0, 0.08, 0.8)), motor_file.load(HURST)
    brakes = [(action.at_s, action.keys["load.constant_nm"]) for action in job.actions if "load.constant_nm" in action.keys]
    on_s = job.scenario.measures[0].from_s
    assert brakes[-2:] == [(on_s, 0.08), (on_s + STEPS.hold_s, 0.0)] and {torque for _, torque in brakes[:-2]} == {0.0}
    assert job.values["motor.psi_vs"] == pytest.approx(0.8 * motor.psi_vs)
    assert job.scenario.duration_s == pytest.approx(on_s + 2.0 * STEPS.hold_s)
    most_nm = 0.85 * 2.75 * 0.8 * 1.5 * motor.pole_pairs * motor.psi_vs # no more than the current gives
    found = [item.torque_nm for item in steps(torques_nm=[0.5, 1.0], speeds_rpm=[1190.0], kphi_factors=[0.8]).cases()]
    assert found == pytest.approx([0.5 * most_nm, most_nm], rel=0.005)


@pytest.mark.parametrize("speed, back_s", [
    ([1000.0] * 100, 0.0), ([1000.0] * 10 + [950.0] * 20 + [990.0] * 70, 0.03), ([950.0] * 100, None),
    ([900.0, 1000.0, 1100.0] + [1000.0] * 97, 0.003), ([1000.0] * 99 + [1021.0], None)])
def test_back_is_where_the_speed_stays_within_two_per_cent(speed, back_s):
    assert loadsteps.back_after(np.array(speed), 1000.0, 2.0, 0.001) == (None if back_s is None else pytest.approx(back_s))


def test_dip_rise_and_angle_are_read_from_the_run():
    item = loadsteps.Case(1000.0, 0.08, 1.0)
    recorded = run('[[measure]]\nname = "measured"\nfrom_s = 1.0\nto_s = 2.0\n', fw__speed_ref_rpm=1002.0, fw__state=step((0, 4), (0.5, 5)), fw__v_limit_v=13.0,
                   fw__theta_est_deg=step((0, 0), (1.0, -7)), plant__speed_rpm=step((0, 1001), (0.9, 1003), (1.0, 801.6), (1.1, 1000),
                                                                                        (1.5, 1202.4), (1.55, 1000)))
    found = loadsteps.LoadSteps(replace(STEPS, hold_s=0.5)).measured(recorded, item)
    assert [found[key] for key in ("unloaded_min_rpm", "unloaded_max_rpm", "lowest_rpm", "highest_rpm", "dip_percent", "rise_percent",
                                   "on_back_s", "off_back_s", "angle_error_max_deg", "voltage_limit_v")] == pytest.approx(
        [1001.0, 1003.0, 801.6, 1202.4, 20.0, 20.0, 0.1, 0.05, 7.0, 13.0], rel=1e-3)
    assert (found["fault"], found["closed"]) == (None, True) and found["drawn"][0][0] == pytest.approx(-0.05, abs=1e-3)


def step_row(**more):
    return {"name": "x", "reference_rpm": 1190.0, "ramped_rpm": 1190.0, "torque_nm": 0.08, "kphi": 1.0, "fault": None, "closed": True,
            "beyond": "", "too_quick": "", "unloaded_min_rpm": 1188.0, "unloaded_max_rpm": 1192.0, "lowest_rpm": 830.0, "highest_rpm": 1500.0,
            "on_back_s": 0.1, "off_back_s": 0.1, "dip_percent": 30.0} | more


FIVE = {"reference_rpm": 500.0, "ramped_rpm": 500.0, "torque_nm": 0.05, "unloaded_min_rpm": 491.0, "unloaded_max_rpm": 509.0}


@pytest.mark.parametrize("values, text", [
    ({}, "ok"), ({"fault": "STALL"}, "fault STALL"), ({"closed": False}, "never in closed loop"),
    ({"lowest_rpm": -0.1}, "backwards, -0 rpm"),
    ({"on_back_s": 0.31}, "step on: not back in 0.3 s"), ({"off_back_s": None}, "step off: not back in 0.3 s"),
    ({"dip_percent": 35.1}, "dip above 35 %"), ({"dip_percent": 60.0, "kphi": 0.8}, "ok"), ({"dip_percent": 60.0, "torque_nm": 0.05}, "ok"),
    (FIVE, "ok"), (FIVE | {"dip_percent": 50.1}, "dip above 50 %"), (FIVE | {"unloaded_max_rpm": 511.0}, "wanders by 2.2 % without load"),
    ({"beyond": "needs", "on_back_s": None}, "out of reach"), ({"beyond": "needs", "off_back_s": None}, "step off: not back in 0.3 s"),
    ({"beyond": "needs", "lowest_rpm": -9.0}, "backwards, -9 rpm"), ({"beyond": "needs", "fault": "STALL"}, "fault STALL"),
    ({"too_quick": "stops"}, "ok"), ({"too_quick": "stops", "lowest_rpm": -9.0}, "out of reach"),
    ({"too_quick": "stops", "lowest_rpm": -9.0, "on_back_s": 0.31}, "step on: not back in 0.3 s")])
def test_each_way_to_fail_is_named_and_what_is_out_of_reach_must_still_come_back(values, text):
    row = step_row(**values)
    row["verdict"] = loadsteps.LoadSteps(STEPS).verdict(None, row)
    outcome, = loadsteps.LoadSteps(STEPS).check(None, row)
    assert (row["verdict"], outcome.ok) == (text, text in ("ok", "out of reach"))
    assert ("after the step off" in outcome.allowed) == bool(row["beyond"])


def test_the_table_ends_with_the_numbers_of_what_is_out_of_reach():
    rows = [step_row(unloaded="1 .. 2", angle_error_max_deg=3.0, verdict="ok"),
            step_row(unloaded="1 .. 2", angle_error_max_deg=3.0, verdict="out of reach", beyond="needs 14.00 V of 13.00 V")]
    text = loadsteps.LoadSteps(STEPS).text
    assert text(rows).endswith("\nx, Kphi x1: needs 14.00 V of 13.00 V") and "friction" not in text(rows[:1])


def test_a_row_that_does_not_hold_says_which_load_stops_its_rotor_before_the_drive_answers():
    why = "the load stops the rotor in 1.78 ms, the drive answers in 2.80 ms"
    rows = [step_row(unloaded="1 .. 2", angle_error_max_deg=3.0, verdict=verdict, too_quick=why) for verdict in ("ok", "step on: not back in 0.3 s")]
    text = loadsteps.LoadSteps(STEPS).text
    assert text(rows).endswith(f"\nwhy others do not hold, friction included:\nx, Kphi x1: {why}") and text(rows).count(why) == 1
    assert why not in text(rows[:1])


# ---- low speed -----------------------------------------------------------------------------------------------------------
def test_another_motor_gets_the_same_shares_of_its_rating_and_no_speed_below_its_header_s():
    hurst, linix = motor_file.load(HURST), motor_file.load(LINIX)
    ratio = linix.rated_speed_rpm / hurst.rated_speed_rpm
    other = SLOW.for_motor(linix, {"MINIMUM_SPEED_RPM": 290.0 * ratio})
    assert other.speeds_rpm == pytest.approx([rpm * ratio for rpm in (290.0, 300.0, 400.0, 500.0)], rel=0.005)
    assert SLOW.for_motor(linix, {"MINIMUM_SPEED_RPM": 50.0}).speeds_rpm == pytest.approx([rpm * ratio for rpm in SLOW.speeds_rpm], rel=0.005)


def slow_bench(defines=()):
    return lowspeed.LowSpeed(SLOW, motor_file.part(HURST), board_file.part("mclv"), Library(library(list(defines)) if defines else LIBRARY))


def test_150_to_500_rpm_are_asked_for_in_ten_seconds_and_the_header_s_minimum_is_lowered_where_it_is_above():
    assert (min(SLOW.speeds_rpm), max(SLOW.speeds_rpm), SLOW.torques_nm, SLOW.measure_s) == (150.0, 500.0, [0.0, 0.03, 0.08], 10.0)
    bench = slow_bench()
    header = bench.library.params["MINIMUM_SPEED_RPM"]
    slow, quick = bench.job((0.5 * header, 0.03)), bench.job((2.0 * header, 0.03))
    assert (slow.parameters, quick.parameters) == ({"MINIMUM_SPEED_RPM": 0.5 * header}, {})
    pots = [action.keys["input.pot"] for action in slow.actions if "input.pot" in action.keys]
    assert pots[-1] == pytest.approx(0.0, abs=1e-3) # the potentiometer's zero is that speed
    below = SLOW.below()
    assert below == sorted(below, reverse=True) and below[0] < 150.0 and below[-1] == SLOW.lowest_rpm
    assert max(a / b for a, b in itertools.pairwise([150.0, *below])) <= SLOW.ratio + 1e-9


def test_a_parameter_changes_at_power_up_in_a_firmware_that_keeps_them_in_ram_only():
    job = slow_bench(("PARAMS_IN_RAM",)).job((100.0, 0.0))
    job.actions, job.scenario.duration_s = [], 0.01
    found = workers.run_all([job], _minimum, lambda seconds: None)
    assert found == [pytest.approx(100.0)]
    with pytest.raises(UserError, match="MINIMUM_SPEED_RPM cannot change in this firmware: build it with PARAMS_IN_RAM"):
        fixed = slow_bench().job((100.0, 0.0))
        workers.run_all([fixed], _minimum, lambda seconds: None)


def _minimum(job, report):
    board = simulate.Board(Library(job.library))
    with simulate.using(board, job):
        simulate.simulate_on(job, board.library, board, report)
        return board.parameter("MINIMUM_SPEED_RPM")


def slow_row(**more):
    return {"name": "x", "closed_after_s": 1.6, "fault": None, "speed_error_percent": 0.1, "angle_error_rms_deg": 2.0,
            "limited_percent": {}} | more


@pytest.mark.parametrize("values, text", [
    ({}, "ok"), ({"closed_after_s": None}, "no start: never in closed loop"),
    ({"closed_after_s": None, "fault": "STALL"}, "no start: STALL"),
    ({"fault": "STALL"}, "fault STALL"), ({"speed_error_percent": 1.01}, "speed +1.0 %"), ({"speed_error_percent": None}, "no speed"),
    ({"angle_error_rms_deg": 8.1}, "angle")])
def test_each_way_not_to_hold_a_low_speed_is_named(values, text):
    row = slow_row(**values)
    assert lowspeed.LowSpeed(SLOW).verdict(None, row) == text
    assert lowspeed.LowSpeed(SLOW).check(None, row | {"verdict": text})[0].ok == (text == "ok")


def test_a_search_that_has_no_value_to_begin_with_goes_on_from_what_is_known():
    limit = search.Search(False, lambda row: row["verdict"] == "ok", 200.0)
    for rpm in (200.0, 100.0, 50.0):
        limit.narrow(rpm, {"verdict": "ok" if rpm > 120.0 else "speed"})
    search.in_rounds([], {"": limit}, lambda key: key, 2.0, lambda number, wanted: [{"verdict": "ok" if rpm > 120.0 else "speed"} for _, rpm in wanted])
    assert limit.bad <= 120.0 < limit.good <= 1.02 * limit.bad


def test_the_speed_is_compared_with_the_reference_that_the_firmware_had():
    text = "[[event]]\nat_s = 0.1\npress = \"S2\"\n[[measure]]\nname = \"measured\"\nfrom_s = 0.5\nto_s = 1.0\nreference_rpm = 150\n"
    recorded = run(text, fw__speed_ref_rpm=152.0, plant__speed_rpm=151.24, fw__state=step((0, 4), (0.3, 5)), pwm__outputs_seen=63)
    found = lowspeed.LowSpeed(SLOW).measured(recorded, (150.0, 0.0))
    assert (found["asked_rpm"], found["speed_error_percent"]) == pytest.approx((152.0, -0.5), abs=1e-3)


def test_how_low_it_goes_is_found_for_each_torque_and_what_happens_below_is_told():
    limits, seen = {0.0: 70.0, 0.03: 600.0, 0.08: 0.0}, []

    class FakeBench(lowspeed.LowSpeed):
        def run(self, cases, title):
            seen.extend(cases)
            return [{"reference_rpm": rpm, "torque_nm_set": torque, "verdict": "ok" if rpm > limits[torque] else "angle"}
                    for rpm, torque in cases]

    bench = FakeBench(*(getattr(slow_bench(), name) for name in ("table", "motor", "board", "library")))
    known = bench.run(list(itertools.product(SLOW.speeds_rpm, limits)), "")
    seen.clear()
    bench.lowest = found = bench.find_lowest(known)
    assert 70.0 < found[0.0].good <= 70.0 * 1.041 and found[0.08].good == 50.0 and len(set(seen)) == len(seen)
    lines = bench.text([slow_row()]).splitlines()[-3:]
    assert lines[0].startswith("0 N m is held down to 7") and lines[0].endswith(": angle)")
    assert lines[1] == "0.03 N m is held not at all (at 500 rpm: angle)"
    assert lines[2] == "0.08 N m is held down to 50 rpm (the search ended there)"


# ---- for the user --------------------------------------------------------------------------------------------------------
def test_load_steps_in_full(tmp_path, monkeypatch):
    code, out, error, data, rows = small_sweep(tmp_path, monkeypatch, "loadsteps", speeds_rpm="[1190, 2500]", torques_nm="[0.08]",
                                         kphi_factors="[1.0]")
    assert (code, error, data["passed"]) == (0, "", True), out
    assert [item["verdict"] for item in rows] == ["ok", "out of reach"] and "needs 1" in out
    assert 5.0 < float(rows[0]["dip_percent"]) < 35.0 and data["plots"] == ["loadsteps.png"]
    assert (tmp_path / "out/loadsteps.png").read_bytes()[:4] == b"\x89PNG"


def test_low_speed_in_full(tmp_path, monkeypatch):
    code, out, error, data, rows = small_sweep(tmp_path, monkeypatch, "lowspeed", speeds_rpm="[400]", torques_nm="[0.03]", measure_s="0.5",
                                         lowest_rpm="300", ratio="1.3")
    assert (code, error, [item["verdict"] for item in rows]) == (0, "", ["ok"]), out
    assert "0.03 N m is held down to 300 rpm (the search ended there)" in out
    assert data["lowest"][0]["lowest_rpm"] == 300.0 and abs(float(rows[0]["speed_error_percent"])) < 1.0


def test_every_step_is_drawn(tmp_path):
    line = (np.array([0.0, 0.1, 0.5, 0.6]), np.array([500.0, 400.0, 500.0, 600.0]))
    rows = [step_row(reference_rpm=rpm, kphi=kphi) for rpm in (500.0, 1190.0) for kphi in (0.8, 1.0, 1.2)]
    assert plots.write_loadsteps(rows, [line] * len(rows), 0.5, tmp_path) == ["loadsteps.png"]
