"""Motor files: the numbers of a data sheet with unit and source, turned into one star phase in SI, and checked for sense.

examples/my_motor.toml shows a file, TABLES has every key and what it means; [tune] replaces values of userparams.h that the tuner would
choose, [plant] sets keys of the virtual board that no sheet gives."""

import functools
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import param_rows, paths, units
from .board_keys import Part, Values
from .errors import Problems, UserError, suggestion
from .toml_file import Document, Section, flatten
from .units import Key, Kind, Quantity

COPPER_PER_K = 0.0039
FERRITE_PER_K = -0.002
MAXIMUM_OVER_RATED = 1.5
START_OVER_RATED = 0.25
LARGEST_FILE = 65536
SLOWEST_S = 5.0
"""In which rated torque brings a bare rotor to rated speed; what is heavier is a load."""
PLANT_TABLES = ("motor.", "mech.", "load.")
DERIVED_KEYS = ("motor.rs_ohm", "motor.ld_h", "motor.lq_h", "motor.psi_vs", "motor.pole_pairs", "motor.r_tempco", "motor.psi_tempco",
                "mech.inertia_kgm2", "mech.viscous_nms", "mech.coulomb_nm", "load.pulse1_nm", "load.pulse1_order")

_DEGC = f"{units.AT_DEGC[0]:g} .. {units.AT_DEGC[1]:g}, {units.REFERENCE_DEGC:g} if not given"
_HZ = f"`frequency_hz` of the LCR meter {units.AT_HZ[0]:g} .. {units.AT_HZ[1]:g}"

TABLES: dict[str, dict[str, Key] | None] = {
    "electrical": {
        "pole_pairs": Key("half the number of poles", Kind("pole pairs", 1, 50, {})),
        "resistance": Key(f"winding; `at_degc` of the value {_DEGC}", units.resistance("Y")),
        "inductance": Key(f"of a motor whose d and q axes do not differ; {_HZ}", units.inductance("Y"), "this, or d and q"),
        "inductance_d": Key(f"smallest inductance over the rotor's angle; {_HZ}", units.inductance("Y"), "with q, or inductance"),
        "inductance_q": Key("largest inductance over the rotor's angle", units.inductance("Y"), "with d, or inductance"),
        "kphi": Key(f"motor constant in any of its forms; `at_degc` of the magnets {_DEGC}", units.kphi("Y", 1)),
        "resistance_tempco": Key("change of R with temperature; copper if not given", units.RESISTANCE_TEMPCO, f"{COPPER_PER_K:g}"),
        "kphi_tempco": Key("change of Kphi with temperature; ferrite magnets if not given", units.KPHI_TEMPCO, f"{FERRITE_PER_K:g}")},
    "mechanical": {
        "inertia": Key("rotor alone", units.INERTIA),
        "viscous_friction": Key("torque proportional to speed", units.VISCOUS, "0"),
        "coulomb_friction": Key("torque that does not depend on speed; give at least an estimate: without it a start is harder", units.FRICTION, "0")},
    "rating": {
        "voltage": Key("rated voltage", units.VOLTAGE), "current": Key("rated current", units.CURRENT), "torque": Key("rated torque", units.TORQUE),
        "speed": Key("rated speed", units.SPEED), "maximum_speed": Key("speed to reach, by field weakening if need be", units.SPEED),
        "maximum_current": Key("what the winding withstands for a while", units.CURRENT, f"{MAXIMUM_OVER_RATED:g} times current"),
        "thermal_time": Key("the winding's thermal time constant: more than `current` then trips in time (I2t)", units.THERMAL_TIME, "no I2t")},
    "spread": {
        "resistance": Key("smallest and largest value of other sheets and measurements; the loops hold over it", units.resistance("Y"), ""),
        "inductance": Key("the same", units.inductance("Y"), ""), "kphi": Key("the same", units.kphi("Y", 1), "")},
    "load": {
        "inertia": Key("what turns with the rotor", units.LOAD_INERTIA, "0"),
        "start_torque": Key("what the shaft carries while it starts, the motor's friction not included", units.FRICTION,
                            f"{START_OVER_RATED:g} times the rated torque"),
        "pulse_torque": Key("amplitude of a torque that swings with the shaft's angle, as that of a piston; [plant] may add `load.pulse2_nm` and more",
                            units.FRICTION, "0"),
        "pulses_per_turn": Key("how often it swings in a turn", Kind("per turn", 1, 100, {}), "1")},
    "tune": None, "plant": None}
"""Tables of a motor file with their keys; None: any key, checked elsewhere. Kinds are a star's; a delta, and Kphi, have other factors."""
ROOT = {"title": Key("one line for tables and reports"), "connection": Key("`Y` (star) or `delta`; counts only for values per `winding`"),
        "board": Key("the board that turns it: a name in tuning/boards, or a path as seen from this file; `BOARD=` overrides it", default="`mclv`")}

FACTS = {"NOPOLESPAIRS": "[electrical] pole_pairs", "MOTOR_RS_OHM": "[electrical] resistance", "MOTOR_LS_MH": "[electrical] inductance",
         "MOTOR_SALIENCY_UH": "[electrical] inductance_d and inductance_q", "MOTOR_KPHI_V_PER_KRPM": "[electrical] kphi", "MOTOR_INERTIA_KGM2": "[mechanical] inertia",
         "MAXIMUM_SPEED_RPM": "[rating] maximum_speed", "MAXIMUM_CURRENT_A": "[rating] maximum_current",
         "I2T_CURRENT_A": "[rating] current", "I2T_TIME_SEC": "[rating] thermal_time",
         "NOMINAL_BUS_V": "the board file", "LOOPTIME_SEC": "the board file", "DEADTIME_SEC": "the board file",
         "SAMPLE_WINDOW_SEC": "the board file", "NORM_CURRENT_CONST": "the board file", "KCURRA": "the board file",
         "KCURRB": "the board file", "BUS_FULL_SCALE_V": "the board file"}
"""What userparams.h holds but [tune] may not: it is said elsewhere."""


@dataclass(frozen=True)
class Motor:
    """A motor in SI units; impedances and flux are those of one phase of the star with the same terminals, at 25 degC."""

    name: str
    path: Path
    title: str
    connection: str
    board: str
    """The board that the file names, by name or path; "" for none."""
    board_where: str
    pole_pairs: int
    rs_ohm: float
    ld_h: float
    lq_h: float
    psi_vs: float
    """Flux linkage of a phase: peak back-EMF per electrical rad/s."""
    kphi_v_per_krpm: float
    """Peak line-to-line back-EMF at 1000 mechanical rpm."""
    resistance_tempco_per_k: float
    kphi_tempco_per_k: float
    inductance_frequency_hz: float | None
    inertia_kgm2: float
    viscous_nms: float
    coulomb_nm: float
    rated_voltage_v: float
    rated_current_a: float
    """Peak of a phase current, as all currents here."""
    rated_torque_nm: float
    rated_speed_rpm: float
    maximum_speed_rpm: float
    maximum_current_a: float
    thermal_time_s: float
    """Of the winding; 0 for none."""
    load_inertia_kgm2: float
    start_torque_nm: float
    """What the shaft carries while starting, friction of the motor not included."""
    pulse_nm: float
    """Amplitude of the load that swings pulses_per_turn times with the shaft's angle."""
    pulses_per_turn: float
    tune: dict[str, float]
    spread: dict[str, tuple[float, float]]
    """Smallest and largest published value of rs_ohm, ls_h, kphi_v_per_krpm, if the file has them."""
    quantities: dict[str, Quantity]
    """Every number that the file gives, by the name it has there."""
    plant_extra: Values

    @property
    def kt_nm_per_a(self) -> float:
        """Torque per ampere of peak phase current: 3/2 P psi."""
        return 1.5 * self.pole_pairs * self.psi_vs

    @property
    def salient(self) -> bool:
        """True if the two inductances differ."""
        return self.ld_h != self.lq_h

    @property
    def heaviest_kgm2(self) -> float:
        """More is no rotor's inertia, but a load's."""
        return 0.99 * SLOWEST_S * self.rated_torque_nm / (self.rated_speed_rpm * units.RPM)

    def plant_values(self) -> Values:
        """Keys of the virtual board; each `where` is the line of the number that it follows from."""
        result = Values()
        for key, value, origin in (
                ("motor.rs_ohm", self.rs_ohm, "resistance"), ("motor.ld_h", self.ld_h, "inductance_d"),
                ("motor.lq_h", self.lq_h, "inductance_q"), ("motor.psi_vs", self.psi_vs, "kphi"),
                ("motor.pole_pairs", float(self.pole_pairs), "pole_pairs"),
                ("motor.r_tempco", self.resistance_tempco_per_k, "resistance_tempco"),
                ("motor.psi_tempco", self.kphi_tempco_per_k, "kphi_tempco"),
                ("mech.inertia_kgm2", self.inertia_kgm2 + self.load_inertia_kgm2, "inertia"),
                ("mech.viscous_nms", self.viscous_nms, "viscous_friction"), ("mech.coulomb_nm", self.coulomb_nm, "coulomb_friction")):
            quantity = self.quantities.get(origin) or self.quantities.get("inductance" if origin.startswith("inductance") else "")
            result.add(key, value, quantity.where if quantity else str(paths.shown(self.path)))
        if self.pulse_nm:
            result.add("load.pulse1_nm", self.pulse_nm, self.quantities["pulse_torque"].where)
            result.add("load.pulse1_order", self.pulses_per_turn, self.quantities["pulse_torque"].where)
        for key, value in self.plant_extra.values.items():
            result.add(key, value, self.plant_extra.where[key])
        return result


def load(name_or_path: str, where: str = "") -> Motor:
    """tuning/motors/NAME.toml or a path; `where` says who asked for it, for the error about a name that does not exist."""
    path = paths.find("motor", name_or_path, paths.MOTORS, where)
    return read_safely(path, _read)


def read(document: Document) -> Motor:
    """What a document says that is not in a file yet."""
    return _read(document.root)


def part(name_or_path: str, where: str = "") -> Part:
    """The same as keys of the virtual board."""
    motor = load(name_or_path, where)
    return Part(motor.path, motor.title, motor.plant_values(), motor.board, motor.board_where)


def read_safely(path: Path, reader: Callable[[Section], Any]) -> Any:
    """What `reader` makes of a file's root table; a file beyond all bounds is a UserError, too."""
    label = str(paths.shown(path))
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise UserError("the file is too large", label, f"give a file of at most {LARGEST_FILE // 1024} KiB")
        return reader(Document(path).root)
    except OSError as error:
        raise UserError(f"cannot read the file ({error.strerror})", label, "give a readable TOML file") from None
    except RecursionError: # a key with thousands of dots
        raise UserError("tables too deep", label, "write keys as a data sheet's names") from None


def kind_of(section: Section, key: str) -> Kind:
    keys = TABLES[section.path[0]]
    assert keys and (kind := keys[key].kind)
    return kind


class _Reader:
    """Collects the quantities of a file by name."""

    def __init__(self) -> None:
        self.found: dict[str, Quantity] = {}
        self.problems = Problems()

    def need(self, section: Section, key: str, kind: Kind | None = None, extra: tuple[str, ...] = ()) -> float:
        """Not a number where it is refused; the refusal is kept. `kind`: another one than that of TABLES"""
        def read() -> float:
            self.found[key] = units.read(section, key, kind or kind_of(section, key), extra=extra)
            return self.found[key].value_si
        return self.problems.attempt(read, math.nan)

    def may(self, section: Section, key: str, default: float) -> float:
        return self.need(section, key) if key in section else default


def _tables(root: Section) -> dict[str, Section | None]:
    """All tables, present or not; unknown tables and keys come first, for a slip of the pen makes another one missing."""
    problems = Problems()
    problems.attempt(lambda: root.close({*ROOT, *TABLES}))
    sections = {name: root.section(name) for name in TABLES}
    for name, section in sections.items():
        keys = TABLES[name]
        if section is not None and keys is not None:
            problems.attempt(lambda section=section, keys=keys: section.close(set(keys)))
        elif section is None and name in ("electrical", "mechanical", "rating"):
            problems.found.append(UserError(f"the table [{name}] is missing", root.document.label, "add it with " + ", ".join(keys or ())))
    problems.tell()
    return sections


def _read(root: Section) -> Motor:
    tables = _tables(root)
    title, connection = root.text("title"), root.choice("connection", ("Y", "delta"))
    electrical, mechanical, rating = (tables[name] for name in ("electrical", "mechanical", "rating"))
    assert electrical and mechanical and rating
    reader = _Reader()
    problems = reader.problems
    values = _read_electrical(electrical, connection, reader)
    values["inertia_kgm2"] = reader.need(mechanical, "inertia")
    values["viscous_nms"] = reader.may(mechanical, "viscous_friction", 0.0)
    values["coulomb_nm"] = reader.may(mechanical, "coulomb_friction", 0.0)
    values |= _read_rating(rating, reader)
    values |= problems.attempt(lambda: _read_load(tables["load"], values["rated_torque_nm"], reader), {})
    spread = problems.attempt(lambda: _read_spread(tables["spread"], connection, values["pole_pairs"]), {})
    tune, plant = problems.attempt(lambda: _read_tune(tables["tune"])), problems.attempt(lambda: _read_plant(tables["plant"]))
    problems.tell()
    path = root.document.path
    motor = Motor(name=path.stem, path=path, title=title, connection=connection, board=_board(root), board_where=root.where("board"),
                  quantities=reader.found, spread=spread, tune=tune, plant_extra=plant, **values)
    _check(motor)
    return motor


def _board(root: Section) -> str:
    """Name or path of the board; a path is seen from the motor file's folder."""
    return paths.beside(root.text("board", ""), root.document.path)[0]


def _read_electrical(section: Section, connection: str, reader: _Reader) -> dict[str, Any]:
    count = reader.problems.attempt(lambda: units.read_count(section, "pole_pairs", kind_of(section, "pole_pairs")))
    pole_pairs = int(count.value_si) if count else 1
    reader.found |= {"pole_pairs": count} if count else {}
    r_tempco = reader.may(section, "resistance_tempco", COPPER_PER_K)
    psi_tempco = reader.may(section, "kphi_tempco", FERRITE_PER_K)
    rs_ohm = reader.need(section, "resistance", units.resistance(connection), extra=("at_degc",))
    rs_ohm /= 1.0 + r_tempco * _above_25(section, "resistance", reader)
    kphi = reader.need(section, "kphi", units.kphi(connection, pole_pairs), extra=("at_degc",))
    kphi /= 1.0 + psi_tempco * _above_25(section, "kphi", reader)
    ld_h, lq_h, frequency_hz = _read_inductance(section, connection, reader)
    return {"pole_pairs": pole_pairs, "rs_ohm": rs_ohm, "ld_h": ld_h, "lq_h": lq_h, "inductance_frequency_hz": frequency_hz,
            "kphi_v_per_krpm": kphi, "psi_vs": kphi / (units.SQRT3 * units.KRPM * pole_pairs),
            "resistance_tempco_per_k": r_tempco, "kphi_tempco_per_k": psi_tempco}


def _read_inductance(section: Section, connection: str, reader: _Reader) -> tuple[float, float, float | None]:
    both = [key for key in ("inductance_d", "inductance_q") if key in section]
    if both and "inductance" in section:
        raise section.fail("inductance", f"'inductance' and '{both[0]}' together", "give either one or d and q")
    kind = units.inductance(connection)
    keys = ("inductance_d", "inductance_q") if both else ("inductance",)
    found = [reader.need(section, key, kind, extra=("frequency_hz",)) for key in keys]
    frequency_hz = reader.problems.attempt(lambda: units.detail(section, keys[0], "frequency_hz", None, *units.AT_HZ)) if keys[0] in reader.found else None
    return found[0], found[-1], frequency_hz


def _above_25(section: Section, key: str, reader: _Reader) -> float:
    if key not in reader.found:
        return 0.0
    at_degc = reader.problems.attempt(lambda: units.detail(section, key, "at_degc", units.REFERENCE_DEGC, *units.AT_DEGC))
    return (at_degc or 0.0) - units.REFERENCE_DEGC


def _read_rating(section: Section, reader: _Reader) -> dict[str, float]:
    result = {name: reader.need(section, key) for name, key in (
        ("rated_voltage_v", "voltage"), ("rated_current_a", "current"), ("rated_torque_nm", "torque"), ("rated_speed_rpm", "speed"),
        ("maximum_speed_rpm", "maximum_speed"))}
    result["thermal_time_s"] = reader.may(section, "thermal_time", 0.0)
    result["maximum_current_a"] = reader.may(section, "maximum_current", MAXIMUM_OVER_RATED * result["rated_current_a"])
    return result


def _read_load(section: Section | None, rated_torque_nm: float, reader: _Reader) -> dict[str, float]:
    result = {"load_inertia_kgm2": 0.0, "start_torque_nm": START_OVER_RATED * rated_torque_nm, "pulse_nm": 0.0, "pulses_per_turn": 1.0}
    if section is None:
        return result
    for name, key in (("load_inertia_kgm2", "inertia"), ("start_torque_nm", "start_torque"), ("pulse_nm", "pulse_torque"),
                      ("pulses_per_turn", "pulses_per_turn")):
        if key in section:
            kind = kind_of(section, key)
            quantity = (units.read if kind.units else units.read_count)(section, key, kind, source="the user's load")
            reader.found["load_inertia" if key == "inertia" else key] = quantity
            result[name] = quantity.value_si
    return result


def _read_spread(section: Section | None, connection: str, pole_pairs: int) -> dict[str, tuple[float, float]]:
    result: dict[str, tuple[float, float]] = {}
    if section is None:
        return result
    for name, key, kind in (("rs_ohm", "resistance", units.resistance(connection)), ("ls_h", "inductance", units.inductance(connection)),
                            ("kphi_v_per_krpm", "kphi", units.kphi(connection, pole_pairs))):
        if key in section:
            result[name] = units.read_pair(section, key, kind)
    return result


def _read_tune(section: Section | None) -> dict[str, float]:
    result: dict[str, float] = {}
    if section is None:
        return result
    known = param_rows.parameters()
    for name in section.data:
        if name in FACTS:
            raise section.fail(name, f"'{name}' is no choice of the tuner", f"it follows from {FACTS[name]}; change that")
        if name not in known:
            raise section.fail(name, f"'{name}' is no parameter of userparams.h", suggestion(name, set(known) - set(FACTS), "docs/parameters.md"))
        result[name] = section.number(name, minimum=float(known[name].low), maximum=float(known[name].high))
    return result


@functools.cache
def plant_ranges() -> dict[str, tuple[str, float, float]]:
    """Unit, minimum and maximum of the virtual board's keys of a motor, from its source: what runs only when it is built knows too late."""
    text = (paths.ROOT / "tools" / "vboard" / "vb_keys.c").read_text(encoding="utf-8")
    rows = re.findall(r'\b[PI]\("((?:motor\.|mech\.|load\.)\w+)", [\w.\[\]]+, \S+, (\S+), (\S+), "([^"]*)"', text)
    return {name: (unit, float(low), float(high)) for name, low, high, unit in rows}


def _read_plant(section: Section | None) -> Values:
    if section is None:
        return Values()
    result, ranges = Values(), plant_ranges()
    for key, value in flatten(section).items():
        if key in DERIVED_KEYS:
            raise section.fail(key, f"'{key}' stands in another table of this file", "change the number there")
        if not key.startswith(PLANT_TABLES):
            raise section.fail(key, f"'{key}' is no key of the motor", "use motor.*, mech.* and load.* here; of the rest board file and scenario have a [plant], too")
        if key not in ranges:
            raise section.fail(key, f"unknown key '{key}'", suggestion(key, set(ranges) - set(DERIVED_KEYS), "`make keys`"))
        unit, low, high = ranges[key]
        if not low <= value <= high:
            raise section.fail(key, f"'{key}' = {value:g} is impossible", f"choose {low:g} .. {high:g} {unit}".rstrip())
        result.add(key, value, section.where(key))
    return result


def _check(motor: Motor) -> None:
    """Numbers that do not fit each other are nearly always a wrong unit or a slipped power of ten."""

    problems = Problems()

    def fail(key: str, what: str, remedy: str) -> None:
        quantity = motor.quantities.get(key) or motor.quantities.get("inductance_q")
        problems.found.append(UserError(what, quantity.where if quantity else str(paths.shown(motor.path)), remedy))

    rated_rad_s = motor.rated_speed_rpm * units.RPM
    time_constant_s = motor.lq_h / motor.rs_ohm
    if not 2e-5 <= time_constant_s <= 0.05:
        fail("inductance", f"L/R = {time_constant_s * 1e3:.3g} ms is implausible", "0.02 .. 50 ms are usual; check both units")
    if not 0.5 <= motor.lq_h / motor.ld_h <= 5.0:
        fail("inductance_q", f"Lq/Ld = {motor.lq_h / motor.ld_h:.3g} is implausible", "0.5 .. 5 are usual; check both units")
    emf_v = motor.kphi_v_per_krpm * motor.rated_speed_rpm / 1000.0
    if not 0.25 <= emf_v / motor.rated_voltage_v <= 1.25:
        fail("kphi", f"the back-EMF at rated speed, {emf_v:.3g} V peak line to line, does not suit {motor.rated_voltage_v:g} V",
                   "0.25 .. 1.25 of it are usual; check the units of kphi, speed and voltage")
    torque_nm = motor.kt_nm_per_a * motor.rated_current_a
    if not 0.5 <= torque_nm / motor.rated_torque_nm <= 2.0:
        fail("torque", f"rated torque is {motor.rated_torque_nm:.3g} N m, but kphi and rated current give {torque_nm:.3g} N m",
                   "probably a wrong unit of torque, current or kphi")
    drop_v = units.SQRT3 * motor.rs_ohm * motor.rated_current_a
    if drop_v > motor.rated_voltage_v:
        fail("resistance", f"the rated current needs {drop_v:.3g} V for the resistance alone",
                   f"that is more than the rated {motor.rated_voltage_v:g} V; check the units of resistance and current")
    friction_nm = motor.coulomb_nm + motor.viscous_nms * rated_rad_s
    if friction_nm > motor.rated_torque_nm:
        key = "coulomb_friction" if motor.coulomb_nm > motor.rated_torque_nm / 2.0 else "viscous_friction"
        fail(key, f"friction at rated speed, {friction_nm:.3g} N m, exceeds the rated torque", "check the unit of friction")
    acceleration_s = motor.inertia_kgm2 * rated_rad_s / motor.rated_torque_nm
    if not 1e-3 <= acceleration_s <= SLOWEST_S:
        load = ", and give what the motor drives as inertia of [load]" if acceleration_s > SLOWEST_S else ""
        fail("inertia", f"rated torque would bring the bare rotor to rated speed in {acceleration_s:.3g} s",
                   f"0.001 .. {SLOWEST_S:g} s are usual; check the unit of inertia{load}")
    _check_limits(motor, fail)
    problems.tell()


def _check_limits(motor: Motor, fail: Callable[[str, str, str], None]) -> None:
    if motor.maximum_speed_rpm < motor.rated_speed_rpm:
        fail("maximum_speed", f"maximum_speed = {motor.maximum_speed_rpm:g} rpm is below the rated {motor.rated_speed_rpm:g} rpm",
                   "raise it, or lower speed")
    if not 0.2 * motor.rated_current_a <= motor.maximum_current_a <= 10.0 * motor.rated_current_a:
        fail("maximum_current", f"maximum_current = {motor.maximum_current_a:.3g} A peak beside a rated {motor.rated_current_a:.3g} A peak",
                   "choose 0.2 .. 10 times the rated current; check both units")
    most_nm = motor.kt_nm_per_a * motor.maximum_current_a
    if motor.start_torque_nm > most_nm:
        fail("start_torque", f"start_torque = {motor.start_torque_nm:.3g} N m is more than maximum_current gives, {most_nm:.3g} N m",
                   "lower it, or raise maximum_current")
    for key, name, value in (("rs_ohm", "resistance", motor.rs_ohm), ("ls_h", "inductance", motor.lq_h),
                             ("kphi_v_per_krpm", "kphi", motor.kphi_v_per_krpm)):
        low, high = motor.spread.get(key, (value, value))
        if not 0.999 * low <= value <= 1.001 * high:
            fail(name, f"'{name}' is outside its own [spread] {low:.4g} .. {high:.4g}", "widen the spread, or check the units")


def listing(motors: list[Motor]) -> str:
    """A table of motors, as `make list-motors` prints it."""
    head = ("name", "winding", "pole pairs", "R ohm", "L mH", "Kphi V/krpm", "Kt N m/A", "rated", "maximum", "unchecked numbers")
    rows = [_row(motor) for motor in motors]
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in [head, *rows]]
    return "\n".join(lines + ["R and L of one star phase at 25 degC; Kphi peak line to line; currents and Kt per ampere peak"])


def _row(motor: Motor) -> tuple[str, ...]:
    inductance = f"{motor.ld_h * 1e3:.3f}" + (f"/{motor.lq_h * 1e3:.3f}" if motor.salient else "")
    marked = sum(quantity.unchecked for quantity in motor.quantities.values())
    return (motor.name, motor.connection, str(motor.pole_pairs), f"{motor.rs_ohm:.3f}", inductance, f"{motor.kphi_v_per_krpm:.3f}",
            f"{motor.kt_nm_per_a:.4f}", f"{motor.rated_voltage_v:g} V, {motor.rated_speed_rpm:g} rpm, {motor.rated_torque_nm:.3g} N m, "
            f"{motor.rated_current_a:.2f} A", f"{motor.maximum_speed_rpm:g} rpm, {motor.maximum_current_a:.2f} A",
            f"{marked} of {len(motor.quantities)}")
