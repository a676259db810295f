"""Where things are in the project, and how a name on the command line becomes a file."""

import os
import re
import zlib
from pathlib import Path

from .errors import UserError, suggestion

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "tools" / "bench" / "scenarios"
TABLES = SCENARIOS / "tables"
MOTORS = ROOT / "tuning" / "motors"
BOARDS = ROOT / "tuning" / "boards"
RESULTS = ROOT / "build" / "run"
TUNED = ROOT / "build" / "tune"
LISTS = {"scenario": "`make scenarios`", "motor": "`make list-motors`"}
"""What lists the names of a kind."""


def find(kind: str, name: str, folder: Path, where: str = "") -> Path:
    """The TOML file for a plain name (folder/NAME.toml) or a path."""
    by_path = is_path(name)
    path = Path(name) if by_path else folder / f"{name}.toml"
    try:
        found = _file(path)
    except OSError as error:
        raise _unreadable(path.parent, error) from None
    if not found and by_path:
        raise UserError(f"no {kind} file '{name}'", where, "check the path")
    if not found:
        raise UserError(f"no {kind} '{name}'", where or str(shown(folder)), suggestion(name, names(folder), LISTS.get(kind, "")))
    return found


def _file(path: Path) -> Path | None:
    """The file of a path that may lack its .toml."""
    full = path.with_name(f"{path.name}.toml") if path.name and path.suffix != ".toml" else path
    return next((place for place in (path, full) if place.is_file()), None)


def beside(name: str, file: Path) -> tuple[str, str]:
    """What a file says of another: a name stays, a path is seen from the file's folder. One that is only there as seen from the current folder
    is taken, too; the second text then says how to write it."""
    if not is_path(name) or Path(name).is_absolute():
        return name, ""
    own = file.parent / name
    try:
        if _file(own) or not (found := _file(Path(name))):
            return str(own), ""
    except OSError: # find() tells
        return str(own), ""
    return name, f"'{name}' is found from the current folder, not from the file's: write \"{os.path.relpath(found, file.parent)}\""


def is_path(name: str) -> bool:
    """Whether a name on the command line or in a file is that of a file, not one of a folder's stems."""
    return "/" in name or name.endswith(".toml")


def names(folder: Path) -> list[str]:
    """Names of the TOML files in a folder."""
    try:
        return sorted(path.stem for path in folder.iterdir() if path.suffix == ".toml")
    except OSError as error:
        raise _unreadable(folder, error) from None


def name_of(path: Path, home: Path | None = None) -> str:
    """A name for what is made of a file or folder: its own in the project's folder `home`; elsewhere with a number, so that namesakes share
    nothing. Plain, whatever the path is."""
    path = path.resolve()
    name = path.name.removesuffix(".toml")
    plain = re.sub(r"[^A-Za-z0-9_.]+", "-", name).strip("-") or "unnamed"
    return name if home is not None and path.parent == home.resolve() and name == plain else f"{plain}-{zlib.crc32(str(path).encode()):08x}"


def pair_name(motor: Path, board: Path | None) -> str:
    """Name of a motor file, and of the board file where one was asked for: what is made of them has a folder of its own."""
    return name_of(motor, MOTORS) + (f"-{name_of(board, BOARDS)}" if board else "")


def _unreadable(folder: Path, error: OSError) -> UserError:
    return UserError(f"cannot read the folder ({error.strerror})", str(shown(folder)), "make it readable")


def shown(path: Path) -> Path:
    """The path as a person in the project's root would write it."""
    try:
        return path.resolve().relative_to(ROOT)
    except ValueError:
        return path
