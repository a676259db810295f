/* Variables under AN1292's names and in its formats, and what it does not have; refreshed in the background. */
#ifndef BOARD_WATCH_H
#define BOARD_WATCH_H

#include "board/modes/mode_board.h"

/** Field weakening: table index in use, d reference (Q15 of full-scale current), start speed. Speeds here are in electrical rpm, or in
 *  counts of SPEED_UNIT of them (the table at the end of userparams.h) where MAXIMUM_SPEED_RPM is above 32000 electrical rpm. */
typedef struct {
    int16_t qIndex, qIdRef, qFwOnSpeed;
} tFdWeakParm;

/** Estimator's motor constants in AN1292's pre-divided formats. 1/Kphi in rpm/V (peak, line to line) is
 *  qInvKFi / NORM_INVKFIBASE * 1000 / MOTOR_KPHI_V_PER_KRPM. */
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

/** Load observer: speed (electrical rpm), and the q current that holds the load (Q15 of full-scale current, signed like the current). */
typedef struct {
    int16_t qVel, qLoad;
} tLoadParm;

/** What the running motor has shown against the header, Q15 of it, cleared by a start: the changes of 1/Kphi (the magnets' temperature: a
 *  weaker magnet makes it positive) and of Rs (the winding's). */
typedef struct {
    int16_t qInvKFi, qRs;
} tAdaptParm;

/** Why the drive gives less than it is asked for, sums of limit_reason_t (drive/limits.h): now, and since the last status line. */
typedef struct {
    uint16_t now, seen;
} tLimitParm;

/** Retries left before a fault stays, and the fault that began them (drive_fault_t; 0: none). */
typedef struct {
    uint16_t left, first;
} tRetryParm;

extern tFdWeakParm FdWeakParm;
extern tMotorEstimParm MotorEstimParm;
extern tEstimParm EstimParm;
extern tParkParm ParkParm;
extern tCtrlParm CtrlParm;
extern tLoadParm LoadParm;
extern tAdaptParm AdaptParm;
extern tLimitParm LimitParm;
extern tRetryParm RetryParm;

/** Copies the drive's state to the variables above. Background. */
void watch_refresh(void);

#endif
