"""Reports: table, protocol, data for programs, plots."""

import json
import re

import numpy as np
import pytest
from support import run, step

from tools.bench import plots, report

TEXT = """
[[event]]
at_s = 0.1
press = "S2"
[[measure]]
name = "1000 rpm"
from_s = 1.0
to_s = 2.0
reference_rpm = 1000
[[measure]]
name = "end"
from_s = 1.5
to_s = 2.0
[[expect]]
kind = "hand_over"
within_s = 0.5
"""


def example(**more):
    signals = {"fw__state": step((0, 4), (0.8, 5)), "plant__speed_rpm": 1001, "fw__speed_ref_rpm": 1000, "fw__speed_est_rpm": 1002,
               "pwm__outputs_seen": 63, "fw__v_q_v": 4, "fw__v_limit_v": 13} | more
    return run(TEXT, **signals)


def test_the_table_has_an_aligned_row_for_each_measure_and_dashes_for_what_is_unknown():
    lines = report.table(report.summary(example(), [], "motor", "board")["measures"]).splitlines()
    assert (len(lines), len({len(line) for line in lines[1:]})) == (5, 1) # the first has no heading for the reasons
    assert re.match(r"1000 rpm +1000 +1001\.0 +1002\.0 +\+0\.10 ", lines[3]) and re.match(r"end +- +1001\.0 +1002\.0 +- ", lines[4])


def test_the_protocol_tells_when_the_loop_closed_and_of_a_fault_and_its_end():
    entries = [(round(at_s, 3), line) for at_s, line in example().protocol()]
    assert (0.8, "closed loop 0.70 s after S2, overshoot 0.1 %") in entries
    assert not [line for _, line in entries if "fault" in line]
    lines = [line for _, line in example(fw__fault=step((0, 0), (1.0, 6), (1.5, 0))).protocol()]
    assert {"fault STALL", "fault cleared"} <= set(lines)


def test_failed_expectations_are_marked_and_warnings_of_the_board_are_printed():
    line = report.outcomes_text(report.check(example()))
    assert line.startswith("FAIL  hand-over: closed loop  0.700 s  (allowed: at most 0.5 s after S2)")
    item = example()
    item.warnings = ["P1DTCON1: dead time is 0"]
    assert "warning of the board: P1DTCON1: dead time is 0" in report.text(item, [], report.summary(item, [], "", ""))


def test_a_summary_is_valid_json_even_with_numbers_that_json_lacks():
    data = report.summary(example(plant__torque_nm=np.inf), [], "motor", "board")
    assert data["measures"][0]["torque_nm"] is None
    assert json.loads(json.dumps(data, allow_nan=False))["measures"][0]["name"] == "1000 rpm"


BASIC = {"speed.png", "currents.png", "voltages.png", "angle_error.png"}


@pytest.mark.parametrize("signals, variables, names", [
    ({"fw__state": 4}, {}, BASIC),
    ({"fw__fw_index": step((0, 0), (1.5, 3)), "fw__inv_kphi_rpm_per_v": 138}, {"SnapBuf1": [1, 2, 3]},
     BASIC | {"hand_over.png", "field_weakening.png", "variables.png"})])
def test_hand_over_field_weakening_and_arrays_get_their_own_plots(tmp_path, signals, variables, names):
    item = example(**signals)
    item.variables = variables
    assert set(plots.write_all(item, tmp_path)) == {path.name for path in tmp_path.iterdir()} == names
    assert all(path.read_bytes()[:4] == b"\x89PNG" for path in tmp_path.iterdir())


def test_the_speed_plot_says_what_happened_where_it_happened(tmp_path, monkeypatch):
    events = "".join(f'[[event]]\nat_s = {at_s}\nset = {{ "load.constant_nm" = 0.01 }}\nnote = "{note}"\n' for at_s, note in ((0.5, "a brake"), (0.52, "and more of it"), (1.5, "again")))
    item, drawn = run(TEXT + events, fw__state=4, plant__speed_rpm=1001), {}
    monkeypatch.setattr(plots, "saved", lambda figure, folder, name: drawn.setdefault(name, figure) and name)
    plots.write_all(item, tmp_path)
    axes = drawn["speed"].axes[0]
    assert [(text.get_text().strip(), text.get_position()[0], text.get_ha()) for text in axes.texts] == [
        ("a brake", 0.5, "right"), ("and more of it", 0.52, "left"), ("again", 1.5, "right")], "one that is close goes to the other side"
    assert not drawn["currents"].axes[0].texts
