"""A person at the virtual board with the BRINGUP firmware: reads its lines, looks at LEDs, shaft and ammeter, presses S2 and S3."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from .board import Board

LOOK_S = 0.01
THINKS_S = 0.1
"""From a line to the press that answers it."""
PRESS_S = 0.05
LONGEST_S = 90.0
PATIENCE = 3
"""First lines after which S2 counts as dead: the other button may begin."""
WATCHES_S = 1.7
"""Two electrical turns with their pauses."""
TURNED = 0.02
MARK = 0.04
"""Turns that the mark may be off: the field goes on to the end of its turn meanwhile, and a rotor swings there."""
SURE_S = 0.06
STANDS_S = 4.0
METER = 0.1


@dataclass
class Said:
    """All that was said, with its motor time; and the largest phase current on the way."""

    lines: list[tuple[float, str]] = field(default_factory=list)
    motor_s: float = 0.0
    current_max_a: float = 0.0
    ended: bool = False

    def findings(self) -> list[str]:
        """Names, with the phase where there is one."""
        return [found[1] for _, line in self.lines if (found := re.match(r"FIX ([A-Z_0-9]+(?: [ABC])?):", line))]

    def warned(self) -> list[str]:
        """Values outside their range."""
        return [found[1] for _, line in self.lines if (found := re.match(r"WRONG ([A-Z_0-9]+(?: [ABC])?):", line))]


class User:
    """Answers what is asked until the end is said, or until the question at which this user leaves."""

    def __init__(self, board: Board, period_s: float, report: Callable[[float], None], leaves: str = "") -> None:
        self.board, self.period_s, self.report, self.leaves = board, period_s, report, leaves
        self.said = Said()
        self.rest = ""
        self.begins = 0
        self.told_by = ""
        self.mark = 0.0

    # ---- time ----
    def wait(self, seconds: float) -> None:
        self.board.run(max(1, round(seconds / self.period_s)))
        self.said.motor_s += seconds
        self.report(seconds)
        self.rest += self.board.uart_take()

    def lines(self) -> Iterator[str]:
        """What has been said since the last call."""
        *complete, self.rest = self.rest.split("\r\n")
        for line in complete:
            self.said.lines.append((self.said.motor_s, line))
            yield line

    def press(self, button: str) -> None:
        self.wait(THINKS_S)
        self.board.set(f"input.{button}", 1.0)
        self.wait(PRESS_S)
        self.board.set(f"input.{button}", 0.0)
        self.wait(PRESS_S)

    def work(self) -> Said:
        while not self.said.ended and self.said.motor_s < LONGEST_S:
            self.wait(LOOK_S)
            for line in self.lines():
                self.said.ended = self.said.ended or line.startswith("end:")
                if asked := re.match(r"ask (\w+): (.*)", line):
                    if asked[1] == self.leaves:
                        self.said.ended = True
                        break
                    button = getattr(self, "on_" + asked[1].lower())(asked[2])
                    if button:
                        self.press(button)
        self.said.current_max_a = self.board.get("stat.i_peak_a")
        return self.said

    # ---- the questions of BRINGUP_QUESTION_TABLE ----
    def on_begin(self, text: str) -> str:
        self.told_by = self.told_by or re.findall(r"R[ABC]\d+", text)[0]
        self.begins += 1
        return "s2" if self.begins <= PATIENCE else "s3"

    def on_uart(self, text: str) -> str:
        return self.yes(re.findall(r"R[ABC]\d+", text)[0] == self.told_by)

    def on_s3(self, text: str) -> str:
        return "s3"

    def on_led_alive(self, text: str) -> str:
        return self.yes(self.lit() == (1.0, 0.0))

    def on_led_run(self, text: str) -> str:
        return self.yes(self.lit() == (0.0, 1.0))

    def on_led_other(self, text: str) -> str:
        return self.yes(sum(self.lit()) == 1.0)

    def on_pot_left(self, text: str) -> str:
        return self.turn_pot(0.0)

    def on_pot_right(self, text: str) -> str:
        return self.turn_pot(1.0)

    def on_fault_input(self, text: str) -> str:
        self.board.set("input.flta", 1.0)
        return "s2"

    def on_fault_open(self, text: str) -> str:
        self.board.set("input.flta", 0.0)
        return "s2"

    def on_current(self, text: str) -> str:
        self.board.set("input.flta", 0.0)
        self.board.set("stat.reset", 1.0)
        return "s2"

    def on_ammeter(self, text: str) -> str:
        told = float(re.findall(r"shows (\d+\.\d+) A", text)[0])
        true = abs(self.board.get("plant.i_a"))
        return self.yes(abs(told - true) <= METER * true)

    def on_direction(self, text: str) -> str:
        before = self.board.get("plant.turns")
        self.wait(WATCHES_S)
        return self.yes(self.board.get("plant.turns") - before > TURNED)

    def on_mark(self, text: str) -> str:
        self.wait(1.0)
        self.mark = self.board.get("plant.turns")
        return "s2"

    def on_turns(self, text: str) -> str:
        """Presses in the pause in which the mark is back."""
        back_s, watched_s = 0.0, 0.0
        while watched_s < LONGEST_S:
            self.wait(LOOK_S)
            watched_s += LOOK_S
            turned = abs(self.board.get("plant.turns") - self.mark)
            back_s = back_s + LOOK_S if abs(turned - 1.0) < MARK else 0.0
            if back_s >= SURE_S:
                return "s2"
            if watched_s > STANDS_S and turned < TURNED:
                return "s3"
        return "s3"

    # ---- what is seen ----
    @staticmethod
    def yes(answer: bool) -> str:
        return "s2" if answer else "s3"

    def lit(self) -> tuple[float, float]:
        return self.board.get("led.alive"), self.board.get("led.run")

    def turn_pot(self, to: float) -> str:
        self.board.set("input.pot", to)
        return "s2"


def use(board: Board, values: dict[str, float], report: Callable[[float], None], leaves: str = "") -> Said:
    """Switches the board on and does what it asks for, up to the question `leaves`."""
    for key, value in values.items():
        board.set(key, value)
    board.power_up()
    board.run(1)
    return User(board, 1.0 / board.get("pwm.frequency_hz"), report, leaves).work()


def answers() -> set[str]:
    """Names of the questions that the user can answer."""
    return {name.removeprefix("on_").upper() for name in vars(User) if name.startswith("on_")}
