"""What the cases of sweeps have in common: the events of a start under load, a scenario that ends with its measure, what is read from its run."""

from typing import Any

import numpy as np

from tools.common import motor_file
from . import picture, report
from .metrics import Measure
from .run import Run
from .scenario import BRAKE, Event, Scenario, param, start_time_s

MEASURE = "measured"
S3_DEBOUNCE_S = 0.03
HIGHEST_OVER_S = 0.1
"""The highest speed of a run is a mean over this time."""


def start_events(start_s: float, speed_rpm: float, nominal_rpm: float, where: str) -> list[Event]:
    """Potentiometer and buttons for a start at speed_rpm; above the nominal speed S3 follows after the hand-over."""
    press = {"kind": "press", "hold_s": 0.1, "where": where}
    first = min(speed_rpm, nominal_rpm)
    events = [Event(0.0, "speed_rpm", where, value=first), Event(start_s, button="S2", **press)]
    if speed_rpm > nominal_rpm:
        fast_s = start_s + 2.0
        events += [Event(fast_s, button="S3", **press), Event(fast_s + S3_DEBOUNCE_S, "speed_rpm", where, value=speed_rpm)]
    return events


def scenario(name: str, title: str, events: list[Event], reference_rpm: float, from_s: float, to_s: float, **more: Any) -> Scenario:
    """A scenario that ends with its only measure."""
    return Scenario(name, title, "", "", "", to_s, events=sorted(events, key=lambda event: event.at_s),
                    measures=[Measure(MEASURE, from_s, to_s, reference_rpm)], **more)


def ramp_time_s(params: dict[str, float], rpm: float) -> float:
    """How long the reference takes from the end of the start to a speed."""
    return abs(rpm - param(params, "END_SPEED_RPM")) / param(params, "SPEEDREFRAMP_RPM_PER_S")


def shares(table_motor: str, motor: motor_file.Motor, speeds_rpm: list[float], torques_nm: list[float]) -> tuple[list[float], list[float]]:
    """A table's speeds and torques for another motor than the table's own: the same shares of its rating, to three digits."""
    own = motor_file.load(table_motor)
    by_speed, by_torque = motor.rated_speed_rpm / own.rated_speed_rpm, motor.rated_torque_nm / own.rated_torque_nm
    return [three_digits(rpm * by_speed) for rpm in speeds_rpm], [three_digits(torque * by_torque) for torque in torques_nm]


def three_digits(value: float) -> float:
    """The value as it is printed."""
    return float(f"{value:.3g}")


def within_header(params: dict[str, float], rpm: float) -> float:
    """The speed nearest to this one that the header allows."""
    return min(max(rpm, param(params, "MINIMUM_SPEED_RPM")), param(params, "MAXIMUM_SPEED_RPM"))


def loaded_run(params: dict[str, float], rpm: float, times: Any, name: str, torque_nm: float = 0.0,
               start_torque_nm: float = 0.0) -> tuple[list[Event], float]:
    """A start under `start_torque_nm`, then to a speed, then the brake to `torque_nm`: the events, and the time at which the motor should
    have settled. `times` has start_s (of S2), settle_s, torque_over_s, and where it was read; `name` says in an error what was asked for."""
    where = times.where
    closed_s = times.start_s + start_time_s(params)
    at_speed_s = closed_s + ramp_time_s(params, rpm) + times.settle_s
    first = min(max(rpm, param(params, "MINIMUM_SPEED_RPM")), param(params, "NOMINAL_SPEED_RPM"))
    events = [Event(0.0, "set", where, keys={BRAKE: start_torque_nm}), Event(0.0, "speed_rpm", where, value=first),
              Event(times.start_s, "press", where, button="S2", hold_s=0.1),
              Event(closed_s, "speed_rpm", where, value=rpm, finds_range=True, written=name)]
    if torque_nm == start_torque_nm:
        return events, at_speed_s
    events.append(Event(at_speed_s, "set", where, keys={BRAKE: torque_nm}, over_s=times.torque_over_s))
    return events, at_speed_s + times.torque_over_s + times.settle_s


def reduced(run: Run) -> dict[str, Any]:
    """What a table needs of a run."""
    hand_overs = run.hand_overs()
    faults = run.raised()
    return {"picture": picture.of(run, picture.SWEEP_STRETCHES), **run.measures[MEASURE],
            "closed_after_s": hand_overs[0].after_s2_s if hand_overs else None,
            "overshoot_percent": hand_overs[0].overshoot_percent if hand_overs else None,
            "hand_over_rpm": hand_overs[0].speed_rpm if hand_overs else None, "back_rpm": back_rpm(run), "fault": faults[0][2] if faults else None,
            "fault_s": faults[0][1] if faults else None,
            "highest_rpm": highest_rpm(run), "warnings": run.warnings, "motor_s": run.motor_s, "wall_s": run.wall_s}


def back_rpm(run: Run) -> float:
    """The highest true speed against a start forwards, until the closed loop or a fault ends it."""
    ends = [at_s for _, at_s, name in run.state_changes() if name in ("CLOSED", "FAULT")]
    return max(0.0, -float(np.min(run.trace.part(0.0, ends[0] if ends else run.trace.time_s[-1]).column("plant.speed_rpm"), initial=0.0)))


def limit_text(result: dict[str, Any]) -> str:
    """What explains a shortfall of more than 0.5 %, and for which share of the time; "" where there is none."""
    if result["fault"]:
        return f"fault {result['fault']}"
    error = result["speed_error_percent"]
    if error is None or error >= -0.5:
        return ""
    return report.limits_text(result["limited_percent"]) or "not limited"


def speed_verdict(row: dict[str, Any], error_percent: float) -> str:
    """"" if the mean speed is at its reference, else by how much it is not, and the limit that explains it."""
    error = row["speed_error_percent"]
    if error is not None and abs(error) <= error_percent:
        return ""
    reason = limit_text(row)
    return ("no speed" if error is None else f"speed {error:+.1f} %") + (f" ({reason})" if reason else "")


def highest_rpm(run: Run) -> float | None:
    """The highest true speed in closed loop that lasted for HIGHEST_OVER_S, against either direction; None without closed loop."""
    if "fw.state" not in run.trace:
        return None
    closed = np.flatnonzero(run.trace.column("fw.state") == run.state_number("CLOSED"))
    rows = max(1, round(HIGHEST_OVER_S / run.trace.period_s)) if len(run.trace) > 1 else 1
    if len(closed) < rows:
        return None
    speed = np.abs(run.trace.column("plant.speed_rpm")[closed[0]:closed[-1] + 1].astype(np.float64))
    sums = np.concatenate(([0.0], np.cumsum(speed)))
    return float(np.max(sums[rows:] - sums[:-rows]) / rows)
