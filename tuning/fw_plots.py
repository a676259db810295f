"""The plots of a field-weakening search: the tables as AN1292's Figure 8, and current, angle error and torque over speed."""

from pathlib import Path
from typing import Any

import numpy as np

from tools.bench import plots # chooses the backend and the style

import matplotlib.pyplot as plt # noqa: E402, I001  after the backend

from .fw_tables import Tables


def write_all(tables: Tables, motor: Any, folder: Path) -> list[str]:
    """Both pictures; returns the file names."""
    return [_write(folder, "figure8", (10, 5.5), _figure8, tables, motor), _write(folder, "over_speed", (10, 11), _over_speed, tables, motor)]


def _write(folder: Path, name: str, size: tuple[float, float], draw: Any, tables: Tables, motor: Any) -> str:
    figure = plt.figure(figsize=size, layout="constrained")
    draw(figure, tables, motor)
    return plots.saved(figure, folder, name)


def _marks(axes: plt.Axes, tables: Tables, motor: Any) -> None:
    for rpm, text in ((motor.maximum_speed_rpm, "asked for"), (tables.maximum_speed_rpm, "highest without load")):
        axes.axvline(rpm, color="grey", linewidth=0.8, linestyle=":")
        axes.annotate(f"{text}: {rpm:.0f}", (rpm, 0.02), xycoords=("data", "axes fraction"), rotation=90, fontsize=8, color="grey",
                      ha="right", va="bottom")


def _figure8(figure: plt.Figure, tables: Tables, motor: Any) -> None:
    axes = figure.subplots()
    other = axes.twinx()
    speed = np.array([tables.speed_rpm(i) for i in range(len(tables.entries))])
    reached = tables.last_index + 1
    series = ((axes, "Id", "tab:blue", 4, [entry.idref_a for entry in tables.entries]),
              (other, "1/Kphi, of its value at base speed", "tab:red", 8, [entry.inv_kfi / tables.inv_kfi_base for entry in tables.entries]),
              (other, "Ls, of its value at base speed", "tab:green", 4, [2.0 * entry.ls_ratio for entry in tables.entries]))
    for place, label, color, size, values in series:
        place.plot(speed[:reached], values[:reached], "o-", color=color, label=label, markersize=size)
        if reached < len(speed):
            place.plot(speed[reached - 1:], values[reached - 1:], "--", color=color, linewidth=0.8)
            place.plot(speed[reached:], values[reached:], "o", color=color, markersize=size, markerfacecolor="white")
    axes.axhline(-motor.rated_current_a, color="tab:blue", linewidth=0.8, linestyle="--", label="rated current")
    axes.axhline(-tables.goal.get("current_limit_a", np.nan), color="tab:blue", linewidth=0.8, linestyle="-.", label="limit of the search")
    axes.set(xlabel="speed reference [rpm]", ylabel="Id [A peak]",
             title=f"{motor.title}: d current, 1/Kphi and Ls over speed (Figure 8); hollow: not reached")
    axes.set_ylim(top=0.1)
    other.set_ylabel("1/Kphi and Ls, of their values at base speed")
    other.set_ylim(0.0, max(1.1, 1.1 * max(max(values) for place, _, _, _, values in series if place is other)))
    other.grid(False)
    _marks(axes, tables, motor)
    handles = [line for side in (axes, other) for line in side.get_lines() if not line.get_label().startswith("_")]
    axes.legend(handles, [line.get_label() for line in handles], loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=3)
    far = max(speed[tables.last_index], tables.maximum_speed_rpm, motor.maximum_speed_rpm)
    axes.set_xlim(speed[0] - 0.3 * (speed[1] - speed[0]), far + 0.7 * (speed[1] - speed[0]))


def _over_speed(figure: plt.Figure, tables: Tables, motor: Any) -> None:
    current, angle, torque = figure.subplots(3, 1, sharex=True)
    speed = [row["speed_rpm"] for row in tables.rows]

    def line(axes: plt.Axes, key: str, label: str, **style: Any) -> None:
        axes.plot(speed, [row[key] for row in tables.rows], label=label, markersize=4, **style)

    line(current, "current_a_rms", "with the entry's load", marker="o", color="tab:red")
    line(current, "current_free_a_rms", "without load", marker="o", color="tab:blue")
    current.axhline(motor.rated_current_a / np.sqrt(2.0), color="black", linewidth=0.8, linestyle="--", label="rated")
    current.set(ylabel="phase current [A rms]", title=f"{motor.title}: at each entry of the tables")
    current.set_ylim(bottom=0.0)

    line(angle, "angle_deg", "with the entry's load", marker="o", color="tab:red")
    line(angle, "angle_free_deg", "without load", marker="o", color="tab:blue")
    limit = tables.goal.get("angle_error_deg", np.nan)
    for sign in (-1.0, 1.0):
        angle.axhline(sign * limit, color="black", linewidth=0.8, linestyle="--", label="limit" if sign > 0.0 else "_limit")
    angle.set(ylabel="mean angle error [deg]")

    line(torque, "torque_nm", "largest that holds the speed, trim on", marker="o", color="tab:green")
    line(torque, "load_nm", "carried by the tables alone", marker="o", color="tab:orange")
    torque.set(ylabel="load torque [N m]", xlabel="speed [rpm]")
    torque.set_ylim(bottom=0.0)
    for axes in (current, angle, torque):
        _marks(axes, tables, motor)
        axes.legend(loc="best")
