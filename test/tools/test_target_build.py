"""make firmware as a user calls it: without the compiler one clear line; with it no warning at any level, and a build that fails for a bad image."""

import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from tools.image import device, image

ROOT = Path(__file__).resolve().parents[2]
MAKES_OWN = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "OPT", "DEFINES", "USERPARAMS", "VARIANT", "DFP", "V")
TREE = ("Makefile", "userparams.h", "firmware", "include", "tools/__init__.py", "tools/bench", "tools/image", "tools/setup")
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

    def test_bad_input_is_one_line_that_says_what_to_give(self):
        (self.folder / "xc16-gcc").symlink_to(shutil.which("true"))
        for word, expected in (("OPT=-O7", "no such level, OPT=-O7: use -O1, -O2 or -O3"), ("OPT=", "no such level, OPT=: use"),
                               ("OPT=-O1 -O2", "no such level"), ("OPT=fast", "no such level"), ("DFP=/nowhere", "no device pack for XC16, DFP=/nowhere: name"),
                               ("DEFINES=-DTUNNING", "no mode -DTUNNING, DEFINES=-DTUNNING: use .*-DTUNING"), ("DEFINES=TUNING", "no mode TUNING"),
                               ("DEFINES=-DTUNING=0", "no mode -DTUNING=0"),
                               ("USERPARAMS=/nowhere", "no userparams.h, USERPARAMS=/nowhere: name a folder")):
            with self.subTest(word):
                done = make("firmware", "VARIANT=none", word, path=str(self.folder))
                self.assertEqual((done.returncode, len(our_lines(done))), (2, 1), done.stderr)
                self.assertRegex(our_lines(done)[0], expected)
                self.assertNotIn("No such file", done.stderr)
        self.assertFalse(list((ROOT / "build").glob("target-O7*")), "no folder for a level that is refused")

    def test_a_misspelt_mode_is_refused_on_the_pc_too(self):
        done = make("lib", "VARIANT=none", "DEFINES=-DTUNNING")
        self.assertEqual((done.returncode, len(our_lines(done))), (2, 1), done.stderr)
        self.assertIn("no mode -DTUNNING", our_lines(done)[0])

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
        self.assertEqual(words[0xF8000A] & 0xDF, 0xC4) # watchdog always on, no window, 32 kHz / 32 / 16
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

    def change(self, file: str, old: str, new: str) -> None:
        path = self.root / file
        text = path.read_text(encoding="utf-8")
        self.assertIn(old, text)
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    def spoil(self, file: str, old: str, new: str) -> subprocess.CompletedProcess:
        self.change(file, old, new)
        done = make("firmware", root=self.root)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        for name in ("checked", "foc33.hex"): # nothing that looks like an image to flash
            self.assertFalse((self.root / "build/target" / name).exists(), name)
        return done

    def add(self, body: str, before: str = "static volatile int32_t spoil_a, spoil_b;") -> str:
        """A line of code in main's loop. @return what the build says of the image"""
        head = "void firmware_background(void)\n{\n"
        return " ".join(our_lines(self.spoil("firmware/board/firmware.c", head, f"{before}\n{head}    {body}\n")))

    def test_a_float_fails_the_build_with_its_place(self):
        self.assertRegex(self.add("spoil_a = (int32_t)((float)spoil_b * 1.5F);"), r"called by firmware_background\(\).*: a float: use a Q format")

    def test_a_long_division_fails_the_build_with_its_place(self):
        self.assertRegex(self.add("spoil_a = spoil_a / spoil_b;"), r"called by firmware_background\(\).*: a division: use qm_divud")

    def test_a_64_bit_division_or_product_fails_the_build_with_its_place(self):
        numbers = "static volatile int64_t spoil_c;"
        self.assertRegex(self.add("spoil_c = spoil_c / board_drive.ticks;", numbers), r"called by firmware_background\(\).*: a division: use qm_divud")

    def test_a_division_by_a_variable_fails_the_build_although_it_needs_no_library(self):
        self.assertRegex(self.add("board_drive.timer = (uint16_t)(100u / board_drive.ticks);"), r"firmware_background\(\) divides by a variable")

    def test_arrays_beyond_the_budgets_fail_the_build(self):
        self.assertRegex(self.add("spoil_ram[board_drive.ticks & 255u] = 1;", "static volatile int16_t spoil_ram[256];"),
                         "RAM: [0-9]+ bytes of a budget of 768")
        self.assertRegex(self.add("board_drive.timer = spoil_flash[board_drive.ticks & 1023u];",
                                  "extern const uint16_t spoil_flash[1024];\nconst uint16_t spoil_flash[1024] = { 1 };"),
                         "flash: [0-9]+ bytes of a budget of 12288")

    def test_recursion_and_calls_through_pointers_fail_the_build(self):
        call = "static __attribute__((noinline)) void spoil(volatile uint16_t n)"
        self.assertRegex(self.add("spoil(board_drive.ticks);", f"{call};\n{call}\n{{\n    if (n) {{\n        spoil((uint16_t)(n - 1u));\n"
                                  "        n = 3;\n    }\n}"), "stack: recursion: spoil -> spoil")
        self.assertRegex(self.add("spoil_pointer();", "extern void (*volatile spoil_pointer)(void);\nvoid (*volatile spoil_pointer)(void) = pwm_outputs_off;"),
                         "stack: firmware_background: call through a pointer")

    def test_a_stack_beyond_its_budget_fails_the_build(self):
        self.assertRegex(self.add("spoil();", "static __attribute__((noinline)) void deeper(void)\n{\n    volatile uint16_t some[62];\n    some[0] = 1;\n}\n"
                                  "static __attribute__((noinline)) void spoil(void)\n{\n    volatile uint16_t some[62];\n    some[0] = 1;\n    deeper();\n"
                                  "    some[1] = 1;\n}"), "stack: up to [0-9]+ bytes of 512")

    def test_a_mode_in_userparams_h_is_not_held_to_the_budget_of_the_delivered_drive(self):
        self.change("userparams.h", "/* #define IDENTIFY */", "#define IDENTIFY")
        done = make("firmware", root=self.root)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("of 33024 bytes of the chip", done.stdout)

    def test_a_missing_handler_fails_the_build(self):
        lines = " ".join(our_lines(self.spoil("firmware/board/isr.c", "void BOARD_ISR _MathError(void)\n{", "void BOARD_ISR _T2Interrupt(void);\n"
                                              "void BOARD_ISR _T2Interrupt(void)\n{")))
        self.assertIn("the image has no _MathError", lines)

    def test_a_wrong_configuration_word_fails_the_build(self):
        lines = " ".join(our_lines(self.spoil("firmware/board/config.c", "PWMPIN = ON", "PWMPIN = OFF")))
        self.assertIn("PWMPIN = OFF in config.c, but the board needs ON (PWM pins are inputs at reset)", lines)

    def test_a_watchdog_that_is_off_or_too_slow_fails_the_build(self):
        for old, new in (("FWDTEN = ON", "FWDTEN = OFF"), ("WDTPOST = PS16", "WDTPOST = PS32768"), ("WDTPRE = PR32", "WDTPRE = PR128"),
                         ("WINDIS = OFF", "WINDIS = ON")):
            with self.subTest(new):
                self.assertIn(f"{new} in config.c, but the board needs", " ".join(our_lines(self.spoil("firmware/board/config.c", old, new))))
                self.change("firmware/board/config.c", new, old)

    def test_a_warning_fails_the_build(self):
        done = self.spoil("firmware/board/main.c", "int main(void)\n{", "int main(void)\n{\n    int unused = 1;")
        self.assertIn("unused variable", done.stderr)


if __name__ == "__main__":
    unittest.main()
