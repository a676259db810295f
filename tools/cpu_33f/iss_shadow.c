/* Lock-step: the host's firmware gets the target's samples, commands and PWM counter at each control interrupt, and both results are compared. */
#include "iss_board_state.h"

#include <stdio.h>
#include <xc.h>

#include "board/firmware.h"
#include "board/watch.h"
#include "drive/drive.h"

enum { MOST_STARTING = 8 }; /* periods that drive_start() may take in the background */

/* Start the host's firmware anew. It takes every reset for power-on: a fault that the target has kept over its reset is followed at the
 * first tick, as one that its background raises. */
void iss_shadow_reset(iss_board_t *b)
{
    b->shadow.running = false;
#if !defined IDENTIFY && !defined BRINGUP /* there the background takes part in the procedure, which only one of the two can do */
    if (b->shadow.on && b->signals) {
        host_registers_reset();
        firmware_init();
#ifdef SNAPSHOT
        board_snapshot.row = 0;
        board_snapshot.wait = 0;
        SnapDone = 0;
#endif
        b->shadow.running = true;
    }
#endif
}

/* What the target's background and its other interrupts have done to the drive since the last tick. */
static void follow_commands(iss_board_t *b, const iss_commands_t *c)
{
    if (c->run != 0 && board_drive.command.run == 0) {
        drive_start(&board_drive, &board_params, c->direction);
        b->shadow.starting = 0;
    }
    board_drive.command.run = c->run;
    board_drive.command.clear_fault = c->clear_fault;
    board_drive.command.target_erpm = c->target_erpm;
#if HEAT_USED
    iss_probe_heat(&board_drive.heat);
#endif
#ifdef SNAPSHOT
    SnapStart = c->snap_start;
#endif
    if (c->fault != 0 && board_drive.fault == 0) {
        drive_raise(&board_drive, (drive_fault_t)c->fault);
    }
}

/* The target enters its control interrupt: commands and samples as they are now. */
void iss_shadow_tick(iss_board_t *b)
{
    if (!b->shadow.running) {
        return;
    }
    const chip_t *chip = b->cpu.chip;
    iss_commands_t commands = iss_probe_commands();
    follow_commands(b, &commands);
    ADC1BUF0 = CHIP_REG(chip, ADC1BUF0);
    ADC1BUF1 = CHIP_REG(chip, ADC1BUF1);
    ADC1BUF2 = CHIP_REG(chip, ADC1BUF2);
    ADC1BUF3 = CHIP_REG(chip, ADC1BUF3);
}

static void note_difference(iss_board_t *b, const char *name, double host, double target)
{
    iss_shadow_t *s = &b->shadow;
    if (s->first[0] == '\0') {
        (void)snprintf(s->first, sizeof s->first, "tick %llu (%.6f s), %s: target %.9g, host %.9g", (unsigned long long)s->ticks,
                       b->cpu.chip->plant->start_s + b->cpu.chip->plant->now_s, name, target, host);
    }
}

static bool registers_agree(iss_board_t *b)
{
    const chip_t *chip = b->cpu.chip;
    const struct { const char *name; uint16_t target, host; } row[] = {
        {"P1DC1", CHIP_REG(chip, P1DC1), P1DC1}, {"P1DC2", CHIP_REG(chip, P1DC2), P1DC2},
        {"P1DC3", CHIP_REG(chip, P1DC3), P1DC3}, {"P1OVDCON", CHIP_REG(chip, P1OVDCON), P1OVDCON},
    };
    for (size_t n = 0; n < sizeof row / sizeof row[0]; n++) {
        if (row[n].target != row[n].host) {
            note_difference(b, row[n].name, (double)row[n].host, (double)row[n].target);
            return false;
        }
    }
    return true;
}

static bool signals_agree(iss_board_t *b)
{
    for (unsigned n = 0; n < iss_probe_signal_count; n++) {
        double target = iss_probe_signals[n].read();
        double host = probe_signals[n].read();
        if (target != host) {
            note_difference(b, iss_probe_signals[n].name, host, target);
            return false;
        }
    }
    return true;
}

/* Counts a period that differs. While the bridge is off and nothing has been asked for, a start may be half prepared: it comes soon, or it counts. */
static void count_differences(iss_board_t *b)
{
    iss_shadow_t *s = &b->shadow;
    bool registers = registers_agree(b), signals = signals_agree(b);
    if (registers && !signals && board_drive.state == (uint16_t)DRIVE_STOPPED && board_drive.command.run == 0 && s->starting < MOST_STARTING) {
        s->starting++;
        return;
    }
    s->differences += s->starting + (registers && signals ? 0u : 1u);
    s->starting = 0;
    if (s->differences == 0u) {
        s->first[0] = '\0';
    }
}

/* The target has done the work of a period. The host's handlers run now, when it is known whether the target's were in time. */
void iss_shadow_compare(iss_board_t *b)
{
    if (!b->shadow.running) {
        return;
    }
    P1TMR = b->counter_seen;
    IFS0bits.AD1IF = 1;
    _ADC1Interrupt();
    if (IFS0bits.T2IF) {
        _T2Interrupt();
    }
    b->shadow.ticks++;
    count_differences(b);
    vb_counts(b->vb)->ticks = (double)b->shadow.ticks;
    vb_counts(b->vb)->differences = (double)b->shadow.differences;
}
