/* Lock-step: the host's firmware gets the target's samples, commands and PWM counter at each control interrupt, and both results are compared. */
#include "pil_internal.h"

#include <stdio.h>
#include <xc.h>

#include "board/firmware.h"
#include "board/watch.h"
#include "drive/drive.h"

/* Start the host's firmware anew. It takes every reset for power-on: a fault that the target has kept over its reset is followed at the
 * first tick, as one that its background raises. */
void pil_shadow_reset(pil_t *pil)
{
    pil->shadow.running = false;
#ifndef IDENTIFY /* there the background takes part in the procedure, which only one of the two can do */
    if (pil->shadow.on && pil->signals) {
        host_registers_reset();
        firmware_init();
#ifdef SNAPSHOT
        board_snapshot.row = 0;
        board_snapshot.wait = 0;
        SnapDone = 0;
#endif
        pil->shadow.running = true;
    }
#endif
}

/* What the target's background and its other interrupts have done to the drive since the last tick. */
static void follow_commands(const pil_commands_t *c)
{
    if (c->run != 0 && board_drive.command.run == 0) {
        drive_start(&board_drive, &board_params, c->direction);
    }
    board_drive.command.run = c->run;
    board_drive.command.clear_fault = c->clear_fault;
    board_drive.command.target_erpm = c->target_erpm;
#ifdef SNAPSHOT
    SnapStart = c->snap_start;
#endif
    if (c->fault != 0 && board_drive.fault == 0) {
        drive_raise(&board_drive, (drive_fault_t)c->fault);
    }
}

/* The target enters its control interrupt: commands and samples as they are now. */
void pil_shadow_tick(pil_t *pil)
{
    if (!pil->shadow.running) {
        return;
    }
    const vb_regs_t *r = &pil->vb->reg;
    pil_commands_t commands = pil_target_commands();
    follow_commands(&commands);
    ADC1BUF0 = *r->adc1buf0;
    ADC1BUF1 = *r->adc1buf1;
    ADC1BUF2 = *r->adc1buf2;
    ADC1BUF3 = *r->adc1buf3;
}

static void note_difference(pil_t *pil, const char *name, double host, double target)
{
    pil_shadow_t *s = &pil->shadow;
    if (s->first[0] == '\0') {
        (void)snprintf(s->first, sizeof s->first, "tick %llu (%.6f s), %s: target %.9g, host %.9g", (unsigned long long)s->ticks,
                       pil->vb->start_s + pil->vb->now_s, name, target, host);
    }
}

static bool registers_agree(pil_t *pil)
{
    const vb_regs_t *r = &pil->vb->reg;
    const struct { const char *name; uint16_t target, host; } row[] = {
        {"P1DC1", *r->p1dc1, P1DC1}, {"P1DC2", *r->p1dc2, P1DC2}, {"P1DC3", *r->p1dc3, P1DC3}, {"P1OVDCON", *r->p1ovdcon, P1OVDCON},
    };
    for (size_t n = 0; n < sizeof row / sizeof row[0]; n++) {
        if (row[n].target != row[n].host) {
            note_difference(pil, row[n].name, (double)row[n].host, (double)row[n].target);
            return false;
        }
    }
    return true;
}

static bool signals_agree(pil_t *pil)
{
    for (unsigned n = 0; n < pil_target_signal_count; n++) {
        double target = pil_target_signals[n].read();
        double host = probe_signals[n].read();
        if (target != host) {
            note_difference(pil, pil_target_signals[n].name, host, target);
            return false;
        }
    }
    return true;
}

/* The target leaves its control interrupt. The host's handler runs now, when it is known whether the target's was in time. */
void pil_shadow_compare(pil_t *pil)
{
    if (!pil->shadow.running) {
        return;
    }
    P1TMR = pil->counter_seen;
    IFS0bits.AD1IF = 1;
    _ADC1Interrupt();
    pil->shadow.ticks++;
    if (!registers_agree(pil) || !signals_agree(pil)) {
        pil->shadow.differences++;
    }
    pil->vb->count.ticks = (double)pil->shadow.ticks;
    pil->vb->count.differences = (double)pil->shadow.differences;
}
