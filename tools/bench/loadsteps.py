"""`loadsteps`: the brake closes and opens at once; how far the speed dips and rises, and how soon it is back. What is asked and what must
hold is in tools/bench/scenarios/tables/loadsteps.toml."""

import argparse
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import motor_file, output, paths
from tools.common.board_keys import Part, Values
from tools.common.errors import UserError
from tools.common.trace import wrapped_deg
from . import command_common, picture, reach, report, simulate, sweep
from .board import Library
from .expect import Outcome
from .metrics import limited_percent
from .run import Run
from .scenario import BRAKE, Event, Scenario, param

BACKWARDS_RPM = 0.0
DRAWN_EVERY = 10
"""Periods."""

COLUMNS = (
    ("kphi", "true Kphi\nfactor", "{:.1f}"), ("unloaded", "unloaded\nrpm", "{}"), ("lowest_rpm", "lowest\nrpm", "{:.0f}"),
    ("dip_percent", "dip\n%", "{:.1f}"), ("on_back_s", "back\nafter s", "{:.3f}"), ("highest_rpm", "highest\nrpm", "{:.0f}"),
    ("off_back_s", "back\nafter s", "{:.3f}"), ("angle_error_max_deg", "angle err\nmax deg", "{:.1f}"), ("verdict", "\nverdict", "{}"))
KEYS = ("reference_rpm", "torque_nm", "kphi", "unloaded_min_rpm", "unloaded_max_rpm", "lowest_rpm", "dip_percent", "on_back_s",
        "highest_rpm", "rise_percent", "off_back_s", "angle_error_max_deg", "need_voltage_v", "voltage_limit_v", "need_current_a", "beyond",
        "too_quick", "fault", "verdict")


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/loadsteps.toml."""

    motor: str
    motor_where: str
    dip_rpm_where: str
    speeds_rpm: list[float] = sweep.within(1.0)
    torques_nm: list[float] = sweep.within(0.0)
    kphi_factors: list[float] = sweep.within(0.1, 10.0)
    current_percent: float = sweep.within(1.0, 100.0)
    start_s: float = sweep.within(0.01, 60.0)
    settle_s: float = sweep.within(0.01, 60.0)
    unloaded_s: float = sweep.within(0.01, 60.0)
    hold_s: float = sweep.within(0.01, 60.0)
    back_percent: float = sweep.within(0.01, 100.0)
    back_s: float = sweep.within(0.001, 60.0)
    dip_rpm: list[float] = sweep.within(0.0)
    dip_nm: list[float] = sweep.within(0.0)
    dip_percent: list[float] = sweep.within(0.0, 100.0)
    unloaded_rpm: list[float] = sweep.within(0.0)
    unloaded_percent: float = sweep.within(0.0, 100.0)

    def __post_init__(self) -> None:
        if not len(self.dip_rpm) == len(self.dip_nm) == len(self.dip_percent):
            raise UserError("columns of different lengths", self.dip_rpm_where, "give dip_rpm, dip_nm and dip_percent as many numbers each")

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own: shares of its rating, and no limits but the common ones."""
        speeds, torques = sweep.shares(self.motor, motor, self.speeds_rpm, self.torques_nm)
        return replace(self, motor=motor.name, speeds_rpm=[sweep.within_header(params, rpm) for rpm in speeds], torques_nm=torques,
                       dip_rpm=[], dip_nm=[], dip_percent=[], unloaded_rpm=[])

    def dip_limit(self, row: Mapping[str, Any]) -> float | None:
        """How far the speed may fall in this row, in per cent; None where that is not limited."""
        limits = {(rpm, torque): percent for rpm, torque, percent in zip(self.dip_rpm, self.dip_nm, self.dip_percent)}
        return limits.get((row["reference_rpm"], row["torque_nm"])) if row["kphi"] == 1.0 else None


@dataclass(frozen=True)
class Case:
    """One row: a step on and off again."""

    table: Table
    rpm: float
    torque_nm: float
    kphi: float
    current_max_a: float
    answer_s: float
    job: simulate.Job
    on_s: float
    off_s: float

    @property
    def scenario(self) -> Scenario:
        return self.job.scenario


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    table = Table.read(paths.TABLES / "loadsteps.toml")
    motor, board, library, used = command_common.set_up(table, options, [])
    target = command_common.results("loadsteps", table.motor, options)
    if motor.path.stem != table.motor:
        table = table.for_motor(motor_file.load(str(motor.path)), library.params)
    asked = itertools.product(table.speeds_rpm, table.torques_nm, table.kphi_factors)
    cases = [case(table, *item, library, motor, board) for item in asked]
    with output.ResultFolder(target) as folder:
        results = sweep.run_cases("loadsteps", cases, options.quiet, _work)
        drawn = [result.pop("drawn") for result in results]
        rows = [row_of(item, result) for item, result in zip(cases, results)]
        outcomes = [check(table, row) for row in rows]
        from . import plots
        report.write_table(folder.work, "loadsteps", KEYS, rows, outcomes, {"title": table.title, **used},
                           {"plots": plots.write_loadsteps(rows, drawn, table.hold_s, folder.work)})
    print(f"{table.title}: {len(rows)} rows\n\n{report.used_text(used)}\n")
    print(text(rows))
    print(f"\nresults in {paths.shown(target)}/: index.html")
    return command_common.verdict("loadsteps", outcomes)


def case(table: Table, rpm: float, torque_nm: float, kphi: float, library: Library, motor: Part, board: Part) -> Case:
    """One row, ready to run."""
    plant = Values({"motor.psi_vs": ("factor", kphi)}, {"motor.psi_vs": table.where})
    current_max_a = param(library.params, "MAXIMUM_CURRENT_A")
    most_nm = table.current_percent / 100.0 * current_max_a * kphi * reach.torque_per_amp(motor.values.values)
    if max(table.torques_nm) > most_nm: # all of them less, so that they stay three
        torque_nm = sweep.three_digits(torque_nm * most_nm / max(table.torques_nm))
    name = f"{rpm:g} rpm, {torque_nm:g} N m, Kphi x{kphi:g}"
    events, settled_s = sweep.loaded_run(library.params, rpm, table, name)
    on_s = settled_s + table.unloaded_s
    off_s = on_s + table.hold_s
    events += [Event(on_s, "set", table.where, keys={BRAKE: torque_nm}), Event(off_s, "set", table.where, keys={BRAKE: 0.0})]
    scenario = sweep.scenario(name, table.title, events, rpm, on_s, off_s + table.hold_s)
    job = simulate.prepare(scenario, library, motor, board, plant)
    return Case(table, rpm, torque_nm, kphi, current_max_a, reach.answer_s(library.params), job, on_s, off_s)


def _work(item: Case, progress: Callable[[float], None]) -> dict[str, Any]:
    return measured(item, simulate.simulate(item.job, progress))


def measured(item: Case, run: Run) -> dict[str, Any]:
    """What a row needs of its run."""
    table, trace, end_s = item.table, run.trace, run.scenario.duration_s
    before, on, off, both = (trace.part(from_s, to_s) for from_s, to_s in (
        (item.on_s - table.unloaded_s, item.on_s), (item.on_s, item.off_s), (item.off_s, end_s), (item.on_s, end_s)))
    speeds = [part.column("plant.speed_rpm").astype(np.float64) for part in (before, on, off, both)]
    reference = float(before.column("fw.speed_ref_rpm").astype(np.float64).mean()) or item.rpm
    faults = [name for _, _, name in run.fault_changes() if name != run.faults.get(0, "NONE")]
    error = wrapped_deg(both.column("fw.theta_est_deg").astype(np.float64) - both.column("plant.theta_e_deg"))
    loaded = trace.part(item.off_s - 0.2 * table.hold_s, item.off_s)
    every = trace.part(item.on_s - 0.1 * table.hold_s, end_s)
    return {
        "picture": picture.of(run, picture.SWEEP_STRETCHES), "limited_percent": limited_percent(loaded),
        "ramped_rpm": reference, "unloaded_min_rpm": float(speeds[0].min()), "unloaded_max_rpm": float(speeds[0].max()),
        "lowest_rpm": float(speeds[3].min()), "highest_rpm": float(speeds[2].max()),
        "dip_percent": 100.0 * (1.0 - float(speeds[3].min()) / reference),
        "rise_percent": 100.0 * (float(speeds[2].max()) / reference - 1.0),
        "on_back_s": back_after(speeds[1], reference, table.back_percent, trace.period_s),
        "off_back_s": back_after(speeds[2], reference, table.back_percent, trace.period_s),
        "angle_error_max_deg": float(np.max(np.abs(error))), "voltage_limit_v": float(loaded.column("fw.v_limit_v").mean()),
        "closed": bool(run.hand_overs()), "fault": faults[0] if faults else None,
        "drawn": (every.time_s[::DRAWN_EVERY] - item.on_s, every.column("plant.speed_rpm")[::DRAWN_EVERY])}


def back_after(speed: np.ndarray, reference: float, percent: float, period_s: float) -> float | None:
    """How long after a step the speed stays within so many per cent of its reference; None if it is outside at the end."""
    outside = np.flatnonzero(np.abs(speed - reference) > percent / 100.0 * reference)
    if not len(outside):
        return 0.0
    return None if outside[-1] == len(speed) - 1 else float((outside[-1] + 1) * period_s)


def row_of(item: Case, result: dict[str, Any]) -> dict[str, Any]:
    """A row of the printed table: what was asked for, what was measured, and what is out of reach."""
    need = reach.least(item.job.values, item.rpm, item.torque_nm, item.current_max_a)
    row = {"name": f"{item.rpm:.0f} rpm, {item.torque_nm:.3g} N m", "reference_rpm": item.rpm, "torque_nm": item.torque_nm,
           "kphi": item.kphi, **result, "unloaded": f"{result['unloaded_min_rpm']:.0f} .. {result['unloaded_max_rpm']:.0f}",
           "need_voltage_v": need.voltage_v, "need_current_a": need.current_a,
           "beyond": reach.out_of_reach(need, item.current_max_a, result["voltage_limit_v"]),
           "too_quick": reach.too_quick(reach.stops_s(item.job.values, item.rpm, item.torque_nm), item.answer_s)}
    return row | {"verdict": verdict(item.table, row)}


def verdict(table: Table, row: dict[str, Any]) -> str:
    """"ok", what is out of reach, or the first thing that does not hold."""
    wander = max(abs(row[key] / row["ramped_rpm"] - 1.0) * 100.0 for key in ("unloaded_min_rpm", "unloaded_max_rpm"))
    dip_limit = table.dip_limit(row)
    if row["fault"] or not row["closed"]:
        return f"fault {row['fault']}" if row["fault"] else "never in closed loop"
    backwards = row["lowest_rpm"] < BACKWARDS_RPM
    if backwards and not row["too_quick"]:
        return f"backwards, {row['lowest_rpm']:.0f} rpm"
    for edge, key in (("on", "on_back_s"), ("off", "off_back_s")):
        back_s = row[key]
        if not (row["beyond"] and edge == "on") and (back_s is None or back_s > table.back_s):
            return f"step {edge}: not back in {table.back_s:g} s"
    if row["reference_rpm"] in table.unloaded_rpm and wander > table.unloaded_percent:
        return f"wanders by {wander:.1f} % without load"
    if dip_limit is not None and row["dip_percent"] > dip_limit:
        return f"dip above {dip_limit:g} %"
    return reach.BEYOND if row["beyond"] or backwards else "ok"


def text(rows: list[dict[str, Any]]) -> str:
    """The table as printed, and by which numbers a load is out of reach."""
    lines = [f"{row['name']}, Kphi x{row['kphi']:g}: {row['beyond'] or row['too_quick']}" for row in rows if row["verdict"] == reach.BEYOND]
    return "\n".join([report.table(rows, COLUMNS)] + ["", f"{reach.BEYOND}, friction included:", *lines] * bool(lines))


def check(table: Table, row: dict[str, Any]) -> Outcome:
    """One row: its verdict with the numbers."""
    dip_limit, edges = table.dip_limit(row), "after the step off" if row["beyond"] else "on both edges"
    seconds = ["never" if row[key] is None else f"{row[key]:.3f} s" for key in ("on_back_s", "off_back_s")]
    allowed = f"not backwards, no fault, back within {table.back_percent:g} % in {table.back_s:g} s {edges}"
    return Outcome(f"{row['name']}, Kphi x{row['kphi']:g}", row["verdict"] in ("ok", reach.BEYOND),
                   f"{row['verdict']}; dip {row['dip_percent']:.1f} %, back after {seconds[0]} and {seconds[1]}",
                   allowed + (f", dip {dip_limit:g} %" if dip_limit is not None else "")
                   + (f", unloaded {table.unloaded_percent:g} %" if row["reference_rpm"] in table.unloaded_rpm else ""))
