"""The delivered image against its budgets: size, longest path, cycles; and against the PC's firmware, interrupt by interrupt."""

import re

import pytest
from xc16 import made


@pytest.mark.parametrize("target", ["wcet", "cycles", "size"])
def test_make(target: str) -> None:
    made(target)


@pytest.mark.parametrize("scenario", ["demo", "fault_stall_running", "fault_overcurrent"])
def test_target_and_pc_agree_in(scenario: str) -> None:
    found = re.search(r"(\d+) interrupts, (\d+) differ", made("pil", f"SCENARIO={scenario}"))
    assert found is not None and int(found[1]) > 10000 and found[2] == "0"
