/* The simulators' common part: the ports' side of ports.h, and how a run ends. */
#ifndef TEST_RUN_IMAGE_H
#define TEST_RUN_IMAGE_H

#include "ports.h"

#include <stdbool.h>
#include <stdint.h>
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
        (void)run_fail(argv[0], "usage: <program.elf> <cycles at most> <table of golden vectors>...");
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

#endif
