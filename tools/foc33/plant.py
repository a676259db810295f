"""The plant of a run: motor file, board file and the scenario's overrides, checked against the virtual board's own list of keys."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Mapping

from . import places
from .errors import UserError, suggestion
from .toml_file import Document, Section, flatten

MOTOR_NEEDS = ("motor.rs_ohm", "motor.ld_h", "motor.lq_h", "motor.psi_vs", "motor.pole_pairs", "mech.inertia_kgm2")
BOARD_NEEDS = ("supply.voltage_v",)

Value = float | tuple[str, float]
"""A number, or ("factor", number) to multiply what the earlier files gave."""


@dataclass(frozen=True)
class Key:
    """One key of the virtual board."""

    name: str
    unit: str
    meaning: str
    minimum: float
    maximum: float
    readable: bool
    writable: bool


@dataclass
class Values:
    """Keys with values from one source; `where` says where each was written."""

    values: dict[str, Value] = field(default_factory=dict)
    where: dict[str, str] = field(default_factory=dict)

    @classmethod
    def from_section(cls, section: Section | None) -> "Values":
        if section is None:
            return cls()
        values = flatten(section, factors=True)
        return cls(values, {key: section.where(key) for key in values})


@dataclass(frozen=True)
class Part:
    """A motor or board file."""

    path: Path
    title: str
    values: Values


def read_motor(name: str, where: str = "") -> Part:
    """tuning/motors/NAME.toml or a path: title, then the virtual board's keys by table, e.g. [motor] rs_ohm = 2.67."""
    return _read_part("motor", name, places.MOTORS, ("motor", "mech"), MOTOR_NEEDS, where)


def read_board(name: str, where: str = "") -> Part:
    """tuning/boards/NAME.toml or a path: title, then the virtual board's keys by table, e.g. [supply] voltage_v = 24."""
    return _read_part("board", name, places.BOARDS, ("supply", "bus", "inverter", "shunt", "adc", "cpu"), BOARD_NEEDS, where)


def _read_part(kind: str, name: str, folder: Path, tables: tuple[str, ...], needs: tuple[str, ...], where: str) -> Part:
    root = Document(places.find(kind, name, folder, where)).root
    title = root.text("title")
    root.text("source", "")
    result = Values()
    for table in tables:
        section = root.section(table)
        if section is not None:
            for key, value in flatten(section).items():
                result.values[f"{table}.{key}"] = value
                result.where[f"{table}.{key}"] = section.where(key)
    root.close()
    for need in needs:
        if need not in result.values:
            table, key = need.split(".", 1)
            raise UserError(f"'{key}' is missing", root.document.where((table,)), f"add it to [{table}]")
    return Part(root.document.path, title, result)


def check(key: str, value: float, keys: Mapping[str, Key], where: str) -> None:
    """Refuse a key that the board does not have, or a value that it would refuse."""
    if key.startswith("reg."):
        info = Key(key, "", "", 0.0, 65535.0, True, True)
    elif key in keys and keys[key].writable:
        info = keys[key]
    else:
        writable = [name for name, info in keys.items() if info.writable]
        what = f"'{key}' can only be read" if key in keys else f"unknown key '{key}'"
        raise UserError(what, where, suggestion(key, writable))
    if not info.minimum <= value <= info.maximum:
        unit = f" {info.unit}" if info.unit else ""
        raise UserError(f"'{key}' = {value:g} is impossible", where, f"choose {info.minimum:g} .. {info.maximum:g}{unit}")


def resolve(layers: list[Values], keys: Mapping[str, Key]) -> dict[str, float]:
    """Final value of every key: later layers replace or scale earlier ones; what none names keeps the board's default."""
    result: dict[str, float] = {}
    for layer in layers:
        for key, value in layer.values.items():
            where = layer.where.get(key, "")
            if isinstance(value, tuple):
                check(key, result.get(key, keys[key].minimum if key in keys else 0.0), keys, where)
                if key not in result:
                    raise UserError(f"'{key}' has no value to scale", where,
                                    "neither motor nor board file gives it; write a number")
                value = value[1] * result[key]
            check(key, value, keys, where)
            result[key] = value
    return result
