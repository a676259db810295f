"""The plant: motor and board files, overrides, and the check against the virtual board's keys."""

from types import SimpleNamespace

import pytest
from support import LIBRARY, refusal

from tools.bench import command_common
from tools.bench.board import Library
from tools.common import motor_file, paths
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


# ---- which board -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("chosen, asked_for, motors, scenarios, expected", [
    ("chosen", True, "motors", "scenarios", "chosen"), (None, True, "motors", "scenarios", "motors"), (None, True, "", "scenarios", "scenarios"),
    (None, False, "motors", "scenarios", "scenarios"), (None, False, "motors", "", "motors"), (None, False, "", "", "mclv")])
def test_the_board_is_the_chosen_one_then_that_of_a_motor_that_was_asked_for_then_the_scenarios_then_its_motors(
        tmp_path, monkeypatch, chosen, asked_for, motors, scenarios, expected):
    text = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")
    for name in ("chosen", "motors", "scenarios", "mclv"):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    motor = (paths.MOTORS / "hurst_dmb0224c10002.toml").read_text(encoding="utf-8")
    (tmp_path / "a_motor.toml").write_text((f'board = "{motors}"\n' if motors else "") + motor, encoding="utf-8")
    for folder in ("BOARDS", "MOTORS"):
        monkeypatch.setattr(paths, folder, tmp_path)
    item = SimpleNamespace(motor="a_motor", motor_where="", board=scenarios, board_where="")
    options = SimpleNamespace(motor="a_motor" if asked_for else None, board=chosen)
    assert command_common.parts_of(item, options)[1].path.stem == expected
