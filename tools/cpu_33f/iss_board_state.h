/* The state of a board around an image, shared by iss_board.c and iss_shadow.c. */
#ifndef FOC33_CPU_33F_ISS_BOARD_STATE_H
#define FOC33_CPU_33F_ISS_BOARD_STATE_H

#include "iss_board.h"
#include "iss_cpu.h"
#include "iss_probe.h"
#include "vb_cpu.h"

enum { ISS_DIFFERENCE = 256 };

typedef struct {
    bool on, running;       /* wanted; the host's firmware has been initialised and follows */
    uint64_t ticks, differences;
    unsigned starting;      /* differences while stopped that a start may explain: the interrupt came in the midst of drive_start() */
    char first[ISS_DIFFERENCE];
} iss_shadow_t;

typedef struct {
    iss_cpu_t cpu;          /* first: its hooks get the board by it */
    vb_t *vb;
    iss_image_t image;
    double fcy_hz, base_s;  /* base_s is the time within the period at base_cycle */
    uint64_t base_cycle, start_cycle;
    double pending_s;       /* when the board must follow the core, PLANT_NEVER: not */
    bool clock_changed, was_reset, written, handled;
    bool in_handler;
    bool slow_to_come;      /* the control interrupt has raised its slow work, which is not over */
    uint64_t entry_cycle, trigger_cycle, slow_cycle;
    uint16_t counter_seen;  /* P1TMR as the handler has read it last */
    bool (*core_raised)(void *context, unsigned irq);
    bool signals;           /* the image says where board_drive is */
    iss_shadow_t shadow;
} iss_board_t;

/* iss_shadow.c */
void iss_shadow_reset(iss_board_t *b);
void iss_shadow_tick(iss_board_t *b);
void iss_shadow_compare(iss_board_t *b);

#endif
