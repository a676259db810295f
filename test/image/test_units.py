"""make test-target: the unit tests of the control law as the chip runs them."""

from xc16 import made


def test_the_results_on_the_chip_are_those_of_the_pc() -> None:
    made("test-target")
