"""Which firmware a figure was measured on: a checksum of all code that it depends on, without comments and white space."""

import hashlib
import re
from pathlib import Path

from .paths import ROOT

FIRMWARE = ("firmware", "include", "userparams.h")
BOARD = tuple(f"tools/{room}" for room in ("plant", "chip", "vboard", "cpu_host"))
PARTS = {"image": FIRMWARE, "pc": FIRMWARE + BOARD, "chip": (*FIRMWARE, *BOARD, "tools/cpu_33f")}
"""The image; the PC library and the virtual board; the image on the simulated chip of that board."""
IMAGE_FLAGS = "tools/make/image.mk", r"(?m)^(?:OPT|target_(?:flags|whole|link_options|device)) .*$"
TOKEN = re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|[\w.]+|<<=|>>=|->|\+\+|--|<<|>>|&&|\|\||[-+*/%&|^<>=!]=|\S')
COMMENT = re.compile(r'/\*.*?\*/|//[^\n]*|("(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\')', re.DOTALL)


def tokens(code: str) -> list[str]:
    """What a compiler reads in C code; of a directive the line, whose blanks have a meaning."""
    code = COMMENT.sub(lambda found: found[1] or " ", code.replace("\r", "").replace("\\\n", " "))
    found: list[str] = []
    for line in code.splitlines():
        words = TOKEN.findall(line)
        found += [" ".join(line.split()) + "\n"] if words[:1] == ["#"] else words
    return found


def files(kind: str, root: Path = ROOT) -> list[Path]:
    """The sources that count."""
    return sorted(path for name in PARTS[kind] for path in ([root / name] if (root / name).is_file() else (root / name).rglob("*.[chS]")))


def checksum(kind: str, root: Path = ROOT) -> str:
    """@param kind of PARTS"""
    found = hashlib.sha256()
    for path in files(kind, root):
        found.update("\0".join([path.relative_to(root).as_posix(), *tokens(path.read_text(encoding="utf-8")), ""]).encode())
    if kind != "pc":
        name, pattern = IMAGE_FLAGS
        found.update("\n".join(re.findall(pattern, (root / name).read_text(encoding="utf-8"))).encode())
    return found.hexdigest()[:8]
