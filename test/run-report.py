"""Gathers the report files of all suites: failures with their place, ignored tests, and the last line "N passed, N failed".

    test/run-report.py [--summary file.json] build/test/unit.test_pi.txt ...

--summary keeps the numbers for the README; for a run of every suite. Exit status 1 when a test failed, a suite crashed or did not
build, or nothing ran at all.
"""

import json
import sys
from pathlib import Path

from report import read_suite


def main() -> int:
    arguments = sys.argv[1:]
    summary = Path(arguments[1]) if arguments[:1] == ["--summary"] else None
    suites = [read_suite(Path(name)) for name in arguments[2 if summary else 0:]]
    passed = sum(len(suite.passed) for suite in suites)
    failed = sum(len(suite.failures) for suite in suites)
    for suite in suites:
        for name in suite.ignored:
            print(f"IGNORED {suite.name}: {name}")
    for suite in suites:
        for failure in suite.failures:
            print(f"FAILED {suite.name}: {failure}")
    if not suites:
        print("FAILED: no test suite was run")
    if summary:
        skipped = sum(len(suite.ignored) for suite in suites)
        summary.write_text(json.dumps({"passed": passed, "failed": failed, "skipped": skipped}) + "\n", encoding="utf-8")
    print(f"{passed} passed, {failed} failed")
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
