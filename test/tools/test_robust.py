"""Robustness: which deviations are tried, what counts as running, and how the margins are found."""

import csv
import itertools
import json
import math
import re

import pytest
from support import LIBRARY, command, refused

from tools.bench import plots, robust
from tools.bench.board import Library
from tools.bench.robust import Deviation, Margins, Robust, Table
from tools.bench.search import Search
from tools.common import board_file, motor_file, param_rows, paths

HURST = "hurst_dmb0224c10002"
TABLE = Table.read(paths.TABLES / "robust.toml")
ALONE = {(1.0, 1.0, 1.0): "none", (0.7, 1.0, 1.0): "R", (1.5, 1.0, 1.0): "R", (1.0, 0.7, 1.0): "L", (1.0, 1.3, 1.0): "L",
         (1.0, 1.0, 0.8): "Kphi", (1.0, 1.0, 1.2): "Kphi"}


def row(**more):
    return {"closed_after_s": 1.6, "fault": None, "fault_s": None, "speed_error_percent": 0.1, "limited_percent": {},
            "angle_error_rms_deg": 1.0, "angle_limit_deg": 2.0, "beyond": ""} | more


# ---- deviations ----------------------------------------------------------------------------------------------------------
def test_each_deviation_alone_and_every_corner_are_promised_and_a_cold_and_a_hot_motor_are_tried():
    items = robust.deviations(TABLE)
    promised = {item.factors: item.alone for item in items if item.promised}
    assert promised == ALONE | dict.fromkeys(itertools.product((0.7, 1.3), (0.7, 1.3), (0.8, 1.2)), "")
    assert len({item.name for item in items}) == len(items)
    degc = [item.temperature_degc for item in items if item.temperature_degc is not None]
    assert min(degc) < 0.0 and max(degc) > 80.0


def test_the_protections_allow_for_what_is_promised():
    """Where voltages and currents ask for an impossible flux, the header may be as wrong as this table promises."""
    r_least, r_most, l_off, flux_most = (param_rows.number(f"PARAM_{name}") for name in ("R_LEAST", "R_MOST", "L_OFF", "FLUX_MOST"))
    assert [r_least, r_most] == TABLE.promised["R"] and [1.0 - l_off, 1.0 + l_off] == TABLE.promised["L"]
    assert TABLE.promised["Kphi"][1] < flux_most < 1.1 * TABLE.promised["Kphi"][1]


def test_the_plant_of_a_job_is_changed_and_its_header_is_not():
    library, motor = Library(LIBRARY), motor_file.load(HURST)
    bench = Robust(TABLE, motor_file.part(HURST), board_file.part("mclv"), library)
    job = bench.job((Deviation("x", (0.7, 1.3, 0.85), temperature_degc=80.0), True, 50.0))
    assert {key: job.values[key] for key in ("motor.rs_ohm", "motor.ld_h", "motor.lq_h", "motor.psi_vs", "motor.temp_c")} == pytest.approx({
        "motor.rs_ohm": 0.7 * motor.rs_ohm, "motor.ld_h": 1.3 * motor.ld_h, "motor.lq_h": 1.3 * motor.lq_h,
        "motor.psi_vs": 0.85 * motor.psi_vs,
        "motor.temp_c": 80.0})
    brakes = [action.keys["load.constant_nm"] for action in job.actions if "load.constant_nm" in action.keys]
    assert (brakes[0], brakes[-1]) == pytest.approx((motor.start_torque_nm, 0.5 * motor.rated_torque_nm))
    assert (job.library, job.scenario.measures[0].reference_rpm) == (library.path, pytest.approx(0.5 * motor.rated_speed_rpm))
    assert {action.keys.get("load.constant_nm", 0.0) for action in bench.job((Deviation("x"), False, 50.0)).actions} == {0.0}
    for percent, rpm in ((1.0, library.params["MINIMUM_SPEED_RPM"]), (900.0, library.params["MAXIMUM_SPEED_RPM"]), (42.5, 1190.0)):
        assert bench.rpm(percent) == pytest.approx(rpm)


def test_temperature_shows_in_the_true_factors():
    motor = motor_file.load(HURST)
    found = robust.true_factors(motor, Deviation("hot", temperature_degc=125.0))
    assert found == pytest.approx([1.0 + 100.0 * motor.resistance_tempco_per_k, 1.0, 1.0 + 100.0 * motor.kphi_tempco_per_k])


# A true L above the header's lets the estimate lead, by dL Iq / psi; without current it means nothing.
@pytest.mark.parametrize("factor, iq_a, degrees", [
    (1.0, 1.0, 0.0), (1.3, 1.4, 5.77), (0.7, 1.4, -5.77), (1.3, 0.0, 0.0), (1.3, None, None)])
def test_the_law_of_l(factor, iq_a, degrees):
    values = {"motor.lq_h": factor * 1.92e-3, "motor.psi_vs": 7.983e-3}
    assert robust.law_deg(values, factor, iq_a) == (None if degrees is None else pytest.approx(degrees, abs=0.02))


@pytest.mark.parametrize("factor, id_a, degrees", [(1.5, -0.88, 6.41), (0.7, -0.88, -3.86), (1.5, 0.0, 0.0), (1.0, -2.0, 0.0), (1.5, None, None)])
def test_a_wrong_resistance_turns_the_angle_by_what_the_d_current_makes_of_it(factor, id_a, degrees):
    values = {"motor.rs_ohm": 2.67 * factor, "motor.psi_vs": 0.007983, "motor.pole_pairs": 5.0}
    found = robust.resistance_law_deg(values, factor, id_a, 2500.0)
    assert found == (None if degrees is None else pytest.approx(degrees, abs=0.02))


@pytest.mark.parametrize("alone, loaded, law, degrees", [
    ("none", True, 0.0, 2.0), ("R", True, 0.0, 2.0), ("Kphi", False, 0.0, 4.0), ("L", True, -5.4, 6.4),
    ("L", False, 0.4, 4.0), ("L", False, 3.5, 4.5),
    ("", True, 5.0, 10.0)])
def test_the_allowed_angle_is_two_degrees_loaded_four_unloaded_and_the_law_plus_one_for_l(alone, loaded, law, degrees):
    assert Robust(TABLE).angle_limit_deg(alone, loaded, law) == pytest.approx(degrees)


# ---- verdicts ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("values, text", [
    ({}, "ok"), ({"closed_after_s": None}, "no start: never in closed loop"),
    ({"closed_after_s": None, "fault": "START_FAILED", "fault_s": 1.8}, "no start: START_FAILED"),
    ({"fault": "STALL", "fault_s": 2.0}, "closed, then STALL"), ({"fault": "STALL", "fault_s": 2.4}, "fault STALL"),
    ({"speed_error_percent": 0.6}, "speed +0.6 %"), ({"speed_error_percent": None}, "no speed"), ({"angle_error_rms_deg": 2.1}, "angle"),
    ({"speed_error_percent": -9.0, "beyond": "needs 14 V"}, "out of reach"),
    ({"fault": "STALL", "fault_s": 2.4, "beyond": "needs 14 V"}, "fault STALL")])
def test_each_way_to_fail_is_named(values, text):
    assert Robust(TABLE).verdict(None, row(**values)) == text


def test_a_start_that_does_not_last_is_none_and_a_failed_case_names_its_load_and_its_error():
    for fault_s, started in ((2.19, False), (2.21, True)): # S2 at 0.1 s, closed 1.6 s later: must last to 2.2 s
        assert Robust(TABLE).started(row(fault="LOST_LOCK", fault_s=fault_s)) == started
    outcome, = Robust(TABLE).check((Deviation("x", promised=True), True, 50.0), row(case="R -30 %", load="loaded", reference_rpm=1190.0, verdict="no start: STALL",
                                      speed_error_percent=-100.0, angle_error_rms_deg=None, need_voltage_v=3.0, voltage_limit_v=13.0))
    assert (outcome.row, outcome.ok) == ("R -30 %, 1190 rpm, loaded", False)
    assert outcome.got == "no start: STALL, error -100.00, volts needed 3.00, volts there 13.00"


# ---- margins -------------------------------------------------------------------------------------------------------------
LADDER = robust.ladder(TABLE)


def searched(first_bad: float, upwards: bool, factors: list[float]) -> Search:
    """A search after runs at these factors, where everything beyond first_bad fails."""
    search = Search(upwards, lambda found: found["ok"], 1.0)
    for factor in factors:
        ok = factor < first_bad if upwards else factor > first_bad
        search.narrow(factor, {"ok": ok, "verdict": "ok" if ok else "no"})
    return search


def margins(down: float, up: float) -> Margins:
    result = Margins()
    for name, (criterion, _, _), upwards in itertools.product(robust.PARAMETERS, robust.CRITERIA, (False, True)):
        result.searches[name, criterion, upwards] = searched(up if upwards else down, upwards, LADDER)
    return result


def test_the_ladder_goes_from_the_lowest_to_the_highest_factor_through_1_and_a_margin_lies_between_its_steps():
    steps = [b / a for a, b in zip(LADDER, LADDER[1:])]
    assert (LADDER[0], LADDER[-1], 1.0 in LADDER) == (0.3, 3.0, True)
    assert 1.0 < min(steps) and max(steps) <= robust.LADDER + 1e-9
    # between the last that holds and the first that does not
    up, down = searched(1.4, True, LADDER), searched(0.6, False, LADDER)
    assert up.good < 1.4 < up.bad and down.bad < 0.6 < down.good
    assert up.next(0.02) == pytest.approx(math.sqrt(up.good * up.bad))


@pytest.mark.parametrize("order", [(1.0, 1.2, 1.5, 2.0), (2.0, 1.5, 1.2, 1.0), (1.0, 2.0, 1.2, 1.5)])
def test_what_works_again_beyond_the_first_failure_does_not_count(order):
    search = Search(True, lambda found: found["ok"], 1.0)
    for factor in order:
        search.narrow(factor, {"ok": factor != 1.5, "verdict": "no"})
    assert (search.good, search.bad) == (1.2, 1.5)


def test_the_search_ends_at_its_resolution_and_comes_that_close():
    search = searched(1.4, True, [1.0, 1.39, 1.41])
    assert search.next(0.02) is None and search.next(0.01) is not None
    search = searched(1.4567, True, LADDER)
    while (factor := search.next(0.005)) is not None:
        search.narrow(factor, {"ok": factor < 1.4567, "verdict": "no"})
    assert 1.4567 / 1.005 <= search.good < 1.4567 <= search.bad
    # a parameter without a limit ends at the bound
    search = searched(99.0, True, LADDER)
    assert (search.good, search.bad, search.next(0.02)) == (3.0, None, None)


def test_the_printed_margin_marks_an_end_that_is_only_the_search_s_and_the_table_tells_what_happens_beyond():
    for ends, text in (((0.0, 99.0), r"<0\.30 \.\. >3\.00"), ((0.6, 1.5), r"0\.6\d \.\. 1\.[34]\d"), ((1.0, 1.0), "not at all")):
        assert re.fullmatch(text, margins(*ends).cell("R", "runs, loaded")), ends
    text = robust.margins_text(TABLE, margins(0.0, 1.5))
    assert re.search(r"(?m)^R x1\.\d\d: no \[starts, no load; runs, no load; starts, loaded; runs, loaded\]$",
                     text) and "0.80 .. 1.20" in text and "0.70 .. 1.50" in text


def test_every_case_is_tried_in_a_handful_of_rounds_and_never_twice():
    seen, rounds = [], []

    class FakeBench(Robust):
        def run(self, cases, title):
            rounds.append(title)
            assert {percent for _, _, percent in cases} == {TABLE.margin_speed_percent}
            seen.extend((item.name, loaded) for item, loaded, _ in cases)
            good = [0.71 < item.factors[2] < 2.0 and item.factors[0] < 2.5 for item, _, _ in cases]
            return [{"started": ok, "verdict": "ok" if ok else "no", "load": robust.load_name(loaded)}
                    for ok, (_, loaded, _) in zip(good, cases)]

    found = FakeBench(TABLE).find_margins()
    assert len(set(seen)) == len(seen) and len(rounds) <= 5
    assert found.cell("L", "runs, loaded") == "<0.30 .. >3.00"
    low, high = (found.searches["Kphi", "runs, no load", upwards].good for upwards in (False, True))
    assert 0.71 < low < 0.71 * 1.021 and 2.0 / 1.021 < high < 2.0


def test_margins_and_angle_error_are_drawn_even_where_nothing_runs(tmp_path):
    found = [{"parameter": name, "criterion": criterion, "direction": direction, "factor": 1.0 if name == "R" else end,
              "fails_at": 1.0 if name == "R" else None}
             for name in robust.PARAMETERS for criterion, _, _ in robust.CRITERIA for direction, end in (("down", 0.5), ("up", 2.0))]
    runs = [{"parameter": name, "load": load, "factor": factor, "verdict": "no" if name == "R" else "ok",
             "angle_error_mean_deg": 1.0, "law_deg": 1.0}
            for name in robust.PARAMETERS for load in ("no load", "loaded") for factor in (0.5, 1.0, 2.0)]
    names = plots.write_robust(found, runs, TABLE.promised, tmp_path)
    assert names == ["margins.png", "angle_error.png"]
    assert [(tmp_path / name).read_bytes()[:4] for name in names] == [b"\x89PNG"] * 2


# ---- for the user --------------------------------------------------------------------------------------------------------
def test_the_promised_deviations_in_full(tmp_path):
    code, _, error = command("robust", "--no-margins", "--library", str(LIBRARY), "--out", str(tmp_path / "out"), "--quiet")
    assert code in (0, 1) and (code == 0) == (error == ""), "a failed case and only a failed case is named on stderr"
    data = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    cases, promised = 2 * len(TABLE.speeds_percent), sum(item["promised"] for item in data["rows"])
    assert (len(data["rows"]), promised, len(data["expectations"])) == (cases * len(robust.deviations(TABLE)), cases * 15, cases * 15)
    assert data["passed"] == (code == 0)
    with (tmp_path / "out" / "robust.csv").open(encoding="utf-8") as file:
        rows = {(item["case"], item["load"], round(float(item["reference_rpm"]))): item for item in csv.DictReader(file)}
    alone = ("as in the header", "R -30 %", "R +50 %", "L -30 %", "L +30 %", "Kphi -20 %", "Kphi +20 %")
    for case in itertools.product(alone, ("no load", "loaded"), (500, 1190)):
        assert rows[case]["verdict"] == "ok", case
    for rpm, sign in itertools.product((500, 1190), (-1.0, 1.0)): # the law
        item = rows[f"L {30.0 * sign:+.0f} %", "loaded", rpm]
        assert float(item["angle_error_mean_deg"]) == pytest.approx(float(item["law_deg"]), abs=1.0)
        assert sign * float(item["law_deg"]) > 2.0


@pytest.mark.parametrize("arguments, part", [
    (["--motor", "no_such"], "no motor 'no_such'"), (["--userparams", "no/where"], "no userparams.h in 'no/where'"),
    (["--library", str(LIBRARY), "--userparams", "."], "leave out --library or --userparams")])
def test_a_mistake_is_one_line(tmp_path, arguments, part):
    refused(command("robust", *arguments, "--out", str(tmp_path / "out")), part)
    assert list(tmp_path.iterdir()) == []
