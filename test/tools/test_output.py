"""Result folders: complete or not there at all, and nobody else's files are touched."""

import json

import pytest
from support import refusal, trace

from tools.common.output import ResultFolder, write_csv, write_summary, write_trace


def write(target, text: str = "{}") -> None:
    with ResultFolder(target) as folder:
        (folder.work / "summary.json").write_text(text, encoding="utf-8")
        seen = (target / "summary.json").read_text(encoding="utf-8") if (target / "summary.json").exists() else ""
        assert seen != text # nothing is visible before the end


def names(folder) -> list[str]:
    return [path.name for path in folder.iterdir()]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failed_or_interrupted_run_leaves_nothing_and_keeps_the_older_result(tmp_path, error):
    for before in ([], ["demo"]):
        with pytest.raises(error), ResultFolder(tmp_path / "demo") as folder:
            (folder.work / "new.json").write_text("{}", encoding="utf-8")
            raise error
        assert names(tmp_path) == before
        if not before:
            write(tmp_path / "demo", "old")
    assert (tmp_path / "demo" / "summary.json").read_text(encoding="utf-8") == "old"


def test_an_older_result_is_replaced_as_a_whole(tmp_path):
    target = tmp_path / "demo"
    write(target, "old")
    (target / "old.png").touch()
    write(target, "new")
    assert (names(tmp_path), names(target)) == (["demo"], ["summary.json"])
    assert (target / "summary.json").read_text(encoding="utf-8") == "new"


def test_an_empty_folder_is_taken_and_missing_parents_are_made(tmp_path):
    (tmp_path / "empty").mkdir()
    for name in ("empty", "a/b"):
        write(tmp_path / name)
        assert (tmp_path / name / "summary.json").is_file()


@pytest.mark.parametrize("target, parts", [
    ("other", ["is not a result folder"]), ("file", ["is not a result folder"]),
    ("file/demo", ["cannot write to '", "file'", "choose a folder"])])
def test_what_is_no_result_or_cannot_be_written_is_refused_before_anything_runs(tmp_path, target, parts):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("years of work", encoding="utf-8")
    (tmp_path / "file").touch()

    def enter() -> None:
        with ResultFolder(tmp_path / target):
            pytest.fail("must not get here")
    refusal(enter, *parts)
    assert names(tmp_path / "other") == ["thesis.txt"]


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    def fill() -> None:
        with ResultFolder(tmp_path / "demo"):
            raise OSError(28, "No space left on device")
    refusal(fill, "cannot write to ", "No space left")
    assert names(tmp_path) == []


def test_a_summary_refuses_what_is_no_json_a_trace_has_a_line_a_row_and_a_table_quotes_what_would_break_its_columns(tmp_path):
    with pytest.raises(ValueError):
        write_summary(tmp_path, {"x": float("nan")})
    write_summary(tmp_path, {"x": None})
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8")) == {"x": None}
    write_trace(tmp_path / "trace.csv", trace(0.001, plant__speed_rpm=1234.5))
    rows = [line.split(",") for line in (tmp_path / "trace.csv").read_text(encoding="utf-8").splitlines()]
    assert (len(rows), len(rows[1])) == (21, len(rows[0]))
    assert (rows[0][:2], rows[1][:2]) == (["time_s", "plant.speed_rpm"], ["0.00005", "1234.5"])
    write_csv(tmp_path / "t.csv", ["a", "b"], [["one, two", 'say "x"'], [1, None]])
    assert (tmp_path / "t.csv").read_text(encoding="utf-8") == 'a,b\n"one, two","say ""x"""\n1,\n'
