"""The acceptance table: what it asks of a motor, what makes a row fail, and one motor run in full."""

import csv
import json
import tempfile
import unittest
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

from support import command

from tools.bench import plots, rating_sweep, sweep
from tools.common import motor_file, paths
from tools.common.errors import UserError
from tools.bench.rating_sweep import Candidate, Table

HURST = "hurst_dmb0224c10002"
PARAMS = {"LOOPTIME_SEC": 50e-6, "NOPOLESPAIRS": 5.0, "END_SPEED_RPM": 1000.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 10.0, "LOCK_TIME": 4000.0,
          "SPEEDREFRAMP_RPM_PER_S": 4000.0, "MINIMUM_SPEED_RPM": 500.0, "NOMINAL_SPEED_RPM": 2800.0, "MAXIMUM_SPEED_RPM": 5500.0,
          "MAXIMUM_CURRENT_A": 2.75}


def table() -> Table:
    return Table.read(paths.TABLES / "rated.toml")


def row(**more):
    values = {"motor": "m", "row": "50 %", "fault": None, "closed_after_s": 1.6, "speed_error_percent": 0.1, "angle_error_rms_deg": 2.0,
              "current_of_maximum_percent": 50.0, "voltage_at_limit_percent": 0.0, "current_at_limit_percent": 0.0, "voltage_percent": 60.0,
              "reference_rpm": 1400.0, "highest_rpm": 1402.0}
    return values | more


class Demands(unittest.TestCase):
    def test_the_table_asks_for_20_50_and_100_per_cent_within_half_a_per_cent_at_half_torque(self):
        item = table()
        self.assertEqual((item.speeds_percent, item.torque_percent, item.error_percent), ([20.0, 50.0, 100.0], 50.0, 0.5))

    def test_a_motor_s_rows_follow_from_its_rating_and_its_header(self):
        motor = motor_file.load(HURST)
        candidate = Candidate(motor, None, "", SimpleNamespace(params=PARAMS))
        rows = rating_sweep.rows_of(table(), candidate)
        half = 0.5 * motor.rated_torque_nm
        self.assertEqual([(item.name, item.torque_nm) for item in rows], [("20 %", half), ("50 %", half), ("100 %", half), ("maximum", 0.0)])
        for item, share in zip(rows, (0.2, 0.5, 1.0)):
            self.assertAlmostEqual(item.rpm, share * motor.rated_speed_rpm)
        self.assertEqual(rows[-1].rpm, 5500.0)

    def test_a_good_row_is_ok(self):
        self.assertEqual(rating_sweep.verdict(table(), row()), "ok")
        self.assertTrue(rating_sweep.check(table(), row(verdict="ok"))[0].ok)

    def test_each_way_to_fail_is_named(self):
        for values, text in (({"fault": "STALL"}, "fault STALL"), ({"closed_after_s": None}, "never in closed loop"),
                             ({"closed_after_s": 5.1}, "closed loop after 5.10 s"), ({"speed_error_percent": 0.51}, "speed +0.5 %"),
                             ({"speed_error_percent": None}, "no speed"), ({"angle_error_rms_deg": 10.1}, "angle"),
                             ({"current_of_maximum_percent": 100.1}, "current"),
                             ({"speed_error_percent": -2.0, "voltage_at_limit_percent": 100.0}, "speed -2.0 % (voltage 100 % of the time)")):
            with self.subTest(text):
                self.assertEqual(rating_sweep.verdict(table(), row(**values)), text)

    def test_a_failed_row_names_motor_row_and_numbers(self):
        outcome = rating_sweep.check(table(), row(verdict="angle", angle_error_rms_deg=12.0))[0]
        self.assertEqual((outcome.row, outcome.ok), ("m at 50 %", False))
        self.assertIn("angle error 12.0 deg", outcome.got)
        self.assertIn("angle error 10 deg", outcome.allowed)

    def test_an_error_at_its_limit_still_holds(self):
        for error, speed in ((0.5, ""), (-0.5, ""), (0.6, "speed +0.6 %")):
            self.assertEqual(sweep.speed_verdict(row(speed_error_percent=error), 0.5), speed)

    def test_what_was_reached_without_load_is_told(self):
        self.assertEqual(rating_sweep.highest_text([row(highest_rpm=5432.1, reference_rpm=5500.0)]),
                         "without load up to 5432 rpm (MAXIMUM_SPEED_RPM 5500)")
        self.assertEqual(rating_sweep.highest_text([row(highest_rpm=None)]), "no closed loop without load")


class Schedule(unittest.TestCase):
    TIMES = SimpleNamespace(start_s=0.1, settle_s=1.0, torque_over_s=0.5, where="here")

    def test_the_start_takes_lock_and_ramp(self):
        self.assertAlmostEqual(sweep.start_time_s(PARAMS), 0.2 + 1.398 + sweep.START_MARGIN_S, places=3)

    def test_a_slower_header_is_given_more_time(self):
        for change in ({"LOCK_TIME": 8000.0}, {"OPENLOOP_RAMPSPEED_INCREASERATE": 5.0}, {"END_SPEED_RPM": 1500.0}):
            self.assertGreater(sweep.start_time_s(PARAMS | change), sweep.start_time_s(PARAMS) + 0.19, change)

    def test_the_brake_closes_when_the_speed_is_reached_and_the_measure_waits_for_it(self):
        events, settled_s = sweep.loaded_run(PARAMS, 2600.0, self.TIMES, "x", torque_nm=0.04, start_torque_nm=0.01)
        brakes = [(event.at_s, event.keys["load.constant_nm"]) for event in events if event.keys]
        closed_s = 0.1 + sweep.start_time_s(PARAMS)
        self.assertEqual([torque for _, torque in brakes], [0.01, 0.04])
        self.assertAlmostEqual(brakes[1][0], closed_s + 1600.0 / 4000.0 + 1.0)
        self.assertAlmostEqual(settled_s, brakes[1][0] + 0.5 + 1.0)

    def test_the_potentiometer_waits_inside_its_normal_range_until_the_loop_is_closed(self):
        for rpm, first in ((5500.0, 2800.0), (1400.0, 1400.0)):
            events, _ = sweep.loaded_run(PARAMS, rpm, self.TIMES, "x")
            speeds = [(event.at_s, event.value) for event in events if event.kind == "speed_rpm"]
            self.assertEqual([speed for _, speed in speeds], [first, rpm])
            self.assertGreater(speeds[1][0], 1.6)

    def test_a_firmware_that_hides_a_parameter_is_refused(self):
        with self.assertRaisesRegex(UserError, "does not tell LOCK_TIME"):
            sweep.start_time_s({name: value for name, value in PARAMS.items() if name != "LOCK_TIME"})


class TableFile(unittest.TestCase):
    def test_mistakes_are_one_line_with_their_place(self):
        text = (paths.TABLES / "rated.toml").read_text(encoding="utf-8")
        for old, new, said in (("settle_s = 1.5", "settle_s = 0", "'settle_s' = 0 is impossible"),
                               ("speeds_percent = [20, 50, 100]", "speeds_percent = []", "not a list of numbers"),
                               ("error_percent", "eror_percent", "'error_percent' is missing"),
                               ("start_s", "more = 1\nstart_s", "unknown key 'more'")):
            with self.subTest(said), tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "rated.toml"
                path.write_text(text.replace(old, new, 1), encoding="utf-8")
                with self.assertRaisesRegex(UserError, said):
                    Table.read(path)


class CommandLine(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.out = Path(folder.name) / "out"

    def refused(self, result: tuple[int, str, str], *parts: str) -> None:
        code, out, error = result
        self.assertEqual((code, out), (2, ""), error)
        self.assertRegex(error, r"\Afoc33: [^\n]+\n\Z")
        for part in parts:
            self.assertIn(part, error)
        self.assertFalse(self.out.exists())

    def test_one_motor_in_full(self):
        code, out, error = command("rated", "--motor", HURST, "--userparams", str(paths.ROOT), "--out", str(self.out), "--quiet")
        self.assertEqual((code, error), (0, ""), out)
        self.assertIn("4 of 4 expectations hold", out)
        self.assertRegex(out, r"without load up to 5[45]\d\d rpm \(MAXIMUM_SPEED_RPM 5500\)")
        with (self.out / "rated.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([item["row"] for item in rows], ["20 %", "50 %", "100 %", "maximum"])
        data = json.loads((self.out / "summary.json").read_text(encoding="utf-8"))
        self.assertTrue(data["passed"])
        self.assertEqual([item["header"] for item in data["motors"]], ["userparams.h"])
        self.assertEqual({path.name for path in self.out.iterdir()}, {"summary.json", "rated.csv", "rated.png"})

    def test_a_motor_that_was_not_tuned_is_refused_with_the_way_to_tune_it(self):
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(paths, "TUNED", Path(folder)):
            self.refused(command("rated", "--motor", HURST, "--out", str(self.out)), f"no userparams.h for motor '{HURST}'",
                         f"make tune MOTOR={HURST}")

    def test_a_motor_without_a_header_does_not_stop_the_others(self):
        ready = []

        def build(found, options):
            ready.extend(motor.name for motor, _ in found)
            raise UserError("that is enough")
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(paths, "TUNED", Path(folder)), mock.patch.object(rating_sweep, "_candidates", build):
            (Path(folder) / HURST).mkdir()
            (Path(folder) / HURST / "userparams.h").write_text("", encoding="utf-8")
            _, _, error = command("rated", "--motor", "linix_45zwn24_40", HURST, "--out", str(self.out))
        self.assertEqual(ready, [HURST])
        self.assertRegex(error, r"\Afoc33: no userparams.h for motor 'linix_45zwn24_40'.*\nfoc33: that is enough\n\Z")

    def test_wrong_motors_and_headers_are_refused(self):
        self.refused(command("rated", "--motor", "hurst", "--out", str(self.out)), "no motor 'hurst'", "--motor")
        self.refused(command("rated", "--motor", HURST, HURST, "--userparams", ".", "--out", str(self.out)), "one header for several motors")
        self.refused(command("rated", "--motor", HURST, "--userparams", "no/where", "--out", str(self.out)), "no userparams.h in 'no/where'")

    def test_the_list_of_motors_has_a_line_for_each(self):
        code, out, _ = command("motors")
        self.assertEqual(code, 0)
        for name in paths.names(paths.MOTORS):
            self.assertRegex(out, rf"(?m)^{name} ")

    def test_a_motor_file_that_cannot_be_read_is_missing_in_the_list_and_named(self):
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(paths, "MOTORS", Path(folder)):
            for name, text in ((HURST, (paths.ROOT / "tuning" / "motors" / f"{HURST}.toml").read_text(encoding="utf-8")), ("broken", "x = = 1")):
                (Path(folder) / f"{name}.toml").write_text(text, encoding="utf-8")
            code, out, error = command("motors")
        self.assertEqual((code, error.count("\n")), (2, 1))
        self.assertRegex(error, r"\Afoc33: TOML syntax, .*broken\.toml line 1")
        self.assertRegex(out, rf"(?m)^{HURST} ")


class Highest(unittest.TestCase):
    def test_the_highest_speed_is_a_mean_in_closed_loop(self):
        from support import run, step
        speed = step((0, 9000), (0.5, 1000), (1.0, 3000), (1.005, 2000), (1.5, 8000))
        item = run(fw__state=step((0, 4), (0.5, 5), (1.5, 1)), plant__speed_rpm=speed)
        self.assertAlmostEqual(sweep.highest_rpm(item), 2000.0 + 1000.0 * 0.005 / 0.1, delta=1.0)

    def test_without_closed_loop_there_is_none(self):
        from support import run
        self.assertIsNone(sweep.highest_rpm(run(fw__state=4, plant__speed_rpm=1000)))

    def test_a_run_backwards_counts_as_well(self):
        from support import run
        self.assertAlmostEqual(sweep.highest_rpm(run(fw__state=5, plant__speed_rpm=-1500)), 1500.0)


class Plot(unittest.TestCase):
    def test_it_can_draw_rows_that_failed(self):
        rows = [row(), row(row="maximum", speed_error_percent=None, angle_error_rms_deg=None, current_of_maximum_percent=None,
                           voltage_percent=None), row(motor="n", speed_error_percent=-80.0)]
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(plots.write_rated(rows, vars(table()), Path(folder)), ["rated.png"])
            self.assertEqual((Path(folder) / "rated.png").read_bytes()[:4], b"\x89PNG")
