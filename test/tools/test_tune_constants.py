"""The headers, compiled, give the constants that AN1292 publishes and that its equations give; refusals come in the build's words."""

import math
import re
import unittest
from unittest import mock

from tools.common import paths
from tools.common.errors import UserError
from tools.common.param_rows import parameters
from tune_support import HURST, designed, motors, of
from tuning import constants
from tuning.constants import filter_hz, filter_k, number_of

PI2 = 2.0 * math.pi


def golden(rs: float, ls_mh: float, kphi: float, pairs: int, amperes: float, most_a: float, speeds: tuple[float, float], hz: float) -> dict[str, float]:
    """AN1292's Equations 5, 6 and 8 in their corrected form at 24 V, 50 us and 2 us; a sine's steepest slope; gains 2 pi f L and 2 pi f R.
    Written here once more, from the note, without the project's headers."""
    ratio = amperes / (24.0 / math.sqrt(3.0) * 0.96)
    slope = [PI2 * rpm / 60.0 * pairs * 50e-6 * most_a / amperes * 16384.0 for rpm in speeds]
    return {"NORM_RS": rs * ratio * 16384.0, "NORM_LSDTBASE": ls_mh * 1e-3 / 50e-6 * ratio * 128.0, "NORM_DELTAT": 50e-6 / 60.0 * 2.0 ** 31,
            "NORM_INVKFIBASE": math.sqrt(3.0) * 1000.0 * pairs * (24.0 / math.sqrt(3.0) * 0.96 / 32768.0) / kphi * 16384.0,
            "estimator.d_ilimit_ls_q14": 8.0 * slope[0], "estimator.d_ilimit_hs_q14": slope[1],
            "pi_q.kp": PI2 * hz * ls_mh * 1e-3 * ratio / 16.0 * 32768.0, "pi_q.ki": PI2 * hz * rs * 50e-6 * ratio * 2048.0}


class Golden(unittest.TestCase):
    def test_published_constants_of_the_hurst(self):
        for amperes, wanted in ((3.95, (12990, 1460, 7956, 1790)), (7.09, (23316, 2620, 7956, 1790)), (4.4, (14470, 1626, 7956, 1790))):
            params = of(HURST).params | {"NORM_CURRENT_CONST": f"{amperes / 32768.0:.12g}"}
            found = constants.evaluate(params, "NORM_RS", "NORM_LSDTBASE", "NORM_INVKFIBASE", "NORM_DELTAT")
            self.assertEqual(tuple(map(int, found)), wanted, amperes)

    def test_limits_are_an1292s_times_pi_for_a_sine_of_the_largest_current(self):
        """AN1292's 1502 and 6117 at 2800 and 5500 rpm are 2 f Ts of the whole scale."""
        params = of(HURST).params | {"MAXIMUM_CURRENT_A": "3.95", "NORM_CURRENT_CONST": f"{3.95 / 32768.0:.12g}"}
        found = constants.evaluate(params, "D_ILIMIT_HS", "D_ILIMIT_LS")
        for here, published in zip(found, (1502.0, 6117.0), strict=True):
            self.assertAlmostEqual(here / (math.pi * published), 1.0, delta=5e-4)

    def test_two_motors_against_the_equations(self):
        cases = {HURST: golden(2.67, 1.92, 7.24, 5, 4.4, 2.75, (2800.0, 5500.0), 1000.0),
                 "trinamic_qbl4208_41_04_006": golden(0.9, 1.3, 3.89301, 4, 4.4, 2.98, (4000.0, 6500.0), 1000.0)}
        for name, wanted in cases.items():
            for key, value in wanted.items():
                self.assertAlmostEqual(of(name).constant(key).q_value, value, delta=0.51 + 1e-4 * abs(value), msg=f"{name} {key}")

    def test_filter_constants_and_corners_belong_together(self):
        self.assertEqual((filter_k(118.76, 50e-6), filter_k(73.5, 50e-6)), (1200, 748))
        self.assertAlmostEqual(filter_hz(1200, 50e-6), 118.76, delta=0.05)
        self.assertAlmostEqual(filter_hz(filter_k(118.76, 100e-6), 100e-6), 118.76, delta=0.1)


class Table(unittest.TestCase):
    def test_all_numbers_of_the_drive_s_parameters_are_listed(self):
        """A new field of drive_params_t without a constant here would be a number that no table shows."""
        known = {item.name.split("[")[0].split(".")[-1] for item in of(HURST).constants}
        text = (paths.ROOT / "include/drive/param_init.h").read_text(encoding="utf-8")
        plain = {"shift", "trim_step_q13", "offset_max_q13"} # written as numbers in param_init.h itself
        fields = set(re.findall(r"\.(\w+) = ", text)) - {"estimator", "fieldweak", "forced", "svm", "pi_d", "pi_q", "pi_speed"}
        self.assertFalse(fields - known - plain)

    def test_each_count_stands_for_its_value_in_its_format(self):
        """Count times the format's unit is the value; what is left is rounding: half a count, one where the firmware cuts off, 0.49 more for the ramp."""
        odd = designed(("2.67", "2.6183"), ("1.92", "1.8391"), ("7.24", "6.9937"), ("value = 5,", "value = 7,"), ("value = 2500", "value = 2213"),
                       ("value = 5000", "value = 4100"))
        for d in (*map(of, motors()), odd):
            for item in d.constants:
                counts = {"speed_ramp_erpm": 1.0, "voltage_limit_per_bus_q16": 1.0, "duty_per_volt_numerator": 1.0}.get(item.name, 0.51)
                counts += 1.01 if item.q_format == "Q15" and item.value > 0.0 else 0.0 # Q15() takes positive numbers times 32767
                single = 1e-5 # percent, of single precision
                self.assertLessEqual(abs(item.error_percent), 100.0 * counts / max(abs(item.q_value), 1) * 1.1 + single, f"{d.motor.name} {item.name}")

    def test_engineering_values_are_the_parameters(self):
        found = {item.name: item for item in of(HURST).constants}
        self.assertEqual((found["NORM_RS"].value, found["NORM_RS"].unit, found["NORM_RS"].group), (2.67, "ohm", "motor"))
        self.assertAlmostEqual(found["estimator.rs_q16"].error_percent, 100.0 * (28940 / (2.67 * 4.4 / (24.0 / math.sqrt(3.0) * 0.96) * 32768.0) - 1.0), delta=1e-4)
        self.assertAlmostEqual(found["pi_d.kp"].value, PI2 * of(HURST).value("CURRENT_BANDWIDTH_HZ") * 1.92e-3, delta=1e-3)
        self.assertAlmostEqual(found["pi_d.ki"].value / found["pi_d.kp"].value, 2.67 / 1.92e-3, delta=0.01)
        self.assertAlmostEqual(found["forced.increase_rate_q10"].value, 715.26, delta=0.01)


class Refusals(unittest.TestCase):
    def wrong(self, **values: str) -> list[str]:
        return constants.header(of(HURST).params | values).wrong

    def test_every_motor_s_header_is_accepted(self):
        for name in motors():
            self.assertEqual(constants.header(of(name).params).wrong, [], name)

    def test_a_value_outside_its_range_is_told_in_the_build_s_words(self):
        self.assertEqual(self.wrong(KFILTER_ESDQ="9"), ["KFILTER_ESDQ = 9 is outside 10 .. 8000 Q15"])
        self.assertEqual(self.wrong(SNAPDELAY="32001"), ["SNAPDELAY = 32001 is outside 1 .. 32000 periods"])

    def test_a_broken_relation_is_told_in_the_build_s_words(self):
        for name, value, words in (("MAXIMUM_SPEED_RPM", "6500", "at most 32000"), ("IDREF_SPEED7", "-3", "IDREF_SPEED7 must not exceed"),
                                   ("OVER_CURRENT_THRESHOLD_A", "3.9", "86.5 %"), ("D_CURRCNTR_CTERM", "0.5", "D_CURRCNTR_CTERM must be")):
            self.assertTrue(any(words in message for message in self.wrong(**{name: value})), (name, self.wrong(**{name: value})))

    def test_a_kphi_that_does_not_fit_is_told_once(self):
        messages = self.wrong(MOTOR_KPHI_V_PER_KRPM="1.7")
        self.assertTrue(messages[0].startswith("MOTOR_KPHI_V_PER_KRPM does not fit"))
        self.assertFalse([message for message in messages if "INVKFI" in message])

    def test_a_missing_parameter_is_named(self):
        params = dict(of(HURST).params)
        del params["LOCK_TIME"]
        self.assertEqual(constants.header(params).wrong, ["LOCK_TIME is missing"])

    def test_no_compiler_and_a_bad_number_end_in_one_line(self):
        with mock.patch.dict("os.environ", {"CC": "/no/such/cc"}), self.assertRaisesRegex(UserError, "the compiler does not run .*/no/such/cc: install gcc"):
            constants.evaluate({"NOPOLESPAIRS": "5", "MOTOR_RS_OHM": "0.123456789"}, "NOPOLESPAIRS + 7")
        with self.assertRaisesRegex(UserError, "do not compile: .*five"):
            constants.evaluate({"NOPOLESPAIRS": "five"}, "NOPOLESPAIRS")

    def test_a_number_is_read_as_in_c(self):
        self.assertEqual([number_of(text) for text in ("0xF", "-0.5", "5.5e-6", 3)], [15.0, -0.5, 5.5e-6, 3.0])
        self.assertEqual(number_of(parameters()["TUNING_DELAY_RAMPUP"].default), 15.0)


if __name__ == "__main__":
    unittest.main()
