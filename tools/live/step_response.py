"""Steps of the running motor on the page: of the current, the speed or the load, beside the tuner's model (docs/response.md). A part of LoopResponse, whose link
and turn it has. The motor is neither started nor stopped for it; a step of the speed borrows the command from whoever has it."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from tools.common import motor_file
from tools.common.errors import UserError

from . import response, step
from .response import PANEL_MODE, RUN, TARGET_MODE, Bench
from .step_model import answer, answers_of, seconds_of

SIZES = {"current": (1.0, 15.0, 5.0, "% of the largest current"), "speed": (2.0, 30.0, 10.0, "% of the speed"), "load": (5.0, 100.0, 40.0, "% of the rated torque")}
"""Least, largest and usual size of each, in a unit."""
NO_BRAKE = "a load step needs the virtual motor's brake: load your motor by hand, with the scope on the speed"
BACK_S = 0.2
"""Until the firmware's background has seen a change of the command."""
COLUMNS = ("time_s", "measured", "model")


class Borrower(Bench):
    """The bench of a motor that somebody else drives. `override` tells a page that has the command which target is meant instead; None: its own again."""

    override: Callable[[int | None], None] = staticmethod(lambda erpm: None)
    borrowed_erpm: int | None = None
    """the target to come back to"""

    def borrow(self) -> None:
        """The target is this bench's. From buttons and potentiometer the command is taken without a change: they wish that the motor runs, and so does the client."""
        put, self.borrowed_erpm = self.firmware.put, self.firmware.get(f"{RUN}.control.reference_erpm")
        if self.firmware.get("scope_command.is_taken"):
            self.override(self.borrowed_erpm)
            return
        put("scope_command.run", 1) # before the mode: it is no start then
        self.pause(BACK_S)
        put("scope_command.target_erpm", self.borrowed_erpm)
        self.hold()
        put("scope_command.mode", TARGET_MODE)
        self.leases = True

    def aim(self, erpm: int) -> None:
        self.override(erpm)
        super().aim(erpm)

    def give_back(self) -> None:
        """Who had the command has it again."""
        if self.borrowed_erpm is None:
            return
        self.aim(self.borrowed_erpm)
        self.override(None)
        if self.leases:
            self.leases = False
            self.firmware.put("scope_command.mode", PANEL_MODE)
            self.firmware.put("scope_command.run", 0)
        self.borrowed_erpm = None


class StepResponse:
    """For one board. `brake` puts so much load beside the bench's own; None: there is no brake."""

    def __init__(self, motor: motor_file.Motor | None, brake: Callable[[float], None] | None) -> None:
        self.motor, self.brake = motor, brake
        self.size = 0.0
        self.told: dict[str, Any] = {"step": None, "said": "", "note": "", "caption": "", "time_ms": [], "measured": [], "model": [], "figures": None, "ripple": None}

    def hello(self) -> dict[str, Any]:
        """What can be chosen."""
        return {"sizes": {name: dict(zip(("low", "high", "usual", "unit"), row)) for name, row in SIZES.items()}, "of_load": None if self.brake else NO_BRAKE}

    def refusal(self, name: str, state: str) -> str | None:
        """Beyond what refuses a loop."""
        if name == "load" and self.brake is None:
            return NO_BRAKE
        return "a step of speed or load is measured in CLOSED" if name != "current" and state != "CLOSED" else None

    @staticmethod
    def read(wish: Any) -> tuple[str, float]:
        """{"step": "speed", "size": 10}: which, and how large in its unit."""
        name, size = (wish["step"], wish["size"]) if isinstance(wish, dict) and set(wish) == {"step", "size"} else (None, None)
        if name not in step.STEPS:
            raise UserError(f"no step '{name}'", "loops", "choose one of " + ", ".join(step.STEPS))
        low, high, _, unit = SIZES[name]
        if isinstance(size, bool) or not isinstance(size, (int, float)) or not low <= size <= high:
            raise UserError(f"a step of the {name} of {size} is impossible", "loops", f"choose {low:g} .. {high:g} {unit}")
        return name, float(size)

    def begin(self, name: str, size: float, note: str) -> None:
        """What is told from now on is of this step."""
        self.size = size
        self.told = self.told | {"step": name, "said": "waits for a steady speed", "note": note, "caption": f"Step of the {name}", "time_ms": [], "measured": [], "model": [],
                                 "figures": None, "ripple": None}

    def measured(self, bench: Borrower, tell: Callable[[], None]) -> None:
        """Makes the step RECORDS times; `tell` after each."""
        name, speed_rpm = self.told["step"], bench.speed_rpm()

        def done(count: int) -> None:
            bench.stays()
            self.told = self.told | {"said": f"{count} of {step.RECORDS}"}
            tell()
        self.told = self.told | {"said": f"0 of {step.RECORDS}"}
        tell()
        size, found = {"current": self._current, "speed": self._speed, "load": self._load}[name](bench, done)
        self.told = self.told | {"caption": f"Step of the {name}, {size} at {speed_rpm:.0f} rpm", **_drawn(found)}

    def _current(self, bench: Borrower, done: step.Told) -> tuple[str, step.Answer]:
        expected = answers_of("current", bench, self.motor)
        found = step.current(bench, self.size / 100.0, done)
        return f"{self.size / 100.0 * bench.params['MAXIMUM_CURRENT_A']:.3g} A", answer("current", found, expected)

    def _speed(self, bench: Borrower, done: step.Told) -> tuple[str, step.Answer]:
        unit_rpm, most = bench.params["COUNT_SPEED_RPM"], bench.params["MAXIMUM_SPEED_RPM"]
        expected = answers_of("speed", bench, self.motor)
        try:
            bench.borrow()
            reference = bench.firmware.get(f"{RUN}.control.reference_erpm")
            if abs(reference) * (1.0 + self.size / 100.0) * unit_rpm > most:
                raise UserError(f"the step goes beyond MAXIMUM_SPEED_RPM, {most:g}", "loops", "choose a smaller step, or a lower speed")
            change = round(self.size / 100.0 * reference)
            if self._limited(bench, change):
                self.told = self.told | {"note": "Its first moment asks for more current than the limit allows: the model has no limit, and is quicker."}
            return f"{change * unit_rpm:.3g} rpm", answer("speed", step.speed(bench, seconds_of(bench), self.size / 100.0, done), expected)
        finally:
            bench.give_back()

    @staticmethod
    def _limited(bench: Bench, change: int) -> bool:
        get = bench.firmware.get
        return abs(get(f"{RUN}.control.ref_q13.q") + change * get(f"{RUN}.control.speed_kp_q13") / 8192.0) > get(f"{RUN}.control.iq_limit_q13")

    def _load(self, bench: Borrower, done: step.Told) -> tuple[str, step.Answer]:
        assert self.brake is not None and self.motor is not None
        brake, load_nm = self.brake, self.size / 100.0 * self.motor.rated_torque_nm
        expected = answers_of("load", bench, self.motor, load_nm)
        try:
            found = step.load(bench, seconds_of(bench), lambda on: brake(load_nm if on else 0.0), done)
        finally:
            brake(0.0)
        return f"{1e3 * load_nm:.3g} mN·m", answer("load", found, expected)

    def line(self) -> str:
        """For the log."""
        found = self.told["figures"]["measured"]
        return f"{self.told['caption']}: " + (f"dip {found['peak']:.1%}" if self.told["step"] == "load" else f"overshoot {max(found['peak'], 0.0):.1%}")

    def csv(self) -> str:
        """What was measured last."""
        told = self.told
        if not told["time_ms"]:
            raise UserError("no step is measured yet", "loops", "measure one first")
        rows = zip(told["time_ms"], told["measured"], told["model"])
        return "".join(",".join(row) + "\n" for row in [COLUMNS, *((f"{at / 1e3:.6g}", f"{one:.6g}", f"{other:.6g}") for at, one, other in rows)])


def _drawn(found: step.Answer) -> dict[str, Any]:
    """An answer as the page has it."""
    def rounded(values: np.ndarray, factor: float = 1.0) -> list[float]:
        return [float(f"{factor * value:.5g}") for value in values]
    figures = {name: {key: value if value is None or math.isfinite(value) else None for key, value in vars(step.figures(found.step, found.time_s, values)).items()}
               for name, values in (("measured", found.measured), ("model", found.expected))}
    return {"time_ms": rounded(found.time_s, 1e3), "measured": rounded(found.measured), "model": rounded(found.expected), "figures": figures, "ripple": round(found.ripple, 4)}
