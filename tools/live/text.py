"""A client of the application `text`: runs a motor by lines of text, on a real board's port or on the pseudo-terminal of `make live-board APP=text`.

    make text PORT=/dev/ttyUSB0 SAY="run 1500"      # until Ctrl-C, then it stops
    make text PORT=/dev/ttyUSB0 SAY=status
"""

import argparse
import re
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from tools.common import command_line
from tools.common.errors import UserError

from . import lnet

ANSWER_S = 0.3
"""So long an answer may take."""
TRIES = 3
RENEW_S = 0.5
"""How often a running motor hears of its client; without it stops after 2 s (TEXT_SILENT_MS)."""
MOST_RPM = 32767
"""A longer number is no number to the drive."""
COMMANDS = ("run", "speed", "stop", "status", "fault", "clear")
ANSWER = re.compile(r"(\w+) run ([01]) speed (-?\d+) fault (\w+)")
REMEDIES = {"range": "choose a speed between MINIMUM_SPEED_RPM and MAXIMUM_SPEED_RPM", "refused": "clear the fault first",
            "unknown": "is its firmware of this version?"}


@dataclass(frozen=True)
class Status:
    """What the drive does."""

    running: bool
    speed_rpm: int
    fault: str

    def text(self, told: str = "") -> str:
        """In words, of a drive that was told this."""
        doing = "stops" if told == "stop" else "runs"
        return f"{doing if self.running else 'stands'}, {self.speed_rpm} rpm, fault {self.fault}"


def checked(line: str) -> str:
    """The line with its checksum."""
    total = 0
    for byte in line.encode("ascii"):
        total ^= byte
    return f"{line}*{total:02X}"


def content(line: str) -> str | None:
    """What a line says; None without a right checksum."""
    text = line.rpartition("*")[0]
    return text if text and text.isascii() and checked(text) == line else None


class TextDrive:
    """A drive at a stream with read() and write()."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self.heard = ""

    def command(self, line: str) -> Status:
        """Says a line and returns the answer. What was disturbed on the way is said again."""
        for _ in range(TRIES):
            self.stream.write((checked(line) + "\n").encode("ascii"))
            for answer in self._answers():
                found = ANSWER.fullmatch(answer)
                if found is None or found[1] == "checksum":
                    continue
                if found[1] != "ok":
                    raise UserError(f"the drive answers '{found[1]}'", line, REMEDIES.get(found[1], f"its fault is {found[4]}"))
                return Status(found[2] == "1", int(found[3]), found[4])
        raise UserError("no answer", line, "is it this port, is the board on, is its firmware built with APP=text?")

    def _answers(self) -> Iterator[str]:
        """Right lines within the time of an answer."""
        until_s = time.monotonic() + ANSWER_S
        while time.monotonic() < until_s:
            self.heard += self.stream.read(64).decode("latin-1")
            *lines, self.heard = self.heard.split("\n")
            yield from (text for line in lines if (text := content(line.strip())) is not None)

    def run(self, seconds: float) -> Iterator[Status]:
        """Keeps a motor running for so long: what it does, again and again."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            yield self.command("status")
            time.sleep(min(RENEW_S, max(until_s - time.monotonic(), 0.0)))


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = command_line.Parser(prog="python3 -m tools.live.text", description=__doc__.splitlines()[0])
    parser.add_argument("port", help="serial port, or the pseudo-terminal that make live-board APP=text names")
    parser.add_argument("command", help=", ".join(COMMANDS))
    parser.add_argument("rpm", nargs="?", type=int, help="of run and speed, with its sign the direction")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="of run; default: until Ctrl-C")
    options = parser.parse_args(arguments)
    if options.command not in COMMANDS:
        raise UserError(f"the text application has no command '{options.command}'", "SAY", f"use {', '.join(COMMANDS)}")
    if options.command == "speed" and options.rpm is None:
        parser.error("speed needs a number: speed 1500")
    if options.rpm is not None and options.command not in ("run", "speed"):
        parser.error(f"{options.command} takes no number: leave out {options.rpm}")
    if options.rpm is not None and abs(options.rpm) > MOST_RPM:
        parser.error(f"{options.rpm} rpm is no speed of the drive: {REMEDIES['range']}")
    return options


def _run(options: argparse.Namespace) -> int:
    drive = TextDrive(lnet.open_port(options.port))
    if options.rpm is not None:
        drive.command(f"speed {options.rpm}")
    status = drive.command("status" if options.command == "speed" else options.command)
    print(status.fault if options.command == "fault" else status.text(options.command), flush=True)
    if options.command == "run":
        try:
            for status in drive.run(options.seconds):
                print(status.text(), flush=True)
                if status.fault != "NONE":
                    return 1
        except KeyboardInterrupt:
            print()
        print(drive.command("stop").text("stop"))
    return 0


def _to_its_end(options: argparse.Namespace) -> int:
    try:
        return _run(options)
    except OSError as error: # a plug that was pulled; pyserial's errors are such, too
        raise UserError(f"the port is gone ({error})", options.port, "is the plug in, does make live-board still run?") from None


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return command_line.run(lambda: _to_its_end(_arguments(arguments)))


if __name__ == "__main__":
    sys.exit(main())
