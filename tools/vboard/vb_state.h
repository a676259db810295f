/* The virtual board's state, for vb_*.c only. */
#ifndef FOC33_VBOARD_VB_STATE_H
#define FOC33_VBOARD_VB_STATE_H

#include "vb_cpu.h"

#define VB_ISR_US 13.0 /* usual time from the ADC interrupt to the moment when the handler's writes act */

enum { VB_UART_TX = 4096, VB_UART_RX = 256, VB_WARNINGS = 48, VB_TEXT = 200 };

/* Buttons, potentiometer, and who pulls the fault pin (vb_circuit.c). */
typedef struct {
    double s2, s3, pot, pot_zero, flta, direction;
    bool comparator; /* the over-current comparator */
    double trips;
} vb_controls_t;

/* The pulses at the command input (vb_pulse.c). Times since power-on. */
typedef struct {
    double hz, us, duty, jitter_us, odd, odd_us, stuck, inverted;
    double fall_s, rise_s; /* the end of the pulse that has begun, and the begin of the next one */
    bool runs, level;
    uint64_t rng;
} vb_pulse_t;

/* What may be connected wrongly on the way to a pin (vb_circuit.c); motor wires and drivers are the plant's. */
typedef struct {
    double currents;  /* 1: the current channels have changed places */
    double flta;      /* 1: the comparator does not reach the pin, 2: with the wrong polarity */
    double buttons;   /* 1: S2 and S3 have changed places, 2: S2 is dead, 3: S3 is dead */
    double leds;      /* 1: the LEDs have changed places, 2: the first one stays dark, 3: the second one */
    double uart_rp;   /* the RP pin that the serial line comes from; 0: whichever sends */
} vb_wiring_t;

/* What a measured signal does instead of following its quantity (vb_circuit.c). */
typedef enum { VB_SENSE_WORKS, VB_SENSE_HOLDS, VB_SENSE_GROUND, VB_SENSE_SUPPLY, VB_SENSE_MIDDLE, VB_SENSES } vb_sense_state_t;

typedef struct {
    double stuck;           /* vb_sense_state_t */
    double gain, error, noise; /* of the quantity, as the ADC would show it */
    double last_v;          /* at the pin, at the last conversion */
} vb_sense_t;

/* An NTC thermistor to ground with a resistor to the reference; lag_s: how it follows what it measures (vb_circuit.c). */
typedef struct {
    double ohm, beta_k, divider_ohm, lag_s, temp_c;
    vb_sense_t sense;
} vb_ntc_t;

/* Amplifiers and dividers before the ADC (vb_circuit.c). */
typedef struct {
    double vbus_ratio, offset_v, gain_v_per_a, shunt_offset_v[2], settle_s;
    double ia_invalid, ib_invalid;
    vb_sense_t current[2], bus, pot;
    vb_ntc_t motor_ntc, bridge_ntc;
} vb_analogue_t;

/* The serial line (vb_serial.c). */
typedef struct {
    char tx[VB_UART_TX], rx[VB_UART_RX];
    size_t tx_count, rx_head, rx_count;
    int master, slave; /* a pseudo-terminal, -1: none */
} vb_serial_t;

/* How a key reaches its value; see vb_keys.c. */
typedef struct {
    int kind;
    size_t offset;
    double (*get)(const vb_t *vb);
    double (*probe)(void);
    volatile uint16_t *reg;
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
    double time_s, i_a, i_b, i_c, i_d, i_q, i_d_mean, i_q_mean, theta_e_deg, speed_rpm, torque_nm, torque_mean_nm, turns;
    double v_d, v_q; /* rotor-frame means of the period before */
} vb_latch_t;

typedef struct {
    double bus_max_v, bus_min_v, i_peak_a, speed_max_rpm, speed_min_rpm;
    double periods, speed_sum, i2_sum, torque_sum, v2_sum;
    double energy_bus_j, energy_brake_j, energy_supply_j, energy_copper_j, energy_shaft_j;
} vb_stat_t;

struct vb {
    chip_t chip;
    plant_t plant;
    vb_controls_t controls;
    vb_pulse_t pulse;
    vb_wiring_t wiring;
    vb_analogue_t analogue;
    vb_serial_t serial;
    const probe_signal_t *signals;
    vb_counts_t count;
    vb_trace_t trace;
    vb_latch_t latch;
    vb_stat_t stat;
    double background_periods;
    bool powered;
    bool awaits_handler; /* the last sample's handler is still to come */
    char error[VB_TEXT];
    char warning[VB_WARNINGS][VB_TEXT];
    const char *warning_format[VB_WARNINGS];
    unsigned warnings;
};

/* vb_message.c */
void vb_warn_list(vb_t *vb, const char *format, va_list args);

/* vb_record.c */
void vb_latch(vb_t *vb);
void vb_stat_reset(vb_t *vb);
void vb_stat_collect(vb_t *vb, double h_s);

/* vb_keys.c */
void vb_keys_defaults(vb_t *vb);
int vb_keys_find(vb_t *vb, const char *name, vb_access_t *access);
double vb_keys_read(const vb_t *vb, const vb_access_t *access);

/* vb_circuit.c */
extern const chip_board_t vb_circuit;
void vb_circuit_warm(vb_t *vb, double period_s);
void vb_circuit_comparator(vb_t *vb, bool period_start);
double vb_circuit_led(const vb_t *vb, unsigned led);
enum { VB_FAULT_RELAY, VB_RUNNING_RELAY, VB_BRAKE }; /* switches behind the outputs of a product, which a pin closes while it drives high */
bool vb_circuit_switch(const vb_t *vb, unsigned number);

/* vb_pulse.c */
double vb_pulse_signals(void *vb, double now_s);
bool vb_pulse_pin(const vb_t *vb);

/* vb_serial.c */
void vb_serial_send(void *vb, uint8_t character);
int vb_serial_receive(void *vb);
void vb_serial_close(vb_t *vb);

/* vb_trace.c */
void vb_trace_row(vb_t *vb);
void vb_trace_free(vb_t *vb);

#endif
