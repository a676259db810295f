"""The keys of motor, board and scenario files, as their loaders ask for them: unit, range and default are the loaders' own; only the
meanings stand here. A key without a meaning, or a meaning without a key, is an error."""

import contextlib
import itertools
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tools.bench import expect, metrics, scenario_file
from tools.common import board_file, motor_file, paths, units
from tools.common.errors import UserError
from tools.common.toml_file import REQUIRED, Document, Section

EXAMPLES = {"motor": [paths.ROOT / "examples/my_motor.toml", paths.MOTORS / "hurst_dmb0224c10002.toml"],
            "board": [paths.ROOT / "examples/my_board.toml"],
            "scenario": [paths.ROOT / "examples/my_scenario.toml", *sorted(paths.SCENARIOS.glob("*.toml"))]}
"""Files that use every key at least once."""
LOADERS: dict[str, Callable[[str], Any]] = {"motor": motor_file.load, "board": board_file.load, "scenario": scenario_file.load}
FREE = ("plant", "tune", "pins")
"""Tables whose keys are listed elsewhere."""
UNITS = {"_s": "s", "_rpm": "rpm", "_deg": "deg", "_percent": "%", "_a": "A"}
PAIR = "pair of values"

MEANINGS: dict[str, dict[str, str]] = {
    "motor": {
        "title": "one line for tables and reports", "connection": "`Y` (star) or `delta`; counts only for values per `winding`",
        "board": "the board that turns it: a name in tuning/boards or a path; `BOARD=` overrides it",
        "electrical.pole_pairs": "pole pairs: half the number of poles",
        "electrical.resistance": "winding; `at_degc` is the temperature of the value",
        "electrical.inductance": "of a motor whose d and q axes do not differ; `frequency_hz` of the LCR meter",
        "electrical.inductance_d": "smallest inductance over the rotor's angle; with inductance_q instead of inductance",
        "electrical.inductance_q": "largest inductance over the rotor's angle",
        "electrical.kphi": "motor constant in any of its forms; `at_degc` of the magnets",
        "electrical.resistance_tempco": "change of R with temperature; copper if not given",
        "electrical.kphi_tempco": "change of Kphi with temperature; ferrite magnets if not given", "mechanical.inertia": "rotor alone",
        "mechanical.viscous_friction": "torque proportional to speed",
        "mechanical.coulomb_friction": "torque that does not depend on speed; give at least an estimate: without it a start is harder",
        "rating.voltage": "rated voltage", "rating.current": "rated current", "rating.torque": "rated torque",
        "rating.speed": "rated speed", "rating.maximum_speed": "speed to reach, by field weakening if need be",
        "rating.maximum_current": "what the winding withstands for a while",
        "rating.thermal_time": "the winding's thermal time constant: more than `current` then trips in time (I2t)",
        "spread.resistance": "smallest and largest value of other sheets and measurements; the loops hold over it",
        "spread.inductance": "the same", "spread.kphi": "the same", "load.inertia": "what turns with the rotor",
        "load.start_torque": "what the shaft carries while it starts, the motor's friction not included"},
    "board": {
        "title": "one line for tables and reports", "supply.voltage": "nominal bus", "supply.resistance": "of the supply and its cable",
        "supply.sinks": "true: the supply takes braking current back", "bus.capacitance": "bus capacitors",
        "bus.load": "what the board itself draws", "inverter.rds_on": "on-resistance of a transistor",
        "inverter.diode_voltage": "forward voltage of its diode",
        "inverter.trip_current": "bus current at which the comparator pulls FLTA1; 0: no comparator",
        "shunt.resistance": "shunt in the low leg of a phase", "shunt.amplifier_gain": "of the shunt's amplifier",
        "shunt.reference": "amplifier's output without current", "shunt.settle": "time until the amplifier shows the current",
        "shunt.inverted": "true: the output falls with current into the motor", "adc.bits": "resolution of the converter",
        "adc.full_scale": "voltage of the converter's full scale", "adc.bus_divider": "bus voltage over the pin's voltage",
        "adc.noise": "standard deviation of a conversion", "pwm.period": "PWM and control period",
        "pwm.dead_time": "between the transistors of a leg", "pwm.sample_window": "low sides on, on each side of the sample",
        "limits.over_voltage": "bus above it trips", "limits.under_voltage": "bus below it trips while running",
        "limits.regen": "braking current falls from here"},
    "scenario": {
        "title": "one line for the list of scenarios", "description": "longer text", "motor": "name in tuning/motors or a path",
        "board": "name in tuning/boards or a path", "duration_s": "motor time of the run",
        "follows_header": "true: a start or a ramp that takes longer with this header shifts what comes after",
        "firmware.defines": "modes or macros of this build, without -D", "start.rotor_deg": "electrical angle of the rotor at power-up",
        "start.speed_rpm": "speed of the shaft at power-up", "event.at_s": "when it happens", "event.note": "text for the protocol",
        "event.hold_s": "how long the button is held", "event.over_s": "how long the change takes, in a straight line",
        "event.start_rpm": "S2, with the potentiometer at this speed since power-up", "event.press": "a button",
        "event.speed_rpm": "potentiometer to this speed, in the range that S3 has chosen",
        "event.speed_percent": "potentiometer to this share of the rated speed, with S3 where it takes that",
        "event.speed": "potentiometer to the header's speed of this name, with S3 where it takes that",
        "event.current_a": "potentiometer to this current, in TORQUE_MODE", "event.pot": "potentiometer's position, left to right",
        "event.set": "keys of the virtual board with their new values: `{ \"load.constant_nm\" = 0.05 }`",
        "event.torque_percent": "the brake `load.constant_nm` to this share of the rated torque",
        "event.debug": "writes 16-bit variables of the firmware, as a debugger would: `{ SnapStart = 1 }`",
        "fault.rpm": "speed at which something breaks after 3 s; it is mended at 4 s, S2 follows at 4.2 s",
        "fault.cause": "keys that break it", "fault.mended": "keys that mend it",
        "fault.name": "fault that must come, stay until S2 and be gone after it", "fault.within_s": "how soon after the cause",
        "fault.over_s": "how long the cause takes", "fault.note": "text for the protocol",
        "fault.mended_note": "the same for the mending", "fault.from_cause": "as in expect fault",
        "fault.kept_to_s": "as in expect fault", "measure.name": "the row's name; reference_rpm if not given", "measure.from_s": "begin",
        "measure.to_s": "end", "measure.reference_rpm": "speed that the error is told against; one of the three at most",
        "measure.reference_percent": "the same as a share of the rated speed", "measure.reference": "the same by the header's name",
        "expect.kind": "what must hold; each has its keys below", "expect measure": "values of rows of the table",
        "expect measure.measure": "name, or a list of names", "expect measure.value": "column, see below",
        "expect speed": "the true mean speed holds the reference", "expect speed.measure": "name, or a list of names",
        "expect speed.percent": "at most this error", "expect hand_over": "closed loop after S2",
        "expect hand_over.press": "which press of S2", "expect hand_over.within_s": "how soon",
        "expect hand_over.overshoot_percent": "at most", "expect hand_over.no_reverse_motion": "true: never backwards",
        "expect stop": "outputs off after S2, and off to the end", "expect stop.after_s": "when S2 was pressed",
        "expect stop.within_s": "how soon", "expect stop.to_s": "until when they stay off",
        "expect stop.speed_max_rpm": "no faster when they go off", "expect stop.lowest_rpm": "no slower on the way",
        "expect stop.brake_max_a": "braking current at most; MAXIMUM_CURRENT_A if not given",
        "expect outputs_off": "all six outputs off", "expect bus_voltage": "lowest and highest bus voltage",
        "expect bus_voltage.above_regen": "true: `max` counts from REGEN_LIMIT_V, at 24 V or in proportion",
        "expect signal": "a signal of the trace: a readable key below or of `python3 -m tools.bench keys`",
        "expect signal.signal": "its name", "expect signal.statistic": "what of it", "expect state": "the drive's state",
        "expect state.name": "state, as in docs/flashing.md", "expect state.at_s": "then; or from_s and to_s",
        "expect state.never": "true: it must not occur", "expect fault": "a fault", "expect fault.name": "as in docs/faults.md",
        "expect fault.after_s": "when its cause begins", "expect fault.within_s": "how soon it comes",
        "expect fault.outputs_off_within_periods": "PWM periods from the fault to the outputs off",
        "expect fault.from_cause": "true: from the cause", "expect fault.kept_to_s": "the code stays until then",
        "expect fault.cleared_from_s": "no fault from then on", "expect no_fault": "no fault",
        "expect no_warnings": "the virtual board found nothing wrong with the firmware's settings",
        "expect clean": "no fault and no warnings", "expect variable": "a firmware variable at the end",
        "expect variable.name": "its name, as a debugger knows it", "expect variable.count": "16-bit elements",
        "expect variable.statistic": "what of them", "*.min": "at least; min, max or both", "*.max": "at most", "*.from_s": "begin",
        "*.to_s": "end"}}
DEFAULTS = {"board": "`mclv`", "electrical.resistance_tempco": f"{100.0 * motor_file.COPPER_PER_K:g} %/K",
            "electrical.kphi_tempco": f"{100.0 * motor_file.FERRITE_PER_K:g} %/K",
            "mechanical.viscous_friction": "0", "mechanical.coulomb_friction": "0", "rating.maximum_current": "1.5 times current", "rating.thermal_time": "no I2t",
            "load.inertia": "0", "load.start_torque": "a quarter of the rated torque",
            "measure.name": "reference_rpm as text", "expect speed.measure": "all with a reference",
            "electrical.inductance": "this, or d and q", "electrical.inductance_d": "with q, or inductance",
            "electrical.inductance_q": "with d, or inductance"}
"""What stands in for a key that the file leaves out, where the loader does not say it."""


@dataclass(frozen=True)
class Asked:
    """One key as a loader asks for it."""

    table: str
    key: str
    what: str
    default: Any = REQUIRED
    low: float | str = ""
    high: float | str = ""
    options: tuple[str, ...] = ()
    kind: units.Kind | None = None
    more: str = ""

    @property
    def name(self) -> str:
        return f"{self.table}.{self.key}" if self.table else self.key

    def shape(self) -> tuple:
        """What is the same in every file; a unit's factor may depend on the pole pairs."""
        kind = self.kind and (self.kind.si_unit, self.kind.minimum, self.kind.maximum, *self.kind.units)
        return self.what, DEFAULTS.get(self.name) or self.default, self.low, self.high, self.options, kind


def _table(section: Section) -> str:
    names = [part for part in section.path if isinstance(part, str)]
    return f"expect {section.data['kind']}" if names == ["expect"] and "kind" in section.data else ".".join(names)


def _is_written(section: Section) -> bool:
    """False for a table that stands for others, as [fault] does."""
    data: Any = section.document.data
    for part in section.path:
        data = data[part] if isinstance(part, int) or part in data else None
    return data is section.data


class Listener:
    """Notes what loaders ask for, while their ways of asking are replaced by ones that tell it."""

    def __init__(self) -> None:
        self.found: dict[str, Asked] = {}
        self.inside = 0

    def note(self, section: Section, key: str, what: str, **more: Any) -> None:
        if self.inside or not _is_written(section) or section.path[:1] and section.path[0] in FREE:
            return
        table = "expect" if key == "kind" else _table(section)
        bounds = {section.document.data.get("duration_s"): "duration_s", section.data.get("after_s"): "after_s"}
        bounds = {value: text for value, text in bounds.items() if value} # a bound of zero is zero
        for name in ("low", "high", "default"):
            if isinstance(more.get(name), float) and more[name] in bounds:
                more[name] = bounds[more[name]]
        asked = Asked(table, key, what, **more)
        known = self.found.setdefault(asked.name, asked)
        if known.shape() != asked.shape():
            raise UserError(f"'{asked.name}' is asked for in two ways", "tools/docs/file_keys.py", f"{known} and {asked}")

    def hush(self, call: Callable[..., Any], *arguments: Any, **more: Any) -> Any:
        """The call, without what it asks for in turn."""
        self.inside += 1
        try:
            return call(*arguments, **more)
        finally:
            self.inside -= 1

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        own = {"text": self._value("text"), "flag": self._value("true or false"), "texts": self._value("list of texts"),
               "number": self._number("number"), "integer": self._number("whole number"), "choice": self._choice("text"),
               "choices": self._choice("text or list of texts"), "values": self._value("table of keys")}
        quantities = {"read": self._quantity("quantity"), "read_pair": self._quantity(PAIR), "read_count": self._count, "detail": self._detail}
        with contextlib.ExitStack() as stack:
            for owner, calls in ((Section, own), (units, quantities)):
                for name, wrap in calls.items():
                    old = getattr(owner, name)
                    stack.callback(setattr, owner, name, old)
                    setattr(owner, name, wrap(old))
            yield

    def _value(self, what: str) -> Callable:
        def wrap(call: Callable) -> Callable:
            def ask(section: Section, key: str, default: Any = REQUIRED, **more: Any) -> Any:
                self.note(section, key, what, default=default)
                rest = more if default is REQUIRED else more | {"default": default}
                return self.hush(call, section, key, **rest)
            return ask
        return wrap

    def _number(self, what: str) -> Callable:
        def wrap(call: Callable) -> Callable:
            def ask(section: Section, key: str, default: Any = REQUIRED, minimum: float = -float("inf"), maximum: float = float("inf")) -> Any:
                self.note(section, key, what, default=default, low=float(minimum), high=float(maximum))
                return self.hush(call, section, key, default, minimum, maximum)
            return ask
        return wrap

    def _choice(self, what: str) -> Callable:
        def wrap(call: Callable) -> Callable:
            def ask(section: Section, key: str, options: Any, *default: Any) -> Any:
                shown = () if key == "measure" else tuple(options) # a measure's names are the file's own
                self.note(section, key, what, default=default[0] if default else REQUIRED, options=shown)
                return self.hush(call, section, key, options, *default)
            return ask
        return wrap

    def _quantity(self, what: str) -> Callable:
        def wrap(call: Callable) -> Callable:
            def ask(section: Section, key: str, kind: units.Kind, *rest: Any, **more: Any) -> Any:
                self.note(section, key, what, kind=kind)
                return self.hush(call, section, key, kind, *rest, **more)
            return ask
        return wrap

    def _count(self, call: Callable) -> Callable:
        def ask(section: Section, key: str, minimum: int, maximum: int, what: str) -> Any:
            self.note(section, key, "count", low=float(minimum), high=float(maximum))
            return self.hush(call, section, key, minimum, maximum, what)
        return ask

    def _detail(self, call: Callable) -> Callable:
        def ask(section: Section, key: str, part: str, default: float | None, minimum: float, maximum: float) -> Any:
            name = f"{_table(section)}.{key}"
            stands_in = "" if default is None else f", {default:g} if not given"
            self.found[name] = replace(self.found[name], more=f"`{part}` {minimum:g} .. {maximum:g}{stands_in}")
            return call(section, key, part, default, minimum, maximum)
        return ask


def listen(kind: str) -> dict[str, Asked]:
    """Every key that the loader of this kind of file asks for."""
    listener = Listener()
    for path in EXAMPLES[kind]:
        with listener.listening():
            LOADERS[kind](str(path))
    found = listener.found
    if kind == "scenario": # what [fault] hands on to other tables
        for key, like in (("over_s", "event.over_s"), ("note", "event.note"), ("mended_note", "event.note"),
                          ("from_cause", "expect fault.from_cause"), ("kept_to_s", "expect fault.kept_to_s")):
            found[f"fault.{key}"] = replace(found[like], table="fault", key=key)
    else:
        for name, asked in found.items():
            if asked.default is REQUIRED and not _is_required(kind, asked):
                found[name] = replace(asked, default=None)
    return dict(sorted(found.items(), key=lambda item: _place(list(MEANINGS[kind]), item[1])))


def _place(order: list[str], asked: Asked) -> int:
    """Keys stand as their meanings do; what every table has alike comes last in its table."""
    name = asked.name if asked.name in order else next(
        (name for name in reversed(order) if name == asked.table or name.startswith(f"{asked.table}.")), order[-1])
    return order.index(name)


def _is_required(kind: str, asked: Asked) -> bool:
    """Whether the loader refuses the example without the line of this key."""
    table, kept = "", []
    for line in EXAMPLES[kind][0].read_text(encoding="utf-8").splitlines():
        table = line.strip("[]") if line.startswith("[") else table
        if table != asked.table or not re.match(rf"{asked.key}\s*=", line):
            kept.append(line)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / EXAMPLES[kind][0].name
        path.write_text("\n".join(kept), encoding="utf-8")
        try:
            LOADERS[kind](str(path))
        except UserError as error:
            if "is missing" not in str(error):
                raise
            return True
    return False


def meaning(kind: str, asked: Asked) -> str:
    """The text for a key; what every table has alike stands under *."""
    known = MEANINGS[kind]
    try:
        text = known.get(asked.name) or known[f"*.{asked.key}"]
    except KeyError:
        raise UserError(f"no meaning of '{asked.name}' in a {kind} file", "tools/docs/file_keys.py", "add it to MEANINGS") from None
    return text + (f"; {asked.more}" if asked.more else "")


def _limit(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def span(asked: Asked) -> str:
    """What the value may be."""
    if asked.options:
        return "see below" if len(asked.options) > 8 else ", ".join(f"`{option}`" for option in asked.options)
    low, high = (asked.kind.minimum, asked.kind.maximum) if asked.kind else (asked.low, asked.high)
    no_low, no_high = low in ("", -float("inf")), high in ("", float("inf"))
    if no_low and no_high:
        return asked.what
    return f"from {_limit(low)}" if no_high else f"to {_limit(high)}" if no_low else f"{_limit(low)} .. {_limit(high)}"


def unit(asked: Asked) -> str:
    if asked.kind:
        return asked.kind.si_unit
    if asked.what != "number":
        return "pairs" if asked.key == "pole_pairs" else ""
    return next((text for suffix, text in UNITS.items() if f"_{asked.key}".endswith(suffix)), "")


def default(asked: Asked) -> str:
    """What stands in for a key that is not there."""
    if asked.name in DEFAULTS:
        return DEFAULTS[asked.name]
    if asked.table == "event" and asked.key in scenario_file.EVENT_KINDS:
        return "one of these"
    if asked.default is REQUIRED:
        return "must be given"
    if isinstance(asked.default, bool):
        return str(asked.default).lower()
    return "" if asked.default in (None, "", []) else _limit(asked.default)


def _rows(kind: str, asked: list[Asked]) -> list[list[str]]:
    return [[f"`{item.key}`", unit(item), span(item), default(item), meaning(kind, item)] for item in asked]


HEAD, ALIGN = "key, unit, range, default, meaning", "lllll"


def _check_meanings(kind: str, found: dict[str, Asked]) -> None:
    """A meaning that no key has any more is an error, too."""
    kinds = {f"expect {name}" for name in expect.KINDS}
    keys = {item.key for item in found.values()}
    for name in MEANINGS[kind]:
        if name not in found and name not in kinds and not (name.startswith("*.") and name[2:] in keys):
            raise UserError(f"no key '{name}' in a {kind} file", "tools/docs/file_keys.py", "take it out of MEANINGS")


def _units_table(found: dict[str, Asked], table: Callable) -> str:
    kinds: dict[tuple, list[str]] = {}
    for item in found.values():
        if item.kind and item.what != PAIR:
            kinds.setdefault((item.kind.si_unit, tuple(item.kind.units)), []).append(f"`{item.key}`")
    rows = [[", ".join(dict.fromkeys(keys)), ", ".join(f"`{name}`" for name in names)] for (_, names), keys in kinds.items()]
    return table("keys, units", "ll", rows)


def of_file(kind: str, table: Callable) -> str:
    """The tables of one kind of file."""
    found = listen(kind)
    _check_meanings(kind, found)
    text = ""
    for name, group in itertools.groupby(found.values(), key=lambda item: item.table):
        if name.startswith("expect "):
            continue
        many = name in ("event", "measure", "expect")
        head = f"[[{name}]], any number" if many else f"[{name}]" if name else "At the top of the file"
        text += f"### {kind}: {head}\n\n" + table(HEAD, ALIGN, _rows(kind, list(group))) + "\n"
    if kind == "scenario":
        return text + _expectations(found, table)
    return text + f"### {kind}: units\n\n" + _units_table(found, table) + "\n"


def _expectations(found: dict[str, Asked], table: Callable) -> str:
    rows = []
    for name in expect.KINDS:
        rows.append([f"**`{name}`**", "", "", "", MEANINGS["scenario"][f"expect {name}"]])
        rows += _rows("scenario", [item for item in found.values() if item.table == f"expect {name}"])
    text = "### scenario: kinds of [[expect]]\n\n" + table("kind and keys, unit, range, default, meaning", ALIGN, rows)
    columns = [[f"`{name}`", told] for name, told in metrics.MEASURE_VALUES.items()]
    text += "\nColumns of a row (`value`):\n\n" + table("value, meaning", "ll", columns)
    statistics = found["expect signal.statistic"].options
    return text + "\n`statistic` is one of " + ", ".join(f"`{name}`" for name in statistics) + ".\n\n"


def plant_keys() -> list[list[str]]:
    """The virtual board's keys from its source: name, unit, range, default, meaning; a key that can only be read has no range."""
    folder = paths.ROOT / "tools" / "vboard"
    constants = dict(re.findall(r"#define (VB_\w+) ([\d.]+)", (folder / "vb_state.h").read_text(encoding="utf-8")))
    source = (folder / "vb_keys.c").read_text(encoding="utf-8")
    found = re.findall(r'^    (P|I|R|G|S|SF|SP|W)\("([\w.]+)", (.*), "([^"]*)", "([^"]*)"\),$', source, re.MULTILINE)
    rows = []
    for macro, name, middle, measured_in, told in found:
        if macro in "RG":
            rows.append([name, measured_in, "", "", told])
            continue
        start, low, high = ("", "0", "1") if macro == "W" else middle.split(", ")[-3:]
        start = constants.get(start, start)
        rows.append([name, measured_in, f"{float(low):g} .. {float(high):g}", f"{float(start):g}" if start else "", told])
    return rows


def page(table: Callable) -> str:
    """All generated parts of docs/files.md; `table` writes one in Markdown."""
    text = "".join(f"## {kind.capitalize()} file\n\n" + of_file(kind, table) for kind in LOADERS)
    writable, readable = ([[f"`{row[0]}`", *row[1:]] for row in plant_keys() if bool(row[2]) == whether] for whether in (True, False))
    text += "## Keys of the virtual board\n\n### Keys that can be set\n\n" + table(HEAD, ALIGN, writable)
    return text + "\n### Keys that can only be read\n\n" + table("key, unit, meaning", "lll", [[row[0], row[1], row[4]] for row in readable])
