/* The status line: composed in the background, sent a character a pass. */
#include "board/status.h"

#include "board/firmware.h"
#include "board/peripherals.h"
#include "drive/params.h"

#define STATUS_PERIOD_MS 500u

static char line[48];
static uint16_t next;       /* index of the next character; a zero byte ends the line */
static uint16_t waited_ms;

static uint16_t put_text(uint16_t at, const char *text)
{
    while (*text != '\0') {
        line[at++] = *text++;
    }
    return at;
}

static uint16_t put_number(uint16_t at, int16_t number)
{
    char digits[6];
    uint16_t count = 0;
    uint16_t rest = (uint16_t)qm_abs(number);

    if (number < 0) {
        line[at++] = '-';
    }
    do {
        digits[count++] = (char)('0' + rest % 10u);
        rest /= 10u;
    } while (rest != 0u);
    while (count != 0u) {
        line[at++] = digits[--count];
    }
    return at;
}

void status_init(void)
{
    line[0] = '\0';
    next = 0;
    waited_ms = 0;
}

void status_tick(uint16_t elapsed_ms)
{
    uint16_t at;
    waited_ms = (uint16_t)(waited_ms + elapsed_ms);
    if (waited_ms < STATUS_PERIOD_MS || line[next] != '\0') {
        return;
    }
    waited_ms = 0;
    at = put_number(put_text(0, "state "), (int16_t)board_drive.state);
    at = put_number(put_text(at, " fault "), (int16_t)board_drive.fault);
    at = put_number(put_text(at, " speed "), (int16_t)(estimator_speed(&board_drive.estimator) / NOPOLESPAIRS));
    at = put_text(at, " rpm\r\n");
    line[at] = '\0';
    next = 0;
}

void status_send(void)
{
    if (line[next] != '\0' && uart_send(line[next])) {
        next++;
    }
}
