"""The loop models agree with simulations step by step, and the chosen bandwidths keep their margins."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from pytest import approx
from tune_support import HURST, designed, motors, of

from tools.common import board_file, motor_file
from tuning import loops
from tuning.design import _spread, design
from tuning.loops import Gains, Plant, current_gains, current_grid, current_loop, margins, speed_gains, speed_loop

TS = 50e-6
MOTOR = Plant(2.67, 1.92e-3, 1.92e-3, 7.983e-3, 5, 5.5e-6, 15.3e-6)
BASE = Gains(0.0, 0.0, 0.0, 0.0, 0.0, 1200 / 32768, 748 / 32768, TS)
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
    slow, grid = Gains(0.0, 0.0, 0.0, 0.0, 0.0, 0.03, 0.02, 1e-6), np.geomspace(10.0, 20000.0, 4000)
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
def speed_swing(factor: float, gains: Gains, true: Plant, omega: float) -> float:
    """Growth of a disturbance: shaft, current loop, estimator and both filters period by period, with the firmware's order of work."""
    h = math.exp(-true.rs * TS / (2 * true.lq))
    b = (1 - h) / true.rs
    w, lag, e_d, e_q, slow, seen = omega, 0.0, 0.0, true.psi * omega, omega, []
    reference = total = last_i = i = true.viscous * omega / true.pole_pairs / true.kt
    before = i_sum = true.rs * total
    for n in range(24000):
        load = 2e-4 if 200 <= n < 260 else 0.0
        if n % 8 == 0:
            error = omega - slow
            reference = total + factor * gains.speed_kp * error
            total += factor * gains.speed_ki * error
        voltage = gains.kp_q * (reference - i) + i_sum
        i_sum += gains.ki * (reference - i)
        wrong = (true.rs - MOTOR.rs) * 0.5 * (i + last_i) + (true.lq - MOTOR.lq) * (i - last_i) / TS
        e_q += gains.esdq * (true.psi * w * math.cos(lag) + wrong - e_q)
        e_d += gains.esdq * (-true.psi * w * math.sin(lag) - e_d)
        estimate = (e_q - e_d) / MOTOR.psi
        slow += gains.velestim * (estimate - slow)
        last_i = i
        i = h * h * i + b * voltage + h * b * before
        before = voltage
        lag += (w - estimate) * TS
        w += TS * true.pole_pairs / true.inertia * (true.kt * i - true.viscous * w / true.pole_pairs - load)
        seen.append(abs(w - omega))
    return max(seen[16000:24000]) / max(max(seen[4000:12000]), 1e-9)


@pytest.mark.parametrize("rpm, true", [
    (500.0, MOTOR), (2800.0, MOTOR), (500.0, replace(MOTOR, rs=0.76 * MOTOR.rs, ld=1.26 * MOTOR.ld, lq=1.26 * MOTOR.lq))])
def test_the_gain_margin_is_where_a_simulated_speed_loop_begins_to_swing(rpm, true):
    gains = speed_gains(MOTOR, 15.0, AT_1000_HZ)
    factor = 10.0 ** (margins(SPEED_GRID, speed_loop(SPEED_GRID, true, MOTOR, gains, erpm(rpm))).gain_db / 20.0)
    assert speed_swing(0.95 * factor, gains, true, erpm(rpm)) < 0.1
    assert speed_swing(1.1 * factor, gains, true, erpm(rpm)) > 0.5


def test_far_above_the_filters_the_phase_is_that_of_all_delays():
    """Hold over 8 periods (4 on average), one period of reading, half of the back-EMF's age, and the current loop's own."""
    gains, hz = replace(speed_gains(MOTOR, 15.0, AT_1000_HZ), esdq=1.0, velestim=1.0, speed_ki=0.0), np.array([60.0])
    inner = current_loop(hz, MOTOR, gains, 0.0)
    found = np.degrees(np.angle(speed_loop(hz, MOTOR, MOTOR, gains, erpm(2800.0)) / (inner / (1.0 + inner))))[0]
    shaft = -math.degrees(math.atan2(2 * math.pi * 60.0 * MOTOR.inertia, MOTOR.viscous))
    assert found == approx(shaft - 360.0 * 60.0 * (4.0 + 1.5) * TS, abs=0.05)


def test_the_bandwidth_is_the_crossover_and_gains_are_those_of_the_header():
    loop = speed_loop(SPEED_GRID, MOTOR, MOTOR, speed_gains(MOTOR, 5.0, AT_1000_HZ), erpm(2800.0))
    assert margins(SPEED_GRID, loop).crossover_hz == approx(5.1, abs=0.2)
    d = of(HURST)
    gains = speed_gains(MOTOR, d.value("SPEED_BANDWIDTH_HZ"), AT_1000_HZ)
    electrical = 5 * 2 * math.pi / 60 # rad/s per rpm
    assert d.constant("pi_speed.kp").value == approx(gains.speed_kp * electrical, rel=1e-4)
    assert d.constant("pi_speed.ki").value == approx(gains.speed_ki * electrical / (8 * TS), rel=1e-4)


def test_an_error_of_the_estimator_s_resistance_costs_gain_margin_at_low_speed():
    gains, hot = speed_gains(MOTOR, 15.0, AT_1000_HZ), replace(MOTOR, rs=1.3 * MOTOR.rs)
    slow, fast = (margins(SPEED_GRID, speed_loop(SPEED_GRID, hot, MOTOR, gains, erpm(rpm))).gain_db for rpm in (300.0, 5000.0))
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
@pytest.mark.parametrize("name", motors())
def test_every_motor_keeps_its_margins_over_its_parameter_set_and_a_loop_slower_than_the_slowest_rotation(name):
    d = of(name)
    for loop in (d.current_loop, d.speed_loop):
        assert loop.worst.phase_deg >= 60.0 and loop.worst.gain_db >= 6.0, loop.worst_case
    assert d.value("SPEED_BANDWIDTH_HZ") <= 0.3125 * d.value("MINIMUM_SPEED_RPM") * d.motor.pole_pairs / 60.0


def test_the_worst_case_is_no_better_than_any_corner_and_the_published_spread_is_among_them():
    d = of(HURST)
    gains = speed_gains(MOTOR, d.value("SPEED_BANDWIDTH_HZ"), current_gains(MOTOR, d.value("CURRENT_BANDWIDTH_HZ"), BASE))
    grid = np.geomspace(0.05, 0.45 / (8 * TS), 400)
    corners = dict(loops.corners(MOTOR, _spread(d.motor)))
    assert "R -24%, L +26%" in corners
    for name, plant in corners.items():
        found = margins(grid, speed_loop(grid, plant, MOTOR, gains, erpm(d.value("MINIMUM_SPEED_RPM"))))
        assert found.phase_deg >= d.speed_loop.worst.phase_deg - 0.2, name


def test_the_next_larger_speed_bandwidth_would_not_keep_the_margin():
    motor, board = motor_file.load(HURST), board_file.load("mclv")
    d = design(replace(motor, tune=motor.tune | {"MINIMUM_SPEED_RPM": 1000.0}), board)
    more = d.value("SPEED_BANDWIDTH_HZ") + 0.5
    assert d.speed_loop.reached
    assert not design(replace(d.motor, tune=d.motor.tune | {"SPEED_BANDWIDTH_HZ": more}), board).speed_loop.reached


def test_the_speed_loop_is_as_slow_as_rotation_asks_but_fast_enough_for_a_load_that_grows():
    """Torque T/s against the integral of the speed controller: error = T/s / (Kt Ki)."""
    calm = designed(("value = 5.5e-6", "value = 2e-5"), more="[tune]\nMINIMUM_SPEED_RPM = 300\n")
    assert calm.value("SPEED_BANDWIDTH_HZ") == 7.81
    d = designed(("value = 5.5e-6", "value = 3e-6"), more="[tune]\nMINIMUM_SPEED_RPM = 300\n")
    assert d.value("SPEED_BANDWIDTH_HZ") > 0.3125 * 300 * 5 / 60
    gains = speed_gains(replace(MOTOR, inertia=3e-6), d.loaded_hz, BASE)
    per_second = gains.speed_ki / (8 * TS) * 5 * MOTOR.kt # N m/s per mechanical rad/s
    assert 0.08 / per_second == approx(0.18 * 300 * math.pi / 30, abs=0.1)


def test_the_current_loop_stays_below_its_cap_unless_rotation_asks_for_more_and_each_axis_of_a_salient_motor_has_its_gain():
    d = of("linix_45zwn24_40")
    assert d.value("D_CURRCNTR_PTERM") / d.value("Q_CURRCNTR_PTERM") == approx(d.motor.ld_h / d.motor.lq_h, abs=1e-4)
    assert of(HURST).value("CURRENT_BANDWIDTH_HZ") == 1000.0 < of("maxon_ec45flat_30w_24v").value("CURRENT_BANDWIDTH_HZ")


def test_a_current_loop_that_rotation_costs_the_margin_is_not_slowed_down_for_a_few_degrees():
    """A small rotor with short L/R: 57.4 degrees at 53 Hz, 54.5 at 1000 Hz."""
    d = designed(("pole_pairs = { value = 5", "pole_pairs = { value = 4"), ("value = 2.67", "value = 3.0"), ("value = 1.92", "value = 0.6"),
                 ("value = 7.24", "value = 4.0"), ("value = 5.5e-6", "value = 1.5e-7"), ("value = 15.3e-6", "value = 1e-9"),
                 ("value = 0.004", "value = 0.0008"), ("value = 1.53", "value = 1.0"), ("value = 0.08", "value = 0.025"),
                 ("speed = { value = 2500", "speed = { value = 4000"), ("value = 5000", "value = 5500"), ("value = 2.75", "value = 1.5"))
    assert d.value("CURRENT_BANDWIDTH_HZ") == 1000.0 and d.speed_loop.reached
    assert any("CURRENT_BANDWIDTH_HZ = 1000: the current loop has 5" in warning for warning in d.warnings), d.warnings
