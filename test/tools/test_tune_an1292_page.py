"""docs/an1292-tuning.md: its commands print what it says, its rules are those of its scenarios, and its Python raises entries by the serial line."""

import io
import os
import re
import shlex
import subprocess
from contextlib import redirect_stdout
from multiprocessing import get_context

import numpy as np
import pytest
from support import LIBRARY

from tools.bench import command_common, scenario_file, simulate
from tools.bench.board import Library
from tools.common import board_file, motor_file, paths
from tools.live import board, lnet

PAGE = (paths.ROOT / "docs/an1292-tuning.md").read_text(encoding="utf-8")
MOTOR = paths.ROOT / "examples/an1292_motor.toml"
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", PAGE, re.DOTALL)
STEPS = [(first.strip(), second) for (_, first), (kind, second) in zip(BLOCKS, BLOCKS[1:]) if re.fullmatch(r"make \w+ [^\n]*\n", first) and not kind]
ENTRIES, CLOSED, NONE = range(18), 5, 0
RISE_A, MOST_A = 0.25, 2.70


# ---- what the commands print ---------------------------------------------------------------------------------------------
def same(told: str, printed: str) -> bool:
    """The same words, and numbers within 2 %, those with decimals within 0.05; `...` at the end stands for the rest."""
    words, got = told.split(), printed.split()
    if words[-1] == "...":
        words, got = words[:-1], got[:len(words) - 1]
    return len(words) == len(got) and all(map(_near, words, got))


def _near(word: str, got: str) -> bool:
    number = re.compile(r"[-+]?\d+(\.\d+)?")
    if number.sub("#", word) != number.sub("#", got):
        return False
    for a, b in zip(number.finditer(word), number.finditer(got)):
        if abs(float(a[0]) - float(b[0])) > max(0.02 * abs(float(a[0])), 0.05 if a[1] else 0.0):
            return False
    return True


@pytest.mark.parametrize("told, printed, is_same", [
    ("ok  speed 3396 (allowed: 1 .. 2)", "ok speed 3397  (allowed: 1 .. 2)", True), ("5", "6", False), ("speed 3396", "speed 3500", False),
    ("ok a", "FAIL a", False), ("a 1.5, ...", "a 1.5, b", True), ("a 1.5", "a 1.5 b", False), ("0.633", "0.7", False), ("-0.003", "0.01", True)])
def test_a_line_is_compared_by_its_words_and_nearly_by_its_numbers(told, printed, is_same):
    assert same(told, printed) == is_same


def test_the_page_goes_through_all_of_the_chapter():
    assert [command.split("=")[-1] for command, _ in STEPS] == [
        "examples/an1292_motor.toml", "open_loop", *(f"an1292_{name}" for name in ("sticks", "masked", "raise", "tuned", "inductance"))]
    assert re.findall(r"^\| (\d) \|", PAGE, re.MULTILINE) == list("1234567")


@pytest.mark.parametrize("command, told", STEPS, ids=[command for command, _ in STEPS])
def test_a_command_of_the_page_prints_its_lines(tmp_path, command, told):
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    done = subprocess.run(["make", "-s", *shlex.split(command)[1:], f"OUT={tmp_path}/out"], cwd=paths.ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    printed = done.stdout.splitlines()
    assert [line for line in told.splitlines() if not any(same(line, got) for got in printed)] == [], done.stdout
    assert "FAIL" not in done.stdout


def ran(name: str):
    """A scenario of the project, run to its end."""
    item = scenario_file.load(name)
    job = simulate.prepare(item, command_common.library_for(item.defines, None), motor_file.part(item.motor), board_file.part("mclv"))
    return simulate.simulate(job, lambda seconds: None)


def behind(run, rpm: float) -> float:
    """How far the shaft is behind the reference while it passes a speed."""
    row = int(np.argmax(run.trace.column("plant.speed_rpm") >= rpm))
    around = slice(row - 2000, row + 2000)
    return float((run.trace.column("fw.speed_ref_rpm")[around] - run.trace.column("plant.speed_rpm")[around]).mean())


def test_where_it_sticks_the_status_line_says_why_and_the_index_is_ahead_of_the_shaft():
    run, told = ran("an1292_sticks"), re.search(r"^state 5 fault NONE .*RAMP_WAITS.*$", PAGE, re.MULTILINE)[0]
    assert [line for line in run.sent.splitlines() if same(told, line)]
    end = run.trace.part(22.0, 23.0)
    shaft, ahead = (float(end.column(name).mean()) for name in ("plant.speed_rpm", "fw.speed_ref_rpm"))
    assert 100.0 * shaft / 5500.0 == pytest.approx(float(re.search(r"(\d+) % of the\s+goal", PAGE)[1]), abs=0.5)
    assert ahead - shaft == pytest.approx(float(re.search(r"waits (\d+) rpm ahead", PAGE)[1]), abs=10.0)
    assert (shaft - 2600.0) / 204.8 == pytest.approx(float(re.search(r"/ 204\.8 = ([\d.]+)`", PAGE)[1]), abs=0.06)
    from_rpm = float(re.search(r"From (\d+) rpm on the voltage is at its limit", PAGE)[1])
    assert behind(run, from_rpm - 100.0) < 10.0 and 25.0 < behind(run, from_rpm) < 80.0


# ---- its rules -----------------------------------------------------------------------------------------------------------
def table(values: dict[str, float]) -> list[float]:
    return [values[f"IDREF_SPEED{entry}"] for entry in ENTRIES]


def changes(name: str, stem: str = "IDREF_SPEED") -> list[tuple[float, dict[str, float]]]:
    return [(event.at_s, event.parameters) for event in scenario_file.load(name).events if any(key.startswith(stem) for key in event.parameters)]


def test_the_motor_file_the_scenarios_begin_with_example_5():
    tune = motor_file.load(str(MOTOR)).tune
    assert table(tune) == pytest.approx([-0.09 * entry for entry in ENTRIES], abs=1e-9)
    for name in ("sticks", "raise"):
        assert changes(f"an1292_{name}")[0] == (0.0, {key: value for key, value in tune.items()})
    assert changes("an1292_masked")[0] == (0.0, tune | {"FW_TRIM_CURRENT_A": Library(LIBRARY).params["FW_TRIM_CURRENT_A"]})


def test_the_scenario_raises_from_the_shaft_s_entry_on_and_the_finished_table_takes_the_next_one_s_values():
    run, ((_, first), *steps) = ran("an1292_raise"), changes("an1292_raise")
    now = table(first)
    for at_s, raised in steps:
        shaft = int((float(run.trace.part(at_s - 0.1, at_s).column("plant.speed_rpm").mean()) - 2600.0) / 204.8)
        assert list(raised) == [f"IDREF_SPEED{entry}" for entry in range(shaft, 18)]
        now = [value if entry < shaft else max(value - RISE_A, -MOST_A) for entry, value in enumerate(now)]
        assert list(raised.values()) == pytest.approx(now[shaft:], abs=1e-9)
    shifted = [now[0], *now[2:], now[-1]]
    for name in ("tuned", "inductance"):
        assert table(changes(f"an1292_{name}")[0][1]) == pytest.approx(shifted, abs=1e-9)


def test_the_build_refuses_the_entries_of_example_4_that_the_page_names():
    base = int(re.search(r"`NORM_INVKFIBASE` \((\d+)\)", PAGE)[1])
    example_4 = [7900, *range(8600, 17701, 700), 18500, 19200, 19750]
    first = next(entry for entry, value in enumerate(example_4) if value > 1.6 * base)
    assert f"so entries {first} to 17 of Example 4" in PAGE and "0.6 .. 1.6 of NORM_INVKFIBASE" in (paths.ROOT / "docs/parameters.md").read_text(encoding="utf-8")


# ---- on the board: the page's Python, at the serial line of a virtual one -----------------------------------------------------
def on_the_line(parts: board.Parts) -> None:
    live = board.LiveBoard(parts)
    live.run(0.2)
    for pressed in (1.0, 0.0):
        live.board.set("input.s2", pressed)
        live.run(0.1)
    live.run(20.0)
    live.board.uart_take()
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)[1].replace('Path("build/target/foc33.elf")', f"Path({str(parts.symbols)!r})")
    assert 'lnet.connect("/dev/ttyUSB0")' in code
    link = lnet.connect(board.BoardStream(live))
    code, told = code.replace('lnet.connect("/dev/ttyUSB0")', "link"), io.StringIO()
    for index, shaft, limits in ((5, 3, 57), (7, 5, 57), (9, 7, 57)):
        told.seek(told.truncate(0))
        with redirect_stdout(told):
            exec(code, {"link": link}) # pylint: disable=exec-used
        assert re.fullmatch(rf"qIndex {index} shaft's entry {shaft} rpm \d+ limits {limits}\n", told.getvalue()), told.getvalue()
        live.run(4.0)
    assert live.board.get("plant.speed_rpm") == pytest.approx(4759, abs=30)
    assert (live.board.get("fw.state"), live.board.get("fw.fault")) == (CLOSED, NONE) and not live.board.warnings()


def test_the_page_s_python_raises_the_entries_while_the_motor_turns(tmp_path):
    done = subprocess.run(["make", "-s", "tune", f"MOTOR={MOTOR}", f"OUT={tmp_path}/header"], cwd=paths.ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    parts = board.parts(defines="-DTUNING", userparams=str(tmp_path / "header"))
    process = get_context("fork").Process(target=on_the_line, args=(parts,))
    process.start()
    process.join()
    assert process.exitcode == 0
