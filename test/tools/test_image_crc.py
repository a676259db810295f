"""The flash's CRC: computed as the chip does, written into its place in the ELF file, and missed where it cannot be."""

import pytest
from sample_image import END, EXECUTE, Section, good_image
from support import command

from tools.image import crc, device, image
from tools.image.program import read_elf

PLACE = 0x57FC


def with_self_tests(place: int | None = PLACE):
    """A good image with self-tests, and erased words where the CRC goes."""
    sample = good_image()
    sample.variables.append(("_board_selftest_failed", 2, True))
    if place is not None:
        sample.words |= {place: 0xFFFF, place + 2: 0xFFFF}
        sample.places.append((place, 4, "prog", "build/target/firmware/board/selftest_run.o"))
    return sample


def bit_by_bit(words: dict[int, int]) -> int:
    """As the chip does: polynomial 0x1021, start value 0xFFFF, highest bit first, low byte first, all but the last two words."""
    value = 0xFFFF
    for address in range(0, PLACE, 2):
        for byte in words.get(address, device.ERASED).to_bytes(3, "little"):
            value ^= byte << 8
            for _ in range(8):
                value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
    return value


def write(sample, folder) -> list[str]:
    arguments = sample.write(folder)
    status, out, error = command(arguments[0], main=crc.main)
    assert (status, out, error) == (0, "", "")
    return arguments


def test_the_crc_is_that_of_the_polynomial_bit_by_bit() -> None:
    words = {0: 0x040200, 0x200: 0x123456, 0x5000: 0, PLACE - 2: 0xABCDEF}
    assert crc.crc(words) == bit_by_bit(words)
    assert crc.crc({}) == bit_by_bit({}) != crc.crc({PLACE - 2: 0})
    assert crc.crc(words | {PLACE: 1, PLACE + 2: 2}) == crc.crc(words), "its own place does not count"


def test_it_is_written_into_the_elf_file_and_nothing_else_changes(tmp_path) -> None:
    sample = with_self_tests()
    elf = sample.elf()
    path = write(sample, tmp_path)[0]
    words = read_elf(tmp_path / "a.elf").words
    value = bit_by_bit(words)
    assert (words[PLACE], words[PLACE + 2]) == (value, value ^ 0xFFFF)
    changed = [at for at, (old, new) in enumerate(zip(elf, (tmp_path / "a.elf").read_bytes())) if old != new]
    assert 0 < len(changed) <= 8 and max(changed) - min(changed) < 8
    assert command(path, main=crc.main) == (0, "", ""), "once more"
    assert read_elf(tmp_path / "a.elf").words == words


def test_an_image_without_self_tests_stays_as_it_is(tmp_path) -> None:
    arguments = write(good_image(), tmp_path)
    assert (tmp_path / "a.elf").read_bytes() == good_image().elf()
    assert command(*arguments, main=image.main)[0] == 0


@pytest.mark.parametrize("place", [None, PLACE - 4, PLACE + 2])
def test_an_image_with_no_place_for_it_is_refused_and_not_touched(tmp_path, place: int | None) -> None:
    sample = with_self_tests(place if place != PLACE + 2 else None)
    if place == PLACE + 2:
        sample.words[place] = 0xFFFF # one word only
    path = sample.write(tmp_path)[0]
    status, _, error = command(path, main=crc.main)
    assert status == 2 and error.count("\n") == 1 and "no place for the flash's CRC" in error and "0x57FC" in error
    assert (tmp_path / "a.elf").read_bytes() == sample.elf()


def test_the_check_of_an_image_wants_the_crc_of_all_its_words(tmp_path) -> None:
    arguments = write(with_self_tests(), tmp_path)
    sample = with_self_tests()
    sample.words |= {address: read_elf(tmp_path / "a.elf").words[address] for address in (PLACE, PLACE + 2)}
    assert command(*sample.write(tmp_path), main=image.main)[0] == 0
    for address, bit in ((PLACE, 1), (PLACE + 2, 0x8000), (0x206, 4)):
        sample.words[address] ^= bit
        status, _, error = command(*sample.write(tmp_path), main=image.main)
        assert status == 1 and "flash's CRC at 0x57FC" in error, error
        sample.words[address] ^= bit
    assert command(*with_self_tests().write(tmp_path), main=image.main)[0] == 1, "left out"
    del arguments


@pytest.mark.parametrize("content", [None, b"", b"\x7fELF", END.encode()])
def test_a_file_that_is_no_program_is_one_line(tmp_path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "a.elf").write_bytes(content)
    status, _, error = command(str(tmp_path / "a.elf"), main=crc.main)
    assert status == 2 and error.count("\n") == 1 and "a.elf" in error


# ---- with PARAMS_KEPT: two pages that stay erased, and the CRC before them -----------------------------------------------------
KEPT_PLACE, NOT_LOADED = 0x4FFC, 0x00800000


def with_kept_pages(place: int = KEPT_PLACE):
    sample = with_self_tests(place)
    sample.sections.append(Section("pages", 0x5000, bytes(4096), EXECUTE | NOT_LOADED, names=[("_board_kept_pages", 0x5000, 0x800)]))
    sample.words[device.FIELDS["WDTPOST"].word] = sample.words[device.FIELDS["WDTPOST"].word] & ~0x0F | 6 # PS64
    return sample


def test_with_kept_parameters_the_crc_is_before_their_pages_and_of_what_is_before_it(tmp_path) -> None:
    arguments = write(with_kept_pages(), tmp_path)
    words = read_elf(tmp_path / "a.elf").words
    value = crc.crc(words, KEPT_PLACE)
    assert (words[KEPT_PLACE], words[KEPT_PLACE + 2]) == (value, value ^ 0xFFFF) and value == crc.crc(words | {KEPT_PLACE: 1}, KEPT_PLACE)
    assert not [address for address in words if address in device.KEPT], "what is not loaded is no content"
    sample = with_kept_pages()
    sample.words |= {address: words[address] for address in (KEPT_PLACE, KEPT_PLACE + 2)}
    status, out, error = command(*sample.write(tmp_path), main=image.main)
    assert status == 0 and "3072 more for kept parameters" in out, error
    sample.words[0x206] ^= 4
    assert "flash's CRC at 0x4FFC" in command(*sample.write(tmp_path), main=image.main)[2]
    del arguments


def test_with_kept_parameters_another_place_of_the_crc_is_refused(tmp_path) -> None:
    status, _, error = command(with_kept_pages(PLACE).write(tmp_path)[0], main=crc.main)
    assert status == 2 and "no place for the flash's CRC: board_flash_crc is not at 0x4FFC" in error


def test_a_word_in_the_kept_parameters_pages_and_the_usual_watchdog_are_refused(tmp_path) -> None:
    sample = with_kept_pages()
    sample.hex_words = {**sample.words, 0x5402: 0x123456}
    assert "word 0x5402 is in the pages of the kept parameters (0x5000 .. 0x57FE), which must stay erased" in command(*sample.write(tmp_path), main=image.main)[2]
    sample = with_kept_pages()
    sample.words[device.FIELDS["WDTPOST"].word] = with_self_tests().words[device.FIELDS["WDTPOST"].word]
    assert "WDTPOST is PS16 (watchdog / 16), must be PS64 (watchdog / 64)" in command(*sample.write(tmp_path), main=image.main)[2]
