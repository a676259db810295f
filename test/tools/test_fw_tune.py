"""The field-weakening tuner: its parts with made-up motors, the tables file, and parameters that change while the motor turns."""

import contextlib
import functools
import math
import re
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from pytest import approx
from tune_support import HURST, command, motor_path

from tools.bench import build
from tools.bench.board import BoardError, Library
from tools.common import board_file, board_keys, motor_file, param_rows, paths, workers
from tools.common.errors import UserError
from tuning import fw_search, fw_tables, fw_tune
from tuning.fw_bench import SIGNALS, Bench, Fault, Point, reduced
from tuning.fw_search import Goal, Search, correction, largest, least, model_current, model_use, peak, voltage_limit
from tuning.fw_tables import ENTRIES, Entry, Tables

HEADER = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
PARAMS = {"NOPOLESPAIRS": 5.0, "MOTOR_RS_OHM": 2.67, "MOTOR_LS_MH": 1.92, "MOTOR_KPHI_V_PER_KRPM": 7.24, "NOMINAL_BUS_V": 24.0,
          "LOOPTIME_SEC": 50e-6, "DEADTIME_SEC": 2e-6, "SAMPLE_WINDOW_SEC": 1.6e-6, "MAXIMUM_CURRENT_A": 2.75, "INVKFI_SPEED0": 7956.0,
          "END_SPEED_RPM": 1000.0, "MINIMUM_SPEED_RPM": 500.0, "MAXIMUM_SPEED_RPM": 6400.0}
GOAL = Goal(0.97, 3.0, 2.66, 2.66, 0.08, 2800.0, 0.2, 5500.0)


# ---- parts ---------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("low, high", [(0, 0), (0, 1), (0, 37), (5, 30)])
def test_least_finds_the_threshold_from_every_guess_and_none_where_nothing_suffices(low, high):
    for guess in range(low - 3, high + 4):
        assert [least(lambda n: n >= threshold, guess, low, high) for threshold in range(low, high + 1)] == list(range(low, high + 1))
        assert least(lambda n: False, guess, low, high) is None


@pytest.mark.parametrize("threshold, guess, most", [*((threshold, 40, 19) for threshold in range(0, 200, 7)), (100, 100, 4)])
def test_least_asks_each_value_once_and_not_outside_and_little_where_the_guess_is_right(threshold, guess, most):
    asked = []
    least(lambda n: asked.append(n) or n >= threshold, guess, 0, 200)
    assert len(asked) == len(set(asked)) <= most and all(0 <= n <= 200 for n in asked)


def test_peak_finds_the_top_of_a_hill_or_a_line_and_uses_what_is_known():
    for top in range(0, 267, 11):
        assert abs(peak(lambda n: -abs(n - top), {0: -float(top), 266: top - 266.0}, 0, 266) - top) <= 4, top
    assert peak(float, {}, 0, 266) == 266
    asked = []
    assert peak(lambda n: asked.append(n) or 0.0, {n: -abs(n - 100.0) for n in range(0, 201, 4)}, 0, 200) == 100
    assert asked == []
    # largest halves towards the threshold
    assert largest(lambda x: x <= 0.3, 1.0, 10) == approx(0.3, abs=1.0 / 1024)
    assert (largest(lambda x: True, 0.2, 8), largest(lambda x: False, 0.2, 8)) == (0.2, 0.0)


def test_the_voltage_model_is_the_equation_and_its_circle_the_modulator_s():
    assert voltage_limit(PARAMS) == approx(0.936 * 24.0 / math.sqrt(3.0), abs=5e-7)
    assert model_use(PARAMS, 2000.0, 0.0, 0.0) * voltage_limit(PARAMS) == approx(2.0 * 7.24 / math.sqrt(3.0), abs=5e-7)
    w = 4000.0 * 5.0 * 2.0 * math.pi / 60.0
    v_d, v_q = 2.67 * -1.5 - w * 1.92e-3 * 0.4, 2.67 * 0.4 + w * (1.92e-3 * -1.5 + 7.983e-3)
    assert model_use(PARAMS, 4000.0, -1.5, 0.4) * voltage_limit(PARAMS) == approx(math.hypot(v_d, v_q), abs=5e-3)
    assert model_use(PARAMS | {"MOTOR_RS_OHM": 2.0, "BRIDGE_RS_OHM": 0.67}, 4000.0, -1.5, 0.4) == approx(model_use(PARAMS, 4000.0, -1.5, 0.4), abs=1e-9)
    current = model_current(PARAMS, 4000.0, 0.3, 0.97, 3.0)
    assert model_use(PARAMS, 4000.0, -current, 0.3) <= 0.97 < model_use(PARAMS, 4000.0, -current + 0.01, 0.3)


def test_correction_is_least_squares_and_load_falls_with_one_over_speed_above_rated_speed():
    for errors, slopes, wanted in (([2.0, 4.0], [1.0, 1.0], -3.0), ([3.0], [-1.5], 2.0), ([3.0], [0.0], 0.0)):
        assert correction(errors, slopes) == approx(wanted, abs=5e-8)
    assert (GOAL.load_nm(2000.0), GOAL.load_nm(5600.0)) == approx((0.016, 0.008), abs=5e-8)


# ---- measuring, starting ---------------------------------------------------------------------------------------------------
ROW = {"plant.speed_rpm": 3000.0, "plant.theta_e_deg": 359.0, "plant.i_d": -0.6, "plant.i_q": 0.8, "fw.theta_est_deg": 1.0,
       "fw.v_d_v": -6.0, "fw.v_q_v": 8.0, "fw.v_limit_v": 12.5, "fw.id_ref_a": -0.6, "fw.id_trim_a": -0.1, "bus.voltage_v": 23.9}


def measured(**changes: float) -> Point:
    row = ROW | {name.replace("__", "."): value for name, value in changes.items()}
    return reduced(np.tile([row[name] for name in SIGNALS], (4, 1)), 3000.0)


def test_means_and_an_angle_error_taken_around_the_circle():
    point = measured()
    assert (point.use, point.current_rms_a, point.angle_deg) == approx((0.8, math.sqrt(0.5), 2.0), abs=5e-8)
    assert (point.id_a, point.iq_a, point.trim_a, point.bus_v) == (-0.6, 0.8, -0.1, 23.9)
    assert measured(plant__theta_e_deg=2.0).angle_deg == approx(-1.0, abs=5e-8)
    # a speed is held within half a per cent
    assert [measured(plant__speed_rpm=rpm).held for rpm in (2984.5, 2985.5, 3014.5, 3015.5)] == [False, True, True, False]


def started(closes_after_s: float, fault: str = "", risks: str = "") -> float:
    """Motor time of a start with 1.6 s of lock and 14 s of ramp; the board is in closed loop, or faults, after a time."""
    bench = Bench.__new__(Bench)
    bench.params, bench.risks, bench.board = {**PARAMS, "LOCK_TIME": 32000.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 1.0}, risks, mock.Mock()
    bench.ranges = mock.Mock(minimum_rpm=500.0)
    times: list[float] = []
    over = lambda: sum(times) > closes_after_s # noqa: E731
    with mock.patch.multiple(bench, create=True, run=times.append, press=lambda button: None, load=lambda torque_nm: None,
                             fault=lambda: fault if over() else "", state=lambda: "CLOSED" if over() and not fault else "RAMP"):
        bench.start()
    return sum(times)


def test_a_start_that_takes_long_by_its_parameters_is_waited_for():
    assert started(15.5) == approx(16.0, abs=0.2)


@pytest.mark.parametrize("given, told", [
    ((60.0,), r"\(no fault in state RAMP after 2[3-5]\.\d s\): run `make run`"),
    ((3.0, "START_FAILED"), r"\(START_FAILED [^)]*\): the motor does not follow the ramp: raise Q_CURRENT_REF_OPENLOOP.*\Z"),
    ((3.0, "START_FAILED", "it swings: add friction"), r"\(START_FAILED [^)]*\): it swings: add friction\Z")])
def test_what_the_tuner_warned_about_is_the_remedy_of_a_start_that_fails(given, told):
    with pytest.raises(UserError, match="does not start " + told):
        started(*given)


def test_the_risks_are_the_tuner_s_warnings_about_the_start():
    board = board_file.load("mclv")
    with motor_path(("viscous_friction = { value = 15.3e-6", "viscous_friction = { value = 0.0"),
                    ("coulomb_friction = { value = 0.004", "coulomb_friction = { value = 0.0"), ("value = 5.5e-6", "value = 6e-5")) as path:
        _, risks = fw_tune._header(motor_file.load(str(path)), board)
    assert re.search(r"\Athe unloaded rotor still swings .*; add \[mechanical\] coulomb_friction, which the no-load current gives: [0-9.]+ N m is enough\Z", risks)
    assert fw_tune._header(motor_file.load(HURST), board) == (HEADER, "")


# ---- made-up motors --------------------------------------------------------------------------------------------------------
class FakeMotor:
    """Steady state of a motor with saturation, by its equations; `faults_below` lets it fault where too little d current flows, `angle`
    says the angle error by the entry."""

    def __init__(self, saturation: float = 0.0, faults_below: float = 0.0, angle=None, **params: float) -> None:
        self.params = {**PARAMS, **params}
        self.saturation, self.faults_below, self.angle = saturation, faults_below, angle
        self.table = [Entry(0.0, 7956.0, 0.5)] * ENTRIES
        self.values: dict[str, float] = {"FW_START_SPEED_RPM": 3000.0}
        self.set = self.values.__setitem__
        self.load_nm = self.rpm = 0.0
        self.starts = 0
        self.running = False

    def start(self) -> None:
        self.running, self.rpm = True, 1000.0
        self.starts += 1

    def stopped(self) -> bool:
        return not self.running

    def load(self, torque_nm: float) -> None:
        self.load_nm = torque_nm

    def speed(self, rpm: float) -> bool:
        self.rpm = rpm
        self.settle()
        return True

    def regain(self) -> bool:
        return self.point().held

    def entries_from(self, index: int, entry: Entry) -> None:
        self.table[index:] = [entry] * (ENTRIES - index)

    def now(self) -> Entry:
        place = max(0.0, (self.rpm - self.values["FW_START_SPEED_RPM"]) * self.params["NOPOLESPAIRS"] / 1024.0)
        return self.table[min(round(place), ENTRIES - 1)]

    def inductance(self, id_a: float, iq_a: float) -> float:
        return self.params["MOTOR_LS_MH"] * 1e-3 * (1.0 - self.saturation * min(1.0, (id_a ** 2 + iq_a ** 2) / 9.0))

    def use(self, entry: Entry) -> tuple[float, float]:
        iq_a = (self.load_nm + 0.008) / fw_search.torque_per_ampere(self.params)
        ls_h = self.inductance(entry.idref_a, iq_a)
        return model_use(self.params, self.rpm, entry.idref_a, iq_a, 0.5 * ls_h / self.params["MOTOR_LS_MH"] * 1e3), iq_a

    def settle(self) -> None:
        if self.running and self.use(self.now())[0] > 1.0 + self.faults_below > 1.0:
            self.running = False
            raise Fault("STALL")

    def point(self) -> Point:
        self.settle()
        entry = self.now()
        use, iq_a = self.use(entry)
        psi, ls_h = fw_search.flux_vs(self.params), self.inductance(entry.idref_a, iq_a)
        wrong_h = ls_h - self.params["MOTOR_LS_MH"] * 1e-3 * 2.0 * entry.ls_ratio
        angle = self.angle(entry) if self.angle else math.degrees(1.0 - 7956.0 / entry.inv_kfi / (1.0 + wrong_h * entry.idref_a / psi))
        return Point(self.rpm / max(use, 1.0), self.rpm, min(use, 1.0), angle, entry.idref_a, iq_a,
                     0.7 * math.hypot(entry.idref_a, iq_a), 0.0, 24.0)

    def needs(self, found: fw_search.Found, load_nm: float) -> bool:
        """Does a hundredth of an ampere less than an entry has not suffice?"""
        self.rpm, self.load_nm = found.rpm, load_nm
        return self.use(replace(found.entry, idref_a=found.entry.idref_a + 0.01))[0] > 0.97


@functools.cache
def search(goal: Goal = GOAL, entries: int = ENTRIES, **motor) -> tuple[fw_search.Result, FakeMotor]:
    """A search's result and its motor, shared by the tests."""
    made = FakeMotor(**motor)
    return Search(made, goal, entries=entries).run(), made


def test_every_entry_has_the_least_current_with_the_margin_and_field_weakening_starts_where_the_voltage_asks_for_it():
    result, motor = search()
    assert len(result.found) > 10
    for before, found in zip(result.found, result.found[1:]):
        assert found.entry.idref_a == before.entry.idref_a or motor.needs(found, found.load_nm), found.index
        motor.rpm, motor.load_nm = found.rpm, found.load_nm
        assert motor.use(found.entry)[0] <= 0.97 + 1e-9
    result, motor = search(entries=2)
    motor.rpm, motor.load_nm = result.start_rpm, GOAL.load_nm(result.start_rpm)
    assert motor.use(Entry())[0] <= 0.97
    motor.rpm += fw_search.START_STEP_RPM
    assert motor.use(Entry())[0] > 0.97


def test_with_saturation_ls_follows_the_motor():
    result, motor = search(saturation=0.4)
    assert all(abs(point.angle_deg) <= 3.0 for found in result.found for point in (found.free, found.loaded))
    first = next(found for found in result.found if found.corrected)
    assert first.entry.ls_ratio == approx(0.5 * motor.inductance(first.entry.idref_a, first.loaded.iq_a) / 1.92e-3, abs=0.03)


def test_a_wrong_kphi_that_ls_cannot_mend_moves_inv_kfi():
    found = search(entries=3, angle=lambda entry: 60.0 * (entry.inv_kfi / 7956.0 - 0.9) if entry.idref_a else 0.0)[0].found[1]
    assert (found.entry.inv_kfi, found.entry.ls_ratio) == (approx(0.9 * 7956.0, abs=80.0), 0.5)


@pytest.mark.parametrize("motor", [{}, {"entries": 3, "angle": lambda entry: 8.0}, {
    "entries": 3, "angle": lambda entry: 5.0 + 50.0 * abs(entry.ls_ratio - 0.5) + 50.0 * abs(entry.inv_kfi / 7956.0 - 1.0)}])
def test_without_an_error_or_an_effect_or_where_it_gets_worse_the_other_tables_stay_flat(motor):
    assert {(found.entry.inv_kfi, found.entry.ls_ratio) for found in search(**motor)[0].found} == {(7956.0, 0.5)}


@pytest.mark.parametrize("motor, stopped", [
    ({"goal": replace(GOAL, limit_a=1.5)}, "limit of 1.50 A"),
    ({"saturation": 0.9, "goal": replace(GOAL, angle_deg=1000.0)}, "gives no more speed"),
    ({"goal": replace(GOAL, maximum_rpm=2000.0)}, "no field weakening is needed"),
    ({"MAXIMUM_SPEED_RPM": 4000.0}, "number format of speeds ends at 4000 rpm")])
def test_the_search_says_why_it_stops(motor, stopped):
    assert stopped in search(**motor)[0].stopped


def test_what_the_entries_are_where_the_search_stopped():
    limited = search(goal=replace(GOAL, limit_a=1.5))[0]
    currents = [entry.idref_a for entry in limited.entries()]
    assert len(limited.found) < 10 and len(currents) == ENTRIES and currents[-1] == min(currents) == -1.5
    idle = search(goal=replace(GOAL, maximum_rpm=2000.0))[0]
    assert not idle.needed and {entry.idref_a for entry in idle.entries()} == {0.0}
    assert search(MAXIMUM_SPEED_RPM=4000.0)[0].found[-1].rpm <= 4000.0


def test_near_the_limit_the_load_gives_way_first_and_the_current_never_falls_with_speed():
    result, _ = search()
    currents = [entry.idref_a for entry in result.entries()]
    shares = [found.load_nm / GOAL.load_nm(found.rpm) for found in result.found]
    assert (currents, shares) == (sorted(currents, reverse=True), sorted(shares, reverse=True))
    assert shares[1] == approx(1.0, abs=5e-8) and shares[-1] < 0.9


def test_above_the_rated_current_only_speed_is_paid_for():
    result, motor = search(goal=replace(GOAL, rated_a=1.5))
    assert any(found.entry.idref_a < -2.0 for found in result.found)
    for found, before in zip(result.found[1:], result.found):
        if found.entry.idref_a < min(-1.5, before.entry.idref_a):
            assert found.load_nm == 0.0 and motor.needs(found, 0.0)
    assert result.found[1].load_nm == GOAL.load_nm(result.found[1].rpm)


def test_a_fault_on_the_way_costs_a_restart_and_changes_nothing_and_the_trim_is_off():
    wild, motor = search(faults_below=0.001)
    assert motor.starts > 1 and motor.values["FW_TRIM_CURRENT_A"] == 0.0
    assert search()[0].entries()[:10] == wild.entries()[:10]


# ---- the tables' file ------------------------------------------------------------------------------------------------------
TABLES = Tables(HURST, 2650.0, [Entry(round(-0.1 * i, 2), 7956.0 + 10 * (i > 3), 0.5 - 0.01 * (i > 5)) for i in range(ENTRIES)],
                {name: PARAMS[name] for name in fw_tables.FINGERPRINT}, 7956.0, 15, 'a "reason" \\ here', 6090.0,
                {"torque_share": 0.2}, [{"speed_rpm": 2650.0, "torque_nm": 0.05}])
GOOD = fw_tables.text(TABLES)


@pytest.fixture
def path(tmp_path):
    found = tmp_path / f"{HURST}.toml"
    found.write_text(GOOD, encoding="utf-8")
    return found


def test_what_is_written_is_read(path):
    fw_tables.write(path, TABLES)
    assert path.read_text(encoding="utf-8") == GOOD
    assert fw_tables.load(path) == TABLES
    assert fw_tables.load(path).mismatch(PARAMS) == ""
    # the rounding of single precision is no difference, and no file no complaint
    found, reason = fw_tables.load_for([HURST], {name: value * 1.0000001 for name, value in PARAMS.items()}, path.parent)
    assert (found is None, reason) == (False, "")
    assert fw_tables.load_for(["nobody"], PARAMS, path.parent) == (None, "")
    # of several boards' files the one that fits; the motor's own one first
    other = replace(TABLES, fingerprint=TABLES.fingerprint | {"LOOPTIME_SEC": 25e-6}, start_speed_rpm=2330.0)
    fw_tables.write(path.with_name(f"{HURST}-quick.toml"), other)
    assert fw_tables.path_of(HURST, "quick").name == f"{HURST}-quick.toml" and fw_tables.path_of(HURST).name == f"{HURST}.toml"
    assert [fw_tables.load_for([HURST], PARAMS | more, path.parent)[0].start_speed_rpm for more in ({}, {"LOOPTIME_SEC": 25e-6})] \
        == [TABLES.start_speed_rpm, 2330.0]
    # header names keep the base value by name
    values = TABLES.parameters()
    assert (values["INVKFI_SPEED3"], values["INVKFI_SPEED4"]) == ("NORM_INVKFIBASE", "7966")
    assert (values["IDREF_SPEED0"], values["IDREF_SPEED17"], len(values)) == ("0.00", "-1.70", 3 * ENTRIES + 1)


@pytest.mark.parametrize("name", fw_tables.FINGERPRINT)
def test_tables_of_another_motor_value_are_not_used_and_the_line_says_which(path, name):
    found, reason = fw_tables.load_for([HURST], {**PARAMS, name: PARAMS[name] * 1.01}, path.parent)
    assert found is None and name in reason and f"make tune-fw MOTOR={HURST}" in reason and "\n" not in reason


def test_tables_whose_1_over_Kphi_counts_another_unit_of_speed_are_not_used(path):
    found, reason = fw_tables.load_for([HURST], {**PARAMS, "NORM_INVKFIBASE": TABLES.inv_kfi_base / 2.0}, path.parent)
    assert found is None and "another SPEED_UNIT" in reason and f"make tune-fw MOTOR={HURST}" in reason
    assert fw_tables.load_for([HURST], {**PARAMS, "NORM_INVKFIBASE": TABLES.inv_kfi_base + 0.4}, path.parent)[1] == ""


@pytest.mark.parametrize("wrong, word", [
    (GOOD.replace("idref_a = [0.00, ", "idref_a = ["), "17 values"), (GOOD.replace("[fingerprint]", "[finger]"), "finger"),
    (GOOD.replace("idref_a = [0.00", "idref_a = [0.50"), "impossible"), (GOOD.replace("MOTOR_RS_OHM", "MOTOR_OHM"), "MOTOR_"),
    (GOOD[:GOOD.index("idref_a") + 14], "TOML syntax"),
    (GOOD.replace("torque_nm = [0.05]", "torque_nm = [0.05, 0.04]"), "'torque_nm' has 2 values")])
def test_damaged_files_have_their_line(path, wrong, word):
    path.write_text(wrong, encoding="utf-8")
    with pytest.raises(UserError, match=word):
        fw_tables.load(path)


def test_a_namesake_in_another_folder_has_tables_of_its_own(tmp_path):
    home = paths.MOTORS / f"{HURST}.toml"
    (tmp_path / home.name).write_bytes(home.read_bytes())
    asked = []
    with mock.patch.object(fw_tables, "check_place", side_effect=lambda path: asked.append(path) or (_ for _ in ()).throw(UserError("looked"))):
        for name, more in ((HURST, ()), (str(tmp_path / home.name), ()), (HURST, ("--board", "mclv_40khz"))):
            assert command("tune-fw", name, *more, "--quiet") == (2, "", "foc33: looked\n")
    own, namesake, quick = asked
    assert (own, quick) == (fw_tables.FOLDER / f"{HURST}.toml", fw_tables.FOLDER / f"{HURST}-mclv_40khz.toml")
    assert namesake.parent == own.parent and re.fullmatch(rf"{HURST}-[0-9a-f]{{8}}\.toml", namesake.name)
    assert fw_tables.names_of(motor_file.load(str(tmp_path / home.name))) == [namesake.stem, HURST]
    assert fw_tables.names_of(motor_file.load(HURST)) == [HURST]


def test_a_motor_s_own_tables_come_before_its_namesake_s_which_are_used_if_they_fit_and_else_not_told(path):
    names = ["mine-0123abcd", HURST]
    fw_tables.write(path, TABLES)
    assert fw_tables.load_for(names, PARAMS, path.parent)[0].start_speed_rpm == TABLES.start_speed_rpm
    assert fw_tables.load_for(names, PARAMS | {"NOMINAL_BUS_V": 12.0}, path.parent) == (None, "")
    fw_tables.write(path.with_name("mine-0123abcd.toml"), replace(TABLES, start_speed_rpm=2330.0))
    assert fw_tables.load_for(names, PARAMS, path.parent)[0].start_speed_rpm == 2330.0
    assert "mine-0123abcd.toml is not used" in fw_tables.load_for(names, PARAMS | {"NOMINAL_BUS_V": 12.0}, path.parent)[1]


def test_an_interrupted_write_leaves_the_old_file(path):
    path.write_text("old", encoding="utf-8")
    with mock.patch.object(Path, "replace", side_effect=KeyboardInterrupt), pytest.raises(KeyboardInterrupt):
        fw_tables.write(path, TABLES)
    assert [(file.name, file.read_text(encoding="utf-8")) for file in path.parent.iterdir()] == [(path.name, "old")]


@pytest.mark.parametrize("place, reason", [(f"{HURST}.toml/tables/a.toml", "(Not a directory)"), ("folder.toml", "(Is a directory)"),
                                           (f"{HURST}.toml", "")])
def test_a_place_that_cannot_be_written_is_refused_before_the_search(path, place, reason):
    (path.parent / "folder.toml").mkdir()
    place, out = path.parent / place, path.parent / "out"
    with mock.patch.object(fw_tune, "_Work", side_effect=UserError("the search began")):
        told = command("tune-fw", HURST, "--tables", str(place), "--out", str(out), "--quiet")
    expected = f"cannot write the tables {reason}, {paths.shown(place)}: make the folder writable" if reason else "the search began"
    assert told == (2, "", f"foc33: {expected}\n")
    assert sorted(file.name for file in path.parent.iterdir()) == ["folder.toml", path.name]


# ---- the header ------------------------------------------------------------------------------------------------------------
KNOWN = fw_tune.defines(HEADER)


def test_values_change_and_comments_stay():
    text = param_rows.with_values(HEADER, {"FW_START_SPEED_RPM": "2345", "IDREF_SPEED1": "-0.77"})
    assert fw_tune.defines(text) == KNOWN | {"FW_START_SPEED_RPM": 2345.0, "IDREF_SPEED1": -0.77}
    assert text.count("/*") == HEADER.count("/*")
    with pytest.raises(UserError, match="NO_SUCH_NAME"):
        param_rows.with_values(HEADER, {"NO_SUCH_NAME": "1"})


def test_numbers_are_read_and_the_highest_speed_is_where_the_format_of_speeds_or_of_the_back_emf_ends():
    text = "#define A 1.5 /* x */\n  # define B 0xF\n#define C (-2)\n#define D OTHER\n/* #define E 3 */\n"
    assert fw_tune.defines(text) == {"A": 1.5, "B": 15.0, "C": -2.0}
    assert fw_tune.highest_speed(KNOWN) == 6400.0
    less = {**KNOWN, "OVER_CURRENT_THRESHOLD_A": 3.81, "MOTOR_LS_MH": 2.2}
    assert fw_tune.highest_speed({**less, "MOTOR_RS_OHM": KNOWN["MOTOR_RS_OHM"] - 1.0, "BRIDGE_RS_OHM": 1.0}) == fw_tune.highest_speed(less) < 6400.0


def test_a_header_s_own_table_is_interpolated_as_the_firmware_does():
    known = {"FW_START_SPEED_RPM": 2600.0, "NOPOLESPAIRS": 5.0, **{f"IDREF_SPEED{i}": -0.1 * i for i in range(ENTRIES)}}
    for rpm, wanted in ((2000.0, 0.0), (2600.0 + 2.5 * 204.8, -0.25), (9000.0, -1.7)):
        assert fw_tune.table_current(known, rpm) == approx(wanted, abs=5e-8)


# ---- on the virtual board ------------------------------------------------------------------------------------------------------
def on_board(work, defines=("PARAMS_IN_RAM",)):
    """work(bench) with the Hurst on its board, in a process of its own: the firmware is one set of globals."""
    def run(library, tell):
        layers = [motor_file.load(HURST).plant_values(), board_file.load("mclv").plant_values()]
        with contextlib.closing(Bench(library, board_keys.resolve(layers, Library(library).keys), tell)) as bench:
            return work(bench)
    return workers.run_all([build.library(list(defines))], run, lambda seconds: None)[0]


def fill(bench: Bench, stem: str, value: float) -> None:
    """The same for all entries of a table."""
    for i in range(ENTRIES):
        bench.set(f"{stem}{i}", value)


def refused(bench: Bench, name: str, value: float) -> str:
    try:
        bench.set(name, value)
    except BoardError as error:
        return str(error)
    return ""


def test_table_entries_and_the_start_speed_change_the_running_motor():
    def work(bench):
        bench.start()
        bench.speed(3500.0)
        points, places = [bench.point()], [(bench.board.get("fw.ls_ratio"), bench.board.get("fw.fw_index"))]
        fill(bench, "IDREF_SPEED", -1.6)
        bench.run(0.05)
        points.append(bench.point())
        fill(bench, "INVKFI_SPEED", 1.1 * bench.params["INVKFI_SPEED0"])
        bench.run(0.1)
        points.append(bench.point())
        fill(bench, "LS_OVER2LS0_SPEED", 0.4)
        bench.set("FW_START_SPEED_RPM", 3400.0)
        bench.run(0.05)
        places.append((bench.board.get("fw.ls_ratio"), bench.board.get("fw.fw_index")))
        return points, places, bench.board.parameter("IDREF_SPEED7")
    (before, after, turned), ((ratio, index), (changed, later)), read = on_board(work)
    assert before.id_a > -1.2 and after.id_a == approx(-1.6, abs=0.05) and read == approx(-1.6, abs=0.001)
    # the law cos d + sin d = K'/K, of which the adaptation at 6/s leaves exp(-0.6) after 0.1 s
    assert turned.angle_deg - after.angle_deg == approx(5.0 * math.exp(-0.6), abs=0.8)
    assert (ratio, changed) == approx((0.5, 0.4), abs=0.001)
    assert index > 2 and later == 0


def test_the_trim_can_be_switched_off():
    def work(bench):
        bench.set("FW_TRIM_CURRENT_A", 0.0)
        fill(bench, "IDREF_SPEED", 0.0)
        bench.start()
        bench.speed(3500.0)
        return bench.point()
    point = on_board(work)
    assert point.trim_a == 0.0 and point.speed_rpm < 3450.0


def test_every_entry_can_be_written_and_read_and_wrong_values_and_names_are_refused():
    wrong = (("IDREF_SPEED3", 0.5), ("INVKFI_SPEED0", 100.0), ("LS_OVER2LS0_SPEED17", 0.7), ("IDREF_SPEED18", -1.0), ("IDREF_SPEED", -1.0),
             ("IDREF_SPEED1x", -1.0), ("MOTOR_RS_OHM", 2.0), ("FW_TRIM_CURRENT_A", math.nan))
    wanted = {f"{stem}{i}": first + i * step for stem, first, step in (
        ("IDREF_SPEED", -0.05, -0.1), ("INVKFI_SPEED", 5000.0, 7.0), ("LS_OVER2LS0_SPEED", 0.2, 0.01)) for i in range(ENTRIES)}

    def work(bench):
        for name, value in wanted.items():
            bench.set(name, value)
        return [refused(bench, *item) for item in wrong], {name: bench.board.parameter(name) for name in wanted}
    answers, read = on_board(work)
    assert all(answers) and "range" in answers[0] and "cannot change" in answers[3], answers
    assert read == approx(wanted, rel=0.0, abs=0.001)


@pytest.mark.parametrize("defines, answer", [((), "PARAMS_IN_RAM"), (("TUNING",), "")])
def test_only_builds_with_parameters_in_ram_change_them(defines, answer):
    told = on_board(lambda bench: refused(bench, "IDREF_SPEED3", -0.5), defines)
    assert answer in told and bool(told) == bool(answer)
