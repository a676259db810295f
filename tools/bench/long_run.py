"""What makes a run long: of its motor time, the part that takes most, and the key to change. Said before a long run begins."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise

from .scenario import SETTLE_PERIODS, Scenario, start_time_s

LONG_S = 120.0
"""Of motor time; the trace of a run of two minutes fits in memory as it is."""


def reason(scenario: Scenario, params: Mapping[str, float], coast_s_per_rpm: float = 0.0) -> str:
    """What takes most of a run, with its key. The scenario is in numbers."""
    parts = list(_parts(scenario, params, coast_s_per_rpm))
    own_s = scenario.duration_s - sum(seconds for seconds, _ in parts)
    file = next((event.where for event in scenario.events), scenario.name).partition(" line ")[0]
    seconds, text = max([*parts, (own_s, f"are its own waits and stretches: change the times of {file}")])
    return f"about {min(seconds, scenario.duration_s):.0f} s of it {text}"


def _parts(scenario: Scenario, params: Mapping[str, float], coast_s_per_rpm: float) -> Iterator[tuple[float, str]]:
    """Seconds, and what takes them, by key of the header or the motor file."""
    presses = [event.at_s for event in scenario.events if event.kind == "press" and event.button == "S2"]
    speeds = [event.value for event in scenario.events if event.kind == "speed_rpm"] or [0.0]
    speeds += [0.0] * (len(presses) > 1)
    first_rpm = abs(abs(speeds[0]) - params.get("END_SPEED_RPM", 0.0))
    up_rpm, down_rpm = first_rpm + sum(max(b - a, 0.0) for a, b in pairwise(speeds)), sum(max(a - b, 0.0) for a, b in pairwise(speeds))
    slope, hz = params.get("SPEEDREFRAMP_RPM_PER_S", 0.0), params.get("SPEED_BANDWIDTH_HZ", 0.0)
    if slope:
        slowed_rpm = 0.0 if coast_s_per_rpm * slope > 1.0 else down_rpm
        yield (up_rpm + slowed_rpm) / slope, f"are ramps of the speed, SPEEDREFRAMP_RPM_PER_S = {slope:g} in the header: raise it"
        yield (down_rpm - slowed_rpm) * coast_s_per_rpm, \
            "is a rotor that only friction slows: give the motor a load, or the board a supply that takes energy back"
    if hz:
        yield len(speeds) * SETTLE_PERIODS / hz, f"is for the speed to settle, SPEED_BANDWIDTH_HZ = {hz:g} in the header: raise it"
    if presses and "LOCK_TIME" in params:
        lock_s = params["LOCK_TIME"] * params["LOOPTIME_SEC"]
        start_s = start_time_s(params)
        key = "LOCK_TIME: lower it" if lock_s > 0.5 * start_s else "OPENLOOP_RAMPSPEED_INCREASERATE: raise it"
        yield start_s * (len(presses) + 1) // 2, f"are starts, in the header {key}"


def say(title: str, runs: Sequence[tuple[float, Callable[[], str]]]) -> None:
    """One line on stderr if any of the runs is long. Of each its duration, and what gives its reason()."""
    seconds, why = max(runs, key=lambda run: run[0], default=(0.0, str))
    if seconds > LONG_S:
        many = f", the longest of {len(runs)} runs" if len(runs) > 1 else ""
        print(f"foc33: {title}: {seconds:.0f} s of motor time{many}; {why()}", file=sys.stderr, flush=True)
