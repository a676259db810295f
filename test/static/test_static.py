"""make static: warnings of two compilers, cppcheck, MISRA, clang-tidy; exceptions in docs/deviations.md."""

import pytest

import static


def test_nothing_is_found_that_the_page_does_not_list(make) -> None:
    make("static")


def test_a_tool_that_is_killed_is_no_tool_that_finds_nothing(capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        static.run(["sh", "-c", "echo a finding; kill -9 $$"])
    assert ended.value.code == 2 and "sh, static checks: ended by signal 9" in capsys.readouterr().err


@pytest.mark.parametrize("check, in_every, in_delivered, counts", [
    ("misra 12.1", True, False, True), ("misra 12.1", False, True, True), ("misra 12.1", True, True, True),
    *((unused, *case) for unused in static.UNUSED for case in ((True, True, True), (True, False, False), (False, True, False)))])
def test_what_is_never_used_is_so_in_both_runs(check: str, in_every: bool, in_delivered: bool, counts: bool) -> None:
    finding = {static.Finding(check, "file.c", 1, "found")}
    assert static.of_both(finding if in_every else set(), finding if in_delivered else set()) == (finding if counts else set())
