"""A loop as it was measured (response.py) beside the tuner's model of it, with what the firmware uses at that moment."""

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tools.common import motor_file
from tools.common.param_rows import phase_ohm
from tuning import loops

from . import response
from .response import Bench, Point

WITHIN_DEG = 3.0
"""Between the margin that is measured and the model's."""
COLUMNS = ("hz", "measured_db", "measured_deg", "model_db", "model_deg", "spread")
"""Of a loop's table."""
PARAMS = "board_params"


@dataclass(frozen=True)
class Result:
    """A loop as it was measured, and the model of it at the same frequencies."""

    loop: str
    points: list[Point]
    model: np.ndarray
    speed_rpm: float
    load_nm: float | None
    measured: loops.Margins
    expected: loops.Margins

    @staticmethod
    def of(loop: str, points: list[Point], model: Callable[[np.ndarray], np.ndarray], speed_rpm: float, load_nm: float | None = None) -> "Result":
        """With the margins of both; those of a loop whose gain does not cross 1 are at no frequency."""
        hz = np.array([point.hz for point in points])
        expected = model(hz)
        return Result(loop, points, expected, speed_rpm, load_nm, loops.margins(hz, np.array([point.response for point in points])), loops.margins(hz, expected))

    @property
    def table(self) -> list[list[float]]:
        """A row of COLUMNS for each frequency."""
        return [[point.hz, *(float(number) for value in (point.response, model) for number in decibels_and_degrees(value)), point.spread]
                for point, model in zip(self.points, self.model)]

    @property
    def difference_deg(self) -> float:
        """Of the phase margins."""
        return self.measured.phase_deg - self.expected.phase_deg

    @property
    def holds(self) -> bool:
        """A loop whose gain does not cross 1 where it was measured has shown no margin."""
        return math.isfinite(self.measured.crossover_hz) and abs(self.difference_deg) <= WITHIN_DEG


def decibels_and_degrees(response: complex) -> tuple[float, float]:
    """Gain and phase."""
    return 20.0 * math.log10(abs(response)), math.degrees(cmath.phase(response))


def plants(params: Mapping[str, float], motor: motor_file.Motor | None) -> tuple[loops.Plant, loops.Plant]:
    """The motor, and what the header says of it; without a motor file both are the header's."""
    pairs, lq = int(params["NOPOLESPAIRS"]), 1e-3 * params["MOTOR_LS_MH"]
    psi = params["MOTOR_KPHI_V_PER_KRPM"] / (1000.0 * np.pi / 30.0 * pairs * np.sqrt(3.0))
    header = loops.Plant(phase_ohm(params), lq - 1e-6 * params["MOTOR_SALIENCY_UH"], lq, psi, pairs, params["MOTOR_INERTIA_KGM2"])
    if motor is None:
        return header, header
    return loops.Plant(motor.rs_ohm + params.get("BRIDGE_RS_OHM", 0.0), motor.ld_h, motor.lq_h, motor.psi_vs, motor.pole_pairs, motor.inertia_kgm2 + motor.load_inertia_kgm2,
                       motor.viscous_nms), header


def model_of(loop: str, bench: Bench, motor: motor_file.Motor | None) -> Callable[[np.ndarray], np.ndarray]:
    """The open loop over the frequency. Gains that follow the speed are read from the firmware."""
    true, header = plants(bench.params, motor)
    gains, omega_e = gains_of(bench), abs(bench.speed_rpm()) * bench.params["NOPOLESPAIRS"] * np.pi / 30.0
    if loop == "current":
        if bench.state() != "CLOSED": # without load the rotor's d axis lies along the forced angle's current
            true = replace(true, ld=true.lq, lq=true.ld)
        return lambda hz: of_q_current(hz, true, gains, omega_e)
    return lambda hz: loops.speed_loop(hz, true, header, gains, omega_e)


def of_q_current(hz: np.ndarray, plant: loops.Plant, gains: loops.Gains, omega_e: float) -> np.ndarray:
    """The q axis' loop while that of the d axis is closed. The complex loop of a frame that turns is a + j b at the positive, the conjugate of a - j b at
    the negative frequency: a along each axis, b from one to the other."""
    def parts(axis: str) -> tuple[np.ndarray, np.ndarray]:
        there, back = (loops.current_loop(sign * hz, plant, gains, omega_e, axis) for sign in (1.0, -1.0))
        return 0.5 * (there + np.conj(back)), -0.5j * (there - np.conj(back))
    (along_d, across_d), (along_q, across_q) = parts("d"), parts("q")
    return along_q + across_d * across_q / (1.0 + along_d)


def gains_of(bench: Bench) -> loops.Gains:
    """Those that the firmware uses at this moment; where its parameters are variables, the current loops' too."""
    params, get = bench.params, bench.firmware.get
    per_count = params["COUNT_VOLTAGE_V"] / params["COUNT_CURRENT_A"]
    kp_d, kp_q, ki = ((get(name) / 2.0 ** get(f"{PARAMS}.pi_q.shift") * per_count for name in (f"{PARAMS}.pi_d.kp", f"{PARAMS}.pi_q.kp", f"{PARAMS}.pi_q.ki"))
                      if f"{PARAMS}.pi_q.kp" in bench.firmware.symbols.variables else (params[f"CURRENT_{name}"] for name in ("KP_D", "KP_Q", "KI")))
    rad_s = params["COUNT_SPEED_RPM"] * params["NOPOLESPAIRS"] * np.pi / 30.0
    return loops.Gains(kp_d, kp_q, ki,
                       get(f"{response.RUN}.control.speed_kp_q13") / 8192.0 * params["COUNT_CURRENT_A"] / rad_s,
                       get(f"{response.RUN}.observer.rate_q16") / response.TURN, get(f"{response.RUN}.model.kfilter_esdq_q16") / response.TURN, bench.period_s)
