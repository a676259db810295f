"""What the scope costs the interrupt of the slow work, counted by the simulator in every period of a record. Needs XC16."""

from unittest import mock

import numpy as np
import pytest
import xc16

from tools.live import board as live_board
from tools.live import lnet
from tools.live.symbols import Symbols

pytestmark = pytest.mark.xc16
OFF_CYCLES, MOST_CYCLES = 3, 35
"""Without a record; with four channels of 16 bits, whatever the scope does in the period."""
SINE_CYCLES = 40
"""Most that the sine takes of a period of the control interrupt while it runs (docs/response.md)."""
SLOW_PHASES = 32
"""Periods after which an interrupt of the drive at rest costs the same again."""
CHANNELS = ("board_drive.phases_q13.a", "board_drive.phases_q13.b", "board_drive.ticks", "board_drive.angle")
LEVEL = 500
ENOUGH_S = 0.02
"""For all rows."""


class Bench:
    """A board with a client, at rest."""

    def __init__(self, parts: live_board.Parts) -> None:
        self.live, self.symbols = live_board.LiveBoard(parts), Symbols.read(parts.symbols)
        self.link = lnet.connect(live_board.BoardStream(self.live))
        self.channels = [self.symbols.find(name).channel for name in CHANNELS]
        self.watched = self.symbols.find("scope_command.target_erpm")
        self.live.run(0.2)
        self.periods = 0
        self.live.board.trace_start(["cpu.slow_cycles"], 1)
        self.live.run(ENOUGH_S)
        rest = self.taken()
        self.rest = rest[:SLOW_PHASES]
        assert (rest == np.resize(self.rest, len(rest))).all()

    def taken(self) -> np.ndarray:
        """Cycles of every interrupt since the last call."""
        rows = self.live.board.trace_take()[:, 0]
        self.periods += len(rows)
        return rows

    def costs(self) -> list[int]:
        """What the scope took in every period since the last call, nothing done."""
        first = self.periods % SLOW_PHASES
        rows = self.taken()
        return (rows - np.resize(np.roll(self.rest, -first), len(rows)) + OFF_CYCLES).astype(int).tolist()

    def record(self, trigger: bool, delay: int = 0, rising: bool = True, wait_s: float = 0.0) -> list[int]:
        """The costs of a record from before its begin until after its end."""
        low, high = (0, 2 * LEVEL) if rising else (2 * LEVEL, 0)
        self.link.write(self.watched.address, self.watched.data(low))
        self.taken()
        self.link.scope_setup(self.channels, lnet.Trigger(self.watched.address, LEVEL, rising) if trigger else None, delay)
        self.live.run(ENOUGH_S + wait_s)
        self.link.write(self.watched.address, self.watched.data(high))
        self.live.run(ENOUGH_S)
        assert not self.link.scope_state().running
        return self.costs()


@pytest.fixture(scope="module")
def bench() -> Bench:
    if not xc16.COMPILER:
        pytest.skip(xc16.NONE)
    return Bench(live_board.parts(cpu="33f"))


def rows_of(bench: Bench) -> int:
    return bench.link.scope_state().used // (2 * len(CHANNELS))


def test_costs_are_what_a_period_took_beyond_the_same_slow_phase_at_rest() -> None:
    """The counting itself; it needs no image."""
    bench, rest = object.__new__(Bench), np.arange(600, 600 + SLOW_PHASES)
    took = [0, 0, 31, 0, 34, 0, 0, 0, 0, 32]
    bench.rest, bench.periods = rest, 3
    bench.live = mock.Mock()
    bench.live.board.trace_take.return_value = np.array([[rest[(3 + n) % SLOW_PHASES] + more] for n, more in enumerate(took)])
    assert bench.costs() == [OFF_CYCLES + more for more in took]
    assert bench.periods == 13


def test_a_record_without_a_trigger(bench: Bench) -> None:
    costs = bench.record(False)
    armed = [cycles for cycles in costs if cycles != OFF_CYCLES]
    assert len(armed) == rows_of(bench) and max(armed) <= MOST_CYCLES
    assert min(costs) == OFF_CYCLES


def test_waiting_and_the_trigger_itself(bench: Bench) -> None:
    for rising in (True, False):
        for delay in (0, 5, -20, 1 - rows_of(bench)):
            # the trigger comes at various places in the array
            costs = [cycles for n in range(16) for cycles in bench.record(True, delay, rising, n * bench.live.period_s)]
            assert min(costs) == OFF_CYCLES < max(costs) <= MOST_CYCLES, (delay, rising)


def test_sine_beside_the_currents_costs_a_period_no_more_than_it_is_said_to(bench: Bench) -> None:
    live, symbols = bench.live, bench.symbols

    def put(name: str, value: int) -> None:
        variable = symbols.find(name)
        bench.link.write(variable.address, variable.data(value))

    def interrupt(left: int) -> np.ndarray:
        """Cycles of the control interrupt while the rotor is aligned, where nothing else changes from turn to turn of the slow phases."""
        put("board_drive.run.sine.left", left)
        live.board.trace_take()
        live.board.trace_start(["cpu.isr_cycles"], 1)
        live.run(0.02)
        return live.board.trace_take()[:, 0]
    put("scope_command.lease_ms", 5000)
    put("scope_command.mode", 1)
    put("scope_command.run", 1)
    live.run(0.3)
    put("board_drive.run.sine.step", 3000)
    put("board_drive.run.sine.size_iq_q16", 400)
    without, running = interrupt(0), interrupt(1000)
    put("scope_command.run", 0)
    more = running.mean() - without.mean()
    assert 20.0 < more <= SINE_CYCLES and running.max() - without.max() <= SINE_CYCLES
