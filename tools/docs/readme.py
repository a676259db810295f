"""`make readme`: measures what the tables and pictures of README.md and docs/ show, and writes them there.

    python3 -m tools.docs.readme [--check] [--compiler] [name ...]

A table's place is between the marks <!-- name --> and <!-- end --> of a page, whichever. Each of its rows carries, out of sight, the
checksum of the firmware that it was measured on (tools/common/checksum.py) and the date; a row of older firmware shows the date. With
--check nothing is written: what takes seconds is measured anew, and a row that differs is an error."""

import argparse
import datetime
import itertools
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tools.common import command_line, paths
from tools.common.checksum import PARTS, checksum, files
from tools.common.errors import UserError, suggestion

from . import figures
from .figures import APPLICATIONS, BLOCKS, Part

ROOT = paths.ROOT
MOTORS = paths.names(paths.MOTORS)
AT_40KHZ = "MOTOR=hurst_dmb0224c10002 BOARD=mclv_40khz"
HEADER_40KHZ = "build/tune/hurst_dmb0224c10002-mclv_40khz"
OTHER_INPUT = ("firmware/budget.toml", "tools/bench/*.py", "tools/bench/scenarios/*.toml", "tools/image/*.py")
"""What results in build/ depend on beside the code that the checksum is of."""
OURS = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "MAKEOVERRIDES", "CHECK", "ONLY")
"""Variables of this make that the ones it starts do not have."""


@dataclass(frozen=True)
class Source:
    """Commands that leave a result in build/, and the pictures that they draw."""
    commands: tuple[str, ...]
    of: str = "pc"          # the code that it depends on: of checksum.PARTS
    takes: str = "long"     # or seconds: --check runs it; by name: run where it is asked for; found: left by others
    left: str = ""          # where it leaves a result that may be taken while it is of this firmware
    pictures: tuple[tuple[str, str], ...] = ()
    counts: bool = False    # its table tells how many rows hold, so one that does not is a result, too


SOURCES = {
    "demo": Source(("run SCENARIO=demo",), takes="seconds",
                   pictures=(("run/demo/speed.png", "demo-speed.png"), ("run/demo/field_weakening.png", "demo-field-weakening.png"))),
    **{name: Source((f"run SCENARIO={name}",), takes="seconds") for name in ("stop_from_top", "fault_stall")},
    "table2": Source(("table2",), takes="seconds"),
    "size": Source(("size",), "image", "seconds", "target/size.json"),
    "options": Source(("options",), "image"),
    **{name: Source((name,), "chip", "seconds", f"target/{name}.json") for name in ("cycles", "wcet")},
    **{name: Source((name,)) for name in ("starts", "motors")},
    "tune-fw": Source(("tune-fw",), pictures=(("tune-fw/hurst_dmb0224c10002/over_speed.png", "tuning-fw.png"),)),
    "robust": Source(("robust",), pictures=(("run/robust/margins.png", "tuning-margins.png"),)),
    "identify": Source(("identify MOTOR=all",)),
    "identify-range": Source(("identify-range",)),
    **{name: Source(tuple(f"{name} MOTOR={motor}" for motor in MOTORS)) for name in ("loadsteps", "lowspeed", "catch")},
    **{name: Source(tuple(f"{name} MOTOR={motor}" for motor in MOTORS), counts=True) for name in ("held", "pulse")},
    "response": Source(tuple(f"response MOTOR={motor}" for motor in MOTORS), pictures=(("run/response/speed.png", "response-speed.png"),)),
    "box": Source(tuple(f"starts MOTOR={motor}{draw}" for motor in MOTORS for draw in (" FULL=1", " DRAW=300 SEED=1"))),
    "demo_40khz": Source((f"run SCENARIO=demo_40khz {AT_40KHZ} OUT=build/run/demo_40khz",)),
    "table2_40khz": Source((f"table2 {AT_40KHZ} OUT=build/run/table2_40khz",)),
    "cycles_40khz": Source((f"tune {AT_40KHZ}", f"cycles SCENARIO=demo_40khz USERPARAMS={HEADER_40KHZ} OUT=build/target/40khz"), "chip"),
    **{name: Source((name,), takes="by name", left=f"{name}/seed-1/summary.json", counts=name == "soak") for name in ("campaign", "soak")},
    "applications": Source(tuple(f"run APP={name}" for name in APPLICATIONS),
                           pictures=tuple((f"run/app_{name}-app-{name.replace('_', '-')}/speed.png", f"app-{name}.png") for name in APPLICATIONS)),
    "tests": Source(("test", "coverage"), takes="found", left="test/summary.json"),
}


# ---- pages ---------------------------------------------------------------------------------------------------------------
STAMP = re.compile(r" *<!-- (\d{4}-\d\d-\d\d) (\w+) -->")
SHOWN_DATE = re.compile(r" \(of \d{4}-\d\d-\d\d\)$")
BLOCK = re.compile(r"(<!-- (?!end)([a-zA-Z][\w ]*) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


@dataclass(frozen=True)
class Row:
    """A line of a table with the firmware that it was measured on."""
    cells: list[str]
    date: str = ""
    sum: str = ""

    @staticmethod
    def read(line: str) -> "Row":
        stamp = STAMP.search(line)
        cells = [cell.strip() for cell in STAMP.sub("", line).strip().strip("|").split("|")]
        return Row([SHOWN_DATE.sub("", cells[0]), *cells[1:]], *(stamp.groups() if stamp else ("", "")))

    def text(self, now: str) -> str:
        """@param now checksum of today's firmware"""
        name = self.cells[0] + (f" (of {self.date})" if self.sum not in ("", now) else "")
        stamp = f" <!-- {self.date} {self.sum} -->" if self.sum else ""
        return "| " + " | ".join([name, *self.cells[1:]]) + stamp + " |"


def pages() -> dict[Path, str]:
    return {path: path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]}


def rows_in(block: str) -> tuple[list[str], list[Row]]:
    """Head and rows of a block's table."""
    lines = block.splitlines()
    return (Row.read(lines[0]).cells if lines else []), [Row.read(line) for line in lines[2:]]


def blocks_of(texts: dict[Path, str]) -> dict[str, Path]:
    """The page of each block; a block stands in one."""
    found = [(match[2], page) for page, text in texts.items() for match in BLOCK.finditer(text) if match[2] != "table"]
    for name in BLOCKS:
        places = [page for other, page in found if other == name]
        if len(places) != 1:
            raise UserError(f"marks '<!-- {name} -->' and '<!-- end -->' found {len(places)} times", "README.md and docs/",
                            "put them in once")
    for name, page in found:
        if name not in BLOCKS:
            raise UserError(f"no table '{name}'", str(page.relative_to(ROOT)), suggestion(name, BLOCKS))
    return dict(found)


def kept(part: Part, rows: list[Row]) -> list[Row]:
    """The rows of a part as they stand in the page."""
    return [row for row in rows if not part.name or row.cells[0] == part.name]


def refilled(name: str, old: str, measured: set[str], sums: dict[str, str], today: str) -> str:
    """A block with new rows of what has been measured; the others stay, with their date if they are of older firmware."""
    head, rows = rows_in(old)
    lines: list[str] = []
    used = 0
    for part in BLOCKS[name]:
        now = sums[SOURCES[part.sources[0]].of]
        if measured.issuperset(part.sources):
            head, cells = part.make()
            lines += [Row(line, today, now).text(now) for line in cells]
            used += len(kept(part, rows))
        else:
            lines += [row.text(now) for row in kept(part, rows)]
            used += len(kept(part, rows))
    if used != len(rows):
        raise UserError(f"{len(rows) - used} rows are no longer measured", f"table '{name}'", "take them out of the page")
    return "\n".join(["| " + " | ".join(head) + " |", "| --- |" + " ---: |" * (len(head) - 1), *lines, ""])


def refill(part: Part) -> str:
    return f"make readme ONLY=\"{' '.join(part.sources)}\""


def differences(name: str, page: str, old: str, measured: set[str]) -> list[str]:
    """A line for each row that a command now gives otherwise."""
    _, rows = rows_in(old)
    lines = []
    for part in BLOCKS[name]:
        if not measured.issuperset(part.sources):
            continue
        command = " and ".join(f"`make {SOURCES[source].commands[0]}`" for source in part.sources)
        for says, gives in itertools.zip_longest((row.cells for row in kept(part, rows)), part.make()[1], fillvalue=[]):
            pairs = list(zip(says, gives))
            if len(says) != len(gives):
                pairs = [(" | ".join(says) or "no such row", " | ".join(gives) or "no such row")]
            differing = [[cell or "nothing" for cell in pair] for pair in pairs if pair[0] != pair[1]]
            if differing:
                one, two = map(", ".join, zip(*differing))
                lines.append(f"{page}, {name}, {(says or gives)[0]}: says {one}, but {two} by {command}: run `{refill(part)}`")
    return lines


def older(name: str, old: str, measured: set[str], sums: dict[str, str]) -> list[str]:
    """The rows of older firmware that nothing has measured now, by what measures them."""
    lines = []
    for part in BLOCKS[name]:
        found = [row for row in kept(part, rows_in(old)[1]) if row.sum != sums[SOURCES[part.sources[0]].of]]
        if found and not measured.issuperset(part.sources):
            what = part.name or f"{len(found)} rows"
            short = what if len(what) < 60 else what[:57] + "..."
            lines.append(f"  {name}, {short}: of {found[0].date or 'no date'} ({refill(part)})")
    return lines


# ---- measuring -----------------------------------------------------------------------------------------------------------
def is_of_now(source: Source, sums: dict[str, str]) -> bool:
    """Whether a result that is there already is of today's firmware: newer than all sources, whose comments may state something, and made of
    just this image."""
    path = ROOT / "build" / source.left
    if not source.left or not path.exists():
        return False
    data = figures.loaded(source.left)
    inputs = [*files("chip"), *(found for pattern in OTHER_INPUT for found in ROOT.glob(pattern))]
    return (not data.get("broken") and (source.takes != "seconds" or data.get("sources") == sums[source.of])
            and path.stat().st_mtime > max(found.stat().st_mtime for found in inputs))


def make(command: str, counts: bool = False) -> None:
    """Runs a target, quietly; an error is its last line. A sweep whose table counts what holds may come to its end with rows that do not."""
    print(f"  make {command}", flush=True)
    log = ROOT / "build/readme.log"
    environment = {name: value for name, value in os.environ.items() if name not in OURS}
    quietly = ["sh", "-c", f"exec make -s {command} >build/readme.log 2>&1"]
    done = subprocess.run([sys.executable, "-m", "tools.common.progress", f"make {command}", *quietly], cwd=ROOT, env=environment, check=False)
    if done.returncode:
        told = log.read_text(encoding="utf-8", errors="replace").strip().splitlines() or [f"exit status {done.returncode}"]
        held = [line for line in told if counts and re.fullmatch(r"\d+ of \d+ (expectations hold|segments are well)", line)]
        if held:
            print(f"    {held[-1]}", flush=True)
            return
        named = [line for line in told if line.startswith("foc33: ")]
        raise UserError(f"make {command} fails: {(named or told)[-1].removeprefix('foc33: ')}", "build/readme.log", "repair it first")


def chosen(names: Iterable[str], checks: bool, compiler: bool, sums: dict[str, str]) -> list[str]:
    """The sources to measure: those that are named, as themselves or by their table, else all that have a turn."""
    result: list[str] = []
    for name in names:
        if name not in SOURCES and name not in BLOCKS:
            raise UserError(f"no table or measurement '{name}'", "ONLY", suggestion(name, [*BLOCKS, *SOURCES]))
        found = [source for part in BLOCKS.get(name, []) for source in part.sources] or [name]
        without = [source for source in found if SOURCES[source].of != "pc"]
        if without and not compiler:
            raise UserError(f"'{without[0]}' needs Microchip's compiler", "ONLY",
                            "put it on PATH or name its folder, e.g. XC16=/opt/microchip/xc16/v2.10")
        result += found
    turns = ("seconds",) if checks else ("seconds", "long")
    return list(dict.fromkeys(result)) or [name for name, source in SOURCES.items() if (compiler or source.of == "pc")
                                           and (source.takes in turns or not checks and is_of_now(source, sums))]


def measured(names: list[str], checks: bool, asked: bool, sums: dict[str, str]) -> tuple[set[str], list[str]]:
    """Runs what the sources need. @return those that have a result now, and with --check a line for each that fails"""
    done, failed = set(), []
    for name in names:
        source = SOURCES[name]
        ready = (checks or source.takes in ("by name", "found")) and is_of_now(source, sums)
        if source.takes == "found" and not ready:
            raise UserError("no result of this firmware", f"build/{source.left}", f"run `make {'` and `make '.join(source.commands)}`")
        try:
            for command in () if ready and not (asked and source.takes == "by name") else source.commands:
                make(command, source.counts)
            done.add(name)
        except UserError as error:
            if not checks:
                raise
            failed.append(str(error))
    return done, failed


def check(texts: dict[Path, str], done: set[str], sums: dict[str, str]) -> list[str]:
    """A line for each row that differs; tells of the rows that are of older firmware."""
    lines, aged = [], []
    for page, text in texts.items():
        for _, name, old, _ in BLOCK.findall(text):
            if name in BLOCKS:
                lines += differences(name, str(page.relative_to(ROOT)), old, done)
                aged += older(name, old, done, sums)
    if aged:
        print("\n".join(["of older firmware, not measured here:", *aged]))
    return lines


def write(texts: dict[Path, str], done: set[str], sums: dict[str, str]) -> None:
    today = datetime.date.today().isoformat()

    def block(found: re.Match) -> str:
        return found[1] + refilled(found[2], found[3], done, sums, today) + found[4] if found[2] in BLOCKS else found[0]
    new = {page: BLOCK.sub(block, text) for page, text in texts.items()}
    drawn = [(ROOT / "build" / source, ROOT / "docs" / target) for name in done for source, target in SOURCES[name].pictures]
    for source, _ in drawn: # before anything is written
        if not source.exists():
            raise UserError("no picture", str(source.relative_to(ROOT)), "run `make readme`, which makes it")
    for page, text in new.items():
        if text != texts[page]:
            page.write_text(text, encoding="utf-8")
    for source, target in drawn:
        shutil.copy(source, target)


def parser() -> argparse.ArgumentParser:
    options = command_line.Parser(prog="python3 -m tools.docs.readme", description=__doc__.splitlines()[0])
    options.add_argument("names", nargs="*", help="tables or measurements; default: all but those that take an hour")
    options.add_argument("--check", action="store_true", help="write nothing: compare what takes seconds")
    options.add_argument("--compiler", action="store_true", help="there is one for the target")
    options.set_defaults(command=run)
    return options


def run(options: argparse.Namespace) -> int:
    blocks_of(pages()) # before hours of measuring
    sums = {kind: checksum(kind) for kind in PARTS}
    done, lines = measured(chosen(options.names, options.check, options.compiler, sums), options.check, bool(options.names), sums)
    if sums != {kind: checksum(kind) for kind in PARTS}:
        raise UserError("the sources have changed meanwhile", "make readme", "run it again")
    texts = pages()
    if not options.check:
        write(texts, done, sums)
        return 0
    if not options.compiler:
        print("not checked: size, cycles, longest path; there is no compiler for the target on PATH or at XC16=folder")
    lines += check(texts, done, sums)
    for line in lines:
        print(f"foc33: {line}", file=sys.stderr)
    return 1 if lines else 0


def main(arguments: list[str] | None = None) -> int:
    return command_line.main(parser, arguments)


if __name__ == "__main__":
    sys.exit(main())
