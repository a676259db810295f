/* The status line: composed in the background, sent a character a pass. */
#include "board/status.h"

#include "board/application.h"
#include "board/kept.h"
#include "board/scope.h"
#include "board/modes/mode_board.h"
#include "board/peripherals.h"
#include "board/reset.h"
#include "board/selftest_run.h"
#include "board/watch.h"
#include "drive/limits.h"

#if SCOPE && APP_SERIAL
#error foc33: an application with app/line.h has the serial line, and so has SCOPE: set SCOPE 0
#endif

#if SCOPE
#define LINE_PLACE __attribute__((aligned(2))) /* a client's answers are words */
#else
#define LINE_PLACE
#endif

static char sent_line[MODE_LINE_SIZE] LINE_PLACE BOARD_UNSET;
static uint16_t line_next BOARD_UNSET; /* index of the next character; a zero byte ends the line */
static uint16_t waited_ms BOARD_UNSET;

/* What this build cannot tell has its place without its text: NAMED(X, yes) is yes, unless UNTOLD_X is defined. */
#if !HEAT_USED
#define UNTOLD_TEMPERATURE , " \0"
#define UNTOLD_MOTOR_HOT , "\0"
#define UNTOLD_BRIDGE_HOT , "\0"
#define UNTOLD_NTC_SENSOR , "\0"
#endif
#define NAMED(name, text) NAMED_SECOND(UNTOLD_##name, text, )
#define NAMED_SECOND(...) NAMED_SECOND_(__VA_ARGS__)
#define NAMED_SECOND_(first, second, ...) second

#define LIMIT_NAME(bit, name, cause, remedy) NAMED(name, " " #name "\0") /* one after the other: a pointer to each would take as much as half of them */
#define LONGEST_LIMIT " FIELD_WEAKENING"                                 /* a test holds the others to it */
/* From here on the line has no room for it, a self-test and the end. */
#define LIMITS_END (sizeof sent_line - sizeof LONGEST_LIMIT - sizeof " selftest 10\r\n")

/** Why the drive gave less than it was asked for since the last line: " limit CURRENT RAMP". What finds no room waits for the next line. @return the text's end */
static char *put_limits(char *at)
{
    const char *name = CHOPPER_USED ? DRIVE_LIMIT_TABLE(LIMIT_NAME) : DRIVE_LIMIT_TABLE_BARE(LIMIT_NAME);
    char *end = at;
    uint16_t bit = 1, seen = LimitParm.seen;
    if (seen != 0u) {
        end = text_put(end, " limit");
    }
    for (; *name != '\0' && end <= sent_line + LIMITS_END; name = text_next(name)) {
        if ((seen & bit) != 0u) {
            end = text_put(end, name);
            seen ^= bit;
        }
        bit = (uint16_t)(bit << 1);
    }
    LimitParm.seen = seen;
    return end;
}

/** How far the retries are: " retries 2 first STALL". @return the text's end */
static char *put_retry(char *at)
{
    if (RETRY_COUNT == 0 || board_retry.first == (uint16_t)FAULT_NONE) {
        return at;
    }
    return text_put_fault(text_put_unsigned(text_put(at, " retries "), board_retry.left), " first ", board_retry.first);
}

/** What the sensors show: " motor 61 C bridge 40 C". @return the text's end */
static char *put_heat(char *at)
{
    char *end = at;
#if MOTOR_NTC_USED
    end = text_put(text_put_named(end, " motor ", (int16_t)(board_drive.heat.motor.celsius_q4 / 16)), " C");
#endif
#if BRIDGE_NTC_USED
    end = text_put(text_put_named(end, " bridge ", (int16_t)(board_drive.heat.bridge.celsius_q4 / 16)), " C");
#endif
    return end;
}

int16_t status_rpm(speed_erpm_t speed)
{
    uint32_t erpm = qm_muluu((uint16_t)qm_abs(speed), SPEED_UNIT), most = (uint32_t)INT16_MAX * NOPOLESPAIRS;
    if (SPEED_UNIT > NOPOLESPAIRS && erpm > most) { /* what a lost estimator sees */
        erpm = most;
    }
    return qm_with_sign((int16_t)qm_divud(erpm, NOPOLESPAIRS), speed);
}

/** The line's text. @return its end */
static char *put_line(void)
{
    char *at = sent_line;
    if (!mode_speaks(&at)) {
        at = text_put_named(at, "state ", (int16_t)board_drive.state);
        at = text_put_fault(at, " fault ", board_drive.fault);
        at = text_put_named(at, " speed ", status_rpm(estimator_speed(&board_drive.run.estimator)));
        at = put_limits(put_retry(put_heat(kept_put(text_put(at, " rpm")))));
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
    char *at = text_put(sent_line, "foc33 " FOC33_VERSION " reset");
    uint16_t bit;
    for (bit = 0x8000u; bit != 0u; bit >>= 1) { /* the highest bit is the next one */
        if (((0u RESET_CAUSE_TABLE(CAUSE_BIT)) & bit) != 0u) {
            if ((board_reset_cause & bit) != 0u) {
                at = text_put(at, name);
            }
            name = text_next(name);
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
    lnet_init((uint8_t *)sent_line);
#endif
    *((board_reset_cause != 0u) ? put_reset() : sent_line) = '\0';
    line_next = 0;
    waited_ms = 0;
    app_line_init();
}

void status_tick(uint16_t elapsed_ms)
{
    if (APP_SERIAL || line_is_taken(elapsed_ms)) {
        return;
    }
    waited_ms = (uint16_t)(waited_ms + elapsed_ms);
    if (waited_ms < MODE_STATUS_MS || sent_line[line_next] != '\0') {
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
    app_line_hear();
    if (sent_line[line_next] == '\0') {
        char *end = app_line_next(sent_line);
        *((end == sent_line) ? record_line(sent_line) : end) = '\0';
        line_next = 0;
    }
    if (sent_line[line_next] != '\0' && uart_send(sent_line[line_next])) {
        line_next++;
    }
}

/* ---- Text and decimal numbers into a buffer ---- */

#define FAULT_NAME(code, name, passes, decided_by, cause, remedy) NAMED(name, #name "\0")

char *text_put(char *at, const char *text)
{
    char *next = at;
    while (*text != '\0') {
        *next++ = *text++;
    }
    return next;
}

char *text_put_unsigned(char *at, uint16_t number)
{
    char digits[6], *digit = &digits[5];
    uint16_t rest = number;
    *digit = '\0';
    do {
        *--digit = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest != 0u);
    return text_put(at, digit);
}

char *text_put_named(char *at, const char *name, int16_t number)
{
    char *next = text_put(at, name);
    if (number < 0) {
        *next++ = '-';
    }
    return text_put_unsigned(next, (uint16_t)qm_abs(number));
}

const char *text_next(const char *name)
{
    const char *end = name;
    while (*end != '\0') {
        end++;
    }
    return &end[1];
}

char *text_put_fault(char *at, const char *before, uint16_t fault)
{
    const char *name = DRIVE_FAULT_TABLE(FAULT_NAME) "UNKNOWN";
    uint16_t left = (fault < (uint16_t)FAULT_COUNT) ? fault : (uint16_t)FAULT_COUNT;
    for (; left != 0u; left--) {
        name = text_next(name);
    }
    return text_put(text_put(at, before), name);
}

char *text_end(char *at)
{
    return text_put(at, "\r\n");
}

/* ---- The fault recorder on the board: where it is, and its rows as lines for the UART ---- */

recorder_t board_recorder BOARD_PERSISTENT;

#define RECORD_IS_NEW 0xFFFFu /* more than there are: its head has not been sent */

static uint16_t rows_left BOARD_UNSET; /* to be sent */

void record_init(drive_fault_t kept)
{
    recorder_restart(&board_recorder, RESET_LOST_RAM(board_reset_cause), kept);
    rows_left = RECORD_IS_NEW;
}

void record_tick(void)
{
    recorder_background(&board_recorder, &board_drive);
    if (board_recorder.left != 0u) {
        rows_left = RECORD_IS_NEW;
    }
}

static char *put_head(char *line)
{
    char *at = text_put_fault(line, "record fault ", (uint16_t)board_recorder.fault);
    at = text_put_named(at, " rows ", (int16_t)rows_left);
    at = text_put_named(at, " every ", (int16_t)RECORDER_EVERY);
    at = text_put_named(at, " offsets ", board_recorder.offset_a_q13);
    return text_put_named(at, " ", board_recorder.offset_b_q13);
}

static char *put_row(char *line, uint16_t place)
{
    const int8_t *byte = board_recorder.row[place].byte;
    char *at = text_put_named(line, "row ", (int16_t)place);
    uint16_t n;
    for (n = 0; n < (uint16_t)RECORDER_BYTES; n++) {
        at = text_put_named(at, " ", byte[n]);
    }
    return at;
}

char *record_line(char *line)
{
    uint16_t rows = recorder_rows(&board_recorder);
    char *at;
    if (rows == 0u || rows_left == 0u) {
        return line;
    }
    if (rows_left > rows) {
        rows_left = rows;
        at = put_head(line);
    } else {
        rows_left--;
        at = put_row(line, recorder_place(&board_recorder, rows_left));
    }
    return text_end(at);
}
