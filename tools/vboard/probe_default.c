/* Empty probe tables for a build without probe.c: weak, so that the firmware's own definitions win. */
#include "probe.h"

#include <stddef.h>

extern const probe_signal_t probe_signals[] __attribute__((weak));
extern const probe_param_t probe_params[] __attribute__((weak));
extern const unsigned probe_signal_count __attribute__((weak));
extern const unsigned probe_param_count __attribute__((weak));
extern const double probe_isr_us __attribute__((weak));

const probe_signal_t probe_signals[1] = {{"", "", "", NULL}};
const unsigned probe_signal_count = 0;
const probe_param_t probe_params[1] = {{"", 0.0, ""}};
const unsigned probe_param_count = 0;
const double probe_isr_us = 13.0;

__attribute__((weak)) void probe_power_up(void)
{
}

__attribute__((weak)) const char *probe_fault_name(int code)
{
    (void)code;
    return "";
}

__attribute__((weak)) const char *probe_state_name(int state)
{
    (void)state;
    return "";
}
