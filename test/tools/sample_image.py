"""Small made-up images as XC16's tools write them: ELF with debugging information, Intel HEX, the linker's map.

Four bytes of the ELF file hold a program word, two hold a byte of data, and every byte of the debugging sections is followed by a zero."""

import io
import struct
from dataclasses import dataclass, field
from pathlib import Path

import intelhex

from tools.image import device

EXECUTE, WRITE, CONST, PERSISTENT = 0x40000006, 0x1000003, 0x50000002, 0x3000003
PROGBITS, SYMTAB, STRTAB, NOTE, NOBITS = 1, 2, 3, 7, 8
START_UP, CONSTANTS, START_VALUES = 0x200, 0x8800, 0x1000
ABSOLUTE = 0xFFF1
RETFIE = 0x064000
LIBRARY = "c:/program files (x86)/microchip/xc16/v2.10/lib\\libc99-pic30-elf.a"
OBJECT = "build/target/firmware/board/isr.o"
CONFIG = "".join(f"#pragma config {line}\n" for line in (
    "FNOSC = FRC", "FCKSM = CSECMD", "POSCMD = XT", "IOL1WAY = OFF", "FWDTEN = ON", "FPWRT = PWR128", "PWMPIN = ON", "HPOL = ON",
    "LPOL = ON", "ICS = PGD3", "JTAGEN = OFF"))


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
class Section:
    """A section as it is in the file; `size` where it is not that of its content; names: symbol, address, size."""
    name: str
    address: int
    content: bytes
    flags: int = EXECUTE
    kind: int = PROGBITS
    size: int | None = None
    names: list[tuple[str, int, int]] = field(default_factory=list)


@dataclass
class Sample:
    """What goes into the files. The program begins with a GOTO to the start-up code."""
    words: dict[int, int] = field(default_factory=dict)                   # program memory and configuration words
    symbols: dict[str, int] = field(default_factory=dict)                 # in the code
    numbers: dict[str, int] = field(default_factory=lambda: {f"__{device.NAME}": 1}) # the linker's own
    constants: list[tuple] = field(default_factory=list)                  # symbol, bytes of data, words if they matter
    variables: list[tuple] = field(default_factory=list)                  # symbol, bytes, whether the linker knows the size, file
    types: dict[str, dict[str, object]] = field(default_factory=dict)     # C name of an object: members, name -> bytes or members
    functions: list[Function] = field(default_factory=list)
    lines: list[tuple[int, str, int]] = field(default_factory=list)       # address, file, line; one sequence up to `lines_end`
    lines_end: int = 0
    start_values: list[int] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)                 # more of them
    places: list[tuple[int, int, str, str]] = field(default_factory=list) # of the map: start, length, section, file
    hex_words: dict[int, int] | None = None                               # where the HEX file is another
    debug: bool = True
    machine: int = 118
    type: int = 2
    ident: bytes = b"\x7fELF\x01\x01\x01" + bytes(9)

    def __post_init__(self) -> None:
        self.words = {0: 0x040000 | START_UP, 2: 0, **self.words}

    # ---- making one ------------------------------------------------------------------------------------------------------
    def function(self, name: str, *words: int, file: str = OBJECT, section: str = ".isr.text") -> int:
        """Appends a function to the program. @return its address"""
        start = max((address for address in self.words if address in device.PROGRAM), default=START_UP - 2) + 2
        self.symbols[f"_{name}"] = start
        self.words |= {start + 2 * number: word for number, word in enumerate(words)}
        self.places.append((start, 2 * len(words), section, file))
        return start

    def constant(self, *words: int, file: str = "build/target/firmware/control/angle.o") -> None:
        """Appends words that the program reads through the window in the data space."""
        self.places.append((CONSTANTS + sum(item[1] for item in self.constants), 2 * len(words), ".const", file))
        self.constants.append((f"_constant{len(self.constants)}", 2 * len(words), words))

    def point(self, name: str, target: int) -> None:
        """Lets both vectors of this name go to an address."""
        for base in (device.IVT, device.AIVT):
            self.words[base + 2 * device.VECTORS.index(name)] = target

    # ---- its files -------------------------------------------------------------------------------------------------------
    @property
    def constant_words(self) -> list[int]:
        """Two bytes of data a word; an object of an odd length shares one with the next."""
        words = [word for _, size, *given in self.constants for word in (given[0] if given else [0] * (size // 2))]
        return words + [0] * ((sum(size for _, size, *_ in self.constants) + 1) // 2 - len(words))

    def elf(self) -> bytes:
        sections, symbols = [], [(name, value, 0, 0x10, ABSOLUTE) for name, value in self.numbers.items()]

        def add(section: Section) -> int:
            sections.append(section)
            return len(sections)

        def place(items: list[tuple], at: int, section: int) -> None:
            for name, size, known in items:
                symbols.append((name, at, size if known else 0, 0x11 if known else 0x10, section))
                at += size

        for start, words in runs(self.words):
            section = add(Section(f".text.{start:x}", start, b"".join(map(four, words))))
            symbols += [(name, at, 0, 0x12, section) for name, at in self.symbols.items() if start <= at < start + 2 * len(words)]
        if self.constants:
            place([(name, size, False) for name, size, *_ in self.constants], CONSTANTS,
                  add(Section(".const", CONSTANTS, b"".join(map(four, self.constant_words)), CONST)))
        if self.variables:
            size = 2 * sum(size for _, size, *_ in self.variables)
            place([item[:3] for item in self.variables], 0x800, add(Section(".nbss", 0x800, b"", WRITE, NOBITS, size)))
        if self.start_values:
            add(Section(".dinit", START_VALUES, b"".join(map(four, self.start_values))))
        for section in self.sections:
            number = add(section)
            symbols += [(name, at, size, 0x11, number) for name, at, size in section.names]
        if self.debug and (self.functions or self.types or any(len(item) > 3 for item in self.variables)):
            sections += [Section(name, 0, bytes(byte for pair in zip(content, bytes(len(content))) for byte in pair), 0x40000000, NOTE)
                         for name, content in _debug(self).items()]
        return self._file(sections, symbols)

    def _file(self, sections: list[Section], symbols: list[tuple]) -> bytes:
        names, table = b"\0", bytes(16)
        for name, value, size, info, section in symbols:
            table += struct.pack("<IIIBBH", len(names), value, size, info, 0, section)
            names += name.encode() + b"\0"
        texts = [section.name for section in sections] + [".symtab", ".strtab", ".shstrtab"]
        strings = b"\0" + b"".join(text.encode() + b"\0" for text in texts)
        everything = [*sections, Section(".symtab", 0, table, 0, SYMTAB), Section(".strtab", 0, names, 0, STRTAB),
                      Section("", 0, strings, 0, STRTAB)]
        body, headers = b"", bytes(40)
        for section, text in zip(everything, texts):
            symtab = section.kind == SYMTAB
            headers += struct.pack("<10I", strings.index(b"\0" + text.encode() + b"\0") + 1, section.kind, section.flags, section.address,
                                   52 + len(body), len(section.content) if section.size is None else section.size,
                                   len(sections) + 2 if symtab else 0, 1 if symtab else 0, 2, 16 if symtab else 0)
            body += section.content
        head = self.ident + struct.pack("<HHIIIIIHHHHHH", self.type, self.machine, 1, START_UP, 0, 52 + len(body), 0, 52, 32, 0, 40,
                                        len(everything) + 1, len(everything))
        return head + body + headers

    def hex(self) -> str:
        start = CONSTANTS - device.PSV_WINDOW
        constants = {start + 2 * number: word for number, word in enumerate(self.constant_words)}
        return hex_text(self.words | constants if self.hex_words is None else self.hex_words)

    def map(self) -> str:
        lines = ["Archive member included because of file (symbol)", "", "Linker script and memory map", "", f"LOAD {OBJECT}"]
        for start, length, section, file in self.places:
            place = (f"0x{start:04x}  " if start >= device.PSV_WINDOW else f"0x{start:06x}") + f"0x{length:x}".rjust(15)
            lines += [f" {section}", f"                  {place} {file}"] if len(section) > 15 else [f" {section:<17}{place} {file}"]
        return "\n".join([*lines, " .debug_info      0x000200       0x10 /lib/libpic30.a(divsf3.eo)", ""])

    def write(self, folder: Path) -> list[str]:
        """Writes the files. @return the arguments of tools.image.image"""
        (folder / "a.elf").write_bytes(self.elf())
        (folder / "a.hex").write_text(self.hex(), encoding="ascii")
        (folder / "a.map").write_text(self.map(), encoding="utf-8")
        (folder / "main.c").write_text(CONFIG, encoding="utf-8")
        return [str(folder / "a.elf"), str(folder / "a.hex"), "--map", str(folder / "a.map"), "--config", str(folder / "main.c")]


def program(*code: tuple[int, int], **fields) -> Sample:
    """An image with code of zeros: start, number of words."""
    return Sample({start + 2 * number: 0 for start, words in code for number in range(words)}, **fields)


def good_image() -> Sample:
    """One that passes every check: start-up code, the drive's handlers, both vector tables, configuration words, 300 bytes of RAM."""
    image = Sample()
    image.function("_reset", *[0] * 8, file=f"{LIBRARY}(crt0_standard.o)", section=".init")
    default = image.function("_DefaultInterrupt", 0xFE0000)
    for table in (device.IVT, device.AIVT):
        image.words |= {table + 2 * number: default for number in range(len(device.VECTORS))}
    for name in device.REQUIRED:
        image.point(name, image.function(name, 0x000000, RETFIE))
    image.function("main", 0x000000, 0x37FFFE, file="build/target/firmware/board/main.o", section=".text.main")
    image.constant(0x007FFF, 0x00A57E)
    image.words |= {0xF80000: 0xCF, 0xF80004: 0x07, 0xF80006: 0x00, 0xF80008: 0x45, 0xF8000A: 0xC4, 0xF8000C: 0xF7, 0xF8000E: 0xC1}
    take_ram(image, 300)
    return image


def take_ram(image: Sample, size: int) -> None:
    """Variables of this many bytes; the rest is for the stack."""
    image.variables = [("_ram", size, True)]
    image.numbers |= {"__SP_init": 0x800 + size, "__SPLIM_init": 0xFF0}


def runs(words: dict[int, int]) -> list[tuple[int, list[int]]]:
    """Words of consecutive addresses together; the reset vector, the tables of vectors and the program apart."""
    result: list[tuple[int, list[int]]] = []
    for address in sorted(words):
        if result and result[-1][0] + 2 * len(result[-1][1]) == address and address not in (device.IVT, device.VECTORS_END):
            result[-1][1].append(words[address])
        else:
            result.append((address, [words[address]]))
    return result


def four(word: int) -> bytes:
    return struct.pack("<I", word)


# ---- HEX -----------------------------------------------------------------------------------------------------------------
END = ":00000001FF\n"


def record(kind: int, address: int, data: bytes) -> str:
    line = bytes([len(data), address >> 8 & 0xFF, address & 0xFF, kind]) + data
    return f":{(line + bytes([-sum(line) & 0xFF])).hex().upper()}\n"


def hex_text(words: dict[int, int]) -> str:
    """Words as a HEX file."""
    file, text = intelhex.IntelHex(), io.StringIO()
    for address, word in words.items():
        file.puts(2 * address, four(word))
    file.write_hex_file(text)
    return text.getvalue()


# ---- DWARF 2 -------------------------------------------------------------------------------------------------------------
UNIT, ABSTRACT, CODE, INLINED, BASE, STRUCT, MEMBER, TYPED, PLACED = range(1, 10)
ABBREVIATIONS = {  # tag, has children, (attribute, form)...
    UNIT: (0x11, 1, (0x03, 0x08), (0x1B, 0x08), (0x10, 0x06)),
    ABSTRACT: (0x2E, 0, (0x03, 0x08), (0x3A, 0x0B), (0x3B, 0x0B), (0x20, 0x0B)),
    CODE: (0x2E, 1, (0x31, 0x13), (0x11, 0x01), (0x12, 0x01)),
    INLINED: (0x1D, 1, (0x31, 0x13), (0x11, 0x01), (0x12, 0x01)),
    BASE: (0x24, 0, (0x03, 0x08), (0x0B, 0x0B)),
    STRUCT: (0x13, 1, (0x0B, 0x0B)),
    MEMBER: (0x0D, 0, (0x03, 0x08), (0x49, 0x13)),
    TYPED: (0x34, 0, (0x03, 0x08), (0x49, 0x13)),
    PLACED: (0x34, 0, (0x03, 0x08), (0x3A, 0x0B), (0x02, 0x0A)),
}


def _debug(sample: Sample) -> dict[str, bytes]:
    files: list[str] = []

    def file(name: str) -> int:
        if name not in files:
            files.append(name)
        return files.index(name) + 1

    info = bytearray(struct.pack("<IHIB", 0, 2, 0, 4) + bytes([UNIT]) + b"all.c\0/p\0" + struct.pack("<I", 0))
    declared: dict[str, int] = {}

    def entry(kind: int, name: str, data: bytes) -> int:
        at = len(info)
        info.extend(bytes([kind]) + name.encode() + b"\0" + data)
        return at

    def declare(function: Function) -> None:
        if function.name not in declared:
            declared[function.name] = entry(ABSTRACT, function.name, bytes([file(function.file), function.line, 1]))
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
            return entry(BASE, "number", bytes([members]))
        kinds = {name: kind_of(inner) for name, inner in members.items()}
        place = len(info)
        info.extend(bytes([STRUCT, _size(members)]))
        for name, kind in kinds.items():
            entry(MEMBER, name, struct.pack("<I", kind))
        info.append(0)
        return place

    for function in sample.functions:
        declare(function)
    for function in sample.functions:
        if function.high:
            code(function, CODE)
    for name, members in sample.types.items():
        entry(TYPED, name, struct.pack("<I", kind_of(members)))
    at = 0x800
    for symbol, size, _, *written in sample.variables:
        if written:
            entry(PLACED, symbol[1:], bytes([file(written[0]), 5, 3]) + struct.pack("<I", at))
        at += size
    info.append(0)
    info[:4] = struct.pack("<I", len(info) - 4)

    steps = b"".join(b"\0\5\2" + struct.pack("<IBBB", at, 4, file(name), 3)
                     + bytes([0x80 | line - before & 0x7F, line - before >> 7 & 0x7F, 1]) # SLEB128 of a small number
                     for (at, name, line), before in zip(sample.lines, [1, *(line for _, _, line in sample.lines)]))
    if sample.lines:
        steps += b"\0\5\2" + struct.pack("<I", sample.lines_end) + b"\0\1\1"
    head = bytes([1, 1, 0xFB, 14, 10, 0, 1, 1, 1, 1, 0, 0, 0, 1]) + b"\0" + b"".join(name.encode() + b"\0\0\0\0" for name in files) + b"\0"
    line = struct.pack("<HI", 2, len(head)) + head + steps
    abbreviations = b"".join(bytes([number, tag, children]) + b"".join(bytes(pair) for pair in pairs) + b"\0\0"
                             for number, (tag, children, *pairs) in ABBREVIATIONS.items()) + b"\0"
    return {".debug_info": bytes(info), ".debug_abbrev": abbreviations, ".debug_line": struct.pack("<I", len(line)) + line}


def _size(members: object) -> int:
    return members if isinstance(members, int) else sum(_size(inner) for inner in members.values())
