"""Writes small ELF files as XC16's linker does: four bytes a program word, every byte of the debugging sections followed by a zero."""

import struct
from dataclasses import dataclass, field
from pathlib import Path

EXECUTE, WRITE, CONST = 0x40000006, 0x1000003, 0x50000002
PROGBITS, NOTE, NOBITS, SYMTAB, STRTAB = 1, 7, 8, 2, 3


@dataclass
class Function:
    """A function, or one inlined into another: where it is written and where its code is. `low` 0: only declared."""
    name: str
    file: str
    line: int
    low: int = 0
    high: int = 0
    inside: list["Function"] = field(default_factory=list)


@dataclass
class Program:
    """What goes into the file."""
    code: list[tuple[int, int]] = field(default_factory=list)             # start, words
    functions: list[Function] = field(default_factory=list)
    declared: list[Function] = field(default_factory=list)                # for names by line
    lines: list[tuple[int, str, int]] = field(default_factory=list)       # address, file, line; one sequence up to `lines_end`
    lines_end: int = 0
    labels: list[tuple[str, int]] = field(default_factory=list)           # in the code: symbol, address
    constants: list[tuple[str, int]] = field(default_factory=list)        # symbol, bytes
    variables: list[tuple[str, int, bool]] = field(default_factory=list)  # symbol, bytes, whether the linker knows the size
    types: dict[str, dict[str, object]] = field(default_factory=dict)     # C name of a variable: members, name -> bytes or members
    start_values: list[int] = field(default_factory=list)
    vectors: list[int] = field(default_factory=list)
    debug: bool = True
    machine: int = 118

    def write(self, path: Path) -> Path:
        path.write_bytes(self.bytes())
        return path

    def bytes(self) -> bytes:
        sections: list[tuple[str, int, int, int, bytes, int]] = [] # name, kind, flags, address, content, size
        symbols: list[tuple[str, int, int, int, int]] = []         # name, value, size, type, section

        def add(name: str, kind: int, flags: int, address: int, content: bytes, size: int | None = None) -> int:
            sections.append((name, kind, flags, address, content, len(content) if size is None else size))
            return len(sections)

        add(".reset", PROGBITS, EXECUTE, 0, bytes([0, 2, 4, 0, 0, 0, 0, 0])) # goto 0x200
        for number, target in enumerate(self.vectors):
            add(f".ivt.{number}", PROGBITS, EXECUTE, 4 + 2 * number, target.to_bytes(4, "little"))
        for start, words in self.code:
            section = add(f".text.{start:x}", PROGBITS, EXECUTE, start, bytes(4 * words))
            symbols += [(name, at, 0, 0, section) for name, at in self.labels if start <= at < start + 2 * words]
        if self.constants:
            total = sum(size for _, size in self.constants)
            section = add(".const", PROGBITS, CONST, 0x8800, bytes((total + 1) // 2 * 4), total // 2 * 4 + total % 2 * 2)
            at = 0x8800
            for name, size in self.constants:
                symbols.append((name, at, 0, 0, section))
                at += size
        if self.variables:
            section = add(".nbss", NOBITS, WRITE, 0x800, b"", 2 * sum(size for _, size, _ in self.variables))
            at = 0x800
            for name, size, known in self.variables:
                symbols.append((name, at, size if known else 0, 1 if known else 0, section))
                at += size
        if self.start_values:
            add(".dinit", PROGBITS, EXECUTE, 0x1000, b"".join(word.to_bytes(4, "little") for word in self.start_values))
        if self.debug:
            for name, content in _debug(self).items():
                add(name, NOTE, 0x40000000, 0, bytes(byte for pair in zip(content, bytes(len(content))) for byte in pair))
        return _elf(sections, symbols, self.machine)


def _elf(sections, symbols, machine: int) -> bytes:
    names, table = b"\0", b"\0"
    entries = bytes(16)
    for name, value, size, kind, section in symbols:
        entries += struct.pack("<IIIBBH", len(names), value, size, kind, 0, section)
        names += name.encode() + b"\0"
    link = len(sections) + 2
    everything = [*sections, (".symtab", SYMTAB, 0, 0, entries, len(entries)), (".strtab", STRTAB, 0, 0, names, len(names)),
                  (".shstrtab", STRTAB, 0, 0, b"", 0)]
    body, headers = b"", bytes(40)
    for index, (name, kind, flags, address, content, size) in enumerate(everything, 1):
        place = len(table)
        table += name.encode() + b"\0"
        if name == ".shstrtab":
            content, size = table, len(table)
        headers += struct.pack("<10I", place, kind, flags, address, 52 + len(body), size, link if kind == SYMTAB else 0,
                               1 if kind == SYMTAB else 0, 2, 16 if kind == SYMTAB else 0)
        body += content
    head = b"\x7fELF\x01\x01\x01" + bytes(9) + struct.pack("<HHIIIIIHHHHHH", 2, machine, 1, 0x200, 0, 52 + len(body), 256, 52, 32, 0, 40,
                                                          len(everything) + 1, len(everything))
    return head + body + headers


# ---- DWARF 2 -------------------------------------------------------------------------------------------------------------
UNIT, ABSTRACT, CODE, INLINED, BASE, STRUCT, MEMBER, VARIABLE = range(1, 9)
ABBREVIATIONS = {  # tag, has children, (attribute, form)...
    UNIT: (0x11, 1, (0x03, 0x08), (0x1B, 0x08), (0x10, 0x06)),
    ABSTRACT: (0x2E, 0, (0x03, 0x08), (0x3A, 0x0B), (0x3B, 0x0B), (0x20, 0x0B)),
    CODE: (0x2E, 1, (0x31, 0x13), (0x11, 0x01), (0x12, 0x01)),
    INLINED: (0x1D, 1, (0x31, 0x13), (0x11, 0x01), (0x12, 0x01)),
    BASE: (0x24, 0, (0x03, 0x08), (0x0B, 0x0B)),
    STRUCT: (0x13, 1, (0x0B, 0x0B)),
    MEMBER: (0x0D, 0, (0x03, 0x08), (0x49, 0x13)),
    VARIABLE: (0x34, 0, (0x03, 0x08), (0x49, 0x13)),
}


def _debug(program: Program) -> dict[str, bytes]:
    files: list[str] = []

    def file(name: str) -> int:
        if name not in files:
            files.append(name)
        return files.index(name) + 1

    info = bytearray(struct.pack("<IHIB", 0, 2, 0, 4) + bytes([UNIT]) + b"all.c\0/p\0" + struct.pack("<I", 0))
    declared: dict[str, int] = {}

    def declare(function: Function) -> None:
        if function.name not in declared:
            declared[function.name] = len(info)
            info.extend(bytes([ABSTRACT]) + function.name.encode() + b"\0" + bytes([file(function.file), function.line, 1]))
        for inner in function.inside:
            declare(inner)

    def code(function: Function, kind: int) -> None:
        info.extend(bytes([kind]) + struct.pack("<III", declared[function.name], function.low, function.high))
        for inner in function.inside:
            code(inner, INLINED)
        info.append(0)

    def kind_of(members: object) -> int:
        """A type's place: bytes of a number, or a structure."""
        if isinstance(members, int):
            place = len(info)
            info.extend(bytes([BASE]) + b"number\0" + bytes([members]))
            return place
        kinds = {name: kind_of(inner) for name, inner in members.items()}
        place = len(info)
        info.extend(bytes([STRUCT, _size(members)]))
        for name, kind in kinds.items():
            info.extend(bytes([MEMBER]) + name.encode() + b"\0" + struct.pack("<I", kind))
        info.append(0)
        return place

    for function in [*program.functions, *program.declared]:
        declare(function)
    for function in program.functions:
        code(function, CODE)
    for name, members in program.types.items():
        kind = kind_of(members)
        info.extend(bytes([VARIABLE]) + name.encode() + b"\0" + struct.pack("<I", kind))
    info.append(0)
    info[:4] = struct.pack("<I", len(info) - 4)

    steps = b"".join(b"\0\5\2" + struct.pack("<I", at) + b"\4" + bytes([file(name)]) + b"\3" + _signed(line - before) + b"\1"
                     for (at, name, line), before in zip(program.lines, [1, *(line for _, _, line in program.lines)]))
    if program.lines:
        steps += b"\0\5\2" + struct.pack("<I", program.lines_end) + b"\0\1\1"
    head = bytes([1, 1, 0xFB, 14, 10, 0, 1, 1, 1, 1, 0, 0, 0, 1]) + b"\0" + b"".join(name.encode() + b"\0\0\0\0" for name in files) + b"\0"
    line = struct.pack("<HI", 2, len(head)) + head + steps
    abbreviations = b"".join(bytes([number, tag, children]) + b"".join(bytes(pair) for pair in pairs) + b"\0\0"
                             for number, (tag, children, *pairs) in ABBREVIATIONS.items()) + b"\0"
    return {".debug_info": bytes(info), ".debug_abbrev": abbreviations, ".debug_line": struct.pack("<I", len(line)) + line}


def _size(members: object) -> int:
    return members if isinstance(members, int) else sum(_size(inner) for inner in members.values())


def _signed(value: int) -> bytes:
    """SLEB128 of a small number."""
    return bytes([0x80 | value & 0x7F, value >> 7 & 0x7F])
