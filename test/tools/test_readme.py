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


STEP = {"reference_rpm": 500.0, "torque_nm": 0.05, "kphi": 1.0, "dip_percent": 47.6, "on_back_s": 0.03, "off_back_s": 0.04, "beyond": "",
        "angle_error_max_deg": 5.2}


def left(tmp_path, name: str, motor: str, rows: list[dict], **more) -> None:
    (tmp_path / "build/run" / name).mkdir(parents=True)
    data = {"motor": f"tuning/motors/{motor}.toml", "rows": rows, "expectations": [{"ok": row.get("ok", True)} for row in rows], **more}
    (tmp_path / "build/run" / name / "summary.json").write_text(json.dumps(data))


@pytest.mark.parametrize("changes, cells", [
    ({}, "48 % | 0.030 s | 0.040 s | 5°"), ({"on_back_s": None}, "48 % | never | 0.040 s | 5°"),
    ({"beyond": "needs 14 V", "on_back_s": None}, "48 % (out of reach) | out of reach | 0.040 s | 5°")])
def test_a_load_step_is_told_with_its_dip_and_its_return(result, tmp_path, changes, cells):
    left(tmp_path, "loadsteps", "own", [STEP | changes])
    assert f"| 500 rpm | 0.05 N·m | {cells} |" in readme.loadsteps()


def test_every_motor_has_its_line_of_load_steps_and_low_speeds(result, tmp_path):
    (tmp_path / "tuning/motors").mkdir(parents=True)
    lowest = [{"lowest_rpm": 120.4}, {"lowest_rpm": None}]
    for motor, end in (("own", ""), ("other", "-other")):
        (tmp_path / f"tuning/motors/{motor}.toml").touch()
        left(tmp_path, f"loadsteps{end}", motor, [STEP, STEP | {"kphi": 0.8, "dip_percent": 90.0, "off_back_s": 0.2, "ok": not end}])
        left(tmp_path, f"lowspeed{end}", motor, [{"asked_rpm": 151.2}], lowest=lowest)
    lines = readme.stiffness().splitlines()
    assert lines[2:] == ["| other | 1 of 2 | 48 % | 0.200 s | 1 of 1 | 151 | 120 / - |", "| own | 2 of 2 | 48 % | 0.200 s | 1 of 1 | 151 | 120 / - |"]


def test_every_motor_has_its_line_of_flying_starts_and_stops(result, tmp_path):
    (tmp_path / "tuning/motors").mkdir(parents=True)
    (tmp_path / "tuning/motors/own.toml").touch()
    start = {"rpm": -2000.0, "rotor_deg": 10.0, "verdict": "ok", "control_s": 0.03, "current_max_a": 2.5, "bus_max_v": 33.0, "stop_s": None}
    stop = {"rpm": 5500.0, "rotor_deg": None, "verdict": "ok", "control_s": None, "current_max_a": 2.8, "bus_max_v": 28.6, "stop_s": 1.39}
    left(tmp_path, "catch", "own", [start, start | {"rpm": 3400.0, "control_s": 0.061, "verdict": "angle"}, stop, stop | {"stop_s": None}])
    assert readme.catches().splitlines()[2:] == ["| own | -2000 .. 3400 | 1 of 2 | 0.061 s | 2.80 A | 5500 rpm | 1.39 / never s | 28.6 V |"]


@pytest.fixture
def long_draws(result, tmp_path):
    """What a campaign and a soak leave, with numbers changed."""
    def write(cases: int = 1990, hours: float = 24.2) -> None:
        for folder, data in (("campaign", {"classes": {"no effect": cases, "ridden through": 10, "wrong and silent": 0}}),
                             ("soak", {"motor_hours": hours, "wrong": 0})):
            (tmp_path / "build" / folder / "seed-1").mkdir(parents=True)
            (tmp_path / "build" / folder / "seed-1/summary.json").write_text(json.dumps(data))
    return write


def test_the_long_draws_are_told_with_their_shares(long_draws):
    long_draws()
    assert [cells[1] for cells in readme.drawn()] == ["1990 no effect; 10 ridden through", "0 wrong in 24.2 h"]


@pytest.mark.parametrize("less", [{"cases": 1989}, {"hours": 23.9}])
def test_less_than_the_readme_promises_is_refused(long_draws, less):
    long_draws(**less)
    with pytest.raises(SystemExit, match=r"less than the README promises: run `make campaign` and `make soak`"):
        readme.drawn()


def test_a_long_draw_that_was_not_made_is_one_line_with_its_command(result):
    with pytest.raises(SystemExit, match=r"^foc33: no results, build/campaign/seed-1/summary.json: run `make campaign`"):
        readme.drawn()
