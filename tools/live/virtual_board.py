"""The virtual board at which somebody works: buttons, sliders, faults; what it records, and what a page is told of it."""

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tools.bench import pil, simulate
from tools.bench.board import Board, Library
from tools.bench.panel import HOLD_S
from tools.bench.scenario import BRAKE, Scenario
from tools.bench.trial import rating_of
from tools.common import drive_tables, motor_file, pins
from tools.common.errors import UserError, suggestion
from tools.common.trace import Trace

from . import view
from .board import SCOPE
from .faults import FAULTS, keys_of
from .kept import Kept
from .line import Line
from .lnet import ANSWER_S, Lnet
from .loop_response import LoopResponse, measured_loop
from .record import Records
from .recording import BUTTONS, POT, Origin, Recording
from .scope import Scope
from .symbols import Symbols
from .tuning import FIXED, Tuning, tuned

SIGNALS = [*simulate.SIGNALS, "fw.theta_ctrl_deg", "fw.speed_target_rpm", "fw.profile_a", "plant.torque_mean_nm", "plant.i_d_mean", "plant.i_q_mean"]
FIRST_S = 0.01
"""What passes at power-up before anybody can act."""
RECORDED_ROW_S = 0.001
LOG_LINES = 200
SAME_MOVE_S = 1.0
"""A slider that moves on within this time has one line in the log."""
SUPPLY, TEMPERATURE = "supply.voltage_v", "motor.temp_c"


class VirtualBoard:
    """Between two run() it can be worked at; one thread at a time."""

    def __init__(self, library: Library, origin: Origin, symbols: Symbols | None = None, tuning: Tuning | None = None, image: Path | None = None) -> None:
        self.library, self.origin, self.image = library, origin, image
        self.line = Line()
        self.scope: Scope | None = None
        self.publish: Callable[[dict[str, Any]], None] = lambda message: None
        self.symbols = symbols
        self.records = None if library.params["SCOPE"] else Records(library.params, library.states)
        self.kept = Kept.of(symbols) if self.records is None else None # it needs the scope's link
        self.tuning = tuning if self.records is None else None
        scenario = Scenario("live", "", "", "", "", 0.0, defines=origin.defines)
        self.job = simulate.prepare(scenario, library, origin.motor, origin.board)
        self.rated = motor_file.load(str(origin.motor.path))
        self.period_s = library.params["LOOPTIME_SEC"]
        self.sliders = self._sliders()
        self.settings = {key: row["start"] for key, row in self.sliders.items()}
        self.faults: list[str] = []
        self.held: dict[str, set[Any]] = {button: set() for button in BUTTONS.values()}
        self.braked: deque[float] = deque()
        """loads beside the slider's, of a step that the scope's thread measures"""
        self.loops = LoopResponse.of(symbols, library.params, self.rated, origin.defines, lambda: self.time_s, self.braked.append)
        if self.loops is not None and self.tuning is not None:
            self.loops.changed = self.tuning.on_board
        self.board: Board | None = None
        self.runs = 0
        self.power_up()

    def _sliders(self) -> dict[str, dict[str, Any]]:
        def row(label: str, unit: str, low: float, high: float, start: float, factor: float = 1.0) -> dict[str, Any]:
            return {"label": label, "unit": unit, "low": low, "high": high, "start": start, "step": (high - low) / 200.0, "shown": factor}

        def value(key: str, otherwise: float) -> float:
            return self.job.values.get(key, otherwise)

        torque_nm, supply_v = self.rated.rated_torque_nm, value(SUPPLY, 24.0)
        return {POT: row("Potentiometer", "%", 0.0, 1.0, 0.0, 100.0),
                BRAKE: row("Load torque", "mN·m", 0.0, float(f"{1.5 * torque_nm:.2g}"), value(BRAKE, 0.0), 1000.0),
                SUPPLY: row("Supply", "V", 0.0, float(f"{1.6 * supply_v:.3g}"), supply_v),
                TEMPERATURE: row("Winding", "°C", -20.0, 160.0, value(TEMPERATURE, 25.0))}

    def start(self, publish: Callable[[dict[str, Any]], None]) -> None:
        """The scope's thread, where the firmware has a scope; it talks over the serial line while the board runs."""
        self.publish = publish
        if self.symbols is not None and self.records is None:
            self.scope = Scope(lambda: Lnet(self.line), self.symbols, self.library.params, publish, self._beat)
            if self.loops is not None:
                self.loops.attach(self.scope)
            self.scope.start()
        if self.tuning is not None:
            self.tuning.publish = publish

    def _beat(self, link: Lnet) -> None:
        """What else the scope's thread does."""
        for part in (self.kept, self.tuning):
            if part is not None:
                part.beat(link)

    @property
    def hurries(self) -> bool:
        """Characters of the line must not wait."""
        return self.loops is not None and self.loops.borrows

    def paced(self, pace: float) -> None:
        """So much slower everything is answered, too."""
        if self.scope is not None:
            self.scope.answer_s = ANSWER_S / pace

    def end(self) -> None:
        """The threads end."""
        for part in (self.scope, self.tuning):
            if part is not None:
                part.end()

    # ---- power, time -----------------------------------------------------------------------------------------------------
    def power_up(self) -> None:
        """A new board with the same motor: sliders and faults stay where they are, and a new recording begins."""
        if self.board is not None:
            self.board.close()
        self.board = self._new_board()
        simulate.set_up(self.board, self.job)
        self.rating = rating_of(self.library, self.origin.motor, self.board)
        self.normal = {key: self.board.get(key) for fault in FAULTS.values() for key in fault.keys(self.rating)}
        kept = {key: value for key, value in self.settings.items() if value != self.board.get(key)} | keys_of(self.faults, self.rating)
        for key, value in kept.items():
            self.board.set(key, value)
        self.settings |= {key: self.board.get(key) for key in self.settings}
        self.board.set("bus.voltage_v", self.settings[SUPPLY])
        self.board.trace_start(SIGNALS, 1)
        self.board.power_up()
        self.time_s = 0.0
        self.runs += 1
        self.recording = Recording(self.origin, kept, SIGNALS, RECORDED_ROW_S)
        self.releases: dict[str, float] = {}
        self.held = {button: set() for button in self.held}
        self.log: deque[dict[str, Any]] = deque(maxlen=LOG_LINES)
        self.lines, self.told, self.rows_seen = 0, 0, 0
        self.recent: list[Trace] = []
        self.recent_rows = 0
        """those that no frame has shown"""
        self.undrawn: list[Trace] = []
        """what no row of the curves has"""
        self.line.clear()
        self.strip: deque[list[float]] = deque(maxlen=round(view.STRIP_S / view.STRIP_ROW_S))
        self.state, self.fault = "", "NONE"
        self.note("power-up")
        self.run(FIRST_S)

    def _new_board(self) -> Board:
        """With the PC as the processor, or the simulated chip that runs an image; nobody compares the two here."""
        if self.image is None or not isinstance(self.library, pil.PilLibrary):
            return Board(self.library)
        board = pil.PilBoard(self.library, self.image)
        if not board.has_names:
            raise UserError("the image does not say where its variables are", str(self.image), "leave out IMAGE, or build it with its names")
        board.lock_step(False)
        return board

    def run(self, seconds: float) -> None:
        """Lets this much motor time pass, a period at least."""
        end_s = self.time_s + seconds
        while self.braked:
            self._set({BRAKE: self.settings[BRAKE] + self.braked.popleft()})
        for button, at_s in sorted(self.releases.items(), key=lambda item: item[1]):
            if at_s < end_s:
                self._pass(at_s - self.time_s)
                self._release(button)
        self._pass(end_s - self.time_s)

    def _pass(self, seconds: float) -> None:
        periods = max(1, round(seconds / self.period_s))
        before_s = self.time_s
        self.board.run(periods)
        self.time_s = self.board.get("time_s")
        data = self.board.trace_take()
        self._said(self.board.uart_take())
        if len(data):
            times = before_s + (self.time_s - before_s) / len(data) * np.arange(1, len(data) + 1)
            self._recorded(Trace(SIGNALS, times, np.ascontiguousarray(data.T)))

    def _said(self, text: str) -> None:
        """By the firmware: to the scope's link, or lines among which may be the fault recorder's."""
        if self.records is None:
            self.line.exchange(self._send, text)
        elif trace := self.records.feed(text):
            self.publish({"trace": trace})

    def _send(self, text: str) -> int:
        """Characters for the board, which are part of the recording."""
        count = self.board.uart_send(text)
        if count:
            self.recording.sent.append((self.time_s, text[:count]))
        return count

    def _recorded(self, trace: Trace) -> None:
        self.recent.append(trace)
        self.undrawn.append(trace)
        self._note_changes(trace, "fw.state", self.library.states, self._note_state)
        self._note_changes(trace, "fw.fault", self.library.faults, self._note_fault)
        every = round(RECORDED_ROW_S / self.period_s)
        first = -self.rows_seen % every
        if len(trace) > first:
            self.recording.add_rows(trace.time_s[first::every], trace.data[:, first::every].T)
        self.rows_seen += len(trace)
        self.recent_rows += len(trace)

    def _drawn(self) -> list[list[float | None]]:
        """More rows of the curves, of what is whole."""
        every = round(view.STRIP_ROW_S / self.period_s)
        whole = _joined(self.undrawn)
        found = view.strip(whole, every, self.library.states)
        rest = len(whole) - len(whole) % every
        self.undrawn = [Trace(SIGNALS, whole.time_s[rest:], whole.data[:, rest:])]
        return found

    @staticmethod
    def _note_changes(trace: Trace, signal: str, names: dict[int, str], note: Any) -> None:
        for row, number in trace.changes(signal):
            note(float(trace.time_s[row]), names.get(int(number), "?"))

    def _note_state(self, at_s: float, name: str) -> None:
        if name != self.state:
            self.state = name
            self.recording.states.append((at_s, name))
            self.note(f"state {name}", at_s, "state")

    def _note_fault(self, at_s: float, name: str) -> None:
        if name != self.fault:
            self.fault = name
            if name != "NONE":
                self.recording.faults.append((at_s, name))
            self.note("fault cleared" if name == "NONE" else f"fault {name}", at_s, "fault")

    # ---- what somebody does ----------------------------------------------------------------------------------------------
    def act(self, command: Any, who: Any = None) -> None:
        """One of {"press": "S2"}, {"release": "S2"}, {"set": [key, value]}, {"fault": [name, true]}, {"power": true}, {"keep": true},
        {"forget": true}, {"measure": "speed"}, {"measure": {"step": "load", "size": 40}}."""
        work = {"press": self._press, "release": self._let_go, "set": self._turn, "fault": self._break, "power": lambda value, who: self.power_up()}
        if self.kept is not None:
            work |= {name: lambda value, who, request=name.upper(): self.kept.ask(request) for name in ("keep", "forget")}
        if self.loops is not None:
            work |= {"measure": lambda wish, who: self.loops.ask(wish, self.state)}
        if not isinstance(command, dict) or len(command) != 1 or next(iter(command)) not in work:
            raise UserError("no such command", "page", "send one of " + ", ".join(work))
        name, value = next(iter(command.items()))
        work[name](value, who)

    def _press(self, button: Any, who: Any) -> None:
        self._known(button, self.held, "button")
        self.held[button].add(who)
        if len(self.held[button]) == 1 and not self.board.get(_key(button)):
            self._set({_key(button): 1.0})
            self.note(f"{button} pressed", kind="action")
        self.releases.pop(button, None)

    def _let_go(self, button: Any, who: Any) -> None:
        """The button comes up when nobody holds it, and the firmware had the time to see it."""
        self._known(button, self.held, "button")
        self.held[button].discard(who)
        if self.held[button] or not self.board.get(_key(button)):
            return
        pressed_s = max(at_s for at_s, keys in self.recording.actions if keys.get(_key(button)))
        if pressed_s + HOLD_S > self.time_s:
            self.releases[button] = pressed_s + HOLD_S
        else:
            self._release(button)

    def _release(self, button: str) -> None:
        self.releases.pop(button, None)
        self._set({_key(button): 0.0})

    def left(self, who: Any) -> None:
        """A tab has gone: what it held comes up."""
        for button, holders in self.held.items():
            if who in holders:
                self._let_go(button, who)

    def _turn(self, pair: Any, who: Any) -> None:
        key, value = pair if isinstance(pair, list) and len(pair) == 2 else (None, None)
        self._known(key, self.sliders, "slider")
        slider = self.sliders[key]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not slider["low"] <= value <= slider["high"]:
            raise UserError(f"'{key}' = {value} is impossible", "page", f"choose {slider['low']:g} .. {slider['high']:g}")
        if value == self.settings[key]:
            return
        self.settings[key] = float(value)
        self._set({key: float(value)})
        self.note(f"{slider['label']} {value * slider['shown']:.4g} {slider['unit']}", kind="action", same=key)

    def _break(self, pair: Any, who: Any) -> None:
        name, on = pair if isinstance(pair, list) and len(pair) == 2 else (None, None)
        self._known(name, FAULTS, "fault")
        self.faults = [other for other in self.faults if other != name] + ([name] if on else [])
        wanted = self.normal | keys_of(self.faults, self.rating)
        changed = {key: wanted[key] for key in FAULTS[name].keys(self.rating) if wanted[key] != self.board.get(key)}
        if changed:
            self._set(changed)
        self.note(f"{FAULTS[name].label}{'' if on else ': mended'}", kind="action")

    def _known(self, name: Any, names: Any, what: str) -> None:
        if not isinstance(name, str) or name not in names:
            raise UserError(f"no {what} '{name}'", "page", suggestion(str(name), names))

    def _set(self, keys: dict[str, float]) -> None:
        for key, value in keys.items():
            self.board.set(key, value)
        self.recording.actions.append((self.time_s, keys))

    def note(self, text: str, at_s: float | None = None, kind: str = "", same: str = "") -> None:
        """A line of the log; one about the same slider replaces the last one."""
        at_s = self.time_s if at_s is None else at_s
        last = self.log[-1] if self.log else None
        if last and same and last["same"] == same and at_s - last["t"] < SAME_MOVE_S:
            self.log.pop()
            self.lines -= 1
        self.log.append({"id": self.lines, "t": round(at_s, 4), "text": text, "kind": kind, "same": same})
        self.told = min(self.told, self.lines)
        self.lines += 1

    # ---- what a page is told ---------------------------------------------------------------------------------------------
    def hello(self) -> dict[str, Any]:
        """All that a new tab must know."""
        return {"virtual": True, "chip": self.image is not None, "motor": self.origin.motor.title, "board": self.origin.board.title,
                "defines": [name for name in self.origin.defines if name != SCOPE],
                "sliders": self.sliders, "pole_pairs": self.rated.pole_pairs, "max_current_a": self.library.params["MAXIMUM_CURRENT_A"],
                "nominal_bus_v": self.job.values.get(SUPPLY, 24.0),
                "throws": [{"name": fault.name, "label": fault.label, "group": fault.kind.partition(":")[0]} for fault in FAULTS.values()],
                "states": view.states(), "estimates": view.ESTIMATES, "faults": view.faults(), "limits": view.limits(),
                "panels": view.panels(True), "kept": self.kept is not None, "loops": self.loops and self.loops.hello(),
                "tuning": self.tuning.hello() if self.tuning else {"fixed": FIXED}, "strip": list(self.strip), "log": list(self.log),
                "scope": self.scope.hello() if self.scope else None,
                "recorder": self.records and self.records.hello(self.symbols or Symbols({}))}

    def frame(self) -> dict[str, Any]:
        """What has happened since the last frame, and how things stand."""
        for part in (self.kept, self.tuning, self.loops):
            while part is not None and part.news:
                self.note(part.news.popleft(), kind="action")
        told, self.told = self.told, self.lines
        new = self._drawn()
        self.strip.extend(new)
        trace, rows = _joined(self.recent), self.recent_rows or len(self.recent[-1])
        self.recent, self.recent_rows = self.recent[-1:], 0 # where nothing passes until the next frame, it shows the last moment again
        reasons = int(self.board.get("fw.limits"))
        return {"t": round(self.time_s, 4), "state": self.state, "fault": self.fault,
                "limits": [row.name for row in drive_tables.limits() if row.code & reasons],
                "now": view.now(trace, rows) | {"power_w": round(self.board.get("bus.voltage_v") * self.board.get("bus.current_a"), 3)},
                "kept": self.kept.told() if self.kept else None, "measurable": self.loops and self.loops.frame(self.state),
                "outputs": int(self.board.get("pwm.outputs_seen")),
                "leds": {name: int(self.board.get("pin." + pins.firmware()[f"led_{name}"].pin)) for name in ("alive", "run")},
                "settings": self.settings, "run": self.runs,
                "buttons": {button: int(self.board.get(_key(button))) for button in self.held}, "broken": self.faults,
                "strip": new, "orbit": view.orbit(trace), "log": [line for line in self.log if line["id"] >= told]}

    # ---- what is saved ---------------------------------------------------------------------------------------------------
    def scenario(self) -> str:
        """What was done since power-up, as a scenario."""
        return self.recording.toml(self.time_s)

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

    def csv(self) -> str:
        """The trace since power-up, at most that of the last two minutes."""
        return self.recording.csv()


def _joined(parts: list[Trace]) -> Trace:
    """One trace of several that follow one another."""
    return Trace(SIGNALS, np.concatenate([part.time_s for part in parts]), np.concatenate([part.data for part in parts], axis=1))


def _key(button: str) -> str:
    return next(key for key, name in BUTTONS.items() if name == button)
