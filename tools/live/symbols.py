"""Names, addresses and types of the firmware's variables, from the ELF file of an image or of `make live-board`.

    symbols = Symbols.read(Path("build/target/foc33.elf"))
    symbols.find("board_drive.run.control.i_q13.q")     # Variable(address=..., bytes=2, signed=True)"""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from tools.common.errors import UserError, suggestion
from tools.image import attribution
from tools.image.program import contents, read_elf, reading

from .lnet import Channel

try:
    from elftools.elf.elffile import ELFFile
except ImportError:
    pass # program.reading() says so

DSPIC = "EM_DSPIC30F"
RAM, RAM_OF_CHIP = range(0x0800, 0xF800), range(0x0800, 0x8000)
"""Of the PC's firmware, and of an image: what lies beyond is the window to the flash, where constants are, and no client can read it."""
ADDRESS, PLUS = 0x03, 0x23
"""DW_OP_addr, DW_OP_plus_uconst."""
SIGNED = (0x05, 0x06, 0x0D)
"""DW_ATE: signed, signed char, signed fixed."""
MOST_ELEMENTS = 1024


@dataclass(frozen=True)
class Variable:
    """A number in the firmware's memory."""

    name: str
    address: int
    bytes: int
    signed: bool

    def value(self, data: bytes) -> int:
        """The number that these bytes are."""
        return int.from_bytes(data[:self.bytes], "little", signed=self.signed)

    def data(self, value: int) -> bytes:
        """The bytes of a number that fits; a larger one is a mistake."""
        try:
            return value.to_bytes(self.bytes, "little", signed=self.signed)
        except OverflowError:
            raise UserError(f"{value} does not fit {self.bytes} bytes", self.name, "write a smaller number") from None

    @property
    def channel(self) -> Channel:
        """For the scope, which takes 16 and 32 bits."""
        if self.bytes not in (2, 4):
            raise UserError(f"{self.bytes} bytes cannot be recorded", self.name, "choose a variable of two or four")
        return Channel(self.address, self.bytes, self.signed)


@dataclass
class Symbols:
    """Every number that an ELF file knows, by name: "scope_command.run", "board_params.fieldweak.idref_q13[3]"."""

    variables: dict[str, Variable]

    @staticmethod
    def read(path: Path) -> "Symbols":
        """The variables of an ELF file of XC16, or of the PC's."""
        with reading("ELF", path):
            found: dict[str, Variable] = {}
            ram = RAM_OF_CHIP if ELFFile(BytesIO(contents("ELF", path)))["e_machine"] == DSPIC else RAM
            for unit in dwarf_of(path).iter_CUs():
                for die in unit.iter_DIEs():
                    place = die.attributes.get("DW_AT_location") if die.tag == "DW_TAG_variable" else None
                    if place is not None and isinstance(place.value, (list, bytes)) and len(place.value) > 2 and place.value[0] == ADDRESS:
                        address = int.from_bytes(bytes(place.value[1:]), "little")
                        if address in ram:
                            found |= {item.name: item for item in _numbers(_declared(die), _name(die), address)}
        return Symbols(found)

    def find(self, name: str) -> Variable:
        """A variable by its name."""
        if name not in self.variables:
            raise UserError(f"the firmware has no variable '{name}'", "", suggestion(name, self.variables))
        return self.variables[name]


def dwarf_of(path: Path) -> Any:
    """Its debugging information."""
    data = contents("ELF", path)
    elf = ELFFile(BytesIO(data))
    info = elf.get_section_by_name(".debug_info")
    if info is None:
        raise UserError("no debugging information", str(path), "compile with -g")
    as_xc16 = elf["e_machine"] == DSPIC and not any(info.data()[1::2]) # not so after plain_elf.py
    return attribution.dwarf_info(read_elf(path, data).debug) if as_xc16 else elf.get_dwarf_info()


def _declared(die: Any) -> Any:
    """A variable that was declared before has its name and type there."""
    return die.get_DIE_from_attribute("DW_AT_specification") if "DW_AT_specification" in die.attributes else die


def _name(die: Any) -> str:
    found = _declared(die).attributes.get("DW_AT_name")
    return found.value.decode() if found else "?"


def _numbers(die: Any, path: str, address: int):
    """Each number in a variable or member."""
    kind = attribution.type_of(die)
    if kind is None:
        return
    if kind.tag == "DW_TAG_structure_type":
        for member in kind.iter_children():
            if member.tag == "DW_TAG_member" and "DW_AT_bit_size" not in member.attributes:
                yield from _numbers(member, f"{path}.{_name(member)}", address + _offset(member))
    elif kind.tag == "DW_TAG_array_type":
        yield from _elements(kind, path, address)
    elif kind.tag in ("DW_TAG_base_type", "DW_TAG_enumeration_type", "DW_TAG_pointer_type"):
        size = kind.attributes["DW_AT_byte_size"].value if "DW_AT_byte_size" in kind.attributes else 2
        encoding = kind.attributes.get("DW_AT_encoding")
        yield Variable(path, address, size, encoding is not None and encoding.value in SIGNED)


def _elements(array: Any, path: str, address: int):
    counts = [child.attributes["DW_AT_upper_bound"].value + 1 for child in array.iter_children() if "DW_AT_upper_bound" in child.attributes]
    if len(counts) != 1: # none of the firmware's has two dimensions
        return
    element = attribution.type_of(array)
    size = element.attributes["DW_AT_byte_size"].value if element is not None and "DW_AT_byte_size" in element.attributes else 2
    for index in range(min(counts[0], MOST_ELEMENTS)):
        yield from _numbers(array, f"{path}[{index}]", address + index * size)


def _offset(member: Any) -> int:
    place = member.attributes.get("DW_AT_data_member_location")
    if place is None or isinstance(place.value, int):
        return place.value if place is not None else 0
    value = bytes(place.value)
    if value[:1] != bytes([PLUS]):
        return 0
    return sum((byte & 0x7F) << 7 * number for number, byte in enumerate(value[1:]))
