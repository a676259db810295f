"""Writes tuning/tuning_params.xlsx: AN1292's spreadsheet with live formulas, for people who tune a motor in one.

Motor and board data go in; AN1292's constants, the firmware's and the lines of userparams.h come out. What needs trying (bandwidths, start,
field weakening) is what make tune found for the chosen motor. The parameters are the rows of include/drive/param_limits.h.
"""

import argparse
import itertools
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.common import board_file, command_line, motor_file, paths
from tools.common.errors import UserError
from tools.common.param_rows import FOLLOWS, parameters
from tools.common.progress import waiting

from .design import Design, design
from .limits import UNIT_ERPM

FILE = paths.ROOT / "tuning" / "tuning_params.xlsx"
DEFAULT_MOTOR = "hurst_dmb0224c10002"
OWN = "own motor"
OPTIONAL = {"D_CURRCNTR_PTERM": ("Q15/16", 0.0001, 0.9999), "Q_CURRCNTR_PTERM": ("Q15/16", 0.0001, 0.9999), "BRIDGE_RS_OHM": ("ohm", 0, 1)}
"""Parameters without a row, with unit and range: the tuner gives them to motors whose Ld and Lq differ, or whose winding the bridge adds to."""


@dataclass(frozen=True)
class Datum:
    """One number of a data sheet: what it is, its name in formulas, its unit and limits, and where make tune has it from."""

    label: str
    name: str
    unit: str
    low: float
    high: float
    parameter: str
    """of userparams.h, whose value is `formula` of this"""
    formula: str
    factor: float = 1.0
    """this datum for a parameter of 1"""


DATA = {
    "Motor": (
        Datum("Pole pairs", "pole_pairs", "", 1, 50, "NOPOLESPAIRS", "pole_pairs"),
        Datum("Resistance, terminal to terminal", "r_ll_ohm", "ohm", 0.02, 80, "MOTOR_RS_OHM", "r_ll_ohm/2", 2.0),
        Datum("Inductance, terminal to terminal (q axis)", "l_ll_mh", "mH", 0.02, 60, "MOTOR_LS_MH", "l_ll_mh/2", 2.0),
        Datum("Back-EMF at 1000 rpm, peak, terminal to terminal", "kphi_v", "V", 0.2, 200, "MOTOR_KPHI_V_PER_KRPM", "kphi_v"),
        Datum("Inertia of rotor and load", "inertia_gcm2", "g cm2", 0.1, 1e6, "MOTOR_INERTIA_KGM2", "inertia_gcm2/10000000", 1e7)),
    "Supply and board": (
        Datum("Supply (DC link)", "supply_v", "V", 10, 48, "NOMINAL_BUS_V", "supply_v"),
        Datum("PWM and control period", "period_us", "us", 25, 140, "LOOPTIME_SEC", "period_us/1000000", 1e6),
        Datum("Dead time", "dead_time_us", "us", 0.5, 3, "DEADTIME_SEC", "dead_time_us/1000000", 1e6),
        Datum("Low sides on around the sample", "window_us", "us", 1.5, 4, "SAMPLE_WINDOW_SEC", "window_us/1000000", 1e6),
        Datum("Ipeak: current at full scale, reference / (shunt * gain)", "ipeak_a", "A peak", 0.33, 65, "NORM_CURRENT_CONST",
              "ROUND(ipeak_a/32768,6-INT(LOG10(ipeak_a/32768)))", 32768.0))}
FORMULAS = {x.parameter: f'IF({x.name}="","",{x.formula})' for rows in DATA.values() for x in rows}

IU = "(I0_a/U0_v)"
OHM = '(MOTOR_RS_OHM+IF(BRIDGE_RS_OHM="",0,BRIDGE_RS_OHM))'
"""Winding and bridge."""
TOP_ERPM = "MAXIMUM_SPEED_RPM*NOPOLESPAIRS"
LARGEST_CURRENT = "MAXIMUM_CURRENT_A/NORM_CURRENT_CONST"
FASTEST = "MAX(MAXIMUM_SPEED_RPM,1.5*NOMINAL_SPEED_RPM)"
LDI = f"(2*PI()/60*{FASTEST}*NOPOLESPAIRS*1.2*MOTOR_LS_MH/1000*MAXIMUM_CURRENT_A)"
LDI_SHARE = (f"MAX(0.75,MIN(1,(0.98*131068*U0_v-MIN(OVER_VOLTAGE_V,1.25*NOMINAL_BUS_V)/SQRT(3)-1.6*2/SQRT(3)*OVER_CURRENT_THRESHOLD_A*{OHM})/{LDI}))")
"""What the back-EMF's format leaves for L di/dt, where the adaptation may raise R by 60 %."""
SCALED = (("NORM_RS", f"{OHM}*I0_a/U0_v*32768", "Rs I0/U0 2^15 (Equation 5)", 1, "phase resistance"),
          ("NORM_LSDTBASE", "MOTOR_LS_MH/1000/LOOPTIME_SEC*I0_a/U0_v*32768", "(Ls/Ts) I0/U0 2^15 (Equation 5)", 8,
           "phase inductance; the shift of the eight-sample difference is 3 more"),
          ("NORM_INVKFIBASE", "SQRT(3)*1000*NOPOLESPAIRS*U0_v/MOTOR_KPHI_V_PER_KRPM*32768", "sqrt(3) 1000 P U0/Kphi 2^15 (Equation 6)", 1,
           "1/Kphi; AN1292 shifts >> 15, then << 1"),
          ("NORM_DELTAT", "LOOPTIME_SEC/60*65536*32768", "Ts/60 2^16 2^15 (Equation 1)", 0, "angle a period for 1 electrical rpm"),
          ("D_ILIMIT_HS", "2*MAXIMUM_SPEED_RPM/60*NOPOLESPAIRS*LOOPTIME_SEC*32768", "2 (n/60) P Ts 2^15", 0, "largest change of a current in a period"),
          ("D_ILIMIT_LS", "8*2*NOMINAL_SPEED_RPM/60*NOPOLESPAIRS*LOOPTIME_SEC*32768", "8 2 (n/60) P Ts 2^15", 0, "the same in eight periods"))
"""AN1292's constants: name, formula before the pre-division, its text, least exponent of the pre-division, meaning."""


def _pterm(axis: str) -> str:
    return f'IF({axis}_CURRCNTR_PTERM="",2*PI()*CURRENT_BANDWIDTH_HZ*MOTOR_LS_MH/1000*{IU}/16,{axis}_CURRCNTR_PTERM)'


ITERM = f"2*PI()*CURRENT_BANDWIDTH_HZ*{OHM}*LOOPTIME_SEC*{IU}"
KT = "(1.5*MOTOR_KPHI_V_PER_KRPM/SQRT(3)*60/(2000*PI()))"
SPEED_PTERM = f"2*PI()*SPEED_BANDWIDTH_HZ*MOTOR_INERTIA_KGM2/{KT}*(2*PI()/60)/NOPOLESPAIRS/NORM_CURRENT_CONST/16*SPEED_UNIT"
CONSTANTS = {
    "Motor, in the firmware's formats": (
        ("NORM_RS", f"MIN({OHM}*{IU}*16384,32767)", "Q15 / 2", "Equation 5, at most 32767"),
        ("NORM_LSDTBASE", f"MIN(MOTOR_LS_MH/1000/LOOPTIME_SEC*{IU}*128,32767)", "Q15 / 256", "Equation 5, at most 32767"),
        ("NORM_INVKFIBASE", "SQRT(3)*1000*NOPOLESPAIRS*U0_v/MOTOR_KPHI_V_PER_KRPM*16384/SPEED_UNIT", "Q15 / 2", "Equation 6"),
        ("NORM_DELTAT", "LOOPTIME_SEC/60*2147483648*SPEED_UNIT", "Q15 of a turn/erpm", "Equation 1")),
    "Derivative limits: a sine of the largest current, 2 pi (n/60) P Ts Imax": (
        ("estimator.d_ilimit_hs_q14", f"MIN({LDI_SHARE}*2*PI()*MAXIMUM_SPEED_RPM/60*NOPOLESPAIRS*LOOPTIME_SEC*{LARGEST_CURRENT}/2,4095)", "Q14 A", "in a period"),
        ("estimator.d_ilimit_ls_q14", f"MIN(MIN(1,{LDI_SHARE}*{FASTEST}/1.5/NOMINAL_SPEED_RPM)*8*2*PI()*MIN(NOMINAL_SPEED_RPM/60*NOPOLESPAIRS*LOOPTIME_SEC,0.12/8)*{LARGEST_CURRENT}/2,16383)", "Q14 A",
         "in eight periods, of 0.12 turns at most")),
    "Speeds": tuple((field, f"{name}*NOPOLESPAIRS{part}/SPEED_UNIT", "erpm", meaning) for field, name, part, meaning in (
        ("minimum_erpm", "MINIMUM_SPEED_RPM", "", "potentiometer at zero"),
        ("nominal_erpm", "NOMINAL_SPEED_RPM", "", "potentiometer at full scale, S3 off"),
        ("maximum_erpm", "MAXIMUM_SPEED_RPM", "", "potentiometer at full scale, S3 on"),
        ("end_erpm", "END_SPEED_RPM", "", "end of the ramp"),
        ("fieldweak.on_speed_erpm", "FW_START_SPEED_RPM", "", "field weakening starts"),
        ("estimator.decimate_erpm", "NOMINAL_SPEED_RPM", "/10", "sign of Equation 2 from the filtered speed below"))),
    "Currents": tuple((field, f"{name}/NORM_CURRENT_CONST/4", "Q13 A", meaning) for field, name, meaning in (
        ("open_loop_q13", "Q_CURRENT_REF_OPENLOOP", "current of lock and ramp"), ("current_max_q13", "MAXIMUM_CURRENT_A", "largest current vector"),
        ("overcurrent_q13", "OVER_CURRENT_THRESHOLD_A", "phase current that trips"))),
    "Controllers: Kp = 2 pi f L, Ki = 2 pi f R; speed Kp = 2 pi f J/Kt": (
        ("pi_d.kp", f"{_pterm('D')}*32768", "Q15 / 16", "D_CURRCNTR_PTERM"), ("pi_q.kp", f"{_pterm('Q')}*32768", "Q15 / 16", "Q_CURRCNTR_PTERM"),
        ("pi_d.ki", f"{ITERM}*2048", "Q11 a period", "D_CURRCNTR_ITERM"), ("pi_q.ki", f"{ITERM}*2048", "Q11 a period", "Q_CURRCNTR_ITERM"),
        ("speed_kp_q13", f"{SPEED_PTERM}*32768", "Q15 / 16", "SPEEDCNTR_PTERM"))}
"""The firmware's: name as in make tune's table, formula, format, meaning."""

READ_ME = (
    ("How to use it", (
        ("step 1", "Motor: choose your motor, or the one most like yours. A yellow cell replaces the value beside it; 25 degC, peak values."),
        ("step 2", "Parameters: change what you like in the yellow cells. Bandwidths, start, limits and field weakening are what make tune found for the "
                   "chosen motor; for another motor write a motor file and run make tune MOTOR=name, which tries them."),
        ("step 3", "Constants: AN1292's constants with pre-division, rounding error and product shift, and the firmware's."),
        ("step 4", "Paste: copy column A over everything in userparams.h and build. A value that cannot work fails the build by name."))),
    ("Equations of AN1292 in their corrected form", (
        ("Equation 1", "angle += w Ts; NORM_DELTAT = Ts/60 2^16 2^15"),
        ("Equation 2", "w = (1/Kphi) (Eqf - sgn(Eqf) Edf); below a tenth of nominal speed the sign of the filtered speed"),
        ("Equation 3", "Ed = Ea cos + Eb sin, Eq = -Ea sin + Eb cos (corrected: the sign in Eq)"), ("Equation 4", "E = V - Rs I - Ls dI/dt"),
        ("Equation 5", "NORM_RS = Rs (I0/U0) 2^15 / 2, NORM_LSDTBASE = (Ls/Ts) (I0/U0) 2^15 / 256 (corrected: the ratios, and no w0)"),
        ("Equation 6", "NORM_INVKFIBASE = sqrt(3) 1000 P (U0/Kphi) 2^15 / 2 (corrected: 1/Kphi; sqrt(3) because Kphi is line to line)"),
        ("Equation 7", "y += K (x - y); K = 2^15 (1 - exp(-2 pi f Ts))"),
        ("Equation 8", "I0 = Ipeak / 2^15; U0 = Vdc/sqrt(3) (1 - Td/Ts) / 2^15: this U0, not Vdc, gives AN1292's constants"))),
    ("Published constants of the Hurst, as a check: set Ipeak on the sheet Motor and look at Constants", (
        ("Ipeak 3.95 A", "NORM_RS 12990, NORM_LSDTBASE 1460, NORM_INVKFIBASE 7956, NORM_DELTAT 1790, D_ILIMIT_HS 1502, D_ILIMIT_LS 6117"),
        ("Ipeak 7.09 A", "NORM_RS 23316, NORM_LSDTBASE 2620"), ("Ipeak 22 A, exponent 4 for NORM_RS", "NORM_RS 9044, NORM_LSDTBASE 8129"))))


def add_command(commands: Any) -> None:
    """`python3 -m tuning spreadsheet`"""
    commands.add_parser("spreadsheet", help="write tuning/tuning_params.xlsx anew").set_defaults(command=_command)


def _command(_: argparse.Namespace) -> int:
    with waiting("spreadsheet"):
        code = write(FILE)
    print(f"wrote {paths.shown(FILE)}")
    return code


def write(path: Path, names: Sequence[str] | None = None) -> int:
    """Builds the workbook from the motor files (all, if none are named) and the table of parameters; the same files give the same bytes.
    Returns the exit code: a motor that its board cannot turn gets its line and no column."""
    try:
        from .workbook import Book
    except ImportError:
        raise UserError("Python's openpyxl is missing", "python3 -m tuning spreadsheet",
                        "install it (Debian package: python3-openpyxl; or pip install openpyxl)") from None
    designs, code = command_line.each(names or paths.names(paths.MOTORS), _design)
    book = Book()
    _read_me(book)
    _motor(book, len(designs))
    _parameters(book)
    _constants(book)
    _paste(book)
    _motors(book, designs)
    book.wb.active = 1
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        book.wb.save(path)
        _without_dates(path)
    except OSError as error:
        raise UserError(f"cannot write ({error.strerror})", str(paths.shown(path)), "choose a folder that can be written") from None
    return code


def _design(name: str) -> Design:
    motor = motor_file.load(name)
    return design(motor, board_file.load(*board_file.named(motor)))


def _without_dates(path: Path) -> None:
    with zipfile.ZipFile(path) as old:
        members = [(name, old.read(name)) for name in old.namelist()]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name, data in members:
            if name == "docProps/core.xml":
                data = re.sub(rb"\d{4}-\d\d-\d\dT[\d:.]+Z", b"2000-01-01T00:00:00Z", data)
            new.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)


def _read_me(book: Any) -> None:
    page = book.page("Read me", [36, 150], "From motor and board data to userparams.h: AN1292's spreadsheet for foc33, with live formulas and no macro.")
    for title, rows in READ_ME:
        page.section(title)
        for name, text in rows:
            page.line((name, "label"), (text, "label"))
    page.line(("", "input"), ("yours to fill in; empty keeps the value beside it", "label"))


def _picked(name: str) -> str:
    """What the sheet Motors has for the chosen motor; empty stays empty."""
    cells = f"INDEX(given_{name},motor_column)"
    return f'IF({cells}="","",{cells})'


def _motor(book: Any, count: int) -> None:
    page = book.page("Motor", [52, 18, 18, 18, 10, 44], "Choose a motor. Yellow cells are yours: a number there replaces the value beside it.")
    row = page.line(("Motor", "label"), (DEFAULT_MOTOR, "input"))
    page.choose(f"B{row}", f"'Motors'!$B$4:${book.letter(count + 2)}$4")
    book.name("motor_name", "Motor", f"B{row}")
    row = page.line(("column of the sheet Motors", "label"), ("=MATCH(motor_name,motor_names,0)", "value"))
    book.name("motor_column", "Motor", f"B{row}")
    page.line(("Red checks on all sheets", "label"), ("=red_checks", "value"))
    page.heads("Quantity", "Motor's", "Yours", "Used", "Unit", "Check")
    for title, rows in DATA.items():
        page.section(title)
        for x in rows:
            row = page.row
            picked = f"INDEX(given_{x.parameter},motor_column)"
            page.line((x.label, "label"), (f'=IF({picked}="","",{picked}*{x.factor:g})', "value"), (None, "input"), (f'=IF(C{row}="",B{row},C{row})', "result"),
                      (x.unit, "label"), (page.inside(f"D{row}", x.low, x.high), "check"))
            page.range(f"C{row}", x.low, x.high, x.label)
            book.name(x.name, "Motor", f"D{row}")


def _parameters(book: Any) -> None:
    page = book.page("Parameters", [40, 18, 18, 18, 19, 24, 44, 90], "Every value of userparams.h. A yellow cell replaces the value beside it.")
    page.heads("Parameter", "By rule", "Yours", "Used", "Unit", "Range", "Check", "Meaning")
    for title, rows in itertools.groupby(parameters().values(), lambda item: item.section):
        page.section(title)
        for p in rows:
            row = page.row
            exact = f'OR(D{row}="NORM_INVKFIBASE",ISNUMBER(D{row}))'
            check = f'=IF({exact},IF(OR(D{row}="NORM_INVKFIBASE",AND(D{row}>={p.low},D{row}<={p.high})),"ok","outside {p.low} .. {p.high}"),"needs a value")'
            page.line((p.name, "code"), (f"={FORMULAS.get(p.name, _picked(p.name))}", "value"), (None, "input"), (f'=IF(C{row}="",B{row},C{row})', "result"),
                      (p.unit, "label"), (f"{p.low} .. {p.high}", "label"), (check, "check"), (p.meaning, "label"))
            page.range(f"C{row}", float(p.low), float(p.high), p.name)
            book.name(p.name, "Parameters", f"D{row}")
    page.section("Gains where the two axes differ, empty: from the bandwidth; transistor and half of the shunt, empty: 0")
    for name, (unit, low, high) in OPTIONAL.items():
        row = page.row
        page.line((name, "code"), (f"={_picked(name)}", "value"), (None, "input"), (f'=IF(C{row}="",B{row},C{row})', "result"), (unit, "label"))
        page.range(f"C{row}", low, high, name)
        book.name(name, "Parameters", f"D{row}")


def _constants(book: Any) -> None:
    page = book.page("Constants", [34, 44, 18, 12, 12, 14, 12, 14, 30, 60], "AN1292's constants, then the firmware's. A yellow cell is your own exponent.")
    page.heads("Constant", "Formula", "Before division", "2^", "Yours", "Stored", "Error %", "Product >>", "Check", "Meaning")
    page.section("Base quantities")
    for name, formula, text in (("U0_v", "NOMINAL_BUS_V/SQRT(3)*(1-DEADTIME_SEC/LOOPTIME_SEC)/32768", "Vdc/sqrt(3) (1 - Td/Ts) / 2^15, V per count"),
                                ("I0_a", "NORM_CURRENT_CONST", "Ipeak / 2^15 (Equation 8), A per count"),
                                ("SPEED_UNIT", f"IF({TOP_ERPM}<={UNIT_ERPM:.0f},1,IF({TOP_ERPM}<={2 * UNIT_ERPM:.0f},2,4))",
                                 "electrical rpm of a count of the firmware's speeds")):
        row = page.line((name, "code"), (text, "label"), (f"={formula}", "result"))
        book.name(name, "Constants", f"C{row}")
    page.section("AN1292's constants, for its own software; foc33 derives its own from userparams.h")
    for name, formula, text, least, meaning in SCALED:
        row = page.row
        fitting = f"MAX({least},IF(C{row}<32767.5,0,INT(LN(C{row}/32767.5)/LN(2))+1))"
        page.line((name, "code"), (text, "label"), (f"={formula}", "value"), (f'=IF(E{row}="",{fitting},E{row})', "value"), (None, "input"),
                  (f"=INT(C{row}/2^D{row}+0.5)", "result"), (f"=100*(F{row}*2^D{row}/C{row}-1)", "value"), (f"=15-D{row}", "value"),
                  (f'=IF(F{row}>32767,"too large for 16 bits: raise the exponent","ok")', "check"), (meaning, "label"))
        page.range(f"E{row}", 0, 15, "Exponent")
        book.name(f"AN1292_{name}", "Constants", f"F{row}")
    for title, rows in CONSTANTS.items():
        page.section(f"The firmware's: {title}")
        for name, formula, q_format, meaning in rows:
            row = page.row
            page.line((name, "code"), (q_format, "label"), (f"={formula}", "value"), ("", "label"), ("", "label"), (f"=ROUND(C{row},0)", "result"),
                      (f"=100*(F{row}/C{row}-1)", "value"), ("", "label"), (f'=IF(F{row}>32767,"too large for 16 bits","ok")', "check"), (meaning, "label"))


def _paste(book: Any) -> None:
    page = book.page("Paste", [170], "Copy from the first line to #endif over everything in userparams.h.")
    number = 'IF(ISNUMBER({0}),SUBSTITUTE({0}&"",",","."),{0})'
    lines = ["/* From tuning_params.xlsx */", "#ifndef USERPARAMS_H", "#define USERPARAMS_H"]
    for title, rows in itertools.groupby(parameters().values(), lambda item: item.section):
        lines += [None, f"/* ---- {title} ---- */"]
        for p in rows:
            comment = "" if p.stem and p.name != f"{p.stem}0" else f" /* [{p.unit}] {p.low} .. {p.high} {p.meaning} */"
            lines.append(f'=IF({p.name}="","#error {p.name} needs a value","#define {p.name} "&{number.format(p.name)}&"{comment}")')
    lines += [None, *(f'=IF({name}="","","#define {name} "&{number.format(name)})' for name in OPTIONAL), None, "#endif"]
    for line in lines:
        page.line((line, "code"))


def _motors(book: Any, designs: list[Design]) -> None:
    page = book.page("Motors", [40, *[26 for _ in designs], 26], "What make tune writes for each motor of tuning/motors on its board.")
    row = page.heads("Parameter", *[d.motor.name for d in designs], OWN)
    last = book.letter(len(designs) + 2)
    usual = max(range(len(designs)), key=lambda i: designs[i].motor.name == DEFAULT_MOTOR) # the board of one's own motor
    book.name("motor_names", "Motors", f"B{row}:{last}{row}")
    for name in [*parameters(), *OPTIONAL]:
        values = [_cell(d.params.get(name)) for d in designs]
        default = parameters()[name].default if name in parameters() else ""
        own = values[usual] if default == "FROM_BOARD" else _cell(default) if default and default not in FOLLOWS else None
        row = page.line((name, "code"), *((value, "value") for value in [*values, own]))
        book.name(f"given_{name}", "Motors", f"B{row}:{last}{row}")
    book.count_red()


def _cell(text: str | None) -> Any:
    return text if text is None or text.startswith("NORM") else int(text, 0) if re.fullmatch(r"-?(0x[0-9A-F]+|\d+)", text) else float(text)
