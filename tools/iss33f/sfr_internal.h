/* The chip's state and what its peripherals offer each other; for the sfr_*.c files only. */
#ifndef FOC33_ISS33F_SFR_INTERNAL_H
#define FOC33_ISS33F_SFR_INTERNAL_H

#include "assumptions.h"
#include "sfr.h"

#define SOC_NEVER UINT64_MAX

/* Things that happen by themselves at a cycle. */
typedef enum { SOC_CLOCK, SOC_WATCHDOG, SOC_TIMER1, SOC_TIMER2, SOC_TIMER3, SOC_SEND, SOC_RECEIVE, SOC_EVENTS } soc_event_t;

enum { SOC_FIFO = 4, SOC_TIMERS = 3 };

typedef struct {
    unsigned low_step, high_step;   /* how far the unlock sequence of OSCCON's halves has come */
    uint64_t low_cycle, high_cycle; /* of its last write */
    bool locked_once;               /* IOLOCK has been set since the reset (IOL1WAY) */
} soc_clock_t;

typedef struct {
    uint64_t base_cycle; /* the count was base_count then */
    uint32_t base_count;
    bool counts;
} soc_timer_t;

typedef struct {
    uint8_t tx[SOC_FIFO], rx[SOC_FIFO];
    unsigned tx_count, rx_count;
    uint8_t shift, incoming;
    bool sending, receiving;
} soc_uart_t;

struct soc {
    iss_t *iss;
    uint16_t *data; /* the core's data memory as words */
    uint32_t config[IMAGE_CONFIG_WORDS];
    soc_board_t board;
    soc_times_t times;
    double fcy_hz, base_s; /* base_s is the time at base_cycle */
    uint64_t base_cycle, limit;
    uint64_t event[SOC_EVENTS];
    bool running, broken;
    bool pending_reset;
    iss_reset_cause_t pending_cause;
    unsigned resets;
    double watchdog_end_s;
    soc_clock_t clock;
    soc_timer_t timer[SOC_TIMERS];
    soc_uart_t uart;
};

/* sfr_soc.c */
static inline uint16_t soc_get(const soc_t *soc, uint16_t address)
{
    return soc->data[address / 2u];
}

static inline void soc_put(soc_t *soc, uint16_t address, unsigned value)
{
    soc->data[address / 2u] = (uint16_t)value;
}

/* The register after a write of the bits in `mask`. */
static inline uint16_t soc_merged(const soc_t *soc, uint16_t address, uint16_t value, uint16_t mask)
{
    return (uint16_t)((soc_get(soc, address) & (uint16_t)~mask) | (value & mask));
}

uint64_t soc_now(const soc_t *soc);
void soc_schedule(soc_t *soc, soc_event_t event, uint64_t cycle);
void soc_note(soc_t *soc, const char *text);
double soc_time_at(const soc_t *soc, uint64_t cycle);
uint64_t soc_cycle_at(const soc_t *soc, double time_s);
void soc_request_reset(soc_t *soc, iss_reset_cause_t cause);

/* sfr_clock.c */
void soc_clock_hooks(soc_t *soc);
void soc_clock_reset(soc_t *soc, iss_reset_cause_t cause);
void soc_clock_event(soc_t *soc);
bool soc_pins_locked(const soc_t *soc);

/* sfr_watchdog.c */
void soc_watchdog_hooks(soc_t *soc);
void soc_watchdog_reset(soc_t *soc);
void soc_watchdog_event(soc_t *soc);
void soc_watchdog_clear(soc_t *soc);
void soc_watchdog_reschedule(soc_t *soc);
uint16_t soc_reset_bits(iss_reset_cause_t cause);

/* sfr_ports.c */
void soc_ports_hooks(soc_t *soc);
bool soc_pin_has_function(const soc_t *soc, unsigned function);

/* sfr_timer.c */
void soc_timer_hooks(soc_t *soc);
void soc_timer_reset(soc_t *soc);
void soc_timer_event(soc_t *soc, unsigned n);

/* sfr_uart.c */
void soc_uart_hooks(soc_t *soc);
void soc_uart_reset(soc_t *soc);
void soc_uart_sent(soc_t *soc);
void soc_uart_received(soc_t *soc);

#endif
