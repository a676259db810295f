/* IDENTIFY on the board: its watch variable and its status line. */
#ifndef BOARD_MODES_IDENTIFY_REPORT_H
#define BOARD_MODES_IDENTIFY_REPORT_H

#include "drive/drive.h"

#ifdef IDENTIFY
/** What the drive has measured: step and result (identify_step_t, identify_result_t in drive/modes/identify.h), phase resistance [mohm]
 *  with the bridge's share, d and q inductance [uH], back-EMF [mV peak line to line per 1000 rpm]; 0 = not measured yet. */
typedef struct {
    uint16_t step, result, Rs_mohm, Ld_uH, Lq_uH, Kphi_mV_per_krpm;
} tIdentifyParm;

extern tIdentifyParm IdentifyParm;

/** "step 11 BUSY fault 0 R 2692 mohm Ld 1919 uH Lq 1920 uH Kphi 0 mV/krpm" in one line. @return its end */
char *identify_status_line(char *line, const drive_t *d);

/** Copies what has been measured to IdentifyParm. */
void identify_watch(const drive_t *d);
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
