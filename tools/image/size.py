"""`make size`: flash, RAM and stack of the image by module and function, beside AN1292's figures, the budget and the last commit.

Program memory is counted as data sheets do, three bytes a word, without the vector tables and the compiler's start-up code. Exit status: 0, 1 when a budget is broken
(a line for each), 2 when the image or the compiler is missing."""

import argparse
import json
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from tools.common import command_line, paths
from tools.common.checksum import checksum
from tools.common.errors import UserError
from tools.common.progress import waiting

from . import attribution, base, stack
from .budget import UNASSIGNED, Budget, Share, Shares, shares
from .sources import Sources

OUT = paths.ROOT / "build" / "target"
LEVELS = [paths.ROOT / "include" / "board" / "mclv.h", *sorted((paths.ROOT / "firmware" / "board").glob("*.c"))]   # where interrupts get theirs
NOTE_TITLE = "as in AN1292"


@dataclass
class Row:
    """A line of the table. `kind`: function, module, group or total."""
    kind: str
    name: str
    group: str = ""
    module: str = ""
    note: int | None = None
    flash: int = 0
    budget: int | None = None
    goal: int | None = None
    flash_change: int | None = None
    ram: int = 0
    note_ram: int | None = None
    ram_budget: int | None = None
    ram_change: int | None = None
    copies: int = 0
    counted: bool = True     # in the whole image


@dataclass
class Report:
    rows: list[Row]
    stack: stack.Result
    budget: Budget
    base_name: str = ""       # commit compared with, "" without one
    no_base: str = ""         # why there is none
    broken: list[str] = field(default_factory=list)
    by_address: int | None = None   # what NOTE_TITLE takes when inlined code is told by its address alone


def deepest(image: attribution.Image, listing: str, budget: Budget, sources: list[Path] | None = None) -> stack.Result:
    """The deepest stack, with the levels that the interrupts get in the sources.
    @param listing the image's disassembly"""
    functions = {function.instructions[0].address: stack.plain(function.name) for function in stack.parse(listing)}
    handlers = {functions[address]: vectors for address, vectors in image.handlers.items() if address in functions}
    text = "".join(path.read_text(encoding="utf-8") for path in (LEVELS if sources is None else sources))
    result = stack.analyse(listing, image.entry, handlers, stack.priorities(text), budget.calls_nothing)
    if image.initial_calls:
        result.errors.append("the list of start values names a function to call")
    written = {word.address: word.chain[-1] for word in image.words}
    result.errors[:] = [re.sub(r"at 0x([0-9a-f]+)", lambda found: _placed(found, written), error) for error in result.errors]
    return result


def _placed(found: re.Match, written: dict[int, attribution.Frame]) -> str:
    """An address with the function that is written there: in the image it may be a part of another one."""
    frame = written.get(int(found[1], 16))
    return f"{found[0]}, {frame.name}() of {frame.file}" if frame and frame.file else found[0]


def measure(image: attribution.Image, depth: stack.Result, budget: Budget, before: Shares | None = None, limits: bool = True) -> Report:
    """All figures of an image.
    @param before shares of the image to compare with
    @param limits whether the budget is for this image"""
    now = shares(image, budget)
    report = Report(rows(now, before, budget), depth, budget)
    report.broken = broken(report, now, limits)
    return report


def note_bytes(now: Shares, budget: Budget) -> int:
    """Flash of what AN1292 does, too."""
    return next(row.flash for row in rows(now, None, budget) if row.name == NOTE_TITLE)


def rows(now: Shares, before: Shares | None, budget: Budget) -> list[Row]:
    """Functions and objects under their modules, modules under their groups, then the totals."""
    result, totals = [], []
    modules = [*budget.modules, UNASSIGNED]
    for group in [*budget.groups, None]:
        title = group.title if group else UNASSIGNED.name
        inside: list[Row] = []
        for module in (module for module in modules if module.group == (group.name if group else "")):
            keys = sorted({key for key in [*now, *(before or {})] if key[0] == module.name})
            below = [_row(key, title, now, before) for key in keys]
            below.sort(key=lambda row: (-row.flash, -row.ram, row.name))
            if below:
                inside += [_sum("module", module.name, title, below, budget=module.flash_budget), *below]
        if inside:
            total = _sum("group", title, title, [row for row in inside if row.kind == "module"], note=group.note_flash if group else None,
                         counted=group is None or group.counted)
            totals.append((total, group))
            result += [total, *inside]
    # what is not assigned counts as AN1292's until somebody says otherwise
    as_note = [row for row, group in totals if group is None or group.counted and group.note_flash is not None]
    known = [group.note_flash for group in budget.groups if group.counted and group.note_flash is not None]
    result.append(_sum("total", NOTE_TITLE, "", as_note, note=sum(known), budget=budget.note.flash, goal=budget.note.goal, note_ram=budget.note.ram,
                       ram_budget=budget.note.ram))
    result.append(_sum("total", "whole image", "", [row for row, group in totals if group is None or group.counted], budget=budget.image.flash, ram_budget=budget.image.ram))
    return result


def _row(key: tuple[str, str], group: str, now: dict, before: dict | None) -> Row:
    share, old = now.get(key, Share()), (before or {}).get(key, Share())
    known = before is not None
    return Row("function", key[1], group, key[0], flash=share.flash, ram=share.ram, copies=len(share.copies),
               flash_change=share.flash - old.flash if known else None, ram_change=share.ram - old.ram if known else None)


def _sum(kind: str, name: str, group: str, below: list[Row], **more) -> Row:
    def change(attribute: str) -> int | None:
        values = [getattr(row, attribute) for row in below]
        return None if not values or None in values else sum(values)
    return Row(kind, name, group, name if kind == "module" else "", flash=sum(row.flash for row in below),
               ram=sum(row.ram for row in below), flash_change=change("flash_change"), ram_change=change("ram_change"), **more)


def broken(report: Report, now: Shares, limits: bool) -> list[str]:
    """A line for each budget that does not hold, and for what no module of the budget file claims."""
    lines = []
    for row in report.rows:
        what = {NOTE_TITLE: "what AN1292 does, too"}.get(row.name, row.name)
        for memory, size, limit in (("flash", row.flash, row.budget), ("RAM", row.ram, row.ram_budget)):
            if limits and limit is not None and size > limit:
                lines.append(f"{memory}, {what}: {size} bytes, {size - limit} over the budget of {limit}")
    limit = report.budget.image.stack
    if limits and report.stack.depth > limit:
        lines.append(f"stack: {report.stack.depth} bytes at its deepest, {report.stack.depth - limit} over the budget of {limit}")
    lines += [f"stack: {error}" for error in report.stack.errors]
    lines += [f"'{name}' is counted with no module: name its file in firmware/budget.toml"
              for module, name in sorted(now) if module == UNASSIGNED.name]
    return lines


# ---- output --------------------------------------------------------------------------------------------------------------
HEAD = f"{'':<44}{'note':>7}{'flash':>7}{'budget':>8}{'change':>8}{'RAM':>7}{'budget':>8}{'change':>8}"


def _line(row: Row) -> str:
    indent = {"group": "", "module": "  ", "function": "    ", "total": ""}[row.kind]
    name = indent + row.name + (f" ({row.copies} copies)" if row.copies > 1 else "")
    return (f"{name:<44}{_number(row.note)}{row.flash:>7}{_number(row.budget, 8)}{_change(row.flash_change)}"
            f"{row.ram:>7}{_number(row.ram_budget, 8)}{_change(row.ram_change)}").rstrip()


def _number(value: int | None, width: int = 7) -> str:
    return f"{'' if value is None else value:>{width}}"


def _change(value: int | None) -> str:
    return f"{'' if value is None else '.' if value == 0 else f'{value:+d}':>8}"


def text(report: Report) -> str:
    """The tables for a terminal; the sums come last, where the eye is."""
    lines = [HEAD, *(_line(row) for row in report.rows if row.kind != "total"), "",
             "deepest stack, bytes" + " " * 21 + "adds  so far", *stack.table(report.stack), ""]
    changed = [row for row in report.rows if row.kind == "function" and (row.flash_change or row.ram_change)]
    if changed:
        lines += [f"changed since {report.base_name}", *(_line(row) for row in changed), ""]
    lines += [HEAD, *(_line(row) for row in report.rows if row.kind != "function")]
    lines.append(f"{'stack':<44}{'':>7}{'':>7}{'':>8}{'':>8}{report.stack.depth:>7}{report.budget.image.stack:>8}")
    lines.append("bytes; flash is 3 bytes a word; AN1292 is at its -O3; not counted: vector tables, configuration words, and on both sides the start-up code")
    lines.append("inlined code is its source line's function" + ("" if report.by_address is None else
                                                                 f"; by its address alone '{NOTE_TITLE}' is {report.by_address} bytes"))
    lines.append(f"change: since {report.base_name}" if report.base_name else f"no column for the change: {report.no_base}")
    return "\n".join(lines)


def summary(report: Report) -> dict:
    """What size.json holds."""
    return {"rows": [vars(row) for row in report.rows], "stack_bytes": report.stack.depth, "stack_budget_bytes": report.budget.image.stack,
            "stack": [{"priority": 0, "steps": report.stack.main.steps}] +
                     [{"priority": level.priority, "steps": level.chain.steps} for level in report.stack.levels],
            "by_address_bytes": report.by_address, "base": report.base_name or None, "broken": report.broken}


def write_json(data: dict, folder: Path, name: str) -> Path:
    """folder/name.json."""
    path = folder / f"{name}.json"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise UserError(f"cannot write to '{folder}' ({error.strerror})", "--out", "choose a folder that can be written") from None
    return path


def told(data: dict, folder: Path, name: str, report: str) -> int:
    """Writes folder/name.json, prints the report and a line for each of data["broken"].
    @return exit status, 1 when something is broken"""
    path = write_json(data, folder, name)
    print(report)
    print(f"written: {paths.shown(path)}")
    for line in data["broken"]:
        print(f"foc33: {line}", file=sys.stderr)
    return 1 if data["broken"] else 0


def readme_table(data: dict) -> tuple[list[str], list[list[str]]]:
    """Head and rows of the README's table, from what size.json holds."""
    def budget(row: dict) -> str:
        return _number(row["budget"], 0) + (f" (goal {row['goal']})" if row["goal"] is not None else "")
    body = [[row["name"], _number(row["note"], 0), _number(row["flash"], 0), budget(row), *(_number(row[key], 0) for key in ("note_ram", "ram", "ram_budget"))]
            for row in data["rows"] if row["kind"] in ("group", "total") and row["counted"]]
    body.insert(next(i for i, row in enumerate(body) if row[0] == NOTE_TITLE) + 1,
                ["the same, inlined code by its address alone", "", str(data["by_address_bytes"]), "", "", "", ""])
    body.append(["stack at its deepest", "", "", "", "", str(data["stack_bytes"]), str(data["stack_budget_bytes"])])
    return ["bytes", "AN1292: flash", "flash", "budget", "AN1292: RAM", "RAM", "budget"], body


# ---- command line --------------------------------------------------------------------------------------------------------
def compare(variables: list[str], budget: Budget) -> tuple[Shares | None, str, str]:
    """Shares of the last commit's image and the commit's name, or None and why there is nothing to compare with."""
    try:
        commit = base.commit()
        return shares(attribution.read(base.build(commit, variables)), budget), commit[:7], ""
    except base.NoBase as reason:
        return None, "", str(reason)


def disassemble(objdump: str, elf: Path) -> str:
    words = shlex.split(objdump)
    if shutil.which(words[0]) is None:
        raise UserError(f"no {words[0]}", "PATH", "install Microchip's XC16, or say where it is with XC16=folder")
    done = subprocess.run([*words, "-d", "-z", str(elf)], capture_output=True, text=True, errors="replace", check=False)
    if done.returncode != 0:
        raise UserError(f"{words[0]} failed ({' '.join(done.stderr.split())})", str(paths.shown(elf)),
                        "build the image anew with `make firmware`")
    return done.stdout


def main(arguments: list[str] | None = None) -> int:
    parser = command_line.Parser(prog="python3 -m tools.image.size", description=__doc__.splitlines()[0])
    parser.add_argument("elf", type=Path, nargs="?", default=OUT / "foc33.elf")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for size.json")
    parser.add_argument("--objdump", default="xc16-objdump")
    parser.add_argument("--base", nargs="*", metavar="NAME=VALUE",
                        help="compare with the last commit's image, built by make with these variables")
    parser.add_argument("--no-budget", action="store_true", help="another mode or optimisation than the budget is for")
    return command_line.run(lambda: _run(parser.parse_args(arguments)))


def _run(options: argparse.Namespace) -> int:
    budget = Budget.read()
    with waiting("reading the image"):
        listing, image = disassemble(options.objdump, options.elf), attribution.read(options.elf)
    before, name, reason = (None, "", "not asked for (--base)") if options.base is None else compare(options.base, budget)
    with waiting("measuring the image"):
        report = measure(image, deepest(image, listing, budget), budget, before, not options.no_budget)
        report.by_address = note_bytes(shares(attribution.read(options.elf, by_lines=False), budget), budget)
    report.base_name, report.no_base = name, reason
    report.broken += budget.unmatched(Sources.read(), image)
    sources = {} if options.no_budget else {"sources": checksum("image")}
    return told(summary(report) | sources, options.out, "size", text(report))


if __name__ == "__main__":
    sys.exit(main())
