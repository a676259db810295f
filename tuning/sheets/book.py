"""A workbook that people work in: styles, named cells, input cells with their checks, and a file that is the same every time."""

import math
import re
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from openpyxl import Workbook
from openpyxl.chart import Reference, ScatterChart, Series
from openpyxl.chart.shapes import GraphicalProperties
from openpyxl.drawing.line import LineProperties
from openpyxl.formatting.rule import FormulaRule
from openpyxl.styles import Alignment, Border, Font, PatternFill, Side
from openpyxl.utils import get_column_letter
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation

from tools.common.errors import UserError
from tools.common.paths import shown

INK, BLUE, PALE, YELLOW, GREY = "1F2933", "1F4E79", "DDE8F3", "FFF2B3", "6B7785"
RED, RED_INK, AMBER, AMBER_INK, GREEN_INK = "F8CBC6", "9C0006", "FFE3B8", "7A4B00", "22662F"
LINES = ("1F4E79", "D9822B", "3C8D5A")
_LINE = Side(style="thin", color="C9D1DA")
_BOX = Border(left=_LINE, right=_LINE, top=_LINE, bottom=_LINE)
_DATE = "2000-01-01T00:00:00Z"


def _fill(color: str) -> PatternFill:
    return PatternFill("solid", start_color=color, end_color=color)


def _font(**options: Any) -> Font:
    return Font(**{"name": "Calibri", "size": 11, "color": INK, **options})


# style: (font, fill, boxed, horizontal alignment, wrap)
_STYLES: dict[str, tuple[Font, PatternFill | None, bool, str, bool]] = {
    "title": (_font(size=18, bold=True, color=BLUE), None, False, "left", False),
    "lead": (_font(color=GREY), None, False, "left", False),
    "section": (_font(bold=True, size=12, color=BLUE), _fill(PALE), False, "left", False),
    "head": (_font(bold=True, color="FFFFFF"), _fill(BLUE), True, "center", True),
    "label": (_font(), None, True, "left", True),
    "name": (_font(name="Consolas", size=10), None, True, "left", False),
    "unit": (_font(color=GREY), None, True, "left", False),
    "note": (_font(color=GREY, size=10), None, True, "left", True),
    "wide": (_font(), None, True, "left", False),
    "formula": (_font(name="Consolas", size=9, color=GREY), None, True, "left", True),
    "value": (_font(), None, True, "right", False),
    "result": (_font(bold=True), _fill("EEF3F8"), True, "right", False),
    "input": (_font(color="7A4B00", bold=True), _fill(YELLOW), True, "right", False),
    "input text": (_font(color="7A4B00", bold=True), _fill(YELLOW), True, "left", False),
    "check": (_font(color=GREEN_INK), None, True, "left", True),
    "code": (_font(name="Consolas", size=9), None, False, "left", False),
}


class Page:
    """One sheet; `row` is the next free row."""

    def __init__(self, book: "Book", title: str, widths: list[float], tab: str, lead: str) -> None:
        self.book = book
        self.ws = book.wb.create_sheet(title)
        self.ws.sheet_properties.tabColor = tab
        self.ws.sheet_view.showGridLines = False
        for i, width in enumerate(widths):
            self.ws.column_dimensions[get_column_letter(i + 1)].width = width
        self.columns = len(widths)
        self.put("A1", title, "title")
        self.put("A2", lead, "lead")
        self.ws.row_dimensions[1].height = 28
        self.row = 4
        self._print_setup()

    def _print_setup(self) -> None:
        setup = self.ws.page_setup
        setup.orientation, setup.paperSize, setup.fitToWidth, setup.fitToHeight = "landscape", 9, 1, 0
        self.ws.sheet_properties.pageSetUpPr.fitToPage = True
        self.ws.page_margins.left = self.ws.page_margins.right = 0.4
        self.ws.page_margins.top = self.ws.page_margins.bottom = 0.5
        self.ws.oddFooter.left.text, self.ws.oddFooter.right.text = "foc33 tuning parameters: &A", "&P / &N"

    def put(self, cell: str, value: Any, style: str, form: str = "") -> str:
        """Writes one cell and returns its address."""
        target = self.ws[cell]
        font, fill, boxed, side, wrap = _STYLES[style]
        target.value = value
        target.font = font
        if fill:
            target.fill = fill
        if boxed:
            target.border = _BOX
        target.alignment = Alignment(horizontal=side, vertical="center" if boxed else "bottom", wrap_text=wrap, indent=int(boxed and side == "left"))
        if form:
            target.number_format = form
        if wrap and isinstance(value, str) and not value.startswith("="):
            self._make_room(target, font.size)
        return cell

    def _make_room(self, target: Any, size: float) -> None:
        """Rows do not grow by themselves in every program: as high as the text needs."""
        width = self.ws.column_dimensions[target.column_letter].width * 11.0 / size - 1.0
        lines = math.ceil(len(target.value) / width)
        if lines > 1:
            dimension = self.ws.row_dimensions[target.row]
            dimension.height = max(dimension.height or 0.0, 15.0 * lines)

    def next_row(self) -> int:
        self.row += 1
        return self.row - 1

    def section(self, text: str) -> None:
        """A coloured line across the table, with a free row above it unless it is the first."""
        if self.row > 6:
            self.row += 1
        row = self.next_row()
        for column in range(1, self.columns + 1):
            self.put(f"{get_column_letter(column)}{row}", text if column == 1 else None, "section")

    def heads(self, texts: list[str], freeze: bool = False) -> None:
        row = self.next_row()
        self.ws.row_dimensions[row].height = 32
        for i, text in enumerate(texts):
            self.put(f"{get_column_letter(i + 1)}{row}", text, "head")
        if freeze:
            self.ws.freeze_panes = f"B{row + 1}"
            self.ws.print_title_rows = f"{row}:{row}"

    def name(self, name: str, cell: str) -> None:
        self.book.name(name, self.ws.title, cell)

    def check(self, cell: str, formula: str) -> None:
        """A cell that says "ok", "warning: ..." (amber), or what is wrong (red, and counted)."""
        self.put(cell, f'=IFERROR({formula[1:]},"waits for missing values")', "check")
        self.book.checks.setdefault(self.ws.title, []).append(cell)
        for test, fill, ink in ((f'IFERROR(LEFT({cell},8)="warning:",FALSE)', AMBER, AMBER_INK), (f'NOT(IFERROR({cell}="ok",FALSE))', RED, RED_INK)):
            self.ws.conditional_formatting.add(cell, FormulaRule([test], fill=_fill(fill), font=Font(color=ink, bold=True), stopIfTrue=True))

    def status(self, cell: str, formula: str) -> None:
        """A line about the checks of the whole workbook."""
        self.put(cell, formula, "check")
        self.ws.conditional_formatting.add(cell, FormulaRule(["red_checks<>0"], fill=_fill(RED), font=Font(color=RED_INK, bold=True)))

    def chart(self, title: str, x_title: str, y_title: str, anchor: str, series: list[tuple[str, Reference, Reference]],
              size: tuple[float, float] = (19.0, 9.0)) -> Any:
        """A line chart: (label, x values, y values) for each line."""
        chart = ScatterChart()
        chart.title, chart.x_axis.title, chart.y_axis.title = title, x_title, y_title
        chart.width, chart.height = size
        for axis in (chart.x_axis, chart.y_axis):
            axis.delete, axis.tickLblPos, axis.number_format = False, "low", "General"
            axis.majorGridlines.spPr = GraphicalProperties(ln=LineProperties(solidFill="DFE4EA", w=6350))
        for (label, x, y), color in zip(series, LINES):
            line = Series(y, x, title=label)
            line.smooth, line.marker.symbol = False, "none"
            line.graphicalProperties.line.solidFill, line.graphicalProperties.line.width = color, 19050
            chart.series.append(line)
        if len(series) == 1:
            chart.legend = None
        else:
            chart.legend.position = "b"
        self.ws.add_chart(chart, anchor)
        return chart

    def choose(self, cell: str, source: str, what: str) -> None:
        """A drop-down: `source` is a range or "a,b,c"."""
        rule = DataValidation("list", formula1=source if "$" in source else f'"{source}"', allow_blank=True)
        rule.errorTitle, rule.error = "Not in the list", f"Choose {what} from the list."
        self._validate(rule, cell)

    def range(self, cell: str, low: float, high: float, what: str, whole: bool = False) -> None:
        """Only numbers from `low` to `high`, or nothing."""
        rule = DataValidation("whole" if whole else "decimal", operator="between", formula1=_plain(low), formula2=_plain(high), allow_blank=True)
        kind = "a whole number" if whole else "a number"
        rule.errorTitle, rule.error = "Out of range", f"{what}: {kind} from {low:g} to {high:g}, or nothing for the value beside it."
        rule.promptTitle, rule.prompt = what[:32], f"{low:g} .. {high:g}; leave empty for the value beside it"
        self._validate(rule, cell)

    def _validate(self, rule: DataValidation, cell: str) -> None:
        rule.showErrorMessage, rule.showInputMessage, rule.errorStyle = True, True, "stop"
        rule.add(cell)
        self.ws.add_data_validation(rule)


class Book:
    """The workbook, its named cells and its checks (cells that say "ok")."""

    def __init__(self) -> None:
        self.wb = Workbook()
        self.wb.remove(self.wb.active)
        self.wb.calculation.fullCalcOnLoad = True
        self.names: dict[str, str] = {}
        self.checks: dict[str, list[str]] = {}
        self.rules: dict[str, Any] = {}
        """Every parameter that has a row, with its rule."""

    def page(self, title: str, widths: list[float], tab: str, lead: str) -> Page:
        return Page(self, title, widths, tab, lead)

    def name(self, name: str, sheet: str, cells: str) -> None:
        """Gives a cell or a range a name for formulas."""
        if name.lower() in (known.lower() for known in self.names):
            raise ValueError(f"the name {name} is taken; a spreadsheet takes small and capital letters for the same")
        self.names[name] = f"'{sheet}'!{_absolute(cells)}"
        names = self.wb.defined_names
        add = getattr(names, "append", None) or names.add  # openpyxl 3.0, 3.1
        add(DefinedName(name, attr_text=self.names[name]))

    def red_checks(self, sheet: str) -> str:
        """A formula's text: how many checks of a sheet are neither "ok" nor a warning; they stand in one column."""
        cells = self.checks[sheet]
        column = f"'{sheet}'!{_absolute(cells[0])}:{_absolute(cells[-1])}"
        return f"{len(cells)}-COUNTIF({column},\"ok\")-COUNTIF({column},\"warning:*\")"

    def arrange(self, order: Iterable[str], first: str) -> None:
        """Puts the sheets in order; `first` is the one that is open when the file is."""
        for place, title in enumerate(order):
            self.wb.move_sheet(title, place - self.wb.sheetnames.index(title))
        self.wb.active = self.wb.sheetnames.index(first)
        for sheet in self.wb.worksheets:
            sheet.sheet_view.tabSelected = sheet.title == first

    def save(self, path: Path) -> None:
        """Writes the file; the same content gives the same bytes."""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.wb.save(path)
            _without_dates(path)
        except OSError as error:
            raise UserError(f"cannot write ({error.strerror})", str(shown(path)), "choose a folder that can be written") from None


def _absolute(cells: str) -> str:
    return re.sub(r"([A-Z]+)([0-9]+)", r"$\1$\2", cells)


def _plain(number: float) -> str:
    """A number for a validation rule: no exponent that a reader might not take."""
    return f"{number:.12f}".rstrip("0").rstrip(".")


def _without_dates(path: Path) -> None:
    with zipfile.ZipFile(path) as old:
        members = [(name, old.read(name)) for name in old.namelist()]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name, data in members:
            if name == "docProps/core.xml":
                data = re.sub(rb"\d{4}-\d\d-\d\dT[\d:.]+Z", _DATE.encode(), data)
            new.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
