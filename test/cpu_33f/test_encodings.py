"""The assembler's table against itself and, where XC16 is installed (PATH or XC16=dir), against its assembler and disassembler."""

import os
import random
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

import asm33
from machine import Machine
from operands import Sampler

SAMPLES = 25


def xc16(name: str) -> str | None:
    """Path of one of XC16's programs."""
    folder = os.environ.get("XC16")
    return shutil.which(f"xc16-{name}", path=f"{folder}/bin" if folder else None)


def texts(samples: int = SAMPLES, seed: int = 1, address: int = 0) -> list[tuple[asm33.Row, str]]:
    """Instructions of every row with random operands."""
    sampler = Sampler(seed, address)
    return [(row, sampler.text(row)) for row in asm33.ROWS for _ in range(samples)]


class Table(unittest.TestCase):
    def test_a_word_is_found_again_in_the_row_it_came_from(self) -> None:
        for row, text in texts():
            word = asm33.encode(text)[0]
            self.assertIs(asm33.match(word), row, f"{text} = {word:06x}")

    def test_fields_come_back_as_they_went_in(self) -> None:
        for row, text in texts(10):
            words = asm33.encode(text)
            self.assertEqual(row.insert(row.extract(words)), words, text)

    def test_no_word_belongs_to_two_rows(self) -> None:
        for _, text in texts(10):
            word = asm33.encode(text)[0]
            self.assertEqual(sum(row.matches(word) for row in asm33.ROWS), 1, f"{text} = {word:06x}")

    def test_operands_that_do_not_fit_are_refused(self) -> None:
        for text in ("add w1, w2", "mov #65536, w1", "add #1024, w0", "add.b #256, w0", "mov 0x801, w1", "mul.ss w1, w2, w3",
                     "mov [w1+1024], w2", "lac w0, #8, a", "sftac a, #17", "mac w4*w8, a", "push.s w1", "frob", "bset w0, #16",
                     "mov [w1+w2], [w3+w4]", "mov.d w1, w2", "div.s w4, w1", "tblrdl w1, w2", "inc2 0x2000", "lnk #3"):
            with self.assertRaises(ValueError, msg=text):
                asm33.encode(text)


def signed(text: str) -> str:
    """A shift of an accumulator as a signed number; the disassembler shows its bits."""
    width = 6 if text.startswith("sftac") else 4 if re.match(r"(lac|sac|sac\.r|add) .*\b[ab]\b", text) else 0
    return re.sub(r"#(0x[0-9a-f]+)", lambda found: f"#{(int(found[1], 16) ^ 1 << width - 1) - (1 << width - 1)}", text) if width else text


class Decoder(unittest.TestCase):
    """The simulator's decoder, seen through its disassembler."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.machine = Machine()

    def test_every_word_reads_as_what_it_was_made_from(self) -> None:
        wrong = []
        for _, text in texts(address=0x400):
            words = asm33.encode(text, 0x400)
            listing = self.machine.disassemble(words[0], (words + [0])[1], 0x400)
            try:
                ours = asm33.encode(listing, 0x400)
            except ValueError as error:
                ours = [error]
            if ours != words:
                wrong.append(f"{text} = {words[0]:06x} reads {listing!r}")
        self.assertEqual(wrong[:20], [], len(wrong))

    def test_words_outside_the_table_are_no_instructions(self) -> None:
        chance = random.Random(7)
        wrong = []
        for word in (chance.getrandbits(24) for _ in range(30000)):
            row, listing = asm33.match(word), self.machine.disassemble(word, 0, 0x400)
            known = listing != "" and not listing.startswith(".word")
            if known != (row is not None):
                wrong.append(f"{word:06x} reads {listing!r}, here {row.text if row else None}")
        self.assertEqual(wrong[:20], [], len(wrong))


@unittest.skipUnless(xc16("as") and xc16("objdump"), "encodings against XC16: xc16-as and xc16-objdump are not on PATH nor in XC16=dir/bin")
class CrossCheck(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.lines = [(row, text, asm33.encode(text)) for row, text in texts()]

    def assembled(self, lines: list[str]) -> list[tuple[int, int, str]]:
        """Address, word and disassembly of what XC16's assembler makes of these lines."""
        source, target = Path(self.folder.name) / "rows.s", Path(self.folder.name) / "rows.o"
        source.write_text("\n".join([".text", *lines, ""]), encoding="ascii")
        done = subprocess.run([xc16("as"), "-p33FJ32MC204", source, "-o", target], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, [x for x in done.stderr.splitlines() if "Error" in x])
        messages = [line for line in done.stderr.splitlines() if "DO loop" not in line and "Assembler messages" not in line]
        self.assertEqual((done.returncode, messages[:20]), (0, []))
        listing = subprocess.run([xc16("objdump"), "-drz", target], capture_output=True, text=True, check=True).stdout
        found = re.findall(r"^ *([0-9a-f]+):\t([0-9a-f]{2}) ([0-9a-f]{2}) ([0-9a-f]{2}) *\t?(.*)$", listing, re.MULTILINE)
        return [(int(at, 16), int(high + middle + low, 16), text.strip()) for at, low, middle, high, text in found]

    def test_every_row_agrees_with_xc16(self) -> None:
        with self.subTest("its assembler gives the same word"):
            self.check_words()
        with self.subTest("its disassembler reads the same instruction"):
            self.check_listing()

    def check_words(self) -> None:
        """Both assemblers give the same words."""
        lines = []
        for row, text, _ in self.lines:
            if "target" not in row.operands and "label" not in row.operands:  # the disassembly below covers what the linker fills in
                lines += [text, "nop"]  # nothing follows a REPEAT that may not
        ours, _ = asm33.assemble("\n".join(lines), origin=0)
        wrong = []
        got = self.assembled(lines)
        for address, word, listing in got:
            if word != ours[address]:
                wrong.append(f"{address:06x}: XC16 {word:06x} ({listing}), here {ours[address]:06x}")
        self.assertEqual(wrong[:20], [])
        self.assertEqual(len(got), len(ours))

    def check_listing(self) -> None:
        """What XC16's disassembler reads gives the word again."""
        lines = [f".pword 0x{word:06x}" for _, _, words in self.lines for word in [*words, 0]]
        listing = self.assembled(lines)
        wrong = []
        at = 0
        for row, _, words in self.lines:
            address, word, text = listing[at]
            at += len(words) + 1
            if word & 0xFF0FF0 == 0x010000:
                continue  # GOTO Wn and RCALL Wn: this disassembler calls both "call"
            ours = asm33.encode(signed(re.sub(r" <.*", "", text.lower())), address)
            if ours != words:
                wrong.append(f"{words[0]:06x} reads {text} to XC16, which is {ours[0]:06x} here")
        self.assertEqual(wrong[:20], [])
