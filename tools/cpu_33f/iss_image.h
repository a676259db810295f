/* What a program puts into the chip: its words and the names in it, as tools/image/load.py reads them from an ELF or HEX file.
 *
 * It comes as text, a line each: "word ADDRESS VALUE" and "SPACE ADDRESS SIZE NAME", SPACE being code, data or persistent; numbers are
 * hexadecimal. The Python side has checked the file; here only what would leave the memory is refused.
 */
#ifndef FOC33_CPU_33F_ISS_IMAGE_H
#define FOC33_CPU_33F_ISS_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "iss.h"

/* One name. `address` is a PC address (code) or a byte address (data), `size` in the same unit, 0 = unknown. */
typedef struct {
    char *name;      /* as in C */
    uint32_t address, size;
    bool data;
    bool persistent; /* a variable that the start-up code leaves alone: it is read before it is written, on purpose */
} iss_symbol_t;

typedef struct {
    uint32_t program[ISS_PROGRAM_WORDS]; /* ISS_ERASED where nothing is programmed */
    uint32_t config[ISS_CONFIG_WORDS];
    iss_symbol_t *symbols; /* in the order of the lines: by space, then address */
    size_t symbol_count;
} iss_image_t;

/* Reads the text, or a file with it. 0, or the number of the first line that cannot be; -1: no file or memory. Free the image anyway. */
int iss_image_parse(iss_image_t *image, const char *text);
int iss_image_read(iss_image_t *image, const char *path);
void iss_image_free(iss_image_t *image);

/* The data symbol of this name, NULL if there is none. */
const iss_symbol_t *iss_image_find(const iss_image_t *image, const char *name);

/* The name at or below an address, for iss_on_symbol(); context: the image. */
const char *iss_image_name(void *image, bool data, uint32_t address, uint32_t *offset);

#endif
