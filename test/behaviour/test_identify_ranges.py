"""Identification of what people own: from the smallest to the largest motor of the range, each is measured or named."""

from tuning import identify_range


def test_the_whole_range_of_motors_is_measured_or_ends_by_name():
    cases = identify_range.cases()
    wrong = {case.name: identify_range.wrong(case, item) for case, item in zip(cases, identify_range.measured(cases, True))}
    assert wrong == {case.name: [] for case in cases}
