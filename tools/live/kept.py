"""Kept parameters on the page: what the board says of them over LNet, and the two requests; and the virtual board's flash in a file. Only of a firmware
with PARAMS_KEPT."""

import contextlib
import time
from collections import deque
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from tools.bench.board import Library
from tools.common.errors import UserError
from tools.common.x_macro import rows

from .lnet import Lnet
from .symbols import Symbols

COMMAND = "kept_command"
MEMBERS = ("request", "result", "copies", "unsaved")
EVERY_S = 0.25
"""How often the page looks."""


@cache
def table(name: str) -> dict[str, tuple[int, str]]:
    """Number and meaning of each name: REQUEST, RESULT, STATE."""
    return {row[1]: (int(row[0]), row[2]) for row in rows("include", "board/kept.h", f"KEPT_{name}_TABLE", "#number #name meaning")}


def _row(name: str, number: int) -> tuple[str, str]:
    return next(((row, meaning) for row, (code, meaning) in table(name).items() if code == number), ("?", f"number {number}, which this version does not know"))


class Kept:
    """For one board. beat() belongs to the link's thread, the others to the page's."""

    def __init__(self, symbols: Symbols) -> None:
        self.symbols = symbols
        self.values: dict[str, int] | None = None
        self.looked_s = 0.0
        self.asked: deque[str] = deque()
        self.news: deque[str] = deque()
        """lines for the log"""

    @staticmethod
    def of(symbols: Symbols | None) -> "Kept | None":
        """None of a firmware without PARAMS_KEPT."""
        return Kept(symbols) if symbols is not None and f"{COMMAND}.request" in symbols.variables else None

    def ask(self, request: str) -> None:
        """KEEP or FORGET."""
        self.asked.append(request)

    def beat(self, link: Lnet) -> None:
        """Reads how things stand; asks, and tells the answer once the request is taken back."""
        now_s = time.monotonic()
        if self.asked:
            request = self.asked.popleft()
            self._write(link, table("REQUEST")[request][0])
            while (values := self._read(link))["request"] != 0:
                pass # the next millisecond takes it; a board that does not answer ends the link
            self.news.append(f"{request.lower()}: {_row('RESULT', values['result'])[1]}")
        elif now_s < self.looked_s + EVERY_S:
            return
        self.values, self.looked_s = self._read(link), now_s

    def _write(self, link: Lnet, request: int) -> None:
        variable = self.symbols.find(f"{COMMAND}.request")
        link.write(variable.address, variable.data(request))

    def _read(self, link: Lnet) -> dict[str, int]:
        members = {name: self.symbols.find(f"{COMMAND}.{name}") for name in MEMBERS}
        first = min(item.address for item in members.values())
        memory = link.read(first, max(item.address + item.bytes for item in members.values()) - first)
        return {name: item.value(memory[item.address - first:]) for name, item in members.items()}

    def told(self) -> dict[str, Any] | None:
        """For a frame; None as long as the board has not answered."""
        if self.values is None:
            return None
        state, meaning = _row("STATE", self.values["copies"])
        return {"state": state, "meaning": meaning, "unsaved": self.values["unsaved"]}


@contextlib.contextmanager
def flash_in(path: Path | None, library: Library, on_chip: bool = False) -> Iterator[None]:
    """The two pages of the PC's firmware come from a file, which need not exist, and go there in the end."""
    if path is not None:
        if on_chip:
            raise UserError("the simulated chip's flash has no file", "KEPT", "leave KEPT or CPU=33f out")
        if not library.params.get("PARAMS_KEPT"):
            raise UserError("this firmware keeps no parameters", "KEPT", 'build it with DEFINES="-DPARAMS_IN_RAM -DPARAMS_KEPT=1"')
        if library.c.host_kept_load(str(path).encode()) != 0:
            raise UserError("is no file of kept parameters", str(path), "name another one, or remove it")
    yield
    if path is not None and library.c.host_kept_save(str(path).encode()) != 0:
        raise UserError("cannot be written", str(path), "name another file for KEPT")
