"""make static: warnings of two compilers, cppcheck, MISRA, clang-tidy; exceptions in docs/deviations.md."""


def test_nothing_is_found_that_the_page_does_not_list(make) -> None:
    make("static")
