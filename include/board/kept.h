/* Parameters that outlive a reset: two copies in the flash's last two pages, written only while the bridge is off (docs/kept.md). Nothing without PARAMS_KEPT. */
#ifndef BOARD_KEPT_H
#define BOARD_KEPT_H

#include "board/firmware.h"
#include "drive/param_limits.h"

/* ---- Where it is: addresses of the program counter, 2 a word ---- */

#define KEPT_PAGE_SIZE 0x0400u /* 512 words, the least that the chip erases */
#define KEPT_PAGES 2u
#define KEPT_COAST_MS 5000u /* a rotor that was let go may turn for so long */
#define KEPT_AT 0x5000u     /* the flash's last two pages; its CRC ends before them (BOARD_FLASH_CRC_AT) */

/* ---- What a client asks for, and hears ---- */

/** X(number, name, meaning): kept_command.request. No small numbers: a bit that flips must not erase flash. */
#define KEPT_REQUEST_TABLE(X) \
    X(19269, KEEP, "keep the values that are in RAM") \
    X(17999, FORGET, "erase both copies; the header's values are in RAM again")

/** X(number, name, meaning): kept_command.result, of the last request. */
#define KEPT_RESULT_TABLE(X) \
    X(0, NONE, "nothing was asked for yet") \
    X(1, DONE, "done") \
    X(2, NOT_STOPPED, "refused: only in STOPPED, 5 s after the bridge was on: the rotor must stand") \
    X(3, RANGE, "refused: a value is outside its range, or does not fit the others") \
    X(4, FLASH, "the flash does not hold what was written")

/** X(number, name, meaning): kept_command.copies. From ONE_COPY on the status line tells it. */
#define KEPT_STATE_TABLE(X) \
    X(0, NONE, "nothing is kept: the header's values are in use") \
    X(1, KEPT, "the kept values are in use") \
    X(2, ONE_COPY, "the kept values are in use, one of their two copies is not whole: keep them anew") \
    X(3, OTHER, "kept by another firmware or with another header: the header's values are in use") \
    X(4, RANGE, "a kept value is outside its range: the header's values are in use") \
    X(5, BROKEN, "no copy is whole: the header's values are in use")

#define KEPT_REQUEST(number, name, meaning) KEPT_ASK_##name = (number),
#define KEPT_RESULT(number, name, meaning) KEPT_RESULT_##name = (number),
#define KEPT_STATE(number, name, meaning) KEPT_##name = (number),
enum { KEPT_REQUEST_TABLE(KEPT_REQUEST) };
enum { KEPT_RESULT_TABLE(KEPT_RESULT) };
enum { KEPT_STATE_TABLE(KEPT_STATE) };

/** A client writes `request`; the next millisecond takes it back. */
typedef struct {
    volatile uint16_t request; /**< KEPT_REQUEST_TABLE, or 0 */
    uint16_t result;           /**< KEPT_RESULT_TABLE */
    uint16_t copies;           /**< KEPT_STATE_TABLE */
    uint16_t unsaved;          /**< words in RAM that a reset would change, of those that can be kept; counted ten times a second */
} kept_t;

/* ---- What is kept: the fields of drive_params_t that follow from a parameter, or are a gain ---- */

/* Of a parameter of PARAM_TABLE: its rows here, each with the macro R: R(first field, last one, least, most), in counts. Limits of current and bus, what protects
 * the motor, and what motor and board are, stay the header's. */
#define KEPT_OF_MINIMUM_SPEED_RPM ~, KEPT_SPEEDS
#define KEPT_OF_SPEEDREFRAMP_RPM_PER_S ~, KEPT_RAMP
#define KEPT_OF_SPEEDREF_DECEL_RPM_PER_S ~, KEPT_DECEL
#define KEPT_OF_OPENLOOP_RAMPSPEED_INCREASERATE ~, KEPT_START_RAMP
#define KEPT_OF_Q_CURRENT_REF_OPENLOOP ~, KEPT_START_CURRENT
#define KEPT_OF_FLYING_START ~, KEPT_FLYING
#define KEPT_OF_KFILTER_ESDQ ~, KEPT_ESDQ
#define KEPT_OF_FW_START_SPEED_RPM ~, KEPT_FW_START
#define KEPT_OF_FW_TRIM_CURRENT_A ~, KEPT_FW_TRIM
#define KEPT_OF_IDREF_SPEED0 ~, KEPT_IDREF
#define KEPT_OF_INVKFI_SPEED0 ~, KEPT_INVKFI
#define KEPT_OF_LS_OVER2LS0_SPEED0 ~, KEPT_LS

/** What fits a word, rounded as the header's values are: what is in the header's range is in this one. */
#define KEPT_WORD(x) ((int16_t)PARAM_ROUND(PARAM_MAX(PARAM_MIN(x, 32767.0F), -32767.0F)))
#define KEPT_SPEED(rpm) KEPT_WORD(SPEED_COUNTS(PARAM_F(rpm) * PARAM_F(NOPOLESPAIRS)))
#define KEPT_CURRENT(current_a) KEPT_WORD(PARAM_F(current_a) / PARAM_F(NORM_CURRENT_CONST) / 4.0F)

/* Minimum, nominal, maximum. The most is the header's: formats, tables and OVERSPEED were made for it. */
#define KEPT_SPEEDS(R, min, max) \
    R(minimum_erpm, maximum_erpm, PARAM_MAX(KEPT_SPEED(min), KEPT_WORD(SPEED_COUNTS(PARAM_LOWEST_ERPM))), KEPT_SPEED(MAXIMUM_SPEED_RPM))
/* Two words; KEPT_RELATION_TABLE has their range. */
#define KEPT_RAMP(R, min, max) R(speed_ramp_q16, speed_ramp_q16, INT16_MIN, INT16_MAX)
#define KEPT_DECEL(R, min, max) R(speed_decel_q16, speed_decel_q16, INT16_MIN, INT16_MAX)
#define KEPT_START_RAMP(R, min, max) R(forced.increase_rate_q10, forced.increase_rate_q10, min, max)
#define KEPT_START_CURRENT(R, min, max) \
    R(open_loop_q13, open_loop_q13, KEPT_CURRENT(min), PARAM_MIN(KEPT_CURRENT(max), CURRENT_Q13(MAXIMUM_CURRENT_A))) \
    R(align_rate_q12, align_rate_q12, 1, INT16_MAX)
#define KEPT_FLYING(R, min, max) R(flying_start, flying_start, min, max)
#define KEPT_ESDQ(R, min, max) R(fieldweak.kfilter_esdq_q16, fieldweak.kfilter_esdq_fw_q16, 2 * (min), 2 * (max)) /* and KFILTER_ESDQ_FW */
#define KEPT_FW_START(R, min, max) \
    R(fieldweak.on_speed_erpm, fieldweak.on_speed_erpm, KEPT_SPEED(min), KEPT_SPEED(max)) \
    R(fieldweak.trim_speed_erpm, fieldweak.trim_speed_erpm, KEPT_SPEED(PARAM_F(min) * PARAM_F(FIELDWEAK_TRIM_FROM)), KEPT_SPEED(max))
#define KEPT_FW_TRIM(R, min, max) \
    R(fieldweak.trim_max_q13, fieldweak.trim_max_q13, KEPT_CURRENT(min), PARAM_MIN(KEPT_CURRENT(max), CURRENT_Q13(MAXIMUM_CURRENT_A)))
#define KEPT_IDREF(R, min, max) \
    R(fieldweak.idref_q13, fieldweak.idref_q13, PARAM_MAX(KEPT_CURRENT(min), CURRENT_Q13(-PARAM_F(MAXIMUM_CURRENT_A))), KEPT_CURRENT(max))
#define KEPT_INVKFI(R, min, max) \
    R(fieldweak.inv_kfi, fieldweak.inv_kfi, KEPT_KFI(PARAM_MAX, min, PARAM_INVKFI_LEAST), KEPT_KFI(PARAM_MIN, max, PARAM_INVKFI_MOST))
#define KEPT_KFI(closer, end, share) KEPT_WORD(closer(PARAM_F(end), PARAM_INVKFI *PARAM_F(share)))
#define KEPT_LS(R, min, max) \
    R(fieldweak.ls_over2ls0_q15, fieldweak.ls_over2ls0_q15, KEPT_WORD(PARAM_F(min) * 32768.0F), KEPT_WORD(PARAM_F(max) * 32768.0F))

/* The controllers' gains, whose ranges are relations of PARAM_RELATION_TABLE. */
#define KEPT_GAINS(R) \
    R(pi_d.kp, pi_d.kp, 1, INT16_MAX) \
    R(pi_d.ki, pi_d.ki, 0, KEPT_KI_MOST) \
    R(pi_q.kp, pi_q.kp, 1, INT16_MAX) \
    R(pi_q.ki, pi_q.ki, 0, KEPT_KI_MOST) \
    R(speed_kp_q13, speed_kp_fast_q13, 1, INT16_MAX)
#define KEPT_KI_MOST 32563 /* 15.9 * 2048 */

/** X(condition): what must hold between the values of `p`, beyond each one's range. */
#define KEPT_RELATION_TABLE(X) \
    X(p->nominal_erpm > p->minimum_erpm) \
    X(p->maximum_erpm >= p->nominal_erpm) \
    X(p->fieldweak.on_speed_erpm < p->maximum_erpm) \
    X(kept_slope_fits(p->speed_ramp_q16)) \
    X(kept_slope_fits(p->speed_decel_q16))
#define KEPT_SLOPE_LEAST PARAM_SLOPE_Q16(1) /* SPEEDREFRAMP_RPM_PER_S's */
#define KEPT_SLOPE_MOST PARAM_SLOPE_Q16(60000)

#define KEPT_WORDS (3u * FIELDWEAK_ENTRIES + 22u) /* of all rows */

/* A row of PARAM_TABLE whose parameter has a KEPT_OF_ gives that one's rows, any other nothing. */
#define KEPT_PICK(...) KEPT_SECOND(__VA_ARGS__, ~)
#define KEPT_SECOND(first, second, ...) second
#define KEPT_NOT(R, min, max)

#if PARAMS_KEPT
/** Of this board; a client finds it by its name. */
extern kept_t kept_command;

/** At the start, before the drive: the kept values into board_params, if there are any that may be used. */
void kept_init(void);

/** A pass each millisecond: serves a request. Writing takes 60 ms, during which the background stands. */
void kept_tick(uint16_t elapsed_ms);

/** Status line: " kept BROKEN" where that is to be told. @return the text's end */
char *kept_put(char *at);
#else
#define kept_init() ((void)0)
#define kept_tick(elapsed_ms) ((void)0)
#define kept_put(at) (at)
#endif

#endif
