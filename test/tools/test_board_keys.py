"""The plant: motor and board files, overrides, and the check against the virtual board's keys."""

import re

import pytest
from support import LIBRARY, document, refusal

from tools.bench.board import Library
from tools.common import board_file, motor_file, paths
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


def test_a_motor_becomes_keys_of_the_virtual_board():
    part = motor_file.part("hurst_dmb0224c10002")
    assert (part.title, part.path.name) == ("Hurst DMB0224C10002", "hurst_dmb0224c10002.toml")
    assert (part.values.values["motor.rs_ohm"], part.values.values["motor.pole_pairs"]) == (2.67, 5.0)
    assert re.search("hurst_dmb0224c10002.toml line [0-9]+", part.values.where["motor.rs_ohm"])


def test_an_unknown_board_gets_the_nearest_name():
    refusal(lambda: board_file.part("mclv2"), "no board 'mclv2', ", "did you mean 'mclv'")


def test_a_plant_key_that_the_board_refuses_names_its_line(tmp_path):
    text = (paths.MOTORS / "hurst_dmb0224c10002.toml").read_text(encoding="utf-8") + "[plant]\n\"motor.sat_lq_ratio\" = 7\n"
    (tmp_path / "motor.toml").write_text(text, encoding="utf-8")
    line = refusal(lambda: motor_file.part(str(tmp_path / "motor.toml")), "'motor.sat_lq_ratio' = 7 is impossible, ")
    assert line.endswith(f"motor.toml line {text.count(chr(10))}: choose 0 .. 0.95")


def test_a_motor_file_knows_the_ranges_of_the_motor_s_keys_before_anything_is_built():
    keys = {name: (key.unit, key.minimum, key.maximum) for name, key in Library(LIBRARY).keys.items()
            if key.writable and name.startswith(motor_file.PLANT_TABLES)}
    assert motor_file.plant_ranges() == keys and "mech.stiction_nm" in keys


def test_plant_sections_remember_their_lines():
    values = Values.from_section(document("[plant]\n\n\"motor.rs_ohm\" = 2\n").root.section("plant"))
    assert "line 3" in values.where["motor.rs_ohm"]
