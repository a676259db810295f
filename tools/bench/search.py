"""How far something may go before it fails: values outwards from one that holds, then bisection; many such searches side by side."""

import math
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Search:
    """How far something may go in one direction from `start`: `good` still does, `bad` is the first that does not, `why` says what happens
    there. No `bad`: all that were tried do. What works again beyond the first failure does not count."""

    upwards: bool
    holds: Callable[[dict[str, Any]], bool]
    start: float
    tried: dict[float, tuple[bool, str]] = field(default_factory=dict)
    good: float = field(init=False, default=0.0)
    bad: float | None = field(init=False, default=None)
    why: str = field(init=False, default="")

    @property
    def fails_at_once(self) -> bool:
        return self.bad == self.start

    def narrow(self, value: float, row: dict[str, Any]) -> None:
        """Learn from one run."""
        self.tried[value] = (self.holds(row), row["verdict"])
        self.good, self.bad, self.why = self.start, None, ""
        for known in sorted(self.tried, reverse=not self.upwards):
            holds, verdict = self.tried[known]
            if not holds:
                self.bad, self.why = known, verdict
                return
            self.good = known

    def next(self, resolution: float) -> float | None:
        """The value to try next; None when it is known well enough."""
        if self.bad is None or self.fails_at_once or max(self.good, self.bad) / min(self.good, self.bad) <= 1.0 + resolution:
            return None
        return math.sqrt(self.good * self.bad)


def in_rounds(first: Iterable[tuple[Hashable, float]], searches: dict[Any, Search], group: Callable[[Any], Hashable], percent: float,
              run: Callable[[int, list[tuple[Any, float]]], list[dict[str, Any]]]) -> None:
    """Rounds of runs until each search knows its end to so many per cent. A run is of a group and a value; group() tells that of a search's key.
    `run` gets the number of the round."""
    def unknown() -> list[tuple[Any, float]]:
        found = ((group(key), search.next(percent / 100.0)) for key, search in searches.items())
        return list(dict.fromkeys((name, value) for name, value in found if value is not None))

    wanted, number = list(first) or unknown(), 0
    while wanted:
        number += 1
        for (name, value), row in zip(wanted, run(number, wanted)):
            for key, search in searches.items():
                if group(key) == name and (value == search.start or (value > search.start) == search.upwards):
                    search.narrow(value, row)
        wanted = unknown()
