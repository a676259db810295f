"""`campaign`: faults drawn by seed, each against the same run without it: how many end in silence, what the others end in, and how soon.

What may break is in injection.py, what counts as wrong in judge.py."""

import argparse
import re
import statistics
import zlib
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tools.common import board_file, motor_file, paths
from tools.common.errors import UserError
from tools.image import load

from . import build, command_common, draws, injection, judge, memory, page, pil, pil_command, trial
from .run import Run
from .scenario import Scenario
from .trial import Bench

HEADERS = paths.ROOT / "build" / "campaign" / "headers"
KEYS = ("case", "kind", "size", "place", "scene", "state", "phase", "motor", "load", "over_s", "lasts_s", "at_s", "class", "code", "after_s",
        "speed_error_percent", "current_peak_a", "why")
BAD = (judge.SILENT, judge.VOID)
WORST = 24
"""Cases whose curves the page has."""
LIVE_ZERO = 0.05
"""POT_LIVE_ZERO of all cases but those of the image."""


@dataclass
class Campaign(draws.Series):
    """The series."""

    name, about, unit = "campaign", "injected faults: which are ridden through, which stop the motor, which are silent", "cases"
    keys, told, pages = KEYS, WORST, "index.html, without/index.html"

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = super().add_command(commands)
        parser.add_argument("--count", type=int, default=2000, metavar="N", help="how many cases; default 2000")
        parser.add_argument("--kind", metavar="TEXT", help="only cases whose kind has this text, as \"sensors\" or \"bus gain\"")
        return parser

    @classmethod
    def prepared(cls, options: argparse.Namespace) -> tuple["Campaign", list[injection.Case]]:
        numbers = cls.numbers(options, "--count", options.count)
        benches = prepared(options.motor or paths.names(paths.MOTORS))
        motors = sorted(name for name in benches if name != injection.IMAGE)
        cases = [injection.draw(options.seed, number, motors) for number in numbers]
        cases = [case for case in cases if not options.kind or options.kind in case.kind]
        if not cases:
            raise UserError(f"no case has '{options.kind}' in its kind", "--kind", "write a part of one, as " + ", ".join(dict.fromkeys(kind.room for kind in injection.KINDS)))
        if left_out := [case for case in cases if case.what.room == injection.IMAGE and injection.IMAGE not in benches]:
            print(f"{len(left_out)} of {len(cases)} cases hit flash, stack and RAM of the image: left out, there is no XC16 (make firmware says how to get it)")
            cases = [case for case in cases if case not in left_out]
        return cls(options.seed, benches), cases

    def bench(self, item: injection.Case) -> Bench:
        """What a case runs on."""
        return self.benches[injection.IMAGE if item.what.room == injection.IMAGE else item.motor]

    def identity(self) -> dict[str, Any]:
        tools = (paths.ROOT / "tools" / "bench" / f"{name}.py" for name in ("injection", "judge", "trial", "memory"))
        firmware = {name: [zlib.crc32(path.read_bytes()) for path in (bench.library.path, bench.image) if path] for name, bench in sorted(self.benches.items())}
        return {"seed": self.seed, "tools": [zlib.crc32(path.read_bytes()) for path in tools], "firmware": firmware}

    def plans(self, items: list[injection.Case]) -> list[tuple[Scenario, dict[str, float]]]:
        """One for each motor and scene."""
        ways = [(trial.scene(item, self.bench(item)), self.bench(item)) for item in {(item.motor, item.scene): item for item in items}.values()]
        return [(replace(way.scenario, duration_s=way.end_s + judge.JUDGE_S), bench.library.params) for way, bench in ways]

    def row(self, item: injection.Case, tell: draws.Tell) -> dict[str, Any]:
        row = trial.run(item, self.bench(item)).row()
        tell(1.0)
        return row

    def alone(self, item: injection.Case, folder: Path) -> tuple[dict[str, Any], str]:
        """Once more without the fault beside it."""
        bench, done = self.bench(item), trial.run(item, self.bench(item))
        row, text = done.row(), draws.reported(done.with_fault or done.without, bench, folder)
        draws.reported(done.without, bench, folder / "without")
        return {"title": f"case {item.number}, seed {self.seed}", "passed": not self.is_bad(row), "row": row, "text": text}, f"{text}\n\n{self.line(row)}"

    def curves(self, item: injection.Case) -> Run | None:
        return trial.run(item, self.bench(item)).with_fault

    def is_bad(self, row: dict[str, Any]) -> bool:
        return row["class"] in BAD

    def line(self, row: dict[str, Any]) -> str:
        return f"{row['class']}: {line(row)}"

    def text(self, rows: list[dict[str, Any]]) -> str:
        lines = [list(HEAD), *shares(rows)]
        widths = [max(len(cells[column]) for cells in lines) for column in range(len(HEAD))]
        return "\n".join("  ".join([cells[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(cells[1:], widths[1:]))]) for cells in lines)

    def worst(self, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return worst(rows)

    def page(self, rows: list[dict[str, Any]]) -> tuple[dict[str, Any], page.Page]:
        counts, table = Counter(row["class"] for row in rows), shares(rows)
        passed, title = not any(map(self.is_bad, rows)), f"{len(rows)} injected faults, seed {self.seed}"
        by_kind = page.Table("How they ended", list(HEAD), [page.Row(cells, cells[2 + judge.CLASSES.index(judge.SILENT)] != "0") for cells in table])
        by_scene = page.Table("By what the drive was doing", ["scene", *HEAD[1:]], [
            page.Row(_share(scene, own)) for scene in injection.SCENES if (own := [row for row in rows if row["scene"] == scene])])
        verdict = "; ".join(f"{counts[name]} {name}" for name in (*judge.CLASSES, *([judge.VOID] if counts[judge.VOID] else [])))
        summary = {"title": title, "passed": passed, "classes": {name: counts[name] for name in judge.CLASSES},
                   "by_kind": [dict(zip(HEAD, cells)) for cells in table]}
        return summary, page.Page(f"campaign: {title}", passed, verdict, [], [by_kind], after=[by_scene])


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
    copy = HEADERS / header.name / build.HEADER
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
