"""Runs one Python test file (unittest) and prints a line "file:line:test:PASS" or "...:FAIL: why" for each test, as Unity does.

    test/run-unittest.py test/tools/test_toml_file.py
"""

import importlib.util
import inspect
import sys
import unittest
from pathlib import Path


class Lines(unittest.TestResult):
    """Prints each result as it comes; a failure is followed by its indented traceback."""

    def __init__(self) -> None:
        super().__init__()
        self.counts = {"PASS": 0, "FAIL": 0, "IGNORE": 0}

    def _print(self, test: unittest.TestCase, result: str, why: str = "") -> None:
        self.counts[result] += 1
        name = test.id().removeprefix(f"{Path(sys.argv[1]).stem}.")
        print(f"{place(test)}:{name}:{result}{': ' + why if why else ''}", flush=True)

    def _failed(self, test: unittest.TestCase, error: tuple) -> None:
        self._print(test, "FAIL", " ".join(str(error[1]).split()) or error[0].__name__)
        for line in self._exc_info_to_string(error, test).splitlines():
            print(f"    {line}", flush=True)

    def addSuccess(self, test: unittest.TestCase) -> None:
        self._print(test, "PASS")

    def addFailure(self, test: unittest.TestCase, err: tuple) -> None:
        self._failed(test, err)

    def addError(self, test: unittest.TestCase, err: tuple) -> None:
        self._failed(test, err)

    def addSkip(self, test: unittest.TestCase, reason: str) -> None:
        self._print(test, "IGNORE", reason)

    def addSubTest(self, test: unittest.TestCase, subtest: unittest.TestCase, err: tuple | None) -> None:
        if err is not None:
            self._failed(subtest, err)

    def addExpectedFailure(self, test: unittest.TestCase, err: tuple) -> None:
        self._print(test, "IGNORE", "fails as expected")

    def addUnexpectedSuccess(self, test: unittest.TestCase) -> None:
        self._print(test, "FAIL", "passes though a failure was expected")


def place(test: unittest.TestCase) -> str:
    """file:line of a test method; only the file for a fixture that failed."""
    test = getattr(test, "test_case", test)
    method = getattr(type(test), getattr(test, "_testMethodName", ""), None)
    if method is None:
        return sys.argv[1]
    return f"{sys.argv[1]}:{inspect.getsourcelines(inspect.unwrap(method))[1]}"


def main() -> int:
    path = Path(sys.argv[1])
    sys.path[0:1] = [str(Path.cwd()), str(path.resolve().parent)]
    spec = importlib.util.spec_from_file_location(path.stem, path.resolve())
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    result = Lines()
    unittest.defaultTestLoader.loadTestsFromModule(module).run(result)
    print(f"{result.counts['PASS']} passed, {result.counts['FAIL']} failed")
    return 1 if result.counts["FAIL"] else 0


if __name__ == "__main__":
    sys.exit(main())
