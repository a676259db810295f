"""Lets a board run in real time, in a thread of its own: a frame every 50 ms, and between two frames what somebody asks for."""

import contextlib
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from tools.common.errors import UserError

FRAMES_PER_S = 20
FRAME_S = 1.0 / FRAMES_PER_S
SLICES = 5
"""Of a frame's time; between them characters of the serial line change hands."""
QUICK_SLICES = 25
"""While a step is measured: between the two words that make it the reference's ramp goes on."""
LEAST_SLICE_S = 0.001
BEHIND_S = 0.25
"""What a board makes up for; else it would run too fast after a while in which the machine was busy."""
MEASURED_S = 1.0
PACES = (1.0, 0.1, 0.01, 0.001)
"""Motor seconds in a second that the page offers."""


class RealTime:
    """When a board's next piece of time is due. What a busy machine is late beyond BEHIND_S is lost and not made up for."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self.due_s, self.lost_s = clock(), 0.0

    def next(self, seconds: float) -> float:
        """A piece that takes so long has begun; returns when it is over."""
        end_s, earliest_s = self.due_s + seconds, self.clock() - BEHIND_S
        self.lost_s += max(earliest_s - end_s, 0.0)
        self.due_s = max(end_s, earliest_s)
        return self.due_s


class Pacemaker:
    """`board` has run(seconds), paced(pace), frame(), time_s and hurries; each frame, with its pace, goes to `publish`."""

    def __init__(self, board: Any, publish: Callable[[dict[str, Any]], None], pace: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        self.board, self.publish, self.pace, self.clock = board, publish, pace, clock
        self.asked: queue.Queue[tuple[Callable[[], Any], Future]] = queue.Queue()
        self.measured: deque[tuple[float, float]] = deque()
        self.ended = False
        self.error: Exception | None = None
        self.thread = threading.Thread(target=self._live, name="board", daemon=True)

    def start(self) -> None:
        self.thread.start()

    def end(self) -> None:
        """Returns when the board stands still."""
        self.ended = True
        self.asked.put((lambda: None, Future()))
        self.thread.join()

    def call(self, work: Callable[[], Any]) -> Future:
        """Lets the board's thread do this between two frames."""
        result: Future = Future()
        self.asked.put((work, result))
        if not self.thread.is_alive() and self.thread.ident is not None: # nobody serves any more
            self._refuse()
        return result

    def _refuse(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                self.asked.get_nowait()[1].set_exception(UserError("the board has stopped"))

    def set_pace(self, pace: float) -> None:
        """To be asked by call() while the board lives."""
        self.board.paced(pace)
        self.pace = pace
        self.measured.clear()

    def _live(self) -> None:
        try:
            real_time = RealTime(self.clock)
            while not self.ended:
                self.frame(real_time)
        except Exception as error: # whoever waits for frames must hear of it
            self.error = error
            self.publish({"ended": str(error)})
        self._refuse()

    def frame(self, real_time: RealTime) -> None:
        """The time of one frame passes, in slices."""
        seconds = FRAME_S * self.pace
        slices = max(1, min(QUICK_SLICES if self.board.hurries else SLICES, round(seconds / LEAST_SLICE_S)))
        for number in range(1, slices + 1):
            self.board.run(seconds / slices)
            if number == slices:
                self.show()
            self.serve(real_time.next(FRAME_S / slices))
            if self.ended:
                return

    def show(self) -> None:
        """A frame for the pages."""
        now, motor_s = self.clock(), self.board.time_s
        if self.measured and motor_s < self.measured[-1][1]: # powered up again
            self.measured.clear()
        self.measured.append((now, motor_s))
        while now - self.measured[0][0] > MEASURED_S:
            self.measured.popleft()
        self.publish(self.board.frame() | {"pace": self.pace, "measured": self.measured_pace()})

    def measured_pace(self) -> float | None:
        """Motor seconds in a second, of the last second; None until there is something to measure."""
        (first, first_s), (last, last_s) = self.measured[0], self.measured[-1]
        return (last_s - first_s) / (last - first) if last - first > 0.5 * MEASURED_S else None

    def serve(self, until: float) -> None:
        """Does what is asked for until it is time for the next frame."""
        while (left_s := until - self.clock()) > 0.0 or not self.asked.empty():
            try:
                work, result = self.asked.get(timeout=max(left_s, 0.0))
            except queue.Empty:
                return
            try:
                result.set_result(work())
            except Exception as error: # the one who asked is told
                result.set_exception(error)
            if self.ended:
                return
