"""make ubsan: the unit tests under clang's undefined, integer and implicit-conversion sanitizers."""


def test_no_wrap_around_that_is_not_marked(make) -> None:
    make("ubsan")
