"""How far a long step is: a bar on a terminal, elsewhere a line now and then. What is over within seconds says nothing.

    python3 -m tools.common.progress TITLE COMMAND...   runs a command that is silent for long, and says that it still runs

The environment variable FOC33_QUIET switches all of it off."""

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from . import command_line
from .errors import UserError

FIRST_S, EVERY_S = 3.0, 10.0
"""Where nobody looks: the first line so long after the program's start, and the next ones."""
BEAT_S = 0.5


class Progress:
    """Counts up to `total` of a unit; without a total only time passes. Call it with what has been done since the last call."""

    next_s = time.monotonic() + FIRST_S
    """When the next line is due; one clock for all steps of a program, for short ones add up."""

    def __init__(self, title: str, total: float | None, quiet: bool = False, unit: str = "s of motor time") -> None:
        self.title, self.total, self.unit = title, total, unit
        self.done = 0.0
        self.begin_s = time.monotonic()
        self.silent = quiet or bool(os.environ.get("FOC33_QUIET"))
        self.bar: Any = None if self.silent else self._bar()

    def _bar(self) -> Any:
        if not sys.stderr.isatty():
            return None
        try:
            from tqdm import tqdm
        except ImportError:
            return None
        tqdm.monitor_interval = 0 # no thread of its own: the simulations fork
        form = "{desc} {elapsed}" if self.total is None else "{desc} {percentage:3.0f}% |{bar}| {n:.4g}/{total:.4g} " + self.unit
        return tqdm(total=self.total, desc=self.title, leave=False, ncols=90, bar_format=form)

    def __call__(self, more: float = 0.0) -> None:
        """So much more is done."""
        self.reach(self.done + more)

    def reach(self, done: float, title: str = "") -> None:
        """So much is done, and what is being done now may have another name."""
        self.done = done if self.total is None else min(done, self.total)
        self.title = title or self.title
        if self.bar is not None:
            self.bar.n = self.done
            self.bar.set_description_str(self.title, refresh=False)
            self.bar.refresh() if self.total is None else self.bar.update(0)
        elif not self.silent and time.monotonic() >= Progress.next_s:
            Progress.next_s = time.monotonic() + EVERY_S
            print(f"  {self.line()}", file=sys.stderr, flush=True)

    def line(self) -> str:
        """Where the step is, as one line."""
        if not self.total:
            return f"{self.title}: {time.monotonic() - self.begin_s:.0f} s"
        return f"{self.title}: {100.0 * self.done / self.total:.0f} %, {self.done:.4g} of {self.total:.4g} {self.unit}"

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *error: Any) -> None:
        if self.bar is not None:
            self.bar.close()


@contextlib.contextmanager
def waiting(title: str, quiet: bool = False) -> Iterator[None]:
    """For a step that cannot tell how far it is: how long it has taken. Not around what forks, for a thread does it."""
    over = threading.Event()
    with Progress(title, None, quiet) as progress:
        def beat() -> None:
            while not over.wait(BEAT_S):
                progress()

        thread = threading.Thread(target=beat, daemon=True)
        if not progress.silent:
            thread.start()
        try:
            yield
        finally:
            over.set()
            if not progress.silent:
                thread.join()


def _run(arguments: list[str]) -> int:
    """Exit code of the command; the rest of make's jobs stay within its reach."""
    if len(arguments) < 2:
        raise UserError("no command", "tools.common.progress", "write a title and a command")
    try:
        with waiting(arguments[0]):
            return subprocess.run(arguments[1:], close_fds=False, check=False).returncode
    except OSError as error:
        raise UserError(f"cannot run {arguments[1]} ({error.strerror})", arguments[0], "install it") from None


if __name__ == "__main__":
    sys.exit(command_line.run(lambda: _run(sys.argv[1:])))
