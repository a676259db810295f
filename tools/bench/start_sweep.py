"""`starts`: the motor started from every rotor angle under several loads, and with heavier rotors. Limits are in tools/bench/scenarios/tables/starts.toml.

Loads, speed and times of the table are for its own motor; another one gets shares of its start torque and rated speed, and the time that
its header's lock and ramp take.
"""

import argparse
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import motor_file
from tools.common.board_keys import Values
from tools.common.errors import UserError
from . import case, simulate, sweep
from .expect import Outcome
from .scenario import BRAKE, start_time_s
from .sweep import within

MARGIN_S = 0.1
"""For the hand-over itself, beside lock and ramp."""
INERTIA = "mech.inertia_kgm2"
SETTLE_PERIODS = 5.0
"""Of the speed loop's bandwidth, which a heavy load makes small: what the speed gets to settle, at least the table's own time."""


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/starts.toml."""

    every_deg: float = within(1.0, 360.0)
    speed_rpm: float = within(0.0)
    start_s: float = within(0.0)
    within_s: float = within(0.0)
    measure_from_s: float = within(0.0)
    measure_to_s: float = within(0.0)
    error_percent: float = within(0.0)
    overshoot_percent: float = within(0.0)
    loads_nm: list[float] = within(0.0)
    hand_over_rpm: float = within(0.0)
    back_rpm: float = within(0.0)
    heavy_factors: list[float] = within(1.0, 1000.0)
    heavy_overshoot_percent: float = within(0.0)
    heavy_later_s: float = within(0.0)
    heavy_error_percent: float = within(0.0)
    may_fail_from: float = within(1.0)
    other_may_fail_from: float = within(1.0)
    other_loads_percent: list[float] = within(0.0, 100.0)
    other_speed_percent: float = within(1.0, 100.0)

    def __post_init__(self) -> None:
        if not self.start_s + self.within_s < self.measure_from_s < self.measure_to_s:
            raise UserError("the times are not in order", self.where, "start_s + within_s < measure_from_s < measure_to_s")

    def for_motor(self, motor: motor_file.Motor, params: Mapping[str, float]) -> "Table":
        """The table for another motor than its own, with that motor's header."""
        later_s = start_time_s(dict(params)) + MARGIN_S - self.within_s
        slower_s = max(SETTLE_PERIODS / params["SPEED_BANDWIDTH_HZ"] - (self.measure_from_s - self.start_s - self.within_s), 0.0)
        speed_rpm = max(self.other_speed_percent / 100.0 * motor.rated_speed_rpm, params["END_SPEED_RPM"])
        return replace(self, motor=motor.name, speed_rpm=round(speed_rpm), hand_over_rpm=1.2 * params["END_SPEED_RPM"], may_fail_from=self.other_may_fail_from, within_s=self.within_s + later_s,
                       measure_from_s=self.measure_from_s + later_s + slower_s, measure_to_s=self.measure_to_s + later_s + slower_s,
                       loads_nm=[case.three_digits(percent / 100.0 * motor.start_torque_nm) for percent in self.other_loads_percent])

    def cases(self) -> list["Case"]:
        """Every load on the bare rotor, and every heavier rotor without one, from every angle."""
        kinds = [(load, 1.0) for load in self.loads_nm] + [(0.0, factor) for factor in self.heavy_factors]
        return [Case(load, inertia, angle) for load, inertia in kinds for angle in np.arange(0.0, 360.0, self.every_deg).tolist()]


@dataclass(frozen=True)
class Case:
    """One start."""

    load_nm: float
    inertia: float
    """of the rotor's"""
    rotor_deg: float

    @property
    def is_heavy(self) -> bool:
        return self.inertia > 1.0

    @property
    def kind(self) -> str:
        return f"inertia x{self.inertia:g}" if self.is_heavy else f"{self.load_nm:g} N m"


class Starts(sweep.Sweep):
    """The sweep."""

    name, about, kind_of_table = "starts", "start from every rotor angle under several loads", Table
    keys = ("load_nm", "inertia", "rotor_deg", "closed_after_s", "hand_over_rpm", "back_rpm", "overshoot_percent", "speed_error_percent",
            "angle_error_rms_deg", "fault")

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = super().add_command(commands)
        parser.add_argument("--every-deg", type=float, help="step of the rotor's electrical angle; default from tables/starts.toml")
        return parser

    @classmethod
    def read(cls, options: argparse.Namespace) -> Table:
        table = super().read(options)
        if options.every_deg is not None and not 1.0 <= options.every_deg <= 360.0:
            raise UserError(f"every-deg = {options.every_deg:g} is impossible", "--every-deg", "choose 1 .. 360")
        return table if options.every_deg is None else replace(table, every_deg=options.every_deg)

    def cases(self) -> list[Case]:
        return self.table.cases()

    def job(self, item: Case) -> simulate.Job:
        table = self.table
        events = case.start_events(table.start_s, table.speed_rpm, self.params.get("NOMINAL_SPEED_RPM", 0.0), table.where)
        plant = Values({BRAKE: item.load_nm, INERTIA: ("factor", item.inertia)}, {BRAKE: table.where, INERTIA: table.where})
        later_s = table.heavy_later_s if item.is_heavy else 0.0
        scenario = case.scenario(f"{item.rotor_deg:g} deg, {item.kind}", table.title, events, table.speed_rpm, table.measure_from_s + later_s,
                                 table.measure_to_s + later_s, rotor_deg=item.rotor_deg, plant=plant)
        return simulate.prepare(scenario, self.library, self.motor, self.board)

    def row(self, item: Case, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        return {**asdict(item), "kind": item.kind, **result}

    def check(self, item: Case, row: dict[str, Any]) -> list[Outcome]:
        """One start against the limits; the first that does not hold is named."""
        return [Outcome(f"start from {row['rotor_deg']:g} deg with {row['kind']}", *self.first_limit(row))]

    def first_limit(self, row: dict[str, Any]) -> tuple[bool, str, str]:
        """Whether it holds, what was found, and what is allowed: of the first limit that does not hold, else of the last."""
        table, heavy = self.table, row["inertia"] > 1.0
        closed, over, error = row["closed_after_s"], row["overshoot_percent"], row["speed_error_percent"]
        if row["back_rpm"] > table.back_rpm:
            return False, f"{row['back_rpm']:.0f} rpm against the direction", f"at most {table.back_rpm:g} rpm"
        if row["fault"]:
            named = "START_FAILED" if row["inertia"] >= table.may_fail_from else ""
            return row["fault"] == named, f"fault {row['fault']}", f"no fault but {named}" if named else "no fault"
        if closed is None or closed > table.within_s:
            return False, "never in closed loop" if closed is None else f"closed loop after {closed:.3f} s", f"at most {table.within_s:g} s"
        most = table.heavy_overshoot_percent if heavy else table.overshoot_percent
        if over > most:
            return False, f"overshoot {over:.1f} %", f"at most {most:g} %"
        if not heavy and row["hand_over_rpm"] > table.hand_over_rpm:
            return False, f"hand-over at {row['hand_over_rpm']:.0f} rpm", f"at most {table.hand_over_rpm:g} rpm"
        allowed = table.heavy_error_percent if heavy else table.error_percent
        return abs(error) <= allowed, f"speed error {error:+.2f} %", f"at most {allowed:g} %"

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        from . import plots
        return {"plots": plots.write_starts(rows, folder)}

    def title(self, rows: list[dict[str, Any]]) -> str:
        return f"{self.table.title}: {len(rows)} starts"

    def text(self, rows: list[dict[str, Any]]) -> str:
        """Angles down, loads and inertias across; each cell: seconds to closed loop, its speed, the worst speed backwards, overshoot, speed error."""
        cells = {(row["kind"], row["rotor_deg"]): _cell(row) for row in rows}
        kinds = list(dict.fromkeys(row["kind"] for row in rows))
        angles = sorted({row["rotor_deg"] for row in rows})
        width = max(map(len, cells.values()))
        width = max(width, 14)
        lines = ["rotor deg  " + "  ".join(kind.center(width) for kind in kinds)]
        lines += [f"{angle:9g}  " + "  ".join(cells[kind, angle].rjust(width) for kind in kinds) for angle in angles]
        return "\n".join(lines) + "\n\neach cell: closed loop after S2 and at what speed, highest speed backwards before, rpm; overshoot and speed error at the end, %"


def _cell(row: dict[str, Any]) -> str:
    if row["fault"]:
        return row["fault"]
    if row["closed_after_s"] is None:
        return "never closed"
    return (f"{row['closed_after_s']:.2f} s {row['hand_over_rpm']:4.0f} {-row['back_rpm']:4.0f} {row['overshoot_percent']:5.1f} "
            f"{row['speed_error_percent']:+5.2f}")
