/* The note's watch variables, copied from the drive in the background. */
#include "board/watch.h"

#include "board/firmware.h"

tFdWeakParm FdWeakParm;
tMotorEstimParm MotorEstimParm;
tEstimParm EstimParm;
tParkParm ParkParm;
tCtrlParm CtrlParm;
#ifdef IDENTIFY
tIdentifyParm IdentifyParm;
#endif

#ifdef SNAPSHOT
int16_t SnapBuf1[DATA_BUFFER_SIZE], SnapBuf2[DATA_BUFFER_SIZE], SnapBuf3[DATA_BUFFER_SIZE], SnapBuf4[DATA_BUFFER_SIZE];
volatile uint16_t SnapStart, SnapDone;
snapshot_t board_snapshot = {
    { SnapBuf1, SnapBuf2, SnapBuf3, SnapBuf4 }, DATA_BUFFER_SIZE, SNAPDELAY, &SnapStart, &SnapDone, 0, 0
};
#endif

/** x * 2^bits, limited to 16 bits. */
static int16_t watch_scaled(int16_t x, uint16_t bits)
{
    int16_t limit = (int16_t)(32767 >> bits);
    return (int16_t)(qm_clamp(x, (int16_t)-limit, limit) * (1 << bits));
}

void watch_refresh(void)
{
    const drive_t *d = &board_drive;
    dq_t emf = estimator_emf(&d->estimator);

    FdWeakParm.qIndex = (int16_t)d->fieldweak.index;
    FdWeakParm.qIdRef = watch_scaled(d->control.ref_q13.d, 2);
    FdWeakParm.qFwOnSpeed = board_params.fieldweak.on_speed_erpm;
    MotorEstimParm.qRs = NORM_RS;
    MotorEstimParm.qLsDt = (int16_t)qm_mulhi_uu(d->tuning.ls_q16, (uint16_t)(2048u << board_params.estimator.ls_exp));
    MotorEstimParm.qInvKFi = d->tuning.inv_kfi;
    MotorEstimParm.qDeltaT = NORM_DELTAT;
    EstimParm.qRho = (int16_t)(d->estimator.rho_q32 >> 16);
    EstimParm.qVelEstim = estimator_speed(&d->estimator);
    EstimParm.qOmegaMr = d->estimator.omega_erpm;
    EstimParm.qEsdf = watch_scaled(emf.d, 1);
    EstimParm.qEsqf = watch_scaled(emf.q, 1);
    ParkParm.qIa = watch_scaled(d->i_a_q13, 2);
    ParkParm.qIb = watch_scaled(d->i_b_q13, 2);
    ParkParm.qId = watch_scaled(d->control.i_q13.d, 2);
    ParkParm.qIq = watch_scaled(d->control.i_q13.q, 2);
    ParkParm.qVd = watch_scaled(d->control.v_q14.d, 1);
    ParkParm.qVq = watch_scaled(d->control.v_q14.q, 1);
    ParkParm.qAngle = (int16_t)d->angle;
    CtrlParm.qVelRef = d->control.reference_erpm;
    CtrlParm.qVdRef = watch_scaled(d->control.ref_q13.d, 2);
    CtrlParm.qVqRef = watch_scaled(d->control.ref_q13.q, 2);
#ifdef IDENTIFY
    IdentifyParm.step = d->identify.step;
    IdentifyParm.result = d->identify.result;
    IdentifyParm.Rs_mohm = d->identify.values.rs_mohm;
    IdentifyParm.Ld_uH = d->identify.values.ld_uh;
    IdentifyParm.Lq_uH = d->identify.values.lq_uh;
    IdentifyParm.Kphi_mV_per_krpm = d->identify.values.kphi_mv_per_krpm;
#endif
}
