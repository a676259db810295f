"""The campaign of injected faults: what is drawn, how an end is judged, that silence fails the command, and that an interrupted one goes on."""

import csv
import functools
import json
import os
import re
import signal
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support import FAULTS, LIBRARY, MOTORS, command, trace

from tools.bench import campaign, draws, injection, judge, memory, trial
from tools.bench.board import Library
from tools.common import board_file, motor_file, param_rows, paths, workers

HURST = "hurst_dmb0224c10002"
CASES = [injection.draw(1, number, list(MOTORS)) for number in range(1, 1001)]
LIMITS = judge.Limits(injected_s=0.5, settled_s=1.5, rated_rpm=2800.0, most_current_a=4.0, codes=("STALL",), faults=FAULTS, closed=(5, 6))


@pytest.fixture(name="bench", scope="module")
def _bench():
    library = Library(LIBRARY)
    return trial.Bench(motor_file.part(HURST), board_file.part("mclv"), library, memory.variables(library))


@pytest.fixture(name="hurst")
def _hurst(bench, monkeypatch):
    """The command with the project's own header, which is built already."""
    monkeypatch.setattr(campaign, "prepared", lambda names: {HURST: bench})
    return bench


# ---- what is drawn ---------------------------------------------------------------------------------------------------------
def test_a_number_always_draws_the_same_case_and_another_number_or_seed_another():
    assert injection.draw(1, 7, list(MOTORS)) == injection.draw(1, 7, list(MOTORS))
    assert injection.draw(1, 7, list(MOTORS)) != replace(injection.draw(2, 7, list(MOTORS)))
    assert len({replace(case, number=0) for case in CASES}) == len(CASES)


def test_a_thousand_cases_have_every_kind_scene_slow_phase_motor_and_load():
    assert {case.kind for case in CASES} == set(injection.BY_NAME)
    assert {case.scene for case in CASES} == set(injection.SCENES)
    assert {case.phase for case in CASES} == set(range(injection.SLOW_PHASES))
    assert {case.motor for case in CASES} == set(MOTORS) and {case.load for case in CASES} == {0.0, 0.25, 0.5, 0.75}
    assert {bool(case.lasts_s) for case in CASES} == {True, False}


def test_a_quarter_of_the_cases_has_another_motor_than_its_header_says_and_some_a_load_that_pulses():
    off, pulses = [case for case in CASES if case.header], [case for case in CASES if case.pulse]
    assert 200 < len(off) < 300 and 110 < len(pulses) < 190
    assert len({case.kind for case in off}) > 0.9 * len(injection.BY_NAME)
    for (_, low, high), factors in zip(injection.HEADER_OFF, zip(*(case.header for case in off))):
        assert low <= min(factors) < low + 0.02 and high - 0.02 < max(factors) <= high
    assert 0.05 <= min(case.pulse for case in pulses) and max(case.pulse for case in pulses) <= 0.3


def test_the_true_motor_is_off_its_header_from_power_up_on_and_its_load_swings_the_speed_by_no_more_than_a_share(bench):
    plain = replace(CASES[0], kind="shaft: blocked", scene="low speed", header=(), pulse=0.0)
    assert set(trial.scene(plain, bench).scenario.plant.values) == {"rng.seed"}
    off = trial.scene(replace(plain, header=(0.7, 1.2, 0.75), pulse=0.3), bench).scenario.plant.values
    assert off["motor.rs_ohm"] == pytest.approx(0.7 * 2.67) and off["motor.psi_vs"] == pytest.approx(1.2 * bench.motor.values.values["motor.psi_vs"])
    assert off["motor.ld_h"] == off["motor.lq_h"] == pytest.approx(0.75 * 1.92e-3)
    omega = 1.4 * bench.library.params["MINIMUM_SPEED_RPM"] * np.pi / 30.0
    swing = off["load.pulse1_nm"] / (bench.motor.values.values["mech.inertia_kgm2"] * omega)
    assert swing == pytest.approx(0.15 * omega)
    fast = trial.scene(replace(plain, scene="rated speed", pulse=0.05), bench).scenario.plant.values
    assert fast["load.pulse1_nm"] == pytest.approx(0.05 * motor_file.load(HURST).rated_torque_nm)


def test_a_shaft_is_held_for_a_hundredth_to_a_second():
    lasts_s = [case.lasts_s for case in CASES if case.kind == "shaft: held and let go"]
    assert len(lasts_s) > 20 and 0.01 <= min(lasts_s) < 0.1 and 0.9 < max(lasts_s) <= 1.0


def test_each_kind_is_drawn_as_often_as_its_weight_says_in_every_stretch():
    counts = Counter(case.kind for case in CASES)
    total = sum(kind.weight for kind in injection.KINDS)
    for name, kind in injection.BY_NAME.items():
        assert abs(counts[name] - 1000.0 * kind.weight / total) <= 2.0 * kind.weight + 1.0, name


def test_every_fault_sets_keys_of_the_board_or_hits_memory_or_a_register(bench):
    rating = injection.Rating(4.0, 0.08, 24.0, 2.67, 8e-3, 8e6)
    for case in CASES:
        for key, value in injection.keys_of(case, rating).items():
            known = bench.library.keys[key]
            assert known.writable and known.minimum <= value <= known.maximum, case
        room = case.kind.partition(":")[0]
        assert injection.keys_of(case, rating) or room in ("RAM", "registers", injection.IMAGE)
    assert {case.place for case in CASES if case.kind.startswith("registers")} <= {name for names in injection.REGISTERS.values() for name in names}


def test_the_codes_that_fit_are_faults_of_the_drive_or_those_that_are_given_out(bench):
    given_out = {"CURRENT_SENSOR", "BUS_SENSOR", "OPEN_PHASE", "POTENTIOMETER", "INTERRUPT_RATE", "OVERTEMPERATURE", "SELFTEST"}
    assert {code for kind in injection.KINDS for code in kind.ends} <= set(bench.library.faults.values()) | given_out


# ---- how an end is judged --------------------------------------------------------------------------------------------------
def running(**signals):
    """Two seconds in closed loop at 1000 rpm and 1 A."""
    return trace(2.0, **{"plant__speed_rpm": 1000.0, "plant__i_q": 1.0, "fw__state": 5.0, "pwm__outputs_seen": 63.0} | signals)


def after(at_s, value, before=0.0):
    return lambda time_s: np.where(time_s >= at_s, value, before)


def verdict(limits=LIMITS, without=None, **signals):
    return judge.judge(running(**signals), without or running(), limits)


def test_a_run_like_the_one_without_the_fault_shows_no_effect():
    assert verdict().outcome == judge.NO_EFFECT
    assert verdict(plant__speed_rpm=after(0.6, 1004.0, 1000.0)).outcome == judge.NO_EFFECT


def test_a_speed_that_a_load_swings_is_judged_over_a_turn():
    rating = injection.Rating(3.0, 0.1, 24.0, 1.0, 0.01, 8e6, 5e-6, 600.0)
    plain = replace(CASES[0], kind="shaft: blocked", pulse=0.0)
    assert trial.mean_s(plain, rating) == judge.MEAN_S and trial.mean_s(replace(plain, pulse=0.1), rating) == 0.1
    assert trial.mean_s(replace(plain, kind="shaft: load that pulses"), rating) == 0.1
    swings = lambda time_s: 1000.0 + 150.0 * np.sin(2.0 * np.pi * 10.0 * time_s) # noqa: E731
    assert verdict(plant__speed_rpm=swings).outcome == judge.SILENT
    assert verdict(replace(LIMITS, mean_s=0.1), plant__speed_rpm=swings).outcome == judge.RIDDEN
    assert verdict(replace(LIMITS, mean_s=0.1), plant__speed_rpm=lambda time_s: 0.93 * swings(time_s)).outcome == judge.SILENT
    for part in (0.25, 0.5, 0.75): # the record ends in any phase of the swing
        ends = functools.partial(lambda part, time_s: swings(time_s + 0.1 * part), part)
        assert verdict(replace(LIMITS, mean_s=0.1), plant__speed_rpm=ends).outcome == judge.RIDDEN
    late = replace(LIMITS, mean_s=0.1, settled_s=1.99)
    assert verdict(late, plant__speed_rpm=after(1.93, 900.0, 1000.0)).outcome == judge.SILENT # what comes last counts


def test_the_mean_of_a_row_is_that_around_it_and_of_the_last_rows_the_last_whole_ones():
    ramp = running(plant__speed_rpm=lambda time_s: 1000.0 * time_s)
    means = judge._smooth(ramp, "plant.speed_rpm", replace(LIMITS, mean_s=0.1))
    inside = (ramp.time_s > 0.06) & (ramp.time_s < 1.94)
    assert means[inside] == pytest.approx(1000.0 * ramp.time_s[inside], abs=1.0)
    assert means[0] == pytest.approx(50.0, abs=1.0) and means[-1] == pytest.approx(1950.0, abs=1.0)


def test_a_load_that_pulses_swings_the_slowest_speed_that_follows_by_its_share(bench):
    for scene, rpm in (("braking", 151.0), ("accelerating", 800.0), ("half speed", 800.0)):
        case = replace(CASES[0], kind="shaft: load that pulses", pulse=0.0, motor=HURST, scene=scene)
        way = trial.scene(case, bench)
        board = SimpleNamespace(get=lambda key: 800.0 if key == "fw.speed_ref_rpm" else 1.0)
        rating = trial.rating_of(bench.library, bench.motor, board, way.last_rpm)
        assert rating.speed_rpm == pytest.approx(1.4 * rpm if scene == "braking" else rpm, rel=0.01)


def test_a_dip_that_is_over_within_a_second_is_ridden_through_and_a_later_one_is_silent():
    dip = lambda end_s: lambda time_s: np.where((time_s > 0.6) & (time_s < end_s), 700.0, 1000.0) # noqa: E731
    assert verdict(plant__speed_rpm=dip(1.4)).outcome == judge.RIDDEN
    late = verdict(plant__speed_rpm=dip(1.6))
    assert late.outcome == judge.SILENT and "speed off by up to 300 rpm" in late.why


def test_a_fault_of_the_drive_stops_with_the_right_code_or_with_another():
    stop = {"fw__state": after(0.7, 7.0, 5.0), "pwm__outputs_seen": after(0.7, 0.0, 63.0), "plant__speed_rpm": after(0.7, 0.0, 1000.0)}
    right = verdict(fw__fault=after(0.7, 6.0), **stop)
    assert (right.outcome, right.code, right.after_s) == (judge.RIGHT, "STALL", pytest.approx(0.2, abs=1e-4))
    other = verdict(fw__fault=after(0.7, 3.0), **stop)
    assert (other.outcome, other.code) == (judge.ANOTHER, "OVERVOLTAGE")


def test_a_code_before_the_injection_is_none():
    cleared = {"fw__fault": lambda time_s: np.where(time_s < 0.6, 6.0, 0.0), "fw__state": after(0.6, 5.0, 7.0)}
    assert judge.judge(running(**cleared), running(**cleared), LIMITS).outcome == judge.NO_EFFECT


@pytest.mark.parametrize("signals, outcome", [({}, judge.NO_EFFECT), ({"plant__speed_rpm": after(0.6, 900.0, 1000.0)}, judge.SILENT)])
def test_two_recordings_of_which_one_is_thinned_are_compared_row_by_row(signals, outcome):
    with_fault, without = running(**signals), running()
    assert judge.judge(with_fault.thinned(3), without, LIMITS).outcome == judge.judge(with_fault, without.thinned(9), LIMITS).outcome == outcome


def test_a_drive_that_cannot_leave_an_earlier_fault_says_so_and_is_not_silent():
    cleared = {"fw__fault": lambda time_s: np.where(time_s < 0.8, 6.0, 0.0), "fw__state": after(0.8, 5.0, 7.0), "pwm__outputs_seen": after(0.8, 63.0)}
    kept = {"fw__fault": 6.0, "fw__state": 7.0, "pwm__outputs_seen": 0.0, "plant__speed_rpm": 0.0}
    found = judge.judge(running(**kept), running(**cleared), LIMITS)
    assert (found.outcome, found.code, found.after_s) == (judge.ANOTHER, "STALL", None)
    assert judge.judge(running(**kept), running(**kept), LIMITS).outcome == judge.NO_EFFECT


@pytest.mark.parametrize("signals, why", [
    ({"pwm__outputs_seen": after(1.0, 0.0, 63.0)}, "stops without a code"),
    ({"plant__speed_rpm": after(0.6, -300.0, 1000.0)}, "turns backwards"),
    ({"plant__i_q": after(0.6, 4.6, 1.0)}, "too much current"),
    ({"plant__speed_rpm": after(0.6, 900.0, 1000.0)}, "speed off by up to 100 rpm"),
    ({"plant__speed_rpm": lambda time_s: 1000.0 + 70.0 * np.sin(2.0 * np.pi * 5.0 * time_s)}, "speed off by up to"),
    ({"fw__fault": after(0.7, 6.0)}, "the outputs stay on")])
def test_what_goes_wrong_without_a_stop_is_silent(signals, why):
    found = verdict(**signals)
    assert found.outcome == judge.SILENT and why in found.why


def test_a_motor_that_turns_where_it_should_stand_is_silent():
    standing = running(pwm__outputs_seen=0.0, plant__speed_rpm=0.0, fw__state=1.0)
    assert judge.judge(running(), standing, LIMITS).why == "runs where it should stand"


def test_too_little_speed_is_right_where_the_drive_names_the_limit_and_the_kind_allows_it():
    slow = {"plant__speed_rpm": after(0.6, 900.0, 1000.0)}
    allowed = replace(LIMITS, limited_is_right=True)
    assert verdict(allowed, fw__limits=1.0, **slow).outcome == judge.RIDDEN
    assert verdict(LIMITS, fw__limits=1.0, **slow).outcome == judge.SILENT
    assert verdict(allowed, fw__limits=32.0, **slow).outcome == judge.SILENT # field weakening alone holds nothing back
    assert verdict(allowed, **slow).outcome == judge.SILENT


def test_a_start_that_waits_for_a_rotor_which_the_load_drives_too_fast_says_so_and_is_not_silent():
    allowed = replace(LIMITS, limited_is_right=True)
    waits = {"pwm__outputs_seen": after(0.6, 0.0, 63.0), "plant__speed_rpm": after(0.6, 5000.0, 1000.0)}
    assert verdict(allowed, fw__limits=after(0.7, 128.0), **waits).outcome == judge.RIDDEN
    for limits, named in ((LIMITS, after(0.7, 128.0)), (allowed, after(0.7, 1.0)), (allowed, 0.0)):
        assert verdict(limits, fw__limits=named, **waits).why == "stops without a code"


def test_a_speed_that_is_off_by_as_much_as_no_firmware_can_know_is_a_class_of_its_own():
    clock = replace(LIMITS, unseen=judge.Unseen(clock=1.1))
    assert verdict(clock, plant__speed_rpm=after(0.6, 1100.0, 1000.0)).outcome == judge.UNKNOWABLE
    assert verdict(clock, plant__speed_rpm=after(0.6, 1070.0, 1000.0)).outcome == judge.UNKNOWABLE # a limit holds some of it back
    for rpm in (1200.0, 900.0): # more than the clock is off, and to the other side
        assert verdict(clock, plant__speed_rpm=after(0.6, rpm, 1000.0)).outcome == judge.SILENT
    assert verdict(clock).outcome == judge.NO_EFFECT
    assert verdict(clock, plant__speed_rpm=after(0.6, -1100.0, 1000.0)).why == "turns backwards"
    assert verdict(clock, plant__speed_rpm=after(0.6, 1100.0, 1000.0), plant__i_q=after(0.6, 8.0, 1.0)).outcome == judge.SILENT
    falls = lambda clock, time_s: 1000.0 - 400.0 * clock * np.maximum(time_s - 0.5, 0.0) # noqa: E731 and its ramps are as slow
    braking = running(plant__speed_rpm=functools.partial(falls, 1.0))
    for share, outcome in ((0.9, judge.UNKNOWABLE), (0.7, judge.SILENT)):
        slow = replace(LIMITS, unseen=judge.Unseen(clock=0.9))
        assert verdict(slow, braking, plant__speed_rpm=functools.partial(falls, share)).outcome == outcome
    more = replace(LIMITS, unseen=judge.Unseen(more_rpm=50.0))
    assert verdict(more, plant__speed_rpm=after(0.6, 1100.0, 1000.0)).outcome == judge.UNKNOWABLE # 56 + 50 rpm
    assert verdict(more, plant__speed_rpm=after(0.6, 1110.0, 1000.0)).outcome == judge.SILENT


def test_a_start_with_as_much_current_as_an_unknown_resistance_hides_cannot_be_known_and_closed_loop_can():
    start = replace(LIMITS, unseen=judge.Unseen(start_current=1.5))
    much = {"plant__i_q": after(0.6, 6.0, 1.0)}
    ramp = running(fw__state=4.0, plant__i_q=4.0)
    assert verdict(start, ramp, fw__state=4.0, **much).outcome == judge.UNKNOWABLE
    assert verdict(start, ramp, **much).outcome == judge.SILENT and verdict(start, ramp, fw__state=4.0, plant__i_q=after(0.6, 7.0, 1.0)).outcome == judge.SILENT
    assert verdict(start, running(fw__state=4.0), fw__state=4.0, **much).outcome == judge.SILENT # 1.5 times little is less than the header allows


def test_a_rotor_that_the_load_drove_backwards_before_the_start_may_be_caught_and_reversed_and_no_other():
    def verdict_of(**signals):
        on = {"pwm__outputs_seen": after(0.6, 63.0), "fw__state": after(0.6, 5.0, 1.0)}
        return judge.judge(running(**on, **signals), running(**on, plant__speed_rpm=after(0.6, 1000.0)), LIMITS)
    back_until = lambda end_s, begin_s=0.0: lambda time_s: np.where(time_s < begin_s, 0.0, np.where(time_s < end_s, -600.0, 1000.0)) # noqa: E731
    assert verdict_of(plant__speed_rpm=back_until(1.2)).outcome == judge.RIDDEN
    assert verdict_of(plant__speed_rpm=back_until(1.2, 0.61)).why == "turns backwards"
    again = lambda time_s: np.where((time_s > 0.9) & (time_s < 1.1), -600.0, back_until(0.8)(time_s)) # noqa: E731
    assert verdict_of(plant__speed_rpm=again).why == "turns backwards"
    recoils = lambda time_s: np.where(time_s < 0.62, -10.0, back_until(1.2)(time_s)) # noqa: E731
    assert verdict_of(plant__speed_rpm=recoils).why == "turns backwards" # it stood, but for a hair


def test_a_start_has_a_ramp_more_where_the_load_drives_the_rotor_backwards(bench):
    params = bench.library.params
    driven = next(case for case in CASES if case.kind == "shaft: driven by the load" and case.size < 0.0)
    assert trial.reversal_s(driven, "STOPPED", params) == trial.start_time_s(params) > 1.0
    other = next(case for case in CASES if case.kind == "shaft: load step")
    for case, state in ((driven, "CLOSED"), (driven, "STOPPING"), (replace(driven, size=0.5), "STOPPED"), (other, "STOPPED")):
        assert trial.reversal_s(case, state, params) == 0.0


@pytest.mark.parametrize("clock, way_end_s, at_s", [(1.0, 3.0, 3.0), (0.75, 3.0, 3.667), (1.25, 3.0, 3.0), (0.75, 0.5, 2.6)])
def test_a_slow_clock_is_judged_when_its_longer_way_is_over(clock, way_end_s, at_s):
    case = SimpleNamespace(over_s=0.2, lasts_s=0.4)
    assert judge.SETTLE_S == 1.0 and trial.settled(case, way_end_s, 1.0, clock) == pytest.approx(at_s, abs=1e-3)


def test_what_cannot_be_known_is_a_wrong_clock_and_a_ripple_as_dead_time_makes_it(bench):
    rating = injection.Rating(3.0, 0.1, 24.0, 1.0, 0.01, 8e6, dead_rpm=trial.dead_rpm(bench.library.params))
    assert rating.dead_rpm == pytest.approx(0.13 * 24.0 * 2.0 / 50.0 * 3.0 ** 0.5 * 1000.0 / 7.24, rel=1e-3)
    unseen = {name: kind.unseen(1.2, rating) for name, kind in injection.BY_NAME.items() if kind.unseen(1.2, rating) != judge.Unseen()}
    kinds = ("sensors: current reads zero", "sensors: current offset", "sensors: current offset drifts", "sensors: current gain", "sensors: current noise",
             "power stage: transistor never turns on")
    assert unseen == dict.fromkeys(kinds, judge.Unseen(more_rpm=0.5 * np.pi * rating.dead_rpm)) | {"clock: crystal off frequency": judge.Unseen(clock=1.2)}
    lost = injection.BY_NAME["interrupts: some lost"]
    seen = re.search(r"LEAST_TICKS PARAM_PERIODS\(([\d.]+)F\)", (paths.ROOT / "firmware/board/firmware.c").read_text(encoding="utf-8"))[1]
    assert injection.LOST_UNSEEN == pytest.approx(1.0 - float(seen) / 0.1)
    assert [lost.unseen(size, rating).clock for size in (0.02, 0.03, 0.031, 0.5)] == pytest.approx([0.98, 0.97, 1.0, 1.0])
    assert param_rows.number("PARAM_RS_MOST") == pytest.approx(injection.MOST_RESISTANCE - 1.0)
    gain = injection.BY_NAME["sensors: current gain"]
    assert [gain.unseen(size, rating).start_current for size in (1.5, 0.8, 0.625, 0.3)] == pytest.approx([1.0, 1.25, 1.6, 1.6])
    rating = replace(rating, start_dead=0.5)
    assert [gain.unseen(size, rating).start_current for size in (0.5, 0.3)] == pytest.approx([2.0, 2.1])
    params = bench.library.params
    assert trial.start_dead(params) == pytest.approx(24.0 * 2.0 / 50.0 / (params["MOTOR_RS_OHM"] * params["Q_CURRENT_REF_OPENLOOP"]), rel=1e-3)
    assert param_rows.number("GATE_SHARE") == trial.DEAD_SHARE


def test_the_campaigns_header_is_the_tuners_with_a_potentiometer_that_has_live_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign, "HEADERS", tmp_path / "results")
    header = tmp_path / "motor"
    header.mkdir()
    (header / "userparams.h").write_text("#define OTHER 1\n#define POT_LIVE_ZERO 0.0 /* [1] */\n", encoding="utf-8")
    copy = campaign.with_live_zero(header) / "userparams.h"
    assert copy.read_text(encoding="utf-8") == "#define OTHER 1\n#define POT_LIVE_ZERO 0.05 /* [1] */\n"
    (header / "userparams.h").write_text("#define OTHER 1\n", encoding="utf-8")
    with pytest.raises(campaign.UserError, match="POT_LIVE_ZERO is missing"):
        campaign.with_live_zero(header)


def test_a_moment_of_more_current_is_allowed_and_more_than_a_moment_is_not():
    peak = lambda width_s: lambda time_s: np.where((time_s > 0.6) & (time_s < 0.6 + width_s), 8.0, 1.0) # noqa: E731
    assert verdict(plant__i_q=peak(0.004)).outcome == judge.RIDDEN
    assert verdict(plant__i_q=peak(0.006)).why == "too much current"


def test_a_recoil_of_a_part_of_a_turn_is_no_turning_backwards():
    back = lambda for_s: lambda time_s: np.where((time_s > 0.6) & (time_s < 0.6 + for_s), -600.0, 1000.0) # noqa: E731
    assert verdict(plant__speed_rpm=back(0.04)).outcome == judge.RIDDEN # 0.4 turns
    assert verdict(plant__speed_rpm=back(0.06)).why == "turns backwards"
    assert verdict(plant__speed_rpm=back(0.06), fw__state=3.0).outcome == judge.RIDDEN # while it is aligned it may


def test_a_comparison_that_trips_by_itself_is_none():
    found = judge.judge(running(), running(fw__fault=after(0.8, 6.0)), LIMITS)
    assert found.outcome == judge.VOID and "STALL" in found.why


# ---- a case on the virtual board ---------------------------------------------------------------------------------------------
def alone(case, bench):
    """In a process of its own, as the command does it."""
    return workers.run_all([case], lambda case, tell: trial.run(case, bench).row(), lambda seconds: None)[0]


def case_of(kind, **more):
    found = next(case for case in CASES if case.kind == kind)
    return replace(found, motor=HURST, **{"scene": "half speed", "load": 0.5, "over_s": 0.0, "lasts_s": 0.0} | more)


@pytest.mark.parametrize("scene", injection.SCENES)
def test_a_fault_comes_in_its_scene_and_slow_phase(bench, scene):
    """A bus that stays stuck where it is changes nothing, so the whole way is seen."""
    row = alone(case_of("sensors: bus stuck at its value", scene=scene, phase=5, part=0.5), bench)
    assert row["state"] == {"retry": "FAULT"}.get(scene, scene if scene.isupper() else "CLOSED") and row["class"] in (judge.NO_EFFECT, judge.RIDDEN), row


def test_the_same_case_ends_the_same_way_twice(bench):
    case = case_of("interrupts: some lost", size=0.2)
    assert alone(case, bench) == alone(case, bench)


def test_a_sensor_at_the_rail_stops_at_once_and_is_named(bench):
    row = alone(case_of("sensors: current stuck at a rail", size=3.0), bench)
    assert row["class"] == judge.RIGHT and row["after_s"] < 0.001 and row["current_peak_a"] > 0.0


def test_every_bit_of_the_firmwares_memory_has_a_name_and_flips_once(bench):
    drive, *others = bench.memory
    assert drive.name == memory.DRIVE and drive.size > 200 and {"app_panel"} <= {item.name for item in others}
    assert "written" not in {item.name for item in others} # what registers must hold is in flash
    assert all(item.size > 0 for item in others) and not [item for item in others if item.name.startswith("vb_")]
    code = ("import ctypes, sys; from tools.bench import memory; from tools.bench.board import Library; from pathlib import Path; "
            "library = Library(Path(sys.argv[1])); area = memory.variables(library)[:1]; size = area[0].size; "
            "view = (ctypes.c_uint8 * size).in_dll(library.c, 'board_drive'); before = bytes(view); "
            "names = [memory.flip(library, area, (bit + 0.5) / (8 * size)) for bit in range(8 * size)]; "
            "assert len(set(names)) == 8 * size and bytes(view) == bytes(255 - byte for byte in before)")
    assert subprocess.run([sys.executable, "-c", code, str(LIBRARY)], check=False, cwd=Path(__file__).parents[2]).returncode == 0


class FakeCore:
    """The simulator's memory, as memory.Core asks for it."""

    def __init__(self):
        self.words, self.data = [memory.ERASED] * memory.FLASH_WORDS, dict.fromkeys(range(0, 0x1000, 2), 0)
        self.words[0x100:0x104] = [0x040000, 0x123456, 0x0F0F0F, 0x111111]
        self.library, self.c, self._vb = self, self, None

    def declare(self, *rows):
        assert all(hasattr(self, name) for name, _, _ in rows)

    def vb_iss_core(self, board):
        return self

    def iss_program(self, core):
        return self.words

    def iss_write_program(self, core, address, word):
        self.words[address // 2] = word
        return True

    def iss_peek(self, core, address):
        return self.data[address]

    def iss_poke(self, core, address, value):
        self.data[address] = value


def test_every_programmed_bit_of_flash_and_every_bit_of_used_ram_can_be_hit_once():
    fake = FakeCore()
    core, before = memory.Core(fake, 0x0900), list(fake.words)
    names = [core.flip_flash((bit + 0.5) / 96.0) for bit in range(96)]
    assert len(set(names)) == 96 and names[0] == "flash 0x0200 bit 0" and names[-1] == "flash 0x0206 bit 23"
    assert sum((one ^ other).bit_count() for one, other in zip(before, fake.words)) == 96
    fake.data[memory.STACK_POINTER] = 0x0910
    for stack, start in ((True, 0x0900), (False, memory.RAM_START)):
        bits = 8 * (0x0910 - start)
        assert len({core.flip_ram((bit + 0.5) / bits, stack) for bit in range(bits)}) == bits
        assert {address for address, value in fake.data.items() if value == 0xFFFF} == set(range(start, 0x0910, 2)) - (
            set() if stack else set(range(0x0900, 0x0910, 2))) # what both hit is as it was


def test_cases_of_the_image_are_left_out_in_one_line_without_a_compiler(hurst, tmp_path, monkeypatch):
    monkeypatch.setattr(campaign, "worst", lambda rows: [])
    numbers = [n for n in range(1, 200) if injection.draw(1, n, [HURST]).what.room == injection.IMAGE][:2]
    code, out, _ = call("--case", *map(str, numbers), "--out", str(tmp_path / "out"))
    assert code == 0 and out.count("left out, there is no XC16") == 1 and rows_of(tmp_path / "out") == []


def test_a_firmware_that_crashes_is_silent_and_one_that_hangs_is_left_to_the_watchdog(monkeypatch):
    monkeypatch.setattr(trial, "HANG_S", 1)
    for work, outcome in ((lambda: os.kill(os.getpid(), signal.SIGKILL), judge.SILENT), (lambda: [None for _ in iter(int, 1)], judge.ANOTHER)):
        result, ending = trial._aside(work)
        assert result is None and trial._ended(ending).outcome == outcome
    assert trial._aside(lambda: "well") == ("well", 0)


# ---- the command -------------------------------------------------------------------------------------------------------------
def call(*arguments):
    return command("campaign", "--quiet", *arguments)


def rows_of(folder):
    return list(csv.DictReader((folder / "cases.csv").open(encoding="utf-8")))


def test_a_campaign_leaves_a_line_for_each_case_a_table_and_a_page(hurst, tmp_path):
    code, out, _ = call("--count", "24", "--kind", "supply", "--out", str(tmp_path / "out"))
    rows = rows_of(tmp_path / "out")
    numbers = [number for number in range(1, 25) if injection.draw(1, number, [HURST]).kind.startswith("supply")]
    assert [int(row["case"]) for row in rows] == numbers != [] and {row["class"] for row in rows} <= set(judge.CLASSES) and code == 0, out
    assert (tmp_path / "out" / "index.html").is_file() and not (tmp_path / "out.part").exists()
    assert sum(json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["classes"].values()) == len(rows)


def test_a_fault_that_nothing_can_detect_is_wrong_and_silent_and_fails_the_command(hurst, tmp_path, monkeypatch):
    """Planted: a potentiometer stuck in the middle of its travel, which is a position like any other."""
    planted = case_of("sensors: potentiometer wire", size=4.0)
    monkeypatch.setattr(injection, "draw", lambda seed, number, motors: replace(planted, number=number))
    code, out, _ = call("--count", "1", "--out", str(tmp_path / "out"))
    row, = rows_of(tmp_path / "out")
    assert code == 1 and row["class"] == judge.SILENT and row["code"] == "" and "wrong and silent: case 1, sensors: potentiometer wire 4" in out
    assert call("--case", "1", "--out", str(tmp_path / "alone"))[0] == 1


def test_one_case_alone_gives_its_whole_report_beside_the_run_without_the_fault(hurst, tmp_path):
    number = next(n for n in range(1, 200) if injection.draw(1, n, [HURST]).kind == "sensors: current stuck at a rail")
    code, out, _ = call("--case", str(number), "--out", str(tmp_path / "out"))
    assert code == 0 and "FAULT INJECTED: sensors: current stuck at a rail" in out and f"stopped, right code: case {number}" in out
    assert all((tmp_path / "out" / name).is_file() for name in ("index.html", "trace.csv", "without/index.html"))


def test_an_interrupted_campaign_goes_on_with_the_cases_that_are_missing(hurst, tmp_path, monkeypatch):
    ran = []
    whole = trial.run

    def counted(case, bench, tell=lambda seconds: None):
        (tmp_path / "ran").open("a", encoding="utf-8").write(f"{case.number}\n")
        if stop_at is not None and case.number >= stop_at:
            raise campaign.UserError("interrupted", "test")
        return whole(case, bench, tell)

    monkeypatch.setattr(trial, "run", counted)
    monkeypatch.setattr(campaign, "worst", lambda rows, most=0: [])
    arguments = ("--case", "1", "2", "3", "4", "5", "6", "--out", str(tmp_path / "out"))
    stop_at = 4
    assert call(*arguments)[0] == 2 and not (tmp_path / "out").exists()
    stop_at = None
    (tmp_path / "ran").unlink()
    code, out, _ = call(*arguments)
    ran = sorted({int(line) for line in (tmp_path / "ran").read_text(encoding="utf-8").split()})
    done = [number for number in range(1, 7) if number not in ran]
    assert done and set(ran) >= {4, 5, 6} and f"{len(done)} of 6 cases are there already" in out, (ran, out)
    assert [int(row["case"]) for row in rows_of(tmp_path / "out")] == [1, 2, 3, 4, 5, 6] and code in (0, 1)


def test_a_half_written_line_and_lines_of_another_firmware_are_not_used(tmp_path):
    part = draws.Part(tmp_path / "out", {"seed": 1}, "case")
    assert part.rows() == {}
    part.add(dict.fromkeys(campaign.KEYS, "a \"quoted\", text") | {"case": 3, "after_s": None, "size": 0.5})
    with (part.folder / draws.PART_FILE).open("a", encoding="utf-8") as file:
        file.write('{"case": 4, "kind": "half')
    part.add({"case": 5})
    assert list(part.rows()) == [3, 5] and part.rows()[3]["why"] == "a \"quoted\", text" and part.rows()[3]["after_s"] is None
    assert draws.Part(tmp_path / "out", {"seed": 2}, "case").rows() == {}


def test_the_worst_are_the_silent_ones_one_of_each_kind_first_then_the_slowest_stops():
    kinds = list(injection.BY_NAME)
    rows = [{"case": n, "kind": kinds[kind], "class": outcome, "after_s": after_s} for n, (kind, outcome, after_s) in enumerate((
        (0, judge.SILENT, None), (0, judge.SILENT, None), (1, judge.SILENT, None), (2, judge.RIGHT, 0.2), (2, judge.RIGHT, 0.9), (2, judge.NO_EFFECT, None)))]
    assert [row["case"] for row in campaign.worst(rows)] == [0, 2, 1, 4, 3]


@pytest.mark.parametrize("arguments, says", [
    (["--count", "0"], "--count"), (["--case", "-1"], "--case"), (["--count", "many"], "invalid int value"), (["--kind", "nonsense"], "--kind"),
    (["--motor", "nosuch"], "nosuch")])
def test_bad_input_is_refused_in_one_line(arguments, says, monkeypatch, bench):
    if "--motor" not in arguments:
        monkeypatch.setattr(campaign, "prepared", lambda names: {HURST: bench})
    code, _, line = call(*arguments)
    assert code == 2 and says in line and line.count("\n") == 1
