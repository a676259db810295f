"""The "Field weakening" sheet: the 18 entries of the three tables, and what they do to the voltage."""

from openpyxl.chart import Reference

from tuning import limits
from tuning.fw_tables import FINGERPRINT

from .book import Book, Page
from .data import DataPage
from .formulas import RPM, down
from .parameters import Rule

WIDTHS = [9, 12, 12, 12, 12, 14, 12, 14, 12, 12, 12, 13, 13, 46]
TABLE_HEADS = ["Entry", "Speed rpm", "Id by rule", "Yours", "Id used (A)", "1/Kphi by rule", "Yours", "1/Kphi used", "Ls ratio by rule", "Yours",
               "Ls ratio used",
               "|V| without load", "of the circle", "Check"]


def weakening_page(book: Book, motor: DataPage) -> Page:
    """Builds the sheet."""
    page = book.page("Field weakening", WIDTHS, "1F4E79",
                     "One entry every 1024 electrical rpm of speed reference. From make tune-fw where the motor has a table; otherwise from the "
                     "voltage equation.")
    _head(page, motor)
    page.heads(TABLE_HEADS)
    page.ws.freeze_panes = f"C{page.row}"
    first = page.row
    for i in range(limits.ENTRIES):
        _entry(page, motor, i)
    _charts(page, first)
    page.ws.page_setup.fitToHeight = 1
    page.ws.print_area = f"A1:N{page.row + 20}"
    return page


def _head(page: Page, motor: DataPage) -> None:
    """Where the tables come from, and the speed of entry 0."""
    page.row = 4
    tuned = _same(motor)
    for label, name, formula, form, why in (
            ("A table of make tune-fw for exactly these values", "tables_match", tuned, "General", "TRUE: used below; FALSE: the voltage equation"),
            ("Base speed without load", "base_speed_shown", "base_speed_rpm", "0", "rpm; sheet Search")):
        row = page.next_row()
        page.put(f"A{row}", label, "wide")
        page.ws.merge_cells(f"A{row}:D{row}")
        page.put(f"E{row}", f"={formula}", "value", form)
        page.put(f"F{row}", why, "unit")
        page.ws.merge_cells(f"F{row}:N{row}")
        page.name(name, f"E{row}")
    reach = f"(MAXIMUM_SPEED_RPM-{(limits.ENTRIES - 1) * limits.STEP_ERPM:g}/pole_pairs)"
    start = (f"MAX(MIN(MAX({down('0.875*base_speed_rpm', '50')},-INT(-{reach}/50)*50),{down('0.95*MAXIMUM_SPEED_RPM', '50')},"
             f"{limits.FW_START_RPM[1]:g}),{limits.FW_START_RPM[0]:g})")
    table = motor.pick("tables.start_speed_rpm")
    rule = Rule("FW_START_SPEED_RPM", f"IF(tables_match,{table},{start})", "")
    page.book.rules[rule.name] = rule
    row = page.next_row()
    formula = rule.formula
    if motor.has(f"tune.{rule.name}"):
        picked = motor.pick(f"tune.{rule.name}")
        formula = f'IF({picked}="",{formula},{picked})'
    page.put(f"A{row}", rule.name, "name")
    page.ws.merge_cells(f"A{row}:B{row}")
    page.put(f"C{row}", f"={formula}", "value", "0")
    page.put(f"D{row}", None, "input", "0")
    page.range(f"D{row}", 100, 20000, rule.name)
    page.put(f"E{row}", f'=IF(D{row}="",C{row},D{row})', "result", "0")
    page.put(f"F{row}", "speed reference of entry 0: 7/8 of the base speed, but so that 18 entries reach MAXIMUM_SPEED_RPM", "unit")
    page.ws.merge_cells(f"F{row}:M{row}")
    page.check(f"N{row}", f'=IF(AND(E{row}>=100,E{row}<=20000),"ok","outside 100 .. 20000 rpm")')
    page.name(rule.name, f"E{row}")
    page.next_row()


def _same(motor: DataPage) -> str:
    """Do the tables of the data sheet belong to the values in use?"""
    if not motor.has("tables.start_speed_rpm"):
        return "FALSE"
    tests = ",".join(f"ABS({name}-{motor.pick(f'tables.{name}')})<=0.0001*ABS({name})" for name in FINGERPRINT)
    return f'IF({motor.pick("tables.start_speed_rpm")}="",FALSE,AND({tests}))'


def _entry(page: Page, motor: DataPage, i: int) -> None:
    row = page.next_row()
    page.put(f"A{row}", i, "label")
    page.put(f"B{row}", f"=FW_START_SPEED_RPM+{i}*{limits.STEP_ERPM:g}/pole_pairs", "value", "0.0")
    equation = f"ROUND(-{down(f'(-entry_id_{i})', '0.01')},2)"
    for stem, columns, by_equation, low, high, form in (("IDREF_SPEED", "CDE", equation, -20, 0, "0.00"),
                                                        ("INVKFI_SPEED", "FGH", "NORM_INVKFIBASE", 2048, 32767, "0"),
                                                        ("LS_OVER2LS0_SPEED", "IJK", "0.5", 0.1, 0.6, "0.00##")):
        name = f"{stem}{i}"
        formula = by_equation
        if motor.has(f"tables.{name}"):
            known = motor.pick(f"tables.{name}")
            if stem == "INVKFI_SPEED":
                known = f'IF({known}="NORM_INVKFIBASE",NORM_INVKFIBASE,{known})'
            formula = f"IF(tables_match,{known},{formula})"
        if motor.has(f"tune.{name}"):
            picked = motor.pick(f"tune.{name}")
            formula = f'IF({picked}="",{formula},{picked})'
        page.put(f"{columns[0]}{row}", f"={formula}", "value", form)
        page.put(f"{columns[1]}{row}", None, "input", form)
        page.range(f"{columns[1]}{row}", low, high, name)
        page.put(f"{columns[2]}{row}", f'=IF({columns[1]}{row}="",{columns[0]}{row},{columns[1]}{row})', "result", form)
        page.name(name, f"{columns[2]}{row}")
        page.book.rules[name] = Rule(name, "", "", "fixed" if stem == "IDREF_SPEED" else "plain")
    w, i_q = f"(B{row}*{RPM}*pole_pairs)", f"((coulomb_nm+viscous_nms*B{row}*{RPM})/kt_nm_per_a)"
    page.put(f"L{row}", f"=SQRT((rs_ohm*E{row}-{w}*lq_h*{i_q})^2+(rs_ohm*{i_q}+{w}*(ld_h*E{row}+psi_vs))^2)", "value", "0.00")
    page.put(f"M{row}", f"=L{row}/circle_v", "value", "0 %")
    page.check(f"N{row}", f'=IF(AND(E{row}<=0,E{row}>=-MAXIMUM_CURRENT_A),IF(AND(H{row}>=2048,H{row}<=32767),IF(AND(K{row}>=0.1,K{row}<=0.6),"ok",'
                          '"Ls ratio outside 0.1 .. 0.6"),"1/Kphi outside 2048 .. 32767"),"Id must be negative and within MAXIMUM_CURRENT_A")')


def _charts(page: Page, first: int) -> None:
    last = first + limits.ENTRIES - 1

    def cells(column: int) -> Reference:
        return Reference(page.ws, min_col=column, min_row=first, max_row=last)

    for title, column, unit, anchor in (("d current", 5, "A", f"A{last + 3}"), ("Voltage without load", 12, "V", f"H{last + 3}")):
        page.chart(title, "speed reference, rpm", unit, anchor, [(title, cells(2), cells(column))], (15.0, 8.5))
