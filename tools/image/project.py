"""Brings the MPLAB X project firmware.X up to what the Makefile says of files, flags and folders (make project), so that it cannot drift.

    make project-facts | python3 -m tools.image.project [--out firmware.X]

The project has the three files that MPLAB X keeps under version control, of which only nbproject/configurations.xml depends on these facts,
and image.c: the firmware's sources as one unit, as make firmware compiles them."""

import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

from tools.common import command_line, paths
from tools.common.errors import UserError

CONFIGURATIONS = "nbproject/configurations.xml"
#: flags that MPLAB X has a box for: it passes them itself
BOXES = {
    "-g": ("enable-symbols", "true"), "-Wall": ("enable-all-warnings", "true"), "-ffunction-sections": ("isolate-each-function", "true"),
    "-O0": ("optimization-level", "0"), "-O1": ("optimization-level", "1"), "-O2": ("optimization-level", "2"),
    "-O3": ("optimization-level", "3"),
}
#: MPLAB X builds in the order of the project and stops at the first file with an error: these say what is wrong with userparams.h
FIRST_FOLDER = "(first) userparams.h"
UNIT = "image.c"
UNIT_SAYS = "/* Every source of the firmware as one unit, as make firmware compiles them (-fwhole-program); written by make project. */"
LINKER_BOXES = {"--gc-sections": ("remove-unused-sections", "true"), "--report-mem": ("report-memory-usage", "true")}


def read(lines: Iterable[str]) -> dict[str, list[str]]:
    """Facts by kind: what is compiled first and by itself, what is in the unit, headers, flags, folders, device."""
    facts: dict[str, list[str]] = {"first": [], "unit": [], "app": [], "header": [], "flag": [], "include": [], "link": [], "device": []}
    for line in lines:
        kind, _, value = line.strip().partition(" ")
        if kind not in facts or not value:
            raise UserError(f"not a fact of the project: '{line.strip()[:60]}'", "make project", "this is what make project-facts prints")
        facts[kind].append(value)
    if len(facts["device"]) != 1 or not facts["unit"]:
        raise UserError("no device or no sources", "make project", "this is what make project-facts prints")
    return facts


def above(path: str) -> str:
    """The same path, seen from the project's folder."""
    return ".." if path in (".", "./") else f"../{path}"


def updated(text: str, facts: dict[str, list[str]]) -> str:
    """configurations.xml with these files, flags, folders and device; all else as it is."""
    root = ET.fromstring(text)
    root.find(".//targetDevice").text = f"dsPIC{facts['device'][0]}"
    _fill(root.find(".//logicalFolder[@name='HeaderFiles']"), {file: "/".join(Path(file).parent.parts[1:]) for file in sorted(facts["header"])})
    compiled = root.find(".//logicalFolder[@name='SourceFiles']")
    _fill(compiled, {file: FIRST_FOLDER for file in facts["first"]} | {file: "app" for file in facts["app"]})
    ET.SubElement(compiled, "itemPath").text = UNIT
    _set(root.find(".//C30"), BOXES, facts["flag"], {"extra-include-directories": ";".join(above(path) for path in facts["include"])})
    _set(root.find(".//C30-LD"), LINKER_BOXES, facts["link"], {})
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def unit(facts: dict[str, list[str]]) -> str:
    """What image.c is."""
    return "\n".join([UNIT_SAYS, *(f'#include "{file}"' for file in facts["unit"]), ""])


def _fill(folder: ET.Element, inside: dict[str, str]) -> None:
    """MPLAB X's folder of files, each in a folder inside."""
    folder[:] = []
    for number, group in enumerate(sorted(set(inside.values()), key=lambda name: (not name, name)), 1):
        into = ET.SubElement(folder, "logicalFolder", name=f"f{number}", displayName=group, projectFiles="true") if group else folder
        for file, its_group in inside.items():
            if its_group == group:
                ET.SubElement(into, "itemPath").text = above(file)


def _set(tool: ET.Element, known: dict[str, tuple[str, str]], flags: list[str], more: dict[str, str]) -> None:
    """A tool's boxes, and as additional options what has no box."""
    ours = {key for key, _ in known.values()}
    kept = {box.get("key"): box.get("value") for box in tool.iter("property") if box.get("key") not in ours}
    tool[:] = [ET.Element("property", key=key, value=value)
               for key, value in sorted({**kept, **more, **dict(known[flag] for flag in flags if flag in known)}.items())]
    if rest := [flag for flag in flags if flag not in known]:
        ET.SubElement(tool, "appendMe", value=" ".join(rest))


def main(arguments: list[str] | None = None) -> int:
    parser = command_line.Parser(prog="python3 -m tools.image.project", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=paths.ROOT / "firmware.X", help="the project's folder (firmware.X)")
    return command_line.run(lambda: _write(parser.parse_args(arguments).out / CONFIGURATIONS))


def _write(path: Path) -> int:
    facts = read(sys.stdin)
    try:
        path.write_text(updated(path.read_text(encoding="utf-8"), facts), encoding="utf-8")
        (path.parents[1] / UNIT).write_text(unit(facts), encoding="utf-8")
    except OSError as error:
        raise UserError(f"cannot write the project ({error.strerror})", str(path), "check the folder's permissions") from None
    except (ET.ParseError, AttributeError) as error:
        raise UserError(f"not a configuration of MPLAB X ({error})", str(path), "take the committed one: git checkout firmware.X") from None
    print(f"{path.parents[1].name}: {CONFIGURATIONS}, {UNIT}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
