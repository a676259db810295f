"""make test-avr: the unit tests of the control law with a 16-bit int."""


def test_the_results_are_those_of_the_pc(make) -> None:
    make("test-avr")
