"""A recording of the virtual board: named columns over time, one row a PWM period; of a long one a row every few periods."""

from dataclasses import dataclass, field

import numpy as np

MOST_ROWS = 2_400_000
"""Of a recording: two minutes at 20 kHz, 0.3 GB of the usual signals."""
THINS = 3
"""What is left of a full recording: every third row. The slow work's 16 periods are no multiple of it, so that each of them is still seen."""


@dataclass
class Trace:
    """`data` holds one line per signal, so that a signal is contiguous."""

    names: list[str]
    time_s: np.ndarray
    data: np.ndarray
    step: int = 1
    """every so many rows of the recording are left"""
    index: dict[str, int] = field(init=False)

    def __post_init__(self) -> None:
        self.index = {name: i for i, name in enumerate(self.names)}

    def __contains__(self, name: str) -> bool:
        return name in self.index

    def __len__(self) -> int:
        return len(self.time_s)

    def column(self, name: str) -> np.ndarray:
        return self.data[self.index[name]]

    @property
    def period_s(self) -> float:
        return float(self.time_s[-1] - self.time_s[0]) / max(1, len(self) - 1) if len(self) else 0.0

    def part(self, from_s: float, to_s: float) -> "Trace":
        """Rows with from_s <= time < to_s, without copying."""
        first, last = np.searchsorted(self.time_s, (from_s, to_s))
        return Trace(self.names, self.time_s[first:last], self.data[:, first:last], self.step)

    def thinned(self, step: int) -> "Trace":
        """Every step-th row."""
        return Trace(self.names, self.time_s[::step].copy(), self.data[:, ::step].copy(), self.step * step)

    def changes(self, name: str) -> list[tuple[int, float]]:
        """Rows at which a signal gets another value, the first row included: (row, value)."""
        if not len(self):
            return []
        column = self.column(name)
        return [(row, float(column[row])) for row in (0, *(np.flatnonzero(column[1:] != column[:-1]) + 1).tolist())]


class Recording:
    """A trace while it grows. It never has more than `most` rows: a full one is thinned, and what comes then is thinned as it comes."""

    def __init__(self, names: list[str], most: int = MOST_ROWS) -> None:
        self.names, self.step = names, 1
        self._time_s, self._data = np.empty(most), np.empty((len(names), most), dtype=np.float32)
        self._rows = self._seen = 0

    def add(self, time_s: np.ndarray, rows: np.ndarray) -> None:
        """The next rows: a line each."""
        while self._rows + len(range(-self._seen % self.step, len(rows), self.step)) > len(self._time_s):
            self._thin()
        kept = slice(-self._seen % self.step, None, self.step)
        time_s, self._seen = time_s[kept], self._seen + len(rows)
        there = slice(self._rows, self._rows + len(time_s))
        self._time_s[there], self._data[:, there] = time_s, rows[kept].T
        self._rows = there.stop

    def _thin(self) -> None:
        left = len(range(0, self._rows, THINS))
        for line in (self._time_s, *self._data):
            line[:left] = line[:self._rows:THINS].copy()
        self._rows, self.step = left, self.step * THINS

    def trace(self) -> Trace:
        """What is there so far, without copying."""
        return Trace(self.names, self._time_s[:self._rows], self._data[:, :self._rows], self.step)


def wrapped_deg(angle_deg: np.ndarray) -> np.ndarray:
    """Angles brought to -180 .. 180 degrees."""
    return (np.asarray(angle_deg, dtype=np.float64) + 180.0) % 360.0 - 180.0
