"""The text of a userparams.h: the rows of include/drive/param_limits.h with a design's values, and what the firmware makes of them."""

import itertools
import math
import re
import shlex
import textwrap
from collections.abc import Iterator

from tools.common import paths
from tools.common.motor_file import Motor
from tools.common.param_rows import FROM_DEFINES, Parameter, modes, parameters

from .constants import Constant, filter_hz
from .design import Design
from .fw_tables import STEP_ERPM
from .loops import Margins

INVKFI_FLAT = """/* 1/Kphi of each entry, in AN1292's counts. The back-EMF keeps its size above base speed here (it has the range), so a
 * constant Kphi is the right start; AN1292's rising table made up for a clipped one. More turns the control angle ahead. */"""
INVKFI_TUNED = "/* 1/Kphi of each entry, in AN1292's counts; NORM_INVKFIBASE is the motor's own. More turns the control angle ahead. */"
WIDTH = 118


def write(design: Design) -> str:
    """The whole file."""
    lines, facts = [*_head(design), *_modes()], _facts(design)
    for title, rows in itertools.groupby(parameters().values(), lambda row: row.section):
        lines += ["", _rule(title + facts.get(re.split("[:,]", title)[0], ""))]
        for stem, group in itertools.groupby(rows, lambda row: row.stem):
            lines += _entries(design, list(group)) if stem else [_define(design, row, facts) for row in group]
        if title.startswith("Motor") and "BRIDGE_RS_OHM" in design.choices:
            lines.append(f"{_left('BRIDGE_RS_OHM', design)}/* [ohm] a transistor and half of the shunt: beside MOTOR_RS_OHM they count */")
        if title.startswith("Control loops") and "D_CURRCNTR_PTERM" in design.choices:
            lines += [f"{_left('D_CURRCNTR_PTERM', design)}/* [V/A, Q15/16] 2 pi f Ld: the salient motor's d axis has its own inductance */",
                      f"{_left('Q_CURRCNTR_PTERM', design)}/* [V/A, Q15/16] 2 pi f Lq */"]
    lines += ["", *_constants(design), "", "#endif"]
    return "\n".join(lines) + "\n"


def _safe(text: str) -> str:
    """Text from a file that must not begin or end a comment, nor a line."""
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").replace("??/", "?? /").split())


def wanted(motor: Motor) -> str:
    """What MOTOR= finds a motor by, for a shell."""
    return shlex.quote(motor.name if motor.path.parent.resolve() == paths.MOTORS.resolve() else str(paths.shown(motor.path)))


def _head(design: Design) -> list[str]:
    motor, board = (_safe(str(paths.shown(path))) for path in (design.motor.path, design.board.path))
    name = _safe(wanted(design.motor))
    lines = ["/* Everything a user edits, in engineering units: the motor, the supply, limits, start, control loops and field weakening.", " *",
             f" * Made from {motor} and {board} by: make tune MOTOR={name}",
             f" * (make userparams MOTOR={name} writes it to userparams.h). Field weakening: {design.tables_from}.", " *",
             " * Each line states unit, range and meaning; a value outside its range fails the build by name. Change a number here to try it; to keep",
             " * it, write it into the motor file's [tune] and make the header again. The Q15 constants of AN1292 (NORM_RS, NORM_LSDTBASE,",
             " * NORM_INVKFIBASE, NORM_DELTAT, D_ILIMIT_HS ...) follow from these in include/drive/scaling/; the table at the end shows them."]
    for warning in design.warnings:
        lines += [" *", *(f" * {line}" for line in textwrap.wrap("Note: " + _safe(warning), WIDTH + 8, break_long_words=False,
                                                             break_on_hyphens=False))]
    lines[-1] += " */"
    return [*lines, "#ifndef USERPARAMS_H", "#define USERPARAMS_H", ""]


def _modes() -> list[str]:
    lines = [_rule("Modes: remove the comment marks, or build with -D")]
    return lines + [f"/* #define {name} */".ljust(36) + f"/* {meaning} */" for name, meaning in modes().items()]


def _rule(title: str) -> str:
    return f"/* ---- {title} ".ljust(WIDTH, "-") + " */"


def _facts(design: Design) -> dict[str, str]:
    """What this motor and board add to a section's title or a parameter's meaning."""
    d, s = design, design.start_up
    period = d.board.pwm_period_s
    facts = {"Motor": f": {_safe(d.motor.title)}, {'star' if d.motor.connection == 'Y' else 'delta'}", "Supply and board": f": {_safe(d.board.title)}",
             "Field weakening": f", {STEP_ERPM / d.motor.pole_pairs:.5g} rpm with {d.motor.pole_pairs} pole pairs",
             "NORM_CURRENT_CONST": f": {d.board.current_full_scale_a:.4g} A full scale"}
    if d.motor.salient:
        facts["MOTOR_LS_MH"] = f"; of the q axis (Ld = {d.motor.ld_h * 1e3:.4g} mH): with it the estimated angle does not turn with the torque"
    facts |= {name: f": {filter_hz(d.value(name), period):.0f} Hz" for name in ("KFILTER_ESDQ", "KFILTER_ESDQ_FW", "KFILTER_VELESTIM")}
    if s:
        facts |= {"LOCK_TIME": f": {d.value('LOCK_TIME') * period:.3g} s", "END_SPEED_RPM": f": back-EMF {s.emf_v:.2f} V",
                  "OPENLOOP_RAMPSPEED_INCREASERATE": f": {s.acceleration_rpm_s:.0f} rpm/s, {s.ramp_s:.2f} s to the end",
                  "Q_CURRENT_REF_OPENLOOP": f": pull-out torque {s.pull_out_nm:.3g} N m"}
    for name, loop in (("CURRENT_BANDWIDTH_HZ", d.current_loop), ("SPEED_BANDWIDTH_HZ", d.speed_loop)):
        if loop:
            least = loop.at_rates.get("quiet", (loop.worst, ""))[0]
            facts[name] = f": {_degrees(loop.nominal)}, {_degrees(least, False)} over the parameter set"
    if d.speed_loop:
        loaded, quick = (d.speed_loop.at_rates[mode][0] for mode in ("loaded", "quick"))
        facts["LOAD_BANDWIDTH_HZ"] = f": {_degrees(quick)} after a load step, {_degrees(loaded, False)} under load"
    return facts


def _degrees(margins: Margins, named: bool = True) -> str:
    if not margins.stable:
        return "unstable"
    return f"phase margin {math.floor(margins.phase_deg)} degrees" if named else f"{math.floor(margins.phase_deg)}"


def _left(name: str, design: Design) -> str:
    text = f"#define {name} {design.choices[name].text}"
    return text.ljust(36) + ("" if len(text) < 36 else " ")


def _define(design: Design, row: Parameter, facts: dict[str, str]) -> str:
    line = f"{_left(row.name, design)}{_comment(row, facts.get(row.name, ''))}"
    value = "1" if row.unit == "switch" else f"{row.low}..{row.high}"
    return f"#ifndef {row.name} /* or build with -D{row.name}={value} */\n{line}\n#endif" if row.name in FROM_DEFINES else line


def _comment(row: Parameter, fact: str = "") -> str:
    return f"/* {f'[{row.unit}]'.ljust(15)} {f'{row.low} .. {row.high}'.ljust(14)} {row.meaning}{fact} */"


def _entries(design: Design, rows: list[Parameter]) -> Iterator[str]:
    """One table; unit, range and meaning stand beside its first entry."""
    yield ""
    if rows[0].stem == "INVKFI_SPEED":
        yield INVKFI_TUNED if design.tuned_by_machine else INVKFI_FLAT
    for row in rows:
        text = design.choices[row.name].text
        text = text if text.startswith(("-", "N")) else " " + text
        line = f"#define {row.name}".ljust(len(f"#define {rows[-1].name}") + 1) + text
        yield line.ljust(42) + _comment(row) if row is rows[0] else line


def _constants(design: Design) -> list[str]:
    """The comment table of derived constants; the 54 table entries are left out, they stand above."""
    rows = [item for item in design.constants if "[" not in item.name]
    lines = ["/* ---- What the firmware makes of these numbers: engineering value, its count, and how much rounding changes it ".ljust(WIDTH, "-")]
    ampere = design.value("NORM_CURRENT_CONST")
    volt = ampere / design.scales.ampere_per_volt
    base = [f" * U0 = {volt:.6g} V and I0 = {ampere:.6g} A per count of Q15 (full scale {volt * 32768:.4g} V, {ampere * 32768:.4g} A)"]
    group = ""
    for item in rows:
        if item.group != group:
            group = item.group
            base += [" *", f" * {group}"]
        base.append(_constant_row(item))
    return [*lines, *base, " */"]


def _constant_row(item: Constant) -> str:
    error = "exact" if abs(item.error_percent) < 5e-6 else f"{item.error_percent:+.3f} %"
    return (f" *   {item.name.ljust(30)}{item.value:>11.5g} {item.unit.ljust(9)}{item.q_value:>12d}  {item.q_format.ljust(26)}{error:>10}  {item.meaning}").rstrip()
