"""Two motors, for a release every one, at the lowest speed that `make lowspeed` asks of them, with all loads: ten seconds, with every probe of the rotor that falls into them."""

import argparse
import itertools

import pytest
from support import MOTORS

from tools.bench import build, command_common, lowspeed
from tools.common import board_file, motor_file, paths
from tuning import design, header

EACH_PUSH = ("hurst_dmb0224c10002", "ipm_4pp_24v_2000")


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.release] * (name not in EACH_PUSH)) for name in MOTORS])
def test_the_lowest_speed_is_held_with_every_load(name, tmp_path):
    values = motor_file.load(name)
    (tmp_path / build.HEADER).write_text(header.write(design.design(values, board_file.load("mclv"))), encoding="utf-8")
    table = lowspeed.Table.read(paths.TABLES / "lowspeed.toml")
    options = argparse.Namespace(motor=name, board="mclv", userparams=str(tmp_path), library=None)
    motor, board, library, _ = command_common.set_up(table, options, ["PARAMS_IN_RAM"])
    table = table.for_motor(values, library.params)
    rows = lowspeed.LowSpeed(table, motor, board, library).run(list(itertools.product([min(table.speeds_rpm)], table.torques_nm)), name)
    assert {row["name"]: row["verdict"] for row in rows} == dict.fromkeys([row["name"] for row in rows], "ok") and len(rows) == 3
