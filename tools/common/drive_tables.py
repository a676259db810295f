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


@cache
def faults() -> tuple[Row, ...]:
    """Why the drive has stopped; the first is that of no fault."""
    return _read("drive/faults.h", "DRIVE_FAULT_TABLE")


@cache
def limits() -> tuple[Row, ...]:
    """Why the drive gives less than it is asked for."""
    return _read("drive/limit_reasons.h", "DRIVE_LIMIT_TABLE")


def _read(header: str, macro: str) -> tuple[Row, ...]:
    return tuple(Row(int(code), *texts) for code, *texts in rows("include", header, macro, "#code #name cause remedy"))
