"""A small made-up image for the tests of tools/image: words, symbols and a map, written as ELF, HEX and map files."""

import struct
from dataclasses import dataclass, field
from pathlib import Path

from tools.image import device

PROGBITS, NOBITS, SYMTAB, STRTAB = 1, 8, 2, 3
WRITE, ALLOC, EXECUTE = 1, 2, 4
RETFIE = 0x064000
START_UP = 0x200
CONFIG = """
#pragma config FNOSC = FRC
#pragma config FCKSM = CSECMD
#pragma config POSCMD = XT
#pragma config IOL1WAY = OFF
#pragma config FWDTEN = ON
#pragma config FPWRT = PWR128
#pragma config PWMPIN = ON
#pragma config HPOL = ON
#pragma config LPOL = ON
#pragma config ICS = PGD3
#pragma config JTAGEN = OFF
"""
LIBRARY = "c:/program files (x86)/microchip/xc16/v2.10/lib\\libc99-pic30-elf.a"


@dataclass
class Made:
    """An image that passes every check; a test breaks one thing of it."""

    words: dict[int, int] = field(default_factory=dict)
    symbols: dict[str, int] = field(default_factory=dict)
    places: list[tuple[int, int, str, str]] = field(default_factory=list)   # start, length, section, file
    ram_bytes: int = 300
    machine: int = 118
    parts: tuple[str, ...] = (device.NAME,)
    hex_words: dict[int, int] | None = None
    constants: set[int] = field(default_factory=set)                        # those of the words that the program reads as data

    def function(self, name: str, *words: int, file: str = "build/target/firmware/board/isr.o", section: str = ".isr.text") -> int:
        """Appends a function to the program. @return its address"""
        start = max(address for address in self.words if address in device.PROGRAM) + 2
        self.symbols[f"_{name}"] = start
        for number, word in enumerate(words):
            self.words[start + 2 * number] = word
        self.places.append((start, 2 * len(words), section, file))
        return start

    def constant(self, *words: int) -> int:
        """Appends words that the program reads through the window in the data space. @return their address"""
        start = max(address for address in self.words if address in device.PROGRAM) + 2
        for number, word in enumerate(words):
            self.words[start + 2 * number] = word
            self.constants.add(start + 2 * number)
        self.places.append((start + device.PSV_WINDOW, 2 * len(words), ".const", "build/target/firmware/control/trig.o"))
        return start

    def point(self, name: str, target: int) -> None:
        """Lets both vectors of this name go to an address."""
        for base in (device.IVT, device.AIVT):
            self.words[base + 2 * device.VECTORS.index(name)] = target

    def elf(self) -> bytes:
        absolute = {f"__{part}": 1 for part in self.parts}
        absolute |= {"__SP_init": 0x800 + self.ram_bytes, "__SPLIM_init": 0xFF0}
        stretches = runs({address: word for address, word in self.words.items() if address not in self.constants})
        sections = [(f".text{number}", PROGBITS, ALLOC | EXECUTE, start, b"".join(four(word) for word in words))
                    for number, (start, words) in enumerate(stretches)]
        indices = {address: number + 1 for number, (start, words) in enumerate(stretches) for address in range(start, start + 2 * len(words), 2)}
        strings, symbols = b"\0", bytes(16)
        for name, value in {**absolute, **self.symbols}.items():
            place = 0xFFF1 if name in absolute else indices.get(value, 0xFFF1)
            symbols += struct.pack("<IIIBBH", len(strings), value, 0, 0x12 if place != 0xFFF1 else 0x10, 0, place)
            strings += name.encode() + b"\0"
        sections += [(".const", PROGBITS, ALLOC, start + device.PSV_WINDOW, b"".join(four(word) for word in words))
                     for start, words in runs({address: self.words[address] for address in self.constants})]
        sections.append((".nbss", NOBITS, ALLOC | WRITE, 0x800, bytes(2 * self.ram_bytes)))
        sections += [(".symtab", SYMTAB, 0, 0, symbols), (".strtab", STRTAB, 0, 0, strings)]
        return whole_elf(sections, self.machine)

    def hex(self) -> str:
        return hex_text(self.words if self.hex_words is None else self.hex_words)

    def map(self) -> str:
        lines = ["Archive member included because of file (symbol)", "", "Linker script and memory map", "", "LOAD build/target/firmware/board/isr.o"]
        for start, length, section, file in self.places:
            place = (f"0x{start:04x}  " if start >= device.PSV_WINDOW else f"0x{start:06x}") + f"0x{length:x}".rjust(15)
            lines += [f" {section}", f"                  {place} {file}"] if len(section) > 15 else [f" {section:<17}{place} {file}"]
        return "\n".join([*lines, " .debug_info      0x000200       0x10 /lib/libpic30.a(divsf3.eo)", ""])

    def write(self, folder: Path) -> list[str]:
        """Writes the files. @return the arguments of tools.image.image"""
        (folder / "a.elf").write_bytes(self.elf())
        (folder / "a.hex").write_text(self.hex(), encoding="ascii")
        (folder / "a.map").write_text(self.map(), encoding="utf-8")
        (folder / "config.c").write_text(CONFIG, encoding="utf-8")
        return [str(folder / "a.elf"), str(folder / "a.hex"), "--map", str(folder / "a.map"), "--config", str(folder / "config.c")]


def made() -> Made:
    """Start-up code, the handlers the drive needs, both vector tables, the configuration words."""
    image = Made()
    image.words = {0: 0x040000 | START_UP, 2: 0}
    for number in range(8):
        image.words[START_UP + 2 * number] = 0x000000
    image.symbols = {"__reset": START_UP, "__resetPRI": START_UP}
    image.places = [(START_UP, 16, ".init", f"{LIBRARY}(crt0_standard.o)")]
    default = image.function("_DefaultInterrupt", 0xFE0000)
    for table in (device.IVT, device.AIVT):
        for number in range(len(device.VECTORS)):
            image.words[table + 2 * number] = default
    for name in device.REQUIRED:
        image.point(name, image.function(name, 0x000000, RETFIE))
    image.function("main", 0x000000, 0x37FFFE, file="build/target/firmware/board/main.o", section=".text.main")
    image.constant(0x007FFF, 0x00A57E)
    image.words |= {0xF80000: 0xCF, 0xF80004: 0x07, 0xF80006: 0x00, 0xF80008: 0x45, 0xF8000A: 0xC4, 0xF8000C: 0xF7, 0xF8000E: 0xC1}
    return image


def runs(words: dict[int, int]) -> list[tuple[int, list[int]]]:
    """Words of consecutive addresses together."""
    result: list[tuple[int, list[int]]] = []
    for address in sorted(words):
        if result and result[-1][0] + 2 * len(result[-1][1]) == address:
            result[-1][1].append(words[address])
        else:
            result.append((address, [words[address]]))
    return result


def four(word: int) -> bytes:
    return struct.pack("<I", word)


def whole_elf(sections: list[tuple[str, int, int, int, bytes]], machine: int) -> bytes:
    """An ELF file of these sections: name, type, flags, address, content. .strtab must follow .symtab."""
    sections = [("", 0, 0, 0, b""), *sections, (".shstrtab", STRTAB, 0, 0, b"")]
    names = b"".join(name.encode() + b"\0" for name, *_ in sections)
    sections[-1] = (*sections[-1][:4], names)
    body, headers, offset, name_at = b"", b"", 52, 0
    for number, (name, kind, flags, address, content) in enumerate(sections):
        in_file = b"" if kind == NOBITS else content
        link, entry = (number + 1, 16) if kind == SYMTAB else (0, 0)
        headers += struct.pack("<10I", name_at, kind, flags, address, offset, len(content), link, 1 if entry else 0, 2, entry)
        body += in_file
        offset += len(in_file)
        name_at += len(name) + 1
    ident = b"\x7fELF\x01\x01\x01" + bytes(9)
    head = struct.pack("<HHIIIIIHHHHHH", 2, machine, 1, START_UP, 0, offset, 0, 52, 0, 0, 40, len(sections), len(sections) - 1)
    return ident + head + body + headers


def record(kind: int, address: int, data: bytes) -> str:
    line = bytes([len(data), address >> 8 & 0xFF, address & 0xFF, kind]) + data
    return f":{(line + bytes([-sum(line) & 0xFF])).hex().upper()}\n"


def hex_text(words: dict[int, int]) -> str:
    """Words as a HEX file, four bytes a word."""
    text, page = "", -1
    for start, run in runs(words):
        for number in range(0, len(run), 4):
            address = 2 * start + 4 * number
            if address >> 16 != page:
                page = address >> 16
                text += record(4, 0, page.to_bytes(2, "big"))
            text += record(0, address & 0xFFFF, b"".join(four(word) for word in run[number:number + 4]))
    return text + record(1, 0, b"")
