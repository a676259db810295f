"""`lowspeed`: is a low speed held under load, and how low does it go? What is asked and what must hold is in
tools/bench/scenarios/tables/lowspeed.toml."""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import motor_file
from . import case, reach, search, simulate, sweep
from .expect import Outcome
from .run import Run
from .scenario import param
from .sweep import within


@dataclass(kw_only=True)
class Table(sweep.Loaded, sweep.Table):
    """tables/lowspeed.toml."""

    speeds_rpm: list[float] = within(1.0)
    torques_nm: list[float] = within(0.0)
    current_percent: float = within(1.0, 100.0)
    error_percent: float = within(0.0, 100.0)
    angle_error_deg: float = within(0.0, 180.0)
    lowest_rpm: float = within(50.0)
    ratio: float = within(1.01, 10.0)
    resolution_percent: float = within(0.1, 20.0)

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own: the same shares of its rating, but no speed below the one from which its header holds it."""
        speeds, torques = case.shares(self.motor, motor, self.speeds_rpm, self.torques_nm)
        possible = dict.fromkeys(max(rpm, param(params, "MINIMUM_SPEED_RPM")) for rpm in speeds)
        return replace(self, motor=motor.name, speeds_rpm=list(possible), torques_nm=torques)

    def below(self) -> list[float]:
        """The speeds that are tried below the table's own, downwards."""
        result = [min(self.speeds_rpm) / self.ratio]
        while result[-1] > self.lowest_rpm:
            result.append(result[-1] / self.ratio)
        return [rpm for rpm in result[:-1] if rpm > self.lowest_rpm] + [self.lowest_rpm] * (min(self.speeds_rpm) > self.lowest_rpm)


class LowSpeed(sweep.Sweep):
    """The sweep. A case is a speed and the torque that is asked for."""

    name, about, kind_of_table, defines = "lowspeed", "low speeds held under load, and how low it goes", Table, ("PARAMS_IN_RAM",)
    columns = (
        ("asked_rpm", "reference\nrpm", "{:.1f}"), ("speed_rpm", "true\nrpm", "{:.1f}"), ("speed_error_percent", "error\n%", "{:+.2f}"),
        ("speed_min_rpm", "lowest\nrpm", "{:.0f}"), ("speed_max_rpm", "highest\nrpm", "{:.0f}"),
        ("angle_error_mean_deg", "angle err\nmean deg", "{:+.1f}"), ("angle_error_rms_deg", "angle err\nrms deg", "{:.1f}"),
        ("current_rms_a", "phase I\nA rms", "{:.3f}"), ("verdict", "\nverdict", "{}"))
    keys = ("reference_rpm", "torque_nm_set", *(key for key, _, _ in columns[:-1]), "fault", "verdict")

    def cases(self) -> list[tuple[float, float]]:
        return list(itertools.product(self.table.speeds_rpm, self.table.torques_nm))

    def torque_nm(self, asked: float) -> float:
        """The torque of a row: what is asked for, as far as the current allows."""
        most_a = self.table.current_percent / 100.0 * param(self.params, "MAXIMUM_CURRENT_A")
        return min(asked, case.three_digits(most_a * reach.torque_per_amp(self.motor.values.values)))

    def job(self, item: tuple[float, float]) -> simulate.Job:
        """A start, the speed, the brake, and the hold."""
        table, rpm, torque_nm = self.table, item[0], self.torque_nm(item[1])
        lowered = {"MINIMUM_SPEED_RPM": rpm} if rpm < param(self.params, "MINIMUM_SPEED_RPM") else {}
        name = f"{rpm:.4g} rpm, {torque_nm:.3g} N m"
        events, settled_s = case.loaded_run(self.params | lowered, rpm, table, name, torque_nm)
        scenario = case.scenario(name, table.title, events, rpm, settled_s, settled_s + table.measure_s)
        return simulate.prepare(scenario, self.library, self.motor, self.board, parameters=lowered)

    def measured(self, run: Run, item: tuple[float, float]) -> dict[str, Any]:
        """The reference is the one that the firmware had: the potentiometer's steps do not count."""
        measure, result = run.scenario.measures[0], case.reduced(run)
        asked = float(run.trace.part(measure.from_s, measure.to_s).column("fw.speed_ref_rpm").astype(np.float64).mean())
        return result | {"asked_rpm": asked, "speed_error_percent": 100.0 * (result["speed_rpm"] / asked - 1.0) if asked > 0.0 else None}

    def row(self, item: tuple[float, float], job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        return {"name": job.scenario.name, "reference_rpm": item[0], "torque_nm_set": self.torque_nm(item[1]), **result}

    def verdict(self, item: tuple[float, float], row: dict[str, Any]) -> str:
        if row["closed_after_s"] is None:
            return f"no start: {row['fault'] or 'never in closed loop'}"
        if row["fault"]:
            return f"fault {row['fault']}"
        error = row["speed_error_percent"]
        if error is None or abs(error) > self.table.error_percent:
            return "no speed" if error is None else f"speed {error:+.1f} %"
        return "angle" if row["angle_error_rms_deg"] > self.table.angle_error_deg else "ok"

    def check(self, item: tuple[float, float], row: dict[str, Any]) -> list[Outcome]:
        error, angle = row["speed_error_percent"], row["angle_error_rms_deg"]
        got = row["verdict"] + ("" if error is None else f", error {error:+.2f} %")
        return [Outcome(row["name"], row["verdict"] == "ok", got + ("" if angle is None else f", angle error {angle:.1f} deg"),
                        f"no fault, error {self.table.error_percent:g} %, angle error {self.table.angle_error_deg:g} deg")]

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        self.lowest = self.find_lowest(rows)
        return {"lowest": [{"torque_nm": torque, "lowest_rpm": None if found.fails_at_once else found.good, "fails_at_rpm": found.bad,
                            "why": found.why} for torque, found in self.lowest.items()]}

    def find_lowest(self, known: list[dict[str, Any]]) -> dict[float, search.Search]:
        """By torque, downwards from the table's highest speed. `known`: the table's own rows."""
        table = self.table
        searches = {self.torque_nm(torque): search.Search(False, lambda row: row["verdict"] == "ok", max(table.speeds_rpm))
                    for torque in table.torques_nm}
        for row in known:
            searches[row["torque_nm_set"]].narrow(row["reference_rpm"], row)
        first = [(torque, rpm) for rpm, torque in itertools.product(table.below(), searches)]
        search.in_rounds(first, searches, lambda torque: torque, table.resolution_percent,
                         lambda number, wanted: self.run([(rpm, torque) for torque, rpm in wanted], f"lowest {number}"))
        return searches

    def text(self, rows: list[dict[str, Any]]) -> str:
        """And for each torque how low it goes, and what happens below."""
        lines = []
        for torque, found in self.lowest.items():
            held = "not at all" if found.fails_at_once else f"down to {found.good:.0f} rpm"
            below = "the search ended there" if found.bad is None else f"at {found.bad:.0f} rpm: {found.why}"
            lines.append(f"{torque:.3g} N m is held {held} ({below})")
        return "\n".join([super().text(rows), "", *lines])
