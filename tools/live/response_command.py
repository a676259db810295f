"""`make response`: the open loops of current and speed, measured with the firmware's own sine, over the tuner's model of them; and steps.

    python3 -m tools.live.response_command [--motor NAME] [--loop current|speed] [--speed RPM] [--load N·m] [--port /dev/ttyUSB0]"""

import argparse
import contextlib
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.bench import build, command_common
from tools.bench.board import Board, BoardError, Library
from tools.bench.plots import plt, saved
from tools.bench.report import clean
from tools.bench.scenario import BRAKE
from tools.bench.scenario_file import MOTOR
from tools.common import command_line, motor_file, output, paths
from tools.common.errors import UserError
from tools.common.progress import Progress
from tuning import loops

from . import board as live_board
from . import lnet, response, step
from .response import Bench, Driven, Firmware, Point
from .response_model import COLUMNS, WITHIN_DEG, Result, model_of
from .step_model import answer, answers_of, seconds_of
from .symbols import Symbols

OPEN_LOOP = "-DOPEN_LOOP_FUNCTIONING"
SPEED_SHARE, LOAD_SHARE = 0.5, 0.4
"""Of the rated speed and torque, where nobody names them: the current is clear of what dead time loses."""
SETTLE_S = 2.0
ANSWER_S = 20.0
"""The simulated chip takes its time."""


# ---- boards ------------------------------------------------------------------------------------------------------------------

@dataclass
class Place:
    """A board with a motor, whichever, and how it ends."""

    bench: Driven
    motor: motor_file.Motor | None
    board: Board | None
    """the virtual one"""
    title: str
    path: str
    """of the motor's file"""


def virtual(options: argparse.Namespace, loop: str) -> Place:
    """A virtual board, or the image in the simulated chip. The current loop is measured with the forced angle, whose frame does not move with the
    current (docs/response.md)."""
    defines = f"{options.defines} {OPEN_LOOP if loop == 'current' else ''}".strip()
    parts = live_board.parts(options.motor, options.board, defines, options.userparams, options.cpu)
    if not parts.library.params["SCOPE"]:
        raise UserError("the firmware has no sine for its loops", "response", "build it with SCOPE 1")
    live = live_board.LiveBoard(parts)
    link = lnet.connect(live_board.BoardStream(live))
    link.answer_s = ANSWER_S
    return Place(Driven(Firmware(link, Symbols.read(parts.symbols)), parts.library.params, live.run), motor_file.load(str(parts.motor.path)), live.board,
                 parts.motor.title, str(paths.shown(parts.motor.path)))


def real(options: argparse.Namespace) -> Place:
    """A board at a serial port."""
    header = command_common.header_for(options)
    library = Library(build.library(live_board.with_scope(command_common.macros(options.defines)), build.header_folder(header) if header else None, "live-library"))
    motor = motor_file.load(options.motor) if options.motor else None
    symbols = Symbols.read(options.elf or paths.ROOT / "build" / "target" / "foc33.elf")
    try:
        link = lnet.connect(options.port)
    except lnet.LnetError as error:
        raise UserError(str(error), options.port, "is it this port, is the board on, is its firmware built with SCOPE 1?") from None
    return Place(Driven(Firmware(link, symbols), library.params), motor, None, *((motor.title, str(paths.shown(motor.path))) if motor else ("the header's motor", "")))


# ---- measuring ---------------------------------------------------------------------------------------------------------------

def measured(place: Place, loop: str, options: argparse.Namespace) -> tuple[Result, list[step.Answer]]:
    """Starts the motor, measures the loop and its steps, stops."""
    bench, motor, load_nm = place.bench, place.motor, None
    rated_rpm = motor.rated_speed_rpm if motor else bench.params["NOMINAL_SPEED_RPM"]
    try:
        bench.start(options.speed or max(SPEED_SHARE * rated_rpm, bench.params["MINIMUM_SPEED_RPM"]))
        if loop == "speed" and place.board is not None and motor is not None:
            load_nm = options.load if options.load is not None else LOAD_SHARE * motor.rated_torque_nm
            try:
                place.board.set(BRAKE, load_nm)
            except BoardError as error:
                raise UserError(str(error), "LOAD", "choose a load within that") from None
            bench.pause(SETTLE_S)
        frequencies, model, speed_rpm = bench.frequencies(loop), model_of(loop, bench, motor), bench.speed_rpm()
        found: list[Point] = []
        with Progress(f"{loop} loop", len(frequencies), unit="frequencies") as progress:
            for point in bench.points(loop, frequencies):
                found.append(point)
                progress(1)
        answers = _answers(place, loop, load_nm)
    except lnet.LnetError as error:
        raise UserError(str(error), "response", "is the board still on?") from None
    finally:
        with contextlib.suppress(lnet.LnetError):
            bench.stop()
    return Result.of(loop, found, model, speed_rpm, load_nm), answers


def _answers(place: Place, loop: str, load_nm: float | None) -> list[step.Answer]:
    """The steps that go with a loop; that of the load is the virtual board's brake."""
    bench, motor, board = place.bench, place.motor, place.board
    if loop == "current":
        return [answer("current", step.current(bench), answers_of("current", bench, motor))]
    seconds, expected = seconds_of(bench), answers_of("speed", bench, motor)
    found = [answer("speed", step.speed(bench, seconds), expected)]
    if board is not None and load_nm is not None:
        board.set(BRAKE, 0.0)
        bench.pause(SETTLE_S)
        found.append(answer("load", step.load(bench, seconds, lambda on: board.set(BRAKE, load_nm if on else 0.0)), answers_of("load", bench, motor, load_nm)))
    return found


def text(results: list[Result], answers: list[step.Answer], title: str) -> str:
    """The table."""
    lines = [title, "", "loop       speed    load        measured                 tuner's model            difference"]
    for item in results:
        load = "" if item.load_nm is None else f"{item.load_nm:.3g} N m"
        lines.append(f"{item.loop:8}{item.speed_rpm:6.0f} rpm  {load:9}  {_margin(item.measured):23}  {_margin(item.expected):23}  {item.difference_deg:+.1f} degrees"
                     + ("" if item.holds else f"  ! more than {WITHIN_DEG:g}"))
    lines += ["", "step        measured: rise / overshoot, of a load dip / settled     tuner's model                     ripple before the step"]
    lines += [f"{item.step:10}  {_figures(item, item.measured):50}  {_figures(item, item.expected):32}  {item.ripple:.1%} rms" for item in answers]
    return "\n".join(lines)


def _figures(answer: step.Answer, values: np.ndarray) -> str:
    found = step.figures(answer.step, answer.time_s, values)
    rise = "-" if found.rise_s is None else f"{found.rise_s * 1e3:.3g} ms"
    return f"{rise} / {max(found.peak, 0.0):.1%} / " + ("not in the record" if found.settled_s is None else f"{found.settled_s * 1e3:.3g} ms")


def write_answer(folder: Path, found: step.Answer, title: str) -> None:
    """Plot and numbers of a step."""
    output.write_csv(folder / f"step_{found.step}.csv", ["time_s", "measured", "model"],
                     [[f"{number:.6g}" for number in row] for row in zip(found.time_s, found.measured, found.expected)])
    figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
    for values, colour, label in ((found.expected, "tab:blue", "tuner's model"), (found.measured, "tab:orange", "measured")):
        axes.plot(found.time_s * 1e3, values, color=colour, label=f"{label}: {_figures(found, values)}")
    axes.set(title=f"{title}: step of the {found.step}", xlabel="time since the step [ms]",
             ylabel="change of the speed, of the speed" if found.step == "load" else "change, of the step")
    axes.legend()
    saved(figure, folder, f"step_{found.step}")


def _margin(margins: loops.Margins) -> str:
    return f"{margins.phase_deg:.1f} degrees at {margins.crossover_hz:.3g} Hz"


def write(folder: Path, result: Result, title: str) -> None:
    """Plot and numbers of a loop."""
    output.write_csv(folder / f"{result.loop}.csv", list(COLUMNS), [[f"{number:.6g}" for number in row] for row in result.table])
    figure, (size, phase) = plt.subplots(2, 1, sharex=True, figsize=(8, 5.6), layout="constrained")
    hz, response = np.array([point.hz for point in result.points]), np.array([point.response for point in result.points])
    for values, colour, marks, label in ((result.model, "tab:blue", "", "tuner's model"), (response, "tab:orange", "o", "measured")):
        size.semilogx(hz, 20.0 * np.log10(np.abs(values)), marker=marks, markersize=4, color=colour, label=label)
        phase.semilogx(hz, np.degrees(np.angle(values)) % -360.0, marker=marks, markersize=4, color=colour)
    for margins, colour in ((result.expected, "tab:blue"), (result.measured, "tab:orange")):
        phase.plot(margins.crossover_hz, margins.phase_deg - 180.0, "*", markersize=10, color=colour)
    size.axhline(0.0, color="black", linewidth=0.8)
    phase.axhline(-180.0, color="black", linewidth=0.8)
    size.set(title=f"{title}: open {result.loop} loop at {result.speed_rpm:.0f} rpm\nphase margin {_margin(result.measured)} measured, {_margin(result.expected)} by the model",
             ylabel="gain [dB]")
    phase.set(xlabel="frequency [Hz]", ylabel="phase [°]", ylim=(-270.0, 0.0), yticks=range(-270, 1, 45))
    size.legend()
    saved(figure, folder, result.loop)


def _summary(results: list[Result], answers: list[step.Answer], place: Place) -> dict[str, Any]:
    rows = [{"loop": item.loop, "speed_rpm": item.speed_rpm, "load_nm": item.load_nm, "measured_deg": item.measured.phase_deg, "measured_hz": item.measured.crossover_hz,
             "model_deg": item.expected.phase_deg, "model_hz": item.expected.crossover_hz, "ok": item.holds} for item in results]
    steps = [{"step": item.step, "measured": vars(step.figures(item.step, item.time_s, item.measured)),
              "model": vars(step.figures(item.step, item.time_s, item.expected)), "ripple": item.ripple} for item in answers]
    return clean({"title": place.title, "motor": place.path, "rows": rows, "steps": steps, "passed": all(item.holds for item in results),
                  "expectations": [{"name": f"{item.loop} loop's phase margin is the model's", "ok": item.holds} for item in results]})


def _parser() -> argparse.ArgumentParser:
    parser = command_line.Parser(prog="python3 -m tools.live.response_command", description=__doc__.splitlines()[0])
    command_common.add_options(parser, "response", without=("library", "quiet"))
    parser.add_argument("--loop", choices=response.LOOPS, help="one of the two; default both, with --port the speed loop")
    parser.add_argument("--speed", type=_number, metavar="RPM", help=f"of the motor; default {SPEED_SHARE:.0%} of the rated one")
    parser.add_argument("--load", type=_number, metavar="NM", help=f"on the virtual board; default {LOAD_SHARE:.0%} of the rated torque")
    parser.add_argument("--defines", default="", metavar="MACROS", help="build with more macros, written as \"-DNAME -DNAME=value\"")
    parser.add_argument("--cpu", choices=("host", "33f"), default="host", help="33f: an image of XC16 in the instruction-set simulator")
    parser.add_argument("--port", help="serial port of a real board, whose firmware has SCOPE 1")
    parser.add_argument("--elf", type=Path, metavar="FILE", help="ELF file of the firmware on it; default build/target/foc33.elf")
    parser.set_defaults(command=_run)
    return parser


def _number(text: str) -> float:
    """A finite one."""
    with contextlib.suppress(ValueError):
        if math.isfinite(number := float(text)):
            return number
    raise argparse.ArgumentTypeError(f"'{text}' is no number")


def _refuse(options: argparse.Namespace) -> None:
    """What does not go together, and would be left out in silence."""
    if options.speed == 0.0:
        raise UserError("0 rpm", "SPEED", "name the speed at which the motor turns, or leave it out")
    if options.load is not None and options.port:
        raise UserError("only the virtual board has a brake", "LOAD", "load the motor at your board by hand, and leave it out")
    if options.cpu == "33f" and options.port:
        raise UserError("a board has its own processor", "CPU", "leave out CPU or PORT")
    if options.loop == "current" and not options.port and (options.speed is not None or options.load is not None):
        raise UserError("the current loop is measured at END_SPEED_RPM without load", "SPEED, LOAD", "leave them out")


def _run(options: argparse.Namespace) -> int:
    _refuse(options)
    asked = [options.loop] if options.loop else ["speed"] if options.port else list(response.LOOPS)
    results: list[Result] = []
    answers: list[step.Answer] = []
    with output.ResultFolder(command_common.results("response", MOTOR, options)) as folder:
        for loop in asked:
            place = real(options) if options.port else virtual(options, loop)
            found, steps = measured(place, loop, options)
            write(folder.work, found, place.title)
            for answer in steps:
                write_answer(folder.work, answer, place.title)
            results, answers = [*results, found], answers + steps
            if place.board is not None:
                place.board.close()
        table = text(results, answers, place.title)
        (folder.work / "summary.txt").write_text(table + "\n", encoding="utf-8")
        output.write_summary(folder.work, _summary(results, answers, place))
    print(table + f"\n\nresults in {paths.shown(folder.target)}/: " + ", ".join(f"{name}.png" for name in [*(item.loop for item in results), *(f"step_{item.step}" for item in answers)]))
    held = sum(item.holds for item in results)
    print(f"{held} of {len(results)} expectations hold")
    return 0 if held == len(results) else 1


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return command_line.main(_parser, arguments)


if __name__ == "__main__":
    sys.exit(main())
