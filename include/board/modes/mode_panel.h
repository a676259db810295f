/* Who looks at buttons and potentiometer: the panel, or BRINGUP's guide in its place. */
#ifndef BOARD_MODES_MODE_PANEL_H
#define BOARD_MODES_MODE_PANEL_H

#include "board/modes/bringup_report.h"
#include "drive/panel_tick.h"

/** After panel_init(). */
QM_INLINE void mode_panel_init(void)
{
#ifdef BRINGUP
    bringup_init(&board_bringup);
#endif
}

/** Buttons and potentiometer to what the drive is asked for. @return the lights */
QM_INLINE panel_lights_t mode_panel(const panel_inputs_t *in)
{
#ifdef BRINGUP
    return bringup_pass(&board_bringup, &board_drive, &board_params, in, board_panel.pot_q15);
#else
    return panel_tick(&board_panel, &board_drive, &board_params, in);
#endif
}

#endif
