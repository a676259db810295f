"""The three field-weakening tables of a motor as a file (tuning/tables/NAME.toml), and which motor values they belong to."""

import contextlib
import errno
import functools
import glob
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.common import paths
from tools.common.errors import UserError
from tools.common.param_rows import ENTRIES
from tools.common.toml_file import Document, Section

STEP_ERPM = 1024
"""One table step in electrical rpm (AN1292's SPEED_INDEX_CONST 10)."""
FOLDER = paths.ROOT / "tuning" / "tables"
FINGERPRINT = ("NOPOLESPAIRS", "MOTOR_RS_OHM", "MOTOR_LS_MH", "MOTOR_KPHI_V_PER_KRPM", "NOMINAL_BUS_V", "LOOPTIME_SEC", "DEADTIME_SEC",
               "SAMPLE_WINDOW_SEC", "MAXIMUM_CURRENT_A")
"""Parameters of userparams.h that the tables depend on."""
NEARLY = 1e-4
_quoted = functools.partial(json.dumps, ensure_ascii=False)


@dataclass(frozen=True)
class Entry:
    """One entry of the three tables: d current, 1/Kphi in AN1292's counts, Ls/(2 Ls0)."""

    idref_a: float = 0.0
    inv_kfi: float = 0.0
    ls_ratio: float = 0.5


@dataclass
class Tables:
    """A tables file. `rows` holds what was measured at each entry; `stopped` says why no further entry was found."""

    motor: str
    start_speed_rpm: float
    entries: list[Entry]
    fingerprint: dict[str, float]
    inv_kfi_base: float
    last_index: int = 0
    stopped: str = ""
    maximum_speed_rpm: float = 0.0
    goal: dict[str, float] = field(default_factory=dict)
    rows: list[dict[str, float]] = field(default_factory=list)
    path: Path | None = field(default=None, compare=False)
    """where they were read"""
    origin: str = ""
    """the header that they were imported from; "" for those that make tune-fw has found"""

    def speed_rpm(self, index: int) -> float:
        """Speed reference of an entry."""
        return self.start_speed_rpm + index * STEP_ERPM / self.fingerprint["NOPOLESPAIRS"]

    def mismatch(self, params: Mapping[str, float]) -> str:
        """"" if the tables belong to a motor with these parameters of userparams.h; otherwise the first difference."""
        for name, known in self.fingerprint.items():
            if not math.isclose(known, params[name], rel_tol=NEARLY):
                return f"they are for {name} = {known:g}, the motor has {params[name]:g}"
        now = params.get("NORM_INVKFIBASE", self.inv_kfi_base)
        if not math.isclose(self.inv_kfi_base, now, rel_tol=0.1): # it follows from the fingerprint, and from the unit of speed
            return f"they count 1/Kphi for another SPEED_UNIT (NORM_INVKFIBASE = {self.inv_kfi_base:g}, now {now:.0f})"
        return ""

    def parameters(self) -> dict[str, str]:
        """Names and values of userparams.h; an unchanged 1/Kphi is written as NORM_INVKFIBASE."""
        values = {"FW_START_SPEED_RPM": f"{self.start_speed_rpm:g}"}
        for i, entry in enumerate(self.entries):
            flat = abs(entry.inv_kfi - self.inv_kfi_base) < 0.5
            values |= {f"IDREF_SPEED{i}": f"{entry.idref_a:.2f}" if entry.idref_a else "0.00",
                       f"INVKFI_SPEED{i}": "NORM_INVKFIBASE" if flat else f"{entry.inv_kfi:.0f}",
                       f"LS_OVER2LS0_SPEED{i}": f"{entry.ls_ratio:g}"}
        return values


def fingerprint(params: Mapping[str, float]) -> dict[str, float]:
    """The values that tables found with these parameters belong to."""
    return {name: float(params[name]) for name in FINGERPRINT}


def path_of(motor: str, board: str = "") -> Path:
    """The motor's file; with a board, other than the motor's own, that for this board."""
    return FOLDER / (f"{motor}-{board}.toml" if board else f"{motor}.toml")


def load(path: Path) -> Tables:
    """Reads and checks a tables file; a wrong one is a user error with its line."""
    root = Document(path).root
    base = root.number("inv_kfi_base", minimum=1024, maximum=32767)
    columns = [root.numbers("idref_a", -20.0, 0.0), root.numbers("inv_kfi", 1024.0, 32767.0), root.numbers("ls_ratio", 0.1, 0.6)]
    for name, column in zip(("idref_a", "inv_kfi", "ls_ratio"), columns):
        if len(column) != ENTRIES:
            raise root.fail(name, f"'{name}' has {len(column)} values", f"it needs {ENTRIES}; make tune-fw writes the file anew")
    tables = Tables(root.text("motor"), root.number("start_speed_rpm", minimum=100.0, maximum=20000.0),
                    [Entry(*values) for values in zip(*columns)], {}, base, root.integer("last_index", 0, 0, ENTRIES - 1),
                    root.text("stopped", ""), root.number("maximum_speed_rpm", 0.0, 0.0), origin=root.text("from", ""))
    known, goal = root.section("fingerprint"), root.section("goal")
    if known is None:
        raise UserError("'fingerprint' is missing", root.where(), "run make tune-fw for the motor")
    tables.fingerprint = {name: known.number(name) for name in FINGERPRINT}
    known.close()
    if goal is not None:
        tables.goal = {key: goal.number(key) for key in goal.data}
    tables.rows = _rows(root.section("entries"))
    tables.path = path
    root.close()
    return tables


def _rows(measured: Section | None) -> list[dict[str, float]]:
    """What was measured at each entry: the file has a list for each quantity."""
    if measured is None:
        return []
    columns = {key: measured.numbers(key) for key in measured.data}
    for key, column in columns.items():
        if len(column) != len(next(iter(columns.values()))):
            raise measured.fail(key, f"'{key}' has {len(column)} values, the others have more or fewer", "make tune-fw writes the file anew")
    return [dict(zip(columns, values)) for values in zip(*columns.values())]


def names_of(motor: Any) -> list[str]:
    """What a motor's tables may be called: of a motor in another folder than tuning/motors its path tells it from its namesakes. Its plain name
    comes last: it is a namesake's, or older than that."""
    return list(dict.fromkeys([paths.name_of(motor.path, paths.MOTORS), motor.name]))


def load_for(names: list[str], params: Mapping[str, float], folder: Path | None = None) -> tuple[Tables | None, str]:
    """The motor's tables, those for one board or another, or None and the reason in one line ("" where there is simply no file)."""
    folder, told = folder or FOLDER, ""
    for name in names:
        for path in (folder / f"{name}.toml", *sorted(folder.glob(f"{glob.escape(name)}-*.toml"))):
            if path.is_file():
                tables = load(path)
                reason = tables.mismatch(params)
                if not reason:
                    return tables, ""
                if name == names[0] or not (paths.MOTORS / f"{name}.toml").exists(): # else they are a namesake's
                    told = told or f"{paths.shown(path)} is not used: {reason}; run make tune-fw MOTOR={tables.motor}"
    return None, told


def check_place(path: Path) -> None:
    """Refuses a place that write() could not write to: nobody wants to hear that after the search."""
    with _beside(path) as unfinished:
        unfinished.touch()
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))


def write(path: Path, tables: Tables) -> None:
    """Writes the file in one step: what is there is either the old file or the whole new one."""
    with _beside(path) as unfinished:
        unfinished.write_text(text(tables), encoding="utf-8")
        unfinished.replace(path)


@contextlib.contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """A file beside `path` that is gone in the end; what cannot be written is a user error."""
    unfinished = path.with_name(f".{path.name}-unfinished-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield unfinished
    except OSError as error:
        raise UserError(f"cannot write the tables ({error.strerror})", str(paths.shown(path)), "make the folder writable") from None
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)


def text(tables: Tables) -> str:
    """The whole file."""
    entries = tables.entries
    found = f"from {_quoted(tables.origin)} by: make import" if tables.origin else f"found on the virtual board by: make tune-fw MOTOR={tables.motor}"
    lines = [f"# Field-weakening tables of {tables.motor}, {found}",
             "# make tune puts them into the motor's userparams.h as long as the fingerprint matches the motor file.",
             f"motor = {_quoted(tables.motor)}", *([f"from = {_quoted(tables.origin)}"] if tables.origin else []), f"start_speed_rpm = {tables.start_speed_rpm:g}   # speed reference of entry 0",
             f"last_index = {tables.last_index}          # the last entry that {'the maximum speed needs' if tables.origin else 'was reached'}",
             f"stopped = {_quoted(tables.stopped)}",
             f"maximum_speed_rpm = {tables.maximum_speed_rpm:.0f}   # {'of the header' if tables.origin else 'reached without load'}",
             f"inv_kfi_base = {tables.inv_kfi_base:.0f}",
             "idref_a = " + _list(f"{entry.idref_a:.2f}" for entry in entries),
             "inv_kfi = " + _list(f"{entry.inv_kfi:.0f}" for entry in entries),
             "ls_ratio = " + _list(f"{entry.ls_ratio:g}" for entry in entries),
             "", "[fingerprint]      # parameters of userparams.h that the tables belong to"]
    lines += [f"{name} = {tables.fingerprint[name]:.6g}" for name in FINGERPRINT]
    if tables.goal:
        lines += ["", "[goal]"] + [f"{name} = {value:.6g}" for name, value in tables.goal.items()]
    if tables.rows:
        lines += ["", "[entries]          # what was measured at each entry"]
        lines += [f"{name} = " + _list(_number(row[name]) for row in tables.rows) for name in tables.rows[0] if name not in vars(Entry())]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return f"{value:.5g}" if math.isfinite(value) else "nan"


def _list(values: Any) -> str:
    return "[" + ", ".join("0.00" if value == "-0.00" else value for value in values) + "]"
