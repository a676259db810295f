"""The acceptance table: what it asks of a motor, what makes a row fail, and one motor run in full."""

import csv
import json
import re
from types import SimpleNamespace

import pytest
from support import MOTORS, command, refusal, refused, run, step

from tools.bench import case, plots, rating_sweep, scenario
from tools.bench.rating_sweep import Candidate, Rated, Table
from tools.common import motor_file, paths
from tools.common.errors import UserError

HURST = "hurst_dmb0224c10002"
PARAMS = {"LOOPTIME_SEC": 50e-6, "NOPOLESPAIRS": 5.0, "END_SPEED_RPM": 1000.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 10.0, "LOCK_TIME": 4000.0,
          "SPEEDREFRAMP_RPM_PER_S": 4000.0, "MINIMUM_SPEED_RPM": 500.0, "NOMINAL_SPEED_RPM": 2800.0, "MAXIMUM_SPEED_RPM": 5500.0,
          "MAXIMUM_CURRENT_A": 2.75}
TABLE = Table.read(paths.TABLES / "rated.toml")
TIMES = SimpleNamespace(start_s=0.1, settle_s=1.0, torque_over_s=0.5, where="here")


def row(**more):
    return {"motor": "m", "row": "50 %", "fault": None, "closed_after_s": 1.6, "speed_error_percent": 0.1, "angle_error_rms_deg": 2.0,
            "current_of_maximum_percent": 50.0, "limited_percent": {}, "voltage_percent": 60.0,
            "reference_rpm": 1400.0, "highest_rpm": 1402.0} | more


# ---- what is asked -------------------------------------------------------------------------------------------------------
def test_20_50_and_100_per_cent_are_asked_for_within_half_a_per_cent_at_half_torque_of_the_rating_and_the_header_s_maximum():
    assert (TABLE.speeds_percent, TABLE.torque_percent, TABLE.error_percent) == ([20.0, 50.0, 100.0], 50.0, 0.5)
    motor = motor_file.load(HURST)
    rows = Rated(TABLE).rows_of(Candidate(motor, None, None, "", SimpleNamespace(params=PARAMS)))
    half, rated_rpm = 0.5 * motor.rated_torque_nm, pytest.approx(motor.rated_speed_rpm)
    assert [(item.name, item.torque_nm) for item in rows] == [("20 %", half), ("50 %", half), ("100 %", half), ("maximum", 0.0)]
    assert [rows[0].rpm / 0.2, rows[1].rpm / 0.5, rows[2].rpm, rows[3].rpm] == [rated_rpm, rated_rpm, rated_rpm, 5500.0]


@pytest.mark.parametrize("values, text", [
    ({}, "ok"), ({"speed_error_percent": -0.5}, "ok"), ({"fault": "STALL"}, "fault STALL"),
    ({"closed_after_s": None}, "never in closed loop"),
    ({"closed_after_s": 5.1}, "closed loop after 5.10 s"), ({"speed_error_percent": 0.51}, "speed +0.5 %"),
    ({"speed_error_percent": None}, "no speed"), ({"angle_error_rms_deg": 10.1}, "angle"),
    ({"current_of_maximum_percent": 100.1}, "current"),
    ({"speed_error_percent": -2.0, "limited_percent": {"VOLTAGE": 100.0}}, "speed -2.0 % (VOLTAGE 100 %)")])
def test_each_way_to_fail_is_named(values, text):
    assert Rated(TABLE).verdict(None, row(**values)) == text
    assert Rated(TABLE).check(None, row(verdict=text))[0].ok == (text == "ok")


def test_a_failed_row_names_motor_row_and_numbers_and_what_was_reached_without_load_is_told():
    for rpm, text in ((5432.1, "without load up to 5432 rpm (MAXIMUM_SPEED_RPM 5500)"), (None, "no closed loop without load")):
        assert rating_sweep.highest_text([row(highest_rpm=rpm, reference_rpm=5500.0)]) == text
    outcome = Rated(TABLE).check(None, row(verdict="angle", angle_error_rms_deg=12.0))[0]
    assert outcome.row == "m at 50 %" and "angle error 12.0 deg" in outcome.got and "angle error 10 deg" in outcome.allowed


# ---- when it happens -----------------------------------------------------------------------------------------------------
def test_the_start_takes_lock_and_ramp_a_slower_header_is_given_more_time_and_one_that_hides_a_parameter_is_refused():
    took = scenario.start_time_s(PARAMS)
    assert took == pytest.approx(0.2 + 1.398 + scenario.START_MARGIN_S, abs=1e-3)
    for change in ({"LOCK_TIME": 8000.0}, {"OPENLOOP_RAMPSPEED_INCREASERATE": 5.0}, {"END_SPEED_RPM": 1500.0}):
        assert scenario.start_time_s(PARAMS | change) > took + 0.19, change
    refusal(lambda: scenario.start_time_s({name: value for name, value in PARAMS.items() if name != "LOCK_TIME"}), "does not tell LOCK_TIME")


def test_the_brake_closes_when_the_speed_is_reached_and_the_measure_waits_for_it():
    events, settled_s = case.loaded_run(PARAMS, 2600.0, TIMES, "x", torque_nm=0.04, start_torque_nm=0.01)
    at_speed_s = 0.1 + scenario.start_time_s(PARAMS) + 1600.0 / 4000.0 + 1.0
    brakes = [(event.at_s, event.keys["load.constant_nm"]) for event in events if event.keys]
    assert brakes == [(0.0, 0.01), (pytest.approx(at_speed_s), 0.04)]
    assert settled_s == pytest.approx(at_speed_s + 0.5 + 1.0)


@pytest.mark.parametrize("rpm, first", [(5500.0, 2800.0), (1400.0, 1400.0)])
def test_the_potentiometer_waits_inside_its_normal_range_until_the_loop_is_closed(rpm, first):
    speeds = [(event.at_s, event.value) for event in case.loaded_run(PARAMS, rpm, TIMES, "x")[0] if event.kind == "speed_rpm"]
    assert [speed for _, speed in speeds] == [first, rpm] and speeds[1][0] > 1.6


@pytest.mark.parametrize("signals, rpm", [
    ({"fw__state": step((0, 4), (0.5, 5), (1.5, 1)), "plant__speed_rpm": step((0, 9000), (0.5, 1000), (1.0, 3000), (1.005, 2000),
                                                                              (1.5, 8000))},
     pytest.approx(2000.0 + 1000.0 * 0.005 / 0.1, abs=1.0)), # a mean in closed loop
    ({"fw__state": 4, "plant__speed_rpm": 1000}, None), ({"fw__state": 5, "plant__speed_rpm": -1500}, pytest.approx(1500.0))])
def test_the_highest_speed(signals, rpm):
    assert case.highest_rpm(run(**signals)) == rpm


# ---- for the user --------------------------------------------------------------------------------------------------------
def test_one_motor_in_full(tmp_path):
    folder = tmp_path / "out"
    code, out, error = command("rated", "--motor", HURST, "--userparams", str(paths.ROOT), "--out", str(folder), "--quiet")
    assert (code, error) == (0, ""), out
    assert "4 of 4 expectations hold" in out and re.search(r"without load up to 5[45]\d\d rpm \(MAXIMUM_SPEED_RPM 5500\)", out)
    with (folder / "rated.csv").open(encoding="utf-8") as file:
        assert [item["row"] for item in csv.DictReader(file)] == ["20 %", "50 %", "100 %", "maximum"]
    data = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert (data["passed"], [item["header"] for item in data["motors"]]) == (True, ["userparams.h"])
    assert {path.name for path in folder.iterdir()} == {"index.html", "summary.json", "rated.csv", "rated.png"}


def test_a_motor_without_a_header_is_refused_and_does_not_stop_the_others(tmp_path, monkeypatch):
    ready = []

    def build(found, quiet):
        ready.extend(motor.name for motor, *_ in found)
        raise UserError("that is enough")
    monkeypatch.setattr(paths, "TUNED", tmp_path)
    monkeypatch.setattr(rating_sweep, "built", build)
    out = ("--out", str(tmp_path / "out"))
    refused(command("rated", "--motor", HURST, *out), f"no userparams.h for motor '{HURST}'", f"make tune MOTOR={HURST}")
    (tmp_path / HURST).mkdir()
    (tmp_path / HURST / "userparams.h").touch()
    error = command("rated", "--motor", "linix_45zwn24_40", HURST, *out)[2]
    assert ready == [HURST] and not (tmp_path / "out").exists()
    assert re.fullmatch(r"foc33: no userparams.h for motor 'linix_45zwn24_40'.*\nfoc33: that is enough\n", error)
    monkeypatch.setattr(paths, "RESULTS", tmp_path / "run")
    assert command("rated", "--motor", "linix_45zwn24_40", HURST)[2] == error and not any((tmp_path / "run").iterdir()) # in a folder of its own


@pytest.mark.parametrize("arguments, parts", [
    (["no_such"], ["no motor 'no_such'", "--motor"]), ([HURST, HURST, "--userparams", "."], ["one header for several motors"]),
    ([HURST, "--userparams", "no/where"], ["no userparams.h in 'no/where'"])])
def test_wrong_motors_and_headers_are_refused(tmp_path, arguments, parts):
    refused(command("rated", "--motor", *arguments, "--out", str(tmp_path / "out")), *parts)
    assert not (tmp_path / "out").exists()


def test_the_list_of_motors_has_a_line_for_each_and_names_a_file_that_cannot_be_read(tmp_path, monkeypatch):
    for name in MOTORS:
        (tmp_path / f"{name}.toml").write_bytes((paths.MOTORS / f"{name}.toml").read_bytes())
    monkeypatch.setattr(paths, "MOTORS", tmp_path)
    code, out, _ = command("motors")
    assert (code, [name for name in MOTORS if f"\n{name} " not in f"\n{out}"]) == (0, [])
    (tmp_path / "broken.toml").write_text("x = = 1", encoding="utf-8")
    code, out, error = command("motors")
    assert code == 2 and f"\n{HURST} " in out and re.fullmatch(r"foc33: TOML syntax, .*broken\.toml line 1.*\n", error)


def test_the_plot_can_draw_rows_that_failed(tmp_path):
    rows = [row(), row(row="maximum", speed_error_percent=None, angle_error_rms_deg=None, current_of_maximum_percent=None,
                       voltage_percent=None), row(motor="n", speed_error_percent=-80.0)]
    assert plots.write_rated(rows, vars(TABLE), tmp_path) == ["rated.png"]
    assert (tmp_path / "rated.png").read_bytes()[:4] == b"\x89PNG"
