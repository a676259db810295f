/* Runs one test image for the dsPIC in the instruction-set simulator: its results are our stdout, its exit code is ours.
 *
 * usage: sim_dspic <program.image, by tools/image/load.py> <cycles at most> <table of golden vectors>...
 * Exit code 255: the image did not end as it should; the reason is on stderr. */
#include "iss.h"
#include "iss_image.h"
#include "ports.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

enum { RUN_FAILED = 255, RUN_TABLES = 128 };

typedef struct {
    uint8_t *data;
    size_t bytes;
} run_table_t;

static struct {
    run_table_t table[RUN_TABLES];
    unsigned tables, chosen;
    uint32_t place;
    int exit_code;        /* -1: not ended */
    const char *mistake;  /* NULL: none */
} run = { .exit_code = -1 };

/** Says what is wrong with the program. @return the simulator's exit code */
static int run_fail(const char *program, const char *what)
{
    (void)fflush(stdout);
    (void)fprintf(stderr, "%s: %s\n", program, what);
    return RUN_FAILED;
}

/** Reads the golden vectors that the arguments name. @return true: an argument cannot be used, and why was said */
static bool run_arguments_wrong(int argc, char **argv)
{
    if (argc < 3 || argc - 3 > RUN_TABLES) {
        (void)run_fail(argv[0], "usage: <program.image> <cycles at most> <table of golden vectors>...");
        return true;
    }
    for (int n = 3; n < argc; n++) {
        run_table_t *table = &run.table[run.tables++];
        FILE *file = fopen(argv[n], "rb");
        long size = (file != NULL && fseek(file, 0, SEEK_END) == 0) ? ftell(file) : -1;
        table->data = (size >= 0) ? malloc((size_t)size + 1u) : NULL;
        if (table->data == NULL || fseek(file, 0, SEEK_SET) != 0 || fread(table->data, 1, (size_t)size, file) != (size_t)size) {
            (void)run_fail(argv[n], "cannot be read");
            return true;
        }
        table->bytes = (size_t)size;
        (void)fclose(file);
    }
    return false;
}

/** The image writes a port. @return true: the run ends */
static bool run_port_write(unsigned port, uint8_t value)
{
    switch (port) {
    case PORT_CONSOLE: (void)putchar(value); break;
    case PORT_FINISH: run.exit_code = value; break;
    case PORT_TABLE: run.chosen = value; break;
    case PORT_PLACE: run.place = run.place << 8 | value; break;
    default: break;
    }
    return run.exit_code >= 0;
}

/** The image reads PORT_BYTE; where no byte is, run.mistake says so. */
static uint8_t run_port_read(void)
{
    if (run.chosen >= run.tables || run.place >= run.table[run.chosen].bytes) {
        run.mistake = "asks for golden vectors that do not exist";
        return 0;
    }
    return run.table[run.chosen].data[run.place++];
}

/** Why the run ended. @param error of the simulator, or NULL @return the exit code */
static int run_result(const char *program, const char *error, uint64_t cycles, const char *stack)
{
    const char *wrong = (error != NULL) ? error
        : (run.mistake != NULL) ? run.mistake
        : (run.exit_code < 0) ? "did not end in the cycles allowed"
        : (run.exit_code == PORT_UNEXPECTED) ? "took a trap or an interrupt that nobody has asked for" : NULL;
    if (wrong != NULL) {
        return run_fail(program, wrong);
    }
    (void)fflush(stdout);
    (void)fprintf(stderr, "%llu cycles, %s", (unsigned long long)cycles, stack);
    return run.exit_code;
}

/* ---- the chip ---- */

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
