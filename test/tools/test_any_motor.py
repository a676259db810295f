"""The sweep over drawn motors and boards: what is drawn, what counts, and a few cases from file to turning motor."""

import csv
import functools
import json
from dataclasses import replace
from pathlib import Path

import pytest
from support import command

from tools.common import board_file, motor_file
from tuning import any_motor, cli, design, drawn, start

CASES = [drawn.draw(9, number) for number in range(1, 201)]
tuner = functools.partial(command, main=cli.main)
NUMBERS = [1, 2, 3, 4, 5, 6, 7, 9, 13, 16, 27, 102, 115, 265, 279]


def files(case: drawn.Case, folder: Path) -> tuple[motor_file.Motor, board_file.BoardFile]:
    motor, board = case.write(folder)
    return motor_file.load(str(motor)), board_file.load(str(board))


def test_a_number_always_draws_the_same_case_and_another_number_or_seed_another():
    assert drawn.draw(1, 7) == drawn.draw(1, 7)
    assert len({case.motor for case in CASES}) == len(CASES)
    assert drawn.draw(1, 7).motor != drawn.draw(2, 7).motor


def test_a_rotor_that_still_swings_after_the_longest_lock_is_handed_over_with_less_current_or_at_a_higher_speed(tmp_path):
    motor, board = files(drawn.draw(1, 102), tmp_path)
    calm = design.design(motor, board)
    assert calm.start_up.follows and not calm.start_up.loud and not [line for line in calm.warnings if "swings" in line]
    assert 270.0 < calm.start_up.end_speed_rpm <= start.CALMEST_END_SHARE * 540.0 and calm.start_up.current_a <= 0.837
    assert calm.start_up.pull_out_nm * start.LOAD_ANGLE_SINE > calm.start_up.needed_nm
    as_told = design.design(replace(motor, tune={"END_SPEED_RPM": 270.0}), board)
    assert as_told.start_up.end_speed_rpm == 270.0 and as_told.start_up.loud # what the motor file says stays, with its warning


def test_a_rotor_that_brakes_by_friction_alone_within_its_ripple_is_no_wrong_sensor(tmp_path):
    """A winding of 43 mohm at 55 V, case 235: what compensates dead time drives half an ampere to and fro through currents that lose nothing to it."""
    code, out, _ = tuner("anymotor", "--case", "235", "--quiet", "--out", str(tmp_path / "out"))
    assert code == 0 and "turns: 1 of 1" in out, out


def test_drawn_files_are_read_without_a_complaint_and_lie_in_the_promised_ranges(tmp_path):
    found = [files(case, tmp_path) for case in CASES]
    for motor, board in found:
        assert 8.0 <= board.nominal_bus_v <= 60.0 and 50.0 <= motor.rated_speed_rpm and motor.rated_speed_rpm * motor.pole_pairs <= 32000.0
        assert 0.0199 <= motor.rs_ohm <= 10.01 and 14.9e-6 <= motor.ld_h and motor.lq_h <= 10.01e-3
    for values, low, high in (([board.nominal_bus_v for _, board in found], 9.0, 55.0), ([motor.rs_ohm for motor, _ in found], 0.05, 5.0),
                              ([motor.lq_h for motor, _ in found], 1e-4, 5e-3), ([motor.rated_speed_rpm for motor, _ in found], 150.0, 8000.0)):
        assert min(values) < low and max(values) > high # the draw fills the ranges
    assert {board.current_gain for _, board in found} == {-0.5, 0.5} and {motor.salient for motor, _ in found} == {True, False}


def test_a_few_cases_turn_or_are_refused_and_leave_files_and_a_table(tmp_path):
    """The small form of make anymotor."""
    code, out, _ = tuner("anymotor", "--case", *map(str, NUMBERS), "--quiet", "--out", str(tmp_path / "out"))
    assert code == 0, out
    rows = list(csv.DictReader((tmp_path / "out" / "cases.csv").open(encoding="utf-8")))
    turning = [row for row in rows if row["verdict"] == "turns"]
    assert len(rows) == len(NUMBERS) and len(turning) >= 10 and {row["verdict"] for row in rows} <= {"turns", "refused"}
    assert f"turns: {len(turning)} of {len(NUMBERS)}, {len(turning) / len(NUMBERS):.0%}" in out and f"fails: 0 of {len(NUMBERS)}, 0%" in out
    assert all(row["why"] and row["number"] for row in rows if row["verdict"] == "refused")
    first = tmp_path / "out" / "cases" / turning[0]["name"]
    assert motor_file.load(str(first / f"{turning[0]['name']}.toml")).title == turning[0]["motor"]
    assert (first / "userparams.h").is_file() and not list(first.glob("*.so"))


def test_a_motor_that_does_not_turn_fails_the_command_with_its_number(tmp_path, monkeypatch):
    monkeypatch.setattr(any_motor, "_one", lambda job, firmware, tell: any_motor.row_of(job) | {"why": "closed loop never"})
    code, out, _ = tuner("anymotor", "--count", "2", "--quiet", "--out", str(tmp_path / "out"))
    assert code == 1 and "drawn_1_0002: fails: closed loop never" in out and "fails: 2 of 2, 100%" in out
    assert [row["verdict"] for row in json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["rows"]] == ["fails", "fails"]


@pytest.mark.parametrize("arguments, says", [(["--count", "0"], "--count"), (["--case", "-1"], "--case"), (["--count", "many"], "invalid int value")])
def test_an_impossible_number_is_refused_in_one_line(arguments, says):
    code, _, line = tuner("anymotor", *arguments)
    assert code == 2 and says in line and line.count("\n") == 1
