"""The plots of a run, as PNG files."""

import os
from collections.abc import Callable
from pathlib import Path

os.environ.pop("MPLBACKEND", None) # a wrong one ends the import

import matplotlib # noqa: E402

matplotlib.use("Agg")

import matplotlib.pyplot as plt # noqa: E402  the backend must be chosen first
import numpy as np # noqa: E402

from .recorder import Rows # noqa: E402
from .run import HAND_OVER_AFTER_S, HAND_OVER_BEFORE_S, Run # noqa: E402
from tools.common.trace import Trace, wrapped_deg # noqa: E402

STEP = 20
"""Every STEP-th period is drawn in the plots over the whole run."""

plt.rcParams.update({"figure.figsize": (10, 5), "figure.dpi": 100, "axes.grid": True, "grid.alpha": 0.3, "lines.linewidth": 1.0,
                     "legend.loc": "best", "legend.fontsize": 9, "axes.titlesize": 11, "font.size": 10,
                     "path.simplify_threshold": 0.5, "agg.path.chunksize": 10000})


def write_all(run: Run, folder: Path) -> list[str]:
    """Every plot that the run has data for; returns the file names."""
    thin = run.trace.thinned(STEP)
    if "fw.state" not in thin: # a target image without names
        return [_write(folder, "speed", run, thin, _true_speed)]
    files = []
    for name, draw in (("speed", _speed), ("currents", _currents), ("voltages", _voltages), ("angle_error", _angle_error)):
        files.append(_write(folder, name, run, thin, draw))
    for name, draw, wanted in (("hand_over", _hand_over, bool(run.hand_overs())),
                               ("field_weakening", _field_weakening, _weakens(run)),
                               ("variables", _variables, any(len(values) > 1 for values in run.variables.values()))):
        if wanted:
            files.append(_write(folder, name, run, thin, draw))
    return files


def _write(folder: Path, name: str, run: Run, thin: Trace, draw: Callable) -> str:
    figure, axes = plt.subplots(layout="constrained")
    draw(run, thin, axes)
    return saved(figure, folder, name)


def saved(figure: plt.Figure, folder: Path, name: str) -> str:
    """Writes NAME.png and returns that name."""
    figure.savefig(folder / f"{name}.png")
    plt.close(figure)
    return f"{name}.png"


def _lines(axes: plt.Axes, thin: Trace, signals: dict[str, tuple[str, dict]]) -> None:
    for signal, (label, style) in signals.items():
        axes.plot(thin.time_s, thin.column(signal), label=label, **style)


def _finish(axes: plt.Axes, title: str, y_label: str, x_label: str = "time [s]") -> None:
    axes.set(title=title, xlabel=x_label, ylabel=y_label)
    axes.legend()


def _closed(run: Run, trace: Trace) -> np.ndarray:
    """Rows in closed loop, stopping included."""
    state = trace.column("fw.state")
    return (state == run.state_number("CLOSED")) | (state == run.state_number("STOPPING"))


def _speed(run: Run, thin: Trace, axes: plt.Axes) -> None:
    _lines(axes, thin, {"plant.speed_rpm": ("true", {"color": "tab:blue"})})
    running = thin.column("pwm.outputs_seen") != 0
    estimated = np.where(running, thin.column("fw.speed_est_rpm"), np.nan)
    reference = np.where(_closed(run, thin), thin.column("fw.speed_ref_rpm"), np.nan)
    axes.plot(thin.time_s, estimated, label="estimated", color="tab:orange", linestyle="--")
    axes.plot(thin.time_s, reference, label="reference", color="black", linewidth=0.7)
    for number, item in enumerate(run.hand_overs()):
        axes.axvline(item.at_s, color="tab:green", linewidth=0.8, linestyle=":", label="" if number else item.text)
    _notes(run, axes)
    _finish(axes, f"{run.scenario.name}: speed", "speed [rpm]")


def _notes(run: Run, axes: plt.Axes) -> None:
    """What the scenario says of its events, where they happen: left of a line, and right of it where the left is taken."""
    room_s, last_s = run.scenario.duration_s / 50.0, -1e9
    for event in run.scenario.events:
        if event.note:
            is_left = event.at_s - last_s > room_s
            axes.axvline(event.at_s, color="grey", linewidth=0.5)
            axes.text(event.at_s, 0.01, f" {event.note}", rotation=90, ha="right" if is_left else "left", va="bottom", fontsize=7, color="dimgrey",
                      transform=axes.get_xaxis_transform(), zorder=1.0)
            last_s = event.at_s


def _true_speed(run: Run, thin: Trace, axes: plt.Axes) -> None:
    _lines(axes, thin, {"plant.speed_rpm": ("true", {"color": "tab:blue"})})
    _finish(axes, f"{run.scenario.name}: speed", "speed [rpm]")


def _currents(run: Run, thin: Trace, axes: plt.Axes) -> None:
    _lines(axes, thin, {"fw.i_d_a": ("Id measured", {"color": "tab:blue", "alpha": 0.5}),
                        "fw.i_q_a": ("Iq measured", {"color": "tab:red", "alpha": 0.5}),
                        "fw.id_ref_a": ("Id reference", {"color": "navy"}), "fw.iq_ref_a": ("Iq reference", {"color": "darkred"})})
    _finish(axes, f"{run.scenario.name}: currents in the control frame", "current [A peak]")


def _voltages(run: Run, thin: Trace, axes: plt.Axes) -> None:
    _lines(axes, thin, {"fw.v_d_v": ("Vd", {"color": "tab:blue"}), "fw.v_q_v": ("Vq", {"color": "tab:red"}),
                        "fw.v_limit_v": ("limit", {"color": "black", "linewidth": 0.8})})
    axes.plot(thin.time_s, np.hypot(thin.column("fw.v_d_v"), thin.column("fw.v_q_v")), label="|V|", color="grey", linewidth=0.7)
    axes.plot(thin.time_s, -thin.column("fw.v_limit_v"), color="black", linewidth=0.8)
    _finish(axes, f"{run.scenario.name}: commanded voltage", "voltage [V peak, phase]")


def _angle_error(run: Run, thin: Trace, axes: plt.Axes) -> None:
    error = wrapped_deg(thin.column("fw.theta_est_deg").astype(np.float64) - thin.column("plant.theta_e_deg"))
    closed = _closed(run, thin)
    axes.plot(thin.time_s, np.where(closed, error, np.nan), label="closed loop", color="tab:blue")
    if not np.any(closed):
        running = thin.column("pwm.outputs_seen") != 0
        axes.plot(thin.time_s, np.where(running, error, np.nan), label="open loop", color="tab:orange")
    _finish(axes, f"{run.scenario.name}: estimated less true angle", "electrical angle [deg]")


def _hand_over(run: Run, thin: Trace, axes: plt.Axes) -> None:
    at_s = run.hand_overs()[0].at_s
    part = run.trace.part(at_s - HAND_OVER_BEFORE_S, at_s + HAND_OVER_AFTER_S)
    time_ms = (part.time_s - at_s) * 1e3
    for signal, label, color in (("plant.i_a", "Ia", "tab:blue"), ("plant.i_b", "Ib", "tab:orange"),
                                 ("plant.i_c", "Ic", "tab:green")):
        axes.plot(time_ms, part.column(signal), label=label, color=color)
    axes.axvline(0.0, color="black", linewidth=0.8, linestyle=":", label="hand-over")
    _finish(axes, f"{run.scenario.name}: phase currents around the hand-over", "current [A]", "time after the hand-over [ms]")


def _variables(run: Run, thin: Trace, axes: plt.Axes) -> None:
    """Arrays of the firmware, such as SnapBuf1..4, as a debugger would draw them."""
    for name, values in run.variables.items():
        if len(values) > 1:
            axes.plot(values, ".-", label=name)
    _finish(axes, f"{run.scenario.name}: firmware variables at the end", "counts", "element")


def _weakens(run: Run) -> bool:
    return bool(np.any(run.trace.column("fw.fw_index") > 0))


def _field_weakening(run: Run, thin: Trace, axes: plt.Axes) -> None:
    """As AN1292's Figure 8: d current and 1/Kphi as functions of speed."""
    closed = _closed(run, thin)
    speed = np.abs(thin.column("plant.speed_rpm"))[closed]
    other = axes.twinx()
    axes.plot(speed, thin.column("fw.id_ref_a")[closed], ".", markersize=2, color="tab:blue", label="Id reference")
    other.plot(speed, thin.column("fw.inv_kphi_rpm_per_v")[closed], ".", markersize=2, color="tab:red", label="1/Kphi")
    other.set_ylabel("1/Kphi [rpm/V peak, line to line]")
    other.set_ylim(bottom=0)
    other.grid(False)
    axes.set(title=f"{run.scenario.name}: d current and 1/Kphi over speed (Figure 8)", xlabel="speed [rpm]", ylabel="Id [A peak]")
    handles = [line for side in (axes, other) for line in side.get_lines()]
    axes.legend(handles, [line.get_label() for line in handles], markerscale=4)


def write_record(rows: Rows, title: str, folder: Path, name: str) -> str:
    """The fault recorder's rows, a panel for each kind, from the fault on in red."""
    figure, panels = plt.subplots(4, 1, sharex=True, layout="constrained", figsize=(10, 10))
    currents, voltages, angle, slow = panels
    for values, label in ((rows.i_a, "Ia"), (rows.i_b, "Ib"), (rows.i_c, "Ic = -Ia - Ib")):
        currents.plot(rows.time_ms, values, ".-", markersize=3, label=label)
    for values, label in ((rows.v_d, "Vd"), (rows.v_q, "Vq")):
        voltages.plot(rows.time_ms, values, ".-", markersize=3, label=label)
    angle.plot(rows.time_ms, rows.angle_deg, ".", markersize=3, label="control angle of the next sample")
    has_bus, has_speed, speed = ~np.isnan(rows.bus_v), ~np.isnan(rows.speed_rpm), slow.twinx()
    lines = slow.plot(rows.time_ms[has_bus], rows.bus_v[has_bus], ".-", markersize=3, color="C0", label="bus")
    lines += speed.plot(rows.time_ms[has_speed], rows.speed_rpm[has_speed], ".-", markersize=3, color="C1", label="estimated speed")
    speed.set_ylabel("speed [rpm]")
    speed.grid(False)
    for axes, label in zip(panels, ("current [A]", "voltage [V peak, phase]", "angle [deg]", "bus [V]")):
        axes.set_ylabel(label)
        axes.axvspan(0.0, max(0.0, float(rows.time_ms[-1])), color="tab:red", alpha=0.12)
        axes.axvline(0.0, color="tab:red", linewidth=1.2, label="fault")
        axes.legend(loc="upper left")
    slow.legend(lines, [line.get_label() for line in lines], loc="upper left")
    slow.set_xlabel("time from the fault on [ms]; " + _states_of(rows))
    figure.suptitle(f"fault recorder, {title}")
    return saved(figure, folder, name)


def _states_of(rows: Rows) -> str:
    """The states in their order."""
    changes = [state for before, state in zip(["", *rows.state], rows.state) if state != before]
    return "states: " + ", ".join(changes)


def write_table2(rows: list[dict], folder: Path) -> list[str]:
    """Speed and current of Table 2: AN1292's and ours over the reference speed."""
    figure, (left, right) = plt.subplots(1, 2, layout="constrained")
    reference = [row["reference_rpm"] for row in rows]
    left.plot(reference, reference, color="black", linewidth=0.7, label="reference")
    for axes, note, ours, label, title in ((left, "note_rpm", "speed_rpm", "speed [rpm]", "speed at the row's torque"),
                                           (right, "note_current_a", "current_rms_a", "phase current [A RMS]", "phase current")):
        axes.plot(reference, [row[note] for row in rows], "s--", color="tab:grey", label="note")
        axes.plot(reference, [row[ours] for row in rows], "o-", color="tab:blue", label="foc33")
        _finish(axes, f"Table 2: {title}", label, "reference speed [rpm]")
    return [saved(figure, folder, "table2")]


def write_starts(rows: list[dict], folder: Path) -> list[str]:
    """Time to closed loop, speed then, and the worst speed backwards before, over the rotor's angle: one line a load or inertia."""
    figure, panels = plt.subplots(3, 1, sharex=True, layout="constrained", figsize=(8, 8))
    for axes, (key, label) in zip(panels, (("closed_after_s", "S2 to closed loop [s]"), ("hand_over_rpm", "speed then [rpm]"),
                                           ("back_rpm", "backwards before [rpm]"))):
        for kind in dict.fromkeys(row["kind"] for row in rows):
            points = [(row["rotor_deg"], row[key]) for row in rows if row["kind"] == kind]
            axes.plot([x for x, _ in points], [np.nan if y is None else y for _, y in points], "o-", label=kind)
        axes.set(ylabel=label, ylim=(0, None))
    _finish(panels[-1], "", panels[-1].get_ylabel(), "electrical angle of the rotor at power-up [deg]")
    panels[0].set_title("starts")
    return [saved(figure, folder, "starts")]


def write_rated(rows: list[dict], limits: dict, folder: Path) -> list[str]:
    """Every motor's rows beside what is allowed: a panel for each quantity, a line for each motor, a mark for each row."""
    motors = list(dict.fromkeys(row["motor"] for row in rows))
    marks = {name: f"C{i}" for i, name in enumerate(dict.fromkeys(row["row"] for row in rows))}
    figure, panels = plt.subplots(1, 4, sharey=True, layout="constrained", figsize=(13, 1.8 + 0.5 * len(motors)))
    for axes, (key, label, low, high) in zip(panels, (
            ("speed_error_percent", "speed error [%]", -limits["error_percent"], limits["error_percent"]),
            ("angle_error_rms_deg", "angle error [deg RMS]", None, limits["angle_error_deg"]),
            ("current_of_maximum_percent", "current [% of its maximum]", None, limits["current_percent"]),
            ("voltage_percent", "voltage [% of its limit]", None, None))):
        for name, color in marks.items():
            points = [(row[key], motors.index(row["motor"])) for row in rows if row["row"] == name and row[key] is not None]
            shown = [(x if low is None else min(max(x, 1.5 * low), 1.5 * high), y) for x, y in points]
            axes.scatter([x for x, _ in shown], [y for _, y in shown], color=color, s=40, label=name, zorder=3)
        for limit in (low, high):
            if limit is not None:
                axes.axvline(limit, color="tab:red", linewidth=0.8, linestyle="--")
        axes.set(xlabel=label, xlim=(None, None) if low is not None else (0.0, None))
    panels[0].set(yticks=range(len(motors)), yticklabels=motors, ylim=(len(motors) - 0.5, -0.5))
    figure.suptitle("speeds in per cent of rated, under load; maximum speed without load; dashed: allowed", fontsize=11)
    panels[-1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
    return [saved(figure, folder, "rated")]


def write_loadsteps(rows: list[dict], drawn: list[tuple[np.ndarray, np.ndarray]], hold_s: float, folder: Path) -> list[str]:
    """Speed over time around both edges of every step: a row of panels for each speed, a colour for each torque, a line style for each Kphi.
    `drawn`: time from the step on, speed; the step off comes after `hold_s`."""
    speeds = list(dict.fromkeys(row["reference_rpm"] for row in rows))
    styles = dict(zip(dict.fromkeys(row["kphi"] for row in rows), ("--", "-", ":", "-.")))
    figure, panels = plt.subplots(len(speeds), 2, sharex=True, sharey="row", squeeze=False, layout="constrained",
                                  figsize=(12, 1.0 + 2.6 * len(speeds)))
    for pair, rpm in zip(panels, speeds):
        part = [(row, line) for row, line in zip(rows, drawn) if row["reference_rpm"] == rpm]
        colors = {torque: f"C{i}" for i, torque in enumerate(dict.fromkeys(row["torque_nm"] for row, _ in part))}
        for axes, edge, from_s in ((pair[0], "on", 0.0), (pair[1], "off", hold_s)):
            for row, (time_s, speed_rpm) in part:
                near = (time_s > from_s - 0.03) & (time_s < from_s + 0.25)
                axes.plot(1e3 * (time_s[near] - from_s), speed_rpm[near], color=colors[row["torque_nm"]], linestyle=styles.get(row["kphi"], "-"),
                          label=f"{row['torque_nm']:.3g} N m, Kphi x{row['kphi']:g}")
            axes.set(title=f"{rpm:g} rpm, step {edge}", ylabel="true speed [rpm]" if edge == "on" else "")
        pair[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axes in panels[-1]:
        axes.set_xlabel("time after the step [ms]")
    return [saved(figure, folder, "loadsteps")]


def write_robust(margins: list[dict], runs: list[dict], promised: dict[str, list[float]], folder: Path) -> list[str]:
    """How far each parameter may be off, as bars, and the angle error on the way there."""
    return [_margins(margins, promised, folder), _angle_over_factor(runs, folder)]


def _margins(margins: list[dict], promised: dict[str, list[float]], folder: Path) -> str:
    criteria = list(dict.fromkeys(row["criterion"] for row in margins))
    ends = {(row["parameter"], row["criterion"], row["direction"]): row for row in margins}
    figure, axes = plt.subplots(layout="constrained", figsize=(10, 4.5))
    lowest, highest = min(row["factor"] for row in margins), max(row["factor"] for row in margins)
    for i, name in enumerate(promised):
        for j, criterion in enumerate(criteria):
            low, high = ends[name, criterion, "down"], ends[name, criterion, "up"]
            y = i + 0.2 * (j - (len(criteria) - 1) / 2.0)
            axes.barh(y, high["factor"] - low["factor"], 0.17, left=low["factor"], color=f"C{j}", label=criterion if i == 0 else None)
            for end, sign in ((low, "<"), (high, ">")):
                if end["fails_at"] is None:
                    axes.plot(end["factor"], y, sign, color="black", markersize=5, clip_on=False)
        for edge in promised[name]:
            axes.plot([edge, edge], [i - 0.42, i + 0.42], color="black", linewidth=1.5,
                      label="promised" if i == 0 and edge < 1.0 else None)
    axes.set_xscale("log")
    axes.set_xlim(lowest / 1.05, highest * 1.05)
    ticks = [tick for tick in (0.3, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.5, 2.0, 3.0) if lowest <= tick <= highest]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set(title="how far the motor may be off (arrow: the search ended there)", xlabel="true value / the header's",
             yticks=range(len(promised)), yticklabels=list(promised), ylim=(len(promised) - 0.5, -0.5))
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return saved(figure, folder, "margins")


def _angle_over_factor(runs: list[dict], folder: Path) -> str:
    names = list(dict.fromkeys(row["parameter"] for row in sorted(runs, key=lambda row: ("R", "L", "Kphi").index(row["parameter"]))))
    figure, panels = plt.subplots(1, len(names), sharey=True, layout="constrained", figsize=(12, 4.5))
    for axes, name in zip(panels, names):
        for load, color in (("no load", "C0"), ("loaded", "C1")):
            rows = sorted((row for row in runs if row["parameter"] == name and row["load"] == load), key=lambda row: row["factor"])
            good = [row for row in rows if row["verdict"] == "ok"]
            axes.plot([row["factor"] for row in good], [row["angle_error_mean_deg"] for row in good], ".-", color=color, label=load)
            if name == "L" and load == "loaded":
                axes.plot([row["factor"] for row in good], [row["law_deg"] for row in good], color="black", linewidth=0.8, linestyle="--",
                          label="by L alone")
            bad = [row["factor"] for row in rows if row["verdict"] != "ok"]
            height = 0.03 if load == "no load" else 0.07
            axes.plot(bad, [height] * len(bad), "x", color=color, label=f"{load}: does not run" if bad else None,
                      transform=axes.get_xaxis_transform())
        axes.set_xscale("log")
        axes.set_xticks([0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0], ["0.3", "0.5", "0.7", "1", "1.5", "2", "3"])
        axes.minorticks_off()
        _finish(axes, name, "estimated less true angle [deg]" if name == names[0] else "", "true value / the header's")
    return saved(figure, folder, "angle_error")


def write_sensitivity(rows: list[dict], folder: Path) -> list[str]:
    """How far each number's two changes move the dip, the angle and the lowest speed, as bars: the numbers that move one of them most."""
    before = rows[0]
    figure, panels = plt.subplots(1, 4, layout="constrained", figsize=(19, 7))
    for axes, key, title in zip(panels, ("dip_percent", "angle_deg", "low_angle_deg", "lowest_rpm"),
                               ("dip [%]", "largest angle error [deg]", "angle error at low speed [deg]", "lowest speed [rpm]")):
        moves = [(row[key] - row[f"{key}_before"], row["name"]) for row in rows[1:] if row[key] is not None and row[f"{key}_before"] is not None]
        most = sorted(sorted(moves, key=lambda pair: -abs(pair[0]))[:24], reverse=True)
        axes.barh([name for _, name in most], [move for move, _ in most], color=["C3" if move > 0.0 else "C0" for move, _ in most])
        axes.set(title=f"change of {title}, {before[key]:.3g} as it stands" if before[key] is not None else title)
        axes.tick_params(axis="y", labelsize=7)
    return [saved(figure, folder, "sensitivity")]
