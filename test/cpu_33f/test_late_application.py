"""An application that does not return, in the image: the drive stops in order, then the fault has its name, also after the watchdog's reset. Needs XC16."""

from collections.abc import Iterator

import pytest

import xc16
from chip import ROOT, library, pass_ms
from tools.bench.pil import PilBoard
from tools.common.drive_tables import faults, states

pytestmark = pytest.mark.xc16
STATE = {row.name: number for number, row in enumerate(states())}
APPLICATION = next(row.code for row in faults() if row.name == "APPLICATION")


@pytest.fixture(scope="module")
def image() -> None:
    if not xc16.COMPILER:
        pytest.skip(xc16.NONE)
    xc16.made("firmware", "APP=test/cpu_33f/late_app.c", "VARIANT=late-app")


@pytest.fixture
def board(image: None) -> Iterator[PilBoard]: # pylint: disable=unused-argument
    chip = PilBoard(library, ROOT / "build" / "target-late-app" / "foc33.elf")
    chip.lock_step(False)
    yield chip
    chip.close()


def until(chip: PilBoard, key: str, value: float, most_ms: int) -> int:
    """Milliseconds until the board's key has the value."""
    for ms in range(most_ms):
        if chip.get(key) == value:
            return ms
        pass_ms(chip, 1)
    return most_ms


def turning(board: PilBoard) -> PilBoard:
    board.power_up()
    assert until(board, "fw.state", STATE["CLOSED"], 3000) < 3000
    pass_ms(board, 1500)
    assert abs(board.get("plant.speed_rpm") - 1500.0) < 15.0
    return board


def test_an_application_that_returns_late_stops_the_motor_in_order_by_name(board: PilBoard) -> None:
    turning(board).set("input.s2", 1.0)
    assert 20 <= until(board, "fw.state", STATE["STOPPING"], 100) <= 24
    board.set("input.s2", 0.0)
    pass_ms(board, 200)
    assert board.get("fw.state") == STATE["STOPPING"] and 500.0 < board.get("plant.speed_rpm") < 1450.0 # it has returned, and the stop goes on
    assert until(board, "fw.fault", APPLICATION, 3000) < 3000 and board.get("pwm.outputs_on") == 0.0
    assert 0.0 <= board.get("plant.speed_rpm") < 500.0


def test_an_application_that_does_not_return_stops_the_motor_in_order_by_name(board: PilBoard) -> None:
    turning(board).set("input.s3", 1.0)
    late_ms = until(board, "fw.state", STATE["STOPPING"], 100)
    assert 20 <= late_ms <= 24
    stopped_ms = until(board, "fw.fault", APPLICATION, 3000)
    assert 100 < stopped_ms < 3000 and board.get("pwm.outputs_on") == 0.0
    assert 0.0 <= board.get("plant.speed_rpm") < 500.0
    pass_ms(board, 500) # the watchdog has reset it, again and again
    assert board.get("fw.fault") == APPLICATION and board.get("pwm.outputs_on") == 0.0
