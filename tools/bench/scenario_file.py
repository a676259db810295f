"""Scenario files: what happens to the board over time, what to measure and what to expect, read from TOML. Unknown keys are refused.

docs/scenarios.md says how to write one; docs/files.md lists every key."""

from typing import Any

from tools.common import param_rows, paths
from tools.common.board_keys import Values
from tools.common.errors import suggestion
from tools.common.toml_file import REQUIRED, Document, Section
from . import build
from .expect import read_expectations
from .metrics import MIDDLE, SPEEDS, STANDSTILL, Measure
from .panel import HOLD_S
from .scenario import Event, Scenario

MOTOR = "hurst_dmb0224c10002"
EVENT_KINDS = {
    "start_rpm": "S2, with the potentiometer at this speed since power-up", "press": "a button",
    "speed_rpm": "potentiometer to this speed, in the range that S3 has chosen",
    "speed_percent": "potentiometer to this share of the rated speed, with S3 where it takes that",
    "speed": "potentiometer to the header's speed of this name, with S3 where it takes that",
    "current_a": "potentiometer to this current, in TORQUE_MODE", "pot": "potentiometer's position, left to right",
    "set": "keys of the virtual board with their new values: `{ \"load.constant_nm\" = 0.05 }`",
    "torque_percent": "the brake `load.constant_nm` to this share of the rated torque",
    "debug": "writes 16-bit variables of the firmware, as a debugger would: `{ SnapStart = 1 }`",
    "parameter": "changes parameters of userparams.h, in a build with PARAMS_IN_RAM or TUNING; a list goes on with the table's next entries: "
                 "`{ IDREF_SPEED5 = [-0.7, -0.8] }`",
    "send": "a line of text for the firmware's serial line, without its end",
    "send_hex": "bytes for the firmware's serial line: `\"55 05 01\"`; a scenario saved while the scope ran has them"}
"""What an event does, and what docs/files.md says of it."""


def load(name: str) -> Scenario:
    """The scenario tools/bench/scenarios/NAME.toml, or the one in the file NAME."""
    return read(Document(paths.find("scenario", name, paths.SCENARIOS)))


def read(document: Document) -> Scenario:
    """Check a whole document and return what it says."""
    root = document.root
    scenario = Scenario(
        document.path.stem, root.text("title", meaning="one line for the list of scenarios"), root.text("description", "", "longer text"),
        root.text("motor", MOTOR, "name in tuning/motors, or a path as seen from this file"),
        root.text("board", "", "name in tuning/boards, or a path as seen from this file; else the motor file's"),
        root.number("duration_s", REQUIRED, 0.01, 120.0, "motor time of the run"),
        root.flag("follows_header", False, "true: a start or a ramp that takes longer with this header shifts what comes after"))
    scenario.motor_where, scenario.board_where = root.where("motor"), root.where("board")
    for key, where in (("motor", scenario.motor_where), ("board", scenario.board_where)):
        name, note = paths.beside(getattr(scenario, key), document.path)
        setattr(scenario, key, name)
        scenario.notes += [f"{where}: {note}"] if note else []
    _read_firmware(root.section("firmware"), scenario)
    scenario.plant = Values.from_section(root.section("plant"))
    _read_start(root.section("start"), scenario)
    fault = _fault_tables(root.section("fault"), scenario.duration_s)
    scenario.events = [event for section in fault["event"] + root.sections("event") for event in _read_event(section, scenario.duration_s)]
    scenario.events.sort(key=lambda event: event.at_s)
    _read_measures(fault["measure"] + root.sections("measure"), scenario)
    measures = {measure.name: measure.has_reference for measure in scenario.measures}
    for section in fault["expect"] + root.sections("expect"):
        found = read_expectations(section, measures, scenario.duration_s)
        scenario.expectations += found
        scenario.expectations_where += [section.where("kind")] * len(found)
    root.close()
    return scenario


def _read_firmware(section: Section | None, scenario: Scenario) -> None:
    if section is None:
        return
    scenario.defines = section.texts("defines", [], "modes or macros of this build, without -D")
    for define in scenario.defines:
        name, _, value = define.partition("=")
        if not name.isidentifier() or not all(c.isalnum() or c in "+-._" for c in value):
            raise section.fail("defines", f"'{define}' is no macro", "write \"NAME\" or \"NAME=value\"")
    if named := section.text("app", "", "application: a name of firmware/app, or a path"):
        scenario.defines.append(build.app(named, section.where("app"), section.document.path))
    section.close()


def _read_start(section: Section | None, scenario: Scenario) -> None:
    if section is None:
        return
    scenario.rotor_deg = section.number("rotor_deg", 0.0, -360.0, 360.0, "electrical angle of the rotor at power-up")
    scenario.speed_rpm = section.number("speed_rpm", 0.0, -10000.0, 10000.0, "speed of the shaft at power-up")
    section.close()


def _fault_tables(section: Section | None, duration_s: float) -> dict[str, list[Section]]:
    """The tables of events, measures and expectations that [fault] stands for."""
    if section is None:
        return {"event": [], "measure": [], "expect": []}
    rpm = section.number("rpm", meaning="speed at which something breaks after 3 s; it is mended at 4 s, S2 follows at 4.2 s")
    cause, mended = section.values("cause", meaning="keys that break it"), section.values("mended", meaning="keys that mend it")
    name = section.text("name", meaning="fault that must come, stay until S2 and be gone after it")
    within_s = section.number("within_s", minimum=0.0, meaning="how soon after the cause")
    section.number("over_s", None, 0.0, duration_s, "how long the cause takes")
    section.text("note", "", "text for the protocol")
    section.text("mended_note", "", "the same for the mending")
    section.flag("from_cause", False, "as in expect fault")
    section.number("kept_to_s", None, 0.0, duration_s, "as in expect fault")
    section.close()

    def given(**keys: str) -> dict[str, Any]:
        return {new: section.data[key] for new, key in keys.items() if key in section}

    tables = {
        "event": [{"at_s": 0.2, "start_rpm": rpm}, {"at_s": 3.0, "set": cause, **given(over_s="over_s", note="note")},
                  {"at_s": 4.0, "set": mended, **given(note="mended_note")}, {"at_s": 4.2, "press": "S2"}],
        "measure": [{"name": "before", "from_s": 2.5, "to_s": 3.0, "reference_rpm": rpm}],
        "expect": [{"kind": "hand_over"}, {"kind": "no_fault", "to_s": 3.0},
                   {"kind": "fault", "name": name, "after_s": 3.0, "within_s": within_s, "kept_to_s": 4.2, "cleared_from_s": 4.3,
                    **given(from_cause="from_cause", kept_to_s="kept_to_s")},
                   {"kind": "state", "name": "STOPPED", "from_s": 4.3}, {"kind": "outputs_off", "from_s": round(3.01 + within_s, 2)}]}
    return {key: [Section(section.document, row, section.path, noted=False) for row in rows] for key, rows in tables.items()}


def _read_event(section: Section, duration_s: float) -> list[Event]:
    at_s = section.number("at_s", minimum=0.0, meaning="when it happens")
    if at_s > duration_s:
        raise section.fail("at_s", f"at_s = {at_s:g} is after the end", f"choose 0 .. duration_s = {duration_s:g}")
    note = section.text("note", "", "text for the protocol")
    hold_s = section.number("hold_s", None, 0.001, duration_s, "how long the button is held")
    over_s = section.number("over_s", None, 0.0, duration_s, "how long the change takes, in a straight line")
    then = section.choice("then", (STANDSTILL, *SPEEDS, MIDDLE), "", "speed that an application asks for after it: with follows_header what comes later waits for that")
    then_rpm = section.number("then_rpm", None, 0.0, meaning="the same as a number")
    kind = section.one_of(tuple(EVENT_KINDS))
    meaning = EVENT_KINDS[kind]
    if hold_s is not None and kind != "press":
        raise section.fail("hold_s", f"'hold_s' with '{kind}'", "only press is held; remove it")
    if over_s is not None and kind in ("start_rpm", "press", "debug", "parameter", "send", "send_hex"):
        raise section.fail("over_s", f"'over_s' with '{kind}'", "only potentiometer and set can take time; remove it")
    event = {"at_s": at_s, "kind": kind, "where": section.where(kind), "note": note, "over_s": over_s or 0.0, "then": then, "then_rpm": then_rpm}
    if kind == "start_rpm":
        turned = Event(0.0, "speed_rpm", event["where"], value=section.number(kind, meaning=meaning))
        return [turned, Event(at_s, "press", event["where"], button="S2", hold_s=HOLD_S, note=note)]
    if kind == "press":
        event |= {"button": section.choice(kind, ("S2", "S3"), meaning=meaning), "hold_s": HOLD_S if hold_s is None else hold_s}
    elif kind == "set":
        event["keys"] = section.values(kind, meaning=meaning)
    elif kind == "debug":
        event["variables"] = _variables(section, kind, meaning)
    elif kind == "parameter":
        event["parameters"], event["written"] = _parameters(section, kind, meaning)
    elif kind == "send":
        event["text"] = section.text(kind, meaning=meaning)
    elif kind == "send_hex":
        event["text"] = _bytes(section, kind, meaning)
    elif kind == "speed":
        event["text"] = section.choice(kind, SPEEDS, meaning=meaning)
    else:
        event["value"] = section.number(kind, **_EVENT_RANGES.get(kind, {}), meaning=meaning)
    return [Event(**event)]


_EVENT_RANGES = {"pot": {"minimum": 0.0, "maximum": 1.0}, "speed_percent": {"minimum": -1000.0, "maximum": 1000.0},
                 "torque_percent": {"minimum": 0.0, "maximum": 1000.0}}


def _bytes(section: Section, key: str, meaning: str) -> str:
    """Bytes as characters of the same numbers."""
    text = section.text(key, meaning=meaning)
    try:
        return bytes.fromhex(text).decode("latin-1")
    except ValueError:
        raise section.fail(key, f"'{text}' is no row of bytes", "write two hexadecimal digits for each, such as \"55 05 01\"") from None


def _variables(section: Section, key: str, meaning: str) -> dict[str, int]:
    values = section.values(key, meaning=meaning)
    for name, value in values.items():
        if value != int(value) or not -32768 <= value <= 65535:
            raise section.fail(key, f"'{name}' = {value:g} is impossible", "choose a whole number within 16 bits")
    return {name: int(value) for name, value in values.items()}


def _parameters(section: Section, key: str, meaning: str) -> tuple[dict[str, float], str]:
    """Values by name, and the same as a text. A list under an entry of a table is for this entry and the next ones."""
    section.note(key, "table of parameters", meaning)
    table = section.data[key]
    if not isinstance(table, dict) or not table:
        raise section.fail(key, f"'{key}' is not a table", f"write {key} = {{ IDREF_SPEED5 = -0.7 }}")
    known, inner = param_rows.parameters(), Section(section.document, table, section.path + (key,), noted=False)
    result: dict[str, float] = {}
    texts = []
    for first, value in table.items():
        if first not in known:
            raise inner.fail(first, f"'{first}' is no parameter of userparams.h", suggestion(first, known, "docs/parameters.md"))
        row = known[first]
        values = inner.numbers(first) if isinstance(value, list) else [inner.number(first)]
        names = [name for name in known if known[name].stem == row.stem] if row.stem else [first]
        names = names[names.index(first):][:len(values)]
        if len(names) < len(values):
            raise inner.fail(first, f"'{first}' has {len(values)} values for {len(names)}",
                             f"a list goes on to the table's last entry, {names[-1]}, at most" if row.stem else "write one number")
        for name, number in zip(names, values):
            if not float(row.low) <= number <= float(row.high):
                raise inner.fail(first, f"'{name}' = {number:g} is impossible", f"choose {row.low} .. {row.high} {row.unit}")
            if name in result:
                raise inner.fail(first, f"'{name}' is there twice", "keep one of them")
            result[name] = number
        last = f" .. {names[-1].removeprefix(row.stem)}" if len(names) > 1 else ""
        texts.append(f"{first}{last} = {values[0]:g}" + ("" if len(set(values)) == 1 else f" .. {values[-1]:g}"))
    return result, ", ".join(texts)


def _read_measures(sections: list[Section], scenario: Scenario) -> None:
    for section in sections:
        section.note("name", "text", "the row's name", "reference_rpm as text")
        rpm = section.number("reference_rpm", None, meaning="speed that the error is told against; one of the three at most")
        name = section.text("name", REQUIRED if rpm is None else f"{rpm:g} rpm")
        from_s = section.number("from_s", minimum=0.0, meaning="begin")
        to_s = section.number("to_s", maximum=scenario.duration_s, meaning="end")
        given = [key for key in ("reference_rpm", "reference_percent", "reference") if key in section]
        if len(given) > 1:
            raise section.fail(given[1], f"'{given[0]}' and '{given[1]}' together", "keep one of them")
        references = {"reference_rpm": rpm, "reference_percent": section.number("reference_percent", None, meaning="the same as a share of the rated speed"),
                      "reference": section.choice("reference", (*SPEEDS, MIDDLE), "", "the same by the header's name, or half way from minimum to maximum")}
        section.close()
        if to_s <= from_s:
            raise section.fail("to_s", f"to_s = {to_s:g} is not after from_s = {from_s:g}", "choose a later one")
        if given and references[given[0]] == 0.0:
            raise section.fail(given[0], f"'{given[0]}' = 0 is impossible", "leave it out where no speed is asked for")
        if any(measure.name == name for measure in scenario.measures):
            raise section.fail("name", f"two measures are called '{name}'", "rename one")
        scenario.measures.append(Measure(name, from_s, to_s, **references))
