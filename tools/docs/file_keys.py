"""The keys of motor, board and scenario files for docs/files.md. Their loaders say all of it: motor and board files in TABLES, scenario files
in what they ask for."""

import math
import re
from collections.abc import Callable

from tools.bench import expect, metrics, scenario_file
from tools.common import board_file, motor_file, paths
from tools.common.errors import UserError
from tools.common.toml_file import REQUIRED, Asked, Document
from tools.common.units import Key

EXAMPLES = [paths.ROOT / "examples/my_scenario.toml", *sorted(paths.SCENARIOS.glob("*.toml"))]
"""Files that use every key of a scenario at least once."""
UNITS = {"_s": "s", "_rpm": "rpm", "_deg": "deg", "_percent": "%", "_a": "A"}
HEAD, ALIGN = "key, unit, range, default, meaning", "lllll"
ROOT_TABLE = "At the top of the file"
Table = Callable[[str, str, list[list[str]]], str]


# ---- motor and board files -------------------------------------------------------------------------------------------------
def _key_row(name: str, key: Key) -> list[str]:
    what = "true or false" if key.kind is None else span(key.kind.minimum, key.kind.maximum)
    return [f"`{name}`", key.kind.si_unit if key.kind else "", what, key.default, key.meaning]


def of_tables(kind: str, root: dict[str, Key], tables: dict[str, dict[str, Key] | None], table: Table) -> str:
    text = f"### {kind}: {ROOT_TABLE}\n\n" + table(HEAD, ALIGN, [[f"`{name}`", "", "text", key.default, key.meaning] for name, key in root.items()])
    units: dict[tuple[str, ...], list[str]] = {}
    for name, keys in tables.items():
        if keys is not None:
            text += f"\n### {kind}: [{name}]\n\n" + table(HEAD, ALIGN, [_key_row(*item) for item in keys.items()])
            for key, told in keys.items():
                if told.kind and told.kind.units:
                    units.setdefault(tuple(told.kind.units), []).append(f"`{key}`")
    rows = [[", ".join(dict.fromkeys(keys)), ", ".join(f"`{unit}`" for unit in names)] for names, keys in units.items()]
    return text + f"\n### {kind}: units\n\n" + table("keys, units", "ll", rows) + "\n"


# ---- scenario files --------------------------------------------------------------------------------------------------------
def asked() -> dict[str, list[Asked]]:
    """What the loader asks for, by table: "event", "expect fault"."""
    found: dict[tuple[str, str], Asked] = {}
    for path in EXAMPLES:
        document = Document(path)
        scenario_file.read(document)
        found |= {name: item for name, item in document.asked.items() if name not in found and name[0] != "plant"}
    kinds = list(scenario_file.EVENT_KINDS)
    result: dict[str, list[Asked]] = {}
    for (table, key), item in sorted(found.items(), key=lambda entry: kinds.index(entry[0][1]) if entry[0][0] == "event" and entry[0][1] in kinds else -1):
        if not item.meaning:
            raise UserError(f"'{key}' of [{table}] has no meaning", item.section.where(key), "add it where the loader asks for the key")
        result.setdefault(table, []).append(item)
    return result


def span(low: float, high: float, text: Callable[[float], str] = "{:g}".format) -> str:
    if -low == high == math.inf:
        return "number"
    return f"from {text(low)}" if high == math.inf else f"to {text(high)}" if low == -math.inf else f"{text(low)} .. {text(high)}"


def _asked_row(item: Asked) -> list[str]:
    def text(value: float) -> str:
        """A limit is named where it is another key's value."""
        named = {data[key]: key for data, key in ((item.section.document.data, "duration_s"), (item.section.data, "after_s")) if data.get(key)}
        return named.get(value) or f"{value:g}"

    what = item.what
    if item.options:
        what = "see below" if len(item.options) > 8 else ", ".join(f"`{option}`" for option in item.options)
    elif what in ("number", "whole number") and (item.low, item.high) != (-math.inf, math.inf):
        what = span(item.low, item.high, text)
    unit = next((unit for suffix, unit in UNITS.items() if item.what == "number" and f"_{item.key}".endswith(suffix)), "")
    default = item.default
    if item.section.path[:1] == ("event",) and item.key in scenario_file.EVENT_KINDS:
        default = "one of these"
    elif default is REQUIRED:
        default = "must be given"
    elif isinstance(default, bool):
        default = str(default).lower()
    elif isinstance(default, float):
        default = text(default)
    return [f"`{item.key}`", unit, what, str(default or ("0" if default == 0 else "")), item.meaning]


def of_scenarios(table: Table) -> str:
    found = asked()
    text = ""
    for name in ("", "firmware", "start", "event", "fault", "measure", "expect"):
        head = f"[[{name}]], any number" if name in ("event", "measure", "expect") else f"[{name}]" if name else ROOT_TABLE
        text += f"### scenario: {head}\n\n" + table(HEAD, ALIGN, [_asked_row(item) for item in found.pop(name)]) + "\n"
    rows = []
    for name, kind in expect.KINDS.items():
        rows += [[f"**`{name}`**", "", "", "", kind.meaning], *(_asked_row(item) for item in found.pop(f"expect {name}", []))]
    if found:
        raise UserError(f"no heading for [{next(iter(found))}]", "tools/docs/file_keys.py", "give the table a place")
    text += "### scenario: kinds of [[expect]]\n\n" + table("kind and keys, unit, range, default, meaning", ALIGN, rows)
    columns = [[f"`{name}`", told] for name, told in metrics.MEASURE_VALUES.items()]
    return text + "\nColumns of a row (`value`):\n\n" + table("value, meaning", "ll", columns) + "\n"


# ---- the virtual board -----------------------------------------------------------------------------------------------------
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


def page(table: Table) -> str:
    """All generated parts of docs/files.md; `table` writes one in Markdown."""
    text = "## Motor file\n\n" + of_tables("motor", motor_file.ROOT, motor_file.TABLES, table)
    text += "## Board file\n\n" + of_tables("board", {"title": motor_file.ROOT["title"]}, board_file.TABLES, table)
    text += "## Scenario file\n\n" + of_scenarios(table)
    writable, readable = ([[f"`{row[0]}`", *row[1:]] for row in plant_keys() if bool(row[2]) == whether] for whether in (True, False))
    text += "## Keys of the virtual board\n\n### Keys that can be set\n\n" + table(HEAD, ALIGN, writable)
    return text + "\n### Keys that can only be read\n\n" + table("key, unit, meaning", "lll", [[row[0], row[1], row[4]] for row in readable])
