/* Handlers run by run: the cycles of all; of one or two, how often and how late which of its parts run, and which together. */
#include "iss_state.h"

#include <stdlib.h>
#include <string.h>

struct watch {
    unsigned vector, also;      /* 0: no other one */
    unsigned level;             /* handlers entered, with the watched one; 0: it does not run */
    uint64_t entered[NESTING], others[NESTING]; /* of each handler: cycle of its entry; cycles of handlers in between */
    uint64_t mask;              /* parts of this run */
    uint32_t times[ISS_WATCH_PARTS];
    uint64_t sets[ISS_WATCH_SETS];
    unsigned set_count;
    iss_watched_t seen;
    uint64_t parts[ISS_PROGRAM_WORDS + 1]; /* bits, by index of the instruction */
};

bool iss_watch(iss_t *m, unsigned vector)
{
    free(m->watch);
    m->watch = vector == 0 ? NULL : calloc(1, sizeof *m->watch);
    if (m->watch != NULL) {
        m->watch->vector = vector;
    }
    return vector == 0 || m->watch != NULL;
}

void iss_watch_also(iss_t *m, unsigned vector)
{
    if (m->watch != NULL) {
        m->watch->also = vector;
    }
}

void iss_watch_part(iss_t *m, uint32_t pc, unsigned part)
{
    if (m->watch != NULL && pc / 2u < ISS_PROGRAM_WORDS && part < ISS_WATCH_PARTS) {
        m->watch->parts[pc / 2u] |= (uint64_t)1 << part;
    }
}

bool iss_watch_set(iss_t *m, uint64_t parts)
{
    watch_t *w = m->watch;
    if (w == NULL || w->set_count == ISS_WATCH_SETS) {
        return false;
    }
    w->sets[w->set_count] = parts;
    w->set_count++;
    return true;
}

const iss_watched_t *iss_watched(const iss_t *m)
{
    return m->watch == NULL ? NULL : &m->watch->seen;
}

static uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

/* Of the handler with so many others around it. */
static uint32_t own_cycles(const iss_t *m, unsigned around)
{
    return (uint32_t)(m->cycle - m->watch->entered[around] - m->watch->others[around]);
}

/* A reset ends all handlers. */
void iss_watch_forget(iss_t *m)
{
    if (m->watch != NULL) {
        m->watch->level = 0;
    }
}

/* Before the entry takes its cycles and counts. */
void iss_watch_enter(iss_t *m, unsigned vector)
{
    watch_t *w = m->watch;
    unsigned around = m->nested % NESTING;
    w->entered[around] = m->cycle;
    w->others[around] = 0;
    if ((vector == w->vector || (w->also != 0 && vector == w->also)) && w->level == 0) {
        w->level = m->nested + 1u;
        w->mask = 0;
        memset(w->times, 0, sizeof w->times);
    }
}

static void note_run(watch_t *w)
{
    w->seen.runs++;
    for (unsigned part = 0; part < ISS_WATCH_PARTS; part++) {
        if ((w->mask >> part & 1u) != 0) {
            w->seen.times[part] = larger(w->seen.times[part], w->times[part]);
        }
    }
    for (unsigned n = 0; n < w->set_count; n++) {
        w->seen.whole[n] += (w->mask & w->sets[n]) == w->sets[n] ? 1u : 0u;
    }
}

/* After the return has taken its cycles and counts. */
void iss_watch_leave(iss_t *m, unsigned vector)
{
    watch_t *w = m->watch;
    unsigned around = m->nested % NESTING;
    if (vector < ISS_VECTORS) {
        w->seen.longest[vector] = larger(w->seen.longest[vector], own_cycles(m, around));
    }
    if (around > 0) {
        w->others[around - 1u] += m->cycle - w->entered[around];
    }
    if (w->level == m->nested + 1u) {
        note_run(w);
        w->level = 0;
    }
}

void iss_watch_instruction(iss_t *m, uint32_t index, unsigned handlers)
{
    watch_t *w = m->watch;
    uint64_t parts = w->level != 0 && handlers == w->level ? w->parts[index] : 0u;
    w->mask |= parts;
    for (unsigned part = 0; parts != 0; part++, parts >>= 1) {
        if ((parts & 1u) != 0) {
            w->times[part]++;
            w->seen.latest[part] = larger(w->seen.latest[part], own_cycles(m, w->level - 1u));
        }
    }
}
