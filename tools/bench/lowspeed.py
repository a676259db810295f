"""`lowspeed`: is a low speed held under load, and how low does it go? What is asked and what must hold is in
tools/bench/scenarios/tables/lowspeed.toml."""

import argparse
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tools.common import motor_file, output, paths
from tools.common.board_keys import Part
from . import command_common, reach, report, simulate, sweep
from .board import Library
from .expect import Outcome
from .run import Run
from .scenario import param

COLUMNS = (
    ("asked_rpm", "reference\nrpm", "{:.1f}"), ("speed_rpm", "true\nrpm", "{:.1f}"), ("speed_error_percent", "error\n%", "{:+.2f}"),
    ("speed_min_rpm", "lowest\nrpm", "{:.0f}"), ("speed_max_rpm", "highest\nrpm", "{:.0f}"),
    ("angle_error_mean_deg", "angle err\nmean deg", "{:+.1f}"), ("angle_error_rms_deg", "angle err\nrms deg", "{:.1f}"),
    ("current_rms_a", "phase I\nA rms", "{:.3f}"), ("verdict", "\nverdict", "{}"))
KEYS = ("reference_rpm", "torque_nm_set", *(key for key, _, _ in COLUMNS[:-1]), "fault", "verdict")


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/lowspeed.toml."""

    motor: str
    motor_where: str
    speeds_rpm: list[float] = sweep.within(1.0)
    torques_nm: list[float] = sweep.within(0.0)
    current_percent: float = sweep.within(1.0, 100.0)
    start_s: float = sweep.within(0.01, 60.0)
    settle_s: float = sweep.within(0.01, 60.0)
    torque_over_s: float = sweep.within(0.01, 60.0)
    measure_s: float = sweep.within(0.01, 60.0)
    error_percent: float = sweep.within(0.0, 100.0)
    angle_error_deg: float = sweep.within(0.0, 180.0)
    lowest_rpm: float = sweep.within(50.0)
    ratio: float = sweep.within(1.01, 10.0)
    resolution_percent: float = sweep.within(0.1, 20.0)

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own: the same shares of its rating, but no speed below the one from which its header holds it."""
        speeds, torques = sweep.shares(self.motor, motor, self.speeds_rpm, self.torques_nm)
        possible = dict.fromkeys(max(rpm, param(params, "MINIMUM_SPEED_RPM")) for rpm in speeds)
        return replace(self, motor=motor.name, speeds_rpm=list(possible), torques_nm=torques)

    def below(self) -> list[float]:
        """The speeds that are tried below the table's own, downwards."""
        result = [min(self.speeds_rpm) / self.ratio]
        while result[-1] > self.lowest_rpm:
            result.append(result[-1] / self.ratio)
        return [rpm for rpm in result[:-1] if rpm > self.lowest_rpm] + [self.lowest_rpm] * (min(self.speeds_rpm) > self.lowest_rpm)


@dataclass(frozen=True)
class Bench:
    """Everything that the runs of one command have in common."""

    table: Table
    motor: Part
    board: Part
    library: Library

    def torque_nm(self, asked: float) -> float:
        """The torque of a row: what is asked for, as far as the current allows."""
        most_a = self.table.current_percent / 100.0 * param(self.library.params, "MAXIMUM_CURRENT_A")
        return min(asked, sweep.three_digits(most_a * reach.torque_per_amp(self.motor.values.values)))

    def job(self, rpm: float, torque_nm: float) -> simulate.Job:
        """A start, the speed, the brake, and the hold."""
        table, lowered = self.table, {}
        if rpm < param(self.library.params, "MINIMUM_SPEED_RPM"):
            lowered = {"MINIMUM_SPEED_RPM": rpm}
        name = f"{rpm:.4g} rpm, {torque_nm:.3g} N m"
        events, settled_s = sweep.loaded_run(self.library.params | lowered, rpm, table, name, torque_nm)
        scenario = sweep.scenario(name, table.title, events, rpm, settled_s, settled_s + table.measure_s)
        return simulate.prepare(scenario, self.library, self.motor, self.board, parameters=lowered)

    def run(self, cases: list[tuple[float, float]], title: str, quiet: bool) -> list[dict[str, Any]]:
        """The rows of all (speed, torque), in order."""
        jobs = [self.job(rpm, self.torque_nm(torque)) for rpm, torque in cases]
        results = sweep.run_cases(title, jobs, quiet, _work)
        return [self._row(rpm, self.torque_nm(torque), result) for (rpm, torque), result in zip(cases, results)]

    def _row(self, rpm: float, torque_nm: float, result: dict[str, Any]) -> dict[str, Any]:
        row = {"name": f"{rpm:.4g} rpm, {torque_nm:.3g} N m", "reference_rpm": rpm, "torque_nm_set": torque_nm, **result}
        return row | {"verdict": verdict(self.table, row)}


def _work(job: simulate.Job, progress: Callable[[float], None]) -> dict[str, Any]:
    return measured(simulate.simulate(job, progress))


def measured(run: Run) -> dict[str, Any]:
    """What a row needs of its run. The reference is the one that the firmware had: the potentiometer's steps do not count."""
    measure, result = run.scenario.measures[0], sweep.reduced(run)
    asked = run.trace.part(measure.from_s, measure.to_s).column("fw.speed_ref_rpm").astype(np.float64).mean()
    result["asked_rpm"] = float(asked)
    result["speed_error_percent"] = 100.0 * (result["speed_rpm"] / float(asked) - 1.0) if asked > 0.0 else None
    return result


def verdict(table: Table, row: dict[str, Any]) -> str:
    """"ok", or the first thing that does not hold."""
    if row["closed_after_s"] is None:
        return f"no start: {row['fault'] or 'never in closed loop'}"
    if row["fault"]:
        return f"fault {row['fault']}"
    error = row["speed_error_percent"]
    if error is None or abs(error) > table.error_percent:
        return "no speed" if error is None else f"speed {error:+.1f} %"
    return "angle" if row["angle_error_rms_deg"] > table.angle_error_deg else "ok"


def check(table: Table, row: dict[str, Any]) -> Outcome:
    """One of the table's rows: its verdict with the numbers."""
    error, angle = row["speed_error_percent"], row["angle_error_rms_deg"]
    got = row["verdict"] + ("" if error is None else f", error {error:+.2f} %")
    return Outcome(row["name"], row["verdict"] == "ok", got + ("" if angle is None else f", angle error {angle:.1f} deg"),
                   f"no fault, error {table.error_percent:g} %, angle error {table.angle_error_deg:g} deg")


def find_lowest(bench: Bench, known: list[dict[str, Any]], quiet: bool) -> dict[float, sweep.Search]:
    """By torque: downwards from the table's highest speed, then bisection between the last that holds and the first that does not.
    `known`: the table's own rows."""
    table = bench.table
    searches = {bench.torque_nm(torque): sweep.Search(False, lambda row: row["verdict"] == "ok", max(table.speeds_rpm))
                for torque in table.torques_nm}
    for row in known:
        searches[row["torque_nm_set"]].narrow(row["reference_rpm"], row)
    wanted, number = list(itertools.product(table.below(), searches)), 0
    while wanted:
        number += 1
        for row in bench.run(wanted, f"lowest {number}", quiet):
            searches[row["torque_nm_set"]].narrow(row["reference_rpm"], row)
        wanted = [(rpm, torque) for torque, search in searches.items()
                  if (rpm := search.next(table.resolution_percent / 100.0)) is not None and search.bad != search.start]
    return searches


def lowest_text(searches: dict[float, sweep.Search]) -> str:
    """A line for each torque: how low it goes, and what happens below."""
    lines = []
    for torque, search in searches.items():
        held = "not at all" if search.bad == search.start else f"down to {search.good:.0f} rpm"
        below = "the search ended there" if search.bad is None else f"at {search.bad:.0f} rpm: {search.why}"
        lines.append(f"{torque:.3g} N m is held {held} ({below})")
    return "\n".join(lines)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    table = Table.read(paths.TABLES / "lowspeed.toml")
    motor, board, library, used = command_common.set_up(table, options, ["PARAMS_IN_RAM"])
    target = command_common.results("lowspeed", table.motor, options)
    if motor.path.stem != table.motor:
        table = table.for_motor(motor_file.load(str(motor.path)), library.params)
    bench = Bench(table, motor, board, library)
    with output.ResultFolder(target) as folder:
        rows = bench.run(list(itertools.product(table.speeds_rpm, table.torques_nm)), "lowspeed", options.quiet)
        outcomes = [check(table, row) for row in rows]
        searches = find_lowest(bench, rows, options.quiet)
        lowest = [{"torque_nm": torque, "lowest_rpm": None if search.bad == search.start else search.good, "fails_at_rpm": search.bad,
                   "why": search.why} for torque, search in searches.items()]
        report.write_table(folder.work, "lowspeed", KEYS, rows, outcomes, {"title": table.title, **used}, {"lowest": lowest})
    print(f"{table.title}\n\n{report.used_text(used)}\n")
    print(report.table(rows, COLUMNS))
    print("\n" + lowest_text(searches))
    print(f"\nresults in {paths.shown(target)}/: index.html")
    return command_common.verdict("lowspeed", outcomes)
