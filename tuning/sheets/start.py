"""The "Start" sheet: current, lock, ramp and hand-over speed by the command's rules."""

from tuning import start

from .book import Book, Page
from .data import DataPage
from .formulas import RPM, digits_down, significant
from .parameters import HEADS, WIDTHS, Rule, parameter, quantity

RATE_UNIT = "(1/67108864/pwm_period_s^2*60/pole_pairs)"


def start_page(book: Book, motor: DataPage, board: DataPage) -> Page:
    """Builds the sheet."""
    page = book.page("Start", WIDTHS, "1F4E79",
                     "A forced current vector pulls the rotor like a spring; the estimator takes over where its back-EMF is large enough.")
    page.heads(HEADS, freeze=True)
    page.section("Current")
    quantity(page, "Load and friction", "first_needed_nm", f"start_torque_nm+coulomb_nm+viscous_nms*0.3*NOMINAL_SPEED_RPM*{RPM}", "N m",
             "at 30 % of nominal speed")
    wanted = f"MAX(MIN({start.CURRENT_SHARE}*rated_current_a,OVER_CURRENT_THRESHOLD_A/{start.TRIP_HEADROOM}),first_needed_nm/(kt_nm_per_a*{start.LOAD_ANGLE_SINE}))"
    parameter(page, motor, Rule("Q_CURRENT_REF_OPENLOOP", significant(f"MIN({wanted},{digits_down('(0.98*MAXIMUM_CURRENT_A)', 3)})", 3),
                                f"{start.CURRENT_SHARE:.0%} of the rated current with the trip level at least {start.TRIP_HEADROOM:g} times that, "
                                f"or what the load needs at 50 degrees of load angle; within the largest current"))
    quantity(page, "Pull-out torque", "pull_out_nm", "kt_nm_per_a*Q_CURRENT_REF_OPENLOOP", "N m", "Kt I")
    page.section("Hand-over")
    dead = "4/PI()*supply_v*dead_time_s/pwm_period_s"
    step = f"2*board_full_scale_a/2^{board.pick('adc.bits')}"
    quantity(page, "Error of the back-EMF", "emf_error_v",
             f"{start.R_ERROR}*rs_ohm*Q_CURRENT_REF_OPENLOOP+{start.DEAD_TIME_ERROR}*{dead}+rs_ohm*{step}", "V",
             f"R {start.R_ERROR:.0%} wrong, {start.DEAD_TIME_ERROR:.0%} of the dead time's voltage, one step of the converter", "0.000")
    lowest = f"MAX(emf_error_v/{start.HAND_OVER_SINE}/(psi_vs*{RPM}*pole_pairs),0.2*NOMINAL_SPEED_RPM)"
    step = f"IF({lowest}>300,50,10)"
    parameter(page, motor, Rule("END_SPEED_RPM",
                                f"MIN(MAX(-INT(-({lowest}/{step}-0.000000001))*{step},50),{digits_down('(0.5*NOMINAL_SPEED_RPM)', 2)},5000)",
                                "that error turns the angle by 20 degrees; at least a fifth, at most half of nominal speed"))
    quantity(page, "Back-EMF there", "end_emf_v", f"psi_vs*END_SPEED_RPM*{RPM}*pole_pairs", "V peak", "psi w", "0.00")
    parameter(page, motor, Rule("MINIMUM_SPEED_RPM", f"MAX({digits_down('MIN(END_SPEED_RPM,0.2*rated_speed_rpm)', 2)},50)",
                                "20 % of rated speed, at most END_SPEED_RPM"))
    page.section("Lock")
    quantity(page, "Swing of the locked rotor", "swing_hz",
             "SQRT(pole_pairs*kt_nm_per_a*Q_CURRENT_REF_OPENLOOP/(inertia_kgm2+load_inertia_kgm2))/(2*PI())", "Hz", "sqrt(P Kt I / J) / 2 pi", "0.0")
    quantity(page, "Lengthened by the command's trial", "lock_factor", _one(motor, "command.lock_factor"), "1",
             "make tune tries lock and ramp on the rotor's equation and lengthens them until the rotor follows and is calm; this is for the motor file's values, 1 for your own motor: try it",
             "0.000")
    seconds = f"MAX({start.LEAST_LOCK_S},-INT(-{start.LOCK_SWINGS}/swing_hz/0.05)*0.05)*lock_factor"
    parameter(page, motor, Rule("LOCK_TIME", f"2*ROUND(MIN({seconds},32000*pwm_period_s)/pwm_period_s/2,0)",
                                f"{start.LOCK_SWINGS:.0f} swings, at least {start.LEAST_LOCK_S:g} s, in periods"))
    quantity(page, "Lock", "lock_s", "LOCK_TIME*LOOPTIME_SEC", "s", "", "0.00")
    page.section("Ramp")
    quantity(page, "Acceleration of one unit", "rate_unit_rpm_s", RATE_UNIT, "rpm/s", "1/1024 angle count a period, a period", "0.000")
    quantity(page, "Slowed by the command's trial", "rate_factor", _one(motor, "command.rate_factor"), "1", "as above", "0.000")
    largest = f"{start.RAMP_TORQUE_SHARE}*pull_out_nm/(inertia_kgm2+load_inertia_kgm2)/{RPM}"
    rate = f"MAX(1,MIN({start.LARGEST_RATE},ROUND(MIN(END_SPEED_RPM/{start.RAMP_S},{largest})/rate_unit_rpm_s,0)))"
    parameter(page, motor, Rule("OPENLOOP_RAMPSPEED_INCREASERATE", f"MAX(1,ROUND({rate}*rate_factor,0))",
                                f"{start.RAMP_S:g} s to END_SPEED_RPM, or slower so that J dw/dt takes at most {start.RAMP_TORQUE_SHARE:.0%} of the "
                                f"pull-out torque"))
    quantity(page, "Acceleration", "ramp_rpm_s", "OPENLOOP_RAMPSPEED_INCREASERATE*rate_unit_rpm_s", "rpm/s", "", "0")
    quantity(page, "Ramp", "ramp_s", "END_SPEED_RPM/ramp_rpm_s", "s", "", "0.00")
    quantity(page, "Torque needed at its end", "needed_nm",
             f"start_torque_nm+coulomb_nm+viscous_nms*END_SPEED_RPM*{RPM}+(inertia_kgm2+load_inertia_kgm2)*ramp_rpm_s*{RPM}", "N m",
             "load, friction, acceleration")
    quantity(page, "Share of the pull-out torque", "start_share", "needed_nm/pull_out_nm", "1", "sine of the load angle; at 1 the rotor slips",
             "0.00",
             'IF(start_share<0.9,"ok","the rotor may not follow: more current, less load or a slower ramp")')
    page.ws.page_setup.fitToHeight = 1
    page.ws.print_area = f"A1:H{page.row - 1}"
    return page


def _one(motor: DataPage, key: str) -> str:
    picked = motor.pick(key)
    return f'IF({picked}="",1,{picked})'
