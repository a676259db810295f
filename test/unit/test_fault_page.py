"""The tables of faults and of reasons for a limit, from which docs/ is made: their codes count up, and what a remedy names exists."""

import re

import pytest

from c_compiler import ROOT

from tools.common.drive_tables import faults, limits


def test_codes_of_faults_count_up_from_none() -> None:
    assert [row.code for row in faults()] == list(range(len(faults()))) and faults()[0].name == "NONE" and len(faults()) > 12


def test_reasons_for_a_limit_are_bits_of_their_own() -> None:
    assert [row.code for row in limits()] == [1 << n for n in range(len(limits()))] and len(limits()) > 4


@pytest.mark.parametrize("table", [faults, limits])
def test_every_parameter_that_a_row_names_exists(table) -> None:
    known = (ROOT / "userparams.h").read_text(encoding="utf-8") + " ".join(row.name for row in table())
    words = re.findall(r"\b[A-Z]+(?:_[A-Z0-9]+)+\b", " ".join(f"{row.cause} {row.remedy}" for row in table()))
    assert words and not [word for word in words if word not in known], words
