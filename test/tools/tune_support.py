"""What the tuner's tests share: a motor file to change, AN1292's motor, and calls of the command line."""

import contextlib
import functools
import hashlib
import os
import pickle
import shlex
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import support

from tools.common import board_file, motor_file, paths
from tuning import cli
from tuning.design import Design, design

COMPILER = shlex.split(os.environ.get("CC") or "gcc")
INCLUDES = ["-Itools/cpu_host", "-Iinclude", "-I."]
WARNINGS = ["-std=gnu99", "-ftrack-macro-expansion=0", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
CHECK = ("-o", os.devnull, "firmware/drive/param_check.c")
HURST = "hurst_dmb0224c10002"

MOTOR = """title = "a motor"
connection = "Y"

[electrical]
pole_pairs = { value = 5, source = "test" }
resistance = { value = 2.67, unit = "ohm phase", source = "test" }
inductance = { value = 1.92, unit = "mH phase", frequency_hz = 1000, source = "test" }
kphi = { value = 7.24, unit = "V peak line-to-line/krpm", source = "test" }

[mechanical]
inertia = { value = 5.5e-6, unit = "kg m2", source = "test" }
viscous_friction = { value = 15.3e-6, unit = "N m s", source = "test" }
coulomb_friction = { value = 0.004, unit = "N m", source = "test" }

[rating]
voltage = { value = 24, unit = "V", source = "test" }
current = { value = 1.53, unit = "A peak", source = "test" }
torque = { value = 0.08, unit = "N m", source = "test" }
speed = { value = 2500, unit = "rpm", source = "test" }
maximum_speed = { value = 5000, unit = "rpm", source = "test" }
maximum_current = { value = 2.75, unit = "A peak", source = "test" }
"""
FOR_ANOTHER_BOARD = (("value = 1.53", "value = 15.3"), ("value = 0.08", "value = 0.8"), ("value = 2.75", "value = 18"), ("value = 2.67", "value = 0.3"),
                     ("value = 1.92", "value = 0.2"))
"""Changes of MOTOR that make it a motor for ten times the current."""

NO_FRICTION = (("viscous_friction = { value = 15.3e-6", "viscous_friction = { value = 0.0"),
               ("coulomb_friction = { value = 0.004", "coulomb_friction = { value = 0.0"))
SMALL_MOTOR = (("pole_pairs = { value = 5", "pole_pairs = { value = 1"), ("value = 2.67", "value = 1.5"), ("value = 7.24", "value = 2.084"),
         ("value = 5.5e-6", "value = 5e-7"), ("value = 15.3e-6", "value = 1e-9"), ("value = 0.004", "value = 0.0024"),
         ("value = 1.53", "value = 1.32"), ("value = 0.08", "value = 0.022"), ("speed = { value = 2500", "speed = { value = 8000"),
         ("value = 5000", "value = 10000"), ("value = 2.75", "value = 1.98"))

command = functools.partial(support.command, main=cli.main)


@contextlib.contextmanager
def motor_path(*changes: tuple[str, str], more: str = "") -> Iterator[Path]:
    """A motor file: MOTOR with texts replaced, and more lines at its end."""
    text = MOTOR
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a_motor.toml"
        path.write_text(text + more, encoding="utf-8")
        yield path


def designed(*changes: tuple[str, str], more: str = "", board: str = "mclv") -> Design:
    """The design of a changed MOTOR."""
    with motor_path(*changes, more=more) as path:
        return design(motor_file.load(str(path)), board_file.load(board))


@functools.cache
def inputs() -> bytes:
    """What a design is made from: the tuner, its files, and the firmware's headers."""
    every = (path for room in ("tuning", "tools/common", "include") for path in sorted((paths.ROOT / room).rglob("*")))
    files = (path for path in every if path.suffix in (".py", ".toml", ".h", ".c"))
    return hashlib.sha256(b"\0".join(str(path).encode() + b"\0" + path.read_bytes() for path in files)).digest()


@functools.cache
def of(name: str) -> Design:
    """The design of one of the project's motors; shared, not to be changed, and kept for the other suites, which ask for the same."""
    kept = paths.ROOT / "build/test/designs" / hashlib.sha256(inputs() + name.encode()).hexdigest()
    with contextlib.suppress(OSError):
        return pickle.loads(kept.read_bytes())
    made = design(motor_file.load(name), board_file.load("mclv"))
    kept.parent.mkdir(parents=True, exist_ok=True)
    new = kept.with_suffix(f".{os.getpid()}")
    new.write_bytes(pickle.dumps(made))
    new.replace(kept)
    return made


def build(text: str, *arguments: str, includes: list[str] = INCLUDES) -> str:
    """What the compiler says with this userparams.h."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "userparams.h").write_text(text, encoding="utf-8")
        compile_ = [*COMPILER, *WARNINGS, f"-I{folder}", *includes, "-c", *arguments]
        return subprocess.run(compile_, cwd=paths.ROOT, capture_output=True, text=True, check=False).stderr
