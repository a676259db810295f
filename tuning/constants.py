"""What the firmware makes of parameters and what the build refuses: the headers, compiled by this machine's compiler, say it."""

import contextlib
import functools
import hashlib
import math
import os
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tools.common import paths
from tools.common.errors import UserError
from tools.common.param_rows import parameters
from tools.common.x_macro import run_compiler

SOURCE = paths.ROOT / "tuning" / "param_values.c"
INCLUDE = paths.ROOT / "include"
KEPT = paths.ROOT / "build" / "param_values"
"""Output of the programs, by a hash of what they were compiled from."""


@dataclass(frozen=True)
class Constant:
    """A number that the firmware computes with."""

    group: str
    name: str
    """a macro of the scaling headers, or a field of drive_params_t"""
    value: float
    """engineering value that it stands for"""
    unit: str
    q_format: str
    """what one is in counts: "Q13 A" is 8192 counts for full-scale current"""
    q_value: int
    error_percent: float
    """of the Q value against the exact one; 0 where both are 0"""
    meaning: str


@dataclass(frozen=True)
class Header:
    """What a userparams.h means."""

    constants: list[Constant]
    wrong: list[str]
    """what the build refuses, in its words; relations first: one wrong value can put several others outside their ranges"""


def number_of(text: str | float) -> float:
    """The value of a define: a C number."""
    if isinstance(text, str):
        return float(int(text, 0)) if text.lower().startswith("0x") else float(text)
    return float(text)


def filter_hz(k_q15: float, period_s: float) -> float:
    """Corner of y += K (x - y): 1 - K = exp(-2 pi f Ts)."""
    return -math.log(1.0 - k_q15 / 32768.0) / (2.0 * math.pi * period_s)


def filter_k(corner_hz: float, period_s: float) -> int:
    """K in Q15 for a corner frequency."""
    return math.floor(32768.0 * (1.0 - math.exp(-2.0 * math.pi * corner_hz * period_s)) + 0.5)


def header(params: Mapping[str, str]) -> Header:
    """Constants and refusals of a complete set of parameters, by name as in userparams.h."""
    missing = [name for name in parameters() if name not in params]
    if missing:
        return Header([], [f"{missing[0]} is missing"])
    constants, relations, outside, group = [], [], [], ""
    for line in _output(SOURCE.read_text(encoding="utf-8"), params).splitlines():
        kind, _, rest = line.partition("|")
        if kind == "group":
            group = rest
        elif kind == "constant":
            name, value, unit, q_format, count, error, meaning = rest.split("|")
            constants.append(Constant(group, name, float(value), unit, q_format, int(count), float(error), meaning))
        elif kind == "relation":
            relations.append(rest)
        elif params[rest] != "NORM_INVKFIBASE" or not any(message.startswith("MOTOR_KPHI") for message in relations):
            p = parameters()[rest]
            outside.append(f"{rest} = {params[rest]} is outside {p.span}")
    if any(message.startswith("MOTOR_KPHI") for message in relations): # what it breaks in turn is not told
        relations = [message for message in relations if "of NORM_INVKFIBASE" not in message]
    return Header(constants, relations + outside)


def evaluate(params: Mapping[str, str], *expressions: str) -> list[float]:
    """Macros of the scaling headers, which need only those parameters that they name."""
    prints = "".join(f'    printf("%.9g\\n", (double)({expression}));\n' for expression in expressions)
    return [float(line) for line in _output(f'#include <stdio.h>\n#include "drive/param_scaling.h"\nint main(void)\n{{\n{prints}    return 0;\n}}\n',
                                            params).split()]


def _output(source: str, params: Mapping[str, str]) -> str:
    """What a program prints that is compiled with these parameters; kept from the last time if nothing has changed since."""
    defines = "".join(f"#define {name} {text}\n" for name, text in params.items())
    kept = KEPT / hashlib.sha256("\0".join([source, defines, _headers()]).encode()).hexdigest()[:32]
    with contextlib.suppress(OSError):
        return kept.read_text(encoding="utf-8")
    text = _compiled(source, f"#ifndef USERPARAMS_H\n#define USERPARAMS_H\n{defines}#endif\n")
    with contextlib.suppress(OSError): # what cannot be kept is compiled again
        KEPT.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=KEPT, delete=False, encoding="utf-8") as new:
            new.write(text)
        os.replace(new.name, kept)
    return text


@functools.cache
def _headers() -> str:
    return "".join(path.read_text(encoding="utf-8") for room in ("control", "drive") for path in sorted((INCLUDE / room).rglob("*.h")))


def _compiled(source: str, userparams: str) -> str:
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "userparams.h").write_text(userparams, encoding="utf-8")
        done = run_compiler(["-std=gnu99", "-O0", "-w", f"-I{name}", f"-I{INCLUDE}", "-o", f"{name}/program", "-lm"], source)
        if done.returncode:
            said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[:200])
            raise UserError(f"the parameters do not compile: {said}", "include/drive", "change the parameter that is named")
        return subprocess.run([f"{name}/program"], capture_output=True, text=True, check=True).stdout
