"""Keys of the virtual board with their values from motor file, board file, scenario and command line, checked against the board's own list."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from .errors import UserError, suggestion
from .toml_file import Section, flatten

Value = float | tuple[str, float]
"""A number, or ("factor", number) to multiply what the earlier sources gave."""


@dataclass
class Values:
    """Keys with values from one source; `where` says where each was written."""

    values: dict[str, Value] = field(default_factory=dict)
    where: dict[str, str] = field(default_factory=dict)

    @classmethod
    def from_section(cls, section: Section | None) -> "Values":
        """The numbers and factors of a [plant] table."""
        if section is None:
            return cls()
        values = flatten(section, factors=True)
        return cls(values, {key: section.where(key) for key in values})

    def add(self, key: str, value: Value, where: str) -> None:
        """One more key."""
        self.values[key] = value
        self.where[key] = where


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
    board: str = ""
    """The board that a motor file names."""
    board_where: str = ""


def check(key: str, value: float, keys: Mapping[str, Key], where: str) -> None:
    """Refuse a key that the board does not have, or a value that it would refuse."""
    if key.startswith("reg."):
        info = Key(key, "", "", 0.0, 65535.0, True, True)
    elif key in keys and keys[key].writable:
        info = keys[key]
    else:
        writable = [name for name, info in keys.items() if info.writable]
        what = f"'{key}' can only be read" if key in keys else f"unknown key '{key}'"
        raise UserError(what, where, suggestion(key, writable, "`make keys`"))
    if not info.minimum <= value <= info.maximum:
        unit = f" {info.unit}" if info.unit else ""
        raise UserError(f"'{key}' = {value:g} is impossible", where, f"choose {info.minimum:g} .. {info.maximum:g}{unit}")


OF_HEADER = {"input.pot_live_zero": "POT_LIVE_ZERO", **{f"ntc.{sensor}_{part}": f"{sensor}_NTC_{part}".upper()
                                                      for sensor in ("motor", "bridge") for part in ("ohm", "beta_k", "divider_ohm")}}
"""Keys of the board that are as the header says, unless a file says otherwise."""


def of_header(params: Mapping[str, float]) -> dict[str, float]:
    """Their values."""
    return {key: params[name] for key, name in OF_HEADER.items() if name in params}


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
