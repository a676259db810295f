"""The C compiler for tests that look at the firmware's sources instead of running them."""

import os
import shlex
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CC = shlex.split(os.environ.get("CC") or "gcc")
CFLAGS = ["-std=gnu99", "-Wall", "-Wextra", "-ftrack-macro-expansion=0"]


def compiler(arguments: list[str], source: str | None = None) -> subprocess.CompletedProcess:
    """Runs the C compiler in the project's root; a source text is given to it as a file on its input."""
    return subprocess.run([*CC, *arguments], input=source, capture_output=True, text=True, cwd=ROOT, check=False)
