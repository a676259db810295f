"""What the tuner refuses and warns about, by name and with a remedy; currents, speeds and field-weakening tables."""

import math
import re
from dataclasses import replace

import pytest
from pytest import approx
from support import MOTORS
from tune_support import FOR_ANOTHER_BOARD, HURST, MOTOR, NO_FRICTION, SMALL_MOTOR, designed, motor_path, of

from tools.common import board_file, motor_file
from tools.common.errors import UserError
from tuning import constants, header, limits, report
from tuning.design import Design, design, plain, real, short
from tuning.design_result import spread_of
from tuning.limits import Envelope

BOARD = board_file.load("mclv")


def parts(changes=(), more: str = "", board: dict | None = None, **other) -> tuple[motor_file.Motor, board_file.BoardFile]:
    """MOTOR with texts replaced, lines added, and numbers of the motor and the board replaced."""
    with motor_path(*changes, more=more) as path:
        return replace(motor_file.load(str(path)), **other), replace(BOARD, **(board or {}))


def made(*arguments, **words) -> Design:
    """The design of parts()."""
    return design(*parts(*arguments, **words))


HEAVIER = ("value = 5.5e-6", "value = 5.5e-5")
INERTIA = '[load]\ninertia = { value = %s, unit = "kg m2" }\n'
OTHER = FOR_ANOTHER_BOARD[:-3] + FOR_ANOTHER_BOARD[-2:]
"""FOR_ANOTHER_BOARD with the maximum_current that it was."""
SMALL = {"rs_ohm": 39.0, "rated_current_a": 0.05, "rated_torque_nm": 0.003, "rated_speed_rpm": 1000.0, "coulomb_nm": 0.0, "viscous_nms": 0.0,
         "start_torque_nm": 0.0}
MAXIMUM = next(line for line in MOTOR.splitlines() if line.startswith("maximum_current"))
REFUSED = {
    "rated speed beyond the speed format": ({"pole_pairs": 31}, ("77500 electrical rpm", "75000; a speed of 2419 rpm is possible", "a_motor.toml")),
    "rated speed beyond a sixteenth of a turn a period": ({"pole_pairs": 14, "board": {"pwm_period_s": 125e-6}},
                                                          ("35000 electrical rpm", "32000 with this PWM period; a speed of 2285 rpm is possible")),
    "voltage too low for the rated speed": (
        {"board": {"nominal_bus_v": 12.0, "under_voltage_v": 7.0}},
        ("12 V are too low for 2500 rpm at half the rated torque", "raise the supply voltage", "or lower the rated speed to")),
    "current beyond the board's range": ({"board": {"current_full_scale_a": 1.0}, "rated_torque_nm": 0.12, "rated_current_a": 2.2},
                                         ("half the rated torque needs", "larger current range than 1 A")),
    "torque beyond the board's current": (
        {"changes": FOR_ANOTHER_BOARD},
        ("3.45 A are allowed", "lower [rating] torque and current to what the board carries, 0.19 N m and 3.45 A peak")),
    "torque beyond maximum_current": ({"changes": (("value = 2.75", "value = 0.55"),)},
                                      ("0.55 A are allowed", "raise [rating] maximum_current to 0.802 A peak")),
    "inertia below the load observer's format": (
        {"changes": (("value = 5.5e-6", "value = 0.5e-6"),)},
        ("cannot count the acceleration of 5e-07 kg m2 by 4.4 A, ", "add at least 1.2e-07 kg m2 of [load] inertia, or use a board with at most 3.5 A of")),
    "speed loop that hunts without load": ({"more": "[tune]\nSPEED_BANDWIDTH_HZ = 17\n"},
                                           ("[tune]", "SPEED_BANDWIDTH_HZ = 17 must be at most 0.148 * LOAD_BANDWIDTH_HZ", "lower it")),
    "lowest speed at which the rotor is not held": ({"more": "[tune]\nMINIMUM_SPEED_RPM = 140\n"},
                                                    ("[tune]", "MINIMUM_SPEED_RPM = 140 must be at least 1126 * NOMINAL_BUS_V", "raise it")),
    "friction that dead time hides": ({"coulomb_nm": 1e-4, "viscous_nms": 0.0},
                                      ("line 33: chokes of 6.3 mH in each phase, added to the motor's inductance", "without load the speed would wander")),
    "friction that a shorter dead time shows": ({"coulomb_nm": 2.5e-4, "viscous_nms": 0.0}, ("without load the speed would wander", "dead_time of 1.1 us, or chokes of 1.4 mH")),
    "as much of viscous friction at half the rated speed": ({"coulomb_nm": 0.0, "viscous_nms": 2.5e-4 / (0.5 * 2500.0 * math.pi / 30.0)},
                                                            ("without load the speed would wander", "dead_time of 1.1 us, or chokes of 1.4 mH")),
    "friction that is enough for a quicker motor": ({"coulomb_nm": 8e-4, "viscous_nms": 0.0, "rated_speed_rpm": 450.0}, ("without load the speed would wander",)),
    "a range so wide that a step of the converter shakes the rotor": ({"rated_speed_rpm": 500.0, "coulomb_nm": 5e-3, "board": {"current_full_scale_a": 24.0}},
                                                                      ("half a step of the converter, 0.023 A, turns the rotor", "a board with at most")),
    "inertia beyond the speed gain's format": ({"more": INERTIA % "5e-3"}, ("speed gain exceeds its Q format with 0.00501 kg m2",)),
    "Kphi too large for its format": ({"pole_pairs": 1, "kphi_v_per_krpm": 12.0, "rated_speed_rpm": 500.0}, ("1/Kphi has only", "too slow for 24 V: use at least")),
    "Kphi too small for its format": ({"kphi_v_per_krpm": 1.2, "rated_speed_rpm": 2000.0}, ("1/Kphi does not fit", "too fast for 24 V: use at most")),
    "resistance too large for its exponent": ({**SMALL, "board": {"current_full_scale_a": 8.0}}, ("MOTOR_RS_OHM", "smaller current range")),
    "motor too small for the board": ({"maximum_current_a": 0.2, "rated_current_a": 0.13, "rated_torque_nm": 0.007},
                                      ("MAXIMUM_CURRENT_A = 0.2 must be at least 6.3 %",)),
    "choice in [tune] that breaks a relation": ({"more": "[tune]\nEND_SPEED_RPM = 2700\n"},
                                                ("[tune]", "END_SPEED_RPM = 2700 must be at most NOMINAL_SPEED_RPM = 2500"))}
FAST = {"pole_pairs": 7, "rs_ohm": 0.45, "ld_h": 3e-4, "lq_h": 3e-4, "kphi_v_per_krpm": 1.8, "psi_vs": 1.8 / (math.sqrt(3.0) * 1000.0 * math.pi / 30.0 * 7),
        "coulomb_nm": 2.5e-3, "viscous_nms": 1.5e-6, "rated_torque_nm": 0.025, "rated_current_a": 1.9, "rated_speed_rpm": 10000.0, "start_torque_nm": 0.006,
        "maximum_current_a": 2.6, "inertia_kgm2": 2.5e-6}
GIMBAL = {"pole_pairs": 7, "rs_ohm": 5.0, "ld_h": 1.5e-3, "lq_h": 1.5e-3, "kphi_v_per_krpm": 40.0, "psi_vs": 40.0 / (math.sqrt(3.0) * 1000.0 * math.pi / 30.0 * 7),
          "inertia_kgm2": 1.2e-5, "coulomb_nm": 8e-3, "viscous_nms": 0.0, "rated_torque_nm": 0.18, "rated_current_a": 0.6, "rated_speed_rpm": 130.0, "maximum_speed_rpm": 140.0,
          "maximum_current_a": 0.9, "start_torque_nm": 0.03, "board": {"current_full_scale_a": 1.3, "adc_bits": 14}}
LOW_OHM = {"rs_ohm": 0.04, "ld_h": 1e-4, "lq_h": 1e-4, "coulomb_nm": 0.02}


def with_supply(ohm: float) -> dict:
    """The board, at the end of such a supply and its cable."""
    return {"quantities": BOARD.quantities | {"supply.resistance": replace(BOARD.quantities["supply.resistance"], value_si=ohm)}}


WARNED = {
    "rounding over a tenth of a percent": ({"rs_ohm": 0.0233, "board": {"rds_on_ohm": 0.001, "shunt_ohm": 0.002}}, ("MOTOR_RS_OHM = 0.0233 is rounded by", "lower [shunt] amplifier_gain to")),
    "supply whose resistance takes too much": (
        {"board": with_supply(8.0), "rated_torque_nm": 0.07}, ("8 ohm of the supply leave", "of 24 V with half the rated torque", "; lower [supply] resistance to ", "or lower the rated speed to")),
    "rated torque that the voltage does not allow": ({"changes": (("value = 2500", "value = 2800"),)}, ("too low for the rated torque at rated speed",)),
    "maximum current beyond the firmware's range": (
        {"changes": (*OTHER, HEAVIER, ("value = 2.75", "value = 24")), "board": {"current_full_scale_a": 60.0}},
        ("maximum_current 24 A peak is above 20 A, the firmware's largest", "MAXIMUM_CURRENT_A is 20; lower [rating] maximum_current to 20 A peak$")),
    "maximum current beyond the board": ({"maximum_current_a": 4.2},
                                         ("maximum_current 4.2 A peak is above what this board can measure", "MAXIMUM_CURRENT_A is 3.45")),
    "rated current beyond the board": ({"rated_current_a": 2.5, "maximum_current_a": 2.3, "board": {"current_full_scale_a": 3.0}},
                                       ("rated current 2.5 A peak is above MAXIMUM_CURRENT_A = 2.3", "amplifier_gain to 70 and raise [rating] maximum_current to 2.5 A peak, or")),
    "rated current beyond the motor's own maximum": ({"rated_current_a": 2.8, "maximum_current_a": 2.7},
                                                     ("rated current 2.8 A peak is above MAXIMUM_CURRENT_A = 2.7", "; raise [rating] maximum_current to 2.8 A peak, or lower")),
    "rated current beyond the firmware's range": (
        {"changes": (*OTHER[1:], HEAVIER, ("value = 1.53", "value = 22"), ("value = 2.75", "value = 24")), "rated_torque_nm": 1.31,
         "board": {"current_full_scale_a": 60.0}},
        ("rated current 22 A peak is above MAXIMUM_CURRENT_A = 20", "N m; lower [rating] current to 20 A peak and [rating] torque to")),
    "kphi that is a factor of 1.4 too small": ({"changes": (("value = 7.24", "value = 5.12"),)},
                                               ("kphi and the rated current give 0.057 N m", "peak and RMS confused?", "kphi to 6.")),
    "torque that is far more than the current gives": ({"rated_torque_nm": 0.125}, ("the rated torque is 0.12 N m: one of the three is wrong",)),
    "largest current beyond the back-EMF's format": ({"rs_ohm": 6.0, "rated_torque_nm": 0.04, "rated_current_a": 0.7, "rated_speed_rpm": 1800.0},
                                                     ("leave the back-EMF's number format", "lower [rating] maximum_current to")),
    "maximum speed that more current reaches": ({"changes": (("value = 5000", "value = 4800"),), "maximum_current_a": 1.9, "rated_torque_nm": 0.07, "rated_current_a": 1.4},
                                                ("maximum_speed 4800 rpm is not reachable", "raise [rating] maximum_current to")),
    "light rotor that a load stops": ({"changes": (("value = 5.5e-6", "value = 2e-6"),)},
                                      ("MINIMUM_SPEED_RPM = 150: a load of 0.08 N m that comes within 0.5 s stops the rotor there", "set MINIMUM_SPEED_RPM to")),
    "rotor so light that no speed holds": (GIMBAL, ("stops so light a rotor at every speed up to NOMINAL_SPEED_RPM = 130", "; raise [load] inertia to")),
    "light rotor that a brake stops at once": (GIMBAL | {"inertia_kgm2": 2.2e-5, "rated_speed_rpm": 300.0, "maximum_speed_rpm": 400.0, "board": {}},
                                               ("stops so light a rotor at 53.6 rpm in 0.66 ms, the drive answers in 2.8 ms", "; set MINIMUM_SPEED_RPM to 230 in [tune]$")),
    "light rotor that a brake stops at once at any speed": (GIMBAL | {"inertia_kgm2": 2.2e-5, "rated_speed_rpm": 200.0, "maximum_speed_rpm": 210.0},
                                                            ("stops so light a rotor at 35.7 rpm in 0.44 ms, the drive answers in 2.8 ms", "; raise [load] inertia to")),
    "swing that a tuned lock leaves": ({"changes": NO_FRICTION, "more": "[tune]\nLOCK_TIME = 4000\n"}, ("the unloaded rotor still swings by", "remove LOCK_TIME from [tune]")),
    "swing that a small inductance feeds": ({"changes": (*SMALL_MOTOR, ("value = 1.92", "value = 0.1"))}, ("feeds the swing", "by chokes in the motor's leads")),
    "heavy load's slow reference": ({"more": INERTIA % "3e-3"}, ("SPEEDREFRAMP_RPM_PER_S = 76: 33 s to the rated speed", "at most 30% of rated torque")),
    "rotation that takes the current loop's margin": ({**FAST, "maximum_speed_rpm": 10500.0}, ("the current loop has", "lower the rated speed to", "and [rating] maximum_speed to")),
    "maximum speed beyond field weakening": ({"changes": (("value = 5000", "value = 6300"),)}, ("maximum_speed 6300 rpm is not reachable",)),
    "maximum speed beyond the speed format": (
        {"changes": (("value = 5000", "value = 9000"),), "ld_h": 6e-3, "lq_h": 6e-3, "maximum_current_a": 3.4, "board": {"pwm_period_s": 125e-6}},
        ("maximum_speed 9000 rpm is not reachable", "32000 electrical rpm are the firmware's end with this PWM period")),
    "rated speed that only S3 reaches": (
        {"changes": (("value = 2500", "value = 2000"),), "pole_pairs": 14, "psi_vs": 7.983e-3 * 5 / 14, "ld_h": 3e-4, "lq_h": 3e-4, "maximum_speed_rpm": 2280.0},
        ("is above 27000 electrical rpm", "use S3 for the rest",)),
    "start that the rotor may not follow": (
        {"changes": (("value = 0.08", "value = 0.06"),), "more": '[load]\ninertia = { value = 1.5e-3, unit = "kg m2" }\nstart_torque = { value = 60, unit = "mN m" }\n'},
        ("the rotor may not follow the ramp",)),
    "inductance measured far from the motor's frequency": ({"changes": (("frequency_hz = 1000", "frequency_hz = 10000"),)},
                                                           ("was measured at 10000 Hz, the motor turns at 208 Hz",)),
    "heavy load's slow speed loop": (
        {"more": '[load]\ninertia = { value = 12000, unit = "g cm2" }\n'},
        ("the speed loop's", "are slow with so much inertia (4 Hz would be calm)", "; lower [load] inertia to")),
    "speed loop that is slow by choice": ({"more": "[tune]\nSPEED_BANDWIDTH_HZ = 4\n"},
                                          ("the speed loop's 4 Hz are slow (13 Hz", "; remove SPEED_BANDWIDTH_HZ from [tune]$")),
    "load observer that is quick by choice": ({"more": "[tune]\nLOAD_BANDWIDTH_HZ = 135\n"},
                                              ("LOAD_BANDWIDTH_HZ = 135: the speed loop has", "15 degrees and 4 dB are asked for; remove LOAD_BANDWIDTH_HZ from [tune]$")),
    "derivative limit that clips": (
        {"pole_pairs": 12, "psi_vs": 7.983e-3 * 5 / 12, "ld_h": 3e-4, "lq_h": 3e-4, "maximum_speed_rpm": 2660.0, "board": {"pwm_period_s": 125e-6},
         "inertia_kgm2": 2e-5},
        ("D_ILIMIT_HS ends at",))}


def test_beyond_32000_electrical_rpm_the_back_emf_s_filter_follows_the_frequency_and_friction_brakes():
    quick = design(motor_file.load("spindle_7pp_24v_10000"), BOARD)
    corner_hz = constants.filter_hz(quick.value("KFILTER_ESDQ"), BOARD.pwm_period_s)
    assert corner_hz == approx(0.37 * 1225.0, rel=1e-3) and quick.value("KFILTER_ESDQ_FW") == quick.value("KFILTER_ESDQ")
    friction_rpm_s = quick.envelope.friction_nm(5000.0) / 2.5e-6 / limits.RPM
    assert 0.38 * friction_rpm_s < quick.value("SPEEDREFRAMP_RPM_PER_S") <= 0.4 * friction_rpm_s
    assert quick.scales.speed_unit == 4.0 and quick.value("NOMINAL_SPEED_RPM") == 10000.0
    slow = design(motor_file.load("maxon_ec45flat_30w_24v"), BOARD) # 507 Hz
    assert slow.scales.speed_unit == 1.0 and slow.value("KFILTER_ESDQ") == 2000.0 and slow.value("SPEEDREFRAMP_RPM_PER_S") > 1000.0


def test_beyond_32000_electrical_rpm_a_heavy_rotor_s_reference_rises_by_torque_and_not_by_friction():
    """A propeller's and a vehicle's: 2.5 rpm/s would be an hour of motor time."""
    spindle = motor_file.load("spindle_7pp_24v_10000")
    heavy = design(replace(spindle, load_inertia_kgm2=7.5e-6), BOARD)
    by_torque = 0.3 * spindle.rated_torque_nm / 1e-5 / limits.RPM
    assert 0.9 * by_torque < heavy.value("SPEEDREFRAMP_RPM_PER_S") <= by_torque
    friction_rpm_s = heavy.envelope.friction_nm(5000.0) / 1e-5 / limits.RPM
    assert heavy.value("SPEEDREFRAMP_RPM_PER_S") > 3.0 * 0.4 * friction_rpm_s


def test_a_motor_for_mains_voltage_is_told_what_it_needs_and_not_to_turn_at_one_rpm():
    washer = {"rs_ohm": 15.0, "ld_h": 20e-3, "lq_h": 20e-3, "kphi_v_per_krpm": 12.0, "psi_vs": 12.0 / (math.sqrt(3.0) * 1000.0 * math.pi / 30.0 * 5), "rated_speed_rpm": 1500.0,
              "rated_current_a": 2.0, "maximum_current_a": 2.5, "rated_torque_nm": 0.19}
    with pytest.raises(UserError) as caught:
        made(**washer)
    said = str(caught.value)
    assert "24 V are too low for 1500 rpm at half the rated torque" in said and "rated speed to" not in said, said
    assert 40.0 < float(re.search(r"raise the supply voltage to ([\d.]+) V$", said)[1]) <= 60.0
    with pytest.raises(UserError, match="the motor needs [0-9]+ V, the firmware's supply ends at 60 V: take another winding"):
        made(**washer | {"rs_ohm": 38.0, "ld_h": 29e-3, "lq_h": 29e-3})


def refused(motor: motor_file.Motor, board: board_file.BoardFile) -> str:
    """What the tuner refuses; "" for nothing."""
    try:
        design(motor, board)
    except UserError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("kphi, rs_ohm, ls_h, rpm", [(95.0, 4.5, 30e-3, 2000.0), (31.4, 2.9, 8e-3, 500.0), (44.8, 5.4, 29e-3, 500.0), (28.7, 9.0, 29e-3, 1000.0), (51.5, 2.0, 10e-3, 500.0)])
def test_a_motor_that_is_too_slow_for_the_supply_is_told_a_voltage_that_is_enough_or_that_none_is(kphi, rs_ohm, ls_h, rpm):
    psi_vs, amps = kphi / (math.sqrt(3.0) * 1000.0 * math.pi / 30.0 * 2), 1.5
    torque_nm = 0.95 * 3.0 * psi_vs * amps
    motor, board = parts(pole_pairs=2, kphi_v_per_krpm=kphi, psi_vs=psi_vs, rs_ohm=rs_ohm, ld_h=ls_h, lq_h=ls_h, rated_speed_rpm=rpm, maximum_speed_rpm=1.3 * rpm, viscous_nms=0.0,
                         rated_current_a=amps, maximum_current_a=2.0, rated_torque_nm=torque_nm, coulomb_nm=0.04 * torque_nm, start_torque_nm=0.2 * torque_nm, inertia_kgm2=torque_nm / rpm)
    said = refused(motor, board)
    volt = float(re.search(r"the motor is too slow for 24 V: use at least ([\d.]+) V", said)[1])
    if volt > 60.0:
        assert said.endswith("but the firmware's supply ends at 60 V: take another winding")
        return
    ratio = volt / board.nominal_bus_v
    supplied = replace(board, nominal_bus_v=volt, **{name: ratio * getattr(board, name) for name in ("bus_full_scale_v", "over_voltage_v", "under_voltage_v", "regen_limit_v")})
    left = refused(motor, supplied)
    assert "too slow" not in left and "too low for" not in left, left


def test_a_value_outside_the_firmware_s_range_is_told_beside_the_supply_that_is_too_low():
    with pytest.raises(UserError) as caught:
        made(kphi_v_per_krpm=12.0, psi_vs=12.0 / (math.sqrt(3.0) * 1000.0 * math.pi / 30.0 * 5), ld_h=35e-3, lq_h=35e-3, rated_speed_rpm=1500.0, rated_torque_nm=0.19)
    assert "24 V are too low for 1500 rpm" in str(caught.value) and "MOTOR_LS_MH = 35 is outside 0.01 .. 30" in str(caught.value), caught.value


def test_remedies_for_a_speed_that_would_wander_are_enough_and_hardly_more():
    hidden = {"coulomb_nm": 2.5e-4, "viscous_nms": 0.0}
    with pytest.raises(UserError) as caught:
        made(**hidden)
    dead_us, chokes_mh = (float(number) for number in re.search(r"dead_time of ([\d.]+) us, or chokes of ([\d.]+) mH", str(caught.value)).groups())
    made(**hidden, board={"dead_time_s": dead_us * 1e-6})
    made(**hidden, ld_h=1.92e-3 + 1e-3 * chokes_mh, lq_h=1.92e-3 + 1e-3 * chokes_mh)
    with pytest.raises(UserError):
        made(**hidden, board={"dead_time_s": 1.1 * dead_us * 1e-6})


@pytest.mark.parametrize("motor, says", REFUSED.values(), ids=REFUSED)
def test_what_cannot_work_is_refused_in_one_line_with_a_remedy(motor, says):
    with pytest.raises(UserError) as caught:
        made(**motor)
    assert "\n" not in str(caught.value) and [words for words in says if words not in str(caught.value)] == [], caught.value


@pytest.mark.parametrize("motor, says", WARNED.values(), ids=WARNED)
def test_what_works_with_a_cost_is_warned_about(motor, says):
    warnings = made(**motor).warnings
    assert any(all(words in f"{warning}$" for words in says) for warning in warnings), warnings


def test_two_warnings_that_ask_for_a_higher_minimum_speed_name_one_number():
    name = "light rotor that a brake stops at once"
    named = [re.findall(r"set MINIMUM_SPEED_RPM to ([\d.]+) in", warning) for warning in made(**WARNED[name][0]).warnings]
    assert sum(named, []) == ["230", "230"]


def test_the_supply_s_resistance_and_the_rated_speed_that_the_warning_names_are_enough():
    words = next(warning for warning in made(board=with_supply(8.0), rated_torque_nm=0.07).warnings if "ohm of the supply" in warning)
    ohm, rpm = (float(re.search(f"{what} to ([0-9.]+)", words)[1]) for what in ("resistance", "rated speed"))
    for design_now in (made(board=with_supply(ohm), rated_torque_nm=0.07), made(board=with_supply(8.0), rated_torque_nm=0.07, rated_speed_rpm=rpm)):
        assert not any("ohm of the supply" in warning for warning in design_now.warnings)
    assert 1.0 < ohm < 8.0 and 1500.0 < rpm < 2500.0


def test_a_bridge_that_counts_beside_the_winding_is_a_define_of_its_own_and_in_the_model():
    bridge_ohm = BOARD.rds_on_ohm + 0.5 * BOARD.shunt_ohm
    usual, low = made(), made(**LOW_OHM)
    assert "BRIDGE_RS_OHM" not in usual.params and "BRIDGE_RS_OHM" not in header.write(usual)
    assert (low.value("MOTOR_RS_OHM"), low.value("BRIDGE_RS_OHM")) == (0.04, approx(bridge_ohm)) and low.plant.rs == approx(0.04 + bridge_ohm)
    assert re.search(r"^#define BRIDGE_RS_OHM 0\.0\d+ +/\* \[ohm\] a transistor and half of the shunt", header.write(low), re.MULTILINE)
    counts = {name: constants.evaluate(low.params | ohm, "NORM_RS")[0] for name, ohm in (("both", {}), ("one", {"MOTOR_RS_OHM": plain(0.04 + bridge_ohm), "BRIDGE_RS_OHM": "0"}))}
    assert counts["both"] == counts["one"] > constants.evaluate(low.params | {"BRIDGE_RS_OHM": "0"}, "NORM_RS")[0]
    assert f"0.04 ohm and {bridge_ohm:.2g} ohm of the bridge, " in report.text(low) and "of the bridge" not in report.text(usual)


def test_a_spread_of_the_winding_is_less_of_the_whole_where_the_bridge_counts():
    motor, board = parts(**LOW_OHM)
    spread = design(replace(motor, spread={"rs_ohm": (0.03, 0.05)}), board)
    bridge_ohm = spread.bridge_ohm
    assert bridge_ohm > 0.0 and spread_of(spread.motor)["rs"] == (approx((0.03 + bridge_ohm) / (0.04 + bridge_ohm)), approx((0.05 + bridge_ohm) / (0.04 + bridge_ohm)))


def test_a_motor_within_all_limits_has_no_warning():
    assert designed(("value = 0.08", "value = 0.06"), ("value = 2500", "value = 2000"), ("value = 1.53", "value = 1.2")).warnings == []


def test_the_limit_that_a_refusal_names_works():
    lowered = dict(FOR_ANOTHER_BOARD) | {"value = 1.53": "value = 3.45", "value = 0.08": "value = 0.19"}
    assert designed(*lowered.items()).value("MAXIMUM_CURRENT_A") == 3.45
    assert designed(("value = 2.75", "value = 0.802"), ("value = 2500", "value = 2300")).value("MAXIMUM_CURRENT_A") == 0.802
    with pytest.raises(UserError) as caught:
        made(more=INERTIA % "5e-3")
    largest = float(re.search(r": (\S+) kg m2 of rotor and load are possible", str(caught.value))[1])
    assert designed(more=INERTIA % (largest - 5.5e-6)).value("SPEED_BANDWIDTH_HZ") >= 0.2


def test_an_unstable_loop_is_called_so_and_has_no_margins():
    d = designed(more="[tune]\nLOAD_BANDWIDTH_HZ = 148\nSPEED_BANDWIDTH_HZ = 21.9\nKFILTER_ESDQ = 1000\n")
    warning = next(line for line in d.warnings if "LOAD_BANDWIDTH_HZ = 148" in line)
    assert "the speed loop is unstable at worst (" in warning and "speed loop unstable at worst" in report.brief(d)
    assert "current loop    1000 Hz, phase margin" in report.text(d)
    assert re.search(r"current loop    1000 Hz, .* at worst \(.*; 60 are asked there\), gain margin", report.text(d))
    assert re.search(r"speed loop      21.9 Hz, .*unstable at worst \(", report.text(d))
    for text in (warning, report.text(d), report.brief(d), header.write(d)):
        assert not re.search(r"-\d+(\.\d)? degrees|-\d+(\.\d)? (at worst|over the parameter set)", text)


# ---- what is chosen --------------------------------------------------------------------------------------------------------
def test_a_choice_in_tune_replaces_the_tuner_s_and_what_follows_from_it():
    d = designed(more="[tune]\nEND_SPEED_RPM = 700\nIDREF_SPEED3 = -0.5\n")
    assert [d.params[name] for name in ("END_SPEED_RPM", "MINIMUM_SPEED_RPM", "IDREF_SPEED3")] == ["700", "150", "-0.5"]
    # inertia includes the load, and a salient motor is estimated with Lq
    assert designed(more=INERTIA % "1e-5").params["MOTOR_INERTIA_KGM2"] == "1.55e-5"
    d = of("linix_45zwn24_40")
    assert d.value("MOTOR_LS_MH") == approx(d.motor.lq_h * 1e3, abs=1e-9)


def test_a_thermal_time_gives_the_header_its_i2t_and_without_one_there_is_none():
    without = made()
    assert without.value("I2T_CURRENT_A") == 0.0
    known = made(thermal_time_s=17.0)
    assert known.value("I2T_TIME_SEC") == 17.0 and known.value("I2T_CURRENT_A") == known.motor.rated_current_a < known.value("MAXIMUM_CURRENT_A")
    small = made(thermal_time_s=17.0, rated_current_a=3.0, board={"current_full_scale_a": 2.2})
    assert small.value("I2T_CURRENT_A") == small.value("MAXIMUM_CURRENT_A") < 3.0


@pytest.mark.parametrize("name", MOTORS)
def test_currents_keep_their_order(name):
    d = of(name)
    start_a, most, trip = (d.value(x) for x in ("Q_CURRENT_REF_OPENLOOP", "MAXIMUM_CURRENT_A", "OVER_CURRENT_THRESHOLD_A"))
    assert start_a < most and 1.1 * most <= trip + 1e-9 and trip <= 0.865 * d.board.current_full_scale_a


def test_the_trip_level_then_the_largest_current_is_lowered_until_the_back_emf_fits_its_format():
    d = made(rs_ohm=3.9, rated_torque_nm=0.04, rated_speed_rpm=2000.0)
    assert d.value("OVER_CURRENT_THRESHOLD_A") < 3.8 and d.value("MAXIMUM_CURRENT_A") == 2.75
    d = made(rs_ohm=6.0, rated_torque_nm=0.04, rated_current_a=0.7, rated_speed_rpm=1800.0)
    assert d.value("MAXIMUM_CURRENT_A") < 2.75
    assert any("leave the back-EMF's number format" in warning for warning in d.warnings), d.warnings


def test_filters_keep_their_corner_at_another_period_and_a_quick_rotor_gets_a_quicker_speed_filter():
    assert made(board={"pwm_period_s": 100e-6}).value("KFILTER_ESDQ") == approx(3878, abs=2.9)
    usual, quick = designed(), designed(("value = 5.5e-6", "value = 1.5e-6"))
    assert usual.value("KFILTER_VELESTIM") == 748.0 and 2.5 * 748.0 < quick.value("KFILTER_VELESTIM") <= 4.0 * 748.0


def test_tables_of_another_motor_are_not_used():
    assert not made(name="hurst_dma0204024b101").tuned_by_machine, "tables for 0.285 ohm were used for 2.67 ohm"


# ---- the voltage equation --------------------------------------------------------------------------------------------------
HURST_MOTOR = motor_file.load(HURST)
ENVELOPE = Envelope(HURST_MOTOR, limits.circle_v(BOARD), 2.75)


def changed(**numbers) -> Envelope:
    return replace(ENVELOPE, motor=replace(HURST_MOTOR, **numbers))


def test_the_circle_and_the_voltage_equation():
    assert ENVELOPE.circle_v == approx(0.936 * 24 / math.sqrt(3), abs=1e-9)
    w = 3000 * 5 * math.pi / 30
    expected = math.hypot(2.67 * -1.0 - w * 1.92e-3 * 0.5, 2.67 * 0.5 + w * (1.92e-3 * -1.0 + HURST_MOTOR.psi_vs))
    assert ENVELOPE.voltage(3000.0, -1.0, 0.5) == approx(expected, abs=1e-9)


def test_the_least_d_current_lies_on_the_circle_and_less_does_not_fit():
    i_d, i_q = ENVELOPE.least_id(4000.0, 0.0, 0.95), ENVELOPE.iq(4000.0, 0.0)
    assert ENVELOPE.voltage(4000.0, i_d, i_q) == approx(0.95 * ENVELOPE.circle_v, abs=1e-6)
    assert ENVELOPE.voltage(4000.0, i_d + 0.05, i_q) > 0.95 * ENVELOPE.circle_v
    assert ENVELOPE.least_id(2000.0, 0.0, 0.95) == 0.0, "below base speed"
    assert ENVELOPE.least_id(9000.0, 0.0, 0.95) is None, "far above"
    stiff = changed(ld_h=8e-3, lq_h=8e-3)
    assert stiff.deepest_id(0.0) == approx(-HURST_MOTOR.psi_vs / 8e-3, abs=1e-9), "the characteristic current"
    # torque falls to nothing at the highest speed
    top = ENVELOPE.highest_speed(0.0, 0.98)
    assert ENVELOPE.torque(0.97 * top, 0.98) > 0.0 == ENVELOPE.torque(1.01 * top, 0.98)


def test_the_d_current_for_a_load_is_the_least_that_fits_or_the_one_of_the_smallest_voltage():
    assert ENVELOPE.id_for(2800.0, 0.04) == ENVELOPE.least_id(2800.0, 0.04, limits.FULL_SHARE) < 0.0
    assert ENVELOPE.least_id(2520.0, 0.08, limits.FULL_SHARE) is None
    i_d, i_q = ENVELOPE.id_for(2520.0, 0.08), ENVELOPE.iq(2520.0, 0.08)
    assert i_d == ENVELOPE.least_voltage_id(2520.0) == approx(-1.97, abs=0.01)
    assert ENVELOPE.voltage(2520.0, i_d, i_q) < min(ENVELOPE.voltage(2520.0, i_d + x, i_q) for x in (-0.05, 0.05))
    assert replace(ENVELOPE, maximum_a=2.0).id_for(2520.0, 0.08) == approx(-math.sqrt((0.96 * 2.0) ** 2 - i_q ** 2)), "the current limit"


def test_the_voltage_feedback_allows_what_the_rated_torque_needs_and_helps_with_less_flux():
    """0.8 of 1.97 A, for with a fifth less flux the smallest voltage lies there; half the torque at rated speed with a fifth more; without need 30 % of the largest current."""
    assert of(HURST).value("FW_TRIM_CURRENT_A") == 1.5
    assert of("linix_45zwn24_40").value("FW_TRIM_CURRENT_A") == 3.0
    assert of("anaheim_bly172s_24v_4000").value("FW_TRIM_CURRENT_A") == 1.0


def test_the_table_follows_the_voltage_equation_and_never_returns():
    start = limits.fw_start_rpm(ENVELOPE, 5500.0)
    table = limits.table(ENVELOPE, start)
    assert (start, table[0], len(table)) == (2600.0, 0.0, 18)
    assert table == sorted(table, reverse=True) and table[-1] >= -2.75
    assert table[:12] == approx([ENVELOPE.least_id(start + i * 1024 / 5, 0.0, 0.95) for i in range(12)], abs=0.011)


def test_the_start_of_the_table_lets_it_reach_the_maximum_speed_and_stays_in_its_range():
    assert limits.fw_start_rpm(changed(pole_pairs=8, rs_ohm=0.5), 4000.0) + 17 * 1024 / 8 + 50.0 >= 4000.0
    quick = changed(pole_pairs=1, psi_vs=3e-3, rs_ohm=0.3, ld_h=1e-4, lq_h=1e-4, viscous_nms=1e-7)
    assert quick.base_speed(0.0) > 25000.0 and limits.fw_start_rpm(quick, 32000.0) == 30000.0


def test_numbers_are_written_without_exponents_but_for_inertia():
    assert (plain(2e-6), real(24.0), short(5.5e-6), plain(1.3427734375e-4, 7)) == ("0.000002", "24.0", "5.5e-6", "0.0001342773")
