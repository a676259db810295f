"""Measures what a motor does after a step of the q current, of the speed reference and of the load, over any link of the scope's.

The firmware's sine without a frequency is a constant beside the q current asked for (firmware/drive/modes/modes.c): its begin is the step."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .lnet import Channel, Trigger
from .response import CURRENT_SHARE, POLL_S, RUN, SINE, SIZE_MOST, TURN, Bench

Told = Callable[[int], None]
"""Hears how many records there are."""

STEPS = ("current", "speed", "load")
RECORDS = 8
"""Whose mean is the answer: the highest place of a single speed's record is a ripple of the estimate, and one load's dip is as much as half deeper than
another, by where in its turn the rotor is when the load comes."""
CURRENT_STEP, SPEED_STEP = CURRENT_SHARE, 0.1
"""Of the largest current; of the speed."""
BEFORE = 0.1
"""Of a record, before the step."""
SETTLED = {"current": 0.1, "speed": 0.1, "load": 0.02}
"""Of the step, of the load's: of the speed."""
QUARTER = 16384
REST_S, UNLOADED_S, BACK_S = 0.5, 1.0, 20.0
LEFT_STEPS = 100
"""Slow steps that the current's step lasts."""


@dataclass(frozen=True)
class Answer:
    """A step's answer over the time since the step: 0 before and 1 afterwards; after a load, the speed's share that is missing."""

    step: str
    time_s: np.ndarray
    measured: np.ndarray
    expected: np.ndarray


    @property
    def ripple(self) -> float:
        """Of what is measured before the step, its standard deviation: so much of a peak may be ripple."""
        before = self.measured[self.time_s < 0.5 * self.time_s[0]]
        return float(before.std()) if len(before) else 0.0


@dataclass(frozen=True)
class Figures:
    """What is told of an answer."""

    rise_s: float | None
    """from 10 to 90 %; a load has none, nor has what does not come so far"""
    peak: float
    """beyond 1; of a load, the dip"""
    settled_s: float | None
    """None: not within the record"""


def figures(step: str, time_s: np.ndarray, values: np.ndarray) -> Figures:
    """Rise, overshoot and settling time of an answer."""
    after = time_s >= 0.0
    at, value = time_s[after], values[after]
    final = 0.0 if step == "load" else 1.0
    outside = np.nonzero(np.abs(value - final) > SETTLED[step])[0]
    settled = 0.0 if not len(outside) else None if outside[-1] + 1 >= len(at) else float(at[outside[-1] + 1])
    if step == "load":
        return Figures(None, float(-value.min()), settled)
    rise = [float(np.interp(level, np.maximum.accumulate(value), at)) for level in (0.1, 0.9)]
    return Figures(rise[1] - rise[0] if value.max() >= 0.9 else None, float(value.max() - 1.0), settled)


def answer_of(closed: np.ndarray) -> np.ndarray:
    """The step's answer of a closed loop that is given at the frequencies k/(2 n T) from 0 to the Nyquist frequency."""
    return np.cumsum(np.fft.irfft(closed))


def current(bench: Bench, share: float = CURRENT_STEP, told: Told = lambda done: None) -> tuple[np.ndarray, np.ndarray]:
    """Times since the step, and the q current as a share of it."""
    firmware, names = bench.firmware, [f"{SINE}.left", f"{RUN}.control.i_q13.q", f"{RUN}.control.ref_q13.q", f"{RUN}.control.i_q13.d"]
    size, records = min(SIZE_MOST, round(8.0 * share * bench.params["MAXIMUM_CURRENT_A"] / bench.params["COUNT_CURRENT_A"])), []
    for name, value in (("left", 0), ("step", 0), ("angle", QUARTER), ("size_iq_q16", size), ("size_rho_q17", 0)):
        firmware.put(f"{SINE}.{name}", value)
    left = firmware.of(f"{SINE}.left")
    rows = firmware.link.scope_state().size // (2 * len(names))
    before = round(BEFORE * rows)
    for done in range(RECORDS):
        bench.pause(0.05)
        firmware.link.scope_setup([Channel(item.address, item.bytes, item.signed) for item in map(firmware.of, names)],
                                  Trigger(left.address, 1, True, False), -before, 1)
        bench.pause(0.02)
        firmware.put(left.name, LEFT_STEPS)
        while firmware.link.scope_state().running:
            bench.pause(POLL_S)
        record = np.array(firmware.link.scope_read(), dtype=float)
        bench.pause(LEFT_STEPS * bench.slow_s)
        records.append((record[:, 1] - record[:before - 1, 1].mean()) / (size / 8.0))
        told(done + 1)
    shortest = min(map(len, records))
    return (np.arange(shortest) - before) * bench.period_s, np.mean([record[:shortest] for record in records], axis=0)


def _record(bench: Bench, seconds: float, act: Callable[[], None]) -> tuple[np.ndarray, np.ndarray, float]:
    """Times, and the estimated speed in electrical rpm: a record during which something is done; and its mean before."""
    firmware, name = bench.firmware, f"{RUN}.observer.omega_q16"
    firmware.put(f"{SINE}.left", 0)
    bench.pause(REST_S)
    rows = firmware.link.scope_state().size // 4
    factor = max(1, round(seconds / rows / bench.period_s))
    firmware.link.scope_setup([firmware.of(name).channel], factor=factor)
    bench.pause(BEFORE * seconds)
    act()
    while firmware.link.scope_state().running:
        bench.pause(POLL_S)
    record = np.array(firmware.link.scope_read(), dtype=float)[:, 0] / TURN
    return np.arange(len(record)) * factor * bench.period_s, record, float(record[:max(2, round(0.5 * BEFORE * len(record)))].mean())


def speed(bench: Bench, seconds: float, step: float = SPEED_STEP, told: Told = lambda done: None) -> tuple[np.ndarray, np.ndarray]:
    """A step of the reference, past its ramp."""
    firmware, reference, records = bench.firmware, f"{RUN}.control.reference_erpm", []
    before = firmware.get(reference)
    target = before + round(step * before)

    def act() -> None:
        bench.aim(target)
        firmware.put(reference, target)
    for done in range(RECORDS):
        time_s, erpm, first = _record(bench, seconds, act)
        share = (erpm - first) / (target - before)
        records.append((time_s - _begin(time_s, share), share))
        bench.aim(before)
        _comes_back(bench, reference, before)
        told(done + 1)
    return _mean(records)


def _comes_back(bench: Bench, reference: str, before: int) -> None:
    """Until the reference's ramp is at its end, and the speed with it."""
    end_s = BACK_S
    while bench.firmware.get(reference) != before and end_s > 0.0:
        bench.pause(POLL_S)
        end_s -= POLL_S
    bench.pause(REST_S)


def load(bench: Bench, seconds: float, put: Callable[[bool], None], told: Told = lambda done: None) -> tuple[np.ndarray, np.ndarray]:
    """A load that `put` puts on and takes off: the speed's change, of the speed."""
    records = []
    for done in range(RECORDS):
        time_s, erpm, first = _record(bench, seconds, lambda: put(True))
        put(False)
        bench.pause(UNLOADED_S)
        share = erpm / first - 1.0
        records.append((time_s - _begin(time_s, -share), share))
        told(done + 1)
    return _mean(records)


def _mean(records: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    since_s = records[0][0]
    return since_s, np.mean([np.interp(since_s, time_s, share) for time_s, share in records], axis=0)


def _begin(time_s: np.ndarray, share: np.ndarray) -> float:
    """When something begins: the straight line through a quarter and a half of the largest, at 0."""
    half = int(np.argmax(share >= 0.5 * share.max()))
    quarter = half - int(np.argmax(share[half::-1] < 0.25 * share.max()))
    low, high = (time_s[k - 1] + (level * share.max() - share[k - 1]) / (share[k] - share[k - 1]) * (time_s[k] - time_s[k - 1])
                 for k, level in ((quarter + 1, 0.25), (half, 0.5)))
    return max(0.0, float(2.0 * low - high))
