"""Identification on the virtual board: every motor within its limits, and what happens when something is wrong with motor, wires or shaft."""

import unittest

from tools.bench import build
from tools.common import board_keys, motor_file, paths, workers
from tuning import identify, identify_result

HURST = "hurst_dmb0224c10002"


def run(name: str = HURST, **changes: float) -> identify_result.Identified:
    """One identification with changes to the plant; dots of keys are written as "__"."""
    values = board_keys.Values({key.replace("__", "."): value for key, value in changes.items()}, {})
    return identify.identify([motor_file.load(name)], "mclv", values)[0]


def made_up(rs_ohm: float, ld_h: float, lq_h: float, kphi: float, current_a: float, speed_rpm: float, **changes: float) -> identify_result.Identified:
    """Another motor in the Hurst's housing: 5 pole pairs."""
    psi_vs = kphi / (3.0 ** 0.5 * 1000.0 * 2.0 * 3.14159265 / 60.0 * 5.0)
    values = {"motor.rs_ohm": rs_ohm, "motor.ld_h": ld_h, "motor.lq_h": lq_h, "motor.psi_vs": psi_vs, "mech.coulomb_nm": 0.001} | changes
    return identify.identify([motor_file.load(HURST)], "mclv", board_keys.Values(values, {}), current_a, speed_rpm)[0]


class Motors(unittest.TestCase):
    def test_every_motor_is_within_its_limits(self):
        names = paths.names(paths.MOTORS)
        self.assertGreaterEqual(len(names), 6)
        for item in identify.identify([motor_file.load(name) for name in names], "mclv", board_keys.Values()):
            with self.subTest(item.motor.name):
                self.assertEqual(item.problems(), [])

    def test_the_corners_of_the_range(self):
        for name, motor in (("low R, long time constant", (0.1, 1e-3, 1e-3, 5.0, 3.0, 1000.0)),
                            ("low R and L, little flux", (0.1, 5e-5, 5e-5, 1.0, 3.0, 2000.0)),
                            ("high R and L, much flux", (20.0, 20e-3, 20e-3, 60.0, 0.4, 120.0)),
                            ("time constant of two periods", (0.5, 5e-5, 5e-5, 3.0, 2.0, 1500.0)),
                            ("Lq twice Ld", (2.0, 1e-3, 2e-3, 8.0, 1.0, 800.0)),
                            ("small current", (2.67, 1.92e-3, 1.92e-3, 7.24, 0.3, 1000.0))):
            with self.subTest(name):
                self.assertEqual(made_up(*motor).problems(), [])

    def test_rotor_anywhere_heavy_light_or_without_friction(self):
        for changes in ({"state__theta_e_deg": 0.0}, {"state__theta_e_deg": 120.0}, {"state__theta_e_deg": 240.0},
                        {"mech__inertia_kgm2": 5.5e-5}, {"mech__inertia_kgm2": 2e-6}, {"mech__coulomb_nm": 0.0, "mech__viscous_nms": 0.0},
                        {"load__constant_nm": 0.02}):
            with self.subTest(**changes):
                self.assertEqual(run(**changes).problems(), [])

    def test_noise_supply_and_bridge_do_not_matter(self):
        for changes in ({"adc__noise_lsb": 2.0}, {"adc__noise_lsb": 0.0}, {"supply__voltage_v": 20.0}, {"supply__resistance_ohm": 1.0},
                        {"inverter__diode_v": 1.2, "inverter__turn_off_s": 4e-7}, {"shunt__offset_a_v": 0.05}):
            with self.subTest(**changes):
                self.assertEqual(run(**changes).problems(), [])

    def test_a_hot_motor_is_measured_hot(self):
        item = run(motor__temp_c=75.0)
        self.assertEqual(item.problems(), [])
        self.assertGreater(item.winding_ohm, 3.1)


class Troubles(unittest.TestCase):
    def assert_ends(self, item: identify_result.Identified, result: str) -> None:
        self.assertEqual((item.result.name, item.measured.fault), (result, "NONE"))
        self.assertEqual(item.measured.outputs_seen, 0.0)

    def test_blocked_shaft(self):
        item = run(load__locked=1.0)
        self.assert_ends(item, "NOT_TURNING")
        self.assertAlmostEqual(item.winding_ohm, 2.67, delta=0.03)
        self.assertEqual(item.measured.watch["Kphi_mV_per_krpm"], 0)

    def test_blocked_shaft_of_a_salient_motor_in_any_position(self):
        for angle in (0.0, 45.0, 90.0, 200.0):
            self.assert_ends(run("linix_45zwn24_40", load__locked=1.0, state__theta_e_deg=angle), "NOT_TURNING")

    def test_each_open_phase(self):
        for phase in (1.0, 2.0, 3.0):
            self.assert_ends(run(fault__open_phase=phase), "NO_CURRENT")

    def test_load_beyond_the_current(self):
        self.assert_ends(run(load__constant_nm=0.2), "NOT_TURNING")

    def test_too_much_resistance_too_much_inductance_too_much_flux(self):
        self.assert_ends(made_up(20.0, 1e-2, 1e-2, 7.24, 1.5, 1000.0), "CURRENT_NOT_REACHED")
        self.assert_ends(made_up(5.0, 0.4, 0.4, 7.24, 1.0, 1000.0), "L_RANGE")
        self.assert_ends(made_up(2.67, 1.92e-3, 1.92e-3, 30.0, 1.0, 1000.0), "VOLTAGE_LIMIT")

    def test_S2_in_every_step_stops_within_its_debouncing(self):
        undisturbed = run()
        began_s = undisturbed.measured.steps[0][0]
        spans = list(zip(undisturbed.measured.steps[1:], undisturbed.measured.steps[2:]))
        presses = [0.5 * (at_s + until_s) - began_s for (at_s, _), (until_s, _) in spans]
        library = paths.ROOT / "build" / f"host-{build.variant_name([identify_result.MODE], identify.HEADERS / HURST)}" / "libvboard.so"
        jobs = [identify.Job(library, undisturbed.values, stop_after_s=at_s) for at_s in presses]
        for at_s, (step, _), measured in zip(presses, spans, workers.run_all(jobs, identify.measure, lambda seconds: None)):
            with self.subTest(identify_result.step_names()[step[1]]):
                self.assertEqual(identify_result.results()[measured.watch["result"]].name, "STOPPED")
                self.assertEqual((measured.fault, measured.outputs_seen), ("NONE", 0.0))
                self.assertIn(step[1], [number for _, number in measured.steps])
                self.assertLess(measured.steps[-1][0] - began_s - at_s, 0.035)
