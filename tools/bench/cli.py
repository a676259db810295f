"""The command line: `python3 -m tools.bench <command>`. Exit codes: 0 all well, 1 an expectation failed, 2 bad input."""

import argparse
import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tools.common import command_line, motor_file, output, paths
from tools.common.errors import UserError
from tools.common.progress import waiting
from . import build, command_common, report, scenario_file, selftest, simulate, sweep
from .bringup import Bringup
from .campaign import Campaign
from .catch_sweep import Catch
from .expect import Outcome
from .held_sweep import Held
from .loadsteps import LoadSteps
from .lowspeed import LowSpeed
from .pulse_sweep import Pulse
from .rating_sweep import Rated
from .robust import Robust
from .run import HAND_OVER_AFTER_S, HAND_OVER_BEFORE_S, Run
from .sensitivity import Sensitivity
from .soak import Soak
from .start_sweep import Starts
from .table2 import Table2

SWEEPS = (Table2, Starts, Rated, LoadSteps, LowSpeed, Catch, Pulse, Held, Robust, Bringup, Sensitivity)


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
        command.add_argument("--app", default="", metavar="NAME", help="with this application: a name of firmware/app, or a C file")
    command_common.add_options(run, "SCENARIO")
    command_common.add_options(prepare, "", without=("library", "out", "quiet"))
    for kind in (*SWEEPS, Campaign, Soak):
        kind.add_command(commands)

    record = commands.add_parser("recorder", help="draw what the fault recorder has sent: a log of the UART")
    record.add_argument("log", nargs="?", help="default: what the last run that ended in a fault has sent")
    command_common.add_options(record, "recorder")
    record.set_defaults(command=_recorder)

    listing = commands.add_parser("scenarios", help="list the scenarios")
    listing.set_defaults(command=_scenarios)

    motors = commands.add_parser("motors", help="list the motor files: data and rating")
    motors.set_defaults(command=_motors)

    registers = commands.add_parser("registers", help="list what the self-test REGISTERS compares: register, bits, value")
    registers.add_argument("--defines", default="", metavar="MACROS", help="of a firmware with more macros, written as \"-DNAME -DNAME=value\"")
    registers.add_argument("--userparams", metavar="FOLDER", help="with the userparams.h in this folder")
    registers.set_defaults(command=_registers)

    keys = commands.add_parser("keys", help="list the virtual board's keys: unit, range, meaning")
    keys.add_argument("--library", type=Path, help="a libvboard.so to use instead of building one")
    keys.set_defaults(command=_keys)
    return parser


def _run(options: argparse.Namespace) -> int:
    item, asked = command_common.scenario_for(options)
    motor, board, library, used = command_common.set_up(item, options, item.defines)
    job = simulate.prepare(item, library, motor, board, command_common.changes(options.changes))
    target = command_common.results(item.name, item.motor, options, asked)
    for note in item.notes:
        print(f"foc33: {note}", file=sys.stderr, flush=True)
    with output.ResultFolder(target) as folder:
        text, outcomes = sweep.run_cases(item.name, [job], options.quiet, functools.partial(_reported, folder.work, used, options))[0]
    print(text)
    print(f"results in {paths.shown(target)}/: index.html")
    return command_common.verdict(item.name, outcomes)


def _reported(folder: Path, used: dict[str, Any], options: argparse.Namespace, job: simulate.Job,
              tell: Callable[[float], None]) -> tuple[str, list[Outcome]]:
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


def _registers(options: argparse.Namespace) -> int:
    found = selftest.written(command_common.library_for(command_common.macros(options.defines), None, options.userparams))
    if not found:
        raise UserError("this firmware has no self-tests", "--defines", "leave out SELFTEST_OFF")
    for register in found:
        print(f"{register.name:10} bits 0x{register.mask:04X}  value 0x{register.value:04X}")
    return 0


def _keys(options: argparse.Namespace) -> int:
    for key in command_common.library_for([], options.library).keys.values():
        span = f"{key.minimum:g} .. {key.maximum:g}" if key.writable else "read only"
        print(f"{key.name:26} {key.unit:8} {span:24} {key.meaning}")
    return 0
