"""`loadsteps`: the brake closes and opens at once; how far the speed dips and rises, and how soon it is back. What is asked and what must
hold is in tools/bench/scenarios/tables/loadsteps.toml."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import motor_file
from tools.common.board_keys import Values
from tools.common.trace import wrapped_deg
from . import case, picture, reach, simulate, sweep
from .expect import Outcome
from .metrics import limited_percent
from .run import Run
from .scenario import BRAKE, Event, param
from .sweep import within

BACKWARDS_RPM = 0.0
DRAWN_EVERY = 10
"""Periods."""


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/loadsteps.toml."""

    dip_rpm_where: str
    speeds_rpm: list[float] = within(1.0)
    torques_nm: list[float] = within(0.0)
    kphi_factors: list[float] = within(0.1, 10.0)
    current_percent: float = within(1.0, 100.0)
    start_s: float = within(0.01, 60.0)
    settle_s: float = within(0.01, 60.0)
    unloaded_s: float = within(0.01, 60.0)
    hold_s: float = within(0.01, 60.0)
    back_percent: float = within(0.01, 100.0)
    back_s: float = within(0.001, 60.0)
    dip_rpm: list[float] = within(0.0)
    dip_nm: list[float] = within(0.0)
    dip_percent: list[float] = within(0.0, 100.0)
    unloaded_rpm: list[float] = within(0.0)
    unloaded_percent: float = within(0.0, 100.0)

    def __post_init__(self) -> None:
        self.same_lengths("dip_rpm", "dip_nm", "dip_percent")

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own: shares of its rating, no limits but the common ones, and more time where the speed loop is slow."""
        speeds, torques = case.shares(self.motor, motor, self.speeds_rpm, self.torques_nm)
        back_s = max(self.back_s, math.log(100.0 / self.back_percent) / (2.0 * math.pi * param(params, "SPEED_BANDWIDTH_HZ"))) # a dip of all the speed
        longer = back_s / self.back_s
        return replace(self, motor=motor.name, back_s=back_s, settle_s=longer * self.settle_s, unloaded_s=longer * self.unloaded_s, hold_s=longer * self.hold_s,
                       speeds_rpm=[case.within_header(params, rpm) for rpm in speeds], torques_nm=torques,
                       dip_rpm=[], dip_nm=[], dip_percent=[], unloaded_rpm=[])

    def dip_limit(self, row: Mapping[str, Any]) -> float | None:
        """How far the speed may fall in this row, in per cent; None where that is not limited."""
        limits = {(rpm, torque): percent for rpm, torque, percent in zip(self.dip_rpm, self.dip_nm, self.dip_percent)}
        return limits.get((row["reference_rpm"], row["torque_nm"])) if row["kphi"] == 1.0 else None


@dataclass(frozen=True)
class Case:
    """One row: a step on and off again."""

    rpm: float
    torque_nm: float
    kphi: float

    @property
    def name(self) -> str:
        return f"{self.rpm:g} rpm, {self.torque_nm:g} N m, Kphi x{self.kphi:g}"


class LoadSteps(sweep.Sweep):
    """The sweep."""

    name, about, kind_of_table = "loadsteps", "the brake closes and opens at once: dips, and how soon the speed is back", Table
    columns = (
        ("kphi", "true Kphi\nfactor", "{:.1f}"), ("unloaded", "unloaded\nrpm", "{}"), ("lowest_rpm", "lowest\nrpm", "{:.0f}"),
        ("dip_percent", "dip\n%", "{:.1f}"), ("on_back_s", "back\nafter s", "{:.3f}"), ("highest_rpm", "highest\nrpm", "{:.0f}"),
        ("off_back_s", "back\nafter s", "{:.3f}"), ("angle_error_max_deg", "angle err\nmax deg", "{:.1f}"), ("verdict", "\nverdict", "{}"))
    keys = ("reference_rpm", "torque_nm", "kphi", "unloaded_min_rpm", "unloaded_max_rpm", "lowest_rpm", "dip_percent", "on_back_s",
            "highest_rpm", "rise_percent", "off_back_s", "angle_error_max_deg", "need_voltage_v", "voltage_limit_v", "need_current_a", "beyond",
            "too_quick", "fault", "verdict")

    @property
    def current_max_a(self) -> float:
        return param(self.params, "MAXIMUM_CURRENT_A")

    def cases(self) -> list[Case]:
        """All of the torques less where the current does not give the largest, so that they stay as many."""
        table, result = self.table, []
        for rpm, torque_nm, kphi in itertools.product(table.speeds_rpm, table.torques_nm, table.kphi_factors):
            most_nm = table.current_percent / 100.0 * self.current_max_a * kphi * reach.torque_per_amp(self.motor.values.values)
            if max(table.torques_nm) > most_nm:
                torque_nm = case.three_digits(torque_nm * most_nm / max(table.torques_nm))
            result.append(Case(rpm, torque_nm, kphi))
        return result

    def job(self, item: Case) -> simulate.Job:
        """Its measure begins at the step on."""
        table, where = self.table, self.table.where
        events, settled_s = case.loaded_run(self.params, item.rpm, table, item.name)
        on_s = settled_s + table.unloaded_s
        off_s = on_s + table.hold_s
        events += [Event(on_s, "set", where, keys={BRAKE: item.torque_nm}), Event(off_s, "set", where, keys={BRAKE: 0.0})]
        scenario = case.scenario(item.name, table.title, events, item.rpm, on_s, off_s + table.hold_s)
        return simulate.prepare(scenario, self.library, self.motor, self.board, Values({"motor.psi_vs": ("factor", item.kphi)}, {"motor.psi_vs": where}))

    def measured(self, run: Run, item: Case) -> dict[str, Any]:
        table, trace, end_s, on_s = self.table, run.trace, run.scenario.duration_s, run.scenario.measures[0].from_s
        off_s = on_s + table.hold_s
        before, on, off, both = (trace.part(*span) for span in ((on_s - table.unloaded_s, on_s), (on_s, off_s), (off_s, end_s), (on_s, end_s)))
        speeds = [part.column("plant.speed_rpm").astype(np.float64) for part in (before, on, off, both)]
        reference = float(before.column("fw.speed_ref_rpm").astype(np.float64).mean()) or item.rpm
        faults = run.raised()
        error = wrapped_deg(both.column("fw.theta_est_deg").astype(np.float64) - both.column("plant.theta_e_deg"))
        loaded = trace.part(off_s - 0.2 * table.hold_s, off_s)
        every = trace.part(on_s - 0.1 * table.hold_s, end_s)
        return {
            "picture": picture.of(run, picture.SWEEP_STRETCHES), "limited_percent": limited_percent(loaded),
            "ramped_rpm": reference, "unloaded_min_rpm": float(speeds[0].min()), "unloaded_max_rpm": float(speeds[0].max()),
            "lowest_rpm": float(speeds[3].min()), "highest_rpm": float(speeds[2].max()),
            "dip_percent": 100.0 * (1.0 - float(speeds[3].min()) / reference),
            "rise_percent": 100.0 * (float(speeds[2].max()) / reference - 1.0),
            "on_back_s": back_after(speeds[1], reference, table.back_percent, trace.period_s),
            "off_back_s": back_after(speeds[2], reference, table.back_percent, trace.period_s),
            "angle_error_max_deg": float(np.max(np.abs(error))), "voltage_limit_v": float(loaded.column("fw.v_limit_v").mean()),
            "closed": bool(run.hand_overs()), "fault": faults[0][2] if faults else None,
            "drawn": (every.time_s[::DRAWN_EVERY] - on_s, every.column("plant.speed_rpm")[::DRAWN_EVERY])}

    def row(self, item: Case, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        """What was asked for, what was measured, and what is out of reach."""
        need = reach.least(job.values, item.rpm, item.torque_nm, self.current_max_a)
        return {"name": f"{item.rpm:.0f} rpm, {item.torque_nm:.3g} N m", "reference_rpm": item.rpm, "torque_nm": item.torque_nm,
                "kphi": item.kphi, **result, "unloaded": f"{result['unloaded_min_rpm']:.0f} .. {result['unloaded_max_rpm']:.0f}",
                "need_voltage_v": need.voltage_v, "need_current_a": need.current_a,
                "beyond": reach.out_of_reach(need, self.current_max_a, result["voltage_limit_v"]),
                "too_quick": reach.too_quick(reach.stops_s(job.values, item.rpm, item.torque_nm), reach.answer_s(self.params))}

    def verdict(self, item: Case, row: dict[str, Any]) -> str:
        """What is out of reach is told as that."""
        table = self.table
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
                return f"step {edge}: not back in {table.back_s:.3g} s"
        if row["reference_rpm"] in table.unloaded_rpm and wander > table.unloaded_percent:
            return f"wanders by {wander:.1f} % without load"
        if dip_limit is not None and row["dip_percent"] > dip_limit:
            return f"dip above {dip_limit:g} %"
        return reach.BEYOND if row["beyond"] or backwards else "ok"

    def check(self, item: Case, row: dict[str, Any]) -> list[Outcome]:
        table, dip_limit = self.table, self.table.dip_limit(row)
        seconds = ["never" if row[key] is None else f"{row[key]:.3f} s" for key in ("on_back_s", "off_back_s")]
        edges = "after the step off" if row["beyond"] else "on both edges"
        allowed = f"not backwards, no fault, back within {table.back_percent:g} % in {table.back_s:.3g} s {edges}"
        return [Outcome(f"{row['name']}, Kphi x{row['kphi']:g}", row["verdict"] in ("ok", reach.BEYOND),
                        f"{row['verdict']}; dip {row['dip_percent']:.1f} %, back after {seconds[0]} and {seconds[1]}",
                        allowed + (f", dip {dip_limit:g} %" if dip_limit is not None else "")
                        + (f", unloaded {table.unloaded_percent:g} %" if row["reference_rpm"] in table.unloaded_rpm else ""))]

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        from . import plots
        return {"plots": plots.write_loadsteps(rows, [row.pop("drawn") for row in rows], self.table.hold_s, folder)}

    def title(self, rows: list[dict[str, Any]]) -> str:
        return f"{self.table.title}: {len(rows)} rows"

    def text(self, rows: list[dict[str, Any]]) -> str:
        """And by which numbers a load is out of reach, or a reason for what does not hold."""
        beyond, others = ([f"{row['name']}, Kphi x{row['kphi']:g}: {row['beyond'] or row['too_quick']}" for row in rows
                           if row["verdict"] != "ok" and (row["verdict"] == reach.BEYOND) == whether and (row["beyond"] or row["too_quick"])] for whether in (True, False))
        return "\n".join([super().text(rows)] + ["", f"{reach.BEYOND}, friction included:", *beyond] * bool(beyond)
                         + ["", "why others do not hold, friction included:", *others] * bool(others))


def back_after(speed: np.ndarray, reference: float, percent: float, period_s: float) -> float | None:
    """How long after a step the speed stays within so many per cent of its reference; None if it is outside at the end."""
    outside = np.flatnonzero(np.abs(speed - reference) > percent / 100.0 * reference)
    if not len(outside):
        return 0.0
    return None if outside[-1] == len(speed) - 1 else float((outside[-1] + 1) * period_s)
