"""The firmware's variables inside a running virtual board, byte by byte, as a hit by radiation finds them."""

import ctypes
import re
import subprocess
from dataclasses import dataclass

from tools.common import paths
from tools.common.errors import UserError

from .board import Library

DRIVE = "board_drive"


@dataclass(frozen=True)
class Variable:
    """A writable object of the firmware; `offset` from DRIVE's address."""

    name: str
    offset: int
    size: int


def variables(library: Library) -> list[Variable]:
    """Every writable variable of the firmware that the library was linked from, DRIVE first."""
    folder = library.path.parent
    try:
        names = (folder / "contents").read_text(encoding="utf-8").split()
    except OSError as error:
        raise UserError(f"cannot read what the library was linked from ({error.strerror})", str(paths.shown(folder / "contents")), "make vboard") from None
    objects = [name for name in names if "/firmware/" in name and not name.endswith("/main.o")]
    written = {(name, size) for name, size, _ in _symbols(*objects)}
    found = {name: Variable(name, at, size) for name, size, at in _symbols(str(library.path)) if (name, size) in written}
    if DRIVE not in found:
        raise UserError(f"the firmware has no variable '{DRIVE}'", str(paths.shown(library.path)), "rebuild with make vboard")
    base = found[DRIVE].offset
    return sorted((Variable(item.name, item.offset - base, item.size) for item in found.values()), key=lambda item: (item.name != DRIVE, item.name))


def _symbols(*files: str) -> list[tuple[str, int, int]]:
    """Name, size and address of what can be written."""
    done = subprocess.run(["nm", "-S", "--defined-only", *files], cwd=paths.ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UserError("nm cannot list the firmware's variables", files[0], (done.stderr.splitlines() or ["install binutils"])[0])
    rows = re.findall(r"^([0-9a-f]+) ([0-9a-f]+) [bBdD] (\S+)$", done.stdout, re.MULTILINE)
    return [(name, int(size, 16), int(at, 16)) for at, size, name in rows]


def flip(library: Library, area: list[Variable], share: float) -> str:
    """Turns the bit at this share, 0..1, of all bits of the area; returns its name."""
    total = sum(item.size for item in area)
    bit = min(int(share * 8 * total), 8 * total - 1)
    at, number = divmod(bit, 8)
    for item in area:
        if at < item.size:
            break
        at -= item.size
    base = ctypes.addressof(ctypes.c_uint8.in_dll(library.c, DRIVE))
    place = ctypes.c_uint8.from_address(base + item.offset + at)
    place.value ^= 1 << number
    return f"{item.name}+{at} bit {number}"
