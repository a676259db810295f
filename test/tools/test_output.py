"""Result folders: complete or not there at all, and nobody else's files are touched."""

import json
import tempfile
import unittest
from pathlib import Path

from support import trace

from tools.common.errors import UserError
from tools.common.output import ResultFolder, write_csv, write_summary, write_trace


class Results(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        self.target = self.root / "demo"

    def write(self, text: str) -> None:
        with ResultFolder(self.target) as folder:
            (folder.work / "summary.json").write_text(text, encoding="utf-8")

    def test_nothing_is_visible_before_the_end(self):
        with ResultFolder(self.target) as folder:
            (folder.work / "summary.json").write_text("{}", encoding="utf-8")
            self.assertFalse(self.target.exists())
        self.assertTrue((self.target / "summary.json").is_file())

    def test_a_failed_run_leaves_nothing(self):
        with self.assertRaises(RuntimeError), ResultFolder(self.target) as folder:
            (folder.work / "summary.json").write_text("{}", encoding="utf-8")
            raise RuntimeError
        self.assertEqual(list(self.root.iterdir()), [])

    def test_an_interrupted_run_leaves_nothing(self):
        with self.assertRaises(KeyboardInterrupt), ResultFolder(self.target):
            raise KeyboardInterrupt
        self.assertEqual(list(self.root.iterdir()), [])

    def test_an_older_result_is_replaced_as_a_whole(self):
        self.write("old")
        (self.target / "old.png").write_text("", encoding="utf-8")
        self.write("new")
        self.assertEqual([path.name for path in self.target.iterdir()], ["summary.json"])
        self.assertEqual((self.target / "summary.json").read_text(encoding="utf-8"), "new")
        self.assertEqual(list(self.root.iterdir()), [self.target])

    def test_a_failed_run_keeps_the_older_result(self):
        self.write("old")
        with self.assertRaises(RuntimeError), ResultFolder(self.target):
            raise RuntimeError
        self.assertEqual((self.target / "summary.json").read_text(encoding="utf-8"), "old")

    def test_a_folder_with_other_files_is_refused_before_anything_runs(self):
        self.target.mkdir()
        (self.target / "thesis.txt").write_text("years of work", encoding="utf-8")
        with self.assertRaisesRegex(UserError, "is not a result folder"), ResultFolder(self.target):
            self.fail("must not get here")
        self.assertTrue((self.target / "thesis.txt").is_file())

    def test_an_empty_folder_is_taken(self):
        self.target.mkdir()
        self.write("{}")
        self.assertTrue((self.target / "summary.json").is_file())

    def test_a_file_in_the_way_is_refused(self):
        self.target.write_text("x", encoding="utf-8")
        with self.assertRaisesRegex(UserError, "is not a result folder"), ResultFolder(self.target):
            self.fail("must not get here")

    def test_a_place_that_cannot_be_written_is_refused(self):
        (self.root / "file").write_text("x", encoding="utf-8")
        with self.assertRaisesRegex(UserError, "cannot write to '.*file'.*choose a folder"), ResultFolder(self.root / "file" / "demo"):
            self.fail("must not get here")

    def test_a_full_disk_is_one_line_and_leaves_nothing(self):
        with self.assertRaisesRegex(UserError, "cannot write to .*No space left"), ResultFolder(self.target):
            raise OSError(28, "No space left on device")
        self.assertEqual(list(self.root.iterdir()), [])

    def test_missing_parents_are_made(self):
        self.target = self.root / "a" / "b"
        self.write("{}")
        self.assertTrue((self.target / "summary.json").is_file())

    def test_a_summary_refuses_what_is_no_json(self):
        with self.assertRaises(ValueError):
            write_summary(self.root, {"x": float("nan")})
        write_summary(self.root, {"x": None})
        self.assertEqual(json.loads((self.root / "summary.json").read_text(encoding="utf-8")), {"x": None})

    def test_a_trace_file_has_a_heading_and_a_line_a_row(self):
        write_trace(self.root / "trace.csv", trace(0.001, plant__speed_rpm=1234.5))
        lines = (self.root / "trace.csv").read_text(encoding="utf-8").splitlines()
        self.assertEqual(len(lines), 21)
        self.assertEqual(lines[0].split(",")[:2], ["time_s", "plant.speed_rpm"])
        self.assertEqual(lines[1].split(",")[:2], ["0.00005", "1234.5"])
        self.assertEqual(len(lines[1].split(",")), len(lines[0].split(",")))

    def test_a_table_file_quotes_what_would_break_its_columns(self):
        write_csv(self.root / "t.csv", ["a", "b"], [["one, two", 'say "x"']])
        self.assertEqual((self.root / "t.csv").read_text(encoding="utf-8"), 'a,b\n"one, two","say ""x"""\n')

    def test_a_table_file_leaves_unknown_cells_empty(self):
        write_csv(self.root / "t.csv", ["a", "b"], [[1, None]])
        self.assertEqual((self.root / "t.csv").read_text(encoding="utf-8"), "a,b\n1,\n")
