/* What an application calls: shares, units, lights; where APP_SERIAL is 1, the serial line: lines heard and said, words, numbers, the checksum; where
 * APP_PULSE is 1, the pulses at the command input. The linker drops what it does not call. */
#include "board/application.h"

#include "app/line.h"
#include "app/pulse.h"
#include "board/mclv.h"
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

#if APP_PULSE

PIN_NEEDS(a_count_is_200_ns, BOARD_FCY_HZ / 8u == 5000000u);
#define PULSE_MOST APP_PULSE_US(11000u)              /* a longer one, or an end that came before the begin */
#define PULSE_QUICK APP_PULSE_US(4000u)              /* of a shorter period more edges may have come than the captures hold */
#define PULSE_ONCE_ROUND_TICKS PARAM_PERIODS(0.012F) /* the count goes round in 13.1 ms, and a pass takes up to 1 */

static struct {
    uint16_t has_begun, begin_200ns, begin_ticks; /* ticks when the begin was read */
    uint16_t length_200ns;                        /* 0: its end has not come */
} pulse;
static uint16_t told_pulse_200ns, told_period_200ns; /* for the application */

/** Both captures empty: what comes next is in order, whatever was lost. */
static void pulse_restart(void)
{
    IC1CON = 0;
    IC2CON = 0;
    IC1CON = BOARD_IC1CON;
    IC2CON = BOARD_IC2CON;
    pulse.has_begun = 0;
    pulse.length_200ns = 0;
}

static void pulse_begins(uint16_t begin_200ns, uint16_t ticks)
{
    pulse.has_begun = 1;
    pulse.begin_200ns = begin_200ns;
    pulse.begin_ticks = ticks;
    pulse.length_200ns = 0;
}

/** The next pulse begins. IC2 starts later than IC1 by less than a period, so that the end is perhaps the next one's. */
static void pulse_is_over(uint16_t begin_200ns, uint16_t ticks)
{
    const uint16_t length_200ns = pulse.length_200ns, is_once = (uint16_t)((uint16_t)(ticks - pulse.begin_ticks) <= PULSE_ONCE_ROUND_TICKS);
    const uint16_t period_200ns = is_once ? (uint16_t)(begin_200ns - pulse.begin_200ns) : 65535u;
    if (length_200ns != 0u) {
        told_pulse_200ns = (length_200ns > period_200ns) ? (uint16_t)(length_200ns - period_200ns) : length_200ns;
        told_period_200ns = period_200ns;
    }
    if (length_200ns == 0u || period_200ns < PULSE_QUICK) {
        pulse_restart();
    } else {
        pulse_begins(begin_200ns, ticks);
    }
}

void app_pulse_init(void)
{
    pins_unlock();
    RPINR7 = BOARD_RPINR7;
    pins_lock();
    T3CON = 0;
    PR3 = 0xFFFFu;
    T3CON = BOARD_T3CON;
    told_pulse_200ns = 0;
    pulse_restart();
}

void app_pulse_look(uint16_t ticks)
{
    uint16_t begins = IC1CONbits.ICBNE;
    if (begins && !pulse.has_begun) {
        pulse_begins(IC1BUF, ticks);
        begins = 0;
    } else if (begins && pulse.length_200ns != 0u) { /* before its own end is looked at, which may have come, too */
        pulse_is_over(IC1BUF, ticks);
        begins = 0;
    } else { /* perhaps the end has come, too */
    }
    if (IC2CONbits.ICBNE) {
        const uint16_t length_200ns = (uint16_t)(IC2BUF - pulse.begin_200ns);
        if (pulse.has_begun && pulse.length_200ns == 0u && length_200ns < PULSE_MOST && (uint16_t)(ticks - pulse.begin_ticks) <= PULSE_ONCE_ROUND_TICKS) {
            pulse.length_200ns = length_200ns;
        }
    }
    if (begins) {
        pulse_is_over(IC1BUF, ticks);
    }
}

void app_pulse_take(app_told_t *told)
{
    told->pulse_200ns = told_pulse_200ns;
    told->period_200ns = told_period_200ns;
    told_pulse_200ns = 0;
}

#endif
