/* BRINGUP: the background starts the bridge, lets the interrupt add up, and sees what has switched the bridge off. */
#include "drive/modes/bringup_measure.h"

#ifdef BRINGUP

#include "drive/modes/bringup_say.h"

#define START_MS 100u /* a start charges the drivers first */
#define SUM_LOG2 10u
#define SUM_PERIODS 1024u

void bringup_measure(drive_t *d, uint16_t wait)
{
    bringup_run_t *t = &d->run.bringup;
    t->sum_a = 0;
    t->sum_b = 0;
    t->off_a = 0;
    t->off_b = 0;
    t->wait = wait;
    t->left = SUM_PERIODS;
    t->ready = 0;
}

int16_t bringup_mean_of(int32_t sum)
{
    return (int16_t)(sum >> SUM_LOG2);
}

uint16_t bringup_started(bringup_guide_t *g, drive_t *d, const drive_params_t *p)
{
    if (g->phase == 0u) {
        drive_start(d, p, 1);
        g->waited_ms = 0;
        g->phase = 1;
    }
    return (uint16_t)(drive_is_running(d) || g->waited_ms >= START_MS);
}

uint16_t bringup_has_tripped(bringup_guide_t *g, const drive_t *d)
{
    bringup_finding_t finding = BRINGUP_FAULT;
    if (drive_is_running(d)) {
        return 0;
    }
    if (d->fault == (uint16_t)FAULT_OVERCURRENT_HW) {
        finding = BRINGUP_SHORT_CIRCUIT;
    } else if (d->fault == (uint16_t)FAULT_OVERCURRENT_SW) {
        finding = BRINGUP_OVERCURRENT;
    } else {
        /* another one */
    }
    bringup_give_up(g, finding, 0);
    g->message.value = (int32_t)d->fault;
    return 1;
}

uint16_t bringup_bus_10mv(const drive_t *d)
{
    return (uint16_t)((uint32_t)qm_muluu((uint16_t)((uint32_t)d->bus_q31 >> 16), (uint16_t)BRINGUP_10MV(BUS_FULL_SCALE_V)) >> 15);
}

#endif
