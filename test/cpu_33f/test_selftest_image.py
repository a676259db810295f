"""The self-tests of the image in the simulator: a healthy chip passes, and each planted defect stops it by name. Needs XC16."""

import ctypes
import pathlib
import re
from collections.abc import Callable, Iterator

import pytest

import xc16
from chip import REGISTERS, ROOT, library, pass_ms
from tools.bench.pil import PilBoard
from tools.common.x_macro import rows
from tools.image import crc, load, program

pytestmark = pytest.mark.xc16
ELF = ROOT / "build" / "target" / "foc33.elf"
TESTS = {name: int(code) for code, name, *_ in rows("include", "drive/selftest.h", "SELFTEST_TABLE", "#code #name clause what")}
STATE, DIRECTION, TICKS = 6, 14, 10 # bytes from board_drive
RAM_START, RAM_END, SPLIM = 0x0800, 0x1000, 0x0FF0
SELFTEST, ADC_LOST = 20, 10
ILLEGAL = 0xE00102
C = library.c
for _name, _result, *_arguments in (
        ("vb_iss_core", ctypes.c_void_p, ctypes.c_void_p), ("iss_poke", None, ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16),
        ("iss_stick", None, ctypes.c_void_p, *3 * [ctypes.c_uint16]), ("iss_program", ctypes.POINTER(ctypes.c_uint32), ctypes.c_void_p),
        ("iss_program_changed", None, ctypes.c_void_p), ("iss_irq_changed", None, ctypes.c_void_p),
        ("iss_restart", None, ctypes.c_void_p, ctypes.c_uint32), ("iss_run", ctypes.c_int, ctypes.c_void_p, ctypes.c_uint64),
        ("iss_pc", ctypes.c_uint32, ctypes.c_void_p), ("iss_set_w_known", None, ctypes.c_void_p, ctypes.c_uint16)):
    getattr(C, _name).restype, getattr(C, _name).argtypes = _result, _arguments


@pytest.fixture(scope="module")
def elf() -> program.Elf:
    if not xc16.COMPILER:
        pytest.skip(xc16.NONE)
    xc16.made("firmware")
    return program.read_elf(ELF)


@pytest.fixture
def board(elf: program.Elf) -> Iterator[PilBoard]: # pylint: disable=unused-argument
    chip = PilBoard(library, ELF)
    chip.lock_step(False)
    yield chip
    chip.close()


def variable(elf: program.Elf, name: str) -> int:
    return next(symbol.address for symbol in elf.names if symbol.name == name)


def started(chip: PilBoard) -> PilBoard:
    chip.power_up()
    pass_ms(chip, 100)
    assert chip.get("fw.state") == 1 and chip.variable("board_selftest_failed", 1) == [0]
    return chip


def running(chip: PilBoard) -> PilBoard:
    started(chip).set("input.s2", 1)
    pass_ms(chip, 60)
    chip.set("input.s2", 0)
    assert chip.get("pwm.outputs_on") != 0
    return chip


def flip(chip: PilBoard, address: int, bits: int) -> None:
    core = C.vb_iss_core(chip._vb)
    C.iss_poke(core, address, chip.peek(address) ^ bits)
    C.iss_irq_changed(core)


def finds(chip: PilBoard, test: str, most_ms: float) -> float:
    """Time in ms until the outputs are off with this test's name."""
    ms = 0.0
    while chip.variable("board_selftest_failed", 1) == [0] and ms < most_ms:
        pass_ms(chip, 0.5)
        ms += 0.5
    assert chip.variable("board_selftest_failed", 1) == [TESTS[test]], f"after {ms} ms"
    pass_ms(chip, 1)
    assert chip.get("fw.fault") == SELFTEST and chip.get("pwm.outputs_on") == 0
    return ms


def test_each_self_test_is_shown_to_fail_below() -> None:
    """Also without the compiler: by their codes, CPU by its function."""
    text = pathlib.Path(__file__).read_text(encoding="utf-8")
    assert len(TESTS) == 10 and {name for name in TESTS if f'(board, "{name}"' not in text and f'TESTS["{name}"]' not in text} == {"CPU", "VARIABLES", "FLOW", "CLOCK"}
    assert all(words in text for words in ('symbols["_board_cpu_test"]', '("VARIABLES", DIRECTION', '("FLOW", TICKS', '(4e6, "CLOCK")'))


def test_a_healthy_chip_passes_all_of_them_and_the_core_meets_nothing_wrong(elf: program.Elf, board: PilBoard) -> None:
    running(board)
    pass_ms(board, 2500)
    assert board.variable("board_selftest_failed", 1) == [0] and board.get("fw.fault") == 0
    assert board.get("cpu.errors") == 0 and board.warnings() == []
    assert board.get("cpu.resets") == 1 # the watchdog's test
    assert re.match(r"foc33 [\d.]+ reset BOR POR\r\n", board.uart_take())
    assert board.variable("waited_counts", 1)[0] == pytest.approx(10000, abs=20)
    assert variable(elf, "board_selftest_failed") and crc.check(elf.words, elf) == []


def test_the_panel_keeps_its_potentiometer_while_the_converter_is_tested(board: PilBoard) -> None:
    started(board).set("input.pot", 0.5)
    pass_ms(board, 1200)
    assert board.warnings() == [] and board.get("fw.fault") == 0


# ---- registers of the peripherals -----------------------------------------------------------------------------------------

@pytest.mark.parametrize("name, bits", [
    ("p1tper", 0x0010), ("pwm1con1", 0x0001), ("p1dtcon1", 0x0008), ("p1fltacon", 0x0001), ("p1secmp", 0x0020), ("pwm1con2", 0x0004),
    ("ad1con2", 0x0100), ("ad1con3", 0x0004), ("ad1chs123", 0x0100), ("ad1pcfgl", 0x0010), ("trisb", 0x0002), ("trisc", 0x0040),
    ("rpinr12", 0x0003), ("pr1", 0x0400), ("ipc15", 0x1000), ("ipc3", 0x0010), ("ipc1", 0x1000), ("corcon", 0x0001), ("osctun", 0x0001), ("pllfbd", 0x0001)])
def test_a_changed_bit_of_a_register_stops(board: PilBoard, name: str, bits: int) -> None:
    flip(running(board), REGISTERS[name], bits)
    assert finds(board, "REGISTERS", 15) <= 12


def test_a_control_interrupt_that_dies_is_a_fault_of_its_own(board: PilBoard) -> None:
    flip(running(board), REGISTERS["iec0"], 1 << 13)
    pass_ms(board, 4)
    assert board.get("fw.fault") == ADC_LOST and board.get("pwm.outputs_on") == 0


# ---- memory and processor --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("place", [0x0B02, 0x0D40, 0x0D7E, SPLIM - 6, SPLIM, RAM_END - 2])
def test_a_stuck_bit_of_ram_is_found_while_running(board: PilBoard, place: int) -> None:
    """In what is free and beyond the stack's limit: elsewhere the program may not last until it is found."""
    running(board)
    C.iss_stick(C.vb_iss_core(board._vb), place, 0x0040, 0)
    assert finds(board, "RAM", 400) < 360


@pytest.mark.parametrize("place", [RAM_START + 0x260, 0x0C04, 0x0D02, SPLIM + 6, RAM_END - 2])
@pytest.mark.parametrize("at_1, at_0", [(0x0001, 0), (0, 0x8000)])
def test_a_stuck_bit_of_ram_is_found_at_a_start(board: PilBoard, place: int, at_1: int, at_0: int) -> None:
    C.iss_stick(C.vb_iss_core(board._vb), place, at_1, at_0)
    board.power_up()
    pass_ms(board, 100)
    assert board.variable("board_selftest_failed", 1) == [TESTS["RAM"]]
    assert board.get("fw.fault") == SELFTEST and board.get("pwm.outputs_on") == 0


def test_a_stuck_bit_of_the_way_back_from_the_start_leaves_the_outputs_off(elf: program.Elf, board: PilBoard) -> None:
    """In the first words of the stack. The program cannot come back to tell: the core resets, again and again."""
    C.iss_stick(C.vb_iss_core(board._vb), elf.symbols["__SP_init"] + 6, 0x0001, 0)
    board.power_up()
    for _ in range(100):
        pass_ms(board, 1)
        assert board.get("pwm.outputs_on") == 0
    assert board.get("cpu.resets") > 1 and board.get("fw.state") != 1


def call(chip: PilBoard, address: int) -> int:
    """W0 after a call of the target's function."""
    core, back = C.vb_iss_core(chip._vb), 0x200
    for offset, word in ((0, back), (2, 0)):
        C.iss_poke(core, 0x0E00 + offset, word)
    C.iss_poke(core, REGISTERS["wreg15"], 0x0E04)
    C.iss_set_w_known(core, 0xFFFF)
    C.iss_restart(core, address)
    for cycle in range(1, 400):
        C.iss_run(core, cycle)
        if C.iss_pc(core) == back:
            return chip.peek(REGISTERS["wreg0"])
    return 0


def test_each_bit_of_each_processor_register_counts(elf: program.Elf, board: PilBoard) -> None:
    """By calls of the test alone: a program whose registers are wrong does not come so far in a way that can be foreseen."""
    started(board)
    place, core, holds = elf.symbols["_board_cpu_test"], C.vb_iss_core(board._vb), variable(elf, "board_cpu_holds")

    def passes(address: int = 0, at_1: int = 0, at_0: int = 0) -> bool:
        C.iss_poke(core, REGISTERS["sr"], 0x00E0) # interrupts off
        C.iss_poke(core, holds, 0xFFFF)
        C.iss_stick(core, address, at_1, at_0)
        call(board, place)
        C.iss_stick(core, 0, 0, 0)
        return board.peek(holds) != 0

    assert passes()
    for address, bits in [(2 * n, range(16 if n < 15 else 12)) for n in range(16)] + [(REGISTERS["sr"], (0, 1, 2, 3, 8))]:
        for bit in bits:
            if address != 30 or bit > 0: # bit 0 of W15 is always 0
                assert not passes(address, 1 << bit, 0), f"{address:04X} bit {bit} stuck at 1"
                assert not passes(address, 0, 1 << bit), f"{address:04X} bit {bit} stuck at 0"
    assert passes()


@pytest.mark.parametrize("where", ["a constant", "a trap's handler", "erased flash", "the CRC"])
def test_a_changed_bit_of_flash_is_found(elf: program.Elf, board: PilBoard, where: str) -> None:
    address = {"a constant": variable(elf, "trig_sin_table") - program.device.PSV_WINDOW, "a trap's handler": elf.symbols["__MathError"],
               "erased flash": 0x5000, "the CRC": crc.PLACE}[where]
    running(board)
    core = C.vb_iss_core(board._vb)
    C.iss_program(core)[address // 2] ^= 0x000004
    C.iss_program_changed(core)
    assert finds(board, "FLASH", 800) < 720


def test_a_changed_bit_of_flash_is_found_at_a_start(board: PilBoard) -> None:
    core = C.vb_iss_core(board._vb)
    C.iss_program(core)[0x5000 // 2] ^= 0x800000
    C.iss_program_changed(core)
    board.power_up()
    pass_ms(board, 100)
    assert board.variable("board_selftest_failed", 1) == [TESTS["FLASH"]] and board.get("fw.fault") == SELFTEST


def test_a_background_that_no_longer_is_code_ends_in_a_fault_and_not_in_one_start_after_the_other(elf: program.Elf, board: PilBoard) -> None:
    running(board)
    core = C.vb_iss_core(board._vb)
    C.iss_program(core)[elf.symbols["_firmware_background"] // 2] = ILLEGAL
    C.iss_program_changed(core)
    pass_ms(board, 150) # a start looks at the flash
    assert board.get("pwm.outputs_on") == 0 and board.get("fw.fault") == SELFTEST
    resets = board.get("cpu.resets")
    pass_ms(board, 200)
    assert board.get("cpu.resets") == resets == 2 # the watchdog's test, and one
    assert board.get("fw.fault") == SELFTEST and board.get("pwm.outputs_on") == 0


# ---- variables, flow, stack -------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("test, place, bits, most_ms", [
    ("VARIABLES", DIRECTION, 0x0001, 2.5), ("VARIABLES", DIRECTION, 0x8000, 2.5), ("FLOW", TICKS, 0x0002, 2.5)])
def test_a_changed_bit_of_the_drive_stops(elf: program.Elf, board: PilBoard, test: str, place: int, bits: int, most_ms: float) -> None:
    running(board)
    flip(board, variable(elf, "board_drive") + place, bits)
    finds(board, test, most_ms)


@pytest.mark.parametrize("address", [SPLIM - 2, SPLIM - 4, REGISTERS["splim"]])
def test_a_broken_stack_guard_or_limit_stops(board: PilBoard, address: int) -> None:
    flip(running(board), address, 0x0002)
    finds(board, "STACK", 2)


# ---- converter, clock, watchdog ---------------------------------------------------------------------------------------------

def test_a_converter_that_does_not_read_ground_as_zero_is_found(board: PilBoard) -> None:
    started(board).set("adc.noise_lsb", 40)
    finds(board, "ADC", 5000)


@pytest.mark.parametrize("crystal_hz, found", [(4e6, "CLOCK"), (8e6, None), (16e6, "CLOCK")])
def test_a_clock_of_half_or_twice_its_frequency_is_found_at_power_up(board: PilBoard, crystal_hz: float, found: str | None) -> None:
    board.set("cpu.crystal_hz", crystal_hz)
    board.power_up()
    pass_ms(board, 100)
    assert board.variable("board_selftest_failed", 1) == [TESTS[found] if found else 0]
    assert board.get("pwm.outputs_on") == 0


def test_a_watchdog_that_never_resets_is_found_at_power_up(elf: program.Elf, monkeypatch: pytest.MonkeyPatch) -> None: # pylint: disable=unused-argument
    text: Callable[[program.Elf], str] = load.text
    monkeypatch.setattr(load, "text", lambda image: re.sub(r"^word f8000a \w+$", "word f8000a 44", text(image), flags=re.MULTILINE))
    chip = PilBoard(library, ELF)
    chip.lock_step(False)
    chip.power_up()
    pass_ms(chip, 100)
    assert chip.variable("board_selftest_failed", 1) == [TESTS["WATCHDOG"]] and chip.get("fw.fault") == SELFTEST
    chip.close()
