"""The plant: motor and board files, overrides, and the check against the virtual board's keys."""

import tempfile
import unittest
from pathlib import Path

from support import LIBRARY, document

from tools.common import board_file, motor_file, paths
from tools.bench.board import Library
from tools.common.errors import UserError
from tools.common.board_keys import Key, Values, resolve

KEYS = {"motor.rs_ohm": Key("motor.rs_ohm", "ohm", "", 0.001, 100.0, True, True),
        "load.constant_nm": Key("load.constant_nm", "N.m", "", 0.0, 10.0, True, True),
        "plant.speed_rpm": Key("plant.speed_rpm", "rpm", "", 0.0, 0.0, True, False)}


def layer(**values) -> Values:
    names = {name.replace("__", "."): value for name, value in values.items()}
    return Values(names, {name: "file.toml line 7" for name in names})


class Overrides(unittest.TestCase):
    def test_later_layers_replace_earlier_ones(self):
        self.assertEqual(resolve([layer(motor__rs_ohm=2.0), layer(motor__rs_ohm=3.0)], KEYS), {"motor.rs_ohm": 3.0})

    def test_a_factor_scales_what_is_there(self):
        self.assertEqual(resolve([layer(motor__rs_ohm=2.0), layer(motor__rs_ohm=("factor", 1.5))], KEYS), {"motor.rs_ohm": 3.0})

    def test_a_factor_of_nothing_is_refused(self):
        with self.assertRaisesRegex(UserError, "'motor.rs_ohm' has no value to scale"):
            resolve([layer(motor__rs_ohm=("factor", 1.5))], KEYS)

    def test_a_scaled_value_must_be_possible_too(self):
        with self.assertRaisesRegex(UserError, "'motor.rs_ohm' = 200 is impossible, file.toml line 7: choose 0.001 .. 100 ohm"):
            resolve([layer(motor__rs_ohm=2.0), layer(motor__rs_ohm=("factor", 100.0))], KEYS)

    def test_an_unknown_key_gets_the_nearest_one(self):
        for value in (1.0, ("factor", 2.0)):
            with self.subTest(value), self.assertRaisesRegex(UserError, "unknown key 'motor.r_ohm', .*did you mean 'motor.rs_ohm'"):
                resolve([layer(motor__r_ohm=value)], KEYS)

    def test_what_can_only_be_read_cannot_be_set(self):
        with self.assertRaisesRegex(UserError, "'plant.speed_rpm' can only be read"):
            resolve([layer(plant__speed_rpm=1.0)], KEYS)

    def test_registers_can_be_set_within_16_bits(self):
        self.assertEqual(resolve([layer(reg__P1TPER=999)], KEYS), {"reg.P1TPER": 999})
        with self.assertRaisesRegex(UserError, "'reg.P1TPER' = 70000 is impossible"):
            resolve([layer(reg__P1TPER=70000)], KEYS)


class Files(unittest.TestCase):
    def test_a_motor_becomes_keys_of_the_virtual_board(self):
        part = motor_file.part("hurst_dmb0224c10002")
        self.assertEqual((part.title, part.path.name), ("Hurst DMB0224C10002", "hurst_dmb0224c10002.toml"))
        self.assertEqual((part.values.values["motor.rs_ohm"], part.values.values["motor.pole_pairs"]), (2.67, 5.0))
        self.assertRegex(part.values.where["motor.rs_ohm"], "hurst_dmb0224c10002.toml line [0-9]+")

    def test_an_unknown_motor_or_board_gets_the_nearest_name(self):
        with self.assertRaisesRegex(UserError, "no motor 'hurst_dmb', scenario.toml line 3: did you mean 'hurst_dmb0224c10002'"):
            motor_file.part("hurst_dmb", "scenario.toml line 3")
        with self.assertRaisesRegex(UserError, "no board 'mclv2', .*did you mean 'mclv'"):
            board_file.part("mclv2")

    def test_a_plant_key_that_the_board_refuses_names_its_line(self):
        text = (paths.MOTORS / "hurst_dmb0224c10002.toml").read_text(encoding="utf-8") + "[plant]\n\"motor.sat_lq_ratio\" = 7\n"
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "motor.toml"
            path.write_text(text, encoding="utf-8")
            with self.assertRaisesRegex(UserError, f"'motor.sat_lq_ratio' = 7 is impossible, .*motor.toml line {text.count(chr(10))}: choose 0 .. 0.95$"):
                motor_file.part(str(path))

    def test_a_motor_file_knows_the_ranges_of_the_motor_s_keys_before_anything_is_built(self):
        keys = {name: (key.unit, key.minimum, key.maximum) for name, key in Library(LIBRARY).keys.items()
                if key.writable and name.startswith(motor_file.PLANT_TABLES)}
        self.assertEqual(motor_file.plant_ranges(), keys)
        self.assertIn("mech.stiction_nm", keys)

    def test_plant_sections_remember_their_lines(self):
        values = Values.from_section(document("[plant]\n\n\"motor.rs_ohm\" = 2\n").root.section("plant"))
        self.assertIn("line 3", values.where["motor.rs_ohm"])
