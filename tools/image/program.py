"""Program memory as it stands in an image: 24-bit words by address, read from an ELF file of XC16 or from a HEX file."""

import bisect
from collections.abc import Callable
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

WRITE, ALLOC, EXECUTE = 0x1, 0x2, 0x4
HEX_END = ":00000001FF"
BYTES_OF_A_WORD = 4         # in both files: the fourth, the phantom byte, is 0
REMEDY = "build it anew with make firmware"


@dataclass
class Elf:
    """What the checks need of an ELF file."""

    words: Words
    code: list[tuple[int, int]]                              # stretches of instructions: start, end
    symbols: dict[str, int] = field(default_factory=dict)    # of the linker's and the program's; in program memory only those of `code`
    functions: list[tuple[int, str]] = field(default_factory=list)  # start and C name, sorted
    devices: set[str] = field(default_factory=set)           # the parts that the objects were compiled for
    ram_bytes: int = 0

    def function_at(self, address: int) -> str:
        """C name of the function that holds this address."""
        index = bisect.bisect_right(self.functions, (address, "\uffff")) - 1
        return self.functions[index][1] if index >= 0 else f"0x{address:04X}"


def c_name(symbol: str) -> str:
    """The name in C: XC16 puts one underscore before it, and a suffix behind a copy that it makes for itself."""
    return symbol.removeprefix("_").split(".")[0]


def _read(path: Path, kind: str, parse: Callable[[bytes], object]):
    """The file's content, parsed; whatever a damaged file does to the parser becomes one line."""
    if MISSING:
        raise UserError(f"no Python module {MISSING}", "tools/image", "install the Debian packages python3-pyelftools and python3-intelhex")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"cannot read the {kind} file ({error.strerror})", str(path), "build it with make firmware") from None
    try:
        return parse(data)
    except UserError:
        raise
    except Exception as error: # pylint: disable=broad-except  # the parsers are not ours: any of theirs means a damaged file
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(f"not a whole {kind} file ({why[:80]})", str(path), REMEDY) from None


def read_elf(path: Path) -> Elf:
    """Words, symbols and memory of a linked program."""
    return _read(path, "ELF", lambda data: _elf(path, data))


def _elf(path: Path, data: bytes) -> Elf:
    file = elftools.elf.elffile.ELFFile(BytesIO(data))
    if file["e_machine"] != device.ELF_MACHINE or file["e_type"] != "ET_EXEC":
        raise UserError("not a linked program for a dsPIC", str(path), REMEDY)
    result = Elf({}, [])
    executable = set()
    for number, section in enumerate(file.iter_sections()):
        flags, size = section["sh_flags"], section["sh_size"]
        if section["sh_type"] not in ("SHT_PROGBITS", "SHT_NOBITS") or not flags & (ALLOC | EXECUTE) or not size:
            continue
        if flags & WRITE and not flags & EXECUTE: # RAM; its start values stand in the template .dinit
            if section["sh_addr"] in device.RAM:
                result.ram_bytes += size // 2 # a byte takes two in this ELF
            continue
        if section["sh_type"] == "SHT_NOBITS":
            continue
        if section["sh_offset"] + size > len(data) or size % BYTES_OF_A_WORD:
            raise UserError(f"section {section.name} does not end inside the ELF file", str(path), REMEDY)
        # By section, because the segment of the configuration words has no gaps where their addresses have. Constants have an address
        # in the data space, from PSV_WINDOW on; all flash of this part is one page of it.
        start = section["sh_addr"] if flags & EXECUTE else section["sh_addr"] - device.PSV_WINDOW
        _add(result.words, start, data[section["sh_offset"]:section["sh_offset"] + size], f"section {section.name}", path)
        if flags & EXECUTE:
            executable.add(number)
            result.code.append((start, start + size // 2))
    table = file.get_section_by_name(".symtab")
    if table is None or not result.words:
        raise UserError("no program or no symbols in the ELF file", str(path), REMEDY)
    _symbols(result, table, executable)
    return result


def _symbols(result: Elf, table, executable: set[int]) -> None:
    functions = {}
    for symbol in table.iter_symbols():
        name, value, place = symbol.name, symbol["st_value"], symbol["st_shndx"]
        if place == "SHN_ABS":
            if name.startswith("__") and name[2:4] in ("33", "30", "24"):
                result.devices.add(name[2:])
            result.symbols.setdefault(name, value)
        elif isinstance(place, int) and name:
            if place in executable and symbol["st_info"]["type"] != "STT_SECTION" and not name.startswith("."):
                result.symbols.setdefault(name, value)
                if value not in functions or symbol["st_info"]["type"] == "STT_FUNC":
                    functions[value] = c_name(name)
    result.functions = sorted(functions.items())


def read_hex(path: Path) -> Words:
    """The words of an Intel HEX file: a byte's address is twice the program counter's, and each fourth byte is 0."""
    return _read(path, "HEX", lambda data: _hex(path, data))


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
        _add(words, start // 2, file.tobinstr(start, end - 1), "the HEX file", path)
    if not words:
        raise UserError("no data in the HEX file", str(path), REMEDY)
    return words


def _add(words: Words, start: int, data: bytes, where: str, path: Path) -> None:
    """Puts the words of some bytes to their addresses."""
    for offset in range(0, len(data), BYTES_OF_A_WORD):
        address = start + offset // 2
        if data[offset + 3] != 0 or address % 2:
            raise UserError(f"no 24-bit word at 0x{address:06X} of {where}", str(path), REMEDY)
        if address in words:
            raise UserError(f"two words for address 0x{address:06X} in {where}", str(path), REMEDY)
        words[address] = int.from_bytes(data[offset:offset + 3], "little")
