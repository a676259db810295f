"""The start: current, lock, ramp and the speed at which the estimator takes over, each by a rule, then tried on the rotor's equation.

A forced current vector I pulls the rotor with Kt I sin(angle between them): a spring of P Kt I per rad, hardly damped.
"""

import ctypes
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tools.common.board_file import BoardFile
from tools.common.motor_file import Motor
from tools.common.param_rows import number, parameters
from tools.common.paths import ROOT

from . import compiled
from .limits import RPM, digits_down, digits_up
from .loops import Gains, Plant, current_loop

SOURCE = ROOT / "tuning" / "start_trial.c"
CURRENT_SHARE = 0.92
"""Start current over rated current: the start is short, so the rated current costs nothing, and more of it holds the rotor more firmly."""
TRIP_HEADROOM = 1.3
"""The trip level over the start current, unless the load asks for more: a rotor that swings half a turn into the lock induces faster than
the current loop gives way, and the current rises by a fifth."""
LOAD_ANGLE_SINE = 0.77
"""Share of the pull-out torque that load and friction may take: 50 degrees of load angle."""
RAMP_TORQUE_SHARE = 0.15
"""Share of the pull-out torque for acceleration."""
RAMP_S = 1.4
"""Duration of the ramp, as in AN1292, unless inertia asks for more."""
R_ERROR = 0.30
DEAD_TIME_ERROR = 0.20
"""Share of the dead-time voltage that compensation leaves."""
HAND_OVER_SINE = 0.35
"""Sine of the angle error (20 degrees) that the estimator may have at the hand-over."""
LEAST_LOCK_S = 0.3
LOCK_SWINGS = 32.0
"""The lock lasts so many periods of the rotor's swing at least: while the current grows, the swing of a rotor that it takes along dies away."""
LOCK_TURNS = number("PARAM_ALIGN_TURNS")
MOST_BACK_RPM = 230.0
"""The lock is longer where the rotor would be thrown back faster: dead time and the current loop add a tenth."""
BACK_LOCK_S = 1.6
"""The longest lock for that alone: more would gain little."""
LARGEST_RATE = 2000
LARGEST_END_RPM = 10000.0
LEAST_ERPM = 100.0
"""Speeds are whole electrical rpm: less would be coarser than a hundredth."""
SAMPLE_AFTER_MEAN_S = 25e-9 * number("SAMPLE_DELAY_CLOCKS")
"""Between the two the back-EMF takes E t/L off the current, which the loop then adds."""
CALM_SHARE = 0.03
"""Share of the hand-over speed by which the rotor may still swing about it without a longer lock: the hand-over overshoots by several times that."""
LOWEST_SHARE = number("PARAM_LOWEST_SHARE")
LOUD_SHARE = 0.1
"""Share beyond which starts fail from some angles."""


NAMES = ("LOCK_TIME", "Q_CURRENT_REF_OPENLOOP", "OPENLOOP_RAMPSPEED_INCREASERATE", "END_SPEED_RPM")
"""What a start is made of; a motor file's [tune] may fix each."""
CALMER_SHARE = 0.8 * LOUD_SHARE
"""A swing that is surely calm: other current loops, which a change brings with it, may leave more."""
CALMER_CURRENTS, CALMER_ENDS, CALMEST_END_SHARE = (1.0, 0.85, 0.7), (1.15, 1.3, 1.45), 0.75
"""Where the lock cannot be long enough: less current swings less, and at a higher speed the same swing matters less. Shares of the rules' values; the speed
at the end is at most so much of the nominal one."""


@dataclass(frozen=True)
class StartDesign:
    """The start's parameters in SI and what they were made from."""

    current_a: float
    end_speed_rpm: float
    lowest_speed_rpm: float
    """at which this motor can be held"""
    minimum_speed_rpm: float
    lock_s: float
    rate: int
    """OPENLOOP_RAMPSPEED_INCREASERATE"""
    acceleration_rpm_s: float
    ramp_s: float
    pull_out_nm: float
    needed_nm: float
    natural_hz: float
    damping: float
    error_v: float
    """error of the back-EMF at the hand-over"""
    emf_v: float
    follows: bool
    trial: "Trial"

    @property
    def loud(self) -> bool:
        """True if the lock's swing lasts until the estimator takes over."""
        return self.trial.swing_rpm > LOUD_SHARE * self.end_speed_rpm


@dataclass(frozen=True)
class Trial:
    """Lock and ramp on the rotor's equation of motion: one column for each start angle and load."""

    time_s: np.ndarray
    speed_rpm: np.ndarray
    forced_rpm: np.ndarray
    followed: np.ndarray
    labels: list[str]
    swing_rpm: float
    """largest swing about the forced speed that is left at the hand-over"""
    back_rpm: float
    """largest speed against the direction"""


def emf_error_v(motor: Motor, board: BoardFile, current_a: float) -> float:
    """Error of Equation 4: R wrong by 30 %, a fifth of the dead time's voltage (4/pi Vbus Td/Ts), one step of the converter through R."""
    dead = 4.0 / math.pi * board.nominal_bus_v * board.dead_time_s / board.pwm_period_s
    step = 2.0 * board.current_full_scale_a / 2 ** board.adc_bits
    return R_ERROR * motor.rs_ohm * current_a + DEAD_TIME_ERROR * dead + motor.rs_ohm * step


def emf_v(motor: Motor, rpm: float) -> float:
    """Phase back-EMF, peak."""
    return motor.psi_vs * rpm * RPM * motor.pole_pairs


def start_current(motor: Motor, maximum_a: float, trip_a: float, needed_nm: float) -> float:
    """The larger of 92 % of the rated current (within the trip level's headroom) and what the load needs at 50 degrees of load angle; within
    the drive's largest current."""
    wanted = max(min(CURRENT_SHARE * motor.rated_current_a, trip_a / TRIP_HEADROOM), needed_nm / (motor.kt_nm_per_a * LOAD_ANGLE_SINE))
    return float(f"{min(wanted, digits_down(0.98 * maximum_a, 3)):.3g}")


def needed_torque(motor: Motor, end_rpm: float) -> float:
    """Load while starting, friction at the end of the ramp; acceleration comes on top."""
    return motor.start_torque_nm + motor.coulomb_nm + motor.viscous_nms * end_rpm * RPM


QUICK_HZ = number("PARAM_EARLY_HZ")


def end_speed(motor: Motor, board: BoardFile, current_a: float, nominal_rpm: float) -> float:
    """Hand-over speed: back-EMF = error / sin(20 degrees), at least a fifth of nominal speed (twice the speed where Equation 2 takes its
    sign from Eq) and QUICK_HZ, where the load observer is quick enough to catch the rotor; at most half of nominal speed."""
    wanted = max(emf_error_v(motor, board, current_a) / HAND_OVER_SINE / emf_v(motor, 1.0), 0.2 * nominal_rpm, 60.0 * QUICK_HZ / motor.pole_pairs)
    step = 50.0 if wanted > 300.0 else 10.0 if wanted > 50.0 else 1.0
    return min(math.ceil(wanted / step - 1e-9) * step, digits_down(0.5 * nominal_rpm, 2), LARGEST_END_RPM)


def lowest_speed(motor: Motor, board: BoardFile) -> float:
    """Back-EMF LOWEST_SHARE of the dead-time voltage: below, what compensation leaves takes the estimator's lock from a rotor under load."""
    return LOWEST_SHARE * board.nominal_bus_v * board.dead_time_s / board.pwm_period_s / emf_v(motor, 1.0)


def minimum_speed(motor: Motor, board: BoardFile) -> float:
    """The lowest speed, rounded up to 10 rpm, or to 1 rpm below 50; nothing asks for less than 50 rpm of a motor that turns at 500."""
    lowest = lowest_speed(motor, board)
    step = 10.0 if lowest > 50.0 else 1.0
    quiet = max(digits_up(0.1 * motor.rated_speed_rpm, 2), math.ceil(LEAST_ERPM / motor.pole_pairs))
    return max(math.ceil(lowest / step - 1e-3) * step, min(50.0, quiet))


def natural_rad_s(motor: Motor, current_a: float, inertia: float) -> float:
    """sqrt(P Kt I / J)"""
    return math.sqrt(motor.pole_pairs * motor.kt_nm_per_a * current_a / inertia)


def lock_by_rule_s(omega: float) -> float:
    """Thirty-two swings of the rotor at the full current, before the trial lengthens it."""
    return max(LEAST_LOCK_S, math.ceil(LOCK_SWINGS * 2.0 * math.pi / omega / 0.05) * 0.05)


def damping_nms(motor: Motor, plant: Plant, gains: Gains, omega: float) -> float:
    """Viscous friction and what the current loop adds: the swing's back-EMF drives a current through the loop's admittance, less what the
    sample after the pulse's centre makes of it. Negative where that is more: a small inductance lets the swing grow."""
    hz = np.array([omega / (2.0 * math.pi)])
    h = math.exp(-plant.rs * gains.period_s / plant.lq)
    open_plant = (1.0 - h) / plant.rs / (np.exp(1j * omega * gains.period_s) - h)
    admittance = (open_plant / (1.0 + current_loop(hz, plant, gains, 0.0)))[0]
    return motor.viscous_nms + 1.5 * (motor.pole_pairs * motor.psi_vs) ** 2 * (float(admittance.real) - SAMPLE_AFTER_MEAN_S / plant.lq)


def ramp_rate(motor: Motor, board: BoardFile, current_a: float, end_rpm: float, inertia: float) -> int:
    """Counts of 1/1024 a period: 1.4 s to the end speed, or slower so that J alpha takes 15 % of the pull-out torque at most."""
    largest = RAMP_TORQUE_SHARE * motor.kt_nm_per_a * current_a / inertia / RPM
    return max(1, min(LARGEST_RATE, round(min(end_rpm / RAMP_S, largest) / rpm_s_of_rate(motor, board, 1))))


def rpm_s_of_rate(motor: Motor, board: BoardFile, rate: float) -> float:
    return rate / 67108864.0 / board.pwm_period_s ** 2 * 60.0 / motor.pole_pairs


@functools.cache
def _program() -> Callable[..., float]:
    """start_trial of start_trial.c: the sums of a trial are a hundred times those of all other rules together."""
    array = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    found = compiled.library(SOURCE).start_trial
    found.argtypes, found.restype = (array, array, ctypes.c_size_t, ctypes.c_size_t, ctypes.c_size_t, array), ctypes.c_double
    return found


def try_start(motor: Motor, inertia: float, damping: float, current_a: float, lock_s: float, acceleration_rpm_s: float, end_rpm: float,
              angles: int = 24) -> Trial:
    """Integrates J dw/dt = Kt I(t) sin(P (forced - rotor)) - friction - load for all start angles, without load and with the start load.

    `forced` is the current's angle: it begins on phase A, a quarter of a turn ahead of the frame, whose q axis it lies on.
    """
    loads = (0.0, motor.start_torque_nm)
    step = min(400e-6, 0.1 / natural_rad_s(motor, current_a, inertia))
    ramp_s = end_rpm / acceleration_rpm_s
    count = int((lock_s + ramp_s + 0.1) / step)
    pull, pairs = motor.kt_nm_per_a * current_a, motor.pole_pairs
    dry = np.repeat(np.array(loads), angles) + motor.coulomb_nm
    columns = np.zeros((len(dry), 6))
    rotor, locked, lowest = columns[:, 2], columns[:, 4], columns[:, 5]
    columns[:, 0], columns[:, 1] = dry, dry * step / inertia
    rotor[:] = np.tile(np.arange(angles) * 2.0 * math.pi / angles, len(loads))
    shared = np.array([step, lock_s, pull, pairs, motor.viscous_nms, damping - motor.viscous_nms, 2.0 * math.pi * LOCK_TURNS / lock_s, acceleration_rpm_s,
                       end_rpm * RPM * pairs, step / inertia, RPM])
    every = max(1, count // 800)
    kept = np.empty((-(-count // every), 2 + len(dry)))
    forced = _program()(shared, columns, len(dry), count, every, kept)
    # The current passes a rotor while it is weak. One that follows the ramp ends within a quarter of a turn of it, and in the same turn as it began.
    turns = (rotor - forced) / (2.0 * math.pi)
    slipped = np.abs(turns - np.round(turns)) > 0.25
    lost = np.round(turns) - np.round(locked / (2.0 * math.pi)) < -0.5
    labels = [f"{360.0 * i / angles:.0f} deg, {load:.3g} N m" for load in loads for i in range(angles)]
    times, forced_rpm, rotor_rpm = kept[:, 0], kept[:, 1] / pairs / RPM, kept[:, 2:] / RPM
    last = times > times[-1] - 0.1 # the plateau at the end speed
    return Trial(times, rotor_rpm, forced_rpm, ~(slipped | lost), labels, float(np.abs(rotor_rpm[last] - forced_rpm[last, None]).max()),
                 max(0.0, -float(lowest.min())) / RPM)


def design_start(motor: Motor, board: BoardFile, plant: Plant, gains: Gains, maximum_a: float, trip_a: float, nominal_rpm: float,
                 fixed: dict[str, float]) -> StartDesign:
    """All of it. `fixed` holds what the motor file's [tune] says; the trial only changes what is not fixed."""
    first = needed_torque(motor, 0.3 * nominal_rpm)
    current = fixed.get("Q_CURRENT_REF_OPENLOOP") or start_current(motor, maximum_a, trip_a, first)
    end = fixed.get("END_SPEED_RPM") or end_speed(motor, board, current, nominal_rpm)
    design = _timed(motor, board, plant, gains, current, end, fixed)
    if not design.loud or set(NAMES) & set(fixed):
        return design
    others = (_timed(motor, board, plant, gains, float(f"{share * current:.3g}"), digits_up(factor * end, 2), fixed)
              for share in CALMER_CURRENTS if share * current >= design.needed_nm / (motor.kt_nm_per_a * LOAD_ANGLE_SINE)
              for factor in CALMER_ENDS if factor * end <= CALMEST_END_SHARE * nominal_rpm)
    return next((other for other in others if other.follows and other.trial.swing_rpm <= CALMER_SHARE * other.end_speed_rpm), design)


def _timed(motor: Motor, board: BoardFile, plant: Plant, gains: Gains, current: float, end: float, fixed: dict[str, float]) -> StartDesign:
    """Lock and ramp for a current and a speed at the end."""
    inertia = motor.inertia_kgm2 + motor.load_inertia_kgm2
    minimum = fixed.get("MINIMUM_SPEED_RPM") or minimum_speed(motor, board)
    rate = int(fixed.get("OPENLOOP_RAMPSPEED_INCREASERATE", 0)) or ramp_rate(motor, board, current, end, inertia)
    omega = natural_rad_s(motor, current, inertia)
    damping = damping_nms(motor, plant, gains, omega)
    lock = fixed.get("LOCK_TIME", 0.0) * board.pwm_period_s or lock_by_rule_s(omega)
    longest = float(parameters()["LOCK_TIME"].high) * board.pwm_period_s
    while True:
        lock = min(lock, longest)
        acceleration = rpm_s_of_rate(motor, board, rate)
        trial = try_start(motor, inertia, damping, current, lock, acceleration, end)
        follows = bool(trial.followed.all())
        if follows and trial.swing_rpm <= CALM_SHARE * end and (trial.back_rpm <= MOST_BACK_RPM or 1.25 * lock > BACK_LOCK_S):
            break
        if "LOCK_TIME" not in fixed and lock < 0.99 * longest and lock < 4.0 * LOCK_SWINGS / omega * 2.0 * math.pi:
            lock *= 1.25
        elif not follows and "OPENLOOP_RAMPSPEED_INCREASERATE" not in fixed and rate > 1 and end / acceleration < 6.0:
            rate = max(1, int(rate * 0.7))
        else:
            break
    needed = needed_torque(motor, end) + inertia * acceleration * RPM
    return StartDesign(current, end, lowest_speed(motor, board), minimum, lock, rate, acceleration, end / acceleration, motor.kt_nm_per_a * current, needed,
                       omega / (2.0 * math.pi), damping / (2.0 * inertia * omega), emf_error_v(motor, board, current), emf_v(motor, end),
                       follows, trial)
