"""One finished simulation and what can be read from its trace: measures, hand-over, faults, protocol."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from .metrics import limited_percent, measure_values
from .scenario import Scenario
from tools.common.trace import Trace

HAND_OVER_BEFORE_S, HAND_OVER_AFTER_S = 0.03, 0.07
"""The stretch around a hand-over that is kept and drawn at the full rate."""


@dataclass(frozen=True)
class HandOver:
    """The moment at which the estimator takes over."""

    at_s: float
    row: int
    after_s2_s: float | None
    """None where the start needed no S2"""
    overshoot_percent: float
    speed_rpm: float
    """true speed in the direction of rotation"""
    lowest_rpm: float
    """lowest true speed in the direction of rotation, from 50 ms before the hand-over to 1 s after it"""

    @property
    def text(self) -> str:
        """When the loop closed, where S2 was pressed for it."""
        return "closed loop" if self.after_s2_s is None else f"closed loop {self.after_s2_s:.2f} s after S2"


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
    sent: str = ""
    """what left UART1"""
    wall_s: float = 0.0
    cpu_s: float = 0.0
    motor_s: float = 0.0
    order_rows: int = 0
    """rows that the PWM module takes to follow an order: an image's row shows the order already, at the end of the interrupt"""

    @property
    def speed_factor(self) -> float:
        """Seconds of motor time per second of wall time, on one core."""
        return self.motor_s / self.wall_s if self.wall_s > 0.0 else 0.0

    def state_number(self, name: str) -> int:
        """Number of a state; -1 if the firmware has no such state."""
        return next((number for number, known in self.states.items() if known == name), -1)

    def fault_changes(self) -> list[tuple[int, float, str]]:
        """(row, time, name) whenever the fault code changes, the start included."""
        return self._changes("fw.fault", self.faults, "code")

    def raised(self) -> list[tuple[int, float, str]]:
        """Those of fault_changes() at which there is a fault."""
        return [change for change in self.fault_changes() if change[2] != self.faults.get(0, "NONE")]

    def state_changes(self) -> list[tuple[int, float, str]]:
        """(row, time, name) whenever the drive's state changes, the start included."""
        return self._changes("fw.state", self.states, "state")

    def _changes(self, signal: str, names: dict[int, str], kind: str) -> list[tuple[int, float, str]]:
        """A target image without names leaves no such signals behind."""
        return [(row, float(self.trace.time_s[row]), names.get(int(code), f"{kind} {int(code)}"))
                for row, code in (self.trace.changes(signal) if signal in self.trace else [])]

    def press_times(self, button: str) -> list[float]:
        return [event.at_s for event in self.scenario.events if event.kind == "press" and event.button == button]

    def hand_overs(self) -> list[HandOver]:
        """Every change from the ramp to closed loop."""
        result = []
        changes = self.state_changes()
        for (_, _, before), (row, at_s, name) in zip(changes, changes[1:]):
            if name == "CLOSED" and before == "RAMP":
                presses = [time for time in self.press_times("S2") if time < at_s]
                result.append(self._hand_over(row, at_s, at_s - presses[-1] if presses else None))
        return result

    def _hand_over(self, row: int, at_s: float, after_s2_s: float | None) -> HandOver:
        after = self.trace.part(at_s, at_s + 1.0)
        reference = after.column("fw.speed_ref_rpm").astype(np.float64)
        direction = -1.0 if reference[min(1, len(reference) - 1)] < 0.0 else 1.0
        speed = direction * after.column("plant.speed_rpm")
        reference = np.maximum(direction * reference, 1.0)
        still_closed = after.column("fw.state") == self.state_number("CLOSED")
        overshoot = np.max(np.where(still_closed, (speed - reference) / reference, -1.0)) * 100.0
        around = self.trace.part(at_s - 0.05, at_s + 1.0).column("plant.speed_rpm") * direction
        return HandOver(at_s, row, after_s2_s, float(overshoot), float(direction * self.trace.column("plant.speed_rpm")[row]),
                        float(np.min(around)))

    def protocol(self) -> list[tuple[float, str]]:
        """What happened and when: the operator's actions, the drive's states, faults."""
        entries = list(self.actions)
        hand_overs = {item.row: item for item in self.hand_overs()}
        for row, at_s, name in self.state_changes():
            text = f"state {name}"
            if row in hand_overs:
                item = hand_overs[row]
                text = f"{item.text}, overshoot {item.overshoot_percent:.1f} %"
            entries.append((at_s, text))
        faults = self.fault_changes()
        entries += [(at_s, f"fault {name}" if code else "fault cleared") for (row, at_s, name), code in
                    zip(faults, (self.trace.column("fw.fault")[row] for row, _, _ in faults)) if row > 0 or code]
        return sorted(entries, key=lambda entry: entry[0])

    @cached_property
    def measures(self) -> dict[str, dict[str, Any]]:
        """The values of every [[measure]], by name."""
        parts = {measure.name: self.trace.part(measure.from_s, measure.to_s) for measure in self.scenario.measures}
        result = {measure.name: measure_values(parts[measure.name], measure) | {"limited_percent": limited_percent(parts[measure.name])}
                  for measure in self.scenario.measures}
        most = self.params.get("MAXIMUM_CURRENT_A")
        for values in result.values():
            if most and values["current_rms_a"] is not None:
                values["current_of_maximum_percent"] = 100.0 * 2.0 ** 0.5 * values["current_rms_a"] / most
        return result
