"""The firmware's tables of faults and of reasons for a limit, as its headers have them."""

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


@cache
def faults() -> tuple[Row, ...]:
    """Why the drive has stopped; the first is that of no fault."""
    table = rows("include", "drive/faults.h", "DRIVE_FAULT_TABLE", "#code #name #passes cause remedy")
    return tuple(Row(int(code), name, cause, remedy, passes == "FAULT_PASSES") for code, name, passes, cause, remedy in table)


@cache
def limits() -> tuple[Row, ...]:
    """Why the drive gives less than it is asked for."""
    return tuple(Row(int(code), *texts) for code, *texts in rows("include", "drive/limit_reasons.h", "DRIVE_LIMIT_TABLE", "#code #name cause remedy"))
