"""The loops of the running motor on the page of make live: measured over the scope's link, refused, cancelled, and what is told of it."""

import contextlib
import csv
import ctypes
import io
import itertools
import json
import time

import pytest
from live_browser import PATIENCE_S, PLACES, SEEN, Page, accessible, dark, inside, overlapping, resized
from live_support import Living, kept_parts, known, parts, recorder_parts, served, until
from support import refusal

from tools.bench.scenario import BRAKE
from tools.live import board, response, step
from tools.live.loop_response import FOLLOWS, LoopResponse
from tools.live.pace import Pacemaker
from tools.live.recording import Origin
from tools.live.response_model import COLUMNS, WITHIN_DEG, gains_of
from tools.live.step_response import NO_BRAKE
from tools.live.symbols import Symbols
from tools.live.virtual_board import VirtualBoard

pytestmark = pytest.mark.waits

LOAD_SHARE = 0.4
"""Of the rated torque: the current is clear of what dead time loses."""
LEFT = known().find(f"{response.SINE}.left")
TRACE = {"channels": ["board_drive.angle"], "trigger": None, "level": 0.0, "rising": True, "position": 0.0, "factor": 1, "mode": "auto"}


class Loops(Living):
    """A board whose loops are measured at few frequencies, once each."""

    def __init__(self) -> None:
        super().__init__(known())
        self.maker.start()
        self.loops = self.board.loops
        self.loops.count, self.loops.rounds = 4, 1
        self.do(set=[BRAKE, LOAD_SHARE * self.board.rated.rated_torque_nm])
        self.do(set=["input.pot", 0.5])

    def turning(self) -> None:
        """In CLOSED, whatever was before."""
        if self.board.state == "FAULT":
            self.click_s2()
            self.state("STOPPED")
            until(lambda: not self.board.releases, "S2 is still pressed")
            time.sleep(0.2) # until the firmware has seen it come up
        if self.board.state != "CLOSED":
            self.click_s2()
            self.state("CLOSED")

    def state(self, name: str) -> None:
        until(lambda: self.board.state == name, lambda: f"not {name}: {self.board.state}")

    def measured(self) -> dict:
        """How the measurement has ended."""
        until(lambda: self.loops.asked is None and not self.loops.told["running"], lambda: f"it does not end: {self.loops.told}", 4 * PATIENCE_S)
        return self.loops.told

    def first_point(self) -> None:
        until(lambda: self.loops.told["done"] >= 1, lambda: f"no point: {self.loops.told['said']}")

    def left(self) -> int:
        """Of the firmware's sine, read in the link's thread."""
        scope, found = self.board.scope, []
        beat = scope.beat

        def once(link) -> None:
            scope.beat = beat
            found.append(LEFT.value(link.read(LEFT.address, LEFT.bytes)))
        scope.beat = once
        return until(lambda: found, "nothing read")[0]


@pytest.fixture(scope="module")
def living():
    with contextlib.closing(Loops()) as item:
        yield item


def test_a_motor_that_stands_is_refused_and_nothing_is_there_to_cancel_or_to_save(living):
    living.state("STOPPED")
    refusal(lambda: living.do(measure="speed"), "loops and steps are measured while the motor turns, in CLOSED, loops: start the motor")
    refusal(lambda: living.do(measure="cancel"), "nothing is being measured")
    refusal(lambda: living.do(measure="sped"), "no loop 'sped', loops: choose one of current, speed")
    refusal(living.board.loop, "no loop is measured yet")
    frame = living.maker.call(living.board.frame).result(5)
    assert set(frame["measurable"]["why"]) == {"speed", "current", "step current", "step speed", "step load"}
    assert all("in CLOSED" in why for why in frame["measurable"]["why"].values()) and frame["measurable"]["old"] == []
    for wish, says in (({"step": "loads", "size": 10}, "no step 'loads'"), ({"step": "load"}, "no step 'None'"), ({"step": "load", "size": 101}, "choose 5 .. 100 % of the rated torque"),
                       ({"step": "speed", "size": True}, "is impossible"), ({"step": "speed", "size": 10}, "in CLOSED")):
        refusal(lambda wish=wish: living.do(measure=wish), says)
    refusal(living.board.step, "no step is measured yet")


def test_the_speed_loop_of_the_running_hurst_has_the_margin_of_the_model_while_the_traces_wait(living):
    living.turning()
    living.loops.count = 9
    living.board.scope.ask(TRACE)
    living.trace()
    beats, beat = itertools.count(), living.board.scope.beat
    living.board.scope.beat = lambda link: (next(beats), beat(link))
    living.do(measure="speed")
    until(lambda: living.board.scope.told["status"] == "lent", "the traces go on")
    living.messages.clear()
    refusal(lambda: living.do(measure="current"), "the speed loop is being measured, loops: cancel that or wait")
    living.board.scope.ask(TRACE | {"factor": 2})
    assert living.board.scope.told["status"] == "lent"
    before = next(beats)
    living.first_point()
    assert next(beats) > before + 5 and not living.traces()
    told = living.measured()
    living.loops.count = 4
    assert told["said"] == "9 points measured" and (told["done"], told["of"], len(told["points"])) == (9, 9, 9) and told["note"] == ""
    assert told["line"][0][0] < told["points"][0][0] and told["points"][-1][0] < told["line"][-1][0]
    measured, model = told["margins"]["measured"], told["margins"]["model"]
    assert abs(measured[0] - model[0]) < WITHIN_DEG and abs(told["margins"]["difference"] - measured[0] + model[0]) < 0.02
    assert abs(measured[1] / model[1] - 1.0) < 0.1 and 20.0 < measured[1] < 30.0 and told["speed_rpm"] == pytest.approx(1475, abs=15)
    assert [message["loops"]["done"] for message in living.messages if "loops" in message][-10:] == [*range(1, 10), 9], "the curve does not grow point by point"
    assert len(living.trace()["rows"]) > 100 and living.board.scope.told["status"] == "waits"
    living.board.scope.ask(TRACE | {"mode": "stop"})
    assert living.left() == 0 and living.board.state == "CLOSED"
    rows = list(csv.reader(io.StringIO(living.maker.call(living.board.loop).result(5))))
    assert tuple(rows[0]) == COLUMNS and [[float(cell) for cell in row] for row in rows[1:]] == told["points"]
    lines = [line["text"] for line in living.board.log]
    assert "measure the speed loop" in lines and f"speed loop: phase margin {measured[0]:.1f} degrees" in lines


def test_the_current_loop_in_closed_loop_is_told_to_be_less_than_it_is(living):
    living.turning()
    living.loops.count = 8
    living.do(measure="current")
    told = living.measured()
    living.loops.count = 4
    assert told["loop"] == "current" and told["note"] == FOLLOWS and told["done"] == told["of"] == 8
    assert 900.0 < told["margins"]["measured"][1] < 1250.0 and abs(told["margins"]["difference"]) < 10.0


@pytest.mark.parametrize("name, size, caption, peak", [
    ("current", 10, "0.275 A", 0.15), ("speed", 10, "14", 0.05), ("load", 40, "32 mN·m", None)])
def test_a_step_of_the_running_motor_is_as_the_model_says_and_nobody_has_lost_the_command(living, monkeypatch, name, size, caption, peak):
    records = 2 if name == "speed" else 4 # the mean of two is a tenth off by the current's noise, or dips as much deeper where one meets the ripple
    monkeypatch.setattr(step, "RECORDS", records)
    living.turning()
    time.sleep(0.3)
    before = living.maker.call(lambda: living.board.frame()["now"]).result(5)
    living.do(measure={"step": name, "size": size})
    refusal(lambda: living.do(measure="speed"), f"the step of the {name} is being measured, loops: cancel that or wait")
    living.measured()
    told = living.loops.steps.told
    assert told["said"] == f"mean of {records} steps" and told["caption"].startswith(f"Step of the {name}, {caption}") and " at 14" in told["caption"], told
    assert len(told["time_ms"]) == len(told["measured"]) == len(told["model"]) > 50 and told["time_ms"][0] < 0.0 < told["time_ms"][-1]
    measured, model = told["figures"]["measured"], told["figures"]["model"]
    if name == "load":
        assert 0.9 * model["peak"] < measured["peak"] < model["peak"] + 55.0 / 1400.0 and measured["settled_s"] is not None
    else:
        assert abs(measured["rise_s"] / model["rise_s"] - 1.0) < 0.3 and measured["peak"] < peak and 0.0 < told["ripple"] < 0.1
    assert bool(told["note"]) == (name == "current")
    after = living.maker.call(lambda: living.board.frame()["now"]).result(5)
    assert after["target_rpm"] == pytest.approx(before["target_rpm"], abs=10.0) and living.board.board.get(BRAKE) == living.board.settings[BRAKE] and living.board.state == "CLOSED"
    assert living.left() == 0
    rows = list(csv.reader(io.StringIO(living.maker.call(living.board.step).result(5))))
    assert rows[0] == ["time_s", "measured", "model"] and [float(row[1]) for row in rows[1:]] == told["measured"]
    assert living.board.loops.hello()["answer"] == told


def test_a_speed_step_that_ends_early_gives_the_command_back_and_s2_still_stops_the_motor(living, monkeypatch):
    living.turning()
    living.do(measure={"step": "speed", "size": 10})
    until(lambda: living.loops.steps.told["said"].startswith("1 of"), lambda: str(living.loops.steps.told))
    living.do(measure="cancel")
    living.measured()
    assert living.loops.steps.told["said"] == "cancelled" and living.loops.steps.told["figures"] is None and living.board.state == "CLOSED"
    living.do(measure={"step": "speed", "size": 10})
    until(lambda: living.loops.steps.told["said"].startswith("1 of"), lambda: str(living.loops.steps.told))
    living.click_s2()
    living.measured()
    assert "the motor has left CLOSED" in living.loops.steps.told["said"]
    living.state("STOPPED")
    living.turning()
    monkeypatch.setattr(living.loops, "params", {**living.loops.params, "MAXIMUM_SPEED_RPM": 1800.0})
    living.do(measure={"step": "speed", "size": 30})
    living.measured()
    assert living.loops.steps.told["said"].startswith("the step goes beyond MAXIMUM_SPEED_RPM, 1800") and living.board.state == "CLOSED"


def test_cancel_ends_the_sine_and_what_was_measured_stays(living):
    living.turning()
    living.do(measure="speed")
    living.first_point()
    living.do(measure="cancel")
    told = living.measured()
    assert told["said"] == "cancelled; 1 of 4 points measured" and len(told["points"]) == 1 and len(told["line"]) > 50
    assert living.left() == 0 and living.board.state == "CLOSED" and living.board.scope.told["status"] == "stop"
    living.maker.call(living.board.frame).result(5) # which takes the news
    assert "speed loop: cancelled; 1 of 4 points measured" in [line["text"] for line in living.maker.call(lambda: list(living.board.log)).result(5)]


@pytest.mark.parametrize("command, words", [({"fault": ["open_b", True]}, "FAULT, fault OPEN_PHASE"), ({"press": "S2"}, "fault NONE"), ({"power": True}, "fault NONE")])
def test_a_motor_that_faults_stops_or_loses_its_power_meanwhile_ends_the_measurement_by_name(living, command, words):
    living.turning()
    living.do(measure="speed")
    living.first_point()
    living.do(**command)
    told = living.measured()
    living.do(release="S2")
    living.do(fault=["open_b", False])
    assert told["said"].startswith("the motor has left CLOSED at ") and words in told["said"] and told["said"].endswith("; 1 of 4 points measured")
    assert len(told["points"]) == 1 and "\n" not in told["said"] and living.left() == 0
    until(lambda: living.board.scope.told["status"] == "stop", "the scope does not come back")


def test_a_motor_that_stops_within_a_point_is_told_at_once(living, monkeypatch):
    living.turning()
    monkeypatch.setattr(living.loops, "rounds", 20) # of 2 s each
    living.do(measure="speed")
    until(lambda: living.loops.told["of"], "it does not begin")
    living.click_s2()
    begun_s = time.monotonic()
    told = living.measured()
    assert time.monotonic() - begun_s < 10.0 and "the motor has left CLOSED" in told["said"] and told["said"].endswith("; 0 of 4 points measured")


def test_a_speed_that_does_not_stay_is_told(living, monkeypatch):
    living.turning()
    monkeypatch.setattr(response, "SPEED_SHARE", -1.0)
    monkeypatch.setattr(response.Bench.settles, "__defaults__", (1.0,))
    living.do(measure="speed")
    told = living.measured()
    assert told["said"].startswith("the speed does not stay where it is") and told["points"] == []


def test_a_sine_that_ends_before_its_record_is_no_point(living, monkeypatch):
    living.turning()
    monkeypatch.setattr(response, "SPARE_S", -1.2)
    living.do(measure="speed")
    told = living.measured()
    assert "has ended before its record" in told["said"] and told["points"] == [] and living.board.state == "CLOSED"


def test_a_firmware_without_the_sine_has_no_such_panel():
    made = recorder_parts()
    item = VirtualBoard(made.library, Origin(made.motor, made.board, ["SCOPE=0"], {}), Symbols.read(made.symbols))
    assert item.loops is None and item.hello()["loops"] is None and item.frame()["measurable"] is None
    refusal(lambda: item.act({"measure": "speed"}), "no such command")
    refusal(item.loop, "the firmware has no sine")


@pytest.mark.parametrize("modes, state, speed, current", [
    ([], "CLOSED", True, True), ([], "RAMP", False, False), ([], "STOPPING", False, False), ([], "", False, False),
    (["OPEN_LOOP_FUNCTIONING"], "RAMP", False, True), (["OPEN_LOOP_FUNCTIONING=1"], "ALIGN", False, False), (["TORQUE_MODE"], "CLOSED", False, True)])
def test_which_loop_can_be_measured_in_which_state_and_mode(modes, state, speed, current):
    loops = LoopResponse(known(), parts().library.params, None, modes, time.monotonic)
    can = {name for name, why in loops.refusals(state).items() if why is None}
    assert can == {name for name, it_can in (("speed", speed), ("step speed", speed), ("current", current), ("step current", current)) if it_can}
    assert loops.refusals("CLOSED")["step load"].startswith("TORQUE_MODE has no" if "TORQUE_MODE" in modes else "a load step needs the virtual motor's brake")


def test_the_current_loop_with_the_forced_angle_has_the_margin_of_the_model():
    made = board.parts(defines="-DOPEN_LOOP_FUNCTIONING")
    item = VirtualBoard(made.library, Origin(made.motor, made.board, ["OPEN_LOOP_FUNCTIONING", board.SCOPE], {}), Symbols.read(made.symbols))
    maker = Pacemaker(item, lambda frame: None)
    item.start(lambda message: None)
    maker.start()
    try:
        item.loops.count, item.loops.rounds = 9, 1
        for command in ({"set": ["input.pot", 0.5]}, {"press": "S2"}, {"release": "S2"}):
            maker.call(lambda command=command: item.act(command)).result(5)
        until(lambda: item.state == "RAMP", "it does not turn")
        maker.call(lambda: item.act({"measure": "current"})).result(5)
        until(lambda: not item.loops.told["running"], lambda: str(item.loops.told), 4 * PATIENCE_S)
        told = item.loops.told
        assert told["done"] == told["of"] and told["note"] == "" and item.state == "RAMP", told
        assert abs(told["margins"]["difference"]) < WITHIN_DEG and 900.0 < told["margins"]["measured"][1] < 1100.0
    finally:
        item.end()
        maker.end()


def test_the_models_gains_are_those_of_the_parameters_that_are_variables():
    made = kept_parts()
    symbols, params = Symbols.read(made.symbols), made.library.params

    class Memory:
        """A link to the parameters of the PC's firmware, and to nothing else."""

        def read(self, address: int, n: int) -> bytes:
            return bytes(there[address - first:address - first + n]) if 0 <= address - first < len(there) else bytes(n)

    members = [item for name, item in symbols.variables.items() if name.startswith("board_params.")]
    first = min(item.address for item in members)
    there = (ctypes.c_ubyte * (max(item.address + item.bytes for item in members) - first)).in_dll(made.library.c, "board_params")
    bench = response.Bench(response.Firmware(Memory(), symbols), params)
    gains = gains_of(bench)
    assert (gains.kp_d, gains.kp_q, gains.ki) == pytest.approx([params[f"CURRENT_{name}"] for name in ("KP_D", "KP_Q", "KI")], rel=2e-3)
    kp = symbols.find("board_params.pi_q.kp")
    before, there[kp.address - first + 1] = there[kp.address - first + 1], 0
    assert gains_of(bench).kp_q < 0.5 * gains.kp_q and gains_of(bench).kp_d == gains.kp_d
    there[kp.address - first + 1] = before


# ---- the page ------------------------------------------------------------------------------------------------------------------
SAID = "document.getElementById('loops-said').textContent"
WHOLE = """(() => { const line = Array.from({ length: 80 }, (_, n) => [2.4 * 42 ** (n / 79), 30 - 45 * n / 79, -150 - 0.9 * Math.abs(n - 40)]);
    const points = Array.from({ length: 25 }, (_, n) => { const [hz, db, deg] = line[3 * n + 1]; return [hz, db + 0.5, deg + 362, db, deg, 0.02]; });
    const times = Array.from({ length: 200 }, (_, n) => n * 3 - 60), curve = times.map((ms) => ms < 0 ? 0 : 1 - Math.exp(-ms / 30) * Math.cos(ms / 40));
    const answer = { step: "speed", said: "mean of 8 steps", note: "A note of the step.", caption: "Step of the speed, 147 rpm at 1474 rpm", time_ms: times, measured: curve, model: curve.map((v) => v * 0.98),
        figures: { measured: { rise_s: 0.0287, peak: 0.0148, settled_s: 0.0338 }, model: { rise_s: 0.0284, peak: -0.0001, settled_s: null } }, ripple: 0.0052 };
    views.loops.set({ answer, loop: "%s", running: false, done: 25, of: 25, said: "25 points measured", speed_rpm: 1474, line, points, note: "%s",
        margins: { measured: [55.8, 24.8], model: [51.3, 24.7], difference: 4.5, within: 3 } }); })()""" % ("current", FOLLOWS)


@pytest.fixture(scope="module")
def page(chromium, server) -> Page:
    """A page of which no loop was measured."""
    return Page(chromium[0], server.url)


def focused(page: Page) -> str:
    return page.run("return document.activeElement.id")


def test_the_keyboard_alone_measures_and_cancels_and_the_curve_grows(page, chromium):
    from selenium.webdriver import ActionChains

    def press(key: str) -> None:
        ActionChains(page.driver).send_keys(key).perform()
    resized(page, 1280)
    page.state("STOPPED")
    page.wait("return document.getElementById('measure-speed').disabled && document.getElementById('measure-cancel').disabled", "it can be measured at rest")
    assert page.text("#loops-why") == "loops and steps are measured while the motor turns, in CLOSED" and not page.one("#loops-result").is_displayed()
    page.slide("load.constant_nm", 0.03)
    inside(page, "link.send({ set: ['input.pot', 0.5] })")
    page.click("[data-button=S2]")
    page.state("CLOSED")
    page.wait("return !document.getElementById('measure-current').disabled", "it cannot be measured")
    page.run("document.getElementById('scope-factor').focus()")
    press("\ue004")
    assert focused(page) == "measure-speed"
    press("\ue004")
    assert focused(page) == "measure-current"
    press("\ue007") # Enter
    page.wait("return document.activeElement.id === 'measure-cancel'", "the focus stays on a button that is disabled")
    assert page.wait(f"return /^current loop: 1 of 25$/.test({SAID})", "no progress") and page.text("#scope-status") == "suspended while a loop is measured"
    assert page.text("#loops-why") == "the current loop is being measured" and not page.one("#measure-speed").is_enabled()
    page.wait("return document.querySelectorAll('#loops-plot circle').length === 4 && document.querySelectorAll('#loops-numbers tr').length === 3", "no second point")
    press("\ue007")
    page.wait(f"return {SAID}.startsWith('current loop: cancelled; ') && document.activeElement.id === 'measure-current'", "no end, or the focus is lost")
    assert page.text("#scope-status") == "stopped" and len(page.driver.find_elements("css selector", "#loops-plot circle")) >= 4
    page.click("#save-loop")
    file = chromium[1] / "loop.csv"
    until(lambda: file.exists() and file.read_text(encoding="utf-8").startswith("hz,measured_db,"), "no file")
    page.click("[data-button=S2]")
    page.state("STOPPED")


@pytest.mark.parametrize("width, whole", [(width, WHOLE) for width in (360, 390, 768, 1280, 2560)] + [(360, WHOLE.replace("2.4 * 42", "160 * 24").replace("24.8]", "990]").replace("24.7]", "985]")), (1280, WHOLE.replace("2.4 * 42", "160 * 24").replace("24.8]", "990]").replace("24.7]", "985]"))],
                         ids=lambda item: item if isinstance(item, int) else "low" if item == WHOLE else "high")
def test_the_panel_fits_its_window_with_all_that_it_says(page, width, whole):
    resized(page, width)
    places = inside(page, whole + ";" + PLACES)
    assert page.run("return document.documentElement.scrollWidth") <= width and overlapping(places) == [] and {"loops-numbers", "save-loop", "measure-step", "step-size", "save-step"} <= {place[0] for place in places}
    wide = page.run("""return [...document.querySelectorAll("#loops-card *")].filter((e) => e.clientWidth && !e.closest("svg") && e.scrollWidth > e.clientWidth + 1).map((e) => e.id || e.tagName)""")
    outside = page.run("""return [...document.querySelectorAll(".plot *")].filter((e) => { const r = e.getBoundingClientRect(), box = e.ownerSVGElement.getBoundingClientRect(); return r.left < box.left - 1 || r.right > box.right + 1 || r.top < box.top - 1 || r.bottom > box.bottom + 1; })
            .map((e) => e.outerHTML)""")
    assert wide == [] and outside == []
    labels = page.run("return [...document.querySelectorAll('.plot text')].map((e) => e.textContent)")
    assert {"0", "-180", "-90", "gain [dB]", "phase [°]", "Hz", "100", "ms", "change, of the step [%]"} | ({"5", "10"} if whole == WHOLE else {"500", "1000"}) <= set(labels)
    apart = page.run("""const boxes = [...document.querySelectorAll(".plot text")].map((e) => e.getBoundingClientRect());
        return boxes.flatMap((a, n) => boxes.slice(n + 1).filter((b) => a.left < b.right && b.left < a.right && a.top + 2 < b.bottom && b.top + 2 < a.bottom)).length""")
    assert apart == 0


def test_the_plot_and_the_tables_say_what_was_measured(page):
    inside(page, WHOLE)
    count = page.run("return ['circle', 'path.model', 'path.measured', '.limit', '.margin'].map((s) => document.querySelectorAll(`#loops-plot ${s}`).length)")
    assert count == [50, 2, 2, 2, 2]
    assert page.run("return [...document.querySelectorAll('#loops-margins tr')].map((row) => [...row.children].map((cell) => cell.textContent))") == [
        ["", "phase margin", "crossover"], ["measured", "55.8°", "24.8 Hz"], ["tuner's model", "51.3°", "24.7 Hz"], ["difference", "4.5°, more than 3°", "0 %"]]
    rows = page.run("return [...document.querySelectorAll('#loops-numbers tr')].map((row) => [...row.children].map((cell) => cell.textContent))")
    assert len(rows) == 26 and rows[1] == ["2.516", "29.9", "29.4", "-183.1", "-185.1"] and rows[4][2] == "24.3" and rows[3][4] == "-179.7", rows[1:5]
    assert page.run("return [...document.querySelectorAll('#step-figures tr')].map((row) => [...row.children].map((cell) => cell.textContent))") == [
        ["", "rise time", "overshoot", "settled in"], ["measured", "28.7 ms", "1.5 %", "33.8 ms"], ["tuner's model", "28.4 ms", "0.0 %", "not in the record"], ["ripple before it, RMS", "", "0.5 %", ""]]
    assert page.text("#step-said") == "step of the speed: mean of 8 steps" and page.run("return document.querySelectorAll('#step-plot path').length") == 2
    assert page.text("#loops-note") == FOLLOWS and page.text("#loops-margins caption") == "Open current loop at 1474 rpm"
    y = inside(page, """(() => { const at = (s) => [...document.querySelectorAll(`#loops-plot ${s}`)]; const label = (text) => at("text").filter((e) => e.textContent === text);
        return [at(".limit").map((e) => e.y1.baseVal.value), [label("0")[0], label("-180")[0]].map((e) => e.y.baseVal[0].value - 4)]; })()""")
    assert y[0] == pytest.approx(y[1], abs=0.1)


def test_results_of_other_parameters_are_marked_until_they_are_measured_again(page):
    said = inside(page, WHOLE + """; const now = (old) => { views.loops.show({ measurable: { ...foc33.frame.measurable, old } }); return [by("loops-said"), by("step-said")].map((e) => [e.textContent, e.className]); };
        [now(["loop"]), now(["step"]), now([])]""")
    changed = ": a parameter has changed since: measure again"
    assert said == [[["current loop: 25 points measured" + changed, "old"], ["step of the speed: mean of 8 steps", ""]],
                    [["current loop: 25 points measured", ""], ["step of the speed: mean of 8 steps" + changed, "old"]],
                    [["current loop: 25 points measured", ""], ["step of the speed: mean of 8 steps", ""]]]


def test_a_size_that_cannot_be_is_refused_at_its_field(page):
    size = page.one("#step-size")
    for text, wrong in (("200", True), ("", True), ("fast", True), ("1e1", False)):
        inside(page, f"by('step-kind').value = 'load'; by('step-kind').onchange(); by('step-size').value = {text!r}; by('measure-step').disabled = false; by('measure-step').click()")
        assert ("wrong" in size.get_attribute("class")) == wrong
        if wrong:
            assert page.text("#message") == f"step: '{text}' is impossible: choose 5 .. 100 % of the rated torque"


def test_why_a_step_cannot_be_measured_stands_there_as_soon_as_it_is_chosen(page):
    why = {"speed": None, "current": None, "step current": None, "step speed": None, "step load": NO_BRAKE}
    shown = [inside(page, f"by('step-kind').value = '{kind}'; by('step-kind').onchange(); views.loops.show({{ measurable: {{ why: {json.dumps(why)}, old: [] }} }}); [by('measure-step').disabled, by('loops-why').textContent]")
             for kind in ("load", "speed")]
    assert shown[0] == [True, NO_BRAKE] and shown[1][0] is False


@SEEN
def test_axe_finds_nothing_in_the_panel(page, pytestconfig, on, width):
    accessible(page, pytestconfig.rootpath.parent, on, width, lambda: inside(page, WHOLE))


def test_the_focus_waits_on_the_cancel_button_until_the_button_that_was_pressed_is_free(page):
    shown = [inside(page, f"{before}; views.loops.show({{ measurable: {{ why: {{ current: {why} }}, old: [] }} }}); [document.activeElement.id, by('measure-cancel').disabled]")
             for before, why in (("views.loops.told.running = false; by('measure-current').disabled = false; by('measure-current').focus(); views.loops.told.running = true", "'busy'"),
                                 ("views.loops.told.running = false", "'busy'"), ("", "null"))]
    assert shown == [["measure-cancel", False], ["measure-cancel", False], ["measure-current", True]]


def test_a_board_without_the_sine_shows_no_panel(chromium):
    with served(made_of=recorder_parts()) as running:
        assert not Page(chromium[0], running.url).one("#loops-card").is_displayed()
