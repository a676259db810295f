"""make size: every word and byte is counted once, with the module it belongs to, and a budget fails exactly when it is exceeded."""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from sample_image import Function, Sample, program
from support import command, refused
import xc16

from tools.common import paths
from tools.common.errors import UserError
from tools.image import attribution, base, size, stack
from tools.image.budget import Budget, shares
from tools.image.sources import Sources

BUDGET = """
with_caller = ["include/a/qmath.h", "small_*"]
[budget.note]
flash_bytes = 60
ram_bytes = 20
[budget.image]
flash_bytes = 120
ram_bytes = 40
stack_bytes = 30
[cycles]
isr_max_cycles = 1
isr_mean_cycles = 1
period_max_cycles = 1
period_mean_cycles = 1
latency_max_cycles = 1
isr_bound_cycles = 1
duty_bound_cycles = 1
slow_bound_cycles = 1
duty_deadline_cycles = 1
both_deadline_cycles = 1
scenarios = ["demo"]
[stack]
calls_nothing = ["_fill"]
[[group]]
name = "law"
title = "the law"
note_flash_bytes = 60
[[group.module]]
name = "control"
files = ["include/a/tick.h", "include/a/park.h", "firmware/a/table.c"]
objects = ["drive"]
[[group.module]]
name = "start"
compiler = ["_reset*"]
objects = ["(start values)", "drive.estimator"]
[[group]]
name = "more"
title = "additions"
[[group.module]]
name = "guard"
files = ["include/a/guard.h", "firmware/a/guard.c"]
functions = ["tick_guard"]
objects = ["drive.fault", "drive.estimator.lost", "silent"]
[[group.module]]
name = "hand-over"
whole = true
functions = ["hand_over"]
objects = ["(texts)", "(alignment)"]
"""
TICK, PARK, GUARD, QMATH, TABLE = "include/a/tick.h", "include/a/park.h", "include/a/guard.h", "include/a/qmath.h", "firmware/a/table.c"
RETURN = "00000200 <_tick>:\n   200:\t00 00 06    \treturn    \n"


def budget_in(folder: Path, old: str = "", new: str = "") -> Budget:
    (folder / "budget.toml").write_text(BUDGET.replace(old, new, 1), encoding="utf-8")
    return Budget.read(folder / "budget.toml")


@pytest.fixture
def budget(tmp_path):
    return budget_in(tmp_path)


@pytest.fixture
def image(tmp_path):
    def of(sample: Sample) -> attribution.Image:
        (tmp_path / "test.elf").write_bytes(sample.elf())
        return attribution.read(tmp_path / "test.elf")
    return of


@pytest.fixture
def counted(image, budget):
    """Bytes of flash or RAM by module and name; together they are all of it."""
    def of(sample: Sample, memory: str = "flash") -> dict[tuple[str, str], int]:
        whole = image(sample)
        found = {key: getattr(share, memory) for key, share in shares(whole, budget).items()}
        assert sum(found.values()) == getattr(whole, f"{memory}_bytes")
        return {key: number for key, number in found.items() if number}
    return of


def tick(end: int, *inside: Function) -> Function:
    return Function("tick", TICK, 1, 0x200, end, list(inside))


def guard(low: int, high: int, *inside: Function, line: int = 1) -> Function:
    return Function("guard", GUARD, line, low, high, list(inside))


# ---- flash ---------------------------------------------------------------------------------------------------------------
HELPERS = tick(0x214, guard(0x204, 0x20A, Function("qm_abs", QMATH, 1, 0x206, 0x20A)), Function("small_one", PARK, 1, 0x210, 0x214))
WHOLE = tick(0x214, Function("hand_over", TICK, 9, 0x204, 0x210, [Function("park", PARK, 1, 0x206, 0x20A), guard(0x20A, 0x20C)]))
MIXED = [(0x200, TICK, 2), (0x202, GUARD, 4), (0x204, TICK, 3), (0x206, GUARD, 5), (0x208, TICK, 4)]


@pytest.mark.parametrize("sample, expected", [
    pytest.param(program((0x200, 10), functions=[tick(0x214)]), {("control", "tick"): 30}, id="a word is three bytes"),
    pytest.param(program((0x200, 10), functions=[tick(0x214, guard(0x204, 0x20A))]), {("control", "tick"): 21, ("guard", "guard"): 9},
                 id="what is inlined is counted with the file it is written in"),
    pytest.param(program((0x200, 10), functions=[HELPERS]), {("control", "tick"): 21, ("guard", "guard"): 9},
                 id="small helpers count with their caller"),
    pytest.param(program((0x200, 10), functions=[WHOLE]), {("control", "tick"): 12, ("hand-over", "hand_over"): 18}, id="a whole module"),
    pytest.param(program((0x200, 3), functions=[tick(0x202), Function("tick_guard", TICK, 5, 0x202, 0x206)]),
                 {("control", "tick"): 3, ("guard", "tick_guard"): 6}, id="a name comes before the file"),
    pytest.param(program((0x200, 5), functions=[tick(0x20A, Function("park", PARK, 1, 0x202, 0x20A, [guard(0x204, 0x206)]))]),
                 {("control", "tick"): 3, ("control", "park"): 9, ("guard", "guard"): 3}, id="the innermost function counts"),
    # the stretch of guard is its first word only; the compiler has moved the other one behind a word of tick
    pytest.param(program((0x200, 5), functions=[tick(0x20A, guard(0x202, 0x204, line=3))], lines=MIXED, lines_end=0x20A),
                 {("control", "tick"): 9, ("guard", "guard"): 6}, id="where stretches have gaps the line says the function"),
    pytest.param(program((0x200, 2), functions=[guard(0, 0x300, Function("park", PARK, 1, 0x200, 0x204))], symbols={"__reset": 0x200}),
                 {("start", "_reset"): 6}, id="a function that the linker removed"),
    pytest.param(program((0x200, 3), (0x300, 2), functions=[Function("tick", TICK, 1, 0x300, 0x304)],
                         symbols={"__reset": 0x200, ".Lx": 0x202}),
                 {("start", "_reset"): 9, ("control", "tick"): 6}, id="code without debugging information goes by its label"),
    pytest.param(program((0x200, 1), functions=[tick(0x202)], start_values=[0x800, 4, 0, 0]),
                 {("control", "tick"): 3, ("start", "(start values)"): 12}, id="start values are counted"),
    pytest.param(program((0x200, 1), functions=[tick(0x202)], constants=[("_drive", 128), (".LC0", 6), (".LC1", 4)]),
                 {("control", "tick"): 3, ("control", "drive"): 192, ("hand-over", "(texts)"): 15},
                 id="constants take three bytes for two"),
    pytest.param(program((0x200, 1), functions=[tick(0x202)], constants=[("_drive", 4), (".LC0", 3), (".LC1", 5)]),
                 {("control", "tick"): 3, ("control", "drive"): 6, ("hand-over", "(texts)"): 12}, id="texts of an odd length share a word"),
    pytest.param(program((0x200, 1), functions=[tick(0x202)], constants=[("_drive", 10)],
                         types={"drive": {"gain": 2, "fault": 2, "rest": 6}}),
                 {("control", "tick"): 3, ("control", "drive"): 12, ("guard", "drive.fault"): 3}, id="a member of a constant"),
    pytest.param(program((0x200, 2), functions=[Function("new", "include/a/new.h", 1, 0x200, 0x204)]), {("not assigned", "new"): 6},
                 id="not assigned")])
def test_flash(counted, sample, expected):
    assert counted(sample) == expected


def test_each_copy_counts_and_vectors_are_the_handlers_and_do_not(image, budget):
    share = shares(image(program((0x200, 5), functions=[tick(0x20A, guard(0x200, 0x202), guard(0x206, 0x20A))])), budget)["guard", "guard"]
    assert (share.flash, len(share.copies)) == (9, 2)
    found = image(Sample({0x200: 0, 4: 0x200, 6: 0x300}, functions=[tick(0x202)]))
    assert (list(found.handlers), found.flash_bytes) == ([0x200, 0x300], 3)


@pytest.mark.parametrize("values, calls", [([0x800, 4, 0, 0], False), ([0x800, 4, 1, 7, 7, 0], False), ([0x800, 4, 2, 7, 7, 0], False),
                                           ([0x800, 4, 3, 0], True),
                                           ([0x800, 4, 1, 7, 7, 0x900, 2, 3, 0], True), ([0x800, 0x10000 + 4, 0x7F0000, 0], False)])
def test_a_list_of_start_values_that_calls_a_function_is_noticed(image, values, calls):
    assert image(program((0x200, 1), functions=[tick(0x202)], start_values=values)).initial_calls == calls


# ---- RAM -----------------------------------------------------------------------------------------------------------------
TYPES = {"drive": {"fault": 2, "estimator": {"history": 8, "lost": 2}, "rest": 4}}


@pytest.mark.parametrize("variables, types, expected", [
    pytest.param([("_drive", 16, True)], TYPES, {("control", "drive"): 4, ("start", "drive.estimator"): 8, ("guard", "drive.fault"): 2,
                                                 ("guard", "drive.estimator.lost"): 2},
                 id="members go to their modules and the rest stays"),
    pytest.param([("_table", 6, False, TABLE), ("_drive", 10, True, "all.c")], {}, {("control", "table"): 6, ("control", "drive"): 10},
                 id="an object goes by its file, and one without a size ends at the next"),
    pytest.param([("_silent", 2, True, TABLE)], {}, {("guard", "silent"): 2}, id="a name comes before the file"),
    pytest.param([("_line.12", 2, True, GUARD)], {}, {("guard", "line.12"): 2}, id="one inside a function goes by its place"),
    pytest.param([("_new", 6, True, "new.c")], {}, {("not assigned", "new"): 6}, id="an object that nobody names")])
def test_ram(counted, variables, types, expected):
    assert counted(program((0x200, 1), functions=[tick(0x202)], variables=variables, types=types), "ram") == expected


# ---- limits: 60 and 120 bytes of flash, 20 and 40 of RAM, 30 of stack -----------------------------------------------------
@pytest.fixture
def report(image, budget):
    def of(words: int, more: int = 0, ram: int = 0, new: int = 0, listing: str = RETURN, before=None, limits: bool = True,
           held=budget) -> size.Report:
        variables = [item for item in (("_drive", ram, True), ("_new", new, True, "new.c")) if item[1]]
        found = image(program((0x200, words), (0x400, more), functions=[tick(0x200 + 2 * words), guard(0x400, 0x400 + 2 * more)],
                              variables=variables))
        return size.measure(found, size.deepest(found, listing, held, []), held, before, limits)
    return of


DEEP = "00000200 <_tick>:\n   200:\t00 00 00    \tlnk       #0x1e\n   202:\t00 00 00    \tulnk      \n   204:\t00 00 06    \treturn    \n"
WILD = "00000200 <_tick>:\n   200:\t00 00 00    \tcall      w2\n   202:\t00 00 06    \treturn    \n"


@pytest.mark.parametrize("given, broken", [
    ({"words": 20, "more": 20, "ram": 20}, []),
    ({"words": 21, "more": 19}, ["flash, what AN1292 does, too: 63 bytes, 3 over the budget of 60"]),
    ({"words": 20, "more": 21}, ["flash, whole image: 123 bytes, 3 over the budget of 120"]),
    ({"words": 1, "ram": 22}, ["RAM, what AN1292 does, too: 22 bytes, 2 over the budget of 20"]),
    ({"words": 1, "listing": DEEP}, ["stack: 32 bytes at its deepest, 2 over the budget of 30"]),
    ({"words": 1, "listing": WILD}, ["stack: tick: call through a pointer at 0x200, tick() of include/a/tick.h (call w2)"]),
    ({"words": 1, "new": 4}, ["'new' is counted with no module: name its file in firmware/budget.toml"]),
    ({"words": 200, "more": 200, "ram": 100, "limits": False}, [])])
def test_a_broken_budget_is_a_line_that_says_how_much(report, given, broken):
    assert report(**given).broken == broken


def test_what_no_module_claims_counts_as_the_note_s_and_a_module_with_a_budget_of_its_own_is_held_to_it(report, tmp_path):
    assert next(row.ram for row in report(1, new=4).rows if row.name == size.NOTE_TITLE) == 4
    held = budget_in(tmp_path, 'name = "guard"\n', 'name = "guard"\nflash_bytes = 6\n')
    assert report(1, 2, held=held).broken == []
    assert report(1, 3, held=held).broken == ["flash, guard: 9 bytes, 3 over the budget of 6"]


def test_a_group_that_is_not_ours_is_shown_and_in_no_sum(report, image, tmp_path):
    held = budget_in(tmp_path, 'title = "additions"\n', 'title = "additions"\nnote_flash_bytes = 9\ncounted = false\n')
    found = report(20, 200, held=held)
    assert [row.note for row in found.rows if row.name == size.NOTE_TITLE] == [60]
    assert "additions" not in [row[0] for row in size.readme_table(size.summary(found) | {"by_address_bytes": 0})[1]]
    assert found.broken == []
    assert {row.name: row.flash for row in found.rows if row.kind != "function"} == {
        "the law": 60, "control": 60, "additions": 600, "guard": 600, size.NOTE_TITLE: 60, "whole image": 60}
    code = image(program((0x200, 20), (0x400, 200), functions=[tick(0x228), guard(0x400, 0x590)]))
    assert held.uncounted(shares(code, held)) == 600 and budget_in(tmp_path).uncounted(shares(code, held)) == 0


def test_the_change_is_counted_for_what_came_what_went_and_the_sums(report, image, budget):
    before = shares(image(program((0x200, 5), (0x300, 4), functions=[tick(0x20A), Function("park", PARK, 1, 0x300, 0x308)])), budget)
    rows = {row.name: row.flash_change for row in report(7, 2, before=before).rows}
    assert [rows[name] for name in ("tick", "park", "guard", "control", "the law", "whole image")] == [6, -12, 6, -6, -6, 0]
    assert {row.flash_change for row in report(7).rows} == {None}


def test_table_and_file_hold_the_same_sums(report, tmp_path):
    found = report(20, 3, ram=10)
    found.no_base = "there is no git history here"
    found.by_address = 66
    lines = size.text(found).splitlines()
    assert next(line.split() for line in lines if line.startswith("the law")) == ["the", "law", "60", "60", "10"]
    assert next(line.split() for line in lines if line.startswith("whole image")) == ["whole", "image", "69", "120", "10", "40"]
    assert lines[-1] == "no column for the change: there is no git history here"
    data = json.loads(size.write_json(size.summary(found), tmp_path / "out", "size").read_text(encoding="utf-8"))
    assert next(row["flash"] for row in data["rows"] if row["name"] == "whole image") == 69
    head, body = size.readme_table(data)
    assert {len(row) for row in body} == {len(head)}
    assert [row[0] for row in body] == ["the law", "additions", size.NOTE_TITLE, "the same, inlined code by its address alone", "whole image",
                                        "stack at its deepest"]


def test_the_limit_is_shown_with_its_goal(report, tmp_path):
    held = budget_in(tmp_path, "flash_bytes = 60\n", "flash_bytes = 70\ngoal_flash_bytes = 50\n")
    found = report(20, held=held)
    assert found.broken == [] # a goal is no limit
    assert ["60", "60", "70 (goal 50)"] in [row[1:4] for row in size.readme_table(size.summary(found))[1]]


def test_inlined_code_may_be_told_by_its_address_alone(image, budget, tmp_path):
    lined = image(program((0x200, 5), functions=[tick(0x20A, guard(0x202, 0x204, line=3))], lines=MIXED, lines_end=0x20A))
    alone = attribution.read(tmp_path / "test.elf", by_lines=False)
    assert [size.note_bytes(shares(one, budget), budget) for one in (lined, alone)] == [9, 12]


# ---- names that match nothing --------------------------------------------------------------------------------------------
TICK_H = """
/* drive_t old; */
#define OLD(x) \\
    old_one(x)
typedef struct {
    volatile uint16_t state, fault;  /**< why */
#ifdef IDENTIFY
    identify_t identify[SIZE];
#endif
    struct {
        int16_t history[4], lost;
    } estimator;
} drive_t;
extern drive_t elsewhere;
QM_INLINE int16_t tick(int16_t a,
                       const drive_t *b)
{
    if (a) {
        return b->fault;
    }
}
static void hand_over(void)
{
}
void tick_guard(void);
void tick_guard(void) { }
"""
FILES = {"include/a/tick.h": TICK_H, "firmware/a/table.c": "drive_t drive;\nconst int16_t table[2] = {\n    1, 2\n};\n"
                                                             "static uint16_t silent KEPT;\n",
         "include/a/park.h": "int park(int a) { return a; }\n", "include/a/guard.h": "void guard(void)\n{\n}\n", "firmware/a/guard.c": "",
         "include/a/qmath.h": "int qm_abs(int a) { return a; }\nint small_one(void)\n{\n}\n"}


@pytest.fixture
def tree(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_sources_tell_what_they_define(tree):
    found = Sources.read(tree)
    assert found.functions["include/a/tick.h"] == {"tick", "hand_over", "tick_guard"}
    assert set(found.variables["firmware/a/table.c"]) == {"drive", "table", "silent"}
    assert found.objects() >= {"drive", "drive.fault", "drive.state", "drive.identify", "drive.estimator.history", "drive.estimator.lost",
                               "table"}
    assert not any("old" in name or "elsewhere" in name for name in found.objects())


@pytest.mark.parametrize("old, new, expected", [
    ("", "", []),
    ('"include/a/guard.h"', '"include/a/gurad.h"', [r"'include/a/gurad.h' is no file of the firmware, \S*budget.toml line \d+: correct it",
                                                     "'include/a/guard.h' is in no module: add it"]),
    ('"tick_guard"', '"tick_gaurd"', ["'tick_gaurd' is no function of the firmware"]),
    ('"small_*"', '"smal_*"', ["'smal_\\*' is no function"]),
    ('"drive.fault"', '"drive.failure"', ["'drive.failure' is no variable or member"]),
    ('"drive.estimator.lost"', '"drive.lost"', ["'drive.lost' is no"]),
    ('"demo"', '"demmo"', ["'demmo' is no scenario"]), ('"silent"', '"drive"', ["'drive' is named twice"]),
    ('"_reset*"', '"_rset*"', [r"'_rset\*' is no function of the compiler's start-up code in the image"]),
    ('"_fill"', '"_filll"', ["'_filll' is no function of the compiler's"])])
def test_a_name_that_matches_nothing_is_a_line(tree, image, old, new, expected):
    found = image(program((0x200, 2), functions=[tick(0x202)], symbols={"__reset": 0x202, "__fill": 0x202}))
    lines = budget_in(tree, old, new).unmatched(Sources.read(tree), found, tree)
    assert len(lines) == len(expected), lines
    assert all(re.search(pattern, line) for pattern, line in zip(expected, lines)), lines


@pytest.mark.parametrize("old, new, told", [('[[group.module]]\nname = "guard"', '[[module]]\nname = "guard"', "unknown key 'module'.*budget.toml line"),
                                            ("whole = true", "hole = true", "unknown key 'hole'"),
                                            ("[stack]", "[stak]", r"no table \[stack\]")])
def test_a_budget_file_with_a_mistake(tmp_path, old, new, told):
    with pytest.raises(UserError, match=told):
        budget_in(tmp_path, old, new)


def test_the_projects_budget_names_what_is_there_and_is_the_note_s():
    budget = Budget.read()
    assert budget.unmatched(Sources.read()) == []
    assert {group.title: group.note_flash for group in budget.groups if group.note_flash is not None} == {
        "sensorless FOC without field weakening": 4425 - 303, "field weakening": 612, "user interface": 645,
        "C start-up: the compiler's, in no budget": 303} # 5682 in all
    assert (budget.note.flash, budget.note.goal, budget.note.ram, budget.image.flash, budget.image.ram) == (7200, 5300, 444, 24576, 1536)


def test_the_projects_budget_is_for_the_delivered_header():
    done = subprocess.run(["cksum"], stdin=(paths.ROOT / "userparams.h").open("rb"), capture_output=True, text=True, check=True)
    assert Budget.read().image.header == int(done.stdout.split()[0]), "write it into firmware/budget.toml"


# ---- bad input -----------------------------------------------------------------------------------------------------------
GOOD, BARE, OTHER = program((0x200, 1), functions=[tick(0x202)]), program((0x200, 1)), program((0x200, 1), machine=62)


@pytest.mark.parametrize("sample, arguments, words", [
    (None, (), ("No such file", "make firmware")), (GOOD, ("--objdump", "no-such-objdump"), ("no no-such-objdump", "XC16")),
    (OTHER, (), ("not a linked program for a dsPIC",)), (BARE, (), ("compile with -g",)),
    (BARE, ("--objdump", r"printf '\351'"), ("compile with -g",)),
    (None, ("--wrong",), ("--help",))])
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, sample, arguments, words):
    if sample is not None:
        (tmp_path / "bad.elf").write_bytes(sample.elf())
    refused(command(str(tmp_path / "bad.elf"), "--out", str(tmp_path / "out"), "--objdump", "true", *arguments, main=size.main), *words)
    assert not (tmp_path / "out").exists()


# ---- the last commit, with a repository and a compiler of the test's own ---------------------------------------------------
MAKEFILE = """target-elf:
	@echo "$(OPT) $$(cat firmware/board/main.c)" >>"$(LOG)"; [ -z "$(FAIL)" ] || { echo "$(FAIL)" >&2; exit 1; }
	@cat tools/image/x.py build/setup/python >/dev/null && cp "$(IMAGE)" made.elf && echo made.elf
"""


class Repository:
    def __init__(self, folder: Path) -> None:
        self.root, self.log = folder / "repository", folder / "log"
        self.main = self.root / "firmware" / "board" / "main.c"
        for name, text in {"Makefile": MAKEFILE, "tools/image/x.py": "", "include/x.h": "", "userparams.h": "", ".gitignore": "/build",
                           "build/setup/python": "python3", "firmware/board/main.c": ""}.items():
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            (self.root / name).write_text(text, encoding="utf-8")

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
        self.main.write_text(f"/* {text} */\n", encoding="utf-8")

    def build(self, commit: str, flag: str = "-O2") -> Path:
        return base.build(commit, [f"OPT={flag}"], self.root)


@pytest.fixture
def repository(tmp_path, monkeypatch):
    if not shutil.which("git"):
        pytest.skip("git is not installed")
    result = Repository(tmp_path)
    (tmp_path / "made.elf").write_bytes(program((0x200, 3), functions=[tick(0x206)]).elf())
    for name, value in {"LOG": result.log, "IMAGE": tmp_path / "made.elf", "FAIL": "", "GIT_CONFIG_GLOBAL": os.devnull,
                        "GIT_CONFIG_SYSTEM": os.devnull, "GIT_CEILING_DIRECTORIES": tmp_path, "GIT_AUTHOR_NAME": "t",
                        "GIT_AUTHOR_EMAIL": "t@example.org", "GIT_COMMITTER_NAME": "t", "GIT_COMMITTER_EMAIL": "t@example.org"}.items():
        monkeypatch.setenv(name, str(value))
    return result


def test_changed_sources_are_compared_with_the_last_commit_and_unchanged_ones_with_the_one_before(repository):
    first = repository.commit("one")
    with pytest.raises(base.NoBase, match="only commit"):
        base.commit(repository.root)
    repository.edit("two")
    assert base.commit(repository.root) == first
    repository.edit("one")
    repository.main.with_name("new.c").write_text("", encoding="utf-8")
    assert base.commit(repository.root) == first
    repository.commit("two")
    (repository.root / "notes.txt").write_text("no source", encoding="utf-8")
    assert base.commit(repository.root) == first


def test_no_history_and_no_git_are_said(repository, monkeypatch):
    with pytest.raises(base.NoBase, match="no git history"):
        base.commit(repository.root)
    monkeypatch.setenv("PATH", str(repository.root))
    with pytest.raises(base.NoBase, match="git is not installed"):
        base.commit(repository.root)


def test_the_commit_s_own_sources_are_built_with_the_same_settings_once(repository):
    commit = repository.commit("one")
    repository.edit("two")
    elf = repository.build(commit)
    assert attribution.read(elf).flash_bytes == 9
    assert repository.build(commit) == elf
    assert repository.build(commit, "-O1") != elf
    assert repository.log.read_text(encoding="utf-8").splitlines() == ["-O2 /* one */", "-O1 /* one */"]


def test_the_rules_of_make_find_all_they_need_among_the_sources_that_are_built(tmp_path):
    for name in base.SOURCES:
        place = paths.ROOT / name
        (shutil.copytree if place.is_dir() else shutil.copy)(place, tmp_path / name)
    (tmp_path / "bin").mkdir()
    shutil.copy("/bin/true", tmp_path / "bin" / "xc16-gcc")
    environment = {name: value for name, value in os.environ.items() if name not in base.MAKES_OWN}
    done = subprocess.run(["make", "-n", "target-elf", f"XC16={tmp_path}"], cwd=tmp_path, env=environment, capture_output=True, text=True,
                          check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "firmware/board/main.c" in done.stdout


def test_a_commit_that_does_not_build_is_said_and_not_kept(repository, monkeypatch):
    commit = repository.commit("one")
    monkeypatch.setenv("FAIL", "main.c: wrong")
    with pytest.raises(base.NoBase, match=f"{commit[:7]} does not build with these settings: main.c: wrong$"):
        repository.build(commit)
    monkeypatch.setenv("FAIL", "")
    repository.build(commit)
    repository.git("rm", "-rq", "include")
    with pytest.raises(base.NoBase, match="no firmware in the folders of today"):
        repository.build(repository.commit("three"))


# ---- with the real compiler: the total is the linker's, and the debugging information is read as it is ---------------------
SOURCE = """
static inline __attribute__((always_inline)) int park(int a, int b) { return a * b; }
static __attribute__((noinline)) int guard(int x) { volatile int y[4]; y[x & 3] = x; return y[0]; }
volatile struct { int fault; struct { int history[4]; int lost; } estimator; } drive;
const int table[20] = { 1, 2, 3 };
void __attribute__((interrupt, no_auto_psv)) _ADC1Interrupt(void);
void __attribute__((interrupt, no_auto_psv)) _ADC1Interrupt(void) { drive.fault = guard(drive.fault) + table[drive.estimator.lost & 15]; }
int main(void) { for (;;) { drive.estimator.lost = park(drive.fault, drive.estimator.history[1]); } }
"""


@xc16.needs_compiler
def test_a_compiled_program(tmp_path):
    (tmp_path / "guard.c").write_text(SOURCE, encoding="utf-8")
    part = [xc16.COMPILER, "-mcpu=33FJ32MC204", "-omf=elf"]
    subprocess.run([*part, "-O2", "-g", "-std=gnu99", "-c", "guard.c", "-o", "t.o"], cwd=tmp_path, check=True)
    done = subprocess.run([*part, "-T", "p33FJ32MC204.gld", "-o", "t.elf", "t.o", "-Wl,--report-mem,-Map=t.map"], cwd=tmp_path, check=True,
                          capture_output=True, text=True)
    image = attribution.read(tmp_path / "t.elf")
    for memory, total in (("program", image.flash_bytes), ("data", image.ram_bytes)):
        assert re.search(rf'Total "{memory}" memory used \(bytes\):\s+0x[0-9a-f]+\s+\({total}\)', done.stdout + done.stderr)
    files = {thing.name: thing.file for thing in image.data + image.constants}
    assert (files["drive"], files["table"]) == ("guard.c", "guard.c")
    found = shares(image, budget_in(tmp_path, '"firmware/a/guard.c"', '"guard.c"'))
    assert found["guard", "park"].flash > 0 and found["guard", "guard"].flash > 0
    members = (("guard", "drive.fault"), ("guard", "drive.estimator.lost"), ("start", "drive.estimator"))
    assert [found[member].ram for member in members] == [2, 2, 8]
    assert found["guard", "table"].flash == 60
    result = stack.analyse(size.disassemble(xc16.program("objdump"), tmp_path / "t.elf"), image.entry, {"_ADC1Interrupt": ["_ADC1Interrupt"]}, {},
                           ("_data_init",))
    assert result.errors == []
    assert [name for name, _ in result.levels[0].chain.steps] == ["interrupt entry", "_ADC1Interrupt", "guard"]
    assert result.levels[0].chain.steps[-1][1] >= 8
