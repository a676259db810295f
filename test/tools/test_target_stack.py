"""The deepest stack from a disassembly: each way to use it counts what a hand count gives, and what cannot be followed is an error by name."""

import unittest

from tools.image import stack

WIDE = ("call 0x", "goto 0x", "call {", "goto {", "do ") # instructions of two words


def listing(source: str, start: int = 0x200) -> str:
    """What xc16-objdump -d prints for lines "name:", ".label:" and instructions; {name} stands for a label's address."""
    at, labels, items = start, {}, []
    for line in (line.strip() for line in source.strip().splitlines()):
        if line.endswith(":"):
            labels[line[:-1]] = at
            items.append((at, line[:-1], None))
        else:
            items.append((at, None, line))
            at += 4 if line.startswith(WIDE) else 2
    text = ["", "foc33.elf:     file format elf32-pic30", ""]
    for address, label, line in items:
        if label is not None:
            text += ["", f"{address:08x} <{label}>:"]
            continue
        for name, value in labels.items():
            line = line.replace("{" + name + "}", f"0x{value:x} <{name}>")
        mnemonic, _, operands = line.partition(" ")
        text.append(f"{address:6x}:\t00 00 00    \t{mnemonic:<9} {operands}".rstrip())
        if line.startswith(WIDE):
            text.append(f"{address + 2:6x}:\t00 00 00 ")
    return "\n".join(text) + "\n"


def program(source: str, calls_nothing: tuple[str, ...] = ()) -> tuple[stack.Chain, list[str]]:
    """Deepest chain and errors of the first function."""
    result = stack.Program(stack.parse(listing(source)), calls_nothing)
    return result.deepest(0x200), result.errors


class OneFunction(unittest.TestCase):
    def depth(self, source: str) -> int:
        chain, errors = program(source)
        self.assertEqual(errors, [])
        return chain.depth

    def wrong(self, source: str, *words: str) -> None:
        """Exactly one error, with the function's name and these words."""
        errors = program(source)[1]
        self.assertEqual(len(errors), 1, errors)
        for word in ("f:", *words):
            self.assertIn(word, errors[0])

    def test_a_leaf_without_a_frame_needs_nothing(self):
        self.assertEqual(self.depth("_f:\nmov.w #0x5, w0\nreturn"), 0)

    def test_a_frame_is_its_size_and_the_saved_frame_pointer(self):
        self.assertEqual(self.depth("_f:\nlnk #0x28\nulnk\nreturn"), 42)

    def test_an_interrupt_that_saves_everything_is_what_counting_by_hand_gives(self):
        saves = "\n".join(f"mov.d w{i}, [w15++]" for i in range(0, 14, 2))
        loads = "\n".join(f"mov.d [--w15], w{i}" for i in range(12, -2, -2))
        self.assertEqual(self.depth(f"_f:\npush 0x36\n{saves}\nlnk #0x28\nulnk\n{loads}\npop 0x36\nretfie"), 2 + 7 * 4 + 2 + 0x28)

    def test_each_form_of_a_push_counts_its_words(self):
        for push, pop, size in (("push w8", "pop w8", 2), ("push.d w8", "pop.d w8", 4), ("push 0x36", "pop 0x36", 2),
                                ("mov.w w8, [w15++]", "mov.w [--w15], w8", 2), ("mov.d w8, [w15++]", "mov.d [--w15], w8", 4),
                                ("clr.w [w15++]", "sub.w w15, #0x2, w15", 2), ("add.w w15, #0x6, w15", "sub.w w15, #0x6, w15", 6),
                                ("add.w #0x20, w15", "sub.w #0x20, w15", 32), ("inc2.w w15, w15", "dec2.w w15, w15", 2)):
            with self.subTest(push):
                self.assertEqual(self.depth(f"_f:\n{push}\n{pop}\nreturn"), size)

    def test_shadow_registers_are_not_on_the_stack(self):
        self.assertEqual(self.depth("_f:\npush.s\npop.s\nreturn"), 0)

    def test_reading_and_comparing_at_the_stack_pointer_does_not_move_it(self):
        self.assertEqual(self.depth("_f:\nlnk #0x4\nsub.w w0, #0x2, [w15]\nmov.w [w15-4], w1\nsub.w w15, #0x4, w3\nulnk\nreturn"), 6)

    def test_the_deeper_of_two_ways_counts(self):
        self.assertEqual(self.depth("_f:\nbra Z, {.L2}\npush w8\npop w8\nreturn\n.L2:\npush.d w8\npush.d w10\npop.d w10\npop.d w8\nreturn"), 8)

    def test_a_repeated_push_counts_as_often_as_it_is_repeated(self):
        self.assertEqual(self.depth("_f:\nlnk #0x0\nrepeat #0x3\nclr.w [w15++]\nulnk\nreturn"), 2 + 4 * 2)
        self.wrong("_f:\nlnk #0x0\nrepeat w3\nclr.w [w15++]\nulnk\nreturn", "unknown number")

    def test_a_push_in_a_loop_is_an_error(self):
        self.wrong("_f:\nlnk #0x0\n.L1:\npush w8\nbra NZ, {.L1}\nulnk\nreturn", "grows in a loop")

    def test_ways_that_disagree_are_an_error(self):
        self.wrong("_f:\nlnk #0x0\nbtsc w0, #0x1\npush w8\nmov.w w1, w2\nulnk\nreturn", "disagree")

    def test_a_skip_over_a_branch_goes_both_ways(self):
        self.assertEqual(self.depth("_f:\nbtss w0, #0x1\nbra {.L3}\nreturn\n.L3:\npush w8\npop w8\nreturn"), 2)

    def test_a_return_with_something_left_is_an_error(self):
        self.wrong("_f:\npush w8\nreturn", "returns with 2 bytes")

    def test_a_computed_stack_pointer_is_an_error(self):
        for line in ("mov.w w0, w15", "add.w w0, w15, w15", "sub.w w15, w1, w15", "mov.w [w0], w15"):
            with self.subTest(line):
                self.assertIn("computed", program(f"_f:\n{line}\nreset")[1][0])

    def test_the_start_up_code_begins_the_stack(self):
        self.assertEqual(self.depth("_f:\nmov.w #0x934, w15\npush w8\nreset"), 2)

    def test_a_frame_closed_twice_is_an_error(self):
        self.wrong("_f:\nlnk #0x4\nulnk\nulnk\nreturn", "not open")

    def test_a_function_that_runs_out_of_code_is_an_error(self):
        self.wrong("_f:\nmov.w w0, w1", "no code")

    def test_a_wide_instruction_ends_after_two_words(self):
        self.assertEqual(self.depth("_f:\ngoto 0x206\nreset\npush.d w8\npop.d w8\nreturn"), 4)


class Calls(unittest.TestCase):
    def test_a_call_adds_the_return_address_and_what_the_callee_needs(self):
        for call in ("rcall {_g}", "call {_g}"):
            with self.subTest(call):
                chain, errors = program(f"_f:\nlnk #0x2\n{call}\nulnk\nreturn\n_g:\npush.d w8\npop.d w8\nreturn")
                self.assertEqual((chain.depth, errors), (4 + 4 + 4, []))
                self.assertEqual(chain.steps, (("f", 8), ("g", 4)))

    def test_the_callee_counts_at_the_depth_of_the_call(self):
        chain, _ = program("_f:\nrcall {_g}\nlnk #0x10\nulnk\nreturn\n_g:\nlnk #0x8\nulnk\nreturn")
        self.assertEqual(chain.depth, 0x12) # the frame and the call are not there at the same time

    def test_the_deepest_of_several_callees_is_named(self):
        chain, _ = program("_f:\nrcall {_a}\nrcall {_b}\nreturn\n_a:\npush w8\npop w8\nreturn\n_b:\nlnk #0x6\nrcall {_a}\nulnk\nreturn")
        self.assertEqual([name for name, _ in chain.steps], ["f", "b", "a"])
        self.assertEqual(chain.depth, 4 + 8 + 4 + 2)

    def test_a_jump_to_a_function_needs_no_return_address(self):
        for jump in ("bra {_g}", "goto 0x204 <_g>"):
            with self.subTest(jump):
                chain, errors = program(f"_f:\n{jump}\n_g:\nlnk #0x8\nulnk\nreturn")
                self.assertEqual((chain.depth, errors), (10, []))

    def test_code_that_runs_on_into_the_next_function_needs_what_that_needs(self):
        self.assertEqual(program("_f:\nmov.w w0, w1\n_g:\nlnk #0x8\nulnk\nreturn")[0].depth, 10)

    def test_recursion_is_an_error_with_its_way(self):
        self.assertEqual(program("_f:\nrcall {_f}\nreturn")[1], ["recursion: f -> f"])
        self.assertEqual(program("_f:\nrcall {_g}\nreturn\n_g:\nrcall {_h}\nreturn\n_h:\nrcall {_g}\nreturn")[1], ["recursion: g -> h -> g"])

    def test_a_call_or_jump_through_a_pointer_is_an_error_with_its_place(self):
        for line in ("call w2", "rcall w2", "goto w2", "bra w2"):
            with self.subTest(line):
                errors = program(f"_f:\nlnk #0x0\n{line}\nulnk\nreturn")[1]
                self.assertEqual(len(errors), 1)
                self.assertRegex(errors[0], r"f: (call|jump) through a pointer at 0x202")

    def test_a_call_through_a_pointer_that_is_known_to_be_harmless_is_none(self):
        self.assertEqual(program("__f:\ncall w2\nreturn", ("_f",))[1], [])

    def test_a_switch_through_a_table_of_branches_is_followed(self):
        chain, errors = program("_f:\nbra w0\nbra {.A}\nbra {.B}\n.A:\npush w8\npop w8\nreturn\n.B:\nlnk #0x4\nulnk\nreturn")
        self.assertEqual((chain.depth, errors), (6, []))

    def test_a_call_to_where_no_code_is_is_an_error(self):
        self.assertIn("0x9000", program("_f:\nrcall 0x9000\nreturn")[1][0])

    def test_a_clone_has_the_name_of_the_function(self):
        self.assertEqual(stack.plain("_drive_idle.clone.10.clone.17"), "drive_idle")
        self.assertEqual(stack.plain("__ADC1Interrupt"), "_ADC1Interrupt")


SYSTEM = """
__reset:
mov.w #0x934, w15
rcall {_main}
reset
_main:
lnk #0x8
.L1:
bra {.L1}
__ADC1Interrupt:
push.d w0
push.d w2
rcall {_help}
pop.d w2
pop.d w0
retfie
__FLTA1Interrupt:
push w0
pop w0
retfie
__T1Interrupt:
push.d w0
pop.d w0
retfie
__MathError:
lnk #0x2
ulnk
retfie
__AddressError:
retfie
_help:
push w8
pop w8
return
"""
HANDLERS = ["_ADC1Interrupt", "_FLTA1Interrupt", "_T1Interrupt", "_MathError", "_AddressError"]


class Interrupts(unittest.TestCase):
    def analyse(self, levels: dict[str, int], handlers=None) -> stack.Result:
        return stack.analyse(listing(SYSTEM), 0x200, HANDLERS if handlers is None else handlers, levels)

    def test_the_levels_of_the_sources_are_read_by_register_field(self):
        source = "IPC3bits.AD1IP = 5;\n    IPC15bits.FLTA1IP  =  6; IPC0bits.T1IP = 2; IFS0bits.AD1IF = 0;"
        self.assertEqual(stack.priorities(source), {"_ADC1Interrupt": 5, "_FLTA1Interrupt": 6, "_T1Interrupt": 2})

    def test_interrupts_of_one_level_do_not_stand_on_each_other(self):
        result = self.analyse({"_ADC1Interrupt": 5, "_FLTA1Interrupt": 5}, HANDLERS[1::-1])
        self.assertEqual(result.depth, (4 + 10) + (4 + 8 + 4 + 2))
        self.assertEqual([level.others for level in result.levels], [["_FLTA1Interrupt 6"]])

    def test_interrupts_of_different_levels_do(self):
        result = self.analyse({"_ADC1Interrupt": 5, "_FLTA1Interrupt": 6}, HANDLERS[:2])
        self.assertEqual(result.depth, (4 + 10) + (4 + 8 + 4 + 2) + (4 + 2))

    def test_an_interrupt_whose_level_nobody_sets_has_the_level_of_reset(self):
        levels = [level.priority for level in self.analyse({"_ADC1Interrupt": 5}, ["_ADC1Interrupt", "_T1Interrupt"]).levels]
        self.assertEqual(levels, [4, 5])

    def test_traps_stand_on_top_of_every_interrupt_and_of_each_other(self):
        result = self.analyse({"_ADC1Interrupt": 5}, ["_ADC1Interrupt", "_MathError", "_AddressError"])
        self.assertEqual([level.priority for level in result.levels], [5, 11, 13])
        self.assertEqual(result.depth, 14 + 18 + (4 + 4) + 4)

    def test_a_handler_that_is_missing_is_an_error(self):
        self.assertEqual(self.analyse({}, ["_U1TXInterrupt"]).errors, ["_U1TXInterrupt: no such function"])

    def test_the_table_ends_at_the_depth(self):
        result = self.analyse({"_ADC1Interrupt": 5})
        lines = [line for line in stack.table(result) if not line.strip().startswith("(")]
        self.assertEqual(int(lines[-1].split()[-1]), result.depth)
        self.assertIn("background", lines[0])


class Listing(unittest.TestCase):
    TEXT = """
foc33.elf:     file format elf32-pic30


 12e:\t7a 02 00    \tnop       

00000214 <__start>:
 214:\t30 1d 02    \tcall      0x21c <.LFE50>
 216:\t00 00 00 
 218:\t00 00 fe    \treset     

0000021c <_main>:
 21c:\t36 00 f8    \tpush      0x36
     21e:\t80 9f be    \tmov.d     w0, [w15++]

00000220 <.LBB4441>:
 220:\tb2 02 36    \tbra       LEU, 0x226 <.L183> <.LBB7>
 222:\t1f 00 be    \tmov.d     [--w15], w0
 224:\t01 00 37    \tbra       0x22a <.L9>

00000226 <.L183>:
 226:\t4f 00 be    \tmov.d     [--w15], w0
 228:\t00 00 00    \tnop       

0000022a <.L9>:
 22a:\t36 00 f9    \tpop       0x36
 22c:\t00 00 06    \treturn    

 f80000:\t0f 00 00    \tnop       
"""

    def test_the_tool_s_own_format_is_read(self):
        functions = stack.parse(self.TEXT)
        self.assertEqual([function.name for function in functions], ["__start", "_main"])
        self.assertEqual([i.size for i in functions[0].instructions], [4, 2])
        self.assertEqual(functions[1].instructions[-1].mnemonic, "return")

    def test_its_depth_is_the_hand_count(self):
        result = stack.Program(stack.parse(self.TEXT))
        self.assertEqual((result.deepest(0x214).depth, result.errors), (4 + 2 + 4, []))


if __name__ == "__main__":
    unittest.main()
