"""A sweep: a table of what is asked, a case for each row, all of them run side by side, then verdicts, the printed table and the result folder.

A kind of sweep is a subclass of Sweep with what is its own."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

from tools.common import motor_file, output, paths, workers
from tools.common.board_keys import Part
from tools.common.errors import UserError
from tools.common.progress import Progress
from tools.common.toml_file import Document
from tools.common.trace import MOST_ROWS
from . import case, command_common, long_run, report, simulate
from .board import Library
from .expect import Outcome
from .run import Run

QUICKEST_HZ = 40e3
"""Rows a second of motor time, at most."""


def within(minimum: float, maximum: float = float("inf")) -> Any:
    """A number of a Table, or a list of numbers, between these bounds."""
    return field(metadata={"minimum": minimum, "maximum": maximum})


@dataclass(kw_only=True)
class AnyMotorTable:
    """What a sweep asks for, from scenarios/tables/NAME.toml. Every field is a key there, but those that end with "where": they tell
    where the others were read."""

    title: str
    board: str
    where: str
    board_where: str

    @classmethod
    def read(cls, path: Path) -> Any:
        """Check the whole file and return what it says."""
        document = Document(path)
        root, values = document.root, {"where": document.label}
        for item in fields(cls):
            if item.name.endswith("_where"):
                values[item.name] = root.where(item.name.removesuffix("_where"))
            elif item.name != "where":
                read = {str: root.text, float: root.number}.get(item.type, root.numbers)
                values[item.name] = read(item.name, **item.metadata)
        root.close()
        return cls(**values)

    def same_lengths(self, *names: str) -> None:
        """Refuses columns of different lengths."""
        if len({len(getattr(self, name)) for name in names}) > 1:
            raise UserError("columns of different lengths", getattr(self, f"{names[0]}_where"),
                            f"give {', '.join(names[:-1])} and {names[-1]} as many numbers each")


@dataclass(kw_only=True)
class Table(AnyMotorTable):
    """A table that is for a motor."""

    motor: str
    motor_where: str

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> Any:
        """The table for another motor than its own."""
        return self


@dataclass(kw_only=True)
class Loaded:
    """The times of case.loaded_run()."""

    start_s: float = within(0.01, 60.0)
    settle_s: float = within(0.01, 60.0)
    torque_over_s: float = within(0.01, 60.0)
    measure_s: float = within(0.01, 60.0)


@dataclass
class Sweep:
    """One sweep. Of its own a kind has, beside what differs from the following,

    cases()            what runs, in order
    job(case)          a case, ready to run
    check(case, row)   what must hold for its row: Outcomes
    """

    table: Any
    motor: Part | None = None
    board: Part | None = None
    library: Library | None = None
    used: dict[str, Any] = field(default_factory=dict)
    """command_common.used()"""
    quiet: bool = True
    outcomes: list[Outcome] = field(default_factory=list)

    name, about, kind_of_table, defines = "", "", Table, ()
    columns: ClassVar[Any] = ()
    """as printed: key, heading, format"""
    keys: ClassVar[Any] = ()
    """of the CSV file"""

    @property
    def params(self) -> dict[str, float]:
        return self.library.params

    @classmethod
    def read(cls, options: argparse.Namespace) -> Any:
        """The table that is asked for."""
        return cls.kind_of_table.read(paths.TABLES / f"{cls.name}.toml")

    @classmethod
    def folder(cls, options: argparse.Namespace) -> str:
        """The name of its result folder, without motor, board and header."""
        return cls.name

    def ask(self, options: argparse.Namespace) -> None:
        """Takes what else the command line says."""

    def measured(self, run: Run, item: Any) -> dict[str, Any]:
        """What is read from a case's run, in the process that ran it."""
        return case.reduced(run)

    def row(self, item: Any, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        """A row of the table, without its verdict."""
        return result

    def verdict(self, item: Any, row: dict[str, Any]) -> str:
        """"ok", or the first thing that does not hold; "" for a kind that has Outcomes only."""
        return ""

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        """What else goes into the summary: pictures, and what is found out after the cases."""
        return {}

    def head(self) -> dict[str, Any]:
        """What the summary begins with."""
        return {"title": self.table.title, **self.used}

    def title(self, rows: list[dict[str, Any]]) -> str:
        return self.table.title

    def text(self, rows: list[dict[str, Any]]) -> str:
        """The printed table."""
        return report.table(rows, self.columns)

    def told(self, rows: list[dict[str, Any]]) -> str:
        """All that is printed of the results."""
        return f"{self.title(rows)}\n\n{report.used_text(self.used)}\n\n{self.text(rows)}"

    def results(self, title: str, jobs: list[simulate.Job]) -> list[dict[str, Any]]:
        """What was measured, in the order of the jobs."""
        return run_cases(title, jobs, self.quiet, self._work)

    def _work(self, job: simulate.Job, tell: Callable[[float], None]) -> dict[str, Any]:
        return self.measured(simulate.simulate(job, tell), job.case)

    def run(self, items: Sequence[Any], title: str) -> list[dict[str, Any]]:
        """The rows of these cases, in order."""
        jobs = [self.job(item) for item in items]
        for job, item in zip(jobs, items):
            job.case = item
        rows = [self.row(item, job, result) for item, job, result in zip(items, jobs, self.results(title, jobs))]
        return [row | ({"verdict": verdict} if (verdict := self.verdict(item, row)) else {}) for item, row in zip(items, rows)]

    def finish(self, target: Path) -> int:
        """Runs all of it, leaves the results in their folder and says how it went; returns the exit code."""
        with output.ResultFolder(target) as folder:
            items = self.cases()
            rows = self.run(items, self.name)
            self.outcomes = [outcome for item, row in zip(items, rows) for outcome in self.check(item, row)] + self.outcomes
            more = self.more(rows, folder.work)
            report.write_table(folder.work, self.name, self.keys, rows, self.outcomes, self.head(), more)
        print(self.told(rows))
        print(f"\nresults in {paths.shown(target)}/: index.html")
        return command_common.verdict(self.name, self.outcomes)

    @classmethod
    def command(cls, options: argparse.Namespace) -> int:
        """The whole command; returns the exit code."""
        table = cls.read(options)
        motor, board, library, used = command_common.set_up(table, options, list(cls.defines))
        target = command_common.results(cls.folder(options), table.motor, options)
        if motor.path.stem != table.motor:
            table = table.for_motor(motor_file.load(str(motor.path)), library.params)
        sweep = cls(table, motor, board, library, used, options.quiet)
        sweep.ask(options)
        return sweep.finish(target)

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        """Adds the sweep to a command line's commands."""
        parser = commands.add_parser(cls.name, help=cls.about)
        command_common.add_options(parser, cls.name)
        parser.set_defaults(command=cls.command)
        return parser


def side_by_side(jobs: list[simulate.Job]) -> int:
    """How many of the jobs may run at once: as many as there are processors, but of long ones only two, for their traces take 0.3 GB each."""
    rows = min(MOST_ROWS, max((job.scenario.duration_s for job in jobs), default=0.0) * QUICKEST_HZ)
    return max(1, min(workers.processors(), int(2 * MOST_ROWS / max(rows, 1.0))))


def run_cases(title: str, jobs: list[simulate.Job], quiet: bool, work: Callable[..., Any]) -> list[Any]:
    """What `work` makes of each job, in order."""
    long_run.say(title, [(job.scenario.duration_s, lambda job=job: job.long) for job in jobs])
    with Progress(title, sum(job.scenario.duration_s for job in jobs), quiet) as progress:
        return workers.run_all(jobs, work, progress, side_by_side(jobs))
