"""The board of make live: buttons, sliders, faults, what a page is told, and recordings that make run repeats exactly."""

import csv
import io
import time
from dataclasses import replace

import numpy as np
import pytest
from live_support import bench, origin, passes, started, until
from support import document, refusal

from tools.bench import report, scenario_file, simulate
from tools.common import paths
from tools.common.trace import Trace, wrapped_deg
from tools.live import view, virtual_board
from tools.live.board import macros_for
from tools.live.faults import FAULTS
from tools.live.recording import LONGEST_S, SENT

ENDS = {"open_a": "OPEN_PHASE", "open_b": "OPEN_PHASE", "open_c": "OPEN_PHASE", "never_on": "CURRENT_SENSOR", "never_off": "OVERCURRENT_HW",
        "ia_zero": "OPEN_PHASE", "ib_stuck": "CURRENT_SENSOR", "ib_rail": "OVERCURRENT_SW", "ia_gain": "CURRENT_SENSOR", "bus_half": "BUS_SENSOR",
        "bus_rail": "OVERVOLTAGE", "supply_lost": "UNDERVOLTAGE", "blocked": "STALL", "interrupts_some": "INTERRUPT_RATE", "interrupts_all": "ADC_LOST"}
"""What the drive says within a second at this speed and load; the others it rides through."""
TURN_PERIODS = 1000
FAULT_DEG = 30.0
"""Where the rotor stands when a fault is thrown in. A dead current signal has its own code within 45 degrees of it; from 120 on it looks
like an open phase."""


def test_a_click_on_s2_starts_the_motor_at_the_potentiometers_speed_and_another_stops_it():
    board = started(0.5)
    frame = passes(board, 1.0)
    half_rpm = sum(board.library.params[name] for name in ("MINIMUM_SPEED_RPM", "NOMINAL_SPEED_RPM")) / 2.0
    assert frame["now"]["target_rpm"] == pytest.approx(half_rpm, abs=3.0) and frame["now"]["speed_rpm"] == pytest.approx(half_rpm, rel=0.005)
    assert frame["outputs"] == 63 and frame["leds"]["run"] == 1 and frame["t"] == pytest.approx(4.21, abs=0.01)
    board.act({"press": "S2"})
    board.act({"release": "S2"})
    assert passes(board, 2.0)["state"] == "STOPPED" and board.board.get("input.s2") == 0.0


def test_a_button_is_up_when_nobody_holds_it_any_more():
    board = bench()
    for who in ("one", "other"):
        board.act({"press": "S3"}, who)
    passes(board, 0.5)
    board.act({"release": "S3"}, "one")
    assert passes(board, 0.1)["buttons"] == {"S2": 0, "S3": 1}
    board.left("other")
    assert passes(board, 0.1)["buttons"]["S3"] == 0
    board.act({"release": "S3"}, "one") # once more: nothing happens
    assert [keys for _, keys in board.recording.actions] == [{"input.s3": 1.0}, {"input.s3": 0.0}]


def turned_to(board, angle_deg: float) -> None:
    """Lets the motor turn, period by period, until its rotor passes this angle: what follows does not depend on how long the start took."""
    before_deg = 0.0
    for _ in range(TURN_PERIODS):
        board.run(board.period_s)
        ahead_deg = wrapped_deg(board.board.get("plant.theta_e_deg") - angle_deg)
        if before_deg < 0.0 <= ahead_deg < 90.0:
            return
        before_deg = ahead_deg
    raise AssertionError("the rotor does not turn")


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_acts_and_can_be_mended(name):
    board = started()
    board.act({"set": ["load.constant_nm", 0.02]})
    passes(board, 0.5)
    turned_to(board, FAULT_DEG)
    board.act({"fault": [name, True]})
    frame = passes(board, 1.0)
    assert frame["broken"] == [name] and frame["fault"] == ENDS.get(name, "NONE")
    board.act({"fault": [name, False]})
    assert passes(board, 0.1)["broken"] == [] and {key: board.board.get(key) for key in board.normal} == board.normal


def test_where_two_faults_are_the_same_wire_the_other_stays_when_one_is_mended():
    board = bench()
    for command in (["open_a", True], ["blocked", True], ["open_b", True], ["open_b", False], ["blocked", False]):
        board.act({"fault": command})
    assert board.board.get("fault.open_phase") == 1.0 and board.board.get("load.locked") == 0.0


def test_power_up_begins_anew_and_leaves_sliders_and_faults():
    board = started()
    board.act({"set": ["supply.voltage_v", 20.0]})
    board.act({"fault": ["open_c", True]})
    run = passes(board, 0.5)["run"]
    board.act({"power": True})
    frame = passes(board, 0.2)
    assert frame["run"] == run + 1 and frame["t"] == pytest.approx(0.21, abs=0.01) and frame["state"] == "STOPPED"
    assert frame["now"]["bus_v"] == pytest.approx(20.0, abs=0.1) and frame["settings"]["input.pot"] == 0.5
    assert board.board.get("fault.open_phase") == 3.0 and '"fault.open_phase" = 3' in board.scenario()


@pytest.mark.parametrize("command, part", [
    (None, "no such command"), ([], "no such command"), ({"stop": 1}, "press, release, set"), ({"press": "S2", "set": []}, "no such command"),
    ({"press": "S1"}, "no button 'S1'"), ({"press": ["S2"]}, "no button"), ({"set": "pot"}, "no slider"), ({"set": ["motor.rs_ohm", 1.0]}, "no slider"),
    ({"set": ["input.pot", 1.01]}, "choose 0 .. 1"), ({"set": ["input.pot", "much"]}, "impossible"), ({"set": ["input.pot", True]}, "impossible"),
    ({"set": ["input.pot", float("nan")]}, "impossible"), ({"fault": ["open_d", True]}, "did you mean 'open_c'?"), ({"fault": [{}, True]}, "no fault")])
def test_a_wrong_command_is_refused_in_one_line_and_changes_nothing(command, part):
    board = bench()
    refusal(lambda: board.act(command), part)
    assert board.recording.actions == []


def test_a_slider_on_its_way_has_one_line_and_a_curve_a_gap_where_it_means_nothing():
    board = bench()
    passes(board, 0.2)
    lines = []
    for step in range(1, 11):
        board.act({"set": ["load.constant_nm", step / 1000.0]})
        lines += passes(board, 0.05)["log"]
    texts = {line["id"]: line["text"] for line in lines}
    assert [text for text in texts.values() if text.startswith("Load")] == ["Load torque 10 mN·m"]
    row = dict(zip(("t", "reference", "estimate", "true", "d", "q", "asked", "learned", "torque", "bus"), passes(board, 0.1)["strip"][-1]))
    assert [name for name, value in row.items() if value is None] == ["reference", "estimate", "d", "q", "asked", "learned"]
    assert None not in passes(started(), 0.1)["strip"][-1]


def test_curves_have_a_row_every_ten_milliseconds_however_time_passes():
    board = started()
    times = [row[0] for row in board.strip]
    for seconds in (0.0005, 0.003, 0.05, 0.007) * 5:
        board.run(seconds)
        times += [row[0] for row in board.frame()["strip"]]
    assert np.diff(times) == pytest.approx(0.01, abs=2e-4) and len(times) > 300


def test_numbers_and_curves_are_means_over_their_time_and_not_samples_at_the_ripples_edge():
    board = started()
    for key in ("motor.ld_h", "motor.lq_h"):
        board.board.set(key, 2e-4)
    passes(board, 0.5)
    board.board.set("stat.reset", 1.0)
    board.run(0.05)
    last, frame, mean_nm = board.recent[-1], board.frame(), board.board.get("stat.torque_mean_nm")
    assert last.column("plant.torque_nm").mean() < 0.7 * mean_nm # every sample stands at the same edge: their mean is another
    assert frame["now"]["torque_nm"] == pytest.approx(mean_nm, abs=2e-4)
    mean_a = mean_nm / (1.5 * board.rated.pole_pairs * board.board.get("motor.psi_vs"))
    assert last.column("fw.i_q_a").mean() < 0.8 * mean_a and frame["now"]["i_q_a"] == pytest.approx(mean_a, rel=0.02)
    assert frame["now"]["i_q_a"] == pytest.approx(view.currents(last)[view.MEAN_Q].mean(), abs=1e-4)
    assert frame["now"]["theta_deg"] == pytest.approx(last.column("plant.theta_e_deg")[-1], abs=1e-3) # of this moment
    rows = [row for row in frame["strip"] if row[0] > last.time_s[0] + 0.01]
    for row in rows:
        share = (last.time_s > row[0] - 0.01 + 2e-5) & (last.time_s <= row[0] + 2e-5)
        assert row[8] == pytest.approx(1000.0 * last.column("plant.torque_mean_nm")[share].mean(), abs=0.05)
        assert row[5] == pytest.approx(view.currents(last)[view.MEAN_Q][share].mean(), abs=1e-3)
    assert len(rows) == 4 and np.mean([row[8] for row in rows]) == pytest.approx(1000.0 * mean_nm, abs=0.5)


def test_a_curve_has_a_gap_where_it_means_nothing_and_the_mean_of_what_does():
    columns = {name: np.zeros(6) for name in virtual_board.SIGNALS} | {"plant.torque_mean_nm": np.array([1.0, 2.0, 3.0, 4.0, 5.0, 9.0]), "plant.i_q_mean": np.arange(6.0),
                                                                       "pwm.outputs_seen": np.array([0.0, 63.0, 63.0, 63.0, 0.0, 63.0])}
    trace = Trace(list(columns), np.arange(6) * 0.1, np.array(list(columns.values())))
    assert [[row[0], row[5], row[8]] for row in view.strip(trace, 2, {})] == [[0.1, 1.0, 1500.0], [0.3, 2.5, 3500.0], [0.5, 5.0, 7000.0]]
    columns["pwm.outputs_seen"][3] = 0.0
    assert [row[5] for row in view.strip(Trace(list(columns), trace.time_s, np.array(list(columns.values()))), 2, {})] == [1.0, None, 5.0]
    assert view.strip(trace, 7, {}) == []


def test_the_orbit_is_one_turn_of_the_voltage_that_is_asked_for_and_ends_where_the_vector_is():
    frame = passes(started(), 0.5)
    now = frame["now"]
    for name, d, q in (("v", now["v_d_v"], now["v_q_v"]), ("i", now["i_d_a"], now["i_q_a"])):
        points = np.array(frame["orbit"][name])
        angles = np.degrees(np.unwrap(np.arctan2(points[:, 1], points[:, 0])))
        assert len(points) > 50 and angles[-1] - angles[0] == pytest.approx(360.0, abs=25.0)
        assert np.hypot(*points.T).mean() == pytest.approx(np.hypot(d, q), rel=0.15)
        assert abs(wrapped_deg(angles[-1] - now["theta_est_deg"] - np.degrees(np.arctan2(q, d)))) < 15.0


# ---- recordings ----------------------------------------------------------------------------------------------------------
def repeated(board, text: str):
    """The run that `make run` makes of a saved scenario."""
    item = scenario_file.read(document(text))
    return simulate.simulate(simulate.prepare(item, board.library, origin().motor, origin().board), lambda seconds: None)


def test_make_run_repeats_a_saved_scenario_to_the_last_bit_and_its_expectations_hold():
    board = bench()
    board.act({"set": ["load.constant_nm", 0.01]})
    board.act({"power": True})
    passes(board, 0.2)
    for command in ({"set": ["input.pot", 0.3]}, {"press": "S2"}):
        board.act(command)
    passes(board, 0.15)
    board.act({"release": "S2"})
    passes(board, 2.3)
    board.act({"set": ["input.pot", 0.6123]})
    board.run(0.0171)
    board.act({"set": ["supply.voltage_v", 22.5]})
    passes(board, 0.5)
    board.act({"fault": ["blocked", True]})
    assert passes(board, 1.0)["fault"] == "STALL"
    run, trace = repeated(board, board.scenario()), board.recording.trace()
    rows = np.searchsorted(run.trace.time_s, trace.time_s - 1e-6)
    for name in ("plant.theta_e_deg", "plant.i_a", "bus.voltage_v", "fw.state"):
        assert np.array_equal(run.trace.column(name)[rows], trace.column(name)), name
    outcomes = report.check(run)
    assert [outcome.row for outcome in outcomes if not outcome.ok] == [] and len(outcomes) >= 3


def test_a_saved_scenario_is_the_same_to_the_last_bit_though_the_scope_ran_and_says_what_it_holds_of_it():
    board = bench()
    assert "send_hex" not in board.recording.toml(1.0)
    board.start(lambda message: None)
    board.scope.ask({"channels": ["board_drive.angle"], "trigger": None, "level": 0, "rising": True, "position": 0.0, "factor": 1, "mode": "auto"})
    try:
        until(lambda: passes(board, 0.05) and board.scope.trace, "no trace")
        for command in ({"set": ["input.pot", 0.3]}, {"press": "S2"}, {"release": "S2"}):
            board.act(command)
        for _ in range(30):
            passes(board, 0.05)
            time.sleep(0.01) # for the scope
    finally:
        board.end()
    text, trace = board.scenario(), board.recording.trace()
    assert text.count("send_hex") > 5 and SENT in text
    run = repeated(board, text)
    rows = np.searchsorted(run.trace.time_s, trace.time_s - 1e-6)
    for name in ("plant.theta_e_deg", "plant.i_a", "fw.i_q_a", "fw.state"):
        assert np.array_equal(run.trace.column(name)[rows], trace.column(name)), name


def test_bytes_of_the_serial_line_that_are_none_are_one_line():
    text = 'title = "x"\nmotor = "hurst_dmb0224c10002"\nduration_s = 1.0\n[[event]]\nat_s = 0.5\nsend_hex = "{}"\n'
    assert scenario_file.read(document(text.format("55 fF00"))).events[0].text == "U\xff\0"
    refusal(lambda: scenario_file.read(document(text.format("5 0g"))), "'5 0g' is no row of bytes", "two hexadecimal digits")


def test_the_expectations_of_a_saved_scenario_fail_when_the_drive_does_something_else():
    board = started()
    run = repeated(board, board.scenario().replace("[[expect]]", '[[event]]\nat_s = 2.5\nset = { "load.locked" = 1 }\n\n[[expect]]', 1))
    assert len([outcome for outcome in report.check(run) if not outcome.ok]) == 2 # a fault came, and the state at the end is another


def test_a_recording_that_is_too_long_or_empty_is_refused_in_one_line():
    board = bench()
    refusal(board.scenario, "do something first")
    refusal(lambda: board.recording.toml(LONGEST_S + 1.0), "120 s", "power up again")


def test_a_saved_scenario_names_the_application_that_ran():
    recording = bench().recording
    recording.origin = replace(recording.origin, defines=["PARAMS_IN_RAM", "APP=analog"])
    assert '[firmware]\ndefines = ["PARAMS_IN_RAM"]\napp = "analog"\n' in recording.toml(1.0)
    recording.origin = replace(recording.origin, defines=["APP=/my/app.c"])
    assert '[firmware]\napp = "/my/app.c"\n' in recording.toml(1.0)


def test_an_application_has_the_scope_beside_it_unless_the_serial_line_is_its_own():
    assert macros_for("", "analog") == ["APP=analog", "SCOPE=1"] and macros_for("", "text") == ["APP=text"]
    assert macros_for("", f"{paths.ROOT}/examples/my_app.c")[1:] == ["SCOPE=1"] and macros_for("-DSCOPE=0", "analog") == ["SCOPE=0", "APP=analog"]


def test_csv_has_a_row_a_millisecond_and_the_last_two_minutes():
    board = started()
    table = list(csv.reader(io.StringIO(board.csv())))
    times = np.array([float(row[0]) for row in table[1:]])
    assert table[0][:2] == ["time_s", "plant.speed_rpm"] and np.diff(times) == pytest.approx(0.001, abs=2e-5)
    assert times[-1] == pytest.approx(board.time_s, abs=0.001)
    for minute in range(5):
        board.recording.add_rows(np.array([60.0 * minute, 60.0 * minute + 59.0]), np.zeros((2, len(board.recording.signals))))
    assert [times[0] for times, _ in board.recording.rows][0] == 120.0


def test_what_is_recorded_keeps_no_more_than_its_rows():
    board = started(0.5)
    for times, rows in board.recording.rows:
        assert times.base is None and rows.base is None # parts of a 20 kHz trace would keep the whole
