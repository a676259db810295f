"""How a name becomes a file, and what a folder that cannot be read is answered with."""

import importlib.util
import sys
from pathlib import Path

from support import refusal

from tools.common import paths


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


def test_the_proofs_find_their_headers_in_a_folder_with_a_blank():
    """Frama-C splits what it passes on to the preprocessor at blanks."""
    spec = importlib.util.spec_from_file_location("proof", paths.ROOT / "test/proof/proof.py")
    proof = importlib.util.module_from_spec(spec)
    sys.modules["proof"] = proof
    spec.loader.exec_module(proof)
    assert not proof.HERE.is_absolute() and (proof.HERE / "any.h").is_file()
