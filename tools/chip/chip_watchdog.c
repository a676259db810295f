/* Watchdog and reset causes: FWDT's period, CLRWDT with its window, SWDTEN, the bits of RCON. */
#include "chip.h"

enum {
    FWDTEN = 0x80, /* FWDT */
    WINDIS = 0x40,
    WDTPRE = 0x10,
    WDTPOST = 0x0F,
    SWDTEN = 0x0020, /* RCON */
    WDTO = 0x0010
};

static bool is_enabled(const chip_t *chip)
{
    return (chip->config[CHIP_FWDT] & FWDTEN) != 0 || (chip_get(chip, SFR_RCON) & SWDTEN) != 0;
}

static double period_s(const chip_t *chip)
{
    unsigned fwdt = chip->config[CHIP_FWDT];
    double prescaler = (fwdt & WDTPRE) != 0 ? 128.0 : 32.0;
    return prescaler * (double)(1u << (fwdt & WDTPOST)) / chip->clock.lprc_hz;
}

/* The end of the period in cycles of the clock as it is now. */
void chip_watchdog_reschedule(chip_t *chip)
{
    chip_schedule(chip, CHIP_EVENT_WATCHDOG, is_enabled(chip) ? chip_cycle_at(chip, chip->watchdog_end_s) : CHIP_NEVER);
}

static void restart(chip_t *chip)
{
    chip->watchdog_end_s = chip_seconds(chip) + period_s(chip);
    chip_watchdog_reschedule(chip);
}

/* CLRWDT. */
void chip_watchdog_clear(void *context)
{
    chip_t *chip = context;
    bool window = (chip->config[CHIP_FWDT] & WINDIS) == 0;
    double left_s = chip->watchdog_end_s - chip_seconds(chip);
    if (is_enabled(chip) && window && left_s > 0.25 * period_s(chip)) {
        chip_request_reset(chip, CHIP_RESET_WATCHDOG); /* too early */
        return;
    }
    restart(chip);
}

/* Wakes a sleeping processor, resets a running one. */
void chip_watchdog_event(chip_t *chip)
{
    if (chip->cpu.wake == NULL || !chip->cpu.wake(chip->cpu.context)) {
        chip_request_reset(chip, CHIP_RESET_WATCHDOG);
        return;
    }
    chip_put(chip, SFR_RCON, chip_get(chip, SFR_RCON) | WDTO);
    restart(chip);
}

static void write_rcon(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    bool before = is_enabled(chip);
    chip_put(chip, address, chip_merged(chip, address, value, mask));
    if (is_enabled(chip) != before) {
        restart(chip);
    }
}

void chip_watchdog_hooks(chip_t *chip)
{
    chip_hook(chip, SFR_RCON, NULL, write_rcon);
}

void chip_watchdog_reset(chip_t *chip)
{
    chip_put(chip, SFR_RCON, chip_get(chip, SFR_RCON) & ~(unsigned)SWDTEN);
    restart(chip);
}
