"""The scope on the page: sets up the firmware's own scope over its serial line (docs/scope.md), waits, and hands on each trace.

One thread owns the link, because requests take turns."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from tools.common import drive_tables
from tools.common.errors import UserError

from . import lnet, view
from .scale import scale_of
from .symbols import Symbols, Variable

MODES = ("auto", "normal", "single", "stop")
"""auto: without a trigger for a while a trace comes all the same; normal: only with one; single: one trace, then stop."""
AUTO_S = 0.4
POLL_S = 0.02
WIDTHS = (2, 4)
"""Bytes that it records."""
AGAIN_S = 0.5
"""After an error of the link."""
MOST_FACTOR = 1000
USUAL = ("board_drive.run.control.i_q13.d", "board_drive.run.control.i_q13.q", "board_drive.angle", "board_drive.run.estimator.omega_erpm")
"""What it shows at first."""
STATE, FAULT = "board_drive.state", "board_drive.fault"
RECORDER = ("board_drive.phases_q13.a", "board_drive.phases_q13.b", "board_drive.run.control.v_q14.d", "board_drive.run.control.v_q14.q", "board_drive.angle",
            "board_drive.run.estimator.omega_erpm", STATE, FAULT)
"""What it records around a fault: what the fault recorder does (docs/faults.md), whose place in RAM it has."""


@dataclass(frozen=True)
class Setup:
    """What somebody has asked for."""

    channels: tuple[Variable, ...]
    trigger: Variable | None
    level: float
    """in the trigger's unit"""
    rising: bool
    position: float
    """share of the trace before the trigger"""
    factor: int
    """periods from row to row"""
    mode: str


class Guest(Protocol):
    """Other work that needs the firmware's scope for a while."""

    asked: Any
    """None: nothing to do"""

    def run(self, link: lnet.Lnet, moment: Callable[[], None]) -> None:
        """Does it, and calls `moment` now and then."""


class Scope(threading.Thread):
    """`open_link` makes the link, `publish` gets messages for the pages. `beat` runs between two requests: other work that needs the link."""

    def __init__(self, open_link: Callable[[], lnet.Lnet], symbols: Symbols, params: Mapping[str, float], publish: Callable[[dict], None],
                 beat: Callable[[lnet.Lnet], None] = lambda link: None) -> None:
        super().__init__(name="scope", daemon=True)
        self.open_link, self.symbols, self.params, self.publish, self.beat = open_link, symbols, params, publish, beat
        self.period_s = params["LOOPTIME_SEC"]
        self.setup: Setup | None = None
        self.link: lnet.Lnet | None = None
        self.guest: Guest | None = None
        self.lent = False
        """The guest has the firmware's scope; the traces come back afterwards."""
        self.ended = False
        self.answer_s = lnet.ANSWER_S
        """How long it waits for an answer; a board that runs slower than real time answers later."""
        self.changed = threading.Event()
        self.told: dict[str, Any] = {"setup": self.first(), "status": "stop"}
        self.trace: dict[str, Any] | None = None

    def first(self) -> dict[str, Any]:
        """What the page shows before anybody has chosen."""
        names = [name for name in USUAL if name in self.symbols.variables] or list(self.symbols.variables)[:1]
        return {"channels": names, "trigger": names[0], "level": 0.0, "rising": True, "position": 0.25, "factor": 2, "mode": "stop"}

    def recorder(self) -> dict[str, Any]:
        """The setup that waits for a fault: the rows are as far apart as the fault recorder's."""
        names = [name for name in RECORDER if name in self.symbols.variables]
        return {"channels": names, "trigger": STATE, "level": float(list(view.states()).index("FAULT")), "rising": True, "position": 0.75, "factor": 4,
                "mode": "normal"}

    def hello(self) -> dict[str, Any]:
        """For a new tab: every variable that it can record, and what is set up."""
        units = {name: scale_of(name, self.params).unit for name, item in self.symbols.variables.items() if item.bytes in WIDTHS}
        return {"variables": units, "period_s": self.period_s, "most_words": lnet.MOST_WORDS, "fault": self.recorder(), **self.told, "trace": self.trace}

    def end(self) -> None:
        """Returns soon."""
        self.ended = True
        self.changed.set()
        if self.is_alive():
            self.join(2.0)

    # ---- what somebody asks for --------------------------------------------------------------------------------------------
    def ask(self, wish: Any) -> None:
        """A setup as the page sends it; refused in one line where it makes no sense."""
        self.setup = self._read(wish)
        self._tell(setup=wish, status=self._status())
        self.changed.set()

    def _read(self, wish: Any) -> Setup:
        keys = {"channels", "trigger", "level", "rising", "position", "factor", "mode"}
        if not isinstance(wish, dict) or set(wish) != keys:
            raise UserError("no setup", "scope", "give " + ", ".join(sorted(keys)))
        if not isinstance(wish["channels"], list) or not wish["channels"]:
            raise UserError("no channel", "scope", "choose a variable")
        channels = tuple(self._named(name) for name in wish["channels"])
        trigger = None if wish["trigger"] is None else self._named(wish["trigger"])
        words = sum(item.bytes // 2 for item in channels)
        if {item.bytes for item in channels} - set(WIDTHS) or trigger and trigger.bytes != 2:
            raise UserError("a variable that has neither 16 nor 32 bits, or a trigger that has not 16", "scope", "choose another one")
        if words > lnet.MOST_WORDS:
            raise UserError(f"{words} words in a row", "scope", f"it can have {lnet.MOST_WORDS}: choose fewer variables")
        if wish["mode"] not in MODES:
            raise UserError(f"no mode '{wish['mode']}'", "scope", "choose one of " + ", ".join(MODES))
        level, position = _number(wish, "level", -1e9, 1e9), _number(wish, "position", 0.0, 1.0)
        return Setup(channels, trigger, level, wish["rising"] is True, position, round(_number(wish, "factor", 1, MOST_FACTOR)), wish["mode"])

    def _named(self, name: Any) -> Variable:
        return self.symbols.find(name if isinstance(name, str) else str(name))

    def _status(self) -> str:
        return "lent" if self.lent else "stop" if self.setup is None or self.setup.mode == "stop" else "waits"

    def _tell(self, **news: Any) -> None:
        self.told = self.told | news
        self.publish({"scope": self.told})

    # ---- the thread --------------------------------------------------------------------------------------------------------
    def run(self) -> None:
        while not self.ended:
            try:
                if self.link is None:
                    self.link = self.open_link()
                    self.link.device_info()
                    if self.told["status"] not in ("waits", "stop"): # it answers again
                        self._tell(status=self._status())
                self._round(self.link)
            except (lnet.LnetError, OSError) as error:
                self.link = None
                self._tell(status=f"no connection: {error}")
                self.changed.wait(AGAIN_S)
            except UserError as error:
                self.link = None
                self._tell(status=str(error))
                self.changed.wait(AGAIN_S)

    def _round(self, link: lnet.Lnet) -> None:
        """One trace, or a moment without one."""
        setup = self.setup
        self.changed.clear()
        link.answer_s = self.answer_s
        self.beat(link)
        if self.guest is not None and self.guest.asked is not None:
            self._lend(link, self.guest)
            return
        if setup is None or setup.mode == "stop":
            self.changed.wait(POLL_S)
            return
        self.publish({"armed": True})
        begun_s, size = time.monotonic(), link.scope_state().size
        self._start(link, setup, setup.trigger is not None, size)
        while link.scope_state().running:
            self.beat(link)
            if self.changed.wait(POLL_S):
                link.scope_stop()
                return
            late = setup.mode == "auto" and time.monotonic() > begun_s + AUTO_S * link.answer_s + 2.0 * self._length_s(setup, size) * link.answer_s
            if late and setup.trigger is not None:
                setup = Setup(setup.channels, None, 0.0, True, 0.0, setup.factor, "auto")
                self._start(link, setup, False, size)
        rows = link.scope_read()
        if rows: # none where the board has been switched off meanwhile
            self._hand_on(setup, rows)

    def _lend(self, link: lnet.Lnet, guest: Guest) -> None:
        """The traces wait until the guest has done."""
        def moment() -> None:
            if self.ended:
                raise lnet.LnetError("the server has ended")
            link.answer_s = self.answer_s
            self.beat(link)
            time.sleep(POLL_S)
        self.lent = True
        self._tell(status="lent")
        try:
            guest.run(link, moment)
            link.scope_stop()
        finally:
            self.lent = False
            self._tell(status=self._status())

    def _length_s(self, setup: Setup, size: int) -> float:
        return size / sum(item.bytes for item in setup.channels) * setup.factor * self.period_s

    def _start(self, link: lnet.Lnet, setup: Setup, waits: bool, size: int) -> None:
        rows = size // sum(item.bytes for item in setup.channels)
        trigger = None
        if waits and setup.trigger is not None:
            level = round(setup.level / scale_of(setup.trigger.name, self.params).per_count)
            low, high = (-32768, 32767) if setup.trigger.signed else (0, 65535)
            trigger = lnet.Trigger(setup.trigger.address, min(max(level, low), high), setup.rising, setup.trigger.signed)
        link.scope_setup([item.channel for item in setup.channels], trigger, -round(setup.position * (rows - 1)) if trigger else 0, setup.factor)

    def _hand_on(self, setup: Setup, rows: list[tuple[int, ...]]) -> None:
        """A trace in engineering units; its times are relative to the trigger."""
        scales = [scale_of(item.name, self.params) for item in setup.channels]
        step_s = setup.factor * self.period_s
        before = round(setup.position * (len(rows) - 1)) if setup.trigger else 0
        self.trace = {"names": [item.name for item in setup.channels], "units": [scale.unit for scale in scales], "triggered": setup.trigger is not None,
                      "fault": _fault(setup, rows),
                      "rows": [[(number - before) * step_s] + [float(f"{value * scale.per_count:.6g}") for value, scale in zip(row, scales)]
                               for number, row in enumerate(rows)]}
        self.publish({"trace": self.trace})
        if self.setup is not None and self.setup.mode == "single" and not self.changed.is_set():
            self.setup = None
            self._tell(setup=self.told["setup"] | {"mode": "stop"}, status="stop")


def _fault(setup: Setup, rows: list[tuple[int, ...]]) -> str | None:
    """The fault that the trace ends with, where it is recorded."""
    codes = {row.code: row.name for row in drive_tables.faults() if row.code}
    at = next((number for number, item in enumerate(setup.channels) if item.name == FAULT), None)
    return None if at is None else codes.get(rows[-1][at])


def _number(wish: dict[str, Any], key: str, low: float, high: float) -> float:
    value = wish[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise UserError(f"'{key}' = {value} is impossible", "scope", f"choose {low:g} .. {high:g}")
    return float(value)
