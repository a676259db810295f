"""What the front end's tests share: scenario texts, made-up traces and runs, and calls of the command line."""

import contextlib
import csv
import io
import json
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest

from tools.bench import cli
from tools.common import paths
from tools.common.errors import UserError
from tools.bench.run import Run
from tools.bench.scenario import Scenario
from tools.bench.scenario_file import read
from tools.bench.simulate import SIGNALS
from tools.common.toml_file import Document
from tools.common.trace import Trace

PERIOD_S = 50e-6
STATES = {0: "CALIBRATE", 1: "STOPPED", 2: "BOOTSTRAP", 3: "ALIGN", 4: "RAMP", 5: "CLOSED", 6: "STOPPING", 7: "FAULT", 8: "CATCH", 9: "BRAKE"}
FAULTS = {0: "NONE", 1: "OVERCURRENT_HW", 3: "OVERVOLTAGE", 6: "STALL"}
LIBRARY = paths.ROOT / "build" / "host" / "libvboard.so"

MOTORS = ("anaheim_bly172s_24v_4000", "hurst_dma0204024b101", "hurst_dmb0224c10002", "ipm_4pp_24v_2000", "linix_45zwn24_40",
          "maxon_ec45flat_30w_24v", "spindle_7pp_24v_10000", "trinamic_qbl4208_41_04_006")
BOARDS = ("mclv", "mclv2", "mclv_40khz")
"""The project's own files. Tests are about these: what a user adds to tuning/motors or tuning/boards may be anything."""

SCENARIO = """
title = "a test"
motor = "hurst_dmb0224c10002"
board = "mclv"
duration_s = 2.0
"""


def document(text: str) -> Document:
    """A document with this text, in a file that is gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "test.toml"
        path.write_text(text, encoding="utf-8")
        return Document(path)


def scenario(more: str = "") -> Scenario:
    """A scenario of two seconds with more lines at its end."""
    return read(document(SCENARIO + more))


def trace(duration_s: float = 2.0, **signals) -> Trace:
    """Every recorded signal at 0, but for those given: a number, or a function of time. Dots of names are written as "__"."""
    time_s = np.arange(1, round(duration_s / PERIOD_S) + 1) * PERIOD_S
    data = np.zeros((len(SIGNALS), len(time_s)), dtype=np.float32)
    for name, value in signals.items():
        data[SIGNALS.index(name.replace("__", "."))] = value(time_s) if callable(value) else value
    return Trace(list(SIGNALS), time_s, data)


def step(*pairs: tuple[float, float]):
    """A function of time with a value from each moment on: step((0, 1), (1.5, 5)) is 1, and 5 from 1.5 s."""
    def value(time_s: np.ndarray) -> np.ndarray:
        result = np.full(len(time_s), pairs[0][1], dtype=np.float64)
        for from_s, number in pairs:
            result[time_s >= from_s - 1e-9] = number
        return result
    return value


def run(more: str = "", recorded: Trace | None = None, **signals) -> Run:
    """A finished run of scenario(more) with a made-up trace."""
    return Run(scenario(more), trace(**signals) if recorded is None else recorded, [(0.0, "power-up")], [], STATES, FAULTS,
               params={"MAXIMUM_CURRENT_A": 2.75}, wall_s=0.1, motor_s=2.0)


def command(*arguments: str, main=cli.main) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command line."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = main(list(arguments))
    return code, out.getvalue(), error.getvalue()


def small_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, **changes: str) -> tuple[int, str, str, dict, list[dict]]:
    """A sweep with a smaller table: exit code, stdout, stderr, summary and rows of the CSV file; its folder is tmp_path/out."""
    lines = (paths.TABLES / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    lines = [f"{key} = {changes.pop(key)}" if (key := line.split(" = ")[0]) in changes else line for line in lines]
    assert not changes
    (tmp_path / "tables").mkdir()
    (tmp_path / f"tables/{name}.toml").write_text("\n".join(lines), encoding="utf-8")
    monkeypatch.setattr(paths, "TABLES", tmp_path / "tables")
    code, out, error = command(name, "--out", str(tmp_path / "out"), "--quiet")
    data = json.loads((tmp_path / "out/summary.json").read_text(encoding="utf-8"))
    with (tmp_path / f"out/{name}.csv").open(encoding="utf-8") as file:
        return code, out, error, data, list(csv.DictReader(file))


def refusal(call, *parts: str) -> str:
    """The line with which `call` refuses bad input; it holds every part."""
    with pytest.raises(UserError) as caught:
        call()
    line = str(caught.value)
    assert "\n" not in line and [part for part in parts if part not in line] == [], line
    return line


def refused(result: tuple[int, str, str], *parts: str) -> None:
    """A command line that ended as after bad input: exit code 2 and one line, which holds every part."""
    code, out, error = result
    assert (code, out) == (2, ""), error
    assert re.fullmatch(r"foc33: [^\n]+\n", error) and [part for part in parts if part not in error] == [], error
