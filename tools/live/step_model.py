"""A step as it was measured (step.py) beside what the tuner's model answers, with what the firmware uses at that moment."""

import numpy as np

from tools.common import motor_file
from tuning import loops

from . import step
from .response import Bench
from .response_model import gains_of, model_of, plants

CURRENT_STEPS, SPEED_STEPS = 2048, 16384
"""Of the model's answers, until all has died away."""
STEP_BANDWIDTHS = 8.0
"""A speed's record, over its bandwidth."""


def seconds_of(bench: Bench) -> float:
    """A record of the speed."""
    return STEP_BANDWIDTHS / bench.params["SPEED_BANDWIDTH_HZ"]


def answers_of(name: str, bench: Bench, motor: motor_file.Motor | None, load_nm: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Times since a step, and what the model answers."""
    period_s = bench.period_s
    if name == "current":
        hz = np.arange(1, CURRENT_STEPS // 2 + 1) / CURRENT_STEPS / period_s
        loop = model_of("current", bench, motor)(hz)
        return np.arange(CURRENT_STEPS) * period_s, step.answer_of(np.concatenate([[1.0], loop / (1.0 + loop)]))
    true, header = plants(bench.params, motor)
    slow_s, omega_e = bench.slow_s, abs(bench.speed_rpm()) * bench.params["NOPOLESPAIRS"] * np.pi / 30.0
    hz = np.arange(1, SPEED_STEPS // 2 + 1) / SPEED_STEPS / slow_s
    base = gains_of(bench)
    if name == "load": # the innovation's gate opens
        base = loops.speed_gains(header, bench.params["SPEED_BANDWIDTH_HZ"], bench.params["LOAD_BANDWIDTH_HZ"], base, omega_e)["quick"]
    reference, torque = loops.SpeedLoops(hz, header).closed(true, base, omega_e)
    closed = np.concatenate([[1.0], reference]) if name == "speed" else np.concatenate([[0.0], torque * load_nm / omega_e])
    return np.arange(SPEED_STEPS) * slow_s, step.answer_of(closed)


def answer(name: str, measured: tuple[np.ndarray, np.ndarray], expected: tuple[np.ndarray, np.ndarray]) -> step.Answer:
    """Both at the times of what was measured."""
    return step.Answer(name, *measured, np.interp(measured[0], *expected, left=0.0))
