"""The image loaders under damaged files: every message is one line, nothing is read that is not there. libFuzzer too where clang has it."""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from sample_image import CONFIG, END, GOTO_0X200, WORDS, Elf, Section, hex_lines, hex_text, record # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [str(ROOT / "test/fuzz/image_harness.c"), *(str(ROOT / "tools/iss33f" / name) for name in ("image.c", "load_elf.c", "load_hex.c"))]
CHECKS = ["-std=c11", "-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-I", str(ROOT / "tools/iss33f")]
MUTATIONS = 20000
FUZZ_SECONDS = 10


class ImageFiles(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.harness = cls.folder / "harness"
        subprocess.run([os.environ.get("CC", "gcc"), *CHECKS, "-Wall", "-Wextra", "-Werror", *SOURCES, "-o", str(cls.harness)], check=True)

    def load(self, contents: bytes | str, name: str = "x") -> subprocess.CompletedProcess[str]:
        path = self.folder / name
        path.write_bytes(contents if isinstance(contents, bytes) else contents.encode())
        return subprocess.run([self.harness, "--load", path], capture_output=True, text=True, check=False)

    def accepted(self, contents: bytes | str) -> str:
        result = self.load(contents)
        self.assertEqual((0, ""), (result.returncode, result.stderr))
        return result.stdout

    def refused(self, contents: bytes | str, text: str) -> None:
        result = self.load(contents)
        self.assertEqual(2, result.returncode, result.stdout)
        self.assertRegex(result.stderr, r"\Afoc33: [^\n]+, [^\n]+: [^\n]+\n\Z")
        self.assertIn(text, result.stderr)

    def test_elf_gives_words_configuration_and_names(self) -> None:
        self.assertEqual("0x040200 0x000045 main\n", self.accepted(Elf().bytes()))

    def test_hex_gives_words_and_configuration(self) -> None:
        self.assertEqual("0x040200 0x000045 -\n", self.accepted(hex_text()))

    def test_hex_in_capitals_with_carriage_returns_and_start_records(self) -> None:
        text = hex_text().upper().replace("\n", "\r\n")
        self.accepted(text)
        self.accepted(record(5, 0, bytes(4)) + "\n" + text)

    def test_hex_with_segment_addresses(self) -> None:
        lines = [record(0, 0, bytes.fromhex("00020400000000 00".replace(" ", ""))), record(2, 0, b"\x00\x40"), record(0, 0, bytes(4)), END]
        self.accepted("\n".join(lines))

    def test_constants_in_their_data_window_go_where_the_segment_says(self) -> None:
        elf = Elf()
        data = bytearray(elf.bytes())
        elf.sections.append(Section(".const", 0x8000 + 0x300, [0x001234], flags=2))
        data = bytearray(elf.bytes())
        const_offset = 84 + 4 * (2 + 2 + 1)
        data[52:84] = b"".join(v.to_bytes(4, "little") for v in (1, const_offset, 0x8300, 0x0300, 4, 4, 4, 2))
        self.accepted(bytes(data))

    def test_start_values_of_variables_are_not_program(self) -> None:
        elf = Elf()
        elf.sections.append(Section(".ndata", 0x200, [1, 2], flags=3))
        self.accepted(elf.bytes())

    def test_every_cut_of_the_elf_file_is_refused(self) -> None:
        whole = Elf().bytes()
        for length in range(1, len(whole), 7):
            result = self.load(whole[:length])
            self.assertEqual(2, result.returncode, f"{length} bytes")
            self.assertEqual(1, result.stderr.count("\n"))

    def test_every_cut_of_the_hex_file_is_refused(self) -> None:
        whole = hex_text()
        for length in range(1, len(whole) - 1, 3):
            self.assertEqual(2, self.load(whole[:length]).returncode, f"{length} characters")

    def test_an_empty_or_foreign_file(self) -> None:
        self.refused("", "neither")
        self.refused("hello\n", "neither")

    def test_a_missing_file(self) -> None:
        result = subprocess.run([self.harness, "--load", self.folder / "none"], capture_output=True, text=True, check=False)
        self.assertEqual(2, result.returncode)
        self.assertIn("no such file", result.stderr)

    def test_other_machine(self) -> None:
        elf = Elf()
        elf.machine = 62
        self.refused(elf.bytes(), "machine 62")

    def test_other_device(self) -> None:
        elf = Elf()
        elf.symbols[1] = ("__33FJ128MC802", 1, 0, 0, 0xFFF1)
        self.refused(elf.bytes(), "33FJ128MC802")

    def test_object_file(self) -> None:
        elf = Elf()
        elf.type = 1
        self.refused(elf.bytes(), "not linked")

    def test_big_endian_and_64_bits(self) -> None:
        elf = Elf()
        elf.ident = b"\x7fELF\x02\x01\x01" + bytes(9)
        self.refused(elf.bytes(), "32 bits")
        elf.ident = b"\x7fELF\x01\x02\x01" + bytes(9)
        self.refused(elf.bytes(), "little endian")

    def test_overlapping_sections(self) -> None:
        elf = Elf()
        elf.sections.append(Section(".again", 0x202, [0]))
        self.refused(elf.bytes(), "0x202 has two contents")

    def test_section_outside_the_flash(self) -> None:
        elf = Elf()
        elf.sections.append(Section(".far", 0x57FE, [0, 0]))
        self.refused(elf.bytes(), "0x5800 is outside")

    def test_half_a_word(self) -> None:
        lines = hex_lines({0: GOTO_0X200[0], 2: 0, 0x200: 0})
        self.refused("\n".join([*lines, record(0, 0x408, b"\x01\x02"), END]), "bytes are missing")

    def test_a_section_of_three_bytes(self) -> None:
        data = bytearray(Elf().bytes())
        headers = int.from_bytes(data[32:36], "little")
        data[headers + 2 * 40 + 20] -= 1 # sh_size of .text
        self.refused(bytes(data), "7 bytes are no whole words")

    def test_a_section_at_an_odd_address(self) -> None:
        elf = Elf()
        elf.sections.append(Section(".odd", 0x301, [0]))
        self.refused(elf.bytes(), "0x301 is outside")

    def test_a_file_larger_than_any_image(self) -> None:
        path = self.folder / "large"
        for size, code in ((65 << 20, "cannot be read"), (5 << 30, "cannot be read")):
            with path.open("wb") as file:
                file.write(hex_text().encode())
                file.truncate(size)
            result = subprocess.run([self.harness, "--load", path], capture_output=True, text=True, check=False)
            self.assertEqual(2, result.returncode)
            self.assertIn(code, result.stderr)
        path.unlink()

    def test_a_folder(self) -> None:
        result = subprocess.run([self.harness, "--load", self.folder], capture_output=True, text=True, check=False)
        self.assertEqual(2, result.returncode)
        self.assertIn("cannot be", result.stderr)

    def test_missing_reset_vector(self) -> None:
        elf = Elf()
        elf.sections = elf.sections[1:]
        self.refused(elf.bytes(), "no reset vector")
        self.refused(hex_text({0x200: 0}), "no reset vector")

    def test_reset_vector_that_leads_nowhere(self) -> None:
        self.refused(hex_text({0: 0x040300, 2: 0, 0x200: 0}), "0x300")
        self.refused(hex_text({0: 0x000000, 2: 0, 0x200: 0}), "no GOTO")

    def test_hex_checksum(self) -> None:
        lines = hex_lines(WORDS)
        lines[1] = lines[1][:-1] + ("0" if lines[1][-1] != "0" else "1")
        self.refused("\n".join([*lines, END]), "checksum")

    def test_hex_record_of_another_length_than_it_says(self) -> None:
        whole = bytes.fromhex(hex_lines(WORDS)[1][1:-2])
        for change, wrong in (("longer", whole + b"\0"), ("shorter", whole[:-1])):
            with self.subTest(change):
                line = ":" + (wrong + bytes([-sum(wrong) & 0xFF])).hex()
                self.refused("\n".join([line, END]), "shorter or longer")

    def test_hex_line_longer_than_a_record_can_be(self) -> None:
        for digits in (522, 524, 1040, 100000):
            self.refused(":" + "0" * digits + "\n" + END + "\n", "no Intel HEX record")

    def test_hex_end_record_with_data(self) -> None:
        self.refused("\n".join([*hex_lines(WORDS), record(1, 0, b"\0")]), "end record has data")

    def test_hex_address_records_have_two_bytes(self) -> None:
        for kind in (2, 4):
            for data in (b"", b"\0", b"\0\0\0"):
                self.refused("\n".join([record(kind, 0, data), *hex_lines(WORDS), END]), "no two bytes")

    def test_hex_record_of_unknown_kind(self) -> None:
        self.refused("\n".join([record(6, 0, b""), *hex_lines(WORDS), END]), "type is unknown")

    def test_hex_overlap_names_the_line(self) -> None:
        lines = hex_lines(WORDS)
        self.refused("\n".join([*lines[:3], lines[2], *lines[3:], END]), "comes twice")

    def test_hex_without_end(self) -> None:
        self.refused("\n".join(hex_lines(WORDS)) + "\n", "end record is missing")

    def test_hex_with_text_behind_the_end(self) -> None:
        self.refused(hex_text() + hex_lines(WORDS)[1] + "\n", "after the end record")

    def test_hex_outside_the_device(self) -> None:
        self.refused(hex_text({**WORDS, 0x5800: 0}), "0x5800 is outside")
        self.refused(hex_text({**WORDS, CONFIG + 24: 0}), "outside")

    def test_hex_with_a_phantom_byte(self) -> None:
        self.refused(hex_text({**WORDS, 0x204: 0x01000000}), "fourth byte")

    def test_control_characters_of_a_file_stay_off_the_terminal(self) -> None:
        elf = Elf()
        elf.sections.append(Section(".a\x1b[2J\n", 0x202, [0]))
        self.refused(elf.bytes(), "two contents")

    def samples(self) -> list[str]:
        files = {"a.elf": Elf().bytes(), "a.hex": hex_text().encode()}
        for name, contents in files.items():
            (self.folder / name).write_bytes(contents)
        return [str(self.folder / name) for name in files]

    def test_seeded_mutations(self) -> None:
        result = subprocess.run([self.harness, "20240607", str(MUTATIONS), *self.samples()], capture_output=True, text=True, check=False)
        self.assertEqual(0, result.returncode, result.stderr[-2000:])

    def test_libfuzzer(self) -> None:
        fuzzer = self.folder / "fuzzer"
        clang = shutil.which("clang-14")
        build = clang and subprocess.run([clang, "-DLIBFUZZER", "-std=c11", "-g", "-O1", "-fsanitize=fuzzer,address,undefined",
                                          "-fno-sanitize-recover=all", "-I", str(ROOT / "tools/iss33f"), *SOURCES, "-o", str(fuzzer)],
                                         capture_output=True, check=False).returncode == 0
        if not build:
            self.skipTest("clang-14 with libclang-rt-14-dev is not installed")
        corpus = self.folder / "corpus"
        corpus.mkdir()
        for sample in self.samples():
            shutil.copy(sample, corpus)
        result = subprocess.run([fuzzer, f"-max_total_time={FUZZ_SECONDS}", "-seed=1", "-max_len=4096", "-print_final_stats=1", str(corpus)],
                                cwd=self.folder, capture_output=True, text=True, check=False)
        self.assertEqual(0, result.returncode, result.stderr[-2000:])


if __name__ == "__main__":
    unittest.main()
