"""The page of a run: curves that keep every peak, text that stays text, what is bad on top, and a zoom that moves all panels."""

import base64
import json
import re
import shutil
import subprocess
import zlib

import numpy as np
import pytest
from support import LIBRARY, PERIOD_S, command, run, step, trace

from tools.bench import page, picture, report
from tools.bench.expect import Outcome
from tools.common.trace import Trace

EVIL = "</script><script>alert('x')</script>&\"<b>"
SWITCHING = {"pwm__outputs_seen": 63, "fw__state": 5}


def decoded(item: picture.Picture):
    """Head, times and curves by panel and name, as the page's script reads them."""
    head, data = json.loads(item.head), zlib.decompress(item.curves)
    points = head["points"]
    times, place, curves = np.cumsum(np.frombuffer(data, "<i4", points)) / 1e6, 4 * points, {}
    for panel in head["panels"]:
        for line in panel["lines"]:
            counts = np.cumsum(np.frombuffer(data, "<i2", points, place), dtype=np.int16).astype(float)
            curves[panel["title"], line["name"]] = np.where(counts == picture.MISSING, np.nan, line["low"] + (counts + 32767) * line["step"])
            place += 2 * points
    assert place == len(data)
    return head, times, curves


# ---- curves --------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("row, value", [(7, 900.0), (12345, -300.0), (39999, 500.0)])
def test_a_peak_of_one_period_is_there_at_its_time_and_with_its_size_however_few_stretches(row, value):
    recorded = trace()
    recorded.data[0] = np.linspace(0.0, 100.0, len(recorded))
    recorded.data[0, row] = value
    _, times, curves = decoded(picture.of(run(recorded=recorded), 100))
    speed = curves["speed", "true"]
    peak = np.argmax(np.abs(speed))
    assert len(times) == 200 and speed[peak] == pytest.approx(value, abs=0.02)
    assert times[peak] == pytest.approx(recorded.time_s[row], abs=2.0 / 100)
    assert np.all(np.diff(times) > 0.0)


def test_a_rising_curve_rises_and_a_falling_one_falls():
    for sign in (1.0, -1.0):
        _, _, curves = decoded(picture.of(run(plant__speed_rpm=lambda t, sign=sign: sign * 1000.0 * t), 50))
        assert np.all(sign * np.diff(curves["speed", "true"]) > 0.0)


def test_a_long_run_drawn_block_by_block_looks_the_same(monkeypatch):
    item = run(plant__speed_rpm=lambda t: 1000.0 * np.sin(9.0 * t), fw__state=step((0, 4), (1.0, 5)), fw__v_q_v=lambda t: 5.0 * t, pwm__outputs_seen=63)
    for stretches in (130, picture.RUN_STRETCHES):
        monkeypatch.setattr(picture, "BLOCK_ROWS", 100_000)
        whole = picture.of(item, stretches)
        monkeypatch.setattr(picture, "BLOCK_ROWS", 999)
        assert picture.of(item, stretches) == whole


def test_a_hand_over_and_a_fault_are_there_in_full():
    item = run(fw__state=step((0, 4), (1.0, 5), (1.5, 7)), fw__fault=step((0, 0), (1.5, 6)), pwm__outputs_seen=63)
    _, times, _ = decoded(picture.of(item, picture.RUN_STRETCHES))
    for at_s, before_s, after_s in ((1.0, 0.03, 0.07), (1.5, 0.04, 0.01)):
        near = times[(times > at_s - before_s + PERIOD_S) & (times < at_s + after_s - PERIOD_S)]
        assert np.diff(near) == pytest.approx(PERIOD_S, abs=1e-6)
    assert np.diff(times[times < 0.9]).mean() > 1.5 * PERIOD_S


def test_a_curve_is_missing_where_it_means_nothing():
    _, times, curves = decoded(picture.of(run(fw__speed_ref_rpm=1000, fw__state=step((0, 4), (1.0, 5)), pwm__outputs_seen=63), 100))
    reference = curves["speed", "reference"]
    assert np.isnan(reference[times < 0.95]).all() and reference[times > 1.05] == pytest.approx(1000.0)


def test_states_faults_and_reasons_have_their_times_and_short_gaps_are_closed():
    limits = step((0, 0), (0.5, 1), (0.6, 0), (0.6001, 1), (0.7, 10), (0.8, 0))
    head, _, _ = decoded(picture.of(run(fw__limits=limits, fw__state=step((0, 4), (1.0, 5)), fw__fault=step((0, 0), (1.5, 6))), 200))
    assert [name for _, name in head["states"]] == ["RAMP", "CLOSED"] and head["faults"][1] == [pytest.approx(1.5, abs=1e-4), "STALL"]
    found = {name: spans for name, spans in head["limits"].items() if spans}
    assert set(found) == {"VOLTAGE", "CURRENT", "RAMP"}
    assert found["VOLTAGE"] == [[pytest.approx(0.5, abs=1e-4), pytest.approx(0.7, abs=1e-4)]]
    assert found["RAMP"] == [[pytest.approx(0.7, abs=1e-4), pytest.approx(0.8, abs=1e-4)]]
    head, _, _ = decoded(picture.of(run(fw__limits=limits), picture.RUN_STRETCHES)) # finer: the gap of two periods is one
    assert len(head["limits"]["VOLTAGE"]) == 1
    head, _, _ = decoded(picture.of(run(fw__limits=step((0, 0), (0.5, 1), (0.6, 0), (0.65, 1), (0.7, 0))), 200))
    assert len(head["limits"]["VOLTAGE"]) == 2


@pytest.mark.parametrize("rows", [0, 1, 2, 3])
def test_a_trace_that_ended_early_has_a_picture(rows):
    whole = trace()
    head, times, curves = decoded(picture.of(run(recorded=Trace(whole.names, whole.time_s[:rows], whole.data[:, :rows])), 100))
    assert (head["points"], len(times)) == (rows, rows) and all(len(values) == rows for values in curves.values())


def test_a_trace_without_the_firmware_s_signals_shows_the_plant():
    whole = trace(plant__speed_rpm=700)
    names = [name for name in whole.names if not name.startswith("fw.")]
    recorded = Trace(names, whole.time_s, whole.data[[whole.index[name] for name in names]])
    head, _, curves = decoded(picture.of(run(recorded=recorded), 100))
    assert [panel["title"] for panel in head["panels"]] == ["speed", "bus", "torque"] and head["limits"] == {}
    assert curves["speed", "true"] == pytest.approx(700.0)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_none_does_not_spoil_its_curve(value):
    _, times, curves = decoded(picture.of(run(plant__torque_nm=step((0, 0.5), (1.0, value))), 100))
    torque = curves["torque", "motor's torque"]
    assert torque[times < 0.95] == pytest.approx(0.5) and np.isnan(torque[times > 1.05]).all()


# ---- the file ------------------------------------------------------------------------------------------------------------
def written(tmp_path, content: page.Page, folders=page.LIBRARY_FOLDERS) -> str:
    page.write(tmp_path, content, folders)
    return (tmp_path / "index.html").read_text(encoding="utf-8")


def fake_library(tmp_path):
    folder = tmp_path / "library"
    folder.mkdir()
    (folder / "dygraph.min.js").write_text("var Dygraph;\n//# sourceMappingURL=x\n", encoding="utf-8")
    (folder / "dygraph.min.css").write_text(".dygraph {}\n/*# sourceMappingURL=y */", encoding="utf-8")
    return (folder,)


def test_text_from_files_stays_text(tmp_path):
    item = run(**SWITCHING)
    item.actions.append((1.0, EVIL))
    item.scenario.name = EVIL
    table = page.Table(EVIL, [EVIL], [page.Row([EVIL])])
    content = page.Page(EVIL, False, EVIL, [EVIL], [table], [picture.of(item, 10)], [table], [], [EVIL])
    text = written(tmp_path, content, fake_library(tmp_path))
    assert "alert('x')</script>" not in text and "<b>" not in text
    assert text.count("<script") == text.count("</script") == 3
    data = json.loads(re.search(r'id="pictures">(.*?)</script>', text, re.DOTALL)[1])
    assert [1.0, EVIL] in json.loads(data[0]["head"])["events"] and zlib.decompress(base64.b64decode(data[0]["curves"]))


def test_the_page_asks_for_nothing_but_itself(tmp_path):
    text = written(tmp_path, page.Page("t", True, "v", [], [], [picture.of(run(**SWITCHING), 10)]), fake_library(tmp_path))
    assert not re.search(r"<link|<script src|https?://|url\(|@import|sourceMappingURL", text)


def test_without_the_library_the_page_says_how_to_get_it(tmp_path):
    text = written(tmp_path, page.Page("t", True, "v", [], [], [picture.of(run(**SWITCHING), 10)]), ())
    assert "libjs-dygraphs" in text and "npm install" in text and "<script" not in text


def test_a_page_that_would_be_too_large_keeps_the_curves_of_bad_rows(tmp_path):
    large = picture.Picture("{}", b"x" * (page.MOST_CURVES // 2 - 10))
    rows = [page.Row([str(n)], bad=n == 2, picture=n) for n in range(3)]
    text = written(tmp_path, page.Page("t", False, "v", [], [page.Table("", [], rows)], [large, large, large]), fake_library(tmp_path))
    data = json.loads(re.search(r'id="pictures">(.*?)</script>', text, re.DOTALL)[1])
    assert [item is None for item in data] == [False, True, False] and "1 runs without curves" in text


# ---- what the reports put on it ------------------------------------------------------------------------------------------
def page_of(tmp_path, item, outcomes=()):
    data = report.summary(item, list(outcomes), "a motor", "a board") | {"motor_title": "M <1>", "header": "userparams.h", "note": "for another"}
    report.write_page(tmp_path, item, list(outcomes), data)
    return (tmp_path / "index.html").read_text(encoding="utf-8")


def test_a_failed_run_shows_its_faults_with_the_remedy_and_what_failed_first(tmp_path):
    item = run(fw__state=step((0, 5), (1.5, 7)), fw__fault=step((0, 0), (1.5, 6)), fw__limits=2, pwm__outputs_seen=63)
    item.warnings = ["P1DTCON1: <dead time> is 0"]
    text = page_of(tmp_path, item, [Outcome("one", True, "1", "1"), Outcome("two", False, "3", "2")])
    assert "1 of 2 expectations hold" in text and text.index("<td>two</td>") < text.index("<td>one</td>")
    assert "<td>STALL</td><td>the estimated speed stayed below" in text and "remove the overload" in text
    assert "<td>CURRENT</td><td>100.0 %</td>" in text and "P1DTCON1: &lt;dead time&gt; is 0" in text
    assert "M &lt;1&gt;" in text and "for another" in text
    assert re.search(r'<tr class="bad" data-at="1\.50\d*"><td>\d</td><td>1\.50', text)


def test_a_run_without_a_trace_has_a_page(tmp_path):
    whole = trace()
    text = page_of(tmp_path, run(recorded=Trace(whole.names, whole.time_s[:0], whole.data[:, :0])))
    assert "<h1>test: a test</h1>" in text


def test_a_table_of_runs_has_a_row_for_each_with_its_curves_and_the_data_stay_free_of_them(tmp_path):
    rows = [{"load_nm": 0.1, "verdict": "ok", "fault": None, "limited_percent": {"CURRENT": 40.0, "RAMP": 0.5},
             "picture": picture.of(run(**SWITCHING), 10)},
            {"load_nm": None, "verdict": "out of reach", "fault": None}, {"load_nm": 0.12345678, "verdict": "angle", "fault": "STALL"}]
    report.write_table(tmp_path, "many", ["load_nm", "verdict", "fault"], rows, [Outcome("x", True, "1", "1")], {"title": "a <title>"}, {})
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert '<tr data-picture="0"><td>0.1</td><td>ok</td><td>-</td><td>CURRENT 40 %</td></tr><tr><td>-</td>' in text
    assert '<tr class="bad"><td>0.12346</td><td>angle</td><td>STALL</td><td>-</td></tr>' in text and "<th>load, N·m</th>" in text
    assert "many: a &lt;title&gt;" in text and "picture" not in (tmp_path / "summary.json").read_text(encoding="utf-8")


# ---- in a browser --------------------------------------------------------------------------------------------------------
PROBE = """<script>
const labels = () => [...document.querySelectorAll('#curves .panel')].map((panel) =>
  [...panel.querySelectorAll('.dygraph-axis-label-x')].map((label) => label.textContent).join(' '));
const send = (kind, target, x) => target.dispatchEvent(new MouseEvent(kind, {
  clientX: x, clientY: 40 + target.getBoundingClientRect().top, bubbles: true, cancelable: true, button: 0, view: window, detail: 1 }));
const seen = [];
setTimeout(() => {
  const canvas = document.querySelectorAll('#curves .panel')[2].querySelectorAll('canvas')[1], left = canvas.getBoundingClientRect().left;
  seen.push(labels());
  send('mousedown', canvas, left + 400);
  for (const kind of ['mousemove', 'mouseup']) {
    const y = canvas.getBoundingClientRect().top + 40;
    document.dispatchEvent(new MouseEvent(kind, { clientX: left + 440, clientY: y, bubbles: true, view: window }));
  }
  seen.push(labels());
  send('mousemove', canvas, left + 300);
  seen.push([document.getElementById('moment').textContent]);
  send('dblclick', canvas, left + 400);
  seen.push(labels());
  const out = document.createElement('pre');
  out.id = 'seen';
  out.textContent = JSON.stringify(seen);
  document.body.append(out);
}, 1500);
</script></body>"""


@pytest.mark.skipif(shutil.which("chromium") is None or not page.draws(), reason="needs chromium and libjs-dygraphs")
def test_a_drag_zooms_all_panels_and_a_double_click_shows_all(tmp_path):
    item = run(fw__limits=step((0, 0), (0.5, 1), (1.6, 0)), plant__speed_rpm=lambda t: 1000.0 * t, **SWITCHING)
    page_of(tmp_path, item)
    file = tmp_path / "index.html"
    file.write_text(file.read_text(encoding="utf-8").replace("</body>", PROBE), encoding="utf-8")
    done = subprocess.run(["chromium", "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
                           "--window-size=1200,1600", "--virtual-time-budget=6000", "--dump-dom", file.as_uri()],
                          capture_output=True, text=True, timeout=120, check=False)
    before, zoomed, moment, after = json.loads(re.search(r'<pre id="seen">(.*?)</pre>', done.stdout, re.DOTALL)[1])
    assert len(before) == 8 and len(set(before)) == len(set(zoomed)) == 1
    assert before == after != zoomed
    at_s, rest = moment[0].split(" s, ")
    assert 0.5 < float(at_s) < 1.6 and rest == "CLOSED, limited by VOLTAGE"


@pytest.mark.skipif(not LIBRARY.is_file(), reason="needs the virtual board")
def test_make_run_ends_with_a_page(tmp_path):
    code, _, error = command("run", "smoke", "--out", str(tmp_path / "out"), "--quiet", "--no-plots", "--library", str(LIBRARY))
    size = (tmp_path / "out" / "index.html").stat().st_size
    assert (code, error) == (0, "") and 20_000 < size < 2_000_000
