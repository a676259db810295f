"""The firmware's memory inside a running virtual board, bit by bit, as a hit by radiation finds it: variables on the PC; flash, RAM and stack of an
image in the simulator."""

import ctypes
import functools
import io
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.common import paths
from tools.common.errors import UserError
from tools.image import program

from .board import Library
from .pil import PilBoard

DRIVE = "board_drive"


@dataclass(frozen=True)
class Variable:
    """A writable object of the firmware; `offset` from DRIVE's address."""

    name: str
    offset: int
    size: int


def variables(library: Library) -> list[Variable]:
    """Every writable variable of the firmware that the library was linked from, DRIVE first."""
    objects = [library.path.parent / name for name in ("unit.o", "app.o")]
    for each in objects:
        if not each.exists():
            raise UserError("cannot read what the library was linked from", str(paths.shown(each)), "make vboard")
    written = {(name, size) for each in objects for name, size, _ in _symbols(str(each))}
    found = {name: Variable(name, at, size) for name, size, at in _symbols(str(library.path)) if (name, size) in written}
    if DRIVE not in found:
        raise UserError(f"the firmware has no variable '{DRIVE}'", str(paths.shown(library.path)), "rebuild with make vboard")
    base = found[DRIVE].offset
    return sorted((Variable(item.name, item.offset - base, item.size) for item in found.values()), key=lambda item: (item.name != DRIVE, item.name))


def _symbols(*files: str) -> list[tuple[str, int, int]]:
    """Name, size and address of what can be written; .data.rel.ro are constants with addresses in them, flash on the chip."""
    done = subprocess.run(["nm", "-S", "-f", "sysv", "--defined-only", *files], cwd=paths.ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UserError("nm cannot list the firmware's variables", files[0], (done.stderr.splitlines() or ["install binutils"])[0])
    rows = re.findall(r"^(\S+) *\|([0-9a-f]+)\| *[bBdD] *\|[^|]*\|([0-9a-f]+)\|[^|]*\|(?!\.data\.rel\.ro)", done.stdout, re.MULTILINE)
    return [(name, int(size, 16), int(at, 16)) for name, at, size in rows]


@functools.cache
def _types(path: Path) -> dict[str, Any]:
    """The types of a library's variables by name, as the compiler noted them; none where nothing here reads that."""
    try:
        from elftools.elf.elffile import ELFFile
    except ImportError:
        return {}
    found = {}
    for unit in ELFFile(io.BytesIO(path.read_bytes())).get_dwarf_info().iter_CUs():
        for entry in unit.get_top_DIE().iter_children():
            if entry.tag == "DW_TAG_variable" and {"DW_AT_type", "DW_AT_name"} <= entry.attributes.keys():
                found[entry.attributes["DW_AT_name"].value.decode()] = entry.get_DIE_from_attribute("DW_AT_type")
    return found


def _field(library: Library, name: str, byte: int) -> str:
    """The part of a variable that has this byte: ".run.control.ref_q13.d"."""
    kind = _types(library.path).get(name)
    return (_member(kind, byte) if kind is not None else "") or f"+{byte}"


def _member(kind: Any, byte: int) -> str:
    while kind.tag in ("DW_TAG_typedef", "DW_TAG_volatile_type", "DW_TAG_const_type"):
        kind = kind.get_DIE_from_attribute("DW_AT_type")
    members = [entry for entry in kind.iter_children() if entry.tag == "DW_TAG_member"] if kind.tag == "DW_TAG_structure_type" else []
    inside = [entry for entry in members if entry.attributes["DW_AT_data_member_location"].value <= byte]
    if not inside:
        return f"+{byte}" if byte else ""
    last = inside[-1]
    at = last.attributes["DW_AT_data_member_location"].value
    return f".{last.attributes['DW_AT_name'].value.decode()}" + _member(last.get_DIE_from_attribute("DW_AT_type"), byte - at)


def flip(library: Library, area: list[Variable], share: float) -> str:
    """Turns the bit at this share, 0..1, of all bits of the area; returns its name."""
    total = sum(item.size for item in area)
    bit = min(int(share * 8 * total), 8 * total - 1)
    at, number = divmod(bit, 8)
    for item in area:
        if at < item.size:
            break
        at -= item.size
    base = ctypes.addressof(ctypes.c_uint8.in_dll(library.c, DRIVE))
    place = ctypes.c_uint8.from_address(base + item.offset + at)
    place.value ^= 1 << number
    return f"{item.name}{_field(library, item.name, at)} bit {number}"


RAM_START, RAM_BYTES, STACK_POINTER, ERASED, FLASH_WORDS = 0x0800, 0x0800, 0x001E, 0xFFFFFF, 0x2C00
"""Of the dsPIC33FJ32MC204: addresses of data memory, and 24-bit words."""


class Core:
    """Flash and RAM of the simulator under a board. `stack_start`: the first address behind the variables."""

    def __init__(self, board: PilBoard, stack_start: int) -> None:
        c, core = board.library.c, ctypes.c_void_p
        board.library.declare(("vb_iss_core", core, [core]), ("iss_peek", ctypes.c_uint16, [core, ctypes.c_uint16]),
                              ("iss_poke", None, [core, ctypes.c_uint16, ctypes.c_uint16]), ("iss_program", ctypes.POINTER(ctypes.c_uint32), [core]),
                              ("iss_write_program", ctypes.c_bool, [core, ctypes.c_uint32, ctypes.c_uint32]))
        self._c, self._core, self._stack_start = c, c.vb_iss_core(board._vb), stack_start # pylint: disable=protected-access

    def flip_flash(self, share: float) -> str:
        """Turns the bit at this share of all bits of programmed flash; returns its name."""
        words = self._c.iss_program(self._core)
        used = [word for word in range(FLASH_WORDS) if words[word] != ERASED]
        bit = min(int(share * 24 * len(used)), 24 * len(used) - 1)
        word, number = used[bit // 24], bit % 24
        self._c.iss_write_program(self._core, 2 * word, words[word] ^ 1 << number)
        return f"flash 0x{2 * word:04X} bit {number}"

    def flip_ram(self, share: float, stack: bool) -> str:
        """The same of RAM from its start to the end of the stack in use, or of that stack alone."""
        end = max(self._c.iss_peek(self._core, STACK_POINTER), self._stack_start + 2)
        start = self._stack_start if stack else RAM_START
        bit = min(int(share * 8 * (end - start)), 8 * (end - start) - 1)
        address, number = start + bit // 16 * 2, bit % 16
        self._c.iss_poke(self._core, address, self._c.iss_peek(self._core, address) ^ 1 << number)
        return f"RAM 0x{address:04X} bit {number}"


def stack_start(image: program.Elf) -> int:
    """The first even address behind an image's variables."""
    ends = [symbol.address + symbol.size for symbol in image.names if symbol.section is not None and symbol.section.memory == program.DATA
            and RAM_START <= symbol.address < RAM_START + RAM_BYTES]
    return max(ends, default=RAM_START) + 1 & ~1
