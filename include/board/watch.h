/* Variables under the names AN1292's readers watch, in the note's formats; refreshed in the background. */
#ifndef BOARD_WATCH_H
#define BOARD_WATCH_H

#include <stdint.h>

#include "control/qmath.h"
#include "drive/param_scaling.h"

/** Field weakening: table index in use, d reference (Q15 of full-scale current), start speed (electrical rpm). */
typedef struct {
    int16_t qIndex, qIdRef, qFwOnSpeed;
} tFdWeakParm;

/** Estimator's motor constants in the note's pre-divided formats. */
typedef struct {
    int16_t qRs, qLsDt, qInvKFi, qDeltaT;
} tMotorEstimParm;

/** Estimator: angle (65536 = one turn), speed and filtered speed (electrical rpm), back-EMF (Q15 of 4 times full scale). */
typedef struct {
    int16_t qRho, qVelEstim, qOmegaMr, qEsdf, qEsqf;
} tEstimParm;

/** Measured currents and commanded voltages (Q15 of full scale; voltages above it are limited), and the control angle. */
typedef struct {
    int16_t qIa, qIb, qId, qIq, qVd, qVq, qAngle;
} tParkParm;

/** References: speed (electrical rpm) and both currents (Q15 of full scale). */
typedef struct {
    int16_t qVelRef, qVdRef, qVqRef;
} tCtrlParm;

extern tFdWeakParm FdWeakParm;
extern tMotorEstimParm MotorEstimParm;
extern tEstimParm EstimParm;
extern tParkParm ParkParm;
extern tCtrlParm CtrlParm;

#ifdef IDENTIFY
/** What the drive has measured: step and result (identify_step_t, identify_result_t in drive/identify.h), phase resistance [mohm] with
 *  the bridge's share, d and q inductance [uH], back-EMF [mV peak line to line per 1000 rpm]; 0 = not measured yet. */
typedef struct {
    uint16_t step, result, Rs_mohm, Ld_uH, Lq_uH, Kphi_mV_per_krpm;
} tIdentifyParm;

extern tIdentifyParm IdentifyParm;
#endif

#ifdef SNAPSHOT
/** Set SnapStart to 1; SnapDone becomes 1 when the arrays are full. Columns: phase current a, q current (Q15 of full
 *  scale), filtered estimated speed (electrical rpm), estimated angle. */
extern int16_t SnapBuf1[DATA_BUFFER_SIZE], SnapBuf2[DATA_BUFFER_SIZE], SnapBuf3[DATA_BUFFER_SIZE], SnapBuf4[DATA_BUFFER_SIZE];
extern volatile uint16_t SnapStart, SnapDone;
#endif

/** Copies the drive's state to the variables above. Background. */
void watch_refresh(void);

/** One period of the recorder; nothing without SNAPSHOT. Control interrupt. */
#ifdef SNAPSHOT
#include "board/firmware.h"
#include "drive/snapshot.h"
extern snapshot_t board_snapshot;
QM_INLINE void watch_snapshot(void)
{
    snapshot_tick(&board_snapshot, &board_drive);
}
#else
QM_INLINE void watch_snapshot(void)
{
}
#endif

#endif
