"""Instructions as the simulator's decoder has them: cycles, stalls, and where the program goes on (iss_fact of tools/cpu_33f/iss.h).

The simulator and whoever adds up cycles without running them have one table: the rows of tools/cpu_33f."""

import ctypes
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from tools.common import paths
from tools.common.errors import UserError

LIBRARY = paths.ROOT / "build" / "iss" / "libmachine.so"
ERASED, TEXT_BYTES, RETFIE = 0xFFFFFF, 80, 0x064000


class Flow(IntEnum):
    """iss_flow_t: where the program goes on."""
    NEXT = 0
    BRANCH = 1
    JUMP = 2
    COMPUTED = 3
    CALL = 4
    RETURN = 5
    SKIP = 6
    REPEAT = 7
    DO = 8
    STOP = 9


@dataclass(frozen=True)
class Op:
    """An instruction. What is not said here stands at iss_fact_t."""
    address: int
    text: str = ""
    flow: Flow = Flow.NEXT
    words: int = 1
    cycles: int = 1
    taken: int = 0
    target: int = -1
    count: int = -1
    stall: int = 0
    writes: int = 0
    window: int = 0
    data: int = -1      # data address that it names, -1: none

    @property
    def following(self) -> int:
        return self.address + 2 * self.words


class _Fact(ctypes.Structure):
    _fields_ = [*((name, ctypes.c_int32) for name in ("flow", "words", "cycles", "taken", "target", "count")),
                ("stall", ctypes.c_uint32), ("writes", ctypes.c_uint32), ("window", ctypes.c_int32), ("address", ctypes.c_int32)]


class _Assumption(ctypes.Structure):
    _fields_ = [("id", ctypes.c_char_p), ("value", ctypes.c_int), ("meaning", ctypes.c_char_p), ("used_in", ctypes.c_char_p)]


class Decoder:
    """The simulator's decoder."""

    def __init__(self, library: Path = LIBRARY) -> None:
        try:
            self._c = ctypes.CDLL(str(library))
        except OSError:
            raise UserError("the simulator is not built", str(paths.shown(library)), "make build/iss/libmachine.so") from None
        self._c.iss_assumption.restype = self._c.iss_fact.restype = ctypes.c_bool
        #: what the simulator assumes, by name
        self.assumed: dict[str, int] = {}
        row = _Assumption()
        while self._c.iss_assumption(ctypes.c_size_t(len(self.assumed)), ctypes.byref(row)):
            self.assumed[row.id.decode()] = row.value

    def op(self, words: dict[int, int], address: int) -> Op | None:
        """The instruction at an address; None: there is none."""
        fact, text = _Fact(), ctypes.create_string_buffer(TEXT_BYTES)
        word, following = words.get(address, ERASED), words.get(address + 2, ERASED)
        if word == ERASED or not self._c.iss_fact(word, following, address, ctypes.byref(fact)):
            return None
        self._c.iss_disassemble(word, following, address, text, ctypes.c_size_t(TEXT_BYTES))
        return Op(address, text.value.decode(), Flow(fact.flow), fact.words, fact.cycles, fact.taken, fact.target, fact.count, fact.stall,
                  fact.writes, fact.window, fact.address)
