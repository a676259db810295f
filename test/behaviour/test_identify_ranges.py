"""Identification of what people own: from the smallest to the largest motor of the range, each is measured or named."""

import pytest

from tuning import identify_range

ENDS = ("gimbal, 1e-7 kg m2", "5 mohm, 10 uH", "hub of a vehicle")
"""On each push, the others for a release."""


@pytest.mark.parametrize("all_but", [pytest.param(False, id="ends"), pytest.param(True, id="all others", marks=pytest.mark.release)])
def test_the_whole_range_of_motors_is_measured_or_ends_by_name(all_but):
    cases = [case for case in identify_range.cases() if (case.name in ENDS) != all_but]
    wrong = {case.name: identify_range.wrong(case, item) for case, item in zip(cases, identify_range.measured(cases, True))}
    assert wrong == {case.name: [] for case in cases}
