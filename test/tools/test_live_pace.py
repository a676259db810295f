"""The pace of make live: twenty frames a second in real time, slower where the machine is, and never a rush to catch up."""

import numpy as np
import pytest
from support import refusal

from tools.common.errors import UserError
from tools.live.pace import BEHIND_S, FRAME_S, QUICK_SLICES, SLICES, Pacemaker, RealTime


class Clock:
    """Time that passes only when somebody waits or works."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class Board:
    """Takes `work_s` of the clock for each piece of its time."""

    def __init__(self, clock: Clock, work_s: float = 0.002) -> None:
        self.clock, self.work_s, self.time_s, self.told_pace = clock, work_s, 0.0, 1.0
        self.begins: list[float] = []
        self.hurries, self.pieces = False, 0

    def run(self, seconds: float) -> None:
        self.pieces += 1
        if self.work_s < 0.0:
            raise ValueError("the supply is gone")
        self.time_s += seconds
        self.clock.now_s += self.work_s

    def paced(self, pace: float) -> None:
        self.told_pace = pace

    def frame(self) -> dict:
        self.begins.append(self.clock.now_s)
        return {"t": self.time_s}


def lived(frames: int, board_of, pace: float = 1.0, happens=lambda maker, number: None):
    """A pacemaker's life of so many frames, without a thread and without waiting."""
    clock = Clock()
    board = board_of(clock)
    published: list[dict] = []

    def publish(frame: dict) -> None:
        published.append(frame)
        happens(maker, len(published))
        maker.ended = len(published) == frames

    maker = Pacemaker(board, publish, pace, clock)
    maker.serve = lambda until: (Pacemaker.serve(maker, clock.now_s), setattr(clock, "now_s", max(clock.now_s, until)))
    maker._live()
    return board, published, maker


@pytest.mark.parametrize("hurries, pieces", [(False, SLICES), (True, QUICK_SLICES)])
def test_a_board_that_hurries_runs_in_smaller_pieces_with_as_many_frames(hurries, pieces):
    def of(clock: Clock) -> Board:
        board = Board(clock, 0.0005)
        board.hurries = hurries
        return board
    board, published, _ = lived(21, of)
    assert board.pieces == 21 * pieces and published[-1]["t"] == pytest.approx(21 * FRAME_S) and np.diff(board.begins) == pytest.approx(FRAME_S)


@pytest.mark.parametrize("pace", [1.0, 0.1, 0.001])
def test_twenty_frames_a_second_show_motor_time_at_the_pace(pace):
    board, published, _ = lived(41, Board, pace)
    gaps = [later - earlier for earlier, later in zip(board.begins, board.begins[1:])]
    assert gaps == pytest.approx([FRAME_S] * 40) and published[-1]["t"] == pytest.approx(41 * FRAME_S * pace)
    assert published[-1]["measured"] == pytest.approx(pace) and published[-1]["pace"] == pace and published[0]["measured"] is None


def test_a_slow_machine_says_how_much_it_manages():
    _, published, _ = lived(41, lambda clock: Board(clock, 0.02))
    assert published[-1]["measured"] == pytest.approx(0.5)


def test_after_a_pause_a_quarter_of_a_second_is_made_up_and_the_rest_is_lost():
    def stumble(maker, number):
        maker.clock.now_s += 3.0 if number == 10 else 0.0

    board, _, _ = lived(60, Board, happens=stumble)
    gaps = [later - earlier for earlier, later in zip(board.begins, board.begins[1:])]
    late = sum(1 for gap in gaps if gap < 0.9 * FRAME_S)
    assert max(gaps) == pytest.approx(3.01, abs=0.05) and 0 < late <= BEHIND_S / (FRAME_S - 0.01) + 1 and gaps[-10:] == pytest.approx([FRAME_S] * 10)


def test_real_time_counts_what_is_lost():
    clock = Clock()
    real_time = RealTime(clock)
    assert real_time.next(0.01) == pytest.approx(100.01) and real_time.lost_s == 0.0
    clock.now_s += 0.2 # made up for
    assert [real_time.next(0.01), real_time.next(0.01)] == pytest.approx([100.02, 100.03]) and real_time.lost_s == 0.0
    clock.now_s += 2.0
    assert real_time.next(0.01) == pytest.approx(clock.now_s - BEHIND_S) and real_time.lost_s == pytest.approx(102.2 - BEHIND_S - 100.04)


def test_what_somebody_asks_for_is_done_between_two_frames_and_errors_go_to_the_one_who_asked():
    answers = []

    def ask(maker, number):
        if number == 3:
            answers.extend([maker.call(lambda: maker.board.time_s), maker.call(lambda: 1 / 0)])

    _, published, _ = lived(5, Board, happens=ask)
    assert answers[0].result(0) == pytest.approx(3 * FRAME_S) and isinstance(answers[1].exception(0), ZeroDivisionError) and len(published) == 5


def test_a_new_pace_is_measured_from_then_on():
    board, published, _ = lived(50, Board, happens=lambda maker, number: maker.set_pace(0.1) if number == 25 else None)
    assert board.told_pace == 0.1
    assert published[30]["measured"] is None and published[-1]["measured"] == pytest.approx(0.1, rel=0.01)


def test_a_pace_that_the_board_refuses_is_not_taken():
    class RealTimeOnly(Board):
        def paced(self, pace: float) -> None:
            raise UserError("a real board has real time", "PACE", "leave it out")

    maker = Pacemaker(RealTimeOnly(Clock()), lambda frame: None)
    refusal(lambda: maker.set_pace(0.1), "real time")
    assert maker.pace == 1.0


def test_the_end_of_a_board_reaches_all_who_wait():
    clock = Clock()
    published: list[dict] = []
    maker = Pacemaker(Board(clock, -1.0), published.append, clock=clock)
    before = maker.call(lambda: 1)
    maker.start()
    maker.thread.join(5.0)
    assert published == [{"ended": "the supply is gone"}] and str(maker.error) == "the supply is gone"
    for future in (before, maker.call(lambda: 1)):
        refusal(lambda future=future: future.result(0), "the board has stopped")
    maker.end() # does not hang
