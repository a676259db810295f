"""make as a user types it: what nothing would read is refused before any work, in one line; any path and any mode works."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from support import refusal
from test_image_build import our_lines
from xc16 import make

from tools.bench import cli, command_common
from tools.common.param_rows import modes
from tools.common.paths import ROOT

SOURCES = ("Makefile", "userparams.h", "firmware", "include", "tools", "tuning", "examples", "build/setup")
HELP = re.findall(r"^  make (\S+) .*?((?: \[.*\])?)$", make().stdout, re.MULTILINE)
MODES = [mode for mode in modes() if mode not in ("BRINGUP", "IDENTIFY", "PARAMS_IN_RAM", "SELFTEST_OFF")]


COMPILED = ("build/board", "build/iss")
"""Of the board alone, no file of the firmware: half a minute of each copy's first build."""


def copy(root: Path) -> Path:
    """The project, its firmware not built yet."""
    for name in (*SOURCES, *(name for name in COMPILED if (ROOT / name).exists())):
        source, target = ROOT / name, root / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", ".*")) if source.is_dir() else shutil.copy(source, target)
    return root


@pytest.fixture(scope="module")
def blanks(tmp_path_factory) -> Path:
    return copy(tmp_path_factory.mktemp("tree") / "my drives" / "foc's 33")


@pytest.fixture(scope="module")
def own(tmp_path_factory) -> Path:
    """A folder of the user's with a motor, a board and a scenario, all in names with blanks."""
    folder = tmp_path_factory.mktemp("own") / "it's \"mine\""
    folder.mkdir()
    for source, name in (("tuning/motors/linix_45zwn24_40.toml", "a motor"), ("tuning/boards/mclv.toml", "a board"),
                         ("tools/bench/scenarios/rated.toml", "a scenario")):
        shutil.copy(ROOT / source, folder / f"{name}.toml")
    return folder


def refused(done: subprocess.CompletedProcess, text: str) -> None:
    """Exit code 2 and one line, which matches; nothing was compiled or run."""
    assert (done.returncode, len(our_lines(done)), done.stdout) == (2, 1, ""), done.stdout + done.stderr
    assert re.search(text, our_lines(done)[0]), done.stderr


# ---- variables -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("goal", [goal for goal, _ in HELP])
def test_every_target_refuses_a_variable_that_does_not_exist_and_names_the_nearest(goal):
    refused(make(goal, "MOTER=linix_45zwn24_40"), "^foc33: no variable MOTER, make's command line: did you mean MOTOR\\?$")


@pytest.mark.parametrize("typed, meant", [("SCENARO", "SCENARIO"), ("OTU", "OUT"), ("board", "BOARD"), ("DEFINE", "DEFINES"), ("VARIENT", "VARIANT"),
                                          ("USERPARAM", "USERPARAMS"), ("CFLAG", "CFLAGS"), ("XC61", "XC16")])
def test_the_nearest_name_is_the_one_that_was_meant(typed, meant):
    refused(make("run", f"{typed}=x"), f"no variable {typed}, .*: did you mean {meant}\\?$")


@pytest.mark.parametrize("goal, word, text", [
    ("starts", "SCENARIO=demo", "make starts has no SCENARIO, .*: it takes FULL DRAW SEED CASE MOTOR BOARD"), ("run", "SAN=1", "make run has no SAN"),
    ("cycles", "MOTOR=x", "make cycles has no MOTOR"), ("motors", "MOTOR=x", "it takes BOARD OUT"), ("format", "OUT=x", "leave it out"),
    ("table2", "DEFINES=-DTUNING", "make table2 has no DEFINES")])
def test_a_variable_that_a_target_would_not_read_is_refused(goal, word, text):
    refused(make(goal, word), text)


@pytest.mark.parametrize("goal, brackets", HELP)
def test_what_the_list_of_targets_names_is_taken_and_so_are_the_usual_ones(goal, brackets):
    names = re.findall(r"\b([A-Z][A-Z0-9]*)=", brackets)
    for typed in (names, ["V", "CC", "PYTHON", "XC16", "INSTALL"]):
        done = subprocess.run(["awk", "-v", f"typed={' '.join(typed)}", "-v", f"goals={goal}", "-f", "tools/make/nearest.awk", "-f", "tools/make/input.awk", "Makefile",
                               *map(str, ROOT.glob("tools/make/*.mk"))], cwd=ROOT, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (0, "")


def test_without_python3_a_misspelt_variable_is_refused_all_the_same(tmp_path):
    for tool in ("awk", "sh"):
        (tmp_path / tool).symlink_to(shutil.which(tool))
    done = subprocess.run(["awk", "-v", "typed=MOTER", "-v", "goals=run", "-f", "tools/make/nearest.awk", "-f", "tools/make/input.awk", "Makefile"], cwd=ROOT,
                          env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "foc33: no variable MOTER, make's command line: `make` lists them\n")


def test_one_of_several_goals_is_enough_and_inner_makes_are_not_asked():
    assert make("-n", "build/host/flags", "VARIANT=x", "CFLAGS=-O1", "WERROR=1").returncode == 0
    done = subprocess.run(["make", "-s", "help", "warnings=-w", "NEW=1"], cwd=ROOT, env=os.environ | {"MAKELEVEL": "1"}, capture_output=True, check=False)
    assert done.returncode == 0
    refused(make("starts", "format", "SCENARIO=x"), "make starts has no SCENARIO")


# ---- tools, folders, files -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("goal", ["lib", "run", "test", "sanitize"])
@pytest.mark.parametrize("word", ["CC=none", "CC=none -g", "RUBY=/no/ruby"])
def test_a_tool_that_is_not_there_is_named(goal, word):
    refused(make(goal, word), f"^foc33: no command {word.split('=')[1].split()[0]}, {word}: name one that is there$")


@pytest.mark.parametrize("goal", ["lib", "run", "test", "tune"])
@pytest.mark.parametrize("kind", ["file", "link", "foreign", "foreign folder", "foreign tree"])
def test_a_build_folder_that_cannot_be_used_is_named(goal, kind):
    with tempfile.TemporaryDirectory() as name: # pytest's folders are closed to other users
        root = Path(name) / "a tree"
        root.mkdir()
        Path(name).chmod(0o755)
        for part in ("Makefile", "tools/make", "tools/setup", "include/drive/modes/mode_table.h"):
            source = ROOT / part
            (root / part).parent.mkdir(parents=True, exist_ok=True)
            shutil.copytree(source, root / part) if source.is_dir() else shutil.copy(source, root / part)
        build, bad = root / "build", {"foreign folder": "build/host", "foreign tree": "."}.get(kind, "build")
        if kind == "link":
            build.symlink_to("nowhere")
        elif kind == "file":
            build.touch()
        elif kind != "foreign tree":
            (build / "host").mkdir(parents=True)
            build.chmod(0o777)
        if kind.startswith("foreign"):
            (root / bad).chmod(0o500 if os.geteuid() else 0o755)
        user = {"user": 65534, "extra_groups": []} if os.geteuid() == 0 else {}
        try:
            done = subprocess.run(["make", "-s", goal], cwd=root, env={"PATH": os.environ["PATH"], "HOME": "/"}, capture_output=True, text=True, check=False, **user)
        finally:
            (root / bad).chmod(0o755) if (root / bad).exists() else None
        refused(done, f"^foc33: cannot read and write {re.escape(bad)}, {re.escape(str(root))}: change owner and permissions$")


def room(folder: Path, **environment: str) -> subprocess.CompletedProcess:
    (folder / "build").mkdir(exist_ok=True)
    return subprocess.run([ROOT / "tools/make/room.sh"], cwd=folder, env={"PATH": os.environ["PATH"], **environment}, capture_output=True, text=True, check=False)


def test_a_disk_with_room_is_silent_and_nothing_stays_there(tmp_path):
    done = room(tmp_path, TMPDIR=str(tmp_path))
    assert (done.returncode, done.stdout, done.stderr, list((tmp_path / "build").iterdir())) == (0, "", "", [])


@pytest.mark.parametrize("program, body, text", [
    ("df", "printf 'Filesystem 1024-blocks Used Available Capacity Mounted\\nx 9 9 100 9% /\\n'", "the disk of {} has only 100 KiB free: free at least 8 MiB"),
    ("head", "echo \"head: error writing 'standard output': No space left on device\" >&2; exit 1",
     "cannot write {} (No space left on device): free some space or make the folder writable")])
def test_a_full_disk_is_one_line(tmp_path, program, body, text):
    (tmp_path / program).write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    (tmp_path / program).chmod(0o755)
    done = room(tmp_path, PATH=f"{tmp_path}:{os.environ['PATH']}")
    assert (done.returncode, done.stdout) == (1, f"foc33: {text.format(f'build, {tmp_path}')}\n") and not list((tmp_path / "build").iterdir())


def test_a_folder_for_temporary_files_that_takes_none_is_one_line_of_make_before_any_work():
    done = subprocess.run(["make", "-s", "lib", "VARIANT=none"], cwd=ROOT, env=os.environ | {"TMPDIR": "/proc"}, capture_output=True, text=True, check=False)
    refused(done, r"^foc33: cannot write temporary files, TMPDIR=/proc \(.+\): free some space or make the folder writable$")


@pytest.mark.parametrize("name, value", [("PYTHONSAFEPATH", "1"), ("MPLBACKEND", "nonsense")])
def test_what_the_environment_says_to_python_does_not_stop_make(name, value):
    clean = {key: text for key, text in os.environ.items() if key not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    done = subprocess.run(["make", "-s", "scenarios"], cwd=ROOT, env=clean | {name: value}, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "demo" in done.stdout, done.stderr


@pytest.mark.parametrize("module", ["tools.bench.plots", "tuning.plots"])
def test_a_wrong_backend_does_not_stop_the_plots(module):
    done = subprocess.run([sys.executable, "-c", f"import {module}"], cwd=ROOT, env=os.environ | {"MPLBACKEND": "nonsense"}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("words, text", [
    (["sanitize", "SCENARIO=dmeo"], "no scenario 'dmeo'.*did you mean 'demo'"), (["run", "SCENARIO=dmeo", "MOTOR=linix_45zwn24_40"], "no scenario 'dmeo'"),
    (["run", "MOTOR=lynix_45zwn24_40"], "no motor 'lynix.*did you mean 'linix"), (["run", "BOARD=mclw"], "no board 'mclw'"),
    (["run", "DEFINES=-DTORQE_MODE"], "no mode 'TORQE_MODE'.*did you mean 'TORQUE_MODE'"), (["sanitize", "DEFINES=TUNING"], "no mode 'TUNING', DEFINES: use -D"),
    (["run", "DEFINES=-DIDENTIFY"], "no scenario is for IDENTIFY, DEFINES: make identify"),
    (["run", "DEFINES=-DBRINGUP"], "no scenario is for BRINGUP, DEFINES: make bringup runs BRINGUP"), (["bringup", "VARIANT=motor_xy"], "no variant 'motor_xy', VARIANT: "), (["run", "DEFINES=-DTUNING=0"], "no mode '-DTUNING=0'"),
    (["run", "DEFINES=-DMOTOR_RS_OHM=3"], "MOTOR_RS_OHM is a parameter, DEFINES: set it in userparams.h")])
def test_a_wrong_file_or_mode_is_told_before_anything_is_built(blanks, words, text):
    refused(make(*words, root=blanks), text)
    assert not list((blanks / "build").glob("host*")) and not (blanks / "build/tune").exists()


# ---- modes ---------------------------------------------------------------------------------------------------------------
def scenario_for(*arguments: str):
    return command_common.scenario_for(cli._parser().parse_args(["run", *arguments]))


@pytest.mark.parametrize("mode", MODES)
def test_a_mode_that_is_asked_for_runs_its_own_scenario_unless_one_is_named(mode):
    item, more = scenario_for(f"--defines=-D{mode}")
    assert (item.defines, more) == ([mode], []) and item.name != "demo"
    item, more = scenario_for("smoke", f"--defines=-D{mode}=1")
    assert (item.name, item.defines, more) == ("smoke", [mode], [mode])


def test_the_scenario_is_named_like_its_mode_and_other_macros_go_to_the_usual_one():
    assert scenario_for("--defines=-DTORQUE_MODE")[0].name == "torque_mode" # not torque_limits, torque_stop
    item, more = scenario_for("--defines=-DPARAMS_IN_RAM -DSPEEDCNTR_PTERM=300")
    assert (item.name, more) == ("demo", ["PARAMS_IN_RAM", "SPEEDCNTR_PTERM=300"])
    assert [scenario_for(*words)[0].name for words in ([], ["--motor", "linix_45zwn24_40"])] == ["demo", "rated"]
    assert [scenario_for("--app", name)[0].name for name in ("fan", "panel", "examples/my_app.c")] == ["app_fan", "demo", "app_any"]
    refusal(lambda: scenario_for("--defines=-DTORQUE_MODE -DTUNING"), "no scenario is for TORQUE_MODE with TUNING, DEFINES: name the one to run")


def test_make_run_runs_the_mode_that_was_asked_for(blanks):
    done = make("run", "DEFINES=-DTORQUE_MODE", root=blanks)
    assert done.returncode == 0 and "results in build/run/torque_mode/" in done.stdout, done.stderr
    assert "#define TORQUE_MODE 1" not in (blanks / "userparams.h").read_text(encoding="utf-8") and list((blanks / "build").glob("host-torque-mode"))


def test_a_parameter_is_not_a_define(blanks):
    done = make("lib", "DEFINES=-DMOTOR_RS_OHM=3", "VARIANT=none", root=blanks)
    assert (done.returncode, our_lines(done)) == (2, ["foc33: MOTOR_RS_OHM is a parameter, DEFINES=-DMOTOR_RS_OHM=3: set it in userparams.h"])


# ---- paths ---------------------------------------------------------------------------------------------------------------
def test_motor_board_scenario_and_results_may_have_any_path_in_a_checkout_with_any(blanks, own):
    done = make("run", f"MOTOR={own}/a motor.toml", f"BOARD={own}/a board.toml", f"SCENARIO={own}/a scenario.toml", f"OUT={own}/my results", root=blanks)
    assert (done.returncode, (own / "my results/summary.json").is_file()) == (0, True), done.stderr
    assert f"results in {own}/my results/" in done.stdout


def test_the_tuner_s_commands_take_any_path_and_nothing_is_lost(blanks, own):
    before = (blanks / "userparams.h").read_text(encoding="utf-8")
    for expected in ("userparams.h written", "userparams.h is up to date"):
        done = make("userparams", f"MOTOR={own}/a motor.toml", root=blanks)
        assert done.returncode == 0 and expected in done.stdout, done.stderr
    assert f"Made from {own}/a motor.toml" in (blanks / "userparams.h").read_text(encoding="utf-8")
    assert [(path.name, path.read_text(encoding="utf-8")) for path in blanks.glob("*.old*")] == [("userparams.h.old", before)]
    done = make("tune", f"MOTOR={own}/a motor.toml", f"OUT={own}/the tuning", root=blanks)
    assert done.returncode == 0 and (own / "the tuning/userparams.h").is_file(), done.stderr
    (blanks / "userparams.h.old").replace(blanks / "userparams.h")


@pytest.mark.parametrize("name", ["two  words", "it's", 'say "x"', "a;b|c&d", "50% #1: a$$b\\c", "*?[x]~"])
def test_a_header_s_folder_may_have_any_name_and_what_changes_in_it_is_built(blanks, tmp_path, name):
    folder = tmp_path / name.replace("$$", "$") # make's way to write a dollar
    folder.mkdir()
    shutil.copy(blanks / "userparams.h", folder)
    words = ("build/host-odd/firmware/drive/param_check.o", f"USERPARAMS={tmp_path / name}", "VARIANT=odd")
    first, again = (make(*words, root=blanks) for _ in range(2))
    assert ("param_check.c" in first.stdout, again.stdout) == (True, ""), first.stderr
    with (folder / "userparams.h").open("a", encoding="utf-8") as header:
        header.write("#error mine\n")
    line = (folder / "userparams.h").read_text(encoding="utf-8").count("\n")
    assert f"{folder}/userparams.h:{line}:" in make(*words, root=blanks).stderr # the user's file, not the copy
