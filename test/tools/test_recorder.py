"""The fault recorder's text: read back, refused where it is damaged, in engineering units, and the trace of its run."""

import csv
from pathlib import Path

import numpy as np
import pytest
from support import LIBRARY, STATES, command, refused

from tools.bench import recorder, simulate
from tools.bench.recorder_command import LOG
from tools.bench.board import Board, Library
from tools.common import paths
from tools.common.errors import UserError

PARAMS = {"LOOPTIME_SEC": 5e-5, "COUNT_CURRENT_A": 0.001, "COUNT_VOLTAGE_V": 0.002, "BUS_FULL_SCALE_V": 50.0, "COUNT_SPEED_RPM": 0.2,
          "KCURRA": -0.5, "KCURRB": 0.25}
STATUS = "state 7 fault STALL speed 0 rpm\r\n"


SPEED, BUS = 0x9CD5, 0x5BE1


def lines(count: int = 4, sent: int | None = None, fault: str = "STALL", first: int = 1, every: int = 1) -> str:
    """A record as the firmware sends it; the last two rows are in the fault."""
    rows = []
    for n in range(count):
        place = (first - n) % 64
        slow = ((SPEED if (place - 1) % 8 < 4 else BUS) >> 4 * (-place % 4) & 15) << 4 | (7 if n >= count - 2 else 5)
        rows.append(f"row {place} {n} {10 * n % 100} {-n} -1 {slow - 256 if slow > 127 else slow} {n - 2}\r\n")
    return f"record fault {fault} rows {count} every {every} offsets -40 30\r\n" + "".join(rows[:sent])


def test_a_record_among_other_lines_is_read_from_the_oldest_row_on() -> None:
    text = "foc33 0.10.0 reset BOR POR\r\n" + STATUS + lines().replace("row 0", STATUS + "row 0") + STATUS
    found = recorder.parse(text, "log")
    rows = (0, 0, 0, -1, -107, -2), (1, 10, -1, -1, 21, -1), (2, 20, -2, -1, -25, 0), (3, 30, -3, -1, -73, 1)
    assert found == [recorder.Record(6, 1, (-40, 30), (1, 0, 63, 62), rows)]
    assert found[0].states == [5, 5, 7, 7] and found[0].fault_row(7) == 2


def test_of_two_records_both_are_read_and_one_that_is_sent_again_once() -> None:
    assert [record.fault for record in recorder.parse(lines() + lines() + lines(fault="OVERVOLTAGE"), "")] == [6, 3]


def test_one_that_is_cut_is_forgotten_where_a_whole_one_is_there() -> None:
    assert len(recorder.parse(lines(sent=2) + "foc33 0.10.0 reset EXTR\r\n" + lines(), "")) == 1
    assert len(recorder.parse(lines() + lines(fault="OVERCURRENT_SW", sent=3), "")) == 1
    assert len(recorder.parse(lines().replace(" offsets -40 30", "") + lines(), "")) == 1, "the board has a newer firmware now"


@pytest.mark.parametrize("text, line", [
    ("", "no record of a fault, log: log the board's UART"), (STATUS, "no record of a fault, log"),
    (lines(sent=3), "the record ends after 3 of 4 rows, log line 1: log it again"),
    (lines(sent=0), "the record ends after 0 of 4 rows"),
    (lines().replace("row 63 2", "row 63"), "no row of a record: 'row 63 20 -2 -1 -25 0', log line 4"),
    (lines().replace("row 63", "row 64"), "no row of a record: 'row 64 2"), (lines().replace("-25", "-129"), "no row of a record: 'row 63 2"),
    (lines().replace(" 21", " 128"), "no row of a record: 'row 0 1"),
    (lines().replace("row 63", "row 62"), "row 63 is missing after row 0, log line 4"),
    (lines().replace("row 0 1 10 -1 -1 21 -1\r\n", ""), "row 0 is missing after row 1, log line 3"),
    (lines(fault="STAL"), "no head of a record: 'record fault STAL rows 4 every 1 offsets -40 30', log line 1"),
    (lines().replace("rows 4", "rows 81"), "no head of a record"), (lines(every=0), "no head of a record"),
    ("record fault STALL rows 72 every 2\r\nrow 67 5008 -3456 48 9160 -18683 185\r\n",
     "no offsets in the record's head: 'record fault STALL rows 72 every 2', log line 1: an older firmware sends none")])
def test_a_bad_log_is_one_line_that_says_where(text: str, line: str) -> None:
    with pytest.raises(UserError) as error:
        recorder.parse(text, "log")
    assert str(error.value).startswith(line)
    assert recorder.of_text(text) == []


def test_a_record_is_under_way_until_its_last_line_is_out() -> None:
    assert not recorder.under_way("") and not recorder.under_way(STATUS) and not recorder.under_way(lines())
    assert all(recorder.under_way(lines(sent=n)) for n in range(4))
    assert recorder.under_way(lines()[:-2]) and recorder.under_way("record fault STALL rows 4")
    assert recorder.under_way(lines() + lines(sent=1)), "the second"


def test_bytes_become_engineering_units_and_the_fault_is_at_zero() -> None:
    rows = recorder.scaled(recorder.parse(lines(every=2), "")[0], PARAMS, STATES)
    middle = 256 * (np.arange(4) + 0.5)
    assert rows.time_ms == pytest.approx([-0.2, -0.1, 0.0, 0.1])
    assert rows.i_a == pytest.approx(0.001 * (-0.25 * middle + 40)), "gain, then the offset, as drive_measure() has it"
    assert rows.i_b == pytest.approx(0.001 * (0.125 * (256 - middle) - 30)) and rows.i_c == pytest.approx(-rows.i_a - rows.i_b)
    assert rows.v_d == pytest.approx(0.002 * 256 * (10 * np.arange(4) + 0.5)) and rows.v_q == pytest.approx([-0.256] * 4)
    assert rows.angle_deg == pytest.approx(np.array([254.5, 255.5, 0.5, 1.5]) * 360.0 / 256.0)
    assert rows.state == ["CLOSED", "CLOSED", "FAULT", "FAULT"]


def test_bus_and_speed_are_words_in_four_rows_each_and_a_part_of_one_is_no_number() -> None:
    rows = recorder.scaled(recorder.parse(lines(count=16, first=5), "")[0], PARAMS, STATES) # 5 | 4 .. 1 | 0 .. 61 | 60 .. 57 | 56 ..
    numbers = {name: [at for at in range(16) if not np.isnan(getattr(rows, name)[at])] for name in ("bus_v", "speed_rpm")}
    assert numbers == {"bus_v": [5], "speed_rpm": [1, 9]}
    assert rows.speed_rpm[[1, 9]] == pytest.approx([(SPEED - 65536) * 0.2] * 2)
    assert rows.bus_v[5] == pytest.approx((BUS + 32768) / 65536 * 50.0)


def test_rows_without_a_fault_end_in_the_reset_that_was_one() -> None:
    text = lines(fault="WATCHDOG").replace(" -25", " -27").replace(" -73", " -75") # still CLOSED
    rows = recorder.scaled(recorder.parse(text, "")[0], PARAMS, STATES)
    assert rows.time_ms == pytest.approx([-0.2, -0.15, -0.1, -0.05])


# ---- the firmware on the virtual board -------------------------------------------------------------------------------------------

SIGNALS = ("fw.fault", "fw.i_a_a", "fw.i_b_a", "fw.v_d_v", "fw.v_q_v", "fw.theta_ctrl_deg", "reg.ADC1BUF3", "fw.speed_est_rpm", "fw.state", "fw.slow_phase",
           "fw.offset_a_a", "fw.offset_b_a")


def faulted(causes: dict[str, float], at_s: float) -> tuple[str, np.ndarray, Library]:
    """A motor at 1000 rpm to which something happens: what was sent until the record was out, and the trace from the cause on."""
    library = Library(LIBRARY)
    board = Board(library)
    board.set("shunt.offset_a_v", 0.1)
    board.set("shunt.offset_b_v", -0.06)
    board.power_up()
    board.set("input.pot", 0.4)
    for key, value, periods in (("input.s2", 0, 4000), ("input.s2", 1, 2000), ("input.s2", 0, 50000)):
        board.set(key, value)
        board.run(periods)
    board.trace_start(list(SIGNALS), 1)
    board.run(200)
    for key, value in causes.items():
        board.set(key, value)
    board.run(round(at_s * 20000))
    sent = board.uart_take()
    trace = board.trace_take()
    for _ in range(10):
        board.run(1000)
        sent += board.uart_take()
    board.close()
    return sent, trace, library


@pytest.mark.parametrize("causes, fault", [({"load.constant_nm": 0.4}, {6}), ({"motor.ld_h": 4e-5, "motor.lq_h": 4e-5, "motor.rs_ohm": 0.2}, {1, 2})],
                         ids=["STALL", "OVERCURRENT"])
def test_what_the_board_sends_is_its_trace_within_a_byte_s_step(causes: dict[str, float], fault: set[int]) -> None:
    sent, trace, library = faulted(causes, 0.5)
    record, = recorder.parse(sent, "")
    assert record.fault in fault and record.every == 4 and len(record.rows) == 64
    rows = recorder.scaled(record, library.params, library.states)
    at = int(np.flatnonzero(trace[:, 0])[0])
    assert record.fault_row(7) == 48
    first = at + -int(trace[at, SIGNALS.index("fw.slow_phase")]) % 4 # rows are those of every fourth period
    part = {name: trace[first - 4 * 48:first + 4 * 16:4, column].astype(np.float64) for column, name in enumerate(SIGNALS)}
    amperes, volts = library.params["COUNT_CURRENT_A"], library.params["COUNT_VOLTAGE_V"]
    assert list(record.offsets_q13) == [round(part[f"fw.offset_{phase}_a"][0] / amperes) for phase in "ab"]
    assert abs(record.offsets_q13[0]) > 200 and abs(record.offsets_q13[1]) > 100, "and there is one"
    bus_v, speed_rpm = library.params["BUS_FULL_SCALE_V"], library.params["COUNT_SPEED_RPM"]
    # the current's step is rounded, and so is its middle
    for expected, values, half_a_step in ((part["fw.i_a_a"], rows.i_a, 33 * amperes), (part["fw.i_b_a"], rows.i_b, 33 * amperes),
                                          (part["fw.v_d_v"], rows.v_d, 128 * volts), (part["fw.v_q_v"], rows.v_q, 128 * volts),
                                          (part["fw.theta_ctrl_deg"], rows.angle_deg, 180.0 / 256.0),
                                          ((part["reg.ADC1BUF3"].astype(int) ^ 0x8000) / 65536.0 * bus_v, rows.bus_v, bus_v / 1e6),
                                          (part["fw.speed_est_rpm"], rows.speed_rpm, 0.01 * speed_rpm)):
        assert np.nanmax(np.abs(expected - values)) <= 1.001 * half_a_step
    for of, values in ((0, rows.bus_v), (4, rows.speed_rpm)): # the last three rows may have a part of one
        assert np.isnan(values[:-3]).tolist() == [place % 8 != of for place in record.places[:-3]]
    assert part["fw.state"].astype(int).tolist() == record.states
    assert rows.bus_v[~np.isnan(rows.bus_v)] == pytest.approx(24.0, abs=1.0), "and of the right size"


FAULT_AT_THE_END = """
title = "a fault at the end of the run"
motor = "hurst_dmb0224c10002"
board = "mclv"
duration_s = 1.002
[[event]]
at_s = 0.2
press = "S2"
[[event]]
at_s = 1.0
set = { "input.flta" = 1 }
"""


def test_a_run_that_ends_in_a_fault_shows_its_record_and_make_recorder_the_same(tmp_path: Path) -> None:
    (tmp_path / "late.toml").write_text(FAULT_AT_THE_END, encoding="utf-8")
    code, out, _ = command("run", str(tmp_path / "late.toml"), "--library", str(LIBRARY), "--out", str(tmp_path / "run"), "--quiet")
    assert code == 0, out
    page = (tmp_path / "run" / "index.html").read_text(encoding="utf-8")
    assert 'alt="recorder"' in page and "recorder.csv" in page and LOG in page
    assert "simulated 1.00 s" in out, "what is run on for the record is no part of the run"
    code, out, _ = command("recorder", str(tmp_path / "run" / LOG), "--library", str(LIBRARY), "--out", str(tmp_path / "again"))
    assert code == 0 and "OVERCURRENT_HW: 48 rows before it, 16 from it on, 4 periods apart" in out
    assert 'alt="recorder"' in (tmp_path / "again" / "index.html").read_text(encoding="utf-8")
    tables = [list(csv.DictReader((tmp_path / name / "recorder.csv").open(encoding="utf-8"))) for name in ("run", "again")]
    assert tables[0] == tables[1] and len(tables[0]) == 64 and tables[0][48]["state"] == "FAULT" and float(tables[0][48]["time_ms"]) == 0.0


def test_a_run_without_a_fault_has_no_record(tmp_path: Path) -> None:
    (tmp_path / "fine.toml").write_text(FAULT_AT_THE_END.partition("[[event]]")[0].replace("1.002", "0.1"), encoding="utf-8")
    code, _, _ = command("run", str(tmp_path / "fine.toml"), "--library", str(LIBRARY), "--out", str(tmp_path / "run"), "--quiet")
    assert code == 0 and not [path for path in (tmp_path / "run").iterdir() if "recorder" in path.name or path.name == LOG]


def test_without_a_log_the_newest_run_s_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paths, "RESULTS", tmp_path)
    code, _, error = command("recorder", "--library", str(LIBRARY))
    assert code == 2 and error.startswith("foc33: no run has left a record, LOG: make run SCENARIO=fault_stall makes one")
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / LOG).write_text(lines(), encoding="utf-8")
    code, out, _ = command("recorder", "--library", str(LIBRARY))
    assert code == 0 and "STALL: 2 rows before it, 2 from it on" in out
    assert (tmp_path / "recorder" / "recorder.png").is_file()


def test_a_log_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    for path, text in ((tmp_path / "none.txt", "No such file"), (tmp_path, "Is a directory")):
        code, _, error = command("recorder", str(path), "--library", str(LIBRARY))
        assert code == 2 and text in error and error.count("\n") == 1


def test_the_longest_record_is_sent_in_the_time_that_a_run_waits_for_it() -> None:
    longest = len("record fault OVERTEMPERATURE rows 64 every 64 offsets -1024 -1024\r\n") + 64 * len("row 63" + 6 * " -128" + "\r\n") + 10 * 100
    assert longest / 11520 < 0.05e-3 * simulate.CHUNK_PERIODS * simulate.LONGEST_RECORD_CHUNKS
