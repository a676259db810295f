/* The seam between the drive and its modes: each mode is one file, which defines its hook twice, with the mode and without it.
 *
 * hook                  mode                   what it takes over
 * MODE_RUN              IDENTIFY, BRINGUP      a period with the bridge switching
 * MODE_ALIGNS           IDENTIFY, BRINGUP      what ALIGN does every slow step
 * mode_start            IDENTIFY, BRINGUP      the end of drive_start()
 * mode_idle             BRINGUP                a period with the bridge off
 * mode_background       IDENTIFY               a pass of the background
 * mode_reference_step   TUNING                 the speed reference in closed loop
 * mode_speed_target     TUNING                 the speed that the reference goes to
 * mode_current_step     TORQUE_MODE            the speed controller in closed loop
 * mode_limit_reasons    TORQUE_MODE            why the commanded current is not given
 * mode_target_range     TORQUE_MODE            what the potentiometer's travel means
 * mode_pot_split        BIDIRECTIONAL_SPEED    the potentiometer's direction
 * mode_hands_over       OPEN_LOOP_FUNCTIONING  the hand-over
 * MODE_PARAMS_PLACE     PARAMS_IN_RAM, TUNING  where the parameters are
 *
 * SNAPSHOT (modes/snapshot.h) is called by the board, which owns its arrays. With BRINGUP the board calls bringup_pass() in place of panel_tick(). */
#ifndef DRIVE_MODES_MODES_H
#define DRIVE_MODES_MODES_H

#include "drive/modes/bidirectional.h"
#include "drive/modes/bringup_tick.h"
#include "drive/modes/identify_tick.h"
#include "drive/modes/open_loop.h"
#include "drive/modes/params_in_ram.h"
#include "drive/modes/torque.h"
#include "drive/modes/tuning.h"

/** What runs a period with the bridge switching; and 1 where ALIGN is the start's. */
#if defined IDENTIFY
#define MODE_RUN identify_run
#define MODE_ALIGNS 0
#elif defined BRINGUP
#define MODE_RUN bringup_run
#define MODE_ALIGNS 0
#else
#define MODE_RUN drive_run
#define MODE_ALIGNS 1
#endif

/** The last thing that drive_start() prepares. */
QM_INLINE void mode_start(drive_t *d, const drive_params_t *p)
{
#if defined IDENTIFY
    identify_start(d, p);
#elif defined BRINGUP
    bringup_start(d, p);
#else
    (void)d;
    (void)p;
#endif
}

#endif
