"""The fault recorder's rows (include/drive/recorder.h): out of the text that the firmware sends, in engineering units."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tools.common import drive_tables
from tools.common.errors import UserError
from .scenario import param

RING_ROWS, AFTER_ROWS, WORDS, STATE_BITS, FAULT_STATE = 72, 16, 6, 15, 7
HEAD = re.compile(r"record fault (\d+) rows (\d+) every (\d+)$")
ROW = re.compile(r"row (\d+)((?: -?\d+){%d})$" % WORDS)
AGAIN = "log it again: after a reset by its pin the board sends the record once more"


@dataclass(frozen=True)
class Record:
    """The words of a record as they were sent; the oldest row first."""

    fault: int
    every: int
    """periods from row to row"""
    places: tuple[int, ...]
    """in the ring: even ones have the bus, odd ones the speed"""
    words: tuple[tuple[int, ...], ...]

    @property
    def states(self) -> list[int]:
        return [row[4] & STATE_BITS for row in self.words]

    def fault_row(self, fault_state: int) -> int:
        """The row at whose end the drive was in the fault; one behind the last where a reset was the fault."""
        return next((number for number, state in enumerate(self.states) if state == fault_state), len(self.words))


def of_text(text: str) -> list[Record]:
    """The complete records of what a run's board has sent."""
    try:
        return parse(text, "")
    except UserError:
        return []


def parse(text: str, where: str) -> list[Record]:
    """The complete records of a log, each once; a damaged or missing one is an error."""
    found: list[Record] = []
    cut: UserError | None = None
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if not (head := HEAD.search(line)):
            continue
        try:
            record = _record([int(word) for word in head.groups()], lines, number, where)
        except _Cut as error:
            cut = error
            continue
        if record not in found[-1:]: # after a reset it is sent again
            found.append(record)
    if not found:
        raise cut or UserError("no record of a fault", where, "log the board's UART (115200 8N1) while it sends one: after a fault, and after a reset")
    return found


def under_way(text: str) -> bool:
    """Whether the last record has begun and has not been sent to its end."""
    heads = list(re.finditer(r"record fault \d+ rows (\d+)", text))
    return bool(heads) and len(re.findall(r"^row .*\r\n", text[heads[-1].start():], re.MULTILINE)) < int(heads[-1][1])


class _Cut(UserError):
    """A record without its end: a later one may be whole."""


def _record(head: list[int], lines: list[str], at: int, where: str) -> Record:
    fault, count, every = head
    place_of = f"{where} line {at + 1}"
    known = {row.code for row in drive_tables.faults()}
    if fault not in known or not 1 <= count <= RING_ROWS or every < 1:
        raise UserError(f"no head of a record: '{lines[at]}'", place_of, AGAIN)
    places: list[int] = []
    words: list[tuple[int, ...]] = []
    for number, line in enumerate(lines[at + 1:], at + 2):
        if len(words) == count or HEAD.search(line):
            break
        if line.startswith("row"):
            place, values = _row(line, f"{where} line {number}")
            if places and place != (places[-1] - 1) % RING_ROWS:
                raise UserError(f"row {(places[-1] - 1) % RING_ROWS} is missing after row {places[-1]}", f"{where} line {number}", AGAIN)
            places.append(place)
            words.append(values)
    if len(words) < count:
        raise _Cut(f"the record ends after {len(words)} of {count} rows", place_of, AGAIN)
    return Record(fault, every, tuple(places), tuple(words))


def _row(line: str, where: str) -> tuple[int, tuple[int, ...]]:
    found = ROW.match(line)
    place, values = (int(found[1]), tuple(map(int, found[2].split()))) if found else (RING_ROWS, ())
    if place >= RING_ROWS or not all(-32768 <= value <= 32767 for value in values):
        raise UserError(f"no row of a record: '{line}'", where, AGAIN)
    return place, values


@dataclass(frozen=True)
class Rows:
    """A record in engineering units; of bus and speed every other row is not a number."""

    time_ms: np.ndarray
    """from the fault on"""
    i_a: np.ndarray
    i_b: np.ndarray
    v_d: np.ndarray
    v_q: np.ndarray
    angle_deg: np.ndarray
    bus_v: np.ndarray
    speed_rpm: np.ndarray
    state: list[str]

    @property
    def i_c(self) -> np.ndarray:
        return -self.i_a - self.i_b


def scaled(record: Record, params: Mapping[str, float], states: Mapping[int, str]) -> Rows:
    """With the scales of the firmware that has the record."""
    words = np.array(record.words, dtype=np.float64).reshape(-1, WORDS)
    fault_state = next((number for number, name in states.items() if name == "FAULT"), FAULT_STATE)
    time = (np.arange(len(words)) - record.fault_row(fault_state)) * record.every * param(params, "LOOPTIME_SEC")
    has_bus = np.array(record.places) % 2 == 0
    return Rows(1e3 * time, *(words[:, column] * param(params, "COUNT_CURRENT_A") for column in (0, 1)),
                *(words[:, column] * param(params, "COUNT_VOLTAGE_V") for column in (2, 3)),
                (words[:, 4].astype(np.int64) & 0xFFFF & ~STATE_BITS) * 360.0 / 65536.0,
                np.where(has_bus, (words[:, 5] + 32768.0) / 65536.0 * param(params, "BUS_FULL_SCALE_V"), np.nan),
                np.where(has_bus, np.nan, words[:, 5] * param(params, "COUNT_SPEED_RPM")),
                [states.get(number, f"state {number}") for number in record.states])


def title(record: Record, rows: Rows) -> str:
    """What is shown, in one line."""
    name = next(row.name for row in drive_tables.faults() if row.code == record.fault)
    before = int(np.sum(rows.time_ms < 0.0))
    return f"{name}: {before} rows before it, {len(rows.state) - before} from it on, {record.every} period{'s' if record.every > 1 else ''} apart"
