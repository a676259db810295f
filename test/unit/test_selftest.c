/* Self-tests that see no register, each with the faults that it must find: memory, CRC, order of the slow work's parts, variables kept twice. */
#include "drive_rig.h"

/* ---- memory with one fault, behind the firmware's own accesses ---- */

typedef enum { HEALTHY, STUCK, NO_RISE, NO_FALL, INVERTS, FORCES, SHARES, OTHER_CELL } kind_t;
typedef struct {
    kind_t kind;
    uint16_t victim, bit, aggressor, aggressor_bit, rises, value; /* cells, bits; the change of the aggressor that counts; what it forces */
} defect_t;

#define CELLS 12u
static uint16_t cells[CELLS];
static defect_t defect;
static uint16_t reads, writes;

static uint16_t bit_of(uint16_t cell, uint16_t bit)
{
    return (uint16_t)((cells[cell] >> bit) & 1u);
}

static void put_bit(uint16_t cell, uint16_t bit, uint16_t value)
{
    cells[cell] = (uint16_t)((cells[cell] & ~(1u << bit)) | (unsigned)(value << bit));
}

static uint16_t decoded(uint16_t cell)
{
    return (defect.kind == OTHER_CELL && cell == defect.victim) ? defect.aggressor : cell;
}

static uint16_t test_read(volatile uint16_t *at)
{
    uint16_t cell = decoded((uint16_t)(at - cells));
    reads++;
    return cells[cell];
}

static void test_write(volatile uint16_t *at, uint16_t value)
{
    uint16_t cell = decoded((uint16_t)(at - cells)), before = cells[cell], victim = bit_of(defect.victim, defect.bit);
    uint16_t changed = (uint16_t)(((before ^ value) >> defect.aggressor_bit) & 1u), rises = (uint16_t)((value >> defect.aggressor_bit) & 1u);
    writes++;
    cells[cell] = value;
    if (defect.kind == STUCK) {
        put_bit(defect.victim, defect.bit, defect.value);
    } else if (cell == defect.victim && ((defect.kind == NO_RISE && !victim) || (defect.kind == NO_FALL && victim))) {
        put_bit(cell, defect.bit, victim);
    } else if (cell == defect.aggressor && changed && rises == defect.rises && defect.kind == INVERTS) {
        put_bit(defect.victim, defect.bit, (uint16_t)!bit_of(defect.victim, defect.bit));
    } else if (cell == defect.aggressor && changed && rises == defect.rises && defect.kind == FORCES) {
        put_bit(defect.victim, defect.bit, defect.value);
    } else if (cell == defect.aggressor && defect.kind == SHARES) {
        cells[defect.victim] = value; /* the decoder opens two cells */
    } else {
        /* healthy */
    }
}

#define SELFTEST_READ(cell) test_read(cell)
#define SELFTEST_WRITE(cell, value) test_write(cell, value)
#include "firmware/drive/selftest.c"

static volatile uint16_t spare[CELLS];

static uint16_t march(uint16_t n)
{
    return selftest_march(cells, CELLS, selftest_backgrounds[n], spare);
}

/** 1 if any of the backgrounds finds it. */
static uint16_t any_march(void)
{
    uint16_t n, found = 0;
    for (n = 0; n < SELFTEST_BACKGROUNDS; n++) {
        found |= (uint16_t)(march(n) != 0u);
    }
    return found;
}

void setUp(void)
{
    static const defect_t none;
    uint16_t n;
    defect = none;
    for (n = 0; n < CELLS; n++) {
        cells[n] = (uint16_t)(n * 0x1357u);
    }
    reads = 0;
    writes = 0;
    rig_power_up();
}

void test_healthy_memory_passes_and_keeps_what_it_held(void)
{
    uint16_t n, k;
    for (n = 0; n < SELFTEST_BACKGROUNDS; n++) {
        TEST_ASSERT_EQUAL_HEX16(0, march(n));
        for (k = 0; k < CELLS; k++) {
            TEST_ASSERT_EQUAL_HEX16(k * 0x1357u, cells[k]);
        }
    }
    reads = 0;
    writes = 0;
    TEST_ASSERT_EQUAL_HEX16(0, selftest_march(cells, CELLS, 0x0F0F, 0));
    TEST_ASSERT_EQUAL_UINT16(5u * CELLS, reads); /* March C-: ten operations a cell */
    TEST_ASSERT_EQUAL_UINT16(5u * CELLS, writes);
    TEST_ASSERT_EQUAL_HEX16(0, selftest_march(cells, 0, 0x0F0F, spare));
}

void test_each_bit_that_is_stuck_or_does_not_change_is_found_with_each_background(void)
{
    static const kind_t kinds[] = { STUCK, NO_RISE, NO_FALL };
    EACH(k, kinds) {
        for (uint16_t n = 0; n < CELLS * 16u * 2u * SELFTEST_BACKGROUNDS; n++) {
            setUp();
            defect.kind = kinds[k];
            defect.value = n & 1u;
            defect.bit = (n >> 1) & 15u;
            defect.victim = (uint16_t)((n >> 5) % CELLS);
            TEST_ASSERT_EQUAL_HEX16(1u << defect.bit, march((uint16_t)((n >> 5) / CELLS)));
        }
    }
}

void test_a_cell_that_changes_another_is_found_with_each_background(void)
{
    static const kind_t kinds[] = { INVERTS, FORCES, SHARES, OTHER_CELL };
    EACH(k, kinds) {
        for (uint16_t pair = 0; pair < CELLS * CELLS; pair++) {
            for (uint16_t n = 0; n < 4u * SELFTEST_BACKGROUNDS && pair % CELLS != pair / CELLS; n++) {
                setUp();
                defect.kind = kinds[k];
                defect.victim = pair % CELLS;
                defect.aggressor = pair / CELLS;
                defect.bit = 5;
                defect.aggressor_bit = 5;
                defect.rises = n & 1u;
                defect.value = (n >> 1) & 1u;
                TEST_ASSERT_NOT_EQUAL_UINT16(0, march(n >> 2));
            }
        }
    }
}

void test_bits_of_a_word_that_change_each_other_are_found_with_one_of_the_backgrounds(void)
{
    for (uint16_t pair = 0; pair < 256u; pair++) {
        for (uint16_t n = 0; n < 4u && pair % 16u != pair / 16u; n++) {
            setUp();
            defect.kind = FORCES;
            defect.victim = 3;
            defect.aggressor = 3;
            defect.bit = pair % 16u;
            defect.aggressor_bit = pair / 16u;
            defect.rises = n & 1u;
            defect.value = n >> 1;
            TEST_ASSERT_EQUAL_UINT16(1, any_march());
        }
    }
}

/* ---- CRC ---- */

static uint16_t crc_of(const uint8_t *bytes, uint16_t count)
{
    uint16_t crc = SELFTEST_CRC_START, n;
    for (n = 0; n < count; n++) {
        crc = selftest_crc(crc, bytes[n]);
    }
    return crc;
}

void test_crc_is_that_of_ccitt(void)
{
    static const uint8_t check[] = { '1', '2', '3', '4', '5', '6', '7', '8', '9' };
    TEST_ASSERT_EQUAL_HEX16(0x29B1, crc_of(check, sizeof check)); /* the catalogue's check value */
}

void test_crc_changes_with_one_two_and_three_bits_and_every_burst_of_sixteen(void)
{
    uint8_t bytes[24] = { 0 };
    uint16_t right = crc_of(bytes, sizeof bytes), a, b;
    for (a = 0; a < 24u * 8u; a++) {
        bytes[a >> 3] ^= (uint8_t)(1u << (a & 7u));
        TEST_ASSERT_NOT_EQUAL_UINT16(right, crc_of(bytes, sizeof bytes));
        for (b = 0; b < a; b++) {
            bytes[b >> 3] ^= (uint8_t)(1u << (b & 7u));
            TEST_ASSERT_NOT_EQUAL_UINT16(right, crc_of(bytes, sizeof bytes));
            bytes[b >> 3] ^= (uint8_t)(1u << (b & 7u));
        }
        bytes[a >> 3] ^= (uint8_t)(1u << (a & 7u));
    }
    for (a = 1; a != 0u; a++) { /* each pattern of 16 bits in one place */
        bytes[7] = (uint8_t)(a >> 8);
        bytes[8] = (uint8_t)a;
        TEST_ASSERT_NOT_EQUAL_UINT16(right, crc_of(bytes, sizeof bytes));
    }
}

/* ---- order of the slow work's parts ---- */

void test_the_parts_of_the_slow_work_hold_their_order_in_every_state(void)
{
    uint16_t n;
    TEST_ASSERT_EQUAL_UINT16(1, selftest_flow_holds(&drive)); /* before the first period, too */
    for (n = 0; n < 1100u; n++) { /* calibration, stop */
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(1, selftest_flow_holds(&drive));
    }
    drive_start(&drive, &params, 1);
    for (n = 0; n < 30000u; n++) {
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(1, selftest_flow_holds(&drive));
    }
    drive_raise(&drive, FAULT_STALL);
    for (n = 0; n < 20u; n++) {
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(1, selftest_flow_holds(&drive));
    }
}

void test_the_order_holds_where_the_ticks_wrap(void)
{
    uint32_t n;
    for (n = 0; n < 70000ul; n++) {
        drive.ticks = (uint16_t)(drive.ticks + 1u);
        if ((drive.ticks & 1u) == 0u) {
            SELFTEST_MARK(&drive, (drive.ticks / 2u) & 15u);
        }
        TEST_ASSERT_EQUAL_UINT16(1, selftest_flow_holds(&drive));
    }
}

void test_a_part_that_is_missing_doubled_or_in_the_place_of_another_is_found_whenever_one_looks(void)
{
    uint16_t part, other, later, periods;
    for (part = 0; part < 16u; part++) {
        for (other = 0; other < 16u; other++) {
            for (later = 0; later < 40u && other != part; later += 13u) {
                rig_power_up();
                rig_tick((uint16_t)(1024u + 2u * part));
                drive.selftest.phases = (uint16_t)(drive.selftest.phases - part + other);
                rig_tick(later);
                TEST_ASSERT_EQUAL_UINT16(0, selftest_flow_holds(&drive));
            }
        }
    }
    for (periods = 1; periods < 32u; periods++) { /* without slow work, or the other way round; all 32 of them would not show */
        rig_ready();
        drive.ticks = (uint16_t)(drive.ticks + periods);
        TEST_ASSERT_EQUAL_UINT16(periods == 1u, selftest_flow_holds(&drive)); /* an odd period has none */
    }
}

void test_a_changed_bit_of_the_ticks_or_of_the_sum_is_found_but_for_the_ticks_lowest_and_the_sums_highest_two(void)
{
    for (uint16_t bit = 0; bit < 16u; bit++) {
        rig_ready();
        drive.ticks ^= (uint16_t)(1u << bit);
        rig_tick(100);
        TEST_ASSERT_EQUAL_UINT16(bit == 0u, selftest_flow_holds(&drive)); /* the next slow work comes a period sooner or later, in its order */
        rig_ready();
        drive.selftest.phases ^= (uint16_t)(1u << bit);
        rig_tick(100);
        TEST_ASSERT_EQUAL_UINT16(bit >= 14u, selftest_flow_holds(&drive)); /* those of all 65536 ticks are 0xC000 */
    }
}

/* ---- variables that are kept twice ---- */

void test_what_is_kept_twice_agrees_in_every_state_and_direction(void)
{
    uint16_t n, states = 0;
    TEST_ASSERT_EQUAL_UINT16(1, selftest_variables_hold(&drive));
    EACH_DIRECTION(direction) {
        rig_power_up();
        rig_currents(40, -30);
        for (n = 0; n < 1100u; n++) {
            rig_tick(1);
            states |= (uint16_t)(1u << drive.state);
            TEST_ASSERT_EQUAL_UINT16(1, selftest_variables_hold(&drive));
        }
        TEST_ASSERT_NOT_EQUAL_INT16(0, drive.calibration.offset_a_q13);
        drive_start(&drive, &params, direction);
        for (n = 0; n < 30000u; n++) {
            rig_tick(1);
            states |= (uint16_t)(1u << drive.state);
            TEST_ASSERT_EQUAL_UINT16(1, selftest_variables_hold(&drive));
        }
        drive_raise(&drive, FAULT_STALL);
        states |= (uint16_t)(1u << drive.state);
        TEST_ASSERT_EQUAL_UINT16(1, selftest_variables_hold(&drive));
        drive.command.clear_fault = 1;
        rig_tick(1);
        TEST_ASSERT_EQUAL_UINT16(1, selftest_variables_hold(&drive));
    }
    TEST_ASSERT_EQUAL_HEX16((1u << DRIVE_STATE_COUNT) - 1u - (1u << DRIVE_CATCH) - (1u << DRIVE_BRAKE), states);
}

void test_each_bit_of_what_is_kept_twice_is_compared(void)
{
    volatile uint16_t *const words[] = {
        &drive.state, &drive.fault, (uint16_t *)&drive.direction, (uint16_t *)&drive.calibration.offset_a_q13,
        (uint16_t *)&drive.calibration.offset_b_q13, &drive.selftest.state, &drive.selftest.fault, &drive.selftest.direction,
        &drive.selftest.offset_a, &drive.selftest.offset_b
    };
    EACH(n, words) {
        for (uint16_t bit = 0; bit < 16u; bit++) {
            *words[n] ^= (uint16_t)(1u << bit);
            TEST_ASSERT_EQUAL_UINT16(0, selftest_variables_hold(&drive));
            *words[n] ^= (uint16_t)(1u << bit);
        }
    }
    TEST_ASSERT_EQUAL_UINT16(1, selftest_variables_hold(&drive));
}
