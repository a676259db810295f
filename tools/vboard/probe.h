/* What the virtual board can read inside a host-built firmware: signals, parameters and the names of states and faults.
 *
 * The firmware's side defines all of it (tools/cpu_host/probe.c); without that file the empty defaults of probe_default.c are linked.
 */
#ifndef FOC33_VBOARD_PROBE_H
#define FOC33_VBOARD_PROBE_H

/* One signal of the running firmware. `name` is without the "fw." that the board puts before it ("theta_est_deg" becomes
 * "fw.theta_est_deg"; a name that already starts with "fw." is taken as it is). `read` returns the present value in `unit`. */
typedef struct {
    const char *name;
    const char *unit;
    const char *meaning;
    double (*read)(void);
} probe_signal_t;

/* One compiled-in parameter of userparams.h: its macro's name, its value, and the unit of the value. */
typedef struct {
    const char *name;
    double value;
    const char *unit;
} probe_param_t;

extern const probe_signal_t probe_signals[];
extern const unsigned probe_signal_count;
extern const probe_param_t probe_params[];
extern const unsigned probe_param_count;

/* From the control interrupt to the write of the duties, as cpu.isr_us: with deferred duties the write is the first that it does. */
extern const double probe_isr_us;

/* Read or write a parameter while the motor turns, as a debugger does: the entries of the three field-weakening tables and what frames
 * them, by their names in userparams.h and in its units. The value is rounded to the firmware's counts and used from the next period on.
 * 0; -1 where this build keeps it as a constant (no PARAMS_IN_RAM), or never lets it change; -2 for a value outside its range. A
 * power-up does not bring the old values back, but with PARAMS_KEPT. */
int probe_param_get(const char *name, double *value);
int probe_param_set(const char *name, double value);

/* Before the firmware starts: parameters in RAM that can be kept have their start values again, as the chip's start-up code gives them. */
void probe_power_up(void);

/* Name of a fault code or of a state number as the signals "fault" and "state" give them; "" for a number that has no name. */
const char *probe_fault_name(int code);
const char *probe_state_name(int state);

#endif
