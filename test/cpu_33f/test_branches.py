"""Every conditional branch under every combination of the flags: taken or not, and the cycles of both."""

import itertools
import unittest

import asm33
from alu import FLAG_NAMES
from machine import PROGRAM, Machine

# What the Programmer's Reference Manual gives as the condition of each branch.
CONDITIONS = {
    "c": lambda f: f["C"], "nc": lambda f: not f["C"], "z": lambda f: f["Z"], "nz": lambda f: not f["Z"],
    "n": lambda f: f["N"], "nn": lambda f: not f["N"], "ov": lambda f: f["OV"], "nov": lambda f: not f["OV"],
    "ge": lambda f: (f["N"] and f["OV"]) or (not f["N"] and not f["OV"]),
    "lt": lambda f: (f["N"] and not f["OV"]) or (not f["N"] and f["OV"]),
    "gt": lambda f: (not f["Z"] and f["N"] and f["OV"]) or (not f["Z"] and not f["N"] and not f["OV"]),
    "le": lambda f: f["Z"] or (f["N"] and not f["OV"]) or (not f["N"] and f["OV"]),
    "gtu": lambda f: f["C"] and not f["Z"], "leu": lambda f: not f["C"] or f["Z"],
    "oa": lambda f: f["OA"], "ob": lambda f: f["OB"], "sa": lambda f: f["SA"], "sb": lambda f: f["SB"],
}
FLAGS = ("C", "Z", "N", "OV", "OA", "OB", "SA", "SB")


class Branches(unittest.TestCase):
    def test_each_is_taken_exactly_when_its_condition_holds(self) -> None:
        machine, wrong = Machine(), []
        for name, condition in CONDITIONS.items():
            words, labels = asm33.assemble(f"bra {name},t\n n: nop\n nop\n t: nop", PROGRAM)
            machine.load(words)
            for values in itertools.product((0, 1), repeat=len(FLAGS)):
                flags = dict(zip(FLAGS, values))
                sr = sum(value << FLAG_NAMES[flag] for flag, value in flags.items())
                machine.set_state([0] * 15 + [0x900], sr, [0, 0], {}, bytes(0x800), PROGRAM)
                machine.run(1)
                now = machine.registers()
                if (now.pc, now.cycles) != ((labels["t"], 2) if condition(flags) else (labels["n"], 1)):
                    wrong.append(f"bra {name} with {' '.join(flag for flag in FLAGS if flags[flag]) or 'no flag'}")
        self.assertEqual([], wrong)
