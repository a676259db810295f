"""Each check of the image tells its line when it ends; at the end stands the time of each, and of the other suites, dearest first."""

from collections import Counter

import pytest

CHECKS = "image/"
times: Counter = Counter()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    suite, _, test = report.nodeid.partition("::")
    checks = CHECKS in suite
    name = test.removeprefix("test_").replace("_", " ") if checks else suite
    times[name] += report.duration
    if checks and (report.when == "call" or not report.passed):
        print(f"  check {name:60} {report.outcome:8} ({report.duration:.1f} s)", flush=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.nodeid.startswith(CHECKS):
            item.add_marker("xc16")


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if times and not hasattr(session.config, "workerinput"): # else a worker of a run that tells it
        print("times, dearest first:", *(f"{seconds:8.1f} s  {name}" for name, seconds in times.most_common()), sep="\n", flush=True)
