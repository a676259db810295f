/* The core's state and what its files share: predecoded instructions, registers and data memory. For the core's own files only. */
#ifndef FOC33_CPU_33F_ISS_STATE_H
#define FOC33_CPU_33F_ISS_STATE_H

#include "iss_assumptions.h"
#include "iss.h"

#define ISS_NEVER UINT64_MAX

/* Status register. */
enum {
    SR_C = 0x0001, SR_Z = 0x0002, SR_OV = 0x0004, SR_N = 0x0008, SR_RA = 0x0010, SR_IPL = 0x00E0, SR_DC = 0x0100, SR_DA = 0x0200,
    SR_SAB = 0x0400, SR_OAB = 0x0800, SR_SB = 0x1000, SR_SA = 0x2000, SR_OB = 0x4000, SR_OA = 0x8000,
    SR_ALU = SR_C | SR_Z | SR_OV | SR_N | SR_DC
};

/* CORCON. */
enum {
    CORCON_IF = 0x0001, CORCON_RND = 0x0002, CORCON_PSV = 0x0004, CORCON_IPL3 = 0x0008, CORCON_ACCSAT = 0x0010, CORCON_SATDW = 0x0020,
    CORCON_SATB = 0x0040, CORCON_SATA = 0x0080, CORCON_DL = 0x0700, CORCON_DL1 = 0x0100, CORCON_EDT = 0x0800, CORCON_US = 0x1000
};

/* INTCON1, and the bit of INTCON2 that the core sets. */
enum {
    INTCON1_OSCFAIL = 0x0002, INTCON1_STKERR = 0x0004, INTCON1_ADDRERR = 0x0008, INTCON1_MATHERR = 0x0010, INTCON1_DIV0ERR = 0x0040,
    INTCON1_SFTACERR = 0x0080, INTCON1_COVTE = 0x0100, INTCON1_OVBTE = 0x0200, INTCON1_OVATE = 0x0400, INTCON1_COVBERR = 0x0800,
    INTCON1_COVAERR = 0x1000, INTCON1_OVBERR = 0x2000, INTCON1_OVAERR = 0x4000, INTCON1_NSTDIS = 0x8000,
    INTCON2_DISI = 0x4000, INTCON2_ALTIVT = 0x8000
};

/* Core registers as indices of data[] (address / 2). W0..W15 are 0..15. */
enum {
    R_SPLIM = 0x10, R_ACCAL = 0x11, R_ACCBU = 0x16, R_PCL = 0x17, R_PCH = 0x18, R_TBLPAG = 0x19, R_PSVPAG = 0x1A, R_RCOUNT = 0x1B,
    R_DCOUNT = 0x1C, R_DOSTARTL = 0x1D, R_DOSTARTH = 0x1E, R_DOENDL = 0x1F, R_DOENDH = 0x20, R_SR = 0x21, R_CORCON = 0x22, R_MODCON = 0x23,
    R_XMODSRT = 0x24, R_XMODEND = 0x25, R_YMODSRT = 0x26, R_YMODEND = 0x27, R_XBREV = 0x28, R_DISICNT = 0x29,
    R_CORE_END = 0x2A,
    R_INTCON1 = 0x40, R_INTCON2 = 0x41, R_IFS0 = 0x42, R_IEC0 = 0x4A, R_IPC0 = 0x52, R_IPC_END = 0x70, R_INTTREG = 0x70, R_INT_END = 0x71,
    R_RCON = 0x3A0, SFR_WORDS = 0x400, IFS_WORDS = 5
};

/* ---- instructions ---- */

/* One operand of an encoding: its fields and their use. The order matters to fill_operand() in iss_decode.c; texts are in iss_decode_text.c. */
typedef enum {
    NO_OPERAND,
    WB,        /* Wb, bits 18..15 */
    WC,        /* Wb, bits 14..11 */
    WS,        /* Ws, bits 3..0 */
    WD,        /* Wd, bits 10..7 */
    WN,        /* bits 3..0, read or not, and written */
    WM,        /* dividend, bits 10..7 */
    WM_PAIR,   /* dividend Wm+1:Wm, bits 14..11 and 10..7 */
    WM_HIGH,   /* dividend of DIVF, bits 14..11 */
    WS_PAIR,   /* even, bits 3..0 */
    WD_PAIR,   /* even, bits 10..7 */
    W_SWAP,    /* bits 10..7, both ways (EXCH) */
    MS, MD,    /* Ws or [Ws], modes 6..4; Wd or [Wd], modes 13..11 */
    MC,        /* as MS, but also written */
    IS, ID,    /* only indirect */
    MS_PAIR, ID_PAIR, /* of two words */
    XS, XD,    /* with [Wx+Wb], Wb in bits 18..15 */
    XS_ACC,    /* the same with Wb in bits 14..11 (LAC, ADD) */
    XD_ACC,    /* destination in bits 3..0 with modes 6..4 (SAC) */
    S_OFFSET, D_OFFSET, /* [Ws+Slit10], [Wd+Slit10] */
    FILE_WREG, /* f, then WREG unless bit 13 is set */
    FILE_ONLY, /* f, bits 12..0 */
    FILE_BIT,  /* f and a bit of it, bits 15..13 */
    FILE_64K,  /* bits 18..4, words */
    FILE_STACK,/* bits 15..1 (PUSH, POP) */
    WREG,
    K1, K4, K5, K6_SIGNED, K8, K10, K14, K14_EVEN, K16,
    SHIFT_ACC, /* bits 10..7, signed */
    BIT_NUMBER,/* bits 15..12 */
    RELATIVE,  /* words from the next instruction, bits 15..0 */
    RELATIVE_2,/* the same in the second word (DO) */
    TARGET,    /* CALL, GOTO */
    ACC,       /* bit 15 */
    PRODUCT,   /* Wm*Wn, bits 18..16 */
    SQUARE,    /* Wm*Wm, bits 17..16 */
    PREFETCH,  /* X, Y */
    PREFETCH_AWB,
    DISTANCE   /* [Wx], [Wy], Wxd (ED, EDAC) */
} operand_t;

enum { OPERANDS = 4 };

typedef struct insn insn_t;
typedef void handler_t(iss_t *m, const insn_t *i);

/* A row of the decoder's table. */
typedef struct {
    const char *name;
    operand_t operand[OPERANDS];
    uint32_t value, mask;
    handler_t *word, *byte;  /* byte: handler for byte operands, NULL if there is none */
    uint16_t writes;         /* W registers written beside the operands */
    uint16_t points;         /* W registers used as destination addresses beside the operands */
    uint16_t reads;          /* W registers used as source addresses beside the operands */
    uint8_t cycles;
    uint8_t taken;           /* more cycles of a branch that is taken, for each word of a skip that is */
    iss_flow_t flow;
    uint32_t byte_bit;       /* 0 means the usual bit 14 */
} row_t;

/* An instruction ready to run. Fields mean what the row's operands make of them. */
struct insn {
    handler_t *run;
    uint16_t stall;    /* W registers whose change by the instruction before costs a stall */
    uint16_t points;   /* W registers used as addresses */
    uint16_t writes;   /* W registers changed: initialised, and not ready as a source address of the next instruction */
    uint16_t k;        /* literal, file address, flash index of a target */
    uint8_t s, d, w;   /* registers */
    uint8_t p, q;      /* addressing modes of s and d */
    uint8_t x, y, i, j; /* prefetch: W numbers of the targets, codes of the addresses */
    uint8_t a;         /* write-back */
    uint8_t b;         /* bit number or accumulator */
    uint8_t cycles, taken, words;
};

enum { CODE_OUTSIDE = ISS_PROGRAM_WORDS }; /* index of the instruction that stands for all memory outside the flash */

/* ---- state ---- */

enum { NESTING = 24, ISS_TEXT = 256, ISS_LATCHES = 64 };

typedef struct {
    uint16_t (*read)(void *context, uint16_t address);
    void (*write)(void *context, uint16_t address, uint16_t value, uint16_t mask);
    void *context;
} sfr_hook_t;

typedef enum { SFR_PLAIN, SFR_CORE, SFR_HOOKED } sfr_kind_t;

typedef struct {
    uint16_t dcount;
    uint32_t start, end;
} do_shadow_t;

typedef struct watch watch_t; /* iss_watch.c */

struct iss {
    uint64_t cycle;     /* instruction cycles since iss_create() */
    uint64_t limit;     /* the fast loop runs to here; 0: it has to look at something */
    uint64_t count;     /* instructions executed */
    uint32_t pc;        /* flash index of the next instruction */
    uint16_t written;   /* insn_t.writes of the last one */
    uint16_t unknown_w; /* W registers that have not been written since the reset */
    const insn_t *current, *do_end;
    int64_t acc[2];
    bool bent;          /* modulo or bit-reversed addressing is on */
    bool attention;     /* interrupts have to be looked at */
    bool edt;           /* DO ends with this turn */
    bool repeat_edge;   /* this turn of REPEAT is the first, or the first after an interrupt */
    uint16_t stack_base, stack_top;

    uint64_t until, wake_at, disi_end, trap_at;
    iss_stop_t stop;
    bool stuck;         /* a word of data memory is damaged: stuck_at holds after every instruction */
    uint16_t stuck_address, stuck_at_1, stuck_at_0;
    iss_power_t power;
    uint32_t lost_pc;   /* where outside the flash */
    do_shadow_t do_shadow;
    uint16_t shadow_w[4], shadow_sr;
    uint8_t nest[NESTING];
    unsigned nested;

    unsigned stop_mask;
    char error[ISS_TEXT];
    uint32_t *profile_counts;
    uint64_t *profile_cycles;
    uint64_t profile_mark;
    iss_profile_t profiling;
    watch_t *watch;     /* NULL: no handler is watched */

    void (*on_report)(void *, iss_error_t, uint32_t, const char *);
    void *report_context;
    const char *(*on_symbol)(void *, bool, uint32_t, uint32_t *);
    void *symbol_context;
    void (*on_clrwdt)(void *);
    void *clrwdt_context;
    void (*on_reset)(void *, chip_reset_t);
    void *reset_context;
    void (*on_enter)(void *, unsigned, uint64_t);
    void (*on_leave)(void *, unsigned, uint64_t);
    void *interrupt_context;

    uint32_t latch[ISS_LATCHES]; /* table writes, for the flash's next row */
    uint32_t latched;            /* index of the last one's word in the flash */

    uint32_t config[ISS_CONFIG_WORDS];
    uint8_t sfr_kind[SFR_WORDS];
    sfr_hook_t hook[SFR_WORDS];
    uint16_t known[(ISS_RAM_END - ISS_RAM_START) / 2]; /* 0x00FF, 0xFF00: byte has been written */
    uint16_t data[ISS_DATA_WORDS];
    insn_t code[ISS_PROGRAM_WORDS + 1];
    uint32_t program[ISS_PROGRAM_WORDS];
    uint8_t programmed[ISS_PROGRAM_WORDS];
};

/* ---- between the files ---- */

/* iss_registers.c */
void iss_demand_reset(iss_t *m, chip_reset_t cause);
void iss_refresh(iss_t *m);
void iss_refresh_do(iss_t *m);
void iss_raise_trap(iss_t *m, unsigned intcon1_bits);

/* iss_memory.c: everything but known RAM at an aligned address */
unsigned iss_load16_slow(iss_t *m, unsigned address);
unsigned iss_load8_slow(iss_t *m, unsigned address);
void iss_store16_slow(iss_t *m, unsigned address, unsigned value);
void iss_store8_slow(iss_t *m, unsigned address, unsigned value);
unsigned iss_bent_address(iss_t *m, unsigned reg, unsigned mode, unsigned index, unsigned step, bool writes);
void iss_stack_access(iss_t *m, unsigned address);
unsigned iss_step_modulo(const iss_t *m, unsigned address, int step, bool y_space);
uint16_t iss_core_read(iss_t *m, unsigned index);
void iss_core_write(iss_t *m, unsigned index, unsigned value, unsigned mask);
uint32_t iss_table_word(iss_t *m, uint32_t address);
void iss_table_write(iss_t *m, uint32_t address, uint32_t value, uint32_t mask);

/* iss_irq.c */
void iss_serve(iss_t *m);
bool iss_exception_pending(const iss_t *m);
void iss_left_exception(iss_t *m);

/* iss_watch.c; all but the first need a core that has a watch */
void iss_watch_forget(iss_t *m);
void iss_watch_enter(iss_t *m, unsigned vector);
void iss_watch_leave(iss_t *m, unsigned vector);
void iss_watch_instruction(iss_t *m, uint32_t index, unsigned handlers);

/* iss_report.c */
void iss_report(iss_t *m, iss_error_t kind, const char *format, ...) __attribute__((format(printf, 3, 4)));
const char *iss_place(const iss_t *m, bool data, uint32_t address, char *buffer, size_t size);

/* iss_decode.c */
void iss_decode(iss_t *m, uint32_t index);
const row_t *iss_fill(insn_t *i, uint32_t word, uint32_t next, uint32_t index);
bool iss_row_is_byte(const row_t *row, uint32_t word);

/* iss_multiply.c */
bool iss_is_divide(const insn_t *i);

/* Rows by groups of instructions; each ends with a row without a name. */
extern const row_t iss_rows_alu[], iss_rows_bit[], iss_rows_move[], iss_rows_multiply[], iss_rows_flow[], iss_rows_dsp[];

/* Handlers that are not in a row: iss_flow.c */
handler_t iss_op_illegal, iss_op_erased, iss_op_outside;

static inline void iss_attend(iss_t *m)
{
    m->attention = true;
    m->limit = 0;
}

static inline uint32_t iss_here(const iss_t *m)
{
    return m->current == NULL ? 2u * m->pc : 2u * (uint32_t)(m->current - m->code);
}

static inline unsigned iss_level(const iss_t *m)
{
    return (m->data[R_CORCON] & CORCON_IPL3) | ((m->data[R_SR] & SR_IPL) >> 5);
}

/* Bit 0 of W15 is always 0. */
static inline void set_w(iss_t *m, unsigned n, unsigned value)
{
    m->data[n] = (uint16_t)value;
    m->data[15] &= 0xFFFEu;
}

static inline int as_int16(unsigned value)
{
    return (int)(int16_t)(uint16_t)value;
}

static inline void flag(iss_t *m, unsigned bit, bool on)
{
    unsigned sr = m->data[R_SR];
    m->data[R_SR] = (uint16_t)(on ? sr | bit : sr & ~bit);
}

/* Go to a PC address. */
static inline void jump(iss_t *m, uint32_t pc)
{
    uint32_t index = (pc & 0x7FFFFFu) / 2u;
    if (index < ISS_PROGRAM_WORDS) {
        m->pc = index;
    } else {
        m->lost_pc = pc & 0x7FFFFEu;
        m->pc = CODE_OUTSIDE;
    }
}

#endif
