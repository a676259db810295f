"""The produced userparams.h: the project's own one is the tuner's output, the firmware builds with every motor's, and a new parameter is one row."""

import functools
import re
import shutil

import openpyxl
import pytest
from support import MOTORS
from tune_support import CHECK, HURST, build, designed, motor_path, of

from tools.common import motor_file, param_rows, paths
from tools.common.errors import UserError
from tools.common.param_rows import parameters
from tools.docs import tables
from tuning import constants, header, spreadsheet

DEFINE = re.compile(r"^#define (\w+)[ \t]+(\S+)[ \t]*(?:/\* \[([^\]]*)\][ \t]+(\S+) \.\. (\S+)[ \t]+(\S.*?) \*/)?", re.MULTILINE)
every_motor = pytest.mark.parametrize("name", MOTORS)


@functools.cache
def written(name: str) -> str:
    return header.write(of(name))


# ---- the project's own -----------------------------------------------------------------------------------------------------
def test_the_project_s_userparams_is_the_tuner_s_output_for_the_hurst():
    assert (paths.ROOT / "userparams.h").read_text(encoding="utf-8") == written(HURST), \
        f"the motor file, the tables or the tuner have changed: write it anew with make userparams MOTOR={HURST}"


@every_motor
def test_the_firmware_builds_without_a_warning_for_every_motor(name, tmp_path):
    """As one unit, like the image; the interrupt optimised, as in the library."""
    sources = {str(path.relative_to(paths.ROOT)) for path in (paths.ROOT / "firmware").rglob("*.c") if path.parent.name != "app"}
    checks, unit = sorted(source for source in sources if "/param_" in source), tmp_path / "unit.c"
    unit.write_text("".join(f'#include "{source}"\n' for source in sorted(sources.difference(checks))), encoding="utf-8")
    assert len(checks) == 2 and build(written(name), "-fsyntax-only", str(unit), *checks) == ""
    assert build(written(name), "-O2", "-o", "/dev/null", "firmware/board/isr.c") == ""


# ---- its text --------------------------------------------------------------------------------------------------------------
@every_motor
def test_every_parameter_is_there_once_with_the_design_s_value_and_its_row_s_unit_range_and_meaning(name):
    found = {define: rest for define, *rest in DEFINE.findall(written(name)) if define != "USERPARAMS_H"}
    assert {define: rest[0] for define, rest in found.items()} == of(name).params and set(parameters()) <= set(found)
    for p in parameters().values():
        _, unit, low, high, meaning = found[f"{p.stem}0" if p.stem else p.name]
        assert (unit, low, high) == (p.unit, p.low, p.high) and meaning.startswith(p.meaning), p.name


def test_it_says_where_it_comes_from_and_what_is_wrong_and_gives_a_salient_motor_s_gains_for_each_axis():
    text = written("anaheim_bly172s_24v_4000")
    assert "tuning/motors/anaheim_bly172s_24v_4000.toml and tuning/boards/mclv.toml by: make tune MOTOR=anaheim_bly172s_24v_4000" in text
    assert "Note: rated current 3.86 A peak is above" in text
    assert re.search(r"#define D_CURRCNTR_PTERM 0\.0\d+ +/\* .*Ld", written("linix_45zwn24_40"))
    assert "#define D_CURRCNTR_PTERM" not in written(HURST)


def test_the_table_shows_each_constant_with_value_count_and_rounding():
    for item in (item for item in of(HURST).constants if "[" not in item.name):
        row = next(line for line in written(HURST).splitlines() if line.startswith(f" *   {item.name} "))
        assert re.search(rf" {item.q_value} .*(exact|[+-]\d+\.\d+ %)", row), row


def test_every_mode_is_there_and_off():
    assert re.findall(r"^/\* #define (\w+) \*/", written(HURST), re.MULTILINE) == list(param_rows.modes())


@pytest.mark.parametrize("name", [*MOTORS, "bad */ title"])
def test_comments_end_where_they_should_and_a_title_cannot_end_one(name):
    text = written(name) if name in MOTORS else header.write(designed(('title = "a motor"', f'title = "{name}"')))
    assert text.count("/*") == text.count("*/") and not re.search(r"/\*(?:(?!\*/)[\s\S])*/\*", text)


# ---- one row more in a copy of param_limits.h, and nothing else -------------------------------------------------------------
def forget() -> None:
    param_rows.parameters.cache_clear()
    param_rows.number.cache_clear()
    constants._headers.cache_clear()


@pytest.fixture
def include(tmp_path, monkeypatch):
    folder, row = tmp_path / "include", '    X(SNAPDELAY, "periods"'
    shutil.copytree(paths.ROOT / "include", folder)
    table = folder / "drive" / "param_limits.h"
    text = table.read_text(encoding="utf-8")
    assert text.count(row) == 1
    table.write_text(text.replace(row, f'    X(NEW_A, "A peak", 0.1, 20, 1.5, "what a test adds") \\\n{row}'), encoding="utf-8")
    monkeypatch.setattr(param_rows, "TABLE", table)
    monkeypatch.setattr(constants, "INCLUDE", folder)
    forget()
    yield folder
    forget()


def test_a_new_row_appears_in_the_header_the_build_the_tuner_the_spreadsheet_and_the_docs(include, tmp_path):
    text = header.write(designed())
    assert re.search(r"#define NEW_A 1\.5 +/\* \[A peak\] +0\.1 \.\. 20 +what a test adds \*/\n#define SNAPDELAY", text)
    includes = ["-Itools/cpu_host", f"-I{include}"]
    assert "userparams.h: NEW_A = 30 is outside 0.1 .. 20 A peak" in build(text.replace("NEW_A 1.5", "NEW_A 30"), *CHECK, includes=includes)
    assert build(text, *CHECK, includes=includes) == ""
    assert designed(more="[tune]\nNEW_A = 2.5\n").params["NEW_A"] == "2.5"
    with motor_path(more="[tune]\nNEW_A = 30\n") as path, pytest.raises(UserError, match="NEW_A"):
        motor_file.load(str(path))
    assert constants.header(designed().params | {"NEW_A": "0.05"}).wrong == ["NEW_A = 0.05 is outside 0.1 .. 20 A peak"]
    assert "| `NEW_A` | A peak | 0.1 | 20 | 1.5 | what a test adds |\n" in tables.params()
    spreadsheet.write(tmp_path / "new.xlsx")
    book = openpyxl.load_workbook(tmp_path / "new.xlsx")
    assert any(cell.value == "NEW_A" for cell in book["Parameters"]["A"])
    assert any("#define NEW_A " in str(cell.value) for cell in book["Paste"]["A"])


def test_a_row_that_cannot_be_read_is_told(include):
    text = param_rows.TABLE.read_text(encoding="utf-8")
    param_rows.TABLE.write_text(text.replace('0.1, 20, 1.5, "what', '0.1, 20, "what'), encoding="utf-8")
    forget()
    with pytest.raises(UserError, match=r"a row cannot be read: X\(NEW_A, .*param_limits.h"):
        parameters()


# ---- the docs' tables ------------------------------------------------------------------------------------------------------
def test_the_rows_are_read_as_the_compiler_reads_them():
    found = tables.rows("include", "drive/param_limits.h", "PARAM_TABLE", "#name unit #low #high #default meaning")
    assert [row[:4] + row[5:] for row in found] == [[p.name, p.unit, p.low, p.high, p.meaning] for p in parameters().values()]


@pytest.mark.parametrize("name", tables.PAGES)
def test_every_page_has_the_table_that_its_header_has_now(name):
    assert (paths.ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") == tables.page(name), "run: python3 -m tools.docs.tables"


def test_every_assumption_of_the_simulator_and_every_relation_has_a_row():
    files = (paths.ROOT / "tools" / name for name in ("cpu_33f/iss_assumptions.h", "chip/chip_assumptions.h"))
    assert tables.simulator().count("\n| `") == "".join(path.read_text(encoding="utf-8") for path in files).count("    X(")
    rows = param_rows.TABLE.read_text(encoding="utf-8").partition("#define PARAM_RELATION_ALONE")[2]
    rows = rows.partition("#define PARAM_INVKFI_FITS")[0]
    for_each_sensor = rows.partition("#define PARAM_RELATION_HEAT")[2].partition("#define PARAM_RELATION_REST")[0].count("    X(")
    for_each_gain = rows.count("PARAM_RELATION_GAIN_FITS(X, ")
    assert for_each_sensor == 3 and for_each_gain == 5
    assert tables.params().count("\n- ") == rows.count("    X(") + for_each_sensor + for_each_gain + 5
