/* Text into a buffer, for the status line. */
#ifndef BOARD_TEXT_H
#define BOARD_TEXT_H

#include <stdint.h>

/** Each writes from `at` on, without a closing zero, and returns where the next text goes. The caller has room. */
char *text_put(char *at, const char *text);
char *text_put_unsigned(char *at, uint16_t number);
char *text_put_signed(char *at, int16_t number);

/** What other texts end with: XC16's linker has no part of a text in common with another. */
extern const char text_record_fault[sizeof "record fault "];
#define TEXT_FAULT (text_record_fault + sizeof "record" - 1)
#define TEXT_BLANK (text_record_fault + sizeof "record fault" - 1)

/** The line's end. */
char *text_end(char *at);

/** A text and a number behind it, in one call: the lines have many of them. */
char *text_put_named(char *at, const char *name, int16_t number);

#endif
