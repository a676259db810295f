"""What a motor can do at best: the voltage and the current that a torque at a speed needs, and how soon a load stops it, from the plant's values."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tools.common.param_rows import slow_periods

ID_STEPS = 2001
BEYOND = "out of reach"
"""The verdict where a limit forbids what was asked."""


@dataclass(frozen=True)
class Need:
    """The steady state with the smallest voltage vector among those within the current limit."""

    id_a: float
    iq_a: float
    current_a: float
    """amplitude; without a state within the limit the smallest that gives the torque"""
    voltage_v: float | None
    """peak of a phase; None without a state within the current limit"""


def torque_per_amp(values: Mapping[str, float]) -> float:
    """N m of a q current of 1 A peak, without d current."""
    return 1.5 * values["motor.pole_pairs"] * values["motor.psi_vs"]


def least(values: Mapping[str, float], rpm: float, torque_nm: float, current_max_a: float) -> Need:
    """What `torque_nm` on the shaft needs at a speed. `values`: the plant's keys; friction comes on top, saturation is left out."""
    pairs, omega_m = values["motor.pole_pairs"], rpm * math.pi / 30.0
    omega, psi, l_d, l_q = pairs * omega_m, values["motor.psi_vs"], values["motor.ld_h"], values["motor.lq_h"]
    torque = torque_nm + values.get("mech.coulomb_nm", 0.0) + values.get("mech.viscous_nms", 0.0) * omega_m
    i_d = np.linspace(-current_max_a, 0.0, ID_STEPS)
    i_q = torque / (1.5 * pairs * (psi + (l_d - l_q) * i_d))
    length = np.hypot(i_d, i_q)
    allowed = np.flatnonzero(length <= current_max_a)
    if not len(allowed):
        best = int(np.argmin(length))
        return Need(float(i_d[best]), float(i_q[best]), float(length[best]), None)
    r_s = values["motor.rs_ohm"]
    voltage = np.hypot(r_s * i_d - omega * l_q * i_q, r_s * i_q + omega * (l_d * i_d + psi))
    best = allowed[int(np.argmin(voltage[allowed]))]
    return Need(float(i_d[best]), float(i_q[best]), float(length[best]), float(voltage[best]))


def least_current(values: Mapping[str, float], rpm: float, torque_nm: float, voltage_v: float) -> Need:
    """The steady state with the least current among those that make `torque_nm`, friction included, within a voltage; without one that with the
    smallest voltage. Torque and speed are positive."""
    pairs, psi, l_d, l_q, r_s = (values[f"motor.{key}"] for key in ("pole_pairs", "psi_vs", "ld_h", "lq_h", "rs_ohm"))
    omega = pairs * rpm * math.pi / 30.0
    i_d = np.linspace(-psi / l_d, 0.0, 5 * ID_STEPS)
    i_q = torque_nm / (1.5 * pairs * (psi + (l_d - l_q) * i_d))
    length, voltage = np.hypot(i_d, i_q), np.hypot(r_s * i_d - omega * l_q * i_q, r_s * i_q + omega * (l_d * i_d + psi))
    reached = voltage <= voltage_v
    best = int(np.argmin(np.where(reached, length, np.inf))) if reached.any() else int(np.argmin(voltage))
    return Need(float(i_d[best]), float(i_q[best]), float(length[best]), float(voltage[best]))


def out_of_reach(need: Need, current_max_a: float, voltage_v: float | None) -> str:
    """Which limit forbids it, with its numbers; "" if none does. `voltage_v`: radius of the voltage circle, None if it is not known."""
    if need.voltage_v is None:
        return f"needs {need.current_a:.2f} A of {current_max_a:.2f} A"
    if voltage_v is not None and need.voltage_v > voltage_v:
        return f"needs {need.voltage_v:.2f} V of {voltage_v:.2f} V (Id {need.id_a:.2f} A, Iq {need.iq_a:.2f} A)"
    return ""


def stops_s(values: Mapping[str, float], rpm: float, torque_nm: float) -> float:
    """How soon a load alone stops the rotor from a speed, with the friction that it has on the way."""
    omega_m = rpm * math.pi / 30.0
    torque = torque_nm + values.get("mech.coulomb_nm", 0.0) + 0.5 * values.get("mech.viscous_nms", 0.0) * omega_m
    return values["mech.inertia_kgm2"] * omega_m / torque if torque > 0.0 else math.inf


def answer_s(params: Mapping[str, float]) -> float:
    """Time constants of what lies between a load and the current that holds it: back-EMF filter, current loop, slow step, load observer."""
    filter_s = -params["LOOPTIME_SEC"] / math.log(1.0 - params["KFILTER_ESDQ"] / 32768.0)
    loops_s = sum(1.0 / (2.0 * math.pi * params[name]) for name in ("CURRENT_BANDWIDTH_HZ", "LOAD_BANDWIDTH_HZ"))
    return filter_s + loops_s + slow_periods(params["LOOPTIME_SEC"]) * params["LOOPTIME_SEC"]


def too_quick(stops: float, answers: float) -> str:
    """Why no drive with these loops keeps the rotor from stopping; "" if it could."""
    return f"the load stops the rotor in {1e3 * stops:.2f} ms, the drive answers in {1e3 * answers:.2f} ms" if stops < answers else ""
