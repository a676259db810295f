"""Rows of userparams.h: what the rule gives, what the user wants instead, what is used; and the "Parameters" sheet."""

from dataclasses import dataclass

from tuning import design, limits
from tuning.params import parameters, relations

from .book import Book, Page
from .data import DataPage
from .formulas import RPM, condition, digits_down, down, significant

WIDTHS = [44, 16, 16, 16, 20, 24, 56, 104]
DI = "(2*PI()*{rpm}/60*NOPOLESPAIRS*LOOPTIME_SEC*MAXIMUM_CURRENT_A/NORM_CURRENT_CONST/2)"
"""Change of a sine of the largest current in a period, in Q14 counts."""
HEADS = ["Parameter", "By rule", "Yours", "Used", "Unit", "Range", "Check", "Rule"]


@dataclass(frozen=True)
class Rule:
    """How the command chooses a parameter, as a formula's text, and how its header writes the number: plain, real, short, hex, fixed."""

    name: str
    formula: str
    why: str
    style: str = "plain"
    digits: int = 6


def parameter(page: Page, motor: DataPage, rule: Rule, unit: str = "", low: str = "", high: str = "") -> int:
    """One row; its used value gets the parameter's name. Unit and range are the table's, if it has the parameter."""
    row, known = page.next_row(), parameters().get(rule.name)
    if known:
        unit, low, high = known.unit, known.low, known.high
    formula = rule.formula
    if motor.has(f"tune.{rule.name}"):
        picked = motor.pick(f"tune.{rule.name}")
        formula = f"IF({picked}=\"\",{formula},{picked})"
    page.put(f"A{row}", rule.name, "name")
    form = "General" if known else "0.00000"
    page.put(f"B{row}", f"={formula}", "value", form)
    page.put(f"C{row}", None, "input", form)
    page.put(f"D{row}", f'=IF(C{row}="",B{row},C{row})', "result", form)
    page.put(f"E{row}", unit, "unit")
    page.put(f"F{row}", f"{low} .. {high}", "unit")
    page.range(f"C{row}", float(low), float(high), rule.name)
    page.check(f"G{row}", f'=IF(ISNUMBER(D{row}),IF(AND(D{row}>={low},D{row}<={high}),"ok","outside {low} .. {high} {unit}"),'
                          '"follows from a value that is missing")')
    page.put(f"H{row}", rule.why + (" (the motor file's [tune] says otherwise for some motors)" if motor.has(f"tune.{rule.name}") else ""), "note")
    page.name(rule.name, f"D{row}")
    page.book.rules[rule.name] = rule
    return row


def quantity(page: Page, label: str, name: str, formula: str, unit: str, why: str, form: str = "0.0000", check: str = "") -> None:
    """A number on the way to a parameter."""
    row = page.next_row()
    page.put(f"A{row}", label, "label")
    for column in "BCF":
        page.put(f"{column}{row}", None, "unit")
    page.put(f"D{row}", f"={formula}", "value", form)
    page.put(f"E{row}", unit, "unit")
    if check:
        page.check(f"G{row}", f"={check}")
    else:
        page.put(f"G{row}", None, "unit")
    page.put(f"H{row}", why, "note")
    page.name(name, f"D{row}")


def parameters_page(book: Book, motor: DataPage) -> Page:
    """Builds the sheet."""
    page = book.page("Parameters", WIDTHS, "1F4E79",
                     "Every value of userparams.h that is not on Loops, Start or Field weakening. A yellow cell replaces the rule's value.")
    page.heads(HEADS, freeze=True)
    page.section("Motor")
    for rule in _motor():
        parameter(page, motor, rule)
    page.section("Supply and board")
    for rule in _board():
        parameter(page, motor, rule)
    page.section("Currents and limits")
    _currents(page, motor)
    page.section("Speeds")
    _speeds(page, motor)
    page.section("Filters, Equation 7")
    faster = f"MIN(MAX({design.QUICK_ROTOR_S}/((inertia_kgm2+load_inertia_kgm2)*rated_speed_rpm*{RPM}/rated_torque_nm),1),4)"
    for name, corner, why in (("KFILTER_ESDQ", design.ESDQ_HZ, "back-EMF: the note's corner at this PWM period"),
                              ("KFILTER_ESDQ_FW", design.ESDQ_HZ, "the same in field weakening: the note's 16 Hz would let the angle swing"),
                              ("KFILTER_VELESTIM", design.VELESTIM_HZ, "speed: the note's corner at this PWM period, up to four times it for a quick rotor")):
        factor = f"*{faster}" if name == "KFILTER_VELESTIM" else ""
        parameter(page, motor, Rule(name, f"INT(32768*(1-EXP(-2*PI()*{corner}{factor}*pwm_period_s))+0.5)",
                                    f"{why}; K = 2^15 (1 - exp(-2 pi {corner:g} Hz Ts))"))
    page.section("Snapshot, tuning")
    for name, value, why, style in (("TUNING_DELAY_RAMPUP", 15, "the note's: 1250 electrical rpm/s", "hex"), ("SNAPDELAY", 5, "the note's", "plain"),
                                    ("DATA_BUFFER_SIZE", 50, "the note's; 400 bytes of RAM", "plain")):
        parameter(page, motor, Rule(name, str(value), why, style))
    page.section("What the command refuses or warns of")
    _warnings(page)
    page.section("What the build refuses (include/drive/param_table.h)")
    _relations(page)
    page.ws.print_area = f"A1:H{page.row - 1}"
    return page


def _motor() -> list[Rule]:
    return [Rule("NOPOLESPAIRS", "pole_pairs", "motor"),
            Rule("MOTOR_RS_OHM", significant("rs_ohm", 6), "motor; per phase of the star"),
            Rule("MOTOR_LS_MH", significant("(lq_h*1000)", 6),
                 "motor; of the q axis if the two differ: then the back-EMF of Equation 4 lies on the q axis whatever the current"),
            Rule("MOTOR_KPHI_V_PER_KRPM", significant("kphi_v_per_krpm", 6), "motor"),
            Rule("MOTOR_INERTIA_KGM2", significant("(inertia_kgm2+load_inertia_kgm2)", 4), "motor; rotor and load", "short", 4)]


def _board() -> list[Rule]:
    return [Rule(name, significant(value, digits), "board", style, digits) for name, value, style, digits in (
        ("NOMINAL_BUS_V", "supply_v", "real", 6), ("LOOPTIME_SEC", "pwm_period_s", "plain", 6), ("DEADTIME_SEC", "dead_time_s", "plain", 6),
        ("NORM_CURRENT_CONST", "(current_full_scale_a/32768)", "plain", 7),
        ("KCURRA", "current_gain", "plain", 6), ("KCURRB", "current_gain", "plain", 6),
        ("BUS_FULL_SCALE_V", "bus_range_v", "real", 6), ("SAMPLE_WINDOW_SEC", "sample_window_s", "plain", 6),
        ("OVER_VOLTAGE_V", "trip_bus_v", "real", 6), ("UNDER_VOLTAGE_V", "least_bus_v", "real", 6), ("REGEN_LIMIT_V", "regen_bus_v", "real", 6))]


def _currents(page: Page, motor: DataPage) -> None:
    step = "IF(current_full_scale_a>1,0.05,0.005)"
    quantity(page, "Highest trip level", "highest_trip_a", down(f"{limits.TRIP_SHARE}*current_full_scale_a", step), "A peak",
             f"{limits.TRIP_SHARE:.1%} of the converter's range", "0.000")
    quantity(page, "Largest current that this board leaves", "board_current_a", digits_down(f"(highest_trip_a/{limits.LEAST_TRIP_OVER_MAXIMUM})", 3),
             "A peak",
             f"the trip level / {limits.LEAST_TRIP_OVER_MAXIMUM:g}", "0.000")
    row = parameter(page, motor, Rule("MAXIMUM_CURRENT_A", "maximum_found_a",
                                      "the motor's highest current, within what this board and the back-EMF's number format leave (sheet Search)"))
    page.name("maximum_current_yours", f"C{row}")
    quantity(page, "Voltage circle", "circle_v", "(1-2*sample_window_s/pwm_period_s)*supply_v/SQRT(3)", "V peak", "highest duty / sqrt(3) * bus",
             "0.000")
    parameter(page, motor, Rule("OVER_CURRENT_THRESHOLD_A", "trip_found_a",
                                f"{limits.TRIP_OVER_MAXIMUM:g} times MAXIMUM_CURRENT_A, at most the highest trip level; "
                                "lowered (sheet Search) until the back-EMF's number format holds"))
    fastest = f"{RPM}*MAX(MAXIMUM_SPEED_RPM,1.5*NOMINAL_SPEED_RPM)*NOPOLESPAIRS"
    quantity(page, "Largest back-EMF at the trip level", "emf_max_v",
             f"OVER_VOLTAGE_V/SQRT(3)+2/SQRT(3)*MOTOR_RS_OHM*OVER_CURRENT_THRESHOLD_A+{fastest}*1.2*MOTOR_LS_MH*0.001*MAXIMUM_CURRENT_A", "V peak",
             "PARAM_EMF_MAX_V in drive/param_scaling.h", "0.00")
    needed = "IF(id_half_table=\"\",-id_half_deepest,-id_half_table)"
    wanted = f"MAX({design.TRIM_SHARE}*MAXIMUM_CURRENT_A,MIN(1.2*{needed},0.8*MAXIMUM_CURRENT_A))"
    parameter(page, motor, Rule("FW_TRIM_CURRENT_A", digits_down(wanted, 1),
                                f"{design.TRIM_SHARE:.0%} of the largest current, or what rated speed needs at half the rated torque", "real"))
    quantity(page, "Duty per volt", "duty_per_volt", "ROUND(LOOPTIME_SEC/0.000000025,0)*4*NORM_VOLTAGE_CONST/BUS_FULL_SCALE_V*4294967296", "count",
             "DUTY_PER_VOLT_NUMERATOR", "0")
    top = "(ROUND(LOOPTIME_SEC/0.000000025,0)-2*ROUND(SAMPLE_WINDOW_SEC/0.000000025,0))"
    quantity(page, "Voltage per bus", "voltage_per_bus", f"{top}/ROUND(LOOPTIME_SEC/0.000000025,0)/SQRT(3)*BUS_FULL_SCALE_V/NORM_VOLTAGE_CONST/2",
             "count", "PARAM_VOLTAGE_PER_BUS", "0")


def _speeds(page: Page, motor: DataPage) -> None:
    most = f"INT({limits.LARGEST_ERPM:g}/pole_pairs)"
    parameter(page, motor, Rule("NOMINAL_SPEED_RPM", significant(f"MIN(rated_speed_rpm,INT({limits.LARGEST_NOMINAL_ERPM:g}/pole_pairs))", 6),
                                "rated speed, at most 27000 electrical rpm"))
    reachable = digits_down("highest_speed_rpm", 3)
    parameter(page, motor, Rule("MAXIMUM_SPEED_RPM", f"INT(MIN(wanted_speed_rpm,{most},MAX({reachable},rated_speed_rpm)))",
                                "highest speed wanted, at most 32000 electrical rpm and what field weakening reaches without load (sheet Search)"))
    slope = f"MAX(1,MIN(rated_speed_rpm/{design.REFERENCE_RISE_S},{design.REFERENCE_TORQUE_SHARE}*rated_torque_nm/(inertia_kgm2+load_inertia_kgm2)/{RPM},60000))"
    parameter(page, motor, Rule("SPEEDREFRAMP_RPM_PER_S", digits_down(slope, 2),
                                f"rated speed in {design.REFERENCE_RISE_S:g} s, or J dw/dt at most {design.REFERENCE_TORQUE_SHARE:.0%} of rated "
                                f"torque"))


def _warnings(page: Page) -> None:
    for text, test, message, cure in (
            ("rated speed in electrical rpm", f"rated_speed_rpm*pole_pairs<={limits.LARGEST_ERPM:g}", "above 32000 electrical rpm",
             "the firmware's speeds end there: lower the rated speed"),
            ("current for half the rated torque", "iq_half<=MAXIMUM_CURRENT_A", "more than allowed",
             "a board with a larger current range, or a higher maximum current"),
            ("voltage for rated speed at half the torque", 'id_half_full<>""', "the supply is too low", "raise the supply, or lower the rated speed"),
            ("voltage for rated speed at rated torque", 'OR(id_rated_full<>"",iq_rated>MAXIMUM_CURRENT_A)',
             "warning: the supply is too low for the rated torque", "raise the supply, or lower the rated speed"),
            ("rated current", "rated_current_a<=MAXIMUM_CURRENT_A", "warning: above MAXIMUM_CURRENT_A", "a smaller shunt or gain raises it"),
            ("highest current", "motor_maximum_current_a<=board_current_a", "warning: above what this board can measure",
             "a smaller shunt or gain raises it"),
            ("highest current in the back-EMF's format", "maximum_found_a>=0.999*MIN(motor_maximum_current_a,board_current_a)-0.005",
             "warning: lowered by the back-EMF's number format", "a lower highest speed, or a higher supply"),
            ("highest speed", "MAXIMUM_SPEED_RPM>=INT(wanted_speed_rpm)", "warning: not reachable, lowered",
             "a higher supply or maximum current raises it, up to 32000 electrical rpm"),
            ("derivative limit, eight periods", f"8*{DI.format(rpm='NOMINAL_SPEED_RPM')}<=1.02*16383", "warning: ends at 16383 counts",
             "the estimated angle lags at high current: lower MAXIMUM_CURRENT_A or the speed"),
            ("derivative limit, one period", f"{DI.format(rpm='MAXIMUM_SPEED_RPM')}<=1.02*4095", "warning: ends at 4095 counts",
             "the estimated angle lags at high current: lower MAXIMUM_CURRENT_A or the speed")):
        row = page.next_row()
        page.put(f"A{row}", text, "label")
        for column in "BCDEF":
            page.put(f"{column}{row}", None, "unit")
        page.check(f"G{row}", f'=IF({test},"ok","{message}")')
        page.put(f"H{row}", cure, "note")


def _relations(page: Page) -> None:
    for relation in relations():
        if "IDREF_SPEED" in relation.condition or "_CTERM" in relation.condition:
            continue  # checked on the sheet Field weakening; constants here
        row = page.next_row()
        page.put(f"A{row}", f"relation of {relation.condition.replace('PARAM_F', '').split()[0].strip('()')}", "label")
        for column in "BCDEF":
            page.put(f"{column}{row}", None, "unit")
        page.check(f"G{row}", f'=IF({condition(relation.condition)},"ok","not so: see the rule beside it")')
        page.put(f"H{row}", relation.message, "note")
