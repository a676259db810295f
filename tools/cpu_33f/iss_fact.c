/* Instructions as facts: what the decoder's table says of cycles and of where the program goes on. */
#include "iss_state.h"

enum { NOWHERE = -1, W_BYTES = 0x20, WINDOW = 0x8000 };

/* A register that is written by its address in data memory; for one that is only read it does no harm. */
static uint32_t as_memory(unsigned address)
{
    return address < W_BYTES ? 1u << address / 2u : 0u;
}

/* The instruction accesses the data address i->k. */
static bool has_file(const row_t *row)
{
    for (unsigned n = 0; n < OPERANDS; n++) {
        if (row->operand[n] >= FILE_WREG && row->operand[n] <= FILE_STACK) {
            return true;
        }
    }
    return false;
}

static int32_t target_of(const row_t *row, const insn_t *i, uint32_t next, uint32_t pc)
{
    if (row->flow == ISS_FLOW_DO) {
        return (int32_t)pc + 4 + 2 * as_int16(next & 0xFFFFu);
    }
    bool fixed = row->flow == ISS_FLOW_BRANCH || row->flow == ISS_FLOW_JUMP || row->flow == ISS_FLOW_CALL;
    return fixed && i->k != CODE_OUTSIDE ? 2 * i->k : NOWHERE;
}

static int32_t count_of(const row_t *row, const insn_t *i)
{
    bool repeats = row->flow == ISS_FLOW_REPEAT || row->flow == ISS_FLOW_DO;
    return repeats && row->operand[0] == K14 ? i->k : NOWHERE;
}

/* Tables are read through registers too, but not through the window; nor is what the instruction itself takes from the stack. */
static int32_t window_of(const row_t *row, const insn_t *i, bool file)
{
    if (file) {
        return i->k >= WINDOW ? 1 : 0;
    }
    unsigned pointers = i->stall & ~(unsigned)row->reads;
    if (pointers == 0 || row->operand[0] == IS) {
        return 0;
    }
    bool two = row->operand[0] == MS_PAIR;
    for (unsigned n = 0; n < OPERANDS; n++) {
        two |= row->operand[n] == PREFETCH || row->operand[n] == PREFETCH_AWB || row->operand[n] == DISTANCE;
    }
    return two ? 2 : 1;
}

bool iss_fact(uint32_t word, uint32_t next, uint32_t pc, iss_fact_t *fact)
{
    insn_t i;
    const row_t *row = iss_fill(&i, word & 0xFFFFFFu, next, pc / 2u);
    if (row == NULL) {
        return false;
    }
    bool file = has_file(row);
    *fact = (iss_fact_t){
        .flow = (int32_t)row->flow, .words = i.words, .cycles = i.cycles, .taken = i.taken, .target = target_of(row, &i, next, pc),
        .count = count_of(row, &i), .stall = i.stall, .writes = i.writes | (file ? as_memory(i.k) : 0u), .window = window_of(row, &i, file),
        .address = file ? i.k : NOWHERE};
    return true;
}
