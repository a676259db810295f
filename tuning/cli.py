"""The command line: `python3 -m tuning <command>`. Exit codes: 0 all well, 1 an expectation failed, 2 bad input."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tools.common import command_line, paths
from tools.common.progress import waiting

from . import fw_tune, identify, spreadsheet

if TYPE_CHECKING:
    from tools.common.board_file import BoardFile

    from .design import Design


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    return command_line.main(_parser, arguments)


def _parser() -> argparse.ArgumentParser:
    parser = command_line.Parser(prog="tuning", description="Makes a userparams.h from a motor file.")
    commands = parser.add_subparsers(required=True, metavar="command", parser_class=command_line.Parser)
    tune = commands.add_parser("tune", help="userparams.h and a report for a motor")
    tune.add_argument("motor", nargs="?", help="a name in tuning/motors or the path of a motor file")
    tune.add_argument("--all", action="store_true", help="every motor of tuning/motors")
    tune.add_argument("--out", type=Path, help="result folder, replaced when complete; default build/tune/NAME")
    tune.add_argument("--brief", action="store_true", help="one line and the warnings")
    tune.set_defaults(command=_tune)
    motors = commands.add_parser("motors", help="tune every motor of tuning/motors, then run those that this board can turn: foc33 rated")
    motors.add_argument("--out", type=Path, help="result folder of the runs; default build/run/rated")
    motors.add_argument("--quiet", action="store_true", help="no progress bar")
    motors.set_defaults(command=_motors)
    for command in (tune, motors):
        command.add_argument("--board", default="mclv", help="a name in tuning/boards or a path; default mclv")
    for module in (fw_tune, spreadsheet, identify):
        module.add_command(commands)
    return parser


def _board(options: argparse.Namespace) -> "BoardFile":
    from tools.common import board_file
    return board_file.load(options.board, "--board")


def _design(motor: str, board: "BoardFile") -> "Design":
    from tools.common import motor_file

    from .design import design
    return design(motor_file.load(motor, "command line"), board)


def _tune(options: argparse.Namespace) -> int:
    names = command_line.one_or_all(options, paths.names(paths.MOTORS))
    return _tune_each(names, _board(options), options.out, options.brief)[1]


def _tune_each(names: list[str], board: "BoardFile", out: Path | None, brief: bool) -> tuple[list[str], int]:
    """The motors that have got a header, and the exit code: one that is made for another board does not stop the rest."""
    def tune(name: str) -> str:
        _tune_one(name, board, out, brief)
        return name
    return command_line.each(names, tune)


def _tune_one(name: str, board: "BoardFile", out: Path | None, brief: bool) -> None:
    with waiting(f"tuning {Path(name).stem}"):
        from . import report
        design = _design(name, board)
        target = out or paths.TUNED / design.motor.name
        report.write(design, target, anew=not brief)
    print(report.brief(design) if brief else report.text(design))
    if not brief:
        print(f"\nresults in {paths.shown(target)}/: userparams.h, report.html")
    sys.stdout.flush() # in its place among the lines of those that are refused


def _motors(options: argparse.Namespace) -> int:
    from tools.bench import rating_sweep
    tuned, code = _tune_each(paths.names(paths.MOTORS), _board(options), None, True)
    if not tuned:
        return code
    return max(code, rating_sweep.command(argparse.Namespace(**vars(options) | {"motor": tuned, "userparams": None})))
