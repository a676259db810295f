/* What a person does at the board: buttons and the potentiometer. */
#include "drive/inputs.h"

#include "drive/drive.h"

#define POT_STEP_Q15 32 /* half a step of the converter */
#define POT_BROKEN_MS 100u

uint16_t button_pressed(button_t *b, uint16_t down, uint16_t elapsed_ms)
{
    uint16_t before = b->down_ms;
    b->down_ms = 0;
    if (!down) {
        return 0;
    }
    b->down_ms = (uint16_t)(before + elapsed_ms);
    if (b->down_ms < BUTTON_DEBOUNCE_MS) {
        return 0;
    }
    b->down_ms = BUTTON_DEBOUNCE_MS;
    return (uint16_t)(before < BUTTON_DEBOUNCE_MS);
}

void contact_init(contact_t *c)
{
    c->is_on = 0;
    c->other_ms = BUTTON_DEBOUNCE_MS;
}

uint16_t contact_settled(contact_t *c, uint16_t on, uint16_t elapsed_ms)
{
    const uint16_t level = (uint16_t)(on != 0u), other_ms = (uint16_t)(c->other_ms + elapsed_ms);
    c->other_ms = 0;
    if (level != c->is_on) {
        if (other_ms >= BUTTON_DEBOUNCE_MS) {
            c->is_on = level;
        } else {
            c->other_ms = other_ms;
        }
    }
    return c->is_on;
}

void pot_init(pot_t *pot)
{
    pot->now_q15 = INT16_MIN;
    pot->smooth_q31 = INT32_MIN;
    pot->used_q15 = INT16_MIN;
    pot->broken_ms = 0;
}

uint16_t pot_travel(const drive_params_t *p, int16_t pot_q15)
{
    /* the middle of the converter's step, so that the upper end is reached to half a step */
    uint16_t pot_q16 = (uint16_t)(((uint16_t)pot_q15 ^ 0x8000u) | 0x20u);
    uint16_t most_q16 = (uint16_t)(65535u - 2u * p->pot_zero_q16), above = 0;
    if (p->pot_zero_q16 == 0u) { /* all of it is live */
        return pot_q16;
    }
    if (pot_q16 > p->pot_zero_q16) {
        above = (uint16_t)(pot_q16 - p->pot_zero_q16);
    }
    return (uint16_t)(qm_muluu((above > most_q16) ? most_q16 : above, p->pot_scale_q15) >> 15);
}

int16_t pot_smooth(pot_t *pot)
{
    int16_t now = qm_lowpass(&pot->smooth_q31, pot->now_q15, 6554);
    if (qm_beyond((int16_t)(now - pot->used_q15), POT_STEP_Q15)) {
        pot->used_q15 = now;
    }
    return pot->used_q15;
}

uint16_t pot_is_broken(pot_t *pot, const drive_params_t *p, uint16_t elapsed_ms)
{
    uint16_t pot_q16 = (uint16_t)((uint16_t)pot->now_q15 ^ 0x8000u), half = (uint16_t)(p->pot_zero_q16 >> 1);
    uint16_t top_q16 = (uint16_t)(65535u - half);
    if (half == 0u || (pot_q16 >= half && pot_q16 <= top_q16)) {
        pot->broken_ms = 0;
        return 0;
    }
    pot->broken_ms = (uint16_t)(pot->broken_ms + elapsed_ms);
    if (pot->broken_ms < POT_BROKEN_MS) {
        return 0;
    }
    pot->broken_ms = POT_BROKEN_MS;
    return 1;
}
