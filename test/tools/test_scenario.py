"""Scenario files: what they may say, and the line that each mistake gets."""

import pytest
from support import SCENARIO, document, refusal, scenario

from tools.bench.scenario import Rating, asks_for_rating, in_numbers
from tools.bench.scenario_file import load, read
from tools.common import paths
from tools.common.toml_file import Document

EVENT = "[[event]]\nat_s = 1.0\n"
MEASURE = "[[measure]]\nname = \"m\"\nfrom_s = 0.5\nto_s = 1.0\n"
FAULT = "[fault]\nrpm = 1000\ncause = { x = 1 }\nmended = { x = 0 }\nwithin_s = 0.1\nname = \"STALL\"\n"
EXPECT = MEASURE + "[[expect]]\nkind = \"measure\"\nmeasure = "

MISTAKES = {
    "unknown key": ("colour = \"red\"", ["unknown key 'colour'"]),
    "misspelt key": ("descripton = \"x\"", ["unknown key 'descripton'", "did you mean 'description'?"]),
    "event without a time": ("[[event]]\npress = \"S2\"", ["'at_s' is missing"]),
    "event without an action": (EVENT, ["nothing to do", "press, speed_rpm"]),
    "slow start": (EVENT + "start_rpm = 1000\nover_s = 1", ["'over_s' with 'start_rpm'"]),
    "speed without a reference": (MEASURE + "[[expect]]\nkind = \"speed\"\nmeasure = \"m\"",
        ["'m' has no speed error", "add reference_rpm"]),
    "event with two actions": (EVENT + "press = \"S2\"\npot = 0.5", ["'press' and 'pot' together"]),
    "unknown button": (EVENT + "press = \"S4\"", ["'S4' is no press"]),
    "event after the end": ("[[event]]\nat_s = 2.5\npress = \"S2\"", ["at_s = 2.5 is after the end", "0 .. duration_s = 2"]),
    "event before the start": ("[[event]]\nat_s = -1\npress = \"S2\"", ["'at_s' = -1 is impossible"]),
    "potentiometer beyond its end": (EVENT + "pot = 1.2", ["'pot' = 1.2 is impossible", "0 .. 1"]),
    "holding a potentiometer": (EVENT + "pot = 0.2\nhold_s = 1", ["'hold_s' with 'pot'"]),
    "pressing slowly": (EVENT + "press = \"S2\"\nover_s = 1", ["'over_s' with 'press'"]),
    "text as a plant value": (EVENT + "set = { \"load.constant_nm\" = \"big\" }", ["'load.constant_nm' is not a number"]),
    "variable beyond 16 bits": (EVENT + "debug = { SnapStart = 70000 }", ["'SnapStart' = 70000 is impossible"]),
    "parameters that are no table": (EVENT + "parameter = 3", ["'parameter' is not a table"]),
    "no parameter at all": (EVENT + "parameter = {}", ["'parameter' is not a table"]),
    "misspelt parameter": (EVENT + "parameter = { IDREF_SPED5 = -0.7 }", ["'IDREF_SPED5' is no parameter of userparams.h", "did you mean 'IDREF_SPEED5'?"]),
    "parameter beyond its range": (EVENT + "parameter = { IDREF_SPEED5 = 0.7 }", ["'IDREF_SPEED5' = 0.7 is impossible", "-20 .. 0 A"]),
    "list with a value beyond its range": (EVENT + "parameter = { IDREF_SPEED5 = [-0.7, 0.7] }", ["'IDREF_SPEED6' = 0.7 is impossible"]),
    "list beyond the table's end": (EVENT + "parameter = { IDREF_SPEED16 = [0, 0, 0] }", ["'IDREF_SPEED16' has 3 values for 2", "IDREF_SPEED17"]),
    "list for a single parameter": (EVENT + "parameter = { FW_TRIM_CURRENT_A = [0, 1] }", ["has 2 values for 1", "write one number"]),
    "parameter as a text": (EVENT + "parameter = { IDREF_SPEED5 = \"much\" }", ["'IDREF_SPEED5' is not a number"]),
    "entry that two lists have": (EVENT + "parameter = { IDREF_SPEED5 = [-0.7, -0.8], IDREF_SPEED6 = -0.9 }", ["'IDREF_SPEED6' is there twice"]),
    "changing a parameter slowly": (EVENT + "parameter = { IDREF_SPEED5 = -0.7 }\nover_s = 1", ["'over_s' with 'parameter'"]),
    "measure backwards": ("[[measure]]\nname = \"m\"\nfrom_s = 1.0\nto_s = 0.5", ["to_s = 0.5 is not after from_s = 1"]),
    "measure after the end": ("[[measure]]\nname = \"m\"\nfrom_s = 1.0\nto_s = 3.0", ["'to_s' = 3 is impossible"]),
    "measure without a name": ("[[measure]]\nfrom_s = 0.5\nto_s = 1.0", ["'name' is missing"]),
    "measure of no speed": (MEASURE + "reference_rpm = 0", ["'reference_rpm' = 0 is impossible"]),
    "two measures of one name": (MEASURE + MEASURE, ["two measures are called 'm'"]),
    "unknown kind of expectation": ("[[expect]]\nkind = \"hope\"", ["'hope' is no kind"]),
    "expectation of an unknown measure": (EXPECT + "\"n\"\nvalue = \"speed_rpm\"\nmin = 1", ["'n' is no measure", "use one of m"]),
    "expectation of several measures, one unknown": (EXPECT + "[\"m\", \"n\"]\nvalue = \"speed_rpm\"\nmin = 1",
                                                     ["'n' is no measure", "use one of m"]),
    "expectation of an unknown value": (EXPECT + "\"m\"\nvalue = \"sped_rpm\"\nmin = 1",
                                        ["'sped_rpm' is no value", "did you mean 'speed_rpm'?"]),
    "expectation without bounds": (EXPECT + "\"m\"\nvalue = \"speed_rpm\"", ["neither 'min' nor 'max'"]),
    "bounds in the wrong order": (EXPECT + "\"m\"\nvalue = \"speed_rpm\"\nmin = 2\nmax = 1", ["min = 2 is above max = 1"]),
    "speed error without a reference": (EXPECT + "\"m\"\nvalue = \"speed_error_percent\"\nmax = 1",
        ["'m' has no speed error", "add reference_rpm"]),
    "expectation with a key of another kind": ("[[expect]]\nkind = \"no_fault\"\nwithin_s = 1", ["unknown key 'within_s'"]),
    "per cent of a speed as a text": (EVENT + "speed_percent = \"half\"", ["'speed_percent' is not a number", "line 8"]),
    "torque that drives": (EVENT + "torque_percent = -50", ["'torque_percent' = -50 is impossible", "0 .. 1000", "line 8"]),
    "absurd per cent of a speed": (EVENT + "speed_percent = 5000", ["'speed_percent' = 5000 is impossible"]),
    "speed by an unknown name": (EVENT + "speed = \"fast\"", ["'fast' is no speed", "maximum, minimum, nominal"]),
    "speed in rpm and in per cent": (EVENT + "speed_rpm = 1000\nspeed_percent = 20", ["'speed_rpm' and 'speed_percent' together"]),
    "holding a speed": (EVENT + "speed_percent = 50\nhold_s = 1", ["'hold_s' with 'speed_percent'"]),
    "measure with two references": (MEASURE + "reference_rpm = 1000\nreference_percent = 50",
                                    ["'reference_rpm' and 'reference_percent' together", "line 11"]),
    "measure of no per cent": (MEASURE + "reference_percent = 0", ["'reference_percent' = 0 is impossible", "line 10"]),
    "measure of an unknown speed": (MEASURE + "reference = \"top\"", ["'top' is no reference"]),
    "define that is no macro": ("[firmware]\ndefines = [\"TUNING; rm\"]", ["'TUNING; rm' is no macro"]),
    "define that is no text": ("[firmware]\ndefines = \"TUNING\"", ["'defines' is not a list of texts"]),
    "fault without its cause": (FAULT.replace("cause", "curse"), ["'cause' is missing"]),
    "fault with a key of an expectation": (FAULT + "after_s = 1", ["unknown key 'after_s'"]),
    "fault of no name": (FAULT.replace("name", "note"), ["'name' is missing"]),
    "fault after the end": (FAULT, ["at_s = 3 is after the end"]),
    "unknown key of [start]": ("[start]\nrotor = 1", ["unknown key 'rotor'", "did you mean 'rotor_deg'?"]),
}


@pytest.mark.parametrize("text, parts", MISTAKES.values(), ids=MISTAKES)
def test_every_mistake_gets_one_line_with_its_place(text, parts):
    refusal(lambda: scenario(text), "test.toml line ", *parts)


@pytest.mark.parametrize("old, new, part", [
    *((line, "", f"'{line.split()[0]}' is missing") for line in SCENARIO.splitlines() if line.startswith(("title", "duration_s"))),
    *(("2.0", duration, "is impossible") for duration in ("0", "-1", "1e6"))])
def test_a_title_and_a_possible_duration_are_required(old, new, part):
    refusal(lambda: read(document(SCENARIO.replace(old, new))), part)


def test_what_a_scenario_leaves_out_has_defaults():
    item = read(document("title = \"t\"\nduration_s = 1.0\n" + EVENT + "press = \"S2\""))
    assert (item.motor, item.board, item.events[0].hold_s) == ("hurst_dmb0224c10002", "", 0.1)


def test_a_start_turns_the_potentiometer_before_power_up_and_presses_s2():
    short = scenario("[[event]]\nat_s = 0.2\nstart_rpm = 1000\n").events
    assert [(event.at_s, event.kind, event.value, event.button, event.hold_s) for event in short] == [
        (0.0, "speed_rpm", 1000.0, "", 0.0), (0.2, "press", 0.0, "S2", 0.1)]
    # and events come in order of time
    assert [event.at_s for event in scenario("[[event]]\nat_s = 1.5\npot = 1\n[[event]]\nat_s = 0.5\npot = 0\n").events] == [0.5, 1.5]


def test_a_list_of_parameters_goes_on_with_the_table_s_next_entries_and_the_protocol_has_it_short():
    event = scenario(EVENT + "parameter = { FW_TRIM_CURRENT_A = 0, IDREF_SPEED9 = [-0.7, -0.8], LS_OVER2LS0_SPEED1 = [0.4, 0.4] }").events[0]
    assert event.parameters == {"FW_TRIM_CURRENT_A": 0.0, "IDREF_SPEED9": -0.7, "IDREF_SPEED10": -0.8, "LS_OVER2LS0_SPEED1": 0.4, "LS_OVER2LS0_SPEED2": 0.4}
    assert event.written == "FW_TRIM_CURRENT_A = 0, IDREF_SPEED9 .. 10 = -0.7 .. -0.8, LS_OVER2LS0_SPEED1 .. 2 = 0.4"


PERCENT = """
[[event]]
at_s = 0.5
speed_percent = 40
[[event]]
at_s = 0.6
torque_percent = 25
over_s = 0.5
[[event]]
at_s = 1.0
speed = "maximum"
[[measure]]
name = "40 %"
from_s = 0.5
to_s = 1.0
reference_percent = 40
[[measure]]
name = "top"
from_s = 1.5
to_s = 2.0
reference = "maximum"
[[expect]]
kind = "speed"
measure = "40 %"
"""


def test_per_cents_become_numbers_of_the_motor_and_names_those_of_the_header():
    item = in_numbers(scenario(PERCENT), Rating(2500.0, 0.08), {"MAXIMUM_SPEED_RPM": 5500.0})
    assert [(event.kind, event.keys or event.value, event.over_s) for event in item.events] == [
        ("speed_rpm", 1000.0, 0.0), ("set", {"load.constant_nm": 0.02}, 0.5), ("speed_rpm", 5500.0, 0.0)]
    assert [measure.reference_rpm for measure in item.measures] == [1000.0, 5500.0]


@pytest.mark.parametrize("text, asks", [
    (PERCENT, True), (EVENT + "speed_percent = 20\n", True), (EVENT + "torque_percent = 20\n", True),
    (MEASURE + "reference_percent = 20\n", True),
    (MEASURE + "reference_rpm = 1000\n" + EVENT + "speed = \"maximum\"\n", False)])
def test_only_per_cents_need_a_rating(text, asks):
    assert asks_for_rating(scenario(text)) == asks


def test_a_scenario_in_numbers_stays_as_it_is_and_a_header_that_does_not_tell_its_speeds_is_refused():
    item = scenario(MEASURE + "reference_rpm = 1000\n" + EVENT + "speed_rpm = 1000\n")
    assert in_numbers(item, None, {}) == item
    refusal(lambda: in_numbers(scenario(PERCENT), Rating(2500.0, 0.08), {}), "does not tell MAXIMUM_SPEED_RPM")


HEADER = {"MINIMUM_SPEED_RPM": 150.0, "NOMINAL_SPEED_RPM": 2500.0, "MAXIMUM_SPEED_RPM": 5000.0, "NOPOLESPAIRS": 5.0, "LOOPTIME_SEC": 50e-6,
          "END_SPEED_RPM": 500.0, "OPENLOOP_RAMPSPEED_INCREASERATE": 10.0, "LOCK_TIME": 4000.0, "SPEEDREFRAMP_RPM_PER_S": 4000.0,
          "SPEED_BANDWIDTH_HZ": 12.7, "LOAD_BANDWIDTH_HZ": 107.0}


def test_a_scenario_that_follows_the_header_keeps_its_times_for_a_quick_motor():
    item = load("rated")
    found = in_numbers(item, Rating(2500.0, 0.08), HEADER)
    assert found.duration_s == pytest.approx(item.duration_s, abs=0.5)
    assert [event.at_s for event in found.events] == pytest.approx([event.at_s for event in item.events], abs=0.5)


def test_a_slow_start_shifts_what_comes_after_and_may_take_its_time():
    slow = HEADER | {"OPENLOOP_RAMPSPEED_INCREASERATE": 1.0, "LOCK_TIME": 32000.0, "END_SPEED_RPM": 1200.0}
    item, found = load("rated"), in_numbers(load("rated"), Rating(2500.0, 0.08), slow)
    start_s = 1.6 + 1200.0 * 5 / 60 * 50e-6 * 65536 * 1024 * 50e-6 + 0.4
    assert start_s > 9.0 and found.expectations[0].within_s == pytest.approx(start_s, rel=1e-3)
    later = found.events[2].at_s - item.events[2].at_s
    assert (found.events[1].at_s, later) == (0.2, pytest.approx(start_s - 5.0, abs=0.3))
    assert found.measures[0].from_s - item.measures[0].from_s == pytest.approx(later)


def test_a_heavy_rotor_gets_its_ramps_its_coasting_and_its_slow_loop():
    heavy = HEADER | {"SPEEDREFRAMP_RPM_PER_S": 200.0, "SPEED_BANDWIDTH_HZ": 1.0}
    item, found = load("rated"), in_numbers(load("rated"), Rating(2500.0, 0.08, coast_s_per_rpm=0.01), heavy)
    gaps, wider = ([b.at_s - a.at_s for a, b in zip(x.events, x.events[1:])] for x in (item, found))
    assert wider[3] - gaps[3] > (1250.0 - 500.0) / 200.0 - 1.0 and wider[4] - gaps[4] > (2500.0 - 500.0) / 200.0 - 1.0
    assert wider[7] - gaps[7] > (5000.0 - 1250.0) * 0.01 - 1.0 # no load: friction alone slows it down
    stop = next(item for item in found.expectations if hasattr(item, "lowest_rpm"))
    assert stop.after_s == found.events[-1].at_s and stop.within_s > 1250.0 * 0.01


def test_a_share_of_the_rated_speed_below_the_headers_minimum_becomes_the_minimum_where_the_scenario_follows_it():
    found = in_numbers(load("rated"), Rating(2500.0, 0.08), HEADER | {"MINIMUM_SPEED_RPM": 700.0})
    assert [event.value for event in found.events if event.kind == "speed_rpm"] == [1250.0, 700.0, 2500.0, 5000.0, 1250.0]
    assert [measure.reference_rpm for measure in found.measures] == [1250.0, 700.0, 2500.0, 5000.0]


def test_the_rated_scenario_asks_for_20_50_and_100_per_cent_at_half_torque():
    item = load("rated")
    torque, at = 0.0, {}
    for event in item.events: # the brake at the end of each measure
        at |= {measure.reference_percent or measure.reference: torque for measure in item.measures
               if measure.name not in at and measure.to_s <= event.at_s and (measure.reference_percent or measure.reference) not in at}
        torque = event.value if event.kind == "torque_percent" else torque
    assert at == {20.0: 50.0, 50.0: 50.0, 100.0: 50.0, "maximum": 0.0}


def test_a_measure_is_called_by_its_reference_and_the_speed_is_checked_in_all_that_have_one():
    item = scenario(MEASURE + MEASURE.replace('name = "m"', "reference_rpm = 1500") + MEASURE.replace('"m"', '"n"\nreference = "nominal"')
                    + "[[expect]]\nkind = \"speed\"\n")
    assert [measure.name for measure in item.measures] == ["m", "1500 rpm", "n"] and item.expectations[0].measures == ["1500 rpm", "n"]


def test_every_scenario_of_the_project_is_valid_and_expects_something_and_there_is_one_for_each_mode_and_each_fault():
    items = [load(name) for name in paths.names(paths.SCENARIOS)]
    assert [item.title for item in items if not item.expectations] == []
    assert {define for item in items for define in item.defines if not define.startswith("APP=")} == {"OPEN_LOOP_FUNCTIONING", "TUNING", "TORQUE_MODE",
        "BIDIRECTIONAL_SPEED", "TORQUE_PROFILE", "SNAPSHOT", "DIRECTION_INPUT_USED=1", "FAULT_OUTPUT_USED=1", "RUNNING_OUTPUT_USED=1", "BRAKE_CHOPPER_V=26",
        "MOTOR_NTC_USED=1", "BRIDGE_NTC_USED=1", "PULSE_DUTY=1"}
    faults = {expectation.name for item in items for expectation in item.expectations if type(expectation).__name__ == "FaultExpectation"}
    assert {"OVERCURRENT_HW", "OVERCURRENT_SW", "OVERVOLTAGE", "UNDERVOLTAGE", "START_FAILED", "STALL", "LOST_LOCK",
            "ISR_OVERRUN"} <= faults


def test_a_motor_and_a_board_are_seen_from_the_scenario_s_folder(tmp_path, monkeypatch):
    motor = paths.MOTORS / "linix_45zwn24_40.toml"
    (tmp_path / "mine").mkdir()
    for name in ("a motor.toml", "mine/a motor.toml"):
        (tmp_path / name).write_bytes(motor.read_bytes())
    (tmp_path / "old.toml").write_bytes((paths.BOARDS / "mclv2.toml").read_bytes())
    file = tmp_path / "mine" / "s.toml"
    file.write_text(SCENARIO.replace("hurst_dmb0224c10002", "./a motor.toml").replace("\"mclv\"", "\"./old.toml\""), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    item = read(Document(file))
    assert (item.motor, item.board) == (str(tmp_path / "mine" / "a motor.toml"), "./old.toml")
    assert item.notes == [f"{paths.shown(file)} line 4: './old.toml' is found from the current folder, not from the file's: write \"../old.toml\""]
    assert not load("demo").notes


def test_what_an_application_asks_for_after_an_event_shifts_what_comes_later():
    slow = HEADER | {"OPENLOOP_RAMPSPEED_INCREASERATE": 1.0, "LOCK_TIME": 32000.0, "END_SPEED_RPM": 1200.0, "SPEEDREFRAMP_RPM_PER_S": 500.0}
    item, found = load("app_rc"), in_numbers(load("app_rc"), None, slow)
    moved = {a.at_s: b.at_s - a.at_s for a, b in zip(item.events, found.events)}
    start_s = 1.6 + 1200.0 * 5 / 60 * 50e-6 * 65536 * 1024 * 50e-6 + 0.4
    ramp_s = (2575.0 - 150.0) / 500.0 - 1.0
    assert moved[3.0] == 0.0 and moved[5.0] == moved[6.0] == pytest.approx(start_s - 1.6, abs=0.3) and moved[8.5] - moved[6.0] == pytest.approx(ramp_s, abs=0.1)
    stop, fault = (next(x for x in found.expectations if type(x).__name__ == name) for name in ("StopExpectation", "FaultExpectation"))
    assert stop.after_s == 9.5 + moved[9.5] and stop.within_s == pytest.approx(1.5 + 2575.0 / 500.0 - 1.0) and fault.kept_to_s == pytest.approx(14.0 + moved[13.5])
    assert [measure.reference_rpm for measure in found.measures] == [150.0, 2575.0, 2575.0]


@pytest.mark.parametrize("name", ["app_analog", "app_fan", "app_fan_ntc", "app_fixed_speed", "app_rc", "app_pwm"])
def test_a_scenario_of_an_application_asks_for_no_speed_of_one_motor_alone(name):
    item = load(name)
    assert item.follows_header and all(measure.reference or measure.reference_rpm in (800.0, 1500.0, 1900.0, 3000.0) for measure in item.measures) # what fan.c and fixed_speed.c say
