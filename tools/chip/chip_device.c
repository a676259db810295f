/* The chip as a whole: how its parts are connected, reset and brought to the end of a period. */
#include "chip.h"
#include "chip_assumptions.h"

#include <string.h>

enum { FPOR_PWMPIN = 0x80 };

/* Registers that no reset but power-on changes: the causes of the resets, and the running clock. */
static bool survives(uint16_t address)
{
    return address == SFR_RCON || address == SFR_OSCCON;
}

static void reset_registers(chip_t *chip, chip_reset_t cause)
{
    chip_put_reset_values(chip, cause == CHIP_RESET_POR ? NULL : survives);
    if ((chip->config[CHIP_FPOR] & FPOR_PWMPIN) == 0) {
        chip_put(chip, SFR_PWM1CON1, 0x0077); /* the PWM module owns its pins from the reset on */
    }
    chip_put(chip, SFR_RCON, cause == CHIP_RESET_POR ? 3u : chip_get(chip, SFR_RCON) | chip_reset_rcon(cause));
}

void chip_reset(chip_t *chip, chip_reset_t cause)
{
    chip->pending_reset = false;
    reset_registers(chip, cause);
    for (unsigned n = 0; n < CHIP_EVENTS; n++) {
        chip->event[n] = CHIP_NEVER;
    }
    chip_clock_reset(chip, cause);
    chip_timer_reset(chip);
    chip_capture_reset(chip);
    chip_uart_reset(chip);
    chip_watchdog_reset(chip);
}

/* By chip_event_t. */
static void (*const on_event[CHIP_EVENTS])(chip_t *) = {
    chip_clock_event, chip_watchdog_event, chip_timer_1, chip_timer_2, chip_timer_3, chip_uart_sent, chip_uart_received,
    chip_capture_signals,
};

bool chip_connect(chip_t *chip, const chip_cpu_t *cpu, const chip_board_t *board, plant_t *plant)
{
    memset(chip, 0, sizeof *chip);
    chip->cpu = *cpu;
    chip->plant = plant;
    if (board != NULL) {
        chip->board = *board;
    }
    if (!chip_find_registers(chip)) {
        return false;
    }
    memcpy(chip->on_event, on_event, sizeof on_event);
    for (unsigned n = 0; n < CHIP_CONFIG_WORDS; n++) {
        chip->config[n] = 0xFFFFFF;
    }
    chip->clock.crystal_hz = 8e6;
    chip->clock.frc_hz = ASSUME_FRC_HZ;
    chip->clock.lprc_hz = ASSUME_LPRC_HZ;
    chip->clock.pll_lock_s = 1e-6 * ASSUME_PLL_LOCK_US;
    chip->clock.crystal_start = ASSUME_CRYSTAL_START_PERIODS;
    chip->clock.fcy_hz = 0.5 * chip->clock.frc_hz;
    chip->adc.due_s = PLANT_NEVER;
    chip_clock_hooks(chip);
    chip_nvm_hooks(chip);
    chip_watchdog_hooks(chip);
    chip_ports_hooks(chip);
    chip_timer_hooks(chip);
    chip_capture_hooks(chip);
    chip_uart_hooks(chip);
    return true;
}

void chip_end(chip_t *chip)
{
    chip_uart_wake(chip);
    chip_happen(chip);
    chip_capture_follow(chip);
    chip_pwm_end(chip);
    chip_adc_end(chip);
    chip->nvm.standing_s = plant_max(chip->nvm.standing_s - chip->pwm.length_s, 0.0);
}
