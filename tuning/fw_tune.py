"""`tune-fw`: finds a motor's field-weakening tables on the virtual board, as AN1292's tuning section does by hand, and writes them down.

    1  raise the speed to where the voltage asks for d current: that is FW_START_SPEED_RPM, entry 0
    2  entry by entry, 1024 electrical rpm apart: the least d current with which speed, lock and a margin of voltage hold at the entry's
       load; Ls and then 1/Kphi where the angle error asks for them (fw_search.py). The entries change while the motor turns
       (PARAMS_IN_RAM); the voltage feedback's trim is off, so that the tables carry the load
    3  with the trim back on: the largest load torque at each entry, and the highest speed without load
    4  a firmware with the new tables, as make tune would build it, goes to the top and back

The load of an entry is a share of the rated torque, constant up to rated speed and falling with 1/speed above (constant power), as long
as the rated current is enough for it. Beyond, the tables make room for the speed alone, and the trim for a load.
"""

import argparse
import contextlib
import math
import re
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tools.bench import build, command_common, report
from tools.common import board_file, board_keys, motor_file, output, param_rows, paths, workers
from tools.bench.board import Library
from tools.common.errors import UserError
from tools.common.progress import Progress, waiting

from . import constants, fw_tables
from .fw_bench import Bench, Fault, built
from .fw_search import Found, Goal, Result, Search, largest, least, model_use, torque_per_ampere
from .fw_tables import ENTRIES, STEP_ERPM, Tables
from .limits import UNIT_ERPM, largest_erpm

RESULTS = paths.ROOT / "build" / "tune-fw"
FIRMWARE = paths.ROOT / "build" / "tune-fw-firmware"
TORQUE_SHARE, ANGLE_DEG, MARGIN = 0.2, 3.0, 0.03
ID_SHARE = 31.0 / 32.0
"""The firmware keeps d currents below this share of MAXIMUM_CURRENT_A."""
SPEED_STEP_RPM = 10.0
TORQUE_STEPS = 8
COLUMNS = (("speed_rpm", "speed\nrpm", "{:.0f}"), ("before_a", "Id so far\nA", "{:.2f}"), ("idref_a", "Id\nA", "{:.2f}"),
           ("inv_kfi", "1/Kphi\nQ15/2", "{:.0f}"), ("ls_ratio", "Ls/2Ls0\n", "{:.3f}"), ("load_nm", "its load\nN m", "{:.4f}"),
           ("use_percent", "voltage\n% of limit", "{:.1f}"), ("use_free_percent", "no load\n%", "{:.1f}"),
           ("angle_deg", "angle error\nmean deg", "{:+.2f}"), ("angle_free_deg", "no load\ndeg", "{:+.2f}"),
           ("current_a_rms", "current\nA rms", "{:.2f}"), ("current_free_a_rms", "no load\nA rms", "{:.2f}"),
           ("torque_nm", "torque\nN m", "{:.4f}"))


# ---- the command -----------------------------------------------------------------------------------------------------------
def add_command(commands: Any) -> None:
    """Adds `tune-fw` to a command line's commands."""
    parser = commands.add_parser("tune-fw", help="field-weakening tables of a motor, found on the virtual board")
    parser.add_argument("motor", help="a name in tuning/motors, or a motor file")
    parser.add_argument("--board", help="a name in tuning/boards, or a board file; default: the one in the motor file, else mclv")
    parser.add_argument("--tables", type=Path, help="where the tables go; default tuning/tables/MOTOR.toml")
    parser.add_argument("--out", type=Path, help="folder for plots and numbers; default build/tune-fw/NAME")
    parser.add_argument("--torque-share", type=float, default=TORQUE_SHARE, metavar="X",
                        help=f"load that the tables carry, as a share of the rated torque; default {TORQUE_SHARE:g}")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
                        help="change a key of the virtual board, e.g. motor.sat_lq_ratio=0.3; may be repeated")
    parser.add_argument("--entries", type=int, default=ENTRIES, metavar="N", help="stop after N entries (for a quick look); default all 18")
    parser.add_argument("--no-plots", action="store_true", help="no pictures")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    _check(options)
    started = time.perf_counter()
    motor = motor_file.load(options.motor, "tune-fw")
    board = board_file.load(*board_file.named(motor, options.board))
    header, risks = _header(motor, board)
    name = paths.name_of(motor.path, paths.MOTORS)
    target = options.out or RESULTS / name
    own = board_file.load(*board_file.named(motor))
    path = options.tables or fw_tables.path_of(name, "" if board.path.resolve() == own.path.resolve() else paths.name_of(board.path, paths.BOARDS))
    fw_tables.check_place(path)
    with output.in_turn(f"tune-fw-{name}"), output.ResultFolder(target) as folder:
        work = _Work(motor, header, risks, [motor.plant_values(), board.plant_values(), command_common.changes(options.changes)], options)
        tables, rows = work.search()
        check = work.check(tables)
        data = _write(folder.work, tables, rows, check, motor, options)
        fw_tables.write(path, tables)
    _print(motor, tables, rows, check, data)
    print(f"\nsimulated {work.motor_s:.0f} s of motor time in {time.perf_counter() - started:.0f} s")
    print(f"tables in {paths.shown(path)}, plots and numbers in {paths.shown(target)}/")
    for line in check.problems:
        print(f"foc33: {motor.name}: {line}", file=sys.stderr)
    return 1 if check.problems else 0


def _check(options: argparse.Namespace) -> None:
    for name, low, high in (("torque_share", 0.0, 1.0), ("entries", 2, ENTRIES)):
        value = getattr(options, name)
        if not low <= value <= high:
            flag = "--" + name.replace("_", "-")
            raise UserError(f"{flag[2:]} = {value:g} is impossible", flag, f"choose {low:g} .. {high:g}")


def _header(motor: Any, board: Any) -> tuple[str, str]:
    """The text of the userparams.h to begin with, and what the tuner warns may keep the motor from starting with it."""
    from . import design, header
    made = design.design(motor, board)
    return header.write(made), "; ".join(made.start_risks)


# ---- the work --------------------------------------------------------------------------------------------------------------
@dataclass
class Check:
    """What the finished firmware did."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Job:
    """What a process needs: a library, the plant, and what to do with it."""

    library: Path
    values: dict[str, float]
    goal: Goal
    tables: Tables | None = None
    index: int = 0
    entries: int = ENTRIES
    risks: str = ""

    def bench(self, tell: Callable) -> "contextlib.closing[Bench]":
        return contextlib.closing(Bench(self.library, self.values, tell, self.risks))


class _Work:
    """The steps of one command; `motor_s` counts the motor time."""

    def __init__(self, motor: Any, header: str, risks: str, layers: list[Any], options: argparse.Namespace) -> None:
        self.motor, self.header, self.quiet = motor, header, options.quiet
        self.motor_s = 0.0
        known = defines(header)
        top_rpm = highest_speed(known)
        library = self._library("search", param_rows.with_values(header, {"MAXIMUM_SPEED_RPM": f"{top_rpm:.0f}"}), ["PARAMS_IN_RAM"])
        self.params = library.params
        self.values = board_keys.resolve(layers, library.keys)
        limit_a = min(self.params["MAXIMUM_CURRENT_A"] * ID_SHARE, motor.maximum_current_a)
        goal = Goal(1.0 - MARGIN, ANGLE_DEG, limit_a, motor.rated_current_a, motor.rated_torque_nm, motor.rated_speed_rpm,
                    options.torque_share, motor.maximum_speed_rpm)
        self.job = _Job(library.path, self.values, goal, entries=options.entries, risks=risks)

    def _library(self, use: str, header: str, defines_: list[str]) -> Library:
        """Builds the firmware for a header text; the folder's name is the same each time, so that make builds only what has changed."""
        return Library(built(FIRMWARE / f"{paths.name_of(self.motor.path, paths.MOTORS)}-{use}", header, defines_))

    def _run(self, jobs: list[_Job], work: Callable, title: str, total: int | None = None, unit: str = "") -> list[Any]:
        """The jobs' results, with a bar that says where they are; what goes wrong in one says of which motor."""
        with Progress(title, total, self.quiet, unit) as progress:
            def tell(news: Any) -> None:
                index, place = 0, ""
                if isinstance(news, tuple):
                    index, rpm, text = news
                    place = f"{rpm:.0f} rpm, {text}"
                else:
                    self.motor_s += news
                progress.reach(max(progress.done, index), f"{title}: {place or f'{self.motor_s:.0f} s of motor time'}")
            try:
                return workers.run_all(jobs, work, tell)
            except UserError as error:
                raise UserError(f"{self.motor.name}: {error}") from None

    def search(self) -> tuple[Tables, list[dict[str, float]]]:
        """The tables, and what was measured at each entry."""
        result: Result = self._run([self.job], _search, "search", self.job.entries, "entries")[0]
        start_rpm = result.start_rpm if result.needed else min(self.params["FW_START_SPEED_RPM"], result.start_rpm - SPEED_STEP_RPM)
        tables = Tables(self.motor.name, round(start_rpm), result.entries(), fw_tables.fingerprint(self.params),
                        self.params["INVKFI_SPEED0"], result.found[-1].index, result.stopped, goal=self._goal())
        job = replace(self.job, tables=tables)
        torques = self._run([replace(job, index=found.index) for found in result.found], _torque, "torque")
        tables.maximum_speed_rpm = self._run([job], _maximum, "top speed")[0]
        tables.rows = [row(found, torque) for found, torque in zip(result.found, torques)]
        rows = [{"name": str(found.index), "before_a": table_current(defines(self.header), found.rpm), **values}
                for found, values in zip(result.found, tables.rows)]
        return tables, rows

    def _goal(self) -> dict[str, float]:
        goal = self.job.goal
        return {"torque_share": goal.torque_share, "voltage_margin": 1.0 - goal.use, "angle_error_deg": goal.angle_deg,
                "current_limit_a": goal.limit_a}

    def check(self, tables: Tables) -> Check:
        """The new tables in the firmware that a user gets: to the maximum speed, to the highest speed found, and a controlled stop."""
        wanted = self.job.goal.maximum_rpm
        top = math.floor(tables.maximum_speed_rpm)
        values = {**tables.parameters(), "MAXIMUM_SPEED_RPM": f"{max(top, round(self.params['NOMINAL_SPEED_RPM']) + 1):.0f}"}
        library = self._library("check", param_rows.with_values(self.header, values), [])
        speeds = [wanted] if wanted <= top else []
        speeds += [top] if top > wanted + SPEED_STEP_RPM or not speeds else []
        job = replace(self.job, library=library.path, tables=tables)
        check: Check = self._run([job], lambda job, tell: _end_to_end(job, speeds, tell), "check")[0]
        if top < wanted - 0.005 * wanted:
            check.problems.append(f"maximum speed {wanted:.0f} rpm is not reached, {top:.0f} rpm is: {tables.stopped}")
        return check


def _search(job: _Job, tell: Callable) -> Result:
    with job.bench(tell) as bench:
        try:
            return Search(bench, job.goal, lambda *news: tell(news), job.entries).run()
        except Fault as fault:
            raise UserError(f"the motor stopped with {fault} at {bench.target_rpm:.0f} rpm, below field weakening", "",
                            "run the motor there with make run and look at its plots") from None


@contextlib.contextmanager
def _ready(job: _Job, tell: Callable) -> Iterator[tuple[Bench, Tables]]:
    """A bench with the new tables and the trim as in userparams.h, in closed loop."""
    assert job.tables is not None
    with job.bench(tell) as bench:
        bench.set("FW_START_SPEED_RPM", job.tables.start_speed_rpm)
        for i, entry in enumerate(job.tables.entries):
            bench.entry(i, entry)
        bench.start()
        yield bench, job.tables


def _torque(job: _Job, tell: Callable) -> float:
    """Largest load at an entry's speed with the speed still held."""
    with _ready(job, tell) as (bench, tables):
        limit = torque_per_ampere(bench.params) * bench.params["MAXIMUM_CURRENT_A"]
        return largest(lambda torque_nm: holds(bench, tables.speed_rpm(job.index), torque_nm), limit, TORQUE_STEPS)


def holds(bench: Bench, rpm: float, torque_nm: float) -> bool:
    """From the unloaded motor at `rpm`: the load comes in half a second, and the speed is there after it. Unloads again."""
    held = False
    try:
        if bench.stopped():
            bench.start()
        bench.speed(rpm)
        if bench.regain():
            for step in range(1, 26):
                bench.load(torque_nm * step / 25.0)
                bench.run(0.02)
            bench.settle()
            bench.run(0.3)
            held = bench.point().held
        bench.load(0.0)
        bench.regain()
    except Fault:
        bench.load(0.0)
    return held


def _maximum(job: _Job, tell: Callable) -> float:
    """Highest speed held without load."""
    with _ready(job, tell) as (bench, tables):
        base = tables.speed_rpm(tables.last_index)

        def too_fast(step: int) -> bool:
            tell((ENTRIES, base + step * SPEED_STEP_RPM, "no load"))
            return not holds(bench, base + step * SPEED_STEP_RPM, 0.0)

        count = max(0, math.floor((bench.params["MAXIMUM_SPEED_RPM"] - base) / SPEED_STEP_RPM))
        first = least(too_fast, 8, 1, count) if count else None
        return base + (count if first is None else first - 1) * SPEED_STEP_RPM


def _end_to_end(job: _Job, speeds: list[float], tell: Callable) -> Check:
    check = Check()
    with job.bench(tell) as bench:
        try:
            _drive(bench, speeds, check)
        except Fault as fault:
            check.problems.append(f"the firmware with the new tables stops with {fault} at {bench.target_rpm:.0f} rpm")
    return check


def _drive(bench: Bench, speeds: list[float], check: Check) -> None:
    """Start, every speed, stop."""
    bench.start()
    for rpm in speeds:
        reached = bench.speed(rpm) and bench.regain()
        bench.run(1.0)
        point = bench.point(0.5)
        check.rows.append({"name": f"{rpm:.0f} rpm", "speed_rpm": point.speed_rpm, "id_a": point.id_a, "current_a_rms": point.current_rms_a,
                           "use_percent": 100.0 * point.use, "angle_deg": point.angle_deg, "trim_a": point.trim_a})
        if not reached or not point.held:
            check.problems.append(f"the firmware with the new tables does not hold {rpm:.0f} rpm, it turns at {point.speed_rpm:.0f} rpm")
    bench.press("s2")
    waited = 0.0
    while bench.state() == "STOPPING" and waited < 20.0:
        bench.run(0.1)
        waited += 0.1
    bench.check()
    if bench.state() != "STOPPED":
        check.problems.append(f"the firmware with the new tables does not stop, its state is {bench.state()}")


# ---- pure parts ------------------------------------------------------------------------------------------------------------
def defines(header: str) -> dict[str, float]:
    """The numbers that a userparams.h defines, by name."""
    found: dict[str, float] = {}
    for name, value in re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+)[ \t]+\(?(\S+?)\)?(?=\s|$)", header, flags=re.MULTILINE):
        try:
            found[name] = float(int(value, 16)) if value.lower().startswith("0x") else float(value.rstrip("fF"))
        except ValueError:
            continue
    return found


def highest_speed(known: dict[str, float]) -> float:
    """The highest MAXIMUM_SPEED_RPM that the build accepts for these parameters and that the tables could use."""
    try:
        pairs, bus = known["NOPOLESPAIRS"], known["NOMINAL_BUS_V"]
        base = next((rpm for rpm in range(100, 30000, 100) if model_use(known, rpm, 0.0, 0.0) > 1.0), 30000)
        ends = base + (ENTRIES + 1) * STEP_ERPM / pairs
        # the back-EMF's format, as PARAM_EMF_MAX_V of include/drive/scaling/estimator.h
        u0 = bus / math.sqrt(3.0) * (1.0 - known["DEADTIME_SEC"] / known["LOOPTIME_SEC"]) / 32768.0
        free_v = 0.9895 * 131068.0 * u0 - known["OVER_VOLTAGE_V"] / math.sqrt(3.0) \
            - 2.0 / math.sqrt(3.0) * known["OVER_CURRENT_THRESHOLD_A"] * param_rows.phase_ohm(known)
        by_emf = free_v / (2.0 * math.pi / 60.0 * pairs * 1.2 * known["MOTOR_LS_MH"] * 1e-3 * known["MAXIMUM_CURRENT_A"])
        # in the header's unit of speed, which 1/Kphi is counted in
        unit = constants.evaluate({name: f"{known[name]:g}" for name in ("NOPOLESPAIRS", "MAXIMUM_SPEED_RPM")}, "SPEED_UNIT")[0]
        by_format = min(UNIT_ERPM * unit, largest_erpm(known["LOOPTIME_SEC"])) / pairs
        return max(known["MAXIMUM_SPEED_RPM"], math.floor(min(ends, by_emf, by_format, 30000.0)))
    except KeyError as missing:
        raise UserError(f"{missing.args[0]} is no number", build.HEADER, "give a complete userparams.h") from None


def table_current(known: dict[str, float], rpm: float) -> float:
    """d current that a header's own table gives at a speed, as the firmware interpolates it."""
    place = max(0.0, (rpm - known["FW_START_SPEED_RPM"]) * known["NOPOLESPAIRS"] / STEP_ERPM)
    index = min(int(place), ENTRIES - 2)
    low, high = known[f"IDREF_SPEED{index}"], known[f"IDREF_SPEED{index + 1}"]
    return low + (high - low) * min(place - index, 1.0)


def row(found: Found, torque_nm: float) -> dict[str, float]:
    """What the tables file keeps of an entry."""
    return {"speed_rpm": found.rpm, "idref_a": found.entry.idref_a, "inv_kfi": found.entry.inv_kfi, "ls_ratio": found.entry.ls_ratio,
            "load_nm": found.load_nm, "use_percent": 100.0 * found.loaded.use, "use_free_percent": 100.0 * found.free.use,
            "angle_deg": found.loaded.angle_deg, "angle_free_deg": found.free.angle_deg, "current_a_rms": found.loaded.current_rms_a,
            "current_free_a_rms": found.free.current_rms_a, "bus_v": found.loaded.bus_v, "torque_nm": torque_nm}


# ---- what a person sees ----------------------------------------------------------------------------------------------------
def _write(folder: Path, tables: Tables, rows: list[dict[str, Any]], check: Check, motor: Any, options: argparse.Namespace) -> dict[str, Any]:
    keys = [key for key, _, _ in COLUMNS]
    output.write_csv(folder / "entries.csv", ["index", *keys], [[item["name"], *(item.get(key) for key in keys)] for item in rows])
    data = {"motor": str(paths.shown(motor.path)), "start_speed_rpm": tables.start_speed_rpm, "last_index": tables.last_index,
            "stopped": tables.stopped, "maximum_speed_rpm": tables.maximum_speed_rpm, "goal": tables.goal, "entries": rows,
            "check": check.rows, "problems": check.problems, "plots": []}
    if not options.no_plots:
        with waiting("plots", options.quiet):
            from . import fw_plots
            data["plots"] = fw_plots.write_all(tables, motor, folder)
    output.write_summary(folder, report.clean(data))
    return data


def _print(motor: Any, tables: Tables, rows: list[dict[str, Any]], check: Check, data: dict[str, Any]) -> None:
    goal = tables.goal
    what = f"field weakening from {tables.start_speed_rpm:.0f} rpm" if tables.last_index else f"{tables.stopped}, the tables are flat"
    print(f"{motor.title}: {what}\nTables carry {100.0 * goal['torque_share']:.0f} % of the rated torque of {motor.rated_torque_nm:g} N m (above "
          f"{motor.rated_speed_rpm:.0f} rpm at constant power), {100.0 * goal['voltage_margin']:.0f} % of the voltage stays free.\n"
          f"d current up to {goal['current_limit_a']:.2f} A" + (f"; above the rated {motor.rated_current_a:.2f} A it is spent on speed only.\n"
          if motor.rated_current_a < goal["current_limit_a"] else ".\n"))
    print(report.table(rows, COLUMNS))
    if tables.last_index:
        print(f"\nstopped: {tables.stopped}")
    print(f"highest speed without load: {tables.maximum_speed_rpm:.0f} rpm; asked for: {motor.maximum_speed_rpm:.0f} rpm")
    print("\nthe firmware with these tables:")
    print(report.table(check.rows, (("speed_rpm", "true\nrpm", "{:.1f}"), ("id_a", "Id\nA", "{:.2f}"), ("current_a_rms", "current\nA rms", "{:.2f}"),
                                    ("use_percent", "voltage\n% of limit", "{:.1f}"), ("angle_deg", "angle error\nmean deg", "{:+.2f}"),
                                    ("trim_a", "trim\nA", "{:.2f}"))))
