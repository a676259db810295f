"""`starts`: the motor started from every rotor angle under several loads. Limits are in tools/bench/scenarios/tables/starts.toml.

Loads, speed and times of the table are for its own motor; another one gets shares of its start torque and rated speed, and the time that
its header's lock and ramp take.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import motor_file, output, paths
from . import command_common, report, simulate, sweep
from .board import Library
from tools.common.errors import UserError
from .expect import Outcome
from tools.common.board_keys import Part, Values


MARGIN_S = 0.1
"""For the hand-over itself, beside lock and ramp."""
SETTLE_PERIODS = 5.0
"""Of the speed loop's bandwidth, which a heavy load makes small: what the speed gets to settle, at least the table's own time."""


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/starts.toml."""

    motor: str
    motor_where: str
    every_deg: float = sweep.within(1.0, 360.0)
    speed_rpm: float = sweep.within(0.0)
    start_s: float = sweep.within(0.0)
    within_s: float = sweep.within(0.0)
    measure_from_s: float = sweep.within(0.0)
    measure_to_s: float = sweep.within(0.0)
    error_percent: float = sweep.within(0.0)
    overshoot_percent: float = sweep.within(0.0)
    loads_nm: list[float] = sweep.within(0.0)
    other_loads_percent: list[float] = sweep.within(0.0, 100.0)
    other_speed_percent: float = sweep.within(1.0, 100.0)

    def __post_init__(self) -> None:
        if not self.start_s + self.within_s < self.measure_from_s < self.measure_to_s:
            raise UserError("the times are not in order", self.where, "start_s + within_s < measure_from_s < measure_to_s")

    def for_motor(self, motor: motor_file.Motor, params: Mapping[str, float]) -> "Table":
        """The table for another motor than its own, with that motor's header."""
        later_s = sweep.start_time_s(dict(params)) + MARGIN_S - self.within_s
        slower_s = max(SETTLE_PERIODS / params["SPEED_BANDWIDTH_HZ"] - (self.measure_from_s - self.start_s - self.within_s), 0.0)
        speed_rpm = max(self.other_speed_percent / 100.0 * motor.rated_speed_rpm, params["END_SPEED_RPM"])
        return replace(self, motor=motor.name, speed_rpm=round(speed_rpm), within_s=self.within_s + later_s,
                       measure_from_s=self.measure_from_s + later_s + slower_s, measure_to_s=self.measure_to_s + later_s + slower_s,
                       loads_nm=[float(f"{percent / 100.0 * motor.start_torque_nm:.3g}") for percent in self.other_loads_percent])


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    table = Table.read(paths.TABLES / "starts.toml")
    if options.every_deg is not None:
        if not 1.0 <= options.every_deg <= 360.0:
            raise UserError(f"every-deg = {options.every_deg:g} is impossible", "--every-deg", "choose 1 .. 360")
        table.every_deg = options.every_deg
    motor, board, library, used = command_common.set_up(table, options, [])
    target = command_common.results("starts", table.motor, options)
    if motor.path.stem != table.motor:
        table = table.for_motor(motor_file.load(str(motor.path)), library.params)
    cases = [(load, angle) for load in table.loads_nm for angle in np.arange(0.0, 360.0, table.every_deg).tolist()]
    jobs = [_job(table, load, angle, library, motor, board) for load, angle in cases]
    with output.ResultFolder(target) as folder:
        results = sweep.run_cases("starts", jobs, options.quiet)
        rows = [{"load_nm": load, "rotor_deg": angle, **result} for (load, angle), result in zip(cases, results)]
        outcomes = [check(table, row) for row in rows]
        _write(folder.work, table, rows, outcomes, used)
    print(f"{table.title}: {len(rows)} starts\n\n{report.used_text(used)}\n")
    print(text(table, rows))
    print(f"\nresults in {paths.shown(target)}/: index.html")
    return command_common.verdict("starts", outcomes)


def _job(table: Table, load: float, angle: float, library: Library, motor: Part, board: Part) -> simulate.Job:
    events = sweep.start_events(table.start_s, table.speed_rpm, library.params.get("NOMINAL_SPEED_RPM", 0.0), table.where)
    scenario = sweep.scenario(f"{angle:g} deg, {load:g} N m", table.title, events, table.speed_rpm, table.measure_from_s,
                               table.measure_to_s, rotor_deg=angle,
                               plant=Values({"load.constant_nm": load}, {"load.constant_nm": table.where}))
    return simulate.prepare(scenario, library, motor, board)


def check(table: Table, row: dict[str, Any]) -> Outcome:
    """One start against the limits; the first that does not hold is named."""
    name = f"start from {row['rotor_deg']:g} deg with {row['load_nm']:g} N m"
    closed, over, error = row["closed_after_s"], row["overshoot_percent"], row["speed_error_percent"]
    if row["fault"]:
        return Outcome(name, False, f"fault {row['fault']}", "no fault")
    if closed is None or closed > table.within_s:
        got = "never in closed loop" if closed is None else f"closed loop after {closed:.3f} s"
        return Outcome(name, False, got, f"at most {table.within_s:g} s")
    if over > table.overshoot_percent:
        return Outcome(name, False, f"overshoot {over:.1f} %", f"at most {table.overshoot_percent:g} %")
    return Outcome(name, abs(error) <= table.error_percent, f"speed error {error:+.2f} %",
                   f"at most {table.error_percent:g} %")


def text(table: Table, rows: list[dict[str, Any]]) -> str:
    """Angles down, loads across; each cell: seconds to closed loop, overshoot, speed error."""
    cells = {(row["load_nm"], row["rotor_deg"]): _cell(row) for row in rows}
    angles = sorted({row["rotor_deg"] for row in rows})
    width = max(map(len, cells.values()))
    width = max(width, 14)
    lines = ["rotor deg  " + "  ".join(f"{load:g} N m".center(width) for load in table.loads_nm)]
    lines += [f"{angle:9g}  " + "  ".join(cells[load, angle].rjust(width) for load in table.loads_nm) for angle in angles]
    return "\n".join(lines) + "\n\neach cell: closed loop after S2, overshoot, speed error at the end"


def _cell(row: dict[str, Any]) -> str:
    if row["fault"]:
        return row["fault"]
    if row["closed_after_s"] is None:
        return "never closed"
    return f"{row['closed_after_s']:.2f} s {row['overshoot_percent']:5.1f} % {row['speed_error_percent']:+5.2f} %"


def _write(folder: Path, table: Table, rows: list[dict[str, Any]], outcomes: list[Outcome], used: dict[str, Any]) -> None:
    keys = ["load_nm", "rotor_deg", "closed_after_s", "overshoot_percent", "speed_error_percent", "angle_error_rms_deg", "fault"]
    from . import plots
    report.write_table(folder, "starts", keys, rows, outcomes, {"title": table.title, **used}, {"plots": plots.write_starts(rows, folder)})
