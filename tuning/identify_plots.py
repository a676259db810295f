"""The plots of an identification: two levels of current, the square voltage and its current, the back-EMF while turning."""

from pathlib import Path

import numpy as np

from tools.bench import plots # chooses the backend and the style
from tools.common.trace import Trace

import matplotlib.pyplot as plt # noqa: E402, I001  after the backend

from .identify_result import Identified

BLOCK = 32
"""Periods of one stretch of back-EMF in the firmware."""
SHOWN_S = 0.003


def write_all(item: Identified, names: list[str], folder: Path) -> list[str]:
    """Every plot for which the procedure got far enough; returns the file names. `names`: of the steps, by number."""
    spans = _spans(item, names)
    files = []
    for name, draw, need in (("resistance", _resistance, "CONNECT"), ("inductance", _inductance, "INDUCTANCE_D"), ("back_emf", _back_emf, "SPIN_HALF")):
        if need in spans:
            figure, axes = plt.subplots(2, 1, figsize=(10, 8), layout="constrained")
            draw(item, spans, axes)
            files.append(plots.saved(figure, folder, name))
    return files


def _spans(item: Identified, names: list[str]) -> dict[str, tuple[float, float]]:
    """From when to when each step lasted."""
    changes = item.measured.steps + [(item.measured.trace.time_s[-1], 0)]
    return {names[number]: (at_s, until_s) for (at_s, number), (until_s, _) in zip(changes, changes[1:]) if number != 0}


def _label_steps(axes: plt.Axes, spans: dict[str, tuple[float, float]], wanted: tuple[str, ...]) -> None:
    for n, name in enumerate(wanted):
        if name in spans:
            axes.axvspan(*spans[name], color="tab:grey", alpha=0.06 + 0.1 * (n % 2))
            axes.text(sum(spans[name]) / 2.0, 0.02, name, transform=axes.get_xaxis_transform(), ha="center", fontsize=8)


def _resistance(item: Identified, spans: dict[str, tuple[float, float]], axes: np.ndarray) -> None:
    steps = ("RISE", "CONNECT", "ALIGN", "RESISTANCE", "BIAS")
    until_s = max(spans[name][1] for name in steps if name in spans)
    part = item.measured.trace.part(spans["RISE"][0], until_s).thinned(10)
    for ax, signal, label in ((axes[0], "fw.i_d_a", "measured current [A]"), (axes[1], "fw.v_d_v", "commanded voltage [V]")):
        ax.plot(part.time_s, part.column(signal), color="tab:blue")
        ax.set(ylabel=label, xlabel="time [s]")
        _label_steps(ax, spans, steps)
    axes[0].set_title(f"{item.motor.name}: two levels of current along phase A; R loop = {1e-3 * item.measured.watch['Rs_uohm']:.5g} mohm")


def _inductance(item: Identified, spans: dict[str, tuple[float, float]], axes: np.ndarray) -> None:
    for ax, step, on_q, value in ((axes[0], "INDUCTANCE_D", False, "Ld_nH"), (axes[1], "INDUCTANCE_Q", True, "Lq_nH")):
        if step not in spans:
            ax.set_axis_off()
            continue
        middle_s = sum(spans[step]) / 2.0
        part = item.measured.trace.part(middle_s, middle_s + SHOWN_S)
        time_ms = 1e3 * (part.time_s - middle_s)
        i_a, i_b = part.column("plant.i_a"), part.column("plant.i_b")
        current = (i_a + 2.0 * i_b) / 3.0 ** 0.5 if on_q else i_a
        axis = "q" if on_q else "d"
        ax.plot(time_ms, current, ".-", color="tab:blue", label=f"{axis} current at the samples")
        ax.plot(time_ms, part.column("fw.i_q_a" if on_q else "fw.i_d_a"), ".", markersize=3, color="tab:orange", label="as the converter sees it")
        ax.set(ylabel="current [A]", xlabel="time [ms]")
        ax.set_title(f"{item.motor.name}, {axis} axis: L{axis} = {1e-3 * item.measured.watch[value]:.5g} uH", loc="left")
        other = ax.twinx()
        other.step(time_ms, part.column("fw.v_q_v" if on_q else "fw.v_d_v"), where="post", color="tab:grey", linewidth=0.8)
        other.set_ylabel("commanded voltage [V]")
        other.grid(False)
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)


def _blocks(part: Trace, name: str) -> np.ndarray:
    column = part.column(name).astype(np.float64)
    count = len(column) // BLOCK
    return column[:count * BLOCK].reshape(count, BLOCK).mean(axis=1)


def _back_emf(item: Identified, spans: dict[str, tuple[float, float]], axes: np.ndarray) -> None:
    steps = [name for name in ("SPIN_HALF", "SPIN_FULL") if name in spans]
    part = item.measured.trace.part(spans[steps[0]][0], spans[steps[-1]][1])
    time_s = part.time_s[:len(part) // BLOCK * BLOCK:BLOCK]
    pairs, watch = item.known.pole_pairs, item.measured.watch
    speed = _blocks(part, "plant.speed_rpm")
    omega = pairs * speed * np.pi / 30.0
    i = _blocks(part, "fw.i_d_a") + 1j * _blocks(part, "fw.i_q_a")
    v = _blocks(part, "fw.v_d_v") + 1j * _blocks(part, "fw.v_q_v")
    emf = v - 1e-6 * watch["Rs_uohm"] * i - 1j * omega * 1e-9 * watch["Ld_nH"] * i
    axes[0].plot(time_s, speed, color="tab:blue", label="true speed")
    axes[0].axhline(item.known.speed_rpm, color="black", linewidth=0.7, label="END_SPEED_RPM")
    axes[0].axhline(0.5 * item.known.speed_rpm, color="black", linewidth=0.7, linestyle="--", label="half of it")
    axes[0].set(ylabel="speed [rpm]", xlabel="time [s]", title=f"{item.motor.name}: turning in open loop")
    axes[1].plot(time_s, np.abs(emf), color="tab:blue", label="length of v - R i - jwL i")
    axes[1].plot(time_s, emf.real, color="tab:orange", linewidth=0.7, label="along the current")
    axes[1].plot(time_s, omega * item.values["motor.psi_vs"], color="black", linewidth=0.7, label="true")
    axes[1].set(ylabel="back-EMF [V, phase]", xlabel="time [s]", title=f"Kphi = {1e-3 * watch['Kphi_uV_per_krpm']:.5g} mV peak line to line per 1000 rpm")
    for ax in axes:
        _label_steps(ax, spans, tuple(steps))
        ax.legend(loc="center right")
