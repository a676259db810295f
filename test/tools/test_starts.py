"""Starts: what the table asks for, the box of motors that the header does not know, drawn starts, and what a limit forbids."""

from dataclasses import replace

import pytest
from support import LIBRARY, refused, command, small_sweep

from tools.bench import cli, start_sweep
from tools.bench.board import Library
from tools.bench.start_sweep import Case, Starts, Table
from tools.common import board_file, motor_file, paths

HURST = "hurst_dmb0224c10002"
TABLE = Table.read(paths.TABLES / "starts.toml")


def sweep(*words, **changes):
    result = Starts(replace(TABLE, **changes), motor_file.part(HURST), board_file.part("mclv"), Library(LIBRARY))
    result.ask(cli._parser().parse_args(["starts", *words]))
    return result


# ---- what is asked -------------------------------------------------------------------------------------------------------
def test_the_box_has_every_combination_under_what_its_weakest_magnets_carry_and_in_full_600_starts_from_eight_angles():
    plain, box = ([item for item in sweep("--full").cases() if item.is_off == whether] for whether in (False, True))
    assert len(plain) == 24 * 5 and {(item.R, item.L, item.Kphi) for item in plain} == {(1.0, 1.0, 1.0)}
    assert len(box) == len(set(box)) == 600 and {(item.load_nm, item.inertia) for item in box} == {(0.048, 1.0)}
    assert {item.R for item in box} == {0.7, 0.85, 1.0, 1.15, 1.3} and {item.L for item in box} == {0.75, 1.0, 1.25}
    assert {item.Kphi for item in box} == {0.8, 0.9, 1.0, 1.1, 1.2} and len({item.rotor_deg for item in box}) == 8
    some = [item for item in sweep().cases() if item.is_off]
    assert len(some) == 150 and set(some) < set(box) and {item.rotor_deg for item in some} == {item.rotor_deg for item in box}


def test_the_plant_of_a_box_s_start_is_off_and_the_header_s_is_not():
    bench, motor = sweep(), motor_file.load(HURST)
    values = bench.job(Case(0.06, 1.0, 45.0, 0.7, 1.25, 0.8, box=True)).values
    assert [values[key] for key in ("motor.rs_ohm", "motor.ld_h", "motor.lq_h", "motor.psi_vs", "load.constant_nm")] == pytest.approx(
        [0.7 * motor.rs_ohm, 1.25 * motor.ld_h, 1.25 * motor.lq_h, 0.8 * motor.psi_vs, 0.06])


def test_a_drawn_start_is_always_the_same_and_all_of_it_is_off_within_its_bounds():
    cases = sweep("--draw", "400", "--seed", "7").cases()
    assert len(cases) == 400 and cases == sweep("--draw", "400", "--seed", "7").cases() and cases != sweep("--draw", "400", "--seed", "8").cases()
    assert sweep("--case", "9", "3", "--seed", "7").cases() == [cases[2], cases[8]]
    for spread, low, high in (([item.R for item in cases], 0.7, 1.3), ([item.L for item in cases], 0.7, 1.3), ([item.Kphi for item in cases], 0.8, 1.2),
                              ([item.inertia for item in cases], 0.5, 3.0), ([item.rotor_deg for item in cases], 0.0, 360.0),
                              ([item.load_nm for item in cases], 0.0, 0.048), ([dict(item.keys)["supply.voltage_v"][1] for item in cases], 0.9, 1.1),
                              ([dict(item.keys)["inverter.turn_on_s"] * 1e6 for item in cases], 0.1, 0.7),
                              ([dict(item.keys)["inverter.turn_off_s"] * 1e6 for item in cases], 0.15, 0.75),
                              ([dict(item.keys)["shunt.offset_b_v"] for item in cases], -0.02, 0.02)):
        margin = 0.05 * (high - low)
        assert low - 1e-9 <= min(spread) < low + margin and high - margin < max(spread) <= high + 1e-9
    values = sweep().job(cases[0]).values
    assert values["supply.voltage_v"] == pytest.approx(24.0 * dict(cases[0].keys)["supply.voltage_v"][1]) and values["rng.seed"] > 1.0


@pytest.mark.parametrize("words, parts", [(["--draw", "0"], ["0 is no number of starts", "--draw"]), (["--case", "-1"], ["-1 is no number", "--case"])])
def test_a_count_that_is_none_is_refused(words, parts):
    refused(command("starts", "--library", str(LIBRARY), *words), *parts)


def test_the_results_of_a_draw_have_a_folder_of_their_own():
    names = [Starts.folder(cli._parser().parse_args(["starts", *words])) for words in ([], ["--full"], ["--draw", "9"], ["--draw", "9", "--seed", "2", "--case", "4"])]
    assert names == ["starts", "starts", "starts-draw-1", "starts-draw-2-case-4"]


# ---- what a limit forbids ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("changes, text", [
    ({}, ""), ({"load_nm": 0.2}, "the start's current gives"), ({"load_nm": 0.06, "Kphi": 0.2}, "the start's current gives"),
    ({"keys": (("supply.voltage_v", 8.0),)}, "needs ")])
def test_what_the_start_s_current_or_the_voltage_forbids_is_told_with_its_numbers(changes, text):
    bench, item = sweep(), replace(Case(0.06, 1.0, 0.0, box=True), **changes)
    found = bench.beyond(item, bench.job(item).values)
    assert found.startswith(text) and (found == "") == (text == ""), found


ROW = {"rotor_deg": 45.0, "kind": "k", "inertia": 1.0, "is_off": True, "back_rpm": 100.0, "fault": None, "closed_after_s": 1.3, "overshoot_percent": 5.0,
       "hand_over_rpm": 250.0, "speed_error_percent": 0.1, "beyond": ""}


@pytest.mark.parametrize("changes, ok", [
    ({}, True), ({"fault": "START_FAILED"}, False), ({"fault": "START_FAILED", "beyond": "needs"}, True), ({"back_rpm": 301.0}, False),
    ({"closed_after_s": None}, False), ({"closed_after_s": 2.1}, False), ({"overshoot_percent": 39.0}, True), ({"overshoot_percent": 41.0}, False),
    ({"overshoot_percent": 11.0, "is_off": False}, False), ({"hand_over_rpm": 400.0}, True), ({"hand_over_rpm": 400.0, "is_off": False}, False),
    ({"speed_error_percent": 0.6}, False), ({"inertia": 2.5, "speed_error_percent": 0.6}, False)])
def test_a_motor_that_the_header_does_not_know_starts_in_time_and_comes_to_its_speed(changes, ok):
    outcome, = sweep().check(None, ROW | changes)
    assert outcome.ok == ok and ("out of reach: needs" in outcome.got) == bool(changes.get("beyond"))


def test_the_text_counts_what_holds_of_the_box_and_of_the_draw_and_tells_what_is_out_of_reach():
    bench = sweep()
    box = [ROW | {"number": 0, "load_nm": 0.06, "R": r, "L": 1.0, "Kphi": kphi, "fault": "STALL" if (r, kphi) == (0.7, 0.8) else None}
           for r in TABLE.box_resistance for kphi in TABLE.box_kphi]
    lines = bench.text(box).splitlines()
    assert next(line for line in lines if line.startswith("true Kphi x0.8")).split()[3:6] == ["0", "of", "1"] and sum("1 of 1" in line for line in lines) == 5
    drawn = [ROW | {"number": 1}, ROW | {"number": 2, "fault": "STALL", "beyond": "needs 9 V"}]
    assert bench.text(drawn).splitlines() == ["1 of 2 drawn starts hold, seed 1", "", "out of reach: k: needs 9 V"]


# ---- for the user --------------------------------------------------------------------------------------------------------
def test_a_small_table_and_a_small_box_in_full(tmp_path, monkeypatch):
    code, out, error, data, rows = small_sweep(tmp_path, monkeypatch, "starts", every_deg="180", loads_nm="[0.03]", heavy_factors="[9]",
                                               box_resistance="[1.0, 1.15]", box_inductance="[1.0]", box_kphi="[1.1]", box_starts="1")
    assert (code, error, data["passed"], len(rows)) == (0, "", True, 6), out
    assert "true Kphi x1.1  1 of 1  1 of 1" in out and (tmp_path / "out/starts.png").is_file()
