"""make firmware as a user calls it: without the compiler one clear line; with it no warning at any level, and a build that fails for a bad image."""

import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from tools.target import device, image

ROOT = Path(__file__).resolve().parents[2]
MAKES_OWN = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "OPT", "DEFINES", "USERPARAMS", "VARIANT", "DFP", "V")
TREE = ("Makefile", "userparams.h", "firmware", "include", "tools/__init__.py", "tools/foc33", "tools/target", "tools/setup")
NEEDED = ("make", "python3", "sh", "env", "grep", "sed", "test", "cat", "rm", "mv", "mkdir", "cmp", "printf", "getconf", "echo", "dirname", "head",
          "tail", "id", "gcc", "ar", "wc", "sort", "cut", "expr")


def xc16() -> str | None:
    folder = os.environ.get("XC16")
    return shutil.which(f"{folder}/bin/xc16-gcc" if folder else "xc16-gcc")


def make(*arguments: str, root: Path = ROOT, path: str | None = None) -> subprocess.CompletedProcess:
    environment = {name: value for name, value in os.environ.items() if name not in MAKES_OWN and (path is None or name != "XC16")}
    if path is not None:
        environment["PATH"] = path
    return subprocess.run(["make", "-s", *arguments], cwd=root, env=environment, capture_output=True, text=True, check=False)


def our_lines(done: subprocess.CompletedProcess) -> list[str]:
    return [line for line in done.stderr.splitlines() if line.startswith("foc33: ")]


class WithoutCompiler(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        for name in NEEDED: # a PATH that has everything but the compiler
            found = shutil.which(name)
            if found:
                (self.folder / name).symlink_to(found)

    def test_a_missing_compiler_is_one_line_that_says_what_to_install(self):
        done = make("firmware", "VARIANT=none", path=str(self.folder))
        self.assertEqual(done.returncode, 2)
        self.assertEqual(len(our_lines(done)), 1, done.stderr)
        self.assertRegex(our_lines(done)[0], "no xc16-gcc, not on PATH: install Microchip's MPLAB XC16 .*XC16=")

    def test_a_wrong_folder_is_named(self):
        done = make("firmware", "VARIANT=none", "XC16=/nowhere/v2.10", path=str(self.folder))
        self.assertEqual(done.returncode, 2)
        self.assertEqual(len(our_lines(done)), 1, done.stderr)
        self.assertIn("XC16=/nowhere/v2.10 has no bin/xc16-gcc", our_lines(done)[0])

    def test_nothing_is_left_that_looks_like_an_image(self):
        make("firmware", "VARIANT=none", path=str(self.folder))
        self.assertFalse((ROOT / "build/target-none/foc33.hex").exists())


@unittest.skipUnless(xc16(), "xc16-gcc is not on PATH; give XC16=folder")
class WithCompiler(unittest.TestCase):
    def build(self, *arguments: str, folder: str) -> tuple[image.Elf, dict[int, int]]:
        done = make("firmware", "VARIANT=check", *arguments)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return image.read_elf(ROOT / folder / "foc33.elf"), image.read_hex(ROOT / folder / "foc33.hex")

    def test_no_warning_and_a_good_image_at_every_level(self):
        for level, folder in (("-O1", "build/target-O1-check"), ("-O2", "build/target-check"), ("-O3", "build/target-O3-check")):
            with self.subTest(level):
                self.build(f"OPT={level}", folder=folder)

    def test_no_warning_and_a_good_image_in_every_mode(self):
        for mode in ("OPEN_LOOP_FUNCTIONING", "TUNING", "TORQUE_MODE", "BIDIRECTIONAL_SPEED", "SNAPSHOT", "IDENTIFY", "PARAMS_IN_RAM"):
            with self.subTest(mode):
                done = make("firmware", f"VARIANT=check-{mode}", f"DEFINES=-D{mode}")
                self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_the_hex_starts_the_program_and_serves_the_control_interrupt(self):
        elf, words = self.build(folder="build/target-check")
        self.assertEqual(words[0], 0x040000 | elf.symbols["__reset"])
        for base in (device.IVT, device.AIVT):
            self.assertEqual(words[base + 2 * device.VECTORS.index("_ADC1Interrupt")], elf.symbols["__ADC1Interrupt"])
            self.assertEqual(words[base + 2 * device.VECTORS.index("_T3Interrupt")], elf.symbols["__DefaultInterrupt"])
        self.assertEqual(words[0xF80006] & 0x07, 0)    # starts on FRC
        self.assertEqual(words[0xF80008] & 0xE7, 0x45) # XT, clock switching, pin selection may be unlocked
        self.assertEqual(words[0xF8000C] & 0xE7, 0xE7) # PWM pins inputs at reset, active high, 128 ms
        self.assertEqual(words[0xF8000E] & 0x23, 0x01) # PGD3, no JTAG

    def test_other_flags_rebuild_and_the_same_flags_do_not(self):
        self.build(folder="build/target-check")
        elf = ROOT / "build/target-check/foc33.elf"
        before = elf.stat().st_mtime_ns
        self.build(folder="build/target-check")
        self.assertEqual(elf.stat().st_mtime_ns, before)
        self.assertEqual(make("firmware", "VARIANT=check", "DEFINES=-DPARAMS_IN_RAM").returncode, 0)
        self.assertNotEqual(elf.stat().st_mtime_ns, before)


@unittest.skipUnless(xc16(), "xc16-gcc is not on PATH; give XC16=folder")
class BadCode(unittest.TestCase):
    """Sources with a mistake, in a copy of the project."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        for name in TREE:
            source, target = ROOT / name, self.root / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)

    def spoil(self, file: str, old: str, new: str) -> subprocess.CompletedProcess:
        path = self.root / file
        text = path.read_text(encoding="utf-8")
        self.assertIn(old, text)
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        done = make("firmware", root=self.root)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertFalse((self.root / "build/target/checked").exists())
        return done

    def add(self, body: str) -> str:
        """A line of code in main's loop. @return what the build says of the image"""
        head = "void firmware_background(void)\n{\n"
        return " ".join(our_lines(self.spoil("firmware/board/firmware.c", head, f"static volatile int32_t spoil_a, spoil_b;\n{head}    {body}\n")))

    def test_a_float_fails_the_build_with_its_place(self):
        self.assertRegex(self.add("spoil_a = (int32_t)((float)spoil_b * 1.5F);"), r"called by firmware_background\(\).*: a float: use a Q format")

    def test_a_long_division_fails_the_build_with_its_place(self):
        self.assertRegex(self.add("spoil_a = spoil_a / spoil_b;"), r"called by firmware_background\(\).*: a division: use qm_divud")

    def test_a_missing_handler_fails_the_build(self):
        lines = " ".join(our_lines(self.spoil("firmware/board/isr.c", "void BOARD_ISR _MathError(void)\n{", "void BOARD_ISR _T2Interrupt(void);\n"
                                              "void BOARD_ISR _T2Interrupt(void)\n{")))
        self.assertIn("the image has no _MathError", lines)

    def test_a_wrong_configuration_word_fails_the_build(self):
        lines = " ".join(our_lines(self.spoil("firmware/board/config.c", "PWMPIN = ON", "PWMPIN = OFF")))
        self.assertIn("PWMPIN = OFF in config.c, but the board needs ON (PWM pins are inputs at reset)", lines)

    def test_a_warning_fails_the_build(self):
        done = self.spoil("firmware/board/main.c", "int main(void)\n{", "int main(void)\n{\n    int unused = 1;")
        self.assertIn("unused variable", done.stderr)


if __name__ == "__main__":
    unittest.main()
