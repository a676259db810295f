"""What the tuner refuses and warns about, by name and with a remedy; currents, speeds and field-weakening tables."""

import math
import random
import re
import subprocess
import tempfile
import unittest
from dataclasses import replace

from tools.common import board_file, motor_file, paths
from tools.common.errors import UserError
from tune_support import COMPILER, FOR_ANOTHER_BOARD, HURST, INCLUDES, MOTOR, designed, motor_path, motors, of
from tuning import header, limits, params, report
from tuning.constants import number_of
from tuning.design import design, plain, real, short
from tuning.limits import Envelope

BOARD = board_file.load("mclv")


class Refusals(unittest.TestCase):
    def refused(self, *changes: tuple[str, str], says: tuple[str, ...], board=BOARD, **other) -> None:
        with motor_path(*changes) as path, self.assertRaises(UserError) as caught:
            motor = motor_file.load(str(path))
            design(replace(motor, **other), board)
        line = str(caught.exception)
        self.assertNotIn("\n", line)
        for words in says:
            self.assertIn(words, line)

    def test_rated_speed_beyond_the_speed_format(self):
        self.refused(says=("electrical rpm", "32000", "a speed of 2285 rpm is possible", "a_motor.toml"), pole_pairs=14)

    def test_a_voltage_too_low_for_the_rated_speed(self):
        self.refused(says=("12 V are too low for 2500 rpm at half the rated torque", "raise the supply voltage", "or lower the rated speed to"),
                     board=replace(BOARD, nominal_bus_v=12.0, under_voltage_v=7.0))

    def test_a_current_beyond_the_board_s_range(self):
        self.refused(says=("half the rated torque needs", "larger current range than 1 A"), board=replace(BOARD, current_full_scale_a=1.0),
                     rated_torque_nm=0.12, rated_current_a=2.2)

    def test_a_torque_beyond_the_board_s_current_is_told_what_the_board_carries(self):
        self.refused(*FOR_ANOTHER_BOARD, says=("3.45 A are allowed", "lower [rating] torque and current to what the board carries, 0.19 N m and 3.45 A peak"))
        lowered = dict(FOR_ANOTHER_BOARD) | {"value = 1.53": "value = 3.45", "value = 0.08": "value = 0.19"}
        self.assertEqual(designed(*lowered.items()).value("MAXIMUM_CURRENT_A"), 3.45)

    def test_a_torque_beyond_maximum_current_is_told_to_raise_it(self):
        self.refused(("value = 2.75", "value = 0.55"), says=("0.55 A are allowed", "raise [rating] maximum_current to at least 0.802 A peak"))
        self.assertEqual(designed(("value = 2.75", "value = 0.802"), ("value = 2500", "value = 2300")).value("MAXIMUM_CURRENT_A"), 0.802)

    def test_a_largest_current_beyond_its_range_is_told_where_to_set_it(self):
        large = replace(BOARD, current_full_scale_a=60.0)
        line = next(line for line in MOTOR.splitlines() if line.startswith("maximum_current"))
        changes = tuple(change for change in FOR_ANOTHER_BOARD if change[1] != "value = 18")
        self.refused(*changes, (line, ""), says=("MAXIMUM_CURRENT_A = 23 is outside 0.1 .. 20", "add [rating] maximum_current and set it to 0.1 .. 20 A peak"), board=large)
        self.refused(*changes, ("value = 2.75", "value = 24"), says=("MAXIMUM_CURRENT_A = 24 is outside", "change [rating] maximum_current to 0.1 .. 20 A peak"), board=large)

    def test_an_inertia_beyond_the_speed_gain_s_format_names_the_largest(self):
        inertia = '[load]\ninertia = { value = %s, unit = "kg m2" }\n'
        with motor_path(more=inertia % "5e-3") as path, self.assertRaisesRegex(UserError, "speed gain exceeds its Q format with 0.00501 kg m2") as caught:
            design(motor_file.load(str(path)), BOARD)
        largest = float(re.search(r": (\S+) kg m2 of rotor and load are possible", str(caught.exception))[1])
        self.assertGreaterEqual(designed(more=inertia % (largest - 5.5e-6)).value("SPEED_BANDWIDTH_HZ"), 0.2)

    def test_a_kphi_too_large_or_small_for_its_format_names_the_voltage_that_fits(self):
        self.refused(says=("1/Kphi has only", "too slow for 24 V: use at least"), pole_pairs=1, rated_speed_rpm=500.0)
        self.refused(says=("1/Kphi does not fit", "too fast for 24 V: use at most"), kphi_v_per_krpm=1.2, rated_speed_rpm=2000.0)

    def test_a_resistance_too_large_for_its_exponent(self):
        self.refused(says=("MOTOR_RS_OHM", "smaller current range"), rs_ohm=39.0, rated_current_a=0.05, rated_torque_nm=0.003, rated_speed_rpm=1000.0,
                     coulomb_nm=0.0, viscous_nms=0.0, start_torque_nm=0.0, board=replace(BOARD, current_full_scale_a=8.0))

    def test_a_motor_too_small_for_the_board(self):
        self.refused(says=("MAXIMUM_CURRENT_A must be at least 6.3 %",), maximum_current_a=0.2, rated_current_a=0.13, rated_torque_nm=0.007)

    def test_a_choice_in_tune_that_breaks_a_relation_points_there(self):
        with motor_path(more="[tune]\nEND_SPEED_RPM = 2700\n") as path, self.assertRaises(UserError) as caught:
            design(motor_file.load(str(path)), BOARD)
        self.assertIn("[tune]", str(caught.exception))
        self.assertIn("END_SPEED_RPM must be at most NOMINAL_SPEED_RPM", str(caught.exception))


class Warnings(unittest.TestCase):
    def warned(self, words: str, *changes: tuple[str, str], more: str = "", board=BOARD, **other) -> str:
        with motor_path(*changes, more=more) as path:
            d = design(replace(motor_file.load(str(path)), **other), board)
        found = [warning for warning in d.warnings if words in warning]
        self.assertTrue(found, d.warnings)
        return found[0]

    def test_nothing_to_say_about_a_motor_that_fits(self):
        self.assertEqual(designed(("value = 0.08", "value = 0.06"), ("value = 2500", "value = 2000"), ("value = 1.53", "value = 1.2")).warnings, [])

    def test_rounding_over_a_tenth_of_a_percent(self):
        line = self.warned("MOTOR_RS_OHM = 0.0233 is rounded by", rs_ohm=0.0233)
        self.assertIn("larger current range", line)

    def test_a_rated_torque_that_the_voltage_does_not_allow(self):
        self.warned("too low for the rated torque at rated speed", ("value = 2500", "value = 2800"))

    def test_a_maximum_current_beyond_the_board(self):
        line = self.warned("maximum_current 4.2 A peak is above what this board can measure", maximum_current_a=4.2)
        self.assertIn("MAXIMUM_CURRENT_A is 3.45", line)

    def test_a_rated_current_beyond_the_board(self):
        self.warned("rated current 3.6 A peak is above MAXIMUM_CURRENT_A", rated_current_a=3.6, maximum_current_a=3.4)

    def test_a_maximum_speed_beyond_field_weakening(self):
        self.warned("maximum_speed 6300 rpm is not reachable", ("value = 5000", "value = 6300"))

    def test_a_maximum_speed_beyond_the_speed_format(self):
        line = self.warned("maximum_speed 9000 rpm is not reachable", ("value = 5000", "value = 9000"), ld_h=6e-3, lq_h=6e-3, maximum_current_a=3.4)
        self.assertIn("32000 electrical rpm", line)

    def test_a_rated_speed_that_only_s3_reaches(self):
        self.warned("use S3 for the rest", ("value = 2500", "value = 2000"), pole_pairs=14, psi_vs=7.983e-3 * 5 / 14, ld_h=3e-4, lq_h=3e-4)

    def test_an_inductance_measured_far_from_the_motor_s_frequency(self):
        self.warned("was measured at 10000 Hz, the motor turns at 208 Hz", ("frequency_hz = 1000", "frequency_hz = 10000"))

    def test_a_heavy_load_s_slow_speed_loop_is_not_called_a_quick_rotor_s(self):
        line = self.warned("the speed loop's", more='[load]\ninertia = { value = 12000, unit = "g cm2" }\n')
        self.assertIn("are slow with so much inertia (0.73 Hz would hold", line)
        self.assertTrue(line.endswith("or lower the load's inertia"), line)
        line = self.warned("slow for so quick a rotor", ("value = 5.5e-6", "value = 1.0e-6"), more="[tune]\nKFILTER_VELESTIM = 748\n")
        self.assertTrue(line.endswith("or add inertia"), line)
        line = self.warned("the speed loop's 4 Hz are slow (", more="[tune]\nSPEED_BANDWIDTH_HZ = 4\n")
        self.assertTrue(line.endswith("or remove SPEED_BANDWIDTH_HZ from [tune]"), line)

    def test_an_unstable_loop_is_called_so_and_has_no_margins(self):
        d = designed(more="[tune]\nSPEED_BANDWIDTH_HZ = 60\n")
        warning = next(line for line in d.warnings if "SPEED_BANDWIDTH_HZ = 60" in line)
        self.assertIn("the speed loop is unstable at worst (", warning)
        self.assertIn("current loop    1000 Hz, phase margin", report.text(d))
        self.assertRegex(report.text(d), r"speed loop      60 Hz, .*unstable at worst \(")
        self.assertIn("speed loop unstable at worst", report.brief(d))
        for text in (warning, report.text(d), report.brief(d), header.write(d)):
            self.assertNotRegex(text, r"-\d+(\.\d)? degrees|-\d+(\.\d)? (at worst|over the parameter set)")

    def test_a_derivative_limit_that_clips(self):
        self.warned("D_ILIMIT_LS ends at", pole_pairs=9, psi_vs=7.983e-3 * 5 / 9, ld_h=3e-4, lq_h=3e-4, maximum_speed_rpm=2600.0,
                    board=replace(BOARD, pwm_period_s=125e-6))


class Everywhere(unittest.TestCase):
    def test_every_motor_s_parameters_are_complete_and_inside_ranges_and_relations(self):
        for name in motors():
            with self.subTest(name):
                self.assertEqual(params.check(of(name).params), [])

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
        with motor_path() as path:
            d = design(replace(motor_file.load(str(path)), rs_ohm=3.9, rated_torque_nm=0.04, rated_speed_rpm=2000.0), BOARD)
        self.assertLess(d.value("OVER_CURRENT_THRESHOLD_A"), 3.8)
        self.assertEqual(d.value("MAXIMUM_CURRENT_A"), 2.75)
        self.assertEqual(params.check(d.params), [])

    def test_then_the_largest_current_is_lowered(self):
        with motor_path() as path:
            d = design(replace(motor_file.load(str(path)), rs_ohm=6.0, rated_torque_nm=0.04, rated_current_a=0.7, rated_speed_rpm=1800.0), BOARD)
        self.assertLess(d.value("MAXIMUM_CURRENT_A"), 2.75)
        self.assertTrue(any("leave the back-EMF's number format" in warning for warning in d.warnings), d.warnings)
        self.assertEqual(params.check(d.params), [])

    def test_filters_keep_their_corner_at_another_period(self):
        with motor_path() as path:
            d = design(motor_file.load(str(path)), replace(BOARD, pwm_period_s=100e-6))
        self.assertLess(abs(d.value("KFILTER_ESDQ") - 2357), 3)

    def test_a_quick_rotor_gets_a_quicker_speed_filter_and_loop(self):
        """Otherwise a load takes its speed before the loop reacts."""
        usual, quick = designed(), designed(("value = 5.5e-6", "value = 1.0e-6"))
        self.assertEqual(usual.value("KFILTER_VELESTIM"), 748.0)
        self.assertGreater(quick.value("KFILTER_VELESTIM"), 2.5 * 748.0)
        self.assertLessEqual(quick.value("KFILTER_VELESTIM"), 4.0 * 748.0)
        self.assertGreaterEqual(quick.speed_loop.worst.phase_deg, 60.0)

    def test_a_reference_slope_that_the_counts_cannot_express_is_warned_about(self):
        d = designed(more="[tune]\nSPEEDREFRAMP_RPM_PER_S = 700\n")
        self.assertTrue(any("SPEEDREFRAMP_RPM_PER_S = 700 becomes 1000 rpm/s" in warning for warning in d.warnings), d.warnings)
        self.assertEqual(d.constant("speed_ramp_erpm").q_value, 2)

    def test_tables_of_another_motor_are_not_used(self):
        with motor_path() as path:
            motor = replace(motor_file.load(str(path)), name="hurst_dma0204024b101")
            d = design(motor, BOARD)
        if d.tuned_by_machine:
            self.fail("tables for 0.285 ohm were used for 2.67 ohm")


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
        low, high = params.parameters()["FW_START_SPEED_RPM"].low, params.parameters()["FW_START_SPEED_RPM"].high
        self.assertEqual(limits.FW_START_RPM, (float(low), float(high)))
        quick = Envelope(replace(self.motor, pole_pairs=1, psi_vs=3e-3, rs_ohm=0.3, ld_h=1e-4, lq_h=1e-4, viscous_nms=1e-7), self.envelope.circle_v, 2.75)
        self.assertGreater(quick.base_speed(0.0), 25000.0)
        self.assertEqual(limits.fw_start_rpm(quick, 26000.0), 20000.0)


class Parameters(unittest.TestCase):
    def test_ranges_are_those_of_the_table_in_the_firmware(self):
        found = params.parameters()
        self.assertEqual((found["IDREF_SPEED17"].low, found["MOTOR_KPHI_V_PER_KRPM"].unit, found["LOOPTIME_SEC"].high), ("-20", "V peak/krpm", "0.00014"))
        self.assertEqual(len(found), 36 + 3 * 18)

    def test_a_value_outside_its_range_is_told_in_the_build_s_words(self):
        wrong = params.check(of(HURST).params | {"KFILTER_ESDQ": "9"})
        self.assertEqual(wrong, ["KFILTER_ESDQ = 9 is outside 10 .. 8000 Q15"])

    def test_every_relation_is_understood(self):
        base = of(HURST).params
        for name, value, words in (("MAXIMUM_SPEED_RPM", "6500", "at most 32000"), ("IDREF_SPEED7", "-3", "IDREF_SPEED7 must not exceed"),
                                   ("OVER_CURRENT_THRESHOLD_A", "3.9", "86.5 %"), ("UNDER_VOLTAGE_V", "7.1", "0.3 * NOMINAL_BUS_V"),
                                   ("SPEEDCNTR_ITERM", "0.00002", "MOTOR_INERTIA_KGM2; of a motor file, [mechanical] or [load] inertia"), ("D_CURRCNTR_CTERM", "0.5", "D_CURRCNTR_CTERM must be"),
                                   ("BUS_FULL_SCALE_V", "99", "too large for NOMINAL_BUS_V"), ("REGEN_LIMIT_V", "33", "REGEN_LIMIT_V + 2 V")):
            wrong = params.check(base | {name: value})
            self.assertTrue(any(words in message for message in wrong), (name, wrong))

    def test_relations_hold_exactly_where_the_compiler_says_so(self):
        """Random sets around the note's motor: each relation in C and here."""
        base = dict(of(HURST).params)
        dice = random.Random(5)
        scalars = [name for name in base if not re.search(r"_SPEED\d+$", name) and name not in ("NOPOLESPAIRS", "LOCK_TIME", "DATA_BUFFER_SIZE", "SNAPDELAY",
                                                                                              "TUNING_DELAY_RAMPUP", "KCURRA", "KCURRB")]
        cases = [{name: plain(number_of(base[name]) * 3.0 ** dice.uniform(-1.0, 1.0)) for name in dice.sample(scalars, 3)} for _ in range(60)]
        lines = ["#include <stdio.h>", "#define USERPARAMS_H", *(f"#define {name} {text}" for name, text in base.items()), '#include "drive/param_init.h"',
                 '#include "drive/param_table.h"', "#define HOLDS(condition, message) putchar((condition) ? '1' : '0');", "int main(void)", "{"]
        for case in cases:
            for name, text in case.items():
                lines += [f"#undef {name}", f"#define {name} {text}"]
            lines += ["PARAM_RELATION_TABLE(HOLDS)", 'puts("");']
            for name in case:
                lines += [f"#undef {name}", f"#define {name} {base[name]}"]
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([*COMPILER, "-std=gnu99", "-O1", "-w", *INCLUDES, "-xc", "-", "-o", f"{folder}/program"], input="\n".join([*lines, "return 0;", "}"]),
                           text=True, cwd=paths.ROOT, check=True, capture_output=True)
            found = subprocess.run([f"{folder}/program"], capture_output=True, text=True, check=True).stdout.split()
        broken = 0
        for case, bits in zip(cases, found, strict=True):
            wrong = params.check(base | case)
            expected = [item.message for item, bit in zip(params.relations(), bits, strict=True) if bit == "0"]
            self.assertEqual([message for message in wrong if "is outside" not in message], expected, case)
            broken += len(expected)
        self.assertGreater(broken, 30)

    def test_no_relation_is_lost_in_reading_the_table(self):
        text = params.TABLE.read_text(encoding="utf-8")
        body = text[text.index("#define PARAM_RELATION_TABLE"):text.index("#define PARAM_RELATION_IDREF")]
        self.assertEqual(len(params.relations()), body.count("    X(") + 18)

    def test_numbers_are_written_without_exponents_but_for_inertia(self):
        self.assertEqual((plain(2e-6), real(24.0), short(5.5e-6), plain(1.3427734375e-4, 7)), ("0.000002", "24.0", "5.5e-6", "0.0001342773"))
