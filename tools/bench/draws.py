"""Drawn cases: each by seed and number, so that any of them can run again alone; an interrupted series goes on where it was.

A kind of series is a subclass of Series with what is its own. Each case that is over has its line in the folder OUT.part."""

import argparse
import functools
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.common import output, paths, workers
from tools.common.errors import UserError
from tools.common.progress import Progress
from . import long_run, page, picture, report
from .run import Run

PART_FILE, IDENTITY = "cases.jsonl", "identity.json"
MOST_NUMBER = 1_000_000
Tell = Callable[[float], None]


@dataclass
class Part:
    """What an unfinished series has: a line for each case that is over. `made_with`: firmware, tools and draw."""

    target: Path
    made_with: dict[str, Any]
    number: str
    """the key of a case's number"""

    @property
    def folder(self) -> Path:
        return self.target.resolve().with_name(f"{self.target.name}.part")

    def rows(self) -> dict[int, dict[str, Any]]:
        """The rows so far, by number; none if firmware, tools or draw have changed since."""
        known, lines, made_with = self.folder / IDENTITY, self.folder / PART_FILE, json.dumps(self.made_with)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if not known.is_file() or known.read_text(encoding="utf-8") != made_with:
                lines.unlink(missing_ok=True)
                known.write_text(made_with, encoding="utf-8")
            whole = lines.read_text(encoding="utf-8").splitlines(keepends=True) if lines.is_file() else []
        except OSError as error:
            raise UserError(f"cannot write '{self.folder}' ({error.strerror})", "--out", "choose a folder that can be written") from None
        rows = [json.loads(line) for line in whole if line.endswith("}\n")]
        return {row[self.number]: row for row in rows}

    def add(self, row: dict[str, Any]) -> None:
        """One more line, in one write: several processes do this at once."""
        file = os.open(self.folder / PART_FILE, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        os.write(file, f"\n{json.dumps(row)}\n".encode()) # what another one has left unfinished ends here
        os.close(file)

    def remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


@dataclass
class Series:
    """One series of cases, each with its `number`. Of its own a kind has

    prepared(options)  the series, ready to run, and its cases
    identity()         what the lines of an unfinished series must have been made with
    plans(cases)       scenarios that last as long as the longest, each with its header's parameters
    row(case, tell)    runs a case; in a process of its own, as the next two. tell(): so much more of its amount is done
    curves(case)       the run once more, for its picture; None without
    alone(case, folder)   one with its whole report: the summary, with "passed", and what is printed
    text(rows)         the table as printed
    is_bad(row), line(row)   whether a case is wrong, and what is said of it
    worst(rows)        those that the page shows, the worst first
    page(rows)         the summary, with title and "passed", and the page, to which the worst are added
    """

    seed: int
    benches: dict[Any, Any]

    name, about, what, unit, file = "", "", "case", "", "cases.csv"
    """`what` is one of them, and the key of its number; `unit` counts how far the series is"""
    keys, told, pages = (), 24, "index.html"
    """columns of the file; how many of the wrong ones are printed; the pages of a single one"""

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        """Adds the series to a command line's commands."""
        parser = commands.add_parser(cls.name, help=cls.about)
        parser.add_argument("--seed", type=int, default=1, help="of the draw; default 1")
        parser.add_argument("--case", type=int, nargs="+", metavar="NUMBER", help=f"these {cls.what}s alone; of a single one the whole report")
        parser.add_argument("--motor", nargs="+", metavar="NAME", help="motors to draw from; default: all of tuning/motors")
        parser.add_argument("--out", type=Path, help=f"result folder, replaced when complete; default build/{cls.name}/seed-SEED")
        parser.add_argument("--quiet", action="store_true", help="no progress bar")
        parser.set_defaults(command=cls.command)
        return parser

    @classmethod
    def numbers(cls, options: argparse.Namespace, flag: str, count: int) -> list[int]:
        """The numbers that are asked for; a count was given by `flag`."""
        for name, value in ((flag, count), ("--case", min(options.case or [1]))):
            if not 1 <= value <= MOST_NUMBER:
                raise UserError(f"{value} is no number of {cls.what}s or of a {cls.what}", name, f"choose 1 .. {MOST_NUMBER}")
        return sorted(set(options.case)) if options.case else list(range(1, count + 1))

    def amount(self, item: Any) -> float:
        """How far a case brings the series."""
        return 1.0

    @classmethod
    def command(cls, options: argparse.Namespace) -> int:
        """The whole command; returns the exit code."""
        series, items = cls.prepared(options)
        folder = f"seed-{options.seed}" + (f"-case-{min(options.case)}" if options.case else "")
        target = options.out or paths.ROOT / "build" / cls.name / folder
        if options.case and len(items) == 1:
            return series.run_alone(items[0], target)
        long_run.say(cls.name, [(plan.duration_s, functools.partial(long_run.reason, plan, params)) for plan, params in series.plans(items)])
        part = Part(target, series.identity(), cls.what)
        return series.finish(items, series.run(items, part, options.quiet), part)

    def run(self, items: list[Any], part: Part, quiet: bool) -> list[dict[str, Any]]:
        """The rows of all cases, in order; only what is missing runs."""
        known = part.rows()
        missing = [item for item in items if item.number not in known]
        if len(missing) < len(items):
            print(f"{len(items) - len(missing)} of {len(items)} {self.what}s are there already, {paths.shown(part.folder)}")
        with Progress(self.name, sum(map(self.amount, items)), quiet, self.unit) as progress:
            progress(sum(self.amount(item) for item in items if item.number in known))
            workers.run_all(missing, lambda item, tell: part.add(self.row(item, tell)), progress)
        found = part.rows()
        return [found[item.number] for item in items]

    def finish(self, items: list[Any], rows: list[dict[str, Any]], part: Part) -> int:
        """Leaves the results in their folder and says how it went; returns the exit code."""
        with output.ResultFolder(part.target) as folder:
            self.write(folder.work, items, rows)
        part.remove()
        print(self.text(rows))
        print(f"results in {paths.shown(part.target)}/: index.html")
        bad = [row for row in rows if self.is_bad(row)]
        for row in bad[:self.told]:
            print(self.line(row))
        return 1 if bad else 0

    def write(self, folder: Path, items: list[Any], rows: list[dict[str, Any]]) -> None:
        """Table, summary and page."""
        output.write_csv(folder / self.file, list(self.keys), [[row[key] for key in self.keys] for row in rows])
        summary, told = self.page(rows)
        output.write_summary(folder, report.clean(summary))
        by_number, shown = {item.number: item for item in items}, self.worst(rows)
        told.pictures = [workers.run_all([by_number[row[self.what]]], self._picture, lambda seconds: None)[0] for row in shown]
        cells = [page.Row(["-" if row[key] is None else str(row[key]) for key in self.keys], self.is_bad(row), number if told.pictures[number] else None)
                 for number, row in enumerate(shown)]
        told.before.append(page.Table(f"The worst {self.what}s", list(self.keys), cells))
        told.notes.append(f"make {self.name} CASE=number runs one of them again, with its whole report.")
        told.files = [self.file, output.SUMMARY]
        page.write(folder, told)

    def _picture(self, item: Any, tell: Tell) -> picture.Picture | None:
        run = self.curves(item)
        return run and picture.of(run, 4 * picture.SWEEP_STRETCHES)

    def run_alone(self, item: Any, target: Path) -> int:
        """One case and its report; returns the exit code."""
        with output.ResultFolder(target) as folder:
            data, text = workers.run_all([item], lambda item, tell: self.alone(item, folder.work), lambda seconds: None)[0]
            output.write_summary(folder.work, report.clean(data))
        print(text)
        print(f"results in {paths.shown(target)}/: {self.pages}")
        return 0 if data["passed"] else 1


def reported(run: Run, bench: Any, folder: Path) -> str:
    """The whole report of a run, in a folder and as text."""
    folder.mkdir(exist_ok=True)
    data = report.summary(run, [], str(bench.motor.path), str(bench.board.path))
    output.write_trace(folder / "trace.csv", run.trace)
    report.write_page(folder, run, [], data)
    return report.text(run, [], data)
