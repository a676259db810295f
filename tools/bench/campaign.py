"""`campaign`: faults drawn by seed, each against the same run without it: how many end in silence, what the others end in, and how soon.

What may break is in injection.py, what counts as wrong in judge.py. An interrupted campaign goes on where it was: each case that is over has its
line in the folder OUT.part."""

import argparse
import csv
import json
import os
import re
import shutil
import statistics
import zlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.common import board_file, motor_file, output, paths, workers
from tools.common.errors import UserError
from tools.common.progress import Progress
from tools.image import load

from . import build, command_common, injection, judge, memory, page, picture, pil, pil_command, report, trial
from .trial import Bench

RESULTS = paths.ROOT / "build" / "campaign"
KEYS = ("case", "kind", "size", "place", "scene", "state", "phase", "motor", "load", "over_s", "lasts_s", "at_s", "class", "code", "after_s",
        "speed_error_percent", "current_peak_a", "why")
CASES, PART_FILE, IDENTITY = "cases.csv", "cases.csv", "identity.json"
BAD = (judge.SILENT, judge.VOID)
WORST = 24
"""Cases whose curves the page has."""
MOST_CASES = 1_000_000
LIVE_ZERO = 0.05
"""POT_LIVE_ZERO of all cases but those of the image."""


def add_command(commands: Any) -> None:
    """Adds `campaign` to a command line's commands."""
    parser = commands.add_parser("campaign", help="injected faults: which are ridden through, which stop the motor, which are silent")
    parser.add_argument("--count", type=int, default=2000, metavar="N", help="how many cases; default 2000")
    parser.add_argument("--seed", type=int, default=1, help="of the draw; default 1")
    parser.add_argument("--case", type=int, nargs="+", metavar="NUMBER", help="these cases alone; of a single one the whole report")
    parser.add_argument("--motor", nargs="+", metavar="NAME", help="motors to draw from; default: all of tuning/motors")
    parser.add_argument("--kind", metavar="TEXT", help="only cases whose kind has this text, as \"sensors\" or \"bus gain\"")
    parser.add_argument("--out", type=Path, help="result folder, replaced when complete; default build/campaign/seed-SEED")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    numbers = numbers_of(options)
    benches = prepared(options.motor or paths.names(paths.MOTORS))
    motors = sorted(name for name in benches if name != injection.IMAGE)
    cases = [injection.draw(options.seed, number, motors) for number in numbers]
    cases = [case for case in cases if not options.kind or options.kind in case.kind]
    if not cases:
        raise UserError(f"no case has '{options.kind}' in its kind", "--kind", "write a part of one, as " + ", ".join(dict.fromkeys(kind.room for kind in injection.KINDS)))
    if left_out := [case for case in cases if case.what.room == injection.IMAGE and injection.IMAGE not in benches]:
        print(f"{len(left_out)} of {len(cases)} cases hit flash, stack and RAM of the image: left out, there is no XC16 (make firmware says how to get it)")
        cases = [case for case in cases if case not in left_out]
    target = options.out or RESULTS / (f"seed-{options.seed}" + (f"-case-{numbers[0]}" if options.case else ""))
    if options.case and len(cases) == 1:
        return _alone(cases[0], bench_of(cases[0], benches), target)
    part = Part(target, identity(benches, options.seed))
    known = part.rows()
    missing = [case for case in cases if case.number not in known]
    if len(missing) < len(cases):
        print(f"{len(cases) - len(missing)} of {len(cases)} cases are there already, {paths.shown(part.folder)}")
    with Progress("campaign", len(cases), options.quiet, "cases") as progress:
        progress(len(cases) - len(missing))
        workers.run_all(missing, lambda case, tell: _one(case, benches, part, tell), progress)
    found = part.rows()
    rows = [found[case.number] for case in cases]
    with output.ResultFolder(target) as folder:
        write(folder.work, rows, options.seed, lambda row: _picture(cases, row, benches))
    part.remove()
    print(text(rows))
    print(f"results in {paths.shown(target)}/: index.html")
    bad = [row for row in rows if row["class"] in BAD]
    for row in bad[:WORST]:
        print(f"{row['class']}: {line(row)}")
    return 1 if bad else 0


def numbers_of(options: argparse.Namespace) -> list[int]:
    """The numbers of the cases that were asked for."""
    for flag, value in (("--count", options.count), ("--case", min(options.case or [1]))):
        if not 1 <= value <= MOST_CASES:
            raise UserError(f"{value} is no number of cases or of a case", flag, f"choose 1 .. {MOST_CASES}")
    return sorted(set(options.case)) if options.case else list(range(1, options.count + 1))


def prepared(names: list[str]) -> dict[str, Bench]:
    """Every motor with the firmware of its own header, by name. The potentiometer has live ends: of one that goes from rail to rail no firmware can tell
    a broken wire from a turned knob."""
    result = {}
    for name in names:
        motor = motor_file.load(name, "--motor")
        library = command_common.library_for([], None, with_live_zero(command_common.tuned_header(motor.path, None)))
        result[motor.name] = Bench(motor_file.part(str(motor.path)), board_file.part(*board_file.named(motor, None)), library, memory.variables(library))
    if build.make("find-xc16", [], None).returncode == 0:
        result[injection.IMAGE] = _with_image()
    return result


def with_live_zero(header: Path) -> Path:
    """A copy of a header whose potentiometer has dead ends."""
    text, found = re.subn(r"(?m)^(#define POT_LIVE_ZERO +)\S+", rf"\g<1>{LIVE_ZERO}", (header / build.HEADER).read_text(encoding="utf-8"))
    if not found:
        raise UserError("POT_LIVE_ZERO is missing", str(paths.shown(header / build.HEADER)), "write it anew with make tune")
    copy = RESULTS / "headers" / header.name / build.HEADER
    copy.parent.mkdir(parents=True, exist_ok=True)
    if not copy.is_file() or copy.read_text(encoding="utf-8") != text:
        copy.write_text(text, encoding="utf-8")
    return copy.parent


def _with_image() -> Bench:
    """The project's own image in the simulator."""
    image = pil_command.image_for([], None, None)
    motor = motor_file.load(injection.IMAGE_MOTOR)
    return Bench(motor_file.part(str(motor.path)), board_file.part(*board_file.named(motor, None)), pil.library([]), [], image,
                 memory.stack_start(load.load(image)))


def bench_of(case: injection.Case, benches: dict[str, Bench]) -> Bench:
    """What a case runs on."""
    return benches[injection.IMAGE if case.what.room == injection.IMAGE else case.motor]


def identity(benches: dict[str, Bench], seed: int) -> dict[str, Any]:
    """What the lines of an unfinished campaign must have been made with: firmware, tools and draw."""
    tools = (paths.ROOT / "tools" / "bench" / f"{name}.py" for name in ("injection", "judge", "trial", "memory"))
    firmware = {name: [zlib.crc32(path.read_bytes()) for path in (bench.library.path, bench.image) if path] for name, bench in sorted(benches.items())}
    return {"seed": seed, "tools": [zlib.crc32(path.read_bytes()) for path in tools], "firmware": firmware}


@dataclass
class Part:
    """What an unfinished campaign has: a line for each case that is over."""

    target: Path
    made_with: dict[str, Any]
    keys: tuple[str, ...] = KEYS
    number: str = "case"

    @property
    def folder(self) -> Path:
        return self.target.resolve().with_name(f"{self.target.name}.part")

    def rows(self) -> dict[int, dict[str, Any]]:
        """The rows so far, by number; none if firmware, tools or draw have changed since."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            known = self.folder / IDENTITY
            if not known.is_file() or known.read_text(encoding="utf-8") != json.dumps(self.made_with):
                (self.folder / PART_FILE).unlink(missing_ok=True)
                known.write_text(json.dumps(self.made_with), encoding="utf-8")
            if not (self.folder / PART_FILE).is_file():
                return {}
            with (self.folder / PART_FILE).open(encoding="utf-8", newline="") as file:
                whole = [cells for cells in csv.reader(file) if len(cells) == len(self.keys) + 1 and cells[-1] == "end"]
        except OSError as error:
            raise UserError(f"cannot write '{self.folder}' ({error.strerror})", "--out", "choose a folder that can be written") from None
        rows = [{key: json.loads(cell) for key, cell in zip(self.keys, cells)} for cells in whole]
        return {row[self.number]: row for row in rows}

    def add(self, row: dict[str, Any]) -> None:
        """One more line, in one write: several processes do this at once."""
        cells = [json.dumps(row[key]).replace('"', '""') for key in self.keys]
        data = ",".join(f'"{cell}"' for cell in [*cells, "end"]) + "\n"
        file = os.open(self.folder / PART_FILE, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        os.write(file, data.encode())
        os.close(file)

    def remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


def _one(case: injection.Case, benches: dict[str, Bench], part: Part, tell: Callable[[float], None]) -> None:
    part.add(trial.run(case, bench_of(case, benches)).row())
    tell(1.0)


def _alone(case: injection.Case, bench: Bench, target: Path) -> int:
    """One case with its whole report, once more without the fault beside it."""
    with output.ResultFolder(target) as folder:
        data = workers.run_all([case], lambda case, tell: _report(case, bench, folder.work), lambda seconds: None)[0]
        output.write_summary(folder.work, report.clean(data))
    print(data["text"])
    print(f"\n{data['row']['class']}: {line(data['row'])}")
    print(f"results in {paths.shown(target)}/: index.html, without/index.html")
    return 1 if data["row"]["class"] in BAD else 0


def _report(case: injection.Case, bench: Bench, folder: Path) -> dict[str, Any]:
    done = trial.run(case, bench)
    row = done.row()
    shown = done.with_fault or done.without
    for run, place in ((shown, folder), (done.without, folder / "without")):
        place.mkdir(exist_ok=True)
        data = report.summary(run, [], str(bench.motor.path), str(bench.board.path))
        output.write_trace(place / "trace.csv", run.trace)
        report.write_page(place, run, [], data)
    return {"row": row, "text": report.text(shown, [], report.summary(shown, [], row["motor"], ""))}


def _picture(cases: list[injection.Case], row: dict[str, Any], benches: dict[str, Bench]) -> picture.Picture | None:
    """The curves of a case, which is run again for them."""
    case = next(case for case in cases if case.number == row["case"])

    def work(case: injection.Case, tell: Callable[[float], None]) -> picture.Picture | None:
        run = trial.run(case, bench_of(case, benches)).with_fault
        return run and picture.of(run, 4 * picture.SWEEP_STRETCHES)
    return workers.run_all([case], work, lambda seconds: None)[0]


def worst(rows: list[dict[str, Any]], most: int = WORST) -> list[dict[str, Any]]:
    """The silent ones, one of each kind first; then the slowest stops."""
    silent = [row for row in rows if row["class"] in BAD]
    seen: Counter[str] = Counter()
    ranked = []
    for row in silent:
        ranked.append((seen[row["kind"]], row["case"], row))
        seen[row["kind"]] += 1
    first = [row for _, _, row in sorted(ranked, key=lambda item: item[:2])]
    late = sorted((row for row in rows if row["class"] in (judge.RIGHT, judge.ANOTHER) and row["after_s"] is not None), key=lambda row: -row["after_s"])
    return (first + late)[:most]


def line(row: dict[str, Any]) -> str:
    """A case in one line."""
    end = row["code"] and f"{row['code']}" + ("" if row["after_s"] is None else f" after {row['after_s']:.4f} s")
    where = f"{row['motor']}, {row['scene']} ({row['state']}), slow phase {row['phase']}"
    return ", ".join(filter(None, (f"case {row['case']}", f"{row['kind']} {row['size']:g} {row['place']}".rstrip(), where, end, row["why"])))


HEAD = ("kind", "cases", *judge.CLASSES, "detected, median s", "worst s")


def shares(rows: list[dict[str, Any]]) -> list[list[str]]:
    """A line for each kind, then for all: how many ended how, and how soon the stops came."""
    kinds = sorted({row["kind"] for row in rows}, key=list(injection.BY_NAME).index)
    return [_share(kind, [row for row in rows if row["kind"] == kind]) for kind in kinds] + [_share("all", rows)]


def _share(name: str, rows: list[dict[str, Any]]) -> list[str]:
    counts = Counter(row["class"] for row in rows)
    times = [row["after_s"] for row in rows if row["after_s"] is not None]
    soon = [f"{statistics.median(times):.4f}", f"{max(times):.4f}"] if times else ["-", "-"]
    return [name, f"{len(rows)}", *(f"{counts[outcome]}" for outcome in judge.CLASSES), *soon]


def text(rows: list[dict[str, Any]]) -> str:
    """The table as printed."""
    lines = [list(HEAD), *shares(rows)]
    widths = [max(len(cells[column]) for cells in lines) for column in range(len(HEAD))]
    return "\n".join("  ".join([cells[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(cells[1:], widths[1:]))]) for cells in lines)


def write(folder: Path, rows: list[dict[str, Any]], seed: int, draw: Callable[[dict[str, Any]], picture.Picture | None]) -> None:
    """The table, the summary and the page."""
    output.write_csv(folder / CASES, list(KEYS), [[row[key] for key in KEYS] for row in rows])
    counts = Counter(row["class"] for row in rows)
    passed, title = not any(counts[name] for name in BAD), f"{len(rows)} injected faults, seed {seed}"
    output.write_summary(folder, report.clean({"title": title, "passed": passed, "classes": {name: counts[name] for name in judge.CLASSES},
                                               "by_kind": [dict(zip(HEAD, cells)) for cells in shares(rows)]}))
    shown = worst(rows)
    pictures = [draw(row) for row in shown]
    by_kind = page.Table("How they ended", list(HEAD), [page.Row(cells, cells[2 + judge.CLASSES.index(judge.SILENT)] != "0") for cells in shares(rows)])
    by_scene = page.Table("By what the drive was doing", ["scene", *HEAD[1:]], [
        page.Row(_share(scene, [row for row in rows if row["scene"] == scene])) for scene in injection.SCENES if any(row["scene"] == scene for row in rows)])
    cells = [page.Row([str(row[key] if row[key] is not None else "-") for key in KEYS], row["class"] in BAD, number if pictures[number] else None)
             for number, row in enumerate(shown)]
    page.write(folder, page.Page(f"campaign: {title}", passed,
                                 "; ".join(f"{counts[name]} {name}" for name in (*judge.CLASSES, *([judge.VOID] if counts[judge.VOID] else []))),
                                 ["make campaign CASE=number runs one of them again, with its whole report."],
                                 [by_kind, page.Table("The worst", list(KEYS), cells)], pictures, [by_scene], [], [CASES, output.SUMMARY]))
