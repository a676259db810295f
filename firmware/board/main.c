/* The program: initialise, then the background for ever; the control interrupt does the rest. */
#include "board/firmware.h"

int main(void)
{
    firmware_init();
    for (;;) {
        firmware_background();
    }
}
