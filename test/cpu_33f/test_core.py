"""What the core offers to those around it: resets, low power, register hooks, reports, profile, stack, program memory."""

import ctypes
import unittest

from machine import PROGRAM
from test_interrupts import ENTRY, INT0, MAIN, STACK_AT, Chip, enable
from test_vectors import differences
from vectors import FOLDER, read

RCON = 0x740
SWR = 1 << 6
IDLE, SLEEP = 1, 2
READ = ctypes.CFUNCTYPE(ctypes.c_uint16, ctypes.c_void_p, ctypes.c_uint16)
WRITE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16, ctypes.c_uint16)
RESET = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int)
SYMBOL = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_bool, ctypes.c_uint32, ctypes.POINTER(ctypes.c_uint32))
MARK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64)
NOTHING = ctypes.c_void_p()


class Hooks(unittest.TestCase):
    address = 0x2C0

    def accesses(self, text: str, value: int = 0x1234) -> list[tuple]:
        """Reads and writes that a hook on 02C0 sees while a program runs."""
        chip = Chip(text + "\n" + MAIN, w={0: 0xABCD, 5: self.address, 6: self.address + 1})
        seen = []
        read = READ(lambda context, address: (seen.append(("read", address)), value)[1])
        write = WRITE(lambda context, address, new, mask: seen.append(("write", address, new & mask, mask)))
        library, core = chip.machine.library, chip.machine.core
        library.iss_sfr_hook(core, ctypes.c_uint16(self.address), read, write, NOTHING)
        try:
            chip.run(text.count("\n") + 1)
        finally:
            library.iss_sfr_hook(core, ctypes.c_uint16(self.address), READ(), WRITE(), NOTHING)
        self.chip = chip
        return seen

    def test_see_words_and_bytes_with_the_bits_that_count(self) -> None:
        at = self.address
        self.assertEqual(self.accesses("mov w0,0x2C0"), [("write", at, 0xABCD, 0xFFFF)])
        self.assertEqual(self.accesses("mov.b wreg,0x2C0"), [("write", at, 0x00CD, 0x00FF)])
        self.assertEqual(self.accesses("mov.b wreg,0x2C1"), [("write", at, 0xCD00, 0xFF00)])
        self.assertEqual(self.accesses("mov w0,[w5]"), [("write", at, 0xABCD, 0xFFFF)])
        self.assertEqual(self.accesses("mov.b w0,[w6]"), [("write", at, 0xCD00, 0xFF00)])
        self.assertEqual(self.accesses("clr 0x2C0"), [("write", at, 0, 0xFFFF)])
        self.assertEqual(self.accesses("setm.b 0x2C1"), [("write", at, 0xFF00, 0xFF00)])

    def test_give_what_is_read(self) -> None:
        self.assertEqual(self.accesses("mov 0x2C0,w1"), [("read", self.address)])
        self.assertEqual(self.chip.w[1], 0x1234)
        self.assertEqual(self.accesses("mov.b [w6],w1"), [("read", self.address)])
        self.assertEqual(self.chip.w[1], 0x12)
        self.assertEqual(self.accesses("btst 0x2C0,#2"), [("read", self.address)])

    def test_see_a_read_and_a_write_of_an_instruction_that_changes_bits(self) -> None:
        at = self.address
        for text, wanted in (("bset 0x2C0,#0", 0x1235), ("bclr 0x2C0,#12", 0x0234), ("btg 0x2C0,#15", 0x9234), ("inc 0x2C0", 0x1235), ("ior 0x2C0", 0xBBFD)):
            with self.subTest(text):
                seen = self.accesses(text)
                self.assertEqual([access[0] for access in seen], ["read", "write"])
                new, mask = seen[1][2:]
                self.assertEqual((0x1234 & ~mask | new, seen[1][1]), (wanted, at))


class Resets(unittest.TestCase):
    def test_reset_instruction_starts_at_0_and_is_told_in_rcon(self) -> None:
        chip = Chip("reset\n" + MAIN + "\n .org 0x0\n goto 0x202")
        chip.run(1)
        self.assertEqual((chip.pc, chip[RCON] & SWR), (0, SWR))

    def test_a_hook_takes_the_reset(self) -> None:
        chip = Chip("reset\n" + MAIN)
        causes = []
        hook = RESET(lambda context, cause: causes.append(cause))
        chip.machine.library.iss_on_reset(chip.machine.core, hook, NOTHING)
        try:
            chip.run(1)
        finally:
            chip.machine.library.iss_on_reset(chip.machine.core, RESET(), NOTHING)
        self.assertEqual(causes, [3])

    def test_core_registers_have_their_reset_values(self) -> None:
        chip = Chip()
        chip.machine.library.iss_reset(chip.machine.core, 0)
        self.assertEqual((chip.pc, chip.w[15], chip[0x44], chip[0x42], chip[0x52], chip[0x46], chip[0x50] & 0x8000), (0, 0x800, 0x20, 0, 0, 0, 0))


    def test_ram_is_unknown_after_power_on_only(self) -> None:
        for cause, known in ((0, False), (1, False), (2, True), (3, True), (4, True), (5, True), (6, True)):
            with self.subTest(cause=cause):
                chip = Chip(MAIN + "\n .org 0x0\n goto 0x400\n .org 0x400\n mov 0x0A00,w6\n again: bra again")
                chip.machine.library.iss_reset(chip.machine.core, cause)
                self.assertEqual(known, chip.run(chip.machine.registers().cycles + 8) == "")


class Power(unittest.TestCase):
    def test_idle_waits_for_an_interrupt(self) -> None:
        chip = Chip("pwrsav #1\n w: inc w5,w5\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
        chip.run(50)
        self.assertEqual((chip.w[5], chip.w[0]), (0, 0))
        self.assertGreaterEqual(chip.machine.registers().cycles, 50)
        chip.request(INT0)
        chip.run(120)
        self.assertEqual((chip.w[1], chip.w[5]), (1, 1))

    def test_an_interrupt_below_the_cpus_priority_wakes_without_a_handler(self) -> None:
        chip = Chip("pwrsav #1\n inc w5,w5\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 2)), sr=4 << 5)
        chip.run(20)
        chip.request(INT0)
        chip.run(60)
        self.assertEqual((chip.w[1], chip.w[5]), (0, 1))

    def test_idle_takes_one_cycle_to_enter_and_its_cycles_are_counted(self) -> None:
        chip = Chip("pwrsav #1\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
        library, core = chip.machine.library, chip.machine.core
        chip.run(1)
        self.assertEqual((chip.machine.registers().cycles, library.iss_power(core)), (1, IDLE))
        chip.run(51)
        chip.request(INT0)
        chip.run(51 + ENTRY)
        self.assertEqual((chip.pc, chip[STACK_AT], library.iss_power(core)), (chip.labels["first"], PROGRAM + 2, 0))

    def test_sleep_is_told_and_ends_when_somebody_wakes_it(self) -> None:
        chip = Chip("pwrsav #0\n inc w5,w5\n" + MAIN)
        library, core = chip.machine.library, chip.machine.core
        chip.run(10)
        self.assertEqual((library.iss_power(core), chip.w[5]), (SLEEP, 0))
        library.iss_wake(core)
        chip.run(11)
        self.assertEqual((library.iss_power(core), chip.w[5]), (0, 1))


class Observation(unittest.TestCase):
    def test_the_profile_counts_instructions_and_cycles_of_each_address(self) -> None:
        chip = Chip("mov #5,w5\n l: dec w5,w5\n b: bra nz,l\n" + MAIN, w={5: 0})
        library, core = chip.machine.library, chip.machine.core
        library.iss_profile_counts.restype = ctypes.POINTER(ctypes.c_uint32)
        library.iss_profile_cycles.restype = ctypes.POINTER(ctypes.c_uint64)
        self.assertTrue(library.iss_profile(core, True) & 1)
        chip.run(1 + 5 + 9)
        at = chip.labels["b"] // 2
        counts, cycles = library.iss_profile_counts(core), library.iss_profile_cycles(core)
        self.assertEqual((counts[at - 1], cycles[at - 1], counts[at], cycles[at], counts[at + 1]), (5, 5, 5, 9, 0))
        library.iss_profile(core, False)

    def test_hooks_tell_of_interrupts(self) -> None:
        chip = Chip(vectors={8 + INT0: "first"}, registers=enable((INT0, 5)))
        library, core = chip.machine.library, chip.machine.core
        seen = []
        enter = MARK(lambda context, vector, cycle: seen.append(("enter", vector, cycle)))
        leave = MARK(lambda context, vector, cycle: seen.append(("leave", vector, cycle)))
        library.iss_on_interrupt(core, enter, leave, NOTHING)
        try:
            chip.run(1)
            chip.request(INT0)
            chip.run(40)
        finally:
            library.iss_on_interrupt(core, MARK(), MARK(), NOTHING)
        self.assertEqual(seen, [("enter", 8 + INT0, 1), ("leave", 8 + INT0, 1 + ENTRY + 5)])

    def test_clrwdt_is_told(self) -> None:
        self.assertEqual(self.cleared("clrwdt\n nop\n clrwdt\n"), [1, 3])

    def test_pwrsav_clears_the_watchdog_too(self) -> None:
        self.assertEqual(self.cleared("nop\n pwrsav #0\n"), [2])
        self.assertEqual(self.cleared("nop\n pwrsav #1\n"), [2])

    def cleared(self, text: str) -> list[int]:
        """Cycles at which the watchdog was cleared in the first three."""
        chip = Chip(text + MAIN)
        cleared = []
        hook = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(lambda context: cleared.append(chip.machine.registers().cycles))
        chip.machine.library.iss_on_clrwdt(chip.machine.core, hook, NOTHING)
        try:
            chip.run(3)
        finally:
            chip.machine.library.iss_on_clrwdt(chip.machine.core, None, NOTHING)
        return cleared

    def test_program_written_through_the_pointer_is_decoded_when_told(self) -> None:
        chip = Chip("l: inc w5,w5\n bra l")
        library, core = chip.machine.library, chip.machine.core
        library.iss_program.restype = ctypes.POINTER(ctypes.c_uint32)
        library.iss_program(core)[PROGRAM // 2] = 0xE90285  # dec w5,w5
        library.iss_program_changed(core)
        chip.run(1)
        self.assertEqual(chip.w[5], 0xFFFF)

    def test_program_memory_ends_where_the_chips_does(self) -> None:
        chip = Chip()
        library, core = chip.machine.library, chip.machine.core
        library.iss_write_program.restype = ctypes.c_bool
        for address, exists in ((0x57FE, True), (0x5800, False), (0xF7FFFE, False), (0xF80000, True), (0xF80016, True), (0xF80018, False)):
            with self.subTest(f"{address:06x}"):
                self.assertEqual(library.iss_write_program(core, ctypes.c_uint32(address), ctypes.c_uint32(0x123456)), exists)
                library.iss_write_program(core, ctypes.c_uint32(address), ctypes.c_uint32(0xFFFFFF))

    def test_nothing_changes_while_the_profile_is_on(self) -> None:
        machine = Chip().machine
        machine.library.iss_profile(machine.core, True)
        wrong = [f"{vector}: {found}" for name in ("flow.txt", "cycles.txt") for vector in read(FOLDER / name) if (found := differences(vector, machine, 0))]
        machine.library.iss_profile(machine.core, False)
        self.assertEqual(wrong, [])

    def test_the_stack_is_watched(self) -> None:
        chip = Chip("mov #0x900,w15\n push w0\n push w0\n pop w0\n pop w0\n" + MAIN)
        chip.machine.library.iss_stack_clear(chip.machine.core)
        chip.run(12)
        self.assertEqual((chip.machine.library.iss_stack_bytes(chip.machine.core), chip.w[15]), (4, STACK_AT))

    def test_the_deepest_stack_counts_every_word_and_frame(self) -> None:
        for text, wanted in (("push w0\n pop w0\n", 2), ("lnk #20\n ulnk\n", 22), ("lnk #20\n push w0\n pop w0\n ulnk\n", 24),
                             ("mov.d w0,[w15++]\n nop\n", 4), ("rcall f\n bra e\n f: return\n e: nop\n", 4)):
            with self.subTest(text):
                chip = Chip("mov #0x900,w15\n " + text + MAIN)
                chip.machine.library.iss_stack_clear(chip.machine.core)
                chip.run(14)
                self.assertEqual(wanted, chip.machine.library.iss_stack_bytes(chip.machine.core))

    def test_reports_name_the_symbol(self) -> None:
        chip = Chip("nop\n .word24 0xDB0000\n" + MAIN)
        start = ctypes.create_string_buffer(b"_start")
        name = SYMBOL(lambda context, data, address, offset: (offset.__setitem__(0, address - 0x200), ctypes.addressof(start))[1])
        chip.machine.library.iss_on_symbol(chip.machine.core, name, NOTHING)
        try:
            text = chip.run(20)
        finally:
            chip.machine.library.iss_on_symbol(chip.machine.core, SYMBOL(), NOTHING)
        self.assertIn("_start", text)
        self.assertRegex(text.lower(), "0*202")

    def test_changed_program_memory_is_decoded_anew(self) -> None:
        chip = Chip("l: inc w5,w5\n bra l")
        chip.run(9)
        chip.machine.load({PROGRAM: 0xE90285, PROGRAM + 2: 0x37FFFE})  # dec w5,w5
        before = chip.w[5]
        chip.run(12)
        self.assertEqual(chip.w[5], before - 1)

    def test_interrupt_latency_is_the_same_for_all_moments(self) -> None:
        for at in range(1, 12):
            chip = Chip("l: nop\n nop\n nop\n nop\n bra l\n" + MAIN, {8 + INT0: "first"}, enable((INT0, 5)))
            chip.run(at)
            now = chip.machine.registers().cycles
            chip.request(INT0)
            self.assertEqual(chip.until("first"), now + ENTRY)
