"""`identify-range`: motors over the whole range, from identify_range.toml, on boards that fit them: measured over true, or how it ends."""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.bench import report
from tools.common import board_file, board_keys, motor_file, output, paths, units
from tools.common.board_file import BoardFile
from tools.common.motor_file import Motor
from tools.common.toml_file import Document, Section

from . import board as board_command
from . import identify
from .identify_result import Identified

TABLE = paths.ROOT / "tuning" / "identify_range.toml"
RESULTS = identify.RESULTS / "range"
BOUNDS = {"ohm": (1e-3, 40.0), "uh": (1.0, 60000.0), "kphi": (0.2, 2000.0), "inertia": (1e-8, 10.0), "coulomb": (0.0, 10.0), "viscous": (0.0, 1.0),
          "current": (0.05, 20.0), "speed": (50.0, 30000.0)}
LEAST_OHM, LEAST_UH = 0.01, 10.0
"""Of a motor file; what is less goes straight to the virtual board."""
COLUMNS = (("result", "ends\nwith", "{}"), ("motor_s", "time\ns", "{:.0f}"), ("R", "%\nR", "{:+.1f}"),
           *((name, f"%\n{name}", "{:+.1f}") for name in ("Ld", "Lq", "Kphi", "J")), ("half", "friction %\nat half", "{:+.1f}"), ("full", "friction %\nat full speed", "{:+.1f}"))
"""Errors of what was measured; `make readme` puts them into docs/tuning.md."""
ROWS = {"R winding": "R", "Ld": "Ld", "Lq": "Lq", "Kphi": "Kphi", "J": "J"}


@dataclass(frozen=True)
class Case:
    """A motor of the table."""

    name: str
    motor: Motor
    board: BoardFile
    changes: board_keys.Values
    ends: str
    """Result that is expected."""
    fails: tuple[str, ...]
    """Values that physics keep beyond their limit; the file says why."""


def cases() -> list[Case]:
    """The table as motors on their boards; files of both are left in build/identify/range-files."""
    root = Document(TABLE).root
    made = root.section("board")
    assert made
    boards = {name: _board(name, made.text(name)) for name in made.data}
    found = [_case(section, boards) for section in root.sections("motor")]
    root.close()
    return found


def _files() -> Path:
    folder = identify.RESULTS / "range-files"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _board(name: str, words: str) -> BoardFile:
    path = _files() / f"board_{name}.toml"
    path.write_text(board_command.written(board_command.given(words.split()), path), encoding="utf-8")
    return board_file.load(str(path))


def _case(section: Section, boards: dict[str, BoardFile]) -> Case:
    name, board = section.text("name"), boards[section.choice("board", tuple(boards))]
    pairs = section.integer("pole_pairs", minimum=1, maximum=50)
    values = {key: section.number(key, minimum=low, maximum=high) for key, (low, high) in BOUNDS.items()}
    values["uh_q"] = section.number("uh_q", values["uh"], 1.0, 60000.0)
    ends, fails = section.text("ends", "DONE"), tuple(section.texts("beyond", []))
    section.close()
    path = _files() / f"{paths.name_of(Path(name))}.toml"
    path.write_text(_text(name, pairs, values, board), encoding="utf-8")
    changes = board_keys.Values()
    for key, value, least in (("motor.rs_ohm", values["ohm"], LEAST_OHM), ("motor.ld_h", 1e-6 * values["uh"], 1e-6 * LEAST_UH),
                              ("motor.lq_h", 1e-6 * values["uh_q"], 1e-6 * LEAST_UH)):
        if value < least:
            changes.add(key, value, section.where())
    return Case(name, motor_file.load(str(path)), board, changes, ends, fails)


def _text(name: str, pairs: int, of: dict[str, float], board: BoardFile) -> str:
    """The motor file; the rating says only what somebody dares to try."""
    torque = max(1e-4, 0.00827 * of["kphi"] * of["current"])
    rotor = min(of["inertia"], torque / (of["speed"] * 0.1047)) # a heavier one is a load
    lines = [f'title = "{name}"', 'connection = "Y"', f'board = "{board.path}"', "[electrical]", _line("pole_pairs", pairs)]
    for key, value, unit in (("resistance", max(of["ohm"], LEAST_OHM), "ohm phase"), ("inductance_d", max(of["uh"], LEAST_UH), "uH phase"),
                             ("inductance_q", max(of["uh_q"], LEAST_UH), "uH phase"), ("kphi", of["kphi"], "V peak line-to-line/krpm"),
                             ("[mechanical]", 0.0, ""), ("inertia", rotor, "kg m2"), ("coulomb_friction", of["coulomb"], "N m"),
                             ("viscous_friction", of["viscous"], "N m s"), ("[rating]", 0.0, ""), ("voltage", board.nominal_bus_v, "V"),
                             ("current", of["current"], "A peak"), ("torque", torque, "N m"), ("speed", of["speed"], "rpm"),
                             ("maximum_speed", of["speed"], "rpm"), ("maximum_current", of["current"], "A peak")):
        lines.append(_line(key, value, unit) if unit else key)
    lines += ["[load]", _line("inertia", of["inertia"] - rotor, "kg m2")]
    return "\n".join([*lines, ""])


def _line(key: str, value: float, unit: str = "") -> str:
    told = f', unit = "{unit}"' if unit else ""
    return f'{key} = {{ value = {value:.10g}{told}, source = "drawn for the table" }}'


# ---- the command -----------------------------------------------------------------------------------------------------------
def measured(chosen: list[Case], quiet: bool) -> list[Identified]:
    """All of them."""
    ready = [identify.prepared(case.motor, str(case.board.path), None, None, case.changes) for case in chosen]
    return identify.identify(ready, board_keys.Values(), quiet)


def row(case: Case, item: Identified) -> dict[str, Any]:
    """A line of the table."""
    found: dict[str, Any] = {"name": case.name, "is": _facts(item), "result": item.result.name, "motor_s": item.measured.motor_s}
    for line in item.rows() if item.has_electrical else []:
        name = line["name"].split(" [")[0]
        key = ROWS.get(name, "")
        if name.startswith("friction"):
            key = "full" if "half" in found else "half"
        if key:
            found[key] = line["error_percent"]
    return found


def _facts(item: Identified) -> str:
    """What the virtual motor is."""
    of = item.values
    kphi = 3.0 ** 0.5 * of["motor.psi_vs"] * of["motor.pole_pairs"] * 1000.0 * units.RPM
    lh = [of["motor.ld_h"], of["motor.lq_h"]]
    numbers = [_engineering(of["motor.rs_ohm"], "ohm"), "/".join(dict.fromkeys(_engineering(value, "H") for value in lh)), f"{kphi:.3g} V",
               f"{of['mech.inertia_kgm2']:.2g} kg m2", _engineering(of["mech.coulomb_nm"], "N m")]
    return ", ".join(numbers)


def _engineering(value: float, unit: str) -> str:
    for factor, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "u")):
        if value >= factor:
            return f"{value / factor:.3g} {prefix}{unit}"
    return f"{value:.2g} {unit}"


def wrong(case: Case, item: Identified) -> list[str]:
    """What is not as expected, one line each."""
    if item.result.name != case.ends:
        return [f"ends with {item.result.name}, expected is {case.ends}: {item.result.cause}"]
    rows = item.rows() if item.has_electrical else []
    return [f"{line['name']} is off by {line['error_percent']:+.1f} %" for line in rows
            if (line["verdict"] == "FAIL") and not line["name"].startswith(case.fails or ("-",))]


def add_command(commands: Any) -> None:
    """Adds `identify-range` to a command line's commands."""
    parser = commands.add_parser("identify-range", help="IDENTIFY on motors over the whole range: tuning/identify_range.toml")
    parser.add_argument("--out", type=Path, help="result folder; default build/identify/range")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    every = cases()
    with output.in_turn("identify"):
        items = measured(every, options.quiet)
    rows = [row(case, item) for case, item in zip(every, items)]
    with output.ResultFolder(options.out or RESULTS) as folder:
        output.write_summary(folder.work, {"rows": rows, "tune": [item.tuner() for item in items]})
    print(report.table(rows, COLUMNS))
    lines = [f"{case.name}: {text}" for case, item in zip(every, items) for text in wrong(case, item)]
    for line in lines:
        print(f"foc33: {line}", file=sys.stderr)
    return 1 if lines else 0
