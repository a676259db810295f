"""docs/files.md: every key of a loader, with its range and default; the virtual board's keys as the board has them."""

import re
from dataclasses import replace

import pytest
from support import LIBRARY, refusal

from tools.bench import expect, scenario_file
from tools.bench.board import Board, Library
from tools.common import board_file, motor_file, paths
from tools.docs import file_keys, tables

MOTOR, BOARD = (paths.ROOT / f"examples/my_{kind}.toml" for kind in ("motor", "board"))
ROUND = paths.MOTORS / "hurst_dmb0224c10002.toml"
"""One inductance."""


def cells(name: str) -> list[str]:
    """The first row of the page that begins with this key."""
    line = next(line for line in tables.page("files").splitlines() if line.startswith(f"| `{name}` |"))
    return [cell.strip() for cell in line.split("|")[1:-1]]


KEYS = {f"{table} {key}": (loader, ROUND if (table, key) == ("electrical", "inductance") else example, table, key)
        for loader, example in ((motor_file, MOTOR), (board_file, BOARD)) for table, keys in loader.TABLES.items() for key in keys or ()}


@pytest.mark.parametrize("loader, example, table, key", KEYS.values(), ids=KEYS)
def test_a_loader_reads_each_key_of_its_tables(tmp_path, loader, example, table, key):
    before, head, rest = example.read_text(encoding="utf-8").partition(f"[{table}]\n")
    inside, blank, after = rest.partition("\n\n")
    changed, count = re.subn(rf"(?m)^{key} = .*", f"{key} = 1", inside)
    path = tmp_path / example.name
    path.write_text(before + head + changed + blank + after, encoding="utf-8")
    assert count == 1
    refusal(lambda: loader.load(str(path)), f"'{key}'", example.name)


def test_every_event_and_expectation_is_in_an_example():
    found = file_keys.asked()
    assert set(scenario_file.EVENT_KINDS) <= {item.key for item in found["event"]}
    assert {f"expect {name}" for name in expect.KINDS} - {"expect no_warnings"} == {name for name in found if name.startswith("expect ")}


@pytest.mark.parametrize("row", [
    ["`dead_time`", "s", "5e-07 .. 3e-06", "must be given"], ["`pole_pairs`", "pole pairs", "1 .. 50", "must be given"],
    ["`coulomb_friction`", "N m", "0 .. 10", "0"],
    ["`rotor_deg`", "deg", "-360 .. 360", "0"], ["`sinks`", "", "true or false", "must be given"],
    ["`torque_percent`", "%", "0 .. 1000", "one of these"],
    ["`overshoot_percent`", "%", "from 0", ""], ["`hold_s`", "s", "0.001 .. duration_s", ""], ["`press`", "", "`S2`, `S3`", "one of these"]])
def test_unit_range_and_default_are_the_loader_s(row):
    assert cells(row[0].strip("`"))[:4] == row


def test_another_range_in_a_loader_is_another_page(monkeypatch):
    key = board_file.TABLES["pwm"]["dead_time"]
    monkeypatch.setitem(board_file.TABLES["pwm"], "dead_time", replace(key, kind=replace(key.kind, maximum=4e-6)))
    assert "| 5e-07 .. 4e-06 |" in tables.page("files")


def test_a_key_without_a_meaning_is_refused(monkeypatch):
    monkeypatch.setitem(scenario_file.EVENT_KINDS, "press", "")
    refusal(lambda: tables.page("files"), "'press' of [event] has no meaning")


@pytest.mark.parametrize("key, expected", [
    ("resistance_tempco", {"resistance_tempco_per_k": 0.0039}), ("kphi_tempco", {"kphi_tempco_per_k": -0.002}),
    ("viscous_friction", {"viscous_nms": 0.0}), ("coulomb_friction", {"coulomb_nm": 0.0}),
    ("maximum_current", {"maximum_current_a": 1.5 * 1.9 * 2.0 ** 0.5}), ("start_torque", {"start_torque_nm": 0.025}),
    ("thermal_time", {"thermal_time_s": 0.0})])
def test_what_stands_in_for_a_quantity_is_what_the_page_says(tmp_path, key, expected):
    (tmp_path / "m.toml").write_text(re.sub(rf"(?m)^{key} = .*\n", "", MOTOR.read_text(encoding="utf-8")), encoding="utf-8")
    motor = motor_file.load(str(tmp_path / "m.toml"))
    assert {name: getattr(motor, name) for name in expected} == pytest.approx(expected)
    assert cells(key)[3] in ("0.0039", "-0.002", "0", "1.5 times current", "no I2t", "0.25 times the rated torque")


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
