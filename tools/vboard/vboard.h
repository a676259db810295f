/* The virtual MCLV board: inverter, motor, supply, shunts and the dsPIC33FJ32MC204's peripherals around a CPU that runs the firmware.
 *
 * The board touches nothing but registers. It interprets what the firmware wrote (clock, PWM, dead time, trigger, ADC, overrides,
 * fault input), so that a wrong setting has the effect that it has on silicon, and says which register is responsible.
 * Everything that can be set or read has a string key; vb_key_info() lists them with unit, range and meaning.
 *
 * The host's registers and the host-built firmware are globals, so one process has one such CPU: do not run two boards
 * made by vb_create() at the same time.
 */
#ifndef FOC33_VBOARD_VBOARD_H
#define FOC33_VBOARD_VBOARD_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vb vb_t;

/* One key. `flags` is a sum of VB_KEY_*; min and max bound what vb_set() accepts (both inclusive). */
typedef struct {
    const char *name;
    const char *unit;
    const char *meaning;
    double min;
    double max;
    unsigned flags;
} vb_key_t;

enum {
    VB_KEY_READ = 1,
    VB_KEY_WRITE = 2,
    VB_KEY_WHOLE = 4 /* takes whole numbers only */
};

/* A new board around the firmware that is linked with this library, with the default Hurst motor; NULL if memory ran out. */
vb_t *vb_create(void);

void vb_destroy(vb_t *vb);

/* Write or read the quantity called `key`. 0, or -1 for an unknown key, a value outside the key's range, or a key that cannot be
 * written or read; vb_error() then says which. Besides the keys of vb_key_info() there is "reg.<NAME>" for every register. */
int vb_set(vb_t *vb, const char *key, double value);
int vb_get(vb_t *vb, const char *key, double *value);

/* One line about the last call that returned -1; "" if there was none. */
const char *vb_error(const vb_t *vb);

/* The key number i of this library, NULL when i is past the last; the firmware's probe signals ("fw.*") are included. */
const vb_key_t *vb_key_info(unsigned i);

/* Switch the board on: registers to their start values, peripherals idle, no current, bus at the supply's voltage, then the firmware's
 * initialisation. Angle and speed of the shaft, time, statistics, the trace and the warnings stay. 0, or -1 if the CPU failed. */
int vb_power_up(vb_t *vb);

/* Let `pwm_periods` PWM periods pass (50 us each while the PWM does not run): plant, interrupts and background. 0, or -1 before the
 * first vb_power_up(). */
int vb_run(vb_t *vb, uint32_t pwm_periods);

/* Record the named keys, one row every `decimation` periods, from now on; a previous trace is dropped. `names` is separated by commas or
 * blanks. An empty string stops tracing. 0, or -1 for an unknown or unreadable key, decimation 0 or lack of memory.
 * A row is taken after the interrupt handler; the "plant.*" values in it belong to the sampling instant that the handler worked on. */
int vb_trace_config(vb_t *vb, const char *names, unsigned decimation);

/* The rows so far, row by row. The pointer is valid until the next vb_run(), vb_trace_config() or vb_trace_clear(). */
const float *vb_trace_data(const vb_t *vb, size_t *rows, size_t *cols);

/* Drop the rows recorded so far and go on recording. */
void vb_trace_clear(vb_t *vb);

/* What is wrong with the configuration: texts that start with the register's name, each once; NULL when i is past the last. */
unsigned vb_warning_count(const vb_t *vb);
const char *vb_warning(const vb_t *vb, unsigned i);

/* Take up to `size` characters that the firmware sent on UART1; returns how many. */
size_t vb_uart_read(vb_t *vb, char *text, size_t size);

/* UART1 also on a pseudo-terminal; its path goes to `path`. 0, or -1. */
int vb_terminal(vb_t *vb, char *path, size_t size);

/* Queue characters for UART1's receiver; returns how many fitted. They arrive at the configured baud rate. */
size_t vb_uart_write(vb_t *vb, const char *text, size_t size);

/* The linked firmware's compiled-in parameter number i: name, value and unit. 0, or -1 when i is past the last. */
int vb_param(unsigned i, const char **name, double *value, const char **unit);

/* Names that the linked firmware gives to the numbers in "fw.fault" and "fw.state"; "" for unknown ones. */
const char *vb_fault_name(int code);
const char *vb_state_name(int state);

#ifdef __cplusplus
}
#endif

#endif
