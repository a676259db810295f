"""The longest path of a program's graph: where every path can be run it is what the simulator takes at most; what cannot be followed is refused."""

import ctypes
import random
import re

import pytest

import asm33
from machine import LIBRARY, PROGRAM, Machine
from test_interrupts import AD1, IEC0, IFS0, IPC0, Chip

from tools.bench.wcet import _Watched
from tools.common.errors import UserError
from tools.image import pointers
from tools.image.facts import Decoder, Op
from tools.image.flow_graph import Core, build
from tools.image.longest import Parts, Paths

CALLER = "call start\nhome: bra home\nstart: "
CALL_CYCLES = 2
DECODER = Decoder(LIBRARY)
CORE = Core.of(DECODER.assumed)


def paths(text: str, turns: int | None = None) -> tuple[Paths, dict[str, int]]:
    """The graph from the label start on, and all labels."""
    words, labels = asm33.assemble(CALLER + text, PROGRAM)
    graph = build(lambda address: DECODER.op(words, address), CORE, labels["start"])
    return Paths(graph, lambda _: turns), labels


def bound(text: str, turns: int | None = None, parts: Parts = Parts()) -> int:
    """Cycles of the longest path to the return, without an interrupt's entry."""
    return paths(text, turns)[0].longest(parts).cycles - CORE.entry


def measured(machine: Machine, text: str, values: range) -> int:
    """Most cycles from start to the return, with any of these values in W0."""
    words, labels = asm33.assemble(CALLER + text, PROGRAM)
    machine.load(words)
    return max(_run(machine, value, labels["home"]) for value in values) - CALL_CYCLES


def _run(machine: Machine, w0: int, home: int) -> int:
    library, core = machine.library, machine.core
    w = [w0, 0x900, 0x902, 0x904, 5, 6, 7, 8, 0x910, 0x920, 2, 4, 0, 0, 0, 0xE02]
    machine.set_state(w, 0, [0, 0], {0x20: 0x0F00, 0x44: 4, 0x34: 0}, bytes(0x800), PROGRAM)
    while library.iss_pc(core) != home:
        assert machine.run(library.iss_cycles(core) + 1) == ""
    return library.iss_cycles(core)


# Every path of these runs with some W0 below 16.
PROGRAMS = {
    "nothing": "return",
    "a stall and double words": "mov #0x900,w1; mov [w1],w2; mov.d w2,w6; mov.d [w1],w8; return",
    "a branch that is taken or not": "cp w0,#3; bra z,other; nop; nop; other: return",
    "a branch forth and back": "btst.z w0,#0; bra z,far; back: return; far: nop; bra back",
    "a skip of one word": "btsc w0,#0; mov #3,w5; nop; return",
    "a skip of two words": "btss w0,#0; call leaf; nop; return; leaf: return",
    "a skip of a stall": "mov #0x900,w1; btsc w0,#1; mov [w1],w2; mov [w1],w3; return",
    "a comparison that skips": "mov #5,w2; cpseq w0,w2; bra on; nop; nop; on: return",
    "a stall only behind a branch that is not taken": "btst.z w0,#2; mov #0x900,w1; bra nz,on; mov #0x902,w1; on: mov [w1],w2; return",
    "a division": "mov #9,w2; repeat #17; div.u w0,w2; return",
    "a repeated move with its stalls": "mov #0x900,w1; mov #0x980,w2; repeat #4; mov [w1++],[w2++]; return",
    "a repeated sum": "repeat #6; add w4,w5,w6; return",
    "two calls of a function": "btsc w0,#0; rcall leaf; call leaf; rcall leaf; return; leaf: btsc w0,#1; mov.d w2,w4; return",
    "calls in calls": "rcall one; return; one: call two; rcall two; return; two: btst.z w0,#3; bra nz,on; nop; on: return",
    "a word through the window": "mov #0x8200,w1; mov [w1],w2; mov #0x900,w1; mov [w1],w2; mov 0x8202,w3; return",
    "two words through the window": "mov #0x8200,w1; nop; mov.d [w1],w2; return",
    "tables, which are no window": "mov #0x200,w1; nop; tblrdl [w1],w2; tblrdh [w1++],w3; return",
    "a chain of cases": "cp w0,#1; bra z,one; cp w0,#2; bra z,two; nop; bra done; one: nop; nop; bra done; two: mov.d w2,w4; done: return",
    "the stack": "push w0; push.d w2; lnk #4; mov w0,[w15-2]; mov [w15-2],w1; ulnk; pop.d w2; pop w0; return",
    "a loop that the core counts": "do #4,last; nop; btsc w0,#0; nop; last: mov.d w2,w4; return",
    "a return with a value": "btsc w0,#0; retlw #3,w0; return",
}


@pytest.mark.parametrize("text", PROGRAMS.values(), ids=PROGRAMS.keys())
def test_the_longest_path_is_what_the_simulator_takes_at_most(machine: Machine, text: str) -> None:
    assert bound(text) == measured(machine, text, range(16))


@pytest.mark.parametrize("text, turns", [
    ("mov #7,w4; loop: dec w4,w4; bra nn,loop; return", 8), ("mov #0x920,w8; mov #3,w4; loop: mov [w8++],w5; dec w4,w4; bra nn,loop; return", 4),
    ("mov #5,w4; loop: cp0 w4; bra z,out; dec w4,w4; bra loop; out: return", 6),
    ("mov #3,w4; outer: mov #3,w5; inner: dec w5,w5; bra nn,inner; dec w4,w4; bra nn,outer; return", 4),
    ("mov #2,w4; loop: rcall leaf; dec w4,w4; bra nn,loop; return; leaf: btsc w0,#0; nop; nop; return", 3)])
def test_a_loop_takes_its_stated_turns(machine: Machine, text: str, turns: int) -> None:
    assert bound(text, turns) == measured(machine, text, range(4))
    assert bound(text, turns + 1) > bound(text, turns)


def test_inner_loops_are_executed_as_often_as_the_outer_ones_turn() -> None:
    ways, labels = paths("outer: nop; inner: dec w5,w5; bra nn,inner; dec w4,w4; bra nn,outer; return", 4)
    assert {loop.head.address: loop.executions for loop in ways.loops.values()} == {labels["outer"]: 4, labels["inner"]: 16}


@pytest.mark.parametrize("text, turns, words", [
    ("loop: dec w4,w4; bra nn,loop; return", None, "nobody says how often the loop"), ("bra w0; return", None, "a jump through a register"),
    ("goto w0; return", None, "a jump through a register"), ("call w0; return", None, "a jump through a register"),
    ("rcall w0; return", None, "a jump through a register"), ("repeat w0; nop; return", None, "a register says how often"),
    ("do w0,last; last: nop; return", None, "a register says how often"), ("rcall start", None, "recursion"), ("reset", None, "goes nowhere"),
    ("rcall ping; return; ping: rcall pong; return; pong: rcall ping; return", None, "recursion"),
    ("nop", None, "no instruction at 0x"), ("loop: nop; bra loop", 3, "never left"),
    ("btsc w0,#0; bra two; one: nop; two: dec w4,w4; bra nz,one; return", 3, "2 ways into it")])
def test_what_cannot_be_followed_is_refused_in_a_line(text: str, turns: int | None, words: str) -> None:
    with pytest.raises(UserError, match=re.escape(words)) as refused:
        bound(text, turns)
    assert "\n" not in str(refused.value)


# Bit 0 of W0 decides twice: no interrupt comes to one and two.
TWICE = "btst.z w0,#0; bra z,on; one: nop; nop; nop; on: btst.z w0,#0; bra nz,off; two: nop; nop; nop; nop; off: return"


def test_parts_that_exclude_each_other_are_not_both_in_the_path(machine: Machine) -> None:
    _, labels = paths(TWICE)
    one, two = {labels["one"]: 1}, {labels["two"]: 2}
    most = measured(machine, TWICE, range(2))
    assert bound(TWICE) > most == bound(TWICE, parts=Parts(one | two, (3,)))
    assert bound(TWICE, parts=Parts(one | two, (4,))) == bound(TWICE)
    assert bound(TWICE, parts=Parts(one | two, (1,))) == measured(machine, TWICE, range(1))
    with pytest.raises(UserError, match="no path to its end"):
        bound(TWICE, parts=Parts({labels["off"]: 1}, (1,)))


def test_a_path_can_end_at_an_instruction() -> None:
    ways, labels = paths(TWICE)
    path = ways.longest(to=lambda node: node.address == labels["on"])
    assert path.cycles == CORE.entry + 6 and path.nodes[-1] == (path.nodes[-1][0], path.cycles) and path.nodes[-1][0].address == labels["on"]


def some_program(seed: int) -> str:
    """Branches by bits of W0, each by one of its own, around instructions of all kinds, with a function that is called now and then."""
    dice = random.Random(seed)
    plain = ["nop", "mov.d w2,w4", "mov [w8],w5", "mov #0x910,w8", "mov w3,[w1]", "repeat #3; add w4,w5,w6", "rcall leaf", "mul.uu w4,w5,w6", "tblrdl [w8],w3",
             "mov #0x8200,w9; mov [w9],w5", "push w4; pop w5"]
    lines = []
    for bit in range(5):
        body = "; ".join(dice.choices(plain, k=dice.randrange(1, 4)))
        form = dice.choice(["btst.z w0,#{0}; bra z,l{0}; {1}; l{0}: {2}", "btsc w0,#{0}; bra l{0}; {1}; bra m{0}; l{0}: {2}; m{0}: nop", "btss w0,#{0}; nop; {1}"])
        lines.append(form.format(bit, body, dice.choice(plain)))
    return "; ".join([*lines, "return", "leaf: btsc w0,#5", "nop", "return"])


@pytest.mark.parametrize("seed", range(5))
def test_the_longest_path_of_random_programs_is_found(machine: Machine, seed: int) -> None:
    text = some_program(seed)
    most = measured(machine, text, range(64))
    assert most <= bound(text) <= most + 4, text # a register that holds addresses of two kinds counts as the dearer one


# ---- what registers point at ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("text, ram", [
    ("mov #0x900,w1; mov [w1],w2", True), ("mov #0x900,w1; add w1,#4,w3; mov [w3],w2", True), ("mov [w15-4],w2", True),
    ("mov #0x900,w1; sl w0,#1,w3; add w1,w3,w3; mov [w3],w2", True), ("mov #0x900,w1; and #6,w0; mov [w1+w0],w2", True),
    ("mov #0x900,w4; mov w4,w6; mov [w6++],w2; mov [w6],w2", True), ("mov #0x900,w4; mov.d w4,w6; mov [w6],w2", True),
    ("mov #0x900,w4; mov w0,[w4++]; inc2 w4,w4; mov [w4],w2", True),
    ("mov [w1],w2", False), ("mov #0x8200,w1; mov [w1],w2", False), ("mov [w15-4],w1; mov [w1],w2", False), ("mov #0x10,w1; mov [w1],w2", False),
    ("mov #0x900,w1; mov [w15-4],w3; add w1,w3,w3; mov [w3],w2", False), ("mov #0x900,w1; mov #0x900,w3; add w1,w3,w3; mov [w3],w2", False),
    ("mov #0x900,w1; mov #0x8200,w3; mov [w1+w3],w2", False), ("mov #0x900,w1; exch w0,w1; mov [w1],w2", False),
    ("mov #0x900,w1; btsc w0,#0; mov #0x8200,w1; nop; mov [w1],w2", False), ("mov 0x8200,w2", False)])
def test_reads_of_ram_are_told_from_reads_that_may_be_elsewhere(text: str, ram: bool) -> None:
    """The same program with a last instruction that cannot read the window."""
    assert bound(f"{text}; return") - bound(f"{re.sub('; [^;]*$', '', '; ' + text).removeprefix('; ') or 'nop'}; return") in (
        ((1, 2) if ram else (1, 2, 3)) if ";" in text else (0, 1))
    words, _ = asm33.assemble(text, PROGRAM)
    held, last = pointers.NOTHING_KNOWN, Op(PROGRAM)
    states = {PROGRAM: held}
    for address in sorted(words):
        op = DECODER.op(words, address)
        held = states.get(address, held)
        last, before = op, held
        held = pointers.after(op, held)
        states[op.following] = pointers.meet(states.get(op.following, held), held)
        if "btsc" in op.text:
            states[DECODER.op(words, op.following).following] = held
    assert pointers.is_ram(last, before) == ram


# ---- what the simulator sees ---------------------------------------------------------------------------------------------
HANDLER = """
loop: bra loop
    .org 0x300
first: bclr 0x84,#13
    btsc w0,#0
one: nop
    btsc w0,#1
two: nop
    mov #2,w5
turn: dec w5,w5
    bra nn,turn
    btsc w0,#2
    bset 0x84,#0
    nop
last: nop
    retfie
    .org 0x380
other: bclr 0x84,#0
    nop
    retfie
"""


def watched(values: list[int]) -> tuple[_Watched, Chip]:
    """Interrupts with these values of W0; part 0 is one, part 1 two, part 2 the loop's head, part 3 the last but one."""
    chip = Chip(HANDLER, {8 + AD1: "first", 8: "other"}, {IEC0: 1 << AD1 | 1, IPC0 + 6: 0x0040, IPC0: 0x0005})
    library, core = chip.machine.library, chip.machine.core
    library.iss_watched.restype = ctypes.POINTER(_Watched)
    assert library.iss_profile(core, 2) and library.iss_watch(core, 8 + AD1)
    for part, label in enumerate(("one", "two", "turn", "last")):
        library.iss_watch_part(core, chip.labels[label], part)
    for parts in (1, 2, 3, 4, 16):
        library.iss_watch_set(core, ctypes.c_uint64(parts))
    for value in values:
        chip.machine.poke(0, value)
        chip.machine.poke(IFS0, 1 << AD1)
        chip.machine.irq_changed()
        chip.run(chip.machine.registers().cycles + 80)
    found = _Watched.from_buffer_copy(library.iss_watched(core)[0])
    library.iss_watch(core, 0)
    library.iss_profile(core, 0)
    return found, chip


def test_parts_are_seen_together_only_where_one_interrupt_has_them_all() -> None:
    found, _ = watched([0, 1, 2, 1, 2])
    assert (found.runs, list(found.whole)[:5]) == (5, [2, 2, 0, 5, 0])
    found, _ = watched([0, 3])
    assert list(found.whole)[:5] == [1, 1, 1, 2, 0]


def test_turns_and_times_are_those_of_the_interrupt_with_the_most() -> None:
    found, chip = watched([0, 1])
    words, _ = asm33.assemble(HANDLER, PROGRAM)
    ways = Paths(build(lambda address: DECODER.op(words, address), CORE, chip.labels["first"]), lambda _: 3)
    assert list(found.times)[:4] == [1, 0, 3, 1]
    assert found.latest[3] + 3 == found.longest[8 + AD1] <= ways.longest().cycles


def test_handlers_in_between_do_not_count() -> None:
    found, _ = watched([4])
    alone, _ = watched([3])
    assert found.longest[8] > 0 and alone.longest[8] == 0
    assert found.longest[8 + AD1] in (alone.longest[8 + AD1], alone.longest[8 + AD1] + 1)


