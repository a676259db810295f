"""The README's count of tests: from a complete run without a failure, or none."""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from tools.docs import readme
from tools.common import paths

REPORTER = paths.ROOT / "test" / "run-report.py"


class Counts(unittest.TestCase):
    def setUp(self) -> None:
        self.root = Path(self.enterContext(tempfile.TemporaryDirectory()))
        (self.root / "build/test").mkdir(parents=True)
        (self.root / "build/coverage").mkdir()
        (self.root / "build/coverage/summary.json").write_text('{"line_percent": 100, "branch_percent": 99.6}')
        self.summary = self.root / "build/test/summary.json"
        self.enterContext(mock.patch.object(readme, "ROOT", self.root))

    def run_suites(self, *texts: str) -> int:
        reports = []
        for number, text in enumerate(texts):
            reports.append(self.root / f"suite{number}.txt")
            reports[-1].write_text(text)
        return subprocess.run([sys.executable, REPORTER, "--summary", self.summary, *reports], capture_output=True, check=False).returncode

    def test_a_complete_run_leaves_its_numbers(self):
        self.assertEqual(0, self.run_suites("a:x:PASS\na:y:PASS\n2 passed, 0 failed\nexit 0\n", "b:z:PASS\nb:w:IGNORE: no xc16-gcc\n1 passed, 0 failed\nexit 0\n"))
        self.assertEqual({"passed": 3, "failed": 0, "skipped": 1}, json.loads(self.summary.read_text()))
        self.assertIn("| unit, board and closed-loop tests (1 more were skipped) | 3 |", readme.tests())

    def test_without_a_skipped_test_the_compiler_was_there(self):
        self.run_suites("a:x:PASS\n1 passed, 0 failed\nexit 0\n")
        self.assertIn("| unit, board and closed-loop tests, with those that need XC16 | 1 |", readme.tests())

    def test_a_failed_test_keeps_the_readme_as_it_is(self):
        self.assertEqual(1, self.run_suites("a:x:FAIL: no\n0 passed, 1 failed\nexit 1\n"))
        with self.assertRaisesRegex(SystemExit, r"^foc33: 1 tests failed, build/test/summary.json: repair them"):
            readme.tests()

    def test_before_a_complete_run_the_table_stays(self):
        self.assertIsNone(readme.tests())

    def test_a_missing_picture_is_one_line_and_nothing_is_written(self):
        page = self.root / "README.md"
        page.write_text("as it was")
        with mock.patch.object(readme, "README", page), self.assertRaisesRegex(SystemExit, r"^foc33: no picture, build/run/demo/speed.png: run `make readme`"):
            readme.main()
        self.assertEqual("as it was", page.read_text())


if __name__ == "__main__":
    unittest.main()
