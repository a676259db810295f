"""make static: warnings of two compilers, cppcheck, MISRA, clang-tidy; exceptions in docs/deviations.md."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import static


def test_nothing_is_found_that_the_page_does_not_list(make) -> None:
    make("static")


def test_a_tool_that_is_killed_is_no_tool_that_finds_nothing(capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        static.run(["sh", "-c", "echo a finding; kill -9 $$"])
    assert ended.value.code == 2 and "sh, static checks: ended by signal 9" in capsys.readouterr().err


@pytest.mark.parametrize("check, delivered, others, counts", [
    ("misra 12.1", True, (False, False), True), ("misra 12.1", False, (False, True), True),
    *((unused, *case) for unused in static.UNUSED for case in (
        (True, (True, True), True), (True, (True, False), unused != "misra 2.5"), (True, (False, True), False),
        (False, (True, True), False)))])
def test_what_is_never_used_is_so_as_delivered_and_in_each_configuration_that_has_the_line(check, delivered, others, counts) -> None:
    finding, texts = static.Finding(check, "file.c", 1, "found"), [frozenset({("file.c", 1, "x")})] * 2 + [frozenset({("file.c", 2, "x")})]
    found = [{finding} if one else set() for one in (delivered, *others)]
    assert static.of_all(found, texts) == ({finding} if counts else set())


def test_chosen_configurations_have_every_line_between_them() -> None:
    texts = {("A",): frozenset("abc"), ("B",): frozenset("bc"), ("C",): frozenset("cd")}
    assert static.cover(texts) == [("A",), ("C",)]


NOT_REACHED = {"ifdef __OPTIMIZE__", "if MOTOR_SALIENCY_UH", "else of ifdef __clang__",
               "else of ifdef DRIVE_PARAM_SCALING_H", "if defined(NORM_RS) || defined(NORM_LSDTBASE) || defined(NORM_INVKFIBASE) || defined(NORM_DELTAT)"}
"""What asks the optimizer; what a salient motor's userparams.h has, or one of AN1292; what is empty."""


def test_what_parameters_are_held_to_in_any_mode_is_analysed(monkeypatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    source = static.CHECKS_OF_PARAMETERS[1]
    rows = re.compile(r"#define MODE_RELATION_\w+\(X\) X\(.*")
    seen, every = ({line[2] for configuration in of for line in static.preprocessed(source, tuple(static.defines(configuration))) if rows.match(line[2])}
                   for of in (static.CHECKED, [*static.CHECKED, ("SNAPSHOT",)]))
    assert len(seen) >= 3 and {re.sub('"[A-Z]+"', "", row) for row in seen} == {re.sub('"[A-Z]+"', "", row) for row in every}


def branches(path: Path) -> Iterator[tuple[str, list[int]]]:
    """Each branch of each #if: its condition, and the numbers of its own lines with code."""
    text = re.sub(r"/\*.*?\*/", lambda comment: "\n" * comment[0].count("\n"), path.read_text(encoding="utf-8"), flags=re.DOTALL)
    open_, goes_on = [], False
    for number, line in enumerate(text.splitlines(), 1):
        directive = re.match(r" *# *(if\w*|elif|else|endif|include|pragma|error)\b *(.*?) *$", line)
        if directive and directive[1] in ("elif", "else", "endif"):
            yield (closed := open_.pop())
            if directive[1] != "endif":
                open_.append((f"{directive[1]} {directive[2]}".strip() if directive[2] else f"else of {closed[0]}", []))
        elif directive and directive[1].startswith("if"):
            open_.append((f"{directive[1]} {directive[2]}", []))
        elif open_ and line.strip() and not goes_on and not directive:
            open_[-1][1].append(number)
        goes_on = line.endswith("\\")


def test_what_stands_in_any_branch_of_any_if_is_analysed_in_one_of_the_configurations(monkeypatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    static.BUILD.mkdir(parents=True, exist_ok=True)
    sources = sorted(map(str, Path("firmware").rglob("*.c")))
    seen, missed = set(), {}
    for source in (static.one_unit(sources), *static.CHECKS_OF_PARAMETERS, *static.other_applications()):
        texts = static.distinct(source, static.CHECKED if source in static.CHECKS_OF_PARAMETERS else [*static.configurations(), static.ON_TARGET])
        seen |= {line[:2] for configuration in static.cover(texts) for line in texts[configuration]}
    for path in (*Path("include").rglob("*.h"), *Path("firmware").rglob("*.c")):
        for condition, lines in branches(path):
            if lines and not any((str(path), number) in seen for number in lines):
                missed[condition] = f"{path}:{lines[0]}"
    assert len(seen) > 5000 and missed.keys() == NOT_REACHED, missed
