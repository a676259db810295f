"""Rows of the summary table: a stretch of time, and what is read from the trace there."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tools.common import drive_tables
from tools.common.trace import Trace, wrapped_deg

SPEEDS = ("minimum", "nominal", "maximum")
"""Speeds of the header by name."""
MIDDLE, STANDSTILL = "middle", "standstill"
"""Half way from the lowest to the highest; none."""


@dataclass(frozen=True)
class Measure:
    """One [[measure]]: a stretch of time that becomes a row of the table."""

    name: str
    from_s: float
    to_s: float
    reference_rpm: float | None = None
    reference_percent: float | None = None
    reference: str = ""
    """which of SPEEDS, or MIDDLE"""
    step_rpm: float = 0.0
    """of the potentiometer: where the firmware's reference is that near to reference_rpm, the speed is held against it"""

    @property
    def has_reference(self) -> bool:
        return self.reference_rpm is not None or self.reference_percent is not None or self.reference != ""


MEASURE_VALUES = {
    "speed_rpm": "true mean speed", "speed_min_rpm": "lowest true speed", "speed_max_rpm": "highest true speed",
    "estimated_rpm": "estimated mean speed", "speed_error_percent": "true mean speed against reference_rpm",
    "estimate_error_percent": "estimated against true mean speed", "current_rms_a": "RMS phase current",
    "current_of_maximum_percent": "its amplitude in per cent of MAXIMUM_CURRENT_A",
    "id_a": "mean d current", "iq_a": "mean q current", "torque_nm": "mean electrical torque",
    "angle_error_mean_deg": "mean electrical angle error, estimated less true", "angle_error_rms_deg": "RMS of the angle error",
    "angle_error_max_deg": "largest angle error", "voltage_v": "mean length of the commanded voltage vector",
    "voltage_percent": "the same in per cent of its limit", "inv_kphi_rpm_per_v": "mean 1/Kphi in use", "bus_v": "mean bus voltage",
    "bus_max_v": "highest bus voltage"}
"""What a row of the table can hold, with the meaning."""
MEASURED_BY_FIRMWARE = {"estimated_rpm", "estimate_error_percent", "angle_error_mean_deg", "angle_error_rms_deg", "angle_error_max_deg", "voltage_v",
                        "voltage_percent", "inv_kphi_rpm_per_v"}
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
            put("speed_error_percent", 100.0 * (speed.mean() / _reference(column("fw.speed_ref_rpm"), measure) - 1.0))
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
        if column("fw.inv_kphi_rpm_per_v") is not None:
            put("inv_kphi_rpm_per_v", column("fw.inv_kphi_rpm_per_v").mean())
    return values


def _reference(own: np.ndarray | None, measure: Measure) -> float:
    """What the speed is held against: what was asked for, as exactly as the potentiometer gives it."""
    asked = float(measure.reference_rpm or 0.0)
    given = asked if own is None else float(np.mean(own))
    return given if abs(given - asked) <= measure.step_rpm else asked


def limited_percent(part: Trace) -> dict[str, float]:
    """Share of the time with the bridge on in which each reason limited the output; those that did not are left out."""
    if "fw.limits" not in part or "pwm.outputs_seen" not in part:
        return {}
    reasons = part.column("fw.limits")[part.column("pwm.outputs_seen") != 0].astype(np.int32)
    return {row.name: float(100.0 * np.mean((reasons & row.code) != 0)) for row in drive_tables.limits() if np.any(reasons & row.code)}


def _currents(column: Any, put: Any) -> None:
    i_d, i_q, torque = column("plant.i_d"), column("plant.i_q"), column("plant.torque_nm")
    if i_d is not None and i_q is not None:
        put("current_rms_a", np.sqrt(np.mean(i_d * i_d + i_q * i_q) / 2.0))
        put("id_a", i_d.mean())
        put("iq_a", i_q.mean())
    if torque is not None:
        put("torque_nm", torque.mean())


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
