"""The workbook tuning/tuning_params.xlsx: it is what the script writes, and recalculated by LibreOffice it agrees with make tune."""

import functools
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from openpyxl.utils import column_index_from_string
from pytest import approx
from support import MOTORS
from tune_support import CHECK, HURST, INCLUDES, build, of

from tuning import constants, spreadsheet

PUBLISHED = {3.95: {"NORM_RS": 12990, "NORM_LSDTBASE": 1460, "NORM_INVKFIBASE": 7956, "NORM_DELTAT": 1790, "D_ILIMIT_HS": 1502, "D_ILIMIT_LS": 6117},
             7.09: {"NORM_RS": 23316, "NORM_LSDTBASE": 2620, "NORM_INVKFIBASE": 7956},
             22.0: {"NORM_RS": 9044, "NORM_LSDTBASE": 8129, "NORM_INVKFIBASE": 7956}}
"""AN1292's constants for the Hurst at some currents of full scale."""
FUNCTIONS = {"IF", "IFERROR", "AND", "OR", "NOT", "INDEX", "MATCH", "ISNUMBER", "MIN", "MAX", "ROUND", "INT", "SQRT", "LN", "LOG10", "PI", "SUBSTITUTE", "COUNTIF"}
COMMA = """<?xml version="1.0" encoding="UTF-8"?>
<oor:items xmlns:oor="http://openoffice.org/2001/registry"><item oor:path="/org.openoffice.Setup/L10N">
<prop oor:name="ooSetupSystemLocale" oor:op="fuse"><value>de-DE</value></prop></item></oor:items>
"""
Place = tuple[str, str]
"""The yellow cell of a row: sheet, beginning of the row's label."""
CASES: dict[str, tuple[str, dict[Place, Any]]] = {
    **{name: (name, {}) for name in MOTORS}, "empty": (spreadsheet.OWN, {}),
    "own": (spreadsheet.OWN, {("Motor", x.label): constants.number_of(of(HURST).params[x.parameter]) * x.factor
                              for rows in spreadsheet.DATA.values() for x in rows}
            | {("Parameters", name): 15 if text == "0xF" else text if text.startswith("NORM") else float(text)
               for name, text in of(HURST).params.items() if name not in spreadsheet.FORMULAS}),
    "bridge": (HURST, {("Parameters", "MOTOR_RS_OHM"): 2.0, ("Parameters", "BRIDGE_RS_OHM"): 0.67}),
    **{f"{amperes} A": (HURST, {("Motor", "Ipeak"): amperes} | ({("Constants", "NORM_RS"): 4} if amperes > 10 else {})) for amperes in PUBLISHED}}


class Recalculated:
    """A copy of the workbook with some inputs, as LibreOffice computes it."""

    def __init__(self, path: Path) -> None:
        book = openpyxl.load_workbook(path, data_only=True)
        self.names = named(book)
        self.sheets = {sheet.title: [list(row) for row in sheet.iter_rows(values_only=True)] for sheet in book}
        self.lines = [str(row[0] or "") for row in self.sheets["Paste"][3:]]
        self.params = {match[1]: match[2] for match in (re.match(r"#define (\w+) +(\S+)", line) for line in self.lines) if match}

    def __getitem__(self, name: str) -> Any:
        sheet, column, row = self.names[name]
        return self.sheets[sheet][row - 1][column - 1]

    def red(self) -> int:
        """Check cells that are not ok."""
        column = {"Motor": 5, "Parameters": 6, "Constants": 8}
        cells = [row[column[title]] for title, rows in self.sheets.items() if title in column for row in rows[4:] if len(row) > column[title]]
        return sum(cell not in (None, "ok", "Check") for cell in cells)


def named(book: openpyxl.Workbook) -> dict[str, tuple[str, int, int]]:
    """Named cells: sheet, column, row."""
    found = book.defined_names
    found = found.definedName if hasattr(found, "definedName") else found.values() # openpyxl 3.0, 3.1
    matches = {name.name: re.fullmatch(r"'?([^'!]+)'?!\$?([A-Z]+)\$?(\d+)", name.attr_text) for name in found}
    return {name: (match[1], column_index_from_string(match[2]), int(match[3])) for name, match in matches.items() if match}


def recalculate(cases: dict[str, tuple[str, dict[Place, Any]]], locale: str = "") -> dict[str, Recalculated]:
    """One run of LibreOffice for all cases."""
    office = shutil.which("soffice") or shutil.which("libreoffice")
    if office is None:
        raise AssertionError("LibreOffice is missing: install it (Debian: apt-get install --no-install-recommends libreoffice-calc-nogui)")
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name, (motor, yours) in cases.items():
            book = openpyxl.load_workbook(spreadsheet.FILE)
            book["Motor"]["B4"].value = motor
            for (title, label), value in yours.items():
                row = next(cell.row for cell in book[title]["A"] if str(cell.value or "").startswith(label))
                book[title][f"{'E' if title == 'Constants' else 'C'}{row}"].value = value
            book.save(root / f"{name}.xlsx")
        if locale:
            (root / "profile" / "user").mkdir(parents=True)
            (root / "profile" / "user" / "registrymodifications.xcu").write_text(locale, encoding="utf-8")
        subprocess.run([office, "--headless", f"-env:UserInstallation=file://{root}/profile", "--convert-to", "xlsx:Calc MS Excel 2007 XML", "--outdir",
                        str(root / "out"), *(str(root / f"{name}.xlsx") for name in cases)], check=True, capture_output=True, timeout=300)
        return {name: Recalculated(root / "out" / f"{name}.xlsx") for name in cases}


@functools.cache
def recalculated() -> dict[str, Recalculated]:
    return recalculate(CASES)


def numbers(params: dict[str, str]) -> dict[str, Any]:
    return {name: text if text.startswith("NORM") else constants.number_of(text) for name, text in params.items()}


every_motor = pytest.mark.parametrize("name", MOTORS)


# ---- the file --------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def book() -> openpyxl.Workbook:
    return openpyxl.load_workbook(spreadsheet.FILE)


def chosen(book: openpyxl.Workbook) -> list[str]:
    """The motors of a workbook: the project's, and what a user has added to it."""
    return [cell.value for cell in book["Motors"][4]][1:-1]


def contents(book: openpyxl.Workbook) -> dict[str, Any]:
    """Everything that matters in a workbook."""
    return {"names": named(book), **{sheet.title: (
        {cell.coordinate: (cell.value, cell.fill.start_color.rgb) for row in sheet for cell in row},
        sorted((str(rule.sqref), rule.formula1, rule.formula2) for rule in sheet.data_validations.dataValidation)) for sheet in book}}


def test_the_committed_file_is_what_the_script_writes_and_writing_twice_gives_the_same_bytes(tmp_path, book):
    new, again = tmp_path / "new.xlsx", tmp_path / "again.xlsx"
    for path in (new, again):
        assert spreadsheet.write(path, chosen(book)) == 0
    assert new.read_bytes() == again.read_bytes()
    written = openpyxl.load_workbook(new)
    assert written.sheetnames == book.sheetnames and contents(written) == contents(book), "run: make spreadsheet"


def test_every_motor_can_be_chosen_and_every_input_refuses_what_is_impossible(book):
    assert set(MOTORS) <= set(chosen(book)) and book["Motors"][4][-1].value == spreadsheet.OWN
    for sheet in book.worksheets[1:]:
        rules = sheet.data_validations.dataValidation
        inputs = {cell.coordinate for row in sheet for cell in row if cell.fill.start_color.rgb == "00FFF2B3"}
        assert inputs == {ranges.coord for rule in rules for ranges in rule.sqref.ranges}, sheet.title
        assert all(len(text) <= 255 for rule in rules for text in (rule.error, rule.formula1))


def test_formulas_and_names_are_what_every_spreadsheet_takes(book):
    for place, formula in ((f"{sheet.title}!{cell.coordinate}", cell.value) for sheet in book for row in sheet for cell in row):
        if str(formula or "").startswith("="):
            assert set(re.findall(r"([A-Z][A-Z0-9.]*)\(", re.sub(r'"[^"]*"', "", formula))) <= FUNCTIONS, place
            assert all(len(text) < 255 for text in re.findall(r'"([^"]*)"', formula)), place
    names = list(named(book))
    assert len({name.lower() for name in names}) == len(names)
    assert not [name for name in names if re.fullmatch(r"(?i)[a-z]{1,3}\d+|r|c|r\d*c\d*", name)]


# ---- against the command ---------------------------------------------------------------------------------------------------
@every_motor
def test_the_lines_of_every_motor_are_the_tuners_and_the_build_accepts_them(name):
    assert numbers(recalculated()[name].params) == numbers(of(name).params)
    assert build("\n".join(recalculated()[name].lines) + "\n", *CHECK, includes=INCLUDES[:2]) == ""


@every_motor
def test_its_constants_are_those_of_the_compiled_header(name):
    rows = recalculated()[name].sheets["Constants"]
    start = next(i for i, row in enumerate(rows) if str(row[0]).startswith("The firmware's"))
    found = {row[0]: (row[2], row[5]) for row in rows[start:] if isinstance(row[5], (int, float))}
    assert set(found) == {row[0] for rows in spreadsheet.CONSTANTS.values() for row in rows}
    for key, (exact, stored) in found.items():
        # Single precision may round the other way where the exact value lies on the edge.
        edge = abs(exact % 1.0 - 0.5) < 3e-6 * abs(exact)
        assert stored == approx(of(name).constant(key).q_value, rel=0.0, abs=edge + 1e-9), key


@every_motor
def test_no_formula_fails_and_no_check_is_red(name):
    found = recalculated()[name]
    errors = [cell for rows in found.sheets.values() for row in rows for cell in row if re.match(r"#(?!define|error|if|end)", str(cell))]
    assert (errors, found.red()) == ([], 0)


def test_a_motor_of_ones_own_needs_its_numbers_and_then_gets_the_same_lines():
    empty, own = recalculated()["empty"], recalculated()["own"]
    assert "#error MOTOR_RS_OHM needs a value" in empty.lines and empty["motor_column"] > len(MOTORS) and empty.red() > 30
    assert numbers(own.params) == numbers(of(HURST).params) and own.red() == 0


def test_a_comma_as_decimal_sign_changes_no_line():
    assert recalculate({"comma": (HURST, {})}, COMMA)["comma"].lines == recalculated()[HURST].lines


def test_the_bridge_s_resistance_is_a_line_of_its_own_and_counts_beside_the_winding():
    found, usual = recalculated()["bridge"], recalculated()[HURST]
    assert found.sheets["Constants"] == usual.sheets["Constants"] and found.red() == 0
    assert {name: text for name, text in found.params.items() if text != usual.params.get(name)} == {"MOTOR_RS_OHM": "2", "BRIDGE_RS_OHM": "0.67"}


@pytest.mark.parametrize("amperes, wanted", PUBLISHED.items())
def test_published_constants_come_out_to_the_last_digit(amperes, wanted):
    assert {name: recalculated()[f"{amperes} A"][f"AN1292_{name}"] for name in wanted} == wanted
