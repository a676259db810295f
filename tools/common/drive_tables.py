"""The firmware's tables of faults, states and reasons for a limit, as its headers have them."""

from dataclasses import dataclass
from functools import cache

from .x_macro import rows


@dataclass(frozen=True)
class Row:
    """A fault, or a reason; `code` is a reason's bit."""

    code: int
    name: str
    cause: str
    remedy: str
    passes: bool = False
    """of a fault: it may pass by itself"""
    decided_by: tuple[str, ...] = ()
    """of a fault: the functions that decide it"""


@cache
def faults() -> tuple[Row, ...]:
    """Why the drive has stopped; the first is that of no fault."""
    table = rows("include", "drive/faults.h", "DRIVE_FAULT_TABLE", "#code #name #passes decided_by cause remedy")
    return tuple(Row(int(code), name, cause, remedy, passes == "FAULT_PASSES", tuple(by.split(", ")) if by else ()) for code, name, passes, by, cause, remedy in table)


@cache
def limits() -> tuple[Row, ...]:
    """Why the drive gives less than it is asked for."""
    return tuple(Row(int(code), *texts) for code, *texts in rows("include", "drive/limits.h", "DRIVE_LIMIT_TABLE", "#code #name cause remedy"))


@dataclass(frozen=True)
class State:
    """What the drive does, and which states may follow: name and reason of each."""

    name: str
    meaning: str
    transitions: tuple[tuple[str, str], ...]


@cache
def states() -> tuple[State, ...]:
    return tuple(State(name, meaning, tuple((to, why) for to, why in rows("include", "drive/states.h", f"TRANSITIONS_FROM_{name}", "#next reason")))
                 for name, meaning in rows("include", "drive/states.h", "DRIVE_STATE_TABLE", "#name meaning"))
