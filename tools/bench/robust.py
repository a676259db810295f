"""`robust`: the motor's true R, L and Kphi differ from the header's. Does it start and run, and how far may each be off?
What is asked is in tools/bench/scenarios/tables/robust.toml."""

import argparse
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.common import board_keys, motor_file, output, paths
from . import command_common, report, simulate, sweep
from .board import Library
from .expect import Outcome
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
    ("angle_error_mean_deg", "angle err\nmean deg", "{:+.1f}"), ("law_deg", "by Kphi\ndeg", "{:+.1f}"),
    ("angle_error_rms_deg", "angle err\nrms deg", "{:.1f}"), ("current_rms_a", "phase I\nA rms", "{:.3f}"),
    ("current_of_maximum_percent", "of max\n%", "{:.0f}"), ("voltage_percent", "voltage\n% of limit", "{:.0f}"),
    ("verdict", "\nverdict", "{}"))
KEYS = ("case", "load", "R", "L", "Kphi", "temperature_degc", "promised", "closed_after_s", "speed_error_percent", "angle_error_mean_deg",
        "law_deg", "angle_error_rms_deg", "current_rms_a", "current_of_maximum_percent", "voltage_percent", "fault", "verdict")


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/robust.toml."""

    motor: str
    motor_where: str
    resistance_percent: float = sweep.within(0.0, 90.0)
    inductance_percent: float = sweep.within(0.0, 90.0)
    kphi_percent: float = sweep.within(0.0, 90.0)
    temperatures_degc: list[float] = sweep.within(-60.0, 250.0)
    speed_percent: float = sweep.within(1.0, 1000.0)
    torque_percent: float = sweep.within(0.0, 1000.0)
    error_percent: float = sweep.within(0.0, 100.0)
    lowest_factor: float = sweep.within(0.01, 0.99)
    highest_factor: float = sweep.within(1.01, 100.0)
    resolution_percent: float = sweep.within(0.1, 20.0)
    start_s: float = sweep.within(0.06, 10.0)
    settle_s: float = sweep.within(0.01, 60.0)
    torque_over_s: float = sweep.within(0.01, 60.0)
    measure_s: float = sweep.within(0.01, 60.0)

    @property
    def promised(self) -> dict[str, float]:
        """How far each of PARAMETERS may be off, as a share."""
        percents = (self.resistance_percent, self.inductance_percent, self.kphi_percent)
        return {name: percent / 100.0 for name, percent in zip(PARAMETERS, percents)}


@dataclass(frozen=True)
class Deviation:
    """What the plant has and the header does not know."""

    name: str
    factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """of R, L and Kphi"""
    temperature_degc: float | None = None
    promised: bool = False
    promised_loaded: bool = False
    """Under load, too: not the combinations, see robust.toml"""

    def values(self) -> board_keys.Values:
        result = board_keys.Values()
        for keys, factor in zip(PARAMETERS.values(), self.factors):
            for key in keys:
                result.values[key] = ("factor", factor)
        if self.temperature_degc is not None:
            result.values["motor.temp_c"] = self.temperature_degc
        result.where.update(dict.fromkeys(result.values, self.name))
        return result


@dataclass
class Bench:
    """Everything that the runs of one command have in common."""

    table: Table
    motor: Motor
    part: board_keys.Part
    board: board_keys.Part
    library: Library

    @property
    def rpm(self) -> float:
        return self.table.speed_percent / 100.0 * self.motor.rated_speed_rpm

    def torque_nm(self, loaded: bool) -> float:
        return self.table.torque_percent / 100.0 * self.motor.rated_torque_nm if loaded else 0.0

    def job(self, deviation: Deviation, loaded: bool) -> simulate.Job:
        table = self.table
        events, settled_s = sweep.loaded_run(self.library.params, self.rpm, table, f"{table.speed_percent:g} % ({self.rpm:g} rpm)",
                                              self.torque_nm(loaded), self.motor.start_torque_nm if loaded else 0.0)
        scenario = sweep.scenario(f"{deviation.name}, {load_name(loaded)}", table.title, events, self.rpm, settled_s,
                                   settled_s + table.measure_s)
        return simulate.prepare(scenario, self.library, self.part, self.board, deviation.values())

    def run(self, cases: list[tuple[Deviation, bool]], title: str, quiet: bool) -> list[dict[str, Any]]:
        """The reduced results of all cases, in order."""
        results = sweep.run_cases(title, [self.job(deviation, loaded) for deviation, loaded in cases], quiet)
        return [self._row(deviation, loaded, result) for (deviation, loaded), result in zip(cases, results)]

    def _row(self, deviation: Deviation, loaded: bool, result: dict[str, Any]) -> dict[str, Any]:
        row = {"name": "  " + deviation.name, "case": deviation.name, "load": load_name(loaded), "promised": deviation.promised_loaded if loaded else deviation.promised,
               "temperature_degc": deviation.temperature_degc, **dict(zip(PARAMETERS, self._true(deviation))), **result}
        return row | {"law_deg": law_deg(row["Kphi"]), "started": started(self.table, row), "verdict": verdict(self.table, row)}

    def _true(self, deviation: Deviation) -> list[float]:
        """Factors of R, L and Kphi with the temperature in them."""
        above = 0.0 if deviation.temperature_degc is None else deviation.temperature_degc - 25.0
        tempcos = (self.motor.resistance_tempco_per_k, 0.0, self.motor.kphi_tempco_per_k)
        return [factor * (1.0 + tempco * above) for factor, tempco in zip(deviation.factors, tempcos)]


def load_name(loaded: bool) -> str:
    return "loaded" if loaded else "no load"


def law_deg(factor: float) -> float | None:
    """The angle error that a true Kphi of factor times the header's means: cos d + sin d = 1 / factor, d = true less estimated angle.
    None beyond sqrt(2), where there is no lock."""
    sine = 1.0 / (factor * math.sqrt(2.0))
    return 45.0 - math.degrees(math.asin(sine)) if sine <= 1.0 else None


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
    return sweep.speed_verdict(row, table.error_percent) or "ok"


def deviations(table: Table) -> list[Deviation]:
    """The header's motor, each parameter alone, every combination, and two temperatures."""
    result = [Deviation("as in the header", promised=True, promised_loaded=True)]
    for index, name in enumerate(PARAMETERS):
        for sign in (-1.0, 1.0):
            change = sign * table.promised[name]
            factors = tuple(1.0 + change if i == index else 1.0 for i in range(3))
            result.append(Deviation(f"{name} {100.0 * change:+.0f} %", factors, promised=True, promised_loaded=True))
    for signs in itertools.product((-1.0, 1.0), repeat=3):
        factors = tuple(1.0 + sign * share for sign, share in zip(signs, table.promised.values()))
        name = " ".join(f"{name}{'+' if sign > 0.0 else '-'}" for name, sign in zip(PARAMETERS, signs))
        result.append(Deviation(name, factors, promised=True))
    return result + [Deviation(f"at {degc:g} degC", temperature_degc=degc) for degc in table.temperatures_degc]


@dataclass
class Search:
    """How far one parameter may be off in one direction: `good` still does, `bad` is the first that does not, `why` says what happens
    there. No `bad`: all up to the bound do. What works again beyond the first failure does not count."""

    parameter: str
    upwards: bool
    loaded: bool
    holds: Callable[[dict[str, Any]], bool]
    tried: dict[float, tuple[bool, str]] = field(default_factory=dict)
    good: float = 1.0
    bad: float | None = None
    why: str = ""

    def narrow(self, factor: float, row: dict[str, Any]) -> None:
        """Learn from one run."""
        self.tried[factor] = (self.holds(row), row["verdict"])
        self.good, self.bad, self.why = 1.0, None, ""
        for known in sorted(self.tried, reverse=not self.upwards):
            holds, verdict = self.tried[known]
            if not holds:
                self.bad, self.why = known, verdict
                return
            self.good = known

    def next(self, resolution: float) -> float | None:
        """The factor to try next; None when it is known well enough."""
        if self.bad is None or max(self.good, self.bad) / min(self.good, self.bad) <= 1.0 + resolution:
            return None
        return math.sqrt(self.good * self.bad)


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
        margins.searches[parameter, criterion, upwards] = Search(parameter, upwards, loaded, holds)
    wanted = {(name, factor, loaded) for name in PARAMETERS for factor in ladder(table) for loaded in (False, True)}
    number = 0
    while wanted:
        number += 1
        cases = sorted(wanted, key=lambda case: abs(math.log(case[1]))) # outwards
        found = bench.run([(deviation_of(name, factor), loaded) for name, factor, loaded in cases], f"margins {number}", quiet)
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
    userparams = options.userparams
    if userparams is None and options.library is None and options.motor:
        userparams = command_common.tuned_header(motor_file.part(options.motor, "--motor").path)
    part, board, library, used = command_common.set_up(table, options, [], userparams)
    bench = Bench(table, motor_file.load(str(part.path)), part, board, library)
    target = options.out or paths.RESULTS / "robust"
    with output.ResultFolder(target) as folder:
        cases = [(deviation, loaded) for loaded in (False, True) for deviation in deviations(table)]
        rows = bench.run(cases, "robust", options.quiet)
        outcomes = [check(table, row) for row in rows if row["promised"]]
        margins = None if options.no_margins else find_margins(bench, options.quiet)
        _write(folder.work, bench, rows, margins, outcomes, used)
    print(f"{table.title}\n\n{report.used_text(used)}\n")
    print(text(bench, rows))
    if margins is not None:
        print("\n" + margins_text(table, margins))
    print(f"\nresults in {paths.shown(target)}/")
    return command_common.verdict("robust", outcomes)


def check(table: Table, row: dict[str, Any]) -> Outcome:
    """One promised case."""
    error = "" if row["speed_error_percent"] is None else f", error {row['speed_error_percent']:+.2f} %"
    return Outcome(f"{row['case']}, {row['load']}", row["verdict"] == "ok", row["verdict"] + error,
                   f"starts and runs, error at most {table.error_percent:g} %")


def text(bench: Bench, rows: list[dict[str, Any]]) -> str:
    """The cases as printed: those without load, then those under load."""
    table, motor = bench.table, bench.motor
    lines = report.table(rows, COLUMNS).splitlines()
    half = 3 + len(rows) // 2
    return "\n".join([*lines[:3], f"{bench.rpm:g} rpm, no load", *lines[3:half],
                      f"{bench.rpm:g} rpm, {bench.torque_nm(True):.4g} N m ({table.torque_percent:g} % of rated), "
                      f"started with {motor.start_torque_nm:.4g} N m", *lines[half:], "",
                      "factor: true value / the header's. by Kphi: the error that Kphi alone means, cos d + sin d = header's / true Kphi;",
                      "a Kphi below 0.71 of the header's cannot be locked to at all."])


def margins_text(table: Table, margins: Margins) -> str:
    """A line for each parameter: from which to which factor it starts and runs."""
    columns = tuple((name, name.replace(", ", ",\n"), "{}") for name, _, _ in CRITERIA) + (("promised", "\npromised", "{}"),)
    rows = [{"name": name, **{criterion: margins.cell(name, criterion) for criterion, _, _ in CRITERIA},
             "promised": f"{1.0 - table.promised[name]:.2f} .. {1.0 + table.promised[name]:.2f}"} for name in PARAMETERS]
    lines = [f"margins: true value / the header's, one at a time, to {table.resolution_percent:g} %; < and >: the search ended there",
             report.table(rows, columns)]
    ends: dict[str, list[str]] = {}
    for (parameter, criterion, _), search in margins.searches.items():
        if search.bad is not None:
            ends.setdefault(f"{parameter} x{search.bad:.2f}: {search.why}", []).append(criterion)
    return "\n".join(lines + [f"{end} [{'; '.join(criteria)}]" for end, criteria in sorted(ends.items())])


def _write(folder: Path, bench: Bench, rows: list[dict[str, Any]], margins: Margins | None, outcomes: list[Outcome],
           used: dict[str, Any]) -> None:
    head = {"title": bench.table.title, **used, "speed_rpm": bench.rpm, "torque_nm": bench.torque_nm(True), "start_torque_nm": bench.motor.start_torque_nm}
    more: dict[str, Any] = {}
    if margins is not None:
        from . import plots
        found = [{"parameter": parameter, "criterion": criterion, "direction": "up" if upwards else "down", "factor": search.good,
                  "fails_at": search.bad, "why": search.why} for (parameter, criterion, upwards), search in margins.searches.items()]
        output.write_csv(folder / "margins.csv", list(found[0]), [list(row.values()) for row in found])
        more = {"margins": found, "plots": plots.write_robust(found, margins.rows, bench.table.promised, law_deg, folder)}
    report.write_table(folder, "robust", KEYS, rows, outcomes, head, more)
