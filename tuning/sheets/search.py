"""The "Search" sheet: what the command finds by trying, as rows of halving steps and solved equations."""

from tuning import limits

from .book import Book, Page
from .formulas import RPM, digits_down, significant

STEPS = 45
TRIP_STEPS = 80
WIDTHS = [44] + [15] * 10
VOLT = "SQRT((rs_ohm*{i_d}-{w}*lq_h*{i_q})^2+(rs_ohm*{i_q}+{w}*(ld_h*{i_d}+psi_vs))^2)"


def _volt(w: str, i_d: str, i_q: str) -> str:
    return VOLT.format(w=w, i_d=i_d, i_q=i_q)


def _deepest(i_q: str) -> str:
    return f"-MIN(SQRT(MAX(({limits.D_SHARE}*MAXIMUM_CURRENT_A)^2-{i_q}^2,0)),psi_vs/ld_h)"


def search_page(book: Book) -> Page:
    """Builds the sheet."""
    page = book.page("Search", WIDTHS, "A5A5A5",
                     "Speeds by halving an interval, d currents from the voltage equation |V| <= share of the circle, the trip level step by step.")
    _points(page)
    _halving(page, "Base speed: no load, no d current, the whole circle", "base_speed_rpm", "circle_v", weakening=False)
    _halving(page, f"Highest speed: no load, field weakening, {limits.FULL_SHARE:.0%} of the circle", "highest_speed_rpm",
             f"{limits.FULL_SHARE}*circle_v", weakening=True)
    _trip(page)
    page.ws.print_area = f"A1:J{page.row - 1}"
    return page


def _points(page: Page) -> None:
    page.section("Least d current at an operating point: the root of (R Id - w Lq Iq)^2 + (R Iq + w (Ld Id + psi))^2 = U^2")
    page.heads(["Point", "rpm", "Load N m", "Voltage U", "w rad/s", "Iq A", "Deepest Id", "|V| at Id = 0", "|V| at deepest", "Least Id (empty: none)",
                "Used"], freeze=True)
    for label, rpm, load, share, names in (
            ("rated speed, half torque, share of the tables", "rated_speed_rpm", "0.5*rated_torque_nm", limits.TABLE_SHARE,
             {"J": "id_half_table", "G": "id_half_deepest"}),
            ("rated speed, half torque, share under load", "rated_speed_rpm", "0.5*rated_torque_nm", limits.FULL_SHARE,
             {"J": "id_half_full", "F": "iq_half"}),
            ("rated speed, rated torque, share under load", "rated_speed_rpm", "rated_torque_nm", limits.FULL_SHARE,
             {"J": "id_rated_full", "F": "iq_rated"})):
        row = _point(page, label, rpm, load, share)
        for column, name in names.items():
            page.name(name, f"{column}{row}")
    for i in range(limits.ENTRIES):
        row = _point(page, f"entry {i} of the tables", f"FW_START_SPEED_RPM+{i}*{limits.STEP_ERPM:g}/pole_pairs", "0", limits.TABLE_SHARE)
        least = f'IF(J{row}="",G{row},J{row})'
        page.put(f"K{row}", "=0" if i == 0 else f"=MIN({least},K{row - 1})", "value", "0.0000")
        page.name(f"entry_id_{i}", f"K{row}")


def _point(page: Page, label: str, rpm: str, load: str, share: float) -> int:
    row = page.next_row()
    a = f"(rs_ohm^2+(E{row}*ld_h)^2)"
    b = f"(2*E{row}*(ld_h*(rs_ohm*F{row}+E{row}*psi_vs)-rs_ohm*lq_h*F{row}))"
    c = f"((E{row}*lq_h*F{row})^2+(rs_ohm*F{row}+E{row}*psi_vs)^2-D{row}^2)"
    root = f"(-{b}+SQRT(MAX({b}^2-4*{a}*{c},0)))/(2*{a})"
    page.put(f"A{row}", label, "label")
    for column, formula, form in (
            ("B", rpm, "0.0"), ("C", load, "0.0000"), ("D", f"{share}*circle_v", "0.000"), ("E", f"B{row}*{RPM}*pole_pairs", "0.0"),
            ("F", f"(C{row}+coulomb_nm+viscous_nms*B{row}*{RPM})/kt_nm_per_a", "0.0000"), ("G", _deepest(f"F{row}"), "0.0000"),
            ("H", _volt(f"E{row}", "0", f"F{row}"), "0.000"), ("I", _volt(f"E{row}", f"G{row}", f"F{row}"), "0.000"),
            ("J", f'IF(F{row}>MAXIMUM_CURRENT_A,"",IF(H{row}<=D{row},0,IF(I{row}>D{row},"",{root})))', "0.0000")):
        page.put(f"{column}{row}", f"={formula}", "value", form)
    page.put(f"K{row}", None, "value")
    return row


def _halving(page: Page, title: str, name: str, limit: str, weakening: bool) -> None:
    page.section(title)
    page.heads(["Step", "Low rpm", "High rpm", "Middle", "w rad/s", "Iq A", "Deepest Id", "|V| at Id = 0", "|V| at deepest", "Reached", ""])
    first = page.row
    for step in range(STEPS + 1):
        row = page.next_row()
        page.put(f"A{row}", "the highest of all" if step == 0 else step, "label")
        low, high, middle = (("0", "65535/pole_pairs", f"C{row}") if step == 0 else
                             ("0", f"C{first}", f"(B{row}+C{row})/2") if step == 1 else
                             (f"IF(J{row - 1},D{row - 1},B{row - 1})", f"IF(J{row - 1},C{row - 1},D{row - 1})", f"(B{row}+C{row})/2"))
        reached = f"AND(F{row}<=MAXIMUM_CURRENT_A,OR(H{row}<={limit},I{row}<={limit}))" if weakening else f"H{row}<={limit}"
        for column, formula, form in (
                ("B", low, "0.0000"), ("C", high, "0.0000"), ("D", middle, "0.0000"), ("E", f"D{row}*{RPM}*pole_pairs", "0.0"),
                ("F", f"(coulomb_nm+viscous_nms*D{row}*{RPM})/kt_nm_per_a", "0.0000"), ("G", _deepest(f"F{row}"), "0.0000"),
                ("H", _volt(f"E{row}", "0", f"F{row}"), "0.000"), ("I", _volt(f"E{row}", f"G{row}", f"F{row}"), "0.000"), ("J", reached, "General")):
            page.put(f"{column}{row}", f"={formula}", "value", form)
    row = page.next_row()
    page.put(f"A{row}", "found", "label")
    page.put(f"B{row}", f"=IF(J{first},C{first},IF(J{row - 1},D{row - 1},B{row - 1}))", "result", "0.00")
    page.name(name, f"B{row}")


def _trip(page: Page) -> None:
    page.section("Trip level and largest current: lowered until voltage + R I + L dI/dt fits the back-EMF's number format")
    fastest = f"(MAX(MIN(wanted_speed_rpm,{limits.LARGEST_ERPM:g}/pole_pairs),1.5*rated_speed_rpm)*{RPM}*pole_pairs)"
    row = page.next_row()
    page.put(f"A{row}", "room for R I + L dI/dt, V", "label")
    page.put(f"B{row}", "=0.985*4*supply_v/SQRT(3)*(1-dead_time_s/pwm_period_s)-trip_bus_v/SQRT(3)", "value", "0.000")
    room = f"$B${row}"
    page.heads(["Step", "Trip level A", "Largest current A", "R I + L dI/dt V", "Fits", "", "", "", "", "", ""])
    first, least = page.row, limits.LEAST_TRIP_OVER_MAXIMUM
    for step in range(TRIP_STEPS):
        row = page.next_row()
        page.put(f"A{row}", step, "label")
        if step == 0:
            most = f'IF(maximum_current_yours="",MIN({significant("motor_maximum_current_a", 3)},board_current_a),maximum_current_yours)'
            trip = significant(f"MIN({digits_down(f'({limits.TRIP_OVER_MAXIMUM}*C{row})', 3)},highest_trip_a)", 6)
        else:
            t, m = f"B{row - 1}", f"C{row - 1}"
            done, high = f"OR(E{row - 1},{m}<=0.5*rated_current_a)", f"{t}>1.02*{least}*{m}"
            most = f"IF(OR({done},{high}),{m},{significant(f'(0.97*{m})', 3)})"
            trip = f"IF({done},{t},IF({high},{significant(f'MAX(0.98*{t},{least}*{m})', 3)},{significant(f'(1.001*{least}*C{row})', 3)}))"
        for column, formula, form in (("B", trip, "0.000"), ("C", most, "0.000"),
                                      ("D", f"2/SQRT(3)*B{row}*rs_ohm+{fastest}*1.2*lq_h*C{row}", "0.000"), ("E", f"D{row}<{room}", "General")):
            page.put(f"{column}{row}", f"={formula}", "value", form)
    last = page.row - 1
    row = page.next_row()
    page.put(f"A{row}", "found", "label")
    for column, name in (("B", "trip_found_a"), ("C", "maximum_found_a")):
        page.put(f"{column}{row}", f"=IF(E{last},{column}{last},{column}{first})", "result", "0.000")
        page.name(name, f"{column}{row}")
