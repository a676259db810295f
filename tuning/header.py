"""The text of a userparams.h: sections, units, ranges and meanings in the user's order, and what the firmware makes of the numbers."""

import math
from collections.abc import Iterator

from tools.common import paths
from tools.common.motor_file import Motor

from .constants import Constant, filter_hz
from .design import Design
from .limits import STEP_ERPM
from .params import parameters

MODES = (("OPEN_LOOP_FUNCTIONING", "stay on the forced angle at END_SPEED_RPM; the estimator runs along and can be watched"),
         ("TUNING", "the speed reference ramps slowly from END_SPEED_RPM to MAXIMUM_SPEED_RPM by itself"),
         ("TORQUE_MODE", "the potentiometer commands the q current; MAXIMUM_SPEED_RPM still limits the speed"),
         ("BIDIRECTIONAL_SPEED", "the potentiometer's sides are the two directions, its middle is MINIMUM_SPEED_RPM; S3 has no function"),
         ("SNAPSHOT", "record SnapBuf1..4"),
         ("IDENTIFY", "measure R, L and Kphi of the motor instead of running it (docs/tuning.md)"),
         ("PARAMS_IN_RAM", "a debugger can change every parameter while the motor turns; TUNING does it too"))
MEANINGS = {
    "NOPOLESPAIRS": "pole pairs", "MOTOR_RS_OHM": "phase resistance: half of line to line", "MOTOR_LS_MH": "phase inductance: half of line to line",
    "MOTOR_KPHI_V_PER_KRPM": "line-to-line back-EMF per 1000 mechanical rpm",
    "MOTOR_INERTIA_KGM2": "rotor and whatever turns with it; scales the speed loop",
    "NOMINAL_BUS_V": "supply; the unit of voltage follows from it", "LOOPTIME_SEC": "PWM and control period", "DEADTIME_SEC": "dead time of the bridge",
    "NORM_CURRENT_CONST": "current of one count: full scale / 32768 (here {full_scale} A); calibrate with a probe",
    "KCURRA": "gain of phase A's current, 0.5 = 1; negative: shunt in the low leg", "KCURRB": "gain of phase B's current",
    "BUS_FULL_SCALE_V": "bus voltage that gives full scale at the converter",
    "SAMPLE_WINDOW_SEC": "low sides on for this long on each side of the sample's centre",
    "MINIMUM_SPEED_RPM": "potentiometer at zero", "NOMINAL_SPEED_RPM": "potentiometer at full scale, S3 off; the estimator's derivative changes here",
    "MAXIMUM_SPEED_RPM": "potentiometer at full scale, S3 on", "SPEEDREFRAMP_RPM_PER_S": "slope of the speed reference",
    "TUNING_DELAY_RAMPUP": "TUNING: one electrical rpm every TUNING_DELAY_RAMPUP + 1 periods",
    "LOCK_TIME": "{lock_s} s: rotor held at a fixed angle (two directions, half the time each)",
    "END_SPEED_RPM": "end of the ramp, where the estimator takes over (back-EMF {emf_v} V)",
    "OPENLOOP_RAMPSPEED_INCREASERATE": "acceleration of the ramp: {acceleration} rpm/s, {ramp_s} s to the end",
    "Q_CURRENT_REF_OPENLOOP": "current of lock and ramp: pull-out torque {pull_out} N m",
    "MAXIMUM_CURRENT_A": "length of the current vector that the drive may ask for",
    "OVER_CURRENT_THRESHOLD_A": "any phase above trips at once; must lie inside the converter's range", "OVER_VOLTAGE_V": "bus above trips",
    "UNDER_VOLTAGE_V": "bus below trips while running", "REGEN_LIMIT_V": "braking current is reduced from here, to nothing 2 V higher",
    "CURRENT_BANDWIDTH_HZ": "both current loops: {current_nominal}, {current_worst} over the parameter set",
    "SPEED_BANDWIDTH_HZ": "speed loop: {speed_nominal}, {speed_worst} over the parameter set",
    "KFILTER_ESDQ": "back-EMF up to FW_START_SPEED_RPM: {KFILTER_ESDQ} Hz", "KFILTER_ESDQ_FW": "back-EMF above: {KFILTER_ESDQ_FW} Hz",
    "KFILTER_VELESTIM": "speed for loop, thresholds and display: {KFILTER_VELESTIM} Hz",
    "FW_START_SPEED_RPM": "speed reference of entry 0", "FW_TRIM_CURRENT_A": "most that the voltage feedback may add to the table's d current",
    "IDREF_SPEED": "d current of each entry", "INVKFI_SPEED": "1/Kphi of each entry", "LS_OVER2LS0_SPEED": "Ls / (2 Ls0) of each entry; 0.5 = no change",
    "SNAPDELAY": "one row every SNAPDELAY periods", "DATA_BUFFER_SIZE": "rows of each of the four arrays"}
SECTIONS = (
    ("Motor: {motor}, values per phase of the star", ("NOPOLESPAIRS", "MOTOR_RS_OHM", "MOTOR_LS_MH", "MOTOR_KPHI_V_PER_KRPM", "MOTOR_INERTIA_KGM2")),
    ("Supply and board: {board}", ("NOMINAL_BUS_V", "LOOPTIME_SEC", "DEADTIME_SEC", "NORM_CURRENT_CONST", "KCURRA", "KCURRB", "BUS_FULL_SCALE_V", "SAMPLE_WINDOW_SEC")),
    ("Speeds", ("MINIMUM_SPEED_RPM", "NOMINAL_SPEED_RPM", "MAXIMUM_SPEED_RPM", "SPEEDREFRAMP_RPM_PER_S", "TUNING_DELAY_RAMPUP")),
    ("Start: lock, ramp, hand-over", ("LOCK_TIME", "END_SPEED_RPM", "OPENLOOP_RAMPSPEED_INCREASERATE", "Q_CURRENT_REF_OPENLOOP")),
    ("Limits and protections", ("MAXIMUM_CURRENT_A", "OVER_CURRENT_THRESHOLD_A", "OVER_VOLTAGE_V", "UNDER_VOLTAGE_V", "REGEN_LIMIT_V")),
    ("Control loops: bandwidths; the note's D_CURRCNTR_PTERM ... can be given directly instead, see drive/param_scaling.h", ("CURRENT_BANDWIDTH_HZ", "SPEED_BANDWIDTH_HZ")),
    ("Filters, Equation 7: K in Q15 per period", ("KFILTER_ESDQ", "KFILTER_ESDQ_FW", "KFILTER_VELESTIM")),
    ("Field weakening: one entry every {step_erpm:.0f} electrical rpm ({step_rpm:.5g} rpm with {pairs} pole pairs) of speed reference",
     ("FW_START_SPEED_RPM", "FW_TRIM_CURRENT_A")))
INVKFI_FLAT = """/* 1/Kphi of each entry, in the note's counts. The back-EMF keeps its size above base speed here (it has the range), so a
 * constant Kphi is the right start; the note's rising table made up for a clipped one. More turns the control angle ahead. */"""
INVKFI_TUNED = "/* 1/Kphi of each entry, in the note's counts; NORM_INVKFIBASE is the motor's own. More turns the control angle ahead. */"
WIDTH = 118


def write(design: Design) -> str:
    """The whole file."""
    lines = [*_head(design), *_modes()]
    facts = _facts(design)
    for title, names in SECTIONS:
        lines += ["", _rule(title.format(**facts))]
        lines += [_define(design, name, facts) for name in names]
        if title.startswith("Control loops") and "D_CURRCNTR_PTERM" in design.choices:
            lines += [f"{_left('D_CURRCNTR_PTERM', design)}/* [V/A, Q15/16] 2 pi f Ld: the salient motor's d axis has its own inductance */",
                      f"{_left('Q_CURRCNTR_PTERM', design)}/* [V/A, Q15/16] 2 pi f Lq */"]
    lines += _tables(design)
    lines += ["", _rule("Snapshot"), _define(design, "SNAPDELAY", facts), _define(design, "DATA_BUFFER_SIZE", facts)]
    lines += ["", *_constants(design), "", "#endif"]
    return "\n".join(lines) + "\n"


def _safe(text: str) -> str:
    """Text from a file that must not begin or end a comment, nor a line."""
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").replace("??/", "?? /").split())


def wanted(motor: Motor) -> str:
    """What MOTOR= finds a motor by."""
    return motor.name if motor.path.parent.resolve() == paths.MOTORS.resolve() else str(paths.shown(motor.path))


def _head(design: Design) -> list[str]:
    motor, board = (_safe(str(paths.shown(path))) for path in (design.motor.path, design.board.path))
    name = _safe(wanted(design.motor))
    lines = ["/* Everything a user edits, in engineering units: the motor, the supply, limits, start, control loops and field weakening.", " *",
             f" * Made from {motor} and {board} by: make tune MOTOR={name}",
             f" * (make userparams MOTOR={name} writes it to userparams.h). Field weakening: {design.tables_from}.", " *",
             " * Each line states unit, range and meaning; a value outside its range fails the build by name. Change a number here to try it; to keep",
             " * it, write it into the motor file's [tune] and make the header again. The Q15 constants of AN1292 (NORM_RS, NORM_LSDTBASE,",
             " * NORM_INVKFIBASE, NORM_DELTAT, D_ILIMIT_HS ...) follow from these in include/drive/param_scaling.h; the table at the end shows them."]
    for warning in design.warnings:
        lines += [" *", *(f" * {line}" for line in _wrapped("Note: " + _safe(warning), WIDTH + 8))]
    lines[-1] += " */"
    return [*lines, "#ifndef USERPARAMS_H", "#define USERPARAMS_H", ""]


def _modes() -> list[str]:
    lines = [_rule("Modes: remove the comment marks, or build with -D")]
    return lines + [f"/* #define {name} */".ljust(36) + f"/* {meaning} */" for name, meaning in MODES]


def _rule(title: str) -> str:
    return f"/* ---- {title} ".ljust(WIDTH, "-") + " */"


def _facts(design: Design) -> dict[str, object]:
    d, s = design, design.start_up
    period = d.board.pwm_period_s
    facts: dict[str, object] = {
        "motor": f"{_safe(d.motor.title)}, {'star' if d.motor.connection == 'Y' else 'delta'}", "board": _safe(d.board.title), "pairs": d.motor.pole_pairs,
        "full_scale": f"{d.board.current_full_scale_a:.4g}", "step_erpm": STEP_ERPM, "step_rpm": STEP_ERPM / d.motor.pole_pairs}
    facts |= {name: f"{filter_hz(d.value(name), period):.0f}" for name in ("KFILTER_ESDQ", "KFILTER_ESDQ_FW", "KFILTER_VELESTIM")}
    if s:
        facts |= {"lock_s": f"{d.value('LOCK_TIME') * period:.3g}", "emf_v": f"{s.emf_v:.2f}", "acceleration": f"{s.acceleration_rpm_s:.0f}",
                  "ramp_s": f"{s.ramp_s:.2f}", "pull_out": f"{s.pull_out_nm:.3g}"}
    for name, loop in (("current", d.current_loop), ("speed", d.speed_loop)):
        if loop:
            facts |= {f"{name}_nominal": f"phase margin {math.floor(loop.nominal.phase_deg)} degrees" if loop.nominal.stable else "unstable",
                      f"{name}_worst": f"{math.floor(loop.worst.phase_deg)}" if loop.worst.stable else "unstable"}
    return facts


def _left(name: str, design: Design) -> str:
    text = f"#define {name} {design.choices[name].text}"
    return text.ljust(36) + ("" if len(text) < 36 else " ")


def _define(design: Design, name: str, facts: dict[str, object]) -> str:
    p = parameters()[name]
    meaning = MEANINGS[name].format(**facts)
    if name == "MOTOR_LS_MH" and design.motor.salient:
        meaning = f"phase inductance of the q axis (Ld = {design.motor.ld_h * 1e3:.4g} mH): with it the estimated angle does not turn with the torque"
    return f"{_left(name, design)}/* {('[' + p.unit + ']').ljust(15)} {(p.low + ' .. ' + p.high).ljust(14)} {meaning} */"


def _tables(design: Design) -> Iterator[str]:
    for stem, comment in (("IDREF_SPEED", ""), ("INVKFI_SPEED", INVKFI_TUNED if design.tuned_by_machine else INVKFI_FLAT), ("LS_OVER2LS0_SPEED", "")):
        yield ""
        if comment:
            yield comment
        p = parameters()[f"{stem}0"]
        for i in range(18):
            text = design.choices[f"{stem}{i}"].text
            text = text if text.startswith(("-", "N")) else " " + text
            line = f"#define {stem}{i}".ljust(len(f"#define {stem}17") + 1) + text
            if i == 0:
                line = line.ljust(42) + f"/* {('[' + p.unit + ']').ljust(15)} {(p.low + ' .. ' + p.high).ljust(14)} {MEANINGS[stem]} */"
            yield line.rstrip()


def _constants(design: Design) -> list[str]:
    """The comment table of derived constants; the 54 table entries are left out, they stand above."""
    rows = [item for item in design.constants if "[" not in item.name]
    lines = ["/* ---- What the firmware makes of these numbers: engineering value, its count, and how much rounding changes it ".ljust(WIDTH, "-")]
    base = [f" * U0 = {_volt_per_count(design):.6g} V and I0 = {design.value('NORM_CURRENT_CONST'):.6g} A per count of Q15 (full scale "
            f"{_volt_per_count(design) * 32768:.4g} V, {design.value('NORM_CURRENT_CONST') * 32768:.4g} A)"]
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


def _volt_per_count(design: Design) -> float:
    return (design.value("NOMINAL_BUS_V") / math.sqrt(3.0) * (1.0 - design.value("DEADTIME_SEC") / design.value("LOOPTIME_SEC")) / 32768.0)


def _wrapped(text: str, width: int) -> list[str]:
    lines, line = [], ""
    for word in text.split():
        if len(line) + len(word) + 1 > width and line:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line]
