/* Data memory beyond known RAM: registers and hooks, the PSV window, addresses that do not exist; modulo and bit-reversed addressing, stack limits. */
#include "iss_state.h"

/* ---- errors ---- */

static void address_error(iss_t *m, const char *what, unsigned address)
{
    char text[96];
    iss_report(m, ISS_ERROR_TRAP, "%s %s: address error trap", what, iss_place(m, true, address, text, sizeof text));
    iss_raise_trap(m, INTCON1_ADDRERR);
}

static void unknown_ram(iss_t *m, unsigned address, unsigned bytes)
{
    char text[96];
    iss_report(m, ISS_ERROR_UNKNOWN_RAM, "RAM read before it was written, %s", iss_place(m, true, address, text, sizeof text));
    iss_ram_known(m, (uint16_t)address, bytes, true); /* told once */
}

/* ---- program memory seen by instructions ---- */

/* The word at a byte-wise address of program memory, flash or configuration. */
uint32_t iss_table_word(iss_t *m, uint32_t address)
{
    uint32_t index = address / 2u;
    if (index < ISS_PROGRAM_WORDS) {
        return m->program[index];
    }
    if (address >= ISS_CONFIG_START && (address - ISS_CONFIG_START) / 2u < ISS_CONFIG_WORDS) {
        return m->config[(address - ISS_CONFIG_START) / 2u];
    }
    iss_report(m, ISS_ERROR_SPACE, "program memory is read at 0x%06X, where there is none", (unsigned)address);
    return ASSUME_OUTSIDE_FLASH_VALUE;
}

/* The bits of `mask` of a word go to its latch. */
void iss_table_write(iss_t *m, uint32_t address, uint32_t value, uint32_t mask)
{
    uint32_t *latch = &m->latch[address / 2u % ISS_LATCHES];
    m->latched = address / 2u;
    *latch = (*latch & ~mask) | (value & mask);
}

void iss_flash(iss_t *m, bool erases, unsigned words, uint64_t cycles)
{
    uint32_t first = m->latched & ~(words - 1u);
    for (uint32_t index = first; index < first + words; index++) {
        uint32_t latch = m->latch[index % ISS_LATCHES];
        if (index < ISS_PROGRAM_WORDS) {
            (void)iss_write_program(m, 2u * index, erases ? ISS_ERASED : m->program[index] & latch);
        }
    }
    for (unsigned n = 0; n < ISS_LATCHES; n++) {
        m->latch[n] = ISS_ERASED;
    }
    m->cycle += cycles;
}

static unsigned psv_cycles(iss_t *m)
{
    bool inner = (m->data[R_SR] & SR_RA) != 0 && m->data[R_RCOUNT] != 0 && !m->repeat_edge;
    return inner ? ASSUME_PSV_REPEAT_INNER_CYCLES : ASSUME_PSV_READ_CYCLES;
}

static unsigned read_psv(iss_t *m, unsigned address)
{
    if ((m->data[R_CORCON] & CORCON_PSV) == 0) {
        address_error(m, "read of", address);
        return 0;
    }
    m->cycle += psv_cycles(m);
    return iss_table_word(m, (uint32_t)(m->data[R_PSVPAG] & 0xFFu) << 15 | (address & 0x7FFEu)) & 0xFFFFu;
}

/* ---- registers ---- */

static unsigned disi_count(const iss_t *m)
{
    return m->disi_end > m->cycle ? (unsigned)(m->disi_end - m->cycle) & 0x3FFFu : 0u;
}

static uint16_t accumulator_part(const iss_t *m, unsigned index)
{
    unsigned part = (index - R_ACCAL) % 3u;
    uint64_t value = (uint64_t)m->acc[(index - R_ACCAL) / 3u];
    return (uint16_t)(value >> 16u * part);
}

uint16_t iss_core_read(iss_t *m, unsigned index)
{
    if (index >= R_ACCAL && index <= R_ACCBU) {
        return accumulator_part(m, index);
    }
    switch (index) {
    case R_PCL: return (uint16_t)(2u * m->pc);
    case R_PCH: return (uint16_t)(2u * m->pc >> 16);
    case R_DISICNT: return (uint16_t)disi_count(m);
    case R_INTCON2: return (uint16_t)((m->data[R_INTCON2] & ~(unsigned)INTCON2_DISI) | (disi_count(m) != 0 ? INTCON2_DISI : 0u));
    default: return m->data[index];
    }
}

static void write_accumulator(iss_t *m, unsigned index, unsigned value)
{
    unsigned part = (index - R_ACCAL) % 3u, which = (index - R_ACCAL) / 3u;
    uint64_t keep = (uint64_t)m->acc[which] & ~((uint64_t)0xFFFFu << 16u * part);
    iss_set_acc(m, which, (int64_t)(keep | (uint64_t)value << 16u * part));
}

/* OA, OB, OAB, RA and DA only show; SA and SB can only be cleared, SAB clears both. */
static void write_sr(iss_t *m, unsigned value)
{
    unsigned old = m->data[R_SR], fixed = SR_OA | SR_OB | SR_OAB | SR_RA | SR_DA;
    unsigned sticky = (value & SR_SAB) == 0 && (old & SR_SAB) != 0 ? 0u : old & value & (SR_SA | SR_SB);
    if ((m->data[R_INTCON1] & INTCON1_NSTDIS) != 0) {
        fixed |= SR_IPL;
    }
    unsigned sr = (old & fixed) | (value & ~(fixed | SR_SA | SR_SB | SR_SAB)) | sticky;
    m->data[R_SR] = (uint16_t)(sr | (sticky != 0 ? SR_SAB : 0u));
    iss_attend(m);
}

/* DL only shows, EDT is an order that reads 0, IPL3 can only be cleared. */
static void write_corcon(iss_t *m, unsigned value)
{
    unsigned old = m->data[R_CORCON], fixed = CORCON_DL;
    if ((value & CORCON_EDT) != 0) {
        m->edt = (m->data[R_SR] & SR_DA) != 0;
    }
    value &= (CORCON_US | 0x00FFu) & (old | ~(unsigned)CORCON_IPL3);
    m->data[R_CORCON] = (uint16_t)((old & fixed) | value);
    iss_attend(m);
}

static void write_do_register(iss_t *m, unsigned index, unsigned value)
{
    bool high = index == R_DOSTARTH || index == R_DOENDH;
    m->data[index] = (uint16_t)(index == R_DCOUNT ? value & 0x3FFFu : high ? value & 0x7Fu : value & 0xFFFEu);
    iss_refresh_do(m);
}

static void write_interrupt_register(iss_t *m, unsigned index, unsigned value)
{
    if (index == R_INTTREG) {
        return;
    }
    m->data[index] = (uint16_t)(index == R_INTCON2 ? value & ~(unsigned)INTCON2_DISI : value);
    iss_attend(m);
}

/* Write the bits of `mask` to a register of the core. */
void iss_core_write(iss_t *m, unsigned index, unsigned value, unsigned mask)
{
    value = (iss_core_read(m, index) & ~mask) | (value & mask);
    if (index < 16) {
        set_w(m, index, value);
        m->unknown_w &= (uint16_t)~(1u << index);
        m->written |= (uint16_t)(1u << index);
    } else if (index >= R_ACCAL && index <= R_ACCBU) {
        write_accumulator(m, index, value);
    } else if (index >= R_INTCON1) {
        write_interrupt_register(m, index, value);
    } else if (index >= R_DCOUNT && index <= R_DOENDH) {
        write_do_register(m, index, value);
    } else {
        switch (index) {
        case R_PCL: case R_PCH: break;
        case R_SPLIM: m->data[index] = (uint16_t)(value & 0xFFFEu); break;
        case R_RCOUNT: m->data[index] = (uint16_t)(value & 0x3FFFu); break;
        case R_TBLPAG: case R_PSVPAG: m->data[index] = (uint16_t)(value & 0xFFu); break;
        case R_SR: write_sr(m, value); break;
        case R_CORCON: write_corcon(m, value); break;
        case R_DISICNT: m->disi_end = m->cycle + (value & 0x3FFFu); iss_attend(m); break;
        default:
            m->data[index] = (uint16_t)value;
            iss_refresh(m);
            break;
        }
    }
}

static unsigned read_register(iss_t *m, unsigned address)
{
    unsigned index = address / 2u;
    const sfr_hook_t *hook = &m->hook[index];
    if (m->sfr_kind[index] == SFR_CORE) {
        return iss_core_read(m, index);
    }
    return hook->read != NULL ? hook->read(hook->context, (uint16_t)(address & ~1u)) : m->data[index];
}

static void write_register(iss_t *m, unsigned address, unsigned value, unsigned mask)
{
    unsigned index = address / 2u;
    const sfr_hook_t *hook = &m->hook[index];
    if (m->sfr_kind[index] == SFR_CORE) {
        iss_core_write(m, index, value, mask);
    } else if (hook->write != NULL) {
        hook->write(hook->context, (uint16_t)(address & ~1u), (uint16_t)value, (uint16_t)mask);
    } else {
        m->data[index] = (uint16_t)((m->data[index] & ~mask) | (value & mask));
    }
}

/* ---- what the fast paths leave ---- */

/* A word at an even address. */
static unsigned read_word(iss_t *m, unsigned address, unsigned reported, unsigned bytes)
{
    if (address < ISS_RAM_START) {
        return read_register(m, address);
    }
    if (address < ISS_RAM_END) {
        unknown_ram(m, reported, bytes);
        return m->data[address / 2u];
    }
    if (address < 0x8000u) {
        address_error(m, "read of", reported);
        return 0;
    }
    return read_psv(m, address);
}

unsigned iss_load16_slow(iss_t *m, unsigned address)
{
    if ((address & 1u) != 0) {
        address_error(m, "word read at odd", address);
        return 0;
    }
    return read_word(m, address, address, 2);
}

unsigned iss_load8_slow(iss_t *m, unsigned address)
{
    return read_word(m, address & ~1u, address, 1) >> 8u * (address & 1u) & 0xFFu;
}

void iss_store16_slow(iss_t *m, unsigned address, unsigned value)
{
    if ((address & 1u) != 0) {
        address_error(m, "word write at odd", address);
    } else if (address < ISS_RAM_START) {
        write_register(m, address, value, 0xFFFFu);
    } else {
        address_error(m, "write of", address);
    }
}

void iss_store8_slow(iss_t *m, unsigned address, unsigned value)
{
    unsigned shift = 8u * (address & 1u);
    if (address < ISS_RAM_START) {
        write_register(m, address & ~1u, (value & 0xFFu) << shift, 0xFFu << shift);
    } else {
        address_error(m, "write of", address);
    }
}

/* ---- stack ---- */

void iss_stack_access(iss_t *m, unsigned address)
{
    unsigned limit = m->data[R_SPLIM];
    if (address >= m->stack_top) {
        m->stack_top = (uint16_t)(address + 2u);
    }
    if ((limit != 0 && address > limit) || address < ISS_RAM_START) {
        iss_report(m, ISS_ERROR_TRAP, "stack at 0x%04X is %s: stack error trap", address, address < ISS_RAM_START ? "below the RAM" : "beyond SPLIM");
        iss_raise_trap(m, INTCON1_STKERR);
    }
}

/* ---- modulo and bit-reversed addressing ---- */

/* Pointer `reg` moved by `step` bytes, bent round where its buffer ends. Y modulo is for the DSP engine's Y pointers only. */
unsigned iss_step_modulo(const iss_t *m, unsigned reg, int step, bool y_space)
{
    unsigned modcon = m->data[R_MODCON], address = m->data[reg];
    unsigned moved = (unsigned)((int)address + step) & 0xFFFFu;
    bool on = y_space ? (modcon & 0x4000u) != 0 && (modcon >> 4 & 15u) == reg : (modcon & 0x8000u) != 0 && (modcon & 15u) == reg && reg != 15;
    unsigned start = m->data[y_space ? R_YMODSRT : R_XMODSRT], end = m->data[y_space ? R_YMODEND : R_XMODEND];
    unsigned length = end - start + 1u;
    if (!on) {
        return moved;
    }
    if (step > 0 && moved > end) {
        return (moved - length) & 0xFFFFu;
    }
    return step < 0 && moved < start ? (moved + length) & 0xFFFFu : moved;
}

/* Adds XBREV to an address with the carry running towards the lower bits; bit 0 stays. */
static unsigned step_reversed(const iss_t *m, unsigned address)
{
    unsigned bit = (m->data[R_XBREV] & 0x7FFFu) << 1;
    while (bit >= 2 && (address & bit) != 0) {
        address &= ~bit;
        bit >>= 1;
    }
    return bit >= 2 ? address | bit : address;
}

static bool is_reversed(const iss_t *m, unsigned reg, unsigned mode, unsigned step, bool writes)
{
    return writes && step == 2 && (mode == 3 || mode == 5) && (m->data[R_XBREV] & 0x8000u) != 0 && (m->data[R_MODCON] >> 8 & 15u) == reg &&
           reg != 15;
}

/* indirect() while one of both is on. */
unsigned iss_bent_address(iss_t *m, unsigned reg, unsigned mode, unsigned index, unsigned step, bool writes)
{
    unsigned address = m->data[reg], moved = address;
    int change = mode == 2 || mode == 4 ? -(int)step : mode == 3 || mode == 5 ? (int)step : mode >= 6 ? as_int16(m->data[index]) : 0;
    if (is_reversed(m, reg, mode, step, writes)) {
        moved = step_reversed(m, address);
    } else if (change != 0) {
        moved = iss_step_modulo(m, reg, change, false);
    }
    if (mode >= 2 && mode <= 5) {
        set_w(m, reg, moved);
    }
    address = mode >= 4 ? moved : address;
    if (reg == 15) {
        iss_stack_access(m, address);
    }
    return address;
}

/* ---- access from outside ---- */

uint16_t iss_peek(iss_t *m, uint16_t address)
{
    unsigned index = address / 2u;
    return index < SFR_WORDS && m->sfr_kind[index] == SFR_CORE ? iss_core_read(m, index) : m->data[index];
}

void iss_poke(iss_t *m, uint16_t address, uint16_t value)
{
    unsigned index = address / 2u;
    bool elsewhere = (index >= R_ACCAL && index <= R_ACCBU) || index == R_DISICNT;
    m->data[index] = value;
    if (elsewhere) {
        iss_core_write(m, index, value, 0xFFFFu);
    } else if (index < 16) {
        m->unknown_w &= (uint16_t)~(1u << index);
    }
    iss_ram_known(m, (uint16_t)(address & ~1u), 2, true);
    iss_refresh(m);
    iss_attend(m);
}

void iss_ram_known(iss_t *m, uint16_t address, unsigned bytes, bool known)
{
    for (unsigned n = 0; n < bytes; n++) {
        unsigned offset = address + n - ISS_RAM_START;
        if (offset < ISS_RAM_END - ISS_RAM_START) {
            unsigned mask = 0xFFu << 8u * (offset & 1u);
            m->known[offset / 2u] = (uint16_t)(known ? m->known[offset / 2u] | mask : m->known[offset / 2u] & ~mask);
        }
    }
}
