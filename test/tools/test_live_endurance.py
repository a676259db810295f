"""make live-endurance: what it judges, and that it runs."""

import pytest

from tools.live import endurance
from tools.live.endurance import Found, Row, failures

pytestmark = pytest.mark.waits


def rows(server: float = 0.1, grown_mb: float = 0.0, tab_mb: float = 0.0, frames: float = 20.0) -> list[Row]:
    """Of ten minutes of two tabs, the second of which is the slower one; what grows does so until the end."""
    return [Row(30.0 * n, 30.0 * n * 0.04, 30.0 * n * (0.04 + server), 90.0 + (200.0 if n else 0.0) + grown_mb * n / 20.0, (9.0, 9.0 + tab_mb * n / 20.0),
                (600 * n, round(30.0 * frames * n))) for n in range(21)]


def test_shares_are_those_beside_the_board_and_the_slowest_tab_counts():
    found = Found.of(rows()[1], rows(frames=18.0, tab_mb=3.0)[20])
    assert found.server == pytest.approx(0.1) and found.board == pytest.approx(0.04)
    assert found.frames_per_s == pytest.approx(18.0, abs=0.2)


@pytest.mark.parametrize("changed, says", [
    ({"server": 0.16}, "the server takes 16.0% of a core beside the board, more than 15%"), ({"frames": 19.9}, "a tab shows 19.9 frames a second, less than 20"),
    ({"grown_mb": 9.0}, "memory has grown by 5.0 MB, more than 4"), ({"tab_mb": 9.0}, "memory has grown by 5.0 MB, more than 4")])
def test_what_is_not_as_it_must_be_is_named_and_what_comes_while_it_warms_up_is_no_growth(changed, says):
    assert failures(rows()) == [] and failures(rows(**changed)) == [says]


def test_a_single_row_that_is_larger_is_no_growth():
    found = rows()
    assert endurance.growth_mb(found[5:]) == 0.0
    last = found[-1]
    assert endurance.growth_mb([*found[5:-1], Row(last.at_s, last.board_s, last.process_s, last.server_mb, (9.0, 14.0), last.frames)]) == 0.0


@pytest.mark.parametrize("arguments, says", [(["--minutes", "0"], "'0' is impossible, MINUTES: choose 0.05 .. 1440"), (["--tabs", "two"], "'two' is impossible, TABS: choose 1 .. 8"),
                                             (["--minutes", "nan"], "'nan' is impossible")])
def test_what_cannot_be_is_one_line(capsys, arguments, says):
    assert endurance.main(arguments) == 2
    assert says in capsys.readouterr().err


def test_two_tabs_for_three_seconds(chromium):
    found = list(endurance.rows(0.05, 2))
    whole = Found.of(found[0], found[-1])
    assert 0.0 < whole.board < 1.0 and 0.0 < whole.server < 1.0 and 2.0 < whole.frames_per_s < 21.0
    assert len(found[0].tabs_mb) == len(found[0].frames) == 2 and 20.0 < found[0].server_mb < 500.0
