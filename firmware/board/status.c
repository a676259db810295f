/* The status line: composed in the background, sent a character a pass. */
#include "board/status.h"

#include "board/firmware.h"
#include "board/peripherals.h"
#include "board/reset.h"
#include "drive/params.h"
#include "version.h"

#define STATUS_PERIOD_MS 500u

#ifdef IDENTIFY
static char line[128];
#else
static char line[64];
#endif
static uint16_t next;       /* index of the next character; a zero byte ends the line */
static uint16_t waited_ms;

static uint16_t put_text(uint16_t at, const char *text)
{
    while (*text != '\0') {
        line[at++] = *text++;
    }
    return at;
}

static uint16_t put_unsigned(uint16_t at, uint16_t number)
{
    char digits[6];
    uint16_t count = 0;
    uint16_t rest = number;

    do {
        digits[count++] = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest != 0u);
    while (count != 0u) {
        line[at++] = digits[--count];
    }
    return at;
}

#ifdef IDENTIFY
/** The line's text. @return its length */
static uint16_t put_line(void)
{
    static const char *const results[] = { IDENTIFY_RESULT_TABLE(IDENTIFY_RESULT_NAME) };
    const identify_t *id = &board_drive.identify;
    uint16_t at = put_text(put_unsigned(put_text(0, "step "), id->step), " ");
    at = put_text(put_text(at, results[id->result]), " fault ");
    at = put_text(put_unsigned(at, board_drive.fault), " R ");
    at = put_text(put_unsigned(at, id->values.rs_mohm), " mohm Ld ");
    at = put_text(put_unsigned(at, id->values.ld_uh), " uH Lq ");
    at = put_text(put_unsigned(at, id->values.lq_uh), " uH Kphi ");
    return put_text(put_unsigned(at, id->values.kphi_mv_per_krpm), " mV/krpm\r\n");
}
#else
static uint16_t put_number(uint16_t at, int16_t number)
{
    uint16_t size = (uint16_t)qm_abs(number);
    if (number < 0) {
        line[at++] = '-';
    }
    return put_unsigned(at, size);
}

/** The line's text. @return its length */
static uint16_t put_line(void)
{
    uint16_t at = put_number(put_text(0, "state "), (int16_t)board_drive.state);
    at = put_number(put_text(at, " fault "), (int16_t)board_drive.fault);
    at = put_number(put_text(at, " speed "), (int16_t)(estimator_speed(&board_drive.estimator) / NOPOLESPAIRS));
    return put_text(at, " rpm\r\n");
}
#endif

/** The first line: "foc33 0.9.0 reset BOR POR". */
static uint16_t put_reset(void)
{
    uint16_t at = put_text(0, "foc33 " FOC33_VERSION " reset");
#define PUT_CAUSE(bit, name, meaning) \
    if (RESET_WAS(name, board_reset_cause)) { \
        at = put_text(at, " " #name); \
    }
    RESET_CAUSE_TABLE(PUT_CAUSE)
    return put_text(at, "\r\n");
}

void status_init(void)
{
    line[(board_reset_cause != 0u) ? put_reset() : 0u] = '\0';
    next = 0;
    waited_ms = 0;
}

void status_tick(uint16_t elapsed_ms)
{
    waited_ms = (uint16_t)(waited_ms + elapsed_ms);
    if (waited_ms < STATUS_PERIOD_MS || line[next] != '\0') {
        return;
    }
    waited_ms = 0;
    line[put_line()] = '\0';
    next = 0;
}

void status_send(void)
{
    if (line[next] != '\0' && uart_send(line[next])) {
        next++;
    }
}
