"""A run that ends in SELFTEST names the register that differs, or the test that has failed; `registers` lists what the firmware compares."""

import pytest
from support import LIBRARY, command, refused, scenario

from tools.bench import command_common, report, selftest, simulate
from tools.bench.board import Board, Library
from tools.common import board_file, motor_file, workers

DEBUG = "[[event]]\nat_s = 0.5\ndebug = {{ {} = {} }}\n"


def protocol(text: str) -> list[str]:
    item = scenario(text)
    run = simulate.simulate(simulate.prepare(item, command_common.library_for([], None), motor_file.part(item.motor), board_file.part("mclv")), lambda seconds: None)
    return [line for _, line in run.protocol()]


def test_an_own_output_pin_is_named_with_its_bit():
    written = next(row for row in selftest.written(Library(LIBRARY)) if row.name == "TRISC")
    assert written.value & 0x0100
    lines = protocol(DEBUG.format("TRISC", written.value & ~0x0100))
    assert "fault SELFTEST" in lines
    assert lines[-1] == f"self-test REGISTERS failed: TRISC is 0x{written.value & ~0x0100:04X}, the start wrote 0x{written.value:04X}: bit 8"


def test_another_self_test_is_told_by_its_name_and_a_run_without_one_says_nothing():
    lines = protocol(DEBUG.format("board_selftest_failed", 5))
    assert lines[-2:] == ["fault SELFTEST", "self-test FLOW failed"]
    assert not [line for line in protocol("[[event]]\nat_s = 0.5\npot = 1\n") if "self-test" in line]


def every_register(_, tell) -> list[tuple[str, list[str]]]:
    """One wrong bit of each register that the board knows, one after the other: what is told."""
    library, found = Library(LIBRARY), []
    board = Board(library)
    board.power_up()
    board.run(4000)
    board.write_variable(selftest.VARIABLE, 7)
    for register in selftest.written(library):
        key, bit = f"reg.{register.name}", register.mask & -register.mask
        before = board.get(key)
        board.set(key, int(before) ^ bit)
        found.append((register.name, selftest.told(board, library)))
        board.set(key, before)
    found.append(("", selftest.told(board, library)))
    return found


def test_each_register_of_the_table_is_named_alone_and_none_where_all_are_right():
    *found, (_, none) = workers.run_all([0], every_register, lambda seconds: None)[0]
    assert len(found) >= 30
    assert [(name, lines) for name, lines in found if len(lines) != 1 or f": {name} is 0x" not in lines[0]] == []
    assert none == ["self-test REGISTERS failed: the register is as it was written again, or it is P1OVDCON: outputs that the state does not ask for"]


def test_the_command_lists_what_the_firmware_compares():
    code, out, error = command("registers")
    assert (code, error) == (0, "") and len(out.splitlines()) == len(selftest.written(Library(LIBRARY)))
    assert out.splitlines()[0].startswith("P1TCON ") and "TRISC      bits 0x03FF" in out
    refused(command("registers", "--defines=-DSELFTEST_OFF"), "no self-tests", "leave out SELFTEST_OFF")


@pytest.mark.parametrize("now, line", [(0x0237, "TRISC is 0x0237, the start wrote 0x0337: bit 8"), (0xFC36, "TRISC is 0x0036, the start wrote 0x0337: bits 0, 8, 9")])
def test_bits_outside_the_mask_are_not_looked_at(now, line):
    register = selftest.Written("TRISC", 0x03FF, 0x0337)
    assert register.differs(now) and register.told(now) == line and not register.differs(0xFF37)


def test_the_page_of_the_run_has_it_too(tmp_path):
    (tmp_path / "own.toml").write_text('title = "own pin"\nduration_s = 1.0\n' + DEBUG.format("TRISC", 0x0237), encoding="utf-8")
    code, out, _ = command("run", str(tmp_path / "own.toml"), "--out", str(tmp_path / "out"), "--no-plots", "--quiet")
    assert code == 0 and "TRISC is 0x0237" in out and "TRISC is 0x0237" in (tmp_path / "out/index.html").read_text(encoding="utf-8")
    assert report.outcomes_text([]) == "no expectations"
