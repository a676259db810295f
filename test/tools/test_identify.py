"""The `identify` command: the neutral header, one motor on the virtual board, its report, and what it refuses."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from pytest import approx
from support import refused
from support import MOTORS
from tune_support import HURST, command

from tools.common import board_file, motor_file, paths
from tools.common.toml_file import Document
from tuning import constants, identify, identify_range, identify_result
from tuning.identify_result import Known

BOARD, MOTOR = board_file.load("mclv"), motor_file.load(HURST)
FILE = (paths.MOTORS / f"{HURST}.toml").read_text(encoding="utf-8")


def pasted(lines: str, path: Path, connection: str = "Y") -> motor_file.Motor:
    """The Hurst's file with other electrical values, read again."""
    text = re.sub(r"\[electrical\].*?(?=^\[rating\])", lambda _: lines + "\n", FILE, flags=re.DOTALL | re.MULTILINE)
    path.write_text(text.replace('"Y"', f'"{connection}"').split("[spread]")[0], encoding="utf-8")
    return motor_file.load(str(path))


# ---- the firmware's tables -------------------------------------------------------------------------------------------------
def test_results_have_name_cause_and_remedy_and_steps_go_from_idle_to_full_speed():
    results, steps = identify_result.results(), identify_result.step_names()
    assert sorted(results) == list(range(len(results)))
    assert (results[2].name, results[8].name, steps[0], steps[-1]) == ("DONE", "NOT_TURNING", "IDLE", "MECHANICS")
    for result in results.values():
        assert re.fullmatch("[A-Z_]+", result.name) and len(result.cause) > 10 and len(result.remedy) > 5
        assert '"' not in result.cause + result.remedy


# ---- the neutral header ----------------------------------------------------------------------------------------------------
def defines(known: Known, board=BOARD) -> dict[str, str]:
    return dict(re.findall(r"^#define (\w+) (\S+)$", identify.header(known, board), re.MULTILINE))


def test_the_header_knows_pole_pairs_current_and_speed_of_the_rating_and_nothing_of_what_is_to_be_measured():
    values = defines(Known.of(MOTOR, BOARD))
    assert [values[name] for name in ("NOPOLESPAIRS", "Q_CURRENT_REF_OPENLOOP", "END_SPEED_RPM")] == ["5", "1.53", "1120"]
    assert not {"2.67", "1.92", "7.24", "5.5e-06"} & set(defines(Known(5, 1.0, 1000.0)).values())
    # a bus below the rating lowers the speed, and current and speed can be given
    assert Known.of(replace(MOTOR, rated_voltage_v=48.0), BOARD).speed_rpm == approx(560.0, abs=5e-8)
    assert Known.of(MOTOR, BOARD, 0.7, 800.0) == Known(5, 0.7, 800.0)


@pytest.mark.parametrize("full_scale_a", [33.0, 46.0])
def test_a_board_for_large_currents_builds_too(full_scale_a):
    """With the placeholders of the MCLV the back-EMF's number format would overflow."""
    values = defines(Known(4, 17.0, 1400.0), replace(BOARD, current_full_scale_a=full_scale_a))
    assert constants.header(values).wrong == []
    assert defines(Known(4, 1.0, 1400.0))["MOTOR_RS_OHM"] == "1"


@pytest.mark.parametrize("name", MOTORS)
def test_current_stays_below_the_boards_trip(name):
    known = Known.of(motor_file.load(name), BOARD)
    assert 1.2 * known.current_a < float(defines(known)["OVER_CURRENT_THRESHOLD_A"])


# ---- one run ---------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("identify") / "result"
    code, out, error = command("identify", HURST, "--quiet", "--out", str(folder))
    assert (code, error) == (0, "")
    return SimpleNamespace(folder=folder, out=out, summary=json.loads((folder / "summary.json").read_text(encoding="utf-8")))


def test_every_value_is_within_its_limit_and_close_to_the_truth(run):
    assert run.summary["result"] == "DONE"
    limits = {row["name"].split(" [")[0]: row for row in run.summary["rows"][1:]}
    assert {name: row["limit_percent"] for name, row in limits.items()} == {
        "R winding": 3.0, "Ld": 5.0, "Lq": 5.0, "Kphi": 2.0, "J": 10.0, "friction at 50 % of rated speed": 10.0, "friction at rated speed": 10.0}
    assert all(abs(row["error_percent"]) < row["limit_percent"] / 3.0 for row in limits.values()), limits


def test_table_shows_loop_and_winding_and_every_step_is_in_the_protocol_once(run):
    assert re.search(r"R loop \[mohm\] +269\d\.\d\d +2692\.50", run.out)
    assert re.search(r"R winding \[mohm\] +26[67]\d\.\d\d +2670\.00 +[+-]0\.\d\d +3 +PASS", run.out)
    assert [step["step"] for step in run.summary["steps"]][1:-1] == identify_result.step_names()[1:]


def test_the_lines_to_paste_are_a_motor_file(run, tmp_path):
    lines = (run.folder / "motor.toml").read_text(encoding="utf-8")
    assert lines.strip() in run.out
    (tmp_path / "pasted.toml").write_text(lines, encoding="utf-8")
    found = motor_file.load(str(tmp_path / "pasted.toml"))
    assert (found.board, found.rated_torque_nm) == ("mclv", MOTOR.rated_torque_nm)
    for name in ("rs_ohm", "ld_h", "kphi_v_per_krpm"):
        assert getattr(found, name) == approx(getattr(MOTOR, name), rel=0.01)
    for name in ("inertia_kgm2", "coulomb_nm", "viscous_nms"):
        assert getattr(found, name) == approx(getattr(MOTOR, name), rel=0.1)
    (line,) = re.findall(r"^#define MOTOR_INERTIA_KGM2 .*", run.out, re.MULTILINE)
    assert float(line.split()[2]) == found.inertia_kgm2
    assert not found.salient
    # plots and header are there
    assert all((run.folder / f"{name}.png").stat().st_size > 10000 for name in ("resistance", "inductance", "back_emf"))
    assert "#define NOPOLESPAIRS 5\n" in (run.folder / "userparams.h").read_text(encoding="utf-8")


# ---- the verdict on made-up measurements -----------------------------------------------------------------------------------
def item(fault: str = "NONE", temp_c: float = 25.0, load_nm: float = 0.0, **watch: int) -> identify_result.Identified:
    values = {"motor.rs_ohm": 2.67, "motor.ld_h": 1.92e-3, "motor.lq_h": 1.92e-3, "motor.psi_vs": 7.983e-3, "motor.pole_pairs": 5,
              "motor.r_tempco": 0.0039, "motor.psi_tempco": -0.002, "motor.temp_c": temp_c, "mech.inertia_kgm2": 5.5e-6,
              "mech.coulomb_nm": 4e-3, "mech.viscous_nms": 15.3e-6, "load.constant_nm": load_nm}
    full = {"step": 0, "result": 2, "Rs_uohm": 2692000, "Ld_nH": 1920000, "Lq_nH": 1920000, "Kphi_uV_per_krpm": 7240000, "J_1e9_kgm2": 5500,
            "Coulomb_1e8_Nm": 400000, "Viscous_1e9_Nms": 15300} | watch
    measured = identify_result.Measured(full, fault, [(0.0, 0)], None)
    return identify_result.Identified(MOTOR, BOARD, Known(5, 1.5, 1000.0), "", values, measured)


@pytest.mark.parametrize("watch, problems", [
    ({}, 0), ({"Rs_uohm": 2772000}, 0), ({"Rs_uohm": 2773000}, 1), ({"Ld_nH": 2015000}, 0), ({"Ld_nH": 2017000}, 1), ({"Lq_nH": 1825000}, 0),
    ({"Lq_nH": 1823000}, 1), ({"Kphi_uV_per_krpm": 7384000}, 0), ({"Kphi_uV_per_krpm": 7386000}, 1), ({"temp_c": 75.0}, 2), # hot: other true values
    ({"temp_c": 75.0, "Rs_uohm": round(2670e3 * 1.195 + 22500), "Kphi_uV_per_krpm": round(7240e3 * 0.9)}, 0),
    # 1400 rpm: 4 + 15.3e-3 * 146.6 = 6.243 mN m; 2800 rpm: 8.486 mN m; a brake counts as friction
    ({"J_1e9_kgm2": 6040}, 0), ({"J_1e9_kgm2": 6060}, 1), ({"J_1e9_kgm2": 4940}, 1), ({"Coulomb_1e8_Nm": 462000}, 0), ({"Coulomb_1e8_Nm": 463000}, 1),
    ({"Viscous_1e9_Nms": 15300 + 2850}, 0), ({"Viscous_1e9_Nms": 15300 + 2920}, 1), ({"load_nm": 0.002}, 2),
    ({"load_nm": 0.002, "Coulomb_1e8_Nm": 600000}, 0)])
def test_each_limit_is_kept(watch, problems):
    assert len(item(**watch).problems()) == problems


def test_friction_is_compared_up_to_the_speed_that_the_bus_allows():
    """24 V and 60 V/krpm: 400 rpm, and at the rated 2800 the error of the viscous part would count seven times."""
    strong = item(Kphi_uV_per_krpm=60000000, Viscous_1e9_Nms=15300 + 9000)
    strong.values["motor.psi_vs"] *= 60.0 / 7.24
    assert strong.problems() == []
    assert [row["name"] for row in strong.rows()[-2:]] == ["friction at 200 rpm [uN m]", "friction at 400 rpm [uN m]"]
    strong.measured.watch["Viscous_1e9_Nms"] += 45000 # 54e-6 * 41.9 = 2.3 mN m too much; ten per cent of five steps of the converter are 2.1 mN m
    assert [line.partition(" is off")[0] for line in strong.problems()] == ["friction at 400 rpm [uN m]"], strong.rows()


def test_salient_motors_get_both_inductances():
    assert 'inductance = { value = 3.86, unit = "mH line-to-line"' in item(Lq_nH=1940000).paste()
    lines = item(Lq_nH=2500000).paste()
    assert "inductance_d = { value = 3.84," in lines and "inductance_q = { value = 5," in lines


@pytest.mark.parametrize("connection", ["Y", "delta"])
@pytest.mark.parametrize("watch", [{}, {"Lq_nH": 2500000}])
def test_the_lines_to_paste_suit_a_star_and_a_delta(tmp_path, connection, watch):
    motor = pasted(item(**watch).paste(), tmp_path / "pasted.toml", connection)
    assert (motor.rs_ohm, motor.ld_h) == (approx(2.6695, abs=1e-3), approx(1.92e-3, abs=1e-6))


def test_another_end_is_one_line_with_the_remedy():
    for told, words in (({"result": 9}, "VOLTAGE_LIMIT.*lower END_SPEED_RPM"),
                        ({"result": 3, "fault": "OVERCURRENT_SW"}, "fault OVERCURRENT_SW")):
        (line,) = item(**told).problems()
        assert re.search(words, line), line


# ---- the whole range -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("result, values, missing", [
    ("INERTIA_RANGE", ("R loop", "R winding", "Ld", "Lq", "Kphi"), "# inertia is missing: INERTIA_RANGE, the inertia is not between"),
    ("FRICTION_RANGE", ("R loop", "R winding", "Ld", "Lq", "Kphi", "J"), "")])
def test_a_value_beyond_the_range_is_named_and_not_printed(result, values, missing):
    number = next(number for number, found in identify_result.results().items() if found.name == result)
    found = item(result=number)
    assert [row["name"].split(" [")[0] for row in found.rows()] == list(values)
    (line,) = found.problems()
    assert line.startswith(f"{result}: the ") and "R, L" in line
    assert missing in found.paste() and "friction =" not in found.paste() and ("inertia =" in found.paste()) == (not missing)


def test_the_printed_file_is_tuned_as_it_stands():
    assert item().tuner() == ""
    assert "make tune" not in item().text()


def test_a_motor_that_the_law_cannot_run_is_told_so_in_one_line():
    assert "[mechanical]" in item(result=12).tuner() or "inertia" in item(result=12).tuner() # not measured
    small = item(Rs_uohm=22500 + 5000, Ld_nH=10000, Lq_nH=10000)
    assert "is impossible" in small.tuner()
    (line,) = [line for line in small.text().splitlines() if "make tune" in line]
    assert line.startswith("`make tune` refuses this motor: 'resistance' = 0.01 ohm line-to-line is impossible")


def test_an_inertia_that_no_rotor_has_is_a_load_in_the_printed_file():
    found = item(J_1e9_kgm2=2000000)
    assert "[load]" in found.file() and found.tuner() == ""
    motor = motor_file.read(Document(MOTOR.path, found.file()))
    assert motor.inertia_kgm2 + motor.load_inertia_kgm2 == approx(2e-3, rel=1e-3) and motor.load_inertia_kgm2 > 0.0


def test_a_current_above_what_the_firmware_takes_is_cut():
    assert Known.of(replace(MOTOR, rated_current_a=30.0), replace(BOARD, current_full_scale_a=41.0)).current_a == 20.0


def test_the_table_of_the_range_reaches_its_corners():
    found = identify_range.cases()
    values = [case.motor.plant_values().values | case.changes.values for case in found]
    for key, low, high in (("motor.rs_ohm", 0.005, 20.0), ("motor.lq_h", 1e-5, 0.02), ("mech.inertia_kgm2", 1e-7, 1.0), ("mech.coulomb_nm", 1e-4, 1.0)):
        assert (min(value[key] for value in values), max(value[key] for value in values)) == (approx(low), approx(high)), key
    assert len(found) >= 12 and len({case.board.name for case in found}) >= 4


# ---- refusals --------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("arguments, says", [
    ((), "which motor?"), ((HURST, "--all"), "which motor?"), (("no_such",), "no motor 'no_such'"),
    ((HURST, "--current", "0.01"), "current = 0.01 is impossible"), ((HURST, "--speed", "9000"), "speed = 9000 is impossible"),
    (("--all", "--out", "x"), "one folder"), ((HURST, "--set", "load.lock=1"), "unknown key 'load.lock'"),
    ((HURST, "--current", "4.2"), "MAXIMUM_CURRENT_A = 4.2 must be below OVER_CURRENT_THRESHOLD_A")]) # by the build
def test_mistakes_on_the_command_line(arguments, says):
    refused(command("identify", *arguments), says)


def test_with_all_every_file_that_cannot_be_used_gets_its_line(tmp_path, monkeypatch):
    (tmp_path / "broken.toml").write_text("x = = 1", encoding="utf-8")
    (tmp_path / "no_board.toml").write_text('board = "no_such"\n' + FILE, encoding="utf-8")
    monkeypatch.setattr(paths, "MOTORS", tmp_path)
    code, out, error = command("identify", "--all")
    assert (code, out) == (2, "") and re.fullmatch(r"foc33: TOML syntax, .*broken\.toml line 1.*\nfoc33: no board 'no_such', .*no_board\.toml line 1.*\n", error)
