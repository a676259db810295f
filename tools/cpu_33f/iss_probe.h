/* The probe's signals, read from a copy of the target's RAM instead of the host's drive object. */
#ifndef FOC33_CPU_33F_ISS_PROBE_H
#define FOC33_CPU_33F_ISS_PROBE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "probe.h"

/* The same rows as probe_signals; each read() looks at the target's drive object through iss_probe_refresh. */
extern const probe_signal_t iss_probe_signals[];
extern const unsigned iss_probe_signal_count;

/* Where the target's variables are. An address of 0: not in its RAM (parameters: a constant in flash). */
typedef struct {
    uint8_t *data; /* the target's data memory; NULL: the signals read zeroes */
    uint16_t drive, params;
    uint16_t snapshot, snap_start, snap_done, snap_buf[4]; /* with SNAPSHOT */
} iss_places_t;

/* They are read anew with every signal. */
void iss_probe_place(const iss_places_t *places);

/* The target has been reset. From here until it enables its control interrupt the RAM belongs to the start-up code: the signals keep their
 * values; after power-on they are 0. */
void iss_probe_restart(bool power_on);

/* Bytes of a drive object and of its parameters on the target. */
size_t iss_probe_drive_bytes(void);
size_t iss_probe_params_bytes(void);

/* As probe_param_get() and probe_param_set(), in the target's RAM. */
int iss_probe_param_get(const char *name, double *value);
int iss_probe_param_set(const char *name, double value);

/* What the background of the target asks of its control interrupt, and what the interrupt has made of it. */
typedef struct {
    int16_t run, clear_fault, target_erpm, direction;
    uint16_t state, fault, ticks;
    uint16_t snap_start;
} iss_commands_t;

iss_commands_t iss_probe_commands(void);

/* What the target's background has made of the temperatures, for the host's drive (heat_t, which has one layout on both). */
void iss_probe_heat(void *heat);

#endif
