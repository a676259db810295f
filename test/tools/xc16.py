"""The target compiler, where the Makefile finds one: in XC16, else on PATH, as XC16 or its successor XC-DSC; and make with it."""

import functools
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tools.common import paths

ROOT = paths.ROOT
MAKES_OWN = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "OPT", "DEFINES", "USERPARAMS", "VARIANT", "DFP", "V")
FOLDER = os.environ.get("XC16") and str(paths.ROOT / os.environ["XC16"])
os.environ.update({"XC16": FOLDER} if FOLDER else {}) # for make in a copy of the project, too
COMPILER = next(filter(None, (shutil.which(f"{name}gcc", path=f"{FOLDER}/bin" if FOLDER else None) for name in ("xc16-", "xc-dsc-"))), None)
NONE = "no xc16-gcc on PATH; give XC16=folder"
MARKS = [pytest.mark.xc16, pytest.mark.skipif(not COMPILER, reason=NONE)]
"""Of what make test-image runs."""


def needs_compiler(test: Callable) -> Callable:
    return functools.reduce(lambda marked, mark: mark(marked), MARKS, test)


def program(name: str) -> str:
    """Path of another program of the compiler."""
    return (COMPILER or "gcc").removesuffix("gcc") + name


def make(*arguments: str, root: Path = ROOT, path: str | None = None) -> subprocess.CompletedProcess:
    """As a user calls it. @param path instead of PATH, without the compiler"""
    environment = {name: value for name, value in os.environ.items() if name not in MAKES_OWN and (path is None or name != "XC16")}
    if path is not None:
        environment["PATH"] = path
    return subprocess.run(["make", "-s", *arguments], cwd=root, env=environment, capture_output=True, text=True, check=False)


def warnings(errors: str) -> list[str]:
    """What a build says, but for what a mode tells its user on purpose."""
    return [line for line in errors.splitlines() if "note: #pragma message: " not in line and not line.startswith("In file included from ")]


def made(*arguments: str) -> str:
    """What make prints; the test fails with what it says where it ends with an error."""
    done = make(*arguments)
    if done.returncode != 0:
        told = warnings(done.stderr) + [line for line in done.stdout.splitlines() if "FAIL" in line]
        pytest.fail("\n".join([f"make {' '.join(arguments)}: exit {done.returncode}", *told[:20]]), pytrace=False)
    return done.stdout


def build_image(*arguments: str) -> None:
    """make firmware, which says nothing that is no remark of a mode."""
    done = make("firmware", *arguments)
    if done.returncode != 0 or warnings(done.stderr):
        pytest.fail("\n".join([f"make firmware {' '.join(arguments)}: exit {done.returncode}", *warnings(done.stderr)[:20]]), pytrace=False)
