"""`identify`: the IDENTIFY firmware measures R, Ld, Lq and Kphi of a motor on the virtual board, and the result is compared with the truth.

The firmware gets a neutral userparams.h: pole pairs, a current and a speed from the motor file's rating, and the board file; nothing of
R, L, Kphi, inertia or friction. What it measures is the loop: winding, transistors and shunt. The winding is that less the bridge's
share, which is known from the board file: one transistor, and the shunt for the half of the time that the low side conducts.
"""

import argparse
import functools
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.bench import build, command_common, report
from tools.common import board_file, board_keys, command_line, motor_file, output, paths, workers
from tools.bench.board import Board, BoardError, Library
from tools.common.board_file import BoardFile
from tools.common.errors import UserError
from tools.common.motor_file import Motor
from tools.common.trace import Trace

RESULTS = paths.ROOT / "build" / "identify"
HEADERS = RESULTS / "headers"
MODE = "IDENTIFY"
LIMITS_PERCENT = {"R": 3.0, "Ld": 5.0, "Lq": 5.0, "Kphi": 2.0}
SALIENT = 0.03
"""Inductances that differ by less are one."""
ENTRIES = 18
LONGEST_S = 20.0
POWER_UP_S = 0.1
PRESS_S = 0.1
PERIODS_A_LOOK = 20
SIGNALS = ("plant.i_a", "plant.i_b", "plant.speed_rpm", "fw.i_d_a", "fw.i_q_a", "fw.v_d_v", "fw.v_q_v")
WATCH = ("step", "result", "Rs_mohm", "Ld_uH", "Lq_uH", "Kphi_mV_per_krpm")
"""Members of IdentifyParm in include/board/watch.h."""
COLUMNS = (("measured", "measured\n", "{}"), ("true", "true\n", "{}"), ("error_percent", "error\n%", "{:+.2f}"), ("limit_percent", "limit\n%", "{:g}"),
           ("verdict", "\nverdict", "{}"))


# ---- the firmware's own tables ---------------------------------------------------------------------------------------------
@functools.cache
def _table(name: str, fields: int) -> list[tuple[str, ...]]:
    """Rows of an X-macro of include/drive/identify.h as the compiler sees them."""
    arguments = ", ".join(f"a{n}" for n in range(fields))
    row = " ~ ".join(f"#a{n}" for n in range(fields))
    source = f'#include "drive/identify.h"\n#define ROW({arguments}) @@ {row}\n{name}(ROW)\n'
    command = [*shlex.split(os.environ.get("CC") or "gcc"), "-E", "-P", f"-I{paths.ROOT / 'include'}", f"-I{paths.ROOT}", "-xc", "-"]
    try:
        done = subprocess.run(command, input=source, capture_output=True, text=True, check=False)
    except OSError as error:
        raise UserError("cannot run the compiler", command[0], error.strerror or str(error)) from None
    if done.returncode != 0:
        raise UserError("the compiler cannot read drive/identify.h", command[0], (done.stderr.splitlines() or ["no message"])[0])
    rows = done.stdout.replace("\n", " ").split("@@")[1:]
    return [tuple(_words(cell) for cell in row.split(" ~ ")) for row in rows]


def _words(cell: str) -> str:
    """A stringised macro argument without its quotes."""
    text = re.sub(r'^\s*"|"\s*$', "", cell.strip())
    return re.sub(r'\\"\s*\\"|\\"', "", text)


def step_names() -> list[str]:
    """Names of the numbers in IdentifyParm.step."""
    return [name for name, _ in _table("IDENTIFY_STEP_TABLE", 2)]


@dataclass(frozen=True)
class Result:
    """How an identification ended."""

    name: str
    cause: str
    remedy: str


def results() -> dict[int, Result]:
    """Meaning of the numbers in IdentifyParm.result."""
    return {int(code): Result(name, cause, remedy) for code, name, cause, remedy in _table("IDENTIFY_RESULT_TABLE", 4)}


# ---- the neutral header ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Known:
    """What somebody without a data sheet knows of a motor, or dares to try."""

    pole_pairs: int
    current_a: float
    speed_rpm: float

    @classmethod
    def of(cls, motor: Motor, board: BoardFile, current_a: float | None = None, speed_rpm: float | None = None) -> "Known":
        """From the rating: the rated current as far as the board allows it, and 40 % of the speed that the rating promises at this bus."""
        share = min(1.0, board.nominal_bus_v / motor.rated_voltage_v)
        return cls(motor.pole_pairs, current_a or min(motor.rated_current_a, 0.8 * _trip_a(board)),
                   speed_rpm or max(50.0, min(0.4 * share * motor.rated_speed_rpm, 5000.0)))


def _trip_a(board: BoardFile) -> float:
    return 0.86 * board.current_full_scale_a


def header(known: Known, board: BoardFile) -> str:
    """A userparams.h for the IDENTIFY firmware."""
    maximum_a = max(known.current_a, 0.07 * board.current_full_scale_a)
    top_rpm = 1.3 * known.speed_rpm
    idle_ohm = min(1.0, 0.2 * board.nominal_bus_v / _trip_a(board)) # with more, R I leaves the back-EMF's format on a board for large currents
    rate = known.speed_rpm * known.pole_pairs * board.pwm_period_s * 65536.0 / 60.0 * 1024.0 / (2.0 / board.pwm_period_s)
    parts = {
        "What somebody has to know, or to try": {
            "NOPOLESPAIRS": known.pole_pairs, "Q_CURRENT_REF_OPENLOOP": known.current_a, "END_SPEED_RPM": known.speed_rpm,
            "OPENLOOP_RAMPSPEED_INCREASERATE": max(1, round(rate)), "MAXIMUM_CURRENT_A": maximum_a,
            "OVER_CURRENT_THRESHOLD_A": _trip_a(board)},
        "The board": {
            "NOMINAL_BUS_V": board.nominal_bus_v, "LOOPTIME_SEC": board.pwm_period_s, "DEADTIME_SEC": board.dead_time_s,
            "NORM_CURRENT_CONST": board.current_full_scale_a / 32768.0, "KCURRA": board.current_gain, "KCURRB": board.current_gain,
            "BUS_FULL_SCALE_V": board.bus_full_scale_v, "SAMPLE_WINDOW_SEC": board.sample_window_s, "OVER_VOLTAGE_V": board.over_voltage_v,
            "UNDER_VOLTAGE_V": board.under_voltage_v, "REGEN_LIMIT_V": board.regen_limit_v},
        "Without meaning here": {
            "MOTOR_RS_OHM": idle_ohm, "MOTOR_LS_MH": idle_ohm, "MOTOR_KPHI_V_PER_KRPM": 1.5 * known.pole_pairs, "MOTOR_INERTIA_KGM2": 1e-5,
            "MINIMUM_SPEED_RPM": max(50.0, 0.5 * known.speed_rpm), "NOMINAL_SPEED_RPM": max(100.0, known.speed_rpm * 1.1),
            "MAXIMUM_SPEED_RPM": max(120.0, top_rpm), "FW_START_SPEED_RPM": max(100.0, known.speed_rpm), "SPEEDREFRAMP_RPM_PER_S": 1000,
            "TUNING_DELAY_RAMPUP": 15, "LOCK_TIME": 4000, "CURRENT_BANDWIDTH_HZ": 200, "SPEED_BANDWIDTH_HZ": 10, "SPEEDCNTR_PTERM": 0.1,
            "SPEEDCNTR_ITERM": 0.001, "KFILTER_ESDQ": 1200, "KFILTER_ESDQ_FW": 1200, "KFILTER_VELESTIM": 748, "FW_TRIM_CURRENT_A": 0,
            **{f"IDREF_SPEED{n}": 0 for n in range(ENTRIES)}, **{f"INVKFI_SPEED{n}": "NORM_INVKFIBASE" for n in range(ENTRIES)},
            **{f"LS_OVER2LS0_SPEED{n}": 0.5 for n in range(ENTRIES)}, "SNAPDELAY": 5, "DATA_BUFFER_SIZE": 50}}
    lines = ["/* Parameters for a motor of which nobody knows R, L and Kphi: build with IDENTIFY. */", "#ifndef USERPARAMS_H", "#define USERPARAMS_H"]
    for title, values in parts.items():
        lines += ["", f"/* ---- {title} ---- */"]
        lines += [f"#define {name} {value if isinstance(value, (str, int)) else format(value, '.7g')}" for name, value in values.items()]
    return "\n".join([*lines, "", "#endif", ""])


def _library(motor: Motor, text: str) -> Path:
    """The virtual board with the IDENTIFY firmware for this header; built anew only when the header has changed."""
    folder = HEADERS / motor.name
    path = folder / build.HEADER
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return build.library([MODE], folder)


# ---- the measurement -------------------------------------------------------------------------------------------------------
@dataclass
class Job:
    """One identification on the virtual board."""

    library: Path
    values: dict[str, float]
    stop_after_s: float = LONGEST_S
    """When S2 is pressed again, counted from the first time."""


@dataclass
class Measured:
    """What the firmware said, and when."""

    watch: dict[str, int]
    fault: str
    steps: list[tuple[float, int]]
    """Time and number of every change of the step."""
    trace: Trace
    motor_s: float = 0.0
    outputs_seen: float = 0.0
    """Outputs that were on in the last period."""


def measure(job: Job, report_s: Callable[[float], None]) -> Measured:
    """Power-up, S2, and wait for the end; runs in a process of its own."""
    library = Library(job.library)
    board = Board(library)
    try:
        return _measure(job, library, board, report_s)
    except BoardError as error:
        raise UserError(f"the virtual board refuses: {error}", "identify", "correct the motor or board file") from None
    finally:
        board.close()


def _watch(board: Board) -> dict[str, int]:
    return {name: value & 0xFFFF for name, value in zip(WATCH, board.variable("IdentifyParm", len(WATCH)))}


def _measure(job: Job, library: Library, board: Board, report_s: Callable[[float], None]) -> Measured:
    for key, value in job.values.items():
        board.set(key, value)
    board.power_up()
    board.run(1)
    period_s = 1.0 / board.get("pwm.frequency_hz")
    board.run(round(POWER_UP_S / period_s))
    board.trace_start(list(SIGNALS), 1)
    board.set("input.s2", 1.0)
    began_s = board.get("time_s")
    now_s, rows, changes = began_s, [], [(began_s, 0)]
    while now_s - began_s < LONGEST_S:
        board.run(PERIODS_A_LOOK)
        rows.append(board.trace_take())
        before_s, now_s = now_s, board.get("time_s")
        report_s(now_s - before_s)
        watch = _watch(board)
        board.set("input.s2", 1.0 if now_s - began_s < PRESS_S or now_s - began_s >= job.stop_after_s else 0.0)
        if watch["step"] != changes[-1][1]:
            changes.append((now_s, watch["step"]))
        if watch["step"] == 0 and watch["result"] > 1:
            break
    board.run(PERIODS_A_LOOK)
    data = np.concatenate(rows)
    time_s = began_s + (now_s - began_s) / len(data) * np.arange(1, len(data) + 1)
    return Measured(_watch(board), library.faults.get(int(board.get("fw.fault")), "?"), changes,
                    Trace(list(SIGNALS), time_s, np.ascontiguousarray(data.T)), now_s - began_s, board.get("pwm.outputs_seen"))


# ---- the comparison --------------------------------------------------------------------------------------------------------
@dataclass
class Identified:
    """A motor, what was told, what was measured."""

    motor: Motor
    board: BoardFile
    known: Known
    header: str
    values: dict[str, float]
    measured: Measured

    @property
    def result(self) -> Result:
        return results()[self.measured.watch["result"]]

    @property
    def done(self) -> bool:
        return self.result.name == "DONE"

    @property
    def bridge_ohm(self) -> float:
        """What transistors and shunt add to a phase."""
        return self.board.rds_on_ohm + 0.5 * self.board.shunt_ohm

    @property
    def winding_ohm(self) -> float:
        return 1e-3 * self.measured.watch["Rs_mohm"] - self.bridge_ohm

    def rows(self) -> list[dict[str, Any]]:
        """Measured and true values with the limits of the errors. The truth is the plant's, changes and temperature included."""
        watch, plant_now = self.measured.watch, self.values
        degrees = plant_now.get("motor.temp_c", 25.0) - 25.0
        rs_ohm = plant_now["motor.rs_ohm"] * (1.0 + plant_now["motor.r_tempco"] * degrees)
        kphi = 3.0 ** 0.5 * plant_now["motor.psi_vs"] * plant_now["motor.pole_pairs"] * 1000.0 * 2.0 * np.pi / 60.0
        kphi *= 1.0 + plant_now["motor.psi_tempco"] * degrees
        return [
            _row("R loop [mohm]", f"{watch['Rs_mohm']}", f"{1e3 * (rs_ohm + self.bridge_ohm):.1f}"),
            _row("R winding [mohm]", f"{1e3 * self.winding_ohm:.1f}", f"{1e3 * rs_ohm:.1f}", self.winding_ohm / rs_ohm, "R"),
            _row("Ld [uH]", f"{watch['Ld_uH']}", f"{1e6 * plant_now['motor.ld_h']:.1f}", 1e-6 * watch["Ld_uH"] / plant_now["motor.ld_h"], "Ld"),
            _row("Lq [uH]", f"{watch['Lq_uH']}", f"{1e6 * plant_now['motor.lq_h']:.1f}", 1e-6 * watch["Lq_uH"] / plant_now["motor.lq_h"], "Lq"),
            _row("Kphi [mV/krpm]", f"{watch['Kphi_mV_per_krpm']}", f"{1e3 * kphi:.1f}", 1e-3 * watch["Kphi_mV_per_krpm"] / kphi, "Kphi")]

    def problems(self) -> list[str]:
        """What is wrong, one line each."""
        if not self.done:
            fault = f" (fault {self.measured.fault})" if self.measured.fault != "NONE" else ""
            return [f"{self.result.name}{fault}: {self.result.cause}: {self.result.remedy}"]
        return [f"{row['name']} is off by {row['error_percent']:+.2f} %, allowed are {row['limit_percent']:g} %"
                for row in self.rows() if row["verdict"] == "FAIL"]

    def paste(self) -> str:
        """The lines for a motor file: line to line, which means the same in a star and in a delta."""
        watch = self.measured.watch
        source = f"measured with {MODE}, {self.known.current_a:.3g} A"
        ld_mh, lq_mh = 1e-3 * watch["Ld_uH"], 1e-3 * watch["Lq_uH"]
        lines = ["[electrical]", f'pole_pairs = {{ value = {self.known.pole_pairs}, source = "counted" }}',
                 f'resistance = {{ value = {2.0 * self.winding_ohm:.4g}, unit = "ohm line-to-line", at_degc = 25, source = "{source}" }}']
        if abs(ld_mh - lq_mh) <= SALIENT * ld_mh:
            lines.append(f'inductance = {{ value = {ld_mh + lq_mh:.4g}, unit = "mH line-to-line", source = "{source}" }}')
        else:
            lines.append(f'inductance_d = {{ value = {2.0 * ld_mh:.4g}, unit = "mH line-to-line", source = "{source}" }}')
            lines.append(f'inductance_q = {{ value = {2.0 * lq_mh:.4g}, unit = "mH line-to-line", source = "{source}" }}')
        lines.append(f'kphi = {{ value = {1e-3 * watch["Kphi_mV_per_krpm"]:.4g}, unit = "V peak line-to-line/krpm", at_degc = 25, '
                     f'source = "{source}, {self.known.speed_rpm:.4g} rpm" }}')
        return "\n".join(lines)

    def text(self) -> str:
        """The whole report, as printed."""
        known = self.known
        parts = [f"{self.motor.name}: {self.motor.title}",
                 f"told: {known.pole_pairs} pole pairs, {known.current_a:.3g} A, {known.speed_rpm:.4g} rpm; "
                 f"bridge of {self.board.name}: {1e3 * self.bridge_ohm:.1f} mohm (transistor, half of the shunt)",
                 "\n".join(f"{at_s:9.4f} s  {step_names()[number]}" for at_s, number in self.measured.steps[1:])]
        if self.done:
            parts += [report.table(self.rows(), COLUMNS), "For the motor file (R without the bridge; note the winding's temperature):\n\n" + self.paste()]
        return "\n\n".join(parts)

    def data(self) -> dict[str, Any]:
        names = step_names()
        return {"motor": str(paths.shown(self.motor.path)), "board": str(paths.shown(self.board.path)), "result": self.result.name,
                "fault": self.measured.fault, "watch": self.measured.watch, "bridge_ohm": self.bridge_ohm, "rows": self.rows() if self.done else [],
                "steps": [{"at_s": round(at_s, 4), "step": names[number]} for at_s, number in self.measured.steps],
                "told": {"pole_pairs": self.known.pole_pairs, "current_a": self.known.current_a, "speed_rpm": self.known.speed_rpm}}


def _row(name: str, measured: str, true: str, ratio: float | None = None, limit: str = "") -> dict[str, Any]:
    if ratio is None:
        return {"name": name, "measured": measured, "true": true, "error_percent": None, "limit_percent": None, "verdict": None}
    error = 100.0 * (ratio - 1.0)
    allowed = LIMITS_PERCENT[limit]
    return {"name": name, "measured": measured, "true": true, "error_percent": error, "limit_percent": allowed,
            "verdict": "PASS" if abs(error) <= allowed else "FAIL"}


def identify(motors: list[Motor], board_name: str, changes: board_keys.Values, current_a: float | None = None, speed_rpm: float | None = None,
             quiet: bool = True) -> list[Identified]:
    """Identifies the motors, side by side."""
    board = board_file.load(board_name, "--board")
    known = [Known.of(motor, board, current_a, speed_rpm) for motor in motors]
    headers = [header(item, board) for item in known]
    libraries = [_library(motor, text) for motor, text in zip(motors, headers)]
    keys = workers.run_all(libraries[:1], _keys, lambda seconds: None)[0]
    values = [_plant(motor, board, changes, keys) for motor in motors]
    jobs = [Job(library, value) for library, value in zip(libraries, values)]
    with command_common.Progress("identify", 8.5 * len(jobs), quiet) as progress:
        measured = workers.run_all(jobs, measure, progress)
    return [Identified(*item) for item in zip(motors, [board] * len(motors), known, headers, values, measured)]


def _keys(library: Path, report_s: Callable[[float], None]) -> dict[str, board_keys.Key]:
    """The board's keys, from a process of its own: a library that this one has loaded would stay as it is when it is built anew."""
    return Library(library).keys


def _plant(motor: Motor, board: BoardFile, changes: board_keys.Values, keys: Any) -> dict[str, float]:
    values = board_keys.resolve([motor.plant_values(), board.plant_values(), changes], keys)
    values.setdefault("state.theta_e_deg", 137.0)
    values.setdefault("bus.voltage_v", values["supply.voltage_v"])
    values.setdefault("motor.r_tempco", motor.resistance_tempco_per_k)
    values.setdefault("motor.psi_tempco", motor.kphi_tempco_per_k)
    return values


# ---- the command -----------------------------------------------------------------------------------------------------------
def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What `identify` understands."""
    parser.add_argument("motor", nargs="?", help="a name in tuning/motors, or a motor file")
    parser.add_argument("--all", action="store_true", help="every motor of tuning/motors")
    parser.add_argument("--board", default="mclv", help="a name in tuning/boards, or a board file; default mclv")
    parser.add_argument("--current", type=float, metavar="A", help="Q_CURRENT_REF_OPENLOOP; default: from the rating")
    parser.add_argument("--speed", type=float, metavar="RPM", help="END_SPEED_RPM; default: 40 %% of the rating")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
                        help="change a key of the virtual board, e.g. load.locked=1; may be repeated")
    parser.add_argument("--out", type=Path, help="folder for plots and numbers; default build/identify/MOTOR")
    parser.add_argument("--no-plots", action="store_true", help="no pictures")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def add_command(commands: Any) -> None:
    """Adds `identify` to a command line's commands."""
    parser = commands.add_parser("identify", help="R, L and Kphi as the IDENTIFY firmware measures them on the virtual board")
    add_arguments(parser)
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code: 1 if a value is outside its limit or the identification did not end with DONE."""
    _check(options)
    motors, code = command_line.each(paths.names(paths.MOTORS) if options.all else [options.motor],
                                     lambda name: motor_file.load(name, "command line"))
    if not motors:
        return code
    found = identify(motors, options.board, command_common.changes(options.changes), options.current, options.speed, options.quiet)
    for item in found:
        target = options.out or RESULTS / item.motor.name
        _write(item, target, not options.no_plots)
        print(item.text() if not options.all else _brief(item))
        if not options.all:
            print(f"\nresults in {paths.shown(target)}/")
        sys.stdout.flush()
        for line in item.problems():
            print(f"foc33: {item.motor.name}: {line}", file=sys.stderr)
            code = max(code, 1)
    return code


def _check(options: argparse.Namespace) -> None:
    if options.all == (options.motor is not None):
        raise UserError("which motor?", "command line", "name one, or write --all" if not options.all else "write either a motor or --all")
    if options.all and options.out is not None:
        raise UserError("one folder for several motors", "--out", "leave it out, or name one motor")
    for name, low, high in (("current", 0.05, 20.0), ("speed", 50.0, 5000.0)):
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            raise UserError(f"{name} = {value:g} is impossible", f"--{name}", f"choose {low:g} .. {high:g}")


def _brief(item: Identified) -> str:
    """One line for a motor in a list."""
    if not item.done:
        return f"{item.motor.name:28}  {item.result.name}"
    errors = "   ".join(f"{row['name'].split(' [')[0]} {row['measured']:>7} {row['error_percent']:+6.2f} %" for row in item.rows()[1:])
    return f"{item.motor.name:28}  {errors}"


def _write(item: Identified, target: Path, with_plots: bool) -> None:
    with output.ResultFolder(target) as folder:
        data = item.data()
        (folder.work / build.HEADER).write_text(item.header, encoding="utf-8")
        if item.done:
            (folder.work / "electrical.toml").write_text(item.paste() + "\n", encoding="utf-8")
        if with_plots:
            from . import identify_plots
            data["plots"] = identify_plots.write_all(item, step_names(), folder.work)
        output.write_summary(folder.work, data)
