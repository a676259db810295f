"""Progress: nothing for what is quick, lines where nobody looks, a bar on a terminal; and no command of the project is silent for long."""

import os
import pty
import re
import subprocess
import sys

import pytest
from support import LIBRARY, refused

from tools.common import command_line, paths, progress

SLOW = ["sh", "-c", "sleep 1.5"]
LOUD = {name: value for name, value in os.environ.items() if name != "FOC33_QUIET"}


@pytest.fixture
def impatient(monkeypatch):
    """Lines come at once; the clock is ours."""
    now = [0.0]
    monkeypatch.delenv("FOC33_QUIET", raising=False)
    monkeypatch.setattr(progress.Progress, "next_s", 3.0)
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_the_first_line_comes_after_three_seconds_and_the_next_ten_later(impatient, capsys):
    with progress.Progress("starts", 40.0) as bar:
        for second in range(16):
            impatient[0] = float(second)
            bar(1.0)
    out, error = capsys.readouterr()
    assert (out, error) == ("", "  starts: 10 %, 4 of 40 s of motor time\n  starts: 35 %, 14 of 40 s of motor time\n")


@pytest.mark.parametrize("quiet, variable", [(True, ""), (False, "1")])
def test_it_is_silent_when_asked_to_be(impatient, monkeypatch, capsys, quiet, variable):
    monkeypatch.setenv("FOC33_QUIET", variable)
    with progress.Progress("starts", 40.0, quiet) as bar:
        impatient[0] = 100.0
        bar(1.0)
    assert capsys.readouterr() == ("", "")


def test_steps_that_are_short_by_themselves_have_one_clock(impatient, capsys):
    for number in range(16):
        with progress.Progress(f"step {number}", 1.0) as bar:
            impatient[0] += 1.0
            bar(1.0)
    assert re.findall(r"  step (\d+): 100 %", capsys.readouterr().err) == ["2", "12"]


def test_more_than_all_is_all_and_a_step_may_rename_itself(impatient, capsys):
    with progress.Progress("search", 18.0, unit="entries") as bar:
        impatient[0] = 4.0
        bar.reach(20.0, "search: 5000 rpm")
    assert capsys.readouterr().err == "  search: 5000 rpm: 100 %, 18 of 18 entries\n"


def wrapped(*arguments: str, first_s: float = 0.5, **more) -> subprocess.CompletedProcess:
    program = f"import sys; from tools.common import command_line, progress; progress.Progress.next_s += {first_s} - progress.FIRST_S\n" \
              "progress.BEAT_S = 0.1; sys.exit(command_line.run(lambda: progress._run(sys.argv[1:])))"
    return subprocess.run([sys.executable, "-c", program, *arguments], cwd=paths.ROOT, env=LOUD, text=True, check=False,
                          **{"capture_output": True} | more)


def test_a_silent_command_is_said_to_run_still_and_its_exit_code_is_kept():
    done = wrapped("proof", "sh", "-c", "sleep 1.5; echo done; exit 3")
    assert (done.returncode, done.stdout) == (3, "done\n") and re.fullmatch(r"  proof: \d s\n", done.stderr)
    quick = wrapped("proof", "true", first_s=60.0)
    assert (quick.returncode, quick.stdout, quick.stderr) == (0, "", "")


def test_on_a_terminal_it_is_one_line_that_goes_away(terminals):
    pytest.importorskip("tqdm")
    ours, theirs = pty.openpty()
    done = wrapped("proof", *SLOW, capture_output=False, stderr=theirs, stdout=subprocess.PIPE)
    os.close(theirs)
    shown = os.read(ours, 65536).decode()
    os.close(ours)
    assert done.returncode == 0 and re.search(r"\rproof 00:0[01]", shown) and "\n" not in shown
    assert not shown.rpartition("\r")[0].rpartition("\r")[2].strip(), "the line is wiped at the end"


def test_make_s_jobs_reach_a_wrapped_make(tmp_path):
    (tmp_path / "Makefile").write_text("all:\n\t+@PYTHONPATH='$(ROOT)' '$(PY)' -m tools.common.progress x $(MAKE) -f inner\n", encoding="utf-8")
    (tmp_path / "inner").write_text("all: a b\na b:\n\t@echo $@\n", encoding="utf-8")
    done = subprocess.run(["make", "-s", "-j2", f"ROOT={paths.ROOT}", f"PY={sys.executable}"], cwd=tmp_path, capture_output=True,
                          text=True, check=False)
    assert (done.returncode, sorted(done.stdout.split()), done.stderr) == (0, ["a", "b"], "")


@pytest.mark.parametrize("arguments, said", [
    (["proof"], "no command"), (["proof", "no-such-command"], "cannot run no-such-command (No such file or directory), proof")])
def test_what_cannot_be_run_is_one_line(capfd, arguments, said):
    code = command_line.run(lambda: progress._run(arguments))
    refused((code, *capfd.readouterr()), said)


WRAPPED = {"proof.mk": "proof.py", "mutate.mk": "mutate.py", "static.mk": "static.py|ubsan.sh", "coverage.mk": "MAKE", "test-target.mk": "call build"}


@pytest.mark.parametrize("file, program", WRAPPED.items(), ids=WRAPPED)
def test_every_long_step_of_make_is_wrapped(file, program):
    lines = [line for line in (paths.ROOT / "tools/make" / file).read_text(encoding="utf-8").splitlines()
             if line.startswith("\t") and re.search(program, line) and "need.sh" not in line and "format.py" not in line]
    assert lines and all("$(still) " in line or line.startswith("\t$(call build,") and line.endswith(",building the tests)") for line in lines)
    assert "$(if $2,$(still) '$2') $(MAKE)" in (paths.ROOT / "Makefile").read_text(encoding="utf-8")


@pytest.mark.parametrize("module, arguments, titles", [
    ("tools.bench", ["run", "smoke", "--library", str(LIBRARY)], ["smoke", "plots"]),
    ("tools.bench", ["table2", "--library", str(LIBRARY)], ["table2"]),
    ("tools.bench", ["rated", "--motor", "hurst_dmb0224c10002", "--userparams", "."], ["building vboard", "firmware", "rated"]),
    ("tuning", ["tune", "hurst_dmb0224c10002"], ["tuning hurst_dmb0224c10002"])])
def test_every_long_step_of_a_command_tells_how_far_it_is(tmp_path, module, arguments, titles):
    program = f"import sys; from tools.common import progress; progress.Progress.next_s = progress.EVERY_S = 0.0; progress.BEAT_S = 0.01\n" \
              f"from {module} import cli; sys.exit(cli.main(sys.argv[1:]))"
    done = subprocess.run([sys.executable, "-c", program, *arguments, "--out", str(tmp_path / "out")], cwd=paths.ROOT, env=LOUD, capture_output=True,
                          text=True, check=False)
    told = {line.partition(":")[0] for line in done.stderr.splitlines()}
    assert done.returncode == 0 and [title for title in titles if not any(line.startswith(f"  {title}") for line in told)] == [], done.stderr
