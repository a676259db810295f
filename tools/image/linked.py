"""What the linker's map says of the origin of every piece of the image: our objects, the compiler's start-up code, or its library."""

import re
from dataclasses import dataclass
from pathlib import Path

from tools.common.errors import UserError

from . import attribution, device
from .program import Elf, Words

#: What may be in the image besides our own objects, by the file that the map names: the compiler's start-up code (crt1: without start
#: values), the linker's list of start values and its own _DefaultInterrupt, which image.py refuses with reasons of its own. Names of the
#: product seen in published maps of versions 1.35 and 1.50; those of 2.10 are taken to be the same [?].
ALLOWED = re.compile(r"\((crt[01]|data_init|crt_start_mode)[_a-z0-9]*\.\w+\)$|^data_init$|^default_isr$")

#: what to write instead of a helper, by a part of its C name or of its archive member's
ADVICE = (
    (re.compile(r"_*u?(div|mod|divmod)(si|hi|di)3?|^l?l?div$"),
     "a division: use qm_divud() or __builtin_divsd() with a proven range, or multiply by a constant"),
    (re.compile(r"_*(mul|lshr|ashr|ashl|neg|cmp|ucmp)di\d?|_*(mul|lshr|ashr|ashl)si3"),
     "a 64-bit number or a long product: use 16-bit factors, qm_mulss() and qm_mulhi()"),
    (re.compile(r"[sd]f\d?$|[sd]f[sd]i$|_*f(un)?pack|_*f(add|sub|mul|div|cmp|util|ix|loat)|^fp?_|float|fix(uns)?[sd]f|unord"),
     "a float: use a Q format, PARAM_F() constants are folded by the compiler"),
    (re.compile(r"mem(cpy|set|move|cmp)|str(len|cpy|cmp)"), "a copy of memory: assign the fields, or loop over a few words"),
    (re.compile(r"printf|puts|malloc|_*(open|read|write|close|lseek)$"), "the C library: status.c shows how a line is composed without it"),
)


@dataclass(frozen=True)
class Piece:
    """A stretch of an input section in the image."""

    start: int
    end: int
    section: str
    file: str


PLACED = re.compile(r"^ (\S+)?\s+0x([0-9a-f]+)\s+0x([0-9a-f]+) (\S.*)$")
DATA_DIGITS = 4     # the map writes addresses of the data space with four digits, those of program memory with six


def read_map(path: Path) -> list[Piece]:
    """Every piece that the map places in the flash."""
    try:
        lines = path.read_bytes().decode("latin-1").splitlines()
    except OSError as error:
        raise UserError(f"cannot read the map file ({error.strerror})", str(path), "build it with make firmware") from None
    begin = next((number for number, line in enumerate(lines) if line.startswith("Linker script and memory map")), None)
    if begin is None:
        raise UserError("not a map file of the linker", str(path), "build it anew with make firmware")
    pieces = []
    for before, line in zip(lines[begin:], lines[begin + 1:]):
        match = PLACED.match(line)
        section = match and (match[1] or before.strip())
        if not match or " " in section or section.startswith((".debug", ".comment", "__c30")): # these have no place in the chip
            continue
        start, size = int(match[2], 16), int(match[3], 16)
        if len(match[2]) == DATA_DIGITS:
            start -= device.PSV_WINDOW # a constant; RAM becomes negative
        if size and start in device.FLASH:
            pieces.append(Piece(start, start + size, section, match[4].strip()))
    return pieces


def is_own(piece: Piece) -> bool:
    """An object file that is in no archive."""
    return piece.file.endswith(".o")


def origins(elf: Elf, pieces: list[Piece]) -> list[str]:
    """A line for every function of a library, and for words of the program that the map does not explain."""
    explained = {address for piece in pieces for address in range(piece.start, piece.end, 2)}
    unknown = sorted(address for address in elf.words if address in device.PROGRAM and address not in explained)
    failures = []
    if unknown:
        failures.append(f"{len(unknown)} words from 0x{unknown[0]:04X} on come from no file that the map names: "
                        "the map is of another build, or the linker made them for a pointer to a function")
    foreign = [piece for piece in pieces if not is_own(piece) and not ALLOWED.search(piece.file)]
    called = {piece: calls_into(elf, piece) for piece in foreign}
    # What only another helper needs goes when that one goes; a piece that nothing calls is told if there is no other.
    roots = [piece for piece in foreign if any(not any(f.start <= place < f.end for f in foreign) for place in called[piece])]
    for piece in roots or foreign:
        callers = sorted({attribution.place(elf, place) for place in called[piece] if not any(f.start <= place < f.end for f in foreign)})
        helpers = helper_names(elf, piece, called[piece])
        failures.append(f"{helpers} of the compiler's library is in the image ({member(piece)}), called by "
                        f"{', '.join(callers) or 'nothing that can be seen'}: {advice(helpers, member(piece))}")
    return failures


def helper_names(elf: Elf, piece: Piece, calls: dict[int, int]) -> str:
    """The functions of a library's piece that something calls, else all of them."""
    inside = {name for address, name in elf.functions if piece.start <= address < piece.end}
    names = {elf.function_at(target) for target in calls.values()} or inside
    return " and ".join(f"{name}()" for name in sorted(names)) or piece.section


def member(piece: Piece) -> str:
    """The archive's member, without the folder."""
    return piece.file.replace("\\", "/").rsplit("/", 1)[-1]


def advice(helpers: str, where: str) -> str:
    names = (*re.findall(r"\w+", helpers), *re.findall(r"\((\w+)", where))
    return next((words for name in names for pattern, words in ADVICE if pattern.search(name)), "write it without the library")


def divisions(elf: Elf, pieces: list[Piece]) -> list[str]:
    """A line for every function of ours with a division that C's / or % made, not a built-in: nobody has proved its operands' ranges."""
    own = [piece for piece in pieces if is_own(piece) and ".text" in piece.section]
    found = {attribution.place(elf, address) for piece in own for address in range(piece.start, piece.end, 2)
             if divides_in_c(elf.words.get(address, 0))}
    return [f"{name} divides by a variable with / or %: use qm_divud() or __builtin_divsd() with a proven range, "
            "or multiply by a constant"
            for name in sorted(found)]


def divides_in_c(word: int) -> bool:
    """DIVF, DIV.S and DIV.U of 16 bits by 16; the built-ins divide 32 bits by 16."""
    return word >> 16 == 0xD9 or word >> 16 == 0xD8 and not word & 0x40


def calls_into(elf: Elf, piece: Piece) -> dict[int, int]:
    """Places outside a piece that call it or jump into it, with their targets."""
    return {place: target for start, end in elf.code for place in range(start, end, 2)
            if (target := branch_target(elf.words, place)) is not None and piece.start <= target < piece.end
            and not piece.start <= place < piece.end}


def branch_target(words: Words, address: int) -> int | None:
    """Where an instruction with a fixed target goes: CALL, GOTO, RCALL, BRA; None for every other one."""
    word = words.get(address, 0)
    opcode = word >> 16
    if opcode in (0x02, 0x04): # the second word holds the target's upper bits
        return word & 0xFFFE | (words.get(address + 2, 0) & 0x7F) << 16
    if opcode == 0x07 or 0x30 <= opcode <= 0x3F or 0x0C <= opcode <= 0x0F:
        return address + 2 + 2 * ((word & 0xFFFF) - (word & 0x8000) * 2)
    return None


def default_handler_is_ours(elf: Elf, pieces: list[Piece]) -> bool:
    address = elf.symbols.get("_" + device.DEFAULT_VECTOR, -1)
    return any(is_own(piece) and piece.start <= address < piece.end for piece in pieces)
