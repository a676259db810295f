"""Writes the table of assumptions into docs/simulator.md from the one in the simulator, tools/cpu_33f/iss_assumptions.h.

    python3 tools/docs/simulator.py            writes the page
    python3 tools/docs/simulator.py --print    prints it instead
"""

import argparse
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "simulator.md"
HEAD = "| name | value | meaning | where |\n|---|---:|---|---|\n"


def assumptions() -> list[tuple[str, str, str, str]]:
    """Name, value, meaning and place of each assumption, as the compiler sees the X-macro."""
    source = '#include "iss_assumptions.h"\n#define ROW(id, value, meaning, place) @@ #id @ #value @ meaning @ place\nASSUMPTIONS(ROW)\n'
    compiler = shlex.split(os.environ.get("CC") or "gcc")
    done = subprocess.run([*compiler, "-E", "-P", f"-I{ROOT / 'tools/cpu_33f'}", f"-I{ROOT / 'tools/chip'}", "-xc", "-"], input=source, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"foc33: tools/cpu_33f/iss_assumptions.h does not compile, {compiler[0]}: {(done.stderr.splitlines() or ['no message'])[0]}")
    rows = []
    for row in done.stdout.replace("\n", " ").split("@@")[1:]:
        parts = [part.strip() for part in row.split(" @ ")]
        rows.append(tuple("".join(re.findall(r'"((?:[^"\\]|\\.)*)"', part)) for part in parts))
    return rows


def page() -> str:
    """The whole of docs/simulator.md with the table that the simulator has now."""
    rows = "".join(f"| `{name}` | {value} | {meaning} | {place} |\n" for name, value, meaning, place in assumptions())
    text, count = re.subn(r"(<!-- assumptions -->\n).*?(<!-- end -->)", lambda match: match[1] + HEAD + rows + match[2],
                          PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    if count != 1:
        sys.exit(f"foc33: marks '<!-- assumptions -->' and '<!-- end -->', docs/simulator.md: found {count} times, put them in once")
    return text


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--print", action="store_true", help="print the page instead of writing it")
    try:
        if options.parse_args().print:
            print(page(), end="")
        else:
            PAGE.write_text(page(), encoding="utf-8")
    except OSError as error:
        print(f"foc33: {PAGE}: {error.strerror}: check the file", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
