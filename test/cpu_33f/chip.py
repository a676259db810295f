"""A virtual board around a program of a few lines: assembled, put into an Intel HEX file, run."""

import os
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "tools")]

import asm33 # noqa: E402
from sample_image import hex_text # noqa: E402
from tools.bench.pil import PilBoard, PilLibrary # noqa: E402

RAM = 0x0800
FOSC_CRYSTAL = 0x41 # clock switching allowed, crystal XT
CONFIG = {"FOSCSEL": 0x00, "FOSC": FOSC_CRYSTAL, "FWDT": 0x5F, "FPOR": 0xF7, "FICD": 0xC1}
CONFIG_ADDRESS = {"FOSCSEL": 0xF80006, "FOSC": 0xF80008, "FWDT": 0xF8000A, "FPOR": 0xF8000C, "FICD": 0xF8000E}
FRC_FCY = 7.37e6 / 2

library = PilLibrary(Path(os.environ.get("PIL_LIBRARY", ROOT / "build/host/libpil.so")))


def _registers() -> dict[str, int]:
    text = (ROOT / "tools/chip/chip_registers.h").read_text()
    return {name.lower(): int(address, 16) for name, address in re.findall(r"X\((\w+), (0x\w+), 0x\w+\)", text)}


REGISTERS = _registers()


# The unlock sequence of OSCCON's low byte, and a value for it.
UNLOCK = "mov #0x742, w1; mov #0x46, w2; mov #0x57, w3; mov #{value}, w0; mov.b w2, [w1]; mov.b w3, [w1]; mov.b w0, [w1]\n"


def switch(source: int) -> str:
    """OSCCON's two unlock sequences: NOSC, then OSWEN."""
    return UNLOCK.replace("0x742", "0x743").replace("0x46", "0x78").replace("0x57", "0x9A").format(value=source) + UNLOCK.format(value=1)


PLL = "mov #38, w0; mov w0, pllfbd; clr clkdiv\n" + switch(3) + """
pll_wait:
    btss osccon, #5
    bra pll_wait
"""
"""The crystal with the PLL at 40 MIPS."""

STOP = "stop: bra stop"


def image(program: str, **config: int) -> Path:
    """The HEX file of a program that starts at 0x200; vectors and other code by ".org"."""
    words, _ = asm33.assemble(program, 0x200, REGISTERS)
    words = {0: 0x040200, 2: 0x000000} | words | {CONFIG_ADDRESS[name]: value for name, value in (CONFIG | config).items()}
    folder = Path(tempfile.mkdtemp())
    path = folder / "program.hex"
    path.write_text(hex_text(words))
    return path


def board(program: str, **config: int) -> PilBoard:
    """A board that has just been switched on with this program."""
    path = image(program, **config)
    result = PilBoard(library, path)
    path.unlink()
    path.parent.rmdir()
    result.power_up()
    return result


def run(program: str, ms: float = 5.0, **config: int) -> PilBoard:
    """The same after some time."""
    result = board(program, **config)
    pass_ms(result, ms)
    return result


def pass_ms(chip: PilBoard, ms: float) -> None:
    end_s = chip.get("time_s") + ms * 1e-3
    while chip.get("time_s") < end_s - 1e-9:
        chip.run(1)
