"""A real board whose firmware has no scope, as the page hears it: the status line twice a second, and the fault recorder's rows after a fault."""

import re
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from tools.bench.board import Library
from tools.common import drive_tables
from tools.common.errors import UserError

from . import lnet, view
from .at_port import AtPort
from .record import Records
from .symbols import Symbols

STATUS = re.compile(r"state (\d+) fault (\w+) speed (-?\d+) rpm(.*)")
LIMITS = re.compile(r" limit((?: [A-Z0-9_]+)+)")
OF_RECORD = re.compile(r"(record|row) ")
WHOLE = re.compile(r"(foc33|state|step|record|row) ")
LONGEST = 400
"""Characters without a line's end: this is no text."""
AGAIN_S = 0.5
"""After the port has gone."""
SCOPE = "scope_command.mode"
"""A variable of a firmware with the scope."""
DAMAGED = "a fault's record did not come whole: after a reset by its pin the board sends it again"
TELLS = "this board's firmware only tells: build it with SCOPE 1 for start, target, scope and loops"


def has_scope(symbols: Symbols) -> bool:
    """Else its serial line has the status line for everybody."""
    return SCOPE in symbols.variables


class ListenedBoard(AtPort):
    """As RealBoard for the server."""

    SILENT_S = 2.0
    """The status line comes twice a second; after a fault the rows come first."""
    kept = tuning = loops = scope = None

    def __init__(self, port: Any, title: str, symbols: Symbols, library: Library) -> None:
        super().__init__(port, title)
        self.symbols, self.params, self.states = symbols, library.params, library.states
        self.records = Records(library.params, library.states)
        self.publish: Callable[[dict[str, Any]], None] = lambda message: None
        self.heard: deque[str] = deque(maxlen=4096)
        """lines that no frame has taken"""
        self.text = ""
        self.begins = True
        """the first line may be the end of one"""
        self.said: Mapping[str, Any] | None = None
        """by the last status line"""
        self.over = threading.Event()
        self.stream: lnet.Stream | None = lnet.open_port(port) if isinstance(port, str) else port
        self.thread = threading.Thread(target=self._listen, name="listen", daemon=True)

    def start(self, publish: Callable[[dict[str, Any]], None]) -> None:
        """The thread that listens."""
        self.publish = publish
        self.thread.start()

    def end(self) -> None:
        """Nobody listens any more."""
        self.over.set()
        if self.thread.is_alive():
            self.thread.join()

    # ---- the listening thread ----------------------------------------------------------------------------------------------
    def _listen(self) -> None:
        while not self.over.is_set():
            try:
                self.stream = self.stream or lnet.open_port(self.port)
                text = self.stream.read(4096).decode("latin-1")
            except (*lnet.PORT_ERRORS, UserError): # the cable is out: no answer
                self.stream, self.text, self.begins = None, "", True
                self.records.forget()
                self.over.wait(AGAIN_S)
                continue
            self.take(text)

    def take(self, text: str) -> None:
        """More of what the board says."""
        if not text:
            return
        self.heard_s = time.monotonic()
        *lines, self.text = (self.text + text).split("\n")
        if lines and self.begins:
            self.begins = False
            if not WHOLE.match(lines[0]):
                del lines[0]
        self.text = self.text[-LONGEST:]
        self.heard.extend(line.rstrip("\r") for line in lines)
        if trace := self.records.feed(text):
            self.publish({"trace": trace})
        if self.records.damaged:
            self.records.damaged = False
            self.heard.append(DAMAGED)

    # ---- the page ----------------------------------------------------------------------------------------------------------
    def act(self, command: Any, who: Any = None) -> None:
        """Nothing can be asked of it."""
        raise UserError("no such command", "page", TELLS)

    def left(self, who: Any) -> None:
        """A tab has gone, and nothing changes."""

    def hello(self) -> dict[str, Any]:
        """All that a new tab must know."""
        return self.about(self.params) | {"remote": None, "panels": view.told_panels(), "kept": False, "loops": None, "tuning": {"fixed": TELLS}, "scope": None,
                                          "recorder": self.records.hello(self.symbols)}

    def frame(self) -> dict[str, Any]:
        """What the board has said since the last frame."""
        new = []
        while self.heard:
            if row := self._line(self.heard.popleft()):
                new.append(row)
        silent = self.silent()
        self.strip.extend(new)
        reasons = [] if silent or self.said is None else self.said["limits"]
        return {"t": round(self.time_s, 3), "run": 1, "state": "" if silent else self.state, "fault": self.fault or "NONE", "limits": reasons,
                "now": None, "outputs": 63 if self.state in view.ON and not silent else 0, "strip": new, "orbit": {"v": [], "i": []}, "log": self.news(),
                "kept": None, "measurable": None, "remote": None, "silent": silent}

    def _line(self, line: str) -> list[Any] | None:
        """A status line is a row of the curves; another one is told as it is, but for the recorder's."""
        found = STATUS.fullmatch(line)
        if found is None:
            if line.strip() and line.isprintable() and not OF_RECORD.match(line):
                self.note(line, "")
            return None
        rpm, rest = int(found[3]), found[4]
        reasons = LIMITS.search(rest)
        names = {row.name for row in drive_tables.limits()}
        self.said = {"limits": [name for name in reasons[1].split() if name in names] if reasons else []}
        self.note_changes(self.states.get(int(found[1]), "?"), found[2])
        self.rows.append({"time_s": round(self.time_s, 3), "state": self.state, "fault": self.fault, "speed_rpm": rpm, "said": rest.strip()})
        return [round(self.time_s, 3), rpm if self.state in view.ESTIMATES else None]

    def header(self) -> bytes:
        """It has no parameters to change."""
        raise UserError("no parameter can change", "page", TELLS)

    def motor(self) -> tuple[str, str]:
        """Nor a motor file with them."""
        raise UserError("no parameter can change", "page", TELLS)

    def loop(self) -> str:
        """It measures none."""
        raise UserError("no loop was measured", "page", TELLS)

    def step(self) -> str:
        """Nor a step."""
        raise UserError("no step was measured", "page", TELLS)
