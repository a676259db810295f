"""Numbers as data sheets print them: units, what they refer to (line to line, phase, winding), and the step to SI per star phase.

Every motor is turned into the star with the same terminals, so that all values are those of one star phase:

    resistance, inductance   line to line      / 2         (both connections: two star phases in series)
                             winding, star     * 1
                             winding, delta    / 3         (a delta Z is a star Z/3)

Kphi here is the peak line-to-line back-EMF in volts at 1000 mechanical rpm. With P pole pairs, psi the flux linkage of a star phase
(peak, per electrical rad/s) and w1 = 1000 * 2 pi / 60 rad/s:

    phase, peak       psi * P * w                             line to line, peak    Kll = sqrt(3) * psi * P   in V s/rad (mechanical)
    Kphi            = Kll * w1 = sqrt(3) * psi * P * w1        hence                 psi = Kphi / (sqrt(3) * w1 * P)
    torque          = 3/2 * P * psi * i_q, i_q the peak of a phase current, so Kt(peak) = 3/2 * P * psi = sqrt(3)/2 * Kll
    Kt(rms)         = sqrt(2) * Kt(peak)                       (the same torque at 1/sqrt(2) of the number of amperes)

A sheet's "dc" values belong to six-step commutation: a dc current flows through two phases, and they change every 60 degrees around
the peak of the line-to-line back-EMF. The mean of a cosine over +-30 degrees is 3/pi, so

    Kt(dc) in N m/A = 3/pi * Kll = back-EMF(dc) in V s/rad,     speed constant = 60 / (2 pi * 3/pi * Kll) in rpm/V
    current         : the same torque needs i_peak = Kt(dc)/Kt(peak) * i_dc = 2 sqrt(3)/pi * i_dc = 1.103 i_dc
                      (that is the fundamental of the six-step current as well)
"""

import math
import re
from dataclasses import dataclass

from .errors import UserError
from .toml_file import REQUIRED, Section

RPM = 2.0 * math.pi / 60.0
KRPM = 1000.0 * RPM
SQRT2, SQRT3 = math.sqrt(2.0), math.sqrt(3.0)
OUNCE_INCH_NM = 0.028349523125 * 9.80665 * 0.0254
SIX_STEP_MEAN = 3.0 / math.pi
PEAK_PER_DC = 2.0 * SQRT3 / math.pi
REFERENCE_DEGC = 25.0
AT_DEGC = (-40.0, 155.0)
AT_HZ = (1.0, 1e6)
REFERENCES = r"\b(?:peak|rms|dc|phase|winding|line-to-line)\b"
"""What a unit may say of its number besides the size."""


@dataclass(frozen=True)
class Conversion:
    """value in SI = factor * number, or factor / number for the reciprocal forms (rpm/V)."""

    factor: float
    reciprocal: bool = False

    def __call__(self, number: float) -> float:
        """To SI, to 14 digits, so that 50 us are 5e-05 s and not its neighbour."""
        return float(f"{self.factor / number if self.reciprocal else self.factor * number:.14g}")

    def given(self, si: float) -> float:
        """From SI back to the number in this unit."""
        return self.factor / si if self.reciprocal else si / self.factor


@dataclass(frozen=True)
class Kind:
    """A physical quantity: the units a file may use, and the range beyond which a value is a mistake."""

    si_unit: str
    minimum: float
    maximum: float
    units: dict[str, Conversion]


@dataclass(frozen=True)
class Key:
    """A key of a motor or board file, as docs/files.md lists it."""

    meaning: str
    kind: Kind | None = None
    """None for true or false; a count has no units to choose from."""
    default: str = "must be given"
    plant: str = ""
    """Key of the virtual board with the same value, "" for what it does not need."""

    @property
    def has_units(self) -> bool:
        return self.kind is not None and bool(self.kind.units)


@dataclass(frozen=True)
class Quantity:
    """One number of a file: in SI, as it was written, and where it comes from."""

    name: str
    value_si: float
    si_unit: str
    given: str
    source: str
    where: str

    @property
    def unchecked(self) -> bool:
        """True for a number that nobody has compared with the sheet: its source carries the mark [?]."""
        return "[?]" in self.source


def _scaled(**factors: float) -> dict[str, Conversion]:
    return {name.replace("__", "/").replace("_", " "): Conversion(factor) for name, factor in factors.items()}


def _per_star_phase(scales: dict[str, float], connection: str) -> dict[str, Conversion]:
    """Impedances. "phase" is not a unit of a delta motor: some sheets mean the winding by it, some the star phase."""
    parts = {"line-to-line": 0.5, "winding": 1.0 / 3.0} if connection == "delta" else {"line-to-line": 0.5, "phase": 1.0, "winding": 1.0}
    return {f"{unit} {part}": Conversion(scale * share) for unit, scale in scales.items() for part, share in parts.items()}


def resistance(connection: str) -> Kind:
    """Ohms of a star phase."""
    return Kind("ohm", 0.01, 40.0, _per_star_phase({"ohm": 1.0, "mohm": 1e-3}, connection))


def inductance(connection: str) -> Kind:
    """Henries of a star phase."""
    return Kind("H", 1e-5, 30e-3, _per_star_phase({"mH": 1e-3, "uH": 1e-6, "H": 1.0}, connection))


def kphi(connection: str, pole_pairs: int) -> Kind:
    """All forms of the motor constant, to V peak line to line per 1000 mechanical rpm; equations at the top of this file."""
    line_to_line = {"V peak line-to-line/krpm": 1.0, "V rms line-to-line/krpm": SQRT2, "V dc/krpm": 1.0 / SIX_STEP_MEAN}
    phase = {} if connection == "delta" else {"V peak phase/krpm": SQRT3, "V rms phase/krpm": SQRT3 * SQRT2}
    flux = SQRT3 * pole_pairs * KRPM
    torque = {}
    for unit, scale in (("N m/A", 1.0), ("mN m/A", 1e-3), ("oz in/A", OUNCE_INCH_NM)):
        torque[f"{unit} peak"] = scale * 2.0 / SQRT3 * KRPM
        torque[f"{unit} rms"] = scale * 2.0 / SQRT3 * KRPM / SQRT2
        torque[f"{unit} dc"] = scale / SIX_STEP_MEAN * KRPM
    factors = line_to_line | phase | {"V s/rad": flux, "mV s/rad": flux * 1e-3, "V s/rad line-to-line": KRPM} | torque
    units = {name: Conversion(factor) for name, factor in factors.items()}
    return Kind("V peak line-to-line/krpm", 0.2, 2000.0, units | {"rpm/V": Conversion(1000.0 / SIX_STEP_MEAN, reciprocal=True)})


KPHI_FORMS = ("V peak line-to-line/krpm", "V rms line-to-line/krpm", "V s/rad line-to-line", "V s/rad", "N m/A peak", "N m/A rms", "N m/A dc", "rpm/V")


def kphi_forms(v_per_krpm: float, pole_pairs: int) -> str:
    """The same motor constant in the forms that sheets give, to compare with; V s/rad alone is the flux of a star phase."""
    known = kphi("Y", pole_pairs).units
    return " = ".join(f"{known[unit].given(v_per_krpm):.4g} {unit}" for unit in KPHI_FORMS)


RESISTANCE_TEMPCO = Kind("1/K", 0.0, 0.01, {"%/K": Conversion(0.01), "1/K": Conversion(1.0), "ppm/K": Conversion(1e-6)})
KPHI_TEMPCO = Kind("1/K", -0.004, 0.0, RESISTANCE_TEMPCO.units)
INERTIA = Kind("kg m2", 1e-8, 10.0, _scaled(kg_m2=1.0, g_cm2=1e-7, kg_cm2=1e-4, g_m2=1e-3, oz_in_s2=OUNCE_INCH_NM))
LOAD_INERTIA = Kind("kg m2", 0.0, 10.0, INERTIA.units)
TORQUE_UNITS = _scaled(N_m=1.0, mN_m=1e-3, N_cm=1e-2, oz_in=OUNCE_INCH_NM)
TORQUE = Kind("N m", 1e-4, 100.0, TORQUE_UNITS)
FRICTION = Kind("N m", 0.0, 10.0, TORQUE_UNITS)
VISCOUS = Kind("N m s", 0.0, 10.0, _scaled(N_m_s=1.0, mN_m_s=1e-3, uN_m_s=1e-6, N_m__krpm=1.0 / KRPM, mN_m__krpm=1e-3 / KRPM,
                                         oz_in__krpm=OUNCE_INCH_NM / KRPM))
SPEED = Kind("rpm", 50.0, 32000.0, {"rpm": Conversion(1.0), "rad/s": Conversion(1.0 / RPM)})
VOLTAGE = Kind("V", 3.0, 400.0, {"V": Conversion(1.0)})
THERMAL_TIME = Kind("s", 2.0, 1000.0, {"s": Conversion(1.0), "min": Conversion(60.0)})
CURRENT = Kind("A peak", 0.02, 100.0, {"A peak": Conversion(1.0), "A rms": Conversion(SQRT2), "A dc": Conversion(PEAK_PER_DC)})


def read(section: Section, key: str, kind: Kind, source: str | None = None, extra: tuple[str, ...] = ()) -> Quantity:
    """key = { value = 5.34, unit = "ohm line-to-line", source = "..." } as a Quantity.

    `source` is what stands in for a missing one; None refuses that. `extra` names keys that the caller reads itself."""
    inner = _table(section, key, next(iter(kind.units)), ("value", "unit", "source", *extra))
    unit = _unit(inner, key, kind)
    number = _number(inner, "value", key)
    conversion = kind.units[unit]
    low, high = sorted((conversion.given(kind.minimum), conversion.given(kind.maximum)))
    tolerance = 1e-9 * max(abs(low), abs(high))
    if not low - tolerance <= number <= high + tolerance:
        raise inner.fail("value", f"'{key}' = {number:g} {unit} is impossible", f"choose {low:g} .. {high:g} {unit}")
    return Quantity(key, conversion(number), kind.si_unit, f"{number:.10g} {unit}", _source(inner, key, source), section.where(key))


def read_count(section: Section, key: str, kind: Kind, source: str | None = None) -> Quantity:
    """key = { value = 5, source = "..." } with a whole number; `source` as in read()."""
    inner = _table(section, key, None, ("value", "source"))
    count = _number(inner, "value", key)
    if not kind.minimum <= count <= kind.maximum:
        raise inner.fail("value", f"'{key}' = {count:g} is impossible", f"choose {kind.minimum:g} .. {kind.maximum:g}")
    if count != int(count):
        raise inner.fail("value", f"'{key}' = {count:g} is not a whole number", "give a whole one")
    return Quantity(key, count, kind.si_unit, f"{count:g} {kind.si_unit}", _source(inner, key, source), section.where(key))


def read_pair(section: Section, key: str, kind: Kind) -> tuple[float, float]:
    """key = { values = [4.06, 5.66], unit = "...", source = "..." } in SI, the smaller first."""
    inner = _table(section, key, next(iter(kind.units)), ("values", "unit", "source"))
    conversion = kind.units[_unit(inner, key, kind)]
    given = inner.data.get("values")
    if not isinstance(given, list) or len(given) != 2:
        raise UserError(f"'{key}' has no pair of values", inner.where(), "write values = [smallest, largest]")
    numbers = [_number(inner, "values", key, item) for item in given]
    _source(inner, key, None)
    if min(numbers) <= 0.0:
        raise inner.fail("values", f"'{key}' = {min(numbers):g} is impossible", "choose values above zero")
    low, high = sorted(conversion(number) for number in numbers)
    if low < kind.minimum or high > kind.maximum:
        raise inner.fail("values", f"'{key}' = {low:g} .. {high:g} {kind.si_unit} is impossible",
                         f"choose {kind.minimum:g} .. {kind.maximum:g} {kind.si_unit}")
    return low, high


def _table(section: Section, key: str, unit: str | None, parts: tuple[str, ...]) -> Section:
    example = f"write {key} = {{ value = ..., " + (f"unit = \"{unit}\", " if unit else "") + "source = \"...\" }"
    if key not in section:
        raise UserError(f"'{key}' is missing", section.where(), example)
    if not isinstance(section.data[key], dict):
        section.asked.add(key)
        raise section.fail(key, f"'{key}' has no unit and source" if unit else f"'{key}' has no source", example)
    inner = section.section(key)
    assert inner is not None
    inner.close(set(parts))
    return inner


def detail(section: Section, key: str, part: str, default: float | None, minimum: float, maximum: float) -> float | None:
    """A further number of an entry that read() has seen, such as at_degc."""
    inner = Section(section.document, section.data[key], section.path + (key,))
    if part not in inner:
        return default
    number = _number(inner, part, part)
    if not minimum <= number <= maximum:
        raise inner.fail(part, f"'{part}' of {key} = {number:g} is impossible", f"choose {minimum:g} .. {maximum:g}")
    return number


def _number(inner: Section, part: str, key: str, value: object = None) -> float:
    if value is None:
        if part not in inner:
            raise UserError(f"'{key}' has no {part}", inner.where(), f"add {part} = number")
        value = inner.data[part]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
        raise inner.fail(part, f"'{key}' is not a number", "write a number, without quotes")
    try:
        return float(value)
    except OverflowError: # every caller has a range, which tells it then
        return math.copysign(math.inf, value > 0 or -1)


def _unit(inner: Section, key: str, kind: Kind) -> str:
    unit = inner.text("unit", None)
    if unit is None:
        raise UserError(f"'{key}' has no unit", inner.where(), "add unit = one of " + ", ".join(kind.units))
    unit = _canonical(unit, kind)
    meant = _of_which(unit, kind)
    if unit not in kind.units and meant:
        raise inner.fail("unit", f"'{unit}' does not say which {key}", "write " + " or ".join(meant))
    if unit not in kind.units:
        raise inner.fail("unit", f"'{unit}' is no unit of {key}", "use one of " + ", ".join(kind.units))
    return unit


def _canonical(unit: str, kind: Kind) -> str:
    """The unit as the table has it, however it is spaced or printed: Nm, N*m and N·m are N m."""
    def bare(text: str) -> str:
        for printed, plain in (("·", " "), ("*", " "), ("²", "2"), ("^2", "2"), ("µ", "u"), ("μ", "u"), ("Ω", "ohm"), ("Ω", "ohm")):
            text = text.replace(printed, plain)
        return "".join(text.split())
    return next((name for name in kind.units if bare(name) == bare(unit)), " ".join(unit.split()))


def _of_which(unit: str, kind: Kind) -> list[str]:
    """The units that say more than this one: N m/A may be peak, rms or dc."""
    said = set(re.findall(REFERENCES, unit))
    return [name for name in kind.units if _bare(name) == _bare(unit) and said < set(re.findall(REFERENCES, name))]


def _bare(unit: str) -> str:
    return re.sub(REFERENCES, "", unit).replace(" ", "")


def _source(inner: Section, key: str, default: str | None) -> str:
    if default is None and "source" not in inner:
        raise UserError(f"'{key}' has no source", inner.where(), "add source = \"where the number comes from\"")
    return inner.text("source", REQUIRED if default is None else default)
