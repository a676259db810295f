"""The command line of make live: `python3 -m tools.live`."""

import argparse
import asyncio
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tools.bench import build, command_common
from tools.bench.scenario import Scenario
from tools.bench.scenario_file import MOTOR
from tools.common import command_line, motor_file, paths
from tools.common.errors import UserError

from .pace import PACES

if TYPE_CHECKING:
    from . import board
    from .symbols import Symbols
    from .tuning import Tuning

IMAGE = paths.shown(paths.ROOT / "build" / "target" / "foc33.elf")


def _parser() -> argparse.ArgumentParser:
    parser = command_line.Parser(prog="python3 -m tools.live", description="Shows the virtual MCLV board in the browser, in real time.")
    parser.add_argument("--motor", help="motor file: a name in tuning/motors or a path")
    parser.add_argument("--board", help="board file instead of the motor's: a name in tuning/boards or a path")
    parser.add_argument("--userparams", metavar="FOLDER", help="build with the userparams.h in this folder")
    parser.add_argument("--defines", default="", metavar="MACROS", help="build with more macros, written as \"-DNAME -DNAME=value\"")
    parser.add_argument("--app", default="", help="the application: a name of firmware/app, or a file")
    parser.add_argument("--library", type=Path, help="a libvboard.so to use instead of building one")
    parser.add_argument("--cpu", choices=("host", "33f"), default="host", help="33f: an image of XC16 in the instruction-set simulator")
    parser.add_argument("--image", type=Path, metavar="FILE", help="such an image (ELF) instead of building one")
    parser.add_argument("--kept", type=Path, metavar="FILE", help="the virtual board's pages of kept parameters: read from this file, and written in the end")
    parser.add_argument("--pace", default="1", help="motor seconds in a second: " + ", ".join(f"{pace:g}" for pace in PACES))
    parser.add_argument("--port", help="serial port of a real board; with SCOPE 1 in its firmware the page can start the motor and has a scope")
    parser.add_argument("--elf", type=Path, metavar="FILE", help="ELF file of the firmware on it; default build/target/foc33.elf, as make firmware leaves it")
    parser.add_argument("--listen", metavar="PORT", help="TCP port of the page; default 8033, or a free one")
    parser.set_defaults(command=_live)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return command_line.main(_parser, arguments)


def _live(options: argparse.Namespace) -> int:
    from . import kept, server # what only this needs: aiohttp
    pace, port = _pace(options.pace), _port(options.listen)
    if options.port and options.kept:
        raise UserError("a real board has its own flash", "KEPT", "leave it out")
    if options.port and (options.cpu != "host" or options.image):
        raise UserError("a board has its own processor", "CPU", "leave out CPU or PORT")
    if options.image and options.cpu == "host":
        raise UserError("an image for the PC's processor", "IMAGE", "add CPU=33f")
    parts = _parts(options)
    with kept.flash_in(options.kept, parts.library, parts.image is not None):
        asyncio.run(server.serve(_real(options, parts) if options.port else _virtual(options, parts), port, pace, _tell))
    return 0


def _real(options: argparse.Namespace, parts: "board.Parts") -> Callable[[], Any]:
    """Makes the bench of a board at a serial port. The PC's firmware, with the same header, tells what its numbers mean."""
    from .listened_board import ListenedBoard, has_scope
    from .real_board import RealBoard
    from .symbols import Symbols
    symbols = Symbols.read(options.elf or IMAGE)
    if not has_scope(symbols):
        return lambda: ListenedBoard(options.port, parts.motor.title, symbols, parts.library)
    tuning, modes = _tuning(options, parts, symbols), command_common.macros(options.defines)
    motor = motor_file.load(str(parts.motor.path)) if options.motor else None # else the header says what the motor is
    return lambda: RealBoard(options.port, parts.motor.title, symbols, parts.library.params, tuning, motor, modes)


def _virtual(options: argparse.Namespace, parts: "board.Parts") -> Callable[[], Any]:
    """Makes the bench of a virtual board."""
    from .board import macros_for
    from .recording import Origin
    from .symbols import Symbols
    from .virtual_board import VirtualBoard
    if options.elf is not None:
        raise UserError("an ELF file without a board", "ELF", "name the board's serial port, PORT=/dev/ttyUSB0")
    words = {name: word for name, word in (("MOTOR", options.motor), ("BOARD", options.board), ("USERPARAMS", options.userparams)) if word}
    origin = Origin(parts.motor, parts.board, macros_for(options.defines, options.app), words)
    symbols = Symbols.read(parts.symbols)
    tuning = _tuning(options, parts, symbols)
    return lambda: VirtualBoard(parts.library, origin, symbols, tuning, parts.image)


def _tuning(options: argparse.Namespace, parts: "board.Parts", symbols: "Symbols") -> "Tuning | None":
    """For a firmware whose parameters are variables."""
    from .board import macros_for
    from .symbols import Symbols
    from .tuning import Tuning
    folder = command_common.header_for(options)
    header = ((build.header_folder(folder) if folder else None) or paths.ROOT) / build.HEADER
    files = (parts.motor.path, parts.board.path) if options.motor else None
    macros = macros_for(options.defines, options.app)
    layout = parts.symbols if parts.image is None else build.library(macros, build.header_folder(folder) if folder else None, "live-library").with_name("foc33.elf")
    return Tuning.of(header, macros, Symbols.read(layout), symbols, files)


def _parts(options: argparse.Namespace) -> "board.Parts":
    """Motor, board and firmware; with --library that one, which its ELF file lies beside."""
    from . import board
    if options.library is None:
        return board.parts(options.motor, options.board, options.defines, options.userparams, options.cpu, options.image, options.app)
    motor, board_part = command_common.parts_of(Scenario("live", "", "", MOTOR, "", 0.0), options)
    library = command_common.library_for([], options.library, options.userparams)
    return board.Parts(motor, board_part, library, None, options.library.with_name("foc33.elf"))


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
    sys.exit(main())
