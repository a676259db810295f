"""The deepest stack from a disassembly: each use counts what a hand count gives, what cannot be followed is an error by name."""

import pytest
from support import refusal

from tools.image import size, stack

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


# ---- one function --------------------------------------------------------------------------------------------------------
SAVES = "".join(f"mov.d w{i}, [w15++]\n" for i in range(0, 14, 2))
LOADS = "".join(f"mov.d [--w15], w{i}\n" for i in range(12, -2, -2))


@pytest.mark.parametrize("code, depth", [
    pytest.param("mov.w #0x5, w0\nreturn", 0, id="a leaf"),
    pytest.param("lnk #0x28\nulnk\nreturn", 42, id="a frame is its size and the saved frame pointer"),
    pytest.param(f"push 0x36\n{SAVES}lnk #0x28\nulnk\n{LOADS}pop 0x36\nretfie", 2 + 7 * 4 + 2 + 0x28,
                 id="an interrupt that saves everything"),
    ("push w8\npop w8\nreturn", 2), ("push.d w8\npop.d w8\nreturn", 4), ("push 0x36\npop 0x36\nreturn", 2),
    ("mov.w w8, [w15++]\nmov.w [--w15], w8\nreturn", 2), ("mov.d w8, [w15++]\nmov.d [--w15], w8\nreturn", 4),
    ("clr.w [w15++]\nsub.w w15, #0x2, w15\nreturn", 2), ("add.w w15, #0x6, w15\nsub.w w15, #0x6, w15\nreturn", 6),
    ("add.w #0x20, w15\nsub.w #0x20, w15\nreturn", 32), ("inc2.w w15, w15\ndec2.w w15, w15\nreturn", 2),
    pytest.param("push.s\npop.s\nreturn", 0, id="shadow registers"),
    pytest.param("lnk #0x4\nsub.w w0, #0x2, [w15]\nmov.w [w15-4], w1\nsub.w w15, #0x4, w3\nulnk\nreturn", 6, id="reading and comparing"),
    pytest.param("bra Z, {.L2}\npush w8\npop w8\nreturn\n.L2:\npush.d w8\npush.d w10\npop.d w10\npop.d w8\nreturn", 8,
                 id="the deeper of two ways"),
    pytest.param("lnk #0x0\nrepeat #0x3\nclr.w [w15++]\nulnk\nreturn", 2 + 4 * 2, id="a repeated push"),
    pytest.param("btss w0, #0x1\nbra {.L3}\nreturn\n.L3:\npush w8\npop w8\nreturn", 2, id="a skip over a branch goes both ways"),
    pytest.param("mov.w #0x934, w15\npush w8\nreset", 2, id="the start-up code begins the stack"),
    pytest.param("goto 0x206\nreset\npush.d w8\npop.d w8\nreturn", 4, id="a wide instruction ends after two words")])
def test_depth_of_one_function(code, depth):
    chain, errors = program(f"_f:\n{code}")
    assert (chain.depth, errors) == (depth, [])


@pytest.mark.parametrize("code, words", [
    ("lnk #0x0\nrepeat w3\nclr.w [w15++]\nulnk\nreturn", "unknown number"),
    ("lnk #0x0\n.L1:\npush w8\nbra NZ, {.L1}\nulnk\nreturn", "grows in a loop"),
    ("lnk #0x0\nbtsc w0, #0x1\npush w8\nmov.w w1, w2\nulnk\nreturn", "disagree"), ("push w8\nreturn", "returns with 2 bytes"),
    ("mov.w w0, w15\nreset", "computed"), ("add.w w0, w15, w15\nreset", "computed"), ("sub.w w15, w1, w15\nreset", "computed"),
    ("mov.w [w0], w15\nreset", "computed"), ("lnk #0x4\nulnk\nulnk\nreturn", "not open"), ("mov.w w0, w1", "no code")])
def test_what_cannot_be_followed_is_one_error_with_the_functions_name(code, words):
    errors = program(f"_f:\n{code}")[1]
    assert len(errors) == 1 and errors[0].startswith("f: ") and words in errors[0]


# ---- calls ---------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("source, steps, depth", [
    ("_f:\nlnk #0x2\nrcall {_g}\nulnk\nreturn\n_g:\npush.d w8\npop.d w8\nreturn", ["f", "g"], 4 + 4 + 4),
    ("_f:\nlnk #0x2\ncall {_g}\nulnk\nreturn\n_g:\npush.d w8\npop.d w8\nreturn", ["f", "g"], 4 + 4 + 4),
    # the frame and the call are not there at the same time
    ("_f:\nrcall {_g}\nlnk #0x10\nulnk\nreturn\n_g:\nlnk #0x8\nulnk\nreturn", ["f"], 0x12),
    ("_f:\nrcall {_a}\nrcall {_b}\nreturn\n_a:\npush w8\npop w8\nreturn\n_b:\nlnk #0x6\nrcall {_a}\nulnk\nreturn", ["f", "b", "a"],
     4 + 8 + 4 + 2),
    ("_f:\nbra {_g}\n_g:\nlnk #0x8\nulnk\nreturn", ["f", "g"], 10), ("_f:\ngoto 0x204 <_g>\n_g:\nlnk #0x8\nulnk\nreturn", ["f", "g"], 10),
    ("_f:\nmov.w w0, w1\n_g:\nlnk #0x8\nulnk\nreturn", ["f", "g"], 10), # runs on into the next function
    ("_f:\nbra w0\nbra {.A}\nbra {.B}\n.A:\npush w8\npop w8\nreturn\n.B:\nlnk #0x4\nulnk\nreturn", ["f"], 6)]) # a switch
def test_the_deepest_chain_of_calls(source, steps, depth):
    chain, errors = program(source)
    assert ([name for name, _ in chain.steps], chain.depth, errors) == (steps, depth, [])
    assert sum(size for _, size in chain.steps) == depth


@pytest.mark.parametrize("source, error", [
    ("_f:\nrcall {_f}\nreturn", "recursion: f -> f"),
    ("_f:\nrcall {_g}\nreturn\n_g:\nrcall {_h}\nreturn\n_h:\nrcall {_g}\nreturn", "recursion: g -> h -> g"),
    *((f"_f:\nlnk #0x0\n{line}\nulnk\nreturn", "through a pointer at 0x202") for line in ("call w2", "rcall w2", "goto w2", "bra w2")),
    ("_f:\nrcall 0x9000\nreturn", "0x9000")])
def test_calls_that_cannot_be_followed_are_errors(source, error):
    errors = program(source)[1]
    assert len(errors) == 1 and error in errors[0]


def test_a_call_through_a_pointer_that_is_known_to_be_harmless_is_none_and_a_clone_has_the_name_of_the_function():
    assert program("__f:\ncall w2\nreturn", ("_f",))[1] == []
    assert [stack.plain(name) for name in ("_drive_idle.clone.10.clone.17", "__ADC1Interrupt")] == ["drive_idle", "_ADC1Interrupt"]


# ---- interrupts ----------------------------------------------------------------------------------------------------------
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
ADC1, FLTA1, T1, MATH, ADDRESS = HANDLERS
MAIN, ADC1_BYTES = 14, 4 + 8 + 4 + 2


def analyse(levels: dict[str, int], handlers: list[str]) -> stack.Result:
    return stack.analyse(listing(SYSTEM), 0x200, {name: [name] for name in handlers}, levels)


def test_the_levels_of_the_sources_are_read_by_register_field_and_slow_work_and_fault_input_have_the_same():
    source = "#define BOARD_PRIORITY_TIMER 2u\nIPC3bits.AD1IP = 5;\n    IPC15bits.FLTA1IP  =  6; IPC0bits.T1IP = BOARD_PRIORITY_TIMER; IFS0bits.AD1IF = 0;"
    assert stack.priorities(source) == {ADC1: 5, FLTA1: 6, T1: 2}
    levels = stack.priorities("".join(path.read_text(encoding="utf-8") for path in size.LEVELS))
    assert (levels[ADC1], levels["_T2Interrupt"], levels[FLTA1]) == (5, 3, 3)
    refusal(lambda: stack.priorities("IPC3bits.AD1IP = BOARD_LEVEL;"), "the priority of an interrupt is no number, AD1IP = BOARD_LEVEL", "BOARD_PRIORITY_NAME")


@pytest.mark.parametrize("levels, handlers, priorities, depth", [
    ({ADC1: 5, FLTA1: 5}, [FLTA1, ADC1], [5], MAIN + ADC1_BYTES),                       # one level: not on each other
    ({ADC1: 5, FLTA1: 6}, [ADC1, FLTA1], [5, 6], MAIN + ADC1_BYTES + (4 + 2)),          # different levels are
    ({ADC1: 5}, [ADC1, T1], [4, 5], MAIN + ADC1_BYTES + (4 + 4)),                       # nobody sets one's level: that of reset
    ({ADC1: 5}, [ADC1, MATH, ADDRESS], [5, 11, 13], MAIN + ADC1_BYTES + (4 + 4) + 4)])  # traps stand on everything and on each other
def test_interrupts_stand_on_the_background_and_on_lower_levels(levels, handlers, priorities, depth):
    result = analyse(levels, handlers)
    assert ([level.priority for level in result.levels], result.depth) == (priorities, depth)


def test_a_handler_of_several_traps_stands_on_itself_once_for_each_level_and_on_interrupts_that_have_none():
    vectors = {ADC1: [ADC1], MATH: ["_MathError", "_StackError", "_T3Interrupt", "_T4Interrupt"]}
    result = stack.analyse(listing(SYSTEM), 0x200, vectors, {ADC1: 5})
    assert [level.priority for level in result.levels] == [stack.RESET_LEVEL, 5, 11, 12]
    assert result.depth == MAIN + ADC1_BYTES + 3 * (4 + 4)


def test_the_table_ends_at_the_depth_and_names_what_was_not_deepest_and_a_missing_handler_is_an_error():
    result = analyse({ADC1: 5, FLTA1: 5}, HANDLERS)
    lines = stack.table(result)
    assert int([line for line in lines if not line.strip().startswith("(")][-1].split()[-1]) == result.depth
    assert "background" in lines[0] and any("(instead of _FLTA1Interrupt 6)" in line for line in lines)
    assert analyse({}, ["_U1TXInterrupt"]).errors == ["_U1TXInterrupt: no such function"]


# ---- the tool's own format -----------------------------------------------------------------------------------------------
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


def test_the_tool_s_own_format_is_read():
    functions = stack.parse(TEXT)
    assert [function.name for function in functions] == ["__start", "_main"]
    assert [instruction.size for instruction in functions[0].instructions] == [4, 2]
    assert functions[1].instructions[-1].mnemonic == "return"
    result = stack.Program(functions)
    assert (result.deepest(0x214).depth, result.errors) == (4 + 2 + 4, [])
