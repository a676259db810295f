"""The page of make live in a real browser: start the motor, turn the potentiometer, break something, read what the page says."""

import subprocess
import sys

import pytest
from live_browser import SIZE, Page
from live_support import kept_parts, served, until
from support import document

from tools.bench import scenario_file
from tools.common import paths

pytestmark = pytest.mark.waits

HOME, END, ARROW_DOWN = "\ue011", "\ue010", "\ue015"
SIZES = [SIZE, (1000, 700)]


@pytest.fixture
def page(chromium, server) -> Page:
    """The page as it is opened, the board just powered up, whole and without load, the potentiometer at its left end."""
    page = Page(chromium[0], server.url)
    page.one("#pot").send_keys(HOME)
    page.slide("load.constant_nm", 0.0)
    page.wait("return window.eval('foc33.frame.settings')['input.pot'] === 0 && window.eval('foc33.frame.settings')['load.constant_nm'] === 0", "sliders")
    for fault in page.frame()["broken"]:
        page.click(f"[data-fault={fault}]")
    page.run("document.getElementById('power').click()")
    page.wait("return window.eval('foc33.frame.t') < 1.0 && window.eval('foc33.frame.broken.length') === 0", "no power-up")
    page.state("STOPPED")
    return page


@pytest.fixture
def turning(chromium, server) -> Page:
    """The page with a motor that turns, as the test before has left it if it did; the potentiometer at its left end."""
    page = Page(chromium[0], server.url)
    page.one("#pot").send_keys(HOME)
    if page.frame()["state"] == "STOPPED":
        page.click("[data-button=S2]")
    page.state("CLOSED")
    return page


def test_s2_starts_the_motor_the_potentiometer_turns_it_faster_and_a_fault_is_told(page):
    from selenium.webdriver import ActionChains
    page.click("[data-button=S2]")
    page.state("CLOSED")
    slow_rpm = page.frame()["now"]["target_rpm"]
    ActionChains(page.driver).click_and_hold(page.one("#pot")).move_by_offset(0, -30).move_by_offset(30, 20).release().perform()
    page.wait("return window.eval('foc33.frame.settings')['input.pot'] > 0.5", "the knob does not turn")
    page.wait(f"return window.eval('foc33.frame.now.speed_rpm') > {slow_rpm} + 500", "the motor does not follow")
    assert page.one("#pot").get_attribute("aria-valuenow") == str(round(page.frame()["settings"]["input.pot"] * 100))
    assert "on" in page.one("#led-run").get_attribute("class") and page.one("#fault").get_attribute("hidden")
    page.slide("load.constant_nm", 0.03)
    page.wait("return window.eval('foc33.frame.now.torque_nm') > 0.025", "no load")
    page.click("[data-fault=open_b]")
    page.state("FAULT")
    assert page.text("#fault").startswith("OPEN_PHASE: ") and "check the motor's wires" in page.text("#fault")
    assert page.one("[data-fault=open_b]").get_attribute("aria-pressed") == "true"
    lines = page.text("#log").split("\n")
    assert "fault OPEN_PHASE" in lines and "phase B open" in lines and "S2 pressed" in lines
    page.click("[data-fault=open_b]")
    page.click("[data-button=S2]")
    page.state("STOPPED")
    assert page.one("#fault").get_attribute("hidden")


def test_keys_work_the_board_as_the_mouse_does(page):
    page.one("#pot").send_keys(END)
    page.wait("return window.eval('foc33.frame.settings')['input.pot'] === 1", "End")
    page.one("#pot").send_keys(ARROW_DOWN)
    page.wait("return Math.abs(window.eval('foc33.frame.settings')['input.pot'] - 0.99) < 1e-9", "arrow")
    page.one("[data-button=S2]").send_keys(" ")
    page.state("RAMP")
    assert page.frame()["buttons"] == {"S2": 0, "S3": 0}


def test_a_limit_says_what_holds_the_output_back_and_what_to_do(turning):
    turning.one("#pot").send_keys(END)
    turning.slide("load.constant_nm", 0.04)
    turning.wait("return [...document.querySelectorAll('#limits b')].some((b) => b.textContent === 'VOLTAGE' && b.title.includes('raise the bus'))", "no limit")
    turning.slide("load.constant_nm", 0.0)


def test_curves_rotor_and_planes_are_drawn(turning):
    page = turning

    def painted(selector: str) -> int:
        return page.run("""const all = [...document.querySelectorAll(arguments[0])];
            const count = (c) => c.getContext("2d").getImageData(0, 0, c.width, c.height).data.filter((v, n) => n % 4 === 3 && v).length;
            return Math.min(...all.map(count))""", selector)

    assert painted("#rotor") > 8000 and painted("#stator") > 1000 and painted("#frame") > 1000
    assert page.run("return document.querySelectorAll('#strips .graph').length") == 4 and painted("#strips .graph canvas:first-of-type") > 300
    before = page.run("return document.getElementById('rotor').toDataURL()")
    page.wait(f"return document.getElementById('rotor').toDataURL() !== '{before}'", "the rotor stands still")
    first, other = page.run("return window.eval('foc33.frames')"), page.run("return performance.now()")
    page.wait(f"return window.eval('foc33.frames') >= {first} + 15", "no frames")
    assert 15 / (page.run("return performance.now()") - other) * 1000 > 3 # of the 20 that come, on a machine that does other things, too


def test_the_scope_shows_the_variables_that_somebody_chooses_from_their_trigger_on(turning):
    turning.click("[data-mode=auto]")
    turning.wait("return window.eval('foc33.traces') >= 2", "no trace")
    turning.run("const s = document.getElementById('scope-trigger'); s.value = 'board_drive.angle'; s.onchange();"
                "const l = document.getElementById('scope-level'); l.value = '180'; l.onchange()")
    rows, at = turning.wait("""const { triggered, rows } = window.eval('views.scope.trace'), at = rows.findIndex((row) => row[0] > -1e-9);
        return triggered && rows[at - 1][3] < 180 && rows[at][3] >= 180 ? [rows, at] : null""", "no trigger at 180 degrees")
    assert at == round(0.25 * (len(rows) - 1))
    last = turning.driver.find_elements("css selector", "#scope-channels input")[3]
    for text, wrong in (("nothing", True), ("state", False)):
        last.clear()
        last.send_keys(text + "\n")
        assert ("wrong" in last.get_attribute("class")) == wrong
    turning.wait("return window.eval('views.scope.trace').names[3] === 'board_drive.state'", "another channel")
    assert {row[4] for row in turning.run("return window.eval('views.scope.trace').rows")} == {5.0} # CLOSED
    turning.click("[data-mode=stop]")
    turning.wait("return document.getElementById('scope-status').textContent === 'stopped'", "no stop")


def test_pace_slows_the_board_down(turning):
    page = turning
    page.run("const pace = document.getElementById('pace'); pace.value = '0.01'; pace.dispatchEvent(new Event('change'))")
    page.wait("return window.eval('foc33.frame.pace') === 0.01", "pace")
    begin = page.frame()["t"]
    page.wait("return window.eval('foc33.frame.measured') !== null", "nothing measured")
    assert 0.0 < page.frame()["t"] - begin < 0.1
    page.run("const pace = document.getElementById('pace'); pace.value = '1'; pace.dispatchEvent(new Event('change'))")
    page.wait("return window.eval('foc33.frame.pace') === 1", "pace")


def test_a_scenario_is_saved_and_make_run_would_take_it(page, chromium):
    page.click("[data-button=S2]")
    page.state("RAMP")
    page.click("#save-scenario")
    file = chromium[1] / "recorded.toml"
    until(file.exists, "no file")
    item = scenario_file.read(document(until(lambda: file.read_text(encoding="utf-8"), "empty")))
    assert "S2" in [event.button for event in item.events if event.kind == "press"] and item.motor == "hurst_dmb0224c10002"


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_nothing_is_cut_off_or_wider_than_the_window(turning, size):
    page = turning
    from tools.live import browser
    browser.resize(page.driver, *size)
    page.wait(f"return innerWidth === {size[0]}", "size")
    assert page.run("return document.documentElement.scrollWidth <= innerWidth")
    wide = page.run("""return [...document.querySelectorAll("main *, header *")].filter((e) => e.clientWidth &&
        !e.closest("svg, #what, .graph, #log, input, select") && e.scrollWidth > e.clientWidth + 1).map((e) => `${e.tagName}#${e.id}.${e.className}`)""")
    assert wide == []
    browser.resize(page.driver, *SIZES[0])


@pytest.fixture
def port(terminals):
    """A board at a pseudo-terminal: its name, and the ELF file's."""
    with subprocess.Popen([sys.executable, "-m", "tools.live.board"], cwd=paths.ROOT, stdout=subprocess.PIPE, text=True) as board:
        try:
            yield [board.stdout.readline().replace(",", " ").split()[place] for place in (2, 1)]
        finally:
            board.terminate()


def test_a_board_at_a_serial_port_is_started_and_stopped_and_has_nothing_of_a_virtual_one(chromium, port):
    with served("--port", port[0], "--elf", port[1]) as running:
        page = Page(chromium[0], running.url)
        page.state("STOPPED")
        assert page.run("return [...document.querySelectorAll('.virtual')].every((e) => !e.getClientRects().length)")
        assert page.run("return document.getElementById('scope-card').getClientRects().length") == 1 and page.one("#message").get_attribute("hidden")
        page.run("const t = document.getElementById('target'); t.value = 1200; t.oninput()")
        page.click("#start")
        page.wait("const { state, now } = window.eval('foc33.frame'); return state === 'CLOSED' && Math.abs(now.estimate_rpm - 1200) < 12", "not 1200 rpm")
        assert "start, 1200 rpm" in page.text("#log")
        page.click("#stop")
        page.state("STOPPED")


def test_when_the_board_is_gone_the_page_says_so_and_what_to_do(chromium):
    with served() as short:
        page = Page(chromium[0], short.url)
        assert page.one("#message").get_attribute("hidden")
        assert short.end() == (0, "")
        page.wait("return document.getElementById('message').innerText.includes('Start it again')", "no word")


def test_the_browser_found_nothing_to_complain_about(turning):
    page = turning
    own = [entry for entry in page.driver.get_log("browser") if "ERR_CONNECTION_REFUSED" not in entry["message"] and "WebSocket" not in entry["message"]]
    assert own == [] and page.run("return performance.getEntriesByType('resource').filter((e) => !e.name.startsWith(location.origin)).length") == 0


# ---- kept parameters ---------------------------------------------------------------------------------------------------------
def test_without_kept_parameters_nothing_is_said_of_them(page):
    assert not page.one("#kept-card").is_displayed()


def test_parameters_are_kept_and_forgotten_and_the_page_says_so(chromium):
    with served(made_of=kept_parts()) as running:
        page = Page(chromium[0], running.url)
        says = "return document.getElementById('kept-state').textContent === '{}' && !document.getElementById('keep').disabled"
        page.wait(says.format("NONE"), "not NONE")
        assert page.one("#kept-card").is_displayed() and page.text("#kept-text") == "nothing is kept: the header's values are in use"
        page.click("#keep")
        page.wait(says.format("KEPT"), "not KEPT")
        assert "keep: done" in page.text("#log")
        page.click("[data-button=S2]")
        page.state("CLOSED")
        assert not page.one("#keep").is_enabled() and not page.one("#forget").is_enabled()
        page.click("[data-button=S2]")
        page.state("STOPPED")
        page.click("#forget")
        page.wait("return document.getElementById('log').textContent.includes('forget: refused: only in STOPPED, 5 s after')", "the rotor may coast")
        assert page.text("#kept-state") == "KEPT"
        page.wait("if (document.getElementById('kept-state').textContent !== 'NONE') document.getElementById('forget').click();"
                  + says.format("NONE"), "not NONE again")
        for unsaved, part in ((0, "no copy is whole"), (1, "; 1 word has changed"), (12, "; 12 words have changed")):
            told = page.run("return window.eval(`views.all.find((view) => view instanceof KeptView).show({ state: 'STOPPED', kept: { state: 'BROKEN', "
                            f"meaning: 'no copy is whole', unsaved: {unsaved} }} }}); [by('kept-text').textContent, by('kept-state').className]`)")
            assert part in told[0] and told[1] == "bad" # at once: the next frame shows the board's own
