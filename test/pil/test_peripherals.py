"""The chip's peripherals, seen by programs of a few instructions."""

import os
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from chip import FRC_FCY, PLL, RAM, REGISTERS, STOP, PilBoard, asm33, board, library, pass_ms, run # noqa: E402
from sample_image import Elf, Section # noqa: E402

UART = """
    mov #0x743, w1
    mov #3, w0; mov w0, rpor9
    mov #0x8008, w0; mov #86, w1; mov w1, u1brg; mov w0, u1mode; bset u1sta, #10
"""
"""115200 baud at 40 MIPS, transmitter on RP18."""

TIMER = "clr tmr1; setm pr1; mov #0x8000, w0; mov w0, t1con\n"


class Names(unittest.TestCase):
    def test_every_register_of_the_part_that_the_host_has_is_the_chips(self) -> None:
        absent = {"IFS2", "IEC2", "IPC6", *(f"IPC{n}" for n in range(8, 14)), "IPC17", "CRCCON", *(f"RPINR{n}" for n in (2, 4, 5, 6, 8, 9, 16, 17, 19))}
        header = (Path(__file__).resolve().parents[2] / "tools/host/xc.h").read_text()
        import re
        host = set(re.findall(r"X\((\w+), 0x\w+\)", header))
        self.assertEqual(absent, {name for name in host if name.lower() not in REGISTERS})


class Memory(unittest.TestCase):
    """What an ELF file's names do for RAM that is read before anything has been written to it."""

    PERSISTENT, NOBITS = 0x02000003, 8
    PROGRAM = f"mov {RAM + 0x10}, w0; mov {RAM + 0x12}, w1; mov {RAM + 0x22}, w2; mov w0, {RAM}; mov w1, {RAM + 2}\n" + STOP

    def chip(self) -> PilBoard:
        words, _ = asm33.assemble(self.PROGRAM, 0x200, REGISTERS)
        elf = Elf()
        elf.sections = [Section(".reset", 0, [0x040200, 0]), Section(".text", 0x200, [words[pc] for pc in sorted(words)]),
                        Section(".pbss", RAM + 0x10, [0], self.PERSISTENT, self.NOBITS), Section(".bss", RAM + 0x20, [0], 3, self.NOBITS)]
        elf.symbols = [("_main", 0x200, 0, 0x12, 2), ("_kept", RAM + 0x10, 4, 0x11, 3), ("_array", RAM + 0x20, 4, 0x11, 4)]
        path = Path(self.enterContext(tempfile.TemporaryDirectory())) / "x.elf"
        path.write_bytes(elf.bytes())
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
        slow = PLL.replace("mov.b w3, [w1]; mov.b w0, [w1]", "mov.b w3, [w1]; nop; nop; mov.b w0, [w1]").split("pll_wait")[0]
        self.assertEqual(0x0000, int(run(slow + STOP, 4).get("reg.OSCCON")))

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


class Pins(unittest.TestCase):
    UNLOCK = "mov #0x742, w1; mov #0x46, w2; mov #0x57, w3; mov #{value}, w0; mov.b w2, [w1]; mov.b w3, [w1]; mov.b w0, [w1]\n"
    LOCKED = UNLOCK.format(value=0x40)
    OPEN = UNLOCK.format(value=0)
    SELECT = "mov #8, w0; mov w0, rpinr12\n"

    def test_selection_is_open_after_reset_and_obeys_the_lock(self) -> None:
        self.assertEqual(8, int(run(self.SELECT + STOP).get("reg.RPINR12")))
        self.assertEqual(0x1F, int(run(self.LOCKED + self.SELECT + STOP).get("reg.RPINR12")))
        self.assertEqual(8, int(run(self.LOCKED + self.OPEN + self.SELECT + STOP).get("reg.RPINR12")))

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

    def test_postscaler(self) -> None:
        self.assertEqual(2, run(STOP, 10, FWDT=self.ON | 2).get("cpu.resets"))

    def test_its_time_does_not_follow_the_clock(self) -> None:
        self.assertEqual(2, run(PLL + STOP, 10, FWDT=self.ON | 2).get("cpu.resets"))

    def test_a_reset_instruction_says_so(self) -> None:
        chip = run("btsc rcon, #6\nbra done\nreset\ndone: " + f"mov rcon, w0; mov w0, {RAM}\n" + STOP)
        self.assertEqual(1, chip.get("cpu.resets"))
        self.assertEqual(0x40, chip.peek(RAM) & 0x40)


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


if __name__ == "__main__":
    unittest.main()
