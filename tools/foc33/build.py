"""Building the firmware variant that a scenario needs, through the project's Makefile."""

import os
import re
import subprocess
from pathlib import Path

from . import places
from .errors import UserError


def variant_name(defines: list[str]) -> str:
    """Folder suffix for a set of defines; "" for the default build."""
    return re.sub(r"[^a-z0-9]+", "-", "-".join(sorted(defines)).lower()).strip("-")


def library(defines: list[str]) -> Path:
    """Builds build/host[-variant]/libvboard.so if needed and returns its path."""
    variant = variant_name(defines)
    command = ["make", "-s", "-C", str(places.ROOT), "vboard"]
    if variant:
        command += [f"VARIANT={variant}", "DEFINES=" + " ".join(f"-D{define}" for define in defines)]
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    try:
        result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    except OSError as error:
        raise UserError("cannot run make", "", error.strerror or str(error)) from None
    if result.returncode != 0:
        raise UserError("the firmware does not build", " ".join(command[-2:]) if variant else "make vboard", _reason(result.stderr))
    return places.ROOT / "build" / (f"host-{variant}" if variant else "host") / "libvboard.so"


def _reason(text: str) -> str:
    """The line of the compiler's output that a user needs."""
    for pattern in (r'static assertion failed: "(.*)"', r"(.*\berror: .*)", r"(.*\S.*)"):
        found = re.search(pattern, text)
        if found:
            return found[1]
    return "run make vboard to see why"
