"""The history of size and cycles: a line a commit, in the commits' order, whatever columns they had."""

import csv
import re
import subprocess

import pytest

from tools.common.errors import UserError
from tools.image import history


@pytest.fixture
def tree(tmp_path):
    """A folder with git and a source; tree("text") commits it."""
    def git(*words: str) -> str:
        identity = ("-c", "user.name=n", "-c", "user.email=e@example.org")
        return subprocess.run(["git", *identity, *words], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.strip()

    def commit(text: str) -> str:
        (tmp_path / "userparams.h").write_text(text, encoding="utf-8")
        git("add", "-A")
        git("commit", "-q", "-m", text)
        return git("log", "-1", "--format=%h")

    git("init", "-q")
    commit.folder = tmp_path
    return commit


def keep(tree, **values: float) -> str:
    return history.keep("size", values, tree.folder / "pictures", tree.folder)


def lines(tree) -> list[dict[str, str]]:
    with (tree.folder / "docs/history/size.csv").open(encoding="utf-8") as file:
        return [{name: text for name, text in line.items() if name != "date"} for line in csv.DictReader(file)]


def test_each_commit_has_one_line_and_a_new_measurement_replaces_it(tree):
    first = tree("a")
    keep(tree, law=10, ram=4)
    keep(tree, law=11, ram=4)
    assert lines(tree) == [{"commit": first, "law": "11", "ram": "4"}]
    second = tree("b")
    told = keep(tree, law=12.5, ram=5)
    assert lines(tree) == [{"commit": first, "law": "11", "ram": "4"}, {"commit": second, "law": "12.5", "ram": "5"}]
    assert told.startswith("history: ") and (tree.folder / "pictures/size_history.png").stat().st_size > 1000


def test_what_came_and_what_went_has_no_number(tree):
    first = tree("a")
    keep(tree, law=10, old=3)
    second = tree("b")
    keep(tree, law=10, new=2)
    assert lines(tree) == [{"commit": first, "law": "10", "old": "3", "new": ""}, {"commit": second, "law": "10", "old": "", "new": "2"}]


def test_sources_that_no_commit_has_leave_no_line(tree):
    tree("a")
    (tree.folder / "userparams.h").write_text("changed", encoding="utf-8")
    assert keep(tree, law=1) == "no line in docs/history/size.csv: the sources are not as in the last commit"
    assert not (tree.folder / "docs").exists()


def test_without_git_there_is_no_line(tmp_path, monkeypatch):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert history.keep("size", {"law": 1}, tmp_path, tmp_path) == "no line in docs/history/size.csv: there is no git history here"


@pytest.mark.parametrize("text, told", [("law,commit\n1,a\n", r"does not begin with commit,date, .*size\.csv:1: take"), ("", r"does not begin.*size\.csv:1: take"),
                                        ("commit,date,law\na,2026-01-01,x\n", r"needs a number.*size\.csv:2: take"),
                                        ("commit,date,law\na,2026-01-01\n", r"needs a number.*size\.csv:2: take"),
                                        ("commit,date,law\na,2026-01-01,1\nb,2026-01-01,1,2\n", r"needs a number.*size\.csv:3: take")])
def test_a_damaged_file_is_told_with_its_line_and_stays_as_it_is(tree, text, told):
    path = tree.folder / "docs/history/size.csv"
    path.parent.mkdir(parents=True)
    path.write_text(text, encoding="utf-8")
    tree("a")
    with pytest.raises(UserError) as error:
        keep(tree, law=1)
    assert path.read_text(encoding="utf-8") == text
    assert re.search(told, str(error.value)), str(error.value)
