"""Motor and board files: a good one becomes SI values, each mistake one line with file, line, what and what to do."""

import math
import re

import pytest
from support import BOARDS, LIBRARY, MOTORS, command, refusal, refused

from tools.bench.board import Library
from tools.common import board_file, motor_file, param_rows, paths
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
    # tables and keys
    "no title": ("title = \"a motor\"", "", "'title' is missing"),
    "no connection": ("connection = \"Y\"", "", "'connection' is missing"),
    "connection unknown": ("\"Y\"", "\"star\"", "'star' is no connection", "line 2", "use one of Y, delta"),
    "connection is no text": ("\"Y\"", "[1]", "is no connection", "line 2"),
    "table missing": ("[mechanical]\ninertia = { value = 24, unit = \"g cm2\", source = \"s\" }", "", "the table [mechanical] is missing"),
    "table misspelt": ("[mechanical]", "[mechanic]", "unknown key 'mechanic'", "line 10", "did you mean 'mechanical'?"),
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
    "infinite": ("value = 1.8", "value = -inf", "'resistance' = -inf ohm line-to-line is impossible", "line 6", "choose 0.02 .. 80 ohm"),
    "beyond a double": ("value = 1.8", "value = 1" + "0" * 400, "'resistance' = inf ohm line-to-line is impossible", "line 6", "choose 0.02 .. 80 ohm"),
    "negative resistance": ("value = 1.8", "value = -1.8", "'resistance' = -1.8 ohm line-to-line is impossible", "line 6", "choose 0.02 .. 80"),
    "zero inductance": ("value = 2.6", "value = 0", "'inductance' = 0 mH line-to-line is impossible", "line 7", "choose 0.02 .. 60 mH"),
    "megohms": ("value = 1.8", "value = 1.8e6", "'resistance' = 1.8e+06 ohm line-to-line is impossible", "line 6"),
    "no pole pairs": ("value = 4,", "value = 0,", "'pole_pairs' = 0 is impossible", "line 5", "choose 1 .. 50"),
    "half a pole pair": ("value = 4,", "value = 2.5,", "'pole_pairs' = 2.5 is not a whole number", "line 5"),
    "hot winding": ("\"ohm line-to-line\",", "\"ohm line-to-line\", at_degc = 400,", "'at_degc' of resistance = 400 is impossible", "line 6"),
    "temperature in words": ("\"ohm line-to-line\",", "\"ohm line-to-line\", at_degc = \"hot\",", "'at_degc' is not a number", "line 6"),
    "temperature of an inertia": ("\"g cm2\",", "\"g cm2\", at_degc = 25,", "unknown key 'at_degc'", "line 11"),
    "frequency": ("\"mH line-to-line\",", "\"mH line-to-line\", frequency_hz = 0,", "'frequency_hz' of inductance = 0 is impossible", "line 7"),
    "one and two inductances": ("[mechanical]", "inductance_d = { value = 2.6, unit = \"mH phase\", source = \"s\" }\n[mechanical]",
                                "'inductance' and 'inductance_d' together", "line 7"),
    "d without q": ("inductance =", "inductance_d =", "'inductance_q' is missing", "line 4"),
    # numbers that do not fit each other
    "inductance and resistance": ("value = 2.6", "value = 0.02", "L/R = 0.0111 ms is implausible", "line 7"),
    "milliohms": ("value = 1.8", "value = 0.02", "L/R = 130 ms is implausible", "line 7"),
    "d and q": ("inductance = { value = 2.6, unit = \"mH line-to-line\", source = \"s\" }",
                "inductance_d = { value = 0.2, unit = \"mH phase\", source = \"s\" }\n"
                "inductance_q = { value = 2.0, unit = \"mH phase\", source = \"s\" }", "Lq/Ld = 10 is implausible", "line 8"),
    "rpm/V taken for V/krpm": ("value = 4.0", "value = 2500", "'kphi' = 2500 V peak line-to-line/krpm is impossible", "line 8"),
    "volts per 1000 rpm twice": ("value = 4.0", "value = 14.0", "back-EMF at rated speed, 56 V peak line to line, does not suit 24 V", "line 8"),
    "torque constant in mN m": (KPHI + ", unit = " + UNITS["KPHI"], "kphi = { value = 3.6, unit = \"mN m/A dc\"",
                                "back-EMF at rated speed", "line 8", "check the units of kphi, speed and voltage"),
    "torque in oz in": ("0.0625, unit = \"N m\"", "8.85, unit = \"N m\"", "rated torque is 8.85 N m, but kphi and rated current give 0.0629 N m",
                        "line 16", "probably a wrong unit"),
    "torque in mN m": ("0.0625, unit = \"N m\"", "0.625, unit = \"N cm\"", "rated torque is 0.00625 N m", "line 16"),
    "resistance too large for the current": ("value = 1.8", "value = 18", "the rated current needs 29.6 V for the resistance alone", "line 6"),
    "friction": ("[rating]", "coulomb_friction = { value = 100, unit = \"mN m\", source = \"s\" }\n[rating]",
                 "friction at rated speed, 0.1 N m, exceeds the rated torque", "line 13"),
    "viscous friction": ("[rating]", "viscous_friction = { value = 1e-3, unit = \"N m s\", source = \"s\" }\n[rating]",
                         "friction at rated speed, 0.419 N m, exceeds the rated torque", "line 13"),
    "negative friction": ("[rating]", "coulomb_friction = { value = -1, unit = \"mN m\", source = \"s\" }\n[rating]",
                          "'coulomb_friction' = -1 mN m is impossible", "line 13"),
    "inertia in g m2": (UNITS["J"], "\"g m2\"", "rated torque would bring the bare rotor to rated speed in 161 s", "line 11",
                        "unit of inertia, and give what the motor drives as inertia of [load]"),
    "inertia in mg cm2": ("value = 24,", "value = 0.24,", "to rated speed in 0.000161 s", "line 11"),
    "maximum below rated": ("value = 6000", "value = 3999", "maximum_speed = 3999 rpm is below the rated 4000 rpm", "line 18"),
    "magnets that grow stronger": ("[mechanical]", "kphi_tempco = { value = 0.1, unit = \"%/K\", source = \"s\" }\n[mechanical]",
                                   "'kphi_tempco' = 0.1 %/K is impossible", "line 10"),
    "maximum current": ("", "maximum_current = { value = 25, unit = \"A peak\", source = \"s\" }", "maximum_current = 25 A peak beside", "line 19"),
    # optional tables
    "thermal time": ("", "thermal_time = { value = 20, unit = \"min\", source = \"s\" }", "'thermal_time' = 20 min is impossible", "line 19"),
    "start torque": ("", "[load]\nstart_torque = { value = 0.1, unit = \"N m\" }", "start_torque = 0.1 N m is more than maximum_current gives", "line 20"),
    "pulses in a turn": ("", "[load]\npulses_per_turn = { value = 1.5 }", "'pulses_per_turn' = 1.5 is not a whole number", "line 20"),
    "pulse in another table": ("", "[plant]\n\"load.pulse1_nm\" = 1", "'load.pulse1_nm' stands in another table", "line 20"),
    "load key": ("", "[load]\ntorque = { value = 0.1, unit = \"N m\" }", "unknown key 'torque'", "line 20"),
    "spread of one": ("", "[spread]\nresistance = { values = [1], unit = \"ohm phase\", source = \"s\" }", "'resistance' has no pair of values", "line 20"),
    "spread of text": ("", "[spread]\nresistance = { values = [1, \"2\"], unit = \"ohm phase\", source = \"s\" }", "'resistance' is not a number", "line 20"),
    "spread below zero": ("", "[spread]\nresistance = { values = [-1, 2], unit = \"ohm phase\", source = \"s\" }", "'resistance' = -1 is impossible", "line 20"),
    "spread beside the value": ("", "[spread]\nresistance = { values = [1, 2], unit = \"ohm phase\", source = \"s\" }",
                                "'resistance' is outside its own [spread] 1 .. 2", "line 6"),
    "unknown choice": ("", "[tune]\nEND_SPED_RPM = 1000", "'END_SPED_RPM' is no parameter of userparams.h", "line 20", "did you mean 'END_SPEED_RPM'?"),
    "choice out of range": ("", "[tune]\nEND_SPEED_RPM = 1", "'END_SPEED_RPM' = 1 is impossible", "line 20", "choose 2 .. 10000"),
    "choice in words": ("", "[tune]\nEND_SPEED_RPM = \"slow\"", "'END_SPEED_RPM' is not a number", "line 20"),
    "choice that is a fact": ("", "[tune]\nMOTOR_RS_OHM = 1", "'MOTOR_RS_OHM' is no choice", "line 20", "[electrical] resistance"),
    "plant key that is derived": ("", "[plant]\n\"motor.rs_ohm\" = 1", "'motor.rs_ohm' stands in another table", "line 20"),
    "plant key of the board": ("", "[plant]\n\"supply.voltage_v\" = 1", "'supply.voltage_v' is no key of the motor", "line 20"),
    "tune key in small letters": ("", "[tune]\nspeed_bandwidth_hz = 10", "'speed_bandwidth_hz' is no parameter", "did you mean 'SPEED_BANDWIDTH_HZ'?"),
    "tune key like no other": ("", "[tune]\nxyz = 10", "'xyz' is no parameter of userparams.h", "docs/parameters.md lists them"),
    "plant key misspelt": ("", "[plant]\n\"motor.sat_lq_ration\" = 0.2", "unknown key 'motor.sat_lq_ration'", "line 20", "did you mean 'motor.sat_lq_ratio'?"),
    "plant key out of range": ("", "[plant]\n\"motor.temp_c\" = 300", "'motor.temp_c' = 300 is impossible", "line 20", "choose -60 .. 250 degC"),
    "plant key in words": ("", "[plant]\n\"mech.stiction_nm\" = \"x\"", "'mech.stiction_nm' is not a number", "line 20"),
}


def changed(old: str, new: str, text: str = MOTOR) -> str:
    """The text with one place changed; with an empty `old`, `new` is appended."""
    if not old:
        return text + new + "\n"
    assert text.count(old) >= 1, old
    return text.replace(old, new, 1)


@pytest.fixture
def load(tmp_path):
    """Writes a file and loads it, a motor's or a board's."""
    def of(text: str | bytes, room=motor_file):
        (tmp_path / "file.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
        return room.load(str(tmp_path / "file.toml"))
    return of


def near(values: dict, places: float = 1e-9) -> dict:
    return {name: pytest.approx(value, rel=places) if isinstance(value, float) else value for name, value in values.items()}


def shows(item, values: dict, places: float = 1e-9) -> None:
    """The item's fields have these values."""
    assert {name: getattr(item, name) for name in values} == near(values, places)


# ---- motors --------------------------------------------------------------------------------------------------------------
def test_values_are_those_of_a_star_phase_in_si_and_what_a_file_leaves_out_has_defaults(load):
    motor = load(MOTOR)
    shows(motor, {"name": "file", "title": "a motor", "connection": "Y", "pole_pairs": 4, "rs_ohm": 0.9, "ld_h": 1.3e-3, "lq_h": 1.3e-3,
                  "kphi_v_per_krpm": 4.0, "psi_vs": 5.513289e-3, "kt_nm_per_a": 0.03307973, "inertia_kgm2": 2.4e-6, "rated_voltage_v": 24.0,
                  "rated_current_a": 1.9, "rated_torque_nm": 0.0625, "rated_speed_rpm": 4000.0, "maximum_speed_rpm": 6000.0,
                  "salient": False}, 1e-6)
    shows(motor, {"viscous_nms": 0.0, "coulomb_nm": 0.0, "load_inertia_kgm2": 0.0, "inductance_frequency_hz": None,
                  "maximum_current_a": 2.85, "thermal_time_s": 0.0,
                  "start_torque_nm": 0.015625, "resistance_tempco_per_k": 0.0039, "kphi_tempco_per_k": -0.002, "tune": {}, "spread": {}})
    assert motor.plant_extra.values == {}


def test_optional_tables_are_read(load):
    motor = load(MOTOR + "maximum_current = { value = 2.0, unit = \"A rms\", source = \"s\" }\n"
                 "thermal_time = { value = 0.5, unit = \"min\", source = \"s\" }\n"
                 "[load]\ninertia = { value = 10, unit = \"g cm2\" }\nstart_torque = { value = 30, unit = \"mN m\", source = \"fan\" }\n"
                 "[spread]\nresistance = { values = [2.0, 1.6], unit = \"ohm line-to-line\", source = \"s\" }\n"
                 "inductance = { values = [1.2, 1.4], unit = \"mH phase\", source = \"s\" }\n"
                 "kphi = { values = [270, 230], unit = \"rpm/V\", source = \"s\" }\n"
                 "[tune]\nEND_SPEED_RPM = 700\nIDREF_SPEED17 = -1.5\n[plant]\n\"motor.sat_lq_ratio\" = 0.2\nmech.stiction_nm = 0.01\n")
    shows(motor, {"maximum_current_a": 8.0 ** 0.5, "thermal_time_s": 30.0, "load_inertia_kgm2": 1e-6, "start_torque_nm": 0.03,
                  "tune": {"END_SPEED_RPM": 700.0, "IDREF_SPEED17": -1.5}})
    assert motor.spread == {"rs_ohm": pytest.approx((0.8, 1.0)), "ls_h": pytest.approx((0.0012, 0.0014)),
                            "kphi_v_per_krpm": pytest.approx((3.8785, 4.553), abs=5e-5)}
    assert "load.pulse1_nm" not in motor.plant_values().values
    assert motor.plant_extra.values == {"motor.sat_lq_ratio": 0.2, "mech.stiction_nm": 0.01}


def test_a_load_that_swings_with_the_angle_comes_to_the_virtual_board_and_more_of_it_by_the_board_s_keys(load):
    motor = load(MOTOR + "[load]\npulse_torque = { value = 5, unit = \"mN m\" }\npulses_per_turn = { value = 2 }\n"
                 "[plant]\n\"load.pulse2_nm\" = 0.001\n\"load.pulse1_deg\" = 90\n")
    values = motor.plant_values()
    assert {key: value for key, value in values.values.items() if key.startswith("load.")} \
        == {"load.pulse1_nm": 0.005, "load.pulse1_order": 2.0, "load.pulse2_nm": 0.001, "load.pulse1_deg": 90.0}
    assert values.where["load.pulse1_nm"].endswith("line 20") and values.where["load.pulse2_nm"].endswith("line 23")


def test_temperatures_are_brought_to_25_degrees(load):
    motor = load(changed("\"ohm line-to-line\",", "\"ohm line-to-line\", at_degc = 125,", changed("krpm\",", "krpm\", at_degc = 75,")))
    shows(motor, {"rs_ohm": 0.9 / 1.39, "kphi_v_per_krpm": 4.0 / 0.9, "psi_vs": 5.513289e-3 / 0.9}, 1e-6)


def test_a_salient_motor_has_two_inductances(load):
    motor = load(changed("inductance = { value = 2.6, unit = \"mH line-to-line\", source = \"s\" }",
                         "inductance_d = { value = 1.1, unit = \"mH phase\", frequency_hz = 120, source = \"s\" }\n"
                         "inductance_q = { value = 1.4, unit = \"mH phase\", source = \"s\" }"))
    shows(motor, {"ld_h": 1.1e-3, "lq_h": 1.4e-3, "inductance_frequency_hz": 120.0, "salient": True})
    assert motor.plant_values().where["motor.lq_h"].endswith("line 8")


def test_a_delta_motor_given_by_its_windings_is_the_star_motor_given_line_to_line(load):
    text = MOTOR.replace("\"Y\"", "\"delta\"").replace("1.8, unit = \"ohm line-to-line\"", "2.7, unit = \"ohm winding\"") \
        .replace("2.6, unit = \"mH line-to-line\"", "3.9, unit = \"mH winding\"")
    star = load(MOTOR)
    shows(load(text), {"rs_ohm": star.rs_ohm, "lq_h": star.lq_h}, 1e-12)


def test_a_motor_file_may_say_any_key_of_motor_mechanics_and_load(load):
    keys = {"load.viscous_nms": 1e-5, "load.quadratic_nms2": 1e-8, "load.constant_nm": 0.01, "load.active_nm": -0.01, "motor.temp_c": 60.0, "mech.stiction_nm": 0.01}
    values = load(MOTOR + "[plant]\n" + "".join(f'"{key}" = {value}\n' for key, value in keys.items())).plant_values().values
    assert {key: values[key] for key in keys} == keys


def test_the_virtual_board_gets_its_keys_from_the_same_numbers(load):
    motor = load(MOTOR + "[load]\ninertia = { value = 10, unit = \"g cm2\" }\n[plant]\n\"mech.stiction_nm\" = 0.01\n")
    values = motor.plant_values()
    expected = {"motor.psi_vs": motor.psi_vs, "mech.inertia_kgm2": 3.4e-6, "mech.stiction_nm": 0.01}
    assert {key: values.values[key] for key in expected} == near(expected)
    for key, line in (("motor.rs_ohm", 6), ("motor.ld_h", 7), ("motor.lq_h", 7), ("motor.psi_vs", 8), ("mech.inertia_kgm2", 11),
                      ("mech.stiction_nm", 22)):
        assert values.where[key].endswith(f"line {line}"), (key, values.where[key])
    assert set(values.where) == set(values.values)


@pytest.mark.parametrize("old, new, parts", [(old, new, parts) for old, new, *parts in BAD.values()], ids=BAD)
def test_every_mistake_is_one_line_with_its_place_and_remedy(load, old, new, parts):
    refusal(lambda: load(changed(old, new)), "file.toml", *parts)


@pytest.mark.parametrize("name", ["no pole pairs", "negative resistance", "no source", "TOML syntax"])
def test_a_bad_motor_file_ends_a_run_with_its_line_and_exit_code_2(tmp_path, name):
    old, new, *parts = BAD[name]
    (tmp_path / "file.toml").write_text(changed(old, new), encoding="utf-8")
    out = tmp_path / "out"
    refused(command("run", "smoke", "--motor", str(tmp_path / "file.toml"), "--library", str(LIBRARY), "--out", str(out), "--quiet"),
            *parts)
    assert not out.exists()


@pytest.mark.parametrize("data, part", [(MOTOR.encode().replace(b"a motor", b"m\xfctor"), "it is not UTF-8 text"), (b"", "is missing"),
                                        (b"\0" * 10, "TOML syntax"), (MOTOR.encode() + b"#" * 70000, "the file is too large")],
                         ids=["not UTF-8", "empty", "NUL", "huge"])
def test_files_that_are_no_text_are_refused(load, data, part):
    refusal(lambda: load(data), "file.toml", part)


@pytest.mark.parametrize("room, name, parts", [
    (motor_file, "hurst_dmb0224", ["no motor 'hurst_dmb0224'", "--motor", "did you mean 'hurst_dmb0224c10002'?"]),
    (motor_file, "no/such.toml", ["no motor file 'no/such.toml'"]), (motor_file, f"{paths.MOTORS}/", ["no motor file"]),
    (board_file, "mclw", ["no board 'mclw'", "--motor", "did you mean 'mclv'"])])
def test_a_name_that_is_no_motor_or_board_gets_the_nearest_one(tmp_path, monkeypatch, room, name, parts):
    for folder, only in (("MOTORS", "hurst_dmb0224c10002"), ("BOARDS", "mclv")):
        (tmp_path / f"{only}.toml").touch()
        monkeypatch.setattr(paths, folder, tmp_path)
    refusal(lambda: room.load(name, "--motor"), *parts)


def test_every_choice_that_is_refused_as_a_fact_is_a_parameter():
    rows = param_rows.parameters()
    assert set(motor_file.FACTS) <= set(rows)
    shows(rows["LS_OVER2LS0_SPEED17"], {"unit": "1", "low": "0.1", "high": "0.6", "default": "0.5", "stem": "LS_OVER2LS0_SPEED"})
    shows(rows["MOTOR_INERTIA_KGM2"], {"unit": "kg m2", "low": "1e-8", "high": "10", "default": "FROM_MOTOR"})


# ---- boards --------------------------------------------------------------------------------------------------------------
MCLV = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")


def test_ranges_follow_from_the_parts(load):
    board = load(MCLV, board_file)
    shows(board, {"current_full_scale_a": 4.4, "bus_full_scale_v": 52.8, "current_gain": -0.5, "adc_bits": 10, "nominal_bus_v": 24.0,
                  "pwm_period_s": 50e-6, "dead_time_s": 2e-6, "sample_window_s": 1.6e-6, "over_voltage_v": 34.0, "regen_limit_v": 27.0,
                  "under_voltage_v": 12.0})
    assert board.plant_values().values["shunt.gain_v_per_a"] == pytest.approx(0.375)


def test_an_amplifier_whose_output_rises_has_the_other_sign_in_header_and_plant(load):
    rising = load(changed("inverted = true", "inverted = false", MCLV), board_file)
    assert rising.current_gain == 0.5 and rising.current_full_scale_a == pytest.approx(4.4)
    assert rising.plant_values().values["shunt.gain_v_per_a"] == pytest.approx(-0.375)


def test_plant_keys_reach_the_virtual_board_with_their_line(load):
    values = load(MCLV + "[plant]\n\"inverter.turn_on_s\" = 1e-7", board_file).plant_values()
    assert values.values["inverter.turn_on_s"] == 1e-7
    assert all(re.search(r"line \d+\Z", values.where[key]) for key in ("inverter.turn_on_s", "shunt.gain_v_per_a"))


BAD_BOARDS = {
    "table missing": ("[bus]\ncapacitance", "[bux]\ncapacitance", "unknown key 'bux'", "did you mean 'bus'?"),
    "key missing": ("settle =", "setle =", "unknown key 'setle'", "did you mean 'settle'?"),
    "no unit": (", unit = \"mohm\"", "", "'rds_on' has no unit"),
    "flag": ("sinks = false", "sinks = 0", "'sinks' is neither true nor false"),
    "no flag": ("inverted = true", "", "'inverted' is missing"),
    "bits": ("bits = { value = 10", "bits = { value = 10.5", "'bits' = 10.5 is not a whole number"),
    "period": ("value = 50, unit = \"us\"", "value = 50, unit = \"ms\"", "'period' = 50 ms is impossible", "0.025 .. 0.14 ms"),
    "reference": ("value = 1.65", "value = 2.5", "reference = 2.5 V is not the middle of the converter's 3.3 V"),
    "limits in order": ("value = 34", "value = 26", "do not rise in this order", "12, 24, 27, 26 and 52.8 V"),
    "bus beyond the converter": ("bus_divider = { value = 16", "bus_divider = { value = 10", "do not rise in this order"),
    "slow amplifier": ("settle = { value = 1.0", "settle = { value = 2.0", "settle = 2 us is longer than the low sides conduct before the sample",
                       "sample_window + 1.5 us - dead_time = 1.1 us", "raise sample_window of [pwm] to 2.5 us"),
    "amplifier slower than any window": ("settle = { value = 1.0", "settle = { value = 4.0", "settle = 4 us is longer than the low sides conduct before the sample",
                                         "no sample_window up to 4 us is enough: a faster amplifier or a shorter dead_time"),
    "derived key": ("", "[plant]\n\"shunt.gain_v_per_a\" = 1", "'shunt.gain_v_per_a' stands in another table"),
    "motor's key": ("", "[plant]\n\"motor.rs_ohm\" = 1", "'motor.rs_ohm' is no key of a board"),
}


@pytest.mark.parametrize("old, new, parts", [(old, new, parts) for old, new, *parts in BAD_BOARDS.values()], ids=BAD_BOARDS)
def test_every_mistake_in_a_board_file_is_one_line_with_its_place_and_remedy(load, old, new, parts):
    refusal(lambda: load(changed(old, new, MCLV), board_file), "file.toml", *parts)


# ---- the project's files -------------------------------------------------------------------------------------------------
def test_the_motor_of_an1292_has_its_values():
    motor = motor_file.load("hurst_dmb0224c10002")
    shows(motor, {"rs_ohm": 2.67, "lq_h": 1.92e-3, "pole_pairs": 5, "kphi_v_per_krpm": 7.24, "inertia_kgm2": 5.5e-6}, 1e-12)
    assert (motor.psi_vs, motor.kt_nm_per_a) == (pytest.approx(7.983e-3, abs=5e-7), pytest.approx(0.0599, abs=5e-5))
    assert set(motor.spread) == {"rs_ohm", "ls_h", "kphi_v_per_krpm"}
    part = motor_file.part(motor.name)
    assert (part.title, part.path.name, part.values.values["motor.pole_pairs"]) == ("Hurst DMB0224C10002", f"{motor.name}.toml", 5.0)


@pytest.mark.parametrize("name", MOTORS)
def test_a_motor_reaches_rated_speed_at_half_rated_torque_within_the_board_s_voltage_and_current(name):
    motor, board = motor_file.load(name), board_file.load("mclv")
    top = (1.0 - 2.0 * board.sample_window_s / board.pwm_period_s) * board.nominal_bus_v / math.sqrt(3.0)
    omega = motor.rated_speed_rpm * motor.pole_pairs * 2.0 * math.pi / 60.0
    i_q = (motor.rated_torque_nm / 2.0 + motor.coulomb_nm + motor.viscous_nms * omega / motor.pole_pairs) / motor.kt_nm_per_a
    needed = [math.hypot(motor.rs_ohm * i_d - omega * motor.lq_h * i_q, motor.rs_ohm * i_q + omega * (motor.psi_vs + motor.ld_h * i_d))
              for i_d in (-0.01 * step for step in range(300)) if math.hypot(i_d, i_q) < min(3.4, motor.maximum_current_a)]
    assert min(needed, default=math.inf) < 0.98 * top
    assert motor.maximum_speed_rpm * motor.pole_pairs <= 75000


@pytest.mark.parametrize("room, name, key", [*((motor_file, name, "motor.psi_vs") for name in MOTORS),
                                             *((board_file, name, "supply.voltage_v") for name in BOARDS)])
def test_the_virtual_board_accepts_every_motor_and_board(room, name, key):
    assert key in resolve([room.load(name).plant_values()], Library(LIBRARY).keys)


def test_the_listing_has_a_line_for_each_motor_and_the_salient_one_has_two_inductances():
    lines = {line.split()[0]: line for line in motor_file.listing([motor_file.load(name) for name in MOTORS]).splitlines()}
    assert set(MOTORS) <= set(lines) and " 0.400/0.480 " in lines["linix_45zwn24_40"]
    assert re.search(r" Y +5 +2\.670 +1\.920 +7\.240 +0\.0599 +24 V, 2800 rpm, 0\.08 N m, 1\.53 A +5500 rpm, 2\.75 A +\d+ of \d+\Z",
                     lines["hurst_dmb0224c10002"])
