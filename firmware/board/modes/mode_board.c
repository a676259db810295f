/* The seam between the board and the modes: lines, watch variables, arrays and memory of theirs. */
#include "board/modes/mode_board.h"

#include "board/application.h"
#include "board/firmware.h"
#include "board/mclv.h"
#include "board/peripherals.h"
#include "board/pin_table.h"
#include "board/status.h"

#include <xc.h>

#ifdef TORQUE_PROFILE
tProfileParm ProfileParm;

static void profile_watch(const profile_t *f)
{
    uint16_t k;
    ProfileParm.qNow = (int16_t)(4 * f->now_q13);
    for (k = 0; k < PROFILE_ORDERS; k++) {
        ProfileParm.qCos[k] = qm_hi(4 * f->harmonic[k].cos_q29);
        ProfileParm.qSin[k] = qm_hi(4 * f->harmonic[k].sin_q29);
    }
}
#endif

#ifdef IDENTIFY
tIdentifyParm IdentifyParm;

/** A number of 32 bits, with what stands before it: by subtraction, for the chip divides 32 bits by 16 only. */
static char *put_decimal(char *at, const char *before, uint32_t number)
{
    static const uint32_t tens[] = { 1000000000ul, 100000000ul, 10000000ul, 1000000ul, 100000ul, 10000ul, 1000ul, 100ul, 10ul };
    char *next = text_put(at, before);
    uint32_t left = number;
    uint16_t n, begun = 0;
    for (n = 0; n < 9u; n++) {
        char digit = '0';
        while (left >= tens[n]) {
            left -= tens[n];
            digit++;
            begun = 1;
        }
        if (begun) {
            *next++ = digit;
        }
    }
    *next++ = (char)('0' + (uint16_t)left);
    *next = '\0';
    return next;
}

/** "step 0 DONE fault NONE R 2692100 uohm Ld 1919400 nH Lq 1920100 nH Kphi 7240300 uV/krpm J 5500e-9 kgm2 friction
 *  400000e-8 Nm + 15300e-9 Nms" in one line. @return its end */
static char *identify_line(char *line, const drive_t *d)
{
    static const char *const results[] = { IDENTIFY_RESULT_TABLE(IDENTIFY_RESULT_NAME) };
    const identify_t *id = &d->run.identify;
    char *at = text_put(text_put_unsigned(text_put(line, "step "), id->step), " ");
    at = text_put_fault(text_put(at, results[id->result]), " fault ", d->fault);
    at = put_decimal(at, " R ", id->values.rs_uohm);
    at = put_decimal(at, " uohm Ld ", id->values.ld_nh);
    at = put_decimal(at, " nH Lq ", id->values.lq_nh);
    at = put_decimal(at, " nH Kphi ", id->values.kphi_uv_per_krpm);
    at = put_decimal(at, " uV/krpm J ", id->values.inertia_1e9_kgm2);
    at = put_decimal(at, "e-9 kgm2 friction ", id->values.coulomb_1e8_nm);
    return text_put(put_decimal(at, "e-8 Nm + ", id->values.viscous_1e9_nms), "e-9 Nms\r\n");
}

static void identify_watch(const drive_t *d)
{
    const identify_t *id = &d->run.identify;
    IdentifyParm.step = id->step;
    IdentifyParm.result = id->result;
    IdentifyParm.Rs_uohm = id->values.rs_uohm;
    IdentifyParm.Ld_nH = id->values.ld_nh;
    IdentifyParm.Lq_nH = id->values.lq_nh;
    IdentifyParm.Kphi_uV_per_krpm = id->values.kphi_uv_per_krpm;
    IdentifyParm.J_1e9_kgm2 = id->values.inertia_1e9_kgm2;
    IdentifyParm.Coulomb_1e8_Nm = id->values.coulomb_1e8_nm;
    IdentifyParm.Viscous_1e9_Nms = id->values.viscous_1e9_nms;
}
#endif

void mode_watch(const drive_t *d UNUSED)
{
#ifdef IDENTIFY
    identify_watch(d);
#elif defined TORQUE_PROFILE
    profile_watch(&d->run.profile);
#endif
}

#ifdef BRINGUP
bringup_guide_t board_bringup;

/* clang-format off */
#define TEXT_ROW(name, text) { #name, text },
#define VALUE_ROW(name, unit, decimals, text) { #name, unit, text, decimals },

/* clang-format on */

typedef struct {
    const char *name, *text;
} named_text_t;

static const char *const phases[3] = { "A", "B", "C" };

/** A number with so many decimals, of which the last is its unit. @param number of 16 bits and a sign */
static char *put_number(char *at, int32_t number, uint16_t decimals)
{
    char digits[6];
    char *next = at;
    uint16_t digit, count = 0, rest = (uint16_t)((number < 0) ? -number : number);
    for (digit = 0; rest != 0u || digit <= decimals; digit++) {
        if (digit == decimals && decimals != 0u) {
            digits[count++] = '.';
        }
        digits[count++] = (char)('0' + rest % 10u);
        rest /= 10u;
    }
    if (number < 0) {
        *next++ = '-';
    }
    while (count != 0u) {
        *next++ = digits[--count];
    }
    return next;
}

/** 1 where a text names a phase or pin. */
static uint16_t names_part(const char *text)
{
    const char *at = text;
    while (*at != '\0' && *at != '~') {
        at++;
    }
    return (uint16_t)(*at == '~');
}

/** A text with its phase or pin for ~, its number, in thousandths or whole, for #, the fault of that number for $. */
static char *put_text(char *at, const char *text, const char *part, int32_t number, uint16_t decimals)
{
    char *next = at;
    const char *from;
    for (from = text; *from != '\0'; from++) {
        if (*from == '~') {
            next = text_put(next, part);
        } else if (*from == '#') {
            next = put_number(next, number, decimals);
        } else if (*from == '$') {
            next = text_put_fault(next, "", (uint16_t)number);
        } else {
            *next++ = *from;
        }
    }
    return next;
}

/** "NAME: ", with the phase where the text names one: "NAME B: ". */
static char *put_name(char *at, const char *name, const char *text, const char *part)
{
    char *next = text_put(at, name);
    if (names_part(text)) {
        next = text_put(text_put(next, " "), part);
    }
    return text_put(next, ": ");
}

static char *put_question(char *line, const bringup_message_t *m)
{
    static const char *const pins[2] = { PIN_NAME(BOARD_PIN_UART_TX), PIN_NAME(BOARD_OTHER_TX) };
    static const named_text_t questions[] = { BRINGUP_QUESTION_TABLE(TEXT_ROW) };
    const char *text = questions[m->code].text;
    char *at = text_put(text_put(text_put(line, "ask "), questions[m->code].name), ": ");
    return put_text(at, text, pins[m->part & 1u], m->value, 3);
}

static char *put_value(char *line, const bringup_message_t *m)
{
    static const struct {
        const char *name, *unit, *text;
        uint16_t decimals;
    } values[] = { BRINGUP_VALUE_TABLE(VALUE_ROW) };
    const char *text = values[m->code].text, *unit = values[m->code].unit, *phase = phases[m->part];
    uint16_t decimals = values[m->code].decimals;
    char *at = text_put(line, (m->value >= m->low && m->value <= m->high) ? "ok " : "WRONG ");
    at = put_text(put_name(at, values[m->code].name, text, phase), text, phase, 0, 0);
    at = text_put(put_number(text_put(at, " "), m->value, decimals), unit);
    at = put_number(text_put(at, ", expected "), m->low, decimals);
    if (m->low != m->high) {
        at = put_number(text_put(at, " .. "), m->high, decimals);
    }
    return text_put(at, unit);
}

static char *put_direction(char *line, const bringup_message_t *m)
{
    static const char *const directions[BRINGUP_DIRECTIONS] = { "+A", "-C", "+B", "-A", "+C", "-B" };
    static const char *const shares[BRINGUP_DIRECTIONS] = { "2 : -1", "1 : 1", "-1 : 2", "-2 : 1", "-1 : -1", "1 : -2" };
    char *at = text_put(text_put(text_put(line, "see "), directions[m->code]), ": ");
    at = put_number(text_put(put_number(at, m->value, 2), " V, current A "), m->low, 3);
    at = put_number(text_put(at, " A, B "), m->high, 3);
    return text_put(text_put(at, " A, expected "), shares[m->code]);
}

static char *put_finding(char *line, const bringup_message_t *m)
{
    static const named_text_t findings[] = { BRINGUP_FINDING_TABLE(TEXT_ROW) };
    const char *text = findings[m->code].text, *phase = phases[m->part];
    char *at = put_name(text_put(line, "FIX "), findings[m->code].name, text, phase);
    return put_text(at, text, phase, m->value, 0);
}

/** The pins that the line goes out by. */
static void choose_sender(uint16_t sender)
{
    pins_unlock();
    PIN_OUTPUT(BOARD_PIN_UART_TX) = (sender != 1u) ? BOARD_UART_TX_FUNCTION : 0u;
    PIN_OUTPUT(BOARD_OTHER_TX) = (sender != 0u) ? BOARD_UART_TX_FUNCTION : 0u;
    pins_lock();
}

/** The guide's next line, if it has one: "ask 4 ...", "ok BUS ...", "WRONG BUS ...", "FIX BUS_DIVIDER: ...". @return its end */
static char *bringup_line(char *line)
{
    bringup_message_t *m = &board_bringup.message;
    char *at = line;
    switch (m->kind) {
    case BRINGUP_ASKS: at = put_question(line, m); break;
    case BRINGUP_TELLS: at = put_value(line, m); break;
    case BRINGUP_SHOWS: at = put_direction(line, m); break;
    case BRINGUP_FINDS: at = put_finding(line, m); break;
    case BRINGUP_ENDS: at = put_number(text_put(line, "end: findings "), m->value, 0); break;
    default: return line;
    }
    choose_sender(board_bringup.sender);
    m->kind = (uint16_t)BRINGUP_SILENT;
    return text_put(at, "\r\n");
}
#endif

uint16_t mode_speaks(char **end UNUSED)
{
#if defined IDENTIFY
    *end = identify_line(*end, &board_drive);
    return 1;
#elif defined BRINGUP
    *end = bringup_line(*end);
    return 1;
#else
    return 0;
#endif
}

void mode_record(void)
{
#ifdef SNAPSHOT
    snapshot_tick(&board_snapshot, &board_drive);
#endif
}

#ifdef SNAPSHOT
int16_t SnapBuf1[DATA_BUFFER_SIZE], SnapBuf2[DATA_BUFFER_SIZE], SnapBuf3[DATA_BUFFER_SIZE], SnapBuf4[DATA_BUFFER_SIZE];

volatile uint16_t SnapStart, SnapDone;

snapshot_t board_snapshot = {
    { SnapBuf1, SnapBuf2, SnapBuf3, SnapBuf4 }, DATA_BUFFER_SIZE, SNAPDELAY, &SnapStart, &SnapDone, 0, 0
};
#endif

void mode_panel_init(void)
{
#ifdef BRINGUP
    bringup_init(&board_bringup);
#endif
}

uint16_t mode_panel(uint16_t elapsed_ms UNUSED)
{
#ifdef BRINGUP
    const buttons_t in = { BOARD_S2_DOWN(), BOARD_S3_DOWN(), elapsed_ms };
    const lights_t lights = bringup_pass(&board_bringup, &board_drive, &board_params, &in, board_pot.now_q15);
    BOARD_SWITCH(BOARD_LED_ALIVE, lights.led_alive);
    BOARD_SWITCH(BOARD_LED_RUN, lights.led_run);
    return 1;
#else
    return 0;
#endif
}
