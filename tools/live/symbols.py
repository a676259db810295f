"""The firmware's variables by name, as its ELF file has them: address, size and sign of every number in RAM, members of structures included."""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.common import paths
from tools.common.errors import UserError, suggestion

RAM = range(0x0800, 0x8000)
"""Where variables are; above the dsPIC has its window to constants."""
MOST_ELEMENTS = 32
"""Of an array that is listed element by element."""
WRAPPERS = ("DW_TAG_typedef", "DW_TAG_volatile_type", "DW_TAG_const_type")
SIGNED = (0x05, 0x06)
"""DW_ATE_signed and signed_char."""


@dataclass(frozen=True)
class Variable:
    """A number that can be read."""

    name: str
    address: int
    bytes: int
    signed: bool

    def value(self, data: bytes) -> int:
        """From memory."""
        return int.from_bytes(data[:self.bytes], "little", signed=self.signed)


def variables(path: Path) -> dict[str, Variable]:
    """All of them by name."""
    from elftools.common.exceptions import ELFError
    from elftools.elf.elffile import ELFFile
    label = str(paths.shown(path))
    try:
        elf = ELFFile(io.BytesIO(path.read_bytes()))
    except OSError as error:
        raise UserError(f"cannot read the symbols ({error.strerror})", label, "name the ELF file of the firmware on the board, ELF=file") from None
    except ELFError:
        raise UserError("no ELF file", label, "name the one that make firmware has left, ELF=build/target/foc33.elf") from None
    found = {item.name: item for item in _listed(elf) if item.address in RAM} if elf.has_dwarf_info() else {}
    if not found:
        raise UserError("the ELF file has no variables", label, "build it with -g, as make firmware does")
    return found


def named(known: dict[str, Variable], name: Any) -> Variable:
    """One of them; a wrong name is refused."""
    if not isinstance(name, str) or name not in known:
        raise UserError(f"the firmware has no variable '{name}'", "scope", suggestion(str(name), known))
    return known[name]


def _listed(elf: Any) -> Iterator[Variable]:
    for unit in elf.get_dwarf_info().iter_CUs():
        for entry in unit.get_top_DIE().iter_children():
            if entry.tag != "DW_TAG_variable" or "DW_AT_location" not in entry.attributes:
                continue
            place = entry.attributes["DW_AT_location"].value
            declared = entry.get_DIE_from_attribute("DW_AT_specification") if "DW_AT_specification" in entry.attributes else entry
            if isinstance(place, list) and place and place[0] == 0x03 and {"DW_AT_type", "DW_AT_name"} <= declared.attributes.keys(): # DW_OP_addr
                yield from _numbers(_name(declared), int.from_bytes(bytes(place[1:]), "little"), declared.get_DIE_from_attribute("DW_AT_type"))


def _numbers(name: str, address: int, kind: Any) -> Iterator[Variable]:
    """A number, or the numbers in a structure or an array."""
    while kind.tag in WRAPPERS and "DW_AT_type" in kind.attributes:
        kind = kind.get_DIE_from_attribute("DW_AT_type")
    if kind.tag in ("DW_TAG_base_type", "DW_TAG_enumeration_type"):
        size = kind.attributes["DW_AT_byte_size"].value
        if size in (1, 2, 4):
            yield Variable(name, address, size, "DW_AT_encoding" in kind.attributes and kind.attributes["DW_AT_encoding"].value in SIGNED)
    elif kind.tag in ("DW_TAG_structure_type", "DW_TAG_union_type"):
        for member in kind.iter_children():
            if member.tag == "DW_TAG_member" and "DW_AT_bit_size" not in member.attributes and "DW_AT_name" in member.attributes:
                yield from _numbers(f"{name}.{_name(member)}", address + _offset(member), member.get_DIE_from_attribute("DW_AT_type"))
    elif kind.tag == "DW_TAG_array_type":
        yield from _elements(name, address, kind)


def _elements(name: str, address: int, kind: Any) -> Iterator[Variable]:
    counts = [child.attributes["DW_AT_upper_bound"].value + 1 for child in kind.iter_children()
              if child.tag == "DW_TAG_subrange_type" and isinstance(getattr(child.attributes.get("DW_AT_upper_bound"), "value", None), int)]
    element = kind.get_DIE_from_attribute("DW_AT_type")
    size = _size(element)
    if len(counts) == 1 and size and counts[0] <= MOST_ELEMENTS:
        for number in range(counts[0]):
            yield from _numbers(f"{name}[{number}]", address + number * size, element)


def _size(kind: Any) -> int:
    """0 where it is not known."""
    while kind.tag in WRAPPERS and "DW_AT_type" in kind.attributes:
        kind = kind.get_DIE_from_attribute("DW_AT_type")
    return kind.attributes["DW_AT_byte_size"].value if "DW_AT_byte_size" in kind.attributes else 0


def _offset(member: Any) -> int:
    """Of a member; DWARF 2, as XC16 writes it, has it as an expression: DW_OP_plus_uconst."""
    if "DW_AT_data_member_location" not in member.attributes:
        return 0
    place = member.attributes["DW_AT_data_member_location"].value
    if isinstance(place, int):
        return place
    value = 0
    for shift, byte in enumerate(place[1:]):
        value |= (byte & 0x7F) << 7 * shift
    return value


def _name(entry: Any) -> str:
    return entry.attributes["DW_AT_name"].value.decode()
