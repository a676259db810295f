"""The target image on the virtual board against the host's firmware. Needs XC16: the image is what `make firmware` builds."""

import ctypes
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from chip import ROOT, library, pass_ms # noqa: E402
from tools.foc33.board import BoardError # noqa: E402
from tools.foc33.errors import UserError # noqa: E402
from tools.foc33.pil import PilBoard # noqa: E402

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

    def test_the_fault_input_is_a_named_fault_in_both(self) -> None:
        start(self.chip)
        self.chip.set("input.flta", 1)
        pass_ms(self.chip, 2)
        self.assertNotEqual(0, self.chip.get("fw.fault"))
        self.assertEqual("", self.chip.difference())
        self.assertEqual(0, self.chip.get("pwm.outputs_on"))


if __name__ == "__main__":
    unittest.main()
