"""Where each program word of the image comes from (function, and the functions it is inlined into) and what each object takes."""

import bisect
import os
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

from tools.common.errors import UserError

from . import device

try:
    from elftools.common.exceptions import DWARFError, ELFError
    from elftools.construct.core import ConstructError
    from elftools.dwarf.dwarfinfo import DebugSectionDescriptor, DwarfConfig, DWARFInfo
    from elftools.elf.elffile import ELFFile
    MISSING = ""
except ImportError as missing:
    MISSING = str(missing.name)

BYTES_PER_WORD = 3          # as data sheets count program memory
COPIES = 2                  # the start-up code's ways to fill RAM: 0 clear, 1 two bytes a word, 2 three; above: call a function
WRITE, ALLOC, EXECUTE, PSV = 0x1, 0x2, 0x4, 0x10000000
DEBUG_SECTIONS = ("debug_info", "debug_abbrev", "debug_line", "debug_str", "debug_loc", "debug_ranges")


@dataclass(frozen=True)
class Frame:
    """A function in the sources."""
    name: str
    file: str


@dataclass
class Node:
    """A stretch of code of one function: its own, or a copy inlined into another one (the parent)."""
    frame: Frame
    low: int
    high: int
    parent: "Node | None" = None
    depth: int = 0

    def chain(self) -> "list[Node]":
        """From the function that is called down to this one."""
        return [*(self.parent.chain() if self.parent else []), self]

    def distance(self, address: int) -> int:
        return max(self.low - address, address - (self.high - 1), 0)


@dataclass(frozen=True)
class Word:
    """A program word: the copy of the function it comes from (the last one) inside its callers."""
    address: int
    chain: tuple[Frame, ...]
    copy: tuple[int, ...]     # which copy of each: lowest address


@dataclass
class Thing:
    """An object or constant, with those of its members that are structures or fields: path, size."""
    name: str
    size: int
    members: list[tuple[str, int]] = field(default_factory=list)


@dataclass
class Image:
    words: list[Word]
    constants: list[Thing]    # sizes in bytes of flash
    data: list[Thing]         # sizes in bytes of RAM
    initial_words: int        # start values of the RAM, and the list of what to clear
    initial_calls: bool       # whether that list names a function to call
    handlers: list[int]       # addresses in the vector table
    ram_bytes: int
    entry: int

    @property
    def flash_bytes(self) -> int:
        return BYTES_PER_WORD * (len(self.words) + self.initial_words) + sum(thing.size for thing in self.constants)


class _Debug:
    """The image's DWARF: functions with what is inlined into them, lines, and types of variables."""

    def __init__(self, elf: "ELFFile") -> None:
        # This ELF stores a byte of the debugging sections in every second byte of the file.
        found = {name: elf.get_section_by_name("." + name) for name in DEBUG_SECTIONS}
        sections = {f"{name}_sec": DebugSectionDescriptor(BytesIO(data), "." + name, None, len(data), 0)
                    for name, section in found.items() if section for data in [section.data()[::2]]}
        self.known = {"debug_info_sec", "debug_abbrev_sec", "debug_line_sec"} <= set(sections)
        absent = [name for name in _section_parameters() if name not in sections]
        self.dwarf = DWARFInfo(DwarfConfig(little_endian=True, machine_arch="dsPIC", default_address_size=4),
                               **sections, **dict.fromkeys(absent))
        self.nodes: list[Node] = []          # called functions
        self.inside: dict[int, list[Node]] = {} # every copy in a called function, by that function's start
        self.lines: dict[int, tuple[str, int]] = {}
        self.functions: dict[str, list[tuple[int, str]]] = {} # of a file: line and name, sorted
        self.types: dict[str, object] = {}
        if self.known:
            for unit in self.dwarf.iter_CUs():
                self._read(unit)
        for known in self.functions.values():
            known.sort()

    def _read(self, unit) -> None:
        top = unit.get_top_DIE()
        program = self.dwarf.line_program_for_CU(unit)
        files = _file_names(top, program)
        for die in top.iter_children():
            if die.tag == "DW_TAG_subprogram":
                self._subprogram(die, files)
            elif die.tag == "DW_TAG_variable" and "DW_AT_name" in die.attributes and "DW_AT_type" in die.attributes:
                self.types.setdefault(_text(die, "DW_AT_name"), die)
        for rows in _sequences(program):
            for row, following in zip(rows, rows[1:]):
                for address in range(row.address, following.address, 2):
                    self.lines[address] = (files.get(row.file, "?"), row.line)

    def _subprogram(self, die, files: dict[int, str]) -> None:
        if "DW_AT_name" in die.attributes and "DW_AT_decl_line" in die.attributes:
            place = files.get(die.attributes["DW_AT_decl_file"].value, "?")
            entry = (die.attributes["DW_AT_decl_line"].value, _text(die, "DW_AT_name"))
            if entry not in self.functions.setdefault(place, []):
                self.functions[place].append(entry)
        low, high = _range(die)
        if high > low >= device.VECTORS_END: # a function that the linker has removed starts at 0
            node = Node(_frame(die, files), low, high)
            self.nodes.append(node)
            self.inside[low] = []
            self._inlined(die, node, files, self.inside[low])

    def _inlined(self, die, node: Node, files: dict[int, str], into: list[Node]) -> None:
        for child in die.iter_children():
            below = node
            if child.tag == "DW_TAG_inlined_subroutine":
                below = Node(_frame(child, files), *_range(child), node, node.depth + 1)
                into.append(below)
            elif child.tag != "DW_TAG_lexical_block":
                continue
            self._inlined(child, below, files, into)

    def function_at(self, file: str, line: int) -> str | None:
        known = self.functions.get(file, [])
        index = bisect.bisect_right(known, (line, "\uffff")) - 1
        return known[index][1] if index >= 0 else None

    def members(self, name: str) -> list[tuple[str, int]]:
        die = self.types.get(name)
        return list(_members(die, name)) if die is not None else []


def read(path: Path) -> Image:
    """The image in an ELF file of XC16."""
    if MISSING:
        raise UserError(f"no Python module {MISSING}", "tools/image", "install the Debian package python3-pyelftools")
    try:
        with path.open("rb") as file:
            elf = ELFFile(file)
            if elf["e_machine"] != device.ELF_MACHINE or elf["e_type"] != "ET_EXEC":
                raise UserError("not a linked dsPIC program", str(path), "build it with `make firmware`")
            return _read(elf, path)
    except OSError as error:
        raise UserError(f"cannot read the file ({error.strerror})", str(path), "build it with `make firmware`") from None
    except (ELFError, DWARFError, ConstructError, KeyError, ValueError, IndexError, TypeError, AttributeError, AssertionError) as error:
        raise UserError(f"not a whole ELF file ({type(error).__name__})", str(path), "build it anew with `make firmware`") from None


def _read(elf: "ELFFile", path: Path) -> Image:
    debug = _Debug(elf)
    if not debug.known:
        raise UserError("no debugging information", str(path), "compile with -g")
    symbols = [symbol for symbol in elf.get_section_by_name(".symtab").iter_symbols() if isinstance(symbol["st_shndx"], int)]
    words, constants, data, initial, handlers, ram = [], [], [], [], set(), 0
    for number, section in enumerate(elf.iter_sections()):
        flags, address = section["sh_flags"], section["sh_addr"]
        if not flags & ALLOC and not flags & EXECUTE or not section["sh_size"]:
            continue
        inside = [symbol for symbol in symbols if symbol["st_shndx"] == number]
        if flags & WRITE:
            if address in device.RAM:
                ram += section["sh_size"] // 2
                data += _variables(section, inside, debug)
        elif flags & PSV:
            constants += _constants(section, inside, debug)
        elif section.name == ".dinit":
            initial += _raw(section)
        elif flags & EXECUTE and device.IVT <= address < device.VECTORS_END:
            handlers.update(_raw(section))
        elif flags & EXECUTE and address in device.PROGRAM:
            words += _words(section, inside, debug)
    rest = ram - sum(thing.size for thing in data)
    if rest:
        data.append(Thing("(alignment)", rest))
    return Image(words, constants, data, len(initial), _calls(initial), sorted(handlers), ram, elf["e_entry"])


def _raw(section) -> list[int]:
    """The section's program words; a word is four bytes in the file."""
    return [int.from_bytes(raw, "little") for raw in _quads(section.data())]


def _quads(data: bytes):
    return (data[at:at + 4] for at in range(0, len(data), 4))


def _calls(records: list[int]) -> bool:
    """Whether the list of start values (address, bytes, way, values) has a record that calls a function."""
    at = 0
    while at + 2 < len(records) and records[at] & 0xFFFF:
        size, way = records[at + 1] & 0xFFFF, records[at + 2] & 0x7F
        if way > COPIES:
            return True
        at += 3 + (-(-size // (way + 1)) if way else 0)
    return False


def _words(section, symbols: list, debug: _Debug) -> list[Word]:
    low = section["sh_addr"]
    nodes = {node.low: node for node in debug.nodes}
    starts = sorted(nodes)
    labels = sorted((symbol["st_value"], symbol.name) for symbol in symbols
                    if symbol.name and not symbol.name.startswith(".") and symbol["st_info"]["type"] != "STT_SECTION")
    return [_word(address, nodes, starts, labels, debug) for address in range(low, low + section["sh_size"] // 2, 2)]


def _word(address: int, nodes: dict[int, Node], starts: list[int], labels: list[tuple[int, str]], debug: _Debug) -> Word:
    index = bisect.bisect_right(starts, address) - 1
    if index < 0 or nodes[starts[index]].high <= address: # no C function: start-up code or a library
        label = bisect.bisect_right(labels, (address, "\uffff")) - 1
        name = labels[label][1] if label >= 0 else "?"
        return Word(address, (Frame(_plain(name), ""),), (labels[label][0] if label >= 0 else 0,))
    function = nodes[starts[index]]
    copies = debug.inside[function.low]
    best = max((node for node in copies if node.low <= address < node.high), key=lambda node: (node.depth, node.low - node.high),
               default=function)
    # The lines tell more exactly than the stretches, which have gaps where the compiler has mixed two functions' instructions.
    place = debug.lines.get(address)
    name = debug.function_at(*place) if place else None
    if name is not None and name != best.frame.name:
        named = [node for node in [function, *copies] if node.frame.name == name]
        best = min(named, key=lambda node: (node.distance(address), -node.depth), default=best)
    chain = best.chain()
    return Word(address, tuple(node.frame for node in chain), tuple(node.low for node in chain))


def _variables(section, symbols: list, debug: _Debug) -> list[Thing]:
    """The linker keeps no size of an object with a start value: it ends where the next one begins."""
    named = {symbol["st_value"]: symbol for symbol in symbols
             if symbol["st_info"]["type"] != "STT_SECTION" and symbol.name and not symbol.name.startswith(".")}
    ends = [*sorted(named), section["sh_addr"] + section["sh_size"] // 2]
    return [Thing(_plain(named[start].name), named[start]["st_size"] or end - start, debug.members(_plain(named[start].name)))
            for start, end in zip(ends, ends[1:])]


def _constants(section, symbols: list, debug: _Debug) -> list[Thing]:
    """A word of flash shows two bytes to the data space and takes three."""
    low, end = section["sh_addr"], section["sh_addr"] + section["sh_size"] // 2
    named = {symbol["st_value"]: symbol.name for symbol in symbols if symbol.name and symbol["st_info"]["type"] != "STT_SECTION"}
    starts = sorted({low, *named})
    things: dict[str, Thing] = {}
    for start, following in zip(starts, [*starts[1:], end]):
        label = named.get(start, "")
        name = "(texts)" if label.startswith(".LC") or not label else _plain(label)
        # a boundary in the middle of a word belongs to what starts before it
        words = (following - low + 1) // 2 - (start - low + 1) // 2
        thing = things.setdefault(name, Thing(name, 0, [(path, size * BYTES_PER_WORD // 2) for path, size in debug.members(name)]))
        thing.size += BYTES_PER_WORD * words
    return list(things.values())


def _members(die, path: str):
    """Every member of a structure and of the structures in it, with its size in bytes of data."""
    kind = _type(die)
    if kind is None or kind.tag != "DW_TAG_structure_type":
        return
    for member in kind.iter_children():
        if member.tag == "DW_TAG_member" and "DW_AT_name" in member.attributes:
            name = f"{path}.{_text(member, 'DW_AT_name')}"
            yield name, _size(member)
            yield from _members(member, name)


def _type(die):
    """What a variable, member or type stands for, without typedef, const and volatile."""
    while die is not None and "DW_AT_type" in die.attributes:
        die = die.get_DIE_from_attribute("DW_AT_type")
        if die.tag not in ("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type"):
            return die
    return None


def _size(die) -> int:
    kind = _type(die)
    if kind is None:
        return 0
    if kind.tag == "DW_TAG_array_type":
        size = _size(kind)
        for dimension in kind.iter_children():
            if "DW_AT_upper_bound" in dimension.attributes:
                size *= dimension.attributes["DW_AT_upper_bound"].value + 1
        return size
    return kind.attributes["DW_AT_byte_size"].value if "DW_AT_byte_size" in kind.attributes else 2


def _section_parameters() -> list[str]:
    code = DWARFInfo.__init__.__code__
    return [name for name in code.co_varnames[2:code.co_argcount] if name.endswith("_sec")]


def _file_names(top, program) -> dict[int, str]:
    """The line program's files, relative to the folder that was compiled in; a file of the compiler by its name in <>."""
    folder = _text(top, "DW_AT_comp_dir")
    own = _text(top, "DW_AT_name")
    names = {}
    if program is None:
        return {1: own}
    directories = [text.decode(errors="replace") for text in program["include_directory"]]
    for number, entry in enumerate(program["file_entry"], 1):
        directory = directories[entry.dir_index - 1] if entry.dir_index else ""
        name = os.path.normpath(os.path.join(folder, directory, entry.name.decode(errors="replace")))
        names[number] = os.path.relpath(name, folder) if name.startswith(folder + "/") else f"<{os.path.basename(name)}>"
    return names


def _sequences(program):
    """Runs of line rows without a gap, but for functions that the linker has removed."""
    rows = []
    for entry in program.get_entries() if program is not None else []:
        state = entry.state
        if state is None:
            continue
        rows.append(state)
        if state.end_sequence:
            if rows[0].address >= device.VECTORS_END:
                yield rows
            rows = []


def _range(die) -> tuple[int, int]:
    attributes = die.attributes
    if "DW_AT_low_pc" not in attributes or "DW_AT_high_pc" not in attributes:
        return 0, 0
    return attributes["DW_AT_low_pc"].value, attributes["DW_AT_high_pc"].value


def _frame(die, files: dict[int, str]) -> Frame:
    while "DW_AT_name" not in die.attributes and "DW_AT_abstract_origin" in die.attributes:
        die = die.get_DIE_from_attribute("DW_AT_abstract_origin")
    place = die.attributes.get("DW_AT_decl_file")
    return Frame(_text(die, "DW_AT_name"), files.get(place.value, "?") if place else "?")


def _text(die, name: str) -> str:
    value = die.attributes[name].value if name in die.attributes else b"?"
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _plain(symbol: str) -> str:
    """A symbol's name in C: one underscore less."""
    return symbol.removeprefix("_")
