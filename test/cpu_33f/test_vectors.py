"""The simulator against the hand-derived vectors of test/cpu_33f/vectors (form of a line: vectors.py): registers, memory, flags, cycles."""

import random

import pytest

import asm33
from alu import FLAG_NAMES
from machine import PROGRAM, RAM, Machine
from vectors import FLAGS, REGISTERS, Vector, read_all

SPLIM = 0x0FD0
BACKGROUND = random.Random(33).randbytes(0x800)


def start(machine: Machine, vector: Vector, flags: int) -> int:
    """Puts the machine before the vector; flags that it leaves open are all `flags`. The address of its end."""
    words, labels = asm33.assemble(vector.program, PROGRAM)
    before = vector.before
    words |= {int(name[2:-1], 16): value for name, value in before.items() if name.startswith("p[")}
    machine.load(words)
    sr = sum(before.get(name.lower(), 0) << bit for name, bit in FLAG_NAMES.items()) | before.get("ipl", 0) << 5
    for name, value in zip(FLAGS, vector.flags_before):
        sr |= (flags if value == "." else int(value)) << FLAG_NAMES[name]
    registers = {address: before[name] for name, address in REGISTERS.items() if name in before}
    registers = {REGISTERS["splim"]: SPLIM, REGISTERS["corcon"]: 0x20, **registers}
    memory = bytearray(BACKGROUND)
    for name, value in before.items():
        if name.startswith("["):
            at = int(name[1:-1], 16) - RAM
            memory[at:at + 2] = value.to_bytes(2, "little")
    w = [before.get(f"w{index}", 0x5A00 + 0x101 * index) for index in range(15)] + [before.get("w15", 0x0F00)]
    machine.set_state(w, sr, [before.get("a", 0x0011223344), before.get("b", 0xFFF1223344)], registers, bytes(memory), PROGRAM)
    return labels


def expected(vector: Vector, before: dict, labels: dict[str, int]) -> dict:
    """The state after the vector: the one before with what it names; None for what it leaves open."""
    state = dict(before)
    state["cycles"] = vector.cycles
    state["pc"] = labels["end"]
    for name, value in vector.after.items():
        if name == "pc":
            state["pc"] = labels[value] if isinstance(value, str) else value
        elif name.startswith("["):
            state[f"[{int(name[1:-1], 16):x}]"] = value
        elif name.upper() in FLAG_NAMES or name == "ipl":
            state[name.upper()] = value
        else:
            state[name] = value
    for name, value in zip(FLAGS, vector.flags_after):
        if value != ".":
            state[name] = None if value == "?" else int(value)
    return state


def differences(vector: Vector, machine: Machine, flags: int) -> list[str]:
    """What the simulator does otherwise."""
    labels = start(machine, vector, flags)
    before = machine.state()
    stop = machine.run(vector.cycles)
    after = machine.state()
    wanted = expected(vector, before, labels)
    found = [f"{name} is {_text(name, after.get(name))}, not {_text(name, value)}"
             for name, value in wanted.items() if value is not None and after.get(name) != value]
    return found + ([f"stopped: {stop}"] if stop else [])


def _text(name: str, value: int | None) -> str:
    return str(value) if name == "cycles" or value is None else f"{value:04x}"


GROUPS: dict[str, list[Vector]] = {}
for one in read_all():
    GROUPS.setdefault(f"{one.place.split('.')[0]} {one.group}", []).append(one)


@pytest.mark.parametrize("group", GROUPS)
def test_group(machine: Machine, group: str) -> None:
    """With all open flags clear and with all set."""
    wrong = [f"{vector}\n    {'; '.join(found)}" for vector in GROUPS[group] for flags in (0,
                                                                                           1) if (found := differences(vector, machine,
                                                                                                                       flags))]
    assert wrong == [], "\n" + "\n".join(wrong[:30])
