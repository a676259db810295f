"""C sources of the tuner as libraries, by this machine's compiler; kept until the source or the compiler is another."""

import contextlib
import ctypes
import hashlib
import os
import platform
import tempfile
from pathlib import Path

from tools.common import paths
from tools.common.errors import UserError
from tools.common.x_macro import run_compiler

KEPT = paths.ROOT / "build" / "tuner"
FLAGS = ["-std=gnu99", "-O2", "-ffp-contract=off", "-fPIC", "-shared"]
"""Sums are rounded as they are written, on every machine."""


def library(source: Path) -> ctypes.CDLL:
    """The library of one source that includes nothing of the project's."""
    text = source.read_text(encoding="utf-8")
    parts = (text, *FLAGS, os.environ.get("CC", ""), platform.machine())
    kept = KEPT / f"{hashlib.sha256(chr(0).join(parts).encode()).hexdigest()[:32]}.so"
    with contextlib.suppress(OSError):
        return ctypes.CDLL(str(kept))
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.so"
        done = run_compiler([*FLAGS, "-o", str(made), "-lm"], text)
        if done.returncode:
            raise UserError(f"does not compile: {(done.stderr.splitlines() or ['no message'])[0]}", str(paths.shown(source)))
        with contextlib.suppress(OSError): # what cannot be kept is compiled again
            KEPT.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=KEPT, delete=False) as new:
                new.write(made.read_bytes())
            os.replace(new.name, kept)
        return ctypes.CDLL(str(made))
