"""Names 32-bit types in the debugging information of a PC's ELF file as the chip's compiler does: there, int has 16 bits. Clients of the serial
line go by the names.

    python3 -m tools.live.chip_types build/host/foc33.elf"""

import sys
from pathlib import Path

from tools.common import command_line
from tools.common.errors import UserError
from tools.image.program import contents, reading

from .symbols import dwarf_of

NAMES = {"int": "long int", "unsigned int": "long unsigned int"}
BYTES, WHERE = 4, ("DW_AT_byte_size", "DW_AT_encoding", "DW_AT_name")
INLINE, POINTER = "DW_FORM_string", "DW_FORM_strp"


def rename(path: Path) -> int:
    """Changes the file in place; returns how many types have a new name. No byte moves: a name of three letters stands in the entry itself, which is as
    long as an offset to a longer name."""
    data = bytearray(contents("ELF", path))
    changed = 0
    with reading("ELF", path):
        dwarf = dwarf_of(path)
        info, texts = dwarf.debug_info_sec, dwarf.debug_str_sec
        strings = bytes(data[texts.global_offset:texts.global_offset + texts.size])
        offsets = {new: _offset(strings, new) for new in NAMES.values()}
        for unit in dwarf.iter_CUs():
            types = [die for die in unit.iter_DIEs() if die.tag == "DW_TAG_base_type" and tuple(die.attributes) == WHERE]
            longer = next((die.abbrev_code for die in types if die.attributes["DW_AT_name"].form == POINTER), None)
            for die in types:
                name = die.attributes["DW_AT_name"]
                new = NAMES.get(name.value.decode())
                if new is None or longer is None or die.attributes["DW_AT_byte_size"].value != BYTES: # a unit with int alone has no variable of it
                    continue
                room = die.attributes["DW_AT_byte_size"].offset - die.offset
                if longer >> 7 * room or name.form == INLINE and len(name.value) != 3:
                    raise UserError("a type cannot be renamed", str(path), "compile with another version of gcc")
                data[info.global_offset + die.offset:info.global_offset + die.offset + room] = leb128(longer, room)
                at = info.global_offset + name.offset
                data[at:at + 4] = offsets[new].to_bytes(4, "little")
                changed += 1
    path.write_bytes(data)
    return changed


def leb128(value: int, size: int) -> bytes:
    """A number of DWARF with a size of its own: more bytes than it needs are as good."""
    return bytes(value >> 7 * n & 0x7F | (0x80 if n < size - 1 else 0) for n in range(size))


def _offset(strings: bytes, text: str) -> int:
    """Where a text begins among those of the file; the end of a longer one will do."""
    at = strings.find(text.encode() + b"\0")
    if at < 0:
        raise UserError(f"no name '{text}'", "debugging information", "compile with another version of gcc")
    return at


if __name__ == "__main__":
    sys.exit(command_line.on_files("tools.live.chip_types", rename, "an ELF file"))
