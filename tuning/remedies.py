"""What to change where something does not fit, and to which value: found by the tuner's own equations, so that the change is enough.

All ways are written alike: "lower [table] key to VALUE UNIT", the supply voltage and the rated speed by these names; two changes that are needed
together have an "and" between them, ways of which each is enough an "or"."""

from collections.abc import Callable
from dataclasses import replace

from tools.common.board_file import TABLES, BoardFile
from tools.common.motor_file import Motor
from tools.common.param_rows import parameters

from . import limits
from .limits import Envelope

MOST_SUPPLY_V = TABLES["supply"]["voltage"].kind.maximum
MOST_CURRENT_A = float(parameters()["MAXIMUM_CURRENT_A"].high)
LEAST_GAIN = TABLES["shunt"]["amplifier_gain"].kind.minimum
SLOWEST_SHARE = 0.05
"""Of the rated speed: to lower that further is no remedy but another motor."""


def either(*ways: str) -> str:
    """The ways that there are."""
    return ", or ".join(filter(None, ways))


def least_supply(envelope: Envelope, board: BoardFile, holds: Callable[[Envelope], bool]) -> float | None:
    """The lowest supply voltage with which `holds`, to three digits; None if even the highest that the firmware takes is not enough."""
    def with_supply(volt: float) -> bool:
        return holds(replace(envelope, circle_v=envelope.circle_v * volt / board.nominal_bus_v))
    if not with_supply(MOST_SUPPLY_V):
        return None
    below = limits.halved(lambda volt: not with_supply(volt), board.nominal_bus_v, MOST_SUPPLY_V, 24)
    return min(limits.digits_up(1.002 * below, 3), MOST_SUPPLY_V)


def raise_supply(volt: float | None) -> str:
    return f"raise the supply voltage to {volt:g} V" if volt else ""


def needed_supply(motor: Motor, board: BoardFile, holds: Callable[[Envelope], bool]) -> float:
    """The same whatever the firmware takes, to two digits, with the current that the back-EMF's format leaves at that supply."""
    ratio = 1.0
    while True:
        higher = replace(board, nominal_bus_v=limits.digits_up(ratio * board.nominal_bus_v, 2), over_voltage_v=ratio * board.over_voltage_v)
        if holds(Envelope(motor, limits.circle_v(higher), limits.fit_emf(motor, higher, limits.currents(motor, higher)).maximum_a)):
            return higher.nominal_bus_v
        ratio *= 1.01


def lower_rated_speed(rpm: float, motor: Motor) -> str:
    """To this speed, where the motor would still be much the same."""
    return f"lower the rated speed to {limits.digits_down(rpm, 2):g} rpm" if rpm >= SLOWEST_SHARE * motor.rated_speed_rpm else ""


def widen_range(board: BoardFile, wanted_a: float) -> str:
    """A gain of the shunt's amplifier with which MAXIMUM_CURRENT_A may be this much; nothing where the parameter ends before."""
    needed_a = wanted_a * limits.LEAST_TRIP_OVER_MAXIMUM / limits.TRIP_SHARE
    if needed_a <= board.current_full_scale_a or wanted_a > MOST_CURRENT_A:
        return ""
    return lower_gain(board, 0.99 * board.current_full_scale_a / needed_a)


def format_holds(motor: Motor, board: BoardFile, wanted_a: float) -> bool:
    """Whether the back-EMF's number format takes this current, on a board that measures it."""
    motor, wider = replace(motor, maximum_current_a=wanted_a), replace(board, current_full_scale_a=max(2.0 * wanted_a, board.current_full_scale_a))
    return limits.fit_emf(motor, wider, limits.currents(motor, wider)).maximum_a >= 0.999 * wanted_a


def lower_gain(board: BoardFile, factor: float) -> str:
    gain = limits.digits_down(board.quantities["shunt.amplifier_gain"].value_si * factor, 3)
    return f"lower [shunt] amplifier_gain to {gain:g}" if gain >= LEAST_GAIN else ""


def maximum_current(motor: Motor, how: str, ampere: float) -> str:
    """Without a line in the motor file there is nothing to raise or to lower."""
    how = how if "maximum_current" in motor.quantities else "set"
    return f"{how} [rating] maximum_current to {ampere:g} A peak"
