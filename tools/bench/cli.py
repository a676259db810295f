"""The command line: `python3 -m tools.bench <command>`. Exit codes: 0 all well, 1 an expectation failed, 2 bad input."""

import argparse
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tools.common import command_line, motor_file, output, paths
from tools.common.progress import waiting
from . import bringup, build, campaign, catch_sweep, command_common, loadsteps, lowspeed, rating_sweep, report, robust, scenario_file, simulate, soak, start_sweep, sweep, table2
from .expect import Outcome
from .run import HAND_OVER_AFTER_S, HAND_OVER_BEFORE_S, Run


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    return command_line.main(_parser, arguments)


def _parser() -> argparse.ArgumentParser:
    parser = command_line.Parser(prog="foc33", description="Runs the foc33 firmware on the virtual MCLV board.")
    commands = parser.add_subparsers(required=True, metavar="command", parser_class=command_line.Parser)

    run = commands.add_parser("run", help="run a scenario: table, protocol, expectations, plots")
    run.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
                     help="change a plant key; KEY=x0.5 multiplies it (see `keys`); may be repeated")
    run.add_argument("--no-plots", action="store_true", help="write summary and trace only")
    run.set_defaults(command=_run)

    prepare = commands.add_parser("prepare", help="look at the files of a run, as `run` would, and say nothing if they are good")
    prepare.add_argument("--sanitized", action="store_true", help="then build its firmware with sanitizers and print the library's path")
    prepare.set_defaults(command=_prepare, library=None)
    for command in (run, prepare):
        command.add_argument("scenario", nargs="?", help="name (see `scenarios`) or TOML file; default demo, rated with --motor")
        command.add_argument("--defines", default="", metavar="MACROS", help="build with more macros, written as \"-DNAME -DNAME=value\"")

    loads = commands.add_parser("table2", help="the eight rows of AN1292's Table 2 beside ours")
    loads.set_defaults(command=table2.command)

    angles = commands.add_parser("starts", help="start from every rotor angle under several loads")
    angles.add_argument("--every-deg", type=float, help="step of the rotor's electrical angle; default from tables/starts.toml")
    angles.set_defaults(command=start_sweep.command)

    rating = commands.add_parser("rated", help="every motor with its tuned header at 20, 50 and 100 %% of its rated speed under load")
    rating.add_argument("--motor", nargs="+", metavar="NAME", help="these motors only: names in tuning/motors or paths")
    rating.set_defaults(command=rating_sweep.command)

    steps = commands.add_parser("loadsteps", help="the brake closes and opens at once: dips, and how soon the speed is back")
    steps.set_defaults(command=loadsteps.command)

    slow = commands.add_parser("lowspeed", help="low speeds held under load, and how low it goes")
    slow.set_defaults(command=lowspeed.command)

    catches = commands.add_parser("catch", help="S2 while the rotor turns at any speed, and stops on a supply that cannot sink")
    catches.set_defaults(command=catch_sweep.command)

    margins = commands.add_parser("robust", help="how far the motor's true R, L and Kphi may be off what the header says")
    margins.add_argument("--no-margins", action="store_true", help="only the promised deviations, not how far one may go")
    margins.set_defaults(command=robust.command)

    record = commands.add_parser("recorder", help="draw what the fault recorder has sent: a log of the UART")
    record.add_argument("log", nargs="?", help="default: what the last run that ended in a fault has sent")
    record.set_defaults(command=_recorder)

    for command, folder in ((run, "SCENARIO"), (prepare, ""), (loads, "table2"), (angles, "starts"), (rating, "rated"), (steps, "loadsteps"),
                            (slow, "lowspeed"), (catches, "catch"), (margins, "robust"), (record, "recorder")):
        header = "build/tune/NAME, written by make tune MOTOR=NAME" + ("" if command is rating else "; without --motor the project's own")
        command.add_argument("--board", help="board file instead of the motor's or the scenario's: a name in tuning/boards or a path")
        command.add_argument("--userparams", metavar="FOLDER", help=f"build with the userparams.h in this folder; default: {header}")
        if command is not rating:
            command.add_argument("--motor", help="motor file instead of the scenario's: a name in tuning/motors or a path")
        if command is prepare:
            continue
        if command is not rating:
            command.add_argument("--library", type=Path, help="a libvboard.so to use instead of building one")
        command.add_argument("--out", type=Path, help=f"result folder, replaced when the run is complete; default build/run/{folder}, with the names "
                             "of another motor, board or header")
        command.add_argument("--quiet", action="store_true", help="no progress bar")

    bringup.add_command(commands)
    campaign.add_command(commands)
    soak.add_command(commands)

    listing = commands.add_parser("scenarios", help="list the scenarios")
    listing.set_defaults(command=_scenarios)

    motors = commands.add_parser("motors", help="list the motor files: data and rating")
    motors.set_defaults(command=_motors)

    keys = commands.add_parser("keys", help="list the virtual board's keys: unit, range, meaning")
    keys.add_argument("--library", type=Path, help="a libvboard.so to use instead of building one")
    keys.set_defaults(command=_keys)
    return parser


def _run(options: argparse.Namespace) -> int:
    item, asked = command_common.scenario_for(options)
    motor, board, library, used = command_common.set_up(item, options, item.defines)
    job = simulate.prepare(item, library, motor, board, command_common.changes(options.changes))
    target = command_common.results(item.name, item.motor, options, asked)
    with output.ResultFolder(target) as folder:
        text, outcomes = sweep.run_cases(item.name, [job], options.quiet, functools.partial(_reported, folder.work, used, options))[0]
    print(text)
    print(f"results in {paths.shown(target)}/: index.html")
    return command_common.verdict(item.name, outcomes)


def _reported(folder: Path, used: dict[str, Any], options: argparse.Namespace, job: simulate.Job, tell: Callable[[float], None]) -> tuple[str, list[Outcome]]:
    """The run and its whole report, in the run's process: a trace takes too much memory to be there twice."""
    run = simulate.simulate(job, tell)
    outcomes = report.check(run)
    data = report.summary(run, outcomes, used["motor"], used["board"]) | used
    _write_traces(run, folder)
    if not options.no_plots:
        with waiting("plots", options.quiet):
            from . import plots, recorder_command
            data["plots"] = plots.write_all(run, folder) + recorder_command.of_run(run, folder)
    output.write_summary(folder, data)
    report.write_page(folder, run, outcomes, data)
    return (f"{report.text(run, outcomes, data)}\n\nsimulated {run.motor_s:.2f} s of motor time in {run.wall_s:.2f} s on one core "
            f"({run.cpu_s:.2f} s of processor time): {run.speed_factor:.1f} times real time"), outcomes


def _prepare(options: argparse.Namespace) -> int:
    item, _ = command_common.scenario_for(options)
    command_common.parts_of(item, options)
    if options.sanitized:
        userparams = command_common.header_for(options)
        print(build.library(item.defines, userparams and build.header_folder(userparams), sanitized=True))
    return 0


def _write_traces(run: Run, folder: Path) -> None:
    """The whole run at a tenth of the rate, and the first hand-over at the full rate."""
    output.write_trace(folder / "trace.csv", run.trace.thinned(10))
    for item in run.hand_overs()[:1]:
        output.write_trace(folder / "hand_over.csv", run.trace.part(item.at_s - HAND_OVER_BEFORE_S, item.at_s + HAND_OVER_AFTER_S))


def _recorder(options: argparse.Namespace) -> int:
    from . import recorder_command # needs matplotlib, which takes its time
    return recorder_command.command(options)


def _scenarios(options: argparse.Namespace) -> int:
    names = paths.names(paths.SCENARIOS)
    width = max(map(len, names), default=0)
    for name in names:
        print(f"{name.ljust(width)}  {scenario_file.load(name).title}")
    return 0


def _motors(options: argparse.Namespace) -> int:
    motors, code = command_line.each(paths.names(paths.MOTORS), motor_file.load)
    print(motor_file.listing(motors))
    return code


def _keys(options: argparse.Namespace) -> int:
    for key in command_common.library_for([], options.library).keys.values():
        span = f"{key.minimum:g} .. {key.maximum:g}" if key.writable else "read only"
        print(f"{key.name:26} {key.unit:8} {span:24} {key.meaning}")
    return 0
