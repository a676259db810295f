"""Kept parameters on the page of make live: what it says of a virtual board's flash and of a real board's, and the two buttons."""

import contextlib
import ctypes
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from live_support import KEPT_DEFINES, kept_parts, parts, until
from support import refusal

from tools.common import paths
from tools.common.errors import UserError
from tools.live import board
from tools.live.kept import Kept, flash_in, table
from tools.live.lnet import Lnet, connect
from tools.live.pace import Pacemaker
from tools.live.real_board import RealBoard
from tools.live.recording import Origin
from tools.live.symbols import Symbols
from tools.live.tuning import Tuning
from tools.live.virtual_board import VirtualBoard

GAIN = "board_params.speed_kp_q13"


class Bench:
    """A virtual board in a thread, and the page's side of it."""

    def __init__(self) -> None:
        made_of = kept_parts()
        self.symbols = Symbols.read(made_of.symbols)
        self.board = VirtualBoard(made_of.library, Origin(made_of.motor, made_of.board, [*KEPT_DEFINES.replace("-D", "").split(), board.SCOPE], {}), self.symbols)
        self.maker = Pacemaker(self.board, lambda frame: None)
        self.board.start(lambda message: None)
        self.maker.start()

    def close(self) -> None:
        self.board.end()
        self.maker.end()

    def do(self, **command) -> None:
        self.maker.call(lambda: self.board.act(command)).result(5)

    def frame(self) -> dict:
        return self.maker.call(self.board.frame).result(5)

    def client(self, work) -> int:
        """Something that the thread of the link does, for only it may use the line."""
        scope, done = self.board.scope, []
        beat = scope.beat

        def once(link: Lnet) -> None:
            scope.beat = beat
            done.append(work(link))
        scope.beat = once
        return until(lambda: done, "nothing done")[0]

    def says(self, **wanted) -> None:
        until(lambda: (kept := self.frame()["kept"]) is not None and all(kept[name] == value for name, value in wanted.items()),
              lambda: f"{wanted}: {self.frame()['kept']}")

    def logs(self, text: str) -> None:
        until(lambda: any(line["text"] == text for line in list(self.board.log)), lambda: f"{text}: {[line['text'] for line in self.board.log]}")


@pytest.fixture
def bench():
    with contextlib.closing(Bench()) as item:
        yield item


class Wire:
    """A link whose memory is a dictionary of words, and a firmware that obeys."""

    def __init__(self, symbols: Symbols, result: int) -> None:
        self.symbols, self.result = symbols, result
        self.words = dict.fromkeys(("request", "result", "copies", "unsaved"), 0)
        self.reads = self.asked = 0

    def _at(self, name: str) -> int:
        return self.symbols.find(f"kept_command.{name}").address

    def read(self, address: int, count: int) -> bytes:
        self.reads += 1
        if self.words["request"] and self.reads % 3 == 0: # it takes its time
            self.asked, self.words["request"], self.words["result"] = self.words["request"], 0, self.result
        memory = bytearray(count)
        for name, word in self.words.items():
            memory[self._at(name) - address:self._at(name) - address + 2] = word.to_bytes(2, "little")
        return bytes(memory)

    def write(self, address: int, data: bytes) -> None:
        assert address == self._at("request")
        self.words["request"] = int.from_bytes(data, "little")


def test_a_firmware_without_kept_parameters_has_no_such_card() -> None:
    plain = Symbols.read(parts().symbols)
    assert Kept.of(plain) is None and Kept.of(None) is None
    page = object.__new__(RealBoard)
    page.kept = None
    refusal(lambda: page.act({"keep": True}), "no such command")


@pytest.mark.parametrize("request_, result", [("KEEP", "DONE"), ("FORGET", "NOT_STOPPED"), ("KEEP", "RANGE"), ("KEEP", "FLASH")])
def test_a_request_is_written_and_its_answer_told_by_its_meaning(request_: str, result: str) -> None:
    symbols = Symbols.read(kept_parts().symbols)
    kept, wire = Kept.of(symbols), Wire(symbols, table("RESULT")[result][0])
    assert kept.told() is None
    kept.beat(wire)
    assert kept.told() == {"state": "NONE", "meaning": table("STATE")["NONE"][1], "unsaved": 0}
    wire.words |= {"copies": table("STATE")["BROKEN"][0], "unsaved": 7}
    kept.beat(wire)
    assert kept.told()["state"] == "NONE", "it looks four times a second"
    kept.ask(request_)
    kept.beat(wire)
    assert wire.asked == table("REQUEST")[request_][0] and list(kept.news) == [f"{request_.lower()}: {table('RESULT')[result][1]}"]
    assert kept.told() == {"state": "BROKEN", "meaning": table("STATE")["BROKEN"][1], "unsaved": 7}


def test_the_numbers_of_the_requests_are_no_neighbours() -> None:
    keep, forget = (table("REQUEST")[name][0] for name in ("KEEP", "FORGET"))
    assert min((keep ^ forget).bit_count(), keep.bit_count(), forget.bit_count()) >= 4


def test_the_page_keeps_over_a_power_up_and_forgets(bench: Bench) -> None:
    gain = bench.symbols.find(GAIN)

    def value() -> int:
        return bench.client(lambda link: gain.value(link.read(gain.address, gain.bytes)))

    assert bench.board.hello()["kept"] is True
    bench.says(state="NONE", unsaved=0)
    header = value()
    bench.client(lambda link: link.write(gain.address, gain.data(header + 100)))
    bench.says(state="NONE", unsaved=1)
    bench.do(keep=True)
    bench.logs("keep: done")
    bench.says(unsaved=0, state="KEPT")
    bench.do(power=True)
    bench.says(unsaved=0, state="KEPT")
    assert value() == header + 100
    bench.do(forget=True)
    bench.logs("forget: done")
    bench.says(unsaved=0, state="NONE")
    assert value() == header


def test_while_the_motor_turns_it_is_refused_by_its_reason(bench: Bench) -> None:
    bench.do(set=["input.pot", 0.5])
    until(lambda: bench.frame()["state"] == "STOPPED", "not STOPPED")
    bench.do(press="S2")
    bench.do(release="S2")
    until(lambda: bench.frame()["state"] == "CLOSED", "does not turn")
    bench.do(keep=True)
    bench.logs("keep: refused: only in STOPPED, 5 s after the bridge was on: the rotor must stand")
    bench.says(state="NONE")


def test_a_board_at_a_serial_port_is_tuned_over_its_line() -> None:
    made_of, symbols = kept_parts(), Symbols.read(kept_parts().symbols)
    defines = [*KEPT_DEFINES.replace("-D", "").split(), board.SCOPE]
    tuning = Tuning.of(paths.ROOT / "userparams.h", defines, symbols, symbols)
    virtual = VirtualBoard(made_of.library, Origin(made_of.motor, made_of.board, defines, {}))
    maker = Pacemaker(virtual, lambda frame: None)
    maker.start()
    real = RealBoard(virtual.line, "the motor", symbols, made_of.library.params, tuning)
    try:
        real.start(lambda message: None)
        real.tuning.ask(["SPEED_BANDWIDTH_HZ", "9.5"])
        wanted = tuning.compiler.build({"SPEED_BANDWIDTH_HZ": "9.5"}).params
        there = (ctypes.c_ubyte * len(wanted)).in_dll(virtual.library.c, "board_params")
        assert wanted != tuning.built.params == bytes(there)
        until(lambda: bytes(there) == wanted, "it is not written")
        assert set(real.hello()["tuning"]) == {"subjects", "changed", "undo", "lost", "foreign"} and real.header() == tuning.saved()
        until(lambda: (real.run(0.0), real.frame(), any(line["text"] == "SPEED_BANDWIDTH_HZ 9.5" for line in real.log))[2], "it is not logged")
    finally:
        real.end()
        maker.end()


# ---- the virtual board's flash in a file ---------------------------------------------------------------------------------------
def test_the_flash_of_the_virtual_board_outlives_the_command(tmp_path: Path) -> None:
    """By the program that `make live-board KEPT=file` starts, twice."""
    file, symbols = tmp_path / "flash", Symbols.read(kept_parts().symbols)
    request, state = symbols.find("kept_command.request"), symbols.find("kept_command.copies")
    gain = symbols.find(GAIN)
    command = [sys.executable, "-m", "tools.live.board", f"--defines={KEPT_DEFINES}", "--kept", str(file)]
    seen = []
    for turn in range(2):
        process = subprocess.Popen(command, cwd=paths.ROOT, stdout=subprocess.PIPE, text=True)
        port = process.stdout.readline().split()[2].rstrip(",")
        link = connect(port)
        until(lambda link=link: link.read(symbols.find("board_drive.state").address, 2) == b"\x01\x00", "not STOPPED")
        seen.append((gain.value(link.read(gain.address, 2)), state.value(link.read(state.address, 2))))
        if turn == 0:
            link.write(gain.address, gain.data(seen[0][0] + 5))
            link.write(request.address, request.data(table("REQUEST")["KEEP"][0]))
            until(lambda link=link: state.value(link.read(state.address, 2)) == table("STATE")["KEPT"][0], "not kept")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10)
        assert process.returncode == 0
    assert seen == [(seen[0][0], table("STATE")["NONE"][0]), (seen[0][0] + 5, table("STATE")["KEPT"][0])]


@pytest.mark.parametrize("arguments, part", [
    ([], "this firmware keeps no parameters"), ([f"--defines={KEPT_DEFINES}"], "is no file of kept parameters")])
def test_a_file_that_cannot_be_is_refused_in_one_line(tmp_path: Path, arguments: list[str], part: str) -> None:
    file = tmp_path / "flash"
    file.write_text("no flash")
    done = subprocess.run([sys.executable, "-m", "tools.live.board", *arguments, "--kept", str(file)], cwd=paths.ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and part in done.stderr and done.stderr.count("\n") == 1
    assert file.read_text() == "no flash"


def test_a_real_board_and_the_simulated_chip_have_no_file() -> None:
    with pytest.raises(UserError, match="leave KEPT or CPU=33f out"), flash_in(Path("flash"), kept_parts().library, True):
        pass
    done = subprocess.run([sys.executable, "-m", "tools.live", "--port", "/dev/null", "--kept", "flash"], cwd=paths.ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "a real board has its own flash" in done.stderr and done.stderr.count("\n") == 1
