"""The start's rules: enough torque, enough back-EMF, a lock long enough, and a rotor that follows."""

import math
import re
import unittest
from dataclasses import replace

from tools.common import board_file, motor_file, paths
from tune_support import HURST, designed, motors, of
from tuning import start

BOARD = board_file.load("mclv")


class Rules(unittest.TestCase):
    def setUp(self) -> None:
        self.motor = motor_file.load(HURST)

    def test_the_note_s_motor_gets_the_note_s_start(self):
        d = of(HURST)
        self.assertEqual([d.params[name] for name in ("Q_CURRENT_REF_OPENLOOP", "END_SPEED_RPM", "LOCK_TIME", "OPENLOOP_RAMPSPEED_INCREASERATE", "MINIMUM_SPEED_RPM")],
                         ["1.41", "1000", "4000", "10", "500"])

    def test_current_carries_the_load_at_50_degrees(self):
        load = 0.1
        motor = replace(self.motor, start_torque_nm=load)
        needed = start.needed_torque(motor, 1000.0)
        current = start.start_current(motor, 10.0, 14.0, needed)
        self.assertAlmostEqual(motor.kt_nm_per_a * current * 0.77, load + 0.004 + 15.3e-6 * 1000 * math.pi / 30, delta=3e-4)

    def test_current_leaves_room_to_the_trip_level_for_a_rotor_that_swings_into_the_lock(self):
        motor = replace(self.motor, rated_current_a=3.4)
        self.assertAlmostEqual(start.start_current(motor, 3.4, 3.8, 0.05), 3.8 / 1.3, delta=0.005)
        for name in motors():
            with self.subTest(name):
                self.assertLessEqual(1.29 * of(name).start_up.current_a, of(name).value("OVER_CURRENT_THRESHOLD_A"))

    def test_current_for_a_load_may_use_that_room(self):
        motor = replace(self.motor, rated_current_a=3.4)
        needed = 3.1 * motor.kt_nm_per_a * 0.77
        self.assertAlmostEqual(start.start_current(motor, 3.4, 3.8, needed), 3.1, delta=0.005)

    def test_current_stays_below_the_largest(self):
        self.assertLess(start.start_current(self.motor, 0.9, 1.3, 0.5), 0.9)

    def test_the_back_emf_at_the_hand_over_is_three_times_its_error(self):
        for name in motors():
            with self.subTest(name):
                s = of(name).start_up
                self.assertGreaterEqual(s.emf_v * start.HAND_OVER_SINE, 0.999 * s.error_v)

    def test_the_error_of_the_back_emf(self):
        dead_v = 4 / math.pi * 24 * 2e-6 / 50e-6
        self.assertAlmostEqual(start.emf_error_v(self.motor, BOARD, 2.0), 0.3 * 2.67 * 2.0 + 0.2 * dead_v + 2.67 * 8.8 / 1024, delta=1e-9)

    def test_minimum_speed_is_at_most_a_fifth_of_rated_speed(self):
        for name in motors():
            d = of(name)
            self.assertLessEqual(d.value("MINIMUM_SPEED_RPM"), 0.2 * d.motor.rated_speed_rpm, name)
            self.assertLessEqual(d.value("MINIMUM_SPEED_RPM"), d.value("END_SPEED_RPM"), name)
        self.assertEqual(start.minimum_speed(self.motor, 2000.0), 560.0)
        self.assertEqual(start.minimum_speed(self.motor, 300.0), 300.0)

    def test_the_swing_of_the_locked_rotor(self):
        self.assertAlmostEqual(start.natural_rad_s(self.motor, 1.41, 5.5e-6), math.sqrt(5 * 0.0598743 * 1.41 / 5.5e-6), delta=0.1)

    def test_more_inertia_means_a_longer_lock_and_a_slower_ramp(self):
        light, heavy = designed(), designed(more='[load]\ninertia = { value = 4e-4, unit = "kg m2" }\n')
        self.assertGreater(heavy.value("LOCK_TIME"), 2.0 * light.value("LOCK_TIME"))
        self.assertLess(heavy.start_up.acceleration_rpm_s, light.start_up.acceleration_rpm_s)
        torque = 4.055e-4 * heavy.start_up.acceleration_rpm_s * math.pi / 30
        self.assertLess(torque, 0.2 * heavy.start_up.pull_out_nm)

    def test_the_end_speed_follows_the_resistance(self):
        low = start.end_speed(replace(self.motor, rs_ohm=0.5), BOARD, 1.41, 2800.0)
        self.assertLess(low, start.end_speed(self.motor, BOARD, 1.41, 2800.0))

    def test_ramp_takes_as_long_as_the_rate_says(self):
        s = of(HURST).start_up
        self.assertAlmostEqual(s.acceleration_rpm_s, 10 / 1024 / 65536 / 50e-6 ** 2 * 60 / 5, delta=1e-6)
        self.assertAlmostEqual(s.ramp_s, 1000 / s.acceleration_rpm_s, delta=1e-9)


class Trials(unittest.TestCase):
    def setUp(self) -> None:
        self.motor = motor_file.load(HURST)

    def trial(self, current_a: float, load_nm: float, acceleration: float = 715.0, inertia: float = 5.5e-6) -> start.Trial:
        return start.try_start(replace(self.motor, start_torque_nm=load_nm), inertia, 4e-5, current_a, 0.3, acceleration, 1000.0, angles=12)

    def test_every_motor_follows_its_ramp_from_every_angle(self):
        for name in motors():
            s = of(name).start_up
            self.assertTrue(s.follows, name)
            self.assertEqual(len(s.trial.labels), 48)

    def test_a_load_within_the_pull_out_torque_is_followed_and_one_beyond_is_not(self):
        pull = self.motor.kt_nm_per_a * 1.41
        self.assertTrue(self.trial(1.41, 0.8 * pull).followed.all())
        loaded = self.trial(1.41, 1.05 * pull).followed
        self.assertTrue(loaded[:12].all())
        self.assertFalse(loaded[12:].any())

    def test_a_ramp_faster_than_the_torque_allows_is_lost(self):
        fastest = self.motor.kt_nm_per_a * 1.41 / 4e-4 * 30 / math.pi
        self.assertTrue(self.trial(1.41, 0.0, 0.1 * fastest, 4e-4).followed.all())
        self.assertFalse(self.trial(1.41, 0.0, 1.5 * fastest, 4e-4).followed.any())

    def test_a_motor_that_cannot_follow_is_warned_about(self):
        d = designed(more="[tune]\nQ_CURRENT_REF_OPENLOOP = 0.1\n")
        self.assertTrue(any("may not follow the ramp" in warning for warning in d.warnings), d.warnings)

    def test_the_rotor_that_begins_against_the_current_swings_most_as_on_the_virtual_board(self):
        """The current begins on phase A, so that is the rotor at 180 degrees, as `make starts` counts them."""
        trial = self.trial(1.41, 0.0)
        early = abs(trial.speed_rpm[trial.time_s < 0.06, :12]).max(axis=0)
        self.assertIn(trial.labels[int(early.argmax())], ("150 deg, 0 N m", "180 deg, 0 N m", "210 deg, 0 N m"))
        self.assertEqual(trial.labels[int(early.argmin())], "0 deg, 0 N m")

    def test_what_is_left_of_the_lock_s_swing_is_measured_on_the_plateau(self):
        free = replace(self.motor, coulomb_nm=0.0, viscous_nms=0.0, start_torque_nm=0.0)
        endless = start.try_start(free, 5.5e-6, 1e-5, 1.41, 0.2, 715.0, 1000.0, angles=12)
        self.assertTrue(endless.followed.all())
        self.assertGreater(endless.swing_rpm, 200.0)
        self.assertLess(self.trial(1.41, 0.0).swing_rpm, 10.0)

    def test_the_lock_is_lengthened_until_the_rotor_is_calm_at_the_hand_over(self):
        for name in motors():
            with self.subTest(name):
                s = of(name).start_up
                self.assertLessEqual(s.trial.swing_rpm, start.CALM_SHARE * s.end_speed_rpm)
        bare = designed(("coulomb_friction = { value = 0.004", "coulomb_friction = { value = 0.0")).start_up
        self.assertGreater(bare.lock_s, 1.4 * designed().start_up.lock_s)
        self.assertLessEqual(bare.trial.swing_rpm, start.CALM_SHARE * bare.end_speed_rpm)

    def test_the_sample_s_delay_is_the_board_s(self):
        text = (paths.ROOT / "include" / "board" / "mclv.h").read_text(encoding="utf-8")
        clocks = int(re.search(r"BOARD_SAMPLE_DELAY_CLOCKS (\d+)u", text)[1])
        self.assertAlmostEqual(clocks / 40e6, start.SAMPLE_AFTER_MEAN_S)

    def test_a_small_inductance_lets_the_swing_grow_and_is_warned_about(self):
        """On the virtual board 24 of 72 starts of this motor succeed; with 0.15 mH all."""
        changes = (("pole_pairs = { value = 5", "pole_pairs = { value = 1"), ("value = 2.67", "value = 1.5"),
                   ("value = 7.24", "value = 2.084"), ("value = 5.5e-6", "value = 5e-7"), ("value = 15.3e-6", "value = 1e-9"), ("value = 0.004", "value = 0.001"),
                   ("value = 1.53", "value = 1.32"), ("value = 0.08", "value = 0.022"), ("speed = { value = 2500", "speed = { value = 8000"),
                   ("value = 5000", "value = 10000"), ("value = 2.75", "value = 1.98"))
        small = designed(*changes, ("value = 1.92", "value = 0.1"))
        self.assertLess(small.start_up.damping, 0.0)
        self.assertTrue(any("put chokes into the motor's leads" in warning for warning in small.warnings), small.warnings)
        large = designed(*changes, ("value = 1.92", "value = 0.5"))
        self.assertFalse(any("chokes" in warning or "swings" in warning for warning in large.warnings), large.warnings)

    def test_a_heavy_rotor_without_friction_that_may_not_follow_gets_the_same_line(self):
        changes = (("viscous_friction = { value = 15.3e-6", "viscous_friction = { value = 1e-9"), ("coulomb_friction = { value = 0.004", "coulomb_friction = { value = 0.0"),
                   ("value = 5.5e-6", "value = 6e-5"))
        (line,) = [warning for warning in designed(*changes).warnings if "may not follow" in warning]
        self.assertRegex(line, r"0 N m\): add \[mechanical\] coulomb_friction")

    def test_a_rotor_without_friction_is_warned_about_with_the_line_to_add(self):
        d = designed(("viscous_friction = { value = 15.3e-6", "viscous_friction = { value = 1e-9"),
                     ("coulomb_friction = { value = 0.004", "coulomb_friction = { value = 0.0"))
        (line,) = [warning for warning in d.warnings if "still swings" in warning]
        self.assertRegex(line, r"swings by \d+ rpm when the estimator takes over at \d+ rpm.*: add \[mechanical\] coulomb_friction")
