"""The produced userparams.h: the project's own one is the tuner's output, and the firmware builds with every motor's."""

import re
import subprocess
import tempfile
import unittest
from pathlib import Path

from tools.common import paths
from tune_support import COMPILER, HURST, INCLUDES, designed, motors, of
from tuning import header
from tuning.params import parameters

WARNINGS = ["-std=gnu99", "-ftrack-macro-expansion=0", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
DEFINE = re.compile(r"^#define (\w+)[ \t]+(\S+)[ \t]*(?:/\* \[([^\]]*)\][ \t]+(\S+) \.\. (\S+)[ \t]+(\S.*?) \*/)?", re.MULTILINE)


class Root(unittest.TestCase):
    def test_the_project_s_userparams_is_the_tuner_s_output_for_the_note_s_motor(self):
        self.assertEqual((paths.ROOT / "userparams.h").read_text(encoding="utf-8"), header.write(of(HURST)),
                         f"the motor file, the tables or the tuner have changed: write it anew with make userparams MOTOR={HURST}")


class Builds(unittest.TestCase):
    def build(self, text: str) -> str:
        """What the compiler says about the whole firmware with this header, the interrupt optimised as in the library."""
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "userparams.h").write_text(text, encoding="utf-8")
            sources = sorted(str(path.relative_to(paths.ROOT)) for path in (paths.ROOT / "firmware").glob("*/*.c"))
            says = ""
            for arguments in (["-fsyntax-only", *sources], ["-O2", "-c", "firmware/board/isr.c", "-o", f"{folder}/isr.o"]):
                done = subprocess.run([*COMPILER, *WARNINGS, f"-I{folder}", *INCLUDES, *arguments], cwd=paths.ROOT, capture_output=True, text=True, check=False)
                says += done.stderr if done.returncode or done.stderr else ""
            return says

    def test_the_firmware_builds_without_a_warning_for_every_motor(self):
        for name in motors():
            with self.subTest(name):
                self.assertEqual(self.build(header.write(of(name))), "")

    def test_this_test_notices_a_value_that_the_build_refuses(self):
        text = header.write(of(HURST)).replace("#define KFILTER_ESDQ 1200", "#define KFILTER_ESDQ 9")
        self.assertIn("KFILTER_ESDQ = 9 is outside", self.build(text))


class Text(unittest.TestCase):
    def test_every_parameter_is_there_once_with_its_unit_and_range(self):
        for name in motors():
            text = header.write(of(name))
            found = DEFINE.findall(text)
            names = [row[0] for row in found if row[0] not in ("USERPARAMS_H", "D_CURRCNTR_PTERM", "Q_CURRCNTR_PTERM")]
            self.assertEqual(sorted(names), sorted(parameters()), name)
            for define, _, unit, low, high, meaning in found:
                table = re.sub(r"(_SPEED)\d+$", r"\g<1>0", define)
                if define in parameters() and (define == table or not define.startswith(("IDREF", "INVKFI", "LS_OVER"))):
                    p = parameters()[define]
                    self.assertEqual((unit, low, high), (p.unit, p.low, p.high), define)
                    self.assertTrue(meaning, define)

    def test_the_values_are_the_design_s(self):
        d = of("linix_45zwn24_40")
        found = {name: value for name, value, *_ in DEFINE.findall(header.write(d)) if name != "USERPARAMS_H"}
        self.assertEqual(found, d.params)

    def test_it_says_where_it_comes_from_and_what_is_wrong(self):
        text = header.write(of("anaheim_bly172s_24v_4000"))
        self.assertIn("tuning/motors/anaheim_bly172s_24v_4000.toml and tuning/boards/mclv.toml by: make tune MOTOR=anaheim_bly172s_24v_4000", text)
        self.assertIn("Note: rated current 3.86 A peak is above", text)

    def test_the_table_shows_each_constant_with_value_count_and_rounding(self):
        d = of(HURST)
        text = header.write(d)
        for item in d.constants:
            if "[" not in item.name:
                row = next(line for line in text.splitlines() if line.startswith(f" *   {item.name} "))
                self.assertIn(f" {item.q_value} ", row)
                self.assertRegex(row, r"exact|[+-]\d+\.\d+ %")

    def test_every_mode_is_there_and_off(self):
        text = header.write(of(HURST))
        self.assertEqual(re.findall(r"^/\* #define (\w+) \*/", text, re.MULTILINE), [name for name, _ in header.MODES])

    def test_comments_end_where_they_should(self):
        for name in motors():
            text = header.write(of(name))
            self.assertEqual(text.count("/*"), text.count("*/"), name)
            self.assertNotRegex(text, r"/\*(?:(?!\*/)[\s\S])*/\*", name)

    def test_a_title_cannot_end_a_comment(self):
        text = header.write(designed(('title = "a motor"', 'title = "bad */ title"')))
        self.assertEqual(text.count("/*"), text.count("*/"))

    def test_a_salient_motor_s_gains_are_given_for_each_axis(self):
        self.assertRegex(header.write(of("linix_45zwn24_40")), r"#define D_CURRCNTR_PTERM 0\.0\d+ +/\* .*Ld")
        self.assertNotIn("#define D_CURRCNTR_PTERM", header.write(of(HURST)))
