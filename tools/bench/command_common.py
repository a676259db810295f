"""Steps that all running commands share: which library and plant, the verdict."""

import argparse
import math
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tools.common import board_file, board_keys, motor_file, paths
from tools.common.errors import UserError, suggestion
from tools.common.param_rows import FROM_DEFINES, modes, parameters
from . import build, scenario_file
from .board import Library
from .expect import Outcome
from .scenario import Scenario


HEADER_VALUES = (("NOPOLESPAIRS", "pairs"), ("MOTOR_RS_OHM", "ohm"), ("MOTOR_LS_MH", "mH"), ("MOTOR_KPHI_V_PER_KRPM", "V peak/krpm"))
SAME_MOTOR = 0.01
"""Header and motor file belong together if their values agree to this."""


def add_options(parser: argparse.ArgumentParser, folder: str, own: str = "; without --motor the project's own", without: tuple[str, ...] = ()) -> None:
    """The options of all running commands, but for those that one of them has not. `folder`: of its results; `own`: what its default header may be."""
    for name, more in (
            ("board", {"help": "board file instead of the motor's or the scenario's: a name in tuning/boards or a path"}),
            ("userparams", {"metavar": "FOLDER", "help": "build with the userparams.h in this folder; default: build/tune/NAME, "
                                                       f"written by make tune MOTOR=NAME{own}"}),
            ("motor", {"help": "motor file instead of the scenario's: a name in tuning/motors or a path"}),
            ("library", {"type": Path, "help": "a libvboard.so to use instead of building one"}),
            ("out", {"type": Path, "help": f"result folder, replaced when the run is complete; default build/run/{folder}, with the names "
                                           "of another motor, board or header"}),
            ("quiet", {"action": "store_true", "help": "no progress bar"})):
        if name not in without:
            parser.add_argument(f"--{name}", **more)


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


def tuned_header(motor: Path, board: Path | None) -> Path:
    """The folder with the header that the tuner has written for a motor file, on the board that was asked for."""
    folder = paths.TUNED / paths.pair_name(motor, board)
    if not (folder / build.HEADER).is_file():
        known = motor.parent.resolve() == paths.MOTORS.resolve()
        words = {"MOTOR": motor.stem if known else motor} | ({"BOARD": board} if board else {})
        raise UserError(f"no {build.HEADER} for motor '{motor.stem}'", str(paths.shown(folder)),
                        "make it with make tune " + " ".join(shlex.quote(f"{name}={word}") for name, word in words.items()))
    return folder


def header_for(options: argparse.Namespace) -> str | Path | None:
    """The folder of the header that was asked for; that of a named motor is the tuner's."""
    if options.userparams is None and getattr(options, "library", None) is None and options.motor:
        return tuned_header(paths.find("motor", options.motor, paths.MOTORS, "--motor"), board_asked_for(options))
    return options.userparams


def scenario_for(options: argparse.Namespace) -> tuple[Scenario, list[str]]:
    """The scenario that was asked for, or else the one for the mode that was, or else the usual one; and the macros that it does not have itself."""
    defines = macros(options.defines)
    asked = {define.partition("=")[0] for define in defines} & set(modes()) - {"PARAMS_IN_RAM", "SELFTEST_OFF"}
    name = options.scenario
    if name is None and asked:
        fitting = [item for item in map(scenario_file.load, paths.names(paths.SCENARIOS)) if set(item.defines) == asked]
        if not fitting:
            raise UserError(f"no scenario is for {' with '.join(sorted(asked))}", "DEFINES",
                            next((f"make {mode.lower()} runs {mode}" for mode in ("IDENTIFY", "BRINGUP") if mode in asked), "name the one to run, SCENARIO=name"))
        name = next((item.name for item in fitting if item.name.upper() in asked), fitting[0].name)
    item = scenario_file.load(name or usual(getattr(options, "app", ""), options.motor))
    more = [define for define in defines if define not in item.defines]
    if getattr(options, "app", ""):
        more.append(build.app(options.app, "APP"))
        item.defines = [define for define in item.defines if not define.startswith(build.APP)]
    item.defines += more
    return item, more


def usual(app: str, motor: str | None = None) -> str:
    """The scenario where none is named: an application of the project has its own, and one for any application presses, turns and waits."""
    if app and app != "panel":
        own = f"app_{app}"
        return own if own in paths.names(paths.SCENARIOS) else "app_any"
    return "rated" if motor else "demo"


def macros(text: str) -> list[str]:
    """NAME or NAME=value of each -DNAME and -DNAME=value."""
    result = []
    for word in text.split():
        name, sign, value = word.removeprefix("-D").partition("=")
        if not word.startswith("-D") or not name.isidentifier() or (name in modes() and sign and value != "1"):
            raise UserError(f"no mode '{word}'", "DEFINES", f"use {' '.join(f'-D{mode}' for mode in modes())} or -DNAME=value")
        if name not in modes() and not sign:
            raise UserError(f"no mode '{name}'", "DEFINES", suggestion(name, modes()))
        if name in parameters() and name not in FROM_DEFINES:
            raise UserError(f"{name} is a parameter", "DEFINES", "set it in userparams.h, or name a folder with another one, USERPARAMS=folder")
        result.append(name if name in modes() else f"{name}={value}")
    return result


def board_asked_for(options: argparse.Namespace) -> Path | None:
    """The board file of --board, if there is one."""
    return paths.find("board", options.board, paths.BOARDS, "--board") if options.board else None


def results(name: str, own: str, options: argparse.Namespace, defines: Sequence[str] = ()) -> Path:
    """The folder of a run's results: the one that was asked for, else NAME; with another motor than its own, another board, header or
    firmware its name tells them, so that two that run at once have each their own."""
    if options.out is not None:
        return options.out
    motor, board = options.motor and paths.find("motor", options.motor, paths.MOTORS, "--motor"), board_asked_for(options)
    header, library = options.userparams and build.header_folder(options.userparams), getattr(options, "library", None)
    firmware = library.parent.name.removeprefix("host").strip("-") if library else build.variant_name(list(defines), header)
    parts = [name, paths.name_of(motor, paths.MOTORS) if motor and motor.resolve() != paths.find("motor", own, paths.MOTORS).resolve() else "",
             paths.name_of(board, paths.BOARDS) if board else "", firmware]
    return paths.RESULTS / "-".join(part for part in parts if part)


def set_up(item: Any, options: argparse.Namespace, defines: list[str]) -> tuple[board_keys.Part, board_keys.Part, Library, dict[str, Any]]:
    """Motor and board, the firmware, and what the report tells of them (used())."""
    motor, board = parts_of(item, options)
    userparams = header_for(options)
    library = library_for(defines, options.library, userparams)
    if options.board:
        _refuse_other_period(board_file.load(options.board, "--board"), library)
    told = used(motor, library, header_name(options.library, userparams)) | {"board": str(paths.shown(board.path)), "app": build.app_shown(defines)}
    return motor, board, library, told


def _refuse_other_period(board: board_file.BoardFile, library: Library) -> None:
    """The PWM of the run is the header's: with a board of another period it would not be the run that was asked for."""
    period_s = library.params["LOOPTIME_SEC"]
    if abs(period_s / board.pwm_period_s - 1.0) > 1e-3:
        raise UserError(f"the header's LOOPTIME_SEC is {period_s * 1e6:g} us, the board's period {board.pwm_period_s * 1e6:g} us", str(paths.shown(board.path)),
                        "add MOTOR=name, which brings a header for this board, or install one with make userparams")


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
