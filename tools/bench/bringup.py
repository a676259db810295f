"""`bringup`: the BRINGUP firmware on the right board and on every miswired one of tables/bringup.toml: what it says, and whether that is it."""

import argparse
import difflib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tools.common import board_keys, paths, workers
from tools.common.board_keys import Values
from tools.common.errors import UserError
from tools.common.progress import Progress
from tools.common.toml_file import Document
from . import bringup_user, command_common, sweep
from .board import Board, BoardError, Library
from .expect import Outcome
from .scenario import param

MODE = "BRINGUP"
USUAL_S = 25.0
"""Of motor time, for the progress bar."""


@dataclass(frozen=True)
class Variant:
    """A board, and what BRINGUP has to find on it."""

    name: str
    title: str
    keys: Values
    finds: list[str]


@dataclass(frozen=True)
class Table:
    """tables/bringup.toml."""

    title: str
    motor: str
    motor_where: str
    board: str
    board_where: str
    variants: list[Variant]


def read(path: Path = paths.TABLES / "bringup.toml") -> Table:
    """The whole file, checked."""
    root = Document(path).root
    variants = []
    for section in root.sections("variant"):
        keys = section.section("set")
        variants.append(Variant(section.text("name"), section.text("title"), Values.from_section(keys), section.texts("finds", [])))
        section.close()
    table = Table(root.text("title"), root.text("motor"), root.where("motor"), root.text("board"), root.where("board"), variants)
    root.close()
    return table


@dataclass
class Job:
    """A variant with everything needed to run it."""

    variant: Variant
    library: Path
    values: dict[str, float]
    most_a: float
    leaves: str = ""
    """The question at which the user leaves; default: stays to the end."""
    case: Variant | None = None


def prepare(variant: Variant, library: Library, motor: board_keys.Part, board: board_keys.Part) -> Job:
    """Checks the variant's keys. Nothing runs yet."""
    layers = [motor.values, board.values, variant.keys]
    values = {"input.pot": 0.5, **board_keys.of_header(library.params)} | board_keys.resolve(layers, library.keys)
    values.setdefault("state.theta_e_deg", 137.0)
    return Job(variant, library.path, values, param(library.params, "MAXIMUM_CURRENT_A"))


def run(job: Job, told: Callable[[float], None]) -> dict[str, Any]:
    """One board in this process."""
    board = Board(Library(job.library))
    try:
        said = bringup_user.use(board, job.values, told, job.leaves)
    except BoardError as error:
        raise UserError(f"the virtual board refuses: {error}", job.variant.name, "correct the motor or board file") from None
    finally:
        board.close()
    return {"name": job.variant.name, "title": job.variant.title, "said": ", ".join(said.findings()) or "nothing wrong",
            "fix": " / ".join(line for _, line in said.lines if line.startswith("FIX")), "current_max_a": said.current_max_a,
            "motor_s": said.motor_s, "verdict": verdict(job, said), "lines": [f"{at_s:7.2f} s  {line}" for at_s, line in said.lines]}


def verdict(job: Job, said: bringup_user.Said) -> str:
    """"ok", or what does not hold."""
    if not said.ended:
        return "no end"
    if said.current_max_a > job.most_a:
        return f"current {said.current_max_a:.2f} A"
    if said.findings() != job.variant.finds:
        return "not that"
    return "ok" if said.findings() or not said.warned() else f"false alarm {said.warned()[0]}"


def check(job: Job, row: dict[str, Any]) -> Outcome:
    """One row: what must be said."""
    wanted = ", ".join(job.variant.finds) or "nothing wrong"
    return Outcome(job.variant.name, row["verdict"] == "ok", f"{row['said']}; {row['current_max_a']:.2f} A; {row['verdict']}",
                   f"{wanted}; {job.most_a:.2f} A")


def simulate(jobs: list[Job], quiet: bool) -> list[dict[str, Any]]:
    """All of them, side by side."""
    with Progress("bringup", USUAL_S * len(jobs), quiet) as progress:
        return workers.run_all(jobs, run, progress)


class Bringup(sweep.Sweep):
    """The sweep: a case is a variant."""

    name, about, defines = "bringup", "the BRINGUP firmware on the right board and on every miswired one", (MODE,)
    columns = (("title", "what is\nwrong", "{}"), ("said", "BRINGUP\nsaid", "{}"), ("current_max_a", "current\nmax A", "{:.2f}"),
               ("motor_s", "motor\ns", "{:.1f}"), ("verdict", "\nverdict", "{}"))
    keys = ("name", "title", "said", "fix", "current_max_a", "motor_s", "verdict")
    alone = False

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = super().add_command(commands)
        parser.add_argument("--variant", help="this one only, with all its lines; default: all, as a table")
        return parser

    @classmethod
    def read(cls, options: argparse.Namespace) -> Table:
        table = read()
        return replace(table, variants=chosen(table, options.variant))

    def ask(self, options: argparse.Namespace) -> None:
        self.alone = options.variant is not None

    def cases(self) -> list[Variant]:
        return self.table.variants

    def job(self, item: Variant) -> Job:
        return prepare(item, self.library, self.motor, self.board)

    def results(self, title: str, jobs: list[Job]) -> list[dict[str, Any]]:
        return simulate(jobs, self.quiet)

    def check(self, item: Variant, row: dict[str, Any]) -> list[Outcome]:
        return [check(self.job(item), row)]

    def finish(self, target: Path) -> int:
        """One alone with all that it says, and without a folder."""
        if not self.alone:
            return super().finish(target)
        (item,) = self.cases()
        row, = self.run([item], self.name)
        print("\n".join(row["lines"]) + f"\n\n{row['name']}: {row['title']}")
        return command_common.verdict(self.name, self.check(item, row))


def chosen(table: Table, name: str | None) -> list[Variant]:
    """The variant that was asked for, or all."""
    names = [variant.name for variant in table.variants]
    if name is not None and name not in names:
        near = difflib.get_close_matches(name, names, 1)
        raise UserError(f"no variant '{name}'", "VARIANT", f"did you mean {near[0]}?" if near else f"take one of {', '.join(names)}")
    return [variant for variant in table.variants if name in (None, variant.name)]
