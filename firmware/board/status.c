/* The status line: composed in the background, sent a character a pass. */
#include "board/status.h"

#include "board/firmware.h"
#include "board/lnet.h"
#include "board/modes/bringup_report.h"
#include "board/modes/identify_report.h"
#include "board/peripherals.h"
#include "board/record.h"
#include "board/reset.h"
#include "board/selftest_run.h"
#include "board/text.h"
#include "board/watch.h"
#include "drive/limit_reasons.h"
#include "version.h"

#if SCOPE
#define LINE_PLACE __attribute__((aligned(2))) /* a client's answers are words */
#else
#define LINE_PLACE
#endif

static char line[MODE_LINE_SIZE] LINE_PLACE BOARD_UNSET;
static uint16_t line_next BOARD_UNSET; /* index of the next character; a zero byte ends the line */
static uint16_t waited_ms BOARD_UNSET;

#define LIMIT_NAME(bit, name, cause, remedy) " " #name "\0" /* one after the other: a pointer to each would take as much as half of them */
#define LONGEST_LIMIT " FIELD_WEAKENING"                    /* a test holds the others to it */
/* From here on the line has no room for it, a self-test and the end. */
#define LIMITS_END (sizeof line - sizeof LONGEST_LIMIT - sizeof " selftest 10\r\n")

/** What follows a text of a list, whose end is an empty one. */
QM_INLINE const char *next_name(const char *name)
{
    const char *end = name;
    while (*end != '\0') {
        end++;
    }
    return &end[1];
}

/** Why the drive gave less than it was asked for since the last line: " limit CURRENT RAMP". What finds no room waits for the next line.
 *  @return the text's end */
static char *put_limits(char *at)
{
    const char *name = DRIVE_LIMIT_TABLE(LIMIT_NAME);
    char *end = at;
    uint16_t bit = 1, seen = LimitParm.seen;
    if (seen != 0u) {
        end = text_put(end, " limit");
    }
    for (; *name != '\0' && end <= line + LIMITS_END; name = next_name(name)) {
        if ((seen & bit) != 0u) {
            end = text_put(end, name);
            seen ^= bit;
        }
        bit = (uint16_t)(bit << 1);
    }
    LimitParm.seen = seen;
    return end;
}

/** How far the retries are: " retries 2 first 6". @return the text's end */
static char *put_retry(char *at)
{
    if (RETRY_COUNT == 0 || board_retry.first == (uint16_t)FAULT_NONE) {
        return at;
    }
    return text_put_unsigned(text_put(text_put_unsigned(text_put(at, " retries "), board_retry.left), " first "), board_retry.first);
}

/** Mechanical rpm of a speed without a sign. */
NOINLINE int16_t size_rpm(uint16_t size)
{
    uint32_t erpm = qm_muluu(size, SPEED_UNIT), most = (uint32_t)INT16_MAX * NOPOLESPAIRS;
    if (SPEED_UNIT > NOPOLESPAIRS && erpm > most) { /* what a lost estimator sees */
        erpm = most;
    }
    return (int16_t)qm_divud(erpm, NOPOLESPAIRS);
}

/** Mechanical rpm. */
static int16_t speed_rpm(speed_erpm_t speed)
{
    return qm_with_sign(size_rpm((uint16_t)qm_abs(speed)), speed);
}

/** The line's text. @return its end */
static char *put_line(void)
{
    char *at = mode_status_line(line, &board_drive);
    if (at == line && !mode_speaks(&at)) {
        at = text_put_named(at, "state ", (int16_t)board_drive.state);
        at = text_put_named(at, TEXT_FAULT, (int16_t)board_drive.fault);
        at = text_put_named(at, " speed ", speed_rpm(estimator_speed(&board_drive.run.estimator)));
        at = put_limits(put_retry(text_put(at, " rpm")));
        at = text_end(selftest_put(at));
    }
    return at;
}

#define CAUSE_BIT(bit, name, meaning) | (1u << (bit))
#define CAUSE_NAME(bit, name, meaning) " " #name "\0"

/** The first line: "foc33 0.9.0 reset BOR POR". */
static char *put_reset(void)
{
    const char *name = RESET_CAUSE_TABLE(CAUSE_NAME);
    char *at = text_put(line, "foc33 " FOC33_VERSION " reset");
    uint16_t bit;
    for (bit = 0x8000u; bit != 0u; bit >>= 1) { /* the highest bit is the next one */
        if (((0u RESET_CAUSE_TABLE(CAUSE_BIT)) & bit) != 0u) {
            if ((board_reset_cause & bit) != 0u) {
                at = text_put(at, name);
            }
            name = next_name(name);
        }
    }
    return text_end(selftest_put_marked(at));
}

#if SCOPE

/** A pass of the line while a client may have it. @return 1 if the status line must wait */
static uint16_t line_serves_client(void)
{
    int16_t byte = uart_receive();
    if (byte >= 0) {
        lnet_receive((uint8_t)byte);
    }
    if (uart_has_room()) {
        byte = lnet_next();
        if (byte >= 0) {
            (void)uart_send((char)byte);
        }
    }
    return lnet_is_busy();
}

/** @return 1 once the line's memory is the client's */
static uint16_t line_is_taken(uint16_t elapsed_ms)
{
    lnet_tick(elapsed_ms);
    return board_lnet.is_up;
}

#else
#define line_serves_client() 0u
#define line_is_taken(elapsed_ms) 0u
#endif

void status_init(void)
{
#if SCOPE
    lnet_init((uint8_t *)line);
#endif
    *((board_reset_cause != 0u) ? put_reset() : line) = '\0';
    line_next = 0;
    waited_ms = 0;
}

void status_tick(uint16_t elapsed_ms)
{
    if (line_is_taken(elapsed_ms)) {
        return;
    }
    waited_ms = (uint16_t)(waited_ms + elapsed_ms);
    if (waited_ms < MODE_STATUS_MS || line[line_next] != '\0') {
        return;
    }
    waited_ms = 0;
    *put_line() = '\0';
    line_next = 0;
}

void status_send(void)
{
    if (line_serves_client()) {
        return;
    }
    if (line[line_next] == '\0') {
        *record_line(line) = '\0';
        line_next = 0;
    }
    if (line[line_next] != '\0' && uart_send(line[line_next])) {
        line_next++;
    }
}
