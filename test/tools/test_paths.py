"""How a name becomes a file, and what a folder that cannot be read is answered with."""

import importlib.util
import sys
from pathlib import Path

from support import refusal

from tools.common import paths
from tools.common.errors import suggestion
from tools.common.param_rows import parameters


def test_names_are_those_of_the_toml_files(tmp_path):
    for name in ("b.toml", "a.toml", "c.txt"):
        (tmp_path / name).touch()
    assert paths.names(tmp_path) == ["a", "b"]


def test_a_folder_that_is_not_there_or_cannot_be_read_is_named(tmp_path, monkeypatch):
    def denied(path):
        raise PermissionError(13, "Permission denied")

    refusal(lambda: paths.names(tmp_path / "nowhere"), "cannot read the folder (No such file or directory), ", "nowhere: make it readable")
    monkeypatch.setattr(Path, "iterdir", denied)
    monkeypatch.setattr(Path, "is_file", denied)
    for call in (lambda: paths.find("motor", "a", tmp_path), lambda: paths.find("motor", str(tmp_path / "a.toml"), tmp_path),
                 lambda: paths.names(tmp_path)):
        refusal(call, f"cannot read the folder (Permission denied), {paths.shown(tmp_path)}: make it readable")


def test_a_path_in_a_file_is_seen_from_that_file_and_from_the_current_folder_only_where_nothing_is_there(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    file = tmp_path / "there" / "scenario.toml"
    (tmp_path / "there" / "motors").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    (tmp_path / "there" / "motors" / "m.toml").touch()
    assert paths.beside("mclv", file) == ("mclv", "") and paths.beside("/any/m.toml", file) == ("/any/m.toml", "")
    for name in ("motors/m.toml", "motors/m"):
        assert paths.beside(name, file) == (str(tmp_path / "there" / name), "")
    assert paths.beside("./none.toml", file) == (str(tmp_path / "there" / "none.toml"), "")
    Path("old.toml").touch()
    assert paths.beside("./old.toml", file) == ("./old.toml", "'./old.toml' is found from the current folder, not from the file's: write \"../here/old.toml\"")
    (tmp_path / "there" / "old.toml").touch()
    assert paths.beside("./old.toml", file) == (str(tmp_path / "there" / "old.toml"), "")


def test_a_path_may_lack_its_toml(tmp_path):
    (tmp_path / "a.b.toml").touch()
    assert paths.find("board", str(tmp_path / "a.b"), tmp_path) == tmp_path / "a.b.toml"
    (tmp_path / "a.b").touch()
    assert paths.find("board", str(tmp_path / "a.b"), tmp_path) == tmp_path / "a.b"
    refusal(lambda: paths.find("board", str(tmp_path / "c"), tmp_path), "no board file", "check the path")


def test_a_long_list_is_named_by_the_command_that_prints_it():
    assert suggestion("zzz", map(str, range(40)), "`make keys`") == "`make keys` lists them"
    assert suggestion("zzz", map(str, range(40))) == "check its spelling"
    assert suggestion("speed_bandwidth_hz", parameters()) == "did you mean 'SPEED_BANDWIDTH_HZ'?"


def test_the_proofs_find_their_headers_in_a_folder_with_a_blank():
    """Frama-C splits what it passes on to the preprocessor at blanks."""
    spec = importlib.util.spec_from_file_location("proof", paths.ROOT / "test/proof/proof.py")
    proof = importlib.util.module_from_spec(spec)
    sys.modules["proof"] = proof
    spec.loader.exec_module(proof)
    assert not proof.HERE.is_absolute() and (proof.HERE / "any.h").is_file()
