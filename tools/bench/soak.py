"""`soak`: motor hours of random commands, loads, temperatures, sags and noise over all motors, within what each can do. Nothing is broken, so nothing
may trip, drift or lose its lock.

The hours are cut into segments, each drawn by its number. An interrupted soak goes on where it was."""

import argparse
import math
import random
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import board_file, motor_file, paths
from tools.common.board_keys import Values
from tools.common.errors import UserError
from tools.common.trace import wrapped_deg

from . import command_common, draws, injection, judge, page, reach, simulate
from .board import Board
from .held_sweep import Table as HeldTable
from .pulse_sweep import whole_turns
from .run import Run
from .scenario import BRAKE, Event, Scenario, decel_rpm_s, param, start_time_s
from .trial import Bench, coast_s

SEGMENT_S = 40.0
"""Of motor time, about."""
EVERY = 20
"""Periods to a row of the trace."""
SPEED_ERROR = 0.01
"""Of the reference, in a stretch without change; of the rated speed a fifth of it where that is more."""
LOST_LOCK_DEG, LOST_LOCK_S = 60.0, 0.05
REST_S = 0.4
SHARES = (0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0)
"""Of the rated torque: the largest that motor and supply can hold is drawn from."""
SAGS, WARM_R, WARM_PSI, TRUE_L = (0.87, 1.0), (0.7, 1.4), (0.8, 1.2), (0.75, 1.25)
"""What the supply may sag to, and what the true motor may be of its header's: a wrong header, and temperature."""
WARM_PER_S = 0.05
"""By how much winding and magnets change in a second: copper's 0.39 % a K times 13 K. 50 A/mm2 warm a wire so fast, rho j^2 / (c density)."""
HOLD_S, HOLD_TORQUES = (0.01, 0.1), (1.3, 3.0)
"""How long a hand holds the shaft, and how hard: times the most torque that the drive has."""
HELD = HeldTable.read(paths.TABLES / "held.toml")
"""What `make held` asks: how far backwards, and how soon a drive that does not go on has stopped. A rotor that stands shows no angle."""
MIDDLE = 0.05
"""Of the potentiometer's travel on each side: where the middle chooses no direction, and no speed."""
VOLTAGE_SHARE, CURRENT_SHARE = 0.8, 0.8
HIDDEN_SHARE = 0.5
"""Of the back-EMF: what a warm winding's unknown resistance takes of it at most, or no estimator sees the rotor."""
SWING_SHARE = 0.5
"""Of the speed: what a growing load takes of it in an electrical period, before any estimator can have seen it."""
BIDIRECTIONAL = "BIDIRECTIONAL_SPEED"
MODES = ("", "", BIDIRECTIONAL)
"""One of these in a segment."""
MOST_HOURS = 10000.0
WHERE = "soak"
OK, STOPPED = "ok", "stopped by a hand"


@dataclass
class Segment:
    """What happens in one segment, and the stretches in which nothing changes: from, to, reference in rpm."""

    number: int
    motor: str
    mode: str
    scenario: Scenario
    rests: list[tuple[float, float, float]] = field(default_factory=list)
    starts: int = 1
    held: list[tuple[float, float]] = field(default_factory=list)
    """from when a hand holds the shaft until the rotor must be known again"""

    @property
    def holds(self) -> int:
        """How often a hand holds the shaft."""
        return len(self.held)


@dataclass
class Soak(draws.Series):
    """The series: segments of motor hours, on every motor in one direction and in both."""

    name, about = "soak", "motor hours of random commands, loads, temperatures, sags, noise: nothing may trip"
    what, unit, file, told = "segment", "motor hours", "segments.csv", 20
    keys = ("segment", "motor", "mode", "motor_s", "starts", "holds", "stretches", "worst_speed_error_percent", "worst_angle_error_deg", "verdict")

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = super().add_command(commands)
        parser.add_argument("--hours", type=float, default=24.0, help="motor hours, simulated; default 24")
        return parser

    @classmethod
    def prepared(cls, options: argparse.Namespace) -> tuple["Soak", list[Segment]]:
        if not 0.0 < options.hours <= MOST_HOURS:
            raise UserError(f"{options.hours:g} motor hours are impossible", "--hours", f"choose more than 0, at most {MOST_HOURS:g}")
        numbers = cls.numbers(options, "--hours", math.ceil(3600.0 * options.hours / SEGMENT_S))
        benches = prepared(options.motor or paths.names(paths.MOTORS))
        return cls(options.seed, benches), [draw(options.seed, number, benches) for number in numbers]

    def identity(self) -> dict[str, Any]:
        files = [paths.ROOT / "tools" / "bench" / "soak.py", *(self.benches[key].library.path for key in sorted(self.benches))]
        return {"seed": self.seed, "motors": [list(key) for key in sorted(self.benches)], "files": [zlib.crc32(path.read_bytes()) for path in files]}

    def amount(self, item: Segment) -> float:
        return item.scenario.duration_s / 3600.0

    def plans(self, items: list[Segment]) -> list[tuple[Scenario, dict[str, float]]]:
        return [(item.scenario, self.benches[item.motor, item.mode].library.params) for item in items]

    def row(self, item: Segment, tell: draws.Tell) -> dict[str, Any]:
        return self._row(item, run(item, self.benches, lambda seconds: tell(seconds / 3600.0)))

    def _row(self, item: Segment, found: Run) -> dict[str, Any]:
        return row_of(item, found, motor_file.load(str(self.benches[item.motor, item.mode].motor.path)).rated_speed_rpm)

    def alone(self, item: Segment, folder: Path) -> tuple[dict[str, Any], str]:
        bench, found = self.benches[item.motor, item.mode], run(item, self.benches, lambda seconds: None)
        row = self._row(item, found)
        text = f"{draws.reported(found, bench, folder)}\n\nsegment {item.number}, {item.motor}, header of {paths.shown(bench.motor.path)}: {row['verdict']}"
        return {"title": item.scenario.title, "passed": not self.is_bad(row), "row": row}, text

    def curves(self, item: Segment) -> Run:
        return run(item, self.benches, lambda seconds: None)

    def is_bad(self, row: dict[str, Any]) -> bool:
        return row["verdict"] != OK and not row["verdict"].startswith(STOPPED)

    def line(self, row: dict[str, Any]) -> str:
        return f"segment {row['segment']}, {row['motor']}{', ' + row['mode'] if row['mode'] else ''}: {row['verdict']}"

    def text(self, rows: list[dict[str, Any]]) -> str:
        """What was run and what went wrong, by motor."""
        lines = []
        for name in sorted({row["motor"] for row in rows}):
            own = [row for row in rows if row["motor"] == name]
            stopped = sum(row["verdict"].startswith(STOPPED) for row in own)
            lines.append(f"{name:28} {sum(row['motor_s'] for row in own) / 3600.0:8.3f} h {sum(row['starts'] for row in own):6d} starts "
                         f"{sum(row['stretches'] for row in own):6d} stretches, worst speed error {max(row['worst_speed_error_percent'] for row in own):.2f} %, "
                         f"{sum(map(self.is_bad, own))} wrong, {sum(self.is_bad(row) for row in own if row['holds'])} of them with a held shaft, {stopped} {STOPPED}")
        return "\n".join([*lines, self._in_short(rows)])

    def _in_short(self, rows: list[dict[str, Any]]) -> str:
        """How many end well: the last line of the text, the headline of the page."""
        return f"{len(rows) - sum(map(self.is_bad, rows))} of {len(rows)} segments are well"

    def worst(self, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return sorted(rows, key=lambda row: (not self.is_bad(row), 0.0 if self.is_bad(row) else -row["worst_speed_error_percent"]))[:12]

    def page(self, rows: list[dict[str, Any]]) -> tuple[dict[str, Any], page.Page]:
        bad, hours = sum(map(self.is_bad, rows)), sum(row["motor_s"] for row in rows) / 3600.0
        title = f"{hours:.3f} motor hours, seed {self.seed}"
        held = [self.is_bad(row) for row in rows if row["holds"]]
        return {"title": title, "passed": not bad, "motor_hours": hours, "wrong": bad, "held": len(held), "wrong_held": sum(held)}, page.Page(
            f"soak: {title}", not bad, self._in_short(rows), self.text(rows).splitlines()[:-1])


def prepared(names: list[str]) -> dict[tuple[str, str], Bench]:
    """Every motor with the firmware of its own header, in one direction and in both; by motor and mode."""
    result = {}
    for name in names:
        motor = motor_file.load(name, "--motor")
        header = command_common.tuned_header(motor.path, None)
        for mode in sorted(set(MODES)):
            library = command_common.library_for([mode] if mode else [], None, header)
            result[motor.name, mode] = Bench(motor_file.part(str(motor.path)), board_file.part(*board_file.named(motor, None)), library, [])
    return result


def draw(seed: int, number: int, benches: dict[tuple[str, str], Bench]) -> Segment:
    """The segment with this number: always the same."""
    r = random.Random(f"soak/{seed}/{number}")
    name, mode = r.choice(sorted({name for name, _ in benches})), r.choice(MODES)
    return _Drawing(r, number, name, mode, benches[name, mode]).segment()


class _Drawing:
    """The operator of one segment while he makes up his mind."""

    def __init__(self, r: random.Random, number: int, name: str, mode: str, bench: Bench) -> None:
        self.r, self.number, self.name, self.mode = r, number, name, mode
        self.params, self.motor = bench.library.params, motor_file.load(str(bench.motor.path))
        self.plant = {**bench.board.values.values, **bench.motor.values.values}
        self.bus_v = float(self.plant["supply.voltage_v"])
        self.slow, self.nominal, self.most = (param(self.params, f"{what}_SPEED_RPM") for what in ("MINIMUM", "NOMINAL", "MAXIMUM"))
        self.slow += MIDDLE * (self.nominal - self.slow) if mode else 0.0
        self.slope = min(param(self.params, "SPEEDREFRAMP_RPM_PER_S"), decel_rpm_s(self.params))
        self.settle_s = max(8.0 / param(self.params, "SPEED_BANDWIDTH_HZ"), 0.7)
        self.events: list[Event] = []
        self.rests: list[tuple[float, float, float]] = []
        self.held: list[tuple[float, float]] = []
        self.rpm, self.load_nm, self.starts, self.now_s, self.true_l = 0.0, 0.0, 0, 0.2, r.uniform(*TRUE_L)
        self.warm: dict[str, float] = {}

    def segment(self) -> Segment:
        values = {"rng.seed": float(self.r.randrange(1, 2**31)), "adc.noise_lsb": self.r.uniform(0.3, 1.5),
                  "shunt.offset_a_v": self.r.uniform(-0.02, 0.02), "shunt.offset_b_v": self.r.uniform(-0.02, 0.02),
                  "supply.resistance_ohm": float(self.plant.get("supply.resistance_ohm", 0.1)) * self.r.uniform(0.5, 2.0),
                  **self._true()}
        values |= {key: float(self.plant[key]) * self.true_l for key in ("motor.ld_h", "motor.lq_h")}
        self._load(self.r.uniform(0.0, 0.5) * self.motor.start_torque_nm, 0.0, 0.0)
        self._start()
        while self.now_s < SEGMENT_S:
            self.r.choices((self._speed, self._new_load, self._again, self._sag, self._temperature, self._held, self._pulse), (38, 22, 8, 10, 8, 7, 7))[0]()
        scenario = Scenario(f"segment {self.number}", f"{self.name} {self.mode}".strip(), "", "", "", round(self.now_s, 3), defines=[self.mode] if self.mode else [],
                            events=sorted(self.events, key=lambda event: event.at_s), rotor_deg=float(self.r.randrange(360)),
                            plant=Values(values, {key: WHERE for key in values}))
        return Segment(self.number, self.name, self.mode, scenario, self.rests, self.starts, self.held)

    def _true(self, over_s: float | None = None) -> dict[str, float]:
        """Resistance and flux of the true motor: any at first, then what they may have become in a time."""
        for key, span in (("motor.rs_ohm", WARM_R), ("motor.psi_vs", WARM_PSI)):
            if over_s is None:
                self.warm[key] = self.r.uniform(*span)
            else:
                changed = self.warm[key] * math.exp(self.r.uniform(-1.0, 1.0) * WARM_PER_S * over_s)
                self.warm[key] = min(max(changed, span[0]), span[1])
        return {key: float(self.plant[key]) * factor for key, factor in self.warm.items()}

    def _event(self, at_s: float, kind: str, **more: Any) -> None:
        self.events.append(Event(round(at_s, 4), kind, WHERE, **more))

    def _set(self, keys: dict[str, float], over_s: float = 0.0, at_s: float | None = None) -> None:
        self._event(self.now_s if at_s is None else at_s, "set", keys=keys, over_s=over_s)

    def _start(self) -> None:
        self.rpm = self.r.uniform(self.slow, self.nominal) * self._direction()
        self._event(max(self.now_s - 0.1, 0.0), "speed_rpm", value=self.rpm, finds_range=True)
        self._event(self.now_s, "press", button="S2", hold_s=0.1)
        self.starts += 1
        self.now_s += start_time_s(self.params)
        self._rest(abs(abs(self.rpm) - param(self.params, "END_SPEED_RPM")))

    def _direction(self) -> float:
        return self.r.choice((1.0, -1.0)) if self.mode else 1.0

    def _rest(self, change_rpm: float, more_s: float = 0.0) -> None:
        """Long enough to settle and be judged, or not."""
        if self.r.random() < 0.35:
            self.now_s += more_s + self.r.uniform(0.05, 0.6)
            return
        settled_s = self.now_s + more_s + change_rpm / self.slope + self.settle_s * (1.0 + self.nominal / max(abs(self.rpm), self.slow) * 0.1)
        self.now_s = settled_s + REST_S + self.r.uniform(0.0, 1.0)
        self.rests.append((round(settled_s, 4), round(self.now_s, 4), self.rpm))

    def _speed(self) -> None:
        before = self.rpm
        top = self.nominal if self.mode or self.r.random() < 0.7 else self.most
        self.rpm = self.r.uniform(self.slow, top) * (self._direction() if self.r.random() < 0.3 else math.copysign(1.0, before))
        if self._most_nm(self.rpm) < self.load_nm:
            self._load(self.r.random() * self._most_nm(self.rpm), 0.2)
        over_s = self.r.choice((0.0, self.r.uniform(0.0, 1.5)))
        self._event(self.now_s, "speed_rpm", value=self.rpm, finds_range=True, over_s=over_s)
        turns = self.rpm * before < 0.0
        coast_s = self._stop_s(before) + start_time_s(self.params) + 1.0 if turns else 0.0
        if turns:
            self._load(min(self.load_nm, 0.5 * self.motor.start_torque_nm), 0.1)
            self.starts += 1
        if coast_s: # a stop, and a start the other way
            self.now_s += over_s + coast_s
        self._rest(abs(self.rpm - before), 0.0 if turns else over_s)

    def _stop_s(self, rpm: float) -> float:
        """How long a stop takes, also where the supply takes nothing back and friction alone brakes."""
        return max(abs(rpm) / self.slope, coast_s(self.motor, rpm)) + 0.5

    def _most_nm(self, rpm: float) -> float:
        """The largest drawn load that a warm motor holds at a sagging supply, and at which its back-EMF can be told from its resistance."""
        values = {key: float(value) for key, value in self.plant.items() if not isinstance(value, tuple)}
        values["motor.rs_ohm"] *= WARM_R[1]
        values["motor.psi_vs"] *= WARM_PSI[1]
        most_a = CURRENT_SHARE * param(self.params, "MAXIMUM_CURRENT_A")
        emf_v = values["motor.pole_pairs"] * abs(rpm) * math.pi / 30.0 * float(self.plant["motor.psi_vs"]) * WARM_PSI[0]
        unknown_ohm = float(self.plant["motor.rs_ohm"]) * (WARM_R[1] - 1.0)
        for share in SHARES:
            need = reach.least(values, abs(rpm), share * self.motor.rated_torque_nm, most_a)
            holds = need.voltage_v is not None and need.voltage_v <= VOLTAGE_SHARE * SAGS[0] * self.bus_v / math.sqrt(3.0)
            iq_a = need.iq_a * WARM_PSI[1] / WARM_PSI[0] # of the weakest magnets
            if holds and unknown_ohm * iq_a <= HIDDEN_SHARE * emf_v:
                return share * self.motor.rated_torque_nm
        return 0.0

    @property
    def _inertia_kgm2(self) -> float:
        return self.motor.inertia_kgm2 + self.motor.load_inertia_kgm2

    def _load_time_s(self, change_nm: float) -> float:
        """A load that grows by m a second takes m / (2 J f^2) of the speed in an electrical period 1/f."""
        turns_hz = abs(self.rpm) / 60.0
        return abs(change_nm) / (2.0 * self._inertia_kgm2 * (self.motor.pole_pairs * turns_hz) ** 2 * SWING_SHARE * 2.0 * math.pi * turns_hz)

    def _load(self, torque_nm: float, over_s: float, at_s: float | None = None) -> None:
        self.load_nm = torque_nm
        self._set({BRAKE: torque_nm}, over_s, at_s)
        self.now_s += over_s

    def _new_load(self) -> None:
        load_nm = self.r.random() * self._most_nm(self.rpm)
        self._load(load_nm, max(self.r.choice((0.05, self.r.uniform(0.05, 1.0))), self._load_time_s(load_nm - self.load_nm)))
        self._rest(0.0)

    def _again(self) -> None:
        """A stop, and a start some time later."""
        self._event(self.now_s, "press", button="S2", hold_s=0.1)
        self.now_s += 0.2 + self._stop_s(self.rpm)
        self._load(self.r.uniform(0.0, 0.5) * self.motor.start_torque_nm, 0.05)
        self.now_s += 0.5 + self.r.random()
        self._start()

    def _sag(self) -> None:
        over_s, lasts_s = self.r.choice((0.0, 0.02)), self.r.uniform(0.05, 1.0)
        self._set({"supply.voltage_v": self.bus_v * self.r.uniform(*SAGS)}, over_s)
        self._set({"supply.voltage_v": self.bus_v}, 0.0, self.now_s + over_s + lasts_s)
        self.now_s += over_s + lasts_s
        self._rest(0.0)

    def _temperature(self) -> None:
        over_s = self.r.uniform(1.0, 5.0)
        self._set(self._true(over_s), over_s)
        self.now_s += over_s
        self._rest(0.0)

    def _held(self) -> None:
        """A hand on the shaft, harder than the drive, and off again."""
        from_s = self.now_s
        most_nm = param(self.params, "MAXIMUM_CURRENT_A") * reach.torque_per_amp(self.plant)
        self._set({BRAKE: self.load_nm + self.r.uniform(*HOLD_TORQUES) * most_nm}, 0.002)
        self.now_s += self.r.uniform(*HOLD_S)
        self._set({BRAKE: self.load_nm})
        self.held.append((from_s, self.now_s + HELD.stop_s))
        self._rest(abs(self.rpm), self._back_s(most_nm))

    def _back_s(self, most_nm: float) -> float:
        """How long the rotor takes to be back at its speed."""
        spare_nm = max(0.5 * most_nm - self.load_nm, 0.1 * most_nm)
        return self._inertia_kgm2 * abs(self.rpm) * math.pi / 30.0 / spare_nm

    def _pulse(self) -> None:
        """A load that pulses once or twice a turn, for a while."""
        order = float(self.r.choice(injection.PULSE_ORDERS))
        most_nm = min(max(self._most_nm(self.rpm) - self.load_nm, 0.0), self.load_nm)
        most_nm = injection.pulse_nm(most_nm, order, self._inertia_kgm2, abs(self.rpm))
        self._set({"load.pulse1_nm": self.r.random() * most_nm, "load.pulse1_order": order})
        self._rest(0.0, 1.0)
        self._set({"load.pulse1_nm": 0.0})
        self.now_s += 0.2


def run(segment: Segment, benches: dict[tuple[str, str], Bench], tell: Callable[[float], None]) -> Run:
    """The segment in this process, which can run no other board afterwards."""
    bench = benches[segment.motor, segment.mode]
    job = simulate.prepare(segment.scenario, bench.library, bench.motor, bench.board)
    with simulate.using(Board(bench.library), job) as board:
        session = simulate.Session(job, bench.library, board, tell, EVERY)
        session.run_to(segment.scenario.duration_s)
        return session.run()


def row_of(segment: Segment, found: Run, rated_rpm: float) -> dict[str, Any]:
    """The segment's line: what was worst, and the first thing that is wrong."""
    trace = found.trace
    errors = [error for rest in segment.rests if (error := _speed_error(trace, rest, rated_rpm)) is not None]
    angle_deg = _angle_error_deg(found, segment.held)
    return {"segment": segment.number, "motor": segment.motor, "mode": segment.mode, "motor_s": round(found.motor_s, 2), "starts": segment.starts,
            "holds": segment.holds, "stretches": len(errors), "worst_speed_error_percent": round(max((abs(error) for _, error, _ in errors), default=0.0), 3),
            "worst_angle_error_deg": round(angle_deg, 1), "verdict": verdict(found, segment, errors, angle_deg, max(HELD.back_rpm, HELD.back_percent / 100.0 * rated_rpm))}


def verdict(run: Run, segment: Segment, errors: list[tuple[float, float, float]], angle_deg: float, most_back_rpm: float) -> str:
    """The first thing that is wrong; OK if nothing is, STOPPED if a hand on the shaft did it."""
    for from_s, to_s in segment.held:
        if (back_rpm := _backwards_rpm(run.trace.part(from_s, to_s))) > most_back_rpm:
            return f"thrown backwards: {back_rpm:.0f} rpm after {from_s:.3f} s"
    for _, at_s, name in run.raised():
        return f"{STOPPED if any(from_s <= at_s <= to_s for from_s, to_s in segment.held) else 'trips'}: {name} at {at_s:.3f} s"
    for at_s, error_percent, allowed_percent in errors:
        if abs(error_percent) > allowed_percent:
            return f"speed {error_percent:+.2f} % off at {at_s:.2f} s, allowed {allowed_percent:.2f} %"
    return f"loses its lock: angle off by {angle_deg:.0f} deg" if angle_deg > LOST_LOCK_DEG else OK


def _speed_error(trace: Any, rest: tuple[float, float, float], rated_rpm: float) -> tuple[float, float, float] | None:
    """When, error and allowed error in per cent of a stretch's reference; None where the drive says which limit holds the speed back."""
    from_s, to_s, rpm = rest
    part = trace.part(from_s, to_s)
    everywhere = np.ones(len(part), dtype=bool)
    if not len(part) or judge.limited(part, everywhere) > 0.02:
        return None
    mean_rpm = float(np.mean(whole_turns(part).column("plant.speed_rpm").astype(np.float64)))
    allowed_rpm = max(SPEED_ERROR * abs(rpm), 0.2 * SPEED_ERROR * rated_rpm)
    return from_s, 100.0 * (mean_rpm - rpm) / abs(rpm), 100.0 * allowed_rpm / abs(rpm)


def _backwards_rpm(part: Any) -> float:
    """How fast the rotor turns against the reference."""
    if not len(part):
        return 0.0
    forward = np.sign(part.column("fw.speed_ref_rpm"))
    return float(np.max(-forward * part.column("plant.speed_rpm")))


def _angle_error_deg(run: Run, held: list[tuple[float, float]]) -> float:
    """The largest error that lasts for LOST_LOCK_S in closed loop, but for a rotor that a hand holds; the sign may change."""
    trace = run.trace
    closed = (trace.column("fw.state") == run.state_number("CLOSED")) | (trace.column("fw.state") == run.state_number("STOPPING"))
    error = np.where(closed, np.abs(wrapped_deg(trace.column("fw.theta_est_deg") - trace.column("plant.theta_e_deg"))), 0.0)
    for from_s, to_s in held:
        error[(trace.time_s >= from_s) & (trace.time_s < to_s)] = 0.0
    rows = max(1, round(LOST_LOCK_S / max(trace.period_s, 1e-6)))
    if len(error) < rows:
        return 0.0
    return float(np.max(np.min(np.lib.stride_tricks.sliding_window_view(error, rows), axis=1)))
