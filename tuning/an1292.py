"""What a userparms.h of AN1292 says in units: its normalisation reversed, with the line of each number, and what contradicts what.

Counts are AN1292's, Q15 of full scale: U0 volts, I0 = NORM_CURRENT_CONST amperes. Equation numbers are its own, in their corrected form."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from tools.common.errors import Problems, UserError, suggestion
from tools.common.param_rows import ENTRIES, modes

from . import constants
from .c_header import Header, Number
from .fw_tables import STEP_ERPM, Entry

SQRT3 = math.sqrt(3.0)
Q15 = 32768.0
FULL_COUNT = 32767
LATER_RS_DIVISOR = 16
LATER_NAMES = ("SPEEDREFRAMP_COUNT", "Q15_OVER_CURRENT_THRESHOLD")
"""Only AN1292's version of 2022 has them; it divides NORM_RS by 16, the earlier ones by 2."""
DIVISORS = {"NORM_RS": 2, "NORM_LSDTBASE": 256, "NORM_INVKFIBASE": 2}
DIVISOR_KEYS = {"NORM_RS": "rs_divisor", "NORM_LSDTBASE": "ls_divisor", "NORM_INVKFIBASE": "invkfi_divisor"}
SAME = 0.005
"""Two numbers for one thing may differ by that: counts are rounded."""
SAME_SPEED = 0.02
NEEDED = ("NOPOLESPAIRS", "NOMINAL_SPEED_RPM", "NORM_CURRENT_CONST", "NORM_RS", "NORM_LSDTBASE", "NORM_INVKFIBASE")
ALIASES = {"NOPOLESPAIRS": ("NOPOLEPAIRS", "NO_POLE_PAIRS", "POLE_PAIRS", "POLEPAIRS"), "LOCK_TIME": ("LOCKTIME",),
           "MAXIMUM_SPEED_RPM": ("MAX_SPEED_RPM",), "NOMINAL_SPEED_RPM": ("NOM_SPEED_RPM",), "NORM_LSDTBASE": ("NORM_LSDT",), "NORM_INVKFIBASE": ("NORM_INVKFI",),
           "SPEED_INDEX_CONST": ("SPEEDINDEX_CONST",), "INITOFFSET_TRANS_OPEN_CLSD": ("INITOFFSET",)}
"""Names that forks of AN1292's header use for the same."""
DERIVED = ("END_SPEED", "ENDSPEED_ELECTR", "NOMINALSPEED_ELECTR", "MAXIMUMSPEED_ELECTR", "DECIMATE_NOMINAL_SPEED", "LOOPINTCY", "DDEADTIME", "MAXPOTVAL_SHL1")
"""AN1292's names for what follows from other lines."""
STEMS = ("IDREF_SPEED", "INVKFI_SPEED", "LS_OVER2LS0_SPEED")


# ---- formulas -----------------------------------------------------------------------------------------------------------------
def base_volt(supply_v: float, dead_time_s: float, period_s: float) -> float:
    """U0 = Vdc / sqrt(3) * (1 - Td / Ts) / 2^15, the largest phase voltage less dead time's share, per count."""
    return supply_v / SQRT3 * (1.0 - dead_time_s / period_s) / Q15


def resistance_ohm(count: float, divisor: float, i0: float, u0: float) -> float:
    """Equation 5: NORM_RS = Rs * I0 / U0 * 2^15 / divisor, so Rs = NORM_RS * divisor * U0 / I0 / 2^15."""
    return count * divisor * u0 / i0 / Q15


def inductance_h(count: float, divisor: float, i0: float, u0: float, period_s: float) -> float:
    """Equation 5: NORM_LSDTBASE = Ls / Ts * I0 / U0 * 2^15 / divisor, so Ls = NORM_LSDTBASE * divisor * Ts * U0 / I0 / 2^15."""
    return count * divisor * period_s * u0 / i0 / Q15


def kphi_v_per_krpm(count: float, divisor: float, pole_pairs: float, u0: float) -> float:
    """Equation 6: NORM_INVKFIBASE = sqrt(3) * 1000 * P * U0 / Kphi * 2^15 / divisor; Kphi in V peak line to line per 1000 rpm."""
    return SQRT3 * 1000.0 * pole_pairs * u0 * Q15 / (count * divisor)


def period_of_deltat(count: float) -> float:
    """NORM_DELTAT = Ts / 60 * 2^16 * 2^15, so Ts = NORM_DELTAT * 60 / 2^31 seconds."""
    return count * 60.0 / 2.0 ** 31


def derivative_rpm(count: float, samples: int, pole_pairs: float, period_s: float) -> float:
    """D_ILIMIT = samples * 2 * (n / 60) * P * Ts * 2^15, so n = D_ILIMIT * 60 / (samples * 2 * P * Ts * 2^15) rpm."""
    return count * 60.0 / (samples * 2.0 * pole_pairs * period_s * Q15)


def ramp_rpm_s(rate: float, pole_pairs: float, period_s: float) -> float:
    """The forced angle's step grows by rate / 1024 of 2^16 counts a turn in each period: rate / 2^26 / Ts^2 * 60 / P rpm/s."""
    return rate / 2.0 ** 26 / period_s ** 2 * 60.0 / pole_pairs


def reference_rpm_s(count: float, every: float, pole_pairs: float, period_s: float) -> float:
    """SPEEDREFRAMP electrical rpm in every `every` periods: SPEEDREFRAMP / (every * Ts) / P rpm/s."""
    return count / (every * period_s) / pole_pairs


# ---- what is read -------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Line:
    """One name of the header: its number in units, where it goes, or why it goes nowhere."""

    line: int
    name: str
    written: str
    shown: str
    goes_to: str = ""
    why: str = ""


@dataclass
class UserParms:
    """A whole header in SI units."""

    header: Header
    supply_v: float
    pole_pairs: int = 0
    period_s: float = 0.0
    dead_time_s: float = 0.0
    ampere: float = 0.0
    """I0, of a count"""
    volt: float = 0.0
    """U0, of a count"""
    gain: float = -0.5
    """KCURRA: 0.5 is 1, negative for a shunt in the low leg"""
    rs_ohm: float = 0.0
    ls_h: float = 0.0
    kphi: float = 0.0
    nominal_rpm: float = 0.0
    maximum_rpm: float = 0.0
    divisors: dict[str, int] = field(default_factory=lambda: dict(DIVISORS))
    tables: list[Entry] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def full_scale_a(self) -> float:
        """Current at the converter's end: i = 2 K * count, so 2 |K| * 32768 * I0."""
        return 2.0 * abs(self.gain) * Q15 * self.ampere

    def name_of(self, name: str) -> str:
        """The name that the header uses for it, "" for none."""
        return next((each for each in (name, *ALIASES.get(name, ())) if each in self.header and self.header.defines[each].parameters is None), "")

    def number(self, name: str, low: float = -math.inf, high: float = math.inf) -> float:
        """A number within a range; a UserError with the line otherwise."""
        used = self.name_of(name)
        if not used:
            raise UserError(f"{name} is missing", self.header.label, f"add #define {name} with its number")
        value = float(self.header.value(used))
        if not low <= value <= high:
            raise UserError(f"{used} = {value:g} is out of range", self.header.place(used), f"choose {low:g} .. {high:g}")
        return value

    def whole(self, name: str, low: float, high: float) -> int:
        value = self.number(name, low, high)
        if value != round(value):
            raise UserError(f"{self.name_of(name)} = {value:g} is not a whole number", self.where(name), "write a whole number, which C's Q15() gives")
        return round(value)

    def maybe(self, name: str, low: float = -FULL_COUNT - 1, high: float = FULL_COUNT) -> float | None:
        """A number that may be missing."""
        return self.number(name, low, high) if self.name_of(name) else None

    def fraction(self, name: str) -> float | None:
        """A Q15 count as a fraction of one; 0.5 stands for itself."""
        if not self.name_of(name):
            return None
        value: Number = self.header.value(self.name_of(name))
        if isinstance(value, float) and abs(value) <= 1.0:
            return value
        return self.number(name, -FULL_COUNT - 1, FULL_COUNT) / Q15

    def where(self, name: str) -> str:
        """File and line of a name's definition; the file where there is none."""
        used = self.name_of(name)
        return self.header.place(used) if used else self.header.label

    def ampere_of(self, name: str) -> float | None:
        count = self.maybe(name)
        return None if count is None else count * self.ampere


def read(header: Header, supply_v: float, dead_time_s: float, divisors: dict[str, int]) -> UserParms:
    """The header in units, at this supply; `dead_time_s` where the header has none, `divisors` what replaces AN1292's."""
    found = UserParms(header, supply_v)
    _refuse_missing(found)
    problems = Problems()
    problems.attempt(lambda: _read_board(found, dead_time_s))
    problems.attempt(lambda: _read_divisors(found, divisors))
    problems.attempt(lambda: _read_speeds(found))
    problems.tell()
    _read_motor(found)
    _refuse_implausible(found)
    found.tables = _read_tables(found)
    found.lines = _lines(found)
    found.contradictions = [text for text in (rule(found) for rule in RULES) if text]
    return found


def _refuse_missing(found: UserParms) -> None:
    missing = [name for name in NEEDED if not found.name_of(name)]
    if not found.name_of("LOOPTIME_SEC") and not found.name_of("NORM_DELTAT"):
        missing.append("LOOPTIME_SEC")
    if not missing:
        return
    if "MOTOR_RS_OHM" in found.header:
        raise UserError("this is a userparams.h of foc33, not a header of AN1292", found.header.label, "use it as it is: make run USERPARAMS=folder")
    unknown = {name for name in found.header.defines if name not in known_names()}
    near = [hint for name in missing for hint in [suggestion(name, unknown)] if hint.startswith("did you") and hint.strip("?").split("'")[1][:4] == name[:4]]
    verb = "is" if len(missing) == 1 else "are"
    raise UserError(f"{', '.join(missing)} {verb} missing", found.header.label, near[0] if near and len(missing) == 1 else
                    "add each with its number; an #ifdef may hide one, then DEFINES=-DNAME")


def _read_board(found: UserParms, dead_time_s: float) -> None:
    found.pole_pairs = found.whole("NOPOLESPAIRS", 1, 50)
    if found.name_of("LOOPTIME_SEC"):
        found.period_s = found.number("LOOPTIME_SEC", 25e-6, 140e-6)
    else:
        found.period_s = float(f"{period_of_deltat(found.number('NORM_DELTAT', 895, 5011)):.3g}")
        found.notes.append(f"LOOPTIME_SEC is missing: {found.period_s * 1e6:.4g} us follow from NORM_DELTAT")
    if found.name_of("DEADTIME_SEC"):
        found.dead_time_s = found.number("DEADTIME_SEC", 0.5e-6, 3e-6)
    else:
        found.dead_time_s = dead_time_s
        found.notes.append(f"DEADTIME_SEC is missing: {dead_time_s * 1e6:g} us are the board file's")
    found.ampere = found.number("NORM_CURRENT_CONST", 1e-6, 0.01)
    gain = found.fraction("KCURRA")
    if gain is not None:
        if abs(gain) < 0.1:
            raise UserError(f"KCURRA = {gain:g} measures no current", found.where("KCURRA"), "write Q15(0.5) for a gain of 1, Q15(-0.5) for a shunt in the low leg")
        found.gain = gain
    found.volt = base_volt(found.supply_v, found.dead_time_s, found.period_s)


def _read_divisors(found: UserParms, given: dict[str, int]) -> None:
    """Which power of two a constant was divided by: SET, the header's own NORM_RS_SCALE (an exponent), or what its version does."""
    later = [name for name in LATER_NAMES if name in found.header]
    if later:
        found.divisors["NORM_RS"] = LATER_RS_DIVISOR
        found.notes.append(f"{later[0]} is a name of AN1292's version of 2022, which divides NORM_RS by {LATER_RS_DIVISOR}; rs_divisor=2 in SET if yours does not")
    for name in DIVISORS:
        scale = found.maybe(f"{name}_SCALE", 0, 15)
        if scale is not None:
            found.divisors[name] = 1 << round(scale)
        for other in found.header.defines:
            if other.startswith(f"{name}_") and other not in known_names() and name not in given:
                found.notes.append(f"line {found.header.defines[other].line}: {other} is not read; {name} is taken as divided by {found.divisors[name]}: "
                                   f"if yours is not, {DIVISOR_KEYS[name]}= in SET")
    found.divisors |= given


def _read_speeds(found: UserParms) -> None:
    found.nominal_rpm = found.number("NOMINAL_SPEED_RPM", 50, 32000)
    found.maximum_rpm = found.maybe("MAXIMUM_SPEED_RPM", 50, 32000) or found.nominal_rpm
    if found.maximum_rpm < found.nominal_rpm:
        raise UserError(f"MAXIMUM_SPEED_RPM = {found.maximum_rpm:g} is below NOMINAL_SPEED_RPM = {found.nominal_rpm:g}", found.where("MAXIMUM_SPEED_RPM"), "raise it")


def _read_motor(found: UserParms) -> None:
    counts = {name: found.whole(name, 1, FULL_COUNT) for name in DIVISORS}
    divisors = found.divisors
    found.rs_ohm = resistance_ohm(counts["NORM_RS"], divisors["NORM_RS"], found.ampere, found.volt)
    found.ls_h = inductance_h(counts["NORM_LSDTBASE"], divisors["NORM_LSDTBASE"], found.ampere, found.volt, found.period_s)
    found.kphi = kphi_v_per_krpm(counts["NORM_INVKFIBASE"], divisors["NORM_INVKFIBASE"], found.pole_pairs, found.volt)


def _refuse_implausible(found: UserParms) -> None:
    """A motor that cannot be is a wrong supply, divisor or constant: the motor file would be refused, too."""
    problems = Problems()

    def within(value: float, low: float, high: float, what: str, name: str, remedy: str) -> None:
        if not low <= value <= high:
            problems.found.append(UserError(f"{found.name_of(name)} stands for {what}, {low:g} .. {high:g} are possible", found.where(name), remedy))

    current = "check NORM_CURRENT_CONST, the supply (SET=supply=24) and "
    within(found.rs_ohm, 0.01, 40.0, f"{found.rs_ohm:.3g} ohm", "NORM_RS", current + "the divisor (SET=rs_divisor=2)")
    within(found.ls_h * 1e3, 0.01, 30.0, f"{found.ls_h * 1e3:.3g} mH", "NORM_LSDTBASE", current + "the divisor (SET=ls_divisor=256)")
    emf_share = found.kphi * found.nominal_rpm / 1000.0 / found.supply_v
    within(emf_share, 0.25, 1.25, f"a back-EMF of {emf_share:.2g} times the supply at NOMINAL_SPEED_RPM", "NORM_INVKFIBASE",
           "check NOPOLESPAIRS, the speed, the supply (SET=supply=24) and the divisor (SET=invkfi_divisor=2)")
    within(found.ls_h / found.rs_ohm * 1e3, 0.02, 50.0, f"L/R = {found.ls_h / found.rs_ohm * 1e3:.3g} ms", "NORM_LSDTBASE", "check NORM_RS and NORM_LSDTBASE")
    problems.tell()


# ---- tables -------------------------------------------------------------------------------------------------------------------
def _read_tables(found: UserParms) -> list[Entry]:
    """The 18 entries: d current in A, 1/Kphi over its base, Ls / (2 Ls0); [] for a header without."""
    columns: dict[str, list[float]] = {}
    for stem in STEMS:
        missing = [i for i in range(ENTRIES) if not found.name_of(f"{stem}{i}")]
        if len(missing) == ENTRIES:
            continue
        if missing:
            raise UserError(f"{stem}{missing[0]} is missing", found.where(f"{stem}{min(set(range(ENTRIES)) - set(missing))}"), f"a table has {ENTRIES} entries, 0 .. {ENTRIES - 1}")
        columns[stem] = [_entry(found, stem, i) for i in range(ENTRIES)]
    if not columns:
        return []
    base = found.number("NORM_INVKFIBASE")
    idref, kfi, ls = (columns.get(stem, [usual] * ENTRIES) for stem, usual in zip(STEMS, (0.0, base, 0.5)))
    return _spaced(found, [Entry(i_d, k / base, ratio) for i_d, k, ratio in zip(idref, kfi, ls)])


def _entry(found: UserParms, stem: str, i: int) -> float:
    name = f"{stem}{i}"
    if stem == "IDREF_SPEED":
        return found.number(name, -FULL_COUNT - 1, 0) * found.ampere + 0.0
    if stem == "INVKFI_SPEED":
        return found.number(name, 1, FULL_COUNT)
    ratio = found.fraction(name)
    assert ratio is not None
    if not 0.05 <= ratio <= 1.0:
        raise UserError(f"{name} = {ratio:g} is out of range", found.where(name), "choose 0.05 .. 1: Ls / (2 Ls0), 0.5 is no change")
    return round(ratio, 4) # Q15() takes positive numbers times 32767


def _spaced(found: UserParms, entries: list[Entry]) -> list[Entry]:
    """The entries every 1024 electrical rpm, where SPEED_INDEX_CONST spaces them otherwise."""
    exponent = found.maybe("SPEED_INDEX_CONST", 6, 13)
    step = STEP_ERPM if exponent is None else 1 << round(exponent)
    if step == STEP_ERPM:
        return entries
    found.notes.append(f"SPEED_INDEX_CONST puts an entry every {step} electrical rpm: the tables are interpolated every {STEP_ERPM}")

    def at(index: float) -> Entry:
        low = min(int(index), ENTRIES - 2)
        part = min(index - low, 1.0)
        return Entry(*(a + part * (b - a) for a, b in zip(vars(entries[low]).values(), vars(entries[low + 1]).values())))
    return [at(i * STEP_ERPM / step) for i in range(ENTRIES)]


# ---- contradictions -------------------------------------------------------------------------------------------------------------
def _differs(one: float, other: float, share: float) -> bool:
    return abs(one - other) > share * abs(other)


def _deltat(found: UserParms) -> str:
    count = found.maybe("NORM_DELTAT")
    if count is None or not found.name_of("LOOPTIME_SEC") or not _differs(period_of_deltat(count), found.period_s, SAME):
        return ""
    return (f"{found.where('NORM_DELTAT')}: NORM_DELTAT = {count:g} belongs to {period_of_deltat(count) * 1e6:.4g} us, LOOPTIME_SEC is {found.period_s * 1e6:.4g} us "
            f"({found.period_s / 60.0 * 2.0 ** 31:.0f}); LOOPTIME_SEC counts")


def _derivative(name: str, samples: int, speed: str) -> Callable[[UserParms], str]:
    def rule(found: UserParms) -> str:
        count, rpm = found.maybe(name), found.nominal_rpm if samples == 8 else found.maximum_rpm
        if count is None:
            return ""
        told = derivative_rpm(count, samples, found.pole_pairs, found.period_s)
        if not _differs(told, rpm, SAME_SPEED):
            return ""
        return f"{found.where(name)}: {name} = {count:g} belongs to {told:.0f} rpm with {found.pole_pairs} pole pairs and {found.period_s * 1e6:.4g} us, {speed} is {rpm:g}; {speed} counts"
    return rule


def _first_invkfi(found: UserParms) -> str:
    first, base = found.maybe("INVKFI_SPEED0"), found.number("NORM_INVKFIBASE")
    if first is None or not _differs(first, base, SAME_SPEED):
        return ""
    return f"{found.where('INVKFI_SPEED0')}: INVKFI_SPEED0 = {first:g}, NORM_INVKFIBASE is {base:g}: both are 1/Kphi at base speed; NORM_INVKFIBASE counts"


def _first_entries(found: UserParms) -> str:
    told = []
    if found.tables and found.tables[0].idref_a < 0.0:
        told.append(f"{found.where('IDREF_SPEED0')}: IDREF_SPEED0 = {found.tables[0].idref_a:.3g} A, entry 0 is base speed, which needs none")
    if found.tables and _differs(found.tables[0].ls_ratio, 0.5, SAME):
        told.append(f"{found.where('LS_OVER2LS0_SPEED0')}: LS_OVER2LS0_SPEED0 = {found.tables[0].ls_ratio:.3g}, at base speed it is 0.5 by definition")
    return "; ".join(told)


def _phases(found: UserParms) -> str:
    a, b = found.fraction("KCURRA"), found.fraction("KCURRB")
    if a is None or b is None or not _differs(b, a, SAME):
        return ""
    return f"{found.where('KCURRB')}: KCURRB = {b:.4g}, KCURRA is {a:.4g}; KCURRA counts for both: write KCURRB into userparams.h if it was calibrated (docs/calibration.md)"


def _end_speed(found: UserParms) -> str:
    end = found.maybe("END_SPEED_RPM")
    if end is None or end <= found.nominal_rpm:
        return ""
    return f"{found.where('END_SPEED_RPM')}: END_SPEED_RPM = {end:g} is above NOMINAL_SPEED_RPM = {found.nominal_rpm:g}; the tuner chooses one"


RULES: tuple[Callable[[UserParms], str], ...] = (
    _deltat, _derivative("D_ILIMIT_HS", 1, "MAXIMUM_SPEED_RPM"), _derivative("D_ILIMIT_LS", 8, "NOMINAL_SPEED_RPM"), _first_invkfi, _first_entries, _phases, _end_speed)
"""Each says in one line what contradicts what, or nothing."""


# ---- every name -------------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Known:
    """A name of AN1292: how it reads in units, where it goes, or why it goes nowhere."""

    shown: Callable[[UserParms, float], str]
    goes_to: str = ""
    why: str = ""


def _gain(found: UserParms, count: float) -> str:
    return f"{16.0 * count / Q15 * found.volt / found.ampere:.3g} V/A, {16.0 * count / Q15 * found.volt / found.ampere / (2.0 * math.pi * found.ls_h):.0f} Hz"


def _integral(found: UserParms, count: float) -> str:
    return f"{count / Q15 * found.volt / found.ampere / found.period_s:.3g} V/(A s)"


def _unit(text: str, factor: float = 1.0) -> Callable[[UserParms, float], str]:
    return lambda _, value: f"{value * factor:.4g} {text}".rstrip()


def _hertz(found: UserParms, count: float) -> str:
    return f"{constants.filter_hz(count, found.period_s):.0f} Hz" if 0.0 < count < Q15 else "no filter"


def _ampere(found: UserParms, count: float) -> str:
    return f"{count * found.ampere:.3g} A"


def _share(_: UserParms, count: float) -> str:
    return f"{count / Q15 if abs(count) > 1.0 else count:.4g}"


LOOP_WHY = "CURRENT_BANDWIDTH_HZ gives both gains from R and L; [tune] CURRENT_BANDWIDTH_HZ keeps yours, and the line itself works in userparams.h"
SPEED_WHY = "SPEED_BANDWIDTH_HZ gives the gain from the inertia, a load observer takes the integral's place"
NAMES: dict[str, Known] = {
    "LOOPTIME_SEC": Known(_unit("us", 1e6), "board [pwm] period"), "DEADTIME_SEC": Known(_unit("us", 1e6), "board [pwm] dead_time"),
    "NORM_CURRENT_CONST": Known(lambda f, v: f"{v * Q15:.4g} A full scale", "board [shunt] amplifier_gain"),
    "KCURRA": Known(lambda f, v: f"gain {2.0 * f.gain:.4g}", "board [shunt] inverted"), "KCURRB": Known(_share, "", "KCURRA counts for both; userparams.h has a KCURRB"),
    "NOPOLESPAIRS": Known(_unit("pole pairs"), "[electrical] pole_pairs"),
    "NOMINAL_SPEED_RPM": Known(_unit("rpm"), "[rating] speed"), "MAXIMUM_SPEED_RPM": Known(_unit("rpm"), "[rating] maximum_speed"),
    "NORM_RS": Known(lambda f, v: f"{f.rs_ohm:.4g} ohm", "[electrical] resistance"),
    "NORM_LSDTBASE": Known(lambda f, v: f"{f.ls_h * 1e3:.4g} mH", "[electrical] inductance"),
    "NORM_INVKFIBASE": Known(lambda f, v: f"{f.kphi:.4g} V/krpm", "[electrical] kphi"),
    "NORM_DELTAT": Known(lambda f, v: f"{period_of_deltat(v) * 1e6:.4g} us", "", "follows from LOOPTIME_SEC"),
    "D_ILIMIT_HS": Known(lambda f, v: f"{derivative_rpm(v, 1, f.pole_pairs, f.period_s):.0f} rpm", "", "follows from MAXIMUM_SPEED_RPM and the largest current"),
    "D_ILIMIT_LS": Known(lambda f, v: f"{derivative_rpm(v, 8, f.pole_pairs, f.period_s):.0f} rpm", "", "follows from NOMINAL_SPEED_RPM and the largest current"),
    "KFILTER_ESDQ": Known(_hertz, "", "the tuner's corner lets the angle follow a load step; [tune] KFILTER_ESDQ keeps yours"),
    "KFILTER_ESDQ_FW": Known(_hertz, "", "AN1292's corner lets the angle swing; [tune] KFILTER_ESDQ_FW keeps yours"),
    "KFILTER_VELESTIM": Known(_hertz, "", "the tuner's, from the rotor's inertia; [tune] KFILTER_VELESTIM keeps yours"),
    "INITOFFSET_TRANS_OPEN_CLSD": Known(_unit("degrees", 360.0 / 65536.0), "", "the hand-over measures the angle instead of assuming it"),
    "LOCK_TIME": Known(lambda f, v: f"{v * f.period_s:.3g} s", "", "the current grows slowly while it turns: the tuner takes the time from the rotor's swing; [tune] LOCK_TIME keeps yours"),
    "END_SPEED_RPM": Known(_unit("rpm"), "[tune] END_SPEED_RPM"),
    "OPENLOOP_RAMPSPEED_INCREASERATE": Known(lambda f, v: f"{ramp_rpm_s(v, f.pole_pairs, f.period_s):.4g} rpm/s", "[tune] OPENLOOP_RAMPSPEED_INCREASERATE"),
    "Q_CURRENT_REF_OPENLOOP": Known(_ampere, "[tune] Q_CURRENT_REF_OPENLOOP"),
    "SPEEDREFRAMP": Known(lambda f, v: f"{reference_ramp(f):.4g} rpm/s", "[tune] SPEEDREFRAMP_RPM_PER_S"),
    "SPEEDREFRAMP_COUNT": Known(_unit("periods"), "", "part of SPEEDREFRAMP"), "TUNING_DELAY_RAMPUP": Known(_unit("periods"), "[tune] TUNING_DELAY_RAMPUP"),
    **{f"{axis}_CURRCNTR_PTERM": Known(_gain, "", LOOP_WHY) for axis in "DQ"}, **{f"{axis}_CURRCNTR_ITERM": Known(_integral, "", LOOP_WHY) for axis in "DQ"},
    **{f"{loop}_CTERM": Known(_share, "", "anti-windup has a number of its own; the line itself works in userparams.h") for loop in ("D_CURRCNTR", "Q_CURRCNTR")},
    "SPEEDCNTR_CTERM": Known(_share, "", "a load observer takes the integral's place"),
    **{f"{axis}_CURRCNTR_OUTMAX": Known(_share, "", "the voltage circle limits both axes together") for axis in "DQ"},
    "SPEEDCNTR_PTERM": Known(lambda f, v: f"{16.0 * v / Q15 * f.pole_pairs * f.ampere * 1e3:.3g} mA/rpm", "", SPEED_WHY), "SPEEDCNTR_ITERM": Known(_share, "", SPEED_WHY),
    "SPEEDCNTR_OUTMAX": Known(_ampere, "[rating] maximum_current"),
    "SNAPDELAY": Known(_unit("periods"), "[tune] SNAPDELAY"), "DATA_BUFFER_SIZE": Known(_unit("rows"), "[tune] DATA_BUFFER_SIZE"),
    "Q15_OVER_CURRENT_THRESHOLD": Known(_ampere, "[tune] OVER_CURRENT_THRESHOLD_A"),
    "KPOT": Known(_share, "", "the potentiometer's ends are MINIMUM_SPEED_RPM and NOMINAL_SPEED_RPM"),
    "DISPLOOPTIME_SEC": Known(_unit("ms", 1e3), "", "buttons are read by the firmware's own clock"),
    "IDREF_BASESPEED": Known(_ampere, "", "entry 0 of the table is the same"), "SPEED_INDEX_CONST": Known(_unit("bits"), "tables"),
    **{f"{name}_SCALE": Known(_unit("bits"), "", f"the divisor of {name}") for name in DIVISORS}}
MODE_ALIASES = {"RTDM": "`make live` and SCOPE record variables", "DMCI_DEMO": "`make live` and SCOPE record variables"}


def reference_ramp(found: UserParms) -> float:
    """SPEEDREFRAMP in rpm/s, 0 where the header has none."""
    count = found.maybe("SPEEDREFRAMP", 0, FULL_COUNT) or 0.0
    return reference_rpm_s(count, 1.0 + (found.maybe("SPEEDREFRAMP_COUNT", 0, 1000) or 0.0), found.pole_pairs, found.period_s)


def known_names() -> set[str]:
    """Every name that a header may have."""
    entries = {f"{stem}{i}" for stem in STEMS for i in range(ENTRIES)}
    return {*NAMES, *entries, *(alias for aliases in ALIASES.values() for alias in aliases), *modes(), *MODE_ALIASES, *DERIVED, "Q15", "NORM_CURRENT"}


def _lines(found: UserParms) -> list[Line]:
    """Every name of the header but the tables', in the order of its lines."""
    canonical = {alias: name for name, aliases in ALIASES.items() for alias in aliases}
    used = {word for define in found.header.defines.values() for word in re.findall(r"[A-Za-z_]\w*", define.body)}
    result = []
    for name, define in found.header.defines.items():
        if name.startswith(STEMS) or define.line == 0:
            continue
        item = NAMES.get(canonical.get(name, name))
        if item is not None and define.parameters is None:
            value = float(found.header.value(name))
            result.append(Line(define.line, name, define.body, item.shown(found, value), item.goes_to, item.why))
        elif name in modes():
            result.append(Line(define.line, name, "", "a mode", f"DEFINES=-D{name}"))
        else:
            result.append(Line(define.line, name, define.body, "", "", _why_unknown(name, define.parameters is not None, name in used)))
    guards = {line.line for line in result if not line.written and not line.shown and re.search(r"_H_*$|^_", line.name)}
    return sorted((line for line in result if line.line not in guards), key=lambda line: line.line)


def _why_unknown(name: str, is_macro: bool, is_used: bool) -> str:
    if name in MODE_ALIASES:
        return MODE_ALIASES[name]
    if name in DERIVED:
        return "follows from other lines"
    if is_macro:
        return "a macro, read where it is used"
    if is_used:
        return "part of other lines"
    hint = suggestion(name, known_names())
    return "no name of AN1292's header" + (f"; {hint}" if hint.startswith("did you mean") else "")
