"""A load that grows on a slowly turning rotor: the speed loop's own model, for what it holds and what stops the rotor.

What decides at low speed is how soon the drive sees the load, for its rates fall with the speed (include/control/observer.h): a light rotor stands
before. The model has the shaft, the current loop as a lag, Equation 4's filter and the estimator's angle, the load observer at its three rates with
its gate, and the speed controller; electrical rad/s, A, N m. Dead time and the converter's steps are left out, so MARGIN is added."""

import ctypes
import functools
import math
from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np

from tools.bench import case, loadsteps, lowspeed, reach
from tools.common import motor_file, paths
from tools.common.param_rows import number, slow_periods

from . import compiled, constants, limits
from .design_result import Design
from .limits import RPM
from .loops import ESDQ_RATIO, FAST_GAIN, FULL_RATIO, LOADED_SHARE, QUIET_RATIO

LOWSPEED = lowspeed.Table.read(paths.TABLES / "lowspeed.toml")
ONSET_S, CURRENT_SHARE = LOWSPEED.torque_over_s, LOWSPEED.current_percent / 100.0
"""What `make lowspeed` asks for: the load comes within this time, and takes so much of the largest current at most."""
LOADSTEPS = loadsteps.Table.read(paths.TABLES / "loadsteps.toml")
STEP_SHARE = min(LOADSTEPS.speeds_rpm) / motor_file.load(LOADSTEPS.motor).rated_speed_rpm
"""The lowest speed of `make loadsteps` over the rated one."""
MARGIN = 1.15
"""Of the speed that the model holds. With it 16 loads on 8 motors that their rotor's inertia limits were named 0.89 to 1.16 of the lowest speed that
the virtual board held."""
AFTER_S, LONGEST_S = 0.6, 10.0
"""How long the rotor has for coming back, at least and at most: in between one period of the speed loop's bandwidth."""
LOST_RAD, BACK_SHARE = 1.2, 0.9
"""Angle error that no lock survives; share of its speed to which the rotor must have come back."""
LOAD_FROM_LOST, GATE, GATE_LOADED = (number(name) for name in ("PARAM_LOAD_FROM_LOST", "GATE_SHARE", "GATE_LOADED_SHARE"))
LAW = (ESDQ_RATIO, FAST_GAIN, 2.0 ** number("OBSERVER_GATE_SPEED_SHIFT"), 2.0 ** number("OBSERVER_GATE_SHIFT"), number("OBSERVER_GATE_STEPS"),
       1.0 - 2.0 ** -number("OBSERVER_FAST_FADE_SHIFT"), number("OBSERVER_FAST_HALF_Q15") / 32768.0, 2.0 ** (number("OBSERVER_GATE_OPEN_SHIFT") - 15.0), LOST_RAD)
"""What follows the drive's own numbers in load_onset.c."""
SPEEDS, PARTS = 60, 20
"""How many speeds between the nominal and the minimum one are tried; parts of a load."""


@dataclass
class Drive:
    """Shaft and controllers."""

    step_s: float
    per_amp: float
    """electrical rad/s2 per A"""
    per_nm: float
    pull_a: float
    """friction"""
    psi: float
    filter_rad_s: float
    current_rad_s: float
    full_rad_s: float
    quiet: float
    loaded: float
    fast: float
    """rates times the step"""
    gain: float
    load_from_a: float
    gate: float
    gate_loaded: float
    most_a: float

    @classmethod
    def of(cls, d: Design, inertia: float) -> "Drive":
        m, b, loop = d.motor, d.board, d.speed_loop
        step_s, dead_v = slow_periods(b.pwm_period_s) * b.pwm_period_s, b.nominal_bus_v * b.dead_time_s / b.pwm_period_s
        rate = 2.0 * math.pi * step_s
        loaded = LOADED_SHARE * rate * loop.load_hz
        return cls(step_s, m.kt_nm_per_a * m.pole_pairs / inertia, m.pole_pairs / inertia, d.envelope.friction_nm(d.value("MINIMUM_SPEED_RPM")) / m.kt_nm_per_a,
                   m.psi_vs, 2.0 * math.pi * constants.filter_hz(d.value("KFILTER_ESDQ"), b.pwm_period_s),
                   2.0 * math.pi * d.value("CURRENT_BANDWIDTH_HZ"), 2.0 * math.pi * loop.load_hz / FULL_RATIO,
                   min(rate * QUIET_RATIO * loop.bandwidth_hz, loaded), loaded, rate * loop.load_hz,
                   2.0 * math.pi * loop.bandwidth_hz * inertia / m.kt_nm_per_a / m.pole_pairs, LOAD_FROM_LOST * d.scales.lost_counts * d.scales.count_a,
                   GATE * dead_v / m.psi_vs, GATE_LOADED * dead_v / m.psi_vs, d.value("MAXIMUM_CURRENT_A"))


@functools.cache
def _program() -> Callable[..., float]:
    """load_onset of load_onset.c: a speed to name takes a hundred runs of the model."""
    array = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    found = compiled.library(paths.ROOT / "tuning" / "load_onset.c").load_onset
    found.argtypes, found.restype = (array, ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_size_t), ctypes.c_double
    return found


def asked_nm(d: Design) -> float:
    """The rated torque, as far as the current allows; friction comes on top."""
    return min(d.motor.rated_torque_nm, CURRENT_SHARE * d.value("MAXIMUM_CURRENT_A") * d.motor.kt_nm_per_a)


def step_rpm(d: Design) -> float:
    """The lowest speed at which `make loadsteps` closes the brake."""
    return case.three_digits(STEP_SHARE * d.motor.rated_speed_rpm)


def answer_s(d: Design) -> float:
    """How soon the drive answers a load."""
    return reach.answer_s({"LOOPTIME_SEC": d.board.pwm_period_s, **{name: d.value(name) for name in ("KFILTER_ESDQ", "CURRENT_BANDWIDTH_HZ", "LOAD_BANDWIDTH_HZ")}})


def held(d: Design, rpm: float, load_nm: float, inertia: float = 0.0, over_s: float = ONSET_S) -> bool:
    """Whether the rotor is back at its speed after a load has come within a time; with another inertia, if one is given."""
    drive = Drive.of(d, inertia or d.inertia_kgm2)
    reference = rpm * RPM * d.motor.pole_pairs
    bandwidth_hz = d.speed_loop.bandwidth_hz * min(2.0 * reference / drive.full_rad_s, 1.0)
    steps = int((over_s + min(max(1.0 / bandwidth_hz, AFTER_S), LONGEST_S)) / drive.step_s)
    return _program()(np.array([*astuple(drive), *LAW]), reference, load_nm, over_s, steps) > BACK_SHARE * reference


def holds(d: Design, rpm: float, load_nm: float, inertia: float = 0.0) -> bool:
    """The same with MARGIN: whether the motor is sure to hold it."""
    return held(d, rpm / MARGIN, load_nm, inertia)


def lowest_rpm(d: Design, load_nm: float) -> float | None:
    """The lowest speed from which on the load is held, to two digits; None if it is not held at the nominal speed."""
    least, found = d.value("MINIMUM_SPEED_RPM"), None
    for rpm in np.geomspace(d.value("NOMINAL_SPEED_RPM"), least, SPEEDS):
        tried = min(limits.digits_up(rpm, 2), d.value("NOMINAL_SPEED_RPM"))
        if not holds(d, tried, load_nm):
            break
        found = tried
    return found


def most_nm(d: Design, rpm: float, load_nm: float) -> float:
    """The largest part of a load that is held at a speed, in twentieths; 0 for none."""
    held_nm = 0.0
    for share in range(1, PARTS + 1):
        if not holds(d, rpm, load_nm * share / PARTS):
            break
        held_nm = load_nm * share / PARTS
    return held_nm
