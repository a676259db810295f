"""Table 2 and the start matrix: their data files, and what makes a row fail."""

import tempfile
import unittest
from pathlib import Path

from tools.bench import report, start_sweep, table2
from tools.common import motor_file, paths
from tools.common.errors import UserError

NOTE = {500: (500, 0.148, 1.697), 1000: (1000, 0.111, 1.556), 1500: (1425, 0.083, 1.513), 2000: (1900, 0.062, 1.117),
        2500: (2375, 0.031, 0.608), 3000: (2850, 0.020, 0.636), 3500: (3325, 0.019, 1.174), 4000: (3800, 0.015, 1.556)}


def result(speed=1500.0, error=0.0, fault=None, voltage=0.0, current=0.0, current_rms=0.5):
    return {"speed_rpm": speed, "current_rms_a": current_rms, "speed_error_percent": error, "fault": fault, "voltage_at_limit_percent": voltage,
            "current_at_limit_percent": current}


class Table2(unittest.TestCase):
    def rows(self):
        return table2.Table.read(paths.TABLES / "table2.toml").rows

    def test_the_file_holds_the_note_s_eight_rows(self):
        self.assertEqual({row.reference_rpm: (row.note_rpm, row.torque_nm, row.note_current_a) for row in self.rows()}, NOTE)

    def test_every_row_must_reach_half_a_per_cent_and_all_but_the_first_at_the_note_s_current(self):
        self.assertEqual([row.error_percent for row in self.rows()], [0.5] * 8)
        self.assertEqual([row.no_more_current for row in self.rows()], [False] + [True] * 7)

    def test_a_row_fails_above_and_below_half_a_per_cent(self):
        row = self.rows()[2]
        for error, ok in ((0.5, True), (-0.5, True), (0.51, False), (-0.51, False), (None, False)):
            outcome = table2.check(row, result(error=error))[0]
            self.assertEqual((outcome.ok, outcome.row), (ok, "1500 rpm, 0.083 N m: speed"), error)

    def test_a_row_fails_above_the_note_s_current(self):
        row = self.rows()[2]
        for current, ok in ((1.513, True), (1.514, False), (None, False)):
            outcome = table2.check(row, result(current_rms=current))[1]
            self.assertEqual((outcome.ok, outcome.row), (ok, "1500 rpm, 0.083 N m: current"), current)
        self.assertEqual(len(table2.check(self.rows()[0], result(current_rms=9.0))), 1)

    def test_a_fault_fails_a_row_whatever_its_speed(self):
        outcome = table2.check(self.rows()[2], result(fault="STALL"))[0]
        self.assertFalse(outcome.ok)
        self.assertIn("STALL", outcome.got)

    def test_a_shortfall_is_explained_by_a_number(self):
        self.assertEqual(table2.limit_text(result(error=-3.0, voltage=100.0)), "voltage 100 % of the time")
        self.assertEqual(table2.limit_text(result(error=-3.0, voltage=0.4, current=80.0)), "current 80 % of the time")
        self.assertEqual(table2.limit_text(result(error=-0.4, voltage=100.0)), "")
        self.assertEqual(table2.limit_text(result(error=-3.0)), "neither voltage nor current")

    def test_times_in_the_wrong_order_are_refused(self):
        text = (paths.TABLES / "table2.toml").read_text(encoding="utf-8").replace("measure_from_s = 4.5", "measure_from_s = 1.0")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "t.toml"
            path.write_text(text, encoding="utf-8")
            with self.assertRaisesRegex(UserError, "times are not in order"):
                table2.Table.read(path)


def start(angle=0.0, load=0.0, closed=1.6, over=1.0, error=0.0, fault=None):
    return {"rotor_deg": angle, "load_nm": load, "closed_after_s": closed, "overshoot_percent": over, "speed_error_percent": error,
            "fault": fault}


class Starts(unittest.TestCase):
    def setUp(self) -> None:
        self.table = start_sweep.Table.read(paths.TABLES / "starts.toml")

    def test_the_matrix_is_every_15_degrees_with_three_loads_within_two_seconds(self):
        self.assertEqual((self.table.every_deg, self.table.loads_nm, self.table.within_s), (15.0, [0.0, 0.03, 0.06], 2.0))

    def test_another_motor_gets_shares_of_its_own_ratings_and_its_header_s_time(self):
        motor = motor_file.load("linix_45zwn24_40")
        slow = {"LOOPTIME_SEC": 50e-6, "NOPOLESPAIRS": 2.0, "END_SPEED_RPM": 800.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 3.0, "LOCK_TIME": 32000.0,
                "SPEED_BANDWIDTH_HZ": 12.0}
        table = self.table.for_motor(motor, slow)
        self.assertEqual(table.loads_nm, [0.0, 0.0115, 0.0231])
        self.assertEqual((table.motor, table.speed_rpm), ("linix_45zwn24_40", 1600.0))
        self.assertAlmostEqual(table.within_s, 1.6 + 800 / 536.4 + 0.5, delta=0.01)
        self.assertAlmostEqual(table.measure_from_s - table.within_s, self.table.measure_from_s - self.table.within_s)
        self.assertAlmostEqual(table.measure_to_s - table.measure_from_s, self.table.measure_to_s - self.table.measure_from_s)

    def test_a_speed_loop_made_slow_by_its_load_gets_time_to_settle(self):
        params = {"LOOPTIME_SEC": 50e-6, "NOPOLESPAIRS": 2.0, "END_SPEED_RPM": 800.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 3.0, "LOCK_TIME": 32000.0}
        quick, slow = (self.table.for_motor(motor_file.load("linix_45zwn24_40"), params | {"SPEED_BANDWIDTH_HZ": hz}) for hz in (20.0, 1.0))
        self.assertEqual(quick.within_s, slow.within_s)
        self.assertAlmostEqual(slow.measure_from_s - slow.start_s - slow.within_s, 5.0)
        self.assertAlmostEqual(slow.measure_to_s - slow.measure_from_s, quick.measure_to_s - quick.measure_from_s)

    def test_the_speed_is_not_below_the_hand_over(self):
        params = {"LOOPTIME_SEC": 50e-6, "NOPOLESPAIRS": 2.0, "END_SPEED_RPM": 1900.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 8.0, "LOCK_TIME": 9000.0,
                  "SPEED_BANDWIDTH_HZ": 12.0}
        self.assertEqual(self.table.for_motor(motor_file.load("linix_45zwn24_40"), params).speed_rpm, 1900.0)

    def test_a_good_start_holds(self):
        self.assertTrue(start_sweep.check(self.table, start()).ok)

    def test_each_way_to_fail_is_named_with_angle_and_load(self):
        for values, got in (({"closed": 2.01}, "closed loop after 2.010 s"), ({"closed": None}, "never in closed loop"),
                            ({"over": 10.1}, "overshoot 10.1 %"), ({"error": -0.6}, "speed error -0.60 %"),
                            ({"fault": "STALL"}, "fault STALL")):
            with self.subTest(got):
                outcome = start_sweep.check(self.table, start(45.0, 0.03, **values))
                self.assertEqual((outcome.ok, outcome.row, outcome.got), (False, "start from 45 deg with 0.03 N m", got))

    def test_the_printed_table_has_a_line_for_each_angle(self):
        rows = [start(angle, load, fault="STALL" if angle else None) for load in self.table.loads_nm for angle in (0.0, 15.0)]
        lines = start_sweep.text(self.table, rows).splitlines()
        self.assertIn("1.60 s", lines[1])
        self.assertEqual(lines[2].split(), ["15", "STALL", "STALL", "STALL"])

    def test_columns_of_the_note_are_in_the_table(self):
        self.assertTrue({"note_rpm", "note_current_a", "speed_rpm", "current_rms_a"} <= {key for key, _, _ in table2.COLUMNS})
        self.assertIn("limited by", report.table([{"name": "x"}], table2.COLUMNS))
