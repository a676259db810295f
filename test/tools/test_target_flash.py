"""make flash: only a checked image is programmed, by the right command, and nobody believes that a board is programmed when it is not."""

import contextlib
import io
import os
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from target_support import made

from tools.image import flash, image

IPECMD = "#!/bin/sh\nprintf '%s\\n' \"$@\" >\"$RESULT\"\npwd >>\"$RESULT\"\nexit ${STATUS:-0}\n"


class Flash(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.image = made()
        self.image.words[0xF80008] = 0x45
        self.result = self.folder / "result"
        for patch in (mock.patch.object(flash, "USUAL", ()), mock.patch.object(flash.find, "__defaults__", ((str(self.folder / "usual"),),)),
                      mock.patch.dict(os.environ, {"RESULT": str(self.result), "PATH": f"{self.folder}/path:/usr/bin:/bin", "STATUS": "0"})):
            patch.start()
            self.addCleanup(patch.stop)
        self.image.write(self.folder)
        patch = mock.patch.object(image, "CONFIG_C", self.folder / "config.c")
        patch.start()
        self.addCleanup(patch.stop)

    def install(self, place: str) -> Path:
        path = self.folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(IPECMD, encoding="utf-8")
        path.chmod(0o755)
        return path

    def flash(self, *more: str) -> tuple[int, str, list[str]]:
        out, error = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
            status = flash.main([str(self.folder / "a.hex"), "--elf", str(self.folder / "a.elf"), *more])
        return status, out.getvalue(), error.getvalue().splitlines()

    def test_each_tool_gets_its_command(self):
        self.install("path/ipecmd.sh")
        for tool in ("PK3", "PK4", "PK5", "ICD4", "SNAP", "snap"):
            with self.subTest(tool):
                status, out, lines = self.flash("--tool", tool)
                self.assertEqual((status, lines), (0, []))
                self.assertEqual(self.result.read_text().split("\n")[:5],
                                 ["-P33FJ32MC204", f"-TP{tool.upper()}", f"-F{self.folder / 'a.hex'}", "-M", "-OL"])
                self.assertIn("programmed and verified", out)

    def test_the_tools_logs_go_beside_the_hex_file(self):
        self.install("path/ipecmd.sh")
        self.flash()
        self.assertEqual(self.result.read_text().split("\n")[5], str(self.folder.resolve()))

    def test_without_ipecmd_the_exact_command_is_printed_and_nothing_is_claimed(self):
        status, out, lines = self.flash("--tool", "PK5")
        self.assertEqual((status, len(lines)), (2, 1))
        self.assertIn(f"ipecmd.sh -P33FJ32MC204 -TPPK5 -F{self.folder / 'a.hex'} -M -OL", out)
        self.assertNotIn("programmed and verified", out)
        self.assertRegex(lines[0], "^foc33: not programmed: .*install MPLAB X")

    def test_the_folder_that_the_user_names_comes_first(self):
        self.install("path/ipecmd.sh")
        named = self.install("x/v6.20/mplab_platform/mplab_ipe/ipecmd.sh")
        self.assertIn(str(named), self.flash("--ipe", str(self.folder / "x/v6.20"))[1])
        status, _, lines = self.flash("--ipe", str(self.folder / "nowhere"))
        self.assertEqual((status, len(lines)), (2, 1))
        self.assertIn("no ipecmd.sh in IPE=", lines[0])

    def test_of_the_usual_places_the_newest_is_taken(self):
        for version in ("v5.50", "v6.9", "v6.20"):
            self.install(f"usual/{version}/mplab_platform/mplab_ipe/ipecmd.sh")
        self.assertIn("usual/v6.20/", self.flash()[1])

    def test_a_failed_programming_is_told(self):
        self.install("path/ipecmd.sh")
        with mock.patch.dict(os.environ, {"STATUS": "7"}):
            status, out, lines = self.flash()
        self.assertEqual((status, len(lines)), (1, 1))
        self.assertIn("programming failed, ipecmd exit status 7", lines[0])
        self.assertNotIn("programmed and verified", out)

    def test_an_image_that_fails_its_checks_is_not_programmed(self):
        self.install("path/ipecmd.sh")
        self.image.words[0xF80008] = 0x47
        self.image.write(self.folder)
        status, _, lines = self.flash()
        self.assertEqual(status, 1)
        self.assertIn("not programmed, the image failed its checks", lines[-1])
        self.assertFalse(self.result.exists())

    def test_an_unknown_tool_is_refused(self):
        status, _, lines = self.flash("--tool", "PK44")
        self.assertEqual((status, len(lines)), (2, 1))
        self.assertRegex(lines[0], "no tool TOOL=PK44, make flash: did you mean 'PK4'")


if __name__ == "__main__":
    unittest.main()
