"""Board files: supply, bridge, shunts, converter, PWM and limits; the tuner and the virtual board read the same numbers.

TABLES has the tables; besides them title, [plant] (further keys of the virtual board) and [pins] (tools/common/pins.py; the MCLV's where nothing is said).

Every number is { value = ..., unit = "...", source = "..." }. Nothing is said twice: the current at the end of the converter's range
is reference / (resistance * gain), the bus voltage there is full_scale * divider."""

from dataclasses import dataclass
from pathlib import Path

from . import paths, pins, units
from .board_keys import Part, Values
from .errors import Problems, UserError
from .motor_file import Motor, read_safely
from .param_rows import number
from .toml_file import Document, Section, flatten
from .units import Conversion, Key, Kind, Quantity

_VOLT = {"V": Conversion(1.0), "mV": Conversion(1e-3)}
_OHM = {"ohm": Conversion(1.0), "mohm": Conversion(1e-3)}
_TIME = {"s": Conversion(1.0), "ms": Conversion(1e-3), "us": Conversion(1e-6), "ns": Conversion(1e-9)}
_FREQUENCY = {"kHz": Conversion(1e-3, reciprocal=True), "Hz": Conversion(1.0, reciprocal=True)}
_AMPERE = {"A": Conversion(1.0), "mA": Conversion(1e-3)}
_ONE = {"1": Conversion(1.0)}
WINDOW_MOST_S = 4e-6
"""The longest sample_window that is allowed: at the highest duty, twice this is without voltage."""

TABLES: dict[str, dict[str, Key]] = {
    "supply": {"voltage": Key("nominal bus", Kind("V", 8.0, 60.0, _VOLT), plant="supply.voltage_v"),
               "resistance": Key("of the supply and its cable", Kind("ohm", 0.001, 10.0, _OHM), plant="supply.resistance_ohm"),
               "sinks": Key("true: the supply takes braking current back", plant="supply.sinks")},
    "bus": {"capacitance": Key("bus capacitors", Kind("F", 1e-6, 1.0, {"F": Conversion(1.0), "mF": Conversion(1e-3), "uF": Conversion(1e-6)}),
                               plant="bus.capacitance_f"),
            "load": Key("what the board itself draws", Kind("A", 0.0, 10.0, _AMPERE), plant="bus.load_a")},
    "inverter": {"rds_on": Key("on-resistance of a transistor", Kind("ohm", 1e-4, 1.0, _OHM), plant="inverter.rds_on_ohm"),
                 "diode_voltage": Key("forward voltage of its diode", Kind("V", 0.0, 2.0, _VOLT), plant="inverter.diode_v"),
                 "trip_current": Key("bus current at which the comparator pulls FLTA1; 0: no comparator", Kind("A", 0.0, 100.0, _AMPERE),
                                     plant="inverter.trip_a")},
    "shunt": {"resistance": Key("shunt in the low leg of a phase", Kind("ohm", 1e-4, 1.0, _OHM), plant="shunt.ohm"),
              "amplifier_gain": Key("of the shunt's amplifier", Kind("1", 1.0, 500.0, _ONE)),
              "reference": Key("amplifier's output without current", Kind("V", 0.1, 3.2, _VOLT), plant="shunt.reference_v"),
              "settle": Key("time until the amplifier shows the current", Kind("s", 0.0, 1e-4, _TIME), plant="shunt.settle_s"),
              "inverted": Key("true: the output falls with current into the motor")},
    "adc": {"bits": Key("resolution of the converter", Kind("bits", 8, 16, {})),
            "full_scale": Key("voltage of the converter's full scale", Kind("V", 1.0, 5.5, _VOLT)),
            "bus_divider": Key("bus voltage over the pin's voltage", Kind("1", 1.0, 100.0, _ONE), plant="adc.vbus_ratio"),
            "noise": Key("standard deviation of a conversion", Kind("LSB", 0.0, 10.0, {"LSB": Conversion(1.0)}), plant="adc.noise_lsb")},
    "pwm": {"period": Key("PWM and control period", Kind("s", 25e-6, 140e-6, _TIME | _FREQUENCY)),
            "dead_time": Key("between the transistors of a leg", Kind("s", 0.5e-6, 3e-6, _TIME)),
            "sample_window": Key("low sides on at the highest duty, on each side of the middle of their on time", Kind("s", 1.5e-6, WINDOW_MOST_S, _TIME))},
    "limits": {"over_voltage": Key("bus above it trips", Kind("V", 6.0, 100.0, _VOLT)),
               "under_voltage": Key("bus below it trips while running", Kind("V", 3.0, 60.0, _VOLT)),
               "regen": Key("braking current falls from here", Kind("V", 6.0, 100.0, _VOLT))}}


@dataclass(frozen=True)
class BoardFile:
    """A board in SI units."""

    name: str
    path: Path
    title: str
    pwm_period_s: float
    dead_time_s: float
    sample_window_s: float
    nominal_bus_v: float
    bus_full_scale_v: float
    """Bus voltage at the end of the converter's range."""
    current_full_scale_a: float
    """Phase current at the end of the converter's range; divided by 32768 it is NORM_CURRENT_CONST."""
    current_gain: float
    """KCURRA and KCURRB of AN1292: 0.5 is gain 1; negative if the amplifier's output falls with current into the motor."""
    rds_on_ohm: float
    shunt_ohm: float
    over_voltage_v: float
    under_voltage_v: float
    regen_limit_v: float
    adc_bits: int
    quantities: dict[str, Quantity]
    """Every number of the file by table and key, e.g. "pwm.period"."""
    pins: dict[str, str]
    """[pins], as names of ports."""
    values: Values

    def plant_values(self) -> Values:
        """Keys of the virtual board; each `where` is the line of the number."""
        return self.values


SAMPLE_CLOCK_S = 25e-9
"""Unit of SAMPLE_DELAY_CLOCKS."""
DEFAULT = "mclv"
"""Where nobody names a board."""


def named(motor: Motor | Part, chosen: str | None = None, where: str = "--board") -> tuple[str, str]:
    """What load() and part() want: the board that was chosen, else the motor file's, else the default; and who asked for it."""
    if chosen:
        return chosen, where
    return (motor.board, motor.board_where) if motor.board else (DEFAULT, "")


def load(name_or_path: str, where: str = "") -> BoardFile:
    """tuning/boards/NAME.toml or a path; `where` says who asked for it, for the error about a name that does not exist."""
    return read_safely(paths.find("board", name_or_path, paths.BOARDS, where), _read)


def part(name_or_path: str, where: str = "") -> Part:
    """The same as keys of the virtual board."""
    board = load(name_or_path, where)
    return Part(board.path, board.title, board.plant_values())


def read(document: Document) -> BoardFile:
    """Checks a whole document and returns what it says."""
    return _read(document.root)


def _read(root: Section) -> BoardFile:
    root.close({"title", "pins", "plant", *TABLES})
    title = root.text("title")
    found: dict[str, Quantity] = {}
    values = Values()
    problems = Problems()
    for table, keys in TABLES.items():
        section = root.section(table)
        if section is None:
            problems.found.append(UserError(f"the table [{table}] is missing", root.document.label, "add it with " + ", ".join(keys)))
            continue
        problems.attempt(lambda section=section, keys=keys: section.close(set(keys)))
        for key, told in keys.items():
            problems.attempt(lambda section=section, key=key, told=told: _read_key(section, key, told, found, values))
    problems.tell()
    inverted = root.data["shunt"]["inverted"]
    volts_per_ampere = found["shunt.resistance"].value_si * found["shunt.amplifier_gain"].value_si
    values.add("shunt.gain_v_per_a", volts_per_ampere if inverted else -volts_per_ampere, found["shunt.amplifier_gain"].where)
    values.add("expect.pwm_hz", 1.0 / found["pwm.period"].value_si, found["pwm.period"].where)
    _read_plant(root.section("plant"), values)
    board = _board(root, title, found, values, inverted, volts_per_ampere)
    _check(board)
    return board


def _read_key(section: Section, key: str, told: Key, found: dict[str, Quantity], values: Values) -> None:
    if told.kind is None:
        value, where = float(section.flag(key)), section.where(key)
    else:
        quantity = units.read(section, key, told.kind) if told.has_units else units.read_count(section, key, told.kind)
        found[f"{section.path[0]}.{key}"], value, where = quantity, quantity.value_si, quantity.where
    if told.plant:
        values.add(told.plant, value, where)


def _read_plant(section: Section | None, values: Values) -> None:
    if section is None:
        return
    for key, value in flatten(section).items():
        if key in values.values:
            raise section.fail(key, f"'{key}' stands in another table of this file", "change the number there")
        if key.startswith(("motor.", "mech.")):
            raise section.fail(key, f"'{key}' is no key of a board", "write it into the motor file")
        values.add(key, value, section.where(key))


def _board(root: Section, title: str, found: dict[str, Quantity], values: Values, inverted: bool, volts_per_ampere: float) -> BoardFile:
    si = {name: quantity.value_si for name, quantity in found.items()}
    return BoardFile(
        name=root.document.path.stem, path=root.document.path, title=title, pwm_period_s=si["pwm.period"], dead_time_s=si["pwm.dead_time"],
        sample_window_s=si["pwm.sample_window"], nominal_bus_v=si["supply.voltage"],
        bus_full_scale_v=si["adc.full_scale"] * si["adc.bus_divider"], current_full_scale_a=si["shunt.reference"] / volts_per_ampere,
        current_gain=-0.5 if inverted else 0.5, rds_on_ohm=si["inverter.rds_on"], shunt_ohm=si["shunt.resistance"],
        over_voltage_v=si["limits.over_voltage"], under_voltage_v=si["limits.under_voltage"], regen_limit_v=si["limits.regen"],
        adc_bits=int(si["adc.bits"]), quantities=found, pins=pins.read(root.section("pins")), values=values)


def _check(board: BoardFile) -> None:
    problems = Problems()
    where = {name: quantity.where for name, quantity in board.quantities.items()}
    full_scale_v = board.quantities["adc.full_scale"].value_si
    reference_v = board.quantities["shunt.reference"].value_si
    if not 0.45 <= reference_v / full_scale_v <= 0.55:
        problems.found.append(UserError(f"reference = {reference_v:g} V is not the middle of the converter's {full_scale_v:g} V", where["shunt.reference"],
                                        "a current in both directions needs the middle"))
    if not board.under_voltage_v < board.nominal_bus_v < board.regen_limit_v < board.over_voltage_v < board.bus_full_scale_v:
        problems.found.append(UserError("under_voltage, supply voltage, regen, over_voltage and the converter's bus range do not rise in this order",
                        where["limits.over_voltage"], f"they are {board.under_voltage_v:g}, {board.nominal_bus_v:g}, {board.regen_limit_v:g}, "
                        f"{board.over_voltage_v:g} and {board.bus_full_scale_v:g} V"))
    problems.attempt(lambda: _check_sample(board, where))
    problems.tell()


def _check_sample(board: BoardFile, where: dict[str, str]) -> None:
    """The low sides must conduct for the amplifier's time before the sample: docs/law.md#the-sample."""
    delay_s, settle_s = SAMPLE_CLOCK_S * number("SAMPLE_DELAY_CLOCKS"), board.quantities["shunt.settle"].value_si
    conducts_s, need_s = board.sample_window_s + delay_s - board.dead_time_s, settle_s - delay_s + board.dead_time_s
    if settle_s > conducts_s + 1e-10:
        raise UserError(f"settle = {settle_s * 1e6:g} us is longer than the low sides conduct before the sample at the highest duty, sample_window + "
                        f"{delay_s * 1e6:g} us - dead_time = {conducts_s * 1e6:.3g} us", where["shunt.settle"],
                        (f"raise sample_window of [pwm] to {need_s * 1e6:.4g} us" if need_s <= WINDOW_MOST_S + 1e-10 else
                         f"no sample_window up to {WINDOW_MOST_S * 1e6:g} us is enough: a faster amplifier or a shorter dead_time") + " (docs/law.md#the-sample)")
