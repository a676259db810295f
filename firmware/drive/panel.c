/* What a person does at the board: buttons S2 and S3, the potentiometer, and what the LEDs say; the retry does it in their place. */
#include "drive/panel.h"

#include "drive/drive.h"

/** Complement of the user's wishes, in which no bit of either goes unseen. */
static uint16_t panel_complement(const panel_t *panel)
{
    return (uint16_t) ~((uint16_t)panel->wish_run + (uint16_t)panel->fast_range);
}

uint16_t panel_holds(const panel_t *panel)
{
    return (uint16_t)(panel->kept == panel_complement(panel));
}

void panel_keep(panel_t *panel, uint16_t held)
{
    if (held) {
        panel->kept = panel_complement(panel);
    }
}

#define PANEL_BLINK_MS 250u
#define PANEL_PAUSE_MS 1500u
#define PANEL_POT_STEP_Q15 32 /* half a step of the converter */
#define PANEL_POT_BROKEN_MS 100u

void panel_init(panel_t *panel)
{
    drive_zero(panel, sizeof *panel);
    panel->kept = 0xFFFFu; /* panel_keep() without a wish */
    panel->pot_q15 = INT16_MIN;
    panel->pot_q31 = INT32_MIN;
    panel->pot_used_q15 = INT16_MIN;
}

/** A fault has ended a run (1), or that no longer matters (0). */
static void panel_interrupt(panel_t *panel, int16_t interrupted)
{
    if (RETRY_COUNT != 0) {
        panel->interrupted = interrupted;
    }
}

uint16_t button_pressed(button_t *b, uint16_t down, uint16_t elapsed_ms)
{
    uint16_t before = b->down_ms;
    b->down_ms = 0;
    if (!down) {
        return 0;
    }
    b->down_ms = (uint16_t)(before + elapsed_ms);
    if (b->down_ms < PANEL_DEBOUNCE_MS) {
        return 0;
    }
    b->down_ms = PANEL_DEBOUNCE_MS;
    return (uint16_t)(before < PANEL_DEBOUNCE_MS);
}

/** low + (high - low) * fraction, the fraction in Q16. */
static int16_t panel_between(int16_t low, int16_t high, uint16_t fraction_q16)
{
    return (int16_t)(low + (int16_t)qm_mulhi_uu((uint16_t)(high - low), fraction_q16));
}

/** Share of the travel between its dead ends, Q16. */
static uint16_t panel_travel(const drive_params_t *p, uint16_t pot_q16)
{
    uint16_t most_q16 = (uint16_t)(65535u - 2u * p->pot_zero_q16), above = 0;
    if (p->pot_zero_q16 == 0u) { /* all of it is live */
        return pot_q16;
    }
    if (pot_q16 > p->pot_zero_q16) {
        above = (uint16_t)(pot_q16 - p->pot_zero_q16);
    }
    return (uint16_t)(qm_muluu((above > most_q16) ? most_q16 : above, p->pot_scale_q15) >> 15);
}

/** A wire of the potentiometer is broken: its signal stays in the outer half of a dead end. */
static void panel_check_pot(panel_t *panel, drive_t *d, const drive_params_t *p, uint16_t elapsed_ms)
{
    uint16_t pot_q16 = (uint16_t)((uint16_t)panel->pot_q15 ^ 0x8000u), half = (uint16_t)(p->pot_zero_q16 >> 1);
    uint16_t top_q16 = (uint16_t)(65535u - half);
    if (half == 0u || (pot_q16 >= half && pot_q16 <= top_q16)) {
        panel->pot_broken_ms = 0;
        return;
    }
    panel->pot_broken_ms = (uint16_t)(panel->pot_broken_ms + elapsed_ms);
    if (panel->pot_broken_ms >= PANEL_POT_BROKEN_MS) {
        panel->pot_broken_ms = PANEL_POT_BROKEN_MS;
        drive_raise(d, FAULT_POTENTIOMETER);
    }
}

int16_t panel_target(const drive_params_t *p, int16_t pot_q15, int16_t fast_range, int16_t direction)
{
    /* the middle of the converter's step, so that the upper end is reached to half a step */
    uint16_t pot_q16 = (uint16_t)(((uint16_t)pot_q15 ^ 0x8000u) | 0x20u);
    int16_t towards = direction;
    uint16_t travel_q16 = mode_pot_split(panel_travel(p, pot_q16), &towards);
    mode_range_t range = mode_target_range(p, fast_range);
    return (int16_t)(towards * panel_between(range.low, range.high, travel_q16));
}

/** Filters the potentiometer (10 ms) and holds it within a converter step, so that noise does not move the reference. */
static int16_t panel_pot(panel_t *panel)
{
    int16_t now = qm_lowpass(&panel->pot_q31, panel->pot_q15, 6554);
    if (qm_beyond((int16_t)(now - panel->pot_used_q15), PANEL_POT_STEP_Q15)) {
        panel->pot_used_q15 = now;
    }
    return panel->pot_used_q15;
}

static void panel_buttons(panel_t *panel, drive_t *d, const panel_inputs_t *in)
{
    if (button_pressed(&panel->s2, in->s2_down, in->elapsed_ms)) {
        if (d->fault != (uint16_t)FAULT_NONE) {
            d->command.clear_fault = 1;
            panel_interrupt(panel, 0);
        } else if (RETRY_COUNT != 0 && panel->interrupted) {
            panel_interrupt(panel, 0); /* a moment before the retry */
        } else {
            panel->wish_run ^= 1;
        }
        panel->fast_range = 0;
        remote_give_up(in->remote);
    }
    if (button_pressed(&panel->s3, in->s3_down, in->elapsed_ms) && panel->wish_run) {
        panel->fast_range ^= 1;
    }
    if (d->fault != (uint16_t)FAULT_NONE && panel->wish_run) {
        panel->wish_run = 0;
        panel_interrupt(panel, 1);
    }
}

/** A fault's code, blinked. @param burst_ms how long that takes */
static uint16_t panel_fault_light(uint16_t blink_ms, uint16_t burst_ms)
{
    return (uint16_t)(blink_ms < burst_ms && (blink_ms / PANEL_BLINK_MS) % 2u == 0u);
}

static panel_lights_t panel_lights(panel_t *panel, const drive_t *d, uint16_t elapsed_ms)
{
    panel_lights_t lights;
    uint16_t burst_ms = (uint16_t)(2u * PANEL_BLINK_MS * d->fault);
    uint16_t blink_ms = (uint16_t)(panel->blink_ms + elapsed_ms);
    if (blink_ms >= ((burst_ms == 0u) ? 4u * PANEL_BLINK_MS : burst_ms + PANEL_PAUSE_MS)) {
        blink_ms = 0;
    }
    panel->blink_ms = blink_ms;
    lights.led_alive = (burst_ms == 0u) ? (uint16_t)(blink_ms < 2u * PANEL_BLINK_MS) : panel_fault_light(blink_ms, burst_ms);
    lights.led_run = drive_is_running(d);
    return lights;
}

panel_lights_t panel_tick(panel_t *panel, drive_t *d, const drive_params_t *p, const panel_inputs_t *in)
{
    int16_t target;
    uint16_t held = panel_holds(panel);
    panel_check_pot(panel, d, p, in->elapsed_ms);
    panel_buttons(panel, d, in);
    remote_tick(in->remote, panel, d, in->elapsed_ms);
    target = remote_target(in->remote, p, panel_target(p, panel_pot(panel), panel->fast_range, d->direction));
    d->command.target_erpm = target;
    if (!panel->wish_run) {
        d->command.run = 0;
    } else if (d->state == (uint16_t)DRIVE_STOPPED) {
        if (!d->command.run) {
            drive_begin(d, p, (int16_t)((target >= 0) ? 1 : -1));
        }
    } else if (drive_is_closed(d)) {
        d->command.run = 1; /* a stop under way goes on from the present speed; the drive itself turns to the target's direction */
    } else if ((target ^ d->direction) < 0) {
        d->command.run = 0; /* not caught yet: let go, and start again in the other direction */
    } else {
        /* it starts */
    }
    if (mode_background(d, p)) {
        panel->wish_run = 0;
    }
    panel_keep(panel, held);
    return panel_lights(panel, d, in->elapsed_ms);
}

/* ---- the retry ---- */

#define RETRY_MS(seconds) ((uint32_t)(PARAM_F(seconds) * 1000.0F + 0.5F))

void retry_init(retry_t *r)
{
    drive_zero(r, sizeof *r);
    r->left = RETRY_COUNT;
}

/** 1 for a fault that may pass by itself (drive/faults.h). */
static uint16_t retry_may_pass(uint16_t fault)
{
#define PASSING_BIT(code, name, passes, decided_by, cause, remedy) | ((uint32_t)(passes) << (code))
    const uint32_t passing = 0ul DRIVE_FAULT_TABLE(PASSING_BIT);
    return (uint16_t)((passing >> fault) & 1u);
}

/** Counts a time. @return 1 when it is over; it then begins anew */
static uint16_t time_is_over(retry_t *r, uint16_t elapsed_ms, uint32_t time_ms)
{
    r->waited_ms += elapsed_ms;
    if (r->waited_ms < time_ms) {
        return 0;
    }
    r->waited_ms = 0;
    return 1;
}

/** A fault stands that has ended a run. */
static void retry_pause(retry_t *r, drive_t *d, uint16_t elapsed_ms)
{
    if (r->first == (uint16_t)FAULT_NONE) {
        r->first = d->fault;
    }
    if (r->fault != d->fault) {
        r->fault = d->fault;
        r->waited_ms = 0;
    }
    r->asked = 0;
    if (r->left != 0u && retry_may_pass(d->fault) && time_is_over(r, elapsed_ms, RETRY_MS(RETRY_PAUSE_SEC))) {
        r->left--;
        r->asked = 1;
        d->command.clear_fault = 1;
    }
}

void retry_tick(retry_t *r, panel_t *panel, drive_t *d, uint16_t elapsed_ms)
{
    if (RETRY_COUNT == 0) {
        return;
    }
    if (!panel->interrupted) {
        uint16_t calm = (uint16_t)(drive_is_closed(d) && time_is_over(r, elapsed_ms, RETRY_MS(RETRY_FORGET_SEC)));
        if (calm || !panel->wish_run) { /* long enough without a fault, or a person has stopped it */
            retry_init(r);
        }
    } else if (d->fault != (uint16_t)FAULT_NONE) {
        retry_pause(r, d, elapsed_ms);
    } else if (!r->asked) {
        panel->interrupted = 0; /* somebody else has cleared it */
    } else if (d->state == (uint16_t)DRIVE_STOPPED) {
        uint16_t held = panel_holds(panel);
        panel->interrupted = 0;
        panel->wish_run = 1;
        panel_keep(panel, held);
        r->fault = (uint16_t)FAULT_NONE;
        r->asked = 0;
        r->waited_ms = 0;
    } else { /* it is about to stop */
    }
}
