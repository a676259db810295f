"""What make test counts: Python suites and Unity executables, also those that crash, stop early, hang, do not build or run no test."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

TEST = Path(__file__).resolve().parents[1]
TWO_PASS = "f.c:1:test_a:PASS\nf.c:2:test_b:PASS\n"
HANGS = "import subprocess\ndef test_a(): subprocess.run(['sh', '-c', 'sleep 3; touch left'])\n"

# Name: what the executable prints of its two tests and how it ends; passed, failed; the reason that is shown.
UNITY = {
    "good": ("f.c:1:test_a:PASS\nf.c:2:test_b:IGNORE: later\n2 Tests 0 Failures 1 Ignored", "exit 0", 1, 0, "IGNORED {}: test_b: later"),
    "fails": ("f.c:1:test_a:PASS\nf.c:2:test_b:FAIL: Expected 3 Was 4\n    and more\n2 Tests 1 Failures 0 Ignored", "exit 1", 1, 1,
              "f.c:2: Expected 3 Was 4\n    and more"),
    "crashes": ("f.c:1:test_a:PASS", "kill -SEGV $$", 1, 1, "crashed: signal 11, after test_a"),
    "stops": ("f.c:1:test_a:PASS", "exit 0", 1, 1, "stopped early (exit 0), without its total, after test_a"),
    "silent": ("", "exit 0", 0, 2, "stopped early (exit 0), without its total, after no test"),
    "no_total": (TWO_PASS, "exit 0", 2, 1, "stopped early (exit 0), without its total, after test_b"),
    "ends_badly": (f"{TWO_PASS}2 Tests 0 Failures 0 Ignored", "exit 3", 2, 1, "ended with exit 3 though no test failed"),
    "other_total": (f"{TWO_PASS}3 Tests 0 Failures 0 Ignored", "exit 0", 2, 1, "is not what it printed: 2 tests, 0 failures, 0 ignored"),
    "not_built": (f"{TWO_PASS}2 Tests 0 Failures 0 Ignored", "exit 0", 0, 1, "FAILED {}: does not build; the compiler's message is above"),
}
# Name: the test file; passed, failed; the reason.
PYTHON = {
    "good": ("import pytest\ndef test_a(): pass\ndef test_b(): pytest.skip('no xc16-gcc')\n", 1, 0, "IGNORED {}: test_b: no xc16-gcc"),
    "crashes": ("import os, signal\ndef test_a(): pass\ndef test_b(): os.kill(os.getpid(), signal.SIGSEGV)\ndef test_c(): pass\n", 1, 1,
                "FAILED {}: crashed: signal 11, at test_b"),
    "leaves": ("import os\ndef test_a(): os._exit(0)\n", 0, 1, "FAILED {}: crashed: exit 0, at test_a"),
    "empty": ("", 0, 1, "FAILED {}: ran no test"),
    "skipped": ("import pytest\ndef test_a(): pytest.skip('why')\n", 0, 1, "FAILED {}: ran no test"),
    "broken": ("broken\n", 0, 1, "NameError: name 'broken' is not defined"),
    "fails": ("def test_a(): assert 1 == 2\n", 0, 1, "assert 1 == 2"),
    "fixture": ("import pytest\n@pytest.fixture\ndef f():\n    yield\n    assert 0, 'in the end'\ndef test_a(f): pass\n", 1, 1, "in the end"),
}


def write_suites(root: Path) -> None:
    for folder in ("test/unit", "build/test/unit", "made/unit"):
        (root / folder).mkdir(parents=True)
    (root / "test/pytest.ini").write_text("[pytest]\n")
    for name, (output, end, *_) in UNITY.items():
        (root / f"test/unit/test_c_{name}.c").touch()
        executable = root / f"build/test/unit/test_c_{name}"
        Path(f"{executable}_runner.c").write_text("".join(f'  run_test_params_arr[0].name = "{test}";\n' for test in ("test_a", "test_b")))
        executable.write_text(f"#!/bin/sh\ncat <<'END'\n{output}\nEND\n{end}\n")
        executable.chmod(0o755)
        if name != "not_built":
            (root / f"made/unit/test_c_{name}").touch()
    for name, (text, *_) in PYTHON.items():
        (root / f"test/unit/test_py_{name}.py").write_text(text)
        (root / f"made/unit/test_py_{name}").touch()


def run(root: Path, *options: str | Path) -> tuple[int, str]:
    """Exit code and output of a run of all suites in the folder."""
    done = subprocess.run([sys.executable, "-m", "pytest", "-p", "unity_suites", "-p", "side_by_side", "-p", "no:cacheprovider", "-qq", "-rN", "--capture=sys",
                           "--continue-on-collection-errors", "--basetemp", root / "tmp", "--jobs", "2", *options, *sorted(root.glob("test/unit/test_*"))],
                          env=os.environ | {"PYTHONPATH": str(TEST)}, cwd=root, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False)
    return done.returncode, done.stdout


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, str, dict]:
    """Exit code, output and summary of a run of all these suites."""
    root = tmp_path_factory.mktemp("suites")
    write_suites(root)
    return *run(root, "--made", root / "made", "--summary", root / "summary.json"), json.loads((root / "summary.json").read_text())


@pytest.mark.parametrize(("suite", "passed", "failed", "reason"), [
    *((f"unit/test_c_{name}", *row[2:]) for name, row in UNITY.items()), *((f"unit/test_py_{name}", *row[1:]) for name, row in PYTHON.items())])
def test_a_suite_is_counted_and_its_failure_explained(result, suite, passed, failed, reason):
    output = result[1]
    assert reason.format(suite) in output
    assert re.search(rf"^  test {suite} +{passed} passed{f', {failed} FAILED' if failed else ''}  \(", output, re.MULTILINE), output


def test_the_last_line_and_the_summary_hold_the_sums(result):
    code, output, summary = result
    rows = [row[-3:-1] for row in (*UNITY.values(), *PYTHON.values())]
    passed, failed = (sum(row[n] for row in rows) for n in (0, 1))
    assert (code, output.splitlines()[-1]) == (1, f"{passed} passed, {failed} failed")
    assert summary == {"passed": passed, "failed": failed, "skipped": 3}


def test_the_dearest_suites_are_named_with_their_time_dearest_first(result):
    found = re.findall(r"^  unit/test_\w+ +(\d+\.\d) +\d+\.\d$", result[1].partition("dearest suites, ")[2], re.MULTILINE)
    assert len(found) == 10 and found == sorted(found, key=float, reverse=True)


def test_at_the_time_limit_a_suite_ends_with_all_that_it_has_started(tmp_path):
    (tmp_path / "test/unit").mkdir(parents=True)
    (tmp_path / "test/pytest.ini").write_text("[pytest]\n")
    (tmp_path / "test/unit/test_hangs.py").write_text(HANGS)
    begin = time.monotonic()
    code, output = run(tmp_path, "--time-limit", "1")
    assert (code, output.splitlines()[-1]) == (1, "0 passed, 1 failed")
    assert "FAILED unit/test_hangs: no end after 1 s, at test_a" in output
    time.sleep(max(0.0, begin + 3.5 - time.monotonic()))
    assert not (tmp_path / "left").exists()


def test_one_suite_that_waits_runs_beside_those_that_work(tmp_path):
    (tmp_path / "test/unit").mkdir(parents=True)
    (tmp_path / "test/pytest.ini").write_text("[pytest]\nmarkers = waits\n")
    spans = "import time, pathlib\ndef test_a():\n    begin = time.monotonic()\n    time.sleep(0.5)\n    pathlib.Path('{}').write_text(f'{{begin}} {{time.monotonic()}}')\n"
    for name in ("a_waits", "b_waits", "c_works", "d_works", "e_works"):
        mark = "import pytest\npytestmark = pytest.mark.waits\n" if "waits" in name else ""
        (tmp_path / f"test/unit/test_{name}.py").write_text(mark + spans.format(name))
    code, output = run(tmp_path)
    assert (code, output.splitlines()[-1]) == (0, "5 passed, 0 failed"), output
    span = {name: [float(part) for part in (tmp_path / name).read_text().split()] for name in ("a_waits", "b_waits", "c_works", "d_works", "e_works")}

    def together(one: str, other: str) -> bool:
        return span[one][0] < span[other][1] and span[other][0] < span[one][1]
    assert together("a_waits", "c_works") and together("a_waits", "d_works") and together("c_works", "d_works")
    assert not together("a_waits", "b_waits") and not (together("c_works", "e_works") and together("d_works", "e_works"))


def test_while_no_suite_ends_it_says_which_ones_run(tmp_path):
    (tmp_path / "test/unit").mkdir(parents=True)
    (tmp_path / "test/pytest.ini").write_text("[pytest]\n")
    (tmp_path / "test/unit/test_slow.py").write_text("import time\ndef test_a(): time.sleep(2.6)\n")
    code, output = run(tmp_path, "--told-every", "1")
    assert (code, re.findall(r"(?m)^  still: unit/test_slow (\d) s$", output)[:1]) == (0, ["1"]), output
    assert "still" not in run(tmp_path)[1]


def test_a_proof_that_does_not_exist_is_named_even_beside_one_that_does():
    done = subprocess.run([sys.executable, TEST / "proof/proof.py", "tick", "nix"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stdout == "" and done.stderr.startswith("foc33: no such proof, nix: use one of ")
