/* BRINGUP, the first steps: serial line, buttons, LEDs, potentiometer. */
#include "drive/modes/bringup_panel.h"

#ifdef BRINGUP

#include "drive/modes/bringup_say.h"

#define REST_MS 100u     /* no button is touched yet */
#define REPEAT_MS 1000u  /* the first line again, by the other pin */
#define BUTTON_MS 20000u /* patience with a button */
#define POT_END 10       /* % */

static int16_t pot_percent(int16_t pot_q15)
{
    return (int16_t)((qm_muluu((uint16_t)((uint16_t)pot_q15 ^ 0x8000u), 100u) + 32768ul) >> 16);
}

void bringup_step_begin(bringup_guide_t *g, const panel_inputs_t *in)
{
    if (g->phase == 0u) {
        if (in->s2_down || in->s3_down) {
            bringup_give_up(g, BRINGUP_BUTTON_DOWN, 0);
        } else if (g->waited_ms >= REST_MS) {
            g->phase = 1;
            g->waited_ms = REPEAT_MS;
        } else {
            /* at rest so far */
        }
    } else if (g->button != 0u) {
        g->first = g->button;
        g->sender = BRINGUP_LINES_BOTH;
        bringup_go(g, BRINGUP_STEP_S3);
    } else if (g->waited_ms >= REPEAT_MS) {
        g->sender = (uint16_t)((g->sender == 0u) ? 1u : 0u);
        bringup_say(g, BRINGUP_ASKS, (uint16_t)BRINGUP_ASK_BEGIN, g->sender);
        g->waited_ms = 0;
    } else {
        /* it has been said */
    }
}

void bringup_step_s3(bringup_guide_t *g)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_S3, 0, 0);
    if (button == 0u) {
        if (g->waited_ms >= BUTTON_MS) {
            bringup_give_up(g, BRINGUP_BUTTON_DEAD, 0);
        }
        return;
    }
    if (button == g->first) {
        bringup_give_up(g, BRINGUP_BUTTON_DEAD, 0);
        return;
    }
    if (button == 2u) {
        bringup_find(g, BRINGUP_BUTTONS_SWAPPED, 0);
        g->swapped = 1;
    }
    bringup_go(g, BRINGUP_STEP_UART);
}

void bringup_step_uart(bringup_guide_t *g)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_UART, 0, 0);
    if (button == 0u) {
        return;
    }
    if (button == 3u) {
        bringup_find(g, BRINGUP_UART_PIN, 0);
    } else {
        g->sender = 0; /* the other pin may be anybody's */
    }
    bringup_go(g, BRINGUP_STEP_LED_ALIVE);
}

void bringup_step_led(bringup_guide_t *g, uint16_t led)
{
    bringup_question_t question = led ? BRINGUP_ASK_LED_RUN : BRINGUP_ASK_LED_ALIVE;
    uint16_t button;
    g->leds = (uint16_t)(1u << led);
    button = g->leds_judged ? 2u : bringup_answered(g, question, 0, 0);
    if (button == 2u) {
        bringup_go(g, led ? BRINGUP_STEP_POT_LEFT : BRINGUP_STEP_LED_RUN);
    } else if (button == 3u) {
        bringup_go(g, led ? BRINGUP_STEP_LED_RUN_OTHER : BRINGUP_STEP_LED_ALIVE_OTHER);
    } else {
        /* no answer yet */
    }
}

void bringup_step_led_other(bringup_guide_t *g, uint16_t led)
{
    uint16_t button = bringup_answered(g, BRINGUP_ASK_LED_OTHER, 0, 0);
    if (button == 0u) {
        return;
    }
    bringup_find(g, (button == 2u) ? BRINGUP_LEDS_SWAPPED : BRINGUP_LED_DARK, 0);
    g->leds_judged = (uint16_t)(button == 2u);
    bringup_go(g, led ? BRINGUP_STEP_POT_LEFT : BRINGUP_STEP_LED_RUN);
}

void bringup_step_pot_end(bringup_guide_t *g, int16_t pot_q15, uint16_t right)
{
    if (bringup_answered(g, right ? BRINGUP_ASK_POT_RIGHT : BRINGUP_ASK_POT_LEFT, 0, 0) == 0u) {
        return;
    }
    if (right) {
        g->pot_right = pot_percent(pot_q15);
    } else {
        g->pot_left = pot_percent(pot_q15);
    }
    bringup_go(g, right ? BRINGUP_STEP_POT : BRINGUP_STEP_POT_RIGHT);
}

static bringup_finding_t pot_finding(const bringup_guide_t *g)
{
    if (qm_abs((int16_t)(g->pot_right - g->pot_left)) <= POT_END) {
        return BRINGUP_POT_DEAD;
    }
    return (g->pot_left > g->pot_right) ? BRINGUP_POT_REVERSED : BRINGUP_POT_RANGE;
}

void bringup_step_pot(bringup_guide_t *g)
{
    int32_t zero = (int32_t)(PARAM_F(POT_LIVE_ZERO) * 100.0F);
    if (g->index == 0u) {
        (void)bringup_tell(g, BRINGUP_VALUE_POT_LEFT, 0, g->pot_left, 0, zero + POT_END);
        g->index = 1;
    } else {
        uint16_t right = bringup_tell(g, BRINGUP_VALUE_POT_RIGHT, 0, g->pot_right, 100 - zero - POT_END, 100);
        if (!right || g->pot_left > zero + POT_END) {
            g->pending = (uint16_t)pot_finding(g);
        }
        bringup_go(g, BRINGUP_STEP_BUS);
    }
}

#endif
