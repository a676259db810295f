/* Storage, start values and look-up of the host's special function registers. */
#include "xc.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HOST_SFR_DEFINE(name, address, start) volatile uint16_t name = (start);
SFR_TABLE(HOST_SFR_DEFINE)

#define HOST_SFR_ROW(name, address, start) {#name, &name, (start)},
host_sfr_t host_sfr_table[] = {SFR_TABLE(HOST_SFR_ROW)};
const size_t host_sfr_count = sizeof host_sfr_table / sizeof host_sfr_table[0];

/* Nothing answers while the firmware runs: a switch to the crystal with PLL "has happened" (COSC = NOSC = 3, LOCK), every pin reads high
 * (buttons released, fault input inactive), the PWM's time base "counts down at 500" for a deadline check, no character waits. */
static const struct { volatile uint16_t *pointer; uint16_t start; } ready[] = {
    {&OSCCON, 0x3320}, {&PORTA, 0x079F}, {&PORTB, 0xFFFF}, {&PORTC, 0x03FF}, {&P1TMR, 0x81F4}, {&U1TXREG, HOST_U1TXREG_EMPTY},
};

/* ---- self-tests ---- */

enum { HOST_ERASED = 0xFFFFFF };
uint32_t host_flash[HOST_FLASH_WORDS];
volatile uint16_t host_free_ram[HOST_FREE_WORDS], host_stack[HOST_STACK_WORDS];
uint16_t host_w_stuck_at_1[HOST_W_REGISTERS], host_w_stuck_at_0[HOST_W_REGISTERS];
uint16_t host_watchdog_counts = 10000;

/* As tools/image/crc.py does: CRC-16 of CCITT, bit by bit, over all before its place. */
static void put_crc(uint32_t place)
{
    uint32_t crc = 0xFFFF;
    for (uint32_t n = 0; n < place; n++) {
        for (unsigned bit = 0; bit < 24; bit++) { /* the low byte first, of each the highest bit */
            uint32_t next = (host_flash[n] >> (8u * (bit / 8u) + 7u - bit % 8u)) & 1u;
            crc = ((crc << 1) ^ ((((crc >> 15) & 1u) ^ next) != 0 ? 0x1021u : 0u)) & 0xFFFFu;
        }
    }
    host_flash[place] = crc;
    host_flash[place + 1] = crc ^ 0xFFFFu;
}

/* Any words, the kept parameters' pages erased. */
static void fill_flash(void)
{
    for (uint32_t n = 0; n < HOST_FLASH_WORDS; n++) {
        host_flash[n] = n < HOST_KEPT_WORD ? (n * 0x9E3779B1u) >> 8 : HOST_ERASED;
    }
    put_crc(HOST_KEPT_WORD - 2);
    put_crc(HOST_FLASH_WORDS - 2);
}

/* ---- the flash programs itself ---- */

uint16_t host_nvm_left = HOST_NVM_FOREVER;
void (*host_power_fails)(void);
static uint32_t latch = HOST_ERASED;
static unsigned latched;

void host_table_write(unsigned offset, uint32_t value, uint32_t mask)
{
    latched = offset / 2u;
    latch = (latch & ~mask) | (value & mask);
}

/* A bit that changes: done or, where the supply fails meanwhile, any. */
static uint32_t changed(uint32_t from, uint32_t to, bool fails)
{
    static uint32_t any = 1;
    any = any * 1664525u + 1013904223u;
    return fails ? (from & any >> 8) | (to & ~(any >> 8) & HOST_ERASED) : to;
}

void host_write_nvm(void)
{
    enum { ERASE_PAGE = 0x4042, PROGRAM_WORD = 0x4003 };
    bool fails = host_nvm_left != HOST_NVM_FOREVER && --host_nvm_left == 0u;
    if (NVMCON == ERASE_PAGE) {
        for (unsigned n = latched & ~(HOST_PAGE_WORDS - 1u), end = n + HOST_PAGE_WORDS; n < end; n++) {
            host_flash[n] = changed(host_flash[n], HOST_ERASED, fails);
        }
    } else if (NVMCON == PROGRAM_WORD) {
        host_flash[latched] = changed(host_flash[latched], host_flash[latched] & latch, fails);
    } else {
        abort(); /* nothing that the firmware may ask for */
    }
    latch = HOST_ERASED;
    if (fails) {
        host_power_fails();
    }
}

int host_kept_load(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return errno == ENOENT ? 0 : -1;
    }
    bool right = fread(host_flash + HOST_KEPT_WORD, sizeof host_flash[0], 2 * HOST_PAGE_WORDS, file) == 2 * HOST_PAGE_WORDS && fgetc(file) == EOF;
    (void)fclose(file);
    if (!right) {
        fill_flash();
    }
    return right ? 0 : -1;
}

int host_kept_save(const char *path)
{
    FILE *file = fopen(path, "wb");
    if (file == NULL) {
        return -1;
    }
    bool right = fwrite(host_flash + HOST_KEPT_WORD, sizeof host_flash[0], 2 * HOST_PAGE_WORDS, file) == 2 * HOST_PAGE_WORDS;
    return fclose(file) == 0 && right ? 0 : -1;
}

/* ---- the processor's own test ---- */

/* The chain of firmware/board/selftest_cpu.c, and its two comparisons. */
volatile uint16_t host_cpu_holds;

void host_cpu_test(void)
{
    host_cpu_holds = 0;
    for (unsigned pattern = 0x5555; pattern <= 0xAAAA; pattern += 0x5555) {
        uint16_t chain = (uint16_t)pattern, first[2] = {(uint16_t)pattern, (uint16_t)pattern};
        for (unsigned n = 0; n < HOST_W_REGISTERS; n++) {
            chain = (uint16_t)((chain | host_w_stuck_at_1[n]) & ~host_w_stuck_at_0[n]);
        }
        for (unsigned n = 0; n < 2; n++) {
            first[n] = (uint16_t)((first[n] | host_w_stuck_at_1[n]) & ~host_w_stuck_at_0[n]);
        }
        if (chain != first[0] || chain != first[1]) {
            host_cpu_holds = 0;
            return;
        }
        host_cpu_holds++;
    }
}

uint16_t host_watchdog_bites(void)
{
    enum { WDTO = 0x0010 };
    TMR1 = (uint16_t)(TMR1 + 100u);
    if (host_watchdog_counts == 0 || TMR1 < host_watchdog_counts) {
        return 0;
    }
    RCON = (uint16_t)(RCON | WDTO);
    return 1;
}

/* The start values stand there before main(). */
__attribute__((constructor)) static void prepare(void)
{
    fill_flash();
    for (size_t i = 0; i < host_sfr_count; i++) {
        for (size_t k = 0; k < sizeof ready / sizeof ready[0]; k++) {
            if (host_sfr_table[i].pointer == ready[k].pointer) {
                host_sfr_table[i].reset = ready[k].start;
            }
        }
        if (host_sfr_table[i].pointer == &SPLIM) { /* as the start-up code leaves it */
            host_sfr_table[i].reset = (uint16_t)(uintptr_t)(host_stack + HOST_STACK_WORDS);
        }
    }
    host_registers_reset();
}

volatile uint16_t host_watchdog_serves;

void host_clear_watchdog(void)
{
    host_watchdog_serves = (uint16_t)(host_watchdog_serves + 1u);
}

void host_registers_reset(void)
{
    host_watchdog_serves = 0;
    for (size_t i = 0; i < host_sfr_count; i++) {
        *host_sfr_table[i].pointer = host_sfr_table[i].reset;
    }
}

volatile uint16_t *host_sfr_find(const char *name)
{
    for (size_t i = 0; i < host_sfr_count; i++) {
        if (strcmp(host_sfr_table[i].name, name) == 0) {
            return host_sfr_table[i].pointer;
        }
    }
    return NULL;
}

void host_write_oscconl(unsigned value)
{
    enum { WRITABLE = 0x00C3, CLOCK_FAIL = 0x0008, KEPT = 0xFF20, LOCK = 0x0020, OSWEN = 0x0001 };
    uint16_t kept = (uint16_t)(OSCCON & (KEPT | CLOCK_FAIL));
    if ((value & CLOCK_FAIL) == 0u) {
        kept = (uint16_t)(kept & ~CLOCK_FAIL); /* CF can only be cleared */
    }
    uint16_t osccon = (uint16_t)(kept | (value & WRITABLE));
    if ((osccon & OSWEN) != 0) {
        uint16_t nosc = (uint16_t)((osccon >> 8) & 7);
        int has_pll = nosc == 1 || nosc == 3;
        osccon = (uint16_t)((osccon & 0x07DE) | (nosc << 12));
        osccon = (uint16_t)(has_pll ? (osccon | LOCK) : (osccon & ~LOCK));
    }
    OSCCON = osccon;
}

void host_write_oscconh(unsigned value)
{
    OSCCON = (uint16_t)((OSCCON & 0x70FFu) | ((value & 7u) << 8));
}

/* The linker's names for the ends of the section fw_ram; without one, nothing can be reached. */
extern uint8_t __start_fw_ram[] __attribute__((weak, visibility("hidden"))), __stop_fw_ram[] __attribute__((weak, visibility("hidden")));

uint8_t *host_window(void)
{
    return __start_fw_ram;
}

size_t host_window_bytes(void)
{
    enum { MOST = 0xF000 };
    size_t bytes = (size_t)((uintptr_t)__stop_fw_ram - (uintptr_t)__start_fw_ram);
    return bytes < MOST ? bytes : MOST;
}
