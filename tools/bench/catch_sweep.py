"""`catch`: S2 while the rotor turns, and stops on a supply that cannot sink. What is asked and what must hold is in
tools/bench/scenarios/tables/catch.toml."""

import argparse
import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tools.common import motor_file, output, paths
from tools.common.board_keys import Part, Values
from tools.common.errors import UserError
from tools.common.trace import Trace, wrapped_deg
from . import command_common, picture, report, simulate, sweep
from .board import Library
from .expect import Outcome
from .metrics import limited_percent
from .run import Run
from .scenario import Event, param

DEBOUNCED_S = 0.028
"""From S2 to the rotor's speed: the button counts a little later, and a light rotor has no time to coast down."""
FORCED, ALIGNED = "RAMP", "ALIGN"
DRIVEN = (FORCED, "CLOSED", "STOPPING")
LOOK_S = 0.02
CHANGES_S = 0.002
"""The current of the loop before takes so long to become that of the forced angle."""
"""Over which the angle is looked at, up to within_s."""
STOP_SETTLE_S, STOP_LONGEST_S = 2.0, 8.0
INERTIA = "mech.inertia_kgm2"

COLUMNS = (
    ("rpm", "rotor\nrpm", "{:.0f}"), ("rotor_deg", "angle\ndeg", "{:.0f}"), ("inertia", "inertia\nfactor", "{:g}"), ("how", "taken\nover by", "{}"),
    ("control_s", "after\ns", "{:.3f}"), ("speed_then_rpm", "speed\nthen rpm", "{:.0f}"), ("angle_error_deg", "angle err\nat last deg", "{:.1f}"),
    ("pull_deg", "pull at\nlast deg", "{:.0f}"), ("current_max_a", "current\nmax A", "{:.2f}"), ("bus_max_v", "bus\nmax V", "{:.1f}"),
    ("verdict", "\nverdict", "{}"))
STOP_COLUMNS = (
    ("rpm", "from\nrpm", "{:.0f}"), ("inertia", "inertia\nfactor", "{:g}"), ("stop_s", "stop\ns", "{:.2f}"), ("current_max_a", "current\nmax A", "{:.2f}"),
    ("copper_max_w", "winding\nmax W", "{:.1f}"), ("bus_max_v", "bus\nmax V", "{:.1f}"), ("verdict", "\nverdict", "{}"))
KEYS = ("name", "rpm", "rotor_deg", "inertia", "how", "control_s", "speed_then_rpm", "angle_error_deg", "pull_deg", "speed_error_percent",
        "stop_s", "copper_max_w", "current_max_a", "bus_max_v", "fault", "verdict")


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/catch.toml."""

    motor: str
    motor_where: str
    stop_s_where: str
    count: float = sweep.within(1.0, 10000.0)
    seed: float = sweep.within(0.0, 1e9)
    lowest_rpm: float = sweep.within(-10000.0, 0.0)
    highest_rpm: float = sweep.within(0.0, 10000.0)
    inertia_factors: list[float] = sweep.within(1.0, 1000.0)
    speed_rpm: float = sweep.within(1.0)
    start_s: float = sweep.within(0.06, 60.0)
    within_s: float = sweep.within(0.0, 60.0)
    angle_error_deg: float = sweep.within(0.0, 180.0)
    pull_deg: float = sweep.within(0.0, 180.0)
    standing_rpm: float = sweep.within(0.0)
    settle_s: float = sweep.within(0.01, 60.0)
    measure_s: float = sweep.within(0.01, 60.0)
    error_percent: float = sweep.within(0.0, 100.0)
    current_percent: float = sweep.within(1.0, 1000.0)
    stop_factors: list[float] = sweep.within(1.0, 1000.0)
    stop_bus_v: float = sweep.within(1.0)
    stop_s: list[float] = sweep.within(0.0)

    def __post_init__(self) -> None:
        if len(self.stop_s) != len(self.stop_factors):
            raise UserError("columns of different lengths", self.stop_s_where, "give stop_factors and stop_s as many numbers each")

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own: shares of its rated speed, as much more time as its winding takes for its heaviest rotor's energy, and
        no limit for the time of a stop."""
        own = motor_file.load(self.motor)
        (lowest, highest, speed), _ = sweep.shares(self.motor, motor, [self.lowest_rpm, self.highest_rpm, self.speed_rpm], [])
        more_s = self.burn_s(motor, lowest) - self.burn_s(own, self.lowest_rpm)
        return replace(self, motor=motor.name, settle_s=self.settle_s + max(0.0, more_s), lowest_rpm=lowest,
                       highest_rpm=min(highest, param(params, "MAXIMUM_SPEED_RPM")),
                       speed_rpm=sweep.within_header(params, speed), stop_s=[0.0] * len(self.stop_s))

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

    table: Table
    rpm: float
    rotor_deg: float | None
    inertia: float
    most_a: float
    bus_v: float
    """the bus must stay below"""
    stop_s: float
    """a stop may take this long; 0: any time"""
    job: simulate.Job
    s2_s: float

    @property
    def scenario(self) -> Any:
        return self.job.scenario

    @property
    def name(self) -> str:
        what = "stop from" if self.rotor_deg is None else "start at"
        return f"{what} {self.rpm:.0f} rpm, inertia x{self.inertia:g}"


def catch_case(table: Table, rpm: float, rotor_deg: float, inertia: float, library: Library, motor: Part, board: Part) -> Case:
    """A rotor that turns when S2 counts."""
    press = Event(table.start_s, "press", table.where, button="S2", hold_s=0.1)
    turned = Event(table.start_s + DEBOUNCED_S, "set", table.where, keys={"state.speed_rpm": rpm, "state.theta_e_deg": rotor_deg}, note="the rotor turns")
    events = [Event(0.0, "speed_rpm", table.where, value=table.speed_rpm, finds_range=True), press, turned]
    end_s = table.start_s + sweep.start_time_s(library.params) + table.settle_s
    return _case(table, rpm, rotor_deg, inertia, library, motor, board, events, table.speed_rpm, end_s, table.start_s, 0.0)


def stop_case(table: Table, inertia: float, stop_s: float, library: Library, motor: Part, board: Part) -> Case:
    """An orderly stop from the maximum speed, on a supply that takes nothing back. A rotor that is heavier than the header says turns at S2: how it starts
    from rest is the matter of `make starts`."""
    top_rpm = param(library.params, "MAXIMUM_SPEED_RPM")
    heavy = STOP_SETTLE_S * (1.0 + inertia / 12.0) # the reference waits for a rotor that the current turns up slowly
    events = sweep.start_events(table.start_s, top_rpm, param(library.params, "NOMINAL_SPEED_RPM"), table.where)
    if inertia > 1.0:
        events.append(Event(table.start_s + DEBOUNCED_S, "set", table.where, keys={"state.speed_rpm": table.speed_rpm}, note="the rotor turns"))
    s2_s = table.start_s + sweep.start_time_s(library.params) + sweep.ramp_time_s(library.params, top_rpm) + heavy + 1.0
    events.append(Event(s2_s, "press", table.where, button="S2", hold_s=0.1))
    return _case(table, top_rpm, None, inertia, library, motor, board, events, top_rpm, s2_s + STOP_LONGEST_S, s2_s, stop_s)


def _case(table: Table, rpm: float, rotor_deg: float | None, inertia: float, library: Library, motor: Part, board: Part, events: list[Event],
          reference_rpm: float, end_s: float, s2_s: float, stop_s: float) -> Case:
    plant = Values({INERTIA: ("factor", inertia), "supply.sinks": 0.0}, {INERTIA: table.where, "supply.sinks": table.where})
    name = f"{'stop from' if rotor_deg is None else 'start at'} {rpm:.0f} rpm, inertia x{inertia:g}"
    scenario = sweep.scenario(name, table.title, events, reference_rpm, end_s - table.measure_s, end_s, plant=plant)
    job = simulate.prepare(scenario, library, motor, board)
    params = library.params
    bus_v = table.stop_bus_v * param(params, "NOMINAL_BUS_V") / 24.0 if rotor_deg is None else param(params, "OVER_VOLTAGE_V")
    return Case(table, rpm, rotor_deg, inertia, table.current_percent / 100.0 * param(params, "MAXIMUM_CURRENT_A"), bus_v, stop_s, job, s2_s)


def _work(item: Case, progress: Callable[[float], None]) -> dict[str, Any]:
    return measured(item, simulate.simulate(item.job, progress))


def measured(item: Case, run: Run) -> dict[str, Any]:
    """What a row needs of its run."""
    trace = run.trace.part(item.s2_s, run.scenario.duration_s)
    faults = [name for _, _, name in run.fault_changes() if name != run.faults.get(0, "NONE")]
    current = np.hypot(trace.column("plant.i_d").astype(np.float64), trace.column("plant.i_q").astype(np.float64))
    row = {"name": item.name, "rpm": item.rpm, "rotor_deg": item.rotor_deg, "inertia": item.inertia, "how": None, "control_s": None,
           "speed_then_rpm": None, "angle_error_deg": None, "pull_deg": None, "stop_s": None,
           "speed_error_percent": run.measures[sweep.MEASURE]["speed_error_percent"],
           "current_max_a": float(current.max()), "bus_max_v": float(trace.column("bus.voltage_v").max()),
           "copper_max_w": 1.5 * item.job.values["motor.rs_ohm"] * float(current.max()) ** 2, "fault": faults[0] if faults else None,
           "limited_percent": limited_percent(trace), "picture": picture.of(run, picture.SWEEP_STRETCHES)}
    row |= stopped(trace, run, item.s2_s) if item.rotor_deg is None else taken_over(trace, run, item.s2_s, item.table.within_s)
    return row | {"verdict": verdict(item, row)}


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


def verdict(item: Case, row: dict[str, Any]) -> str:
    """"ok", or the first thing that does not hold."""
    table = item.table
    if row["fault"]:
        return f"fault {row['fault']}"
    if row["current_max_a"] > item.most_a:
        return f"current {row['current_max_a']:.2f} A"
    if row["bus_max_v"] > item.bus_v:
        return f"bus {row['bus_max_v']:.1f} V"
    if item.rotor_deg is None:
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


def check(item: Case, row: dict[str, Any]) -> Outcome:
    """One row: its verdict with the numbers."""
    table, verdict_text = item.table, row["verdict"]
    both = f"{row['current_max_a']:.2f} A, bus {row['bus_max_v']:.1f} V"
    if item.rotor_deg is None:
        took = "never" if row["stop_s"] is None else f"{row['stop_s']:.2f} s"
        most = f", {item.stop_s:g} s" if item.stop_s else ""
        return Outcome(item.name, verdict_text == "ok", f"{verdict_text}; {took}, {both}", f"no fault, {item.most_a:.2f} A, bus {item.bus_v:g} V{most}")
    angles = ", ".join(f"{text} {row[key]:.1f} deg" for key, text in (("angle_error_deg", "angle error"), ("pull_deg", "pull")) if row[key] is not None)
    then = "never" if row["control_s"] is None else f"{row['how']} after {row['control_s']:.3f} s, {angles}"
    return Outcome(item.name, verdict_text == "ok", f"{verdict_text}; {then}, {both}",
                   f"no fault, {table.within_s:g} s, {table.angle_error_deg:g} deg, {item.most_a:.2f} A, bus {item.bus_v:g} V, speed {table.error_percent:g} %")


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    table = Table.read(paths.TABLES / "catch.toml")
    motor, board, library, used = command_common.set_up(table, options, [])
    target = command_common.results("catch", table.motor, options)
    if motor.path.stem != table.motor:
        table = table.for_motor(motor_file.load(str(motor.path)), library.params)
    cases = [catch_case(table, *draw, library, motor, board) for draw in table.draws()]
    cases += [stop_case(table, inertia, stop_s, library, motor, board) for inertia, stop_s in zip(table.stop_factors, table.stop_s)]
    with output.ResultFolder(target) as folder:
        rows = sweep.run_cases("catch", cases, options.quiet, _work)
        outcomes = [check(item, row) for item, row in zip(cases, rows)]
        report.write_table(folder.work, "catch", KEYS, rows, outcomes, {"title": table.title, **used}, {})
    starts, stops = ([row for row in rows if (row["rotor_deg"] is None) == is_stop] for is_stop in (False, True))
    print(f"{table.title}\n\n{report.used_text(used)}\n")
    print(report.table(starts, COLUMNS) + "\n\n" + report.table(stops, STOP_COLUMNS))
    print(f"\nresults in {paths.shown(target)}/: index.html")
    return command_common.verdict("catch", outcomes)
