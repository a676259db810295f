/* Runs one test image in the instruction-set simulator: its results are our stdout, its exit code is ours.
 *
 * usage: target-test <program.elf> <cycles at most> <table of golden vectors>...
 * Exit code 255: the image did not end as it should; the reason is on stderr. */
#include "image.h"
#include "iss.h"
#include "simulator.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FAILED = 255, TABLES = 128 };

typedef struct {
    uint8_t *data;
    size_t words;
} table_t;

typedef struct {
    iss_t *iss;
    image_t image;
    table_t table[TABLES];
    unsigned tables, chosen;
    uint32_t place;
    int exit_code;        /* -1: not ended */
    const char *mistake;  /* NULL: none */
} run_t;

static run_t run = {.exit_code = -1};

static int fail(const char *program, const char *what)
{
    (void)fflush(stdout);
    (void)fprintf(stderr, "%s: %s\n", program, what);
    return FAILED;
}

static bool read_table(const char *path, table_t *table)
{
    FILE *file = fopen(path, "rb");
    long size = -1;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
        size = ftell(file);
        rewind(file);
    }
    table->data = size >= 0 ? malloc((size_t)size + 1u) : NULL;
    bool good = table->data != NULL && fread(table->data, 1, (size_t)size, file) == (size_t)size;
    table->words = good ? (size_t)size / 2u : 0u;
    if (file != NULL) {
        (void)fclose(file);
    }
    return good;
}

/* ---- the registers of simulator.h ---- */

static void stop(int code)
{
    run.exit_code = code;
    iss_request_stop(run.iss);
}

static void write_register(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    (void)context;
    (void)mask;
    switch (address) {
    case SIM_CONSOLE: (void)putchar(value & 0xFF); break;
    case SIM_FINISH: stop(value); break;
    case SIM_TABLE: run.chosen = value; break;
    case SIM_PLACE_LOW: run.place = (run.place & 0xFFFF0000u) | value; break;
    case SIM_PLACE_HIGH: run.place = (run.place & 0xFFFFu) | (uint32_t)value << 16; break;
    default: break;
    }
}

static uint16_t read_register(void *context, uint16_t address)
{
    (void)context;
    if (address != SIM_WORD) {
        return 0;
    }
    if (run.chosen >= run.tables || run.place >= run.table[run.chosen].words) {
        run.mistake = "asks for golden vectors that do not exist";
        stop(FAILED);
        return 0;
    }
    const uint8_t *byte = run.table[run.chosen].data + 2u * (size_t)run.place++;
    return (uint16_t)(byte[0] | byte[1] << 8);
}

static const char *symbol(void *context, bool data, uint32_t address, uint32_t *offset)
{
    (void)context;
    const image_symbol_t *found = image_symbol_at(&run.image, data ? IMAGE_DATA : IMAGE_CODE, address);
    if (found == NULL) {
        return NULL;
    }
    *offset = address - found->address;
    return found->name;
}

/* ---- the run ---- */

static void load(void)
{
    uint32_t *program = iss_program(run.iss);
    for (size_t word = 0; word < IMAGE_WORDS; word++) {
        program[word] = run.image.program[word];
    }
    iss_program_changed(run.iss);
    for (uint16_t address = SIM_CONSOLE; address <= SIM_WORD; address = (uint16_t)(address + 2u)) {
        iss_sfr_hook(run.iss, address, read_register, write_register, NULL);
    }
    iss_on_symbol(run.iss, symbol, NULL);
    iss_stop_on(run.iss, ISS_STOP_DEFAULT | 1u << ISS_ERROR_TRAP | 1u << ISS_ERROR_TRAP_CONFLICT);
    iss_reset(run.iss, ISS_RESET_POR);
}

static int finish(const char *program, iss_stop_t why)
{
    if (why == ISS_STOP_ERROR) {
        return fail(program, iss_error(run.iss));
    }
    if (run.mistake != NULL) {
        return fail(program, run.mistake);
    }
    if (run.exit_code < 0) {
        return fail(program, "did not end in the cycles allowed");
    }
    if (run.exit_code >= SIM_UNEXPECTED) {
        return fail(program, "took a trap or an interrupt that nobody has asked for");
    }
    (void)fflush(stdout);
    (void)fprintf(stderr, "%llu cycles, %u bytes of stack", (unsigned long long)iss_cycles(run.iss), iss_stack_bytes(run.iss));
    return run.exit_code;
}

int main(int argc, char **argv)
{
    if (argc < 3 || argc - 3 > TABLES) {
        return fail("target-test", "usage: target-test <program.elf> <cycles at most> <table of golden vectors>...");
    }
    for (int n = 3; n < argc; n++) {
        if (!read_table(argv[n], &run.table[run.tables++])) {
            return fail(argv[n], "cannot be read");
        }
    }
    if (image_load(&run.image, argv[1]) != 0) {
        return fail(argv[1], run.image.error);
    }
    run.iss = iss_create();
    if (run.iss == NULL) {
        return fail(argv[1], "no memory for the simulator");
    }
    load();
    iss_stop_t why = iss_run(run.iss, strtoull(argv[2], NULL, 10));
    int code = finish(argv[1], why);
    iss_destroy(run.iss);
    image_free(&run.image);
    for (unsigned n = 0; n < run.tables; n++) {
        free(run.table[n].data);
    }
    return code;
}
