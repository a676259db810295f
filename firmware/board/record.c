/* The fault recorder on the board: where it is, and its rows as lines for the UART. */
#include "board/record.h"

#include "board/reset.h"
#include "board/text.h"

#define NOTHING_TO_SEND 0xFFFFu

recorder_t board_recorder BOARD_PERSISTENT;

static uint16_t next_line; /* of the record: 0 is its head */
static uint16_t seen_left; /* rows still to come at the last look: at its end a record is to be sent */

void record_init(drive_fault_t kept)
{
    recorder_restart(&board_recorder, RESET_LOST_RAM, kept);
    next_line = NOTHING_TO_SEND;
    seen_left = 1; /* one that was kept is sent, too */
}

void record_tick(void)
{
    recorder_background(&board_recorder, &board_drive);
    if (board_recorder.left != 0u) {
        next_line = NOTHING_TO_SEND; /* of rows that are written nothing can be told */
    } else if (seen_left != 0u) {
        next_line = 0;
    } else {
        /* it has been told */
    }
    seen_left = board_recorder.left;
}

static char *put_head(char *line, uint16_t rows)
{
    char *at = text_put_unsigned(text_put(line, "record fault "), board_recorder.fault);
    at = text_put_unsigned(text_put(at, " rows "), rows);
    return text_put_unsigned(text_put(at, " every "), RECORDER_EVERY);
}

static char *put_row(char *line, uint16_t place)
{
    const int16_t *word = &board_recorder.word[place * (uint16_t)RECORDER_WORDS];
    char *at = text_put_unsigned(text_put(line, "row "), place);
    uint16_t n;
    for (n = 0; n < (uint16_t)RECORDER_WORDS; n++) {
        at = text_put_signed(text_put(at, " "), word[n]);
    }
    return at;
}

char *record_line(char *line)
{
    uint16_t rows = recorder_rows(&board_recorder);
    char *at;

    if (next_line > rows) { /* also with nothing to send */
        next_line = NOTHING_TO_SEND;
        return line;
    }
    at = (next_line == 0u) ? put_head(line, rows) : put_row(line, recorder_place(&board_recorder, (uint16_t)(next_line - 1u)));
    next_line++;
    return text_put(at, "\r\n");
}
