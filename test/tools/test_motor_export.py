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
    (HURST, {"I2T_CURRENT_A": "1.5", "I2T_TIME_SEC": "20"}),
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


def test_a_time_constant_of_zero_takes_its_row_away():
    _, board, params = of(HURST)
    with motor_path(('maximum_current = { value = 2.75', 'thermal_time = { value = 30, unit = "s", source = "test" }\nmaximum_current = { value = 2.75')) as path:
        assert design(motor_file.load(str(path)), board).params["I2T_TIME_SEC"] == "30"
        text, _ = motor_text(path, board, params)
    assert "thermal_time" not in text
    assert 'current = { value = 1.53, unit = "A peak", source = "test" }' in text


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


def test_what_only_a_board_file_says_and_what_the_tuner_does_not_allow_is_told_with_its_value():
    text, left, _, _ = exported(IPM, NOMINAL_BUS_V="25.5", MOTOR_LS_MH="1.9")
    assert left == ["NOMINAL_BUS_V 25.5 (a board file says it)", "MAXIMUM_SPEED_RPM 4000 (it follows from [rating] maximum_speed, as far as make tune allows)"]
    assert text.splitlines()[1] == f"# Not in it: {', '.join(left)}."


@pytest.mark.parametrize("name, changes, parts", [
    (HURST, {"MOTOR_RS_OHM": "3.4"}, ("too low for 2800 rpm at half the rated torque", "raise the supply voltage")),
    (HURST, {"IDREF_SPEED4": "MY_CURRENT"}, ("IDREF_SPEED4 is MY_CURRENT", "write a number")),
    (IPM, {"MOTOR_LS_MH": "0.8"}, ("'inductance_d' = -0.", "is impossible"))])
def test_a_motor_that_cannot_be_is_refused_in_one_line(name, changes, parts):
    refusal(lambda: exported(name, **changes), *parts)
