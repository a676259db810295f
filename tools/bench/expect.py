"""Expectations: what a scenario says must hold, each kind read from [[expect]] and checked against the finished run.

docs/files.md lists the kinds with their keys."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tools.common.toml_file import REQUIRED, Section
from .metrics import MEASURE_VALUES, MEASURED_BY_FIRMWARE
from .run import Run
from .scenario import param
from tools.common.trace import Trace


@dataclass(frozen=True)
class Outcome:
    """One checked line: `row` names it, `got` and `allowed` are the numbers as text."""

    row: str
    ok: bool
    got: str
    allowed: str


@dataclass(frozen=True)
class Bounds:
    """An allowed range; at least one end is given."""

    minimum: float
    maximum: float

    @classmethod
    def read(cls, section: Section) -> "Bounds":
        low, high = section.number("min", None, meaning="at least; min, max or both"), section.number("max", None, meaning="at most")
        if low is None and high is None:
            raise section.fail("kind", "neither 'min' nor 'max' is there", "add one, or both")
        if low is not None and high is not None and low > high:
            raise section.fail("min", f"min = {low:g} is above max = {high:g}", "exchange them")
        return cls(-math.inf if low is None else low, math.inf if high is None else high)

    def hold(self, value: float | None) -> bool:
        return value is not None and self.minimum <= value <= self.maximum

    def text(self) -> str:
        if self.maximum == math.inf:
            return f"at least {self.minimum:g}"
        if self.minimum == -math.inf:
            return f"at most {self.maximum:g}"
        return f"{self.minimum:g} .. {self.maximum:g}"


def _number(value: float | None) -> str:
    return "nothing" if value is None or not math.isfinite(value) else f"{value:.4g}"


class Expectation:
    """Base of the kinds: read() takes a section (measures: see read_expectations), check() a finished run."""

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "Expectation":
        return cls()

    def check(self, run: Run) -> list[Outcome]:
        raise NotImplementedError

    def signals(self) -> list[str]:
        """Signals that must be recorded for it, besides the usual ones."""
        return []

    def variables(self) -> dict[str, int]:
        """Firmware variables (name, element count) to read at the end."""
        return {}

    def names(self) -> dict[str, str]:
        """Names that the firmware must know: "fault" or "state" and the name."""
        return {}

    def reads_firmware(self) -> bool:
        """Whether it looks into the firmware's variables, which a HEX file does not tell."""
        return bool(self.names() or self.variables() or any(name.startswith("fw.") for name in self.signals()))


def _window(section: Section, duration_s: float) -> tuple[float, float]:
    from_s = section.number("from_s", 0.0, 0.0, duration_s, "begin")
    to_s = section.number("to_s", duration_s, 0.0, duration_s, "end")
    if to_s < from_s:
        raise section.fail("to_s", f"to_s = {to_s:g} is before from_s = {from_s:g}", "choose a later one")
    return from_s, to_s


def _window_text(from_s: float, to_s: float) -> str:
    return f"{from_s:g} .. {to_s:g} s"


@dataclass(frozen=True)
class MeasureExpectation(Expectation):
    """kind `measure` or `speed`: a value of rows of the table."""

    measures: list[str]
    value: str
    bounds: Bounds

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "MeasureExpectation":
        speed = section.data["kind"] == "speed"
        section.note("measure", "text or list of texts", "name, or a list of names", *(["all with a reference"] if speed else []))
        referred = [name for name, has_reference in measures.items() if has_reference]
        names = referred if speed and referred and "measure" not in section else section.choices("measure", sorted(measures))
        value = "speed_error_percent" if speed else section.choice("value", tuple(MEASURE_VALUES), meaning="column, see below")
        for name in names:
            if value == "speed_error_percent" and not measures[name]:
                raise section.fail("kind" if speed else "value", f"'{name}' has no speed error", "add reference_rpm to the measure")
        percent = section.number("percent", 0.5, 0.0, meaning="at most this error") if speed else 0.0
        return cls(names, value, Bounds(-percent, percent) if speed else Bounds.read(section))

    def reads_firmware(self) -> bool:
        return self.value in MEASURED_BY_FIRMWARE

    def check(self, run: Run) -> list[Outcome]:
        found = {name: run.measures[name][self.value] for name in self.measures}
        return [Outcome(f"{name}: {self.value}", self.bounds.hold(got), _number(got), self.bounds.text()) for name, got in found.items()]


@dataclass(frozen=True)
class HandOverExpectation(Expectation):
    """kind `hand_over`: closed loop in time, without much overshoot."""

    press: int
    within_s: float
    overshoot_percent: float | None
    no_reverse_motion: bool

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "HandOverExpectation":
        return cls(section.integer("press", 1, 1, meaning="which press of S2"), section.number("within_s", 2.0, 0.0, meaning="how soon"),
                   section.number("overshoot_percent", None, 0.0, meaning="at most"), section.flag("no_reverse_motion", False, "true: never backwards"))

    def reads_firmware(self) -> bool:
        return True

    def check(self, run: Run) -> list[Outcome]:
        presses = run.press_times("S2")
        name = "hand-over" if self.press == 1 else f"hand-over after S2 number {self.press}"
        since = presses[self.press - 1] if len(presses) >= self.press else math.inf
        found = [item for item in run.hand_overs() if item.at_s > since]
        allowed = f"at most {self.within_s:g} s after S2"
        if not found:
            return [Outcome(f"{name}: closed loop", False, "never", allowed)]
        item = found[0]
        took = item.at_s - since
        outcomes = [Outcome(f"{name}: closed loop", took <= self.within_s, f"{took:.3f} s", allowed)]
        if self.overshoot_percent is not None:
            outcomes.append(Outcome(f"{name}: overshoot", item.overshoot_percent <= self.overshoot_percent,
                                    f"{item.overshoot_percent:.1f} %", f"at most {self.overshoot_percent:g} %"))
        if self.no_reverse_motion:
            outcomes.append(Outcome(f"{name}: no reverse motion", item.lowest_rpm >= 0.0,
                                    f"lowest speed {item.lowest_rpm:.0f} rpm", "at least 0 rpm"))
        return outcomes


RAMPS, COASTS = 0.0, 1.0
"""STOP_MODE: as a rule, and without a ramp: the outputs go off at any speed."""


def _braked_rows(run: Run, trace: Trace) -> int:
    """Rows until a short circuit of the winding that a stop begins (STOP_MODE 2) is over; 0 without one."""
    braked = np.flatnonzero(trace.column("fw.state") == run.state_number("BRAKE"))
    return int(braked[-1]) + 1 if len(braked) else 0


def _off_row(trace: Trace, from_row: int = 0) -> int | None:
    """First row from `from_row` on with all six outputs off."""
    off = np.flatnonzero(trace.column("pwm.outputs_on")[from_row:] == 0)
    return None if len(off) == 0 else from_row + int(off[0])


def _stays_off(run: Run, trace: Trace, off_row: int, to_row: int | None = None) -> bool:
    """No output is on after `off_row`. "pwm.outputs_seen" tells of the whole period before its row."""
    return not np.any(trace.column("pwm.outputs_seen")[off_row + 2 + run.order_rows:to_row])


@dataclass(frozen=True)
class StopExpectation(Expectation):
    """kind `stop`: outputs off in time, slow and without much braking current."""

    after_s: float
    within_s: float
    to_s: float
    speed_max_rpm: float | None
    lowest_rpm: float
    brake_max_a: float | None

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "StopExpectation":
        after_s = section.number("after_s", REQUIRED, 0.0, duration_s, "when S2 was pressed")
        return cls(after_s, section.number("within_s", REQUIRED, 0.0, meaning="how soon"),
                   section.number("to_s", duration_s, after_s, duration_s, "until when they stay off"),
                   section.number("speed_max_rpm", None, 0.0, meaning="no faster when they go off"),
                   section.number("lowest_rpm", 0.0, meaning="no slower on the way"),
                   section.number("brake_max_a", None, 0.0, meaning="braking current at most; MAXIMUM_CURRENT_A if not given"))

    def check(self, run: Run) -> list[Outcome]:
        part = run.trace.part(self.after_s, self.to_s)
        row, mode = _off_row(part, _braked_rows(run, part)), run.params.get("STOP_MODE", RAMPS)
        allowed = f"at most {self.within_s:g} s after {self.after_s:g} s, and to " + \
            ("the end" if self.to_s >= run.scenario.duration_s else f"{self.to_s:g} s")
        if row is None:
            return [Outcome("stop: outputs off", False, "never", allowed), *self._on_the_way(run, part)]
        took = float(part.time_s[row]) - self.after_s
        stays = _stays_off(run, part, row)
        got = f"{took:.3f} s" + ("" if stays else ", on again later")
        outcomes = [Outcome("stop: outputs off", took <= self.within_s and stays, got, allowed)]
        if self.speed_max_rpm is not None and mode != COASTS:
            speed = abs(float(part.column("plant.speed_rpm")[row]))
            outcomes.append(Outcome("stop: speed when the outputs go off", speed <= self.speed_max_rpm, f"{speed:.0f} rpm",
                                    f"at most {self.speed_max_rpm:g} rpm"))
        return outcomes + self._on_the_way(run, part)

    def _on_the_way(self, run: Run, part: Trace) -> list[Outcome]:
        """Lowest speed and largest braking current, both in the direction that the shaft had at S2."""
        speed, i_q = part.column("plant.speed_rpm"), part.column("plant.i_q")
        direction = -1.0 if speed[0] < 0.0 else 1.0
        lowest, brake = float(np.min(direction * speed)) + 0.0, float(np.max(-direction * i_q)) + 0.0
        most = param(run.params, "MAXIMUM_CURRENT_A") if self.brake_max_a is None else self.brake_max_a
        return [Outcome("stop: lowest speed", lowest >= self.lowest_rpm, f"{lowest:.1f} rpm", f"at least {self.lowest_rpm:g} rpm"),
                Outcome("stop: braking current", brake <= most, f"{brake:.2f} A", f"at most {most:g} A")]


@dataclass(frozen=True)
class WindowExpectation(Expectation):
    """Base of those that have nothing but their time."""

    from_s: float
    to_s: float

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "WindowExpectation":
        return cls(*_window(section, duration_s))


class OutputsOffExpectation(WindowExpectation):
    """kind `outputs_off`: no output is driven."""

    def check(self, run: Run) -> list[Outcome]:
        part = run.trace.part(self.from_s, self.to_s)
        on = np.flatnonzero(part.column("pwm.outputs_seen"))
        got = "on at %.4f s" % part.time_s[on[0]] if len(on) else ("off" if len(part) else "nothing")
        return [Outcome(f"outputs off {_window_text(self.from_s, self.to_s)}", got == "off", got, "all six off")]


@dataclass(frozen=True)
class SignalExpectation(Expectation):
    """kind `signal`: lowest and highest value of a signal."""

    row: str
    signal: str
    statistic: str
    bounds: Bounds
    from_s: float
    to_s: float

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "SignalExpectation":
        signal = section.text("signal", meaning="its name")
        statistic = section.choice("statistic", tuple(_STATISTICS), meaning="what of it")
        return cls(f"{signal} {statistic}", signal, statistic, Bounds.read(section), *_window(section, duration_s))

    def check(self, run: Run) -> list[Outcome]:
        column = run.trace.part(self.from_s, self.to_s).column(self.signal).astype(np.float64)
        got = float(_STATISTICS[self.statistic](column)) if len(column) else None
        row = f"{self.row} {_window_text(self.from_s, self.to_s)}"
        return [Outcome(row, self.bounds.hold(got), _number(got), self.bounds.text())]

    def signals(self) -> list[str]:
        return [self.signal]


@dataclass(frozen=True)
class BusVoltageExpectation(SignalExpectation):
    """Shorthand: lowest and highest bus voltage."""

    above_regen: bool

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "BusVoltageExpectation":
        return cls("bus voltage", "bus.voltage_v", "span", Bounds.read(section), *_window(section, duration_s),
                   section.flag("above_regen", False, "true: `max` counts from REGEN_LIMIT_V, at 24 V or in proportion"))

    def check(self, run: Run) -> list[Outcome]:
        column = run.trace.part(self.from_s, self.to_s).column(self.signal)
        bounds = self.bounds
        if self.above_regen: # the controllers are as quick on any supply: what overshoots is in proportion to it
            scale = max(run.params["NOMINAL_BUS_V"] / 24.0, 1.0)
            bounds = Bounds(bounds.minimum, run.params["REGEN_LIMIT_V"] + scale * bounds.maximum)
        if not len(column):
            return [Outcome(self.row, False, "nothing", bounds.text() + " V")]
        low, high = float(column.min()), float(column.max())
        return [Outcome(f"{self.row} {_window_text(self.from_s, self.to_s)}", bounds.hold(low) and bounds.hold(high),
                        f"{low:.2f} .. {high:.2f} V", bounds.text() + " V")]


_STATISTICS: dict[str, Callable[[np.ndarray], Any]] = {
    "mean": np.mean, "min": np.min, "max": np.max, "rms": lambda x: np.sqrt(np.mean(x * x)), "peak": lambda x: np.max(np.abs(x)),
    "span": np.ptp, "last": lambda x: x[-1], "distinct": lambda x: len(np.unique(x))}


@dataclass(frozen=True)
class StateExpectation(Expectation):
    """kind `state`: the only state of the drive in its time."""

    name: str
    from_s: float
    to_s: float
    never: bool

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "StateExpectation":
        name = section.text("name", meaning="state, as in docs/law.md")
        at_s = section.number("at_s", None, 0.0, duration_s, "then; or from_s and to_s")
        never = section.flag("never", False, "true: it must not occur")
        if at_s is None:
            return cls(name, *_window(section, duration_s), never)
        return cls(name, at_s, at_s, never)

    def names(self) -> dict[str, str]:
        return {"state": self.name}

    def check(self, run: Run) -> list[Outcome]:
        part = run.trace.part(self.from_s, max(self.to_s, self.from_s + 1.5 * run.trace.period_s))
        there = part.column("fw.state") == run.state_number(self.name)
        when = f"at {self.from_s:g} s" if self.from_s == self.to_s else _window_text(self.from_s, self.to_s)
        seen = [run.states.get(int(value), "?") for _, value in part.changes("fw.state")]
        got = " ".join(dict.fromkeys(seen)) or "nothing"
        if self.never:
            return [Outcome(f"state never {self.name} {when}", len(part) > 0 and not np.any(there), got, f"not {self.name}")]
        return [Outcome(f"state {when}", len(part) > 0 and bool(np.all(there)), got, self.name)]


@dataclass(frozen=True)
class FaultExpectation(Expectation):
    """kind `fault`: the named fault comes in time, switches off and stays until S2."""

    name: str
    after_s: float
    within_s: float
    outputs_off_within_periods: int
    from_cause: bool
    kept_to_s: float | None
    cleared_from_s: float | None

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "FaultExpectation":
        return cls(section.text("name", meaning="as in docs/faults.md"), section.number("after_s", REQUIRED, 0.0, duration_s, "when its cause begins"),
                   section.number("within_s", REQUIRED, 0.0, meaning="how soon it comes"),
                   section.integer("outputs_off_within_periods", 1, 0, meaning="PWM periods from the fault to the outputs off"),
                   section.flag("from_cause", False, "true: from the cause"),
                   section.number("kept_to_s", None, 0.0, duration_s, "the code stays until then"),
                   section.number("cleared_from_s", None, 0.0, duration_s, "no fault from then on"))

    def names(self) -> dict[str, str]:
        return {"fault": self.name}

    def check(self, run: Run) -> list[Outcome]:
        title = f"fault {self.name}"
        raised = run.raised()
        allowed = f"{self.name} within {self.within_s:g} s of {self.after_s:g} s"
        if not raised:
            return [Outcome(f"{title}: raised", False, "no fault", allowed)]
        row, at_s, name = raised[0]
        ok = name == self.name and self.after_s <= at_s <= self.after_s + self.within_s
        outcomes = [Outcome(f"{title}: raised", ok, f"{name} at {at_s:.4f} s", allowed), self._outputs(run, title, row)]
        if self.kept_to_s is not None:
            outcomes.append(self._code(run, f"{title}: kept to {self.kept_to_s:g} s", at_s, self.kept_to_s, self.name))
        if self.cleared_from_s is not None:
            outcomes.append(self._code(run, f"{title}: cleared from {self.cleared_from_s:g} s", self.cleared_from_s, math.inf,
                                       run.faults.get(0, "NONE")))
        return outcomes

    def _outputs(self, run: Run, title: str, fault_row: int) -> Outcome:
        """The row after `first` is one period later."""
        first = int(np.searchsorted(run.trace.time_s, self.after_s)) if self.from_cause else fault_row
        off = _off_row(run.trace, first)
        periods = None if off is None else (off - first) * run.trace.step
        kept = off is not None and _stays_off(run, run.trace, off, self._kept_row(run))
        thinned = f", of which the trace has one of {run.trace.step}" if run.trace.step > 1 else ""
        got = "never" if periods is None else f"{periods} periods{thinned}" + ("" if kept else ", on again later")
        origin = "cause" if self.from_cause else "fault"
        return Outcome(f"{title}: outputs off", kept and periods is not None and periods <= self.outputs_off_within_periods, got,
                       f"at most {self.outputs_off_within_periods} after the {origin}")

    def _kept_row(self, run: Run) -> int | None:
        if self.kept_to_s is None:
            return None
        return int(np.searchsorted(run.trace.time_s, self.kept_to_s))

    @staticmethod
    def _code(run: Run, row: str, from_s: float, to_s: float, name: str) -> Outcome:
        codes = np.unique(run.trace.part(from_s, to_s).column("fw.fault"))
        got = " ".join(run.faults.get(int(code), "?") for code in codes) or "nothing"
        return Outcome(row, got == name, got, name)


class NoFaultExpectation(WindowExpectation):
    """kind `no_fault`: none in its time."""

    def reads_firmware(self) -> bool:
        return True

    def check(self, run: Run) -> list[Outcome]:
        part = run.trace.part(self.from_s, self.to_s)
        raised = [(part.time_s[row], run.faults.get(int(code), "?")) for row, code in part.changes("fw.fault") if code != 0]
        got = f"{raised[0][1]} at {raised[0][0]:.4f} s" if raised else "none"
        return [Outcome(f"no fault {_window_text(self.from_s, self.to_s)}", not raised and len(part) > 0, got, "none")]


class NoWarningsExpectation(Expectation):
    """kind `no_warnings`: the virtual board has nothing to say."""

    def check(self, run: Run) -> list[Outcome]:
        return [Outcome("no warnings of the board", not run.warnings, run.warnings[0] if run.warnings else "none", "none")]


@dataclass(frozen=True)
class SentExpectation(Expectation):
    """kind `sent`: lines on the serial line."""

    text: str
    never: bool

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "SentExpectation":
        return cls(section.text("text", meaning="what the firmware must have sent, anywhere in a line"),
                   section.flag("never", False, "true: it must not"))

    def check(self, run: Run) -> list[Outcome]:
        found = self.text in run.sent
        return [Outcome(f"sent: {self.text}", found != self.never, "sent" if found else "not sent", "never" if self.never else "sent")]


@dataclass(frozen=True)
class VariableExpectation(Expectation):
    """kind `variable`: a firmware variable at the end of the run."""

    name: str
    count: int
    statistic: str
    bounds: Bounds

    @classmethod
    def read(cls, section: Section, measures: dict[str, bool], duration_s: float) -> "VariableExpectation":
        return cls(section.text("name", meaning="its name, as a debugger knows it"), section.integer("count", 1, 1, 1000, "16-bit elements"),
                   section.choice("statistic", tuple(_STATISTICS), meaning="what of them"), Bounds.read(section))

    def check(self, run: Run) -> list[Outcome]:
        got = float(_STATISTICS[self.statistic](np.array(run.variables[self.name][:self.count], dtype=np.float64)))
        return [Outcome(f"{self.name} {self.statistic}", self.bounds.hold(got), _number(got), self.bounds.text())]

    def variables(self) -> dict[str, int]:
        return {self.name: self.count}


@dataclass(frozen=True)
class Kind:
    """A kind of [[expect]]: what docs/files.md says of it, and what it checks."""

    meaning: str
    parts: tuple[type[Expectation], ...]


KINDS = {
    "measure": Kind("values of rows of the table", (MeasureExpectation,)),
    "speed": Kind("the true mean speed holds the reference", (MeasureExpectation,)),
    "hand_over": Kind("closed loop after S2", (HandOverExpectation,)),
    "stop": Kind("outputs off after S2, and off to the end", (StopExpectation,)),
    "outputs_off": Kind("all six outputs off", (OutputsOffExpectation,)),
    "bus_voltage": Kind("lowest and highest bus voltage", (BusVoltageExpectation,)),
    "signal": Kind("a signal of the trace: a readable key below or of `make keys`", (SignalExpectation,)),
    "state": Kind("the drive's state", (StateExpectation,)),
    "fault": Kind("a fault", (FaultExpectation,)),
    "no_fault": Kind("no fault", (NoFaultExpectation,)),
    "no_warnings": Kind("the virtual board found nothing wrong with the firmware's settings", (NoWarningsExpectation,)),
    "clean": Kind("no fault and no warnings", (NoFaultExpectation, NoWarningsExpectation)),
    "sent": Kind("a text that the firmware has sent on its serial line", (SentExpectation,)),
    "variable": Kind("a firmware variable at the end", (VariableExpectation,))}


def read_expectations(section: Section, measures: dict[str, bool], duration_s: float) -> list[Expectation]:
    """What one [[expect]] table asks for. `measures` holds the known measures' names, and whether they have a reference speed."""
    kind = section.choice("kind", tuple(KINDS), meaning="what must hold; each has its keys below")
    found = [part.read(section, measures, duration_s) for part in KINDS[kind].parts]
    section.close()
    return found
