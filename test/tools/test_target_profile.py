"""From counts by address to functions and stacks: every count as if added by hand; and the flame-style picture of it."""

import unittest
import xml.etree.ElementTree as ElementTree
from collections import Counter

from tools.image import flame
from tools.image.attribution import Frame, Image, Word
from tools.image.profile import Counts, folded, profile, reachable
from tools.image.program import Elf

CALL, RCALL, NOP_WORD = 0x020000, 0x070000, 0x780000


def rcall(place: int, target: int) -> int:
    return RCALL | ((target - place - 2) // 2) & 0xFFFF


class Program:
    """Functions of a few words; `inside` names what is inlined into one from an address on."""

    def __init__(self) -> None:
        self.words: dict[int, int] = {}
        self.listed: list[Word] = []
        self.functions: list[tuple[int, str]] = []

    def function(self, name: str, start: int, words: list[int], inside: dict[int, tuple[str, ...]] | None = None) -> "Program":
        self.functions.append((start, name))
        for number, word in enumerate(words):
            address = start + 2 * number
            names = (name, *(inside or {}).get(address, ()))
            self.words[address] = word
            self.listed.append(Word(address, tuple(Frame(item, "") for item in names), tuple(start for _ in names)))
        return self

    def elf(self) -> Elf:
        return Elf(self.words, [(0x200, 0x1000)], {}, sorted(self.functions))

    def image(self) -> Image:
        return Image(self.listed, [], [], 0, False, [], 0, 0x200)


def interrupt() -> Program:
    """An interrupt that has pi() inlined, with a helper in it, and calls slow(), which calls deep(); the background calls deep(), too."""
    program = Program()
    program.function("_ADC1Interrupt", 0x200, [NOP_WORD, NOP_WORD, NOP_WORD, rcall(0x206, 0x300), NOP_WORD],
                     {0x202: ("pi",), 0x204: ("pi", "qm_clamp")})
    program.function("slow", 0x300, [NOP_WORD, rcall(0x302, 0x400)], {0x300: ("ramp",)})
    program.function("deep", 0x400, [NOP_WORD])
    program.function("main", 0x500, [rcall(0x500, 0x400), NOP_WORD])
    return program


COUNTS = Counts({0x200: 10, 0x202: 10, 0x204: 10, 0x206: 2, 0x208: 10, 0x300: 2, 0x302: 1, 0x400: 1, 0x500: 50, 0x502: 50},
                {0x200: 50, 0x202: 10, 0x204: 20, 0x206: 4, 0x208: 30, 0x300: 2, 0x302: 2, 0x400: 7, 0x500: 100, 0x502: 50})


class ByFunction(unittest.TestCase):
    def setUp(self):
        program = interrupt()
        self.elf, self.image = program.elf(), program.image()
        self.found = profile(self.elf, self.image, COUNTS)

    def test_what_the_interrupt_reaches_is_followed_through_calls(self):
        self.assertEqual(reachable(self.elf, self.image), {0x200, 0x300, 0x400})

    def test_background_is_not_counted(self):
        self.assertNotIn("main", self.found.symbols)
        self.assertEqual(self.found.total, 125)

    def test_linked_functions_have_what_is_inlined_into_them(self):
        self.assertEqual(self.found.symbols, Counter({"_ADC1Interrupt": 114, "slow": 4, "deep": 7}))

    def test_inlined_functions_are_counted_where_they_are_written(self):
        self.assertEqual(self.found.inlined, Counter({"_ADC1Interrupt": 84, "qm_clamp": 20, "pi": 10, "ramp": 2, "slow": 2, "deep": 7}))

    def test_a_helper_is_counted_with_what_it_is_inlined_into(self):
        found = profile(self.elf, self.image, COUNTS, ("qm_*",))
        self.assertEqual(found.inlined["pi"], 30)
        self.assertNotIn("qm_clamp", found.inlined)

    def test_stacks_begin_at_the_interrupt_and_follow_its_calls(self):
        self.assertEqual(self.found.stacks[("_ADC1Interrupt", "slow", "deep")], 7)
        self.assertEqual(self.found.stacks[("_ADC1Interrupt", "slow", "ramp")], 2)
        self.assertEqual(self.found.stacks[("_ADC1Interrupt", "pi", "qm_clamp")], 20)
        self.assertEqual(sum(self.found.stacks.values()), self.found.total)

    def test_words_that_never_ran_are_told_by_function(self):
        found = profile(self.elf, self.image, Counts({0x200: 1}, {0x200: 1}))
        self.assertEqual(found.executed, {"_ADC1Interrupt": (1, 5), "slow": (0, 2), "deep": (0, 1)})

    def test_a_function_with_two_callers_is_shared_by_their_calls(self):
        program = Program()
        program.function("_ADC1Interrupt", 0x200, [rcall(0x200, 0x400), rcall(0x202, 0x300)])
        program.function("slow", 0x300, [rcall(0x300, 0x400)])
        program.function("deep", 0x400, [NOP_WORD])
        found = profile(program.elf(), program.image(), Counts({0x200: 3, 0x202: 1, 0x300: 1, 0x400: 4}, {0x200: 3, 0x202: 1, 0x300: 1, 0x400: 8}))
        self.assertAlmostEqual(found.stacks[("_ADC1Interrupt", "deep")], 6.0)
        self.assertAlmostEqual(found.stacks[("_ADC1Interrupt", "slow", "deep")], 2.0)

    def test_second_word_of_a_call_is_no_instruction(self):
        program = Program().function("_ADC1Interrupt", 0x200, [CALL | 0x300, 0, NOP_WORD]).function("far", 0x300, [NOP_WORD])
        found = profile(program.elf(), program.image(), Counts({0x200: 1, 0x204: 1, 0x300: 1}, {0x200: 2, 0x204: 1, 0x300: 1}))
        self.assertEqual(found.executed, {"_ADC1Interrupt": (2, 2), "far": (1, 1)})
        self.assertEqual(found.stacks[("_ADC1Interrupt", "far")], 1)

    def test_recursion_does_not_hang(self):
        program = Program().function("_ADC1Interrupt", 0x200, [rcall(0x200, 0x300)]).function("ping", 0x300, [rcall(0x300, 0x400)])
        program.function("pong", 0x400, [rcall(0x400, 0x300)])
        found = profile(program.elf(), program.image(), Counts({0x200: 1, 0x300: 5, 0x400: 4}, {0x200: 1, 0x300: 5, 0x400: 4}))
        self.assertAlmostEqual(sum(found.stacks.values()), 10)

    def test_folded_lines_are_what_flame_tools_read(self):
        self.assertEqual(folded(Counter({("a", "b"): 4, ("a",): 1}), 2), ["a 0.500", "a;b 2.000"])


class Picture(unittest.TestCase):
    NAMESPACE = "{http://www.w3.org/2000/svg}"

    def boxes(self, stacks: dict, per: float = 1.0) -> dict[str, tuple[float, float, float]]:
        """Title: left, top, width of each box."""
        root = ElementTree.fromstring(flame.svg(Counter(stacks), "a <title> & more", per))
        return {group.find(f"{self.NAMESPACE}title").text.split(":")[0]: tuple(float(group.find(f"{self.NAMESPACE}rect").get(name))
                for name in ("x", "y", "width")) for group in root.iter(f"{self.NAMESPACE}g")}

    def test_width_is_share_and_a_callee_lies_inside_below_its_caller(self):
        boxes = self.boxes({("isr",): 50, ("isr", "big"): 40, ("isr", "small"): 10})
        self.assertAlmostEqual(boxes["isr"][2], flame.WIDTH - 2 * flame.MARGIN, 1)
        self.assertAlmostEqual(boxes["big"][2] / boxes["isr"][2], 0.4, 3)
        self.assertEqual(boxes["big"][1], boxes["isr"][1] + flame.ROW)
        self.assertLess(boxes["big"][0], boxes["small"][0])
        self.assertAlmostEqual(boxes["small"][0], boxes["big"][0] + boxes["big"][2], 1)

    def test_numbers_are_per_interrupt(self):
        self.assertIn("isr: 12.5 cycles, 100.0 %", flame.svg(Counter({("isr",): 50}), "t", 4))

    def test_names_cannot_break_the_file(self):
        self.assertIn("operator<", self.boxes({("operator<",): 1}))

    def test_nothing_counted_is_an_empty_picture(self):
        self.assertEqual(self.boxes({}), {})

    def test_a_name_always_has_the_same_colour(self):
        self.assertEqual(flame._color("pi_tick"), flame._color("pi_tick")) # pylint: disable=protected-access
        self.assertNotEqual(flame._color("pi_tick"), flame._color("svm")) # pylint: disable=protected-access


if __name__ == "__main__":
    unittest.main()
