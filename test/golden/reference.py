"""Reference of the control law: float64 for the mathematics, exact integers for the target's word lengths and rounding.

Every block comes twice. The function named `..._real` is the equation itself in float64. The one without is the same
equation in integers, with the formats that the headers of include/control document: a product is exact, its "upper word"
is floor(product / 65536), and every intermediate result is checked against the word it has to fit. Nothing wraps, except
where a format says so (angles). Equation numbers are AN1292's in their corrected form, see docs/law.md.
"""

import cmath
import math
from dataclasses import dataclass, field

SQRT3 = math.sqrt(3.0)
WORD = 65536


# ---- words, products, rounding --------------------------------------------------------------------------------------

def word(low, high):
    """A function that returns its argument, which must fit the word."""
    def fits(x):
        if not low <= x <= high:
            raise OverflowError(f"{x} does not fit {low}..{high}")
        return x
    return fits


s16 = word(-32768, 32767)
u16 = word(0, 65535)
s32 = word(-(1 << 31), (1 << 31) - 1)


def wrap16(x):
    """x as a signed word, modulo 65536: angles only."""
    return (x + 32768) % WORD - 32768


def upper(x):
    """Upper word of a double word: rounds toward minus infinity."""
    return s32(x) // WORD


def share(x, factor):
    """x * factor / 65536 by the upper word of the exact product; either may be an unsigned word."""
    return s16(x * factor // WORD)


def clamp(x, low, high):
    return max(low, min(high, x))


def magnitude(x):
    """|x| in a signed word: -32768 has no counterpart and gives 32767."""
    return min(abs(s16(x)), 32767)


def nearest(x):
    """Nearest integer, halves away from zero."""
    return int(math.floor(abs(x) + 0.5)) * (1 if x >= 0 else -1)


def q15(x):
    """Q15 of a fraction as AN1292 rounds it: positive by 32767, negative by 32768, then half up and truncated."""
    return int(x * 32768 - 0.5) if x < 0 else int(x * 32767 + 0.5)


def polynomial_checksum(values, start=0):
    """Checksum that a 16-bit target computes cheaply: s = 31 s + low word of the value, modulo 2^32."""
    s = start
    for v in values:
        s = (31 * s + v % WORD) % (1 << 32)
    return s


# ---- Equation 7, the first-order low-pass ---------------------------------------------------------------------------

def lowpass(y_q16, x, k_q16):
    """y += K (x - y): y has 16 fraction bits, K is Q16; the difference uses the whole counts of y."""
    return s32(y_q16 + k_q16 * (x - upper(y_q16)))


def lowpass_real(y, x, k):
    return y + k * (x - y)


def lowpass_corner_hz(k, sample_hz):
    """-3 dB frequency of y += K (x - y): |K / (1 - (1-K) z^-1)|^2 = 1/2 solved for the frequency."""
    a = 1.0 - k
    return sample_hz / (2 * math.pi) * math.acos((1 + a * a - 2 * k * k) / (2 * a))


# ---- sine, cosine, circle -------------------------------------------------------------------------------------------

SINE_STEPS = 128
SINE_AMPLITUDE = 32757  # interpolation by the derivative overshoots by (pi/128)^2/2 = 0.03 %, ten counts
CIRCLE_STEPS = 64


def sine_table():
    return [nearest(SINE_AMPLITUDE * math.sin(2 * math.pi * i / SINE_STEPS)) for i in range(SINE_STEPS)]


def circle_table():
    """sqrt(1 - (i/64)^2) with 1 = 32767, rounded down; exact by the integer square root."""
    n = CIRCLE_STEPS
    return [math.isqrt(32767 * 32767 * (n * n - i * i) // (n * n)) for i in range(n + 1)]


_SINE = sine_table()
_CIRCLE = circle_table()
_RADIANS_OF_STEP = nearest(2 * math.pi / SINE_STEPS * WORD)


def sincos(angle):
    """sin(a + x) = sin a + x cos a about the nearest table point a; x in radians * 65536."""
    step = WORD // SINE_STEPS
    point = (angle + step // 2) // step
    rest = angle - point * step  # -256..255 counts
    x = share(rest * (WORD // step), _RADIANS_OF_STEP)
    s = _SINE[point % SINE_STEPS]
    c = _SINE[(point + SINE_STEPS // 4) % SINE_STEPS]
    return s16(s + share(c, x)), s16(c - share(s, x))


def sincos_real(angle):
    a = 2 * math.pi * angle / WORD
    return 32767 * math.sin(a), 32767 * math.cos(a)


def circle(x):
    """sqrt(1 - x^2), the chord between two table points."""
    step = 32768 // CIRCLE_STEPS
    i, rest = divmod(x, step)
    return s16(_CIRCLE[i] - (_CIRCLE[i] - _CIRCLE[i + 1]) * rest // step)


def circle_real(x):
    return 32767 * math.sqrt(1 - (x / 32768) ** 2)


# ---- transformations ------------------------------------------------------------------------------------------------

_HALF_SQRT3 = nearest(SQRT3 / 2 * WORD)
_CLARKE_EXCESS = nearest((2 / SQRT3 - 1) * WORD)


def clarke(a, b):
    """alpha = a, beta = (a + 2b)/sqrt(3); the result has twice the counts (Q13 in, Q14 out)."""
    total = s16(a + 2 * b)
    return s16(2 * a), s16(total + share(total, _CLARKE_EXCESS))


def clarke_real(a, b):
    return 2.0 * a, 2.0 * (a + 2 * b) / SQRT3


def park(alpha, beta, sine, cosine):
    """d = alpha cos + beta sin, q = beta cos - alpha sin; half the counts, because Q15 times 1/2 is the upper word."""
    return upper(s32(alpha * cosine) + s32(beta * sine)), upper(s32(beta * cosine) - s32(alpha * sine))


def park_real(alpha, beta, a):
    return (alpha * math.cos(a) + beta * math.sin(a)) / 2, (beta * math.cos(a) - alpha * math.sin(a)) / 2


def inverse_park(d, q, sine, cosine):
    """alpha = d cos - q sin, beta = d sin + q cos; half the counts."""
    return upper(s32(d * cosine) - s32(q * sine)), upper(s32(d * sine) + s32(q * cosine))


def inverse_park_real(d, q, a):
    return (d * math.cos(a) - q * math.sin(a)) / 2, (d * math.sin(a) + q * math.cos(a)) / 2


def phases_of(d, q, sine, cosine):
    """Inverse Park and a = alpha, b = (sqrt(3) beta - alpha)/2, c = -a - b; full counts, rounded to the nearest."""
    alpha = upper(s32(2 * (d * cosine - q * sine)) + 32768)
    beta = upper(s32(2 * (d * sine + q * cosine)) + 32768)
    b = s16(upper(s32(beta * _HALF_SQRT3) + 32768) - alpha // 2)
    return alpha, b, s16(-alpha - b)


def phases_of_real(d, q, a):
    alpha, beta = (2 * x for x in inverse_park_real(d, q, a))
    return alpha, (SQRT3 * beta - alpha) / 2, (-SQRT3 * beta - alpha) / 2


# ---- the machine: engineering values and what follows from them -----------------------------------------------------

@dataclass(frozen=True)
class Machine:
    """Motor, supply and limits; properties are the constants of Equations 5 to 8 in float64."""
    rs_ohm: float = 2.67
    ls_h: float = 1.92e-3
    kphi: float = 7.24              # V peak line to line per 1000 rpm
    pole_pairs: int = 5
    bus_v: float = 24.0
    period_s: float = 50e-6
    dead_time_s: float = 2e-6
    window_s: float = 1.6e-6
    peak_current_a: float = 4.4     # of 32768 counts
    maximum_current_a: float = 2.75
    over_current_a: float = 3.8
    over_voltage_v: float = 34.0
    nominal_rpm: float = 2800.0
    maximum_rpm: float = 5500.0
    kfilter_velestim: int = 748
    inertia_kgm2: float = 5.5e-6
    speed_hz: float = 13.0
    load_hz: float = 110.0

    @property
    def u0(self):
        """Volts per count: the largest phase voltage Vbus/sqrt(3), less the dead time's share."""
        return self.bus_v / SQRT3 * (1 - self.dead_time_s / self.period_s) / 32768

    @property
    def i0(self):
        return self.peak_current_a / 32768

    @property
    def rs(self):
        """Equation 5b: Rs I0/U0."""
        return self.rs_ohm * self.i0 / self.u0

    @property
    def ls(self):
        """Equation 5a: Ls/Ts I0/U0."""
        return self.ls_h / self.period_s * self.i0 / self.u0

    @property
    def speed_unit(self):
        """Electrical rpm of a count of speed: the maximum speed is at most 32000 counts."""
        return next(unit for unit in (1, 2, 4) if unit == 4 or self.maximum_rpm * self.pole_pairs <= 32000 * unit)

    @property
    def inv_kfi(self):
        """Equation 6: electrical rpm per voltage count; Kphi is line to line, hence sqrt(3)."""
        return SQRT3 * 1000 * self.pole_pairs * self.u0 / self.kphi

    @property
    def turns_per_erpm(self):
        """Share of a turn that one electrical rpm advances in a period."""
        return self.period_s / 60

    @property
    def psi(self):
        """Flux of the rotor in V s per electrical radian: phase back-EMF per electrical speed."""
        return self.kphi / SQRT3 / (1000 * 2 * math.pi / 60) / self.pole_pairs

    @property
    def fastest_rpm(self):
        return max(self.maximum_rpm, 1.5 * self.nominal_rpm)

    @property
    def shares(self):
        """In volts: what 98 % of Q13 leaves beside the largest voltage, R i at the trip level, and the largest L di/dt."""
        room = 0.98 * 131068 * self.u0 - min(self.over_voltage_v, 1.25 * self.bus_v) / SQRT3
        return room, 2 / SQRT3 * self.over_current_a * self.rs_ohm, \
            1.2 * self.fastest_rpm * self.pole_pairs * 2 * math.pi / 60 * self.ls_h * self.maximum_current_a

    @property
    def ldi_share(self):
        """What is left of L di/dt with R as large as the adaptation makes it, three quarters at least."""
        room, ri, ldi = self.shares
        return clamp((room - 1.6 * ri) / ldi, 0.75, 1)

    @property
    def ldi_ls_share(self):
        return min(self.ldi_share * self.fastest_rpm / (1.5 * self.nominal_rpm), 1)

    @property
    def rs_end(self):
        """How far R may grow in what is left beside that."""
        room, ri, ldi = self.shares
        return (room - self.ldi_share * ldi) / ri

    @property
    def lost_current(self):
        """Phase current (Q13) that half the bus takes back within the dead time: below it less voltage is lost."""
        return self.bus_v / 2 * self.dead_time_s / self.ls_h / self.i0 / 4

    @property
    def eight_samples_erpm(self):
        """Up to here the derivative spans eight samples: nominal speed, or what turns by 0.12 in eight periods."""
        return min(self.nominal_rpm * self.pole_pairs, 0.12 / 8 / self.turns_per_erpm)

    @property
    def dead_time_erpm(self):
        """What dead time takes from a leg, as the speed of that back-EMF."""
        return self.bus_v * self.dead_time_s / self.period_s * SQRT3 * 1000 * self.pole_pairs / self.kphi

    @property
    def acceleration(self):
        """Of a count of q current (Q13): counts of speed in a slow step."""
        torque_per_a = 1.5 * self.pole_pairs * self.psi
        return torque_per_a / self.inertia_kgm2 * self.pole_pairs * 60 / (2 * math.pi) * 4 * self.i0 * 8 * self.period_s / self.speed_unit

    def current_step(self, rpm, periods=1):
        """Largest change of a sine of the maximum current in some periods: 2 pi f Ts I; in counts of I0."""
        frequency = rpm / 60 * self.pole_pairs
        return 2 * math.pi * frequency * self.period_s * periods * self.maximum_current_a / self.i0

    def exponent(self, x):
        """Binary exponent that brings x below 65535."""
        return next(e for e in range(4) if x < 65536 * 2 ** e - 2 ** e)

    def estimator(self):
        rs, ls = self.rs * 32768, self.ls * 4096
        rs_exp, ls_exp, unit = self.exponent(rs), self.exponent(1.2 * ls), self.speed_unit
        return {
            "rs_q16": nearest(rs / 2 ** rs_exp), "rs_exp": rs_exp,
            "ls_q16": nearest(ls / 2 ** ls_exp), "ls_exp": ls_exp,
            "d_ilimit_ls_q14": min(nearest(self.ldi_ls_share * self.current_step(self.eight_samples_erpm / self.pole_pairs, 8) / 2), 16383),
            "d_ilimit_hs_q14": min(nearest(self.ldi_share * self.current_step(self.maximum_rpm) / 2), 4095),
            "deltat_q32": nearest(self.turns_per_erpm * unit * 2 ** 32),
            "half_step_q16_rad": nearest(self.turns_per_erpm * unit * math.pi * 2 ** 32),
            "kfilter_velestim_q16": nearest((1 - (1 - self.kfilter_velestim / 32768) ** 2) * WORD),
            "nominal_erpm": int(self.eight_samples_erpm / unit),
            "decimate_erpm": nearest(self.nominal_rpm * self.pole_pairs / 10 / unit),
            "inv_kfi": nearest(self.inv_kfi * 16384 / unit),
        }

    def observer(self):
        """A step is eight periods; the unit of acceleration is 2^-shift counts of speed a step, half to one a count of current."""
        unit = self.speed_unit
        shift = min(13, next(s for s in range(1, 14) if s == 13 or self.acceleration >= 2.0 ** (-1 - s)))
        units = self.acceleration * 2 ** shift
        quick = 2 * math.pi * self.load_hz * 8 * self.period_s * WORD
        load_from = clamp(5 * self.lost_current * units, 1, 16000)
        return {
            "deltat_q32": nearest(self.turns_per_erpm * unit * 2 ** 32),
            "per_turn_q12": nearest(WORD * 4096 / (8 * self.turns_per_erpm * unit * 2 ** 32)),
            "shift": shift, "per_current_q16": min(nearest(units * WORD), 65535), "per_unit_q15": min(nearest(32768 / units), 65535),
            "innovation_max": int(min(16383, 16000 * WORD * WORD / quick ** 2 / 2 ** shift)),
            "load_max": int(nearest(self.maximum_current_a / self.i0 / 4) * units),
            "quiet_q16": int(min(1.22 * self.speed_hz / self.load_hz, 0.3) * quick),
            "loaded_q16": int(0.3 * quick), "fast_q16": int(quick),
            "full_erpm": int(60 / 2.7 * self.load_hz / unit), "load_from": int(load_from), "load_width": int(load_from),
            "load_slope_q15": int(32767 / load_from),
            "gate_erpm": int(0.13 * self.dead_time_erpm / unit), "gate_loaded_erpm": int(0.03 * self.dead_time_erpm / unit),
        }

    def adaptation(self):
        e = self.estimator()
        return {
            "rate_q16": nearest(6 * 32 * self.period_s * WORD), "kfi_least": q15(-0.3), "kfi_most": q15(0.35), "rs_least": q15(-0.4),
            "rs_most": q15(clamp(self.rs_end - 1, 0, 0.6)), "emf_least_q12": int(0.2 * self.bus_v * self.dead_time_s / self.period_s / self.u0 / 8),
            "turned_q12": int(min(max(0.175 * self.psi / 16, 0.4 * self.bus_v * self.dead_time_s) / self.period_s / self.u0 / 8, 32767)),
            "rs_base_q16": e["rs_q16"],
        }

    def modulator(self):
        """Duty counts: 2 per PWM clock of 25 ns, 100 % = period / 25 ns."""
        clock = 25e-9
        full = nearest(self.period_s / clock)
        dead = nearest(self.dead_time_s / clock)
        knee = max(2, nearest(self.lost_current / 4))
        return {"full": full, "top": full - 2 * nearest(self.window_s / clock), "dead_time": dead, "knee_q13": knee,
                "dead_slope_q8": dead * 256 // knee, "turn_q13": int(self.current_step(self.maximum_rpm) / 4)}

    def duty_per_volt_q16(self, bus_v):
        """Duty counts per Q13 voltage count * 65536 for a measured bus."""
        return u16(int(self.modulator()["full"] * 4 * self.u0 / bus_v * WORD))

    def circle_radius_q14(self, bus_v):
        """Radius of the largest circle whose line voltages the window leaves: top/full bus/sqrt(3)."""
        m = self.modulator()
        return int(m["top"] / m["full"] * bus_v / SQRT3 / (2 * self.u0))


# ---- modulator ------------------------------------------------------------------------------------------------------


def dead_time(p, i_q13):
    """What dead time takes from a leg, linear up to the knee."""
    return s16(clamp(i_q13, -p["knee_q13"], p["knee_q13"]) * p["dead_slope_q8"]) // 256


def svm(p, alpha, beta, duty_per_volt, asked, currents):
    """Phase voltages in duty counts, centred by min-max injection, moved down to leave the window, then the dead time of the currents
    asked for, as far as the measured ones allow."""
    a = share(alpha, duty_per_volt)
    t = share(share(beta, duty_per_volt), _HALF_SQRT3)
    phases = [a, s16(t - a // 2), s16(-t - a // 2)]
    shift = s16(p["full"] - max(phases) - min(phases)) // 2
    shift = min(shift, p["top"] - max(phases))
    return [leg(p, s16(u + shift), *both) for u, *both in zip(phases, asked, currents)]


def leg(p, u, asked_q13, i_q13):
    """Inside the window; its dead time may go beyond only where the current surely keeps its sign to the next sample."""
    return clamp(u + dead_time(p, asked_q13), 0, p["full"] if i_q13 > p["turn_q13"] else p["top"])


def svm_real(p, alpha, beta, duty_per_volt, asked, currents):
    k = duty_per_volt / WORD
    phases = [k * alpha, k * (-alpha + SQRT3 * beta) / 2, k * (-alpha - SQRT3 * beta) / 2]
    shift = (p["full"] - max(phases) - min(phases)) / 2
    shift = min(shift, p["top"] - max(phases))
    knee = p["knee_q13"]
    legs = [u + shift + p["dead_time"] * clamp(i / knee, -1, 1) for u, i in zip(phases, asked)]
    return [clamp(u, 0, p["full"] if i > p["turn_q13"] else p["top"]) for u, i in zip(legs, currents)]


# ---- PI controller --------------------------------------------------------------------------------------------------

@dataclass
class Pi:
    """U = Sum + Kp err; out = limit(U); Sum += Ki err - Kc (U - out)."""
    kp: int
    ki: int
    kc: int     # Q15
    shift: int  # U counts = output counts << shift
    sum: int = 0

    def tick(self, err, limit):
        """The excess counts in whole steps of 65536, by its magnitude, so that both signs are alike."""
        u = s32(self.sum + s32(err * self.kp))
        bound = s32(limit << self.shift)
        excess = u - clamp(u, -bound, bound)
        steps = abs(s32(excess)) // WORD * (1 if excess > 0 else -1)
        out = limit if excess > 0 else -limit if excess < 0 else u // (1 << self.shift)
        self.sum = s32(self.sum + s32(err * self.ki) - 2 * s32(steps * self.kc))
        return s16(out)

    def preset(self, err, out):
        self.sum = s32((out << self.shift) - err * self.kp)


class PiReal(Pi):
    """The same in float64."""

    def tick(self, err, limit):
        u = self.sum + self.kp * err
        bound = limit * 2.0 ** self.shift
        out = clamp(u, -bound, bound)
        self.sum += self.ki * err - self.kc / 32768 * (u - out)
        return out / 2.0 ** self.shift

    def preset(self, err, out):
        self.sum = out * 2.0 ** self.shift - err * self.kp


# ---- voltage circle and current circle ------------------------------------------------------------------------------

def voltage_circle_reciprocal(radius):
    """2^28 / radius, rounded up: the ratio that it gives is never too small."""
    return u16(2 ** 28 // max(radius, 4097) + 1)


def vd_limit(radius):
    """31/32 of the radius; the 32nd is rounded down."""
    return radius - radius // 32


def vq_limit(radius, vd):
    """sqrt(radius^2 - vd^2): the ratio in Q12 rounded up, the circle's table, the upper word of twice the product."""
    ratio = magnitude(vd) * voltage_circle_reciprocal(radius) // WORD + 1
    return upper(2 * s32(radius * circle(8 * ratio)))


def vq_limit_real(radius, vd):
    return math.sqrt(max(0.0, radius * radius - vd * vd))


def iq_limit(maximum, i_d):
    """sqrt(Imax^2 - Id^2); the ratio |Id|/Imax in Q15 by a reciprocal of 2^25/Imax."""
    reciprocal = nearest(2 ** 25 / maximum)
    ratio = min(abs(i_d) * reciprocal // 1024, 32767)
    return upper(2 * s32(maximum * circle(ratio)))


def current_control(pi_d, pi_q, ref, meas, radius):
    """d first within 31/32 of the circle; q gets what the circle leaves."""
    vd = pi_d.tick(s16(ref[0] - meas[0]), vd_limit(radius))
    limit = vq_limit(radius, vd)
    return vd, pi_q.tick(s16(ref[1] - meas[1]), limit), limit


# ---- estimator ------------------------------------------------------------------------------------------------------

def emf_sum_max(inv_kfi):
    """Largest Eq -+ Ed (Q12) whose speed fits a word: E * inv_kfi / 2^11 <= 32767."""
    return s16(32767 * 2048 // max(inv_kfi, 2048))


def turn_small(x, y, a_q16_rad):
    """A vector turned by a small angle: x - a y, y + a x."""
    return s16(x - share(y, a_q16_rad)), s16(y + share(x, a_q16_rad))


@dataclass
class Estimator:
    """The PLL of Equations 1 to 7 in integers; p is Machine.estimator(). What need not follow each sample is settled every second period."""
    p: dict
    kfilter_esdq_q16: int = 2400
    history: list = field(default_factory=lambda: [(0, 0)] * 9)  # of every period, oldest first
    oldest: tuple = (0, 0)
    periods: int = 0
    own: tuple = field(default_factory=lambda: sincos(0))        # frame of the periods to come
    v: list = field(default_factory=lambda: [(0, 0)] * 2)        # two periods ago, one period ago
    e: tuple = (0, 0)
    e_d: int = 0
    e_q: int = 0
    omega: int = 0
    before: int = 0     # omega of the period before
    filtered: int = 0
    rho: int = 0        # modulo 2^32
    step: int = 0       # of a period, 2^32 = a turn
    half_step: int = 0
    old_turn: int = 0   # 3.5 steps of the filtered speed
    sign: int = 0

    @property
    def speed(self):
        return upper(self.filtered)

    def next_angle(self):
        """The angle half a period after the last sample, plus half a step."""
        return (self.rho // WORD + self.step // WORD // 2) % WORD

    def inductive(self, now, ls_q16):
        """Ls dI/dt in Q13: eight samples below nominal speed, turned from 4 samples ago to the middle of the last
        period (3.5 steps, half a radian at most); one sample above, which counts eightfold."""
        p = self.p
        slow = magnitude(self.speed) < p["nominal_erpm"]
        base, limit = (self.oldest, p["d_ilimit_ls_q14"]) if slow else (self.history[-1], p["d_ilimit_hs_q14"])
        change = [clamp(s16(n - b), -limit, limit) for n, b in zip(now, base)]
        v = [share(s16(c if slow else 8 * c), ls_q16) for c in change]
        if slow:
            v = turn_small(*v, self.old_turn)
        return [s16(x << p["ls_exp"]) for x in v]

    def back_emf(self, now, ls_q16):
        """Equation 4 at the middle of the last period: mean of two vectors and of two currents."""
        p = self.p
        inductive = self.inductive(now, ls_q16)
        e = []
        for axis in (0, 1):
            mean_i = s16(now[axis] + self.history[-1][axis]) // 2
            mean_v = (self.v[0][axis] + self.v[1][axis]) // 2
            e.append(s16(mean_v - s16(share(mean_i, p["rs_q16"]) << p["rs_exp"]) - inductive[axis]))
        self.e = tuple(e)
        self.history = self.history[1:] + [tuple(now)]

    def pll(self, e_d, e_q, inv_kfi):
        """Equations 7, 2 and 1."""
        p = self.p
        self.e_d = lowpass(self.e_d, e_d, self.kfilter_esdq_q16)
        self.e_q = lowpass(self.e_q, e_q, self.kfilter_esdq_q16)
        d, q = upper(self.e_d), upper(self.e_q)
        most = emf_sum_max(inv_kfi)
        total = clamp(s16(q - self.sign * d), -most, most)
        self.before, self.omega = self.omega, s16(total * inv_kfi // 2048)
        self.step = self.omega * p["deltat_q32"]
        self.rho = (self.rho + self.step) % (1 << 32)
        self.half_step = share(self.omega, p["half_step_q16_rad"])

    def settle(self):
        """After every second period: the filtered speed, the current of 6.5 periods ago, which is eight before the next two in their mean, and the
        frame of the next two."""
        self.periods += 1
        if self.periods % 2:
            return
        self.oldest = tuple(s16(six - six // 4 + eight // 4) for six, eight in zip(self.history[-7], self.history[-9]))
        self.filtered = lowpass(self.filtered, (self.omega + self.before) // 2, self.p["kfilter_velestim_q16"])
        self.own = sincos(self.next_angle())
        self.follow()

    def follow(self):
        """For the next periods: the sign of Equation 2, Eq's above a tenth of nominal speed and the filtered speed's below; 3.5 steps, half a radian
        at most."""
        p = self.p
        decides = upper(self.e_q) if magnitude(self.speed) > p["decimate_erpm"] else self.speed
        self.sign = 1 if decides >= 0 else -1
        self.old_turn = s16(7 * clamp(share(self.speed, p["half_step_q16_rad"]), -4681, 4681))

    def tick_free(self, now, ls_q16, inv_kfi):
        """In the estimator's own frame, by its own sine and cosine."""
        self.back_emf(now, ls_q16)
        self.pll(*park(*self.e, *self.own), inv_kfi)
        self.settle()

    def tick_closed(self, now, ls_q16, inv_kfi, frame):
        """In the control frame of this sample, turned back by half a step to the middle of the last period."""
        self.back_emf(now, ls_q16)
        d, q = park(*self.e, *frame)
        self.pll(s16(d - share(q, self.half_step)), s16(q + share(d, self.half_step)), inv_kfi)
        self.settle()

    def commanded(self, v):
        self.v = [self.v[1], tuple(v)]


@dataclass
class EstimatorReal:
    """The same equations in float64 and SI units, with exact rotations."""
    m: Machine
    kfilter_esdq: float = 1200 / 32768
    history: list = field(default_factory=lambda: [0j] * 9)
    oldest: complex = 0j
    v: list = field(default_factory=lambda: [0j] * 2)
    e_dq: complex = 0j
    omega: float = 0.0     # electrical rpm
    before: float = 0.0
    filtered: float = 0.0
    rho: float = 0.0       # turns, not wrapped
    frame: float = 0.0     # turns: angle of the next sample
    own: float = 0.0       # turns: the estimator's own frame for two periods
    sign: int = 0
    periods: int = 0

    def tick(self, i, inv_kphi_ratio, closed):
        m, rad = self.m, 2 * math.pi
        step = self.omega * m.turns_per_erpm  # turns a period
        if abs(self.filtered) < m.eight_samples_erpm:
            limit = m.ldi_ls_share * m.current_step(m.eight_samples_erpm / m.pole_pairs, 8) * m.i0
            change = i - self.oldest
            change = complex(clamp(change.real, -limit, limit), clamp(change.imag, -limit, limit)) / 8
            change *= cmath.rect(1.0, clamp(3.5 * self.filtered * m.turns_per_erpm * rad, -0.5, 0.5))
        else:
            limit = m.ldi_share * m.current_step(m.maximum_rpm) * m.i0
            change = i - self.history[-1]
            change = complex(clamp(change.real, -limit, limit), clamp(change.imag, -limit, limit))
        e = sum(self.v) / 2 - m.rs_ohm * (i + self.history[-1]) / 2 - m.ls_h / m.period_s * change
        self.history = self.history[1:] + [i]
        e_dq = e * cmath.rect(1.0, -rad * ((self.frame - step / 2) if closed else self.own))
        self.e_dq += self.kfilter_esdq * (e_dq - self.e_dq)
        total = self.e_dq.imag - self.sign * self.e_dq.real
        per_volt = SQRT3 * 1000 * m.pole_pairs / m.kphi * inv_kphi_ratio
        self.before, self.omega = self.omega, clamp(total * per_volt, -32767.0 * m.speed_unit, 32767.0 * m.speed_unit)
        self.rho += self.omega * m.turns_per_erpm
        self.frame = self.rho + self.omega * m.turns_per_erpm / 2
        self.settle()

    def settle(self):
        """After every second period."""
        m = self.m
        self.periods += 1
        if self.periods % 2:
            return
        self.oldest = 0.75 * self.history[-7] + 0.25 * self.history[-9]
        self.filtered += (1 - (1 - m.kfilter_velestim / 32768) ** 2) * ((self.omega + self.before) / 2 - self.filtered)
        self.own = self.frame
        decides = self.e_dq.imag if abs(self.filtered) > m.nominal_rpm * m.pole_pairs / 10 else self.filtered
        self.sign = 1 if decides >= 0 else -1

    def commanded(self, v):
        self.v = [self.v[1], v]


def synthetic_motor(m, speed_erpm, current_dq):
    """Samples of a motor whose speed and d-q current are given for every sample: the current vector, the vector that
    the drive commands (it acts for the period centred on the next sample), and the rotor's angle in turns.

    @param speed_erpm, current_dq: lists of the same length (complex for the current)
    @return lists of i (A), v (V), theta (turns), all one shorter
    """
    rad, ts = 2 * math.pi, m.period_s
    theta, i, v = [0.0], [], []
    for n in range(len(speed_erpm) - 1):
        nxt = n + 1
        theta.append(theta[n] + (speed_erpm[n] + speed_erpm[nxt]) / 2 * m.turns_per_erpm)
        omega = speed_erpm[nxt] / 60 * rad
        slope = (current_dq[min(nxt + 1, len(current_dq) - 1)] - current_dq[n]) / (2 * ts)
        frame = cmath.rect(1.0, rad * theta[nxt])
        i.append(current_dq[n] * cmath.rect(1.0, rad * theta[n]))
        v.append((m.rs_ohm * current_dq[nxt] + m.ls_h * (slope + 1j * omega * current_dq[nxt]) + 1j * omega * m.psi) * frame)
    return i, v, theta[:-1]


def lock_error_deg(ratio):
    """Angle of the rotor ahead of the estimate where cos D + sin D = K'/K, i.e. sqrt(2) sin(D + 45 deg) = K'/K."""
    return math.degrees(math.asin(ratio / math.sqrt(2))) - 45.0


# ---- field weakening ------------------------------------------------------------------------------------------------

FIELDWEAK_STEP = 1024  # electrical rpm per table entry


def between(table, index, fraction_q16):
    """Linear between two entries; the fraction's product is rounded down."""
    return s16(table[index] - (table[index] - table[index + 1]) * fraction_q16 // WORD)


FILTER_LEAST = 256


def emf_filter(k_q16, per_erpm_q13, ref):
    """The back-EMF filter's K in Q16: in proportion to the speed, in eighths, from the least up to the parameter."""
    slow = magnitude(ref) * per_erpm_q13 // WORD
    return k_q16 if slow >= k_q16 // 8 else 8 * max(slow, FILTER_LEAST // 8)


def emf_filter_real(k_q16, per_erpm, ref):
    return min(k_q16, max(abs(ref) * per_erpm, FILTER_LEAST))


def fieldweak(tables, on_speed, ls_base, ref, unit=1):
    """Index, Id, 1/Kphi and Ls for a speed reference in counts; the last interval ends 1/65536 before the end."""
    above, step = magnitude(ref) - on_speed, FIELDWEAK_STEP // unit
    index, rest = divmod(above, step) if above > 0 else (0, 0)
    fraction = rest * (WORD // step)
    last = len(tables["idref"]) - 2
    if index > last:
        index, fraction = last, WORD - 1
    i_d, inv_kfi, ratio = (between(tables[n], index, fraction) for n in ("idref", "inv_kfi", "ls"))
    return index, i_d, inv_kfi, u16(ls_base * ratio // 2 ** 14), int(above > 0)


def fieldweak_real(tables, on_speed, ls_base, ref, unit=1):
    x = clamp((abs(ref) - on_speed) * unit / FIELDWEAK_STEP, 0, len(tables["idref"]) - 1)
    i = min(int(x), len(tables["idref"]) - 2)
    i_d, inv_kfi, ratio = (t[i] + (t[i + 1] - t[i]) * (x - i) for t in (tables["idref"], tables["inv_kfi"], tables["ls"]))
    return i_d, inv_kfi, ls_base * ratio / 2 ** 14


# ---- adaptation -----------------------------------------------------------------------------------------------------

@dataclass
class Adaptation:
    """Changes of 1/Kphi and R against the header, Q31; p is Machine.adaptation()."""
    p: dict
    kfi: int = 0
    rs: int = 0

    @staticmethod
    def bounded(x, low, high):
        return high * WORD if upper(x) >= high else low * WORD if upper(x) < low else x

    def learn(self, e_d, e_q, ri):
        """An error, Q15 of the voltage, is taken back by the flux and by R at rates that share out the voltage."""
        p, total = self.p, u16(magnitude(e_q) + magnitude(ri))
        if magnitude(e_q) < p["emf_least_q12"]:
            return
        error = s16(min(magnitude(e_d), total - 1) * 32768 // total) * (-1 if e_d < 0 else 1)
        by_rs = magnitude(ri) * 32768 // total
        rs_rate = upper(2 * s16(by_rs) * p["rate_q16"] + 32768)
        self.kfi = self.bounded(self.kfi - error * (p["rate_q16"] - rs_rate), p["kfi_least"], p["kfi_most"])
        along = -error if (ri < 0) != (e_q < 0) else error
        self.rs = self.bounded(self.rs + along * rs_rate, p["rs_least"], p["rs_most"])

    def apply(self, inv_kfi):
        """@param inv_kfi of the table @return 1/Kphi, R and the EMF limit"""
        kfi = clamp(inv_kfi + 2 * share(inv_kfi, upper(self.kfi)), 1024, 32767)
        rs = min(self.p["rs_base_q16"] + 2 * share(upper(self.rs), self.p["rs_base_q16"]), 65535)
        return kfi, u16(rs), emf_sum_max(kfi)


class AdaptationReal(Adaptation):
    """The same in float64; the changes are fractions."""

    def learn(self, e_d, e_q, ri):
        p, total = self.p, abs(e_q) + abs(ri)
        if abs(e_q) < p["emf_least_q12"]:
            return
        step = min(abs(e_d) / total, 1) * p["rate_q16"] / WORD * (-1 if e_d < 0 else 1)
        self.kfi = clamp(self.kfi - step * abs(e_q) / total, p["kfi_least"] / 32768, p["kfi_most"] / 32768)
        self.rs = clamp(self.rs + step * ri / total * (1 if e_q >= 0 else -1), p["rs_least"] / 32768, p["rs_most"] / 32768)

    def apply(self, inv_kfi):
        kfi = clamp(inv_kfi * (1 + self.kfi), 1024, 32767)
        return kfi, min(self.p["rs_base_q16"] * (1 + self.rs), 65535), 32767 * 2048 / max(kfi, 2048)


# ---- salient motors -------------------------------------------------------------------------------------------------

def salience_flux(double, i_d, kfi):
    """Flux over the magnets' in Q13 and one over it in Q15 at a d current; `double` is psi/(Lq - Ld), kfi the learnt change of 1/Kphi."""
    least = -2 * double if double < 8191 else -16383
    most = min(double // 2 - 1, 16383)
    near = clamp(i_d, -16383, 16383)
    counts = clamp(s16(near + upper(2 * s32(near * kfi))), least, most)
    change = magnitude(counts) * 8192 // double
    flux = u16(8192 - change if counts >= 0 else 8192 + change)
    return flux, u16(2 ** 28 // flux)


def salience_flux_real(double, i_d, kfi):
    counts = clamp(clamp(i_d, -16383, 16383) * (1 + kfi / 32768), max(-2 * double, -16383), min(double / 2, 16383))
    return 1 - counts / double, 1 / (1 - counts / double)


def salience_torque(flux, i_q):
    """q current without d current of the same torque."""
    return s16(i_q * flux >> 13)


def salience_current(per_flux, torque_q26):
    """The way back, with 13 fraction bits."""
    x = clamp(torque_q26, -2 ** 28, 2 ** 28)
    return s32(2 * s32(upper(x) * per_flux) + (x % WORD * per_flux >> 15))


def salience_kfi(per_flux, inv_kfi):
    return inv_kfi * per_flux >> 15


def salience_least(double, least, i_q):
    """A step of the least current's d current towards i_q^2/(I + least)."""
    return s16(least + (s16(i_q * i_q // u16(double + least)) - least >> 2))


def mtpa_real(double, i_q):
    """The least current's -i_d in closed form."""
    return math.sqrt(double * double / 4 + i_q * i_q) - double / 2


# ---- load observer --------------------------------------------------------------------------------------------------

FASTEST = 32700 * WORD


def toward(a, b, share_q15):
    """a + (b - a) share"""
    return s16(a + upper(2 * s32(s16(b - a) * share_q15)))


@dataclass
class Observer:
    """Speed (erpm, 16 fraction bits) and load (units, the same) of the shaft; p is Machine.observer()."""
    p: dict
    omega: int = 0
    load: int = 0
    rho: int = 0
    rate: int = 0
    large: int = 0
    quick: int = 0
    part: int = 0
    unrest: int = 0
    large_last: int = 0

    @property
    def calm(self):
        return self.quick < 4096

    def follow_unrest(self, innovation):
        """Four more for a step that is not calm, one less for one that is; from 1000 on, a large innovation counts in the calm only. Large ones to
        both sides with no calm between them are as much unrest as that."""
        if not self.calm:
            self.unrest += 4 if self.unrest < 4000 else 0
        else:
            self.unrest -= 1 if self.unrest else 0
        counts = abs(innovation) > self.large and (self.unrest < 1000 or self.calm)
        if counts:
            turned, self.large_last = (innovation < 0) != (self.large_last < 0), innovation
            self.unrest = 1000 if turned and not self.calm else self.unrest
        return counts

    def follow_quick(self, innovation, one, half, large, faded):
        """In full from one and a half of what is large, less below it."""
        level = (one if abs(innovation) > large else half) if self.follow_unrest(innovation) else 0
        self.quick = max(faded, level)

    @property
    def speed(self):
        return upper(self.omega)

    def load_q26(self):
        """The q current that holds the load, Q13 with 13 fraction bits."""
        return s32(upper(self.load + 32768) * self.p["per_unit_q15"]) // 4

    def preset(self, rho, speed, iq):
        self.rho, self.omega, self.load, self.quick = rho, speed * WORD, share(iq, self.p["per_current_q16"]) * WORD, 0
        self.unrest = 768

    def schedule(self, ref, iq):
        p, speed = self.p, magnitude(ref)
        counts = min(magnitude(upper(self.load)), magnitude(s32(iq * p["per_current_q16"]) // WORD))
        loaded = s16(clamp(s16(counts - p["load_from"]), 0, p["load_width"]) * p["load_slope_q15"])
        slow = speed * 32768 // p["full_erpm"] if speed < p["full_erpm"] else 32767
        self.part = toward(slow, 2 * slow if slow < 16384 else 32767, loaded)
        rate = toward(toward(0, p["quiet_q16"], slow), toward(0, p["loaded_q16"], self.part), loaded)
        self.rate = toward(rate, toward(0, p["fast_q16"], self.part), self.quick)
        large = s16(toward(p["gate_erpm"], p["gate_loaded_erpm"], loaded) + speed // 32)
        self.large = min(large + large * self.unrest // 256, 32767)

    def innovation(self, rho, middle):
        """By how much the angle turned further than the speed says, rounded to counts of 2^-16 turns, then to electrical rpm."""
        p = self.p
        more = upper((rho - self.rho - 8 * middle * p["deltat_q32"] + 32768 + (1 << 31)) % (1 << 32) - (1 << 31))
        self.rho = rho
        return clamp(s16((clamp(more, -8192, 8191) * p["per_turn_q12"] + 2048) // 4096), -p["innovation_max"], p["innovation_max"])

    def step(self, rho, iq):
        p, before = self.p, self.omega
        self.omega = self.sum(before, s32(s32(iq * p["per_current_q16"]) - self.load) // 2 ** p["shift"])
        innovation = self.innovation(rho, upper(before // 2 + self.omega // 2))
        self.omega = self.sum(self.omega, s32(2 * innovation * self.rate))
        load = s32(self.load - s32(innovation * self.rate ** 2 * 2 ** p["shift"] // WORD))
        self.load = clamp(load, -p["load_max"] * WORD, p["load_max"] * WORD)
        self.follow_quick(innovation, 32767, 12288, self.large + self.large // 2, self.quick - (self.quick >> 6))

    @staticmethod
    def sum(omega, change):
        return s32(clamp(omega + s32(change), -FASTEST, FASTEST))


class ObserverReal(Observer):
    """The same in float64, speed and load in their units, angles in 2^-32 turns; no limits but the load's."""

    @property
    def calm(self):
        return self.quick < 0.125

    def preset(self, rho, speed, iq):
        self.rho, self.omega, self.load, self.quick = rho, float(speed), iq * self.p["per_current_q16"] / WORD, 0.0
        self.unrest = 768

    def schedule(self, ref, iq):
        p = self.p
        loaded = clamp((min(abs(self.load), abs(iq) * p["per_current_q16"] / WORD) - p["load_from"]) / p["load_width"], 0, 1)
        slow = min(abs(ref) / p["full_erpm"], 1)
        self.part = slow + (min(2 * slow, 1) - slow) * loaded
        rate = p["quiet_q16"] * slow * (1 - loaded) + p["loaded_q16"] * self.part * loaded
        self.rate = (rate + (p["fast_q16"] * self.part - rate) * self.quick) / WORD
        self.large = (p["gate_erpm"] + (p["gate_loaded_erpm"] - p["gate_erpm"]) * loaded + abs(ref) / 32) * (1 + self.unrest / 256)

    def step(self, rho, iq):
        p, before = self.p, self.omega
        self.omega += (iq * p["per_current_q16"] / WORD - self.load) / 2 ** p["shift"]
        turned = (rho - self.rho + (1 << 31)) % (1 << 32) - (1 << 31)
        innovation = turned / 8 / p["deltat_q32"] - (before + self.omega) / 2
        self.rho = rho
        self.omega += 2 * innovation * self.rate
        self.load = clamp(self.load - innovation * self.rate ** 2 * 2 ** p["shift"], -p["load_max"], p["load_max"])
        self.follow_quick(innovation, 1.0, 0.375, 1.5 * self.large, self.quick * 63 / 64)


# ---- start ----------------------------------------------------------------------------------------------------------

def forced_angle(rate_q10, end_q10, direction, speed_q10, angle_q32, tick):
    """One period of the start ramp, ticks 1, 2, ...: counts/1024 per period, angle in 2^-32 turns (2^-16 counts). The speed grows before every odd
    tick, for two periods."""
    speed = min(speed_q10 + 2 * rate_q10, end_q10) if tick % 2 else speed_q10
    return speed, (angle_q32 + direction * speed * 64) % (1 << 32), int(speed == end_q10)


def speed_ramp(reference, target, step):
    """One step closer; the target itself when it is nearer than two steps."""
    difference = target - reference
    if abs(difference) < 2 * step:
        return target
    return s16(reference + (step if difference > 0 else -step))


def hand_over(forced, estimated, v_dq, i_q):
    """A vector keeps its place in the stator: seen from the estimator's frame it turns by forced - estimated.
    @return offset, voltage d and q, current d and q"""
    offset = wrap16(forced - estimated)
    sc = sincos(offset % WORD)
    v = [s16(2 * x) for x in inverse_park(*v_dq, *sc)]
    i = [s16(2 * x) for x in inverse_park(0, i_q, *sc)]
    return offset, *v, *i


def hand_over_real(forced, estimated, v_dq, i_q):
    a = 2 * math.pi * (forced - estimated) / WORD
    v = complex(*v_dq) * cmath.rect(1.0, a)
    i = 1j * i_q * cmath.rect(1.0, a)
    return v.real, v.imag, i.real, i.imag
