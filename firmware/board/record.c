/* The fault recorder on the board: where it is, and its rows as lines for the UART. */
#include "board/record.h"

#include "board/reset.h"
#include "board/text.h"

recorder_t board_recorder BOARD_PERSISTENT;

static uint16_t lines_left; /* of the record: its head is the first */
static uint16_t is_told;    /* 1 from the end of a record to the next start */

void record_init(drive_fault_t kept)
{
    recorder_restart(&board_recorder, RESET_LOST_RAM, kept);
    lines_left = 0;
    is_told = 0;
}

void record_tick(void)
{
    uint16_t rows;
    recorder_background(&board_recorder, &board_drive);
    rows = recorder_rows(&board_recorder);
    if (rows == 0u) {
        lines_left = 0; /* it has begun anew */
        is_told = 0;
    } else if (!is_told) {
        lines_left = (uint16_t)(rows + 1u);
        is_told = 1;
    } else {
        /* once is enough */
    }
}

static char *put_head(char *line, uint16_t rows)
{
    char *at = text_put_unsigned(text_put(line, "record fault "), board_recorder.fault);
    at = text_put_unsigned(text_put(at, " rows "), rows);
    at = text_put_unsigned(text_put(at, " every "), RECORDER_EVERY);
    at = text_put_signed(text_put(at, " offsets "), board_recorder.offset_a_q13);
    return text_put_signed(text_put(at, " "), board_recorder.offset_b_q13);
}

static char *put_row(char *line, uint16_t place)
{
    const int8_t *byte = board_recorder.row[place].byte;
    char *at = text_put_unsigned(text_put(line, "row "), place);
    uint16_t n;
    for (n = 0; n < (uint16_t)RECORDER_BYTES; n++) {
        at = text_put_signed(text_put(at, " "), byte[n]);
    }
    return at;
}

char *record_line(char *line)
{
    uint16_t rows = recorder_rows(&board_recorder);
    char *at;

    if (lines_left == 0u) {
        return line;
    }
    lines_left--;
    at = (lines_left == rows) ? put_head(line, rows) : put_row(line, recorder_place(&board_recorder, lines_left));
    return text_put(at, "\r\n");
}
