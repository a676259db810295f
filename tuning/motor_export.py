"""A motor file for a userparams.h that was tuned by hand: the motor's own file with other values, so that `make tune` gives that header again.

What motor and rating are goes into their tables; what the tuner would choose otherwise goes into [tune]. What a motor file cannot say is told."""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Table

from tools.common import board_file, motor_file, paths
from tools.common.board_file import BoardFile
from tools.common.errors import UserError
from tools.common.motor_file import FACTS, Motor
from tools.common.param_rows import modes
from tools.common.toml_file import Document

from .constants import number_of
from .design import design

SOURCE = "tuned by hand"
SAME = 5e-6
"""Relative difference: the tuner writes six digits."""
ROUNDED = {"MOTOR_INERTIA_KGM2": 1e-3, "MOTOR_SALIENCY_UH": 1e-3}
"""Of these it writes fewer."""
ROUNDS = 4
"""A value that is kept may change what the tuner chooses for another one; more than two are never needed."""
SPREADS = {"MOTOR_RS_OHM": ("resistance", "rs_ohm", 1.0), "MOTOR_LS_MH": ("inductance", "ls_h", 1e-3), "MOTOR_KPHI_V_PER_KRPM": ("kphi", "kphi_v_per_krpm", 1.0)}
"""Key in [spread], the motor's name of it, and its unit."""
DIRECT = {"MOTOR_RS_OHM": ("electrical.resistance", 2.0, "ohm line-to-line"), "MOTOR_KPHI_V_PER_KRPM": ("electrical.kphi", 1.0, "V peak line-to-line/krpm"),
          "MAXIMUM_SPEED_RPM": ("rating.maximum_speed", 1.0, "rpm"), "MAXIMUM_CURRENT_A": ("rating.maximum_current", 1.0, "A peak")}
HEAD, LEFT = "# A motor file with values that were tuned by hand", "# Not in it:"
Row = tuple[Any, str]
"""A value and its unit; a value of None takes the row away."""


def motor_text(path: Path, board: BoardFile, values: Mapping[str, str], others: Mapping[str, str] | None = None) -> tuple[str, list[str]]:
    """The file's text, and what it cannot hold, each with the reason.

    `path`: the motor's file; `board`: the one that it shall turn on; `values`: every parameter of the header by name, as it is written there;
    `others`: what else the header defines."""
    text = _with_board(_without_head(Document(path).text), path, board)
    params = design(_motor(path, text), board).params
    text = _with_facts(path, text, {name: value for name, value in values.items() if name in FACTS and not _same(name, params[name], value)}, values)
    for _ in range(ROUNDS):
        wrong = {name: value for name, value in _different(path, text, board, values).items() if name not in FACTS and _is_number(value)}
        if not wrong:
            break
        text = _with_rows(path, text, {f"tune.{name}": _round(number_of(value)) for name, value in wrong.items()})
    unused = {"I2T_TIME_SEC"} if values.get("I2T_CURRENT_A") == "0" else set()
    wanted = {name: value for name, value in {**values, **(others or {})}.items() if name not in unused}
    left = _left(design(_motor(path, text), board).params, wanted)
    where = " ".join(str(paths.shown(path)).split())
    return "\n".join([f"{HEAD}; it takes the place of {where}.", *([f"{LEFT} {', '.join(left)}."] if left else []), text]), left


def _motor(path: Path, text: str) -> Motor:
    return motor_file.read(Document(path, text))


def _without_head(text: str) -> str:
    """Without what an export before this one has told."""
    lines = text.splitlines(keepends=True)
    while lines and lines[0].startswith((HEAD, LEFT)):
        del lines[0]
    return "".join(lines)


def _with_board(text: str, path: Path, board: BoardFile) -> str:
    """With the board that it shall turn on, found from any folder."""
    document, own = tomlkit.parse(text), board.path.resolve()
    name = own.stem if own.parent == paths.BOARDS.resolve() else str(own)
    named = board_file.load(*board_file.named(_motor(path, text))).path.resolve()
    if named == own and not paths.is_path(str(document.get("board", ""))):
        return text
    if "board" not in document: # first of all: behind a table it would be that table's
        return f'board = {tomlkit.item(name).as_string()}\n{text}'
    document["board"] = name
    return tomlkit.dumps(document)


# ---- what differs --------------------------------------------------------------------------------------------------------
def _is_number(text: str) -> bool:
    """Else it is an expression, or another parameter's name."""
    with contextlib.suppress(ValueError):
        number_of(text)
        return True
    return False


def _same(name: str, one: str, other: str) -> bool:
    if not (_is_number(one) and _is_number(other)):
        return one == other
    a, b = number_of(one), number_of(other)
    return abs(a - b) <= ROUNDED.get(name, SAME) * max(abs(a), abs(b))


def _different(path: Path, text: str, board: BoardFile, values: Mapping[str, str]) -> dict[str, str]:
    """Parameters that the tuner does not choose as they are wanted: all that it chooses, where those that are kept do not go with its own."""
    motor = _motor(path, text)
    try:
        tuned = design(motor, board).params
    except UserError:
        every = {name: wanted for name, wanted in values.items() if name not in FACTS and _is_number(wanted)}
        if motor.tune.keys() >= every.keys():
            raise
        return every
    return {name: wanted for name, wanted in values.items() if name in tuned and not _same(name, tuned[name], wanted)}


def _left(made: Mapping[str, str], wanted: Mapping[str, str]) -> list[str]:
    """What is not as it was wanted, each with the reason."""
    return [f"{name} {text}".rstrip() + f" ({_reason(name, text, name in made)})" for name, text in wanted.items() if name not in made or not _same(name, made[name], text)]


def _reason(name: str, text: str, made: bool) -> str:
    if name in modes():
        return "a mode"
    if not _is_number(text):
        return "no number"
    if FACTS.get(name, "").startswith("the board"):
        return "a board file says it"
    if name in FACTS:
        return f"it follows from {FACTS[name]}, as far as make tune allows"
    return "the tuner makes it of other values" if made else "the header alone has it"


# ---- what is written -----------------------------------------------------------------------------------------------------
def _with_facts(path: Path, text: str, changed: Mapping[str, str], values: Mapping[str, str]) -> str:
    """With what the motor is, in its tables."""
    motor = _motor(path, text)
    facts = {name: number_of(value) for name, value in changed.items() if _is_number(value)}
    if "NOPOLESPAIRS" in facts and _is_number(values["MOTOR_KPHI_V_PER_KRPM"]): # in some units Kphi has them in it
        facts["MOTOR_KPHI_V_PER_KRPM"] = number_of(values["MOTOR_KPHI_V_PER_KRPM"])
    rows: dict[str, Row] = {DIRECT[name][0]: (_round(DIRECT[name][1] * value), DIRECT[name][2]) for name, value in facts.items() if name in DIRECT}
    if "NOPOLESPAIRS" in facts:
        rows["electrical.pole_pairs"] = (int(facts["NOPOLESPAIRS"]), "")
    rows |= _thermal(facts, values) | _inertia(motor, facts) | _inductances(motor, facts)
    for name, (key, of, unit) in SPREADS.items():
        low, high = motor.spread.get(of, (0.0, 0.0))
        if name in facts and high and (not low <= facts[name] * unit <= high or "NOPOLESPAIRS" in facts):
            rows[f"spread.{key}"] = (None, "") # the loops hold for what is measured now
    return _with_rows(path, text, {key: {"value": value, **({"unit": unit} if unit else {}), "source": SOURCE} if value is not None else None
                                   for key, (value, unit) in rows.items()})


def _thermal(facts: Mapping[str, float], values: Mapping[str, str]) -> dict[str, Row]:
    """I2t: both of its numbers, or none."""
    if not facts.keys() & {"I2T_CURRENT_A", "I2T_TIME_SEC"} or not all(_is_number(values[name]) for name in ("I2T_CURRENT_A", "I2T_TIME_SEC")):
        return {}
    current_a, time_s = (number_of(values[name]) for name in ("I2T_CURRENT_A", "I2T_TIME_SEC"))
    return {"rating.current": (_round(current_a), "A peak"), "rating.thermal_time": (_round(time_s), "s")} if current_a else {"rating.thermal_time": (None, "")}


def _inertia(motor: Motor, facts: Mapping[str, float]) -> dict[str, Row]:
    """What turns with the rotor is what one knows least of; below the rotor's own there is none."""
    if "MOTOR_INERTIA_KGM2" not in facts:
        return {}
    load_kgm2 = facts["MOTOR_INERTIA_KGM2"] - motor.inertia_kgm2
    if motor.load_inertia_kgm2 and load_kgm2 > 0.0:
        return {"load.inertia": (_round(load_kgm2), "kg m2")}
    return {"mechanical.inertia": (_round(facts["MOTOR_INERTIA_KGM2"]), "kg m2")} | ({"load.inertia": (None, "")} if motor.load_inertia_kgm2 else {})


def _inductances(motor: Motor, facts: Mapping[str, float]) -> dict[str, Row]:
    """MOTOR_LS_MH is that of the q axis, MOTOR_SALIENCY_UH what the d axis has less."""
    if not facts.keys() & {"MOTOR_LS_MH", "MOTOR_SALIENCY_UH"}:
        return {}
    lq_mh = facts.get("MOTOR_LS_MH", motor.lq_h * 1e3)
    less_mh = facts["MOTOR_SALIENCY_UH"] * 1e-3 if "MOTOR_SALIENCY_UH" in facts else (motor.lq_h - motor.ld_h) * 1e3
    none: Row = (None, "")
    if less_mh <= 0.0:
        return {"electrical.inductance": (_round(2.0 * lq_mh), "mH line-to-line"), "electrical.inductance_d": none, "electrical.inductance_q": none}
    return {"electrical.inductance": none, "electrical.inductance_d": (_round(2.0 * (lq_mh - less_mh)), "mH line-to-line"),
            "electrical.inductance_q": (_round(2.0 * lq_mh), "mH line-to-line")}


def _round(value: float) -> int | float:
    value = float(f"{value:.7g}")
    return int(value) if value.is_integer() else value


def _with_rows(path: Path, text: str, rows: Mapping[str, Any]) -> str:
    """The file with these rows, by table and key."""
    document = tomlkit.parse(text)
    for key, value in rows.items():
        table, _, name = key.partition(".")
        if table not in document:
            document.add(tomlkit.nl())
            document.add(table, tomlkit.table())
        _put(document[table], name, value)
    changed = tomlkit.dumps(document)
    data = Document(path, changed).data
    for key, value in rows.items():
        table, _, name = key.partition(".")
        if data.get(table, {}).get(name) != value:
            raise UserError(f"[{table}] {name} cannot be changed", str(paths.shown(path)), f"write [{table}] once, each of its keys on a line, and try again")
    return changed


def _put(rows: Any, key: str, value: Any) -> None:
    """A row that replaces the one that is there; None takes it away."""
    if value is None:
        rows.pop(key, None)
        return
    if isinstance(value, dict):
        inline = tomlkit.inline_table()
        inline.update(value)
        value = inline
    after = []
    body = rows.value.body if isinstance(rows, Table) else []
    while key not in rows and body and body[-1][0] is None: # what stands above the next table
        after.append(body.pop())
    rows[key] = value
    body.extend(reversed(after))
