"""BRINGUP names what is wrong with every miswired board, and finds nothing on the right one; another motor on a board of another shunt, too."""

import re
from dataclasses import replace

import pytest

from tools.bench import bringup, build, command_common
from tools.common import board_file, motor_file, paths
from tuning import design, header

TABLE = bringup.read()
NAMES = [variant.name for variant in TABLE.variants]
OTHERS = ["right", "shunts_inverted", "gains_double", "bus_divider", "offset_a", "dead_time_short", "open_c", "other_motor"]
"""For the other motor: the right board, and boards whose lines have numbers of motor and board. `make bringup MOTOR=` runs all."""
LEAVES = {
    "CURRENT": ("noise_b", "pot_dead", "pot_reversed", "buttons_swapped", "leds_swapped", "led_run_dark", "uart_other_pin"),
    "MARK": ("motor_ab", "motor_bc", "motor_ca", "drivers_ab", "drivers_bc", "drivers_ca", "currents_swapped", "shunt_a_inverted", "shunt_b_inverted",
             "shunts_inverted", "dead_time_long", "dead_time_short", "other_motor")}
"""Boards that have nothing left to be found from a question on: from there they are the right one."""
OTHER_MOTOR, OTHER_BOARD = "trinamic_qbl4208_41_04_006", str(paths.ROOT / "examples/my_board.toml")
SAYS = {
    "bus_divider": r"WRONG BUS: bus 19\.\d\d V, expected 21\.60 \.\. 26\.40 V", "offset_b": r"WRONG OFFSET B: .* 1\.0\d\d A, expected -0\.550 \.\. 0\.550 A",
    "dead_time_long": r"WRONG DEAD_TIME: .* (2\.9|3\.0)\d\d us", "dead_time_short": r"WRONG DEAD_TIME: .* 1\.1\d\d us", "pole_pairs": r"WRONG POLE_PAIRS: .* 3, expected 5",
    "other_motor": r"WRONG RESISTANCE: .* 5\.\d\d\d ohm", "gain_b_more": r"WRONG RATIO: .* 1[23]\d %", "noise_b": r"WRONG NOISE B: .* 0\.0[78]\d A",
    "pot_dead": r"WRONG POT_LEFT: .* 50 %", "uart_other_pin": r"ask BEGIN: .* RC5"}
"""A line that a variant's run must have."""


def rows_on(motor_name: str, board_name: str, folder, names: list[str]) -> dict[str, dict]:
    """Variants with the header that the tuner writes."""
    motor, board = motor_file.load(motor_name), board_file.load(board_name)
    (folder / build.HEADER).write_text(header.write(design.design(motor, board)), encoding="utf-8")
    library = command_common.library_for([bringup.MODE], None, folder)
    parts = motor_file.part(motor_name), board_file.part(board_name)
    jobs = [bringup.prepare(variant, library, *parts) for variant in TABLE.variants if variant.name in names]
    leaves = {name: question for question, left in LEAVES.items() for name in left}
    return {row["name"]: row for row in bringup.simulate([replace(job, leaves=leaves.get(job.variant.name, "")) for job in jobs], True)}


@pytest.fixture(scope="module")
def hurst(tmp_path_factory):
    return rows_on(TABLE.motor, TABLE.board, tmp_path_factory.mktemp("bringup_hurst"), NAMES)


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    return rows_on(OTHER_MOTOR, OTHER_BOARD, tmp_path_factory.mktemp("bringup_other"), OTHERS)


@pytest.mark.parametrize("name", NAMES)
def test_a_board_gets_its_findings_and_no_other(name, hurst):
    assert hurst[name]["verdict"] == "ok", "\n".join(hurst[name]["lines"])


@pytest.mark.parametrize("name", OTHERS)
def test_another_motor_on_another_board_too(name, other):
    assert other[name]["verdict"] == "ok", "\n".join(other[name]["lines"])


@pytest.mark.parametrize("name", SAYS)
def test_the_line_has_what_was_measured_and_what_is_expected(name, hurst):
    assert re.search(SAYS[name], "\n".join(hurst[name]["lines"])), "\n".join(hurst[name]["lines"])


def test_a_board_that_is_left_early_has_its_findings_before(hurst):
    left = [name for names in LEAVES.values() for name in names]
    assert set(left) < set(NAMES) and len(left) == len(set(left)) and not {"right", "gains_double"} & set(left)
    for question, names in LEAVES.items():
        for name in names:
            assert f"ask {question}:" in hurst[name]["lines"][-1], name


def test_current_stays_at_its_share_while_the_signals_are_right(hurst):
    assert 0.5 < hurst["right"]["current_max_a"] < 1.05 * 0.3 * 2.75 # BRINGUP_CURRENT_SHARE of MAXIMUM_CURRENT_A


def test_without_a_finding_of_rest_no_current_flows(hurst):
    for name in ("bus_divider", "offset_a", "offset_b", "fault_dead", "fault_inverted", "s2_dead", "s3_dead"):
        assert hurst[name]["current_max_a"] == 0.0, name


def test_each_finding_names_the_line_to_change_or_what_to_look_at(hurst):
    told = [row["fix"] for row in hurst.values() if row["fix"]]
    assert len(told) >= len(NAMES) - 1
    for name, key in (("gains_half", "NORM_CURRENT_CONST"), ("shunt_b_inverted", "KCURRB"), ("pole_pairs", "NOPOLESPAIRS"), ("bus_divider", "BUS_FULL_SCALE_V"),
                      ("dead_time_long", "DEADTIME_SEC"), ("currents_swapped", "BOARD_PIN_CURRENT_A"), ("drivers_ca", "BOARD_PIN_PWM_A")):
        assert key in hurst[name]["fix"]
