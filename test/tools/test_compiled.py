"""The tuner's C sources as libraries: compiled once for each text and compiler, kept, and refused in one line."""

import pytest
from support import refusal

from tools.common import paths
from tuning import compiled


@pytest.fixture(autouse=True)
def kept(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled, "KEPT", tmp_path / "kept")
    return compiled.KEPT


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "source.c"
    path.write_text("int answer(void)\n{\n    return 42;\n}\n", encoding="utf-8")
    return path


def test_a_source_is_compiled_once_and_again_when_it_or_the_compiler_is_another(source, kept, monkeypatch):
    assert compiled.library(source).answer() == 42 and len(list(kept.iterdir())) == 1
    with monkeypatch.context() as patch:
        patch.setattr(compiled, "run_compiler", None)
        assert compiled.library(source).answer() == 42
    source.write_text(source.read_text(encoding="utf-8").replace("42", "43"), encoding="utf-8")
    assert compiled.library(source).answer() == 43 and len(list(kept.iterdir())) == 2
    monkeypatch.setenv("CC", "gcc -g")
    assert compiled.library(source).answer() == 43 and len(list(kept.iterdir())) == 3


def test_what_cannot_be_kept_is_compiled_each_time_and_what_is_no_library_any_more_again(source, kept):
    kept.write_text("no folder", encoding="utf-8")
    assert compiled.library(source).answer() == 42
    kept.unlink()
    compiled.library(source)
    library = next(kept.iterdir())
    library.unlink() # it is loaded: its text must not change
    library.write_text("half a library", encoding="utf-8")
    assert compiled.library(source).answer() == 42 and library.stat().st_size > 1000


def test_what_does_not_compile_is_refused_in_one_line(source):
    source.write_text("int answer(void) { return forty_two; }\n", encoding="utf-8")
    refusal(lambda: compiled.library(source), "does not compile: ", "source.c")


def test_sums_are_rounded_as_they_are_written(source):
    """A machine that multiplies and adds in one step must give the same numbers."""
    assert "-ffp-contract=off" in compiled.FLAGS and "-ffast-math" not in compiled.FLAGS
    for name in ("start_trial.c", "load_onset.c"):
        assert compiled.library(paths.ROOT / "tuning" / name)
