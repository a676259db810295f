/* AN1292's watch variables, copied from the drive in the background. */
#include "board/watch.h"

#include "board/firmware.h"
#include "drive/limits.h"

tFdWeakParm FdWeakParm;
tMotorEstimParm MotorEstimParm;
tEstimParm EstimParm;
tParkParm ParkParm;
tCtrlParm CtrlParm;
tLoadParm LoadParm;
tAdaptParm AdaptParm;
tLimitParm LimitParm;
tRetryParm RetryParm;

/** x * 2^bits, limited to 16 bits. */
static int16_t watch_scaled(int16_t x, uint16_t bits)
{
    int16_t limit = (int16_t)(32767 >> bits);
    return (int16_t)(qm_limit(x, limit) * (1 << bits));
}

static int16_t watch_current(current_q13_t i)
{
    return watch_scaled(i, 2);
}

static int16_t watch_voltage(voltage_q14_t v)
{
    return watch_scaled(v, 1);
}

void watch_refresh(void)
{
    const drive_t *d = &board_drive;
    const drive_run_t *run = &d->run;
    const estimator_params_t *motor = &board_params.estimator;
    dq_t emf = estimator_emf(&run->estimator);
    FdWeakParm.qIndex = (int16_t)run->fieldweak.index;
    FdWeakParm.qFwOnSpeed = board_params.fieldweak.on_speed_erpm;
    MotorEstimParm.qRs = (motor->rs_exp == 0u) ? (int16_t)(run->model.rs_q16 >> 1) : INT16_MAX; /* the exponent begins where NORM_RS ends */
    MotorEstimParm.qLsDt = (int16_t)qm_mulhi_uu(run->model.ls_q16, (uint16_t)(2048u << motor->ls_exp));
    MotorEstimParm.qInvKFi = run->model.inv_kfi;
    MotorEstimParm.qDeltaT = (int16_t)((motor->deltat_q32 + 1) >> 1);
    EstimParm.qRho = (int16_t)(run->estimator.rho_q32 >> 16);
    EstimParm.qVelEstim = estimator_speed(&run->estimator);
    EstimParm.qOmegaMr = run->estimator.omega_erpm;
    EstimParm.qEsdf = watch_voltage(emf.d);
    EstimParm.qEsqf = watch_voltage(emf.q);
    ParkParm.qIa = watch_current(d->phases_q13.a);
    ParkParm.qIb = watch_current(d->phases_q13.b);
    ParkParm.qId = watch_current(run->control.i_q13.d);
    ParkParm.qIq = watch_current(run->control.i_q13.q);
    ParkParm.qVd = watch_voltage(run->control.v_q14.d);
    ParkParm.qVq = watch_voltage(run->control.v_q14.q);
    ParkParm.qAngle = (int16_t)d->angle;
    CtrlParm.qVelRef = run->control.reference_erpm;
    CtrlParm.qVdRef = watch_current(run->control.ref_q13.d);
    FdWeakParm.qIdRef = CtrlParm.qVdRef;
    CtrlParm.qVqRef = watch_current(run->control.ref_q13.q);
    LoadParm.qVel = observer_speed(&run->observer);
    LoadParm.qLoad = watch_current(observer_load(&run->observer, &board_params.observer));
    AdaptParm.qInvKFi = qm_hi(run->adaptation.kfi_q31);
    AdaptParm.qRs = qm_hi(run->adaptation.rs_q31);
    LimitParm.now = limits_reasons(d, &board_params);
    if (CHOPPER_USED && board_chopper.rests) {
        LimitParm.now |= (uint16_t)LIMIT_CHOPPER;
    }
    LimitParm.seen |= LimitParm.now;
    RetryParm.left = board_retry.left;
    RetryParm.first = board_retry.first;
    mode_watch(d);
}
