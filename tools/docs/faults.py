"""Writes docs/faults.md from the one table of faults, include/drive/faults.h.

    python3 tools/docs/faults.py            writes the page
    python3 tools/docs/faults.py --print    prints it instead
"""

import argparse
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "faults.md"

INTRODUCTION = """# Faults

Any fault switches all six outputs off at once. The code of the first one is kept until S2 is pressed, which only clears it; a second
press starts again.

Where to read the code:
- the alive LED blinks it: code times, then a pause of a second and a half;
- the status line on UART1 says `fault 6` (115200 baud, twice a second);
- the debugger: `board_drive.fault`;
- the virtual board prints its name.

This page is made from `include/drive/faults.h` by `python3 tools/docs/faults.py`.

| code | name | cause | remedy |
|---|---|---|---|
"""


def table() -> list[tuple[int, str, str, str]]:
    """Code, name, cause and remedy of each fault, as the compiler sees the X-macro."""
    source = '#include "drive/faults.h"\n#define ROW(code, name, cause, remedy) @@ code @ #name @ cause @ remedy\nDRIVE_FAULT_TABLE(ROW)\n'
    compiler = shlex.split(os.environ.get("CC") or "gcc")
    done = subprocess.run([*compiler, "-E", "-P", f"-I{ROOT / 'include'}", "-xc", "-"], input=source, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"foc33: include/drive/faults.h does not compile, {compiler[0]}: {(done.stderr.splitlines() or ['no message'])[0]}")
    rows = []
    for row in done.stdout.replace("\n", " ").split("@@")[1:]:
        code, *texts = (part.strip() for part in row.split(" @ "))
        name, cause, remedy = ("".join(re.findall(r'"((?:[^"\\]|\\.)*)"', text)) for text in texts)
        rows.append((int(code), name, cause, remedy))
    return rows


def page() -> str:
    """The whole of docs/faults.md."""
    return INTRODUCTION + "".join(f"| {code} | {name} | {cause} | {remedy} |\n" for code, name, cause, remedy in table() if code != 0)


def main() -> None:
    options = argparse.ArgumentParser(description="Writes docs/faults.md from include/drive/faults.h.")
    options.add_argument("--print", action="store_true", help="print the page instead of writing it")
    if options.parse_args().print:
        print(page(), end="")
        return
    try:
        PAGE.write_text(page(), encoding="utf-8")
    except OSError as error:
        print(f"foc33: cannot write, {PAGE}: {error.strerror}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
