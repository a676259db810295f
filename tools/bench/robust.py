"""`robust`: the motor's true R, L and Kphi differ from the header's. Does it start and run, and how far may each be off?
What is asked is in tools/bench/scenarios/tables/robust.toml."""

import argparse
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.common import board_keys, motor_file, output, paths
from . import command_common, reach, report, simulate, sweep
from .board import Library
from .expect import Outcome
from .scenario import param
from tools.common.errors import UserError
from tools.common.motor_file import Motor

PARAMETERS = {"R": ("motor.rs_ohm",), "L": ("motor.ld_h", "motor.lq_h"), "Kphi": ("motor.psi_vs",)}
"""What can be off, and the plant's keys of it."""
LADDER = 1.15
"""Ratio of the factors that are tried first, from 1 outwards, until one fails."""
STARTED_FOR_S = 0.5
"""A start counts if closed loop lasts that long."""

COLUMNS = (
    ("R", "true R\nfactor", "{:.2f}"), ("L", "true L\nfactor", "{:.2f}"), ("Kphi", "true Kphi\nfactor", "{:.2f}"),
    ("closed_after_s", "closed\nafter s", "{:.2f}"), ("speed_error_percent", "error\n%", "{:+.2f}"),
    ("angle_error_mean_deg", "angle err\nmean deg", "{:+.1f}"), ("law_deg", "by law\ndeg", "{:+.1f}"),
    ("angle_error_rms_deg", "angle err\nrms deg", "{:.1f}"), ("angle_limit_deg", "allowed\ndeg", "{:.1f}"),
    ("current_rms_a", "phase I\nA rms", "{:.3f}"),
    ("current_of_maximum_percent", "of max\n%", "{:.0f}"), ("voltage_percent", "voltage\n% of limit", "{:.0f}"),
    ("verdict", "\nverdict", "{}"))
KEYS = ("case", "load", "reference_rpm", "R", "L", "Kphi", "temperature_degc", "promised", "closed_after_s", "speed_error_percent",
        "angle_error_mean_deg", "law_deg", "angle_error_rms_deg", "angle_limit_deg", "current_rms_a", "current_of_maximum_percent",
        "voltage_percent", "need_voltage_v", "voltage_limit_v", "beyond", "fault", "verdict")


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/robust.toml."""

    motor: str
    motor_where: str
    resistance_percent: list[float] = sweep.within(-90.0, 900.0)
    inductance_percent: list[float] = sweep.within(-90.0, 900.0)
    kphi_percent: list[float] = sweep.within(-90.0, 900.0)
    corner_resistance_percent: list[float] = sweep.within(-90.0, 900.0)
    temperatures_degc: list[float] = sweep.within(-60.0, 250.0)
    speeds_percent: list[float] = sweep.within(1.0, 1000.0)
    margin_speed_percent: float = sweep.within(1.0, 1000.0)
    torque_percent: float = sweep.within(0.0, 1000.0)
    error_percent: float = sweep.within(0.0, 100.0)
    angle_loaded_deg: float = sweep.within(0.0, 180.0)
    angle_unloaded_deg: float = sweep.within(0.0, 180.0)
    angle_over_law_deg: float = sweep.within(0.0, 180.0)
    angle_corner_deg: float = sweep.within(0.0, 180.0)
    lowest_factor: float = sweep.within(0.01, 0.99)
    highest_factor: float = sweep.within(1.01, 100.0)
    resolution_percent: float = sweep.within(0.1, 20.0)
    start_s: float = sweep.within(0.06, 10.0)
    settle_s: float = sweep.within(0.01, 60.0)
    torque_over_s: float = sweep.within(0.01, 60.0)
    measure_s: float = sweep.within(0.01, 60.0)

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


@dataclass
class Bench:
    """Everything that the runs of one command have in common."""

    table: Table
    motor: Motor
    part: board_keys.Part
    board: board_keys.Part
    library: Library

    def rpm(self, percent: float) -> float:
        """A share of the rated speed, as far as the header allows."""
        return sweep.within_header(self.library.params, percent / 100.0 * self.motor.rated_speed_rpm)

    def torque_nm(self, loaded: bool) -> float:
        return self.table.torque_percent / 100.0 * self.motor.rated_torque_nm if loaded else 0.0

    def job(self, deviation: Deviation, loaded: bool, percent: float) -> simulate.Job:
        table, rpm = self.table, self.rpm(percent)
        events, settled_s = sweep.loaded_run(self.library.params, rpm, table, f"{percent:g} % ({rpm:g} rpm)",
                                              self.torque_nm(loaded), self.motor.start_torque_nm if loaded else 0.0)
        scenario = sweep.scenario(f"{deviation.name}, {load_name(loaded)}", table.title, events, rpm, settled_s,
                                   settled_s + table.measure_s)
        return simulate.prepare(scenario, self.library, self.part, self.board, deviation.values())

    def run(self, cases: list[Case], title: str, quiet: bool) -> list[dict[str, Any]]:
        """The reduced results of all cases, in order."""
        jobs = [self.job(*item) for item in cases]
        results = sweep.run_cases(title, jobs, quiet)
        return [self._row(*item, job.values, result) for item, job, result in zip(cases, jobs, results)]

    def _row(self, deviation: Deviation, loaded: bool, percent: float, values: dict[str, float], result: dict[str, Any]) -> dict[str, Any]:
        rpm, limit_a = self.rpm(percent), param(self.library.params, "MAXIMUM_CURRENT_A")
        need, limit_v = reach.least(values, rpm, self.torque_nm(loaded), limit_a), voltage_limit(result)
        row = {"name": "  " + deviation.name, "case": deviation.name, "load": load_name(loaded), "reference_rpm": rpm,
               "promised": deviation.promised, "temperature_degc": deviation.temperature_degc,
               **dict(zip(PARAMETERS, self._true(deviation))), **result, "need_voltage_v": need.voltage_v, "voltage_limit_v": limit_v,
               "beyond": reach.out_of_reach(need, limit_a, limit_v)}
        row["law_deg"] = law_deg(values, row["L"], row["iq_a"])
        if deviation.alone == "R":
            row["law_deg"] = resistance_law_deg(values, row["R"], row["id_a"], rpm)
        row["angle_limit_deg"] = angle_limit_deg(self.table, deviation.alone, loaded, row["law_deg"])
        return row | {"started": started(self.table, row), "verdict": verdict(self.table, row)}

    def _true(self, deviation: Deviation) -> list[float]:
        """Factors of R, L and Kphi with the temperature in them."""
        above = 0.0 if deviation.temperature_degc is None else deviation.temperature_degc - 25.0
        tempcos = (self.motor.resistance_tempco_per_k, 0.0, self.motor.kphi_tempco_per_k)
        return [factor * (1.0 + tempco * above) for factor, tempco in zip(deviation.factors, tempcos)]


def load_name(loaded: bool) -> str:
    return "loaded" if loaded else "no load"


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


def angle_limit_deg(table: Table, alone: str, loaded: bool, law: float | None) -> float:
    """The largest RMS of the angle error."""
    if not alone:
        return table.angle_corner_deg
    most = table.angle_loaded_deg if loaded else table.angle_unloaded_deg
    if alone in ("L", "R"):
        return max(abs(law or 0.0) + table.angle_over_law_deg, 0.0 if loaded and alone == "L" else most)
    return most


def voltage_limit(result: Mapping[str, Any]) -> float | None:
    """Radius of the voltage circle in volts, None without closed loop."""
    return 100.0 * result["voltage_v"] / result["voltage_percent"] if result["voltage_percent"] else None


def started(table: Table, row: dict[str, Any]) -> bool:
    """Closed loop was reached, and lasted."""
    closed = row["closed_after_s"]
    return closed is not None and (row["fault_s"] is None or row["fault_s"] > table.start_s + closed + STARTED_FOR_S)


def verdict(table: Table, row: dict[str, Any]) -> str:
    """"ok", or the first thing that does not hold."""
    if row["closed_after_s"] is None:
        return f"no start: {row['fault'] or 'never in closed loop'}"
    if not started(table, row):
        return f"closed, then {row['fault']}"
    if row["fault"]:
        return f"fault {row['fault']}"
    if row["beyond"]:
        return reach.BEYOND
    speed = sweep.speed_verdict(row, table.error_percent)
    return speed or ("angle" if row["angle_error_rms_deg"] > row["angle_limit_deg"] else "ok")


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


@dataclass
class Search(sweep.Search):
    """How far one parameter may be off in one direction."""

    parameter: str = ""
    loaded: bool = False


CRITERIA = tuple((f"{what}, {load}", loaded, holds) for load, loaded in (("no load", False), ("loaded", True)) for what, holds in (
    ("starts", lambda row: row["started"]), ("runs", lambda row: row["verdict"] == "ok")))
"""What a margin is looked for: name, loaded, what must hold."""


@dataclass
class Margins:
    """The outcome of all searches."""

    searches: dict[tuple[str, str, bool], Search] = field(default_factory=dict)
    """by parameter, criterion, upwards"""
    rows: list[dict[str, Any]] = field(default_factory=list)
    """every run, with "parameter" and "factor" """

    def cell(self, parameter: str, criterion: str) -> str:
        down, up = (self.searches[parameter, criterion, upwards] for upwards in (False, True))
        if down.bad == 1.0 or up.bad == 1.0:
            return "not at all"
        return f"{'<' if down.bad is None else ''}{down.good:.2f} .. {'>' if up.bad is None else ''}{up.good:.2f}"


def find_margins(bench: Bench, quiet: bool) -> Margins:
    """Steps outwards from the header's values, then bisection between the last that holds and the first that does not, all in parallel."""
    table, margins = bench.table, Margins()
    for parameter, (criterion, loaded, holds), upwards in itertools.product(PARAMETERS, CRITERIA, (False, True)):
        margins.searches[parameter, criterion, upwards] = Search(upwards, holds, 1.0, parameter, loaded)
    wanted = {(name, factor, loaded) for name in PARAMETERS for factor in ladder(table) for loaded in (False, True)}
    number = 0
    while wanted:
        number += 1
        cases = sorted(wanted, key=lambda case: abs(math.log(case[1]))) # outwards
        tried = [(deviation_of(name, factor), loaded, table.margin_speed_percent) for name, factor, loaded in cases]
        found = bench.run(tried, f"margins {number}", quiet)
        for (name, factor, loaded), row in zip(cases, found):
            margins.rows.append(row | {"parameter": name, "factor": factor})
            for search in margins.searches.values():
                if search.parameter == name and search.loaded == loaded and (factor == 1.0 or (factor > 1.0) == search.upwards):
                    search.narrow(factor, row)
        wanted = {(search.parameter, factor, search.loaded) for search in margins.searches.values()
                  if (factor := search.next(table.resolution_percent / 100.0)) is not None and search.bad != 1.0}
    return margins


def ladder(table: Table) -> list[float]:
    """Factors from the lowest to the highest, 1 among them."""
    down = range(1, math.ceil(math.log(table.lowest_factor) / math.log(1.0 / LADDER)))
    up = range(1, math.ceil(math.log(table.highest_factor) / math.log(LADDER)))
    return [table.lowest_factor, *sorted(LADDER ** -n for n in down), 1.0, *(LADDER ** n for n in up), table.highest_factor]


def deviation_of(parameter: str, factor: float) -> Deviation:
    return Deviation(f"{parameter} x{factor:.3f}", tuple(factor if name == parameter else 1.0 for name in PARAMETERS))


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    table = Table.read(paths.TABLES / "robust.toml")
    part, board, library, used = command_common.set_up(table, options, [])
    bench = Bench(table, motor_file.load(str(part.path)), part, board, library)
    target = command_common.results("robust", table.motor, options)
    with output.ResultFolder(target) as folder:
        cases = list(itertools.product(deviations(table), (False, True), table.speeds_percent))
        cases.sort(key=lambda item: (item[1], item[2]))
        rows = bench.run(cases, "robust", options.quiet)
        outcomes = [check(table, row) for row in rows if row["promised"]]
        margins = None if options.no_margins else find_margins(bench, options.quiet)
        _write(folder.work, bench, rows, margins, outcomes, used)
    print(f"{table.title}\n\n{report.used_text(used)}\n")
    print(text(bench, rows))
    if margins is not None:
        print("\n" + margins_text(table, margins))
    print(f"\nresults in {paths.shown(target)}/: index.html")
    return command_common.verdict("robust", outcomes)


def check(table: Table, row: dict[str, Any]) -> Outcome:
    """One promised case."""
    got = row["verdict"] + "".join(f", {text} {row[key]:{form}}" for text, key, form in (
        ("error", "speed_error_percent", "+.2f"), ("angle error", "angle_error_rms_deg", ".1f"), ("volts needed", "need_voltage_v", ".2f"),
        ("volts there", "voltage_limit_v", ".2f")) if row[key] is not None)
    return Outcome(f"{row['case']}, {row['reference_rpm']:.0f} rpm, {row['load']}", row["verdict"] in ("ok", reach.BEYOND), got,
                   f"starts and runs, error {table.error_percent:g} %, angle error {row['angle_limit_deg']:.1f} deg RMS")


def text(bench: Bench, rows: list[dict[str, Any]]) -> str:
    """The cases as printed, by load and speed."""
    lines, titles = report.table(rows, COLUMNS).splitlines(), {
        "no load": "no load", "loaded": f"{bench.torque_nm(True):.4g} N m ({bench.table.torque_percent:g} % of rated), "
                                        f"started with {bench.motor.start_torque_nm:.4g} N m"}
    parts, group = lines[:3], None
    for row, line in zip(rows, lines[3:]):
        if group != (group := (row["reference_rpm"], row["load"])):
            parts.append(f"{row['reference_rpm']:.0f} rpm, {titles[row['load']]}")
        parts.append(line)
    beyond = [f"{row['case']}, {row['reference_rpm']:.0f} rpm, {row['load']}: {row['beyond']}" for row in rows if row["beyond"]]
    law = ("factor: true value / the header's. by law: the error that L means, tan d = (true - header's L) Iq / psi; where R alone is off, that of "
           "R, tan d = -(true - header's R) Id / (psi w).")
    return "\n".join([*parts, "", law] + [f"{reach.BEYOND}: {line}" for line in beyond])


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


def _write(folder: Path, bench: Bench, rows: list[dict[str, Any]], margins: Margins | None, outcomes: list[Outcome],
           used: dict[str, Any]) -> None:
    head = {"title": bench.table.title, **used, "speed_rpm": bench.rpm(bench.table.margin_speed_percent),
            "torque_nm": bench.torque_nm(True), "start_torque_nm": bench.motor.start_torque_nm}
    more: dict[str, Any] = {}
    if margins is not None:
        from . import plots
        found = [{"parameter": parameter, "criterion": criterion, "direction": "up" if upwards else "down", "factor": search.good,
                  "fails_at": search.bad, "why": search.why} for (parameter, criterion, upwards), search in margins.searches.items()]
        output.write_csv(folder / "margins.csv", list(found[0]), [list(row.values()) for row in found])
        more = {"margins": found, "plots": plots.write_robust(found, margins.rows, bench.table.promised, folder)}
    report.write_table(folder, "robust", KEYS, rows, outcomes, head, more)
