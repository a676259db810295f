"""A scenario: what happens to the board over time, what to measure and what to expect. scenario_file.py reads it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tools.common.errors import UserError
from tools.common.board_keys import Values
from tools.common.param_rows import number
from .metrics import MIDDLE, STANDSTILL, Measure

BRAKE = "load.constant_nm"
POT_STEPS = 1024
START_MARGIN_S = 0.4
"""Debouncing, charging of the drivers and waiting for the estimator's agreement, at most."""
RAMP_S, SETTLE_S = 1.0, 1.0
"""What a scenario with `follows_header` leaves for a ramp of the speed reference, and for the speed to settle."""
APP_START_S = 1.6
"""What a scenario of an application leaves for the start."""
SETTLE_PERIODS, SLOW_PERIODS, LONGEST_SETTLE_S = 5.0, 3.0, 20.0
"""Of the speed loop's bandwidth, and of what is left of it at low speed, where it falls with the speed."""
FULL_RATIO = number("PARAM_FULL_RATIO")


@dataclass(frozen=True)
class Event:
    """One [[event]]; which fields count depends on the kind."""

    at_s: float
    kind: str
    where: str
    button: str = ""
    hold_s: float = 0.0
    value: float = 0.0
    keys: dict[str, float] = field(default_factory=dict)
    variables: dict[str, int] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    over_s: float = 0.0
    note: str = ""
    text: str = ""
    """which of SPEEDS, the line to send, or the bytes to send as characters"""
    written: str = ""
    """how the file gave the value, where that is not the kind and the value"""
    then: str = ""
    """speed that an application asks for after it: one of SPEEDS, MIDDLE or STANDSTILL"""
    then_rpm: float | None = None
    finds_range: bool = False
    """the operator presses S3 where the speed lies in the potentiometer's other range"""


@dataclass(frozen=True)
class Rating:
    """What a hundred per cent are."""

    speed_rpm: float
    torque_nm: float
    coast_s_per_rpm: float = 0.0
    """how long the motor's own friction takes where the supply takes nothing back"""


@dataclass
class Scenario:
    """A whole scenario file."""

    name: str
    title: str
    description: str
    motor: str
    board: str
    duration_s: float
    follows_header: bool = False
    """a start or a ramp that takes longer than the file leaves for it shifts what comes after"""
    defines: list[str] = field(default_factory=list)
    plant: Values = field(default_factory=Values)
    rotor_deg: float = 0.0
    speed_rpm: float = 0.0
    events: list[Event] = field(default_factory=list)
    measures: list[Measure] = field(default_factory=list)
    expectations: list[Any] = field(default_factory=list)
    """of expect.py's kinds"""
    expectations_where: list[str] = field(default_factory=list)
    motor_where: str = ""
    board_where: str = ""
    notes: list[str] = field(default_factory=list)
    """what to write otherwise in the file, though it works"""


def asks_for_rating(scenario: Scenario) -> bool:
    """Whether anything is written in per cent."""
    return any(event.kind in ("speed_percent", "torque_percent") for event in scenario.events) \
        or any(measure.reference_percent is not None for measure in scenario.measures)


def in_numbers(scenario: Scenario, rating: Rating | None, params: dict[str, float]) -> Scenario:
    """The scenario with every per cent and every named speed replaced by its number; `rating` is needed if asks_for_rating()."""
    least_rpm = param(params, "MINIMUM_SPEED_RPM") if scenario.follows_header else 0.0
    found = replace(scenario, events=[_event_in_numbers(event, rating, params, least_rpm) for event in scenario.events],
                    measures=[_measure_in_numbers(measure, rating, params, least_rpm) for measure in scenario.measures])
    return stretched(found, params, rating.coast_s_per_rpm if rating else 0.0) if scenario.follows_header else found


def early_ramp_s(params: Mapping[str, float]) -> float:
    """The least that the ramp takes: from the lock's speed to the one from which the estimator may take over."""
    period_s, pairs = param(params, "LOOPTIME_SEC"), param(params, "NOPOLESPAIRS")
    lock_hz = number("PARAM_ALIGN_TURNS") / (param(params, "LOCK_TIME") * period_s)
    early_hz = min(param(params, "END_SPEED_RPM") * pairs / 60.0,
                   max(number("PARAM_EARLY_HZ"), number("PARAM_EARLY_SHARE") * param(params, "MINIMUM_SPEED_RPM") * pairs / 60.0))
    return max(0.0, (early_hz - lock_hz) * period_s ** 2 * 65536.0 * 1024.0 / param(params, "OPENLOOP_RAMPSPEED_INCREASERATE"))


def start_time_s(params: Mapping[str, float]) -> float:
    """How long a header's start takes at most, from S2 to closed loop: lock, the whole ramp and what is around them."""
    period_s, pairs = param(params, "LOOPTIME_SEC"), param(params, "NOPOLESPAIRS")
    end_count = param(params, "END_SPEED_RPM") * pairs / 60.0 * period_s * 65536.0 * 1024.0
    ramp_periods = end_count / param(params, "OPENLOOP_RAMPSPEED_INCREASERATE")
    return (param(params, "LOCK_TIME") + ramp_periods) * period_s + START_MARGIN_S


def stretched(scenario: Scenario, params: Mapping[str, float], coast_s_per_rpm: float = 0.0) -> Scenario:
    """The scenario with the time that this header takes for the start and for each change of speed, where that is more than the file leaves."""
    by_application = any(event.then or event.then_rpm is not None for event in scenario.events)
    delays = list(_delays_of_application(scenario, params) if by_application else _delays(scenario, params, coast_s_per_rpm))

    def later(at_s: float) -> float:
        return at_s + sum(extra_s for after_s, extra_s in delays if after_s < at_s)

    def moved(item: Any) -> Any:
        times = {name: later(getattr(item, name)) for name in ("at_s", "from_s", "to_s", "after_s", "kept_to_s", "cleared_from_s") if getattr(item, name, None) is not None}
        within = getattr(item, "within_s", None)
        if within is not None: # the start itself, or the stop's ramp
            times["within_s"] = within + sum(extra_s for after_s, extra_s in delays if after_s == getattr(item, "after_s", delays[0][0]))
        return replace(item, **times) if times else item

    if not delays:
        return scenario
    return replace(scenario, duration_s=later(scenario.duration_s), events=[moved(event) for event in scenario.events],
                   measures=[moved(measure) for measure in scenario.measures], expectations=[moved(item) for item in scenario.expectations])


def _settle_s(params: Mapping[str, float], rpm: float) -> float:
    """How much longer than SETTLE_S the speed takes to settle."""
    hz, full_hz = param(params, "SPEED_BANDWIDTH_HZ"), param(params, "LOAD_BANDWIDTH_HZ") / FULL_RATIO
    share = min(1.0, max(rpm, 1.0) * param(params, "NOPOLESPAIRS") / 60.0 / full_hz)
    return min(max(SETTLE_PERIODS / hz, SLOW_PERIODS / hz / share, SETTLE_S) - SETTLE_S, LONGEST_SETTLE_S)


def _delays_of_application(scenario: Scenario, params: Mapping[str, float]) -> Iterator[tuple[float, float]]:
    """The same where an application decides what the motor does: its events say what it makes of them."""
    slope, down, now = param(params, "SPEEDREFRAMP_RPM_PER_S"), decel_rpm_s(params), abs(scenario.speed_rpm)
    for event in scenario.events:
        asked = _then_rpm(event, params)
        if asked is None:
            continue
        before, now = now, asked
        if before == 0.0 and now > 0.0:
            to_speed_s = max(now - param(params, "END_SPEED_RPM"), 0.0) / slope
            yield event.at_s, max(start_time_s(params) - APP_START_S, 0.0) + max(to_speed_s - RAMP_S, 0.0) + _settle_s(params, now)
        elif now > 0.0:
            yield event.at_s, max((now - before) / slope - RAMP_S, (before - now) / down - RAMP_S, 0.0) + _settle_s(params, now)
        else:
            yield event.at_s, max(before / down - RAMP_S, 0.0)


def _then_rpm(event: Event, params: Mapping[str, float]) -> float | None:
    """The speed after an event, within the header's; None where it asks for none."""
    if event.then_rpm is not None:
        return min(max(event.then_rpm, _named_speed("minimum", params)), _named_speed("maximum", params))
    return _named_speed(event.then, params) if event.then else None


def _delays(scenario: Scenario, params: Mapping[str, float], coast_s_per_rpm: float) -> Iterator[tuple[float, float]]:
    """When something takes longer than the file leaves for it, and by how much; the first is the start."""
    slope, down, now, coasting = param(params, "SPEEDREFRAMP_RPM_PER_S"), decel_rpm_s(params), 0.0, coast_s_per_rpm

    def settle_s(rpm: float) -> float:
        return _settle_s(params, rpm)

    presses = [event.at_s for event in scenario.events if event.kind == "press" and event.button == "S2"]
    for event in scenario.events:
        if event.kind == "speed_rpm":
            before, now = now, event.value
            if presses and event.at_s > presses[0]:
                yield event.at_s, max((now - before) / slope - RAMP_S, (before - now) / down - RAMP_S, (before - now) * coasting - RAMP_S, 0.0) + settle_s(now)
        elif event.at_s in presses[:1]:
            allowed = next((item.within_s for item in scenario.expectations if hasattr(item, "overshoot_percent")), 0.0)
            to_speed_s = max(now - param(params, "END_SPEED_RPM"), 0.0) / slope
            yield event.at_s, max(start_time_s(params) - allowed, 0.0) + max(to_speed_s - RAMP_S, 0.0) + settle_s(now)
        elif event.at_s in presses:
            yield event.at_s, max(now / down - RAMP_S, now * coasting - RAMP_S, 0.0) + 2.0 * settle_s(now)
        elif event.kind == "set" and BRAKE in event.keys:
            coasting = 0.0 if event.keys[BRAKE] else coast_s_per_rpm
            if presses and event.at_s > presses[0]:
                yield event.at_s, settle_s(now)


def _event_in_numbers(event: Event, rating: Rating | None, params: dict[str, float], least_rpm: float) -> Event:
    if event.kind == "speed":
        rpm = _named_speed(event.text, params)
        return replace(event, kind="speed_rpm", value=rpm, written=f"speed = \"{event.text}\" ({rpm:g} rpm)", finds_range=True)
    if event.kind == "speed_percent":
        rpm = _share(event.value, rating, least_rpm)
        return replace(event, kind="speed_rpm", value=rpm, written=f"speed_percent = {event.value:g} ({rpm:g} rpm)", finds_range=True)
    if event.kind == "torque_percent":
        torque_nm = event.value / 100.0 * rating.torque_nm
        return replace(event, kind="set", keys={BRAKE: torque_nm},
                       note=event.note or f"brake to {event.value:g} % of the rated torque: {torque_nm:.4g} N m")
    return event


def _measure_in_numbers(measure: Measure, rating: Rating | None, params: dict[str, float], least_rpm: float) -> Measure:
    if measure.reference:
        return replace(measure, reference_rpm=_named_speed(measure.reference, params))
    if measure.reference_percent is not None:
        rpm = _share(measure.reference_percent, rating, least_rpm)
        if least_rpm == 0.0:
            return replace(measure, reference_rpm=rpm)
        step_rpm = (param(params, "NOMINAL_SPEED_RPM") - least_rpm) / POT_STEPS + 1.0 / param(params, "NOPOLESPAIRS")
        return replace(measure, reference_rpm=rpm, step_rpm=step_rpm)
    return measure


def _share(percent: float, rating: Rating, least_rpm: float) -> float:
    """A part of the rated speed; the header's minimum where that is more, and the scenario follows it: the potentiometer goes no lower."""
    rpm = percent / 100.0 * rating.speed_rpm
    return max(rpm, least_rpm) if least_rpm else rpm


def _named_speed(name: str, params: Mapping[str, float]) -> float:
    if name == STANDSTILL:
        return 0.0
    if name == MIDDLE:
        return 0.5 * (_named_speed("minimum", params) + _named_speed("maximum", params))
    return param(params, f"{name.upper()}_SPEED_RPM")


def decel_rpm_s(params: Mapping[str, float]) -> float:
    """Slope of the speed reference towards standstill."""
    return params.get("SPEEDREF_DECEL_RPM_PER_S") or param(params, "SPEEDREFRAMP_RPM_PER_S")


def param(params: Mapping[str, float], name: str) -> float:
    """A parameter of the firmware, which an old library may not tell."""
    if name not in params:
        raise UserError(f"the firmware does not tell {name}", "tools/cpu_host/probe.c", "rebuild with make vboard")
    return params[name]
