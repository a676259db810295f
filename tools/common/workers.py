"""Simulations in processes of their own: the firmware is one set of globals, so each run needs a fresh process."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any

from .errors import UserError


_ENDING = {signal.SIGINT, signal.SIGTERM}
_ended: list[int] = []
NO_MEMORY = "close other programs"


def end(number: int, frame: Any) -> None:
    """Signal handler: ends run_all(), even where Python swallows the exception (in a callback of its own)."""
    _ended.append(number)
    raise KeyboardInterrupt


@dataclass
class _Running:
    number: int
    process: Any
    pipe: Any


Report = Callable[[float], None]


def processors() -> int:
    """Those that this program may use."""
    return (len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()) or 1


def run_all(jobs: list[Any], work: Callable[[Any, Report], Any], progress: Report, processes: int | None = None) -> list[Any]:
    """Results of work(job, report) for every job, in order, with at most `processes` at a time (default: one per processor).

    `work` runs in a fresh process and calls report(seconds) now and then; `progress` gets the same here. A UserError in a process is
    raised here; a process that dies is an error too. Whatever happens, no process is left behind.
    """
    context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    limit = processes or processors()
    results: list[Any] = [None] * len(jobs)
    waiting = list(enumerate(jobs))[::-1]
    running: dict[Any, _Running] = {}
    try:
        while waiting or running:
            while waiting and len(running) < limit:
                _start(context, work, waiting.pop(), running)
            for pipe in wait(list(running)):
                if _ended:
                    raise KeyboardInterrupt
                _receive(running, pipe, results, progress)
    finally:
        for item in running.values():
            item.process.kill() # not terminate: Python may swallow an exception raised by a signal while it forks
            item.process.join()
    return results


def _start(context: Any, work: Any, numbered_job: tuple[int, Any], running: dict[Any, _Running]) -> None:
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_child, args=(work, numbered_job[1], here, there), daemon=True)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING) # a process that runs is one that run_all() knows
    try:
        process.start()
        there.close()
        running[here] = _Running(numbered_job[0], process, here)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _child(work: Any, job: Any, other_end: Any, pipe: Any) -> None:
    other_end.close() # so that the pipe breaks if the parent is gone
    signal.signal(signal.SIGINT, signal.SIG_IGN) # the parent ends it
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
    try:
        pipe.send(("result", work(job, lambda seconds: pipe.send(("progress", seconds)))))
    except UserError as error:
        pipe.send(("error", UserError(str(error))))
    except MemoryError:
        pipe.send(("error", UserError("no memory is left", "", NO_MEMORY)))
    except OSError as error: # a full disk is the caller's matter
        pipe.send(("error", error))


def _died(code: int) -> UserError:
    if code == -signal.SIGKILL:
        return UserError("the simulation was killed", "most often for want of memory", NO_MEMORY)
    return UserError("the simulation ended by itself", f"exit code {code}", "a crash in the virtual board or the firmware; build with SAN=1 to find it")


def _receive(running: dict[Any, _Running], pipe: Any, results: list[Any], progress: Callable[[float], None]) -> None:
    item = running[pipe]
    try:
        kind, value = pipe.recv()
    except EOFError:
        item.process.join()
        raise _died(item.process.exitcode) from None
    if kind == "progress":
        progress(value)
        return
    if kind == "error":
        raise value
    results[item.number] = value
    item.process.join()
    pipe.close()
    del running[pipe]
