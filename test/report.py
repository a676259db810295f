"""Reads the report file of one test suite; shared by run-suite.py and run-report.py.

A result is a line "where:test:PASS", "where:test:FAIL: why" or "where:test:IGNORE: why", as Unity prints it; "test: PASS" is fine too.
Indented lines after a FAIL belong to it. Then comes the suite's own total, Unity's or "N passed, N failed", and a last line that says how
the suite ended. A suite that ended badly or without a total has failed in any case.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

RESULT = re.compile(r"^(?P<test>\S.*?): ?(?P<result>PASS|FAIL|IGNORE)(?:: ?(?P<why>.*))?$")
TOTALS = re.compile(r"^(?:(\d+) Tests (\d+) Failures (\d+) Ignored|(\d+) passed, (\d+) failed$)", re.MULTILINE)


@dataclass
class Suite:
    """What one suite reported: names of tests, and a text for each failure."""

    name: str
    passed: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)


def read_suite(path: Path) -> Suite:
    """The results in a report file; a missing file is a suite that could not be built."""
    suite = Suite(path.stem)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        suite.failures.append("does not build; the compiler's message is above")
        return suite
    *lines, end = text.rstrip("\n").split("\n")
    _read_results(suite, lines)
    trouble = _trouble(suite, text, end)
    if trouble:
        tail = [f"    {line}" for line in lines[-15:]]
        suite.failures.append("\n".join([trouble, *tail]))
    return suite


def _read_results(suite: Suite, lines: list[str]) -> None:
    in_failure = False
    for line in lines:
        found = RESULT.match(line)
        if found is None:
            in_failure = in_failure and line.startswith((" ", "\t"))
            if in_failure:
                suite.failures[-1] += f"\n{line}"
            continue
        in_failure = found["result"] == "FAIL"
        name = found["test"] + (f": {found['why']}" if found["why"] else "")
        {"PASS": suite.passed, "FAIL": suite.failures, "IGNORE": suite.ignored}[found["result"]].append(name)


def _trouble(suite: Suite, text: str, end: str) -> str:
    """Why the results cannot be the whole story, or ""."""
    if not end.startswith("exit "):
        return f"crashed: {end}, after {suite.passed[-1] if suite.passed else 'no test'}"
    passed, failed, ignored = len(suite.passed), len(suite.failures), len(suite.ignored)
    total = TOTALS.search(text)
    if total is None:
        return f"stopped early ({end}), without its total"
    if total[0] not in (f"{passed + failed + ignored} Tests {failed} Failures {ignored} Ignored", f"{passed} passed, {failed} failed"):
        return f"its total, {total[0]}, is not what it printed: {passed} passed, {failed} failed, {ignored} ignored"
    if end == "exit 0" and suite.failures:
        return "ended with exit 0 in spite of failures"
    if end != "exit 0" and not suite.failures:
        return f"ended with {end} though no test failed"
    if not suite.passed and not suite.failures:
        return "ran no test"
    return ""
