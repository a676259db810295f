"""make static: warnings of two compilers, cppcheck, MISRA, clang-tidy; exceptions in docs/deviations.md."""

import pytest

import static


def test_nothing_is_found_that_the_page_does_not_list(make) -> None:
    make("static")


def test_a_tool_that_is_killed_is_no_tool_that_finds_nothing(capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        static.run(["sh", "-c", "echo a finding; kill -9 $$"])
    assert ended.value.code == 2 and "sh, static checks: ended by signal 9" in capsys.readouterr().err
