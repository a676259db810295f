/* tools/cpu_host/probe.c once more, for an image in the simulator.
 *
 * On the target 32-bit numbers are aligned to two bytes; the drive's structures have no pointers, enumerations or bit-fields, so under
 * pack(2) they have exactly the target's layout, and the same formulas read a copy of the target's RAM. iss_board.c compares the size with
 * the image's symbol table. */
#include "iss_probe.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include <xc.h>

#pragma GCC diagnostic ignored "-Waddress-of-packed-member"
#pragma pack(push, 2)

#include "board/firmware.h"
#include "board/watch.h"
#include "drive/param_limits.h"
#include "drive/param_scaling.h"
#include "drive/param_init.h"

#include "law.c" /* its functions read a drive, so they are needed in this layout too */

static drive_t target_drive;
static drive_params_t target_params = DRIVE_PARAMS_INIT;
static iss_places_t places;

enum { IEC0_ADDRESS = 0x0094, AD1IE = 0x2000 };
static bool starting; /* the start-up code clears and fills the RAM */

static bool is_starting(void)
{
    uint16_t iec0 = 0;
    if (starting) {
        memcpy(&iec0, places.data + IEC0_ADDRESS, sizeof iec0);
        starting = (iec0 & AD1IE) == 0;
    }
    return starting;
}

static drive_t *refreshed_drive(void)
{
    if (places.data != NULL && !is_starting()) {
        memcpy(&target_drive, places.data + places.drive, sizeof target_drive);
    }
    return &target_drive;
}

static int16_t target_word(unsigned address)
{
    int16_t word = 0;
    if (places.data != NULL && address != 0) {
        memcpy(&word, places.data + address, sizeof word);
    }
    return word;
}

#ifdef SNAPSHOT
/* The recorder's pointers have 16 bits on the target, so its layout is not the host's: four columns, rows, delay, start, done, row. */
enum { ROW_OFFSET = 8 * 2 };
typedef struct {
    uint16_t row;
} target_snapshot_t;

static target_snapshot_t target_snapshot(void)
{
    return (target_snapshot_t){places.snapshot == 0 ? (uint16_t)0 : (uint16_t)target_word(places.snapshot + ROW_OFFSET)};
}

static const int16_t *target_array(unsigned n)
{
    static int16_t copy[DATA_BUFFER_SIZE];
    if (places.data != NULL && places.snap_buf[n] != 0) {
        memcpy(copy, places.data + places.snap_buf[n], sizeof copy);
    }
    return copy;
}

#define board_snapshot target_snapshot()
#define SnapDone target_word(places.snap_done)
#define SnapBuf1 target_array(0)
#define SnapBuf2 target_array(1)
#define SnapBuf3 target_array(2)
#define SnapBuf4 target_array(3)
#endif

#define board_drive (*refreshed_drive())
#define board_params target_params
#define probe_signals iss_probe_signals
#define probe_signal_count iss_probe_signal_count
#define probe_params iss_unused_params
#define probe_param_count iss_unused_param_count
#define probe_isr_us iss_unused_isr_us
#define probe_fault_name iss_unused_fault_name
#define probe_state_name iss_unused_state_name
#define probe_param_get raw_param_get
#define probe_param_set raw_param_set

static int raw_param_get(const char *name, double *value);
static int raw_param_set(const char *name, double value);
const char *iss_unused_fault_name(int code);
const char *iss_unused_state_name(int code);
extern const probe_param_t iss_unused_params[];
extern const unsigned iss_unused_param_count;
extern const double iss_unused_isr_us;

#include "../cpu_host/probe.c"

#pragma pack(pop)

void iss_probe_place(const iss_places_t *found)
{
    places = *found;
}

void iss_probe_restart(bool power_on)
{
    starting = true;
    if (power_on) {
        memset(&target_drive, 0, sizeof target_drive);
    }
}

size_t iss_probe_drive_bytes(void)
{
    return sizeof target_drive;
}

size_t iss_probe_params_bytes(void)
{
    return sizeof target_params;
}

static bool params_are_in_ram(void)
{
    return places.data != NULL && places.params != 0;
}

int iss_probe_param_get(const char *name, double *value)
{
    if (!params_are_in_ram()) {
        return -1;
    }
    memcpy(&target_params, places.data + places.params, sizeof target_params);
    return raw_param_get(name, value);
}

int iss_probe_param_set(const char *name, double value)
{
    if (!params_are_in_ram()) {
        return -1;
    }
    memcpy(&target_params, places.data + places.params, sizeof target_params);
    int result = raw_param_set(name, value);
    if (result == 0) {
        memcpy(places.data + places.params, &target_params, sizeof target_params);
    }
    return result;
}

iss_commands_t iss_probe_commands(void)
{
    const drive_t *d = refreshed_drive();
    return (iss_commands_t){d->command.run, d->command.clear_fault, d->command.target_erpm, d->direction, d->state, d->fault, d->ticks,
                            (uint16_t)target_word(places.snap_start)};
}

void iss_probe_heat(void *heat)
{
#if HEAT_USED
    memcpy(heat, &refreshed_drive()->heat, sizeof refreshed_drive()->heat);
#else
    (void)heat;
#endif
}
