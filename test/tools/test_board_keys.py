"""The plant: motor and board files, overrides, and the check against the virtual board's keys."""

import pytest
from support import LIBRARY, refusal

from tools.bench.board import Library
from tools.common import motor_file
from tools.common.board_keys import Key, Values, resolve

KEYS = {"motor.rs_ohm": Key("motor.rs_ohm", "ohm", "", 0.001, 100.0, True, True),
        "load.constant_nm": Key("load.constant_nm", "N.m", "", 0.0, 10.0, True, True),
        "plant.speed_rpm": Key("plant.speed_rpm", "rpm", "", 0.0, 0.0, True, False)}


def resolved(*pairs) -> dict:
    """What the layers, each of one key and its value, come to."""
    return resolve([Values({key: value}, {key: "file.toml line 7"}) for key, value in pairs], KEYS)


@pytest.mark.parametrize("layers, values", [
    ([("motor.rs_ohm", 2.0), ("motor.rs_ohm", 3.0)], {"motor.rs_ohm": 3.0}), ([("reg.P1TPER", 999)], {"reg.P1TPER": 999}),
    ([("motor.rs_ohm", 2.0), ("motor.rs_ohm", ("factor", 1.5))], {"motor.rs_ohm": 3.0})])
def test_later_layers_replace_or_scale_earlier_ones(layers, values):
    assert resolved(*layers) == values


@pytest.mark.parametrize("layers, part", [
    ([("motor.rs_ohm", ("factor", 1.5))], "'motor.rs_ohm' has no value to scale"),
    ([("motor.rs_ohm", 2.0), ("motor.rs_ohm", ("factor", 100.0))],
     "'motor.rs_ohm' = 200 is impossible, file.toml line 7: choose 0.001 .. 100 ohm"),
    ([("motor.r_ohm", 1.0)], "unknown key 'motor.r_ohm', file.toml line 7: did you mean 'motor.rs_ohm'"),
    ([("motor.r_ohm", ("factor", 2.0))], "unknown key 'motor.r_ohm', file.toml line 7: did you mean 'motor.rs_ohm'"),
    ([("plant.speed_rpm", 1.0)], "'plant.speed_rpm' can only be read"), ([("reg.P1TPER", 70000)], "'reg.P1TPER' = 70000 is impossible")])
def test_what_the_board_would_refuse_is_named_with_its_line(layers, part):
    refusal(lambda: resolved(*layers), part, "file.toml line 7")


def test_a_motor_file_knows_the_ranges_of_the_motor_s_keys_before_anything_is_built():
    keys = {name: (key.unit, key.minimum, key.maximum) for name, key in Library(LIBRARY).keys.items()
            if key.writable and name.startswith(motor_file.PLANT_TABLES)}
    assert motor_file.plant_ranges() == keys and "mech.stiction_nm" in keys
