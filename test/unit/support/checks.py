"""A list of named checks for scripts that look at the sources instead of running them: prints what make test counts."""

import os
import shlex
import subprocess
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
CC = shlex.split(os.environ.get("CC") or "gcc")
CFLAGS = ["-std=gnu99", "-Wall", "-Wextra", "-ftrack-macro-expansion=0"]


def compiler(arguments: list[str], source: str | None = None) -> subprocess.CompletedProcess:
    """Runs the C compiler in the project's root; a source text is given to it as a file on its input."""
    return subprocess.run([*CC, *arguments], input=source, capture_output=True, text=True, cwd=ROOT, check=False)


def run(checks: list[Callable[[], None]]) -> None:
    """Runs each check, a function that asserts, and ends the program."""
    failed = 0
    for check in checks:
        try:
            check()
            print(f"{check.__name__}: PASS", flush=True)
        except AssertionError as error:
            failed += 1
            print(f"{check.__name__}: FAIL: {error}".replace("\n", "\n    "), flush=True)
        except Exception:  # a check that breaks has failed; the others still run
            failed += 1
            print(f"{check.__name__}: FAIL: {traceback.format_exc()}".replace("\n", "\n    "), flush=True)
    print(f"{len(checks) - failed} passed, {failed} failed")
    sys.exit(1 if failed else 0)
