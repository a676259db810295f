"""docs/files.md: every key that a loader asks for, with its range and default; the virtual board's keys as the board has them."""

import re
from dataclasses import replace

import pytest
from support import LIBRARY, refusal

from tools.bench import expect, scenario_file
from tools.bench.board import Board, Library
from tools.common import board_file, motor_file
from tools.docs import file_keys, tables

MOTOR = file_keys.EXAMPLES["motor"][0]


@pytest.fixture(scope="module")
def found() -> dict[str, dict[str, file_keys.Asked]]:
    return {kind: file_keys.listen(kind) for kind in file_keys.LOADERS}


def cells(name: str) -> list[str]:
    """The first row of the page that begins with this key."""
    line = next(line for line in tables.page("files").splitlines() if line.startswith(f"| `{name}` |"))
    return [cell.strip() for cell in line.split("|")[1:-1]]


def test_no_key_of_the_loaders_own_tables_is_left_out(found):
    assert {f"{table}.{key}" for table, keys in motor_file.TABLES.items() for key in keys or ()} <= set(found["motor"])
    board = {table: (*keys, *board_file.OTHERS.get(table, ())) for table, keys in board_file.TABLES.items()}
    assert {f"{table}.{key}" for table, keys in board.items() for key in keys} <= set(found["board"])
    assert {f"event.{kind}" for kind in scenario_file.EVENT_KINDS} <= set(found["scenario"])
    keyless = {"no_warnings", "clean", "no_fault", "outputs_off"}
    assert set(expect.KINDS) - keyless <= {item.table.removeprefix("expect ") for item in found["scenario"].values()}


@pytest.mark.parametrize("row", [
    ["`dead_time`", "s", "5e-07 .. 3e-06", "must be given"], ["`pole_pairs`", "pairs", "1 .. 50", "must be given"],
    ["`coulomb_friction`", "N m", "0 .. 10", "0"],
    ["`rotor_deg`", "deg", "-360 .. 360", "0"], ["`sinks`", "", "true or false", "must be given"],
    ["`torque_percent`", "%", "0 .. 1000", "one of these"],
    ["`overshoot_percent`", "%", "from 0", ""], ["`hold_s`", "s", "0.001 .. duration_s", ""], ["`press`", "", "`S2`, `S3`", "one of these"]])
def test_unit_range_and_default_are_the_loader_s(row):
    assert cells(row[0].strip("`"))[:4] == row


def test_another_range_in_a_loader_is_another_page(monkeypatch):
    monkeypatch.setitem(board_file.TABLES["pwm"], "dead_time", ("", replace(board_file.TABLES["pwm"]["dead_time"][1], maximum=4e-6)))
    assert "| 5e-07 .. 4e-06 |" in tables.page("files")


def test_a_key_without_a_meaning_and_a_meaning_without_a_key_are_refused(monkeypatch):
    meanings = file_keys.MEANINGS["board"]
    monkeypatch.setitem(file_keys.MEANINGS, "board", {name: text for name, text in meanings.items() if name != "bus.load"})
    refusal(lambda: tables.page("files"), "no meaning of 'bus.load' in a board file, tools/docs/file_keys.py")
    monkeypatch.setitem(file_keys.MEANINGS, "board", meanings | {"bus.weight": "none"})
    refusal(lambda: tables.page("files"), "no key 'bus.weight' in a board file")


def test_listening_leaves_the_loaders_as_they_were():
    before = {name: getattr(file_keys.Section, name) for name in ("text", "number", "choice", "flag")}, file_keys.units.read
    file_keys.listen("board")
    assert before == ({name: getattr(file_keys.Section, name) for name in before[0]}, file_keys.units.read)


@pytest.mark.parametrize("key, expected", [
    ("resistance_tempco", {"resistance_tempco_per_k": 0.0039}), ("kphi_tempco", {"kphi_tempco_per_k": -0.002}),
    ("viscous_friction", {"viscous_nms": 0.0}), ("coulomb_friction", {"coulomb_nm": 0.0}),
    ("maximum_current", {"maximum_current_a": 1.5 * 1.9 * 2.0 ** 0.5}), ("start_torque", {"start_torque_nm": 0.025}),
    ("thermal_time", {"thermal_time_s": 0.0})])
def test_what_stands_in_for_a_quantity_is_what_the_page_says(tmp_path, key, expected):
    (tmp_path / "m.toml").write_text(re.sub(rf"(?m)^{key} = .*\n", "", MOTOR.read_text(encoding="utf-8")), encoding="utf-8")
    motor = motor_file.load(str(tmp_path / "m.toml"))
    assert {name: getattr(motor, name) for name in expected} == pytest.approx(expected)
    assert cells(key)[3] in ("0.39 %/K", "-0.2 %/K", "0", "1.5 times current", "no I2t", "a quarter of the rated torque")


def test_the_virtual_board_has_the_keys_of_the_page_with_these_units_ranges_defaults_and_meanings():
    library = Library(LIBRARY)
    listed = {row[0]: row[1:] for row in file_keys.plant_keys()}
    known = {name: key for name, key in library.keys.items() if not name.startswith(("fw.", "pin."))}
    assert {name: (row[0], row[3]) for name, row in listed.items()} == {name: (key.unit, key.meaning) for name, key in known.items()}
    assert {name: row[1] for name, row in listed.items() if row[1]} \
        == {name: f"{key.minimum:g} .. {key.maximum:g}" for name, key in known.items() if key.writable}
    board = Board(library)
    try:
        assert {name: row[2] for name, row in listed.items() if row[2]} \
            == {name: f"{board.get(name):g}" for name, key in known.items() if key.writable and key.readable}
    finally:
        board.close()
