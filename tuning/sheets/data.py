"""The data sheets behind the choosers: every motor file, every board file, and the units with their factors to SI."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from openpyxl.utils import get_column_letter

from tools.common import board_file, units
from tools.common.units import Kind

from .book import Book

OWN = "own motor"
FIRST = 3  # column of the first file


@dataclass(frozen=True)
class UnitKind:
    """A kind of quantity: its range in SI, and its units' factors for a star and a delta motor."""

    name: str
    star: Kind
    delta: Kind
    per_pole_pair: frozenset[str] = frozenset()
    """Units whose factor has to be multiplied by the number of pole pairs."""

    def limits(self) -> tuple[float, float]:
        """Smallest and largest number that makes sense in any of the units."""
        ends = [conversion.given(end) for conversion in self.star.units.values() for end in (self.star.minimum, self.star.maximum)
                if not (conversion.reciprocal and end == 0.0)]
        return min(ends), max(ends)


def _kinds() -> dict[str, UnitKind]:
    one, two = units.kphi("Y", 1), units.kphi("Y", 2)
    per_pole_pair = frozenset(unit for unit in one.units if one.units[unit].factor != two.units[unit].factor)
    result = {"resistance": UnitKind("resistance", units.resistance("Y"), units.resistance("delta")),
              "inductance": UnitKind("inductance", units.inductance("Y"), units.inductance("delta")),
              "kphi": UnitKind("kphi", one, units.kphi("delta", 1), per_pole_pair)}
    for name in ("RESISTANCE_TEMPCO", "KPHI_TEMPCO", "INERTIA", "LOAD_INERTIA", "VISCOUS", "FRICTION", "TORQUE", "SPEED", "VOLTAGE", "CURRENT"):
        result[name.lower()] = UnitKind(name.lower(), getattr(units, name), getattr(units, name))
    for table, keys in board_file.TABLES.items():
        for key, (_, kind) in keys.items():
            result[f"{table}.{key}"] = UnitKind(f"{table}.{key}", kind, kind)
    return result


KINDS = _kinds()


def unit_name(kind: UnitKind) -> str:
    """The defined name of the range that lists the units of a kind."""
    return "unit_" + kind.name.replace(".", "_")


def units_page(book: Book) -> None:
    """A block of rows for each kind: unit, factor for star and delta, times pole pairs or not, reciprocal or not."""
    page = book.page("Units", [26, 28, 18, 18, 12, 12, 14, 14, 24], "A5A5A5",
                     "Factors from a data sheet's unit to SI and one star phase; made from tools/common/units.py, where the equations stand.")
    page.heads(["Quantity", "Unit", "Factor, star", "Factor, delta", "x pole pairs", "Reciprocal", "Smallest (SI)", "Largest (SI)", "SI unit"],
               freeze=True)
    for kind in KINDS.values():
        first = page.row
        for unit, conversion in kind.star.units.items():
            delta = kind.delta.units.get(unit)
            row = page.next_row()
            page.put(f"A{row}", kind.name, "label")
            page.put(f"B{row}", unit, "label")
            page.put(f"C{row}", conversion.factor, "value", "General")
            page.put(f"D{row}", delta.factor if delta else None, "value", "General")
            page.put(f"E{row}", int(unit in kind.per_pole_pair), "value")
            page.put(f"F{row}", int(conversion.reciprocal), "value")
            page.put(f"G{row}", kind.star.minimum, "value", "General")
            page.put(f"H{row}", kind.star.maximum, "value", "General")
            page.put(f"I{row}", kind.star.si_unit, "unit")
        book.name(unit_name(kind), "Units", f"B{first}:B{page.row - 1}")
        book.name("factor_" + unit_name(kind)[5:], "Units", f"C{first}:F{page.row - 1}")


class DataPage:
    """Files side by side: a row for each number, unit, source; formulas pick the chosen file's column."""

    def __init__(self, book: Book, title: str, files: dict[str, dict[str, Any]], lead: str, column_name: str, spare: str = "") -> None:
        self.title = title
        self.column_name = column_name
        names = list(files) + ([spare] if spare else [])
        self.last = get_column_letter(FIRST + len(names) - 1)
        page = book.page(title, [30, 12] + [34] * len(names), "A5A5A5", lead)
        page.heads(["Key of the file", "Part"] + names, freeze=True)
        page.ws.freeze_panes = f"C{page.row}"
        header = page.row - 1
        book.name(f"{column_name}_names", title, f"C{header}:{self.last}{header}")
        self.rows: dict[tuple[str, str], int] = {}
        for key, part in _all_keys(files.values()):
            row = page.next_row()
            self.rows[key, part] = row
            page.put(f"A{row}", key, "name")
            page.put(f"B{row}", part, "unit")
            for i in range(len(names)):
                value = files.get(names[i], {}).get((key, part))
                page.put(f"{get_column_letter(FIRST + i)}{row}", value, "label")

    def has(self, key: str, part: str = "value") -> bool:
        return (key, part) in self.rows

    def pick(self, key: str, part: str = "value") -> str:
        """A formula's text (no "="): the chosen file's entry, "" if it has none."""
        if not self.has(key, part):
            return '""'
        row = self.rows[key, part]
        entry = f"INDEX('{self.title}'!$C${row}:${self.last}${row},1,{self.column_name})"
        return f'IF({entry}="","",{entry})'


def _all_keys(files: Any) -> list[tuple[str, str]]:
    """Every (key, part) of the files: in the order of the first file that has it, the parts of a key together."""
    order: dict[str, dict[str, None]] = {}
    for file in files:
        for key, part in file:
            order.setdefault(key, {})[part] = None
    return [(key, part) for key, parts in order.items() for part in parts]


def entries(path: Path) -> dict[tuple[str, str], Any]:
    """A TOML file's leaves as (table.key, part): value."""
    result: dict[tuple[str, str], Any] = {}
    for key, value in tomllib.loads(path.read_text(encoding="utf-8")).items():
        if not isinstance(value, dict):
            result[key, "value"] = value
            continue
        for inner, leaf in value.items():
            parts = leaf if isinstance(leaf, dict) else {"value": leaf}
            for part, item in parts.items():
                result[f"{key}.{inner}", part] = _cell(item)
    return result


def _cell(item: Any) -> Any:
    if isinstance(item, list):
        return " .. ".join(f"{number:g}" for number in item)
    return int(item) if isinstance(item, bool) else item
