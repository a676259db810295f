"""The reader of images: memory words, sections and names of an ELF file of XC16, memory words of an Intel HEX file.

Addresses of program memory are the program counter's, 2 for each 24-bit word; those of data memory count bytes."""

import bisect
import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO, StringIO
from pathlib import Path

from tools.common.errors import UserError

from . import device

try:
    import elftools.elf.elffile
    import intelhex
    MISSING = ""
except ImportError as error:
    MISSING = error.name

Words = dict[int, int]      # address -> 24-bit word

WRITE, ALLOC, EXECUTE, NOT_LOADED, PERSISTENT = 0x1, 0x2, 0x4, 0x00800000, 0x02000000
CODE, CONSTANTS, DATA = "code", "constants", "data"
LARGEST_FILE = 64 << 20
HEX_START, HEX_END = ":", ":00000001FF"
BYTES_OF_A_WORD = 4         # in both files: the fourth, the phantom byte, is 0
REMEDY = "build it anew with make firmware"


@dataclass(frozen=True)
class Section:
    """A stretch of memory: instructions, constants (with addresses in their window of the data space) or variables."""

    name: str
    memory: str
    start: int
    end: int
    persistent: bool = False    # variables that the start-up code leaves alone


@dataclass(frozen=True)
class Symbol:
    """A name: in a section, or the linker's own number where `section` is None."""

    symbol: str                 # as the linker has it
    address: int
    size: int                   # in units of the address; 0: unknown
    function: bool
    section: Section | None

    @property
    def name(self) -> str:
        """In C: the compiler puts one underscore before it."""
        return self.symbol.removeprefix("_")

    @property
    def local(self) -> bool:
        """A label of the compiler's, such as a text's; kept only among the constants."""
        return self.symbol.startswith(".")


@dataclass
class Elf:
    """What an ELF file says."""

    words: Words                                             # program memory and configuration words
    sections: list[Section] = field(default_factory=list)
    names: list[Symbol] = field(default_factory=list)        # sorted: code before data, then by address, functions first
    debug: dict[str, bytes] = field(default_factory=dict)    # contents of .debug_info and its like
    entry: int = 0

    def __post_init__(self) -> None:
        named = [item for item in self.names if item.section is None or item.section.memory == CODE]
        #: the linker's own numbers and the addresses of code, by symbol
        self.symbols = {item.symbol: item.address for item in reversed(named)}
        #: the parts that the objects were compiled for
        self.devices = {item.symbol[2:] for item in named if item.section is None and item.symbol.startswith(("__33", "__30", "__24"))}
        first = {item.address: c_name(item.symbol) for item in reversed(named) if item.section is not None}
        #: start and C name of what is in the code, sorted
        self.functions = sorted(first.items())

    @property
    def ram_bytes(self) -> int:
        return sum(section.end - section.start for section in self.sections if section.memory == DATA)

    @property
    def code(self) -> list[tuple[int, int]]:
        """Stretches of instructions: start, end."""
        return [(section.start, section.end) for section in self.sections if section.memory == CODE]

    def function_at(self, address: int) -> str:
        """C name of the function that holds this address."""
        index = bisect.bisect_right(self.functions, (address, "\uffff")) - 1
        return self.functions[index][1] if index >= 0 else f"0x{address:04X}"


def c_name(symbol: str) -> str:
    """The name in C: XC16 puts one underscore before it, and a suffix behind a copy that it makes for itself."""
    return symbol.removeprefix("_").split(".")[0]


@contextlib.contextmanager
def reading(kind: str, path: Path) -> Iterator[None]:
    """Whatever a damaged file does to a parser becomes one line."""
    if MISSING:
        raise UserError(f"no Python module {MISSING}", "tools/image", "install the Debian packages python3-pyelftools and python3-intelhex")
    try:
        yield
    except UserError:
        raise
    except Exception as error: # pylint: disable=broad-except  # the parsers are not ours: any of theirs means a damaged file
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(f"not a whole {kind} file ({why[:80]})", str(path), REMEDY) from None


def contents(kind: str, path: Path) -> bytes:
    """The file's bytes; one that no image can be is not read."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise UserError(f"the {kind} file cannot be read (it is larger than any image)", str(path), "name an ELF or HEX file")
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"cannot read the {kind} file ({error.strerror})", str(path), "build it with make firmware") from None


def load(path: Path) -> Elf:
    """The image in an ELF or HEX file, ready to run: for this part, and with a reset vector that leads into the program."""
    data = contents("ELF or HEX", path)
    if data.startswith(b"\x7fELF"):
        elf = read_elf(path, data)
    elif data.lstrip()[:1] == HEX_START.encode():
        elf = Elf(read_hex(path, data))
    else:
        raise UserError("neither an ELF nor an Intel HEX file", str(path), "name what the linker or xc16-bin2hex wrote")
    if others := sorted(elf.devices - {device.NAME}):
        raise UserError(f"the ELF file is for the {others[0]}", str(path), f"build it for the {device.NAME}")
    for address in sorted(elf.words):
        if address not in device.FLASH and address not in device.CONFIGURATION:
            raise UserError(f"address 0x{address:X} is outside the {device.NAME}", str(path), "build it for that device")
    target = reset_target(elf.words)
    if target is None:
        what = f"0x{elf.words[0]:06X} at address 0 is no GOTO" if 0 in elf.words else "no reset vector at address 0"
        raise UserError(what, str(path), "link it with the device's linker script")
    if target not in elf.words or target not in device.FLASH:
        raise UserError(f"the reset vector leads to 0x{target:X}, where nothing is programmed", str(path), "build it again")
    return elf


def reset_target(words: Words) -> int | None:
    """Where the first instruction, a GOTO, leads."""
    first, second = words.get(0, device.ERASED), words.get(2, device.ERASED)
    return None if first & 0xFF0001 != 0x040000 or second >> 7 else first & 0xFFFE | second << 16


# ---- ELF -----------------------------------------------------------------------------------------------------------------
def read_elf(path: Path, data: bytes | None = None) -> Elf:
    """Words, sections, symbols and debugging sections of a linked program."""
    data = contents("ELF", path) if data is None else data
    with reading("ELF", path):
        return _elf(path, data)


def _elf(path: Path, data: bytes) -> Elf:
    file = elftools.elf.elffile.ELFFile(BytesIO(data))
    if file.elfclass != 32 or not file.little_endian or file["e_machine"] != device.ELF_MACHINE or file["e_type"] != "ET_EXEC":
        raise UserError(f"not a linked program for a dsPIC ({file.elfclass} bits, {file['e_machine']}, {file['e_type']})", str(path),
                        REMEDY)
    words: Words = {}
    sections: dict[int, Section] = {}
    debug = {}
    for number, section in enumerate(file.iter_sections()):
        kind, size = section["sh_type"], section["sh_size"]
        if kind != "SHT_NOBITS" and section["sh_offset"] + size > len(data):
            raise UserError(f"section {section.name} does not end inside the ELF file", str(path), REMEDY)
        if section.name.startswith(".debug_"):
            debug[section.name[1:]] = section.data()[::2] # this ELF stores a byte of them in every second byte of the file
        elif kind in ("SHT_PROGBITS", "SHT_NOBITS") and size and (found := _section(section)):
            sections[number] = found
            if found.memory != DATA and not section["sh_flags"] & NOT_LOADED: # a place that stays erased
                _add(words, found, section.data(), path)
    table = file.get_section_by_name(".symtab")
    if table is None or not words:
        raise UserError("no program or no symbols in the ELF file", str(path), REMEDY)
    return Elf(words, list(sections.values()), _symbols(table, sections), debug, file["e_entry"])


def _section(section) -> Section | None:
    """A section of the chip's memory. Start values of variables stand in .dinit too, so their own sections are only memory."""
    flags, start, held = section["sh_flags"], section["sh_addr"], section["sh_type"] == "SHT_PROGBITS"
    end = start + section["sh_size"] // 2 # the file has two bytes for one of data, four for a program word
    if flags & EXECUTE:
        return Section(section.name, CODE, start, end) if held else None
    if flags & WRITE:
        return Section(section.name, DATA, start, end, bool(flags & PERSISTENT)) if start in device.RAM else None
    return Section(section.name, CONSTANTS, start, end) if flags & ALLOC and held else None


def _symbols(table, sections: dict[int, Section]) -> list[Symbol]:
    result = []
    for symbol in table.iter_symbols():
        place, kind, name = symbol["st_shndx"], symbol["st_info"]["type"], symbol.name
        section = sections.get(place) if isinstance(place, int) else None
        wanted = not name.startswith(".") or section is not None and section.memory == CONSTANTS
        if name and wanted and (place == "SHN_ABS" or section is not None and kind != "STT_SECTION"):
            result.append(Symbol(name, symbol["st_value"], symbol["st_size"], kind == "STT_FUNC", section))
    return sorted(result, key=lambda item: (item.section is not None and item.section.memory != CODE, item.address, not item.function,
                                            item.name))


# ---- HEX -----------------------------------------------------------------------------------------------------------------
def read_hex(path: Path, data: bytes | None = None) -> Words:
    """The words of an Intel HEX file: a byte's address is twice the program counter's."""
    data = contents("HEX", path) if data is None else data
    with reading("HEX", path):
        return _hex(path, data)


def _hex(path: Path, data: bytes) -> Words:
    text = data.decode("ascii").upper()
    if text.count(HEX_END) != 1 or not text.rstrip().endswith(HEX_END):
        raise UserError("the HEX file does not end with its end record", str(path), REMEDY)
    file = intelhex.IntelHex()
    file.loadhex(StringIO(text)) # refuses wrong check sums and bytes that are given twice
    words: Words = {}
    for start, end in file.segments():
        if start % BYTES_OF_A_WORD or (end - start) % BYTES_OF_A_WORD:
            raise UserError(f"half a word in the HEX file, at 0x{start // 2:06X}", str(path), REMEDY)
        _add(words, Section("of the HEX file", CODE, start // 2, end // 2), file.tobinstr(start, end - 1), path)
    if not words:
        raise UserError("no data in the HEX file", str(path), REMEDY)
    return words


def _add(words: Words, section: Section, data: bytes, path: Path) -> None:
    """Puts a section's words to their addresses. By section, because the segment of the configuration words has no gaps where their
    addresses have. All flash of this part is one page of the window that constants have in the data space."""
    start = section.start - (device.PSV_WINDOW if section.memory == CONSTANTS else 0)
    if len(data) % BYTES_OF_A_WORD:
        raise UserError(f"{len(data)} bytes of section {section.name} are no whole words", str(path), REMEDY)
    for offset in range(0, len(data), BYTES_OF_A_WORD):
        address = start + offset // 2
        if data[offset + 3] != 0 or address % 2:
            raise UserError(f"no 24-bit word at 0x{address:06X}, section {section.name}", str(path), REMEDY)
        if address in words:
            raise UserError(f"two words for address 0x{address:06X}, section {section.name}", str(path), REMEDY)
        words[address] = int.from_bytes(data[offset:offset + 3], "little")
