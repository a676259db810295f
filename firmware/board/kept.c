/* Parameters that outlive a reset: two copies in the flash's last two pages, written only while the bridge is off (docs/kept.md). */
#include "board/kept.h"

#if PARAMS_KEPT
#include "board/mclv.h"
#include "board/status.h"
#include "drive/param_init.h"

/* ---- What is kept ---- */

/** A stretch of board_params and the range of its words. */
typedef struct {
    uint16_t place; /* its words, above bit 8; and its first one */
    int16_t least, most;
} kept_range_t;

#define KEPT_PLACE(field) (__builtin_offsetof(drive_params_t, field) / 2u)
#define KEPT_SIZE(first, last) (KEPT_PLACE(last) + sizeof(((drive_params_t *)0)->last) / 2u - KEPT_PLACE(first))
#define KEPT_RANGE_ROW(first, last, least, most) { (uint16_t)((KEPT_SIZE(first, last) << 8) + KEPT_PLACE(first)), (least), (most) },
#define KEPT_RANGE_OF(name, unit, min, max, value, meaning) KEPT_PICK(KEPT_OF_##name, KEPT_NOT)(KEPT_RANGE_ROW, min, max)

typedef int16_t __attribute__((may_alias)) kept_word_t; /* any of board_params */

#define ROWS (sizeof ranges / sizeof ranges[0])
static const kept_range_t ranges[] = { KEPT_GAINS(KEPT_RANGE_ROW) PARAM_TABLE(KEPT_RANGE_OF) };

static uint16_t of_header[KEPT_WORDS]; /* the values that the compiler's start-up code has put into RAM */

/* ---- A copy: version of ranges and header, number of the copy, values, CRC of all that ---- */

#define AT_VERSION 0u
#define AT_NUMBER 1u
#define AT_VALUES 2u
#define AT_CRC (AT_VALUES + KEPT_WORDS)

#ifdef __XC16__
/** The two pages, which the linker leaves free and the HEX file leaves erased. */
const uint16_t board_kept_pages[KEPT_PAGES * KEPT_PAGE_SIZE / 2u] __attribute__((space(prog), address(KEPT_AT), noload, keep, externally_visible));
#endif

#define NVM_ERASE_PAGE 0x4042u
#define NVM_PROGRAM_WORD 0x4003u

kept_t kept_command;

static uint16_t kept_version, kept_wrong;      /* a value in RAM is outside its range */
static uint16_t kept_newest, kept_number;      /* page of the copy in use, or of the one to be written last; that copy's */
static uint16_t kept_since_ms, kept_coasts_ms; /* since they were compared; so long may the rotor coast yet */

#define FIRST_PAGE KEPT_AT
#define SECOND_PAGE (KEPT_AT + KEPT_PAGE_SIZE)
#define OTHER_PAGE(page) ((uint16_t)((page) ^ (FIRST_PAGE ^ SECOND_PAGE)))

static uint16_t kept_read_word(uint16_t page, uint16_t n)
{
    return (uint16_t)__builtin_tblrdl((uint16_t)(page + 2u * n));
}

/** The processor stands meanwhile: 27 ms for a page at most, 56 us for a word [?]. The watchdog's time is longer (main.c). What the converter has
 *  sampled is then late for its duties, and left out. */
static void kept_nvm(uint16_t operation)
{
    NVMCON = operation;
    ClrWdt();
    SET_CPU_IPL(7);
    __builtin_write_NVM();
    IFS0bits.AD1IF = 0;
    SET_CPU_IPL(0); /* the background's */
}

static void kept_write_word(uint16_t page, uint16_t n, uint16_t word)
{
    uint16_t at = (uint16_t)(page + 2u * n);
    __builtin_tblwtl(at, word);
    __builtin_tblwth(at, 0xFFFFu); /* as an instruction it does nothing */
    kept_nvm(NVM_PROGRAM_WORD);
}

/** The high byte first: the CRC behind its words makes 0. */
static uint16_t kept_crc_of(uint16_t crc, uint16_t word)
{
    return selftest_crc(selftest_crc(crc, word >> 8), word & 0xFFu);
}

/** @return KEPT_KEPT for a copy that is whole; KEPT_OTHER, KEPT_NONE for an erased page, KEPT_BROKEN */
static uint16_t kept_judge(uint16_t page)
{
    uint16_t crc = SELFTEST_CRC_START, n;
    const uint16_t found = kept_read_word(page, AT_VERSION);
    for (n = 0; n <= AT_CRC; n++) {
        crc = kept_crc_of(crc, kept_read_word(page, n));
    }
    if (crc == 0u) {
        return (uint16_t)((found == kept_version) ? KEPT_KEPT : KEPT_OTHER);
    }
    return (uint16_t)((found == 0xFFFFu) ? KEPT_NONE : KEPT_BROKEN);
}

/** Which copy counts, and what is to be said of both. */
static void kept_look(void)
{
    const uint16_t first = kept_judge(FIRST_PAGE), second = kept_judge(SECOND_PAGE);
    kept_newest = FIRST_PAGE;
    kept_number = kept_read_word(FIRST_PAGE, AT_NUMBER);
    if (second == (uint16_t)KEPT_KEPT) {
        const uint16_t other = kept_read_word(SECOND_PAGE, AT_NUMBER);
        if (first != (uint16_t)KEPT_KEPT || (uint16_t)(other - kept_number) < 0x8000u) {
            kept_newest = SECOND_PAGE;
            kept_number = other;
        }
    }
    kept_command.copies = (first == second) ? first : (first == (uint16_t)KEPT_KEPT || second == (uint16_t)KEPT_KEPT) ? (uint16_t)KEPT_ONE_COPY
                                                                                                                      : (uint16_t)PARAM_MAX(first, second);
}

static uint16_t kept_holds(void)
{
    return (uint16_t)(kept_command.copies == (uint16_t)KEPT_KEPT || kept_command.copies == (uint16_t)KEPT_ONE_COPY);
}

/** What a reset would bring: word n of the copy in use, or of the header. */
static uint16_t kept_value_of(uint16_t n)
{
    return kept_holds() ? kept_read_word(kept_newest, (uint16_t)(AT_VALUES + n)) : of_header[n];
}

/** What kept_walk() does beside comparing; anything else: writes them to that page. */
enum { WALK_COMPARE,
       WALK_LEARN, /* they are the header's */
       WALK_SET /* to what a reset would bring */ };

/** One value of a walk. @return it, as it is now */
static int16_t kept_visit(uint16_t job, kept_word_t *at, uint16_t n)
{
    if (job == (uint16_t)WALK_LEARN) {
        of_header[n] = (uint16_t)*at;
    } else if (job == (uint16_t)WALK_SET) {
        *at = (int16_t)kept_value_of(n);
    } else if (job >= KEPT_AT) {
        kept_write_word(job, (uint16_t)(AT_VALUES + n), (uint16_t)*at);
    } else { /* no more */
    }
    return *at;
}

/** All values in their order: outside their range? other than what a reset would bring? @return their CRC, behind `start` */
static uint16_t kept_walk(uint16_t job, uint16_t start)
{
    const kept_range_t *range;
    uint16_t left, n = 0, crc = start, unsaved = 0;
    kept_wrong = 0;
    for (range = ranges; range != &ranges[ROWS]; range++) {
        kept_word_t *at = (kept_word_t *)(void *)&board_params + (range->place & 0xFFu);
        for (left = range->place >> 8; left != 0u; left--) {
            const int16_t value = kept_visit(job, at, n);
            unsaved = (uint16_t)(unsaved + ((uint16_t)value != kept_value_of(n)));
            if (value < range->least || value > range->most) {
                kept_wrong = 1;
            }
            crc = kept_crc_of(crc, (uint16_t)value);
            at++;
            n++;
        }
    }
    kept_command.unsaved = unsaved;
    return crc;
}

/** A slope of the speed reference within SPEEDREFRAMP_RPM_PER_S's range. */
static uint16_t kept_slope_fits(int32_t slope_q16)
{
    return (uint16_t)(slope_q16 >= KEPT_SLOPE_LEAST && slope_q16 <= KEPT_SLOPE_MOST);
}

#define KEPT_HOLDS(condition) &&(condition)

/** The values in RAM, after a walk. */
static uint16_t kept_may_be_used(void)
{
    const drive_params_t *p = &board_params;
    return (uint16_t)(!kept_wrong KEPT_RELATION_TABLE(KEPT_HOLDS));
}

void kept_init(void)
{
    uint16_t n;
    TBLPAG = 0;
    kept_version = kept_walk(WALK_LEARN, SELFTEST_CRC_START);
    for (n = 0; n < sizeof ranges / 2u; n++) {
        kept_version = kept_crc_of(kept_version, ((const uint16_t *)(const void *)ranges)[n]);
    }
    kept_look();
    (void)kept_walk(WALK_SET, 0);
    if (kept_holds() && !kept_may_be_used()) {
        kept_command.copies = KEPT_RANGE;
        (void)kept_walk(WALK_SET, 0);
    }
}

static void kept_erase(uint16_t page)
{
    __builtin_tblwtl(page, 0xFFFFu);
    kept_nvm(NVM_ERASE_PAGE);
}

/** The CRC comes last: before it the copy is not whole. */
static void kept_write_copy(uint16_t page)
{
    uint16_t crc = kept_crc_of(kept_crc_of(SELFTEST_CRC_START, kept_version), kept_number);
    kept_erase(page);
    kept_write_word(page, AT_VERSION, kept_version);
    kept_write_word(page, AT_NUMBER, kept_number);
    kept_write_word(page, AT_CRC, kept_walk(page, crc));
}

/** The older copy first: one of both is whole all the time. */
static uint16_t kept_keep(void)
{
    const uint16_t last = kept_newest;
    (void)kept_walk(WALK_COMPARE, 0);
    if (!kept_may_be_used()) {
        return KEPT_RESULT_RANGE;
    }
    kept_number = (uint16_t)(kept_number + 1u); /* wraps */
    kept_write_copy(OTHER_PAGE(last));
    if (kept_judge(OTHER_PAGE(last)) == (uint16_t)KEPT_KEPT) {
        kept_write_copy(last);
    }
    kept_look();
    return (uint16_t)((kept_command.copies == (uint16_t)KEPT_KEPT) ? KEPT_RESULT_DONE : KEPT_RESULT_FLASH);
}

static uint16_t kept_forget(void)
{
    kept_erase(OTHER_PAGE(kept_newest));
    kept_erase(kept_newest);
    kept_look();
    (void)kept_walk(WALK_SET, 0);
    return (uint16_t)((kept_command.copies == (uint16_t)KEPT_NONE) ? KEPT_RESULT_DONE : KEPT_RESULT_FLASH);
}

/** A start is the background's own: none comes in between. What coasts has been counted since the bridge was on. */
static uint16_t kept_serve(uint16_t request)
{
    if (board_drive.state != (uint16_t)DRIVE_STOPPED || board_drive.command.run || kept_coasts_ms != 0u) {
        return KEPT_RESULT_NOT_STOPPED;
    }
    return (request == (uint16_t)KEPT_ASK_KEEP) ? kept_keep() : kept_forget();
}

void kept_tick(uint16_t elapsed_ms)
{
    const uint16_t request = kept_command.request;
    kept_command.request = 0;
    if (P1OVDCON != BOARD_OUTPUTS_OFF) {
        kept_coasts_ms = KEPT_COAST_MS;
    } else if (kept_coasts_ms != 0u) {
        kept_coasts_ms--;
    } else { /* the rotor stands */
    }
    kept_since_ms = (uint16_t)(kept_since_ms + elapsed_ms);
    if (request == (uint16_t)KEPT_ASK_KEEP || request == (uint16_t)KEPT_ASK_FORGET) {
        kept_command.result = kept_serve(request);
        kept_since_ms = 100;
    }
    if (kept_since_ms >= 100u) {
        kept_since_ms = 0;
        (void)kept_walk(WALK_COMPARE, 0);
    }
}

#define KEPT_NAME(number, name, meaning) #name "\0"

char *kept_put(char *at)
{
    const char *name = KEPT_STATE_TABLE(KEPT_NAME);
    uint16_t left;
    if (kept_command.copies < (uint16_t)KEPT_ONE_COPY) {
        return at;
    }
    for (left = kept_command.copies; left != 0u; left--) {
        name = text_next(name);
    }
    return text_put(text_put(at, " kept "), name);
}
#endif
