/* The virtual board's state and the interfaces between its modules; nothing outside tools/board and tools/pil includes this. */
#ifndef FOC33_BOARD_VB_INTERNAL_H
#define FOC33_BOARD_VB_INTERNAL_H

#include "probe.h"
#include "vboard.h"

#include <stdarg.h>
#include <stdbool.h>

#define VB_PI 3.14159265358979323846
#define VB_RPM_PER_RAD_S (30.0 / VB_PI)
#define VB_NEVER 1e30
#define VB_ISR_US 13.0         /* usual time from the ADC interrupt to the moment when the handler's writes act */
#define VB_IDLE_PERIOD_S 50e-6 /* length of a "PWM period" while the PWM does not run */

/* Registers that the board reads or writes, as fields of vb_regs_t under their lower-case names. */
#define VB_REG_LIST(X) \
    X(p1tcon, "P1TCON") X(p1tmr, "P1TMR") X(p1tper, "P1TPER") X(p1secmp, "P1SECMP") X(pwm1con1, "PWM1CON1") \
    X(pwm1con2, "PWM1CON2") X(p1dtcon1, "P1DTCON1") X(p1dtcon2, "P1DTCON2") X(p1fltacon, "P1FLTACON") \
    X(p1ovdcon, "P1OVDCON") X(p1dc1, "P1DC1") X(p1dc2, "P1DC2") X(p1dc3, "P1DC3") \
    X(ad1con1, "AD1CON1") X(ad1con2, "AD1CON2") X(ad1con3, "AD1CON3") X(ad1chs0, "AD1CHS0") X(ad1chs123, "AD1CHS123") \
    X(ad1pcfgl, "AD1PCFGL") \
    X(adc1buf0, "ADC1BUF0") X(adc1buf1, "ADC1BUF1") X(adc1buf2, "ADC1BUF2") X(adc1buf3, "ADC1BUF3") \
    X(adc1buf4, "ADC1BUF4") X(adc1buf5, "ADC1BUF5") X(adc1buf6, "ADC1BUF6") X(adc1buf7, "ADC1BUF7") \
    X(adc1buf8, "ADC1BUF8") X(adc1buf9, "ADC1BUF9") X(adc1bufa, "ADC1BUFA") X(adc1bufb, "ADC1BUFB") \
    X(adc1bufc, "ADC1BUFC") X(adc1bufd, "ADC1BUFD") X(adc1bufe, "ADC1BUFE") X(adc1buff, "ADC1BUFF") \
    X(osccon, "OSCCON") X(clkdiv, "CLKDIV") X(pllfbd, "PLLFBD") X(pmd1, "PMD1") X(sr, "SR") \
    X(ifs0, "IFS0") X(ifs3, "IFS3") X(iec0, "IEC0") X(iec3, "IEC3") X(ipc0, "IPC0") X(ipc1, "IPC1") X(ipc2, "IPC2") \
    X(ipc3, "IPC3") X(ipc14, "IPC14") X(ipc15, "IPC15") \
    X(porta, "PORTA") X(portb, "PORTB") X(portc, "PORTC") X(lata, "LATA") X(latb, "LATB") X(latc, "LATC") \
    X(trisa, "TRISA") X(trisb, "TRISB") X(trisc, "TRISC") X(rpinr12, "RPINR12") X(rpinr18, "RPINR18") \
    X(rpor0, "RPOR0") X(rpor1, "RPOR1") X(rpor2, "RPOR2") X(rpor3, "RPOR3") X(rpor4, "RPOR4") X(rpor5, "RPOR5") \
    X(rpor6, "RPOR6") X(rpor7, "RPOR7") X(rpor8, "RPOR8") X(rpor9, "RPOR9") X(rpor10, "RPOR10") X(rpor11, "RPOR11") \
    X(rpor12, "RPOR12") \
    X(t1con, "T1CON") X(tmr1, "TMR1") X(pr1, "PR1") X(t2con, "T2CON") X(tmr2, "TMR2") X(pr2, "PR2") \
    X(t3con, "T3CON") X(tmr3, "TMR3") X(pr3, "PR3") \
    X(u1mode, "U1MODE") X(u1sta, "U1STA") X(u1txreg, "U1TXREG") X(u1rxreg, "U1RXREG") X(u1brg, "U1BRG")

typedef struct {
#define VB_REG_FIELD(field, name) volatile uint16_t *field;
    VB_REG_LIST(VB_REG_FIELD)
#undef VB_REG_FIELD
} vb_regs_t;

/* ---- motor and mechanics (vb_motor.c) ---- */

typedef struct {
    /* parameters as set by keys */
    double rs_ohm, ld_h, lq_h, psi_vs, pole_pairs;
    double sat_ld_ratio, sat_lq_ratio, sat_current_a; /* share of L that is lost at sat_current_a; 0 = linear */
    double temp_c, r_tempco, psi_tempco;
    double inertia_kgm2, viscous_nms, coulomb_nm, stiction_nm;
    double load_constant_nm, load_active_nm, load_viscous_nms, load_quadratic_nms2, load_locked;
    /* effective values of this period */
    double r, psi, ld, lq, inv_ld, inv_lq;
    /* state: dq currents, electrical angle with its cosine and sine, electrical speed (constant within a period) */
    double id, iq, theta, c, s, omega;
    double turns; /* mechanical revolutions since creation */
    /* integrals over the period */
    double torque_nms, vd_vs, vq_vs, copper_j;
    double torque_nm, vd_v, vq_v, copper_w; /* means of the last period */
    bool derived_stale;
} vb_motor_t;

/* ---- inverter (vb_inverter.c) ---- */

typedef enum { VB_GATE_OFF = 0, VB_GATE_LOW = 1, VB_GATE_HIGH = 2, VB_GATE_BOTH = 3 } vb_gate_t;
typedef enum { VB_COND_FLOAT, VB_COND_LOW, VB_COND_HIGH, VB_COND_DIODE_LOW, VB_COND_DIODE_HIGH, VB_COND_SHOOT } vb_cond_t;

/* A leg: terminal voltage = share * bus + fixed - ohm * i; it takes from_bus * i + shoot * bus from the bus. */
typedef struct {
    double share, fixed_v, ohm, from_bus, shoot_s;
} vb_leg_equation_t;

typedef struct {
    double rds_on_ohm, diode_v, diode_ohm, turn_on_s, turn_off_s, trip_a, open_phase;
    double shunt_ohm;
    vb_gate_t gate[3];
    vb_cond_t cond[3];
    bool low_path[3];        /* the low transistor or its diode carries the leg */
    double low_since_s[3];   /* when low_path last changed, absolute time */
    double i[3];             /* phase currents, into the motor */
    double v[3];             /* terminal voltages of the last segment, against bus minus */
    vb_leg_equation_t equation[3]; /* what cond[] means for voltages and the bus */
    double bus_as;           /* integral over this period of the current from the bus into the bridge */
    double max_step_s;       /* upper bound of an integration step */
    unsigned off_mask, float_mask; /* legs (bit k) with both transistors off, and those of them that carry nothing */
    unsigned open_mask;      /* the open phase, as a mask, that the conduction states stand for */
} vb_inverter_t;

/* ---- supply and bus capacitor (vb_supply.c) ---- */

typedef struct {
    double voltage_v, resistance_ohm, sinks, capacitance_f, load_a;
    double bus_v;
    double bus_a, supply_a; /* means of the last period: bridge, supply */
} vb_supply_t;

/* ---- PWM module (vb_pwm.c) ---- */

enum { VB_EDGES = 12 };

/* Progress of one leg through its dead-time generator. Times are relative to the start of the period. */
typedef struct {
    uint8_t from;   /* gate state before the last change of the request */
    uint8_t to;     /* requested state */
    uint8_t stage;  /* 0: both edges of the change are to come, 1: one, 2: none */
    uint8_t gate;   /* gate state after the edges emitted so far */
    double change_s;
} vb_leg_state_t;

typedef struct {
    vb_leg_state_t state, saved; /* after and before the planned stretch */
    double edge_s[VB_EDGES];
    uint8_t edge_gate[VB_EDGES];
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
} vb_leg_t;

typedef struct {
    bool running, centre, double_update;
    uint16_t seen[16];       /* registers as last decoded */
    double fcy_hz, tick_s, period_s;
    uint32_t ticks;          /* counts of the time base per period */
    uint16_t duty[3], tper;  /* double-buffered values in force */
    uint16_t ovdcon;
    double trigger_s;        /* special event in this period, VB_NEVER if none */
    uint32_t postscale, event_postscale;
    uint32_t udis_periods, idle_periods, deaf_periods;
    double length_s;         /* of this period, shorter than planned when the time base starts or the device is reset within it */
    vb_leg_t leg[3];
    double planned_from_s;
    uint8_t seen_mask;       /* outputs that were on at any time in this period, bits as in P1OVDCON */
    uint8_t last_mask;
} vb_pwm_t;

/* ---- ADC (vb_adc.c) ---- */

typedef struct {
    double gain_error, noise_lsb, vbus_ratio, offset_v;
    double gain_v_per_a, shunt_offset_v[3], settle_s;
    uint64_t rng;
    double seed;
    /* decoded */
    uint16_t seen[7];
    bool on, twelve_bit;
    unsigned channels, form, sequence_length;
    double tad_s, conversion_s;
    /* progress, times relative to the period */
    double conversion_end_s, handler_s;
    bool queued;
    unsigned turn;               /* SIMSAM = 0: next channel to convert */
    unsigned sequence, fill;
    uint16_t result[4], queued_result[4];
    unsigned result_count, queued_count;
    double ia_invalid, ib_invalid, overruns, samples;
    double reading_a[2];         /* currents that the results stand for */
} vb_adc_t;

/* ---- pins, timers, serial port (vb_io.c) ---- */

enum { VB_UART_TX = 4096, VB_UART_RX = 256 };

typedef struct {
    double s2, s3, pot, flta;
    uint16_t written[3];     /* PORTA, PORTB, PORTC as the board left them */
    uint16_t analogue[3];    /* pins that read 0 because they are analogue inputs */
    double timer_rest[3];    /* fractions of a timer count */
} vb_pins_t;

typedef struct {
    char tx[VB_UART_TX], rx[VB_UART_RX];
    size_t tx_count, rx_head, rx_count;
    uint8_t fifo[4];
    unsigned fifo_count;
    double tx_busy_s, rx_busy_s; /* time left for the character on the line */
    bool sending, presented, enabled;
    double baud;
    double lost;
} vb_uart_t;

typedef struct {
    bool comparator, pin, latched; /* over-current comparator, resulting pin active, outputs held by a latched fault */
    bool active;                   /* outputs are in their fault state */
    double trips;
} vb_fault_t;

/* ---- a CPU that has a time of its own (tools/pil) ---- */

/* It executes instructions between the board's events instead of running whole handlers at them, and has timers, serial port, watchdog and
 * oscillator of its own. Times are within the period.
 *   run       go on to `until_s`, or to the end of an instruction that the board must follow at once; returns that time
 *   raised    a peripheral of the board has set the interrupt flag of `vector`
 *   follow    the plant has reached the time that run() returned
 *   end       the period of `length_s` is over: times start at 0 again
 *   destroy   the board is going away */
typedef struct {
    double (*run)(void *context, double until_s);
    void (*raised)(void *context, vb_vector_t vector);
    void (*follow)(void *context);
    void (*end)(void *context, double length_s);
    void (*destroy)(void *context);
} vb_live_t;

/* What such a CPU has counted; zeroes for the host's. Latency: from the trigger to the write of the third duty. */
typedef struct {
    double isr_count, isr_min, isr_max, isr_sum, isr_last;
    double latency_min, latency_max, latency_sum, latency_count, latency_last;
    double stack_bytes, instructions, cycles, resets, errors;
    double ticks, differences;
} vb_counts_t;

/* ---- trace (vb_trace.c) ---- */

/* How a key reaches its value; see vb_keys.c. */
typedef struct {
    int kind;
    size_t offset;
    double (*get)(const vb_t *vb);
    double (*probe)(void);
    const volatile uint16_t *reg;
    unsigned pin;
} vb_access_t;

typedef struct {
    vb_access_t *column;
    size_t columns, rows, capacity;
    float *data;
    unsigned decimation, countdown;
    bool due; /* a sample was latched and its row is not written yet */
    double lost_rows;
} vb_trace_t;

/* Plant quantities at the sampling instant. */
typedef struct {
    double time_s, i_a, i_b, i_c, i_d, i_q, theta_e_deg, speed_rpm, torque_nm, turns;
    double v_d, v_q; /* rotor-frame means of the period before */
} vb_latch_t;

typedef struct {
    double bus_max_v, bus_min_v, i_peak_a, speed_max_rpm, speed_min_rpm;
    double periods, speed_sum, i2_sum, torque_sum, v2_sum;
    double energy_bus_j, energy_supply_j, energy_copper_j, energy_shaft_j;
} vb_stat_t;

enum { VB_WARNINGS = 48, VB_TEXT = 200 };

struct vb {
    vb_cpu_t cpu;
    const vb_live_t *live;         /* NULL: the CPU has handlers only */
    const probe_signal_t *signals; /* the firmware's, in the order of probe_signals; NULL: unknown */
    vb_counts_t count;
    vb_regs_t reg;
    vb_motor_t motor;
    vb_inverter_t inverter;
    vb_supply_t supply;
    vb_pwm_t pwm;
    vb_adc_t adc;
    vb_pins_t pins;
    vb_uart_t uart;
    vb_fault_t fault;
    vb_trace_t trace;
    vb_latch_t latch;
    vb_stat_t stat;
    double crystal_hz, isr_us, isr_dropped, background_periods, expected_fcy_hz, expected_pwm_hz;
    double background_countdown;
    double start_s;  /* absolute time of the period's start */
    double now_s;    /* time within the period */
    bool powered;
    bool stuck_in_isr;
    char error[VB_TEXT];
    char warning[VB_WARNINGS][VB_TEXT];
    const char *warning_format[VB_WARNINGS];
    unsigned warnings;
};

static inline double vb_min(double a, double b)
{
    return a < b ? a : b;
}

static inline double vb_max(double a, double b)
{
    return a > b ? a : b;
}

/* `x` brought into 0..range; it is at most a few ranges away. */
static inline double vb_wrap(double x, double range)
{
    while (x >= range) {
        x -= range;
    }
    while (x < 0.0) {
        x += range;
    }
    return x;
}

/* vboard.c */
int vb_fail(vb_t *vb, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Note a configuration problem once: the format string identifies the problem together with the register's name in the text. */
void vb_warn(vb_t *vb, const char *format, ...) __attribute__((format(printf, 2, 3)));
void vb_latch(vb_t *vb);
void vb_stat_reset(vb_t *vb);
/* End this period now. */
void vb_cut_period(vb_t *vb);

/* vb_keys.c */
void vb_keys_defaults(vb_t *vb);
int vb_keys_find(vb_t *vb, const char *name, vb_access_t *access);
double vb_keys_read(const vb_t *vb, const vb_access_t *access);

/* vb_cpu.c */
extern const vb_cpu_t vb_host_cpu;
bool vb_raise(vb_t *vb, vb_vector_t vector);
void vb_background(vb_t *vb);
void vb_serve_pending(vb_t *vb);
void vb_handler(vb_t *vb, vb_vector_t vector);

/* vb_clock.c */
double vb_clock_fcy_hz(vb_t *vb);

/* vb_motor.c */
void vb_motor_prepare(vb_motor_t *m);
void vb_motor_turn(vb_motor_t *m, double h_s);
double vb_motor_float_voltage(const vb_motor_t *m, const double v[3], unsigned leg);
void vb_motor_set_alpha_beta(vb_motor_t *m, double i_alpha, double i_beta);
void vb_motor_emf(const vb_motor_t *m, double e[3]);
double vb_motor_torque(const vb_motor_t *m);
void vb_motor_mechanics(vb_motor_t *m, double h_s);

/* vb_inverter.c */
void vb_inverter_reset(vb_t *vb);
void vb_inverter_gate(vb_t *vb, unsigned leg, vb_gate_t gate);
bool vb_inverter_run(vb_t *vb, double until_s, double trip_a);
double vb_inverter_bus_a(const vb_t *vb);
void vb_inverter_prepare(vb_t *vb);

/* vb_supply.c */
void vb_supply_step(vb_supply_t *s, double bridge_as, double h_s);

/* vb_pwm.c */
void vb_pwm_reset(vb_t *vb);
void vb_pwm_begin(vb_t *vb);
void vb_pwm_end(vb_t *vb);
void vb_pwm_replan(vb_t *vb);
void vb_pwm_half(vb_t *vb);
void vb_pwm_registers_changed(vb_t *vb);
void vb_pwm_show_counter(vb_t *vb);
uint16_t vb_pwm_counter(const vb_t *vb, double now_s);
uint8_t vb_pwm_mask(const vb_t *vb);
void vb_fault_check(vb_t *vb, bool period_start);

/* vb_adc.c */
void vb_adc_reset(vb_t *vb);
void vb_adc_decode(vb_t *vb);
void vb_adc_seed(vb_adc_t *adc);
void vb_adc_trigger(vb_t *vb);
void vb_adc_handler(vb_t *vb);
double vb_adc_next_trigger(const vb_t *vb, double after_s);
void vb_adc_end(vb_t *vb);
void vb_adc_check(vb_t *vb);

/* vb_io.c */
void vb_io_reset(vb_t *vb);
void vb_io_decode(vb_t *vb);
void vb_io_ports(vb_t *vb);
void vb_io_external_levels(const vb_t *vb, uint16_t level[3]);
void vb_io_timers(vb_t *vb, double h_s);
void vb_io_uart_step(vb_t *vb, double h_s);
void vb_io_uart_take(vb_t *vb);
unsigned vb_io_pin_level(const vb_t *vb, unsigned port, unsigned bit);
bool vb_io_fault_pin(vb_t *vb);

/* vb_trace.c */
void vb_trace_row(vb_t *vb);
void vb_trace_free(vb_t *vb);

#endif
