"""What the image makes of a PWM at the command input while it turns the motor: each duty at each frequency, to a count. Needs XC16."""

from collections.abc import Iterator

import pytest
from pytest import approx

import xc16
from chip import ROOT, library, pass_ms
from tools.bench.pil import PilBoard
from tools.common.drive_tables import states

pytestmark = pytest.mark.xc16
CLOSED = next(number for number, row in enumerate(states()) if row.name == "CLOSED")
COUNT_S = 200e-9


@pytest.fixture(scope="module")
def board() -> Iterator[PilBoard]:
    if not xc16.COMPILER:
        pytest.skip(xc16.NONE)
    xc16.made("firmware", "APP=rc", "DEFINES=-DPULSE_DUTY=1", "VARIANT=pwm-command")
    chip = PilBoard(library, ROOT / "build" / "target-pwm-command" / "foc33.elf")
    chip.lock_step(False)
    chip.set("input.pulse_hz", 1000.0)
    chip.set("input.pulse_duty", 0.05)
    chip.power_up()
    pass_ms(chip, 1000)
    chip.set("input.pulse_duty", 0.5)
    pass_ms(chip, 3000)
    yield chip
    chip.close()


@pytest.mark.parametrize("hz", [91, 100, 249, 400, 1000, 3000, 7000, 10000])
def test_the_duty_is_the_command_in_each_millisecond(board: PilBoard, hz: float) -> None:
    assert board.get("fw.state") == CLOSED
    board.set("input.pulse_hz", hz)
    for duty in (0.05, 0.3, 0.5, 0.7, 0.95):
        board.set("input.pulse_duty", duty)
        pass_ms(board, 100)
        found, doubts = [], []
        for _ in range(40):
            pass_ms(board, 1)
            share, doubt_ms = (board.variable(name, 1)[0] & 0xFFFF for name in ("command_q16", "doubt_ms"))
            found.append(share / 65535 * 0.9 + 0.05)
            doubts.append(doubt_ms)
        assert found == approx([duty] * 40, abs=1.2 * COUNT_S * hz + 1e-4)
        assert max(doubts) <= max(2.0, 2200.0 / hz)
    board.set("input.pulse_duty", 0.5)
    pass_ms(board, 1500)
