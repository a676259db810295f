"""`rated`: every motor with its tuned header at parts of its rated speed under load, and how fast it gets without. What is asked and what
must hold is in tools/bench/scenarios/tables/rated.toml."""

import argparse
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tools.common import command_line, motor_file, paths
from tools.common.board_keys import Part
from tools.common.errors import UserError
from tools.common.motor_file import Motor
from tools.common.progress import Progress
from . import case, command_common, report, simulate, sweep
from .board import Library
from .expect import Outcome
from .sweep import within

Ready = tuple[Motor, Part, Path]
"""A motor, its board and the folder of its header."""


@dataclass(kw_only=True)
class Table(sweep.Loaded, sweep.AnyMotorTable):
    """tables/rated.toml."""

    speeds_percent: list[float] = within(1.0, 1000.0)
    torque_percent: float = within(0.0, 1000.0)
    within_s: float = within(0.01, 60.0)
    error_percent: float = within(0.0)
    angle_error_deg: float = within(0.0)
    current_percent: float = within(0.0)


@dataclass(frozen=True)
class Candidate:
    """A motor with the firmware that was built for it."""

    motor: Motor
    part: Part
    board: Part
    header: str
    library: Library

    @property
    def params(self) -> dict[str, float]:
        return self.library.params


@dataclass(frozen=True)
class Row:
    """What one row asks of a motor."""

    name: str
    rpm: float
    torque_nm: float


@dataclass
class Rated(sweep.Sweep):
    """The sweep, of several motors. A case is a motor and what a row asks of it."""

    ready: list[Ready] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    """motors that cannot run, with the reason"""
    candidates: list[Candidate] = field(default_factory=list)

    name, about, kind_of_table = "rated", "every motor with its tuned header at 20, 50 and 100 %% of its rated speed under load", Table
    columns = (
        ("torque_nm_set", "brake\nN m", "{:.4f}"), ("reference_rpm", "reference\nrpm", "{:.0f}"), ("speed_rpm", "true\nrpm", "{:.1f}"),
        ("speed_error_percent", "error\n%", "{:+.2f}"), ("current_rms_a", "phase I\nA rms", "{:.3f}"),
        ("current_of_maximum_percent", "of max\n%", "{:.0f}"), ("angle_error_mean_deg", "angle err\nmean deg", "{:+.1f}"),
        ("angle_error_rms_deg", "angle err\nrms deg", "{:.1f}"), ("voltage_percent", "voltage\n% of limit", "{:.0f}"),
        ("closed_after_s", "closed\nafter s", "{:.2f}"), ("verdict", "\nverdict", "{}"))
    keys = ("motor", "row", "torque_nm_set", "reference_rpm", "speed_rpm", "speed_error_percent", "current_rms_a",
            "current_of_maximum_percent", "angle_error_mean_deg", "angle_error_rms_deg", "voltage_percent", "closed_after_s", "highest_rpm",
            "fault", "verdict")

    @classmethod
    def add_command(cls, commands: Any) -> argparse.ArgumentParser:
        parser = commands.add_parser(cls.name, help=cls.about)
        parser.add_argument("--motor", nargs="+", metavar="NAME", help="these motors only: names in tuning/motors or paths")
        command_common.add_options(parser, cls.name, "", ("motor", "library"))
        parser.set_defaults(command=cls.command)
        return parser

    @classmethod
    def command(cls, options: argparse.Namespace) -> int:
        """A motor without a header does not stop the others."""
        table = cls.read(options)
        names = paths.names(paths.MOTORS) if options.motor is None else options.motor
        if options.userparams is not None and len(names) != 1:
            raise UserError("one header for several motors", "--userparams", "name one motor with --motor")
        refused: dict[str, str] = getattr(options, "refused", {})
        ready, code = command_line.each(names, lambda name: _with_header(name, options, table))
        if not ready and not refused:
            return code
        target = options.out or results("rated", names[0] if len(names) == 1 else None, command_common.board_asked_for(options))
        outcomes = [Outcome(name, False, why, "a motor that its board can turn") for name, why in refused.items()]
        return max(code, cls(table, quiet=options.quiet, outcomes=outcomes, ready=ready, refused=refused).finish(target))

    def cases(self) -> list[tuple[Candidate, Row]]:
        self.candidates = built(self.ready, self.quiet)
        return [(item, row) for item in self.candidates for row in self.rows_of(item)]

    def rows_of(self, item: Candidate) -> list[Row]:
        """The rows of one motor: loaded at each speed, then as fast as the header allows."""
        motor, torque_nm = item.motor, self.table.torque_percent / 100.0 * item.motor.rated_torque_nm
        rows = [Row(f"{percent:g} %", percent / 100.0 * motor.rated_speed_rpm, torque_nm) for percent in self.table.speeds_percent]
        return [*rows, Row("maximum", item.params["MAXIMUM_SPEED_RPM"], 0.0)]

    def job(self, item: tuple[Candidate, Row]) -> simulate.Job:
        candidate, row = item
        asked = f"{candidate.motor.name}: {row.name} ({row.rpm:g} rpm)"
        events, settled_s = case.loaded_run(candidate.params, row.rpm, self.table, asked, row.torque_nm)
        scenario = case.scenario(asked, self.table.title, events, row.rpm, settled_s, settled_s + self.table.measure_s)
        return simulate.prepare(scenario, candidate.library, candidate.part, candidate.board)

    def row(self, item: tuple[Candidate, Row], job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        row = item[1]
        return {"motor": item[0].motor.name, "row": row.name, "name": f"  {row.name}", "reference_rpm": row.rpm, "torque_nm_set": row.torque_nm,
                **result}

    def verdict(self, item: Any, row: dict[str, Any]) -> str:
        table, closed, speed = self.table, row["closed_after_s"], case.speed_verdict(row, self.table.error_percent)
        if row["fault"]:
            return f"fault {row['fault']}"
        if closed is None:
            return "never in closed loop"
        if closed > table.within_s:
            return f"closed loop after {closed:.2f} s"
        if speed:
            return speed
        if row["angle_error_rms_deg"] is None or row["angle_error_rms_deg"] > table.angle_error_deg:
            return "angle"
        return "current" if row["current_of_maximum_percent"] > table.current_percent else "ok"

    def check(self, item: Any, row: dict[str, Any]) -> list[Outcome]:
        numbers = [f"{text} {row[key]:{form}} {unit}" for text, key, form, unit in
                   (("error", "speed_error_percent", "+.2f", "%"), ("angle error", "angle_error_rms_deg", ".1f", "deg"),
                    ("current", "current_of_maximum_percent", ".0f", "% of its maximum")) if row[key] is not None]
        allowed = f"no fault, closed loop within {self.table.within_s:g} s, error {self.table.error_percent:g} %, angle error " \
                  f"{self.table.angle_error_deg:g} deg, current {self.table.current_percent:g} %"
        return [Outcome(f"{row['motor']} at {row['row']}", row["verdict"] == "ok", ", ".join([row["verdict"], *numbers]), allowed)]

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        from . import plots
        return {"plots": plots.write_rated(rows, vars(self.table), folder)}

    def head(self) -> dict[str, Any]:
        motors = [command_common.used(item.part, item.library, item.header)
                  | {"name": item.motor.name, "board": str(paths.shown(item.board.path)), "rated_speed_rpm": item.motor.rated_speed_rpm,
                     "rated_torque_nm": item.motor.rated_torque_nm} for item in self.candidates]
        return {"title": self.table.title, "motors": motors, "refused": self.refused}

    def told(self, rows: list[dict[str, Any]]) -> str:
        """A heading for each motor, then its rows; last a line for each motor that cannot run, with its reason."""
        lines = report.table(rows, self.columns).splitlines()
        parts = [f"{self.table.title}: {self.table.torque_percent:g} % of the rated torque", "", *lines[:3]]
        per_motor = len(rows) // max(len(self.candidates), 1)
        for number, item in enumerate(self.candidates):
            part = slice(number * per_motor, (number + 1) * per_motor)
            rating = f"{item.motor.rated_speed_rpm:g} rpm, {item.motor.rated_torque_nm:.3g} N m, board {item.board.path.stem}"
            parts += [f"{item.motor.name} ({rating}), {item.header}: {highest_text(rows[part])}", *lines[3:][part]]
            note = command_common.header_note(item.part.values.values, item.params)
            parts += [f"  note: {note}"] if note else []
        return "\n".join([*parts, *(f"{name}: not run: {why}" for name, why in self.refused.items())])


def results(name: str, motor: str | None, board: Path | None) -> Path:
    """The folder of the results; its name tells the motor, if it is one, and the board that was asked for."""
    parts = [name, motor and paths.name_of(paths.find("motor", motor, paths.MOTORS, "--motor"), paths.MOTORS), board and paths.name_of(board, paths.BOARDS)]
    return paths.RESULTS / "-".join(part for part in parts if part)


def _with_header(name: str, options: argparse.Namespace, table: Table) -> Ready:
    """Files are looked at before anything is built."""
    motor = motor_file.load(name, "--motor")
    board = command_common.board_of(motor, table, options.board, True)
    return motor, board, Path(options.userparams) if options.userparams else command_common.tuned_header(motor.path, command_common.board_asked_for(options))


def built(ready: list[Ready], quiet: bool) -> list[Candidate]:
    """Every motor's firmware."""
    result = []
    with Progress("firmware", len(ready), quiet, "headers built") as progress:
        for motor, board, header in ready:
            library = command_common.library_for([], None, header)
            result.append(Candidate(motor, motor_file.part(str(motor.path)), board, command_common.header_name(None, header), library))
            progress(1.0)
    return result


def highest_text(rows: list[dict[str, Any]]) -> str:
    """How fast a motor got without load, of what its header allows."""
    row = rows[-1]
    if row["highest_rpm"] is None:
        return "no closed loop without load"
    return f"without load up to {row['highest_rpm']:.0f} rpm (MAXIMUM_SPEED_RPM {row['reference_rpm']:.0f})"
