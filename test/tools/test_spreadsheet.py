"""The workbook of tuning/tuning_params.xlsx: it is what the script writes, and recalculated by LibreOffice it agrees with `make tune`."""

import dataclasses
import functools
import io
import math
import os
import re
import shutil
import subprocess
import tempfile
import unittest
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
from openpyxl.utils import column_index_from_string

from tools.common import board_file, motor_file, paths
from tuning import constants, design, header, loops, spreadsheet, start

MOTORS = paths.names(paths.MOTORS)
PUBLISHED = {3.95: {"NORM_RS": 12990, "NORM_LSDTBASE": 1460, "NORM_INVKFIBASE": 7956, "NORM_DELTAT": 1790, "D_ILIMIT_HS": 1502, "D_ILIMIT_LS": 6117},
             7.09: {"NORM_RS": 23316, "NORM_LSDTBASE": 2620, "NORM_INVKFIBASE": 7956},
             22.0: {"NORM_RS": 9044, "NORM_LSDTBASE": 8129, "NORM_INVKFIBASE": 7956}}
"""Full-scale current of the published sets, and their constants."""
OWN_DELTA = tuple(("Motor", column, label, value) for label, number, unit in (
    ("Connection", "delta", None), ("Pole pairs", 4, None), ("Resistance (terminals)", 1.2, "ohm winding"), ("... measured at", 20, None),
                                                                              ("Inductance (d axis)", 900, "uH winding"),
    ("Kphi", 140, "rpm/V"), ("Inertia of the rotor", 240, "g cm2"), ("Rated voltage", 24, "V"), ("Rated current", 2, "A rms"),
                                                                              ("Rated torque", 13, "N cm"),
    ("Rated speed", 314.159265, "rad/s"), ("Highest speed wanted", 3500, "rpm")) for column,
                  value in (("D", number), ("E", unit)) if value is not None)
"""A motor that is in no file, in units that no file has."""
CHECKS = {"Motor": 8, "Parameters": 7, "Loops": 7, "Start": 7, "Field weakening": 14, "Constants": 12}
"""Sheets with a column of checks."""
FUNCTIONS = set("IF IFERROR AND OR NOT INDEX MATCH ISNUMBER SUM MIN MAX ROUND INT ABS MOD SQRT LN LOG10 EXP PI SIN COS ATAN2 FIXED SUBSTITUTE REPT "
                "LEN LEFT MID COUNT COUNTIF DEC2HEX".split())
READ = (*CHECKS, "Paste")
COMMA = """<?xml version="1.0" encoding="UTF-8"?>
<oor:items xmlns:oor="http://openoffice.org/2001/registry"><item oor:path="/org.openoffice.Setup/L10N">
<prop oor:name="ooSetupSystemLocale" oor:op="fuse"><value>de-DE</value></prop></item></oor:items>
"""


class Recalculated:
    """A copy of the workbook with some inputs, as LibreOffice computes it."""

    def __init__(self, path: Path) -> None:
        self.book = openpyxl.load_workbook(path, data_only=True, read_only=True)
        self.names = _defined(self.book)
        with zipfile.ZipFile(path) as archive:
            self.errors = {name: re.findall(r'<c r="(\w+)"[^>]* t="e"', archive.read(name).decode()) for name in archive.namelist()
                           if name.startswith("xl/worksheets/sheet")}

    @functools.cache
    def sheet(self, title: str) -> list[tuple]:
        """All values of a sheet, by row and column."""
        return list(self.book[title].iter_rows(values_only=True))

    def __getitem__(self, name: str) -> Any:
        """Value of a named cell."""
        title, column, row = self.names[name]
        return self.sheet(title)[row - 1][column - 1]

    def column(self, title: str, column: int, after: str) -> dict[str, Any]:
        """A column of a sheet by its first one, from the row below the one that begins with `after`."""
        rows = self.sheet(title)
        start = next(i for i, row in enumerate(rows) if str(row[0]).startswith(after))
        found: dict[str, Any] = {}
        for row in rows[start + 1:]:
            found.setdefault(row[0], row[column - 1])
        return found

    def lines(self) -> list[str]:
        """What a user copies."""
        return [str(row[0] or "") for row in self.sheet("Paste")[4:]]


def _defined(book: openpyxl.Workbook) -> dict[str, tuple[str, int, int]]:
    """Named cells: sheet, column, row."""
    names = book.defined_names
    found = names.definedName if hasattr(names, "definedName") else names.values()  # openpyxl 3.0, 3.1
    matches = {name.name: re.fullmatch(r"'?([^'!]+)'?!\$?([A-Z]+)\$?(\d+)", name.attr_text) for name in found}
    return {name: (match[1], column_index_from_string(match[2]), int(match[3])) for name, match in matches.items() if match}


@dataclass(frozen=True)
class Case:
    """Inputs of a copy: the motor, and values for the yellow cells of rows that begin with a text."""

    motor: str
    yours: tuple[tuple[str, str, str, Any], ...] = ()
    """sheet, column, beginning of the row, value"""


def _set(book: openpyxl.Workbook, case: Case) -> list[Any]:
    """Fills the inputs in and returns the cells."""
    cells = [book["Motor"]["B4"]]
    cells[0].value = case.motor
    for title, column, label, value in case.yours:
        row = next(cell.row for cell in book[title]["A"] if str(cell.value or "").startswith(label))
        cells.append(book[title][f"{column}{row}"])
        cells[-1].value = value
    return cells


def recalculate(cases: dict[str, Case], locale: str = "") -> dict[str, Recalculated]:
    """One run of LibreOffice for all cases."""
    office = shutil.which("soffice") or shutil.which("libreoffice")
    if office is None:
        raise AssertionError("LibreOffice is missing: install it (Debian: apt-get install --no-install-recommends libreoffice-calc-nogui)")
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "in").mkdir()
        book = openpyxl.load_workbook(spreadsheet.FILE)
        for name, case in cases.items():
            cells = _set(book, case)
            book.save(root / "in" / f"{name}.xlsx")
            for cell in cells:
                cell.value = None
        if locale:
            (root / "profile" / "user").mkdir(parents=True)
            (root / "profile" / "user" / "registrymodifications.xcu").write_text(locale, encoding="utf-8")
        subprocess.run([office, "--headless", f"-env:UserInstallation=file://{root}/profile", "--convert-to", "xlsx:Calc MS Excel 2007 XML",
                        "--outdir", str(root / "out"), *(str(root / "in" / f"{name}.xlsx") for name in cases)],
                       check=True, capture_output=True, timeout=300)
        found = {name: Recalculated(root / "out" / f"{name}.xlsx") for name in cases}
        for one in found.values():
            for title in READ:
                one.sheet(title)
        return found


IPEAK = ("Motor", "D", "Current at full internal scale")
WRONG = {"r": 0.7, "l": 1.3, "psi": 0.85}
"""True motor over assumed motor, for the margins of a wrong one."""


@functools.cache
def recalculated() -> dict[str, Recalculated]:
    cases = {name: Case(name) for name in MOTORS}
    for ipeak in PUBLISHED:
        exponent = (("Constants", "G", "NORM_RS", 4),) if ipeak > 10 else ()
        cases[f"Ipeak {ipeak}"] = Case(spreadsheet.DEFAULT_MOTOR, ((*IPEAK, ipeak), *exponent))
    cases["wrong"] = Case("linix_45zwn24_40",
                          (("Loops", "C", "True R", WRONG["r"]), ("Loops", "C", "True L", WRONG["l"]), ("Loops", "C", "True flux", WRONG["psi"])))
    cases |= {f"changed {name}": Case(name, tuple(("Motor", "D", label, number) for label, number in change.yours)) for name,
              change in CHANGED.items()}
    cases["delta"] = Case("own motor", OWN_DELTA)
    cases["wrong unit"] = Case("own motor", tuple((*place, "ohm phase" if value == "ohm winding" else value) for *place, value in OWN_DELTA))
    return recalculate(cases)


@dataclass(frozen=True)
class Change:
    """A motor of the list with values of the user's: rows of the sheet Motor in the file's unit, and the same as the command has them."""

    yours: tuple[tuple[str, float], ...]
    motor: dict[str, float]


CHANGED = {"hurst_dmb0224c10002": Change((("Resistance (terminals)", 6.0), ("Inductance (d axis)", 5.0), ("Inertia of the rotor", 2e-5),
                                          ("Rated torque", 0.07)),
                                         {"rs_ohm": 3.0, "ld_h": 2.5e-3, "lq_h": 2.5e-3, "inertia_kgm2": 2e-5, "rated_torque_nm": 0.07}),
           "linix_45zwn24_40": Change((("Inductance, q axis", 0.6), ("Dry friction", 6.0), ("Highest speed wanted", 6500.0)),
                                      {"lq_h": 0.6e-3, "coulomb_nm": 6e-3, "maximum_speed_rpm": 6500.0})}


@functools.cache
def with_comma() -> Recalculated:
    """The default motor where the decimal sign is a comma."""
    return recalculate({"comma": Case(spreadsheet.DEFAULT_MOTOR)}, COMMA)["comma"]


@functools.cache
def generated() -> bytes:
    """The workbook as the script writes it now."""
    with tempfile.TemporaryDirectory() as folder:
        spreadsheet.write(Path(folder) / "new.xlsx")
        return (Path(folder) / "new.xlsx").read_bytes()


@functools.cache
def designed(name: str) -> design.Design:
    return design.design(motor_file.load(name), board_file.load(spreadsheet.DEFAULT_BOARD))


def defines(lines: list[str]) -> dict[str, str]:
    found = [re.match(r"#define (\w+) +(\S+)", line) for line in lines]
    return {match[1]: match[2] for match in found if match}


class File(unittest.TestCase):
    def test_the_committed_file_is_what_the_script_writes(self):
        new, old = openpyxl.load_workbook(io.BytesIO(generated())), openpyxl.load_workbook(spreadsheet.FILE)
        self.assertEqual(new.sheetnames, old.sheetnames, "run: python3 -m tuning spreadsheet")
        for sheet in new:
            differing = [cell.coordinate for row in sheet for cell in row if not _same(cell, old[sheet.title][cell.coordinate])]
            self.assertEqual(differing[:5], [], f"sheet {sheet.title}; run: python3 -m tuning spreadsheet")
            self.assertEqual(sheet.dimensions, old[sheet.title].dimensions)
            self.assertEqual(_rules(sheet), _rules(old[sheet.title]))
        self.assertEqual(_defined(new), _defined(old))

    def test_writing_twice_gives_the_same_bytes(self):
        first = generated()
        generated.cache_clear()
        self.assertEqual(first, generated())

    def test_every_motor_file_can_be_chosen(self):
        sheet = openpyxl.load_workbook(spreadsheet.FILE)["Motors"]
        names = [cell.value for cell in sheet[4]][2:]
        self.assertEqual(names, [*MOTORS, "own motor"])

    def test_every_input_refuses_what_is_impossible(self):
        book = openpyxl.load_workbook(spreadsheet.FILE)
        for sheet in book:
            guarded = {cell for rule in sheet.data_validations.dataValidation for ranges in rule.sqref.ranges for cell in [ranges.coord]}
            for row in sheet:
                for cell in row:
                    if cell.fill.start_color.rgb == "00FFF2B3" and cell.value is None and sheet.title != "Read me" and not _merged(sheet, cell):
                        self.assertIn(cell.coordinate, guarded, f"{sheet.title}: an input without a rule")


    def test_the_formulas_stay_within_what_every_spreadsheet_knows(self):
        for sheet in openpyxl.load_workbook(spreadsheet.FILE):
            for formula, cell in ((cell.value, cell.coordinate) for row in sheet for cell in row if str(cell.value or "").startswith("=")):
                text = re.sub(r'"[^"]*"', "", formula)
                self.assertLessEqual(set(re.findall(r"([A-Z][A-Z0-9.]*)\(", text)), FUNCTIONS, f"{sheet.title}!{cell}")
                self.assertLess(len(formula), 8000, f"{sheet.title}!{cell}")
                self.assertLess(max(map(len, re.findall(r'"([^"]*)"', formula)), default=0), 255, f"{sheet.title}!{cell}")

    def test_names_differ_by_more_than_capital_letters_and_are_no_cells(self):
        names = list(_defined(openpyxl.load_workbook(spreadsheet.FILE)))
        self.assertEqual(len({name.lower() for name in names}), len(names))
        self.assertEqual([name for name in names if re.fullmatch(r"(?i)[a-z]{1,3}\d+|r|c|r\d*c\d*", name)], [])

    def test_the_texts_of_input_rules_fit_a_spreadsheets_limits(self):
        for sheet in openpyxl.load_workbook(spreadsheet.FILE):
            for rule in sheet.data_validations.dataValidation:
                self.assertLessEqual(max(len(rule.errorTitle or ""), len(rule.promptTitle or "")), 32)
                self.assertLessEqual(max(len(rule.error or ""), len(rule.prompt or ""), len(rule.formula1 or "")), 255)


def _merged(sheet: Any, cell: Any) -> bool:
    return any(cell.coordinate in ranges for ranges in sheet.merged_cells.ranges)


def _same(a: Any, b: Any) -> bool:
    return (a.value, a.number_format, a.fill.start_color.rgb, a.font.b) == (b.value, b.number_format, b.fill.start_color.rgb, b.font.b)


def _rules(sheet: Any) -> list[tuple]:
    return sorted((str(rule.sqref), rule.type, str(rule.formula1), str(rule.formula2)) for rule in sheet.data_validations.dataValidation)


class AgainstTheCommand(unittest.TestCase):
    def test_every_line_to_paste_has_the_commands_number(self):
        for name in MOTORS:
            with self.subTest(motor=name):
                found, wanted = defines(recalculated()[name].lines()), designed(name).params
                self.assertEqual({key: found.get(key) for key in wanted if not _equal(found.get(key), wanted[key])},
                                 {key: wanted[key] for key in wanted if not _equal(found.get(key), wanted[key])})
                self.assertEqual(set(found) - set(wanted), set())

    def test_the_lines_are_the_commands_file_but_for_comments(self):
        header_lines = [line for line in header.write(designed(spreadsheet.DEFAULT_MOTOR)).splitlines() if line.startswith("#")]
        lines = [line for line in recalculated()[spreadsheet.DEFAULT_MOTOR].lines() if line.startswith("#")]
        self.assertEqual([line.split("/*")[0].rstrip() for line in lines], [line.split("/*")[0].rstrip() for line in header_lines])

    def test_a_motor_with_the_users_values_gets_what_the_command_makes_of_them(self):
        for name, change in CHANGED.items():
            with self.subTest(motor=name):
                d = design.design(dataclasses.replace(motor_file.load(name), **change.motor), board_file.load(spreadsheet.DEFAULT_BOARD))
                self.assertFalse(d.tuned_by_machine)
                found = defines(recalculated()[f"changed {name}"].lines())
                # Bandwidths and how much longer the lock has to be are found by trying; the sheet keeps the chosen motor's.
                wanted = {key: text for key, text in d.params.items() if "_BANDWIDTH_" not in key and "_PTERM" not in key}
                lock_s = _lock_by_rule_s(d) * designed(name).start_up.lock_s / _lock_by_rule_s(designed(name))
                wanted["LOCK_TIME"] = str(2 * round(lock_s / d.board.pwm_period_s / 2.0))
                self.assertEqual({key: (found[key], wanted[key]) for key in wanted if not _equal(found[key], wanted[key])}, {})

    def test_the_build_accepts_the_lines_of_every_motor(self):
        for name in MOTORS:
            with self.subTest(motor=name), tempfile.TemporaryDirectory() as folder:
                (Path(folder) / "userparams.h").write_text("\n".join(recalculated()[name].lines()) + "\n", encoding="utf-8")
                build = subprocess.run([os.environ.get("CC", "gcc"), "-std=gnu99", "-fsyntax-only", f"-I{folder}", "-Itools/cpu_host", "-Iinclude",
                                        "firmware/drive/param_check.c"],
                                       cwd=paths.ROOT, capture_output=True, text=True)
                self.assertEqual(build.stderr, "")

    def test_a_comma_as_decimal_sign_changes_no_line(self):
        self.assertIn(",", with_comma()["decimal_sign"])
        self.assertEqual(with_comma().lines(), recalculated()[spreadsheet.DEFAULT_MOTOR].lines())

    def test_every_constant_of_the_firmware_is_the_commands(self):
        for name in MOTORS:
            value, exact, stored = (recalculated()[name].column("Constants", column, "The firmware's numbers: motor") for column in (2, 8, 9))
            with self.subTest(motor=name):
                self.assertEqual({item.name for item in designed(name).constants} - set(stored), set())
                for item in designed(name).constants:
                    # Single precision may round the other way where the exact value lies on the edge.
                    edge = abs(exact[item.name] % 1.0 - 0.5) < 3e-6 * abs(exact[item.name])
                    self.assertAlmostEqual(stored[item.name], item.q_value, delta=edge + 1e-6 * abs(item.q_value), msg=item.name)
                    self.assertAlmostEqual(value[item.name], item.value, delta=1e-4 * abs(item.value) + 1e-9, msg=item.name)

    def test_the_notes_constants_are_those_of_the_commands_sheet(self):
        for name in MOTORS:
            m, b, sheet = designed(name).motor, designed(name).board, recalculated()[name]
            wanted = constants.sheet(constants.SheetInputs(
                b.nominal_bus_v, b.current_full_scale_a, b.pwm_period_s, b.dead_time_s, m.pole_pairs, m.rs_ohm, m.lq_h, m.kphi_v_per_krpm,
                designed(name).value("NOMINAL_SPEED_RPM"), designed(name).value("MAXIMUM_SPEED_RPM")))
            with self.subTest(motor=name):
                self.assertEqual([sheet[f"note_{key}"] for key in ("NORM_RS", "NORM_LSDTBASE", "NORM_INVKFIBASE", "NORM_DELTAT", "D_ILIMIT_HS",
                                                                   "D_ILIMIT_LS")],
                                 [wanted.norm_rs.stored, wanted.norm_lsdtbase.stored, wanted.norm_invkfibase.stored, wanted.norm_deltat.stored,
                                  wanted.d_ilimit_hs, wanted.d_ilimit_ls])
                exponents, shifts = (sheet.column("Constants", column, "The note's constants") for column in (6, 11))
                for scaled, key in ((wanted.norm_rs, "NORM_RS"), (wanted.norm_lsdtbase, "NORM_LSDTBASE"), (wanted.norm_invkfibase, "NORM_INVKFIBASE"),
                                    (wanted.norm_deltat, "NORM_DELTAT")):
                    self.assertEqual((exponents[key], str(shifts[key]).split()[0]), (scaled.exponent, str(scaled.shift)), key)

    def test_the_phase_margins_are_the_commands(self):
        for case in (*MOTORS, "wrong"):
            with self.subTest(motor=case):
                name, wrong = ("linix_45zwn24_40", WRONG) if case == "wrong" else (case, {"r": 1.0, "l": 1.0, "psi": 1.0})
                self.assertEqual(_off(recalculated()[case], _margins(designed(name), wrong)), {})

    def test_no_formula_of_the_workbook_fails(self):
        for name in MOTORS:
            with self.subTest(motor=name):
                self.assertEqual({sheet: cells[:5] for sheet, cells in recalculated()[name].errors.items() if cells}, {})

    def test_the_motors_of_the_list_have_no_red_check_but_warnings(self):
        for name in MOTORS:
            with self.subTest(motor=name):
                sheet = recalculated()[name]
                bad = [row[column - 1] for title, column in CHECKS.items() for row in sheet.sheet(title)
                       if row[column - 1] not in (None, "ok", "Check") and not str(row[column - 1]).startswith("warning:")]
                self.assertEqual(bad, [])
                self.assertEqual(sheet["red_checks"], 0)


def _lock_by_rule_s(d: design.Design) -> float:
    return start.lock_by_rule_s(start.natural_rad_s(d.motor, d.start_up.current_a, d.motor.inertia_kgm2 + d.motor.load_inertia_kgm2))


def _equal(a: str | None, b: str) -> bool:
    if a is None or a == b or "NORM_INVKFIBASE" in (a, b):
        return a == b
    return constants.number_of(a) == constants.number_of(b)


def _margins(d: design.Design, wrong: dict[str, float]) -> dict[str, float]:
    """Phase margins of the nominal design on a motor that differs, by the command's own functions."""
    m, period = d.motor, d.board.pwm_period_s
    inertia = m.inertia_kgm2 + m.load_inertia_kgm2
    plant = loops.Plant(m.rs_ohm, m.ld_h, m.lq_h, m.psi_vs, m.pole_pairs, inertia, m.viscous_nms)
    true = loops.Plant(m.rs_ohm * wrong["r"], m.ld_h * wrong["l"], m.lq_h * wrong["l"], m.psi_vs * wrong["psi"], m.pole_pairs, inertia, m.viscous_nms)
    base = loops.Gains(0, 0, 0, 0, 0, d.value("KFILTER_ESDQ") / 32768, d.value("KFILTER_VELESTIM") / 32768, period)
    gains = loops.speed_gains(plant, d.value("SPEED_BANDWIDTH_HZ"), loops.current_gains(plant, d.value("CURRENT_BANDWIDTH_HZ"), base))
    grid, slow = loops.current_grid(period, 2000), np.geomspace(0.05, 0.45 / (loops.SLOTS * period), 2000)
    found = {f"margin_{axis}_{at}": loops.margins(grid, loops.current_loop(grid, true, gains, w, axis)).phase_deg
             for axis in "dq" for at, w in (("standstill", 0.0), ("top", d.envelope.omega(d.value("MAXIMUM_SPEED_RPM"))))}
    return found | {f"margin_speed_{label}": loops.margins(slow,
                                                           loops.speed_loop(slow, true, plant, gains,
                                                                            d.envelope.omega(d.value(f"{label.upper()}_SPEED_RPM")))).phase_deg
                    for label in ("minimum", "nominal", "maximum")}


def _off(sheet: Recalculated, wanted: dict[str, float]) -> dict[str, tuple[float, float]]:
    return {name: (sheet[name], value) for name, value in wanted.items() if abs(sheet[name] - value) > 0.2}


class OwnMotor(unittest.TestCase):
    def test_a_delta_motor_in_other_units_becomes_a_star_in_si(self):
        sheet = recalculated()["delta"]
        for name, wanted in (("rs_ohm", 1.2 / 3.0 / (1.0 + 0.0039 * (20.0 - 25.0))), ("lq_h", 900e-6 / 3.0),
                             ("kphi_v_per_krpm", 1000.0 / (3.0 / math.pi) / 140.0),
                             ("inertia_kgm2", 240e-7), ("rated_current_a", 2.0 * math.sqrt(2.0)),
                             ("rated_speed_rpm", 314.159265 * 60.0 / (2.0 * math.pi))):
            self.assertAlmostEqual(sheet[name] / wanted, 1.0, places=8, msg=name)

    def test_a_unit_that_the_connection_does_not_have_is_red(self):
        sheet = recalculated()["wrong unit"]
        rows = {row[0]: row[7] for row in sheet.sheet("Motor") if row[0]}
        self.assertEqual(rows["Resistance (terminals)"], "choose a unit that this motor has")
        self.assertTrue(any(line.startswith("#error") for line in sheet.lines()))


class PublishedConstants(unittest.TestCase):
    def test_the_notes_constants_come_out_to_the_last_digit(self):
        for ipeak, wanted in PUBLISHED.items():
            with self.subTest(ipeak=ipeak):
                sheet = recalculated()[f"Ipeak {ipeak}"]
                self.assertEqual({name: sheet[f"note_{name}"] for name in wanted}, wanted)


if __name__ == "__main__":
    unittest.main()
