"""Writes the flash's CRC, which the firmware's self-test compares, into a linked program: `make firmware` does it before the HEX file is made.

    python3 -m tools.image.crc foc33.elf

CRC-16 of CCITT over every word before its place, low byte first; erased words count as they are. The place is the last two words of the flash, or
with PARAMS_KEPT those before the pages of the kept parameters: CRC and complement. A program without self-tests stays as it is."""

import argparse
import binascii
import sys
from io import BytesIO
from pathlib import Path

from tools.common import command_line
from tools.common.errors import UserError

from . import device
from .program import REMEDY, Elf, Words, contents, read_elf

try:
    import elftools.elf.elffile
except ImportError:
    pass # program.py says so

PLACE = device.FLASH[-2]            # BOARD_FLASH_CRC_AT of include/board/selftest_cpu.h
PLACE_KEPT = device.KEPT[0] - 4     # with PARAMS_KEPT
SELF_TESTS, VARIABLE, KEPT = "board_selftest_failed", "board_flash_crc", "board_kept_pages"
START = 0xFFFF


def crc(words: Words, end: int = PLACE) -> int:
    """Of all words before an address."""
    data = b"".join(words.get(address, device.ERASED).to_bytes(3, "little") for address in range(0, end, 2))
    return binascii.crc_hqx(data, START)


def expected(words: Words, at: int = PLACE) -> tuple[int, int]:
    """The two words at the CRC's place."""
    return crc(words, at), crc(words, at) ^ 0xFFFF


def keeps_parameters(elf: Elf) -> bool:
    """True of a program built with PARAMS_KEPT."""
    return any(symbol.name == KEPT for symbol in elf.names)


def place_in(elf: Elf) -> int:
    """The CRC's place in this program."""
    return PLACE_KEPT if keeps_parameters(elf) else PLACE


def has_self_tests(elf: Elf) -> bool:
    return any(symbol.name == SELF_TESTS for symbol in elf.names)


def place(path: Path) -> bool:
    """Writes the two words into the file. @return whether the program has self-tests."""
    elf = read_elf(path)
    if not has_self_tests(elf):
        return False
    at = place_in(elf)
    data = bytearray(contents("ELF", path))
    for section in elftools.elf.elffile.ELFFile(BytesIO(bytes(data))).iter_sections():
        if section["sh_type"] == "SHT_PROGBITS" and section["sh_addr"] == at and section["sh_size"] == 8 and section["sh_flags"] & 4:
            start = section["sh_offset"]
            for offset, word in enumerate(expected(elf.words, at)):
                data[start + 4 * offset:start + 4 * offset + 4] = word.to_bytes(4, "little")
            path.write_bytes(data)
            return True
    raise UserError(f"no place for the flash's CRC: {VARIABLE} is not at 0x{at:04X}", str(path), REMEDY)


def check(words: Words, elf: Elf) -> list[str]:
    """A line if the program has self-tests and its CRC is not right; and one if it has anything in the pages of the kept parameters."""
    filled = [address for address in words if address in device.KEPT] if keeps_parameters(elf) else []
    if filled:
        return [f"word 0x{filled[0]:04X} is in the pages of the kept parameters (0x{device.KEPT[0]:04X} .. 0x{device.KEPT[-1]:04X}), which must stay erased"]
    if not has_self_tests(elf):
        return []
    at = place_in(elf)
    wanted = expected(words, at)
    found = (words.get(at, device.ERASED), words.get(at + 2, device.ERASED))
    if found == wanted:
        return []
    return [f"flash's CRC at 0x{at:04X}: 0x{found[0]:06X} 0x{found[1]:06X}, must be 0x{wanted[0]:06X} 0x{wanted[1]:06X}: {REMEDY}"]


def main(arguments: list[str] | None = None) -> int:
    parser = command_line.Parser(prog="python3 -m tools.image.crc", description=__doc__.splitlines()[0])
    parser.add_argument("elf", type=Path)

    def write() -> int:
        place(parser.parse_args(arguments).elf)
        return 0
    return command_line.run(write)


if __name__ == "__main__":
    sys.exit(main())
