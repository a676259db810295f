"""The plots of a tuning report, as SVG text."""

import io
import os

os.environ.pop("MPLBACKEND", None) # a wrong one ends the import

import matplotlib # noqa: E402

matplotlib.use("Agg")

import matplotlib.pyplot as plt # noqa: E402  the backend must be chosen first
import numpy as np # noqa: E402

from tools.common.param_rows import ENTRIES # noqa: E402

from . import limits # noqa: E402
from .design import Design # noqa: E402
from .fw_tables import STEP_ERPM # noqa: E402
from .loops import Curve, LoopDesign # noqa: E402

STYLE = {"axes.grid": True, "grid.alpha": 0.3, "lines.linewidth": 1.2, "legend.fontsize": 8, "axes.titlesize": 10, "font.size": 9,
         "svg.fonttype": "path", "svg.hashsalt": "foc33", "path.simplify_threshold": 0.5}
COLOURS = ("tab:blue", "tab:green", "tab:red", "tab:purple", "tab:orange")


def draw(design: Design) -> dict[str, str]:
    """Every plot by name."""
    with plt.rc_context(STYLE):
        return {"current_loop": _bode(design.current_loop, "current loop"), "speed_loop": _bode(design.speed_loop, "speed loop"),
                "start": _start(design), "torque": _torque(design), "current": _current(design)}


def _text(figure: plt.Figure) -> str:
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    text = file.getvalue()
    return text[text.index("<svg"):]


def _bode(loop: LoopDesign | None, title: str) -> str:
    figure, (size, phase) = plt.subplots(2, 1, sharex=True, figsize=(8, 5.4), layout="constrained")
    for curve, colour in zip(loop.curves if loop else (), COLOURS):
        _bode_curve(size, phase, curve, colour)
    size.axhline(0.0, color="black", linewidth=0.8)
    size.set(title=f"{title}, {loop.bandwidth_hz if loop else 0:g} Hz: open loop", ylabel="gain [dB]", ylim=(-50, 50))
    phase.axhline(-180.0, color="black", linewidth=0.8)
    asked = loop.worst.asked_deg if loop else 0.0
    phase.axhline(asked - 180.0, color="black", linewidth=0.8, linestyle=":")
    phase.annotate(f"{asked:.0f}° margin", (0.01, asked - 178.0), xycoords=("axes fraction", "data"), fontsize=8)
    phase.set(xlabel="frequency [Hz]", ylabel="phase [°]", ylim=(-270, 0), yticks=range(-270, 1, 30))
    size.legend()
    return _text(figure)


def _bode_curve(size: plt.Axes, phase: plt.Axes, curve: Curve, colour: str) -> None:
    """Negative frequencies (a rotor that turns makes them differ) are dashed, their phase mirrored."""
    margin = curve.margins
    label = f"{curve.label}: " + (f"{margin.phase_deg:.0f}° at {margin.crossover_hz:.3g} Hz, {margin.gain_db:.0f} dB" if margin.stable else "unstable")
    for sign, dashes in ((1.0, "-"), (-1.0, "--")):
        rows = curve.frequency_hz * sign > 0.0
        if not rows.any():
            continue
        hz, response = np.abs(curve.frequency_hz[rows]), curve.response[rows]
        order = np.argsort(hz)
        hz, response = hz[order], response[order]
        angle = np.degrees(np.unwrap(np.angle(response))) * sign
        angle -= 360.0 * np.round((angle[0] + 90.0) / 360.0)
        size.semilogx(hz, 20.0 * np.log10(np.abs(response)), dashes, color=colour, label=label if sign > 0.0 else None)
        phase.semilogx(hz, angle, dashes, color=colour)
    phase.plot(margin.crossover_hz, margin.phase_deg - 180.0, "o", color=colour, markersize=4)


def _start(design: Design) -> str:
    figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
    trial = design.start_up.trial if design.start_up else None
    if trial is not None:
        half = trial.speed_rpm.shape[1] // 2
        for part, colour, label in ((trial.speed_rpm[:, :half], "tab:blue", "no load"),
                                    (trial.speed_rpm[:, half:], "tab:orange", f"{design.motor.start_torque_nm:.3g} N m")):
            axes.fill_between(trial.time_s, part.min(axis=1), part.max(axis=1), color=colour, alpha=0.25, linewidth=0.0,
                              label=f"rotor, all {half} start angles, {label}")
            axes.plot(trial.time_s, part[:, half // 3], color=colour, linewidth=0.8)
        axes.plot(trial.time_s, trial.forced_rpm, color="black", label="forced angle")
    axes.set(title="lock and ramp on the rotor's equation of motion", xlabel="time after S2's bootstrap [s]", ylabel="speed [rpm]")
    axes.legend(loc="upper left")
    return _text(figure)


def _torque(design: Design) -> str:
    figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
    m, e = design.motor, design.envelope
    top = design.value("MAXIMUM_SPEED_RPM") * 1.08
    speeds = np.linspace(1.0, top, 160)
    with_fw = [e.torque(rpm, limits.FULL_SHARE) for rpm in speeds]
    without = [_torque_without(e, rpm) for rpm in speeds]
    axes.fill_between(speeds, without, with_fw, color="tab:green", alpha=0.2, linewidth=0.0)
    axes.plot(speeds, with_fw, color="tab:green", label="with field weakening")
    axes.plot(speeds, without, color="tab:blue", label="without d current")
    axes.plot([0.0, m.rated_speed_rpm], [m.rated_torque_nm] * 2, color="grey", linestyle=":")
    axes.plot(m.rated_speed_rpm, m.rated_torque_nm, "s", color="black", label="rated point")
    axes.plot([0.2 * m.rated_speed_rpm, 0.5 * m.rated_speed_rpm, m.rated_speed_rpm], [0.5 * m.rated_torque_nm] * 3, "o", color="tab:red",
              markersize=5, label="20, 50, 100 % at half torque")
    axes.set(title=f"torque at {design.board.nominal_bus_v:g} V and {e.maximum_a:g} A peak, friction taken off", xlabel="speed [rpm]", ylabel="torque [N m]",
             xlim=(0, top), ylim=(0, None))
    axes.legend(loc="lower left")
    return _text(figure)


def _torque_without(envelope: limits.Envelope, rpm: float) -> float:
    if envelope.voltage(rpm, 0.0, envelope.iq(rpm, 0.0)) > limits.FULL_SHARE * envelope.circle_v:
        return 0.0

    def fits(load_nm: float) -> bool:
        i_q = envelope.iq(rpm, load_nm)
        return i_q <= envelope.maximum_a and envelope.voltage(rpm, 0.0, i_q) <= limits.FULL_SHARE * envelope.circle_v
    return limits.halved(fits, 0.0, envelope.most_nm, 30)


def _current(design: Design) -> str:
    figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
    e = design.envelope
    top = design.value("MAXIMUM_SPEED_RPM")
    entries = design.value("FW_START_SPEED_RPM") + np.arange(ENTRIES) * STEP_ERPM / design.motor.pole_pairs
    table = np.array([design.value(f"IDREF_SPEED{i}") for i in range(ENTRIES)])
    speeds = np.linspace(0.0, top, 300)
    i_d = np.interp(speeds, entries, table, left=table[0])
    i_q = np.array([e.iq(rpm, 0.0) for rpm in speeds])
    share = np.array([e.voltage(rpm, d, q) for rpm, d, q in zip(speeds, i_d, i_q)]) / e.circle_v * 100.0
    axes.plot(speeds, i_d, color="tab:red", label="d current of the table")
    reached = entries <= top
    axes.plot(entries[reached], table[reached], "o", color="tab:red", markersize=3)
    axes.plot(speeds, i_q, color="tab:blue", label="q current without load")
    axes.plot(speeds, np.sqrt(np.maximum(e.maximum_a ** 2 - i_d ** 2, 0.0)), color="tab:blue", linestyle="--", label="largest q current")
    axes.axhline(-e.maximum_a, color="grey", linestyle=":", linewidth=0.8)
    axes.axvline(design.value("FW_START_SPEED_RPM"), color="grey", linestyle=":", linewidth=0.8)
    axes.set(title="currents and voltage over speed, without load", xlabel="speed [rpm]", ylabel="current [A peak]", xlim=(0, top))
    right = axes.twinx()
    right.plot(speeds, share, color="black", linewidth=0.9)
    right.set(ylabel="voltage [% of its circle] (black)", ylim=(0, 110))
    right.grid(False)
    axes.legend(loc="center left")
    return _text(figure)
