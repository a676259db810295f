/* Text into a buffer, for the status line. */
#ifndef BOARD_TEXT_H
#define BOARD_TEXT_H

#include <stdint.h>

/** Each puts its text at line[at] without a closing zero. The caller has room. @return where the next text goes */
uint16_t text_put(char *line, uint16_t at, const char *text);
uint16_t text_put_unsigned(char *line, uint16_t at, uint16_t number);
uint16_t text_put_signed(char *line, uint16_t at, int16_t number);

#endif
