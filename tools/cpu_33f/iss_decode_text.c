/* Instructions as text, from the decoder's table. */
#include "iss_state.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---- a text that grows as far as there is room ---- */

typedef struct {
    char *buffer;
    size_t size, length;
} text_t;

__attribute__((format(printf, 2, 3))) static void add(text_t *t, const char *format, ...)
{
    if (t->length + 1u >= t->size) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    int written = vsnprintf(t->buffer + t->length, t->size - t->length, format, arguments);
    va_end(arguments);
    size_t room = t->size - t->length - 1u;
    t->length += written < 0 ? 0u : (size_t)written < room ? (size_t)written : room;
}

/* ---- how operands are written ---- */

static void in_mode(text_t *t, unsigned mode, unsigned reg, unsigned index)
{
    static const char *const before[8] = {"", "[", "[", "[", "[--", "[++", "[", "["}, *const behind[8] = {"", "]", "--]", "++]", "]", "]", "", ""};
    add(t, "%sw%u%s", before[mode & 7u], reg, behind[mode & 7u]);
    if (mode >= 6) {
        add(t, "+w%u]", index);
    }
}

static void with_offset(text_t *t, unsigned reg, unsigned offset)
{
    add(t, "[w%u%+d]", reg, as_int16(offset));
}

static void prefetch(text_t *t, unsigned code, unsigned first)
{
    static const char *const steps[8] = {"", "+=2", "+=4", "+=6", "", "-=6", "-=4", "-=2"};
    if (code == 12) {
        add(t, "[w%u+w12]", first + 1u);
    } else {
        add(t, "[w%u]%s", first + (code >> 3), steps[code & 7u]);
    }
}

static void prefetches(text_t *t, const insn_t *i)
{
    if (i->i != 4) {
        add(t, ",");
        prefetch(t, i->i, 8);
        add(t, ",w%u", i->x);
    }
    if (i->j != 4) {
        add(t, ",");
        prefetch(t, i->j, 10);
        add(t, ",w%u", i->y);
    }
    if (i->a < 2) {
        add(t, i->a == 0 ? ",w13" : ",[w13]+=2");
    }
}

static void distance(text_t *t, const insn_t *i)
{
    add(t, ",");
    prefetch(t, i->i, 8);
    add(t, ",");
    prefetch(t, i->j, 10);
    add(t, ",w%u", i->x);
}

static void register_text(text_t *t, operand_t operand, const insn_t *i)
{
    switch (operand) {
    case WB:
    case WC:
    case WM_HIGH: add(t, "w%u", i->w); break;
    case WS:
    case WS_PAIR: add(t, "w%u", i->s); break;
    case WREG: add(t, "wreg"); break;
    default: add(t, "w%u", i->d); break;
    }
}

static void file_text(text_t *t, operand_t operand, const insn_t *i)
{
    add(t, "0x%04x", i->k);
    if (operand == FILE_WREG && i->d == 0) {
        add(t, ",wreg");
    } else if (operand == FILE_BIT) {
        add(t, ",#%u", i->b);
    }
}

static void target_text(text_t *t, operand_t operand, uint32_t word, uint32_t next, uint32_t pc)
{
    uint32_t base = pc + (operand == RELATIVE_2 ? 4u : 2u), low = operand == RELATIVE_2 ? next & 0xFFFFu : word & 0xFFFFu;
    uint32_t target = operand == TARGET ? (word & 0xFFFEu) | (next & 0x7Fu) << 16 : base + 2u * (uint32_t)as_int16(low);
    add(t, "0x%04x", (unsigned)(target & 0x7FFFFEu));
}

static void dsp_text(text_t *t, operand_t operand, const insn_t *i)
{
    switch (operand) {
    case ACC: add(t, i->b == 0 ? "a" : "b"); break;
    case PRODUCT:
    case SQUARE: add(t, "w%u*w%u", i->s, i->d); break;
    case DISTANCE: distance(t, i); break;
    default: prefetches(t, i); break;
    }
}

static void operand_text(text_t *t, operand_t operand, const insn_t *i, uint32_t word, uint32_t next, uint32_t pc)
{
    switch (operand) {
    case MS: case MC: case IS: case MS_PAIR: case XS: case XS_ACC: in_mode(t, i->p, i->s, i->w); break;
    case MD: case ID: case ID_PAIR: case XD: case XD_ACC: in_mode(t, i->q, i->d, i->w); break;
    case S_OFFSET: with_offset(t, i->s, i->k); break;
    case D_OFFSET: with_offset(t, i->d, i->k); break;
    case FILE_WREG: case FILE_ONLY: case FILE_BIT: case FILE_64K: case FILE_STACK: file_text(t, operand, i); break;
    case K6_SIGNED: case SHIFT_ACC: add(t, "#%d", as_int16(i->k)); break;
    case BIT_NUMBER: add(t, "#%u", i->b); break;
    case RELATIVE: case RELATIVE_2: case TARGET: target_text(t, operand, word, next, pc); break;
    case ACC: case PRODUCT: case SQUARE: case PREFETCH: case PREFETCH_AWB: case DISTANCE: dsp_text(t, operand, i); break;
    case K1: case K4: case K5: case K8: case K10: case K14: case K14_EVEN: case K16: add(t, "#0x%x", i->k); break;
    default: register_text(t, operand, i); break;
    }
}

static bool brings_its_comma(operand_t operand)
{
    return operand == PREFETCH || operand == PREFETCH_AWB || operand == DISTANCE;
}

unsigned iss_disassemble(uint32_t word, uint32_t next, uint32_t pc, char *buffer, size_t size)
{
    insn_t i;
    text_t t = {buffer, size, 0};
    const row_t *row = iss_fill(&i, word & 0xFFFFFFu, next, pc / 2u);
    if (row == NULL) {
        add(&t, ".word24 0x%06x", (unsigned)(word & 0xFFFFFFu));
        return 0;
    }
    bool condition = strchr(row->name, ' ') != NULL;
    add(&t, "%s%s", row->name, iss_row_is_byte(row, word) ? ".b" : "");
    for (unsigned n = 0; n < OPERANDS && row->operand[n] != NO_OPERAND; n++) {
        add(&t, "%s", n == 0 ? condition ? "," : " " : brings_its_comma(row->operand[n]) ? "" : ",");
        operand_text(&t, row->operand[n], &i, word, next, pc);
    }
    return i.words;
}
