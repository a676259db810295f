"""make test-target around compiler and simulator: vectors as the chip reads them, images split where the flash ends, the verdict."""

import argparse
import re
import shlex
import sys
from pathlib import Path

import pytest
from xc16 import ROOT, make, needs_compiler

sys.path.insert(0, str(ROOT / "test" / "sixteen_bit"))
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


# ---- vectors -------------------------------------------------------------------------------------------------------------
def test_a_row_is_words_low_word_first_without_gaps_and_tables_hold_every_row_of_the_vectors(tmp_path):
    columns = [("a", "s16"), ("b", "s32"), ("c", "u16"), ("d", "u32")]
    assert golden_words.words(columns, ["-1", "-2", "65535", "65536"]) == [0xFFFF, 0xFFFE, 0xFFFF, 0xFFFF, 0, 1]
    tables = golden_words.write(ROOT / "test/golden/vectors", tmp_path)
    sizes = {table.stem: table.stat().st_size for table in tables}
    assert (sizes["sincos"], sizes["multiply"]) == (700 * 6, 301 * 22)
    assert f"golden_fetch({list(sizes).index('sincos')}, " in (tmp_path / "golden_sincos.h").read_text()


def test_header_keeps_type_rows_and_constants_and_fetches_rows():
    text = golden_words.header("x", 7, [("a", "s16"), ("b", "s32")], {"k": "5"}, [["1", "2"], ["3", "4"]])
    for part in ("#define GOLDEN_X_K 5", "#define GOLDEN_X_ROWS 2u", "int32_t b;", "golden_x_t golden_x_row(uint32_t n)",
                 "golden_fetch(7, n * 3u, &row,"):
        assert part in text
    assert "golden_x[" not in text
    constants = golden_words.header("x", 7, [], {"k": "5"}, []) # a file with constants only stays as it is
    assert "#define GOLDEN_X_K 5" in constants and "golden_fetch" not in constants


# ---- images: a test file made of names, through a made-up tool chain -------------------------------------------------------
@pytest.fixture
def judge(tmp_path, monkeypatch):
    """The verdict on a test file: lines, entries, passed, failed."""
    for name, text in (("cc", COMPILER), ("ld", LINKER), ("sim", SIMULATOR)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    for place in ("unity/src", "test/unit", "runners/unit"):
        (tmp_path / place).mkdir(parents=True)
    (tmp_path / "unity/src/unity.c").write_text("")
    (tmp_path / "law.a").write_text("")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(target_run.Builder, "loadable", lambda builder, elf: elf)

    def of(on_chip: list[str], on_pc: dict[str, str] | None = None, source: str = "int x;\n"):
        Path("test/unit/test_x.c").write_text(source)
        Path("runners/unit/test_x_runner.c").write_text(
            "".join(f'  a[{i}].name = "{name}";\n  a[{i}].line_num = {i};\n' for i, name in enumerate(on_chip)))
        host = Path("runners/unit/test_x")
        results = on_pc if on_pc is not None else {name: "PASS" for name in on_chip}
        host.write_text("#!/bin/sh\ncat <<END\n" + "".join(f"test/unit/test_x.c:1:{name}:{text}\n" for name, text in results.items())
                        + "END\n")
        host.chmod(0o755)
        options = argparse.Namespace(out=f"{tmp_path}/out", unity="unity", runners="runners", compile=shlex.quote(f"{tmp_path}/cc"),
                                     link=shlex.quote(f"{tmp_path}/ld") + " {elf} {objects}", library="law.a", simulator=f"{tmp_path}/sim", cycles=1)
        builder = target_run.Builder(options)
        builder.shared()
        return target_run.judge("unit/test_x", builder, Path("runners"))
    return of


def test_results_like_the_pcs_pass(judge):
    lines, entries, passed, failed = judge(["test_a", "test_b"])
    assert (passed, failed) == (2, 0)
    assert entries == ["test/unit/test_x.c:test_a:PASS", "test/unit/test_x.c:test_b:PASS"]
    assert re.search(r"^unit/test_x: 2 passed, 0 failed \(1000 cycles", lines[-1])


def test_what_does_not_fit_one_image_is_split_and_nothing_is_lost(judge):
    names = [f"test_{letter}" for letter in "abcdefg"]
    lines, entries, passed, failed = judge(names)
    assert (passed, failed, [entry.split(":")[1] for entry in entries]) == (7, 0, names)
    assert "images, " in lines[-1] and Path("out/unit/test_x.2.elf").exists()


@pytest.mark.parametrize("on_chip, on_pc, counts, told", [
    (["test_a", "test_fails"], None, (1, 1), "unit/test_x: test_fails: FAIL: Expected 1 Was 2 on the target, passes on the PC"),
    (["test_a"], {"test_a": "FAIL: Expected 1 Was 3"}, (0, 1), ""),
    (["test_a"], {"test_a": "PASS", "test_gone": "PASS"}, (1, 1), "test_gone: FAIL: no result on the target"),
    (["test_a", "test_hangs"], None, (0, 1), "stopped after test_a: did not end in the cycles allowed"),
    # other errors of the linker are no reason to split
    (["test_a", "test_lost"], None, (0, 1), "undefined reference to _lost")])
def test_what_fails_on_one_side_is_told(judge, on_chip, on_pc, counts, told):
    lines, entries, passed, failed = judge(on_chip, on_pc)
    assert (passed, failed) == counts and (told == "" or told in lines[0])
    assert "hangs" not in on_chip[-1] or re.search("FAIL: stopped after", entries[0])


def test_an_error_of_the_compiler_is_shown(judge):
    lines, _, _, failed = judge(["test_a"], source="broken\n")
    assert failed == 1 and "error: broken" in lines[0]


# ---- with the compiler ---------------------------------------------------------------------------------------------------
@needs_compiler
def test_some_unit_tests_give_the_pcs_results():
    done = make("test-target", "ONLY=test_pi test_trig")
    assert done.returncode == 0, done.stdout + done.stderr
    results = (ROOT / "build/target/test/report.txt").read_text(encoding="utf-8")
    assert ":FAIL" not in results
    assert all(re.search(rf"{suite}\.c:\w+:PASS", results) for suite in ("test_pi", "test_trig"))


@needs_compiler
def test_an_unknown_test_is_one_line():
    done = make("test-target", "ONLY=test_nothing")
    assert done.returncode == 2, done.stdout + done.stderr
    assert re.search(r"\Afoc33: no unit test of the control law, ONLY=test_nothing: use test_[^\n]*\nmake: [^\n]*\n\Z", done.stderr)
