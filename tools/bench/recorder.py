"""The fault recorder's rows (include/drive/recorder.h): out of the text that the firmware sends, in engineering units."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tools.common import drive_tables
from tools.common.errors import UserError
from .scenario import param

RING_ROWS, AFTER_ROWS, BYTES, STATE_BITS, FAULT_STATE = 64, 16, 6, 15, 7
I_A, V_D, I_B, V_Q, SLOW, ANGLE = range(BYTES)
HEAD = re.compile(r"record fault (\w+) rows (\d+) every (\d+)(?: offsets (-?\d+) (-?\d+))?$")
ROW = re.compile(r"row (\d+)((?: -?\d+){%d})$" % BYTES)
AGAIN = "log it again: after a reset by its pin the board sends the record once more"
OLDER = "an older firmware sends none: draw its log with the foc33 of its own version"


@dataclass(frozen=True)
class Record:
    """The bytes of a record as they were sent; the oldest row first."""

    fault: int
    every: int
    """periods from row to row"""
    offsets_q13: tuple[int, int]
    """of the currents of A and B"""
    places: tuple[int, ...]
    """in the ring"""
    rows: tuple[tuple[int, ...], ...]

    @property
    def states(self) -> list[int]:
        return [row[SLOW] & STATE_BITS for row in self.rows]

    def slow_words(self, of: int) -> np.ndarray:
        """The signed word that four rows have, where the first one's place is `of`, `of` + 8, ...; nan in the others."""
        found = np.full(len(self.rows), np.nan)
        for number, place in enumerate(self.places[:-3]):
            if place % 8 == of:
                *lower, upper = (row[SLOW] >> 4 for row in self.rows[number:number + 4])
                found[number] = upper * 4096 + sum((bits & 15) << shift for bits, shift in zip(lower, (0, 4, 8)))
        return found

    def fault_row(self, fault_state: int) -> int:
        """The row at whose end the drive was in the fault; one behind the last where a reset was the fault."""
        return next((number for number, state in enumerate(self.states) if state == fault_state), len(self.rows))


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
            record = _record(head, lines, number, where)
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
    heads = list(re.finditer(r"record fault \w+ rows (\d+)", text))
    return bool(heads) and len(re.findall(r"^row .*\r\n", text[heads[-1].start():], re.MULTILINE)) < int(heads[-1][1])


class _Cut(UserError):
    """A record without its end or its offsets: a later one may be whole."""


def _record(head: re.Match[str], lines: list[str], at: int, where: str) -> Record:
    place_of = f"{where} line {at + 1}"
    if head[4] is None:
        raise _Cut(f"no offsets in the record's head: '{lines[at]}'", place_of, OLDER)
    count, every, *offsets = map(int, head.groups()[1:])
    fault = next((row.code for row in drive_tables.faults() if row.name == head[1]), None)
    if fault is None or not 1 <= count <= RING_ROWS or every < 1:
        raise UserError(f"no head of a record: '{lines[at]}'", place_of, AGAIN)
    places: list[int] = []
    rows: list[tuple[int, ...]] = []
    for number, line in enumerate(lines[at + 1:], at + 2):
        if len(rows) == count or HEAD.search(line):
            break
        if line.startswith("row"):
            place, values = _row(line, f"{where} line {number}")
            if places and place != (places[-1] - 1) % RING_ROWS:
                raise UserError(f"row {(places[-1] - 1) % RING_ROWS} is missing after row {places[-1]}", f"{where} line {number}", AGAIN)
            places.append(place)
            rows.append(values)
    if len(rows) < count:
        raise _Cut(f"the record ends after {len(rows)} of {count} rows", place_of, AGAIN)
    return Record(fault, every, (offsets[0], offsets[1]), tuple(places), tuple(rows))


def _row(line: str, where: str) -> tuple[int, tuple[int, ...]]:
    found = ROW.match(line)
    place, values = (int(found[1]), tuple(map(int, found[2].split()))) if found else (RING_ROWS, ())
    if place >= RING_ROWS or not all(-128 <= value <= 127 for value in values):
        raise UserError(f"no row of a record: '{line}'", where, AGAIN)
    return place, values


@dataclass(frozen=True)
class Rows:
    """A record in engineering units; bus and speed are numbers in every eighth row."""

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
    """With the scales of the firmware that has the record. A byte stands for the middle of its step."""
    middles = 256.0 * (np.array(record.rows, dtype=np.float64).reshape(-1, BYTES) + 0.5)
    fault_state = next((number for number, name in states.items() if name == "FAULT"), FAULT_STATE)
    time = (np.arange(len(middles)) - record.fault_row(fault_state)) * record.every * param(params, "LOOPTIME_SEC")
    # as drive_measure() of include/drive/tick.h
    currents = [(middles[:, column] * param(params, gain) / 2.0 - offset) * param(params, "COUNT_CURRENT_A")
                for column, gain, offset in zip((I_A, I_B), ("KCURRA", "KCURRB"), record.offsets_q13)]
    return Rows(1e3 * time, *currents, *(middles[:, column] * param(params, "COUNT_VOLTAGE_V") for column in (V_D, V_Q)),
                middles[:, ANGLE] % 65536.0 * 360.0 / 65536.0,
                (record.slow_words(0) + 32768.0) / 65536.0 * param(params, "BUS_FULL_SCALE_V"),
                record.slow_words(4) * param(params, "COUNT_SPEED_RPM"),
                [states.get(number, f"state {number}") for number in record.states])


def title(record: Record, rows: Rows) -> str:
    """What is shown, in one line."""
    name = next(row.name for row in drive_tables.faults() if row.code == record.fault)
    before = int(np.sum(rows.time_ms < 0.0))
    return f"{name}: {before} rows before it, {len(rows.state) - before} from it on, {record.every} period{'s' if record.every > 1 else ''} apart"
