"""The scope on the page of make live: symbols, units, and traces that the firmware's own scope records and sends over its serial line."""

import contextlib
import math
import re
import struct
import time

import numpy as np
import pytest
from live_support import Living, bench, known, parts, recorder_parts, until
from support import refusal

from tools.bench import recorder
from tools.live import board, record, symbols
from tools.live.lnet import Channel, Lnet, ScopeState, Trigger
from tools.live.scale import RAW, scale_of
from tools.live.recording import Origin
from tools.live.scope import FAULT, STATE, Scope
from tools.live.symbols import Symbols
from tools.live.virtual_board import VirtualBoard

pytestmark = pytest.mark.waits

SYMBOLS = known()
KNOWN = SYMBOLS.variables
WISH = {"channels": [], "trigger": None, "level": 0.0, "rising": True, "position": 0.25, "factor": 2, "mode": "single"}
I_Q, ANGLE, SPEED = "board_drive.run.control.i_q13.q", "board_drive.angle", "board_drive.run.estimator.omega_erpm"


# ---- names and units -------------------------------------------------------------------------------------------------------
def test_scales_are_those_that_the_virtual_board_has_for_the_same_quantity():
    board = bench()
    params, names = board.library.params, {"ParkParm.qIq": "A", I_Q: "A", "ParkParm.qVd": "V", "board_drive.run.control.v_q14.d": "V", ANGLE: "°",
                                           "EstimParm.qOmegaMr": "rpm", SPEED: "rpm", "board_drive.bus_q31": "V", "board_drive.state": "",
                                           "board_drive.run.estimator.rho_q32": "°"}
    assert {name: scale_of(name, params).unit for name in names} == names and set(names) <= KNOWN.keys()
    assert scale_of("board_drive.state", params) == RAW and scale_of(ANGLE, params).per_count * 65536 == 360.0
    assert scale_of(I_Q, params).per_count == pytest.approx(4.0 * scale_of("ParkParm.qIq", params).per_count)


def test_a_quantity_has_one_full_scale_whatever_format_its_variables_have():
    params = parts().library.params
    full = {"A": params["COUNT_CURRENT_A"] * 2 ** 13, "V": params["COUNT_VOLTAGE_V"] * 2 ** 14, "rpm": params["COUNT_SPEED_RPM"]}
    formats = {}
    for name in KNOWN:
        scale, bits = scale_of(name, params), re.search(r"_q(\d+)(\.\w+)?$", name)
        if bits and scale.unit in full and "bus" not in name:
            formats.setdefault((scale.unit, bits[1]), set()).add(scale.per_count * 2 ** int(bits[1]) / full[scale.unit])
        if scale.unit == "°":
            assert scale.per_count * 2 ** (8 * KNOWN[name].bytes) == 360.0, name
    assert formats.keys() == {("A", "13"), ("A", "26"), ("V", "13"), ("V", "14"), ("rpm", "16")}
    assert all(ratios == {1.0} for ratios in formats.values()), formats
    assert scale_of("EstimParm.qEsqf", params) == scale_of("board_drive.run.estimator.e_q13.beta", params)


@pytest.mark.parametrize("bytes_, signed, data, value", [
    (2, True, b"\xfe\xff", -2), (2, True, b"\x00\x80", -32768), (2, False, b"\xfe\xff", 65534), (4, True, b"\xfe\xff\xff\xff", -2),
    (4, False, b"\x01\x00\x00\x80", 0x80000001), (1, True, b"\x80", -128), (2, True, b"\x34\x12", 0x1234)])
def test_a_number_keeps_its_sign_and_the_order_of_its_bytes(bytes_, signed, data, value):
    variable = symbols.Variable("x", 0x0800, bytes_, signed)
    assert variable.value(data + b"\xff\xff") == value and variable.data(value) == data
    if bytes_ > 1:
        assert struct.unpack("<" + variable.channel.format, data) == (value,)
    refusal(lambda: variable.data(1 << 8 * bytes_), "does not fit")


class SetUp:
    """A link that remembers what the scope is set up for."""

    def scope_setup(self, channels, trigger, delay, factor) -> None:
        self.trigger, self.delay = trigger, delay


@pytest.mark.parametrize("name, level, count", [
    (I_Q, -1e6, -32768), (I_Q, 1e6, 32767), (I_Q, -0.5, -931), (ANGLE, -10.0, 0), (ANGLE, 270.0, 49152), (ANGLE, 1000.0, 65535)])
def test_a_level_is_in_counts_and_stops_at_the_ends_of_its_variable(name, level, count):
    link, scope = SetUp(), Scope(EmptyLink, SYMBOLS, parts().library.params, lambda message: None)
    scope._start(link, scope._read(WISH | {"channels": [I_Q], "trigger": name, "level": level, "position": 0.5}), True, 202)
    assert link.trigger == Trigger(KNOWN[name].address, count, True, KNOWN[name].signed) and link.delay == -50


def test_trigger_and_delay_reach_the_line_with_their_signs():
    falls = Trigger(0x0900, 0xFFF0, rising=False, signed=False)
    for trigger, kind, level, edge in ((Trigger(0x0900, -5), 0xA2, b"\xfb\xff", 1), (falls, 0x82, b"\xf0\xff", 0)):
        link = Lnet(None)
        link.request = lambda service, arguments, link=link: setattr(link, "sent", arguments)
        link.scope_setup([Channel(0x0800), Channel(0x0802, 4)], trigger, -3, 2)
        assert link.sent[-14:] == bytes([kind, 0]) + struct.pack("<I", 0x0900) + level + struct.pack("<iBB", 18, edge, 1)


# ---- traces ------------------------------------------------------------------------------------------------------------------
class Turning(Living):
    """A board whose motor turns, with its scope."""

    def __init__(self) -> None:
        super().__init__(SYMBOLS)
        for command in ({"set": ["input.pot", 0.5]}, {"press": "S2"}, {"release": "S2"}):
            self.board.act(command)
        self.board.run(3.0)
        assert self.board.state == "CLOSED"
        self.maker.start()

    def ask(self, **wish) -> None:
        self.messages.clear()
        self.board.scope.ask(WISH | {"channels": [I_Q]} | wish)


@pytest.fixture(scope="module")
def living():
    with contextlib.closing(Turning()) as item:
        yield item


def test_a_trace_is_what_the_motor_does_in_its_units_and_times(living):
    living.ask(channels=[ANGLE, I_Q, "board_drive.run.control.v_q14.q"])
    trace = living.trace()
    rows = np.array(trace["rows"])
    assert trace["units"] == ["°", "A", "V"] and trace["triggered"] is False and len(rows) > 100
    assert np.diff(rows[:, 0]) == pytest.approx(1e-4) # two periods
    turned = np.diff(np.unwrap(np.radians(rows[:, 1]))).mean() / 1e-4
    rpm = living.board.board.get("plant.speed_rpm")
    assert turned * 30.0 / math.pi / living.board.rated.pole_pairs == pytest.approx(rpm, rel=0.01)
    assert rows[:, 3].mean() == pytest.approx(living.board.board.get("fw.v_q_v"), rel=0.05)


@pytest.mark.parametrize("rising, position", [(True, 0.0), (True, 0.5), (False, 0.25)])
def test_the_trigger_stands_at_zero_where_the_value_crosses_its_level(living, rising, position):
    level = 180.0 if rising else 90.0
    living.ask(channels=[ANGLE, I_Q], trigger="EstimParm.qRho" if not rising else ANGLE, level=level if rising else 0.0, rising=rising, position=position)
    trace = living.trace()
    rows = np.array(trace["rows"])
    zero = int(np.argmin(np.abs(rows[:, 0])))
    assert zero == round(position * (len(rows) - 1)) and trace["triggered"] is True
    if rising and zero:
        assert rows[zero - 1, 1] < level <= rows[zero, 1]


def test_single_gives_one_trace_and_auto_gives_more_even_without_a_trigger(living):
    living.ask(mode="single")
    living.trace()
    time.sleep(0.3) # as long as several traces
    assert len(living.traces()) == 1 and living.board.scope.told["setup"]["mode"] == "stop"
    living.ask(mode="auto", trigger="board_drive.fault", level=5.0) # which never comes
    until(lambda: len(living.traces()) >= 2, "no second trace")
    living.ask(mode="normal", trigger="board_drive.fault", level=5.0)
    time.sleep(0.8) # longer than auto would have waited
    assert not living.traces()
    living.ask(mode="stop")


def test_a_trigger_on_the_state_catches_a_start(living):
    living.click_s2()
    until(lambda: living.board.state == "STOPPED", "it does not stop")
    living.ask(channels=["board_drive.state", I_Q], trigger="board_drive.state", level=4.0, mode="normal", factor=10)
    time.sleep(0.3) # until it is set up
    living.click_s2()
    rows = np.array(living.trace()["rows"])
    before, after = rows[rows[:, 0] < -1e-6], rows[rows[:, 0] >= -1e-6]
    assert set(before[:, 1]) == {3.0} and set(after[:, 1]) == {4.0} # from ALIGN to RAMP
    until(lambda: living.board.state == "CLOSED", "it does not start")


def test_a_power_up_meanwhile_does_not_end_the_scope(living):
    living.ask(mode="auto")
    living.trace()
    living.do(power=True)
    living.messages.clear()
    living.trace()
    living.ask(mode="stop")


class EmptyLink:
    """A firmware whose scope was reset before it had a row."""

    answer_s = 1.0

    def scope_state(self) -> ScopeState:
        return ScopeState(0, 1, 1, 0, 0x0800, 0, 0, 0, 800)

    def scope_setup(self, *settings) -> None:
        pass

    def scope_read(self) -> list:
        return []


def test_a_trace_without_rows_is_none():
    published: list[dict] = []
    scope = Scope(EmptyLink, SYMBOLS, parts().library.params, published.append)
    scope.ask({"channels": [I_Q], "trigger": None, "level": 0.0, "rising": True, "position": 0.0, "factor": 1, "mode": "auto"})
    scope._round(EmptyLink())
    assert [message for message in published if "trace" in message] == [] and scope.trace is None


@pytest.mark.parametrize("wish, part", [
    ({"channels": []}, "no channel"), ({"channels": ["nothing"]}, "no variable 'nothing'"), ({"channels": [["x"]]}, "no variable"),
    ({"channels": [I_Q] * 9}, "9 words"),
    ({"channels": ["board_lnet.first[0]"]}, "neither 16 nor 32"), ({"trigger": "board_drive.bus_q31"}, "has not 16"), ({"mode": "always"}, "choose one of auto"),
    ({"factor": 0}, "choose 1 .. 1000"), ({"position": 1.5}, "choose 0 .. 1"), ({"level": "high"}, "'level' = high"), ({"more": 1}, "no setup")])
def test_a_setup_that_makes_no_sense_is_refused_in_one_line(living, wish, part):
    before = living.board.scope.setup
    refusal(lambda: living.ask(**wish), part)
    assert living.board.scope.setup is before


# ---- a fault -----------------------------------------------------------------------------------------------------------------
def test_what_waits_for_a_fault_is_a_setup_that_the_firmware_takes(living):
    setup = living.board.scope.hello()["fault"]
    link, scope = SetUp(), Scope(EmptyLink, SYMBOLS, parts().library.params, lambda message: None)
    scope._start(link, scope._read(setup), True, 848)
    assert len(setup["channels"]) == 8 and link.trigger == Trigger(KNOWN[STATE].address, 7, True, KNOWN[STATE].signed) and link.delay == -39


@pytest.mark.parametrize("codes, name", [([0, 0, 16], "OPEN_PHASE"), ([6, 6, 6], "STALL"), ([16, 0, 0], None), ([99, 99, 99], None)])
def test_a_trace_has_the_fault_that_it_ends_with(codes, name):
    published: list[dict] = []
    scope = Scope(EmptyLink, SYMBOLS, parts().library.params, published.append)
    setup = scope._read(WISH | {"channels": [I_Q, FAULT]})
    scope._hand_on(setup, [(0, code) for code in codes])
    scope._hand_on(scope._read(WISH | {"channels": [I_Q]}), [(16,)])
    assert [message["trace"]["fault"] for message in published if "trace" in message] == [name, None]


def test_the_fault_recorders_rows_are_a_trace_however_their_text_is_cut():
    made = recorder_parts()
    item, messages = VirtualBoard(made.library, Origin(made.motor, made.board, ["SCOPE=0"], {}), Symbols.read(made.symbols)), []
    item.start(messages.append)
    item.act({"press": "S2"})
    item.run(0.2)
    item.act({"release": "S2"})
    item.run(2.5)
    item.act({"fault": ["open_b", True]})
    said: list[str] = []
    feed = item.records.feed
    item.records.feed = lambda text: (said.append(text), feed(text))[1]
    for _ in range(100):
        item.run(0.02)
    trace, = (message["trace"] for message in messages)
    text = "".join(said)
    assert item.scope is None and item.kept is None and item.hello()["recorder"]["trace"] is trace and trace["fault"] == "OPEN_PHASE"
    rows = recorder.scaled(recorder.of_text(text)[0], made.library.params, made.library.states)
    table = np.array(trace["rows"], float)
    for number, wanted in enumerate((rows.time_ms / 1000.0, rows.i_a, rows.i_b, rows.v_d, rows.v_q, rows.angle_deg, rows.speed_rpm, rows.bus_v)):
        assert table[:, number] == pytest.approx(wanted, rel=1e-5, nan_ok=True)
    assert [7 <= np.isfinite(table[:, number]).sum() <= 8 for number in (6, 7)] == [True, True] and table[:, 8].tolist() == [5.0] * 48 + [7.0] * 16
    reader = record.Records(made.library.params, made.library.states)
    found = [trace for letter in text + text for trace in [reader.feed(letter)] if trace]
    assert found == [trace, trace] and reader.feed("row 3 1 2\r\n" * 100) is None and len(reader.text) <= record.LONGEST_LINE


def test_without_the_scope_nothing_can_be_kept():
    made = board.parts(defines="-DPARAMS_IN_RAM -DPARAMS_KEPT=1 -DSCOPE=0")
    item = VirtualBoard(made.library, Origin(made.motor, made.board, [], {}), Symbols.read(made.symbols))
    assert item.kept is None and item.hello()["kept"] is False


@pytest.mark.parametrize("params, names, part", [
    ({"RECORDER_PERIODS": 4.0}, ["board_recorder.left"], "its rows come after the next fault"), ({"RECORDER_PERIODS": 0.0}, [], "RECORDER_PERIODS is 0"),
    ({"RECORDER_PERIODS": 4.0}, ["SnapDone"], "SNAPSHOT has the fault recorder's place"), ({"RECORDER_PERIODS": 4.0}, ["board_params.speed_kp_q13"], "PARAMS_IN_RAM or TUNING has"),
    ({"RECORDER_PERIODS": 4.0}, ["board_bringup.step"], "BRINGUP has"), ({"RECORDER_PERIODS": 4.0}, ["IdentifyParm.r"], "IDENTIFY has")])
def test_a_firmware_without_a_recorder_says_what_to_build(params, names, part):
    said = record.told(Symbols(dict.fromkeys(names)), params)
    assert part in said and ("SCOPE 1" in said) == (said != record.COMES)


@pytest.mark.parametrize("defines, variable", [("-DSNAPSHOT", "SnapDone"), ("-DTUNING", "board_params"), ("-DBRINGUP", "board_bringup")])
def test_a_mode_that_takes_the_recorders_place_is_known_by_its_variables(defines, variable):
    found = Symbols.read(board.parts(defines=f"{defines} -DSCOPE=0").symbols)
    assert record.TAKEN[variable] in record.told(found, {"RECORDER_PERIODS": 4.0})
    assert record.told(known(), {"RECORDER_PERIODS": 4.0}) == record.COMES


def test_the_scope_is_on_unless_somebody_says_otherwise():
    assert board.with_scope([]) == ["SCOPE=1"] and board.with_scope(["SCOPE=1"]) == ["SCOPE=1"] and board.with_scope(["TUNING", "SCOPE=0"]) == ["TUNING", "SCOPE=0"]
