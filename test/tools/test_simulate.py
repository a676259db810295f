"""Running a scenario: what is set when, what is recorded, and what the processes around it do."""

import faulthandler
import os
import time

import numpy as np
import pytest
from support import FAULTS, STATES, refusal, scenario

from tools.bench import simulate
from tools.common import workers
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


def test_a_wrong_pwm_period_still_ends_at_the_right_time():
    board = FakeBoard(period_s=100e-6)
    simulated("[[event]]\nat_s = 1.0\npot = 0.5\n", board)
    assert board.now() == pytest.approx(2.0, abs=0.2)


def test_variables_are_written_and_read():
    board = FakeBoard()
    result, _ = simulated("[[event]]\nat_s = 0.5\ndebug = { SnapStart = 1 }\n", board)
    assert (0.5, "SnapStart", 1) in board.calls and result.variables == {"SnapBuf1": [7, 7, 7]}


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


def own_process(job, report):
    return os.getpid()


def test_results_come_in_the_order_of_the_jobs_and_the_progress_of_all_arrives():
    seconds = []
    assert workers.run_all([0, 1, 2, 3], late_for_small, seconds.append, processes=2) == [0, 1, 2, 3]
    assert seconds == [1.0] * 4


def test_every_job_has_a_process_of_its_own():
    assert len({os.getpid(), *workers.run_all([0] * 5, own_process, print, processes=2)}) == 6


@pytest.mark.parametrize("work, line", [(refuse, "no such thing, job 1: think again"), (crash, "the simulation ended by itself, exit code -6")])
def test_a_refusal_or_a_crash_in_a_process_is_one_line_here_and_no_endless_wait(work, line):
    refusal(lambda: workers.run_all([1], work, print), line)
