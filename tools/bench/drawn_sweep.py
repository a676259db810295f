"""A sweep whose cases are those of a table, all of their combinations, or drawn: always the same by seed and number."""

import argparse
from typing import Any

from tools.common.errors import UserError
from . import sweep
from .draws import MOST_NUMBER


class DrawnSweep(sweep.Sweep):
    """Of its own a kind has `what` one of its cases is, and what --full means."""

    what, all_of_it = "case", ""
    full, seed, numbers = False, 1, ()

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = super().add_command(commands)
        parser.add_argument("--full", action="store_true", help=cls.all_of_it)
        parser.add_argument("--draw", type=int, metavar="COUNT", help=f"only drawn {cls.what}s, so many")
        parser.add_argument("--seed", type=int, default=1, help="of the draw; default 1")
        parser.add_argument("--case", type=int, nargs="+", metavar="NUMBER", help=f"these drawn {cls.what}s alone")
        return parser

    @classmethod
    def folder(cls, options: argparse.Namespace) -> str:
        if not options.draw and not options.case:
            return cls.name
        return f"{cls.name}-draw-{options.seed}" + (f"-case-{min(options.case)}" if options.case else "")

    def ask(self, options: argparse.Namespace) -> None:
        for flag, value in (("--draw", options.draw), ("--case", min(options.case) if options.case else None)):
            if value is not None and not 1 <= value <= MOST_NUMBER:
                raise UserError(f"{value} is no number of {self.what}s or of a {self.what}", flag, f"choose 1 .. {MOST_NUMBER}")
        self.full, self.seed = options.full, options.seed
        self.numbers = sorted(set(options.case)) if options.case else range(1, (options.draw or 0) + 1)
