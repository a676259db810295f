"""40 kHz: the tuner's header for the board with a period of 25 us, the demo with it, and what is refused."""

import numpy as np
import pytest
from pytest import approx
from support import command

from tools.bench import build, cli, command_common, report, scenario_file, simulate, table2
from tools.common import board_file, motor_file, paths
from tools.common.param_rows import duties_are_late, slow_periods
from tuning import design, header, loops

HURST, SLOW, QUICK = "hurst_dmb0224c10002", "mclv", "mclv_40khz"


@pytest.fixture(scope="module")
def designs() -> dict[str, design.Design]:
    return {board: design.design(motor_file.load(HURST), board_file.load(board)) for board in (SLOW, QUICK)}


@pytest.fixture(scope="module")
def folder(designs, tmp_path_factory):
    made = tmp_path_factory.mktemp("header40")
    (made / build.HEADER).write_text(header.write(designs[QUICK]), encoding="utf-8")
    return made


def test_the_board_is_the_same_but_for_its_period():
    slow, quick = board_file.load(SLOW), board_file.load(QUICK)
    assert quick.pwm_period_s == approx(25e-6)
    assert (quick.dead_time_s, quick.sample_window_s, quick.current_full_scale_a) == (slow.dead_time_s, slow.sample_window_s, slow.current_full_scale_a)


def test_duties_are_late_below_40_us_and_a_slow_step_lasts_400_us_at_20_and_40_khz():
    assert [duties_are_late(us * 1e-6) for us in (25, 39.95, 40, 50)] == [True, True, False, False]
    assert slow_periods(25e-6) * 25e-6 == approx(slow_periods(50e-6) * 50e-6) == approx(400e-6)


def test_late_duties_delay_the_current_loop_by_one_more_period():
    plant = loops.Plant(2.67, 1.92e-3, 1.92e-3, 7.98e-3, 5, 5.5e-6)
    hz, late, ts = np.array([50.0, 500.0, 2000.0]), loops.Gains(12.0, 12.0, 0.4, 0.0, 0.0, 0.03, 39.95e-6), 40e-6
    early = loops.Gains(12.0, 12.0, 0.4, 0.0, 0.0, 0.03, ts)
    ratio = loops.current_loop(hz, plant, late, 0.0) / loops.current_loop(hz, plant, early, 0.0)
    assert ratio == approx(np.exp(-2j * np.pi * hz * ts), rel=0.01)


def test_the_current_loop_is_quicker_than_at_20_khz_and_ends_where_the_delay_takes_its_phase_margin(designs):
    slow, quick = (designs[board].current_loop for board in (SLOW, QUICK))
    assert quick.bandwidth_hz > 1.2 * slow.bandwidth_hz
    assert loops.PHASE_MARGIN_DEG <= quick.worst.phase_deg < loops.PHASE_MARGIN_DEG + 2.0
    assert quick.bandwidth_hz < 0.9 * loops.CURRENT_CAP / 25e-6, "the delay is the limit, not the converter's step"


def test_the_demo_holds(folder):
    scenario = scenario_file.load("demo_40khz")
    assert scenario.board == QUICK
    library = command_common.library_for(scenario.defines, None, folder)
    assert library.params["LOOPTIME_SEC"] == approx(25e-6)
    run = simulate.simulate(simulate.prepare(scenario, library, motor_file.part(HURST), board_file.part(QUICK)), lambda seconds: None)
    assert [f"{outcome.row}: {outcome.got}, allowed {outcome.allowed}" for outcome in report.check(run) if not outcome.ok] == []


def test_a_header_of_another_period_than_the_boards_is_refused_in_one_line(folder, tmp_path):
    code, _, told = command("run", "demo", "--board", QUICK, "--out", str(tmp_path), main=cli.main)
    assert code == 2 and told.count("\n") <= 1
    assert "the header's LOOPTIME_SEC is 50 us, the board's period 25 us, tuning/boards/mclv_40khz.toml: add MOTOR=name" in told


def test_rows_of_table_2_hold(folder):
    """The slowest one under the largest load, where field weakening begins, and one in it."""
    table = table2.Table.read(paths.TABLES / "table2.toml")
    library = command_common.library_for([], None, folder)
    quick, slow = (table2.Table2(table, motor_file.part(HURST), board_file.part(QUICK), found) for found in (library, command_common.library_for([], None)))
    rows = [row for row in quick.cases() if row.reference_rpm in (500.0, 3000.0, 3500.0)]
    assert [row.more_percent for row in rows] == [5.0, 5.0, 5.0] and not any(row.more_percent for row in slow.cases())
    outcomes = [outcome for row, result in zip(rows, quick.run(rows, "table2")) for outcome in quick.check(row, result)]
    assert [f"{outcome.row}: {outcome.got}" for outcome in outcomes if not outcome.ok] == []
