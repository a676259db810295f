/* What a processor's room needs of the board that it is put on. */
#ifndef FOC33_VBOARD_VB_CPU_H
#define FOC33_VBOARD_VB_CPU_H

#include "chip.h"
#include "probe.h"
#include "vboard.h"

/* A quantity that was measured `count` times. */
typedef struct {
    double count, min, max, sum, last;
} vb_range_t;

/* What a processor with a time of its own has counted; zeroes for the host. Latency: from the trigger to the write of the third duty;
 * entry: from the trigger to the handler. */
typedef struct {
    vb_range_t isr, slow, period, latency, entry;
    double stack_bytes, instructions, cycles, resets, errors;
    double ticks, differences;
} vb_counts_t;

/* A board with this processor. NULL: it lacks a register, or memory ran out. The struct is copied. */
vb_t *vb_create_with_cpu(const chip_cpu_t *cpu);

chip_t *vb_chip(vb_t *vb);
vb_counts_t *vb_counts(vb_t *vb);

/* The firmware's signals, in the order of probe_signals; NULL: nobody knows where they are. To begin with those of the linked firmware. */
void vb_use_signals(vb_t *vb, const probe_signal_t *signals);

/* The handler of the last sample has run: its row of the trace is complete. */
void vb_served(void *vb);

/* PWM periods between two passes of the main loop, where these take no time. */
double vb_background_periods(const vb_t *vb);

/* When the last sample was taken, within the period. */
double vb_sampled_at(const vb_t *vb);

int vb_fail(vb_t *vb, const char *format, ...) __attribute__((format(printf, 2, 3)));
void vb_warn(vb_t *vb, const char *format, ...) __attribute__((format(printf, 2, 3)));

#endif
