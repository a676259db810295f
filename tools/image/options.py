"""`make options`: what each option of userparams.h costs in flash and RAM, and all of them together, with the delivered header.

Each is a build of its own, of a copy of the header with other values. What does not fit the chip is linked for a larger one by tools/make/overfull.sh."""

import json
import os
import re
import shutil
import subprocess
import sys
from typing import Any

from tools.common import command_line, paths
from tools.common.errors import UserError
from tools.common.progress import waiting

OUT = paths.ROOT / "build" / "target" / "options.json"
OPTIONS: dict[str, tuple[dict[str, str], str]] = {
    "`SCOPE` 1": ({"SCOPE": "1"}, ""), "`PARAMS_IN_RAM`": ({}, "-DPARAMS_IN_RAM"), "`PARAMS_IN_RAM`, `PARAMS_KEPT` 1": ({"PARAMS_KEPT": "1"}, "-DPARAMS_IN_RAM"),
    **{f"`{name}` {value}": ({name: value}, "") for name, value in (
        ("DIRECTION_INPUT_USED", "1"), ("FAULT_OUTPUT_USED", "1"), ("RUNNING_OUTPUT_USED", "1"), ("BRAKE_CHOPPER_V", "26.0"), ("MOTOR_NTC_USED", "1"), ("BRIDGE_NTC_USED", "1"),
        ("SUPPLY_CURRENT_LIMIT_A", "2.0"), ("DERATE_BELOW_V", "20.0"), ("SPEEDREF_DECEL_RPM_PER_S", "2000"), ("STOP_MODE", "1"), ("STOP_MODE", "2"), ("POT_LIVE_ZERO", "0.167"),
        ("FAULT_INPUT_USED", "0"))}}
"""Name in the table: values of the header, and macros."""
PRODUCT = [values for name, (values, macros) in OPTIONS.items() if not macros and name not in ("`SCOPE` 1", "`STOP_MODE` 1", "`FAULT_INPUT_USED` 0")]
ALL = {name: value for values in PRODUCT for name, value in values.items()}
"""What a product may have on at once."""


def changed(header: str, values: dict[str, str]) -> str:
    """The header with these values."""
    for name, value in values.items():
        header, number = re.subn(rf"^([ \t]*#[ \t]*define[ \t]+{name}[ \t]+)\S+", rf"\g<1>{value}", header, flags=re.MULTILINE)
        if number != 1:
            raise UserError(f"{name} is not in the header once", "userparams.h", "make userparams writes one that has all")
    return header


def built(number: int, values: dict[str, str], macros: str) -> tuple[int, int | None]:
    """Bytes of flash and of RAM; no RAM for an image that does not fit."""
    folder = paths.ROOT / "build" / "options" / str(number)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "userparams.h").write_text(changed((paths.ROOT / "userparams.h").read_text(encoding="utf-8"), values), encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    done = subprocess.run(["make", "-s", "image-room", f"USERPARAMS={paths.shown(folder)}", f"VARIANT=option-{number}", f"DEFINES={macros}"], cwd=paths.ROOT, env=environment,
                          capture_output=True, text=True, check=False)
    shutil.rmtree(paths.ROOT / "build" / f"target-option-{number}", ignore_errors=True)
    found = re.search(r"flash (\d+)(?:, RAM (\d+))?", done.stdout)
    if done.returncode or not found:
        told = next((line.removeprefix("foc33: ") for line in done.stderr.splitlines() if line.startswith("foc33: ")), "run make firmware to see why")
        raise UserError(f"the image with {values or macros} does not build", "make options", told)
    return int(found[1]), int(found[2]) if found[2] else None


def measured() -> list[dict[str, Any]]:
    """A row for each option, and the first for none."""
    wanted = {"none of them": ({}, ""), **OPTIONS, "all but the first three, `STOP_MODE` 2": (ALL, "")}
    rows = []
    for number, (name, (values, macros)) in enumerate(wanted.items()):
        with waiting(f"option {number} of {len(wanted) - 1}: {name}"):
            flash, ram = built(number, values, macros)
        rows.append({"name": name, "flash": flash, "ram": ram})
    return rows


def table(rows: list[dict[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of docs/results.md."""
    none = rows[0]
    found = [["none", f"{none['flash']}", f"{none['ram']}"]]
    for row in rows[1:]:
        found.append([row["name"], f"{row['flash'] - none['flash']:+d}", f"{row['ram'] - none['ram']:+d}" if row["ram"] is not None else "does not fit"])
    return ["option", "flash, bytes", "RAM, bytes"], found


def main() -> int:
    return command_line.run(_run)


def _run() -> int:
    rows = measured()
    OUT.parent.mkdir(parents=True, exist_ok=True)
    OUT.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    head, lines = table(rows)
    for line in [head, *lines]:
        print(f"{line[0].replace('`', ''):<44}{line[1]:>14}{line[2]:>14}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
