"""make size: every word and byte is counted once, with the module it belongs to, and a budget fails exactly when it is exceeded."""

import contextlib
import io
import json
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from size_support import Function, Program

from tools.common import paths
from tools.common.errors import UserError
from tools.image import attribution, base, size, stack
from tools.image.budget import Budget, shares

BUDGET = """
with_caller = ["qm_*"]
[budget.note]
flash_bytes = 60
ram_bytes = 20
[budget.image]
flash_bytes = 120
ram_bytes = 40
stack_bytes = 30
[stack]
calls_nothing = []
[[group]]
name = "law"
title = "the law"
note_flash_bytes = 60
[[group]]
name = "more"
title = "additions"
[[module]]
name = "control"
group = "law"
functions = ["tick", "park", "tick_l*"]
objects = ["drive", "table"]
files = ["pi.h"]
[[module]]
name = "start"
group = "law"
functions = ["_reset*"]
objects = ["(start values)", "drive.run.estimator"]
[[module]]
name = "guard"
group = "more"
functions = ["guard", "tick*"]
objects = ["drive.fault", "drive.run.estimator.lost", "table.limit"]
[[module]]
name = "hand-over"
group = "more"
whole = true
functions = ["hand_over"]
objects = ["(texts)", "(alignment)"]
"""


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        (self.folder / "budget.toml").write_text(BUDGET, encoding="utf-8")
        self.budget = Budget.read(self.folder / "budget.toml")

    def image(self, program: Program) -> attribution.Image:
        return attribution.read(program.write(self.folder / "test.elf"))

    def flash(self, program: Program) -> dict[tuple[str, str], int]:
        found = shares(self.image(program), self.budget)
        self.assertEqual(sum(share.flash for share in found.values()), self.image(program).flash_bytes)
        return {key: share.flash for key, share in found.items() if share.flash}

    def ram(self, program: Program) -> dict[tuple[str, str], int]:
        found = shares(self.image(program), self.budget)
        self.assertEqual(sum(share.ram for share in found.values()), self.image(program).ram_bytes)
        return {key: share.ram for key, share in found.items() if share.ram}


class Flash(Case):
    def test_a_word_is_three_bytes(self):
        self.assertEqual(self.flash(Program([(0x200, 10)], [Function("tick", "t.c", 1, 0x200, 0x214)])), {("control", "tick"): 30})

    def test_what_is_inlined_is_counted_with_its_own_module(self):
        tick = Function("tick", "t.c", 1, 0x200, 0x214, [Function("guard", "g.h", 1, 0x204, 0x20A)])
        self.assertEqual(self.flash(Program([(0x200, 10)], [tick])), {("control", "tick"): 21, ("guard", "guard"): 9})

    def test_a_small_function_is_counted_with_whoever_uses_it(self):
        guard = Function("guard", "g.h", 1, 0x204, 0x20A, [Function("qm_abs", "q.h", 1, 0x206, 0x20A)])
        tick = Function("tick", "t.c", 1, 0x200, 0x214, [guard, Function("qm_abs", "q.h", 1, 0x210, 0x214)])
        self.assertEqual(self.flash(Program([(0x200, 10)], [tick])), {("control", "tick"): 21, ("guard", "guard"): 9})

    def test_a_whole_module_counts_all_that_is_inlined_into_it(self):
        inner = Function("hand_over", "h.h", 1, 0x204, 0x210, [Function("park", "p.h", 1, 0x206, 0x20A), Function("guard", "g.h", 1, 0x20A, 0x20C)])
        self.assertEqual(self.flash(Program([(0x200, 10)], [Function("tick", "t.c", 1, 0x200, 0x214, [inner])])),
                         {("control", "tick"): 12, ("hand-over", "hand_over"): 18})

    def test_a_function_that_nobody_names_goes_by_its_file(self):
        self.assertEqual(self.flash(Program([(0x200, 4)], [Function("pi_new", "pi.h", 1, 0x200, 0x208)])), {("control", "pi_new"): 12})

    def test_a_name_in_full_comes_before_a_pattern_that_fits_too(self):
        code = [Function("tick", "t.c", 1, 0x200, 0x202), Function("tick_new", "t.c", 5, 0x202, 0x206)]
        self.assertEqual(self.flash(Program([(0x200, 3)], code)), {("control", "tick"): 3, ("guard", "tick_new"): 6})

    def test_the_longer_of_two_patterns_that_fit_counts(self):
        code = [Function("tick_long", "t.c", 1, 0x200, 0x202), Function("tick_new", "t.c", 5, 0x202, 0x206)]
        self.assertEqual(self.flash(Program([(0x200, 3)], code)), {("control", "tick_long"): 3, ("guard", "tick_new"): 6})

    def test_the_innermost_function_counts(self):
        park = Function("park", "p.h", 1, 0x202, 0x20A, [Function("guard", "g.h", 1, 0x204, 0x206)])
        self.assertEqual(self.flash(Program([(0x200, 5)], [Function("tick", "t.c", 1, 0x200, 0x20A, [park])])),
                         {("control", "tick"): 3, ("control", "park"): 9, ("guard", "guard"): 3})

    def test_where_stretches_have_gaps_the_line_says_the_function(self):
        # the stretch of guard is its first word only; the compiler has moved the other one behind a word of tick
        tick = Function("tick", "t.c", 1, 0x200, 0x20A, [Function("guard", "g.h", 3, 0x202, 0x204)])
        lines = [(0x200, "t.c", 2), (0x202, "g.h", 4), (0x204, "t.c", 3), (0x206, "g.h", 5), (0x208, "t.c", 4)]
        self.assertEqual(self.flash(Program([(0x200, 5)], [tick], lines=lines, lines_end=0x20A)),
                         {("control", "tick"): 9, ("guard", "guard"): 6})

    def test_each_copy_counts(self):
        tick = Function("tick", "t.c", 1, 0x200, 0x20A, [Function("guard", "g.h", 1, 0x200, 0x202), Function("guard", "g.h", 1, 0x206, 0x20A)])
        share = shares(self.image(Program([(0x200, 5)], [tick])), self.budget)["guard", "guard"]
        self.assertEqual((share.flash, len(share.copies)), (9, 2))

    def test_a_function_that_the_linker_removed_is_not_counted(self):
        gone = Function("guard", "g.h", 1, 0, 0x300, [Function("park", "p.h", 1, 0x200, 0x204)])
        program = Program([(0x200, 2)], [gone], labels=[("__reset", 0x200)])
        self.assertEqual(self.flash(program), {("start", "_reset"): 6})

    def test_code_without_debugging_information_goes_by_its_label(self):
        program = Program([(0x200, 3), (0x300, 2)], [Function("tick", "t.c", 1, 0x300, 0x304)], labels=[("__reset", 0x200), (".Lx", 0x202)])
        self.assertEqual(self.flash(program), {("start", "_reset"): 9, ("control", "tick"): 6})

    def test_vectors_are_not_counted_and_start_values_are(self):
        program = Program([(0x200, 1)], [Function("tick", "t.c", 1, 0x200, 0x202)], vectors=[0x200, 0x300], start_values=[0x800, 4, 0, 0])
        self.assertEqual(self.flash(program), {("control", "tick"): 3, ("start", "(start values)"): 12})
        self.assertEqual(self.image(program).handlers, [0x200, 0x300])

    def test_constants_take_three_bytes_for_two(self):
        self.assertEqual(self.flash(Program(constants=[("_table", 128), (".LC0", 6), (".LC1", 4)])),
                         {("control", "table"): 192, ("hand-over", "(texts)"): 15})

    def test_texts_of_an_odd_length_share_a_word_without_counting_it_twice(self):
        self.assertEqual(self.flash(Program(constants=[("_table", 4), (".LC0", 3), (".LC1", 5)])),
                         {("control", "table"): 6, ("hand-over", "(texts)"): 12})

    def test_a_member_of_a_constant_can_have_another_module(self):
        program = Program(constants=[("_table", 10)], types={"table": {"gain": 2, "limit": 2, "rest": 6}})
        self.assertEqual(self.flash(program), {("control", "table"): 12, ("guard", "table.limit"): 3})

    def test_a_list_of_start_values_that_calls_a_function_is_noticed(self):
        for values, calls in (([0x800, 4, 0, 0], False), ([0x800, 4, 1, 7, 7, 0], False), ([0x800, 4, 2, 7, 7, 0], False),
                              ([0x800, 4, 3, 0], True), ([0x800, 4, 1, 7, 7, 0x900, 2, 3, 0], True), ([0x800, 0x10000 + 4, 0x7F0000, 0], False)):
            with self.subTest(values):
                self.assertEqual(self.image(Program([(0x200, 1)], start_values=values)).initial_calls, calls)


class Ram(Case):
    TYPES = {"drive": {"fault": 2, "estimator": {"history": 8, "lost": 2}, "rest": 4}}

    def test_members_go_to_their_modules_and_the_rest_stays(self):
        self.assertEqual(self.ram(Program(variables=[("_drive", 16, True)], types=self.TYPES)),
                         {("control", "drive"): 4, ("start", "drive.run.estimator"): 8, ("guard", "drive.fault"): 2, ("guard", "drive.run.estimator.lost"): 2})

    def test_an_object_without_a_size_ends_at_the_next(self):
        self.assertEqual(self.ram(Program(variables=[("_table", 6, False), ("_drive", 10, True)])), {("control", "table"): 6, ("control", "drive"): 10})

    def test_an_object_that_nobody_names_is_not_assigned(self):
        self.assertEqual(self.ram(Program(variables=[("_new", 6, True)])), {("not assigned", "new"): 6})


class Limits(Case):
    """The budgets of the test: 60 and 120 bytes of flash, 20 and 40 of RAM, 30 of stack."""

    def report(self, tick: int, guard: int = 0, ram: int = 0, fault: int = 0, listing: str = "", before=None, limits: bool = True) -> size.Report:
        functions = [Function("tick", "t.c", 1, 0x200, 0x200 + 2 * tick), Function("guard", "g.c", 1, 0x400, 0x400 + 2 * guard)]
        variables = [item for item in (("_drive", ram, True), ("_fault", fault, True)) if item[1]]
        path = Program([(0x200, tick), (0x400, guard)] if guard else [(0x200, tick)], functions, variables=variables).write(self.folder / "l.elf")
        return size.measure(path, self.budget, listing or "00000200 <_tick>:\n   200:\t00 00 06    \treturn    \n", "", before, limits)

    def test_at_the_budget_everything_holds(self):
        self.assertEqual(self.report(20, 20, ram=20).broken, [])

    def test_one_word_more_is_a_line_that_says_how_much(self):
        self.assertEqual(self.report(21, 19).broken, ["flash, control law, field weakening and user interface: 63 bytes, 3 over the budget of 60"])
        self.assertEqual(self.report(20, 21).broken, ["flash, whole image: 123 bytes, 3 over the budget of 120"])

    def test_ram_and_stack_have_their_lines(self):
        self.assertEqual(self.report(1, ram=22).broken, ["RAM, control law, field weakening and user interface: 22 bytes, 2 over the budget of 20"])
        deep = "00000200 <_tick>:\n   200:\t00 00 00    \tlnk       #0x1e\n   202:\t00 00 00    \tulnk      \n   204:\t00 00 06    \treturn    \n"
        self.assertEqual(self.report(1, listing=deep).broken, ["stack: 32 bytes at its deepest, 2 over the budget of 30"])

    def test_a_stack_that_cannot_be_followed_is_a_line(self):
        wild = "00000200 <_tick>:\n   200:\t00 00 00    \tcall      w2\n   202:\t00 00 06    \treturn    \n"
        self.assertEqual(self.report(1, listing=wild).broken, ["stack: tick: call through a pointer at 0x200 (call w2)"])

    def test_what_no_module_claims_is_a_line_and_counts_as_the_note_s(self):
        report = self.report(1, fault=4)
        self.assertEqual(report.broken, ["'fault' is counted with no module: name it in firmware/budget.toml"])
        self.assertEqual(next(row.ram for row in report.rows if row.name == size.NOTE_TITLE), 4)

    def test_another_mode_has_no_budget(self):
        self.assertEqual(self.report(200, 200, ram=100, limits=False).broken, [])

    def test_a_module_with_a_budget_of_its_own_is_held_to_it(self):
        (self.folder / "budget.toml").write_text(BUDGET.replace('name = "guard"\n', 'name = "guard"\nflash_bytes = 6\n'), encoding="utf-8")
        self.budget = Budget.read(self.folder / "budget.toml")
        self.assertEqual(self.report(1, 2).broken, [])
        self.assertEqual(self.report(1, 3).broken, ["flash, guard: 9 bytes, 3 over the budget of 6"])

    def test_the_change_is_counted_for_what_came_what_went_and_the_sums(self):
        before = shares(self.image(Program([(0x200, 5), (0x300, 4)], [Function("tick", "t.c", 1, 0x200, 0x20A), Function("park", "p.c", 1, 0x300, 0x308)])),
                        self.budget)
        rows = {row.name: row.flash_change for row in self.report(7, 2, before=before).rows}
        self.assertEqual((rows["tick"], rows["park"], rows["guard"]), (6, -12, 6))
        self.assertEqual((rows["control"], rows["the law"], rows["whole image"]), (-6, -6, 0))
        self.assertEqual({row.flash_change for row in self.report(7).rows}, {None})

    def test_the_table_has_the_note_the_budget_and_the_sums(self):
        report = self.report(20, 3, ram=10)
        report.no_base = "there is no git history here"
        lines = size.text(report).splitlines()
        self.assertEqual(next(line.split() for line in lines if line.startswith("the law")), ["the", "law", "60", "60", "10"])
        self.assertEqual(next(line.split() for line in lines if line.startswith("whole image")), ["whole", "image", "69", "120", "10", "40"])
        self.assertEqual(lines[-1], "no column for the change: there is no git history here")

    def test_the_files_hold_the_same_sums(self):
        report = self.report(20, 3, ram=10)
        files = size.write(report, self.folder / "out")
        self.assertEqual([path.name for path in files], ["size.json", "size.csv", "size.png"])
        data = json.loads(files[0].read_text(encoding="utf-8"))
        self.assertEqual(next(row["flash"] for row in data["rows"] if row["name"] == "whole image"), 69)
        self.assertEqual(len(files[1].read_text(encoding="utf-8").splitlines()), len(data["rows"]) + 1)
        self.assertTrue(files[2].read_bytes().startswith(b"\x89PNG"))
        head, body = size.readme_table(data)
        self.assertEqual({len(row) for row in body}, {len(head)})
        self.assertEqual([row[0] for row in body], ["the law", "additions", size.NOTE_TITLE, "whole image", "stack at its deepest"])


class BadInput(Case):
    def fails(self, *words: str, data: bytes | None = None, arguments: tuple[str, ...] = ()) -> None:
        path = self.folder / "bad.elf"
        if data is not None:
            path.write_bytes(data)
        out, error = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
            status = size.main([str(path), "--out", str(self.folder / "out"), "--objdump", "true", *arguments])
        self.assertEqual((status, error.getvalue().count("\n"), out.getvalue()), (2, 1, ""), error.getvalue())
        for word in ("foc33: ", *words):
            self.assertIn(word, error.getvalue())
        self.assertFalse((self.folder / "out").exists())

    def test_no_image(self):
        self.fails("No such file", "make firmware")

    def test_no_compiler(self):
        self.fails("no no-such-objdump", "XC16", arguments=("--objdump", "no-such-objdump"))

    def test_another_machine_s_program(self):
        self.fails("not a linked dsPIC program", data=Program([(0x200, 1)], machine=62).bytes())

    def test_no_debugging_information(self):
        self.fails("compile with -g", data=Program([(0x200, 1)], debug=False).bytes())

    def test_names_that_are_no_text(self):
        self.fails("compile with -g", data=Program([(0x200, 1)], debug=False).bytes(), arguments=("--objdump", r"printf '\351'"))

    def test_a_file_cut_short_anywhere(self):
        data = Program([(0x200, 5)], [Function("tick", "t.c", 1, 0x200, 0x20A)], lines=[(0x200, "t.c", 2)], lines_end=0x20A,
                       constants=[("_table", 8)], variables=[("_drive", 8, True)], types={"drive": {"a": 8}}).bytes()
        for length in range(0, len(data), 37):
            with self.subTest(length):
                (self.folder / "cut.elf").write_bytes(data[:length])
                with self.assertRaises(UserError):
                    attribution.read(self.folder / "cut.elf")

    def test_a_wrong_option(self):
        self.fails("--help", arguments=("--wrong",))

    def test_a_budget_file_that_names_no_group(self):
        (self.folder / "budget.toml").write_text(BUDGET.replace('group = "more"', 'group = "mroe"'), encoding="utf-8")
        with self.assertRaisesRegex(UserError, "'mroe' is no group, .*budget.toml line .*more"):
            Budget.read(self.folder / "budget.toml")

    def test_a_budget_file_with_an_unknown_key(self):
        (self.folder / "budget.toml").write_text(BUDGET.replace("whole = true", "hole = true"), encoding="utf-8")
        with self.assertRaisesRegex(UserError, "unknown key 'hole'"):
            Budget.read(self.folder / "budget.toml")


COMPILER = """#!/bin/sh
echo "$@" >>"$LOG"
[ -z "$FAIL" ] || exit 1
for word; do last=$before; before=$word; done
cp "$IMAGE" "$before"
"""


@unittest.skipUnless(shutil.which("git"), "git is not installed")
class LastCommit(Case):
    """With a repository and a compiler of the test's own."""

    def setUp(self):
        super().setUp()
        self.root = self.folder / "repository"
        (self.root / "firmware" / "board").mkdir(parents=True)
        self.compiler = self.folder / "compiler"
        self.compiler.write_text(COMPILER, encoding="utf-8")
        self.compiler.chmod(0o755)
        self.image_path = Program([(0x200, 3)], [Function("tick", "t.c", 1, 0x200, 0x206)]).write(self.folder / "made.elf")
        self.log = self.folder / "log"
        environment = {"LOG": str(self.log), "IMAGE": str(self.image_path), "FAIL": "", "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull,
                       "GIT_CEILING_DIRECTORIES": str(self.folder)}
        for name in ("AUTHOR", "COMMITTER"):
            environment |= {f"GIT_{name}_NAME": "t", f"GIT_{name}_EMAIL": "t@example.org"}
        patch = mock.patch.dict(os.environ, environment)
        patch.start()
        self.addCleanup(patch.stop)

    def git(self, *words: str) -> str:
        return subprocess.run(["git", *words], cwd=self.root, check=True, capture_output=True, text=True).stdout.strip()

    def commit(self, text: str) -> str:
        if not (self.root / ".git").exists():
            self.git("init", "-q")
        self.edit(text)
        self.git("add", "-A")
        self.git("commit", "-q", "-m", text)
        return self.git("rev-parse", "HEAD")

    def edit(self, text: str) -> None:
        (self.root / "firmware" / "board" / "main.c").write_text(f"/* {text} */\n", encoding="utf-8")

    def build(self, commit: str, flag: str = "-O2") -> Path:
        return base.build(commit, [str(self.compiler), flag], [str(self.compiler), "{objects}", "-Wl,-Map={map}", "-o", "{elf}"], self.root)

    def test_changed_sources_are_compared_with_the_last_commit(self):
        commit = self.commit("one")
        self.edit("two")
        self.assertEqual(base.commit(self.root), commit)

    def test_a_new_file_is_a_change(self):
        commit = self.commit("one")
        (self.root / "firmware" / "board" / "new.c").write_text("", encoding="utf-8")
        self.assertEqual(base.commit(self.root), commit)

    def test_unchanged_sources_are_compared_with_the_commit_before(self):
        first = self.commit("one")
        self.commit("two")
        (self.root / "notes.txt").write_text("no source", encoding="utf-8")
        self.assertEqual(base.commit(self.root), first)

    def test_an_only_commit_has_nothing_before_it(self):
        self.commit("one")
        with self.assertRaisesRegex(base.NoBase, "only commit"):
            base.commit(self.root)

    def test_no_history_is_said(self):
        with self.assertRaisesRegex(base.NoBase, "no git history"):
            base.commit(self.root)

    def test_no_git_is_said(self):
        with mock.patch.dict(os.environ, {"PATH": str(self.folder)}), self.assertRaisesRegex(base.NoBase, "git is not installed"):
            base.commit(self.root)

    def test_the_commit_s_own_sources_are_compiled_with_the_same_flags_once(self):
        commit = self.commit("one")
        self.edit("two")
        elf = self.build(commit)
        self.assertEqual(attribution.read(elf).flash_bytes, 9)
        self.assertIn("one", (elf.parent / "source/firmware/board/main.c").read_text(encoding="utf-8"))
        lines = self.log.read_text(encoding="utf-8").splitlines()
        self.assertRegex(lines[0], r"^-O2 -c firmware/board/main\.c -o .*main\.o$")
        self.assertRegex(lines[1], r"^\S*main\.o -Wl,-Map=\S+foc33\.map -o \S+\.elf$")
        self.assertEqual(self.build(commit), elf)
        self.assertEqual(len(self.log.read_text(encoding="utf-8").splitlines()), 2)
        self.assertNotEqual(self.build(commit, "-O1"), elf)

    def test_a_commit_that_does_not_compile_is_said_and_not_kept(self):
        commit = self.commit("one")
        with mock.patch.dict(os.environ, {"FAIL": "1"}), self.assertRaisesRegex(base.NoBase, f"{commit[:7]} does not compile"):
            self.build(commit)
        self.build(commit)

    def test_without_a_compiler_command_there_is_no_column(self):
        found, name, reason = size.compare("", "", self.budget)
        self.assertEqual((found, name), (None, ""))
        self.assertIn("no compiler", reason)


class TheProject(unittest.TestCase):
    def test_the_budget_is_the_note_s(self):
        budget = Budget.read()
        self.assertEqual({group.title: group.note_flash for group in budget.groups if group.note_flash is not None},
                         {"sensorless FOC without field weakening": 4425, "field weakening": 612, "user interface": 645})
        self.assertEqual((budget.note.flash, budget.note.ram), (5682, 444))
        self.assertEqual((budget.image.flash, budget.image.ram), (12288, 768))

    def test_no_function_or_object_is_named_twice(self):
        for kind in ("functions", "objects"):
            names = [name for module in Budget.read().modules for name in getattr(module, kind)]
            self.assertEqual(sorted(names), sorted(set(names)))

    def test_the_levels_of_the_interrupts_are_in_the_board_s_sources(self):
        text = "".join(path.read_text(encoding="utf-8") for path in sorted((paths.ROOT / "firmware/board").glob("*.c")))
        self.assertEqual({name: stack.priorities(text).get(name) for name in ("_ADC1Interrupt", "_FLTA1Interrupt")},
                         {"_ADC1Interrupt": 5, "_FLTA1Interrupt": 5})


SOURCE = """
static inline __attribute__((always_inline)) int park(int a, int b) { return a * b; }
static __attribute__((noinline)) int guard(int x) { volatile int y[4]; y[x & 3] = x; return y[0]; }
volatile struct { int fault; struct { int history[4]; int lost; } estimator; } drive;
const int table[20] = { 1, 2, 3 };
void __attribute__((interrupt, no_auto_psv)) _ADC1Interrupt(void);
void __attribute__((interrupt, no_auto_psv)) _ADC1Interrupt(void) { drive.fault = guard(drive.fault) + table[drive.run.estimator.lost & 15]; }
int main(void) { for (;;) { drive.run.estimator.lost = park(drive.fault, drive.run.estimator.history[1]); } }
"""


@unittest.skipUnless(shutil.which("xc16-gcc"), "no xc16-gcc on PATH")
class Compiled(Case):
    """With the real compiler: the total is the linker's, and the debugging information is read as it is."""

    def setUp(self):
        super().setUp()
        (self.folder / "t.c").write_text(SOURCE, encoding="utf-8")
        part = ["xc16-gcc", "-mcpu=33FJ32MC204", "-omf=elf"]
        subprocess.run([*part, "-O2", "-g", "-std=gnu99", "-c", "t.c", "-o", "t.o"], cwd=self.folder, check=True)
        link = [*part, "-T", "p33FJ32MC204.gld", "-o", "t.elf", "t.o", "-Wl,--report-mem,-Map=t.map"]
        done = subprocess.run(link, cwd=self.folder, check=True, capture_output=True, text=True)
        self.memory = done.stdout + done.stderr
        self.elf = self.folder / "t.elf"

    def test_the_total_is_what_the_linker_reports(self):
        image = attribution.read(self.elf)
        self.assertRegex(self.memory, rf'Total "program" memory used \(bytes\):\s+0x[0-9a-f]+\s+\({image.flash_bytes}\)')
        self.assertRegex(self.memory, rf'Total "data" memory used \(bytes\):\s+0x[0-9a-f]+\s+\({image.ram_bytes}\)')

    def test_inlined_functions_and_members_are_found(self):
        found = shares(attribution.read(self.elf), self.budget)
        self.assertGreater(found["control", "park"].flash, 0)
        self.assertGreater(found["guard", "guard"].flash, 0)
        self.assertEqual(found["guard", "drive.fault"].ram, 2)
        self.assertEqual(found["guard", "drive.run.estimator.lost"].ram, 2)
        self.assertEqual(found["start", "drive.run.estimator"].ram, 8)
        self.assertEqual(found["control", "table"].flash, 60)

    def test_the_stack_is_followed_from_reset_into_the_interrupt(self):
        image = attribution.read(self.elf)
        listing = size.disassemble("xc16-objdump", self.elf)
        result = stack.analyse(listing, image.entry, ["_ADC1Interrupt"], {}, ("_data_init",))
        self.assertEqual(result.errors, [])
        self.assertEqual([name for name, _ in result.levels[0].chain.steps], ["interrupt entry", "_ADC1Interrupt", "guard"])
        self.assertGreaterEqual(result.levels[0].chain.steps[-1][1], 8)


if __name__ == "__main__":
    unittest.main()
