"""The checks of a target image: a good image passes, and each broken thing is one line that says what and where."""

import contextlib
import io
import random
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import target_support
from target_support import LIBRARY, RETFIE, made

from tools.image import device, image

CALL = 0x020000
RCALL = 0x070000


def run(arguments: list[str]) -> tuple[int, str, list[str]]:
    """Exit status, stdout, lines of stderr of the command."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = image.main(arguments)
    return status, out.getvalue(), error.getvalue().splitlines()


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.image = made()

    def check(self, *more: str) -> tuple[int, str, list[str]]:
        return run([*self.image.write(self.folder), *more])

    def fails(self, *patterns: str, more: tuple[str, ...] = ()) -> None:
        """The image fails with exactly these lines."""
        status, _, lines = self.check(*more)
        self.assertEqual(status, 1, lines)
        self.assertEqual(len(lines), len(patterns), lines)
        for pattern, line in zip(patterns, lines):
            self.assertRegex(line, pattern)

    def passes(self, *more: str) -> str:
        status, out, lines = self.check(*more)
        self.assertEqual((status, lines), (0, []))
        return out


class Image(Case):
    def test_a_good_image_passes_and_its_sizes_are_printed(self):
        words = sum(address in device.PROGRAM for address in self.image.words)
        self.assertIn(f"flash {3 * words} of 33024 bytes of the chip, RAM 300 of 2048 bytes of the chip, 1732 bytes free", self.passes())

    def test_another_part_is_refused(self):
        self.image.parts = ("33FJ128MC802",)
        self.fails("the image is for 33FJ128MC802, not for the 33FJ32MC204")

    def test_one_file_that_was_compiled_for_another_part_is_refused(self):
        self.image.parts = (device.NAME, "33FJ64MC204")
        self.fails("for 33FJ32MC204, 33FJ64MC204, not")

    def test_a_word_above_the_flash_is_refused(self):
        self.image.words[0x5800] = 0
        self.fails("1 words outside the flash .*0x005800")

    def test_the_last_word_of_the_flash_is_inside(self):
        self.image.words[0x57FE] = 0
        self.image.places.append((0x57FE, 2, ".text", "a.o"))
        self.passes()

    def test_a_hex_of_another_elf_is_refused(self):
        self.image.hex_words = dict(self.image.words)
        self.image.hex_words[0x204] ^= 1
        self.image.hex_words[0x5000] = 7
        self.fails("HEX and ELF differ in 2 words, the first at 0x000204: 0x000001 in the HEX, 0x000000 in the ELF")


class Vectors(Case):
    def test_the_vectors_have_the_addresses_of_the_family_s_reference_manual(self):
        places = {name: 4 + 2 * number for number, name in enumerate(device.VECTORS)}
        for name, place in (("_OscillatorFail", 0x06), ("_AddressError", 0x08), ("_StackError", 0x0A), ("_MathError", 0x0C), ("_INT0Interrupt", 0x14),
                            ("_T1Interrupt", 0x1A), ("_U1RXInterrupt", 0x2A), ("_U1TXInterrupt", 0x2C), ("_ADC1Interrupt", 0x2E),
                            ("_CNInterrupt", 0x3A), ("_MPWM1Interrupt", 0x86), ("_FLTA1Interrupt", 0x92)):
            self.assertEqual(places[name], place, name)
        self.assertEqual(len(device.VECTORS), (0x100 - 0x04) // 2)

    def test_every_erased_vector_is_found_in_both_tables(self):
        for base, table in ((device.IVT, "IVT"), (device.AIVT, "AIVT")):
            for number, name in enumerate(device.VECTORS[:8 + device.LEFT_ERASED]):
                with self.subTest(table=table, name=name):
                    self.image = made()
                    del self.image.words[base + 2 * number]
                    self.fails(rf"vector {name} of the {table} \(0x{base + 2 * number:03X}\) is erased")

    def test_the_product_may_leave_the_end_of_the_tables_erased(self):
        for base in (device.IVT, device.AIVT):
            for number in range(8 + device.LEFT_ERASED, len(device.VECTORS)):
                del self.image.words[base + 2 * number]
        self.passes()

    def test_swapped_handlers_are_found(self):
        self.image.point("_ADC1Interrupt", self.image.symbols["__FLTA1Interrupt"])
        self.fails(r"vector _ADC1Interrupt of the IVT \(0x02E\) goes to .* \(_FLTA1Interrupt\), not to .* \(_ADC1Interrupt\)", "of the AIVT")

    def test_an_unused_vector_must_go_to_the_default(self):
        self.image.point("_T2Interrupt", self.image.symbols["_main"])
        self.fails(r"_T2Interrupt of the IVT .*\(main\), not to .*_DefaultInterrupt", "AIVT")

    def test_a_function_that_exists_must_be_in_its_vector(self):
        self.image.function("_T1Interrupt", RETFIE)
        self.fails("_T1Interrupt of the IVT .*_DefaultInterrupt.*, not to .*_T1Interrupt", "AIVT")

    def test_many_wrong_vectors_are_a_few_lines(self):
        for number in range(len(device.VECTORS)):
            self.image.words[device.IVT + 2 * number] = 0
        self.fails("IVT", "IVT", "IVT", "and 123 more vectors of the IVT")

    def test_a_missing_handler_is_named(self):
        for name in device.REQUIRED:
            with self.subTest(name):
                self.image = made()
                del self.image.symbols[f"_{name}"]
                self.image.point(name, self.image.symbols["__DefaultInterrupt"])
                self.fails(f"the image has no {name}: ")

    def test_a_misspelt_handler_is_named(self):
        self.image.function("_ADC1Interupt", RETFIE)
        self.passes() # no vector's name at all: the compiler warns of it
        self.image.function("_ADC2Interrupt", RETFIE)
        self.fails("_ADC2Interrupt is no vector of the 33FJ32MC204: the function never runs")

    def test_the_compilers_own_default_handler_is_refused(self):
        self.image.places = [place if place[0] != self.image.symbols["__DefaultInterrupt"] else (*place[:2], ".isr", "default_isr")
                             for place in self.image.places]
        self.fails("_DefaultInterrupt is the compiler's")

    def test_an_image_without_a_reset_vector_is_refused(self):
        del self.image.words[0], self.image.words[2]
        self.fails("reset vector: 0xFFFFFF 0xFFFFFF is no GOTO")

    def test_a_reset_vector_that_misses_the_start_up_code_is_refused(self):
        self.image.words[0] = 0x040000 | self.image.symbols["_main"]
        self.fails(r"reset vector: goes to .* \(main\), not to the start-up code at 0x000200")


class Configuration(Case):
    def test_every_wrong_bit_of_a_known_field_is_found(self):
        known = {**device.BOARD_NEEDS, **image.wanted_fields(target_support.CONFIG)}
        for name in known:
            field = device.FIELDS[name]
            for bit in range(8):
                if field.mask & 1 << bit:
                    with self.subTest(field=name, bit=bit):
                        self.image = made()
                        self.image.words[field.word] ^= 1 << bit
                        self.fails(rf"configuration word {device.WORDS[field.word]} .*: {name} is .*, must be {known[name]} \(")

    def test_bits_that_mean_nothing_do_not_matter(self):
        self.image.words[0xF80000] = 0xFFFFFF
        self.image.words[0xF8000E] = 0x01
        self.passes()

    def test_a_missing_word_is_named_with_its_fields(self):
        del self.image.words[0xF80006]
        self.fails(r"word FOSCSEL \(0xF80006\) is missing: FNOSC must be FRC")

    def test_sources_that_set_what_the_board_cannot_have_are_refused(self):
        arguments = self.image.write(self.folder)
        path = self.folder / "config.c"
        path.write_text(path.read_text().replace("PWMPIN = ON", "PWMPIN = OFF"))
        status, _, lines = run(arguments)
        self.assertEqual(status, 1)
        self.assertRegex(lines[0], "PWMPIN = OFF in config.c, but the board needs ON")

    def test_a_setting_that_the_table_does_not_know_is_refused(self):
        arguments = self.image.write(self.folder)
        with (self.folder / "config.c").open("a", encoding="utf-8") as file:
            file.write("#pragma config PLLKEN = ON\n")
        status, _, lines = run(arguments)
        self.assertEqual((status, len(lines)), (1, 1))
        self.assertIn("PLLKEN = ON in config.c is unknown", lines[0])

    def test_the_table_names_every_field_with_its_meaning(self):
        out = self.passes("--table")
        for text in ("FOSCSEL  0x00  FNOSC     FRC (internal oscillator)", "FICD     0xC1  ICS       PGD3 (debugger on PGC3/PGD3)"):
            self.assertIn(text, out)

    def test_the_projects_own_settings_are_all_known_and_what_the_board_needs(self):
        config = image.wanted_fields(image.CONFIG_C.read_text(encoding="utf-8"))
        self.assertGreater(len(config), 10)
        for name, value in config.items():
            self.assertIn(value, device.FIELDS[name].values, name)
            self.assertEqual(value, device.BOARD_NEEDS.get(name, value), name)


class Library(Case):
    def test_a_helper_is_named_with_its_caller_and_what_to_write_instead(self):
        for helper, member, advice in (("__divsf3", "divsf3.eo", "a float"), ("__divsi3", "divsi3.eo", "a division"),
                                       ("__muldi3", "muldi3.eo", "64-bit"), ("memcpy", "memcpy.eo", "a copy"),
                                       ("__udivmodsi4", "lib_int.o", "a division"), ("oddity", "x.o", "without the library")):
            with self.subTest(helper):
                self.image = made()
                target = self.image.function(helper, 0x000000, 0x060000, file=f"{LIBRARY}({member})", section=".libm.x")
                self.image.function("caller", CALL | target, 0x000000, 0x060000, file="a.o")
                self.fails(rf"{helper}\(\) of the compiler's library is in the image \(libc99-pic30-elf.a\({member}\)\), "
                           rf"called by caller\(\): .*{advice}")

    def test_relative_calls_and_jumps_are_seen_too(self):
        for opcode in (RCALL, 0x370000, 0x320000, 0x0C0000):
            with self.subTest(hex(opcode)):
                self.image = made()
                target = self.image.function("__mulsf3", 0x060000, file=f"{LIBRARY}(mulsf3.eo)")
                at = self.image.function("caller", 0, 0x060000, file="a.o")
                self.image.words[at] = opcode | (target - at - 2) // 2 & 0xFFFF
                self.fails(r"called by caller\(\)")

    def test_what_only_a_helper_calls_is_not_told_too(self):
        inner = self.image.function("__fpack", 0x060000, file=f"{LIBRARY}(fpack.eo)")
        outer = self.image.function("__mulsf3", CALL | inner, 0, 0x060000, file=f"{LIBRARY}(mulsf3.eo)")
        self.image.function("caller", CALL | outer, 0, file="a.o")
        self.fails(r"__mulsf3\(\) .*called by caller\(\)")

    def test_a_helper_that_nothing_visible_calls_is_still_told(self):
        self.image.function("__divsf3", 0x060000, file=f"{LIBRARY}(divsf3.eo)")
        self.fails(r"__divsf3\(\) .*called by nothing that can be seen")

    def test_start_up_code_is_allowed_under_its_known_names(self):
        for member in ("crt0_standard.o", "crt0_extended.o", "crt1_standard.o", "crt0.o", "data_init_standard.o", "crt_start_mode_normal.Leo",
                       "crt_start_mode.o"):
            with self.subTest(member):
                self.image = made()
                self.image.function("start", 0x060000, file=f"{LIBRARY}({member})", section=".libpic30_crt_start_mode")
                self.passes()

    def test_a_constant_of_a_library_is_told(self):
        self.image.constant(1, 2)
        self.image.places[-1] = (*self.image.places[-1][:3], f"{LIBRARY}(fp_thenan.o)")
        self.fails(r"\.const of the compiler's library .*fp_thenan.o\)\), called by nothing that can be seen")

    def test_a_map_of_another_build_is_refused(self):
        self.image.places.pop()
        self.fails("2 words from 0x.* on come from no file that the map names: the map is of another build, or the linker made them for a pointer")


class Divisions(Case):
    def test_a_division_that_is_no_built_in_is_told_with_its_function(self):
        for word in (0xD80102, 0xD87B85, 0xD88102, 0xD8F90F, 0xD90002): # div.s, div.u, divf
            with self.subTest(hex(word)):
                self.image = made()
                self.image.function("average", 0x090011, word, 0x060000)
                self.fails(r"average\(\) divides by a variable with / or %: use qm_divud")

    def test_built_in_divisions_and_constants_that_look_like_one_pass(self):
        self.image.function("average", 0x090011, 0xD88242, 0x090011, 0xD80242, 0x060000) # div.ud, div.sd
        self.image.constant(0xD80102)
        self.passes()


class Budget(Case):
    def budget(self, text: str) -> tuple[str, str]:
        path = self.folder / "budget.toml"
        path.write_text(text, encoding="utf-8")
        return "--budget", str(path)

    def test_a_budget_that_is_just_kept_passes(self):
        words = sum(address in device.PROGRAM for address in self.image.words)
        out = self.passes(*self.budget(f"[budget.image]\nflash_bytes = {3 * words}\nram_bytes = 300\nstack_bytes = 1732\n"))
        self.assertIn(f"flash {3 * words} of {3 * words} bytes, RAM 300 of 300 bytes", out)

    def test_each_budget_that_is_broken_is_a_line(self):
        words = sum(address in device.PROGRAM for address in self.image.words)
        more = self.budget(f"[budget.image]\nflash_bytes = {3 * words - 1}\nram_bytes = 299\nstack_bytes = 1733\n")
        self.fails(f"flash: {3 * words} bytes of a budget of {3 * words - 1}", "RAM: 300 bytes of a budget of 299", "stack: 1732 bytes are left",
                   more=more)

    def test_a_stack_that_is_deeper_than_its_budget_or_than_what_is_free_is_a_line(self):
        with mock.patch.object(image, "deepest_stack", lambda *_: (400, [])):
            budget = self.budget("[budget.image]\nflash_bytes = 12288\nram_bytes = 768\nstack_bytes = 400\n")
            self.assertIn("stack at most 400 of 400 bytes, 1732 bytes free", self.passes("--objdump", "x", *budget))
            self.image.ram_bytes = 1700
            self.fails("stack: up to 400 bytes of 332", more=("--objdump", "x"))
        with mock.patch.object(image, "deepest_stack", lambda *_: (401, ["f: calls through a pointer"])):
            self.image.ram_bytes = 300
            self.fails("stack: up to 401 bytes of 400; make size", "stack: f: calls through a pointer", more=("--objdump", "x", *budget))

    def test_a_budget_file_without_budgets_is_one_line(self):
        for text in ("", "[budget.image]\nflash_bytes = 1\n", "[budget.image]\nflash_bytes = 'x'\nram_bytes = 1\n", "not toml"):
            with self.subTest(text):
                status, _, lines = self.check(*self.budget(text))
                self.assertEqual((status, len(lines)), (2, 1))
                self.assertIn("[budget.image]", lines[0])

    def test_the_projects_budget_is_read(self):
        self.assertEqual(image.read_budget(image.ROOT / "firmware" / "budget.toml")["flash_bytes"], 12288)
        self.assertEqual(image.read_budget(image.ROOT / "firmware" / "budget.toml")["ram_bytes"], 768)


class BadFiles(Case):
    def one_line(self, arguments: list[str], *patterns: str) -> None:
        status, out, lines = run(arguments)
        self.assertEqual((status, out, len(lines)), (2, "", 1), lines)
        for pattern in (r"^foc33: .*: (build it|check)", *patterns):
            self.assertRegex(lines[0], pattern)

    def test_files_that_are_not_there(self):
        arguments = self.image.write(self.folder)
        for name in ("a.elf", "a.hex", "a.map"):
            with self.subTest(name):
                (self.folder / name).rename(self.folder / "kept")
                self.one_line(arguments, rf"No such file.*{name}")
                (self.folder / "kept").rename(self.folder / name)

    def test_an_elf_of_another_machine_or_none_at_all(self):
        arguments = self.image.write(self.folder)
        self.image.machine = 62
        for data in (self.image.elf(), b"", b"\x7fELF", b"text\n" * 40):
            (self.folder / "a.elf").write_bytes(data)
            self.one_line(arguments, "a.elf")

    def test_an_elf_that_ends_too_early(self):
        arguments = self.image.write(self.folder)
        data = (self.folder / "a.elf").read_bytes()
        for length in range(0, len(data), 37):
            (self.folder / "a.elf").write_bytes(data[:length])
            self.one_line(arguments, "a.elf")

    def test_a_hex_that_ends_too_early(self):
        arguments = self.image.write(self.folder)
        text = (self.folder / "a.hex").read_text()
        for length in range(0, len(text.rstrip()), 41):
            (self.folder / "a.hex").write_text(text[:length])
            self.one_line(arguments, "a.hex")

    def test_a_hex_with_a_wrong_check_sum_or_words_given_twice(self):
        arguments = self.image.write(self.folder)
        lines = (self.folder / "a.hex").read_text().splitlines()
        for broken in ([lines[0], lines[1][:-1] + ("0" if lines[1][-1] != "0" else "1"), *lines[2:]], [lines[0], lines[1], lines[1], *lines[2:]],
                       [*lines, lines[1]], [*lines[:3], lines[-1], *lines[3:]], ["no hex", lines[-1]],
                       [target_support.record(0, 2, b"\0\0\0\0").strip(), lines[-1]],
                       [target_support.record(0, 0, b"\0\0\0\1").strip(), lines[-1]], [lines[-1]]):
            (self.folder / "a.hex").write_text("\n".join(broken) + "\n")
            self.one_line(arguments, "a.hex")

    def test_a_map_that_is_none(self):
        arguments = self.image.write(self.folder)
        (self.folder / "a.map").write_bytes(b"\xff\xfe nothing")
        self.one_line(arguments, "not a map file", "a.map")

    def test_damaged_files_end_in_one_line_or_in_failed_checks_never_otherwise(self):
        arguments = self.image.write(self.folder)
        rng = random.Random(33)
        originals = {name: (self.folder / name).read_bytes() for name in ("a.elf", "a.hex", "a.map")}
        for turn in range(400):
            name = ("a.elf", "a.elf", "a.hex", "a.map")[turn % 4]
            data = bytearray(originals[name])
            for _ in range(rng.choice((1, 1, 3, 20))):
                data[rng.randrange(len(data))] = rng.randrange(256)
            if rng.random() < 0.2:
                del data[rng.randrange(len(data)):]
            (self.folder / name).write_bytes(data)
            status, _, lines = run(arguments)
            self.assertIn(status, (0, 1, 2))
            self.assertEqual(len(lines) == 1 if status == 2 else bool(lines), status != 0, (turn, name, status, lines))
            (self.folder / name).write_bytes(originals[name])


if __name__ == "__main__":
    unittest.main()
