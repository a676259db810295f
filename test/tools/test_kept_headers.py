"""Kept parameters and headers: every motor's own values may be kept, the page lists what is kept, and a build that cannot keep is refused."""

import re
import subprocess
from pathlib import Path

import pytest
import xc16

from tools.common import board_file, motor_file, paths
from tuning import header
from tuning.design import design

ROOT = paths.ROOT
MOTORS = sorted(path.stem for path in (ROOT / "tuning" / "motors").glob("*.toml"))
HEADER = (ROOT / "include" / "board" / "kept.h").read_text(encoding="utf-8")
FLAGS = ["-std=gnu99", "-DPARAMS_IN_RAM", "-DPARAMS_KEPT=1", "-D_GNU_SOURCE"]
PROGRAM = """
#include "firmware/board/kept.c"
#include <stdio.h>
#include <string.h>
drive_t board_drive;
drive_params_t board_params = DRIVE_PARAMS_INIT;
char *text_put(char *at, const char *text) { return stpcpy(at, text); }
const char *text_next(const char *name) { return name + strlen(name) + 1; }
int main(void)
{
    board_drive.state = DRIVE_STOPPED;
    P1OVDCON = BOARD_OUTPUTS_OFF;
    kept_init();
    kept_command.request = KEPT_ASK_KEEP;
    kept_tick(1);
    kept_init();
    printf("%u %u %u\\n", kept_command.result, kept_command.copies, (unsigned)(ROWS));
    return 0;
}
"""


@pytest.mark.parametrize("motor", MOTORS)
def test_the_own_values_of_every_motor_can_be_kept(motor: str, tmp_path: Path) -> None:
    data = motor_file.load(str(ROOT / "tuning" / "motors" / f"{motor}.toml"))
    (tmp_path / "userparams.h").write_text(header.write(design(data, board_file.load(data.board or "mclv"))), encoding="utf-8")
    (tmp_path / "main.c").write_text(PROGRAM, encoding="utf-8")
    done = subprocess.run(["gcc", *FLAGS, f"-I{tmp_path}", "-Iinclude", "-I.", "-Itools/cpu_host", str(tmp_path / "main.c"), "tools/cpu_host/xc.c",
                           "firmware/drive/selftest.c", "-o", str(tmp_path / "keeps")], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:600]
    assert subprocess.run([tmp_path / "keeps"], capture_output=True, text=True, check=True).stdout.split()[:2] == ["1", "1"]


def test_the_page_lists_each_parameter_and_field_that_is_kept() -> None:
    listed = (ROOT / "docs" / "kept.md").read_text(encoding="utf-8").partition("## What is kept")[2].partition("## ")[0]
    parameters = set(re.findall(r"#define KEPT_OF_(\w+) ", HEADER))
    named = set(re.findall(r"`([A-Z][A-Z0-9_]+)`", listed)) - {"KEPT_RELATION_TABLE"}
    follow = {"NOMINAL_SPEED_RPM", "MAXIMUM_SPEED_RPM", "KFILTER_ESDQ_FW"} # in the row of the first
    assert len(parameters) > 10 and named == parameters | follow
    fields = {field for row in re.findall(r"R\(((?:[\w.]+), (?:[\w.]+)),", HEADER) for field in row.split(", ")}
    assert len(fields) > 20 and fields | {"nominal_erpm"} == set(re.findall(r"`((?:\w+\.)?[a-z]\w*)`", listed)) - {"board_params"}


@pytest.mark.parametrize("defines, part", [
    ("-DPARAMS_KEPT=1", "PARAMS_KEPT = 1 must be 0 without PARAMS_IN_RAM: add #define PARAMS_IN_RAM"),
    ("-DPARAMS_IN_RAM -DPARAMS_KEPT=2", "PARAMS_KEPT = 2 is outside 0 .. 1")])
def test_a_build_that_cannot_keep_is_refused_in_one_line(defines: str, part: str) -> None:
    done = xc16.make("vboard", f"DEFINES={defines}", "VARIANT=kept-refused")
    lines = [line for line in done.stderr.splitlines() if not line.startswith("make")]
    assert done.returncode != 0 and len(lines) == 1 and part in lines[0], done.stderr


def test_tuning_has_its_parameters_in_ram_too(tmp_path: Path) -> None:
    done = subprocess.run(["gcc", "-std=gnu99", "-O2", "-DTUNING", "-DPARAMS_KEPT=1", "-Iinclude", "-I.", "-c", "firmware/drive/param_check.c", "-o",
                           str(tmp_path / "out.o")], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
