"""Which W registers hold addresses of RAM: what is read there does not come through the PSV window, which costs more cycles.

A register holds one if a literal in the RAM's range has come into it, or such an address and a number that shifts, masks or products have
made. What is loaded may be anything. It is assumed that, as in C, an address of an object is only moved inside that object."""

import re
from collections.abc import Mapping

from . import device
from .facts import Op

RAM, NUMBER, UNKNOWN = "R", "N", "?"
Held = str                                          # of W0 to W15, a letter each
NOTHING_KNOWN: Held = UNKNOWN * 14 + RAM * 2        # but frame and stack pointer
_NUMBERS = ("sl", "lsr", "asr", "and", "mul", "ze", "se")
_SUMS = ("add", "sub")
_STEPS = ("inc", "dec", "inc2", "dec2")
_REGISTER = re.compile(r"w(\d+)$")
_MOVED = re.compile(r"\[(?:\+\+|--)?w(\d+)(?:\+\+|--)?\]")


def is_ram(op: Op, held: Held) -> bool:
    """Whether everything that an instruction reads through registers is in RAM."""
    classes = [held[number] for number in range(16) if op.stall >> number & 1]
    return bool(classes) and classes.count(RAM) == 1 and classes.count(UNKNOWN) == 0


def meet(one: Held, two: Held) -> Held:
    """What is known where two ways come together."""
    return one if one == two else "".join(a if a == b else UNKNOWN for a, b in zip(one, two))


def after(op: Op, held: Held) -> Held:
    """What the registers hold after an instruction."""
    if not op.writes & 0x3FFF:
        return held
    result = list(held)
    kept = {int(number) for number in _MOVED.findall(op.text)}
    for number, kind in _written(op, held).items():
        if number < 14 and number not in kept:
            result[number] = kind
    return "".join(result)


def _written(op: Op, held: Held) -> Mapping[int, str]:
    """What the instruction leaves in each register that it writes."""
    head, _, rest = op.text.partition(" ")
    mnemonic, operands = head.partition(".")[0], rest.split(",")
    targets = [number for number in range(16) if op.writes >> number & 1]
    if head == "mov" and len(operands) == 2:
        return dict.fromkeys(targets, _value(operands[0], held))
    if head == "mov.d" and (found := _REGISTER.match(operands[0])):
        return dict(zip(targets, held[int(found[1]):]))
    if mnemonic in _SUMS and not head.endswith(".b"):
        sources = operands[:2] if len(operands) == 3 else operands
        return dict.fromkeys(targets, _sum([_value(source, held) for source in sources]))
    if head in _STEPS:
        return dict.fromkeys(targets, _value(operands[0], held))
    return dict.fromkeys(targets, NUMBER if mnemonic in _NUMBERS else UNKNOWN)


def _value(operand: str, held: Held) -> str:
    if found := _REGISTER.match(operand):
        return held[int(found[1])]
    if not operand.startswith("#"):
        return UNKNOWN
    literal = int(operand[1:], 0)
    if literal in device.RAM:
        return RAM
    return NUMBER if literal < device.RAM.start else UNKNOWN


def _sum(kinds: list[str]) -> str:
    if UNKNOWN in kinds or kinds.count(RAM) > 1:
        return UNKNOWN
    return RAM if RAM in kinds else NUMBER
