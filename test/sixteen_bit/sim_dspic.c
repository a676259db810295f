/* Runs one test image for the dsPIC in the instruction-set simulator: its results are our stdout, its exit code is ours.
 *
 * usage: sim_dspic <program.image, by tools/image/load.py> <cycles at most> <table of golden vectors>...
 * Exit code 255: the image did not end as it should; the reason is on stderr. */
#include "iss.h"
#include "iss_image.h"
#include "run_image.h"

enum { PORTS = 0x07F0 };

static iss_t *iss;
static iss_image_t image;

static void write_port(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    (void)context;
    (void)mask;
    if (run_port_write((unsigned)(address - PORTS) / 2u, (uint8_t)value)) {
        iss_request_stop(iss);
    }
}

static uint16_t read_port(void *context, uint16_t address)
{
    (void)context;
    uint16_t value = (address == PORTS + 2 * PORT_BYTE) ? run_port_read() : 0u;
    if (run.mistake != NULL) {
        iss_request_stop(iss);
    }
    return value;
}

/* ---- the run ---- */

static void load(void)
{
    uint32_t *program = iss_program(iss);
    for (size_t word = 0; word < ISS_PROGRAM_WORDS; word++) {
        program[word] = image.program[word];
    }
    iss_program_changed(iss);
    for (uint16_t port = 0; port < PORT_COUNT; port++) {
        iss_sfr_hook(iss, (uint16_t)(PORTS + 2 * port), read_port, write_port, NULL);
    }
    iss_on_symbol(iss, iss_image_name, &image);
    iss_stop_on(iss, ISS_STOP_DEFAULT | 1u << ISS_ERROR_TRAP | 1u << ISS_ERROR_TRAP_CONFLICT);
    iss_reset(iss, CHIP_RESET_POR);
}

int main(int argc, char **argv)
{
    char stack[40];
    if (run_arguments_wrong(argc, argv)) {
        return RUN_FAILED;
    }
    if (iss_image_read(&image, argv[1]) != 0) {
        return run_fail(argv[1], "cannot be read, or is no image as tools/image/load.py writes it");
    }
    iss = iss_create();
    if (iss == NULL) {
        return run_fail(argv[1], "no memory for the simulator");
    }
    load();
    iss_stop_t why = iss_run(iss, strtoull(argv[2], NULL, 10));
    (void)snprintf(stack, sizeof stack, "%u bytes of stack", iss_stack_bytes(iss));
    int code = run_result(argv[1], (why == ISS_STOP_ERROR) ? iss_error(iss) : NULL, iss_cycles(iss), stack);
    iss_destroy(iss);
    iss_image_free(&image);
    return code;
}
