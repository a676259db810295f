"""What the project's command lines share: one line for bad input, and the exit codes."""

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from .errors import UserError

Item, Made = TypeVar("Item"), TypeVar("Made")


class Parser(argparse.ArgumentParser):
    """Bad arguments get one line like all bad input, not the usage."""

    def error(self, message: str) -> None: # type: ignore[override]
        raise UserError(message, "command line", f"see {self.prog} --help")


BY_MAKE = {name: name.upper() for name in ("board", "case", "defines", "draw", "hours", "image", "kind", "motor", "out", "seed", "set", "userparams")} | {"count": "N"}
"""Options as make has them."""


def as_asked(line: str) -> str:
    """A line for whoever has called make, and knows of no options."""
    if os.environ.get("ASKED_BY") != "make":
        return line
    line = re.sub(r"see [\w. -]+ --help$", "make help tells what it takes", line)
    return re.sub(r"(?<![\w-])--([a-z]+)(?![\w-])", lambda option: BY_MAKE.get(option[1], option[0]), line)


def tell(_: object, error: UserError) -> None:
    """The lines of a refused item, on standard error."""
    for line in error.lines:
        print(f"foc33: {as_asked(line)}", file=sys.stderr, flush=True)


def each(items: Iterable[Item], work: Callable[[Item], Made], refuse: Callable[[Item, UserError], None] = tell) -> tuple[list[Made], int]:
    """What `work` makes of every item, and the exit code: an item that is refused gets its line and code 2, the others go on."""
    made, code = [], 0
    for item in items:
        try:
            made.append(work(item))
        except UserError as error:
            refuse(item, error)
            code = 2
    return made, code


def one_or_all(options: argparse.Namespace, known: list[str]) -> list[str]:
    """The motors that a command is for: the one that is named, or with --all those that are known."""
    if options.all == (options.motor is not None):
        raise UserError("which motor?", "command line", "name one, or write --all" if not options.all else "write either a motor or --all")
    if options.all and options.out is not None:
        raise UserError("one folder for several motors", "--out", "leave it out, or name one motor")
    return known if options.all else [options.motor]


def main(parser: Callable[[], argparse.ArgumentParser], arguments: list[str] | None) -> int:
    """Exit code of the command that the arguments choose: the parser sets it as `command`."""
    def work() -> int:
        options = parser().parse_args(arguments)
        return options.command(options)
    return run(work)


def on_files(program: str, work: Callable[..., object], *names: str) -> int:
    """Exit code of a command whose arguments are files, one for each of `names`, and nothing else."""
    def ready() -> int:
        files = sys.argv[1:]
        if len(files) != len(names):
            raise UserError(f"{len(files)} files instead of {len(names)}", program, "name " + " and ".join(names))
        work(*map(Path, files))
        return 0
    return run(ready)


def run(work: Callable[[], int]) -> int:
    """Exit code of `work`; 2 after bad input, 130 after Ctrl-C, 141 when the reader of the output went away."""
    try:
        return work()
    except UserError as error:
        tell(None, error)
        return 2
    except KeyboardInterrupt:
        print("foc33: interrupted, nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()) # say nothing more
        return 141
