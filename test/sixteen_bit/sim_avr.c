/* Runs one test image for an ATmega2560 in simavr: its results are our stdout, its exit code is ours.
 *
 * usage: sim_avr <program.elf> <cycles at most> <table of golden vectors>...
 * Exit code 255: the image did not end as it should; the reason is on stderr. */
#include "run_image.h"

#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>

#include <string.h>

enum { PORTS = 0xE0, RAM = 0x200, SPL = 0x5D, SPH = 0x5E }; /* data addresses */

static void write_port(avr_t *avr, avr_io_addr_t address, uint8_t value, void *context)
{
    (void)context;
    if (run_port_write(address - PORTS, value)) {
        avr->state = cpu_Done;
    }
}

static uint8_t read_port(avr_t *avr, avr_io_addr_t address, void *context)
{
    uint8_t value = run_port_read();
    (void)address;
    (void)context;
    if (run.mistake != NULL) {
        avr->state = cpu_Done;
    }
    return value;
}

/** @param variables_end where to write the lowest address that the stack may reach @return NULL: no image for this chip */
static avr_t *load(const char *path, uint16_t *variables_end)
{
    elf_firmware_t program;
    avr_t *avr = avr_make_mcu_by_name("atmega2560");
    memset(&program, 0, sizeof program);
    if (avr == NULL || elf_read_firmware(path, &program) != 0 || avr_init(avr) != 0) {
        return NULL;
    }
    *variables_end = (uint16_t)(RAM + program.datasize + program.bsssize);
    avr->log = LOG_ERROR;
    avr_load_firmware(avr, &program);
    for (avr_io_addr_t port = PORTS; port < PORTS + PORT_COUNT; port++) {
        avr_register_io_write(avr, port, write_port, NULL);
    }
    avr_register_io_read(avr, PORTS + PORT_BYTE, read_port, NULL);
    return avr;
}

int main(int argc, char **argv)
{
    avr_t *avr;
    uint64_t limit;
    uint16_t lowest = UINT16_MAX, variables_end = 0;
    int state = cpu_Running;
    char stack[40];
    if (run_arguments_wrong(argc, argv)) {
        return RUN_FAILED;
    }
    avr = load(argv[1], &variables_end);
    if (avr == NULL) {
        return run_fail(argv[1], "is no program for the ATmega2560");
    }
    limit = strtoull(argv[2], NULL, 10);
    while (state != cpu_Done && state != cpu_Crashed && avr->cycle < limit) {
        state = avr_run(avr);
        uint16_t pointer = (uint16_t)(avr->data[SPL] | avr->data[SPH] << 8);
        if (pointer != 0 && pointer < lowest) { /* zero until the start-up code has set it */
            lowest = pointer;
        }
    }
    (void)snprintf(stack, sizeof stack, "%d bytes of stack to spare\n", lowest - variables_end);
    return run_result(argv[1], (state == cpu_Crashed) ? "crashed" : (lowest <= variables_end) ? "the stack ran into the variables" : NULL,
                      avr->cycle, stack);
}
