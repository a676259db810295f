"""The drive's constants are the same to the bit on the chip and on the PC: double has 32 bits on the chip and 64 on the PC.

Both compilers get the same parameters; every field of the result is compared. Needs XC16."""

import os
import random
import re
import shlex
import subprocess
from io import BytesIO
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from xc16 import COMPILER, ROOT, needs_compiler

from tools.image import device
from tools.image.attribution import type_of

SOURCE = '#include "drive/param_init.h"\nconst drive_params_t board_params = DRIVE_PARAMS_INIT;\n'
NUMBER = re.compile(r"^(#define +\w+ +)(-?\d+\.\d+(?:e-?\d+)?)\b", re.MULTILINE)


def compiled(command: list[str], header: Path, folder: Path) -> ELFFile:
    """Object file with board_params of this userparams.h."""
    (folder / "a.c").write_text(SOURCE, encoding="utf-8")
    include = [f"-I{header.parent}", f"-I{ROOT / 'include'}"]
    done = subprocess.run([*command, "-std=gnu99", "-O2", *include, "-c", str(folder / "a.c"), "-o", str(folder / "a.o")],
                          capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{command[0]}: {done.stderr.strip().splitlines()[0]}")
    return ELFFile(BytesIO((folder / "a.o").read_bytes()))


def symbol_bytes(elf: ELFFile, name: str, size: int, octets: int) -> bytes:
    """A constant's bytes; XC16 keeps each of them in two (octets) of the file."""
    symbol = elf.get_section_by_name(".symtab").get_symbol_by_name(name)[0]
    data = elf.get_section(symbol["st_shndx"]).data()[::octets]
    assert symbol["st_size"] == size, f"{name} has {symbol['st_size']} bytes, its fields add up to {size}"
    return data[symbol["st_value"]:symbol["st_value"] + size]


def fields(kind, path: str, offset: int) -> list[tuple[str, int, int, bool]]:
    """Every number inside a type: path, offset, size, signed."""
    if kind.tag == "DW_TAG_structure_type":
        return [field for member in kind.iter_children() if member.tag == "DW_TAG_member"
                for field in fields(type_of(member), f"{path}.{member.attributes['DW_AT_name'].value.decode()}",
                                    offset + member.attributes["DW_AT_data_member_location"].value)]
    if kind.tag == "DW_TAG_array_type":
        count = next(kind.iter_children()).attributes["DW_AT_upper_bound"].value + 1
        inner = type_of(kind)
        size = inner.attributes["DW_AT_byte_size"].value
        return [field for i in range(count) for field in fields(inner, f"{path}[{i}]", offset + i * size)]
    assert kind.tag == "DW_TAG_base_type", kind.tag
    return [(path, offset, kind.attributes["DW_AT_byte_size"].value, kind.attributes["DW_AT_encoding"].value in (5, 6))]


def host_values(header: Path, folder: Path) -> list[tuple[str, int, bool, int]]:
    """Each field of board_params on the PC: path, size, signed, value."""
    host = compiled([*shlex.split(os.environ.get("CC") or "gcc"), "-g", "-gdwarf-4"], header, folder)
    variable = next(die for unit in host.get_dwarf_info().iter_CUs() for die in unit.iter_DIEs()
                    if die.tag == "DW_TAG_variable" and die.attributes["DW_AT_name"].value == b"board_params")
    kind = type_of(variable)
    layout = fields(kind, "board_params", 0)
    data = symbol_bytes(host, "board_params", kind.attributes["DW_AT_byte_size"].value, 1)
    return [(path, size, signed, int.from_bytes(data[offset:offset + size], "little", signed=signed))
            for path, offset, size, signed in layout]


def values(header: Path, folder: Path, target: str) -> list[tuple[str, int, int]]:
    """Each field of board_params with its value on the PC and on the chip, where nothing is aligned to more than two bytes."""
    here = host_values(header, folder)
    there = symbol_bytes(compiled([target, f"-mcpu={device.NAME}", "-omf=elf"], header, folder), "_board_params",
                         sum(size for _, size, _, _ in here), 2)
    result, at = [], 0
    for path, size, signed, value in here:
        result.append((path, value, int.from_bytes(there[at:at + size], "little", signed=signed)))
        at += size
    return result


def test_the_fields_are_read_with_their_names_sizes_and_signs(tmp_path):
    found = {path: (size, signed, value) for path, size, signed, value in host_values(ROOT / "userparams.h", tmp_path)}
    text = (ROOT / "userparams.h").read_text(encoding="utf-8")
    numbers = {name: float(number) for name, number in re.findall(r"^#define +(\w+) +(-?[\d.]+)\b", text, re.MULTILINE)}
    assert found["board_params.align_periods"] == (2, False, numbers["LOCK_TIME"])
    assert found["board_params.kcurr_a"] == (2, True, round(numbers["KCURRA"] * 32768))
    assert found["board_params.maximum_erpm"] == (2, True, numbers["MAXIMUM_SPEED_RPM"] * numbers["NOPOLESPAIRS"])
    assert found["board_params.duty_per_volt_numerator"][:2] == (4, False)
    assert "board_params.fieldweak.idref_q13[17]" in found


@needs_compiler
@pytest.mark.parametrize("seed", [None, *range(12)])
def test_every_field_is_the_same_for_the_projects_own_parameters_and_for_others(tmp_path, seed):
    text = (ROOT / "userparams.h").read_text(encoding="utf-8")
    assert len(NUMBER.findall(text)) > 40
    if seed is not None:
        rng = random.Random(seed)
        text = NUMBER.sub(lambda m: f"{m[1]}{float(m[2]) * rng.uniform(0.9, 1.1):.7g}", text)
    header = tmp_path / "userparams.h"
    header.write_text(text, encoding="utf-8")
    pairs = values(header, tmp_path, COMPILER)
    assert len(pairs) > 100 and sum(host != 0 for _, host, _ in pairs) > 90
    assert [f"{path}: {host} on the PC, {image} on the chip" for path, host, image in pairs if host != image] == []
