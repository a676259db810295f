"""Every scenario of tools/bench/scenarios holds on the virtual board with the project's own header, in the build that it asks for."""

import pytest

from tools.bench import command_common, report, scenario_file, simulate
from tools.common import board_file, motor_file, paths

HURST = "hurst_dmb0224c10002"


@pytest.mark.parametrize("name", paths.names(paths.SCENARIOS))
def test_scenario_holds(name):
    scenario = scenario_file.load(name)
    library = command_common.library_for(scenario.defines, None)
    run = simulate.simulate(simulate.prepare(scenario, library, motor_file.part(scenario.motor or HURST), board_file.part(scenario.board or "mclv")),
                            lambda seconds: None)
    outcomes = report.check(run)
    assert outcomes and [f"{outcome.row}: {outcome.got}, allowed {outcome.allowed}" for outcome in outcomes if not outcome.ok] == []
