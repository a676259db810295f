"""Currents, speeds, voltages and field weakening: what board and motor allow together, by the steady-state voltage equation.

    Vd = R Id - w Lq Iq,   Vq = R Iq + w (Ld Id + psi),   |V| <= circle = highest duty / sqrt(3) * bus
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from tools.common.board_file import BoardFile
from tools.common.motor_file import Motor
from tools.common.param_rows import ENTRIES, number, parameters

from .fw_tables import STEP_ERPM

LARGEST_ERPM, LARGEST_TURN = number("PARAM_LARGEST_ERPM"), number("PARAM_LARGEST_TURN")
UNIT_ERPM = number("SPEED_UNIT_ERPM")
LARGEST_NOMINAL_ERPM = number("PARAM_LARGEST_NOMINAL_ERPM")
"""Of a nominal speed where a count of speed is one electrical rpm."""
TRIP_SHARE = number("PARAM_TRIP_SHARE")
"""Largest over-current threshold as a share of the converter's range."""
TRIP_OVER_MAXIMUM = 1.4
"""Trip level over the largest current that is asked for, where the range allows it: overshoot, noise and the load step's swing."""
LEAST_TRIP_OVER_MAXIMUM = 1.1
TABLE_SHARE = 0.95
"""Share of the circle that the table leaves to the motor without load; the rest is for control, and loads bring the voltage feedback."""
REACH_SHARE = 0.94
"""And at the highest speed: control needs the rest."""
FULL_SHARE = 0.98
"""Share of the circle that a loaded motor may use in steady state."""
D_SHARE = 0.96
"""The drive clamps the d current to 31/32 of the largest current."""
RPM = 2.0 * math.pi / 60.0


def down(value: float, step: float) -> float:
    """The largest multiple of a step that is not above."""
    return math.floor(value / step + 1e-9) * step


def digits_down(value: float, digits: int) -> float:
    """Rounded down to so many significant digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{down(value, step):.10g}")


def digits_up(value: float, digits: int) -> float:
    step = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{math.ceil(value / step - 1e-9) * step:.10g}")


def halved(good: Callable[[float], bool], low: float, high: float, steps: int) -> float:
    """The largest value that is good, where `low` is and `high` is not, to (high - low) / 2^steps."""
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


@dataclass(frozen=True)
class Currents:
    """Peak values."""

    trip_a: float
    maximum_a: float
    board_a: float
    """largest current that this board leaves, given its range, and the firmware's parameter"""


def currents(motor: Motor, board: BoardFile) -> Currents:
    """The trip level lies below the range's end, the largest current below the trip level."""
    highest_trip = down(TRIP_SHARE * board.current_full_scale_a, 0.05 if board.current_full_scale_a > 1.0 else 0.005)
    board_a = min(digits_down(highest_trip / LEAST_TRIP_OVER_MAXIMUM, 3), float(parameters()["MAXIMUM_CURRENT_A"].high))
    maximum_a = min(float(f"{motor.maximum_current_a:.3g}"), board_a)
    return Currents(float(f"{min(digits_down(TRIP_OVER_MAXIMUM * maximum_a, 3), highest_trip):.6g}"), maximum_a, board_a)


@dataclass(frozen=True)
class Envelope:
    """Motor and board as the voltage equation sees them."""

    motor: Motor
    circle_v: float
    maximum_a: float

    def omega(self, rpm: float) -> float:
        """Electrical rad/s."""
        return rpm * RPM * self.motor.pole_pairs

    def friction_nm(self, rpm: float) -> float:
        return self.motor.coulomb_nm + self.motor.viscous_nms * rpm * RPM

    def iq(self, rpm: float, load_nm: float) -> float:
        """q current for a load on top of friction; reluctance torque is left out."""
        return (load_nm + self.friction_nm(rpm)) / self.motor.kt_nm_per_a

    def voltage(self, rpm: float, i_d: float, i_q: float) -> float:
        w, m = self.omega(rpm), self.motor
        return math.hypot(m.rs_ohm * i_d - w * m.lq_h * i_q, m.rs_ohm * i_q + w * (m.ld_h * i_d + m.psi_vs))

    def deepest_id(self, i_q: float) -> float:
        """Most negative d current: current limit, and the characteristic current psi/Ld beyond which more only heats."""
        left = (D_SHARE * self.maximum_a) ** 2 - i_q * i_q
        return -min(math.sqrt(max(left, 0.0)), self.motor.psi_vs / self.motor.ld_h)

    def least_id(self, rpm: float, load_nm: float, share: float) -> float | None:
        """The smallest |Id| that keeps |V| within a share of the circle; None if none does."""
        i_q = self.iq(rpm, load_nm)
        if i_q > self.maximum_a:
            return None
        deepest, limit = self.deepest_id(i_q), share * self.circle_v
        if self.voltage(rpm, 0.0, i_q) <= limit:
            return 0.0
        if self.voltage(rpm, deepest, i_q) > limit:
            return None
        return halved(lambda i_d: self.voltage(rpm, i_d, i_q) <= limit, deepest, 0.0, 50)

    def id_for(self, rpm: float, load_nm: float) -> float:
        """The d current that a load needs; where none is enough, the one with the least voltage that the current limit allows."""
        least = self.least_id(rpm, load_nm, FULL_SHARE)
        if least is not None:
            return least
        return max(self.deepest_id(self.iq(rpm, load_nm)), self.least_voltage_id(rpm))

    def least_voltage_id(self, rpm: float) -> float:
        """The d current of the smallest voltage, d|V|^2/di_d = 0, whatever the q current (but for Lq - Ld)."""
        x = self.omega(rpm) * self.motor.ld_h
        return -self.motor.psi_vs / self.motor.ld_h * x * x / (self.motor.rs_ohm ** 2 + x * x)

    def base_speed(self, load_nm: float) -> float:
        """Speed at which the motor without d current needs the whole circle."""
        return self._highest(lambda rpm: self.voltage(rpm, 0.0, self.iq(rpm, load_nm)) <= self.circle_v)

    def highest_speed(self, load_nm: float, share: float) -> float:
        """Speed that field weakening reaches."""
        return self._highest(lambda rpm: self.least_id(rpm, load_nm, share) is not None)

    def torque(self, rpm: float, share: float) -> float:
        """Largest load at a speed."""
        if self.least_id(rpm, 0.0, share) is None:
            return 0.0
        return halved(lambda load_nm: self.least_id(rpm, load_nm, share) is not None, 0.0, self.most_nm, 40)

    @property
    def most_nm(self) -> float:
        """More torque than the largest current gives."""
        return 1.2 * self.motor.kt_nm_per_a * self.maximum_a

    def _highest(self, holds: Callable[[float], bool]) -> float:
        highest = 2.0 * 65535.0 / self.motor.pole_pairs
        return highest if holds(highest) else halved(holds, 0.0, highest, 50)


def largest_erpm(period_s: float) -> float:
    """Where the firmware's speeds end with this PWM period."""
    return min(LARGEST_ERPM, max(UNIT_ERPM, LARGEST_TURN / period_s * (1.0 + 1e-6)))


def fit_emf(motor: Motor, board: BoardFile, wanted: Currents) -> Currents:
    """Lowers first the trip level, then the largest current, until Equation 4 stays inside its format (a relation of param_h).
    Gives up at half the rated current; the relation's own message tells then."""
    fastest = max(min(motor.maximum_speed_rpm, largest_erpm(board.pwm_period_s) / motor.pole_pairs), 1.5 * motor.rated_speed_rpm) * RPM * motor.pole_pairs
    room_v = 0.985 * 4.0 * board.nominal_bus_v / math.sqrt(3.0) * (1.0 - board.dead_time_s / board.pwm_period_s) - board.over_voltage_v / math.sqrt(3.0)

    def fits(trip_a: float, maximum_a: float) -> bool:
        return 2.0 / math.sqrt(3.0) * trip_a * motor.rs_ohm + fastest * 1.2 * motor.lq_h * maximum_a < room_v

    trip, maximum = wanted.trip_a, wanted.maximum_a
    while not fits(trip, maximum) and maximum > 0.5 * motor.rated_current_a:
        if trip > 1.02 * LEAST_TRIP_OVER_MAXIMUM * maximum:
            trip = float(f"{max(0.98 * trip, LEAST_TRIP_OVER_MAXIMUM * maximum):.3g}")
        else:
            maximum = float(f"{0.97 * maximum:.3g}")
            trip = float(f"{1.001 * LEAST_TRIP_OVER_MAXIMUM * maximum:.3g}")
    return Currents(trip, maximum, wanted.board_a) if fits(trip, maximum) else wanted


def of_period(erpm: float) -> str:
    """A shorter PWM period would allow more."""
    return " with this PWM period" if erpm < LARGEST_ERPM else ""


def circle_v(board: BoardFile) -> float:
    """Radius of the voltage circle at the nominal bus: the sampling window takes its share of the duty."""
    return (1.0 - 2.0 * board.sample_window_s / board.pwm_period_s) * board.nominal_bus_v / math.sqrt(3.0)


def fw_start_rpm(envelope: Envelope, maximum_rpm: float) -> float:
    """Where entry 0 lies: seven eighths of the no-load base speed (the last eighth belongs to loads and a sagging supply), but so that the
    18 entries still reach the maximum speed, below the maximum speed, and within the parameter's range."""
    step = 50.0 if maximum_rpm >= 1000.0 else 1.0
    start = down(0.875 * envelope.base_speed(0.0), step)
    reach = maximum_rpm - (ENTRIES - 1) * STEP_ERPM / envelope.motor.pole_pairs
    row = parameters()["FW_START_SPEED_RPM"]
    return max(min(max(start, math.ceil(reach / step) * step), down(0.95 * maximum_rpm, step), float(row.high)), float(row.low))


def table(envelope: Envelope, start_rpm: float) -> list[float]:
    """d current of the 18 entries from the voltage equation; where no current suffices, the deepest one stays."""
    found: list[float] = []
    for i in range(ENTRIES):
        rpm = start_rpm + i * STEP_ERPM / envelope.motor.pole_pairs
        least = envelope.least_id(rpm, 0.0, TABLE_SHARE)
        if least is None:
            least = envelope.deepest_id(envelope.iq(rpm, 0.0))
        found.append(min(least, found[-1]) if found else 0.0)
    return [float(f"{-down(-x, 0.01):.2f}") + 0.0 for x in found]
