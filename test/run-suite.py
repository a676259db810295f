"""Runs one test suite, keeps what it prints in a report file, and shows one line about it; the report of all suites comes later.

    test/run-suite.py [--one-test] build/test/unit.test_pi.txt command...

With --one-test the command itself is the test: it passes when it ends with 0. The exit status is 0 whatever the tests say, so that
make goes on with the other suites; run-report.py decides.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from report import read_suite

TIME_LIMIT_S = 600


def run(command: list[str]) -> tuple[str, str]:
    """Output of the command and how it ended: "exit 0", "signal 11", "timeout". At the time limit all that it started ends too."""
    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)
    except OSError as error:
        return "", f"cannot start: {error.strerror}"
    try:
        output, _ = process.communicate(timeout=TIME_LIMIT_S)
        end = f"exit {process.returncode}" if process.returncode >= 0 else f"signal {-process.returncode}"
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output, _ = process.communicate()
        end = f"timeout {TIME_LIMIT_S} s"
    except BaseException:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    return output.decode(errors="replace"), end


def main() -> None:
    arguments = sys.argv[1:]
    one_test = arguments[0] == "--one-test"
    report, *command = arguments[one_test:]
    path = Path(report)
    start = time.monotonic()
    output, end = run(command)
    if one_test:
        passed = end == "exit 0"
        result = "PASS" if passed else f"FAIL: {end}\n" + "".join(f"    {line}\n" for line in output.splitlines())
        output = f"{path.stem}:{result}\n{int(passed)} passed, {int(not passed)} failed"
        end = "exit 0" if passed else "exit 1"
    path.write_text(f"{output.rstrip()}\n{end}\n", encoding="utf-8")
    suite = read_suite(path)
    verdict = f"{len(suite.passed):4} passed" + (f", {len(suite.failures)} FAILED" if suite.failures else "")
    print(f"  test {path.stem:44} {verdict}  ({time.monotonic() - start:.1f} s)", flush=True)


if __name__ == "__main__":
    main()
