"""Random integer instructions with random registers, memory and flags: the simulator against the reference in alu.py."""

import random

import pytest

import asm33
from alu import FLAG_NAMES, OV, RA, Alu, C, State
from dsp import is_dsp
from machine import PROGRAM, RAM, Machine
from operands import Sampler

ROUNDS = 130
EXTREMES = [0, 1, 0x7F, 0x80, 0xFF, 0x100, 0x7FFF, 0x8000, 0x8001, 0xFFFF, 0xFFFE]
# What the vectors alone test: program flow, tables, stack frames, and what acts on the core as a whole.
ELSEWHERE = {"bra", "call", "rcall", "goto", "return", "retlw", "retfie", "do", "repeat", "btss", "btsc", "cpseq", "cpsne", "cpsgt",
             "cpslt", "push", "pop",
             "push.s", "pop.s", "lnk", "ulnk", "tblrdl", "tblrdh", "tblwtl", "tblwth", "nop", "nopr", "clrwdt", "disi", "pwrsav", "reset"}
ROWS = [row for row in asm33.ROWS if not is_dsp(row) and row.mnemonic not in ELSEWHERE]


class Case:
    """One instruction and a state in which its addresses lie in RAM."""

    def __init__(self, chance: random.Random, sampler: Sampler, row: asm33.Row, memory: bytes) -> None:
        self.chance, self.row, self.memory = chance, row, memory
        while True:
            self.text = sampler.text(row).replace("w15", "w13").replace("w14", "w12")
            try:
                self.word = asm33.encode(self.text)[0]
            except ValueError:  # an odd register took the place of an even one
                continue
            self.fields = row.extract([self.word])
            if self._has_roles():
                break
        self._place_file()
        self._make_state()

    def _has_roles(self) -> bool:
        """Whether every pointer is a register of its own; which one wins else is not written down."""
        fields = self.fields
        modes = {"s": fields.get("p", fields.get("g", 0)), "d": fields.get("q", fields.get("h", 0))}
        if "k" in fields and self.row.operands[0] in ("Wb",) and "p" not in fields:
            modes["s"] = 0
        self.pointers = [fields[letter] for letter in "sd" if letter in fields and (modes[letter] or self._by_offset(letter))]
        self.indexed = any(mode == 6 for mode in modes.values())
        others = [fields[letter] for letter in "sd" if letter in fields and fields[letter] not in self.pointers]
        if "w" in fields:
            others.append(fields["w"])
        pairs = [register + 1 for register in others] if ":" in "".join(self.row.operands) else []
        return len(set(self.pointers)) == len(self.pointers) and not set(self.pointers) & {*others, *pairs}

    def _by_offset(self, letter: str) -> bool:
        return f"[W{letter}+k]" in self.row.operands

    def _place_file(self) -> None:
        """A file address in RAM."""
        if "f" in self.fields:
            address = self.chance.randrange(RAM, RAM + 0x800)
            if self.row.width("f") == 15:
                self.fields["f"] = address >> 1
            else:
                byte = self.fields.get("B", 0) or "f.bit" in self.row.operands
                self.fields["f"] = address if byte else address & ~1
            self.word = self.row.insert(self.fields)[0]

    def _number(self) -> int:
        return self.chance.choice([self.chance.choice(EXTREMES), self.chance.getrandbits(16)])

    def _make_state(self) -> None:
        self.state = State(self.memory)
        self.state.w = [self._number() for _ in range(14)] + [0x5A5A, 0x0F80]
        step = 1 if self.fields.get("B") or self.row.mnemonic in ("se", "ze") else 2
        for register in self.pointers:
            self.state.w[register] = self.chance.randrange(RAM + 0x404, RAM + 0x600, step)
        if self.indexed:
            self.state.w[self.fields["w"]] = self.chance.randrange(-0x200, 0x200, step) & 0xFFFF
        if "k" in self.fields and self.pointers and self.row.operands[0] != "Wb":  # an offset: stay within RAM
            offset = self.chance.randrange(-0xF0, 0xF0)
            self.fields["k"] = offset & 0x3FF
            self.word = self.row.insert(self.fields)[0]
        if self.row.mnemonic.startswith("div"):
            self._make_division()
        self.state.sr = sum(self.chance.getrandbits(1) << bit for name, bit in FLAG_NAMES.items() if name in ("C", "Z", "N", "OV", "DC"))

    def _make_division(self) -> None:
        """A divisor that is not 0, and mostly a quotient that fits."""
        w, fields = self.state.w, self.fields
        while w[fields["s"]] == 0 or fields["s"] == fields["m"] + 1 and w[fields["s"]] == 0:
            w[fields["s"]] = self._number()
        if "t" in fields and self.chance.random() < 0.8 and fields["s"] not in (fields["m"], fields["m"] + 1):
            divisor = w[fields["s"]]
            quotient, rest = self._number(), self.chance.randrange(divisor)
            product = quotient * divisor + rest
            w[fields["m"]], w[fields["m"] + 1] = product & 0xFFFF, product >> 16


def run_case(machine: Machine, case: Case) -> list[str]:
    """Differences between simulator and reference after one instruction."""
    division = case.row.mnemonic.startswith("div")
    words = [0x090011, case.word] if division else [case.word]
    state = case.state
    machine.start(words, state)
    cycles = 19 if division else 2 if case.row.mnemonic == "mov.d" else 1
    stopped = machine.run(cycles)
    Alu(state, case.row, case.fields).execute()
    mask, overflow = 0xFFFF & ~(1 << RA), division and state.flag(OV)
    if division:
        mask &= ~(1 << C | (0xA if overflow else 0))
    found = machine.differences(state, stopped, mask, 2 if overflow else 0)
    after = machine.registers()
    if after.cycles != cycles or after.pc != PROGRAM + 2 * len(words):
        found.append(f"{after.cycles} cycles to {after.pc:04x}, not {cycles}")
    return found


@pytest.mark.parametrize("number", range(len(ROWS)), ids=[" ".join(row.text.split()[:2]) for row in ROWS])
def test_every_instruction_does_what_the_reference_does(machine: Machine, number: int) -> None:
    row, chance, sampler, wrong = ROWS[number], random.Random(2010 + number), Sampler(2011 + number), []
    memories = [chance.randbytes(0x800), b"\0" * 0x800, b"\xff" * 0x800, chance.randbytes(0x800)]
    for turn in range(ROUNDS):
        case = Case(chance, sampler, row, memories[turn % 4])
        registers = " ".join(f"{value:04x}" for value in case.state.w)
        if found := run_case(machine, case):
            wrong.append(f"{case.text} = {case.word:06x}, W: {registers}: {'; '.join(found)}")
    assert wrong[:3] == [], f"{len(wrong)} of {ROUNDS}"


def test_enough_instructions_are_tried() -> None:
    assert ROUNDS * len(ROWS) > 15000
