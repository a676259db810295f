/* Moves, stack, program memory as tables, EXCH and SWAP. */
#include "iss_access.h"

#include <string.h>

/* ---- MOV ---- */

#define MOVES(suffix, bits) \
    static void mov_file_##suffix(iss_t *m, const insn_t *i) \
    { \
        unsigned value = load(m, i->k, bits); \
        to_file_or_wreg(m, i, value, bits); \
        flags_nz(m, value, bits); \
    } \
    static void mov_wreg_##suffix(iss_t *m, const insn_t *i) { store(m, i->k, m->data[0] & ones(bits), bits); } \
    static void mov_##suffix(iss_t *m, const insn_t *i) { destination(m, i, source(m, i, bits), bits); } \
    static void mov_from_offset_##suffix(iss_t *m, const insn_t *i) \
    { \
        to_register(m, i->d, load(m, with_offset(m, i->s, i->k), bits), bits); \
    } \
    static void mov_to_offset_##suffix(iss_t *m, const insn_t *i) \
    { \
        unsigned value = m->data[i->s] & ones(bits); \
        store(m, with_offset(m, i->d, i->k), value, bits); \
    }

static inline unsigned with_offset(iss_t *m, unsigned reg, unsigned offset)
{
    unsigned address = (m->data[reg] + offset) & 0xFFFFu;
    if (reg == 15) {
        iss_stack_access(m, address);
    }
    return address;
}

MOVES(w, 16)
MOVES(b, 8)

OP(mov_from_64k, set_w(m, i->d, load16(m, i->k)))
OP(mov_to_64k, store16(m, i->k, m->data[i->s]))

static void mov_literal(iss_t *m, const insn_t *i)
{
    set_w(m, i->d, i->k);
    if (i->d == 15) {
        m->stack_base = (uint16_t)(i->k & 0xFFFEu);
        m->stack_top = m->stack_base;
    }
}

OP(mov_literal8, set_w8(m, i->d, i->k))

/* ---- MOV.D: the even register is the low word ---- */

static void mov_d_from(iss_t *m, const insn_t *i)
{
    unsigned low, high;
    if (i->p == 0) {
        low = m->data[i->s];
        high = m->data[i->s | 1u];
    } else {
        unsigned address = indirect(m, i->s, i->p, i->w, 4, false);
        low = load16(m, address);
        high = load16(m, (address + 2u) & 0xFFFFu);
    }
    set_w(m, i->d, low);
    set_w(m, i->d | 1u, high);
}

static void mov_d_to(iss_t *m, const insn_t *i)
{
    unsigned low = m->data[i->s], high = m->data[i->s | 1u];
    unsigned address = indirect(m, i->d, i->q, i->w, 4, true);
    store16(m, address, low);
    if (i->d == 15) {
        iss_stack_access(m, (address + 2u) & 0xFFFFu);
    }
    store16(m, (address + 2u) & 0xFFFFu, high);
}

/* ---- stack ---- */

OP(push_f, push16(m, load16(m, i->k)))

static void pop_f(iss_t *m, const insn_t *i)
{
    unsigned value = pop16(m);
    store16(m, i->k, value);
}

static void push_shadow(iss_t *m, const insn_t *i)
{
    (void)i;
    memcpy(m->shadow_w, m->data, sizeof m->shadow_w);
    m->shadow_sr = m->data[R_SR] & SR_ALU;
}

static void pop_shadow(iss_t *m, const insn_t *i)
{
    (void)i;
    memcpy(m->data, m->shadow_w, sizeof m->shadow_w);
    m->data[R_SR] = (uint16_t)((m->data[R_SR] & ~(unsigned)SR_ALU) | m->shadow_sr);
}

static void lnk(iss_t *m, const insn_t *i)
{
    push16(m, m->data[14]);
    set_w(m, 14, m->data[15]);
    set_w(m, 15, m->data[15] + (unsigned)i->k);
    if (m->data[15] > m->stack_top) {
        m->stack_top = m->data[15];
    }
}

static void ulnk(iss_t *m, const insn_t *i)
{
    (void)i;
    set_w(m, 15, m->data[14]);
    set_w(m, 14, pop16(m));
}

/* ---- registers ---- */

static void exch(iss_t *m, const insn_t *i)
{
    unsigned value = m->data[i->s];
    set_w(m, i->s, m->data[i->d]);
    set_w(m, i->d, value);
}

static void swap_w(iss_t *m, const insn_t *i)
{
    unsigned value = m->data[i->d];
    set_w(m, i->d, value >> 8 | value << 8);
}

static void swap_b(iss_t *m, const insn_t *i)
{
    unsigned value = m->data[i->d] & 0xFFu;
    set_w8(m, i->d, value >> 4 | value << 4);
}

/* ---- tables: TBLPAG and the pointer are a byte-wise program address; its lowest bit chooses the byte in byte mode ---- */

static inline uint32_t table_address(const iss_t *m, unsigned pointer)
{
    return (uint32_t)(m->data[R_TBLPAG] & 0xFFu) << 16 | pointer;
}

#define TABLE_READ(name, shift) \
    static void name##_w(iss_t *m, const insn_t *i) \
    { \
        unsigned pointer = indirect(m, i->s, i->p, i->w, 2, false); \
        destination(m, i, iss_table_word(m, table_address(m, pointer)) >> (shift) & 0xFFFFu, 16); \
    } \
    static void name##_b(iss_t *m, const insn_t *i) \
    { \
        unsigned pointer = indirect(m, i->s, i->p, i->w, 1, false); \
        unsigned word = iss_table_word(m, table_address(m, pointer)) >> (shift) & 0xFFFFu; \
        destination(m, i, (pointer & 1u) != 0 ? word >> 8 : word & 0xFFu, 8); \
    }
TABLE_READ(tblrdl, 0)
TABLE_READ(tblrdh, 16)

#define TABLE_WRITE(name, shift) \
    static void name##_w(iss_t *m, const insn_t *i) \
    { \
        unsigned value = source(m, i, 16); \
        unsigned pointer = indirect(m, i->d, i->q, i->w, 2, true); \
        iss_table_write(m, table_address(m, pointer), value << (shift), 0xFFFFu << (shift)); \
    } \
    static void name##_b(iss_t *m, const insn_t *i) \
    { \
        unsigned value = source(m, i, 8) & 0xFFu; \
        unsigned pointer = indirect(m, i->d, i->q, i->w, 1, true); \
        unsigned place = (shift) + 8u * (pointer & 1u); \
        iss_table_write(m, table_address(m, pointer), value << place, 0xFFu << place); \
    }
TABLE_WRITE(tblwtl, 0)
TABLE_WRITE(tblwth, 16)

const row_t iss_rows_move[] = {
    {"mov", {FILE_WREG}, 0xBF8000, 0xFF8000, W_B(mov_file), .cycles = 1},
    {"mov", {WREG, FILE_ONLY}, 0xB7A000, 0xFFA000, W_B(mov_wreg), .cycles = 1},
    {"mov", {FILE_64K, WN}, 0x800000, 0xF80000, mov_from_64k, NULL, .cycles = 1},
    {"mov", {WS, FILE_64K}, 0x880000, 0xF80000, mov_to_64k, NULL, .cycles = 1},
    {"mov.b", {K8, WN}, 0xB3C000, 0xFFF000, mov_literal8, NULL, .cycles = 1},
    {"mov", {K16, WN}, 0x200000, 0xF00000, mov_literal, NULL, .cycles = 1},
    {"mov", {S_OFFSET, WD}, 0x900000, 0xF80000, W_B(mov_from_offset), .cycles = 1},
    {"mov", {WS, D_OFFSET}, 0x980000, 0xF80000, W_B(mov_to_offset), .cycles = 1},
    {"mov", {XS, XD}, 0x780000, 0xF80000, W_B(mov), .cycles = 1},
    {"mov.d", {MS_PAIR, WD_PAIR}, 0xBE0000, 0xFFF880, mov_d_from, NULL, .cycles = 2},
    {"mov.d", {WS_PAIR, ID_PAIR}, 0xBE8000, 0xFFC071, mov_d_to, NULL, .cycles = 2},
    {"push", {FILE_STACK}, 0xF80000, 0xFF0001, push_f, NULL, .writes = 1u << 15, .points = 1u << 15, .cycles = 1},
    {"pop", {FILE_STACK}, 0xF90000, 0xFF0001, pop_f, NULL, .reads = 1u << 15, .cycles = 1},
    {"push.s", {NO_OPERAND}, 0xFEA000, 0xFFFFFF, push_shadow, NULL, .cycles = 1},
    {"pop.s", {NO_OPERAND}, 0xFE8000, 0xFFFFFF, pop_shadow, NULL, .writes = 0x000F, .cycles = 1},
    {"lnk", {K14_EVEN}, 0xFA0000, 0xFFC001, lnk, NULL, .writes = 3u << 14, .points = 1u << 15, .cycles = 1},
    {"ulnk", {NO_OPERAND}, 0xFA8000, 0xFFFFFF, ulnk, NULL, .writes = 3u << 14, .reads = 1u << 14, .cycles = 1},
    {"exch", {WS, W_SWAP}, 0xFD0000, 0xFFF870, exch, NULL, .cycles = 1},
    {"swap", {WN}, 0xFD8000, 0xFFBFF0, W_B(swap), .cycles = 1},
    {"tblrdl", {IS, MD}, 0xBA0000, 0xFF8000, W_B(tblrdl), .cycles = 2},
    {"tblrdh", {IS, MD}, 0xBA8000, 0xFF8000, W_B(tblrdh), .cycles = 2},
    {"tblwtl", {MS, ID}, 0xBB0000, 0xFF8000, W_B(tblwtl), .cycles = 2},
    {"tblwth", {MS, ID}, 0xBB8000, 0xFF8000, W_B(tblwth), .cycles = 2},
    {0},
};
