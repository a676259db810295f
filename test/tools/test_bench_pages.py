"""The pages for the bench: their sums, what they promise of wires and variables, on the virtual board; their scenarios run."""

import math
import re
import subprocess

import numpy as np
import pytest
from support import LIBRARY, command
from test_pages import pages

from tools.bench import build
from tools.bench.board import Board, Library
from tools.common import paths, workers

PAGES = {page: text for page, text in pages().items() if page.startswith("docs/")}
FULL_SCALE_A = 4.4
GCC = ["gcc", "-std=gnu99", "-Itools/cpu_host", "-Iinclude", "-I."]


def header() -> dict[str, float]:
    """The project's own header, and AN1292's U0."""
    values = dict(Library(LIBRARY).params)
    return values | {"U0": values["NOMINAL_BUS_V"] / math.sqrt(3.0) * (1.0 - values["DEADTIME_SEC"] / values["LOOPTIME_SEC"]) / 32768.0}


def calculated(text: str, values: dict[str, float]) -> float:
    assert re.fullmatch(r"[\w\s.+*/()-]+", text), text
    return eval(text, {"__builtins__": {}}, values)


# ---- numbers -------------------------------------------------------------------------------------------------------------
SUM = re.compile(r"`([^`=\n]*[\d\w] [*/] [^`=\n]*) = (-?[\d.e-]+)`")
SUMS = [(page, left, right) for page, text in PAGES.items() for left, right in SUM.findall(text)]


@pytest.mark.parametrize("page, left, right", SUMS, ids=[f"{page} {left}" for page, left, _ in SUMS])
def test_every_sum_on_a_page_is_right_to_its_last_digit(page, left, right):
    last = 10.0 ** -len(right.partition(".")[2])
    assert calculated(left, header()) == pytest.approx(float(right), abs=0.51 * last)


def test_the_pages_that_calculate_have_their_sums_here():
    assert {"docs/wiring.md", "docs/calibration.md", "docs/mplabx.md"} <= {page for page, _, _ in SUMS} and len(SUMS) >= 10


def test_every_variable_that_a_page_names_is_one_that_a_debugger_finds():
    pattern = r"`((?:board_drive|board_params|[A-Z]\w+Parm)(?:\.\w+(?:\[\d+\])?)+|Snap(?:Buf\d|Start|Done))`"
    names = sorted({name for text in PAGES.values() for name in re.findall(pattern, text)})
    lines = [f"    (void)sizeof({name});" for name in names if not name.startswith("IdentifyParm")]
    source = '#include "board/firmware.h"\n#include "board/watch.h"\nint main(void)\n{\n' + "\n".join(lines) + "\n    return 0;\n}\n"
    done = subprocess.run([*GCC, "-DSNAPSHOT", "-fsyntax-only", "-xc", "-"], input=source, cwd=paths.ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert {"board_params.fieldweak.idref_q13[3]", "ParkParm.qIq", "SnapBuf1"} <= set(names)


# ---- a board in a process of its own ----------------------------------------------------------------------------------------
def looked_at(job, tell) -> dict:
    """Starts the drive, waits, and gives the means and RMS values of signals and variables over a second."""
    library = Library(job["library"])
    board = Board(library)
    for key, value in job.get("keys", {}).items():
        board.set(key, value)
    board.power_up()
    board.run(4000)
    for at_s, key, value in [(0.2, "input.s2", 1.0), (0.3, "input.s2", 0.0), *job.get("events", [])]:
        board.run(max(0, round((at_s - board.get("time_s")) / 50e-6)))
        board.set(key, value)
    board.run(max(0, round((job.get("at_s", 3.0) - board.get("time_s")) / 50e-6)))
    board.trace_start(job["signals"], 1)
    seen = []
    for _ in range(200):
        board.run(97) # no multiple of anything
        seen.append([value for name, count in job.get("variables", {}).items() for value in board.variable(name, count)])
    return {"trace": board.trace_take().astype(float), "seen": np.array(seen, dtype=float), "faults": library.faults}


def look(*jobs: dict) -> list[dict]:
    return workers.run_all(list(jobs), looked_at, lambda seconds: None)


def amplitude(column: np.ndarray) -> float:
    return math.sqrt(2.0) * float(column.std())


# ---- calibration ---------------------------------------------------------------------------------------------------------
SINES = {"signals": ["plant.i_a", "plant.i_b", "fw.bus_v", "bus.voltage_v"], "variables": {"ParkParm": 7}}


def test_the_probe_and_the_count_give_the_amplifier_s_true_scale():
    library, shares = build.library(["OPEN_LOOP_FUNCTIONING"]), (1.0, 0.9, 1.07)
    for share, done in zip(shares, look(*({"library": library, "keys": {"shunt.gain_v_per_a": 0.375 * share}, **SINES} for share in shares))):
        count = done["seen"][:, 3].mean()
        assert count == pytest.approx(10500, rel=2e-3)
        assert amplitude(done["trace"][:, 0]) / count == pytest.approx(FULL_SCALE_A / share / 32768.0, rel=3e-3)


def test_the_ratio_of_the_amplitudes_gives_phase_b_s_gain(tmp_path):
    text = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
    (tmp_path / "wrong_b").mkdir()
    (tmp_path / "wrong_b/userparams.h").write_text(re.sub(r"(#define KCURRB) -0.5", r"\1 -0.46", text), encoding="utf-8")
    done = look({"library": build.library(["OPEN_LOOP_FUNCTIONING"], tmp_path / "wrong_b"), **SINES})[0]
    assert -0.46 * amplitude(done["trace"][:, 1]) / amplitude(done["trace"][:, 0]) == pytest.approx(-0.5, rel=0.01) # from 8 % off: once more, and it is gone


def test_the_voltmeter_and_the_count_give_the_bus_divider():
    done = look({"library": LIBRARY, "keys": {"adc.vbus_ratio": 18.0}, **SINES, "at_s": 0.3})[0]
    count = done["trace"][:, 2].mean() / header()["BUS_FULL_SCALE_V"] * 32768.0
    assert done["trace"][:, 3].mean() * 32768.0 / count / 3.3 == pytest.approx(18.0, rel=2e-3)


# ---- wires and supply ----------------------------------------------------------------------------------------------------
CURRENTS = {"a": "i_alpha", "b": "(-0.5 * i_alpha + 0.866 * i_beta)", "c": "(-0.5 * i_alpha - 0.866 * i_beta)"}


def turned(folder, legs: str, sensed: str, sign: str = "-") -> tuple[float, int]:
    """Speed and fault at the end of examples/turn_motor.c whose legs feed these phases, with the current signals of these phases."""
    text = (paths.ROOT / "examples/turn_motor.c").read_text(encoding="utf-8")
    for phase, leg in enumerate(legs.index(name) for name in "abc"):
        text, count = re.subn(rf"acting\[{phase}\] = P1DC\d;", f"acting[{phase}] = P1DC{leg + 1};", text)
        assert count == 1
    for number in (1, 2):
        current = CURRENTS[sensed[number - 1]]
        text, count = re.subn(rf"ADC1BUF{number} = converter\(.*\);", f"ADC1BUF{number} = converter(0.5 {sign} {current} / 8.8);", text)
        assert count == 1
    text = text.replace("    return fabs(rpm", '    printf("end %.1f %u\\n", rpm, (unsigned)board_drive.fault);\n    return fabs(rpm')
    (folder / "swapped.c").write_text(text, encoding="utf-8")
    subprocess.run([*GCC, folder / "swapped.c", "build/host/libfirmware.a", "-lm", "-o", folder / "swapped"], cwd=paths.ROOT, check=True)
    said = subprocess.run([folder / "swapped"], capture_output=True, text=True, check=False).stdout
    speed, fault = re.search(r"end (\S+) (\d+)", said).groups()
    return float(speed), int(fault)


@pytest.mark.parametrize("legs, rpm", [("abc", 1473), ("bca", 1473), ("cab", 1473), ("acb", -1473), ("bac", -1473), ("cba", -1473)])
def test_exchanged_motor_wires_change_the_direction_and_nothing_else(tmp_path, legs, rpm):
    speed, fault = turned(tmp_path, legs, legs)
    assert fault == 0 and speed == pytest.approx(rpm, abs=2.0)


@pytest.mark.parametrize("legs, sensed, sign", [("abc", "ba", "-"), ("acb", "ab", "-"), ("bac", "ab", "-"), ("abc", "ab", "+")])
def test_exchanged_signals_or_a_wrong_sign_end_in_over_current(tmp_path, legs, sensed, sign):
    speed, fault = turned(tmp_path, legs, sensed, sign)
    assert (Library(LIBRARY).faults[fault], round(speed)) == ("OVERCURRENT_SW", 0)


def test_an_open_wire_ends_in_the_faults_that_the_page_names():
    start = {"library": LIBRARY, "keys": {"fault.open_phase": 2.0}, "signals": ["fw.fault"]}
    running = {"library": LIBRARY, "keys": {"input.pot": 0.3}, "signals": ["fw.fault"], "events": [(2.5, "load.constant_nm", 0.03), (3.0, "fault.open_phase", 1.0)], "at_s": 4.0}
    found = [done["faults"][int(done["trace"][-1, 0])] for done in look(start, running)]
    assert found == ["START_FAILED", "OPEN_PHASE"]


SUPPLY = {"open loop at 1.41 A": {"library": ["OPEN_LOOP_FUNCTIONING"]},
          "2500 rpm, 0.05 N·m": {"events": [(0.3, "input.pot", (2500 - 150) / (2800 - 150)), (3.0, "load.constant_nm", 0.05)], "at_s": 4.0},
          "5500 rpm, no load": {"events": [(0.4, "input.pot", 1.0), (3.0, "input.s3", 1.0), (3.1, "input.s3", 0.0)], "at_s": 5.0}}


def test_the_supply_gives_what_the_table_and_the_formula_say():
    rows = dict(re.findall(r"^\| ([^|]*) \| [\d.]+ A \| ([\d.]+) A \|$", PAGES["docs/wiring.md"], re.MULTILINE))
    jobs = [{"signals": ["supply.current_a", "plant.i_d", "plant.i_q", "plant.torque_nm", "plant.speed_rpm"], **job,
             "library": build.library(job["library"]) if "library" in job else LIBRARY} for job in SUPPLY.values()]
    for name, done in zip(SUPPLY, look(*jobs)):
        drawn, i_d, i_q, torque, rpm = done["trace"].mean(axis=0)
        formula = (1.5 * 2.67 * (i_d ** 2 + i_q ** 2) + torque * 2.0 * math.pi * rpm / 60.0) / 24.0 + 0.05
        assert (float(rows[name]), formula) == (pytest.approx(drawn, abs=0.01), pytest.approx(drawn, rel=0.06)), (name, drawn, formula)


# ---- variables -----------------------------------------------------------------------------------------------------------
def members() -> dict[str, list[str]]:
    """The variables of watch.h with their members."""
    text = (paths.ROOT / "include/board/watch.h").read_text(encoding="utf-8")
    return {name: [member for line in re.findall(r"int16_t ([^;]*);", body) for member in line.split(", ")]
            for body, name in re.findall(r"typedef struct \{([^}]*)\} t(\w+Parm);", text)}


def test_the_watch_table_turns_counts_into_the_units_of_the_virtual_board():
    rows = re.findall(r"^\| `(\w+)\.(\w+)` \| [^|]* \| `([^`]*)`[^|]* \| `(fw\.\w+)` \|$", PAGES["docs/mplabx.md"], re.MULTILINE)
    known, values = members(), header()
    variables = {name: len(known[name]) for name in dict.fromkeys(row[0] for row in rows)}
    done = look({"library": LIBRARY, "signals": [row[3] for row in rows], "variables": variables, "at_s": 5.0,
                 "events": [(0.4, "input.pot", 0.5), (3.0, "input.s3", 1.0), (3.1, "input.s3", 0.0), (4.0, "load.constant_nm", 0.02)]})[0]
    columns = [f"{name}.{member}" for name in variables for member in known[name]]
    assert len(rows) >= 15
    for number, (name, member, formula, signal) in enumerate(rows):
        told = np.array([calculated(formula, values | {"x": count}) for count in done["seen"][:, columns.index(f"{name}.{member}")]])
        true = done["trace"][:, number]
        if "deg" in signal:
            true = (true + 180.0) % 360.0 - 180.0
        rms = [math.sqrt(float(np.mean(part * part))) for part in (told, true)]
        assert rms[0] == pytest.approx(rms[1], rel=0.04, abs=0.02), (name, member, rms)
    assert done["trace"][:, [row[3] for row in rows].index("fw.i_d_a")].mean() < -0.5, "field weakening, so that no current is nothing"


def test_mplab_x_has_the_box_for_macros_that_the_page_names():
    assert '<property key="preprocessor-macros" value="" />' in (paths.ROOT / "firmware.X/nbproject/configurations.xml").read_text(encoding="utf-8")


# ---- scenarios -----------------------------------------------------------------------------------------------------------
BLOCKS = re.findall(r"```toml\n(.*?)```", PAGES["docs/scenarios.md"], re.DOTALL)


@pytest.mark.parametrize("text", BLOCKS, ids=[re.search('title = "(.*)"', text)[1] for text in BLOCKS])
def test_every_scenario_of_the_page_holds(tmp_path, text):
    (tmp_path / "my.toml").write_text(text, encoding="utf-8")
    code, out, error = command("run", str(tmp_path / "my.toml"), "--out", str(tmp_path / "out"), "--no-plots", "--quiet")
    assert (code, error) == (0, ""), out


def test_the_order_of_the_first_day_leads_through_all_pages_for_the_bench():
    linked = set(re.findall(r"\]\((\w+\.md)", PAGES["docs/bench.md"]))
    assert {"wiring.md", "compiler.md", "flashing.md", "calibration.md", "mplabx.md", "tuning.md", "faults.md"} <= linked
