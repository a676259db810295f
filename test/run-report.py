"""Gathers the report files of all suites: failures with their place, ignored tests, and the last line "N passed, N failed".

    test/run-report.py build/test/unit.test_pi.txt ...

Exit status 1 when a test failed, a suite crashed or did not build, or nothing ran at all.
"""

import sys
from pathlib import Path

from report import read_suite


def main() -> int:
    suites = [read_suite(Path(name)) for name in sys.argv[1:]]
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
    print(f"{passed} passed, {failed} failed")
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
