/* A test image's side of the simulator: Unity's characters go out, golden vectors come in, the exit code ends the run. */
#include "ports.h"
#include "unity.h"

int test_main(void);

void __attribute__((weak)) setUp(void)
{
}

void __attribute__((weak)) tearDown(void)
{
}

void console_put(int c)
{
    PORT(PORT_CONSOLE) = (uint8_t)c;
}

void golden_fetch(uint16_t table, uint32_t place, void *row, uint16_t words)
{
    uint8_t *to = row;
    int8_t shift;
    PORT(PORT_TABLE) = (uint8_t)table;
    for (shift = 24; shift >= 0; shift = (int8_t)(shift - 8)) {
        PORT(PORT_PLACE) = (uint8_t)(2u * place >> shift);
    }
    for (words = (uint16_t)(2u * words); words > 0u; words--) {
        *to++ = (uint8_t)PORT(PORT_BYTE);
    }
}

static void finish(uint8_t code)
{
    for (;;) {
        PORT(PORT_FINISH) = code;
    }
}

void __attribute__((interrupt, no_auto_psv)) _DefaultInterrupt(void);

void _DefaultInterrupt(void)
{
    finish(PORT_UNEXPECTED);
}

int main(void)
{
    int failures = test_main();
    finish((uint8_t)((failures > PORT_UNEXPECTED - 1) ? PORT_UNEXPECTED - 1 : failures));
    return 0;
}
