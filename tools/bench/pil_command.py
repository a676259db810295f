"""`make pil`: scenarios with the target image in the loop: the report of `make run`, and the comparison with the PC's firmware tick by tick.

    python3 -m tools.bench.pil_command [demo table2 ...] [--image build/target/foc33.elf]
"""

import argparse
import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tools.common import command_line, output, paths
from . import build, command_common, pil, report, simulate, sweep, table2
from tools.common.errors import UserError
from tools.common.progress import waiting
from .expect import Outcome

DEFAULT = ("demo", "table2")
HEX_NOTE = "not compared, no expectations of the drive's state: a HEX file alone does not say where its variables are"
MODE_NOTE = "not compared: in this mode the background has a part in every interrupt"


def image_for(defines: list[str], userparams: Path | None, given: Path | None) -> Path:
    """The image for these settings, built if it has to be."""
    if given is not None:
        if not given.is_file():
            raise UserError(f"no image '{given}'", "--image", "build one with make firmware, or name a file that is there")
        return given
    done = build.make("target-elf", defines, userparams)
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        told = next((line for line in lines if line.startswith("foc33: ")), None)
        if told is not None:
            raise UserError(told.removeprefix("foc33: "))
        raise UserError("the target image does not build", " ".join(done.args[4:]), (lines or ["run make firmware to see why"])[0])
    return paths.ROOT / done.stdout.split()[-1]


def work(image: Path, job: simulate.Job, progress: Callable[[float], None]) -> pil.PilRun:
    """One run in a process of its own."""
    return pil.run(job, image, progress)


def checked(run: pil.PilRun) -> list[Outcome]:
    """The scenario's expectations, without those that need names where the image has none."""
    return [outcome for expectation in run.run.scenario.expectations if run.has_names or not expectation.reads_firmware()
            for outcome in expectation.check(run.run)]


LATE = "APPLICATION"
"""The fault of an application that does not return in time."""


def comparison(run: pil.PilRun) -> Outcome:
    """Whether target and PC agreed."""
    row = "target = PC in every interrupt"
    if not run.has_names or {"IDENTIFY", "BRINGUP"} & set(run.run.scenario.defines):
        return Outcome(row, True, MODE_NOTE if run.has_names else HEX_NOTE, "no difference where it is compared")
    if run.ticks == 0:
        return Outcome(row, False, "the image never entered its control interrupt", "no difference in P1DC1-3, P1OVDCON, signals")
    got = f"{run.ticks} interrupts, {run.differences} differ" + (f"; first: {run.first_difference}" if run.differences else "")
    if run.differences and LATE in {name for *_, name in run.run.raised()}:
        got += f"; the application took longer than APP_LATE_MS on the chip (fault {LATE}), and a PC does not count its time"
    return Outcome(row, run.differences == 0, got, "no difference in P1DC1-3, P1OVDCON, signals")


def figures(run: pil.PilRun) -> dict[str, Any]:
    """What the core counted, as plain data."""
    return {**vars(run.cycles), "ticks": run.ticks, "differences": run.differences, "first_difference": run.first_difference,
            "instructions_per_second": instructions_per_second(run)}


def instructions_per_second(run: pil.PilRun) -> float:
    """Simulated instructions in a second of processor time: what else the machine does has no part in it."""
    return run.cycles.instructions / run.run.cpu_s if run.run.cpu_s > 0.0 else 0.0


def core_text(run: pil.PilRun) -> str:
    """The core's figures in three lines."""
    c = run.cycles
    return (f"control interrupt   {c.isr_cycles_min:.0f} / {c.isr_cycles_mean:.1f} / {c.isr_cycles_max:.0f} cycles (min / mean / max), {c.isr_count:.0f} times\n"
            f"trigger to duties   {c.latency_cycles_min:.0f} / {c.latency_cycles_mean:.1f} / {c.latency_cycles_max:.0f} cycles\n"
            f"deepest stack       {c.stack_bytes:.0f} bytes" + (f"\nresets              {c.resets:.0f}, with that of the watchdog's self-test at power-up" if c.resets else ""))


def _scenario(name: str | None, options: argparse.Namespace) -> int:
    item, asked = command_common.scenario_for(argparse.Namespace(**vars(options) | {"scenario": name}))
    motor, board = command_common.parts_of(item, options)
    header = command_common.header_for(options)
    folder = None if header is None else build.header_folder(header)
    image = image_for(item.defines, folder, options.image)
    library = pil.library(item.defines, folder)
    used = command_common.used(motor, library, command_common.header_name(None, header))
    job = simulate.prepare(item, library, motor, board)
    target = command_common.results(f"pil-{item.name}", item.motor, options, asked)
    with output.ResultFolder(target) as result:
        found = sweep.run_cases(f"{item.name} on the target", [job], options.quiet, functools.partial(work, image))[0]
        run = found.run
        outcomes = [*checked(found), comparison(found)]
        data = report.summary(run, outcomes, str(paths.shown(motor.path)), str(paths.shown(board.path))) | used
        data |= {"image": str(paths.shown(image)), "target": report.clean(figures(found))}
        output.write_trace(result.work / "trace.csv", run.trace.thinned(10))
        (result.work / "uart.txt").write_text(run.sent, encoding="latin-1", newline="")
        if not options.no_plots:
            with waiting("plots", options.quiet):
                from . import plots, recorder_command
                data["plots"] = plots.write_all(run, result.work) + recorder_command.of_run(run, result.work)
        output.write_summary(result.work, data)
        report.write_page(result.work, run, outcomes, data)
    print(report.text(run, outcomes, data))
    print(f"\nimage               {paths.shown(image)}\n{core_text(found)}")
    print(f"\nsimulated {run.motor_s:.2f} s of motor time in {run.wall_s:.2f} s on one core ({run.cpu_s:.2f} s of processor time): {run.speed_factor:.2f} times real time, "
          f"{instructions_per_second(found) / 1e6:.0f} million instructions a second")
    print(f"results in {paths.shown(target)}/: index.html")
    return command_common.verdict(item.name, outcomes)


def _table2(options: argparse.Namespace) -> int:
    defines, header = command_common.macros(options.defines), command_common.header_for(options)
    folder = None if header is None else build.header_folder(header)
    image = image_for(defines, folder, options.image)
    library = pil.library(defines, folder)
    runs: list[pil.PilRun] = []

    class OnTarget(table2.Table2):
        """The sweep on the image."""

        def results(self, title: str, jobs: list[simulate.Job]) -> list[dict[str, Any]]:
            runs.extend(sweep.run_cases(title, jobs, self.quiet, functools.partial(work, image)))
            return [self.measured(run.run, None) for run in runs]

    out = command_common.results("pil-table2", table2.Table.read(paths.TABLES / "table2.toml").motor, options, defines)
    status = OnTarget.command(argparse.Namespace(**vars(options) | {"library": library.path, "userparams": None, "out": out}))
    outcomes = [comparison(run) for run in runs]
    print()
    for outcome in outcomes:
        print(f"{'ok  ' if outcome.ok else 'FAIL'}  {outcome.row}: {outcome.got}")
    return max(status, command_common.verdict("table2 on the target", outcomes))


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = command_line.Parser(prog="python3 -m tools.bench.pil_command", description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", nargs="*", help="names, TOML files, or table2; default demo table2, or the one for the mode of --defines")
    parser.add_argument("--defines", default="", metavar="MACROS", help="build with more macros, written as \"-DNAME -DNAME=value\"")
    parser.add_argument("--app", default="", help="the application: a name of firmware/app, or a file")
    parser.add_argument("--image", type=Path, help="ELF or HEX file; default: built with XC16")
    parser.add_argument("--motor", help="motor file instead of the scenario's")
    parser.add_argument("--board", help="board file instead of the scenario's")
    parser.add_argument("--userparams", metavar="FOLDER", help="build both with the userparams.h in this folder")
    parser.add_argument("--out", type=Path, help="result folder of a single scenario; default build/run/pil-NAME")
    parser.add_argument("--no-plots", action="store_true")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return command_line.run(lambda: _run(_arguments(arguments)))


def _run(options: argparse.Namespace) -> int:
    """All scenarios, one after the other; the worst of their exit codes."""
    names = options.scenarios or ([None] if options.defines or options.app else DEFAULT)
    if options.out is not None and len(names) > 1:
        raise UserError("one result folder for several scenarios", "--out", "run them one by one")
    status = 0
    for number, name in enumerate(names):
        if number:
            print(f"\n{'=' * 100}\n")
        status = max(status, _table2(options) if name == "table2" else _scenario(name, options))
    return status


if __name__ == "__main__":
    sys.exit(main())
