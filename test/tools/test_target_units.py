"""make test-target around the compiler and the simulator: vectors as the target reads them, images split where the flash ends, and the verdict."""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test" / "target"))
import run as target_run # noqa: E402
import golden_words # noqa: E402

# A compiler that copies, a linker with room for three tests, and a simulator in which every test passes but those named *_fails.
COMPILER = """#!/bin/sh
for word; do case $last in -c) source=$word;; -o) out=$word;; esac; last=$word; done
grep -q broken "$source" && { echo "$source:1:1: error: broken" >&2; exit 1; }
cat "$source" >"$out"
"""
LINKER = """#!/bin/sh
out=$1; shift
cat "$@" | grep -o 'UnityDefaultTestRun([a-z_]*' >"$out"
[ $(wc -l <"$out") -le 3 ] || { echo "Link Error: Could not allocate program memory" >&2; exit 1; }
grep -q lost "$out" && { echo "undefined reference to _lost" >&2; exit 1; }
exit 0
"""
SIMULATOR = """#!/bin/sh
number=0; bad=0
for test in $(sed 's/.*(//' "$1"); do
    number=$((number + 1))
    case $test in
        *fails) bad=$((bad + 1)); echo "test/unit/test_x.c:1:$test:FAIL: Expected 1 Was 2";;
        *hangs) echo "did not end in the cycles allowed" >&2; exit 255;;
        *) echo "test/unit/test_x.c:1:$test:PASS";;
    esac
done
echo; echo "$number Tests $bad Failures 0 Ignored"
echo "1000 cycles" >&2
exit $bad
"""


class Vectors(unittest.TestCase):
    def test_a_row_is_words_low_word_first_without_gaps(self):
        columns = [("a", "s16"), ("b", "s32"), ("c", "u16"), ("d", "u32")]
        self.assertEqual(golden_words.words(columns, ["-1", "-2", "65535", "65536"]), [0xFFFF, 0xFFFE, 0xFFFF, 0xFFFF, 0, 1])

    def test_header_keeps_type_rows_and_constants_and_fetches_rows(self):
        text = golden_words.header("x", 7, [("a", "s16"), ("b", "s32")], {"k": "5"}, [["1", "2"], ["3", "4"]])
        for part in ("#define GOLDEN_X_K 5", "#define GOLDEN_X_ROWS 2u", "int32_t b;", "golden_x_t golden_x_row(uint32_t n)", "golden_fetch(7, n * 3u, &row,"):
            self.assertIn(part, text)
        self.assertNotIn("golden_x[", text)

    def test_a_file_with_constants_only_stays_as_it_is(self):
        text = golden_words.header("x", 7, [], {"k": "5"}, [])
        self.assertIn("#define GOLDEN_X_K 5", text)
        self.assertNotIn("golden_fetch", text)

    def test_every_access_to_a_row_becomes_a_call_and_lines_keep_their_numbers(self):
        text = golden_words.fed("one\ngolden_pi_t v = golden_pi[n];\ngolden_##name##_t row = golden_##name[n];\ntable[golden_sine[n + 1u].value]\n", "t.c")
        self.assertEqual(text, '#line 1 "t.c"\none\ngolden_pi_t v = golden_pi_row(n);\ngolden_##name##_t row = golden_##name##_row(n);\n'
                               "table[golden_sine_row(n + 1u).value]\n")

    def test_tests_of_the_project_have_no_access_that_is_missed(self):
        for path in sorted((ROOT / "test/unit").glob("test_*.c")):
            with self.subTest(path.name):
                self.assertNotRegex(golden_words.fed(path.read_text(encoding="utf-8"), path.name), r"golden_\w*(?:##\w+)?\[")

    def test_tables_hold_every_row_of_the_vectors(self):
        with tempfile.TemporaryDirectory() as folder:
            tables = golden_words.write(ROOT / "test/golden/vectors", Path(folder))
            sizes = {table.stem: table.stat().st_size for table in tables}
            self.assertEqual(sizes["sincos"], 700 * 6)
            self.assertEqual(sizes["multiply"], 301 * 22)
            header = (Path(folder) / "golden_sincos.h").read_text()
            self.assertIn(f"golden_fetch({[table.stem for table in tables].index('sincos')}, ", header)


class Images(unittest.TestCase):
    """A test file made of names, through a made-up tool chain."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        for name, text in (("cc", COMPILER), ("ld", LINKER), ("sim", SIMULATOR)):
            path = self.folder / name
            path.write_text(text)
            path.chmod(0o755)
        (self.folder / "unity/src").mkdir(parents=True)
        (self.folder / "unity/src/unity.c").write_text("")
        (self.folder / "law.a").write_text("")
        here = Path.cwd()
        self.addCleanup(os.chdir, here)
        os.chdir(self.folder)
        for place in ("test/unit", "runners/unit"):
            (self.folder / place).mkdir(parents=True)

    def judge(self, on_target: list[str], on_pc: dict[str, str] | None = None, source: str = "int x;\n"):
        Path("test/unit/test_x.c").write_text(source)
        Path("runners/unit/test_x_runner.c").write_text("".join(f'  a[{i}].name = "{name}";\n  a[{i}].line_num = {i};\n' for i, name in enumerate(on_target)))
        host = Path("runners/unit/test_x")
        results = on_pc if on_pc is not None else {name: "PASS" for name in on_target}
        host.write_text("#!/bin/sh\ncat <<END\n" + "".join(f"test/unit/test_x.c:1:{name}:{text}\n" for name, text in results.items()) + "END\n")
        host.chmod(0o755)
        options = argparse.Namespace(out=f"{self.folder}/out", unity="unity", runners="runners", compile=f"{self.folder}/cc",
                                     link=f"{self.folder}/ld {{elf}} {{objects}}", library="law.a", simulator=f"{self.folder}/sim", cycles=1)
        builder = target_run.Builder(options)
        builder.shared()
        return target_run.judge("unit/test_x", builder, Path("runners"))

    def test_results_like_the_pcs_pass(self):
        lines, entries, passed, failed = self.judge(["test_a", "test_b"])
        self.assertEqual((passed, failed), (2, 0))
        self.assertEqual(entries, ["test/unit/test_x.c:test_a:PASS", "test/unit/test_x.c:test_b:PASS"])
        self.assertRegex(lines[-1], r"^unit/test_x: 2 passed, 0 failed \(1000 cycles")

    def test_what_does_not_fit_one_image_is_split_and_nothing_is_lost(self):
        names = [f"test_{letter}" for letter in "abcdefg"]
        lines, entries, passed, failed = self.judge(names)
        self.assertEqual((passed, failed), (7, 0))
        self.assertEqual([entry.split(":")[1] for entry in entries], names)
        self.assertIn("images, ", lines[-1])
        self.assertTrue((self.folder / "out/unit/test_x.2.elf").exists())

    def test_a_failure_on_the_target_only_is_told_with_both_sides(self):
        lines, _, passed, failed = self.judge(["test_a", "test_fails"])
        self.assertEqual((passed, failed), (1, 1))
        self.assertEqual(lines[0], "unit/test_x: test_fails: FAIL: Expected 1 Was 2 on the target, passes on the PC")

    def test_a_failure_on_the_pc_only_counts_too(self):
        _, _, passed, failed = self.judge(["test_a"], {"test_a": "FAIL: Expected 1 Was 3"})
        self.assertEqual((passed, failed), (0, 1))

    def test_a_test_that_the_target_never_ran_is_missed(self):
        lines, _, _, failed = self.judge(["test_a"], {"test_a": "PASS", "test_gone": "PASS"})
        self.assertEqual(failed, 1)
        self.assertIn("test_gone: FAIL: no result on the target", lines[0])

    def test_an_image_that_does_not_end_fails_with_the_simulators_reason(self):
        lines, entries, passed, failed = self.judge(["test_a", "test_hangs"])
        self.assertEqual((passed, failed), (0, 1))
        self.assertIn("stopped after test_a: did not end in the cycles allowed", lines[0])
        self.assertRegex(entries[0], "FAIL: stopped after")

    def test_other_errors_of_the_linker_are_no_reason_to_split(self):
        lines, _, _, failed = self.judge(["test_a", "test_lost"])
        self.assertEqual(failed, 1)
        self.assertIn("undefined reference to _lost", lines[0])

    def test_an_error_of_the_compiler_is_shown(self):
        lines, _, _, failed = self.judge(["test_a"], source="broken\n")
        self.assertEqual(failed, 1)
        self.assertIn("error: broken", lines[0])


@unittest.skipUnless(shutil.which("xc16-gcc") or os.environ.get("XC16"), "no xc16-gcc: make test-target cannot run")
class OnTheTarget(unittest.TestCase):
    def test_some_unit_tests_give_the_pcs_results(self):
        environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
        done = subprocess.run(["make", "-s", "test-target", "ONLY=test_pi test_trig"], cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        results = (ROOT / "build/target/test/report.txt").read_text()
        self.assertNotIn(":FAIL", results)
        self.assertGreater(results.count(":PASS"), 20)

    def test_an_unknown_test_is_one_line(self):
        environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
        done = subprocess.run(["make", "-s", "test-target", "ONLY=test_nothing"], cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertRegex(done.stderr, r"\Afoc33: no unit test of the control law, ONLY=test_nothing: use test_[^\n]*\nmake: [^\n]*\n\Z")


if __name__ == "__main__":
    unittest.main()
