"""Building a firmware variant: its folder's name, and what a failed build tells the user."""

import concurrent.futures
import os
import subprocess
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from tools.bench import build
from tools.common import paths
from tools.common.errors import UserError


class Build(unittest.TestCase):
    def make(self, script: str, defines=(), userparams=None):
        """build.library() with a make of our own."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "make"
            path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
            path.chmod(0o755)
            with mock.patch.dict(os.environ, {"PATH": f"{folder}:{os.environ['PATH']}", "MAKEFLAGS": "-j8", "RESULT": f"{folder}/result"}):
                library = build.library(list(defines), userparams)
                return library, Path(folder, "result").read_text(encoding="utf-8") if Path(folder, "result").exists() else ""

    def test_no_defines_mean_the_default_build(self):
        library, call = self.make("echo \"$@\" > $RESULT")
        self.assertEqual(library, paths.ROOT / "build" / "host" / "libvboard.so")
        self.assertNotIn("VARIANT", call)

    def test_defines_mean_a_folder_of_their_own(self):
        library, call = self.make("echo \"$@\" > $RESULT", ["TUNING", "SNAPSHOT"])
        self.assertEqual(library.parent.name, "host-snapshot-tuning")
        self.assertIn("VARIANT=snapshot-tuning DEFINES=-DTUNING -DSNAPSHOT", call)

    def test_different_values_of_a_macro_do_not_share_a_folder(self):
        self.assertNotEqual(build.variant_name(["A=1"]), build.variant_name(["A=2"]))

    def test_two_builds_of_one_folder_take_turns(self):
        with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor() as pool:
            path = Path(folder) / "make"
            path.write_text(f"#!/bin/sh\nmkdir {folder}/busy || exit 1\nsleep 0.2\nrmdir {folder}/busy\n", encoding="utf-8")
            path.chmod(0o755)
            with mock.patch.dict(os.environ, {"PATH": f"{folder}:{os.environ['PATH']}"}):
                self.assertEqual(len(list(pool.map(build.library, [["TURNS"]] * 3))), 3)

    def test_the_image_s_board_and_the_pc_s_share_objects_and_flags(self):
        def flags(target: str) -> str:
            environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
            done = subprocess.run(["make", "-n", "-C", str(paths.ROOT), target], env=environment, capture_output=True, text=True, check=True)
            return next(line for line in done.stdout.splitlines() if "build/host/flags" in line)
        self.assertEqual(flags("build/host/flags"), flags("build/host/tools/cpu_33f/iss_board.o"))
        self.assertEqual(flags("build/host/flags"), flags("build/host/tools/cpu_33f/iss_core.o"))

    def test_a_motor_file_s_name_with_blanks_and_quotes_is_one_word_to_the_shell(self):
        environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
        done = subprocess.run(["make", "-n", "-C", str(paths.ROOT), "userparams", "MOTOR=/tmp/it's a motor.toml"], env=environment,
                              capture_output=True, text=True, check=True)
        line = next(line for line in done.stdout.splitlines() if "new=" in line)
        self.assertIn("new='build/tune/it'\\''s a motor/userparams.h'", line)
        self.assertEqual(done.stdout.count("$new"), done.stdout.count('"$new"'))

    def test_a_tuned_header_is_built_under_its_motor_s_name(self):
        library, call = self.make("echo \"$@\" > $RESULT", userparams=paths.TUNED / "some_motor")
        self.assertEqual(library.parent.name, "host-some_motor")
        self.assertIn("VARIANT=some_motor DEFINES= USERPARAMS=build/tune/some_motor", call)

    def test_a_header_and_defines_share_no_folder_with_either_alone(self):
        library, call = self.make("echo \"$@\" > $RESULT", ["TUNING"], paths.TUNED / "some_motor")
        self.assertEqual(library.parent.name, "host-some_motor-tuning")
        self.assertIn("DEFINES=-DTUNING USERPARAMS=", call)

    def test_headers_in_folders_of_the_same_name_share_no_folder(self):
        names = {build.variant_name([], Path(folder) / "params") for folder in ("/one", "/two")}
        self.assertEqual(len(names), 2)
        for name in names:
            self.assertRegex(name, r"^params-[0-9a-f]{8}$")

    def test_the_project_s_own_header_is_the_default_build(self):
        self.assertIsNone(build.header_folder(paths.ROOT))
        self.assertIsNone(build.header_folder(paths.ROOT / "userparams.h"))

    def test_a_header_is_found_by_its_folder_or_by_itself(self):
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "userparams.h").write_text("", encoding="utf-8")
            self.assertEqual(build.header_folder(folder), Path(folder).resolve())
            self.assertEqual(build.header_folder(Path(folder) / "userparams.h"), Path(folder).resolve())

    def test_a_folder_without_a_header_or_with_a_name_that_make_cannot_take_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaisesRegex(UserError, "no userparams.h in .*--userparams: name the folder"):
                build.header_folder(folder)
            odd = Path(folder, "two words")
            odd.mkdir()
            Path(odd, "userparams.h").write_text("", encoding="utf-8")
            with self.assertRaisesRegex(UserError, "two words' cannot be given to make"):
                build.header_folder(odd)

    def test_a_refused_parameter_of_another_header_is_told_with_that_header(self):
        with self.assertRaisesRegex(UserError, "does not build, build/tune/m/userparams.h: the back-EMF's format"):
            self.make("echo \"a.h:3: error: static assertion failed: \\\"the back-EMF\\\\'s format\\\"\" >&2; exit 2",
                      userparams=paths.TUNED / "m")

    def test_the_flags_of_a_surrounding_make_are_not_inherited(self):
        self.assertEqual(self.make("echo \"flags=$MAKEFLAGS\" > $RESULT")[1].strip(), "flags=")

    def test_a_refused_parameter_is_named(self):
        message = "include/x.h:3: error: static assertion failed: \"userparams.h: MOTOR_RS_OHM = 99 is outside 0.01 .. 40 ohm\""
        with self.assertRaisesRegex(UserError, "does not build, make vboard: userparams.h: MOTOR_RS_OHM = 99 is outside 0.01 .. 40 ohm$"):
            self.make(f"cat >&2 <<'X'\nIn file included from a.c\n{message}\nX\nexit 2")

    def test_another_compiler_error_is_shown_with_its_place(self):
        with self.assertRaisesRegex(UserError, "a.c:3:1: error: expected"):
            self.make("echo 'noise' >&2; echo 'a.c:3:1: error: expected ;' >&2; exit 2")
