"""Scenario files: what happens to the board over time, what to measure and what to expect, read from TOML. Unknown keys are refused.

docs/scenarios.md says how to write one; docs/files.md lists every key."""

from typing import Any

from tools.common import paths
from tools.common.board_keys import Values
from tools.common.toml_file import REQUIRED, Document, Section
from .expect import read_expectations
from .metrics import SPEEDS, Measure
from .panel import HOLD_S
from .scenario import Event, Scenario

MOTOR = "hurst_dmb0224c10002"
EVENT_KINDS = ("start_rpm", "press", "speed_rpm", "speed_percent", "speed", "current_a", "pot", "set", "torque_percent", "debug")


def load(name: str) -> Scenario:
    """The scenario tools/bench/scenarios/NAME.toml, or the one in the file NAME."""
    return read(Document(paths.find("scenario", name, paths.SCENARIOS)))


def read(document: Document) -> Scenario:
    """Check a whole document and return what it says."""
    root = document.root
    scenario = Scenario(document.path.stem, root.text("title"), root.text("description", ""), root.text("motor", MOTOR),
                        root.text("board", ""), root.number("duration_s", minimum=0.01, maximum=120.0), root.flag("follows_header", False))
    scenario.motor_where, scenario.board_where = root.where("motor"), root.where("board")
    _read_firmware(root.section("firmware"), scenario)
    scenario.plant = Values.from_section(root.section("plant"))
    _read_start(root.section("start"), scenario)
    fault = _fault_tables(root.section("fault"))
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
    scenario.defines = section.texts("defines", [])
    for define in scenario.defines:
        name, _, value = define.partition("=")
        if not name.isidentifier() or not all(c.isalnum() or c in "+-._" for c in value):
            raise section.fail("defines", f"'{define}' is no macro", "write \"NAME\" or \"NAME=value\"")
    section.close()


def _read_start(section: Section | None, scenario: Scenario) -> None:
    if section is None:
        return
    scenario.rotor_deg = section.number("rotor_deg", 0.0, -360.0, 360.0)
    scenario.speed_rpm = section.number("speed_rpm", 0.0, -10000.0, 10000.0)
    section.close()


def _fault_tables(section: Section | None) -> dict[str, list[Section]]:
    """The tables of events, measures and expectations that [fault] stands for."""
    if section is None:
        return {"event": [], "measure": [], "expect": []}
    rpm, name, within_s = section.number("rpm"), section.text("name"), section.number("within_s", minimum=0.0)
    cause, mended = section.values("cause"), section.values("mended")
    section.close({"over_s", "note", "mended_note", "from_cause", "kept_to_s"})

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
    return {key: [Section(section.document, row, section.path) for row in rows] for key, rows in tables.items()}


def _read_event(section: Section, duration_s: float) -> list[Event]:
    at_s = section.number("at_s", minimum=0.0)
    if at_s > duration_s:
        raise section.fail("at_s", f"at_s = {at_s:g} is after the end", f"choose 0 .. duration_s = {duration_s:g}")
    note = section.text("note", "")
    hold_s = section.number("hold_s", None, 0.001, duration_s)
    over_s = section.number("over_s", None, 0.0, duration_s)
    kind = section.one_of(EVENT_KINDS)
    if hold_s is not None and kind != "press":
        raise section.fail("hold_s", f"'hold_s' with '{kind}'", "only press is held; remove it")
    if over_s is not None and kind in ("start_rpm", "press", "debug"):
        raise section.fail("over_s", f"'over_s' with '{kind}'", "only potentiometer and set can take time; remove it")
    event = {"at_s": at_s, "kind": kind, "where": section.where(kind), "note": note, "over_s": over_s or 0.0}
    if kind == "start_rpm":
        turned = Event(0.0, "speed_rpm", event["where"], value=section.number(kind))
        return [turned, Event(at_s, "press", event["where"], button="S2", hold_s=HOLD_S, note=note)]
    if kind == "press":
        event |= {"button": section.choice(kind, ("S2", "S3")), "hold_s": HOLD_S if hold_s is None else hold_s}
    elif kind == "set":
        event["keys"] = section.values(kind)
    elif kind == "debug":
        event["variables"] = _variables(section, kind)
    elif kind == "speed":
        event["text"] = section.choice(kind, SPEEDS)
    else:
        event["value"] = section.number(kind, **_EVENT_RANGES.get(kind, {}))
    return [Event(**event)]


_EVENT_RANGES = {"pot": {"minimum": 0.0, "maximum": 1.0}, "speed_percent": {"minimum": -1000.0, "maximum": 1000.0},
                 "torque_percent": {"minimum": 0.0, "maximum": 1000.0}}


def _variables(section: Section, key: str) -> dict[str, int]:
    values = section.values(key)
    for name, value in values.items():
        if value != int(value) or not -32768 <= value <= 65535:
            raise section.fail(key, f"'{name}' = {value:g} is impossible", "choose a whole number within 16 bits")
    return {name: int(value) for name, value in values.items()}


def _read_measures(sections: list[Section], scenario: Scenario) -> None:
    for section in sections:
        rpm = section.number("reference_rpm", None)
        name = section.text("name", REQUIRED if rpm is None else f"{rpm:g} rpm")
        from_s = section.number("from_s", minimum=0.0)
        to_s = section.number("to_s", maximum=scenario.duration_s)
        given = [key for key in ("reference_rpm", "reference_percent", "reference") if key in section]
        if len(given) > 1:
            raise section.fail(given[1], f"'{given[0]}' and '{given[1]}' together", "keep one of them")
        references = {"reference_rpm": rpm, "reference_percent": section.number("reference_percent", None),
                      "reference": section.choice("reference", SPEEDS, "")}
        section.close()
        if to_s <= from_s:
            raise section.fail("to_s", f"to_s = {to_s:g} is not after from_s = {from_s:g}", "choose a later one")
        if given and references[given[0]] == 0.0:
            raise section.fail(given[0], f"'{given[0]}' = 0 is impossible", "leave it out where no speed is asked for")
        if any(measure.name == name for measure in scenario.measures):
            raise section.fail("name", f"two measures are called '{name}'", "rename one")
        scenario.measures.append(Measure(name, from_s, to_s, **references))
