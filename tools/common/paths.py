"""Where things are in the project, and how a name on the command line becomes a file."""

from pathlib import Path

from .errors import UserError, suggestion

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "tools" / "bench" / "scenarios"
TABLES = SCENARIOS / "tables"
MOTORS = ROOT / "tuning" / "motors"
BOARDS = ROOT / "tuning" / "boards"
RESULTS = ROOT / "build" / "run"
TUNED = ROOT / "build" / "tune"


def find(kind: str, name: str, folder: Path, where: str = "") -> Path:
    """The TOML file for a plain name (folder/NAME.toml) or a path."""
    by_path = is_path(name)
    path = Path(name) if by_path else folder / f"{name}.toml"
    try:
        found = path.is_file()
    except OSError as error:
        raise _unreadable(path.parent, error) from None
    if not found and by_path:
        raise UserError(f"no {kind} file '{name}'", where, "check the path")
    if not found:
        raise UserError(f"no {kind} '{name}'", where or str(shown(folder)), suggestion(name, names(folder)))
    return path


def is_path(name: str) -> bool:
    """Whether a name on the command line or in a file is that of a file, not one of a folder's stems."""
    return "/" in name or name.endswith(".toml")


def names(folder: Path) -> list[str]:
    """Names of the TOML files in a folder."""
    try:
        return sorted(path.stem for path in folder.iterdir() if path.suffix == ".toml")
    except OSError as error:
        raise _unreadable(folder, error) from None


def _unreadable(folder: Path, error: OSError) -> UserError:
    return UserError(f"cannot read the folder ({error.strerror})", str(shown(folder)), "make it readable")


def shown(path: Path) -> Path:
    """The path as a person in the project's root would write it."""
    try:
        return path.resolve().relative_to(ROOT)
    except ValueError:
        return path
