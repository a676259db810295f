"""Steps that all running commands share: which library and plant, a progress bar, the verdict."""

import argparse
import sys
from pathlib import Path
from typing import Any

from . import build, plant
from .board import Library
from .errors import UserError
from .expect import Outcome


def library_for(defines: list[str], given: Path | None) -> Library:
    """The board with the firmware that the defines ask for."""
    if given is not None and not given.is_file():
        raise UserError(f"no library '{given}'", "--library", "check the path")
    return Library(given if given is not None else build.library(defines))


class Progress:
    """A bar over motor time; silent when asked to be or when nobody looks."""

    def __init__(self, title: str, total_s: float, quiet: bool) -> None:
        self.bar = None
        if quiet or not sys.stderr.isatty():
            return
        try:
            from tqdm import tqdm
        except ImportError:
            return
        tqdm.monitor_interval = 0
        self.bar = tqdm(total=total_s, desc=title, unit="s", leave=False, ncols=90,
                        bar_format="{desc} {percentage:3.0f}% |{bar}| {n:.1f}/{total:.1f} s of motor time")

    def __call__(self, seconds: float) -> None:
        if self.bar is not None:
            self.bar.update(min(seconds, max(0.0, self.bar.total - self.bar.n)))

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *error: Any) -> None:
        if self.bar is not None:
            self.bar.close()


def changes(texts: list[str]) -> plant.Values:
    """Plant changes written as KEY=NUMBER or KEY=xFACTOR."""
    result = plant.Values()
    for text in texts:
        key, sign, value = text.partition("=")
        factor = value.startswith("x")
        try:
            number = float(value[1:] if factor else value)
        except ValueError:
            raise UserError(f"'{text}' is no change", "--set", "write KEY=NUMBER or KEY=xFACTOR") from None
        if not sign:
            raise UserError(f"'{text}' is no change", "--set", "write KEY=NUMBER or KEY=xFACTOR")
        result.values[key] = ("factor", number) if factor else number
        result.where[key] = "--set"
    return result


def parts_of(item: Any, options: argparse.Namespace) -> tuple[plant.Part, plant.Part]:
    """Motor and board: from the command line, else from the scenario or table."""
    motor = plant.read_motor(options.motor, "--motor") if options.motor else plant.read_motor(item.motor, item.motor_where)
    board = plant.read_board(options.board, "--board") if options.board else plant.read_board(item.board, item.board_where)
    return motor, board


def verdict(name: str, outcomes: list[Outcome]) -> int:
    """Says how many expectations hold, names the others on stderr, and returns the exit code."""
    failed = [outcome for outcome in outcomes if not outcome.ok]
    print(f"{len(outcomes) - len(failed)} of {len(outcomes)} expectations hold", flush=True)
    for outcome in failed:
        print(f"foc33: {name}: {outcome.row}: got {outcome.got}, allowed {outcome.allowed}", file=sys.stderr)
    return 1 if failed else 0
