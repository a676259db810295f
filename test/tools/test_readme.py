"""The README's count of tests: from a complete run without a failure, or none."""

import json
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from tools.docs import readme


class Counts(unittest.TestCase):
    def setUp(self) -> None:
        self.root = Path(self.enterContext(tempfile.TemporaryDirectory()))
        (self.root / "build/test").mkdir(parents=True)
        (self.root / "build/coverage").mkdir()
        (self.root / "build/coverage/summary.json").write_text('{"line_percent": 100, "branch_percent": 99.6}')
        self.summary = self.root / "build/test/summary.json"
        self.enterContext(mock.patch.object(readme, "ROOT", self.root))

    def result(self, passed: int, failed: int, skipped: int) -> None:
        self.summary.write_text(json.dumps({"passed": passed, "failed": failed, "skipped": skipped}))

    def test_a_complete_run_gives_its_numbers(self):
        self.result(3, 0, 1)
        self.assertIn("| unit, board and closed-loop tests (1 more were skipped) | 3 |", readme.tests())

    def test_without_a_skipped_test_the_compiler_was_there(self):
        self.result(1, 0, 0)
        self.assertIn("| unit, board and closed-loop tests, with those that need XC16 | 1 |", readme.tests())

    def test_a_failed_test_keeps_the_readme_as_it_is(self):
        self.result(0, 1, 0)
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
