/* What a file puts into the chip: program words, configuration words and the names in it; read from ELF or Intel HEX. */
#ifndef FOC33_ISS33F_IMAGE_H
#define FOC33_ISS33F_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    IMAGE_PROGRAM_END = 0x5800,              /* first PC address above the flash of the 33FJ32MC204 */
    IMAGE_WORDS = IMAGE_PROGRAM_END / 2,     /* its instruction words */
    IMAGE_CONFIG_START = 0xF80000,           /* PC address of the first configuration word */
    IMAGE_CONFIG_WORDS = 12,                 /* FBS, reserved, FGS, FOSCSEL, FOSC, FWDT, FPOR, FICD, FUID0..3 */
    IMAGE_ERROR = 320
};

/* Index of a configuration word in image_t.config. */
enum {
    IMAGE_FBS = 0, IMAGE_FGS = 2, IMAGE_FOSCSEL = 3, IMAGE_FOSC = 4, IMAGE_FWDT = 5, IMAGE_FPOR = 6, IMAGE_FICD = 7, IMAGE_FUID0 = 8
};

#define IMAGE_ERASED 0xFFFFFFu

/* Which memory an address belongs to. */
typedef enum { IMAGE_CODE, IMAGE_DATA } image_space_t;

/* One name of an ELF file. `address` is a PC address (code) or a byte address (data); `size` in the same unit, 0 = unknown. */
typedef struct {
    const char *name; /* as in C: without the leading underscore that the compiler puts before it */
    uint32_t address, size;
    image_space_t space;
    bool function;   /* the compiler marked it as a function */
    bool persistent; /* a variable that the start-up code leaves alone: it is read before it is written, on purpose */
} image_symbol_t;

/* A loaded file. `programmed` has one byte a word, 1 where the file has contents; other words are IMAGE_ERASED. */
typedef struct {
    uint32_t program[IMAGE_WORDS];
    uint8_t programmed[IMAGE_WORDS];
    uint32_t config[IMAGE_CONFIG_WORDS];
    uint8_t configured[IMAGE_CONFIG_WORDS];
    image_symbol_t *symbols; /* sorted by space, then address; functions before other names of the same address */
    size_t symbol_count;
    char *names;             /* the symbols' texts */
    char error[IMAGE_ERROR]; /* after a failure: one line "what, where: what to do" */
} image_t;

/* Everything erased, no symbols. */
void image_clear(image_t *image);

/* Frees what the loaders allocated and clears the image. */
void image_free(image_t *image);

/* Read the file at `path`, ELF or Intel HEX by its first characters. 0, or -1 with the text in image->error. The image is cleared first. */
int image_load(image_t *image, const char *path);

/* The same for a file's contents; `name` is what the messages call it. They add to a cleared image and do not look at the reset vector. */
int image_load_elf(image_t *image, const uint8_t *data, size_t size, const char *name);
int image_load_hex(image_t *image, const uint8_t *data, size_t size, const char *name);

/* 0 if address 0 holds an instruction that leads to programmed memory; otherwise -1 with a text. */
int image_check_reset(image_t *image, const char *name);

/* The data or code symbol of this name, NULL if there is none. */
const image_symbol_t *image_find(const image_t *image, image_space_t space, const char *name);

/* The symbol that covers the address, or the nearest below it where sizes are unknown; NULL if there is none. */
const image_symbol_t *image_symbol_at(const image_t *image, image_space_t space, uint32_t address);

/* For the loaders. image_fail() notes a text and returns -1; image_put() stores one instruction word. */
int image_fail(image_t *image, const char *format, ...) __attribute__((format(printf, 2, 3)));
int image_put(image_t *image, uint32_t pc, uint32_t word, const char *name);
bool image_holds(uint32_t pc);

#endif
