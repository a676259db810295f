"""From engineering values to counts: the note's spreadsheet as a pure function, and the firmware's own constants.

The sheet is AN1292's tuning_params.xls with the published exponents. The firmware's constants repeat include/drive/param_scaling.h and
param_init.h in single precision, bit for bit (a test compiles the header and compares), and once more in double precision: the
difference between the two is the rounding error that the tables show.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

LARGEST_Q15 = 32767

# ---- the note's sheet -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SheetInputs:
    """What the sheet asks for; R and L per phase. An exponent of None is chosen: the note's, or the next larger one that fits."""

    peak_voltage_v: float
    """DC-link voltage"""
    peak_current_a: float
    """current at full scale, 32768 counts"""
    pwm_period_s: float
    dead_time_s: float
    pole_pairs: int
    rs_ohm: float
    ls_h: float
    kphi_v_per_krpm: float
    """V peak line to line per 1000 mechanical rpm"""
    nominal_speed_rpm: float
    maximum_speed_rpm: float
    rs_exponent: int | None = None
    ls_exponent: int | None = None
    invkfi_exponent: int | None = None


@dataclass(frozen=True)
class Scaled:
    """One constant of the sheet: stored = raw / 2^exponent, and the right shift of a product with it that undoes both."""

    raw: float
    """in Q15, before the pre-division"""
    exponent: int
    stored: int
    shift: int
    """of the 32-bit product: 15 - exponent"""

    @property
    def fits(self) -> bool:
        return 0 < self.stored <= LARGEST_Q15

    @property
    def rounding_percent(self) -> float:
        """Error of the stored value."""
        return 100.0 * (self.stored * 2.0 ** self.exponent / self.raw - 1.0)


@dataclass(frozen=True)
class SheetOutputs:
    """The sheet's results; counts in the note's formats."""

    u0_v: float
    """V per count"""
    i0_a: float
    """A per count"""
    omega0: float
    """rad/s per rpm"""
    norm_rs: Scaled
    norm_lsdtbase: Scaled
    """its shift is for the one-sample difference; three more for the eight-sample one"""
    norm_invkfibase: Scaled
    norm_deltat: Scaled
    d_ilimit_hs: int
    """counts a period, with the note's factor 2 (the firmware uses pi and the largest current)"""
    d_ilimit_ls: int
    """counts in eight periods"""


NOTE_EXPONENTS = {"rs": 1, "ls": 8, "invkfi": 1}
"""Pre-divisions by 2, 256 and 2."""


def choose_exponent(raw: float, least: int = 0) -> int:
    """The smallest exponent from `least` on with which the rounded value fits 16 bits: small keeps the rounding error small."""
    exponent = least
    while _nearest(raw / 2.0 ** exponent) > LARGEST_Q15:
        exponent += 1
    return exponent


def _nearest(x: float) -> int:
    return math.floor(x + 0.5)


def _scaled(raw: float, exponent: int | None, least: int) -> Scaled:
    chosen = choose_exponent(raw, least) if exponent is None else exponent
    return Scaled(raw, chosen, _nearest(raw / 2.0 ** chosen), 15 - chosen)


def sheet(x: SheetInputs) -> SheetOutputs:
    """Equations 5, 6 and 8 in their corrected form, qDeltaT and the derivative limits.

    U0 = Vdc/sqrt(3) (1 - Td/Ts)/2^15, I0 = Ipeak/2^15, RS = R I0/U0 2^15, LSDT = L/Ts I0/U0 2^15, INVKFI = sqrt(3) 1000 P U0/Kphi 2^15.
    """
    u0 = x.peak_voltage_v / math.sqrt(3.0) * (1.0 - x.dead_time_s / x.pwm_period_s) / 32768.0
    i0 = x.peak_current_a / 32768.0
    rate = x.pwm_period_s * 32768.0 / 60.0 * x.pole_pairs
    return SheetOutputs(
        u0, i0, 2.0 * math.pi / 60.0,
        _scaled(x.rs_ohm * i0 / u0 * 32768.0, x.rs_exponent, NOTE_EXPONENTS["rs"]),
        _scaled(x.ls_h / x.pwm_period_s * i0 / u0 * 32768.0, x.ls_exponent, NOTE_EXPONENTS["ls"]),
        _scaled(math.sqrt(3.0) * 1000.0 * x.pole_pairs * u0 / x.kphi_v_per_krpm * 32768.0, x.invkfi_exponent, NOTE_EXPONENTS["invkfi"]),
        _scaled(x.pwm_period_s / 60.0 * 65536.0 * 32768.0, 0, 0),
        _nearest(2.0 * x.maximum_speed_rpm * rate), _nearest(8.0 * 2.0 * x.nominal_speed_rpm * rate))


# ---- the firmware's constants ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Constant:
    """A number that the firmware computes with."""

    group: str
    name: str
    """a macro of param_scaling.h, or a field of drive_params_t"""
    value: float
    """engineering value that it stands for"""
    unit: str
    q_format: str
    """what one is in counts: "Q13 A" is 8192 counts for full-scale current"""
    q_value: int
    error_percent: float
    """of the Q value against the exact one; 0 where both are 0"""
    meaning: str

    @property
    def expression(self) -> str:
        """The same number in C, for a drive_params_t p."""
        return self.name if self.name.isupper() else f"p.{self.name}"


Number = Callable[[Any], Any]


def number_of(text: str | float) -> float:
    """The value of a define: a C number."""
    if isinstance(text, str):
        return float(int(text, 0)) if text.lower().startswith("0x") else float(text)
    return float(text)


class Formulas:
    """param_scaling.h, macro by macro and in its order of operations, in single precision (np.float32) or exactly (float)."""

    def __init__(self, params: Mapping[str, str | float], number: Number) -> None:
        self.params = params
        self.n = number
        self.pi = number(3.14159265) if number is np.float32 else math.pi
        self.sqrt3 = number(1.73205081) if number is np.float32 else math.sqrt(3.0)
        self.u0 = self["NOMINAL_BUS_V"] / self.sqrt3 * (number(1) - self["DEADTIME_SEC"] / self["LOOPTIME_SEC"]) / number(32768)
        self.iu = self["NORM_CURRENT_CONST"] / self.u0

    def __getitem__(self, name: str) -> Any:
        """PARAM_F(name)"""
        if name not in self.params:
            return self._derived(name)
        if self.params[name] == "NORM_INVKFIBASE":
            return self.n(nearest(self.invkfi()))
        return self.n(number_of(self.params[name]))

    def _derived(self, name: str) -> Any:
        """What param_scaling.h derives where userparams.h does not define it."""
        n = self.n
        if name in ("D_CURRCNTR_PTERM", "Q_CURRCNTR_PTERM"):
            return self["D_CURRCNTR_PTERM"] if name[0] == "Q" else (
                n(2) * self.pi * self["CURRENT_BANDWIDTH_HZ"] * self["MOTOR_LS_MH"] * n(0.001) * self.iu / n(16))
        if name in ("D_CURRCNTR_ITERM", "Q_CURRCNTR_ITERM"):
            return self["D_CURRCNTR_ITERM"] if name[0] == "Q" else (
                n(2) * self.pi * self["CURRENT_BANDWIDTH_HZ"] * self["MOTOR_RS_OHM"] * self["LOOPTIME_SEC"] * self.iu)
        if name == "SPEEDCNTR_PTERM":
            return (n(2) * self.pi * self["SPEED_BANDWIDTH_HZ"] * self["MOTOR_INERTIA_KGM2"] / self.kt()
                    * (n(2) * self.pi / n(60)) / self["NOPOLESPAIRS"] / self["NORM_CURRENT_CONST"] / n(16))
        if name == "SPEEDCNTR_ITERM":
            return self["SPEEDCNTR_PTERM"] * n(32) / n(3) * self.pi * self["SPEED_BANDWIDTH_HZ"] * self["LOOPTIME_SEC"]
        if name.endswith("_CTERM"):
            return n(0.999)
        raise KeyError(name)

    def kt(self) -> Any:
        """PARAM_KT, N m per A peak"""
        n = self.n
        return n(1.5) * self["MOTOR_KPHI_V_PER_KRPM"] / self.sqrt3 * n(60) / (n(2000) * self.pi)

    def rs(self, scale: float) -> Any:
        return self["MOTOR_RS_OHM"] * self.iu * self.n(scale)

    def ls(self, scale: float) -> Any:
        return self["MOTOR_LS_MH"] * self.n(0.001) / self["LOOPTIME_SEC"] * self.iu * self.n(scale)

    def invkfi(self) -> Any:
        n = self.n
        return self.sqrt3 * n(1000) * self["NOPOLESPAIRS"] * self.u0 / self["MOTOR_KPHI_V_PER_KRPM"] * n(16384)

    def erpm(self, name: str, divisor: float = 1.0) -> Any:
        rpm = self[name]
        return (rpm if divisor == 1.0 else rpm / self.n(divisor)) * self["NOPOLESPAIRS"]

    def q13(self, name: str) -> Any:
        """CURRENT_Q13, unrounded"""
        return self[name] / self["NORM_CURRENT_CONST"] / self.n(4)

    def q14(self, name: str) -> Any:
        return self[name] / self["NORM_CURRENT_CONST"] / self.n(2)

    def bus(self, voltage: Any) -> Any:
        """BUS_Q15, unrounded"""
        return voltage / self["BUS_FULL_SCALE_V"] * self.n(32768)

    def di(self, name: str) -> Any:
        """PARAM_DI: change of a sine of the largest current in a period, Q14"""
        n = self.n
        return (n(2) * self.pi * self[name] / n(60) * self["NOPOLESPAIRS"] * self["LOOPTIME_SEC"] * self.q14("MAXIMUM_CURRENT_A"))

    def emf_max_v(self) -> Any:
        """PARAM_EMF_MAX_V"""
        n = self.n
        speed = max(self["MAXIMUM_SPEED_RPM"], n(1.5) * self["NOMINAL_SPEED_RPM"])
        return (self["OVER_VOLTAGE_V"] / self.sqrt3 + n(2) / self.sqrt3 * self["OVER_CURRENT_THRESHOLD_A"] * self["MOTOR_RS_OHM"]
                + n(2) * self.pi / n(60) * speed * self["NOPOLESPAIRS"] * n(1.2) * self["MOTOR_LS_MH"] * n(0.001) * self["MAXIMUM_CURRENT_A"])

    def periods(self, time: Any) -> Any:
        return time / self["LOOPTIME_SEC"]

    def slots(self, time_s: float) -> Any:
        return self.n(time_s) * self.slots_per_s()

    def slots_per_s(self) -> Any:
        return self.n(1) / (self.n(8) * self["LOOPTIME_SEC"])

    def ticks(self, name: str) -> Any:
        return self[name] / self.n(0.000000025)

    def full_duty(self) -> int:
        return nearest(self.ticks("LOOPTIME_SEC"))

    def top_duty(self) -> int:
        return self.full_duty() - 2 * nearest(self.ticks("SAMPLE_WINDOW_SEC"))

    def knee(self) -> int:
        return int(self.n(1.1) * self.n(nearest(self.ticks("DEADTIME_SEC"))))

    def voltage_per_bus(self) -> Any:
        n = self.n
        return n(self.top_duty()) / n(self.full_duty()) / self.sqrt3 * self["BUS_FULL_SCALE_V"] / self.u0 / n(2)

    def duty_numerator(self) -> Any:
        n = self.n
        return n(self.full_duty()) * n(4) * self.u0 / self["BUS_FULL_SCALE_V"] * n(4294967296)


def nearest(x: Any) -> int:
    """PARAM_ROUND: half away from zero, added in the number's own precision."""
    half = type(x)(0.5)
    return int(x - half) if x < 0 else int(x + half)


def half_up(x: Any) -> int:
    """(uint16_t)(x + 0.5F)"""
    return int(x + type(x)(0.5))


def _q15(x: Any) -> int:
    """Q15(): negative * 32768, positive * 32767."""
    n = type(x)
    return int(x * n(32768) - n(0.5)) if x < 0 else int(x * n(32767) + n(0.5))


def exponent_of(full: Any) -> int:
    """PARAM_EXP: how often a 16-bit constant is halved so that it fits."""
    return 0 if full < 65535 else 1 if full < 131071 else 2 if full < 262143 else 3


class _Table:
    """Collects constants: the same formula evaluated twice."""

    def __init__(self, params: Mapping[str, str | float]) -> None:
        self.single, self.exact = Formulas(params, np.float32), Formulas(params, float)
        self.rows: list[Constant] = []
        self.group = ""

    def value(self, name: str) -> float:
        return float(self.exact[name])

    def add(self, name: str, unit_value: tuple[float, str], q_format: str, raw: Callable[[Formulas], Any], meaning: str,
            rounded: Callable[[Any], int] = nearest) -> None:
        q_value, exact = rounded(raw(self.single)), float(raw(self.exact))
        if rounded is _q15:
            exact *= 32768.0
        error = 0.0 if exact == 0.0 else 100.0 * (q_value / exact - 1.0)
        self.rows.append(Constant(self.group, name, unit_value[0], unit_value[1], q_format, q_value, error, meaning))

    def count(self, name: str, unit_value: tuple[float, str], q_value: int, meaning: str, q_format: str = "count") -> None:
        self.rows.append(Constant(self.group, name, unit_value[0], unit_value[1], q_format, q_value, 0.0, meaning))


def firmware_constants(params: Mapping[str, str | float]) -> list[Constant]:
    """Every number that the firmware derives from these parameters, by name as in userparams.h."""
    t = _Table(params)
    for group, rows in (("motor", _motor), ("estimator", _estimator), ("speeds", _speeds), ("current and speed controllers", _controllers),
                        ("start", _start), ("limits", _limits), ("modulator and bus", _modulator), ("field weakening", _field_weakening)):
        t.group = group
        rows(t)
    return t.rows


def _motor(t: _Table) -> None:
    rs, ls, kphi, period = t.value("MOTOR_RS_OHM"), t.value("MOTOR_LS_MH"), t.value("MOTOR_KPHI_V_PER_KRPM"), t.value("LOOPTIME_SEC")
    rs_exp, ls_exp = exponent_of(t.single.rs(32768)), exponent_of(t.single.ls(4096) * np.float32(1.2))
    t.add("NORM_RS", (rs, "ohm"), "Q15 / 2", lambda f: min(f.rs(16384), f.n(32767)), "Equation 5, the note's constant, at most 32767")
    t.add("NORM_LSDTBASE", (ls, "mH"), "Q15 / 256", lambda f: min(f.ls(128), f.n(32767)), "Equation 5, the note's constant, at most 32767")
    t.add("NORM_INVKFIBASE", (kphi, "V/krpm"), "Q15 / 2, 1/Kphi", lambda f: f.invkfi(), "Equation 6")
    t.add("NORM_DELTAT", (period, "s"), "Q15 of a turn/erpm", lambda f: f["LOOPTIME_SEC"] / f.n(60) * f.n(2147483648), "Equation 1, the note's constant")
    t.add("estimator.rs_q16", (rs, "ohm"), f"Q16 / {1 << rs_exp}", lambda f: f.rs(32768) / f.n(1 << rs_exp), "R of the estimator", half_up)
    t.count("estimator.rs_exp", (1 << rs_exp, "1"), rs_exp, "the product is shifted left by it")
    t.add("fieldweak.ls_base_q16", (ls, "mH"), f"Q16 / {1 << ls_exp}", lambda f: f.ls(4096) / f.n(1 << ls_exp), "L of the estimator, eight samples", half_up)
    t.count("estimator.ls_exp", (1 << ls_exp, "1"), ls_exp, "the product is shifted left by it")


def _estimator(t: _Table) -> None:
    period = t.value("LOOPTIME_SEC")
    t.add("estimator.deltat_q32", (period, "s"), "Q32 of a turn/erpm", lambda f: f["LOOPTIME_SEC"] / f.n(60) * f.n(4294967296), "angle a period")
    t.add("estimator.half_step_q16_rad", (period / 2, "s"), "Q16 rad/erpm", lambda f: f["LOOPTIME_SEC"] * f.pi / f.n(60) * f.n(4294967296), "half of it")
    amperes = t.value("NORM_CURRENT_CONST") * 2.0
    least = min(8.0 * float(t.exact.di("NOMINAL_SPEED_RPM")), 16383.0)
    most = min(float(t.exact.di("MAXIMUM_SPEED_RPM")), 4095.0)
    t.add("estimator.d_ilimit_ls_q14", (least * amperes, "A"), "Q14 A", lambda f: min(f.n(8) * f.di("NOMINAL_SPEED_RPM"), f.n(16382.5)),
          "D_ILIMIT_LS: change in eight periods", half_up)
    t.add("estimator.d_ilimit_hs_q14", (most * amperes, "A"), "Q14 A", lambda f: min(f.di("MAXIMUM_SPEED_RPM"), f.n(4094.5)),
          "D_ILIMIT_HS: change in a period", half_up)
    t.count("D_ILIMIT_LS", (least * amperes, "A"), 2 * t.rows[-2].q_value, "the same in the note's format", "Q15 A")
    t.count("D_ILIMIT_HS", (most * amperes, "A"), 2 * t.rows[-2].q_value, "the same in the note's format", "Q15 A")
    for name, field in (("KFILTER_ESDQ", "fieldweak.kfilter_esdq_q16"), ("KFILTER_ESDQ_FW", "fieldweak.kfilter_esdq_fw_q16"),
                        ("KFILTER_VELESTIM", "estimator.kfilter_velestim_q16")):
        t.count(field, (filter_hz(t.value(name), period), "Hz"), 2 * int(t.value(name)), "Equation 7", "Q16 a period")


def filter_hz(k_q15: float, period_s: float) -> float:
    """Corner of y += K (x - y): 1 - K = exp(-2 pi f Ts)."""
    return -math.log(1.0 - k_q15 / 32768.0) / (2.0 * math.pi * period_s)


def filter_k(corner_hz: float, period_s: float) -> int:
    """K in Q15 for a corner frequency."""
    return _nearest(32768.0 * (1.0 - math.exp(-2.0 * math.pi * corner_hz * period_s)))


def _speeds(t: _Table) -> None:
    def speed(field: str, name: str, meaning: str, divisor: float = 1.0) -> None:
        t.add(field, (t.value(name) / divisor, "rpm"), "erpm", lambda f: f.erpm(name, divisor), meaning)

    speed("minimum_erpm", "MINIMUM_SPEED_RPM", "potentiometer at zero")
    speed("nominal_erpm", "NOMINAL_SPEED_RPM", "potentiometer at full scale, S3 off")
    speed("maximum_erpm", "MAXIMUM_SPEED_RPM", "potentiometer at full scale, S3 on")
    speed("end_erpm", "END_SPEED_RPM", "end of the ramp")
    speed("fieldweak.on_speed_erpm", "FW_START_SPEED_RPM", "field weakening starts")
    speed("estimator.nominal_erpm", "NOMINAL_SPEED_RPM", "one-sample derivative above")
    speed("estimator.decimate_erpm", "NOMINAL_SPEED_RPM", "sign of Equation 2 from the filtered speed below", 10.0)
    t.add("speed_ramp_erpm", (t.value("SPEEDREFRAMP_RPM_PER_S"), "rpm/s"), "erpm in 8 periods",
          lambda f: f["SPEEDREFRAMP_RPM_PER_S"] * f["NOPOLESPAIRS"] / f.slots_per_s(), "slope of the reference, rounded up",
          lambda x: nearest(x + type(x)(0.49)))
    t.add("tuning_step_q16", (t.value("TUNING_DELAY_RAMPUP"), "periods"), "Q16 erpm in 8 periods",
          lambda f: f.n(8) * f.n(65536) / (f["TUNING_DELAY_RAMPUP"] + f.n(1)), "slope in TUNING")
    t.add("ramp_hold_erpm", (t.value("NOMINAL_SPEED_RPM") / 8, "rpm"), "erpm", lambda f: f["NOMINAL_SPEED_RPM"] * f["NOPOLESPAIRS"] / f.n(8),
          "the ramp waits when the motor is further behind")
    t.add("overspeed_erpm", (min(t.value("MAXIMUM_SPEED_RPM") * 1.25, 32700 / t.value("NOPOLESPAIRS")), "rpm"), "erpm",
          lambda f: min(f["MAXIMUM_SPEED_RPM"] * f["NOPOLESPAIRS"] * f.n(1.25), f.n(32700)), "lost lock above")


def _controllers(t: _Table) -> None:
    volt_per_amp = 16.0 / float(t.exact.iu)
    period, iu = t.value("LOOPTIME_SEC"), float(t.exact.iu)
    for axis in ("d", "q"):
        stem = f"{axis.upper()}_CURRCNTR_"
        t.add(f"pi_{axis}.kp", (t.value(stem + "PTERM") * volt_per_amp, "V/A"), "Q15 / 16", lambda f, s=stem: f[s + "PTERM"] * f.n(32768), "proportional gain")
        t.add(f"pi_{axis}.ki", (t.value(stem + "ITERM") / iu / period, "V/(A s)"), "Q11 a period", lambda f, s=stem: f[s + "ITERM"] * f.n(2048), "integral gain")
        t.add(f"pi_{axis}.kc", (t.value(stem + "CTERM"), "1"), "Q15", lambda f, s=stem: f[s + "CTERM"], "anti-windup", _q15)
    gain = t.value("SPEEDCNTR_PTERM") * 16.0 * t.value("NORM_CURRENT_CONST") * t.value("NOPOLESPAIRS")
    integral = t.value("SPEEDCNTR_ITERM") * t.value("NORM_CURRENT_CONST") * t.value("NOPOLESPAIRS") / period
    t.add("pi_speed.kp", (gain, "A/rpm"), "Q15 / 16", lambda f: f["SPEEDCNTR_PTERM"] * f.n(32768), "proportional gain")
    t.add("pi_speed.ki", (integral, "A/(rpm s)"), "Q14 in 8 periods", lambda f: f["SPEEDCNTR_ITERM"] * f.n(16384), "integral gain")
    t.add("pi_speed.kc", (t.value("SPEEDCNTR_CTERM"), "1"), "Q15", lambda f: f["SPEEDCNTR_CTERM"], "anti-windup", _q15)


def _start(t: _Table) -> None:
    period = t.value("LOOPTIME_SEC")
    lock = int(t.value("LOCK_TIME"))
    t.add("forced.end_speed_q10", (t.value("END_SPEED_RPM"), "rpm"), "Q10 angle counts a period",
          lambda f: f["END_SPEED_RPM"] * f["NOPOLESPAIRS"] * f["LOOPTIME_SEC"] / f.n(60) * f.n(67108864), "end of the ramp")
    rate = int(t.value("OPENLOOP_RAMPSPEED_INCREASERATE"))
    t.count("forced.increase_rate_q10", (rate / 67108864.0 / period ** 2 * 60.0 / t.value("NOPOLESPAIRS"), "rpm/s"), rate, "acceleration", "Q10 counts/period^2")
    t.count("lock_periods", (lock * period, "s"), lock, "lock", "periods")
    t.count("lock_sweep_q32", (90.0 / (lock / 2 * period), "deg/s"), 0x40000000 // (lock // 2), "first half of the lock", "Q32 of a turn a period")
    t.add("open_loop_q13", (t.value("Q_CURRENT_REF_OPENLOOP"), "A"), "Q13 A", lambda f: f.q13("Q_CURRENT_REF_OPENLOOP"), "current of lock and ramp")
    t.add("bootstrap_periods", (0.010, "s"), "periods", lambda f: f.periods(f.n(0.010)), "low sides on before the start")
    for field, time_s, meaning in (("ready_slots", 0.02, "agreement before the hand-over"), ("ready_timeout_slots", 0.2, "and how long it may take")):
        t.add(field, (time_s, "s"), "8 periods", lambda f, x=time_s: f.slots(x), meaning)


def _limits(t: _Table) -> None:
    for field, name, meaning in (("current_max_q13", "MAXIMUM_CURRENT_A", "current vector that is asked for"),
                                 ("overcurrent_q13", "OVER_CURRENT_THRESHOLD_A", "phase current that trips"),
                                 ("fieldweak.trim_max_q13", "FW_TRIM_CURRENT_A", "most that the voltage feedback adds")):
        t.add(field, (t.value(name), "A"), "Q13 A", lambda f, x=name: f.q13(x), meaning)
    t.add("current_max_reciprocal", (t.value("MAXIMUM_CURRENT_A"), "A"), "2^25 / Q13", lambda f: f.n(33554432) / f.q13("MAXIMUM_CURRENT_A"),
          "its reciprocal", half_up)
    for field, name, meaning in (("bus_over_q15", "OVER_VOLTAGE_V", "trips"), ("bus_under_q15", "UNDER_VOLTAGE_V", "trips"),
                                 ("bus_regen_q15", "REGEN_LIMIT_V", "braking is reduced from here"), ("bus_nominal_q15", "NOMINAL_BUS_V", "supply")):
        t.add(field, (t.value(name), "V"), "Q15 of full scale", lambda f, x=name: f.bus(f[x]), meaning)
    t.add("brake_per_bus_q8", (t.value("MAXIMUM_CURRENT_A") / 2.0, "A/V"), "Q8",
          lambda f: f.n(256) * f.n(nearest(f.q13("MAXIMUM_CURRENT_A"))) / f.n(nearest(f.bus(f.n(2)))), "braking current taken off a volt", half_up)
    for field, time_s, meaning in (("stall_slots", 0.3, "stall"), ("lost_lock_slots", 0.05, "lost lock")):
        t.add(field, (time_s, "s"), "8 periods", lambda f, x=time_s: f.slots(x), meaning)


def _modulator(t: _Table) -> None:
    n = np.float32
    dead, knee = nearest(t.single.ticks("DEADTIME_SEC")), t.single.knee()
    t.add("svm.full", (t.value("LOOPTIME_SEC") * 1e6, "us"), "25 ns", lambda f: f.ticks("LOOPTIME_SEC"), "duty of 100 %")
    t.count("svm.top", (100.0 * t.single.top_duty() / t.single.full_duty(), "%"), t.single.top_duty(), "highest duty: sampling window", "duty")
    t.add("svm.dead_time", (t.value("DEADTIME_SEC") * 1e6, "us"), "25 ns", lambda f: f.ticks("DEADTIME_SEC"), "dead-time compensation")
    t.count("svm.knee_q13", (knee * 4 * t.value("NORM_CURRENT_CONST"), "A"), knee, "current from which it is full", "Q13 A")
    t.count("svm.dead_slope_q16", (dead / knee, "1"), nearest(n(dead) / n(knee) * n(65536)), "duty per current", "Q16")
    t.count("svm.turn_q13", (float(t.exact.di("MAXIMUM_SPEED_RPM")) * 2 * t.value("NORM_CURRENT_CONST"), "A"),
            int(t.single.di("MAXIMUM_SPEED_RPM") / n(2)), "most that a current turns in a period", "Q13 A")
    t.add("voltage_limit_per_bus_q16", (t.single.top_duty() / t.single.full_duty() / math.sqrt(3.0), "V/V"), "Q14 V per Q16 bus",
          Formulas.voltage_per_bus, "voltage circle", int)
    t.add("duty_per_volt_numerator", (t.value("BUS_FULL_SCALE_V"), "V"), "Q32", Formulas.duty_numerator, "duty per volt at bus 1", int)
    for field, name in (("kcurr_a", "KCURRA"), ("kcurr_b", "KCURRB")):
        t.add(field, (t.value(name), "1"), "Q15", lambda f, x=name: f[x], "gain of the samples", _q15)


def _field_weakening(t: _Table) -> None:
    t.add("fieldweak.margin_q14", (t.value("NOMINAL_BUS_V") * 0.01, "V"), "Q14 V", lambda f: f["NOMINAL_BUS_V"] * f.n(0.01) / f.u0 / f.n(2),
          "voltage kept free before the feedback acts")
    t.add("fieldweak.trim_speed_erpm", (t.value("FW_START_SPEED_RPM") * 0.6, "rpm"), "erpm",
          lambda f: f["FW_START_SPEED_RPM"] * f["NOPOLESPAIRS"] * f.n(0.6), "speed from which it acts")
    kphi = t.value("MOTOR_KPHI_V_PER_KRPM") * float(t.exact.invkfi())
    for i in range(18):
        t.add(f"fieldweak.idref_q13[{i}]", (t.value(f"IDREF_SPEED{i}"), "A"), "Q13 A", lambda f, x=i: f.q13(f"IDREF_SPEED{x}"), "d current")
        inv_kfi = nearest(t.single[f"INVKFI_SPEED{i}"])
        t.count(f"fieldweak.inv_kfi[{i}]", (kphi / inv_kfi, "V/krpm"), inv_kfi, "1/Kphi", "Q15 / 2, 1/Kphi")
        t.add(f"fieldweak.ls_over2ls0_q15[{i}]", (t.value(f"LS_OVER2LS0_SPEED{i}"), "1"), "Q15",
              lambda f, x=i: f[f"LS_OVER2LS0_SPEED{x}"] * f.n(32768), "Ls/(2 Ls0)")
