"""The plant of a run: motor file, board file and the scenario's overrides, checked against the virtual board's own list of keys."""

from dataclasses import dataclass
from pathlib import Path
from typing import Mapping

from . import board_file, motor_file
from .errors import UserError, suggestion
from .plant_overrides import Value, Values

__all__ = ["Key", "Part", "Value", "Values", "check", "read_board", "read_motor", "resolve"]


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


@dataclass(frozen=True)
class Part:
    """A motor or board file as the virtual board sees it."""

    path: Path
    title: str
    values: Values


def read_motor(name: str, where: str = "") -> Part:
    """tuning/motors/NAME.toml or a path, in the form that motor_file.py describes, as keys of the virtual board."""
    motor = motor_file.load(name, where)
    return Part(motor.path, motor.title, motor.plant_values())


def read_board(name: str, where: str = "") -> Part:
    """tuning/boards/NAME.toml or a path, in the form that board_file.py describes, as keys of the virtual board."""
    board = board_file.load(name, where)
    return Part(board.path, board.title, board.plant_values())


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
