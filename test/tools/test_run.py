"""What is read from a trace: measures, hand-over, changes; checked on signals whose values are known."""

import unittest

import numpy as np
from support import PERIOD_S, run, step, trace

from tools.bench.metrics import MEASURE_VALUES, Measure, measure_values
from tools.common.trace import wrapped_deg

ROW = Measure("row", 0.5, 1.5, 1000.0)


def values(**signals):
    return measure_values(trace(pwm__outputs_seen=63, **signals).part(ROW.from_s, ROW.to_s), ROW)


class Measures(unittest.TestCase):
    def test_every_value_is_described(self):
        self.assertEqual(set(values()), set(MEASURE_VALUES))

    def test_mean_speed_counts_only_the_window(self):
        found = values(plant__speed_rpm=step((0, 5), (0.5, 990), (1.0, 1000), (1.5, 7)))
        self.assertAlmostEqual(found["speed_rpm"], 995, delta=0.1)
        self.assertAlmostEqual(found["speed_error_percent"], -0.5, delta=0.01)
        self.assertEqual((found["speed_min_rpm"], found["speed_max_rpm"]), (990, 1000))

    def test_backward_speed_that_is_too_fast_is_a_positive_error(self):
        found = measure_values(trace(plant__speed_rpm=-1010), Measure("row", 0.0, 2.0, -1000.0))
        self.assertAlmostEqual(found["speed_error_percent"], 1.0)

    def test_phase_current_is_the_rms_of_the_vector(self):
        self.assertAlmostEqual(values(plant__i_d=-3, plant__i_q=4)["current_rms_a"], 5 / 2 ** 0.5, places=5)

    def test_angle_error_is_estimated_less_true_across_the_turn(self):
        found = values(fw__theta_est_deg=1.0, plant__theta_e_deg=359.0)
        self.assertAlmostEqual(found["angle_error_mean_deg"], 2.0, places=3)
        self.assertAlmostEqual(found["angle_error_rms_deg"], 2.0, places=3)

    def test_angle_error_rms_includes_what_the_mean_hides(self):
        found = values(fw__theta_est_deg=lambda t: np.where(np.arange(len(t)) % 2, 10.0, 350.0))
        self.assertAlmostEqual(found["angle_error_mean_deg"], 0.0, places=3)
        self.assertAlmostEqual(found["angle_error_rms_deg"], 10.0, places=3)

    def test_voltage_used_and_time_at_the_limit(self):
        found = values(fw__v_d_v=-3, fw__v_q_v=4, fw__v_limit_v=step((0, 10), (1.0, 5)))
        self.assertAlmostEqual(found["voltage_v"], 5.0)
        self.assertAlmostEqual(found["voltage_percent"], 75.0, delta=0.1)
        self.assertAlmostEqual(found["voltage_at_limit_percent"], 50.0, delta=0.1)

    def test_current_at_its_limit_counts_both_signs(self):
        found = values(fw__iq_ref_a=step((0, 2), (0.75, -2), (1.0, 1.9)), fw__iq_limit_a=2)
        self.assertAlmostEqual(found["current_at_limit_percent"], 50.0, delta=0.1)

    def test_a_bridge_that_is_off_has_no_estimate(self):
        found = measure_values(trace(fw__speed_est_rpm=1000), ROW)
        self.assertEqual((found["estimated_rpm"], found["angle_error_rms_deg"], found["voltage_v"]), (None, None, None))
        self.assertEqual(found["speed_rpm"], 0.0)

    def test_an_empty_window_has_no_values(self):
        self.assertEqual(set(measure_values(trace(0.1).part(1.0, 1.5), ROW).values()), {None})


class Runs(unittest.TestCase):
    def test_current_is_compared_with_the_header_s_maximum_by_its_amplitude(self):
        item = run("[[measure]]\nname = \"row\"\nfrom_s = 0.5\nto_s = 1.0\n", plant__i_d=-0.6, plant__i_q=0.8)
        self.assertIsNone(item.measures["row"]["current_of_maximum_percent"])
        item = run("[[measure]]\nname = \"row\"\nfrom_s = 0.5\nto_s = 1.0\n", plant__i_d=-0.6, plant__i_q=0.8)
        item.params["MAXIMUM_CURRENT_A"] = 2.0
        self.assertAlmostEqual(item.measures["row"]["current_of_maximum_percent"], 50.0, places=3)

    def test_hand_over_is_timed_from_the_last_s2_before_it(self):
        item = run("[[event]]\nat_s = 0.1\npress = \"S2\"\n[[event]]\nat_s = 0.5\npress = \"S2\"\n",
                   fw__state=step((0, 1), (0.6, 4), (0.8, 5)), fw__speed_ref_rpm=1000)
        self.assertEqual(len(item.hand_overs()), 1)
        self.assertAlmostEqual(item.hand_overs()[0].after_s2_s, 0.3, delta=2 * PERIOD_S)

    def test_overshoot_follows_a_ramped_reference(self):
        ramp = lambda t: 1000 + 500 * np.maximum(t - 0.8, 0) # noqa: E731
        item = run("[[event]]\nat_s = 0.1\npress = \"S2\"\n", fw__state=step((0, 4), (0.8, 5)), fw__speed_ref_rpm=ramp,
                   plant__speed_rpm=ramp)
        self.assertAlmostEqual(item.hand_overs()[0].overshoot_percent, 0.0, places=3)

    def test_overshoot_ends_with_closed_loop(self):
        item = run("[[event]]\nat_s = 0.1\npress = \"S2\"\n", fw__state=step((0, 4), (0.8, 5), (1.0, 7)), fw__speed_ref_rpm=1000,
                   plant__speed_rpm=step((0, 1000), (1.1, 1500)))
        self.assertAlmostEqual(item.hand_overs()[0].overshoot_percent, 0.0, places=3)

    def test_fault_and_state_changes_carry_names(self):
        item = run(fw__state=step((0, 1), (1.0, 7)), fw__fault=step((0, 0), (1.0, 3)))
        self.assertEqual([name for _, _, name in item.state_changes()], ["STOPPED", "FAULT"])
        self.assertEqual([name for _, _, name in item.fault_changes()], ["NONE", "OVERVOLTAGE"])

    def test_an_unknown_code_is_shown_as_a_number(self):
        self.assertEqual(run(fw__fault=99).fault_changes()[0][2], "code 99")

    def test_speed_factor_is_motor_time_per_wall_time(self):
        self.assertAlmostEqual(run().speed_factor, 20.0)


class Traces(unittest.TestCase):
    def test_a_part_includes_its_start_and_not_its_end(self):
        part = trace(1.0).part(0.1, 0.2)
        self.assertEqual(len(part), 2000)
        self.assertAlmostEqual(float(part.time_s[0]), 0.1)

    def test_thinning_keeps_every_nth_row(self):
        thin = trace(1.0, fw__i_q_a=lambda t: np.arange(len(t))).thinned(10)
        self.assertEqual(list(thin.column("fw.i_q_a")[:3]), [0, 10, 20])

    def test_angles_wrap_to_half_a_turn(self):
        self.assertTrue(np.allclose(wrapped_deg(np.array([350.0, -350.0, 90.0, 720.0])), [-10.0, 10.0, 90.0, 0.0]))
