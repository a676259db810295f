"""The page of make live as it lies on the screen: nothing moves, overlaps or is wider than the window, from a phone to a wide desk, light and dark; all of it by keyboard."""

import re

import pytest
from live_browser import CONTROLS, PLACES, SEEN, SIZE, Page, accessible, dark, inside, overlapping, resized
from live_support import Living, known, parts, served, until

from tools.live import page as page_text
from tools.live import view
from tools.live.real_board import RealBoard

RELEASE = (390, 500, 768, 1400, 2560)
"""On each push one of each of page.css's layouts."""
WIDTHS = [pytest.param(width, marks=[pytest.mark.release] * (width in RELEASE)) for width in (360, 390, 500, 720, 768, 900, 1000, 1280, 1400, 1800, 2560)]
CURVE_PX = 300
STYLE = (page_text.HERE / "page.css").read_text(encoding="utf-8")


@pytest.fixture
def page(chromium, server) -> Page:
    """The page in its usual size, light, with no fault thrown in."""
    page = Page(chromium[0], server.url)
    dark(page, False)
    resized(page, *SIZE)
    return page


def scope_open(page: Page, opened: bool = True, then: str = "null"):
    """Its cursors, its spectrum and the record of a fault are shown, or not; `then` is looked at, before another trace comes."""
    return inside(page, """((on) => { for (const id of ["scope-cursors", "scope-fft"]) { if ((by(id).getAttribute("aria-pressed") === "true") !== on) { by(id).click(); } }
        by("scope-why").hidden = !on; return %s; })(%s)""" % (then, str(opened).lower()))


# ---- nothing moves -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("width", WIDTHS)
def test_no_control_moves_when_a_fault_a_message_or_limits_are_told_and_every_text_has_room(page, width):
    resized(page, width)
    calm = inside(page, PLACES)
    told, moved = inside(page, """(() => {
        const room = () => by("notices").scrollHeight <= by("notices").clientHeight, hello = views.drive.hello, cut = [];
        const long = Object.keys(hello.faults).filter((name) => name !== "NONE").sort((a, b) => hello.faults[b].remedy.length - hello.faults[a].remedy.length);
        for (const name of long) { views.drive.fault(name); if (by("fault").hidden || !room()) { cut.push(name); } }
        views.drive.fault(long[0]);
        views.drive.limits(Object.keys(hello.limits));
        by("measured").textContent = "this machine manages 1 : 1234";
        views.scope.say("no connection: no answer to service 0 in 3 s", true);
        return [cut, %s]; })()""" % PLACES) # at once: the next frame takes some of it back
    inside(page, "say('a message')")
    moved_by_message = inside(page, PLACES)
    inside(page, """views.drive.fault("NONE"); views.drive.limits([]); say(""); by("measured").textContent = "";""")
    assert told == [] and len(calm) > 40
    assert [new for old, new in zip(calm, moved) if old != new] == [] and moved_by_message == calm


def test_a_second_click_at_the_same_place_mends_the_fault_that_the_first_threw_in(page):
    from selenium.webdriver import ActionChains
    page.click("[data-button=S2]")
    page.state("CLOSED")
    page.driver.execute_script("document.querySelector('[data-fault=bus_rail]').scrollIntoView({ block: 'center' })")
    ActionChains(page.driver).move_to_element(page.one("[data-fault=bus_rail]")).click().perform()
    page.state("FAULT")
    ActionChains(page.driver).click().perform()
    page.wait("return window.eval('foc33.frame.broken').length === 0", "another fault is thrown in, or none is mended")
    assert page.text("#fault").startswith("OVERVOLTAGE")
    page.click("[data-button=S2]")
    page.state("STOPPED")


# ---- from a phone to a wide desk ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("width", WIDTHS)
def test_the_page_fits_its_window_no_control_lies_on_another_and_curves_are_wide_enough(page, width):
    resized(page, width)
    assert page.run("return document.documentElement.scrollWidth") <= width
    places = inside(page, PLACES)
    assert overlapping(places) == []
    assert [place for place in places if place[1] < 0 or place[3] > width + 0.5] == []
    if not page.run("return document.querySelectorAll('#scope-graphs .graph').length"):
        page.click("[data-mode=auto]")
        page.wait("return document.querySelectorAll('#scope-graphs .graph').length", "no trace")
        page.click("[data-mode=stop]")
    wide = inside(page, "[...views.strips.graphs, ...views.scope.graphs].map(({ graph }) => graph.getArea().w)")
    assert len(wide) >= 6 and min(wide) >= CURVE_PX
    places = scope_open(page, then=PLACES)
    scope_open(page, False)
    assert overlapping(places) == [] and {"cursor-a", "cursor-b", "scope-low", "scope-png", "scope-numbers", "scope-why"} <= {place[0] for place in places}
    assert [place for place in places if place[1] < 0 or place[3] > width + 0.5] == [] and page.run("return document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("width", [360, 1280])
def test_a_refusal_and_a_fault_stay_in_sight_wherever_one_has_scrolled_to(page, width):
    resized(page, width)
    seen = """(() => { const r = by("notices").getBoundingClientRect(), top = document.elementFromPoint(r.left + 20, r.top + 12);
        return [scrollY > 300, r.top >= 0 && r.bottom <= innerHeight, by("notices").contains(top)]; })()"""
    page.run("scrollTo(0, document.body.scrollHeight)")
    assert inside(page, f"tell(''); {seen}")[:2] == [True, False]
    assert inside(page, f"tell('a refusal'); {seen}") == [True, True, True]
    assert inside(page, f"tell(''); views.drive.fault('OVERCURRENT'); {seen}") == [True, True, True]
    inside(page, "views.drive.fault('NONE')")
    page.run("scrollTo(0, 0)")


@pytest.mark.parametrize("width", [360, 1280])
def test_all_numbers_of_the_traces_are_within_the_window(page, width):
    resized(page, width)
    traced(page)
    cut = scope_open(page, then="""(() => { const box = by("scope-numbers").getBoundingClientRect(); return [...by("scope-numbers").querySelectorAll("th, td")].map((e) => [e.textContent, e.getBoundingClientRect()])
        .filter(([, r]) => r.left < box.left - 1 || r.right > box.right + 1).map(([text]) => text).concat(by("scope-numbers").scrollWidth > by("scope-numbers").clientWidth ? ["wide"] : []); })()""")
    count = inside(page, "by('scope-numbers').querySelectorAll('[role=cell], [role=columnheader]').length")
    scope_open(page, False)
    assert cut == [] and count >= 15


def test_the_panels_are_higher_where_the_window_has_room(page):
    traced(page)
    heights = []
    for width, height in ((1280, 800), (2560, 800), (2560, 1440)):
        resized(page, width, height)
        heights.append(page.run("return [...document.querySelectorAll('#strips .graph, #scope-graphs .graph')].map((e) => e.clientHeight)"))
    assert all(min(b - a for a, b in zip(low, high)) > 15 for low, high in zip(heights, heights[1:])), heights


@pytest.mark.parametrize("width", WIDTHS)
def test_no_control_moves_when_the_record_of_a_fault_comes_and_its_cause_has_room(page, width):
    resized(page, width)
    traced(page)
    cut, moved = inside(page, """(() => { const cut = [], moved = [], v = views.scope, places = () => JSON.stringify(%s), { setup } = v;
        v.set({ setup: v.recorder, status: "waits" });
        const calm = places(), names = Object.keys(v.faults).filter((name) => name !== "NONE");
        const rows = [-0.01, 0, 0.003].map((t) => [t, 1, 2, 3, 4, 5, 6, 5, 16]);
        const units = v.recorder.channels.map((name) => v.units[name]);
        for (const fault of names) {
            v.draw({ names: v.recorder.channels, units, triggered: true, fault, rows });
            if (by("scope-why").scrollHeight > by("scope-why").clientHeight) { cut.push(fault); }
            if (places() !== calm) { moved.push(fault); }
        }
        v.draw({ ...v.trace, fault: null }); v.set({ setup, status: "stop" });
        return [cut, moved]; })()""" % PLACES)
    assert cut == [] and moved == []


# ---- contrast ------------------------------------------------------------------------------------------------------------------
def luminance(colour: str) -> float:
    parts_ = [int(colour[n:n + 2], 16) / 255.0 for n in (1, 3, 5)]
    return sum(share * (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4) for share, part in zip((0.2126, 0.7152, 0.0722), parts_))


def contrast(one: str, other: str) -> float:
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_texts_have_a_contrast_of_four_and_a_half_and_edges_of_controls_of_three(theme):
    names = [dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6});", block)) for block in re.findall(r":root \{(.*?)\}", STYLE, re.S)]
    colours = names[0] | names[theme]
    assert len(names) == 2 and set(names[0]) == set(names[1]) and len(colours) > 20
    texts = {"card": "ink soft true estimate reference d q bad leaf rose", "back": "ink soft true", "field": "ink soft true", "off": "ink soft", "fault": "ink bad", "note": "ink",
             "warn-back": "warn", "true": "on", "d": "on", "bad": "on"}
    low = {(text, ground): round(contrast(colours[text], colours[ground]), 2) for ground, row in texts.items() for text in row.split()
           if contrast(colours[text], colours[ground]) < 4.5}
    assert low == {}
    assert min(contrast(colours[edge], colours[ground]) for edge, ground in (("edge", "card"), ("edge", "field"), ("true", "card"), ("true", "back"))) >= 3.0
    assert {line.color for panel in view.PANELS for line in panel.lines} <= set(colours)


def test_in_the_dark_the_page_and_its_curves_are_dark(page):
    ground = "return getComputedStyle(document.querySelector('.card')).backgroundColor"
    assert page.run(ground) == "rgb(255, 255, 255)"
    for on, card, line in ((True, "rgb(27, 33, 39)", "#6fa8e0"), (False, "rgb(255, 255, 255)", "#2a68a8")):
        dark(page, on)
        page.wait(f"{ground} === '{card}'", "the ground stays")
        page.wait(f"return window.eval('views.strips.graphs[2].graph.getColors()[0]') === '{line}'", "the curve stays")
        label = page.run("return getComputedStyle(document.querySelector('.dygraph-axis-label')).color")
        assert label == ("rgb(163, 173, 183)" if on else "rgb(91, 101, 112)")


@SEEN
def test_axe_finds_nothing_that_keeps_somebody_from_using_the_page(page, pytestconfig, on, width):
    traced(page)
    scope_open(page)
    accessible(page, pytestconfig.rootpath.parent, on, width)
    scope_open(page, False)


# ---- curves --------------------------------------------------------------------------------------------------------------------
def test_an_axis_has_three_to_seven_ticks_at_round_values(page):
    found = inside(page, """(() => { const all = [];
        for (let power = -4; power <= 4; power++) for (let n = 0; n < 60; n++) {
            const span = 10 ** power * (1 + 0.153 * n), low = (n % 7 - 3) * 0.37 * span; all.push([low, low + span, ticks(low, low + span)]); }
        return all; })()""")
    for low, high, row in found:
        values = [tick["v"] for tick in row]
        step = values[1] - values[0]
        assert 3 <= len(row) <= 7 and low - 1e-9 <= values[0] and values[-1] <= high + 1e-9, (low, high, values)
        assert f"{step:.6e}"[:4].rstrip("0") in ("1.", "2.", "2.5", "5."), (low, high, values)
        assert all(abs(value / step - round(value / step)) < 1e-6 for value in values) and len({tick["label"] for tick in row}) == len(row)
    assert inside(page, "ticks(2, 2).length") == 1
    assert inside(page, "ticks(-1, 30001).map((t) => t.label)") == ["0", "10k", "20k", "30k"]


def traced(page: Page) -> None:
    """Traces come, then no more."""
    before = page.run("return window.eval('foc33.traces')")
    page.click("[data-mode=auto]")
    page.wait(f"return window.eval('foc33.traces') > {before}", "no trace")
    page.click("[data-mode=stop]")
    page.wait("return document.getElementById('scope-status').textContent === 'stopped'", "no stop")


def test_every_curve_that_is_drawn_has_such_an_axis(page):
    traced(page)
    counts = inside(page, """[...views.strips.graphs, ...views.scope.graphs].map(({ graph }) => {
        const [low, high] = graph.yAxisRange(); return [graph.layout_.yticks.length, ticks(low, high).length]; })""")
    assert len(counts) >= 6 and all(3 <= drawn <= 7 and drawn == wanted for drawn, wanted in counts), counts


RANGES = "views.scope.graphs.map(({ graph }) => graph.xAxisRange().map((t) => Math.round(t * 1000)))"


def test_who_zooms_one_panel_of_the_scope_zooms_all_and_the_next_trace_stays_there(page):
    from selenium.webdriver import ActionChains
    traced(page)
    whole = inside(page, RANGES)
    assert len(whole) >= 3 and all(one == whole[0] for one in whole)
    panel = page.driver.find_elements("css selector", "#scope-graphs .graph")[1]
    page.driver.execute_script("arguments[0].scrollIntoView({ block: 'center' })", panel)
    ActionChains(page.driver).move_to_element_with_offset(panel, -60, 0).click_and_hold().move_by_offset(60, 2).move_by_offset(60, 0).release().perform()
    zoomed = inside(page, RANGES)
    assert zoomed[1] != whole[1] and zoomed[1][1] - zoomed[1][0] < 0.6 * (whole[1][1] - whole[1][0]) and all(one == zoomed[1] for one in zoomed)
    traced(page)
    assert inside(page, RANGES) == zoomed
    ActionChains(page.driver).double_click(panel).perform()
    page.wait(f"return JSON.stringify(window.eval({RANGES!r})) === '{str(whole).replace(' ', '')}'", "a double click does not show all")


def test_keys_zoom_and_move_the_traces(page):
    traced(page)
    graphs = page.one("#scope-graphs")
    whole = inside(page, RANGES)[0]

    def after(keys: str) -> list[int]:
        page.run("arguments[0].focus()", graphs)
        graphs.send_keys(keys)
        ranges = inside(page, RANGES)
        assert all(one == ranges[0] for one in ranges)
        return ranges[0]
    half = after("+")
    assert half[1] - half[0] == pytest.approx((whole[1] - whole[0]) / 2, abs=2)
    right = after("\ue014") # arrow right
    assert right[0] > half[0] and right[1] - right[0] == pytest.approx(half[1] - half[0], abs=2)
    assert after("\ue014" * 9)[1] == whole[1] and after("\ue012" * 20)[0] == whole[0] # no further than the trace
    assert after("-") == whole and after("++") != whole and after("0") == whole


def test_triggered_is_said_of_a_trace_and_goes_when_the_next_one_is_awaited(page):
    status = "document.getElementById('scope-status').textContent"
    page.run("const s = document.getElementById('scope-trigger'); s.value = 'board_drive.angle'; s.onchange();"
             "const l = document.getElementById('scope-level'); l.value = '180'; l.onchange()")
    page.click("[data-button=S2]")
    page.click("[data-mode=normal]")
    page.wait(f"return {status} === 'triggered'", "no trigger")
    page.click("[data-fault=blocked]") # the angle stands, and no trigger comes
    page.state("FAULT")
    page.wait(f"return {status} === 'waits for its trigger'", "it still says that it has triggered", 3.0)
    assert "bad" in inside(page, "views.scope.set({ setup: views.scope.setup, status: 'no connection: x' }); by('scope-status').className")
    assert inside(page, "views.scope.draw(views.scope.trace); [by('scope-status').textContent, by('scope-status').className]") == ["triggered", ""]
    page.click("[data-mode=stop]")
    page.click("[data-fault=blocked]")
    page.wait("return window.eval('foc33.frame.broken').length === 0", "not mended")
    page.click("[data-button=S2]")
    page.state("STOPPED")


# ---- keyboard ------------------------------------------------------------------------------------------------------------------
def test_tab_comes_to_every_control_and_shows_where_it_is(page):
    from selenium.webdriver import ActionChains
    name = "e.id || e.dataset.fault || e.dataset.button || e.dataset.mode || e.name || e.getAttribute('aria-label') || e.tagName"
    names = f"""return [...document.querySelectorAll("{CONTROLS}, a, [role=button], [role=slider]")].filter((e) => e.getClientRects().length && !e.disabled).map((e) => {name})"""
    scope_open(page)
    wanted = page.run(names)
    page.run("document.activeElement.blur(); getSelection().removeAllRanges(); window.scrollTo(0, 0)")
    found: dict[str, bool] = {}
    for _ in range(len(wanted) + 8):
        ActionChains(page.driver).send_keys("\ue004").perform()
        key, seen = page.run(f"""const e = document.activeElement, s = getComputedStyle(e), r = e.getBoundingClientRect();
            return [{name}, s.outlineStyle !== "none" && parseFloat(s.outlineWidth) >= 2 && r.top < innerHeight && r.bottom > 0]""")
        found[key] = seen
    assert [key for key in wanted if key not in found] == [] and set(
        "save-csv save-scenario pot S2 open_b scope-graphs scope-numbers cursor-a cursor-b scope-low scope-png scope-fault".split()) <= set(wanted)
    scope_open(page, False)
    assert [key for key, seen in found.items() if not seen and key in wanted] == []


def test_the_trace_is_saved_by_keyboard_and_the_pace_keeps_the_focus(page, chromium):
    page.one("#save-csv").send_keys("\ue007") # Enter
    until((chromium[1] / "recorded.csv").exists, "no file")
    pace = page.one("#pace")
    pace.send_keys("\ue015") # arrow down: 1 : 10
    page.wait("return window.eval('foc33.frame.pace') === 0.1", "pace")
    assert page.run("return document.activeElement.id") == "pace"
    pace.send_keys("\ue013")
    page.wait("return window.eval('foc33.frame.pace') === 1", "pace")


# ---- a board that does not answer ------------------------------------------------------------------------------------------------
class Off:
    """The serial line of a board that can be switched off."""

    def __init__(self, line) -> None:
        self.line, self.on = line, True

    def write(self, data: bytes) -> None:
        if self.on:
            self.line.write(data)

    def read(self, size: int = 1) -> bytes:
        data = self.line.read(size)
        return data if self.on else b""


def test_a_board_that_was_switched_off_has_no_state_and_no_new_curve():
    living = Living()
    living.maker.start()
    line = Off(living.board.line)
    real = RealBoard(line, "the motor", known(), parts().library.params)
    real.start(living.messages.append)
    try:
        def frame() -> dict:
            real.run(0.05)
            return real.frame()
        until(lambda: frame()["state"] == "STOPPED", "no state")
        assert RealBoard.SILENT_S == 1.0 and len(frame()["strip"]) == 1
        line.on = False
        until(lambda: frame()["silent"], "nobody says it", 5.0)
        until(lambda: real.scope.told["status"].startswith("no connection"), "the scope says nothing")
        silent = frame()
        assert (silent["state"], silent["now"], silent["strip"], silent["limits"], silent["outputs"]) == ("", None, [], [], 0)
        line.on = True
        until(lambda: frame()["state"] == "STOPPED", "it does not come back")
        texts = [entry["text"] for entry in real.log]
        assert texts.count("no answer") == 1 and texts.count("it answers again") == 1
        until(lambda: real.scope.told["status"] == "stop", "the scope still says that it has no connection")
    finally:
        real.end()
        living.close()


def test_the_page_says_no_answer_and_what_is_old_is_grey(chromium):
    with served() as short:
        page = Page(chromium[0], short.url)
        page.state("STOPPED")
        grey = "getComputedStyle(document.querySelector('.strip')).opacity < 0.6 && document.querySelectorAll('#states .now').length === 0"
        frame = "take({ ...foc33.frame, state: '', now: null, strip: [], log: [], silent: %s })"
        told = f"; [{grey}, by('message').hidden, by('message').textContent]" # at once: the next frame is the virtual board's own
        is_grey, hidden, text = inside(page, "views.all = [views.drive]; " + frame % "true" + told) # as the frames of a real board are
        assert is_grey and not hidden and text.startswith("no answer")
        assert inside(page, frame % "false" + told) == [False, True, ""]
        text = inside(page, frame % "true" + "; warn('y axis: no number'); clearTimeout(warn.timer); tell(say.now); by('message').textContent")
        assert text.startswith("no answer") # a warning is for a while
        assert inside(page, "link.hush(false); " + frame % "true" + told)[1:] == [False, text] # after a new connection, too
        assert inside(page, frame % "false" + told) == [False, True, ""]
        old = "views.strips.graphs[0].graph.xAxisRange()[1]"
        last = inside(page, "views.strips.rows.at(-1)[0]")
        assert inside(page, f"views.strips.count = 0; views.strips.show({{ ...foc33.frame, t: {last} + 60, strip: [], silent: true }}); {old}") == max(last, 10)
        page.state("STOPPED")
        short.end()
        page.wait("return " + grey, "the values of a board that has ended stay", 5.0)
