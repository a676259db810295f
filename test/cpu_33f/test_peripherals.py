"""The chip's peripherals, seen by programs of a few instructions."""

import os
import re
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from chip import FRC_FCY, PLL, RAM, REGISTERS, ROOT, STOP, PilBoard, asm33, board, library, pass_ms, run, switch # noqa: E402
from sample_image import NOBITS, PERSISTENT, WRITE, Sample, Section # noqa: E402

UART = """
    mov #0x743, w1
    mov #3, w0; mov w0, rpor9
    mov #0x8008, w0; mov #86, w1; mov w1, u1brg; mov w0, u1mode; bset u1sta, #10
"""
"""115200 baud at 40 MIPS, transmitter on RP18."""

TIMER = "clr tmr1; setm pr1; mov #0x8000, w0; mov w0, t1con\n"


class Resets(unittest.TestCase):
    LIVE = {"PORTA", "PORTB", "PORTC", "RCON", "OSCCON", "P1TMR", "IFS3"} # the fault input is tied to ground, which is active

    def test_every_register_has_its_value_after_power_on_and_after_a_reset(self) -> None:
        text = (ROOT / "tools/chip/chip_registers.h").read_text()
        table = {name: (int(address, 16), int(value, 16)) for name, address, value in re.findall(r"X\((\w+), (0x\w+), (0x\w+)\)", text)}
        peripherals = {name: row for name, row in table.items() if row[0] >= 0x60 and name not in self.LIVE}
        spoil = "btsc rcon, #6\nbra done\n" + "".join(f"com {address}\n" for address, _ in peripherals.values() if not 0x1C0 <= address < 0x200) + "reset\ndone: "
        for program in (STOP, spoil + STOP):
            chip = run(program, 1)
            wrong = [f"{name} {int(chip.get('reg.' + name)):04X}" for name, (_, value) in peripherals.items() if int(chip.get("reg." + name)) != value]
            self.assertEqual([], wrong)


class Memory(unittest.TestCase):
    """What an ELF file's names do for RAM that is read before anything has been written to it."""

    PROGRAM = f"mov {RAM + 0x10}, w0; mov {RAM + 0x12}, w1; mov {RAM + 0x22}, w2; mov w0, {RAM}; mov w1, {RAM + 2}\n" + STOP

    def chip(self) -> PilBoard:
        words, _ = asm33.assemble(self.PROGRAM, 0x200, REGISTERS)
        elf = Sample(words, {"_main": 0x200}, sections=[
            Section(".pbss", RAM + 0x10, b"", PERSISTENT, NOBITS, 8, [("_kept", RAM + 0x10, 4)]),
            Section(".bss", RAM + 0x20, b"", WRITE, NOBITS, 8, [("_array", RAM + 0x20, 4)])])
        path = Path(self.enterContext(tempfile.TemporaryDirectory())) / "x.elf"
        path.write_bytes(elf.elf())
        result = PilBoard(library, path)
        result.power_up()
        pass_ms(result, 1)
        return result

    def test_persistent_variables_hold_something_and_are_no_mistake(self) -> None:
        first, second = self.chip(), self.chip()
        self.assertEqual([first.peek(RAM), first.peek(RAM + 2)], [second.peek(RAM), second.peek(RAM + 2)], "every run begins alike")
        self.assertNotEqual(0, first.peek(RAM))
        self.assertEqual(1, len(first.warnings()), first.warnings())

    def test_any_other_is_told_with_address_and_names(self) -> None:
        self.assertEqual(["RAM read before it was written, 0x0822 (array+2), at 0x000204 (main+4)"], self.chip().warnings())

    def test_without_names_the_address_is_told(self) -> None:
        self.assertEqual(["RAM read before it was written, 0x0822, at 0x000200"], run(f"mov {RAM + 0x22}, w2\n" + STOP, 1).warnings())


class Clock(unittest.TestCase):
    def test_starts_on_the_fast_rc_oscillator(self) -> None:
        chip = run(STOP, 1)
        self.assertAlmostEqual(FRC_FCY * 1e-3, chip.get("cpu.cycles"), delta=3 + FRC_FCY * 51e-6)
        self.assertEqual(0, int(chip.get("reg.OSCCON")) >> 12)

    def test_switches_to_the_crystal_when_the_pll_has_locked(self) -> None:
        chip = board(PLL + STOP)
        pass_ms(chip, 1.5)
        self.assertEqual(0x0301, int(chip.get("reg.OSCCON")), "still waiting")
        pass_ms(chip, 0.3)
        self.assertEqual(0x3320, int(chip.get("reg.OSCCON")))
        before = chip.get("cpu.cycles")
        pass_ms(chip, 1)
        self.assertAlmostEqual(40000, chip.get("cpu.cycles") - before, delta=5)

    def test_nothing_happens_without_the_unlock_sequence(self) -> None:
        chip = run("mov #0x743, w1; mov #3, w0; mov.b w0, [w1]; bset osccon, #0\n" + STOP, 4)
        self.assertEqual(0x0000, int(chip.get("reg.OSCCON")))

    def test_the_keys_must_follow_each_other_at_once(self) -> None:
        for gap, osccon in (("nop;", 0x3320), ("nop; nop;", 0x0000)):
            slow = PLL.replace("mov.b w3, [w1]; mov.b w0, [w1]", f"mov.b w3, [w1]; {gap} mov.b w0, [w1]").split("pll_wait")[0]
            self.assertEqual(osccon, int(run(slow + STOP, 4).get("reg.OSCCON")), gap)

    def test_a_wrong_key_keeps_it_locked(self) -> None:
        wrong = PLL.replace("mov #0x57, w3", "mov #0x58, w3").split("pll_wait")[0]
        self.assertEqual(0x0300, int(run(wrong + STOP, 4).get("reg.OSCCON")), "the high byte was unlocked, the low one not")

    def test_a_crystal_that_is_switched_off_never_comes(self) -> None:
        chip = run(PLL + STOP, 6, FOSC=0x43)
        self.assertEqual(0, int(chip.get("reg.OSCCON")) >> 12)
        self.assertTrue(any("POSCMD" in text for text in chip.warnings()))

    def test_switching_can_be_forbidden(self) -> None:
        chip = run(PLL + STOP, 6, FOSC=0x81)
        self.assertEqual(0, int(chip.get("reg.OSCCON")) >> 12)

    def test_the_configuration_chooses_the_first_clock(self) -> None:
        chip = run(STOP, 1, FOSCSEL=2)
        self.assertAlmostEqual(4000, chip.get("cpu.cycles"), delta=210)


    def cycles_per_ms(self, program: str, ms: float = 20.0, **config: int) -> float:
        """Instruction clock in kHz after `ms` of the program."""
        chip = run(program + STOP, ms, **config)
        before, at_s = chip.get("cpu.cycles"), chip.get("time_s")
        pass_ms(chip, ms)
        return (chip.get("cpu.cycles") - before) / (chip.get("time_s") - at_s) / 1000

    def test_the_pll_has_a_divider_before_a_multiplier_and_a_divider_behind(self) -> None:
        frc_khz = 2 * FRC_FCY / 1000
        for clkdiv, pllfbd, factor in ((0x0040, 0x30, 50 / 2 / 4), (0x00C0, 0x30, 50 / 2 / 8), (0x0041, 0x30, 50 / 3 / 4), (0x0000, 0x20, 34 / 2 / 2),
                                       (0x00DE, 0x110, 274 / 32 / 8)):
            with self.subTest(clkdiv=clkdiv, pllfbd=pllfbd):
                got = self.cycles_per_ms(f"mov #{clkdiv}, w0; mov w0, clkdiv; mov #{pllfbd}, w0; mov w0, pllfbd\n", 5, FOSCSEL=1)
                self.assertAlmostEqual(frc_khz * factor / 2, got, delta=0.002 * frc_khz * factor)

    def test_a_pll_that_is_changed_while_it_is_the_clock_is_told(self) -> None:
        change = "mov #0x20, w0; mov w0, pllfbd\n"
        for program, source, told in ((change, 1, True), (change, 0, False), ("mov pllfbd, w0; mov w0, pllfbd\n", 1, False),
                                      ("mov #0x3000, w0; mov w0, clkdiv\n", 1, True), ("mov #0x3140, w0; mov w0, clkdiv\n", 1, False),
                                      (switch(0) + change, 1, False)):
            with self.subTest(program=program, source=source):
                warnings = run(program + STOP, FOSCSEL=source).warnings()
                self.assertEqual(told, any("while it is the clock" in text for text in warnings), warnings)

    def test_every_source_has_its_frequency(self) -> None:
        for source, khz in ((2, 4000), (4, 16.384), (5, 16), (6, FRC_FCY / 16e3), (7, FRC_FCY / 32e3)):
            with self.subTest(source=source):
                got = self.cycles_per_ms("mov #0x3540, w0; mov w0, clkdiv\n" + switch(source))
                self.assertAlmostEqual(khz, got, delta=0.01 * khz)

    def test_the_divided_rc_oscillator_has_eight_divisors(self) -> None:
        for bits, divisor in enumerate((1, 2, 4, 8, 16, 32, 64, 256)):
            with self.subTest(bits=bits):
                khz = FRC_FCY / 1000 / divisor
                self.assertAlmostEqual(khz, self.cycles_per_ms(f"mov #{bits << 8 | 0x3040}, w0; mov w0, clkdiv\n" + switch(7), 40), delta=0.02 * khz)

    def test_lock_tells_of_a_pll_only(self) -> None:
        self.assertEqual(0x2200, int(run(PLL + switch(2) + STOP, 5).get("reg.OSCCON")))
        self.assertEqual(0x1120, int(run(STOP, 5, FOSCSEL=1).get("reg.OSCCON")))

    def ready_ms(self, source: int, fosc: int) -> float:
        """When the clock has been switched, to a period of the board that runs without PWM."""
        chip = board(switch(source) + STOP, FOSC=fosc)
        while int(chip.get("reg.OSCCON")) >> 12 != source:
            chip.run(1)
        return chip.get("time_s") * 1000

    def test_after_power_on_a_pll_has_to_lock(self) -> None:
        chip = board(STOP, FOSCSEL=1)
        pass_ms(chip, 1.4)
        self.assertEqual(0x1100, int(chip.get("reg.OSCCON")))
        pass_ms(chip, 0.2)
        self.assertEqual(0x1120, int(chip.get("reg.OSCCON")))

    def test_software_cannot_set_the_failure_bit(self) -> None:
        self.assertEqual(0, int(run(Pins.UNLOCK.format(value=8) + STOP).get("reg.OSCCON")))

    def test_a_crystal_starts_for_1024_periods_and_then_the_pll_locks(self) -> None:
        crystal, external = 0x41, 0x40
        self.assertAlmostEqual(0.128, self.ready_ms(2, crystal), delta=0.06)
        self.assertAlmostEqual(0.0, self.ready_ms(2, external), delta=0.06)
        self.assertAlmostEqual(1.628, self.ready_ms(3, crystal), delta=0.06)
        self.assertAlmostEqual(1.5, self.ready_ms(3, external), delta=0.06)
        self.assertAlmostEqual(1.5, self.ready_ms(1, crystal), delta=0.06)

    def test_clklock_forbids_switching(self) -> None:
        chip = run("mov #0x742, w1; mov #0x46, w2; mov #0x57, w3; mov #0x80, w0; mov.b w2, [w1]; mov.b w3, [w1]; mov.b w0, [w1]\n" + switch(2) + STOP, 3)
        self.assertEqual(0x0080, int(chip.get("reg.OSCCON")))

    def test_clklock_forbids_a_switch_that_was_prepared(self) -> None:
        high, low = switch(2).split("\n", 1)
        locked = low.replace("#1, w0", "#0x80, w0")
        self.assertEqual(0x0280, int(run(f"{high}\n{locked}{low}" + STOP, 3).get("reg.OSCCON")))

    def test_a_reset_goes_on_with_the_running_clock(self) -> None:
        chip = run("btsc rcon, #6\nbra done\n" + PLL + f"reset\ndone: mov osccon, w0; mov w0, {RAM}\n" + STOP)
        self.assertEqual(0x3320, chip.peek(RAM))
        self.assertEqual(1, chip.get("cpu.resets"))


class Pins(unittest.TestCase):
    UNLOCK = "mov #0x742, w1; mov #0x46, w2; mov #0x57, w3; mov #{value}, w0; mov.b w2, [w1]; mov.b w3, [w1]; mov.b w0, [w1]\n"
    LOCKED = UNLOCK.format(value=0x40)
    OPEN = UNLOCK.format(value=0)
    SELECT = "mov #8, w0; mov w0, rpinr12\n"

    def test_selection_is_open_after_reset_and_obeys_the_lock(self) -> None:
        self.assertEqual(8, int(run(self.SELECT + STOP).get("reg.RPINR12")))
        self.assertEqual(0x1F, int(run(self.LOCKED + self.SELECT + STOP).get("reg.RPINR12")))
        self.assertEqual(8, int(run(self.LOCKED + self.OPEN + self.SELECT + STOP).get("reg.RPINR12")))

    def test_a_selection_has_five_bits(self) -> None:
        self.assertEqual(0x1F1F, int(run("setm rpinr18\n" + STOP).get("reg.RPINR18")))

    def test_the_configuration_may_give_the_pwm_its_pins_from_the_reset_on(self) -> None:
        self.assertEqual(0x0000, int(run(STOP, FPOR=0xF7).get("reg.PWM1CON1")))
        self.assertEqual(0x0077, int(run(STOP, FPOR=0x77).get("reg.PWM1CON1")))

    def test_every_selection_obeys_the_lock(self) -> None:
        names = [name for name in REGISTERS if name.startswith(("rpinr", "rpor"))]
        chip = run(self.LOCKED + "mov #0x0405, w0\n" + "".join(f"mov w0, {name}\n" for name in names) + STOP)
        self.assertEqual([], [name for name in names if int(chip.get("reg." + name.upper())) == 0x0405])
        chip = run("mov #0x0405, w0\n" + "".join(f"mov w0, {name}\n" for name in names) + STOP)
        self.assertEqual([], [name for name in names if int(chip.get("reg." + name.upper())) != 0x0405])

    def test_a_clock_switch_does_not_lock_the_selection(self) -> None:
        self.assertEqual(8, int(run(PLL + self.SELECT + STOP, FOSC=0x61).get("reg.RPINR12")))

    def test_pins_that_the_part_does_not_have_read_zero(self) -> None:
        for port, implemented in (("a", 0x079F), ("b", 0xFFFF), ("c", 0x03FF)):
            chip = run(f"setm ad1pcfgl; clr tris{port}; setm lat{port}; mov port{port}, w0; mov w0, {RAM}\n" + STOP)
            self.assertEqual(implemented, chip.peek(RAM))

    def test_the_lock_may_be_one_way(self) -> None:
        self.assertEqual(0x1F, int(run(self.LOCKED + self.OPEN + self.SELECT + STOP, FOSC=0x61).get("reg.RPINR12")))

    def test_latch_reaches_the_pin_and_the_port_reads_it(self) -> None:
        chip = run(f"bclr trisc, #6; bset latc, #6; mov portc, w0; mov w0, {RAM}\n" + STOP)
        self.assertEqual(1, chip.get("pin.RC6"))
        self.assertEqual(0x40, chip.peek(RAM) & 0x40)

    def test_a_button_is_read(self) -> None:
        chip = board(f"bset ad1pcfgl, #0\nagain: mov porta, w0; mov w0, {RAM}; bra again\n")
        pass_ms(chip, 1)
        self.assertEqual(0x100, chip.peek(RAM) & 0x100)
        chip.set("input.s2", 1)
        pass_ms(chip, 1)
        self.assertEqual(0, chip.peek(RAM) & 0x100)

    def test_analogue_pins_read_zero(self) -> None:
        program = f"mov #{{pins}}, w0; mov w0, ad1pcfgl; mov portb, w0; mov w0, {RAM}\n" + STOP
        self.assertEqual(0, run(program.format(pins=0)).peek(RAM) & 0x000F)
        self.assertEqual(0xF, run(program.format(pins=0x1FF)).peek(RAM) & 0x000F)

    def test_each_analogue_input_has_its_pin(self) -> None:
        """AN0 and 1 are RA0 and 1, AN2 to 5 RB0 to 3, AN6 to 8 RC0 to 2."""
        ports = [("porta", 0x3), ("portb", 0xF), ("portc", 0x7)]
        program = "mov #{pins}, w0; mov w0, ad1pcfgl\n" + "".join(f"mov {port}, w0; mov w0, {RAM + 2 * n}\n" for n, (port, _) in enumerate(ports)) + STOP
        for number in range(9):
            chip = run(program.format(pins=0x1FF & ~(1 << number)))
            low = [mask & ~chip.peek(RAM + 2 * n) for n, (_, mask) in enumerate(ports)]
            expected = [1 << number if number < 2 else 0, 1 << number - 2 if 2 <= number < 6 else 0, 1 << number - 6 if number >= 6 else 0]
            self.assertEqual(expected, low, f"AN{number}")

    def test_a_written_port_is_the_latch_and_a_warning(self) -> None:
        chip = run("bclr trisc, #6; bset portc, #6\n" + STOP)
        self.assertEqual(1, chip.get("pin.RC6"))
        self.assertTrue(any(text.startswith("PORTC:") for text in chip.warnings()))


class Timers(unittest.TestCase):
    def test_counts_instruction_cycles(self) -> None:
        chip = run(TIMER + f"repeat #98; nop; mov tmr1, w0; mov w0, {RAM}\n" + STOP)
        self.assertEqual(101, chip.peek(RAM), "REPEAT, 99 NOPs, MOV: the write of T1CON ends before the first")

    def test_prescaler(self) -> None:
        chip = run(TIMER.replace("0x8000", "0x8010") + f"repeat #798; nop; mov tmr1, w0; mov w0, {RAM}\n" + STOP)
        self.assertIn(chip.peek(RAM), (99, 100))

    def test_flag_comes_every_period_register_plus_one(self) -> None:
        loop = "{label}: btss ifs0, #3; bra {label}; bclr ifs0, #3; mov tmr2, w{n}\n"
        chip = run("mov #999, w0; mov w0, pr1; setm pr2; clr tmr1; clr tmr2; mov #0x8000, w0; mov w0, t2con; mov w0, t1con\n"
                   + loop.format(label="a", n=1) + "".join(loop.format(label=f"b{n}", n=3) for n in range(20))
                   + f"sub w3, w1, w3; mov w3, {RAM}\n" + STOP, 10)
        self.assertAlmostEqual(20000, chip.peek(RAM), delta=4)

    def test_every_prescaler(self) -> None:
        for bits, cycles in ((0, 1), (1, 8), (2, 64), (3, 256)):
            chip = run(TIMER.replace("0x8000", hex(0x8000 | bits << 4)) + f"repeat #5117; nop; mov tmr1, w0; mov w0, {RAM}\n" + STOP)
            self.assertAlmostEqual(5120 / cycles, chip.peek(RAM), delta=1, msg=f"1:{cycles}")

    def test_every_timer_has_its_flag(self) -> None:
        for number, bit in ((1, 3), (2, 7), (3, 8)):
            chip = run(f"clr ifs0; mov #99, w0; mov w0, pr{number}; clr tmr{number}; mov #0x8000, w0; mov w0, t{number}con\n" + STOP, 1)
            self.assertEqual(1 << bit, int(chip.get("reg.IFS0")) & 0x0188, f"timer {number}")

    def test_a_period_of_zero_gives_no_flag(self) -> None:
        chip = run("clr ifs0; clr pr1; clr tmr1; mov #0x8000, w0; mov w0, t1con\n" + STOP, 1)
        self.assertEqual(0, int(chip.get("reg.IFS0")) & 8)

    def test_beyond_its_period_register_a_timer_goes_round(self) -> None:
        chip = run("mov #0xFFF0, w0; mov #99, w1; mov w1, pr1; mov w0, tmr1; clr ifs0; setm pr2; clr tmr2; mov #0x8000, w0; mov w0, t2con; mov w0, t1con\n"
                   f"wait: btss ifs0, #3; bra wait; mov tmr2, w0; mov tmr1, w1; mov w0, {RAM}; mov w1, {RAM + 2}\n" + STOP)
        self.assertAlmostEqual(16 + 100, chip.peek(RAM), delta=5)
        self.assertLess(chip.peek(RAM + 2), 8)

    def test_a_timer_that_goes_round_shows_the_counts_between(self) -> None:
        chip = run("mov #0xFFF0, w0; mov #99, w1; mov w1, pr1; mov w0, tmr1; mov #0x8000, w0; mov w0, t1con\n"
                   f"repeat #60; nop; mov tmr1, w0; mov w0, {RAM}; repeat #139; nop; mov tmr1, w0; mov w0, {RAM + 2}\n" + STOP)
        self.assertEqual([63 - 16, 63 + 143 - 16 - 100], [chip.peek(RAM), chip.peek(RAM + 2)])

    def test_a_stopped_timer_keeps_its_count(self) -> None:
        chip = run(TIMER + "repeat #98; nop; bclr t1con, #15; repeat #98; nop; mov tmr1, w0; mov w0, 0x800\n" + STOP)
        self.assertAlmostEqual(101, chip.peek(RAM), delta=2)


class Uart(unittest.TestCase):
    def test_a_character_takes_ten_bits(self) -> None:
        chip = run(PLL + UART + TIMER + "mov #0x55, w0; mov w0, u1txreg\nwait: btss u1sta, #8; bra wait\n"
                   f"mov tmr1, w0; mov w0, {RAM}\n" + STOP)
        self.assertAlmostEqual(10 * 4 * 87, chip.peek(RAM), delta=8)
        self.assertEqual("U", chip.uart_take())
        self.assertAlmostEqual(114943, chip.get("uart.baud"), delta=1)

    def character_cycles(self, mode: int) -> int:
        return run(PLL + UART.replace("#0x8008", f"#{mode}") + TIMER + "mov #0x55, w0; mov w0, u1txreg\nwait: btss u1sta, #8; bra wait\n"
                   f"mov tmr1, w0; mov w0, {RAM}\n" + STOP).peek(RAM)

    def test_low_speed_has_sixteen_cycles_a_bit(self) -> None:
        self.assertAlmostEqual(10 * 16 * 87, self.character_cycles(0x8000), delta=8)

    def test_parity_and_a_second_stop_bit_take_a_bit_each(self) -> None:
        for bits, length in ((0b001, 11), (0b010, 11), (0b011, 12), (0b111, 12)):
            self.assertAlmostEqual(length * 4 * 87, self.character_cycles(0x8008 | bits), delta=8, msg=f"{bits:03b}")

    FLAGS = PLL + UART + "mov #{sta}, w0; mov w0, u1sta; clr ifs0\n"

    def flag_times(self, sta: int, characters: int) -> list[int]:
        """Characters that had left when U1TXIF came, after so many were written."""
        chip = run(self.FLAGS.format(sta=sta) + f"mov #{RAM}, w4; mov #0x41, w0; " + "mov w0, u1txreg; " * characters + "setm pr1; clr tmr1; mov #0x8000, w1; mov w1, t1con\n"
                   "again: btss ifs0, #12; bra again; mov tmr1, w0; bclr ifs0, #12; mov w0, [w4++]; bra again\n")
        return [round(chip.peek(RAM + 2 * n) / (40 * 87)) for n in range(characters) if chip.peek(RAM + 2 * n)]

    def test_the_transmitters_interrupt_comes_when_utxisel_says(self) -> None:
        self.assertEqual([0, 1, 2], self.flag_times(0x0400, 3), "each character that leaves the buffer")
        self.assertEqual([3], self.flag_times(0x2400, 3), "everything has left")
        self.assertEqual([0, 2], self.flag_times(0x8400, 3), "the buffer is empty")

    def test_enabling_the_transmitter_sets_its_flag(self) -> None:
        chip = run(PLL + "clr ifs0; mov #0x8008, w0; mov w0, u1mode\n" + f"mov ifs0, w1; mov w1, {RAM}; bset u1sta, #10; mov ifs0, w1; mov w1, {RAM + 2}\n" + STOP)
        self.assertEqual([0, 0x1000], [chip.peek(RAM) & 0x1000, chip.peek(RAM + 2) & 0x1000])

    def test_the_receivers_interrupt_comes_when_urxisel_says(self) -> None:
        for mode, count in ((0, 1), (1, 1), (2, 3), (3, 4)):
            chip = board(self.FLAGS.format(sta=0x400 | mode << 6) + "mov #20, w0; mov w0, rpinr18\n" + STOP)
            pass_ms(chip, 2)
            for received in range(1, 5):
                chip.uart_send("a")
                pass_ms(chip, 0.2)
                self.assertEqual(received >= count, bool(int(chip.get("reg.IFS0")) & 0x0800), f"URXISEL {mode}, {received} characters")

    def test_clearing_the_overrun_empties_the_receiver(self) -> None:
        chip = board(PLL + UART + "mov #20, w0; mov w0, rpinr18\nw: btss u1sta, #1; bra w; bclr u1sta, #1\n" + STOP)
        pass_ms(chip, 2)
        chip.uart_send("abcdef")
        pass_ms(chip, 1)
        self.assertEqual(1, int(chip.get("reg.U1STA")) & 3, "URXDA: the character behind the overrun")
        chip.uart_send("ghi")
        pass_ms(chip, 1)
        self.assertEqual(1, int(chip.get("reg.U1STA")) & 3, "three places were free")

    def test_one_character_on_the_line_and_four_waiting(self) -> None:
        chip = run(PLL + UART + "mov #0x41, w0\n" + f"mov w0, u1txreg; mov u1sta, w2; mov w2, {RAM}\n"
                   + "mov w0, u1txreg; mov w0, u1txreg; mov w0, u1txreg\n" + f"mov u1sta, w2; mov w2, {RAM + 2}\n"
                   + f"mov w0, u1txreg; mov u1sta, w2; mov w2, {RAM + 4}\n" + STOP)
        self.assertEqual([0, 0, 0x200], [chip.peek(RAM + n) & 0x200 for n in (0, 2, 4)])
        self.assertEqual("AAAAA", chip.uart_take())

    def test_a_sixth_character_is_lost_with_a_warning(self) -> None:
        chip = run(PLL + UART + "mov #0x41, w0\n" + "mov w0, u1txreg\n" * 6 + STOP)
        self.assertEqual("AAAAA", chip.uart_take())
        self.assertTrue(any("UTXBF" in text for text in chip.warnings()))

    def test_without_a_pin_nothing_leaves(self) -> None:
        chip = run(PLL + UART.replace("rpor9", f"{RAM}") + "mov #0x41, w0; mov w0, u1txreg\n" + STOP)
        self.assertEqual("", chip.uart_take())
        self.assertTrue(any(text.startswith("RPOR9") for text in chip.warnings()))

    def test_received_characters_arrive_in_order(self) -> None:
        chip = board(PLL + UART + f"mov #20, w0; mov w0, rpinr18; mov #{RAM}, w4\n"
                     "again: btss u1sta, #0; bra again; mov u1rxreg, w0; mov w0, [w4++]; bra again\n")
        pass_ms(chip, 2)
        chip.uart_send("xyz")
        pass_ms(chip, 1)
        self.assertEqual([ord(c) for c in "xyz"], [chip.peek(RAM + 2 * n) for n in range(3)])

    def test_characters_that_wait_are_read_in_order(self) -> None:
        chip = board(PLL + UART + f"mov #20, w0; mov w0, rpinr18; mov #{RAM}, w4; setm pr1; clr tmr1; mov #0x8030, w0; mov w0, t1con\n"
                     "wait: mov tmr1, w0; mov #300, w1; cp w0, w1; bra ltu, wait\nagain: btss u1sta, #0; bra again; mov u1rxreg, w0; mov w0, [w4++]; bra again\n".replace("bra ltu", "bra nc"))
        pass_ms(chip, 1.8)
        chip.uart_send("wxyz")
        pass_ms(chip, 4)
        self.assertEqual([ord(c) for c in "wxyz"], [chip.peek(RAM + 2 * n) for n in range(4)])

    def test_without_a_pin_nothing_arrives(self) -> None:
        chip = board(PLL + UART + STOP)
        pass_ms(chip, 2)
        chip.uart_send("x")
        pass_ms(chip, 1)
        self.assertEqual(0, int(chip.get("reg.U1STA")) & 1)
        self.assertTrue(any(text.startswith("RPINR18") for text in chip.warnings()))

    def test_an_unread_receiver_overruns(self) -> None:
        chip = board(PLL + UART + "mov #20, w0; mov w0, rpinr18\n" + STOP)
        pass_ms(chip, 2)
        chip.uart_send("abcdef")
        pass_ms(chip, 1)
        self.assertEqual(3, int(chip.get("reg.U1STA")) & 3, "OERR and URXDA")

    def test_loop_back(self) -> None:
        chip = run(PLL + UART + f"bset u1mode, #6; mov #0x5A, w0; mov w0, u1txreg\nw: btss u1sta, #0; bra w; mov u1rxreg, w0; mov w0, {RAM}\n" + STOP)
        self.assertEqual(0x5A, chip.peek(RAM))

    def test_on_a_pseudo_terminal(self) -> None:
        try:
            for end in os.openpty():
                os.close(end)
        except OSError as error:
            self.skipTest(f"this machine has no pseudo-terminals: {error}")
        chip = board(PLL + UART + "mov #20, w0; mov w0, rpinr18\nagain: btss u1sta, #0; bra again; mov u1rxreg, w0; inc w0, w0\n"
                     "mov w0, u1txreg; bra again\n")
        line = os.open(chip.terminal(), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            pass_ms(chip, 2)
            os.write(line, b"A")
            time.sleep(0.05)
            pass_ms(chip, 1)
            time.sleep(0.05)
            self.assertEqual(b"B", os.read(line, 10))
        finally:
            os.close(line)


class Watchdog(unittest.TestCase):
    ON = 0xC0 # FWDTEN, WINDIS, 1:32, 1:1: 1 ms
    COUNT = f"inc {RAM}; mov rcon, w0; mov w0, {RAM + 2}\n"

    def test_resets_a_program_that_does_not_serve_it(self) -> None:
        chip = run(self.COUNT + STOP, 10.5, FWDT=self.ON)
        self.assertEqual(10, chip.get("cpu.resets"))
        self.assertEqual(0x0010, chip.peek(RAM + 2) & 0x0010, "RCON.WDTO")

    def test_leaves_a_program_alone_that_serves_it(self) -> None:
        chip = run(self.COUNT + "again: clrwdt; bra again\n", 10, FWDT=self.ON)
        self.assertEqual(0, chip.get("cpu.resets"))
        self.assertEqual(3, chip.peek(RAM + 2), "RCON: power-on")

    def test_is_off_until_software_enables_it(self) -> None:
        self.assertEqual(0, run(STOP, 10, FWDT=0x40).get("cpu.resets"))
        self.assertGreater(run("bset rcon, #5\n" + STOP, 10, FWDT=0x40).get("cpu.resets"), 0)

    def test_what_software_enabled_a_reset_disables(self) -> None:
        self.assertEqual(1, run("btsc rcon, #4\nbra done\nbset rcon, #5\ndone: " + STOP, 10, FWDT=0x40).get("cpu.resets"))

    def test_postscaler(self) -> None:
        self.assertEqual(2, run(STOP, 10, FWDT=self.ON | 2).get("cpu.resets"))

    def test_prescaler(self) -> None:
        self.assertEqual(2, run(STOP, 10, FWDT=self.ON | 0x10).get("cpu.resets"))

    def test_with_a_window_serving_it_too_early_resets(self) -> None:
        serve = "mov #7370, w0\nagain: repeat {wait}; nop; clrwdt; bra again\n"
        window = self.ON & ~0x40
        self.assertGreater(run(serve.format(wait="#2000"), 10, FWDT=window).get("cpu.resets"), 10, "every 0.54 ms")
        self.assertEqual(0, run(serve.format(wait="#3300"), 10, FWDT=window).get("cpu.resets"), "every 0.9 ms")
        self.assertEqual(0, run(serve.format(wait="#2000"), 10, FWDT=self.ON).get("cpu.resets"), "without a window")

    def test_wakes_a_sleeping_core_without_a_reset(self) -> None:
        for mode in (0, 1):
            chip = run(f"clr {RAM}\nagain: pwrsav #{mode}; inc {RAM}; mov rcon, w0; mov w0, {RAM + 2}; bra again\n", 10.5, FWDT=self.ON)
            self.assertEqual(0, chip.get("cpu.resets"))
            self.assertEqual(10, chip.peek(RAM))
            self.assertEqual(0x0010, chip.peek(RAM + 2) & 0x0010, "RCON.WDTO")

    def test_what_the_core_resets_for_is_told_in_rcon(self) -> None:
        program = f"mov rcon, w0; mov w0, {RAM}; mov #0xC000, w1; and w0, w1, w1\nbra nz, done\n{{cause}}\ndone: " + STOP
        conflict = "mov #0x900, w15; bset 0x80, #1; nop; nop\nbra done"
        handler = "\n.org 0x1000\nhandler: mov #0x801, w2; mov [w2], w3; bra handler\n.org 0x6\n.word24 0x001000\n"
        for cause, bit in ((".word24 0xFD8010", 0x4000), ("mov [w9], w0", 0x4000), (conflict, 0x8000)):
            with self.subTest(cause):
                chip = run(program.format(cause=cause) + handler, 1)
                self.assertEqual(bit, chip.peek(RAM) & 0xC000)
                self.assertEqual(1, chip.get("cpu.resets"))

    def test_its_time_does_not_follow_the_clock(self) -> None:
        self.assertEqual(2, run(PLL + STOP, 10, FWDT=self.ON | 2).get("cpu.resets"))

    def test_a_reset_instruction_says_so(self) -> None:
        chip = run("btsc rcon, #6\nbra done\nreset\ndone: " + f"mov rcon, w0; mov w0, {RAM}\n" + STOP)
        self.assertEqual(1, chip.get("cpu.resets"))
        self.assertEqual(0x43, chip.peek(RAM), "what nobody has cleared is still there")


class Pwm(unittest.TestCase):
    START = PLL + "mov #999, w0; mov w0, p1tper; setm pr1; clr tmr1; mov #0x8002, w0; mov #0x8000, w1; mov w1, t1con; mov w0, p1tcon\n"

    def counter_after(self, cycles: int) -> tuple[int, int]:
        chip = run(self.START + f"repeat #{cycles}; nop; mov p1tmr, w2; mov tmr1, w3; mov w2, {RAM}; mov w3, {RAM + 2}\n" + STOP)
        return chip.peek(RAM), chip.peek(RAM + 2)

    def test_counter_goes_up_then_down_with_the_direction_bit(self) -> None:
        for cycles in (10, 500, 900, 1100, 1500, 1900, 2200, 3500):
            counter, timer = self.counter_after(cycles)
            passed = (timer - 2) % 2000 # TMR1 is read an instruction later and was started one earlier
            expected = passed if passed < 1000 else 0x8000 | (2000 - passed)
            self.assertAlmostEqual(expected, counter, delta=1, msg=f"{cycles} cycles")

    def test_override_acts_at_once(self) -> None:
        chip = run(self.START.replace("mov #0x8002", "mov #0x77, w1; mov w1, pwm1con1; clr p1ovdcon; mov #0x8002")
                   + "mov #0x15, w0; mov w0, p1ovdcon\n" + STOP)
        self.assertEqual(0x15, chip.get("pwm.outputs_on"))

    def test_override_acts_within_a_period(self) -> None:
        chip = run(self.START.replace("mov #0x8002", "mov #0x77, w1; mov w1, pwm1con1; clr p1ovdcon; mov #0x8002")
                   + "mov #0x15, w1\nagain: mov w1, p1ovdcon; repeat #199; nop; clr p1ovdcon; repeat #3000; nop; bra again\n")
        seen = []
        for _ in range(32):
            chip.run(1)
            seen.append(int(chip.get("pwm.outputs_seen")))
        self.assertEqual({0x00, 0x15}, set(seen))
        self.assertGreater(seen.count(0x15), 16, "a pulse of 5 us every 80 us is in more than half of the periods")


class Adc(unittest.TestCase):
    SETUP = Pwm.START.replace("mov #0x8002, w0;", """mov #0x836C, w0; mov #0x0200, w1; mov #2, w2; mov #8, w3; mov w1, ad1con2; mov w2, ad1con3
        mov w3, ad1chs0; mov #0xFEF8, w3; mov w3, ad1pcfgl; mov w0, ad1con1
        mov #{trigger}, w0; mov w0, p1secmp; bclr ifs0, #13; mov #0x8002, w0;""")
    WAIT = f"wait: btss ifs0, #13; bra wait; mov tmr1, w0; mov w0, {RAM}; mov adc1buf0, w0; mov w0, {RAM + 2}\n" + STOP

    def finished_at(self, trigger: int) -> int:
        return run(self.SETUP.format(trigger=trigger) + self.WAIT).peek(RAM)

    def test_four_conversions_take_144_cycles_from_the_trigger(self) -> None:
        self.assertAlmostEqual(400 + 4 * 12 * 3, self.finished_at(400), delta=6)

    def test_the_interrupt_can_be_held_up(self) -> None:
        chip = board(self.SETUP.format(trigger=400) + self.WAIT)
        chip.set("cpu.isr_us", 13 + 20)
        pass_ms(chip, 5)
        self.assertAlmostEqual(400 + 144 + 800, chip.peek(RAM), delta=6)

    def test_an_interrupt_held_up_for_longer_than_a_period_loses_samples(self) -> None:
        chip = board(self.SETUP.format(trigger=400) + self.WAIT)
        chip.set("cpu.isr_us", 13 + 60)
        pass_ms(chip, 5)
        self.assertAlmostEqual((400 + 144 + 2400) & 0xFFFF, chip.peek(RAM), delta=6)
        self.assertTrue(any("cpu.isr_us" in text for text in chip.warnings()))

    def test_special_event_counting_down(self) -> None:
        self.assertAlmostEqual(2000 - 400 + 144, self.finished_at(0x8000 | 400), delta=6)

    def test_result_is_the_potentiometer(self) -> None:
        chip = board(self.SETUP.format(trigger=400) + self.WAIT)
        chip.set("input.pot", 0.75)
        chip.set("adc.noise_lsb", 0)
        pass_ms(chip, 5)
        self.assertEqual(0x4000, chip.peek(RAM + 2), "three quarters, signed fractional")

    def test_an_interrupt_is_entered_and_counted(self) -> None:
        handler = "bclr ifs0, #13; inc 0x804; mov w0, p1dc3; retfie\n"
        enable = "mov #0x40, w5; mov w5, ipc3; bset iec0, #13\n"
        chip = run("mov #0x900, w15; mov #0xFF0, w0; mov w0, splim; clr 0x804\n" + self.SETUP.format(trigger=400) + enable + STOP
                   + "\n.org 0x1000\n" + handler + ".org 0x2E\n.word24 0x001000\n", 12)
        self.assertGreater(chip.peek(RAM + 4), 100)
        self.assertAlmostEqual(chip.peek(RAM + 4), chip.get("cpu.isr_count"), delta=1)
        self.assertLess(chip.get("cpu.isr_cycles_max"), 20)
        self.assertAlmostEqual(144 + 10, chip.get("cpu.latency_cycles_mean"), delta=8)
        chip.set("cpu.isr_reset", 1)
        self.assertEqual(0, chip.get("cpu.isr_count"))
