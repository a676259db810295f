"""`starts`: the motor started from every rotor angle under several loads, with heavier rotors, and under load with R, L and Kphi that the
header does not know; or drawn starts, where more is off. Limits are in tools/bench/scenarios/tables/starts.toml.

Loads, speed and times of the table are for its own motor; another one gets shares of its start torque and rated speed, and the time that
its header's lock and ramp take.
"""

import argparse
import itertools
import math
import random
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import motor_file
from tools.common.board_keys import Values
from tools.common.errors import UserError
from . import case, reach, report, simulate, sweep
from .drawn_sweep import DrawnSweep
from .expect import Outcome
from .robust import PARAMETERS
from .scenario import BRAKE, START_MARGIN_S, param, start_time_s
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
    box_resistance: list[float] = within(0.1, 10.0)
    box_inductance: list[float] = within(0.1, 10.0)
    box_kphi: list[float] = within(0.1, 10.0)
    box_angles: float = within(1.0, 360.0)
    box_starts: float = within(0.0, 360.0)
    box_load: float = within(0.0, 1.0)
    box_overshoot_percent: float = within(0.0)
    draw_resistance: float = within(0.0, 0.9)
    draw_inductance: float = within(0.0, 0.9)
    draw_kphi: float = within(0.0, 0.9)
    draw_supply: float = within(0.0, 0.9)
    draw_dead_time: float = within(0.0, 0.9)
    draw_inertia: list[float] = within(0.1, 100.0)
    draw_offset_v: float = within(0.0, 1.0)

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

    def box(self, full: bool) -> list["Case"]:
        """Every combination of R, L and Kphi, under load: from all of the angles, or so many of them in turn."""
        angles = [360.0 * number / int(self.box_angles) for number in range(int(self.box_angles))]
        each, load_nm, result = len(angles) if full else int(self.box_starts), case.three_digits(self.box_load * max(self.loads_nm)), []
        for factors in itertools.product(self.box_resistance, self.box_inductance, self.box_kphi):
            first = len(result)
            result += [Case(load_nm, 1.0, angles[(first + number) % len(angles)], *factors, box=True) for number in range(each)]
        return result

    def drawn(self, seed: int, number: int, dead_s: float) -> "Case":
        """The start with this number: always the same."""
        r = random.Random(f"starts/{seed}/{number}")
        factors = [1.0 + r.uniform(-part, part) for part in (self.draw_resistance, self.draw_inductance, self.draw_kphi)]
        low, high = self.draw_inertia
        later_s = r.uniform(-self.draw_dead_time, self.draw_dead_time) * dead_s
        keys = {"supply.voltage_v": ("factor", 1.0 + r.uniform(-self.draw_supply, self.draw_supply)),
                "inverter.turn_on_s": 1e-7 + max(later_s, 0.0), "inverter.turn_off_s": 1.5e-7 + max(-later_s, 0.0),
                **{f"shunt.offset_{phase}_v": r.uniform(-self.draw_offset_v, self.draw_offset_v) for phase in "ab"},
                "rng.seed": float(r.randrange(1, 2**31))}
        load_nm = case.three_digits(r.uniform(0.0, self.box_load * max(self.loads_nm)))
        return Case(load_nm, low * (high / low) ** r.random(), r.uniform(0.0, 360.0), *factors, number=number, keys=tuple(keys.items()))


@dataclass(frozen=True)
class Case:
    """One start."""

    load_nm: float
    inertia: float
    """of the rotor's"""
    rotor_deg: float
    R: float = 1.0
    L: float = 1.0
    Kphi: float = 1.0
    """true value / the header's, as the two before"""
    box: bool = False
    number: int = 0
    """of the draw"""
    keys: tuple[tuple[str, Any], ...] = ()
    """what else the plant has otherwise"""

    @property
    def is_heavy(self) -> bool:
        return self.inertia > 1.0

    @property
    def is_off(self) -> bool:
        """Whether the motor may be another one than the header's."""
        return self.box or self.number > 0

    @property
    def kind(self) -> str:
        if self.number:
            return f"draw {self.number}: {self.load_nm:g} N m, R x{self.R:.2f}, L x{self.L:.2f}, Kphi x{self.Kphi:.2f}, inertia x{self.inertia:.2f}"
        if self.is_off:
            return f"{self.load_nm:g} N m, R x{self.R:g}, L x{self.L:g}, Kphi x{self.Kphi:g}"
        return f"inertia x{self.inertia:g}" if self.is_heavy else f"{self.load_nm:g} N m"


class Starts(DrawnSweep):
    """The sweep."""

    name, about, kind_of_table = "starts", "start from every rotor angle under several loads", Table
    keys = ("load_nm", "inertia", "rotor_deg", "R", "L", "Kphi", "number", "closed_after_s", "hand_over_rpm", "back_rpm", "overshoot_percent",
            "speed_error_percent", "angle_error_rms_deg", "beyond", "fault")
    what, all_of_it = "start", "every combination of R, L and Kphi from every angle"

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
        """Those of the table with its box; or else the drawn ones."""
        table = self.table
        if self.numbers:
            return [table.drawn(self.seed, number, param(self.params, "DEADTIME_SEC")) for number in self.numbers]
        return table.cases() + table.box(self.full)

    def job(self, item: Case) -> simulate.Job:
        table = self.table
        events = case.start_events(table.start_s, table.speed_rpm, self.params.get("NOMINAL_SPEED_RPM", 0.0), table.where)
        plant = Values({BRAKE: item.load_nm, INERTIA: ("factor", item.inertia), **dict(item.keys)})
        for keys, factor in zip(PARAMETERS.values(), (item.R, item.L, item.Kphi)):
            plant.values.update(dict.fromkeys(keys, ("factor", factor)) if factor != 1.0 else {})
        plant.where.update(dict.fromkeys(plant.values, table.where))
        later_s = table.heavy_later_s if item.is_heavy else 0.0
        scenario = case.scenario(f"{item.rotor_deg:g} deg, {item.kind}", table.title, events, table.speed_rpm, table.measure_from_s + later_s,
                                 table.measure_to_s + later_s, rotor_deg=item.rotor_deg, plant=plant)
        return simulate.prepare(scenario, self.library, self.motor, self.board)

    def row(self, item: Case, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        beyond = self.beyond(item, job.values) if item.is_off else ""
        return {**asdict(item), "keys": None, "kind": item.kind, "is_off": item.is_off, "beyond": beyond, **result}

    def beyond(self, item: Case, values: Mapping[str, float]) -> str:
        """Which limit forbids the start of this motor with this header, with its numbers; "" if none does."""
        params = self.params
        ramp_s = start_time_s(params) - START_MARGIN_S - param(params, "LOCK_TIME") * param(params, "LOOPTIME_SEC")
        end_w = param(params, "END_SPEED_RPM") * math.pi / 30.0
        friction_nm = values.get("mech.coulomb_nm", 0.0) + values.get("mech.viscous_nms", 0.0) * end_w
        needs_nm = item.load_nm + friction_nm + values[INERTIA] * end_w / ramp_s
        gives_nm = reach.torque_per_amp(values) * param(params, "Q_CURRENT_REF_OPENLOOP")
        if needs_nm > gives_nm:
            return f"the start's current gives {gives_nm:.3g} N m, load, friction and ramp need {needs_nm:.3g}"
        most_a = param(params, "MAXIMUM_CURRENT_A")
        need = reach.least(values, self.table.speed_rpm, item.load_nm, most_a)
        return reach.out_of_reach(need, most_a, values["supply.voltage_v"] / math.sqrt(3.0))

    def check(self, item: Case, row: dict[str, Any]) -> list[Outcome]:
        """One start against the limits; the first that does not hold is named. What a limit forbids is told as that."""
        ok, got, allowed = self.first_limit(row)
        return [Outcome(f"start from {row['rotor_deg']:.4g} deg with {row['kind']}", ok or bool(row["beyond"]),
                        f"{got}, {reach.BEYOND}: {row['beyond']}" if row["beyond"] and not ok else got, allowed)]

    def first_limit(self, row: dict[str, Any]) -> tuple[bool, str, str]:
        """Whether it holds, what was found, and what is allowed: of the first limit that does not hold, else of the last."""
        table, heavy = self.table, row["inertia"] > 1.0 and not row["is_off"]
        closed, over, error = row["closed_after_s"], row["overshoot_percent"], row["speed_error_percent"]
        if row["back_rpm"] > table.back_rpm:
            return False, f"{row['back_rpm']:.0f} rpm against the direction", f"at most {table.back_rpm:g} rpm"
        if row["fault"]:
            named = "START_FAILED" if row["inertia"] >= table.may_fail_from else ""
            return row["fault"] == named, f"fault {row['fault']}", f"no fault but {named}" if named else "no fault"
        if closed is None or closed > table.within_s:
            return False, "never in closed loop" if closed is None else f"closed loop after {closed:.3f} s", f"at most {table.within_s:g} s"
        most = table.heavy_overshoot_percent if heavy else table.box_overshoot_percent if row["is_off"] else table.overshoot_percent
        if over > most:
            return False, f"overshoot {over:.1f} %", f"at most {most:g} %"
        if not heavy and not row["is_off"] and row["hand_over_rpm"] > table.hand_over_rpm:
            return False, f"hand-over at {row['hand_over_rpm']:.0f} rpm", f"at most {table.hand_over_rpm:g} rpm"
        allowed = table.heavy_error_percent if heavy else table.error_percent
        return abs(error) <= allowed, f"speed error {error:+.2f} %", f"at most {allowed:g} %"

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        from . import plots
        plain = [row for row in rows if not row["is_off"]]
        return {"plots": plots.write_starts(plain, folder)} if plain else {}

    def title(self, rows: list[dict[str, Any]]) -> str:
        return f"{self.table.title}: {len(rows)} starts"

    def text(self, rows: list[dict[str, Any]]) -> str:
        """The table's starts; then of the others how many hold, and what is out of reach."""
        plain, off = ([row for row in rows if row["is_off"] == whether] for whether in (False, True))
        parts = [self.plain_text(plain)] if plain else []
        drawn, box = [row for row in off if row["number"]], [row for row in off if not row["number"]]
        if box:
            parts.append(self.box_text(box))
        if drawn:
            parts.append(f"{sum(self.first_limit(row)[0] for row in drawn)} of {len(drawn)} drawn starts hold, seed {self.seed}")
        forbidden = [row for row in off if row["beyond"] and not self.first_limit(row)[0]]
        beyond = dict.fromkeys(f"{reach.BEYOND}: {row['kind']}: {row['beyond']}" for row in forbidden)
        return "\n\n".join(parts + ["\n".join(beyond)] * bool(beyond))

    def box_text(self, rows: list[dict[str, Any]]) -> str:
        """Kphi down, R across: how many starts hold, of every L and angle."""
        table = self.table

        def cell(kphi: float, r: float) -> str:
            holds = [self.first_limit(row)[0] for row in rows if (row["Kphi"], row["R"]) == (kphi, r)]
            return f"{sum(holds)} of {len(holds)}"
        lines = [{"name": f"true Kphi x{kphi:g}", **{r: cell(kphi, r) for r in table.box_resistance}} for kphi in table.box_kphi]
        columns = tuple((r, f"true R\nx{r:g}", "{}") for r in table.box_resistance)
        inductances = " ".join(f"x{factor:g}" for factor in table.box_inductance)
        return (f"starts under {rows[0]['load_nm']:g} N m that hold, true value / the header's, L {inductances}:\n\n" + report.table(lines, columns))

    def plain_text(self, rows: list[dict[str, Any]]) -> str:
        """Angles down, loads and inertias across; each cell: seconds to closed loop, its speed, the worst speed backwards, overshoot, speed error."""
        cells = {(row["kind"], row["rotor_deg"]): _cell(row) for row in rows}
        kinds = list(dict.fromkeys(row["kind"] for row in rows))
        angles = sorted({row["rotor_deg"] for row in rows})
        width = max(map(len, cells.values()))
        width = max(width, 14)
        lines = ["rotor deg  " + "  ".join(kind.center(width) for kind in kinds)]
        lines += [f"{angle:9g}  " + "  ".join(cells[kind, angle].rjust(width) for kind in kinds) for angle in angles]
        lines += ["", "each cell: closed loop after S2 and at what speed, highest speed backwards before, rpm; overshoot and speed error at the end, %"]
        return "\n".join(lines + self.failed_text(rows))

    def failed_text(self, rows: list[dict[str, Any]]) -> list[str]:
        """How many of each kind end in a fault: some count as holding, for so much inertia may fail to start."""
        lines = []
        for kind, some in ((kind, [row for row in rows if row["kind"] == kind]) for kind in dict.fromkeys(row["kind"] for row in rows)):
            failed = [row for row in some if row["fault"]]
            allowed = [row for row in failed if self.first_limit(row)[0]]
            if failed:
                lines.append(f"{kind}: {len(failed)} of {len(some)} starts end in a fault" + (
                    f", {len(allowed)} of them in START_FAILED, which is allowed from {self.table.may_fail_from:g} times the inertia on: the header is made for less, "
                    "give the motor file its [load] inertia" if allowed else ""))
        return ["", *lines] if lines else []


def _cell(row: dict[str, Any]) -> str:
    if row["fault"]:
        return row["fault"]
    if row["closed_after_s"] is None:
        return "never closed"
    return (f"{row['closed_after_s']:.2f} s {row['hand_over_rpm']:4.0f} {-row['back_rpm']:4.0f} {row['overshoot_percent']:5.1f} "
            f"{row['speed_error_percent']:+5.2f}")
