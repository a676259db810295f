"""The README's count of tests: from a complete run without a failure, or none."""

import json

import pytest

from tools.docs import readme


@pytest.fixture
def result(tmp_path, monkeypatch):
    """Writes what a run of the tests leaves."""
    (tmp_path / "build/test").mkdir(parents=True)
    (tmp_path / "build/coverage").mkdir()
    (tmp_path / "build/coverage/summary.json").write_text('{"line_percent": 100, "branch_percent": 99.6}')
    monkeypatch.setattr(readme, "ROOT", tmp_path)

    def write(passed: int, failed: int, skipped: int) -> None:
        (tmp_path / "build/test/summary.json").write_text(json.dumps({"passed": passed, "failed": failed, "skipped": skipped}))
    return write


@pytest.mark.parametrize("numbers, row", [((3, 0, 1), "| unit, board and closed-loop tests (1 more were skipped) | 3 |"),
                                          ((1, 0, 0), "| unit, board and closed-loop tests, with those that need XC16 | 1 |")])
def test_a_complete_run_gives_its_numbers(result, numbers, row):
    assert readme.tests() is None # before it the table stays
    result(*numbers)
    assert row in readme.tests()


def test_a_failed_test_keeps_the_readme_as_it_is(result):
    result(0, 1, 0)
    with pytest.raises(SystemExit, match=r"^foc33: 1 tests failed, build/test/summary.json: repair them"):
        readme.tests()


def test_a_missing_picture_is_one_line_and_nothing_is_written(result, tmp_path, monkeypatch):
    (tmp_path / "README.md").write_text("as it was")
    monkeypatch.setattr(readme, "README", tmp_path / "README.md")
    with pytest.raises(SystemExit, match=r"^foc33: no picture, build/run/demo/speed.png: run `make readme`"):
        readme.main()
    assert (tmp_path / "README.md").read_text() == "as it was"
