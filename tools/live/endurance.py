"""`make live-endurance`: the page of make live in Chromium for minutes, while the motor turns and the scope runs: what the server takes beside the board, whether
memory grows, how many frames a second each tab shows.

    python3 -m tools.live.endurance [--minutes 10] [--tabs 2]"""

import argparse
import contextlib
import json
import math
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.bench.board import Board
from tools.common import command_line, paths
from tools.common.errors import UserError
from tools.common.progress import Progress

from . import browser
from .pace import FRAMES_PER_S

SHARE_MOST = 0.15
"""Of a core, that the server takes beside the board."""
GROWTH_MOST_MB = 4.0
"""Of the server, and of each tab after its garbage is collected; from WARM_S on."""
WARM_S = 150.0
"""Until the recording has its two minutes, and the curves and the log all their rows."""
SIZE = (1400, 900)
LOOK_S, ROW_S, START_S = 1.0, 30.0, 20.0
SERVED = "--served"
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
POT, TURNING = 0.5, "document.querySelector('#states .now')?.dataset.state === 'CLOSED'"


@dataclass(frozen=True)
class Row:
    """How things stood; the counts are since the start."""

    at_s: float
    board_s: float
    """processor time of the simulated board"""
    process_s: float
    """of the whole server, with the board"""
    server_mb: float
    tabs_mb: tuple[float, ...]
    frames: tuple[int, ...]


@dataclass(frozen=True)
class Found:
    """Of two rows, what has been between them."""

    server: float
    board: float
    frames_per_s: float
    """of the slowest tab"""

    @staticmethod
    def of(first: Row, last: Row) -> "Found":
        """Shares of a core."""
        seconds, board_s = last.at_s - first.at_s, last.board_s - first.board_s
        return Found((last.process_s - first.process_s - board_s) / seconds, board_s / seconds, min(b - a for a, b in zip(first.frames, last.frames)) / seconds)


def growth_mb(rows: list[Row]) -> float:
    """Of what has grown most, server or tab: from the median of the first third of the rows to that of the last. What a tab has just got makes single ones differ."""
    third = max(1, len(rows) // 3)
    early, late = ([statistics.median(sizes) for sizes in zip(*((row.server_mb, *row.tabs_mb) for row in part))] for part in (rows[:third], rows[-third:]))
    return max(b - a for a, b in zip(early, late))


def failures(rows: list[Row]) -> list[str]:
    """What is not as it must be; growth is judged of what is left after WARM_S."""
    whole, warm = Found.of(rows[0], rows[-1]), [row for row in rows if row.at_s >= rows[0].at_s + WARM_S]
    found = []
    if whole.server > SHARE_MOST:
        found.append(f"the server takes {whole.server:.1%} of a core beside the board, more than {SHARE_MOST:.0%}")
    if round(whole.frames_per_s, 1) < FRAMES_PER_S:
        found.append(f"a tab shows {whole.frames_per_s:.1f} frames a second, less than {FRAMES_PER_S}")
    if len(warm) > 1 and (grown_mb := growth_mb(warm)) > GROWTH_MOST_MB:
        found.append(f"memory has grown by {grown_mb:.1f} MB, more than {GROWTH_MOST_MB:g}")
    return found


# ---- the server, in a process of its own -----------------------------------------------------------------------------------------
def _served() -> int:
    """make live, which tells on its second output what it takes."""
    from . import __main__ as live
    board_s, run = [0.0], Board.run

    def timed(board: Board, periods: int) -> None:
        begun_s = time.thread_time()
        run(board, periods)
        board_s[0] += time.thread_time() - begun_s

    def tell() -> None:
        while True:
            resident_mb = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE_BYTES / 1e6
            print(json.dumps([time.monotonic(), board_s[0], time.process_time(), resident_mb]), file=sys.stderr, flush=True)
            time.sleep(LOOK_S)
    Board.run = timed # type: ignore[method-assign]
    threading.Thread(target=tell, daemon=True).start()
    return live.main(["--listen", "0"])


class Server:
    """That process; `told` is what it has said last."""

    def __init__(self) -> None:
        self.process = subprocess.Popen([sys.executable, "-m", "tools.live.endurance", SERVED], cwd=paths.ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.told: list[float] = []
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().removeprefix("open ").strip()
        if not self.url:
            raise UserError("the server has ended", "make live-endurance", "see what make live says")
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            with contextlib.suppress(ValueError):
                self.told = json.loads(line)

    def end(self) -> None:
        self.process.terminate()
        self.process.wait()


# ---- the tabs ----------------------------------------------------------------------------------------------------------------
def _opened(driver: Any, url: str, count: int) -> list[str]:
    """So many windows, in sight all of them; in the first one the motor is started and the scope, too."""
    browser.resize(driver, *SIZE)
    driver.get(url)
    _until(driver, "window.eval('foc33.frames') > 2", "no frames come")
    for command in (f"link.send({{ set: ['input.pot', {POT}] }})", "link.send({ press: 'S2' }), link.send({ release: 'S2' })"):
        driver.execute_script("window.eval(arguments[0])", command)
    _until(driver, TURNING, "the motor does not turn")
    driver.execute_script("window.eval(\"views.scope.apply({ mode: 'auto' })\")")
    for _ in range(count - 1):
        driver.switch_to.new_window("window")
        browser.resize(driver, *SIZE)
        driver.get(url)
        _until(driver, "window.eval('foc33.frames') > 2", "no frames come")
    return driver.window_handles


def _until(driver: Any, condition: str, otherwise: str) -> None:
    end_s = time.monotonic() + START_S
    while not driver.execute_script(f"return {condition}"):
        if time.monotonic() > end_s:
            raise UserError(otherwise, "make live-endurance", "look at it with make live")
        time.sleep(0.05)


def _row(driver: Any, tabs: list[str], server: Server) -> Row:
    """At this moment; the garbage of the tabs is collected first."""
    sizes, frames = [], []
    for tab in tabs:
        driver.switch_to.window(tab)
        driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
        sizes.append(driver.execute_cdp_cmd("Runtime.getHeapUsage", {})["usedSize"] / 1e6)
    told_s = server.told[0] if server.told else math.nan
    while not server.told or server.told[0] == told_s: # the frames of the same moment
        time.sleep(0.01)
    at_s, board_s, process_s, server_mb = server.told
    for tab in tabs:
        driver.switch_to.window(tab)
        frames.append(driver.execute_script("return window.eval('foc33.frames')"))
    return Row(at_s, board_s, process_s, server_mb, tuple(sizes), tuple(frames))


def rows(minutes: float, tabs: int) -> Iterator[Row]:
    """One at the start, then every ROW_S, then the last."""
    driver = browser.start()
    try:
        server = Server()
        try:
            handles = _opened(driver, server.url, tabs)
            first, begun_s = _row(driver, handles, server), time.monotonic()
            yield first
            while (left_s := 60.0 * minutes - (time.monotonic() - begun_s)) > 0.0:
                time.sleep(min(left_s, ROW_S))
                if server.process.poll() is not None:
                    raise UserError("the server has ended", "make live-endurance", "see what make live says")
                row = _row(driver, handles, server)
                if row.at_s > first.at_s:
                    yield row
        finally:
            server.end()
    finally:
        driver.quit()


def text(row: Row, before: Row) -> str:
    """A line of the table."""
    found = Found.of(before, row)
    return f"{found.server:14.1%}{found.board:9.1%}{row.server_mb:11.1f} MB  " + " ".join(f"{size:6.1f} MB" for size in row.tabs_mb) + f"{found.frames_per_s:10.1f}"


def _parser() -> argparse.ArgumentParser:
    parser = command_line.Parser(prog="python3 -m tools.live.endurance", description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", default="10", help="how long; default 10")
    parser.add_argument("--tabs", default="2", help="how many, in windows of their own; default 2")
    parser.set_defaults(command=_run)
    return parser


def _number(text_: str, name: str, low: float, high: float) -> float:
    with contextlib.suppress(ValueError):
        if low <= (value := float(text_)) <= high:
            return value
    raise UserError(f"'{text_}' is impossible", name, f"choose {low:g} .. {high:g}")


def _run(options: argparse.Namespace) -> int:
    minutes, tabs = _number(options.minutes, "MINUTES", 0.05, 1440.0), round(_number(options.tabs, "TABS", 1.0, 8.0))
    found: list[Row] = []
    with Progress("live-endurance", math.ceil(60.0 * minutes / ROW_S), unit="rows") as progress:
        for row in rows(minutes, tabs):
            if found:
                progress(1)
            found.append(row)
    print(f"{'server beside the board':>14}  board     memory  of the tabs   frames a second")
    for before, row in zip(found, found[1:]):
        print(f"{row.at_s - found[0].at_s:7.0f} s" + text(row, before))
    whole, failed = Found.of(found[0], found[-1]), failures(found)
    print(f"in all: server {whole.server:.1%} of a core beside the board's {whole.board:.1%}, {whole.frames_per_s:.1f} frames a second in the slowest of {tabs} tabs"
          + ("" if found[-1].at_s - found[0].at_s > 2.0 * WARM_S else f"; growth is judged from {2.0 * WARM_S / 60.0:g} minutes on"))
    print(f"load of this machine: {os.getloadavg()[1]:.1f} of {os.cpu_count()} cores in the last five minutes")
    for line in failed:
        print(f"! {line}")
    return 1 if failed else 0


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return _served() if (arguments or sys.argv[1:]) == [SERVED] else command_line.main(_parser, arguments)


if __name__ == "__main__":
    sys.exit(main())
