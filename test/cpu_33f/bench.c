/* How fast the simulator is on one core: an integer loop, a DSP loop, and, given its image, the firmware with an interrupt every 50 us. */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "iss_cpu.h"

enum {
    START = 0x200,
    PERIOD = 2000,                     /* cycles of 50 us */
    ZERO_CURRENT = 0, BUS_24_V = -3072, HALF_POT = 0, /* ADC results, signed fractional */
    S2_PORT = 0, S2_BIT = 8            /* RA8, low while it is pressed */
};

/* Squares of an array, scaled, summed, with a branch in 8 instructions. */
static const uint32_t integer_loop[] = {
    0x209001, /* start: mov #0x0900,w1 */
    0x209804, /* mov #0x0980,w4 */
    0x2001F5, /* mov #31,w5 */
    0x780131, /* loop: mov [w1++],w2 */
    0xB99302, /* mul.ss w2,w2,w6 */
    0xDEB343, /* asr w6,#3,w6 */
    0x439A06, /* add w7,w6,[w4++] */
    0xE13005, /* cp w6,w5 */
    0x3C0001, /* bra gt,skip */
    0x530305, /* sub w6,w5,w6 */
    0x885006, /* skip: mov w6,0x0A00 */
    0xE90285, /* dec w5,w5 */
    0x3AFFF6, /* bra nz,loop */
    0x37FFF2, /* bra start */
};

/* A filter: products under DO and under REPEAT. */
static const uint32_t dsp_loop[] = {
    0x209008, /* start: mov #0x0900,w8 */
    0x20D00A, /* mov #0x0D00,w10 */
    0xC30446, /* clr a,[w8]+=2,w4,[w10]+=2,w5 */
    0x08000F, /* do #15,end */
    0x000001,
    0xC00446, /* mac w4*w5,a,[w8]+=2,w4,[w10]+=2,w5 */
    0xC00446, /* end: the same */
    0xCD0000, /* sac.r a,w0 */
    0x09000F, /* repeat #15 */
    0xC00446, /* the same */
    0x37FFF5, /* bra start */
};

static double seconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void print(const char *what, double instructions, double cycles, double time_s)
{
    printf("%-46s %7.1f million instructions/s, %6.1f million cycles/s\n", what, 1e-6 * instructions / time_s, 1e-6 * cycles / time_s);
}

static int fail(const char *text)
{
    (void)fprintf(stderr, "foc33: %s\n", text);
    return 2;
}

/* The loop alone, for `millions` of cycles. */
static int bench_loop(const char *what, const uint32_t *words, size_t count, unsigned millions)
{
    iss_t *iss = iss_create();
    if (iss == NULL) {
        return fail("no memory for the simulator, iss-bench: free some");
    }
    for (size_t n = 0; n < count; n++) {
        (void)iss_write_program(iss, (uint32_t)(START + 2u * n), words[n]);
    }
    iss_ram_known(iss, ISS_RAM_START, ISS_RAM_END - ISS_RAM_START, true);
    iss_set_w_known(iss, 0xFFFF);
    iss_set_pc(iss, START);
    double start_s = seconds();
    iss_stop_t stop = iss_run(iss, 1000000ull * millions);
    print(what, (double)iss_instructions(iss), (double)iss_cycles(iss), seconds() - start_s);
    int result = stop == ISS_STOP_NONE ? 0 : fail(iss_error(iss));
    iss_destroy(iss);
    return result;
}

/* ---- the firmware without a motor: constant samples, S2 pressed once ---- */

static bool s2_down;

static void levels(void *context, uint16_t level[3])
{
    (void)context;
    level[S2_PORT] = s2_down ? (uint16_t)(0xFFFFu & ~(1u << S2_BIT)) : (uint16_t)0xFFFFu;
}

static uint16_t counting_down(iss_cpu_t *cpu)
{
    (void)cpu;
    return 0x81F4;
}

static int run_firmware(iss_cpu_t *cpu, unsigned periods)
{
    static const int16_t samples[4] = {HALF_POT, ZERO_CURRENT, ZERO_CURRENT, BUS_24_V};
    for (unsigned n = 0; n < periods; n++) {
        memcpy(iss_data(cpu->iss) + SFR_ADC1BUF0 / 2, samples, sizeof samples);
        (void)chip_irq_raise(cpu->chip, CHIP_IRQ_ADC1);
        uint64_t end = iss_cycles(cpu->iss) + PERIOD;
        while (iss_cycles(cpu->iss) < end) {
            iss_stop_t stop = iss_cpu_run(cpu, end);
            if (stop == ISS_STOP_ERROR) {
                return fail(iss_error(cpu->iss));
            }
        }
    }
    return 0;
}

static int bench_firmware(const char *path)
{
    static iss_image_t image;
    static iss_cpu_t cpu;
    static chip_t chip;
    const chip_board_t board = {.levels = levels};
    chip_cpu_t functions = {.reset = NULL};
    if (iss_image_read(&image, path) != 0 || !iss_cpu_create(&cpu, &image, &functions) || !chip_connect(&chip, &functions, &board, NULL)) {
        return fail("the image cannot be used, iss-bench: build it with make firmware");
    }
    cpu.counter = counting_down;
    iss_cpu_connect(&cpu, &chip, &image);
    iss_stop_on(cpu.iss, ISS_STOP_DEFAULT & ~(1u << ISS_ERROR_UNKNOWN_RAM)); /* variables kept over a reset are looked at */
    int result = run_firmware(&cpu, 4000);
    s2_down = true;
    result = result != 0 ? result : run_firmware(&cpu, 1500);
    s2_down = false;
    double instructions = (double)iss_instructions(cpu.iss), cycles = (double)iss_cycles(cpu.iss), start_s = seconds();
    result = result != 0 ? result : run_firmware(&cpu, 20000);
    double time_s = seconds() - start_s;
    cycles = (double)iss_cycles(cpu.iss) - cycles;
    if (result == 0) {
        print("the firmware, interrupt every 50 us", (double)iss_instructions(cpu.iss) - instructions, cycles, time_s);
        printf("that is %.1f times real time at 40 MIPS\n", cycles / 40e6 / time_s);
    }
    iss_cpu_destroy(&cpu);
    iss_image_free(&image);
    return result;
}

int main(int count, char **arguments)
{
    int result = bench_loop("integer loop", integer_loop, sizeof integer_loop / sizeof integer_loop[0], 200);
    if (result == 0) {
        result = bench_loop("DSP loop (MAC with two prefetches)", dsp_loop, sizeof dsp_loop / sizeof dsp_loop[0], 200);
    }
    if (result == 0 && count > 1) {
        result = bench_firmware(arguments[1]);
    }
    if (count < 2) {
        puts("the firmware: not measured, build/target/foc33.elf does not exist (make firmware)");
    }
    return result;
}
