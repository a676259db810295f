"""The "Loops" sheet: gains from bandwidths, phase margins with the firmware's delays, and the "Bode" sheet that they are read from."""

from openpyxl.chart import Reference
from openpyxl.utils import get_column_letter

from tuning import loops

from .book import Book, Page
from .data import DataPage
from .formulas import RPM, significant
from .parameters import HEADS, WIDTHS, Rule, parameter, quantity

POINTS = 120
SPEEDS = (("MINIMUM_SPEED_RPM", "minimum"), ("NOMINAL_SPEED_RPM", "nominal"), ("MAXIMUM_SPEED_RPM", "maximum"))
IU = "(NORM_CURRENT_CONST/NORM_VOLTAGE_CONST)"
FIRST = 6
LAST = FIRST + POINTS - 1
SALIENT = "(ld_h<>lq_h)"


def loops_page(book: Book, motor: DataPage, margins: dict[str, str]) -> Page:
    """Builds the sheet; `margins` are the formulas that bode_page() returns."""
    page = book.page("Loops", WIDTHS, "1F4E79",
                     "Bandwidths are inputs: make tune finds the largest ones with 60 degrees of margin over a whole set of wrong motor values. The "
                     "margins here are live.")
    page.heads(HEADS, freeze=True)
    page.section("Bandwidths")
    cap = f"MIN({loops.CURRENT_CAP}/pwm_period_s,2000)"
    parameter(page, motor, Rule("CURRENT_BANDWIDTH_HZ", _command(motor, "CURRENT_BANDWIDTH_HZ", f"ROUND({cap}*0.8,-1)"),
                                "found by make tune for the motors of the list; for your own motor 0.8 of its upper end: look at the margins"))
    parameter(page, motor, Rule("SPEED_BANDWIDTH_HZ", _command(motor, "SPEED_BANDWIDTH_HZ", "5"),
                                "found by make tune for the motors of the list; for your own motor start with 5 Hz and raise it while the margins "
                                "allow"))
    page.section("A motor that differs from the file (1: as in the file): what the margins become then")
    for label, name in (("True R / R", "factor_r"), ("True L / L", "factor_l"), ("True flux / flux", "factor_psi")):
        row = page.next_row()
        for column in "BEFG":
            page.put(f"{column}{row}", None, "unit")
        page.put(f"A{row}", label, "label")
        page.put(f"C{row}", None, "input", "0.00")
        page.range(f"C{row}", 0.3, 3, label)
        page.put(f"D{row}", f'=IF(C{row}="",1,C{row})', "result", "0.00")
        page.put(f"H{row}", "make tune tries 0.7 .. 1.3 for R and L, 0.85 .. 1.15 for the flux, and the published spread", "note")
        page.name(name, f"D{row}")
    _margins(page, motor, margins)
    _gains(page, motor)
    _charts(page)
    page.ws.page_setup.fitToHeight = 1
    page.ws.print_area = f"A1:H{page.row + 42}"
    return page


def _command(motor: DataPage, name: str, fallback: str) -> str:
    picked = motor.pick(f"command.{name}")
    return f'IF({picked}="",{fallback},{picked})'


def _margins(page: Page, motor: DataPage, margins: dict[str, str]) -> None:
    page.section(f"Margins: {loops.PHASE_MARGIN_DEG:.0f} degrees are asked for")
    for axis in ("q", "d"):
        for at in ("standstill", "top"):
            where = "at standstill" if at == "standstill" else "at MAXIMUM_SPEED_RPM, the smaller of both signs of frequency"
            _margin(page, f"Current loop, {axis} axis, {at}", f"margin_{axis}_{at}", margins, where)
    for name, label in SPEEDS:
        _margin(page, f"Speed loop at {label} speed", f"margin_speed_{label}", margins,
                f"at {name}; the estimator is slower the slower the motor turns")
    for label, key in (("Current loop, worst of the set", "current"), ("Speed loop, worst of the set", "speed")):
        row = page.next_row()
        for column in "BCFG":
            page.put(f"{column}{row}", None, "unit")
        page.put(f"A{row}", label, "label")
        page.put(f"D{row}", f"={motor.pick(f'command.{key}_worst_deg')}", "value", "0.0")
        page.put(f"E{row}", "degrees", "unit")
        page.put(f"H{row}", "what make tune found for the file's values and its own bandwidths; empty for your own motor", "note")


def _margin(page: Page, label: str, name: str, margins: dict[str, str], why: str) -> None:
    quantity(page, label, name, margins[name], "degrees", why, "0.0",
             f'IF({name}>={loops.PHASE_MARGIN_DEG:g},"ok","below {loops.PHASE_MARGIN_DEG:g} degrees: lower the bandwidth")')


def _gains(page: Page, motor: DataPage) -> None:
    page.section("Gains in userparams.h units (derived by include/drive/param_scaling.h; lines to paste only for a salient motor)")
    common = f"2*PI()*CURRENT_BANDWIDTH_HZ*MOTOR_LS_MH*0.001*{IU}/16"
    for name, inductance in (("D_CURRCNTR_PTERM", "ld_h"), ("Q_CURRCNTR_PTERM", "lq_h")):
        own = significant(f"(2*PI()*CURRENT_BANDWIDTH_HZ*{inductance}*{IU}/16)", 5)
        parameter(page, motor, Rule(name, f"IF({SALIENT},{own},{common})", "2 pi f L I0/U0 / 16; each axis its own inductance if they differ"),
                  "Q15, gain / 16", "0.0000001", "0.99")
    integral = f"2*PI()*CURRENT_BANDWIDTH_HZ*MOTOR_RS_OHM*LOOPTIME_SEC*{IU}"
    for name in ("D_CURRCNTR_ITERM", "Q_CURRCNTR_ITERM"):
        quantity(page, name, name, integral, "Q15 a period", "2 pi f R Ts I0/U0: the zero cancels the motor's pole", "0.00000")
    kt = "(1.5*MOTOR_KPHI_V_PER_KRPM/SQRT(3)*60/(2000*PI()))"
    quantity(page, "SPEEDCNTR_PTERM", "SPEEDCNTR_PTERM",
             f"2*PI()*SPEED_BANDWIDTH_HZ*MOTOR_INERTIA_KGM2/{kt}*{RPM}/NOPOLESPAIRS/NORM_CURRENT_CONST/16", "Q15, gain / 16",
             "2 pi f J/Kt in A per electrical rpm, over I0, / 16", "0.00000")
    quantity(page, "SPEEDCNTR_ITERM", "SPEEDCNTR_ITERM", "SPEEDCNTR_PTERM*32/3*PI()*SPEED_BANDWIDTH_HZ*LOOPTIME_SEC", "Q15 a period", "the zero at f/3",
             "0.00000")


def _vector(page: Page, row: int, magnitude: str, angle: str, values: tuple[str, str], forms: tuple[str, str] = ("0.00000", "0.00")) -> None:
    for column, value, form in zip((magnitude, angle), values, forms):
        page.put(f"{column}{row}", f"={value}", "value", form)


_CONSTANTS = {
    "bode_ts": "pwm_period_s", "bode_r": "rs_ohm*factor_r", "bode_ld": "ld_h*factor_l", "bode_lq": "lq_h*factor_l", "bode_psi": "psi_vs*factor_psi",
    "bode_top": f"MAXIMUM_SPEED_RPM*{RPM}*pole_pairs*pwm_period_s", "bode_kpd": "2*PI()*CURRENT_BANDWIDTH_HZ*ld_h",
              "bode_kpq": "2*PI()*CURRENT_BANDWIDTH_HZ*lq_h",
    "bode_ki": "2*PI()*CURRENT_BANDWIDTH_HZ*rs_ohm*pwm_period_s", "bode_hd": "EXP(-bode_r*bode_ts/(2*bode_ld))",
              "bode_hq": "EXP(-bode_r*bode_ts/(2*bode_lq))",
    "bode_j": "inertia_kgm2+load_inertia_kgm2", "bode_kps": "2*PI()*SPEED_BANDWIDTH_HZ*bode_j/kt_nm_per_a/pole_pairs",
    "bode_kis": f"bode_kps*2*PI()*SPEED_BANDWIDTH_HZ/{loops.ZERO_RATIO}*{loops.SLOTS}*bode_ts", "bode_e": "KFILTER_ESDQ/32768",
              "bode_v": "KFILTER_VELESTIM/32768",
    "bode_kt": "1.5*pole_pairs*bode_psi"}


def bode_page(book: Book) -> dict[str, str]:
    """Builds the sheet Bode: the open loops over frequency. Returns the margins' formulas by name."""
    margins: dict[str, str] = {}
    labels: list[str] = ["Hz (current)", "w Ts"]
    cases = [(axis, at, sign) for axis in ("q", "d") for at, signs in (("standstill", (1,)), ("top", (1, -1))) for sign in signs]
    for axis, at, sign in cases:
        labels += [f"{axis}, {at}{', -f' if sign < 0 else ''}: |L|", "degrees", "margin"]
    start_speed = len(labels)
    labels += ["Hz (speed)", "w Ts", "|inner loop|", "angle", "controller |.|", "angle", "shaft re", "shaft im", "filter F re", "im", "integrator re",
               "im", "speed filter |.|", "angle"]
    for _, label in SPEEDS:
        labels += [f"{label}: denominator re", "im", "bracket re", "im", "|L|", "degrees", "margin"]
    page = book.page("Bode", [12.0] * len(labels), "A5A5A5",
                     "The open loops over frequency; phase in degrees; a margin stands where the magnitude falls through 1. Equations: "
                     "tuning/loops.py.")
    page.row = 3
    for i, (name, formula) in enumerate(_CONSTANTS.items()):
        column = _column(2 * i)
        page.put(f"{column}3", name, "unit")
        page.put(f"{_column(2 * i + 1)}3", f"={formula}", "value", "0.000E+00")
        page.name(name, f"{_column(2 * i + 1)}3")
    page.row = FIRST - 1
    page.heads(labels, freeze=True)
    for k in range(POINTS):
        row = page.next_row()
        _current_row(page, row, k, cases)
        _speed_row(page, row, k, start_speed)
    for i, (axis, at, sign) in enumerate(cases):
        column = _column(4 + 3 * i)
        name = f"margin_{axis}_{at}"
        own = f"IF(COUNT('Bode'!${column}${FIRST}:${column}${LAST})=0,180,MIN('Bode'!${column}${FIRST}:${column}${LAST}))"
        margins[name] = f"MIN({margins[name]},{own})" if sign < 0 else own
    for i, (_, label) in enumerate(SPEEDS):
        column = _column(start_speed + 14 + 7 * i + 6)
        margins[f"margin_speed_{label}"] = f"IF(COUNT('Bode'!${column}${FIRST}:${column}${LAST})=0,180,MIN('Bode'!${column}${FIRST}:${column}${LAST}))"
    page.ws.print_area = f"A1:{_column(10)}{LAST}"
    return margins


def _column(index: int) -> str:
    return get_column_letter(index + 1)


def _crossing(page: Page, row: int, size: str, angle: str, target: str) -> None:
    """180 degrees + phase where the magnitude falls through 1, between this row and the next one."""
    if row == LAST:
        page.put(f"{target}{row}", None, "value")
        return
    a, b = f"{size}{row}", f"{size}{row + 1}"
    step = f"(MOD({angle}{row + 1}-{angle}{row}+180,360)-180)"
    share = f"LN({a})/(LN({a})-LN({b}))"
    page.put(f"{target}{row}", f'=IF(({a}-1)*({b}-1)<=0,MOD({angle}{row}+{share}*{step},360)-180,"")', "value", "0.00")


def _current_row(page: Page, row: int, k: int, cases: list[tuple[str, str, int]]) -> None:
    page.put(f"A{row}", f"=5*(0.4999/bode_ts/5)^({k}/{POINTS - 1})", "value", "0.00")
    page.put(f"B{row}", f"=2*PI()*A{row}*bode_ts", "value", "0.00000")
    for i, (axis, at, sign) in enumerate(cases):
        size, angle, margin = (_column(2 + 3 * i + j) for j in range(3))
        theta, phi = (f"B{row}" if sign > 0 else f"(-B{row})"), ("bode_top" if at == "top" else "0")
        _vector(page, row, size, angle, _current(theta, phi, axis))
        if sign < 0:
            page.ws[f"{angle}{row}"].value = "=-(" + page.ws[f"{angle}{row}"].value[1:] + ")"
        _crossing(page, row, size, angle, margin)


def _current(theta: str, phi: str, axis: str) -> tuple[str, str]:
    """(Kp + Ki/(z-1)) (1-h)/R (z + h e^-j phi) / (z (z - h^2 e^-j phi)): magnitude, degrees."""
    h, kp = f"bode_h{axis}", f"bode_kp{axis}"
    c, s = f"COS({theta})", f"SIN({theta})"
    factors = [(f"({c}-(1-bode_ki/{kp}))", s, 1), (f"({c}+{h}*COS({phi}))", f"({s}-{h}*SIN({phi}))", 1), (f"({c}-1)", s, -1),
               (f"({c}-{h}^2*COS({phi}))", f"({s}+{h}^2*SIN({phi}))", -1)]
    top = "*".join(f"SQRT({re}^2+{im}^2)" for re, im, power in factors if power > 0)
    bottom = "*".join(f"SQRT({re}^2+{im}^2)" for re, im, power in factors if power < 0)
    angle = "".join(f"{'+' if power > 0 else '-'}ATAN2({re},{im})" for re, im, power in factors)
    return f"{kp}*(1-{h})/bode_r*{top}/({bottom})", f"({angle[1:]}-({theta}))*180/PI()"


def _speed_row(page: Page, row: int, k: int, base: int) -> None:
    c = [f"{_column(base + i)}{row}" for i in range(14)]
    column = [_column(base + i) for i in range(14)]
    page.put(c[0], f"=0.05*(0.45/({loops.SLOTS}*bode_ts)/0.05)^({k}/{POINTS - 1})", "value", "0.000")
    page.put(c[1], f"=2*PI()*{c[0]}*bode_ts", "value", "0.00000")
    size, angle = _current(c[1], "0", "q")
    page.put(c[2], f"={size}", "value", "0.0000")
    page.put(c[3], f"=({angle})*PI()/180", "value", "0.0000")
    slow = f"({loops.SLOTS}*{c[1]})"
    zero = "(1-bode_kis/bode_kps)"
    _vector(page, row, column[4], column[5], (
        f"bode_kps*SQRT((COS({slow})-{zero})^2+SIN({slow})^2)/SQRT((COS({slow})-1)^2+SIN({slow})^2)*SIN({slow}/2)/({slow}/2)",
        f"ATAN2(COS({slow})-{zero},SIN({slow}))-ATAN2(COS({slow})-1,SIN({slow}))-{slow}/2"))
    w = f"({c[1]}/bode_ts)"
    shaft = f"bode_kt*pole_pairs/(viscous_nms^2+(bode_j*{w})^2)"
    page.put(c[6], f"={shaft}*viscous_nms", "value", "0.000E+00")
    page.put(c[7], f"=-{shaft}*bode_j*{w}", "value", "0.000E+00")
    # F = e/(1 - (1-e)/z): 1/z = cos - j sin
    re, im = f"(1-(1-bode_e)*COS({c[1]}))", f"((1-bode_e)*SIN({c[1]}))"
    page.put(c[8], f"=bode_e*{re}/({re}^2+{im}^2)", "value", "0.00000")
    page.put(c[9], f"=-bode_e*{im}/({re}^2+{im}^2)", "value", "0.00000")
    gap = f"((COS({c[1]})-1)^2+SIN({c[1]})^2)"
    page.put(c[10], f"=bode_ts*(COS({c[1]})-1)/{gap}", "value", "0.000E+00")
    page.put(c[11], f"=-bode_ts*SIN({c[1]})/{gap}", "value", "0.000E+00")
    re, im = f"(1-(1-bode_v)*COS({c[1]}))", f"((1-bode_v)*SIN({c[1]}))"
    _vector(page, row, column[12], column[13], (f"bode_v/SQRT({re}^2+{im}^2)", f"-ATAN2({re},{im})"))
    for i, (name, _) in enumerate(SPEEDS):
        _speed_case(page, row, base + 14 + 7 * i, name, c)


def _speed_case(page: Page, row: int, base: int, name: str, c: list[str]) -> None:
    """C T (shaft s (1 + w0 I) + wrong) F / (1 + s F w0 I) V e^(-1.5 w Ts); s = true flux / flux."""
    d = [_column(base + i) for i in range(7)]
    w0, w = f"({name}*{RPM}*pole_pairs)", f"({c[1]}/bode_ts)"
    f_re, f_im, i_re, i_im, s_re, s_im = c[8], c[9], c[10], c[11], c[6], c[7]
    page.put(f"{d[0]}{row}", f"=1+factor_psi*{w0}*({f_re}*{i_re}-{f_im}*{i_im})", "value", "0.0000")
    page.put(f"{d[1]}{row}", f"=factor_psi*{w0}*({f_re}*{i_im}+{f_im}*{i_re})", "value", "0.0000")
    one_re, one_im = f"(1+{w0}*{i_re})", f"({w0}*{i_im})"
    page.put(f"{d[2]}{row}", f"=factor_psi*({s_re}*{one_re}-{s_im}*{one_im})+rs_ohm*(factor_r-1)/psi_vs", "value", "0.000E+00")
    page.put(f"{d[3]}{row}", f"=factor_psi*({s_re}*{one_im}+{s_im}*{one_re})+{w}*lq_h*(factor_l-1)/psi_vs", "value", "0.000E+00")
    inner_re, inner_im = f"(1+{c[2]}*COS({c[3]}))", f"({c[2]}*SIN({c[3]}))"
    size = (f"{c[4]}*{c[2]}/SQRT({inner_re}^2+{inner_im}^2)*SQRT({d[2]}{row}^2+{d[3]}{row}^2)*SQRT({f_re}^2+{f_im}^2)"
            f"/SQRT({d[0]}{row}^2+{d[1]}{row}^2)*{c[12]}")
    angle = (f"({c[5]}+{c[3]}-ATAN2({inner_re},{inner_im})+ATAN2({d[2]}{row},{d[3]}{row})+ATAN2({f_re},{f_im})"
             f"-ATAN2({d[0]}{row},{d[1]}{row})+{c[13]}-1.5*{c[1]})*180/PI()")
    _vector(page, row, d[4], d[5], (size, angle))
    _crossing(page, row, d[4], d[5], d[6])


def _charts(page: Page) -> None:
    bode = page.book.wb["Bode"]

    def cells(column: int) -> Reference:
        return Reference(bode, min_col=column, min_row=FIRST, max_row=LAST)

    base = 2 + 3 * 6
    current = [("standstill", cells(1), 3), ("top speed", cells(1), 6)]
    speed = [(label, cells(base + 1), base + 14 + 7 * i + 5) for i, (_, label) in enumerate(SPEEDS)]
    row = page.row + 2
    for name, lines, column in (("Current loop, q axis", current, "A"), ("Speed loop", speed, "G")):
        size = page.chart(f"{name}: magnitude", "Hz", "|L|", f"{column}{row}", [(label, x, cells(y)) for label, x, y in lines])
        size.y_axis.scaling.logBase, size.y_axis.scaling.min, size.y_axis.scaling.max, size.y_axis.crosses = 10, 0.01, 1000, "min"
        phase = page.chart(f"{name}: phase", "Hz", "degrees", f"{column}{row + 19}", [(label, x, cells(y + 1)) for label, x, y in lines])
        phase.y_axis.scaling.min, phase.y_axis.scaling.max, phase.y_axis.majorUnit = -270, 0, 30
        for chart in (size, phase):
            chart.x_axis.scaling.logBase = 10
