"""make coverage: lines and branches of the control law that the unit tests reach."""


def test_the_unit_tests_reach_the_control_law(make) -> None:
    make("coverage")
