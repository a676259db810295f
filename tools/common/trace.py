"""A recording of the virtual board: named columns over time, one row a PWM period."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Trace:
    """`data` holds one line per signal, so that a signal is contiguous."""

    names: list[str]
    time_s: np.ndarray
    data: np.ndarray
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
        return Trace(self.names, self.time_s[first:last], self.data[:, first:last])

    def thinned(self, step: int) -> "Trace":
        """Every step-th row."""
        return Trace(self.names, self.time_s[::step].copy(), self.data[:, ::step].copy())

    def changes(self, name: str) -> list[tuple[int, float]]:
        """Rows at which a signal gets another value, the first row included: (row, value)."""
        if not len(self):
            return []
        column = self.column(name)
        rows = np.concatenate(([0], np.flatnonzero(np.diff(column)) + 1))
        return [(int(row), float(column[row])) for row in rows]


def wrapped_deg(angle_deg: np.ndarray) -> np.ndarray:
    """Angles brought to -180 .. 180 degrees."""
    return (np.asarray(angle_deg, dtype=np.float64) + 180.0) % 360.0 - 180.0
