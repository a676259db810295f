"""`anymotor`: drawn motors and boards, each tuned and run to its rating as `make run MOTOR= BOARD=` does. Each turns, or the tuner refuses it."""

import argparse
import shlex
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tools.bench import command_common, report, scenario_file, simulate
from tools.bench.board import Library
from tools.bench.build import HEADER
from tools.bench.expect import Outcome
from tools.common import board_file, motor_file, output, paths, workers
from tools.common.errors import UserError
from tools.common.progress import Progress

from . import drawn

if TYPE_CHECKING:
    from .design import Design

RESULTS = paths.ROOT / "build" / "anymotor"
TURNS, REFUSED, FAILS = "turns", "refused", "fails"
KEYS = ("number", "name", "verdict", "why", "motor", "motor_s", "warnings")


@dataclass(frozen=True)
class Job:
    """One case, and where its files go."""

    case: drawn.Case
    number: int
    folder: Path
    keep: bool = False


def add_command(commands: Any) -> None:
    """Adds `anymotor` to a command line's commands."""
    parser = commands.add_parser("anymotor", help="drawn motors and boards: tuned and turning, or refused by the tuner")
    parser.add_argument("--count", type=int, default=300, metavar="N", help="how many cases; default 300")
    parser.add_argument("--seed", type=int, default=1, help="of the draw; default 1")
    parser.add_argument("--case", type=int, nargs="+", metavar="NUMBER", help="these cases alone; of a single one the whole report")
    parser.add_argument("--out", type=Path, help="result folder, replaced when complete; default build/anymotor/seed-SEED")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    for flag, value in (("--count", options.count), ("--case", min(options.case or [1]))):
        if value < 1:
            raise UserError(f"{value} is no number of cases or of a case", flag, "choose 1 or more")
    numbers = options.case or list(range(1, options.count + 1))
    alone = options.case is not None and len(numbers) == 1
    firmware = shared_firmware()
    target = options.out or RESULTS / (f"seed-{options.seed}" + (f"-case-{numbers[0]}" if options.case else ""))
    with output.ResultFolder(target) as folder:
        jobs = [Job(drawn.draw(options.seed, number), number, folder.work / "cases", alone) for number in numbers]
        with Progress("anymotor", len(jobs), options.quiet, "cases") as progress:
            rows = workers.run_all(jobs, lambda job, tell: _one(job, firmware, tell), progress)
        outcomes = [Outcome(row["name"], row["verdict"] != FAILS, ": ".join(filter(None, (row["verdict"], row["why"]))), "turns, or refused by the tuner")
                    for row in rows]
        texts = [row.pop("report") for row in rows]
        report.write_table(folder.work, "cases", KEYS, rows, outcomes,
                           {"title": f"drawn motors and boards, seed {options.seed}", "seed": options.seed}, {}, (TURNS, REFUSED))
    for row, text in zip(rows, texts):
        if text:
            print(text)
        if alone or row["verdict"] == FAILS:
            print(": ".join(filter(None, (row["name"], row["verdict"], row["why"]))))
    for verdict in (TURNS, REFUSED, FAILS):
        count = sum(row["verdict"] == verdict for row in rows)
        print(f"{verdict}: {count} of {len(rows)}, {count / len(rows):.0%}")
    print(f"results in {paths.shown(target)}/: index.html")
    return 1 if any(row["verdict"] == FAILS for row in rows) else 0


@dataclass(frozen=True)
class Firmware:
    """The default build, taken apart: what a header changes is compiled for each case, the rest is linked as it is."""

    compile: list[str]
    sources: list[str]
    objects: list[str]

    def build(self, folder: Path) -> Library:
        """The virtual board with the userparams.h in this folder."""
        target = folder / "board.so"
        done = subprocess.run([self.compile[0], f"-I{folder}", *self.compile[1:], "-w", "-shared", "-o", str(target), *self.sources, *self.objects, "-lm"],
                              cwd=paths.ROOT, capture_output=True, text=True, check=False)
        if done.returncode:
            said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[-200:])
            raise UserError(f"the firmware does not build: {said}", HEADER)
        return Library(target)


def shared_firmware() -> Firmware:
    """The objects of the default build."""
    library = command_common.library_for([], None) # up to date
    folder = library.path.parent
    objects = [paths.ROOT / name for name in (folder / "contents").read_text(encoding="utf-8").split() if not name.endswith("/main.o")]
    with_header = [path for path in objects if HEADER in path.with_suffix(".d").read_text(encoding="utf-8")]
    flags = shlex.split((folder / "flags").read_text(encoding="utf-8")) + [f"-Itools/{room}" for room in ("plant", "chip", "vboard", "cpu_host")]
    sources = [_source(path, folder) for path in with_header]
    return Firmware(flags, sources, [str(path) for path in objects if path not in with_header])


def _source(path: Path, folder: Path) -> str:
    """Of an object: what make has written beside it, the application that it was made from, or the file in the same place of the project."""
    if (named := path.with_suffix(".from")).exists():
        return named.read_text(encoding="utf-8").strip()
    return str(path.with_suffix(".c") if path.with_suffix(".c").exists() else path.relative_to(folder).with_suffix(".c"))


def row_of(job: Job) -> dict[str, Any]:
    """A case of which nothing is known yet: it fails."""
    return {"number": job.number, "name": job.case.name, "verdict": FAILS, "why": "", "motor": "", "motor_s": 0.0, "warnings": "", "report": ""}


def _one(job: Job, firmware: Firmware, tell: Callable[[float], None]) -> dict[str, Any]:
    """One case: files, design, firmware, run."""
    row = row_of(job)
    motor_path, board_path = job.case.write(job.folder / job.case.name)
    try:
        made = _tuned(motor_path, board_path)
    except UserError as error:
        tell(1.0)
        return row | {"verdict": REFUSED, "why": str(error).replace(f"{paths.shown(motor_path.parent)}/", "")}
    row |= {"motor": made.motor.title, "warnings": " | ".join(made.warnings)}
    try:
        outcomes, row["motor_s"], row["report"] = _run(job, firmware, motor_path, board_path)
        failed = [f"{outcome.row} {outcome.got} (allowed {outcome.allowed})" for outcome in outcomes if not outcome.ok]
        row |= {"verdict": FAILS if failed else TURNS, "why": "; ".join(failed[:4])}
    except UserError as error:
        row["why"] = str(error)
    tell(1.0)
    return row


def _tuned(motor_path: Path, board_path: Path) -> "Design":
    from . import design, header
    made = design.design(motor_file.load(str(motor_path)), board_file.load(str(board_path)))
    (motor_path.parent / HEADER).write_text(header.write(made), encoding="utf-8")
    return made


def _run(job: Job, firmware: Firmware, motor_path: Path, board_path: Path) -> tuple[list[Outcome], float, str]:
    """Expectations, motor time, and the report where one case is asked for."""
    library = firmware.build(motor_path.parent)
    motor, board = motor_file.part(str(motor_path)), board_file.part(str(board_path))
    run = simulate.simulate(simulate.prepare(scenario_file.load("rated"), library, motor, board), lambda seconds: None)
    library.path.unlink()
    outcomes = report.check(run)
    text = report.text(run, outcomes, report.summary(run, outcomes, str(motor_path), str(board_path))) if job.keep else ""
    return outcomes, run.motor_s, text
