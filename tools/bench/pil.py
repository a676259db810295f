"""The virtual board around an image of the target (processor in the loop): libpil.so through ctypes, and runs of scenarios on it."""

import contextlib
import ctypes
import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import build, simulate
from .board import Board, Library
from tools.common.errors import UserError
from tools.image import load
from .run import Run

ERROR_BYTES = 400
FIRMWARE = "fw."
"""What begins so is read from the firmware's variables."""


class PilLibrary(Library):
    """libpil.so: everything of libvboard.so, and boards around an image."""

    def _declare(self) -> None:
        super()._declare()
        board, text, out = ctypes.c_void_p, ctypes.c_char_p, ctypes.POINTER
        words, number = out(ctypes.c_int16), out(ctypes.c_double)
        self.declare(
                ("vb_create_iss", board, [text, text, ctypes.c_size_t]), ("vb_iss_has_names", ctypes.c_int, [board]),
                ("vb_iss_difference", text, [board]),
                ("vb_iss_lock_step", None, [board, ctypes.c_int]), ("vb_iss_peek", ctypes.c_int, [board, ctypes.c_uint]),
                ("vb_iss_read", ctypes.c_int, [board, text, words, ctypes.c_uint]),
                ("vb_iss_write", ctypes.c_int, [board, text, words, ctypes.c_uint]),
                ("vb_iss_param_get", ctypes.c_int, [board, text, number]), ("vb_iss_param_set", ctypes.c_int, [board, text, ctypes.c_double]))


def library(defines: list[str], userparams: Path | None = None) -> PilLibrary:
    """Builds build/host[-variant]/libpil.so if needed and loads it."""
    return PilLibrary(build.library(defines, userparams, "pil-library").with_name("libpil.so"))


class PilBoard(Board):
    """A virtual board with an image of the target in its CPU. The comparison's other half is one set of globals: one a process."""

    FIXED_IN = "this image: build it with PARAMS_IN_RAM"

    def __init__(self, pil: PilLibrary, image: Path) -> None: # pylint: disable=super-init-not-called
        self.library = pil
        self._c = pil.c
        error = ctypes.create_string_buffer(ERROR_BYTES)
        self._vb = ctypes.c_void_p(self._c.vb_create_iss(load.text(load.load(image)).encode(), error, ERROR_BYTES))
        if not self._vb:
            raise UserError(f"{image}: {error.value.decode(errors='replace')}")

    @property
    def has_names(self) -> bool:
        """Whether the image says where the drive's variables are: without them no signals "fw.*" and no comparison."""
        return bool(self._c.vb_iss_has_names(self._vb))

    def lock_step(self, on: bool) -> None:
        """Compare with the host's firmware (the default) or not, from the next power-up on."""
        self._c.vb_iss_lock_step(self._vb, int(on))

    def difference(self) -> str:
        """Where target and host first differed; "" if nowhere."""
        return self._c.vb_iss_difference(self._vb).decode()

    def peek(self, address: int) -> int:
        """The 16-bit word at an address of data memory."""
        return self._c.vb_iss_peek(self._vb, address)

    def variable(self, name: str, count: int) -> list[int]:
        values = (ctypes.c_int16 * count)()
        self._check(self._c.vb_iss_read(self._vb, name.encode(), values, count))
        return list(values)

    def write_variable(self, name: str, value: int) -> None:
        self._check(self._c.vb_iss_write(self._vb, name.encode(), (ctypes.c_int16 * 1)(value), 1))

    def _probe(self, action: str, name: str, value: Any) -> int:
        return getattr(self._c, f"vb_iss_param_{action}")(self._vb, name.encode(), value)


@dataclass(frozen=True)
class Cycles:
    """What the core has counted in a run."""

    isr_count: float
    isr_cycles_min: float
    isr_cycles_mean: float
    isr_cycles_max: float
    latency_cycles_min: float
    latency_cycles_mean: float
    latency_cycles_max: float
    cycles: float
    instructions: float
    stack_bytes: float
    resets: float


@dataclass
class PilRun:
    """A scenario that ran on the target image: the run itself, the cycles, and the comparison with the host's firmware."""

    run: Run
    cycles: Cycles
    ticks: int
    differences: int
    first_difference: str
    """tick, signal and values; "" if target and host agreed in all ticks"""
    has_names: bool = True
    """whether the image said where the drive's variables are"""


def check_image(pil: PilLibrary, image: Path) -> bool:
    """Whether the image has names; a damaged or foreign one is a UserError before anything else looks at it."""
    with contextlib.closing(PilBoard(pil, image)) as board:
        return board.has_names


def without_names(job: simulate.Job) -> simulate.Job:
    """The job for an image that does not say where its variables are: what the plant and the registers tell."""
    return dataclasses.replace(job, signals=[name for name in job.signals if not name.startswith(FIRMWARE)], variables={})


def run(job: simulate.Job, image: Path, report: Callable[[float], None]) -> PilRun:
    """Run a job, prepared with a library() of the same defines, on an image; one a process."""
    pil = PilLibrary(job.library)
    with simulate.using(PilBoard(pil, image), job) as board:
        result = simulate.simulate_on(job if board.has_names else without_names(job), pil, board, report)
        result.order_rows = 1
        cycles = Cycles(**{name: board.get(f"cpu.{name}") for name in Cycles.__dataclass_fields__})
        return PilRun(result, cycles, int(board.get("pil.ticks")), int(board.get("pil.differences")), board.difference(),
                      board.has_names)
