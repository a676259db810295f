"""A workbook that people work in: styles, named cells, yellow input cells with their checks."""

import math
from typing import Any

from openpyxl import Workbook
from openpyxl.formatting.rule import FormulaRule
from openpyxl.styles import Alignment, Border, Font, PatternFill, Side
from openpyxl.utils import get_column_letter
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation

BLUE, PALE, YELLOW, GREY = "1F4E79", "DDE8F3", "FFF2B3", "6B7785"
RED, RED_INK = "F8CBC6", "9C0006"
_LINE = Side(style="thin", color="C9D1DA")
_BOX = Border(left=_LINE, right=_LINE, top=_LINE, bottom=_LINE)


def _fill(color: str) -> PatternFill:
    return PatternFill("solid", start_color=color, end_color=color)


# style: (font, fill, horizontal alignment)
_STYLES: dict[str, tuple[Font, PatternFill | None, str]] = {
    "title": (Font(size=18, bold=True, color=BLUE), None, "left"),
    "lead": (Font(color=GREY), None, "left"),
    "section": (Font(bold=True, size=12, color=BLUE), _fill(PALE), "left"),
    "head": (Font(bold=True, color="FFFFFF"), _fill(BLUE), "center"),
    "label": (Font(color=GREY), None, "left"),
    "code": (Font(name="Consolas", size=10), None, "left"),
    "value": (Font(), None, "right"),
    "result": (Font(bold=True), _fill("EEF3F8"), "right"),
    "input": (Font(color="7A4B00", bold=True), _fill(YELLOW), "right"),
    "check": (Font(color="22662F"), None, "left"),
}


class Page:
    """One sheet; `row` is the next free row."""

    def __init__(self, book: "Book", title: str, widths: list[float], lead: str) -> None:
        self.book, self.ws, self.columns, self.row = book, book.wb.create_sheet(title), len(widths), 4
        self.ws.sheet_view.showGridLines = False
        for i, width in enumerate(widths):
            self.ws.column_dimensions[get_column_letter(i + 1)].width = width
        self._put("A1", title, "title")
        self._put("A2", lead, "lead")
        setup = self.ws.page_setup
        setup.orientation, setup.paperSize, setup.fitToWidth, setup.fitToHeight = "landscape", 9, 1, 0
        self.ws.sheet_properties.pageSetUpPr.fitToPage = True

    def _put(self, cell: str, value: Any, style: str) -> None:
        target, (font, fill, side) = self.ws[cell], _STYLES[style]
        target.value, target.font = value, font
        target.alignment = Alignment(horizontal=side, vertical="center", wrap_text=style == "label")
        if fill:
            target.fill = fill
        if style in ("label", "value", "result", "input", "check"):
            target.border = _BOX
        if style == "label" and isinstance(value, str):
            self._make_room(target)
        if style == "check":
            self.book.checks.setdefault(self.ws.title, []).append(cell)
            self.ws.conditional_formatting.add(cell, FormulaRule([f'NOT(IFERROR({cell}="ok",FALSE))'], fill=_fill(RED), font=Font(color=RED_INK, bold=True)))

    def _make_room(self, target: Any) -> None:
        """Rows do not grow by themselves in every program: as high as the text needs."""
        lines = math.ceil(len(target.value) / (self.ws.column_dimensions[target.column_letter].width - 1.0))
        dimension = self.ws.row_dimensions[target.row]
        dimension.height = max(dimension.height or 0.0, 15.0 * lines)

    def line(self, *cells: tuple[Any, str]) -> int:
        """Writes the next row, (value, style) for each column from A; returns its number."""
        for i, (value, style) in enumerate(cells):
            if style == "check":
                value = f'=IFERROR({value[1:]},"waits for missing values")'
            self._put(f"{get_column_letter(i + 1)}{self.row}", value, style)
        self.row += 1
        return self.row - 1

    def section(self, text: str) -> None:
        """A coloured line across the table."""
        self.row += 1
        self.line(*((text if i == 0 else None, "section") for i in range(self.columns)))

    def heads(self, *texts: str) -> int:
        """The table's head, which stays in view."""
        row = self.line(*((text, "head") for text in texts))
        self.ws.freeze_panes = f"B{row + 1}"
        return row

    def inside(self, cell: str, low: float, high: float) -> str:
        """A check's formula."""
        return f'=IF(ISNUMBER({cell}),IF(AND({cell}>={low!r},{cell}<={high!r}),"ok","impossible: {low:g} .. {high:g}"),"needs a value")'

    def choose(self, cell: str, source: str) -> None:
        """A drop-down."""
        rule = DataValidation("list", formula1=source, allow_blank=False)
        rule.errorTitle, rule.error = "Not in the list", "Choose from the list."
        self._validate(rule, cell)

    def range(self, cell: str, low: float, high: float, what: str) -> None:
        """Only numbers from `low` to `high`, or nothing."""
        ends = [f"{number:.12f}".rstrip("0").rstrip(".") for number in (low, high)]
        rule = DataValidation("decimal", operator="between", formula1=ends[0], formula2=ends[1], allow_blank=True)
        rule.errorTitle, rule.error = "Out of range", f"{what}: a number from {low:g} to {high:g}, or nothing for the value beside it."
        self._validate(rule, cell)

    def _validate(self, rule: DataValidation, cell: str) -> None:
        rule.showErrorMessage, rule.errorStyle = True, "stop"
        rule.add(cell)
        self.ws.add_data_validation(rule)


class Book:
    """The workbook, its named cells and its checks (cells that say "ok")."""

    letter = staticmethod(get_column_letter)

    def __init__(self) -> None:
        self.wb = Workbook()
        self.wb.remove(self.wb.active)
        self.wb.calculation.fullCalcOnLoad = True
        self.checks: dict[str, list[str]] = {}

    def page(self, title: str, widths: list[float], lead: str) -> Page:
        return Page(self, title, widths, lead)

    def name(self, name: str, sheet: str, cells: str) -> None:
        """Gives a cell or a range a name for formulas."""
        self._define(name, f"'{sheet}'!" + ":".join(f"${cell.rstrip('0123456789')}${cell.lstrip('ABCDEFGHIJKLMNOPQRSTUVWXYZ')}" for cell in cells.split(":")))

    def count_red(self) -> None:
        """Names the number of checks on all sheets that are not "ok"; each sheet's stand in one column."""
        parts = []
        for sheet, cells in self.checks.items():
            column = cells[0].rstrip("0123456789")
            parts.append(f"{len(cells)}-COUNTIF('{sheet}'!${column}$1:${column}$999,\"ok\")")
        self._define("red_checks", "+".join(parts))

    def _define(self, name: str, text: str) -> None:
        names = self.wb.defined_names
        add = getattr(names, "append", None) or names.add # openpyxl 3.0, 3.1
        add(DefinedName(name, attr_text=text))
