/* The virtual board's view into the firmware: its signals in engineering units, its parameters and names. */
#include "probe.h"

#include "board/firmware.h"
#include "board/kept.h"
#include "board/watch.h"
#include "drive/limits.h"
#include "drive/param_limits.h"
#include "drive/param_scaling.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define CURRENT_A(q13) ((double)(q13) * 4.0 * (double)PARAM_F(NORM_CURRENT_CONST))
#define VOLTAGE_V(q14) ((double)(q14) * 2.0 * (double)NORM_VOLTAGE_CONST)
#define EMF_V(q12) ((double)(q12) * 8.0 * (double)NORM_VOLTAGE_CONST)
#define ANGLE_DEG(counts) ((double)(counts) * 360.0 / 65536.0)
#define SPEED_RPM(counts) ((double)(counts) * (double)SPEED_UNIT / (double)(NOPOLESPAIRS))
#define BUS_V(q15) ((double)(q15) / 32768.0 * (double)PARAM_F(BUS_FULL_SCALE_V))

/* X(id, name, unit, meaning, value): the signals of the drive `d`. */
#define DRIVE_SIGNALS(X) \
    X(state, "fw.state", "", "drive state (drive_state_t)", (double)d->state) \
    X(fault, "fw.fault", "", "fault code (drive_fault_t)", (double)d->fault) \
    X(slow_phase, "fw.slow_phase", "", "period of the last step of 8, from 0 on", (double)(d->ticks % SLOW_PERIODS)) \
    X(running, "fw.run", "", "1 while the bridge switches", (double)drive_is_running(d)) \
    X(calibrated, "fw.calibrated", "", "1 after the offset calibration", (double)d->calibration.done) \
    X(theta_est, "fw.theta_est_deg", "deg", "estimated rotor angle at the last sample", \
      ANGLE_DEG(estimator_next_angle(&d->run.estimator)) - (double)d->run.estimator.omega_erpm * SPEED_UNIT * 6.0 * (double)PARAM_F(LOOPTIME_SEC)) \
    X(theta_ctrl, "fw.theta_ctrl_deg", "deg", "control angle of the next sample", ANGLE_DEG(d->angle)) \
    X(speed_est, "fw.speed_est_rpm", "rpm", "filtered estimated speed", SPEED_RPM(estimator_speed(&d->run.estimator))) \
    X(speed_raw, "fw.speed_raw_rpm", "rpm", "estimated speed before its filter", SPEED_RPM(d->run.estimator.omega_erpm)) \
    X(speed_ref, "fw.speed_ref_rpm", "rpm", "ramped speed reference", SPEED_RPM(d->run.control.reference_erpm)) \
    X(speed_target, "fw.speed_target_rpm", "rpm", "speed target", SPEED_RPM(d->command.target_erpm)) \
    X(i_a, "fw.i_a_a", "A", "measured current of phase A", CURRENT_A(d->phases_q13.a)) \
    X(i_b, "fw.i_b_a", "A", "measured current of phase B", CURRENT_A(d->phases_q13.b)) \
    X(i_d, "fw.i_d_a", "A", "measured d current", CURRENT_A(d->run.control.i_q13.d)) \
    X(i_q, "fw.i_q_a", "A", "measured q current", CURRENT_A(d->run.control.i_q13.q)) \
    X(id_ref, "fw.id_ref_a", "A", "d current reference", CURRENT_A(d->run.control.ref_q13.d)) \
    X(iq_ref, "fw.iq_ref_a", "A", "q current reference", CURRENT_A(d->run.control.ref_q13.q)) \
    X(iq_limit, "fw.iq_limit_a", "A", "q current limit", CURRENT_A(d->run.control.iq_limit_q13)) \
    X(id_trim, "fw.id_trim_a", "A", "d current of the voltage feedback", CURRENT_A(d->run.fieldweak.trim_q13)) \
    X(iq_trim, "fw.iq_trim_a", "A", "q current of the slow trim of the speed", CURRENT_A((double)d->run.control.iq_trim_q26 / 8192.0)) \
    X(brake_limit, "fw.brake_limit_a", "A", "limit of the braking current", CURRENT_A(d->run.control.brake_limit_q13)) \
    X(v_d, "fw.v_d_v", "V", "commanded d voltage", VOLTAGE_V(d->run.control.v_q14.d)) \
    X(v_q, "fw.v_q_v", "V", "commanded q voltage", VOLTAGE_V(d->run.control.v_q14.q)) \
    X(v_limit, "fw.v_limit_v", "V", "radius of the voltage circle", VOLTAGE_V(d->circle.limit_q14)) \
    X(vq_limit, "fw.vq_limit_v", "V", "q voltage limit", VOLTAGE_V(d->run.control.vq_limit_q14)) \
    X(bus, "fw.bus_v", "V", "filtered bus voltage", BUS_V(qm_hi(d->bus_q31))) \
    X(fw_index, "fw.fw_index", "", "field-weakening table index (FdWeakParm.qIndex)", (double)d->run.fieldweak.index) \
    X(limits, "fw.limits", "", "why the output is limited, a sum of limit_reason_t (LimitParm.now)", (double)limits_reasons(d, &board_params)) \
    X(inv_kphi, "fw.inv_kphi_rpm_per_v", "rpm/V", "1/Kphi in use, V peak line to line (MotorEstimParm.qInvKFi)", \
      (double)d->run.model.inv_kfi * SPEED_UNIT / (sqrt(3.0) * 16384.0 * (double)(NOPOLESPAIRS) * (double)NORM_VOLTAGE_CONST)) \
    X(ls_ratio, "fw.ls_ratio", "", "Ls/(2 Ls0) in use", (double)d->run.model.ls_q16 / (double)board_params.fieldweak.ls_base_q16 / 2.0) \
    X(offset, "fw.offset_deg", "deg", "hand-over angle offset that is left", ANGLE_DEG(d->run.handover.offset)) \
    X(speed_obs, "fw.speed_obs_rpm", "rpm", "speed of the load observer", SPEED_RPM(observer_speed(&d->run.observer))) \
    X(wrong_steps, "fw.wrong_steps", "", "8 periods", (double)d->run.observer.wrong_steps) \
    X(load, "fw.load_a", "A", "q current that holds the observed load", CURRENT_A(observer_load(&d->run.observer, &board_params.observer))) \
    X(kphi_change, "fw.kphi_change_percent", "%", "flux that the motor has shown against the header's Kphi: the magnets' temperature", \
      100.0 / (1.0 + (double)d->run.adaptation.kfi_q31 / 2147483648.0) - 100.0) \
    X(rs_change, "fw.rs_change_percent", "%", "resistance that the motor has shown against the header's", \
      (double)d->run.adaptation.rs_q31 / 21474836.48) \
    X(e_d, "fw.e_d_v", "V", "filtered d back-EMF", EMF_V(estimator_emf(&d->run.estimator).d)) \
    X(e_q, "fw.e_q_v", "V", "filtered q back-EMF", EMF_V(estimator_emf(&d->run.estimator).q)) \
    X(profile, "fw.profile_a", "A", "learned q current of this step (TORQUE_PROFILE)", CURRENT_A(mode_profile_current(&d->run))) \
    X(offset_a, "fw.offset_a_a", "A", "calibrated offset of phase A", CURRENT_A(d->calibration.offset_a_q13)) \
    X(offset_b, "fw.offset_b_a", "A", "calibrated offset of phase B", CURRENT_A(d->calibration.offset_b_q13))

#ifdef TORQUE_PROFILE
#define PROFILE_COS(k) ((double)d->run.profile.harmonic[k].cos_q29 / 65536.0)
#define PROFILE_SIN(k) ((double)d->run.profile.harmonic[k].sin_q29 / 65536.0)
#define PROFILE_SIGNALS(X) \
    X(profile1, "fw.profile1_a", "A", "amplitude of the learned current once a turn", CURRENT_A(hypot(PROFILE_COS(0), PROFILE_SIN(0)))) \
    X(profile1_deg, "fw.profile1_deg", "deg", "shaft's angle of its most, from where the count began", atan2(PROFILE_SIN(0), PROFILE_COS(0)) * 57.29577951) \
    X(profile2, "fw.profile2_a", "A", "amplitude of the learned current twice a turn", CURRENT_A(hypot(PROFILE_COS(1), PROFILE_SIN(1)))) \
    X(profile2_deg, "fw.profile2_deg", "deg", "angle of its most, 360 degrees in half a turn", atan2(PROFILE_SIN(1), PROFILE_COS(1)) * 57.29577951)
#else
#define PROFILE_SIGNALS(X)
#endif

#ifdef SNAPSHOT
#define SNAPSHOT_SIGNALS(X) \
    X(snap_done, "fw.snap_done", "", "SnapDone", (double)(SnapDone)) \
    X(snap_rows, "fw.snap_rows", "rows", "rows recorded so far", (double)(board_snapshot.row)) \
    X(snap1_last, "fw.snap1_last", "Q15", "last row of SnapBuf1, phase current a", (double)(SnapBuf1[DATA_BUFFER_SIZE - 1])) \
    X(snap2_last, "fw.snap2_last", "Q15", "last row of SnapBuf2, q current", (double)(SnapBuf2[DATA_BUFFER_SIZE - 1])) \
    X(snap3_last, "fw.snap3_last", "erpm", "last row of SnapBuf3, speed", (double)(SnapBuf3[DATA_BUFFER_SIZE - 1])) \
    X(snap4_last, "fw.snap4_last", "1/65536 turn", "last row of SnapBuf4, angle", (double)(SnapBuf4[DATA_BUFFER_SIZE - 1]))
#else
#define SNAPSHOT_SIGNALS(X)
#endif

#if MOTOR_NTC_USED
#define MOTOR_NTC_SIGNALS(X) X(motor_c, "fw.motor_c", "degC", "temperature of the motor's NTC", (double)d->heat.motor.celsius_q4 / 16.0)
#else
#define MOTOR_NTC_SIGNALS(X)
#endif
#if BRIDGE_NTC_USED
#define BRIDGE_NTC_SIGNALS(X) X(bridge_c, "fw.bridge_c", "degC", "temperature of the bridge's NTC", (double)d->heat.bridge.celsius_q4 / 16.0)
#else
#define BRIDGE_NTC_SIGNALS(X)
#endif
#define HEAT_SIGNALS(X) MOTOR_NTC_SIGNALS(X) BRIDGE_NTC_SIGNALS(X)

#define SIGNAL_FUNCTION(id, name, unit, meaning, value) \
    static double read_##id(void) \
    { \
        const drive_t *d = &board_drive; \
        (void)d; \
        return (value); \
    }
DRIVE_SIGNALS(SIGNAL_FUNCTION)
PROFILE_SIGNALS(SIGNAL_FUNCTION)
HEAT_SIGNALS(SIGNAL_FUNCTION)
SNAPSHOT_SIGNALS(SIGNAL_FUNCTION)

#define SIGNAL_ROW(id, name, unit, meaning, value) { name, unit, meaning, read_##id },
const probe_signal_t probe_signals[] = { DRIVE_SIGNALS(SIGNAL_ROW) PROFILE_SIGNALS(SIGNAL_ROW) HEAT_SIGNALS(SIGNAL_ROW) SNAPSHOT_SIGNALS(SIGNAL_ROW) };
const unsigned probe_signal_count = sizeof probe_signals / sizeof probe_signals[0];

#define PARAM_ENTRY(name, unit, min, max, value, meaning) { #name, (double)PARAM_F(name), unit },
/* Behind the parameters the scales of what the fault recorder sends. */
const probe_param_t probe_params[] = {
    PARAM_TABLE(PARAM_ENTRY) { "COUNT_CURRENT_A", CURRENT_A(1), "A" }, { "COUNT_VOLTAGE_V", VOLTAGE_V(1), "V" }, { "COUNT_SPEED_RPM", SPEED_RPM(1), "rpm" },
    { "CURRENT_KP_D", 16.0F * PARAM_F(D_CURRCNTR_PTERM) / PARAM_IU, "V/A" }, { "CURRENT_KP_Q", 16.0F * PARAM_F(Q_CURRCNTR_PTERM) / PARAM_IU, "V/A" },
    { "CURRENT_KI", PARAM_F(Q_CURRCNTR_ITERM) / PARAM_IU, "V/A" }, { "BRIDGE_RS_OHM", PARAM_F(BRIDGE_RS_OHM), "ohm" }
};
const unsigned probe_param_count = sizeof probe_params / sizeof probe_params[0];

const double probe_isr_us = DEFER_DUTIES ? 0.5 : 13.0;

/* What may change while the motor turns: the name of userparams.h (or its stem, for the 18 entries of a table), where the firmware
 * keeps it, and the value of one count. A name in two rows has two places. */
typedef struct {
    const char *name;
    unsigned entries; /* 0: not a table */
    int16_t *place;
    double per_count;
} tunable_t;

#if defined(TUNING) || defined(PARAMS_IN_RAM)
#define TUNABLE(name, field, per_count) { name, 0, &board_params.field, per_count },
#define TUNABLE_TABLE(stem, field, per_count) { stem, FIELDWEAK_ENTRIES, board_params.field, per_count },
#else
#define TUNABLE(name, field, per_count)
#define TUNABLE_TABLE(stem, field, per_count)
#endif

static const tunable_t tunables[] = {
    TUNABLE_TABLE("IDREF_SPEED", fieldweak.idref_q13, CURRENT_A(1))
    TUNABLE_TABLE("INVKFI_SPEED", fieldweak.inv_kfi, 1.0)
    TUNABLE_TABLE("LS_OVER2LS0_SPEED", fieldweak.ls_over2ls0_q15, 1.0 / 32768.0)
    TUNABLE("FW_START_SPEED_RPM", fieldweak.on_speed_erpm, SPEED_RPM(1))
    TUNABLE("FW_START_SPEED_RPM", fieldweak.trim_speed_erpm, SPEED_RPM(1) / 0.6)
    TUNABLE("FW_TRIM_CURRENT_A", fieldweak.trim_max_q13, CURRENT_A(1))
    TUNABLE("KFILTER_ESDQ", fieldweak.kfilter_esdq_q16, 0.5)
    TUNABLE("KFILTER_ESDQ_FW", fieldweak.kfilter_esdq_fw_q16, 0.5)
    TUNABLE("MINIMUM_SPEED_RPM", minimum_erpm, SPEED_RPM(1))
    { NULL, 0, NULL, 0.0 }
};

typedef struct {
    const char *name;
    double min, max;
} range_t;

#define RANGE_OF(name, unit, min, max, value, meaning) { #name, min, max },
static const range_t ranges[] = { PARAM_TABLE(RANGE_OF) };

static int16_t *tunable_place(const tunable_t *t, const char *name)
{
    size_t stem = strlen(t->name);
    unsigned entry = 0;
    int used = 0;
    if (t->entries == 0) {
        return (strcmp(t->name, name) == 0) ? t->place : NULL;
    }
    if (strncmp(t->name, name, stem) != 0 || sscanf(name + stem, "%2u%n", &entry, &used) != 1 || name[stem + (size_t)used] != '\0') {
        return NULL;
    }
    return (entry < t->entries) ? &t->place[entry] : NULL;
}

int probe_param_get(const char *name, double *value)
{
    for (const tunable_t *t = tunables; t->name != NULL; t++) {
        const int16_t *place = tunable_place(t, name);
        if (place != NULL) {
            *value = (double)*place * t->per_count;
            return 0;
        }
    }
    return -1;
}

int probe_param_set(const char *name, double value)
{
    int result = -1;
    for (size_t n = 0; n < sizeof ranges / sizeof ranges[0]; n++) {
        if (strcmp(ranges[n].name, name) == 0 && !(value >= ranges[n].min && value <= ranges[n].max)) {
            return -2;
        }
    }
    for (const tunable_t *t = tunables; t->name != NULL; t++) {
        int16_t *place = tunable_place(t, name);
        if (place != NULL) {
            *place = (int16_t)lround(value / t->per_count);
            result = 0;
        }
    }
    return result;
}

void probe_power_up(void)
{
#if defined(PARAMS_IN_RAM) || defined(TUNING) /* a reset of the chip brings the header's values back */
    static drive_params_t start_values;
    static int are_known;
    if (!are_known) {
        start_values = board_params;
        are_known = 1;
    }
    board_params = start_values;
#endif
#if PARAMS_KEPT
    kept_command = (kept_t){0};
#endif
}

const char *probe_fault_name(int code)
{
#define FAULT_NAME(number, name, passes, decided_by, cause, remedy) \
    if (code == (number)) { \
        return #name; \
    }
    DRIVE_FAULT_TABLE(FAULT_NAME)
    return "?";
}

const char *probe_state_name(int code)
{
#define STATE_NAME(name, meaning) #name,
    static const char *const names[] = { DRIVE_STATE_TABLE(STATE_NAME) };
    return (code >= 0 && code < (int)DRIVE_STATE_COUNT) ? names[code] : "?";
}
