"""The current and speed loops in the frequency domain with the firmware's real delays, and the bandwidths that keep their margins.

Current loop, complex (d + j q) because the rotor turns under the controllers. A vector computed at sample n is loaded half a period later
and acts for one period, and is turned by the angle of sample n+1; so, with h = exp(-R Ts/2L) and phi = w Ts,

    i[n+1] = h^2 e^(-j phi) i[n] + (1 - h)/R v[n] + h (1 - h)/R e^(-j phi) v[n-1]      C(z) = Kp + Ki/(z - 1)

With deferred duties (include/drive/tick.h) v[n] acts a period later, turned by the angle of sample n+2: one more delay, 1/z.

Speed loop. Every 8 periods, with deferred duties 16, the load observer (include/control/observer.h) takes the estimated speed's mean over them and the q current and
gives the speed and the load, from which the controller makes the q current of a quarter of that later; the estimated speed is half a period older.
Per step T, with a = Kt P/J, r the rate times T, w^ that mean,

    e = w^ - w - a T (i - l)/2,   w <- w + a T (i - l) + 2 r e,   l <- l - r^2/(a T) e,   i* = l - Kp w

The loop is opened at the estimated speed: there a wrong J or Kt is a factor. With F the back-EMF filter, I = Ts/(z - 1) and the estimator
linearised at the electrical speed w0, the estimated speed is F (1 + w0 I)/(1 + F w0 I) times the true one; an error dR, dL of the
estimator's R and L adds F/(1 + F w0 I) (dR + s dL)/psi times the q current, which is what makes a slow motor hunt.
"""

import functools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from tools.bench import robust
from tools.common import paths
from tools.common.param_rows import duties_are_late, number, slow_periods

from .limits import digits_down

PHASE_MARGIN_DEG = 60.0
"""Least margins of the current loops over the parameter set."""
GAIN_MARGIN_DB = 6.0
CURRENT_CAP = 1.0 / 20.0
"""Highest bandwidth of the current loops as a share of the PWM frequency: no outer loop needs more, and the voltage that a single step
of the converter causes grows with it."""
SPEED_MARGINS = {"quiet": (45.0, 6.0), "loaded": (35.0, 6.0), "quick": (15.0, 4.0), "quick, L wrong": (10.0, 0.5)}
"""Phase [deg] and gain [dB] that the speed loop keeps at each rate of the observer: quiet over the parameter set; loaded with L wrong, for the
adaptation has taken out what R and flux are wrong by then; quick, which lasts some 30 ms after a load step, with the motor as it is, and just
stable with an L as wrong as `make robust` makes it: what the current's change costs the estimated speed would go round and round.
On the virtual board slower observers are no calmer, and 0.08 N m stops the Hurst at 500 rpm with 70 Hz, not with 110."""
SPEED_CAP = 0.32
"""Highest bandwidth of the speed loop over the electrical frequency. Without load the currents lie where the dead time's compensation is
only linear; the voltage that is missing there looks like back-EMF, and the estimator rejects it no faster than the motor turns."""
CLEAR_OF_DEAD_TIME, LEAST_SPEED_SHARE = 1.9, 0.5
"""Friction's current over what dead time loses of a current, from which SPEED_CAP holds; below it falls with the square, no further than this share.
Where friction takes less current the compensation knows little of an unloaded motor's, and a quick loop follows what it sees."""
HIDDEN_HZ, HIDDEN_LEAST, HIDDEN_MOST = 9.0, 0.57, 1.4
"""Friction's current over what dead time loses of a current, which the speed of an unloaded motor needs: HIDDEN_HZ over the electrical frequency
at SLOW_SHARE of the rated speed, within these bounds. With less it wanders by tens of per cent on the virtual board, with quick and slow loops,
the slower the motor turns the more: what compensation leaves has the longer time."""
SLOW_SHARE = 0.2
STEP_SHARE_MOST = 0.25
"""Of SLOW_SHARE of the rated speed, most that half a step of the converter may turn the rotor off its speed in an electrical turn. Motors with 0.15
hold their speed on the virtual board, one with 0.4 does not."""
QUIET_RATIO, LOADED_SHARE, FAST_GAIN = (number(f"PARAM_{name}") for name in ("QUIET_RATIO", "LOADED_SHARE", "FAST_GAIN"))
FULL_RATIO, ESDQ_RATIO = (number(f"PARAM_{name}") for name in ("FULL_RATIO", "ESDQ_RATIO"))
HEAVY_SHARE = 0.75
"""What an innovation that is just large may ask for until the estimator answers, of the largest current. The heavier the rotor, the more current an
innovation is worth; the step of current shakes the estimate, and that is the next innovation. On the virtual board motors with 0.69 are calm; with
1.1 some swing between both limits. A heavy rotor needs no quick observer: a load slows it slowly."""
RATE_MOST = 0.374
"""OBSERVER_RATE_MOST_Q16 of control/observer.h"""
CURRENT_TOP = 1.0 / 12.0
"""Taken above the cap only for a motor whose rotation at top speed would cost the margin below it."""
CURRENT_NEARLY_DEG = 5.0
"""Where no bandwidth of the current loops has the margin, the one nearest the cap that has so little less than the best: rotation takes the
margin then, and a loop twenty times slower would gain three degrees and leave the speed loop nothing to stand on."""
TOLERANCE = {"rs": (0.9, 1.3), "ls": (0.8, 1.2), "psi": (0.9, 1.1)}
"""Parameter set of every motor, as factors: R 10 % below the sheet up to copper at 100 degC, L and flux as sheets leave them open."""
WRONG_L = robust.Table.read(paths.TABLES / "robust.toml").promised["L"]
"""How far L may be off, as factors: what `make robust` promises."""


@dataclass(frozen=True)
class Plant:
    """The motor that the loops see."""

    rs: float
    ld: float
    lq: float
    psi: float
    pole_pairs: int
    inertia: float
    viscous: float = 0.0

    @property
    def kt(self) -> float:
        return 1.5 * self.pole_pairs * self.psi


@dataclass(frozen=True)
class Gains:
    """Controller gains in SI: V/A, V/A a period; A per electrical rad/s. The observer's rate times its step; the filter's K per period."""

    kp_d: float
    kp_q: float
    ki: float
    speed_kp: float
    rate: float
    esdq: float
    period_s: float

    @property
    def slow_s(self) -> float:
        """A slow step."""
        return slow_periods(self.period_s) * self.period_s


@dataclass(frozen=True)
class Margins:
    """Margins of one loop in one case."""

    phase_deg: float
    gain_db: float
    crossover_hz: float
    asked_deg: float = PHASE_MARGIN_DEG
    asked_db: float = GAIN_MARGIN_DB

    @property
    def slack_deg(self) -> float:
        """Phase margin beyond what is asked for."""
        return self.phase_deg - self.asked_deg

    @property
    def stable(self) -> bool:
        """A loop that still has gain where its phase has gone beyond -180 degrees is not, and its margins are no margins."""
        return self.phase_deg > 0.0

    @property
    def enough(self) -> bool:
        return self.slack_deg >= 0.0 and self.gain_db >= self.asked_db


@dataclass
class Curve:
    """An open loop over frequency, for the Bode plot."""

    label: str
    frequency_hz: np.ndarray
    response: np.ndarray
    margins: Margins


@dataclass
class LoopDesign:
    """A bandwidth and what it leaves."""

    bandwidth_hz: float
    worst: Margins
    worst_case: str
    nominal: Margins
    curves: list[Curve] = field(default_factory=list)
    load_hz: float = 0.0
    """bandwidth of the load observer"""
    at_rates: dict[str, tuple[Margins, str]] = field(default_factory=dict)
    """of the speed loop: the worst at each rate of the observer"""

    @property
    def reached(self) -> bool:
        return self.worst.enough


def current_loop(hz: np.ndarray, plant: Plant, gains: Gains, omega_e: float, axis: str = "q") -> np.ndarray:
    """Open current loop; negative frequencies are different when the rotor turns."""
    ts = gains.period_s
    inductance, kp = (plant.ld, gains.kp_d) if axis == "d" else (plant.lq, gains.kp_q)
    z, turn = np.exp(2j * np.pi * hz * ts), np.exp(-1j * omega_e * ts)
    h = np.exp(-plant.rs * ts / (2.0 * inductance))
    b = (1.0 - h) / plant.rs
    late = z if duties_are_late(ts) else 1.0
    return (kp + gains.ki / (z - 1.0)) * b * (z + h * turn) / (late * z * (z - h * h * turn))


def estimator(hz: np.ndarray, gains: Gains, omega_e: float, strength: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """From true to estimated speed, and from an error of the back-EMF (over psi) to it. `strength`: true psi over assumed psi."""
    z = np.exp(2j * np.pi * hz * gains.period_s)
    f = gains.esdq / (1.0 - (1.0 - gains.esdq) / z)
    integrator = gains.period_s / (z - 1.0)
    closed = 1.0 + strength * f * omega_e * integrator
    return strength * f * (1.0 + omega_e * integrator) / closed, f / closed


def observer_law(hz: np.ndarray, assumed: Plant, gains: Gains) -> tuple[np.ndarray, np.ndarray]:
    """The q current that observer and controller ask for: per estimated speed, per measured q current."""
    step = gains.slow_s
    z, r, gain = np.exp(2j * np.pi * hz * step), gains.rate, assumed.kt * assumed.pole_pairs / assumed.inertia * step
    (a, b), (c, d) = (1.0 - 2.0 * r, -(1.0 - r) * gain), (r * r / gain, 1.0 - 0.5 * r * r)

    def current(to_speed: float, to_load: float) -> np.ndarray:
        speed, load = (z - d) * to_speed + b * to_load, c * to_speed + (z - a) * to_load
        return z * (load - gains.speed_kp * speed) / ((z - a) * (z - d) - b * c)

    mean = (1.0 - 1.0 / z) / (1.0 - np.exp(-2j * np.pi * hz * gains.period_s)) * gains.period_s / step
    return current(2.0 * r, -c) * mean, current(-b, 0.5 * r * r)


class SpeedLoops:
    """Open speed loops of many motors on one grid, with controllers made for `assumed`: what they share is computed once."""

    def __init__(self, hz: np.ndarray, assumed: Plant) -> None:
        self.hz, self.assumed = hz, assumed
        self._currents, self._estimators, self._laws = (functools.cache(part) for part in (self._current, self._estimator, self._law))

    def _current(self, true: Plant, gains: Gains) -> tuple[np.ndarray, np.ndarray]:
        """The current that follows the one asked for, and the shaft that it turns."""
        s, slow = 2j * np.pi * self.hz, gains.slow_s
        inner = current_loop(self.hz, true, gains, 0.0)
        current = inner / (1.0 + inner) * (1.0 - np.exp(-s * slow)) / (s * slow) * np.exp(-0.25 * s * slow)
        return current, true.kt * true.pole_pairs / (true.inertia * s + true.viscous)

    def _estimator(self, gains: Gains, omega_e: float, strength: float) -> tuple[np.ndarray, np.ndarray]:
        return estimator(self.hz, gains, omega_e, strength)

    def _law(self, gains: Gains) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        per_speed, per_current = observer_law(self.hz, self.assumed, gains)
        return -per_speed, per_current, np.exp(-0.5 * (2j * np.pi * self.hz) * gains.period_s)

    def of(self, true: Plant, gains: Gains, omega_e: float) -> np.ndarray:
        """The open loop of a motor `true` at a speed."""
        assumed, s = self.assumed, 2j * np.pi * self.hz
        current, shaft = self._currents(true, replace(gains, speed_kp=0.0, rate=0.0, esdq=0.0))
        speed, error = self._estimators(replace(gains, speed_kp=0.0, rate=0.0), omega_e, true.psi / assumed.psi)
        per_speed, per_current, late = self._laws(gains)
        wrong = (true.rs - assumed.rs + s * (true.lq - assumed.lq)) / assumed.psi
        return per_speed * current * (shaft * speed + wrong * error) * late / (1.0 - per_current * current)


    def closed(self, true: Plant, gains: Gains, omega_e: float) -> tuple[np.ndarray, np.ndarray]:
        """The shaft's speed per reference; and per torque that brakes it, electrical rad/s per N m."""
        current, shaft = self._currents(true, replace(gains, speed_kp=0.0, rate=0.0, esdq=0.0))
        _, per_current, _ = self._laws(gains)
        opened = 1.0 + self.of(true, gains, omega_e)
        return gains.speed_kp * current / (1.0 - per_current * current) * shaft / opened, -shaft / true.kt / opened


def speed_loop(hz: np.ndarray, true: Plant, assumed: Plant, gains: Gains, omega_e: float) -> np.ndarray:
    """Open speed loop of a motor `true` with controllers made for `assumed`."""
    return SpeedLoops(hz, assumed).of(true, gains, omega_e)


def margins(hz: np.ndarray, response: np.ndarray, asked: tuple[float, float] = (PHASE_MARGIN_DEG, GAIN_MARGIN_DB)) -> Margins:
    """Least phase margin over all gain crossovers, least gain margin over all phase crossovers; both signs of frequency."""
    size, angle = np.abs(response), np.degrees(np.angle(response))
    angle = np.where(hz < 0.0, -angle, angle)
    neighbours = hz[1:] * hz[:-1] > 0.0
    crossings = np.nonzero((size[:-1] - 1.0) * (size[1:] - 1.0) <= 0.0)[0]
    crossings = crossings[neighbours[crossings]]
    phase, where = 180.0, float("nan")
    for k in crossings:
        share = (1.0 - size[k]) / (size[k + 1] - size[k]) if size[k + 1] != size[k] else 0.0
        step = (angle[k + 1] - angle[k] + 180.0) % 360.0 - 180.0
        margin = (angle[k] + share * step) % 360.0 - 180.0
        if where != where or margin < phase:
            phase, where = margin, abs(hz[k] + share * (hz[k + 1] - hz[k]))
    wraps = np.nonzero((np.abs(angle[1:] - angle[:-1]) > 180.0) & neighbours)[0]
    gain = min((-20.0 * np.log10(max(size[k], size[k + 1])) for k in wraps if size[k] < 1.0), default=60.0)
    return Margins(float(phase), float(gain), float(where), *asked)


def current_grid(period_s: float, points: int = 400) -> np.ndarray:
    """Frequencies of both signs up to half the sampling frequency."""
    half = np.geomspace(5.0, 0.45 / period_s, points)
    return np.concatenate([-half[::-1], half])


def corners(plant: Plant, spread: dict[str, tuple[float, float]] | None = None) -> list[tuple[str, Plant]]:
    """The parameter set: every combination of R, L and flux at both ends of their published spread, or of the tolerance
    where none is published, and the middle."""
    ends = TOLERANCE | (spread or {})
    found = [("nominal", plant)]
    for r, l, k in product(*((1.0, *ends[name]) for name in ("rs", "ls", "psi"))):
        if (r, l, k) != (1.0, 1.0, 1.0):
            text = ", ".join(f"{name} {factor - 1.0:+.0%}" for name, factor in (("R", r), ("L", l), ("flux", k)) if factor != 1.0)
            found.append((text, replace(plant, rs=plant.rs * r, ld=plant.ld * l, lq=plant.lq * l, psi=plant.psi * k)))
    return found


def _worst(cases: Iterable[tuple[str, Callable[[], Margins]]], first: str | None = None) -> tuple[Margins, str]:
    """The case with the least phase margin beyond what is asked of it, with the least gain margin of those of which as much is asked; with the
    name of the case to look at `first`, one that is not enough, if there is any."""
    found: list[tuple[str, Margins]] = []
    for name, compute in cases if first is None else sorted(cases, key=lambda case: case[0] != first):
        found.append((name, compute()))
        if first is not None and not found[-1][1].enough:
            break
    label, worst = min(found, key=lambda item: (item[1].enough, item[1].slack_deg))
    return replace(worst, gain_db=min(each.gain_db for _, each in found if each.asked_db == worst.asked_db)), label


def _largest(candidates: list[float], worst_of: Callable[[float, str | None], tuple[Margins, str]],
             nearly_deg: float = 0.0) -> tuple[float, Margins, str]:
    """The largest candidate with enough margin; if there is none, the first one that is within `nearly_deg` of the most. The case that has refused
    one candidate is the likeliest to refuse the next."""
    refused_by = ""
    for candidate in candidates:
        found, refused_by = worst_of(candidate, refused_by)
        if found.enough:
            return candidate, *worst_of(candidate, None)
    results = [(candidate, *worst_of(candidate, None)) for candidate in candidates[:: max(1, len(candidates) // 20)]]
    most = max(item[1].slack_deg for item in results)
    return next(item for item in results if item[1].slack_deg >= most - nearly_deg)


def current_gains(plant: Plant, bandwidth_hz: float, base: Gains) -> Gains:
    """Pole-zero cancellation: Kp = 2 pi f L of each axis, Ki = 2 pi f R."""
    w = 2.0 * np.pi * bandwidth_hz
    return replace(base, kp_d=w * plant.ld, kp_q=w * plant.lq, ki=w * plant.rs * base.period_s)


def speed_gains(plant: Plant, bandwidth_hz: float, load_hz: float, base: Gains, omega_e: float) -> dict[str, Gains]:
    """Kp = 2 pi f J/Kt per mechanical, i.e. / P per electrical rad/s, and the observer at its three rates; both fall with the speed below
    the one that the rates need, under load below half of it, and so does the corner of the back-EMF filter."""
    full = omega_e / full_rad_s(load_hz)
    kp, step = 2.0 * np.pi * bandwidth_hz * plant.inertia / plant.kt / plant.pole_pairs, base.slow_s
    loaded, esdq = LOADED_SHARE * load_hz, min(base.esdq, ESDQ_RATIO * omega_e * base.period_s)

    def at(rate_hz: float, share: float, gain: float = 1.0) -> Gains:
        return replace(base, speed_kp=kp * gain * min(1.0, share), rate=2.0 * np.pi * rate_hz * step * min(1.0, share), esdq=esdq)

    return {"quiet": at(min(QUIET_RATIO * bandwidth_hz, loaded), full), "loaded": at(loaded, 2.0 * full),
            "quick": at(load_hz, 2.0 * full, FAST_GAIN)}


def full_rad_s(load_hz: float) -> float:
    """Electrical speed from which rates and gain are in full without load; under load from half of it."""
    return 2.0 * np.pi * load_hz / FULL_RATIO


def design_current(plant: Plant, spread: dict[str, tuple[float, float]], base: Gains, top_rad_s: float, largest_hz: float, least_hz: float,
                   fixed_hz: float | None = None) -> LoopDesign:
    """Bandwidth of the current loops, margins at standstill and at the highest electrical speed."""
    grid = current_grid(base.period_s)
    axes = ("q",) if plant.ld == plant.lq else ("d", "q")
    cases = {f"{name}, {'standstill' if w == 0.0 else 'top speed'}" + (f", {axis} axis" if len(axes) > 1 else ""): (p, w, axis)
             for name, p in corners(plant, spread) if p.psi == plant.psi for w in (0.0, top_rad_s) for axis in axes}

    def worst_of(bandwidth_hz: float, first: str | None) -> tuple[Margins, str]:
        gains = current_gains(plant, bandwidth_hz, base)
        return _worst(((label, lambda case=case: margins(grid, current_loop(grid, case[0], gains, *case[1:])))
                       for label, case in cases.items()), first)

    cap = min(CURRENT_CAP / base.period_s, largest_hz)
    above = [f for f in _steps(min(CURRENT_TOP / base.period_s, largest_hz), cap, 0.95) if f > cap][::-1]
    candidates = [fixed_hz] if fixed_hz else _steps(cap, max(least_hz, cap / 8.0), 0.95) + above
    chosen, worst, label = _largest(candidates, worst_of, CURRENT_NEARLY_DEG)
    gains = current_gains(plant, chosen, base)
    shown = dict.fromkeys([*list(cases)[:2 * len(axes)], label])
    return _made(chosen, worst, label, grid, {name: current_loop(grid, cases[name][0], gains, *cases[name][1:]) for name in shown})


def _made(chosen: float, worst: Margins, label: str, grid: np.ndarray, responses: dict[str, np.ndarray]) -> LoopDesign:
    """A design with the curves that the report shows, the nominal one first."""
    curves = [Curve(name, grid, response, margins(grid, response)) for name, response in responses.items()]
    return LoopDesign(chosen, worst, label, curves[0].margins, curves)


def _steps(highest: float, lowest: float, ratio: float) -> list[float]:
    """From the highest down by a constant ratio, rounded down to 1 in 20 to 200 of it."""
    found: list[float] = []
    value = highest
    while value >= lowest * 0.999:
        digits = 10.0 ** (np.floor(np.log10(0.5 * value)) - 1.0)
        rounded = float(f"{np.floor(value / digits + 1e-9) * digits:.6g}")
        if rounded >= lowest * 0.999 and rounded not in found:
            found.append(rounded)
        value *= ratio
    return found or [lowest]


def load_bandwidth(base: Gains, esdq_hz: float, current_hz: float) -> float:
    """Largest bandwidth of the load observer: its time constant is that of back-EMF filter and current loop and one slow step together, and
    its rate times the step keeps within its format."""
    step = 2.0 * np.pi * base.slow_s
    return min(1.0 / (1.0 / esdq_hz + 1.0 / current_hz + step), RATE_MOST / step)


def calm_load_bandwidth(innovation_counts: float, acceleration: float, largest_counts: float, period_s: float) -> float:
    """Bandwidth of the load observer at which a large innovation asks for HEAVY_SHARE of the largest current, at the lowest speed of the full
    rates. `acceleration`: of a count of current, counts of speed in a slow step."""
    return HEAVY_SHARE * largest_counts * acceleration / (FULL_RATIO * innovation_counts) / (2.0 * math.pi * slow_periods(period_s) * period_s)


def speed_cap(friction_over_lost: float) -> float:
    """SPEED_CAP, or what is left of it where an unloaded motor's current hides in dead time."""
    return SPEED_CAP * min(1.0, max(LEAST_SPEED_SHARE, (friction_over_lost / CLEAR_OF_DEAD_TIME) ** 2))


def hidden_limit(slow_hz: float) -> float:
    """Least current of friction over what dead time loses. `slow_hz`: electrical frequency at SLOW_SHARE of the rated speed."""
    return min(HIDDEN_MOST, max(HIDDEN_LEAST, HIDDEN_HZ / slow_hz))


def calm_bandwidth(load_hz: float, lowest_rad_s: float, cap: float = SPEED_CAP) -> float:
    """Largest bandwidth of the speed loop: `cap` of the electrical frequency from which it is in full, or of the lowest one."""
    return cap * max(load_hz / FULL_RATIO, lowest_rad_s / (2.0 * np.pi))


def design_speed(plant: Plant, spread: dict[str, tuple[float, float]], base: Gains, speeds_rad_s: dict[str, float], largest_hz: float,
                 load_hz: float, fixed_hz: float | None = None, fixed_load_hz: float | None = None, cap: float = SPEED_CAP) -> LoopDesign:
    """Bandwidth of the load observer, the largest up to `load_hz` with enough margin at every speed of `speeds_rad_s` (name: electrical
    rad/s) and every rate, and of the speed loop that goes with it: up to `largest_hz` and what is calm at the lowest speed."""
    grid = np.geomspace(0.05, 0.45 / base.slow_s, 400)
    responses = SpeedLoops(grid, plant)
    whole, lowest = corners(plant, spread), min(speeds_rad_s.values())
    sets = {"quiet": whole, "loaded": [item for item in whole if (item[1].rs, item[1].psi) == (plant.rs, plant.psi)], "quick": whole[:1],
            "quick, L wrong": [(f"L x{factor:g}", replace(plant, ld=plant.ld * factor, lq=plant.lq * factor)) for factor in WRONG_L]}

    def speed_hz(load: float) -> float:
        return fixed_hz or digits_down(min(largest_hz, calm_bandwidth(load, lowest, cap)), 3)

    def cases(load: float) -> Iterable[tuple[str, Plant, Gains, float, tuple[float, float]]]:
        full = {"full rates": full_rad_s(load), "full rates under load": 0.5 * full_rad_s(load)}
        for at, omega in ({name: omega for name, omega in full.items() if omega > lowest} | speeds_rad_s).items():
            gains = speed_gains(plant, speed_hz(load), load, base, omega)
            for mode, asked in SPEED_MARGINS.items():
                for name, true in sets[mode]:
                    yield f"{name}, {at}, {mode}", true, gains[mode.split(",", maxsplit=1)[0]], omega, asked

    def worst_of(load: float, first: str | None, rates: tuple[str, ...] = tuple(SPEED_MARGINS)) -> tuple[Margins, str]:
        return _worst(((label, lambda item=item: margins(grid, responses.of(*item[:3]), item[3]))
                       for label, *item in cases(load) if label.endswith(rates)), first)

    candidates = [fixed_load_hz] if fixed_load_hz else _steps(load_hz, load_hz / 10.0, 0.98)
    load, worst, label = _largest(candidates, worst_of)
    if not worst.enough: # a rotor so heavy that no bandwidth has it all hardly ever gives a large innovation: L is right then
        right = tuple(mode for mode in SPEED_MARGINS if mode != "quick, L wrong")
        load, worst, label = _largest(candidates, lambda hz, first: worst_of(hz, first, right))
    found = {name: item for name, *item in cases(load)}
    shown = dict.fromkeys([next(name for name in found if name.endswith(mode)) for mode in SPEED_MARGINS] + [label])
    curves = [Curve(name, grid, responses.of(*found[name][:3]), margins(grid, responses.of(*found[name][:3]), found[name][3])) for name in shown]
    return LoopDesign(speed_hz(load), worst, label, curves[0].margins, curves, load, {mode: worst_of(load, None, (mode,)) for mode in SPEED_MARGINS})
