"""The "Motor" sheet: chooser, the motor in data-sheet terms, the board, and both in SI units and one star phase."""

from dataclasses import dataclass
from typing import Any

from tools.common import motor_file, paths, units

from .book import Book, Page
from .data import KINDS, DataPage, entries, unit_name

HEADS = ["Quantity", "From the file", "Unit", "Yours", "Unit of yours", "Used", "Unit", "Check", "Where the file's value comes from",
         "Taken: number", "Taken: unit", "Factor"]
WIDTHS = [44, 14, 27, 14, 27, 14, 27, 50, 84, 14, 27, 14]


@dataclass(frozen=True)
class Row:
    """One number of a file. `default` is a formula for a number that may be missing."""

    key: str
    kind: str
    label: str
    name: str
    default: str = ""


MOTOR = [
    ("Electrical", [
        Row("electrical.resistance", "resistance", "Resistance (terminals)", "rs_given"),
        Row("electrical.inductance_d", "inductance", "Inductance (d axis)", "ld_h"),
        Row("electrical.inductance_q", "inductance", "Inductance, q axis (empty: as d)", "lq_h"),
        Row("electrical.kphi", "kphi", "Kphi: back-EMF or torque constant", "kphi_given"),
        Row("electrical.resistance_tempco", "resistance_tempco", "Change of R with temperature", "resistance_tempco_per_k",
            str(motor_file.COPPER_PER_K)),
        Row("electrical.kphi_tempco", "kphi_tempco", "Change of Kphi with temperature", "kphi_tempco_per_k", str(motor_file.FERRITE_PER_K)),
    ]),
    ("Mechanical", [
        Row("mechanical.inertia", "inertia", "Inertia of the rotor", "inertia_kgm2"),
        Row("mechanical.viscous_friction", "viscous", "Viscous friction", "viscous_nms", "0"),
        Row("mechanical.coulomb_friction", "friction", "Dry friction", "coulomb_nm", "0"),
        Row("load.inertia", "load_inertia", "Inertia of the load", "load_inertia_kgm2", "0"),
        Row("load.start_torque", "friction", "Load torque while starting", "start_torque_nm", "0.25*rated_torque_nm"),
    ]),
    ("Rating", [
        Row("rating.voltage", "voltage", "Rated voltage", "rated_voltage_v"),
        Row("rating.current", "current", "Rated current", "rated_current_a"),
        Row("rating.torque", "torque", "Rated torque", "rated_torque_nm"),
        Row("rating.speed", "speed", "Rated speed", "rated_speed_rpm"),
        Row("rating.maximum_speed", "speed", "Highest speed wanted", "wanted_speed_rpm"),
        Row("rating.maximum_current", "current", "Highest current", "motor_maximum_current_a", "1.5*rated_current_a"),
    ]),
]

BOARD = [
    Row("supply.voltage", "supply.voltage", "Supply (DC link)", "supply_v"),
    Row("inverter.rds_on", "inverter.rds_on", "On-resistance of a MOSFET", "rds_on_ohm"),
    Row("shunt.resistance", "shunt.resistance", "Shunt", "shunt_ohm"),
    Row("shunt.amplifier_gain", "shunt.amplifier_gain", "Gain of its amplifier", "amplifier_gain"),
    Row("shunt.reference", "shunt.reference", "Amplifier's output at 0 A", "reference_v"),
    Row("adc.full_scale", "adc.full_scale", "Converter's full scale", "adc_full_scale_v"),
    Row("adc.bus_divider", "adc.bus_divider", "Divider of the bus voltage, 1 :", "bus_divider"),
    Row("pwm.period", "pwm.period", "PWM and control period", "pwm_period_s"),
    Row("pwm.dead_time", "pwm.dead_time", "Dead time", "dead_time_s"),
    Row("pwm.sample_window", "pwm.sample_window", "Low sides on around the sample", "sample_window_s"),
    Row("limits.over_voltage", "limits.over_voltage", "Bus above: trip", "trip_bus_v"),
    Row("limits.under_voltage", "limits.under_voltage", "Bus below: trip", "least_bus_v"),
    Row("limits.regen", "limits.regen", "Bus above: braking current is reduced", "regen_bus_v"),
]


def motors() -> dict[str, dict[tuple[str, str], Any]]:
    """Every motor file that loads, an inductance without an axis as both."""
    return {name: _both_axes(entries(motor_file.load(name).path)) for name in paths.names(paths.MOTORS)}


def boards() -> dict[str, dict[tuple[str, str], Any]]:
    return {name: entries(paths.BOARDS / f"{name}.toml") for name in paths.names(paths.BOARDS)}


def _both_axes(file: dict[tuple[str, str], Any]) -> dict[tuple[str, str], Any]:
    result: dict[tuple[str, str], Any] = {}
    for (key, part), value in file.items():
        if key == "electrical.inductance":
            result[key + "_d", part] = result[key + "_q", part] = value
        else:
            result[key, part] = value
    return result


def motor_page(book: Book, motor: DataPage, board: DataPage, first_motor: str) -> Page:
    """Builds the sheet."""
    page = book.page("Motor", WIDTHS, "F2C200", "Choose a motor. Yellow cells are yours: a number there replaces the file's, an empty one keeps it.")
    _choosers(page, motor, board, first_motor)
    page.heads(HEADS, freeze=True)
    for text, rows in MOTOR:
        page.section(text)
        if text == "Electrical":
            _pole_pairs(page, motor)
        for row in rows:
            _quantity(page, motor, row)
            if row.name in ("rs_given", "kphi_given"):
                _temperature(page, motor, row)
    page.section("One star phase at 25 degC, peak values")
    _phase_values(page)
    page.section("Board")
    for row in BOARD:
        _quantity(page, board, row)
    _board_values(page, board)
    page.section("Do the numbers fit each other? A wrong one is nearly always a wrong unit or a slipped power of ten")
    _plausible(page)
    page.ws.page_setup.fitToHeight = 1
    page.ws.print_area = f"A1:I{page.row - 1}"
    return page


def _choosers(page: Page, motor: DataPage, board: DataPage, first_motor: str) -> None:
    for label, data, name, default, what in (("Motor", motor, "motor", first_motor, "a motor"), ("Board", board, "board", "mclv", "a board")):
        row = page.next_row()
        page.put(f"A{row}", label, "label")
        page.put(f"B{row}", default, "input text")
        page.put(f"C{row}", None, "input text")
        page.ws.merge_cells(f"B{row}:C{row}")
        page.choose(f"B{row}", f"'{data.title}'!$C$4:${data.last}$4", what)
        page.name(f"{name}_name", f"B{row}")
        page.put(f"D{row}", f"={data.pick('title')}", "label")
        page.name(f"{name}_title", f"D{row}")
        page.ws.merge_cells(f"D{row}:E{row}")
        page.put(f"F{row}", f"=MATCH({name}_name,{data.column_name}_names,0)", "value")
        page.put(f"G{row}", f"column of the sheet {data.title}", "unit")
        page.name(data.column_name, f"F{row}")
        page.check(f"H{row}", f'=IF(ISNUMBER(F{row}),"ok","choose {what} from the list")')
    row = page.next_row()
    page.put(f"A{row}", "Red checks on all sheets", "label")
    page.put(f"B{row}", "=red_checks", "value", "0")
    page.status(f"D{row}", "=checks_text")
    page.ws.merge_cells(f"D{row}:H{row}")
    page.next_row()


def _source(page: Page, row: int, data: DataPage, key: str) -> None:
    page.put(f"I{row}", f"={data.pick(key, 'source')}", "note")


def _pole_pairs(page: Page, motor: DataPage) -> None:
    row = page.next_row()
    page.put(f"A{row}", "Connection", "label")
    page.put(f"B{row}", f"={motor.pick('connection')}", "value")
    page.put(f"C{row}", "", "unit")
    page.put(f"D{row}", None, "input")
    page.choose(f"D{row}", "Y,delta", "Y or delta")
    page.put(f"E{row}", "", "unit")
    page.put(f"F{row}", f'=IF(D{row}="",B{row},D{row})', "result")
    page.put(f"G{row}", "", "unit")
    page.check(f"H{row}", f'=IF(OR(F{row}="Y",F{row}="delta"),"ok","choose Y or delta")')
    page.put(f"I{row}", "counts for values \"winding\": a winding of a delta motor is 3 star phases", "note")
    page.name("connection", f"F{row}")
    row = page.next_row()
    page.put(f"A{row}", "Pole pairs", "label")
    page.put(f"B{row}", f"={motor.pick('electrical.pole_pairs')}", "value")
    page.put(f"C{row}", "", "unit")
    page.put(f"D{row}", None, "input", "0")
    page.range(f"D{row}", 1, 50, "Pole pairs", whole=True)
    page.put(f"E{row}", "", "unit")
    page.put(f"F{row}", f'=IF(D{row}="",B{row},D{row})', "result", "0")
    page.put(f"G{row}", "pairs", "unit")
    page.check(f"H{row}", f'=IF(ISNUMBER(F{row}),IF(AND(F{row}>=1,F{row}<=50,F{row}=INT(F{row})),"ok","a whole number from 1 to 50"),"enter the '
                          f'number")')
    _source(page, row, motor, "electrical.pole_pairs")
    page.name("pole_pairs", f"F{row}")


def _quantity(page: Page, data: DataPage, spec: Row) -> None:
    row, kind = page.next_row(), KINDS[spec.kind]
    page.put(f"A{row}", spec.label, "label")
    page.put(f"B{row}", f"={data.pick(spec.key)}", "value", "General")
    page.put(f"C{row}", f"={data.pick(spec.key, 'unit')}", "unit")
    page.put(f"D{row}", None, "input", "General")
    page.range(f"D{row}", *kind.limits(), spec.label)
    page.put(f"E{row}", None, "input text")
    page.choose(f"E{row}", f"{_units_range(page.book, kind.name)}", "the unit")
    number, unit, factor = f"J{row}", f"K{row}", f"L{row}"
    as_d = spec.name == "lq_h"
    page.put(number, f'=IF(D{row}<>"",D{row},' + (f'IF(D{row - 1}<>"",D{row - 1},B{row}))' if as_d else f"B{row})"), "unit", "General")
    page.put(unit, f'=IF(E{row}<>"",E{row},' + (f'IF(AND(D{row}="",E{row - 1}<>""),E{row - 1},C{row}))' if as_d else f"C{row})"), "unit")
    page.put(factor, _factor(kind, unit), "unit", "General")
    si = f'IF({_entry(kind, unit, 4)}=1,{factor}/{number},{factor}*{number})'
    missing = spec.default or '""'
    page.put(f"F{row}", f'=IF({number}="",{missing},{si})', "result", _form(kind.star.si_unit))
    page.put(f"G{row}", kind.star.si_unit, "unit")
    low, high = kind.star.minimum, kind.star.maximum
    absent = '"ok"' if spec.default else '"enter a value and its unit"'
    page.check(f"H{row}", f'=IF({number}="",{absent},IF(ISNUMBER({factor}),IF(AND(F{row}>={low!r}*{_loose(low, -1)},'
                          f'F{row}<={high!r}*{_loose(high, 1)}),'
                          f'"ok","impossible: {low:g} .. {high:g} {kind.star.si_unit}"),"choose a unit that this motor has"))')
    _source(page, row, data, spec.key)
    page.name(spec.name, f"F{row}")


def _loose(limit: float, side: int) -> str:
    """A limit that comes from a conversion may be missed by a rounding error."""
    return "1.000000001" if (side > 0) == (limit >= 0) else "0.999999999"


def _form(unit: str) -> str:
    """Number format of an SI value."""
    return {"ohm": "0.0000", "H": "0.000000", "kg m2": "0.00E+00", "N m s": "0.00E+00", "N m": "0.0000", "rpm": "0", "V": "0.00", "A": "0.000",
            "A peak": "0.000", "s": "0.00E+00",
            "1/K": "0.0000", "V peak line-to-line/krpm": "0.0000", "V s": "0.000000", "N m per A peak": "0.0000",
            "V peak": "0.000"}.get(unit, "0.000")


def _units_range(book: Book, kind: str) -> str:
    return book.names[unit_name(KINDS[kind])]


def _entry(kind: Any, unit: str, column: Any) -> str:
    name = unit_name(kind)
    return f"INDEX(factor_{name[5:]},MATCH({unit},{name},0),{column})"


def _factor(kind: Any, unit: str) -> str:
    entry = _entry(kind, unit, 'IF(connection="delta",2,1)')
    poles = f"*IF({_entry(kind, unit, 3)}=1,pole_pairs,1)" if kind.per_pole_pair else ""
    return f'=IFERROR(IF({entry}="","",{entry}{poles}),"")'


def _temperature(page: Page, motor: DataPage, spec: Row) -> None:
    row = page.next_row()
    page.put(f"A{row}", "... measured at", "label")
    page.put(f"B{row}", f"={motor.pick(spec.key, 'at_degc')}", "value")
    page.put(f"C{row}", "degC", "unit")
    page.put(f"D{row}", None, "input")
    page.range(f"D{row}", -40, 155, "Temperature, degC")
    page.put(f"E{row}", "degC", "unit")
    page.put(f"F{row}", f'=IF(D{row}<>"",D{row},IF(OR(B{row}="",D{row - 1}<>""),{units.REFERENCE_DEGC:g},B{row}))', "result")
    page.put(f"G{row}", "degC", "unit")
    page.check(f"H{row}", f'=IF(AND(F{row}>=-40,F{row}<=155),"ok","impossible: -40 .. 155 degC")')
    page.put(f"I{row}", "25 if nothing is said", "note")
    page.name(spec.name.replace("given", "degc"), f"F{row}")


def _derived(page: Page, label: str, name: str, formula: str, unit: str, note: str, check: str = '"ok"') -> None:
    row = page.next_row()
    for column in "BCDE":
        page.put(f"{column}{row}", None, "unit")
    page.put(f"A{row}", label, "label")
    page.put(f"F{row}", formula, "result", _form(unit))
    page.put(f"G{row}", unit, "unit")
    page.check(f"H{row}", f"={check}")
    page.put(f"I{row}", note, "note")
    page.name(name, f"F{row}")


def _phase_values(page: Page) -> None:
    _derived(page, "Resistance", "rs_ohm", "=rs_given/(1+resistance_tempco_per_k*(rs_degc-25))", "ohm", "R / (1 + a (T - 25))")
    _derived(page, "Kphi", "kphi_v_per_krpm", "=kphi_given/(1+kphi_tempco_per_k*(kphi_degc-25))", "V peak line-to-line/krpm", "the same for Kphi")
    _derived(page, "Flux linkage", "psi_vs", "=kphi_v_per_krpm/(SQRT(3)*1000*2*PI()/60*pole_pairs)", "V s", "psi = Kphi / (sqrt(3) 1000 2 pi/60 P)")
    _derived(page, "Torque constant", "kt_nm_per_a", "=1.5*pole_pairs*psi_vs", "N m per A peak", "Kt = 3/2 P psi")
    _derived(page, "Back-EMF of a phase at rated speed", "emf_rated_v", "=psi_vs*pole_pairs*rated_speed_rpm*2*PI()/60", "V peak", "psi w")
    _derived(page, "Electrical time constant", "time_constant_s", "=lq_h/rs_ohm", "s", "L/R")


def _board_values(page: Page, board: DataPage) -> None:
    row = page.row
    _derived(page, "Current at the converter's full scale", "board_full_scale_a", "=reference_v/(shunt_ohm*amplifier_gain)", "A peak",
             "reference / (shunt * gain)")
    row = page.next_row()
    page.put(f"A{row}", "Current at full internal scale (Ipeak)", "label")
    page.put(f"B{row}", "=board_full_scale_a", "value")
    page.put(f"C{row}", "A peak", "unit")
    page.put(f"D{row}", None, "input")
    page.range(f"D{row}", 0.3, 65, "Ipeak, A")
    page.put(f"E{row}", "A peak", "unit")
    page.put(f"F{row}", f'=IF(D{row}="",B{row},D{row})', "result")
    page.put(f"G{row}", "A at 32768 counts", "unit")
    page.check(f"H{row}", f'=IF(AND(F{row}>=0.3,F{row}<=65),"ok","impossible: 0.3 .. 65 A")')
    page.put(f"I{row}", "calibrate with a probe, as the note explains; 3.95 A gives its constants", "note")
    page.name("current_full_scale_a", f"F{row}")
    row = page.next_row()
    page.put(f"A{row}", "Output falls with current into the motor", "label")
    page.put(f"B{row}", f"={board.pick('shunt.inverted')}", "value")
    page.put(f"C{row}", "1 = yes", "unit")
    page.put(f"D{row}", None, "input")
    page.choose(f"D{row}", "0,1", "0 or 1")
    page.put(f"E{row}", "1 = yes", "unit")
    page.put(f"F{row}", f'=IF(IF(D{row}="",B{row},D{row})=1,-0.5,0.5)', "result")
    page.put(f"G{row}", "KCURRA, KCURRB", "unit")
    page.check(f"H{row}", '="ok"')
    page.put(f"I{row}", "0.5 is gain 1; negative with shunts in the low legs", "note")
    page.name("current_gain", f"F{row}")
    _derived(page, "Bus voltage at the converter's full scale", "bus_range_v", "=adc_full_scale_v*bus_divider", "V", "full scale * divider")


def _plausible(page: Page) -> None:
    rated = "(rated_speed_rpm*2*PI()/60)"
    for label, name, formula, unit, low, high in (
            ("L/R", "fit_time_constant", "=lq_h/rs_ohm", "s", 2e-5, 0.05),
            ("Lq/Ld", "fit_saliency", "=lq_h/ld_h", "1", 0.5, 5),
            ("Back-EMF at rated speed / rated voltage", "fit_emf", "=kphi_v_per_krpm*rated_speed_rpm/1000/rated_voltage_v", "1", 0.25, 1.25),
            ("Kt * rated current / rated torque", "fit_torque", "=kt_nm_per_a*rated_current_a/rated_torque_nm", "1", 0.5, 2),
            ("Rated current's drop in R / rated voltage", "fit_drop", "=SQRT(3)*rs_ohm*rated_current_a/rated_voltage_v", "1", 0, 1),
            ("Friction at rated speed / rated torque", "fit_friction", f"=(coulomb_nm+viscous_nms*{rated})/rated_torque_nm", "1", 0, 1),
            ("Time to rated speed with rated torque", "fit_acceleration", f"=inertia_kgm2*{rated}/rated_torque_nm", "s", 0.001, 5),
            ("Highest speed / rated speed", "fit_speed", "=wanted_speed_rpm/rated_speed_rpm", "1", 1, 100),
            ("Highest current / rated current", "fit_current", "=motor_maximum_current_a/rated_current_a", "1", 0.2, 10),
            ("Load torque at start / torque at highest current", "fit_start", "=start_torque_nm/(kt_nm_per_a*motor_maximum_current_a)", "1", 0, 1)):
        _derived(page, label, name, formula, unit, "the same test as the command's when it reads a motor file",
                 f'IF(AND({name}>={low!r},{name}<={high!r}),"ok","implausible: {low:g} .. {high:g} {unit}")'.replace(" 1\")", "\")"))


