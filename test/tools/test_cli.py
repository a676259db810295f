"""The command line with the real virtual board: exit codes, one line for each mistake, results complete or absent."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support import LIBRARY, SCENARIO, command, refused

from tools.bench import build, cli, command_common
from tools.bench.board import Library
from tools.bench.simulate import SIGNALS
from tools.common import motor_file, paths

START = """
[[event]]
at_s = 0.0
speed_rpm = 1000
[[event]]
at_s = 0.1
press = "S2"
[[measure]]
name = "waiting"
from_s = 1.9
to_s = 2.0
reference_rpm = 1000
[[expect]]
kind = "measure"
measure = "waiting"
value = "speed_rpm"
min = 900
"""

BAD = {
    "unknown plant key": ("[plant]\n\"motor.rs_om\" = 2\n", "unknown key 'motor.rs_om'", "did you mean 'motor.rs_ohm'?"),
    "impossible plant value": ("[plant]\n\"motor.rs_ohm\" = -2\n", "'motor.rs_ohm' = -2 is impossible", "choose"),
    "unknown key in an event": ("[[event]]\nat_s = 0.5\nset = { \"load.constnt_nm\" = 1 }\n", "unknown key 'load.constnt_nm'",
                                "load.constant_nm"),
    "impossible value in an event": ("[[event]]\nat_s = 0.5\nset = { \"input.pot\" = 2 }\n", "'input.pot' = 2 is impossible",
                                     "0 .. 1"),
    "speed that needs S3": ("[[event]]\nat_s = 0.5\nspeed_rpm = 5000\n", "speed_rpm = 5000 is impossible", "press S3"),
    "unknown signal": ("[[expect]]\nkind = \"signal\"\nsignal = \"fw.sped_est_rpm\"\nstatistic = \"max\"\nmax = 1\n",
                       "no signal 'fw.sped_est_rpm'", "did you mean 'fw.speed_est_rpm'?"),
    "unknown fault": ("[[expect]]\nkind = \"fault\"\nname = \"OVERVOLTS\"\nafter_s = 1\nwithin_s = 1\n", "no fault 'OVERVOLTS'",
                      "did you mean 'OVERVOLTAGE'?"),
    "unknown state": ("[[expect]]\nkind = \"state\"\nname = \"CLOSE\"\nat_s = 1\n", "no state 'CLOSE'", "did you mean 'CLOSED'?"),
    "speed in per cent beyond the header's": ("[[event]]\nat_s = 0.5\nspeed_percent = 5\n", "speed_percent = 5 (140 rpm) is impossible",
                                              "the header's speeds are 150 .. 5500 rpm"),
}


class Place:
    """A folder with a scenario in it, and the results' place."""

    def __init__(self, root: Path) -> None:
        self.root, self.out, self.path = root, root / "out", root / "test.toml"

    def run(self, text: str, *more: str) -> tuple[int, str, str]:
        self.path.write_text(SCENARIO + text, encoding="utf-8")
        return command("run", str(self.path), "--out", str(self.out), "--library", str(LIBRARY), "--no-plots", "--quiet", *more)

    def refused(self, result: tuple[int, str, str], *parts: str) -> None:
        refused(result, *parts)
        assert not self.out.exists() and not list(self.root.glob(".*"))

    def summary(self) -> dict:
        return json.loads((self.out / "summary.json").read_text(encoding="utf-8"))


@pytest.fixture
def place(tmp_path) -> Place:
    return Place(tmp_path)


# ---- refusals ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("text, parts", [(text, parts) for text, *parts in BAD.values()], ids=BAD)
def test_every_mistake_in_a_scenario_is_one_line_and_leaves_no_result(place, text, parts):
    place.refused(place.run(text), *parts, "line ")


@pytest.mark.parametrize("arguments, parts", [
    (["run", "dmeo"], ["no scenario 'dmeo'", "did you mean 'demo'"]), (["run", "no/such.toml"], ["no scenario file 'no/such.toml'"]),
    (["run", "demo", "--library", "no.so"], ["no library 'no.so'"]),
    (["run", "demo", "--library", "{}/wrong.so"], ["cannot load the virtual board"]),
    (["walk"], ["invalid choice: 'walk'"]), (["run", "--speed"], ["unrecognized arguments: --speed"]),
    (["starts", "--every-deg", "0", "--library", str(LIBRARY)], ["every-deg = 0 is impossible"]),
    *((["run", "demo", "--library", str(LIBRARY), *words], parts) for words, parts in (
        (["--motor", "no_such"], ["no motor 'no_such'", "--motor"]), (["--board", "no_such"], ["no board 'no_such'", "--board"]),
        (["--set", "motor.rs_ohm"], ["'motor.rs_ohm' is no change", "--set"]),
        (["--set", "motor.rs_ohm=big"], ["'motor.rs_ohm=big' is no change"]),
        (["--out", "{}/wrong.so/out"], ["cannot write to", "--out"]))),
    *(([*name, "--userparams", folder, *words], parts) for name in (["run", "demo"], ["table2"], ["starts"]) for folder, words, parts in (
        ("no/where", [], ["no userparams.h in 'no/where'", "--userparams"]),
        (".", ["--library", str(LIBRARY)], ["leave out --library or"])))])
def test_wrong_options_are_one_line(place, arguments, parts):
    (place.root / "wrong.so").write_text("no library", encoding="utf-8")
    out = [] if arguments[0] == "walk" or "--out" in arguments else ["--out", str(place.out)]
    place.refused(command(*(word.format(place.root) for word in arguments), *out), *parts)


def test_a_folder_that_holds_something_else_is_left_alone(place):
    place.out.mkdir()
    (place.out / "mine.txt").write_text("x", encoding="utf-8")
    refused(place.run(""), "is not a result folder")
    assert [path.name for path in place.out.iterdir()] == ["mine.txt"]


# ---- runs ----------------------------------------------------------------------------------------------------------------
def test_a_good_run_ends_with_zero_and_complete_results_the_same_to_the_last_digit_each_time(place):
    code, out, error = place.run(START)
    assert (code, error) == (0, "") and "1 of 1 expectations hold" in out
    assert re.search(r"simulated 2\.00 s of motor time in \d+\.\d+ s on one core "
                     r"\(\d+\.\d+ s of processor time\): \d+\.\d times real time", out)
    assert (place.summary()["passed"], place.summary()["measures"][0]["reference_rpm"]) == (True, 1000)
    first = (place.out / "trace.csv").read_bytes()
    assert first.count(b"\n") > 3900 and not list(place.root.glob(".*"))
    place.run(START)
    assert (place.out / "trace.csv").read_bytes() == first


@pytest.mark.parametrize("text, more, allowed",
                         [(START.replace("min = 900", "min = 5000"), [], "5000"), (START, ["--set", "load.locked=1"], "900")])
def test_a_failed_expectation_ends_with_one_and_names_the_row_and_the_numbers(place, text, more, allowed):
    code, out, error = place.run(text, *more)
    assert code == 1 and "FAIL  waiting: speed_rpm" in out and not place.summary()["passed"]
    assert re.fullmatch(rf"foc33: test: waiting: speed_rpm: got \S+, allowed at least {allowed}\n", error)


def test_the_report_tells_motor_and_header_and_says_if_they_do_not_belong_together(place):
    own = place.root / "other"
    own.mkdir()
    text = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
    (own / "userparams.h").write_text(re.sub(r"(#define MOTOR_RS_OHM) \S+", r"\1 2.0", text), encoding="utf-8")
    place.path.write_text(SCENARIO + START, encoding="utf-8")
    arguments = ["run", str(place.path), "--out", str(place.out), "--no-plots", "--quiet"]
    try:
        code, out, error = command(*arguments, "--userparams", str(own))
    finally:
        shutil.rmtree(paths.ROOT / "build" / f"host-{build.variant_name([], own)}", ignore_errors=True)
    assert (code, error) == (0, "")
    assert "\nmotor   tuning/motors/hurst_dmb0224c10002.toml: Hurst DMB0224C10002\n" in out
    assert f"\nheader  {paths.shown(own)}/userparams.h\nnote    the header is for another motor: MOTOR_RS_OHM is 2 ohm" in out
    assert (place.summary()["header"], place.summary()["motor"]) == (f"{paths.shown(own)}/userparams.h", "tuning/motors/hurst_dmb0224c10002.toml")
    assert "\nheader  userparams.h\n\n" in command(*arguments)[1]


def test_a_scenario_in_per_cent_follows_the_motor_file(place):
    text = START.replace("speed_rpm = 1000", "speed_percent = 50", 1).replace("reference_rpm = 1000", "reference_percent = 50")
    code, _, error = place.run(text)
    assert (code, error) == (0, "")
    assert place.summary()["measures"][0]["reference_rpm"] == 0.5 * motor_file.load("hurst_dmb0224c10002").rated_speed_rpm


def test_an_ended_run_leaves_neither_results_nor_processes(place):
    place.path.write_text(SCENARIO.replace("2.0", "120.0"), encoding="utf-8")
    line = [sys.executable, "-m", "tools.bench", "run", str(place.path), "--out", str(place.out), "--library", str(LIBRARY)]
    process = subprocess.Popen(line, cwd=paths.ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline and not list(place.root.glob(".out-unfinished*")):
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    _, error = process.communicate(timeout=20)
    assert (process.returncode, error) == (130, "foc33: interrupted, nothing was written\n")
    assert [item.name for item in place.root.iterdir()] == ["test.toml"]
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


# ---- lists ---------------------------------------------------------------------------------------------------------------
def test_the_list_of_scenarios_has_a_line_for_each_and_keys_has_unit_and_range_of_the_board_s_keys():
    code, out, _ = command("scenarios")
    assert (code, [line.split()[0] for line in out.splitlines()]) == (0, paths.names(paths.SCENARIOS))
    code, out, _ = command("keys", "--library", str(LIBRARY))
    assert code == 0 and re.search(r"(?m)^motor\.rs_ohm +ohm +\S+ \.\. \S+ +\w", out)


@pytest.mark.parametrize("name", ["run", "table2", "starts", "rated", "loadsteps", "lowspeed", "catch", "pulse", "held", "robust", "scenarios", "motors", "keys"])
def test_every_command_explains_itself(name, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main([name, "--help"])
    assert (ended.value.code, "usage:" in capsys.readouterr().out) == (0, True)


# ---- a header for another motor ------------------------------------------------------------------------------------------
VALUES = {"motor.pole_pairs": 5.0, "motor.rs_ohm": 2.67, "motor.ld_h": 1.8e-3, "motor.lq_h": 2.0e-3, "motor.psi_vs": 7.983e-3}
PARAMS = {"NOPOLESPAIRS": 5.0, "MOTOR_RS_OHM": 2.67, "MOTOR_LS_MH": 1.92, "MOTOR_KPHI_V_PER_KRPM": 7.24}


@pytest.mark.parametrize("changes, text", [
    ({}, ""), ({"MOTOR_LS_MH": 1.8}, ""), ({"MOTOR_LS_MH": 2.0}, ""), # a salient motor's header may hold either inductance
    ({"NOPOLESPAIRS": 4.0}, "NOPOLESPAIRS is 4 pairs, the motor's is 5"),
    ({"MOTOR_RS_OHM": 2.6}, "MOTOR_RS_OHM is 2.6 ohm, the motor's is 2.67"),
    ({"MOTOR_LS_MH": 2.1}, "MOTOR_LS_MH is 2.1 mH, the motor's is 1.9"),
    ({"MOTOR_KPHI_V_PER_KRPM": 7.0}, "MOTOR_KPHI_V_PER_KRPM is 7 V peak/krpm, the motor's is 7.24"),
    ({"NOPOLESPAIRS": 2.0, "MOTOR_RS_OHM": 1.0}, "NOPOLESPAIRS is 2 pairs, the motor's is 5; MOTOR_RS_OHM is 1 ohm, the motor's is 2.67")])
def test_each_number_of_another_motor_is_named(changes, text):
    assert command_common.header_note(VALUES, PARAMS | changes) == (text and f"the header is for another motor: {text}")


def test_the_firmware_tells_parameters_states_and_faults_and_has_every_usual_signal():
    library = Library(LIBRARY)
    assert library.faults[0] == "NONE" and {"RAMP", "CLOSED", "STOPPING", "STOPPED", "FAULT"} <= set(library.states.values())
    assert library.params["NOMINAL_SPEED_RPM"] > library.params["MINIMUM_SPEED_RPM"]
    assert set(SIGNALS) <= set(library.keys)
