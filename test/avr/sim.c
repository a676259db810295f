/* Runs one AVR program in simavr: its UART is our stdout, and its end is the exit code that it leaves in GPIOR0.
 *
 * usage: sim <program.elf> <end of its variables> <seconds of simulated time>
 * The second argument is the lowest address that the stack may reach. */
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CLOCK_HZ 16000000u
#define GPIOR0 0x3E /* data address on the ATmega2560 */
#define SPL 0x5D
#define SPH 0x5E

static void put_character(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    (void)parameter;
    putchar((int)(value & 0xFFu));
}

static int fail(const char *program, const char *what)
{
    fflush(stdout);
    fprintf(stderr, "%s: %s\n", program, what);
    return 255; /* the program itself ends with 254 at most */
}

static avr_t *load(const char *path)
{
    elf_firmware_t program;
    uint32_t flags = 0;
    avr_t *avr;

    memset(&program, 0, sizeof program);
    if (elf_read_firmware(path, &program) != 0) {
        return NULL;
    }
    avr = avr_make_mcu_by_name("atmega2560");
    if (avr == NULL || avr_init(avr) != 0) {
        return NULL;
    }
    avr->frequency = CLOCK_HZ;
    avr->log = LOG_ERROR;
    avr_load_firmware(avr, &program);
    (void)avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)AVR_UART_FLAG_STDIO;
    (void)avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), put_character, NULL);
    return avr;
}

int main(int argc, char **argv)
{
    avr_t *avr;
    uint64_t limit;
    uint16_t lowest = UINT16_MAX, variables_end;
    int state = cpu_Running;

    if (argc != 4 || (avr = load(argv[1])) == NULL) {
        return fail("sim", "usage: sim <program.elf> <end of its variables> <seconds>");
    }
    variables_end = (uint16_t)strtoul(argv[2], NULL, 0);
    limit = strtoul(argv[3], NULL, 0) * (uint64_t)CLOCK_HZ;
    while (state != cpu_Done && state != cpu_Crashed && avr->cycle < limit) {
        uint16_t stack;
        state = avr_run(avr);
        stack = (uint16_t)(avr->data[SPL] | avr->data[SPH] << 8);
        if (stack != 0 && stack < lowest) { /* zero until the start-up code has set it */
            lowest = stack;
        }
    }
    if (state == cpu_Crashed) {
        return fail(argv[1], "crashed");
    }
    if (state != cpu_Done) {
        return fail(argv[1], "did not end in the time allowed");
    }
    if (lowest <= variables_end) {
        return fail(argv[1], "the stack ran into the variables");
    }
    fflush(stdout);
    fprintf(stderr, "%llu cycles, %u bytes of stack to spare\n", (unsigned long long)avr->cycle, (unsigned)(lowest - variables_end));
    return avr->data[GPIOR0];
}
