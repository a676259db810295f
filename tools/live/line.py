"""The serial line of a virtual board in this process, between the board's thread and the client's."""

import threading

MOMENT_S = 0.02
"""How long a read waits."""


class Line:
    """The client's end is a stream for tools/live/lnet.py: read() and write(). The board's end is exchange()."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.sent, self.received = bytearray(), bytearray()

    def write(self, data: bytes) -> None:
        """To the board."""
        with self.changed:
            self.sent += data

    def read(self, size: int = 1) -> bytes:
        """What has come from it, perhaps nothing."""
        with self.changed:
            if not self.received:
                self.changed.wait(MOMENT_S)
            data = bytes(self.received[:size])
            del self.received[:size]
            return data

    def clear(self) -> None:
        """A board that is switched off sends nothing more."""
        with self.changed:
            self.sent.clear()
            self.received.clear()

    def exchange(self, send, text: str) -> None:
        """`send` takes characters for the board and returns how many it has taken; `text` is what the board has sent."""
        with self.changed:
            if self.sent:
                del self.sent[:send(self.sent.decode("latin-1"))]
            if text:
                self.received += text.encode("latin-1")
                self.changed.notify_all()
