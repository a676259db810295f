"""What the page shows of a board: which signals it draws, and how a frame is made of a trace."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from tools.common import drive_tables
from tools.common.trace import Trace, wrapped_deg
from tools.common.x_macro import rows

STRIP_ROW_S = 0.01
"""Time between two points of the rolling curves."""
STRIP_S = 20.0
"""What a new tab finds drawn."""
ORBIT_POINTS = 120
ESTIMATES = ("RAMP", "CLOSED", "STOPPING")
"""States in which the estimated angle means something."""
CLOSED = ("CLOSED", "STOPPING")
ON = ("BOOTSTRAP", "ALIGN", *ESTIMATES)
"""In which the bridge switches."""


ALWAYS, SWITCHING, ESTIMATING, CONTROLLED = "always", "switching", "estimating", "controlled"
"""When a signal means something; outside of it a curve has a gap."""


@dataclass(frozen=True)
class Line:
    """A curve: the virtual board's signal, and what a real board is asked for (tools/live/watch.py), "" where it cannot tell."""

    name: str
    signal: str
    watched: str
    color: str
    when: str = ALWAYS
    dashed: bool = False
    sampled: bool = False
    """a real board has only what it samples, at one edge of the ripple"""


@dataclass(frozen=True)
class Panel:
    """Curves with one axis."""

    title: str
    unit: str
    lines: tuple[Line, ...]


MEAN_D, MEAN_Q = "mean.i_d_a", "mean.i_q_a"
"""Not of the board: see currents()."""
TRUE, ESTIMATE, REFERENCE, D, Q = "true", "estimate", "reference", "d", "q"
"""Colours of the page's style, which has them for light and dark."""
PANELS = (
    Panel("speed", "rpm", (Line("reference", "fw.speed_ref_rpm", "reference_rpm", REFERENCE, CONTROLLED, True),
                           Line("estimate", "fw.speed_est_rpm", "estimate_rpm", ESTIMATE, ESTIMATING), Line("true", "plant.speed_rpm", "", TRUE))),
    Panel("current", "A", (Line("d", MEAN_D, "i_d_a", D, SWITCHING, sampled=True), Line("q", MEAN_Q, "i_q_a", Q, SWITCHING, sampled=True),
                           Line("q asked for", "fw.iq_ref_a", "iq_ref_a", REFERENCE, SWITCHING, True),
                           Line("learned", "fw.profile_a", "", ESTIMATE, CONTROLLED))),
    Panel("torque", "mN·m", (Line("motor", "plant.torque_mean_nm", "", TRUE),)),
    Panel("bus", "V", (Line("bus", "bus.voltage_v", "bus_v", D),)))
SCALES = {"mN·m": 1000.0}
NOW = {"speed_rpm": "plant.speed_rpm", "estimate_rpm": "fw.speed_est_rpm", "reference_rpm": "fw.speed_ref_rpm", "target_rpm": "fw.speed_target_rpm",
       "theta_deg": "plant.theta_e_deg", "theta_est_deg": "fw.theta_est_deg", "i_d_a": MEAN_D, "i_q_a": MEAN_Q, "iq_limit_a": "fw.iq_limit_a",
       "v_d_v": "fw.v_d_v", "v_q_v": "fw.v_q_v", "v_limit_v": "fw.v_limit_v", "torque_nm": "plant.torque_mean_nm", "bus_v": "bus.voltage_v"}
"""The numbers of the moment, by the page's name."""
MEANS = ("speed_rpm", "estimate_rpm", "i_d_a", "i_q_a", "v_d_v", "v_q_v", "torque_nm", "bus_v")
"""Of these the mean over a frame's time: a sample stands at one edge of the PWM's ripple. Torque and currents are means within each period, too."""


def currents(trace: Trace) -> dict[str, np.ndarray]:
    """Mean current of each period in the firmware's frame: the plant's in that of the rotor, turned by what the control angle is wrong. What the firmware samples
    stands at one edge of the ripple."""
    d, q = (trace.column(name).astype(float) for name in ("plant.i_d_mean", "plant.i_q_mean"))
    ahead = np.radians(trace.column("plant.theta_e_deg").astype(float) - trace.column("fw.theta_ctrl_deg"))
    cosine, sine = np.cos(ahead), np.sin(ahead)
    return {MEAN_D: d * cosine - q * sine, MEAN_Q: d * sine + q * cosine}


def strip(trace: Trace, every: int, states: dict[int, str]) -> list[list[float | None]]:
    """Rows of the rolling curves, one for each `every` rows of the trace: their last time, then the mean of each curve of the panels in their order, over
    the rows in which it means something."""
    ends = np.arange(every - 1, len(trace), every)
    if not len(ends):
        return []
    starts = ends - every + 1
    state = trace.column("fw.state")
    means = {ALWAYS: np.ones(len(state), bool), SWITCHING: trace.column("pwm.outputs_seen") > 0,
             ESTIMATING: np.isin(state, [number for number, name in states.items() if name in ESTIMATES]),
             CONTROLLED: np.isin(state, [number for number, name in states.items() if name in CLOSED])}
    columns, means_of = [], currents(trace)
    for panel in PANELS:
        for line in panel.lines:
            good, upto = means[line.when], ends[-1] + 1
            counts = np.add.reduceat(good[:upto].astype(int), starts)
            sums = np.add.reduceat(np.where(good, means_of[line.signal] if line.signal in means_of else trace.column(line.signal).astype(float), 0.0)[:upto], starts) * SCALES.get(panel.unit, 1.0)
            columns.append([round(total / count, 4) if count and last else None for total, count, last in zip(sums.tolist(), counts.tolist(), good[ends].tolist())])
    return [list(row) for row in zip(trace.time_s[ends].round(4).tolist(), *columns)]


def now(trace: Trace, rows: int) -> dict[str, float]:
    """The last row, under the page's names; of MEANS the mean of the last `rows`."""
    found = currents(trace)
    columns = {name: found[signal] if signal in found else trace.column(signal) for name, signal in NOW.items()}
    return {name: round(float(column[-rows:].mean(dtype=float) if name in MEANS else column[-1]), 4) for name, column in columns.items()}


def orbit(trace: Trace) -> dict[str, list[list[float]]]:
    """The last turn of voltage and current in the alpha-beta plane; a part of it where the frame is shorter."""
    turn = np.abs(np.cumsum(wrapped_deg(np.diff(trace.column("fw.theta_ctrl_deg")))[::-1]))
    count = min(int(np.searchsorted(turn, 360.0)) + 2, len(trace))
    pick = np.unique(np.linspace(len(trace) - count, len(trace) - 1, min(count, ORBIT_POINTS)).astype(int))
    angle = np.radians(trace.column("fw.theta_ctrl_deg")[pick].astype(float))
    v_d, v_q = (trace.column(name)[pick].astype(float) for name in ("fw.v_d_v", "fw.v_q_v"))
    i_d, i_q = (column[pick] for column in currents(trace).values())
    switching = trace.column("pwm.outputs_seen")[pick] > 0
    v_d, v_q = np.where(switching, v_d, 0.0), np.where(switching, v_q, 0.0)
    return {name: _points(d * np.cos(angle) - q * np.sin(angle), d * np.sin(angle) + q * np.cos(angle)) for name, d, q in (("v", v_d, v_q), ("i", i_d, i_q))}


def _points(x: np.ndarray, y: np.ndarray) -> list[list[float]]:
    return np.column_stack((x, y)).round(3).tolist()


def lines(virtual: bool) -> list[Line]:
    """The curves that such a board has, in the panels' order."""
    return [line for panel in PANELS for line in panel.lines if virtual or line.watched]


def panels(virtual: bool) -> list[dict[str, Any]]:
    """What the page draws; a panel without curves is left out."""
    known = lines(virtual)
    found = [{"title": panel.title, "unit": panel.unit,
              "lines": [{"name": f"{line.name}, sampled" if line.sampled and not virtual else line.name, "color": line.color, "dashed": line.dashed} for line in panel.lines if line in known]} for panel in PANELS]
    return [panel for panel in found if panel["lines"]]


def told_panels() -> list[dict[str, Any]]:
    """Of a board that only tells its speed."""
    speed = next(panel for panel in panels(False) if panel["title"] == "speed")
    return [speed | {"lines": [line for line in speed["lines"] if line["name"] == "estimate"]}]


@cache
def states() -> dict[str, str]:
    """Name and meaning, in the order of their numbers."""
    return dict(rows("include", "drive/states.h", "DRIVE_STATE_TABLE", "#name meaning"))


def faults() -> dict[str, dict[str, str]]:
    """Cause and remedy by name."""
    return _told(drive_tables.faults())


def limits() -> dict[str, dict[str, str]]:
    """The same of the reasons for a limit."""
    return _told(drive_tables.limits())


def _told(table: tuple[drive_tables.Row, ...]) -> dict[str, dict[str, str]]:
    return {row.name: {"cause": row.cause, "remedy": row.remedy} for row in table}
