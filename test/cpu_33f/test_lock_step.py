"""The target image on the virtual board against the host's firmware. Needs XC16: the image is what `make firmware` builds."""

import ctypes
import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

import xc16
from chip import RAM, REGISTERS, ROOT, STOP, image, library, pass_ms
from tools.bench import pil_command, recorder
from tools.bench.board import BoardError
from tools.bench.pil import PilBoard
from tools.common import drive_tables
from tools.common.errors import UserError

pytestmark = pytest.mark.xc16
IMAGE = ROOT / "build" / "target" / "foc33.elf"


def symbol_at(elf: bytes, name: str) -> int:
    """Offset of the symbol table's entry with this name."""
    table = ELFFile(io.BytesIO(elf)).get_section_by_name(".symtab")
    return table["sh_offset"] + table["sh_entsize"] * next(n for n, symbol in enumerate(table.iter_symbols()) if symbol.name == name)


def start(chip: PilBoard) -> None:
    """Power-up, calibration, and S2."""
    chip.power_up()
    pass_ms(chip, 100)
    chip.set("input.s2", 1)
    pass_ms(chip, 60)
    chip.set("input.s2", 0)


@pytest.mark.parametrize("name, content", [("missing.elf", None), ("empty.elf", b""), ("text.elf", b"no image"),
                                           ("cut.hex", b":10000000AA\n")])
def test_an_image_that_is_no_image_is_one_line(tmp_path: Path, name: str, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises((UserError, BoardError)) as caught:
        PilBoard(library, tmp_path / name).close()
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


# ---- a program without names, through the whole of `make pil` ------------------------------------------------------------

SCENARIO = """
title = "a moment"
motor = "hurst_dmb0224c10002"
board = "mclv"
duration_s = 0.02
[[measure]]
name = "all"
from_s = 0.0
to_s = 0.02
[[expect]]
kind = "measure"
measure = "all"
value = "speed_max_rpm"
max = 1
[[expect]]
kind = "measure"
measure = "all"
value = "angle_error_rms_deg"
max = 5
[[expect]]
kind = "hand_over"
within_s = 0.01
[[expect]]
kind = "state"
name = "CLOSED"
[[expect]]
kind = "no_fault"
[[expect]]
kind = "no_warnings"
"""


@pytest.fixture
def pil(tmp_path: Path, capsys: pytest.CaptureFixture):
    """Runs a program; exit code, text, summary with what came out of the serial port."""
    def run(program: str) -> tuple[int, str, dict]:
        scenario, out = tmp_path / "short.toml", tmp_path / "out"
        scenario.write_text(SCENARIO, encoding="utf-8")
        code = pil_command.main([str(scenario), "--image", str(image(program)), "--out", str(out), "--quiet"])
        return code, capsys.readouterr().out, json.loads((out / "summary.json").read_text()) | {"uart": (out / "uart.txt").read_text()}
    return run


def test_it_runs_and_is_judged_by_what_the_plant_shows(pil) -> None:
    code, text, data = pil(STOP)
    assert code == 0, text
    assert [row["row"] for row in data["expectations"]] == ["all: speed_max_rpm", "no warnings of the board",
                                                            "target = PC in every interrupt"]
    assert "a HEX file alone does not say" in text
    assert data["plots"] == ["speed.png"]


def test_what_it_sends_is_kept(pil) -> None:
    setup = "mov #3, w0; mov w0, rpor9; mov #0x8008, w0; mov w0, u1mode; bset u1sta, #10\n"
    text = "mov #0x48, w0; mov w0, u1txreg; inc w0, w0; mov w0, u1txreg\n"
    assert pil(setup + text + STOP)[2]["uart"] == "HI"


def test_what_the_core_met_is_a_warning_with_its_address(pil) -> None:
    code, text, _ = pil(f"mov {RAM + 6}, w0\n" + STOP)
    assert code == 1
    assert "warning of the board: RAM read before it was written, 0x0806, at 0x000200" in text


# ---- lock-step -----------------------------------------------------------------------------------------------------------

@pytest.fixture
def firmware() -> Path:
    """The ELF file that `make firmware` builds, with the HEX file beside it."""
    if not xc16.COMPILER:
        pytest.skip(xc16.NONE)
    xc16.made("firmware")
    return IMAGE


@pytest.fixture
def board(firmware: Path) -> Iterator[PilBoard]:
    """A board with the firmware in the simulator."""
    chip = PilBoard(library, firmware)
    yield chip
    chip.close()


def test_every_interrupt_of_a_start_agrees(board: PilBoard) -> None:
    start(board)
    pass_ms(board, 1500)
    assert board.difference() == ""
    assert board.get("pil.ticks") > 30000
    assert board.get("pil.differences") == 0
    assert board.get("plant.speed_rpm") > 100
    assert board.warnings() == []


def test_a_changed_variable_is_named_with_its_tick(board: PilBoard) -> None:
    start(board)
    assert board.difference() == ""
    words = board.variable("board_drive", 40)
    board.write_variable("board_drive", 0) # the run command: the background's, which both follow
    pass_ms(board, 1)
    assert board.difference() == ""
    board.write_variable("board_drive", 0)
    ticks = board.get("pil.ticks")
    assert board._c.vb_iss_write(board._vb, b"board_drive", (ctypes.c_int16 * 40)(*words), 40) == 0 # an old state
    pass_ms(board, 1)
    assert re.search(rf"^tick {ticks + 1:.0f} \(\d\.\d+ s\), (P1\w+|fw\.\w+): target -?[\d.e-]+, host -?[\d.e-]+$", board.difference())
    assert board.get("pil.differences") > 0


def test_the_hex_file_runs_with_the_names_of_the_elf_file_beside_it(firmware: Path) -> None:
    chip = PilBoard(library, firmware.with_suffix(".hex"))
    start(chip)
    assert chip.get("pil.ticks") > 2000
    assert chip.difference() == ""
    chip.close()


def test_a_hex_file_alone_has_no_signals(firmware: Path, tmp_path: Path) -> None:
    chip = PilBoard(library, Path(shutil.copy(firmware.with_suffix(".hex"), tmp_path)))
    chip.power_up()
    pass_ms(chip, 10)
    assert chip.get("pil.ticks") == 0
    with pytest.raises(BoardError, match="no names"):
        chip.get("fw.state")
    chip.close()


def test_an_image_of_other_settings_is_refused(firmware: Path, tmp_path: Path) -> None:
    data = bytearray(firmware.read_bytes())
    at = symbol_at(data, "_board_drive")
    data[at + 8:at + 12] = (int.from_bytes(data[at + 8:at + 12], "little") + 2).to_bytes(4, "little")
    (tmp_path / "other.elf").write_bytes(data)
    with pytest.raises(UserError, match="same DEFINES"):
        PilBoard(library, tmp_path / "other.elf")


def test_the_status_line_comes_out_of_the_serial_port(board: PilBoard) -> None:
    start(board)
    pass_ms(board, 700)
    assert re.search(r"state \d fault NONE speed -?\d+ rpm\r\n", board.uart_take())


def test_a_handler_that_is_held_up_is_the_same_fault_in_both(board: PilBoard) -> None:
    start(board)
    board.set("cpu.isr_us", 30)
    pass_ms(board, 2)
    assert library.faults[int(board.get("fw.fault"))] == "ISR_OVERRUN"
    assert board.difference() == ""


def test_the_fault_input_is_a_named_fault_in_both(board: PilBoard) -> None:
    start(board)
    board.set("input.flta", 1)
    pass_ms(board, 2)
    assert board.get("fw.fault") != 0
    assert board.difference() == ""
    assert board.get("pwm.outputs_on") == 0


def test_the_fault_recorder_sends_the_trace_to_the_byte(board: PilBoard) -> None:
    start(board)
    board.trace_start(["fw.fault", "reg.ADC1BUF1", "reg.ADC1BUF2", "fw.v_d_v", "fw.v_q_v", "fw.theta_ctrl_deg", "fw.state", "fw.slow_phase"], 1)
    pass_ms(board, 100)
    board.uart_take()
    board.set("input.flta", 1)
    pass_ms(board, 400)
    record, = recorder.parse(board.uart_take(), "")
    assert (record.fault, record.every, len(record.rows), record.fault_row(7)) == (1, 4, 64, 48)
    rows, trace = recorder.scaled(record, library.params, library.states), board.trace_take()
    at = int((trace[:, 0] != 0).argmax())
    at += -int(trace[at, 7]) % 4 # a row belongs to every fourth period
    part = trace[at - 4 * 48:at + 4 * 16:4].astype(float)
    volts = library.params["COUNT_VOLTAGE_V"]
    for column, place, count in ((1, recorder.I_A, 1.0), (2, recorder.I_B, 1.0), (3, recorder.V_D, volts), (4, recorder.V_Q, volts),
                                 (5, recorder.ANGLE, 360.0 / 65536.0)):
        words = (part[:, column] / count).round().astype(int)
        assert (words >> 8 & 0xFF).tolist() == [row[place] & 0xFF for row in record.rows]
    assert part[:, 6].tolist() == record.states
    assert rows.bus_v[rows.bus_v > 0] == pytest.approx(24.0, abs=0.5)


def test_a_fault_is_shown_without_a_gap_while_the_watchdog_resets(board: PilBoard) -> None:
    start(board)
    board.set("cpu.isr_dropped", 1)
    pass_ms(board, 10)
    board.trace_start(["fw.fault", "fw.state"], 1)
    pass_ms(board, 100)
    assert board.get("cpu.resets") > 3
    assert {library.faults[int(value)] for value in board.trace_take()[:, 0]} == {"ADC_LOST"}
    board.power_up()
    assert board.get("fw.fault") == 0


# ---- resets: outputs off when something in the chip goes wrong, the watchdog's reset, and a cause that outlives it ------------------

T3, AD1, STKERR = 1 << 8, 1 << 13, 1 << 2
C = library.c


@pytest.fixture
def running(board: PilBoard) -> PilBoard:
    """A motor that runs, without comparison."""
    C.vb_iss_core.restype, C.vb_iss_core.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
    C.iss_poke.restype, C.iss_poke.argtypes = None, [ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16]
    C.iss_irq_changed.restype, C.iss_irq_changed.argtypes = None, [ctypes.c_void_p]
    board.lock_step(False)
    start(board)
    assert board.get("pwm.outputs_on") != 0
    assert board.get("cpu.resets") == 1 # the watchdog's test at power-up
    board.uart_take()
    return board


def change(chip: PilBoard, register: str, clear: int, put: int = 0) -> None:
    address, core = REGISTERS[register], C.vb_iss_core(chip._vb)
    C.iss_poke(core, address, chip.peek(address) & ~clear | put)
    C.iss_irq_changed(core)


def off_within_ms(chip: PilBoard, ms: float) -> None:
    """From here on until the reset and beyond it no output conducts."""
    pass_ms(chip, ms)
    for _ in range(int(60 * 20)):
        assert chip.get("pwm.outputs_on") == 0
        chip.run(1)


@pytest.mark.parametrize("registers, off_ms, fault", [
    ([("iec0", AD1, 0)], 3.1, 10), ([("ifs0", 0, T3), ("iec0", 0, T3)], 0.1, 12)],
    ids=["ADC_LOST: a control interrupt that stays away", "TRAP: an interrupt that nobody expects and nobody ends"])
def test_outputs_go_off_and_the_fault_outlives_the_watchdogs_reset(running: PilBoard, registers: list[tuple], off_ms: float,
                                                                   fault: int) -> None:
    for register, clear, put in registers:
        change(running, register, clear, put)
    off_within_ms(running, off_ms)
    pass_ms(running, 700)
    assert running.get("cpu.resets") == 2
    sent = running.uart_take()
    name = drive_tables.faults()[fault].name
    assert re.search(rf"reset WDTO\r\n(.*\n)*state 7 fault {name} speed", sent)
    record = recorder.parse(sent.partition("reset WDTO")[2], "")[0]
    assert record.fault == fault and len(record.rows) == 64 and set(record.states) <= {3, 7}, "what came before it outlives the reset, too"
    assert running.get("pwm.outputs_on") == 0
    assert [text for text in running.warnings() if "PLL" in text] == [], "the old clock goes on over this reset"


def test_a_stack_that_overflows(running: PilBoard) -> None:
    change(running, "splim", 0xFFFF, running.peek(REGISTERS["wreg15"]) - 4)
    off_within_ms(running, 0.1)
    pass_ms(running, 700)
    assert running.get("fw.fault") == 12
    assert running.variable("board_trap_intcon1", 1)[0] & STKERR == STKERR
    assert recorder.parse(running.uart_take(), "")[-1].fault == 12


def test_power_on_forgets_it_all(running: PilBoard) -> None:
    change(running, "iec0", AD1)
    pass_ms(running, 40)
    running.power_up()
    pass_ms(running, 700)
    sent = running.uart_take().rpartition("reset BOR POR")[2]
    assert re.search(r"^\r\n(.*\n)*state 1 fault NONE speed", sent)
    assert "record" not in sent
