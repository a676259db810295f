"""The ELF file of an image with its debugging information as other programs expect it: XC16 stores a byte of it in every second byte of the file.

    python3 -m tools.live.plain_elf build/target/foc33.elf build/target/foc33.client.elf"""

import struct
import sys
from io import BytesIO
from pathlib import Path

from tools.common import command_line
from tools.common.errors import UserError
from tools.image.program import contents, reading

try:
    from elftools.elf.elffile import ELFFile
except ImportError:
    pass # program.reading() says so

SIZE_AT = 20
"""Of sh_size in a section's header."""


def write(image: Path, path: Path) -> Path:
    """Writes the file; returns its path."""
    data = bytearray(contents("ELF", image))
    with reading("ELF", image):
        elf = ELFFile(BytesIO(bytes(data)))
        for number, section in enumerate(elf.iter_sections()):
            if section.name.startswith(".debug_"):
                plain = section.data()[::2]
                at = section["sh_offset"]
                data[at:at + len(plain)] = plain
                struct.pack_into("<I", data, elf["e_shoff"] + number * elf["e_shentsize"] + SIZE_AT, len(plain))
    try:
        path.write_bytes(data)
    except OSError as error:
        raise UserError(f"cannot write the file ({error.strerror})", str(path), "name another one") from None
    return path


if __name__ == "__main__":
    sys.exit(command_line.on_files("tools.live.plain_elf", write, "an image", "the file to write"))
