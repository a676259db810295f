"""The target image on the virtual board against the host's firmware. Needs XC16: the image is what `make firmware` builds."""

import contextlib
import ctypes
import io
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from chip import RAM, REGISTERS, ROOT, STOP, image, library, pass_ms # noqa: E402
from tools.bench import pil_command # noqa: E402
from tools.bench.board import BoardError # noqa: E402
from tools.common.errors import UserError # noqa: E402
from tools.bench.pil import PilBoard # noqa: E402

XC16 = shutil.which("xc16-gcc", path=os.pathsep.join([os.path.join(os.environ.get("XC16", ""), "bin"), os.environ.get("PATH", "")]))
IMAGE = ROOT / "build" / "target" / "foc33.elf"


def symbol_at(elf: bytes, name: bytes) -> int:
    """Offset of the symbol table's entry with this name."""
    sections, count = int.from_bytes(elf[32:36], "little"), int.from_bytes(elf[48:50], "little")
    headers = [struct.unpack_from("<10I", elf, sections + 40 * n) for n in range(count)]
    table = next(header for header in headers if header[1] == 2)
    strings = headers[table[6]][4]
    for at in range(table[4], table[4] + table[5], 16):
        text = strings + int.from_bytes(elf[at:at + 4], "little")
        if elf[text:text + len(name)] == name:
            return at
    raise ValueError(name)


def start(chip: PilBoard) -> None:
    """Power-up, calibration, and S2."""
    chip.power_up()
    pass_ms(chip, 100)
    chip.set("input.s2", 1)
    pass_ms(chip, 60)
    chip.set("input.s2", 0)


class Refused(unittest.TestCase):
    """What can be told without a compiler for the target."""

    def test_an_image_that_is_no_image_is_one_line(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            for name, content in (("missing.elf", None), ("empty.elf", b""), ("text.elf", b"no image"), ("cut.hex", b":10000000AA\n")):
                path = Path(folder) / name
                if content is not None:
                    path.write_bytes(content)
                with self.subTest(name), self.assertRaises((UserError, BoardError)) as caught:
                    PilBoard(library, path).close()
                self.assertIn(name, str(caught.exception))
                self.assertNotIn("\n", str(caught.exception))


class HexAlone(unittest.TestCase):
    """A program without names, through the whole of `make pil`."""

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

    def run_program(self, program: str) -> tuple[int, str, dict]:
        with tempfile.TemporaryDirectory() as folder:
            scenario, out = Path(folder) / "short.toml", Path(folder) / "out"
            scenario.write_text(self.SCENARIO, encoding="utf-8")
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
                code = pil_command.main([str(scenario), "--image", str(image(program)), "--out", str(out), "--quiet"])
            return code, printed.getvalue(), json.loads((out / "summary.json").read_text()) | {"uart": (out / "uart.txt").read_text()}

    def test_it_runs_and_is_judged_by_what_the_plant_shows(self) -> None:
        code, text, data = self.run_program(STOP)
        self.assertEqual(0, code, text)
        self.assertEqual(["all: speed_max_rpm", "no warnings of the board", "target = PC in every interrupt"],
                         [row["row"] for row in data["expectations"]])
        self.assertIn("a HEX file alone does not say", text)
        self.assertEqual(["speed.png"], data["plots"])

    def test_what_it_sends_is_kept(self) -> None:
        setup = "mov #3, w0; mov w0, rpor9; mov #0x8008, w0; mov w0, u1mode; bset u1sta, #10; mov #0x48, w0; mov w0, u1txreg; inc w0, w0; mov w0, u1txreg\n"
        self.assertEqual("HI", self.run_program(setup + STOP)[2]["uart"])

    def test_what_the_core_met_is_a_warning_with_its_address(self) -> None:
        code, text, _ = self.run_program(f"mov {RAM + 6}, w0\n" + STOP)
        self.assertEqual(1, code)
        self.assertIn("warning of the board: RAM read before it was written, 0x0806, at 0x000200", text)


@unittest.skipUnless(XC16, "xc16-gcc is not installed")
class LockStep(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        subprocess.run(["make", "-s", "-C", str(ROOT), "firmware"], check=True, env={k: v for k, v in os.environ.items() if not k.startswith("MAKE")})

    def setUp(self) -> None:
        self.chip = PilBoard(library, IMAGE)
        self.addCleanup(self.chip.close)

    def test_every_interrupt_of_a_start_agrees(self) -> None:
        start(self.chip)
        pass_ms(self.chip, 1500)
        self.assertEqual("", self.chip.difference())
        self.assertGreater(self.chip.get("pil.ticks"), 30000)
        self.assertEqual(0, self.chip.get("pil.differences"))
        self.assertGreater(self.chip.get("plant.speed_rpm"), 100)
        self.assertEqual([], self.chip.warnings())

    def test_a_changed_variable_is_named_with_its_tick(self) -> None:
        start(self.chip)
        self.assertEqual("", self.chip.difference())
        words = self.chip.variable("board_drive", 40)
        self.chip.write_variable("board_drive", 0) # the run command: the background's, which both follow
        pass_ms(self.chip, 1)
        self.assertEqual("", self.chip.difference())
        self.chip.write_variable("board_drive", 0)
        ticks = self.chip.get("pil.ticks")
        poke = (ctypes.c_int16 * 40)(*words)
        self.assertEqual(0, self.chip._c.vb_iss_write(self.chip._vb, b"board_drive", poke, 40)) # an old state
        pass_ms(self.chip, 1)
        self.assertRegex(self.chip.difference(), rf"^tick {ticks + 1:.0f} \(\d\.\d+ s\), (P1\w+|fw\.\w+): target -?[\d.e-]+, host -?[\d.e-]+$")
        self.assertGreater(self.chip.get("pil.differences"), 0)

    def test_the_hex_file_runs_with_the_names_of_the_elf_file_beside_it(self) -> None:
        self.chip.close()
        chip = PilBoard(library, IMAGE.with_suffix(".hex"))
        self.addCleanup(chip.close)
        start(chip)
        self.assertGreater(chip.get("pil.ticks"), 2000)
        self.assertEqual("", chip.difference())

    def test_a_hex_file_alone_has_no_signals(self) -> None:
        self.chip.close()
        with tempfile.TemporaryDirectory() as folder:
            alone = shutil.copy(IMAGE.with_suffix(".hex"), folder)
            chip = PilBoard(library, Path(alone))
        self.addCleanup(chip.close)
        chip.power_up()
        pass_ms(chip, 10)
        self.assertEqual(0, chip.get("pil.ticks"))
        with self.assertRaisesRegex(BoardError, "no names"):
            chip.get("fw.state")

    def test_an_image_of_other_settings_is_refused(self) -> None:
        self.chip.close()
        with tempfile.TemporaryDirectory() as folder:
            other = Path(folder) / "other.elf"
            data = bytearray(IMAGE.read_bytes())
            at = symbol_at(data, b"_board_drive\0")
            size = int.from_bytes(data[at + 8:at + 12], "little")
            data[at + 8:at + 12] = (size + 2).to_bytes(4, "little")
            other.write_bytes(data)
            with self.assertRaisesRegex(UserError, "same DEFINES"):
                PilBoard(library, other)

    def test_the_status_line_comes_out_of_the_serial_port(self) -> None:
        start(self.chip)
        pass_ms(self.chip, 700)
        self.assertRegex(self.chip.uart_take(), r"state \d fault 0 speed -?\d+ rpm\r\n")

    def test_a_handler_that_is_held_up_is_the_same_fault_in_both(self) -> None:
        start(self.chip)
        self.chip.set("cpu.isr_us", 30)
        pass_ms(self.chip, 2)
        self.assertEqual("ISR_OVERRUN", library.faults[int(self.chip.get("fw.fault"))])
        self.assertEqual("", self.chip.difference())

    def test_a_fault_is_shown_without_a_gap_while_the_watchdog_resets(self) -> None:
        start(self.chip)
        self.chip.set("cpu.isr_dropped", 1)
        pass_ms(self.chip, 10)
        self.chip.trace_start(["fw.fault", "fw.state"], 1)
        pass_ms(self.chip, 100)
        self.assertGreater(self.chip.get("cpu.resets"), 3)
        faults = {library.faults[int(value)] for value in self.chip.trace_take()[:, 0]}
        self.assertEqual({"ADC_LOST"}, faults)
        self.chip.power_up()
        self.assertEqual(0, self.chip.get("fw.fault"))

    def test_the_fault_input_is_a_named_fault_in_both(self) -> None:
        start(self.chip)
        self.chip.set("input.flta", 1)
        pass_ms(self.chip, 2)
        self.assertNotEqual(0, self.chip.get("fw.fault"))
        self.assertEqual("", self.chip.difference())
        self.assertEqual(0, self.chip.get("pwm.outputs_on"))


@unittest.skipUnless(XC16, "xc16-gcc is not installed")
class Resets(unittest.TestCase):
    """The image when something in the chip goes wrong: outputs off, the watchdog's reset, and a cause that outlives it."""

    T3, AD1, STKERR = 1 << 8, 1 << 13, 1 << 2

    def setUp(self) -> None:
        subprocess.run(["make", "-s", "-C", str(ROOT), "firmware"], check=True, env={k: v for k, v in os.environ.items() if not k.startswith("MAKE")})
        self.chip = PilBoard(library, IMAGE)
        self.addCleanup(self.chip.close)
        self.core = library.c
        self.core.vb_iss_core.restype, self.core.vb_iss_core.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
        self.core.iss_poke.restype, self.core.iss_poke.argtypes = None, [ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16]
        self.core.iss_irq_changed.restype, self.core.iss_irq_changed.argtypes = None, [ctypes.c_void_p]
        self.chip.lock_step(False)
        start(self.chip)
        self.assertNotEqual(0, self.chip.get("pwm.outputs_on"))
        self.assertEqual(0, self.chip.get("cpu.resets"))
        self.chip.uart_take()

    def change(self, register: str, clear: int, put: int = 0) -> None:
        address, core = REGISTERS[register], self.core.vb_iss_core(self.chip._vb)
        self.core.iss_poke(core, address, self.chip.peek(address) & ~clear | put)
        self.core.iss_irq_changed(core)

    def off_within_ms(self, ms: float) -> None:
        """From here on until the reset and beyond it no output conducts."""
        pass_ms(self.chip, ms)
        for _ in range(int(60 * 20)):
            self.assertEqual(0, self.chip.get("pwm.outputs_on"))
            self.chip.run(1)

    def came_back(self, fault: int) -> None:
        """After one reset by the watchdog, with the fault kept."""
        pass_ms(self.chip, 700)
        self.assertEqual(1, self.chip.get("cpu.resets"))
        self.assertRegex(self.chip.uart_take(), rf"reset WDTO\r\n(.*\n)*state 7 fault {fault} speed")
        self.assertEqual(0, self.chip.get("pwm.outputs_on"))
        self.assertEqual([], [text for text in self.chip.warnings() if "PLL" in text], "the old clock goes on over this reset")

    def test_a_control_interrupt_that_stays_away(self) -> None:
        self.change("iec0", self.AD1)
        self.off_within_ms(3.1)
        self.came_back(10) # ADC_LOST

    def test_an_interrupt_that_nobody_expects_and_nobody_ends(self) -> None:
        self.change("ifs0", 0, self.T3)
        self.change("iec0", 0, self.T3)
        self.off_within_ms(0.1)
        self.came_back(12) # TRAP

    def test_a_stack_that_overflows(self) -> None:
        self.change("splim", 0xFFFF, self.chip.peek(REGISTERS["wreg15"]) - 4)
        self.off_within_ms(0.1)
        pass_ms(self.chip, 700)
        self.assertEqual(12, self.chip.get("fw.fault"))
        self.assertEqual(self.STKERR, self.chip.variable("board_trap_intcon1", 1)[0] & self.STKERR)

    def test_power_on_forgets_it_all(self) -> None:
        self.change("iec0", self.AD1)
        pass_ms(self.chip, 40)
        self.chip.power_up()
        pass_ms(self.chip, 700)
        self.assertRegex(self.chip.uart_take(), r"reset BOR POR\r\n(.*\n)*state 1 fault 0 speed")
