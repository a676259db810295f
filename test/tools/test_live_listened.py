"""A board whose firmware has no scope on the page of make live: what its status line and its fault recorder's rows say, and nothing that cannot be asked of it."""

import csv
import io
import re
import subprocess
import sys
import time

import pytest
from live_browser import SIZE, Page, accessible, resized
from live_support import known, recorder_parts, served, until
from support import refusal

from tools.common import paths
from tools.live import listened_board, lnet
from tools.live.listened_board import DAMAGED, TELLS, ListenedBoard, has_scope
from tools.live.recording import POT, Origin
from tools.live.symbols import Symbols
from tools.live.virtual_board import VirtualBoard

MADE = recorder_parts()
SYMBOLS = Symbols.read(MADE.symbols)


class Quiet:
    """A serial line on which nothing comes by itself."""

    def read(self, size: int) -> bytes:
        time.sleep(0.01)
        return b""


class Desk:
    """A virtual board, and a page that has nothing of it but what it says."""

    def __init__(self) -> None:
        self.board = VirtualBoard(MADE.library, Origin(MADE.motor, MADE.board, ["SCOPE=0"], {}), SYMBOLS)
        self.page = ListenedBoard(Quiet(), "the motor", SYMBOLS, MADE.library)
        self.messages: list[dict] = []
        self.page.publish = self.messages.append
        self.said: list[str] = []
        feed = self.board.records.feed
        self.board.records.feed = lambda text: (self.said.append(text), feed(text))[1]
        self.heard = 0

    def passes(self, seconds: float) -> dict:
        for _ in range(round(seconds / 0.02)):
            self.board.run(0.02)
            for text in self.said[self.heard:]:
                self.page.take(text)
            self.heard = len(self.said)
        return self.page.frame()

    def s2(self) -> None:
        self.board.act({"press": "S2"})
        self.passes(0.2)
        self.board.act({"release": "S2"})


@pytest.fixture
def desk() -> Desk:
    return Desk()


def logs(desk: Desk) -> list[str]:
    return [line["text"] for line in desk.page.log]


def test_it_shows_state_speed_limits_and_fault_as_the_status_line_tells_them(desk):
    frame = desk.passes(1.2)
    assert (frame["state"], frame["fault"], frame["now"], frame["outputs"]) == ("STOPPED", "NONE", None, 0)
    assert logs(desk) == ["state STOPPED"]
    assert [row[1] for row in desk.page.strip] == [None, None] # no estimate while the bridge is off
    desk.s2()
    desk.board.act({"set": [POT, 1.0]})
    limits = [limit for _ in range(8) for limit in desk.passes(0.25)["limits"]]
    frame = desk.passes(0.6)
    assert frame["state"] == "CLOSED" and frame["outputs"] == 63 and "RAMP" in limits
    assert frame["strip"][-1][1] == pytest.approx(desk.board.board.get("plant.speed_rpm"), rel=0.1)
    desk.board.act({"fault": ["open_b", True]})
    frame = desk.passes(1.5)
    assert (frame["state"], frame["fault"]) == ("FAULT", "OPEN_PHASE") and "fault OPEN_PHASE" in logs(desk)
    desk.board.act({"fault": ["open_b", False]})
    desk.s2()
    assert desk.passes(1.0)["fault"] == "NONE" and "fault cleared" in logs(desk)


def test_the_fault_recorder_s_rows_are_the_same_trace_as_of_a_virtual_board_and_are_not_in_the_log(desk):
    desk.s2()
    desk.passes(2.5)
    desk.board.act({"fault": ["open_b", True]})
    desk.passes(2.5)
    trace, = (message["trace"] for message in desk.messages)
    assert trace == desk.board.records.trace and trace["fault"] == "OPEN_PHASE" and len(trace["rows"]) == 64
    assert desk.page.hello()["recorder"]["trace"] is trace
    assert not any(text.startswith(("row", "record", "state 7")) for text in logs(desk))


def test_a_record_that_lost_a_line_is_told_and_costs_no_other_one(desk):
    desk.s2()
    desk.passes(2.5)
    desk.board.act({"fault": ["open_b", True]})
    desk.passes(2.5)
    text, page, traces = "".join(desk.said), ListenedBoard(Quiet(), "the motor", SYMBOLS, MADE.library), []
    page.publish = lambda message: traces.append(message["trace"])
    record = text[text.index("record fault"):]
    page.take(re.sub(r"row 30 .*\r\n", "", record))
    page.take("state 7 fault OPEN_PHASE speed 0 rpm\r\n" * 20)
    assert traces == [] and DAMAGED not in [line["text"] for line in page.frame()["log"]]
    page.take(record)
    assert len(traces) == 1 and traces[0]["fault"] == "OPEN_PHASE" and DAMAGED in [line["text"] for line in page.frame()["log"]]
    page.take(record.partition("row 30 ")[0])
    for _ in range(400): # and no second one comes
        page.take("state 7 fault OPEN_PHASE speed 0 rpm\r\n")
    assert [line["text"] for line in page.frame()["log"]] == [DAMAGED] and len(page.records.text) <= 200
    page.take(record + record) # two at once
    assert len(traces) == 2


@pytest.mark.parametrize("size", [1, 7, 100])
def test_however_the_text_is_cut_the_same_is_shown(desk, size):
    desk.passes(1.2)
    desk.s2()
    desk.passes(1.5)
    text, other = "".join(desk.said), ListenedBoard(Quiet(), "the motor", SYMBOLS, MADE.library)
    for at in range(0, len(text), size):
        other.take(text[at:at + size])
    frame = other.frame()
    assert [row[1] for row in frame["strip"]] == [row[1] for row in desk.page.strip] and [line["text"] for line in other.log] == logs(desk)


def test_what_the_board_says_after_a_reset_is_in_the_log_though_it_comes_first(desk):
    desk.page.take("foc33 0.10.0 reset BOR POR\r\n")
    desk.page.frame()
    assert logs(desk) == ["foc33 0.10.0 reset BOR POR"]


def test_a_first_line_without_its_beginning_and_what_is_no_text_are_left_out_and_other_lines_are_told(desk):
    desk.page.take("fault NONE speed 12 rpm\r\nkept BROKEN\r\n\x55\x01\x02\r\n" + "x" * 5000)
    assert desk.page.frame()["strip"] == [] and logs(desk) == ["kept BROKEN"] and len(desk.page.text) <= listened_board.LONGEST
    desk.page.take("\r\nstate 5 fault NONE speed -1500 rpm motor 61 C limit CURRENT RAMP NOT_ONE selftest 3\r\n")
    frame = desk.page.frame()
    assert (frame["state"], frame["limits"], frame["strip"][0][1]) == (MADE.library.states[5], ["CURRENT", "RAMP"], -1500)
    desk.page.take("state 5 fault NONE speed 7 rpm app x,y\r\n")
    desk.page.frame()
    assert list(csv.DictReader(io.StringIO(desk.page.csv())))[-1]["said"] == "app x,y"
    assert desk.page.csv().splitlines()[0] == "time_s,state,fault,speed_rpm,said" and ",-1500,motor 61 C limit CURRENT RAMP NOT_ONE selftest 3" in desk.page.csv()


def test_a_board_that_says_nothing_has_no_state_and_has_one_again_when_it_speaks(desk, monkeypatch):
    desk.passes(1.2)
    monkeypatch.setattr(ListenedBoard, "SILENT_S", 0.05)
    time.sleep(0.1)
    frame = desk.page.frame()
    assert (frame["silent"], frame["state"], logs(desk)[-1]) == (True, "", "no answer")
    frame = desk.passes(0.6)
    assert (frame["silent"], frame["state"], logs(desk)[-1]) == (False, "STOPPED", "it answers again")


@pytest.mark.parametrize("error", lnet.PORT_ERRORS)
def test_a_port_that_goes_away_is_opened_again_when_it_is_back(monkeypatch, error):
    class Cable:
        """Unplugged after the first words."""

        def __init__(self, *words: bytes) -> None:
            self.words = list(words)

        def read(self, size: int) -> bytes:
            if not self.words:
                raise error("unplugged")
            return self.words.pop(0)

    opened: list[Cable] = []

    def opens(port: str) -> Cable:
        assert port == "/dev/ttyX"
        opened.append(Cable(b"state 0 fault NONE speed 0 rpm\r\nstate", b" 1 fau") if not opened else Cable(b"lt NONE speed 1 rpm\r\nstate 2 fault NONE speed 2 rpm\r\n"))
        return opened[-1]

    monkeypatch.setattr(lnet, "open_port", opens)
    monkeypatch.setattr(listened_board, "AGAIN_S", 0.01)
    page = ListenedBoard("/dev/ttyX", "the motor", SYMBOLS, MADE.library)
    page.start(lambda message: None)
    until(lambda: len(opened) > 1 and len(page.heard) >= 2, "not opened again")
    page.end()
    assert not page.thread.is_alive() and list(page.heard)[:2] == ["state 0 fault NONE speed 0 rpm", "state 2 fault NONE speed 2 rpm"]


def test_nothing_can_be_asked_of_it_and_one_line_says_what_to_build(desk):
    for work in (lambda: desk.page.act({"start": 1000}), lambda: desk.page.act({"stop": True}), desk.page.header, desk.page.motor, desk.page.loop):
        refusal(work, TELLS)
    refusal(desk.page.scenario, "a real board has no scenario")
    refusal(desk.page.csv, "nothing is recorded yet")
    refusal(lambda: desk.page.paced(0.1), "a real board has real time")
    hello = desk.page.hello()
    assert hello["remote"] is hello["scope"] is hello["loops"] is None and hello["tuning"] == {"fixed": TELLS} and hello["virtual"] is False
    assert [(panel["title"], [line["name"] for line in panel["lines"]]) for panel in hello["panels"]] == [("speed", ["estimate"])]
    assert not has_scope(SYMBOLS) and has_scope(known())


# ---- the page ------------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def page(chromium):
    """Of a board at a pseudo-terminal, whose S2 nobody presses."""
    arguments = [sys.executable, "-m", "tools.live.board", "--defines=-DSCOPE=0"]
    with subprocess.Popen(arguments, cwd=paths.ROOT, stdout=subprocess.PIPE, text=True) as board:
        try:
            port, elf = (board.stdout.readline().replace(",", " ").split()[place] for place in (2, 1))
            with served("--port", port, "--elf", elf) as running:
                yield Page(chromium[0], running.url)
        finally:
            board.terminate()


def test_the_page_has_state_speed_log_and_recorder_and_no_control_that_does_nothing(page):
    resized(page, *SIZE)
    page.state("STOPPED")
    shown = "return [...document.querySelectorAll('button')].filter((e) => e.getClientRects().length).map((e) => e.id)"
    assert page.run(shown) == ["save-csv", "scope-cursors", "scope-fft", "scope-keep", "scope-csv", "scope-png"]
    assert page.text("#scope-title") == "Fault recorder" and page.text("#tuning-fixed") == TELLS
    assert page.run("return [...document.querySelectorAll('#strips .strip')].filter((e) => e.getClientRects().length).length") == 1
    assert page.run("return document.querySelector('.right').getClientRects().length") == 0 and page.one("#message").get_attribute("hidden")


@pytest.mark.parametrize("width", [360, 1400])
def test_it_fits_the_window_and_axe_finds_nothing(page, pytestconfig, width):
    accessible(page, pytestconfig.rootpath.parent, False, width)
    resized(page, width)
    assert page.run("return document.documentElement.scrollWidth") <= width
    resized(page, *SIZE)
