"""Runs one scenario on the virtual board and records it."""

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tools.common import board_keys, motor_file
from . import long_run, panel, selftest
from . import scenario as scenarios
from .board import Board, BoardError, Library
from tools.common.errors import UserError, suggestion
from .recorder import under_way
from .run import Run
from .scenario import Scenario
from tools.common.trace import MOST_ROWS, Recording, Trace

CHUNK_PERIODS = 2000
LONGEST_RECORD_CHUNKS = 10
LONGEST_COAST_S = 60.0
"""From rated speed: braking takes the rest."""

SIGNALS = (
    "plant.speed_rpm", "plant.theta_e_deg", "plant.i_a", "plant.i_b", "plant.i_c", "plant.i_d", "plant.i_q", "plant.torque_nm",
    "bus.voltage_v", "pwm.outputs_on", "pwm.outputs_seen",
    "fw.state", "fw.fault", "fw.speed_ref_rpm", "fw.speed_est_rpm", "fw.theta_est_deg", "fw.i_d_a", "fw.i_q_a", "fw.id_ref_a",
    "fw.iq_ref_a", "fw.iq_limit_a", "fw.v_d_v", "fw.v_q_v", "fw.v_limit_v", "fw.fw_index", "fw.inv_kphi_rpm_per_v", "fw.offset_deg",
    "fw.limits")
"""What every run records."""


@dataclass
class Job:
    """A checked scenario with everything needed to run it; made by prepare()."""

    scenario: Scenario
    library: Path
    values: dict[str, float]
    actions: list[panel.Action]
    signals: list[str]
    variables: dict[str, int] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    """of userparams.h, changed at power-up; needs PARAMS_IN_RAM"""
    long: str = ""
    """why it takes long"""
    case: Any = None
    """of the sweep that it belongs to"""


def prepare(scenario: Scenario, library: Library, motor: board_keys.Part, board: board_keys.Part, extra: board_keys.Values | None = None,
            parameters: dict[str, float] | None = None) -> Job:
    """Check the scenario against motor, board and firmware, and work out what happens when. Nothing runs yet."""
    parameters = {name: value for event in scenario.events if event.at_s == 0.0 for name, value in event.parameters.items()} | (parameters or {})
    keys, params = library.keys, library.params | parameters
    rating = rating_of(motor, board) if scenarios.asks_for_rating(scenario) else None
    scenario = scenarios.in_numbers(scenario, rating, params)
    layers = [motor.values, board.values, scenario.plant] + ([extra] if extra else [])
    values = board_keys.of_header(params) | board_keys.resolve(layers, keys)
    for event in scenario.events:
        for key, value in event.keys.items():
            board_keys.check(key, value, keys, event.where)
        _check_parameters(event, library)
    start = {key: values.get(key, 0.0) for event in scenario.events for key in event.keys}
    actions = panel.plan(scenario, panel.Ranges.of(params, scenario.defines), start)
    variables: dict[str, int] = {}
    signals = list(SIGNALS)
    for expectation, where in zip(scenario.expectations, scenario.expectations_where):
        _check_names(expectation.names(), library, where)
        signals += [name for name in expectation.signals() if name not in signals]
        for name, count in expectation.variables().items():
            variables[name] = max(count, variables.get(name, 0))
    _check_signals(signals, library, scenario)
    job = Job(scenario, library.path, values, actions, signals, variables, parameters)
    if scenario.duration_s > long_run.LONG_S:
        job.long = long_run.reason(scenario, params, (rating or rating_of(motor, board)).coast_s_per_rpm)
    return job


def rating_of(motor: board_keys.Part, board: board_keys.Part) -> scenarios.Rating:
    """What a hundred per cent are for this motor, and how it coasts on this supply."""
    data = motor_file.load(str(motor.path))
    coasts = data.coulomb_nm > 0.0 and not board.values.values.get("supply.sinks", 0.0)
    seconds = (data.inertia_kgm2 + data.load_inertia_kgm2) * math.pi / 30.0 / data.coulomb_nm if coasts else 0.0
    return scenarios.Rating(data.rated_speed_rpm, data.rated_torque_nm, min(seconds, LONGEST_COAST_S / data.rated_speed_rpm))


def _check_parameters(event: scenarios.Event, library: Library) -> None:
    for name, value in event.parameters.items():
        if not library.tunable(name):
            remedy = "add PARAMS_IN_RAM to [firmware] defines, or build with DEFINES=-DPARAMS_IN_RAM; TUNING has them in RAM, too"
            if library.tunable("FW_TRIM_CURRENT_A"):
                remedy = "the field-weakening tables, what frames them, and MINIMUM_SPEED_RPM can; set others in userparams.h"
            raise UserError(f"{name} cannot change while this firmware runs", event.where, remedy)
        most_a = library.params["MAXIMUM_CURRENT_A"]
        if name.startswith(("IDREF_SPEED", "FW_TRIM_CURRENT_A")) and abs(value) > most_a:
            raise UserError(f"{name} = {value:g} exceeds MAXIMUM_CURRENT_A", event.where, f"choose {most_a:g} A at most")


def _check_names(names: dict[str, str], library: Library, where: str) -> None:
    for kind, name in names.items():
        known = (library.faults if kind == "fault" else library.states).values()
        if name not in known:
            raise UserError(f"the firmware knows no {kind} '{name}'", where, suggestion(name, known))


def _check_signals(signals: list[str], library: Library, scenario: Scenario) -> None:
    readable = [name for name, key in library.keys.items() if key.readable]
    for name in signals:
        if name not in readable and not name.startswith("reg."):
            where = next((where for expectation, where in zip(scenario.expectations, scenario.expectations_where)
                          if name in expectation.signals()), str(library.path))
            raise UserError(f"the board has no signal '{name}'", where, suggestion(name, readable, "`make keys`"))


def simulate(job: Job, report: Callable[[float], None]) -> Run:
    """Run a job in this process; `report` gets the motor time that has passed since the last call."""
    library = Library(job.library)
    with using(Board(library), job) as board:
        return simulate_on(job, library, board, report)


@contextlib.contextmanager
def using(board: Any, job: Job) -> Iterator[Any]:
    """The board, closed at the end; what it refuses is the scenario's mistake."""
    try:
        yield board
    except BoardError as error:
        raise UserError(f"the virtual board refuses: {error}", job.scenario.name, "correct the scenario") from None
    finally:
        board.close()


def simulate_on(job: Job, library: Library, board: Any, report: Callable[[float], None]) -> Run:
    """Run a job on a board that the caller has made and closes."""
    session = Session(job, library, board, report)
    session.run_to_end()
    return session.run()


def set_up(board: Any, job: Job) -> None:
    """Plant and rotor as they are before power-up."""
    for key, value in job.values.items():
        board.set(key, value)
    board.set("state.theta_e_deg", job.scenario.rotor_deg)
    board.set("state.speed_rpm", job.scenario.speed_rpm)
    if "bus.voltage_v" not in job.values:
        board.set("bus.voltage_v", board.get("supply.voltage_v"))


class Session:
    """A job on a board, from power-up on, as far as it was taken. A row of the trace every `every` periods, but no more than `most` in all."""

    def __init__(self, job: Job, library: Library, board: Any, report: Callable[[float], None], every: int = 1, most: int = MOST_ROWS) -> None:
        self.job, self.library, self.board = job, library, board
        set_up(board, job)
        self.recorder = _Recorder(board, job.signals, report, every, most)
        self.done: list[tuple[float, str]] = [(0.0, "power-up")]
        self.pending = list(job.actions)
        self._act_until(0.0) # in place before the firmware looks at its pins
        board.power_up()
        for name, value in job.parameters.items():
            board.write_parameter(name, value)
        self.wall_s, self.cpu_s = 0.0, 0.0

    @property
    def now_s(self) -> float:
        return self.recorder.now_s

    def run_to(self, until_s: float) -> None:
        """Goes on to this time; what happens after it stays pending."""
        started, cpu_started = time.perf_counter(), time.process_time()
        while self.pending and self.pending[0].at_s <= until_s:
            self.recorder.run_to(self.pending[0].at_s)
            self._act_until(self.pending[0].at_s)
        self.recorder.run_to(until_s)
        self.wall_s += time.perf_counter() - started
        self.cpu_s += time.process_time() - cpu_started

    def run_to_end(self) -> None:
        """To the end of the scenario, or its last action."""
        self.run_to(max([self.job.scenario.duration_s, *(action.at_s for action in self.job.actions)]))

    def _act_until(self, at_s: float) -> None:
        while self.pending and self.pending[0].at_s <= at_s:
            _act(self.board, self.pending.pop(0), self.done)

    def plan(self, actions: list[panel.Action]) -> None:
        """More that is to happen."""
        self.pending = sorted(self.pending + actions, key=lambda action: action.at_s)

    def run(self) -> Run:
        """What has happened so far. After a fault the board runs on, without a trace, until the fault recorder's lines are out."""
        job, library = self.job, self.library
        variables = {name: self.board.variable(name, count) for name, count in job.variables.items()}
        motor_s, trace, warnings = self.board.get("time_s"), self.recorder.recording.trace(), self.board.warnings()
        if "fw.fault" in trace and len(trace) and trace.column("fw.fault")[-1] != 0:
            self.recorder.sent += _rest_of_record(self.board, self.recorder.sent)
        return Run(job.scenario, trace, self.done + self._self_test(trace, motor_s), warnings, library.states, library.faults, variables, library.params | job.parameters,
                   self.recorder.sent, self.wall_s, self.cpu_s, motor_s)


    def _self_test(self, trace: Trace, at_s: float) -> list[tuple[float, str]]:
        """What a failed self-test is about, of a run that ended in its fault."""
        ended = self.library.faults.get(int(trace.column("fw.fault")[-1])) if "fw.fault" in trace and len(trace) else None
        return [(at_s, line) for line in selftest.told(self.board, self.library)] if ended == selftest.FAULT else []


def _rest_of_record(board: Any, sent: str) -> str:
    """The fault recorder's lines that were not out when the scenario ended in a fault."""
    text = ""
    for chunk in range(LONGEST_RECORD_CHUNKS):
        if chunk > 0 and not under_way(sent + text):
            break
        board.run(CHUNK_PERIODS)
        text += board.uart_take()
    return text


def _act(board: Any, action: panel.Action, done: list[tuple[float, str]]) -> None:
    for key, value in action.keys.items():
        board.set(key, value)
    for name, value in action.variables.items():
        board.write_variable(name, value)
    for name, value in action.parameters.items():
        board.write_parameter(name, value)
    if action.sends:
        board.uart_send(action.sends)
    if action.text:
        done.append((action.at_s, action.text))


class _Recorder:
    """Lets the board run and collects its trace, a chunk at a time."""

    def __init__(self, board: Any, signals: list[str], report: Callable[[float], None], every: int, most: int) -> None:
        self.board = board
        self.report = report
        self.now_s = 0.0
        self.period_s = 50e-6
        self.recording = Recording(signals, most)
        self.sent = ""
        self.board.trace_start(signals, every)

    def run_to(self, until_s: float) -> None:
        while (periods := math.ceil((until_s - self.now_s) / self.period_s - 1e-6)) > 0:
            periods = min(periods, CHUNK_PERIODS)
            self.board.run(periods)
            now_s = self.board.get("time_s")
            rows = self.board.trace_take()
            self.sent += self.board.uart_take()
            if len(rows):
                self.recording.add(self.now_s + (now_s - self.now_s) / len(rows) * np.arange(1, len(rows) + 1), rows)
            self.report(now_s - self.now_s)
            self.period_s = (now_s - self.now_s) / periods
            self.now_s = now_s
