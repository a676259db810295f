/* BRINGUP on the board: the guide in the panel's place, its lines on the serial line, and the two pins that this may be on. */
#ifndef BOARD_MODES_BRINGUP_REPORT_H
#define BOARD_MODES_BRINGUP_REPORT_H

#include "board/firmware.h"
#include "drive/modes/bringup_guide.h"

#ifdef BRINGUP
/** Steps, answers, measurements. */
extern bringup_guide_t board_bringup;

/** The guide's next line, if it has one: "ask 4 ...", "ok BUS ...", "WRONG BUS ...", "-> BUS_DIVIDER: ...". @return its end */
char *bringup_line(char *line);

#define MODE_STATUS_MS 1u /* the guide waits for its lines */
#else
#define MODE_STATUS_MS 500u
#endif

/** 1 where the mode alone speaks. @param end where its line begins, and then ends */
QM_INLINE uint16_t mode_speaks(char **end)
{
#ifdef BRINGUP
    *end = bringup_line(*end);
    return 1;
#else
    (void)end;
    return 0;
#endif
}

#endif
