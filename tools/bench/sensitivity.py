"""`sensitivity`: every number of include/control/tuned.h less and more than it is; what moves, and which is on an edge? What is asked is in
tools/bench/scenarios/tables/sensitivity.toml."""

import argparse
import itertools
import shutil
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import motor_file, output, paths, workers
from tools.common.board_keys import Values
from tools.common.errors import UserError, suggestion
from tools.common.progress import Progress
from tools.common.trace import wrapped_deg
from tools.common.tuned_rows import HEADER, TABLE, Row, tuned, with_value
from . import build, case, command_common, loadsteps, report, scenario_file, simulate, sweep
from .board import Library
from .expect import Outcome
from .run import Run
from .scenario import BRAKE, Event, Scenario, param
from .sweep import within

FOLDER = paths.ROOT / "build" / "sensitivity"
NEEDED_S = 0.1
"""To END_SPEED_RPM, beside the start's own time."""
OTHER = ("motor.rs_ohm", "motor.ld_h", "motor.lq_h", "motor.psi_vs")


MEASURED = {"dip_percent": 2, "angle_deg": 2, "low_angle_deg": 2, "lowest_rpm": 0, "start_s": 3}
"""What is measured, and with how many digits it is told."""


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/sensitivity.toml."""

    step_rpm_where: str
    change_percent: float = within(1.0, 50.0)
    scenarios: str
    start_s: float = within(0.01, 60.0)
    settle_s: float = within(0.01, 60.0)
    torque_over_s: float = within(0.01, 60.0)
    step_rpm: list[float] = within(1.0)
    step_nm: list[float] = within(0.0)
    hold_s: float = within(0.01, 60.0)
    back_percent: float = within(0.01, 100.0)
    other_factors: list[float] = within(0.1, 10.0)
    low_rpm: list[float] = within(1.0)
    low_nm: list[float] = within(0.0)
    low_hold_s: float = within(0.01, 60.0)
    low_error_percent: float = within(0.0, 100.0)
    low_angle_deg: float = within(0.0, 180.0)
    start_deg: list[float] = within(0.0, 360.0)
    start_nm: list[float] = within(0.0)

    def __post_init__(self) -> None:
        self.same_lengths("step_rpm", "step_nm")
        if len(self.other_factors) != 3:
            raise UserError("other_factors are three", self.where, "give those of R, L and Kphi")

    def for_motor(self, motor: motor_file.Motor, params: dict[str, float]) -> "Table":
        """The table for another motor than its own; the least speed is the header's."""
        steps, loads = case.shares(self.motor, motor, self.step_rpm, self.step_nm)
        speeds, brakes = case.shares(self.motor, motor, self.low_rpm, self.low_nm)
        own = motor_file.load(self.motor).start_torque_nm
        least = 0.4 * param(params, "MINIMUM_SPEED_RPM")
        names = [name for name in self.scenarios.split() if scenario_file.load(name).follows_header] or ["rated"]
        return replace(self, motor=motor.name, scenarios=" ".join(names), step_rpm=[case.within_header(params, rpm) for rpm in steps], step_nm=loads,
                       low_rpm=[rpm for rpm in speeds if rpm >= least], low_nm=brakes,
                       start_nm=[case.three_digits(torque * motor.start_torque_nm / own) for torque in self.start_nm])


@dataclass
class Variant:
    """A firmware: as it stands (no row), or with a row's value changed."""

    row: Row | None = None
    value: str = ""
    library: Library | None = None
    """None where it does not build, or is the same program"""
    said: str = ""
    """why it has none"""

    @property
    def name(self) -> str:
        return f"{self.row.name} {self.row.value} -> {self.value}" if self.row else "as it stands"

    @property
    def file(self) -> Path:
        return FOLDER / (f"{self.row.name}-{self.value}.so" if self.row else "as-it-stands.so")


@dataclass(frozen=True)
class Probe:
    """One run that every variant makes. `kind`: step, low, start, or a scenario's name."""

    kind: str
    numbers: tuple[float, ...] = ()
    other: bool = False

    @property
    def name(self) -> str:
        return " ".join([self.kind, *(f"{number:g}" for number in self.numbers), *(["other motor"] if self.other else [])])


@dataclass
class Found:
    """What a probe has shown."""

    probe: Probe
    print: int
    """of the trace: the same where nothing moves"""
    wrong: str = ""
    values: dict[str, float] = field(default_factory=dict)


class Sensitivity(sweep.Sweep):
    """The sweep. A case is a variant and a probe; a row of the table is a variant."""

    name, about, kind_of_table, defines = "sensitivity", "every number chosen by trial a fifth less and more: what moves", Table, ("PARAMS_IN_RAM",)
    columns = (("dip_percent_told", "dip\n%", "{}"), ("angle_deg_told", "angle err\nmax deg", "{}"), ("low_angle_deg_told", "at low speed\nrms deg", "{}"),
               ("lowest_rpm_told", "lowest\nrpm", "{}"), ("starts", "starts\nthat work", "{}"), ("start_s_told", "closed\nafter s", "{}"),
               ("verdict", "\nverdict", "{}"))
    keys = ("number", "value", *MEASURED, *(f"{key}_before" for key in MEASURED), "starts", "verdict")
    only: tuple[str, ...] = ()
    all = False
    """every probe for each number, not its own alone"""
    header = paths.ROOT
    """the folder of the header"""

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = super().add_command(commands)
        parser.add_argument("--only", nargs="+", default=[], metavar="NUMBER", help="these rows of include/control/tuned.h alone")
        parser.add_argument("--all", action="store_true", help="every probe for each number, not only those of its own command")
        return parser

    def ask(self, options: argparse.Namespace) -> None:
        for name in options.only:
            if name not in tuned():
                raise UserError(f"no number '{name}'", str(paths.shown(TABLE)), suggestion(name, tuned(), "docs/tuned.md"))
        self.only, self.all = tuple(options.only), options.all
        asked = command_common.header_for(options)
        self.header = asked and build.header_folder(asked) or paths.ROOT

    def variants(self) -> list[Variant]:
        """The firmware as it stands, then each number less and more."""
        change = self.table.change_percent
        return [Variant(), *(Variant(row, row.changed(percent)) for name, row in tuned().items() if not self.only or name in self.only
                             for percent in (-change, change))]

    def probes(self) -> list[Probe]:
        table, steps = self.table, list(zip(self.table.step_rpm, self.table.step_nm))
        return [*(Probe("step", step) for step in steps), Probe("step", steps[-1], other=True), *(Probe("low", (torque,)) for torque in table.low_nm),
                *(Probe("start", pair) for pair in itertools.product(table.start_nm, table.start_deg)), *map(Probe, table.scenarios.split())]

    def job_of(self, variant: Variant, probe: Probe) -> simulate.Job:
        """A probe with a variant's firmware."""
        table, params = self.table, variant.library.params
        plant, lowered = Values(), {}
        if probe.other:
            resistance, inductance, flux = table.other_factors
            plant = Values({key: ("factor", factor) for key, factor in zip(OTHER, (resistance, inductance, inductance, flux))},
                           dict.fromkeys(OTHER, table.where))
        if probe.kind == "step":
            item = self.step(params, *probe.numbers)
        elif probe.kind == "low":
            lowered = {"MINIMUM_SPEED_RPM": min(table.low_rpm)}
            item = self.low(params | lowered, *probe.numbers)
        elif probe.kind == "start":
            item = self.start(params, *probe.numbers)
        else:
            item = scenario_file.load(probe.kind)
        job = simulate.prepare(item, variant.library, self.motor, self.board, plant, lowered)
        job.case = probe
        return job

    def step(self, params: dict[str, float], rpm: float, torque_nm: float) -> Scenario:
        events, on_s = case.loaded_run(params, rpm, self.table, f"{rpm:g} rpm")
        off_s = on_s + self.table.hold_s
        events += [Event(at_s, "set", self.table.where, keys={BRAKE: brake_nm}) for at_s, brake_nm in ((on_s, torque_nm), (off_s, 0.0))]
        return case.scenario("step", self.table.title, events, rpm, on_s, off_s + self.table.hold_s)

    def low(self, params: dict[str, float], torque_nm: float) -> Scenario:
        table = self.table
        events, from_s = case.loaded_run(params, table.low_rpm[0], table, "low", torque_nm)
        events += [Event(from_s + number * table.low_hold_s, "speed_rpm", table.where, value=rpm) for number, rpm in enumerate(table.low_rpm)]
        return case.scenario("low", table.title, events, table.low_rpm[-1], from_s, from_s + len(table.low_rpm) * table.low_hold_s)

    def start(self, params: dict[str, float], torque_nm: float, rotor_deg: float) -> Scenario:
        events, closed_s = case.loaded_run(params, param(params, "END_SPEED_RPM"), self.table, "start", torque_nm, torque_nm)
        closed_s += NEEDED_S
        plant = Values({BRAKE: torque_nm}, {BRAKE: self.table.where})
        return case.scenario("start", self.table.title, events, param(params, "END_SPEED_RPM"), closed_s - NEEDED_S, closed_s,
                             rotor_deg=rotor_deg, plant=plant)

    def measured(self, run: Run, item: Probe) -> Found:
        """In the process that ran it."""
        found = Found(item, zlib.crc32(np.ascontiguousarray(run.trace.data).tobytes()))
        own = {"step": self.of_step, "low": self.of_low, "start": self.of_start}.get(item.kind)
        if own is None:
            wrong = [outcome for outcome in report.check(run) if not outcome.ok]
            return replace(found, wrong=f"{item.name}: {wrong[0].row}: {wrong[0].got}" if wrong else "")
        values, wrong = own(run)
        faults = run.raised()
        wrong = f"fault {faults[0][2]}" if faults and item.kind != "low" else wrong
        return replace(found, values=values, wrong=f"{item.name}: {wrong}" if wrong else "")

    def of_step(self, run: Run) -> tuple[dict[str, float], str]:
        measure, table = run.scenario.measures[0], self.table
        both, off = run.trace.part(measure.from_s, measure.to_s), run.trace.part(measure.from_s + table.hold_s, measure.to_s)
        speed = both.column("plant.speed_rpm").astype(np.float64)
        back = [loadsteps.back_after(part.column("plant.speed_rpm").astype(np.float64), measure.reference_rpm, table.back_percent, run.trace.period_s)
                for part in (run.trace.part(measure.from_s, measure.from_s + table.hold_s), off)]
        return ({"dip_percent": 100.0 * (1.0 - float(speed.min()) / measure.reference_rpm), "angle_deg": float(angle_error(both).max())},
                "" if None not in back else f"not back in {table.hold_s:g} s")

    def of_low(self, run: Run) -> tuple[dict[str, float], str]:
        """The speed above the first that is not held."""
        table, from_s = self.table, run.scenario.measures[0].from_s
        held, angles, is_lost = 0.0, [], False
        for number, rpm in enumerate(table.low_rpm):
            part = run.trace.part(from_s + (number + 0.5) * table.low_hold_s, from_s + (number + 1) * table.low_hold_s)
            error = abs(float(part.column("plant.speed_rpm").astype(np.float64).mean()) / rpm - 1.0)
            angles.append(float(np.sqrt((angle_error(part) ** 2).mean())))
            is_lost |= bool(part.column("fw.fault").any()) or error > table.low_error_percent / 100.0 or angles[-1] > table.low_angle_deg
            held = held if is_lost else rpm
        return {"lowest_rpm": held, "low_angle_deg": float(np.mean(angles))}, "" if held else f"{table.low_rpm[0]:g} rpm not held"

    def of_start(self, run: Run) -> tuple[dict[str, float], str]:
        hand_overs = run.hand_overs()
        return ({"start_s": hand_overs[0].after_s2_s}, "") if hand_overs else ({}, "no closed loop")

    def summed(self, variant: Variant, found: list[Found], before: list[Found]) -> dict[str, Any]:
        """A variant's row. `before`: what the firmware as it stands has shown."""
        same = {item.probe: item for item in before}
        before = [same[item.probe] for item in found]
        starts = [item for item in found if item.probe.kind == "start"]
        row: dict[str, Any] = {"name": variant.name, "number": variant.row.name if variant.row else "", "value": variant.value,
                               "starts": f"{sum(not item.wrong for item in starts)}/{len(starts)}" if starts else None,
                               "moved": moved(found, before),
                               "wrong": [item.wrong for item in found if item.wrong]}
        for key, digits in MEASURED.items():
            now, was = (mean_or_most(key, [item.values[key] for item in part if key in item.values]) for part in (found, before))
            row |= {key: now, f"{key}_before": was}
            if now is not None:
                row[f"{key}_told"] = f"{now:.{digits}f}" + (f" {now - was:+.{digits}f}" if variant.row and was is not None else "")
        known = {item.probe for item in before if item.wrong}
        edge = [item.wrong for item in found if item.wrong and item.probe not in known]
        row["why"] = "; ".join(edge) or variant.said.removeprefix(REFUSED)
        row["verdict"] = variant.said.partition(":")[0] or (EDGE if edge else "ok" if variant.row is None else "" if row["moved"] else NOTHING)
        return row

    def text(self, rows: list[dict[str, Any]]) -> str:
        """And what fails on an edge."""
        told = [f"{row['name']}: {row['verdict']}: {row['why']}" for row in rows if row["verdict"] in (EDGE, REFUSED[:-2])]
        return "\n".join([super().text(rows), "", *told, f"moves nothing: {', '.join(nothing_moves(rows)) or 'none'}",
                          f"on an edge: {', '.join(edges(rows)) or 'none'}"])

    def found(self, wanted: list[tuple[Variant, list[Probe]]]) -> list[list[Found]]:
        """What each variant's probes show."""
        results = iter(self.results(self.name, [self.job_of(variant, probe) for variant, probes in wanted for probe in probes]))
        return [list(itertools.islice(results, len(probes))) for _, probes in wanted]

    def finish(self, target: Path) -> int:
        """Builds, runs and tells; returns the exit code."""
        variants, probes = self.variants(), self.probes()
        with output.ResultFolder(target) as folder:
            build_all(variants, self.header, self.defines, self.quiet)
            built = [variant for variant in variants if variant.library]
            before, *first = self.found([(variant, probes if not variant.row or self.all else own_of(variant.row, probes)) for variant in built])
            idle = [(variant, [probe for probe in probes if probe not in own_of(variant.row, probes)]) for variant, found in zip(built[1:], first)
                    if not self.all and not moved(found, before)]
            more_of = dict(zip((variant.name for variant, _ in idle), self.found(idle)))
            shown = {variant.name: found + more_of.get(variant.name, []) for variant, found in zip(built[1:], first)}
            rows = [self.summed(variant, shown.get(variant.name, []) if variant.row else before, before) for variant in variants]
            self.outcomes = [Outcome(item.probe.name, not item.wrong, item.wrong or "ok", "as it stands all is well") for item in before]
            from . import plots
            more = {"plots": plots.write_sensitivity(rows, folder.work), "nothing": nothing_moves(rows), "edges": edges(rows)}
            report.write_table(folder.work, self.name, self.keys, rows, self.outcomes, self.head(), more, fine=("ok", "", NOTHING, SAME))
        print(self.told(rows))
        print(f"\nresults in {paths.shown(target)}/: index.html")
        return command_common.verdict(self.name, self.outcomes)


OWN = {"loadsteps": ("step",), "lowspeed": ("low",), "starts": ("start",), "robust": ("step", "other"),
       "catch": ("catch_backward", "stop_from_top", "brake_without_sink"), "campaign": ("step", "fault_open_phase", "fault_lost_lock")}
"""Kinds of probes that are short forms of a target's sweep."""
EDGE, REFUSED, NOTHING = "edge", "does not build: ", "moves nothing"
SAME = "the same program"
LOADED = 2
"""ELF's flag of a section that is in memory."""


def own_of(row: Row, probes: list[Probe]) -> list[Probe]:
    """The probes that are like the command which shows the row's effect; all, if none is."""
    target, _, scenario = row.command.partition(" SCENARIO=")
    kinds = OWN.get(target, (scenario,))
    return [probe for probe in probes if ("other" if probe.other else probe.kind) in kinds] or probes


def mean_or_most(key: str, values: list[float]) -> float | None:
    """Of a speed that is held, the highest: where every torque is held."""
    return (max(values) if key == "lowest_rpm" else float(np.mean(values))) if values else None


def moved(found: list[Found], before: list[Found]) -> list[str]:
    """The probes that are not what they were."""
    prints = {item.probe: item.print for item in before}
    return [item.probe.name for item in found if item.print != prints[item.probe]]


def angle_error(part: Any) -> np.ndarray:
    """Size of it, degrees."""
    return np.abs(wrapped_deg(part.column("fw.theta_est_deg").astype(np.float64) - part.column("plant.theta_e_deg")))


def nothing_moves(rows: list[dict[str, Any]]) -> list[str]:
    """Numbers with which no run is another, neither less nor more."""
    idle = [row["number"] for row in rows if row["verdict"] in (NOTHING, SAME)]
    return [number for number in dict.fromkeys(idle) if idle.count(number) == 2]


def edges(rows: list[dict[str, Any]]) -> list[str]:
    """Numbers with which something fails that does not as it stands."""
    return list(dict.fromkeys(row["number"] for row in rows if row["verdict"] in (EDGE, REFUSED[:-2])))


def build_all(variants: list[Variant], header: Path, defines: tuple[str, ...], quiet: bool) -> None:
    """Every variant's library, as many side by side as there are processors, each in a folder of its own that it keeps."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    count = min(workers.processors(), len(variants))
    with Progress("building", float(len(variants)), quiet, "firmware") as progress:
        told = workers.run_all([(number, variants[number::count], header, defines) for number in range(count)], _build, progress)
    for number, said in enumerate(told):
        for variant, text in zip(variants[number::count], said):
            variant.said = text
    own = program(variants[0].file)
    for variant in variants:
        if not variant.said and variant.row and program(variant.file) == own:
            variant.said = SAME
        if not variant.said:
            variant.library = Library(variant.file)


def _build(job: tuple[int, list[Variant], Path, tuple[str, ...]], tell: Any) -> list[str]:
    """Builds these in turn, and returns what is said of each that does not build."""
    number, variants, header, defines = job
    folder, said = FOLDER / f"header-{number}", []
    (folder / HEADER).parent.mkdir(parents=True)
    shutil.copy(header / build.HEADER, folder)
    text = TABLE.read_text(encoding="utf-8")
    for variant in variants:
        (folder / HEADER).write_text(with_value(text, variant.row, variant.value) if variant.row else text, encoding="utf-8")
        try:
            shutil.copy(build.library(list(defines), folder), variant.file)
            said.append("")
        except UserError as error:
            said.append(f"{REFUSED}{error}")
        tell(1.0)
    return said


def program(library: Path) -> int:
    """A number of a library's code and constants, which debug information and names do not change."""
    from elftools.elf.elffile import ELFFile
    with library.open("rb") as file:
        return zlib.crc32(b"".join(section.data() for section in ELFFile(file).iter_sections()
                                   if section["sh_type"] == "SHT_PROGBITS" and section["sh_flags"] & LOADED))
