"""The command line: `python3 -m tuning <command>`. Exit codes: 0 all well, 1 an expectation failed, 2 bad input."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tools.common import command_line, paths
from tools.common.progress import waiting

from . import board, fw_tune, identify, spreadsheet

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
        command.add_argument("--board", help="a name in tuning/boards or a path; default: the one in the motor file, else mclv")
    for module in (fw_tune, spreadsheet, identify, board):
        module.add_command(commands)
    return parser


def _board(options: argparse.Namespace) -> "BoardFile | None":
    """The board that was asked for; None: each motor's own."""
    from tools.common import board_file
    return board_file.load(options.board, "--board") if options.board else None


def _design(motor: str, board: "BoardFile | None") -> "Design":
    from tools.common import board_file, motor_file

    from .design import design
    loaded = motor_file.load(motor, "command line")
    return design(loaded, board or board_file.load(*board_file.named(loaded)))


def _tune(options: argparse.Namespace) -> int:
    names = command_line.one_or_all(options, paths.names(paths.MOTORS))
    board = _board(options)
    return command_line.each(names, lambda name: _tune_one(name, board, options.out, options.brief))[1]


def _tune_one(name: str, board: "BoardFile | None", out: Path | None, brief: bool) -> None:
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
    """A motor that its board cannot turn does not stop the rest: the table has a row with the reason."""
    from tools.bench import rating_sweep
    board, refused = _board(options), {}

    def tune(name: str) -> str:
        _tune_one(name, board, None, True)
        return name
    tuned, _ = command_line.each(paths.names(paths.MOTORS), tune, lambda name, error: refused.update({name: str(error)}))
    return rating_sweep.command(argparse.Namespace(**vars(options) | {"motor": tuned, "refused": refused, "userparams": None}))
