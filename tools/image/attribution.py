"""Where each program word of the image comes from (function, file, and the functions it is inlined into) and what each object takes."""

import bisect
import os
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from io import BytesIO
from pathlib import Path

from tools.common.errors import UserError

from . import device
from .program import CODE, CONSTANTS, DATA, Elf, Section, Symbol, read_elf, reading

try:
    from elftools.dwarf.dwarfinfo import DebugSectionDescriptor, DwarfConfig, DWARFInfo
except ImportError:
    pass # program.reading() says so

BYTES_PER_WORD = 3          # as data sheets count program memory
COPIES = 2                  # the start-up code's ways to fill RAM: 0 clear, 1 two bytes a word, 2 three; above: call a function
DEBUGGED = {"debug_info", "debug_abbrev", "debug_line"}
ADDRESS = 0x03              # DW_OP_addr: a variable with a place of its own


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
    """An object or constant, the file that defines it, and its members: path, size."""
    name: str
    size: int
    members: list[tuple[str, int]] = field(default_factory=list)
    file: str = ""


@dataclass
class Image:
    words: list[Word]
    constants: list[Thing]    # sizes in bytes of flash
    data: list[Thing]         # sizes in bytes of RAM
    initial_words: int        # start values of the RAM, and the list of what to clear
    initial_calls: bool       # whether that list names a function to call
    handlers: dict[int, list[str]] # addresses in the vector table: the vectors that go there
    ram_bytes: int
    entry: int
    labels: frozenset[str] = frozenset()    # names in the code

    @property
    def flash_bytes(self) -> int:
        return BYTES_PER_WORD * (len(self.words) + self.initial_words) + sum(thing.size for thing in self.constants)


def dwarf_info(sections: dict[str, bytes]):
    """The image's DWARF, from its sections."""
    parameters = DWARFInfo.__init__.__code__
    names = [name for name in parameters.co_varnames[2:parameters.co_argcount] if name.endswith("_sec")]
    held = {name: sections.get(name.removesuffix("_sec")) for name in names}
    return DWARFInfo(DwarfConfig(little_endian=True, machine_arch="dsPIC", default_address_size=4),
                     **{name: data and DebugSectionDescriptor(BytesIO(data), "." + name, None, len(data), 0) for name, data in held.items()})


class _Debug:
    """The image's DWARF: functions with what is inlined into them, lines, and types of variables."""

    def __init__(self, sections: dict[str, bytes]) -> None:
        self.dwarf = dwarf_info(sections)
        self.nodes: dict[int, Node] = {}        # called functions, by start
        self.inside: dict[int, list[Node]] = {} # every copy in a called function, by that function's start
        self.lines: dict[int, tuple[str, int]] = {}
        self.functions: dict[str, list[tuple[int, str]]] = {} # of a file: line and name, sorted
        self.variables: dict[str, object] = {}
        self.files: dict[int, str] = {}         # which file defines the variable at an address
        for unit in self.dwarf.iter_CUs():
            self._read(unit)
        for known in self.functions.values():
            known.sort()

    @cached_property
    def starts(self) -> list[int]:
        return sorted(self.nodes)

    def _read(self, unit) -> None:
        top = unit.get_top_DIE()
        program = self.dwarf.line_program_for_CU(unit)
        files = _file_names(top, program)
        for die in top.iter_children():
            if die.tag == "DW_TAG_subprogram":
                self._subprogram(die, files)
        for die in unit.iter_DIEs():
            if die.tag == "DW_TAG_variable":
                self._variable(die, files, os.path.normpath(_text(top, "DW_AT_name")))
        for rows in _sequences(program):
            for row, following in zip(rows, rows[1:]):
                for address in range(row.address, min(following.address, device.PROGRAM.stop), 2):
                    self.lines[address] = (files.get(row.file, "?"), row.line)

    def _variable(self, die, files: dict[int, str], unit: str) -> None:
        """One that others see is defined in the unit, whatever header declares it; a static one where it is written."""
        place = die.attributes.get("DW_AT_location")
        die = _origin(die)
        name = _text(die, "DW_AT_name")
        if "DW_AT_type" in die.attributes:
            self.variables.setdefault(name, die)
        if place is not None and isinstance(place.value, (list, bytes)) and len(place.value) > 1 and place.value[0] == ADDRESS:
            written = die.attributes.get("DW_AT_decl_file")
            self.files[int.from_bytes(bytes(place.value[1:]), "little")] = \
                unit if "DW_AT_external" in die.attributes or written is None else files.get(written.value, unit)

    def _subprogram(self, die, files: dict[int, str]) -> None:
        if "DW_AT_name" in die.attributes and "DW_AT_decl_line" in die.attributes:
            place = files.get(die.attributes["DW_AT_decl_file"].value, "?")
            entry = (die.attributes["DW_AT_decl_line"].value, _text(die, "DW_AT_name"))
            if entry not in self.functions.setdefault(place, []):
                self.functions[place].append(entry)
        low, high = _range(die)
        if high > low >= device.VECTORS_END: # a function that the linker has removed starts at 0
            node = Node(_frame(die, files), low, high)
            self.nodes[low] = node
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

    def thing(self, symbol: Symbol, size: int) -> Thing:
        """An object with what is known of it."""
        die = self.variables.get(symbol.name)
        return Thing(symbol.name, size, list(_members(die, symbol.name)) if die is not None else [], self.files.get(symbol.address, ""))


def read(path: Path, by_lines: bool = True) -> Image:
    """The image in an ELF file of XC16. @param by_lines off: inlined code is only told by its address"""
    elf = read_elf(path)
    if not DEBUGGED <= set(elf.debug):
        raise UserError("no debugging information", str(path), "compile with -g")
    with reading("ELF", path):
        return _read(elf, by_lines)


def lines(elf: Elf) -> dict[int, tuple[str, int]]:
    """File and line of every instruction of an image with debugging information."""
    return _debug(elf).lines


def place(elf: Elf, address: int) -> str:
    """The function whose code it is, where it is written, though the compiler has put it into another one: "name() (file, line 7)"; in an image without
    debugging information the name that is before it."""
    if not DEBUGGED <= set(elf.debug):
        return f"{elf.function_at(address)}()"
    with reading("ELF", Path("the image")):
        word = _word(address, debug := _debug(elf))
    if word is None:
        return f"{elf.function_at(address)}()"
    file, line = debug.lines.get(address, (word.chain[-1].file, 0))
    return f"{word.chain[-1].name}() ({file}{f', line {line}' if line else ''})"


@lru_cache(maxsize=1)
def _cached(sections: tuple[tuple[str, bytes], ...]) -> _Debug:
    return _Debug(dict(sections))


def _debug(elf: Elf) -> _Debug:
    return _cached(tuple(sorted(elf.debug.items())))


def _read(elf: Elf, by_lines: bool) -> Image:
    debug = _debug(elf)
    words, constants, data, initial = [], [], [], []
    for section in elf.sections:
        named = {item.address: item for item in elf.names if item.section is section}
        if section.memory == DATA:
            data += _variables(section, named, debug)
        elif section.memory == CONSTANTS:
            constants += _constants(section, named, debug)
        elif section.name == ".dinit":
            initial += [elf.words[address] for address in range(section.start, section.end, 2)]
        elif section.memory == CODE and section.start in device.PROGRAM:
            words += [_word(address, debug, by_lines) or _unknown(address, named) for address in range(section.start, section.end, 2)
                      if address in elf.words] # what stays erased is nobody's
    rest = elf.ram_bytes - sum(thing.size for thing in data)
    if rest:
        data.append(Thing("(alignment)", rest))
    return Image(words, constants, data, len(initial), _calls(initial), _handlers(elf), elf.ram_bytes, elf.entry,
                 frozenset(item.name for item in elf.names if item.section is not None and item.section.memory == CODE))


def _handlers(elf: Elf) -> dict[int, list[str]]:
    """Vectors of both tables by the address of their handler."""
    found: dict[int, list[str]] = {}
    for table in (device.IVT, device.AIVT):
        for number, vector in enumerate(device.VECTORS):
            if (address := elf.words.get(table + 2 * number)) is not None and vector not in found.setdefault(address, []):
                found[address].append(vector)
    return dict(sorted(found.items()))


def _calls(records: list[int]) -> bool:
    """Whether the list of start values (address, bytes, way, values) has a record that calls a function."""
    at = 0
    while at + 2 < len(records) and records[at] & 0xFFFF:
        size, way = records[at + 1] & 0xFFFF, records[at + 2] & 0x7F
        if way > COPIES:
            return True
        at += 3 + (-(-size // (way + 1)) if way else 0)
    return False


def _unknown(address: int, named: dict[int, Symbol]) -> Word:
    """A word of the start-up code or of a library: the name before it."""
    start = max((place for place in named if place <= address), default=0)
    return Word(address, (Frame(named[start].name if start in named else "?", ""),), (start,))


def _word(address: int, debug: _Debug, by_lines: bool = True) -> Word | None:
    """A word of a C function."""
    index = bisect.bisect_right(debug.starts, address) - 1
    if index < 0 or debug.nodes[debug.starts[index]].high <= address:
        return None
    function = debug.nodes[debug.starts[index]]
    copies = debug.inside[function.low]
    best = max((node for node in copies if node.low <= address < node.high), key=lambda node: (node.depth, node.low - node.high),
               default=function)
    # The lines tell more exactly than the stretches, which have gaps where the compiler has mixed two functions' instructions.
    place = debug.lines.get(address) if by_lines else None
    name = debug.function_at(*place) if place else None
    if name is not None and name != best.frame.name:
        named = [node for node in [function, *copies] if node.frame.name == name]
        best = min(named, key=lambda node: (node.distance(address), -node.depth), default=best)
    chain = best.chain()
    return Word(address, tuple(node.frame for node in chain), tuple(node.low for node in chain))


def _variables(section: Section, named: dict[int, Symbol], debug: _Debug) -> list[Thing]:
    """The linker keeps no size of an object with a start value: it ends where the next one begins."""
    ends = [*sorted(named), section.end]
    return [debug.thing(named[start], named[start].size or end - start) for start, end in zip(ends, ends[1:])]


def _constants(section: Section, named: dict[int, Symbol], debug: _Debug) -> list[Thing]:
    """A word of flash shows two bytes to the data space and takes three. What has no name of its own is a text."""
    starts = sorted({section.start, *named})
    things: dict[str, Thing] = {}
    for start, following in zip(starts, [*starts[1:], section.end]):
        found = debug.thing(named[start], 0) if start in named and not named[start].local else Thing("(texts)", 0)
        thing = things.setdefault(found.name, found)
        # a boundary in the middle of a word belongs to what starts before it
        thing.size += BYTES_PER_WORD * ((following - section.start + 1) // 2 - (start - section.start + 1) // 2)
    for thing in things.values():
        thing.members = [(path, size * BYTES_PER_WORD // 2) for path, size in thing.members]
    return list(things.values())


def _members(die, path: str):
    """Every member of a structure and of the structures in it, with its size in bytes of data."""
    kind = type_of(die)
    if kind is None or kind.tag != "DW_TAG_structure_type":
        return
    for member in kind.iter_children():
        if member.tag == "DW_TAG_member" and "DW_AT_name" in member.attributes:
            name = f"{path}.{_text(member, 'DW_AT_name')}"
            yield name, _size(member)
            yield from _members(member, name)


def type_of(die):
    """What a variable, member or type stands for, without typedef, const and volatile."""
    while die is not None and "DW_AT_type" in die.attributes:
        die = die.get_DIE_from_attribute("DW_AT_type")
        if die.tag not in ("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type"):
            return die
    return None


def _size(die) -> int:
    kind = type_of(die)
    if kind is None:
        return 0
    if kind.tag == "DW_TAG_array_type":
        size = _size(kind)
        for dimension in kind.iter_children():
            if "DW_AT_upper_bound" in dimension.attributes:
                size *= dimension.attributes["DW_AT_upper_bound"].value + 1
        return size
    return kind.attributes["DW_AT_byte_size"].value if "DW_AT_byte_size" in kind.attributes else 2


def _file_names(top, program) -> dict[int, str]:
    """The line program's files, relative to the folder that was compiled in; a file of the compiler by its name in <>."""
    if program is None:
        return {1: _text(top, "DW_AT_name")}
    folder, names = _text(top, "DW_AT_comp_dir"), {}
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
    low, high = die.attributes.get("DW_AT_low_pc"), die.attributes.get("DW_AT_high_pc")
    return (low.value, high.value) if low and high else (0, 0)


def _origin(die):
    """Where a copy's name is: a function that is inlined, and what is in it, refers to the one that is written."""
    while "DW_AT_name" not in die.attributes and "DW_AT_abstract_origin" in die.attributes:
        die = die.get_DIE_from_attribute("DW_AT_abstract_origin")
    return die


def _frame(die, files: dict[int, str]) -> Frame:
    die = _origin(die)
    place = die.attributes.get("DW_AT_decl_file")
    return Frame(_text(die, "DW_AT_name"), files.get(place.value, "?") if place else "?")


def _text(die, name: str) -> str:
    value = die.attributes[name].value if name in die.attributes else b"?"
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
