"""make cycles and make pil around the simulator: classes of interrupts, figures, budgets, texts, and what a user sees when something is missing."""

import contextlib
import io
import json
import subprocess
import sys
import tempfile
import unittest
from collections import Counter
from pathlib import Path
from unittest import mock

import numpy as np
import support
from test_target_build import NEEDED, make, our_lines, shutil

sys.path.append(str(Path(__file__).resolve().parents[1] / "fuzz"))
from sample_image import hex_text # noqa: E402
from tools.bench import pil, pil_command
from tools.common import paths # noqa: E402
from tools.common.errors import UserError # noqa: E402
from tools.image import cycles # noqa: E402
from tools.image.profile import Counts, Profile # noqa: E402


def found(name: str, without: list[int], weakening: list[int], latency: tuple[int, ...] = (700,), stack: int = 100, differences: int = 0) -> cycles.Found:
    """A scenario with these interrupts in closed loop."""
    def spread(values) -> cycles.Spread:
        return cycles.Spread.of(np.array(values))
    return cycles.Found({"STOPPED": spread([]), "CLOSED": spread(without + weakening), cycles.WITHOUT: spread(without), cycles.WITH: spread(weakening)},
                        spread(latency), Counts({0x200: 1}, {0x200: sum(without + weakening)}), stack, differences, 10,
                        "tick 3, P1DC1" if differences else "", {name: (max(without + weakening), 1.5, "CLOSED")}, 967, 2.0, 1.0, 5e6)


LIMITS = cycles.Limits(600, 500, 960, 512, ("demo",))


def report(item: cycles.Found, limits: cycles.Limits | None = LIMITS) -> cycles.Report:
    total = sum(item.counts.cycles.values())
    result = cycles.Report("foc33.elf", item, Profile(Counter(pi=total), Counter(_ADC1Interrupt=total), Counter({("_ADC1Interrupt", "pi"): total}),
                           {"_ADC1Interrupt": (9, 10)}, total), limits, [["ENTRY", "4", "cycles of an entry", "interrupts"]])
    result.broken = cycles.broken(result)
    return result


class Spreads(unittest.TestCase):
    def test_least_mean_and_most_of_the_values(self):
        spread = cycles.Spread.of(np.array([5, 7, 7, 9, 12]))
        self.assertEqual((spread.number, spread.least, spread.mean, spread.most), (5, 5, 8.0, 12))

    def test_two_spreads_are_added_value_by_value(self):
        spread = cycles.Spread.of(np.array([3])) + cycles.Spread.of(np.array([100, 2]))
        self.assertEqual((spread.number, spread.least, spread.mean, spread.most), (3, 2, 35.0, 100))

    def test_nothing_is_no_division(self):
        self.assertEqual(cycles.Spread().data(), {"interrupts": 0, "min": 0, "mean": 0.0, "max": 0})


class Classes(unittest.TestCase):
    def classes(self, states: list[int], reference: list[float]) -> dict[str, list[bool]]:
        result = cycles.classes(np.array(states), support.STATES, np.array(reference), 2640.0)
        return {name: which.tolist() for name, which in result.items()}

    def test_every_interrupt_belongs_to_one_state(self):
        result = self.classes(list(range(8)), [0.0] * 8)
        for number, name in support.STATES.items():
            self.assertEqual(result[name], [i == number for i in range(8)])

    def test_bridge_off_is_in_neither_figure(self):
        result = self.classes([0, 1, 2, 7], [3000.0] * 4)
        self.assertFalse(any(result[cycles.WITH] + result[cycles.WITHOUT]))

    def test_field_weakening_is_closed_loop_above_its_first_speed_either_way(self):
        result = self.classes([4, 5, 5, 5, 6, 6], [4000.0, 2600.0, 2640.0, -5500.0, 3000.0, 900.0])
        self.assertEqual(result[cycles.WITH], [False, False, True, True, True, False])
        self.assertEqual(result[cycles.WITHOUT], [True, True, False, False, False, True])


class Budgets(unittest.TestCase):
    def test_within_the_limits_nothing_is_said(self):
        self.assertEqual(report(found("demo", [500], [500, 510])).broken, ["mean interrupt with field weakening: 505.0 cycles, over the budget of 500"])
        self.assertEqual(report(found("demo", [500], [490, 510])).broken, [])

    def test_the_longest_interrupt_is_told_with_scenario_time_and_state(self):
        lines = report(found("demo", [400], [390, 601])).broken
        self.assertEqual(lines, ["longest interrupt: 601 cycles, 1 over the budget of 600 (demo at 1.5000 s, CLOSED)"])

    def test_latency_and_stack_have_limits(self):
        lines = report(found("demo", [400], [400], latency=(961,), stack=513)).broken
        self.assertEqual(lines, ["trigger to duties: 961 cycles, over the budget of 960", "stack: 513 bytes, over the budget of 512"])

    def test_duties_that_miss_their_load_break_it_whatever_the_budget(self):
        lines = report(found("demo", [400], [400], latency=(967,)), None).broken
        self.assertEqual(lines, ["trigger to duties: 967 cycles, but the duties load 967 cycles after the trigger"])

    def test_a_difference_from_the_pc_breaks_it_whatever_the_budget(self):
        lines = report(found("demo", [400], [400], differences=2), None).broken
        self.assertEqual(lines, ["target and PC differ in 2 interrupts, the first: tick 3, P1DC1"])

    def test_figures_without_field_weakening_in_them_are_no_figures(self):
        self.assertIn("no scenario ran with and without", report(found("smoke", [400], []), None).broken[0])

    def test_a_profile_that_misses_cycles_is_an_error(self):
        item = found("demo", [400], [400])
        item.counts.cycles[0x200] = 700
        self.assertIn("the profile has 700 cycles, the interrupts took 800", report(item, None).broken[0])

    def test_budget_file_has_the_limits(self):
        limits = cycles.Limits.read()
        self.assertLessEqual(limits.isr_max, 946) # the note's
        self.assertIn("demo", limits.scenarios)
        self.assertGreater(len(limits.scenarios), 3)

    def test_a_budget_file_without_cycles_is_refused_by_name(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "budget.toml"
            path.write_text("[budget.image]\nstack_bytes = 3\n", encoding="utf-8")
            with self.assertRaisesRegex(UserError, r"no table \[cycles\]"):
                cycles.Limits.read(path)

    def test_scenarios_are_put_together(self):
        whole = cycles.merged([found("demo", [400], [500], stack=90), found("stop", [300], [450], latency=(800,), stack=110)])
        self.assertEqual((whole.spreads[cycles.WITHOUT].least, whole.spreads[cycles.WITH].most), (300, 500))
        self.assertEqual((whole.latency.most, whole.stack_bytes, set(whole.longest)), (800, 110, {"demo", "stop"}))
        self.assertEqual(whole.counts.cycles, {0x200: 1650})


class Output(unittest.TestCase):
    def test_table_has_cycles_us_load_and_the_notes_figures(self):
        lines = cycles.text(report(found("demo", [400, 600], [500]))).splitlines()
        row = next(line for line in lines if line.startswith(cycles.WITHOUT))
        self.assertEqual(row.split(), "without field weakening 2 400 500.0 600 10.00 12.50 15.00 25.0 % 14.725 / 20.8 / 21.4".split())
        self.assertTrue(any("ENTRY" in line and "cycles of an entry" in line for line in lines))

    def test_files_are_written_and_the_readme_table_follows_from_them(self):
        with tempfile.TemporaryDirectory() as folder:
            files = cycles.write(report(found("demo", [400], [440, 480])), Path(folder))
            data = json.loads(files[0].read_text())
            head, rows = cycles.readme_table(data)
            self.assertTrue(all(len(row) == len(head) for row in rows))
            self.assertIn(["interrupt with field weakening", "14.975 / 23.325 / 23.65", "440 / 460 / 480", "11.00 / 11.50 / 12.00"], rows)
            self.assertTrue(files[1].read_text().startswith("<svg"))
            self.assertEqual(files[2].read_text(), "_ADC1Interrupt;pi 440.000\n")

    def test_comparison_names_the_first_difference(self):
        counted = pil.Cycles(*[0.0] * len(pil.Cycles.__dataclass_fields__))
        run = support.run()
        good = pil_command.comparison(pil.PilRun(run, counted, 100, 0, ""))
        bad = pil_command.comparison(pil.PilRun(run, counted, 100, 4, "tick 7 (0.1 s), P1DC2: target 1, host 2"))
        self.assertTrue(good.ok)
        self.assertFalse(bad.ok)
        self.assertIn("a HEX file", pil_command.comparison(pil.PilRun(run, counted, 0, 0, "", has_names=False)).got)
        self.assertIn("100 interrupts, 4 differ; first: tick 7 (0.1 s), P1DC2: target 1, host 2", bad.got)

    def test_an_image_that_never_enters_its_interrupt_does_not_agree(self):
        counted = pil.Cycles(*[0.0] * len(pil.Cycles.__dataclass_fields__))
        run = support.run()
        self.assertFalse(pil_command.comparison(pil.PilRun(run, counted, 0, 0, "")).ok)
        run.scenario.defines.append("IDENTIFY")
        self.assertTrue(pil_command.comparison(pil.PilRun(run, counted, 0, 0, "")).ok)


class ForTheUser(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def path_without_compiler(self) -> str:
        for name in (*NEEDED, "ruby", "gem", "dpkg", "date", "tr", "ld", "as"):
            found_at = shutil.which(name)
            if found_at:
                (self.folder / name).symlink_to(found_at)
        return str(self.folder)

    def test_without_the_compiler_each_command_says_so_in_one_line(self):
        path = self.path_without_compiler()
        for target in ("pil", "cycles", "test-target"):
            with self.subTest(target):
                done = make(target, "VARIANT=none", path=path)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertEqual(len(our_lines(done)), 1, done.stderr)
                self.assertRegex(our_lines(done)[0], "no xc16-gcc, not on PATH: install Microchip's MPLAB XC16")

    def test_what_cycles_cannot_do_is_one_line(self):
        for word, expected in (("MOTOR=hurst_dmb0224c10002", "make cycles has no MOTOR"), ("BOARD=mclv", "no BOARD"), ("USERPARAMS=/nowhere", "no userparams.h")):
            with self.subTest(word):
                done = make("cycles", "IMAGE=/nowhere", word)
                self.assertEqual((done.returncode, len(our_lines(done))), (2, 1), done.stderr)
                self.assertIn(expected, our_lines(done)[0])
                self.assertNotIn("No such file", done.stderr)

    def module(self, name: str, *arguments: str) -> tuple[int, list[str]]:
        error = io.StringIO()
        with contextlib.redirect_stderr(error), contextlib.redirect_stdout(io.StringIO()):
            status = (cycles if name == "cycles" else pil_command).main(list(arguments))
        return status, error.getvalue().splitlines()

    def test_an_image_that_is_not_there_is_named(self):
        for name in ("cycles", "pil"):
            with self.subTest(name):
                self.assertEqual(self.module(name, "--image", "/no/such.elf"), (2, ["foc33: no image '/no/such.elf', --image: build one with make "
                                                                                   "firmware, or name a file that is there"]))

    def test_a_file_that_is_no_image_is_refused(self):
        path = self.folder / "text.elf"
        path.write_text("hello", encoding="utf-8")
        code, lines = self.module("cycles", "--image", str(path))
        self.assertEqual((code, len(lines)), (2, 1))
        self.assertIn(str(path), lines[0])

    def test_an_image_without_names_cannot_be_measured(self):
        path = self.folder / "alone.hex"
        path.write_text(hex_text(), encoding="utf-8")
        code, lines = self.module("cycles", "--image", str(path))
        self.assertEqual((code, len(lines)), (2, 1))
        self.assertIn("name the ELF file", lines[0])

    def test_a_file_of_gigabytes_is_refused_at_once(self):
        path = self.folder / "huge.elf"
        with path.open("wb") as file:
            file.write(b"\x7fELF")
            file.truncate(5 << 30)
        for name in ("cycles", "pil"):
            with self.subTest(name):
                code, lines = self.module(name, "--image", str(path), *(["smoke", "--out", str(self.folder / "out")] if name == "pil" else []))
                self.assertEqual((code, len(lines)), (2, 1))
                self.assertIn("cannot be read", lines[0])
        self.assertFalse((self.folder / "out").exists())

    def test_an_unknown_scenario_is_refused(self):
        path = self.folder / "x.elf"
        path.write_text("", encoding="utf-8")
        code, lines = self.module("pil", "demmo", "--image", str(path))
        self.assertEqual(code, 2)
        self.assertIn("did you mean 'demo'?", lines[0])

    def test_what_looks_like_an_option_and_is_none_is_one_line(self):
        for name in ("pil", "cycles"):
            code, lines = self.module(name, "--nonsense")
            self.assertEqual((code, len(lines)), (2, 1))
            self.assertIn("--nonsense", lines[0])

    def test_table2_goes_where_out_says(self):
        image = self.folder / "x.hex"
        image.write_text(hex_text(), encoding="utf-8")
        for given, wanted in (([], paths.RESULTS / "pil-table2"), (["--out", str(self.folder)], self.folder)):
            with mock.patch.object(pil_command.table2, "command", return_value=0) as command:
                self.module("pil", "table2", "--image", str(image), *given)
                self.assertEqual(command.call_args.args[0].out, wanted)

    def test_one_folder_for_two_scenarios_is_refused(self):
        code, lines = self.module("pil", "demo", "smoke", "--out", str(self.folder))
        self.assertEqual((code, len(lines)), (2, 1))
        self.assertIn("--out", lines[0])

    def test_modules_run_from_the_command_line(self):
        for name in ("tools.image.cycles", "tools.bench.pil_command"):
            done = subprocess.run([sys.executable, "-m", name, "--help"], capture_output=True, text=True, check=False)
            self.assertIn("--image", done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
