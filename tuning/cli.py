"""The command line: `python3 -m tuning <command>`. Exit codes: 0 all well, 2 bad input."""

import argparse
import importlib
import importlib.util
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tools.foc33 import command_line, places
from tools.foc33.errors import UserError

if TYPE_CHECKING:
    from .design import Design

OTHERS = ("fw_tune", "spreadsheet", "identify")
"""Modules that bring a command of their own: add_command(commands)."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    def work() -> int:
        options = _parser().parse_args(arguments)
        return options.command(options)
    return command_line.run(work)


def _parser() -> argparse.ArgumentParser:
    parser = command_line.Parser(prog="tuning", description="Makes a userparams.h from a motor file.")
    commands = parser.add_subparsers(required=True, metavar="command", parser_class=command_line.Parser)
    tune = commands.add_parser("tune", help="userparams.h and a report for a motor")
    tune.add_argument("motor", nargs="?", help="a name in tuning/motors or the path of a motor file")
    tune.add_argument("--all", action="store_true", help="every motor of tuning/motors")
    tune.add_argument("--out", type=Path, help="result folder, replaced when complete; default build/tune/NAME")
    tune.add_argument("--brief", action="store_true", help="one line and the warnings")
    tune.set_defaults(command=_tune)
    header = commands.add_parser("header", help="print the userparams.h of a motor, nothing else")
    header.add_argument("motor", help="a name in tuning/motors or the path of a motor file")
    header.set_defaults(command=_header)
    for command in (tune, header):
        command.add_argument("--board", default="mclv", help="a name in tuning/boards or a path; default mclv")
    for name in OTHERS:
        if importlib.util.find_spec(f"{__package__}.{name}"):
            module = importlib.import_module(f"{__package__}.{name}")
            if hasattr(module, "add_command"):
                module.add_command(commands)
    return parser


def _design(motor: str, board: str) -> "Design":
    from tools.foc33 import board_file, motor_file

    from .design import design
    return design(motor_file.load(motor, "command line"), board_file.load(board, "--board"))


def _tune(options: argparse.Namespace) -> int:
    from . import report
    if options.all == (options.motor is not None):
        raise UserError("which motor?", "command line", "name one, or write --all" if not options.all else "write either a motor or --all")
    if options.all and options.out is not None:
        raise UserError("one folder for several motors", "--out", "leave it out, or name one motor")
    designs = [_design(name, options.board) for name in (places.names(places.MOTORS) if options.all else [options.motor])]
    for design in designs:
        target = options.out or places.TUNED / design.motor.name
        report.write(design, target, anew=not options.brief)
        print(report.brief(design) if options.brief else report.text(design))
        if not options.brief:
            print(f"\nresults in {places.shown(target)}/: userparams.h, report.html")
    return 0


def _header(options: argparse.Namespace) -> int:
    from . import header
    sys.stdout.write(header.write(_design(options.motor, options.board)))
    return 0
