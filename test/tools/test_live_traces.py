"""What one does with the scope's traces on the page of make live: numbers, spectra, cursors, y axes, a reference, files, the record of a fault."""

import csv
import json

import numpy as np
import pytest
from live_browser import PATIENCE_S, SIZE, Page
from live_support import recorder_parts, served, until

from tools.common import drive_tables

pytestmark = pytest.mark.waits

HOME, END, RIGHT, TAB = "\ue011", "\ue010", "\ue014", "\ue004"
ALL = "\ue009a\ue000"
"""Ctrl-A."""
STEP_S = 1e-4
TIMES = np.arange(-25, 75) * STEP_S


@pytest.fixture
def page(chromium, server) -> Page:
    """The page as it is when it is opened, without a trace; its scope stands still."""
    from tools.live import browser
    browser.resize(chromium[0], *SIZE)
    page = Page(chromium[0], server.url)
    inside(page, "TracesView.kept = null; begin({ ...views.drive.hello, scope: { ...views.drive.hello.scope, trace: null } }); say('')")
    for name in ("csv", "png"):
        (chromium[1] / f"scope.{name}").unlink(missing_ok=True)
    return page


def inside(page: Page, script: str):
    """Runs it where the page's own names are known."""
    return page.run(f"return window.eval({script!r})")


def trace(**curves) -> dict:
    """As the server sends one; a curve's name ends with its unit: i_A."""
    rows = [[time, *values] for time, *values in zip(TIMES.tolist(), *(np.broadcast_to(curve, TIMES.shape).tolist() for curve in curves.values()))]
    return {"names": list(curves), "units": [name.rpartition("_")[2] for name in curves], "triggered": True, "rows": rows, "fault": None}


def draw(page: Page, **curves) -> None:
    inside(page, f"views.scope.draw({json.dumps(trace(**curves))})")


def table(page: Page) -> list[list[str]]:
    return page.run("return [...document.querySelectorAll('#scope-numbers tr')].map((row) => [...row.children].map((cell) => cell.textContent))")


def column(page: Page, title: str) -> list[str]:
    rows = table(page)
    return [row[rows[0].index(title)] for row in rows[1:]]


def ranges(page: Page, axis: str = "y") -> list[list[float]]:
    return inside(page, f"views.scope.graphs.map(({{ graph }}) => graph.{axis}AxisRange())")


def message(page: Page) -> str:
    return page.run("const m = document.getElementById('message'); return m.hidden ? '' : m.textContent")


SINE = np.sin(2.0 * np.pi * 400.0 * TIMES)


# ---- numbers -----------------------------------------------------------------------------------------------------------------
def measured(page: Page, name: str, values: np.ndarray, step_s: float = STEP_S):
    return inside(page, f"measure.{name}({json.dumps([[n * step_s, value] for n, value in enumerate(np.asarray(values, float).tolist())])})")


NOISE = np.random.default_rng(1).normal(size=200)
TIME = np.arange(200) * STEP_S


@pytest.mark.parametrize("values", [3.0 + 2.0 * np.sin(2 * np.pi * 230.0 * TIME), NOISE, np.full(200, -4.0)], ids=["sine", "noise", "constant"])
def test_mean_rms_and_spectrum_are_those_of_numpy(page, values):
    assert measured(page, "mean", values) == pytest.approx(values.mean())
    assert measured(page, "rms", values) == pytest.approx(np.sqrt(np.mean(values ** 2)))
    window = np.hanning(len(values) + 1)[:-1]
    wanted = 2.0 * np.abs(np.fft.rfft((values - values.mean()) * window, 4 * len(values))) / window.sum()
    spectrum = np.array(measured(page, "spectrum", values))
    assert spectrum[:, 0] == pytest.approx(np.fft.rfftfreq(4 * len(values), STEP_S)) and spectrum[:, 1] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("hz", [100.0, 230.0, 1234.5])
def test_a_sines_peak_stands_at_its_frequency_with_its_amplitude(page, hz):
    spectrum = measured(page, "spectrum", 7.0 + 2.0 * np.sin(2 * np.pi * hz * TIME))
    assert max(value for _, value in spectrum) == pytest.approx(2.0, rel=0.03)
    assert inside(page, f"measure.peak({json.dumps(spectrum)})") == pytest.approx(hz, abs=1.0 / (8 * len(TIME) * STEP_S))


@pytest.mark.parametrize("values, hz", [
    (5.0 + np.sin(2 * np.pi * 230.0 * TIME + 1.0), 230.0), (360.0 * (TIME * 137.0 % 1.0), 137.0), (360.0 * (-TIME * 137.0 % 1.0), 137.0),
    (np.sin(2 * np.pi * 230.0 * TIME) + 0.04 * NOISE.clip(-1, 1), 230.0), (np.sin(2 * np.pi * 110.0 * TIME - 0.7) + 0.09 * NOISE.clip(-1, 1), 110.0), (np.where(TIME * 200.0 % 1.0 < 0.2, 1.0, 0.0), 200.0)],
    ids=["sine", "angle", "angle backwards", "noise on it", "more noise than a row's rise", "pulses"])
def test_a_frequency_is_that_of_the_signal(page, values, hz):
    assert measured(page, "frequency", values) == pytest.approx(hz, rel=0.02)


WALK = np.cumsum(np.random.default_rng(3).normal(size=(40, 100)), axis=1)
"""Forty speeds that wander."""


@pytest.mark.parametrize("values", [np.full(200, 2.0), TIME, np.sin(2 * np.pi * 40.0 * TIME), np.sin(2 * np.pi * (100.0 + 20000.0 * TIME) * TIME)],
                         ids=["constant", "ramp", "less than a period", "changing"])
def test_what_has_no_frequency_gets_none(page, values):
    assert measured(page, "frequency", values) is None


def test_noise_has_no_frequency(page):
    series = [*WALK, *np.random.default_rng(4).normal(size=(40, 100)), *np.random.default_rng(5).integers(0, 2, size=(20, 100)).astype(float)]
    found = inside(page, f"{json.dumps([one.tolist() for one in series])}.map((row) => measure.frequency(row.map((y, n) => [n * {STEP_S}, y])))")
    assert [hz for hz in found if hz is not None] == []


def test_nothing_is_computed_of_nothing(page):
    assert [measured(page, name, np.array([])) for name in ("mean", "rms", "frequency", "spectrum", "peak")] == [None, None, None, [], None]
    assert measured(page, "spectrum", np.array([1.0, 2.0, 1.0])) == []


def test_the_table_has_mean_rms_and_frequency_of_what_is_shown(page):
    draw(page, i_A=1.0 + 2.0 * SINE, angle_deg=(400.0 * TIMES % 1.0) * 360.0)
    inside(page, "views.scope.trace.units[1] = '°'; views.scope.draw(views.scope.trace)")
    assert table(page)[0] == ["of what is shown", "mean", "RMS", "frequency"]
    assert [row[0] for row in table(page)[1:]] == ["i_A [A]", "angle_deg [°]"]
    assert float(column(page, "mean")[0]) == pytest.approx(1.0) and float(column(page, "RMS")[0]) == pytest.approx(np.sqrt(3.0), rel=1e-3)
    assert [float(text.removesuffix(" Hz")) for text in column(page, "frequency")] == pytest.approx([400.0, 400.0], rel=0.01)
    assert column(page, "mean")[1] == column(page, "RMS")[1] == "–" # it wraps
    inside(page, "views.scope.show([0, 1.2])") # half a period
    assert float(column(page, "mean")[0]) == pytest.approx(1.0 + 2.0 * SINE[25:38].mean(), rel=1e-3) and column(page, "frequency")[0] == "–"


def test_a_curve_with_gaps_is_measured_where_it_has_values(page):
    item = trace(bus_V=24.0 + SINE, i_A=SINE)
    for n, row in enumerate(item["rows"]):
        if n % 4:
            row[1] = None
    inside(page, f"views.scope.draw({json.dumps(item)})")
    assert float(column(page, "mean")[0]) == pytest.approx(24.0 + SINE[::4].mean(), rel=1e-3) and float(column(page, "frequency")[0].split()[0]) == pytest.approx(400.0, rel=0.01)
    page.click("#scope-fft")
    assert ranges(page, "x")[0] == ranges(page, "x")[1] == pytest.approx([0.0, 5000.0])
    assert column(page, "peak at") == ["400 Hz", "400 Hz"]


# ---- cursors -----------------------------------------------------------------------------------------------------------------
def test_cursors_tell_times_values_and_their_differences(page):
    draw(page, i_A=TIMES * 1000.0, v_V=5.0 - TIMES * 2000.0)
    assert not page.one("#scope-places").is_displayed()
    page.click("#scope-cursors")
    a, b = page.one("#cursor-a"), page.one("#cursor-b")
    a.send_keys(HOME)
    b.send_keys(HOME)
    b.send_keys(RIGHT * 2)
    assert page.one("#cursor-text").get_attribute("textContent") == "A -2.5 ms   B -2.3 ms   B − A 0.2 ms = 1 / 5000 Hz"
    assert (column(page, "A"), column(page, "B"), column(page, "B − A")) == (["-2.5", "10"], ["-2.3", "9.6"], ["0.2", "-0.4"])
    assert table(page)[0][0] == "between A and B" and column(page, "mean") == ["-2.4", "9.8"]
    a.send_keys(END)
    assert page.one("#cursor-text").get_attribute("textContent") == "A 7.4 ms   B -2.3 ms   B − A -9.7 ms = 1 / 103.09 Hz"
    assert a.get_attribute("aria-valuetext") == "7.4 ms" and column(page, "mean") == [f"{np.arange(-2.3, 7.45, 0.1).mean():.4g}", "-0.1"]
    b.send_keys(END)
    assert page.one("#cursor-text").get_attribute("textContent") == "A 7.4 ms   B 7.4 ms   B − A 0 ms"
    page.click("#scope-cursors")
    assert not page.one("#scope-places").is_displayed() and table(page)[0] == ["of what is shown", "mean", "RMS", "frequency"]


def test_a_click_takes_the_nearer_cursor_there_and_the_next_trace_leaves_it(page):
    from selenium.webdriver import ActionChains
    draw(page, i_A=TIMES * 1000.0)
    inside(page, "views.scope.put(1.0)") # nothing while they are off
    page.click("#scope-cursors")
    panel = page.one("#scope-graphs .graph")
    page.run("arguments[0].scrollIntoView({ block: 'center' })", panel)
    first, second = inside(page, "views.scope.cut")
    ActionChains(page.driver).move_to_element_with_offset(panel, 200, 0).click().perform()
    a, b = inside(page, "views.scope.cut")
    graph = "views.scope.graphs[0].graph"
    clicked = inside(page, f"{graph}.toDataXCoord({panel.size['width'] / 2 + 200})")
    assert a == first and b != second and b == pytest.approx(clicked, abs=0.06)
    ActionChains(page.driver).move_to_element_with_offset(panel, -200, 0).click().perform()
    assert inside(page, "views.scope.cut")[0] < first and inside(page, "views.scope.cut")[1] == b
    held = inside(page, "views.scope.cut")
    drawn = inside(page, f"""views.scope.cut.map((x) => {{ const g = {graph}, a = g.getArea(), c = g.hidden_ctx_, s = c.canvas.width / g.width_;
        const data = c.getImageData(Math.round(g.toDomXCoord(x) * s), a.y * s, 1, a.h * s).data; return data.filter((v, n) => n % 4 === 3 && v > 200).length / (a.h * s); }})""")
    assert min(drawn) > 0.95
    draw(page, i_A=SINE)
    assert inside(page, "views.scope.cut") == held
    before = page.run("return document.querySelector('#scope-graphs canvas').toDataURL()")
    page.click("#scope-cursors")
    assert page.run("return document.querySelector('#scope-graphs canvas').toDataURL()") != before # they were drawn


def test_a_trace_of_another_length_is_shown_whole_with_cursors_inside(page):
    draw(page, i_A=SINE)
    page.click("#scope-cursors")
    inside(page, "views.scope.show([6, 7])")
    draw(page, i_A=-SINE)
    assert ranges(page, "x") == [[6.0, 7.0]]
    short = trace(i_A=SINE)
    inside(page, f"views.scope.draw({json.dumps(short | {'rows': short['rows'][:50]})})")
    assert ranges(page, "x")[0] == pytest.approx([-2.5, 2.4]) and all(-2.5 <= x <= 2.4 for x in inside(page, "views.scope.cut"))


# ---- y axes ------------------------------------------------------------------------------------------------------------------
def typed(page: Page, low: str, high: str) -> None:
    for name, text in (("low", low), ("high", high)):
        item = page.one(f"#scope-{name}")
        item.clear()
        item.send_keys(text + TAB)


def test_an_axis_is_scaled_by_hand_and_automatic_again(page):
    draw(page, i_A=SINE, v_V=10.0 * SINE)
    auto = ranges(page)
    assert auto[0] == pytest.approx([-1.12, 1.12], rel=0.02) and auto[1] == pytest.approx([-11.2, 11.2], rel=0.02)
    page.run("const s = document.getElementById('scope-axis'); s.value = 'V'; s.onchange()")
    typed(page, "-2", "30.5")
    assert ranges(page) == [auto[0], [-2.0, 30.5]] and message(page) == ""
    draw(page, i_A=2.0 * SINE, v_V=SINE)
    assert ranges(page)[1] == [-2.0, 30.5] and ranges(page)[0] != auto[0]
    page.run("const s = document.getElementById('scope-axis'); s.value = 'A'; s.onchange()")
    assert page.one("#scope-low").get_attribute("value") == ""
    page.run("const s = document.getElementById('scope-axis'); s.value = 'V'; s.onchange()")
    assert [page.one(f"#scope-{name}").get_attribute("value") for name in ("low", "high")] == ["-2", "30.5"]
    typed(page, "", "")
    assert ranges(page)[1] == pytest.approx([-1.12, 1.12], rel=0.02)


@pytest.mark.parametrize("low, high, said, wrong", [
    ("5", "2", "y axis: 5 .. 2 is impossible: the lower end must be less than the upper one", [True, True]),
    ("3", "3", "y axis: 3 .. 3 is impossible: the lower end must be less than the upper one", [True, True]),
    ("abc", "2", "y axis: 'abc' is no number: type one such as -1.5, or clear both ends", [True, False]),
    ("0", "1,5", "y axis: '1,5' is no number: type one such as -1.5, or clear both ends", [False, True]),
    ("0", "Infinity", "y axis: 'Infinity' is no number: type one such as -1.5, or clear both ends", [False, True]),
    ("7", "", "", [False, False])], ids=["reversed", "equal", "no number", "a comma", "no end", "one alone"])
def test_a_scale_that_cannot_be_is_refused_in_one_line_and_the_axis_stays(page, low, high, said, wrong):
    draw(page, i_A=SINE)
    before = ranges(page)
    typed(page, low, high)
    assert message(page) == said and ranges(page) == before
    assert ["wrong" in page.one(f"#scope-{name}").get_attribute("class") for name in ("low", "high")] == wrong
    typed(page, "0", "2")
    assert ranges(page) == [[0.0, 2.0]] and not page.driver.find_elements("css selector", "#scope-card .wrong")


def test_a_drag_upwards_scales_one_axis_and_a_double_click_shows_all_of_it(page):
    from selenium.webdriver import ActionChains
    draw(page, i_A=SINE, v_V=SINE)
    auto, panel = ranges(page), page.one("#scope-graphs .graph")
    page.run("arguments[0].scrollIntoView({ block: 'center' })", panel)
    ActionChains(page.driver).move_to_element_with_offset(panel, 0, -25).click_and_hold().move_by_offset(1, 20).move_by_offset(0, 20).release().perform()
    scaled = ranges(page)
    assert scaled[1] == auto[1] and scaled[0][1] - scaled[0][0] < 0.7 * (auto[0][1] - auto[0][0])
    assert float(page.one("#scope-low").get_attribute("value")) == pytest.approx(scaled[0][0], rel=1e-3)
    draw(page, i_A=SINE, v_V=SINE)
    assert ranges(page) == scaled
    ActionChains(page.driver).double_click(panel).perform()
    assert ranges(page) == auto and page.one("#scope-low").get_attribute("value") == ""


# ---- spectra -----------------------------------------------------------------------------------------------------------------
def test_fft_shows_the_spectrum_of_the_stretch_that_is_shown_with_cursors_and_scales_of_its_own(page):
    draw(page, i_A=3.0 + 2.0 * SINE)
    typed(page, "-9", "9")
    page.click("#scope-fft")
    assert ranges(page, "x") == [pytest.approx([0.0, 5000.0])] and ranges(page)[0] == pytest.approx([0.0, 2.12], rel=0.02)
    assert column(page, "peak at") == ["400 Hz"]
    page.click("#scope-cursors")
    page.one("#cursor-a").send_keys(HOME)
    page.one("#cursor-b").send_keys(HOME)
    page.one("#cursor-b").send_keys(RIGHT * 16)
    assert page.one("#cursor-text").get_attribute("textContent") == "A 0 Hz   B 400 Hz   B − A 400 Hz" and float(column(page, "B")[0]) == pytest.approx(2.0, rel=0.01)
    page.click("#scope-fft")
    assert ranges(page) == [[-9.0, 9.0]] and page.one("#cursor-text").get_attribute("textContent").endswith("Hz")
    inside(page, "views.scope.show([0, 5])")
    page.click("#scope-fft")
    assert len(inside(page, "views.scope.curves[0].points")) == 2 * 51 + 1
    page.click("#scope-fft")
    assert ranges(page, "x") == [[0.0, 5.0]]


# ---- a reference -------------------------------------------------------------------------------------------------------------
def test_a_kept_trace_lies_under_the_next_ones_with_its_numbers(page):
    draw(page, i_A=SINE, v_V=SINE)
    page.click("#scope-keep")
    draw(page, i_A=0.1 * SINE, other_A=SINE)
    assert inside(page, "views.scope.curves.map((curve) => curve.name)") == ["i_A", "other_A", "i_A"]
    assert [row[0] for row in table(page)[1:]] == ["i_A [A]", "reference", "other_A [A]"]
    assert [float(text) for text in column(page, "RMS")] == pytest.approx([0.0707, 0.707, 0.707], rel=0.01)
    draw(page, i_A=0.1 * SINE)
    assert ranges(page)[0] == pytest.approx([-1.12, 1.12], rel=0.02) # the axis has room for both
    picture = "return document.querySelector('#scope-graphs canvas').toDataURL()"
    before = page.run(picture)
    typed(page, *map(str, ranges(page)[0]))
    page.click("#scope-keep")
    assert page.run(picture) != before and [row[0] for row in table(page)[1:]] == ["i_A [A]"]


def test_the_reference_outlives_a_lost_connection(page):
    draw(page, i_A=SINE)
    page.click("#scope-keep")
    inside(page, "views.lost = true; link.socket.close()")
    page.wait("return document.getElementById('message').textContent.startsWith('no answer')", "still there")
    page.wait("return document.getElementById('message').hidden && !window.eval('views.lost')", "it does not come back") # the hello builds the views anew
    draw(page, i_A=2.0 * SINE)
    assert len(table(page)) == 3 and page.one("#scope-keep").get_attribute("aria-pressed") == "true"


# ---- files -------------------------------------------------------------------------------------------------------------------
def saved(chromium, name: str) -> bytes:
    file = chromium[1] / name
    until(file.exists, "no file")
    return until(file.read_bytes, "empty")


def test_csv_is_what_is_shown_with_the_reference_beside_it(page, chromium):
    draw(page, i_A=SINE)
    page.click("#scope-keep")
    draw(page, i_A=2.0 * SINE, v_V=TIMES)
    page.click("#scope-csv")
    head, *rows = csv.reader(saved(chromium, "scope.csv").decode("utf-8").splitlines())
    assert head == ["time_s", "i_A [A]", "v_V [V]", "reference time_s", "reference i_A [A]"]
    assert np.array(rows, float) == pytest.approx(np.column_stack((TIMES, 2.0 * SINE, TIMES, TIMES, SINE)), rel=1e-5, abs=1e-12)
    page.click("#scope-keep")
    page.click("#scope-fft")
    (chromium[1] / "scope.csv").unlink()
    page.click("#scope-csv")
    head, *rows = csv.reader(saved(chromium, "scope.csv").decode("utf-8").splitlines())
    assert head == ["frequency_hz", "i_A [A]", "v_V [V]"] and len(rows) == 201 and float(rows[-1][0]) == pytest.approx(5000.0)


def test_png_shows_curves_numbers_and_cursors(page, chromium):
    draw(page, i_A=SINE, v_V=SINE)
    page.click("#scope-cursors")
    size, inked = inside(page, """(() => { const c = views.scope.picture(), all = by("scope-view").getBoundingClientRect();
        const ink = (part) => { const r = part.getBoundingClientRect(), at = (p) => Math.round(2 * (p + 10));
            const data = c.getContext("2d").getImageData(at(r.left - all.left), at(r.top - all.top), Math.round(2 * r.width), Math.round(2 * r.height)).data;
            return data.filter((v, n) => n % 4 === 0 && v < 200).length; };
        const parts = [".graph", ".legend", ".dygraph-axis-label-y", ".dygraph-axis-label-x", "th[scope=row]", "td:nth-child(2)", "th[scope=col]"];
        return [[c.width, c.height], parts.map((one) => ink(document.querySelector("#scope-view " + one)))]; })()""")
    assert min(inked) > 20, inked
    page.click("#scope-png")
    data = saved(chromium, "scope.png")
    assert data[:8] == b"\x89PNG\r\n\x1a\n" and [int.from_bytes(data[n:n + 4], "big") for n in (16, 20)] == size


def test_without_a_trace_nothing_is_saved_and_a_line_says_what_to_do(page):
    for name, said in (("csv", "CSV"), ("png", "PNG"), ("keep", "reference")):
        page.click(f"#scope-{name}")
        assert message(page) == f"{said}: no trace yet: click Auto or Single first"


# ---- eight channels, and a fault -----------------------------------------------------------------------------------------------
EIGHT = ["control.i_q13.d", "control.i_q13.q", "angle", "estimator.omega_erpm", "phases_q13.a", "phases_q13.b", "state", "ticks"]


def test_eight_channels_are_recorded_each_in_its_colour_and_a_ninth_word_is_refused(page):
    inputs = page.driver.find_elements("css selector", "#scope-channels input")
    assert len(inputs) == 8
    for item, text in zip(inputs, EIGHT):
        item.send_keys(ALL + text + "\n")
    page.wait("return window.eval('views.scope.setup.channels.length') === 8", "not eight")
    page.run("const s = document.getElementById('scope-trigger'); s.value = ''; s.onchange()")
    page.click("[data-mode=single]")
    page.wait("return window.eval('views.scope.trace')?.names.length === 8", "no trace of eight")
    assert inside(page, "views.scope.trace.names.map((name) => views.scope.short(name))") == EIGHT
    assert len(inside(page, "views.scope.trace.rows")) == 52 and len(set(inside(page, "views.scope.curves.map((curve) => tint(curve.color))"))) == 8
    inputs[7].send_keys(ALL + "bus_q31\n") # 32 bits
    page.wait("return document.getElementById('message').textContent.includes('9 words in a row')", "not refused")
    assert message(page) == "9 words in a row, scope: it can have 8: choose fewer variables"


def test_a_channel_that_is_cleared_is_left_out_and_the_others_stay(page):
    inputs = page.driver.find_elements("css selector", "#scope-channels input")
    before = [name for name in inside(page, "views.scope.setup.channels")]
    inputs[0].send_keys(ALL + "\ue003\n") # Backspace; the focus stays
    page.wait(f"return window.eval('views.scope.setup.channels.length') === {len(before) - 1}", "nothing is left out")
    page.run("return new Promise((done) => setTimeout(done, 200))") # the server's word for it has come, too
    assert inside(page, "views.scope.setup.channels") == inside(page, "views.scope.chosen()") == before[1:]
    assert page.run("return document.activeElement === arguments[0]", inputs[0])


def test_a_name_that_no_variable_has_is_said_in_words_and_not_by_colour_alone(page):
    inputs = page.driver.find_elements("css selector", "#scope-channels input")
    inputs[0].send_keys(ALL + "nonsense\n")
    page.wait("return document.getElementById('message').textContent.includes('nonsense')", "nothing is said")
    assert message(page) == "channel 1: no variable 'nonsense': choose one of the list, or clear it"
    assert inputs[0].get_attribute("aria-invalid") == "true" and inputs[1].get_attribute("aria-invalid") == "false"


def test_the_button_of_the_fault_recorder_once_more_brings_the_channels_of_before_back(page):
    before = inside(page, "views.scope.setup")
    page.click("#scope-fault")
    page.wait("return document.getElementById('scope-fault').getAttribute('aria-pressed') === 'true'", "not armed")
    assert inside(page, "views.scope.setup.channels") != before["channels"]
    page.click("#scope-fault")
    page.wait("return document.getElementById('scope-fault').getAttribute('aria-pressed') === 'false'", "still armed")
    assert inside(page, "views.scope.setup") == before


def test_the_record_of_a_fault_comes_by_itself_with_cause_and_remedy_beside_it(page):
    page.click("[data-button=S2]")
    page.state("CLOSED")
    page.click("#scope-fault")
    page.wait("return document.getElementById('scope-why').textContent.startsWith('Armed')", "not armed")
    assert page.one("#scope-why").is_displayed() and page.one("#scope-fault").get_attribute("aria-pressed") == "true"
    page.wait("return document.getElementById('scope-status').textContent === 'waits for its trigger'", "it does not wait")
    page.click("#scope-csv")
    assert message(page).startswith("CSV: no trace yet")
    page.run("return new Promise((done) => setTimeout(done, 500))") # until the rows before a fault are there
    page.click("[data-fault=bus_rail]")
    page.wait("return document.querySelector('#scope-why b')?.textContent === 'OVERVOLTAGE'", "no record", 4 * PATIENCE_S)
    row = next(row for row in drive_tables.faults() if row.name == "OVERVOLTAGE")
    assert page.text("#scope-why") == f"OVERVOLTAGE, at 0 ms: {row.cause}. Remedy: {row.remedy}."
    item = inside(page, "views.scope.trace")
    state, rows = item["names"].index("board_drive.state") + 1, item["rows"]
    assert item["triggered"] and {row[state] for row in rows if row[0] < -1e-9} == {5.0} and {row[state] for row in rows if row[0] >= 0.0} == {7.0}
    assert sum(row[0] < 0.0 for row in rows) == 38 and rows[1][0] - rows[0][0] == pytest.approx(4 * 50e-6)
    page.click("[data-mode=stop]")
    page.click("[data-fault=bus_rail]")
    page.wait("return window.eval('foc33.frame.broken').length === 0", "not mended")
    page.click("[data-button=S2]")
    page.state("STOPPED")
    assert page.text("#scope-why").startswith("OVERVOLTAGE") # the record stays


def test_a_firmware_without_the_scope_shows_the_rows_of_its_fault_recorder_and_nothing_moves_when_they_come(chromium):
    with served("--defines=-DSCOPE=0", made_of=recorder_parts()) as running:
        page = Page(chromium[0], running.url)
        assert page.text("#scope-title") == "Fault recorder" and page.text("#scope-why") == "The firmware's fault recorder: its rows come after the next fault."
        assert [page.one(f"#scope-{name}").is_displayed() for name in ("mode", "fault", "channels", "trigger", "cursors", "fft", "csv")] == [False] * 4 + [True] * 3
        places = "JSON.stringify([...document.querySelectorAll('#scope-card button, #scope-card input')].filter((e) => e.getClientRects().length).map((e) => e.getBoundingClientRect().top + scrollY))"
        before = inside(page, places)
        page.click("[data-button=S2]")
        page.state("CLOSED")
        page.click("[data-fault=bus_rail]")
        page.wait("return document.querySelector('#scope-why b')?.textContent === 'OVERVOLTAGE'", "no record", 4 * PATIENCE_S)
        assert "Remedy: brake more gently" in page.text("#scope-why") and inside(page, places) == before
        item = inside(page, "views.scope.trace")
        assert item["names"] == ["i_a", "i_b", "v_d", "v_q", "angle", "speed", "bus", "state"] and len(item["rows"]) == 64
        assert [row[8] for row in item["rows"]] == [5.0] * 48 + [7.0] * 16 and item["rows"][48][0] == 0.0
        bus = [row[7] for row in item["rows"] if row[7] is not None] # now and then
        assert bus[0] == pytest.approx(24.0, abs=0.3) and float(column(page, "mean")[6]) == pytest.approx(np.mean(bus), rel=0.01)
        page.driver.refresh() # a new tab has it, too
        page.wait("return document.querySelector('#scope-why b')?.textContent === 'OVERVOLTAGE'", "it is lost")
