"""A scenario: what happens to the board over time, what to measure and what to expect. scenario_file.py reads it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tools.common.errors import UserError
from tools.common.board_keys import Values
from .metrics import Measure

BRAKE = "load.constant_nm"


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
    over_s: float = 0.0
    note: str = ""
    text: str = ""
    """which of SPEEDS"""
    written: str = ""
    """how the file gave the value, where that is not the kind and the value"""
    finds_range: bool = False
    """the operator presses S3 where the speed lies in the potentiometer's other range"""


@dataclass(frozen=True)
class Rating:
    """What a hundred per cent are."""

    speed_rpm: float
    torque_nm: float


@dataclass
class Scenario:
    """A whole scenario file."""

    name: str
    title: str
    description: str
    motor: str
    board: str
    duration_s: float
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


def asks_for_rating(scenario: Scenario) -> bool:
    """Whether anything is written in per cent."""
    return any(event.kind in ("speed_percent", "torque_percent") for event in scenario.events) \
        or any(measure.reference_percent is not None for measure in scenario.measures)


def in_numbers(scenario: Scenario, rating: Rating | None, params: dict[str, float]) -> Scenario:
    """The scenario with every per cent and every named speed replaced by its number; `rating` is needed if asks_for_rating()."""
    return replace(scenario, events=[_event_in_numbers(event, rating, params) for event in scenario.events],
                   measures=[_measure_in_numbers(measure, rating, params) for measure in scenario.measures])


def _event_in_numbers(event: Event, rating: Rating | None, params: dict[str, float]) -> Event:
    if event.kind == "speed":
        rpm = _named_speed(event.text, params)
        return replace(event, kind="speed_rpm", value=rpm, written=f"speed = \"{event.text}\" ({rpm:g} rpm)", finds_range=True)
    if event.kind == "speed_percent":
        rpm = event.value / 100.0 * rating.speed_rpm
        return replace(event, kind="speed_rpm", value=rpm, written=f"speed_percent = {event.value:g} ({rpm:g} rpm)", finds_range=True)
    if event.kind == "torque_percent":
        torque_nm = event.value / 100.0 * rating.torque_nm
        return replace(event, kind="set", keys={BRAKE: torque_nm},
                       note=event.note or f"brake to {event.value:g} % of the rated torque: {torque_nm:.4g} N m")
    return event


def _measure_in_numbers(measure: Measure, rating: Rating | None, params: dict[str, float]) -> Measure:
    if measure.reference:
        return replace(measure, reference_rpm=_named_speed(measure.reference, params))
    if measure.reference_percent is not None:
        return replace(measure, reference_rpm=measure.reference_percent / 100.0 * rating.speed_rpm)
    return measure


def _named_speed(name: str, params: Mapping[str, float]) -> float:
    return param(params, f"{name.upper()}_SPEED_RPM")


def param(params: Mapping[str, float], name: str) -> float:
    """A parameter of the firmware, which an old library may not tell."""
    if name not in params:
        raise UserError(f"the firmware does not tell {name}", "tools/cpu_host/probe.c", "rebuild with make vboard")
    return params[name]
