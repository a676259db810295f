"""Writes tuning/tuning_params.xlsx: the note's spreadsheet with live formulas, for people who tune a motor in one."""

import argparse
import functools
from pathlib import Path
from typing import Any

from tools.common import board_file, motor_file, paths
from tools.common.errors import UserError

FILE = paths.ROOT / "tuning" / "tuning_params.xlsx"
DEFAULT_MOTOR = "hurst_dmb0224c10002"
DEFAULT_BOARD = "mclv"
ORDER = ("Read me", "Motor", "Parameters", "Loops", "Start", "Field weakening", "Constants", "Paste", "Search", "Bode", "Motors", "Boards", "Units")


def add_command(commands: Any) -> None:
    """`python3 -m tuning spreadsheet`"""
    command = commands.add_parser("spreadsheet", help="write tuning/tuning_params.xlsx anew")
    command.add_argument("--out", type=Path, default=FILE, help="the file; default tuning/tuning_params.xlsx")
    command.set_defaults(command=_command)


def _command(options: argparse.Namespace) -> int:
    write(options.out)
    print(f"wrote {paths.shown(options.out)}")
    return 0


def write(path: Path) -> None:
    """Builds the workbook from the motor and board files and writes it; the same files give the same bytes."""
    try:
        import openpyxl  # noqa: F401
    except ImportError:
        raise UserError("Python's openpyxl is missing", "python3 -m tuning spreadsheet",
                        "install it (Debian package: python3-openpyxl; or pip install openpyxl)") from None
    from .sheets import constants, data, loops, motor, parameters, paste, readme, search, start, weakening
    from .sheets.book import Book

    book = Book()
    data.units_page(book)
    motors = data.DataPage(book, "Motors", {name: file | _from_the_command(name) for name, file in motor.motors().items()},
                           "tuning/motors/*.toml side by side, and below what make tune found by trying (command.*, tables.*).", "motor_column",
                           data.OWN)
    boards = data.DataPage(book, "Boards", motor.boards(), "tuning/boards/*.toml side by side.", "board_column")
    motor.motor_page(book, motors, boards, DEFAULT_MOTOR)
    parameters.parameters_page(book, motors)
    margins = loops.bode_page(book)
    loops.loops_page(book, motors, margins)
    start.start_page(book, motors, boards)
    weakening.weakening_page(book, motors)
    constants.constants_page(book)
    search.search_page(book)
    paste.paste_page(book)
    readme.readme_page(book)
    book.arrange(ORDER, "Motor")
    book.save(path)


@functools.cache
def _from_the_command(name: str) -> dict[tuple[str, str], Any]:
    """What the command finds by trying and no formula can: bandwidths, trial of the start, tables tuned by the machine."""
    from . import fw_tables, start
    from .design import design

    d = design(motor_file.load(name), board_file.load(DEFAULT_BOARD))
    assert d.current_loop and d.speed_loop and d.start_up
    m, s = d.motor, d.start_up
    inertia = m.inertia_kgm2 + m.load_inertia_kgm2
    omega = start.natural_rad_s(m, s.current_a, inertia)
    found: dict[str, Any] = {
        "CURRENT_BANDWIDTH_HZ": d.current_loop.bandwidth_hz, "SPEED_BANDWIDTH_HZ": d.speed_loop.bandwidth_hz,
        "current_worst_deg": round(d.current_loop.worst.phase_deg, 2), "speed_worst_deg": round(d.speed_loop.worst.phase_deg, 2),
        "lock_factor": round(s.lock_s / start.lock_by_rule_s(omega), 6), "rate_factor": s.rate / start.ramp_rate(m, d.board, s.current_a, s.end_speed_rpm, inertia)}
    result = {(f"command.{key}", "value"): value for key, value in found.items()}
    if d.tuned_by_machine:
        tables = fw_tables.load(fw_tables.path_of(name))
        result["tables.start_speed_rpm", "value"] = tables.start_speed_rpm
        result |= {(f"tables.{key}", "value"): value for key, value in tables.fingerprint.items()}
        for key, text in tables.parameters().items():
            if key != "FW_START_SPEED_RPM":
                result[f"tables.{key}", "value"] = text if text.startswith("NORM") else float(text)
    return result
