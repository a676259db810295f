"""make examples: the harness compiles and turns its motor, the scenario's expectations hold, the board's numbers give a header."""


def test_all_of_them_run(make):
    make("examples")
