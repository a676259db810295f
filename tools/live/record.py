"""The fault recorder's rows (docs/faults.md) as a trace of the page, out of what a firmware without the scope says on its serial line."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from tools.bench import recorder
from tools.common import drive_tables

from .symbols import Symbols

HEAD = re.compile(r"record fault .*\n")
LONGEST_LINE, LONGEST_RECORD = 200, 8192
"""Characters; a record has half as many."""
TAKEN = {"SnapDone": "SNAPSHOT", "board_bringup": "BRINGUP", "IdentifyParm": "IDENTIFY", "board_params": "PARAMS_IN_RAM or TUNING"}
"""Variables of the modes that take the recorder's place in RAM."""
COLUMNS = {"i_a": "A", "i_b": "A", "v_d": "V", "v_q": "V", "angle": "°", "speed": "rpm", "bus": "V", "state": ""}
"""Of the trace, with their units."""
COMES = "The firmware's fault recorder: its rows come after the next fault."


def told(symbols: Symbols, params: Mapping[str, float]) -> str:
    """What is to come, or what to build where the firmware has no recorder."""
    if not params["RECORDER_PERIODS"]:
        return "RECORDER_PERIODS is 0, and nothing is recorded: build with 4, or with SCOPE 1."
    roots = {re.split(r"[.\[]", name)[0] for name in symbols.variables}
    taken = next((mode for variable, mode in TAKEN.items() if variable in roots), None)
    return COMES if taken is None else f"{taken} has the fault recorder's place in RAM, and nothing is recorded: build without it, or with SCOPE 1."


def trace_of(record: recorder.Record, params: Mapping[str, float], states: Mapping[int, str]) -> dict[str, Any]:
    """As the scope's traces are; at 0 s the drive was in the fault. Speed and bus have a value in every eighth row."""
    rows = recorder.scaled(record, params, states)
    table = np.column_stack((rows.time_ms / 1000.0, rows.i_a, rows.i_b, rows.v_d, rows.v_q, rows.angle_deg, rows.speed_rpm, rows.bus_v, record.states))
    return {"names": list(COLUMNS), "units": list(COLUMNS.values()), "triggered": True,
            "fault": next(row.name for row in drive_tables.faults() if row.code == record.fault),
            "rows": [[None if np.isnan(value) else float(f"{value:.6g}") for value in row] for row in table.tolist()]}


class Records:
    """Reads along; `trace` is that of the last complete record."""

    def __init__(self, params: Mapping[str, float], states: Mapping[int, str]) -> None:
        self.params, self.states = params, states
        self.text = ""
        self.trace: dict[str, Any] | None = None
        self.damaged = False
        """one did not come whole; whoever tells it clears it"""

    def forget(self) -> None:
        """The line was cut."""
        self.text = ""

    def hello(self, symbols: Symbols) -> dict[str, Any]:
        """For a new tab."""
        return {"told": told(symbols, self.params), "names": list(COLUMNS), "units": list(COLUMNS.values()), "trace": self.trace}

    def feed(self, text: str) -> dict[str, Any] | None:
        """More of the line; a trace where a record is complete with it."""
        self.text += text
        heads = [head.start() for head in HEAD.finditer(self.text)]
        if not heads:
            self.text = self.text[-LONGEST_LINE:]
            return None
        self.text, *records = [self.text[begin:end] for begin, end in zip(heads, [*heads[1:], len(self.text)])][::-1]
        if not recorder.under_way(self.text) or len(self.text) > LONGEST_RECORD:
            records, self.text = [self.text, *records], ""
        found = [record for text in records for record in recorder.of_text(text)]
        self.damaged |= len(found) < len(records)
        if not found:
            return None
        self.trace = trace_of(found[0], self.params, self.states)
        return self.trace
