"""Measures the loops of a running motor with the firmware's own sine (firmware/drive/modes/modes.c, docs/response.md), over any link of the scope's.

A sine r beside the q current asked for gives the q current i = T r, of which the open loop is T / (1 - T); the d axis' loop is closed meanwhile.
Beside the angle that the load observer sees, the sine s gives the estimator's angle rho, and the open speed loop is -rho / (rho + s)."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from tools.common import drive_tables
from tools.common.errors import UserError
from tools.common.param_rows import slow_periods

from . import view
from .lnet import Channel, Lnet
from .symbols import Symbols, Variable

LOOPS = ("current", "speed")
SPAN = {"current": (1.0 / 6.0, 4.0), "speed": (1.0 / 5.0, 8.0)}
"""From and to, of the loop's bandwidth."""
HIGHEST = {"current": 0.2, "speed": 0.1}
"""Of a sampling frequency: the period's, the slow step's."""
LOWEST_HZ = 0.8
POINTS = 25
CLEAR_OF_TURN = 0.15
"""Beside the electrical frequency a sine looks like an offset of a current's sensor: the loop is not measured so near."""
CURRENT_SHARE, FORCED_SHARE, SPEED_SHARE, GATE_SHARE = 0.05, 0.15, 0.02, 0.4
"""Size of the sine: of the largest current, with the estimator's angle and with the forced one; of the speed, and of what the load observer takes for a load step."""
SIZE_MOST = 32767
TURN = 65536.0
ROUNDS = 3
"""Records of each frequency, of which the mean counts."""
TURNS = 3.0
"""Of the sine in a record, at least."""
SETTLE_TURNS, SETTLE_S = 2.0, 0.05
SPARE_S = 2.0
"""That the sine lasts beyond a record: the link has other work, too."""
LONGEST_S = 3.0
"""Of a record: the lease of scope_command holds 5 s."""
LEASE_MS, RENEW_S = 5000, 1.0
PANEL_MODE, TARGET_MODE = 0, 1
"""Of scope_command."""
POLL_S, LOOK_S, STEADY_S = 0.02, 0.1, 1.0
RUN = "board_drive.run"
SINE = f"{RUN}.sine"


@dataclass(frozen=True)
class Point:
    """The open loop at one frequency."""

    hz: float
    response: complex
    spread: float
    """of the records, as a share of the response"""


class Firmware:
    """Variables by name, over a link."""

    def __init__(self, link: Lnet, symbols: Symbols) -> None:
        self.link, self.symbols = link, symbols

    def of(self, name: str) -> Variable:
        """The variable itself."""
        return self.symbols.find(name)

    def get(self, name: str) -> int:
        """Its value, in counts."""
        variable = self.of(name)
        return variable.value(self.link.read(variable.address, variable.bytes))

    def put(self, name: str, value: int) -> None:
        """Writes it; a value that does not fit is refused."""
        variable = self.of(name)
        self.link.write(variable.address, variable.data(value))

    def record(self, names: list[str], factor: int, pause: Callable[[float], None]) -> np.ndarray:
        """A whole array of rows; the longest is LONGEST_S."""
        self.link.scope_setup([Channel(item.address, item.bytes, item.signed) for item in map(self.of, names)], factor=factor)
        while self.link.scope_state().running:
            pause(POLL_S)
        return np.array(self.link.scope_read(), dtype=np.int64)


class Bench:
    """A motor that turns, and its loops. `pause` lets time pass, of the board's where it is in this process."""

    def __init__(self, firmware: Firmware, params: Mapping[str, float], pause: Callable[[float], None] = time.sleep, rounds: int = ROUNDS) -> None:
        self.firmware, self.params, self._pause, self.rounds = firmware, params, pause, rounds
        self.period_s = params["LOOPTIME_SEC"]
        self.slow_s = slow_periods(self.period_s) * self.period_s
        """of a step of the load observer, and of the sine's `left`"""
        self.turning, self.hz = "", 0.0
        """the state that the motor must not leave, and the frequency that is measured"""
        self.leases = False
        """the scope's command holds only as long as its lease is renewed"""
        if not has_sine(firmware.symbols):
            raise UserError("the firmware has no sine for its loops", "response", "build it with SCOPE 1")

    def frequencies(self, loop: str, points: int = POINTS) -> np.ndarray:
        """Where the loop is measured."""
        bandwidth_hz = self.params["CURRENT_BANDWIDTH_HZ" if loop == "current" else "SPEED_BANDWIDTH_HZ"]
        step_s = self.period_s if loop == "current" else self.slow_s
        low, high = (factor * bandwidth_hz for factor in SPAN[loop])
        grid = np.geomspace(max(low, LOWEST_HZ), min(high, HIGHEST[loop] / step_s), points)
        turn_hz = abs(self.speed_rpm()) * self.params["NOPOLESPAIRS"] / 60.0
        return grid[np.abs(grid / turn_hz - 1.0) > CLEAR_OF_TURN] if loop == "current" and turn_hz else grid

    # ---- the motor ----------------------------------------------------------------------------------------------------------
    def pause(self, seconds: float) -> None:
        """Lets time pass; a lease is renewed."""
        while seconds > 0.0:
            if self.leases:
                self.hold()
            self._pause(min(seconds, RENEW_S))
            seconds -= RENEW_S

    def hold(self) -> None:
        """Renews the lease."""
        self.firmware.put("scope_command.lease_ms", LEASE_MS)

    def aim(self, erpm: int) -> None:
        """Another target for the motor, of the client that has the command."""
        self.firmware.put("scope_command.target_erpm", erpm)

    def end(self) -> None:
        """No sine any more."""
        self.firmware.put(f"{SINE}.left", 0)

    def stays(self) -> None:
        """Refuses a motor that has left the state in which it is measured."""
        if (state := self.state()) != self.turning:
            raise UserError(f"the motor has left {self.turning} at {self.hz:.3g} Hz: {state}, fault {self.fault()}", "response", "measure at another speed")

    def settles(self, within_s: float = 10.0) -> None:
        """Waits for a steady speed, whatever it is."""
        steady, before = 0, math.inf
        for _ in range(round(within_s / LOOK_S)):
            self.pause(LOOK_S)
            speed = self.speed_rpm()
            steady = steady + 1 if abs(speed - before) < SPEED_SHARE * abs(speed) + 1.0 else 0
            before = speed
            if steady * LOOK_S >= STEADY_S:
                return
        raise UserError(f"the speed does not stay where it is, {before:.0f} rpm", "response", "wait until it does")

    def state(self) -> str:
        """Of the drive, by name."""
        return dict(enumerate(view.states())).get(self.firmware.get("board_drive.state"), "?")

    def fault(self) -> str:
        """By name; NONE."""
        return {row.code: row.name for row in drive_tables.faults()}.get(self.firmware.get("board_drive.fault"), "?")

    def speed_rpm(self) -> float:
        """Of the load observer, or of the forced angle."""
        if self.state() != "CLOSED":
            turns = self.firmware.get("board_drive.forced.speed_q10") / 1024.0 / TURN
            return turns / self.period_s * 60.0 / self.params["NOPOLESPAIRS"] * self.firmware.get("board_drive.direction")
        return self.firmware.get(f"{RUN}.observer.omega_q16") / TURN * self.params["COUNT_SPEED_RPM"]

    # ---- the sine -----------------------------------------------------------------------------------------------------------
    def sine(self, hz: float, seconds: float, **sizes: int) -> float:
        """Begins; returns the frequency that it has."""
        step = max(1, round(hz * self.period_s * TURN))
        self.firmware.put(f"{SINE}.left", 0)
        self.firmware.put(f"{SINE}.step", step)
        for name in ("size_iq_q16", "size_rho_q17"):
            self.firmware.put(f"{SINE}.{name}", sizes.get(name, 0))
        self.firmware.put(f"{SINE}.left", min(65535, math.ceil(seconds / self.slow_s)))
        return step / TURN / self.period_s

    def points(self, loop: str, frequencies: np.ndarray) -> Iterator["Point"]:
        """The open loop at these frequencies."""
        measure, self.turning = {"current": self._current, "speed": self._speed}[loop], self.turning or self.state()
        for hz in frequencies:
            self.hz = float(hz)
            found = [measure(self.hz) for _ in range(self.rounds)]
            self.stays()
            responses = np.array([response for _, response in found])
            mean = complex(responses.mean())
            yield Point(found[0][0], mean, float(np.abs(responses - mean).max() / abs(mean)))

    def _factor(self, hz: float, words: int) -> int:
        """Periods from row to row: enough turns of the sine in a record and one of the rotor's field, for dead time shakes a current where a phase's
        goes through zero; and no row in the same place of the sine as the last."""
        rows = self.firmware.link.scope_state().size // (2 * words)
        turn_hz = max(abs(self.speed_rpm()) * self.params["NOPOLESPAIRS"] / 60.0, 1.0)
        factor = max(1, min(math.ceil(max(TURNS / hz, 1.0 / turn_hz) / self.period_s / rows), int(LONGEST_S / self.period_s / rows)))
        while factor > 1 and abs((hz * self.period_s * factor * 2.0 + 0.1) % 1.0 - 0.1) < 0.1:
            factor += 1
        return factor

    def _seconds(self, hz: float, factor: int, words: int) -> float:
        rows = self.firmware.link.scope_state().size // (2 * words)
        return SETTLE_S + SETTLE_TURNS / hz + factor * rows * self.period_s + SPARE_S

    def _record(self, names: list[str], factor: int, hz: float) -> np.ndarray:
        """A record that the sine has outlasted."""
        rows = self.firmware.record(names, factor, self.pause)
        if not self.firmware.get(f"{SINE}.left"):
            self.stays()
            raise UserError(f"the sine of {hz:.3g} Hz has ended before its record", "response", "the link is too slow, or another client measures")
        return rows

    def _current(self, hz: float) -> tuple[float, complex]:
        share = CURRENT_SHARE if self.state() == "CLOSED" else FORCED_SHARE
        size = min(SIZE_MOST, round(8.0 * share * self.params["MAXIMUM_CURRENT_A"] / self.params["COUNT_CURRENT_A"]))
        names = [f"{SINE}.angle", f"{RUN}.control.i_q13.q", f"{RUN}.control.i_q13.d", f"{RUN}.control.ref_q13.q"]
        factor = self._factor(hz, len(names))
        hz = self.sine(hz, self._seconds(hz, factor, len(names)), size_iq_q16=size)
        self.pause(SETTLE_S + SETTLE_TURNS / hz)
        rows = self._record(names, factor, hz)
        closed = wave(rows[:, 1], rows[:, 0]) / (size / 8.0)
        return hz, closed / (1.0 - closed)

    def _speed(self, hz: float) -> tuple[float, complex]:
        erpm = min(GATE_SHARE * self.firmware.get(f"{RUN}.observer.gate_erpm"), SPEED_SHARE * abs(self.firmware.get(f"{RUN}.control.reference_erpm")))
        hertz = erpm * self.params["COUNT_SPEED_RPM"] * self.params["NOPOLESPAIRS"] / 60.0
        size = max(1, min(SIZE_MOST, round(hertz / (2.0 * math.pi * hz) * 2.0 * TURN)))
        names = [f"{SINE}.angle", f"{RUN}.estimator.rho_q32", f"{RUN}.control.ref_q13.q"]
        factor = self._factor(hz, 4)
        hz = self.sine(hz, self._seconds(hz, factor, 4), size_rho_q17=size)
        self.pause(SETTLE_S + SETTLE_TURNS / hz)
        mean_hz = self.speed_rpm() * self.params["NOPOLESPAIRS"] / 60.0
        rows = self._record(names, factor, hz)
        angle = wave(unwrapped(rows[:, 1] / TURN ** 2, mean_hz * factor * self.period_s), rows[:, 0])
        return hz, -angle / (angle + size / TURN / 2.0)


class Driven(Bench):
    """A motor that is started and stopped for it, by the scope's command, whose lease is renewed."""

    def start(self, speed_rpm: float, within_s: float = 20.0) -> None:
        """Starts it, and waits until it turns steadily: at the speed, or with OPEN_LOOP_FUNCTIONING at that of the forced angle."""
        put, steady = self.firmware.put, 0
        put("scope_command.run", 0)
        put("scope_command.target_erpm", round(speed_rpm / self.params["COUNT_SPEED_RPM"]))
        self.leases = True
        self.hold()
        put("scope_command.mode", TARGET_MODE)
        put("scope_command.run", 1)
        before = 0
        for _ in range(round(within_s / LOOK_S)):
            self.pause(LOOK_S)
            state, forced = self.state(), self.firmware.get("board_drive.forced.speed_q10")
            if state == "FAULT":
                raise UserError(f"the motor ends in fault {self.fault()}", "response", "try make run with this speed first")
            arrived = abs(self.speed_rpm() - speed_rpm) < SPEED_SHARE * abs(speed_rpm) + 5.0
            steady = steady + 1 if (state == "CLOSED" and arrived) or (state == "RAMP" and forced == before != 0) else 0
            before = forced
            if steady * LOOK_S >= STEADY_S:
                return
        raise UserError(f"the motor has {self.speed_rpm():.0f} rpm instead of {speed_rpm:g} after {within_s:g} s", "response", "name a speed that it reaches")

    def stop(self) -> None:
        """No sine, and the motor stops."""
        self.leases = False
        self.end()
        self.firmware.put("scope_command.run", 0)


def has_sine(symbols: Symbols) -> bool:
    """Of a firmware with SCOPE."""
    return f"{SINE}.left" in symbols.variables


def unwrapped(turns: np.ndarray, expected: float) -> np.ndarray:
    """Turns without jumps, less what is expected from row to row."""
    left = np.diff(turns) - expected
    return np.concatenate([[0.0], np.cumsum(left - np.round(left))])


def wave(values: np.ndarray, angle: np.ndarray) -> complex:
    """What of the values is a wave with this angle, as a factor of the sine; a mean and a drift are not."""
    turn, time = 2.0 * np.pi * angle / TURN, np.linspace(-1.0, 1.0, len(values))
    sine, cosine = np.linalg.lstsq(np.stack([np.sin(turn), np.cos(turn), np.ones(len(values)), time, time ** 2], axis=1), values, rcond=None)[0][:2]
    return complex(sine, cosine)
