"""`pulse`: a load that swings with the shaft's angle. What is asked and what must hold is in tools/bench/scenarios/tables/pulse.toml."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tools.common import motor_file
from tools.common.board_keys import Values
from tools.common.trace import Trace
from . import case, reach, simulate, sweep
from .expect import Outcome
from .metrics import limited_percent
from .run import Run
from .scenario import BRAKE, POT_STEPS, Event, param
from .sweep import within

AMPLITUDE, ORDER, INERTIA = "load.pulse1_nm", "load.pulse1_order", "mech.inertia_kgm2"
RPM = math.pi / 30.0
"""rad/s of 1 rpm."""


@dataclass(kw_only=True)
class Table(sweep.Loaded, sweep.Table):
    """tables/pulse.toml."""

    speeds_rpm: list[float] = within(1.0)
    torques_nm: list[float] = within(0.0)
    inertia_factors: list[float] = within(0.1, 1000.0)
    pulses_per_turn: list[float] = within(1.0, 100.0)
    current_percent: float = within(1.0, 100.0)
    error_percent: float = within(0.0, 100.0)
    bridge_percent: float = within(0.0, 200.0)
    swing_percent: float = within(0.0, 1000.0)
    swing_pulses: float = within(1.0, 100.0)
    swing_inertia: float = within(0.1, 1000.0)
    swing_from_percent: float = within(0.0, 1000.0)

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own: the same shares of its rating, and no speed that its header does not have."""
        speeds, torques = case.shares(self.motor, motor, self.speeds_rpm, self.torques_nm)
        possible = dict.fromkeys(case.within_header(params, rpm) for rpm in speeds)
        return replace(self, motor=motor.name, speeds_rpm=list(possible), torques_nm=torques)


@dataclass(frozen=True)
class Case:
    """One row: a speed under a load of this mean and this amplitude."""

    rpm: float
    torque_nm: float
    inertia: float
    pulses: float

    @property
    def name(self) -> str:
        return f"{self.rpm:g} rpm, {self.torque_nm:g} N m +-100 %, inertia x{self.inertia:g}, {self.pulses:g} a turn"


class Pulse(sweep.Sweep):
    """The sweep."""

    name, about, kind_of_table = "pulse", "a load that pulses with the shaft's angle: mean speed and swing", Table
    columns = (
        ("inertia", "inertia\nfactor", "{:g}"), ("pulses", "pulses\na turn", "{:g}"), ("speed_error_percent", "mean\nerror %", "{:+.2f}"),
        ("lowest_rpm", "lowest\nrpm", "{:.0f}"), ("highest_rpm", "highest\nrpm", "{:.0f}"), ("swing_rpm", "swing\nrpm", "{:.0f}"),
        ("constant_rpm", "at constant\ncurrent", "{:.0f}"), ("swing_share", "share of\nit", "{:.2f}"), ("swing_limit", "allowed\n", "{}"),
        ("current_max_a", "current\nmax A", "{:.2f}"), ("verdict", "\nverdict", "{}"))
    keys = ("reference_rpm", "torque_nm", "inertia", "pulses", "speed_error_percent", "lowest_rpm", "highest_rpm", "swing_rpm", "constant_rpm",
            "swing_share", "swing_limit", "current_max_a", "beyond", "swing_beyond", "fault", "fault_after_s", "verdict")

    @property
    def most_a(self) -> float:
        return param(self.params, "MAXIMUM_CURRENT_A")

    def cases(self) -> list[Case]:
        """All of the torques less where the current does not give the largest one's peak, so that they stay as many."""
        table = self.table
        most_nm = table.current_percent / 100.0 * self.most_a * reach.torque_per_amp(self.motor.values.values)
        share = min(1.0, most_nm / (2.0 * max(table.torques_nm) or 1.0))
        torques = table.torques_nm if share == 1.0 else [case.three_digits(share * torque) for torque in table.torques_nm]
        return [Case(*item) for item in itertools.product(table.speeds_rpm, torques, table.inertia_factors, table.pulses_per_turn)]

    def job(self, item: Case) -> simulate.Job:
        """A start of the motor alone, the speed; then the inertia, and the load as a ramp. Its measure begins when that has settled."""
        table, where = self.table, self.table.where
        events, settled_s = case.loaded_run(self.params, item.rpm, table, item.name)
        inertia = {INERTIA: item.inertia * self.motor.values.values[INERTIA]}
        events += [Event(settled_s, "set", where, keys=inertia, note=f"inertia x{item.inertia:g}"),
                   Event(settled_s, "set", where, keys={BRAKE: item.torque_nm, AMPLITUDE: item.torque_nm}, over_s=table.torque_over_s)]
        from_s = settled_s + table.torque_over_s + table.settle_s
        scenario = case.scenario(item.name, table.title, events, item.rpm, from_s, from_s + table.measure_s,
                                 plant=Values({ORDER: item.pulses}, {ORDER: where}))
        return simulate.prepare(scenario, self.library, self.motor, self.board)

    def measured(self, run: Run, item: Case) -> dict[str, Any]:
        table, measure = self.table, run.scenario.measures[0]
        load_s = measure.from_s - table.settle_s - table.torque_over_s
        before = run.trace.part(load_s - 0.5 * table.settle_s, load_s)
        part = whole_turns(run.trace.part(measure.from_s, measure.to_s))
        speed = part.column("plant.speed_rpm").astype(np.float64)
        faults, result = run.raised(), case.reduced(run)
        lowest, highest, swing = (None,) * 3 if faults else (float(speed.min()), float(speed.max()), float(speed.max() - speed.min()))
        loaded = run.trace.part(load_s, measure.to_s)
        current = np.hypot(loaded.column("plant.i_d").astype(np.float64), loaded.column("plant.i_q").astype(np.float64))
        return {"picture": result["picture"], "closed": bool(run.hand_overs()), "mean_rpm": float(speed.mean()),
                "asked_rpm": float(part.column("fw.speed_ref_rpm").astype(np.float64).mean()),
                "lowest_rpm": lowest, "highest_rpm": highest, "swing_rpm": swing,
                "current_max_a": float(current.max()), "voltage_limit_v": float(before.column("fw.v_limit_v").mean()),
                "limited_percent": limited_percent(part), "fault": faults[0][2] if faults else None,
                "fault_after_s": faults[0][1] - load_s if faults else None}

    def row(self, item: Case, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        """What was asked for, what was measured, and what is out of reach."""
        values = job.values | {INERTIA: item.inertia * self.motor.values.values[INERTIA]}
        constant = constant_current_rpm(values[INERTIA], item.rpm, item.torque_nm, item.pulses)
        reference = self.reference_rpm(item.rpm, result["asked_rpm"])
        row = {"name": f"{item.rpm:g} rpm, {item.torque_nm:g} N m", "reference_rpm": item.rpm, "torque_nm": item.torque_nm, "inertia": item.inertia,
               "pulses": item.pulses, **result, "constant_rpm": constant,
               "swing_share": result["swing_rpm"] / constant if constant and not result["fault"] else None,
               "speed_error_percent": None if result["fault"] else 100.0 * (result["mean_rpm"] / reference - 1.0),
               "beyond": self.beyond(values, item, result["voltage_limit_v"], constant), "swing_beyond": ""}
        if self.swing_counts(item):
            row["swing_beyond"] = row["beyond"] or self.forbids(values, item.rpm, 1.5 * item.torque_nm, result["voltage_limit_v"])
        counts = self.swing_counts(item) and not row["swing_beyond"]
        return row | {"swing_limit": f"{self.table.swing_percent / 100.0:.2f}" if counts else "-"}

    def reference_rpm(self, rpm: float, given_rpm: float) -> float:
        """What the speed is held against: what was asked for, as exactly as the potentiometer gives it."""
        speeds = [param(self.params, f"{name}_SPEED_RPM") for name in ("MINIMUM", "NOMINAL", "MAXIMUM")]
        step_rpm = max(b - a for a, b in itertools.pairwise(speeds)) / POT_STEPS + 1.0 / param(self.params, "NOPOLESPAIRS")
        return given_rpm if abs(given_rpm - rpm) <= step_rpm else rpm

    def forbids(self, values: Mapping[str, float], rpm: float, torque_nm: float, voltage_v: float) -> str:
        """Which limit forbids a torque, with its numbers."""
        return reach.out_of_reach(reach.least(values, rpm, torque_nm, self.most_a), self.most_a, voltage_v or None)

    def beyond(self, values: Mapping[str, float], item: Case, voltage_v: float, constant_rpm: float) -> str:
        """Why the motor cannot carry the load: its mean is beyond a limit, or its peak is and the rotor's energy does not bridge it."""
        mean, peak = (self.forbids(values, item.rpm, torque, voltage_v) for torque in (item.torque_nm, 2.0 * item.torque_nm))
        if mean or not peak:
            return f"mean {mean}" if mean else ""
        bridged = constant_rpm <= self.table.bridge_percent / 100.0 * item.rpm
        return "" if bridged else f"peak {peak}; constant current swings by {constant_rpm:.0f} rpm"

    def swing_counts(self, item: Case) -> bool:
        rated = motor_file.load(str(self.motor.path)).rated_speed_rpm
        same = (item.inertia, item.pulses) == (self.table.swing_inertia, self.table.swing_pulses)
        return same and item.rpm >= self.table.swing_from_percent / 100.0 * rated - 1e-6

    def verdict(self, item: Case, row: dict[str, Any]) -> str:
        """What is out of reach is told as that."""
        if not row["closed"]:
            return f"no start: {row['fault'] or 'never in closed loop'}"
        found = f"fault {row['fault']} after {row['fault_after_s']:.2f} s" if row["fault"] else case.speed_verdict(row, self.table.error_percent)
        if found:
            return reach.BEYOND if row["beyond"] else found
        too_wide = row["swing_share"] is not None and row["swing_share"] > self.table.swing_percent / 100.0
        return "swing" if too_wide and row["swing_limit"] != "-" else "ok"

    def check(self, item: Case, row: dict[str, Any]) -> list[Outcome]:
        table, counts = self.table, row["swing_limit"] != "-"
        error = "" if row["speed_error_percent"] is None else f", mean error {row['speed_error_percent']:+.2f} %"
        swing = "" if row["fault"] else f", swing {row['swing_rpm']:.0f} rpm of {row['constant_rpm']:.0f}"
        return [Outcome(item.name, row["verdict"] in ("ok", reach.BEYOND), row["verdict"] + error + swing,
                        f"no fault, mean error {table.error_percent:g} %"
                        + (f", swing {table.swing_percent:g} % of constant current's" if counts else ""))]

    def title(self, rows: list[dict[str, Any]]) -> str:
        return f"{self.table.title}: {len(rows)} rows"

    def text(self, rows: list[dict[str, Any]]) -> str:
        """And by which numbers a load is out of reach."""
        def lines(key: str) -> list[str]:
            return list(dict.fromkeys(f"{row['name']}, inertia x{row['inertia']:g}: {row[key]}" for row in rows if row[key]))
        beyond, swing = lines("beyond"), [line for line in lines("swing_beyond") if line not in lines("beyond")]
        return "\n".join([super().text(rows), *["", f"{reach.BEYOND}, friction included:", *beyond] * bool(beyond),
                          *["", "half of the swing is out of reach, friction included:", *swing] * bool(swing)])


def constant_current_rpm(inertia_kgm2: float, rpm: float, torque_nm: float, pulses: float) -> float:
    """How far a load of this amplitude makes the speed swing, peak to peak, if the motor's torque is its mean."""
    return 2.0 * torque_nm / (pulses * inertia_kgm2 * rpm * RPM) / RPM


def whole_turns(part: Trace) -> Trace:
    """As much of it from its begin as is whole turns, so that a part of a pulse does not count in the mean; all of it where there is no turn."""
    turns = np.abs(np.cumsum(part.column("plant.speed_rpm").astype(np.float64))) * part.period_s / 60.0 if len(part) else np.zeros(1)
    if turns[-1] < 1.0:
        return part
    last, half_s = int(np.searchsorted(turns, math.floor(turns[-1]))), 0.5 * part.period_s
    return part.part(part.time_s[0] - half_s, part.time_s[last] + half_s)
