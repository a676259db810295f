"""What works with a cost: each warning says what it is, what it costs and what to change, by file key and value."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from tools.bench import reach
from tools.common.board_file import TABLES
from tools.common.motor_file import Motor

from . import limits, load_onset, remedies, start
from .design_result import Design
from .limits import RPM, Envelope
from .remedies import either

ROUNDING_LIMIT_PERCENT = 0.1
MOTOR_CONSTANTS = {"adaptation.rs_base_q16": "MOTOR_RS_OHM", "fieldweak.ls_base_q16": "MOTOR_LS_MH", "NORM_INVKFIBASE": "MOTOR_KPHI_V_PER_KRPM"}
"""Constants that the estimator computes with: their rounding is an error of the motor's values."""
L_FREQUENCY_RATIO = 10.0
TORQUE_TOLERANCE = 0.25
"""Sheets round, and leave open what friction takes; a factor of sqrt(2) is more."""
NEAR_FACTOR = 0.08
MOST_INVKFI = 32766.0
"""Counts of 1/Kphi: a slower motor counts its speed finer."""
LONG_RAMP_S = 30.0
"""To the rated speed: a user who turns the potentiometer up waits for it."""
AT_ONCE_SHARE = 0.9
"""Of the drive's answer: the shipped motors' rotors, from 0.95 of it up, come back from each step of `make loadsteps`."""
HEAVIER_FACTORS = (1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 36.0)
KPHI_FACTORS = {math.sqrt(2.0): "peak and RMS", math.sqrt(3.0): "line to line and phase"}


def of_numbers(d: Design, currents: limits.Currents) -> list[str]:
    """Of the sheet's numbers, the board's and the formats'."""
    return [*_torque(d), *_currents(d, currents), *_speeds(d), *_numbers(d)]


def of_running(d: Design) -> list[str]:
    """What makes the motor slow, or lets it down under load."""
    return [*_slow_loop(d), *_slow_ramp(d), *_held(d), *_at_once(d)]


def warning(what: str, *ways: str) -> str:
    """What it is and what it costs; then the ways that help, as far as there are any."""
    return "; ".join(filter(None, (what, either(*ways))))


# ---- what the sheet's numbers say of each other ------------------------------------------------------------------------------
def shaft_nm(m: Motor, ampere: float) -> float:
    """What a current gives at most at rated speed, friction taken off."""
    e = Envelope(m, math.inf, ampere)
    most = max(1.5 * m.pole_pairs * (m.psi_vs + (m.ld_h - m.lq_h) * i_d) * math.sqrt(ampere ** 2 - i_d ** 2)
               for i_d in ([-ampere * k / 50.0 for k in range(50)] if m.salient else [0.0]))
    return most - e.friction_nm(m.rated_speed_rpm)


def _torque(d: Design) -> list[str]:
    """kphi, current and torque are one too many: two of them give the third."""
    m = d.motor
    given_nm, friction_nm = shaft_nm(m, m.rated_current_a), Envelope(m, math.inf, 1.0).friction_nm(m.rated_speed_rpm)
    if abs(given_nm / m.rated_torque_nm - 1.0) <= TORQUE_TOLERANCE:
        return []
    factor = (m.rated_torque_nm + friction_nm) / (given_nm + friction_nm)
    size = max(factor, 1.0 / factor)
    other = replace(d.envelope, motor=replace(m, psi_vs=factor * m.psi_vs)) # no kphi with which the voltage is too low
    kphi = f"set [electrical] kphi to {m.kphi_v_per_krpm * factor:.4g} V peak line-to-line/krpm"
    guess = next((f" (a factor of {size:.2f}: {names} confused?)" for known, names in KPHI_FACTORS.items() if abs(size / known - 1.0) < NEAR_FACTOR), "")
    return [warning(f"kphi and the rated current give {given_nm:.2g} N m at the shaft, the rated torque is {m.rated_torque_nm:.2g} N m: one of the three is wrong{guess}",
                    kphi if other.least_id(m.rated_speed_rpm, 0.5 * m.rated_torque_nm, limits.FULL_SHARE) is not None else "", f"set [rating] current to {m.rated_current_a * factor:.3g} A peak",
                    f"set [rating] torque to {given_nm:.3g} N m" if given_nm > 0.0 else "")]


# ---- currents ----------------------------------------------------------------------------------------------------------------
def _currents(d: Design, currents: limits.Currents) -> list[str]:
    return [*_largest_current(d, currents), *_rated_current(d, currents)]


def _largest_current(d: Design, currents: limits.Currents) -> list[str]:
    """Board, parameter or number format may allow less than the motor."""
    m, most = d.motor, currents.maximum_a
    lower = remedies.maximum_current(m, "lower", limits.digits_down(most, 3))
    if m.maximum_current_a > currents.board_a:
        if currents.board_a >= remedies.MOST_CURRENT_A:
            return [warning(f"maximum_current {m.maximum_current_a:.3g} A peak is above {remedies.MOST_CURRENT_A:g} A, the firmware's largest: MAXIMUM_CURRENT_A is {most:g}", lower)]
        return [warning(f"maximum_current {m.maximum_current_a:.3g} A peak is above what this board can measure and protect ({currents.board_a:g} A of "
                        f"{d.board.current_full_scale_a:.3g} A): MAXIMUM_CURRENT_A is {most:g}", remedies.widen_range(d.board, m.maximum_current_a) if remedies.format_holds(m, d.board, m.maximum_current_a) else "", lower)]
    if most < float(f"{m.maximum_current_a:.3g}"):
        return [warning(f"MAXIMUM_CURRENT_A is {most:g} instead of {m.maximum_current_a:.3g}: with more, R I + L dI/dt leave the back-EMF's number format",
                        *_format_ways(d, currents), lower)]
    return []


def _format_ways(d: Design, currents: limits.Currents) -> list[str]:
    """A lower top speed or a higher supply voltage with which the format holds the whole current."""
    m, b, wanted = d.motor, d.board, limits.currents(d.motor, d.board)

    def whole(motor: Motor, volt: float) -> bool:
        ratio = volt / b.nominal_bus_v
        board = replace(b, nominal_bus_v=volt, over_voltage_v=ratio * b.over_voltage_v)
        return limits.fit_emf(motor, board, wanted).maximum_a == wanted.maximum_a

    def with_top(rpm: float) -> bool:
        return whole(replace(m, maximum_speed_rpm=rpm), b.nominal_bus_v)
    ways = []
    if with_top(m.rated_speed_rpm):
        ways.append(f"lower [rating] maximum_speed to {limits.digits_down(limits.halved(with_top, m.rated_speed_rpm, m.maximum_speed_rpm, 20), 3):g} rpm")
    if whole(m, remedies.MOST_SUPPLY_V):
        below = limits.halved(lambda volt: not whole(m, volt), b.nominal_bus_v, remedies.MOST_SUPPLY_V, 20)
        ways.append(remedies.raise_supply(limits.digits_up(1.002 * below, 3)))
    return ways


def _rated_current(d: Design, currents: limits.Currents) -> list[str]:
    m, most = d.motor, currents.maximum_a
    if m.rated_current_a <= most:
        return []
    raised = [remedies.maximum_current(m, "raise", limits.digits_up(m.rated_current_a, 3))] if m.maximum_current_a < m.rated_current_a else []
    wider = m.rated_current_a > currents.board_a
    gain = remedies.widen_range(d.board, m.rated_current_a) if wider else ""
    possible = (gain or not wider) and remedies.format_holds(m, d.board, m.rated_current_a)
    torque_nm = limits.digits_down(max(shaft_nm(m, most), 1e-4), 3)
    less = torque_nm < m.rated_torque_nm
    torque = f" and [rating] torque to {torque_nm:g} N m" if less else ""
    costs = f": at most {m.kt_nm_per_a * most:.3g} N m of {m.rated_torque_nm:.3g} N m" if less else ""
    return [warning(f"rated current {m.rated_current_a:.3g} A peak is above MAXIMUM_CURRENT_A = {most:g}{costs}", " and ".join(filter(None, [gain, *raised])) if possible else "",
                    f"lower [rating] current to {limits.digits_down(most, 3):g} A peak{torque}")]


# ---- speeds ------------------------------------------------------------------------------------------------------------------
def _speeds(d: Design) -> list[str]:
    return [*(_rated_torque(d) or _soft_supply(d)), *_top_speed(d), *_nominal_speed(d), *_inductance(d)]


def _rated_torque(d: Design) -> list[str]:
    m, e, volt = d.motor, d.envelope, d.board.nominal_bus_v
    torque = e.torque(m.rated_speed_rpm, limits.FULL_SHARE)
    if torque >= 0.99 * m.rated_torque_nm or e.iq(m.rated_speed_rpm, m.rated_torque_nm) > e.maximum_a:
        return []
    enough = remedies.least_supply(e, d.board, lambda x: x.torque(m.rated_speed_rpm, limits.FULL_SHARE) >= m.rated_torque_nm)
    return [warning(f"{volt:g} V are too low for the rated torque at rated speed: about {torque:.2g} N m of {m.rated_torque_nm:.2g} N m at {m.rated_speed_rpm:g} rpm",
                    "raise the supply voltage" if enough else "",
                    remedies.lower_rated_speed(max(e.highest_speed(m.rated_torque_nm, limits.FULL_SHARE), 1.0), m))]


def _soft_supply(d: Design) -> list[str]:
    """Half the rated torque at rated speed, for which the supply's resistance may leave too little voltage."""
    m, e, volt, ohm = d.motor, d.envelope, d.board.nominal_bus_v, d.board.quantities["supply.resistance"].value_si
    half = 0.5 * m.rated_torque_nm

    def bus_v(rpm: float, supply_ohm: float) -> float:
        """V (U - V) / R is what winding, bridge, friction and load take."""
        i_q = e.iq(rpm, half)
        watt = 1.5 * m.rs_ohm * i_q ** 2 + m.kt_nm_per_a * i_q * rpm * RPM
        return 0.5 * (volt + math.sqrt(max(volt ** 2 - 4.0 * supply_ohm * watt, 0.0)))

    def holds(rpm: float, supply_ohm: float) -> bool:
        left = replace(e, circle_v=e.circle_v * bus_v(rpm, supply_ohm) / volt)
        return left.least_id(rpm, half, limits.FULL_SHARE) is not None
    if holds(m.rated_speed_rpm, ohm):
        return []
    slower = limits.halved(lambda rpm: holds(rpm, ohm), 1.0, m.rated_speed_rpm, 24)
    enough = limits.digits_down(limits.halved(lambda less: holds(m.rated_speed_rpm, less), 0.0, ohm, 24), 2)
    least = TABLES["supply"]["resistance"].kind.minimum
    return [warning(f"{ohm:g} ohm of the supply leave {bus_v(m.rated_speed_rpm, ohm):.3g} V of {volt:g} V with half the rated torque at rated speed, which is not enough",
                    f"lower [supply] resistance to {enough:g} ohm in the board file" if enough >= least else "", remedies.lower_rated_speed(slower, m))]


def _top_speed(d: Design) -> list[str]:
    m, e, most = d.motor, d.envelope, d.value("MAXIMUM_SPEED_RPM")
    if most >= math.floor(m.maximum_speed_rpm):
        return []
    lower, what = f"lower [rating] maximum_speed to {most:g} rpm", f"maximum_speed {m.maximum_speed_rpm:g} rpm is not reachable, MAXIMUM_SPEED_RPM is {most:g}"
    largest_erpm = limits.largest_erpm(d.board.pwm_period_s)
    if most * m.pole_pairs >= largest_erpm - m.pole_pairs:
        return [warning(f"{what}: {largest_erpm:.0f} electrical rpm are the firmware's end{limits.of_period(largest_erpm)}", lower)]

    def reaches(x: Envelope) -> bool:
        return x.highest_speed(0.0, limits.REACH_SHARE) >= 1.01 * m.maximum_speed_rpm
    board_a = limits.currents(replace(m, maximum_current_a=math.inf), d.board).board_a
    more = ""
    if board_a > e.maximum_a and reaches(replace(e, maximum_a=board_a)):
        needed = limits.halved(lambda ampere: not reaches(replace(e, maximum_a=ampere)), e.maximum_a, board_a, 20)
        needed = min(limits.digits_up(1.002 * needed, 3), board_a)
        more = remedies.maximum_current(m, "raise", needed) if remedies.format_holds(m, d.board, needed) else ""
    return [warning(f"{what}: {d.board.nominal_bus_v:g} V and {e.maximum_a:g} A reach no more", remedies.raise_supply(remedies.least_supply(e, d.board, reaches)), more, lower)]


def _nominal_speed(d: Design) -> list[str]:
    m, nominal = d.motor, d.value("NOMINAL_SPEED_RPM")
    if nominal >= m.rated_speed_rpm:
        return []
    return [warning(f"rated speed {m.rated_speed_rpm:g} rpm is above {d.nominal_erpm:.0f} electrical rpm: NOMINAL_SPEED_RPM is {nominal:g}, use S3 for the rest",
                    f"lower the rated speed to {nominal:g} rpm")]


def _inductance(d: Design) -> list[str]:
    m, measured = d.motor, d.motor.inductance_frequency_hz
    hz = m.rated_speed_rpm * m.pole_pairs / 60.0
    if measured is None or 1.0 / L_FREQUENCY_RATIO <= measured / hz <= L_FREQUENCY_RATIO:
        return []
    key = "inductance" if "inductance" in m.quantities else "inductance_d"
    return [warning(f"the inductance was measured at {measured:g} Hz, the motor turns at {hz:.0f} Hz electrical: iron and eddy currents make it differ",
                    f"measure [electrical] {key} at {limits.digits_up(hz, 2):g} Hz, or by make identify")]


# ---- number formats ------------------------------------------------------------------------------------------------------------
def _numbers(d: Design) -> list[str]:
    return [*_rounding(d), *_derivative(d)]


def _rounding(d: Design) -> list[str]:
    found = []
    for name, parameter in MOTOR_CONSTANTS.items():
        item = d.constant(name)
        if abs(item.error_percent) > ROUNDING_LIMIT_PERCENT:
            counts = 50.0 / ROUNDING_LIMIT_PERCENT / item.q_value # half a count is less than the limit then
            way = remedies.raise_supply(limits.digits_up(d.board.nominal_bus_v * counts, 2)) if parameter.startswith("MOTOR_KPHI") else \
                remedies.lower_gain(d.board, 0.99 / counts)
            found.append(warning(f"{parameter} = {d.choices[parameter].text} is rounded by {item.error_percent:+.2f} % ({name} = {item.q_value})", way))
    return found


def _derivative(d: Design) -> list[str]:
    found, m = [], d.motor
    fast = d.constant("svm.turn_q13").value / (2.0 * d.value("NORM_CURRENT_CONST"))
    slow = fast * d.constant("estimator.nominal_erpm").value / d.value("MAXIMUM_SPEED_RPM")
    for name, wanted, limit in (("D_ILIMIT_LS", 8.0 * slow, 16383.0), ("D_ILIMIT_HS", fast, 4095.0)):
        if wanted > 1.02 * limit:
            ampere = limits.digits_down(d.value("MAXIMUM_CURRENT_A") * limit / wanted, 3)
            found.append(warning(f"{name} ends at {limit:.0f} of the {wanted:.0f} counts that the largest current can change: the estimated angle lags at high current",
                                 remedies.maximum_current(m, "lower", ampere)))
    return found


# ---- loops -------------------------------------------------------------------------------------------------------------------
def margins(d: Design) -> list[str]:
    """Loops that have less than is asked of them, which may cost the start."""
    found = []
    for what, loop, name in (("current", d.current_loop, "CURRENT_BANDWIDTH_HZ"), ("speed", d.speed_loop, "SPEED_BANDWIDTH_HZ")):
        if loop and not loop.reached:
            name, value = ("LOAD_BANDWIDTH_HZ", loop.load_hz) if what == "speed" and "LOAD_BANDWIDTH_HZ" in d.motor.tune else (name, loop.bandwidth_hz)
            left = f"has {loop.worst.phase_deg:.0f} degrees and {loop.worst.gain_db:.0f} dB of margin" if loop.worst.stable else "is unstable"
            way = f"remove {name} from [tune]" if name in d.motor.tune else _slower_top(d) if what == "current" else _lighter(d, 0.5)
            found.append(warning(f"{name} = {value:g}: the {what} loop {left} at worst ({loop.worst_case}), {loop.worst.asked_deg:.0f} degrees and "
                                 f"{loop.worst.asked_db:.0f} dB are asked for", way))
    return found


def _slower_top(d: Design) -> str:
    """A top speed whose rotation leaves the current loop its margin."""
    m, top = d.motor, d.value("MAXIMUM_SPEED_RPM")
    rpm = limits.halved(lambda rpm: d.current_loop_at(rpm).reached, 0.0, top, 6)
    if rpm >= m.rated_speed_rpm:
        return f"lower [rating] maximum_speed to {limits.digits_down(rpm, 3):g} rpm"
    unit = 1 + (rpm * m.pole_pairs > limits.UNIT_ERPM) + 2 * (rpm * m.pole_pairs > 2.0 * limits.UNIT_ERPM)
    lower = remedies.lower_rated_speed(rpm, m) if d.scales.invkfi * d.scales.speed_unit / unit < MOST_INVKFI else ""
    return lower and f"{lower} and [rating] maximum_speed to {limits.digits_down(rpm, 2):g} rpm"


def _lighter(d: Design, factor: float) -> str:
    """This much of the inertia, where that leaves more than the rotor."""
    m = d.motor
    load = (m.inertia_kgm2 + m.load_inertia_kgm2) * factor - m.inertia_kgm2
    if m.load_inertia_kgm2 == 0.0:
        return ""
    return f"lower [load] inertia to {limits.digits_down(load, 2):g} kg m2" if load > 1e-9 else "remove [load] inertia"


def _slow_loop(d: Design) -> list[str]:
    loop = d.speed_loop
    if not loop or not loop.reached or loop.bandwidth_hz >= 0.5 * d.calm_hz:
        return []
    kind, way = " with so much inertia", _lighter(d, 0.98 * loop.bandwidth_hz / (0.5 * d.calm_hz))
    if "SPEED_BANDWIDTH_HZ" in d.motor.tune:
        kind, way = "", "remove SPEED_BANDWIDTH_HZ from [tune]"
    return [warning(f"the speed loop's {loop.bandwidth_hz:g} Hz are slow{kind} ({d.calm_hz:.2g} Hz would be calm): after a load step the speed comes back in "
                    f"{1.0 / loop.bandwidth_hz:.2g} s", way)]


def _slow_ramp(d: Design) -> list[str]:
    """A reference that takes long says why, and what makes it quicker."""
    rpm_s = d.value("SPEEDREFRAMP_RPM_PER_S")
    seconds = d.motor.rated_speed_rpm / rpm_s
    if seconds <= LONG_RAMP_S:
        return []
    way = "remove SPEEDREFRAMP_RPM_PER_S from [tune]" if "SPEEDREFRAMP_RPM_PER_S" in d.motor.tune else \
        f"set SPEEDREFRAMP_RPM_PER_S to {limits.digits_up(1.02 * d.motor.rated_speed_rpm / LONG_RAMP_S, 2):g} in [tune], if the load allows it"
    return [warning(f"SPEEDREFRAMP_RPM_PER_S = {rpm_s:g}: {seconds:.0f} s to the rated speed ({d.choices['SPEEDREFRAMP_RPM_PER_S'].why})", _lighter(d, 0.98 * LONG_RAMP_S / seconds), way)]


def _held(d: Design) -> list[str]:
    """What the shaft may carry at the lowest speed, on the speed loop's own model."""
    m, least = d.motor, d.value("MINIMUM_SPEED_RPM")
    torque = load_onset.asked_nm(d)
    if load_onset.holds(d, least, torque):
        return []
    rpm, held_nm = load_onset.lowest_rpm(d, torque), load_onset.most_nm(d, least, torque)
    if rpm is None:
        return [warning(f"a load of {torque:.3g} N m that comes within {load_onset.ONSET_S:g} s stops so light a rotor at every speed up to NOMINAL_SPEED_RPM = "
                        f"{d.value('NOMINAL_SPEED_RPM'):g}, before the drive answers", _heavier(d, torque))]
    stopped = _stopped_at_once(d)
    wanted = max(rpm, stopped.least_rpm) if stopped and stopped.least_rpm < d.value("NOMINAL_SPEED_RPM") else rpm # one number for both
    return [warning(f"MINIMUM_SPEED_RPM = {least:g}: a load of {torque:.3g} N m that comes within {load_onset.ONSET_S:g} s stops the rotor there, "
                    + (f"{held_nm:.2g} N m are held" if held_nm > 0.0 else "none is held"), f"set MINIMUM_SPEED_RPM to {wanted:g} in [tune]")]


@dataclass(frozen=True)
class AtOnce:
    """A rotor that a brake stops at this speed before the drive answers, and the speed from which on it does not."""

    rpm: float
    stops_s: float
    answers_s: float
    least_rpm: float


def _stopped_at_once(d: Design) -> AtOnce | None:
    """At the lowest speed that `make loadsteps` asks for; None where the drive answers in time."""
    m, nominal, torque = d.motor, d.value("NOMINAL_SPEED_RPM"), load_onset.asked_nm(d)
    answers_s, rpm = load_onset.answer_s(d), max(d.value("MINIMUM_SPEED_RPM"), load_onset.step_rpm(d))

    def stops_s(speed_rpm: float) -> float:
        return reach.stops_s({"mech.inertia_kgm2": d.inertia_kgm2, "mech.coulomb_nm": m.coulomb_nm, "mech.viscous_nms": m.viscous_nms}, speed_rpm, torque)
    if stops_s(rpm) >= AT_ONCE_SHARE * answers_s:
        return None
    return AtOnce(rpm, stops_s(rpm), answers_s, limits.digits_up(limits.halved(lambda speed: stops_s(speed) < answers_s, rpm, nominal, 20), 2))


def _at_once(d: Design) -> list[str]:
    """A brake that closes at once, as in `make loadsteps`: a rotor that it stops before the drive has an answer may not come back."""
    nominal, torque = d.value("NOMINAL_SPEED_RPM"), load_onset.asked_nm(d)
    if not load_onset.holds(d, nominal, torque): # told by _held
        return []
    if (stopped := _stopped_at_once(d)) is None:
        return []
    heavier = limits.digits_up(1.02 * d.inertia_kgm2 * stopped.answers_s / stopped.stops_s - d.motor.inertia_kgm2, 2)
    return [warning(f"a brake that closes at once with {torque:.3g} N m stops so light a rotor at {stopped.rpm:g} rpm in {1e3 * stopped.stops_s:.2g} ms, the drive answers in "
                    f"{1e3 * stopped.answers_s:.2g} ms, and the speed may not come back",
                    f"set MINIMUM_SPEED_RPM to {stopped.least_rpm:g} in [tune]" if stopped.least_rpm < nominal else f"raise [load] inertia to {heavier:g} kg m2")]


def _heavier(d: Design, load_nm: float) -> str:
    """More inertia that gives the drive the time which it needs at the nominal speed."""
    heavy = (factor * d.inertia_kgm2 for factor in HEAVIER_FACTORS)
    found = next((inertia for inertia in heavy if load_onset.holds(d, d.value("NOMINAL_SPEED_RPM"), load_nm, inertia)), None)
    return f"raise [load] inertia to {limits.digits_up(found - d.motor.inertia_kgm2, 2):g} kg m2" if found else ""


# ---- start -------------------------------------------------------------------------------------------------------------------
def of_start(d: Design) -> list[str]:
    """What the start's trial has found; each way was tried on it."""
    s, m = d.start_up, d.motor
    if not s or s.trial is None:
        return []
    if not s.follows:
        lost = [label for label, ok in zip(s.trial.labels, s.trial.followed) if not ok]
        return [warning(f"the rotor may not follow the ramp ({len(lost)} of {len(s.trial.labels)} start angles and loads, e.g. {lost[0]})",
                        *start_ways(d, lambda x: x.follows))]
    if not s.loud:
        return []
    why = ": with so little inductance the current's sample, after the pulse's centre, feeds the swing" if s.damping < 0.0 else ""
    return [warning(f"the unloaded rotor still swings by {s.trial.swing_rpm:.0f} rpm when the estimator takes over at {s.end_speed_rpm:g} rpm, and may fail "
                    f"to start from some angles{why}", *start_ways(d, lambda x: x.follows and x.trial.swing_rpm < start.CALMER_SHARE * x.end_speed_rpm))]


TRIED_SHARES = (0.8, 0.6, 0.4, 0.2, 0.1)
"""Of a load, from the least change on."""
TRIED_FACTORS = (1.15, 1.3, 1.6, 2.0)
CHOKE_FACTORS = (1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
TRIED_FRICTION = (0.01, 0.02, 0.04, 0.08)
"""Of the rated torque."""


def start_ways(d: Design, good: Callable[[start.StartDesign], bool]) -> list[str]:
    """Each change of one key that makes the start good, with the first value that does."""
    m, most = d.motor, d.value("MAXIMUM_CURRENT_A")

    def tried(values: list[float], changed: Callable[[float], Motor], maximum_a: Callable[[float], float] = lambda _: most) -> float | None:
        return next((value for value in values if good(d.start_of(changed(value), maximum_a(value)))), None)

    ways = [f"remove {name} from [tune]" for name in start.NAMES if name in m.tune
            and good(d.start_of(replace(m, tune={key: value for key, value in m.tune.items() if key != name}), most))]
    if m.coulomb_nm == 0.0:
        found = tried([limits.digits_up(share * m.rated_torque_nm, 2) for share in TRIED_FRICTION], lambda value: replace(m, coulomb_nm=value))
        ways += [f"add [mechanical] coulomb_friction, which the no-load current gives: {found:g} N m is enough"] if found else []
    if m.load_inertia_kgm2 > 0.0:
        found = tried([limits.digits_down(share * m.load_inertia_kgm2, 2) for share in TRIED_SHARES], lambda value: replace(m, load_inertia_kgm2=value))
        ways += [f"lower [load] inertia to {found:g} kg m2"] if found else []
    if m.start_torque_nm > 0.0:
        found = tried([limits.digits_down(share * m.start_torque_nm, 2) for share in TRIED_SHARES], lambda value: replace(m, start_torque_nm=value))
        ways += [f"{'lower' if 'start_torque' in m.quantities else 'set'} [load] start_torque to {found:g} N m"] if found else []
    board_a = limits.currents(replace(m, maximum_current_a=math.inf), d.board).board_a
    if most < board_a and d.start_up.current_a > 0.97 * most:
        raised = [limits.digits_down(min(factor * most, board_a), 3) for factor in TRIED_FACTORS]
        found = tried(raised, lambda value: replace(m, maximum_current_a=value), lambda value: value)
        ways += [remedies.maximum_current(m, "raise", found)] if found else []
    if d.start_up.damping < 0.0 and not m.salient:
        found = tried([limits.digits_up(factor * m.lq_h, 2) for factor in CHOKE_FACTORS], lambda value: replace(m, ld_h=value, lq_h=value))
        ways += [f"raise [electrical] inductance to {found * 1e3:g} mH phase by chokes in the motor's leads"] if found else []
    ends = [limits.digits_up(factor * d.start_up.end_speed_rpm, 2) for factor in TRIED_FACTORS]
    found = tried([rpm for rpm in ends if rpm <= d.value("NOMINAL_SPEED_RPM")], lambda value: replace(m, tune=m.tune | {"END_SPEED_RPM": value})) if not ways else None
    return ways + ([f"set END_SPEED_RPM to {found:g} in [tune]"] if found else [])
