"""What a page has of any board at a serial port: its own clock, a log, the curves' rows, and whether the board is heard."""

import csv
import io
import math
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

from tools.common import drive_tables
from tools.common.errors import UserError

from . import view
from .pace import FRAME_S

CSV_S = 600.0


class AtPort:
    """Time passes by itself."""

    SILENT_S = 1.0
    """So long without a word, and the page says so."""
    hurries = False
    """Its line is its own."""

    def __init__(self, port: Any, title: str) -> None:
        self.port, self.title = port, title
        self.begun_s = time.monotonic()
        self.time_s = 0.0
        self.heard_s = -math.inf
        self.rows: deque[dict[str, Any]] = deque(maxlen=round(CSV_S / FRAME_S))
        self.strip: deque[list[Any]] = deque(maxlen=round(view.STRIP_S / FRAME_S))
        self.log: deque[dict[str, Any]] = deque(maxlen=200)
        self.lines = self.told = 0
        self.state = self.fault = ""
        self.was_silent = False

    def paced(self, pace: float) -> None:
        """Its time is everybody's."""
        if pace != 1.0:
            raise UserError("a real board has real time", "PACE", "leave it out")

    def run(self, seconds: float) -> None:
        """Nothing to do."""
        self.time_s = time.monotonic() - self.begun_s

    def note(self, text: str, kind: str = "action") -> None:
        """A line of the log."""
        self.log.append({"id": self.lines, "t": round(self.time_s, 3), "text": text, "kind": kind, "same": ""})
        self.lines += 1

    def news(self) -> list[dict[str, Any]]:
        """Lines of the log that no frame has told."""
        told, self.told = self.told, self.lines
        return [line for line in self.log if line["id"] >= told]

    def silent(self) -> bool:
        """Not a word for a while: how things stand is not known. Each change has its line in the log."""
        silent = time.monotonic() > max(self.heard_s, self.begun_s) + self.SILENT_S
        if silent != self.was_silent:
            self.note("no answer" if silent else "it answers again", "fault")
        self.was_silent = silent
        return silent

    def note_changes(self, state: str, fault: str) -> None:
        """Of the drive."""
        if state != self.state:
            self.note(f"state {state}", "state")
        if fault != self.fault and (fault != "NONE" or self.fault):
            self.note("fault cleared" if fault == "NONE" else f"fault {fault}", "fault")
        self.state, self.fault = state, fault

    def about(self, params: Mapping[str, float]) -> dict[str, Any]:
        """What a new tab must know of any such board."""
        return {"virtual": False, "motor": self.title, "board": str(self.port), "defines": [], "sliders": {}, "throws": [],
                "max_current_a": params["MAXIMUM_CURRENT_A"], "nominal_bus_v": params["NOMINAL_BUS_V"],
                "states": view.states(), "estimates": view.ESTIMATES, "faults": view.faults(), "limits": view.limits(),
                "strip": list(self.strip), "log": list(self.log)}

    @staticmethod
    def limits(reasons: int) -> list[str]:
        """Names of the reasons in a word."""
        return [row.name for row in drive_tables.limits() if row.code & reasons]

    def scenario(self) -> str:
        """Only a virtual board can repeat."""
        raise UserError("a real board has no scenario", "page", "save its CSV")

    def csv(self) -> str:
        """What was heard, a row each, of the last ten minutes."""
        if not self.rows:
            raise UserError("nothing is recorded yet", "CSV", "wait a moment")
        rows, text = list(self.rows), io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(rows[0])
        writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in row.values()] for row in rows)
        return text.getvalue()
