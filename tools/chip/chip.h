/* The chip: the peripherals of the dsPIC33FJ32MC204 by register, once for whatever processor executes the firmware.
 *
 * The processor (chip_cpu_t) holds the registers; the chip reads and writes them in place and is told of accesses that mean more than
 * storing (chip_read, chip_write). What is soldered to the pins is chip_board_t; the bridge that the PWM drives is the plant. Time is counted in
 * instruction cycles for what the chip does by itself (events), and in seconds within a PWM period for PWM and ADC.
 */
#ifndef FOC33_CHIP_CHIP_H
#define FOC33_CHIP_CHIP_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "chip_irq.h"
#include "chip_registers.h"
#include "plant.h"

/* Addresses of the registers: SFR_OSCCON and so on. */
#define CHIP_ADDRESS(name, address, reset) SFR_##name = (address),
enum { SFR_TABLE(CHIP_ADDRESS) SFR_END = 0x0800 };
#undef CHIP_ADDRESS

#define CHIP_NEVER UINT64_MAX
#define CHIP_IDLE_PERIOD_S 50e-6 /* length of a "PWM period" while the PWM does not run */

enum { CHIP_CONFIG_WORDS = 12, CHIP_TIMERS = 3, CHIP_CAPTURES = 4, CHIP_FIFO = 4, CHIP_WORDS = SFR_END / 2 };

/* Index of a configuration word. */
enum { CHIP_FBS = 0, CHIP_FGS = 2, CHIP_FOSCSEL = 3, CHIP_FOSC = 4, CHIP_FWDT = 5, CHIP_FPOR = 6, CHIP_FICD = 7, CHIP_FUID0 = 8 };

/* The processor on the chip. `context` is handed back to every function. Times in seconds are within the PWM period.
 *   own_isr_us     what its control interrupt takes by itself, without the board's cpu.isr_us
 *   start_periods  PWM periods that its start-up code may take
 *   reg            place of a register; NULL if it has none of that name. It stays where it is as long as the board lives
 *   reset          power-on: registers to their start values, then everything that comes before main()'s loop; 0, or -1 if that failed
 *   cycles         instruction cycles so far
 *   raised         the flag of an interrupt has been set; true if a handler for it is still to come, false if it has run or never will
 *   attend         something is due before the cycle chip_t.limit, to which the processor runs; NULL: it never runs ahead
 *   clock          the instruction clock has changed; NULL: of no concern
 *   wake           the watchdog's time is over: true if that has woken it from sleep
 *   begin, end     a PWM period starts (NULL: of no concern), is over
 *   run            go on to `until_s`, or to an instant before at which the board must follow; returns it. NULL: handlers take no time
 *   flash          erase the page, or program the row or word, of the last table write, and stand for so many cycles; NULL: nothing is programmed
 *   follow         the plant has reached the time that run() returned
 *   destroy        the board is going away */
typedef struct {
    void *context;
    double own_isr_us;
    unsigned start_periods;
    volatile uint16_t *(*reg)(void *context, const char *name);
    int (*reset)(void *context);
    uint64_t (*cycles)(void *context);
    bool (*raised)(void *context, unsigned irq);
    void (*attend)(void *context);
    void (*clock)(void *context);
    void (*flash)(void *context, bool erases, unsigned words, uint64_t cycles);
    bool (*wake)(void *context);
    void (*begin)(void *context);
    double (*run)(void *context, double until_s);
    void (*follow)(void *context);
    void (*end)(void *context, double length_s);
    void (*destroy)(void *context);
} chip_cpu_t;

/* What is soldered to the chip. Functions may be NULL.
 *   levels     levels that the circuits around give to the pins of ports A, B, C that are inputs; default all high
 *   input_v    voltage at the analogue input AN<input>
 *   sampled    the sample-and-holds have just been opened
 *   served     nothing more will happen with this sample: its handler has run, or none will
 *   signals    brings levels that change by themselves to what they are at a time since power-on; returns when one changes next, PLANT_NEVER without
 *   send       a character has left UART1
 *   receive    the next character for UART1, or -1
 *   warn       the firmware uses a peripheral in a way that cannot work; the text starts with the register's name
 *   fault_rp   the RPn pin with the fault signal; capture_rp: with the signal that IC1 and IC2 capture; channel: the input that sample-and-hold 0..3
 *              should take, its name, and a mask of others that it may take in turn */
typedef struct {
    void *context;
    void (*levels)(void *context, uint16_t level[3]);
    double (*input_v)(void *context, unsigned input);
    void (*sampled)(void *context);
    void (*served)(void *context);
    double (*signals)(void *context, double now_s);
    void (*send)(void *context, uint8_t character);
    int (*receive)(void *context);
    void (*warn)(void *context, const char *format, va_list args);
    unsigned fault_rp, capture_rp;
    struct { unsigned input; const char *name; uint16_t others; } channel[4];
} chip_board_t;

typedef struct chip chip_t;

/* An access that means more than storing; the value of a write counts where `mask` has bits. */
typedef struct {
    uint16_t (*read)(void *chip, uint16_t address);
    void (*write)(void *chip, uint16_t address, uint16_t value, uint16_t mask);
} chip_hook_t;

/* Things that happen by themselves at a cycle. */
typedef enum {
    CHIP_EVENT_CLOCK, CHIP_EVENT_WATCHDOG, CHIP_EVENT_TIMER1, CHIP_EVENT_TIMER2, CHIP_EVENT_TIMER3, CHIP_EVENT_SEND,
    CHIP_EVENT_RECEIVE, CHIP_EVENT_SIGNALS, CHIP_EVENTS
} chip_event_t;

/* ---- oscillator (chip_clock.c) ---- */

/* Clocks and times; the crystal is the board's, the others the data sheet gives as ranges: chip_assumptions.h. */
typedef struct {
    double crystal_hz, frc_hz, lprc_hz, pll_lock_s, crystal_start; /* crystal_start: periods that the start-up timer counts */
    double fcy_hz, base_s; /* instruction clock; base_s is the time since power-on at base_cycle */
    uint64_t base_cycle;
    unsigned low_step, high_step;   /* how far the unlock sequence of OSCCON's halves has come */
    uint64_t low_cycle, high_cycle; /* of its last write */
    bool locked_once;               /* IOLOCK has been set since the reset (IOL1WAY) */
    double expected_fcy_hz;         /* no cause for a warning, 0 = any */
} chip_clock_t;

/* Self-programming (chip_nvm.c). */
typedef struct {
    unsigned step;       /* how far the unlock sequence has come */
    uint64_t cycle;      /* of its last write */
    double standing_s;   /* left of the time that the processor stands: nobody can serve an interrupt */
    double operations;   /* carried out so far */
} chip_nvm_t;

typedef struct {
    uint64_t base_cycle; /* the count was base_count then */
    uint32_t base_count;
    bool counts;
} chip_timer_t;

/* An input capture, IC1, IC2, IC7 or IC8 (chip_capture.c). */
typedef struct {
    uint16_t fifo[CHIP_FIFO];
    unsigned count;    /* in the FIFO */
    unsigned edges;    /* since the last capture, where only every fourth or sixteenth is one */
    unsigned captures; /* since the last interrupt */
    bool level;        /* of its pin */
} chip_capture_t;

typedef struct {
    uint8_t tx[CHIP_FIFO], rx[CHIP_FIFO];
    unsigned tx_count, rx_count;
    uint8_t shift, incoming;
    bool sending, receiving;
    double baud, lost;
} chip_uart_t;

/* ---- PWM module (chip_pwm.c) ---- */

enum { CHIP_EDGES = 12 };

/* Progress of one leg through its dead-time generator. Times are relative to the start of the period. */
typedef struct {
    uint8_t from;   /* gate state before the last change of the request */
    uint8_t to;     /* requested state */
    uint8_t stage;  /* 0: both edges of the change are to come, 1: one, 2: none */
    uint8_t gate;   /* gate state after the edges emitted so far */
    double change_s;
} chip_leg_state_t;

typedef struct {
    chip_leg_state_t state, saved; /* after and before the planned stretch */
    double edge_s[CHIP_EDGES];
    uint8_t edge_gate[CHIP_EDGES];
    unsigned count, next;
    /* decoded settings */
    double a_s, b_s;          /* PWM reference is high before a_s and from b_s on */
    uint8_t pen, povd, pout;  /* bit 0 low, bit 1 high transistor */
    uint8_t port;             /* level from the port latch where PEN is 0 */
    bool idle;                /* the time base stands still: the module drives neither transistor */
    bool independent;
    bool faulted;
    uint8_t fault_out;
    double dead_high_s, dead_low_s; /* delay of the high and of the low transistor's turn-on */
} chip_leg_t;

typedef struct {
    bool running, centre, double_update;
    uint16_t seen[16];       /* registers as last decoded */
    double tick_s, period_s;
    uint32_t ticks;          /* counts of the time base per period */
    uint16_t duty[3], tper;  /* double-buffered values in force */
    uint16_t ovdcon;
    double trigger_s;        /* special event in this period, PLANT_NEVER if none */
    uint32_t postscale, event_postscale;
    uint32_t udis_periods, idle_periods;
    double length_s;         /* of this period, shorter than planned when the time base starts or the device is reset within it */
    chip_leg_t leg[3];
    double planned_from_s;
    uint8_t seen_mask;       /* outputs that were on at any time in this period, bits as in P1OVDCON */
    uint8_t last_mask;
} chip_pwm_t;

/* The fault input. */
typedef struct {
    bool pin, latched; /* active now; outputs held by a latched fault */
    bool active;       /* outputs are in their fault state */
} chip_fault_t;

/* ---- ADC (chip_adc.c) ---- */

typedef struct {
    double gain_error, noise_lsb;
    uint64_t rng;
    double seed;
    double hold_us;              /* from the end of a conversion to its interrupt, with what the handler takes */
    double dropped;              /* 1: the interrupt does not come */
    double lost_share, late_share, late_us; /* of the interrupts, evenly spread: never come, come so much later */
    double lost_debt, late_debt; /* what of the next one is due to the shares so far */
    double lost;                 /* interrupts that were due and never came */
    bool withheld;               /* one has not come */
    /* decoded */
    uint16_t seen[7];
    bool on, twelve_bit;
    unsigned channels, form, sequence_length;
    double tad_s, conversion_s;
    uint32_t judge_in;           /* periods until the selected inputs are judged; 0: done */
    uint32_t deaf_periods;       /* of a running PWM without the ADC */
    /* progress, times relative to the period */
    double conversion_end_s, due_s;
    bool queued;
    unsigned turn;               /* SIMSAM = 0: next channel to convert */
    unsigned sequence, fill;
    uint16_t result[4], queued_result[4];
    unsigned result_count, queued_count;
    double overruns, samples;
    double volts[2];             /* at AN0 and AN1, as the last results tell */
} chip_adc_t;

struct chip {
    chip_cpu_t cpu;
    chip_board_t board;
    plant_t *plant;
    volatile uint16_t *place[CHIP_WORDS]; /* of the registers, index = address / 2; those that do not exist share one place */
    volatile uint16_t nowhere;
    chip_hook_t hook[CHIP_WORDS];
    uint32_t config[CHIP_CONFIG_WORDS];
    uint64_t event[CHIP_EVENTS], limit;
    void (*on_event[CHIP_EVENTS])(chip_t *chip);
    bool pending_reset;
    chip_reset_t pending_cause;
    unsigned resets;             /* other than the first */
    double watchdog_end_s;
    chip_clock_t clock;
    chip_nvm_t nvm;
    chip_timer_t timer[CHIP_TIMERS];
    chip_capture_t capture[CHIP_CAPTURES];
    uint64_t signals_cycle;      /* when a level changes next */
    chip_uart_t uart;
    chip_pwm_t pwm;
    chip_fault_t fault;
    chip_adc_t adc;
    double expected_pwm_hz;
    uint16_t analogue_seen;
};

/* ---- the chip as a whole (chip_device.c, chip.c) ---- */

/* Connect a chip with its processor and, unless NULL, its board and plant. False if the processor lacks a register. */
bool chip_connect(chip_t *chip, const chip_cpu_t *cpu, const chip_board_t *board, plant_t *plant);

/* Registers and peripherals as after a reset by `cause`; after CHIP_RESET_POR everything has its power-on value. */
void chip_reset(chip_t *chip, chip_reset_t cause);

/* Somebody asks for a reset; the processor carries it out between two instructions. */
void chip_request_reset(chip_t *chip, chip_reset_t cause);

/* An access by the processor, or by somebody in its place. */
uint16_t chip_read(chip_t *chip, uint16_t address);
void chip_write(chip_t *chip, uint16_t address, uint16_t value, uint16_t mask);

/* Address of a register by its name in Microchip's header, or -1; the name at an even address, NULL if there is none. */
int chip_register(const char *name);
const char *chip_register_name(uint16_t address);

/* The cycle of the next event, and all events that are due now. */
uint64_t chip_next_event(const chip_t *chip);
void chip_happen(chip_t *chip);

/* Between a time since power-on and cycles of the present clock. */
double chip_time_at(const chip_t *chip, uint64_t cycle);
uint64_t chip_cycle_at(const chip_t *chip, double time_s);

/* The end of a PWM period, and start of bookkeeping for the next. */
void chip_end(chip_t *chip);

/* ---- what its files offer each other ---- */

#define CHIP_REG(chip, name) (*(chip)->place[SFR_##name / 2])

static inline uint16_t chip_get(const chip_t *chip, unsigned address)
{
    return *chip->place[address / 2u];
}

static inline void chip_put(chip_t *chip, unsigned address, unsigned value)
{
    *chip->place[address / 2u] = (uint16_t)value;
}

/* The register after a write of the bits in `mask`. */
static inline uint16_t chip_merged(const chip_t *chip, unsigned address, uint16_t value, uint16_t mask)
{
    return (uint16_t)((chip_get(chip, address) & (uint16_t)~mask) | (value & mask));
}

static inline uint64_t chip_now(const chip_t *chip)
{
    return chip->cpu.cycles(chip->cpu.context);
}

static inline double chip_seconds(const chip_t *chip)
{
    return chip_time_at(chip, chip_now(chip));
}

/* chip.c */
void chip_warn(chip_t *chip, const char *format, ...) __attribute__((format(printf, 2, 3)));
void chip_schedule(chip_t *chip, chip_event_t event, uint64_t cycle);
void chip_hook(chip_t *chip, uint16_t address, uint16_t (*read)(void *, uint16_t), void (*write)(void *, uint16_t, uint16_t, uint16_t));

bool chip_irq_raise(chip_t *chip, unsigned irq); /* set its flag; true if a handler is still to come */
void chip_put_reset_values(chip_t *chip, bool (*kept)(uint16_t address));
bool chip_find_registers(chip_t *chip);

/* chip_clock.c */
void chip_clock_hooks(chip_t *chip);
void chip_clock_reset(chip_t *chip, chip_reset_t cause);
void chip_clock_event(chip_t *chip);
void chip_clock_follow(chip_t *chip);
void chip_clock_check(chip_t *chip);
bool chip_clock_pins_locked(const chip_t *chip);

/* chip_nvm.c */
void chip_nvm_hooks(chip_t *chip);

/* chip_watchdog.c */
void chip_watchdog_hooks(chip_t *chip);
void chip_watchdog_reset(chip_t *chip);
void chip_watchdog_event(chip_t *chip);
void chip_watchdog_clear(void *chip);
void chip_watchdog_reschedule(chip_t *chip);

/* chip_ports.c */
void chip_ports_hooks(chip_t *chip);
void chip_ports_show(chip_t *chip);
unsigned chip_ports_pin(const chip_t *chip, unsigned port, unsigned bit);
bool chip_ports_rp(const chip_t *chip, unsigned rp);
bool chip_ports_fault(chip_t *chip);
bool chip_ports_fault_used(chip_t *chip);
enum { CHIP_FUNCTION_U1TX = 3 }; /* in RPORx */
bool chip_ports_pin_has_function(const chip_t *chip, unsigned rp, unsigned function);
bool chip_ports_have_function(const chip_t *chip, unsigned function);

/* chip_timer.c */
void chip_timer_hooks(chip_t *chip);
void chip_timer_reset(chip_t *chip);
void chip_timer_1(chip_t *chip); /* its count has reached the period register */
void chip_timer_2(chip_t *chip);
void chip_timer_3(chip_t *chip);
uint16_t chip_timer_count(const chip_t *chip, unsigned n, uint64_t cycle); /* of timer n + 1 at a cycle since its last match */

/* chip_capture.c */
void chip_capture_hooks(chip_t *chip);
void chip_capture_reset(chip_t *chip);
void chip_capture_signals(chip_t *chip);                          /* a level changes */
void chip_capture_follow(chip_t *chip);                           /* levels may have changed, or when they do */
unsigned chip_capture_show(chip_t *chip);                         /* what ICxBUF reads, for who reads without a hook; a bit for each that has something */
void chip_capture_drop(chip_t *chip, unsigned channel);           /* its oldest capture has been read */
bool chip_capture_is_control(uint16_t address);                   /* ICxCON */

/* chip_uart.c */
void chip_uart_hooks(chip_t *chip);
void chip_uart_reset(chip_t *chip);
void chip_uart_sent(chip_t *chip);
void chip_uart_received(chip_t *chip);
void chip_uart_wake(chip_t *chip); /* there may be characters to receive */

/* chip_pwm.c */
void chip_pwm_reset(chip_t *chip);
void chip_pwm_begin(chip_t *chip);
void chip_pwm_end(chip_t *chip);
void chip_pwm_half(chip_t *chip);
void chip_pwm_written(chip_t *chip);
void chip_pwm_cut(chip_t *chip);
bool chip_pwm_enabled(const chip_t *chip);
uint16_t chip_pwm_counter(const chip_t *chip, double now_s);
void chip_pwm_show_counter(chip_t *chip);
void chip_pwm_fault(chip_t *chip, bool period_start);

/* chip_adc.c */
void chip_adc_reset(chip_t *chip);
void chip_adc_begin(chip_t *chip);
void chip_adc_seed(chip_adc_t *adc);
double chip_adc_noise(chip_adc_t *adc);
void chip_adc_trigger(chip_t *chip);
void chip_adc_done(chip_t *chip);
double chip_adc_next_trigger(const chip_t *chip, double after_s);
void chip_adc_end(chip_t *chip);

#endif
