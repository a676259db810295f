"""A header that was tuned by hand, as a motor file: the tuner makes the same header of it."""

from pathlib import Path

import pytest
from pytest import approx
from support import refusal
from tune_support import HURST, motor_path

from tools.common import board_file, motor_file, paths
from tools.common.param_rows import parameters
from tools.common.toml_file import Document
from tuning.constants import number_of
from tuning.design import design
from tuning.motor_export import motor_text

IPM = "ipm_4pp_24v_2000"
MOTORS = sorted(path.stem for path in paths.MOTORS.glob("*.toml"))


def params_of(motor: motor_file.Motor, board: board_file.BoardFile) -> dict[str, str]:
    """Those that have a row in param_limits.h."""
    return {name: text for name, text in design(motor, board).params.items() if name in parameters()}


def of(name: str) -> tuple[Path, board_file.BoardFile, dict[str, str]]:
    """A motor's file, its board, and the parameters of its header."""
    motor = motor_file.load(name)
    board = board_file.load(*board_file.named(motor))
    return motor.path, board, params_of(motor, board)


def exported(name: str, **changes: str) -> tuple[str, list[str], motor_file.Motor, dict[str, str]]:
    """The text, what is not in it, the motor that it says, and the header that is made of it."""
    path, board, params = of(name)
    text, left = motor_text(path, board, params | changes)
    motor = motor_file.read(Document(path, text))
    return text, left, motor, params_of(motor, board)


@pytest.mark.parametrize("name", MOTORS)
def test_where_nothing_was_changed_it_is_the_motor_s_own_file(name):
    path, board, params = of(name)
    text, left = motor_text(path, board, params)
    head, own = text.split("\n", 1)
    assert head.startswith("# A motor file with values that were tuned by hand") and str(paths.shown(path)) in head
    assert (own, left) == (path.read_text(encoding="utf-8"), [])


@pytest.mark.parametrize("name, changes", [
    (HURST, {"SPEED_BANDWIDTH_HZ": "9.5", "IDREF_SPEED4": "-0.61", "UNDER_VOLTAGE_V": "14"}),
    (HURST, {"MOTOR_RS_OHM": "2.8", "MOTOR_LS_MH": "1.9", "MOTOR_INERTIA_KGM2": "0.00004", "SPEED_BANDWIDTH_HZ": "5", "MAXIMUM_SPEED_RPM": "3000"}),
    (HURST, {"MOTOR_KPHI_V_PER_KRPM": "7.4", "NOPOLESPAIRS": "4", "MAXIMUM_CURRENT_A": "2.7", "MAXIMUM_SPEED_RPM": "4000", "RETRY_COUNT": "3"}),
    (HURST, {"I2T_CURRENT_A": "1.5", "I2T_TIME_SEC": "20"}), (HURST, {"I2T_CURRENT_A": "1.5"}),
    (IPM, {"MOTOR_LS_MH": "2.25", "LOCK_TIME": "20000"}), (IPM, {"MOTOR_SALIENCY_UH": "900"}), ("linix_45zwn24_40", {"CURRENT_BANDWIDTH_HZ": "700"})])
def test_make_tune_gives_the_header_back_with_each_value_that_was_changed_and_no_other_one(name, changes):
    _, _, params = of(name)
    _, left, _, made = exported(name, **changes)
    assert left == []
    wanted = params | changes
    different = {key: (made[key], text) for key, text in wanted.items() if made[key] != text and number_of(made[key]) != approx(number_of(text), rel=1e-3)}
    assert different == {} and all(params[key] != text for key, text in changes.items())


def test_what_the_motor_is_stands_in_its_tables_and_what_the_tuner_would_choose_otherwise_in_tune():
    text, _, motor, _ = exported(HURST, MOTOR_RS_OHM="2.8", SPEED_BANDWIDTH_HZ="9.5")
    assert motor.rs_ohm == approx(2.8) and motor.tune["SPEED_BANDWIDTH_HZ"] == 9.5 and "MOTOR_RS_OHM" not in motor.tune
    assert 'resistance = {value = 5.6, unit = "ohm line-to-line", source = "tuned by hand"}' in text
    assert "kphi = { value = 7.24" in text and "# AN1292's Table 1 has R and L swapped" in text # the rest is as it was
    _, _, salient, _ = exported(IPM, MOTOR_SALIENCY_UH="900")
    assert (salient.lq_h, salient.ld_h) == approx((2.2e-3, 1.3e-3))
    _, _, none, _ = exported(IPM, MOTOR_SALIENCY_UH="0")
    assert none.lq_h == none.ld_h == approx(2.2e-3)


def test_a_value_outside_the_file_s_own_spread_ends_the_spread():
    path, _, _ = of(HURST)
    assert "rs_ohm" in motor_file.load(HURST).spread and "[spread]\nresistance" in path.read_text(encoding="utf-8")
    _, _, motor, _ = exported(HURST, MOTOR_RS_OHM="1.9")
    assert "rs_ohm" not in motor.spread and "ls_h" in motor.spread
    _, _, motor, _ = exported(HURST, MOTOR_RS_OHM="2.6")
    assert "rs_ohm" in motor.spread


@pytest.mark.parametrize("time_s", ["30", "60"])
def test_without_i2t_there_is_no_time_constant_whatever_the_header_says_of_it(time_s):
    _, board, params = of(HURST)
    with motor_path(('maximum_current = { value = 2.75', 'thermal_time = { value = 30, unit = "s", source = "test" }\nmaximum_current = { value = 2.75')) as path:
        own = params_of(motor_file.load(str(path)), board)
        assert (own["I2T_CURRENT_A"], own["I2T_TIME_SEC"]) == ("1.53", "30")
        text, left = motor_text(path, board, own | {"I2T_CURRENT_A": "0", "I2T_TIME_SEC": time_s})
        made = params_of(motor_file.read(Document(path, text)), board)
    assert "thermal_time" not in text and made["I2T_CURRENT_A"] == "0" and 'current = { value = 1.53, unit = "A peak", source = "test" }' in text
    assert left == []


def test_a_load_keeps_what_it_has_beside_the_rotor(tmp_path):
    _, board, _ = of(HURST)
    path = tmp_path / "loaded.toml"
    path.write_text((paths.MOTORS / f"{HURST}.toml").read_text(encoding="utf-8") + '\n[load]\ninertia = { value = 2e-5, unit = "kg m2" }\n', encoding="utf-8")
    params = params_of(motor_file.load(str(path)), board)
    for whole, rotor, load in (("0.00004", 5.5e-6, 3.45e-5), ("0.000005", 5e-6, 0.0)):
        text, left = motor_text(path, board, params | {"MOTOR_INERTIA_KGM2": whole})
        motor = motor_file.read(Document(path, text))
        assert (motor.inertia_kgm2, motor.load_inertia_kgm2, left) == (approx(rotor), approx(load), [])


def test_a_board_that_is_named_by_a_path_is_found_from_any_folder(tmp_path):
    (tmp_path / "own.toml").write_bytes((paths.BOARDS / "mclv.toml").read_bytes())
    path = tmp_path / "mine.toml"
    path.write_text('board = "./own.toml"\n' + (paths.MOTORS / f"{HURST}.toml").read_text(encoding="utf-8"), encoding="utf-8")
    board = board_file.load(str(tmp_path / "own.toml"))
    text, _ = motor_text(path, board, params_of(motor_file.load(str(path)), board))
    assert motor_file.read(Document(path, text)).board == str(tmp_path / "own.toml")


def test_the_board_that_it_was_tuned_for_is_in_the_file():
    path, _, _ = of(HURST)
    board = board_file.load("mclv_40khz")
    params = params_of(motor_file.load(HURST), board)
    text, left = motor_text(path, board, params | {"SPEED_BANDWIDTH_HZ": "9.5"})
    motor = motor_file.read(Document(path, text))
    assert motor.board == "mclv_40khz" and left == []
    assert params_of(motor, board_file.load(*board_file.named(motor))) == params | {"SPEED_BANDWIDTH_HZ": "9.5"}


def test_what_an_export_before_has_told_is_not_told_again():
    path, board, params = of(HURST)
    first, left = motor_text(path, board, params | {"NOMINAL_BUS_V": "23"})
    assert len(left) == 1
    with motor_path() as place:
        place.write_text(first, encoding="utf-8")
        second, left = motor_text(place, board, params)
    assert left == [] and second.count("tuned by hand") == 1 and "NOMINAL_BUS_V" not in second


def test_a_small_change_of_what_the_motor_is_counts():
    _, left, motor, made = exported(HURST, MOTOR_RS_OHM="2.672", MOTOR_KPHI_V_PER_KRPM="7.236", MAXIMUM_CURRENT_A="2.752", NOMINAL_BUS_V="24.02")
    assert motor.rs_ohm == approx(2.672) and made["MOTOR_KPHI_V_PER_KRPM"] == "7.236"
    assert left == ["NOMINAL_BUS_V 24.02 (a board file says it)", "MAXIMUM_CURRENT_A 2.752 (it follows from [rating] maximum_current, as far as make tune allows)"]


def test_poles_that_are_in_the_unit_of_kphi_leave_kphi_as_it_is():
    _, board, _ = of(HURST)
    with motor_path(('value = 7.24, unit = "V peak line-to-line/krpm"', 'value = 0.00798, unit = "V s/rad"')) as path:
        params = params_of(motor_file.load(str(path)), board)
        text, left = motor_text(path, board, params | {"NOPOLESPAIRS": "4", "MAXIMUM_SPEED_RPM": "4000"})
        motor = motor_file.read(Document(path, text))
    assert (motor.pole_pairs, left) == (4, []) and motor.kphi_v_per_krpm == approx(float(params["MOTOR_KPHI_V_PER_KRPM"]), rel=1e-5)


@pytest.mark.parametrize("old, new, change", [
    ('title = "a motor"', 'title = "a motor"\ntune.RETRY_COUNT = 1', {"SPEED_BANDWIDTH_HZ": "9.5"}),
    ("resistance = { value = 2.67", 'resistance.source = "test"\nresistance.unit = "ohm phase"\nresistance.value = 2.67 #', {"MOTOR_RS_OHM": "2.5"}),
    ('\n[mechanical]', '\n[electrical.resistance_tempco]\nvalue = 0.39\nunit = "%/K"\nsource = "copper"\n\n[mechanical]', {"MOTOR_RS_OHM": "2.5"})])
def test_other_ways_to_write_a_motor_file_are_changed_too(old, new, change):
    _, board, _ = of(HURST)
    with motor_path((old, new)) as path:
        params = params_of(motor_file.load(str(path)), board)
        text, left = motor_text(path, board, params | change)
        made = params_of(motor_file.read(Document(path, text)), board)
    assert left == [] and {name: made[name] for name in change} == change


def test_what_the_header_alone_has_and_what_is_no_number_is_told():
    _, left, _, _ = exported(IPM, IDREF_SPEED4="MY_CURRENT", NOPOLESPAIRS="+0x4")
    assert left == ["NOPOLESPAIRS +0x4 (no number)", "IDREF_SPEED4 MY_CURRENT (no number)"]
    path, board, params = of(IPM)
    constants = {"D_CURRCNTR_PTERM": "0.14288", "TORQUE_MODE": "", "MY_GAIN": "3"}
    _, left = motor_text(path, board, params | {"CURRENT_BANDWIDTH_HZ": "700"}, constants)
    assert left == ["D_CURRCNTR_PTERM 0.14288 (the tuner makes it of other values)", "TORQUE_MODE (a mode)", "MY_GAIN 3 (the header alone has it)"]


def test_what_only_a_board_file_says_and_what_the_tuner_does_not_allow_is_told_with_its_value():
    text, left, _, _ = exported(IPM, NOMINAL_BUS_V="25.5", MOTOR_LS_MH="1.9")
    assert left == ["NOMINAL_BUS_V 25.5 (a board file says it)", "MAXIMUM_SPEED_RPM 4000 (it follows from [rating] maximum_speed, as far as make tune allows)"]
    assert text.splitlines()[1] == f"# Not in it: {', '.join(left)}."


@pytest.mark.parametrize("name, changes, parts", [
    (HURST, {"MOTOR_RS_OHM": "3.4"}, ("too low for 2800 rpm at half the rated torque", "raise the supply voltage")),
    (IPM, {"MOTOR_LS_MH": "0.8"}, ("'inductance_d' = -0.", "is impossible"))])
def test_a_motor_that_cannot_be_is_refused_in_one_line(name, changes, parts):
    refusal(lambda: exported(name, **changes), *parts)
