"""What the tests of make live share: a board to work at, and a server in a process of its own."""

import contextlib
import functools
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

from live_browser import PATIENCE_S

from tools.common import paths
from tools.live import board, symbols
from tools.live.pace import FRAME_S, Pacemaker
from tools.live.recording import Origin
from tools.live.virtual_board import VirtualBoard

@functools.cache
def parts() -> board.Parts:
    """The firmware with its scope."""
    return board.parts()


KEPT_DEFINES = "-DPARAMS_IN_RAM -DPARAMS_KEPT=1"


@functools.cache
def kept_parts() -> board.Parts:
    """The firmware with its scope and parameters that can be kept."""
    return board.parts(defines=KEPT_DEFINES)


@functools.cache
def recorder_parts() -> board.Parts:
    """The firmware with the fault recorder in the scope's place."""
    return board.parts(defines="-DSCOPE=0")


@functools.cache
def known() -> symbols.Symbols:
    """Its variables."""
    return symbols.Symbols.read(parts().symbols)


def origin() -> Origin:
    return Origin(parts().motor, parts().board, [board.SCOPE], {})


def bench() -> VirtualBoard:
    """A board without the scope's thread."""
    return VirtualBoard(parts().library, origin(), known())


def passes(board: VirtualBoard, seconds: float) -> dict:
    """Lets motor time pass in frames; the last frame, with the log and curves of all."""
    log, strip = [], []
    for _ in range(round(seconds / FRAME_S)):
        board.run(FRAME_S)
        frame = json.loads(json.dumps(board.frame(), allow_nan=False)) # as the page gets it
        log += frame["log"]
        strip += frame["strip"]
    return frame | {"log": log, "strip": strip}


def started(pot: float = 0.5) -> VirtualBoard:
    """A board whose motor turns."""
    board = bench()
    passes(board, 0.2)
    board.act({"set": ["input.pot", pot]})
    board.act({"press": "S2"})
    board.act({"release": "S2"})
    assert passes(board, 3.0)["state"] == "CLOSED"
    return board


class Living:
    """A board that lives in a thread of its own, with the scope's thread if it has `symbols`; `messages` are the scope's."""

    def __init__(self, variables: symbols.Symbols | None = None) -> None:
        self.board = VirtualBoard(parts().library, origin(), variables)
        self.maker = Pacemaker(self.board, lambda frame: None)
        self.messages: list[dict] = []
        self.board.start(self.messages.append)

    def do(self, **command) -> None:
        """Somebody works at it."""
        self.maker.call(lambda: self.board.act(command)).result(5)

    def pace(self, pace: float) -> None:
        """Asked of the board's thread, like the page does."""
        self.maker.call(lambda: self.maker.set_pace(pace)).result(5)

    def click_s2(self) -> None:
        self.do(press="S2")
        self.do(release="S2")

    def traces(self) -> list[dict]:
        """Those that have come."""
        return [message["trace"] for message in list(self.messages) if "trace" in message]

    def trace(self) -> dict:
        """The next one."""
        return until(self.traces, "no trace", 30.0)[0]

    def close(self) -> None:
        self.board.end()
        self.maker.end()
        assert self.maker.error is None, self.maker.error


class Served:
    """A running server. `url` is what it has printed."""

    def __init__(self, *arguments: str, made_of: board.Parts | None = None) -> None:
        command = [sys.executable, "-m", "tools.live", "--library", str((made_of or parts()).library.path), "--listen", "0", *arguments]
        self.process = subprocess.Popen(command, cwd=paths.ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        first = self.process.stdout.readline()
        assert first.startswith("open http://127.0.0.1:"), first + self.process.stderr.read()
        self.url = first.split()[1]
        self.port = urlsplit(self.url).port
        self.token = self.url.partition("token=")[2]

    def end(self) -> tuple[int, str]:
        self.process.terminate()
        _, said = self.process.communicate(timeout=10)
        return self.process.returncode, said


@contextlib.contextmanager
def served(*arguments: str, made_of: board.Parts | None = None) -> Iterator[Served]:
    server = Served(*arguments, made_of=made_of)
    try:
        yield server
    finally:
        server.end()


def until(found, what, seconds: float = PATIENCE_S):
    """Waits for something true; else `what` has not happened, a text or what makes it."""
    end_s = time.monotonic() + seconds
    while not (value := found()):
        assert time.monotonic() < end_s, what() if callable(what) else what
        time.sleep(0.02)
    return value
