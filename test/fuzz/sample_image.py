"""Small ELF and Intel HEX files as XC16's tools write them, with every field in the caller's hands."""

import struct
from dataclasses import dataclass, field

GOTO_0X200 = (0x040200, 0x000000)
CONFIG = 0xF80000


@dataclass
class Section:
    name: str
    address: int
    words: list[int]
    flags: int = 6 # ALLOC, EXECINSTR
    kind: int = 1 # PROGBITS


@dataclass
class Elf:
    """An executable of `sections`; the header's fields can be changed before bytes()."""

    sections: list[Section] = field(default_factory=lambda: [
        Section(".reset", 0, list(GOTO_0X200)), Section(".text", 0x200, [0x000000, 0x37FFFF]), Section(".config_FOSC", CONFIG + 8, [0x000045])])
    symbols: list[tuple[str, int, int, int, int]] = field(default_factory=lambda: [
        ("_main", 0x200, 4, 0x12, 2), ("__33FJ32MC204", 1, 0, 0, 0xFFF1)]) # name, value, size, info, section
    machine: int = 118
    type: int = 2
    ident: bytes = b"\x7fELF\x01\x01\x01" + bytes(9)

    def bytes(self) -> bytes:
        names, offsets = b"\0", []
        all_names = ["", *(s.name for s in self.sections), ".symtab", ".strtab", ".shstrtab"]
        for name in all_names:
            offsets.append(len(names) if name else 0)
            names += name.encode() + b"\0" if name else b""
        strings = b"\0"
        symtab = bytes(16)
        for name, value, size, info, section in self.symbols:
            symtab += struct.pack("<IIIBBH", len(strings), value, size, info, 0, section)
            strings += name.encode() + b"\0"
        contents = [b"".join(struct.pack("<I", word) for word in s.words) for s in self.sections] + [symtab, strings, names]
        position = 52 + 32
        headers = [bytes(40)]
        count = len(self.sections)
        for n, data in enumerate(contents):
            kind, flags, address, link, size = 3, 0, 0, 0, 0
            if n < count:
                kind, flags, address = self.sections[n].kind, self.sections[n].flags, self.sections[n].address
            elif n == count:
                kind, link, size = 2, count + 2, 16
            headers.append(struct.pack("<10I", offsets[n + 1], kind, flags, address, position, len(data), link, 0, 2, size))
            position += len(data)
        body = b"".join(contents)
        segment = struct.pack("<8I", 1, 84, 0, 0, len(contents[0]), len(contents[0]), 5, 2)
        header = self.ident + struct.pack("<HHIIIIIHHHHHH", self.type, self.machine, 1, 0x200, 52, 84 + len(body), 0x100, 52, 32, 1, 40,
                                          len(headers), len(headers) - 1)
        return header + segment + body + b"".join(headers)


def record(kind: int, address: int, data: bytes) -> str:
    body = bytes([len(data)]) + address.to_bytes(2, "big") + bytes([kind]) + data
    return ":" + (body + bytes([-sum(body) & 0xFF])).hex()


def hex_lines(words: dict[int, int]) -> list[str]:
    """Records for {PC address: word}, without the end record."""
    lines, base = [], None
    for pc, word in sorted(words.items()):
        address = 2 * pc
        if address >> 16 != base:
            base = address >> 16
            lines.append(record(4, 0, base.to_bytes(2, "big")))
        lines.append(record(0, address & 0xFFFF, word.to_bytes(4, "little")))
    return lines


WORDS = {0: GOTO_0X200[0], 2: GOTO_0X200[1], 0x200: 0x000000, 0x202: 0x37FFFF, CONFIG + 8: 0x45}
END = ":00000001FF"


def hex_text(words: dict[int, int] | None = None) -> str:
    return "\n".join([*hex_lines(WORDS if words is None else words), END]) + "\n"
