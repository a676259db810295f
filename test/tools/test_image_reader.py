"""The reader of images: what a good ELF or HEX file gives, and one line for every damaged or foreign one."""

import random

import pytest
from sample_image import (CONSTANTS, END, NOBITS, PERSISTENT, WRITE, Function, Sample, Section, four, hex_text, record, take_ram)

from tools.common.errors import UserError
from tools.image import attribution, device
from tools.image.linked import read_map
from tools.image.program import CODE, CONSTANTS as CONST, DATA, Elf, load, read_elf, read_hex

MUTATIONS = 800
WORDS = {0: 0x040200, 2: 0, 0x200: 0, 0x202: 0x37FFFF, 0xF80008: 0x45}
LINES = hex_text(WORDS).splitlines(keepends=True)[:-1]


def sample(**fields) -> Sample:
    """A program of two words with a configuration word, names and debugging information."""
    return Sample({0x200: 0, 0x202: 0x37FFFF, 0xF80008: 0x45}, {"_main": 0x200}, functions=[Function("main", "m.c", 1, 0x200, 0x204)],
                  lines=[(0x200, "m.c", 2)], lines_end=0x204, **fields)


@pytest.fixture
def image(tmp_path):
    """Puts contents into a file and loads it."""
    def of(contents: bytes | str) -> Elf:
        path = tmp_path / "x"
        path.write_bytes(contents if isinstance(contents, bytes) else contents.encode())
        return load(path)
    return of


@pytest.fixture
def refused(image):
    """The file's contents are refused with one line that has these words in it."""
    def of(contents: bytes | str, words: str = "") -> None:
        with pytest.raises(UserError) as error:
            image(contents)
        assert words in str(error.value)
        assert str(error.value).isprintable() and str(error.value).count(": ") >= 1
    return of


def test_elf_gives_words_names_and_memory_and_hex_the_same_words(image):
    found = sample()
    take_ram(found, 40)
    elf = image(found.elf())
    assert elf.words == image(found.hex()).words == WORDS
    assert (elf.ram_bytes, elf.devices, elf.entry) == (40, {device.NAME}, 0x200)
    assert elf.function_at(0x202) == "main"
    assert [(item.name, item.address, item.size, item.function, item.section.memory) for item in elf.names if item.section] == [
        ("main", 0x200, 0, True, CODE), ("ram", 0x800, 40, False, DATA)]


def test_constants_are_programmed_where_their_window_shows_them_and_start_values_are_memory(image):
    elf = image(sample(constants=[("_table", 4, (0x1234, 0x5678))]).elf())
    assert [elf.words[CONSTANTS - 0x8000 + at] for at in (0, 2)] == [0x1234, 0x5678]
    assert [(item.name, item.address, item.section.memory) for item in elf.names if item.section][-1] == ("table", CONSTANTS, CONST)
    # start values of variables are memory and no program
    elf = image(sample(sections=[Section(".ndata", 0x900, four(1) + four(2), WRITE),
                                   Section(".pbss", 0xA00, b"", PERSISTENT, NOBITS, 8)]).elf())
    assert elf.words == WORDS
    found = [(item.start, item.end, item.persistent) for item in elf.sections if item.memory == DATA]
    assert found == [(0x900, 0x904, False), (0xA00, 0xA04, True)]


@pytest.mark.parametrize("text", [
    "\r\n".join("".join(LINES + [END]).lower().split("\n")), record(5, 0, bytes(4)) + "".join(LINES) + END,
                                  record(3, 0, bytes(4)) + "".join(LINES) + END,
    "".join([record(0, 0, bytes.fromhex("0002040000000000")), record(2, 0, b"\x00\x40"), record(0, 0, bytes(4)), END])])
def test_hex_in_every_way_of_writing_it(image, text):
    assert image(text).words[0] == 0x040200


@pytest.mark.parametrize("words, change", [
    ("EM_X86_64", {"machine": 62}), ("ET_REL", {"type": 1}), ("64 bits", {"ident": b"\x7fELF\x02\x01\x01" + bytes(9)}),
    ("", {"ident": b"\x7fELF\x01\x02\x01" + bytes(9)}), ("for the 33FJ128MC802", {"numbers": {"__33FJ128MC802": 1}}),
    ("two words for address 0x000202", {"sections": [Section(".again", 0x202, four(0))]}),
    ("two words", {"sections": [Section(".a\x1b[2J\n", 0x202, four(0))]}),
    ("0x5800 is outside", {"sections": [Section(".far", 0x57FE, four(0) * 2)]}),
    ("0x000301", {"sections": [Section(".odd", 0x301, four(0))]}),
    ("3 bytes of section .short", {"sections": [Section(".short", 0x300, bytes(3))]}),
    ("does not end inside", {"sections": [Section(".long", 0x300, four(0), size=1 << 20)]}),
    ("no 24-bit word at 0x000300", {"sections": [Section(".phantom", 0x300, four(1 << 24))]})])
def test_elf_that_is_not_for_this_chip_or_damaged(refused, words, change):
    refused(sample(**change).elf(), words)


@pytest.mark.parametrize("words, given", [
    ("no reset vector", {0x200: 0}), ("is no GOTO", {0: 0, 2: 0, 0x200: 0}), ("leads to 0x300", {0: 0x040300, 2: 0, 0x200: 0}),
    ("0x5800 is outside", {**WORDS, 0x5800: 0}), ("0xF80018 is outside", {**WORDS, 0xF80018: 0}),
    ("no 24-bit word", {**WORDS, 0x204: 1 << 24})])
def test_words_that_are_no_program(refused, words, given):
    refused(hex_text(given), words)


@pytest.mark.parametrize("words, text", [
    ("neither", ""), ("neither", "hello\n"), ("end record", "".join(LINES)), ("end record", "".join(LINES) + END + LINES[1]),
    ("end record", "".join(LINES) + record(1, 0, b"\0")),
    ("checksum", LINES[0] + LINES[1][:-2] + ("1" if LINES[1][-2] == "0" else "0") + "\n" + END),
    ("overlap", "".join([*LINES[:2], LINES[1], *LINES[2:], END])),
    ("half a word", "".join(LINES) + record(4, 0, bytes(2)) + record(0, 0x800, b"\1\2") + END),
    ("length", ":05000000" + "00" * 7 + "\n" + END), ("invalid", record(6, 0, b"") + "".join(LINES) + END),
    ("", record(4, 0, b"\0") + "".join(LINES) + END),
    ("", record(2, 0, b"\0\0\0") + "".join(LINES) + END), ("invalid", ":" + "0" * 1040 + "\n" + END), ("no data", END)])
def test_hex_that_is_damaged(refused, words, text):
    refused(text if words in ("neither", "no data") else ":" + text.lstrip(":"), words)


def test_every_cut_of_a_file_is_refused(refused):
    whole, text = sample().elf(), sample().hex()
    for length in range(1, len(whole), 7):
        refused(whole[:length])
    for length in range(1, len(text) - 1, 3):
        refused(text[:length])


def test_files_that_cannot_be_read(tmp_path):
    huge = tmp_path / "huge"
    with huge.open("wb") as file:
        file.write(hex_text(WORDS).encode())
        file.truncate(5 << 30)
    for path, words in ((huge, "cannot be read"), (tmp_path, "cannot read"), (tmp_path / "none", "No such file")):
        for read in (load, read_elf, read_hex, attribution.read):
            with pytest.raises(UserError, match=words):
                read(path)


def mutate(data: bytearray, rng: random.Random) -> None:
    """One change: a bit, a byte, four bytes of an extreme number, a moved piece, or a cut."""
    at, kind = rng.randrange(len(data)), rng.randrange(5)
    if kind == 0:
        data[at] ^= 1 << rng.randrange(8)
    elif kind == 1:
        data[at] = rng.randrange(256)
    elif kind == 2:
        data[at:at + 4] = rng.choice((0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFF0, 0x5800, 0xF80000)).to_bytes(4, "little")
    elif kind == 3:
        data[at:at + 8] = data[(other := rng.randrange(len(data))):other + 8]
    else:
        del data[at:at + rng.randrange(1, 40)]


def test_mutated_files_are_read_or_refused_in_one_line(tmp_path):
    rng = random.Random(20240607)
    whole = sample(constants=[("_table", 8)], variables=[("_drive", 8, True, "m.c")], types={"drive": {"a": 8}},
                   places=[(0x200, 4, ".text", "m.o")])
    originals = [whole.elf(), whole.elf(), whole.hex().encode(), whole.map().encode()]
    path = tmp_path / "x"
    for turn in range(MUTATIONS):
        data = bytearray(originals[turn % 4])
        for _ in range(rng.choice((1, 1, 2, 8))):
            mutate(data, rng)
        path.write_bytes(data)
        for read in (load, attribution.read, read_map):
            try:
                elf = read(path)
                assert read is not load or all(elf.function_at(address) for address in (0, 0x200, 0x57FE))
            except UserError as error:
                assert str(error).isprintable()
