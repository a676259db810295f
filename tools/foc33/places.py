"""Where things are in the project, and how a name on the command line becomes a file."""

from pathlib import Path

from .errors import UserError, suggestion

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ROOT / "tools" / "scenarios"
TABLES = SCENARIOS / "tables"
MOTORS = ROOT / "tuning" / "motors"
BOARDS = ROOT / "tuning" / "boards"
RESULTS = ROOT / "build" / "run"
TUNED = ROOT / "build" / "tune"


def find(kind: str, name: str, folder: Path, where: str = "") -> Path:
    """The TOML file for a plain name (folder/NAME.toml) or a path."""
    if "/" in name or name.endswith(".toml"):
        path = Path(name)
        if not path.is_file():
            raise UserError(f"no {kind} file '{name}'", where, "check the path")
        return path
    path = folder / f"{name}.toml"
    if not path.is_file():
        raise UserError(f"no {kind} '{name}'", where or str(shown(folder)), suggestion(name, names(folder)))
    return path


def names(folder: Path) -> list[str]:
    """Names of the TOML files in a folder."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def shown(path: Path) -> Path:
    """The path as a person in the project's root would write it."""
    try:
        return path.resolve().relative_to(ROOT)
    except ValueError:
        return path
