"""The operator: potentiometer positions for speeds and currents, buttons, ramps."""

import pytest
from support import refusal, scenario

from tools.bench.panel import DEBOUNCE_S, HOLD_S, Ranges, plan
from tools.bench.scenario import Rating, in_numbers

PARAMS = {"MINIMUM_SPEED_RPM": 500.0, "NOMINAL_SPEED_RPM": 2800.0, "MAXIMUM_SPEED_RPM": 5500.0, "MAXIMUM_CURRENT_A": 2.75}
STEP = 1.0 / 1024.0
BOTH, TORQUE = ["BIDIRECTIONAL_SPEED"], ["TORQUE_MODE"]


def events(*pairs: tuple[float, str]) -> str:
    return "".join(f"[[event]]\nat_s = {at_s}\n{action}\n" for at_s, action in pairs)


def actions(*pairs: tuple[float, str], defines=(), start=None):
    return plan(scenario(events(*pairs)), Ranges.of(PARAMS, list(defines)), start or {})


def percent(*pairs: tuple[float, str], defines=(), params=None):
    """actions() of a motor with 2500 rpm and 0.08 N m; it is started at 0.2 s."""
    params = PARAMS | (params or {})
    item = in_numbers(scenario(events((0.2, "press = \"S2\""), *pairs)), Rating(2500.0, 0.08), params)
    return plan(item, Ranges.of(params, list(defines)), {"load.constant_nm": 0.0})


def turned(found) -> list[tuple[float, float]]:
    """When the potentiometer is turned, and to where."""
    return [(action.at_s, action.keys["input.pot"]) for action in found if "input.pot" in action.keys]


def pots(found) -> list[float]:
    return [position for _, position in turned(found)]


def s3(found) -> list[float]:
    """When S3 is pressed."""
    return [action.at_s for action in found if action.keys.get("input.s3") == 1.0]


# ---- positions -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("pairs, defines, positions", [
    ([(0, "speed_rpm = 500"), (0.1, "speed_rpm = 1650"), (0.2, "speed_rpm = 2800")], [], [0.0, 0.5, 1.0]),
    ([(0, "press = \"S3\""), (0.1, "speed_rpm = 4150")], [], [0.5]), # 2800 .. 5500 rpm
    ([(0, "press = \"S3\""), (0.3, "press = \"S3\""), (0.6, "speed_rpm = 1650")], [], [0.5]),
    ([(0, "press = \"S3\""), (0.3, "press = \"S2\""), (0.6, "speed_rpm = 1650")], [], [0.5]), # S2 goes back to the normal range
    ([(0, "speed_rpm = 1650"), (0.1, "speed_rpm = -1650")], BOTH, [0.75, 0.25]),
    ([(0, "current_a = 1.375")], TORQUE, [0.5])])
def test_each_speed_and_current_has_its_position(pairs, defines, positions):
    assert pots(actions(*pairs, defines=defines)) == pytest.approx(positions, abs=STEP)


def test_the_position_is_the_middle_of_the_converter_step_that_is_nearest_to_the_speed():
    assert pots(actions((0, "speed_rpm = 1000")))[0] / STEP % 1.0 == pytest.approx(0.5)
    ranges = Ranges.of(PARAMS, [])
    for rpm in range(500, 2801, 7):
        assert abs(500 + ranges.pot_for_speed(rpm, False) * 2300 - rpm) <= 2300 * STEP * 0.5 + 1e-9, rpm
    # bidirectional, the minimum speed keeps its direction
    forward, backward = pots(actions((0, "speed_rpm = 500"), (0.1, "speed_rpm = -500"), defines=BOTH))
    assert forward > 0.515 and backward < 0.485


@pytest.mark.parametrize("pairs, defines, parts", [
    ([(0, "speed_rpm = 4000")], [], ["speed_rpm = 4000 is impossible, ", "line", "500 .. 2800 rpm", "press S3"]),
    ([(0, "press = \"S3\""), (0.1, "speed_rpm = 1000")], [], ["2800 .. 5500 rpm"]),
    ([(0, "speed_rpm = 1000")], TORQUE, ["TORQUE_MODE has no speed command"]),
    ([(0, "current_a = 1")], [], ["only TORQUE_MODE has a current command"])])
def test_what_the_potentiometer_does_not_cover_is_refused(pairs, defines, parts):
    refusal(lambda: actions(*pairs, defines=defines), *parts)


def test_a_speed_beyond_every_range_does_not_ask_for_s3_and_a_firmware_that_hides_its_ranges_is_refused():
    assert "S3" not in refusal(lambda: actions((0, "speed_rpm = 9000")))
    refusal(lambda: Ranges.of({"MINIMUM_SPEED_RPM": 500.0}, []), "NOMINAL_SPEED_RPM")


# ---- per cent, and S3 by itself ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("pairs, pressed, rpm", [ # rpm: the potentiometer's, in the range that S3 has chosen last
    ([(0.5, "speed_percent = 40")], [], 1000.0),
    ([(0.5, "speed_percent = 160"), (1.5, "speed_percent = 40")], [0.5, 1.5], 1000.0),
    ([(0.5, "speed_percent = 160"), (1.5, "speed_percent = 200")], [0.5], 5000.0),
    ([(0.5, "speed_percent = 160"), (1.5, "speed = \"maximum\"")], [0.5], 5500.0),
    ([(0.5, "speed = \"nominal\""), (0.7, "speed_percent = 160"), (1.7, "speed = \"nominal\"")], [0.7],
     2800.0)]) # the border is in both ranges
def test_s3_is_pressed_where_the_speed_takes_it(pairs, pressed, rpm):
    found = percent(*pairs)
    low, high = (2800.0, 5500.0) if len(pressed) % 2 else (500.0, 2800.0)
    assert s3(found) == pressed
    assert low + (high - low) * pots(found)[-1] == pytest.approx(rpm, abs=2.0)


def test_the_potentiometer_moves_when_the_button_acts():
    found = percent((0.5, "speed_percent = 160"))
    assert (0.5 + HOLD_S, 0.0) in [(action.at_s, action.keys.get("input.s3")) for action in found]
    assert turned(found) == [(pytest.approx(0.5 + DEBOUNCE_S), pytest.approx(1200.0 / 2700.0, abs=STEP))]


def test_a_slow_turn_goes_through_the_border_at_its_share_of_the_time():
    found = percent((0.5, "speed = \"minimum\""), (0.6, "speed_percent = 160\nover_s = 0.7"))
    at_s = s3(found)[0]
    assert at_s == pytest.approx(0.6 + 0.7 * 2300.0 / 3500.0, abs=0.002)
    before, after = ([pot for time, pot in turned(found) if low <= time <= high] for low, high in ((0.6, at_s), (at_s + 1e-9, 9.0)))
    assert (before, after) == (sorted(before), sorted(after))
    assert (before[-1], after[0], after[-1]) == pytest.approx((1.0, 0.0, 1200.0 / 2700.0), abs=STEP)
    assert turned(found)[-1][0] == pytest.approx(1.3 + DEBOUNCE_S, abs=0.002)


def test_a_slow_turn_back_goes_down_in_both_ranges():
    found = percent((0.3, "speed = \"maximum\""), (0.6, "speed_percent = 40\nover_s = 0.9"))
    at_s = s3(found)[1]
    assert at_s == pytest.approx(0.6 + 0.9 * 2700.0 / 4500.0, abs=0.002)
    after = [pot for time, pot in turned(found) if time > at_s]
    assert after == sorted(after, reverse=True)
    assert (after[0], after[-1]) == pytest.approx((1.0, 500.0 / 2300.0), abs=STEP)
    # a button that is still down is let go before it is pressed again
    first, second = s3(percent((0.5, "speed_percent = 160"), (0.52, "speed_percent = 40")))
    assert second >= first + HOLD_S + DEBOUNCE_S


def test_s3_does_nothing_before_the_start_so_its_range_is_refused_there():
    item = in_numbers(scenario(events((0.0, "speed_percent = 160"))), Rating(2500.0, 0.08), PARAMS)
    refusal(lambda: plan(item, Ranges.of(PARAMS, []), {}), "speed_percent = 160 (4000 rpm) is impossible, ", "line 8: ",
            "before S2; start the motor first")


@pytest.mark.parametrize("share, defines, maximum_rpm, parts", [
    *((share, [], 5500.0, [f"speed_percent = {share} ({rpm} rpm) is impossible, ", "line 11: the header's speeds are 500 .. 5500 rpm"])
      for share, rpm in ((10, 250), (230, 5750), (-40, -1000))),
    (160, [], 2800.0, ["500 .. 2800 rpm"]), (160, BOTH, 5500.0, ["500 .. 2800 rpm"])])
def test_a_speed_that_the_header_does_not_allow_is_refused_with_its_rpm_and_its_line(share, defines, maximum_rpm, parts):
    refusal(lambda: percent((0.5, f"speed_percent = {share}"), defines=defines, params={"MAXIMUM_SPEED_RPM": maximum_rpm}), *parts)


def test_without_a_fast_range_the_end_is_the_nominal_speed_and_where_the_potentiometer_has_a_middle_backwards_is_possible():
    assert s3(percent((0.5, "speed = \"maximum\""), params={"MAXIMUM_SPEED_RPM": 2800.0})) == []
    assert pots(percent((0.5, "speed_percent = 66"), (1.0, "speed_percent = -66"), defines=BOTH)) == pytest.approx([0.75, 0.25])


def test_torque_is_a_brake_in_per_cent_of_the_rated_one():
    found = percent((0.5, "torque_percent = 50\nover_s = 0.1"))
    values = [action.keys["load.constant_nm"] for action in found if "load.constant_nm" in action.keys]
    assert (values[-1], values) == (0.04, sorted(values))
    assert "brake to 50 % of the rated torque: 0.04 N m" in [action.text for action in found]


# ---- actions -------------------------------------------------------------------------------------------------------------
def test_a_press_is_released_after_its_time_and_actions_come_in_order():
    found = actions((0.5, "press = \"S2\"\nhold_s = 0.25"), (0.7, "pot = 0.1"))
    assert [(action.at_s, action.keys) for action in found] == [
        (0.5, {"input.s2": 1.0}), (0.7, {"input.pot": 0.1}), (0.75, {"input.s2": 0.0})]


def test_a_ramp_starts_at_the_present_value_ends_exactly_at_the_goal_and_is_one_line_of_the_protocol():
    found = actions((0.5, "set = { \"load.constant_nm\" = 0.05 }\nover_s = 0.1"), start={"load.constant_nm": 0.01})
    values = [action.keys["load.constant_nm"] for action in found]
    assert (values, values[-1], found[-1].at_s) == (sorted(values), 0.05, pytest.approx(0.6))
    assert 0.01 < values[0] < 0.012 and sum(bool(action.text) for action in found) == 1


def test_the_protocol_tells_speed_and_button_a_note_replaces_its_text_and_variables_are_written_as_given():
    texts = [action.text for action in percent((0.5, "speed_percent = 160\nover_s = 0.5")) if action.text]
    assert texts == ["S2 pressed", "potentiometer to 4000 rpm", "S3 pressed"]
    assert actions((0, "pot = 0.5\nnote = \"left\""))[0].text == "left"
    assert actions((0, "debug = { SnapStart = 1 }"))[0].variables == {"SnapStart": 1}


def test_a_line_for_the_serial_line_is_sent_with_its_end_and_the_protocol_has_it():
    found = actions((0.5, "send = \"run*69\""), (0.7, "send = \"stop*18\"\nnote = \"enough\""))
    assert [(action.at_s, action.sends, action.text) for action in found] == [(0.5, "run*69\n", "serial line: run*69"), (0.7, "stop*18\n", "enough")]
