"""One injected fault: the motor is brought to the moment, then goes on twice, with the fault and without it. Both begin from the same bit."""

import contextlib
import math
import os
import pickle
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.common import motor_file
from tools.common.board_keys import Part, Values
from tools.common.param_rows import phase_ohm, slow_periods

from . import injection, judge, memory, pil, simulate
from .board import Board, Library
from .injection import Case
from .panel import Action
from .run import Run
from .scenario import BRAKE, Event, Scenario, decel_rpm_s, early_ramp_s, param, start_time_s

EVERY, MOST_ROWS = 4, 400_000
"""Periods to a row of the trace, and rows at most: a case has five of it at once."""
START_S, PRESS_S = 0.15, 0.1
WAIT_STEP_S = 0.001
SETTLE_S = 0.4
"""For the speed, before a fault that comes at a steady one."""
STEADY_S = 0.2
"""The stretch of a steady speed in which it comes."""
LOAD_OVER_S = 0.1
CLEAR_S, AGAIN_S = 0.3, 0.3
"""From a fault to the S2 that clears it, and on to the one that starts again; in between the rotor coasts to a stop."""
BLOCKED_S, RETRY_PAUSE_S, RETRY_STATES = 0.8, 3.0, ("RETRY", "FAULT")
"""The shaft is blocked for the first; a drive that tries again by itself may wait for the second, in one of these states."""
RAMP_STEP_S = 0.005
CLOSED = ("CLOSED", "STOPPING")
DEAD_SHARE = 0.13
"""Of dead time's voltage: what its compensation leaves may move the speed (GATE_SHARE of include/control/tuned.h)."""
HANG_S = 300
WHERE = "campaign"
HUNG = "WATCHDOG"
"""What ends a firmware that hangs; the virtual board has no watchdog."""


@dataclass(frozen=True)
class Bench:
    """A motor with its header's firmware: on the PC, or as an image in the simulator."""

    motor: Part
    board: Part
    library: Library
    memory: list[memory.Variable]
    image: Path | None = None
    stack_start: int = 0

    def new_board(self) -> Board:
        """One for this process."""
        if self.image is None:
            return Board(self.library)
        board = pil.PilBoard(self.library, self.image)
        board.lock_step(False)
        return board


@dataclass(frozen=True)
class Scene:
    """The way to the moment. `states`: wait for one of them from from_s on; the moment lies within the next `within_s`."""

    scenario: Scenario
    from_s: float
    within_s: float
    states: tuple[str, ...]
    end_s: float
    """not before this: a start is over and has settled"""
    last_rpm: float
    """the reference that the way leads to"""


def scene(case: Case, bench: Bench) -> Scene:
    """What leads to a case's moment."""
    params, motor = bench.library.params, motor_file.load(str(bench.motor.path))
    slow, nominal, most = (param(params, f"{name}_SPEED_RPM") for name in ("MINIMUM", "NOMINAL", "MAXIMUM"))
    top = min(0.97 * nominal, 0.97 * motor.rated_speed_rpm)
    first = {"low speed": 1.4 * slow, "accelerating": 1.4 * slow, "half speed": 0.5 * top, "RAMP": 0.5 * top, "FAULT": 0.5 * top}.get(case.scene, top)
    second = {"accelerating": top, "braking": 1.4 * slow, "field weakening": nominal + 0.5 * (most - nominal)}.get(case.scene, 0.0)
    load_nm = case.load * motor.rated_torque_nm * (0.2 if case.scene == "field weakening" else 0.7)
    period_s, pairs = param(params, "LOOPTIME_SEC"), param(params, "NOPOLESPAIRS")
    lock_s = param(params, "LOCK_TIME") * period_s
    slope, down = param(params, "SPEEDREFRAMP_RPM_PER_S"), decel_rpm_s(params)
    closed_s = START_S + start_time_s(params)
    speed_s = closed_s + max(abs(first - param(params, "END_SPEED_RPM")) / slope, LOAD_OVER_S) + SETTLE_S
    events = [_event(0.0, "set", keys={BRAKE: min(load_nm, 0.5 * motor.start_torque_nm)}), _event(0.0, "speed_rpm", value=first), *_press(START_S),
              _event(closed_s, "set", keys={BRAKE: load_nm}, over_s=LOAD_OVER_S)]
    if second:
        events.append(_event(speed_s, "speed_rpm", value=second, finds_range=True))
    ramp_s = max((second - first) / slope, (first - second) / down)
    end_s = closed_s + judge.SETTLE_S
    begin = {"CALIBRATE": (0.0, 0.045, ()), "STOPPED": (0.06, START_S - 0.06, ()), "BOOTSTRAP": (START_S, 0.009, ("BOOTSTRAP",)),
             "ALIGN": (START_S, 0.95 * lock_s, ("ALIGN",)), "RAMP": (START_S + lock_s, early_ramp_s(params), ("RAMP",)),
             "accelerating": (speed_s + 0.02, 0.9 * ramp_s, ()), "braking": (speed_s + 0.02, 0.9 * ramp_s, ()),
             "field weakening": (speed_s + 0.1 + ramp_s + SETTLE_S, STEADY_S, ()),
             "STOPPING": (speed_s, 0.5 * first / down, ("STOPPING",)), "FAULT": (speed_s, 0.5 * CLEAR_S, ("FAULT",)),
             "retry": (speed_s, CLEAR_S, RETRY_STATES)}.get(case.scene, (speed_s, STEADY_S, ()))
    if case.scene == "STOPPING":
        events += _press(speed_s)
    if case.scene == "FAULT":
        again_s = speed_s + CLEAR_S + AGAIN_S + coast_s(motor, first)
        events += [_event(speed_s, "set", keys={"input.flta": 1.0}), _event(speed_s + 0.005, "set", keys={"input.flta": 0.0}),
                   *_press(speed_s + CLEAR_S), *_press(again_s)]
        end_s = again_s + start_time_s(params) + judge.SETTLE_S
    if case.scene == "retry":
        events += [_event(speed_s, "set", keys={"load.locked": 1.0}), _event(speed_s + BLOCKED_S, "set", keys={"load.locked": 0.0})]
        end_s = speed_s + BLOCKED_S + RETRY_PAUSE_S + start_time_s(params) + judge.SETTLE_S
    text = f"{case.kind} {case.size:g} {case.place}".strip()
    plant = {"rng.seed": float(case.noise)} | _true_motor(case, bench, min(speed for speed in (first, second) if speed))
    scenario = Scenario(f"case {case.number}", f"{text}, {case.scene}", "", "", "", 60.0, events=sorted(events, key=lambda event: event.at_s),
                        rotor_deg=case.rotor_deg, plant=Values(plant, dict.fromkeys(plant, WHERE)))
    return Scene(scenario, *begin, end_s, second or first)


def _true_motor(case: Case, bench: Bench, rpm: float) -> dict[str, float]:
    """What the motor and its load have that the header does not know. @param rpm the slowest of the way: the load that pulses swings it most"""
    values = {key: value for key, value in {**bench.board.values.values, **bench.motor.values.values}.items() if not isinstance(value, tuple)}
    result = injection.true_motor(case, values)
    if case.pulse:
        most_nm = case.pulse * motor_file.load(str(bench.motor.path)).rated_torque_nm
        result["load.pulse1_nm"] = injection.pulse_nm(most_nm, 1.0, values["mech.inertia_kgm2"], rpm)
    return result


def coast_s(motor: motor_file.Motor, rpm: float) -> float:
    """How long friction alone takes to stop the rotor."""
    return (motor.inertia_kgm2 + motor.load_inertia_kgm2) * abs(rpm) * math.pi / 30.0 / max(motor.coulomb_nm, 1e-6)


def _event(at_s: float, kind: str, **more: Any) -> Event:
    return Event(at_s, kind, WHERE, **more)


def _press(at_s: float) -> list[Event]:
    return [_event(at_s, "press", button="S2", hold_s=PRESS_S)]


@dataclass
class Trial:
    """What a case has left: both runs, when it happened, and how it ended."""

    case: Case
    with_fault: Run | None
    without: Run
    injected_s: float
    state: str
    target: str
    verdict: judge.Verdict

    def row(self) -> dict[str, Any]:
        """One line of the table."""
        case, verdict = self.case, self.verdict
        return {"case": case.number, "kind": case.kind, "size": case.size, "place": self.target or case.place, "scene": case.scene, "state": self.state,
                "phase": case.phase, "motor": case.motor, "load": case.load, "over_s": case.over_s, "lasts_s": case.lasts_s,
                "at_s": round(self.injected_s, 5), "class": verdict.outcome, "code": verdict.code,
                "after_s": None if verdict.after_s is None else round(max(verdict.after_s, 0.0), 5),
                "speed_error_percent": None if verdict.speed_error_percent is None else round(verdict.speed_error_percent, 2),
                "current_peak_a": round(verdict.current_peak_a, 2), "why": verdict.why}


def run(case: Case, bench: Bench, tell: Callable[[float], None] = lambda seconds: None) -> Trial:
    """The whole case, in this process, which can run no other board afterwards."""
    way = scene(case, bench)
    job = simulate.prepare(way.scenario, bench.library, bench.motor, bench.board)
    with simulate.using(bench.new_board(), job) as board:
        session = simulate.Session(job, bench.library, board, tell, EVERY, MOST_ROWS)
        _to_the_moment(session, way, case)
        injected_s = session.now_s
        state = bench.library.states.get(int(board.get("fw.state")), "?")
        rating = rating_of(bench.library, bench.motor, board, way.last_rpm)
        unseen = case.what.unseen(case.size, rating)
        settled_s = settled(case, way.end_s + reversal_s(case, state, bench.library.params), injected_s, unseen.clock)
        end_s = settled_s + judge.JUDGE_S

        def goes_wrong() -> tuple[Run, str]:
            target = _inject(session, case, rating, bench)
            session.run_to(end_s)
            return session.run(), target

        result, ending = _aside(goes_wrong)
        session.run_to(end_s)
        without = session.run()
    closed = tuple(number for number, name in bench.library.states.items() if name in CLOSED)
    limits = judge.Limits(injected_s, settled_s, motor_file.load(str(bench.motor.path)).rated_speed_rpm, rating.current_a, case.what.ends,
                          bench.library.faults, closed, case.what.limits, mean_s(case, rating), unseen)
    with_fault, target = result or (None, "")
    verdict = _ended(ending) if with_fault is None else judge.judge(with_fault.trace, without.trace, limits)
    return Trial(case, with_fault, without, injected_s, state, target, verdict)


def mean_s(case: Case, rating: injection.Rating) -> float:
    """Over which the speed is judged: a turn where a load swings it, else as a rule."""
    return max(judge.MEAN_S, 60.0 / rating.speed_rpm) if case.swings else judge.MEAN_S


def rating_of(library: Library, motor: Part, board: Any, last_rpm: float | None = None) -> injection.Rating:
    """What the sizes of faults are shares of, for the motor on this board."""
    reference_rpm = abs(board.get("fw.speed_ref_rpm"))
    slowest_rpm = reference_rpm if last_rpm is None else min(reference_rpm, last_rpm)
    return injection.Rating(param(library.params, "MAXIMUM_CURRENT_A"), motor_file.load(str(motor.path)).rated_torque_nm,
                            *(board.get(key) for key in ("supply.voltage_v", "motor.rs_ohm", "motor.psi_vs", "cpu.crystal_hz", "mech.inertia_kgm2")),
                            speed_rpm=max(slowest_rpm, param(library.params, "MINIMUM_SPEED_RPM")),
                            dead_rpm=dead_rpm(library.params), start_dead=start_dead(library.params))


def settled(case: Case, way_end_s: float, injected_s: float, clock: float) -> float:
    """When a case is judged: a while after its fault has come and gone, and after its way is over, which a slow clock makes longer."""
    return max(injected_s + case.over_s + case.lasts_s + judge.SETTLE_S, injected_s + (way_end_s - injected_s) / min(clock, 1.0))


def reversal_s(case: Case, state: str, params: dict[str, float]) -> float:
    """What a start takes longer that catches a rotor turning backwards: a ramp more."""
    return start_time_s(params) if case.what.reverses and case.size < 0.0 and state not in CLOSED else 0.0


def dead_rpm(params: dict[str, float]) -> float:
    """The firmware's PARAM_LARGE_ERPM as a speed of the shaft."""
    return DEAD_SHARE * _dead_v(params) * math.sqrt(3.0) * 1000.0 / param(params, "MOTOR_KPHI_V_PER_KRPM")


def start_dead(params: dict[str, float]) -> float:
    """Dead time's voltage over R I of the start."""
    return _dead_v(params) / (phase_ohm(params) * param(params, "Q_CURRENT_REF_OPENLOOP"))


def _dead_v(params: dict[str, float]) -> float:
    return param(params, "NOMINAL_BUS_V") * param(params, "DEADTIME_SEC") / param(params, "LOOPTIME_SEC")


def _to_the_moment(session: simulate.Session, way: Scene, case: Case) -> None:
    """To the scene's state, a drawn part into it, and to the drawn slow phase."""
    session.run_to(way.from_s)
    wanted = [number for number, name in session.library.states.items() if name in way.states]
    for _ in range(4000 if way.states else 0):
        if session.board.get("fw.state") in wanted:
            break
        session.run_to(session.now_s + WAIT_STEP_S)
    session.run_to(session.now_s + case.part * way.within_s)
    for _ in range(slow_periods(session.recorder.period_s)):
        if session.board.get("fw.slow_phase") == case.phase:
            break
        session.run_to(session.now_s + session.recorder.period_s)


def _inject(session: simulate.Session, case: Case, rating: injection.Rating, bench: Bench) -> str:
    """The fault, at once or slowly, and its end if it passes; what was hit, where that is not the case's own place."""
    board = session.board
    name, _, what = case.kind.partition(": ")
    session.done.append((session.now_s, f"FAULT INJECTED: {case.kind} {case.size:g} {case.place}".rstrip()))
    if name == "RAM":
        area = bench.memory[:1] if case.place == injection.DRIVE_RAM else bench.memory[1:]
        return memory.flip(bench.library, area, case.size)
    if name == injection.IMAGE:
        core = memory.Core(board, bench.stack_start)
        return core.flip_flash(case.size) if case.place == injection.FLASH else core.flip_ram(case.size, case.place == injection.STACK)
    if name == "registers":
        bit = min(int(case.size * 16.0), 15)
        board.set(f"reg.{case.place}", float(int(board.get(f"reg.{case.place}")) ^ 1 << bit))
        return f"{case.place} bit {bit}"
    keys = injection.keys_of(case, rating)
    before = {key: board.get(key) for key in keys}
    steps = max(1, round(case.over_s / RAMP_STEP_S))
    now_s = session.now_s
    actions = [Action(now_s + case.over_s * step / steps, {key: before[key] + (value - before[key]) * step / steps for key, value in keys.items()})
               for step in range(1, steps + 1)]
    if steps == 1:
        for key, value in actions.pop().keys.items():
            board.set(key, value)
    if case.lasts_s:
        actions.append(Action(now_s + case.over_s + case.lasts_s, before, text="the fault is over"))
    session.plan(actions)
    return ""


def _aside(work: Callable[[], Any]) -> tuple[Any, int]:
    """The result of `work` in a copy of this process, which goes on from the same state; None and what ended the copy if it did not end well."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        with contextlib.suppress(BaseException):
            os.close(reader)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(HANG_S)
            with os.fdopen(writer, "wb") as pipe:
                pickle.dump(work(), pipe)
            os._exit(0)
        os._exit(1)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        data = pipe.read()
    ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return (pickle.loads(data) if ended == 0 else None), ended


def _ended(how: int) -> judge.Verdict:
    """A firmware that did not come to the end: it hangs, or its own accesses ended it."""
    if how == -signal.SIGALRM:
        return judge.Verdict(judge.ANOTHER, HUNG, None, "hangs; the chip's watchdog resets it")
    return judge.Verdict(judge.SILENT, "", None, f"reads or writes outside its memory (exit {how})")
