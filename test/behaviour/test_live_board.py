"""A client on the virtual board's serial line: it runs the motor, tunes it while it turns, vanishes, and sends nonsense."""

import contextlib
import itertools
import os
import random
import re
import signal
import subprocess
import sys
import time
from multiprocessing import get_context

import pytest

from tools.common import paths
from tools.live import board, lnet
from tools.live.symbols import Symbols

MACROS = "-DPARAMS_IN_RAM"
STOPPED, CLOSED, FAULT = 1, 5, 7
TARGET_MODE = 1
START_S = 2.5


@pytest.fixture(scope="module")
def parts() -> board.Parts:
    return board.parts(defines=MACROS)


class Client:
    """A link to a board in this process, by the names of its variables."""

    def __init__(self, parts: board.Parts) -> None:
        self.live = board.LiveBoard(parts)
        self.live.run(0.2)
        self.live.board.uart_take()
        self.link = lnet.connect(board.BoardStream(self.live))
        self.symbols = Symbols.read(parts.symbols)

    def get(self, name: str) -> int:
        variable = self.symbols.find(name)
        return variable.value(self.link.read(variable.address, variable.bytes))

    def put(self, name: str, value: int) -> None:
        variable = self.symbols.find(name)
        self.link.write(variable.address, variable.data(value))

    def command(self, **values: int) -> None:
        for name, value in (values | {"lease_ms": 500}).items():
            self.put(f"scope_command.{name}", value)

    def attend(self, seconds: float) -> None:
        """Time goes by with the lease renewed."""
        while seconds > 0.0:
            self.put("scope_command.lease_ms", 500)
            self.live.run(0.2)
            seconds -= 0.2

    def start(self, rpm: float) -> None:
        self.command(mode=TARGET_MODE, run=0, target_erpm=round(rpm * 5))
        self.put("scope_command.run", 1)
        self.attend(START_S)

    @property
    def rpm(self) -> float:
        return self.live.board.get("plant.speed_rpm")

    @property
    def state(self) -> int:
        return self.get("board_drive.state")


def in_a_process(parts: board.Parts, work) -> None:
    """The firmware is one set of globals: a board in a process of its own."""
    process = get_context("fork").Process(target=_run, args=(parts, work))
    process.start()
    process.join()
    assert process.exitcode == 0


def _run(parts: board.Parts, work) -> None:
    client = Client(parts)
    work(client)
    assert not client.live.board.warnings(), client.live.board.warnings()


def test_a_client_starts_the_motor_sets_its_speed_and_stops_it(parts):
    def work(client):
        client.start(1000)
        assert client.state == CLOSED
        client.command(target_erpm=2000 * 5)
        client.attend(1.5)
        assert client.rpm == pytest.approx(2000, abs=20)
        client.command(run=0)
        client.attend(1.5)
        assert client.state == STOPPED
        assert client.get("board_drive.fault") == 0
    in_a_process(parts, work)


def test_a_client_that_vanishes_leaves_a_motor_that_stops_in_order(parts):
    def work(client):
        client.start(1500)
        client.live.run(0.25)
        assert client.rpm > 1400
        client.live.run(1.5)
        assert client.state == STOPPED
        assert client.get("board_drive.fault") == 0
        assert client.get("scope_command.mode") == 0
    in_a_process(parts, work)


def test_a_gain_is_tuned_while_the_motor_turns(parts):
    def work(client):
        client.start(1500)
        before = client.get("board_params.speed_kp_q13")
        client.put("board_params.speed_kp_q13", before // 2)
        client.attend(0.4)
        assert client.get("board_drive.run.control.speed_kp_q13") == pytest.approx(before // 2, abs=2)
        client.put("board_params.minimum_erpm", 7000)
        client.command(target_erpm=0)
        client.attend(1.0)
        assert client.rpm == pytest.approx(1400, abs=20)
        assert client.state == CLOSED
    in_a_process(parts, work)


def test_the_scope_shows_the_phase_current_of_a_motor_that_turns(parts):
    def work(client):
        client.start(1500) # 125 Hz: 160 periods a turn of the current
        names = ("board_drive.phases_q13.a", "board_drive.phases_q13.b", "board_drive.angle", "board_drive.bus_q31")
        variables = [client.symbols.find(name) for name in names]
        trigger = lnet.Trigger(variables[0].address, 0)
        client.link.scope_setup([variable.channel for variable in variables], trigger, delay=-10, factor=8)
        for _ in range(20):
            client.attend(0.2)
            if not client.link.scope_state().running:
                break
        rows = client.link.scope_read()
        assert len(rows) > 40
        currents, angles, bus = [row[0] for row in rows], [row[2] for row in rows], [row[3] for row in rows]
        assert max(currents[:9]) < 10 and currents[10] >= 0 # kept from before the trigger, and its row
        assert max(currents) > 20 and min(currents) < -20
        steps = [(after - now) & 0xFFFF for now, after in itertools.pairwise(angles)]
        assert all(abs(step - 65536 * 8 / 160) < 300 for step in steps), steps
        assert all(abs(value / 2**31 * 52.8 - 24.0) < 0.5 for value in bus)
    in_a_process(parts, work)


# ---- nonsense ------------------------------------------------------------------------------------------------------------
def nonsense(chance: random.Random, good: bytes) -> bytes:
    """Random bytes, or a frame that something has happened to."""
    kind, data = chance.randrange(5), bytearray(good)
    if kind == 0:
        return chance.randbytes(chance.randrange(1, 60))
    if kind == 1:
        return bytes(data[:chance.randrange(1, len(data))])
    if kind == 2:
        data[-1] ^= chance.randrange(1, 256)
    elif kind == 3:
        data[chance.randrange(len(data))] = chance.choice([0x55, 0x02, 0, chance.randrange(256)])
    else:
        data.insert(chance.randrange(len(data)), chance.choice([0x55, 0x02, 0]))
    return bytes(data)


def test_nonsense_changes_nothing_and_the_next_request_is_answered(parts):
    def work(client):
        chance = random.Random(19)
        client.start(1000)
        address = client.symbols.find("board_params.speed_kp_q13").address
        params = client.symbols.find("board_params.estimator.rs_exp").address
        before = client.link.read(params, 240)
        write = lnet.frame(bytes([lnet.PUT_RAM]) + address.to_bytes(2, "little") + b"\x02\x00\x00")
        read = lnet.frame(bytes([lnet.GET_RAM]) + address.to_bytes(2, "little") + b"\x20\x01")
        for _ in range(120):
            sent = nonsense(chance, chance.choice([write, read, lnet.frame(chance.randbytes(chance.randrange(1, 40)), chance.randrange(2, 9))]))
            if write not in sent:
                client.live.board.uart_send(sent.decode("latin-1"))
            client.live.run(0.03)
            if chance.randrange(4) == 0:
                client.live.run(0.11) # longer than an unfinished frame is waited for
                client.live.board.uart_take()
                assert client.link.request(lnet.DEVICE_INFO)
            client.put("scope_command.lease_ms", 500)
        assert client.link.read(params, 240) == before
        assert client.state == CLOSED and client.rpm == pytest.approx(1000, abs=20)
    in_a_process(parts, work)


# ---- in real time --------------------------------------------------------------------------------------------------------
@contextlib.contextmanager
def running(*options: str):
    """make live-board's program, its lines, and what it says at its end."""
    with subprocess.Popen([sys.executable, "-m", "tools.live.board", *options], cwd=paths.ROOT, stdout=subprocess.PIPE, text=True,
                          env=os.environ | {"FOC33_QUIET": "1"}) as process:
        told = [process.stdout.readline() for _ in range(5)]
        yield process, "".join(told)
        process.send_signal(signal.SIGINT)
        assert "ran for" in process.stdout.read()
        assert process.wait() == 0


def test_over_a_pseudo_terminal_in_real_time(terminals, parts):
    pytest.importorskip("serial")
    with running(f"--defines={MACROS}") as (_, told):
        port = re.search(r"serial line +(\S+),", told)[1]
        symbols = Symbols.read(paths.ROOT / re.search(r"symbols +(\S+)", told)[1])
        assert symbols.variables.keys() == Symbols.read(parts.symbols).variables.keys()
        link = lnet.connect(port)
        ticks = symbols.find("board_drive.ticks")
        began_s, first = time.monotonic(), ticks.value(link.read(ticks.address, 2))
        time.sleep(0.5)
        passed = (ticks.value(link.read(ticks.address, 2)) - first) & 0xFFFF
        assert passed * 50e-6 == pytest.approx(time.monotonic() - began_s, abs=0.15)
        with pytest.raises(lnet.LnetError, match="refused"):
            link.write(0x0100, b"\x01\x00")


def test_a_port_that_is_not_there_is_told_in_one_line():
    pytest.importorskip("serial")
    with pytest.raises(Exception, match="^cannot open the port.*no-such-port: name the one that the board is at$"):
        lnet.connect("/dev/no-such-port")
