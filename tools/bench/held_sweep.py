"""`held`: the shaft is held and let go; or drawn holds, with a motor that the header does not know, by a brake, or twice. What is asked and what must
hold is in tools/bench/scenarios/tables/held.toml."""

import argparse
import itertools
import math
import random
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from tools.common import motor_file
from tools.common.trace import Trace
from tools.common.board_keys import Values
from . import case, picture, reach, report, simulate, sweep
from .drawn_sweep import DrawnSweep
from .expect import Outcome
from .loadsteps import back_after
from .robust import PARAMETERS
from .run import Run
from .scenario import BRAKE, Event, param, start_time_s
from .sweep import within

INERTIA, LOCKED = "mech.inertia_kgm2", "load.locked"
CURRENT_SHARE, VOLTAGE_SHARE = 0.85, 0.85
"""Of what there is: a load that takes more is not asked for."""
TURNING = "CLOSED"
MEAN_S = 0.1
"""The speed is its mean over this time: at a low speed dead time's ripple is more than two per cent."""
BEFORE_S = 0.2
"""Of the reference that the speed must come back to, or of the speed where the drive named a limit: the voltage of a motor off its header."""
WATCH_S = 0.3
"""At least this long the speed must be back."""


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/held.toml."""

    start_s: float = within(0.01, 60.0)
    settle_s: float = within(0.01, 60.0)
    torque_over_s: float = within(0.01, 60.0)
    speeds_percent: list[float] = within(1.0, 1000.0)
    weakened_percent: float = within(0.0, 100.0)
    torque_percent: float = within(0.0, 1000.0)
    inertia_factors: list[float] = within(0.1, 1000.0)
    holds_s: list[float] = within(0.001, 60.0)
    angles: float = within(1.0, 360.0)
    back_rpm: float = within(0.0)
    back_percent: float = within(0.0, 100.0)
    stop_s: float = within(0.0, 60.0)
    near_percent: float = within(0.01, 100.0)
    heavy_percent: float = within(0.01, 100.0)
    after_s: float = within(0.0, 60.0)
    draw_resistance: float = within(0.0, 0.9)
    draw_inductance: float = within(0.0, 0.9)
    draw_kphi: float = within(0.0, 0.9)
    draw_brake: list[float] = within(1.0, 100.0)
    draw_again_s: list[float] = within(0.001, 60.0)

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """All of it is in shares of the rating."""
        return replace(self, motor=motor.name)


@dataclass(frozen=True)
class Case:
    """One row: a hold at a speed."""

    rpm: float
    torque_nm: float
    inertia: float
    hold_s: float
    angle_deg: float
    """electrical, by which the rotor is held later"""
    R: float = 1.0
    L: float = 1.0
    Kphi: float = 1.0
    """true value / the header's, as the two before"""
    brake_nm: float = 0.0
    """of the brake that holds it; 0 = it is blocked"""
    again_s: float = 0.0
    """after the release it is held once more; 0 = never"""
    number: int = 0
    """of the draw"""

    @property
    def until_s(self) -> float:
        """From the hold to the last release."""
        return self.hold_s + (self.again_s + self.hold_s if self.again_s else 0.0)

    @property
    def kind(self) -> str:
        if self.number:
            return f"draw {self.number}: {self.plain}, R x{self.R:.2f}, L x{self.L:.2f}, Kphi x{self.Kphi:.2f}"
        return self.plain

    @property
    def plain(self) -> str:
        return f"{self.rpm:g} rpm{f', {self.torque_nm:g} N m' if self.torque_nm else ''}, inertia x{self.inertia:g}"

    @property
    def name(self) -> str:
        by = f" by {self.brake_nm:.3g} N m" if self.brake_nm else ""
        again = f", and {self.again_s:.3g} s later again" if self.again_s else ""
        return f"{self.kind}, held for {self.hold_s:.3g} s{by} at {self.angle_deg:.3g} deg{again}"


class Held(DrawnSweep):
    """The sweep."""

    name, about, kind_of_table = "held", "the shaft is held and let go: how far backwards, and what follows", Table
    keys = ("reference_rpm", "torque_nm", "inertia", "hold_s", "angle_deg", "R", "L", "Kphi", "brake_nm", "again_s", "number", "backwards_rpm", "afterwards", "back_s", "fault", "fault_s", "current_max_a",
            "bus_max_v", "verdict")
    what, all_of_it = "hold", "every angle of every hold"

    @property
    def rated(self) -> motor_file.Motor:
        return motor_file.load(str(self.motor.path))

    @property
    def most_back_rpm(self) -> float:
        return max(self.table.back_rpm, self.table.back_percent / 100.0 * self.rated.rated_speed_rpm)

    def speeds_rpm(self) -> list[float]:
        """Those of the rating as far as the header has them, and one in field weakening if it has that."""
        nominal, most = (param(self.params, f"{name}_SPEED_RPM") for name in ("NOMINAL", "MAXIMUM"))
        rated_rpm = self.rated.rated_speed_rpm
        speeds = [case.within_header(self.params, case.three_digits(percent / 100.0 * rated_rpm)) for percent in self.table.speeds_percent]
        weakened = [case.three_digits(nominal + self.table.weakened_percent / 100.0 * (most - nominal))] if most > nominal else []
        return list(dict.fromkeys(speeds + weakened))

    def torque_nm(self, rpm: float) -> float:
        """What the motor is loaded with at a speed."""
        most_a, values = CURRENT_SHARE * param(self.params, "MAXIMUM_CURRENT_A"), self.motor.values.values
        most_v = VOLTAGE_SHARE * param(self.params, "NOMINAL_BUS_V") / math.sqrt(3.0)
        for tenths in range(10, 0, -1):
            torque = case.three_digits(tenths / 10.0 * self.table.torque_percent / 100.0 * self.rated.rated_torque_nm)
            if not reach.out_of_reach(reach.least(values, rpm, torque, most_a), most_a, most_v):
                return torque
        return 0.0

    def cases(self) -> list[Case]:
        """Every speed, load, inertia and hold; of the angles all, or one after the other. Or else the drawn ones."""
        if self.numbers:
            return [self.drawn(number) for number in self.numbers]
        table, result = self.table, []
        kinds = [(rpm, torque) for rpm in self.speeds_rpm() for torque in dict.fromkeys((0.0, self.torque_nm(rpm)))]
        angles = [360.0 * number / int(table.angles) for number in range(int(table.angles))]
        for number, ((rpm, torque), inertia, hold_s) in enumerate(itertools.product(kinds, table.inertia_factors, table.holds_s)):
            result += [Case(rpm, torque, inertia, hold_s, angle) for angle in (angles if self.full else [angles[number % len(angles)]])]
        return result

    def drawn(self, number: int) -> Case:
        """The hold with this number: always the same. Speeds, inertias, holds and the time between two are drawn by their ratio."""
        table, r = self.table, random.Random(f"held/{self.seed}/{number}")

        def between(values: list[float]) -> float:
            return min(values) * (max(values) / min(values)) ** r.random()
        rpm = case.three_digits(between(self.speeds_rpm()))
        torque_nm = case.three_digits(self.torque_nm(rpm) * r.choice((0.0, r.random(), 1.0)))
        factors = [1.0 + r.uniform(-part, part) for part in (table.draw_resistance, table.draw_inductance, table.draw_kphi)]
        most_nm = param(self.params, "MAXIMUM_CURRENT_A") * reach.torque_per_amp(self.motor.values.values)
        inertia, hold_s, angle_deg = r.choice((1.0, between(table.inertia_factors))), between(table.holds_s), r.uniform(0.0, 360.0)
        brake_nm, again_s = r.choice((0.0, most_nm * between(table.draw_brake))), r.choice((0.0, between(table.draw_again_s)))
        return Case(rpm, torque_nm, inertia, hold_s, angle_deg, *factors, brake_nm, again_s, number)

    def inertia_kgm2(self, item: Case) -> float:
        return item.inertia * self.motor.values.values[INERTIA]

    def allowed_s(self, item: Case) -> float:
        """How long the rotor may take to be back: the reference's ramp or what the inertia makes of the most current less the load, twice."""
        most_nm = param(self.params, "MAXIMUM_CURRENT_A") * reach.torque_per_amp(self.motor.values.values)
        inertia_s = self.inertia_kgm2(item) * item.rpm * math.pi / 30.0 / max(0.5 * most_nm - item.torque_nm, 0.1 * most_nm)
        ramp_s = item.rpm / param(self.params, "SPEEDREFRAMP_RPM_PER_S")
        return self.table.after_s + start_time_s(self.params) + 2.0 * max(inertia_s, ramp_s)

    def near_percent(self, item: Case) -> float:
        return self.table.heavy_percent if item.inertia > 1.0 else self.table.near_percent

    def job(self, item: Case) -> simulate.Job:
        """A start of the motor alone, the speed, inertia and brake; then the hold, with which the measure begins."""
        table, where = self.table, self.table.where
        events, settled_s = case.loaded_run(self.params, item.rpm, table, item.name)
        held_s = settled_s + table.torque_over_s + table.settle_s + item.angle_deg / (6.0 * item.rpm * param(self.params, "NOPOLESPAIRS"))
        events += [Event(settled_s, "set", where, keys={INERTIA: self.inertia_kgm2(item)}, note=f"inertia x{item.inertia:g}"),
                   Event(settled_s, "set", where, keys={BRAKE: item.torque_nm}, over_s=table.torque_over_s),
                   *self.hold(held_s, item), *(self.hold(held_s + item.hold_s + item.again_s, item) if item.again_s else [])]
        plant = Values({key: ("factor", factor) for keys, factor in zip(PARAMETERS.values(), (item.R, item.L, item.Kphi)) for key in keys if factor != 1.0})
        plant.where.update(dict.fromkeys(plant.values, where))
        end_s = held_s + item.until_s + self.allowed_s(item) + WATCH_S
        return simulate.prepare(case.scenario(item.name, table.title, events, item.rpm, held_s, end_s, plant=plant), self.library, self.motor, self.board)

    def hold(self, at_s: float, item: Case) -> list[Event]:
        """The shaft is blocked, or held by a brake, and let go."""
        key, held, free = (BRAKE, item.brake_nm, item.torque_nm) if item.brake_nm else (LOCKED, 1.0, 0.0)
        return [Event(at_s, "set", self.table.where, keys={key: held}, note="the shaft is held"),
                Event(at_s + item.hold_s, "set", self.table.where, keys={key: free}, note="and let go")]

    def measured(self, run: Run, item: Case) -> dict[str, Any]:
        held_s, end_s = run.scenario.measures[0].from_s, run.scenario.duration_s
        free_s = held_s + item.until_s
        watched, free = run.trace.part(held_s, end_s), run.trace.part(free_s, end_s)
        before = run.trace.part(held_s - BEFORE_S, held_s)
        names = ("fw.speed_ref_rpm", "plant.speed_rpm") if before.column("fw.limits").any() else ("fw.speed_ref_rpm",)
        reference = min(float(before.column(name).astype(np.float64).mean()) for name in names)
        faults = run.raised()
        current = np.hypot(watched.column("plant.i_d").astype(np.float64), watched.column("plant.i_q").astype(np.float64))
        return {"picture": picture.of(run, picture.SWEEP_STRETCHES), "turned": state_at(run, held_s) == TURNING,
                "backwards_rpm": max(0.0, -float(watched.column("plant.speed_rpm").min())),
                "back_s": back_s(free, reference, self.near_percent(item)),
                "fault": faults[0][2] if faults else None, "fault_s": faults[0][1] - free_s if faults else None,
                "current_max_a": float(current.max()), "bus_max_v": float(watched.column("bus.voltage_v").max())}

    def row(self, item: Case, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        row = {"name": item.kind, "reference_rpm": item.rpm, **asdict(item), **result}
        return row | {"afterwards": afterwards(row)}

    def verdict(self, item: Case, row: dict[str, Any]) -> str:
        if not row["turned"]:
            return f"not at the speed: {row['fault'] or 'no closed loop'}"
        if row["backwards_rpm"] > self.most_back_rpm:
            return "backwards"
        if row["fault"]:
            return "late" if row["fault_s"] > self.table.stop_s else "ok"
        return "not back" if row["back_s"] is None or row["back_s"] > self.allowed_s(item) else "ok"

    def check(self, item: Case, row: dict[str, Any]) -> list[Outcome]:
        return [Outcome(item.name, row["verdict"] == "ok", f"{row['verdict']}; {row['backwards_rpm']:.0f} rpm backwards, {row['afterwards']}",
                        f"{self.most_back_rpm:g} rpm backwards, then within {self.near_percent(item):g} % after {self.allowed_s(item):.1f} s, "
                        f"or stopped by name {self.table.stop_s:g} s after the release")]

    def title(self, rows: list[dict[str, Any]]) -> str:
        return f"{self.table.title}: {len(rows)} rows"

    def text(self, rows: list[dict[str, Any]]) -> str:
        """Speeds, loads and inertias down, holds across; of several angles the worst. Of drawn ones how many hold, and what followed."""
        if self.numbers:
            back, stopped = ([row for row in rows if bool(row["fault"]) == fault] for fault in (False, True))
            return (f"{sum(row['verdict'] == 'ok' for row in rows)} of {len(rows)} drawn holds are well, seed {self.seed}: {len(back)} back at the speed, "
                    f"{len(stopped)} stopped by name; at most {max(row['backwards_rpm'] for row in rows):.0f} rpm backwards")
        holds = list(dict.fromkeys(row["hold_s"] for row in rows))
        columns = tuple((hold_s, f"held\n{hold_s:g} s", "{}") for hold_s in holds)
        lines = []
        for name in dict.fromkeys(row["name"] for row in rows):
            own = {hold_s: [row for row in rows if (row["name"], row["hold_s"]) == (name, hold_s)] for hold_s in holds}
            lines.append({"name": name, **{hold_s: cell(max(group, key=lambda row: (row["verdict"] != "ok", row["backwards_rpm"])))
                                           for hold_s, group in own.items()}})
        return report.table(lines, columns) + (
            f"\n\neach cell: the highest speed backwards, rpm (at most {self.most_back_rpm:g}), then the time from the release to the reference, "
            f"or the fault (at most {self.table.stop_s:g} s after it); ! = does not hold")


def cell(row: dict[str, Any]) -> str:
    """A row in short."""
    then = row["fault"] or ("never" if row["back_s"] is None else f"{row['back_s']:.2f}")
    return f"{'!' if row['verdict'] != 'ok' else ''}{row['backwards_rpm']:.0f} {then}"


def back_s(free: Trace, reference: float, percent: float) -> float | None:
    """How long after the release the speed stays near its reference; None if it is not there at the end."""
    rows = max(1, round(MEAN_S / free.period_s))
    sums = np.concatenate(([0.0], np.cumsum(free.column("plant.speed_rpm").astype(np.float64))))
    back = back_after((sums[rows:] - sums[:-rows]) / rows, reference, percent, free.period_s)
    return None if back is None else back + 0.5 * MEAN_S


def state_at(run: Run, at_s: float) -> str:
    """The drive's state just before a moment."""
    return next((name for _, changed_s, name in reversed(run.state_changes()) if changed_s < at_s), "")


def afterwards(row: dict[str, Any]) -> str:
    """What happened after the release."""
    if row["fault"]:
        return f"stopped: {row['fault']} after {row['fault_s']:.2f} s"
    return "never at the reference" if row["back_s"] is None else f"at the reference after {row['back_s']:.2f} s"
