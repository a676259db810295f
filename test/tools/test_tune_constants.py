"""The headers, compiled, give the constants that AN1292 publishes and that its equations give; refusals come in the build's words."""

import math
import re

import pytest
from pytest import approx
from support import MOTORS
from tune_support import HURST, designed, of

from tools.common import paths
from tools.common.errors import UserError
from tools.common.param_rows import parameters
from tuning import constants
from tuning.constants import filter_hz, filter_k, number_of

PI2 = 2.0 * math.pi


def golden(rs: float, ls_mh: float, kphi: float, pairs: int, amperes: float, most_a: float, speeds: tuple[float, float], hz: float) -> dict[str, float]:
    """AN1292's Equations 5, 6 and 8 in their corrected form at 24 V, 50 us and 2 us; a sine's steepest slope; gains 2 pi f L and 2 pi f R.
    Written here once more, from AN1292, without the project's headers."""
    ratio = amperes / (24.0 / math.sqrt(3.0) * 0.96)
    slope = [PI2 * rpm / 60.0 * pairs * 50e-6 * most_a / amperes * 16384.0 for rpm in speeds]
    return {"NORM_RS": rs * ratio * 16384.0, "NORM_LSDTBASE": ls_mh * 1e-3 / 50e-6 * ratio * 128.0, "NORM_DELTAT": 50e-6 / 60.0 * 2.0 ** 31,
            "NORM_INVKFIBASE": math.sqrt(3.0) * 1000.0 * pairs * (24.0 / math.sqrt(3.0) * 0.96 / 32768.0) / kphi * 16384.0,
            "estimator.d_ilimit_ls_q14": 8.0 * slope[0], "D_ILIMIT_HS": 2.0 * round(slope[1]),
            "pi_q.kp": PI2 * hz * ls_mh * 1e-3 * ratio / 16.0 * 32768.0, "pi_q.ki": PI2 * hz * rs * 50e-6 * ratio * 2048.0}


CUT_OFF = ("PARAM_BRAKE_COUNTS", "voltage_limit_per_bus_q16", "duty_per_volt_numerator", "speed_kp_fast_q13", "adaptation.emf_least_q12", "adaptation.turned_q12",
           "svm.dead_slope_q8")
"""Constants that the firmware cuts off; those of the observer are others."""


def full_scale(amperes: float) -> dict[str, str]:
    return {"NORM_CURRENT_CONST": f"{amperes / 32768.0:.12g}"}


@pytest.mark.parametrize("amperes, wanted", [(3.95, (12990, 1460, 7956, 1790)), (7.09, (23316, 2620, 7956, 1790)),
                                             (4.4, (14470, 1626, 7956, 1790))])
def test_published_constants_of_the_hurst(amperes, wanted):
    found = constants.evaluate(of(HURST).params | full_scale(amperes), "NORM_RS", "NORM_LSDTBASE", "NORM_INVKFIBASE", "NORM_DELTAT")
    assert tuple(map(int, found)) == wanted


def test_limits_are_an1292s_times_pi_for_a_sine_of_the_largest_current():
    """AN1292's 1502 and 6117 at 2800 and 5500 rpm are 2 f Ts of the whole scale."""
    found = constants.evaluate(of(HURST).params | {"MAXIMUM_CURRENT_A": "3.95"} | full_scale(3.95), "D_ILIMIT_HS", "D_ILIMIT_LS")
    assert found == approx([math.pi * 1502.0, math.pi * 6117.0], rel=5e-4)


@pytest.mark.parametrize("name, wanted", [
    (HURST, golden(2.67, 1.92, 7.24, 5, 4.4, 2.75, (2800.0, 5500.0), 1000.0)),
    ("trinamic_qbl4208_41_04_006", golden(0.9, 1.3, 3.89301, 4, 4.4, 2.98, (4000.0, 6500.0), 1000.0))])
def test_two_motors_against_the_equations(name, wanted):
    for key, value in wanted.items():
        assert of(name).constant(key).q_value == approx(value, rel=0.0, abs=0.51 + 1e-4 * abs(value)), key


def test_filter_constants_and_corners_belong_together():
    assert (filter_k(118.76, 50e-6), filter_k(73.5, 50e-6)) == (1200, 748)
    assert filter_hz(1200, 50e-6) == approx(118.76, abs=0.05)
    assert filter_hz(filter_k(118.76, 100e-6), 100e-6) == approx(118.76, abs=0.1)


# ---- the table -------------------------------------------------------------------------------------------------------------
def test_all_numbers_of_the_drive_s_parameters_are_listed():
    """A new field of drive_params_t without a constant here would be a number that no table shows."""
    known = {item.name.split("[")[0].split(".")[-1] for motor in (HURST, "ipm_4pp_24v_2000") for item in of(motor).constants}
    headers = [paths.ROOT / "include/drive/param_init.h", *(paths.ROOT / "include/drive/scaling").glob("*.h")]
    text = "".join(path.read_text(encoding="utf-8") for path in headers)
    plain = {"shift", "trim_step_q13", "trim_most_q13", "offset_max_q13"} # counts as they stand in control/tuned.h
    fields = set(re.findall(r"\.(\w+) = ", text)) - {"estimator", "fieldweak", "forced", "svm", "pi_d", "pi_q", "adaptation", "observer"}
    assert fields - known - plain == set()


def test_each_count_stands_for_its_value_in_its_format():
    """Count times the format's unit is the value; what is left is rounding: half a count, one where the firmware cuts off."""
    odd = designed(("2.67", "2.6183"), ("1.92", "1.8391"), ("7.24", "6.9937"), ("value = 5,", "value = 7,"),
                   ("value = 2500", "value = 2213"), ("value = 5000", "value = 4100"))
    for d in (*map(of, MOTORS), odd):
        for item in d.constants:
            counts = 1.0 if item.name in CUT_OFF or item.name.startswith("observer.") else 0.51
            counts += 1.01 if item.q_format == "Q15" and item.value > 0.0 else 0.0 # Q15() takes positive numbers times 32767
            single = 1e-5 # percent, of single precision
            assert abs(item.error_percent) <= 100.0 * counts / max(abs(item.q_value), 1) * 1.1 + single, f"{d.motor.name} {item.name}"


def test_engineering_values_are_the_parameters():
    found = {item.name: item for item in of(HURST).constants}
    assert (found["NORM_RS"].value, found["NORM_RS"].unit, found["NORM_RS"].group) == (2.67, "ohm", "motor")
    exact = 2.67 * 4.4 / (24.0 / math.sqrt(3.0) * 0.96) * 32768.0
    assert found["adaptation.rs_base_q16"].error_percent == approx(100.0 * (28940 / exact - 1.0), abs=1e-4)
    assert found["pi_d.kp"].value == approx(PI2 * of(HURST).value("CURRENT_BANDWIDTH_HZ") * 1.92e-3, abs=1e-3)
    assert found["pi_d.ki"].value / found["pi_d.kp"].value == approx(2.67 / 1.92e-3, abs=0.01)
    assert found["forced.increase_rate_q10"].value == approx(715.26, abs=0.01)


# ---- refusals --------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name, value, words", [
    ("KFILTER_ESDQ", "9", "^KFILTER_ESDQ = 9 is outside 10 .. 8000 Q15$"),
    ("SNAPDELAY", "32001", "^SNAPDELAY = 32001 is outside 1 .. 32000 periods$"),
    ("MAXIMUM_SPEED_RPM", "15001", "at most 75000"), ("IDREF_SPEED7", "-3", "IDREF_SPEED7 = -3 must not exceed"),
    ("OVER_CURRENT_THRESHOLD_A", "3.9", "86.5 %"), ("D_CURRCNTR_CTERM", "0.5", "^D_CURRCNTR_CTERM = 0.5 must be 0.9 ")])
def test_a_value_outside_its_range_and_a_broken_relation_are_told_in_the_build_s_words(name, value, words):
    messages = constants.header(of(HURST).params | {name: value}).wrong
    assert any(re.search(words, message) for message in messages), messages
    assert "outside" not in words or len(messages) == 1


def test_a_kphi_that_does_not_fit_is_told_once_and_a_missing_parameter_is_named():
    messages = constants.header(of(HURST).params | {"MOTOR_KPHI_V_PER_KRPM": "1.7"}).wrong
    assert messages[0].startswith("MOTOR_KPHI_V_PER_KRPM = 1.7 does not fit") and not [message for message in messages if "INVKFI" in message]
    params = {name: text for name, text in of(HURST).params.items() if name != "LOCK_TIME"}
    assert constants.header(params).wrong == ["LOCK_TIME is missing"]


def test_a_number_is_read_as_in_c_and_no_compiler_and_a_bad_number_end_in_one_line(monkeypatch):
    assert [number_of(text) for text in ("0xF", "-0.5", "5.5e-6", 3)] == [15.0, -0.5, 5.5e-6, 3.0]
    assert number_of(parameters()["TUNING_DELAY_RAMPUP"].default) == 15.0
    with pytest.raises(UserError, match="do not compile: .*five"):
        constants.evaluate({"NOPOLESPAIRS": "five"}, "NOPOLESPAIRS")
    monkeypatch.setenv("CC", "/no/such/cc")
    with pytest.raises(UserError, match="the compiler does not run .*/no/such/cc: install gcc"):
        constants.evaluate({"NOPOLESPAIRS": "5", "MOTOR_RS_OHM": "0.123456789"}, "NOPOLESPAIRS + 7")
