"""The command line of make live: `python3 -m tools.live`."""

import argparse
import asyncio
import sys
from pathlib import Path

from tools.bench import command_common
from tools.bench.scenario import Scenario
from tools.bench.scenario_file import MOTOR
from tools.common import command_line
from tools.common.errors import UserError

from .pace import PACES


def _parser() -> argparse.ArgumentParser:
    parser = command_line.Parser(prog="python3 -m tools.live", description="Shows the virtual MCLV board in the browser, in real time.")
    parser.add_argument("--motor", help="motor file: a name in tuning/motors or a path")
    parser.add_argument("--board", help="board file instead of the motor's: a name in tuning/boards or a path")
    parser.add_argument("--userparams", metavar="FOLDER", help="build with the userparams.h in this folder")
    parser.add_argument("--defines", default="", metavar="MACROS", help="build with more macros, written as \"-DNAME -DNAME=value\"")
    parser.add_argument("--library", type=Path, help="a libvboard.so to use instead of building one")
    parser.add_argument("--pace", default="1", help="motor seconds in a second: " + ", ".join(f"{pace:g}" for pace in PACES))
    parser.add_argument("--listen", metavar="PORT", help="TCP port of the page; default 8033, or a free one")
    parser.set_defaults(command=_live)
    return parser


def _live(options: argparse.Namespace) -> int:
    from . import server # what only this needs: aiohttp
    from .recording import Origin
    from .virtual_board import VirtualBoard
    pace, port = _pace(options.pace), _port(options.listen)
    defines = command_common.macros(options.defines)
    motor, board, library, _ = command_common.set_up(Scenario("live", "", "", MOTOR, "", 0.0), options, defines)
    words = {name: word for name, word in (("MOTOR", options.motor), ("BOARD", options.board), ("USERPARAMS", options.userparams)) if word}
    origin = Origin(motor, board, defines, words)
    asyncio.run(server.serve(lambda: VirtualBoard(library, origin), port, pace, _tell))
    return 0


def _tell(url: str) -> None:
    print(f"open {url}\nCtrl-C ends", flush=True)


def _pace(text: str) -> float:
    known = {f"{pace:g}": pace for pace in PACES}
    if text not in known:
        raise UserError(f"no pace '{text}'", "PACE", "choose one of " + ", ".join(known))
    return known[text]


def _port(text: str | None) -> int | None:
    if text is None:
        return None
    if not text.isascii() or not text.isdigit() or int(text) > 65535:
        raise UserError(f"'{text}' is no port", "LISTEN", "choose 1024 .. 65535, or 0 for a free one")
    return int(text)


if __name__ == "__main__":
    sys.exit(command_line.main(_parser, None))
