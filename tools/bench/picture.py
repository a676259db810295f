"""The curves of a run over time, small enough for a page: each stretch of time keeps the lowest and the highest value of every curve."""

import json
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from tools.common import drive_tables
from tools.common.trace import Trace, wrapped_deg
from .run import HAND_OVER_AFTER_S, HAND_OVER_BEFORE_S, Run

RUN_STRETCHES = 12000
"""Of a run that has the page for itself; what happens around a hand-over and a fault is there in full."""
SWEEP_STRETCHES = 250
"""Of a run that shares the page with many."""
AROUND_FAULT_S = (0.04, 0.01)
BLOCK_ROWS = 100_000
"""All curves of a long run at once would take many times the room of its trace."""
MISSING = -32768
"""Where a curve has no value."""


@dataclass(frozen=True)
class Picture:
    """What the page's script draws."""

    head: str
    """JSON: panels, states, faults, reasons, events"""
    curves: bytes
    """deflated: the times in us (int32), then each curve in the head's order (int16); of both, what a value is above the one before"""


@dataclass(frozen=True)
class Curve:
    """One line of a panel."""

    name: str
    color: str
    values: np.ndarray
    style: str = ""
    """"thin", "dashed", or as usual"""


def of(run: Run, stretches: int) -> Picture:
    """The picture of a run; of one without a trace, what is known without."""
    trace = run.trace
    starts, widths = _stretches(run, stretches)
    rows = _rows(starts, widths)
    head: dict[str, Any] = {
        "title": run.scenario.name, "points": len(rows), "from_s": float(trace.time_s[0]) if len(trace) else 0.0,
        "to_s": float(trace.time_s[-1]) if len(trace) else 0.0, "panels": [],
        "states": [[at_s, name] for _, at_s, name in run.state_changes()],
        "faults": [[at_s, name] for _, at_s, name in run.fault_changes()],
        "limits": _limits(run, max(1, len(trace) // stretches)), "events": [[at_s, text] for at_s, text in run.protocol()]}
    parts = [_differences(np.round(trace.time_s[rows] * 1e6).astype(np.int32))]
    for title, unit, curves in _drawn(run, starts, widths):
        lines = []
        for curve in curves:
            counts, low, step = _counts(curve.values)
            lines.append({"name": curve.name, "color": curve.color, "style": curve.style, "low": low, "step": step})
            parts.append(_differences(counts))
        head["panels"].append({"title": title, "unit": unit, "lines": lines})
    return Picture(json.dumps(head, allow_nan=False), zlib.compress(b"".join(parts), 9))


def _drawn(run: Run, starts: np.ndarray, widths: np.ndarray) -> list[tuple[str, str, list[Curve]]]:
    """The panels that have curves, with a value for each of _rows(); made block by block."""
    edges = np.unique(np.append(np.searchsorted(starts, np.arange(0, len(run.trace), BLOCK_ROWS)), len(starts)))
    blocks = []
    for first, end in list(pairwise(edges.tolist())) or [(0, 0)]:
        from_row = int(starts[first]) if end else 0
        rows = slice(from_row, int(starts[end - 1] + widths[end - 1]) if end else 0)
        part = Trace(run.trace.names, run.trace.time_s[rows], run.trace.data[:, rows])
        blocks.append([(title, unit, [replace(curve, values=_lowest_and_highest(curve.values, starts[first:end] - from_row, widths[first:end]))
                                      for curve in curves]) for title, unit, curves in _panels(run, part) if curves])
    return [(title, unit, [replace(curve, values=np.concatenate([block[panel][2][line].values for block in blocks]))
                           for line, curve in enumerate(curves)]) for panel, (title, unit, curves) in enumerate(blocks[0])]


def _stretches(run: Run, most: int) -> tuple[np.ndarray, np.ndarray]:
    """First row and number of rows of each stretch."""
    rows = len(run.trace)
    starts = [np.arange(0, rows, max(1, -(-rows // most)))]
    if most == RUN_STRETCHES:
        for at_s, before_s, after_s in _in_full(run):
            starts.append(np.arange(*np.searchsorted(run.trace.time_s, (at_s - before_s, at_s + after_s))))
    first = np.unique(np.concatenate(starts))
    return first, np.diff(first, append=rows)


def _in_full(run: Run) -> Iterator[tuple[float, float, float]]:
    for item in run.hand_overs()[:3]:
        yield item.at_s, HAND_OVER_BEFORE_S, HAND_OVER_AFTER_S
    for _, at_s, _ in run.fault_changes()[1:4]:
        yield at_s, *AROUND_FAULT_S


def _rows(starts: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Rows that give a stretch its times: its first, and its middle if it has more than one row."""
    return np.sort(np.concatenate([starts, (starts + widths // 2)[widths > 1]]))


def _lowest_and_highest(values: np.ndarray, starts: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """A value for each of _rows(): the lower one first where the curve rises."""
    if not len(starts):
        return np.empty(0)
    low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
    rises = ~(values[starts + widths - 1] < values[starts])
    more = widths > 1
    place = np.arange(len(starts)) + np.cumsum(more) - more
    result = np.empty(len(starts) + int(more.sum()))
    result[place] = np.where(rises, low, high)
    result[place[more] + 1] = np.where(rises, high, low)[more]
    return result


def _counts(values: np.ndarray) -> tuple[np.ndarray, float, float]:
    """The values in 65535 steps of their range: counts from -32767 on, the lowest value, a step."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(values), MISSING, dtype=np.int16), 0.0, 0.0
    low = float(values[known].min())
    step = (float(values[known].max()) - low) / 65534.0
    counts = np.full(len(values), MISSING, dtype=np.int16)
    counts[known] = np.round((values[known] - low) / step).astype(np.int32) - 32767 if step > 0.0 else -32767
    return counts, low, step


def _differences(counts: np.ndarray) -> bytes:
    """Compresses better than the values; wraps."""
    little = counts.astype(counts.dtype.newbyteorder("<"))
    return np.diff(little, prepend=little.dtype.type(0)).tobytes()


def _limits(run: Run, gap: int) -> dict[str, list[list[float]]]:
    """When each reason held the output back: from, to; gaps of so many rows are closed."""
    if "fw.limits" not in run.trace or not len(run.trace):
        return {}
    reasons, times, found = run.trace.column("fw.limits").astype(np.int32), run.trace.time_s, {}
    for row in drive_tables.limits():
        edges = np.flatnonzero(np.diff(np.concatenate(([0], (reasons & row.code) != 0, [0])))).tolist()
        spans: list[list[int]] = []
        for first, end in zip(edges[::2], edges[1::2]):
            if spans and first - spans[-1][1] <= gap:
                spans[-1][1] = end
            else:
                spans.append([first, end])
        found[row.name] = [[float(times[first]), float(times[min(end, len(times) - 1)])] for first, end in spans]
    return found


def _panels(run: Run, trace: Trace) -> Iterator[tuple[str, str, list[Curve]]]:
    """What is drawn of a part of the run's trace: title, unit, and those curves that it has the signals of."""

    def column(name: str) -> np.ndarray | None:
        return trace.column(name).astype(np.float64) if name in trace else None

    def known(*curves: Curve) -> list[Curve]:
        return [curve for curve in curves if curve.values is not None]

    state = column("fw.state")
    closed = None if state is None else (state == run.state_number("CLOSED")) | (state == run.state_number("STOPPING"))
    on = None if "pwm.outputs_seen" not in trace else trace.column("pwm.outputs_seen") != 0

    def where(values: np.ndarray | None, rows: np.ndarray | None) -> np.ndarray | None:
        return None if values is None or rows is None else np.where(rows, values, np.nan)

    v_d, v_q = column("fw.v_d_v"), column("fw.v_q_v")
    estimated, true = column("fw.theta_est_deg"), column("plant.theta_e_deg")
    error = None if estimated is None or true is None else wrapped_deg(estimated - true)
    yield "speed", "rpm", known(Curve("true", "#1f77b4", column("plant.speed_rpm")),
                                Curve("estimated", "#ff7f0e", where(column("fw.speed_est_rpm"), on), "thin"),
                                Curve("reference", "#000000", where(column("fw.speed_ref_rpm"), closed), "dashed"))
    yield "current", "A", known(Curve("Id", "#6baed6", where(column("fw.i_d_a"), on), "thin"),
                                Curve("Iq", "#fb6a4a", where(column("fw.i_q_a"), on), "thin"),
                                Curve("Id reference", "#08306b", where(column("fw.id_ref_a"), on)),
                                Curve("Iq reference", "#7f0000", where(column("fw.iq_ref_a"), on)),
                                Curve("Iq limit", "#888888", where(column("fw.iq_limit_a"), closed), "dashed"))
    yield "voltage", "V", known(Curve("Vd", "#6baed6", where(v_d, on), "thin"), Curve("Vq", "#fb6a4a", where(v_q, on), "thin"),
                                Curve("length", "#2ca02c", None if v_d is None or v_q is None else where(np.hypot(v_d, v_q), on)),
                                Curve("limit", "#888888", where(column("fw.v_limit_v"), on), "dashed"))
    yield "bus", "V", known(Curve("bus", "#1f77b4", column("bus.voltage_v")))
    yield "torque", "N·m", known(Curve("motor's torque", "#1f77b4", column("plant.torque_nm")))
    yield "angle error", "°", known(Curve("estimated less true, closed loop", "#1f77b4", where(error, closed)),
                                    Curve("before", "#bbbbbb", where(error, None if on is None or closed is None else on & ~closed), "thin"))
    yield "1/Kphi in use", "rpm/V", known(Curve("1/Kphi", "#1f77b4", where(column("fw.inv_kphi_rpm_per_v"), on)))
