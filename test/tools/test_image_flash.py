"""make flash: only a checked image is programmed, by the right command, and nobody believes that a board is programmed when it is not."""

import re
import shlex

import pytest
from sample_image import good_image
from support import command

from tools.image import flash, image

IPECMD = "#!/bin/sh\nprintf '%s\\n' \"$@\" >\"$RESULT\"\npwd >>\"$RESULT\"\nexit ${STATUS:-0}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A good image, and nothing of MPLAB."""
    monkeypatch.setattr(flash.find, "__defaults__", ((str(tmp_path / "usual"),),))
    for name, value in (("RESULT", str(tmp_path / "result")), ("PATH", f"{tmp_path}/path:/usr/bin:/bin"), ("STATUS", "0")):
        monkeypatch.setenv(name, value)
    good_image().write(tmp_path)
    monkeypatch.setattr(image, "CONFIG_C", tmp_path / "main.c")
    return tmp_path


@pytest.fixture
def install(folder):
    def at(place: str) -> str:
        path = folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(IPECMD, encoding="utf-8")
        path.chmod(0o755)
        return str(path)
    return at


@pytest.fixture
def run(folder):
    """The command: exit status, stdout, lines of stderr."""
    def with_options(*more: str) -> tuple[int, str, list[str]]:
        status, out, error = command(str(folder / "a.hex"), "--elf", str(folder / "a.elf"), *more, main=flash.main)
        assert ("programmed and verified" in out) == (status == 0)
        return status, out, error.splitlines()
    return with_options


@pytest.mark.parametrize("tool", ["PK3", "PK4", "PK5", "ICD4", "SNAP", "snap"])
def test_each_tool_gets_its_command_and_its_logs_go_beside_the_hex_file(folder, install, run, tool):
    install("path/ipecmd.sh")
    status, _, lines = run("--tool", tool)
    assert (status, lines) == (0, [])
    assert (folder / "result").read_text().split("\n")[:6] == ["-P33FJ32MC204", f"-TP{tool.upper()}", f"-F{folder / 'a.hex'}", "-M", "-OL",
                                                               str(folder.resolve())]


def test_without_ipecmd_the_exact_command_is_printed_and_nothing_is_claimed(folder, run):
    status, out, lines = run("--tool", "PK5")
    assert (status, len(lines)) == (2, 1)
    assert shlex.join(["ipecmd.sh", "-P33FJ32MC204", "-TPPK5", f"-F{folder / 'a.hex'}", "-M", "-OL"]) in out
    assert re.search("^foc33: not programmed: .*install MPLAB X", lines[0])


def test_of_the_usual_places_the_newest_is_taken_but_the_folder_that_the_user_names_comes_first(folder, install, run):
    for version in ("v5.50", "v6.9", "v6.20"):
        install(f"usual/{version}/mplab_platform/mplab_ipe/ipecmd.sh")
    assert "usual/v6.20/" in run()[1]
    assert install("path/ipecmd.sh") in run()[1]
    named = install("x/v6.20/mplab_platform/mplab_ipe/ipecmd.sh")
    assert named in run("--ipe", str(folder / "x/v6.20"))[1]
    status, _, lines = run("--ipe", str(folder / "nowhere"))
    assert (status, len(lines)) == (2, 1) and "no ipecmd.sh in IPE=" in lines[0]


def test_a_failed_programming_is_told(install, run, monkeypatch):
    install("path/ipecmd.sh")
    monkeypatch.setenv("STATUS", "7")
    status, _, lines = run()
    assert (status, len(lines)) == (1, 1) and "programming failed, ipecmd exit status 7" in lines[0]


def test_an_image_that_fails_its_checks_is_not_programmed(folder, install, run):
    install("path/ipecmd.sh")
    bad = good_image()
    bad.words[0xF80008] = 0x47
    bad.write(folder)
    status, _, lines = run()
    assert status == 1 and "not programmed, the image failed its checks" in lines[-1]
    assert not (folder / "result").exists()


def test_an_unknown_tool_is_refused(run):
    status, _, lines = run("--tool", "PK44")
    assert (status, len(lines)) == (2, 1) and "no tool TOOL=PK44, make flash: did you mean 'PK4'" in lines[0]
