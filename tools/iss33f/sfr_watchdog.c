/* Watchdog and reset causes: FWDT's period, CLRWDT with its window, SWDTEN, the bits of RCON. */
#include "sfr_internal.h"

enum {
    FWDTEN = 0x80, /* FWDT */
    WINDIS = 0x40,
    WDTPRE = 0x10,
    WDTPOST = 0x0F,
    SWDTEN = 0x0020, /* RCON */
    WDTO = 0x0010
};

static bool is_enabled(const soc_t *soc)
{
    return (soc->config[IMAGE_FWDT] & FWDTEN) != 0 || (soc_get(soc, SFR_RCON) & SWDTEN) != 0;
}

static double period_s(const soc_t *soc)
{
    unsigned fwdt = soc->config[IMAGE_FWDT];
    double prescaler = (fwdt & WDTPRE) != 0 ? 128.0 : 32.0;
    return prescaler * (double)(1u << (fwdt & WDTPOST)) / soc->times.lprc_hz;
}

uint16_t soc_reset_bits(iss_reset_cause_t cause)
{
    switch (cause) {
    case ISS_RESET_POR: return 0x0003;
    case ISS_RESET_BOR: return 0x0002;
    case ISS_RESET_WATCHDOG: return 0x0010;
    case ISS_RESET_SOFTWARE: return 0x0040;
    case ISS_RESET_MCLR: return 0x0080;
    case ISS_RESET_ILLEGAL: return 0x4000;
    case ISS_RESET_TRAP: return 0x8000;
    default: return 0;
    }
}

/* The end of the period in cycles of the clock as it is now. */
void soc_watchdog_reschedule(soc_t *soc)
{
    soc_schedule(soc, SOC_WATCHDOG, is_enabled(soc) ? soc_cycle_at(soc, soc->watchdog_end_s) : SOC_NEVER);
}

static void restart(soc_t *soc)
{
    soc->watchdog_end_s = soc_seconds(soc) + period_s(soc);
    soc_watchdog_reschedule(soc);
}

void soc_watchdog_clear(soc_t *soc)
{
    bool window = (soc->config[IMAGE_FWDT] & WINDIS) == 0;
    double left_s = soc->watchdog_end_s - soc_seconds(soc);
    if (is_enabled(soc) && window && left_s > 0.25 * period_s(soc)) {
        soc_request_reset(soc, ISS_RESET_WATCHDOG); /* too early */
        return;
    }
    restart(soc);
}

/* Wakes a sleeping core, resets a running one. */
void soc_watchdog_event(soc_t *soc)
{
    if (iss_power(soc->iss) == ISS_POWER_RUN) {
        soc_request_reset(soc, ISS_RESET_WATCHDOG);
        return;
    }
    soc_put(soc, SFR_RCON, soc_get(soc, SFR_RCON) | WDTO);
    iss_wake(soc->iss);
    restart(soc);
}

static void write_rcon(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    soc_t *soc = context;
    bool before = is_enabled(soc);
    soc_put(soc, address, soc_merged(soc, address, value, mask));
    if (is_enabled(soc) != before) {
        restart(soc);
    }
}

static void clear_by_instruction(void *context)
{
    soc_watchdog_clear(context);
}

void soc_watchdog_hooks(soc_t *soc)
{
    iss_sfr_hook(soc->iss, SFR_RCON, NULL, write_rcon, soc);
    iss_on_clrwdt(soc->iss, clear_by_instruction, soc);
}

void soc_watchdog_reset(soc_t *soc)
{
    soc_put(soc, SFR_RCON, soc_get(soc, SFR_RCON) & ~(unsigned)SWDTEN);
    restart(soc);
}
