"""The numbers that were chosen by trial: the rows of include/control/tuned.h, and the header with one of them changed."""

import functools
import math
import re
from dataclasses import dataclass

from . import paths
from .errors import UserError

HEADER = "control/tuned.h"
TABLE = paths.ROOT / "include" / HEADER
SHIFT = "shift"
"""The unit of a number whose step is a factor of two."""
_ROW = re.compile(r"#define (\w+) (-?[\d.]+)(u?) +/\* \[([^\]]+)\] (.+) \| (\S[^|]*\S) \*/")
_SECTION = re.compile(r"/\* ---- (.+) ---- \*/")


@dataclass(frozen=True)
class Row:
    """One number. `value` as it is written; `command` is the target of make that shows its effect."""

    name: str
    value: str
    suffix: str
    unit: str
    meaning: str
    command: str
    section: str

    @property
    def is_whole(self) -> bool:
        return "." not in self.value

    def changed(self, percent: float) -> str:
        """The value changed by so many per cent: a whole number by one at least, a shift by one step of it."""
        sign = math.copysign(1.0, percent)
        if self.unit == SHIFT:
            return f"{int(self.value) + int(sign)}"
        change = float(self.value) * percent / 100.0
        return f"{int(self.value) + round(sign * max(1.0, abs(change)))}" if self.is_whole else f"{float(self.value) + change:.6g}"


@functools.cache
def tuned() -> dict[str, Row]:
    """Every row by name, in the order of the table."""
    return read(TABLE.read_text(encoding="utf-8"))


def read(text: str) -> dict[str, Row]:
    """The rows of a table's text; a line that defines a number and is no row is refused."""
    found: dict[str, Row] = {}
    section = ""
    for number, line in enumerate(text.splitlines(), 1):
        if titled := _SECTION.fullmatch(line):
            section = titled[1]
        elif row := _ROW.fullmatch(line):
            found[row[1]] = Row(*row.groups(), section)
        elif line.startswith("#define ") and not line.endswith("_H"):
            raise UserError(f"a row cannot be read: {line[:60]}", f"{paths.shown(TABLE)}:{number}", "write #define NAME value /* [unit] meaning | make target */")
    return found


def with_value(text: str, row: Row, value: str) -> str:
    """The table's text with another value in a row."""
    return text.replace(f"#define {row.name} {row.value}{row.suffix} ", f"#define {row.name} {value}{row.suffix} ")
