"""A design while it grows and when it is finished: motor, board, every parameter with its reason, loops, start and warnings."""

import functools
import math
from dataclasses import dataclass, field, replace
from decimal import Decimal

from tools.common import paths
from tools.common.board_file import BoardFile
from tools.common.motor_file import Motor
from tools.common.param_rows import parameters

from . import constants, limits, loops, start
from .constants import Constant, number_of
from .limits import Envelope


@dataclass(frozen=True)
class Choice:
    """One parameter: the text that stands in the header, and why."""

    name: str
    text: str
    why: str


@dataclass(frozen=True)
class Scales:
    """Numbers that the scaling headers make of motor and board."""

    invkfi: float
    """counts of 1/Kphi"""
    ampere_per_volt: float
    """I0/U0"""
    pterm_per_hz: float
    iterm_per_hz: float
    speed_pterm_per_hz: float
    acceleration: float
    """of a count of current, counts of speed in a slow step"""
    large_counts: float
    """innovation that the load observer calls large, counts of speed"""
    count_a: float
    """a count of current"""
    lost_counts: float
    """current that dead time loses, in counts of count_a"""
    speed_unit: float
    """electrical rpm of a count of speed"""


@dataclass
class Design:
    """A finished design."""

    motor: Motor
    board: BoardFile
    envelope: Envelope
    bridge_ohm: float = 0.0
    """of BRIDGE_RS_OHM, in the motor's R"""
    choices: dict[str, Choice] = field(default_factory=dict)
    constants: list[Constant] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    start_risks: list[str] = field(default_factory=list)
    """those of the warnings that tell why the motor may not start"""
    current_loop: loops.LoopDesign | None = None
    speed_loop: loops.LoopDesign | None = None
    start_up: start.StartDesign | None = None
    tables_from: str = ""
    """where the field-weakening tables come from"""
    tuned_by_machine: bool = False
    calm_hz: float = 0.0
    """speed bandwidth that the lowest speed and the load observer allow"""
    gains: loops.Gains | None = None
    """of the current loops"""

    @functools.cached_property
    def scales(self) -> Scales:
        """What the header makes of motor and board; asked for when their parameters are chosen."""
        top_rpm = self.motor.tune.get("MAXIMUM_SPEED_RPM", maximum_speed(self)[0])
        return Scales(*constants.evaluate(self.params | {"CURRENT_BANDWIDTH_HZ": "1", "SPEED_BANDWIDTH_HZ": "1", "MAXIMUM_SPEED_RPM": plain(top_rpm)},
                                          "PARAM_INVKFI", "PARAM_IU", "Q_CURRCNTR_PTERM", "Q_CURRCNTR_ITERM", "SPEEDCNTR_PTERM", "PARAM_ACCEL",
                                          "SPEED_COUNTS(PARAM_LARGE_ERPM)", "4.0F * PARAM_F(NORM_CURRENT_CONST)", "PARAM_LOST_CURRENT_Q13", "SPEED_UNIT"))

    @property
    def params(self) -> dict[str, str]:
        """Every define by name, as text."""
        return {name: choice.text for name, choice in self.choices.items()}

    def value(self, name: str) -> float:
        return number_of(self.choices[name].text)

    @property
    def inertia_kgm2(self) -> float:
        """Rotor and load."""
        return self.motor.inertia_kgm2 + self.motor.load_inertia_kgm2

    @property
    def nominal_erpm(self) -> float:
        """Where NOMINAL_SPEED_RPM ends."""
        return limits.LARGEST_NOMINAL_ERPM * self.scales.speed_unit

    def put(self, name: str, text: str, why: str) -> None:
        """Sets a parameter, unless the motor file's [tune] says otherwise."""
        if name in self.motor.tune:
            text, why = plain(self.motor.tune[name]), "the motor file's [tune]"
        self.choices[name] = Choice(name, text, why)

    @property
    def plant(self) -> loops.Plant:
        m = self.motor
        return loops.Plant(m.rs_ohm, m.ld_h, m.lq_h, m.psi_vs, m.pole_pairs, self.inertia_kgm2, m.viscous_nms)

    @property
    def filter_gains(self) -> loops.Gains:
        """The back-EMF's filter; no controllers yet."""
        return loops.Gains(0.0, 0.0, 0.0, 0.0, 0.0, self.value("KFILTER_ESDQ") / 32768.0, self.board.pwm_period_s)

    def current_loop_at(self, top_rpm: float) -> loops.LoopDesign:
        """The current loops of this motor with a top speed."""
        low, high = range_of("CURRENT_BANDWIDTH_HZ")
        largest = min(high, 0.98 / self.scales.pterm_per_hz, 15.7 / self.scales.iterm_per_hz)
        return loops.design_current(self.plant, spread_of(self.motor), self.filter_gains, self.envelope.omega(top_rpm), largest, low,
                                    self.motor.tune.get("CURRENT_BANDWIDTH_HZ"))

    def start_of(self, motor: Motor, maximum_a: float) -> start.StartDesign:
        """The start of this motor, or of a changed one, with current loops of this bandwidth."""
        plant = replace(self.plant, ld=motor.ld_h, lq=motor.lq_h)
        gains = loops.current_gains(plant, self.value("CURRENT_BANDWIDTH_HZ"), self.filter_gains)
        return start.design_start(motor, self.board, plant, gains, maximum_a, self.value("OVER_CURRENT_THRESHOLD_A"), self.value("NOMINAL_SPEED_RPM"),
                                  motor.tune)

    def constant(self, name: str) -> Constant:
        return next(item for item in self.constants if item.name == name)

    def where(self, key: str) -> str:
        """Line of the motor file that a message is about."""
        quantity = self.motor.quantities.get(key) or self.motor.quantities.get(f"{key}_q")
        return quantity.where if quantity else str(paths.shown(self.motor.path))


def plain(value: float, digits: int = 6) -> str:
    """A decimal number without exponent."""
    return format(Decimal(f"{value:.{digits}g}"), "f")


def real(value: float, digits: int = 6) -> str:
    """The same with a point, so that it reads as a physical value."""
    text = plain(value, digits)
    return text if "." in text else text + ".0"


def short(value: float, digits: int = 4) -> str:
    """With an exponent where that is shorter: 5.5e-6."""
    text = f"{value:.{digits}g}"
    mantissa, sign, exponent = text.partition("e")
    return f"{mantissa}e{int(exponent)}" if sign else text


def range_of(name: str) -> tuple[float, float]:
    """Smallest and largest value of a parameter."""
    row = parameters()[name]
    return float(row.low), float(row.high)


BRIDGE_COUNTS = 0.1
"""Less than this share of the winding is within what R may be off."""


def with_bridge(motor: Motor, board: BoardFile) -> tuple[Motor, float]:
    """The motor as the drive meets it, with the bridge's resistance in its own where that counts, and that resistance."""
    bridge_ohm = board.rds_on_ohm + 0.5 * board.shunt_ohm
    if bridge_ohm <= BRIDGE_COUNTS * motor.rs_ohm:
        return motor, 0.0
    spread = {key: tuple(ohm + bridge_ohm for ohm in ends) if key == "rs_ohm" else ends for key, ends in motor.spread.items()}
    return replace(motor, rs_ohm=motor.rs_ohm + bridge_ohm, spread=spread), bridge_ohm


def spread_of(motor: Motor) -> dict[str, tuple[float, float]]:
    """The motor file's published spread as factors."""
    found = {}
    for key, name, nominal in (("rs_ohm", "rs", motor.rs_ohm), ("ls_h", "ls", motor.lq_h), ("kphi_v_per_krpm", "psi", motor.kphi_v_per_krpm)):
        if key in motor.spread:
            low, high = motor.spread[key]
            found[name] = (low / nominal, high / nominal)
    return found


def maximum_speed(d: Design) -> tuple[float, str]:
    """MAXIMUM_SPEED_RPM, and why."""
    m = d.motor
    most_rpm = math.floor(limits.largest_erpm(d.board.pwm_period_s) / m.pole_pairs)
    reachable = limits.digits_down(max(d.envelope.highest_speed(0.0, limits.REACH_SHARE), 1.0), 3)
    maximum = min(m.maximum_speed_rpm, most_rpm, max(reachable, m.rated_speed_rpm))
    return math.floor(maximum), ("motor file's maximum_speed" if maximum == m.maximum_speed_rpm else
                                 "electrical speed's end" if maximum == most_rpm else "what field weakening reaches without load")
