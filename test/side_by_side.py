"""pytest --jobs N: suites (test files) side by side, each in a process of its own: one line a suite, and at the end "N passed, N failed".

One suite with the mark `waits` runs beside those, for it leaves the processor idle. A suite that ends before its last test (a crash, the time
limit), that make could not build or that runs no test has failed. Without --jobs pytest works as everywhere.
"""

import json
import os
import selectors
import signal
import time
from collections import Counter
from pathlib import Path

import pytest

DEAREST = 10 # suites that the end names with their time


def pytest_addoption(parser) -> None:
    group = parser.getgroup("foc33")
    group.addoption("--jobs", type=int, default=0, help="suites at the same time, each in its own process")
    group.addoption("--time-limit", type=float, default=900, metavar="SECONDS", help="how long a suite may take: the static checks need five minutes of two free cores")
    group.addoption("--told-every", type=float, default=10, metavar="SECONDS", help="how long it may be silent while suites run")
    group.addoption("--made", metavar="FOLDER", help="stamps of make: a suite without one could not be built")
    group.addoption("--summary", metavar="FILE", help="where to write the numbers of a whole run, for the README")


def pytest_configure(config: pytest.Config) -> None:
    if config.option.jobs:
        config.pluginmanager.register(SideBySide(config), "side_by_side_parent")


@pytest.hookimpl(hookwrapper=True)
def pytest_collect_file(file_path: Path, parent: pytest.Collector):
    outcome = yield
    made = parent.config.option.made
    if made and not Path(made, name_of(file_path, parent.config)).exists():
        outcome.force_result([NotBuilt.from_parent(parent, path=file_path)])


def name_of(path: Path, config: pytest.Config) -> str:
    """unit/test_pi for test/unit/test_pi.c."""
    return str(path.resolve().relative_to(config.rootpath).with_suffix(""))


def waits(items: list[pytest.Item]) -> bool:
    """True for a suite that leaves the processor idle."""
    return items[0].get_closest_marker("waits") is not None


class NotBuilt(pytest.File):
    """A suite that make could not build."""

    def collect(self):
        raise self.CollectError("does not build; the compiler's message is above")


class Child:
    """A process that runs one suite and sends its reports."""

    def __init__(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        self.suite = name_of(items[0].path, config)
        self.missing = [item.nodeid for item in items]
        self.waits = waits(items)
        self.start = time.monotonic()
        self.text = b""
        self.pipe, writer = os.pipe()
        self.process = os.fork()
        if self.process == 0:
            os.setpgid(0, 0)  # the time limit ends all that the suite has started
            os.close(self.pipe)
            run_child(config, items, writer)
        os.close(writer)

    def reports(self) -> list[dict] | None:
        """What has come since the last call; None at the end."""
        data = os.read(self.pipe, 1 << 16)
        *lines, self.text = (self.text + data).split(b"\n")
        return [json.loads(line) for line in lines] if data else None

    def stop(self) -> None:
        try:
            os.killpg(self.process, signal.SIGKILL)
        except ProcessLookupError:
            pass

    def end(self) -> tuple[str, float]:
        """How it ended, and the processor seconds of all that it has waited for."""
        os.close(self.pipe)
        _, status, used = os.wait4(self.process, 0)
        code = os.waitstatus_to_exitcode(status)
        return f"signal {-code}" if code < 0 else f"exit {code}", used.ru_utime + used.ru_stime


def run_child(config: pytest.Config, items: list[pytest.Item], writer: int) -> None:
    """Runs the items as pytest does and never returns. What no test captures goes nowhere."""
    class Sender:
        def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
            data = config.hook.pytest_report_to_serializable(config=config, report=report)
            os.write(writer, json.dumps(data, default=str).encode() + b"\n")

    code = 1
    try:
        null = os.open(os.devnull, os.O_RDWR)
        for descriptor in (0, 1, 2):
            os.dup2(null, descriptor)
        for name in ("terminalreporter", "side_by_side_parent"):
            config.pluginmanager.unregister(name=name)
        config.pluginmanager.register(Sender())
        for item, following in zip(items, [*items[1:], None], strict=True):
            config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        code = 0
    finally:
        os._exit(code)


class SideBySide:
    """Deals the suites out, shows a line for each, counts."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.limit_s = config.option.time_limit
        self.counts: dict[str, Counter] = {}
        self.ignored: list[str] = []
        self.failed: list[str] = []
        self.took: list[tuple[float, float, str]] = []
        self.told_s = time.monotonic()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.config._tmp_path_factory.getbasetemp()  # one folder for all, made before they part
        waiting: dict[str, list[pytest.Item]] = {}
        for item in session.items:
            waiting.setdefault(name_of(item.path, self.config), []).append(item)
        for argument in self.config.args:
            if Path(argument).is_file() and (suite := name_of(Path(argument), self.config)) not in (*waiting, *self.counts):
                self.fail("ran no test", suite)
                self.show(suite)
        with selectors.DefaultSelector() as selector:
            try:
                self.loop(waiting, selector)
            finally:
                for key in selector.get_map().values():
                    key.data.stop()
        session.testsfailed = len(self.failed)
        return True

    def loop(self, waiting: dict[str, list[pytest.Item]], selector: selectors.BaseSelector) -> None:
        while waiting or selector.get_map():
            while suite := self.following(waiting, [key.data for key in selector.get_map().values()]):
                child = Child(self.config, waiting.pop(suite))
                selector.register(child.pipe, selectors.EVENT_READ, child)
            for key, _ in selector.select(1):
                reports = key.data.reports()
                for data in reports or []:
                    self.take(key.data, self.config.hook.pytest_report_from_serializable(config=self.config, data=data))
                if reports is None:
                    selector.unregister(key.fileobj)
                    self.finish(key.data)
            for key in selector.get_map().values():
                if time.monotonic() > key.data.start + self.limit_s:
                    key.data.stop()
            self.still([key.data for key in selector.get_map().values()])

    def following(self, waiting: dict[str, list[pytest.Item]], running: list[Child]) -> str:
        """The next suite that there is room for."""
        waits_already = sum(child.waits for child in running)
        room = {True: not waits_already, False: len(running) - waits_already < self.config.option.jobs}
        return next((suite for suite, items in waiting.items() if room[waits(items)]), "")

    def still(self, running: list[Child]) -> None:
        """Says which suites run when no line has come for a while."""
        now_s = time.monotonic()
        if running and now_s >= self.told_s + self.config.option.told_every:
            self.told_s = now_s
            print("  still: " + ", ".join(f"{child.suite} {now_s - child.start:.0f} s" for child in running), flush=True)

    def take(self, child: Child, report: pytest.TestReport) -> None:
        """Counts one report: a test passes with its call and fails with any phase."""
        self.config.hook.pytest_runtest_logreport(report=report)
        counts = self.counts.setdefault(child.suite, Counter())
        test = report.nodeid.partition("::")[2]
        if report.when == "teardown":
            child.missing.remove(report.nodeid)
        if report.failed:
            counts["failed"] += 1
            self.failed.append(f"{child.suite}: {test}")
        elif report.skipped:
            counts["skipped"] += 1
            why = report.longrepr[2] if isinstance(report.longrepr, (list, tuple)) else getattr(report, "wasxfail", "")
            self.ignored.append(f"{child.suite}: {test}: {why.removeprefix('Skipped: ')}")
        elif report.when == "call":
            counts["passed"] += 1

    def finish(self, child: Child) -> None:
        """The suite's line; one that ended too early, or had nothing but ignored tests, has failed."""
        (end, cpu_s), seconds = child.end(), time.monotonic() - child.start
        self.took.append((seconds, cpu_s, child.suite))
        counts = self.counts.setdefault(child.suite, Counter())
        if child.missing:
            how = f"no end after {self.limit_s:g} s" if seconds > self.limit_s else f"crashed: {end}"
            self.fail(f"{how}, at {child.missing[0].partition('::')[2]}", child.suite)
        elif not counts["passed"] + counts["failed"]:
            self.fail("ran no test", child.suite)
        self.show(child.suite, seconds)

    def show(self, suite: str, seconds: float = 0) -> None:
        counts, self.told_s = self.counts[suite], time.monotonic()
        verdict = f"{counts['passed']:4} passed" + (f", {counts['failed']} FAILED" if counts["failed"] else "")
        print(f"  test {suite:44} {verdict}  ({seconds:.1f} s)", flush=True)

    def fail(self, text: str, suite: str) -> None:
        self.failed.append(f"{suite}: {text}")
        self.counts.setdefault(suite, Counter())["failed"] += 1

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            suite = name_of(self.config.rootpath / report.nodeid, self.config)
            self.fail(str(report.longrepr).splitlines()[-1], suite)
            self.show(suite)

    @pytest.hookimpl(tryfirst=True)
    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        return ("failed" if report.failed else "", "", "")  # no dot and no letter for each test

    @pytest.hookimpl(hookwrapper=True, tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session):
        yield
        total = sum(self.counts.values(), Counter())
        for line in self.ignored:
            print(f"IGNORED {line}")
        for line in self.failed:
            print(f"FAILED {line}")
        if not self.counts:
            print("FAILED: no test suite was run")
        if len(self.took) > DEAREST:
            print("dearest suites, in seconds, and seconds of a processor:")
            for seconds, cpu_s, suite in sorted(self.took, reverse=True)[:DEAREST]:
                print(f"  {suite:49} {seconds:8.1f} {cpu_s:8.1f}")
        if self.config.option.summary:
            numbers = {name: total[name] for name in ("passed", "failed", "skipped")}
            Path(self.config.option.summary).write_text(json.dumps(numbers) + "\n", encoding="utf-8")
        print(f"{total['passed']} passed, {total['failed']} failed", flush=True)
        session.exitstatus = pytest.ExitCode.OK if total["passed"] and not total["failed"] else pytest.ExitCode.TESTS_FAILED
