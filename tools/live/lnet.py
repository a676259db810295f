"""A client of the firmware's serial line (docs/scope.md): reads and writes its memory, and records with its scope.

    link = connect("/dev/ttyUSB0")      # or a stream: an object with read(size) and write(data)
    link.write(address, b"\\x01\\x00")
    link.scope_setup([Channel(address), Channel(other)], Trigger(address, 500), delay=-20, factor=4)
    while link.scope_state().running: ...
    rows = link.scope_read()"""

import errno
import os
import struct
import time
from dataclasses import dataclass, field
from typing import Any, Protocol

from tools.common.errors import UserError

BAUD = 115200
SYN, KEY, NODE = 0x55, 0x02, 1
DEVICE_INFO, GET_RAM, PUT_RAM, LOAD_PARAMETER, SAVE_PARAMETER = 0, 9, 10, 17, 18
ERRORS = {19: "the checksum is wrong", 20: "wrong length, address or settings", 21: "too long", 33: "no such service"}
SCOPE_PARAMETER, RAM, TRIGGERED, AUTO = 1, 0, 1, 2
OPEN_ERRORS = {None: ("it is no serial port", "name the one that the board is at"),
               errno.EAGAIN: ("another program has it", "end that one"),
               errno.EACCES: ("it is not yours to open", "join its group, on Debian dialout, and log in again")}
"""Why a port does not open, and what to do, by the error's number; others speak for themselves."""
MOST_BYTES = 253
"""Of memory in one answer."""
MOST_WORDS = 8
"""Of 16 bits, that the scope records at once."""
ANSWER_S = 1.0
TRIES = 3


try:
    import termios
    PORT_ERRORS: tuple[type[Exception], ...] = (OSError, termios.error)
except ImportError: # not every system has them
    PORT_ERRORS = (OSError,)


class LnetError(Exception):
    """The firmware refuses, or does not answer."""


class Stream(Protocol):
    """What a link needs: a serial port, or something like it."""

    def read(self, size: int) -> bytes:
        """Up to `size` bytes; what is there after a moment, perhaps nothing."""

    def write(self, data: bytes) -> Any:
        """Sends."""


@dataclass(frozen=True)
class Channel:
    """A variable to record."""

    address: int
    bytes: int = 2
    signed: bool = True

    @property
    def format(self) -> str:
        """As struct has it."""
        letter = {2: "h", 4: "i"}[self.bytes]
        return letter if self.signed else letter.upper()


@dataclass(frozen=True)
class Trigger:
    """A 16-bit variable that comes to a level, from below or from above."""

    address: int
    level: int
    rising: bool = True
    signed: bool = True


@dataclass(frozen=True)
class ScopeState:
    """What the scope says of itself; places in its array are bytes."""

    state: int
    channels: int
    factor: int
    """periods from row to row"""
    next: int
    array: int
    """address"""
    delay: int
    """rows from the trigger to the first one; negative: before it"""
    event: int
    """the trigger's row"""
    used: int
    size: int

    @property
    def running(self) -> bool:
        """It records, or waits for its trigger."""
        return self.state != 0


def frame(data: bytes, node: int = NODE) -> bytes:
    """The data between SYN and checksum, with fill bytes."""
    plain = bytes([SYN, len(data), node]) + data
    total = sum(plain) & 0xFF
    filled = b"".join(bytes([byte, 0]) if byte in (SYN, KEY) else bytes([byte]) for byte in plain[1:])
    return bytes([SYN]) + filled + bytes([total ^ 0xFF if total in (SYN, KEY) else total])


class Decoder:
    """Finds the frames in a stream of bytes, whatever else is in it."""

    def __init__(self) -> None:
        self._plain = bytearray()
        self._special = 0
        self._inside = False

    def feed(self, data: bytes) -> list[bytes]:
        """The data of each frame that is complete now and has its checksum."""
        return [found for byte in data if (found := self._byte(byte)) is not None]

    def _begin(self) -> None:
        self._plain, self._special, self._inside = bytearray([SYN]), 0, True

    def _byte(self, byte: int) -> bytes | None:
        before, self._special = self._special, 0
        if before and byte == 0:
            return None
        if before == SYN: # it was no data: a frame began there
            self._begin()
        elif before:
            self._inside = False
        complete = self._inside and len(self._plain) > 3 and len(self._plain) == 3 + self._plain[1]
        if not self._inside or (complete and byte == SYN):
            self._inside = False
            if byte == SYN:
                self._begin()
            return None
        if complete:
            self._inside = False
            total = sum(self._plain) & 0xFF
            return bytes(self._plain[3:]) if byte == (total ^ 0xFF if total in (SYN, KEY) else total) and self._plain[2] == NODE else None
        self._plain.append(byte)
        self._special = byte if byte in (SYN, KEY) else 0
        return None


def connect(port: str | Stream) -> "Lnet":
    """A link to the firmware behind a serial port's name or a stream; it has answered."""
    link = Lnet(open_port(port) if isinstance(port, str) else port)
    link.device_info()
    return link


def open_port(port: str) -> Stream:
    """A serial port by its name, for this program alone."""
    try:
        import serial
    except ImportError:
        raise UserError("no module serial", port, "install python3-serial") from None
    try:
        return serial.Serial(port, BAUD, timeout=0.01, exclusive=True)
    except PORT_ERRORS as error: # serial's, too; without a number it could not set the speed
        number = getattr(error, "errno", None)
        reason, remedy = OPEN_ERRORS.get(number, (os.strerror(number or 0), "name the one that the board is at"))
        raise UserError(f"cannot open the port ({reason})", port, remedy) from None


@dataclass
class Lnet:
    """A link to one firmware. Requests take turns: use it from one thread."""

    stream: Stream
    answer_s: float = ANSWER_S
    channels: list[Channel] = field(default_factory=list)
    """of the last scope_setup()"""

    def request(self, service: int, arguments: bytes = b"") -> bytes:
        """What the firmware answers after service and error. What can be asked twice is asked again if no answer comes."""
        for _ in range(TRIES):
            self.stream.write(frame(bytes([service]) + arguments))
            answer = self._answer(service)
            if answer is not None and answer[1] != 19:
                break
        if answer is None:
            raise LnetError(f"no answer to service {service} in {TRIES * self.answer_s:g} s")
        if answer[1]:
            raise LnetError(f"service {service} is refused: {ERRORS.get(answer[1], f'error {answer[1]}')}")
        return answer[2:]

    def _answer(self, service: int) -> bytes | None:
        decoder, end = Decoder(), time.monotonic() + self.answer_s
        while time.monotonic() < end:
            for data in decoder.feed(self.stream.read(512)):
                if len(data) >= 2 and data[0] == service:
                    return data
        return None

    def device_info(self) -> dict[str, int]:
        """Version of the protocol, longest frame, kind of processor."""
        monitor, _, longest, processor = struct.unpack_from("<HHBH", self.request(DEVICE_INFO))
        return {"monitor": monitor, "longest": longest, "processor": processor}

    def read(self, address: int, n: int) -> bytes:
        """`n` bytes of memory."""
        data = b""
        while len(data) < n:
            part = min(n - len(data), MOST_BYTES & ~1)
            data += self.request(GET_RAM, struct.pack("<HBB", address + len(data), part, 1))
        return data

    def write(self, address: int, data: bytes) -> None:
        """Writes variables; a word at an even address is written at once."""
        self.request(PUT_RAM, struct.pack("<HB", address, len(data)) + data)

    def scope_setup(self, channels: list[Channel], trigger: Trigger | None = None, delay: int = 0, factor: int = 1) -> None:
        """Begins to record a row every `factor` periods: at once, or `delay` rows after the trigger; negative: so many rows before it are kept.
        On the line the delay is in bytes, with the other sign."""
        self.channels = list(channels)
        request = struct.pack("<HBBH", SCOPE_PARAMETER, TRIGGERED if trigger else AUTO, len(channels), factor - 1)
        request += b"".join(struct.pack("<BIB", RAM, channel.address, channel.bytes) for channel in channels)
        if trigger is None:
            trigger = Trigger(channels[0].address, 0)
        kind = 0x80 | (0x20 if trigger.signed else 0) | 2
        row = sum(channel.bytes for channel in channels)
        request += struct.pack("<BBIHiBB", kind, RAM, trigger.address, trigger.level & 0xFFFF, -delay * row, trigger.rising, 1)
        self.request(SAVE_PARAMETER, request)

    def scope_stop(self) -> None:
        """Nothing is recorded any more."""
        self.request(SAVE_PARAMETER, struct.pack("<HBBH", SCOPE_PARAMETER, 0, 0, 0))

    def scope_state(self) -> ScopeState:
        """What the scope does, and where."""
        state, count, factor, following, array, delay, event, used, size = struct.unpack_from("<BBHIIiIII", self.request(
            LOAD_PARAMETER, struct.pack("<H", SCOPE_PARAMETER)))
        row = sum(channel.bytes for channel in self.channels) or 1
        return ScopeState(state, count, factor + 1, following, array, -delay // row, event, used, size)

    def scope_read(self) -> list[tuple[int, ...]]:
        """The rows that were recorded, the oldest first: a value of each channel."""
        state = self.scope_state()
        if state.running:
            raise LnetError("the scope still records")
        data = self.read(state.array, state.used) if state.used else b""
        layout = "<" + "".join(channel.format for channel in self.channels)
        return list(struct.iter_unpack(layout, data[state.next:] + data[:state.next]))
