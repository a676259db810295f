"""`table2`: the eight rows of AN1292's Table 2 beside ours. The rows are data in tools/bench/scenarios/tables/table2.toml."""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tools.common import output, paths
from . import command_common, report, simulate, sweep
from .board import Library
from tools.common.errors import UserError
from .expect import Outcome
from .sweep import limit_text
from tools.common.board_keys import Part
from .scenario import Event

COLUMNS = (
    ("torque_nm_set", "torque\nN m", "{:.3f}"), ("note_rpm", "note\nrpm", "{:.0f}"), ("speed_rpm", "ours\nrpm", "{:.1f}"),
    ("speed_error_percent", "error\n%", "{:+.2f}"), ("note_current_a", "note I\nA rms", "{:.3f}"),
    ("current_rms_a", "our I\nA rms", "{:.3f}"),
    ("angle_error_mean_deg", "angle err\nmean deg", "{:+.2f}"), ("angle_error_rms_deg", "angle err\nrms deg", "{:.2f}"),
    ("voltage_v", "voltage\nV", "{:.2f}"), ("voltage_percent", "of limit\n%", "{:.0f}"), ("limit", "\nlimited by", "{}"))


@dataclass(frozen=True)
class Row:
    """One row of AN1292's table, and what must hold for it."""

    reference_rpm: float
    torque_nm: float
    note_rpm: float
    note_current_a: float
    error_percent: float
    no_more_current: bool
    more_percent: float = 0.0
    """of current, for a header whose shorter period leaves less voltage"""


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/table2.toml, with its columns as rows."""

    motor: str
    motor_where: str
    reference_rpm_where: str
    start_s: float = sweep.within(0.0)
    torque_from_s: float = sweep.within(0.0)
    torque_over_s: float = sweep.within(0.0)
    measure_from_s: float = sweep.within(0.0)
    measure_to_s: float = sweep.within(0.0)
    error_percent: float = sweep.within(0.0)
    reference_rpm: list[float] = sweep.within(1.0)
    torque_nm: list[float] = sweep.within(0.0)
    note_rpm: list[float] = sweep.within(0.0)
    note_current_a: list[float] = sweep.within(0.0)
    more_current_rpm: list[float] = sweep.within(0.0)
    note_period_us: float = sweep.within(10.0)
    shorter_period_percent: float = sweep.within(0.0)

    def __post_init__(self) -> None:
        if not self.start_s < self.torque_from_s < self.measure_from_s < self.measure_to_s:
            raise UserError("the times are not in order", self.where, "start_s < torque_from_s < measure_from_s < measure_to_s")
        columns = (self.reference_rpm, self.torque_nm, self.note_rpm, self.note_current_a)
        if len(set(map(len, columns))) > 1:
            raise UserError("columns of different lengths", self.reference_rpm_where,
                            "give reference_rpm, torque_nm, note_rpm and note_current_a a number for each row")
        self.rows = [Row(*cells, self.error_percent, cells[0] not in self.more_current_rpm) for cells in zip(*columns)]


def rows_for(table: Table, period_s: float) -> list[Row]:
    """What must hold with a header of this period."""
    shorter = period_s < 0.99e-6 * table.note_period_us
    return [replace(row, more_percent=table.shorter_period_percent) if shorter else row for row in table.rows]


def command(options: argparse.Namespace, run_cases: Callable[..., list[dict[str, Any]]] = sweep.run_cases) -> int:
    """The whole command; returns the exit code. `run_cases` runs the jobs."""
    table = Table.read(paths.TABLES / "table2.toml")
    motor, board, library, used = command_common.set_up(table, options, [])
    wanted = rows_for(table, library.params["LOOPTIME_SEC"])
    jobs = [job(table, row, library, motor, board) for row in wanted]
    target = command_common.results("table2", table.motor, options)
    with output.ResultFolder(target) as folder:
        results = run_cases("table2", jobs, options.quiet)
        rows = [_result(row, result) for row, result in zip(wanted, results)]
        outcomes = [outcome for row, result in zip(wanted, rows) for outcome in check(row, result)]
        _write(folder.work, table, rows, outcomes, used)
    print(f"{table.title}\n\n{report.used_text(used)}\n")
    print(report.table(rows, COLUMNS))
    print("\n" + report.outcomes_text(outcomes))
    print(f"\nresults in {paths.shown(target)}/: index.html")
    return command_common.verdict("table2", outcomes)


def job(table: Table, row: Row, library: Library, motor: Part, board: Part) -> simulate.Job:
    """A fresh start for a row."""
    nominal = library.params.get("NOMINAL_SPEED_RPM", 0.0)
    events = sweep.start_events(table.start_s, row.reference_rpm, nominal, table.reference_rpm_where)
    events.append(Event(table.torque_from_s, "set", table.reference_rpm_where, keys={"load.constant_nm": row.torque_nm},
                        over_s=table.torque_over_s))
    scenario = sweep.scenario(f"{row.reference_rpm:g} rpm", table.title, events, row.reference_rpm, table.measure_from_s,
                               table.measure_to_s)
    return simulate.prepare(scenario, library, motor, board)


def _result(row: Row, result: dict[str, Any]) -> dict[str, Any]:
    """A row of the printed table: AN1292's numbers and ours."""
    return {"name": f"{row.reference_rpm:.0f} rpm", "reference_rpm": row.reference_rpm, "torque_nm_set": row.torque_nm,
            "note_rpm": row.note_rpm, "note_current_a": row.note_current_a, **result, "limit": limit_text(result)}


def check(row: Row, result: dict[str, Any]) -> list[Outcome]:
    """What must hold for one row."""
    name = f"{row.reference_rpm:g} rpm, {row.torque_nm:g} N m"
    got = f"{result['speed_rpm']:.1f} rpm" + (f", fault {result['fault']}" if result["fault"] else "")
    error = result["speed_error_percent"]
    ok = error is not None and abs(error) <= row.error_percent and not result["fault"]
    outcomes = [Outcome(f"{name}: speed", ok, got, f"{row.reference_rpm:g} rpm +- {row.error_percent:g} %")]
    if row.no_more_current:
        current = result["current_rms_a"]
        most = row.note_current_a * (1.0 + 0.01 * row.more_percent)
        outcomes.append(Outcome(f"{name}: current", current is not None and current <= most, "nothing" if current is None else f"{current:.3f} A RMS",
                                f"at most AN1292's {row.note_current_a:g} A" + (f" and {row.more_percent:g} %" if row.more_percent else "")))
    return outcomes


def _write(folder: Path, table: Table, rows: list[dict[str, Any]], outcomes: list[Outcome], used: dict[str, Any]) -> None:
    keys = ["reference_rpm", *(key for key, _, _ in COLUMNS), "fault"]
    from . import plots
    report.write_table(folder, "table2", keys, rows, outcomes, {"title": table.title, **used}, {"plots": plots.write_table2(rows, folder)})
