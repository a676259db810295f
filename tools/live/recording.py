"""What somebody did at the board since power-up, and what it did: saved as a scenario that `make run` repeats, or as CSV."""

import itertools
import json
import shlex
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from tools.bench import build
from tools.common import output, paths
from tools.common.board_keys import Part
from tools.common.errors import UserError
from tools.common.trace import Trace

LONGEST_S = 120.0
"""As long as a scenario may be; of the trace the last so many seconds are kept."""
SHORTEST_S = 0.2
POT, BUTTONS = "input.pot", {"input.s2": "S2", "input.s3": "S3"}
FAULT_MARGIN_S = 0.1
"""Around the moment of a fault, in what the scenario expects."""

SENT = "# The events send_hex are what the scope said on the serial line: without them the run is not the same to the last bit.\n"


@dataclass(frozen=True)
class Origin:
    """What was run: a scenario needs the same to repeat it."""

    motor: Part
    board: Part
    defines: list[str]
    words: dict[str, str]
    """variables of make beside SCENARIO, e.g. MOTOR"""


@dataclass
class Recording:
    """From one power-up on."""

    origin: Origin
    plant: dict[str, float]
    """what differed from motor and board file at power-up"""
    signals: list[str]
    row_s: float
    """time between two rows of the trace"""
    actions: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    sent: list[tuple[float, str]] = field(default_factory=list)
    """what the scope has said on the serial line. A character brings the main loop's next pass forward, and all that follows is a little other."""
    states: list[tuple[float, str]] = field(default_factory=list)
    faults: list[tuple[float, str]] = field(default_factory=list)
    rows: deque[tuple[np.ndarray, np.ndarray]] = field(default_factory=deque)

    def add_rows(self, times: np.ndarray, rows: np.ndarray) -> None:
        """More of the trace; what is too old goes. Copied: a part of an array would keep the whole."""
        self.rows.append((np.array(times), np.array(rows)))
        while self.rows[0][0][-1] < times[-1] - LONGEST_S:
            self.rows.popleft()

    def trace(self) -> Trace:
        """What is kept of it."""
        if not self.rows:
            raise UserError("nothing is recorded yet", "CSV", "wait a moment")
        times, rows = zip(*self.rows)
        return Trace(self.signals, np.concatenate(times), np.ascontiguousarray(np.concatenate(rows).T))

    def csv(self) -> str:
        """The trace as text."""
        return "".join(output.trace_lines(self.trace()))

    def toml(self, end_s: float) -> str:
        """The scenario, as tools/bench/scenario_file.py reads it."""
        if end_s > LONGEST_S:
            raise UserError(f"{end_s:.0f} s since power-up", "scenario", f"it can have {LONGEST_S:g} s: power up again and be quicker")
        if end_s < SHORTEST_S:
            raise UserError("nothing has happened yet", "scenario", "do something first")
        words = " ".join(f"{name}={shlex.quote(word)}" for name, word in self.origin.words.items())
        parts = [f"# Recorded at the page of make live. Run it again: make run SCENARIO=./recorded.toml{' ' * bool(words)}{words}\n"
                 + SENT * bool(self.sent) +
                 f'title = "recorded: {self._title()}"\n'
                 f"motor = {_text(_name(self.origin.motor, paths.MOTORS))}\nboard = {_text(_name(self.origin.board, paths.BOARDS))}\n"
                 f"duration_s = {_number(end_s)}\n"]
        if self.origin.defines:
            macros = [text for text in self.origin.defines if not text.startswith(build.APP)]
            apps = [f"app = {_text(text.removeprefix(build.APP))}\n" for text in self.origin.defines if text not in macros]
            parts.append("".join(["[firmware]\n", *([f"defines = {json.dumps(macros)}\n"] if macros else []), *apps]))
        if self.plant:
            parts.append("[plant]\n" + "".join(f"{_text(key)} = {_number(value)}\n" for key, value in self.plant.items()))
        sent = (_event(at_s, f"send_hex = {_text(text.encode('latin-1').hex(' '))}") for at_s, text in self.sent)
        return "\n".join([*parts, *self._events(end_s), *sent, *self._expectations(end_s)])

    def _title(self) -> str:
        return ", ".join(name for name, _ in itertools.groupby(name for _, name in self.states))[:100] or "at rest"

    def _events(self, end_s: float) -> Iterator[str]:
        """Each button once, with how long it was held; the other changes as they were."""
        for at_s, keys in self.actions:
            for key, value in keys.items():
                if key in BUTTONS and value:
                    up_s = next((up_s for up_s, later in self.actions if up_s > at_s and later.get(key) == 0.0), end_s)
                    yield _event(at_s, f"press = {_text(BUTTONS[key])}\nhold_s = {_number(max(up_s - at_s, 0.001))}")
                elif key == POT:
                    yield _event(at_s, f"pot = {_number(value)}")
            others = {key: value for key, value in keys.items() if key not in BUTTONS and key != POT}
            if others:
                yield _event(at_s, "set = { " + ", ".join(f"{_text(key)} = {_number(value)}" for key, value in others.items()) + " }")

    def _expectations(self, end_s: float) -> Iterator[str]:
        """What the drive did: its first fault, or none; and its state at the end."""
        if self.faults:
            at_s, name = self.faults[0]
            after_s = max((time for time, _ in self.actions if time < at_s), default=0.0)
            yield _expect("fault", f"name = {_text(name)}\nafter_s = {_number(after_s)}\nwithin_s = {_number(at_s - after_s + FAULT_MARGIN_S)}")
        else:
            yield _expect("no_fault")
        if self.states and self.states[-1][0] < end_s - FAULT_MARGIN_S:
            yield _expect("state", f"name = {_text(self.states[-1][1])}\nat_s = {_number(end_s - 0.5 * FAULT_MARGIN_S)}")


def _name(part: Part, folder) -> str:
    """As a scenario names it: of the project's own files the stem."""
    return part.path.stem if part.path.resolve().parent == folder.resolve() else str(part.path.resolve())


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _number(value: float) -> str:
    """Exact, and whole numbers as such."""
    return f"{round(value, 9):.9f}".rstrip("0").rstrip(".") if 1e-3 <= abs(value) < 1e6 or value == 0.0 else repr(float(value))


def _event(at_s: float, what: str) -> str:
    return f"[[event]]\nat_s = {_number(at_s)}\n{what}\n"


def _expect(kind: str, more: str = "") -> str:
    return f"[[expect]]\nkind = {_text(kind)}\n{more}{chr(10) * bool(more)}"
