/* Self-programming of the flash: NVMCON with its unlock sequence, and how long the processor stands. The flash itself is the processor's. */
#include "chip.h"
#include "chip_assumptions.h"

enum {
    WR = 0x8000, /* NVMCON */
    WREN = 0x4000,
    WRERR = 0x2000,
    OPERATION = 0x004F, /* ERASE and NVMOP */
    WRITABLE = WREN | WRERR | OPERATION,
    ERASE_PAGE = 0x42,
    PROGRAM_ROW = 0x01,
    PROGRAM_WORD = 0x03,
    FIRST_KEY = 0x55, /* NVMKEY */
    SECOND_KEY = 0xAA,
    UNLOCKED = 2
};

static void write_key(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    chip_nvm_t *nvm = &chip->nvm;
    unsigned key = value & mask & 0xFFu;
    bool follows = nvm->step == 1 && key == SECOND_KEY && chip_now(chip) - nvm->cycle <= ASSUME_UNLOCK_CYCLES;
    (void)address; /* it reads 0 */
    nvm->step = follows ? UNLOCKED : key == FIRST_KEY ? 1u : 0u;
    nvm->cycle = chip_now(chip);
}

typedef struct {
    unsigned operation, words;
    double us;
    bool erases;
} operation_t;

static const operation_t *operation_of(unsigned nvmcon)
{
    static const operation_t known[] = {{ERASE_PAGE, 512, ASSUME_NVM_ERASE_US, true},
                                        {PROGRAM_ROW, 64, ASSUME_NVM_ROW_US, false},
                                        {PROGRAM_WORD, 1, ASSUME_NVM_WORD_US, false}};
    for (size_t n = 0; n < sizeof known / sizeof known[0]; n++) {
        if (known[n].operation == (nvmcon & OPERATION)) {
            return &known[n];
        }
    }
    return NULL;
}

/* The operation is over when the processor goes on. */
static void carry_out(chip_t *chip, unsigned nvmcon)
{
    const operation_t *o = operation_of(nvmcon);
    bool open = chip->nvm.step == UNLOCKED && chip_now(chip) - chip->nvm.cycle <= ASSUME_UNLOCK_CYCLES;
    chip->nvm.step = 0;
    if (!open || (nvmcon & WREN) == 0 || o == NULL || chip->cpu.flash == NULL) {
        chip_warn(chip, o == NULL ? "NVMCON: 0x%04X is no operation" : "NVMCON: WR without WREN and the unlock sequence, 0x%04X: nothing is written", nvmcon);
        chip_put(chip, SFR_NVMCON, (nvmcon & WRITABLE) | WRERR);
        return;
    }
    chip_put(chip, SFR_NVMCON, nvmcon & WRITABLE);
    chip->nvm.operations += 1.0;
    chip->nvm.standing_s = o->us * 1e-6 + chip->plant->now_s;
    chip->cpu.flash(chip->cpu.context, o->erases, o->words, (uint64_t)(o->us * 1e-6 * chip->clock.fcy_hz));
}

static void write_nvmcon(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    chip_t *chip = context;
    unsigned nvmcon = chip_merged(chip, address, value, mask);
    if ((nvmcon & WR) != 0) {
        carry_out(chip, nvmcon);
    } else {
        chip_put(chip, address, nvmcon & WRITABLE);
    }
}

void chip_nvm_hooks(chip_t *chip)
{
    chip_hook(chip, SFR_NVMKEY, NULL, write_key);
    chip_hook(chip, SFR_NVMCON, NULL, write_nvmcon);
}
