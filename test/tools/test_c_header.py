"""Reading a C header: comments, continued lines, branches, macros and expressions as a compiler takes them; every mistake is one line with its place."""

import pytest

from tools.common.errors import UserError
from tuning import c_header


@pytest.fixture
def header(tmp_path):
    """Reads a text as a header; the file is called drive.h."""
    def read(text: str | bytes, **defined: str) -> c_header.Header:
        path = tmp_path / "drive.h"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        found = c_header.read(path, defined)
        found.label = "drive.h"
        return found
    return read


@pytest.fixture
def refusal(header):
    """The one line that reading a text, or the value of A, is refused with; the folder is left out."""
    def refused(text: str | bytes, name: str = "A") -> str:
        with pytest.raises(UserError) as caught:
            header(text).value(name)
        assert len(caught.value.lines) == 1
        return caught.value.lines[0]
    return refused


# ---- expressions -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("body, value", [
    ("12", 12), ("1.5e-3", 0.0015), (".25", 0.25), ("3.", 3.0), ("0x2000", 8192), ("0x1FUL", 31), ("20000L", 20000), ("0.5f", 0.5), ("0", 0), ("0.1", 0.1),
    ("2*374", 748), ("(1 + 2) * 3", 9), ("1 + 2 * 3", 7), ("7/2", 3), ("-7/2", -3), ("7/2.0", 3.5), ("-7 % 3", -1), ("10 - 3 - 2", 5), ("-(-2)", 2), ("!0", 1), ("~5", -6),
    ("1 << 4 | 3", 19), ("5 > 3 ? 10 : 20", 10), ("0 ? 1/0 : 4", 4), ("1 ? 4 : 1/0", 4), ("1 == 1 && 2 < 1 || 1", 1),
    ("(int)(0.25*32768)", 8192), ("(int)-2.9", -2), ("(float)1/2", 0.5), ("(unsigned int)(40000)", 40000), ("(long)100000", 100000),
    ("Q15(0.5)", 16384), ("Q15(-0.5)", -16384), ("Q15(1.0)", 32767), ("Q15(0.00003)", 1), ("Q15(1/4.0)", 8192)])
def test_an_expression_has_c_s_value(header, body, value):
    found = header(f"#define A {body}\n").value("A")
    assert found == pytest.approx(value, rel=1e-12) and isinstance(found, type(value))


def test_a_current_is_a_share_of_full_scale(header):
    text = "#define NORM_CURRENT_CONST 0.0002\n#define A NORM_CURRENT(-3.2768)\n"
    assert header(text).value("A") == -16384
    own = "#define NORM_CURRENT(current_real) (Q15(current_real/NORM_CURRENT_CONST/32768))\n"
    printed = "#define NORM_CURRENT(current_real)\n(Q15(current_real/NORM_CURRENT_CONST/32768))\n"
    assert header(own + text).value("A") == header(printed + text).value("A") == -16384


def test_macros_are_replaced_as_text_with_and_without_arguments(header):
    found = header("#define RATE 20000\n#define PERIOD (1.0/RATE)\n#define SUM(a, b) a + b\n#define A 2*SUM(3, RATE)\n#define B PERIOD\n#define C SELF\n#define SELF SELF\n")
    assert found.value("A") == 2 * 3 + 20000 and found.value("B") == pytest.approx(50e-6)
    with pytest.raises(UserError, match="C: SELF in line 7 leads back to itself, .*:6: write its number there"):
        found.value("C")


def test_macros_that_need_each_other_are_called_so(header):
    with pytest.raises(UserError, match="A: B in line 2 leads back to itself, .*:1: write its number there"):
        header("#define A B\n#define B A\n").value("A")


@pytest.mark.parametrize("body, told", [
    ("", "A has no value, drive.h:1: write a number behind it"), ("017", "'017' is octal in C"), ("24V", "'24V' is no number"), ("50us", "'50us' is no number"),
    ("2,67", "a comma in a number"), ("1/0", "division by zero"), ("1.0/0.0", "division by zero"), ("5 % 0", "division by zero"), ("OTHER", "OTHER is not defined in this header"),
    ("(2", "a bracket is not closed"), ("2)", "')' is not expected"), ("2 3", "'3' is not expected"), ("2 +", "the expression ends too early"), ("2 * * 3", "'*' is not expected"),
    ("Q15(1.2)", "Q15(1.2) is beyond -1 .. 1"), ("(int)(1.0*32768)", "(int) of it is 32768, which 16 bits do not hold"), ("1.5 % 2", "'%' of these numbers"),
    ("1e300*1e300", "'1e300' is out of range"), ("1e20*1e20", "'*' gives a number out of range"), ("0x", "'0x' is no number"), ('"text"', "'\"' is not expected"),
    ("NORM_CURRENT(1)", "NORM_CURRENT needs NORM_CURRENT_CONST"), ("(" * 200 + "1" + ")" * 200, "brackets are too deep")])
def test_what_is_no_number_is_one_line_with_its_place(refusal, body, told):
    line = refusal(f"#define A {body}\n")
    assert told in line and "drive.h:1" in line


def test_macros_that_grow_without_end_are_refused(refusal):
    text = "".join(f"#define M{i} M{i + 1}+M{i + 1}\n" for i in range(40)) + "#define M40 1\n#define A M0\n"
    assert "too" in refusal(text)


# ---- comments, lines, directives --------------------------------------------------------------------------------------------
def test_comments_continued_lines_and_blanks_do_not_count_but_keep_the_line_numbers(header):
    found = header("/* two\nlines */ #define A 1 // the first\n  #  define\tB \\\n   2 /* and\n more */\n#define C 3\n")
    assert [(name, found.value(name), define.line) for name, define in found.defines.items()] == [("A", 1, 2), ("B", 2, 3), ("C", 3, 6)]


def test_a_semicolon_behind_a_number_is_left_out_and_told(header):
    found = header("#define A Q15(0.25);\n#define B 3 ;\n")
    assert (found.value("A"), found.value("B")) == (8192, 3) and found.notes == ["line 1, 2: a semicolon behind a number is left out"]


@pytest.mark.parametrize("defined, value, told", [
    ({}, 3, "line 1: #ifdef FAST is not taken, but #else in line 5"), ({"FAST": "1"}, 1, "line 1: #ifdef FAST is taken"),
    ({"SLOW": "2"}, 2, "line 1: #ifdef FAST is not taken, but #elif defined(SLOW) && SLOW > 1 in line 3"), ({"SLOW": "1"}, 3, "line 1: #ifdef FAST is not taken, but #else in line 5")])
def test_the_branch_that_counts_is_told(header, defined, value, told):
    found = header("#ifdef FAST\n#define A 1\n#elif defined(SLOW) && SLOW > 1\n#define A 2\n#else\n#define A 3\n#endif\n", **defined)
    assert (found.value("A"), found.branches) == (value, [told])


def test_branches_in_a_branch_that_does_not_count_are_silent_and_the_guard_is_no_branch(header):
    found = header("#ifndef DRIVE_H\n#define DRIVE_H\n#if 0\n#ifdef X\n#define A 1\n#else\n#define A 2\n#endif\n#endif\n#define A 4\n#endif\n")
    assert found.value("A") == 4 and found.branches == ["line 3: #if 0 is not taken"]


def test_undef_a_second_definition_and_an_include(header):
    found = header('#include "general.h"\n#define A 1\n#define A 2\n#define B 1\n#undef B\n')
    assert found.value("A") == 2 and "B" not in found
    assert found.notes == ['line 1: #include "general.h" is not read', "line 3: A is defined again, line 2 has '1': the last one, '2', counts"]


@pytest.mark.parametrize("text, told", [
    ("#define A 1\n/* open\n", "a comment is not closed, "), ("#define A 1\n#ifdef X\n", "#ifdef X is not closed, "), ("#define A 1\n#endif\n", "#endif without #if, "),
    ("#define A 1\n#else\n", "#else without #if, "), ("#define A 1\n#defin B 2\n", "#defin is no directive, "), ("#define A 1\n#define 5\n", "a #define without a name, "),
    ("#define A 1\n#error not for this motor\n", "#error not for this motor, "), ("#define A 1\n#if (\n#endif\n", "#if: "), ("#define A 1\n#ifdef\n#endif\n", "#ifdef without a name, ")])
def test_what_is_no_header_is_one_line_with_its_place(refusal, text, told):
    line = refusal(text)
    assert line.startswith(told) and "drive.h:2: " in line


@pytest.mark.parametrize("content, told", [
    (b"", "the file is empty"), (b"\x7fELF\0\0\1", "the file is binary"), ("#define A 1\n".encode("utf-16"), "the file is UTF-16"),
    (b"a page of text\n", "no #define in the file"), (b"#define A 1\n" * 30000, "the file is too large, 351 KiB")])
def test_what_is_no_text_of_a_header_is_one_line(refusal, content, told):
    assert told in refusal(content)


@pytest.mark.parametrize("content", [b"\xef\xbb\xbf#define A 5 // mark\r\n", b"/* \xb5s */\r\n#define A 5\r\n", b"#define A 5"])
def test_marks_old_encodings_and_dos_line_ends_are_read(header, content):
    assert header(content).value("A") == 5


def test_a_folder_and_a_file_that_is_not_there_are_one_line(tmp_path):
    for path, told in ((tmp_path, "this is a folder"), (tmp_path / "none.h", "no such file")):
        with pytest.raises(UserError, match=told):
            c_header.read(path)
