"""AN1292's normalisation reversed: counts of its formulas come back as the motor, and what contradicts what is named."""

import math
import re

import pytest
from import_support import CONSTANTS, HEADER, LATER, changed

from tools.common.errors import UserError
from tools.common.param_rows import modes
from tuning import an1292, c_header

NUMBERS = dict(rs=1.1, ls=0.9e-3, kphi=5.8, pairs=4, period=50e-6, dead=2e-6, bus=24.0, ampere=0.00018)


@pytest.fixture
def parms(tmp_path):
    def read(text: str = HEADER, supply_v: float = 24.0, **divisors: int) -> an1292.UserParms:
        path = tmp_path / "pump.h"
        path.write_text(text, encoding="utf-8")
        header = c_header.read(path)
        header.label = "pump.h"
        return an1292.read(header, supply_v, 2e-6, divisors)
    return read


def refused(read, text: str, *told: str) -> None:
    with pytest.raises(UserError) as caught:
        read(text)
    assert len(caught.value.lines) == 1 and not [part for part in told if part not in caught.value.lines[0]], caught.value.lines


# ---- formulas --------------------------------------------------------------------------------------------------------------
def test_the_formulas_give_back_what_the_spreadsheet_s_direction_was_given():
    """AN1292's equations as its spreadsheet computes them, and back."""
    n = NUMBERS
    u0 = n["bus"] / math.sqrt(3.0) * (1.0 - n["dead"] / n["period"]) / 32768.0
    assert an1292.base_volt(n["bus"], n["dead"], n["period"]) == pytest.approx(u0)
    ratio = n["ampere"] / u0
    assert an1292.resistance_ohm(n["rs"] * ratio * 32768.0 / 2.0, 2, n["ampere"], u0) == pytest.approx(n["rs"])
    assert an1292.resistance_ohm(n["rs"] * ratio * 32768.0 / 16.0, 16, n["ampere"], u0) == pytest.approx(n["rs"])
    assert an1292.inductance_h(n["ls"] / n["period"] * ratio * 32768.0 / 256.0, 256, n["ampere"], u0, n["period"]) == pytest.approx(n["ls"])
    count = u0 * math.sqrt(3.0) * 1000.0 * n["pairs"] / n["kphi"] * 32768.0 / 2.0
    assert an1292.kphi_v_per_krpm(count, 2, n["pairs"], u0) == pytest.approx(n["kphi"])
    assert an1292.period_of_deltat(n["period"] / 60.0 * 65536.0 * 32768.0) == pytest.approx(n["period"])
    assert an1292.derivative_rpm(8 * 2 * 3200 / 60 * 4 * 50e-6 * 32768.0, 8, 4, 50e-6) == pytest.approx(3200.0)


def test_ramps_are_what_the_firmware_of_an1292_turns():
    """10 / 1024 counts more a period: 1000 rpm of five pole pairs after 27962 periods. One electrical rpm in each: 4000 rpm/s."""
    assert an1292.ramp_rpm_s(10, 5, 50e-6) * 27962 * 50e-6 == pytest.approx(1000.0, rel=1e-4)
    assert an1292.reference_rpm_s(1, 1.0, 5, 50e-6) == pytest.approx(4000.0)
    assert an1292.reference_rpm_s(1, 4.0, 5, 50e-6) == pytest.approx(1000.0)


# ---- a header --------------------------------------------------------------------------------------------------------------
def test_a_header_is_the_motor_that_its_counts_were_made_of(parms):
    found = parms()
    assert (found.rs_ohm, found.ls_h, found.kphi) == (pytest.approx(1.1, rel=1e-3), pytest.approx(0.9e-3, rel=1e-3), pytest.approx(5.8, rel=1e-3))
    assert (found.pole_pairs, found.nominal_rpm, found.maximum_rpm, found.full_scale_a) == (4, 3200.0, 5200.0, pytest.approx(5.898, rel=1e-3))
    assert found.contradictions == []


def test_another_supply_scales_voltage_and_with_it_the_motor(parms):
    one, other = parms(), parms(supply_v=12.0)
    assert other.rs_ohm == pytest.approx(0.5 * one.rs_ohm) and other.kphi == pytest.approx(0.5 * one.kphi)


def test_each_name_is_told_with_its_line_unit_and_place_or_the_reason_why_not(parms):
    lines = {line.name: line for line in parms().lines}
    rows = HEADER.splitlines()
    assert all(re.search(rf"#\s*define\s+{name}\b", rows[line.line - 1]) for name, line in lines.items())
    assert all(bool(line.goes_to) != bool(line.why) for line in lines.values())
    for name, shown, goes_to in (("NORM_RS", "1.1 ohm", "[electrical] resistance"), ("LOOPTIME_SEC", "50 us", "board [pwm] period"), ("KCURRA", "gain -1", "board [shunt] inverted"),
                                 ("OPENLOOP_RAMPSPEED_INCREASERATE", "715.3 rpm/s", "[tune] OPENLOOP_RAMPSPEED_INCREASERATE"), ("Q_CURRENT_REF_OPENLOOP", "1.8 A", "[tune] Q_CURRENT_REF_OPENLOOP"),
                                 ("SPEEDCNTR_OUTMAX", "3.69 A", "[rating] maximum_current"), ("SNAPSHOT", "a mode", "DEFINES=-DSNAPSHOT")):
        assert (lines[name].shown, lines[name].goes_to) == (shown, goes_to)
    for name, shown, why in (("INITOFFSET_TRANS_OPEN_CLSD", "45 degrees", "measures the angle"), ("KFILTER_ESDQ", "119 Hz", "[tune] KFILTER_ESDQ"), ("LOCK_TIME", "0.25 s", "tuner"),
                             ("D_CURRCNTR_PTERM", "0.721 V/A, 128 Hz", "CURRENT_BANDWIDTH_HZ"), ("ENDSPEED_ELECTR", "", "follows"), ("PUMP_COLOUR", "", "no name of AN1292's header")):
        assert lines[name].shown == shown and why in lines[name].why, lines[name]
    assert "PUMP_PARMS_H" not in lines


def test_every_name_that_goes_to_the_tuner_is_a_parameter_or_a_key_of_a_file(parms):
    for name, known in an1292.NAMES.items():
        assert bool(known.goes_to) != bool(known.why), name
        assert not known.goes_to or re.match(r"board \[\w+\] \w+$|\[\w+\] \w+$|tables$", known.goes_to), name
    assert {"TUNING", "OPEN_LOOP_FUNCTIONING", "TORQUE_MODE"} <= set(modes())


def test_the_tables_are_read_in_ampere_and_as_shares_of_base_speed(parms):
    tables = parms().tables
    assert [round(entry.idref_a, 3) for entry in tables[:3]] == [0.0, -0.3, -0.6] and tables[17].idref_a == pytest.approx(-2.6, abs=2e-4)
    assert tables[0].inv_kfi == 1.0 and tables[17].inv_kfi == pytest.approx(13045 / 7945) and tables[1].ls_ratio == pytest.approx(0.48, abs=1e-4)
    assert parms(re.sub(r"#define (IDREF|INVKFI|LS_OVER2LS0)_SPEED.*\n", "", HEADER)).tables == []


def test_entries_that_are_spaced_otherwise_are_interpolated(parms):
    found = parms(changed(("#define NORM_RS", "#define SPEED_INDEX_CONST 11\n#define NORM_RS")))
    plain = parms().tables
    assert found.tables[2] == plain[1] and found.tables[1].idref_a == pytest.approx(0.5 * (plain[0].idref_a + plain[1].idref_a))
    assert "2048 electrical rpm" in found.notes[0]


def test_the_later_version_divides_r_by_16_and_says_so(parms):
    found = parms(LATER)
    assert found.rs_ohm == pytest.approx(1.1, rel=1e-3) and "2022" in found.notes[0]
    assert parms(LATER, NORM_RS=2).rs_ohm == pytest.approx(1.1 / 8.0, rel=1e-3)
    assert parms(changed(("#define NORM_RS 7991", "#define NORM_RS_SCALE 3\n#define NORM_RS 1998"))).rs_ohm == pytest.approx(1.1, rel=1e-3)
    shift = changed(("#define NORM_RS 7991", "#define NORM_RS 7991\n#define NORM_RS_SCALE_SHIFT 11"))
    assert any("NORM_RS_SCALE_SHIFT is not read; NORM_RS is taken as divided by 2: if yours is not, rs_divisor= in SET" in note for note in parms(shift).notes)


def test_the_period_may_follow_from_deltat(parms):
    found = parms(changed(("#define LOOPTIME_SEC 0.00005\n", ""), ("NORM_DELTAT 1790", "NORM_DELTAT 2386")))
    assert found.period_s == pytest.approx(66.7e-6, rel=1e-3) and "LOOPTIME_SEC is missing" in found.notes[0]


# ---- contradictions ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("change, told", [
    (("NORM_DELTAT 1790", "NORM_DELTAT 2386"), "NORM_DELTAT = 2386 belongs to 66.66 us, LOOPTIME_SEC is 50 us (1790)"),
    (("D_ILIMIT_HS 1136", "D_ILIMIT_HS 1447"), "D_ILIMIT_HS = 1447 belongs to 6624 rpm with 4 pole pairs and 50 us, MAXIMUM_SPEED_RPM is 5200"),
    (("D_ILIMIT_LS 5592", "D_ILIMIT_LS 6990"), "D_ILIMIT_LS = 6990 belongs to 4000 rpm"),
    (("#define INVKFI_SPEED0 7945", "#define INVKFI_SPEED0 7000"), "INVKFI_SPEED0 = 7000, NORM_INVKFIBASE is 7945"),
    (("LS_OVER2LS0_SPEED0 Q15(0.5)", "LS_OVER2LS0_SPEED0 Q15(0.4)"), "LS_OVER2LS0_SPEED0 = 0.4, at base speed it is 0.5"),
    (("IDREF_SPEED0 NORM_CURRENT(0)", "IDREF_SPEED0 NORM_CURRENT(-0.2)"), "IDREF_SPEED0 = -0.2 A"),
    (("KCURRB Q15(-0.5)", "KCURRB Q15(-0.45)"), "KCURRB = -0.45, KCURRA is -0.5"),
    (("END_SPEED_RPM 600", "END_SPEED_RPM 3600"), "END_SPEED_RPM = 3600 is above NOMINAL_SPEED_RPM = 3200")])
def test_two_numbers_for_one_thing_are_named_with_the_line_and_the_one_that_counts(parms, change, told):
    text = changed(change)
    found = parms(text).contradictions
    line = text[:text.index(change[1])].count("\n") + 1
    assert len(found) == 1 and found[0].startswith(f"pump.h:{line}: ") and told in found[0], found


# ---- refusals ----------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("change, told", [
    (("#define NORM_RS 7991\n", ""), ["NORM_RS is missing, pump.h: "]), (("NORM_RS 7991", "NORM_RES 7991"), ["NORM_RS is missing", "did you mean 'NORM_RES'?"]),
    (("NORM_RS 7991", "NORM_RS 0"), ["NORM_RS = 0 is out of range, pump.h:", "choose 1 .. 32767"]), (("NORM_RS 7991", "NORM_RS 79.5"), ["NORM_RS = 79.5 is not a whole number"]),
    (("NORM_RS 7991", "NORM_RS 40000"), ["NORM_RS = 40000 is out of range"]), (("NORM_CURRENT_CONST 0.00018", "NORM_CURRENT_CONST 0"), ["NORM_CURRENT_CONST = 0 is out of range"]),
    (("LOOPTIME_SEC 0.00005", "LOOPTIME_SEC (1/20000)"), ["LOOPTIME_SEC = 0 is out of range", "choose 2.5e-05 .. 0.00014"]),
    (("NOPOLESPAIRS 4", "NOPOLESPAIRS 0"), ["NOPOLESPAIRS = 0 is out of range"]), (("NOPOLESPAIRS 4", "NOPOLESPAIRS 4.5"), ["NOPOLESPAIRS = 4.5 is not a whole number"]),
    (("MAXIMUM_SPEED_RPM 5200", "MAXIMUM_SPEED_RPM 3000"), ["MAXIMUM_SPEED_RPM = 3000 is below NOMINAL_SPEED_RPM = 3200"]), (("KCURRA Q15(-0.5)", "KCURRA 0"), ["KCURRA = 0 measures no current"]),
    (("NORM_INVKFIBASE 7945", "NORM_INVKFIBASE 500"), ["NORM_INVKFIBASE stands for a back-EMF of 12 times the supply", "SET=supply=24"]),
    (("#define IDREF_SPEED9 NORM_CURRENT(-2.15)\n", ""), ["IDREF_SPEED9 is missing", "18 entries"]),
    (("IDREF_SPEED9 NORM_CURRENT(-2.15)", "IDREF_SPEED9 NORM_CURRENT(2.15)"), ["IDREF_SPEED9 = 11944 is out of range", "choose -32768 .. 0"]),
    (("LS_OVER2LS0_SPEED2 Q15(0.46);", "LS_OVER2LS0_SPEED2 Q15(0.0)"), ["LS_OVER2LS0_SPEED2 = 0 is out of range"]),
    (("Q_CURRENT_REF_OPENLOOP NORM_CURRENT(1.8)", "Q_CURRENT_REF_OPENLOOP NORM_CURRENT(9)"), ["Q_CURRENT_REF_OPENLOOP: Q15(1.5", "below full scale"])])
def test_what_cannot_be_is_one_line_with_its_place(parms, change, told):
    refused(parms, changed(change), *told)


def test_a_motor_that_cannot_be_names_every_constant_that_may_be_wrong(parms):
    with pytest.raises(UserError) as caught:
        parms(changed(("NORM_RS 7991", "NORM_RS 1")))
    assert [line.split(",")[0] for line in caught.value.lines] == ["NORM_RS stands for 0.000138 ohm", "NORM_LSDTBASE stands for L/R = 6.54e+03 ms"]


def test_all_that_is_missing_comes_at_once(parms):
    refused(parms, "#define LOCK_TIME 4000\n", "NOPOLESPAIRS, NOMINAL_SPEED_RPM, NORM_CURRENT_CONST, NORM_RS, NORM_LSDTBASE, NORM_INVKFIBASE, LOOPTIME_SEC are missing, pump.h")
    refused(parms, "#define MOTOR_RS_OHM 2.67\n", "this is a userparams.h of foc33")


def test_the_fixture_s_constants_are_those_of_its_motor():
    n = NUMBERS
    ratio = n["ampere"] / an1292.base_volt(n["bus"], n["dead"], n["period"])
    assert CONSTANTS == {"NORM_RS": round(n["rs"] * ratio * 16384.0), "NORM_LSDTBASE": round(n["ls"] / n["period"] * ratio * 128.0), "NORM_INVKFIBASE": 7945}
