"""Building a firmware variant: its folder's name, and what a failed build tells the user."""

import os
import re
from pathlib import Path

import pytest
from support import refusal
from xc16 import make

from tools.bench import build, report
from tools.common import paths

TUNED = paths.TUNED / "some_motor"


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """build.library() with a make of our own; returns the library and what this make has written to $RESULT."""
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("MAKEFLAGS", "-j8")
    monkeypatch.setenv("RESULT", str(tmp_path / "result"))

    def made(script: str, defines=(), userparams=None):
        (tmp_path / "make").write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        (tmp_path / "make").chmod(0o755)
        library = build.library(list(defines), userparams)
        return library, (tmp_path / "result").read_text(encoding="utf-8") if (tmp_path / "result").exists() else ""
    return made


# ---- folders -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("defines, userparams, folder, words", [
    (["TUNING", "SNAPSHOT"], None, "host-snapshot-tuning", "VARIANT=snapshot-tuning DEFINES=-DTUNING -DSNAPSHOT"),
    ([], TUNED, "host-some_motor", "VARIANT=some_motor DEFINES= USERPARAMS=build/tune/some_motor"),
    (["TUNING"], TUNED, "host-some_motor-tuning", "DEFINES=-DTUNING USERPARAMS="), ([], None, "host", "vboard")])
def test_a_header_and_defines_mean_a_folder_of_their_own(fake, defines, userparams, folder, words):
    library, call = fake("echo \"$@\" > $RESULT", defines, userparams)
    assert library == paths.ROOT / "build" / folder / "libvboard.so"
    assert words in call and ("VARIANT" in call) == (folder != "host")


def test_different_values_of_a_macro_and_headers_in_folders_of_the_same_name_share_no_folder():
    assert build.variant_name(["A=1"]) != build.variant_name(["A=2"])
    names = {build.variant_name([], Path(folder) / "params") for folder in ("/one", "/two")}
    assert len(names) == 2 and all(re.fullmatch(r"params-[0-9a-f]{8}", name) for name in names)


def test_a_header_is_found_by_its_folder_or_by_itself_and_the_project_s_own_is_the_default_build(tmp_path):
    (tmp_path / "userparams.h").touch()
    for folder, found in ((tmp_path, tmp_path.resolve()), (paths.ROOT, None)):
        assert build.header_folder(folder) == build.header_folder(folder / "userparams.h") == found
    refusal(lambda: build.header_folder(paths.TABLES), "no userparams.h in ", "--userparams: name the folder")


# ---- make ----------------------------------------------------------------------------------------------------------------
def test_the_flags_of_a_surrounding_make_are_not_inherited(fake):
    assert fake("echo \"flags=$MAKEFLAGS\" > $RESULT")[1].strip() == "flags="


def test_the_image_s_board_and_the_pc_s_share_objects_and_flags():
    flags = {next(line for line in make("-n", target).stdout.splitlines() if "build/host/flags" in line) for target in (
        "build/host/flags", "build/host/tools/cpu_33f/iss_board.o", "build/host/tools/cpu_33f/iss_core.o")}
    assert len(flags) == 1


@pytest.mark.parametrize("options, folder", [
    ((), "board"), (("VARIANT=x", "DEFINES=-DTUNING"), "board"), (("VARIANT=y", "USERPARAMS=examples"), "board"),
    (("VARIANT=x", "SAN=1"), "host-x-san"), (("VARIANT=x", "WERROR=1"), "board-strict"), (("VARIANT=x", "CFLAGS=-O1"), "host-x")])
def test_variants_share_the_board_s_objects_unless_they_compile_in_a_way_of_their_own(options, folder):
    said = make("-n", "-B", "vboard", *options).stdout
    assert re.findall(r"-c tools/plant/plant_motor\.c -o (\S+)/tools/plant/", said) == [f"build/{folder}"]


REFUSED = "include/x.h:3: error: static assertion failed: \"userparams.h: MOTOR_RS_OHM = 99 is outside 0.01 .. 40 ohm\""


@pytest.mark.parametrize("script, userparams, text", [
    ("echo 'foc33: build/tune/m/userparams.h:26: MOTOR_RS_OHM = 99 is outside' >&2; echo 'make: *** [x] Error 2' >&2; exit 2", paths.TUNED / "m",
     "build/tune/m/userparams.h:26: MOTOR_RS_OHM = 99 is outside"), # the line of the build says it all
    ("echo 'a.c:3:1: error: one' >&2; exit 2", paths.TUNED / "m", "does not build, build/tune/m/userparams.h: a.c:3:1: error: one"),
    ("echo 'noise' >&2; echo 'a.c:3:1: error: expected ;' >&2; exit 2", None, "does not build, make vboard: a.c:3:1: error: expected ;")])
def test_a_refused_parameter_or_another_error_is_told_with_its_place(fake, script, userparams, text):
    assert refusal(lambda: fake(script, userparams=userparams)).endswith(text)


# ---- application ---------------------------------------------------------------------------------------------------------
def test_an_application_that_is_no_file_is_called_what_it_is(tmp_path):
    (tmp_path / "pump.c").touch()
    for text, what, remedy in ((f"{tmp_path}", "' is a folder", "name the C file in it"), (f"{tmp_path}/pump", "no file '", f"did you mean '{tmp_path}/pump.c'?"),
                               (f"{tmp_path}/fan.c", f"no file '{tmp_path}/fan.c'", "name a C file, or one of analog, fan, "), ("mine.c", "no file 'mine.c'", "name a C file"),
                               ("panle", "no application 'panle'", "did you mean 'panel'?")):
        refusal(lambda text=text: build.app(text, "APP"), what, "APP: ", remedy)
    assert build.app("pump.c", "APP", tmp_path / "scenario.toml") == f"APP={tmp_path}/pump.c" and build.app("fan", "APP") == "APP=fan"


def test_a_report_names_the_application_that_ran():
    for defines, shown in (([], ""), (["TUNING", "APP=fan"], "fan"), ([f"APP={paths.ROOT}/examples/my_app.c"], "examples/my_app.c")):
        data = {"motor": "m.toml", "motor_title": "M", "header": "userparams.h", "note": "", "app": build.app_shown(defines)}
        assert report.used_lines(data) == ["motor   m.toml: M", "header  userparams.h", *([f"app     {shown}"] if shown else [])]
