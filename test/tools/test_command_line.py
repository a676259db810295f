"""What the command lines share: commands that take files and nothing else."""

import runpy
import sys
from pathlib import Path

import pytest
from support import refused

from tools.common import command_line
from tools.common.errors import UserError


@pytest.fixture
def called(monkeypatch, capsys):
    """Exit code, stdout and stderr of a command with two files."""
    def call(work, *arguments: str):
        monkeypatch.setattr(sys, "argv", ["name", *arguments])
        code = command_line.on_files("tools.name", work, "an image", "the file to write")
        return code, *capsys.readouterr()
    return call


def test_a_command_gets_the_files_that_it_asks_for(called):
    got = []
    assert called(lambda *files: got.extend(files), "one", "other") == (0, "", "") and got == [Path("one"), Path("other")]


@pytest.mark.parametrize("arguments", [(), ("one",), ("one", "two", "three")])
def test_too_few_or_too_many_files_are_one_line(called, arguments):
    refused(called(lambda *files: None, *arguments), f"{len(arguments)} files instead of 2, tools.name: name an image and the file to write")


@pytest.mark.parametrize("line, by_make", [
    ("no motor 'x', --motor: use one of a, b", "no motor 'x', MOTOR: use one of a, b"),
    ("argument --count: invalid int value: 'many', command line: see python3 -m tools.any one --help",
     "argument N: invalid int value: 'many', command line: make help tells what it takes"),
    ("write --all, not --outer or a--out", "write --all, not --outer or a--out")])
def test_a_line_names_the_variables_of_make_where_make_was_called(line, by_make, monkeypatch, capsys):
    for asked, told in (("make", by_make), ("", line)):
        monkeypatch.setenv("ASKED_BY", asked)
        command_line.tell(None, UserError(line))
        assert capsys.readouterr().err == f"foc33: {told}\n"


@pytest.mark.parametrize("module, files", [("tools.live.chip_types", 1), ("tools.live.plain_elf", 2), ("tools.image.load", 1)])
def test_a_file_that_is_no_elf_file_is_one_line_and_stays_as_it_is(module, files, tmp_path, monkeypatch, capsys):
    nothing = tmp_path / "x.elf"
    nothing.write_text("nothing", encoding="utf-8")
    monkeypatch.setattr(sys, "argv", [module, *[str(nothing)] * files])
    monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(SystemExit) as ended:
        runpy.run_module(module, run_name="__main__")
    refused((ended.value.code, *capsys.readouterr()), str(nothing))
    assert nothing.read_text(encoding="utf-8") == "nothing"
