"""The operator at the board: turns a scenario's events into timed changes of buttons, potentiometer, plant and variables.

The potentiometer's position for a speed follows from the firmware's own parameters. S3 switches between its two ranges; each S2
goes back to the normal one. Presses are tracked in the order of the events.
"""

import math
from dataclasses import dataclass, field

from .errors import UserError
from .scenario import Event, Scenario

ADC_STEPS = 1024
RAMP_STEP_S = 0.002


@dataclass(frozen=True)
class Action:
    """What happens at one moment. `text` is a line for the protocol, "" for the parts of a longer event."""

    at_s: float
    keys: dict[str, float] = field(default_factory=dict)
    variables: dict[str, int] = field(default_factory=dict)
    text: str = ""


@dataclass(frozen=True)
class Ranges:
    """What the potentiometer means in the firmware at hand."""

    minimum_rpm: float
    nominal_rpm: float
    maximum_rpm: float
    maximum_current_a: float
    torque_mode: bool
    bidirectional: bool

    @classmethod
    def of(cls, params: dict[str, float], defines: list[str]) -> "Ranges":
        names = {define.split("=")[0] for define in defines}
        try:
            return cls(params["MINIMUM_SPEED_RPM"], params["NOMINAL_SPEED_RPM"], params["MAXIMUM_SPEED_RPM"],
                       params["MAXIMUM_CURRENT_A"], "TORQUE_MODE" in names, "BIDIRECTIONAL_SPEED" in names)
        except KeyError as missing:
            raise UserError(f"the firmware does not tell {missing.args[0]}", "tools/board/probe.c",
                            "rebuild with make vboard") from None

    def pot_for_speed(self, rpm: float, fast: bool) -> float:
        """Position 0..1 for a speed; raises ValueError with the remedy if the range does not hold it."""
        if self.torque_mode:
            raise ValueError("TORQUE_MODE has no speed command: use current_a or pot")
        if self.bidirectional:
            size = _fraction(abs(rpm), self.minimum_rpm, self.nominal_rpm)
            return 0.5 + math.copysign(0.5, rpm) * max(size, 0.04) # three per cent around the middle mean no direction
        if fast:
            return _middle_of_step(_fraction(rpm, self.nominal_rpm, self.maximum_rpm))
        remedy = ", or press S3 before" if self.nominal_rpm < rpm <= self.maximum_rpm else ""
        return _middle_of_step(_fraction(rpm, self.minimum_rpm, self.nominal_rpm, remedy))

    def pot_for_current(self, current_a: float) -> float:
        if not self.torque_mode:
            raise ValueError("only TORQUE_MODE has a current command: use speed_rpm")
        size = _fraction(abs(current_a), 0.0, self.maximum_current_a, unit="A")
        return 0.5 + math.copysign(0.5, current_a) * size if self.bidirectional else _middle_of_step(size)


def _fraction(value: float, low: float, high: float, remedy: str = "", unit: str = "rpm") -> float:
    if not low <= value <= high or high <= low:
        raise ValueError(f"the potentiometer covers {low:g} .. {high:g} {unit} here; choose within{remedy}")
    return (value - low) / (high - low)


def _middle_of_step(fraction: float) -> float:
    """The middle of the converter step whose meaning is nearest, so that noise does not move the reading."""
    step = min(max(round(fraction * ADC_STEPS - 0.5), 0), ADC_STEPS - 1)
    return (step + 0.5) / ADC_STEPS


def plan(scenario: Scenario, ranges: Ranges, start: dict[str, float]) -> list[Action]:
    """Every action of the scenario in order of time. `start` holds the plant's values at the start, where ramps begin."""
    present = dict(start)
    fast = False
    actions: list[Action] = []
    for event in scenario.events:
        if event.kind == "press":
            fast = {"S2": False, "S3": not fast}[event.button]
        actions += _actions(event, ranges, fast, present)
    return sorted(actions, key=lambda action: action.at_s)


def _actions(event: Event, ranges: Ranges, fast: bool, present: dict[str, float]) -> list[Action]:
    if event.kind == "press":
        key = "input." + event.button.lower()
        return [Action(event.at_s, {key: 1.0}, text=f"{event.button} pressed"), Action(event.at_s + event.hold_s, {key: 0.0})]
    if event.kind == "debug":
        text = ", ".join(f"{name} = {value}" for name, value in event.variables.items())
        return [Action(event.at_s, {}, event.variables, event.note or f"debugger writes {text}")]
    try:
        goal, text = _goal(event, ranges, fast)
    except ValueError as error:
        raise UserError(f"{event.kind} = {event.value:g} is impossible", event.where, str(error)) from None
    from_values = {key: present.get(key, 0.0) for key in goal}
    present.update(goal)
    return _ramp(event, from_values, goal, event.note or text)


def _goal(event: Event, ranges: Ranges, fast: bool) -> tuple[dict[str, float], str]:
    if event.kind == "speed_rpm":
        return {"input.pot": ranges.pot_for_speed(event.value, fast)}, f"potentiometer to {event.value:g} rpm"
    if event.kind == "current_a":
        return {"input.pot": ranges.pot_for_current(event.value)}, f"potentiometer to {event.value:g} A"
    if event.kind == "pot":
        return {"input.pot": event.value}, f"potentiometer to {event.value:g}"
    return dict(event.keys), ", ".join(f"{key} = {value:g}" for key, value in event.keys.items())


def _ramp(event: Event, before: dict[str, float], goal: dict[str, float], text: str) -> list[Action]:
    steps = max(1, math.ceil(event.over_s / RAMP_STEP_S))
    actions = []
    for step in range(1, steps + 1):
        share = step / steps
        keys = {key: before[key] + (goal[key] - before[key]) * share if share < 1.0 else goal[key] for key in goal}
        at_s = event.at_s + (event.over_s * share if steps > 1 else 0.0)
        actions.append(Action(at_s, keys, text=text if step == 1 else ""))
    return actions
