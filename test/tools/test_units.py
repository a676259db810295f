"""Units: every form in which a data sheet prints a number arrives at the same star phase in SI, and what is no unit is refused."""

import math

import pytest
from support import document, refusal

from tools.common import units

# One motor in every form: 5 pole pairs, 7.24 V peak line to line at 1000 rpm. Worked out by hand from AN1292's Table 1.
SAME_KPHI = {"V peak line-to-line/krpm": 7.24, "V rms line-to-line/krpm": 5.119453, "V dc/krpm": 6.913691, "V peak phase/krpm": 4.180016,
             "V rms phase/krpm": 2.955717, "V s/rad": 7.983242e-3, "mV s/rad": 7.983242, "V s/rad line-to-line": 0.06913691,
             "N m/A peak": 0.05987432, "N m/A rms": 0.08467507, "N m/A dc": 0.06602088, "mN m/A peak": 59.87432, "mN m/A rms": 84.67507,
             "mN m/A dc": 66.02088, "oz in/A peak": 8.478926, "oz in/A rms": 11.99101, "oz in/A dc": 9.349343, "rpm/V": 144.6406}


def entry(kind: units.Kind, value: object, unit: str | None, more: str = "source = \"test\"") -> units.Quantity:
    """What read() makes of such an entry on line 2 of a file."""
    text = f"[a]\nx = {{ value = {value}, {f'unit = {chr(34)}{unit}{chr(34)}, ' if unit is not None else ''}{more} }}\n"
    section = document(text).root.section("a")
    assert section is not None
    return units.read(section, "x", kind)


def six_step(pole_pairs: int, psi_vs: float, current_a: float) -> float:
    """Mean torque of a motor with sinusoidal back-EMF whose two phases with the largest line-to-line voltage carry a dc current."""
    def phase(turn: float, number: int) -> float:
        return pole_pairs * psi_vs * math.cos(2.0 * math.pi * (turn - number / 3.0))
    steps = 60000
    total = 0.0
    for step in range(steps):
        emf = [phase((step + 0.5) / steps, number) for number in range(3)]
        total += (max(emf) - min(emf)) * current_a
    return total / steps


def sine(pole_pairs: int, psi_vs: float, peak_a: float) -> float:
    """Torque of the same motor with sinusoidal currents in phase with the back-EMF."""
    return sum(pole_pairs * psi_vs * peak_a * math.cos(2.0 * math.pi * (0.1 - number / 3.0)) ** 2 for number in range(3))


Y, DELTA = units.kphi("Y", 5), units.kphi("delta", 5)
R, L, R_DELTA, L_DELTA = units.resistance("Y"), units.inductance("Y"), units.resistance("delta"), units.inductance("delta")
TERMINALS = 1.2 * 2.4 / (1.2 + 2.4) # one delta winding of 1.2 ohm parallel to the two others
EXACT = [
    (R, 5.34, "ohm line-to-line", 2.67), (R_DELTA, 5.34, "ohm line-to-line", 2.67), # two star phases whatever the connection
    (L, 3.84, "mH line-to-line", 1.92e-3), (L_DELTA, 3.84, "mH line-to-line", 1.92e-3),
    (R_DELTA, 1.2, "ohm winding", 0.4), (L_DELTA, 900, "uH winding", 300e-6), (R_DELTA, TERMINALS, "ohm line-to-line", 0.4),
    (R, 1.2, "ohm winding", 1.2), (R, 1.2, "ohm phase", 1.2), (R, 570, "mohm line-to-line", 0.285), (L, 400, "uH phase", 0.4e-3),
    (L, 0.0026, "H line-to-line", 1.3e-3), (R, 80, "ohm line-to-line", 40.0), (R_DELTA, 0.03, "ohm winding", 0.01),
    (units.TORQUE, 2, "Nm", 2.0), (units.TORQUE, 2, "N·m", 2.0), (units.TORQUE, 2, "mN*m", 2e-3), (units.INERTIA, 3, "kg·m²", 3.0),
    (units.INERTIA, 3, "kgm^2", 3.0), (R, 2.0, "Ω line-to-line", 1.0), (L, 400, "µH phase", 0.4e-3), (Y, 1.0, "V s/rad  line-to-line", 104.71975511966),
    (units.SPEED, 100, "  rpm ", 100.0), (units.CURRENT, 1.2, "A peak", 1.2)]
ROUNDED = [
    (units.INERTIA, 24, "g cm2", 24e-7), (units.INERTIA, 6.8e-4, "oz in s2", 4.802e-6), (units.INERTIA, 0.055, "kg cm2", 5.5e-6),
    (units.INERTIA, 0.0055, "g m2", 5.5e-6), (units.TORQUE, 62.5, "mN m", 0.0625), (units.TORQUE, 6.25, "N cm", 0.0625),
    (units.TORQUE, 17.7, "oz in", 0.12499), (units.VISCOUS, 15.3, "uN m s", 15.3e-6), (units.VISCOUS, 1.602, "mN m/krpm", 15.298e-6),
    (units.VISCOUS, 1e-3, "N m/krpm", 9.5493e-6), (units.CURRENT, 1.2, "A rms", 1.69706),
    (units.SPEED, 314.159, "rad/s", 3000.0), (units.KPHI_TEMPCO, -1100, "ppm/K", -0.0011),
    (units.RESISTANCE_TEMPCO, 0.39, "%/K", 0.0039)]


@pytest.mark.parametrize("kind, value, unit, si, within", [*((*row, 1e-12) for row in EXACT), *((*row, 5e-5) for row in ROUNDED)])
def test_a_number_becomes_si(kind, value, unit, si, within):
    assert entry(kind, value, unit).value_si == pytest.approx(si, rel=within)


@pytest.mark.parametrize("kind, value, unit, parts", [
    # of a delta motor some sheets mean the winding by "phase", some the star phase
    *((kind, 1.0, unit, [f"'{unit}' is no unit of x, ", "line 2: use one of ", "line-to-line"]) for kind, unit in (
        (R_DELTA, "ohm phase"), (L_DELTA, "mH phase"), (DELTA, "V peak phase/krpm"))),
    (units.TORQUE, 1, "N", ["'N' is no unit of x, ", "line 2: use one of N m, mN m, N cm, oz in"]),
    (Y, 1, "V rms dc/krpm", ["'V rms dc/krpm' is no unit of x"]),
    *((kind, 1, unit, [f"'{unit}' does not say which x, ", f"line 2: write {wanted}"]) for kind, unit, wanted in (
        (Y, "N m/A", "N m/A peak or N m/A rms or N m/A dc"), (Y, "V rms/krpm", "V rms line-to-line/krpm or V rms phase/krpm"),
        (DELTA, "V line-to-line/krpm", "V peak line-to-line/krpm or V rms line-to-line/krpm"),
        (units.CURRENT, "A", "A peak or A rms or A dc"))),
    (R, 5.34e6, "ohm line-to-line", ["'x' = 5.34e+06 ohm line-to-line is impossible, ", "line 2: choose 0.02 .. 80 ohm line-to-line"]),
    (Y, 0, "rpm/V", ["'x' = 0 rpm/V is impossible, ", ": choose 0.523599 .. 5235.99 rpm/V"])])
def test_what_is_no_unit_or_impossible_in_it_is_refused(kind, value, unit, parts):
    line = refusal(lambda: entry(kind, value, unit), *parts)
    assert line.endswith(parts[-1]) or "use one of" in line or len(parts) == 1


def test_a_quantity_remembers_what_was_written_where_and_if_it_was_checked():
    quantity = entry(units.INERTIA, 24, "g cm2", "source = \"a sheet [?]\"")
    assert (quantity.given, quantity.source, quantity.si_unit, quantity.unchecked) == ("24 g cm2", "a sheet [?]", "kg m2", True)
    assert quantity.where.endswith("line 2") and not entry(units.INERTIA, 24, "g cm2").unchecked


# ---- the motor constant --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("unit, value", SAME_KPHI.items())
def test_every_form_of_the_same_motor_gives_the_same_kphi(unit, value):
    assert entry(Y, value, unit).value_si == pytest.approx(7.24, rel=5e-6)
    only_flux = 2.0 if unit in ("V s/rad", "mV s/rad") else 1.0 # depends on the pole pairs
    assert units.kphi("Y", 10).units[unit](1.0) / Y.units[unit](1.0) == pytest.approx(only_flux)
    # every unit of Kphi is among the tested ones
    assert set(Y.units) == set(SAME_KPHI)
    assert set(DELTA.units) == {unit for unit in SAME_KPHI if " phase/" not in unit}


def kphi(value: float, unit: str) -> float:
    """Of a motor with four pole pairs."""
    return units.kphi("Y", 4).units[unit](value)


def test_torque_constants_are_those_of_a_commutated_motor_and_of_sinusoidal_currents_and_both_currents_give_the_same_torque():
    assert kphi(six_step(4, 5.4e-3, 1.0), "N m/A dc") == pytest.approx(kphi(5.4e-3, "V s/rad"), abs=5e-7)
    assert kphi(sine(4, 5.4e-3, 1.0), "N m/A peak") == pytest.approx(kphi(5.4e-3, "V s/rad"), abs=5e-10)
    peak_a = entry(units.CURRENT, 2.3, "A dc").value_si
    assert sine(4, 5.4e-3, peak_a) / six_step(4, 5.4e-3, 2.3) == pytest.approx(1.0, abs=5e-8)
    assert peak_a == pytest.approx(2.536, abs=5e-4)
    # the two constants of a flat motor's sheet agree
    assert kphi(187.0, "rpm/V") / kphi(51.0, "mN m/A dc") == pytest.approx(1.0, abs=5e-3)


def test_the_forms_to_compare_with_are_all_the_same_constant():
    text = units.kphi_forms(7.24, 5)
    assert text.startswith("7.24 V peak line-to-line/krpm = 5.119 V rms line-to-line/krpm = "
                           "0.06914 V s/rad line-to-line = 0.007983 V s/rad = ")
    for form in text.split(" = "):
        value, _, unit = form.partition(" ")
        assert Y.units[unit](float(value)) == pytest.approx(7.24, rel=5e-4), form
