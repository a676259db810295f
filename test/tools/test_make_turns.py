"""Two makes at once in one tree, and two programs that write the same result: they take turns or have folders of their own."""

import fcntl
import io
import json
import multiprocessing
import os
import shlex
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from xc16 import MAKES_OWN
from test_make_input import copy

from tools.bench import command_common
from tools.common import output, paths

# Compiles like gcc; writes down if another make compiles at the same time. $1 says which make.
WATCHING = """#!/bin/sh
maker=$1; shift
touch "$BUSY/$maker.$$"
ls "$BUSY" | grep -v "^$maker\\." >>"$BUSY.overlaps"
gcc "$@"; status=$?
rm "$BUSY/$maker.$$"
exit $status
"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory) -> Path:
    return copy(tmp_path_factory.mktemp("tree"))


def together(root: Path, *lines: list[str], **more: str) -> list[subprocess.CompletedProcess]:
    """What makes say that are started at the same time."""
    environment = {name: value for name, value in os.environ.items() if name not in MAKES_OWN} | more
    with ThreadPoolExecutor(len(lines)) as pool:
        return list(pool.map(lambda words: subprocess.run(["make", *words], cwd=root, env=environment, capture_output=True, text=True, check=False), lines))


def test_two_makes_do_not_compile_at_the_same_time(tree, tmp_path):
    (tmp_path / "busy").mkdir()
    (tmp_path / "cc").write_text(WATCHING, encoding="utf-8")
    (tmp_path / "cc").chmod(0o755)
    done = together(tree, *(["lib", f"CC={shlex.quote(str(tmp_path))}/cc {maker}"] for maker in ("one", "two")), BUSY=str(tmp_path / "busy"))
    assert [item.returncode for item in done] == [0, 0], [item.stdout + item.stderr for item in done]
    assert (tmp_path / "busy.overlaps").read_text(encoding="utf-8") == ""


@pytest.mark.parametrize("goal", ["lib", "vboard", "pil-library", "iss", "bench", "run SCENARIO=smoke", "test-quick ONLY=test_pi"])
def test_what_compiles_waits_for_another_make_and_says_so(tree, goal):
    for name in ("test", "build/gems"):
        if goal.startswith(("test", "bench")) and not (tree / name).exists():
            shutil.copytree(paths.ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__", ".*")) # suites write there meanwhile
    environment = {name: value for name, value in os.environ.items() if name not in MAKES_OWN}
    (tree / "build").mkdir(exist_ok=True)
    with (tree / "build/lock").open("w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        process = subprocess.Popen(["make", *goal.split()], cwd=tree, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        said = []
        while (line := process.stdout.readline()) and "waiting for another make" not in line:
            said.append(line)
        assert line and not [text for text in said if text.startswith(("  cc", "  ld", "  ar"))], said
        fcntl.flock(lock, fcntl.LOCK_UN)
    rest = process.communicate()[0]
    assert process.returncode == 0, rest


def test_two_motors_and_two_equal_runs_at_once_end_well_and_share_no_folder(tree):
    names = ["linix_45zwn24_40", "maxon_ec45flat_30w_24v", "linix_45zwn24_40"]
    done = together(tree, *(["-s", "run", f"MOTOR={name}"] for name in names))
    assert [item.returncode for item in done] == [0] * 3, [item.stderr for item in done]
    folders = [tree / f"build/run/rated-{name}" for name in names]
    for name, item, folder in zip(names, done, folders):
        assert f"results in build/run/rated-{name}/: index.html\n" in item.stdout
        data = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        assert (Path(data["motor"]).stem, data["header"]) == (name, f"build/tune/{name}/userparams.h")
    assert sorted(path.name for path in (tree / "build/run").glob("rated*")) == sorted({folder.name for folder in folders})


# ---- folders -------------------------------------------------------------------------------------------------------------
def options(**given: str) -> SimpleNamespace:
    return SimpleNamespace(**{"out": None, "motor": None, "board": None, "userparams": None} | given)


def test_a_result_is_named_after_what_was_asked_for(tmp_path):
    own, other = "hurst_dmb0224c10002", "linix_45zwn24_40"
    shutil.copy(paths.ROOT / "userparams.h", tmp_path)
    mine = [tmp_path / folder / f"{other}.toml" for folder in ("a", "b")]
    for path in mine:
        path.parent.mkdir()
        path.touch()
    names = [command_common.results("demo", own, item, defines).name for item, defines in (
        (options(), ()), (options(motor=own), ()), (options(motor=other), ()), (options(board="mclv"), ()), (options(motor=other, board="mclv"), ()),
        (options(userparams=tmp_path), ()), (options(), ["TUNING"]), (options(library=tmp_path / "host-san" / "libvboard.so"), ()),
        *((options(motor=str(path)), ()) for path in mine))]
    assert names[:5] == ["demo", "demo", f"demo-{other}", "demo-mclv", f"demo-{other}-mclv"] and names[6:8] == ["demo-tuning", "demo-san"]
    assert len(set(names)) == len(names) - 1 and all(name.startswith(f"demo-{other}-") for name in names[8:])
    assert command_common.results("demo", own, options(out=tmp_path)) == tmp_path


@pytest.mark.parametrize("name", ["a motor.toml", "it's.toml", "ä.toml", "x:y;z.toml"])
def test_a_name_that_make_or_a_shell_would_take_apart_becomes_a_plain_one(tmp_path, name):
    plain = {paths.name_of(path, home) for path in (tmp_path / name, tmp_path / "sub" / name) for home in (tmp_path, None)}
    assert len(plain) == 2 and all(item.replace("-", "").isalnum() for item in plain), plain
    assert paths.name_of(tmp_path / "plain.v2.toml", tmp_path) == "plain.v2"


# ---- one result, several writers -----------------------------------------------------------------------------------------
@pytest.mark.parametrize("exchange", [True, False])
def test_of_runs_that_end_at_once_one_result_stays_as_a_whole(tmp_path, monkeypatch, exchange):
    if not exchange:
        monkeypatch.setattr(output, "_renameat2", None)
    target = tmp_path / "demo"

    def write(number: int) -> None:
        for _ in range(50):
            with output.ResultFolder(target) as folder:
                for name in ("summary.json", "other"):
                    (folder.work / name).write_text(str(number), encoding="utf-8")
    writers = [multiprocessing.get_context("fork").Process(target=write, args=(number,)) for number in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0] * 4
    assert len({path.read_text(encoding="utf-8") for path in target.iterdir()}) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["demo"]


@pytest.mark.skipif(output._renameat2 is None, reason="the system cannot exchange two folders in one step")
def test_a_reader_always_finds_a_result(tmp_path):
    target, stop, seen = tmp_path / "demo", threading.Event(), []

    def read() -> None:
        while not stop.is_set():
            seen.append((target / "summary.json").read_text(encoding="utf-8"))
    for number in range(2):
        with output.ResultFolder(target) as folder:
            (folder.work / "summary.json").write_text(str(number), encoding="utf-8")
    with ThreadPoolExecutor(1) as pool:
        reader = pool.submit(read)
        for number in range(300):
            with output.ResultFolder(target) as folder:
                (folder.work / "summary.json").write_text(str(number), encoding="utf-8")
        stop.set()
        reader.result()
    assert len(set(seen)) > 1


def test_a_search_and_an_identification_wait_for_another_one(tmp_path, monkeypatch):
    monkeypatch.setattr(output, "ROOT", tmp_path)
    said = io.StringIO() # capsys empties what it reads, and would lose what the other thread writes meanwhile
    monkeypatch.setattr(sys, "stdout", said)
    order, begun = [], threading.Event()

    def second() -> None:
        begun.wait()
        with output.in_turn("search"):
            order.append("second")
    with ThreadPoolExecutor(1) as pool:
        with output.in_turn("search"):
            waiting = pool.submit(second)
            begun.set()
            with output.in_turn("another search"):
                pass
            latest_s = time.monotonic() + 60.0
            while said.getvalue() != "waiting for another search\n":
                assert not waiting.done() and time.monotonic() < latest_s, said.getvalue()
                time.sleep(0.001)
            order.append("first")
        waiting.result()
    assert order == ["first", "second"]
