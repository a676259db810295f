/* The fault recorder on the board: where it is, and its rows as lines for the UART. */
#include "board/record.h"

#include "board/reset.h"
#include "board/text.h"

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
    char *at = text_put_named(line, text_record_fault, board_recorder.fault);
    at = text_put_named(at, " rows ", (int16_t)rows_left);
    at = text_put_named(at, " every ", (int16_t)RECORDER_EVERY);
    at = text_put_named(at, " offsets ", board_recorder.offset_a_q13);
    return text_put_named(at, TEXT_BLANK, board_recorder.offset_b_q13);
}

static char *put_row(char *line, uint16_t place)
{
    const int8_t *byte = board_recorder.row[place].byte;
    char *at = text_put_named(line, "row ", (int16_t)place);
    uint16_t n;
    for (n = 0; n < (uint16_t)RECORDER_BYTES; n++) {
        at = text_put_named(at, TEXT_BLANK, byte[n]);
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
