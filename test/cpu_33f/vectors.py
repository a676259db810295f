"""Reads the hand-derived vectors of test/cpu_33f/vectors. A line, columns between bars, numbers hexadecimal (cycles decimal):

    program | before | after | flags | cycles     # comment

program   instructions between semicolons, "label:" before them; it stands at 0200
before    name=value: w0..w15, [address]=word in data memory, p[address]=word in program memory, a and b (accumulators), names of
          status bits (oa, sab, ...), ipl, names of core registers (corcon, splim, ...). What is not named has a pattern of its own,
          status bits 0, corcon 0020
after     the same for what changes; "?" for what is left open, pc=label for where it ends. All else must be as before
flags     C Z N OV DC after, or "before > after": 0, 1, "." any before (tried with both) or kept after, "?" left open. Empty: kept
cycles    1 if left away
"""

import re
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parent / "vectors"
FLAGS = ("C", "Z", "N", "OV", "DC")
REGISTERS = {
    "splim": 0x20, "tblpag": 0x32, "psvpag": 0x34, "rcount": 0x36, "dcount": 0x38, "dostart": 0x3A, "doend": 0x3E, "corcon": 0x44,
    "modcon": 0x46, "xmodsrt": 0x48, "xmodend": 0x4A, "ymodsrt": 0x4C, "ymodend": 0x4E, "xbrev": 0x50, "disicnt": 0x52,
}
STATUS = {"oa", "ob", "sa", "sb", "oab", "sab", "da", "ra", "ipl"}
NAME = re.compile(r"w\d+|\[[0-9a-f]+\]|p\[[0-9a-f]+\]|[ab]|pc|\w+")


@dataclass
class Vector:
    """One line of a vector file."""

    place: str
    group: str
    program: str
    before: dict[str, int]
    after: dict[str, int | str | None]
    flags_before: str
    flags_after: str
    cycles: int

    def __str__(self) -> str:
        return f"{self.place}: {self.program}"


def _assignments(text: str, place: str) -> dict[str, int | str | None]:
    result: dict[str, int | str | None] = {}
    for part in text.lower().split():
        name, equals, value = part.partition("=")
        if not equals or not NAME.fullmatch(name):
            raise ValueError(f"{place}: {part} is no assignment")
        if name[0] not in "w[p" and name not in ("a", "b", *STATUS, *REGISTERS) and not name.startswith("p["):
            raise ValueError(f"{place}: {name} is not known")
        if value == "?":
            result[name] = None
        elif name == "pc" and not re.fullmatch(r"[0-9a-f]{4,}", value):
            result[name] = value
        else:
            result[name] = int(value, 16)
    return result


def read(path: Path) -> list[Vector]:
    """All vectors of a file."""
    vectors = []
    group = ""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        place = f"{path.name}:{number}"
        if line.startswith("=="):
            group = line.strip("= ").split(":")[0]
        text = re.split(r"(?:^|\s)# ", line)[0].strip()
        if not text or text.startswith(("#", "==")):
            continue
        columns = [column.strip() for column in text.split("|")] + [""] * 4
        flags = columns[3].split(">")
        after = flags[-1].strip() or "....."
        before = flags[0].strip() if len(flags) == 2 else "....."
        if len(before) != 5 or len(after) != 5:
            raise ValueError(f"{place}: flags are C Z N OV DC")
        vectors.append(Vector(place, group, columns[0], _assignments(columns[1], place), _assignments(columns[2], place), before, after,
                              int(columns[4] or 1)))
    return vectors


def read_all() -> list[Vector]:
    """The vectors of all files."""
    return [vector for path in sorted(FOLDER.glob("*.txt")) for vector in read(path)]
