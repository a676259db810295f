"""Writes the golden vectors from the reference, or compares the committed ones with it (--check)."""

import argparse
import cmath
import math
import pathlib
import random
import sys
from dataclasses import dataclass, field

import reference as ref

HERE = pathlib.Path(__file__).resolve().parent
SEED = 1292
EDGES = [-32768, -32767, -16384, -256, -1, 0, 1, 2, 255, 16384, 32767]
MACHINE = ref.Machine()
QUICK = ref.Machine(rs_ohm=0.45, ls_h=0.3e-3, kphi=1.8, pole_pairs=7, maximum_current_a=2.6, nominal_rpm=10000.0, maximum_rpm=10500.0,
                    inertia_kgm2=2.5e-6, speed_hz=23.0, load_hz=54.0) # 1225 Hz: a count of speed is 4 electrical rpm


@dataclass
class Vectors:
    """One file: a table of integers, named constants, and how far the integer model is from float64."""
    name: str
    what: str
    format: str
    columns: str = ""
    rows: list = field(default_factory=list)
    constants: dict = field(default_factory=dict)
    real: list = field(default_factory=list)     # float64
    model: list = field(default_factory=list)    # the integer model's counterpart
    least_db: float = 0.0                        # asserted minimum of the signal-to-noise ratio

    def compare(self, real, model):
        self.real += list(real)
        self.model += list(model)

    def add(self, arguments, out, real, compared=None):
        """A row: arguments and the model's results; they, or what is compared of them, against float64."""
        self.rows.append([*arguments, *out])
        self.compare(real, out if compared is None else compared)

    def ratio_db(self):
        noise = math.fsum((r - m) ** 2 for r, m in zip(self.real, self.model))
        return 10 * math.log10(math.fsum(r * r for r in self.real) / noise) if noise else math.inf

    def text(self):
        ratio = "not applicable, exact by definition"
        if self.real:
            db = self.ratio_db()
            if db < self.least_db:
                raise ValueError(f"{self.name}: the integer model has {db:.1f} dB against float64, at least {self.least_db} are asserted")
            ratio = f"{db:.1f} dB of the exact integers against float64, at least {self.least_db:g} dB"
        lines = [f"# {self.what}", f"# format: {self.format}", "# tolerance: 0 LSB", f"# signal to noise: {ratio}",
                 *(f"# constant {name} = {value}" for name, value in self.constants.items())]
        if self.rows:
            lines.append(f"# columns: {self.columns}")
            lines += [" ".join(str(x) for x in row) for row in self.rows]
        return "\n".join(lines) + "\n"


BLOCKS = []


def block(what, layout, columns="", least_db=0.0):
    """The function that follows fills the vectors of its own name; its random numbers are its own, so that a change in one block leaves
    the others' files alone."""
    def register(fill):
        def make():
            v = Vectors(fill.__name__, what, layout, columns, least_db=least_db)
            fill(v, random.Random(f"{SEED} {fill.__name__}"))
            return v
        BLOCKS.append(make)
        return fill
    return register


def dither(rng, low, high, count):
    return [rng.randrange(low, high + 1) for _ in range(count)]


# ---- arithmetic -----------------------------------------------------------------------------------------------------

@block("exact products and their upper words, signed, mixed and unsigned",
       "a, b 16-bit words; ss su uu 32-bit products; hi* upper words (floor)",
       "a:s16 b:s16 ss:s32 su:s32 uu:u32 hi:s16 hi_su:s16 hi_uu:u16")
def multiply(v, rng):
    pairs = [(a, b) for a in EDGES for b in EDGES]
    pairs += list(zip(dither(rng, -32768, 32767, 180), dither(rng, -32768, 32767, 180)))
    for a, b in pairs:
        ua, ub = a % 65536, b % 65536
        v.rows.append([a, b, a * b, a * ub, ua * ub, ref.share(a, b), ref.share(a, ub), ua * ub // 65536])


@block("unsigned 32/16 division, truncated", "n / d with d > n >> 16", "n:u32 d:u16 q:u16")
def divide(v, rng):
    pairs = [(1 << 29, 8193), (1 << 29, 16384), (1 << 29, 32767), (32767 * 2048, 2048), (32767 * 2048, 7956),
             (32767 * 2048, 32767), (0, 1), (65535, 1), (0xFFFEFFFF, 0xFFFF), (0xFFFE0001, 0xFFFF), (0xFFFE0000, 0xFFFF)]
    for _ in range(80):
        d = rng.randrange(1, 65536)
        pairs.append((rng.randrange(0, d * 65536), d))
    v.rows = [[n, d, n // d] for n, d in pairs]


@block("magnitude, difference in 17 bits limited to half the range, clamp",
       "abs_a = |a|; sub = a - b within -16383..16383; clamped = a within min(b, c)..max(b, c)",
       "a:s16 b:s16 c:s16 abs_a:s16 sub:s16 clamped:s16")
def limits(v, rng):
    rows = [(a, b, rng.choice(EDGES)) for a in EDGES for b in EDGES]
    rows += [(a, b, c) for a in (-5, -4, -3, 3, 4, 5) for b, c in ((-4, 4), (4, 4), (-4, -4))]
    rows += [(16383, 0, 0), (16384, 0, 0), (16385, 1, 0), (-16383, 0, 0), (-16384, 0, 0), (-16384, -1, 0)]
    rows += [tuple(dither(rng, -32768, 32767, 3)) for _ in range(60)]
    for a, b, c in rows:
        v.rows.append([a, b, c, ref.magnitude(a), ref.clamp(a - b, -16383, 16383), ref.clamp(a, min(b, c), max(b, c))])


@block("Equation 7: full-scale steps both ways, small steps and noise for each filter constant in use",
       "k Q16 (twice the note's Q15); x counts; y 16 fraction bits; start 1 = y begins at zero; "
       "-3 dB at 118, 16, 73 Hz for 2400, 328, 1496",
       "start:u16 k:s16 x:s16 y:s32", least_db=90.0)
def lowpass(v, rng):
    for k, corner in ((2400, 118.8), (328, 16.0), (1496, 73.5), (16384, None)):
        if corner and abs(ref.lowpass_corner_hz(k / 65536, 20000.0) - corner) > 0.1:
            raise ValueError(f"lowpass: -3 dB of {k} is not at {corner} Hz")
        y, real = 0, 0.0
        xs = [32767] * 60 + [-32768] * 60 + [0] * 30 + [1] * 10 + [-1] * 10 + dither(rng, -20000, 20000, 50)
        for n, x in enumerate(xs):
            y, real = ref.lowpass(y, x, k), ref.lowpass_real(real, x, k / 65536)
            v.add([int(n == 0), k, x], [y], [real], [y / 65536])


# ---- sine, circle, transformations ----------------------------------------------------------------------------------

@block("sine and cosine: table points, their neighbours, the borders between them, a random sample",
       "angle 65536 = one turn; sin, cos Q15; checksum s = 31 s + word over sin, cos of all 65536 angles",
       "angle:u16 sin:s16 cos:s16", least_db=72.0)
def sincos(v, rng):
    everything = [ref.sincos(a) for a in range(65536)]
    for a, sc in enumerate(everything):
        v.compare(ref.sincos_real(a), sc)
    v.constants["checksum"] = ref.polynomial_checksum(x for sc in everything for x in sc)
    angles = [(512 * i + d) % 65536 for i in range(128) for d in (-256, -1, 0, 1, 255)] + dither(rng, 0, 65535, 60)
    v.rows = [[a, *everything[a]] for a in angles]


@block("sqrt(1 - x^2): table points, the middle and the end of every interval",
       "x, value Q15; checksum s = 31 s + word over all x from 0 to 32767; the ratio is for x up to 31/32",
       "x:s16 value:s16", least_db=72.0)
def circle(v, _):
    everything = [ref.circle(x) for x in range(32768)]
    used = range(32768 * 31 // 32 + 1)  # both users end at 31/32; beyond, the chord of the steep end is 4 % below
    v.compare((ref.circle_real(x) for x in used), everything)
    v.constants["checksum"] = ref.polynomial_checksum(everything)
    v.rows = [[x, everything[x]] for i in range(64) for x in (512 * i, 512 * i + 1, 512 * i + 256, 512 * i + 511)]


@block("Clarke: the largest currents and offsets, a circle of full-scale current, a random sample",
       "a, b Q13 phase currents; alpha, beta Q14", "a:s16 b:s16 alpha:s16 beta:s16", least_db=88.0)
def clarke(v, rng):
    edges = [-10240, -8192, -1, 0, 1, 8192, 10240]
    pairs = [(a, b) for a in edges for b in edges if abs(a + b) <= 10240]  # the third phase has the same range
    pairs += [(round(8192 * math.cos(t)), round(8192 * math.cos(t - 2 * math.pi / 3)))
              for t in (2 * math.pi * n / 48 for n in range(48))]
    pairs += [p for p in zip(dither(rng, -10240, 10240, 150), dither(rng, -10240, 10240, 150)) if abs(sum(p)) <= 10240]
    for pair in pairs:
        v.add(pair, ref.clarke(*pair), ref.clarke_real(*pair))


def rotations(rng, most):
    angles = [n * 65536 // 24 for n in range(24)] + [1, 255, 256, 257, 65535]
    rows = [(x, y, a) for x in (-most, 0, most) for y in (-most, 0, most) for a in angles if x or y]
    return rows + [(*dither(rng, -most, most, 2), rng.randrange(65536)) for _ in range(120)]


def rotate(v, rows, model, real):
    for x, y, angle in rows:
        v.add((x, y, angle), model(x, y, *ref.sincos(angle)), real(x, y, 2 * math.pi * angle / 65536))


@block("Park: the largest vectors in 24 directions, a random sample", "alpha, beta counts; angle 65536 = one turn; d, q half the counts",
       "alpha:s16 beta:s16 angle:u16 d:s16 q:s16", least_db=71.0)
def park(v, rng):
    rotate(v, rotations(rng, 23170), ref.park, ref.park_real)


@block("inverse Park: the largest vectors in 24 directions, a random sample",
       "d, q counts; angle 65536 = one turn; alpha, beta half the counts",
       "d:s16 q:s16 angle:u16 alpha:s16 beta:s16", least_db=71.0)
def inverse_park(v, rng):
    rotate(v, rotations(rng, 23170) + [(30350, 0, a) for a in (0, 5000, 20000)], ref.inverse_park, ref.inverse_park_real)


@block("phase currents of a current vector: the largest vectors in 24 directions, a random sample",
       "d, q, phase currents Q13; angle 65536 = one turn", "d:s16 q:s16 angle:u16 a:s16 b:s16 c:s16", least_db=71.0)
def phases(v, rng):
    rotate(v, [*rotations(rng, 8192), (0, 8195, 0)], ref.phases_of, ref.phases_of_real)


# ---- modulator ------------------------------------------------------------------------------------------------------

@block("modulator at five bus voltages: every sector, its borders and their neighbours, up to and beyond "
       "the voltage circle, every second row with dead-time compensation",
       "alpha, beta Q13 volts; gain duty per volt count * 65536; currents asked for and measured Q13; a, b, c duty counts; "
       "the ratio is that of the line voltages",
       "alpha:s16 beta:s16 gain:u16 asked_a:s16 asked_b:s16 asked_c:s16 i_a:s16 i_b:s16 i_c:s16 a:u16 b:u16 c:u16", least_db=56.0)
def svm(v, rng):
    p = MACHINE.modulator()
    v.constants = dict(p)
    degrees = sorted({*range(0, 360, 30), *(s + d for s in range(0, 360, 60) for d in (-1, 1)), 17, 101, 223, 318})
    for bus_v in (12.0, 18.0, 24.0, 30.0, 34.0):
        gain = MACHINE.duty_per_volt_q16(bus_v)
        radius = MACHINE.circle_radius_q14(bus_v) / 2
        for part in (0.02, 0.3, 0.7, 1.0, 1.1, 1.8):
            for n, angle in enumerate(degrees):
                vector = cmath.rect(part * radius, math.radians(angle))
                alpha, beta = round(vector.real), round(vector.imag)
                asked, currents = [0, 0, 0], [0, 0, 0]
                if n % 2: # around the knee, and as large as those measured, with which they have nothing to do
                    asked, currents = (dither(rng, -most, most, 2) for most in ((8, 400) if n % 4 == 1 else (1500, 1500)))
                    asked.append(-sum(asked))
                    currents.append(-sum(currents))
                a, b, c = ref.svm(p, alpha, beta, gain, asked, currents)
                ra, rb, rc = ref.svm_real(p, alpha, beta, gain, asked, currents)
                v.add([alpha, beta, gain, *asked, *currents], [a, b, c], [ra - rb, rb - rc], [a - b, b - c])


# ---- controllers ----------------------------------------------------------------------------------------------------

@block("PI: small signals, wind-up against both limits, recovery, no and full anti-windup, limit zero and full",
       "op 0 tick, 1 clear and tick, 2 preset (err, and limit is the wanted output); sum after the step; "
       "U counts = output counts << shift; the ratio is for shifts in use (10 and more)",
       "op:u16 kp:s16 ki:s16 kc:s16 shift:u16 err:s16 limit:s16 out:s16 sum:s32", least_db=55.0)
def pi(v, rng):
    half_full = ref.q15(0.999)
    for gains in ((6538, 455, half_full, 10), (3000, 40, half_full, 13), (20, 7, 0, 0), (6538, 455, 0, 10),
                  (16384, 9000, 32767, 14), (900, 300, 16384, 4)):
        size = max(1, (2000 << gains[3]) // gains[0])  # an error whose proportional share is about 2000 counts
        small, large = min(size // 4, 16000), min(3 * size, 32767)
        steps = [(1, small, 32767)] + [(0, small, 32767)] * 5 + [(0, large, 2000)] * 20 + [(0, -small, 2000)] * 20
        steps += [(0, -large, 1500)] * 20 + [(0, small, 1500)] * 20 + [(0, small, 0)] * 3 + [(0, -small, 0)] * 3
        steps += [(0, 0, 32767), (2, large, 1234), (0, large, 2000), (2, -small, -987), (0, -small, 2000)]
        steps += [(0, e, 3000) for e in dither(rng, -large, large, 12)]
        if gains[2]:
            steps += [(0, 32767, 0), (0, -32767, 0), (0, 32767, 32767), (0, -32767, 32767)]
        model, real = ref.Pi(*gains), ref.PiReal(*gains)
        for op, err, limit in steps:
            if op == 1:
                model.sum, real.sum = 0, 0.0
            if op == 2:
                model.preset(err, limit)
                real.preset(err, limit)
                v.rows.append([op, *gains, err, limit, limit, model.sum])
                continue
            out, exact = model.tick(err, limit), real.tick(err, limit)
            v.rows.append([op, *gains, err, limit, out, model.sum])
            if gains[3] >= 10 or not gains[2]:  # the excess counts in steps of 65536 >> shift output counts
                v.compare([exact], [out])


RADII = (4097, 7987, 12287, 15974, 19000, 22630, 30350)


@block("d-axis limit and what the circle leaves to the q axis, in steps of 1/64 of the d limit",
       "radius, Vd, limits Q14; checksum_<radius>: s = 31 s + word over Vd from -limit to +limit",
       "radius:s16 vd_limit:s16 vd:s16 vq_limit:s16", least_db=66.0)
def voltage_circle(v, _):
    for radius in RADII:
        most = ref.vd_limit(radius)
        everything = [ref.vq_limit(radius, vd) for vd in range(-most, most + 1)]
        v.constants[f"checksum_{radius}"] = ref.polynomial_checksum(everything)
        v.compare((ref.vq_limit_real(radius, vd) for vd in range(-most, most + 1)), everything)
        chosen = {-most, *range(-63 * most // 64, most, max(1, most // 12)), 0, most}
        v.rows += [[radius, most, vd, everything[vd + most]] for vd in sorted(chosen)]


@block("both current controllers on a sequence that runs into the d limit and the circle and back",
       "references, currents Q13; radius, voltages, q limit Q14; sequence from cleared integrators",
       "ref_d:s16 ref_q:s16 meas_d:s16 meas_q:s16 radius:s16 v_d:s16 v_q:s16 limit_q:s16", least_db=48.0)
def current_control(v, rng):
    gains = (6538, 455, ref.q15(0.999), 10)
    v.constants = dict(zip(("kp", "ki", "kc", "shift"), gains))
    pi_d, pi_q, real_d, real_q = ref.Pi(*gains), ref.Pi(*gains), ref.PiReal(*gains), ref.PiReal(*gains)
    plan = [(0, 2000, 15974, 60), (-3000, 4000, 15974, 60), (-1000, -4000, 15974, 80), (3000, -100, 15974, 60),
            (0, 5000, 9000, 60), (0, -200, 9000, 80), (-2000, 300, 22630, 60)]
    d = q = 0.0
    for ref_d, ref_q, radius, count in plan:
        for _ in range(count):
            meas = [round(d) + rng.randrange(-8, 9), round(q) + rng.randrange(-8, 9)]
            out = ref.current_control(pi_d, pi_q, (ref_d, ref_q), meas, radius)
            v_d = real_d.tick(ref_d - meas[0], ref.vd_limit(radius))
            limit = ref.vq_limit_real(radius, v_d)
            v.add([ref_d, ref_q, *meas, radius], out, [v_d, real_q.tick(ref_q - meas[1], limit), limit])
            d += 0.02 * out[0] - 0.07 * d       # a plant of first order that cannot follow everything
            q += 0.02 * (out[1] - 9000) - 0.07 * q


@block("q-current limit sqrt(Imax^2 - Id^2) for a wanted d current, which is limited to 31/32 Imax first",
       "Q13; reciprocal 2^25/Imax", "maximum:s16 reciprocal:u16 wanted_d:s16 ref_d:s16 iq_limit:s16", least_db=67.0)
def current_limit(v, _):
    for amperes in (0.28, 1.0, 2.75, 3.8):
        maximum = ref.nearest(amperes / MACHINE.i0 / 4)
        most = maximum - maximum // 32
        wanted = sorted({n * maximum // 20 for n in range(-20, 21)} | {most, -most, most + 1, -most - 1, most - 1, 1, -1})
        for i_d in wanted:
            ref_d = ref.clamp(i_d, -most, most)
            limit = ref.iq_limit(maximum, ref_d)
            v.add((maximum, ref.nearest(2 ** 25 / maximum), i_d, ref_d), [limit], [math.sqrt(maximum ** 2 - ref_d ** 2)])


# ---- estimator ------------------------------------------------------------------------------------------------------

def profile(points):
    """Linear between (sample, value) points; every sample."""
    out = []
    for (n0, y0), (n1, y1) in zip(points, points[1:]):
        out += [y0 + (y1 - y0) * (n - n0) / (n1 - n0) for n in range(n0, n1)]
    return out + [points[-1][1]]


ESTIMATOR_FORMAT = ("currents Q14, voltages Q13 (the vector given to the modulator after this tick); rows from closed_from on in the "
                    "frame of estimator_next_angle(); omega electrical rpm; rho upper word after the tick; the ratio is that of omega "
                    "and of the angle in steady state")
ESTIMATOR_COLUMNS = "i_alpha:s16 i_beta:s16 v_alpha:s16 v_beta:s16 omega:s16 rho:u16"


def estimator_sequence(v, speed, current, closed_from, inv_kfi, compare_from, m=MACHINE, kfilter_esdq=1200):
    """@param speed electrical rpm @param inv_kfi ratio to the true one, a value for every sample @param compare_from samples that count for the ratio
    @return angle of the rotor in turns for every sample"""
    p = m.estimator()
    v.constants = dict(p, kfilter_esdq_q16=2 * kfilter_esdq, closed_from=closed_from)
    model, real = ref.Estimator(p, 2 * kfilter_esdq), ref.EstimatorReal(m, kfilter_esdq / 32768)
    amperes, volts, turns = ref.synthetic_motor(m, speed, current)
    frame = ref.sincos(0)
    for n, (i, u) in enumerate(zip(amperes, volts)):
        now = (ref.nearest(i.real / m.i0 / 2), ref.nearest(i.imag / m.i0 / 2))
        command = (ref.nearest(u.real / m.u0 / 4), ref.nearest(u.imag / m.u0 / 4))
        kfi = ref.nearest(p["inv_kfi"] * inv_kfi[n])
        closed = n >= closed_from
        if closed:
            model.tick_closed(now, p["ls_q16"], kfi, frame)
        else:
            model.tick_free(now, p["ls_q16"], kfi)
        real.tick(complex(*now) * 2 * m.i0, kfi * m.speed_unit / 16384 / m.inv_kfi, closed)
        frame = ref.sincos(model.next_angle())
        model.commanded(command)
        real.commanded(complex(*command) * 4 * m.u0)
        v.rows.append([*now, *command, model.omega, model.rho >> 16] + ([kfi] if "inv_kfi" in v.columns else []))
        if n in compare_from:
            v.compare([real.omega, 0.0], [model.omega * m.speed_unit, ref.wrap16(model.rho // 65536 - round(real.rho * 65536))])
    return turns


def require_lock(v, turns, speed, n, expected_deg, within_deg):
    """The estimated angle after sample n (-1: the last one) lags the rotor's by what it should."""
    n = n % len(v.rows)
    true = round((turns[n] + speed[n] * MACHINE.turns_per_erpm / 2) * 65536)
    error_deg = ref.wrap16(true - v.rows[n][5]) * 360 / 65536
    if abs(error_deg - expected_deg) > within_deg:
        raise ValueError(f"{v.name}: the angle error is {error_deg:.2f} deg, expected {expected_deg:.2f}")


def locked_sequence(v, speed, current, closed_from, compare_from, within_deg, *more):
    """A sequence with the right Kphi that ends on the rotor's angle."""
    turns = estimator_sequence(v, speed, current, closed_from, [1.0] * len(speed), compare_from, *more)
    require_lock(v, turns, speed, -1, 0.0, within_deg)


@block("estimator from standstill: the start ramp in its own frame, then the control frame, a load change",
       ESTIMATOR_FORMAT, ESTIMATOR_COLUMNS, 44.0)
def estimator_start(v, _):
    speed = profile([(0, 0.0), (100, 0.0), (800, 5000.0), (1250, 5000.0)])
    current = [1.41 * cmath.rect(1, math.radians(x)) for x in profile([(0, 5.0), (1000, 20.0), (1050, 80.0), (1250, 80.0)])]
    locked_sequence(v, speed, current, 950, range(800, 1250), 1.0)


@block("estimator started on a turning motor: lock, load step, across nominal speed, field weakening at 5500 rpm",
       ESTIMATOR_FORMAT, ESTIMATOR_COLUMNS, 53.0)
def estimator_speed(v, _):
    speed = profile([(0, 5000.0), (300, 5000.0), (500, 13900.0), (600, 14100.0), (950, 27500.0), (1250, 27500.0)])
    current = profile([(0, 0.5j), (250, 0.5j), (260, 2j), (500, 1j), (950, -2.2 + 0.4j), (1050, -2.2 + 0.4j),
                       (1055, -2.2 + 1.0j), (1250, -2.2 + 1.0j)])
    locked_sequence(v, speed, current, 0, range(250, 1250), 1.5)


@block("estimator whose count of speed is 4 electrical rpm: lock, load step, count by count across eight samples' end, 1225 Hz with load",
       ESTIMATOR_FORMAT.replace("omega electrical rpm", "omega 4 electrical rpm"), ESTIMATOR_COLUMNS, 50.0)
def estimator_quick(v, _):
    speed = profile([(0, 14000.0), (200, 14000.0), (300, 17980.0), (500, 18020.0), (600, 22000.0), (1150, 73500.0), (1550, 73500.0)])
    current = profile([(0, 0.3j), (150, 0.3j), (160, 1.9j), (1300, 1.9j), (1305, 0.3j), (1400, 0.3j), (1405, -1.5 + 1.5j),
                       (1550, -1.5 + 1.5j)])
    locked_sequence(v, speed, current, 0, range(150, 1550), 2.0, QUICK, 4348)


@block("estimator from negative speed through standstill to positive speed: the sign of Equation 2 changes",
       ESTIMATOR_FORMAT, ESTIMATOR_COLUMNS, 47.0)
def estimator_reversal(v, _):
    speed = profile([(0, -5000.0), (300, -5000.0), (600, -800.0), (750, 0.0), (850, 1200.0), (1150, 6000.0), (1350, 6000.0)])
    current = profile([(0, -1j), (300, -1j), (350, 1j), (1000, 1j), (1350, 0.3j)])
    locked_sequence(v, speed, current, 0, [*range(250, 600), *range(1150, 1350)], 1.0)


@block("estimator with 1/Kphi at 1, 1.1, 2 and 0.8 times the true one: the angle follows sqrt(2) sin(D + 45 deg) = K'/K, the speed stays",
       ESTIMATOR_FORMAT, ESTIMATOR_COLUMNS + " inv_kfi:s16", 47.0)
def estimator_kphi(v, _):
    ratios = [1.0] * 300 + [1.1] * 300 + [2.0] * 300 + [0.8] * 400
    speed = [7500.0] * 1301
    turns = estimator_sequence(v, speed, [0.8j] * 1301, 0, ratios, [*range(250, 300), *range(550, 600), *range(1250, 1300)])
    for end in (300, 600, 900, 1300):
        require_lock(v, turns, speed, end - 1, ref.lock_error_deg(1 / ratios[end - 1]), 0.5) # K'/K is a ratio of Kphi, inv_kfi its inverse


# ---- field weakening, start, drive ----------------------------------------------------------------------------------

PUBLISHED = {
    "inv_kfi": [7956, 8674, 9156, 9638, 10120, 10602, 11084, 11566, 12048, 12530, 13012, 13494, 13976, 14458, 14940, 15422, 15904, 16387],
    "idref": [ref.nearest(-a / 0.000121 / 4) for a in
              (0, .7, .9, 1.0, 1.4, 1.7, 2.0, 2.1, 2.2, 2.25, 2.3, 2.35, 2.4, 2.45, 2.5, 2.5, 2.5, 2.5)],
    "ls": [ref.nearest(x * 32768) for x in (.5, .45, .4, .4, .35, .35, .34, .34, .33, .33, .32, .32, .31, .30, .29, .28, .27, .26)],
}


@block("the published tables of the field-weakening vectors", "Id Q13 at 0.000121 A/count; 1/Kphi Q15/2; "
       "Ls/(2 Ls0) Q15", "idref:s16 inv_kfi:s16 ls:s16")
def fieldweak_tables(v, _):
    """A table that falls, rises and jumps everywhere, so that no index can stand in for another."""
    v.rows = [list(x) for x in zip(PUBLISHED["idref"], PUBLISHED["inv_kfi"], PUBLISHED["ls"])]


@block("table look-up: below and at the start speed, every index with its borders and inside, the end, beyond the end",
       "ref electrical rpm; id Q13; ls_q16; above 1 = the filter of field weakening",
       "ref:s16 index:u16 idref:s16 inv_kfi:s16 ls_q16:u16 above:u16", least_db=86.0)
def fieldweak(v, rng):
    on_speed, ls_base = 13000, MACHINE.estimator()["ls_q16"]
    v.constants = {"on_speed": on_speed, "ls_base": ls_base}
    speeds = [0, 1, 12999] + [on_speed + 1024 * i + d for i in range(18) for d in (-1, 0, 1, 511, 512, 1023)]
    speeds += [30407, 30408, 30409, 31432, 32000, 32766, 32767] + dither(rng, 13000, 32767, 40)
    for x in [*speeds, *(-s for s in speeds[::3]), -32767, -32768]:
        if x > 32767:
            continue
        out = ref.fieldweak(PUBLISHED, on_speed, ls_base, x)
        v.add([x], out, ref.fieldweak_real(PUBLISHED, on_speed, ls_base, x), [out[1], out[2], out[3]])


@block("table look-up where a count of speed is 2 or 4 electrical rpm: an entry is still 1024 electrical rpm wide",
       "ref counts; id Q13; ls_q16", "unit:u16 ref:s16 index:u16 idref:s16 inv_kfi:s16 ls_q16:u16 above:u16", least_db=86.0)
def fieldweak_quick(v, rng):
    on_speed, ls_base = 13000, MACHINE.estimator()["ls_q16"]
    v.constants = {"on_speed": on_speed, "ls_base": ls_base}
    for unit in (2, 4):
        wide = 1024 // unit
        speeds = [0, 12999] + [on_speed + wide * i + d for i in range(18) for d in (-1, 0, 1, wide // 2 - 1, wide - 1)]
        for x in [*speeds, 32000, 32767, -32767, *dither(rng, 13000, 13000 + 18 * wide, 20)]:
            out = ref.fieldweak(PUBLISHED, on_speed, ls_base, x, unit)
            v.add([unit, x], out, ref.fieldweak_real(PUBLISHED, on_speed, ls_base, x, unit), [out[1], out[2], out[3]])


@block("the back-EMF filter over the speed: its floor, the slope, the full value",
       "ref electrical rpm; K Q16; per_erpm K per electrical rpm Q13",
       "k:s16 per_erpm:u16 ref:s16 filter:s16", least_db=62.0)
def emf_filter(v, rng):
    for k, period_s in ((4000, 50e-6), (2406, 100e-6), (16000, 140e-6)):
        corner = 5 * 2 * math.pi / 60 * period_s * 65536 # five times the electrical frequency
        steep, full = ref.nearest(corner * 8192), int(k / corner)
        floor = int(ref.FILTER_LEAST / corner)
        speeds = [0, 1, floor - 8, floor, floor + 8, full // 2, full - 8, full, full + 8, 32767, -32768]
        speeds.append(-(k // 8 * 65536 // -steep)) # the first to have it in full
        for x in [*speeds, *(-s for s in speeds[:9]), *dither(rng, floor, full, 12)]:
            v.add([k, steep, x], [ref.emf_filter(k, steep, x)], [ref.emf_filter_real(k, corner, x)])


# ---- salient motors -------------------------------------------------------------------------------------------------

SALIENT = (256, 3000, 8190, 8191, 12412, 32767, 32768, 57343)  # -i_d that doubles the flux, Q13 counts


@block("a salient motor's flux at a d current, and torque, current and 1/Kphi with it",
       "doubles (-i_d that doubles the flux), i_d, i_q, torque Q13; kfi Q15; flux Q13, per_flux Q15 of the magnets'; current_q26 of the q current i_q as a torque in Q26",
       "doubles:u16 i_d:s16 kfi:s16 flux:u16 per_flux:u16 i_q:s16 torque:s16 current_q26:s32 inv_kfi:s16 flux_kfi:s32", least_db=66.0)
def salience(v, rng):
    for double in SALIENT:
        for i_d in (-32768, -20000, -8000, -2 * double, -double, -1300, -1, 0, 1, 700, double // 2 - 1, double // 2, 8000, 32767):
            if not -32768 <= i_d <= 32767:
                continue
            kfi, i_q, inv_kfi = rng.choice((-9830, -500, 0, 0, 700, 11468)), rng.randrange(-8182, 8183), rng.randrange(1024, 32768)
            flux, per_flux = ref.salience_flux(double, i_d, kfi)
            torque, current = ref.salience_torque(flux, i_q), ref.salience_current(per_flux, i_q * 8192)
            v.rows.append([double, i_d, kfi, flux, per_flux, i_q, torque, current, inv_kfi, ref.salience_kfi(per_flux, inv_kfi)])
            if double > 2999:
                more, less = ref.salience_flux_real(double, i_d, kfi)
                v.compare([more, less, more * i_q / 8192, less * i_q / 8192], [flux / 8192, per_flux / 32768, torque / 8192, current / 2 ** 26])


@block("a salient motor's d current of the least current for the torque, step by step",
       "start 1 = it begins at zero; doubles: -i_d that doubles the flux; i_q, least Q13; of each case the first 30 steps and the hundredth, whose current "
       "is compared with the closed form",
       "start:u16 doubles:u16 i_q:s16 least:s16", least_db=66.0)
def salience_least(v, _):
    for double, i_q in ((12412, 4279), (12412, -4279), (12412, 6300), (3200, 6300), (25000, 3000), (57343, 7086), (12412, 300)):
        least = 0
        for n in range(100):
            least = ref.salience_least(double, least, i_q)
            if n < 30 or n == 99:
                v.rows.append([int(n == 0), double, i_q, least])
        v.compare([math.hypot(ref.mtpa_real(double, i_q), i_q)], [math.hypot(least, i_q)])


# ---- adaptation and load observer -----------------------------------------------------------------------------------

def lock(m, model, kphi, resistance, erpm, iq):
    """What the estimator sees in lock where the motor has `kphi` times the header's Kphi and `resistance` times its R: Ed, Eq, R i_q."""
    inv_kfi = m.inv_kfi * 16384
    kfi, rs, _ = model.apply(round(inv_kfi))
    emf, missing = erpm * 2048 / inv_kfi * kphi, (resistance * model.p["rs_base_q16"] - rs) * iq / 65536
    ahead = math.asin((erpm * 2048 / kfi - missing) / emf / math.sqrt(2)) - math.pi / 4
    return (ref.nearest(-abs(emf) * math.sin(ahead)), ref.nearest(emf * math.cos(ahead) + missing), iq * rs // 65536)


ADAPTATION_FORMAT = "back-EMF and R i_q Q12; changes kfi, rs Q31; inv_kfi of the table and of the model; the ratio is that of the changes"


@block("adaptation to Kphi x0.8 with R x1.5, x1.2 with x0.7, backwards, braking: flux where the speed prevails, R where the current does",
       ADAPTATION_FORMAT + "; from cleared states", "start:u16 e_d:s16 e_q:s16 ri:s16 kfi:s32 rs:s32", least_db=60.0)
def adaptation(v, _):
    p = MACHINE.adaptation() | {"rate_q16": 8192} # the largest, for a fiftieth of the rows
    v.constants = dict(p)
    cases = ((0.8, 1.5, 1, 1), (1.2, 0.7, 1, 1), (1.2, 1.5, -1, 1), (0.8, 1.5, 1, -1), (1.2, 0.7, -1, -1))
    for kphi, resistance, direction, braking in cases:
        model, real = ref.Adaptation(p), ref.AdaptationReal(p)
        for n in range(600):
            erpm, iq = ((5000, 300), (2500, 2000), (8000, 500), (2500, 2000 if braking > 0 else -1000))[n // 20 % 4]
            seen = lock(MACHINE, model, kphi, resistance, direction * erpm, direction * iq)
            model.learn(*seen)
            real.learn(*seen)
            v.add([int(n == 0), *seen], [model.kfi, model.rs], [real.kfi, real.rs], [model.kfi / 2 ** 31, model.rs / 2 ** 31])
        missed = [model.kfi / 2 ** 31 - (1 / kphi - 1), model.rs / 2 ** 31 - (resistance - 1)]
        if max(map(abs, missed)) > 0.01:
            raise ValueError(f"adaptation: {missed} off after Kphi x{kphi}, R x{resistance}")


@block("single steps of the adaptation: ends of the formats, bounds, no information, a random sample",
       ADAPTATION_FORMAT, "kfi0:s32 rs0:s32 e_d:s16 e_q:s16 ri:s16 inv_kfi0:s16 kfi:s32 rs:s32 inv_kfi:s16 rs_q16:u16 emf_max:s16",
       least_db=35.0)
def adaptation_step(v, rng):
    p = MACHINE.adaptation()
    v.constants = dict(p)
    ends = [(p[f"{x}_least"] * 65536, p[f"{x}_most"] * 65536) for x in ("kfi", "rs")]
    least, big = p["emf_least_q12"], (-32768, 32767)
    seen = [(d, q, ri) for d in (*big, 0, 1, -1) for q in (*big, least, -least) for ri in (*big, 0, 1, -1)]
    seen += [(d, q, ri) for d in (50, -50) for q in (least - 1, 1 - least, 0) for ri in (500, -500)]
    seen += [(*dither(rng, -3000, 3000, 2), *dither(rng, -2000, 2000, 1)) for _ in range(150)]
    for n, (d, q, ri) in enumerate(seen):
        model, real = ref.Adaptation(p, *(rng.choice((*e, 0, rng.randrange(*e))) for e in ends)), ref.AdaptationReal(p)
        before, inv_kfi = (model.kfi, model.rs), rng.choice((2048, 7956, 32767, rng.randrange(2048, 32768)))
        real.kfi, real.rs = (x / 2 ** 31 for x in before)
        model.learn(d, q, ri)
        real.learn(d, q, ri)
        v.add([*before, d, q, ri, inv_kfi], [model.kfi, model.rs, *model.apply(inv_kfi)],
              [real.kfi - before[0] / 2 ** 31, real.rs - before[1] / 2 ** 31],
              [(model.kfi - before[0]) / 2 ** 31, (model.rs - before[1]) / 2 ** 31])


OBSERVER_FORMAT = ("op 0 schedule by ref and iq, and step, 1 preset to speed ref; heavy 1 = the constants h_; ref electrical rpm; rho 2^-32 turns; "
                   "iq Q13; omega, load 16 fraction bits; load_q26 Q13 current with 13 fraction bits; the ratio is that of speed and load")
OBSERVER_COLUMNS = ("op:u16 heavy:u16 ref:s16 rho:u32 iq:s16 omega:s32 load:s32 rate:s16 large:s16 quick:s16 part:s16 load_q26:s32")
OBSERVED = (MACHINE.observer(), ref.Machine(inertia_kgm2=8e-4, speed_hz=1.5, load_hz=30.0).observer())


def observe(v, model, op, heavy, reference, rho, iq, real=None):
    for each in filter(None, (model, real)):
        if op:
            each.preset(rho, reference, iq)
        else:
            each.schedule(reference, iq)
            each.step(rho, iq)
    m = model
    v.rows.append([op, heavy, reference, rho, iq, m.omega, m.load, m.rate, m.large, m.quick, m.part, m.load_q26()])
    if real:
        v.compare([real.omega, real.load], [model.omega / 65536, model.load / 65536])


@block("observer in a loop around a shaft: preset, load on and off at 500 rpm both ways, at 150 rpm, a speed step, a heavy rotor",
       OBSERVER_FORMAT, OBSERVER_COLUMNS, least_db=55.0)
def observer(v, rng):
    v.constants = {f"{prefix}{k}": x for prefix, p in zip(("", "h_"), OBSERVED) for k, x in p.items()}
    for heavy, erpm, load, on in ((0, 2500, 1500, 200), (0, -2500, 900, 200), (0, 750, 500, 800), (1, 2500, 1000, 250)):
        observed_shaft(v, rng, (heavy, OBSERVED[heavy], (0.012, 0.003)[heavy]), erpm, load, on, on + 200 + 200 * heavy)


@block("observer where a count of speed is 4 electrical rpm: load on and off at 1167 Hz both ways, half a turn in a step, and at 140 Hz",
       OBSERVER_FORMAT.replace("ref electrical rpm", "ref 4 electrical rpm").replace("heavy 1 = the constants h_", "heavy 2"), OBSERVER_COLUMNS, least_db=55.0)
def observer_quick(v, rng):
    v.constants = QUICK.observer()
    for counts, load in ((17500, 1500), (-17500, 900), (2100, 900)):
        observed_shaft(v, rng, (2, QUICK.observer(), 0.012), counts, load, 250, 450, QUICK.speed_unit)


def observed_shaft(v, rng, rotor, erpm, load, on, off, speed_unit=1):
    """@param rotor its number in the rows, its constants, and by how much of an error of the speed its controller corrects it in a step"""
    heavy, p, share = rotor
    model, real = ref.Observer(p), ref.ObserverReal(p)
    unit = p["per_current_q16"] / 65536
    gain = share * 2 ** p["shift"] / unit # counts of current per count of speed
    speed, turns, wanted = float(erpm), 0.3, erpm
    observe(v, model, 1, heavy, erpm, round(turns * 2 ** 32) % 2 ** 32, 40, real)
    for n in range(off + 150):
        if n == off + 75:
            wanted = erpm + (200 if erpm > 0 else -200)
        iq = round(ref.clamp(gain * model.part / 32768 * (wanted - model.speed) + model.load_q26() / 8192, -5120, 5120))
        torque = (load if on <= n < off else 25) * (1 if speed > 0 else -1)
        before = speed
        speed += (iq - torque) * unit / 2 ** p["shift"]
        turns += (before + speed) / 2 * 8 * MACHINE.turns_per_erpm * speed_unit
        seen = turns + rng.uniform(-0.0001, 0.0001) # what dead time leaves on the angle
        observe(v, model, 0, heavy, wanted, round(seen * 2 ** 32) % 2 ** 32, iq + rng.randrange(-8, 9), real)
        missed = abs(model.load_q26() / 8192 - torque)
        if n in (on - 1, off - 1) and (abs(model.speed - speed) > 10 or missed > 30 + 0.03 * abs(torque)):
            raise ValueError(f"observer: {model.speed} counts, not {speed:.0f}, load {missed:.0f} counts off")


@block("observer at the ends of its formats: fastest speed, largest load, current and innovation of either sign; random inputs",
       OBSERVER_FORMAT, OBSERVER_COLUMNS)
def observer_ends(v, rng):
    v.constants = {f"{prefix}{k}": x for prefix, p in zip(("", "h_"), OBSERVED) for k, x in p.items()}
    for heavy, p in enumerate(OBSERVED):
        for sign in (1, -1):
            model = ref.Observer(p)
            observe(v, model, 1, heavy, sign * 32700, 0, sign * 8191)
            for n in range(24):
                observe(v, model, 0, heavy, sign * 32767, (n * 0x55555555 * sign) % 2 ** 32, sign * 10240)
            for n in range(24): # every step says half a turn
                observe(v, model, 0, heavy, -32768, n % 2 << 31, -sign * 10240)
            for part in (0, p["full_erpm"] // 4, p["full_erpm"] // 2, p["full_erpm"]): # where the shares of the rates bend, under load
                observe(v, model, 0, heavy, sign * part, 0, sign * 8191)
                observe(v, model, 0, heavy, sign * part, 0, sign * 300)
        for _ in range(40):
            observe(v, model, 0, heavy, rng.randrange(-32768, 32768), rng.randrange(2 ** 32), rng.randrange(-10240, 10241))


@block("start ramp in both directions to 1000 rpm at 10/1024 counts per period squared, by 20 every second one; every 499th period",
       "tick number; speed 1/1024 counts per period; angle 2^-32 turns; at_end is 1 from tick 27961 = 1.398 s on",
       "direction:s16 tick:u16 speed:s32 angle:u32 at_end:u16", least_db=130.0)
def forced_angle(v, _):
    exact_end = 1000 * 5 * 50e-6 / 60 * 65536 * 1024
    rate, end = 10, round(exact_end)
    v.constants = {"end_speed_q10": end, "increase_rate_q10": rate}
    for direction in (1, -1):
        speed, angle, exact = 0, 0, 0.0
        for tick in range(1, 31001):
            speed, angle, at_end = ref.forced_angle(rate, end, direction, speed, angle, tick)
            exact_speed = min(rate * (tick + tick % 2), exact_end)
            exact += exact_speed / 1024
            if tick % 499 == 1 or 27960 <= tick <= 27964:
                nearest = exact + ref.wrap16(round(direction * angle / 65536 - exact) % 65536)
                v.add([direction, tick], [speed, angle, at_end], [exact], [nearest])


@block("reference ramp: far, nearer than two steps (snap), exactly two steps, across zero, at the ends of the range",
       "electrical rpm", "reference:s16 target:s16 step:s16 next:s16")
def speed_ramp(v, rng):
    for step in (1, 8, 100, 1000):
        for base in (-5000, -1, 0, 7, 14000):
            for d in (-3 * step, -2 * step - 1, -2 * step, -2 * step + 1, -step, -1, 0,
                      1, step, 2 * step - 1, 2 * step, 2 * step + 1, 9 * step):
                v.rows.append([base, base + d, step])
    v.rows += [[-32768, 32767, 8], [32767, -32768, 8], [32767, 32767, 1], [-32768, -32768, 1], [32760, 32767, 8], [-32760, -32768, 8]]
    v.rows += [[*dither(rng, -32000, 32000, 2), rng.randrange(1, 700)] for _ in range(40)]
    for row in v.rows:
        row.append(ref.speed_ramp(*row))


@block("hand-over: voltage and current vectors seen from the estimator's frame, measured offset of every size and sign",
       "angles 65536 = one turn; voltages Q14; currents Q13; i_q the signed open-loop current",
       "forced:u16 estimated:u16 v_d:s16 v_q:s16 i_q:s16 offset:s16 new_v_d:s16 new_v_q:s16 new_i_d:s16 new_i_q:s16",
       least_db=67.0)
def hand_over(v, rng):
    edges = [0, 1, -1, 100, -100, 8192, -8192, 15000, -15000, 16384, -16384, 30000, -30000, -32768, 32767]
    for offset in edges + dither(rng, -32768, 32767, 50):
        forced = rng.randrange(65536)
        u = cmath.rect(rng.uniform(500, 15000), rng.uniform(0, 6.3))
        args = (forced, (forced - offset) % 65536, (round(u.real), round(u.imag)), rng.choice((-2625, 2625)))
        out = ref.hand_over(*args)
        v.add([args[0], args[1], *args[2], args[3]], out, ref.hand_over_real(*args), out[1:])


@block("constants of Equations 5 to 8 for the motor of AN1292 with four current ranges (A * 100 in the name)",
       "c395: 3.95 A, c709: 7.09 A, c440: 4.4 A, c2200: 22 A; in the drive's formats")
def params(v, _):
    """What include/drive/scaling/ must give to 1 count, in float64."""
    for amperes in (3.95, 7.09, 4.4, 22.0):
        machine = ref.Machine(peak_current_a=amperes)
        v.constants |= {f"c{round(amperes * 100)}_{name}": value for name, value in machine.estimator().items()}
    m = MACHINE
    v.constants |= {**{f"svm_{name}": value for name, value in m.modulator().items()},
                    **{f"observer_{name}": value for name, value in m.observer().items()},
                    **{f"adaptation_{name}": value for name, value in m.adaptation().items()},
                    "tight_rs_most": ref.Machine(over_current_a=5.0).adaptation()["rs_most"],
                    "tight_d_ilimit_hs_q14": ref.Machine(over_current_a=5.0).estimator()["d_ilimit_hs_q14"],
                    "duty_per_volt_24": m.duty_per_volt_q16(24.0), "duty_per_volt_12": m.duty_per_volt_q16(12.0),
                    "radius_24": m.circle_radius_q14(24.0), "radius_34": m.circle_radius_q14(34.0)}


@block("constants of motors whose speeds are counted in 2 and 4 electrical rpm", "u2: the motor of AN1292 for 7500 rpm at 100 us; u4: a spindle for 10500 rpm")
def params_quick(v, _):
    """As params()."""
    for name, m in (("u2", ref.Machine(maximum_rpm=7500.0, period_s=100e-6, speed_hz=8.0, load_hz=60.0)), ("u4", QUICK)):
        v.constants |= {f"{name}_unit": m.speed_unit, **{f"{name}_{key}": value for key, value in m.estimator().items()},
                        **{f"{name}_observer_{key}": value for key, value in m.observer().items()}}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare with the committed files instead of writing them")
    options = parser.parse_args()
    texts = {f"{v.name}.txt": v.text() for v in (make() for make in BLOCKS)}
    folder = HERE / "vectors"
    folder.mkdir(exist_ok=True)
    committed = {p.name: p.read_text(encoding="ascii") for p in folder.glob("*.txt")}
    differing = sorted(name for name in texts.keys() | committed.keys() if texts.get(name) != committed.get(name))
    for name in differing:
        if options.check:
            print(f"foc33: golden vectors differ, test/golden/vectors/{name}: run make golden, look at the change, commit it",
                  file=sys.stderr)
        elif name in texts:
            (folder / name).write_text(texts[name], encoding="ascii")
        else:
            (folder / name).unlink()
    return 1 if options.check and differing else 0


if __name__ == "__main__":
    sys.exit(main())
