"""The operator at the board: turns a scenario's events into timed changes of buttons, potentiometer, plant and variables.

The potentiometer's position for a speed follows from the firmware's own parameters. S3 switches between its two ranges; each S2
goes back to the normal one. Presses are tracked in the order of the events. An event may leave it to the operator to press S3.
"""

import math
from dataclasses import dataclass, field

from tools.common.errors import UserError
from .scenario import Event, Scenario, param

ADC_STEPS = 1024
RAMP_STEP_S = 0.002
DEBOUNCE_S = 0.03
"""The firmware acts on a button when it has been down that long."""
HOLD_S = 0.1
"""How long the operator holds a button down."""


@dataclass(frozen=True)
class Action:
    """What happens at one moment. `text` is a line for the protocol, "" for the parts of a longer event."""

    at_s: float
    keys: dict[str, float] = field(default_factory=dict)
    variables: dict[str, int] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    text: str = ""
    sends: str = ""
    """for the firmware's serial line"""


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
        told = (param(params, name) for name in ("MINIMUM_SPEED_RPM", "NOMINAL_SPEED_RPM", "MAXIMUM_SPEED_RPM", "MAXIMUM_CURRENT_A"))
        return cls(*told, "TORQUE_MODE" in names, "BIDIRECTIONAL_SPEED" in names)

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

    def speed_for_pot(self, position: float, fast: bool) -> float:
        """The speed that a position means, where a direction is not chosen by it."""
        low, high = (self.nominal_rpm, self.maximum_rpm) if fast else (self.minimum_rpm, self.nominal_rpm)
        return low + (high - low) * position

    def other_range(self, rpm: float, fast: bool) -> bool:
        """Whether S3 must be pressed for a speed: the present range does not hold it and the other one does."""
        if self.torque_mode or self.bidirectional:
            return False
        low, high = (self.minimum_rpm, self.nominal_rpm) if fast else (self.nominal_rpm, self.maximum_rpm)
        inside = self.nominal_rpm <= rpm if fast else rpm <= self.nominal_rpm
        return not inside and low <= rpm <= high

    def check_speed(self, rpm: float) -> None:
        """Raises ValueError if no position of potentiometer and S3 gives this speed."""
        low = self.minimum_rpm
        high = self.nominal_rpm if self.bidirectional else self.maximum_rpm
        if not low <= (abs(rpm) if self.bidirectional else rpm) <= high and not self.torque_mode:
            raise ValueError(f"the header's speeds are {low:g} .. {high:g} rpm; change MINIMUM_SPEED_RPM or MAXIMUM_SPEED_RPM")

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


@dataclass
class _Panel:
    """What the operator knows of the panel while he plans."""

    ranges: Ranges
    values: dict[str, float]
    fast: bool = False
    running: bool = False
    s3_free_s: float = 0.0

    def press(self, button: str, at_s: float, hold_s: float) -> list[Action]:
        if button == "S2":
            self.running, self.fast = not self.running, False
        else:
            self.fast = not self.fast
            self.s3_free_s = at_s + hold_s + 2.0 * DEBOUNCE_S
        key = "input." + button.lower()
        return [Action(at_s, {key: 1.0}, text=f"{button} pressed"), Action(at_s + hold_s, {key: 0.0})]


def plan(scenario: Scenario, ranges: Ranges, start: dict[str, float]) -> list[Action]:
    """Every action of the scenario in order of time. `start` holds the plant's values at the start, where ramps begin."""
    panel = _Panel(ranges, dict(start))
    actions: list[Action] = []
    for event in scenario.events:
        actions += _actions(event, panel)
    return sorted(actions, key=lambda action: action.at_s)


def _actions(event: Event, panel: _Panel) -> list[Action]:
    if event.kind == "press":
        return panel.press(event.button, event.at_s, event.hold_s)
    if event.kind == "debug":
        text = ", ".join(f"{name} = {value}" for name, value in event.variables.items())
        return [Action(event.at_s, {}, event.variables, text=event.note or f"debugger writes {text}")]
    if event.kind == "parameter": # those of time 0 are in place when the firmware begins: Job.parameters
        return [Action(event.at_s, parameters=event.parameters if event.at_s > 0.0 else {}, text=event.note or event.written)]
    if event.kind == "send":
        return [Action(event.at_s, sends=event.text + "\n", text=event.note or f"serial line: {event.text}")]
    if event.kind == "send_hex": # a scope's are too many to be told
        return [Action(event.at_s, sends=event.text, text=event.note)]
    try:
        if event.finds_range:
            panel.ranges.check_speed(event.value)
            if panel.ranges.other_range(event.value, panel.fast):
                return _across_ranges(event, panel)
        goal, text = _goal(event, panel.ranges, panel.fast)
    except ValueError as error:
        raise UserError(f"{event.written or f'{event.kind} = {event.value:g}'} is impossible", event.where, str(error)) from None
    return _turned(event.at_s, event.over_s, goal, event.note or text, panel)


def _turned(at_s: float, over_s: float, goal: dict[str, float], text: str, panel: _Panel) -> list[Action]:
    before = {key: panel.values.get(key, 0.0) for key in goal}
    panel.values.update(goal)
    return _ramp(at_s, over_s, before, goal, text)


def _across_ranges(event: Event, panel: _Panel) -> list[Action]:
    """To a speed in the other range: to the end of this one, S3, and on from the beginning of the other one. The potentiometer moves when
    the button acts, so that the speed does not jump."""
    ranges, goal_rpm, border_rpm = panel.ranges, event.value, panel.ranges.nominal_rpm
    if not panel.fast and not panel.running:
        raise ValueError(f"the potentiometer covers {ranges.minimum_rpm:g} .. {ranges.nominal_rpm:g} rpm before S2; start the motor first")
    now_rpm = ranges.speed_for_pot(panel.values.get("input.pot", 0.0), panel.fast)
    before_s = event.over_s * min(max((border_rpm - now_rpm) / (goal_rpm - now_rpm), 0.0), 1.0)
    press_s = max(event.at_s + before_s, panel.s3_free_s)
    on_s, after_s = press_s + DEBOUNCE_S, event.over_s - before_s
    actions: list[Action] = []
    if before_s > 0.0:
        actions += _turned(event.at_s, before_s, {"input.pot": ranges.pot_for_speed(border_rpm, panel.fast)}, "", panel)
    actions += panel.press("S3", press_s, HOLD_S)
    if after_s > 0.0:
        actions += _turned(on_s, 0.0, {"input.pot": ranges.pot_for_speed(border_rpm, panel.fast)}, "", panel)
    actions += _turned(on_s, after_s, {"input.pot": ranges.pot_for_speed(goal_rpm, panel.fast)}, "", panel)
    return [Action(event.at_s, text=event.note or f"potentiometer to {goal_rpm:g} rpm"), *actions]


def _goal(event: Event, ranges: Ranges, fast: bool) -> tuple[dict[str, float], str]:
    if event.kind == "speed_rpm":
        return {"input.pot": ranges.pot_for_speed(event.value, fast)}, f"potentiometer to {event.value:g} rpm"
    if event.kind == "current_a":
        return {"input.pot": ranges.pot_for_current(event.value)}, f"potentiometer to {event.value:g} A"
    if event.kind == "pot":
        return {"input.pot": event.value}, f"potentiometer to {event.value:g}"
    return dict(event.keys), ", ".join(f"{key} = {value:g}" for key, value in event.keys.items())


def _ramp(at_s: float, over_s: float, before: dict[str, float], goal: dict[str, float], text: str) -> list[Action]:
    steps = max(1, math.ceil(over_s / RAMP_STEP_S))
    actions = []
    for step in range(1, steps + 1):
        share = step / steps
        keys = {key: before[key] + (goal[key] - before[key]) * share if share < 1.0 else goal[key] for key in goal}
        actions.append(Action(at_s + (over_s * share if steps > 1 else 0.0), keys, text=text if step == 1 else ""))
    return actions
