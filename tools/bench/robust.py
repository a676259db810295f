"""`robust`: the motor's true R, L and Kphi differ from the header's. Does it start and run, and how far may each be off?
What is asked is in tools/bench/scenarios/tables/robust.toml."""

import argparse
import functools
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.common import board_keys, motor_file, output
from tools.common.errors import UserError
from . import case, reach, report, search, simulate, sweep
from .expect import Outcome
from .scenario import param
from .sweep import within

PARAMETERS = {"R": ("motor.rs_ohm",), "L": ("motor.ld_h", "motor.lq_h"), "Kphi": ("motor.psi_vs",)}
"""What can be off, and the plant's keys of it."""
LADDER = 1.15
"""Ratio of the factors that are tried first, from 1 outwards, until one fails."""
STARTED_FOR_S = 0.5
"""A start counts if closed loop lasts that long."""


@dataclass(kw_only=True)
class Table(sweep.Loaded, sweep.Table):
    """tables/robust.toml."""

    resistance_percent: list[float] = within(-90.0, 900.0)
    inductance_percent: list[float] = within(-90.0, 900.0)
    kphi_percent: list[float] = within(-90.0, 900.0)
    corner_resistance_percent: list[float] = within(-90.0, 900.0)
    temperatures_degc: list[float] = within(-60.0, 250.0)
    speeds_percent: list[float] = within(1.0, 1000.0)
    margin_speed_percent: float = within(1.0, 1000.0)
    torque_percent: float = within(0.0, 1000.0)
    error_percent: float = within(0.0, 100.0)
    angle_loaded_deg: float = within(0.0, 180.0)
    angle_unloaded_deg: float = within(0.0, 180.0)
    angle_over_law_deg: float = within(0.0, 180.0)
    angle_corner_deg: float = within(0.0, 180.0)
    lowest_factor: float = within(0.01, 0.99)
    highest_factor: float = within(1.01, 100.0)
    resolution_percent: float = within(0.1, 20.0)
    start_s: float = within(0.06, 10.0)

    def __post_init__(self) -> None:
        for name in ("resistance_percent", "inductance_percent", "kphi_percent", "corner_resistance_percent"):
            if len(getattr(self, name)) != 2:
                raise UserError(f"{name} has {len(getattr(self, name))} numbers", self.where, "give the lowest and the highest")

    @property
    def promised(self) -> dict[str, list[float]]:
        """How far each of PARAMETERS may be off alone: the factors."""
        percents = (self.resistance_percent, self.inductance_percent, self.kphi_percent)
        return {name: [1.0 + percent / 100.0 for percent in ends] for name, ends in zip(PARAMETERS, percents)}

    @property
    def corners(self) -> dict[str, list[float]]:
        """How far all may be off together: the factors."""
        return self.promised | {"R": [1.0 + percent / 100.0 for percent in self.corner_resistance_percent]}


@dataclass(frozen=True)
class Deviation:
    """What the plant has and the header does not know."""

    name: str
    factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """of R, L and Kphi"""
    temperature_degc: float | None = None
    promised: bool = False
    alone: str = ""
    """which of PARAMETERS, or "none", is off alone; "" for several at once, and where a margin is looked for"""

    def values(self) -> board_keys.Values:
        result = board_keys.Values()
        for keys, factor in zip(PARAMETERS.values(), self.factors):
            for key in keys:
                result.values[key] = ("factor", factor)
        if self.temperature_degc is not None:
            result.values["motor.temp_c"] = self.temperature_degc
        result.where.update(dict.fromkeys(result.values, self.name))
        return result


Case = tuple[Deviation, bool, float]
"""What is off, loaded, per cent of the rated speed."""
CRITERIA = tuple((f"{what}, {load}", loaded, holds) for load, loaded in (("no load", False), ("loaded", True)) for what, holds in (
    ("starts", lambda row: row["started"]), ("runs", lambda row: row["verdict"] == "ok")))
"""What a margin is looked for: name, loaded, what must hold."""
LOADED = {name: loaded for name, loaded, _ in CRITERIA}


@dataclass
class Margins:
    """The outcome of all searches."""

    searches: dict[tuple[str, str, bool], search.Search] = field(default_factory=dict)
    """by parameter, criterion, upwards"""
    rows: list[dict[str, Any]] = field(default_factory=list)
    """every run, with "parameter" and "factor" """

    def cell(self, parameter: str, criterion: str) -> str:
        down, up = (self.searches[parameter, criterion, upwards] for upwards in (False, True))
        if down.fails_at_once or up.fails_at_once:
            return "not at all"
        return f"{'<' if down.bad is None else ''}{down.good:.2f} .. {'>' if up.bad is None else ''}{up.good:.2f}"


@dataclass
class Robust(sweep.Sweep):
    """The sweep, and how far one may go."""

    with_margins: bool = True
    margins: Margins | None = None

    name, about, kind_of_table = "robust", "how far the motor's true R, L and Kphi may be off what the header says", Table
    columns = (
        ("R", "true R\nfactor", "{:.2f}"), ("L", "true L\nfactor", "{:.2f}"), ("Kphi", "true Kphi\nfactor", "{:.2f}"),
        ("closed_after_s", "closed\nafter s", "{:.2f}"), ("speed_error_percent", "error\n%", "{:+.2f}"),
        ("angle_error_mean_deg", "angle err\nmean deg", "{:+.1f}"), ("law_deg", "by law\ndeg", "{:+.1f}"),
        ("angle_error_rms_deg", "angle err\nrms deg", "{:.1f}"), ("angle_limit_deg", "allowed\ndeg", "{:.1f}"),
        ("current_rms_a", "phase I\nA rms", "{:.3f}"),
        ("current_of_maximum_percent", "of max\n%", "{:.0f}"), ("voltage_percent", "voltage\n% of limit", "{:.0f}"),
        ("verdict", "\nverdict", "{}"))
    keys = ("case", "load", "reference_rpm", "R", "L", "Kphi", "temperature_degc", "promised", "closed_after_s", "speed_error_percent",
            "angle_error_mean_deg", "law_deg", "angle_error_rms_deg", "angle_limit_deg", "current_rms_a", "current_of_maximum_percent",
            "voltage_percent", "need_voltage_v", "voltage_limit_v", "beyond", "fault", "verdict")

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = super().add_command(commands)
        parser.add_argument("--no-margins", action="store_true", help="only the promised deviations, not how far one may go")
        return parser

    def ask(self, options: argparse.Namespace) -> None:
        self.with_margins = not options.no_margins

    @functools.cached_property
    def rated(self) -> motor_file.Motor:
        return motor_file.load(str(self.motor.path))

    def rpm(self, percent: float) -> float:
        """A share of the rated speed, as far as the header allows."""
        return case.within_header(self.params, percent / 100.0 * self.rated.rated_speed_rpm)

    def torque_nm(self, loaded: bool) -> float:
        return self.table.torque_percent / 100.0 * self.rated.rated_torque_nm if loaded else 0.0

    def cases(self) -> list[Case]:
        return sorted(itertools.product(deviations(self.table), (False, True), self.table.speeds_percent), key=lambda item: item[1:])

    def job(self, item: Case) -> simulate.Job:
        (deviation, loaded, percent), rpm = item, self.rpm(item[2])
        events, settled_s = case.loaded_run(self.params, rpm, self.table, f"{percent:g} % ({rpm:g} rpm)",
                                            self.torque_nm(loaded), self.rated.start_torque_nm if loaded else 0.0)
        scenario = case.scenario(f"{deviation.name}, {load_name(loaded)}", self.table.title, events, rpm, settled_s, settled_s + self.table.measure_s)
        return simulate.prepare(scenario, self.library, self.motor, self.board, deviation.values())

    def row(self, item: Case, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        (deviation, loaded, percent), values = item, job.values
        rpm, limit_a, limit_v = self.rpm(percent), param(self.params, "MAXIMUM_CURRENT_A"), voltage_limit(result)
        need = reach.least(values, rpm, self.torque_nm(loaded), limit_a)
        row = {"name": "  " + deviation.name, "case": deviation.name, "load": load_name(loaded), "reference_rpm": rpm,
               "promised": deviation.promised, "temperature_degc": deviation.temperature_degc,
               **dict(zip(PARAMETERS, true_factors(self.rated, deviation))), **result, "need_voltage_v": need.voltage_v, "voltage_limit_v": limit_v,
               "beyond": reach.out_of_reach(need, limit_a, limit_v)}
        row["law_deg"] = law_deg(values, row["L"], row["iq_a"])
        if deviation.alone == "R":
            row["law_deg"] = resistance_law_deg(values, row["R"], row["id_a"], rpm)
        return row | {"angle_limit_deg": self.angle_limit_deg(deviation.alone, loaded, row["law_deg"]), "started": self.started(row)}

    def angle_limit_deg(self, alone: str, loaded: bool, law: float | None) -> float:
        """The largest RMS of the angle error."""
        table = self.table
        if not alone:
            return table.angle_corner_deg
        most = table.angle_loaded_deg if loaded else table.angle_unloaded_deg
        if alone in ("L", "R"):
            return max(abs(law or 0.0) + table.angle_over_law_deg, 0.0 if loaded and alone == "L" else most)
        return most

    def started(self, row: dict[str, Any]) -> bool:
        """Closed loop was reached, and lasted."""
        closed = row["closed_after_s"]
        return closed is not None and (row["fault_s"] is None or row["fault_s"] > self.table.start_s + closed + STARTED_FOR_S)

    def verdict(self, item: Any, row: dict[str, Any]) -> str:
        if row["closed_after_s"] is None:
            return f"no start: {row['fault'] or 'never in closed loop'}"
        if not self.started(row):
            return f"closed, then {row['fault']}"
        if row["fault"]:
            return f"fault {row['fault']}"
        if row["beyond"]:
            return reach.BEYOND
        speed = case.speed_verdict(row, self.table.error_percent)
        return speed or ("angle" if row["angle_error_rms_deg"] > row["angle_limit_deg"] else "ok")

    def check(self, item: Case, row: dict[str, Any]) -> list[Outcome]:
        """What is promised."""
        got = row["verdict"] + "".join(f", {text} {row[key]:{form}}" for text, key, form in (
            ("error", "speed_error_percent", "+.2f"), ("angle error", "angle_error_rms_deg", ".1f"), ("volts needed", "need_voltage_v", ".2f"),
            ("volts there", "voltage_limit_v", ".2f")) if row[key] is not None)
        allowed = f"starts and runs, error {self.table.error_percent:g} %, angle error {row['angle_limit_deg']:.1f} deg RMS"
        name = f"{row['case']}, {row['reference_rpm']:.0f} rpm, {row['load']}"
        return [Outcome(name, row["verdict"] in ("ok", reach.BEYOND), got, allowed)] if item[0].promised else []

    def head(self) -> dict[str, Any]:
        return super().head() | {"speed_rpm": self.rpm(self.table.margin_speed_percent), "torque_nm": self.torque_nm(True),
                                 "start_torque_nm": self.rated.start_torque_nm}

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        if not self.with_margins:
            return {}
        from . import plots
        self.margins = self.find_margins()
        found = [{"parameter": parameter, "criterion": criterion, "direction": "up" if upwards else "down", "factor": end.good,
                  "fails_at": end.bad, "why": end.why} for (parameter, criterion, upwards), end in self.margins.searches.items()]
        output.write_csv(folder / "margins.csv", list(found[0]), [list(row.values()) for row in found])
        return {"margins": found, "plots": plots.write_robust(found, self.margins.rows, self.table.promised, folder)}

    def find_margins(self) -> Margins:
        """Outwards from the header's values."""
        margins = Margins({(parameter, criterion, upwards): search.Search(upwards, holds, 1.0) for parameter, (criterion, _, holds), upwards
                           in itertools.product(PARAMETERS, CRITERIA, (False, True))})

        def tried(number: int, wanted: list[tuple[Any, float]]) -> list[dict[str, Any]]:
            cases = [(deviation_of(name, factor), loaded, self.table.margin_speed_percent) for (name, loaded), factor in wanted]
            found = self.run(cases, f"margins {number}")
            margins.rows.extend(row | {"parameter": name, "factor": factor} for ((name, _), factor), row in zip(wanted, found))
            return found
        first = [((name, loaded), factor) for factor in sorted(ladder(self.table), key=lambda factor: abs(math.log(factor)))
                 for name, loaded in itertools.product(PARAMETERS, (False, True))]
        search.in_rounds(first, margins.searches, lambda key: (key[0], LOADED[key[1]]), self.table.resolution_percent, tried)
        return margins

    def text(self, rows: list[dict[str, Any]]) -> str:
        """The cases by load and speed, then the margins."""
        lines, titles = super().text(rows).splitlines(), {
            "no load": "no load", "loaded": f"{self.torque_nm(True):.4g} N m ({self.table.torque_percent:g} % of rated), "
                                            f"started with {self.rated.start_torque_nm:.4g} N m"}
        parts, group = lines[:3], None
        for row, line in zip(rows, lines[3:]):
            if group != (group := (row["reference_rpm"], row["load"])):
                parts.append(f"{row['reference_rpm']:.0f} rpm, {titles[row['load']]}")
            parts.append(line)
        beyond = [f"{reach.BEYOND}: {row['case']}, {row['reference_rpm']:.0f} rpm, {row['load']}: {row['beyond']}" for row in rows if row["beyond"]]
        law = ("factor: true value / the header's. by law: the error that L means, tan d = (true - header's L) Iq / psi; where R alone is off, that of "
               "R, tan d = -(true - header's R) Id / (psi w).")
        return "\n".join([*parts, "", law, *beyond, *([] if self.margins is None else ["", margins_text(self.table, self.margins)])])


def load_name(loaded: bool) -> str:
    return "loaded" if loaded else "no load"


def true_factors(motor: motor_file.Motor, deviation: Deviation) -> list[float]:
    """Factors of R, L and Kphi with the temperature in them."""
    above = 0.0 if deviation.temperature_degc is None else deviation.temperature_degc - 25.0
    tempcos = (motor.resistance_tempco_per_k, 0.0, motor.kphi_tempco_per_k)
    return [factor * (1.0 + tempco * above) for factor, tempco in zip(deviation.factors, tempcos)]


def law_deg(values: Mapping[str, float], factor: float, iq_a: float | None) -> float | None:
    """The angle error that a true Lq of factor times the header's means, tan d = (true - header's Lq) Iq / psi, d = estimated less true
    angle; nothing adapts to it. A wrong Kphi or R means none: they are adapted. `values`: the plant's keys."""
    if iq_a is None:
        return None
    return math.degrees(math.atan(values["motor.lq_h"] * (1.0 - 1.0 / factor) * iq_a / values["motor.psi_vs"]))


def resistance_law_deg(values: Mapping[str, float], factor: float, id_a: float | None, rpm: float) -> float | None:
    """The angle error that a true R of factor times the header's means, if nothing of it is learnt, tan d = (true - header's R) Id / (psi w): what
    it does with a q current is adapted, but with the d current of field weakening it looks like a turned back-EMF."""
    if id_a is None:
        return None
    emf_v = values["motor.psi_vs"] * values["motor.pole_pairs"] * rpm * math.pi / 30.0
    return math.degrees(math.atan(values["motor.rs_ohm"] * (1.0 - 1.0 / factor) * -id_a / emf_v))


def voltage_limit(result: Mapping[str, Any]) -> float | None:
    """Radius of the voltage circle in volts, None without closed loop."""
    return 100.0 * result["voltage_v"] / result["voltage_percent"] if result["voltage_percent"] else None


def deviations(table: Table) -> list[Deviation]:
    """The header's motor, each parameter alone, every combination, and two temperatures."""
    result = [Deviation("as in the header", promised=True, alone="none")]
    for name, ends in table.promised.items():
        for factor in ends:
            factors = tuple(factor if other == name else 1.0 for other in PARAMETERS)
            result.append(Deviation(f"{name} {100.0 * (factor - 1.0):+.0f} %", factors, promised=True, alone=name))
    for factors in itertools.product(*table.corners.values()):
        name = " ".join(f"{name}{'+' if factor > 1.0 else '-'}" for name, factor in zip(PARAMETERS, factors))
        result.append(Deviation(name, factors, promised=True))
    return result + [Deviation(f"at {degc:g} degC", temperature_degc=degc) for degc in table.temperatures_degc]


def ladder(table: Table) -> list[float]:
    """Factors from the lowest to the highest, 1 among them."""
    down = range(1, math.ceil(math.log(table.lowest_factor) / math.log(1.0 / LADDER)))
    up = range(1, math.ceil(math.log(table.highest_factor) / math.log(LADDER)))
    return [table.lowest_factor, *sorted(LADDER ** -n for n in down), 1.0, *(LADDER ** n for n in up), table.highest_factor]


def deviation_of(parameter: str, factor: float) -> Deviation:
    return Deviation(f"{parameter} x{factor:.3f}", tuple(factor if name == parameter else 1.0 for name in PARAMETERS))


def margins_text(table: Table, margins: Margins) -> str:
    """A line for each parameter: from which to which factor it starts and runs."""
    columns = tuple((name, name.replace(", ", ",\n"), "{}") for name, _, _ in CRITERIA) + (("promised", "\npromised", "{}"),)
    rows = [{"name": name, **{criterion: margins.cell(name, criterion) for criterion, _, _ in CRITERIA},
             "promised": "{:.2f} .. {:.2f}".format(*table.promised[name])} for name in PARAMETERS]
    lines = [f"margins: true value / the header's, one at a time, to {table.resolution_percent:g} %; < and >: the search ended there",
             report.table(rows, columns)]
    ends: dict[str, list[str]] = {}
    for (parameter, criterion, _), search in margins.searches.items():
        if search.bad is not None:
            ends.setdefault(f"{parameter} x{search.bad:.2f}: {search.why}", []).append(criterion)
    return "\n".join(lines + [f"{end} [{'; '.join(criteria)}]" for end, criteria in sorted(ends.items())])
