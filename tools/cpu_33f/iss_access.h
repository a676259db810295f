/* The fast paths of instructions: loads and stores of known RAM, operands, flags, the stack. */
#ifndef FOC33_CPU_33F_ISS_ACCESS_H
#define FOC33_CPU_33F_ISS_ACCESS_H

#include "iss_state.h"

static inline void set_w8(iss_t *m, unsigned n, unsigned value)
{
    set_w(m, n, (m->data[n] & 0xFF00u) | (value & 0xFFu));
}

static inline unsigned load16(iss_t *m, unsigned address)
{
    unsigned offset = address - ISS_RAM_START;
    if (offset < ISS_RAM_END - ISS_RAM_START && (address & 1u) == 0 && m->known[offset / 2u] == 0xFFFFu) {
        return m->data[address / 2u];
    }
    return iss_load16_slow(m, address);
}

static inline void store16(iss_t *m, unsigned address, unsigned value)
{
    unsigned offset = address - ISS_RAM_START;
    if (offset < ISS_RAM_END - ISS_RAM_START && (address & 1u) == 0) {
        m->known[offset / 2u] = 0xFFFFu;
        m->data[address / 2u] = (uint16_t)value;
    } else {
        iss_store16_slow(m, address, value);
    }
}

static inline unsigned load8(iss_t *m, unsigned address)
{
    unsigned offset = address - ISS_RAM_START, shift = 8u * (address & 1u);
    if (offset < ISS_RAM_END - ISS_RAM_START && ((m->known[offset / 2u] >> shift) & 0xFFu) != 0) {
        return ((unsigned)m->data[address / 2u] >> shift) & 0xFFu;
    }
    return iss_load8_slow(m, address);
}

static inline void store8(iss_t *m, unsigned address, unsigned value)
{
    unsigned offset = address - ISS_RAM_START, shift = 8u * (address & 1u), mask = 0xFFu << shift;
    if (offset < ISS_RAM_END - ISS_RAM_START) {
        m->known[offset / 2u] = (uint16_t)(m->known[offset / 2u] | mask);
        m->data[address / 2u] = (uint16_t)((m->data[address / 2u] & ~mask) | ((value << shift) & mask));
    } else {
        iss_store8_slow(m, address, value);
    }
}

static inline unsigned load(iss_t *m, unsigned address, unsigned bits)
{
    return bits == 8 ? load8(m, address) : load16(m, address);
}

static inline void store(iss_t *m, unsigned address, unsigned value, unsigned bits)
{
    if (bits == 8) {
        store8(m, address, value);
    } else {
        store16(m, address, value);
    }
}

/* Effective address of an indirect operand, with the pointer's change. Modes: 1 [W], 2 [W--], 3 [W++], 4 [--W], 5 [++W], 6 and 7 [W+Wb]. */
static inline unsigned indirect(iss_t *m, unsigned reg, unsigned mode, unsigned index, unsigned step, bool writes)
{
    unsigned address = m->data[reg];
    if (m->bent) {
        return iss_bent_address(m, reg, mode, index, step, writes);
    }
    switch (mode) {
    case 1: break;
    case 2: set_w(m, reg, address - step); break;
    case 3: set_w(m, reg, address + step); break;
    case 4: address = (address - step) & 0xFFFFu; set_w(m, reg, address); break;
    case 5: address = (address + step) & 0xFFFFu; set_w(m, reg, address); break;
    default: address = (address + m->data[index]) & 0xFFFFu; break;
    }
    if (reg == 15) {
        iss_stack_access(m, address);
    }
    return address;
}

static inline unsigned ones(unsigned bits)
{
    return (1u << bits) - 1u;
}

/* The value of source operand Ws in whatever mode. */
static inline unsigned source(iss_t *m, const insn_t *i, unsigned bits)
{
    if (i->p == 0) {
        return m->data[i->s] & ones(bits);
    }
    return load(m, indirect(m, i->s, i->p, i->w, bits / 8u, false), bits);
}

static inline void to_register(iss_t *m, unsigned n, unsigned result, unsigned bits)
{
    if (bits == 8) {
        set_w8(m, n, result);
    } else {
        set_w(m, n, result);
    }
}

/* Write the result to destination operand Wd in whatever mode. */
static inline void destination(iss_t *m, const insn_t *i, unsigned value, unsigned bits)
{
    if (i->q != 0) {
        store(m, indirect(m, i->d, i->q, i->w, bits / 8u, true), value, bits);
    } else {
        to_register(m, i->d, value, bits);
    }
}

/* The result to WREG or f (d: 1 = f). */
static inline void to_file_or_wreg(iss_t *m, const insn_t *i, unsigned result, unsigned bits)
{
    if (i->d != 0) {
        store(m, i->k, result, bits);
    } else {
        to_register(m, 0, result, bits);
    }
}

static inline unsigned carry_of(const iss_t *m)
{
    return m->data[R_SR] & SR_C;
}

/* Flags N and Z of a result; the others stay. */
static inline void flags_nz(iss_t *m, unsigned result, unsigned bits)
{
    unsigned sr = m->data[R_SR] & ~(unsigned)(SR_N | SR_Z);
    sr |= ((result >> (bits - 1u)) & 1u) << 3;
    sr |= (unsigned)((result & ones(bits)) == 0) << 1;
    m->data[R_SR] = (uint16_t)sr;
}

/* The result of an operation that sets N and Z alone. */
static inline unsigned logic(iss_t *m, unsigned result, unsigned bits)
{
    flags_nz(m, result, bits);
    return result & ones(bits);
}

static inline void push16(iss_t *m, unsigned value)
{
    unsigned address = m->data[15];
    iss_stack_access(m, address);
    set_w(m, 15, address + 2u);
    store16(m, address, value);
}

static inline unsigned pop16(iss_t *m)
{
    unsigned address = (m->data[15] - 2u) & 0xFFFFu;
    set_w(m, 15, address);
    iss_stack_access(m, address);
    return load16(m, address);
}

/* ---- instructions: their functions, and rows of the decoder's table ---- */

/* An instruction that is one expression of the core `m` and its operands `i`. */
#define OP(name, expression) \
    static void name(iss_t *m, const insn_t *i) \
    { \
        (void)m; \
        (void)i; \
        expression; \
    }

#define BOTH(form, name) form(name, w, 16) form(name, b, 8)
#define W_B(name) name##_w, name##_b

/* One operand `a`: from f to f or WREG, from Ws to Wd. The expression gives the result and sets the flags. */
#define ALU1(name, expression) \
    static inline unsigned alu_##name(iss_t *m, unsigned a, unsigned bits) { return (expression); } \
    BOTH(ALU1_FORMS, name)
#define ALU1_FORMS(name, suffix, bits) \
    OP(name##_f_##suffix, to_file_or_wreg(m, i, alu_##name(m, load(m, i->k, bits), bits), bits)) \
    OP(name##_w_##suffix, destination(m, i, alu_##name(m, source(m, i, bits), bits), bits))
#define ALU1_ROWS(name, f, w) \
    {#name, {FILE_WREG}, f, 0xFF8000, W_B(name##_f), .cycles = 1}, {#name, {MS, MD}, w, 0xFF8000, W_B(name##_w), .cycles = 1}

#endif
