"""TOML files are read strictly: every mistake is one line that says what, where and what to do."""

from pathlib import Path

import pytest
from support import document, refusal

from tools.common import paths
from tools.common.toml_file import Document, flatten

KEYS = ("press", "set")


def close(root) -> None:
    """Asks for a few keys and refuses the others."""
    root.text("title", "")
    root.number("duration_s", 0.0)
    root.close()


# Text of the file, what is asked of it, and what the refusal must say.
REFUSED = [
    ("a = 1\nb = = 2\n", None, "TOML syntax", "line 2"),
    ("a = 1\na = 2\n", None, "TOML syntax", "line 2: a stands twice in its table: remove one of the two"),
    ("a = 1\nr = { value = 1,5, unit = \"ohm\" }\n", None, "TOML syntax", "line 2: write 1.5, with a decimal point"),
    ("a = -2,67", None, "TOML syntax", "line 1: write -2.67"),
    ("a = [1,5]\nb\n", None, "TOML syntax", "line 2: expected"),
    ("[a.b]\nx = 1\n[a.b]\n", None, "cannot declare [a.b] twice", "line 3"),
    ("[a]\nx = 1\n[a]\n", None, "cannot declare [a] twice", "line 3"),
    ("a = 1\nb = \"x", None, "TOML syntax", "line 2"),
    ("x = 1" + "0" * 5000, None, "a number too long"),
    ("x = " + "[" * 100000, None, "tables too deep"),
    ("x = 1" + "0" * 400, lambda root: root.number("x"), "'x' is out of range", "line 1", "choose a number below 1e300"),
    ("[plant]\n" + ".".join("a" * 3000) + " = 1\n", lambda root: flatten(root.section("plant")), "tables too deep", "line 1"),
    ('"a\\u001b[31m" = 1\n', close, "unknown key 'a?[31m'"),
    ("title = \"x\"\nduraton_s = 3\n", close, "unknown key 'duraton_s'", "line 2", "did you mean 'duration_s'?"),
    ("zzz = 3\n", close, "unknown key 'zzz'", "use one of duration_s, title"),
    ("[[event]]\ntitle = \"a\"\n\n[[event]]\ntitle = \"b\"\nwrong = 1\n", lambda root: close(root.sections("event")[1]),
     "unknown key 'wrong'", "line 6"),
    ("x = 1\n[[event]]\ny = 1\n", lambda root: root.sections("event")[0].number("at_s"), "'at_s' is missing", "line 2"),
    ("a = \"1\"", lambda root: root.number("a"), "'a' is not a number", "line 1"),
    ("a = true", lambda root: root.number("a"), "'a' is not a number"),
    ("a = nan", lambda root: root.number("a"), "'a' is not a number"),
    ("a = 3", lambda root: root.number("a", minimum=0, maximum=2), "'a' = 3 is impossible", "0 .. 2"),
    ("a = 1.5", lambda root: root.integer("a"), "not a whole number"),
    ("a = \" \"", lambda root: root.text("a"), "'a' is not a text"),
    ("kind = \"mesure\"", lambda root: root.choice("kind", ("measure", "stop")), "did you mean 'measure'?"),
    ("", lambda root: root.one_of(KEYS), "nothing to do", "press, set"),
    ("press = 1\nset = 2", lambda root: root.one_of(KEYS), "'press' and 'set' together"),
    ("pres = 1", lambda root: root.one_of(KEYS), "unknown key 'pres'", "did you mean 'press'?"),
    ("[event]\nat_s = 1", lambda root: root.sections("event"), "write [[event]]"),
    ("a = 1\n[[start]]\nb = 2\n", lambda root: root.section("start"), "'start' is not a table", "line 2", "write [start]"),
    *((f"a = {value}", lambda root, limits=limits: root.number("a", **limits), "'a' is out of range", remedy)
      for value in ("inf", "-inf", "1e300")
      for limits, remedy in (({}, "choose"), ({"minimum": 0.0}, "choose 0 or more"), ({"maximum": 2.0}, "choose 2 or less")))]


@pytest.mark.parametrize("text, ask, parts", [(text, ask, parts) for text, ask, *parts in REFUSED], ids=[row[0][:30] for row in REFUSED])
def test_a_mistake_is_one_line_with_its_place(text, ask, parts):
    refusal(lambda: ask(document(text).root) if ask else document(text), *parts)


@pytest.mark.parametrize("path, parts", [("no/such.toml", ("no such file", "no/such.toml")), (".", ("cannot read",))])
def test_what_is_no_file_is_refused(path, parts):
    refusal(lambda: Document(Path(path)), *parts)


def test_the_mark_that_some_editors_begin_a_file_with_is_read_over_and_both_ends_of_a_range_are_allowed():
    root = document("\ufeffa = 0\nb = 2").root
    assert (root.number("a", minimum=0, maximum=2), root.number("b", minimum=0, maximum=2)) == (0.0, 2.0)


def test_a_default_is_returned_for_a_missing_key():
    root = document("").root
    assert (root.number("a", None), root.text("b", "x"), root.flag("c", False)) == (None, "x", False)


@pytest.mark.parametrize("text", ["[plant]\n\"motor.rs_ohm\" = 2\n", "[plant.motor]\nrs_ohm = 2\n", "[plant]\nmotor.rs_ohm = 2\n"])
def test_quoted_and_nested_names_are_the_same_values(text):
    assert document(text).root.values("plant") == {"motor.rs_ohm": 2.0}


def test_a_factor_is_allowed_only_where_it_makes_sense():
    root = document("[plant]\n\"motor.psi_vs\" = { factor = 0.5 }\n").root
    assert root.values("plant", factors=True) == {"motor.psi_vs": ("factor", 0.5)}
    assert root.values("plant") == {"motor.psi_vs.factor": 0.5}


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_a_file_in_utf_16_is_called_so(tmp_path, encoding):
    path = tmp_path / "x.toml"
    path.write_bytes("a = 1\n".encode(encoding))
    refusal(lambda: Document(path), f"the file is UTF-16, {paths.shown(path)}: save it as UTF-8")


def test_line_ends_and_a_mark_are_no_matter(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1\r\nb = 2\r\n")
    assert Document(path).data == {"a": 1, "b": 2}
