"""The loops of the running motor on the page, and its steps (step_response.py): measured over the scope's link, beside the tuner's model (docs/response.md). The
motor is neither started nor stopped for it; the scope's own traces wait meanwhile. Only of a firmware with `run.sine`."""

import contextlib
import math
import threading
from collections import deque
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from tools.bench.report import clean
from tools.common import motor_file
from tools.common.errors import UserError

from . import response, step
from .lnet import Lnet, LnetError
from .response import Bench, Firmware, Point
from .response_model import COLUMNS, WITHIN_DEG, Result, decibels_and_degrees, model_of
from .scope import Scope
from .step import STEPS
from .step_response import Borrower, StepResponse
from .symbols import Symbols

OPEN_LOOP, TORQUE = "OPEN_LOOP_FUNCTIONING", "TORQUE_MODE"
LINE_POINTS = 80
"""Of the model's line."""
FOLLOWS = ("In closed loop the estimator's angle follows the voltage that the sine takes in the winding: the margin measured is some degrees less. "
           "OPEN_LOOP_FUNCTIONING measures it with the forced angle.")
STEP_FOLLOWS = ("In closed loop the estimator's angle follows the voltage that the step takes in the winding, and the rotor gains speed: the current comes back a "
                "little. OPEN_LOOP_FUNCTIONING measures it with the forced angle.")


class Cancelled(Exception):
    """Somebody has pressed Cancel."""


class LoopResponse:
    """For one board. run() belongs to the scope's thread, the others to the page's. `clock` is the motor's time; `modes` are the firmware's."""

    def __init__(self, symbols: Symbols, params: Mapping[str, float], motor: motor_file.Motor | None, modes: Collection[str], clock: Callable[[], float],
                 brake: Callable[[float], None] | None = None) -> None:
        self.symbols, self.params, self.motor, self.clock = symbols, params, motor, clock
        self.modes = {mode.partition("=")[0] for mode in modes}
        self.count, self.rounds = response.POINTS, response.ROUNDS
        self.lock = threading.Lock()
        self.asked: str | None = None
        """what is measured, in words"""
        self.step: str | None = None
        """which step it is; None: a loop"""
        self.steps = StepResponse(motor, brake)
        self.override: Callable[[int | None], None] = lambda erpm: None
        """tells a page that has the command which target a step means"""
        self.changed: Callable[[], Any] = lambda: None
        """the parameters that are not the header's at this moment"""
        self.was: dict[str, Any] = {}
        """what they were when a loop or a step was measured"""
        self.cancelled = False
        self.publish: Callable[[dict[str, Any]], None] = lambda message: None
        self.wake: Callable[[], None] = lambda: None
        self.news: deque[str] = deque()
        """lines for the log"""
        self.told: dict[str, Any] = {"loop": None, "running": False, "done": 0, "of": 0, "said": "", "note": "", "speed_rpm": None, "points": [], "line": [],
                                     "margins": None}

    @staticmethod
    def of(symbols: Symbols | None, params: Mapping[str, float], motor: motor_file.Motor | None, modes: Collection[str],
           clock: Callable[[], float], brake: Callable[[float], None] | None = None) -> "LoopResponse | None":
        """None of a firmware without the sine."""
        return LoopResponse(symbols, params, motor, modes, clock, brake) if symbols is not None and response.has_sine(symbols) else None

    def attach(self, scope: Scope) -> None:
        """The scope lends its thread and its link."""
        scope.guest, self.publish, self.wake = self, scope.publish, scope.changed.set

    # ---- the page ----------------------------------------------------------------------------------------------------------
    def hello(self) -> dict[str, Any]:
        """For a new tab."""
        return self.steps.hello() | self.told | {"answer": self.steps.told}

    def frame(self, state: str) -> dict[str, Any]:
        """Why each loop and step cannot be measured in this state of the drive, None: it can; and which results are of other parameters."""
        return {"why": self.refusals(state), "old": [name for name, values in self.was.items() if values != self.changed()]}

    def refusals(self, state: str) -> dict[str, str | None]:
        """By name; a step's begins with "step"."""
        return {loop: self._refusal(loop, state) for loop in response.LOOPS} | {
            f"step {name}": self._refusal(name, state) or self.steps.refusal(name, state) for name in STEPS}

    def _refusal(self, loop: str, state: str) -> str | None:
        if self.asked is not None:
            return f"the {self.asked} is being measured"
        if loop != "current" and TORQUE in self.modes:
            return f"{TORQUE} has no speed loop"
        if state == "CLOSED" or (state == "RAMP" and loop == "current" and OPEN_LOOP in self.modes):
            return None
        return "loops and steps are measured while the motor turns, in CLOSED" + (", the current loop in RAMP, too" if OPEN_LOOP in self.modes else "")

    def ask(self, wish: Any, state: str) -> None:
        """"speed", "current", {"step": "load", "size": 40} or "cancel", in this state of the drive."""
        with self.lock:
            if wish == "cancel":
                if self.asked is None:
                    raise UserError("nothing is being measured", "loops", "nothing to cancel")
                self.cancelled = True
                return
            name, size = StepResponse.read(wish) if isinstance(wish, dict) else (wish, None)
            if size is None and name not in response.LOOPS:
                raise UserError(f"no loop '{name}'", "loops", "choose one of " + ", ".join(response.LOOPS))
            refusal = self.refusals(state)[name if size is None else f"step {name}"]
            if refusal is not None:
                raise UserError(refusal, "loops", "cancel that or wait" if self.asked is not None else "start the motor and wait for the state"
                                if state != "CLOSED" else "choose another one")
            self.asked, self.step, self.cancelled = f"{name} loop" if size is None else f"step of the {name}", None if size is None else name, False
        self.news.append(f"measure the {self.asked}")
        note = FOLLOWS if name == "current" and state == "CLOSED" else ""
        if size is not None:
            self.steps.begin(name, size, note and STEP_FOLLOWS)
            self._tell(running=True)
        else:
            self._tell(loop=name, running=True, done=0, of=0, said="waits for a steady speed", note=note, speed_rpm=None, points=[], line=[], margins=None)
        self.wake()

    @property
    def borrows(self) -> bool:
        """A step of the speed has the command."""
        return self.asked is not None and self.step == "speed"

    def csv(self) -> str:
        """The loop that was measured last."""
        told = self.told
        if not told["points"]:
            raise UserError("no loop is measured yet", "loops", "measure one first")
        return "".join(",".join(row) + "\n" for row in [COLUMNS, *([f"{number:.6g}" for number in row] for row in told["points"])])

    def _tell(self, **news: Any) -> None:
        self.told = clean(self.told | news)
        self.publish({"loops": self.told | {"answer": self.steps.told}})

    # ---- the scope's thread ------------------------------------------------------------------------------------------------
    def run(self, link: Lnet, moment: Callable[[], None]) -> None:
        """Measures what is asked for. `moment` lets the link's other work go on."""
        said = ""
        bench = Borrower(Firmware(link, self.symbols), self.params, lambda seconds: self._pause(bench, seconds, moment), self.rounds)
        bench.override = self.override
        try:
            said = self._measured(bench)
        except Cancelled:
            said = "cancelled"
        except UserError as error:
            said = str(error)
        except LnetError as error:
            said = f"no connection: {error}"
            raise
        finally:
            with contextlib.suppress(LnetError):
                bench.end()
            self._ended(said or "the page's server has failed")

    def _pause(self, bench: Bench, seconds: float, moment: Callable[[], None]) -> None:
        """So much of the motor's time, in which it may leave its state and somebody may cancel."""
        end_s = self.clock() + seconds
        while True:
            moment()
            if self.cancelled:
                raise Cancelled
            bench.stays()
            if self.clock() >= end_s:
                return

    def _measured(self, bench: Borrower) -> str:
        """What is said in the end."""
        loop = str(self.step or self.told["loop"])
        bench.turning = bench.state()
        if bench.turning != "CLOSED" and (loop != "current" or bench.turning != "RAMP"): # since somebody has asked
            raise UserError(f"the motor has left CLOSED: {bench.turning}", "loops", "start it and measure again")
        bench.settles()
        self.was["loop" if self.step is None else "step"] = self.changed()
        if self.step is not None:
            self.steps.measured(bench, self._tell)
            return "done"
        frequencies, model, speed_rpm = bench.frequencies(loop, self.count), model_of(loop, bench, self.motor), bench.speed_rpm()
        half = 0.5 / response.TURN / bench.period_s # the firmware's sines have whole steps
        hz = np.geomspace(max(frequencies[0] - half, half), frequencies[-1] + half, LINE_POINTS)
        line = [_rounded([at, *decibels_and_degrees(value)]) for at, value in zip(hz, model(hz))]
        self._tell(of=len(frequencies), said="", speed_rpm=round(speed_rpm), line=line)
        found: list[Point] = []
        for point in bench.points(loop, frequencies):
            found.append(point)
            result = Result.of(loop, found, model, speed_rpm)
            self._tell(done=len(found), points=[_rounded(row) for row in result.table], margins=_margins(result))
        return "done"

    def _ended(self, said: str) -> None:
        """Says how, and lends the link no more."""
        what, whole = self.asked, said == "done"
        if self.step is not None:
            self.news.append(self.steps.line() if whole else f"{what}: {said}")
            self.steps.told = self.steps.told | {"said": f"mean of {step.RECORDS} steps" if whole else said}
        elif whole:
            margins = self.told["margins"]
            self.told["said"] = f"{self.told['of']} points measured"
            self.news.append(f"{what}: " + (f"phase margin {margins['measured'][0]:.1f} degrees" if margins["measured"][1] else "no crossover in the range"))
        else:
            done, of = self.told["done"], self.told["of"]
            self.told["said"] = f"{said}; {done} of {of} points measured" if of else said
            self.news.append(f"{what}: {self.told['said']}")
        with self.lock:
            self.asked = None
        self._tell(running=False)


def measured_loop(loops: LoopResponse | None) -> LoopResponse:
    """Refused where there is none."""
    if loops is None:
        raise UserError("the firmware has no sine for its loops", "loops", "build it with SCOPE 1")
    return loops


def _rounded(row: list[float]) -> list[float]:
    return [float(f"{number:.5g}") for number in row]


def _margins(result: Result) -> dict[str, Any] | None:
    """Degrees and hertz of both, where the gain crosses 1 in what is measured; the difference where both do."""
    found = {name: [round(margins.phase_deg, 2), float(f"{margins.crossover_hz:.4g}")] if math.isfinite(margins.crossover_hz) else [None, None]
             for name, margins in (("measured", result.measured), ("model", result.expected))}
    both = None not in (found["measured"][1], found["model"][1])
    return found | {"difference": round(result.difference_deg, 2) if both else None, "within": WITHIN_DEG}
