"""Result folders: written under a temporary name and moved into place when complete, so that nothing half-done looks finished."""

import atexit
import contextlib
import ctypes
import errno
import fcntl
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import UserError
from .paths import ROOT
from .trace import Trace

SUMMARY = "summary.json"
LINES_AT_ONCE = 10000
AT_FDCWD, RENAME_EXCHANGE = -100, 2 # of Linux's renameat2, which Python does not have
_renameat2 = getattr(ctypes.CDLL(None), "renameat2", None)


class ResultFolder:
    """Context manager: write into `.work`; at a normal end it replaces `target`, otherwise it vanishes.

    Only an empty folder or an older result (with a summary.json) is replaced.
    """

    def __init__(self, target: Path) -> None:
        self.target = target.resolve()
        self.work = self.target

    def __enter__(self) -> "ResultFolder":
        target = self.target
        if target.exists() and not _replaceable(target):
            raise UserError(f"'{target}' is not a result folder", "--out",
                            "it holds something else; choose a new or an empty folder")
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            # The name is known before the folder is there, and atexit removes it even if a signal comes before __exit__ can.
            self.work = target.parent / f".{target.name}-unfinished-{os.getpid()}"
            atexit.register(shutil.rmtree, self.work, ignore_errors=True)
            self.work.mkdir()
        except OSError as error:
            raise _unwritable(target.parent, error, "choose a folder that can be written") from None
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if kind is not None:
            shutil.rmtree(self.work, ignore_errors=True)
            if isinstance(error, OSError):
                raise _unwritable(self.target, error, "free some space, or choose another folder") from None
            return
        try:
            self._move()
        except OSError as failure:
            shutil.rmtree(self.work, ignore_errors=True)
            raise _unwritable(self.target, failure, "choose a folder that can be written") from None

    def _move(self) -> None:
        """Who looks finds a complete result, the older or the new one; of two runs that end at once the later one's stays."""
        old = self.work.with_name(self.work.name + "-old")
        while not _exchanged(self.work, self.target):
            try:
                if self.target.exists(): # and the file system cannot exchange
                    shutil.rmtree(old, ignore_errors=True)
                    self.target.rename(old)
                self.work.rename(self.target)
                break
            except OSError as error:
                if error.errno not in (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST) or not self.work.exists():
                    raise # else another run has just moved its result there, or away
        shutil.rmtree(self.work, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


@contextlib.contextmanager
def in_turn(name: str) -> Iterator[None]:
    """Waits for another program of this tree that does the same."""
    path = ROOT / "build" / f"{name}.lock"
    try:
        path.parent.mkdir(exist_ok=True)
        lock = path.open("w", encoding="utf-8")
    except OSError as error:
        raise UserError(f"cannot write '{path}' ({error.strerror})", "", "make build/ writable") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print(f"waiting for another {name}", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _exchanged(one: Path, other: Path) -> bool:
    """Whether two folders could change places in one step."""
    return bool(_renameat2) and _renameat2(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other), RENAME_EXCHANGE) == 0


def _replaceable(folder: Path) -> bool:
    try:
        summary = folder / SUMMARY
        return summary.is_file() or not any(folder.iterdir()) or summary.is_file() # between the looks another run may have replaced it
    except FileNotFoundError: # another run is just replacing it
        return True
    except NotADirectoryError:
        return False


def _unwritable(place: Path, error: OSError, remedy: str) -> UserError:
    return UserError(f"cannot write to '{place}' ({error.strerror})", "--out", remedy)


def write_summary(folder: Path, data: dict[str, Any]) -> None:
    (folder / SUMMARY).write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def write_trace(path: Path, trace: Trace) -> None:
    """A CSV file: time and every signal, numbers with six significant digits."""
    with path.open("w", encoding="utf-8") as file:
        file.writelines(trace_lines(trace))


def trace_lines(trace: Trace) -> Iterator[str]:
    """The lines of such a file."""
    form = "%.5f," + ",".join(["%.6g"] * len(trace.names)) + "\n"
    yield ",".join(["time_s"] + trace.names) + "\n"
    for first in range(0, len(trace), LINES_AT_ONCE): # a row as Python's numbers takes ten times its room
        part = slice(first, first + LINES_AT_ONCE)
        for time, row in zip(trace.time_s[part].tolist(), trace.data[:, part].T.tolist()):
            yield form % (time, *row)


def write_csv(path: Path, header: list[str], rows: list[list[Any]]) -> None:
    lines = [",".join(_csv_cell(cell) for cell in row) for row in [header, *rows]]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _csv_cell(cell: Any) -> str:
    text = "" if cell is None else str(cell)
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\n') else text
