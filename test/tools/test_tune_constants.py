"""The note's sheet gives the published constants, and the tuner's numbers are those that the compiler makes of the header."""

import math
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

from tools.common import paths
from tune_support import COMPILER, INCLUDES, designed, motors, of
from tuning import header
from tuning.constants import SheetInputs, choose_exponent, filter_hz, filter_k, firmware_constants, sheet
from tuning.design import Design


def note(peak_a: float, **more) -> SheetInputs:
    """The sheet's inputs for the note's motor."""
    values = {"peak_voltage_v": 24.0, "peak_current_a": peak_a, "pwm_period_s": 50e-6, "dead_time_s": 2e-6, "pole_pairs": 5, "rs_ohm": 2.67,
              "ls_h": 1.92e-3, "kphi_v_per_krpm": 7.24, "nominal_speed_rpm": 2800.0, "maximum_speed_rpm": 5500.0}
    return SheetInputs(**(values | more))


class Sheet(unittest.TestCase):
    def test_published_constants_at_3_95_ampere(self):
        out = sheet(note(3.95))
        self.assertEqual((out.norm_rs.stored, out.norm_lsdtbase.stored, out.norm_invkfibase.stored, out.norm_deltat.stored), (12990, 1460, 7956, 1790))
        self.assertEqual((out.d_ilimit_hs, out.d_ilimit_ls), (1502, 6117))

    def test_published_constants_at_7_09_ampere(self):
        out = sheet(note(7.09))
        self.assertEqual((out.norm_rs.stored, out.norm_lsdtbase.stored, out.norm_invkfibase.stored), (23316, 2620, 7956))

    def test_published_constants_at_22_ampere_with_their_exponent(self):
        out = sheet(note(22.0, rs_exponent=4))
        self.assertEqual((out.norm_rs.stored, out.norm_rs.shift, out.norm_lsdtbase.stored), (9044, 11, 8129))

    def test_derivative_limits_of_other_published_speeds(self):
        for low, high, expected_ls, expected_hs in ((2600, 5300, 5680, 1447), (2000, 4000, 4369, 1092), (2000, 3500, 4369, 956)):
            out = sheet(note(3.95, nominal_speed_rpm=low, maximum_speed_rpm=high))
            self.assertLessEqual(abs(out.d_ilimit_ls - expected_ls), 1)
            self.assertLessEqual(abs(out.d_ilimit_hs - expected_hs), 1)

    def test_base_quantities(self):
        out = sheet(note(3.95))
        self.assertAlmostEqual(out.u0_v, 4.05949e-4, delta=1e-9)
        self.assertAlmostEqual(out.i0_a, 1.20544e-4, delta=1e-9)
        self.assertAlmostEqual(out.omega0, 0.104720, delta=1e-6)

    def test_an_exponent_is_chosen_so_that_the_constant_fits_and_the_shift_undoes_it(self):
        out = sheet(note(22.0))
        self.assertEqual((out.norm_rs.exponent, out.norm_rs.stored), (3, 18087))
        for constant in (out.norm_rs, out.norm_lsdtbase, out.norm_invkfibase):
            self.assertTrue(constant.fits)
            self.assertEqual(constant.exponent + constant.shift, 15)

    def test_the_note_s_exponents_are_kept_while_they_fit(self):
        out = sheet(note(3.95))
        self.assertEqual((out.norm_rs.exponent, out.norm_lsdtbase.exponent, out.norm_invkfibase.exponent), (1, 8, 1))
        self.assertEqual((out.norm_rs.shift, out.norm_lsdtbase.shift), (14, 7))

    def test_the_chosen_exponent_is_the_smallest_that_fits(self):
        for raw in (1.0, 32767.4, 32767.6, 65535.0, 1e6, 7.7e7):
            exponent = choose_exponent(raw)
            self.assertLessEqual(math.floor(raw / 2 ** exponent + 0.5), 32767)
            if exponent:
                self.assertGreater(math.floor(raw / 2 ** (exponent - 1) + 0.5), 32767)

    def test_rounding_error_is_that_of_the_stored_value(self):
        constant = sheet(note(3.95)).norm_deltat
        self.assertAlmostEqual(constant.rounding_percent, 0.0240, delta=0.0005)

    def test_filter_constants_and_corners_belong_together(self):
        self.assertEqual((filter_k(118.76, 50e-6), filter_k(73.5, 50e-6)), (1200, 748))
        self.assertAlmostEqual(filter_hz(1200, 50e-6), 118.76, delta=0.05)
        self.assertAlmostEqual(filter_hz(filter_k(118.76, 100e-6), 100e-6), 118.76, delta=0.1)


def compiled(design: Design) -> dict[str, int]:
    """Every constant as a C program prints it that includes the header."""
    names = [item.expression for item in design.constants]
    source = ["#include <stdio.h>", '#include "drive/param_init.h"', "static const drive_params_t p = DRIVE_PARAMS_INIT;", "int main(void)", "{",
              *(f'    printf("%lld\\n", (long long)({name}));' for name in names), "    return 0;", "}"]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "userparams.h").write_text(header.write(design), encoding="utf-8")
        program = f"{folder}/program"
        subprocess.run([*COMPILER, "-std=gnu99", "-O1", "-w", f"-I{folder}", *INCLUDES, "-xc", "-", "-o", program], input="\n".join(source), text=True,
                       cwd=paths.ROOT, check=True, capture_output=True)
        lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    return dict(zip((item.name for item in design.constants), map(int, lines), strict=True))


class Compiled(unittest.TestCase):
    def same(self, design: Design) -> None:
        found = compiled(design)
        wrong = [f"{item.name}: {item.q_value}, the compiler says {found[item.name]}" for item in design.constants if found[item.name] != item.q_value]
        self.assertFalse(wrong, "\n".join(wrong))

    def test_every_motor_s_constants_are_the_compiler_s_to_the_last_bit(self):
        for name in motors():
            with self.subTest(name):
                self.same(of(name))

    def test_odd_numbers_too(self):
        self.same(designed(("2.67", "2.6183"), ("1.92", "1.8391"), ("7.24", "6.9937"), ("value = 5,", "value = 7,"), ("value = 2500", "value = 2213"),
                           ("value = 5000", "value = 4100")))

    def test_all_numbers_of_the_drive_s_parameters_are_listed(self):
        """A new field of drive_params_t without a constant here would be a number that no table shows."""
        listed = {item.name.split("[")[0] for item in of("hurst_dmb0224c10002").constants}
        text = (paths.ROOT / "include/drive/param_init.h").read_text(encoding="utf-8")
        fields = set(re.findall(r"\.(\w+) = ", text)) - {"estimator", "fieldweak", "forced", "svm", "pi_d", "pi_q", "pi_speed"}
        known = {name.split(".")[-1] for name in listed}
        plain = {"shift", "trim_step_q13", "offset_max_q13"} # written as numbers in param_init.h itself
        self.assertFalse(fields - known - plain)


class Errors(unittest.TestCase):
    def test_a_rounding_error_is_the_difference_to_the_exact_value(self):
        found = {item.name: item for item in firmware_constants(of("hurst_dmb0224c10002").params)}
        u0 = 24.0 / math.sqrt(3.0) * 0.96 / 32768.0
        exact = 2.67 * (0.0001342773 / u0) * 32768.0
        self.assertAlmostEqual(found["estimator.rs_q16"].error_percent, 100.0 * (28940 / exact - 1.0), delta=1e-6)

    def test_engineering_values_are_the_parameters(self):
        found = {item.name: item for item in firmware_constants(of("hurst_dmb0224c10002").params)}
        self.assertEqual((found["NORM_RS"].value, found["NORM_RS"].unit), (2.67, "ohm"))
        self.assertAlmostEqual(found["pi_d.kp"].value, 2 * math.pi * found_bandwidth() * 1.92e-3, delta=1e-3)
        self.assertAlmostEqual(found["pi_d.ki"].value / found["pi_d.kp"].value, 2.67 / 1.92e-3, delta=0.01)
        self.assertAlmostEqual(found["forced.increase_rate_q10"].value, 715.26, delta=0.01)


def found_bandwidth() -> float:
    return of("hurst_dmb0224c10002").value("CURRENT_BANDWIDTH_HZ")
