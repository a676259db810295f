"""`catch`: S2 while the rotor turns, and stops on a supply that cannot sink. What is asked and what must hold is in
tools/bench/scenarios/tables/catch.toml."""

import math
import random
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tools.common import motor_file
from tools.common.board_keys import Values
from tools.common.trace import Trace, wrapped_deg
from . import case, picture, report, simulate, sweep
from .expect import Outcome
from .metrics import limited_percent
from .run import Run
from .scenario import Event, param, start_time_s
from .sweep import within

DEBOUNCED_S = 0.028
"""From S2 to the rotor's speed: the button counts a little later, and a light rotor has no time to coast down."""
FORCED, ALIGNED = "RAMP", "ALIGN"
DRIVEN = (FORCED, "CLOSED", "STOPPING")
LOOK_S = 0.02
"""Over which the angle is looked at, up to within_s."""
CHANGES_S = 0.002
"""The current of the loop before takes so long to become that of the forced angle."""
STOP_SETTLE_S, STOP_LONGEST_S = 2.0, 8.0
INERTIA = "mech.inertia_kgm2"
STOP_COLUMNS = (
    ("rpm", "from\nrpm", "{:.0f}"), ("inertia", "inertia\nfactor", "{:g}"), ("stop_s", "stop\ns", "{:.2f}"), ("current_max_a", "current\nmax A", "{:.2f}"),
    ("copper_max_w", "winding\nmax W", "{:.1f}"), ("bus_max_v", "bus\nmax V", "{:.1f}"), ("verdict", "\nverdict", "{}"))


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/catch.toml."""

    stop_s_where: str
    count: float = within(1.0, 10000.0)
    seed: float = within(0.0, 1e9)
    lowest_rpm: float = within(-10000.0, 0.0)
    highest_rpm: float = within(0.0, 10000.0)
    inertia_factors: list[float] = within(1.0, 1000.0)
    speed_rpm: float = within(1.0)
    start_s: float = within(0.06, 60.0)
    within_s: float = within(0.0, 60.0)
    angle_error_deg: float = within(0.0, 180.0)
    pull_deg: float = within(0.0, 180.0)
    standing_rpm: float = within(0.0)
    settle_s: float = within(0.01, 60.0)
    measure_s: float = within(0.01, 60.0)
    error_percent: float = within(0.0, 100.0)
    current_percent: float = within(1.0, 1000.0)
    stop_factors: list[float] = within(1.0, 1000.0)
    stop_bus_v: float = within(1.0)
    stop_s: list[float] = within(0.0)

    def __post_init__(self) -> None:
        self.same_lengths("stop_s", "stop_factors")

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own: shares of its rated speed, as much more time as its winding takes for its heaviest rotor's energy, and
        no limit for the time of a stop."""
        own = motor_file.load(self.motor)
        (lowest, highest, speed), _ = case.shares(self.motor, motor, [self.lowest_rpm, self.highest_rpm, self.speed_rpm], [])
        more_s = self.burn_s(motor, lowest) - self.burn_s(own, self.lowest_rpm)
        return replace(self, motor=motor.name, settle_s=self.settle_s + max(0.0, more_s), lowest_rpm=lowest,
                       highest_rpm=min(highest, param(params, "MAXIMUM_SPEED_RPM")),
                       speed_rpm=case.within_header(params, speed), stop_s=[0.0] * len(self.stop_s))

    def burn_s(self, motor: motor_file.Motor, rpm: float) -> float:
        """How long the most current takes to turn the heaviest rotor's energy into heat of the winding."""
        energy_j = 0.5 * max(self.inertia_factors) * motor.inertia_kgm2 * (rpm * math.pi / 30.0) ** 2
        return energy_j / (1.5 * motor.rs_ohm * motor.maximum_current_a ** 2)

    def draws(self) -> list[tuple[float, float, float]]:
        """Speed, electrical angle and inertia of each row."""
        dice = random.Random(int(self.seed))
        return [(round(dice.uniform(self.lowest_rpm, self.highest_rpm)), round(dice.uniform(0.0, 360.0)),
                 self.inertia_factors[number % len(self.inertia_factors)]) for number in range(int(self.count))]


@dataclass(frozen=True)
class Case:
    """One row: a flying start, or a stop (no angle)."""

    rpm: float
    rotor_deg: float | None
    inertia: float
    stop_s: float = 0.0
    """a stop may take this long; 0: any time"""

    @property
    def is_stop(self) -> bool:
        return self.rotor_deg is None

    @property
    def name(self) -> str:
        return f"{'stop from' if self.is_stop else 'start at'} {self.rpm:.0f} rpm, inertia x{self.inertia:g}"


class Catch(sweep.Sweep):
    """The sweep. The last S2 of a run is the one that counts."""

    name, about, kind_of_table = "catch", "S2 while the rotor turns at any speed, and stops on a supply that cannot sink", Table
    columns = (
        ("rpm", "rotor\nrpm", "{:.0f}"), ("rotor_deg", "angle\ndeg", "{:.0f}"), ("inertia", "inertia\nfactor", "{:g}"), ("how", "taken\nover by", "{}"),
        ("control_s", "after\ns", "{:.3f}"), ("speed_then_rpm", "speed\nthen rpm", "{:.0f}"), ("angle_error_deg", "angle err\nat last deg", "{:.1f}"),
        ("pull_deg", "pull at\nlast deg", "{:.0f}"), ("current_max_a", "current\nmax A", "{:.2f}"), ("bus_max_v", "bus\nmax V", "{:.1f}"),
        ("verdict", "\nverdict", "{}"))
    keys = ("name", "rpm", "rotor_deg", "inertia", "how", "control_s", "speed_then_rpm", "angle_error_deg", "pull_deg", "speed_error_percent",
            "stop_s", "copper_max_w", "current_max_a", "bus_max_v", "fault", "verdict")

    @property
    def most_a(self) -> float:
        return self.table.current_percent / 100.0 * param(self.params, "MAXIMUM_CURRENT_A")

    def bus_v(self, item: Case) -> float:
        """The bus must stay below."""
        return self.table.stop_bus_v * param(self.params, "NOMINAL_BUS_V") / 24.0 if item.is_stop else param(self.params, "OVER_VOLTAGE_V")

    def cases(self) -> list[Case]:
        table, top_rpm = self.table, param(self.params, "MAXIMUM_SPEED_RPM")
        return [Case(*draw) for draw in table.draws()] + [Case(top_rpm, None, *stop) for stop in zip(table.stop_factors, table.stop_s)]

    def job(self, item: Case) -> simulate.Job:
        table, where = self.table, self.table.where
        events, reference_rpm, end_s = self._stop(item) if item.is_stop else self._start(item)
        plant = Values({INERTIA: ("factor", item.inertia), "supply.sinks": 0.0}, {INERTIA: where, "supply.sinks": where})
        scenario = case.scenario(item.name, table.title, events, reference_rpm, end_s - table.measure_s, end_s, plant=plant)
        return simulate.prepare(scenario, self.library, self.motor, self.board)

    def _start(self, item: Case) -> tuple[list[Event], float, float]:
        """A rotor that turns when S2 counts: events, reference, end."""
        table, turned = self.table, {"state.speed_rpm": item.rpm, "state.theta_e_deg": item.rotor_deg}
        events = [Event(0.0, "speed_rpm", table.where, value=table.speed_rpm, finds_range=True), self._press(table.start_s), self._turned(turned)]
        return events, table.speed_rpm, table.start_s + start_time_s(self.params) + table.settle_s

    def _stop(self, item: Case) -> tuple[list[Event], float, float]:
        """An orderly stop from the maximum speed, on a supply that takes nothing back. A rotor that is heavier than the header says turns at S2: how it
        starts from rest is the matter of `make starts`."""
        table, params = self.table, self.params
        heavy = STOP_SETTLE_S * (1.0 + item.inertia / 12.0) # the reference waits for a rotor that the current turns up slowly
        events = case.start_events(table.start_s, item.rpm, param(params, "NOMINAL_SPEED_RPM"), table.where)
        if item.inertia > 1.0:
            events.append(self._turned({"state.speed_rpm": table.speed_rpm}))
        s2_s = table.start_s + start_time_s(params) + case.ramp_time_s(params, item.rpm) + heavy + 1.0
        return [*events, self._press(s2_s)], item.rpm, s2_s + STOP_LONGEST_S

    def _press(self, at_s: float) -> Event:
        return Event(at_s, "press", self.table.where, button="S2", hold_s=0.1)

    def _turned(self, keys: dict[str, float]) -> Event:
        return Event(self.table.start_s + DEBOUNCED_S, "set", self.table.where, keys=keys, note="the rotor turns")

    def measured(self, run: Run, item: Case) -> dict[str, Any]:
        s2_s = run.press_times("S2")[-1]
        trace, faults = run.trace.part(s2_s, run.scenario.duration_s), run.raised()
        current = np.hypot(trace.column("plant.i_d").astype(np.float64), trace.column("plant.i_q").astype(np.float64))
        row = {"name": item.name, "rpm": item.rpm, "rotor_deg": item.rotor_deg, "inertia": item.inertia, "how": None, "control_s": None,
               "speed_then_rpm": None, "angle_error_deg": None, "pull_deg": None, "stop_s": None,
               "speed_error_percent": run.measures[case.MEASURE]["speed_error_percent"],
               "current_max_a": float(current.max()), "bus_max_v": float(trace.column("bus.voltage_v").max()),
               "copper_max_w": None, "fault": faults[0][2] if faults else None,
               "limited_percent": limited_percent(trace), "picture": picture.of(run, picture.SWEEP_STRETCHES)}
        return row | (stopped(trace, run, s2_s) if item.is_stop else taken_over(trace, run, s2_s, self.table.within_s))

    def row(self, item: Case, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        return result | {"copper_max_w": 1.5 * job.values["motor.rs_ohm"] * result["current_max_a"] ** 2}

    def verdict(self, item: Case, row: dict[str, Any]) -> str:
        table = self.table
        if row["fault"]:
            return f"fault {row['fault']}"
        if row["current_max_a"] > self.most_a:
            return f"current {row['current_max_a']:.2f} A"
        if row["bus_max_v"] > self.bus_v(item):
            return f"bus {row['bus_max_v']:.1f} V"
        if item.is_stop:
            if row["stop_s"] is None:
                return "never stopped"
            return "slow" if 0.0 < item.stop_s < row["stop_s"] else "ok"
        if row["control_s"] is None or row["control_s"] > table.within_s:
            return "never in control" if row["control_s"] is None else "late"
        if row["how"] == ALIGNED and abs(row["speed_then_rpm"]) > table.standing_rpm:
            return "aligned while it turned"
        if row["how"] != ALIGNED and ((row["angle_error_deg"] or 0.0) > table.angle_error_deg or (row["pull_deg"] or 0.0) > table.pull_deg):
            return "angle"
        error = row["speed_error_percent"]
        return "ok" if error is not None and abs(error) <= table.error_percent else "speed"

    def check(self, item: Case, row: dict[str, Any]) -> list[Outcome]:
        table, both = self.table, f"{row['current_max_a']:.2f} A, bus {row['bus_max_v']:.1f} V"
        if item.is_stop:
            got = ("never" if row["stop_s"] is None else f"{row['stop_s']:.2f} s") + f", {both}"
            allowed = f"no fault, {self.most_a:.2f} A, bus {self.bus_v(item):g} V" + (f", {item.stop_s:g} s" if item.stop_s else "")
        else:
            angles = ", ".join(f"{text} {row[key]:.1f} deg" for key, text in (("angle_error_deg", "angle error"), ("pull_deg", "pull")) if row[key] is not None)
            got = ("never" if row["control_s"] is None else f"{row['how']} after {row['control_s']:.3f} s, {angles}") + f", {both}"
            allowed = f"no fault, {table.within_s:g} s, {table.angle_error_deg:g} deg, {self.most_a:.2f} A, bus {self.bus_v(item):g} V, " \
                      f"speed {table.error_percent:g} %"
        return [Outcome(item.name, row["verdict"] == "ok", f"{row['verdict']}; {got}", allowed)]

    def text(self, rows: list[dict[str, Any]]) -> str:
        starts, stops = ([row for row in rows if (row["rotor_deg"] is None) == is_stop] for is_stop in (False, True))
        return report.table(starts, self.columns) + "\n\n" + report.table(stops, STOP_COLUMNS)


def taken_over(trace: Trace, run: Run, s2_s: float, within_s: float) -> dict[str, Any]:
    """When the drive has the rotor, in which state and at which speed; and when it must be in control the error of its angle, or on a forced angle
    how far the current pulls ahead of the rotor's flux."""
    state = trace.column("fw.state")
    numbers = {run.state_number(name): name for name in (*DRIVEN, ALIGNED)}
    rows = np.flatnonzero(np.isin(state, list(numbers)))
    if not len(rows):
        return {}
    then = trace.time_s[rows[0]]
    angle = trace.part(s2_s + within_s - LOOK_S, s2_s + within_s)
    error = np.abs(wrapped_deg(angle.column("fw.theta_est_deg").astype(np.float64) - angle.column("plant.theta_e_deg")))
    pull = np.abs(np.degrees(np.arctan2(angle.column("plant.i_q").astype(np.float64), angle.column("plant.i_d"))))
    forced = angle.column("fw.state") == run.state_number(FORCED)
    before = trace.part(s2_s + within_s - LOOK_S - CHANGES_S, s2_s + within_s - CHANGES_S).column("fw.state") == run.state_number(FORCED)
    return {"how": numbers[int(state[rows[0]])], "control_s": float(then - s2_s), "speed_then_rpm": float(trace.column("plant.speed_rpm")[rows[0]]),
            "angle_error_deg": float(error[~forced].mean()) if not forced.all() else None,
            "pull_deg": float(pull[forced & before].max()) if (forced & before).any() else None}


def stopped(trace: Trace, run: Run, s2_s: float) -> dict[str, Any]:
    """How long an orderly stop takes until the outputs are off."""
    off = np.flatnonzero(trace.column("fw.state") == run.state_number("STOPPED"))
    return {"stop_s": float(trace.time_s[off[0]] - s2_s) if len(off) else None}
