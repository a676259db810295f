"""Every scenario of tools/bench/scenarios holds on the virtual board with the project's own header, in the build that it asks for. One for a board of its
own has a header of its own: test_40_khz.py."""

import pytest

from tools.bench import command_common, report, scenario_file, simulate
from tools.common import board_file, motor_file, paths

HURST = "hurst_dmb0224c10002"
NAMES = [name for name in paths.names(paths.SCENARIOS) if scenario_file.load(name).board in ("", "mclv")]


@pytest.mark.parametrize("name", NAMES)
def test_scenario_holds(name):
    scenario = scenario_file.load(name)
    library = command_common.library_for(scenario.defines, None)
    run = simulate.simulate(simulate.prepare(scenario, library, motor_file.part(scenario.motor or HURST), board_file.part("mclv")),
                            lambda seconds: None)
    outcomes = report.check(run)
    assert outcomes and [f"{outcome.row}: {outcome.got}, allowed {outcome.allowed}" for outcome in outcomes if not outcome.ok] == []
