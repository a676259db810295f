"""The field-weakening tuner: its parts with made-up motors, the tables file, and parameters that change while the motor turns."""

import math
import tempfile
import unittest
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np

from tools.bench import build
from tools.common import board_file, board_keys, motor_file, paths
from tools.bench.board import BoardError, Library
from tools.common.errors import UserError
from tuning import fw_search, fw_tables, fw_tune
from tuning.fw_bench import SIGNALS, Bench, Fault, Point, reduced
from tuning.fw_search import Goal, Search, correction, largest, least, model_current, model_use, peak, voltage_limit
from tuning.fw_tables import ENTRIES, Entry, Tables
from tune_support import command, motor_path

HURST = "hurst_dmb0224c10002"
HEADER = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
PARAMS = {"NOPOLESPAIRS": 5.0, "MOTOR_RS_OHM": 2.67, "MOTOR_LS_MH": 1.92, "MOTOR_KPHI_V_PER_KRPM": 7.24, "NOMINAL_BUS_V": 24.0,
          "LOOPTIME_SEC": 50e-6, "DEADTIME_SEC": 2e-6, "SAMPLE_WINDOW_SEC": 1.6e-6, "MAXIMUM_CURRENT_A": 2.75, "INVKFI_SPEED0": 7956.0,
          "END_SPEED_RPM": 1000.0, "MINIMUM_SPEED_RPM": 500.0, "MAXIMUM_SPEED_RPM": 6400.0}
GOAL = Goal(0.97, 3.0, 2.66, 2.66, 0.08, 2800.0, 0.2, 5500.0)


class Parts(unittest.TestCase):
    def test_least_finds_the_threshold_from_every_guess_and_none_where_nothing_suffices(self):
        for low, high in ((0, 0), (0, 1), (0, 37), (5, 30)):
            for guess in range(low - 3, high + 4):
                for threshold in range(low, high + 1):
                    self.assertEqual(least(lambda n: n >= threshold, guess, low, high), threshold, (low, high, threshold, guess))
                self.assertIsNone(least(lambda n: False, guess, low, high))

    def test_least_asks_each_value_once_and_not_outside_and_little_where_the_guess_is_right(self):
        for threshold, guess, most in (*((threshold, 40, 19) for threshold in range(0, 200, 7)), (100, 100, 4)):
            asked = []
            least(lambda n: asked.append(n) or n >= threshold, guess, 0, 200)
            self.assertEqual(len(asked), len(set(asked)))
            self.assertTrue(all(0 <= n <= 200 for n in asked))
            self.assertLessEqual(len(asked), most)

    def test_peak_finds_the_top_of_a_hill_or_a_line_and_uses_what_is_known(self):
        for top in range(0, 267, 11):
            known = {0: -float(top), 266: top - 266.0}
            self.assertLessEqual(abs(peak(lambda n: -abs(n - top), known, 0, 266) - top), 4, top)
        self.assertEqual(peak(float, {}, 0, 266), 266)
        asked = []
        self.assertEqual(peak(lambda n: asked.append(n) or 0.0, {n: -abs(n - 100.0) for n in range(0, 201, 4)}, 0, 200), 100)
        self.assertEqual(asked, [])

    def test_largest_halves_towards_the_threshold(self):
        self.assertAlmostEqual(largest(lambda x: x <= 0.3, 1.0, 10), 0.3, delta=1.0 / 1024)
        self.assertEqual((largest(lambda x: True, 0.2, 8), largest(lambda x: False, 0.2, 8)), (0.2, 0.0))

    def test_the_voltage_model_is_the_equation_and_its_circle_the_modulator_s(self):
        self.assertAlmostEqual(voltage_limit(PARAMS), 0.936 * 24.0 / math.sqrt(3.0), places=6)
        self.assertAlmostEqual(model_use(PARAMS, 2000.0, 0.0, 0.0) * voltage_limit(PARAMS), 2.0 * 7.24 / math.sqrt(3.0), places=6)
        w = 4000.0 * 5.0 * 2.0 * math.pi / 60.0
        v_d, v_q = 2.67 * -1.5 - w * 1.92e-3 * 0.4, 2.67 * 0.4 + w * (1.92e-3 * -1.5 + 7.983e-3)
        self.assertAlmostEqual(model_use(PARAMS, 4000.0, -1.5, 0.4) * voltage_limit(PARAMS), math.hypot(v_d, v_q), places=2)
        current = model_current(PARAMS, 4000.0, 0.3, 0.97, 3.0)
        self.assertLessEqual(model_use(PARAMS, 4000.0, -current, 0.3), 0.97)
        self.assertGreater(model_use(PARAMS, 4000.0, -current + 0.01, 0.3), 0.97)

    def test_correction_is_least_squares(self):
        for errors, slopes, wanted in (([2.0, 4.0], [1.0, 1.0], -3.0), ([3.0], [-1.5], 2.0), ([3.0], [0.0], 0.0)):
            self.assertAlmostEqual(correction(errors, slopes), wanted)

    def test_load_falls_with_one_over_speed_above_rated_speed(self):
        self.assertAlmostEqual(GOAL.load_nm(2000.0), 0.016)
        self.assertAlmostEqual(GOAL.load_nm(5600.0), 0.008)


class FakeMotor:
    """Steady state of a motor with saturation, by its equations; `faults_below` lets it fault where too little d current flows."""

    def __init__(self, saturation: float = 0.0, faults_below: float = 0.0, **params: float) -> None:
        self.params = {**PARAMS, **params}
        self.saturation, self.faults_below = saturation, faults_below
        self.table = [Entry(0.0, 7956.0, 0.5)] * ENTRIES
        self.values: dict[str, float] = {"FW_START_SPEED_RPM": 3000.0}
        self.load_nm = self.rpm = 0.0
        self.starts = 0
        self.running = False

    def start(self) -> None:
        self.running, self.rpm = True, 1000.0
        self.starts += 1

    def stopped(self) -> bool:
        return not self.running

    def run(self, seconds: float) -> None:
        pass

    def settle(self) -> None:
        self.check()

    def load(self, torque_nm: float) -> None:
        self.load_nm = torque_nm

    def speed(self, rpm: float) -> bool:
        self.rpm = rpm
        self.check()
        return True

    def regain(self) -> bool:
        self.check()
        return self.point().held

    def entries_from(self, index: int, entry: Entry) -> None:
        self.table[index:] = [entry] * (ENTRIES - index)

    def set(self, name: str, value: float) -> None:
        self.values[name] = value

    def now(self) -> Entry:
        place = max(0.0, (self.rpm - self.values["FW_START_SPEED_RPM"]) * self.params["NOPOLESPAIRS"] / 1024.0)
        return self.table[min(round(place), ENTRIES - 1)]

    def inductance(self, id_a: float, iq_a: float) -> float:
        return self.params["MOTOR_LS_MH"] * 1e-3 * (1.0 - self.saturation * min(1.0, (id_a ** 2 + iq_a ** 2) / 9.0))

    def use(self, entry: Entry) -> tuple[float, float]:
        iq_a = (self.load_nm + 0.008) / fw_search.torque_per_ampere(self.params)
        ls_h = self.inductance(entry.idref_a, iq_a)
        return model_use(self.params, self.rpm, entry.idref_a, iq_a, 0.5 * ls_h / self.params["MOTOR_LS_MH"] * 1e3), iq_a

    def check(self) -> None:
        if self.running and self.use(self.now())[0] > 1.0 + self.faults_below > 1.0:
            self.running = False
            raise Fault("STALL")

    def point(self) -> Point:
        self.check()
        entry = self.now()
        use, iq_a = self.use(entry)
        psi, ls_h = fw_search.flux_vs(self.params), self.inductance(entry.idref_a, iq_a)
        wrong_h = ls_h - self.params["MOTOR_LS_MH"] * 1e-3 * 2.0 * entry.ls_ratio
        angle = math.degrees(1.0 - 7956.0 / entry.inv_kfi / (1.0 + wrong_h * entry.idref_a / psi))
        speed = self.rpm if use <= 1.0 else self.rpm / use
        return Point(speed, self.rpm, min(use, 1.0), angle, abs(angle), entry.idref_a, iq_a, 0.7 * math.hypot(entry.idref_a, iq_a), 0.0, 24.0)


class Measuring(unittest.TestCase):
    ROW = {"plant.speed_rpm": 3000.0, "plant.theta_e_deg": 359.0, "plant.i_d": -0.6, "plant.i_q": 0.8, "fw.theta_est_deg": 1.0, "fw.v_d_v": -6.0,
           "fw.v_q_v": 8.0, "fw.v_limit_v": 12.5, "fw.id_ref_a": -0.6, "fw.id_trim_a": -0.1, "bus.voltage_v": 23.9}

    def point(self, **changes: float) -> Point:
        row = {**self.ROW, **{name.replace("__", "."): value for name, value in changes.items()}}
        return reduced(np.tile([row[name] for name in SIGNALS], (4, 1)), 3000.0)

    def test_means_and_an_angle_error_taken_around_the_circle(self):
        point = self.point()
        self.assertAlmostEqual(point.use, 0.8)
        self.assertAlmostEqual(point.current_rms_a, math.sqrt(0.5))
        self.assertEqual((point.id_a, point.iq_a, point.trim_a, point.bus_v), (-0.6, 0.8, -0.1, 23.9))
        self.assertAlmostEqual(point.angle_deg, 2.0)
        self.assertAlmostEqual(self.point(plant__theta_e_deg=2.0).angle_deg, -1.0)

    def test_a_speed_is_held_within_half_a_per_cent(self):
        for rpm, held in ((2985.5, True), (3014.5, True), (2984.5, False), (3015.5, False)):
            self.assertEqual(self.point(plant__speed_rpm=rpm).held, held, rpm)


class Starting(unittest.TestCase):
    SLOW = {**PARAMS, "LOCK_TIME": 32000.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 1.0}
    """1.6 s of lock and 14 s of ramp"""

    def start(self, closes_after_s: float, fault: str = "", risks: str = "") -> float:
        """Motor time of a start; the board is in closed loop, or faults, after a time."""
        bench = Bench.__new__(Bench)
        bench.params, bench.risks, bench.board = self.SLOW, risks, mock.Mock()
        bench.ranges = mock.Mock(minimum_rpm=500.0)
        times: list[float] = []
        over = lambda: sum(times) > closes_after_s # noqa: E731
        with mock.patch.multiple(bench, create=True, run=times.append, press=lambda button: None, load=lambda torque_nm: None,
                                 fault=lambda: fault if over() else "", state=lambda: "CLOSED" if over() and not fault else "RAMP"):
            bench.start()
        return sum(times)

    def test_a_start_that_takes_long_by_its_parameters_is_waited_for(self):
        self.assertAlmostEqual(self.start(15.5), 16.0, delta=0.2)
        with self.assertRaisesRegex(UserError, r"does not start \(no fault in state RAMP after 2[3-5]\.\d s\): run `make run`"):
            self.start(60.0)

    def test_what_the_tuner_warned_about_is_the_remedy_of_a_start_that_fails(self):
        for risks, remedy in (("", "the motor does not follow the ramp: raise Q_CURRENT_REF_OPENLOOP.*"), ("it swings: add friction", "it swings: add friction")):
            with self.assertRaisesRegex(UserError, rf"does not start \(START_FAILED [^)]*\): {remedy}\Z"):
                self.start(3.0, "START_FAILED", risks)

    def test_the_risks_are_the_tuner_s_warnings_about_the_start(self):
        options = SimpleNamespace(userparams=None)
        with motor_path(("viscous_friction = { value = 15.3e-6", "viscous_friction = { value = 1e-9"),
                        ("coulomb_friction = { value = 0.004", "coulomb_friction = { value = 0.0")) as path:
            _, risks = fw_tune._header(options, motor_file.load(str(path)), board_file.load("mclv"))
        self.assertRegex(risks, r"\Athe unloaded rotor still swings .*: add \[mechanical\] coulomb_friction, which the no-load current gives\Z")
        self.assertEqual(fw_tune._header(options, motor_file.load(HURST), board_file.load("mclv"))[1], "")
        self.assertEqual(fw_tune._header(SimpleNamespace(userparams=str(paths.ROOT)), None, None), (HEADER, ""))


class MadeUpMotors(unittest.TestCase):
    def search(self, motor: FakeMotor, goal: Goal = GOAL, entries: int = ENTRIES) -> tuple[fw_search.Result, FakeMotor]:
        return Search(motor, goal, entries=entries).run(), motor

    def test_every_entry_has_the_least_current_with_the_margin(self):
        result, motor = self.search(FakeMotor())
        self.assertGreater(len(result.found), 10)
        for found in result.found[1:]:
            motor.rpm, motor.load_nm = found.rpm, found.load_nm
            self.assertLessEqual(motor.use(found.entry)[0], 0.97 + 1e-9)
            before = result.found[found.index - 1].entry
            if found.entry.idref_a < before.idref_a:
                self.assertGreater(motor.use(replace(found.entry, idref_a=found.entry.idref_a + 0.01))[0], 0.97, found.index)

    def test_field_weakening_starts_where_the_voltage_asks_for_it(self):
        result, motor = self.search(FakeMotor(), entries=2)
        motor.load_nm = GOAL.load_nm(result.start_rpm)
        motor.rpm = result.start_rpm
        self.assertLessEqual(motor.use(Entry())[0], 0.97)
        motor.rpm += fw_search.START_STEP_RPM
        self.assertGreater(motor.use(Entry())[0], 0.97)

    def test_with_saturation_ls_follows_the_motor(self):
        result, motor = self.search(FakeMotor(saturation=0.4))
        changed = [found for found in result.found if found.corrected]
        self.assertTrue(changed)
        for found in result.found:
            self.assertLessEqual(abs(found.free.angle_deg), 3.0)
            self.assertLessEqual(abs(found.loaded.angle_deg), 3.0)
        first = changed[0]
        true = 0.5 * motor.inductance(first.entry.idref_a, first.loaded.iq_a) / 1.92e-3
        self.assertAlmostEqual(first.entry.ls_ratio, true, delta=0.03)

    def with_angle(self, angle) -> fw_search.Result:
        """A search on a motor whose angle error follows from the entry."""
        motor = FakeMotor()
        point = motor.point
        motor.point = lambda: replace(point(), angle_deg=angle(motor.now()))
        return self.search(motor, entries=3)[0]

    def test_a_wrong_kphi_that_ls_cannot_mend_moves_inv_kfi(self):
        found = self.with_angle(lambda entry: 60.0 * (entry.inv_kfi / 7956.0 - 0.9) if entry.idref_a else 0.0).found[1]
        self.assertAlmostEqual(found.entry.inv_kfi, 0.9 * 7956.0, delta=80.0)
        self.assertEqual(found.entry.ls_ratio, 0.5)

    def test_without_an_error_or_an_effect_or_where_it_gets_worse_the_other_tables_stay_flat(self):
        flat = [self.search(FakeMotor())[0], self.with_angle(lambda entry: 8.0),
                self.with_angle(lambda entry: 5.0 + 50.0 * abs(entry.ls_ratio - 0.5) + 50.0 * abs(entry.inv_kfi / 7956.0 - 1.0))]
        for result in flat:
            self.assertEqual({(found.entry.inv_kfi, found.entry.ls_ratio) for found in result.found}, {(7956.0, 0.5)})

    def test_stops_at_the_current_limit_and_says_so(self):
        result, _ = self.search(FakeMotor(), replace(GOAL, limit_a=1.5))
        self.assertLess(len(result.found), 10)
        self.assertIn("limit of 1.50 A", result.stopped)
        entries = result.entries()
        self.assertEqual(len(entries), ENTRIES)
        self.assertEqual(entries[-1].idref_a, -1.5)
        self.assertGreaterEqual(min(entry.idref_a for entry in entries), -1.5)

    def test_stops_where_more_current_gives_no_more_speed(self):
        result, _ = self.search(FakeMotor(saturation=0.9), replace(GOAL, angle_deg=1000.0))
        self.assertIn("gives no more speed", result.stopped)

    def test_near_the_limit_the_load_gives_way_first_and_the_current_never_falls_with_speed(self):
        result, _ = self.search(FakeMotor())
        currents = [entry.idref_a for entry in result.entries()]
        self.assertEqual(currents, sorted(currents, reverse=True))
        shares = [found.load_nm / GOAL.load_nm(found.rpm) for found in result.found]
        self.assertAlmostEqual(shares[1], 1.0)
        self.assertLess(shares[-1], 0.9)
        self.assertEqual(shares, sorted(shares, reverse=True))

    def test_above_the_rated_current_only_speed_is_paid_for(self):
        result, motor = self.search(FakeMotor(), replace(GOAL, rated_a=1.5))
        self.assertTrue(any(found.entry.idref_a < -2.0 for found in result.found))
        for found, before in zip(result.found[1:], result.found):
            if found.entry.idref_a < min(-1.5, before.entry.idref_a):
                self.assertEqual(found.load_nm, 0.0)
                motor.rpm, motor.load_nm = found.rpm, 0.0
                self.assertGreater(motor.use(replace(found.entry, idref_a=found.entry.idref_a + 0.01))[0], 0.97)
        self.assertEqual(result.found[1].load_nm, GOAL.load_nm(result.found[1].rpm))

    def test_no_field_weakening_where_none_is_needed(self):
        result, _ = self.search(FakeMotor(), replace(GOAL, maximum_rpm=2000.0))
        self.assertFalse(result.needed)
        self.assertIn("no field weakening is needed", result.stopped)
        self.assertEqual({entry.idref_a for entry in result.entries()}, {0.0})

    def test_ends_where_the_number_format_ends(self):
        result, _ = self.search(FakeMotor(MAXIMUM_SPEED_RPM=4000.0))
        self.assertIn("number format of speeds ends at 4000 rpm", result.stopped)
        self.assertLessEqual(result.found[-1].rpm, 4000.0)

    def test_a_fault_on_the_way_costs_a_restart_and_changes_nothing_and_the_trim_is_off(self):
        calm, _ = self.search(FakeMotor())
        wild, motor = self.search(FakeMotor(faults_below=0.001))
        self.assertGreater(motor.starts, 1)
        self.assertEqual(calm.entries()[:10], wild.entries()[:10])
        self.assertEqual(motor.values["FW_TRIM_CURRENT_A"], 0.0)


def tables(**changes: object) -> Tables:
    made = Tables(HURST, 2650.0, [Entry(-0.1 * i, 7956.0 + 10 * (i > 3), 0.5 - 0.01 * (i > 5)) for i in range(ENTRIES)],
                  {name: PARAMS[name] for name in fw_tables.FINGERPRINT}, 7956.0, 15, 'a "reason" \\ here', 6090.0,
                  {"torque_share": 0.2}, [{"speed_rpm": 2650.0, "torque_nm": 0.05}])
    return replace(made, **changes)


class TablesFile(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory()))
        self.path = self.folder / f"{HURST}.toml"

    def test_what_is_written_is_read(self):
        fw_tables.write(self.path, tables())
        read = fw_tables.load(self.path)
        self.assertEqual([(round(x.idref_a, 2), x.inv_kfi, x.ls_ratio) for x in read.entries], [(round(x.idref_a, 2), x.inv_kfi, x.ls_ratio) for x in tables().entries])
        self.assertEqual((read.stopped, read.last_index, read.maximum_speed_rpm), ('a "reason" \\ here', 15, 6090.0))
        self.assertEqual(read.mismatch(PARAMS), "")
        self.assertEqual(read.rows, tables().rows)

    def test_tables_of_another_motor_value_are_not_used_and_the_line_says_which(self):
        """The rounding of single precision is no difference, no file no complaint."""
        fw_tables.write(self.path, tables())
        found, reason = fw_tables.load_for(HURST, {name: value * 1.0000001 for name, value in PARAMS.items()}, self.folder)
        self.assertEqual((found is None, reason), (False, ""))
        self.assertEqual(fw_tables.load_for("nobody", PARAMS, self.folder), (None, ""))
        for name in fw_tables.FINGERPRINT:
            found, reason = fw_tables.load_for(HURST, {**PARAMS, name: PARAMS[name] * 1.01}, self.folder)
            self.assertIsNone(found)
            self.assertIn(name, reason)
            self.assertIn(f"make tune-fw MOTOR={HURST}", reason)
            self.assertNotIn("\n", reason)

    def test_damaged_files_have_their_line(self):
        good = fw_tables.text(tables())
        for wrong, word in ((good.replace("idref_a = [0.00, ", "idref_a = ["), "17 values"), (good.replace("[fingerprint]", "[finger]"), "finger"),
                            (good.replace("idref_a = [0.00", "idref_a = [0.50"), "impossible"), (good.replace("MOTOR_RS_OHM", "MOTOR_OHM"), "MOTOR_"),
                            (good[:good.index("idref_a") + 14], "TOML syntax")):
            self.path.write_text(wrong, encoding="utf-8")
            with self.assertRaises(UserError) as caught:
                fw_tables.load(self.path)
            self.assertIn(word, str(caught.exception))

    def test_an_interrupted_write_leaves_the_old_file(self):
        self.path.write_text("old", encoding="utf-8")
        with mock.patch.object(Path, "replace", side_effect=KeyboardInterrupt), self.assertRaises(KeyboardInterrupt):
            fw_tables.write(self.path, tables())
        self.assertEqual([file.name for file in self.folder.iterdir()], [self.path.name])
        self.assertEqual(self.path.read_text(encoding="utf-8"), "old")

    def test_a_place_that_cannot_be_written_is_refused_before_the_search(self):
        self.path.write_text("", encoding="utf-8")
        self.path.with_name("folder.toml").mkdir()
        with mock.patch.object(fw_tune, "_Work", side_effect=AssertionError("the search began")):
            for place, reason in ((self.path / "tables" / "a.toml", "(Not a directory)"), (self.path.with_name("folder.toml"), "(Is a directory)")):
                code, out, error = command("tune-fw", HURST, "--tables", str(place), "--out", str(self.folder / "out"), "--quiet")
                self.assertEqual((code, out, error), (2, "", f"foc33: cannot write the tables {reason}, {place}: make the folder writable\n"))
            with self.assertRaisesRegex(AssertionError, "the search began"):
                command("tune-fw", HURST, "--tables", str(self.path), "--out", str(self.folder / "out"), "--quiet")
        self.assertEqual(sorted(file.name for file in self.folder.iterdir()), sorted([self.path.name, "folder.toml"]))

    def test_header_names_keep_the_base_value_by_name(self):
        values = tables().parameters()
        self.assertEqual((values["INVKFI_SPEED3"], values["INVKFI_SPEED4"]), ("NORM_INVKFIBASE", "7966"))
        self.assertEqual((values["IDREF_SPEED0"], values["IDREF_SPEED17"]), ("0.00", "-1.70"))
        self.assertEqual(len(values), 3 * ENTRIES + 1)


class Header(unittest.TestCase):
    def test_values_change_and_comments_stay(self):
        text = fw_tune.with_values(HEADER, {"FW_START_SPEED_RPM": "2345", "IDREF_SPEED1": "-0.77"})
        known = fw_tune.defines(text)
        self.assertEqual((known["FW_START_SPEED_RPM"], known["IDREF_SPEED1"]), (2345.0, -0.77))
        self.assertEqual(known["IDREF_SPEED10"], fw_tune.defines(HEADER)["IDREF_SPEED10"])
        self.assertEqual(text.count("/*"), HEADER.count("/*"))
        with self.assertRaisesRegex(UserError, "NO_SUCH_NAME"):
            fw_tune.with_values(HEADER, {"NO_SUCH_NAME": "1"})

    def test_numbers_are_read(self):
        known = fw_tune.defines("#define A 1.5 /* x */\n  # define B 0xF\n#define C (-2)\n#define D OTHER\n/* #define E 3 */\n")
        self.assertEqual(known, {"A": 1.5, "B": 15.0, "C": -2.0})

    def test_highest_speed_is_where_the_format_of_speeds_or_of_the_back_emf_ends(self):
        known = fw_tune.defines(HEADER)
        self.assertEqual(fw_tune.highest_speed(known), 6400.0)
        self.assertLess(fw_tune.highest_speed({**known, "OVER_CURRENT_THRESHOLD_A": 3.81, "MOTOR_LS_MH": 2.2}), 6400.0)

    def test_a_header_s_own_table_is_interpolated_as_the_firmware_does(self):
        known = {"FW_START_SPEED_RPM": 2600.0, "NOPOLESPAIRS": 5.0, **{f"IDREF_SPEED{i}": -0.1 * i for i in range(ENTRIES)}}
        for rpm, wanted in ((2000.0, 0.0), (2600.0 + 2.5 * 204.8, -0.25), (9000.0, -1.7)):
            self.assertAlmostEqual(fw_tune.table_current(known, rpm), wanted)


# ---- on the virtual board ------------------------------------------------------------------------------------------------------
def values(**changes: float) -> dict[str, float]:
    """The Hurst on its board, as keys of the virtual board."""
    library = Library(build.library(["PARAMS_IN_RAM"]))
    layers = [motor_file.load(HURST).plant_values(), board_file.load("mclv").plant_values()]
    return {**board_keys.resolve(layers, library.keys), **{key.replace("__", "."): value for key, value in changes.items()}}


def bench_work(work):
    """work(bench) in a process of its own: the firmware is one set of globals."""
    def run(job, tell):
        bench = Bench(job, values(), tell)
        try:
            return work(bench)
        finally:
            bench.close()
    return run


def on_board(work, defines=("PARAMS_IN_RAM",)):
    from tools.common import workers
    return workers.run_all([build.library(list(defines))], bench_work(work), lambda seconds: None)[0]


def refused(bench, name: str, value: float) -> str:
    try:
        bench.set(name, value)
    except BoardError as error:
        return str(error)
    return ""


class LiveParameters(unittest.TestCase):
    def test_a_table_entry_changes_the_running_motor(self):
        def work(bench):
            bench.start()
            bench.speed(3500.0)
            before = bench.point()
            for i in range(ENTRIES):
                bench.set(f"IDREF_SPEED{i}", -1.6)
            bench.run(0.05)
            after = bench.point()
            for i in range(ENTRIES):
                bench.set(f"INVKFI_SPEED{i}", 1.1 * bench.params["INVKFI_SPEED0"])
            bench.run(0.1)
            return before, after, bench.point(), bench.board.parameter("IDREF_SPEED7")
        before, after, turned, read = on_board(work)
        self.assertGreater(before.id_a, -1.2)
        self.assertAlmostEqual(after.id_a, -1.6, delta=0.05)
        self.assertAlmostEqual(turned.angle_deg - after.angle_deg, 5.0, delta=1.5) # the law cos d + sin d = K'/K
        self.assertAlmostEqual(read, -1.6, delta=0.001)

    def test_ls_and_the_start_speed_change_too(self):
        def work(bench):
            bench.start()
            bench.speed(3500.0)
            ratio, index = bench.board.get("fw.ls_ratio"), bench.board.get("fw.fw_index")
            for i in range(ENTRIES):
                bench.set(f"LS_OVER2LS0_SPEED{i}", 0.4)
            bench.set("FW_START_SPEED_RPM", 3400.0)
            bench.run(0.05)
            return ratio, index, bench.board.get("fw.ls_ratio"), bench.board.get("fw.fw_index")
        ratio, index, changed, later = on_board(work)
        self.assertAlmostEqual(ratio, 0.5, delta=0.001)
        self.assertAlmostEqual(changed, 0.4, delta=0.001)
        self.assertGreater(index, 2)
        self.assertEqual(later, 0)

    def test_the_trim_can_be_switched_off(self):
        def work(bench):
            bench.set("FW_TRIM_CURRENT_A", 0.0)
            for i in range(ENTRIES):
                bench.set(f"IDREF_SPEED{i}", 0.0)
            bench.start()
            bench.speed(3500.0)
            return bench.point()
        point = on_board(work)
        self.assertEqual(point.trim_a, 0.0)
        self.assertLess(point.speed_rpm, 3450.0)

    def test_values_outside_their_range_and_unknown_names_are_refused(self):
        def work(bench):
            return [refused(bench, name, value) for name, value in
                    (("IDREF_SPEED3", 0.5), ("INVKFI_SPEED0", 100.0), ("LS_OVER2LS0_SPEED17", 0.7), ("IDREF_SPEED18", -1.0),
                     ("IDREF_SPEED", -1.0), ("IDREF_SPEED1x", -1.0), ("MOTOR_RS_OHM", 2.0), ("FW_TRIM_CURRENT_A", math.nan))]
        answers = on_board(work)
        self.assertTrue(all(answers), answers)
        self.assertIn("range", answers[0])
        self.assertIn("cannot change", answers[3])

    def test_every_entry_of_every_table_can_be_written_and_read(self):
        def work(bench):
            result = []
            for stem, first, step in (("IDREF_SPEED", -0.05, -0.1), ("INVKFI_SPEED", 5000.0, 7.0), ("LS_OVER2LS0_SPEED", 0.2, 0.01)):
                for i in range(ENTRIES):
                    bench.set(f"{stem}{i}", first + i * step)
                result += [bench.board.parameter(f"{stem}{i}") - first - i * step for i in range(ENTRIES)]
            return result
        self.assertLess(max(map(abs, on_board(work))), 0.001)

    def test_only_builds_with_parameters_in_ram_change_them(self):
        self.assertIn("PARAMS_IN_RAM", on_board(lambda bench: refused(bench, "IDREF_SPEED3", -0.5), ()))
        self.assertEqual(on_board(lambda bench: refused(bench, "IDREF_SPEED3", -0.5), ("TUNING",)), "")


if __name__ == "__main__":
    unittest.main()
