"""Each warning of the tuner names a key and a value, and each of its ways is tried: with the change the warning is gone."""

import ast
import functools
import inspect
import re
from dataclasses import replace

import pytest
from test_tune_design import WARNED, parts

from tools.common import board_file, motor_file
from tuning import design_warnings
from tuning.design import Design, design

pytestmark = pytest.mark.release

NUMBER = r"([\d.]+(?:e-?\d+)?)"
MOTOR_KEYS = {"[rating] current": "rated_current_a", "[rating] torque": "rated_torque_nm", "the rated speed": "rated_speed_rpm", "[rating] maximum_speed": "maximum_speed_rpm",
              "[rating] maximum_current": "maximum_current_a", "[load] inertia": "load_inertia_kgm2", "[load] start_torque": "start_torque_nm",
              "[mechanical] coulomb_friction": "coulomb_nm", "[electrical] inductance": "inductance_frequency_hz"}
Parts = tuple[motor_file.Motor, board_file.BoardFile]


def kind(warning: str) -> str:
    """What a warning is about, whatever its numbers."""
    return re.sub(r"\d[\d.]*(e-?\d+)?", "#", warning)[:26]


def ways(warning: str) -> list[str]:
    """The ways that a warning offers."""
    return re.split(r", or (?=raise|lower|set|add|remove|measure|by)", warning.rpartition("; ")[2])


def with_supply(board: board_file.BoardFile, volt: float) -> board_file.BoardFile:
    """A board for another supply: its limits and its divider go with it."""
    ratio = volt / board.nominal_bus_v
    return replace(board, nominal_bus_v=volt, **{name: ratio * getattr(board, name) for name in ("bus_full_scale_v", "over_voltage_v", "under_voltage_v", "regen_limit_v")})


def changed(one: str, motor: motor_file.Motor, board: board_file.BoardFile) -> Parts:
    """Motor and board after what one change asks for."""
    if tuned := re.fullmatch(rf"set (\w+) to {NUMBER} in \[tune\](?:, if the load allows it)?", one):
        return replace(motor, tune=motor.tune | {tuned[1]: float(tuned[2])}), board
    if removed := re.fullmatch(r"remove (\w+) from \[tune\]", one):
        return replace(motor, tune={name: value for name, value in motor.tune.items() if name != removed[1]}), board
    if one == "raise the supply voltage":
        return motor, with_supply(board, 1.3 * board.nominal_bus_v)
    if chokes := re.match(rf"raise \[electrical\] inductance to {NUMBER} mH phase", one):
        return replace(motor, ld_h=1e-3 * float(chokes[1]), lq_h=1e-3 * float(chokes[1])), board
    if one == "remove [load] inertia":
        return replace(motor, load_inertia_kgm2=0.0), board
    if found := re.fullmatch(rf"(?:raise|lower|set|measure|add|)\s?(the supply voltage|the rated speed|\[\w+\] \w+)(?: to|, which the no-load current gives:| at) {NUMBER}(?: .*)?", one):
        key, value = found[1], float(found[2])
        if key == "the supply voltage":
            return motor, with_supply(board, value)
        if key == "[shunt] amplifier_gain":
            return motor, replace(board, current_full_scale_a=board.current_full_scale_a * board.quantities["shunt.amplifier_gain"].value_si / value)
        if key == "[electrical] kphi":
            return replace(motor, kphi_v_per_krpm=value, psi_vs=motor.psi_vs * value / motor.kphi_v_per_krpm), board
        return replace(motor, **{MOTOR_KEYS[key]: value}), board
    raise AssertionError(f"'{one}' names no key that a test can change")


def after(way: str, motor: motor_file.Motor, board: board_file.BoardFile) -> Design:
    """The design after all changes of a way."""
    for one in way.split(" and "):
        motor, board = changed(one, motor, board)
    return design(motor, board)


@functools.cache
def example(name: str) -> tuple[Parts, list[str], set[str]]:
    """A motor with its board, its warnings, and the functions that made them."""
    makers, made, both = set(), design_warnings.warning, parts(**WARNED[name][0])

    def noted(what: str, *more: str) -> str:
        makers.add(inspect.stack()[1].function)
        return made(what, *more)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(design_warnings, "warning", noted)
        return both, design(*both).warnings, makers


@pytest.mark.parametrize("name", WARNED)
def test_after_each_change_that_a_warning_names_it_is_gone(name):
    both, warnings, _ = example(name)
    warning = next(warning for warning in warnings if all(part in f"{warning}$" for part in WARNED[name][1]))
    assert "; " in warning, warning
    for way in ways(warning):
        if not way.startswith("by make"):
            left = after(way, *both).warnings
            assert kind(warning) not in map(kind, left), f"{way}: {left}"


def test_every_warning_that_the_tuner_has_is_among_them():
    tree = ast.parse(inspect.getsource(design_warnings))
    functions = {function.name for function in ast.walk(tree) if isinstance(function, ast.FunctionDef)
                 for call in ast.walk(function) if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "warning"}
    assert functions - set().union(*(example(name)[2] for name in WARNED)) == set()
