"""`board`: the calculator of an inverter of one's own: what its parts measure, and the board file that says so.

    python3 -m tuning board mclv                                                what a board file comes to
    python3 -m tuning board my_inverter shunt=10mohm gain=20 supply=36 pwm=16kHz  writes tuning/boards/my_inverter.toml, then the same

A new file begins as a copy of mclv.toml (from=NAME: of another one). Every key of a board file may be given, and the pins of [pins]."""

import argparse
import re
from pathlib import Path
from typing import Any

from tools.common import board_file, paths, pins
from tools.common.board_file import BoardFile
from tools.common.errors import UserError, suggestion
from tools.common.toml_file import Document
from tools.common.units import Kind

from . import limits

SHORT = {"shunt": "shunt.resistance", "gain": "shunt.amplifier_gain", "offset": "shunt.reference", "divider": "adc.bus_divider",
         "supply": "supply.voltage", "cable": "supply.resistance", "trip": "inverter.trip_current", "range": "adc.full_scale",
         "pwm": "pwm.period", "deadtime": "pwm.dead_time"}
"""Short names of keys."""
FLAGS = {"inverted": "shunt.inverted", "sinks": "supply.sinks"}
OF_SUPPLY = {"limits.over_voltage": 1.4, "limits.under_voltage": 0.5, "limits.regen": 1.125}
"""Limits that follow the supply's voltage, if they are not given: their share of it."""
LEAST_SHARE = 0.063
"""Of full scale: the smallest MAXIMUM_CURRENT_A of include/drive/param_limits.h."""
PWM_STEP_US = 0.05
"""The PWM counts up and down in steps of 25 ns."""
WHERE = "SET"


def add_command(commands: Any) -> None:
    """Adds `board` to a command line's commands."""
    parser = commands.add_parser("board", help="what a board measures; with key=value: write the file of an inverter of one's own")
    parser.add_argument("board", help="a name in tuning/boards, or a board file")
    parser.add_argument("given", nargs="*", metavar="key=value", help="e.g. shunt=10mohm gain=20 offset=1.65 divider=30k/2k supply=36 fault=RB9")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    if not options.given:
        print(text(board_file.load(options.board, "command line")))
        return 0
    path = Path(options.board) if paths.is_path(options.board) else paths.BOARDS / options.board
    path = path if path.suffix == ".toml" else path.with_name(f"{path.name}.toml")
    label = str(paths.shown(path))
    if path.exists():
        raise UserError("the board file is there already", label, "give another name, or remove it first")
    made = written(given(options.given), path)
    board = board_file.read(Document(path, made))
    try:
        path.write_text(made, encoding="utf-8")
    except OSError as error:
        remedy = "choose a folder that can be written" if path.parent.is_dir() else f"make the folder {paths.shown(path.parent)} first"
        raise UserError(f"cannot write the file ({error.strerror})", label, remedy) from None
    print(f"wrote {label}; numbers that nobody gave are those of the board that it began as: look through it\n\n{text(board)}")
    return 0


# ---- what is given ---------------------------------------------------------------------------------------------------------
def keys() -> dict[str, str]:
    """What may be given: short name, or the key's own where only one table has it; and the key with its table."""
    every = [f"{table}.{key}" for table, known in board_file.TABLES.items() for key, told in known.items() if told.has_units]
    own = {name.split(".")[1]: name for name in every if sum(other.endswith(name[name.index("."):]) for other in every) == 1}
    return own | SHORT


def given(words: list[str]) -> dict[str, str]:
    """The words of the command line by key; "from" and pins keep their name."""
    known, result = keys(), {}
    for word in _joined(words):
        name, sign, value = word.partition("=")
        name = name if name in pins.firmware() else name.lower()
        if not sign or not value:
            raise UserError(f"'{word}' is no key=value", WHERE, "write e.g. shunt=10mohm gain=20, without blanks inside")
        if name not in {**known, **FLAGS, **pins.firmware(), "from": "", "title": ""}:
            raise UserError(f"unknown key '{name}'", WHERE, suggestion(name, [*known, *FLAGS, *pins.firmware(), "from", "title"], "docs/files.md"))
        key = known.get(name) or FLAGS.get(name) or name
        if key in result:
            raise UserError(f"'{name}' is given twice", WHERE, "give it once")
        result[key] = value
    return result


def _joined(words: list[str]) -> list[str]:
    """The words, a unit that a blank has cut off (pwm=20 kHz) back at its number."""
    units = {unit for table in board_file.TABLES.values() for key in table.values() if key.has_units for unit in key.kind.units}
    result: list[str] = []
    for word in words:
        if word in units and result and re.search(r"=[-+\d.eE]+$", result[-1]):
            result[-1] += word
        else:
            result.append(word)
    return result


def number(name: str, kind: Kind, value: str) -> tuple[float, str]:
    """A value with its unit; without one it is the first of the kind. A divider may be written as its two resistors, 30k/2k."""
    divider = re.fullmatch(r"([\d.]+)([kM]?)/([\d.]+)([kM]?)", value)
    if divider and name == "adc.bus_divider":
        upper, lower = (_float(digits, name) * {"": 1.0, "k": 1e3, "M": 1e6}[prefix] for digits, prefix in (divider.group(1, 2), divider.group(3, 4)))
        if lower == 0.0:
            raise UserError(f"the lower resistor of '{value}' is 0", WHERE, "write upper/lower, e.g. 30k/2k")
        found, unit = (upper + lower) / lower, "1"
    else:
        match = re.fullmatch(r"([-+]?[\d.]+(?:[eE][-+]?\d+)?) *([A-Za-z]*)", value)
        if not match:
            raise UserError(f"{name} = '{value}' is not a number", WHERE, "write a number with a decimal point, with its unit if you like: 10mohm")
        found, unit = _float(match[1], name), match[2] or next(iter(kind.units))
        unit = next((known for known in kind.units if known.lower() == unit.lower()), unit)
    if unit not in kind.units:
        raise UserError(f"'{unit}' is no unit of {name}", WHERE, "use one of " + ", ".join(kind.units))
    low, high = sorted(kind.units[unit].given(limit) for limit in (kind.minimum, kind.maximum))
    if not low <= found <= high:
        also = " or a frequency such as 16kHz" if "kHz" in kind.units and unit == "s" else ""
        raise UserError(f"{name} = {found:g} {unit} is impossible", WHERE, f"choose {low:g} .. {high:g} {unit}{also}")
    if kind.units[unit].reciprocal: # as a period, of which the PWM counts whole steps
        return round(1e6 * kind.units[unit](found) / PWM_STEP_US) * PWM_STEP_US, "us"
    return found, unit


def _float(digits: str, name: str) -> float:
    try:
        return float(digits)
    except ValueError:
        raise UserError(f"{name} = '{digits}' is not a number", WHERE, "write it with one decimal point") from None


def written(changes: dict[str, str], path: Path) -> str:
    """The text of the new file: another board's with what is given."""
    base = board_file.load(changes.pop("from", board_file.DEFAULT), WHERE)
    lines = base.path.read_text(encoding="utf-8").splitlines()
    while lines and lines[0].startswith("#"): # what is said of the other board
        lines.pop(0)
    title = changes.pop("title", path.stem)
    chosen = {key: changes.pop(key) for key in list(changes) if key in pins.firmware()}
    if "supply.voltage" in changes:
        supply_v, _ = number("supply.voltage", board_file.TABLES["supply"]["voltage"].kind, changes["supply.voltage"])
        changes = {**{key: f"{float(f'{share * supply_v:.3g}'):g}" for key, share in OF_SUPPLY.items()}, **changes}
    table, result = "", ["# Made by: make board; look through every number. [?] in a source: not confirmed for this board."]
    for line in lines:
        header = re.match(r"\[(\w+)\]", line)
        table = header[1] if header else table
        key = re.match(r"(\w+) *=", line)
        result.append(_line(f"{table}.{key[1]}" if key else "", line, changes, title))
    if chosen and "[pins]" in result:
        raise UserError("the other board has pins of its own", WHERE, "leave the pins out here and write them into the new file's [pins]")
    return "\n".join([*result, *(["", "[pins]"] if chosen else []), *(f'{key} = "{value}"' for key, value in chosen.items())]) + "\n"


def _line(name: str, line: str, changes: dict[str, str], title: str) -> str:
    if name == ".title":
        return f'title = "{_quoted(title)}"'
    if name not in changes:
        return line
    table, key = name.split(".")
    if name in FLAGS.values():
        if changes[name] not in ("yes", "no"):
            raise UserError(f"'{key}' = '{changes[name]}' is neither yes nor no", WHERE, "write one of them")
        return f"{key} = {'true' if changes[name] == 'yes' else 'false'}"
    value, unit = number(name, board_file.TABLES[table][key].kind, changes[name])
    return f'{key} = {{ value = {value:.10g}, unit = "{unit}", source = "given to make board: {_quoted(changes[name])}" }}'


def _quoted(words: str) -> str:
    return re.sub(r"[\"\\\x00-\x1f\x7f]", " ", words)


# ---- what it comes to ------------------------------------------------------------------------------------------------------
def text(board: BoardFile) -> str:
    """What a board measures and what the tuner makes of it."""
    given_as = {name: quantity.given for name, quantity in board.quantities.items()}
    full_a, full_v, counts = board.current_full_scale_a, board.bus_full_scale_v, 2 ** board.adc_bits
    trip_a = limits.down(limits.TRIP_SHARE * full_a, 0.05 if full_a > 1.0 else 0.005)
    comparator_a = board.quantities["inverter.trip_current"].value_si
    volts_per_ampere = board.quantities["shunt.resistance"].value_si * board.quantities["shunt.amplifier_gain"].value_si
    rows = [
        ("board", f"{board.title} ({paths.shown(board.path)})"),
        ("current", f"{given_as['shunt.resistance']} * {board.quantities['shunt.amplifier_gain'].value_si:g} = {volts_per_ampere:.4g} V/A around "
                    f"{given_as['shunt.reference']}, output {'falls' if board.current_gain < 0.0 else 'rises'} with current into the motor"),
        ("", f"full scale {full_a:.4g} A peak, one count of {board.adc_bits} bits {2e3 * full_a / counts:.3g} mA; NORM_CURRENT_CONST {full_a / 32768.0:.7g}"),
        ("over-current", f"by the firmware up to {trip_a:.4g} A, by the comparator at {comparator_a:g} A; MAXIMUM_CURRENT_A {LEAST_SHARE * full_a:.2g} .. "
                         f"{limits.digits_down(trip_a / limits.LEAST_TRIP_OVER_MAXIMUM, 3):g} A"),
        ("shunt", f"{0.5 * full_a ** 2 * board.shunt_ohm:.3g} W with a sine of full scale"),
        ("bus", f"full scale {full_v:.4g} V, one count {1e3 * full_v / counts:.3g} mV; the nominal {board.nominal_bus_v:g} V are "
                f"{100.0 * board.nominal_bus_v / full_v:.0f} % of it"),
        ("", f"runs from {board.under_voltage_v:g} V, brakes up to {board.regen_limit_v:g} V, trips at {board.over_voltage_v:g} V"),
        ("PWM", f"{1e-3 / board.pwm_period_s:g} kHz, dead time {1e6 * board.dead_time_s:g} us; highest phase voltage {limits.circle_v(board):.3g} V"),
        ("pins", "those of the MCLV (docs/pins.md)")]
    lines = pins.differences(board.pins)
    if lines:
        rows[-1:] = [("pins", "other than the MCLV's: write into include/board/mclv.h"), *(("", line) for line in lines)]
    notes = []
    if comparator_a > 1.5 * full_a:
        notes.append("the comparator trips far above the converter's range: only the firmware protects between the two")
    if board.nominal_bus_v < 0.3 * full_v:
        notes.append("the bus uses less than a third of the converter's range: a smaller divider measures finer")
    return "\n".join([f"{name:14}{value}" for name, value in rows] + [f"note: {note}" for note in notes])
