/* The application: what decides when the motor runs and how fast. One file of this room is in the build; APP=path names another one.
 *
 *     void app_init(void);                                            once, before anything moves
 *     void app_ms(const app_told_t *told, app_asks_t *asks);          every millisecond, in the background
 *
 * It is told what the drive does and asks the drive; it reaches nothing else, and the build refuses one that does. A call that takes longer than
 * APP_LATE_MS stops the motor in order, and is the fault APPLICATION. docs/application.md leads through it.
 *
 * Quantities are counts, and these make counts of units at no cost: APP_RPM(1500), APP_AMPERE(0.5), APP_VOLT(20). */
#ifndef APP_APP_H
#define APP_APP_H

#include "drive/faults.h"
#include "drive/inputs.h"
#include "drive/scaling/current_voltage.h"
#include "drive/states.h"

#define APP_LATE_MS 20 /* a call that takes longer is late, [ms] */

/** 1: the application has the serial line. The Makefile sets it for one that includes app/line.h. */
#ifndef APP_SERIAL
#define APP_SERIAL 0
#endif
/** 1: the application is told of pulses at the command input. The Makefile sets it for one that includes app/pulse.h. */
#ifndef APP_PULSE
#define APP_PULSE 0
#endif
#define APP_LINE_SIZE 64u /* of a line heard or said, with its end */

/** Counts of a speed, current or voltage that is a constant. A speed is electrical rpm in counts of SPEED_UNIT, a current full scale / 8192. */
#define APP_RPM(rpm) ((int16_t)PARAM_ROUND(PARAM_F(rpm) * PARAM_F(NOPOLESPAIRS) / PARAM_F(SPEED_UNIT)))
#define APP_AMPERE(ampere) ((int16_t)CURRENT_Q13(ampere))
#define APP_VOLT(volt) ((int16_t)PARAM_MIN(PARAM_F(volt) / PARAM_F(BUS_FULL_SCALE_V) * 32768.0F, 32767.0F)) /* at full scale and above: its end */
/** Counts of a share, 0..1: of the potentiometer's travel. */
#define APP_SHARE(share) ((uint16_t)(PARAM_F(share) * 65535.0F))

/** Counts of a temperature, -40..152 degrees Celsius. */
#define APP_CELSIUS(celsius) ((int16_t)(16.0F * PARAM_F(celsius)))

/** The same of a speed that is no constant. @param rpm int16_t; times NOPOLESPAIRS within a word */
#define APP_OF_RPM(rpm) ((int16_t)((int16_t)((rpm) * (int16_t)NOPOLESPAIRS) / (int16_t)SPEED_UNIT))

/** Shaft rpm of a speed in counts, cut off towards 0. */
int16_t app_rpm_of(speed_erpm_t speed_erpm) APP_CALLS;

/** Where a value lies between two others: 0 at `from` and below, 65535 at `to` and above. */
uint16_t app_share(uint16_t value, uint16_t from, uint16_t to) APP_CALLS;

/** 1 for a fault that may pass by itself, so that another try is worth it; 0 where it would feed a short circuit again (drive/faults.h). */
uint16_t app_may_pass(uint16_t fault) APP_CALLS;

/** Bits of app_told_t.inputs: on while the pin is on, as its row of the board file says. */
enum {
    APP_S2 = 1,       /**< button S2 is down */
    APP_S3 = 2,       /**< button S3 is down */
    APP_DIRECTION = 4 /**< the direction input is on, debounced; never with DIRECTION_INPUT_USED 0 */
};

/** Bits of app_asks_t.outputs. */
enum {
    APP_LED_ALIVE = 1, /**< lights LED ALIVE */
    APP_LED_RUN = 2    /**< lights LED RUN */
};

/** Lowest and highest of a range: low, high. */
typedef pot_range_t app_range_t;

/** Its value at a share of it, 0..65535 from low to high. */
int16_t app_between(app_range_t range, uint16_t share_q16) APP_CALLS;

/** What the application is told. */
typedef struct {
    uint16_t elapsed_ms;         /**< since the last call; 1 as a rule */
    uint16_t state;              /**< drive_state_t */
    uint16_t fault;              /**< drive_fault_t; FAULT_NONE is 0 */
    uint16_t limits;             /**< bits of limit_reason_t: why the drive gives less than it is asked for */
    uint16_t is_running;         /**< 1 while the bridge switches: ALIGN to STOPPING */
    uint16_t is_remote;          /**< 1 while a client of the serial line is in command: what is asked for waits */
    speed_erpm_t speed_erpm;     /**< estimated speed, counts of APP_RPM(); 0 while the bridge is off */
    speed_erpm_t reference_erpm; /**< the speed reference on its ramp, counts of APP_RPM() */
    int16_t iq_q13;              /**< q current, counts of APP_AMPERE(): the torque */
    int16_t bus_q15;             /**< supply, counts of APP_VOLT() */
    uint16_t inputs;             /**< bits APP_S2, ... */
    uint16_t pot_q16;            /**< potentiometer's share of its travel, smoothed from 0 at power-up, APP_SHARE(); in BIDIRECTIONAL_SPEED from its middle */
    int16_t towards;             /**< 1 or -1: the direction of the potentiometer's side in BIDIRECTIONAL_SPEED, else 1; APP_DIRECTION turns it round */
    uint16_t pot_is_lost;        /**< 1: its signal is where no position is, POT_LIVE_ZERO */
#if MOTOR_NTC_USED
    int16_t motor_q4; /**< temperature of the motor's NTC, counts of APP_CELSIUS(); 0 until it is known */
#endif
#if BRIDGE_NTC_USED
    int16_t bridge_q4; /**< temperature of the bridge's NTC, counts of APP_CELSIUS(); 0 until it is known */
#endif
    app_range_t slow; /**< MINIMUM_SPEED_RPM .. NOMINAL_SPEED_RPM; TORQUE_MODE: currents */
    app_range_t fast; /**< NOMINAL_SPEED_RPM .. MAXIMUM_SPEED_RPM; TORQUE_MODE: as slow */
#if APP_SERIAL
    char *heard; /**< a line that has come, without its end; 0 without. Only for this call */
#endif
#if APP_PULSE
    uint16_t pulse_200ns;  /**< length of the last pulse that was measured since the last call, APP_PULSE_US(), below 11 ms; 0: none was */
    uint16_t period_200ns; /**< from its begin to the next one's; 65535 beyond 12 ms */
#endif
} app_told_t;

/** What it asks for. Before the call it holds what stands; what the application does not change stays. */
typedef struct {
    int16_t run;           /**< 1: run. From 0 to 1 without a fault starts; 0 stops in order. 0 after a fault, but for one that the retry will clear */
    int16_t target_erpm;   /**< speed, its sign the direction, counts of APP_RPM(); TORQUE_MODE: q current, counts of APP_AMPERE() */
    uint16_t clear_fault;  /**< 1: clear the fault, once */
    uint16_t fault;        /**< a fault of the application's own: FAULT_POTENTIOMETER for a lost command signal, any other is FAULT_APPLICATION */
    uint16_t take_command; /**< 1: take command back from a client of the serial line */
    uint16_t outputs;      /**< bits APP_LED_ALIVE, ... */
#if APP_SERIAL
    const char *say; /**< a line to send, without its end; its text stays as it is for 20 ms. 0 without */
#endif
} app_asks_t;

/** The plain lights: ALIVE unless there is a fault, RUN while the bridge switches. @return for asks->outputs */
uint16_t app_lights(const app_told_t *told) APP_CALLS;

/** Once after a reset, before the outputs are on: the application's own variables begin anew. */
void app_init(void);

/** Every millisecond in the background. It must return at once: no waiting, no loop without end. */
void app_ms(const app_told_t *told, app_asks_t *asks);

#endif
