"""Counts of the firmware's variables in engineering units: a name tells the quantity and its format (docs/formats.md)."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

TURN_DEG = 360.0


@dataclass(frozen=True)
class Scale:
    """A count is `per_count` of `unit`."""

    unit: str
    per_count: float


RAW = Scale("", 1.0)

# Pattern of the name, unit, the parameter that the count is a multiple of ("" for none), and the multiple. The first that fits counts.
_RULES = (
    (r"ParkParm\.qI\w$|CtrlParm\.qV[dq]Ref$|LoadParm\.qLoad$|FdWeakParm\.qIdRef$", "A", "COUNT_CURRENT_A", 1.0 / 4.0),
    (r"ParkParm\.qV\w$", "V", "COUNT_VOLTAGE_V", 1.0 / 2.0),
    (r"EstimParm\.qEs\w+$", "V", "COUNT_VOLTAGE_V", 2.0),
    (r"EstimParm\.q(Vel|Omega)\w+$|CtrlParm\.qVelRef$|LoadParm\.qVel$|FdWeakParm\.qFwOnSpeed$|_erpm$", "rpm", "COUNT_SPEED_RPM", 1.0),
    (r"(EstimParm\.qRho|ParkParm\.qAngle|board_drive\.angle|\.offset)$", "°", "", TURN_DEG / 2.0 ** 16),
    (r"(rho|angle)_q32$", "°", "", TURN_DEG / 2.0 ** 32),
    (r"omega(_filtered)?_q16$", "rpm", "COUNT_SPEED_RPM", 2.0 ** -16),
    (r"\b(e|v_last|v_mean)_q13(\.\w+)?$", "V", "COUNT_VOLTAGE_V", 2.0),
    (r"\b(v|limit|vq_limit)_q14(\.\w+)?$", "V", "COUNT_VOLTAGE_V", 1.0),
    (r"\b(phases|i|ref|iq_limit|brake_limit|burn|trim|table|current|id|probe_\w+|offset_[ab])_q13(\.\w+)?$", "A", "COUNT_CURRENT_A", 1.0),
    (r"\biq_trim_q26$", "A", "COUNT_CURRENT_A", 2.0 ** -13),
    (r"\bbus_q31$", "V", "BUS_FULL_SCALE_V", 2.0 ** -31))


def scale_of(name: str, params: Mapping[str, float]) -> Scale:
    """What a count of this variable is; RAW where the name does not tell."""
    for pattern, unit, parameter, factor in _RULES:
        if re.search(pattern, name):
            count = 1.0 if not parameter else params.get(parameter)
            return RAW if count is None else Scale(unit, factor * count)
    return RAW
