"""Units: every form in which a data sheet prints a number arrives at the same star phase in SI, and what is no unit is refused."""

import math
import unittest

from support import document

from tools.common import units
from tools.common.errors import UserError

# One motor in every form: 5 pole pairs, 7.24 V peak line to line at 1000 rpm. Worked out by hand from the note's Table 1.
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


class Impedances(unittest.TestCase):
    def test_line_to_line_is_two_star_phases_whatever_the_connection(self):
        for connection in ("Y", "delta"):
            with self.subTest(connection):
                self.assertAlmostEqual(entry(units.resistance(connection), 5.34, "ohm line-to-line").value_si, 2.67, 12)
                self.assertAlmostEqual(entry(units.inductance(connection), 3.84, "mH line-to-line").value_si, 1.92e-3, 12)

    def test_a_delta_winding_is_three_star_phases(self):
        self.assertAlmostEqual(entry(units.resistance("delta"), 1.2, "ohm winding").value_si, 0.4, 12)
        self.assertAlmostEqual(entry(units.inductance("delta"), 900, "uH winding").value_si, 300e-6, 12)

    def test_a_star_winding_is_a_phase(self):
        for unit in ("ohm winding", "ohm phase"):
            self.assertEqual(entry(units.resistance("Y"), 1.2, unit).value_si, 1.2)

    def test_a_delta_winding_measured_at_the_terminals_gives_the_same_as_line_to_line(self):
        terminals = 1.2 * 2.4 / (1.2 + 2.4) # one winding parallel to the two others
        self.assertAlmostEqual(entry(units.resistance("delta"), terminals, "ohm line-to-line").value_si,
                               entry(units.resistance("delta"), 1.2, "ohm winding").value_si, 12)

    def test_phase_of_a_delta_motor_is_ambiguous_and_refused(self):
        for kind, unit in ((units.resistance("delta"), "ohm phase"), (units.inductance("delta"), "mH phase"),
                           (units.kphi("delta", 4), "V peak phase/krpm")):
            with self.subTest(unit), self.assertRaisesRegex(UserError, f"'{unit}' is no unit of x, .*line 2: use one of .*line-to-line"):
                entry(kind, 1.0, unit)

    def test_scales(self):
        self.assertAlmostEqual(entry(units.resistance("Y"), 570, "mohm line-to-line").value_si, 0.285, 12)
        self.assertAlmostEqual(entry(units.inductance("Y"), 400, "uH phase").value_si, 0.4e-3, 12)
        self.assertAlmostEqual(entry(units.inductance("Y"), 0.0026, "H line-to-line").value_si, 1.3e-3, 12)


class Kphi(unittest.TestCase):
    def test_every_form_of_the_same_motor_gives_the_same_kphi(self):
        for unit, value in SAME_KPHI.items():
            with self.subTest(unit):
                self.assertAlmostEqual(entry(units.kphi("Y", 5), value, unit).value_si / 7.24, 1.0, 5)

    def test_every_unit_of_kphi_is_among_the_tested_ones(self):
        self.assertEqual(set(units.kphi("Y", 5).units), set(SAME_KPHI))
        self.assertEqual(set(units.kphi("delta", 5).units), {unit for unit in SAME_KPHI if " phase/" not in unit})

    def test_only_the_flux_linkage_depends_on_the_pole_pairs(self):
        for unit in SAME_KPHI:
            ratio = units.kphi("Y", 10).units[unit](1.0) / units.kphi("Y", 5).units[unit](1.0)
            self.assertAlmostEqual(ratio, 2.0 if unit in ("V s/rad", "mV s/rad") else 1.0, 12, unit)

    def read(self, value: float, unit: str) -> float:
        kind = units.kphi("Y", 4)
        return kind.units[unit](value)

    def test_dc_torque_constant_is_that_of_a_commutated_motor(self):
        psi_vs = 5.4e-3
        self.assertAlmostEqual(self.read(six_step(4, psi_vs, 1.0), "N m/A dc"), self.read(psi_vs, "V s/rad"), 6)

    def test_peak_torque_constant_is_that_of_sinusoidal_currents(self):
        psi_vs = 5.4e-3
        self.assertAlmostEqual(self.read(sine(4, psi_vs, 1.0), "N m/A peak"), self.read(psi_vs, "V s/rad"), 9)

    def test_a_dc_current_and_its_peak_give_the_same_torque(self):
        peak_a = entry(units.CURRENT, 2.3, "A dc").value_si
        self.assertAlmostEqual(sine(4, 5.4e-3, peak_a) / six_step(4, 5.4e-3, 2.3), 1.0, 7)
        self.assertAlmostEqual(peak_a, 2.536, 3)

    def test_the_two_constants_of_a_flat_motor_s_sheet_agree(self):
        self.assertAlmostEqual(self.read(187.0, "rpm/V") / self.read(51.0, "mN m/A dc"), 1.0, 2)

    def test_the_forms_to_compare_with_are_all_the_same_constant(self):
        text = units.kphi_forms(7.24, 5)
        self.assertTrue(text.startswith("7.24 V peak line-to-line/krpm = 5.119 V rms line-to-line/krpm = 0.06914 V s/rad line-to-line = 0.007983 V s/rad = "))
        for form in text.split(" = "):
            value, _, unit = form.partition(" ")
            self.assertAlmostEqual(units.kphi("Y", 5).units[unit](float(value)) / 7.24, 1.0, 3, form)


class Others(unittest.TestCase):
    def test_scales(self):
        for kind, value, unit, si in ((units.INERTIA, 24, "g cm2", 24e-7), (units.INERTIA, 6.8e-4, "oz in s2", 4.802e-6),
                                      (units.INERTIA, 0.055, "kg cm2", 5.5e-6), (units.INERTIA, 0.0055, "g m2", 5.5e-6),
                                      (units.TORQUE, 62.5, "mN m", 0.0625), (units.TORQUE, 6.25, "N cm", 0.0625),
                                      (units.TORQUE, 17.7, "oz in", 0.12499), (units.VISCOUS, 15.3, "uN m s", 15.3e-6),
                                      (units.VISCOUS, 1.602, "mN m/krpm", 15.298e-6), (units.VISCOUS, 1e-3, "N m/krpm", 9.5493e-6),
                                      (units.CURRENT, 1.2, "A rms", 1.69706), (units.CURRENT, 1.2, "A peak", 1.2),
                                      (units.SPEED, 314.159, "rad/s", 3000.0), (units.KPHI_TEMPCO, -1100, "ppm/K", -0.0011),
                                      (units.RESISTANCE_TEMPCO, 0.39, "%/K", 0.0039)):
            with self.subTest(unit):
                self.assertAlmostEqual(entry(kind, value, unit).value_si / si, 1.0, 4)

    def test_blanks_in_a_unit_do_not_matter(self):
        self.assertEqual(entry(units.SPEED, 100, "  rpm ").value_si, 100.0)

    def test_a_quantity_remembers_what_was_written_where_and_if_it_was_checked(self):
        quantity = entry(units.INERTIA, 24, "g cm2", "source = \"a sheet [?]\"")
        self.assertEqual((quantity.given, quantity.source, quantity.si_unit), ("24 g cm2", "a sheet [?]", "kg m2"))
        self.assertTrue(quantity.where.endswith("line 2"))
        self.assertTrue(quantity.unchecked)
        self.assertFalse(entry(units.INERTIA, 24, "g cm2").unchecked)

    def test_an_unknown_unit_gets_the_list_of_known_ones(self):
        with self.assertRaisesRegex(UserError, "'N' is no unit of x, .*line 2: use one of N m, mN m, N cm, oz in"):
            entry(units.TORQUE, 1, "N")

    def test_a_unit_that_does_not_say_of_which_asks_for_it(self):
        for kind, unit, wanted in ((units.kphi("Y", 5), "N m/A", "N m/A peak or N m/A rms or N m/A dc"),
                                   (units.kphi("Y", 5), "V rms/krpm", "V rms line-to-line/krpm or V rms phase/krpm"),
                                   (units.kphi("delta", 5), "V line-to-line/krpm", "V peak line-to-line/krpm or V rms line-to-line/krpm"),
                                   (units.CURRENT, "A", "A peak or A rms or A dc")):
            with self.subTest(unit), self.assertRaisesRegex(UserError, f"'{unit}' does not say which x, .*line 2: write {wanted}$"):
                entry(kind, 1, unit)
        with self.assertRaisesRegex(UserError, "'V rms dc/krpm' is no unit of x"):
            entry(units.kphi("Y", 5), 1, "V rms dc/krpm")

    def test_limits_are_told_in_the_unit_that_was_written(self):
        with self.assertRaisesRegex(UserError, "'x' = 5.34e\\+06 ohm line-to-line is impossible, .*line 2: choose 0.02 .. 80 ohm line-to-line"):
            entry(units.resistance("Y"), 5.34e6, "ohm line-to-line")
        with self.assertRaisesRegex(UserError, "'x' = 0 rpm/V is impossible, .*: choose 5.23599 .. 5235.99 rpm/V"):
            entry(units.kphi("Y", 5), 0, "rpm/V")

    def test_the_limits_themselves_are_allowed(self):
        self.assertAlmostEqual(entry(units.resistance("Y"), 80, "ohm line-to-line").value_si, 40.0)
        self.assertAlmostEqual(entry(units.resistance("delta"), 0.03, "ohm winding").value_si, 0.01)
