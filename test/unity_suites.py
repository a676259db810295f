"""pytest collects test/*/test_*.c: each test of the Unity executable that make has built from it is one item, run with all the others of its file.

A test without a result of its own has failed: the executable crashed or stopped there. An executable that ends otherwise than its results
say fails too.
"""

import re
import subprocess
from functools import cached_property
from pathlib import Path

import pytest

REGISTERED = re.compile(r'\.name = "(.*)";|run_test\(\w+, "(.*)", \d+\)')  # in the runner that Unity's script has written
RESULT = re.compile(r"^(?P<where>[^:\s]\S*?:\d+):(?P<test>.*?):(?P<result>PASS|FAIL|IGNORE)(?:: ?(?P<why>.*))?$")
TOTAL = re.compile(r"^(\d+) Tests (\d+) Failures (\d+) Ignored", re.MULTILINE)


def pytest_addoption(parser) -> None:
    parser.getgroup("foc33").addoption("--build", default="build/test", metavar="FOLDER", help="where make has built the Unity executables")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> "UnitySuite | None":
    if file_path.suffix == ".c" and file_path.name.startswith("test_"):
        return UnitySuite.from_parent(parent, path=file_path)
    return None


class TestFailed(Exception):
    """A test that Unity reports as failed; the text is what it printed."""


class UnitySuite(pytest.File):
    """One C file with tests, and the executable made of it."""

    @property
    def executable(self) -> Path:
        root = self.config.rootpath
        return root.parent / self.config.option.build / self.path.relative_to(root).with_suffix("")

    def collect(self):
        runner = Path(f"{self.executable}_runner.c")
        if not self.executable.exists() or not runner.exists():
            raise self.CollectError(f"{self.executable} does not exist: build it with make test ONLY={self.path.stem}")
        for found in REGISTERED.finditer(runner.read_text(encoding="utf-8")):
            yield UnityTest.from_parent(self, name=found[1] or found[2])

    @cached_property
    def outcome(self) -> tuple[dict[str, tuple[str, str]], str]:
        """Result and text of each test, and what is wrong with the end of the executable, or ""."""
        done = subprocess.run([self.executable], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
                              cwd=self.config.rootpath.parent)
        results, test = {}, ""
        for line in done.stdout.splitlines():
            if found := RESULT.match(line):
                test = found["test"]
                results[test] = (found["result"], f"{found['where']}: {found['why']}" if found["result"] == "FAIL" else found["why"] or "")
            elif line.startswith((" ", "\t")) and results and results[test][0] == "FAIL":
                results[test] = ("FAIL", f"{results[test][1]}\n{line}")
        return results, trouble(done, [result for result, _ in results.values()], test)

    def teardown(self) -> None:
        results, wrong = self.outcome
        if wrong and len(results) == len(list(self.collect())):
            raise TestFailed(wrong)


def trouble(done: subprocess.CompletedProcess, results: list[str], last: str) -> str:
    """Why the results cannot be the whole story, or ""."""
    tail = "".join(f"\n    {line}" for line in done.stdout.splitlines()[-15:])
    failed, ignored = results.count("FAIL"), results.count("IGNORE")
    if done.returncode < 0:
        return f"crashed: signal {-done.returncode}, after {last or 'no test'}{tail}"
    total = TOTAL.search(done.stdout)
    if total is None:
        return f"stopped early (exit {done.returncode}), without its total, after {last or 'no test'}{tail}"
    if [int(number) for number in total.groups()] != [len(results), failed, ignored]:
        return f"its total, {total[0]}, is not what it printed: {len(results)} tests, {failed} failures, {ignored} ignored"
    if (done.returncode != 0) != (failed != 0):
        return f"ended with exit {done.returncode} though {failed or 'no'} test failed"
    return ""


class UnityTest(pytest.Item):
    """One test of a Unity executable."""

    parent: UnitySuite

    def runtest(self) -> None:
        results, wrong = self.parent.outcome
        result, text = results.get(self.name, ("FAIL", wrong or "has no result"))
        if result == "FAIL":
            raise TestFailed(text)
        if result == "IGNORE":
            pytest.skip(text)

    def repr_failure(self, excinfo, style=None):
        return str(excinfo.value) if excinfo.errisinstance(TestFailed) else super().repr_failure(excinfo, style)

    def reportinfo(self):
        return self.path, None, self.name
