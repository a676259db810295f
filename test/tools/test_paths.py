"""How a name becomes a file, and what a folder that cannot be read is answered with."""

import tempfile
import unittest
from pathlib import Path
from unittest import mock

from tools.common import paths
from tools.common.errors import UserError


class Places(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = Path(temporary.name)

    def test_names_are_those_of_the_toml_files(self):
        for name in ("b.toml", "a.toml", "c.txt"):
            (self.folder / name).write_text("", encoding="utf-8")
        self.assertEqual(paths.names(self.folder), ["a", "b"])

    def test_a_folder_that_is_not_there_is_named(self):
        with self.assertRaisesRegex(UserError, r"cannot read the folder \(No such file or directory\), .*nowhere: make it readable"):
            paths.names(self.folder / "nowhere")

    def test_a_folder_that_cannot_be_read_is_named(self):
        with mock.patch.object(Path, "is_file", side_effect=PermissionError(13, "Permission denied")):
            for name in ("a", str(self.folder / "a.toml")):
                with self.assertRaisesRegex(UserError, rf"cannot read the folder \(Permission denied\), {self.folder}: make it readable"):
                    paths.find("motor", name, self.folder)
        with mock.patch.object(Path, "iterdir", side_effect=PermissionError(13, "Permission denied")), \
                self.assertRaisesRegex(UserError, r"cannot read the folder \(Permission denied\)"):
            paths.names(self.folder)
