/* IDENTIFY on the board: its watch variable and its status line. */
#ifndef BOARD_MODES_IDENTIFY_REPORT_H
#define BOARD_MODES_IDENTIFY_REPORT_H

#include "drive/drive.h"

#ifdef IDENTIFY
/** What the drive has measured: step and result (identify_step_t, identify_result_t in drive/modes/identify.h), phase resistance [mohm]
 *  with the bridge's share, d and q inductance [uH], back-EMF [mV peak line to line per 1000 rpm], inertia
 *  [10^-8 kg m2], friction at standstill [uN m] and its growth [nN m s]; 0 = not measured yet. */
typedef struct {
    uint16_t step, result, Rs_mohm, Ld_uH, Lq_uH, Kphi_mV_per_krpm, J_1e8_kgm2, Coulomb_uNm, Viscous_nNms;
} tIdentifyParm;

extern tIdentifyParm IdentifyParm;

/** "step 0 DONE fault 0 R 2692 mohm Ld 1919 uH Lq 1920 uH Kphi 7240 mV/krpm J 550e-8 kgm2 friction 4000 uNm + 15300 nNms" in one line. @return its end */
char *identify_status_line(char *line, const drive_t *d);

/** Copies what has been measured to IdentifyParm. */
void identify_watch(const drive_t *d);
#endif

/** Longest status line and its end: retries with four reasons of a limit or more, or all that IDENTIFY measures, or a remedy of BRINGUP, or a client's
 *  longest frame. */
#if defined IDENTIFY
#define MODE_LINE_SIZE 160
#elif defined BRINGUP
#define MODE_LINE_SIZE 240
#elif SCOPE
#define MODE_LINE_SIZE 144
#else
#define MODE_LINE_SIZE 112
#endif

/** The mode's status line. @return its end; the line itself without the mode */
QM_INLINE char *mode_status_line(char *line, const drive_t *d)
{
#ifdef IDENTIFY
    return identify_status_line(line, d);
#else
    (void)d;
    return line;
#endif
}

/** Refreshes the mode's watch variable. */
QM_INLINE void mode_watch(const drive_t *d)
{
#ifdef IDENTIFY
    identify_watch(d);
#else
    (void)d;
#endif
}

#endif
