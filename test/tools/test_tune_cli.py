"""The command line: results complete or not at all, one line and exit code 2 for every mistake."""

import json
import os
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace
from unittest import mock

import pytest
from support import refused
from tune_support import FOR_ANOTHER_BOARD, HURST, command, motor_path

from tools.bench import rating_sweep
from tools.common import paths
from tools.common.errors import UserError


# ---- the whole result of one motor, plots included -------------------------------------------------------------------------
@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tune") / "result"
    code, out, error = command("tune", HURST, "--out", str(folder))
    assert (code, error) == (0, "")
    return SimpleNamespace(folder=folder, out=out, page=(folder / "report.html").read_text(encoding="utf-8"))


def test_a_motor_becomes_a_header_a_page_and_numbers(result):
    assert sorted(path.name for path in result.folder.iterdir()) == ["report.html", "summary.json", "tuning.json", "userparams.h"]
    assert "phase margin" in result.out and "NORM_RS 14470" in result.out
    numbers = json.loads((result.folder / "tuning.json").read_text(encoding="utf-8"))
    assert numbers["params"]["MOTOR_RS_OHM"] == "2.67" and numbers["loops"]["speed"]["rates"]["quiet"]["phase_deg"] >= 45.0


def test_the_page_needs_nothing_else_and_shows_everything(result):
    assert result.page.count("<svg") == 5
    assert not [words for words in ("src=", "href=\"http", "<script") if words in result.page]
    cells = (f'<td class="n">{cell}</td>' for cell in ("7.24 V peak line-to-line/krpm", "2.67 ohm", "2800 rpm", "24 V"))
    for words in ("Current loop", "Speed loop", "Start", "Parameters", "Constants", "Inputs", "NORM_RS", "AN1292", *cells):
        assert words in result.page
    for words in ("= 0.06914 V s/rad line-to-line =", "= 0.05987 N m/A peak = 0.08468 N m/A rms ="):
        assert words in result.out and words in result.page


def test_the_result_of_the_same_input_is_the_same(result):
    before = {path.name: path.read_bytes() for path in result.folder.iterdir()}
    command("tune", HURST, "--out", str(result.folder))
    assert {path.name: path.read_bytes() for path in result.folder.iterdir()} == before


# ---- without plots ---------------------------------------------------------------------------------------------------------
@pytest.fixture
def out(tmp_path, monkeypatch):
    names = ("current_loop", "speed_loop", "start", "torque", "current")
    monkeypatch.setattr("tuning.plots.draw", lambda design: dict.fromkeys(names, ""))
    return tmp_path / "result"


@pytest.fixture
def several(tmp_path, monkeypatch, out):
    """A folder of three motors; the one in the middle is for another board."""
    folder = tmp_path / "motors"
    folder.mkdir()
    for name, changes in (("a_first", ()), ("b_large", FOR_ANOTHER_BOARD), ("c_last", ())):
        with motor_path(*changes) as source:
            shutil.copy(source, folder / f"{name}.toml")
    monkeypatch.setattr(paths, "MOTORS", folder)
    monkeypatch.setattr(paths, "TUNED", tmp_path / "tune")
    return folder


def test_a_motor_by_its_name_or_path_and_the_command_that_makes_the_result_again(out):
    with motor_path() as path:
        for motor in (HURST, str(path)):
            code, _, error = command("tune", motor, "--out", str(out))
            assert (code, error) == (0, "")
            assert all(f"make tune MOTOR={motor}" in (out / name).read_text(encoding="utf-8") for name in ("report.html", "userparams.h"))


def test_an_unchanged_header_keeps_its_time(out):
    header = out / "userparams.h"
    command("tune", HURST, "--out", str(out), "--brief")
    os.utime(header, (1e9, 1e9))
    command("tune", HURST, "--out", str(out), "--brief")
    assert header.stat().st_mtime == 1e9
    header.write_text("old", encoding="utf-8")
    command("tune", HURST, "--out", str(out), "--brief")
    assert header.stat().st_mtime > 1.5e9


def test_brief_is_a_line_and_the_warnings(out):
    first, *others = command("tune", "anaheim_bly172s_24v_4000", "--out", str(out), "--brief")[1].splitlines()
    assert first.startswith("anaheim_bly172s_24v_4000: ") and all(line.startswith("  warning: ") for line in others)


@pytest.mark.parametrize("older", [False, True])
def test_a_refusal_writes_nothing_and_keeps_an_older_result(out, older):
    if older:
        command("tune", HURST, "--out", str(out), "--brief")
    before = sorted(out.parent.rglob("*"))
    with motor_path(("value = 2500", "value = 4000")) as path:
        refused(command("tune", str(path), "--out", str(out)), "are too low for 4000 rpm")
    assert sorted(out.parent.rglob("*")) == before and out.exists() == older


def test_a_folder_that_is_something_else_is_not_replaced(out):
    out.mkdir()
    (out / "precious").write_text("mine", encoding="utf-8")
    refused(command("tune", HURST, "--out", str(out)), "is not a result folder")
    assert (out / "precious").is_file()


@pytest.mark.parametrize("arguments, says", [
    (("tune", "no_such"), "no motor 'no_such'"), (("tune", "nowhere/motor.toml"), "no motor file"),
    (("tune", HURST, "--board", "no_such"), "no board 'no_such'"), (("tune",), "name one, or write --all"), (("tune", HURST, "--all"), "either a motor or --all"),
    (("tune", "--all", "--out", "x"), "one folder for several motors"), (("tun",), "command line"),
    (("tune", "--all", "--board", "no_such"), "no board 'no_such'"), (("motors", "--board", "no_such"), "no board 'no_such'")])
def test_mistakes_on_the_command_line(arguments, says):
    refused(command(*arguments), says)


@pytest.mark.parametrize("more", [(), ("--brief",)])
def test_one_motor_that_is_for_another_board_does_not_stop_the_others(several, more):
    code, text, error = command("tune", "--all", *more)
    assert (code, error.count("\n")) == (2, 1) and re.search(r"\Afoc33: half the rated torque needs .*b_large\.toml", error), error
    assert all(name in text and (paths.TUNED / name / "userparams.h").is_file() for name in ("a_first", "c_last"))
    assert not (paths.TUNED / "b_large").exists()


def test_all_problems_of_a_motor_and_its_board_come_in_one_run_each_with_its_file_and_line(tmp_path):
    changes = (("value = 5, source", "value = 5.5, source"), ("ohm phase", "ohms"), ("value = 2500", "value = 9e9"))
    with motor_path(*changes) as path:
        code, _, error = command("tune", str(path), "--brief")
        lines = error.splitlines()
    assert code == 2 and len(lines) == 3 and all(line.startswith("foc33: ") and "a_motor.toml line " in line for line in lines), error
    assert [word in line for word, line in zip(("pole_pairs", "'ohms'", "'speed'"), lines)] == [True] * 3
    text = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")
    board = tmp_path / "two_slips.toml"
    board.write_text(text.replace("value = 24.0", "value = 7").replace("value = 75", "value = 750"), encoding="utf-8")
    code, _, error = command("tune", "hurst_dmb0224c10002", "--board", str(board), "--brief")
    assert code == 2 and [key in line for key, line in zip(("'voltage' = 7 V", "'amplifier_gain' = 750"), error.splitlines())] == [True, True], error


def test_what_the_build_refuses_of_a_boards_numbers_names_the_board_file_and_a_motor_that_cannot_turn_has_all_its_reasons(tmp_path):
    text = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")
    board = tmp_path / "late.toml"
    board.write_text(text.replace("over_voltage = { value = 34", "over_voltage = { value = 47").replace("under_voltage = { value = 12", "under_voltage = { value = 7"),
                     encoding="utf-8")
    code, _, error = command("tune", "hurst_dmb0224c10002", "--board", str(board), "--brief")
    lines = error.splitlines()
    assert code == 2 and all("late.toml line " in line for line in lines), error
    assert {line.split(" = ")[0] for line in lines} == {"foc33: OVER_VOLTAGE_V", "foc33: UNDER_VOLTAGE_V"}
    with motor_path(("value = 5, source", "value = 31, source"), ("value = 5.5e-6", "value = 4e-7")) as path:
        code, _, error = command("tune", str(path), "--brief")
    assert code == 2 and [word in error for word in ("electrical rpm", "load observer")] == [True, True], error


@pytest.mark.parametrize("refuses", [True, False])
def test_make_motors_runs_those_that_got_a_header_and_hands_on_why_the_others_did_not(several, out, refuses):
    if not refuses:
        (several / "b_large.toml").unlink()
    with mock.patch.object(rating_sweep.Rated, "command", return_value=1) as runs:
        code, _, error = command("motors", "--out", str(out), "--quiet")
    (options,) = runs.call_args.args
    assert (code, error, options.motor, options.out, options.board) == (1, "", ["a_first", "c_last"], out, None)
    assert [name for name, why in options.refused.items() if why.startswith("half the rated torque needs")] == ["b_large"] * refuses


def test_a_motor_that_its_board_cannot_turn_is_a_row_with_its_reason_and_the_summary_says_that_not_all_holds(several, out):
    for name in ("a_first", "c_last"):
        (several / f"{name}.toml").unlink()
    code, text, error = command("motors", "--out", str(out), "--quiet")
    assert code == 1 and re.search(r"^b_large: not run: half the rated torque needs .*b_large\.toml", text, re.MULTILINE)
    assert "0 of 1 expectations hold" in text and re.fullmatch(r"foc33: rated: b_large: got half the rated torque needs .*\n", error)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert not summary["passed"] and list(summary["refused"]) == ["b_large"]


# ---- a motor's own board ---------------------------------------------------------------------------------------------------
@pytest.fixture
def own_board(several):
    """a_first names a board of 30 V beside it, c_last names none."""
    text = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8").replace("value = 24.0", "value = 30").replace("value = 27,", "value = 32,")
    (several.parent / "my_board.toml").write_text(text, encoding="utf-8")
    motor = several / "a_first.toml"
    motor.write_text("board = \"../my_board.toml\"\n" + motor.read_text(encoding="utf-8"), encoding="utf-8")
    (several / "b_large.toml").unlink()
    return several.parent / "my_board.toml"


def bus_v(name: str) -> float:
    return float(re.search(r"^#define NOMINAL_BUS_V (\S+)", (paths.TUNED / name / "userparams.h").read_text(encoding="utf-8"), re.MULTILINE)[1])


@pytest.mark.parametrize("more, folders, volts", [
    ((), ("a_first", "c_last"), (30.0, 24.0)), (("--board", "mclv"), ("a_first-mclv", "c_last-mclv"), (24.0, 24.0))])
def test_a_motor_is_tuned_for_the_board_that_its_file_names_unless_another_one_is_asked_for(own_board, more, folders, volts):
    assert command("tune", "--all", "--brief", *more)[0] == 0
    assert tuple(bus_v(folder) for folder in folders) == volts


def test_make_motors_runs_each_motor_on_its_board(own_board, out):
    taken = {}

    def stop(found, options):
        taken.update({motor.name: board.path.stem for motor, board, _ in found})
        raise UserError("that is enough")
    with mock.patch.object(rating_sweep, "built", stop):
        refused((*command("motors", "--out", str(out), "--quiet")[:1], "", "foc33: that is enough\n"))
    assert taken == {"a_first": "my_board", "c_last": "mclv"}


def test_a_board_that_is_not_there_is_told_with_the_line_of_the_motor_file(several):
    with motor_path(('title = "a motor"', 'title = "a motor"\nboard = "no_such"')) as path:
        refused(command("tune", str(path)), "no board 'no_such'", "a_motor.toml line 2")


def test_make_help_names_the_motor_that_is_taken_without_motor():
    makefile = (paths.ROOT / "Makefile").read_text(encoding="utf-8")
    default = re.search(r"tune_motor = .*\$\(or \$\(MOTOR\),(\w+)\)", makefile)[1]
    text = subprocess.run(["make", "help"], cwd=paths.ROOT, capture_output=True, text=True, check=True).stdout
    assert re.search(rf"make tune +.*\[MOTOR={default}\b", text)
    assert all(re.search(rf"make {name} +.*\[MOTOR=", text) for name in ("tune-fw", "identify", "userparams"))


def test_as_a_program():
    arguments = [sys.executable, "-m", "tuning", "tune", "no_such_motor"]
    done = subprocess.run(arguments, cwd=paths.ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "") and "foc33: no motor 'no_such_motor'" in done.stderr
