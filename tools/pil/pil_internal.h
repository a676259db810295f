/* The state of a board around an image, shared by pil.c and pil_shadow.c. */
#ifndef FOC33_PIL_PIL_INTERNAL_H
#define FOC33_PIL_PIL_INTERNAL_H

#include "pil.h"
#include "pil_probe.h"
#include "sfr.h"
#include "vb_internal.h"

enum { PIL_TEXT = 256 };

typedef struct {
    bool on, running;       /* wanted; the host's firmware has been initialised and follows */
    uint64_t ticks, differences;
    char first[PIL_TEXT];   /* the first difference */
} pil_shadow_t;

typedef struct {
    vb_t *vb;
    soc_t *soc;
    image_t image;
    soc_pty_t *terminal;
    double fcy_hz, base_s;  /* base_s is the time within the period at base_cycle */
    uint64_t base_cycle, start_cycle;
    double pending_s;       /* when the board must follow the core, VB_NEVER: not */
    bool clock_changed, was_reset, written, handled;
    bool in_handler;
    uint64_t entry_cycle, trigger_cycle;
    uint16_t counter_seen;  /* P1TMR as the handler has read it last */
    bool signals;           /* the image says where board_drive is */
    pil_shadow_t shadow;
} pil_t;

/* pil_shadow.c */
void pil_shadow_reset(pil_t *pil);
void pil_shadow_tick(pil_t *pil);
void pil_shadow_compare(pil_t *pil);

#endif
