"""Many runs of one kind: builds a scenario for each case, runs them in parallel and keeps what the tables need."""

from collections.abc import Callable
from typing import Any

from . import simulate, workers
from .run import Run
from .scenario import Event, Measure, Scenario

MEASURE = "measured"
S3_DEBOUNCE_S = 0.03


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


def run_cases(jobs: list[simulate.Job], progress: Callable[[float], None]) -> list[dict[str, Any]]:
    """The reduced results of all jobs, in order."""
    return workers.run_all(jobs, _work, progress)


def _work(job: simulate.Job, report: Callable[[float], None]) -> dict[str, Any]:
    return reduced(simulate.simulate(job, report))


def reduced(run: Run) -> dict[str, Any]:
    """What a table needs of a run."""
    hand_overs = run.hand_overs()
    faults = [name for row, _, name in run.fault_changes() if name != run.faults.get(0, "NONE")]
    return {**run.measures[MEASURE], "closed_after_s": hand_overs[0].after_s2_s if hand_overs else None,
            "overshoot_percent": hand_overs[0].overshoot_percent if hand_overs else None, "fault": faults[0] if faults else None,
            "warnings": run.warnings, "motor_s": run.motor_s, "wall_s": run.wall_s}
