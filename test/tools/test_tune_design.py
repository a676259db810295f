"""What the tuner refuses and warns about, by name and with a remedy; currents, speeds and field-weakening tables."""

import math
import re
import unittest
from dataclasses import replace

from tools.common import board_file, motor_file
from tools.common.errors import UserError
from tune_support import FOR_ANOTHER_BOARD, HURST, MOTOR, designed, motor_path, motors, of
from tuning import header, limits, report
from tuning.design import Design, design, plain, real, short
from tuning.limits import Envelope

BOARD = board_file.load("mclv")


def made(changes=(), more: str = "", board: dict | None = None, **other) -> Design:
    """The design of MOTOR with texts replaced, lines added, and numbers of the motor and the board replaced."""
    with motor_path(*changes, more=more) as path:
        return design(replace(motor_file.load(str(path)), **other), replace(BOARD, **(board or {})))


INERTIA = '[load]\ninertia = { value = %s, unit = "kg m2" }\n'
OTHER = FOR_ANOTHER_BOARD[:-3] + FOR_ANOTHER_BOARD[-2:]
"""FOR_ANOTHER_BOARD with the maximum_current that it was."""
SMALL = {"rs_ohm": 39.0, "rated_current_a": 0.05, "rated_torque_nm": 0.003, "rated_speed_rpm": 1000.0, "coulomb_nm": 0.0, "viscous_nms": 0.0,
         "start_torque_nm": 0.0}
MAXIMUM = next(line for line in MOTOR.splitlines() if line.startswith("maximum_current"))
REFUSED = {
    "rated speed beyond the speed format": ({"pole_pairs": 14}, ("electrical rpm", "32000", "a speed of 2285 rpm is possible", "a_motor.toml")),
    "voltage too low for the rated speed": (
        {"board": {"nominal_bus_v": 12.0, "under_voltage_v": 7.0}},
        ("12 V are too low for 2500 rpm at half the rated torque", "raise the supply voltage", "or lower the rated speed to")),
    "current beyond the board's range": ({"board": {"current_full_scale_a": 1.0}, "rated_torque_nm": 0.12, "rated_current_a": 2.2},
                                         ("half the rated torque needs", "larger current range than 1 A")),
    "torque beyond the board's current": (
        {"changes": FOR_ANOTHER_BOARD},
        ("3.45 A are allowed", "lower [rating] torque and current to what the board carries, 0.19 N m and 3.45 A peak")),
    "torque beyond maximum_current": ({"changes": (("value = 2.75", "value = 0.55"),)},
                                      ("0.55 A are allowed", "raise [rating] maximum_current to at least 0.802 A peak")),
    "largest current beyond its range, not given": (
        {"changes": (*OTHER, (MAXIMUM, "")), "board": {"current_full_scale_a": 60.0}},
        ("MAXIMUM_CURRENT_A = 23 is outside 0.1 .. 20", "add [rating] maximum_current and set it to 0.1 .. 20 A peak")),
    "largest current beyond its range, given": (
        {"changes": (*OTHER, ("value = 2.75", "value = 24")), "board": {"current_full_scale_a": 60.0}},
        ("MAXIMUM_CURRENT_A = 24 is outside", "change [rating] maximum_current to 0.1 .. 20 A peak")),
    "inertia beyond the speed gain's format": ({"more": INERTIA % "5e-3"}, ("speed gain exceeds its Q format with 0.00501 kg m2",)),
    "Kphi too large for its format": ({"pole_pairs": 1, "rated_speed_rpm": 500.0}, ("1/Kphi has only", "too slow for 24 V: use at least")),
    "Kphi too small for its format": ({"kphi_v_per_krpm": 1.2, "rated_speed_rpm": 2000.0}, ("1/Kphi does not fit", "too fast for 24 V: use at most")),
    "resistance too large for its exponent": ({**SMALL, "board": {"current_full_scale_a": 8.0}}, ("MOTOR_RS_OHM", "smaller current range")),
    "motor too small for the board": ({"maximum_current_a": 0.2, "rated_current_a": 0.13, "rated_torque_nm": 0.007},
                                      ("MAXIMUM_CURRENT_A must be at least 6.3 %",)),
    "choice in [tune] that breaks a relation": ({"more": "[tune]\nEND_SPEED_RPM = 2700\n"},
                                                ("[tune]", "END_SPEED_RPM must be at most NOMINAL_SPEED_RPM"))}
WARNED = {
    "rounding over a tenth of a percent": ({"rs_ohm": 0.0233}, ("MOTOR_RS_OHM = 0.0233 is rounded by", "larger current range")),
    "rated torque that the voltage does not allow": ({"changes": (("value = 2500", "value = 2800"),)}, ("too low for the rated torque at rated speed",)),
    "maximum current beyond the board": ({"maximum_current_a": 4.2},
                                         ("maximum_current 4.2 A peak is above what this board can measure", "MAXIMUM_CURRENT_A is 3.45")),
    "rated current beyond the board": ({"rated_current_a": 3.6, "maximum_current_a": 3.4}, ("rated current 3.6 A peak is above MAXIMUM_CURRENT_A",)),
    "maximum speed beyond field weakening": ({"changes": (("value = 5000", "value = 6300"),)}, ("maximum_speed 6300 rpm is not reachable",)),
    "maximum speed beyond the speed format": (
        {"changes": (("value = 5000", "value = 9000"),), "ld_h": 6e-3, "lq_h": 6e-3, "maximum_current_a": 3.4},
        ("maximum_speed 9000 rpm is not reachable", "32000 electrical rpm")),
    "rated speed that only S3 reaches": (
        {"changes": (("value = 2500", "value = 2000"),), "pole_pairs": 14, "psi_vs": 7.983e-3 * 5 / 14, "ld_h": 3e-4, "lq_h": 3e-4},
        ("use S3 for the rest",)),
    "inductance measured far from the motor's frequency": ({"changes": (("frequency_hz = 1000", "frequency_hz = 10000"),)},
                                                           ("was measured at 10000 Hz, the motor turns at 208 Hz",)),
    "heavy load's slow speed loop": (
        {"more": '[load]\ninertia = { value = 12000, unit = "g cm2" }\n'},
        ("the speed loop's", "are slow with so much inertia (0.73 Hz would hold", "or lower the load's inertia$")),
    "quick rotor's slow speed loop": ({"changes": (("value = 5.5e-6", "value = 1.0e-6"),), "more": "[tune]\nKFILTER_VELESTIM = 748\n"},
                                      ("slow for so quick a rotor", "or add inertia$")),
    "speed loop that is slow by choice": ({"more": "[tune]\nSPEED_BANDWIDTH_HZ = 4\n"},
                                          ("the speed loop's 4 Hz are slow (", "or remove SPEED_BANDWIDTH_HZ from [tune]$")),
    "reference slope that the counts cannot express": ({"more": "[tune]\nSPEEDREFRAMP_RPM_PER_S = 700\n"},
                                                       ("SPEEDREFRAMP_RPM_PER_S = 700 becomes 1000 rpm/s",)),
    "derivative limit that clips": (
        {"pole_pairs": 9, "psi_vs": 7.983e-3 * 5 / 9, "ld_h": 3e-4, "lq_h": 3e-4, "maximum_speed_rpm": 2600.0, "board": {"pwm_period_s": 125e-6}},
        ("D_ILIMIT_LS ends at",))}


class Messages(unittest.TestCase):
    def test_what_cannot_work_is_refused_in_one_line_with_a_remedy(self):
        for label, (motor, says) in REFUSED.items():
            with self.subTest(label), self.assertRaises(UserError) as caught:
                made(**motor)
            self.assertNotIn("\n", str(caught.exception))
            self.assertEqual([words for words in says if words not in str(caught.exception)], [], str(caught.exception))

    def test_what_works_with_a_cost_is_warned_about(self):
        for label, (motor, says) in WARNED.items():
            with self.subTest(label):
                warnings = made(**motor).warnings
                self.assertTrue(any(all(words in f"{warning}$" for words in says) for warning in warnings), warnings)
        self.assertEqual(designed(("value = 0.08", "value = 0.06"), ("value = 2500", "value = 2000"), ("value = 1.53", "value = 1.2")).warnings, [])

    def test_the_limit_that_a_refusal_names_works(self):
        lowered = dict(FOR_ANOTHER_BOARD) | {"value = 1.53": "value = 3.45", "value = 0.08": "value = 0.19"}
        self.assertEqual(designed(*lowered.items()).value("MAXIMUM_CURRENT_A"), 3.45)
        self.assertEqual(designed(("value = 2.75", "value = 0.802"), ("value = 2500", "value = 2300")).value("MAXIMUM_CURRENT_A"), 0.802)
        with self.assertRaises(UserError) as caught:
            made(more=INERTIA % "5e-3")
        largest = float(re.search(r": (\S+) kg m2 of rotor and load are possible", str(caught.exception))[1])
        self.assertGreaterEqual(designed(more=INERTIA % (largest - 5.5e-6)).value("SPEED_BANDWIDTH_HZ"), 0.2)

    def test_an_unstable_loop_is_called_so_and_has_no_margins(self):
        d = designed(more="[tune]\nSPEED_BANDWIDTH_HZ = 60\n")
        warning = next(line for line in d.warnings if "SPEED_BANDWIDTH_HZ = 60" in line)
        self.assertIn("the speed loop is unstable at worst (", warning)
        self.assertIn("current loop    1000 Hz, phase margin", report.text(d))
        self.assertRegex(report.text(d), r"speed loop      60 Hz, .*unstable at worst \(")
        self.assertIn("speed loop unstable at worst", report.brief(d))
        for text in (warning, report.text(d), report.brief(d), header.write(d)):
            self.assertNotRegex(text, r"-\d+(\.\d)? degrees|-\d+(\.\d)? (at worst|over the parameter set)")


class Everywhere(unittest.TestCase):
    def test_a_choice_in_tune_replaces_the_tuner_s_and_what_follows_from_it(self):
        d = designed(more="[tune]\nEND_SPEED_RPM = 700\nIDREF_SPEED3 = -0.5\n")
        self.assertEqual((d.params["END_SPEED_RPM"], d.params["MINIMUM_SPEED_RPM"], d.params["IDREF_SPEED3"]), ("700", "500", "-0.5"))

    def test_inertia_includes_the_load(self):
        self.assertEqual(designed(more='[load]\ninertia = { value = 1e-5, unit = "kg m2" }\n').params["MOTOR_INERTIA_KGM2"], "1.55e-5")

    def test_a_salient_motor_is_estimated_with_lq(self):
        d = of("linix_45zwn24_40")
        self.assertAlmostEqual(d.value("MOTOR_LS_MH"), d.motor.lq_h * 1e3, delta=1e-9)

    def test_currents_keep_their_order(self):
        for name in motors():
            d = of(name)
            start_a, most, trip = (d.value(x) for x in ("Q_CURRENT_REF_OPENLOOP", "MAXIMUM_CURRENT_A", "OVER_CURRENT_THRESHOLD_A"))
            self.assertLess(start_a, most, name)
            self.assertLessEqual(1.1 * most, trip + 1e-9, name)
            self.assertLessEqual(trip, 0.865 * d.board.current_full_scale_a, name)

    def test_the_trip_level_is_lowered_until_the_back_emf_fits_its_format(self):
        """Then the largest current is."""
        d = made(rs_ohm=3.9, rated_torque_nm=0.04, rated_speed_rpm=2000.0)
        self.assertLess(d.value("OVER_CURRENT_THRESHOLD_A"), 3.8)
        self.assertEqual(d.value("MAXIMUM_CURRENT_A"), 2.75)
        d = made(rs_ohm=6.0, rated_torque_nm=0.04, rated_current_a=0.7, rated_speed_rpm=1800.0)
        self.assertLess(d.value("MAXIMUM_CURRENT_A"), 2.75)
        self.assertTrue(any("leave the back-EMF's number format" in warning for warning in d.warnings), d.warnings)

    def test_filters_keep_their_corner_at_another_period(self):
        self.assertLess(abs(made(board={"pwm_period_s": 100e-6}).value("KFILTER_ESDQ") - 2357), 3)

    def test_a_quick_rotor_gets_a_quicker_speed_filter_and_loop(self):
        """Otherwise a load takes its speed before the loop reacts."""
        usual, quick = designed(), designed(("value = 5.5e-6", "value = 1.0e-6"))
        self.assertEqual(usual.value("KFILTER_VELESTIM"), 748.0)
        self.assertGreater(quick.value("KFILTER_VELESTIM"), 2.5 * 748.0)
        self.assertLessEqual(quick.value("KFILTER_VELESTIM"), 4.0 * 748.0)
        self.assertGreaterEqual(quick.speed_loop.worst.phase_deg, 60.0)

    def test_tables_of_another_motor_are_not_used(self):
        self.assertFalse(made(name="hurst_dma0204024b101").tuned_by_machine, "tables for 0.285 ohm were used for 2.67 ohm")


class Voltage(unittest.TestCase):
    def setUp(self) -> None:
        self.motor = motor_file.load(HURST)
        self.envelope = Envelope(self.motor, limits.circle_v(BOARD), 2.75)

    def test_circle_is_93_6_percent_of_the_largest_amplitude(self):
        self.assertAlmostEqual(self.envelope.circle_v, 0.936 * 24 / math.sqrt(3), delta=1e-9)

    def test_voltage_equation(self):
        w = 3000 * 5 * math.pi / 30
        expected = math.hypot(2.67 * -1.0 - w * 1.92e-3 * 0.5, 2.67 * 0.5 + w * (1.92e-3 * -1.0 + self.motor.psi_vs))
        self.assertAlmostEqual(self.envelope.voltage(3000.0, -1.0, 0.5), expected, delta=1e-9)

    def test_the_least_d_current_lies_on_the_circle_and_less_does_not_fit(self):
        i_d = self.envelope.least_id(4000.0, 0.0, 0.95)
        i_q = self.envelope.iq(4000.0, 0.0)
        self.assertAlmostEqual(self.envelope.voltage(4000.0, i_d, i_q), 0.95 * self.envelope.circle_v, delta=1e-6)
        self.assertGreater(self.envelope.voltage(4000.0, i_d + 0.05, i_q), 0.95 * self.envelope.circle_v)

    def test_no_d_current_below_base_speed_and_none_that_helps_far_above(self):
        self.assertEqual(self.envelope.least_id(2000.0, 0.0, 0.95), 0.0)
        self.assertIsNone(self.envelope.least_id(9000.0, 0.0, 0.95))

    def test_d_current_never_exceeds_the_characteristic_current(self):
        stiff = Envelope(replace(self.motor, ld_h=8e-3, lq_h=8e-3), self.envelope.circle_v, 2.75)
        self.assertAlmostEqual(stiff.deepest_id(0.0), -self.motor.psi_vs / 8e-3, delta=1e-9)

    def test_torque_falls_to_nothing_at_the_highest_speed(self):
        top = self.envelope.highest_speed(0.0, 0.98)
        self.assertGreater(self.envelope.torque(0.97 * top, 0.98), 0.0)
        self.assertEqual(self.envelope.torque(1.01 * top, 0.98), 0.0)

    def test_the_table_follows_the_voltage_equation_and_never_returns(self):
        start = limits.fw_start_rpm(self.envelope, 5500.0)
        table = limits.table(self.envelope, start)
        self.assertEqual((start, table[0], len(table)), (2600.0, 0.0, 18))
        self.assertEqual(table, sorted(table, reverse=True))
        for i, i_d in enumerate(table[:12]):
            rpm = start + i * 1024 / 5
            least = self.envelope.least_id(rpm, 0.0, 0.95)
            self.assertAlmostEqual(i_d, least, delta=0.011, msg=f"{rpm}")
        self.assertGreaterEqual(table[-1], -2.75)

    def test_18_entries_reach_the_maximum_speed(self):
        fast = Envelope(replace(self.motor, pole_pairs=8, rs_ohm=0.5), self.envelope.circle_v, 2.75)
        start = limits.fw_start_rpm(fast, 4000.0)
        self.assertGreaterEqual(start + 17 * 1024 / 8 + 50.0, 4000.0)

    def test_the_start_of_the_table_stays_in_its_range_for_the_quickest_motor(self):
        quick = Envelope(replace(self.motor, pole_pairs=1, psi_vs=3e-3, rs_ohm=0.3, ld_h=1e-4, lq_h=1e-4, viscous_nms=1e-7), self.envelope.circle_v, 2.75)
        self.assertGreater(quick.base_speed(0.0), 25000.0)
        self.assertEqual(limits.fw_start_rpm(quick, 26000.0), 20000.0)

    def test_numbers_are_written_without_exponents_but_for_inertia(self):
        self.assertEqual((plain(2e-6), real(24.0), short(5.5e-6), plain(1.3427734375e-4, 7)), ("0.000002", "24.0", "5.5e-6", "0.0001342773"))
