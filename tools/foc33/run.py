"""One finished simulation and what can be read from its trace: measures, hand-over, faults, protocol."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from .scenario import Measure, Scenario
from .trace import Trace, wrapped_deg

HAND_OVER_BEFORE_S, HAND_OVER_AFTER_S = 0.03, 0.07
"""The stretch around a hand-over that is kept and drawn at the full rate."""
AT_LIMIT = 0.985
"""A quantity counts as "at its limit" from this share of it."""


@dataclass(frozen=True)
class HandOver:
    """The moment at which the estimator takes over."""

    at_s: float
    row: int
    after_s2_s: float
    overshoot_percent: float
    lowest_rpm: float
    """lowest true speed in the direction of rotation, from 50 ms before the hand-over to 1 s after it"""


@dataclass
class Run:
    """Everything that a simulation left behind."""

    scenario: Scenario
    trace: Trace
    actions: list[tuple[float, str]] = field(default_factory=list)
    """what the operator did: time and text"""
    warnings: list[str] = field(default_factory=list)
    states: dict[int, str] = field(default_factory=dict)
    faults: dict[int, str] = field(default_factory=dict)
    variables: dict[str, list[int]] = field(default_factory=dict)
    params: dict[str, float] = field(default_factory=dict)
    wall_s: float = 0.0
    cpu_s: float = 0.0
    motor_s: float = 0.0

    @property
    def speed_factor(self) -> float:
        """Seconds of motor time per second of wall time, on one core."""
        return self.motor_s / self.wall_s if self.wall_s > 0.0 else 0.0

    def state_number(self, name: str) -> int:
        """Number of a state; -1 if the firmware has no such state."""
        return next((number for number, known in self.states.items() if known == name), -1)

    def fault_number(self, name: str) -> int:
        return next((number for number, known in self.faults.items() if known == name), -1)

    def fault_changes(self) -> list[tuple[int, float, str]]:
        """(row, time, name) whenever the fault code changes, the start included."""
        return [(row, float(self.trace.time_s[row]), self.faults.get(int(code), f"code {int(code)}"))
                for row, code in self._firmware_changes("fw.fault")]

    def _firmware_changes(self, name: str) -> list[tuple[int, float]]:
        """A target image without names leaves no such signals behind."""
        return self.trace.changes(name) if name in self.trace else []

    def state_changes(self) -> list[tuple[int, float, str]]:
        """(row, time, name) whenever the drive's state changes, the start included."""
        return [(row, float(self.trace.time_s[row]), self.states.get(int(code), f"state {int(code)}"))
                for row, code in self._firmware_changes("fw.state")]

    def press_times(self, button: str) -> list[float]:
        return [event.at_s for event in self.scenario.events if event.kind == "press" and event.button == button]

    def hand_overs(self) -> list[HandOver]:
        """Every change from the ramp to closed loop."""
        result = []
        changes = self.state_changes()
        for (_, _, before), (row, at_s, name) in zip(changes, changes[1:]):
            if name == "CLOSED" and before == "RAMP":
                presses = [time for time in self.press_times("S2") if time < at_s]
                result.append(self._hand_over(row, at_s, at_s - presses[-1] if presses else float("nan")))
        return result

    def _hand_over(self, row: int, at_s: float, after_s2_s: float) -> HandOver:
        after = self.trace.part(at_s, at_s + 1.0)
        reference = after.column("fw.speed_ref_rpm").astype(np.float64)
        direction = -1.0 if reference[min(1, len(reference) - 1)] < 0.0 else 1.0
        speed = direction * after.column("plant.speed_rpm")
        reference = np.maximum(direction * reference, 1.0)
        still_closed = after.column("fw.state") == self.state_number("CLOSED")
        overshoot = np.max(np.where(still_closed, (speed - reference) / reference, -1.0)) * 100.0
        around = self.trace.part(at_s - 0.05, at_s + 1.0).column("plant.speed_rpm") * direction
        return HandOver(at_s, row, after_s2_s, float(overshoot), float(np.min(around)))

    @cached_property
    def measures(self) -> dict[str, dict[str, Any]]:
        """The values of every [[measure]], by name."""
        result = {measure.name: measure_values(self.trace.part(measure.from_s, measure.to_s), measure)
                  for measure in self.scenario.measures}
        most = self.params.get("MAXIMUM_CURRENT_A")
        for values in result.values():
            if most and values["current_rms_a"] is not None:
                values["current_of_maximum_percent"] = 100.0 * 2.0 ** 0.5 * values["current_rms_a"] / most
        return result


MEASURE_VALUES = {
    "speed_rpm": "true mean speed", "speed_min_rpm": "lowest true speed", "speed_max_rpm": "highest true speed",
    "estimated_rpm": "estimated mean speed", "speed_error_percent": "true mean speed against reference_rpm",
    "estimate_error_percent": "estimated against true mean speed", "current_rms_a": "RMS phase current",
    "current_of_maximum_percent": "its amplitude in per cent of MAXIMUM_CURRENT_A",
    "id_a": "mean d current", "iq_a": "mean q current", "torque_nm": "mean electrical torque",
    "angle_error_mean_deg": "mean electrical angle error, estimated less true", "angle_error_rms_deg": "RMS of the angle error",
    "angle_error_max_deg": "largest angle error", "voltage_v": "mean length of the commanded voltage vector",
    "voltage_percent": "the same in per cent of its limit", "voltage_at_limit_percent": "share of time at the voltage limit",
    "current_at_limit_percent": "share of time with the q current reference at its limit", "bus_v": "mean bus voltage",
    "bus_max_v": "highest bus voltage"}
"""What a row of the table can hold, with the meaning."""
MEASURED_BY_FIRMWARE = {"estimated_rpm", "estimate_error_percent", "angle_error_mean_deg", "angle_error_rms_deg", "angle_error_max_deg", "voltage_v",
                        "voltage_percent", "voltage_at_limit_percent", "current_at_limit_percent"}
"""Those that need the firmware's variables; the others are the plant's."""


def measure_values(part: Trace, measure: Measure) -> dict[str, Any]:
    """Means over one stretch of the trace; None where there is nothing to tell: no such signal, or a bridge that is off."""
    values: dict[str, Any] = dict.fromkeys(MEASURE_VALUES)
    if not len(part):
        return values

    def column(name: str) -> np.ndarray | None:
        return part.column(name).astype(np.float64) if name in part else None

    def put(name: str, value: Any) -> None:
        values[name] = None if value is None else float(value)

    switching = "pwm.outputs_seen" not in part or bool(np.any(part.column("pwm.outputs_seen")))
    speed = column("plant.speed_rpm")
    estimated = column("fw.speed_est_rpm") if switching else None
    if speed is not None:
        put("speed_rpm", speed.mean())
        put("speed_min_rpm", speed.min())
        put("speed_max_rpm", speed.max())
        if measure.reference_rpm is not None:
            put("speed_error_percent", 100.0 * (speed.mean() / measure.reference_rpm - 1.0))
    if estimated is not None:
        put("estimated_rpm", estimated.mean())
        if speed is not None and abs(speed.mean()) > 1.0:
            put("estimate_error_percent", 100.0 * (estimated.mean() / speed.mean() - 1.0))
    _currents(column, put)
    if column("bus.voltage_v") is not None:
        put("bus_v", column("bus.voltage_v").mean())
        put("bus_max_v", column("bus.voltage_v").max())
    if switching:
        _angle(column, put)
        _voltage(column, put)
    return values


def _currents(column: Any, put: Any) -> None:
    i_d, i_q, torque = column("plant.i_d"), column("plant.i_q"), column("plant.torque_nm")
    if i_d is not None and i_q is not None:
        put("current_rms_a", np.sqrt(np.mean(i_d * i_d + i_q * i_q) / 2.0))
        put("id_a", i_d.mean())
        put("iq_a", i_q.mean())
    if torque is not None:
        put("torque_nm", torque.mean())
    reference, limit = column("fw.iq_ref_a"), column("fw.iq_limit_a")
    if reference is not None and limit is not None:
        put("current_at_limit_percent", 100.0 * np.mean((np.abs(reference) >= AT_LIMIT * limit) & (limit > 0.0)))


def _angle(column: Any, put: Any) -> None:
    estimated, true = column("fw.theta_est_deg"), column("plant.theta_e_deg")
    if estimated is None or true is None:
        return
    error = wrapped_deg(estimated - true)
    centre = np.degrees(np.angle(np.mean(np.exp(1j * np.radians(error)))))
    put("angle_error_mean_deg", centre)
    put("angle_error_rms_deg", np.sqrt(np.mean(error * error)))
    put("angle_error_max_deg", np.max(np.abs(error)))


def _voltage(column: Any, put: Any) -> None:
    v_d, v_q, limit = column("fw.v_d_v"), column("fw.v_q_v"), column("fw.v_limit_v")
    if v_d is not None and v_q is not None:
        length = np.hypot(v_d, v_q)
        put("voltage_v", length.mean())
        if limit is not None and np.all(limit > 0.0):
            put("voltage_percent", 100.0 * np.mean(length / limit))
            put("voltage_at_limit_percent", 100.0 * np.mean(length >= AT_LIMIT * limit))
