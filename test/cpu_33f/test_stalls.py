"""Address register dependencies: every kind of write of a register before every kind of use, and the one cycle that some pairs cost more."""

import math

import pytest

import asm33
from machine import PROGRAM, RAM, Machine

# W8 becomes 0900 in each of these.
WRITES = ["mov w0,w8", "add w0,#0,w8", "mov #0x900,w8", "mov 0x0A00,w8", "mov [w1],w8", "mov [w1+0],w8", "exch w0,w8", "sl w2,#1,w8",
          "mul.uu w2,#2,w8", "sac a,w8", "lsr w11,w10,w8", "pop w8", "mov.d w0,w8", "add w0,w10,w8", "ze w10,w8; ior w8,w0,w8", "ior #0,w8", "mov w0,0x0010", "exch w8,w0", "bclr w8,#0"]
# W8 is a destination's pointer and is changed.
POINTERS = ["mov w3,[w8++]", "mov.b w3,[w8++]", "clr [++w8]", "mov w3,[--w8]", "mov.d w2,[w8++]", "sac a,[w8++]", "add w3,w3,[w8--]"]
# W8 is not written, or changed as a source's pointer only.
OTHERS = ["nop", "mov w3,[w8]", "mov [w8++],w3", "mov [--w8],w3", "cp w8,w0", "mov w8,w3", "mov w8,0x0A02", "btst.c [w8],#0", "mov [w8+2],w3",
          "clr a,[w8]+=2,w6", "add w8,w0,w3", "mov w0,w9"]
# W8 addresses a source.
SOURCES = ["mov [w8],w5", "mov [w8+w10],w5", "mov [w10+w8],w5", "mov [w8+2],w5", "mov.b [w8++],w5", "mov [--w8],w5", "add w5,[w8],w5", "cp0 [w8]", "cp w5,[w8]",
           "bset [w8],#0", "btst.z [w8],#3", "mul.uu w5,[w8],w4", "mac w4*w5,a,[w8]+=2,w6", "clr a,[w8],w6", "lac [w8],a", "mov.d [w8],w4",
           "se [w8],w5", "push [w8]", "inc [w8],w5", "ff1l [w8],w5", "tblrdl [w8],w5", "mov [w8],[w1]"]
# W8 is a value, or addresses a destination.
PLAIN = ["mov w8,w5", "add w8,w8,w5", "mov w5,[w8]", "mov w5,[w8++]", "mov w5,[w8+2]", "mov w5,[w10+w8]", "clr [w8]", "mov w8,0x0A02", "nop", "mov [w1],[w8]",
         "mov.d w4,[w8]", "add w5,w5,[w8]", "sac a,[w8]", "mov [w1],w5"]
TWO_CYCLES = ("mov.d", "tblrdl")
START = {"mov w3,[w8++]": 0x8FE, "mov.b w3,[w8++]": 0x8FF, "clr [++w8]": 0x8FE, "mov w3,[--w8]": 0x902, "mov.d w2,[w8++]": 0x8FC, "sac a,[w8++]": 0x8FE,
         "add w3,w3,[w8--]": 0x902, "mov [w8++],w3": 0x8FE, "mov [--w8],w3": 0x902, "clr a,[w8]+=2,w6": 0x8FE}


def cycles(text: str) -> int:
    """Of a text without stalls."""
    return sum(2 if part.strip().startswith(TWO_CYCLES) else 1 for part in text.split(";"))


def measured(machine: Machine, first: str, second: str, registers: dict[int, int] | None = None) -> int:
    """Cycles of the pair; `registers`: other values of W registers."""
    words, labels = asm33.assemble(f"{first}; {second}", PROGRAM)
    w = [0x900, 0xA00, 0x480, 0, 0, 0, 0, 0, START.get(first, 0x900), 0x900, 0, 0x900, 0, 0, 0, 0xE02]
    for register, value in (registers or {}).items():
        w[register] = value
    ram = bytearray(0x800)
    for address in (0xA00, 0xE00):
        ram[address - RAM:address - RAM + 2] = b"\0\x09"
    machine.load(words | {0x900: 0})
    machine.set_state(w, 0, [0x09000000, 0], {0x20: 0x0F00, 0x44: 0}, bytes(ram), PROGRAM)
    while machine.registers().pc != labels["end"]:
        before = machine.registers().cycles
        assert machine.run(before + 1) == "", f"{first}; {second}"
        assert before < 12, f"{first}; {second}"
    return machine.registers().cycles


@pytest.mark.parametrize("first, second, assumptions", [
    (WRITES, SOURCES, ["RAW_STALL_CYCLES"]), (POINTERS, SOURCES, ["RAW_STALL_CYCLES", "RAW_STALL_POINTER"]), (OTHERS, SOURCES, []),
    (WRITES + POINTERS + OTHERS, PLAIN, []), ([f"{write}; nop" for write in WRITES], SOURCES, [])],
    ids=["a written register that addresses the next source costs one",
         "a changed destination pointer that addresses the next source costs one",
         "a register that was only read costs nothing", "a register that the next uses otherwise costs nothing",
         "an instruction between hides the write"])
def test_every_pair_costs_as_much_more_than_its_instructions(machine: Machine, first: list[str], second: list[str],
                                                             assumptions: list[str]) -> None:
    stall = math.prod(machine.assumption(name) for name in assumptions) if assumptions else 0
    found = {f"{one}; {two}": measured(machine, one, two) - cycles(one) - cycles(two) for one in first for two in second}
    assert {pair: more for pair, more in found.items() if more != stall} == {}, stall


@pytest.mark.parametrize("first, second, stall", [
    ("mac w4*w5,a", "mov [w4],w9", 0), ("clr a", "mov [w4],w9", 0), ("clr a,[w8],w5", "mov [w5],w9", 1),
    ("clr a,[w8],w5", "mov [w4],w9", 0), ("clr a,[w10],w6", "mov [w6],w9", 1), ("clr a,[w10],w6", "mov [w4],w9", 0),
    ("ed w4*w4,a,[w8],[w10],w5", "mov [w5],w9", 1), ("ed w4*w4,a,[w8],[w10],w5", "mov [w4],w9", 0),
    ("clr a,w13", "mov [w13],w9", 1), ("clr a,[w13]+=2", "mov [w13],w9", 1), ("mac w4*w5,a", "mov [w13],w9", 0)])
def test_the_dsp_engine_writes_what_it_fetches_and_no_more(machine: Machine, first: str, second: str, stall: int) -> None:
    registers = {4: 0x900, 5: 0x900, 6: 0x900, 10: 0xE00, 13: 0x8FE if "+=" in first else 0xB00}
    assert measured(machine, first, second, registers) == 2 + stall
