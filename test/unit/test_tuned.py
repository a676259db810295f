"""Numbers that were chosen by trial stand in one table, each with its command, and the scaling headers have none of their own."""

import re

import pytest
from c_compiler import ROOT

from tools.common.errors import UserError
from tools.common.tuned_rows import TABLE, read, tuned, with_value

SCALING = [*sorted((ROOT / "include/drive/scaling").glob("*.h")), ROOT / "include/drive/param_init.h", ROOT / "include/drive/param_scaling.h"]
# Units, formats and AN1292's own: none of them could be chosen otherwise. Powers of two, and one less, are formats anyway.
EXACT = {"3", "10", "12", "60", "1000", "2000", "3.14159265", "1.73205081", "0.001", "0.000001", "0.5", "1.5", "65.536", "131068", "131070", "131071", "262143",
         "33554432", "67108864"}
# The ends of a format's word, with room for what is added; a clock; a schedule. The line has the name that it stands for.
NAMED = {"SPEED_UNIT_ERPM": "32000", "PWM_TICK_SEC": "0.000000025", "DEFER_BELOW_SEC": "0.00004", "CURRENT_PI_SHIFT": "10", "PARAM_LS_RAISED": "1.2",
         "PARAM_LOAD_FROM": "16000", "PARAM_INNOVATION_MAX": "16000", "PARAM_ACCEL_SHIFT": " ".join(map(str, range(16))), "PARAM_PROTECTION_INIT": "32700 0.99", "TUNING_STEP_Q16": "1",
         # 1/e; the share's rounding; an NTC's table and its exponential function, Kelvin and 25 degrees Celsius.
         "PARAM_LOAD_MEAN": "0.36788", "CHOPPER_SHARE_Q10": "0.01", "NTC_LEAST_C": "40", "NTC_NODES": "13", "NTC_MOST_C": "152", "PARAM_NTC_EXP_TOP": "120",
         "PARAM_NTC_SHARE": "298.15 273.15"}
COMMENT = re.compile(r"/\*.*?\*/|\"[^\"]*\"", re.DOTALL)


def macros(text: str) -> list[tuple[str, str]]:
    """Every macro of a header: name and what it stands for."""
    return re.findall(r"^#define (\w+)(?:\([^)]*\))? ((?:.*\\\n)*.*)", COMMENT.sub("", text), re.MULTILINE)


def is_format(number: str) -> bool:
    """A power of two, or one less; also a negative one."""
    value = float(number)
    whole = value if value >= 1.0 else 1.0 / value if value > 0.0 else 1.0
    return whole == int(whole) and (int(whole) & (int(whole) - 1) == 0 or int(whole) & (int(whole) + 1) == 0)


def numbers(text: str) -> list[str]:
    return [number.rstrip(".") for number in re.findall(r"(?<![\w.])(\d+(?:\.\d+)?(?:e-?\d+)?)[FfuUlL]*(?!\w)", text)]


def untold(text: str) -> list[str]:
    """The numbers of a header that are neither exact nor named."""
    return [f"{name}: {number}" for name, body in macros(text) if name != "PARAM_18_OF" for number in numbers(body)
            if not is_format(number) and (number.removesuffix(".0") not in EXACT) and number.removesuffix(".0") not in NAMED.get(name, "").split()]


@pytest.mark.parametrize("path", SCALING, ids=lambda path: path.name)
def test_a_scaling_header_has_no_number_chosen_by_trial(path) -> None:
    assert untold(path.read_text(encoding="utf-8")) == []


def test_such_a_number_would_be_seen() -> None:
    assert untold("#define A(x) (0.13F * (x))\n") == ["A: 0.13"] and untold("#define A { \\\n .b = 5, \\\n .c = 32768.0F }\n") == ["A: 5"]
    assert untold("#define A (60.0F / 1000 * 0.5F * 4294967296.0F) /* 0.13 */\n") == []


def test_every_row_is_read_and_used_by_the_firmware() -> None:
    text = TABLE.read_text(encoding="utf-8")
    assert len(tuned()) == len(re.findall(r"^#define \w+ \S", text, re.MULTILINE)) > 90
    code = "\n".join(COMMENT.sub("", path.read_text(encoding="utf-8")) for top in ("firmware", "include") for path in sorted((ROOT / top).rglob("*.[ch]"))
                     if path != TABLE)
    assert [name for name in tuned() if not re.search(rf"\b{name}\b", code)] == []
    assert all(row.unit and row.meaning and row.section for row in tuned().values())


def test_the_command_of_a_row_can_be_given() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for row in tuned().values():
        target, *variables = row.command.split()
        assert re.search(rf"^{target}:.*## ", makefile, re.MULTILINE), row
        for name, value in (variable.split("=") for variable in variables):
            folder = {"SCENARIO": "tools/bench/scenarios", "MOTOR": "tuning/motors"}[name]
            assert (ROOT / folder / f"{value}.toml").is_file(), row


def test_a_row_changes_by_a_share_a_whole_number_by_one_at_least_and_a_shift_by_a_step() -> None:
    rows = read("#define A 0.13 /* [1] share | loadsteps */\n#define B 2u    /* [steps] count | starts */\n#define C 9 /* [shift] of it | starts */\n")
    assert [(row.changed(-20.0), row.changed(20.0)) for row in rows.values()] == [("0.104", "0.156"), ("1", "3"), ("8", "10")]


def test_a_row_that_cannot_be_read_is_refused_with_its_line() -> None:
    for line in ("#define A 0.13", "#define A 0.13 /* no unit | starts */", "#define A 0.13 /* [1] no command */", "#define A (B) /* [1] a | starts */"):
        with pytest.raises(UserError, match="a row cannot be read: #define A .*tuned.h:2"):
            read(f"\n{line}\n")


def test_a_changed_row_is_the_only_difference() -> None:
    text, row = TABLE.read_text(encoding="utf-8"), tuned()["CATCH_PAUSE_TURN"]
    lines = [pair for pair in zip(text.splitlines(), with_value(text, row, "10922").splitlines(), strict=True) if pair[0] != pair[1]]
    assert len(lines) == 1 and lines[0][1].startswith("#define CATCH_PAUSE_TURN 10922u "), lines


def test_a_number_that_the_page_names_is_a_row() -> None:
    text = (ROOT / "docs/tuned.md").read_text(encoding="utf-8")
    assert sorted(set(re.findall(r"`([A-Z][A-Z0-9]+_\w+)`", text)) - set(tuned())) == []
    assert len(set(re.findall(r"`(\w+)`", text.partition("Nothing moves with")[2].partition("## The numbers")[0]))) == 36
