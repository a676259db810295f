"""make board: what a board measures, the file of an inverter of one's own, and every mistake in one line."""

import re

import pytest
from support import refused
from tune_support import HURST, command, motor_path

from tools.common import board_file, motor_file, paths
from tuning import board
from tuning.design import design

OWN = ("shunt=10mohm", "gain=20", "offset=1.65", "divider=30k/2k", "supply=36", "trip=12A", "inverted=no", "fault=RB9")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "my_inverter.toml"


def shown(*arguments: str) -> str:
    code, out, error = command("board", *arguments)
    assert (code, error) == (0, "")
    return out


@pytest.mark.parametrize("name, shunt", [("mclv", "0.005 ohm * 75 = 0.375 V/A"), ("mclv2", "0.025 ohm * 15 = 0.375 V/A")])
def test_both_boards_measure_the_same_with_other_shunts(name, shunt):
    out = shown(name)
    for words in (shunt, "full scale 4.4 A peak, one count of 10 bits 8.59 mA", "NORM_CURRENT_CONST 0.0001342773", "by the firmware up to 3.8 A, by the comparator at 7 A",
                  "MAXIMUM_CURRENT_A 0.28 .. 3.45 A", "full scale 52.8 V, one count 51.6 mV; the nominal 24 V are 45 % of it", "20 kHz, dead time 2 us"):
        assert words in out, words


def test_a_file_is_written_with_what_was_given_and_the_tuner_takes_it(path):
    out = shown(str(path), *OWN)
    for words in ("10 mohm * 20 = 0.2 V/A around 1.65 V, output rises", "full scale 8.25 A peak", "#define BOARD_PIN_FAULT B, 9",
                  "runs from 18 V, brakes up to 40.5 V, trips at 50.4 V"):
        assert words in out, words
    made = board_file.load(str(path))
    assert (made.title, made.current_gain, made.pins, made.nominal_bus_v) == ("my_inverter", 0.5, {"fault": "RB9"}, 36.0)
    assert (made.current_full_scale_a, made.bus_full_scale_v) == (pytest.approx(8.25), pytest.approx(52.8))
    assert made.quantities["shunt.resistance"].source == "given to make board: 10mohm"
    kept, usual = (item.quantities["pwm.period"] for item in (made, board_file.load("mclv")))
    assert (kept.given, kept.source) == (usual.given, usual.source)
    with motor_path() as motor:
        params = design(motor_file.load(str(motor)), made).params
    assert float(params["NORM_CURRENT_CONST"]) == pytest.approx(8.25 / 32768.0, rel=1e-5) and float(params["KCURRA"]) == 0.5
    assert out.endswith(shown(str(path)))


def test_what_the_calculator_says_of_the_currents_is_what_the_tuner_allows():
    most = float(re.search(r"MAXIMUM_CURRENT_A [\d.]+ \.\. ([\d.]+) A", shown("mclv"))[1])
    with motor_path(("value = 2.75", "value = 9")) as motor:
        params = design(motor_file.load(str(motor)), board_file.load("mclv")).params
    assert float(params["MAXIMUM_CURRENT_A"]) == most and board.LEAST_SHARE == float(
        re.search(r"PARAM_F\(MAXIMUM_CURRENT_A\) >= ([\d.]+)F", (paths.ROOT / "include/drive/param_limits.h").read_text(encoding="utf-8"))[1])


def test_a_motor_can_name_the_new_board_beside_it(path):
    shown(str(path), "supply=30")
    motor = path.with_name("my_motor.toml")
    motor.write_text('board = "./my_inverter.toml"\n' + (paths.MOTORS / f"{HURST}.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert board_file.load(*board_file.named(motor_file.load(str(motor)))).nominal_bus_v == 30.0


@pytest.mark.parametrize("words, unit, period_s", [
    (("pwm=16kHz",), "62.5 us", 62.5e-6), (("pwm=20", "kHz"), "50 us", 50e-6), (("pwm=20 kHz",), "50 us", 50e-6), (("PWM=16000hz",), "62.5 us", 62.5e-6),
    (("period=62.5us",), "62.5 us", 62.5e-6), (("pwm=15kHz",), "66.65 us", 66.65e-6)])
def test_a_pwm_may_be_given_as_frequency_or_period(path, words, unit, period_s):
    shown(str(path), *words)
    made = board_file.load(str(path))
    assert (made.quantities["pwm.period"].given, made.pwm_period_s) == (unit, pytest.approx(period_s, rel=1e-9))


def test_a_board_file_may_say_a_frequency(path):
    text = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")
    path.write_text(re.sub(r'(?m)^(period = \{) value = 50, unit = "us"', r'\1 value = 16, unit = "kHz"', text), encoding="utf-8")
    assert board_file.load(str(path)).pwm_period_s == 62.5e-6


def test_capitals_are_no_other_key(path):
    shown(str(path), "SUPPLY=36", "DeadTime=1.5US", "fault=RB9")
    made = board_file.load(str(path))
    assert (made.nominal_bus_v, made.dead_time_s, made.pins) == (36.0, 1.5e-6, {"fault": "RB9"})


def test_a_path_without_toml_is_written_with_it_and_found_by_either_name(tmp_path):
    name = tmp_path / "own boards" / "x.y"
    name.parent.mkdir()
    assert f"wrote {paths.shown(name)}.toml;" in shown(str(name), "supply=30")
    assert [board_file.load(text).nominal_bus_v for text in (str(name), f"{name}.toml")] == [30.0, 30.0]
    refused(command("board", str(name), "supply=36"), "is there already", "x.y.toml")
    assert board_file.load(str(name)).nominal_bus_v == 30.0


def test_an_existing_file_stays_as_it_is(path):
    path.write_text("mine", encoding="utf-8")
    refused(command("board", str(path), "gain=20"), "is there already", "give another name")
    assert path.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("words, parts", [
    (("gain=5000",), ["shunt.amplifier_gain = 5000 1 is impossible", "choose 1 .. 500"]), (("shunt=0",), ["shunt.resistance = 0 ohm is impossible"]),
    (("shunt=5kg",), ["'kg' is no unit of shunt.resistance", "ohm, mohm"]), (("shunt=1,5",), ["'1,5' is not a number", "decimal point"]),
    (("shunt=1.2.3",), ["'1.2.3' is not a number"]), (("shunt=nan",), ["is not a number"]), (("gian=3",), ["unknown key 'gian'", "did you mean 'gain'?"]),
    (("shunt",), ["'shunt' is no key=value"]), (("gain=",), ["'gain=' is no key=value"]), (("gain=1", "amplifier_gain=2"), ["'amplifier_gain' is given twice"]),
    (("divider=2k/30k",), ["do not rise in this order", "3.52 V"]), (("divider=30k/0",), ["the lower resistor of '30k/0' is 0"]),
    (("offset=2.5",), ["reference = 2.5 V is not the middle of the converter's 3.3 V"]), (("supply=70",), ["supply.voltage = 70 V", "choose 8 .. 60 V"]),
    (("supply=48",), ["do not rise in this order", "67.2 and 52.8 V"]), (("inverted=true",), ["'inverted' = 'true' is neither yes nor no"]),
    (("pwm=16",), ["pwm.period = 16 s is impossible", "choose 2.5e-05 .. 0.00014 s or a frequency such as 16kHz"]),
    (("pwm=2kHz",), ["pwm.period = 2 kHz is impossible", "choose 7.14286 .. 40 kHz"]), (("pwm=0kHz",), ["pwm.period = 0 kHz is impossible"]),
    (("zzz=3",), ["unknown key 'zzz', SET: docs/files.md lists them"]), (("gain=20", "kHz"), ["'kHz' is no unit of shunt.amplifier_gain"]),
    (("fault=RA8",), ["fault cannot be on RA8"]), (("from=no_such",), ["no board 'no_such'", "SET"])])
def test_nonsense_is_one_line_and_writes_nothing(path, words, parts):
    refused(command("board", str(path), *words), *parts)
    assert not path.exists()


def test_a_folder_that_is_not_there_is_one_line(tmp_path):
    refused(command("board", str(tmp_path / "none" / "x.toml"), "gain=20"), "cannot write the file", "make the folder", "none first")


def test_text_from_the_command_line_cannot_break_the_file(path):
    shown(str(path), 'title=a "quoted" \\ name')
    assert board_file.load(str(path)).title == "a  quoted    name"
