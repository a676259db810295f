"""Running a scenario: what is set when, what is recorded, and what the processes around it do."""

import faulthandler
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from support import FAULTS, LIBRARY, SCENARIO, STATES, refusal, scenario

from tools.bench import command_common, long_run, simulate
from tools.bench import scenario as scenario_module
from tools.common import board_file, motor_file, paths, workers
from tools.common.errors import UserError
from tools.bench.panel import Ranges, plan

RANGES = Ranges(500.0, 2800.0, 5500.0, 2.75, False, False)


class FakeBoard:
    """A board that only remembers: every call with the time at which it came."""

    def __init__(self, period_s: float = 50e-6) -> None:
        self.period_s = period_s
        self.periods = 0
        self.traced = 0
        self.calls: list[tuple] = []
        self.values = {"supply.voltage_v": 24.0}

    def now(self) -> float:
        return round(self.periods * self.period_s, 7)

    def set(self, key, value):
        self.values[key] = value
        self.calls.append((self.now(), key, value))

    def get(self, key):
        return self.now() if key == "time_s" else self.values[key]

    def power_up(self):
        self.calls.append((self.now(), "power_up"))

    def run(self, periods):
        assert 0 < periods <= simulate.CHUNK_PERIODS
        self.periods += periods

    def trace_start(self, names, decimation):
        self.columns = len(names)

    def trace_take(self):
        rows = np.arange(self.traced, self.periods, dtype=np.float32)
        self.traced = self.periods
        return np.repeat(rows[:, None], self.columns, axis=1)

    def uart_take(self):
        return ""

    def write_variable(self, name, value):
        self.calls.append((self.now(), name, value))

    def write_parameter(self, name, value):
        self.calls.append((self.now(), name, value))

    def variable(self, name, count):
        return [7] * count

    def warnings(self):
        return []


class FakeLibrary:
    states, faults, params = STATES, FAULTS, {}


def simulated(text: str, board: FakeBoard, values=None):
    item = scenario(text)
    job = simulate.Job(item, None, values or {}, plan(item, RANGES, {}), ["plant.speed_rpm"], {"SnapBuf1": 3})
    seconds = []
    result = simulate.simulate_on(job, FakeLibrary, board, seconds.append)
    return result, sum(seconds)


def test_events_happen_at_their_period_and_are_in_the_protocol_once():
    board = FakeBoard()
    result, _ = simulated("[[event]]\nat_s = 0.5\npress = \"S2\"\n", board)
    assert {(0.5, "input.s2", 1.0), (0.6, "input.s2", 0.0)} <= set(board.calls)
    assert result.actions == [(0.0, "power-up"), (0.5, "S2 pressed")]


def test_events_at_zero_are_in_place_before_power_up_and_the_shaft_starts_where_the_scenario_says_and_the_bus_at_the_supply():
    board = FakeBoard()
    simulated("[[event]]\nat_s = 0.0\npot = 0.25\n[[event]]\nat_s = 0.1\npot = 0.5\n", board)
    calls = [call for call in board.calls if call[1] in ("input.pot", "power_up")]
    assert calls == [(0.0, "input.pot", 0.25), (0.0, "power_up"), (0.1, "input.pot", 0.5)]
    simulated("[start]\nrotor_deg = 75\nspeed_rpm = -300\n", board, {"supply.voltage_v": 20.0})
    assert [board.values[key] for key in ("state.theta_e_deg", "state.speed_rpm", "bus.voltage_v")] == [75.0, -300.0, 20.0]


def test_every_period_is_recorded_once_with_its_time():
    result, seconds = simulated("", FakeBoard())
    assert len(result.trace) == 40000 and np.array_equal(result.trace.column("plant.speed_rpm"), np.arange(40000))
    assert np.allclose(result.trace.time_s, (np.arange(40000) + 1) * 50e-6, atol=1e-9)
    assert seconds == pytest.approx(2.0)


def test_a_long_recording_keeps_every_third_row_then_every_ninth_and_never_more_than_it_may():
    whole = simulated("", FakeBoard())[0].trace
    job = simulate.Job(scenario(), None, {}, [], ["plant.speed_rpm"])
    session = simulate.Session(job, FakeLibrary, FakeBoard(), lambda seconds: None, most=5000)
    session.run_to_end()
    thin = session.run().trace
    assert (thin.step, len(thin)) == (9, 4445)
    assert np.array_equal(thin.data, whole.data[:, ::9]) and np.array_equal(thin.time_s, whole.time_s[::9])
    assert (thin.part(0.5, 1.0).step, thin.thinned(2).step) == (9, 18)


@pytest.mark.parametrize("values, said", [
    ({}, "about 2480 s of it are ramps of the speed, SPEEDREFRAMP_RPM_PER_S = 2.5 in the header: raise it"),
    ({"SPEEDREFRAMP_RPM_PER_S": 1000.0}, "about 2989 s of it are its own waits and stretches: change the times of "),
    ({"SPEEDREFRAMP_RPM_PER_S": 1000.0, "SPEED_BANDWIDTH_HZ": 0.004}, "about 2500 s of it is for the speed to settle, SPEED_BANDWIDTH_HZ = 0.004 in the header"),
    ({"SPEEDREFRAMP_RPM_PER_S": 1000.0, "LOCK_TIME": 6e7}, "about 3000 s of it are starts, in the header LOCK_TIME: lower it")])
def test_a_long_run_names_what_takes_most_of_it_and_the_key_to_change(values, said):
    item = scenario("[[event]]\nat_s = 0.0\nspeed_rpm = 3200\n[[event]]\nat_s = 0.1\npress = \"S2\"\n[[event]]\nat_s = 1.5\nspeed_rpm = 6300\n")
    params = {"SPEEDREFRAMP_RPM_PER_S": 2.5, "SPEED_BANDWIDTH_HZ": 2.0, "END_SPEED_RPM": 100.0, "LOCK_TIME": 4000.0, "LOOPTIME_SEC": 50e-6,
              "NOPOLESPAIRS": 5.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 10.0}
    told = long_run.reason(replace(item, duration_s=3000.0), params | values)
    assert said in told and (" waits " not in told or told.endswith("test.toml"))
    sweeps_own = long_run.reason(replace(item, events=[replace(event, where="tables/x.toml") for event in item.events], duration_s=9000.0), params)
    assert sweeps_own.endswith("its own waits and stretches: change the times of tables/x.toml")


def test_a_slow_speed_loop_has_as_much_more_time_after_a_load_s_step_as_after_a_change_of_speed():
    params = {"SPEEDREFRAMP_RPM_PER_S": 3000.0, "SPEED_BANDWIDTH_HZ": 10.0, "LOAD_BANDWIDTH_HZ": 1.0, "END_SPEED_RPM": 1000.0, "LOCK_TIME": 4000.0,
              "LOOPTIME_SEC": 50e-6, "NOPOLESPAIRS": 5.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 1000.0}
    start = '[[event]]\nat_s = 0.0\nspeed_rpm = 2000\n[[event]]\nat_s = 0.1\npress = "S2"\n'
    changes = {what: scenario(f"{start}[[event]]\nat_s = 1.9\n{what}\n") for what in ("speed_rpm = 2000", "set = { load.constant_nm = 0.01 }")}
    for what, item in changes.items():
        quick, slow = (scenario_module.stretched(item, params | {"SPEED_BANDWIDTH_HZ": hz}).duration_s for hz in (10.0, 0.5))
        assert slow - quick == pytest.approx(2.0 * (scenario_module.SETTLE_PERIODS / 0.5 - scenario_module.SETTLE_S)), what


def test_a_long_run_says_so_before_it_begins_and_its_whole_report_takes_little_memory(tmp_path):
    """Three million rows: their recording alone has 0.36 GB, and was there four times over."""
    text = (paths.MOTORS / "hurst_dmb0224c10002.toml").read_text(encoding="utf-8")
    (tmp_path / "flywheel.toml").write_text(text + '[load]\ninertia = { value = 1, unit = "kg m2" }\nstart_torque = { value = 0.01, unit = "N m" }\n', encoding="utf-8")
    events = "".join(f"[[event]]\nat_s = {at_s}\n{what}\n" for at_s, what in (
        (0.0, "speed_percent = 96"), (0.1, 'press = "S2"'), (50.0, "speed_percent = 25"), (60.0, "speed_percent = 96"), (70.0, "speed_percent = 25")))
    scenario_text = SCENARIO.replace("duration_s = 2.0", "duration_s = 75\nfollows_header = true") + events
    (tmp_path / "long.toml").write_text(scenario_text, encoding="utf-8")
    with (tmp_path / "said").open("w", encoding="utf-8") as said:
        process = subprocess.Popen([sys.executable, "-m", "tools.bench", "run", tmp_path / "long.toml", "--library", LIBRARY, "--quiet",
                                    "--motor", tmp_path / "flywheel.toml", "--out", tmp_path / "out"], cwd=paths.ROOT, stdout=subprocess.DEVNULL, stderr=said)
        _, status, used = os.wait4(process.pid, 0) # the largest of it and its processes
    told = (tmp_path / "said").read_text(encoding="utf-8")
    assert (status, told.count("\n")) == (0, 1) and re.match(r"foc33: long: 161 s of motor time; about \d\d s of it is a rotor that only friction slows", told), told
    assert used.ru_maxrss < 600_000 and "its trace has one period of 3<" in (tmp_path / "out/index.html").read_text(encoding="utf-8")
    assert 90_000 < sum(1 for _ in (tmp_path / "out/trace.csv").open(encoding="utf-8")) < 110_000 # a thirtieth


def test_a_wrong_pwm_period_still_ends_at_the_right_time():
    board = FakeBoard(period_s=100e-6)
    simulated("[[event]]\nat_s = 1.0\npot = 0.5\n", board)
    assert board.now() == pytest.approx(2.0, abs=0.2)


def test_variables_are_written_and_read():
    board = FakeBoard()
    result, _ = simulated("[[event]]\nat_s = 0.5\ndebug = { SnapStart = 1 }\n", board)
    assert (0.5, "SnapStart", 1) in board.calls and result.variables == {"SnapBuf1": [7, 7, 7]}


PARAMETERS = "[[event]]\nat_s = 0.0\nparameter = { FW_TRIM_CURRENT_A = 0 }\n[[event]]\nat_s = 0.5\nparameter = { IDREF_SPEED5 = [-0.7, -0.8] }\n"


def prepared(text: str, *defines: str, **parameters: float) -> simulate.Job:
    item = scenario(text)
    return simulate.prepare(item, command_common.library_for(list(defines), None), motor_file.part(item.motor), board_file.part("mclv"), parameters=parameters)


def test_parameters_change_at_their_time_and_those_of_time_0_when_the_firmware_begins():
    job, board = prepared(PARAMETERS, "TUNING"), FakeBoard()
    simulate.simulate_on(job, FakeLibrary, board, lambda seconds: None)
    names = ("power_up", "FW_TRIM_CURRENT_A", "IDREF_SPEED5", "IDREF_SPEED6")
    assert [call for call in board.calls if call[1] in names] == [
        (0.0, "power_up"), (0.0, "FW_TRIM_CURRENT_A", 0.0), (0.5, "IDREF_SPEED5", -0.7), (0.5, "IDREF_SPEED6", -0.8)]
    # what a sweep asks for counts more than the scenario's own, and the run tells what was used
    assert prepared(PARAMETERS, "TUNING", FW_TRIM_CURRENT_A=1.0).parameters == {"FW_TRIM_CURRENT_A": 1.0}


@pytest.mark.parametrize("text, defines, parts", [
    (PARAMETERS, (), ["FW_TRIM_CURRENT_A cannot change while this firmware runs", "line 8", "add PARAMS_IN_RAM"]),
    (PARAMETERS.replace("FW_TRIM_CURRENT_A", "LOCK_TIME").replace("= 0 }", "= 2000 }"), ("PARAMS_IN_RAM",), ["LOCK_TIME cannot change", "set others in userparams.h"]),
    (PARAMETERS.replace("-0.8", "-2.8"), ("PARAMS_IN_RAM",), ["IDREF_SPEED6 = -2.8 exceeds MAXIMUM_CURRENT_A", "line 11", "2.75 A at most"]),
    (PARAMETERS.replace("CURRENT_A = 0", "CURRENT_A = 3"), ("PARAMS_IN_RAM",), ["FW_TRIM_CURRENT_A = 3 exceeds MAXIMUM_CURRENT_A"])])
def test_what_this_firmware_cannot_change_is_refused_before_the_run(text, defines, parts):
    refusal(lambda: prepared(text, *defines), *parts)


# ---- processes -----------------------------------------------------------------------------------------------------------
def late_for_small(job, report):
    report(1.0)
    time.sleep(0.05 if job == 0 else 0.0)
    return job


def refuse(job, report):
    raise UserError("no such thing", f"job {job}", "think again")


def crash(job, report):
    faulthandler.disable()  # its lines about this crash are not wanted
    os.abort()


def killed(job, report):
    os.kill(os.getpid(), signal.SIGKILL)


def full_disk(job, report):
    raise OSError(28, "No space left on device")


def own_process(job, report):
    return os.getpid()


def test_results_come_in_the_order_of_the_jobs_and_the_progress_of_all_arrives():
    seconds = []
    assert workers.run_all([0, 1, 2, 3], late_for_small, seconds.append, processes=2) == [0, 1, 2, 3]
    assert seconds == [1.0] * 4


def test_every_job_has_a_process_of_its_own():
    assert len({os.getpid(), *workers.run_all([0] * 5, own_process, print, processes=2)}) == 6


@pytest.mark.parametrize("work, line", [(refuse, "no such thing, job 1: think again"), (crash, "the simulation ended by itself, exit code -6"),
                                        (killed, "the simulation was killed, most often for want of memory: close other programs")])
def test_a_refusal_or_a_crash_in_a_process_is_one_line_here_and_no_endless_wait(work, line):
    refusal(lambda: workers.run_all([1], work, print), line)


def test_a_full_disk_in_a_process_is_one_here():
    with pytest.raises(OSError, match="No space left"):
        workers.run_all([1], full_disk, print)
