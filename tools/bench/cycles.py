"""`make cycles`: what the interrupts of a period cost on the simulated core, by scenario, state and function, beside AN1292's figures.

    python3 -m tools.bench.cycles [--image build/target/foc33.elf] [scenario ...]

Exit status: 0, 1 when a budget is broken (a line for each), 2 when the image or the compiler is missing."""

import argparse
import ctypes
import functools
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import board_file, command_line, motor_file, paths
from tools.common.checksum import checksum
from tools.common.errors import UserError
from tools.image import attribution, program
from tools.image.budget import Budget
from tools.image.profile import INTERRUPT, SLOW, Counts, Profile, profile
from tools.image.size import told
from tools.image.wcet import RETURN

from . import build, command_common, pil, pil_command, scenario_file, simulate, sweep

FCY_MHZ = 40.0
PERIOD_CYCLES = 2000
"""of 50 us, AN1292's period and usually the header's"""
P1SECMP = 0x01C6    # the counter's value at the trigger; it counts down to zero from there, and the duties load
MOST_EXPENSIVE = 10
MISSED = 0.0001     # share of the cycles by which the profile may be off: other handlers call some of the interrupt's functions
PROFILE_HANDLERS = 2 # iss_profile_t: what runs in handlers
WITHOUT, WITH = "without field weakening", "with field weakening"
NOTE_US = {WITHOUT: (14.725, 20.8, 21.4), WITH: (14.975, 23.325, 23.65)}
MEANING = {WITHOUT: "bridge on, speed reference below FW_START_SPEED_RPM", WITH: "bridge on, speed reference above it"}
SIGNALS = ("cpu.isr_cycles", "cpu.slow_cycles", "cpu.latency_cycles")


class Spread(Counter):
    """How many interrupts took how many cycles."""

    @staticmethod
    def of(values: np.ndarray) -> "Spread":
        return Spread(values.astype(np.int64).tolist())

    @property
    def most(self) -> int:
        return max(self, default=0)

    @property
    def sum(self) -> int:
        return sum(cycles * number for cycles, number in self.items())

    @property
    def mean(self) -> float:
        return self.sum / max(self.total(), 1)

    def data(self) -> dict[str, Any]:
        return {"interrupts": self.total(), "min": min(self, default=0), "mean": self.mean, "max": self.most}


def added(spreads: Iterable[Spread]) -> Spread:
    """All of them together."""
    result = Spread()
    for spread in spreads:
        result.update(spread)
    return result


@dataclass
class Found:
    """What one scenario, or all of them, gave."""

    spreads: dict[str, Spread]               # of the control interrupt, by state, and WITHOUT and WITH
    periods: dict[str, Spread]               # of both interrupts of a period, likewise
    latency: Spread
    counts: Counts
    stack_bytes: int
    differences: int
    ticks: int
    first_difference: str
    longest: dict[str, tuple[int, float, str]] # scenario: most cycles of the control interrupt, when, in which state
    load_cycles: int = 0   # from the trigger to the moment when the duties load
    motor_s: float = 0.0
    cpu_s: float = 0.0
    instructions: float = 0.0
    period_cycles: int = PERIOD_CYCLES


def classes(state: np.ndarray, states: dict[int, str], reference_rpm: np.ndarray, fw_start_rpm: float) -> dict[str, np.ndarray]:
    """Which interrupts belong to each state, and which had field weakening in them."""
    numbers = {name: number for number, name in states.items()}
    on = (state >= numbers["ALIGN"]) & (state <= numbers["STOPPING"])
    weakening = on & (np.abs(reference_rpm) >= fw_start_rpm) & (state >= numbers["CLOSED"])
    return {**{name: state == number for number, name in states.items()}, WITHOUT: on & ~weakening, WITH: weakening}


def work(image: Path, job: simulate.Job, progress: Callable[[float], None]) -> Found:
    """One scenario on the image, counted by address and interrupt by interrupt; in a process of its own."""
    library = pil.PilLibrary(job.library)
    with simulate.using(pil.PilBoard(library, image), job) as board:
        core = _Core(board)
        session = simulate.Session(job, library, board, progress)
        session.run_to_end()
        counts = core.counts() # of what the trace shows, and no more
        run = session.run()
        trace = run.trace
        isr, state = trace.column("cpu.isr_cycles"), trace.column("fw.state").astype(int)
        period, known = isr + trace.column("cpu.slow_cycles"), isr > 0
        kinds = classes(state, run.states, trace.column("fw.speed_ref_rpm"), run.params["FW_START_SPEED_RPM"])
        spreads, periods = ({name: Spread.of(values[which & known]) for name, which in kinds.items()} for values in (isr, period))
        worst = int(np.argmax(isr))
        where = (int(isr[worst]), float(trace.time_s[worst]), run.states.get(int(state[worst]), "?"))
        latency = trace.column("cpu.latency_cycles")
        return Found(spreads, periods, Spread.of(latency[latency > 0]), counts, int(board.get("cpu.stack_bytes")),
                     int(board.get("pil.differences")),
                     int(board.get("pil.ticks")), board.difference(), {job.scenario.name: where}, board.peek(P1SECMP) & 0x7FFF,
                     run.motor_s, run.cpu_s, board.get("cpu.instructions"), period_cycles(run.params))


def merged(found: list[Found]) -> Found:
    """All scenarios together."""
    whole = found[0]
    for item in found[1:]:
        spreads, periods = ({name: added((one.get(name, Spread()), two.get(name, Spread()))) for name in {**one, **two}}
                            for one, two in ((whole.spreads, item.spreads), (whole.periods, item.periods)))
        whole = Found(spreads, periods, added([whole.latency, item.latency]), whole.counts + item.counts, max(whole.stack_bytes, item.stack_bytes),
                      whole.differences + item.differences, whole.ticks + item.ticks, whole.first_difference or item.first_difference,
                      whole.longest | item.longest, min(whole.load_cycles, item.load_cycles), whole.motor_s + item.motor_s,
                      whole.cpu_s + item.cpu_s, whole.instructions + item.instructions, whole.period_cycles)
    return whole


@dataclass
class Report:
    """Everything that is printed and written."""

    image: str
    found: Found
    profile: Profile
    budget: Budget | None
    assumptions: list[list[str]]
    broken: list[str] = field(default_factory=list)

    @property
    def all(self) -> Spread:
        """Every control interrupt: the states, which do not overlap."""
        return added(spread for name, spread in self.found.spreads.items() if name not in NOTE_US)

    @property
    def all_periods(self) -> Spread:
        """Every period: both interrupts."""
        return added(spread for name, spread in self.found.periods.items() if name not in NOTE_US)


class _Assumption(ctypes.Structure):
    _fields_ = [("id", ctypes.c_char_p), ("value", ctypes.c_int), ("meaning", ctypes.c_char_p), ("used_in", ctypes.c_char_p)]


def assumptions(library: pil.PilLibrary) -> list[list[str]]:
    """The simulator's table of what is assumed about the chip: name, value, meaning, where it is used."""
    rows, row = [], _Assumption()
    library.declare(("iss_assumption", ctypes.c_bool, [ctypes.c_size_t, ctypes.POINTER(_Assumption)]))
    while library.c.iss_assumption(len(rows), ctypes.byref(row)):
        rows.append([row.id.decode(), str(row.value), row.meaning.decode(), row.used_in.decode()])
    return rows


class _Core:
    """Counting by address in the core of a board."""

    WORDS = 0x2C00

    def __init__(self, board: pil.PilBoard) -> None:
        c = board.library.c
        board.library.declare(("vb_iss_core", ctypes.c_void_p, [ctypes.c_void_p]),
                              ("iss_profile", ctypes.c_bool, [ctypes.c_void_p, ctypes.c_int]),
                              ("iss_profile_counts", ctypes.POINTER(ctypes.c_uint32), [ctypes.c_void_p]),
                              ("iss_profile_cycles", ctypes.POINTER(ctypes.c_uint64), [ctypes.c_void_p]))
        self._c, self._core = c, c.vb_iss_core(board._vb) # pylint: disable=protected-access
        if not c.iss_profile(self._core, PROFILE_HANDLERS):
            raise UserError("no memory for the profile", "make cycles", "free some")

    def counts(self) -> Counts:
        executions, cycles = (np.ctypeslib.as_array(function(self._core), shape=(self.WORDS,)) for function in
                              (self._c.iss_profile_counts, self._c.iss_profile_cycles))
        used = np.flatnonzero(executions)
        return Counts({2 * int(i): int(executions[i]) for i in used}, {2 * int(i): int(cycles[i]) for i in used})


def broken(report: Report) -> list[str]:
    """A line for each limit that does not hold."""
    lines, found = [], report.found
    if found.differences:
        lines.append(f"target and PC differ in {found.differences} interrupts, the first: {found.first_difference}")
    if abs(report.profile.total - report.all_periods.sum) > MISSED * report.all_periods.sum:
        lines.append(f"the profile has {report.profile.total} cycles, the interrupts took {report.all_periods.sum}: "
                     "the figures by function are wrong")
    if not found.spreads[WITH] or not found.spreads[WITHOUT]:
        lines.append("no scenario ran with and without field weakening: the figures are not those of the table")
    if found.latency.most >= found.load_cycles:
        lines.append(f"trigger to duties: {found.latency.most} cycles, but the duties load {found.load_cycles} cycles after the trigger")
    if report.budget is None:
        return lines
    limits, stack = report.budget.cycles, report.budget.image.stack
    worst = max(found.longest.items(), key=lambda item: item[1][0])
    if report.all_periods.most > limits.period_max:
        lines.append(f"longest period: {report.all_periods.most} cycles of both interrupts, over the budget of {limits.period_max}")
    if report.all.most > limits.isr_max:
        lines.append(f"longest control interrupt: {report.all.most} cycles, {report.all.most - limits.isr_max} over the budget of {limits.isr_max} "
                     f"({worst[0]} at {worst[1][1]:.4f} s, {worst[1][2]})")
    for name in NOTE_US:
        if found.spreads[name].mean > limits.isr_mean:
            lines.append(f"mean control interrupt {name}: {found.spreads[name].mean:.1f} cycles, over the budget of {limits.isr_mean}")
        if found.periods[name].mean > limits.period_mean:
            lines.append(f"mean period {name}: {found.periods[name].mean:.1f} cycles of both interrupts, over the budget of {limits.period_mean}")
    if found.latency.most > limits.latency_max:
        lines.append(f"trigger to duties: {found.latency.most} cycles, over the budget of {limits.latency_max}")
    if found.stack_bytes > stack:
        lines.append(f"stack: {found.stack_bytes} bytes, over the budget of {stack}")
    return lines


# ---- output --------------------------------------------------------------------------------------------------------------
def period_cycles(params: Mapping[str, float]) -> int:
    """Cycles of a header's period."""
    return round(params["LOOPTIME_SEC"] * FCY_MHZ * 1e6)


def us(cycles: float) -> float:
    return cycles / FCY_MHZ


def _spread_line(name: str, spread: Spread, period: int, note: tuple[float, ...] | None = None) -> str:
    if not spread:
        return f"{name:<26}{'-':>10}"
    told = f"{name:<26}{spread.total():>10}{min(spread):>8}{spread.mean:>9.1f}{spread.most:>7}"
    told += f"{us(min(spread)):>10.2f}{us(spread.mean):>8.2f}{us(spread.most):>8.2f}{100.0 * spread.mean / period:>8.1f} %"
    return told + (f"   {note[0]:g} / {note[1]:g} / {note[2]:g}" if note else "")


def _spread_lines(spreads: dict[str, Spread], everything: Spread, period: int, notes: dict[str, tuple[float, ...]]) -> list[str]:
    """With and without field weakening, each state, all."""
    return [*(_spread_line(name, spreads[name], period, notes.get(name)) for name in NOTE_US),
            *(_spread_line(f"  {name}", spread, period) for name, spread in spreads.items() if name not in NOTE_US and spread), _spread_line("all", everything, period)]


def text(report: Report) -> str:
    """The whole report, as printed."""
    found, shape = report.found, report.profile
    head = (f"{'control interrupt':<26}{'number':>10}{'min':>8}{'mean':>9}{'max':>7}{'min us':>10}{'mean':>8}{'max':>8}{'load':>10}"
            "   AN1292's us")
    where: dict[str, list[str]] = {}
    for name, (cycles, at_s, state) in sorted(found.longest.items(), key=lambda item: -item[1][0]):
        where.setdefault(f"{cycles} in {state} at {at_s:.4f} s", []).append(name)
    parts = [f"{report.image}: the interrupts of a period in cycles (entry to return), at {FCY_MHZ:g} MIPS in us, and their share of the core",
             "\n".join([head, "-" * len(head), *_spread_lines(found.spreads, report.all, found.period_cycles, {})]),
             "\n".join([head.replace("control interrupt", "with its slow work", 1), "-" * len(head), *_spread_lines(found.periods, report.all_periods, found.period_cycles, NOTE_US)]),
             "\n".join(f"{name}: {meaning}" for name, meaning in MEANING.items()),
             "longest in each scenario:\n" + "\n".join(f"  {place}: {', '.join(names)}" for place, names in where.items())]
    latency, least = found.latency, min(found.latency, default=0)
    parts.append(f"trigger to the third duty   {least} / {latency.mean:.1f} / {latency.most} cycles (min / mean / max), "
                 f"{us(least):.2f} / {us(latency.mean):.2f} / {us(latency.most):.2f} us;\n"
                 f"                            the duties load {found.load_cycles} cycles after the trigger\n"
                 f"deepest stack               {found.stack_bytes} bytes\n"
                 f"target = PC                 {found.ticks} interrupts compared, {found.differences} differ\n"
                 f"speed                       {found.instructions / found.cpu_s / 1e6:.0f} million instructions a second "
                 f"of processor time, {found.motor_s / found.cpu_s:.2f} times real time (while counting by address)")
    interrupts = max(report.all.total(), 1)
    for title, table in (("function, wherever it is inlined", shape.inlined), ("function as linked", shape.symbols)):
        rows = [f"{name:<44}{cycles / interrupts:>10.1f}{100.0 * cycles / max(shape.total, 1):>8.1f} %"
                for name, cycles in table.most_common(MOST_EXPENSIVE)]
        parts.append("\n".join([f"{title:<44}{'cycles':>10}{'':>10}   (own cycles, mean of all periods)", *rows]))
    parts.append("\n".join([f"{'code of both interrupts that was executed':<44}{'words':>10}{'of':>6}",
                            *(f"{name:<44}{done:>10}{of:>6}"
                              for name, (done, of) in sorted(shape.executed.items(), key=lambda item: -item[1][1]))]))
    if report.assumptions:
        width = [max(len(row[column]) for row in report.assumptions) for column in (0, 1)]
        parts.append("\n".join(["assumed about the chip, for want of a source:",
                                *(f"  {row[0]:<{width[0]}}  {row[1]:>{width[1]}}  {row[2]}" for row in report.assumptions)]))
    return "\n\n".join(parts)


def summary(report: Report) -> dict[str, Any]:
    """The report as plain data."""
    found = report.found
    interrupts = max(report.all.total(), 1)
    return {"image": report.image, "fcy_mhz": FCY_MHZ, "note_us": NOTE_US,
            "spreads": {name: item.data() for name, item in found.spreads.items()},
            "periods": {name: item.data() for name, item in found.periods.items()},
            "all": report.all.data(), "all_periods": report.all_periods.data(), "latency": found.latency.data(), "stack_bytes": found.stack_bytes, "ticks": found.ticks,
            "differences": found.differences, "first_difference": found.first_difference,
            "longest": {name: {"cycles": cycles, "at_s": at_s, "state": state} for name, (cycles, at_s, state) in found.longest.items()},
            "load_cycles": found.load_cycles, "period_cycles": found.period_cycles, "instructions_per_second": found.instructions / found.cpu_s,
            "speed_factor": found.motor_s / found.cpu_s,
            "functions": {name: cycles / interrupts for name, cycles in report.profile.inlined.most_common()},
            "symbols": {name: cycles / interrupts for name, cycles in report.profile.symbols.most_common()},
            "executed": report.profile.executed, "assumptions": report.assumptions, "broken": report.broken}


def _spread_cells(data: dict[str, Any], values: dict[str, Any]) -> list[str]:
    cycles = f"{values['min']} / {values['mean']:.0f} / {values['max']}"
    return [cycles, " / ".join(f"{values[name] / data['fcy_mhz']:.2f}" for name in ("min", "mean", "max"))]


def readme_table(data: dict[str, Any], longest: dict[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of the README's table. @param data what cycles.json holds @param longest what wcet.json holds"""
    bound = {(item["handler"], item["to"]): (item["bound"], item["observed"]) for item in longest["bounds"]}

    def proven(name: str, pair: tuple[int, int | None], note: str = "") -> list[str]:
        most, seen = pair[0], pair[1] or 0
        return [f"{name}: proven / seen", note, f"{most} / {seen}", f"{us(most):.2f} / {us(seen):.2f}"]

    rows = [proven("longest control interrupt", bound[INTERRUPT, RETURN]),
            proven("longest slow work", bound[SLOW, RETURN]),
            proven(f"longest from the trigger to the third duty (loads after {data['load_cycles']})", (longest["latency"], data["latency"]["max"])),
            proven("longest period: both, proven with a fault's handler", (longest["period"], data["all_periods"]["max"]), f"{NOTE_US[WITH][2]:g}")]
    rows += [[f"control interrupt {name}: min / mean / max", "", *_spread_cells(data, data["spreads"][name])] for name in (WITHOUT, WITH)]
    rows += [[f"with its slow work, {name}: min / mean / max", " / ".join(f"{value:g}" for value in data["note_us"][name]),
              *_spread_cells(data, data["periods"][name])] for name in (WITHOUT, WITH)]
    load = 100.0 * data["periods"][WITH]["mean"] / PERIOD_CYCLES
    rows.append(["load of the core with field weakening", f"{100.0 * data['note_us'][WITH][1] / 50.0:.0f} %", f"{load:.0f} %", ""])
    rows.append(["deepest stack seen", "", f"{data['stack_bytes']} bytes", ""])
    return ["both interrupts of a period", "AN1292, us", "cycles", "us"], rows


def short_table(data: dict[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of another header's figures, with the bridge on."""
    on = {key: added_data([data[key][name] for name in NOTE_US]) for key in ("spreads", "periods")}
    return [f"of {data['period_cycles']} cycles a period", "min / mean / max", "us"], [
        ["control interrupt", *_spread_cells(data, on["spreads"])], ["with its slow work", *_spread_cells(data, on["periods"])],
        [f"trigger to the third duty (loads after {data['load_cycles']})", *_spread_cells(data, data["latency"])]]


def added_data(spreads: list[dict[str, Any]]) -> dict[str, Any]:
    """Several spreads of the file as one."""
    number = sum(item["interrupts"] for item in spreads)
    some = [item for item in spreads if item["interrupts"]]
    return {"interrupts": number, "min": min(item["min"] for item in some), "max": max(item["max"] for item in some),
            "mean": sum(item["mean"] * item["interrupts"] for item in some) / number}


# ---- command line --------------------------------------------------------------------------------------------------------
def jobs_of(names: tuple[str, ...], library: pil.PilLibrary, macros: Sequence[str] = ()) -> list[simulate.Job]:
    """The scenarios, recorded with the interrupt's cycles; all with the firmware as it is delivered, or with the application that `macros` names."""
    jobs = []
    for name in names:
        item = scenario_file.load(name)
        if others := [define for define in item.defines if define not in macros]:
            raise UserError(f"scenario '{item.name}' is for another image ({', '.join(others)})", "make cycles",
                            "measure scenarios of the firmware as it is delivered, or name their application, APP=name")
        motor = motor_file.part(item.motor, item.motor_where)
        job = simulate.prepare(item, library, motor, board_file.part(*board_file.named(motor, item.board, item.board_where)))
        job.signals += [signal for signal in SIGNALS if signal not in job.signals]
        jobs.append(job)
    return jobs


def measure(image: Path, userparams: Path | None, names: tuple[str, ...], budget: Budget, limits: bool, quiet: bool, macros: Sequence[str] = ()) -> Report:
    library = pil.library([*macros], userparams)
    if not pil.check_image(library, image):
        raise UserError("the image does not say where functions and variables are", str(image),
                        "name the ELF file that the HEX file was made from")
    elf = image.with_suffix(".elf") if image.suffix == ".hex" else image # a HEX file has its names from there
    code, source = program.read_elf(elf), attribution.read(elf)
    jobs = jobs_of(names or budget.cycles.scenarios, library, macros)
    found = merged(sweep.run_cases("cycles", jobs, quiet, functools.partial(work, image)))
    report = Report(str(paths.shown(image)), found, profile(code, source, found.counts, budget.counted_at), budget if limits else None,
                    assumptions(library))
    report.broken = broken(report)
    return report


def parser_of(name: str, about: str, command: Callable[[argparse.Namespace], int]) -> argparse.ArgumentParser:
    """Options of a command that runs scenarios on the image. @param name of the module here and of the file that it writes"""
    parser = command_line.Parser(prog=f"python3 -m tools.bench.{name}", description=about)
    parser.add_argument("scenarios", nargs="*", help="default: those of [cycles] in firmware/budget.toml")
    parser.add_argument("--app", default="", help="the application: a name of firmware/app, or a file; default: the panel, and with another one its own scenario")
    parser.add_argument("--image", type=Path, help="ELF file with debugging information; default: built with XC16")
    parser.add_argument("--userparams", metavar="FOLDER", help="build with the userparams.h in this folder")
    parser.add_argument("--out", type=Path, help=f"folder for {name}.json; default: the image's")
    parser.add_argument("--no-budget", action="store_true", help="another mode or optimisation than the budget is for")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(command=command)
    return parser


def macros_of(options: argparse.Namespace) -> list[str]:
    """Of the build: the application, if there is another than the panel."""
    return [build.app(options.app, "APP")] if options.app and options.app != "panel" else []


def scenarios_of(options: argparse.Namespace) -> tuple[str, ...]:
    """Those that were named, else the application's own; none: those of the budget."""
    return tuple(options.scenarios) or ((command_common.usual(options.app),) if macros_of(options) else ())


def sources_of(options: argparse.Namespace) -> dict[str, str]:
    """Which firmware the result is of, where it is the delivered one's and complete: `make readme` need not measure it again."""
    return {} if options.no_budget or options.app or options.scenarios or options.image else {"sources": checksum("chip")}


def main(arguments: list[str] | None = None) -> int:
    return command_line.main(lambda: parser_of("cycles", __doc__.splitlines()[0], _run), arguments)


def _run(options: argparse.Namespace) -> int:
    budget = Budget.read()
    userparams = None if options.userparams is None else build.header_folder(options.userparams)
    macros = macros_of(options)
    image = pil_command.image_for(macros, userparams, options.image)
    report = measure(image, userparams, scenarios_of(options), budget, not options.no_budget and not macros, options.quiet, macros)
    return told(summary(report) | sources_of(options), options.out or image.parent, "cycles", text(report) + "\n")


if __name__ == "__main__":
    sys.exit(main())
