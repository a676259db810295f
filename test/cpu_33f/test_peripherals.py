"""The chip's peripherals, seen by programs of a few instructions."""

import os
import re
import time
from pathlib import Path

import pytest
from pytest import approx

from chip import FRC_FCY, PLL, RAM, REGISTERS, ROOT, STOP, UNLOCK, PilBoard, asm33, board, library, pass_ms, run, switch
from sample_image import NOBITS, PERSISTENT, WRITE, Sample, Section

# 115200 baud at 40 MIPS, transmitter on RP18.
UART = """
    mov #0x743, w1
    mov #3, w0; mov w0, rpor9
    mov #0x8008, w0; mov #86, w1; mov w1, u1brg; mov w0, u1mode; bset u1sta, #10
"""
RECEIVER = "mov #20, w0; mov w0, rpinr18\n"
TIMER = "clr tmr1; setm pr1; mov #0x8000, w0; mov w0, t1con\n"
ON = 0xC0 # FWDTEN, WINDIS, 1:32, 1:1: 1 ms
COUNT = f"inc {RAM}; mov rcon, w0; mov w0, {RAM + 2}\n"
SERVE = "mov #7370, w0\nagain: repeat {wait}; nop; clrwdt; bra again\n"
WATCHDOG_SLEEP = f"clr {RAM}\nagain: pwrsav #{{mode}}; inc {RAM}; mov rcon, w0; mov w0, {RAM + 2}; bra again\n"
ONCE = "btsc rcon, #6\nbra done\n" # what follows it is not done after a RESET instruction
LOCK_PINS, OPEN_PINS = UNLOCK.format(value=0x40), UNLOCK.format(value=0)
SELECT = "mov #8, w0; mov w0, rpinr12\n"
KEYS = PLL.split("pll_wait")[0]
CHANGE_PLL = "mov #0x20, w0; mov w0, pllfbd\n"
WARNED = "warning" # of an expectation: part of a warning of the board


def told(chip: PilBoard, text: str) -> bool:
    return any(text in warning for warning in chip.warnings())


def keys_with(between: str) -> str:
    """The unlock sequence of the PLL with something before its last write."""
    return KEYS.replace("mov.b w3, [w1]; mov.b w0, [w1]", f"mov.b w3, [w1]; {between} mov.b w0, [w1]")


def late_switch() -> str:
    """A switch that is prepared before CLKLOCK forbids it."""
    high, low = switch(2).split("\n", 1)
    return f"{high}\n" + low.replace("#1, w0", "#0x80, w0") + low


def timer_after(bits: int, turns: int) -> str:
    return TIMER.replace("0x8000", hex(0x8000 | bits << 4)) + f"repeat #{turns}; nop; mov tmr1, w0; mov w0, {RAM}\n"


def character(mode: int = 0x8008) -> str:
    """Timer 1 when a character has left."""
    return (PLL + UART.replace("#0x8008", f"#{mode}") + TIMER + "mov #0x55, w0; mov w0, u1txreg\nwait: btss u1sta, #8; bra wait\n"
            f"mov tmr1, w0; mov w0, {RAM}\n")


PLACE = 0x5000
LATCH = "mov #{at}, w1; mov #{low}, w0; tblwtl w0, [w1]; mov #{high}, w0; tblwth w0, [w1]\n"
KEY = "mov w2, nvmkey; mov w3, nvmkey; bset nvmcon, #15; nop; nop\n"
READ = f"mov #{PLACE}, w1; tblrdl [w1], w0; mov w0, {RAM}; tblrdh [w1], w0; mov w0, {RAM + 2}; mov nvmcon, w0; mov w0, {RAM + 4}\n"


def flash(operation: int, key: str = KEY, at: int = PLACE, low: int = 0x1234, high: int = 0x56) -> str:
    """A word into its latch, and an operation of the flash."""
    return f"clr 0x32; mov #0x55, w2; mov #0xAA, w3; {LATCH.format(at=at, low=low, high=high)} mov #{operation}, w0; mov w0, nvmcon; {key}"


WORD, ROW, ERASE = 0x4003, 0x4001, 0x4042
NOTHING = {RAM: 0xFFFF, RAM + 2: 0xFF, WARNED: "nothing is written"}

# Name, program, milliseconds and configuration words, what it leaves: registers, keys and words of RAM, as (mask, value) or a value.
CASES = [
    ("the clock starts on the fast RC oscillator", "", {"ms": 1},
     {"reg.OSCCON": (0xF000, 0), "cpu.cycles": approx(FRC_FCY * 1e-3, abs=3 + FRC_FCY * 51e-6)}),
    ("the configuration chooses the first clock", "", {"ms": 1, "FOSCSEL": 2}, {"cpu.cycles": approx(4000, abs=210)}),
    ("no switch without the unlock sequence", "mov #0x743, w1; mov #3, w0; mov.b w0, [w1]; bset osccon, #0\n", {"ms": 4},
     {"reg.OSCCON": 0}),
    ("a cycle between the keys", keys_with("nop;"), {"ms": 4}, {"reg.OSCCON": 0x3320}),
    ("two cycles between the keys", keys_with("nop; nop;"), {"ms": 4}, {"reg.OSCCON": 0}),
    ("a wrong key of the low byte", KEYS.replace("mov #0x57, w3", "mov #0x58, w3"), {"ms": 4}, {"reg.OSCCON": 0x0300}),
    ("a crystal that is off never comes", PLL, {"ms": 6, "FOSC": 0x43}, {"reg.OSCCON": (0xF000, 0), WARNED: "POSCMD"}),
    ("switching can be forbidden", PLL, {"ms": 6, "FOSC": 0x81}, {"reg.OSCCON": (0xF000, 0)}),
    ("LOCK tells of a PLL only", PLL + switch(2), {}, {"reg.OSCCON": 0x2200}),
    ("LOCK after power-on with a PLL", "", {"FOSCSEL": 1}, {"reg.OSCCON": 0x1120}),
    ("software cannot set the failure bit", UNLOCK.format(value=8), {}, {"reg.OSCCON": 0}),
    ("CLKLOCK forbids switching", UNLOCK.format(value=0x80) + switch(2), {"ms": 3}, {"reg.OSCCON": 0x0080}),
    ("CLKLOCK forbids a prepared switch", late_switch(), {"ms": 3}, {"reg.OSCCON": 0x0280}),
    ("a reset goes on with the running clock", ONCE + PLL + f"reset\ndone: mov osccon, w0; mov w0, {RAM}\n", {},
     {RAM: 0x3320, "cpu.resets": 1}),
    ("pins: selection is open after reset", SELECT, {}, {"reg.RPINR12": 8}),
    ("pins: locked", LOCK_PINS + SELECT, {}, {"reg.RPINR12": 0x1F}),
    ("pins: open again", LOCK_PINS + OPEN_PINS + SELECT, {}, {"reg.RPINR12": 8}),
    ("pins: the lock may be one way", LOCK_PINS + OPEN_PINS + SELECT, {"FOSC": 0x61}, {"reg.RPINR12": 0x1F}),
    ("pins: a clock switch does not lock", PLL + SELECT, {"FOSC": 0x61}, {"reg.RPINR12": 8}),
    ("pins: a selection has five bits", "setm rpinr18\n", {}, {"reg.RPINR18": 0x1F1F}),
    ("pins: FPOR leaves them to the ports", "", {"FPOR": 0xF7}, {"reg.PWM1CON1": 0x0000}),
    ("pins: FPOR gives them to the PWM", "", {"FPOR": 0x77}, {"reg.PWM1CON1": 0x0077}),
    *((f"port {port}: absent pins read zero", f"setm ad1pcfgl; clr tris{port}; setm lat{port}; mov port{port}, w0; mov w0, {RAM}\n", {},
       {RAM: bits})
      for port, bits in (("a", 0x079F), ("b", 0xFFFF), ("c", 0x03FF))),
    ("port: the latch reaches the pin", f"bclr trisc, #6; bset latc, #6; mov portc, w0; mov w0, {RAM}\n", {},
     {"pin.RC6": 1, RAM: (0x40, 0x40)}),
    *((f"port: analogue pins, AD1PCFGL {pins:03x}", f"mov #{pins}, w0; mov w0, ad1pcfgl; mov portb, w0; mov w0, {RAM}\n", {},
       {RAM: (0xF, low)})
      for pins, low in ((0, 0), (0x1FF, 0xF))),
    ("port: written, it is the latch", "bclr trisc, #6; bset portc, #6\n", {}, {"pin.RC6": 1, WARNED: "PORTC:"}),
    ("flash: a word", flash(WORD) + READ, {}, {RAM: 0x1234, RAM + 2: 0x56, RAM + 4: 0x4003}),
    ("flash: programming only clears bits", flash(WORD) + flash(WORD, low=0xFF0F, high=0xF0) + READ, {}, {RAM: 0x1204, RAM + 2: 0x50}),
    ("flash: a row has the words of its table writes", f"clr 0x32; {LATCH.format(at=PLACE + 126, low=1, high=2)}" + flash(ROW) + READ.replace(str(PLACE), str(PLACE + 126)), {},
     {RAM: 1, RAM + 2: 2}),
    ("flash: a word is not the row", flash(WORD, at=PLACE + 2) + READ, {}, {RAM: 0xFFFF, RAM + 2: 0xFF}),
    ("flash: a page is erased", flash(WORD) + flash(ERASE, at=PLACE + 0x3FE) + READ, {"ms": 60}, {RAM: 0xFFFF, RAM + 2: 0xFF, RAM + 4: 0x4042}),
    ("flash: the next page is not", flash(WORD) + flash(ERASE, at=PLACE + 0x400) + READ, {"ms": 60}, {RAM: 0x1234, RAM + 2: 0x56}),
    *((f"flash: the processor stands, {us} us", PLL + TIMER.replace("0x8000", "0x8030") + flash(operation) + f"mov tmr1, w0; mov w0, {RAM}\n", {"ms": 60},
       {RAM: approx(us * 40 / 256, abs=1)}) for operation, us in ((WORD, 56), (ROW, 1740), (ERASE, 26500))),
    ("flash: nothing without the keys", flash(WORD, "bset nvmcon, #15\n") + READ, {}, NOTHING | {RAM + 4: 0x6003}),
    ("flash: nothing with the second key alone", flash(WORD, KEY.replace("mov w2, nvmkey;", "")) + READ, {}, NOTHING),
    ("flash: nothing with the keys in the other order", flash(WORD, KEY.replace("w2", "w4").replace("w3", "w2").replace("w4", "w3")) + READ, {}, NOTHING),
    ("flash: nothing too long after the keys", flash(WORD, KEY.replace("bset", "nop; nop; bset", 1)) + READ, {}, NOTHING),
    ("flash: nothing without WREN", flash(WORD & 0x3FFF) + READ, {}, NOTHING),
    ("flash: the keys are good for once", flash(WORD) + "bset nvmcon, #15\n" + READ, {}, {RAM: 0x1234, WARNED: "nothing is written"}),
    ("flash: an operation that there is not", flash(0x4004) + READ, {}, {RAM: 0xFFFF, WARNED: "0xC004 is no operation"}),
    ("flash: it outlives a reset", f"btsc rcon, #6\nbra done\n" + flash(WORD) + "reset\ndone:\n" + READ, {}, {RAM: 0x1234, "cpu.resets": 1, "cpu.flash_operations": 1}),
    ("timer: instruction cycles", timer_after(0, 98), {}, {RAM: 101}), # REPEAT, 99 NOPs, MOV: the write of T1CON ends before the first
    *((f"timer: prescaler 1:{cycles}", timer_after(bits, 5117), {}, {RAM: approx(5120 / cycles, abs=1)})
      for bits, cycles in ((0, 1), (1, 8), (2, 64), (3, 256))),
    *((f"timer {number} has its flag",
       f"clr ifs0; mov #99, w0; mov w0, pr{number}; clr tmr{number}; mov #0x8000, w0; mov w0, t{number}con\n", {"ms": 1},
       {"reg.IFS0": (0x0188, 1 << bit)}) for number, bit in ((1, 3), (2, 7), (3, 8))),
    ("timer: a period of zero gives no flag", "clr ifs0; clr pr1; clr tmr1; mov #0x8000, w0; mov w0, t1con\n", {"ms": 1},
     {"reg.IFS0": (8, 0)}),
    ("timer: beyond its period it goes round", "mov #0xFFF0, w0; mov #99, w1; mov w1, pr1; mov w0, tmr1; mov #0x8000, w0; mov w0, t1con\n"
     f"repeat #60; nop; mov tmr1, w0; mov w0, {RAM}; repeat #139; nop; mov tmr1, w0; mov w0, {RAM + 2}\n", {},
     {RAM: 63 - 16, RAM + 2: 63 + 143 - 16 - 100}),
    ("timer: stopped, it keeps its count", TIMER + f"repeat #98; nop; bclr t1con, #15; repeat #98; nop; mov tmr1, w0; mov w0, {RAM}\n", {},
     {RAM: approx(101, abs=2)}),
    ("uart: a character takes ten bits", character(), {}, {RAM: approx(10 * 4 * 87, abs=8), "text": "U",
                                                           "uart.baud": approx(114943, abs=1)}),
    ("uart: sixteen cycles a bit at low speed", character(0x8000), {}, {RAM: approx(10 * 16 * 87, abs=8)}),
    *((f"uart: PDSEL, STSEL {bits:03b}", character(0x8008 | bits), {}, {RAM: approx(length * 4 * 87, abs=8)})
      for bits, length in ((0b001, 11), (0b010, 11), (0b011, 12), (0b111, 12))),
    ("uart: enabling the transmitter sets its flag", PLL + "clr ifs0; mov #0x8008, w0; mov w0, u1mode\n"
     f"mov ifs0, w1; mov w1, {RAM}; bset u1sta, #10; mov ifs0, w1; mov w1, {RAM + 2}\n", {}, {RAM: (0x1000, 0), RAM + 2: (0x1000, 0x1000)}),
    ("uart: one on the line and four waiting", PLL + UART + f"mov #0x41, w0\nmov w0, u1txreg; mov u1sta, w2; mov w2, {RAM}\n"
     f"mov w0, u1txreg; mov w0, u1txreg; mov w0, u1txreg\nmov u1sta, w2; mov w2, {RAM + 2}\n"
     f"mov w0, u1txreg; mov u1sta, w2; mov w2, {RAM + 4}\n", {},
     {RAM: (0x200, 0), RAM + 2: (0x200, 0), RAM + 4: (0x200, 0x200), "text": "AAAAA"}),
    ("uart: a sixth character is lost", PLL + UART + "mov #0x41, w0\n" + "mov w0, u1txreg\n" * 6, {}, {"text": "AAAAA", WARNED: "UTXBF"}),
    ("uart: without a pin nothing leaves", PLL + UART.replace("rpor9", f"{RAM}") + "mov #0x41, w0; mov w0, u1txreg\n", {},
     {"text": "", WARNED: "RPOR9"}),
    ("uart: loop back",
     PLL + UART + f"bset u1mode, #6; mov #0x5A, w0; mov w0, u1txreg\nw: btss u1sta, #0; bra w; mov u1rxreg, w0; mov w0, {RAM}\n", {},
     {RAM: 0x5A}),
    ("watchdog: resets what does not serve it", COUNT, {"ms": 10.5, "FWDT": ON}, {"cpu.resets": 10, RAM + 2: (0x0010, 0x0010)}),
    ("watchdog: leaves alone what serves it", COUNT + "again: clrwdt; bra again\n", {"ms": 10, "FWDT": ON}, {"cpu.resets": 0, RAM + 2: 3}),
    ("watchdog: off until software enables it", "", {"ms": 10, "FWDT": 0x40}, {"cpu.resets": 0}),
    ("watchdog: what software enabled a reset disables", "btsc rcon, #4\nbra done\nbset rcon, #5\ndone: ", {"ms": 10, "FWDT": 0x40},
     {"cpu.resets": 1}),
    ("watchdog: postscaler", "", {"ms": 10, "FWDT": ON | 2}, {"cpu.resets": 2}),
    ("watchdog: prescaler", "", {"ms": 10, "FWDT": ON | 0x10}, {"cpu.resets": 2}),
    ("watchdog: its time does not follow the clock", PLL, {"ms": 10, "FWDT": ON | 2}, {"cpu.resets": 2}),
    ("watchdog: too early for its window, 0.54 ms", SERVE.format(wait="#2000"), {"ms": 10, "FWDT": ON & ~0x40},
     {"cpu.resets": approx(18, abs=7)}),
    ("watchdog: in its window, 0.9 ms", SERVE.format(wait="#3300"), {"ms": 10, "FWDT": ON & ~0x40}, {"cpu.resets": 0}),
    ("watchdog: without a window, 0.54 ms", SERVE.format(wait="#2000"), {"ms": 10, "FWDT": ON}, {"cpu.resets": 0}),
    *((f"watchdog: wakes from PWRSAV #{mode}", WATCHDOG_SLEEP.format(mode=mode), {"ms": 10.5, "FWDT": ON},
       {"cpu.resets": 0, RAM: 10, RAM + 2: (0x0010, 0x0010)}) for mode in (0, 1)),
    ("a reset instruction says so", ONCE + f"reset\ndone: mov rcon, w0; mov w0, {RAM}\n", {},
     {"cpu.resets": 1, RAM: 0x43}), # nobody cleared the rest
]


@pytest.mark.parametrize("program, settings, expected", [row[1:] for row in CASES], ids=[row[0] for row in CASES])
def test_program_leaves(program: str, settings: dict, expected: dict) -> None:
    chip = run(program + STOP, **settings)
    found = {}
    for what, value in expected.items():
        if what == WARNED:
            found[what] = value if told(chip, value) else chip.warnings()
        elif what == "text":
            found[what] = chip.uart_take()
        else:
            number = chip.peek(what) if isinstance(what, int) else chip.get(what)
            found[what] = (value[0], int(number) & value[0]) if isinstance(value, tuple) else number
    assert found == expected


LIVE = {"PORTA", "PORTB", "PORTC", "RCON", "OSCCON", "P1TMR", "IFS3"} # the fault input is tied to ground, which is active


def test_every_register_has_its_value_after_power_on_and_after_a_reset() -> None:
    text = (ROOT / "tools/chip/chip_registers.h").read_text()
    table = {name: (int(address, 16), int(value, 16)) for name, address, value in re.findall(r"X\((\w+), (0x\w+), (0x\w+)\)", text)}
    peripherals = {name: row for name, row in table.items() if row[0] >= 0x60 and name not in LIVE}
    spoil = ONCE + "".join(f"com {address}\n" for address, _ in peripherals.values() if not 0x1C0 <= address < 0x200) + "reset\ndone: "
    for program in (STOP, spoil + STOP):
        chip = run(program, 1)
        wrong = [f"{name} {int(chip.get('reg.' + name)):04X}"
                 for name, (_, value) in peripherals.items() if int(chip.get("reg." + name)) != value]
        assert wrong == []


# ---- memory: what an ELF file's names do for RAM that is read before anything has been written to it ----------------------------

def with_variables(folder: Path) -> PilBoard:
    """A program that reads two persistent words, which it keeps, and one of an array."""
    program = f"mov {RAM + 0x10}, w0; mov {RAM + 0x12}, w1; mov {RAM + 0x22}, w2; mov w0, {RAM}; mov w1, {RAM + 2}\n" + STOP
    elf = Sample(asm33.assemble(program, 0x200, REGISTERS)[0], {"_main": 0x200}, sections=[
        Section(".pbss", RAM + 0x10, b"", PERSISTENT, NOBITS, 8, [("_kept", RAM + 0x10, 4)]),
        Section(".bss", RAM + 0x20, b"", WRITE, NOBITS, 8, [("_array", RAM + 0x20, 4)])])
    path = folder / "x.elf"
    path.write_bytes(elf.elf())
    chip = PilBoard(library, path)
    chip.power_up()
    pass_ms(chip, 1)
    return chip


def test_persistent_variables_hold_something_and_any_other_is_told_with_address_and_names(tmp_path: Path) -> None:
    first, second = with_variables(tmp_path), with_variables(tmp_path)
    assert [first.peek(RAM), first.peek(RAM + 2)] == [second.peek(RAM), second.peek(RAM + 2)], "every run begins alike"
    assert first.peek(RAM) != 0
    assert first.warnings() == ["RAM read before it was written, 0x0822 (array+2), at 0x000204 (main+4)"]


def test_without_names_the_address_is_told() -> None:
    assert run(f"mov {RAM + 0x22}, w2\n" + STOP, 1).warnings() == ["RAM read before it was written, 0x0822, at 0x000200"]


# ---- clock ---------------------------------------------------------------------------------------------------------------

def test_switches_to_the_crystal_when_the_pll_has_locked() -> None:
    chip = board(PLL + STOP)
    pass_ms(chip, 1.5)
    assert int(chip.get("reg.OSCCON")) == 0x0301, "still waiting"
    pass_ms(chip, 0.3)
    assert int(chip.get("reg.OSCCON")) == 0x3320
    before = chip.get("cpu.cycles")
    pass_ms(chip, 1)
    assert chip.get("cpu.cycles") - before == approx(40000, abs=5)


def clock_khz(program: str, ms: float = 20.0, **config: int) -> float:
    """Instruction clock after `ms` of the program."""
    chip = run(program + STOP, ms, **config)
    before, at_s = chip.get("cpu.cycles"), chip.get("time_s")
    pass_ms(chip, ms)
    return (chip.get("cpu.cycles") - before) / (chip.get("time_s") - at_s) / 1000


@pytest.mark.parametrize("clkdiv, pllfbd, factor", [(0x0040, 0x30, 50 / 2 / 4), (0x00C0, 0x30, 50 / 2 / 8), (0x0041, 0x30, 50 / 3 / 4),
                                                    (0x0000, 0x20, 34 / 2 / 2), (0x00DE, 0x110, 274 / 32 / 8)])
def test_the_pll_has_a_divider_before_a_multiplier_and_a_divider_behind(clkdiv: int, pllfbd: int, factor: float) -> None:
    frc_khz = 2 * FRC_FCY / 1000
    got = clock_khz(f"mov #{clkdiv}, w0; mov w0, clkdiv; mov #{pllfbd}, w0; mov w0, pllfbd\n", 5, FOSCSEL=1)
    assert got == approx(frc_khz * factor / 2, abs=0.002 * frc_khz * factor)


@pytest.mark.parametrize("program, source, expected", [
    (CHANGE_PLL, 1, True), (CHANGE_PLL, 0, False), ("mov pllfbd, w0; mov w0, pllfbd\n", 1, False),
    ("mov #0x3000, w0; mov w0, clkdiv\n", 1, True),
    ("mov #0x3140, w0; mov w0, clkdiv\n", 1, False), (switch(0) + CHANGE_PLL, 1, False)])
def test_a_pll_that_is_changed_while_it_is_the_clock_is_told(program: str, source: int, expected: bool) -> None:
    assert told(run(program + STOP, FOSCSEL=source), "while it is the clock") == expected


@pytest.mark.parametrize("source, khz", [(2, 4000), (4, 16.384), (5, 16), (6, FRC_FCY / 16e3), (7, FRC_FCY / 32e3)])
def test_every_source_has_its_frequency(source: int, khz: float) -> None:
    assert clock_khz("mov #0x3540, w0; mov w0, clkdiv\n" + switch(source)) == approx(khz, abs=0.01 * khz)


@pytest.mark.parametrize("bits, divisor", enumerate((1, 2, 4, 8, 16, 32, 64, 256)))
def test_the_divided_rc_oscillator_has_eight_divisors(bits: int, divisor: int) -> None:
    khz = FRC_FCY / 1000 / divisor
    assert clock_khz(f"mov #{bits << 8 | 0x3040}, w0; mov w0, clkdiv\n" + switch(7), 40) == approx(khz, abs=0.02 * khz)


def test_after_power_on_a_pll_has_to_lock() -> None:
    chip = board(STOP, FOSCSEL=1)
    pass_ms(chip, 1.4)
    assert int(chip.get("reg.OSCCON")) == 0x1100
    pass_ms(chip, 0.2)
    assert int(chip.get("reg.OSCCON")) == 0x1120


CRYSTAL, EXTERNAL = 0x41, 0x40


@pytest.mark.parametrize("source, fosc, ready_ms", [(2, CRYSTAL, 0.128), (2, EXTERNAL, 0.0), (3, CRYSTAL, 1.628), (3, EXTERNAL, 1.5),
                                                    (1, CRYSTAL, 1.5)])
def test_a_crystal_starts_for_1024_periods_and_then_the_pll_locks(source: int, fosc: int, ready_ms: float) -> None:
    chip = board(switch(source) + STOP, FOSC=fosc)
    while int(chip.get("reg.OSCCON")) >> 12 != source:
        chip.run(1)
    assert chip.get("time_s") * 1000 == approx(ready_ms, abs=0.06), "to a period of the board that runs without PWM"


# ---- pins ----------------------------------------------------------------------------------------------------------------

def test_every_selection_obeys_the_lock() -> None:
    names = [name for name in REGISTERS if name.startswith(("rpinr", "rpor"))]
    select = "mov #0x0405, w0\n" + "".join(f"mov w0, {name}\n" for name in names) + STOP
    for lock, taken in ((LOCK_PINS, False), ("", True)):
        chip = run(lock + select)
        assert [name for name in names if (int(chip.get("reg." + name.upper())) == 0x0405) != taken] == []


def test_a_button_is_read() -> None:
    chip = board(f"bset ad1pcfgl, #0\nagain: mov porta, w0; mov w0, {RAM}; bra again\n")
    for pressed in (0, 1):
        chip.set("input.s2", pressed)
        pass_ms(chip, 1)
        assert chip.peek(RAM) & 0x100 == (0 if pressed else 0x100)


def test_each_analogue_input_has_its_pin() -> None:
    """AN0 and 1 are RA0 and 1, AN2 to 5 RB0 to 3, AN6 to 8 RC0 to 2."""
    ports = [("porta", 0x3), ("portb", 0xF), ("portc", 0x7)]
    reads = "".join(f"mov {port}, w0; mov w0, {RAM + 2 * n}\n" for n, (port, _) in enumerate(ports))
    program = "mov #{pins}, w0; mov w0, ad1pcfgl\n" + reads + STOP
    for number in range(9):
        chip = run(program.format(pins=0x1FF & ~(1 << number)))
        low = [mask & ~chip.peek(RAM + 2 * n) for n, (_, mask) in enumerate(ports)]
        assert low == [1 << number if number < 2 else 0, 1 << number - 2 if 2 <= number < 6 else 0,
                       1 << number - 6 if number >= 6 else 0], f"AN{number}"


# ---- timers --------------------------------------------------------------------------------------------------------------

def test_flag_comes_every_period_register_plus_one() -> None:
    loop = "{label}: btss ifs0, #3; bra {label}; bclr ifs0, #3; mov tmr2, w{n}\n"
    chip = run("mov #999, w0; mov w0, pr1; setm pr2; clr tmr1; clr tmr2; mov #0x8000, w0; mov w0, t2con; mov w0, t1con\n"
               + loop.format(label="a", n=1) + "".join(loop.format(label=f"b{n}", n=3) for n in range(20))
               + f"sub w3, w1, w3; mov w3, {RAM}\n" + STOP, 10)
    assert chip.peek(RAM) == approx(20000, abs=4)


def test_beyond_its_period_register_the_flag_comes_after_a_whole_round() -> None:
    chip = run("mov #0xFFF0, w0; mov #99, w1; mov w1, pr1; mov w0, tmr1; clr ifs0; setm pr2; clr tmr2\n"
               "mov #0x8000, w0; mov w0, t2con; mov w0, t1con\n"
               f"wait: btss ifs0, #3; bra wait; mov tmr2, w0; mov tmr1, w1; mov w0, {RAM}; mov w1, {RAM + 2}\n" + STOP)
    assert chip.peek(RAM) == approx(16 + 100, abs=5)
    assert chip.peek(RAM + 2) < 8


# ---- input capture -------------------------------------------------------------------------------------------------------

COUNT_200NS = "setm pr3; mov #0x8010, w0; mov w0, t3con; setm pr2; mov #0x8020, w0; mov w0, t2con\n" # timer 2 counts 1.6 us
PULSES = PLL + "mov #0x0707, w0; mov w0, rpinr7; mov w0, rpinr10\n" + COUNT_200NS + f"mov #{RAM}, w4\n"
KEEP_ALL = "again: btss {con}, #3; bra again; mov {buf}, w1; mov w1, [w4++]; mov #{end}, w2; cp w4, w2; bra nz, again\n" + STOP


def pulsed(program: str, ms: float, hz: float = 1000.0, **keys: float) -> PilBoard:
    """After so long with pulses at RB7, a quarter of the period each; they begin when the captures are on."""
    chip = board(program)
    pass_ms(chip, 2.0)
    for key, value in {"pulse_hz": hz, "pulse_duty": 0.25, **keys}.items():
        chip.set(f"input.{key}", value)
    pass_ms(chip, ms)
    return chip


def steps(chip: PilBoard, count: int) -> list[int]:
    """Differences of the counts in RAM."""
    words = [chip.peek(RAM + 2 * n) for n in range(count)]
    return [(after - before) & 0xFFFF for before, after in zip(words, words[1:])]


@pytest.mark.parametrize("mode, expected", [(1, [3750, 1250, 3750, 1250]), (2, [5000] * 4), (3, [5000] * 4), (4, [20000] * 4),
                                            (5, [80000 - 65536] * 4)])
def test_each_capture_mode_has_its_edges(mode: int, expected: list[int]) -> None:
    program = PULSES + f"mov #{mode}, w0; mov w0, ic1con\n" + KEEP_ALL.format(con="ic1con", buf="ic1buf", end=RAM + 10)
    assert steps(pulsed(program, 90), 5) == approx(expected, abs=1)


def test_a_pulse_is_captured_at_both_its_edges_by_two_captures_at_one_pin() -> None:
    program = PULSES + ("mov #2, w0; mov w0, ic2con; mov #3, w0; mov w0, ic1con\nfirst: btss ic2con, #3; bra first; mov ic2buf, w1\nrise: btss ic1con, #3; bra rise; mov ic1buf, w1; mov w1, [w4++]\n"
                        "fall: btss ic2con, #3; bra fall; mov ic2buf, w1; mov w1, [w4++]\n") + STOP
    for wrong in (0, 1):
        chip = board(program)
        chip.set("wiring.pulse", wrong)
        pass_ms(chip, 2.0)
        for key, value in (("pulse_duty", 0.0), ("pulse_us", 1300.0), ("pulse_hz", 50.0)):
            chip.set(f"input.{key}", value)
        pass_ms(chip, 45)
        assert steps(chip, 2) == [approx((1300 * 5, 18700 * 5 - 65536)[wrong], abs=1)]


def test_ictmr_chooses_timer_2() -> None:
    program = PULSES + "mov #0x83, w0; mov w0, ic1con\n" + KEEP_ALL.format(con="ic1con", buf="ic1buf", end=RAM + 6)
    assert steps(pulsed(program, 10), 3) == [approx(625, abs=1)] * 2


@pytest.mark.parametrize("con, word, bit", [("ic1con", "ifs0", 1), ("ic2con", "ifs0", 5), ("ic7con", "ifs1", 6), ("ic8con", "ifs1", 7)])
def test_each_capture_has_its_flag_and_its_buffer(con: str, word: str, bit: int) -> None:
    program = PULSES + f"mov #0x5A, w0; mov w0, {con.replace('con', 'buf')}; mov #3, w0; mov w0, {con}\n"
    chip = pulsed(program + KEEP_ALL.format(con=con, buf=con.replace("con", "buf"), end=RAM + 4), 5)
    assert steps(chip, 2) == [approx(5000, abs=1)]
    flags = {"ifs0": int(chip.get("reg.IFS0")) & 0x22, "ifs1": int(chip.get("reg.IFS1")) & 0xC0}
    assert flags == {"ifs0": 0, "ifs1": 0, word: 1 << bit}


@pytest.mark.parametrize("ici", range(4))
def test_the_interrupt_comes_with_every_first_to_fourth_capture(ici: int) -> None:
    program = PULSES + (f"mov #{3 | ici << 5}, w0; mov w0, ic1con; clr {RAM}\n"
                        f"again: mov ic1buf, w1; btss ifs0, #1; bra again; bclr ifs0, #1; inc {RAM}; bra again\n")
    chip = pulsed(program, 10)
    before = chip.peek(RAM)
    pass_ms(chip, 24)
    assert chip.peek(RAM) - before == 24 // (ici + 1)


def test_every_edge_ignores_the_choice_of_interrupts() -> None:
    chip = pulsed(PULSES + f"mov #0x61, w0; mov w0, ic1con; clr {RAM}\n"
                  f"again: mov ic1buf, w1; btss ifs0, #1; bra again; bclr ifs0, #1; inc {RAM}; bra again\n", 10)
    before = chip.peek(RAM)
    pass_ms(chip, 10)
    assert chip.peek(RAM) - before == 20


@pytest.mark.parametrize("mode, overflow", [(3, 0x10), (1, 0)])
def test_a_full_fifo_keeps_the_first_four_and_says_so(mode: int, overflow: int) -> None:
    program = PULSES + f"mov #{mode}, w0; mov w0, ic1con; mov #20000, w5; wait: repeat #18; nop; dec w5, w5; bra nz, wait\n" + "".join(
        "mov ic1con, w1; mov w1, [w4++]; mov ic1buf, w1; mov w1, [w4++]\n" for _ in range(5)) + STOP
    chip = pulsed(program, 30)
    states = [chip.peek(RAM + 4 * n) & 0x18 for n in range(5)]
    counts = [chip.peek(RAM + 2 + 4 * n) for n in range(5)]
    assert states == [8 | overflow] * 4 + [0]
    assert [(after - before) & 0xFFFF for before, after in zip(counts, counts[1:4])] == [approx(5000 if mode == 3 else step, abs=1) for step in (3750, 1250, 3750)]
    assert counts[4] == counts[3], "an empty one"


def test_switched_off_it_forgets_and_captures_nothing() -> None:
    off = "mov #20000, w5; {label}: repeat #18; nop; dec w5, w5; bra nz, {label}\n"
    chip = pulsed(PULSES + "mov #3, w0; mov w0, ic1con\n" + off.format(label="a") + f"clr ic1con; mov ic1con, w1; mov w1, {RAM}\n"
                  + off.format(label="b") + f"mov ic1con, w1; mov w1, {RAM + 2}\n" + STOP, 40)
    assert [chip.peek(RAM), chip.peek(RAM + 2)] == [0, 0]


@pytest.mark.parametrize("program, warning", [
    ("mov #7, w0; mov w0, rpinr7\n" + COUNT_200NS + "mov #3, w0; mov w0, ic1con\n", ""),
    (COUNT_200NS + "mov #3, w0; mov w0, ic1con\n", "RPINR7: IC1 has no pin"),
    (COUNT_200NS + "mov #0x1F07, w0; mov w0, rpinr10; mov #3, w0; mov w0, ic8con\n", "RPINR10: IC8 has no pin"),
    ("mov #9, w0; mov w0, rpinr7\n" + COUNT_200NS + "mov #3, w0; mov w0, ic1con\n", "RPINR7: IC1R is 9"),
    ("mov #7, w0; mov w0, rpinr7; mov #3, w0; mov w0, ic1con\n", "T3CON: IC1 captures timer 3, which stands still"),
    ("mov #7, w0; mov w0, rpinr7\n" + COUNT_200NS + "mov #6, w0; mov w0, ic1con\n", "IC1CON: mode 6")])
def test_a_capture_that_cannot_work_is_told(program: str, warning: str) -> None:
    chip = pulsed(PLL + program + STOP, 10)
    found = [text for text in chip.warnings() if "IC" in text]
    assert [warning in text for text in found] == ([True] if warning else []), found


def test_the_pin_reads_the_pulses_and_what_is_wrong_with_them() -> None:
    chip = pulsed(STOP, 10)

    def high(ms: float = 10.0) -> float:
        levels = []
        for _ in range(round(ms * 20)):
            chip.run(1)
            levels.append(chip.get("pin.RB7"))
        return sum(levels) / len(levels)

    def now(**keys: float) -> float:
        for key, value in keys.items():
            chip.set(key.replace("__", "."), value)
        pass_ms(chip, 2.0)
        return high()

    assert now() == approx(0.25, abs=0.03)
    assert now(wiring__pulse=1) == approx(0.75, abs=0.03)
    assert now(wiring__pulse=0, input__pulse_stuck=1) == 0.0
    assert now(input__pulse_stuck=2) == 1.0
    assert now(input__pulse_stuck=0, input__pulse_duty=0, input__pulse_us=600) == approx(0.6, abs=0.03)
    assert now(input__pulse_us=2000) == 1.0, "as long as the period and longer"
    assert now(input__pulse_us=0) == 0.0
    assert now(input__pulse_us=300, input__pulse_odd=1000, input__pulse_odd_us=500) == approx(0.5, abs=0.03)
    assert 985 <= chip.get("input.pulse_odd") <= 989
    assert now(input__pulse_odd=0) == approx(0.3, abs=0.03)
    assert now(input__pulse_hz=100) == approx(0.03, abs=0.03)
    assert now(input__pulse_hz=0) == 1.0, "pulled up"


def test_jitter_spreads_the_pulses_evenly_and_the_same_in_each_run() -> None:
    program = PULSES + "mov #2, w0; mov w0, ic2con; mov #3, w0; mov w0, ic1con\n" + (
        "first: btss ic2con, #3; bra first; mov ic2buf, w1\nagain: btss ic1con, #3; bra again; mov ic1buf, w1\nfall: btss ic2con, #3; bra fall; mov ic2buf, w2; sub w2, w1, w2; mov w2, [w4++]\n"
        f"mov #{RAM + 200}, w2; cp w4, w2; bra nz, again\n") + STOP
    chips = [pulsed(program, 260, 400.0, pulse_duty=0.0, pulse_us=1500.0, pulse_jitter_us=jitter) for jitter in (0.0, 200.0, 200.0)]
    lengths = [[chip.peek(RAM + 2 * n) / 5 for n in range(100)] for chip in chips]
    assert lengths[0] == [approx(1500, abs=0.3)] * 100
    assert lengths[1] == lengths[2] and 1300 <= min(lengths[1]) < 1320 and 1680 < max(lengths[1]) <= 1700
    assert sum(lengths[1]) / 100 == approx(1500, abs=25)


# ---- UART ----------------------------------------------------------------------------------------------------------------

FLAGS = PLL + UART + "mov #{sta}, w0; mov w0, u1sta; clr ifs0\n"


@pytest.mark.parametrize("sta, left", [(0x0400, [0, 1, 2]), (0x2400, [3]), (0x8400, [0, 2])],
                         ids=["each character that leaves the buffer", "everything has left", "the buffer is empty"])
def test_the_transmitters_interrupt_comes_when_utxisel_says(sta: int, left: list[int]) -> None:
    chip = run(FLAGS.format(sta=sta) + f"mov #{RAM}, w4; mov #0x41, w0; " + "mov w0, u1txreg; " * 3
               + "setm pr1; clr tmr1; mov #0x8000, w1; mov w1, t1con\n"
               "again: btss ifs0, #12; bra again; mov tmr1, w0; bclr ifs0, #12; mov w0, [w4++]; bra again\n")
    assert [round(chip.peek(RAM + 2 * n) / (40 * 87)) for n in range(3) if chip.peek(RAM + 2 * n)] == left


def sent_to(program: str, *texts: str, before_ms: float = 2.0, each_ms: float = 1.0) -> list[int]:
    """U1STA's OERR and URXDA after each text that a board with this program has received, then four words of RAM."""
    chip = board(PLL + UART + program)
    pass_ms(chip, before_ms)
    status = []
    for text in texts:
        chip.uart_send(text)
        pass_ms(chip, each_ms)
        status.append(int(chip.get("reg.U1STA")) & 3)
    if "rpinr18" not in program:
        assert told(chip, "RPINR18")
    return status + [chip.peek(RAM + 2 * n) for n in range(4)]


STORE = "again: btss u1sta, #0; bra again; mov u1rxreg, w0; mov w0, [w4++]; bra again\n"
LATE = "setm pr1; clr tmr1; mov #0x8030, w0; mov w0, t1con\nwait: mov tmr1, w0; mov #300, w1; cp w0, w1; bra nc, wait\n"


def test_received_characters_arrive_in_order_also_those_that_wait() -> None:
    assert sent_to(RECEIVER + f"mov #{RAM}, w4\n" + STORE, "xyz")[1:4] == [ord(c) for c in "xyz"]
    assert sent_to(RECEIVER + f"mov #{RAM}, w4; " + LATE + STORE, "wxyz", before_ms=1.8, each_ms=4)[1:] == [ord(c) for c in "wxyz"]


@pytest.mark.parametrize("program, texts, status", [
    (STOP, ["x"], [0]), (RECEIVER + STOP, ["abcdef"], [3]), (RECEIVER + "w: btss u1sta, #1; bra w; bclr u1sta, #1\n" + STOP,
                                                             ["abcdef", "ghi"], [1, 1])],
    ids=["without a pin nothing arrives", "unread it overruns", "clearing the overrun empties the receiver"])
def test_the_receivers_status(program: str, texts: list[str], status: list[int]) -> None:
    assert sent_to(program, *texts)[:len(texts)] == status


@pytest.mark.parametrize("mode, count", [(0, 1), (1, 1), (2, 3), (3, 4)])
def test_the_receivers_interrupt_comes_when_urxisel_says(mode: int, count: int) -> None:
    chip = board(FLAGS.format(sta=0x400 | mode << 6) + RECEIVER + STOP)
    pass_ms(chip, 2)
    for received in range(1, 5):
        chip.uart_send("a")
        pass_ms(chip, 0.2)
        assert bool(int(chip.get("reg.IFS0")) & 0x0800) == (received >= count), f"{received} characters"


def test_on_a_pseudo_terminal(terminals) -> None:
    chip = board(PLL + UART + RECEIVER + "again: btss u1sta, #0; bra again; mov u1rxreg, w0; inc w0, w0\nmov w0, u1txreg; bra again\n")
    line = os.open(chip.terminal(), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        pass_ms(chip, 2)
        os.write(line, b"A")
        time.sleep(0.05)
        pass_ms(chip, 1)
        time.sleep(0.05)
        assert os.read(line, 10) == b"B"
    finally:
        os.close(line)


# ---- resets --------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("cause, bit", [(".word24 0xFD8010", 0x4000), ("mov [w9], w0", 0x4000),
                                        ("mov #0x900, w15; bset 0x80, #1; nop; nop\nbra done", 0x8000)],
                                        ids=["opcode", "address", "conflict"])
def test_what_the_core_resets_for_is_told_in_rcon(cause: str, bit: int) -> None:
    chip = run(f"mov rcon, w0; mov w0, {RAM}; mov #0xC000, w1; and w0, w1, w1\nbra nz, done\n{cause}\ndone: " + STOP
               + "\n.org 0x1000\nhandler: mov #0x801, w2; mov [w2], w3; bra handler\n.org 0x6\n.word24 0x001000\n", 1)
    assert (chip.peek(RAM) & 0xC000, chip.get("cpu.resets")) == (bit, 1)


# ---- PWM -----------------------------------------------------------------------------------------------------------------

START = PLL + "mov #999, w0; mov w0, p1tper; setm pr1; clr tmr1; mov #0x8002, w0; mov #0x8000, w1; mov w1, t1con; mov w0, p1tcon\n"
OVERRIDE = START.replace("mov #0x8002", "mov #0x77, w1; mov w1, pwm1con1; clr p1ovdcon; mov #0x8002")


@pytest.mark.parametrize("cycles", [10, 500, 900, 1100, 1500, 1900, 2200, 3500])
def test_counter_goes_up_then_down_with_the_direction_bit(cycles: int) -> None:
    chip = run(START + f"repeat #{cycles}; nop; mov p1tmr, w2; mov tmr1, w3; mov w2, {RAM}; mov w3, {RAM + 2}\n" + STOP)
    passed = (chip.peek(RAM + 2) - 2) % 2000 # TMR1 is read an instruction later and was started one earlier
    assert chip.peek(RAM) == approx(passed if passed < 1000 else 0x8000 | (2000 - passed), abs=1)


def test_override_acts_at_once_and_within_a_period() -> None:
    assert run(OVERRIDE + "mov #0x15, w0; mov w0, p1ovdcon\n" + STOP).get("pwm.outputs_on") == 0x15
    chip = run(OVERRIDE + "mov #0x15, w1\nagain: mov w1, p1ovdcon; repeat #199; nop; clr p1ovdcon; repeat #3000; nop; bra again\n")
    seen = []
    for _ in range(32):
        chip.run(1)
        seen.append(int(chip.get("pwm.outputs_seen")))
    assert set(seen) == {0x00, 0x15}
    assert seen.count(0x15) > 16, "a pulse of 5 us every 80 us is in more than half of the periods"


# ---- ADC -----------------------------------------------------------------------------------------------------------------

SETUP = START.replace("mov #0x8002, w0;", """mov #0x836C, w0; mov #0x0200, w1; mov #3, w2; mov #8, w3; mov w1, ad1con2; mov w2, ad1con3
    mov w3, ad1chs0; mov #0xFEF8, w3; mov w3, ad1pcfgl; mov w0, ad1con1
    mov #{trigger}, w0; mov w0, p1secmp; bclr ifs0, #13; mov #0x8002, w0;""")
WAIT = f"wait: btss ifs0, #13; bra wait; mov tmr1, w0; mov w0, {RAM}; mov adc1buf0, w0; mov w0, {RAM + 2}\n" + STOP


@pytest.mark.parametrize("trigger, isr_us, at, warning", [
    (400, 13, 400 + 4 * 12 * 4, False), (0x8000 | 400, 13, 2000 - 400 + 192, False), (400, 13 + 20, 400 + 192 + 800, False),
    (400, 13 + 60, 400 + 192 + 2400, True)], ids=["four conversions take 192 cycles", "counting down", "held up",
                                                  "held up beyond a period"])
def test_the_conversions_end(trigger: int, isr_us: float, at: int, warning: bool) -> None:
    chip = board(SETUP.format(trigger=trigger) + WAIT)
    chip.set("cpu.isr_us", isr_us)
    pass_ms(chip, 5)
    assert chip.peek(RAM) == approx(at, abs=6)
    assert told(chip, "cpu.isr_us") or not warning


def test_result_is_the_potentiometer() -> None:
    chip = board(SETUP.format(trigger=400) + WAIT)
    chip.set("input.pot", 0.75)
    chip.set("adc.noise_lsb", 0)
    pass_ms(chip, 5)
    assert chip.peek(RAM + 2) == 0x4000, "three quarters, signed fractional"


def test_an_interrupt_is_entered_and_counted() -> None:
    handler = "bclr ifs0, #13; inc 0x804; mov w0, p1dc3; retfie\n"
    enable = "mov #0x40, w5; mov w5, ipc3; bset iec0, #13\n"
    chip = run("mov #0x900, w15; mov #0xFF0, w0; mov w0, splim; clr 0x804\n" + SETUP.format(trigger=400) + enable + STOP
               + "\n.org 0x1000\n" + handler + ".org 0x2E\n.word24 0x001000\n", 12)
    assert chip.peek(RAM + 4) > 100
    assert chip.get("cpu.isr_count") == approx(chip.peek(RAM + 4), abs=1)
    assert chip.get("cpu.isr_cycles_max") < 20
    assert chip.get("cpu.latency_cycles_mean") == approx(192 + 10, abs=8)
    chip.set("cpu.isr_reset", 1)
    assert chip.get("cpu.isr_count") == 0
