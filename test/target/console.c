/* A test image's side of the simulator: Unity's characters go out, golden vectors come in, the exit code ends the run. */
#include "golden_fetch.h"
#include "simulator.h"
#include "unity_config.h"

#define REGISTER(address) (*(volatile uint16_t *)(address))

void __attribute__((interrupt, no_auto_psv)) _DefaultInterrupt(void);
int test_main(void);

void console_put(int c)
{
    REGISTER(SIM_CONSOLE) = (uint16_t)c;
}

void golden_fetch(uint16_t table, uint32_t place, void *row, uint16_t words)
{
    uint16_t *to = row;
    REGISTER(SIM_TABLE) = table;
    REGISTER(SIM_PLACE_LOW) = (uint16_t)place;
    REGISTER(SIM_PLACE_HIGH) = (uint16_t)(place >> 16);
    while (words-- > 0u) {
        *to++ = REGISTER(SIM_WORD);
    }
}

static void finish(uint16_t code)
{
    REGISTER(SIM_FINISH) = code;
    for (;;) {
    }
}

void _DefaultInterrupt(void)
{
    finish(SIM_UNEXPECTED);
}

int main(void)
{
    int failures = test_main();
    finish((uint16_t)((failures > SIM_UNEXPECTED - 1) ? SIM_UNEXPECTED - 1 : failures));
    return 0;
}
