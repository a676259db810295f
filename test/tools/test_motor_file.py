"""Motor and board files: a good one becomes SI values, each mistake one line with file, line, what and what to do."""

import math
import tempfile
import unittest
from pathlib import Path

from support import LIBRARY, command

from tools.common import board_file, motor_file, param_rows, paths
from tools.bench.board import Library
from tools.common.errors import UserError
from tools.common.board_keys import resolve

MOTOR = """title = "a motor"
connection = "Y"

[electrical]
pole_pairs = { value = 4, source = "s" }
resistance = { value = 1.8, unit = "ohm line-to-line", source = "s" }
inductance = { value = 2.6, unit = "mH line-to-line", source = "s" }
kphi = { value = 4.0, unit = "V peak line-to-line/krpm", source = "s" }

[mechanical]
inertia = { value = 24, unit = "g cm2", source = "s" }

[rating]
voltage = { value = 24, unit = "V", source = "s" }
current = { value = 1.9, unit = "A peak", source = "s" }
torque = { value = 0.0625, unit = "N m", source = "s" }
speed = { value = 4000, unit = "rpm", source = "s" }
maximum_speed = { value = 6000, unit = "rpm", source = "s" }
"""

R, KPHI = "resistance = { value = 1.8", "kphi = { value = 4.0"
UNITS = {"R": "\"ohm line-to-line\"", "L": "\"mH line-to-line\"", "KPHI": "\"V peak line-to-line/krpm\"", "J": "\"g cm2\""}

# Mistake: what to replace by what in the good file (or to append to it), and what the line must say.
BAD = {
    # the text as such
    "TOML syntax": ("[mechanical]", "[mechanical", "TOML syntax", "line 10"),
    "a key twice": ("\n[mechanical]", "resistance = 1\n[mechanical]", "TOML syntax", "line 9"),
    # tables and keys
    "no title": ("title = \"a motor\"", "", "'title' is missing"),
    "title is a number": ("title = \"a motor\"", "title = 3", "'title' is not a text", "line 1"),
    "no connection": ("connection = \"Y\"", "", "'connection' is missing"),
    "connection unknown": ("\"Y\"", "\"star\"", "'star' is no connection", "line 2", "use one of Y, delta"),
    "connection is no text": ("\"Y\"", "[1]", "is no connection", "line 2"),
    "table missing": ("[mechanical]\ninertia = { value = 24, unit = \"g cm2\", source = \"s\" }", "", "the table [mechanical] is missing"),
    "table misspelt": ("[mechanical]", "[mechanic]", "unknown key 'mechanic'", "line 10", "did you mean 'mechanical'?"),
    "table is a number": ("\n[electrical]", "rating = 3\n[electrical]", "TOML syntax"),
    "table is a list": ("[mechanical]", "[[mechanical]]", "'mechanical' is not a table", "line 10", "write [mechanical]"),
    "key missing": (R, "", "TOML syntax"),
    "no resistance": ("resistance = { value = 1.8, unit = \"ohm line-to-line\", source = \"s\" }", "", "'resistance' is missing", "line 4",
                      "write resistance = { value = ..., unit = \"ohm line-to-line\", source = \"...\" }"),
    "no maximum speed": ("maximum_speed = { value = 6000, unit = \"rpm\", source = \"s\" }", "", "'maximum_speed' is missing", "line 13"),
    "key misspelt": ("inertia =", "intertia =", "unknown key 'intertia'", "line 11", "did you mean 'inertia'?"),
    "part misspelt": (R, "resistance = { valu = 1.8", "unknown key 'valu'", "line 6", "did you mean 'value'?"),
    "bare number": ("inertia = { value = 24, unit = \"g cm2\", source = \"s\" }", "inertia = 24", "'inertia' has no unit and source", "line 11"),
    "bare count": ("pole_pairs = { value = 4, source = \"s\" }", "pole_pairs = 4", "'pole_pairs' has no source", "line 5"),
    "no value": ("{ value = 24, ", "{ ", "'inertia' has no value", "line 11"),
    "no unit": ("unit = \"g cm2\", ", "", "'inertia' has no unit", "line 11", "one of kg m2, g cm2"),
    "no source": ("\"g cm2\", source = \"s\"", "\"g cm2\"", "'inertia' has no source", "line 11"),
    "empty source": ("\"g cm2\", source = \"s\"", "\"g cm2\", source = \" \"", "'source' is not a text", "line 11"),
    "unit unknown": (UNITS["J"], "\"g mm2\"", "'g mm2' is no unit of inertia", "line 11", "use one of kg m2"),
    "unit of another quantity": (UNITS["L"], "\"ohm line-to-line\"", "is no unit of inductance", "line 7", "mH line-to-line"),
    "unit without reference": (UNITS["R"], "\"ohm\"", "'ohm' does not say which resistance", "line 6", "write ohm line-to-line or ohm phase or ohm winding"),
    "unit is a number": (UNITS["J"], "2", "'unit' is not a text", "line 11"),
    # values
    "text": ("value = 1.8", "value = \"1.8\"", "'resistance' is not a number", "line 6"),
    "truth": ("value = 1.8", "value = true", "'resistance' is not a number", "line 6"),
    "list": ("value = 1.8", "value = [1.8]", "'resistance' is not a number", "line 6"),
    "nan": ("value = 1.8", "value = nan", "'resistance' is not a number", "line 6"),
    "infinite": ("value = 1.8", "value = -inf", "'resistance' = -inf ohm line-to-line is impossible", "line 6", "choose 0.02 .. 80 ohm"),
    "beyond a double": ("value = 1.8", "value = 1" + "0" * 400, "'resistance' = inf ohm line-to-line is impossible", "line 6", "choose 0.02 .. 80 ohm"),
    "beyond reason": ("value = 1.8", "value = 1e30", "'resistance' = 1e+30 ohm line-to-line is impossible", "line 6", "choose 0.02 .. 80 ohm"),
    "beyond all": ("value = 1.8", "value = 1" + "0" * 5000, "a number too long"),
    "too deep": ("value = 1.8", "value = " + "[" * 5000, "tables too deep"),
    "negative resistance": ("value = 1.8", "value = -1.8", "'resistance' = -1.8 ohm line-to-line is impossible", "line 6", "choose 0.02 .. 80"),
    "zero inductance": ("value = 2.6", "value = 0", "'inductance' = 0 mH line-to-line is impossible", "line 7", "choose 0.02 .. 60 mH"),
    "megohms": ("value = 1.8", "value = 1.8e6", "'resistance' = 1.8e+06 ohm line-to-line is impossible", "line 6"),
    "a flywheel": ("value = 24, unit = \"g cm2\"", "value = 5.5, unit = \"kg m2\"", "'inertia' = 5.5 kg m2 is impossible", "line 11"),
    "no pole pairs": ("value = 4,", "value = 0,", "'pole_pairs' = 0 is impossible", "line 5", "choose 1 .. 50"),
    "half a pole pair": ("value = 4,", "value = 2.5,", "'pole_pairs' = 2.5 is not a whole number", "line 5"),
    "negative pole pairs": ("value = 4,", "value = -4,", "'pole_pairs' = -4 is impossible", "line 5"),
    "hot winding": ("\"ohm line-to-line\",", "\"ohm line-to-line\", at_degc = 400,", "'at_degc' of resistance = 400 is impossible", "line 6"),
    "temperature in words": ("\"ohm line-to-line\",", "\"ohm line-to-line\", at_degc = \"hot\",", "'at_degc' is not a number", "line 6"),
    "temperature of an inertia": ("\"g cm2\",", "\"g cm2\", at_degc = 25,", "unknown key 'at_degc'", "line 11"),
    "frequency": ("\"mH line-to-line\",", "\"mH line-to-line\", frequency_hz = 0,", "'frequency_hz' of inductance = 0 is impossible", "line 7"),
    "one and two inductances": ("[mechanical]", "inductance_d = { value = 2.6, unit = \"mH phase\", source = \"s\" }\n[mechanical]",
                                "'inductance' and 'inductance_d' together", "line 7"),
    "d without q": ("inductance =", "inductance_d =", "'inductance_q' is missing", "line 4"),
    # numbers that do not fit each other
    "uH for mH": (UNITS["L"], "\"uH line-to-line\"", "'inductance' = 2.6 uH line-to-line is impossible", "line 7"),
    "inductance and resistance": ("value = 2.6", "value = 0.02", "L/R = 0.0111 ms is implausible", "line 7"),
    "milliohms": ("value = 1.8", "value = 0.02", "L/R = 130 ms is implausible", "line 7"),
    "d and q": ("inductance = { value = 2.6, unit = \"mH line-to-line\", source = \"s\" }",
                "inductance_d = { value = 0.2, unit = \"mH phase\", source = \"s\" }\n"
                "inductance_q = { value = 2.0, unit = \"mH phase\", source = \"s\" }", "Lq/Ld = 10 is implausible", "line 8"),
    "rpm/V taken for V/krpm": ("value = 4.0", "value = 250", "'kphi' = 250 V peak line-to-line/krpm is impossible", "line 8"),
    "volts per 1000 rpm twice": ("value = 4.0", "value = 14.0", "back-EMF at rated speed, 56 V peak line to line, does not suit 24 V", "line 8"),
    "torque constant in mN m": (KPHI + ", unit = " + UNITS["KPHI"], "kphi = { value = 3.6, unit = \"mN m/A dc\"",
                                "back-EMF at rated speed", "line 8", "check the units of kphi, speed and voltage"),
    "torque in oz in": ("0.0625, unit = \"N m\"", "8.85, unit = \"N m\"", "rated torque is 8.85 N m, but kphi and rated current give 0.0629 N m",
                        "line 16", "probably a wrong unit"),
    "torque in mN m": ("0.0625, unit = \"N m\"", "0.625, unit = \"N cm\"", "rated torque is 0.00625 N m", "line 16"),
    "current of a tenth": ("value = 1.9", "value = 0.19", "rated torque is 0.0625 N m, but", "line 16"),
    "resistance too large for the current": ("value = 1.8", "value = 18", "the rated current needs 29.6 V for the resistance alone", "line 6"),
    "friction": ("[rating]", "coulomb_friction = { value = 100, unit = \"mN m\", source = \"s\" }\n[rating]",
                 "friction at rated speed, 0.1 N m, exceeds the rated torque", "line 13"),
    "viscous friction": ("[rating]", "viscous_friction = { value = 1e-3, unit = \"N m s\", source = \"s\" }\n[rating]",
                         "friction at rated speed, 0.419 N m, exceeds the rated torque", "line 13"),
    "negative friction": ("[rating]", "coulomb_friction = { value = -1, unit = \"mN m\", source = \"s\" }\n[rating]",
                          "'coulomb_friction' = -1 mN m is impossible", "line 13"),
    "inertia in g m2": (UNITS["J"], "\"g m2\"", "rated torque would bring the bare rotor to rated speed in 161 s", "line 11", "unit of inertia"),
    "inertia in mg cm2": ("value = 24,", "value = 0.24,", "to rated speed in 0.000161 s", "line 11"),
    "maximum below rated": ("value = 6000", "value = 3999", "maximum_speed = 3999 rpm is below the rated 4000 rpm", "line 18"),
    "magnets that grow stronger": ("[mechanical]", "kphi_tempco = { value = 0.1, unit = \"%/K\", source = \"s\" }\n[mechanical]",
                                   "'kphi_tempco' = 0.1 %/K is impossible", "line 10"),
    "maximum current": ("", "maximum_current = { value = 25, unit = \"A peak\", source = \"s\" }", "maximum_current = 25 A peak beside", "line 19"),
    # optional tables
    "start torque": ("", "[load]\nstart_torque = { value = 0.1, unit = \"N m\" }", "start_torque = 0.1 N m is more than maximum_current gives", "line 20"),
    "load key": ("", "[load]\ntorque = { value = 0.1, unit = \"N m\" }", "unknown key 'torque'", "line 20"),
    "spread of one": ("", "[spread]\nresistance = { values = [1], unit = \"ohm phase\", source = \"s\" }", "'resistance' has no pair of values", "line 20"),
    "spread of text": ("", "[spread]\nresistance = { values = [1, \"2\"], unit = \"ohm phase\", source = \"s\" }", "'resistance' is not a number", "line 20"),
    "spread below zero": ("", "[spread]\nresistance = { values = [-1, 2], unit = \"ohm phase\", source = \"s\" }", "'resistance' = -1 is impossible", "line 20"),
    "spread beside the value": ("", "[spread]\nresistance = { values = [1, 2], unit = \"ohm phase\", source = \"s\" }",
                                "'resistance' is outside its own [spread] 1 .. 2", "line 6"),
    "unknown choice": ("", "[tune]\nEND_SPED_RPM = 1000", "'END_SPED_RPM' is no parameter of userparams.h", "line 20", "did you mean 'END_SPEED_RPM'?"),
    "choice out of range": ("", "[tune]\nEND_SPEED_RPM = 1", "'END_SPEED_RPM' = 1 is impossible", "line 20", "choose 50 .. 5000"),
    "choice in words": ("", "[tune]\nEND_SPEED_RPM = \"slow\"", "'END_SPEED_RPM' is not a number", "line 20"),
    "choice that is a fact": ("", "[tune]\nMOTOR_RS_OHM = 1", "'MOTOR_RS_OHM' is no choice", "line 20", "[electrical] resistance"),
    "plant key that is derived": ("", "[plant]\n\"motor.rs_ohm\" = 1", "'motor.rs_ohm' stands in another table", "line 20"),
    "plant key of the board": ("", "[plant]\n\"supply.voltage_v\" = 1", "'supply.voltage_v' is no key of the motor", "line 20"),
    "plant key misspelt": ("", "[plant]\n\"motor.sat_lq_ration\" = 0.2", "unknown key 'motor.sat_lq_ration'", "line 20", "did you mean 'motor.sat_lq_ratio'?"),
    "plant key out of range": ("", "[plant]\n\"motor.temp_c\" = 300", "'motor.temp_c' = 300 is impossible", "line 20", "choose -60 .. 250 degC"),
    "plant key in words": ("", "[plant]\n\"mech.stiction_nm\" = \"x\"", "'mech.stiction_nm' is not a number", "line 20"),
    "plant key of a thousand dots": ("", "[plant]\n" + "a." * 3000 + "a = 1", "tables too deep"),
    "plant key far too long": ("", "[plant]\n\"mech.stiction_nm\" = 1" + "0" * 400, "'mech.stiction_nm' is out of range", "line 20"),
}


def changed(old: str, new: str, text: str = MOTOR) -> str:
    """The text with one place changed; with an empty `old`, `new` is appended."""
    if not old:
        return text + new + "\n"
    assert text.count(old) >= 1, old
    return text.replace(old, new, 1)


class FilesCase(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name) / "file.toml"

    def load(self, text: str | bytes) -> motor_file.Motor:
        self.path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return motor_file.load(str(self.path))

    def refused(self, call, *parts: str) -> None:
        with self.assertRaises(UserError) as caught:
            call()
        line = str(caught.exception)
        self.assertEqual(len(line.splitlines()), 1)
        for part in parts:
            self.assertIn(part, line)


class Motors(FilesCase):
    def test_values_are_those_of_a_star_phase_in_si(self):
        motor = self.load(MOTOR)
        self.assertEqual((motor.name, motor.title, motor.connection, motor.pole_pairs), ("file", "a motor", "Y", 4))
        for got, expected in ((motor.rs_ohm, 0.9), (motor.ld_h, 1.3e-3), (motor.lq_h, 1.3e-3), (motor.kphi_v_per_krpm, 4.0),
                              (motor.psi_vs, 5.513289e-3), (motor.kt_nm_per_a, 0.03307973), (motor.inertia_kgm2, 2.4e-6),
                              (motor.rated_voltage_v, 24.0), (motor.rated_current_a, 1.9), (motor.rated_torque_nm, 0.0625),
                              (motor.rated_speed_rpm, 4000.0), (motor.maximum_speed_rpm, 6000.0)):
            self.assertAlmostEqual(got / expected, 1.0, 6)
        self.assertFalse(motor.salient)

    def test_what_a_file_leaves_out_has_defaults(self):
        motor = self.load(MOTOR)
        self.assertEqual((motor.viscous_nms, motor.coulomb_nm, motor.load_inertia_kgm2, motor.inductance_frequency_hz), (0.0, 0.0, 0.0, None))
        self.assertAlmostEqual(motor.maximum_current_a, 2.85)
        self.assertAlmostEqual(motor.start_torque_nm, 0.015625)
        self.assertEqual((motor.resistance_tempco_per_k, motor.kphi_tempco_per_k), (0.0039, -0.002))
        self.assertEqual((motor.tune, motor.spread, motor.plant_extra.values), ({}, {}, {}))

    def test_optional_tables_are_read(self):
        motor = self.load(MOTOR + "maximum_current = { value = 2.0, unit = \"A rms\", source = \"s\" }\n"
                          "[load]\ninertia = { value = 10, unit = \"g cm2\" }\nstart_torque = { value = 30, unit = \"mN m\", source = \"fan\" }\n"
                          "[spread]\nresistance = { values = [2.0, 1.6], unit = \"ohm line-to-line\", source = \"s\" }\n"
                          "inductance = { values = [1.2, 1.4], unit = \"mH phase\", source = \"s\" }\n"
                          "kphi = { values = [270, 230], unit = \"rpm/V\", source = \"s\" }\n"
                          "[tune]\nEND_SPEED_RPM = 700\nIDREF_SPEED17 = -1.5\n[plant]\n\"motor.sat_lq_ratio\" = 0.2\nmech.stiction_nm = 0.01\n")
        self.assertAlmostEqual(motor.maximum_current_a, 2.828427, 5)
        self.assertAlmostEqual(motor.load_inertia_kgm2, 1e-6, 12)
        self.assertAlmostEqual(motor.start_torque_nm, 0.03, 12)
        self.assertEqual([round(value, 6) for value in motor.spread["rs_ohm"]], [0.8, 1.0])
        self.assertEqual([round(value, 6) for value in motor.spread["ls_h"]], [0.0012, 0.0014])
        self.assertEqual([round(value, 4) for value in motor.spread["kphi_v_per_krpm"]], [3.8785, 4.553])
        self.assertEqual(motor.tune, {"END_SPEED_RPM": 700.0, "IDREF_SPEED17": -1.5})
        self.assertEqual(motor.plant_extra.values, {"motor.sat_lq_ratio": 0.2, "mech.stiction_nm": 0.01})

    def test_temperatures_are_brought_to_25_degrees(self):
        motor = self.load(changed("\"ohm line-to-line\",", "\"ohm line-to-line\", at_degc = 125,",
                                  changed("krpm\",", "krpm\", at_degc = 75,")))
        self.assertAlmostEqual(motor.rs_ohm, 0.9 / 1.39, 9)
        self.assertAlmostEqual(motor.kphi_v_per_krpm, 4.0 / 0.9, 9)
        self.assertAlmostEqual(motor.psi_vs, 5.513289e-3 / 0.9, 8)

    def test_a_salient_motor_has_two_inductances(self):
        motor = self.load(changed("inductance = { value = 2.6, unit = \"mH line-to-line\", source = \"s\" }",
                                  "inductance_d = { value = 1.1, unit = \"mH phase\", frequency_hz = 120, source = \"s\" }\n"
                                  "inductance_q = { value = 1.4, unit = \"mH phase\", source = \"s\" }"))
        self.assertAlmostEqual(motor.ld_h, 1.1e-3)
        self.assertAlmostEqual(motor.lq_h, 1.4e-3)
        self.assertEqual(motor.inductance_frequency_hz, 120.0)
        self.assertTrue(motor.salient)
        self.assertTrue(motor.plant_values().where["motor.lq_h"].endswith("line 8"))

    def test_a_delta_motor_given_by_its_windings_is_the_star_motor_given_line_to_line(self):
        star = self.load(MOTOR)
        text = MOTOR.replace("\"Y\"", "\"delta\"").replace("1.8, unit = \"ohm line-to-line\"", "2.7, unit = \"ohm winding\"") \
            .replace("2.6, unit = \"mH line-to-line\"", "3.9, unit = \"mH winding\"")
        delta = self.load(text)
        self.assertAlmostEqual(delta.rs_ohm, star.rs_ohm, 12)
        self.assertAlmostEqual(delta.lq_h, star.lq_h, 12)

    def test_the_virtual_board_gets_its_keys_from_the_same_numbers(self):
        motor = self.load(MOTOR + "[load]\ninertia = { value = 10, unit = \"g cm2\" }\n[plant]\n\"mech.stiction_nm\" = 0.01\n")
        values = motor.plant_values()
        self.assertEqual(values.values["motor.psi_vs"], motor.psi_vs)
        self.assertAlmostEqual(values.values["mech.inertia_kgm2"], 3.4e-6, 12)
        self.assertEqual(values.values["mech.stiction_nm"], 0.01)
        for key, line in (("motor.rs_ohm", 6), ("motor.ld_h", 7), ("motor.lq_h", 7), ("motor.psi_vs", 8), ("mech.inertia_kgm2", 11),
                          ("mech.stiction_nm", 22)):
            self.assertTrue(values.where[key].endswith(f"line {line}"), (key, values.where[key]))
        self.assertEqual(set(values.where), set(values.values))

    def test_every_mistake_is_one_line_with_its_place_and_remedy(self):
        for name, (old, new, *parts) in BAD.items():
            with self.subTest(name):
                self.refused(lambda: self.load(changed(old, new)), "file.toml", *parts)

    def test_a_bad_motor_file_ends_a_run_with_its_line_and_exit_code_2(self):
        for name in ("no pole pairs", "negative resistance", "no source", "TOML syntax"):
            old, new, *parts = BAD[name]
            self.path.write_text(changed(old, new), encoding="utf-8")
            out = self.path.parent / "out"
            with self.subTest(name):
                code, printed, error = command("run", "smoke", "--motor", str(self.path), "--library", str(LIBRARY), "--out", str(out), "--quiet")
                self.assertEqual((code, printed, out.exists()), (2, "", False))
                self.assertRegex(error, r"\Afoc33: [^\n]+\n\Z")
                for part in parts:
                    self.assertIn(part, error)

    def test_files_that_are_no_text_are_refused(self):
        for name, data, part in (("not UTF-8", MOTOR.encode().replace(b"a motor", b"m\xfctor"), "it is not UTF-8 text"),
                                 ("empty", b"", "is missing"), ("NUL", b"\0" * 10, "TOML syntax"),
                                 ("huge", MOTOR.encode() + b"#" * 70000, "the file is too large")):
            with self.subTest(name):
                self.refused(lambda: self.load(data), "file.toml", part)

    def test_a_name_that_is_no_motor_gets_the_nearest_one(self):
        self.refused(lambda: motor_file.load("hurst_dmb0224", "--motor"), "no motor 'hurst_dmb0224'", "--motor",
                     "did you mean 'hurst_dmb0224c10002'?")
        self.refused(lambda: motor_file.load("no/such.toml"), "no motor file 'no/such.toml'")
        self.refused(lambda: motor_file.load(f"{self.path.parent}/"), "no motor file")

    def test_every_choice_that_is_refused_as_a_fact_is_a_parameter(self):
        self.assertLessEqual(set(motor_file.FACTS), set(param_rows.parameters()))
        row = param_rows.parameters()["LS_OVER2LS0_SPEED17"]
        self.assertEqual((row.unit, row.low, row.high, row.default, row.stem), ("1", "0.1", "0.6", "0.5", "LS_OVER2LS0_SPEED"))
        row = param_rows.parameters()["MOTOR_INERTIA_KGM2"]
        self.assertEqual((row.unit, row.low, row.high, row.default), ("kg m2", "1e-8", "0.1", "FROM_MOTOR"))


class Boards(FilesCase):
    def setUp(self) -> None:
        super().setUp()
        self.good = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")

    def board(self, old: str = "", new: str = "") -> board_file.BoardFile:
        self.path.write_text(changed(old, new, self.good), encoding="utf-8")
        return board_file.load(str(self.path))

    def test_ranges_follow_from_the_parts(self):
        board = self.board()
        self.assertAlmostEqual(board.current_full_scale_a, 4.4, 9)
        self.assertAlmostEqual(board.bus_full_scale_v, 52.8, 9)
        self.assertAlmostEqual(board.plant_values().values["shunt.gain_v_per_a"], 0.375, 9)
        self.assertEqual((board.current_gain, board.adc_bits, board.nominal_bus_v), (-0.5, 10, 24.0))
        self.assertEqual((board.pwm_period_s, board.dead_time_s, board.sample_window_s), (50e-6, 2e-6, 1.6e-6))
        self.assertEqual((board.over_voltage_v, board.regen_limit_v, board.under_voltage_v), (34.0, 27.0, 12.0))

    def test_an_amplifier_that_does_not_invert_has_a_positive_gain(self):
        self.assertEqual(self.board("inverted = true", "inverted = false").current_gain, 0.5)

    def test_plant_keys_reach_the_virtual_board_with_their_line(self):
        values = self.board("", "[plant]\n\"inverter.turn_on_s\" = 1e-7").plant_values()
        self.assertEqual(values.values["inverter.turn_on_s"], 1e-7)
        self.assertRegex(values.where["inverter.turn_on_s"], r"line \d+\Z")
        self.assertRegex(values.where["shunt.gain_v_per_a"], r"line \d+\Z")

    def test_every_mistake_is_one_line_with_its_place_and_remedy(self):
        for name, (old, new, *parts) in {
                "table missing": ("[bus]\ncapacitance", "[bux]\ncapacitance", "unknown key 'bux'", "did you mean 'bus'?"),
                "key missing": ("settle =", "setle =", "unknown key 'setle'", "did you mean 'settle'?"),
                "no unit": (", unit = \"mohm\"", "", "'rds_on' has no unit"),
                "flag": ("sinks = false", "sinks = 0", "'sinks' is neither true nor false"),
                "no flag": ("inverted = true", "", "'inverted' is missing"),
                "bits": ("bits = { value = 10", "bits = { value = 10.5", "'bits' = 10.5 is not a whole number"),
                "period": ("value = 50, unit = \"us\"", "value = 50, unit = \"ms\"", "'period' = 50 ms is impossible", "0.04 .. 0.14 ms"),
                "reference": ("value = 1.65", "value = 2.5", "reference = 2.5 V is not the middle of the converter's 3.3 V"),
                "limits in order": ("value = 34", "value = 26", "do not rise in this order", "12, 24, 27, 26 and 52.8 V"),
                "bus beyond the converter": ("bus_divider = { value = 16", "bus_divider = { value = 10", "do not rise in this order"),
                "derived key": ("", "[plant]\n\"shunt.gain_v_per_a\" = 1", "'shunt.gain_v_per_a' stands in another table"),
                "motor's key": ("", "[plant]\n\"motor.rs_ohm\" = 1", "'motor.rs_ohm' is no key of a board"),
                "huge number": ("value = 24.0", "value = 1" + "0" * 5000, "a number too long")}.items():
            with self.subTest(name):
                self.refused(lambda: self.board(old, new), "file.toml", *parts)


class Project(unittest.TestCase):
    def motors(self) -> list[motor_file.Motor]:
        return [motor_file.load(name) for name in paths.names(paths.MOTORS)]

    def test_there_are_at_least_six_motors_and_one_is_salient(self):
        self.assertGreaterEqual(len(self.motors()), 6)
        self.assertEqual([motor.name for motor in self.motors() if motor.salient], ["linix_45zwn24_40"])

    def test_the_note_s_motor_has_the_note_s_values(self):
        motor = motor_file.load("hurst_dmb0224c10002")
        self.assertAlmostEqual(motor.rs_ohm, 2.67, 12)
        self.assertAlmostEqual(motor.lq_h, 1.92e-3, 12)
        self.assertAlmostEqual(motor.psi_vs, 7.983e-3, 6)
        self.assertAlmostEqual(motor.kt_nm_per_a, 0.0599, 4)
        self.assertEqual((motor.pole_pairs, motor.kphi_v_per_krpm, motor.inertia_kgm2), (5, 7.24, 5.5e-6))
        self.assertEqual(set(motor.spread), {"rs_ohm", "ls_h", "kphi_v_per_krpm"})

    def test_every_motor_reaches_rated_speed_at_half_rated_torque_within_the_board_s_voltage_and_current(self):
        board = board_file.load("mclv")
        top = (1.0 - 2.0 * board.sample_window_s / board.pwm_period_s) * board.nominal_bus_v / math.sqrt(3.0)
        for motor in self.motors():
            with self.subTest(motor.name):
                omega = motor.rated_speed_rpm * motor.pole_pairs * 2.0 * math.pi / 60.0
                torque = motor.rated_torque_nm / 2.0 + motor.coulomb_nm + motor.viscous_nms * omega / motor.pole_pairs
                i_q = torque / motor.kt_nm_per_a
                needed = [math.hypot(motor.rs_ohm * i_d - omega * motor.lq_h * i_q, motor.rs_ohm * i_q + omega * (motor.psi_vs + motor.ld_h * i_d))
                          for i_d in (-0.01 * step for step in range(300)) if math.hypot(i_d, i_q) < min(3.4, motor.maximum_current_a)]
                self.assertLess(min(needed, default=math.inf), 0.98 * top)
                self.assertLessEqual(motor.rated_speed_rpm * motor.pole_pairs, 27000)
                self.assertLessEqual(motor.maximum_speed_rpm * motor.pole_pairs, 32000)

    def test_the_virtual_board_accepts_every_motor_and_board(self):
        keys = Library(LIBRARY).keys
        for part in [*self.motors(), *(board_file.load(name) for name in paths.names(paths.BOARDS))]:
            with self.subTest(part.name):
                self.assertLessEqual({"motor.psi_vs"} if isinstance(part, motor_file.Motor) else {"supply.voltage_v"},
                                     set(resolve([part.plant_values()], keys)))

    def test_the_listing_has_a_line_for_every_motor(self):
        lines = motor_file.listing(self.motors()).splitlines()
        for motor in self.motors():
            self.assertTrue(any(line.startswith(motor.name + " ") for line in lines), motor.name)
        hurst = next(line for line in lines if line.startswith("hurst_dmb0224c10002"))
        self.assertRegex(hurst, r" Y +5 +2\.670 +1\.920 +7\.240 +0\.0599 +24 V, 2800 rpm, 0\.08 N m, 1\.53 A +5500 rpm, 2\.75 A +\d+ of \d+\Z")
