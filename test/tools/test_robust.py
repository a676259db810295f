"""Robustness: which deviations are tried, what counts as running, and how the margins are found."""

import csv
import itertools
import json
import math
import tempfile
import unittest
from pathlib import Path

from support import LIBRARY, command

from tools.bench import plots, robust
from tools.common import board_file, motor_file, paths
from tools.bench.board import Library
from tools.common.errors import UserError
from tools.bench.robust import Bench, Deviation, Margins, Search, Table

HURST = "hurst_dmb0224c10002"


def table() -> Table:
    return Table.read(paths.TABLES / "robust.toml")


def row(**more):
    values = {"closed_after_s": 1.6, "fault": None, "fault_s": None, "speed_error_percent": 0.1, "voltage_at_limit_percent": 0.0,
              "current_at_limit_percent": 0.0}
    return values | more


class Deviations(unittest.TestCase):
    def test_30_30_and_15_per_cent_are_promised_alone_and_in_every_combination(self):
        promised = {item.factors for item in robust.deviations(table()) if item.promised}
        alone = {(1.0, 1.0, 1.0), (0.7, 1.0, 1.0), (1.3, 1.0, 1.0), (1.0, 0.7, 1.0), (1.0, 1.3, 1.0), (1.0, 1.0, 0.85), (1.0, 1.0, 1.15)}
        self.assertEqual(promised, alone | set(itertools.product((0.7, 1.3), (0.7, 1.3), (0.85, 1.15))))

    def test_under_load_each_alone_is_promised_and_combinations_are_only_reported(self):
        promised = {item.factors for item in robust.deviations(table()) if item.promised_loaded}
        self.assertEqual(promised, {(1.0, 1.0, 1.0), (0.7, 1.0, 1.0), (1.3, 1.0, 1.0), (1.0, 0.7, 1.0), (1.0, 1.3, 1.0),
                                    (1.0, 1.0, 0.85), (1.0, 1.0, 1.15)})

    def test_a_cold_and_a_hot_motor_are_tried_as_well(self):
        degc = [item.temperature_degc for item in robust.deviations(table()) if item.temperature_degc is not None]
        self.assertLess(min(degc), 0.0)
        self.assertGreater(max(degc), 80.0)

    def test_names_are_different(self):
        names = [item.name for item in robust.deviations(table())]
        self.assertEqual(len(set(names)), len(names))

    def test_both_inductances_follow_the_factor_of_l(self):
        self.assertEqual(Deviation("x", (0.7, 1.3, 0.85)).values().values,
                         {"motor.rs_ohm": ("factor", 0.7), "motor.ld_h": ("factor", 1.3), "motor.lq_h": ("factor", 1.3),
                          "motor.psi_vs": ("factor", 0.85)})

    def test_the_plant_of_a_job_is_changed_and_its_header_is_not(self):
        library = Library(LIBRARY)
        bench = Bench(table(), motor_file.load(HURST), motor_file.part(HURST), board_file.part("mclv"), library)
        motor = bench.motor
        job = bench.job(Deviation("x", (0.7, 1.3, 0.85), temperature_degc=80.0), True)
        self.assertAlmostEqual(job.values["motor.rs_ohm"], 0.7 * motor.rs_ohm)
        self.assertAlmostEqual(job.values["motor.lq_h"], 1.3 * motor.lq_h)
        self.assertAlmostEqual(job.values["motor.psi_vs"], 0.85 * motor.psi_vs)
        self.assertEqual(job.values["motor.temp_c"], 80.0)
        self.assertEqual(job.library, library.path)
        brakes = [action.keys["load.constant_nm"] for action in job.actions if "load.constant_nm" in action.keys]
        self.assertAlmostEqual(brakes[0], motor.start_torque_nm)
        self.assertAlmostEqual(brakes[-1], 0.5 * motor.rated_torque_nm)
        self.assertAlmostEqual(job.scenario.measures[0].reference_rpm, 0.5 * motor.rated_speed_rpm)
        self.assertEqual({action.keys.get("load.constant_nm", 0.0) for action in bench.job(Deviation("x"), False).actions}, {0.0})

    def test_temperature_shows_in_the_true_factors(self):
        motor = motor_file.load(HURST)
        bench = Bench(table(), motor, None, None, None)
        r, l, kphi = bench._true(Deviation("hot", temperature_degc=125.0))
        self.assertAlmostEqual((r, l, kphi), (1.0 + 100.0 * motor.resistance_tempco_per_k, 1.0, 1.0 + 100.0 * motor.kphi_tempco_per_k))


class Law(unittest.TestCase):
    def test_a_true_kphi_has_no_error_a_smaller_one_lags_and_a_larger_one_leads(self):
        self.assertAlmostEqual(robust.law_deg(1.0), 0.0)
        self.assertAlmostEqual(robust.law_deg(1.1), 5.0, delta=0.1)
        self.assertAlmostEqual(robust.law_deg(2.0), 24.3, delta=0.1)
        self.assertAlmostEqual(robust.law_deg(0.8), -17.1, delta=0.2)

    def test_a_header_41_per_cent_too_high_is_the_end_of_lock(self):
        self.assertAlmostEqual(robust.law_deg(1.0 / 1.4142), -45.0, delta=1.0)
        self.assertIsNone(robust.law_deg(1.0 / 1.4143))


class Verdicts(unittest.TestCase):
    def test_a_good_run_is_ok(self):
        self.assertEqual(robust.verdict(table(), row()), "ok")

    def test_each_way_to_fail_is_named(self):
        for values, text in (({"closed_after_s": None}, "no start: never in closed loop"),
                             ({"closed_after_s": None, "fault": "START_FAILED", "fault_s": 1.8}, "no start: START_FAILED"),
                             ({"fault": "STALL", "fault_s": 2.0}, "closed, then STALL"), ({"fault": "STALL", "fault_s": 2.4}, "fault STALL"),
                             ({"speed_error_percent": 0.6}, "speed +0.6 %"), ({"speed_error_percent": None}, "no speed")):
            with self.subTest(text):
                self.assertEqual(robust.verdict(table(), row(**values)), text)

    def test_a_start_that_does_not_last_is_none(self):
        item = table() # S2 at 0.1 s, closed 1.6 s later: must last to 2.2 s
        self.assertFalse(robust.started(item, row(fault="LOST_LOCK", fault_s=2.19)))
        self.assertTrue(robust.started(item, row(fault="LOST_LOCK", fault_s=2.21)))

    def test_a_failed_case_names_its_load_and_its_error(self):
        outcome = robust.check(table(), row(case="R -30 %", load="loaded", verdict="no start: STALL", speed_error_percent=-100.0))
        self.assertEqual((outcome.row, outcome.ok, outcome.got), ("R -30 %, loaded", False, "no start: STALL, error -100.00 %"))


def searched(first_bad: float, upwards: bool, factors: list[float]) -> Search:
    """A search after runs at these factors, where everything beyond first_bad fails."""
    search = Search("R", upwards, False, lambda found: found["ok"])
    for factor in factors:
        ok = factor < first_bad if upwards else factor > first_bad
        search.narrow(factor, {"ok": ok, "verdict": "ok" if ok else "no"})
    return search


class Searches(unittest.TestCase):
    def test_the_ladder_goes_from_the_lowest_to_the_highest_factor_through_1(self):
        steps = robust.ladder(table())
        self.assertEqual((steps[0], steps[-1], steps), (0.3, 3.0, sorted(steps)))
        self.assertIn(1.0, steps)
        self.assertLessEqual(max(b / a for a, b in zip(steps, steps[1:])), robust.LADDER + 1e-9)
        self.assertGreater(min(b / a for a, b in zip(steps, steps[1:])), 1.0)

    def test_a_margin_lies_between_the_last_that_holds_and_the_first_that_does_not(self):
        search = searched(1.4, True, robust.ladder(table()))
        self.assertLess(search.good, 1.4)
        self.assertGreater(search.bad, 1.4)
        self.assertAlmostEqual(search.next(0.02), math.sqrt(search.good * search.bad))
        search = searched(0.6, False, robust.ladder(table()))
        self.assertGreater(search.good, 0.6)
        self.assertLess(search.bad, 0.6)

    def test_what_works_again_beyond_the_first_failure_does_not_count(self):
        for order in ((1.0, 1.2, 1.5, 2.0), (2.0, 1.5, 1.2, 1.0), (1.0, 2.0, 1.2, 1.5)):
            search = Search("R", True, False, lambda found: found["ok"])
            for factor in order:
                search.narrow(factor, {"ok": factor != 1.5, "verdict": "no"})
            self.assertEqual((search.good, search.bad), (1.2, 1.5), order)

    def test_the_search_ends_at_its_resolution(self):
        search = searched(1.4, True, [1.0, 1.39, 1.41])
        self.assertIsNone(search.next(0.02))
        self.assertIsNotNone(search.next(0.01))

    def test_bisection_comes_as_close_as_its_resolution(self):
        search = searched(1.4567, True, robust.ladder(table()))
        while (factor := search.next(0.005)) is not None:
            search.narrow(factor, {"ok": factor < 1.4567, "verdict": "no"})
        self.assertTrue(1.4567 / 1.005 <= search.good < 1.4567 <= search.bad)

    def test_a_parameter_without_a_limit_ends_at_the_bound(self):
        search = searched(99.0, True, robust.ladder(table()))
        self.assertEqual((search.good, search.bad, search.next(0.02)), (3.0, None, None))

    def margins(self, down: float, up: float) -> Margins:
        result = Margins()
        for name, (criterion, _, _), upwards in itertools.product(robust.PARAMETERS, robust.CRITERIA, (False, True)):
            result.searches[name, criterion, upwards] = searched(up if upwards else down, upwards, robust.ladder(table()))
        return result

    def test_the_printed_margin_marks_an_end_that_is_only_the_search_s(self):
        self.assertEqual(self.margins(0.0, 99.0).cell("R", "runs, loaded"), "<0.30 .. >3.00")
        self.assertRegex(self.margins(0.6, 1.5).cell("R", "runs, loaded"), r"^0\.6\d \.\. 1\.[34]\d$")
        self.assertEqual(self.margins(1.0, 1.0).cell("R", "runs, loaded"), "not at all")

    def test_the_printed_table_tells_what_happens_beyond(self):
        text = robust.margins_text(table(), self.margins(0.0, 1.5))
        self.assertRegex(text, r"(?m)^R x1\.\d\d: no \[starts, no load; runs, no load; starts, loaded; runs, loaded\]$")
        self.assertIn("0.85 .. 1.15", text)

    def test_every_case_is_tried_in_a_handful_of_rounds_and_never_twice(self):
        seen, rounds = [], []

        class FakeBench:
            table = table()

            def run(self, cases, title, quiet):
                rounds.append(title)
                seen.extend((item.name, loaded) for item, loaded in cases)
                found = []
                for item, loaded in cases:
                    ok = 0.71 < item.factors[2] < 2.0 and item.factors[0] < 2.5
                    found.append({"started": ok, "verdict": "ok" if ok else "no", "load": robust.load_name(loaded)})
                return found

        margins = robust.find_margins(FakeBench(), True)
        self.assertEqual(len(set(seen)), len(seen))
        self.assertLessEqual(len(rounds), 5)
        self.assertEqual(margins.cell("L", "runs, loaded"), "<0.30 .. >3.00")
        low, high = margins.searches["Kphi", "runs, no load", False].good, margins.searches["Kphi", "runs, no load", True].good
        self.assertTrue(0.71 < low < 0.71 * 1.021 and 2.0 / 1.021 < high < 2.0, (low, high))


class Plots(unittest.TestCase):
    def test_margins_and_angle_error_are_drawn_even_where_nothing_runs(self):
        found = [{"parameter": name, "criterion": criterion, "direction": direction, "factor": 1.0 if name == "R" else end,
                  "fails_at": 1.0 if name == "R" else None}
                 for name in robust.PARAMETERS for criterion, _, _ in robust.CRITERIA for direction, end in (("down", 0.5), ("up", 2.0))]
        runs = [{"parameter": name, "load": load, "factor": factor, "verdict": "no" if name == "R" else "ok", "angle_error_mean_deg": 1.0}
                for name in robust.PARAMETERS for load in ("no load", "loaded") for factor in (0.5, 1.0, 2.0)]
        with tempfile.TemporaryDirectory() as folder:
            names = plots.write_robust(found, runs, table().promised, robust.law_deg, Path(folder))
            self.assertEqual(names, ["margins.png", "angle_error.png"])
            for name in names:
                self.assertEqual((Path(folder) / name).read_bytes()[:4], b"\x89PNG")


class CommandLine(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)

    def test_the_promised_deviations_in_full(self):
        out = self.root / "out"
        code, text, error = command("robust", "--no-margins", "--library", str(LIBRARY), "--out", str(out), "--quiet")
        self.assertIn(code, (0, 1))
        self.assertEqual(code == 0, error == "", "a failed case and only a failed case is named on stderr")
        data = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        self.assertEqual(len(data["rows"]), 2 * len(robust.deviations(table())))
        self.assertEqual(data["passed"], code == 0)
        self.assertEqual(sum(item["promised"] for item in data["rows"]), 15 + 7)
        self.assertEqual(len(data["expectations"]), 15 + 7)
        with (out / "robust.csv").open(encoding="utf-8") as file:
            rows = {(item["case"], item["load"]): item for item in csv.DictReader(file)}
        for load in ("no load", "loaded"):
            for case in ("as in the header", "R -30 %", "R +30 %", "L -30 %", "L +30 %", "Kphi -15 %", "Kphi +15 %"):
                self.assertEqual(rows[case, load]["verdict"], "ok", (case, load))
        for case in ("Kphi -15 %", "Kphi +15 %"): # the law, with the header's own error taken off
            item = rows[case, "no load"]
            error_deg = float(item["angle_error_mean_deg"]) - float(rows["as in the header", "no load"]["angle_error_mean_deg"])
            self.assertAlmostEqual(error_deg, float(item["law_deg"]), delta=2.0)

    def test_mistakes_are_one_line(self):
        for arguments, part in ((["--motor", "hurst"], "no motor 'hurst'"), (["--userparams", "no/where"], "no userparams.h in 'no/where'"),
                                (["--library", str(LIBRARY), "--userparams", "."], "leave out --library or --userparams")):
            code, out, error = command("robust", *arguments, "--out", str(self.root / "out"))
            self.assertEqual((code, out), (2, ""))
            self.assertRegex(error, r"\Afoc33: [^\n]+\n\Z")
            self.assertIn(part, error)
        self.assertEqual(list(self.root.iterdir()), [])

    def test_a_wrong_table_is_refused(self):
        path = self.root / "robust.toml"
        text = (paths.TABLES / "robust.toml").read_text(encoding="utf-8")
        path.write_text(text.replace("lowest_factor = 0.3", "lowest_factor = 1.5"), encoding="utf-8")
        with self.assertRaisesRegex(UserError, "'lowest_factor' = 1.5 is impossible, .*line"):
            Table.read(path)
