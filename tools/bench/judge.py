"""How a run with a fault ended, against the same run without it."""

from dataclasses import dataclass, replace

import numpy as np

from tools.common import drive_tables
from tools.common.trace import Trace

NO_EFFECT, RIDDEN, RIGHT, ANOTHER = "no effect", "ridden through", "stopped, right code", "stopped, another code"
UNKNOWABLE, SILENT = "cannot be known", "wrong and silent"
CLASSES = (NO_EFFECT, RIDDEN, RIGHT, ANOTHER, UNKNOWABLE, SILENT)
VOID = "no comparison"
"""The run without the fault does not do what the scene asks for."""
SETTLE_S, JUDGE_S = 1.0, 0.5
"""A ride-through has this time to be back within limits, and must then stay there for that time."""
BAND_OF_SPEED, BAND_OF_RATED = 0.03, 0.02
"""How far the speed may be off that of the run without the fault."""
CURRENT_MARGIN = 1.1
"""Of the most that the header allows, or of what the run without the fault takes."""
MEAN_S, CURRENT_S = 0.01, 0.005
"""The speed is judged as a mean over the first, as a rule; more current than allowed counts when it lasts for the second."""
BACKWARDS_TURNS = 0.5
"""Mechanical turns against its direction that a motor may make: a rotor recoils when a block lets it go."""
HOLDS_BACK = ("VOLTAGE", "CURRENT", "BRAKE", "RAMP_WAITS")
"""Reasons for a speed that is not the reference."""
HOLDS_OFF = ("TOO_FAST",)
"""Reasons for a start that waits."""
SAME_SPEED, SAME_CURRENT = 0.003, 0.05
"""Of rated speed and most current: smaller differences are no effect."""


@dataclass(frozen=True)
class Unseen:
    """What no firmware can know of a fault; docs/faults.md has the calculations."""

    clock: float = 1.0
    """the speed is as many times as high, or less of it where a limit holds it back, and what changes it comes as much later"""
    more_rpm: float = 0.0
    """and so many rpm off"""
    start_current: float = 1.0
    """before closed loop the current is as many times that of a start without the fault"""


@dataclass(frozen=True)
class Limits:
    """What a verdict needs to know of the case. `codes`: names of the faults that fit; `faults`: names by number."""

    injected_s: float
    settled_s: float
    """from here on a ride-through must be within limits"""
    rated_rpm: float
    most_current_a: float
    codes: tuple[str, ...]
    faults: dict[int, str]
    closed: tuple[int, ...]
    """numbers of the states in closed loop; before, a rotor swings while it is aligned"""
    limited_is_right: bool = False
    mean_s: float = MEAN_S
    """over which the speed is judged; a turn where the load pulses with it"""
    unseen: Unseen = Unseen()


@dataclass(frozen=True)
class Verdict:
    """The class, and what was seen. `why`: of a wrong end, what was wrong; of a stop, nothing."""

    outcome: str
    code: str = ""
    after_s: float | None = None
    why: str = ""
    speed_error_percent: float | None = None
    current_peak_a: float = 0.0


def judge(with_fault: Trace, without: Trace, limits: Limits) -> Verdict:
    """The verdict on two traces with the same signals."""
    step = max(with_fault.step, without.step)
    with_fault, without = (trace.thinned(step // trace.step) if trace.step < step else trace for trace in (with_fault, without))
    after = with_fault.part(limits.injected_s, np.inf)
    reference = without.part(limits.injected_s, np.inf)
    rows = min(len(after), len(reference))
    after, reference = _first(after, rows), _first(reference, rows)
    error_percent = _speed_error_percent(after, reference, limits)
    peak_a = float(np.max(_amplitude(after), initial=0.0))
    if own := _first_code(without, limits)[0]:
        return Verdict(VOID, own, None, f"without the fault it ends in {own}", error_percent, peak_a)
    code, after_s = _first_code(with_fault, limits)
    if code:
        why = _still_on(after, reference)
        outcome = SILENT if why else RIGHT if code in limits.codes else ANOTHER
        return Verdict(outcome, code, after_s, why, error_percent, peak_a)
    if (code := _kept_code(after, limits)) and not _kept_code(reference, limits):
        return Verdict(ANOTHER, code, None, "still stopped by the fault before", error_percent, peak_a)
    why = _wrong(after, reference, limits)
    if why and not _wrong(after, reference, limits, limits.unseen):
        return Verdict(UNKNOWABLE, "", None, why, error_percent, peak_a)
    outcome = SILENT if why else NO_EFFECT if _same(after, reference, limits) else RIDDEN
    return Verdict(outcome, "", None, why, error_percent, peak_a)


def _first(trace: Trace, rows: int) -> Trace:
    return Trace(trace.names, trace.time_s[:rows], trace.data[:, :rows])


def _first_code(trace: Trace, limits: Limits) -> tuple[str, float | None]:
    """The first fault that the drive names after the injection, and how long that took."""
    before = trace.part(-np.inf, limits.injected_s)
    known = float(before.column("fw.fault")[-1]) if len(before) else 0.0
    for row, code in trace.part(limits.injected_s, np.inf).changes("fw.fault"):
        if code not in (0.0, known):
            at_s = float(trace.part(limits.injected_s, np.inf).time_s[row])
            return limits.faults.get(int(code), f"{int(code)}"), at_s - limits.injected_s
        known = code
    return "", None


def _kept_code(after: Trace, limits: Limits) -> str:
    """A fault that the drive had before and cannot leave: it says so, and nothing turns."""
    stays = len(after) > 0 and after.column("fw.fault")[-1] != 0.0 and not _on_at_end(after)
    return limits.faults.get(int(after.column("fw.fault")[-1]), "") if stays else ""


def _still_on(after: Trace, reference: Trace) -> str:
    """A code without a stop is none; a drive that has been started again since may be on."""
    fault, on = after.column("fw.fault"), after.column("pwm.outputs_seen")
    return "the outputs stay on" if len(fault) and fault[-1] != 0.0 and on[-1] != 0.0 else ""


def _wrong(after: Trace, reference: Trace, limits: Limits, unseen: Unseen = Unseen()) -> str:
    """What is wrong with a run that has raised no fault, but for what nobody can know; "" if nothing is."""
    speed, expected = _smooth(after, "plant.speed_rpm", limits), _smooth(reference, "plant.speed_rpm", limits)
    drives_s = unseen.clock * (after.time_s - after.time_s[:1])
    later = np.interp(drives_s, after.time_s - after.time_s[:1], expected) if len(expected) else expected
    ends = np.sort(np.vstack((expected, unseen.clock * expected, unseen.clock * later)), axis=0)
    last, last_expected = _on_at_end(after), _on_at_end(reference)
    if last_expected and not last:
        waits = limits.limited_is_right and limited(after, after.time_s >= after.time_s[-1] - JUDGE_S, HOLDS_OFF) > 0.5
        return "" if waits else "stops without a code"
    if last and not last_expected:
        return "runs where it should stand"
    if _backwards(after, reference, limits):
        return "turns backwards"
    if _too_much_current(after, reference, limits, unseen.start_current):
        return "too much current"
    judged = after.time_s >= limits.settled_s
    off_rpm = np.maximum(np.maximum(ends[0] - speed, speed - ends[-1]), 0.0)[judged]
    band_rpm = np.maximum(BAND_OF_SPEED * np.abs(ends).max(axis=0), BAND_OF_RATED * limits.rated_rpm)[judged] + unseen.more_rpm
    if last_expected and np.any(off_rpm > band_rpm) and not (limits.limited_is_right and limited(after, judged) > 0.5):
        return f"speed off by up to {np.max(off_rpm):.0f} rpm"
    return ""


def _backwards(after: Trace, reference: Trace, limits: Limits) -> bool:
    """In closed loop, against the direction in which the motor without the fault turns, and further than that one does. What a rotor turns that
    the load has already driven backwards before the drive came on does not count until it first stands: it is being caught and reversed."""
    speed, expected = after.column("plant.speed_rpm"), reference.column("plant.speed_rpm")
    if not len(speed):
        return False
    direction = 1.0 if expected[np.argmax(np.abs(expected))] >= 0.0 else -1.0
    in_loop = np.isin(after.column("fw.state"), limits.closed)
    in_loop[:_driven_rows(direction * speed, after.column("pwm.outputs_seen") != 0.0, BAND_OF_RATED * limits.rated_rpm)] = False
    turns = -np.minimum(direction * speed[in_loop], 0.0).sum() * after.period_s / 60.0
    own_turns = -np.minimum(direction * expected, 0.0).sum() * after.period_s / 60.0
    return bool(turns > own_turns + BACKWARDS_TURNS)


def _driven_rows(along_rpm: np.ndarray, on: np.ndarray, band_rpm: float) -> int:
    """Rows until a rotor first stands that turned backwards when the outputs came on."""
    first = int(np.argmax(on))
    if not on[first] or along_rpm[first] >= -band_rpm:
        return 0
    stood = along_rpm[first:] >= 0.0
    return first + (int(np.argmax(stood)) if stood.any() else 0)


def _too_much_current(after: Trace, reference: Trace, limits: Limits, start_current: float) -> bool:
    in_loop = np.isin(after.column("fw.state"), limits.closed)
    most_a = max(limits.most_current_a, float(np.max(_amplitude(reference), initial=0.0)))
    start_a = float(np.max(_amplitude(reference)[~np.isin(reference.column("fw.state"), limits.closed)], initial=0.0))
    allowed_a = CURRENT_MARGIN * np.where(in_loop, most_a, max(most_a, start_current * start_a))
    over = _amplitude(after) > allowed_a
    rows = max(1, round(CURRENT_S / max(after.period_s, 1e-6)))
    return len(over) >= rows and bool(np.max(np.convolve(over, np.ones(rows), "valid")) >= rows)


def limited(trace: Trace, rows: np.ndarray, reasons: tuple[str, ...] = HOLDS_BACK) -> float:
    """The share of the rows in which the drive names one of these reasons."""
    if "fw.limits" not in trace or not np.any(rows):
        return 0.0
    mask = sum(row.code for row in drive_tables.limits() if row.name in reasons)
    return float(np.mean((trace.column("fw.limits")[rows].astype(np.int32) & mask) != 0))


def _on_at_end(trace: Trace) -> bool:
    return len(trace) > 0 and bool(trace.column("pwm.outputs_seen")[-1] != 0.0)


def _amplitude(trace: Trace) -> np.ndarray:
    """Of the true current vector."""
    return np.hypot(trace.column("plant.i_d"), trace.column("plant.i_q"))


def _smooth(trace: Trace, name: str, limits: Limits) -> np.ndarray:
    """The mean around each row; near an end that of the last whole turn, for a part of one has another mean."""
    values = trace.column(name).astype(np.float64)
    rows = max(1, round(limits.mean_s / max(trace.period_s, 1e-6)))
    if len(values) < rows:
        return values
    means = np.convolve(values, np.ones(rows) / rows, "valid")
    return np.pad(means, (rows // 2, rows - 1 - rows // 2), "edge")


def _speed_error_percent(after: Trace, reference: Trace, limits: Limits) -> float | None:
    """The largest difference once settled, of the rated speed."""
    judged = after.time_s >= limits.settled_s
    if not np.any(judged):
        return None
    off_rpm = (_smooth(after, "plant.speed_rpm", limits) - _smooth(reference, "plant.speed_rpm", limits))[judged]
    return float(100.0 * off_rpm[np.argmax(np.abs(off_rpm))] / limits.rated_rpm)


def _same(after: Trace, reference: Trace, limits: Limits) -> bool:
    """As if nothing had happened: states, speed and current."""
    if [value for _, value in after.changes("fw.state")] != [value for _, value in reference.changes("fw.state")]:
        return False
    off_rpm = np.abs(np.subtract(*(_smooth(trace, "plant.speed_rpm", replace(limits, mean_s=MEAN_S)) for trace in (after, reference))))
    off_a = np.abs(_amplitude(after) - _amplitude(reference))
    return bool(np.max(off_rpm, initial=0.0) <= SAME_SPEED * limits.rated_rpm
                and np.sqrt(np.mean(off_a ** 2)) <= SAME_CURRENT * limits.most_current_a)
