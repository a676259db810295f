"""`make live-board`: the virtual board in real time, its serial line a pseudo-terminal, until Ctrl-C. Nothing happens to it by itself:
potentiometer, buttons and load are at rest.

    python3 -m tools.live.board [--motor NAME] [--cpu 33f]
"""

import argparse
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from tools.bench import build, command_common, pil, pil_command, simulate
from tools.bench.board import Board, BoardError, Library
from tools.bench.scenario import Scenario
from tools.bench.scenario_file import MOTOR
from tools.common import board_keys, command_line, paths
from tools.common.errors import UserError

from . import kept, plain_elf
from .pace import RealTime

SCOPE = "SCOPE=1"
REST = Scenario("live-board", "", "", MOTOR, "", 0.0)
"""Nothing happens."""


def with_scope(macros: list[str]) -> list[str]:
    """The scope is on, unless somebody has said SCOPE=0, or an application has the serial line: then the fault recorder has its place."""
    return macros if any(macro.startswith("SCOPE=") for macro in macros) or build.has_line(macros) else [*macros, SCOPE]


def macros_for(defines: str, app: str = "") -> list[str]:
    """Those of a build with an application, if one is named, and with the scope."""
    return with_scope([*command_common.macros(defines), *([build.app(app, "APP")] if app and app != "panel" else [])])


STEP_S = 0.002
"""What the board runs in one go: a byte of the serial line waits so long at most."""
BACKGROUND_PERIODS = 2
"""Between two passes of a background that takes no time."""


@dataclass(frozen=True)
class Parts:
    """What a board is made of."""

    motor: board_keys.Part
    board: board_keys.Part
    library: Library
    image: Path | None
    """for the simulated chip; None: the PC is the processor"""
    symbols: Path
    """the ELF file with the names and addresses that a client needs"""


def parts(motor: str | None = None, board: str | None = None, defines: str = "", userparams: str | None = None, cpu: str = "host",
          image: Path | None = None, app: str = "") -> Parts:
    """The parts by their names on the command line; builds the firmware with its scope, unless an application wants the line."""
    options = argparse.Namespace(motor=motor, board=board, userparams=userparams)
    motor_part, board_part = command_common.parts_of(REST, options)
    header = command_common.header_for(options)
    folder = None if header is None else build.header_folder(header)
    macros = macros_for(defines, app)
    if cpu == "33f":
        elf = pil_command.image_for(macros, folder, image)
        return Parts(motor_part, board_part, pil.library(macros, folder), elf, plain_elf.write(elf, elf.with_suffix(".client.elf")))
    library = Library(build.library(macros, folder, "live-library"))
    return Parts(motor_part, board_part, library, None, library.path.with_name("foc33.elf"))


class LiveBoard:
    """A virtual board at rest, whose serial line somebody else has. One a process."""

    def __init__(self, made_of: Parts) -> None:
        self.parts = made_of
        library = made_of.library
        self.board = pil.PilBoard(library, made_of.image) if isinstance(library, pil.PilLibrary) and made_of.image else Board(library)
        simulate.set_up(self.board, simulate.prepare(REST, library, made_of.motor, made_of.board))
        self.board.set("cpu.background_periods", BACKGROUND_PERIODS)
        if isinstance(self.board, pil.PilBoard):
            self.board.lock_step(False)
        self.board.power_up()
        self.period_s = library.params.get("LOOPTIME_SEC", 50e-6)

    def close(self) -> None:
        """Switches off."""
        self.board.close()

    def run(self, seconds: float) -> float:
        """Goes on by so much of its own time, in whole periods; returns how much that was."""
        periods = max(1, round(seconds / self.period_s))
        self.board.run(periods)
        return periods * self.period_s



class BoardStream:
    """The serial line of a board in this process, as a client's stream: reading lets the board run."""

    def __init__(self, live: LiveBoard) -> None:
        self.live = live

    def write(self, data: bytes) -> None:
        """Sends; the characters take their time on the line."""
        while data:
            data = data[self.live.board.uart_send(data.decode("latin-1")):]
            if data:
                self.live.run(STEP_S)

    def read(self, _: int = 0) -> bytes:
        """What the firmware has sent by a moment later."""
        self.live.run(STEP_S / 2)
        return self.live.board.uart_take().encode("latin-1")


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = command_line.Parser(prog="python3 -m tools.live.board", description=__doc__.splitlines()[0])
    parser.add_argument("--motor", help=f"motor file: a name in tuning/motors or a path; default {MOTOR}")
    parser.add_argument("--board", help="board file instead of the motor's: a name in tuning/boards or a path")
    parser.add_argument("--defines", default="", metavar="MACROS", help="build with more macros, written as \"-DNAME -DNAME=value\"")
    parser.add_argument("--userparams", metavar="FOLDER", help="build with the userparams.h in this folder")
    parser.add_argument("--app", default="", help="application: a name of firmware/app or a path; the line is then without the scope")
    parser.add_argument("--cpu", choices=("host", "33f"), default="host", help="33f: an image of XC16 in the instruction-set simulator")
    parser.add_argument("--kept", type=Path, metavar="FILE", help="the flash's pages of kept parameters: read from this file, and written in the end")
    parser.add_argument("--image", type=Path, help="its ELF file; default: built with XC16")
    return parser.parse_args(arguments)


def _told(live: LiveBoard) -> str:
    made_of = live.parts
    return (f"serial line   {live.board.terminal()}, 115200 baud 8N1\nsymbols       {paths.shown(made_of.symbols)}\n"
            f"motor         {paths.shown(made_of.motor.path)}\nboard         {paths.shown(made_of.board.path)}\n"
            "in real time, buttons, potentiometer and load at rest; Ctrl-C ends it")


def _run(options: argparse.Namespace) -> int:
    words = vars(options)
    path, made_of = words.pop("kept"), parts(**words)
    with kept.flash_in(path, made_of.library, made_of.image is not None):
        return _live(made_of)


def _live(made_of: Parts) -> int:
    try:
        live = LiveBoard(made_of)
        print(_told(live), flush=True)
    except BoardError as error:
        raise UserError(f"the virtual board refuses: {error}", "live-board") from None
    ended: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: ended.append(number))
    real_time, began_s, said_s = RealTime(), time.monotonic(), 1.0
    while not ended:
        due_s = real_time.next(live.run(STEP_S))
        live.board.uart_take() # the terminal has it
        time.sleep(max(due_s - time.monotonic(), 0.0))
        if real_time.lost_s > said_s:
            said_s = 10.0 * real_time.lost_s
            print(f"slower than real time: {real_time.lost_s:.1f} s behind after {time.monotonic() - began_s:.0f} s", flush=True)
    live.close()
    print(f"\nran for {time.monotonic() - began_s:.1f} s")
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return command_line.run(lambda: _run(_arguments(arguments)))


if __name__ == "__main__":
    sys.exit(main())
