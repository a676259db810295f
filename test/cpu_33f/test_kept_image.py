"""Parameters kept over a reset, on the image in the simulator: the chip's own flash, its stalls, its watchdog, and the supply that fails. Needs XC16."""

import contextlib
import ctypes
from collections.abc import Iterator

import pytest

import xc16
from chip import library as _library # the interface of the core
from tools.common import paths
from tools.common.x_macro import rows
from tools.image import crc, device, program
from tools.live import board as live_board
from tools.live import lnet
from tools.live.symbols import Symbols
from tools.live.tuning import Tuning

pytestmark = pytest.mark.xc16
DEFINES = "-DPARAMS_IN_RAM -DPARAMS_KEPT=1"
ROW = "#number #name meaning"
STATES, RESULTS, REQUESTS = ({name: int(number) for number, name, _ in rows("include", "board/kept.h", f"KEPT_{table}_TABLE", ROW)}
                             for table in ("STATE", "RESULT", "REQUEST"))
STOPPED, CLOSED = 1, 5
COPY_OPERATIONS = 1 + 3 + 76
"""A page is erased, its words are programmed."""
FWDT = device.FIELDS["WDTPOST"].word
C = _library.c
for _name, _result in (("vb_iss_core", ctypes.c_void_p), ("iss_program", ctypes.POINTER(ctypes.c_uint32)), ("iss_program_changed", None)):
    getattr(C, _name).restype, getattr(C, _name).argtypes = _result, [ctypes.c_void_p]
GAIN, RAMP, ENTRY = "board_params.speed_kp_q13", "board_params.speed_ramp_q16", "board_params.fieldweak.ls_over2ls0_q15[17]"


@pytest.fixture(scope="module")
def parts() -> live_board.Parts:
    if not xc16.COMPILER:
        pytest.skip(xc16.NONE)
    return live_board.parts(cpu="33f", defines=DEFINES)


class Bench:
    """A board with a client on its serial line."""

    def __init__(self, parts: live_board.Parts) -> None:
        self.live, self.symbols = live_board.LiveBoard(parts), Symbols.read(parts.symbols)
        self.board = self.live.board
        self.core = C.vb_iss_core(self.board._vb)
        self.connect()

    def connect(self) -> None:
        self.live.run(0.2)
        self.board.uart_take()
        self.link = lnet.connect(live_board.BoardStream(self.live))

    def power_up(self) -> None:
        """After which the client begins anew."""
        self.board.power_up()
        self.connect()

    def get(self, name: str) -> int:
        variable = self.symbols.find(name)
        return variable.value(self.link.read(variable.address, variable.bytes))

    def put(self, name: str, value: int) -> None:
        variable = self.symbols.find(name)
        self.link.write(variable.address, variable.data(value))

    def choose(self, number: int) -> None:
        for name, start in ((GAIN, 1000), (RAMP, 0x50000), (ENTRY, 16000)):
            self.put(name, start + number)

    def chosen(self) -> int:
        """Which set is in RAM; all three say the same."""
        numbers = {self.get(name) - start for name, start in ((GAIN, 1000), (RAMP, 0x50000), (ENTRY, 16000))}
        assert len(numbers) == 1, numbers
        return numbers.pop()

    def ask(self, request: str, seconds: float = 0.3) -> int:
        self.put("kept_command.request", REQUESTS[request])
        self.live.run(seconds)
        return self.get("kept_command.result")

    def state(self) -> int:
        return self.get("kept_command.copies")

    def keeps(self, number: int) -> None:
        self.choose(number)
        assert self.ask("KEEP") == RESULTS["DONE"] and self.state() == STATES["KEPT"] and self.get("kept_command.unsaved") == 0

    def flip(self, page: int, word: int, bits: int) -> None:
        C.iss_program(self.core)[device.KEPT[0] // 2 + 512 * page + word] ^= bits
        C.iss_program_changed(self.core)

    def healthy(self) -> None:
        """Nothing but what was asked for has happened."""
        assert self.get("board_drive.fault") == 0 and self.get("board_drive.state") == STOPPED
        assert self.board.get("cpu.resets") == 1 # the watchdog's test
        assert self.board.get("cpu.errors") == 0 and self.board.warnings() == []


@pytest.fixture
def bench(parts: live_board.Parts) -> Iterator[Bench]:
    made = Bench(parts)
    yield made
    made.live.close()


def test_the_page_of_make_live_knows_the_image_s_parameters_by_name_and_value(parts):
    """What it compiles for the PC is what the compiler of the image has put there."""
    host = Symbols.read(live_board.parts(defines=DEFINES).symbols)
    tuning = Tuning.of(paths.ROOT / "userparams.h", [*DEFINES.replace("-D", "").split(), live_board.SCOPE], host, Symbols.read(parts.symbols))
    try:
        members = tuning.members(tuning.built)
        with contextlib.closing(live_board.LiveBoard(parts)) as live:
            live.run(0.2)
            live.board.uart_take()
            there = tuning.read_back(lnet.connect(live_board.BoardStream(live)), list(members))
    finally:
        tuning.end()
    assert len(members) > 150 and {name: value for name, value in zip(members, there) if members[name] != value} == {}


def test_the_image_has_its_crc_before_the_pages_and_nothing_in_them(parts: live_board.Parts) -> None:
    elf = program.read_elf(parts.image)
    assert crc.keeps_parameters(elf) and crc.place_in(elf) == device.KEPT[0] - 4
    assert not [address for address in elf.words if address in device.KEPT] and crc.check(elf.words, elf) == []
    assert elf.words[FWDT] & 0x0F == 6, "a watchdog of 64 ms"


def test_values_are_kept_over_a_reset_and_forgotten(bench: Bench) -> None:
    header = {name: bench.get(name) for name in (GAIN, RAMP, ENTRY)}
    assert bench.state() == STATES["NONE"] and bench.get("kept_command.unsaved") == 0
    bench.choose(1)
    bench.live.run(0.2)
    assert bench.get("kept_command.unsaved") in (3, 4) # the ramp has two words
    bench.keeps(1)
    assert bench.board.get("cpu.flash_operations") == 2 * COPY_OPERATIONS
    bench.healthy()
    bench.power_up()
    assert bench.chosen() == 1 and bench.state() == STATES["KEPT"]
    bench.live.run(2.5) # a round of the flash's self-test
    bench.healthy()
    assert bench.ask("FORGET") == RESULTS["DONE"] and bench.state() == STATES["NONE"]
    assert {name: bench.get(name) for name in header} == header
    bench.healthy()
    bench.power_up()
    assert {name: bench.get(name) for name in header} == header and bench.state() == STATES["NONE"]


def test_the_motor_starts_as_ever_and_while_it_runs_nothing_is_written(bench: Bench) -> None:
    bench.choose(1)
    bench.put(GAIN, 1600)
    assert bench.ask("KEEP") == RESULTS["DONE"]
    operations = bench.board.get("cpu.flash_operations")
    bench.board.set("input.s2", 1.0)
    bench.live.run(0.06)
    bench.board.set("input.s2", 0.0)
    for _ in range(5):
        assert bench.ask("KEEP", 0.5) == bench.ask("FORGET", 0.05) == RESULTS["NOT_STOPPED"]
    assert bench.get("board_drive.state") == CLOSED and bench.get(GAIN) == 1600
    assert bench.board.get("cpu.flash_operations") == operations and bench.board.warnings() == []


@pytest.mark.parametrize("share", [0.75, 1.3])
def test_the_watchdog_waits_for_an_erasing_also_with_an_oscillator_that_is_off(parts: live_board.Parts, share: float) -> None:
    bench = Bench(parts)
    bench.board.set("cpu.lprc_hz", 32000.0 * share)
    bench.power_up()
    bench.keeps(1)
    assert bench.board.get("cpu.resets") == 1 and bench.get("board_drive.fault") == 0
    bench.live.close()


def test_with_the_usual_watchdog_an_erasing_would_end_in_a_reset(parts: live_board.Parts) -> None:
    """What the longer time is for. The oscillator is faster than the self-test of a start lets pass, so it changes its frequency behind it."""
    bench = Bench(parts)
    bench.choose(1)
    bench.board.set("cpu.lprc_hz", 64000.0) # 32 ms
    assert bench.ask("KEEP") == RESULTS["DONE"] and bench.board.get("cpu.resets") == 1.0
    bench.board.set("cpu.lprc_hz", 128000.0) # 16 ms
    bench.live.run(0.2)
    assert bench.board.get("cpu.resets") == 1.0
    bench.put("kept_command.request", REQUESTS["KEEP"])
    bench.live.run(0.3)
    assert bench.board.get("cpu.resets") > 1.0
    bench.live.close()


@pytest.mark.parametrize("operations", [1, 2, 3, 40, COPY_OPERATIONS - 1, COPY_OPERATIONS, COPY_OPERATIONS + 1, COPY_OPERATIONS + 2,
                                        2 * COPY_OPERATIONS - 1, 2 * COPY_OPERATIONS])
def test_a_supply_that_fails_leaves_the_old_values_or_the_new_ones(bench: Bench, operations: int) -> None:
    bench.keeps(1)
    bench.choose(2)
    begin = bench.board.get("cpu.flash_operations")
    bench.board.write_variable("kept_command", REQUESTS["KEEP"]) # without the line, whose answer takes its time
    for _ in range(100_000):
        if bench.board.get("cpu.flash_operations") >= begin + operations:
            break
        bench.board.run(1)
    bench.power_up()
    done = bench.board.get("cpu.flash_operations") - begin
    assert operations <= done <= operations + 1
    assert bench.chosen() == (2 if done >= COPY_OPERATIONS else 1)
    assert bench.state() == STATES["ONE_COPY" if 0 < done < 2 * COPY_OPERATIONS and done != COPY_OPERATIONS else "KEPT"]
    bench.keeps(3)
    bench.healthy()


def test_damaged_copies_are_named_on_the_line(bench: Bench) -> None:
    bench.keeps(1)
    bench.flip(0, 20, 0x0010)
    bench.power_up()
    assert bench.chosen() == 1 and bench.state() == STATES["ONE_COPY"]
    bench.flip(1, 21, 0x8000)
    bench.board.power_up()
    bench.live.run(1.2)
    assert " rpm kept BROKEN" in bench.board.uart_take()
    bench.link = lnet.connect(live_board.BoardStream(bench.live))
    assert bench.state() == STATES["BROKEN"] and bench.get(GAIN) != 1001
    bench.keeps(2)
    bench.power_up()
    assert bench.chosen() == 2 and bench.state() == STATES["KEPT"]


def test_the_two_pages_count_with_no_module_and_the_stack_is_followed_through_the_built_in(parts) -> None:
    assert "kept_nvm" in xc16.made("size", f"DEFINES={DEFINES}", "VARIANT=kept-size")
