"""What userparams.h is made of: the rows of include/drive/param_limits.h with unit, range, default and meaning, and the modes."""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass

from . import paths, tuned_rows
from .errors import UserError
from .x_macro import rows

TABLE = paths.ROOT / "include" / "drive" / "param_limits.h"
SCALING = TABLE.with_name("scaling")
"""One header a subject."""
ENTRIES = 18
"""Parameters of a field-weakening table: stem0 .. stem17."""
FOLLOWS = {"FROM_MOTOR": "motor file", "FROM_BOARD": "board file", "FROM_TUNER": "tuner"}
"""Defaults that are no number: what the value follows from."""
FROM_DEFINES = ("SCOPE", "DIRECTION_INPUT_USED", "FAULT_OUTPUT_USED", "RUNNING_OUTPUT_USED", "BRAKE_CHOPPER_V", "BRAKE_CHOPPER_SHARE", "BRAKE_CHOPPER_SEC",
                "MOTOR_NTC_USED", "BRIDGE_NTC_USED", "PARAMS_KEPT")
"""Parameters that DEFINES may set instead of userparams.h, which asks about them."""
_GROUP = re.compile(r"#define PARAM_\w+\(X\) /\* (.+?) \*/(.*)")
_ROW = re.compile(r'(PARAM_ENTRIES\(X, |X\()(\w+), "([^"]*)", ([^,()]+), ([^,()]+), ([^,()]+), "([^"]*)"\)')


@dataclass(frozen=True)
class Parameter:
    """One define of userparams.h. Range and default are kept as they are written."""

    name: str
    unit: str
    low: str
    high: str
    default: str
    """a number, or a key of FOLLOWS"""
    meaning: str
    section: str
    stem: str = ""
    """of the table whose entry this is"""

    @property
    def span(self) -> str:
        """The range as a message tells it: a bare number has no unit."""
        return f"{self.low} .. {self.high}" + (f" {self.unit}" if self.unit != "1" else "")


@functools.cache
def number(name: str) -> float:
    """A limit of the table's relations, a unit of the scaling headers or a tuned number, that is a macro of its own."""
    texts = [path.read_text(encoding="utf-8") for path in (TABLE, tuned_rows.TABLE, *sorted(SCALING.glob("*.h")))]
    found = re.search(rf"^#define {name} ([\d.]+)u?(?= |$)", "".join(texts), re.MULTILINE)
    if found is None:
        raise UserError(f"{name} cannot be read", str(paths.shown(TABLE)), f"write #define {name} and its number, there or in {paths.shown(tuned_rows.TABLE)}")
    return float(found[1])


def duties_are_late(period_s: float) -> bool:
    """True where the firmware's duties act a period later: DEFER_DUTIES of scaling/current_voltage.h."""
    return period_s < 0.9999 * number("DEFER_BELOW_SEC")


def slow_periods(period_s: float) -> int:
    """Periods of a step of four slots: SLOW_PERIODS of scaling/current_voltage.h."""
    return int(number("SLOW_PERIODS_IN_TIME")) * (2 if duties_are_late(period_s) else 1)


def phase_ohm(params: Mapping[str, float]) -> float:
    """The estimator's resistance, PARAM_PHASE_OHM of scaling/estimator.h: winding, and the bridge's where a header has it."""
    return params["MOTOR_RS_OHM"] + params.get("BRIDGE_RS_OHM", 0.0)


@functools.cache
def parameters() -> dict[str, Parameter]:
    """Every parameter by name, in the order of the table."""
    found: dict[str, Parameter] = {}
    for section, row_text in _GROUP.findall(TABLE.read_text(encoding="utf-8").replace("\\\n", " ")):
        left = _ROW.sub("", row_text).strip()
        if left:
            raise UserError(f"a row cannot be read: {left[:60]}", str(paths.shown(TABLE)), "write X(NAME, \"unit\", minimum, maximum, default, \"meaning\")")
        for macro, name, *columns in _ROW.findall(row_text):
            for each in (f"{name}{i}" for i in range(ENTRIES)) if macro.startswith("PARAM") else (name,):
                found[each] = Parameter(each, *columns, section, name if each != name else "")
    return found


@functools.cache
def modes() -> dict[str, str]:
    """Every mode and what it does, in the order of include/drive/modes/mode_table.h."""
    return {name: meaning for name, meaning in rows("include", "drive/modes/mode_table.h", "MODE_TABLE", "#name meaning")}


def with_values(header: str, values: Mapping[str, str]) -> str:
    """The text of a userparams.h with other values, comments and order kept."""
    for name, value in values.items():
        header, found = re.subn(rf"^([ \t]*#[ \t]*define[ \t]+{name}[ \t]+)(\S+)", lambda m: m[1] + value, header, flags=re.MULTILINE)
        if found != 1:
            raise UserError(f"'{name}' is not defined once", "userparams.h", "give a complete userparams.h")
    return header


def texts_of(header: str) -> dict[str, str]:
    """The value of each parameter that the text of a userparams.h defines, as it is written there."""
    found = re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+)[ \t]+(\S+)", header, re.MULTILINE)
    return {name: text for name, text in found if name in parameters()}
