"""The page of make live on the simulated chip that runs the image. Needs XC16."""

import contextlib
import time

import pytest
import xc16

from tools.bench import pil
from tools.live import board as live_board
from tools.live import step
from tools.live.__main__ import main
from tools.live.pace import Pacemaker
from tools.live.recording import Origin
from tools.live.symbols import Symbols
from tools.live.virtual_board import VirtualBoard

pytestmark = pytest.mark.xc16
LONGEST_S = 120.0
"""A busy machine is slower than real time."""


class Living:
    """A board that lives in a thread of its own, with the scope's thread."""

    def __init__(self) -> None:
        made = live_board.parts(cpu="33f")
        self.symbols = Symbols.read(made.symbols)
        self.board = VirtualBoard(made.library, Origin(made.motor, made.board, [live_board.SCOPE], {}), self.symbols, None, made.image)
        self.maker = Pacemaker(self.board, lambda frame: None)
        self.board.start(lambda message: None)
        self.maker.start()

    def do(self, **command) -> None:
        self.maker.call(lambda: self.board.act(command)).result(20)

    @staticmethod
    def until(found, what) -> None:
        end_s = time.monotonic() + LONGEST_S
        while not found():
            assert time.monotonic() < end_s, what()
            time.sleep(0.05)

    def close(self) -> None:
        self.board.end()
        self.maker.end()
        assert self.maker.error is None, self.maker.error


@pytest.fixture(scope="module")
def living():
    if not xc16.COMPILER:
        pytest.skip(xc16.NONE)
    with contextlib.closing(Living()) as item:
        yield item


@pytest.mark.parametrize("words, told", [
    (("--image", "an.elf"), "an image for the PC's processor, IMAGE: add CPU=33f"),
    (("--cpu", "33f", "--port", "/dev/null"), "CPU"), (("--cpu", "33f", "--image", "no such.elf"), "no such.elf")])
def test_what_does_not_go_with_an_image_is_one_line(capsys, words, told) -> None:
    assert main([*words, "--listen", "0"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("foc33: ") and said.count("\n") == 1 and told in said


def test_constants_of_the_image_are_no_variables(living) -> None:
    assert "board_drive.run.control.i_q13.q" in living.symbols.variables
    assert not [name for name, item in living.symbols.variables.items() if name.startswith("board_params") or item.address >= 0x8000]


def test_the_motor_starts_a_step_is_measured_and_it_stops(living, monkeypatch) -> None:
    monkeypatch.setattr(step, "RECORDS", 1)
    assert isinstance(living.board.board, pil.PilBoard) and living.board.hello()["chip"]
    living.do(set=["input.pot", 0.5])
    living.do(press="S2")
    living.do(release="S2")
    living.until(lambda: living.board.state == "CLOSED", lambda: living.board.state)
    living.do(measure={"step": "load", "size": 40})
    living.until(lambda: not living.board.loops.told["running"], lambda: living.board.loops.steps.told)
    told = living.board.loops.steps.told
    assert told["said"] == "mean of 1 steps" and 0.03 < told["figures"]["measured"]["peak"] < 0.3, told
    frame = living.maker.call(living.board.frame).result(20)
    assert frame["state"] == "CLOSED" and 0.0 < frame["now"]["i_q_a"] < 1.0 and frame["now"]["speed_rpm"] == pytest.approx(1475.0, rel=0.05)
    living.do(press="S2")
    living.do(release="S2")
    living.until(lambda: living.board.state == "STOPPED", lambda: living.board.state)
