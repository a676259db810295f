"""The simulator as the tests see it: a state goes in, some cycles run, the state comes out. The library is machine.c with the core."""

import ctypes
import os
import struct
from dataclasses import dataclass
from pathlib import Path

from alu import FLAG_NAMES
from vectors import REGISTERS

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = Path(os.environ.get("ISS_LIBRARY", ROOT / "build" / "iss" / "libmachine.so"))
PROGRAM = 0x200
RAM = 0x800
RAM_NAMES = [f"[{address:x}]" for address in range(RAM, RAM + 0x800, 2)]


_P, _U, _U32, _TEXT = ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint32, ctypes.c_char_p
SIGNATURES = { # of machine.c: the result, the arguments
    "machine_create": (_P,), "machine_core": (_P, _P), "machine_run": (_TEXT, _P, ctypes.c_uint64), "machine_load": (None, _P, _U, _P),
    "machine_set": (None, _P, _P, _TEXT, _U, _P), "machine_get": (None, _P, _P), "machine_ram": (None, _P, _TEXT),
    "machine_peek": (_U, _P, _U),
    "machine_poke": (None, _P, _U, _U), "machine_forget": (None, _P, _U, _U), "machine_forget_w": (None, _P, _U),
    "machine_disassemble": (_TEXT, _P, _U32, _U32, _U32), "machine_irq_changed": (None, _P),
}


class _Assumption(ctypes.Structure):
    _fields_ = [("id", ctypes.c_char_p), ("value", ctypes.c_int), ("meaning", ctypes.c_char_p), ("used_in", ctypes.c_char_p)]


class Registers(ctypes.Structure):
    """What machine_get() fills in; the order is machine.c's."""

    _fields_ = [("w", ctypes.c_uint16 * 16), ("sr", ctypes.c_uint16), ("corcon", ctypes.c_uint16), ("acc", ctypes.c_uint64 * 2),
                ("pc", ctypes.c_uint32), ("cycles", ctypes.c_uint64)]


@dataclass
class Snapshot:
    """Registers at one moment; the accumulators as their 40 bits."""

    w: list[int]
    sr: int
    acc: list[int]
    pc: int
    cycles: int


class Machine:
    """One simulator, used for many programs."""

    def __init__(self) -> None:
        library = ctypes.CDLL(str(LIBRARY))
        for name, (result, *arguments) in SIGNATURES.items():
            getattr(library, name).restype, getattr(library, name).argtypes = result, arguments
        library.iss_assumption.restype = ctypes.c_bool
        self._core = ctypes.c_void_p(library.machine_create())
        self.core = ctypes.c_void_p(library.machine_core(self._core))
        self.library = library
        self._registers = Registers()
        self._ram = ctypes.create_string_buffer(0x800)

    def assumption(self, name: str) -> int:
        """A value of tools/cpu_33f/iss_assumptions.h."""
        row, line = 0, _Assumption()
        while self.library.iss_assumption(ctypes.c_size_t(row), ctypes.byref(line)):
            if line.id == name.encode():
                return line.value
            row += 1
        raise KeyError(name)

    def load(self, words: dict[int, int]) -> None:
        """Erases the last program and writes this one, by address."""
        flat = [number for pair in words.items() for number in pair]
        self.library.machine_load(self._core, len(words), (ctypes.c_uint32 * len(flat))(*flat))

    def set_state(self, w: list[int], sr: int, acc: list[int], registers: dict[int, int], ram: bytes, pc: int) -> None:
        """Resets the core, then sets registers, core registers by address, and RAM, all of which counts as written."""
        state = self._registers
        state.w[:] = w
        state.sr, state.pc = sr, pc
        state.acc[:] = [value & 0xFFFFFFFFFF for value in acc]
        flat = [number for pair in registers.items() for number in pair]
        self.library.machine_set(self._core, ctypes.byref(state), ram, len(registers), (ctypes.c_uint32 * len(flat))(*flat))

    def run(self, until: int) -> str:
        """Runs to at least this cycle after set_state(); the text of what stopped it before, or ""."""
        return self.library.machine_run(self._core, until).decode()

    def registers(self) -> Snapshot:
        """Registers, program counter and cycles since set_state()."""
        state = self._registers
        self.library.machine_get(self._core, ctypes.byref(state))
        return Snapshot(list(state.w), state.sr, list(state.acc), state.pc, state.cycles)

    def memory(self) -> bytes:
        """All of RAM."""
        self.library.machine_ram(self._core, self._ram)
        return self._ram.raw

    def state(self) -> dict[str, int]:
        """Everything by name, as the vectors call it."""
        now = self.registers()
        state = {f"w{index}": value for index, value in enumerate(now.w)}
        state |= {name: now.sr >> bit & 1 for name, bit in FLAG_NAMES.items()}
        state |= {name: self.peek(address) for name, address in REGISTERS.items()}
        state |= zip(RAM_NAMES, struct.unpack("<1024H", self.memory()))
        return state | {"IPL": now.sr >> 5 & 7, "a": now.acc[0], "b": now.acc[1], "pc": now.pc, "cycles": now.cycles}

    def peek(self, address: int) -> int:
        """A word of data memory or a register."""
        return self.library.machine_peek(self._core, address)

    def poke(self, address: int, value: int) -> None:
        """Writes a word of data memory as a peripheral does."""
        self.library.machine_poke(self._core, address, value)

    def forget(self, address: int) -> None:
        """Lets a word of RAM count as never written."""
        self.library.machine_forget(self._core, address, 2)

    def forget_w(self, register: int) -> None:
        """Lets a W register count as never written."""
        self.library.machine_forget_w(self._core, 0xFFFF & ~(1 << register))

    def disassemble(self, word: int, following: int, address: int) -> str:
        """An instruction as text, "" if it is none."""
        return self.library.machine_disassemble(self._core, word, following, address).decode()

    def irq_changed(self) -> None:
        """Tells the core that interrupt flags were set from outside."""
        self.library.machine_irq_changed(self._core)
