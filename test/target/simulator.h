/* What the simulator offers a test image, in addresses where the chip has no registers; shared by both sides.
 *
 * Golden vectors are larger than the flash: the simulator holds them, and the image asks for them a row at a time. */
#ifndef TEST_TARGET_SIMULATOR_H
#define TEST_TARGET_SIMULATOR_H

enum {
    SIM_CONSOLE = 0x07F0,   /* write: one character of the results */
    SIM_FINISH = 0x07F2,    /* write: exit code, the run ends here */
    SIM_TABLE = 0x07F4,     /* write: number of a table of golden vectors */
    SIM_PLACE_LOW = 0x07F6, /* write: number of the 16-bit word in it, both halves */
    SIM_PLACE_HIGH = 0x07F8,
    SIM_WORD = 0x07FA       /* read: that word; the place moves on */
};

enum { SIM_UNEXPECTED = 255 }; /* exit code: a trap or an interrupt that nobody has asked for */

#endif
