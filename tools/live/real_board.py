"""A real board at a serial port, as the page sees it: what its firmware says over LNet, its scope, and its remote control."""

import math
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from tools.common import drive_tables, motor_file
from tools.common.errors import UserError

from . import lnet, view
from .at_port import AtPort
from .kept import Kept
from .loop_response import LoopResponse, measured_loop
from .pace import FRAME_S
from .response import TARGET_MODE
from .scope import Scope
from .symbols import Symbols
from .tuning import FIXED, Tuning, tuned
from .watch import Watch

LEASE_MS, RENEW_S = 2000, 0.5
"""How long the firmware obeys without hearing from the page; and how often it hears."""
PANEL_MODE = 0
"""Of scope_command."""


@dataclass
class Remote:
    """What the page has asked for."""

    run: bool
    target_rpm: float
    sent_run: bool = False
    taken: bool = False
    """the firmware has obeyed before"""
    renew_at_s: float = 0.0


class RealBoard(AtPort):
    """As VirtualBoard for the server; time passes by itself."""

    def __init__(self, port: Any, title: str, symbols: Symbols, params: Mapping[str, float], tuning: Tuning | None = None,
                 motor: motor_file.Motor | None = None, modes: Collection[str] = ()) -> None:
        super().__init__(port, title)
        self.symbols, self.params = symbols, params
        self.watch = Watch(symbols, params)
        self.kept, self.tuning = Kept.of(symbols), tuning
        self.loops = LoopResponse.of(symbols, params, motor, modes, time.monotonic)
        self.aimed_erpm: int | None = None
        """the target that a step of the speed means instead of the slider's"""
        if self.loops is not None:
            self.loops.override = self._override
            if tuning is not None:
                self.loops.changed = tuning.on_board
        self.values: dict[str, float] | None = None
        self.scope: Scope | None = None
        self.remote: Remote | None = None
        self.driver: Any = None
        """the tab that has started the motor"""
        self.clears = False
        self.first_link: lnet.Lnet | None = self._connect()

    def _connect(self) -> lnet.Lnet:
        try:
            return lnet.connect(self.port)
        except lnet.LnetError as error:
            raise UserError(str(error), str(self.port), "is it this port, is the board on, is its firmware built with SCOPE 1?") from None

    def _link(self) -> lnet.Lnet:
        """That of the start, later a new one."""
        link, self.first_link = self.first_link, None
        return link or self._connect()

    def start(self, publish: Callable[[dict[str, Any]], None]) -> None:
        """The thread that talks to the board."""
        self.scope = Scope(self._link, self.symbols, self.params, publish, self._beat)
        if self.tuning is not None:
            self.tuning.publish = publish
        if self.loops is not None:
            self.loops.attach(self.scope)
        self.scope.start()

    def end(self) -> None:
        """A motor that the page has started stops in order, as the lease runs out."""
        for part in (self.scope, self.tuning):
            if part is not None:
                part.end()

    # ---- the link's thread -------------------------------------------------------------------------------------------------
    def _beat(self, link: lnet.Lnet) -> None:
        now_s = time.monotonic()
        if now_s >= self.heard_s + FRAME_S:
            self.values = self.watch.read(link)
            self.heard_s = now_s
        if self.clears:
            self.clears = False
            self._write(link, "clear_fault", 1)
        if self.remote is not None:
            self._command(link, self.remote, now_s)
        for part in (self.kept, self.tuning):
            if part is not None:
                part.beat(link)

    def _command(self, link: lnet.Lnet, remote: Remote, now_s: float) -> None:
        """Renews the lease; where S2 has taken the command, it is S2's."""
        if remote.taken and self.values is not None and self.values["mode"] == PANEL_MODE:
            self.remote = None
            self.note("the buttons have taken the command")
            return
        if now_s < remote.renew_at_s and remote.run == remote.sent_run:
            return
        remote.renew_at_s = now_s + RENEW_S
        if not remote.taken:
            self._write(link, "run", 0) # a start is a change, and an older 1 may still stand there
        self._write(link, "target_erpm", round(remote.target_rpm / self.params["COUNT_SPEED_RPM"]) if self.aimed_erpm is None else self.aimed_erpm)
        self._write(link, "lease_ms", LEASE_MS)
        if not remote.taken: # once: after S2 it must stay the panel's
            self._write(link, "mode", TARGET_MODE)
        if remote.run != remote.sent_run:
            self._write(link, "run", int(remote.run))
            remote.sent_run = remote.run
        self.values, remote.taken = self.watch.read(link), True

    def _override(self, erpm: int | None) -> None:
        self.aimed_erpm = erpm

    def _write(self, link: lnet.Lnet, member: str, value: int) -> None:
        variable = self.symbols.find(f"scope_command.{member}")
        link.write(variable.address, variable.data(value))

    # ---- the page ----------------------------------------------------------------------------------------------------------
    def act(self, command: Any, who: Any = None) -> None:
        """One of {"start": rpm}, {"target": rpm}, {"stop": true}, {"clear": true}, {"keep": true}, {"forget": true}, {"measure": "speed"}."""
        name, value = next(iter(command.items())) if isinstance(command, dict) and len(command) == 1 else (None, None)
        if name in ("start", "target"):
            low, high = self._range()
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
                raise UserError(f"{value} rpm is impossible", "page", f"choose {low:g} .. {high:g}")
            self._wish(name == "start", float(value), who)
        elif name == "stop":
            self._wish_stop()
        elif name == "clear":
            self.clears = True
            self.note("clear the fault")
        elif name in ("keep", "forget") and self.kept is not None:
            self.kept.ask(name.upper())
        elif name == "measure" and self.loops is not None:
            self.loops.ask(value, "" if self.was_silent else self.state)
        else:
            raise UserError("no such command", "page", "a real board takes start, target, stop, clear and scope")

    def _wish(self, starts: bool, target_rpm: float, who: Any) -> None:
        remote = self.remote
        if self.loops is not None and self.loops.borrows:
            raise UserError("a step of the speed is being measured", "page", "wait, or cancel it")
        if starts:
            self.remote, self.driver = Remote(True, target_rpm), who
            self.note(f"start, {target_rpm:.0f} rpm")
        elif remote is not None:
            remote.target_rpm, remote.renew_at_s = target_rpm, 0.0

    def _wish_stop(self) -> None:
        if self.remote is not None:
            self.remote.run = False
            self.note("stop")

    def left(self, who: Any) -> None:
        """A tab has gone: a motor that it has started must not turn on with nobody there."""
        if who is self.driver and self.remote is not None and self.remote.run:
            self._wish_stop()

    def _range(self) -> tuple[float, float]:
        return self.params["MINIMUM_SPEED_RPM"], self.params["MAXIMUM_SPEED_RPM"]

    def hello(self) -> dict[str, Any]:
        """All that a new tab must know."""
        low, high = self._range()
        return self.about(self.params) | {
            "remote": {"low": low, "high": high}, "panels": view.panels(False), "kept": self.kept is not None, "loops": self.loops and self.loops.hello(),
            "tuning": self.tuning.hello() if self.tuning else {"fixed": FIXED}, "scope": self.scope.hello() if self.scope else None}

    def frame(self) -> dict[str, Any]:
        """How things stand, as far as the board has told."""
        new = []
        silent = self.silent()
        values = None if silent else self.values
        if values is not None:
            self._note_changes(values)
            new = [self._strip_row(values)]
            self.strip.extend(new)
            self.rows.append({"time_s": round(self.time_s, 3)} | values)
        for part in (self.kept, self.tuning, self.loops):
            while part is not None and part.news:
                self.note(part.news.popleft())
        return {"t": round(self.time_s, 3), "run": 1, "state": "" if silent else self.state, "fault": self.fault or "NONE",
                "limits": self.limits(int(values["limits"]) if values else 0),
                "now": {name: round(value, 4) for name, value in values.items()} if values else None, "outputs": 63 if self.state in view.ON and not silent else 0,
                "strip": new, "orbit": self._vectors(values), "log": self.news(),
                "kept": self.kept.told() if self.kept else None, "measurable": self.loops and self.loops.frame("" if silent else self.state),
                "remote": None if self.remote is None else {"run": self.remote.run, "target_rpm": self.remote.target_rpm},
                "silent": silent}

    def _note_changes(self, values: dict[str, float]) -> None:
        state = dict(enumerate(view.states())).get(int(values["state"]), "?")
        fault = {row.code: row.name for row in drive_tables.faults()}.get(int(values["fault"]), "?")
        self.note_changes(state, fault)

    def _strip_row(self, values: dict[str, float]) -> list[float | None]:
        """As VirtualBoard's rows, of the curves that a real board has."""
        means = {view.ALWAYS: True, view.SWITCHING: self.state in view.ON, view.ESTIMATING: self.state in view.ESTIMATES,
                 view.CONTROLLED: self.state in view.CLOSED}
        return [round(self.time_s, 3), *(round(values[line.watched], 4) if means[line.when] else None for line in view.lines(False))]

    @staticmethod
    def _vectors(values: dict[str, float] | None) -> dict[str, list[list[float]]]:
        """Voltage and current in the stator's frame, of this moment."""
        if not values:
            return {"v": [], "i": []}
        angle = math.radians(values["angle_deg"])
        return {name: [[round(d * math.cos(angle) - q * math.sin(angle), 3), round(d * math.sin(angle) + q * math.cos(angle), 3)]]
                for name, d, q in (("v", values["v_d_v"], values["v_q_v"]), ("i", values["i_d_a"], values["i_q_a"]))}

    def header(self) -> bytes:
        """userparams.h with what has been changed."""
        return tuned(self.tuning).saved()

    def motor(self) -> tuple[str, str]:
        """Name and text of the motor file with it."""
        return tuned(self.tuning).motor()

    def loop(self) -> str:
        """The loop that was measured last."""
        return measured_loop(self.loops).csv()

    def step(self) -> str:
        """The step that was measured last."""
        return measured_loop(self.loops).steps.csv()
