"""From counts by address to functions: every count as if added by hand."""

from collections import Counter

from tools.image.attribution import Frame, Image, Word
from tools.image.profile import Counts, profile, reachable
from tools.image.program import CODE, Elf, Section, Symbol

CALL, NOP = 0x020000, 0x780000
SECTION = Section(".text", CODE, 0x200, 0x1000)


def rcall(place: int, target: int) -> int:
    return 0x070000 | ((target - place - 2) // 2) & 0xFFFF


def made(*functions: tuple) -> tuple[Elf, Image]:
    """An image of functions: name, start, words, and what is inlined into it at an address."""
    words, listed, symbols = {}, [], []
    for name, start, code, *inside in functions:
        symbols.append(Symbol(f"_{name}", start, 0, True, SECTION))
        for address, word in zip(range(start, start + 2 * len(code), 2), code):
            names = (name, *(inside[0] if inside else {}).get(address, ()))
            words[address] = word
            listed.append(Word(address, tuple(Frame(item, "") for item in names), tuple(start for _ in names)))
    return Elf(words, [SECTION], symbols), Image(listed, [], [], 0, False, [], 0, 0x200)


# An interrupt that has pi() inlined, with a helper in it, and calls slow(), which calls deep(); the background calls deep(), too.
INTERRUPT = made(("_ADC1Interrupt", 0x200, [NOP, NOP, NOP, rcall(0x206, 0x300), NOP], {0x202: ("pi",), 0x204: ("pi", "qm_clamp")}),
                 ("slow", 0x300, [NOP, rcall(0x302, 0x400)], {0x300: ("ramp",)}), ("deep", 0x400, [NOP]),
                 ("main", 0x500, [rcall(0x500, 0x400), NOP]))
COUNTS = Counts({0x200: 10, 0x202: 10, 0x204: 10, 0x206: 2, 0x208: 10, 0x300: 2, 0x302: 1, 0x400: 1, 0x500: 50, 0x502: 50},
                {0x200: 50, 0x202: 10, 0x204: 20, 0x206: 4, 0x208: 30, 0x300: 2, 0x302: 2, 0x400: 7, 0x500: 100, 0x502: 50})


def test_only_what_the_interrupt_reaches_is_counted_with_what_is_inlined_into_it():
    found = profile(*INTERRUPT, COUNTS)
    assert reachable(*INTERRUPT) == {0x200, 0x300, 0x400}
    assert (found.total, found.symbols) == (125, Counter({"_ADC1Interrupt": 114, "slow": 4, "deep": 7}))
    assert found.inlined == Counter({"_ADC1Interrupt": 84, "qm_clamp": 20, "pi": 10, "ramp": 2, "slow": 2, "deep": 7})


def test_a_helper_is_counted_with_what_it_is_inlined_into():
    found = profile(*INTERRUPT, COUNTS, lambda word: min(len(word.chain) - 1, 1))
    assert found.inlined["pi"] == 30 and "qm_clamp" not in found.inlined


def test_words_that_never_ran_are_told_by_function_and_the_second_word_of_a_call_is_no_instruction():
    assert profile(*INTERRUPT, Counts({0x200: 1}, {0x200: 1})).executed == {"_ADC1Interrupt": (1, 5), "slow": (0, 2), "deep": (0, 1)}
    found = profile(*made(("_ADC1Interrupt", 0x200, [CALL | 0x300, 0, NOP]), ("far", 0x300, [NOP])),
                    Counts({0x200: 1, 0x204: 1, 0x300: 1}, {0x200: 2, 0x204: 1, 0x300: 1}))
    assert found.executed == {"_ADC1Interrupt": (2, 2), "far": (1, 1)}


def test_recursion_does_not_hang():
    image = made(("_ADC1Interrupt", 0x200, [rcall(0x200, 0x300)]), ("ping", 0x300, [rcall(0x300, 0x400)]),
                 ("pong", 0x400, [rcall(0x400, 0x300)]))
    assert profile(*image, Counts({0x200: 1, 0x300: 5, 0x400: 4}, {0x200: 1, 0x300: 5, 0x400: 4})).total == 10
