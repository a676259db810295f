"""An image as the simulator takes it: lines of words and names (tools/cpu_33f/iss_image.h).

    python3 -m tools.image.load build/target/foc33.elf >build/target/foc33.image"""

import sys
from pathlib import Path

from tools.common import command_line
from tools.common.errors import UserError

from . import device, program


def load(path: Path) -> program.Elf:
    """A checked ELF or HEX file. A HEX file has no names; an ELF file of the same name and contents beside it lends it its own."""
    image = program.load(path)
    beside = path.with_suffix(".elf")
    if not image.names and path.suffix == ".hex" and beside.is_file():
        try:
            elf = program.load(beside)
        except UserError: # whatever it is, it is not the image that was asked for
            return image
        if elf.words == image.words:
            return elf
    return image


def text(image: program.Elf) -> str:
    """The lines; names by space, then address, functions before other names of the same address."""
    lines = [f"word {address:x} {word:x}" for address, word in sorted(image.words.items())]
    names = []
    for symbol in image.names:
        if symbol.section is None or symbol.local:
            continue
        section = symbol.section
        data = section.memory == program.DATA or section.memory == program.CONSTANTS and symbol.address >= device.PSV_WINDOW
        space = "persistent" if section.persistent else "data" if data else "code"
        names.append((data, symbol.address, not symbol.function, symbol.name, f"{space} {symbol.address:x} {symbol.size:x} {symbol.name}"))
    return "\n".join([*lines, *(line for *_, line in sorted(names)), ""])


if __name__ == "__main__":
    sys.exit(command_line.on_files("tools.image.load", lambda path: sys.stdout.write(text(load(path))), "an ELF or HEX file"))
