"""The produced userparams.h: the project's own one is the tuner's output, the firmware builds with every motor's, and a new parameter is one row."""

import functools
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import openpyxl

from tools.common import motor_file, param_rows, paths
from tools.common.errors import UserError
from tools.common.param_rows import parameters
from tools.docs import tables
from tune_support import COMPILER, HURST, INCLUDES, designed, motor_path, motors, of
from tuning import constants, header, spreadsheet

WARNINGS = ["-std=gnu99", "-ftrack-macro-expansion=0", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
DEFINE = re.compile(r"^#define (\w+)[ \t]+(\S+)[ \t]*(?:/\* \[([^\]]*)\][ \t]+(\S+) \.\. (\S+)[ \t]+(\S.*?) \*/)?", re.MULTILINE)


@functools.cache
def written(name: str) -> str:
    return header.write(of(name))


def build(text: str, *arguments: str, includes: list[str] = INCLUDES) -> str:
    """What the compiler says with this header."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "userparams.h").write_text(text, encoding="utf-8")
        command = [*COMPILER, *WARNINGS, f"-I{folder}", *includes, *arguments, "-c", *(["-o", f"{folder}/out.o"] if "-O2" in arguments else [])]
        return subprocess.run(command, cwd=paths.ROOT, capture_output=True, text=True, check=False).stderr


class Project(unittest.TestCase):
    def test_the_project_s_userparams_is_the_tuner_s_output_for_the_hurst(self):
        self.assertEqual((paths.ROOT / "userparams.h").read_text(encoding="utf-8"), written(HURST),
                         f"the motor file, the tables or the tuner have changed: write it anew with make userparams MOTOR={HURST}")

    def test_the_firmware_builds_without_a_warning_for_every_motor(self):
        """The interrupt optimised, as in the library."""
        sources = sorted(str(path.relative_to(paths.ROOT)) for path in (paths.ROOT / "firmware").rglob("*.c"))
        for name in motors():
            with self.subTest(name):
                self.assertEqual(build(written(name), "-fsyntax-only", *sources) + build(written(name), "-O2", "firmware/board/isr.c"), "")

    def test_this_test_notices_a_value_that_the_build_refuses(self):
        text = written(HURST).replace("#define KFILTER_ESDQ 1200", "#define KFILTER_ESDQ 9")
        self.assertIn("KFILTER_ESDQ = 9 is outside", build(text, "-fsyntax-only", "firmware/drive/param_check.c"))


class Text(unittest.TestCase):
    def test_every_parameter_is_there_once_with_the_design_s_value_and_its_row_s_unit_range_and_meaning(self):
        for name in motors():
            found = {define: rest for define, *rest in DEFINE.findall(written(name)) if define != "USERPARAMS_H"}
            self.assertEqual({define: rest[0] for define, rest in found.items()}, of(name).params, name)
            self.assertLessEqual(set(parameters()), set(found), name)
            for p in parameters().values():
                stated = found[f"{p.stem}0" if p.stem else p.name][1:]
                self.assertEqual(stated[:3], [p.unit, p.low, p.high], p.name)
                self.assertTrue(stated[3].startswith(p.meaning), p.name)

    def test_it_says_where_it_comes_from_and_what_is_wrong(self):
        text = written("anaheim_bly172s_24v_4000")
        self.assertIn("tuning/motors/anaheim_bly172s_24v_4000.toml and tuning/boards/mclv.toml by: make tune MOTOR=anaheim_bly172s_24v_4000", text)
        self.assertIn("Note: rated current 3.86 A peak is above", text)

    def test_the_table_shows_each_constant_with_value_count_and_rounding(self):
        for item in of(HURST).constants:
            if "[" not in item.name:
                row = next(line for line in written(HURST).splitlines() if line.startswith(f" *   {item.name} "))
                self.assertRegex(row, rf" {item.q_value} .*(exact|[+-]\d+\.\d+ %)")

    def test_every_mode_is_there_and_off(self):
        self.assertEqual(re.findall(r"^/\* #define (\w+) \*/", written(HURST), re.MULTILINE), list(param_rows.modes()))

    def test_comments_end_where_they_should_and_a_title_cannot_end_one(self):
        for text in (*map(written, motors()), header.write(designed(('title = "a motor"', 'title = "bad */ title"')))):
            self.assertEqual(text.count("/*"), text.count("*/"))
            self.assertNotRegex(text, r"/\*(?:(?!\*/)[\s\S])*/\*")

    def test_a_salient_motor_s_gains_are_given_for_each_axis(self):
        self.assertRegex(written("linix_45zwn24_40"), r"#define D_CURRCNTR_PTERM 0\.0\d+ +/\* .*Ld")
        self.assertNotIn("#define D_CURRCNTR_PTERM", written(HURST))


class NewRow(unittest.TestCase):
    """One row more in a copy of param_table.h, and nothing else."""

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.include = Path(folder.name) / "include"
        shutil.copytree(paths.ROOT / "include", self.include)
        self.table = self.include / "drive" / "param_table.h"
        row = '    X(SNAPDELAY, "periods"'
        text = self.table.read_text(encoding="utf-8")
        assert text.count(row) == 1
        self.table.write_text(text.replace(row, f'    X(NEW_A, "A peak", 0.1, 20, 1.5, "what a test adds") \\\n{row}'), encoding="utf-8")
        for place, value in (("tools.common.param_rows.TABLE", self.table), ("tuning.constants.INCLUDE", self.include)):
            patch = mock.patch(place, value)
            patch.start()
            self.addCleanup(patch.stop)
        self.forget()
        self.addCleanup(self.forget)

    def forget(self) -> None:
        param_rows.parameters.cache_clear()
        constants._headers.cache_clear()

    def test_it_appears_in_the_header_the_build_the_tuner_the_spreadsheet_and_the_docs(self):
        text = header.write(designed())
        self.assertRegex(text, r"#define NEW_A 1\.5 +/\* \[A peak\] +0\.1 \.\. 20 +what a test adds \*/\n#define SNAPDELAY")
        includes = ["-Itools/cpu_host", f"-I{self.include}"]
        refused = build(text.replace("NEW_A 1.5", "NEW_A 30"), "-fsyntax-only", "firmware/drive/param_check.c", includes=includes)
        self.assertIn("userparams.h: NEW_A = 30 is outside 0.1 .. 20 A peak", refused)
        self.assertEqual(build(text, "-fsyntax-only", "firmware/drive/param_check.c", includes=includes), "")
        self.assertEqual(designed(more="[tune]\nNEW_A = 2.5\n").params["NEW_A"], "2.5")
        with motor_path(more="[tune]\nNEW_A = 30\n") as path, self.assertRaisesRegex(UserError, "NEW_A"):
            motor_file.load(str(path))
        self.assertEqual(constants.header(designed().params | {"NEW_A": "0.05"}).wrong, ["NEW_A = 0.05 is outside 0.1 .. 20 A peak"])
        self.assertIn("| `NEW_A` | A peak | 0.1 | 20 | 1.5 | what a test adds |\n", tables.params())
        with tempfile.TemporaryDirectory() as folder:
            spreadsheet.write(Path(folder) / "new.xlsx")
            book = openpyxl.load_workbook(Path(folder) / "new.xlsx")
            self.assertTrue(any(cell.value == "NEW_A" for cell in book["Parameters"]["A"]))
            self.assertTrue(any("#define NEW_A " in str(cell.value) for cell in book["Paste"]["A"]))

    def test_a_row_that_cannot_be_read_is_told(self):
        self.table.write_text(self.table.read_text(encoding="utf-8").replace('0.1, 20, 1.5, "what', '0.1, 20, "what'), encoding="utf-8")
        self.forget()
        with self.assertRaisesRegex(UserError, r"a row cannot be read: X\(NEW_A, .*param_table.h"):
            parameters()


class Pages(unittest.TestCase):
    def test_the_rows_are_read_as_the_compiler_reads_them(self):
        found = tables.rows("include", "drive/param_table.h", "PARAM_TABLE", "#name unit #low #high #default meaning")
        self.assertEqual([row[:4] + row[5:] for row in found], [[p.name, p.unit, p.low, p.high, p.meaning] for p in parameters().values()])

    def test_every_page_has_the_table_that_its_header_has_now(self):
        for name in tables.PAGES:
            self.assertEqual((paths.ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8"), tables.page(name), "run: python3 -m tools.docs.tables")

    def test_every_assumption_of_the_simulator_and_every_relation_has_a_row(self):
        text = "".join((paths.ROOT / "tools" / name).read_text(encoding="utf-8") for name in ("cpu_33f/iss_assumptions.h", "chip/chip_assumptions.h"))
        self.assertEqual(tables.simulator().count("\n| `"), text.count("    X("))
        text = param_rows.TABLE.read_text(encoding="utf-8").partition("#define PARAM_RELATION_TABLE")[2].partition("#define PARAM_RELATION_IDREF")[0]
        self.assertEqual(tables.params().count("\n- "), text.count("    X(") + 1)


if __name__ == "__main__":
    unittest.main()
