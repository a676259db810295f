"""A board at a serial port on the page of make live. The board is a virtual one: all that the page has of it is its serial line."""

import contextlib
import csv
import io
import os
import time

import pytest
from live_browser import PATIENCE_S
from live_support import Living, known, parts, until
from support import command, refusal, refused

from tools.bench.scenario import BRAKE
from tools.live import step, symbols
from tools.live.__main__ import main
from tools.live.line import Line
from tools.live.lnet import connect
from tools.live.real_board import LEASE_MS, RealBoard
from tools.live.watch import WATCHED, Watch, blocks

pytestmark = pytest.mark.waits

SYMBOLS = known()


class Desk(Living):
    """A board and the page's side of its serial line."""

    def __init__(self) -> None:
        super().__init__()
        self.maker.start()
        self.page = RealBoard(self.board.line, "the motor", SYMBOLS, parts().library.params)
        self.page.start(self.messages.append)

    def frame(self) -> dict:
        self.page.run(0.05)
        return self.page.frame()

    def close(self) -> None:
        self.page.end()
        super().close()

    def state(self, name: str) -> None:
        until(lambda: self.frame()["state"] == name, f"not {name}: {self.frame()}")


@pytest.fixture(scope="module")
def desk():
    with contextlib.closing(Desk()) as item:
        yield item


def test_it_shows_what_the_firmware_knows_in_engineering_units(desk):
    desk.state("STOPPED")
    now = desk.frame()["now"]
    assert now["bus_v"] == pytest.approx(24.0, abs=0.2) and now["estimate_rpm"] == pytest.approx(0.0, abs=1.0)
    assert desk.page.hello()["virtual"] is False and [panel["title"] for panel in desk.page.hello()["panels"]] == ["speed", "current", "bus"]
    assert len(desk.frame()["strip"][0]) == 1 + 2 + 3 + 1


def test_the_page_starts_the_motor_gives_it_a_target_and_stops_it(desk):
    desk.page.act({"start": 1200.0})
    desk.state("CLOSED")
    until(lambda: desk.frame()["now"]["estimate_rpm"] == pytest.approx(1200.0, rel=0.01), "not 1200 rpm")
    desk.page.act({"target": 1500})
    until(lambda: desk.board.board.get("plant.speed_rpm") == pytest.approx(1500.0, rel=0.01), "not 1500 rpm")
    until(lambda: desk.frame()["now"]["reference_rpm"] == pytest.approx(1500.0, rel=0.01), "the reference is not told")
    now = desk.frame()["now"]
    assert now["i_q_a"] == pytest.approx(desk.board.board.get("fw.i_q_a"), abs=0.1)
    assert now["v_q_v"] == pytest.approx(desk.board.board.get("fw.v_q_v"), rel=0.1)
    begun_s = desk.board.time_s
    desk.pace(2.0)
    until(lambda: desk.board.time_s > begun_s + 2.5, "no time passes") # longer than a lease
    desk.pace(1.0)
    assert desk.frame()["state"] == "CLOSED"
    desk.page.act({"stop": True})
    desk.state("STOPPED")


def test_s2_takes_the_command_from_the_page(desk):
    desk.page.act({"start": 1000.0})
    desk.state("CLOSED")
    desk.click_s2()
    desk.state("STOPPED")
    until(lambda: desk.frame()["remote"] is None, "the page still wants to drive")
    assert "the buttons have taken the command" in [line["text"] for line in desk.page.log]


def test_the_motor_stops_when_the_tab_that_has_started_it_is_closed(desk):
    desk.page.act({"start": 1000.0}, "a tab")
    desk.state("CLOSED")
    desk.page.left("another tab")
    desk.page.act({"target": 1100.0}, "another tab")
    until(lambda: desk.frame()["now"]["estimate_rpm"] == pytest.approx(1100.0, rel=0.02), "not 1100 rpm")
    desk.page.left("a tab")
    desk.state("STOPPED")


def test_a_fault_is_told_and_the_page_clears_it(desk):
    desk.do(fault=["blocked", True])
    desk.page.act({"start": 1000.0})
    until(lambda: desk.frame()["fault"] not in ("", "NONE"), "no fault")
    desk.do(fault=["blocked", False])
    desk.page.act({"stop": True})
    desk.page.act({"clear": True})
    until(lambda: desk.frame()["fault"] == "NONE", "not cleared")
    assert any(line["kind"] == "fault" for line in desk.page.log)


def test_a_trace_comes_over_the_same_line(desk):
    desk.messages.clear()
    desk.page.scope.ask({"channels": ["board_drive.state", "board_drive.ticks"], "trigger": None, "level": 0, "rising": True, "position": 0.0, "factor": 1,
                         "mode": "single"})
    ticks = [row[2] for row in desk.trace()["rows"]]
    assert [(later - earlier) % 65536 for earlier, later in zip(ticks, ticks[1:])] == [1] * (len(ticks) - 1) and len(ticks) > 200


def test_the_record_of_a_fault_comes_over_the_same_line(desk):
    setup = desk.page.hello()["scope"]["fault"]
    desk.page.act({"start": 1000.0})
    desk.state("CLOSED")
    desk.messages.clear()
    desk.page.scope.ask(setup)
    time.sleep(0.5) # until the rows before a fault are there
    desk.do(fault=["open_b", True])
    trace = desk.trace()
    states = [row[1 + setup["channels"].index("board_drive.state")] for row in trace["rows"]]
    before = round(setup["position"] * (len(states) - 1))
    assert trace["fault"] == "OPEN_PHASE" and len(states) >= 52 and states == [5.0] * before + [7.0] * (len(states) - before)
    desk.page.scope.ask(setup | {"mode": "stop"})
    desk.do(fault=["open_b", False])
    desk.page.act({"stop": True})
    desk.page.act({"clear": True})
    until(lambda: desk.frame()["fault"] == "NONE", "not cleared")


def test_a_loop_and_a_step_are_measured_while_the_watch_and_the_lease_go_on_and_end_with_the_motor(desk, monkeypatch):
    loops = desk.page.loops
    loops.count, loops.rounds = 4, 1
    desk.do(set=[BRAKE, 0.4 * desk.board.rated.rated_torque_nm])
    desk.state("STOPPED")
    refusal(lambda: desk.page.act({"measure": "speed"}), "loops and steps are measured while the motor turns")
    desk.page.act({"start": 1500.0}, "a tab")
    desk.state("CLOSED")
    desk.page.act({"measure": "speed"})
    frames = [desk.frame()]
    until(lambda: (frames.append(desk.frame()), not loops.told["running"])[1], lambda: str(loops.told), 4 * PATIENCE_S)
    assert loops.told["done"] == loops.told["of"] == 4 and loops.told["margins"]["measured"][1] is not None, loops.told
    assert {frame["state"] for frame in frames} == {"CLOSED"} and not any(frame["silent"] for frame in frames)
    assert max(frame["now"]["lease_ms"] for frame in frames) <= LEASE_MS and len({frame["now"]["angle_deg"] for frame in frames}) > 20
    assert frames[0]["measurable"]["why"]["current"] == "the speed loop is being measured" and desk.page.loop().startswith("hz,measured_db,")
    monkeypatch.setattr(step, "RECORDS", 2)
    refusal(lambda: desk.page.act({"measure": {"step": "load", "size": 40}}), "a load step needs the virtual motor's brake")
    desk.page.act({"measure": {"step": "speed", "size": 20}}) # of a tenth, the estimate's ripple moves the 90 % by a third of the rise
    refusal(lambda: desk.page.act({"target": 1600.0}), "a step of the speed is being measured")
    frames = []
    until(lambda: (frames.append(desk.frame()), not loops.told["running"])[1], lambda: str(loops.steps.told), 4 * PATIENCE_S)
    assert loops.steps.told["figures"]["measured"]["rise_s"] == pytest.approx(loops.steps.told["figures"]["model"]["rise_s"], rel=0.3), loops.steps.told
    assert {frame["state"] for frame in frames} == {"CLOSED"} and max(frame["now"]["target_rpm"] for frame in frames) == pytest.approx(1800.0, abs=20.0)
    until(lambda: desk.frame()["now"]["target_rpm"] == pytest.approx(1500.0, abs=2.0), "the target does not come back")
    desk.page.act({"measure": "speed"})
    until(lambda: (desk.frame(), loops.told["done"])[1], "no point")
    desk.pace(0.0001)
    until(lambda: (desk.frame(), not loops.told["running"])[1], "it does not end")
    assert loops.told["said"].startswith("no connection: no answer to service") and loops.told["said"].endswith("; 1 of 4 points measured")
    desk.pace(1.0)
    until(lambda: not desk.frame()["silent"] and desk.frame()["measurable"]["why"]["speed"] is None, "it does not come back")
    desk.page.act({"measure": "speed"})
    until(lambda: (desk.frame(), loops.told["done"])[1], "no point")
    desk.page.left("a tab")
    until(lambda: (desk.frame(), not loops.told["running"])[1], "it does not end")
    assert "the motor has left CLOSED" in loops.told["said"]
    desk.frame()
    assert any("speed loop: the motor has left CLOSED" in line["text"] for line in desk.page.log)
    desk.state("STOPPED")
    desk.do(set=[BRAKE, 0.0])


@pytest.mark.parametrize("wish, part", [
    ({"start": 9.0}, "choose"), ({"start": "fast"}, "impossible"), ({"press": "S2"}, "no such command"), ([], "no such command")])
def test_a_wrong_command_is_refused_in_one_line(desk, wish, part):
    refusal(lambda: desk.page.act(wish), part)
    refusal(desk.page.scenario, "save its CSV")


def test_csv_is_what_was_read(desk):
    table = list(csv.reader(io.StringIO(desk.page.csv())))
    assert table[0] == ["time_s", *WATCHED] and {len(row) for row in table} == {1 + len(WATCHED)} and len(table) > 10


def test_a_board_that_falls_silent_is_told(desk):
    until(lambda: not desk.frame()["silent"], "it is not heard")
    desk.pace(0.0001)
    until(lambda: desk.frame()["silent"], "nobody says it")
    desk.pace(1.0)
    until(lambda: not desk.frame()["silent"], "it does not come back")


def test_what_lies_together_is_read_together():
    found = blocks([SYMBOLS.find(name) for name in WATCHED.values()])
    assert len(found) <= 4 and max(block.bytes for block in found) <= 252
    for name in WATCHED.values():
        item = SYMBOLS.find(name)
        assert sum(block.address <= item.address and item.address + item.bytes <= block.address + block.bytes for block in found) == 1


class Ones:
    """A firmware whose memory is all ones."""

    @staticmethod
    def read(address: int, n: int) -> bytes:
        return b"\xff" * n


def test_what_is_read_keeps_its_sign():
    params = parts().library.params
    values = Watch(SYMBOLS, params).read(Ones)
    assert values["i_q_a"] == values["i_d_a"] == -params["COUNT_CURRENT_A"] and values["v_d_v"] == -params["COUNT_VOLTAGE_V"]
    assert values["reference_rpm"] == -params["COUNT_SPEED_RPM"] and values["estimate_rpm"] == -params["COUNT_SPEED_RPM"] / 65536
    assert values["angle_deg"] == 360.0 * 65535 / 65536 and values["limits"] == 65535


def test_vectors_are_turned_forward_by_the_angle():
    values = {"angle_deg": 30.0, "v_d_v": -1.0, "v_q_v": 2.0, "i_d_a": 1.0, "i_q_a": 0.0}
    assert RealBoard._vectors(values) == {"v": [[-1.866, 1.232]], "i": [[0.866, 0.5]]}


def test_a_firmware_without_a_scope_or_a_port_without_a_board_is_one_line():
    params, without = parts().library.params, symbols.Symbols({name: item for name, item in SYMBOLS.variables.items() if not name.startswith("scope_command")})
    refusal(lambda: Watch(without, params), "scope_command.mode", "SCOPE 1")
    refused(command("--library", str(parts().library.path), "--elf", str(parts().symbols), "--port", "/dev/nothing", main=main),
            "cannot open the port", "/dev/nothing")


@pytest.fixture
def taken(terminals):
    """A serial port that another program has."""
    serial = pytest.importorskip("serial")
    ends = os.openpty()
    with serial.Serial(os.ttyname(ends[1]), exclusive=True) as other:
        yield other.port
    for end in ends:
        os.close(end)


def test_a_port_that_cannot_be_opened_is_one_line_that_says_why(tmp_path, taken):
    pytest.importorskip("serial")
    (tmp_path / "notes.txt").write_text("nothing", encoding="utf-8")
    for port, why in ((str(tmp_path / "none"), "(No such file or directory)"), (str(tmp_path), "(Is a directory)"),
                      ("/dev/null", "(it is no serial port)"), (str(tmp_path / "notes.txt"), "(it is no serial port)"),
                      (taken, "(another program has it)")):
        assert refusal(lambda port=port: connect(port), f"cannot open the port {why}, {port}: ").count(port) == 1
    assert (tmp_path / "notes.txt").read_text(encoding="utf-8") == "nothing"


def test_a_line_keeps_what_the_board_cannot_take_yet():
    line = Line()
    line.write(b"abcdef")
    line.exchange(lambda text: 4, "xyz")
    assert line.sent == b"ef" and line.read(2) == b"xy" and line.read(9) == b"z" and line.read(9) == b""
