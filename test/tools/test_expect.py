"""Expectations: each kind holds when it should, and a failed one names its row and the numbers."""

import pytest
from support import PERIOD_S, run, step

from tools.bench import report


def expect(kind: str, **keys) -> str:
    def toml(value) -> str:
        return str(value).lower() if isinstance(value, bool) else f"\"{value}\"" if isinstance(value, str) else str(value)
    return f"[[expect]]\nkind = \"{kind}\"\n" + "".join(f"{key} = {toml(value)}\n" for key, value in keys.items())


def off_from(at_s: float) -> dict:
    """Outputs that are on up to a moment; "seen" tells of the period before."""
    return {"pwm__outputs_on": step((0, 21), (at_s, 0)), "pwm__outputs_seen": step((0, 63), (at_s + 2 * PERIOD_S, 0))}


def raised(at_s: float, code: int = 3, outputs_off_s: float | None = None, cleared_s: float = 9) -> dict:
    """A fault, and outputs that are off from then on."""
    return {"fw__fault": step((0, 0), (at_s, code), (cleared_s, 0)), **off_from(at_s if outputs_off_s is None else outputs_off_s)}


S2 = "[[event]]\nat_s = 0.1\npress = \"S2\"\n"
MEASURE = "[[measure]]\nname = \"row\"\nfrom_s = 0.5\nto_s = 1.0\nreference_rpm = 1000\n"
ON = {"pwm__outputs_on": 21, "pwm__outputs_seen": 63}
ERROR = MEASURE + expect("measure", measure="row", value="speed_error_percent", min=-0.5, max=0.5)
HELD = MEASURE + expect("speed", measure="row")
CLOSED = {"fw__state": step((0, 4), (0.8, 5)), "fw__speed_ref_rpm": 1000}
REVERSED = {sign: CLOSED | {"fw__speed_ref_rpm": sign * 1000,
                            "plant__speed_rpm": step((0, sign * 1000), (0.76, sign * -30), (0.77, sign * 1000))}
            for sign in (1, -1)}
OVERSHOOT = S2 + expect("hand_over", within_s=0.8, overshoot_percent=10)
NO_REVERSE = S2 + expect("hand_over", within_s=0.8, no_reverse_motion=True)
SLOW_STOP = expect("stop", after_s=1.0, within_s=0.5, speed_max_rpm=600)
STOP = expect("stop", after_s=1.0, within_s=0.3)
GENTLE_STOP = expect("stop", after_s=1.0, within_s=0.5, brake_max_a=0.5)
AGAIN = expect("stop", after_s=0.5, to_s=1.0, within_s=0.3)
BACKWARDS = {sign: off_from(1.2) | {"plant__speed_rpm": step((0, sign * 900), (1.1, sign * -3), (1.15, 0))} for sign in (1, -1)}
BRAKED = {sign: off_from(1.2) | {"plant__speed_rpm": sign * 900, "plant__i_q": step((0, sign * -9), (0.99, sign * -2.8), (1.15, sign * 9))}
          for sign in (1, -1)}
OFF = expect("outputs_off", from_s=1.0, to_s=2.0)
BUS = expect("bus_voltage", min=20, max=30)
PEAK = {"fw__i_q_a": step((0, 0), (1.5, 7), (1.6, 0))}
STATES = {"fw__state": step((0, 1), (1.0, 5))}
NEVER = expect("state", name="CLOSED", never=True)
FAULT = expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1)
KEPT = expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1, kept_to_s=1.5)
CLEARED = expect("fault", name="OVERVOLTAGE", after_s=1.0, within_s=0.1, cleared_from_s=1.5)
HARDWARE = expect("fault", name="OVERCURRENT_HW", after_s=1.0, within_s=0.1, from_cause=True)
NO_FAULT = expect("no_fault", to_s=1.0)

HOLDS = {
    "measure within its bounds": (ERROR, {"plant__speed_rpm": 1004}),
    "speed within half a per cent": (HELD, {"plant__speed_rpm": 1004}),
    "speed within its own per cent": (HELD + "percent = 1.0\n", {"plant__speed_rpm": 1009}),
    "hand-over in time": (S2 + expect("hand_over", within_s=0.8, overshoot_percent=10, no_reverse_motion=True),
                          CLOSED | {"plant__speed_rpm": step((0, 0), (0.7, 1000))}),
    "hand-over within two seconds if nothing is said": (S2 + expect("hand_over"), CLOSED),
    "overshoot a second after the hand-over": (OVERSHOOT, CLOSED | {"plant__speed_rpm": step((0, 1000), (1.9, 1120))}),
    "stop in time and slow enough": (SLOW_STOP, off_from(1.4) | {"plant__speed_rpm": step((0, 1000), (1.3, 400))}),
    "stop that ends in a short circuit of the winding": (SLOW_STOP, {
        "pwm__outputs_on": step((0, 21), (1.05, 0), (1.0501, 42), (1.3, 0)), "pwm__outputs_seen": step((0, 63), (1.3, 0)),
        "fw__state": step((0, 5), (1.05, 9), (1.3, 1)), "plant__speed_rpm": step((0, 1000), (1.3, 0))}),
    "stop that counts to its end": (AGAIN, {name: step((0, on), (0.7, 0), (1.1, on))
                                           for name, on in (("pwm__outputs_on", 21), ("pwm__outputs_seen", 63))}),
    "stop with the allowed speed and current": (GENTLE_STOP + "lowest_rpm = -3\n", BACKWARDS[1] | {"plant__i_q": -0.5}),
    "outputs off": (OFF, {"pwm__outputs_seen": step((0, 63), (0.9, 0))}),
    "bus voltage": (BUS, {"bus__voltage_v": 24}),
    "signal outside its bounds after the window": (expect("signal", signal="fw.i_q_a", statistic="max", max=5, to_s=1.5), PEAK),
    "states at two moments": (expect("state", name="STOPPED", at_s=0.5) + expect("state", name="CLOSED", at_s=1.5), STATES),
    "state that never comes": (NEVER, {"fw__state": 4}),
    "fault in time, outputs off a period later": (KEPT + "cleared_from_s = 1.7\n",
                                                  raised(1.05, outputs_off_s=1.05 + PERIOD_S, cleared_s=1.6)),
    "hardware a period after the cause": (HARDWARE, raised(1.01, 1, 1.0 + PERIOD_S)),
    "fault after the window": (NO_FAULT, {"fw__fault": step((0, 0), (1.5, 6))}),
    "clean": (expect("clean"), {}),
    **{f"statistic {name}": (expect("signal", signal="fw.i_q_a", statistic=name, min=value - 0.01, max=value + 0.01),
                             {"fw__i_q_a": step((0, -3), (1.0, 1))}) # half of the time each
       for name, value in (("min", -3), ("max", 1), ("mean", -1), ("span", 4), ("peak", 3), ("last", 1), ("rms", 5 ** 0.5),
                           ("distinct", 2))},
}


@pytest.mark.parametrize("text, signals", HOLDS.values(), ids=HOLDS)
def test_it_holds(text, signals):
    outcomes = report.check(run(text, **signals))
    assert outcomes and all(outcome.ok for outcome in outcomes), outcomes


# Text, the one row that fails, what its number says, signals.
FAILS = [
    (ERROR, "row: speed_error_percent", "0.6", {"plant__speed_rpm": 1006}),
    (ERROR, "row: speed_error_percent", "-0.6", {"plant__speed_rpm": 994}),
    (HELD, "row: speed_error_percent", "-0.6", {"plant__speed_rpm": 994}),
    (MEASURE + MEASURE.replace("row", "later").replace("0.5", "0.8") + expect("measure", measure=["row", "later"], value="speed_rpm",
                                                                              min=1000),
     "later: speed_rpm", "990", {"plant__speed_rpm": step((0, 1100), (0.8, 990))}),
    (MEASURE + expect("measure", measure="row", value="estimated_rpm", min=0), "row: estimated_rpm", "nothing", {}), # the bridge is off
    (S2 + expect("hand_over", within_s=0.6), "hand-over: closed loop", "0.700 s", CLOSED),
    (S2 + expect("hand_over", within_s=0.6), "hand-over: closed loop", "never", {"fw__state": 4}),
    (S2.replace("0.1", "1.0") + expect("hand_over", within_s=0.6), "hand-over: closed loop", "never", CLOSED),
    (OVERSHOOT, "hand-over: overshoot", "12.0 %", CLOSED | {"plant__speed_rpm": step((0, 1000), (1.0, 1120), (1.01, 1000))}),
    *((NO_REVERSE, "hand-over: no reverse motion", "-30 rpm", signals) for signals in REVERSED.values()),
    (SLOW_STOP, "stop: speed when the outputs go off", "1000 rpm", off_from(1.4) | {"plant__speed_rpm": 1000}),
    *((STOP, "stop: lowest speed", "-3.0 rpm", signals) for signals in BACKWARDS.values()),
    *((STOP, "stop: braking current", "2.80 A", signals) for signals in BRAKED.values()),
    (GENTLE_STOP, "stop: braking current", "0.60 A", off_from(1.2) | {"plant__i_q": -0.6}),
    (STOP, "stop: outputs off", "0.400 s", off_from(1.4)),
    (STOP, "stop: outputs off", "never", ON),
    (STOP, "stop: outputs off", "on again later", {"pwm__outputs_on": step((0, 21), (1.2, 0), (1.5, 21)),
                                                   "pwm__outputs_seen": step((0, 63), (1.2, 0), (1.5, 63))}),
    (OFF, "outputs off 1 .. 2 s", "1.5000 s", {"pwm__outputs_seen": step((0, 0), (1.5, 63), (1.5001, 0))}),
    (BUS, "bus voltage 0 .. 2 s", "24.00 .. 31.00 V", {"bus__voltage_v": step((0, 24), (1.0, 31), (1.0001, 24))}),
    (BUS, "bus voltage 0 .. 2 s", "19.00 .. 24.00 V", {"bus__voltage_v": step((0, 24), (1.0, 19), (1.0001, 24))}),
    (expect("signal", signal="fw.i_q_a", statistic="max", max=5), "fw.i_q_a max 0 .. 2 s", "7", PEAK),
    (expect("state", name="STOPPED", at_s=1.5), "state at 1.5 s", "CLOSED", STATES),
    (expect("state", name="STOPPED", from_s=0.5, to_s=1.5), "state 0.5 .. 1.5 s", "STOPPED CLOSED", STATES),
    (NEVER, "state never CLOSED 0 .. 2 s", "RAMP CLOSED", {"fw__state": step((0, 4), (1.0, 5), (1.0001, 4))}),
    (FAULT, "fault OVERVOLTAGE: raised", "STALL at 1.05", raised(1.05, 6)),
    (FAULT, "fault OVERVOLTAGE: raised", "OVERVOLTAGE at 1.2", raised(1.2)),
    (FAULT, "fault OVERVOLTAGE: raised", "OVERVOLTAGE at 0.9", raised(0.9)),
    (FAULT, "fault OVERVOLTAGE: raised", "no fault", {}),
    (FAULT, "fault OVERVOLTAGE: outputs off", "2 periods", raised(1.05, outputs_off_s=1.05 + 2 * PERIOD_S)),
    (FAULT, "fault OVERVOLTAGE: outputs off", "never", raised(1.05) | ON),
    (HARDWARE, "fault OVERCURRENT_HW: outputs off", "periods", raised(1.01, 1)), # after the code, not after the cause
    (KEPT, "fault OVERVOLTAGE: kept to 1.5 s", "NONE", raised(1.05, cleared_s=1.2)),
    (CLEARED, "fault OVERVOLTAGE: cleared from 1.5 s", "OVERVOLTAGE", raised(1.05)),
    (NO_FAULT, "no fault 0 .. 1 s", "STALL at 0.5", {"fw__fault": step((0, 0), (0.5, 6))}),
]


@pytest.mark.parametrize("text, row, got, signals", FAILS, ids=[f"{row}: {got}" for _, row, got, _ in FAILS])
def test_one_row_fails_with_its_name_and_number(text, row, got, signals):
    failed = [outcome for outcome in report.check(run(text, **signals)) if not outcome.ok]
    assert [outcome.row for outcome in failed] == [row] and got in failed[0].got, failed


@pytest.mark.parametrize("nominal_v, ok", [(12.0, False), (24.0, False), (30.0, True)])
def test_bus_voltage_above_regen_counts_from_the_headers_limit_in_proportion_above_24_v(nominal_v, ok):
    item = run(expect("bus_voltage", above_regen=True, max=3), bus__voltage_v=step((0, 24), (1.0, 30.5), (1.0001, 24)))
    item.params |= {"NOMINAL_BUS_V": nominal_v, "REGEN_LIMIT_V": 27.0}
    assert report.check(item)[0].ok == ok


@pytest.mark.parametrize("kind", ["no_warnings", "clean"])
def test_the_first_warning_is_named(kind):
    item = run(expect(kind))
    assert report.check(item)[-1].ok
    item.warnings = ["P1DTCON1: dead time is 0"]
    assert (report.check(item)[-1].ok, report.check(item)[-1].got) == (False, "P1DTCON1: dead time is 0")


@pytest.mark.parametrize("values, ok, got", [([1, 2, 9, 100], True, "8"), ([1, 1, 2, 100], False, "1")])
def test_a_firmware_variable_is_checked_over_its_elements(values, ok, got):
    item = run(expect("variable", name="SnapBuf1", count=3, statistic="span", min=5))
    item.variables = {"SnapBuf1": values}
    assert (report.check(item)[0].ok, report.check(item)[0].got) == (ok, got)


@pytest.mark.parametrize("text", [expect("no_fault", from_s=2.0), expect("outputs_off", from_s=2.0),
                                  expect("bus_voltage", max=30, from_s=2.0),
                                  expect("signal", signal="fw.i_q_a", statistic="max", max=5, from_s=2.0)])
def test_an_empty_window_never_holds(text):
    item = run(text)
    item.trace = item.trace.part(0.0, 1.0)
    assert not report.check(item)[0].ok


@pytest.mark.parametrize("order_rows, ok", [(0, False), (1, True)])
def test_an_order_that_takes_a_row_longer_is_not_outputs_on_again(order_rows, ok):
    later = {"pwm__outputs_on": step((0, 21), (1.2, 0)), "pwm__outputs_seen": step((0, 63), (1.2 + 3 * PERIOD_S, 0))}
    item = run(STOP, **later)
    item.order_rows = order_rows
    found = next(outcome for outcome in report.check(item) if outcome.row == "stop: outputs off")
    assert (found.ok, "on again later" in found.got) == (ok, not ok)


@pytest.mark.parametrize("sent, never, ok", [("foc33\r\nok run 1\r\n", False, True), ("foc33\r\n", False, False), ("foc33\r\n", True, True), ("ok run 1", True, False)])
def test_a_text_is_looked_for_in_what_the_serial_line_has_sent(sent, never, ok):
    done = run(expect("sent", text="ok run", never=never))
    done.sent = sent
    assert [outcome.ok for outcome in report.check(done)] == [ok]


def test_a_stop_that_coasts_may_be_fast_when_the_outputs_go_off():
    fast = run(SLOW_STOP, **off_from(1.1), plant__speed_rpm=step((0, 1000), (1.9, 0)))
    named = {outcome.row: outcome.ok for expectation in fast.scenario.expectations for outcome in expectation.check(fast)}
    assert not named["stop: speed when the outputs go off"]
    fast.params["STOP_MODE"] = 1.0
    rows = {outcome.row: outcome.ok for expectation in fast.scenario.expectations for outcome in expectation.check(fast)}
    assert "stop: speed when the outputs go off" not in rows and all(rows.values())
