"""The self-test REGISTERS: which registers the firmware compares with what, and which of a board's differ."""

import ctypes
from dataclasses import dataclass
from functools import cache
from typing import Any

from tools.common.x_macro import rows
from .board import BoardError, Library

FAULT, VARIABLE, REGISTERS = "SELFTEST", "board_selftest_failed", "REGISTERS"


@dataclass(frozen=True)
class Written:
    """A register as the start has written it; bits outside of `mask` are not looked at."""

    name: str
    mask: int
    value: int

    def differs(self, now: int) -> bool:
        return (now & self.mask) != self.value

    def told(self, now: int) -> str:
        """The difference as a line."""
        bits = (now ^ self.value) & self.mask
        where = ", ".join(str(bit) for bit in range(16) if bits >> bit & 1)
        return f"{self.name} is 0x{now & self.mask:04X}, the start wrote 0x{self.value:04X}: bit{'s' if bits & (bits - 1) else ''} {where}"


@cache
def test_names() -> dict[int, str]:
    """Names of the self-tests by their code."""
    return {int(code): name for code, name, *_ in rows("include", "drive/selftest.h", "SELFTEST_TABLE", "#code #name clause what")}


def written(library: Library) -> list[Written]:
    """What this firmware compares; nothing with SELFTEST_OFF, or of a library without it."""
    call = getattr(library.c, "probe_written", None)
    mask, value, found = ctypes.c_uint16(), ctypes.c_uint16(), list[Written]()
    if call is None:
        return found
    call.restype = ctypes.c_char_p
    while name := call(len(found), ctypes.byref(mask), ctypes.byref(value)):
        found.append(Written(name.decode(), mask.value, value.value))
    return found


def told(board: Any, library: Library) -> list[str]:
    """Lines about the self-test that has failed on a board: its name, and the registers that differ now."""
    try:
        code = board.variable(VARIABLE, 1)[0] & 0xFFFF
    except BoardError: # an image without names, or SELFTEST_OFF
        return []
    if code == 0:
        return []
    name = test_names().get(code, str(code))
    if name != REGISTERS:
        return [f"self-test {name} failed"]
    found = []
    for register in written(library):
        try:
            now = int(board.get(f"reg.{register.name}"))
        except BoardError: # of the core, which the board does not know
            continue
        if register.differs(now):
            found.append(register.told(now))
    return [f"self-test {name} failed: {line}" for line in found or ["the register is as it was written again, or it is P1OVDCON: outputs that the state does not ask for"]]
