"""The tables of faults and of reasons for a limit, from which docs/ is made: their codes count up, and what a remedy names exists."""

import re

import pytest

from c_compiler import ROOT

from tools.common.drive_tables import faults, limits, states


def test_codes_of_faults_count_up_from_none() -> None:
    assert [row.code for row in faults()] == list(range(len(faults()))) and faults()[0].name == "NONE" and len(faults()) > 12


def test_reasons_for_a_limit_are_bits_of_their_own() -> None:
    assert [row.code for row in limits()] == [1 << n for n in range(len(limits()))] and len(limits()) > 4


@pytest.mark.parametrize("table", [faults, limits])
def test_every_parameter_that_a_row_names_exists(table) -> None:
    known = (ROOT / "userparams.h").read_text(encoding="utf-8") + " ".join(row.name for row in table())
    words = re.findall(r"\b[A-Z]+(?:_[A-Z0-9]+)+\b", " ".join(f"{row.cause} {row.remedy}" for row in table()))
    assert words and not [word for word in words if word not in known], words


def bodies() -> dict[str, str]:
    """What each function of the firmware does, by its name, without comments."""
    found: dict[str, str] = {}
    for file in sorted((ROOT / "firmware").rglob("*.c")):
        code = re.sub(r"/\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        found |= {head[1]: head[2] for head in re.finditer(r"^\w[^;{}#]*?\b(\w+)\([^;{}]*\)\s*\n\{\n(.*?)^\}", code, re.DOTALL | re.MULTILINE)}
    return found


def undecided(table, functions: dict[str, str]) -> list[str]:
    """Rows that no function decides, and functions that are not there or do not name their fault."""
    wrong = [f"{row.name}: nobody" for row in table[1:] if not row.decided_by]
    return wrong + [f"{row.name}: {name}" for row in table for name in row.decided_by if f"FAULT_{row.name}" not in re.findall(r"\bFAULT_\w+", functions.get(name, ""))]


def test_the_functions_that_decide_a_fault_exist_and_name_it() -> None:
    assert len(functions := bodies()) > 300
    assert not undecided(faults(), functions)
    assert len(undecided(faults(), functions | {"panel_tick": "asks->fault = FAULT_POTENTIOMETERS, FAULT_APPLICATION;"})) == 1


def test_whoever_names_a_fault_but_to_compare_it_is_in_its_row() -> None:
    rows = {row.name: row.decided_by for row in faults()[1:]}
    compared = re.compile(r"[!=<]=?\s*(?:\(uint16_t\))?FAULT_\w+")
    named = {(name, fault) for name, body in bodies().items() for fault in re.findall(r"\bFAULT_(\w+)", compared.sub("", body)) if fault in rows}
    assert len(named) > 20 and not [(name, fault) for name, fault in named if name not in rows[fault]]


def test_every_state_may_go_to_FAULT_and_its_reasons_name_each_fault() -> None:
    reasons = {state.name: " ".join(why for to, why in state.transitions if to == "FAULT") for state in states()}
    named = {state: set(re.findall(r"\b[A-Z_]{4,}\b", why)) for state, why in reasons.items()}
    known = {row.name for row in faults()[1:]}
    assert all({"TRAP", "OVERCURRENT_HW", "SELFTEST"} <= found <= known for found in named.values()), named
    assert set.union(*named.values()) == known
    assert "OFFSET" in named["CALIBRATE"] and "STALL" in named["CLOSED"] and "STALL" not in named["RAMP"] and "OVERCURRENT_SW" not in named["STOPPED"]
