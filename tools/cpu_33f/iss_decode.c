/* Decoder: finds the row of a word and makes an instruction that is ready to run. */
#include "iss_state.h"

static const row_t *const groups[] = {iss_rows_alu, iss_rows_bit, iss_rows_move, iss_rows_multiply, iss_rows_flow, iss_rows_dsp};
enum { GROUPS = (int)(sizeof groups / sizeof groups[0]), USUAL_BYTE_BIT = 0x4000 };

bool iss_row_is_byte(const row_t *row, uint32_t word)
{
    return row->byte != NULL && (word & (row->byte_bit != 0 ? row->byte_bit : USUAL_BYTE_BIT)) != 0;
}

static unsigned bits(uint32_t word, unsigned high, unsigned low)
{
    return (word >> low) & ((2u << (high - low)) - 1u);
}

static uint16_t extended(unsigned value, unsigned width)
{
    unsigned sign = 1u << (width - 1u);
    return (uint16_t)((value ^ sign) - sign);
}

static uint16_t one(unsigned reg)
{
    return (uint16_t)(1u << reg);
}

/* ---- what an instruction does with W registers ---- */

static void reads_at(insn_t *i, unsigned reg)
{
    i->points |= one(reg);
    i->stall |= one(reg);
}

static void writes_at(insn_t *i, unsigned reg)
{
    i->points |= one(reg);
    if (ASSUME_RAW_STALL_DESTINATION != 0) {
        i->stall |= one(reg);
    }
}

/* Source in register `reg` or where it points. */
static bool from(insn_t *i, unsigned reg, unsigned mode, unsigned modes)
{
    i->s = (uint8_t)reg;
    i->p = (uint8_t)mode;
    if (mode != 0) {
        reads_at(i, reg);
    }
    if (mode >= 6) {
        reads_at(i, i->w);
    }
    return mode <= modes;
}

/* Destination in register `reg` or where it points. */
static bool to(insn_t *i, unsigned reg, unsigned mode, unsigned modes)
{
    i->d = (uint8_t)reg;
    i->q = (uint8_t)mode;
    if (mode == 0) {
        i->writes |= one(reg);
        return true;
    }
    writes_at(i, reg);
    if (mode >= 6) {
        writes_at(i, i->w);
    } else if (mode >= 2 && ASSUME_RAW_STALL_POINTER != 0) {
        i->writes |= one(reg);
    }
    return mode <= modes;
}

static bool to_pair(insn_t *i, unsigned reg)
{
    i->d = (uint8_t)reg;
    i->writes |= (uint16_t)(3u << (reg & 14u));
    return (reg & 1u) == 0;
}

/* ---- operands; false: there is no such instruction ---- */

static bool register_operand(insn_t *i, operand_t operand, uint32_t word)
{
    switch (operand) {
    case WB: i->w = (uint8_t)bits(word, 18, 15); return true;
    case WC: i->w = (uint8_t)bits(word, 14, 11); return true;
    case WS: i->s = (uint8_t)bits(word, 3, 0); return true;
    case WD: return to(i, bits(word, 10, 7), 0, 0);
    case WN: return to(i, bits(word, 3, 0), 0, 0);
    case WM: i->d = (uint8_t)bits(word, 10, 7); return true;
    case WM_HIGH: i->w = (uint8_t)bits(word, 14, 11); return true;
    case WM_PAIR:
        i->w = (uint8_t)bits(word, 14, 11);
        i->d = (uint8_t)bits(word, 10, 7);
        return (i->d & 1u) == 0 && i->w == i->d + 1;
    case WS_PAIR: i->s = (uint8_t)bits(word, 3, 0); return (i->s & 1u) == 0;
    case WD_PAIR: return to_pair(i, bits(word, 10, 7));
    case W_SWAP: i->writes |= one(i->s); return to(i, bits(word, 10, 7), 0, 0);
    default: return false;
    }
}

static bool mode_operand(insn_t *i, operand_t operand, uint32_t word)
{
    unsigned s = bits(word, 3, 0), p = bits(word, 6, 4), d = bits(word, 10, 7), q = bits(word, 13, 11);
    switch (operand) {
    case MC: i->writes |= p == 0 ? one(s) : 0u; return from(i, s, p, 5);
    case MS: return from(i, s, p, 5);
    case IS: return p != 0 && from(i, s, p, 5);
    case MS_PAIR: return (p != 0 || (s & 1u) == 0) && from(i, s, p, 5);
    case XS: i->w = (uint8_t)bits(word, 18, 15); return from(i, s, p, 7);
    case XS_ACC: i->w = (uint8_t)bits(word, 14, 11); return from(i, s, p, 7);
    case MD: return to(i, d, q, 5);
    case ID:
    case ID_PAIR: return q != 0 && to(i, d, q, 5);
    case XD: return to(i, d, q, 7);
    case XD_ACC: i->w = (uint8_t)bits(word, 14, 11); return to(i, s, p, 7);
    default: return false;
    }
}

/* Offsets count bytes or words. */
static bool offset_operand(insn_t *i, operand_t operand, uint32_t word, bool byte)
{
    unsigned offset = extended(bits(word, 18, 15) << 6 | bits(word, 13, 11) << 3 | bits(word, 6, 4), 10);
    i->k = (uint16_t)(byte ? offset : offset << 1);
    if (operand == S_OFFSET) {
        i->s = (uint8_t)bits(word, 3, 0);
        reads_at(i, i->s);
    } else {
        i->d = (uint8_t)bits(word, 10, 7);
        writes_at(i, i->d);
    }
    return true;
}

static bool file_operand(insn_t *i, operand_t operand, uint32_t word)
{
    switch (operand) {
    case FILE_64K: i->k = (uint16_t)(bits(word, 18, 4) << 1); return true;
    case FILE_STACK: i->k = (uint16_t)(word & 0xFFFEu); return true;
    case FILE_BIT: i->b = (uint8_t)bits(word, 15, 13); break;
    case FILE_WREG:
        i->d = (uint8_t)bits(word, 13, 13);
        i->writes |= i->d == 0 ? 1u : 0u;
        break;
    default: break;
    }
    i->k = (uint16_t)bits(word, 12, 0);
    return true;
}

static bool number_operand(insn_t *i, operand_t operand, uint32_t word, bool byte)
{
    switch (operand) {
    case K1: i->k = (uint16_t)bits(word, 0, 0); return true;
    case K4: i->k = (uint16_t)bits(word, 3, 0); return true;
    case K5: i->k = (uint16_t)bits(word, 4, 0); return true;
    case K6_SIGNED: i->k = extended(bits(word, 5, 0), 6); return true;
    case K8: i->k = (uint16_t)bits(word, 11, 4); return true;
    case K10: i->k = (uint16_t)bits(word, byte ? 11 : 13, 4); return true;
    case K14:
    case K14_EVEN: i->k = (uint16_t)bits(word, 13, 0); return true;
    case K16: i->k = (uint16_t)bits(word, 19, 4); return true;
    case SHIFT_ACC: i->k = extended(bits(word, 10, 7), 4); return true;
    case BIT_NUMBER: i->b = (uint8_t)bits(word, 15, 12); return !byte || i->b < 8;
    default: return false;
    }
}

/* Targets in the flash are an index, all others lead outside. */
static bool target_operand(insn_t *i, operand_t operand, uint32_t word, uint32_t next, uint32_t index)
{
    uint32_t target = operand == TARGET ? (word & 0xFFFEu) / 2u + (next & 0x7Fu) * 0x8000u : index + 1u + (uint32_t)as_int16(word & 0xFFFFu);
    if (operand != RELATIVE_2) { /* DO takes it from the program when it runs */
        i->k = target < ISS_PROGRAM_WORDS ? (uint16_t)target : (uint16_t)CODE_OUTSIDE;
    }
    return true;
}

static void prefetch_pointer(insn_t *i, unsigned code, unsigned first)
{
    if (code != 4) {
        reads_at(i, first + (code >> 3));
    }
    if (code == 12) {
        reads_at(i, 12);
    }
}

static bool prefetch_operand(insn_t *i, operand_t operand, uint32_t word)
{
    i->x = (uint8_t)(4u + bits(word, 13, 12));
    i->y = (uint8_t)(4u + bits(word, 11, 10));
    i->i = (uint8_t)bits(word, 9, 6);
    i->j = (uint8_t)bits(word, 5, 2);
    i->a = operand == PREFETCH_AWB ? (uint8_t)bits(word, 1, 0) : (uint8_t)2;
    prefetch_pointer(i, i->i, 8);
    prefetch_pointer(i, i->j, 10);
    i->writes |= i->i != 4 || operand == DISTANCE ? one(i->x) : 0u;
    i->writes |= i->j != 4 && operand != DISTANCE ? one(i->y) : 0u;
    if (i->a == 0) {
        i->writes |= one(13);
    } else if (i->a == 1) {
        writes_at(i, 13);
        i->writes |= ASSUME_RAW_STALL_POINTER != 0 ? one(13) : 0u;
    }
    return i->a != 3 && (operand != DISTANCE || (i->i != 4 && i->j != 4));
}

static bool dsp_operand(insn_t *i, operand_t operand, uint32_t word)
{
    static const uint8_t first[8] = {4, 4, 4, 0, 5, 5, 6, 0}, second[8] = {5, 6, 7, 0, 6, 7, 7, 0};
    switch (operand) {
    case ACC: i->b = (uint8_t)bits(word, 15, 15); return true;
    case PRODUCT:
        i->s = first[bits(word, 18, 16)];
        i->d = second[bits(word, 18, 16)];
        return i->s != 0;
    case SQUARE:
        i->s = (uint8_t)(4u + bits(word, 17, 16));
        i->d = i->s;
        return true;
    case PREFETCH:
    case PREFETCH_AWB:
    case DISTANCE: return prefetch_operand(i, operand, word);
    default: return false;
    }
}

static bool fill_operand(insn_t *i, operand_t operand, const row_t *row, uint32_t word, uint32_t next, uint32_t index)
{
    if (operand <= W_SWAP) {
        return register_operand(i, operand, word);
    }
    if (operand <= XD_ACC) {
        return mode_operand(i, operand, word);
    }
    if (operand <= D_OFFSET) {
        return offset_operand(i, operand, word, iss_row_is_byte(row, word));
    }
    if (operand <= FILE_STACK) {
        return file_operand(i, operand, word);
    }
    if (operand <= BIT_NUMBER) {
        return operand == WREG || number_operand(i, operand, word, iss_row_is_byte(row, word));
    }
    return operand <= TARGET ? target_operand(i, operand, word, next, index) : dsp_operand(i, operand, word);
}

static bool has_two_words(const row_t *row)
{
    return row->operand[0] == TARGET || row->operand[1] == RELATIVE_2;
}

static bool fill(insn_t *i, const row_t *row, uint32_t word, uint32_t next, uint32_t index)
{
    *i = (insn_t){.run = iss_row_is_byte(row, word) ? row->byte : row->word, .writes = row->writes, .points = row->points | row->reads, .stall = row->reads,
                  .cycles = row->cycles, .taken = row->taken, .words = has_two_words(row) ? 2 : 1};
    for (unsigned n = 0; n < OPERANDS && row->operand[n] != NO_OPERAND; n++) {
        if (!fill_operand(i, row->operand[n], row, word, next, index)) {
            return false;
        }
    }
    return true;
}

/* The row of a word, with the instruction that it makes; NULL: there is no such instruction. */
const row_t *iss_fill(insn_t *i, uint32_t word, uint32_t next, uint32_t index)
{
    for (size_t g = 0; g < GROUPS; g++) {
        for (const row_t *row = groups[g]; row->name != NULL; row++) {
            if ((word & row->mask) == row->value && fill(i, row, word, next, index)) {
                return row;
            }
        }
    }
    *i = (insn_t){.run = iss_op_illegal, .cycles = 1, .words = 1};
    return NULL;
}

void iss_decode(iss_t *m, uint32_t index)
{
    insn_t *i = &m->code[index];
    if (index >= ISS_PROGRAM_WORDS || m->programmed[index] == 0) {
        *i = (insn_t){.run = index < ISS_PROGRAM_WORDS ? iss_op_erased : iss_op_outside, .cycles = 1, .words = 1};
        return;
    }
    uint32_t next = index + 1u < ISS_PROGRAM_WORDS ? m->program[index + 1u] : 0u;
    (void)iss_fill(i, m->program[index], next, index);
}
