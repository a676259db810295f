/* What can be observed: errors with names, hooks, profile, stack, assumptions. */
#include "iss_state.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* An address with its name, as "0x0204 (main+4)". */
const char *iss_place(const iss_t *m, bool data, uint32_t address, char *buffer, size_t size)
{
    uint32_t offset = 0;
    const char *name = m->on_symbol != NULL ? m->on_symbol(m->symbol_context, data, address, &offset) : NULL;
    int digits = data ? 4 : 6;
    if (name == NULL) {
        (void)snprintf(buffer, size, "0x%0*X", digits, (unsigned)address);
    } else if (offset == 0) {
        (void)snprintf(buffer, size, "0x%0*X (%.60s)", digits, (unsigned)address, name);
    } else {
        (void)snprintf(buffer, size, "0x%0*X (%.60s+%u)", digits, (unsigned)address, name, (unsigned)offset);
    }
    return buffer;
}

/* Note an error at the present instruction; it stops the run if this kind does. */
void iss_report(iss_t *m, iss_error_t kind, const char *format, ...)
{
    char place[96], what[150];
    uint32_t pc = m->pc == CODE_OUTSIDE && kind == ISS_ERROR_FETCH ? m->lost_pc : iss_here(m);
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    (void)iss_place(m, false, pc, place, sizeof place);
    (void)snprintf(m->error, sizeof m->error, "%s, at %s", what, place);
    if (m->on_report != NULL) {
        m->on_report(m->report_context, kind, pc, m->error);
    }
    if ((m->stop_mask >> kind & 1u) != 0) {
        m->stop = ISS_STOP_ERROR;
        m->limit = 0;
    }
}

const char *iss_error(const iss_t *m)
{
    return m->error;
}

void iss_stop_on(iss_t *m, unsigned mask)
{
    m->stop_mask = mask;
}

/* ---- hooks ---- */

void iss_on_report(iss_t *m, void (*report)(void *, iss_error_t, uint32_t, const char *), void *context)
{
    m->on_report = report;
    m->report_context = context;
}

void iss_on_symbol(iss_t *m, const char *(*name)(void *, bool, uint32_t, uint32_t *), void *context)
{
    m->on_symbol = name;
    m->symbol_context = context;
}

void iss_on_clrwdt(iss_t *m, void (*cleared)(void *), void *context)
{
    m->on_clrwdt = cleared;
    m->clrwdt_context = context;
}

void iss_on_reset(iss_t *m, void (*reset)(void *, chip_reset_t), void *context)
{
    m->on_reset = reset;
    m->reset_context = context;
}

void iss_on_interrupt(iss_t *m, void (*enter)(void *, unsigned, uint64_t), void (*leave)(void *, unsigned, uint64_t), void *context)
{
    m->on_enter = enter;
    m->on_leave = leave;
    m->interrupt_context = context;
}

/* ---- profile ---- */

bool iss_profile(iss_t *m, iss_profile_t what)
{
    enum { PLACES = ISS_PROGRAM_WORDS + 1 };
    if (what != ISS_PROFILE_OFF && m->profile_counts == NULL) {
        m->profile_counts = calloc(PLACES, sizeof *m->profile_counts);
    }
    if (what != ISS_PROFILE_OFF && m->profile_cycles == NULL) {
        m->profile_cycles = calloc(PLACES, sizeof *m->profile_cycles);
    }
    if (what != ISS_PROFILE_OFF && (m->profile_counts == NULL || m->profile_cycles == NULL)) {
        return false;
    }
    if (what != ISS_PROFILE_OFF) {
        memset(m->profile_counts, 0, PLACES * sizeof *m->profile_counts);
        memset(m->profile_cycles, 0, PLACES * sizeof *m->profile_cycles);
    }
    m->profiling = what;
    m->profile_mark = m->cycle;
    m->limit = 0;
    return true;
}

const uint32_t *iss_profile_counts(const iss_t *m)
{
    return m->profile_counts;
}

const uint64_t *iss_profile_cycles(const iss_t *m)
{
    return m->profile_cycles;
}

/* ---- stack ---- */

unsigned iss_stack_bytes(const iss_t *m)
{
    return m->stack_top > m->stack_base ? (unsigned)(m->stack_top - m->stack_base) : 0u;
}

void iss_stack_clear(iss_t *m)
{
    m->stack_top = m->data[15];
}

/* ---- assumptions ---- */

bool iss_assumption(size_t row, iss_assumption_t *assumption)
{
    static const iss_assumption_t rows[] = {
#define ASSUMPTION_ROW(id, value, meaning, used_in) {#id, value, meaning, used_in},
        ASSUMPTIONS(ASSUMPTION_ROW)
#undef ASSUMPTION_ROW
    };
    if (row >= sizeof rows / sizeof rows[0]) {
        return false;
    }
    *assumption = rows[row];
    return true;
}
