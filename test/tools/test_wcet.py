"""make wcet around the graph: statements in the sources, parts by name, what is wrong with a statement or a bound, texts, and what a user sees."""

import dataclasses
import re
from pathlib import Path
from unittest import mock

import asm33
import pytest
from machine import LIBRARY
from support import command, refused

from tools.bench import wcet as bench
from tools.common.errors import UserError
from tools.image import device, image, wcet
from tools.image.budget import Budget, CycleLimits, Limits
from tools.image.facts import Decoder
from tools.image.program import Elf
from tools.image.wcet import Place, Program, Statement, read_statements

DECODER = Decoder(LIBRARY)
ENTRY = DECODER.assumed["INTERRUPT_ENTRY_CYCLES"]
HEAD = ("include/tick.h", 7)

# Bit 0 of W0 decides twice: only one of ramp and look is ever executed. The third duty is written behind both.
TEXT = """
main: nop
    bra main
interrupt: btst.z w0,#0
    bra z,on
ramp: nop
    nop
    nop
on: btst.z w0,#0
    bra nz,off
look: nop
    nop
off: mov w0,0x01DA
    mov #2,w5
turn: dec w5,w5
    bra nn,turn
    retfie
fault: nop
    retfie
"""
WORDS, LABELS = asm33.assemble(TEXT)
EXCLUDES = Statement(("isr.c", 3), part="ramp", others=("_ADC1Interrupt/look",))
TURNS = Statement(HEAD, turns=3)


def program(*statements: Statement) -> Program:
    """The program above as an image, with these statements about it."""
    places = {address: Place(("_ADC1Interrupt",), "isr.c", 9) for address in WORDS}
    places |= {LABELS["ramp"] + step: Place(("_ADC1Interrupt", "ramp"), "ramp.h", 4) for step in (0, 2, 4)}
    places[LABELS["look"]] = Place(("_ADC1Interrupt", "step", "look"), "look.h", 5)
    places |= {LABELS["turn"] + step: Place(("_ADC1Interrupt", "turn"), *HEAD) for step in (0, 2)}
    elf = Elf(WORDS)
    elf.symbols["_main"] = LABELS["main"]
    return Program(elf, places, list(statements), DECODER, {"_ADC1Interrupt": LABELS["interrupt"], "_FLTA1Interrupt": LABELS["fault"]})


def limits(isr: int = 1000, duty: int = 1000, deadline: int = 745, both: int = 1949) -> Budget:
    return Budget(Limits(0, 0), Limits(0, 0), CycleLimits(1, 1, 1, 1, 1, isr, duty, 1, deadline, both, ()), [], [], (), (), [])


def report(*statements: Statement, **seen) -> bench.Report:
    """The report of an image whose interrupts ran as is said here, else as its graph has them."""
    image = program(TURNS, *statements)
    ways = image.ways("_ADC1Interrupt")
    bounds = image.bounds_of(ways, "_ADC1Interrupt") + image.bounds("_FLTA1Interrupt")
    result = bench.Report("foc33.elf", image, bounds, image.longest_instruction(), bench.executions(ways.loops.values()))
    longest = [0] * len(device.VECTORS)
    longest[bench.ADC1_VECTOR] = 20
    parts = len(result.watch.parts)
    usual = bench.Seen(100, longest, [1] * (parts - 1) + [3], [12] * parts, [0] * len(result.watch.sets), (192, 194), 939)
    result.seen = dataclasses.replace(usual, **seen)
    return result


# ---- statements ----------------------------------------------------------------------------------------------------------
def sources(folder: Path, text: str) -> Path:
    for room in ("firmware/board", "include/drive"):
        (folder / room).mkdir(parents=True)
    (folder / "include" / "drive" / "tick.h").write_text(text, encoding="utf-8")
    return folder


def test_statements_are_comments_of_the_sources(tmp_path):
    text = "/* slow wcet: no */\nwhile (x) { /* wcet: at most 12 turns */\n/* wcet: ramp excludes look a/b */\n}\n/** wcet: idle is never reached */\n"
    assert read_statements(sources(tmp_path, text)) == [
        Statement(("include/drive/tick.h", 2), turns=12), Statement(("include/drive/tick.h", 3), part="ramp", others=("look", "a/b")),
        Statement(("include/drive/tick.h", 5), part="idle", others=("idle",))]


@pytest.mark.parametrize("text", ["at most many turns", "ramp excludes", "ramp never reached", "12 turns"])
def test_a_comment_that_is_no_statement_is_refused(tmp_path, text):
    with pytest.raises(UserError, match="no statement about the longest path.*include/drive/tick.h:2.*write 'at most N turns'"):
        read_statements(sources(tmp_path, f"\n/* wcet: {text} */\n"))


def test_the_statements_of_the_firmware_can_be_read():
    assert any(item.turns for item in read_statements()) and any(item.part for item in read_statements())


@pytest.mark.parametrize("name, names, found", [
    ("look", ("isr", "look"), True), ("isr/look", ("isr", "step", "look"), True), ("look/isr", ("isr", "look"), False), ("look", ("isr",), False),
    ("isr/isr", ("isr",), False)])
def test_a_part_is_a_function_wherever_it_is_inlined(name, names, found):
    image = program(Statement(HEAD, part=name, others=(name,)))
    image.places[LABELS["fault"]] = Place(names)
    assert (LABELS["fault"] in image.parts[name]) == found


def test_a_part_that_is_nowhere_is_told_with_its_place():
    lines = program(Statement(("isr.c", 3), part="ramp", others=("loook",))).unknown_parts()
    assert lines == ["ramp excludes loook (isr.c:3): no loook in the image: correct the name or take the statement out"]


# ---- bounds --------------------------------------------------------------------------------------------------------------
def test_bounds_are_those_of_the_path_that_is_possible():
    free = {bound.to: bound.cycles for bound in program(TURNS).bounds("_ADC1Interrupt")}
    bounds = {bound.to: bound for bound in program(TURNS, EXCLUDES).bounds("_ADC1Interrupt")}
    assert free == {wcet.THIRD_DUTY: ENTRY + 10, wcet.RETURN: ENTRY + 10 + 1 + 8 + 3}
    assert {to: (bound.cycles, bound.free) for to, bound in bounds.items()} == {to: (cycles - 1, cycles) for to, cycles in free.items()}


def test_another_handler_has_no_duty():
    assert [(bound.to, bound.cycles) for bound in program().bounds("_FLTA1Interrupt")] == [(wcet.RETURN, ENTRY + 4)]


def test_a_loop_that_nobody_speaks_of_is_refused_with_its_line():
    with pytest.raises(UserError, match=r"nobody says how often the loop at 0x\w+ turns.*include/tick.h:7.*at most 8 turns"):
        program(EXCLUDES).bounds("_ADC1Interrupt")


def test_a_background_that_holds_interrupts_up_is_refused():
    words, labels = asm33.assemble("main: disi #9; bra main")
    image = program()
    image.elf.words, image.elf.symbols["_main"] = words, labels["main"]
    with pytest.raises(UserError, match=r"the background holds interrupts up at 0x200 \(disi #0x9\)"):
        image.longest_instruction()


def test_handlers_come_control_interrupt_first_then_by_vector():
    image = program()
    image.handlers = dict.fromkeys(("_DefaultInterrupt", "_FLTA1Interrupt", "_MathError", "_ADC1Interrupt"), 0)
    assert wcet.handlers_of(image) == ["_ADC1Interrupt", "_MathError", "_FLTA1Interrupt", "_DefaultInterrupt"]


def test_the_path_is_told_by_line_with_its_loops():
    image = program(TURNS, EXCLUDES)
    lines = wcet.by_line(image, image.bounds("_ADC1Interrupt")[1])
    assert [line.split()[2] for line in lines] == ["isr.c:9", "ramp.h:4", "isr.c:9", "include/tick.h:7", "isr.c:9"]
    assert sum(int(line.split()[1]) for line in lines) == int(lines[-1].split()[0])
    assert re.search(r"turn\(\); a loop, 3 turns of 3 cycles$", lines[3])


# ---- what does not hold --------------------------------------------------------------------------------------------------
def test_a_budget_fails_exactly_when_a_bound_is_above_it():
    item = report()
    duty, isr = (bound.cycles for bound in item.bounds[:2])
    assert bench.broken(item, limits(isr, duty)) == [] == bench.broken(item, None)
    assert bench.broken(item, limits(isr - 2, duty)) == [
        f"longest path of _ADC1Interrupt to its return: {isr} cycles, 2 over the budget of {isr - 2}; make wcet shows it"]
    assert bench.broken(item, limits(isr, duty - 1)) == [
        f"longest path of _ADC1Interrupt to the third duty: {duty} cycles, 1 over the budget of {duty - 1}; make wcet shows it"]


def test_a_statement_that_a_run_contradicts_fails():
    assert bench.broken(report(EXCLUDES), None) == []
    line, = bench.broken(report(EXCLUDES, whole=[3]), None)
    assert line.startswith("ramp excludes _ADC1Interrupt/look (isr.c:3): not true of 3 interrupts that ran, which had ramp and _ADC1Interrupt/look")


def test_a_part_that_never_ran_is_told():
    ran, never = (report(EXCLUDES, times=[1, times, 0, 3]) for times in (1, 0))
    assert [item.unseen for item in (ran, never)] == [[], ["ramp"]] == [bench.summary(item)["unseen"] for item in (ran, never)]
    assert "ran in no scenario, so that no run has tried what is stated of it: ramp" in bench.text(never) and "ran in no scenario" not in bench.text(ran)


def test_a_loop_that_turned_more_often_than_is_stated_fails():
    line, = bench.broken(report(times=[1, 4]), None)
    assert line == "turn(), include/tick.h:7: a loop turned 4 times in one interrupt, but what is stated makes 3 at most"


def test_an_interrupt_longer_than_its_longest_path_fails():
    longest = [0] * len(device.VECTORS)
    longest[bench.ADC1_VECTOR] = 99
    line, = bench.broken(report(longest=longest), None)
    assert line.startswith("_ADC1Interrupt to its return ran 99 cycles, its longest path has ") and line.endswith("the graph is not the program's")


def test_the_deadline_is_proven_or_not():
    # samples 192, the longest instruction of the background 2: one more to wait for
    item = report()
    assert item.latency == 192 + 1 + item.bounds[0].cycles
    assert bench.broken(report(load_cycles=item.latency + 1), None) == []
    line, = bench.broken(report(load_cycles=item.latency), None)
    assert line == (f"the deadline is not proven: up to {item.latency} cycles from the trigger to the third duty, but the duties load after "
                    f"{item.latency}")


def test_an_interrupt_may_wait_for_a_fault_and_no_longer():
    most = report().instruction - 1 + report().others
    assert bench.broken(report(entry=(192, 192 + most)), None) == []
    assert "where a fault's handler came first" in bench.text(report(entry=(192, 192 + most)))
    assert bench.broken(report(entry=(192, 193 + most)), None) == [
        f"an interrupt waited {most + 1} cycles for its entry, longer than any instruction and handler takes"]


def test_an_interrupt_that_never_ran_proves_nothing():
    assert bench.broken(report(latest=[0, 0]), None) == ["the control interrupt never ran"]


def test_scenarios_add_up_to_the_most_of_each():
    one, two = report(EXCLUDES).seen, report(EXCLUDES, runs=5, entry=(190, 193), load_cycles=930, whole=[2], times=[9, 0, 0, 0]).seen
    both = one + two
    assert (both.runs, both.entry, both.load_cycles, both.whole, both.times, both.scenarios) == (105, (190, 194), 930, [2], [9, 1, 1, 3], 2)


# ---- output --------------------------------------------------------------------------------------------------------------
def test_the_text_has_bounds_observed_deadline_path_and_statements():
    item = report(EXCLUDES)
    text = bench.text(item)
    duty = item.bounds[0].cycles
    assert re.search(rf"_ADC1Interrupt +third duty +{duty} +12 +{duty + 1}\n", text)
    assert re.search(r"_FLTA1Interrupt +return +8 +- +8\n", text)
    assert f"trigger to the third duty: {192 + 1 + duty} cycles at most, the duties load after 939" in text
    assert "ramp.h:4 ramp()" in text and "stated, and true of all that ran:\n  at most 3 turns (include/tick.h:7)" in text
    assert bench.summary(item)["bounds"][0] == {"handler": "_ADC1Interrupt", "to": "third duty", "bound": duty, "observed": 12, "free": duty + 1}


@pytest.mark.parametrize("arguments, words", [(["--image", "/no/such.elf"], "no image '/no/such.elf'"), (["--nonsense"], "--nonsense")])
def test_bad_input_is_one_line(arguments, words):
    refused(command(*arguments, main=bench.main), words)


def test_without_the_simulator_it_says_what_to_make(tmp_path):
    with pytest.raises(UserError, match="the simulator is not built.*libmachine.so.*make"):
        Decoder(tmp_path / "libmachine.so")


@pytest.mark.parametrize("duty, isr, slow, delivered, broken", [
    (470, 500, 960, True, []), (471, 501, 961, True, ["the third duty", "its return", "its return"]),
    (745, 989, 960, False, []), (746, 989, 960, False, ["the third duty"]), (745, 989, 961, False, ["together: 1950 cycles, 1 more"])])
def test_another_header_than_the_delivered_one_is_held_to_the_deadlines_alone(duty, isr, slow, delivered, broken):
    bounds = [mock.Mock(handler=handler, to=to, cycles=cycles) for handler, to, cycles in (
        (wcet.INTERRUPT, wcet.THIRD_DUTY, duty), (wcet.INTERRUPT, wcet.RETURN, isr), (wcet.SLOW, wcet.RETURN, slow))]
    cycles = dataclasses.replace(limits(500, 470).cycles, slow_bound=960)
    lines = wcet.over(bounds, cycles, delivered)
    assert len(lines) == len(broken) and all(words in line for words, line in zip(broken, lines))


def test_the_build_s_line_says_which_of_the_paths_is_the_slow_work_s():
    bounds = [mock.Mock(handler=handler, to=to, cycles=cycles) for handler, to, cycles in (
        (wcet.INTERRUPT, wcet.THIRD_DUTY, 454), (wcet.INTERRUPT, wcet.RETURN, 481), (wcet.SLOW, wcet.RETURN, 1078))]
    with mock.patch.object(wcet, "check", return_value=(bounds, [])):
        text, failures = image.longest_paths(Path("foc33.elf"), mock.Mock(), True)
    assert (text, failures) == ("longest path of the interrupt 454 cycles to its third duty, 481 cycles to its return, of its slow work 1078 cycles to its return", [])
