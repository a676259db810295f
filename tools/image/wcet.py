"""The longest path of every interrupt from the linked image, with what is stated about it beside the code.

A statement is a comment in firmware/ or include/ that begins with "wcet:". Parts are functions as they are written, wherever they are inlined;
a/b is what b does inside a.

    at most 15 turns        in a line of a loop: how often its head is executed whenever the loop is entered
    a excludes b c          no interrupt executes instructions of part a and of part b, or of a and c
    a is never reached      no interrupt executes an instruction of part a

`make wcet` holds each against what the simulator executes. What is stated must be true for another reason: no run proves it."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from tools.common import paths
from tools.common.errors import UserError

from . import attribution, device
from .budget import CycleLimits
from .facts import Decoder, Op
from .flow_graph import Core, Graph, build
from .longest import Path as Longest
from .longest import Parts, Paths
from .program import Elf, read_elf, reading
from .profile import INTERRUPT, SLOW
from .stack import plain

ROOMS = ("firmware", "include")
BACKGROUND = "_main"
RETURN, THIRD_DUTY = "return", "third duty"
P1DC3 = 0x01DA
MOST_PARTS = 64
_COMMENT = re.compile(r"/\*+ wcet: (.*?) \*/")
_TURNS = re.compile(r"at most (\d+) turns?$")
_EXCLUDES = re.compile(r"(\S+) excludes (\S.*)$")
_NEVER = re.compile(r"(\S+) is never reached$")
REMEDY = "write 'at most N turns', 'a excludes b' or 'a is never reached'"


@dataclass(frozen=True)
class Statement:
    """What is stated in a line. Two times the same part: it is never reached."""
    where: tuple[str, int]
    turns: int = 0
    part: str = ""
    others: tuple[str, ...] = ()

    def __str__(self) -> str:
        what = f"{self.part} excludes {' '.join(self.others)}" if self.others != (self.part,) else f"{self.part} is never reached"
        return f"{f'at most {self.turns} turns' if self.turns else what} ({self.where[0]}:{self.where[1]})"


def read_statements(root: Path = paths.ROOT) -> list[Statement]:
    """All of the sources."""
    result = []
    for path in sorted(path for room in ROOMS for path in (root / room).rglob("*.[ch]")):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            result += [_statement(text, (str(path.relative_to(root)), number)) for text in _COMMENT.findall(line)]
    return result


def _statement(text: str, where: tuple[str, int]) -> Statement:
    if found := _TURNS.match(text):
        return Statement(where, turns=int(found[1]))
    if found := _EXCLUDES.match(text):
        return Statement(where, part=found[1], others=tuple(found[2].split()))
    if found := _NEVER.match(text):
        return Statement(where, part=found[1], others=(found[1],))
    raise UserError(f"no statement about the longest path: '{text}'", f"{where[0]}:{where[1]}", REMEDY)


@dataclass(frozen=True)
class Place:
    """Where an instruction comes from."""
    names: tuple[str, ...]      # functions as written, from the linked one to the innermost
    file: str = "?"
    line: int = 0


@dataclass
class Bound:
    """The longest path of a handler."""
    handler: str
    to: str                 # RETURN, or what it is the path to
    path: Longest
    free: int               # cycles of the longest path where nothing excludes anything

    @property
    def cycles(self) -> int:
        return self.path.cycles


@dataclass
class Program:
    """An image as the longest path needs it."""
    elf: Elf
    places: dict[int, Place]
    statements: list[Statement]
    decoder: Decoder
    handlers: dict[str, int] = field(default_factory=dict)      # name: address

    @staticmethod
    def read(path: Path, statements: list[Statement], decoder: Decoder) -> "Program":
        elf = read_elf(path)
        image = attribution.read(path)
        with reading("ELF", path):
            lines = attribution.lines(elf)
        places = {word.address: Place(tuple(plain(f"_{frame.name}") for frame in word.chain), *lines.get(word.address, ("?", 0)))
                  for word in image.words}
        names = {plain(name): address for name, address in elf.symbols.items() if address in image.handlers}
        return Program(elf, places, statements, decoder, {name: names[name] for name in names if name in (*device.VECTORS, device.DEFAULT_VECTOR)})

    @cached_property
    def part_names(self) -> list[str]:
        return sorted({name for item in self.statements if item.part for name in (item.part, *item.others)})

    @cached_property
    def parts(self) -> dict[str, set[int]]:
        """Addresses of every part that is named."""
        found: dict[str, set[int]] = {}
        for name in self.part_names:
            wanted = name.split("/")
            found[name] = {address for address, place in self.places.items() if _within(wanted, place.names)}
        return found

    @cached_property
    def excluding(self) -> Parts:
        """The parts as bits, and what excludes what."""
        if len(self.part_names) > MOST_PARTS:
            raise UserError(f"{len(self.part_names)} parts in the statements about the longest path", "", f"{MOST_PARTS} are possible")
        bit = {name: 1 << number for number, name in enumerate(self.part_names)}
        of: dict[int, int] = {}
        for name, addresses in self.parts.items():
            for address in addresses:
                of[address] = of.get(address, 0) | bit[name]
        return Parts(of, tuple(bit[item.part] | bit[other] for item, other in self.pairs))

    @property
    def pairs(self) -> list[tuple[Statement, str]]:
        """Each part that is stated to exclude another, and that."""
        return [(item, other) for item in self.statements for other in item.others]

    def unknown_parts(self) -> list[str]:
        """A line for each part that is nowhere in the image."""
        return [f"{item}: no {name} in the image: correct the name or take the statement out"
                for item in self.statements if item.part for name in dict.fromkeys((item.part, *item.others)) if not self.parts[name]]

    def name(self, address: int) -> str:
        """An address for a reader."""
        place = self.places.get(address)
        return f"0x{address:x}" if place is None else f"{place.names[-1]}(), {place.file}:{place.line}"

    def turns(self, addresses: Iterable[int]) -> int | None:
        """What is stated of the loop that has these addresses."""
        lines = {(self.places[address].file, self.places[address].line) for address in addresses if address in self.places}
        return max((item.turns for item in self.statements if item.turns and item.where in lines), default=None)

    def longest_instruction(self) -> int:
        """Of the background, in cycles: an interrupt waits for its end, and for nothing else."""
        graph = build(self._op, self._core, self.elf.symbols[BACKGROUND], self.name)
        for op in graph.ops.values():
            if op.text.startswith("disi"):
                raise UserError(f"the background holds interrupts up at 0x{op.address:x} ({op.text})", self.name(op.address),
                                "leave DISI out, or the deadline cannot be proven")
        return graph.single

    def bounds(self, handler: str) -> list[Bound]:
        """To the return, and in the control interrupt to the third duty."""
        return self.bounds_of(self.ways(handler), handler)

    def ways(self, handler: str) -> Paths:
        return Paths(build(self._op, self._core, self.handlers[handler], self.name), self.turns, self.name)

    def bounds_of(self, ways: Paths, handler: str) -> list[Bound]:
        targets = {RETURN: None}
        if handler == INTERRUPT:
            duties = third_duty(ways.graph)
            targets = {THIRD_DUTY: lambda node: node.address in duties, RETURN: None}
        return [Bound(handler, to, ways.longest(self.excluding, which), ways.longest(to=which).cycles) for to, which in targets.items()]

    def _op(self, address: int) -> Op | None:
        return self.decoder.op(self.elf.words, address)

    @property
    def _core(self) -> Core:
        return Core.of(self.decoder.assumed)


def third_duty(graph: Graph) -> set[int]:
    """Addresses of the instructions that write it."""
    return {address for address, op in graph.ops.items() if op.data == P1DC3}


def _within(wanted: list[str], names: tuple[str, ...]) -> bool:
    """Whether the wanted names are among these in their order."""
    left = iter(names)
    return all(name in left for name in wanted)


def by_line(program: Program, bound: Bound) -> list[str]:
    """The path by source line: cycles to its end, cycles of the line, where, in which function."""
    lines, last, began = [], None, 0
    for node, cycles in bound.path.nodes:
        place = program.places.get(node.address, Place(("?",)))
        here = (place.file, place.line, place.names[-1], node.calls)
        if here == last:
            lines[-1] = _line(place, cycles, cycles - began, lines[-1])
        else:
            began = lines and int(lines[-1].split()[0]) or 0
            lines.append(_line(place, cycles, cycles - began))
        if loop := bound.path.loops.get(node):
            lines[-1] += f"; a loop, {loop.turns} turns of {loop.cycles} cycles"
        last = here
    return lines


def _line(place: Place, cycles: int, own: int, before: str = "") -> str:
    note = before.partition(";")[1:]
    return f"{cycles:>6}{own:>6}  {place.file}:{place.line} {place.names[-1]}()" + "".join(note)


def handlers_of(program: Program) -> list[str]:
    """The control interrupt first, then its slow work, interrupts, traps."""
    first = [INTERRUPT, SLOW]
    order = [*first, *(name for name in device.VECTORS if name not in first), "_" + device.DEFAULT_VECTOR.removeprefix("_")]
    return sorted(program.handlers, key=lambda name: (order.index(name) if name in order else len(order), name))


def over(bounds: list[Bound], limits: CycleLimits, delivered: bool = True) -> list[str]:
    """A line for each bound of a period's interrupts that is above its limit.
    @param delivered the limits are for this image; another one has the deadlines only"""
    most = {(INTERRUPT, THIRD_DUTY): limits.duty_bound, (INTERRUPT, RETURN): limits.isr_bound, (SLOW, RETURN): limits.slow_bound}
    if not delivered:
        most = {(INTERRUPT, THIRD_DUTY): limits.duty_deadline}
    lines = [f"longest path of {bound.handler} to {_the(bound.to)}: {bound.cycles} cycles, {bound.cycles - limit} over the budget of {limit}; make wcet shows it"
             for bound in bounds if (limit := most.get((bound.handler, bound.to), bound.cycles)) < bound.cycles]
    both = sum(bound.cycles for bound in bounds if bound.to == RETURN and bound.handler in (INTERRUPT, SLOW))
    if both > limits.both_deadline:
        lines.append(f"longest paths of {INTERRUPT} and {SLOW} together: {both} cycles, {both - limits.both_deadline} more than a period leaves; make wcet shows them")
    return lines


def _the(to: str) -> str:
    return f"its {to}" if to == RETURN else f"the {to}"


def check(elf: Path, limits: CycleLimits, delivered: bool = True) -> tuple[list[Bound], list[str]]:
    """Bounds of a period's interrupts, and what is wrong with them or with what is stated."""
    image = Program.read(elf, read_statements(), Decoder())
    bounds = image.bounds(INTERRUPT) + image.bounds(SLOW)
    return bounds, [*image.unknown_parts(), *over(bounds, limits, delivered)]
