"""The current and speed loops in the frequency domain with the firmware's real delays, and the bandwidths that keep their margins.

Current loop, complex (d + j q) because the rotor turns under the controllers. A vector computed at sample n is loaded half a period later
and acts for one period, and is turned by the angle of sample n+1; so, with h = exp(-R Ts/2L) and phi = w Ts,

    i[n+1] = h^2 e^(-j phi) i[n] + (1 - h)/R v[n] + h (1 - h)/R e^(-j phi) v[n-1]      C(z) = Kp + Ki/(z - 1)

Speed loop. The controller runs every 8 periods and reads the speed that was filtered a period before; the currents are a period older
than their mean back-EMF. With F the back-EMF filter, V the speed filter, I = Ts/(z - 1) and the estimator linearised at the electrical
speed w0, the estimated speed is F (1 + w0 I)/(1 + F w0 I) times the true one; an error dR, dL of the estimator's R and L adds
F/(1 + F w0 I) (dR + s dL)/psi times the q current, which is what makes a slow motor hunt.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

PHASE_MARGIN_DEG = 60.0
"""Least phase margin of both loops over the parameter set."""
GAIN_MARGIN_DB = 6.0
CURRENT_CAP = 1.0 / 20.0
"""Highest bandwidth of the current loops as a share of the PWM frequency: no outer loop needs more, and the voltage that a single step
of the converter causes grows with it."""
SPEED_CAP = 0.3125
"""Highest bandwidth of the speed loop over the electrical frequency at the lowest speed, if loads allow it (LOAD_DIP). Without load the
currents lie where the dead time's compensation is only linear; the voltage that is missing there looks like back-EMF, and the estimator
rejects it no faster than the motor turns. On the virtual board the Hurst hunts by 4 % of its speed from 0.34 on; all six are calm here."""
LOAD_DIP = 0.18
"""Share of the lowest speed that half the rated torque may take when it comes in half a second: what grows steadily is held by the
integral alone, error = dT/dt / (J (2 pi f)^2 / ZERO_RATIO)."""
ZERO_RATIO = 3.0
"""The speed controller's zero lies at the bandwidth / 3 (SPEEDCNTR_ITERM in param_scaling.h): the integral is what holds a load that grows, and a
lower bandwidth with more of it is calmer at low speed than the other way round."""
SLOW_PHASES = 8
CURRENT_TOP = 1.0 / 12.0
"""Taken above the cap only for a motor whose rotation at top speed would cost the margin below it."""
CURRENT_NEARLY_DEG = 5.0
"""Where no bandwidth of the current loops has the margin, the one nearest the cap that has so little less than the best: rotation takes the
margin then, and a loop twenty times slower would gain three degrees and leave the speed loop nothing to stand on."""
TOLERANCE = {"rs": (0.9, 1.3), "ls": (0.8, 1.2), "psi": (0.9, 1.1)}
"""Parameter set of every motor, as factors: R 10 % below the sheet up to copper at 100 degC, L and flux as sheets leave them open."""


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
    """Controller gains in SI: V/A, V/A a period; A per electrical rad/s and that in 8 periods. Filters per period."""

    kp_d: float
    kp_q: float
    ki: float
    speed_kp: float
    speed_ki: float
    esdq: float
    velestim: float
    period_s: float


@dataclass(frozen=True)
class Margins:
    """Margins of one loop in one case."""

    phase_deg: float
    gain_db: float
    crossover_hz: float

    @property
    def stable(self) -> bool:
        """A loop that still has gain where its phase has gone beyond -180 degrees is not, and its margins are no margins."""
        return self.phase_deg > 0.0

    @property
    def enough(self) -> bool:
        return self.phase_deg >= PHASE_MARGIN_DEG and self.gain_db >= GAIN_MARGIN_DB


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
    return (kp + gains.ki / (z - 1.0)) * b * (z + h * turn) / (z * (z - h * h * turn))


def estimator(hz: np.ndarray, gains: Gains, omega_e: float, strength: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """From true to estimated speed, and from an error of the back-EMF (over psi) to it. `strength`: true psi over assumed psi."""
    z = np.exp(2j * np.pi * hz * gains.period_s)
    f = gains.esdq / (1.0 - (1.0 - gains.esdq) / z)
    integrator = gains.period_s / (z - 1.0)
    closed = 1.0 + strength * f * omega_e * integrator
    return strength * f * (1.0 + omega_e * integrator) / closed, f / closed


def speed_loop(hz: np.ndarray, true: Plant, assumed: Plant, gains: Gains, omega_e: float) -> np.ndarray:
    """Open speed loop of a motor `true` with controllers made for `assumed`."""
    ts, s = gains.period_s, 2j * np.pi * hz
    slow = SLOW_PHASES * ts
    controller = (gains.speed_kp + gains.speed_ki / (np.exp(s * slow) - 1.0)) * (1.0 - np.exp(-s * slow)) / (s * slow)
    inner = current_loop(hz, true, gains, 0.0)
    shaft = true.kt * true.pole_pairs / (true.inertia * s + true.viscous)
    speed, error = estimator(hz, gains, omega_e, true.psi / assumed.psi)
    wrong = (true.rs - assumed.rs + s * (true.lq - assumed.lq)) / assumed.psi
    z = np.exp(s * ts)
    filtered = gains.velestim / (1.0 - (1.0 - gains.velestim) / z)
    return controller * inner / (1.0 + inner) * (shaft * speed + wrong * error) * filtered * np.exp(-1.5 * s * ts)


def margins(hz: np.ndarray, response: np.ndarray) -> Margins:
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
    return Margins(float(phase), float(gain), float(where))


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


def _worst(cases: Iterable[tuple[str, Callable[[], Margins]]], stop: bool) -> tuple[Margins, str]:
    """The case with the least phase margin; with `stop`, the first one that is not enough."""
    worst, label = Margins(180.0, 60.0, float("nan")), ""
    for name, compute in cases:
        found = compute()
        if found.phase_deg < worst.phase_deg or not label:
            worst, label = Margins(found.phase_deg, min(found.gain_db, worst.gain_db), found.crossover_hz), name
        elif found.gain_db < worst.gain_db:
            worst = Margins(worst.phase_deg, found.gain_db, worst.crossover_hz)
        if stop and not worst.enough:
            break
    return worst, label


def _largest(candidates: list[float], worst_of: Callable[[float, bool], tuple[Margins, str]],
             nearly_deg: float = 0.0) -> tuple[float, Margins, str]:
    """The largest candidate with enough margin; if there is none, the first one that is within `nearly_deg` of the most."""
    for candidate in candidates:
        if worst_of(candidate, True)[0].enough:
            return candidate, *worst_of(candidate, False)
    results = [(candidate, *worst_of(candidate, False)) for candidate in candidates[:: max(1, len(candidates) // 20)]]
    most = max(item[1].phase_deg for item in results)
    return next(item for item in results if item[1].phase_deg >= most - nearly_deg)


def current_gains(plant: Plant, bandwidth_hz: float, base: Gains) -> Gains:
    """Pole-zero cancellation: Kp = 2 pi f L of each axis, Ki = 2 pi f R."""
    w = 2.0 * np.pi * bandwidth_hz
    return replace(base, kp_d=w * plant.ld, kp_q=w * plant.lq, ki=w * plant.rs * base.period_s)


def speed_gains(plant: Plant, bandwidth_hz: float, base: Gains) -> Gains:
    """Kp = 2 pi f J/Kt per mechanical, i.e. / P per electrical rad/s; zero at f/3."""
    w = 2.0 * np.pi * bandwidth_hz
    kp = w * plant.inertia / plant.kt / plant.pole_pairs
    return replace(base, speed_kp=kp, speed_ki=kp * w / ZERO_RATIO * SLOW_PHASES * base.period_s)


def design_current(plant: Plant, spread: dict[str, tuple[float, float]], base: Gains, top_rad_s: float, largest_hz: float, least_hz: float,
                   fixed_hz: float | None = None) -> LoopDesign:
    """Bandwidth of the current loops, margins at standstill and at the highest electrical speed."""
    grid = current_grid(base.period_s)
    axes = ("q",) if plant.ld == plant.lq else ("d", "q")
    cases = {f"{name}, {'standstill' if w == 0.0 else 'top speed'}" + (f", {axis} axis" if len(axes) > 1 else ""): (p, w, axis)
             for name, p in corners(plant, spread) if p.psi == plant.psi for w in (0.0, top_rad_s) for axis in axes}

    def worst_of(bandwidth_hz: float, stop: bool) -> tuple[Margins, str]:
        gains = current_gains(plant, bandwidth_hz, base)
        return _worst(((label, lambda case=case: margins(grid, current_loop(grid, case[0], gains, *case[1:])))
                       for label, case in cases.items()), stop)

    cap = min(CURRENT_CAP / base.period_s, largest_hz)
    above = [f for f in _steps(min(CURRENT_TOP / base.period_s, largest_hz), cap, 0.95) if f > cap][::-1]
    candidates = [fixed_hz] if fixed_hz else _steps(cap, max(least_hz, cap / 20.0), 0.95) + above
    chosen, worst, label = _largest(candidates, worst_of, CURRENT_NEARLY_DEG)
    gains = current_gains(plant, chosen, base)
    shown = dict.fromkeys([*list(cases)[:2 * len(axes)], label])
    return _made(chosen, worst, label, grid, {name: current_loop(grid, cases[name][0], gains, *cases[name][1:]) for name in shown})


def _made(chosen: float, worst: Margins, label: str, grid: np.ndarray, responses: dict[str, np.ndarray]) -> LoopDesign:
    """A design with the curves that the report shows, the nominal one first."""
    curves = [Curve(name, grid, response, margins(grid, response)) for name, response in responses.items()]
    return LoopDesign(chosen, worst, label, curves[0].margins, curves)


def _steps(highest: float, lowest: float, ratio: float) -> list[float]:
    """From the highest down by a constant ratio, rounded down to two digits."""
    found: list[float] = []
    value = highest
    while value >= lowest * 0.999:
        digits = 10.0 ** (np.floor(np.log10(value)) - 1.0)
        rounded = float(f"{np.floor(value / digits + 1e-9) * digits:.6g}")
        if rounded >= lowest * 0.999 and rounded not in found:
            found.append(rounded)
        value *= ratio
    return found or [lowest]


def least_speed_bandwidth(torque_nm_s: float, inertia: float, lowest_rad_s: float) -> float:
    """Bandwidth that holds a torque growing at this rate within LOAD_DIP of the lowest (mechanical) speed."""
    return float(np.sqrt(torque_nm_s * ZERO_RATIO / (inertia * LOAD_DIP * lowest_rad_s)) / (2.0 * np.pi))


def design_speed(plant: Plant, spread: dict[str, tuple[float, float]], base: Gains, speeds_rad_s: dict[str, float], largest_hz: float,
                 least_hz: float, fixed_hz: float | None = None) -> LoopDesign:
    """Bandwidth of the speed loop: the largest with enough margin at every speed of `speeds_rad_s` (name: electrical rad/s)."""
    grid = np.geomspace(0.05, 0.45 / (SLOW_PHASES * base.period_s), 400)
    cases = {f"{name}, {at}": (p, w) for name, p in corners(plant, spread) for at, w in speeds_rad_s.items()}

    def worst_of(bandwidth_hz: float, stop: bool) -> tuple[Margins, str]:
        gains = speed_gains(plant, bandwidth_hz, base)
        return _worst(((label, lambda case=case: margins(grid, speed_loop(grid, case[0], plant, gains, case[1])))
                       for label, case in cases.items()), stop)

    chosen, worst, label = _largest([fixed_hz] if fixed_hz else _steps(largest_hz, least_hz, 0.93), worst_of)
    if fixed_hz is None and worst.enough: # now to three digits
        step = 10.0 ** (np.floor(np.log10(chosen)) - 2.0)
        finer = [float(f"{chosen + k * step:.3g}") for k in range(30, -1, -1)]
        chosen, worst, label = _largest([f for f in finer if f <= largest_hz], worst_of)
    gains = speed_gains(plant, chosen, base)
    nominal = list(cases)[:len(speeds_rad_s)]
    shown = dict.fromkeys([nominal[0], nominal[-1], label])
    return _made(chosen, worst, label, grid, {name: speed_loop(grid, cases[name][0], plant, gains, cases[name][1]) for name in shown})
