/* Application: the motor is run by lines of text, 115200 baud: run, stop, speed 1500, status, fault, clear, each with its checksum ("run*69").
 * Each is answered with what the drive does and its fault. Without a right line for TEXT_SILENT_MS the motor stops in order. tools/live/text.py talks to it. */
#include "app/line.h"

#define TEXT_SILENT_MS 2000u

static int16_t target;
static uint16_t silent_ms;

void app_init(void)
{
    target = 0; /* below MINIMUM_SPEED_RPM: that speed */
    silent_ms = 0;
}

/** Does what a right line says. @return the answer's first word */
static const char *obey(const char *line, const app_told_t *told, app_asks_t *asks)
{
    int16_t rpm;
    if (app_line_number(line, "speed", &rpm)) {
        if (qm_abs(rpm) < app_rpm_of(told->slow.low) || qm_abs(rpm) > app_rpm_of(told->fast.high)) {
            return "range";
        }
        target = APP_OF_RPM(rpm);
    } else if (app_line_is(line, "run")) {
        asks->run = 1; /* not in a fault: app_ms() */
        return told->fault ? "refused" : "ok";
    } else if (app_line_is(line, "stop")) {
        asks->run = 0;
    } else if (app_line_is(line, "clear")) {
        asks->clear_fault = 1;
    } else {
        return (app_line_is(line, "status") || app_line_is(line, "fault")) ? "ok" : "unknown"; /* each answer has both */
    }
    return "ok";
}

/** The answer to a line: "ok run 1 speed 1498 fault NONE*5F". */
static void reply(char *line, const app_told_t *told, app_asks_t *asks)
{
    static char answer[APP_LINE_SIZE];
    const uint16_t is_right = app_line_is_right(line);
    char *at = app_line_put(answer, is_right ? obey(line, told, asks) : "checksum");
    silent_ms = is_right ? 0 : silent_ms;
    at = app_line_put_number(app_line_put_number(at, " run ", (int16_t)told->is_running), " speed ", app_rpm_of(told->speed_erpm));
    app_line_end(answer, app_line_put_fault(at, " fault ", told->fault));
    asks->say = answer;
}

void app_ms(const app_told_t *told, app_asks_t *asks)
{
    silent_ms = (uint16_t)((silent_ms < TEXT_SILENT_MS) ? silent_ms + told->elapsed_ms : silent_ms);
    if (told->heard != 0) {
        reply(told->heard, told, asks);
    }
    asks->run = (int16_t)(asks->run && told->fault == (uint16_t)FAULT_NONE && silent_ms < TEXT_SILENT_MS);
    asks->target_erpm = target;
    asks->outputs = app_lights(told);
}
