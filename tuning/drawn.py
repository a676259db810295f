"""Motors and boards drawn by number: physically sensible, over the whole range that the project promises, as files that a user can open.

What belongs together follows from what a motor is: the flux from voltage and rated speed, the current from the share of the voltage that the
resistance may take, the inductance from the electrical time constant, the inertia from the time to rated speed, friction from the rated torque.
The board is one that an engineer would build for it, or, in one case of five, one that lay in the drawer.
"""

import math
import random
from dataclasses import dataclass
from pathlib import Path

from .limits import RPM, UNIT_ERPM, digits_down

SQRT3 = math.sqrt(3.0)
SUPPLY_V = (8.0, 60.0)
SPEED_RPM = (50.0, 30000.0)
R_OHM, L_H = (0.02, 10.0), (15e-6, 10e-3)
"""What is promised, per phase of the star."""
POLE_PAIRS = (1, 2, 2, 3, 4, 4, 5, 5, 7, 7, 8, 10, 11, 14, 15, 20, 21)
SHUNTS_MOHM = (0.5, 1, 2, 3, 5, 10, 20, 25, 50, 100, 200, 330, 500)
GAINS = (5, 8, 10, 15, 20, 25, 40, 50, 75, 100)
SUPPLIES_V = (8, 9, 11.1, 12, 12, 14.8, 18, 24, 24, 24, 28, 36, 36, 42, 48, 48, 55, 60)
PERIODS_US = (50, 50, 50, 50, 40, 62.5, 80, 100, 125)
MOST_A = 20.0
"""The largest current of the firmware's number format."""


@dataclass(frozen=True)
class Case:
    """One drawn motor with its board: the texts of the two files."""

    name: str
    motor: str
    board: str

    def write(self, folder: Path) -> tuple[Path, Path]:
        """The two files, named so that two cases never share a folder of results."""
        folder.mkdir(parents=True, exist_ok=True)
        motor, board = folder / f"{self.name}.toml", folder / f"{self.name}_board.toml"
        motor.write_text(self.motor, encoding="utf-8")
        board.write_text(self.board, encoding="utf-8")
        return motor, board


def _log(random_: random.Random, low: float, high: float) -> float:
    return math.exp(random_.uniform(math.log(low), math.log(high)))


def _rounded(value: float, digits: int = 3) -> float:
    return float(f"{value:.{digits}g}")


def draw(seed: int, number: int) -> Case:
    """The case with this number: always the same."""
    r = random.Random(f"{seed}/{number}")
    name = f"drawn_{seed}_{number:04d}"
    while (drawn := _motor(r)) is None:
        pass
    return Case(name, _motor_text(name, drawn), _board_text(name, r, drawn))


def _motor(r: random.Random) -> dict[str, float] | None:
    """A motor in SI, star phase, peak values; None where the draw left what is promised."""
    volt, pairs = float(r.choice(SUPPLIES_V)), r.choice(POLE_PAIRS)
    erpm = _log(r, max(600.0, SPEED_RPM[0] * pairs), UNIT_ERPM * 0.95)
    rpm = digits_down(erpm / pairs, 2)
    drop = _log(r, 0.04, 0.3) # of the voltage, for the resistance at rated current
    ohm = _log(r, *R_OHM)
    ampere = volt / SQRT3 * drop / ohm
    if ampere > 0.9 * MOST_A:
        ampere = _log(r, 2.0, 0.9 * MOST_A)
        drop = ampere * ohm * SQRT3 / volt
    flux_share = r.uniform(0.62, 0.95) * (1.0 - 0.6 * drop) # line-to-line back-EMF at rated speed, of the supply
    omega = rpm * RPM * pairs
    psi = flux_share * 0.9 * volt / SQRT3 / omega
    swing = min(0.6, 2.0 * (1.0 - flux_share)) # L I over psi
    henry = min(_log(r, 1.5e-4, 4e-3) * ohm, swing * psi / ampere)
    torque = 1.5 * pairs * psi * ampere
    rise_s = _log(r, 0.004, 0.4)
    ripple = volt * 40e-6 / 6.0 / henry # peak to peak at the shortest period
    if ripple > 0.8 * ampere:
        return None
    if not (L_H[0] <= henry <= L_H[1] and SPEED_RPM[0] <= rpm <= SPEED_RPM[1] and 0.05 <= ampere and 2.5e-5 <= henry / ohm):
        return None
    coulomb, viscous = _log(r, 0.02, 0.08) * torque, _log(r, 0.005, 0.06) * torque / (rpm * RPM)
    rated = 0.97 * torque - coulomb - viscous * rpm * RPM
    return {"volt": volt, "pairs": pairs, "rpm": rpm, "ohm": ohm, "henry": henry, "psi": psi, "ampere": ampere, "torque": rated,
            "inertia": rise_s * rated / (rpm * RPM), "coulomb": coulomb, "viscous": viscous, "salience": r.choice((1.0, 1.0, 1.0, 1.0, 1.0, r.uniform(1.05, 1.8))),
            "top": min(rpm * r.choice((1.0, 1.2, 1.5, 2.0)), SPEED_RPM[1]), "most": r.choice((1.0, 1.5, 2.0)),
            "load": r.choice((0.0, 0.0, 0.0, _log(r, 0.1, 3.0)))}


def _number(value: float, unit: str) -> str:
    return f"{{ value = {_rounded(value, 4):g}, unit = \"{unit}\", source = \"drawn\" }}"


def _motor_text(name: str, m: dict[str, float]) -> str:
    kphi = SQRT3 * m["psi"] * m["pairs"] * 1000.0 * RPM
    lines = [f"# Drawn by: make anymotor; {name}", f"title = \"{m['volt']:g} V, {m['rpm']:g} rpm, {m['pairs']} pole pairs ({name})\"", "connection = \"Y\"", "",
             "[electrical]", f"pole_pairs = {{ value = {m['pairs']}, source = \"drawn\" }}", f"resistance = {_number(2.0 * m['ohm'], 'ohm line-to-line')}"]
    if m["salience"] == 1.0:
        lines.append(f"inductance = {_number(2e3 * m['henry'], 'mH line-to-line')}")
    else:
        lines += [f"inductance_d = {_number(2e3 * m['henry'] / m['salience'], 'mH line-to-line')}", f"inductance_q = {_number(2e3 * m['henry'], 'mH line-to-line')}"]
    lines += [f"kphi = {_number(kphi, 'V peak line-to-line/krpm')}", "", "[mechanical]", f"inertia = {_number(m['inertia'], 'kg m2')}",
              f"viscous_friction = {_number(m['viscous'], 'N m s')}", f"coulomb_friction = {_number(m['coulomb'] * 1e3, 'mN m')}", "",
              "[rating]", f"voltage = {_number(m['volt'], 'V')}", f"current = {_number(m['ampere'], 'A peak')}", f"torque = {_number(m['torque'], 'N m')}",
              f"speed = {_number(m['rpm'], 'rpm')}", f"maximum_speed = {_number(m['top'], 'rpm')}",
              f"maximum_current = {_number(m['most'] * m['ampere'], 'A peak')}"]
    if m["load"]:
        lines += ["", "[load]", f"inertia = {_number(m['load'] * m['inertia'], 'kg m2')}"]
    return "\n".join(lines) + "\n"


def _board_text(name: str, r: random.Random, m: dict[str, float]) -> str:
    """Shunt and gain for one and a half to four times the rated current, a divider for one and a half to three times the supply."""
    drawer = r.random() < 0.2
    wanted_a = m["ampere"] * m["most"] * (_log(r, 1.0, 8.0) if drawer else r.uniform(1.35, 2.2))
    shunt, gain = min(((s, g) for s in SHUNTS_MOHM for g in GAINS if 1.65e3 / s / g >= wanted_a * 0.999 and s * 1e-3 * wanted_a < 0.25),
                      key=lambda pair: (1.65e3 / pair[0] / pair[1], r.random()), default=(0.5, 100))
    volt = m["volt"]
    divider = _rounded(volt * (_log(r, 1.6, 6.0) if drawer else r.uniform(1.55, 2.5)) / 3.3, 3)
    over, regen = _rounded(volt * r.uniform(1.3, 1.45) + 1.0), _rounded(volt * r.uniform(1.08, 1.14) + 0.3)
    period = r.choice([p for p in PERIODS_US if volt * p * 1e-6 / 6.0 / m["henry"] <= 0.8 * m["ampere"]])
    window = _rounded(r.uniform(1.5, 2.2), 2)
    rows = {"supply": {"voltage": (volt, "V"), "resistance": (_log(r, 0.02, 0.1) * min(1.0, volt / SQRT3 / m["ampere"] / 2.0), "ohm")},
            "bus": {"capacitance": (_rounded(_log(r, 470, 2200) * max(1.0, m["ampere"] / 4.0), 2), "uF"), "load": (r.choice((20, 50, 100)), "mA")},
            "inverter": {"rds_on": (_log(r, 1.5, 30) * min(1.0, 3.0 / m["ampere"] + 0.1), "mohm"), "diode_voltage": (0.8, "V"),
                         "trip_current": (min(1.65e3 / shunt / gain * 1.6, 100.0), "A")},
            "shunt": {"resistance": (shunt, "mohm"), "amplifier_gain": (gain, "1"), "reference": (1.65, "V"), "settle": (_rounded(r.uniform(0.3, 1.0), 2), "us")},
            "adc": {"full_scale": (3.3, "V"), "bus_divider": (divider, "1"), "noise": (0.5, "LSB")},
            "pwm": {"period": (period, "us"), "dead_time": (_rounded(r.uniform(0.5, min(2.0, window + 0.4)), 2), "us"), "sample_window": (window, "us")},
            "limits": {"over_voltage": (over, "V"), "under_voltage": (_rounded(volt * r.uniform(0.5, 0.7), 2), "V"), "regen": (regen, "V")}}
    extra = {"supply": f"sinks = {r.choice(('false', 'false', 'true'))}", "shunt": f"inverted = {r.choice(('false', 'true'))}", "adc": "bits = { value = 10, source = \"dsPIC33FJ32MC204\" }"}
    lines = [f"# Drawn by: make anymotor; {name}", f"title = \"{volt:g} V, {1.65e3 / shunt / gain:.3g} A range ({name})\""]
    for table, keys in rows.items():
        lines += ["", f"[{table}]", *(f"{key} = {_number(*pair)}" for key, pair in keys.items()), *([extra[table]] if table in extra else [])]
    return "\n".join(lines) + "\n"
