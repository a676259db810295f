/* The seam between the board and the modes: lines, watch variables, arrays and memory of theirs. */
#ifndef BOARD_MODES_MODE_BOARD_H
#define BOARD_MODES_MODE_BOARD_H

#include "drive/drive.h"
#include "drive/modes/bringup.h"
#include "drive/modes/mode_table.h"
#include "drive/request.h"

#ifdef IDENTIFY

/** What the drive has measured: step and result (identify_step_t, identify_result_t in drive/modes/identify.h), phase resistance [uohm]
 *  with the bridge's share, d and q inductance [nH], back-EMF [uV peak line to line per 1000 rpm], inertia
 *  [10^-9 kg m2], friction at standstill [10^-8 N m] and its growth [10^-9 N m s]; 0 = not measured. */
typedef struct {
    uint16_t step, result;
    uint32_t Rs_uohm, Ld_nH, Lq_nH, Kphi_uV_per_krpm, J_1e9_kgm2, Coulomb_1e8_Nm, Viscous_1e9_Nms;
} tIdentifyParm;

extern tIdentifyParm IdentifyParm;
#endif

#ifdef TORQUE_PROFILE
/** The learned q current (Q15 of full scale): of this moment, and the cosine and sine of each harmonic of the turn. */
typedef struct {
    int16_t qNow, qCos[PROFILE_ORDERS], qSin[PROFILE_ORDERS];
} tProfileParm;

extern tProfileParm ProfileParm;
#endif

/** Longest status line and its end: retries with four reasons of a limit or more, or all that IDENTIFY measures, or a remedy of BRINGUP, or a client's
 *  longest frame. */
#if defined IDENTIFY
#define MODE_LINE_SIZE 208
#elif defined BRINGUP
#define MODE_LINE_SIZE 240
#else
#define MODE_LINE_SIZE 144
#endif

/** Refreshes the mode's watch variable. */
void mode_watch(const drive_t *d);

/* ---- BRINGUP on the board: the guide in the panel's place, its lines on the serial line, and the two pins that this may be on ---- */

#ifdef BRINGUP
/** Steps, answers, measurements. */
extern bringup_guide_t board_bringup;

#define MODE_STATUS_MS 1u /* the guide waits for its lines */
#else
#define MODE_STATUS_MS 500u
#endif

/** 1 where the mode alone speaks. @param end where its line begins, and then ends */
uint16_t mode_speaks(char **end);

/* ---- SNAPSHOT on the board: AN1292's arrays, and the recorder that fills them ---- */

#ifdef SNAPSHOT
/** Set SnapStart to 1; SnapDone becomes 1 when the arrays are full. Columns: phase current a, q current (Q15 of full
 *  scale), filtered estimated speed (as EstimParm.qVelEstim), estimated angle. */
extern int16_t SnapBuf1[DATA_BUFFER_SIZE], SnapBuf2[DATA_BUFFER_SIZE], SnapBuf3[DATA_BUFFER_SIZE], SnapBuf4[DATA_BUFFER_SIZE];

extern volatile uint16_t SnapStart, SnapDone;

extern snapshot_t board_snapshot;
#endif

/** The mode's part of the slow work. */
void mode_record(void);

/* ---- Who looks at buttons and potentiometer: the application, or BRINGUP's guide in its place ---- */

/** After application_init(). */
void mode_panel_init(void);

/** A pass of the guide in the application's place: buttons, potentiometer, lights. @return 1 where it is */
uint16_t mode_panel(uint16_t elapsed_ms);

/* ---- The scope's memory: what the chip has left without the fault recorder, less what a mode takes of it ---- */

/** Bytes that a mode has in RAM. */
#if defined(TUNING) || defined(PARAMS_IN_RAM)
#define SCOPE_MODE_PARAMS (sizeof(drive_params_t) + ((PARAMS_KEPT) ? 192u : 0u)) /* and what kept.c has */
#else
#define SCOPE_MODE_PARAMS 0u
#endif
#ifdef IDENTIFY
#define SCOPE_MODE_IDENTIFY (sizeof(identify_t) + 232u) /* its stack, too */
#else
#define SCOPE_MODE_IDENTIFY 0u
#endif
#ifdef BRINGUP
#define SCOPE_MODE_BRINGUP 360u
#else
#define SCOPE_MODE_BRINGUP 0u
#endif
#ifdef TORQUE_PROFILE
#define SCOPE_MODE_PROFILE 48u
#else
#define SCOPE_MODE_PROFILE 0u
#endif
#ifdef SNAPSHOT
#define SCOPE_MODE_SNAPSHOT (8u * (DATA_BUFFER_SIZE) + 24u)
#if SCOPE && (DATA_BUFFER_SIZE) > 60
#error userparams.h: SNAPSHOT and SCOPE 1 together have no room for DATA_BUFFER_SIZE rows: lower it to 60
#endif
#else
#define SCOPE_MODE_SNAPSHOT 0u
#endif

/** Of the trace buffer. */
#define SCOPE_BYTES ((840u - SCOPE_MODE_PARAMS - SCOPE_MODE_IDENTIFY - SCOPE_MODE_BRINGUP - SCOPE_MODE_PROFILE - SCOPE_MODE_SNAPSHOT) & ~3u)

#endif
