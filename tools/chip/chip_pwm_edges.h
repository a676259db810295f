/* The part of the PWM module that runs at every switching edge, in a header so that it is inlined there. */
#ifndef FOC33_CHIP_CHIP_PWM_EDGES_H
#define FOC33_CHIP_CHIP_PWM_EDGES_H

#include "chip.h"

/* The gates as they are now, bits as in P1OVDCON. */
static inline uint8_t chip_pwm_mask(const chip_t *chip)
{
    unsigned mask = 0;
    for (unsigned k = 0; k < 3; k++) {
        mask |= (unsigned)chip->plant->inverter.gate[k] << (2u * k);
    }
    return (uint8_t)mask;
}

/* Transistors change at their planned edges. */
static inline void chip_pwm_apply_edges(chip_t *chip)
{
    for (unsigned k = 0; k < 3; k++) {
        chip_leg_t *leg = &chip->pwm.leg[k];
        while (leg->next < leg->count && leg->edge_s[leg->next] <= chip->plant->now_s) {
            plant_inverter_gate(chip->plant, k, (plant_gate_t)leg->edge_gate[leg->next]);
            leg->next++;
        }
    }
    chip->pwm.seen_mask = (uint8_t)(chip->pwm.seen_mask | chip_pwm_mask(chip));
}

static inline double chip_pwm_next_edge(const chip_t *chip)
{
    double first = PLANT_NEVER;
    for (unsigned k = 0; k < 3; k++) {
        const chip_leg_t *leg = &chip->pwm.leg[k];
        if (leg->next < leg->count && leg->edge_s[leg->next] < first) {
            first = leg->edge_s[leg->next];
        }
    }
    return first;
}

#endif
