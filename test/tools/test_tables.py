"""Table 2 and the start matrix: their data files, and what makes a row fail."""

import pytest
from support import refusal

from tools.bench import case, catch_sweep, loadsteps, lowspeed, rating_sweep, report, robust, start_sweep, table2
from tools.common import motor_file, paths

NOTE = {500: (500, 0.148, 1.697), 1000: (1000, 0.111, 1.556), 1500: (1425, 0.083, 1.513), 2000: (1900, 0.062, 1.117),
        2500: (2375, 0.031, 0.608), 3000: (2850, 0.020, 0.636), 3500: (3325, 0.019, 1.174), 4000: (3800, 0.015, 1.556)}
TABLE2 = table2.Table2(table2.Table.read(paths.TABLES / "table2.toml"))
ROWS = TABLE2.table.rows
STARTS = start_sweep.Table.read(paths.TABLES / "starts.toml")
LINIX = {"LOOPTIME_SEC": 50e-6, "NOPOLESPAIRS": 2.0, "END_SPEED_RPM": 800.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 3.0, "LOCK_TIME": 32000.0,
         "SPEED_BANDWIDTH_HZ": 12.0}


def result(**more):
    return {"speed_rpm": 1500.0, "current_rms_a": 0.5, "speed_error_percent": 0.0, "fault": None, "limited_percent": {}} | more


# ---- Table 2 -------------------------------------------------------------------------------------------------------------
def test_the_file_holds_the_note_s_eight_rows_and_half_a_per_cent_and_the_note_s_current_for_all_but_the_first():
    assert {row.reference_rpm: (row.note_rpm, row.torque_nm, row.note_current_a) for row in ROWS} == NOTE
    assert [(row.error_percent, row.no_more_current) for row in ROWS] == [(0.5, False)] + [(0.5, True)] * 7
    assert len(TABLE2.check(ROWS[0], result(current_rms_a=9.0))) == 1
    # the printed table has AN1292's columns
    assert {"note_rpm", "note_current_a", "speed_rpm", "current_rms_a"} <= {key for key, _, _ in table2.Table2.columns}
    assert "limited by" in report.table([{"name": "x"}], table2.Table2.columns)


@pytest.mark.parametrize("which, values, ok, row, got", [
    *((0, {"speed_error_percent": error}, ok, "1500 rpm, 0.083 N m: speed", "1500.0 rpm")
      for error, ok in ((0.5, True), (-0.5, True), (0.51, False), (-0.51, False), (None, False))),
    (0, {"fault": "STALL"}, False, "1500 rpm, 0.083 N m: speed", "STALL"), # whatever its speed
    *((1, {"current_rms_a": current}, ok, "1500 rpm, 0.083 N m: current", got)
      for current, ok, got in ((1.513, True, "1.513"), (1.514, False, "1.514"), (None, False, "nothing")))])
def test_a_row_fails_beyond_half_a_per_cent_above_the_note_s_current_and_with_a_fault(which, values, ok, row, got):
    outcome = TABLE2.check(ROWS[2], result(**values))[which]
    assert (outcome.ok, outcome.row) == (ok, row) and got in outcome.got


@pytest.mark.parametrize("error, shares, text", [
    (-3.0, {"VOLTAGE": 100.0, "CURRENT": 0.4}, "VOLTAGE 100 %"), (-3.0, {"CURRENT": 80.0, "RAMP": 1.0}, "CURRENT 80 %, RAMP 1 %"),
    (-0.4, {"VOLTAGE": 100.0}, ""), (-3.0, {}, "not limited")])
def test_a_shortfall_is_explained_by_what_limited_the_output_and_for_how_long(error, shares, text):
    assert case.limit_text(result(speed_error_percent=error, limited_percent=shares)) == text


@pytest.mark.parametrize("room, name, old, new, said", [
    (table2, "table2", "measure_from_s = 4.5", "measure_from_s = 1.0", "times are not in order"),
    (robust, "robust", "lowest_factor = 0.3", "lowest_factor = 1.5", "'lowest_factor' = 1.5 is impossible, "),
    (robust, "robust", "kphi_percent = [-20, 20]", "kphi_percent = [20]", "kphi_percent has 1 numbers"),
    (loadsteps, "loadsteps", "dip_rpm = [1190, 500]", "dip_rpm = [1190]", "columns of different lengths"),
    (catch_sweep, "catch", "stop_s = [1.66, 1.66, 1.66]", "stop_s = [1.66]", "columns of different lengths"),
    (lowspeed, "lowspeed", "lowest_rpm = 50", "lowest_rpm = 40", "'lowest_rpm' = 40 is impossible"),
    (rating_sweep, "rated", "settle_s = 1.5", "settle_s = 0", "'settle_s' = 0 is impossible"),
    (rating_sweep, "rated", "speeds_percent = [20, 50, 100]", "speeds_percent = []", "not a list of numbers"),
    (rating_sweep, "rated", "error_percent", "eror_percent", "'error_percent' is missing"),
    (rating_sweep, "rated", "start_s", "more = 1\nstart_s", "unknown key 'more'")])
def test_a_mistake_in_a_table_is_one_line_with_its_place(tmp_path, room, name, old, new, said):
    text = (paths.TABLES / f"{name}.toml").read_text(encoding="utf-8")
    (tmp_path / "t.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    refusal(lambda: room.Table.read(tmp_path / "t.toml"), said, "t.toml")


# ---- starts --------------------------------------------------------------------------------------------------------------
def start(**more):
    return {"rotor_deg": 45.0, "load_nm": 0.03, "inertia": 1.0, "kind": "0.03 N m", "closed_after_s": 1.6, "hand_over_rpm": 250.0, "back_rpm": 120.0,
            "overshoot_percent": 1.0, "speed_error_percent": 0.0, "fault": None, "is_off": False, "beyond": ""} | more


def other(**params):
    """The table for another motor."""
    return STARTS.for_motor(motor_file.load("linix_45zwn24_40"), LINIX | params)


def test_the_matrix_is_every_15_degrees_and_another_motor_gets_shares_of_its_own_ratings_and_its_header_s_time():
    assert (STARTS.every_deg, STARTS.loads_nm, STARTS.within_s) == (15.0, [0.0, 0.03, 0.06], 2.0)
    table = other()
    assert (table.motor, table.speed_rpm, table.loads_nm) == ("linix_45zwn24_40", 1600.0, [0.0, 0.0115, 0.0231])
    assert table.within_s == pytest.approx(1.6 + 800 / 536.4 + 0.5, abs=0.01)
    assert table.measure_from_s - table.within_s == pytest.approx(STARTS.measure_from_s - STARTS.within_s)
    assert table.measure_to_s - table.measure_from_s == pytest.approx(STARTS.measure_to_s - STARTS.measure_from_s)


def test_a_speed_loop_made_slow_by_its_load_gets_time_to_settle_and_the_speed_is_not_below_the_hand_over():
    quick, slow = (other(SPEED_BANDWIDTH_HZ=hz) for hz in (20.0, 1.0))
    assert quick.within_s == slow.within_s
    assert slow.measure_from_s - slow.start_s - slow.within_s == pytest.approx(5.0)
    assert slow.measure_to_s - slow.measure_from_s == pytest.approx(quick.measure_to_s - quick.measure_from_s)
    assert other(END_SPEED_RPM=1900.0, OPENLOOP_RAMPSPEED_INCREASERATE=8.0, LOCK_TIME=9000.0).speed_rpm == 1900.0


@pytest.mark.parametrize("values, ok, got", [
    ({}, True, "speed error +0.00 %"), ({"closed_after_s": 2.01}, False, "closed loop after 2.010 s"),
    ({"closed_after_s": None}, False, "never in closed loop"), ({"overshoot_percent": 10.1}, False, "overshoot 10.1 %"),
    ({"speed_error_percent": -0.6}, False, "speed error -0.60 %"), ({"fault": "STALL"}, False, "fault STALL"),
    ({"back_rpm": 301.0}, False, "301 rpm against the direction"), ({"back_rpm": 301.0, "fault": "START_FAILED"}, False, "301 rpm against the direction"),
    ({"hand_over_rpm": 301.0}, False, "hand-over at 301 rpm"),
    ({"inertia": 36.0, "overshoot_percent": 39.0, "hand_over_rpm": 400.0, "speed_error_percent": 4.0}, True, "speed error +4.00 %"),
    ({"inertia": 36.0, "overshoot_percent": 41.0}, False, "overshoot 41.0 %"), ({"inertia": 36.0, "fault": "START_FAILED"}, False, "fault START_FAILED")])
def test_each_way_to_fail_is_named_with_angle_and_load(values, ok, got):
    outcome, = start_sweep.Starts(STARTS).check(None, start(**values))
    assert (outcome.ok, outcome.row, outcome.got) == (ok, "start from 45 deg with 0.03 N m", got)


def test_another_motor_s_header_may_refuse_a_rotor_that_it_is_not_made_for_by_name_and_by_no_other():
    found = {(inertia, fault): start_sweep.Starts(other()).check(None, start(inertia=inertia, fault=fault))[0].ok
             for inertia in (1.0, 9.0, 36.0) for fault in ("START_FAILED", "STALL")}
    assert [key for key, ok in found.items() if ok] == [(36.0, "START_FAILED")]


def test_starts_that_may_fail_are_counted_below_the_table_by_kind():
    rows = [start(rotor_deg=15.0 * number, inertia=inertia, kind=f"inertia x{inertia:g}", fault="START_FAILED" if fails else None)
            for inertia, fails in ((9.0, 0), (36.0, 1)) for number in range(3)]
    lines = start_sweep.Starts(other()).text(rows).splitlines()
    assert lines[-1].startswith("inertia x36: 3 of 3 starts end in a fault, 3 of them in START_FAILED, which is allowed from 36 times the inertia on")
    assert "[load] inertia" in lines[-1] and "inertia x9:" not in "\n".join(lines)
    stalled = start_sweep.Starts(other()).text([start(kind="0.03 N m", fault="STALL")]).splitlines()
    assert stalled[-1] == "0.03 N m: 1 of 1 starts end in a fault"


def test_every_load_and_every_heavy_rotor_comes_from_every_angle():
    cases = STARTS.cases()
    assert len(set(cases)) == len(cases) == 24 * 5 and {(case.load_nm, case.inertia) for case in cases} == {(0.0, 1.0), (0.03, 1.0), (0.06, 1.0), (0.0, 9.0), (0.0, 36.0)}


def test_the_printed_table_has_a_line_for_each_angle():
    rows = [start(rotor_deg=angle, kind=f"{load:g} N m", fault="STALL" if angle else None) for load in STARTS.loads_nm for angle in (0.0, 15.0)]
    lines = start_sweep.Starts(STARTS).text(rows).splitlines()
    assert "1.60 s" in lines[1] and lines[2].split() == ["15", "STALL", "STALL", "STALL"]
