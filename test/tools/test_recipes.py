"""Each starred row of CONTRIBUTING.md, "How to add ...", followed on a copy of the tree: it touches the files that it names and no others, and the
firmware compiles with what was added, which arrives in the enums and in docs/."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tools.common import drive_tables
from tools.common.paths import ROOT

TREES = ("firmware", "include", "tools", "tuning", "docs", "test/unit")

class Tree:
    """A copy of the project in which a recipe is followed."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for name in TREES:
            shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__", "*.png", "*.xlsx"))
        shutil.copy(ROOT / "userparams.h", root)
        self.touched: set[str] = set()

    def put(self, path: str, text: str) -> None:
        self.touched.add(path)
        (self.root / path).write_text(text, encoding="utf-8")

    def change(self, path: str, pattern: str, new: str) -> None:
        text, count = re.subn(pattern, lambda found: found.expand(new), (self.root / path).read_text(encoding="utf-8"), count=1, flags=re.MULTILINE | re.DOTALL)
        assert count == 1, (path, pattern)
        self.put(path, text)

    def row(self, path: str, table: str, row: str) -> None:
        """As the last of an X-macro's table."""
        self.change(path, rf"(^#define {table}\(X\)(?:[^\n]*\\\n)+[^\n]*)", rf"\1 \\\n    {row}")

    def at_end(self, path: str, function: str, statement: str) -> None:
        """Before a function's closing brace, or before the return that ends it."""
        self.change(path, rf"(^\w[^;{{}}#\n]*\b{function}\([^;{{}}]*\)\n\{{\n(?:(?!^\}}).)*?)((?:^    return [^\n]*\n)?^\}})", rf"\1    {statement}\n\2")

    def compile(self, holds: str = "1", *flags: str) -> None:
        """All of the firmware as one unit, and a condition."""
        files = [path.relative_to(self.root) for path in sorted(self.root.glob("firmware/**/*.c")) if path.name != "main.c" and path.parent.name != "app"]
        source = "".join(f'#include "{path}"\n' for path in files) + f"_Static_assert({holds}, \"arrived\");\n"
        arguments = ["-std=gnu99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-fsyntax-only", "-Itools/cpu_host", "-Iinclude", "-I.", *flags]
        done = subprocess.run(["gcc", *arguments, "-xc", "-"], input=source, cwd=self.root, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

    def page(self, name: str) -> str:
        return self.run("-m", "tools.docs.tables", "--print", name)

    def run(self, *arguments: str) -> str:
        done = subprocess.run([sys.executable, *arguments], cwd=self.root, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def passes(self, *files: str) -> None:
        """Tests of the copy's own."""
        self.run("-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir=.", *files)


def add_fault(tree: Tree) -> None:
    code = len(drive_tables.faults())
    tree.row("include/drive/faults.h", "DRIVE_FAULT_TABLE", f'X({code}, BELT, FAULT_STAYS, "protection_check_rotor", "the belt slips", "tighten the belt")')
    tree.at_end("firmware/drive/protection.c", "protection_check_rotor", "if (d->ticks == 7u) {\n        drive_raise(d, FAULT_BELT);\n    }")
    tree.row("include/drive/states.h", "TRANSITIONS_BY_ROTOR_OR_SIGNAL", 'X(FAULT, "BELT: it slips")')
    stall = (ROOT / "tools/bench/scenarios/fault_stall.toml").read_text(encoding="utf-8")
    tree.put("tools/bench/scenarios/fault_NAME.toml", stall.replace("START_FAILED", "BELT"))
    tree.compile(f"FAULT_BELT == {code} && FAULT_COUNT == {code + 1}")
    assert f"| {code} | BELT |  | the belt slips | tighten the belt | [`protection_check_rotor`](../firmware/drive/protection.c) |" in tree.page("faults")
    tree.passes("test/unit/test_fault_page.py")


def add_limit(tree: Tree) -> None:
    bit = 1 << len(drive_tables.limits())
    tree.row("include/drive/limits.h", "DRIVE_LIMIT_TABLE", f'X({bit}, BELT, "the belt slips", "tighten the belt")')
    tree.at_end("firmware/drive/limits.c", "limits_reasons", "found |= (d->ticks == 7u) ? (uint16_t)LIMIT_BELT : 0u;")
    tree.compile(f"LIMIT_BELT == {bit}")
    assert f"| {bit} | BELT | the belt slips | tighten the belt |" in tree.page("limits")
    tree.passes("test/unit/test_fault_page.py")


def add_selftest(tree: Tree) -> None:
    tree.row("include/drive/selftest.h", "SELFTEST_TABLE", 'X(11, BELT, "1.3", "the belt does not slip")')
    tree.at_end("firmware/board/selftest_run.c", "selftest_pass", "if (board_drive.ticks == 7u) {\n        selftest_fail(SELFTEST_BELT);\n    }")
    tree.compile("SELFTEST_BELT == 11 && SELFTEST_COUNT == 12")
    assert "| 11 | BELT | 1.3 | the belt does not slip |" in tree.page("selftest")


def add_state(tree: Tree) -> None:
    states = "include/drive/states.h"
    tree.row(states, "DRIVE_STATE_TABLE", 'X(COAST, "outputs off, the rotor runs out")')
    tree.row(states, "TRANSITIONS_FROM_STOPPED", 'X(COAST, "the rotor still turns")')
    tree.change(states, r"(?=^#define TRANSITIONS_FROM_STOPPED)",
                '#define TRANSITIONS_FROM_COAST(X) \\\\\n    X(STOPPED, "the rotor stands") \\\\\n    TRANSITIONS_BY_SUPERVISION(X)\n')
    tree.change("firmware/drive/states.c", r"(    case DRIVE_CATCH: next)", r"    case DRIVE_COAST: next = (uint16_t)DRIVE_STOPPED; break;\n\1")
    tree.compile("DRIVE_COAST == DRIVE_STATE_COUNT - 1")
    page = tree.page("states")
    assert "    STOPPED --> COAST: the rotor still turns\n" in page and "| COAST | outputs off, the rotor runs out |" in page
    tree.passes("test/unit/test_fault_page.py")


def add_transition(tree: Tree) -> None:
    tree.row("include/drive/states.h", "TRANSITIONS_FROM_CLOSED", 'X(STOPPED, "the belt slips")')
    tree.at_end("firmware/drive/speed.c", "speed_choose_state", "if (d->ticks == 7u) {\n        drive_enter(d, DRIVE_STOPPED);\n    }")
    tree.compile()
    page = tree.page("states")
    assert "    CLOSED --> STOPPED: the belt slips\n" in page and "| CLOSED | STOPPED | the belt slips |" in page
    tree.passes("test/unit/test_fault_page.py")


def add_slot(tree: Tree) -> None:
    tree.change("include/drive/schedule.h", r"SLOT\( 6, (\w+, +\w+, +)\w+, +\w+\)", r"SLOT( 6, \1watch_belt, CLOSED)")
    work = ("/** Does the belt slip? */\nstatic void watch_belt(drive_t *d, const drive_params_t *p, const drive_samples_t *raw)\n"
            "{\n    choose_state(d, p, raw);\n}\n\n")
    tree.change("firmware/drive/schedule.c", r"(?=^/\*\* [^\n]*\*/\nstatic void follow_estimate)", work)
    tree.compile()
    page = tree.page("law")
    assert re.search(r"\| 6 \| 0\.6 \| `\w+` \| \w+ \| `watch_belt` \| CLOSED \|", page)
    assert "| `watch_belt` | 6 | 32 periods | Does the belt slip? |" in page
    tree.change("firmware/drive/schedule.c", r"/\*\* Does the belt slip\? \*/\n", "")
    with pytest.raises(AssertionError, match="no comment says what 'watch_belt' does"):
        tree.page("law")


def add_parameter(tree: Tree) -> None:
    tree.change("include/drive/param_limits.h", r'(^    X\(POT_LIVE_ZERO, [^\n]*\))$',
                r'\1 \\\n    X(BELT_RATIO, "1", 0, 0.9, 0.5, "speed of the belt over that of the motor")')
    tree.change("include/drive/drive.h", r"(?=^    uint16_t pot_zero_q16;)", r"    uint16_t belt_q16; /**< BELT_RATIO */\n")
    tree.change("include/drive/param_init.h", r"(?=^ +\.pot_zero_q16 = )", r"        .belt_q16 = (uint16_t)(PARAM_F(BELT_RATIO) * 65536.0F + 0.5F), \\\n")
    tree.change("tuning/param_values.c", r"(?=^    FIELD\(pot_zero_q16)", r'    FIELD(belt_q16, BELT_RATIO, "1", 1.0 / 65536.0, "Q16", "speed of the belt");\n')
    for path in ("userparams.h", "test/unit/support/hurst_params.h"):
        tree.change(path, r"(?=^#define POT_LIVE_ZERO)", "#define BELT_RATIO 0.25\n")
    tree.compile()
    tree.run("-c", "import subprocess; subprocess.run(['gcc', '-Iinclude', '-I.', 'tuning/param_values.c', '-lm', '-o', 'values'], check=True)")
    values = subprocess.run([tree.root / "values"], cwd=tree.root, capture_output=True, text=True, check=True).stdout
    assert "constant|belt_q16|0.25|1|Q16|16384|" in values
    assert "| `BELT_RATIO` | 1 | 0 | 0.9 | 0.5 | speed of the belt over that of the motor |" in tree.page("parameters")


def add_mode(tree: Tree) -> None:
    tree.row("include/drive/modes/mode_table.h", "MODE_TABLE", 'X(BELT, "the belt turns, too")')
    tree.change("include/drive/modes/modes.h", r"(?=^ \*\n \* SNAPSHOT)", " * mode_turn_belt        BELT                   what follows the speed controller\n")
    tree.change("include/drive/modes/modes.h", r"(?=^/\*\* The last thing that drive_start)",
                "/** Where the speed controller has done its step. */\nvoid mode_turn_belt(drive_t *d);\n\n")
    tree.change("firmware/drive/modes/modes.c", r"(?=^uint16_t mode_hands_over)", "void mode_turn_belt(drive_t *d)\n{\n#ifdef BELT\n"
                "    d->command.target_erpm = 7;\n#else\n    (void)d;\n#endif\n}\n\n")
    tree.at_end("firmware/drive/speed.c", "speed_step", "mode_turn_belt(d);")
    torque = (ROOT / "tools/bench/scenarios/tuning.toml").read_text(encoding="utf-8")
    tree.put("tools/bench/scenarios/NAME.toml", torque.replace("TUNING", "BELT"))
    tree.compile()
    tree.compile("1", "-DBELT")
    assert "the belt turns, too" in tree.run("-c", "from tools.common.param_rows import modes; print(modes()['BELT'])")


def add_pin(tree: Tree) -> None:
    tree.change("include/board/mclv.h", r"(^#define BOARD_PIN_UART_TX )C, 3", r"\1C, 9")
    tree.compile("BOARD_TRIS(C) == 0xFD3F && sizeof(RPOR12bits) == 2") # LEDs on bits 6 and 7, the transmitter on bit 9
    assert re.search(r"\| 5 \| RC9 \|  \| RP25 \|  \| serial line, transmits", tree.page("pins"))
    tree.touched.add("include/board/pin_table.h") # named as what to read


FOLLOWED = {"fault": add_fault, "reason for a limit": add_limit, "self-test": add_selftest, "state": add_state, "transition": add_transition,
            "work in a slot": add_slot, "parameter": add_parameter, "mode": add_mode, "pin": add_pin}


def recipes() -> dict[str, set[str]]:
    """The files that each starred row names."""
    rows = re.findall(r"^\| (?:another|an?)?\s*([\w -]+?) \* \| (.*?) \| ", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.MULTILINE)
    return {name: set(re.findall(r"`((?:[\w-]+/)+\w+\.(?:h|c|toml)|userparams\.h)`", where)) for name, where in rows}


def test_every_recipe_is_followed():
    assert recipes().keys() == FOLLOWED.keys()


@pytest.mark.parametrize("name", FOLLOWED)
def test_a_recipe_touches_the_files_that_it_names_and_what_was_added_arrives(tmp_path, name):
    tree = Tree(tmp_path)
    FOLLOWED[name](tree)
    assert tree.touched == recipes()[name]
