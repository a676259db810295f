"""What the options of userparams.h cost, and what is said of an image that does not fit the chip."""

import os
import subprocess

import pytest
from support import refusal

from tools.common import paths
from tools.common.param_rows import modes, parameters
from tools.image import options

SCRIPT = "MEMORY\n{\n  program (xr)   : ORIGIN = 0x200,         LENGTH = 0x5600\n}\n"
REPORT = '                 Total "program" memory used (bytes):         0x8433  ({})  69%\n                 Total "data" memory used (bytes):          0x6ec  (1772) 86%\n'


def overfull(folder, used: int | None, flags: str = "", **environment: str) -> subprocess.CompletedProcess:
    """The script with a linker that reports so much; None: it reports nothing."""
    (folder / "chip.gld").write_text(SCRIPT, encoding="utf-8")
    (folder / "options").write_text(flags, encoding="utf-8")
    (folder / "report").write_text("" if used is None else REPORT.format(used), encoding="utf-8")
    (folder / "ld").write_text(f'#!/bin/sh\nwhile [ "$1" != -T ]; do shift; done\ngrep -q "LENGTH = 0xFC00" "$2" && cat "{folder}/report"\n', encoding="utf-8")
    (folder / "ld").chmod(0o755)
    return subprocess.run(["tools/make/overfull.sh", folder / "chip.gld", folder / "wide", folder / "options", folder / "ld", "-mcpu=33FJ32MC204", "image.o"], cwd=paths.ROOT,
                          env=os.environ | environment, capture_output=True, text=True, check=False)


def cost(name: str) -> str:
    text = (paths.ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    return next(line for line in text.splitlines() if line.startswith(f"| `{name}`") and "<!--" in line).split("|")[2].strip().lstrip("+")


def test_an_image_that_does_not_fit_says_by_how_many_bytes_and_what_its_options_cost(tmp_path):
    done = overfull(tmp_path, 33843, "-DSCOPE=1 -DPARAMS_IN_RAM\n#define MOTOR_NTC_USED 1 /* there */\n#define BRIDGE_NTC_USED 0\n#define BRAKE_CHOPPER_V 0.0\n")
    assert (done.returncode, done.stderr) == (0, "") and done.stdout == (
        f"foc33: the image does not fit the chip: 33843 bytes of flash, there are 33024, 819 too many: leave out an option, of these SCOPE {cost('SCOPE')}, "
        f"PARAMS_IN_RAM {cost('PARAMS_IN_RAM')}, MOTOR_NTC_USED {cost('MOTOR_NTC_USED')} bytes (docs/results.md, What an option costs)\n")


def test_an_option_that_needs_another_is_told_with_what_it_costs_on_top(tmp_path):
    said = overfull(tmp_path, 34140, "-DPARAMS_IN_RAM -DPARAMS_KEPT=1").stdout
    both = int(cost("PARAMS_IN_RAM`, `PARAMS_KEPT").lstrip("+"))
    assert f"of these PARAMS_IN_RAM {cost('PARAMS_IN_RAM')}, PARAMS_KEPT {both - int(cost('PARAMS_IN_RAM'))} bytes" in said


@pytest.mark.parametrize("used", [None, 33024])
def test_what_does_not_link_for_another_reason_is_not_called_too_large(tmp_path, used):
    done = overfull(tmp_path, used)
    assert (done.returncode, done.stdout) == (1, "")


def test_an_image_is_measured_whether_it_fits_or_not(tmp_path):
    assert [overfull(tmp_path, used, MEASURE="1").stdout for used in (24579, 33843)] == ["flash 24579, RAM 1772\n", "flash 33843, RAM 1772\n"]


def test_each_option_is_a_parameter_or_a_mode_and_another_value_than_the_header_s():
    header = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
    for values, macros in options.OPTIONS.values():
        assert set(values) <= set(parameters()) and set(macros.replace("-D", "").split()) <= set(modes()) and (values or macros)
        assert options.changed(header, values) != header or not values
    assert options.changed("#define SCOPE 0 /* off */\n", {"SCOPE": "1"}) == "#define SCOPE 1 /* off */\n"
    refusal(lambda: options.changed("#define SCOPES 0\n", {"SCOPE": "1"}), "SCOPE is not in the header once", "make userparams")


def test_the_table_tells_what_an_option_adds():
    rows = [{"name": "none of them", "flash": 24579, "ram": 1184}, {"name": "`SCOPE` 1", "flash": 27447, "ram": 1758}, {"name": "`STOP_MODE` 1", "flash": 24525, "ram": 1184}]
    assert options.table(rows) == (["option", "flash, bytes", "RAM, bytes"], [["none", "24579", "1184"], ["`SCOPE` 1", "+2868", "+574"], ["`STOP_MODE` 1", "-54", "+0"]])
