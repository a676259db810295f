"""The MPLAB X project is what the Makefile says: regenerated, well formed, and every file it names exists."""

import contextlib
import io
import os
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as ET
from pathlib import Path
from unittest import mock

from tools.common.errors import UserError
from tools.image import project

ROOT = Path(__file__).resolve().parents[2]
PROJECT = ROOT / "firmware.X"
VARIABLES = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "OPT", "DEFINES", "USERPARAMS", "VARIANT", "DFP")
FACTS = ["file firmware/board/a.c", "file include/drive/b.h", "file userparams.h", "flag -O2", "flag -std=gnu99", "flag -Wall",
         "include include", "include .", "link --gc-sections", "link --odd", "device 33FJ32MC204"]


def facts() -> dict[str, list[str]]:
    """What the Makefile says."""
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    done = subprocess.run(["make", "-s", "project-facts"], cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    return project.read(done.stdout.splitlines())


class Project(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.facts = facts()
        cls.tree = ET.parse(PROJECT / "nbproject" / "configurations.xml")

    def test_the_committed_project_is_the_generated_one(self):
        for name, text in project.project(self.facts).items():
            self.assertEqual((PROJECT / name).read_text(encoding="utf-8"), text, f"{name} differs: run make project")

    def test_it_does_not_follow_what_one_build_is_asked_for(self):
        done = subprocess.run(["make", "-s", "project-facts", "OPT=-O1", "USERPARAMS=/tmp", "DEFINES=-DTUNING"], cwd=ROOT, capture_output=True,
                              text=True, check=True)
        self.assertEqual(project.read(done.stdout.splitlines()), self.facts)

    def test_every_file_that_it_names_exists(self):
        items = [item.text for item in self.tree.iter("itemPath")]
        self.assertGreater(len(items), 30)
        for item in items:
            self.assertTrue((PROJECT / item).is_file(), item)

    def test_it_has_every_source_and_header_of_the_firmware(self):
        items = {item.text for item in self.tree.iter("itemPath")}
        files = {f"../{path.relative_to(ROOT)}" for pattern in ("firmware/**/*.c", "include/**/*.h", "userparams.h") for path in ROOT.glob(pattern)}
        self.assertEqual(items, files | {"Makefile"})

    def test_device_folders_and_flags_are_those_of_make_firmware(self):
        self.assertEqual(self.tree.findtext(".//targetDevice"), "dsPIC33FJ32MC204")
        boxes = {box.get("key"): box.get("value") for box in self.tree.find(".//C30").iter("property")}
        self.assertEqual(boxes["optimization-level"], "2")
        for folder in boxes["extra-include-directories"].split(";"):
            self.assertTrue((PROJECT / folder).is_dir(), folder)
        more = self.tree.find(".//C30/appendMe").get("value").split()
        for flag in self.facts["flag"]:
            self.assertTrue(flag in more or flag in project.BOXES, flag)
        linker = {box.get("key"): box.get("value") for box in self.tree.find(".//C30-LD").iter("property")}
        self.assertEqual(linker["remove-unused-sections"], "true")

    def test_the_other_files_are_well_formed(self):
        name = ET.parse(PROJECT / "nbproject" / "project.xml").find(".//{http://www.netbeans.org/ns/make-project/1}name")
        self.assertEqual(name.text, "foc33")
        self.assertIn("include nbproject/Makefile-impl.mk", (PROJECT / "Makefile").read_text(encoding="utf-8"))


class Generator(unittest.TestCase):
    def test_what_has_no_box_becomes_an_additional_option(self):
        tree = ET.fromstring(project.project(project.read(FACTS))["nbproject/configurations.xml"])
        self.assertEqual(tree.find(".//C30/appendMe").get("value"), "-std=gnu99")
        self.assertEqual(tree.find(".//C30-LD/appendMe").get("value"), "--odd")

    def test_odd_characters_do_not_break_the_xml(self):
        text = project.project(project.read([*FACTS, "flag -DNAME=\"a<b>&c\"", "file firmware/board/a&b.c"]))["nbproject/configurations.xml"]
        tree = ET.fromstring(text)
        self.assertIn("../firmware/board/a&b.c", [item.text for item in tree.iter("itemPath")])
        self.assertIn('-DNAME="a<b>&c"', tree.find(".//C30/appendMe").get("value"))

    def test_facts_that_are_none_are_refused(self):
        for lines in (["nonsense"], ["file"], [], FACTS[:-1], [*FACTS, "device 33FJ64MC204"]):
            with self.assertRaises(UserError):
                project.read(lines)

    def test_the_command_writes_three_files_or_says_why_not(self):
        with tempfile.TemporaryDirectory() as folder:
            for facts_, status in ((FACTS, 0), (["nonsense"], 2)):
                out, error = io.StringIO(), io.StringIO()
                with mock.patch("sys.stdin", io.StringIO("\n".join(facts_))), contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
                    self.assertEqual(project.main(["--out", f"{folder}/p"]), status)
                self.assertEqual(len(error.getvalue().splitlines()), 1 if status else 0)
            self.assertEqual(sorted(str(path.relative_to(f"{folder}/p")) for path in Path(folder, "p").rglob("*") if path.is_file()),
                             sorted(project.FILES))


if __name__ == "__main__":
    unittest.main()
