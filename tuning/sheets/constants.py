"""The "Constants" sheet: the note's constants with their pre-divisions and shifts, and every number that the firmware derives."""

from dataclasses import dataclass

from .book import Book, Page

WIDTHS = [36, 14, 17, 48, 16, 11, 12, 16, 13, 12, 12, 46, 56]
HEADS = ["Constant", "Stands for", "Unit", "Formula", "Before division", "Divided by 2^", "Yours (exponent)", "After division", "Stored",
         "Rounding error %",
         "Product shift >>", "Check", "Meaning"]
LARGEST_ERROR = 0.1
"""Rounding error of a motor constant, in percent, above which a check turns red."""


@dataclass(frozen=True)
class Scaled:
    """A constant of the note's sheet; `least` is the note's exponent, a larger one is taken if the value needs it."""

    name: str
    value: str
    unit: str
    text: str
    formula: str
    least: int
    shift: str
    meaning: str


NOTE = [
    Scaled("NORM_RS", "rs_ohm", "ohm", "Rs I0/U0 2^15 (Equation 5)", "rs_ohm*I0_a/U0_v*32768", 1, "", "phase resistance"),
    Scaled("NORM_LSDTBASE", "1000*lq_h", "mH", "(Ls/Ts) I0/U0 2^15 (Equation 5)", "lq_h/pwm_period_s*I0_a/U0_v*32768", 8,
           "+3", "phase inductance; with the eight-sample difference the shift is 3 more"),
    Scaled("NORM_INVKFIBASE", "kphi_v_per_krpm", "V/krpm", "sqrt(3) 1000 P U0/Kphi 2^15 (Equation 6)",
           "SQRT(3)*1000*pole_pairs*U0_v/kphi_v_per_krpm*32768", 1, "",
           "1/Kphi; the note shifts >> 15, then << 1"),
    Scaled("NORM_DELTAT", "pwm_period_s", "s", "Ts/60 2^16 2^15 (Equation 1)", "pwm_period_s/60*65536*32768", 0, "",
           "angle a period for 1 electrical rpm"),
]


@dataclass(frozen=True)
class Own:
    """A number of drive_params_t or a macro of param_scaling.h. `rounding`: nearest, up (half up), down, next (to the next whole number), count (it is
    a whole number already)."""

    name: str
    value: str
    unit: str
    q_format: str
    raw: str
    meaning: str
    rounding: str = "nearest"
    limit: float = 0.0
    """Rounding error in percent that is worth a warning; 0: none is."""


IU = "(NORM_CURRENT_CONST/NORM_VOLTAGE_CONST)"
RS_FULL = f"MOTOR_RS_OHM*{IU}*32768"
LS_FULL = f"MOTOR_LS_MH*0.001/LOOPTIME_SEC*{IU}*4096"
SLOTS = "(1/(8*LOOPTIME_SEC))"


def _exponent(full: str) -> str:
    return f"IF({full}<65535,0,IF({full}<131071,1,IF({full}<262143,2,3)))"


def _di(speed: str) -> str:
    return f"(2*PI()*{speed}/60*NOPOLESPAIRS*LOOPTIME_SEC*MAXIMUM_CURRENT_A/NORM_CURRENT_CONST/2)"


def _filter_hz(name: str) -> str:
    return f"-LN(1-{name}/32768)/(2*PI()*LOOPTIME_SEC)"


def _q13(name: str) -> str:
    return f"{name}/NORM_CURRENT_CONST/4"


def _bus(volt: str) -> str:
    return f"{volt}/BUS_FULL_SCALE_V*32768"


_FULL = "ROUND(LOOPTIME_SEC/0.000000025,0)"
_TOP = f"({_FULL}-2*ROUND(SAMPLE_WINDOW_SEC/0.000000025,0))"
_DEAD = "ROUND(DEADTIME_SEC/0.000000025,0)"
_KNEE = f"INT(1.1*{_DEAD}+0.000001)"
_LEAST = f"MIN(8*{_di('NOMINAL_SPEED_RPM')},16382.5)"
_MOST = f"MIN({_di('MAXIMUM_SPEED_RPM')},4094.5)"
_KP_VOLT = "16/" + IU

MOTOR = [
    Own("NORM_RS", "MOTOR_RS_OHM", "ohm", "Q15 / 2", f"MIN(MOTOR_RS_OHM*{IU}*16384,32767)", "Equation 5, the note's format, at most 32767"),
    Own("NORM_LSDTBASE", "MOTOR_LS_MH", "mH", "Q15 / 256", f"MIN(MOTOR_LS_MH*0.001/LOOPTIME_SEC*{IU}*128,32767)", "Equation 5, the note's format, at most 32767"),
    Own("NORM_INVKFIBASE", "MOTOR_KPHI_V_PER_KRPM", "V/krpm", "Q15 / 2, 1/Kphi",
        "SQRT(3)*1000*NOPOLESPAIRS*NORM_VOLTAGE_CONST/MOTOR_KPHI_V_PER_KRPM*16384", "Equation 6", limit=LARGEST_ERROR),
    Own("NORM_DELTAT", "LOOPTIME_SEC", "s", "Q15 of a turn/erpm", "LOOPTIME_SEC/60*2147483648", "Equation 1, the note's format"),
    Own("estimator.rs_q16", "MOTOR_RS_OHM", "ohm", "Q16 / 2^rs_exp", f"{RS_FULL}/2^{_exponent(RS_FULL)}", "R of the estimator", "up", LARGEST_ERROR),
    Own("estimator.rs_exp", f"2^{_exponent(RS_FULL)}", "1", "count", _exponent(RS_FULL), "the product is shifted left by it", "count"),
    Own("fieldweak.ls_base_q16", "MOTOR_LS_MH", "mH", "Q16 / 2^ls_exp", f"{LS_FULL}/2^{_exponent('1.2*' + LS_FULL)}",
        "L of the estimator, eight samples", "up", LARGEST_ERROR),
    Own("estimator.ls_exp", f"2^{_exponent('1.2*' + LS_FULL)}", "1", "count", _exponent("1.2*" + LS_FULL), "the product is shifted left by it",
        "count"),
]

ESTIMATOR = [
    Own("estimator.deltat_q32", "LOOPTIME_SEC", "s", "Q32 of a turn/erpm", "LOOPTIME_SEC/60*4294967296", "angle a period", limit=LARGEST_ERROR),
    Own("estimator.half_step_q16_rad", "LOOPTIME_SEC/2", "s", "Q16 rad/erpm", "LOOPTIME_SEC*PI()/60*4294967296", "half of it", limit=LARGEST_ERROR),
    Own("estimator.d_ilimit_ls_q14", f"{_LEAST}*2*NORM_CURRENT_CONST", "A", "Q14 A", _LEAST, "largest change in eight periods: 8 * 2 pi f Ts Imax",
        "up"),
    Own("estimator.d_ilimit_hs_q14", f"{_MOST}*2*NORM_CURRENT_CONST", "A", "Q14 A", _MOST, "largest change in a period: 2 pi f Ts Imax", "up"),
    Own("D_ILIMIT_LS", f"{_LEAST}*2*NORM_CURRENT_CONST", "A", "Q15 A", f"2*INT({_LEAST}+0.5)", "the same in the note's format", "count"),
    Own("D_ILIMIT_HS", f"{_MOST}*2*NORM_CURRENT_CONST", "A", "Q15 A", f"2*INT({_MOST}+0.5)", "the same in the note's format", "count"),
    Own("fieldweak.kfilter_esdq_q16", _filter_hz("KFILTER_ESDQ"), "Hz", "Q16 a period", "2*KFILTER_ESDQ", "Equation 7: back-EMF", "count"),
    Own("fieldweak.kfilter_esdq_fw_q16", _filter_hz("KFILTER_ESDQ_FW"), "Hz", "Q16 a period", "2*KFILTER_ESDQ_FW", "back-EMF in field weakening",
        "count"),
    Own("estimator.kfilter_velestim_q16", _filter_hz("KFILTER_VELESTIM"), "Hz", "Q16 a period", "2*KFILTER_VELESTIM", "speed", "count"),
]

SPEEDS = [
    Own("minimum_erpm", "MINIMUM_SPEED_RPM", "rpm", "erpm", "MINIMUM_SPEED_RPM*NOPOLESPAIRS", "potentiometer at zero"),
    Own("nominal_erpm", "NOMINAL_SPEED_RPM", "rpm", "erpm", "NOMINAL_SPEED_RPM*NOPOLESPAIRS", "potentiometer at full scale, S3 off"),
    Own("maximum_erpm", "MAXIMUM_SPEED_RPM", "rpm", "erpm", "MAXIMUM_SPEED_RPM*NOPOLESPAIRS", "potentiometer at full scale, S3 on"),
    Own("end_erpm", "END_SPEED_RPM", "rpm", "erpm", "END_SPEED_RPM*NOPOLESPAIRS", "end of the ramp"),
    Own("fieldweak.on_speed_erpm", "FW_START_SPEED_RPM", "rpm", "erpm", "FW_START_SPEED_RPM*NOPOLESPAIRS", "field weakening starts"),
    Own("estimator.nominal_erpm", "NOMINAL_SPEED_RPM", "rpm", "erpm", "NOMINAL_SPEED_RPM*NOPOLESPAIRS", "one-sample derivative above"),
    Own("estimator.decimate_erpm", "NOMINAL_SPEED_RPM/10", "rpm", "erpm", "NOMINAL_SPEED_RPM/10*NOPOLESPAIRS",
        "sign of Equation 2 from the filtered speed below"),
    Own("speed_ramp_erpm", "SPEEDREFRAMP_RPM_PER_S", "rpm/s", "erpm in 8 periods", f"SPEEDREFRAMP_RPM_PER_S*NOPOLESPAIRS/{SLOTS}",
        "slope of the reference, rounded up", "next", 30.0),
    Own("tuning_step_q16", "TUNING_DELAY_RAMPUP", "periods", "Q16 erpm in 8 periods", "8*65536/(TUNING_DELAY_RAMPUP+1)", "slope in TUNING"),
    Own("ramp_hold_erpm", "NOMINAL_SPEED_RPM/8", "rpm", "erpm", "NOMINAL_SPEED_RPM*NOPOLESPAIRS/8",
        "the ramp waits when the motor is further behind"),
    Own("overspeed_erpm", "MIN(MAXIMUM_SPEED_RPM*1.25,32700/NOPOLESPAIRS)", "rpm", "erpm", "MIN(MAXIMUM_SPEED_RPM*NOPOLESPAIRS*1.25,32700)",
        "lost lock above"),
]


def _controllers() -> list[Own]:
    rows = []
    for axis in ("d", "q"):
        stem = f"{axis.upper()}_CURRCNTR_"
        rows += [Own(f"pi_{axis}.kp", f"{stem}PTERM*{_KP_VOLT}", "V/A", "Q15 / 16", f"{stem}PTERM*32768", "proportional gain"),
                 Own(f"pi_{axis}.ki", f"{stem}ITERM/{IU}/LOOPTIME_SEC", "V/(A s)", "Q11 a period", f"{stem}ITERM*2048", "integral gain"),
                 Own(f"pi_{axis}.kc", "0.999", "1", "Q15", "0.999*32767", "anti-windup", "up")]
    return rows + [
        Own("pi_speed.kp", "SPEEDCNTR_PTERM*16*NORM_CURRENT_CONST*NOPOLESPAIRS", "A/rpm", "Q15 / 16", "SPEEDCNTR_PTERM*32768", "proportional gain"),
        Own("pi_speed.ki", "SPEEDCNTR_ITERM*NORM_CURRENT_CONST*NOPOLESPAIRS/LOOPTIME_SEC", "A/(rpm s)", "Q14 in 8 periods", "SPEEDCNTR_ITERM*16384",
            "integral gain", limit=10.0),
        Own("pi_speed.kc", "0.999", "1", "Q15", "0.999*32767", "anti-windup", "up")]


START = [
    Own("forced.end_speed_q10", "END_SPEED_RPM", "rpm", "Q10 angle counts a period", "END_SPEED_RPM*NOPOLESPAIRS*LOOPTIME_SEC/60*67108864",
        "end of the ramp"),
    Own("forced.increase_rate_q10", "OPENLOOP_RAMPSPEED_INCREASERATE/67108864/LOOPTIME_SEC^2*60/NOPOLESPAIRS", "rpm/s", "Q10 counts/period^2",
        "OPENLOOP_RAMPSPEED_INCREASERATE", "acceleration", "count"),
    Own("lock_periods", "LOCK_TIME*LOOPTIME_SEC", "s", "periods", "LOCK_TIME", "lock", "count"),
    Own("lock_sweep_q32", "90/(LOCK_TIME/2*LOOPTIME_SEC)", "deg/s", "Q32 of a turn a period", "INT(1073741824/INT(LOCK_TIME/2))",
        "first half of the lock", "count"),
    Own("open_loop_q13", "Q_CURRENT_REF_OPENLOOP", "A", "Q13 A", _q13("Q_CURRENT_REF_OPENLOOP"), "current of lock and ramp"),
    Own("bootstrap_periods", "0.01", "s", "periods", "0.01/LOOPTIME_SEC", "low sides on before the start"),
    Own("ready_slots", "0.02", "s", "8 periods", f"0.02*{SLOTS}", "agreement before the hand-over"),
    Own("ready_timeout_slots", "0.2", "s", "8 periods", f"0.2*{SLOTS}", "and how long it may take"),
]

LIMITS = [
    Own("current_max_q13", "MAXIMUM_CURRENT_A", "A", "Q13 A", _q13("MAXIMUM_CURRENT_A"), "current vector that is asked for"),
    Own("overcurrent_q13", "OVER_CURRENT_THRESHOLD_A", "A", "Q13 A", _q13("OVER_CURRENT_THRESHOLD_A"), "phase current that trips"),
    Own("fieldweak.trim_max_q13", "FW_TRIM_CURRENT_A", "A", "Q13 A", _q13("FW_TRIM_CURRENT_A"), "most that the voltage feedback adds"),
    Own("current_max_reciprocal", "MAXIMUM_CURRENT_A", "A", "2^25 / Q13", f"33554432/({_q13('MAXIMUM_CURRENT_A')})", "its reciprocal", "up"),
    Own("bus_over_q15", "OVER_VOLTAGE_V", "V", "Q15 of full scale", _bus("OVER_VOLTAGE_V"), "trips"),
    Own("bus_under_q15", "UNDER_VOLTAGE_V", "V", "Q15 of full scale", _bus("UNDER_VOLTAGE_V"), "trips"),
    Own("bus_regen_q15", "REGEN_LIMIT_V", "V", "Q15 of full scale", _bus("REGEN_LIMIT_V"), "braking is reduced from here"),
    Own("bus_nominal_q15", "NOMINAL_BUS_V", "V", "Q15 of full scale", _bus("NOMINAL_BUS_V"), "supply"),
    Own("brake_per_bus_q8", "MAXIMUM_CURRENT_A/2", "A/V", "Q8", f"256*ROUND({_q13('MAXIMUM_CURRENT_A')},0)/ROUND({_bus('2')},0)",
        "braking current taken off a volt", "up"),
    Own("stall_slots", "0.3", "s", "8 periods", f"0.3*{SLOTS}", "stall"),
    Own("lost_lock_slots", "0.05", "s", "8 periods", f"0.05*{SLOTS}", "lost lock"),
]

MODULATOR = [
    Own("svm.full", "LOOPTIME_SEC*1000000", "us", "25 ns", "LOOPTIME_SEC/0.000000025", "duty of 100 %"),
    Own("svm.top", f"100*{_TOP}/{_FULL}", "%", "duty", _TOP, "highest duty: sampling window", "count"),
    Own("svm.dead_time", "DEADTIME_SEC*1000000", "us", "25 ns", "DEADTIME_SEC/0.000000025", "dead-time compensation"),
    Own("svm.knee_q13", f"{_KNEE}*4*NORM_CURRENT_CONST", "A", "Q13 A", _KNEE, "current from which it is full", "count"),
    Own("svm.dead_slope_q16", f"{_DEAD}/{_KNEE}", "1", "Q16", f"ROUND({_DEAD}/{_KNEE}*65536,0)", "duty per current", "count"),
    Own("svm.turn_q13", f"{_di('MAXIMUM_SPEED_RPM')}*2*NORM_CURRENT_CONST", "A", "Q13 A", f"INT({_di('MAXIMUM_SPEED_RPM')}/2)",
        "most that a current turns in a period", "count"),
    Own("voltage_limit_per_bus_q16", f"{_TOP}/{_FULL}/SQRT(3)", "V/V", "Q14 V per Q16 bus",
        f"{_TOP}/{_FULL}/SQRT(3)*BUS_FULL_SCALE_V/NORM_VOLTAGE_CONST/2", "voltage circle", "down"),
    Own("duty_per_volt_numerator", "BUS_FULL_SCALE_V", "V", "Q32", f"{_FULL}*4*NORM_VOLTAGE_CONST/BUS_FULL_SCALE_V*4294967296",
        "duty per volt at bus 1", "down"),
    Own("kcurr_a", "KCURRA", "1", "Q15", "KCURRA*IF(KCURRA<0,32768,32767)", "gain of the samples"),
    Own("kcurr_b", "KCURRB", "1", "Q15", "KCURRB*IF(KCURRB<0,32768,32767)", "gain of the samples"),
]


def _field_weakening() -> list[Own]:
    rows = [Own("fieldweak.margin_q14", "NOMINAL_BUS_V*0.01", "V", "Q14 V", "NOMINAL_BUS_V*0.01/NORM_VOLTAGE_CONST/2",
                "voltage kept free before the feedback acts"),
            Own("fieldweak.trim_speed_erpm", "FW_START_SPEED_RPM*0.6", "rpm", "erpm", "FW_START_SPEED_RPM*NOPOLESPAIRS*0.6",
                "speed from which it acts")]
    for i in range(18):
        kphi = f"MOTOR_KPHI_V_PER_KRPM*norm_invkfi_exact/INVKFI_SPEED{i}"
        rows += [Own(f"fieldweak.idref_q13[{i}]", f"IDREF_SPEED{i}", "A", "Q13 A", _q13(f"IDREF_SPEED{i}"), "d current"),
                 Own(f"fieldweak.inv_kfi[{i}]", kphi, "V/krpm", "Q15 / 2, 1/Kphi", f"INVKFI_SPEED{i}", "1/Kphi", "count"),
                 Own(f"fieldweak.ls_over2ls0_q15[{i}]", f"LS_OVER2LS0_SPEED{i}", "1", "Q15", f"LS_OVER2LS0_SPEED{i}*32768", "Ls/(2 Ls0)")]
    return rows


GROUPS = [("motor", MOTOR), ("estimator", ESTIMATOR), ("speeds", SPEEDS), ("current and speed controllers", _controllers()), ("start", START),
          ("limits", LIMITS), ("modulator and bus", MODULATOR), ("field weakening", _field_weakening())]


def constants_page(book: Book) -> Page:
    """Builds the sheet."""
    page = book.page("Constants", WIDTHS, "1F4E79",
                     "The note's sheet (yellow: your own exponent), then every number of the firmware. Counts follow from the sheets Motor to Field "
                     "weakening.")
    page.heads(HEADS, freeze=True)
    page.section("Base quantities")
    for name, formula, text, unit, meaning in (
            ("U0_v", "=supply_v/SQRT(3)*(1-dead_time_s/pwm_period_s)/32768", "Vdc/sqrt(3) (1 - Td/Ts) / 2^15", "V per count",
             "largest phase voltage, less the dead time's share"),
            ("I0_a", "=current_full_scale_a/32768", "Ipeak / 2^15 (Equation 8)", "A per count", "Ipeak: current at full internal scale"),
            ("w0_rad_s", "=2*PI()/60", "2 pi / 60", "rad/s per rpm", "unit of speed"),
            ("NORM_VOLTAGE_CONST", "=NOMINAL_BUS_V/SQRT(3)*(1-DEADTIME_SEC/LOOPTIME_SEC)/32768", "U0 from the values in userparams.h", "V per count",
             "what the firmware computes with")):
        row = page.next_row()
        page.put(f"A{row}", name.split("_v")[0] if name == "U0_v" else {"I0_a": "I0", "w0_rad_s": "w0"}.get(name, name), "name")
        page.put(f"B{row}", formula, "result", "0.00000E+00")
        page.put(f"C{row}", unit, "unit")
        page.put(f"D{row}", text, "formula")
        _blank(page, row, "EFGHIJKL")
        page.put(f"M{row}", meaning, "note")
        page.name(name, f"B{row}")
    page.section("The note's constants (AN1292, corrected): paste them into the note's own software; foc33 derives its own from userparams.h")
    for scaled in NOTE:
        _scaled(page, scaled)
    for name, factor, speed in (("D_ILIMIT_HS", "2", "maximum_speed"), ("D_ILIMIT_LS", "8*2", "nominal")):
        rpm = "MAXIMUM_SPEED_RPM" if speed == "maximum_speed" else "NOMINAL_SPEED_RPM"
        raw = f"{factor}*{rpm}/60*pole_pairs*pwm_period_s*32768"
        _limit(page, f"{name}, the note's formula", raw, f"{factor.replace('*', ' ')} (n/60) P Ts 2^15".replace("8 2", "8 * 2"),
               "triangle approximation: clips a sine of full-scale current", f"note_{name}")
        _limit(page, f"{name}, with pi and Imax", raw.replace("2*", "2*PI()*", 1) if factor == "2" else raw.replace("8*2*", "8*2*PI()*", 1),
               f"{'8 ' if factor != '2' else ''}2 pi (n/60) P Ts Imax/I0", "foc33: a sine's steepest slope", f"pi_{name}")
    for group, rows in GROUPS:
        page.section(f"The firmware's numbers: {group}")
        for own in rows:
            _own(page, own)
    page.ws.print_area = f"A1:M{page.row - 1}"
    return page


def _scaled(page: Page, s: Scaled) -> None:
    row = page.next_row()
    page.put(f"A{row}", s.name, "name")
    page.put(f"B{row}", f"={s.value}", "value", "0.0000" if s.unit != "s" else "0.00E+00")
    page.put(f"C{row}", s.unit, "unit")
    page.put(f"D{row}", s.text, "formula")
    page.put(f"E{row}", f"={s.formula}", "value", "0.00")
    page.put(f"F{row}", f'=IF(G{row}<>"",G{row},{_automatic(row, s.least)})', "value", "0")
    page.put(f"G{row}", None, "input", "0")
    page.range(f"G{row}", 0, 15, "Exponent", whole=True)
    page.put(f"H{row}", f"=E{row}/2^F{row}", "value", "0.00")
    page.put(f"I{row}", f"=INT(H{row}+0.5)", "result", "0")
    page.put(f"J{row}", f"=100*(I{row}/H{row}-1)", "value", "0.0000")
    page.put(f"K{row}", f'=15-F{row}' if not s.shift else f'=(15-F{row})&" / "&(18-F{row})', "value")
    page.check(f"L{row}", f'=IF(I{row}>32767,"too large for 16 bits: raise the exponent",IF(ABS(J{row})>{LARGEST_ERROR},'
                          f'"warning: rounded by more than {LARGEST_ERROR} %","ok"))')
    page.put(f"M{row}", s.meaning, "note")
    page.name(f"note_{s.name}", f"I{row}")


def _blank(page: Page, row: int, columns: str) -> None:
    for column in columns:
        page.put(f"{column}{row}", None, "unit")


def _automatic(row: int, least: int) -> str:
    """The note's exponent, or the smallest larger one that fits: 2^e must exceed raw/32767.5."""
    return f"MAX({least},IF(E{row}<32767.5,0,INT(LN(E{row}/32767.5)/LN(2))+1))"


def _limit(page: Page, label: str, raw: str, text: str, meaning: str, defined: str) -> None:
    row = page.next_row()
    _blank(page, row, "FGK")
    if "PI()" in raw:
        raw = raw.replace("*32768", "*MAXIMUM_CURRENT_A/I0_a")
    page.put(f"A{row}", label, "name")
    page.put(f"B{row}", f"=I{row}*I0_a", "value", "0.000")
    page.put(f"C{row}", "A", "unit")
    page.put(f"D{row}", text, "formula")
    page.put(f"E{row}", f"={raw}", "value", "0.00")
    page.put(f"H{row}", f"=E{row}", "value", "0.00")
    page.put(f"I{row}", f"=INT(H{row}+0.5)", "result", "0")
    page.put(f"J{row}", f"=100*(I{row}/H{row}-1)", "value", "0.0000")
    page.check(f"L{row}", f'=IF(I{row}>32767,"too large for 16 bits","ok")')
    page.put(f"M{row}", meaning, "note")
    page.name(defined, f"I{row}")


def _own(page: Page, own: Own) -> None:
    row = page.next_row()
    _blank(page, row, "EFGK")
    page.put(f"A{row}", own.name, "name")
    page.put(f"B{row}", f"={own.value}", "value", _form(own.unit))
    page.put(f"C{row}", own.unit, "unit")
    page.put(f"D{row}", own.q_format, "formula")
    page.put(f"H{row}", f"={own.raw}", "value", "0.00")
    page.put(f"I{row}", {"nearest": f"=ROUND(H{row},0)", "up": f"=INT(H{row}+0.5)", "down": f"=INT(H{row})", "count": f"=H{row}",
                         "next": f"=ROUND(H{row}+0.49,0)"}[own.rounding], "result", "0")
    page.put(f"J{row}", f"=IF(H{row}=0,0,100*(I{row}/H{row}-1))", "value", "0.0000")
    limit = f'IF(ABS(J{row})>{own.limit},"warning: rounded by more than {own.limit:g} %",' if own.limit else "("
    largest = 65535 if "q16" in own.name else 4294967295 if own.name in ("duty_per_volt_numerator", "lock_sweep_q32",
                                                                         "forced.end_speed_q10") else 65535 \
        if own.rounding == "up" else 32767
    page.check(f"L{row}", f'=IF(ABS(I{row})>{largest},"too large for its format",{limit}"ok"))')
    page.put(f"M{row}", own.meaning, "note")
    if own.name == "NORM_INVKFIBASE":
        page.name("norm_invkfi_exact", f"H{row}")
        page.name("NORM_INVKFIBASE", f"I{row}")


def _form(unit: str) -> str:
    return {"s": "0.00E+00", "rpm": "0.0", "rpm/s": "0", "V/(A s)": "0.0", "Hz": "0.0", "A/rpm": "0.00000", "A/(rpm s)": "0.0000", "deg/s": "0",
            "periods": "0"}.get(unit, "0.0000")
