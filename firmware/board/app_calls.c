/* What an application calls: shares, units, lights; and, where APP_SERIAL is 1, the serial line: lines heard and said, words, numbers, the checksum.
 * The linker drops what it does not call. */
#include "board/app_calls.h"

#include "app/line.h"
#include "board/peripherals.h"
#include "board/reset.h"
#include "board/status.h"

int16_t app_rpm_of(speed_erpm_t speed_erpm)
{
    return status_rpm(speed_erpm);
}

uint16_t app_share(uint16_t value, uint16_t from, uint16_t to)
{
    if (value <= from) {
        return 0;
    }
    return (value >= to) ? 65535u : qm_divud((uint32_t)(uint16_t)(value - from) << 16, (uint16_t)(to - from));
}

uint16_t app_may_pass(uint16_t fault)
{
    return retry_may_pass(fault);
}

int16_t app_between(app_range_t range, uint16_t share_q16)
{
    return (int16_t)(range.low + (int16_t)qm_mulhi_uu((uint16_t)(range.high - range.low), share_q16));
}

uint16_t app_lights(const app_told_t *told)
{
    return (uint16_t)(((told->fault == (uint16_t)FAULT_NONE) ? (uint16_t)APP_LED_ALIVE : 0u) | (told->is_running ? (uint16_t)APP_LED_RUN : 0u));
}

#if APP_SERIAL

static char heard_line[APP_LINE_SIZE] BOARD_UNSET;
static uint16_t heard_next BOARD_UNSET; /* where the next character goes */
static uint16_t is_heard BOARD_UNSET;   /* 1: the line is complete */
static const char *to_say;              /* the application's; cleared at the start */

void app_line_init(void)
{
    heard_next = 0;
    is_heard = 0;
    to_say = 0;
}

void app_line_hear(void)
{
    int16_t byte = is_heard ? (int16_t)-1 : uart_receive();
    if (byte == '\r' || byte == '\n') {
        heard_line[heard_next] = '\0';
        is_heard = (uint16_t)(heard_next != 0u);
        heard_next = 0;
    } else if (byte >= 0 && heard_next < APP_LINE_SIZE - 1u) { /* the end of a longer line is lost, and its checksum with it */
        heard_line[heard_next++] = (char)byte;
    } else { /* nothing */
    }
}

char *app_line_heard(void)
{
    return is_heard ? heard_line : 0;
}

void app_line_say(const char *text)
{
    is_heard = 0;
    if (text != 0) {
        to_say = text;
    }
}

char *app_line_next(char *line)
{
    const char *text = to_say;
    uint16_t n;
    if (text == 0) {
        return line;
    }
    to_say = 0;
    for (n = 0; n < APP_LINE_SIZE - 1u && text[n] != '\0'; n++) {
        line[n] = text[n];
    }
    return text_end(&line[n]);
}

/* ---- the serial line: what the application calls ---- */

/** The checksum's digit. */
static char digit_of(uint16_t value)
{
    static const char digits[] = "0123456789ABCDEF";
    return digits[value & 15u];
}

/** Exclusive-or of the characters from `line` to before `end`. */
static uint16_t check_of(const char *line, const char *end)
{
    uint16_t sum = 0;
    const char *at;
    for (at = line; at != end; at++) {
        sum ^= (uint8_t)*at;
    }
    return sum;
}

uint16_t app_line_is_right(char *line)
{
    char *end = line;
    uint16_t sum;
    while (*end != '\0' && *end != '*') {
        end++;
    }
    if (*end == '\0') {
        return 0;
    }
    sum = check_of(line, end);
    *end = '\0';
    return (uint16_t)(end[1] == digit_of((uint16_t)(sum >> 4)) && end[2] == digit_of(sum) && end[3] == '\0');
}

/** What follows a word. @return 0 if the line begins with another one */
static const char *line_after(const char *line, const char *word)
{
    const char *at = line, *wanted = word;
    while (*wanted != '\0') {
        if (*at++ != *wanted++) {
            return 0;
        }
    }
    return at;
}

uint16_t app_line_is(const char *line, const char *word)
{
    const char *rest = line_after(line, word);
    return (uint16_t)(rest != 0 && *rest == '\0');
}

uint16_t app_line_number(const char *line, const char *word, int16_t *number)
{
    const char *at = line_after(line, word);
    uint16_t size = 0, is_negative;
    if (at == 0 || *at++ != ' ') {
        return 0;
    }
    is_negative = (uint16_t)(*at == '-');
    at = &at[is_negative];
    do {
        const uint16_t digit = (uint16_t)((uint8_t)*at++ - (uint8_t)'0');
        if (digit > 9u || size > (INT16_MAX - digit) / 10u) {
            return 0;
        }
        size = (uint16_t)(10u * size + digit);
    } while (*at != '\0');
    *number = (int16_t)(is_negative ? -(int16_t)size : (int16_t)size);
    return 1;
}

char *app_line_put(char *at, const char *text)
{
    return text_put(at, text);
}

char *app_line_put_number(char *at, const char *text, int16_t number)
{
    return text_put_named(at, text, number);
}

char *app_line_put_fault(char *at, const char *text, uint16_t fault)
{
    return text_put_fault(at, text, fault);
}

void app_line_end(const char *line, char *end)
{
    const uint16_t sum = check_of(line, end);
    end[0] = '*';
    end[1] = digit_of((uint16_t)(sum >> 4));
    end[2] = digit_of(sum);
    end[3] = '\0';
}

#endif
