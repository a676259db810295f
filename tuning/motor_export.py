"""A motor file for a userparams.h that was tuned by hand: the motor's own file with other values, so that `make tune` gives that header again.

What motor and rating are goes into their tables; what the tuner would choose otherwise goes into [tune]. What only a board file says is told."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit

from tools.common import motor_file, paths
from tools.common.board_file import BoardFile
from tools.common.errors import UserError
from tools.common.motor_file import FACTS, Motor
from tools.common.toml_file import Document

from .constants import number_of
from .design import design

SOURCE = "tuned by hand"
SAME, FACTS_SAME = 1e-6, 1e-3
"""Relative difference of a value of [tune], and of one that the tuner rounds."""
ROUNDS = 4
"""A value that is kept may change what the tuner chooses for another one; more than two are never needed."""
HEAD = "# A motor file with values that were tuned by hand; it takes the place of {}.\n"
LEFT = "# Not in it: {}.\n"


def motor_text(path: Path, board: BoardFile, values: Mapping[str, str]) -> tuple[str, list[str]]:
    """The file's text, and what it cannot hold, each with the reason.

    `path`: the motor's file; `values`: every parameter of the header by name, as it is written there."""
    text = _placed(Document(path).text, path)
    for _ in range(ROUNDS):
        wrong = _different(path, text, board, values)
        changed = _with_values(text, motor_file.read(Document(path, text)), wrong)
        if changed == text:
            break
        text = changed
    left = [f"{name} {text} ({'a board file says it' if FACTS[name].startswith('the board') else f'it follows from {FACTS[name]}, as far as make tune allows'})"
            for name, text in wrong.items()]
    return HEAD.format(paths.shown(path)) + (LEFT.format(", ".join(left)) if left else "") + text, left


def _placed(text: str, path: Path) -> str:
    """A board that is named by a path is found from any folder."""
    document = tomlkit.parse(text)
    name = str(document.get("board", ""))
    if not paths.is_path(name):
        return text
    document["board"] = str(Path(paths.beside(name, path)[0]).resolve())
    return tomlkit.dumps(document)


def _different(path: Path, text: str, board: BoardFile, values: Mapping[str, str]) -> dict[str, str]:
    """Parameters that the tuner does not choose as they are wanted: all that it chooses, where those that are kept do not go with its own."""
    motor = motor_file.read(Document(path, text))
    try:
        tuned = design(motor, board).params
    except UserError:
        every = {name: wanted for name, wanted in values.items() if name not in FACTS and _is_number(wanted)}
        if motor.tune.keys() >= every.keys():
            raise
        return every
    return {name: wanted for name, wanted in values.items() if name in tuned and not _same(name, tuned[name], wanted)}


def _is_number(text: str) -> bool:
    """Else it is another parameter's name."""
    with contextlib.suppress(ValueError):
        number_of(text)
        return True
    return False


def _same(name: str, one: str, other: str) -> bool:
    if not (_is_number(one) and _is_number(other)):
        return one == other
    a, b = number_of(one), number_of(other)
    return abs(a - b) <= (FACTS_SAME if name in FACTS else SAME) * max(abs(a), abs(b))


def _with_values(text: str, motor: Motor, wanted: Mapping[str, str]) -> str:
    """The file with these values, as far as a motor file has a place for them."""
    document = tomlkit.parse(text)
    for key, (value, unit) in _rows(motor, {name: number_of(text) for name, text in wanted.items() if name in FACTS}).items():
        table, _, name = key.partition(".")
        _put(document, table, name, {"value": value, **({"unit": unit} if unit else {}), "source": SOURCE} if value is not None else None)
        low, high = motor.spread.get({"resistance": "rs_ohm", "kphi": "kphi_v_per_krpm"}.get(name, "ls_h"), (0.0, 0.0)) if table == "electrical" else (0.0, 0.0)
        if low < high and name in document["spread"]:
            del document["spread"][name] # the loops hold for what is measured now
    for name, value in wanted.items():
        if name not in FACTS:
            _put(document, "tune", name, _number(value, name))
    return tomlkit.dumps(document)


def _number(text: str, name: str) -> int | float:
    if not _is_number(text):
        raise UserError(f"{name} is {text}, and a motor file has numbers", "motor file", "write a number")
    return _round(number_of(text))


def _put(document: Any, table: str, key: str, value: Any) -> None:
    """A row that replaces the one that is there; None takes it away."""
    if table not in document:
        document.add(tomlkit.nl())
        document.add(table, tomlkit.table())
    rows = document[table]
    if value is None:
        rows.pop(key, None)
        return
    if isinstance(value, dict):
        inline = tomlkit.inline_table()
        inline.update(value)
        value = inline
    after = []
    while key not in rows and rows.value.body and rows.value.body[-1][0] is None: # what stands above the next table
        after.append(rows.value.body.pop())
    rows[key] = value
    rows.value.body.extend(reversed(after))


def _rows(motor: Motor, facts: Mapping[str, float]) -> dict[str, tuple[Any, str]]:
    """Rows of a motor file by table and key, each with its value and unit, that make these parameters."""
    direct = {"MOTOR_RS_OHM": ("electrical.resistance", 2.0, "ohm line-to-line"), "MOTOR_KPHI_V_PER_KRPM": ("electrical.kphi", 1.0, "V peak line-to-line/krpm"),
              "MAXIMUM_SPEED_RPM": ("rating.maximum_speed", 1.0, "rpm"), "MAXIMUM_CURRENT_A": ("rating.maximum_current", 1.0, "A peak"),
              "I2T_CURRENT_A": ("rating.current", 1.0, "A peak"), "I2T_TIME_SEC": ("rating.thermal_time", 1.0, "s")}
    rows: dict[str, tuple[Any, str]] = {direct[name][0]: (_round(direct[name][1] * value), direct[name][2]) for name, value in facts.items() if name in direct}
    if "NOPOLESPAIRS" in facts:
        rows["electrical.pole_pairs"] = (int(facts["NOPOLESPAIRS"]), "")
    if 0.0 in (facts.get("I2T_CURRENT_A"), facts.get("I2T_TIME_SEC")):
        rows = {key: row for key, row in rows.items() if key != "rating.current"} | {"rating.thermal_time": (None, "")}
    if "MOTOR_INERTIA_KGM2" in facts:
        rows |= _inertia(motor, facts["MOTOR_INERTIA_KGM2"])
    return rows | _inductances(motor, facts)


def _inertia(motor: Motor, whole_kgm2: float) -> dict[str, tuple[Any, str]]:
    """What turns with the rotor is what one knows least of; below the rotor's own there is none."""
    load_kgm2 = whole_kgm2 - motor.inertia_kgm2
    if motor.load_inertia_kgm2 and load_kgm2 > 0.0:
        return {"load.inertia": (_round(load_kgm2), "kg m2")}
    return {"mechanical.inertia": (_round(whole_kgm2), "kg m2")} | ({"load.inertia": (None, "")} if motor.load_inertia_kgm2 else {})


def _inductances(motor: Motor, facts: Mapping[str, float]) -> dict[str, tuple[Any, str]]:
    """MOTOR_LS_MH is that of the q axis, MOTOR_SALIENCY_UH what the d axis has less."""
    if not facts.keys() & {"MOTOR_LS_MH", "MOTOR_SALIENCY_UH"}:
        return {}
    lq_mh = facts.get("MOTOR_LS_MH", motor.lq_h * 1e3)
    less_mh = facts["MOTOR_SALIENCY_UH"] * 1e-3 if "MOTOR_SALIENCY_UH" in facts else (motor.lq_h - motor.ld_h) * 1e3
    none: tuple[Any, str] = (None, "")
    if less_mh <= 0.0:
        return {"electrical.inductance": (_round(2.0 * lq_mh), "mH line-to-line"), "electrical.inductance_d": none, "electrical.inductance_q": none}
    return {"electrical.inductance": none, "electrical.inductance_d": (_round(2.0 * (lq_mh - less_mh)), "mH line-to-line"),
            "electrical.inductance_q": (_round(2.0 * lq_mh), "mH line-to-line")}


def _round(value: float) -> int | float:
    value = float(f"{value:.7g}")
    return int(value) if value.is_integer() else value
