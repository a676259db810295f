"""A shaft that is held and let go: what is asked of a motor, what is measured, and what makes a row fail."""

from dataclasses import replace

import pytest
from support import LIBRARY, run, small_sweep, step

from tools.bench import cli, held_sweep
from tools.bench.board import Library
from tools.bench.held_sweep import Case, Held, Table
from tools.common import board_file, motor_file, paths
from tools.common.errors import UserError

HURST = "hurst_dmb0224c10002"
TABLE = Table.read(paths.TABLES / "held.toml")
ITEM = Case(1400.0, 0.04, 9.0, 0.1, 90.0)


def sweep(**changes):
    return Held(replace(TABLE, **changes), motor_file.part(HURST), board_file.part("mclv"), Library(LIBRARY))


# ---- what is asked -------------------------------------------------------------------------------------------------------
def test_ten_milliseconds_to_a_second_are_asked_for_at_every_speed_loaded_and_not_with_every_inertia_and_all_angles_in_turn():
    bench = sweep()
    assert bench.speeds_rpm() == [280.0, 560.0, 1400.0, 2800.0, 4150.0] and (min(TABLE.holds_s), max(TABLE.holds_s)) == (0.01, 1.0)
    assert len([hold for hold in TABLE.holds_s if 0.08 <= hold <= 0.2]) >= 5 and TABLE.inertia_factors == [1.0, 9.0, 36.0]
    cases = bench.cases()
    assert len(cases) == 5 * 2 * 3 * len(TABLE.holds_s) and {item.angle_deg for item in cases} == {0.0, 90.0, 180.0, 270.0}
    assert {item.angle_deg for item in cases if item.rpm == 1400.0 and item.torque_nm and item.inertia == 9.0} == {0.0, 90.0, 180.0, 270.0}
    bench.ask(cli._parser().parse_args(["held", "--full"]))
    assert len(bench.cases()) == 4 * len(cases) and len(set(bench.cases())) == 4 * len(cases)


def test_the_load_is_half_of_the_rated_torque_or_what_voltage_and_current_give():
    bench = sweep()
    assert bench.torque_nm(1400.0) == 0.04 and 0.0 < bench.torque_nm(4150.0) < 0.02
    assert sweep(torque_percent=1000.0).torque_nm(280.0) < 0.85 * 2.75 * 0.0599


def test_the_shaft_is_held_with_its_inertia_and_load_at_the_angle_and_let_go_in_one_step():
    bench, motor = sweep(), motor_file.load(HURST)
    job, plain = bench.job(ITEM), bench.job(replace(ITEM, angle_deg=0.0))
    locks = [(action.at_s, action.keys["load.locked"]) for action in job.actions if "load.locked" in action.keys]
    held_s = job.scenario.measures[0].from_s
    assert locks == [(held_s, 1.0), (pytest.approx(held_s + 0.1), 0.0)]
    assert held_s - plain.scenario.measures[0].from_s == pytest.approx(0.25 * 60.0 / 1400.0 / motor.pole_pairs)
    inertia, = (action.keys["mech.inertia_kgm2"] for action in job.actions if "mech.inertia_kgm2" in action.keys)
    brake = [action.keys["load.constant_nm"] for action in job.actions if "load.constant_nm" in action.keys]
    assert inertia == pytest.approx(9.0 * motor.inertia_kgm2) and brake[-1] == 0.04
    assert job.scenario.duration_s == pytest.approx(held_s + 0.1 + bench.allowed_s(ITEM) + held_sweep.WATCH_S)
    assert bench.allowed_s(replace(ITEM, inertia=360.0)) > bench.allowed_s(ITEM)


def test_no_more_than_a_hundred_rpm_or_four_per_cent_of_rated_are_allowed_backwards():
    assert sweep().most_back_rpm == pytest.approx(112.0) and sweep(back_rpm=200.0).most_back_rpm == 200.0


# ---- what is drawn -------------------------------------------------------------------------------------------------------
def drawn(*arguments):
    bench = sweep()
    bench.ask(cli._parser().parse_args(["held", *arguments]))
    return bench.cases()


def test_a_number_always_draws_the_same_hold_and_another_number_or_seed_another():
    first = drawn("--draw", "3", "--seed", "7")
    assert len(first) == 3 and drawn("--case", "2", "--seed", "7") == [first[1]] and len(set(first)) == 3
    assert drawn("--draw", "3", "--seed", "8")[1] != first[1]


def test_three_hundred_holds_have_every_speed_load_inertia_and_length_and_a_motor_that_its_header_does_not_know():
    cases = drawn("--draw", "300")
    assert min(item.rpm for item in cases) < 300.0 and max(item.rpm for item in cases) > 3900.0
    assert min(item.hold_s for item in cases) < 0.012 and max(item.hold_s for item in cases) > 0.9
    assert {item.torque_nm == 0.0 for item in cases} == {item.brake_nm == 0.0 for item in cases} == {item.again_s == 0.0 for item in cases} == {True, False}
    assert sum(item.inertia == 1.0 for item in cases) > 100 and max(item.inertia for item in cases) > 30.0
    for name, part in (("R", 0.3), ("L", 0.25), ("Kphi", 0.2)):
        factors = [getattr(item, name) for item in cases]
        assert 1.0 - part <= min(factors) < 1.0 - 0.95 * part and 1.0 + 0.95 * part < max(factors) <= 1.0 + part


def test_a_drawn_hold_is_a_brake_twice_with_another_motor():
    bench, motor = sweep(), motor_file.load(HURST)
    job = bench.job(replace(ITEM, R=1.2, Kphi=0.9, brake_nm=0.3, again_s=0.2, number=4))
    held_s = job.scenario.measures[0].from_s
    brakes = [(action.at_s - held_s, action.keys["load.constant_nm"]) for action in job.actions if "load.constant_nm" in action.keys and action.at_s >= held_s]
    assert [at_s for at_s, _ in brakes] == pytest.approx([0.0, 0.1, 0.3, 0.4]) and [nm for _, nm in brakes] == [0.3, 0.04, 0.3, 0.04]
    assert not [action for action in job.actions if "load.locked" in action.keys]
    assert job.values["motor.rs_ohm"] == pytest.approx(1.2 * motor.rs_ohm) and ITEM.until_s == 0.1
    plain = bench.job(ITEM).values
    assert job.values["motor.psi_vs"] == pytest.approx(0.9 * plain["motor.psi_vs"]) and job.values["motor.ld_h"] == plain["motor.ld_h"]
    assert job.scenario.duration_s == pytest.approx(held_s + 0.4 + bench.allowed_s(ITEM) + held_sweep.WATCH_S)


@pytest.mark.parametrize("arguments, says", [(["--draw", "0"], "0 is no number of holds or of a hold"), (["--case", "0"], "0 is no number of holds")])
def test_a_number_that_draws_nothing_is_refused_in_one_line(arguments, says):
    with pytest.raises(UserError, match=says):
        drawn(*arguments)


def test_the_table_of_drawn_holds_says_how_many_are_well_and_what_followed():
    bench = sweep()
    bench.ask(cli._parser().parse_args(["held", "--draw", "3", "--seed", "5"]))
    rows = [ROW | {"verdict": "ok"}, ROW | {"verdict": "ok", "fault": "STALL"}, ROW | {"verdict": "backwards", "backwards_rpm": 300.0}]
    assert bench.text(rows) == "2 of 3 drawn holds are well, seed 5: 2 back at the speed, 1 stopped by name; at most 300 rpm backwards"


# ---- what is measured ----------------------------------------------------------------------------------------------------
def recorded(speed, *, state=step((0, 4), (0.2, 5)), fault=0.0, limits=0.0):
    return run('[[measure]]\nname = "measured"\nfrom_s = 0.5\nto_s = 2.0\n', plant__speed_rpm=speed, fw__speed_ref_rpm=1400.0, fw__state=state, fw__fault=fault,
               fw__limits=limits)


def test_the_speed_backwards_and_the_time_to_the_reference_are_read_from_the_run():
    found = sweep().measured(recorded(step((0, 1400), (0.5, 0), (0.6, -300), (0.7, 1000), (0.9, 1400))), ITEM)
    assert (found["backwards_rpm"], found["fault"], found["turned"]) == (300.0, None, True)
    assert found["back_s"] == pytest.approx(0.3, abs=0.05) # within 5 per cent, its mean over 0.1 s
    bare = replace(ITEM, inertia=1.0)
    assert sweep().measured(recorded(step((0, 1400), (0.5, 0), (0.6, 1360))), bare)["back_s"] is None
    assert sweep().measured(recorded(step((0, 1400), (0.5, 0), (0.6, 1360))), ITEM)["back_s"] is not None
    assert not sweep().measured(recorded(1400.0, state=4), ITEM)["turned"]


def test_a_motor_whose_voltage_gave_less_than_the_reference_must_be_back_at_what_it_had():
    slow = step((0, 1300), (0.5, 0), (0.7, 1300))
    assert sweep().measured(recorded(slow), ITEM)["back_s"] is None
    assert sweep().measured(recorded(slow, limits=step((0, 2), (0.5, 0))), ITEM)["back_s"] == pytest.approx(0.1, abs=0.05)
    assert sweep().measured(recorded(step((0, 1300), (0.5, 0), (0.7, 1200)), limits=2.0), ITEM)["back_s"] is None


def test_a_fault_is_told_with_its_time_from_the_release():
    found = sweep().measured(recorded(step((0, 1400), (0.5, 0)), fault=step((0, 0), (0.55, 6))), ITEM)
    assert (found["fault"], found["fault_s"]) == ("STALL", pytest.approx(-0.05, abs=1e-3))
    assert held_sweep.afterwards(found) == "stopped: STALL after -0.05 s"


ROW = {"turned": True, "backwards_rpm": 50.0, "fault": None, "fault_s": None, "back_s": 0.3}


@pytest.mark.parametrize("changes, text, after", [
    ({}, "ok", "at the reference after 0.30 s"), ({"backwards_rpm": 113.0}, "backwards", "at the reference"), ({"backwards_rpm": 112.0}, "ok", "at the reference"),
    ({"fault": "STALL", "fault_s": -0.2, "back_s": None}, "ok", "stopped: STALL after -0.20 s"), ({"fault": "STALL", "fault_s": 0.31}, "late", "stopped: STALL"),
    ({"fault": "STALL", "fault_s": 0.1, "backwards_rpm": 300.0}, "backwards", "stopped"), ({"back_s": None}, "not back", "never at the reference"),
    ({"back_s": 99.0}, "not back", "at the reference after 99"), ({"turned": False}, "not at the speed: no closed loop", "at")])
def test_each_way_to_fail_is_named(changes, text, after):
    row = ROW | changes
    row |= {"verdict": sweep().verdict(ITEM, row), "afterwards": held_sweep.afterwards(row)}
    outcome, = sweep().check(ITEM, row)
    assert row["verdict"] == text and row["afterwards"].startswith(after) and outcome.ok == (text == "ok") and row["afterwards"] in outcome.got


def test_a_line_of_the_table_has_the_worst_angle_of_each_hold():
    rows = [ROW | {"name": "1400 rpm", "hold_s": hold_s, "backwards_rpm": rpm, "verdict": verdict}
            for hold_s, rpm, verdict in ((0.1, 50.0, "ok"), (0.1, 10.0, "not back"), (0.2, 20.0, "ok"), (0.2, 30.0, "ok"))]
    line = next(line for line in sweep().text(rows).splitlines() if line.startswith("1400 rpm"))
    assert line.split("  ", 1)[1].split() == ["!10", "0.30", "30", "0.30"]


# ---- for the user --------------------------------------------------------------------------------------------------------
def test_a_hold_in_full(tmp_path, monkeypatch):
    code, out, error, data, rows = small_sweep(tmp_path, monkeypatch, "held", speeds_percent="[50]", torque_percent="0", inertia_factors="[1]", holds_s="[1.0]",
                                               weakened_percent="0")
    assert (code, error) == (0, ""), out
    assert [(row["fault"], row["verdict"]) for row in rows if row["reference_rpm"] == "1400.0"] == [("STALL", "ok")] and data["passed"]
    assert rows[0]["afterwards"].startswith("stopped: STALL after -0.7")

