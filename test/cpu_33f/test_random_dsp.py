"""Random DSP instructions in random modes: the simulator against the exact reference in dsp.py, all flags and both accumulators."""

import random

import pytest

import asm33
from alu import FLAG_NAMES, OA, OAB, OB, SA, SAB, SB, State, signed
from dsp import INDEXED, UNUSED, Dsp, is_dsp
from machine import Machine
from operands import Sampler

ROUNDS = 1000
CHAINS = 400
ROWS = [row for row in asm33.ROWS if is_dsp(row)]
WORDS = [0, 1, 0x7FFF, 0x8000, 0x8001, 0xFFFF, 0x4000, 0xC000]
EDGES = [1 << 31, 1 << 39, 0, 0x7FFF8000, 0x12348000, 0x12358000, (1 << 31) - 0x8000, -(1 << 31), -(1 << 39)]
MODES = (12, 7, 6, 5, 4, 1, 0)  # US SATA SATB SATDW ACCSAT RND IF
Y_SPACE = 0x0C00


class Chance:
    """Numbers that lie close to where something happens."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def word(self) -> int:
        """A register's value."""
        return self.random.choice([self.random.choice(WORDS), self.random.getrandbits(16)])

    def accumulator(self) -> int:
        """A 40-bit value."""
        near = self.random.choice(EDGES) + self.random.randint(-3, 3)
        value = self.random.choice([near, near, self.random.getrandbits(40), self.random.getrandbits(32), self.random.getrandbits(16) << 16])
        return signed(value, 40)

    def corcon(self) -> int:
        """A mode of the DSP engine."""
        return sum(self.random.getrandbits(1) << bit for bit in MODES)


def reach(chance: random.Random, state: State, row: asm33.Row, fields: dict[str, int]) -> None:
    """Lets the addresses of the instruction lie in RAM: X space for W8, W9, Y space for W10, W11."""
    w = state.w
    if "i" in fields:
        w[12] = chance.randrange(-0x80, 0x80, 2) & 0xFFFF
        w[8], w[9] = (chance.randrange(0x900, 0xB80, 2) for _ in range(2))
        w[10], w[11] = (chance.randrange(0xD00, 0xF40, 2) for _ in range(2))
        if fields.get("a") == 1:
            w[13] = chance.randrange(0x900, 0xF80, 2)
        return
    letter = "d" if "h" in fields else "s"
    mode = fields.get("h", fields.get("g", 0))
    if mode:
        w[fields[letter]] = chance.randrange(0xA00, 0xE00, 2)
    if mode == 6:
        w[fields["w"]] = chance.randrange(-0x200, 0x200, 2) & 0xFFFF
    if row.mnemonic == "sftac" and "s" in fields:
        w[fields["s"]] = chance.randint(-16, 16) & 0xFFFF


def usable(fields: dict[str, int], row: asm33.Row) -> bool:
    """No case that the data sheet leaves open: one register as pointer and offset, as target of both prefetches, the stack pointer."""
    if fields.get("h", fields.get("g", 0)) >= 6 and fields["w"] == fields["d" if "h" in fields else "s"]:
        return False
    if "j" in fields and row.mnemonic not in ("ed", "edac") and UNUSED not in (fields["i"], fields["j"]) and fields["x"] == fields["y"]:
        return False
    if row.mnemonic in ("ed", "edac") and UNUSED in (fields["i"], fields["j"]):
        return False
    return 15 not in (fields.get("s"), fields.get("d")) and not (fields.get("h", fields.get("g", 0)) >= 6 and fields["w"] == 15)


def sample(sampler: Sampler, row: asm33.Row) -> tuple[str, int, dict[str, int]]:
    """An instruction of this row."""
    while True:
        text = sampler.text(row)
        word = asm33.encode(text)[0]
        fields = row.extract([word])
        if usable(fields, row):
            return text, word, fields


def ram(chance: Chance) -> bytes:
    """Contents of the memory."""
    return b"".join(chance.word().to_bytes(2, "little") for _ in range(0x400))


def begin(chance: Chance, memory: bytes) -> State:
    """A random state, in the reference."""
    state = State(memory)
    state.w = [chance.word() for _ in range(14)] + [0x5A5A, 0x0F80]
    state.corcon = chance.corcon()
    state.acc = [chance.accumulator(), chance.accumulator()]
    for first, second, both in ((OA, OB, OAB), (SA, SB, SAB)):
        for bit in (first, second):
            state.set_flag(bit, chance.random.random() < 0.2)
        state.set_flag(both, state.flag(first) or state.flag(second))
    for name in ("C", "Z", "N", "OV", "DC"):
        state.set_flag(FLAG_NAMES[name], chance.random.getrandbits(1))
    return state


@pytest.mark.parametrize("number", range(len(ROWS)), ids=[" ".join(row.text.split()[:2]) for row in ROWS])
def test_every_instruction_does_what_the_reference_does(machine: Machine, number: int) -> None:
    row, chance, sampler, wrong, memory = ROWS[number], Chance(40 + number), Sampler(41 + number), [], b""
    for turn in range(ROUNDS):
        memory = ram(chance) if turn % 50 == 0 else memory
        text, word, fields = sample(sampler, row)
        state = begin(chance, memory)
        reach(chance.random, state, row, fields)
        machine.start([word], state)
        acc = " ".join(f"{value & 0xFFFFFFFFFF:010x}" for value in state.acc)
        before = f"{text}: A, B {acc} CORCON {state.corcon:04x} SR {state.sr:04x}"
        stopped = machine.run(1)
        Dsp(state, row, fields).execute()
        cycles = machine.registers().cycles
        if found := machine.differences(state, stopped) + ([f"{cycles} cycles"] if cycles != 1 else []):
            wrong.append(f"{before}: {'; '.join(found)}")
    assert wrong[:3] == [], f"{len(wrong)} of {ROUNDS}"


def test_enough_instructions_are_tried() -> None:
    assert ROUNDS * len(ROWS) >= 19000


def test_chains_of_instructions_end_in_the_same_state(machine: Machine) -> None:
    chance, sampler = Chance(42), Sampler(43)
    rows = [row for row in ROWS if "i" in row.extract([0])]
    wrong = []
    memory = ram(chance)
    for _ in range(CHAINS):
        state = begin(chance, memory)
        chain = [sample(sampler, row) + (row,) for row in (chance.random.choice(rows) for _ in range(12))]
        chain = [part for part in chain if part[2].get("a") != 1 and INDEXED not in (part[2]["i"], part[2]["j"])]
        state.w[8:12] = 0x9C0, 0xA80, 0xD80, 0xE80
        machine.start([part[1] for part in chain], state)
        stopped = machine.run(len(chain))
        for _, _, fields, row in chain:
            Dsp(state, row, fields).execute()
        if found := machine.differences(state, stopped):
            wrong.append(f"{'; '.join(part[0] for part in chain)}: {'; '.join(found)}")
    assert wrong[:3] == [], f"{len(wrong)} of {CHAINS}"
