"""TOML files are read strictly: every mistake is one line that says what, where and what to do."""

import unittest
from pathlib import Path

from support import document

from tools.common.errors import UserError
from tools.common.toml_file import Document, flatten


class TomlFile(unittest.TestCase):
    def refused(self, call, *parts: str) -> None:
        """`call` raises one line that holds every part."""
        with self.assertRaises(UserError) as caught:
            call()
        line = str(caught.exception)
        self.assertNotIn("\n", line)
        for part in parts:
            self.assertIn(part, line)

    def test_a_missing_file_is_named(self):
        self.refused(lambda: Document(Path("no/such.toml")), "no such file", "no/such.toml")

    def test_a_syntax_error_names_its_line(self):
        self.refused(lambda: document("a = 1\nb = = 2\n"), "TOML syntax", "line 2")

    def test_a_syntax_error_about_a_table_shows_it_as_the_file_does(self):
        self.refused(lambda: document("[a.b]\nx = 1\n[a.b]\n"), "cannot declare [a.b] twice", "line 3")
        self.refused(lambda: document("[a]\nx = 1\n[a]\n"), "cannot declare [a] twice", "line 3")

    def test_the_mark_that_some_editors_begin_a_file_with_is_read_over(self):
        self.assertEqual(document("\ufeffx = 1\n").root.number("x"), 1.0)

    def test_an_unclosed_string_at_the_end_names_the_last_line(self):
        self.refused(lambda: document("a = 1\nb = \"x"), "TOML syntax", "line 2")

    def test_numbers_and_nesting_beyond_all_bounds_are_refused(self):
        self.refused(lambda: document("x = 1" + "0" * 400).root.number("x"), "'x' is out of range", "line 1", "choose a number below 1e300")
        self.refused(lambda: document("x = 1" + "0" * 5000), "a number too long")
        self.refused(lambda: document("x = " + "[" * 100000), "tables too deep")

    def test_a_key_with_thousands_of_dots_is_refused(self):
        text = "[plant]\n" + ".".join("a" * 3000) + " = 1\n"
        self.refused(lambda: flatten(document(text).root.section("plant")), "tables too deep", "line 1")

    def test_control_characters_of_a_file_stay_off_the_terminal(self):
        root = document('"a\\u001b[31m" = 1\n').root
        self.refused(root.close, "unknown key 'a?[31m'")

    def test_a_list_of_tables_where_a_table_belongs_is_refused_with_its_line(self):
        self.refused(lambda: document("a = 1\n[[start]]\nb = 2\n").root.section("start"), "'start' is not a table", "line 2")

    def test_a_file_that_is_no_text_is_refused(self):
        with self.subTest("folder"):
            self.refused(lambda: Document(Path(".")), "cannot read")

    def test_an_unknown_key_gets_its_line_and_the_nearest_known_key(self):
        root = document("title = \"x\"\nduraton_s = 3\n").root
        root.text("title")
        root.number("duration_s", 0.0)
        self.refused(root.close, "unknown key 'duraton_s'", "line 2", "did you mean 'duration_s'?")

    def test_an_unknown_key_without_a_near_one_lists_the_known_ones(self):
        root = document("zzz = 3\n").root
        root.text("title", "")
        self.refused(root.close, "unknown key 'zzz'", "use one of title")

    def test_a_key_in_the_second_of_two_tables_gets_the_right_line(self):
        text = "[[event]]\nat_s = 1\n\n[[event]]\nat_s = 2\nwrong = 1\n"
        section = document(text).root.sections("event")[1]
        section.number("at_s")
        self.refused(section.close, "unknown key 'wrong'", "line 6")

    def test_a_missing_key_gets_the_line_of_its_table(self):
        section = document("x = 1\n[[event]]\ny = 1\n").root.sections("event")[0]
        self.refused(lambda: section.number("at_s"), "'at_s' is missing", "line 2")

    def test_a_text_in_place_of_a_number_is_refused(self):
        self.refused(lambda: document("a = \"1\"").root.number("a"), "'a' is not a number", "line 1")

    def test_true_is_no_number(self):
        self.refused(lambda: document("a = true").root.number("a"), "'a' is not a number")

    def test_nan_is_no_number(self):
        self.refused(lambda: document("a = nan").root.number("a"), "'a' is not a number")

    def test_infinity_is_out_of_range_whatever_the_range(self):
        for text in ("a = inf", "a = -inf", "a = 1e300"):
            with self.subTest(text):
                self.refused(lambda: document(text).root.number("a"), "'a' is out of range")
                self.refused(lambda: document(text).root.number("a", minimum=0.0), "'a' is out of range", "choose 0 or more")
                self.refused(lambda: document(text).root.number("a", maximum=2.0), "choose 2 or less")

    def test_a_number_outside_its_range_is_refused_with_the_range(self):
        self.refused(lambda: document("a = 3").root.number("a", minimum=0, maximum=2), "'a' = 3 is impossible", "0 .. 2")

    def test_both_ends_of_a_range_are_allowed(self):
        root = document("a = 0\nb = 2").root
        self.assertEqual((root.number("a", minimum=0, maximum=2), root.number("b", minimum=0, maximum=2)), (0.0, 2.0))

    def test_a_fraction_is_no_integer(self):
        self.refused(lambda: document("a = 1.5").root.integer("a"), "not a whole number")

    def test_a_default_is_returned_for_a_missing_key(self):
        root = document("").root
        self.assertEqual((root.number("a", None), root.text("b", "x"), root.flag("c", False)), (None, "x", False))

    def test_an_empty_text_is_refused(self):
        self.refused(lambda: document("a = \" \"").root.text("a"), "'a' is not a text")

    def test_a_word_that_is_no_choice_gets_the_nearest_one(self):
        self.refused(lambda: document("kind = \"mesure\"").root.choice("kind", ("measure", "stop")), "did you mean 'measure'?")

    def test_one_of_refuses_none_two_and_unknown(self):
        keys = ("press", "set")
        self.refused(lambda: document("").root.one_of(keys), "nothing to do", "press, set")
        self.refused(lambda: document("press = 1\nset = 2").root.one_of(keys), "'press' and 'set' together")
        self.refused(lambda: document("pres = 1").root.one_of(keys), "unknown key 'pres'", "did you mean 'press'?")

    def test_quoted_and_nested_names_are_the_same_values(self):
        quoted = document("[plant]\n\"motor.rs_ohm\" = 2\n").root.values("plant")
        nested = document("[plant.motor]\nrs_ohm = 2\n").root.values("plant")
        dotted = document("[plant]\nmotor.rs_ohm = 2\n").root.values("plant")
        self.assertEqual([quoted, nested, dotted], [{"motor.rs_ohm": 2.0}] * 3)

    def test_a_factor_is_allowed_only_where_it_makes_sense(self):
        text = "[plant]\n\"motor.psi_vs\" = { factor = 0.5 }\n"
        self.assertEqual(document(text).root.values("plant", factors=True), {"motor.psi_vs": ("factor", 0.5)})
        self.assertEqual(document(text).root.values("plant"), {"motor.psi_vs.factor": 0.5})

    def test_a_table_where_a_list_of_tables_belongs_is_refused(self):
        self.refused(lambda: document("[event]\nat_s = 1").root.sections("event"), "write [[event]]")
        self.refused(lambda: document("[[start]]\nx = 1").root.section("start"), "write [start]")
