"""Cycles of the control interrupt and of its slow work by function, as linked and as written.

The counts are those of handlers alone: the background executes some of the interrupt's functions. What other handlers execute of them is
counted with it, too; that is little."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from .attribution import Image, Word
from .linked import branch_target
from .program import Elf
from .stack import plain

INTERRUPT, SLOW = "_ADC1Interrupt", "_T2Interrupt" # the slow work of a period is raised by the first


@dataclass(frozen=True)
class Counts:
    """What the core counted in handlers, by address of the instruction; entering an interrupt counts with its first one."""

    executions: dict[int, int]
    cycles: dict[int, int]

    def __add__(self, other: "Counts") -> "Counts":
        return Counts(dict(Counter(self.executions) + Counter(other.executions)), dict(Counter(self.cycles) + Counter(other.cycles)))


@dataclass
class Profile:
    """Cycles of all interrupts together."""

    inlined: Counter = field(default_factory=Counter)   # by function as it is written
    symbols: Counter = field(default_factory=Counter)   # by function as it is linked, with what is inlined into it
    executed: dict[str, tuple[int, int]] = field(default_factory=dict) # words of a linked function: executed at least once, all
    total: int = 0


def reachable(elf: Elf, image: Image, starts: tuple[str, ...] = (INTERRUPT, SLOW)) -> set[int]:
    """First addresses of the linked functions that the two interrupts can come to."""
    first = {word.address: word.copy[0] for word in image.words}
    leaving: dict[int, set[int]] = {}
    for place, function in first.items():
        target = branch_target(elf.words, place)
        if target in first:
            leaving.setdefault(function, set()).add(first[target])
    todo = [address for address, name in elf.functions if name in starts]
    found: set[int] = set()
    while todo:
        function = todo.pop()
        if function not in found:
            found.add(function)
            todo += leaving.get(function, ())
    return found


def profile(elf: Elf, image: Image, counts: Counts, counted_at: Callable[[Word], int] = lambda word: len(word.chain) - 1) -> Profile:
    """The counts by function.
    @param counted_at place in a word's chain of the function that it counts with (budget.Budget.counted_at)"""
    words = {word.address: word for word in image.words}
    inside = reachable(elf, image)
    result = Profile()
    for address, cycles in counts.cycles.items():
        if not cycles or address not in words or words[address].copy[0] not in inside:
            continue
        names = [plain(f"_{frame.name}") for frame in words[address].chain]
        result.inlined[names[counted_at(words[address])]] += cycles
        result.symbols[names[0]] += cycles
        result.total += cycles
    code = {place for start, end in elf.code for place in range(start, end, 2)}
    for address, word in words.items():
        if word.copy[0] in inside and address in code and not _second_word(elf, address):
            name = plain(f"_{word.chain[0].name}")
            done, of = result.executed.get(name, (0, 0))
            result.executed[name] = done + (1 if counts.executions.get(address) else 0), of + 1
    return result


def _second_word(elf: Elf, address: int) -> bool:
    """The second word of CALL, GOTO and DO: it starts with a zero byte, and what is before it with one of theirs."""
    return elf.words.get(address, 0) >> 16 == 0 and elf.words.get(address - 2, 0) >> 16 in (0x02, 0x04, 0x08)
