"""From a motor and a board to every parameter of userparams.h, with the reason for each, the constants, the margins and the warnings."""

import math
import re
from collections.abc import Callable
from dataclasses import replace

from tools.common import paths
from tools.common.board_file import BoardFile
from tools.common.errors import Problems, UserError
from tools.common.motor_file import FACTS, Motor
from tools.common.param_rows import FOLLOWS, number, parameters

from . import constants, design_warnings, fw_tables, limits, loops, remedies, start
from .constants import number_of
from .design_result import Design, maximum_speed, plain, range_of, real, short, spread_of, with_bridge
from .limits import RPM, Envelope

ESDQ_HZ = 200.49
"""2000 at 50 us. AN1292's 1200, 119 Hz, is older than a load step allows."""
ESDQ_SHARE = 0.37
"""Least of the filter's corner over the top electrical frequency: the estimator's lock swings with sqrt(corner frequency) and a damping of half the
root of their ratio, 0.3. On the virtual board 200 Hz let the angle of a motor of 1167 Hz swing up when its speed changed."""
VELESTIM_HZ = 73.5
"""AN1292's 748 at 50 us."""
QUICK_ROTOR_S = 0.015
"""The speed filter's corner rises for a rotor that rated torque brings to rated speed in less than this, up to four times: otherwise the
thresholds see its speed too late."""
REFERENCE_RISE_S = 0.7
"""The speed reference goes from 0 to rated speed in this time, unless inertia asks for more."""
REFERENCE_TORQUE_SHARE = 0.3
BRAKE_SHARE, LIGHT_S = 0.4, 0.3
"""Beyond limits.UNIT_ERPM a light rotor's reference falls with this share of what friction alone would do: with a q current near zero dead time takes
from the quick lock more than it can bear, on the virtual board, and a supply that takes nothing back allows no larger braking current. Light is one
that rated torque brings to rated speed in less than LIGHT_S: a propeller (0.46 s), a spindle with its tool (0.42 s) and a scooter (3 s) kept their lock."""
TRIM_SHARE = 0.3
TRIM_SPEED_SHARE = 0.9
"""The voltage feedback's d current allows the rated torque up to this share of rated speed, where the current limit does."""
TRIM_WEAK_FLUX, TRIM_STRONG_FLUX = 0.8, 1.2
"""Flux over the header's at which the voltage feedback must still help, and for which it must be enough: the adaptation's tolerance."""
BOARD_KEYS = {"NOMINAL_BUS_V": "supply.voltage", "LOOPTIME_SEC": "pwm.period", "DEADTIME_SEC": "pwm.dead_time", "SAMPLE_WINDOW_SEC": "pwm.sample_window",
              "NORM_CURRENT_CONST": "shunt.amplifier_gain", "BUS_FULL_SCALE_V": "adc.bus_divider", "OVER_VOLTAGE_V": "limits.over_voltage",
              "UNDER_VOLTAGE_V": "limits.under_voltage", "REGEN_LIMIT_V": "limits.regen"}
"""Parameters that the board file alone decides, with the key that they come from."""
SALIENT_FROM = number("PARAM_SALIENT_FROM")
ACCEL_MOST, ACCEL_LEAST = number("PARAM_ACCEL_MOST"), number("PARAM_ACCEL_LEAST")


def design(motor: Motor, board: BoardFile) -> Design:
    """Everything. Refuses by UserError what cannot work; what works with a cost is in `.warnings`."""
    problems = Problems()
    motor, bridge_ohm = with_bridge(motor, board)
    currents = limits.fit_emf(motor, board, limits.currents(motor, board))
    d = Design(motor, board, Envelope(motor, limits.circle_v(board), currents.maximum_a), bridge_ohm=bridge_ohm)
    _motor(d)
    _board(d)
    _refuse_impossible(d, currents, problems)
    problems.tell()
    _speeds(d)
    _currents(d, currents)
    _loops_and_start(d)
    _field_weakening(d)
    for name, row in parameters().items():
        if name not in d.choices and row.default not in FOLLOWS:
            d.put(name, row.default, "the default")
    found = constants.header(d.params)
    _check(d, found.wrong)
    d.constants = found.constants
    margins, of_start = design_warnings.margins(d), design_warnings.of_start(d)
    d.warnings += [*design_warnings.of_numbers(d, currents), *margins, *design_warnings.of_running(d), *of_start]
    d.start_risks = [*of_start, *margins]
    return d


# ---- what cannot work ------------------------------------------------------------------------------------------------------

def _refuse_impossible(d: Design, currents: limits.Currents, problems: Problems) -> None:
    """All that motor and board cannot do together; the voltage only where the other numbers are right."""
    m, e = d.motor, d.envelope

    def refuse(what: str, where: str, remedy: str) -> None:
        problems.found.append(UserError(what, where, remedy))

    rated_erpm, largest_erpm = m.rated_speed_rpm * m.pole_pairs, limits.largest_erpm(d.board.pwm_period_s)
    if rated_erpm > largest_erpm:
        refuse(f"rated speed {m.rated_speed_rpm:g} rpm with {m.pole_pairs} pole pairs is {rated_erpm:.0f} electrical rpm", d.where("speed"),
                        f"the firmware's speeds end at {largest_erpm:.0f}{limits.of_period(largest_erpm)}; a speed of {math.floor(largest_erpm / m.pole_pairs)} rpm is possible")
    problems.attempt(lambda: _refuse_kphi(d))
    problems.attempt(lambda: _refuse_light(d))
    half = 0.5 * m.rated_torque_nm
    needed_a = e.iq(m.rated_speed_rpm, half)
    if needed_a > currents.maximum_a:
        refuse(f"half the rated torque needs {needed_a:.2f} A peak, {currents.maximum_a:.2f} A are allowed", d.where("torque"),
               _current_remedy(d, currents, needed_a))
    if not problems.found and e.least_id(m.rated_speed_rpm, half, limits.FULL_SHARE) is None:
        refuse(f"{d.board.nominal_bus_v:g} V are too low for {m.rated_speed_rpm:g} rpm at half the rated torque", d.where("speed"), _voltage_remedy(d, half))
    for name, key, value in (("MOTOR_RS_OHM", "resistance", m.rs_ohm - d.bridge_ohm), ("MOTOR_LS_MH", "inductance", 1e3 * m.lq_h)):
        low, high = range_of(name)
        if not low <= value <= high:
            refuse(f"{name} = {value:.4g} is outside {low:g} .. {high:g}", d.where(key), f"it follows from [electrical] {key}; change that")


def _voltage_remedy(d: Design, torque_nm: float) -> str:
    """What to change where the voltage is too low for a torque at rated speed."""
    m, e = d.motor, d.envelope

    needed_v = remedies.needed_supply(m, d.board, _reaches(m, torque_nm))
    found = remedies.either(remedies.raise_supply(needed_v if needed_v <= remedies.MOST_SUPPLY_V else None),
                            remedies.lower_rated_speed(e.highest_speed(torque_nm, limits.FULL_SHARE), m))
    return found or f"the motor needs {needed_v:g} V, the firmware's supply ends at {remedies.MOST_SUPPLY_V:g} V: take another winding"


def _reaches(m: Motor, torque_nm: float) -> Callable[[Envelope], bool]:
    """Whether an envelope has a torque at rated speed."""
    return lambda x: x.least_id(m.rated_speed_rpm, torque_nm, limits.FULL_SHARE) is not None


def _current_remedy(d: Design, currents: limits.Currents, needed_a: float) -> str:
    """What to change where half the rated torque needs more than is allowed: that depends on who allows no more."""
    m, board_a = d.motor, currents.board_a
    if needed_a > board_a:
        carried_nm = m.kt_nm_per_a * board_a - d.envelope.friction_nm(m.rated_speed_rpm)
        who, more = "the board carries", f", or use a board with a larger current range than {d.board.current_full_scale_a:.3g} A (smaller shunt or gain)"
        if board_a >= remedies.MOST_CURRENT_A:
            who, more = "the firmware's largest MAXIMUM_CURRENT_A carries", ""
        return f"lower [rating] torque and current to what {who}, {limits.digits_down(max(carried_nm, 1e-4), 2):g} N m and {board_a:g} A peak{more}"
    if needed_a > m.maximum_current_a:
        return remedies.maximum_current(m, "raise", limits.digits_up(needed_a, 3))
    return "with more current R I + L dI/dt leave the back-EMF's number format: lower maximum_speed, or raise the supply voltage"


def _speed_v(d: Design) -> float:
    """What half the rated torque at rated speed needs, so that one change of the supply is enough; 0 where the current does not allow that torque."""
    m, half = d.motor, 0.5 * d.motor.rated_torque_nm
    return remedies.needed_supply(m, d.board, _reaches(m, half)) if d.envelope.iq(m.rated_speed_rpm, half) <= limits.currents(m, d.board).maximum_a else 0.0


def _refuse_kphi(d: Design) -> None:
    """1/Kphi has 16 bits: the electrical speed at full voltage must be 2048 .. 65534 counts."""
    counts = d.scales.invkfi
    least = range_of("INVKFI_SPEED0")[0]
    if counts < least:
        needed_v = math.ceil(max(d.board.nominal_bus_v * least / counts, _speed_v(d)))
        end = "" if needed_v <= remedies.MOST_SUPPLY_V else f", but the firmware's supply ends at {remedies.MOST_SUPPLY_V:g} V: take another winding"
        raise UserError(f"1/Kphi has only {counts:.0f} counts for {d.motor.kphi_v_per_krpm:.4g} V/krpm and {d.motor.pole_pairs} pole pairs, {least:g} is the least",
                        d.where("kphi"), f"the motor is too slow for {d.board.nominal_bus_v:g} V: use at least {needed_v} V{end}")
    if counts >= 32767.0:
        raise UserError(f"1/Kphi does not fit 16 bits: {counts:.0f} counts for {d.motor.kphi_v_per_krpm:.4g} V/krpm and {d.motor.pole_pairs} pole pairs",
                        d.where("kphi"), f"the motor is too fast for {d.board.nominal_bus_v:g} V: use at most {math.floor(d.board.nominal_bus_v * 32766.0 / counts)} V")


def _refuse_light(d: Design) -> None:
    """A count of current must accelerate the rotor by a number that the load observer holds."""
    if "MOTOR_INERTIA_KGM2" in d.motor.tune:
        return
    accel, inertia = d.scales.acceleration, d.value("MOTOR_INERTIA_KGM2")
    if accel >= ACCEL_MOST:
        raise UserError(f"the load observer cannot count the acceleration of {inertia:.3g} kg m2 by {d.board.current_full_scale_a:.3g} A", d.where("inertia"),
                        f"add at least {limits.digits_up(inertia * (accel / ACCEL_MOST - 1.0) * 1.001 + 1e-12, 2):g} kg m2 of [load] inertia, or use a board with at most "
                        f"{limits.digits_down(0.999 * d.board.current_full_scale_a * ACCEL_MOST / accel, 2):g} A of current range")
    if accel < ACCEL_LEAST:
        raise UserError(f"the load observer cannot count the acceleration of {inertia:.3g} kg m2 by {d.board.current_full_scale_a:.3g} A", d.where("inertia"),
                        f"{limits.digits_down(0.999 * inertia * accel / ACCEL_LEAST, 2):g} kg m2 of rotor and load are possible")


def _check(d: Design, wrong: list[str]) -> None:
    """Ranges and relations of the build, in its own words, each with the file that it is about."""
    problems = Problems()
    for message in wrong:
        what, _, remedy = message.partition(": ")
        names = re.findall(r"[A-Z][A-Z0-9_]{3,}", what)
        tuned = any(name in d.motor.tune for name in names)
        on_board = next((d.board.quantities[BOARD_KEYS[name]].where for name in names[:1] if name in BOARD_KEYS), "")
        where = f"{paths.shown(d.motor.path)} [tune]" if tuned else on_board or str(paths.shown(d.motor.path))
        problems.found.append(UserError(what, where, remedy or _range_remedy(d, what.partition(" ")[0])))
    problems.tell()


def _range_remedy(d: Design, name: str) -> str:
    """What to change where a parameter is outside its range."""
    if name in d.motor.tune or name not in FACTS:
        return "change the motor file or the board file"
    if name == "MAXIMUM_CURRENT_A":
        p = parameters()[name]
        return f"set [rating] maximum_current to {p.low} .. {p.high} A peak"
    return f"it follows from {FACTS[name]}; change that"


# ---- motor and board ---------------------------------------------------------------------------------------------------------

def _motor(d: Design) -> None:
    m = d.motor
    d.put("NOPOLESPAIRS", str(m.pole_pairs), "motor file")
    d.put("MOTOR_RS_OHM", plain(m.rs_ohm - d.bridge_ohm), "motor file; per phase of the star")
    if d.bridge_ohm:
        d.put("BRIDGE_RS_OHM", plain(d.bridge_ohm), "board file: a transistor and half of the shunt, where they are more than a tenth of the winding")
    d.put("MOTOR_LS_MH", plain(m.lq_h * 1e3), "motor file; per phase of the star" + (
        ", of the q axis: with Lq in Equation 4 the salient motor's back-EMF lies on the q axis whatever the current, with Ld or a mean "
        "its angle would turn with the torque" if m.salient else ""))
    d.put("MOTOR_SALIENCY_UH", *_saliency(m, d.envelope.maximum_a))
    d.put("MOTOR_KPHI_V_PER_KRPM", plain(m.kphi_v_per_krpm), "motor file")
    d.put("MOTOR_INERTIA_KGM2", short(m.inertia_kgm2 + m.load_inertia_kgm2), "motor file" + (", rotor and load" if m.load_inertia_kgm2 else ""))


def _saliency(m: Motor, maximum_a: float) -> tuple[str, str]:
    """MOTOR_SALIENCY_UH, and why: where the largest current changes the flux by an eighth."""
    difference_h = m.lq_h - m.ld_h
    if difference_h * maximum_a * SALIENT_FROM < 1.001 * m.psi_vs:
        return "0", "motor file" + ("; the largest current would change the flux by less than an eighth" if m.salient else "")
    return str(round(difference_h * 1e6)), "motor file; Lq - Ld per phase of the star"


def _board(d: Design) -> None:
    b = d.board
    for name, text in (("NOMINAL_BUS_V", real(b.nominal_bus_v)), ("LOOPTIME_SEC", plain(b.pwm_period_s)), ("DEADTIME_SEC", plain(b.dead_time_s)),
                       ("NORM_CURRENT_CONST", plain(b.current_full_scale_a / 32768.0, 7)), ("KCURRA", plain(b.current_gain)),
                       ("KCURRB", plain(b.current_gain)), ("BUS_FULL_SCALE_V", real(b.bus_full_scale_v)),
                       ("SAMPLE_WINDOW_SEC", plain(b.sample_window_s)), ("OVER_VOLTAGE_V", real(b.over_voltage_v)),
                       ("UNDER_VOLTAGE_V", real(b.under_voltage_v)), ("REGEN_LIMIT_V", real(b.regen_limit_v))):
        d.put(name, text, "board file")
    esdq_hz = max(ESDQ_HZ, ESDQ_SHARE * maximum_speed(d)[0] * d.motor.pole_pairs / 60.0)
    d.put("KFILTER_ESDQ", str(constants.filter_k(esdq_hz, b.pwm_period_s)), f"{esdq_hz:.0f} Hz at this PWM period" + (
        "" if esdq_hz == ESDQ_HZ else f", {ESDQ_SHARE:g} of the top electrical frequency") + "; at low speed the firmware lowers it")
    d.put("KFILTER_ESDQ_FW", str(constants.filter_k(esdq_hz, b.pwm_period_s)),
          "the same: AN1292's 16 Hz would let the angle swing, and it is not needed since the back-EMF has range enough")
    rise_s = _rise_s(d.motor)
    faster = min(max(QUICK_ROTOR_S / rise_s, 1.0), 4.0)
    d.put("KFILTER_VELESTIM", str(constants.filter_k(faster * VELESTIM_HZ, b.pwm_period_s)), f"{faster * VELESTIM_HZ:.0f} Hz at this PWM period, " + (
        "AN1292's corner" if faster == 1.0 else f"{faster:.2g} times AN1292's corner: rated torque brings the rotor to rated speed in {rise_s * 1e3:.2g} ms"))


def _rise_s(m: Motor) -> float:
    """Time in which rated torque brings rotor and load to rated speed."""
    return (m.inertia_kgm2 + m.load_inertia_kgm2) * m.rated_speed_rpm * RPM / m.rated_torque_nm


# ---- speeds and currents -------------------------------------------------------------------------------------------------------

def _speeds(d: Design) -> None:
    m = d.motor
    nominal = min(m.rated_speed_rpm, math.floor(d.nominal_erpm / m.pole_pairs))
    d.put("NOMINAL_SPEED_RPM", plain(nominal), "rated speed" + ("" if nominal == m.rated_speed_rpm else f", lowered to {d.nominal_erpm:.0f} electrical rpm"))
    maximum, why = maximum_speed(d)
    d.put("MAXIMUM_SPEED_RPM", plain(maximum), why)
    inertia = m.inertia_kgm2 + m.load_inertia_kgm2
    slope = min(m.rated_speed_rpm / REFERENCE_RISE_S, REFERENCE_TORQUE_SHARE * m.rated_torque_nm / inertia / RPM, 60000.0)
    friction = BRAKE_SHARE * d.envelope.friction_nm(0.5 * m.rated_speed_rpm) / inertia / RPM
    quick = maximum * m.pole_pairs > limits.UNIT_ERPM and 0.0 < friction < slope and _rise_s(m) < LIGHT_S
    d.put("SPEEDREFRAMP_RPM_PER_S", plain(limits.digits_down(max(friction if quick else slope, 1.0), 2)), (
        f"{BRAKE_SHARE:.0%} of what friction alone slows it: a quick, light motor must not be without q current" if quick else
        f"rated speed in {REFERENCE_RISE_S:g} s, or J dw/dt at most {REFERENCE_TORQUE_SHARE:.0%} of rated torque"))


def _currents(d: Design, currents: limits.Currents) -> None:
    m, maximum = d.motor, currents.maximum_a
    why = "motor file's maximum_current"
    if maximum < limits.currents(m, d.board).maximum_a:
        why = "lowered until the back-EMF's number format holds voltage + R I + L dI/dt"
    elif m.maximum_current_a > currents.board_a:
        why = ("the firmware's largest" if currents.board_a >= remedies.MOST_CURRENT_A else
               f"what this board can measure with a margin to its trip level ({currents.board_a:g} A)")
    d.put("MAXIMUM_CURRENT_A", plain(maximum), why)
    lowered = currents.trip_a < limits.currents(m, d.board).trip_a
    d.put("OVER_CURRENT_THRESHOLD_A", plain(currents.trip_a), f"{limits.TRIP_OVER_MAXIMUM:g} times the largest current, at most "
          f"{limits.TRIP_SHARE:.1%} of the converter's {d.board.current_full_scale_a:.3g} A" + (
          "; lowered until the back-EMF's number format holds voltage + R I + L dI/dt at the trip level" if lowered else ""))
    told = m.thermal_time_s > 0.0
    d.put("I2T_CURRENT_A", plain(min(m.rated_current_a, maximum)) if told else "0", "rated current" if told else "the motor file gives no thermal_time")
    d.put("I2T_TIME_SEC", plain(m.thermal_time_s) if told else "60", "motor file's thermal_time" if told else "not used")
    full = d.envelope.id_for(TRIM_SPEED_SHARE * m.rated_speed_rpm, m.rated_torque_nm)
    strong = replace(d.envelope, motor=replace(m, psi_vs=TRIM_STRONG_FLUX * m.psi_vs))
    half = strong.id_for(m.rated_speed_rpm, 0.5 * m.rated_torque_nm)
    useful = d.envelope.least_voltage_id(TRIM_SPEED_SHARE * m.rated_speed_rpm) * TRIM_WEAK_FLUX
    trim = limits.digits_down(max(TRIM_SHARE * maximum, min(max(-full, -half), -useful)), 2)
    d.put("FW_TRIM_CURRENT_A", real(trim), f"{TRIM_SHARE:.0%} of the largest current, or what rated torque needs at {TRIM_SPEED_SHARE:.0%} of rated speed "
          f"({abs(full):.2f} A) or half of it at rated speed with {TRIM_STRONG_FLUX - 1.0:.0%} more flux ({abs(half):.2f} A), as far as the largest current allows; "
          f"no more than {abs(useful):.2f} A, beyond which d current asks for more voltage than it saves with {1.0 - TRIM_WEAK_FLUX:.0%} less flux")


# ---- loops and start -----------------------------------------------------------------------------------------------------------

def _loops_and_start(d: Design) -> None:
    m, period = d.motor, d.board.pwm_period_s
    d.current_loop = d.current_loop_at(d.value("MAXIMUM_SPEED_RPM"))
    bandwidth = d.current_loop.bandwidth_hz
    cap = f"1/{1 / loops.CURRENT_CAP:.0f} of the PWM frequency"
    d.put("CURRENT_BANDWIDTH_HZ", plain(bandwidth), (
        f"the largest up to {cap} (a converter step would shake the voltage more, and nothing outside needs it) with "
        if bandwidth <= loops.CURRENT_CAP / period else f"above {cap}, because the rotation at top speed takes the margin below: the least with ")
        + f"{loops.PHASE_MARGIN_DEG:.0f} degrees of phase margin over the parameter set")
    if m.salient:
        d.put("D_CURRCNTR_PTERM", plain(2.0 * math.pi * bandwidth * m.ld_h * d.scales.ampere_per_volt / 16.0, 5), "2 pi f Ld: the d axis has its own inductance")
        d.put("Q_CURRCNTR_PTERM", plain(2.0 * math.pi * bandwidth * m.lq_h * d.scales.ampere_per_volt / 16.0, 5), "2 pi f Lq")
    _refuse_inertia(d, d.scales.speed_pterm_per_hz)
    problems = Problems()
    problems.attempt(lambda: _refuse_hidden(d))
    problems.attempt(lambda: _refuse_coarse(d))
    problems.tell()
    d.gains = loops.current_gains(d.plant, bandwidth, d.filter_gains)
    _start(d)
    _speed_loop(d, d.gains)


def _speed_loop(d: Design, gains: loops.Gains) -> None:
    m, names = d.motor, {"minimum speed": "MINIMUM_SPEED_RPM", "nominal speed": "NOMINAL_SPEED_RPM", "maximum speed": "MAXIMUM_SPEED_RPM"}
    speeds = {label: d.envelope.omega(d.value(name)) for label, name in names.items()}
    (low, high), (least_load, most_load) = range_of("SPEED_BANDWIDTH_HZ"), range_of("LOAD_BANDWIDTH_HZ")
    quickest = loops.load_bandwidth(gains, constants.filter_hz(d.value("KFILTER_ESDQ"), gains.period_s), d.value("CURRENT_BANDWIDTH_HZ"))
    calm = loops.calm_load_bandwidth(d.scales.large_counts, d.scales.acceleration, d.value("MAXIMUM_CURRENT_A") / d.scales.count_a, gains.period_s)
    cap = loops.speed_cap(_friction_over_lost(d))
    loop = loops.design_speed(d.plant, spread_of(m), gains, speeds, max(low, min(high, 0.98 / d.scales.speed_pterm_per_hz)),
                              max(least_load, min(most_load, limits.digits_down(min(quickest, calm), 2))), m.tune.get("SPEED_BANDWIDTH_HZ"), m.tune.get("LOAD_BANDWIDTH_HZ"), cap)
    d.speed_loop, d.calm_hz = loop, loops.calm_bandwidth(loop.load_hz, min(speeds.values()), cap)
    asked = ", ".join(f"{degrees:.0f} degrees {mode}" for mode, (degrees, _) in loops.SPEED_MARGINS.items())
    d.put("LOAD_BANDWIDTH_HZ", plain(loop.load_hz), f"as quick as back-EMF filter, current loop and slow step let it be ({quickest:.0f} Hz), and the inertia ({calm:.0f} Hz), lowered until the "
          f"speed loop has its phase margins from the minimum to the maximum speed ({asked})")
    d.put("SPEED_BANDWIDTH_HZ", plain(loop.bandwidth_hz), f"{cap:.2g} of the electrical frequency from which it is in full ({d.calm_hz:.3g} Hz: above, the "
          "dead time may make an unloaded motor hunt), or what the gain's format holds")


def _friction_over_lost(d: Design) -> float:
    """Current that friction takes at half the rated speed, over what dead time loses of a current."""
    m = d.motor
    friction_a = (m.coulomb_nm + m.viscous_nms * 0.5 * m.rated_speed_rpm * limits.RPM) / (1.5 * m.pole_pairs * m.psi_vs)
    return friction_a / (d.scales.lost_counts * d.scales.count_a)


def _slow_hz(d: Design) -> float:
    return loops.SLOW_SHARE * d.motor.rated_speed_rpm * d.motor.pole_pairs / 60.0


def _refuse_hidden(d: Design) -> None:
    """What turns without load must show in the current; a file that tells no friction is believed."""
    ratio, least, lost_a = _friction_over_lost(d), loops.hidden_limit(_slow_hz(d)), d.scales.lost_counts * d.scales.count_a
    if not 0.0 < ratio < least:
        return
    dead_s, chokes_mh = 0.999 * d.board.dead_time_s * ratio / least, d.motor.lq_h * 1e3 * (least / ratio - 1.0)
    shorter = f"[pwm] dead_time of {limits.digits_down(dead_s, 2) * 1e6:g} us, or " if dead_s >= range_of("DEADTIME_SEC")[0] else ""
    raise UserError(f"dead time loses {lost_a:.2g} A, friction takes only {ratio * lost_a:.2g} A: without load the speed would wander", d.board.quantities["pwm.dead_time"].where,
                    f"{shorter}chokes of {limits.digits_up(1.001 * chokes_mh, 2):g} mH in each phase, added to the motor's inductance")


def _refuse_coarse(d: Design) -> None:
    """A step of the converter must not turn the rotor off its speed."""
    m, step_a = d.motor, 2.0 * d.board.current_full_scale_a / 2 ** d.board.adc_bits
    rpm_s = m.kt_nm_per_a * 0.5 * step_a / (m.inertia_kgm2 + m.load_inertia_kgm2) / limits.RPM
    share = rpm_s / (2.0 * math.pi * _slow_hz(d)) / (loops.SLOW_SHARE * m.rated_speed_rpm)
    if share > loops.STEP_SHARE_MOST:
        raise UserError(f"half a step of the converter, {0.5 * step_a:.2g} A, turns the rotor {share:.0%} off its speed at {loops.SLOW_SHARE:.0%} of the rated one", d.where("inertia"),
                        f"use a board with at most {limits.digits_down(d.board.current_full_scale_a * loops.STEP_SHARE_MOST / share, 2):g} A of current range")


def _refuse_inertia(d: Design, gain_at_1_hz: float) -> None:
    """The speed gain grows with the inertia: at the least bandwidth it must still fit its number."""
    least_hz, _ = range_of("SPEED_BANDWIDTH_HZ")
    if gain_at_1_hz * least_hz >= 1.0 and "SPEED_BANDWIDTH_HZ" not in d.motor.tune:
        inertia = d.value("MOTOR_INERTIA_KGM2")
        raise UserError(f"the speed gain exceeds its Q format with {inertia:.3g} kg m2 even at SPEED_BANDWIDTH_HZ = {least_hz:g}",
                        d.where("load_inertia" if d.motor.load_inertia_kgm2 else "inertia"),
                        f"{limits.digits_down(0.98 * inertia / (gain_at_1_hz * least_hz), 2):g} kg m2 of rotor and load are possible with {d.board.current_full_scale_a:.3g} A of "
                        "current range; a larger one gives room for more")


def _start(d: Design) -> None:
    m = d.motor
    s = d.start_up = d.start_of(m, d.value("MAXIMUM_CURRENT_A"))
    d.put("Q_CURRENT_REF_OPENLOOP", plain(s.current_a), f"{start.CURRENT_SHARE:.0%} of the rated current with the trip level at least {start.TRIP_HEADROOM:g} times that, or (load + friction)/(Kt {start.LOAD_ANGLE_SINE:g}): "
          f"pull-out torque {s.pull_out_nm:.3g} N m for {s.needed_nm:.3g} N m")
    d.put("END_SPEED_RPM", plain(s.end_speed_rpm), f"back-EMF {s.emf_v:.2f} V: its error, {s.error_v:.2f} V (R {start.R_ERROR:.0%} wrong, "
          f"{start.DEAD_TIME_ERROR:.0%} of the dead time, one converter step), turns the angle by 20 degrees")
    d.put("MINIMUM_SPEED_RPM", plain(s.minimum_speed_rpm), f"the rotor is held from {s.lowest_speed_rpm:.0f} rpm: back-EMF "
          f"{start.LOWEST_SHARE:g} of the dead-time voltage")
    d.put("LOCK_TIME", str(2 * round(s.lock_s / d.board.pwm_period_s / 2.0)), f"{start.LOCK_SWINGS:.0f} swings of the rotor at the full current "
          f"({s.natural_hz:.0f} Hz, damping {s.damping:.3f}), at least {start.LEAST_LOCK_S:g} s; thrown back at {s.trial.back_rpm:.0f} rpm at most")
    d.put("OPENLOOP_RAMPSPEED_INCREASERATE", str(s.rate), f"{s.ramp_s:.1f} s to END_SPEED_RPM; J dw/dt at most {start.RAMP_TORQUE_SHARE:.0%} of the pull-out torque")


# ---- field weakening -----------------------------------------------------------------------------------------------------------

def _field_weakening(d: Design) -> None:
    start_rpm = limits.fw_start_rpm(d.envelope, d.value("MAXIMUM_SPEED_RPM"))
    d.put("FW_START_SPEED_RPM", plain(start_rpm), f"7/8 of the no-load base speed {d.envelope.base_speed(0.0):.0f} rpm, but at most 95 % of the maximum speed, and 18 "
          "entries reach that")
    known = {name: number_of(text) for name, text in d.params.items() if text != "NORM_INVKFIBASE"}
    tables, reason = fw_tables.load_for(fw_tables.names_of(d.motor), known | {"NORM_INVKFIBASE": d.scales.invkfi})
    if reason:
        d.warnings.append(reason)
    rows = {f"IDREF_SPEED{i}": f"{i_d:.2f}" for i, i_d in enumerate(limits.table(d.envelope, d.value("FW_START_SPEED_RPM")))}
    rows |= {name: row.default for name, row in parameters().items() if row.stem in ("INVKFI_SPEED", "LS_OVER2LS0_SPEED")}
    d.tables_from = "the motor's voltage equation"
    why = f"least d current that keeps the voltage within {limits.TABLE_SHARE:.0%} of its circle without load"
    if tables is not None and "FW_START_SPEED_RPM" not in d.motor.tune:
        rows, d.tuned_by_machine = tables.parameters(), True
        why = f"from {tables.origin}" if tables.origin else "found on the virtual board"
        d.tables_from = f"{paths.shown(tables.path or fw_tables.path_of(fw_tables.names_of(d.motor)[0]))}, {why}{'' if tables.origin else ' by make tune-fw'}"
    for name, text in rows.items():
        d.put(name, text, why)
