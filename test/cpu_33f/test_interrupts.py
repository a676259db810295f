"""Interrupts and traps on the simulator: priorities, nesting, DISI, what is stacked, return, vectors, and what is reported as an error."""

import unittest

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


class Entry(unittest.TestCase):
    def test_the_handler_is_reached_after_the_entry_cycles_with_its_priority(self) -> None:
        chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, 5)), sr=0x0103)
        chip.request(INT0)
        chip.run(ENTRY)
        self.assertEqual((chip.pc, chip.level), (chip.labels["first"], 5))

    def test_return_address_status_and_priority_go_to_the_stack(self) -> None:
        chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, 5)), sr=0x010F | 2 << 5)
        chip.request(INT0)
        chip.run(ENTRY)
        self.assertEqual((chip[STACK_AT], chip[STACK_AT + 2], chip.w[15]), (PROGRAM, 0x4F00, STACK_AT + 4))

    def test_retfie_brings_back_status_and_address_in_three_cycles(self) -> None:
        chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, 5)), sr=0x0009 | 2 << 5)
        chip.request(INT0)
        chip.run(ENTRY + 2)
        chip.run(ENTRY + 5)
        self.assertEqual((chip.pc, chip[SR], chip.w[15], chip.machine.registers().cycles), (PROGRAM, 0x49, STACK_AT, ENTRY + 5))

    def test_inttreg_tells_vector_and_priority(self) -> None:
        chip = Chip(vectors={8 + AD1: "second"}, registers=enable((AD1, 6)))
        chip.request(AD1)
        chip.run(ENTRY)
        self.assertEqual(chip[INTTREG] & 0x0F7F, 6 << 8 | 8 + AD1 - chip.machine.assumption("VECNUM_OFFSET"))

    def test_the_alternate_table_is_used_when_altivt_is_set(self) -> None:
        chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, 5)) | {INTCON2: ALTIVT}, alternate=True)
        chip.request(INT0)
        chip.run(ENTRY)
        self.assertEqual(chip.pc, chip.labels["first"])

    def test_an_interrupt_that_arises_in_the_middle_comes_at_the_next_instruction(self) -> None:
        chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, 5)))
        chip.run(2)
        chip.request(INT0)
        chip.run(2 + ENTRY)
        self.assertEqual((chip.pc, chip[STACK_AT], chip.w[0]), (chip.labels["first"], PROGRAM + 4, 2))

    def test_a_flag_set_by_the_program_itself_interrupts(self) -> None:
        chip = Chip("bset 0x84,#13\n nop\n nop\n nop\n nop\n nop\n" + MAIN, {8 + AD1: "second"}, enable((AD1, 3)))
        chip.run(30)
        self.assertEqual(chip.w[2], 1)

    def test_a_flag_that_the_handler_does_not_clear_interrupts_again(self) -> None:
        chip = Chip("loop: inc w0,w0\n bra loop\n .org 0x300\n h: inc w1,w1\n retfie", {8 + INT0: "h"}, enable((INT0, 5)))
        chip.request(INT0)
        chip.run(200)
        self.assertGreater(chip.w[1], 15)
        self.assertLess(chip.w[0], 35)


class Priorities(unittest.TestCase):
    def test_only_a_higher_priority_than_the_cpus_interrupts(self) -> None:
        for priority, ipl, expected in ((5, 4, 1), (5, 5, 0), (5, 6, 0), (7, 6, 1), (7, 7, 0), (1, 0, 1), (0, 0, 0)):
            with self.subTest(priority=priority, ipl=ipl):
                chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, priority)), sr=ipl << 5)
                chip.request(INT0)
                chip.run(40)
                self.assertEqual(chip.w[1], expected)

    def test_without_its_enable_bit_nothing_interrupts(self) -> None:
        chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, 5)) | {IEC0: 0})
        chip.request(INT0)
        chip.run(40)
        self.assertEqual((chip.w[1], chip[IFS0]), (0, 1))

    def test_of_two_with_one_priority_the_lower_number_comes_first(self) -> None:
        chip = Chip(vectors={8 + INT0: "first", 8 + AD1: "second"}, registers=enable((INT0, 4), (AD1, 4)))
        chip.request(AD1, INT0)
        self.assertLess(chip.until("first"), 10)
        self.assertEqual(chip.w[2], 0)
        chip.until("second")
        self.assertEqual(chip.w[1], 1)

    def test_of_two_the_higher_priority_comes_first(self) -> None:
        chip = Chip(vectors={8 + INT0: "first", 8 + AD1: "second"}, registers=enable((INT0, 4), (AD1, 5)))
        chip.request(AD1, INT0)
        chip.until("second")
        self.assertEqual(chip.w[1], 0)

    def test_a_handler_is_interrupted_by_a_higher_priority(self) -> None:
        chip = Chip(vectors={8 + INT0: "first", 8 + AD1: "second"}, registers=enable((INT0, 4), (AD1, 5)))
        chip.request(INT0)
        chip.run(ENTRY + 1)
        chip.request(AD1)
        chip.run(ENTRY + 1 + ENTRY)
        self.assertEqual((chip.pc, chip.level), (chip.labels["second"], 5))
        self.assertEqual(chip[STACK_AT + 4], chip.labels["first"] + 2)
        chip.run(100)
        self.assertEqual((chip.w[1], chip.w[2], chip.level), (1, 1, 0))

    def test_a_handler_is_not_interrupted_by_its_own_or_a_lower_priority(self) -> None:
        for priority in (3, 4):
            chip = Chip(vectors={8 + INT0: "first", 8 + AD1: "second"}, registers=enable((INT0, 4), (AD1, priority)))
            chip.request(INT0)
            chip.run(ENTRY + 1)
            chip.request(AD1)
            chip.run(ENTRY + 2)
            self.assertEqual((chip.pc, chip.w[2]), (chip.labels["first"] + 4, 0))
            chip.until("second")
            self.assertEqual(chip.w[1], 1)

    def test_with_nstdis_no_handler_is_interrupted(self) -> None:
        chip = Chip(vectors={8 + INT0: "first", 8 + AD1: "second"}, registers=enable((INT0, 4), (AD1, 7)) | {INTCON1: NSTDIS})
        chip.request(INT0)
        chip.run(ENTRY + 1)
        chip.request(AD1)
        chip.run(ENTRY + 2)
        self.assertEqual(chip.w[2], 0)
        self.assertEqual(chip.pc, chip.labels["first"] + 4)
        chip.run(100)
        self.assertEqual((chip.w[1], chip.w[2], chip.level), (1, 1, 0))

    def test_with_nstdis_software_cannot_change_the_priority(self) -> None:
        for nstdis, level in ((NSTDIS, 2), (0, 5)):
            chip = Chip("mov #0xA0,w5\n mov w5,0x42\n" + MAIN, registers=enable() | {INTCON1: nstdis}, sr=2 << 5)
            chip.run(3)
            self.assertEqual(level, chip.level)

    def test_with_nstdis_inttreg_has_the_interrupts_own_priority(self) -> None:
        self.assertEqual(1, Chip.machine.assumption("INTTREG_OWN_PRIORITY"))
        chip = Chip(vectors={8 + AD1: "second"}, registers=enable((AD1, 4)) | {INTCON1: NSTDIS})
        chip.request(AD1)
        chip.run(ENTRY)
        self.assertEqual((4, 7), (chip[INTTREG] >> 8, chip.level))

    def test_inttreg_cannot_be_written(self) -> None:
        chip = Chip("setm 0xE0\n mov.b wreg,0xE1\n" + MAIN, registers=enable(), w={0: 0x55})
        before = chip[INTTREG]
        chip.run(3)
        self.assertEqual(before, chip[INTTREG])

    def test_interrupts_of_every_register_reach_their_vectors(self) -> None:
        for number in (0, 1, 13, 16, 23, 29, 57, 58, 63, 65, 73, 74):
            with self.subTest(number=number):
                chip = Chip(vectors={8 + number: "trap"}, registers=enable((number, 3)))
                chip.request(number)
                chip.run(ENTRY)
                self.assertEqual(chip.pc, chip.labels["trap"])

    def test_one_that_waits_at_the_end_of_a_handler_follows_at_once(self) -> None:
        chip = Chip(vectors={8 + INT0: "first", 8 + AD1: "second"}, registers=enable((INT0, 4), (AD1, 4)))
        chip.request(INT0, AD1)
        self.assertEqual(chip.until("second"), ENTRY + 2 + chip.machine.assumption("RETFIE_PENDING_CYCLES") + ENTRY)
        self.assertEqual((chip.w[0], chip.level), (0, 4))  # no instruction of the program comes between them
        chip.run(100)
        self.assertEqual((chip.w[1], chip.w[2], chip.w[15]), (1, 1, STACK_AT))

    def test_writing_ipl_lets_a_waiting_interrupt_in(self) -> None:
        chip = Chip("mov #0xE0,w5\n mov w5,0x42\n nop\n nop\n nop\n mov #0,w5\n mov w5,0x42\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)), sr=0xE0)
        chip.request(INT0)
        chip.run(6)
        self.assertEqual(chip.w[1], 0)
        chip.run(40)
        self.assertEqual(chip.w[1], 1)


class Disi(unittest.TestCase):
    def test_holds_interrupts_back_for_its_number_of_cycles(self) -> None:
        chip = Chip("disi #6\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
        chip.run(1)
        chip.request(INT0)
        at = chip.until("first")
        self.assertTrue(7 <= at - ENTRY <= 9, at)  # DISI, then 6 cycles, then the end of the present instruction

    def test_holds_back_to_the_cycle(self) -> None:
        for count in range(8):
            chip = Chip(f"disi #{count}\n" + "nop\n" * 12 + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
            chip.run(1)
            chip.request(INT0)
            self.assertEqual(1 + count + ENTRY, chip.until("first"))

    def test_holds_back_to_the_cycle_when_nothing_else_happens(self) -> None:
        for count in range(8):
            chip = Chip(f"disi #{count}\n" + "nop\n" * 12 + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
            chip.run(1)
            chip.request(INT0)
            chip.run(60)
            self.assertEqual(PROGRAM + 2 * (1 + count), chip[STACK_AT], "where it came")

    def test_disicnt_counts_down(self) -> None:
        chip = Chip("disi #5\n" + "nop\n" * 12 + MAIN)
        seen = []
        for cycle in range(1, 9):
            chip.run(cycle)
            seen.append((chip[0x52], chip[INTCON2] >> 14 & 1))
        self.assertEqual([(5, 1), (4, 1), (3, 1), (2, 1), (1, 1), (0, 0), (0, 0), (0, 0)], seen)

    def test_does_not_hold_back_priority_7(self) -> None:
        chip = Chip("disi #100\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 7)))
        chip.run(1)
        chip.request(INT0)
        self.assertLessEqual(chip.until("first"), 1 + ENTRY + 1)

    def test_its_bit_in_intcon2_tells_that_it_acts(self) -> None:
        chip = Chip("disi #4\n" + MAIN)
        chip.run(2)
        self.assertTrue(chip[INTCON2] & 1 << 14)
        self.assertIn(chip[0x52], (2, 3, 4))
        chip.run(12)
        self.assertFalse(chip[INTCON2] & 1 << 14)
        self.assertEqual(chip[0x52], 0)

    def test_writing_disicnt_0_ends_it(self) -> None:
        chip = Chip("disi #1000\n nop\n clr 0x52\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
        chip.request(INT0)
        self.assertLess(chip.until("first"), 3 + ENTRY + 5)


class Loops(unittest.TestCase):
    def test_repeat_is_interrupted_and_goes_on(self) -> None:
        chip = Chip("repeat #19\n r: inc w0,w0\n" + MAIN.replace("loop: inc w0,w0\n    inc w0,w0", "loop: nop"), {8 + INT0: "first"}, enable((INT0, 5)))
        chip.run(5)
        chip.request(INT0)
        chip.until("first")
        self.assertEqual(chip[STACK_AT], chip.labels["r"])
        self.assertTrue(chip[STACK_AT + 2] & 0x1000, "RA is stacked")
        self.assertFalse(chip[SR] & 0x10, "RA is clear in the handler")
        self.assertLess(chip.w[0], 20)
        chip.run(80)
        self.assertEqual((chip.w[0], chip.w[1]), (20, 1))

    def test_a_repeated_psv_read_waits_anew_after_an_interrupt(self) -> None:
        def cycles(interrupted: bool) -> int:
            chip = Chip("repeat #20\n mov [w5++],w6\n done: nop\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)) | {CORCON: 0x24}, w={5: 0x8200})
            chip.run(12)
            if interrupted:
                chip.request(INT0)
            return chip.until("done")
        self.assertEqual(1 + 21 + 2, cycles(False))
        self.assertEqual(1 + 21 + 2 + ENTRY + 1 + 1 + 3 + 1, cycles(True))

    def test_the_handlers_own_repeat_needs_rcount_kept(self) -> None:
        chip = Chip("""repeat #19
            inc w0,w0
            loop: bra loop
            .org 0x300
            h: push 0x36
            repeat #4
            inc w1,w1
            pop 0x36
            bclr 0x84,#0
            retfie""", {8 + INT0: "h"}, enable((INT0, 5)))
        chip.run(8)
        chip.request(INT0)
        chip.run(100)
        self.assertEqual((chip.w[0], chip.w[1], chip.w[15]), (20, 5, STACK_AT))

    def test_a_division_is_interrupted_and_goes_on(self) -> None:
        for at in range(1, 19):
            chip = Chip("repeat #17\n div.sd w2,w4\n" + MAIN.replace("inc w0,w0", "nop"), {8 + INT0: "first"}, enable((INT0, 5)),
                        w={2: 0x2500, 3: 0xFF42, 4: 0x2200})
            chip.run(at)
            chip.request(INT0)
            chip.run(80)
            # the handler counts in W1, which would be the remainder of what has been worked out so far
            self.assertEqual(chip.w[0] & 0xFFFF, 0xFA6B, f"at {at}")

    def test_the_end_of_do_may_lie_before_it(self) -> None:
        chip = Chip("b: nop\n do #2,b\n" + MAIN)
        chip.run(3)
        self.assertEqual((PROGRAM, 0), (chip[0x3E], chip[0x40]))

    def test_do_is_interrupted_and_goes_on(self) -> None:
        for at in range(1, 20):
            chip = Chip("do #4,l\n inc w5,w5\n l: inc w6,w6\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
            chip.run(at)
            chip.request(INT0)
            chip.run(60)
            self.assertEqual((chip.w[5], chip.w[6], chip.w[1]), (5, 5, 1), f"at {at}")


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


class Traps(unittest.TestCase):
    vectors = {OSCILLATOR: "trap", ADDRESS: "trap", STACK: "trap", MATH: "trap"}

    def expect(self, chip: Chip, error: int, vector: int, level: int, limit: int = 60) -> None:
        """The trap is taken, with its bit, vector and level."""
        chip.until("trap", limit)
        chip.run(chip.machine.registers().cycles + 2)
        self.assertEqual(chip[INTCON1] & error, error)
        self.assertEqual((chip.w[4] & 0x7F, chip.w[4] >> 8 & 15, chip.level), (vector - chip.machine.assumption("VECNUM_OFFSET") & 0x7F, level, level))

    def test_each_error_has_its_trap(self) -> None:
        for kind, (vector, level, cases) in ERRORS.items():
            for text, registers, w, acc, error in cases:
                with self.subTest(f"{kind}: {text}"):
                    chip = Chip(f"{text}\n nop\n nop\n" + MAIN, self.vectors, enable() | registers, w=w, acc=[acc, 0], sr=registers.get(SR, 0))
                    if kind != "none":
                        self.expect(chip, error, vector, level)
                    else:
                        chip.run(20)
                        self.assertEqual((chip[INTCON1] & ~COVTE, chip.w[3]), (0, 0))

    def test_a_divisor_of_zero_traps_in_the_first_turn(self) -> None:
        self.assertEqual(1, Chip.machine.assumption("DIVIDE_ZERO_FIRST_TURN"))
        chip = Chip("repeat #17\n div.s w2,w5\n nop\n" + MAIN, self.vectors, enable(), w={2: 100, 5: 0})
        self.assertLess(chip.until("trap"), 10)

    def test_an_accumulator_shift_beyond_16_is_a_math_error_and_changes_nothing(self) -> None:
        for shift in (17, 0xFFEF, 0x7FFF):
            chip = Chip("sftac a,w6\n nop\n nop\n" + MAIN, self.vectors, enable(), w={6: shift}, acc=[0x12345678, 0])
            self.expect(chip, MATHERR | SFTACERR, MATH, 11)
            self.assertEqual(chip.machine.registers().acc[0], 0x12345678)

    def test_a_failing_oscillator_traps_above_all(self) -> None:
        chip = Chip(vectors=self.vectors, registers=enable(), sr=7 << 5)
        chip.run(3)
        chip[INTCON1] |= OSCFAIL
        chip.machine.irq_changed()
        self.expect(chip, OSCFAIL, OSCILLATOR, 14)

    def test_a_handler_that_clears_the_error_returns(self) -> None:
        chip = Chip("repeat #17\n div.u w2,w5\n" + MAIN + "\n .org 0x3C0\n m: bclr 0x80,#4\n bclr 0x80,#6\n mov #1,w5\n inc w7,w7\n retfie",
                    {MATH: "m"}, enable(), w={2: 100, 5: 0})
        chip.run(100)
        self.assertEqual((chip.w[7], chip.level, chip.w[15], chip[INTCON1]), (1, 0, STACK_AT, 0))

    def test_a_soft_trap_waits_and_a_hard_one_does_not(self) -> None:
        delay = Chip.machine.assumption("SOFT_TRAP_DELAY_CYCLES")
        for text, cycles in (("sftac a,w6", 1 + delay + ENTRY), ("push w0", 1 + delay + ENTRY), ("mov [w5],w6", 1 + ENTRY)):
            with self.subTest(text):
                chip = Chip(text + "\n" + "nop\n" * 8 + MAIN, self.vectors, enable() | {SPLIM: 0x0A00},
                            w={5: 0x0901, 6: 17, 15: 0x0A02 if "push" in text else STACK_AT})
                self.assertEqual(cycles, chip.until("trap"))

    def test_a_trap_within_a_trap_returns_to_the_first_ones_level(self) -> None:
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
        self.assertEqual(13, chip.level)
        chip.run(chip.machine.registers().cycles + 10)
        self.assertEqual((11, 1), (chip.level, chip.w[7]))
        self.assertIn(chip.pc, (chip.labels["back"], chip.labels["back"] + 2))

    def test_the_alternate_table_is_used_for_traps_too(self) -> None:
        chip = Chip("mov [w5],w6\n nop\n nop\n" + MAIN, self.vectors, enable() | {INTCON2: ALTIVT}, w={5: 0x0901}, alternate=True)
        self.expect(chip, ADDRERR, ADDRESS, 13)


class Reports(unittest.TestCase):
    """Errors of a program that the chip would not tell."""

    def test_an_illegal_opcode_is_told_with_its_address(self) -> None:
        for word in (0xDB1234, 0xDC0000, 0xBF0000, 0x0A0000, 0x0B0000, 0xFC8000):
            self.assertIsNone(asm33.match(word), f"{word:06x}")
            with self.subTest(f"{word:06x}"):
                chip = Chip(f"nop\n .word24 {word:#x}\n" + MAIN)
                self.assertRegex(chip.run(20).lower(), "0*202")

    def test_erased_flash_is_told_with_its_address(self) -> None:
        chip = Chip("goto 0x1000\n" + MAIN)
        self.assertRegex(chip.run(20).lower(), "0*1000")

    def test_an_empty_vector_is_told(self) -> None:
        chip = Chip(registers=enable((INT0, 5)))
        chip.request(INT0)
        self.assertIn("vector", chip.run(20).lower())

    def test_a_division_that_is_not_repeated_17_times_is_told(self) -> None:
        for text in ("repeat #16\n div.s w2,w4", "div.s w2,w4", "repeat #18\n div.u w2,w4"):
            with self.subTest(text):
                chip = Chip(text + "\n" + MAIN, w={2: 100, 4: 7})
                self.assertRegex(chip.run(40).lower(), "divi")

    def test_a_register_never_written_that_addresses_memory_is_told(self) -> None:
        for text in ("mov [w5],w6", "mov w6,[w5++]", "mov [w5+2],w6", "mov w6,[w7+w5]", "tblrdl [w5],w6", "clr a,[w9],w6"):
            with self.subTest(text):
                chip = Chip("nop\n " + text.replace("w9", "w8") + "\n" + MAIN, w={5: 0x900, 7: 0x900, 8: 0x900})
                chip.machine.forget_w(8 if "w9" in text else 5)
                self.assertRegex(chip.run(20), "W[58].*0202")

    def test_a_register_written_before_is_none_of_them(self) -> None:
        chip = Chip("mov w7,w5\n nop\n mov [w5],w6\n inc w8,w8\n" + MAIN, w={7: 0x900})
        chip.machine.forget_w(5)
        self.assertEqual(chip.run(20), "")

    def test_prefetches_from_the_wrong_space_are_told(self) -> None:
        for text, w in (("clr a,[w8],w6", {8: 0xC00}), ("clr a,[w10],w6", {10: 0xBFE}), ("clr a,[w10],w6", {10: 0x8200}), ("ed w4*w4,a,[w8],[w10],w6", {8: 0xBFE, 10: 0x900})):
            with self.subTest(text):
                chip = Chip(f"{text}\n" + MAIN, w=w)
                self.assertRegex(chip.run(20).lower(), "space.*0*200")

    def test_program_memory_that_does_not_exist_is_told(self) -> None:
        chip = Chip("tblrdl [w5],w6\n" + MAIN, w={5: 0x5800})
        self.assertRegex(chip.run(20), "5800")
        for page, address in ((0x10, "080200"), (0xFF, "7F8200"), (0x01, "008200")):
            chip = Chip("mov [w5],w6\n" + MAIN, registers={CORCON: 0x24, 0x34: page}, w={5: 0x8200})
            self.assertRegex(chip.run(20), f"read at 0x{address}")

    def test_a_jump_beyond_the_flash_is_told_with_where_it_led(self) -> None:
        for text in ("goto 0x10200", "call 0x10200", "goto 0x7F0200", "goto 0x5800"):
            with self.subTest(text):
                chip = Chip(text + "\n" + MAIN)
                self.assertRegex(chip.run(20), "no flash.*" + text.split("0x")[1])

    def test_an_address_error_in_the_handler_of_a_failing_oscillator_resets(self) -> None:
        chip = Chip("nop\n" + MAIN + "\n .org 0x3C0\n h: mov #0x901,w5\n nop\n mov [w5],w6\n nop\n nop\n .org 0\n goto 0x204", {OSCILLATOR: "h", ADDRESS: "trap"}, enable())
        chip[INTCON1] = OSCFAIL
        chip.machine.irq_changed()
        chip.run(14)
        self.assertEqual((chip[RCON] & TRAPR, chip.level, chip.w[3]), (TRAPR, 0, 0))

    def test_ram_that_was_never_written_is_told_with_its_address(self) -> None:
        chip = Chip("nop\n mov 0x0A00,w6\n" + MAIN)
        chip.machine.forget(0x0A00)
        text = chip.run(20).lower()
        self.assertRegex(text, "0*202")
        self.assertRegex(text, "0*a00")

    def test_ram_that_was_never_written_is_told_once(self) -> None:
        chip = Chip("mov 0x0A00,w6\n mov 0x0A00,w6\n mov 0x0A02,w6\n" + MAIN)
        chip.machine.forget(0x0A00)
        chip.machine.forget(0x0A02)
        self.assertIn("0A00", chip.run(20))
        self.assertIn("0A02", chip.run(20))
        self.assertEqual("", chip.run(20))

    def test_ram_is_known_after_a_write_of_just_that_byte(self) -> None:
        chip = Chip("mov.b w0,[w5]\n mov.b [w5],w6\n mov.b [w7],w6\n" + MAIN, w={5: 0x0A00, 7: 0x0A01})
        chip.machine.forget(0x0A00)
        self.assertRegex(chip.run(20).lower(), "0*204")
