"""The assembler's table against itself and, where XC16 is installed (PATH or XC16=dir), against its assembler and disassembler."""

import random
import re
import subprocess
from pathlib import Path

import pytest

import asm33
import xc16
from machine import Machine
from operands import Sampler

SAMPLES = 25


def texts(samples: int = SAMPLES, seed: int = 1, address: int = 0) -> list[tuple[asm33.Row, str]]:
    """Instructions of every row with random operands."""
    sampler = Sampler(seed, address)
    return [(row, sampler.text(row)) for row in asm33.ROWS for _ in range(samples)]


def test_a_word_is_found_again_in_the_row_it_came_from_with_its_fields() -> None:
    for row, text in texts():
        words = asm33.encode(text)
        assert asm33.match(words[0]) is row, f"{text} = {words[0]:06x}"
        assert row.insert(row.extract(words)) == words, text


def test_no_word_belongs_to_two_rows() -> None:
    for _, text in texts(10):
        word = asm33.encode(text)[0]
        assert sum(row.matches(word) for row in asm33.ROWS) == 1, f"{text} = {word:06x}"


@pytest.mark.parametrize("text", [
    "add w1, w2", "mov #65536, w1", "add #1024, w0", "add.b #256, w0", "mov 0x801, w1", "mul.ss w1, w2, w3", "mov [w1+1024], w2",
    "lac w0, #8, a", "sftac a, #17", "mac w4*w8, a", "push.s w1", "frob", "bset w0, #16", "mov [w1+w2], [w3+w4]", "mov.d w1, w2",
    "div.s w4, w1", "tblrdl w1, w2", "inc2 0x2000", "lnk #3"])
def test_operands_that_do_not_fit_are_refused(text: str) -> None:
    with pytest.raises(ValueError):
        asm33.encode(text)


def signed(text: str) -> str:
    """A shift of an accumulator as a signed number; the disassembler shows its bits."""
    width = 6 if text.startswith("sftac") else 4 if re.match(r"(lac|sac|sac\.r|add) .*\b[ab]\b", text) else 0
    return re.sub(r"#(0x[0-9a-f]+)", lambda found: f"#{(int(found[1], 16) ^ 1 << width - 1) - (1 << width - 1)}", text) if width else text


# ---- the simulator's decoder, seen through its disassembler ---------------------------------------------------------------

def test_every_word_reads_as_what_it_was_made_from(machine: Machine) -> None:
    wrong = []
    for _, text in texts(address=0x400):
        words = asm33.encode(text, 0x400)
        listing = machine.disassemble(words[0], (words + [0])[1], 0x400)
        try:
            ours = asm33.encode(listing, 0x400)
        except ValueError as error:
            ours = [error]
        if ours != words:
            wrong.append(f"{text} = {words[0]:06x} reads {listing!r}")
    assert wrong[:20] == [], len(wrong)


def test_words_outside_the_table_are_no_instructions(machine: Machine) -> None:
    chance, wrong = random.Random(7), []
    for word in (chance.getrandbits(24) for _ in range(30000)):
        row, listing = asm33.match(word), machine.disassemble(word, 0, 0x400)
        if (listing != "") != (row is not None):
            wrong.append(f"{word:06x} reads {listing!r}, here {row.text if row else None}")
    assert wrong[:20] == [], len(wrong)


# ---- XC16 ----------------------------------------------------------------------------------------------------------------

def assembled(folder: Path, lines: list[str]) -> list[tuple[int, int, str]]:
    """Address, word and disassembly of what XC16's assembler makes of these lines."""
    source, target = folder / "rows.s", folder / "rows.o"
    source.write_text("\n".join([".text", *lines, ""]), encoding="ascii")
    done = subprocess.run([xc16.program("as"), "-p33FJ32MC204", source, "-o", target], capture_output=True, text=True, check=False)
    messages = [line for line in done.stderr.splitlines() if "DO loop" not in line and "Assembler messages" not in line]
    assert (done.returncode, messages[:20]) == (0, [])
    listing = subprocess.run([xc16.program("objdump"), "-drz", target], capture_output=True, text=True, check=True).stdout
    found = re.findall(r"^ *([0-9a-f]+):\t([0-9a-f]{2}) ([0-9a-f]{2}) ([0-9a-f]{2}) *\t?(.*)$", listing, re.MULTILINE)
    return [(int(at, 16), int(high + middle + low, 16), text.strip()) for at, low, middle, high, text in found]


@xc16.needs_compiler
def test_xc16s_assembler_gives_the_same_words(tmp_path: Path) -> None:
    lines = []
    for row, text in texts():
        if "target" not in row.operands and "label" not in row.operands:  # the disassembly below covers what the linker fills in
            lines += [text, "nop"]  # nothing follows a REPEAT that may not
    ours, _ = asm33.assemble("\n".join(lines), origin=0)
    got = assembled(tmp_path, lines)
    wrong = [f"{address:06x}: XC16 {word:06x} ({listing}), here {ours[address]:06x}"
             for address, word, listing in got if word != ours[address]]
    assert (wrong[:20], len(got)) == ([], len(ours))


@xc16.needs_compiler
def test_xc16s_disassembler_reads_the_same_instruction(tmp_path: Path) -> None:
    encoded = [asm33.encode(text) for _, text in texts()]
    listing = assembled(tmp_path, [f".pword 0x{word:06x}" for words in encoded for word in [*words, 0]])
    wrong, at = [], 0
    for words in encoded:
        address, word, text = listing[at]
        at += len(words) + 1
        if word & 0xFF0FF0 == 0x010000:
            continue  # GOTO Wn and RCALL Wn: this disassembler calls both "call"
        ours = asm33.encode(signed(re.sub(r" <.*", "", text.lower())), address)
        if ours != words:
            wrong.append(f"{words[0]:06x} reads {text} to XC16, which is {ours[0]:06x} here")
    assert wrong[:20] == []
