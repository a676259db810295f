/* What the simulator offers a test image, in addresses where the chip has no registers: bytes out, bytes in, shared by both sides.
 *
 * Golden vectors are larger than the flash: the simulator holds them, and the image asks for them a row at a time. */
#ifndef TEST_PORTS_H
#define TEST_PORTS_H

#include <stdint.h>

#define PORTS 0x07F0
#define PORT(number) (*(volatile unsigned int *)(PORTS + 2 * (number)))

enum {
    PORT_CONSOLE, /* write: one character of the results */
    PORT_FINISH,  /* write: exit code, the run ends here */
    PORT_TABLE,   /* write: number of a table of golden vectors */
    PORT_PLACE,   /* write: number of a byte in it, the highest eight bits first */
    PORT_BYTE,    /* read: that byte; the place moves on */
    PORT_COUNT
};

enum { PORT_UNEXPECTED = 255 }; /* exit code: a trap or an interrupt that nobody has asked for */

/** In the image: copies a row of a table.
 *  @param table its number
 *  @param place of the row's first 16-bit word in the table
 *  @param words of a row */
void golden_fetch(uint16_t table, uint32_t place, void *row, uint16_t words);

#endif
