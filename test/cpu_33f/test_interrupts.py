"""Interrupts and traps on the simulator: priorities, nesting, DISI, what is stacked, return, vectors, and what is reported as an error."""

import re

import pytest

import asm33
from machine import PROGRAM, Machine

ENTRY = 4  # cycles from the end of an instruction to the first one of the handler
INTCON1, INTCON2, IFS0, IFS1, IEC0, IPC0, INTTREG, SPLIM, CORCON, SR = 0x80, 0x82, 0x84, 0x86, 0x94, 0xA4, 0xE0, 0x20, 0x44, 0x42
OSCFAIL, STKERR, ADDRERR, MATHERR, DIV0ERR, SFTACERR = 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 6, 1 << 7
COVTE, OVBTE, OVATE, COVAERR, OVAERR, OVBERR = 1 << 8, 1 << 9, 1 << 10, 1 << 12, 1 << 14, 1 << 13
NSTDIS, ALTIVT = 1 << 15, 1 << 15
INT0, T1, U1RX, AD1 = 0, 3, 11, 13
OSCILLATOR, ADDRESS, STACK, MATH = 1, 2, 3, 4  # trap vectors; interrupt n has vector 8 + n
RCON, TRAPR = 0x740, 1 << 15
STACK_AT = 0x0900

# A program that counts in W0; one handler that counts in W1, one in W2.
MAIN = """
loop: inc w0,w0
    inc w0,w0
    bra loop
    .org 0x300
first: inc w1,w1
    bclr 0x84,#0
    retfie
    .org 0x340
second: inc w2,w2
    bclr 0x84,#13
    retfie
    .org 0x380
trap: inc w3,w3
    mov 0xE0,w4
    bra trap
"""


class Chip:
    """A machine with a program and vectors; run() counts cycles from the start of the program."""

    machine: Machine | None = None

    def __init__(self, text: str = MAIN, vectors: dict[int, str] | None = None, registers: dict[int, int] | None = None,
                 w: dict[int, int] | None = None, sr: int = 0, alternate: bool = False, acc: list[int] | None = None) -> None:
        if Chip.machine is None:
            Chip.machine = Machine()
        self.machine = Chip.machine
        words, self.labels = asm33.assemble(text, PROGRAM)
        for number, label in (vectors or {}).items():
            words[4 + 2 * number + (0x100 if alternate else 0)] = self.labels[label]
        registers = {SPLIM: 0x0F00, CORCON: 0x20, **(registers or {})}
        values = [0] * 15 + [STACK_AT]
        for index, value in (w or {}).items():
            values[index] = value
        self.machine.load(words)
        self.machine.set_state(values, sr, acc or [0, 0], registers, bytes(0x800), PROGRAM)

    def run(self, until: int) -> str:
        """Runs to at least this cycle; the reason if it stopped before."""
        return self.machine.run(until)

    def until(self, label: str, limit: int = 200) -> int:
        """Cycles to a label."""
        for cycle in range(self.machine.registers().cycles, limit):
            if self.pc == self.labels[label]:
                return self.machine.registers().cycles
            self.machine.run(cycle + 1)
        raise AssertionError(f"{label} not reached, pc {self.pc:04x}")

    def __getitem__(self, address: int) -> int:
        return self.machine.peek(address)

    def __setitem__(self, address: int, value: int) -> None:
        self.machine.poke(address, value)

    def request(self, *numbers: int) -> None:
        """Sets interrupt flags, as a peripheral does."""
        for number in numbers:
            self[IFS0 + 2 * (number // 16)] |= 1 << number % 16
        self.machine.irq_changed()

    @property
    def pc(self) -> int:
        return self.machine.registers().pc

    @property
    def w(self) -> list[int]:
        return self.machine.registers().w

    @property
    def level(self) -> int:
        """Priority of the CPU: IPL3 of CORCON and IPL of SR."""
        return (self[CORCON] & 8) | self[SR] >> 5 & 7


def enable(*pairs: tuple[int, int]) -> dict[int, int]:
    """Registers that enable interrupts with priorities."""
    registers = {IPC0 + 2 * index: 0 for index in range(19)} | {IEC0 + 2 * index: 0 for index in range(5)} | {IFS0 + 2 * index: 0 for index in range(5)}
    registers |= {INTCON1: 0, INTCON2: 0}
    for number, priority in pairs:
        registers[IEC0 + 2 * (number // 16)] |= 1 << number % 16
        registers[IPC0 + 2 * (number // 4)] |= priority << 4 * (number % 4)
    return registers


def first(priority: int = 5, text: str = MAIN, registers: dict[int, int] | None = None, **more) -> Chip:
    """A chip whose interrupt INT0 counts in W1."""
    return Chip(text, {8 + INT0: "first"}, enable((INT0, priority)) | (registers or {}), **more)


def both(first_priority: int, second_priority: int, registers: dict[int, int] | None = None) -> Chip:
    """A chip whose interrupt INT0 counts in W1 and AD1 in W2."""
    return Chip(vectors={8 + INT0: "first", 8 + AD1: "second"},
                registers=enable((INT0, first_priority), (AD1, second_priority)) | (registers or {}))


def requested(chip: Chip, at: int, until: int, *numbers: int) -> Chip:
    """The chip with interrupts (INT0) requested at a cycle, and run to another."""
    if at:
        chip.run(at)
    chip.request(*(numbers or (INT0,)))
    chip.run(until)
    return chip


# ---- entry and return ----------------------------------------------------------------------------------------------------

def test_entry_stacks_address_and_status_and_retfie_brings_them_back() -> None:
    chip = requested(first(sr=0x010F | 2 << 5), 0, ENTRY)
    assert (chip.pc, chip.level) == (chip.labels["first"], 5)
    assert (chip[STACK_AT], chip[STACK_AT + 2], chip.w[15]) == (PROGRAM, 0x4F00, STACK_AT + 4)
    chip = requested(first(sr=0x0009 | 2 << 5), 0, ENTRY + 2)
    chip.run(ENTRY + 5)
    assert (chip.pc, chip[SR], chip.w[15], chip.machine.registers().cycles) == (PROGRAM, 0x49, STACK_AT, ENTRY + 5)


def test_inttreg_tells_vector_and_priority() -> None:
    chip = requested(Chip(vectors={8 + AD1: "second"}, registers=enable((AD1, 6))), 0, ENTRY, AD1)
    assert chip[INTTREG] & 0x0F7F == 6 << 8 | 8 + AD1 - chip.machine.assumption("VECNUM_OFFSET")


def test_the_alternate_table_is_used_when_altivt_is_set() -> None:
    chip = requested(first(registers={INTCON2: ALTIVT}, alternate=True), 0, ENTRY)
    assert chip.pc == chip.labels["first"]


def test_an_interrupt_that_arises_in_the_middle_comes_at_the_next_instruction() -> None:
    chip = requested(first(), 2, 2 + ENTRY)
    assert (chip.pc, chip[STACK_AT], chip.w[0]) == (chip.labels["first"], PROGRAM + 4, 2)


def test_a_flag_set_by_the_program_itself_interrupts() -> None:
    chip = Chip("bset 0x84,#13\n nop\n nop\n nop\n nop\n nop\n" + MAIN, {8 + AD1: "second"}, enable((AD1, 3)))
    chip.run(30)
    assert chip.w[2] == 1


def test_a_flag_that_the_handler_does_not_clear_interrupts_again() -> None:
    chip = requested(Chip("loop: inc w0,w0\n bra loop\n .org 0x300\n h: inc w1,w1\n retfie", {8 + INT0: "h"}, enable((INT0, 5))), 0, 200)
    assert chip.w[1] > 15
    assert chip.w[0] < 35


# ---- priorities ----------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("priority, ipl, expected", [(5, 4, 1), (5, 5, 0), (5, 6, 0), (7, 6, 1), (7, 7, 0), (1, 0, 1), (0, 0, 0)])
def test_only_a_higher_priority_than_the_cpus_interrupts(priority: int, ipl: int, expected: int) -> None:
    assert requested(first(priority, sr=ipl << 5), 0, 40).w[1] == expected


def test_without_its_enable_bit_nothing_interrupts() -> None:
    chip = requested(first(registers={IEC0: 0}), 0, 40)
    assert (chip.w[1], chip[IFS0]) == (0, 1)


@pytest.mark.parametrize("priorities, order", [((4, 4), ("first", "second")), ((4, 5), ("second", "first"))])
def test_of_two_the_higher_priority_comes_first_then_the_lower_number(priorities: tuple[int, int], order: tuple[str, str]) -> None:
    chip = both(*priorities)
    chip.request(AD1, INT0)
    assert chip.until(order[0]) < 10
    assert chip.w[1:3] == [0, 0]
    chip.until(order[1])
    assert chip.w[1:3] == ([1, 0] if order[0] == "first" else [0, 1])


def test_a_handler_is_interrupted_by_a_higher_priority() -> None:
    chip = requested(requested(both(4, 5), 0, ENTRY + 1), 0, ENTRY + 1 + ENTRY, AD1)
    assert (chip.pc, chip.level) == (chip.labels["second"], 5)
    assert chip[STACK_AT + 4] == chip.labels["first"] + 2
    chip.run(100)
    assert (chip.w[1], chip.w[2], chip.level) == (1, 1, 0)


@pytest.mark.parametrize("priority, registers", [(3, {}), (4, {}), (7, {INTCON1: NSTDIS})], ids=["lower", "own", "NSTDIS"])
def test_a_handler_is_not_interrupted_by_its_own_or_a_lower_priority_nor_with_nstdis(priority: int, registers: dict[int, int]) -> None:
    chip = requested(requested(both(4, priority, registers), 0, ENTRY + 1), 0, ENTRY + 2, AD1)
    assert (chip.pc, chip.w[2]) == (chip.labels["first"] + 4, 0)
    chip.until("second")
    assert chip.w[1] == 1
    chip.run(100)
    assert (chip.w[1], chip.w[2], chip.level) == (1, 1, 0)


@pytest.mark.parametrize("nstdis, level", [(NSTDIS, 2), (0, 5)])
def test_with_nstdis_software_cannot_change_the_priority(nstdis: int, level: int) -> None:
    chip = Chip("mov #0xA0,w5\n mov w5,0x42\n" + MAIN, registers=enable() | {INTCON1: nstdis}, sr=2 << 5)
    chip.run(3)
    assert chip.level == level


def test_with_nstdis_inttreg_has_the_interrupts_own_priority() -> None:
    chip = requested(Chip(vectors={8 + AD1: "second"}, registers=enable((AD1, 4)) | {INTCON1: NSTDIS}), 0, ENTRY, AD1)
    assert chip.machine.assumption("INTTREG_OWN_PRIORITY") == 1
    assert (chip[INTTREG] >> 8, chip.level) == (4, 7)


def test_inttreg_cannot_be_written() -> None:
    chip = Chip("setm 0xE0\n mov.b wreg,0xE1\n" + MAIN, registers=enable(), w={0: 0x55})
    before = chip[INTTREG]
    chip.run(3)
    assert chip[INTTREG] == before


@pytest.mark.parametrize("number", [0, 1, 13, 16, 23, 29, 57, 58, 63, 65, 73, 74])
def test_interrupts_of_every_register_reach_their_vectors(number: int) -> None:
    chip = requested(Chip(vectors={8 + number: "trap"}, registers=enable((number, 3))), 0, ENTRY, number)
    assert chip.pc == chip.labels["trap"]


def test_one_that_waits_at_the_end_of_a_handler_follows_at_once() -> None:
    chip = both(4, 4)
    chip.request(INT0, AD1)
    assert chip.until("second") == ENTRY + 2 + chip.machine.assumption("RETFIE_PENDING_CYCLES") + ENTRY
    assert (chip.w[0], chip.level) == (0, 4)  # no instruction of the program comes between them
    chip.run(100)
    assert (chip.w[1], chip.w[2], chip.w[15]) == (1, 1, STACK_AT)


def test_writing_ipl_lets_a_waiting_interrupt_in() -> None:
    chip = requested(first(text="mov #0xE0,w5\n mov w5,0x42\n nop\n nop\n nop\n mov #0,w5\n mov w5,0x42\n" + MAIN, sr=0xE0), 0, 6)
    assert chip.w[1] == 0
    chip.run(40)
    assert chip.w[1] == 1


# ---- DISI ----------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("count", range(8))
def test_disi_holds_interrupts_back_to_the_cycle(count: int) -> None:
    text = f"disi #{count}\n" + "nop\n" * 12 + MAIN
    chip = requested(first(text=text), 1, 1)
    assert chip.until("first") == 1 + count + ENTRY
    assert requested(first(text=text), 1, 60)[STACK_AT] == PROGRAM + 2 * (1 + count), "where it came, when nobody stops the core before"


def test_disi_lets_the_present_instruction_end() -> None:
    chip = requested(first(text="disi #6\n" + MAIN), 1, 1)
    assert 7 <= chip.until("first") - ENTRY <= 9  # DISI, then 6 cycles, then the end of the present instruction


def test_disicnt_counts_down_and_its_bit_in_intcon2_tells_that_it_acts() -> None:
    chip = Chip("disi #5\n" + "nop\n" * 12 + MAIN)
    seen = []
    for cycle in range(1, 9):
        chip.run(cycle)
        seen.append((chip[0x52], chip[INTCON2] >> 14 & 1))
    assert seen == [(5, 1), (4, 1), (3, 1), (2, 1), (1, 1), (0, 0), (0, 0), (0, 0)]


def test_disi_does_not_hold_back_priority_7() -> None:
    assert requested(first(7, "disi #100\n" + MAIN), 1, 1).until("first") <= 1 + ENTRY + 1


def test_writing_disicnt_0_ends_it() -> None:
    assert requested(first(text="disi #1000\n nop\n clr 0x52\n" + MAIN), 0, 0).until("first") < 3 + ENTRY + 5


# ---- loops ---------------------------------------------------------------------------------------------------------------

def test_repeat_is_interrupted_and_goes_on() -> None:
    chip = requested(first(text="repeat #19\n r: inc w0,w0\n" + MAIN.replace("loop: inc w0,w0\n    inc w0,w0", "loop: nop")), 5, 5)
    chip.until("first")
    assert chip[STACK_AT] == chip.labels["r"]
    assert chip[STACK_AT + 2] & 0x1000, "RA is stacked"
    assert not chip[SR] & 0x10, "RA is clear in the handler"
    assert chip.w[0] < 20
    chip.run(80)
    assert (chip.w[0], chip.w[1]) == (20, 1)


@pytest.mark.parametrize("interrupt, cycles", [(False, 1 + 21 + 2), (True, 1 + 21 + 2 + ENTRY + 1 + 1 + 3 + 1)])
def test_a_repeated_psv_read_waits_anew_after_an_interrupt(interrupt: bool, cycles: int) -> None:
    chip = first(text="repeat #20\n mov [w5++],w6\n done: nop\n" + MAIN, registers={CORCON: 0x24}, w={5: 0x8200})
    chip.run(12)
    if interrupt:
        chip.request(INT0)
    assert chip.until("done") == cycles


def test_the_handlers_own_repeat_needs_rcount_kept() -> None:
    chip = requested(Chip("""repeat #19
        inc w0,w0
        loop: bra loop
        .org 0x300
        h: push 0x36
        repeat #4
        inc w1,w1
        pop 0x36
        bclr 0x84,#0
        retfie""", {8 + INT0: "h"}, enable((INT0, 5))), 8, 100)
    assert (chip.w[0], chip.w[1], chip.w[15]) == (20, 5, STACK_AT)


@pytest.mark.parametrize("at", range(1, 19))
def test_a_division_is_interrupted_and_goes_on(at: int) -> None:
    text = "repeat #17\n div.sd w2,w4\n" + MAIN.replace("inc w0,w0", "nop")
    chip = requested(first(text=text, w={2: 0x2500, 3: 0xFF42, 4: 0x2200}), at, 80)
    assert chip.w[0] == 0xFA6B  # the handler counts in W1, which would be the remainder of what has been worked out so far


def test_the_end_of_do_may_lie_before_it() -> None:
    chip = Chip("b: nop\n do #2,b\n" + MAIN)
    chip.run(3)
    assert (chip[0x3E], chip[0x40]) == (PROGRAM, 0)


@pytest.mark.parametrize("at", range(1, 20))
def test_do_is_interrupted_and_goes_on(at: int) -> None:
    chip = requested(first(text="do #4,l\n inc w5,w5\n l: inc w6,w6\n" + MAIN), at, 60)
    assert (chip.w[5], chip.w[6], chip.w[1]) == (5, 5, 1)


# ---- traps ---------------------------------------------------------------------------------------------------------------

MODULO = {0x46: 0x8FF1, 0x48: 0x0B00, 0x4A: 0x0B07, SPLIM: 0x0A00} # of W1, while W15 is watched
ODD, LIMIT, FULL = {5: 0x0901}, {SPLIM: 0x0A00}, {15: 0x0A02}
PRODUCT = {6: 0x8000, 7: 0x8000}
ERRORS = { # kind: vector, level, and cases of instructions, registers, W registers, accumulator A, bits of INTCON1
    "address": (ADDRESS, 13, [
        *((text, {}, ODD, 0, ADDRERR) for text in ("mov [w5],w6", "mov w6,[w5]", "mov [w5++],w6", "add w6,[w5],w6", "clr [w5]", "mov.d [w5],w6")),
        *((text, {}, {5: address}, 0, ADDRERR) for text in ("mov [w5],w6", "mov w6,[w5]") for address in (0x1000, 0x2000, 0x7FFE)),
        ("mov [w5],w6", {CORCON: 0x20}, {5: 0x8200}, 0, ADDRERR),               # PSV is off
        ("mov [w5],w6", {INTCON1: NSTDIS}, ODD, 0, ADDRERR),
        ("disi #100\n mov [w5],w6", {SR: 7 << 5}, ODD, 0, ADDRERR)]),
    "stack": (STACK, 12, [
        ("push w0\n push w0", LIMIT, FULL, 0, STKERR), ("push w0", MODULO, FULL, 0, STKERR), ("call f\n f: nop", LIMIT, FULL, 0, STKERR),
        ("mov.d w6,[w15++]", LIMIT, {15: 0x0A00}, 0, STKERR), ("pop w0", {}, {15: 0x0800}, 0, STKERR),
        *((text, {SPLIM: 0x0900}, {15: 0x0900}, 0, STKERR) for text in ("mov w6,[w15+16]", "mov [w15-258],w6", "mov.b w6,[w15+18]"))]),
    "math": (MATH, 11, [
        *((f"repeat #17\n {text}", {}, {2: 100, 5: 0}, 0, MATHERR | DIV0ERR)
          for text in ("div.s w2,w5", "div.u w2,w5", "div.sd w2,w5", "div.ud w2,w5", "divf w2,w5")),
        ("mpy w6*w7,a", {INTCON1: OVATE, CORCON: 0}, PRODUCT, 0, MATHERR | OVAERR),
        ("mpy w6*w7,b", {INTCON1: OVBTE, CORCON: 0}, PRODUCT, 0, MATHERR | OVBERR),
        ("mac w6*w7,a", {INTCON1: COVTE, CORCON: 0}, {6: 0x7FFF, 7: 0x7FFF}, 0x7FFFFFFFFF, MATHERR | COVAERR)]),
    "none": (0, 0, [
        ("mov.b w6,[w5]\n mov.b [w5],w6", {}, ODD, 0, 0), ("push w0", LIMIT, {15: 0x0A00}, 0, 0), ("mov w0,[w1++]", MODULO, {1: 0x0B06}, 0, 0),
        ("mpy w6*w7,a", {CORCON: 0}, PRODUCT, 0, 0), ("mpy w6*w7,b", {CORCON: 0}, PRODUCT, 0, 0),
        ("mac w6*w7,a", {INTCON1: COVTE, CORCON: 0}, {6: 0x7FFF, 7: 0x7FFF}, 0x7FFFFFFF, 0)]), # only guard bits are used
}


VECTORS = {OSCILLATOR: "trap", ADDRESS: "trap", STACK: "trap", MATH: "trap"}


def expect_trap(chip: Chip, error: int, vector: int, level: int) -> None:
    """The trap is taken, with its bit, vector and level."""
    chip.until("trap", 60)
    chip.run(chip.machine.registers().cycles + 2)
    assert chip[INTCON1] & error == error
    assert (chip.w[4] & 0x7F, chip.w[4] >> 8 & 15, chip.level) == (vector - chip.machine.assumption("VECNUM_OFFSET") & 0x7F, level, level)


@pytest.mark.parametrize("kind, text, registers, w, acc, error",
                         [(kind, *case) for kind, (_, _, cases) in ERRORS.items() for case in cases])
def test_each_error_has_its_trap(kind: str, text: str, registers: dict[int, int], w: dict[int, int], acc: int, error: int) -> None:
    chip = Chip(f"{text}\n nop\n nop\n" + MAIN, VECTORS, enable() | registers, w=w, acc=[acc, 0], sr=registers.get(SR, 0))
    if kind != "none":
        expect_trap(chip, error, *ERRORS[kind][:2])
    else:
        chip.run(20)
        assert (chip[INTCON1] & ~COVTE, chip.w[3]) == (0, 0)


def test_a_divisor_of_zero_traps_in_the_first_turn() -> None:
    chip = Chip("repeat #17\n div.s w2,w5\n nop\n" + MAIN, VECTORS, enable(), w={2: 100, 5: 0})
    assert chip.machine.assumption("DIVIDE_ZERO_FIRST_TURN") == 1
    assert chip.until("trap") < 10


@pytest.mark.parametrize("shift", [17, 0xFFEF, 0x7FFF])
def test_an_accumulator_shift_beyond_16_is_a_math_error_and_changes_nothing(shift: int) -> None:
    chip = Chip("sftac a,w6\n nop\n nop\n" + MAIN, VECTORS, enable(), w={6: shift}, acc=[0x12345678, 0])
    expect_trap(chip, MATHERR | SFTACERR, MATH, 11)
    assert chip.machine.registers().acc[0] == 0x12345678


def test_a_failing_oscillator_traps_above_all() -> None:
    chip = Chip(vectors=VECTORS, registers=enable(), sr=7 << 5)
    chip.run(3)
    chip[INTCON1] |= OSCFAIL
    chip.machine.irq_changed()
    expect_trap(chip, OSCFAIL, OSCILLATOR, 14)


def test_a_handler_that_clears_the_error_returns() -> None:
    chip = Chip("repeat #17\n div.u w2,w5\n" + MAIN + "\n .org 0x3C0\n m: bclr 0x80,#4\n bclr 0x80,#6\n mov #1,w5\n inc w7,w7\n retfie",
                {MATH: "m"}, enable(), w={2: 100, 5: 0})
    chip.run(100)
    assert (chip.w[7], chip.level, chip.w[15], chip[INTCON1]) == (1, 0, STACK_AT, 0)


@pytest.mark.parametrize("text, soft", [("sftac a,w6", True), ("push w0", True), ("mov [w5],w6", False)])
def test_a_soft_trap_waits_and_a_hard_one_does_not(text: str, soft: bool) -> None:
    chip = Chip(text + "\n" + "nop\n" * 8 + MAIN, VECTORS, enable() | {SPLIM: 0x0A00},
                w={5: 0x0901, 6: 17, 15: 0x0A02 if "push" in text else STACK_AT})
    assert chip.until("trap") == 1 + ENTRY + (chip.machine.assumption("SOFT_TRAP_DELAY_CYCLES") if soft else 0)


def test_a_trap_within_a_trap_returns_to_the_first_ones_level() -> None:
    chip = Chip("sftac a,w6\n" + "nop\n" * 6 + MAIN + """
        .org 0x3C0
        m: inc w7,w7
        mov [w5],w8
        back: nop
        bra back
        .org 0x400
        a: bclr 0x80,#3
        mov #0x900,w5
        retfie""", {MATH: "m", ADDRESS: "a"}, enable(), w={5: 0x0901, 6: 17})
    chip.until("a")
    assert chip.level == 13
    chip.run(chip.machine.registers().cycles + 10)
    assert (chip.level, chip.w[7]) == (11, 1)
    assert chip.pc in (chip.labels["back"], chip.labels["back"] + 2)


def test_the_alternate_table_is_used_for_traps_too() -> None:
    chip = Chip("mov [w5],w6\n nop\n nop\n" + MAIN, VECTORS, enable() | {INTCON2: ALTIVT}, w={5: 0x0901}, alternate=True)
    expect_trap(chip, ADDRERR, ADDRESS, 13)


# ---- reports: errors of a program that the chip would not tell -------------------------------------------------------------------

POINTERS = {5: 0x900, 7: 0x900, 8: 0x900}
PSV = {CORCON: 0x24}
TOLD = [ # a program, W registers, registers, what stops it
    ("goto 0x1000", {}, {}, "001000"),
    *((f"nop\n .word24 {word:#x}", {}, {}, "000202") for word in (0xDB1234, 0xDC0000, 0xBF0000, 0x0A0000, 0x0B0000, 0xFC8000)),
    *((text, {2: 100, 4: 7}, {}, "[Dd]ivi") for text in ("repeat #16\n div.s w2,w4", "div.s w2,w4", "repeat #18\n div.u w2,w4")),
    *((text, w, {}, "(?i)space.*0*200") for text, w in (
        ("clr a,[w8],w6", {8: 0xC00}), ("clr a,[w10],w6", {10: 0xBFE}), ("clr a,[w10],w6", {10: 0x8200}),
        ("ed w4*w4,a,[w8],[w10],w6", {8: 0xBFE, 10: 0x900}))),
    ("tblrdl [w5],w6", {5: 0x5800}, {}, "5800"),
    *(("mov [w5],w6", {5: 0x8200}, PSV | {0x34: page}, f"read at 0x{address}")
      for page, address in ((0x10, "080200"), (0xFF, "7F8200"), (0x01, "008200"))),
    *((text, {}, {}, "no flash.*" + text.split("0x")[1]) for text in ("goto 0x10200", "call 0x10200", "goto 0x7F0200", "goto 0x5800")),
]


@pytest.mark.parametrize("text, w, registers, report", TOLD)
def test_what_no_program_should_do_is_told(text: str, w: dict[int, int], registers: dict[int, int], report: str) -> None:
    word = asm33.match(int(text.split()[-1], 0)) if ".word24" in text else None
    assert word is None
    assert re.search(report, Chip(text + "\n" + MAIN, registers=registers, w=w).run(40))


def test_an_empty_vector_is_told() -> None:
    chip = Chip(registers=enable((INT0, 5)))
    chip.request(INT0)
    assert "vector" in chip.run(20).lower()


@pytest.mark.parametrize("text, register", [("mov [w5],w6", 5), ("mov w6,[w5++]", 5), ("mov [w5+2],w6", 5), ("mov w6,[w7+w5]", 5),
                                            ("tblrdl [w5],w6", 5),
                                            ("clr a,[w8],w6", 8)])
def test_a_register_never_written_that_addresses_memory_is_told(text: str, register: int) -> None:
    chip = Chip("nop\n " + text + "\n" + MAIN, w=POINTERS)
    chip.machine.forget_w(register)
    assert re.search(f"W{register}.*0202", chip.run(20))


def test_a_register_written_before_is_none_of_them() -> None:
    chip = Chip("mov w7,w5\n nop\n mov [w5],w6\n inc w8,w8\n" + MAIN, w={7: 0x900})
    chip.machine.forget_w(5)
    assert chip.run(20) == ""


def test_an_address_error_in_the_handler_of_a_failing_oscillator_resets() -> None:
    chip = Chip("nop\n" + MAIN + "\n .org 0x3C0\n h: mov #0x901,w5\n nop\n mov [w5],w6\n nop\n nop\n .org 0\n goto 0x204",
                {OSCILLATOR: "h", ADDRESS: "trap"}, enable())
    chip[INTCON1] = OSCFAIL
    chip.machine.irq_changed()
    chip.run(14)
    assert (chip[RCON] & TRAPR, chip.level, chip.w[3]) == (TRAPR, 0, 0)


def test_ram_that_was_never_written_is_told_once_with_its_address() -> None:
    chip = Chip("nop\n mov 0x0A00,w6\n mov 0x0A00,w6\n mov 0x0A02,w6\n" + MAIN)
    chip.machine.forget(0x0A00)
    chip.machine.forget(0x0A02)
    assert re.search("0A00.*0202", chip.run(20))
    assert "0A02" in chip.run(20)
    assert chip.run(20) == ""


def test_ram_is_known_after_a_write_of_just_that_byte() -> None:
    chip = Chip("mov.b w0,[w5]\n mov.b [w5],w6\n mov.b [w7],w6\n" + MAIN, w={5: 0x0A00, 7: 0x0A01})
    chip.machine.forget(0x0A00)
    assert "0204" in chip.run(20)
