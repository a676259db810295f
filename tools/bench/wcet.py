"""`make wcet`: the longest path of every interrupt, from the image itself, beside the longest that ran.

    python3 -m tools.bench.wcet [--image build/target/foc33.elf] [scenario ...]

The scenarios run in the simulator, with every interrupt held against what is stated about the longest path (tools/image/wcet.py).
Exit status: 0, 1 when a statement, a bound or a budget does not hold (a line for each), 2 when the image or the compiler is missing."""

import argparse
import ctypes
import functools
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.common import command_line, paths
from tools.common.errors import UserError
from tools.image import device
from tools.image.budget import Budget
from tools.image.facts import Decoder
from tools.image.size import told
from tools.image.profile import INTERRUPT, SLOW
from tools.image.wcet import MOST_PARTS, RETURN, THIRD_DUTY, Bound, Program, by_line, handlers_of, over, read_statements

from . import build, cycles, pil, pil_command, simulate, sweep

ADC1_VECTOR, SLOW_VECTOR = device.VECTORS.index(INTERRUPT), device.VECTORS.index(SLOW)


@dataclass(frozen=True)
class Watch:
    """What the simulator looks for in each interrupt of a period."""
    parts: tuple[tuple[int, ...], ...]      # addresses of each
    sets: tuple[int, ...]                   # parts as bits, of which no interrupt has all


@dataclass
class Seen:
    """What the interrupts of one scenario, or of all, were like at most."""
    runs: int
    longest: list[int]      # cycles of each vector's handler, without others in between
    times: list[int]        # of each part: executions in one interrupt
    latest: list[int]       # of each part: cycles from entry to its end
    whole: list[int]        # of each set: interrupts that had all of it
    entry: tuple[int, int]  # cycles from the trigger to the entry, least and most
    load_cycles: int        # from the trigger to the moment when the duties load
    scenarios: int = 1

    def __add__(self, other: "Seen") -> "Seen":
        def most(one: list[int], two: list[int]) -> list[int]:
            return [max(pair) for pair in zip(one, two)]
        return Seen(self.runs + other.runs, most(self.longest, other.longest), most(self.times, other.times), most(self.latest, other.latest),
                    [sum(pair) for pair in zip(self.whole, other.whole)],
                    (min(self.entry[0], other.entry[0]), max(self.entry[1], other.entry[1])), min(self.load_cycles, other.load_cycles),
                    self.scenarios + other.scenarios)


class _Watched(ctypes.Structure):
    """iss_watched_t of tools/cpu_33f/iss.h."""
    _fields_ = [("runs", ctypes.c_uint64), ("longest", ctypes.c_uint32 * 126), ("times", ctypes.c_uint32 * 64), ("latest", ctypes.c_uint32 * 64),
                ("whole", ctypes.c_uint64 * 128)]


class _Core(cycles._Core): # pylint: disable=protected-access
    """Watching both interrupts of a period in the core of a board."""

    def __init__(self, board: pil.PilBoard, watch: Watch) -> None:
        super().__init__(board)
        core, number = ctypes.c_void_p, ctypes.c_uint
        board.library.declare(("iss_watch", ctypes.c_bool, [core, number]), ("iss_watch_also", None, [core, number]),
                              ("iss_watch_part", None, [core, ctypes.c_uint32, number]),
                              ("iss_watch_set", ctypes.c_bool, [core, ctypes.c_uint64]), ("iss_watched", ctypes.POINTER(_Watched), [core]))
        held = self._c.iss_watch(self._core, ADC1_VECTOR) and all(self._c.iss_watch_set(self._core, parts) for parts in watch.sets)
        if not held:
            raise UserError(f"{len(watch.sets)} exclusions are stated", "make wcet", f"the simulator has room for {len(_Watched().whole)}")
        self._c.iss_watch_also(self._core, SLOW_VECTOR)
        for part, addresses in enumerate(watch.parts):
            for address in addresses:
                self._c.iss_watch_part(self._core, address, part)
        self._parts, self._sets = len(watch.parts), len(watch.sets)

    def seen(self, board: pil.PilBoard) -> Seen:
        found = self._c.iss_watched(self._core)[0]
        return Seen(found.runs, list(found.longest), list(found.times)[:self._parts], list(found.latest)[:self._parts],
                    list(found.whole)[:self._sets], (int(board.get("cpu.entry_cycles_min")), int(board.get("cpu.entry_cycles_max"))),
                    board.peek(cycles.P1SECMP) & 0x7FFF)


def work(image: Path, watch: Watch, job: simulate.Job, progress: Callable[[float], None]) -> Seen:
    """One scenario on the image; in a process of its own."""
    library = pil.PilLibrary(job.library)
    with simulate.using(pil.PilBoard(library, image), job) as board:
        core = _Core(board, watch)
        simulate.Session(job, library, board, progress).run_to_end()
        return core.seen(board)


@dataclass
class Report:
    """Everything that is printed and written."""
    image: str
    program: Program
    bounds: list[Bound]
    instruction: int                # cycles of the background's longest
    loops: list[tuple[int, int]]    # of a period's interrupts: address of the head, executions in one interrupt at most
    seen: Seen | None = None
    broken: list[str] = field(default_factory=list)
    period_cycles: int = cycles.PERIOD_CYCLES
    """of the header that the image was made with"""

    @property
    def watch(self) -> Watch:
        """The parts that are stated, then the third duty, then the heads of loops."""
        image = self.program
        bit = {name: 1 << number for number, name in enumerate(image.part_names)}
        parts = [tuple(sorted(image.parts[name])) for name in image.part_names]
        parts += [tuple(self.duties), *((head,) for head, _ in self.loops)]
        if len(parts) > MOST_PARTS:
            raise UserError(f"{len(parts)} parts and loops in the statements about the longest path", "make wcet", f"{MOST_PARTS} are possible")
        return Watch(tuple(parts), tuple(bit[item.part] | bit[other] for item, other in image.pairs))

    @property
    def unseen(self) -> list[str]:
        """Stated parts that no interrupt has executed: there the runs have held nothing against the statement."""
        return [] if self.seen is None else [name for name, times in zip(self.program.part_names, self.seen.times) if not times]

    @property
    def duties(self) -> list[int]:
        return sorted({bound.path.nodes[-1][0].address for bound in self.bounds if bound.to == THIRD_DUTY})

    def observed(self, bound: Bound) -> int | None:
        """The most that ran; None: it never did."""
        if self.seen is None:
            return None
        vector = device.VECTORS.index(bound.handler) if bound.handler in device.VECTORS else None
        if bound.to == THIRD_DUTY:
            found = self.seen.latest[len(self.program.part_names)]
        else:
            found = 0 if vector is None else self.seen.longest[vector]
        return found or None

    @property
    def others(self) -> int:
        """Cycles of the longest handler that can come before: the fault's, whose bridge is off, so that a late duty does no harm."""
        return max((bound.cycles for bound in self.bounds if bound.handler not in (INTERRUPT, SLOW)), default=0)

    @property
    def period(self) -> int:
        """Cycles of both interrupts of a period and of a fault's handler, at most."""
        return sum(bound.cycles for bound in self.bounds if bound.to == RETURN and bound.handler in (INTERRUPT, SLOW)) + self.others

    @property
    def latency(self) -> int:
        """Cycles from the trigger to the third duty at most: samples, the instruction that the interrupt waits for, the longest path."""
        duty = next(bound.cycles for bound in self.bounds if bound.to == THIRD_DUTY)
        return (self.seen.entry[0] if self.seen else 0) + self.instruction - 1 + duty


def of_image(image: Path) -> Report:
    """The bounds of an image, before anything has run."""
    program = Program.read(image, read_statements(), Decoder())
    bounds: list[Bound] = []
    loops: list[Any] = []
    for handler in handlers_of(program):
        ways = program.ways(handler)
        bounds += program.bounds_of(ways, handler)
        loops += ways.loops.values() if handler in (INTERRUPT, SLOW) else []
    return Report(str(paths.shown(image)), program, bounds, program.longest_instruction(), executions(loops))


def executions(loops: Any) -> list[tuple[int, int]]:
    """How often the head of each loop is executed in one interrupt at most: a function stands in the graph once for each call."""
    found: dict[int, int] = {}
    for loop in loops:
        found[loop.head.address] = found.get(loop.head.address, 0) + loop.executions
    return sorted(found.items())


def broken(report: Report, budget: Budget | None) -> list[str]:
    """A line for everything that does not hold."""
    seen, image = report.seen, report.program
    lines = [] if budget is None else [*image.unknown_parts(), *over(report.bounds, budget.cycles)]
    if seen is None:
        return lines
    lines += [f"{item}: not true of {number} interrupts that ran, which had {item.part if item.part == other else f'{item.part} and {other}'}: the bound counts for nothing"
              for (item, other), number in zip(image.pairs, seen.whole) if number]
    first = len(image.part_names) + 1
    lines += [f"{image.name(head)}: a loop turned {turns} times in one interrupt, but what is stated makes {most} at most"
              for (head, most), turns in zip(report.loops, seen.times[first:]) if turns > most]
    for bound in report.bounds:
        ran = report.observed(bound)
        if ran is not None and ran > bound.cycles:
            lines.append(f"{bound.handler} to its {bound.to} ran {ran} cycles, its longest path has {bound.cycles}: the graph is not the program's")
    if not any(report.observed(bound) for bound in report.bounds if bound.to == THIRD_DUTY):
        lines.append("the control interrupt never ran")
    elif report.latency >= seen.load_cycles:
        lines.append(f"the deadline is not proven: up to {report.latency} cycles from the trigger to the third duty, but the duties load after "
                     f"{seen.load_cycles}")
    if report.period >= report.period_cycles:
        lines.append(f"the slow work is not proven to end in its period: up to {report.period} cycles with the control interrupt and a fault's handler, the "
                     f"period has {report.period_cycles}")
    if seen.entry[1] - seen.entry[0] > report.instruction - 1 + report.others:
        lines.append(f"an interrupt waited {seen.entry[1] - seen.entry[0]} cycles for its entry, longer than any instruction and handler takes")
    return lines


# ---- output --------------------------------------------------------------------------------------------------------------
def text(report: Report) -> str:
    """The whole report, as printed."""
    head = f"{'handler, from its entry':<28}{'to':<14}{'bound':>7}{'observed':>10}{'with nothing excluded':>24}"
    rows = [f"{bound.handler:<28}{bound.to:<14}{bound.cycles:>7}{report.observed(bound) or '-':>10}{bound.free:>24}" for bound in report.bounds]
    parts = [f"{report.image}: the longest path of every interrupt in cycles, without others in between, and the longest that ran",
             "\n".join([head, "-" * len(head), *rows])]
    if report.seen is not None:
        parts.append(deadline(report, report.seen))
    parts += ["\n".join([f"{bound.handler} to its {bound.to}: {bound.cycles} cycles", f"{'cycles':>6}{'line':>6}", *by_line(report.program, bound)])
              for bound in report.bounds if bound.handler in (INTERRUPT, SLOW)]
    stated = "\n".join(f"  {item}" for item in report.program.statements)
    parts.append(f"stated, and true of all that ran:\n{stated}" if not report.broken else f"stated:\n{stated}")
    if report.unseen:
        parts.append(f"ran in no scenario, so that no run has tried what is stated of it: {', '.join(report.unseen)}")
    return "\n\n".join(parts)


def deadline(report: Report, seen: Seen) -> str:
    """Why the duties are in time."""
    waited = report.instruction - 1
    duty = report.latency - seen.entry[0] - waited
    fault = " where a fault's handler came first: the bridge is off then" if seen.entry[1] - seen.entry[0] > waited else ""
    return (f"trigger to the third duty: {report.latency} cycles at most, the duties load after {seen.load_cycles}\n"
            f"  {seen.entry[0]} until the samples are there, {waited} until the background's instruction ends "
            f"(seen: {seen.entry[1] - seen.entry[0]}{fault}), {duty} in the interrupt\n"
            f"both interrupts of a period and a fault's handler: {report.period} cycles at most, the period has {report.period_cycles}\n"
            f"{seen.runs} interrupts ran in {seen.scenarios} scenarios")


def summary(report: Report) -> dict[str, Any]:
    """The report as plain data."""
    data: dict[str, Any] = {"image": report.image, "instruction": report.instruction, "broken": report.broken,
            "bounds": [{"handler": bound.handler, "to": bound.to, "bound": bound.cycles, "observed": report.observed(bound), "free": bound.free}
                       for bound in report.bounds], "statements": [str(item) for item in report.program.statements]}
    if report.seen is not None:
        data |= {"unseen": report.unseen, "latency": report.latency, "period": report.period, "load_cycles": report.seen.load_cycles,
                 "interrupts": report.seen.runs}
    return data


# ---- command line --------------------------------------------------------------------------------------------------------
def measure(image: Path, userparams: Path | None, names: tuple[str, ...], budget: Budget, limits: bool, quiet: bool, macros: Sequence[str] = ()) -> Report:
    library = pil.library([*macros], userparams)
    if not pil.check_image(library, image):
        raise UserError("the image does not say where functions and variables are", str(image), "name the ELF file that the HEX file was made from")
    report = of_image(image.with_suffix(".elf") if image.suffix == ".hex" else image)
    report.period_cycles = cycles.period_cycles(library.params)
    jobs = cycles.jobs_of(names or budget.cycles.scenarios, library, macros)
    found = sweep.run_cases("wcet", jobs, quiet, functools.partial(work, image, report.watch))
    report.seen = functools.reduce(lambda one, two: one + two, found)
    report.broken = broken(report, budget if limits else None)
    return report


def main(arguments: list[str] | None = None) -> int:
    return command_line.main(lambda: cycles.parser_of("wcet", __doc__.splitlines()[0], _run), arguments)


def _run(options: argparse.Namespace) -> int:
    userparams = None if options.userparams is None else build.header_folder(options.userparams)
    macros = cycles.macros_of(options)
    image = pil_command.image_for(macros, userparams, options.image)
    report = measure(image, userparams, cycles.scenarios_of(options), Budget.read(), not options.no_budget and not macros, options.quiet, macros)
    return told(summary(report) | cycles.sources_of(options), options.out or image.parent, "wcet", text(report) + "\n")


if __name__ == "__main__":
    sys.exit(main())
