"""Steps that all running commands share: which library and plant, the verdict."""

import argparse
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tools.common import board_file, board_keys, motor_file, paths
from . import build
from .board import Library
from tools.common.errors import UserError
from .expect import Outcome


HEADER_VALUES = (("NOPOLESPAIRS", "pairs"), ("MOTOR_RS_OHM", "ohm"), ("MOTOR_LS_MH", "mH"), ("MOTOR_KPHI_V_PER_KRPM", "V peak/krpm"))
SAME_MOTOR = 0.01
"""Header and motor file belong together if their values agree to this."""


def library_for(defines: list[str], given: Path | None, userparams: str | Path | None = None) -> Library:
    """The board with the firmware that the defines ask for, built with the userparams.h in the folder `userparams`."""
    if given is not None and not given.is_file():
        raise UserError(f"no library '{given}'", "--library", "check the path")
    if given is not None and userparams is not None:
        raise UserError("a library has its header already", "--userparams", "leave out --library or --userparams")
    if given is not None:
        return Library(given)
    return Library(build.library(defines, None if userparams is None else build.header_folder(userparams)))


def header_name(given: Path | None, userparams: str | Path | None) -> str:
    """The header of a run as a person would name it."""
    if given is not None:
        return f"the one in {paths.shown(given)}"
    folder = None if userparams is None else build.header_folder(userparams)
    return build.HEADER if folder is None else str(paths.shown(folder / build.HEADER))


def tuned_header(motor: Path) -> Path:
    """The folder with the header that the tuner has written for a motor file."""
    folder = paths.TUNED / motor.stem
    if not (folder / build.HEADER).is_file():
        known = motor.parent.resolve() == paths.MOTORS.resolve()
        name = motor.stem if known else motor
        raise UserError(f"no {build.HEADER} for motor '{motor.stem}'", str(paths.shown(folder)), f"make it with make tune MOTOR={name}")
    return folder


def header_for(options: argparse.Namespace) -> str | Path | None:
    """The folder of the header that was asked for; that of a named motor is the tuner's."""
    if options.userparams is None and options.library is None and options.motor:
        return tuned_header(motor_file.part(options.motor, "--motor").path)
    return options.userparams


def results(name: str, motor: board_keys.Part, own: str, given: Path | None) -> Path:
    """The folder of a table's results: NAME for the table's own motor, NAME-MOTOR for another one, or the one that was asked for."""
    return given or paths.RESULTS / (name if motor.path.stem == own else f"{name}-{motor.path.stem}")


def set_up(item: Any, options: argparse.Namespace, defines: list[str], userparams: str | Path | None) \
        -> tuple[board_keys.Part, board_keys.Part, Library, dict[str, Any]]:
    """Motor and board, the firmware, and what the report tells of them (used())."""
    motor, board = parts_of(item, options)
    library = library_for(defines, options.library, userparams)
    told = used(motor, library, header_name(options.library, userparams)) | {"board": str(paths.shown(board.path))}
    return motor, board, library, told


def used(motor: board_keys.Part, library: Library, header: str) -> dict[str, Any]:
    """Which motor and which header a run used, for the report; "note" says if they are not for the same motor."""
    return {"motor": str(paths.shown(motor.path)), "motor_title": motor.title, "header": header,
            "note": header_note(motor.values.values, library.params)}


def header_note(values: Mapping[str, Any], params: Mapping[str, float]) -> str:
    """Where a header is for another motor than the plant's; "" where it is for this one."""
    try:
        pairs, flux = values["motor.pole_pairs"], values["motor.psi_vs"]
        plain = {"NOPOLESPAIRS": (pairs, pairs), "MOTOR_RS_OHM": (values["motor.rs_ohm"],) * 2,
                 "MOTOR_LS_MH": (1e3 * min(values["motor.ld_h"], values["motor.lq_h"]),
                                 1e3 * max(values["motor.ld_h"], values["motor.lq_h"])),
                 "MOTOR_KPHI_V_PER_KRPM": (flux * pairs * 3.0 ** 0.5 * 1000.0 * math.pi / 30.0,) * 2}
    except (KeyError, TypeError):
        return ""
    differ = []
    for name, unit in HEADER_VALUES:
        low, high = plain[name]
        if name in params and not (1.0 - SAME_MOTOR) * low <= params[name] <= (1.0 + SAME_MOTOR) * high:
            differ.append(f"{name} is {params[name]:.4g} {unit}, the motor's is {(low + high) / 2.0:.4g}")
    return f"the header is for another motor: {'; '.join(differ)}" if differ else ""


def changes(texts: list[str]) -> board_keys.Values:
    """Plant changes written as KEY=NUMBER or KEY=xFACTOR."""
    result = board_keys.Values()
    for text in texts:
        key, sign, value = text.partition("=")
        factor = value.startswith("x")
        try:
            number = float(value[1:] if factor else value)
        except ValueError:
            raise UserError(f"'{text}' is no change", "--set", "write KEY=NUMBER or KEY=xFACTOR") from None
        if not sign:
            raise UserError(f"'{text}' is no change", "--set", "write KEY=NUMBER or KEY=xFACTOR")
        result.values[key] = ("factor", number) if factor else number
        result.where[key] = "--set"
    return result


def parts_of(item: Any, options: argparse.Namespace) -> tuple[board_keys.Part, board_keys.Part]:
    """Motor and board: from the command line, else from the scenario or table. A motor of the command line brings its file's board."""
    motor = motor_file.part(options.motor, "--motor") if options.motor else motor_file.part(item.motor, item.motor_where)
    return motor, board_of(motor, item, options.board, bool(options.motor))


def board_of(motor: Any, item: Any, chosen: str | None, motors_first: bool) -> board_keys.Part:
    """The chosen board, else the one of the scenario or table, else the one that the motor file names; `motors_first` swaps these two."""
    if chosen or motors_first and motor.board:
        return board_file.part(*board_file.named(motor, chosen))
    return board_file.part(*board_file.named(motor, item.board, item.board_where))


def verdict(name: str, outcomes: list[Outcome]) -> int:
    """Says how many expectations hold, names the others on stderr, and returns the exit code."""
    failed = [outcome for outcome in outcomes if not outcome.ok]
    print(f"{len(outcomes) - len(failed)} of {len(outcomes)} expectations hold", flush=True)
    for outcome in failed:
        print(f"foc33: {name}: {outcome.row}: got {outcome.got}, allowed {outcome.allowed}", file=sys.stderr)
    return 1 if failed else 0
