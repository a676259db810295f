"""Identification on the virtual board: every motor within its limits, and what happens when something is wrong with motor, wires or shaft."""

import pytest
from pytest import approx
from support import MOTORS

from tools.bench import build
from tools.common import board_keys, motor_file, paths, workers
from tuning import identify, identify_result

HURST, LINIX = "hurst_dmb0224c10002", "linix_45zwn24_40"


def run(name: str = HURST, current_a: float | None = None, speed_rpm: float | None = None, **changes: float) -> identify_result.Identified:
    """One identification with changes to the plant; dots of keys are written as "__"."""
    values = board_keys.Values({key.replace("__", "."): value for key, value in changes.items()}, {})
    return identify.identify([identify.prepared(motor_file.load(name), "mclv", current_a, speed_rpm)], values)[0]


def made_up(rs_ohm: float, ld_h: float, lq_h: float, kphi: float, current_a: float, speed_rpm: float) -> identify_result.Identified:
    """Another motor in the Hurst's housing: 5 pole pairs."""
    psi_vs = kphi / (3.0 ** 0.5 * 1000.0 * 2.0 * 3.14159265 / 60.0 * 5.0)
    return run(HURST, current_a, speed_rpm, motor__rs_ohm=rs_ohm, motor__ld_h=ld_h, motor__lq_h=lq_h, motor__psi_vs=psi_vs,
               mech__coulomb_nm=0.001)


def ends(item: identify_result.Identified, result: str) -> bool:
    """Did it end so, without a fault and with the outputs off?"""
    return (item.result.name, item.measured.fault, item.measured.outputs_seen) == (result, "NONE", 0.0)


# ---- values ----------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("names", [(HURST, LINIX), pytest.param(set(MOTORS) - {HURST, LINIX}, marks=pytest.mark.release)], ids=["two", "the others"])
def test_every_motor_is_within_its_limits(names):
    items = identify.identify([identify.prepared(motor_file.load(name), None, None, None) for name in names], board_keys.Values())
    assert {item.motor.name: item.problems() for item in items} == {name: [] for name in names}


def failed(item: identify_result.Identified, *without: str) -> list[str]:
    """Values outside their limits, but for those whose names begin so."""
    return [row["name"] for row in item.rows() if row["verdict"] == "FAIL" and not row["name"].startswith(without)]


def test_long_time_constant_at_a_speed_that_the_measurement_does_not_reach():
    item = made_up(0.1, 1e-3, 1e-3, 5.0, 3.0, 1000.0)
    assert item.done and failed(item, "friction at rated speed") == [] # 2800 rpm; it has turned at 2000
    assert abs(item.rows()[-1]["error_percent"]) < 15.0


def test_less_back_emf_than_dead_time_takes_is_enough():
    item = made_up(0.1, 5e-5, 5e-5, 1.0, 3.0, 2000.0) # 1.15 V, and dead time takes 1.2 V
    assert item.done and item.problems() == []


def test_a_load_counts_as_friction_and_leaves_the_rest_as_it_is():
    item = run(load__constant_nm=0.02) # stops the rotor in 40 ms
    assert item.done and failed(item, "friction") == []
    assert all(abs(row["error_percent"]) < 25.0 for row in item.rows()[-2:])


@pytest.mark.parametrize("motor", [
    pytest.param((20.0, 20e-3, 20e-3, 60.0, 0.4, 120.0), id="high R and L, much flux", marks=pytest.mark.release),
    pytest.param((0.5, 5e-5, 5e-5, 3.0, 2.0, 1500.0), id="time constant of two periods", marks=pytest.mark.release),
    pytest.param((2.0, 1e-3, 2e-3, 8.0, 1.0, 1000.0), id="Lq twice Ld"),
    pytest.param((2.67, 1.92e-3, 1.92e-3, 7.24, 0.3, 1000.0), id="small current")])
def test_the_corners_of_the_range(motor):
    assert made_up(*motor).problems() == []


@pytest.mark.parametrize("changes", [
    # the rotor anywhere, heavy, light, without friction; noise, supply, bridge: several at once
    {"state__theta_e_deg": 0.0, "mech__inertia_kgm2": 5.5e-5}, {"state__theta_e_deg": 120.0, "mech__inertia_kgm2": 2e-6, "adc__noise_lsb": 2.0},
    {"state__theta_e_deg": 240.0, "mech__coulomb_nm": 0.0, "mech__viscous_nms": 0.0, "adc__noise_lsb": 0.0},
    {"load__constant_nm": 0.002, "supply__voltage_v": 20.0, "supply__resistance_ohm": 1.0},
    {"inverter__diode_v": 1.2, "inverter__turn_off_s": 4e-7, "shunt__offset_a_v": 0.05}], ids=str)
def test_what_does_not_matter(changes):
    assert run(**changes).problems() == []


def test_a_hot_motor_is_measured_hot():
    item = run(motor__temp_c=75.0)
    assert item.problems() == [] and item.winding_ohm > 3.1


# ---- troubles --------------------------------------------------------------------------------------------------------------
def test_a_blocked_shaft_has_a_resistance_and_no_kphi():
    item = run(load__locked=1.0)
    assert ends(item, "NOT_TURNING") and item.winding_ohm == approx(2.67, abs=0.03)
    assert item.measured.watch["Kphi_uV_per_krpm"] == 0


@pytest.mark.parametrize("result, motor", [
    *(("NOT_TURNING", {"name": LINIX, "load__locked": 1.0, "state__theta_e_deg": angle})
      for angle in (0.0, 45.0, 90.0, 200.0)),
    *(("NO_CURRENT", {"fault__open_phase": phase}) for phase in (1.0, 2.0, 3.0)), ("NOT_TURNING", {"load__constant_nm": 0.2}),
    ("CURRENT_NOT_REACHED", (20.0, 1e-2, 1e-2, 7.24, 1.0, 1000.0)), ("L_RANGE", (5.0, 0.4, 0.4, 7.24, 1.0, 1000.0)),
    ("VOLTAGE_LIMIT", (2.67, 1.92e-3, 1.92e-3, 30.0, 1.0, 1000.0))], ids=str)
def test_what_ends_otherwise(result, motor):
    assert ends(run(**motor) if isinstance(motor, dict) else made_up(*motor), result)


def test_s2_in_every_step_stops_within_its_debouncing():
    undisturbed = run()
    began_s = undisturbed.measured.steps[0][0]
    spans = list(zip(undisturbed.measured.steps[1:], undisturbed.measured.steps[2:]))
    presses = [0.5 * (at_s + until_s) - began_s for (at_s, _), (until_s, _) in spans]
    library = paths.ROOT / "build" / f"host-{build.variant_name([identify_result.MODE], identify.HEADERS / HURST)}" / "libvboard.so"
    jobs = [identify.Job(library, undisturbed.values, stop_after_s=at_s) for at_s in presses]
    for at_s, ((_, step), _), measured in zip(presses, spans, workers.run_all(jobs, identify.measure, lambda seconds: None)):
        assert identify_result.results()[measured.watch["result"]].name == "STOPPED", identify_result.step_names()[step]
        assert (measured.fault, measured.outputs_seen) == ("NONE", 0.0)
        assert step in [number for _, number in measured.steps] and measured.steps[-1][0] - began_s - at_s < 0.035
