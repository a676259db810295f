"""`rated`: every motor with its tuned header at parts of its rated speed under load, and how fast it gets without. What is asked and what
must hold is in tools/bench/scenarios/tables/rated.toml."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.common import board_keys, command_line, motor_file, output, paths
from . import command_common, report, simulate, sweep
from .board import Library
from tools.common.errors import UserError
from .expect import Outcome
from tools.common.motor_file import Motor
from tools.common.progress import Progress

COLUMNS = (
    ("torque_nm_set", "brake\nN m", "{:.4f}"), ("reference_rpm", "reference\nrpm", "{:.0f}"), ("speed_rpm", "true\nrpm", "{:.1f}"),
    ("speed_error_percent", "error\n%", "{:+.2f}"), ("current_rms_a", "phase I\nA rms", "{:.3f}"),
    ("current_of_maximum_percent", "of max\n%", "{:.0f}"), ("angle_error_mean_deg", "angle err\nmean deg", "{:+.1f}"),
    ("angle_error_rms_deg", "angle err\nrms deg", "{:.1f}"), ("voltage_percent", "voltage\n% of limit", "{:.0f}"),
    ("closed_after_s", "closed\nafter s", "{:.2f}"), ("verdict", "\nverdict", "{}"))
KEYS = ("motor", "row", "torque_nm_set", "reference_rpm", "speed_rpm", "speed_error_percent", "current_rms_a",
        "current_of_maximum_percent", "angle_error_mean_deg", "angle_error_rms_deg", "voltage_percent", "closed_after_s", "highest_rpm",
        "fault", "verdict")


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/rated.toml."""

    speeds_percent: list[float] = sweep.within(1.0, 1000.0)
    torque_percent: float = sweep.within(0.0, 1000.0)
    start_s: float = sweep.within(0.01, 60.0)
    within_s: float = sweep.within(0.01, 60.0)
    settle_s: float = sweep.within(0.01, 60.0)
    torque_over_s: float = sweep.within(0.01, 60.0)
    measure_s: float = sweep.within(0.01, 60.0)
    error_percent: float = sweep.within(0.0)
    angle_error_deg: float = sweep.within(0.0)
    current_percent: float = sweep.within(0.0)


@dataclass(frozen=True)
class Candidate:
    """A motor with the firmware that was built for it."""

    motor: Motor
    part: board_keys.Part
    board: board_keys.Part
    header: str
    library: Library

    @property
    def params(self) -> dict[str, float]:
        return self.library.params


@dataclass(frozen=True)
class Row:
    """What one row asks of a motor."""

    name: str
    rpm: float
    torque_nm: float


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    table = Table.read(paths.TABLES / "rated.toml")
    names = paths.names(paths.MOTORS) if options.motor is None else options.motor
    if options.userparams is not None and len(names) != 1:
        raise UserError("one header for several motors", "--userparams", "name one motor with --motor")
    refused: dict[str, str] = getattr(options, "refused", {})
    ready, code = command_line.each(names, lambda name: _with_header(name, options, table))
    if not ready and not refused:
        return code
    target = options.out or results("rated", names[0] if len(names) == 1 else None, command_common.board_asked_for(options))
    with output.ResultFolder(target) as folder:
        candidates = _candidates(ready, options)
        cases = [(item, row) for item in candidates for row in rows_of(table, item)]
        jobs = [_job(table, item, row) for item, row in cases]
        results = sweep.run_cases("rated", jobs, options.quiet)
        rows = [_result(table, item, row, result) for (item, row), result in zip(cases, results)]
        outcomes = [outcome for row in rows for outcome in check(table, row)]
        outcomes += [Outcome(name, False, why, "a motor that its board can turn") for name, why in refused.items()]
        _write(folder.work, table, candidates, rows, outcomes, refused)
    print(text(table, candidates, rows, refused))
    print(f"\nresults in {paths.shown(target)}/: index.html")
    return max(code, command_common.verdict("rated", outcomes))


def results(name: str, motor: str | None, board: Path | None) -> Path:
    """The folder of the results; its name tells the motor, if it is one, and the board that was asked for."""
    parts = [name, motor and paths.name_of(paths.find("motor", motor, paths.MOTORS, "--motor"), paths.MOTORS), board and paths.name_of(board, paths.BOARDS)]
    return paths.RESULTS / "-".join(part for part in parts if part)


def _with_header(name: str, options: argparse.Namespace, table: Table) -> tuple[Motor, board_keys.Part, Path]:
    """A motor, its board and the folder of its header. Files are looked at before anything is built."""
    motor = motor_file.load(name, "--motor")
    board = command_common.board_of(motor, table, options.board, True)
    return motor, board, Path(options.userparams) if options.userparams else command_common.tuned_header(motor.path, command_common.board_asked_for(options))


def _candidates(ready: list[tuple[Motor, board_keys.Part, Path]], options: argparse.Namespace) -> list[Candidate]:
    """Every motor's firmware, built."""
    result = []
    with Progress("firmware", len(ready), options.quiet, "headers built") as progress:
        for motor, board, header in ready:
            library = command_common.library_for([], None, header)
            result.append(Candidate(motor, motor_file.part(str(motor.path)), board, command_common.header_name(None, header), library))
            progress(1.0)
    return result


def rows_of(table: Table, item: Candidate) -> list[Row]:
    """The rows of one motor: loaded at each speed, then as fast as the header allows."""
    motor, torque_nm = item.motor, table.torque_percent / 100.0 * item.motor.rated_torque_nm
    rows = [Row(f"{percent:g} %", percent / 100.0 * motor.rated_speed_rpm, torque_nm) for percent in table.speeds_percent]
    return [*rows, Row("maximum", item.params["MAXIMUM_SPEED_RPM"], 0.0)]


def _job(table: Table, item: Candidate, row: Row) -> simulate.Job:
    asked = f"{item.motor.name}: {row.name} ({row.rpm:g} rpm)"
    events, settled_s = sweep.loaded_run(item.params, row.rpm, table, asked, row.torque_nm)
    scenario = sweep.scenario(asked, table.title, events, row.rpm, settled_s, settled_s + table.measure_s)
    return simulate.prepare(scenario, item.library, item.part, item.board)


def _result(table: Table, item: Candidate, row: Row, result: dict[str, Any]) -> dict[str, Any]:
    """A row of the printed table."""
    data = {"motor": item.motor.name, "row": row.name, "name": f"  {row.name}", "reference_rpm": row.rpm, "torque_nm_set": row.torque_nm,
            **result}
    return data | {"verdict": verdict(table, data)}


def verdict(table: Table, row: dict[str, Any]) -> str:
    """"ok", or the first thing that does not hold."""
    closed, speed = row["closed_after_s"], sweep.speed_verdict(row, table.error_percent)
    if row["fault"]:
        return f"fault {row['fault']}"
    if closed is None:
        return "never in closed loop"
    if closed > table.within_s:
        return f"closed loop after {closed:.2f} s"
    if speed:
        return speed
    if row["angle_error_rms_deg"] is None or row["angle_error_rms_deg"] > table.angle_error_deg:
        return "angle"
    if row["current_of_maximum_percent"] > table.current_percent:
        return "current"
    return "ok"


def check(table: Table, row: dict[str, Any]) -> list[Outcome]:
    """What must hold for one row: its verdict with the numbers."""
    numbers = [f"{text} {row[key]:{form}} {unit}" for text, key, form, unit in
               (("error", "speed_error_percent", "+.2f", "%"), ("angle error", "angle_error_rms_deg", ".1f", "deg"),
                ("current", "current_of_maximum_percent", ".0f", "% of its maximum")) if row[key] is not None]
    allowed = f"no fault, closed loop within {table.within_s:g} s, error {table.error_percent:g} %, angle error " \
              f"{table.angle_error_deg:g} deg, current {table.current_percent:g} %"
    return [Outcome(f"{row['motor']} at {row['row']}", row["verdict"] == "ok", ", ".join([row["verdict"], *numbers]), allowed)]


def highest_text(rows: list[dict[str, Any]]) -> str:
    """How fast a motor got without load, of what its header allows."""
    row = rows[-1]
    if row["highest_rpm"] is None:
        return "no closed loop without load"
    return f"without load up to {row['highest_rpm']:.0f} rpm (MAXIMUM_SPEED_RPM {row['reference_rpm']:.0f})"


def text(table: Table, candidates: list[Candidate], rows: list[dict[str, Any]], refused: dict[str, str]) -> str:
    """The table as printed: a heading for each motor, then its rows; last a row for each motor that cannot run, with its reason."""
    lines = report.table(rows, COLUMNS).splitlines()
    parts = [f"{table.title}: {table.torque_percent:g} % of the rated torque", "", *lines[:3]]
    per_motor = len(rows) // max(len(candidates), 1)
    for number, item in enumerate(candidates):
        part = slice(number * per_motor, (number + 1) * per_motor)
        rating = f"{item.motor.rated_speed_rpm:g} rpm, {item.motor.rated_torque_nm:.3g} N m, board {item.board.path.stem}"
        parts += [f"{item.motor.name} ({rating}), {item.header}: {highest_text(rows[part])}", *lines[3:][part]]
        note = command_common.header_note(item.part.values.values, item.params)
        parts += [f"  note: {note}"] if note else []
    return "\n".join([*parts, *(f"{name}: not run: {why}" for name, why in refused.items())])


def _write(folder: Path, table: Table, candidates: list[Candidate], rows: list[dict[str, Any]], outcomes: list[Outcome],
           refused: dict[str, str]) -> None:
    from . import plots
    motors = [command_common.used(item.part, item.library, item.header)
              | {"name": item.motor.name, "board": str(paths.shown(item.board.path)), "rated_speed_rpm": item.motor.rated_speed_rpm,
                 "rated_torque_nm": item.motor.rated_torque_nm} for item in candidates]
    report.write_table(folder, "rated", KEYS, rows, outcomes,
                       {"title": table.title, "motors": motors, "refused": refused},
                       {"plots": plots.write_rated(rows, vars(table), folder)})
