"""The command line: `python3 -m tuning <command>`. Exit codes: 0 all well, 1 an expectation failed, 2 bad input."""

import argparse
import itertools
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from tools.common import command_line, paths
from tools.common.errors import UserError
from tools.common.progress import waiting

from . import any_motor, board, fw_tune, identify, identify_range, import_header, spreadsheet

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
    tune.add_argument("--install", action="store_true", help="then put the header in the project's place; the one that is there is kept")
    tune.set_defaults(command=_tune)
    motors = commands.add_parser("motors", help="tune every motor of tuning/motors, then run those that this board can turn: foc33 rated")
    motors.add_argument("--out", type=Path, help="result folder of the runs; default build/run/motors, with the board's name if one is given")
    motors.add_argument("--quiet", action="store_true", help="no progress bar")
    motors.set_defaults(command=_motors)
    for command in (tune, motors):
        command.add_argument("--board", help="a name in tuning/boards or a path; default: the one in the motor file, else mclv")
    for module in (fw_tune, spreadsheet, identify, identify_range, board, any_motor, import_header):
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
    made, code = _tune_each(names, options, options.brief)
    if options.install and made:
        install(_folder(made[0], options) / "userparams.h", paths.ROOT / "userparams.h")
    return code


def install(new: Path, place: Path) -> None:
    """Puts a header in its place; what was there is kept beside it under a new name."""
    try:
        if place.exists() and place.read_bytes() == new.read_bytes():
            print("userparams.h is up to date")
            return
        if place.exists():
            names = itertools.chain([".old"], (f".old{number}" for number in itertools.count(2)))
            old = next(path for path in map(place.with_name, (place.name + name for name in names)) if not path.exists())
            shutil.copy2(place, old)
            print(f"yours is kept as {old.name}")
        unfinished = place.with_name(f".{place.name}-unfinished-{os.getpid()}")
        shutil.copyfile(new, unfinished)
        os.replace(unfinished, place)
    except OSError as error:
        raise UserError(f"cannot write {place.name} ({error.strerror})", str(place.parent), "make the folder writable") from None
    print("userparams.h written")


def _folder(motor: str, options: argparse.Namespace) -> Path:
    """Where the header of a motor goes; on a board that was asked for into a folder of its own."""
    board = paths.find("board", options.board, paths.BOARDS, "--board") if options.board else None
    return options.out or paths.TUNED / paths.pair_name(paths.find("motor", motor, paths.MOTORS, "command line"), board)


def _tune_each(names: list[str], options: argparse.Namespace, brief: bool,
               refuse: Callable[[str, UserError], None] = command_line.tell) -> tuple[list[str], int]:
    """The motors that have got a header, and the exit code: one that is made for another board does not stop the rest."""
    board = _board(options)

    def tune(name: str) -> str:
        _tune_one(name, board, _folder(name, options), brief)
        return name
    return command_line.each(names, tune, refuse)


def _tune_one(name: str, board: "BoardFile | None", target: Path, brief: bool) -> None:
    with waiting(f"tuning {Path(name).stem}"):
        from . import report
        design = _design(name, board)
        report.write(design, target, anew=not brief)
    print(report.brief(design) if brief else report.text(design))
    if not brief:
        print(f"\nresults in {paths.shown(target)}/: userparams.h, report.html")
    sys.stdout.flush() # in its place among the lines of those that are refused


def _motors(options: argparse.Namespace) -> int:
    """A motor that its board cannot turn does not stop the rest: the table has a row with the reason."""
    from tools.bench import command_common, rating_sweep
    refused: dict[str, str] = {}
    tuned, _ = _tune_each(paths.names(paths.MOTORS), argparse.Namespace(**vars(options) | {"out": None}), True,
                          lambda name, error: refused.update({name: str(error)}))
    out = options.out or rating_sweep.results("motors", None, command_common.board_asked_for(options))
    return rating_sweep.Rated.command(argparse.Namespace(**vars(options) | {"motor": tuned, "refused": refused, "userparams": None, "out": out}))
