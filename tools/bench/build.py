"""Building the firmware variant that a scenario needs, through the project's Makefile."""

import os
import re
import subprocess
import zlib
from pathlib import Path

from tools.common import paths
from tools.common.errors import UserError, UserErrors, suggestion
from tools.common.progress import waiting

HEADER = "userparams.h"
APP = "APP="
"""Begins the entry of a list of macros that names the application: one of firmware/app, or a path."""


def variant_name(defines: list[str], userparams: Path | None = None) -> str:
    """Folder suffix for a header and a set of defines; "" for the default build."""
    names = [_app_name(define.removeprefix(APP)) if define.startswith(APP) else define for define in sorted(defines)]
    macros = re.sub(r"[^a-z0-9]+", "-", "-".join(names).lower()).strip("-")
    return "-".join(part for part in ("" if userparams is None else _header_name(userparams), macros) if part)


def app(text: str, where: str, beside: Path | None = None) -> str:
    """The entry for an application: a name of firmware/app, or a file, also one beside the file that names it."""
    known = sorted(path.stem for path in (paths.ROOT / "firmware" / "app").glob("*.c"))
    if text in known:
        return APP + text
    places = [Path(text), *([beside.parent / text] if beside else [])]
    for path in places:
        if path.is_file():
            return APP + str(path.resolve())
    if any(path.is_dir() for path in places):
        raise UserError(f"'{text}' is a folder", where, "name the C file in it")
    if any(Path(f"{path}.c").is_file() for path in places):
        raise UserError(f"no file '{text}'", where, f"did you mean '{text}.c'?")
    if "/" in text or text.endswith(".c"):
        raise UserError(f"no file '{text}'", where, f"name a C file, or one of {', '.join(known)}")
    raise UserError(f"no application '{text}'", where, suggestion(text, known))


def app_shown(defines: list[str]) -> str:
    """The application in a list of macros, as a report names it; "" for panel, which is in every other build."""
    return next((_app_path(define.removeprefix(APP)) for define in defines if define.startswith(APP)), "")


def has_line(defines: list[str]) -> bool:
    """Whether the application has the serial line: it includes app/line.h."""
    named = [Path(define.removeprefix(APP)) for define in defines if define.startswith(APP)]
    files = [path if path.suffix else paths.ROOT / "firmware" / "app" / f"{path}.c" for path in named]
    return any(re.search(r'^ *# *include *"app/line\.h"', path.read_text(encoding="utf-8", errors="replace"), re.MULTILINE) for path in files)


def _app_name(text: str) -> str:
    path = Path(text)
    return f"app-{path.stem}" + (f"-{zlib.crc32(text.encode()):08x}" if path.suffix else "")


def _app_path(text: str) -> str:
    return str(paths.shown(Path(text))) if Path(text).suffix else text


def _header_name(folder: Path) -> str:
    """The motor's name for a tuned header; for any other folder its own name and a number that tells it from its namesakes."""
    return paths.name_of(folder, paths.TUNED)


def header_folder(text: str | Path, where: str = "--userparams") -> Path | None:
    """The folder with a userparams.h that a user has named; None for the project's own, which needs no variant."""
    folder = Path(text)
    if folder.name == HEADER and folder.is_file():
        folder = folder.parent
    if not (folder / HEADER).is_file():
        raise UserError(f"no {HEADER} in '{text}'", where, "name the folder that holds it; make tune MOTOR=name writes one")
    folder = folder.resolve()
    return None if folder == paths.ROOT else folder


def library(defines: list[str], userparams: Path | None = None, target: str = "vboard", sanitized: bool = False) -> Path:
    """Builds build/host[-variant]/libvboard.so if needed and returns its path. `userparams`: folder of the header, None for the root's.
    `target`: what make shall make, if there is to be more in that folder. Builds take turns: the Makefile sees to it."""
    variant = variant_name(defines, userparams)
    result = make(target, defines, userparams, sanitized)
    if result.returncode != 0:
        if told := re.findall(r"^foc33: (.*)", result.stderr, re.MULTILINE):
            raise UserErrors([UserError(line) for line in told])
        raise UserError("the firmware does not build", _what(variant, result.args, userparams), _reason(result.stderr))
    return paths.ROOT / "build" / "-".join(part for part in ("host", variant, "san" if sanitized else "") if part) / "libvboard.so"


def make(target: str, defines: list[str], userparams: Path | None, sanitized: bool = False) -> subprocess.CompletedProcess:
    """What make says when it makes the target in the folder of these settings."""
    variant = variant_name(defines, userparams)
    command = ["make", "-s", "-C", str(paths.ROOT), target]
    if variant:
        command += [f"VARIANT={variant}", "DEFINES=" + " ".join(f"-D{define}" for define in defines if not define.startswith(APP))]
        command += [APP + _app_path(define.removeprefix(APP)).replace("$", "$$") for define in defines if define.startswith(APP)]
    if userparams is not None:
        command.append(f"USERPARAMS={paths.shown(userparams)}".replace("$", "$$"))
    if sanitized:
        command.append("SAN=1")
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    try:
        with waiting(f"building {' '.join([target, variant]).strip()}"):
            return subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
                                  check=False)
    except OSError as error:
        raise UserError("cannot run make", "", error.strerror or str(error)) from None


def _what(variant: str, command: list[str], userparams: Path | None) -> str:
    if userparams is not None:
        return str(paths.shown(userparams) / HEADER)
    return " ".join(command[-2:]) if variant else "make vboard"


def _reason(text: str) -> str:
    """The line of the compiler's output that a user needs."""
    for pattern in (r"(.*\berror: .*)", r"(.*\S.*)"):
        found = re.search(pattern, text)
        if found:
            return found[1]
    return "run make vboard to see why"
