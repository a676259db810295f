/* Unity's output on the AVR: characters go to UART0; a program that ends leaves its exit code in GPIOR0 and stops the processor. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "unity_config.h"

void console_put(int c)
{
    UCSR0A = (uint8_t)(1u << U2X0); /* fastest: the divider is at its reset value of zero */
    UCSR0B = (uint8_t)(1u << TXEN0);
    while ((UCSR0A & (1u << UDRE0)) == 0u) {
    }
    UDR0 = (uint8_t)c;
}

int test_main(void);

int main(void)
{
    int failures = test_main();
    while ((UCSR0A & (1u << UDRE0)) == 0u) {
    }
    GPIOR0 = (uint8_t)(failures > 254 ? 254 : failures);
    cli(); /* asleep with interrupts off: the simulator ends here */
    sleep_enable();
    for (;;) {
        sleep_cpu();
    }
}
