"""The loop models agree with simulations step by step, and the chosen bandwidths keep their margins."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from pytest import approx
from support import MOTORS
from tune_support import HURST, designed, of

from tools.common import board_file, motor_file
from tuning import loops
from tuning.design import design
from tuning.design_result import spread_of
from tuning.loops import (SPEED_MARGINS, Gains, Plant, current_gains, current_grid, current_loop, full_rad_s, margins, observer_law, speed_gains,
                          speed_loop)

TS = 50e-6
MOTOR = Plant(2.67, 1.92e-3, 1.92e-3, 7.983e-3, 5, 5.5e-6, 15.3e-6)
BASE = Gains(0.0, 0.0, 0.0, 0.0, 0.0, 2000 / 32768, TS)
AT_1000_HZ = current_gains(MOTOR, 1000.0, BASE)
GRID, SPEED_GRID = current_grid(TS, 4000), np.geomspace(0.05, 1100.0, 4000)


def erpm(rpm: float) -> float:
    return rpm * 5 * 2 * math.pi / 60


# ---- current loop ----------------------------------------------------------------------------------------------------------
def current_swing(factor: float, omega: float, gains: Gains) -> float:
    """Growth of a disturbance: a winding in stator coordinates, integrated in small steps, with pulses that begin half a period late."""
    current, total, before, seen = 1.0 + 0.0j, 0.0j, 0.0j, []
    small = 40
    for n in range(400):
        measured = current * cmath.exp(-1j * omega * TS * n)
        vector = (-gains.kp_q * factor * measured + total) * cmath.exp(1j * omega * TS * (n + 1))
        total -= gains.ki * factor * measured
        for k in range(small):
            voltage = before if k < small // 2 else vector
            current += TS / small * (voltage - MOTOR.rs * current) / MOTOR.lq
        before = vector
        seen.append(abs(measured))
    return max(seen[300:]) / max(seen[100:200])


@pytest.mark.parametrize("rpm", [0.0, 5500.0])
def test_the_gain_margin_is_where_a_simulated_current_loop_begins_to_swing(rpm):
    factor = 10.0 ** (margins(GRID, current_loop(GRID, MOTOR, AT_1000_HZ, erpm(rpm))).gain_db / 20.0)
    assert current_swing(0.95 * factor, erpm(rpm), AT_1000_HZ) < 1.0 < current_swing(1.05 * factor, erpm(rpm), AT_1000_HZ)


def test_without_rotation_and_delay_the_crossover_is_the_bandwidth():
    slow, grid = Gains(0.0, 0.0, 0.0, 0.0, 0.0, 0.03, 1e-6), np.geomspace(10.0, 20000.0, 4000)
    found = margins(grid, current_loop(grid, MOTOR, current_gains(MOTOR, 300.0, slow), 0.0))
    assert found.crossover_hz == approx(300.0, abs=1.0)
    assert found.phase_deg == approx(90.0 - 300.0 * 1e-6 * 360.0, abs=0.2)


def test_the_delay_is_one_period_and_the_hold():
    """A vector acts from half a period after its sample for one period: a period on average, 18 degrees at 1 kHz."""
    found = margins(GRID, current_loop(GRID, MOTOR, AT_1000_HZ, 0.0))
    assert found.phase_deg == approx(90.0 - found.crossover_hz * TS * 360.0, abs=1.0)


def test_rotation_takes_margin_at_one_sign_of_frequency():
    gains, grid = current_gains(MOTOR, 400.0, BASE), current_grid(TS)
    turning, still = (margins(grid, current_loop(grid, MOTOR, gains, erpm(rpm))).phase_deg for rpm in (5500.0, 0.0))
    assert turning < still - 5.0


# ---- speed loop ------------------------------------------------------------------------------------------------------------
def rates(speed_hz: float, load_hz: float, rpm: float) -> dict[str, Gains]:
    return speed_gains(MOTOR, speed_hz, load_hz, AT_1000_HZ, erpm(rpm))


def speed_swing(factor: float, gains: Gains, true: Plant, omega: float) -> float:
    """Growth of a disturbance: shaft, current loop, estimator, observer and controller period by period, with the firmware's order of work.
    `factor` multiplies the speed that the observer sees."""
    h = math.exp(-true.rs * TS / (2 * true.lq))
    b = (1 - h) / true.rs
    gain, rate = MOTOR.kt * MOTOR.pole_pairs / MOTOR.inertia * 8 * TS, gains.rate
    friction_a = true.viscous * omega / true.pole_pairs / true.kt
    w, lag, e_d, e_q, seen = omega, 0.0, 0.0, true.psi * omega, []
    reference = last_i = i = load = friction_a
    before = i_sum = true.rs * i
    observed, angle = 0.0, 0.0 # deviations from omega
    for n in range(24000):
        brake = 2e-4 if 200 <= n < 260 else 0.0
        if n % 8 == 1: # asked for a period before, after that one's duties
            reference = load - gains.speed_kp * observed
        voltage = gains.kp_q * (reference - i) + i_sum
        i_sum += gains.ki * (reference - i)
        wrong = (true.rs - MOTOR.rs) * 0.5 * (i + last_i - 2 * friction_a) + (true.lq - MOTOR.lq) * (i - last_i) / TS
        e_q += gains.esdq * (true.psi * w * math.cos(lag) + wrong - e_q)
        e_d += gains.esdq * (-true.psi * w * math.sin(lag) - e_d)
        estimate = (e_q - e_d) / MOTOR.psi
        angle += factor * (estimate - omega * true.psi / MOTOR.psi) / 8
        if n % 8 == 7:
            predicted = observed + gain * (i - load)
            innovation, angle = angle - 0.5 * (observed + predicted), 0.0
            observed, load = predicted + 2 * rate * innovation, load - rate * rate / gain * innovation
        last_i = i
        i = h * h * i + b * voltage + h * b * before
        before = voltage
        lag += (w - estimate) * TS
        w += TS * true.pole_pairs / true.inertia * (true.kt * i - true.viscous * w / true.pole_pairs - brake)
        seen.append(abs(w - omega))
    return max(seen[16000:24000]) / max(max(seen[4000:12000]), 1e-9)


@pytest.mark.parametrize("rpm, true, rate", [
    (500.0, MOTOR, "quiet"), (500.0, MOTOR, "quick"), (2800.0, MOTOR, "loaded"), (250.0, MOTOR, "quick"),
    (500.0, replace(MOTOR, rs=0.76 * MOTOR.rs, ld=1.26 * MOTOR.ld, lq=1.26 * MOTOR.lq), "loaded")])
def test_the_gain_margin_is_where_a_simulated_speed_loop_begins_to_swing(rpm, true, rate):
    gains = rates(13.0, 110.0, rpm)[rate]
    factor = 10.0 ** (margins(SPEED_GRID, speed_loop(SPEED_GRID, true, MOTOR, gains, erpm(rpm))).gain_db / 20.0)
    assert factor > 1.1 and speed_swing(0.93 * factor, gains, true, erpm(rpm)) < 0.3
    assert speed_swing(1.1 * factor, gains, true, erpm(rpm)) > 0.5


def test_the_observer_and_its_controller_are_those_of_the_equations():
    """Without delays: per estimated speed (2 r k s + r^2 (s + k))/(s (s + k + 2 r)) over a; a current that the speed agrees with changes nothing."""
    hz, fine = np.array([3.0, 20.0, 60.0]), replace(AT_1000_HZ, period_s=5e-7)
    s, r, k, a = 2j * np.pi * hz, 2 * np.pi * 47.0, 2 * np.pi * 13.0, MOTOR.kt * MOTOR.pole_pairs / MOTOR.inertia
    per_speed, per_current = observer_law(hz, MOTOR, replace(fine, rate=r * fine.slow_s, speed_kp=k / a))
    alone = -(2 * r * k * s + r * r * (s + k)) / (s * (s + k + 2 * r)) / a
    assert per_speed / (1.0 - per_current) == approx(alone, rel=0.002)
    assert per_speed * a / s + per_current == approx(-k / s, rel=0.005), "the load stays what it is"


def test_rates_and_gain_are_those_of_the_header_and_fall_with_the_speed():
    d = of(HURST)
    speed_hz, load_hz = d.value("SPEED_BANDWIDTH_HZ"), d.value("LOAD_BANDWIDTH_HZ")
    full = rates(speed_hz, load_hz, 2800.0)
    electrical = 5 * 2 * math.pi / 60 # rad/s per rpm
    assert d.constant("speed_kp_q13").value == approx(full["quiet"].speed_kp * electrical, rel=1e-4)
    assert d.constant("speed_kp_fast_q13").value == approx(full["quick"].speed_kp * electrical, rel=1e-4)
    for name, gains in ((name.replace("quick", "fast"), gains) for name, gains in full.items()):
        assert gains.rate * 65536 == approx(d.constant(f"observer.{name}_q16").q_value, abs=1.0), name
    assert d.constant("observer.full_erpm").value * electrical == approx(full_rad_s(load_hz), rel=1e-6)
    half = rates(speed_hz, load_hz, 0.25 * full_rad_s(load_hz) / electrical)
    assert [half[name].rate / full[name].rate for name in full] == approx([0.25, 0.5, 0.5])
    assert [half[name].speed_kp / full[name].speed_kp for name in full] == approx([0.25, 0.5, 0.5])
    assert half["quiet"].esdq == approx(d.constant("fieldweak.esdq_per_erpm_q13").q_value / 8192 / 65536 * 0.25 * 60 / 2.7 * load_hz, rel=1e-3)


def test_an_error_of_the_estimator_s_resistance_costs_gain_margin_at_low_speed():
    hot = replace(MOTOR, rs=0.7 * MOTOR.rs)
    slow, fast = (margins(SPEED_GRID, speed_loop(SPEED_GRID, hot, MOTOR, rates(13.0, 110.0, rpm)["loaded"], erpm(rpm))).gain_db
                  for rpm in (300.0, 5000.0))
    assert slow < fast


# ---- margins ---------------------------------------------------------------------------------------------------------------
def delayed(crossover_hz: float) -> loops.Margins:
    """Margins of an integrator with a delay of 10 ms."""
    grid = np.geomspace(0.1, 1000.0, 4000)
    s = 2j * np.pi * grid
    return margins(grid, 2 * np.pi * crossover_hz / s * np.exp(-s * 0.01))


def test_an_integrator_with_a_delay_an_unstable_loop_and_the_least_of_several_crossovers():
    found = delayed(10.0)
    assert found.crossover_hz == approx(10.0, abs=0.01)
    assert found.phase_deg == approx(90.0 - 36.0, abs=0.1)
    assert found.gain_db == approx(20 * math.log10(2.5), abs=0.05)
    assert delayed(40.0).phase_deg < 0.0 and not delayed(40.0).enough
    grid = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    response = np.array([2.0, 0.5, 2.0, 0.5, 0.1]) * np.exp(-1j * np.radians([90.0, 90.0, 150.0, 150.0, 150.0]))
    assert margins(grid, response).phase_deg == approx(30.0, abs=1.0)


# ---- choice ----------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", MOTORS)
def test_every_motor_keeps_its_margins_and_a_loop_slower_than_the_slowest_rotation(name):
    d = of(name)
    turns_a_period = d.envelope.omega(d.value("MAXIMUM_SPEED_RPM")) * d.board.pwm_period_s / (2.0 * math.pi)
    least_deg = 60.0 if turns_a_period < 0.03 else 40.0 # beyond, rotation takes the rest, and the tuner warns
    assert d.current_loop.worst.phase_deg >= least_deg and d.current_loop.worst.gain_db >= 6.0, d.current_loop.worst_case
    for rate, (asked_deg, asked_db) in SPEED_MARGINS.items():
        worst, label = d.speed_loop.at_rates[rate]
        assert worst.phase_deg >= asked_deg and worst.gain_db >= asked_db, label
    for rpm in (d.value("MINIMUM_SPEED_RPM"), d.motor.rated_speed_rpm):
        electrical_hz = d.envelope.omega(rpm) / (2.0 * math.pi)
        share = min(1.0, d.envelope.omega(rpm) / full_rad_s(d.value("LOAD_BANDWIDTH_HZ")))
        assert share * d.value("SPEED_BANDWIDTH_HZ") <= 0.3201 * electrical_hz


def test_the_worst_case_is_no_better_than_any_corner_and_the_published_spread_is_among_them():
    d = of(HURST)
    gains = speed_gains(MOTOR, d.value("SPEED_BANDWIDTH_HZ"), d.value("LOAD_BANDWIDTH_HZ"), AT_1000_HZ, erpm(d.value("MINIMUM_SPEED_RPM")))["quiet"]
    grid = np.geomspace(0.05, 0.45 / (8 * TS), 400)
    corners = dict(loops.corners(MOTOR, spread_of(d.motor)))
    assert "R -25%, L +27%" in corners
    for name, plant in corners.items():
        found = margins(grid, speed_loop(grid, plant, MOTOR, gains, erpm(d.value("MINIMUM_SPEED_RPM"))))
        assert found.phase_deg >= d.speed_loop.at_rates["quiet"][0].phase_deg - 0.2, name


def test_the_load_observer_is_as_quick_as_filter_current_loop_and_margins_allow():
    """Time constants of 119 Hz, 1000 Hz and 0.4 ms together are those of 84 Hz; with 200 Hz, of 118 Hz, and an L that is 30 % off takes some."""
    slow = designed(more="[tune]\nKFILTER_ESDQ = 1200\n")
    assert (slow.value("LOAD_BANDWIDTH_HZ"), designed().value("LOAD_BANDWIDTH_HZ")) == (83.0, 105.0)
    assert slow.value("SPEED_BANDWIDTH_HZ") == approx(0.32 * 83.0 / 2.7, abs=0.01)
    more = designed(more="[tune]\nLOAD_BANDWIDTH_HZ = 135\n")
    assert not more.speed_loop.reached and "quick" in more.speed_loop.worst_case
    longer = made_with_period(100e-6)
    assert longer.value("LOAD_BANDWIDTH_HZ") * 100e-6 <= 0.0074 and longer.speed_loop.reached


def made_with_period(period_s: float):
    return design(motor_file.load(HURST), replace(board_file.load("mclv"), pwm_period_s=period_s))


def test_the_current_loop_stays_below_its_cap_unless_rotation_asks_for_more_and_each_axis_of_a_salient_motor_has_its_gain():
    d = of("linix_45zwn24_40")
    assert d.value("D_CURRCNTR_PTERM") / d.value("Q_CURRCNTR_PTERM") == approx(d.motor.ld_h / d.motor.lq_h, abs=1e-4)
    assert of(HURST).value("CURRENT_BANDWIDTH_HZ") == 1000.0 < of("maxon_ec45flat_30w_24v").value("CURRENT_BANDWIDTH_HZ")


def test_a_current_loop_that_rotation_costs_the_margin_is_not_slowed_down_for_a_few_degrees():
    """A small rotor with short L/R: 57.4 degrees at 53 Hz, 54.5 at 1000 Hz."""
    d = designed(("pole_pairs = { value = 5", "pole_pairs = { value = 4"), ("value = 2.67", "value = 3.0"), ("value = 1.92", "value = 0.6"),
                 ("value = 7.24", "value = 4.0"), ("value = 5.5e-6", "value = 8e-7"), ("value = 15.3e-6", "value = 1e-9"),
                 ("value = 0.004", "value = 0.0008"), ("value = 1.53", "value = 1.0"), ("value = 0.08", "value = 0.025"),
                 ("speed = { value = 2500", "speed = { value = 4000"), ("value = 5000", "value = 5500"), ("value = 2.75", "value = 1.5"))
    assert d.value("CURRENT_BANDWIDTH_HZ") == 1000.0
    assert any("CURRENT_BANDWIDTH_HZ = 1000: the current loop has 5" in warning for warning in d.warnings), d.warnings


def test_a_heavy_rotor_gets_a_slower_load_observer_and_a_large_innovation_asks_for_the_same_share_of_the_current():
    light, heavy = (loops.calm_load_bandwidth(100.0, acceleration, 5000.0, 50e-6) for acceleration in (0.1, 0.01))
    assert light == pytest.approx(10.0 * heavy)
    step = 2.0 * np.pi * heavy * 8 * 50e-6
    assert loops.FULL_RATIO * 100.0 * step / 0.01 == pytest.approx(loops.HEAVY_SHARE * 5000.0)


@pytest.mark.parametrize("ratio, share", [(10.0, 1.0), (1.9, 1.0), (1.9 * np.sqrt(0.75), 0.75), (0.5, 0.5), (0.0, 0.5)])
def test_the_speed_loop_is_slower_where_dead_time_hides_the_current_of_an_unloaded_motor(ratio, share):
    assert loops.speed_cap(ratio) == pytest.approx(share * loops.SPEED_CAP)
