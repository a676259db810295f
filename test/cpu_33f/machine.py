"""The simulator as the tests see it: a state goes in, some cycles run, the state comes out. The library is the core alone."""

import ctypes
import os
import struct
from dataclasses import dataclass
from pathlib import Path

from alu import FLAG_NAMES, State, signed
from vectors import REGISTERS

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = Path(os.environ.get("ISS_LIBRARY", ROOT / "build" / "iss" / "libmachine.so"))
PROGRAM = 0x200
RAM = 0x800
SR = 0x42
RAM_NAMES = [f"[{address:x}]" for address in range(RAM, RAM + 0x800, 2)]


_P, _U, _U16, _U32, _TEXT = ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint16, ctypes.c_uint32, ctypes.c_char_p
SIGNATURES = { # of iss.h: the result, the arguments
    "iss_create": (_P,), "iss_reset": (None, _P, ctypes.c_int), "iss_restart": (None, _P, _U32), "iss_error": (_TEXT, _P),
    "iss_run": (ctypes.c_int, _P, ctypes.c_uint64), "iss_write_program": (ctypes.c_bool, _P, _U32, _U32), "iss_data": (_P, _P),
    "iss_peek": (_U16, _P, _U16), "iss_poke": (None, _P, _U16, _U16), "iss_set_w_known": (None, _P, _U16),
    "iss_ram_known": (None, _P, _U16, _U, ctypes.c_bool),
    "iss_pc": (_U32, _P), "iss_cycles": (ctypes.c_uint64, _P), "iss_acc": (ctypes.c_int64, _P, _U),
    "iss_set_acc": (None, _P, _U, ctypes.c_int64), "iss_sync": (None, _P), "iss_irq_changed": (None, _P),
    "iss_disassemble": (_U, _U32, _U32, _U32, _TEXT, ctypes.c_size_t),
}
ERASED, ACC_MASK = 0xFFFFFF, 0xFFFFFFFFFF


class _Assumption(ctypes.Structure):
    _fields_ = [("id", ctypes.c_char_p), ("value", ctypes.c_int), ("meaning", ctypes.c_char_p), ("used_in", ctypes.c_char_p)]


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
        self.core = ctypes.c_void_p(library.iss_create())
        self.library = library
        self._data = library.iss_data(self.core)
        self._loaded: list[int] = []

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
        for address, word in [*((address, ERASED) for address in self._loaded), *words.items()]:
            self.library.iss_write_program(self.core, address, word)
        self._loaded = list(words)

    def set_state(self, w: list[int], sr: int, acc: list[int], registers: dict[int, int], ram: bytes, pc: int) -> None:
        """Resets the core, then sets registers, core registers by address, and RAM, all of which counts as written."""
        library, core = self.library, self.core
        library.iss_reset(core, 0)
        library.iss_restart(core, pc)
        for address, value in [*((2 * index, value) for index, value in enumerate(w)), *registers.items(), (SR, sr)]:
            library.iss_poke(core, address, value)
        library.iss_set_w_known(core, 0xFFFF)
        ctypes.memmove(self._data + RAM, ram, 0x800)
        library.iss_ram_known(core, RAM, 0x800, True)
        for which, value in enumerate(acc):
            library.iss_set_acc(core, which, signed(value, 40))
        library.iss_irq_changed(core)

    def run(self, until: int) -> str:
        """Runs to at least this cycle after set_state(); the text of what stopped it before, or ""."""
        stopped = self.library.iss_run(self.core, until)
        assert stopped in (0, 2), "a stop without an error"
        return self.library.iss_error(self.core).decode() if stopped else ""

    def start(self, words: list[int], state: State) -> None:
        """Puts the machine before a program, in a reference's state."""
        self.load({PROGRAM + 2 * index: word for index, word in enumerate(words)})
        self.set_state(state.w, state.sr, state.acc, {0x20: 0x0FD0, 0x44: state.corcon}, bytes(state.memory[RAM:]), PROGRAM)

    def differences(self, state: State, stopped: str, sr_mask: int = 0xFFFF, w_from: int = 0) -> list[str]:
        """What it has otherwise than the reference, in the bits of SR and from the W register that count, and what stopped it."""
        after, memory, wanted = self.registers(), self.memory(), state.memory[RAM:]
        found = [f"w{index} is {after.w[index]:04x}, not {value:04x}" for index, value in enumerate(state.w)
                 if after.w[index] != value and index >= w_from]
        found += [f"{name} is {is_:010x}, not {value & ACC_MASK:010x}" for name, is_, value in zip("AB", after.acc, state.acc)
                  if is_ != value & ACC_MASK]
        if (after.sr ^ state.sr) & sr_mask:
            found.append(f"SR is {after.sr:04x}, not {state.sr:04x}")
        if memory != wanted:
            at = next(index for index in range(0x800) if memory[index] != wanted[index])
            found.append(f"[{RAM + at:04x}] is {memory[at]:02x}, not {wanted[at]:02x}")
        return found + ([f"stopped: {stopped}"] if stopped else [])

    def registers(self) -> Snapshot:
        """Registers, program counter and cycles since set_state()."""
        library, core = self.library, self.core
        words = struct.unpack("<34H", ctypes.string_at(self._data, SR + 2))
        return Snapshot(list(words[:16]), words[-1], [library.iss_acc(core, which) & ACC_MASK for which in (0, 1)], library.iss_pc(core),
                        library.iss_cycles(core))

    def memory(self) -> bytes:
        """All of RAM."""
        return ctypes.string_at(self._data + RAM, 0x800)

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
        self.library.iss_sync(self.core)
        return self.library.iss_peek(self.core, address)

    def poke(self, address: int, value: int) -> None:
        """Writes a word of data memory as a peripheral does."""
        self.library.iss_poke(self.core, address, value)

    def forget(self, address: int) -> None:
        """Lets a word of RAM count as never written."""
        self.library.iss_ram_known(self.core, address, 2, False)

    def forget_w(self, register: int) -> None:
        """Lets a W register count as never written."""
        self.library.iss_set_w_known(self.core, 0xFFFF & ~(1 << register))

    def disassemble(self, word: int, following: int, address: int) -> str:
        """An instruction as text, "" if it is none."""
        text = ctypes.create_string_buffer(400)
        return text.value.decode() if self.library.iss_disassemble(word, following, address, text, len(text)) else ""

    def irq_changed(self) -> None:
        """Tells the core that interrupt flags were set from outside."""
        self.library.iss_irq_changed(self.core)
