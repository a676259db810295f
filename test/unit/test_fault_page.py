"""The table of faults, from which docs/faults.md is made: its codes count up, and what a remedy names exists."""

import re

from c_compiler import ROOT

from tools.common.x_macro import rows

FAULTS = rows("include", "drive/faults.h", "DRIVE_FAULT_TABLE", "#code #name cause remedy")


def test_the_codes_count_up_from_none() -> None:
    assert [code for code, *_ in FAULTS] == [str(n) for n in range(len(FAULTS))] and len(FAULTS) > 12


def test_every_parameter_that_a_fault_names_exists() -> None:
    known = (ROOT / "userparams.h").read_text(encoding="utf-8") + " ".join(name for _, name, *_ in FAULTS)
    words = re.findall(r"\b[A-Z]+(?:_[A-Z0-9]+)+\b", " ".join(f"{cause} {remedy}" for _, _, cause, remedy in FAULTS))
    assert words and not [word for word in words if word not in known], words
