"""`identify`: the IDENTIFY firmware measures R, Ld, Lq, Kphi, inertia and friction of a motor on the virtual board.

The result is compared with the truth.

The firmware gets a neutral userparams.h: pole pairs, a current and a speed from the motor file's rating, and the board file; nothing of
R, L, Kphi, inertia or friction. What it measures is the loop: winding, transistors and shunt. The winding is that less the bridge's
share, which is known from the board file: one transistor, and the shunt for the half of the time that the low side conducts.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tools.bench import build, command_common
from tools.bench.board import Board, BoardError, Library
from tools.common import board_file, board_keys, command_line, motor_file, output, paths, workers
from tools.common.board_file import BoardFile
from tools.common.errors import UserError
from tools.common.motor_file import Motor
from tools.common.param_rows import FOLLOWS, parameters
from tools.common.progress import Progress
from tools.common.trace import Trace

from .fw_bench import built
from .identify_result import MODE, Identified, Known, Measured, step_names, trip_a

RESULTS = paths.ROOT / "build" / "identify"
HEADERS = RESULTS / "headers"
LONGEST_S = 900.0
USUAL_S = 12.0
ALL_ROWS_S = 60.0
POWER_UP_S = 0.1
PRESS_S = 0.1
PERIODS_A_LOOK = 20
SIGNALS = ("plant.i_a", "plant.i_b", "plant.speed_rpm", "fw.i_d_a", "fw.i_q_a", "fw.v_d_v", "fw.v_q_v")
WATCH = ("step", "result")
VALUES = ("Rs_uohm", "Ld_nH", "Lq_nH", "Kphi_uV_per_krpm", "J_1e9_kgm2", "Coulomb_1e8_Nm", "Viscous_1e9_Nms")
"""Members of IdentifyParm in include/board/modes/mode_board.h: of 16 bits, then of 32."""


# ---- the neutral header ----------------------------------------------------------------------------------------------------
def header(known: Known, board: BoardFile) -> str:
    """A userparams.h for the IDENTIFY firmware."""
    maximum_a = max(known.current_a, 0.07 * board.current_full_scale_a)
    top_rpm = 1.3 * known.speed_rpm
    idle_ohm = min(1.0, 0.2 * board.nominal_bus_v / trip_a(board)) # with more, R I leaves the back-EMF's format on a board for large currents
    rate = known.speed_rpm * known.pole_pairs * board.pwm_period_s * 65536.0 / 60.0 * 1024.0 / (2.0 / board.pwm_period_s)
    parts = {
        "What somebody has to know, or to try": {
            "NOPOLESPAIRS": known.pole_pairs, "Q_CURRENT_REF_OPENLOOP": known.current_a, "END_SPEED_RPM": known.speed_rpm,
            "OPENLOOP_RAMPSPEED_INCREASERATE": max(1, round(rate)), "MAXIMUM_CURRENT_A": maximum_a,
            "OVER_CURRENT_THRESHOLD_A": trip_a(board)},
        "The board": {
            "NOMINAL_BUS_V": board.nominal_bus_v, "LOOPTIME_SEC": board.pwm_period_s, "DEADTIME_SEC": board.dead_time_s,
            "NORM_CURRENT_CONST": board.current_full_scale_a / 32768.0, "KCURRA": board.current_gain, "KCURRB": board.current_gain,
            "BUS_FULL_SCALE_V": board.bus_full_scale_v, "SAMPLE_WINDOW_SEC": board.sample_window_s, "OVER_VOLTAGE_V": board.over_voltage_v,
            "UNDER_VOLTAGE_V": board.under_voltage_v, "REGEN_LIMIT_V": board.regen_limit_v},
        "Without meaning here": {
            "MOTOR_RS_OHM": idle_ohm, "MOTOR_LS_MH": idle_ohm, "MOTOR_KPHI_V_PER_KRPM": min(0.2 * known.pole_pairs * board.nominal_bus_v, 200.0),
            "MOTOR_INERTIA_KGM2": 1e-5 * known.pole_pairs ** 2, "MINIMUM_SPEED_RPM": max(50.0, known.speed_rpm),
            "NOMINAL_SPEED_RPM": max(100.0, known.speed_rpm * 1.1),
            "MAXIMUM_SPEED_RPM": max(120.0, top_rpm), "FW_START_SPEED_RPM": max(100.0, known.speed_rpm), "SPEEDREFRAMP_RPM_PER_S": 1000,
            "LOCK_TIME": 4000, "CURRENT_BANDWIDTH_HZ": 200, "SPEED_BANDWIDTH_HZ": 1, "LOAD_BANDWIDTH_HZ": 10,
            "SPEEDCNTR_PTERM": 0.1, "KFILTER_ESDQ": 1200, "KFILTER_ESDQ_FW": 1200, "KFILTER_VELESTIM": 748, "FW_TRIM_CURRENT_A": 0,
            "I2T_CURRENT_A": 0, "I2T_TIME_SEC": 60,
            **{name: 0 if row.stem == "IDREF_SPEED" else row.default for name, row in parameters().items()
               if row.stem == "IDREF_SPEED" or row.default not in FOLLOWS}}}
    lines = ["/* Parameters for a motor of which nobody knows R, L and Kphi: build with IDENTIFY. */", "#ifndef USERPARAMS_H", "#define USERPARAMS_H"]
    for title, values in parts.items():
        lines += ["", f"/* ---- {title} ---- */"]
        lines += [f"#define {name} {value if isinstance(value, (str, int)) else format(value, '.7g')}" for name, value in values.items()]
    return "\n".join([*lines, "", "#endif", ""])


# ---- the measurement -------------------------------------------------------------------------------------------------------
@dataclass
class Job:
    """One identification on the virtual board."""

    library: Path
    values: dict[str, float]
    stop_after_s: float = LONGEST_S
    """When S2 is pressed again, counted from the first time."""


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
    words = [value & 0xFFFF for value in board.variable("IdentifyParm", len(WATCH) + 2 * len(VALUES))]
    low, high = words[len(WATCH)::2], words[len(WATCH) + 1::2]
    return dict(zip(WATCH, words)) | {name: lower + 65536 * upper for name, lower, upper in zip(VALUES, low, high)}


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
    last = len(step_names()) - 1
    now_s, rows, times, changes = began_s, [], [], [(began_s, 0)]
    while now_s - began_s < LONGEST_S:
        board.run(PERIODS_A_LOOK)
        before_s, now_s = now_s, board.get("time_s")
        report_s(now_s - before_s)
        watch = _watch(board)
        seen = board.trace_take()
        shown = slice(-1, None) if watch["step"] == last or now_s - began_s > ALL_ROWS_S else slice(None) # no plot shows the rest
        times.append(np.linspace(before_s, now_s, len(seen) + 1)[1:][shown])
        rows.append(seen[shown])
        board.set("input.s2", 1.0 if now_s - began_s < PRESS_S or now_s - began_s >= job.stop_after_s else 0.0)
        if watch["step"] != changes[-1][1]:
            changes.append((now_s, watch["step"]))
        if watch["step"] == 0 and watch["result"] > 1:
            break
    board.run(PERIODS_A_LOOK)
    data, time_s = np.concatenate(rows), np.concatenate(times)
    return Measured(_watch(board), library.faults.get(int(board.get("fw.fault")), "?"), changes,
                    Trace(list(SIGNALS), time_s, np.ascontiguousarray(data.T)), now_s - began_s, board.get("pwm.outputs_seen"))


# ---- several motors at once -------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Prepared:
    """A motor with its board and the firmware that measures it."""

    motor: Motor
    board: BoardFile
    known: Known
    header: str
    library: Path
    changes: board_keys.Values = field(default_factory=board_keys.Values)


def prepared(motor: Motor, board_name: str | None, current_a: float | None, speed_rpm: float | None,
             changes: board_keys.Values | None = None) -> Prepared:
    """Builds the firmware for a motor; on its own board if none is named."""
    board = board_file.load(*board_file.named(motor, board_name))
    known = Known.of(motor, board, current_a, speed_rpm)
    text = header(known, board)
    return Prepared(motor, board, known, text, built(HEADERS / paths.name_of(motor.path, paths.MOTORS), text, [MODE]), changes or board_keys.Values())


def identify(items: list[Prepared], changes: board_keys.Values, quiet: bool = True) -> list[Identified]:
    """Identifies the motors, side by side."""
    keys = workers.run_all([items[0].library], _keys, lambda seconds: None)[0]
    values = [_plant(item, changes, keys) for item in items]
    jobs = [Job(item.library, value) for item, value in zip(items, values)]
    with Progress("identify", USUAL_S * len(jobs), quiet) as progress:
        spent_s = 0.0

        def tell(more_s: float) -> None:
            nonlocal spent_s
            spent_s += more_s
            progress.reach(spent_s, "" if spent_s <= USUAL_S * len(jobs) else f"identify, {spent_s:.0f} s: heavy rotors take minutes")
        measured = workers.run_all(jobs, measure, tell)
    return [Identified(item.motor, item.board, item.known, item.header, *found) for item, *found in zip(items, values, measured)]


def _keys(library: Path, report_s: Callable[[float], None]) -> dict[str, board_keys.Key]:
    """The board's keys, from a process of its own: a library that this one has loaded would stay as it is when it is built anew."""
    return Library(library).keys


def _plant(item: Prepared, changes: board_keys.Values, keys: Any) -> dict[str, float]:
    motor, board = item.motor, item.board
    values = board_keys.resolve([motor.plant_values(), board.plant_values(), item.changes, changes], keys)
    values.setdefault("state.theta_e_deg", 137.0)
    values.setdefault("bus.voltage_v", values["supply.voltage_v"])
    values.setdefault("motor.r_tempco", motor.resistance_tempco_per_k)
    values.setdefault("motor.psi_tempco", motor.kphi_tempco_per_k)
    return values


# ---- the command -----------------------------------------------------------------------------------------------------------
def add_command(commands: Any) -> None:
    """Adds `identify` to a command line's commands."""
    parser = commands.add_parser("identify", help="R, L, Kphi, inertia, friction as IDENTIFY measures them on the virtual board")
    parser.add_argument("motor", nargs="?", help="a name in tuning/motors, or a motor file")
    parser.add_argument("--all", action="store_true", help="every motor of tuning/motors")
    parser.add_argument("--board", help="a name in tuning/boards, or a board file; default: the one in the motor file, else mclv")
    parser.add_argument("--current", type=float, metavar="A", help="Q_CURRENT_REF_OPENLOOP; default: from the rating")
    parser.add_argument("--speed", type=float, metavar="RPM", help="END_SPEED_RPM; default: 40 %% of the rating")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
                        help="change a key of the virtual board, e.g. load.locked=1; may be repeated")
    parser.add_argument("--out", type=Path, help="folder for plots and numbers; default build/identify/NAME")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code: 1 if a value is outside its limit or the identification did not end with DONE."""
    names = command_line.one_or_all(options, paths.names(paths.MOTORS))
    _check(options)
    changes = command_common.changes(options.changes)
    board = options.board and paths.find("board", options.board, paths.BOARDS, "--board")
    with output.in_turn("identify"):
        ready, code = command_line.each(names, lambda name: prepared(motor_file.load(name, "command line"), options.board, options.current, options.speed))
        if not ready:
            return code
        found = identify(ready, changes, options.quiet)
    for item in found:
        target = options.out or RESULTS / paths.pair_name(item.motor.path, board)
        _write(item, target)
        print(item.text() if not options.all else _brief(item))
        if not options.all:
            print(f"\nresults in {paths.shown(target)}/")
        sys.stdout.flush()
        for line in item.problems():
            print(f"foc33: {item.motor.name}: {line}", file=sys.stderr)
            code = max(code, 1)
    return code


def _check(options: argparse.Namespace) -> None:
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


def _write(item: Identified, target: Path) -> None:
    with output.ResultFolder(target) as folder:
        data = item.data()
        (folder.work / build.HEADER).write_text(item.header, encoding="utf-8")
        if item.has_electrical:
            (folder.work / "motor.toml").write_text(item.file() + "\n", encoding="utf-8")
        from . import identify_plots
        data["plots"] = identify_plots.write_all(item, step_names(), folder.work)
        output.write_summary(folder.work, data)
