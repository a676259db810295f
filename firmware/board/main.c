/* The program: initialise, then the background for ever; the interrupts do the rest. */
#include "board/firmware.h"
#include "board/selftest_cpu.h"

int main(void)
{
#ifndef SELFTEST_OFF
    (void)board_free_ram(); /* the test of the RAM reads the stack, also what a function leaves unused */
#endif
    firmware_init();
    for (;;) {
        firmware_background();
    }
}
