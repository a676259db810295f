"""Names of types in a PC's ELF file: those of the chip's compiler, for clients of the serial line."""

import subprocess
from io import BytesIO

import pytest
from elftools.common.construct_utils import ULEB128
from support import refusal

from tools.live.chip_types import leb128, rename
from tools.live.symbols import dwarf_of

SOURCE = "long unsigned int a; long int b; unsigned int c; short int d; int e; unsigned char f;\n"


def types_of(path) -> dict[str, str]:
    """The name of each variable's type."""
    unit = next(dwarf_of(path).iter_CUs())
    variables = [die for die in unit.iter_DIEs() if die.tag == "DW_TAG_variable"]
    return {die.attributes["DW_AT_name"].value.decode(): die.get_DIE_from_attribute("DW_AT_type").attributes["DW_AT_name"].value.decode() for die in variables}


def compiled(folder, text: str):
    (folder / "types.c").write_text(text)
    subprocess.run(["gcc", "-g", "-shared", "-nostdlib", "types.c", "-o", "types.so"], cwd=folder, check=True)
    return folder / "types.so"


def test_types_of_32_bits_have_the_chip_s_names_and_the_others_their_own(tmp_path):
    path = compiled(tmp_path, SOURCE)
    size = path.stat().st_size
    assert rename(path) == 2 and path.stat().st_size == size
    assert types_of(path) == {"a": "long unsigned int", "b": "long int", "c": "long unsigned int", "d": "short int", "e": "long int", "f": "unsigned char"}


def test_a_file_without_the_chip_s_names_is_refused(tmp_path):
    path = compiled(tmp_path, "int e;\n")
    before = path.read_bytes()
    refusal(lambda: rename(path), "no name 'long int'")
    assert path.read_bytes() == before


@pytest.mark.parametrize("value", [0, 1, 83, 127, 128, 129, 300, 16383])
@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_number_of_any_size_reads_back(value, size):
    """A file with more than 127 kinds of entries, as that of IDENTIFY, has entries whose number takes two bytes."""
    if value >> 7 * size == 0:
        data = BytesIO(leb128(value, size) + b"\xff")
        assert ULEB128("number").parse_stream(data) == value and data.tell() == size
