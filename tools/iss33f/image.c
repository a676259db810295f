/* The image of a chip's memory: contents, checks that do not depend on the file's kind, and look-up of names. */
#include "image.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LARGEST_FILE = 64 << 20, GOTO = 0x040000, BRA = 0x370000 };

void image_clear(image_t *image)
{
    memset(image, 0, sizeof *image);
    for (size_t n = 0; n < IMAGE_WORDS; n++) {
        image->program[n] = IMAGE_ERASED;
    }
    for (size_t n = 0; n < IMAGE_CONFIG_WORDS; n++) {
        image->config[n] = IMAGE_ERASED;
    }
}

void image_free(image_t *image)
{
    free(image->symbols);
    free(image->names);
    image_clear(image);
}

/* A text that came from a file stays on one line. */
static void make_printable(char *text)
{
    for (; *text != '\0'; text++) {
        if ((unsigned char)*text < ' ' || *text == 0x7F) {
            *text = '?';
        }
    }
}

int image_fail(image_t *image, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    (void)vsnprintf(image->error, sizeof image->error, format, args);
    va_end(args);
    make_printable(image->error);
    return -1;
}

bool image_holds(uint32_t pc)
{
    return pc < IMAGE_PROGRAM_END
           || (pc >= IMAGE_CONFIG_START && pc < (uint32_t)IMAGE_CONFIG_START + 2u * (uint32_t)IMAGE_CONFIG_WORDS);
}

int image_put(image_t *image, uint32_t pc, uint32_t word, const char *name)
{
    if ((pc & 1u) != 0 || !image_holds(pc)) {
        return image_fail(image, "address 0x%lX is outside the 33FJ32MC204, %s: build for that device", (unsigned long)pc, name);
    }
    bool config = pc >= IMAGE_CONFIG_START;
    size_t n = (config ? pc - IMAGE_CONFIG_START : pc) / 2u;
    uint8_t *used = config ? &image->configured[n] : &image->programmed[n];
    if (*used != 0) {
        return image_fail(image, "address 0x%lX has two contents, %s: two parts of the file overlap, build it again", (unsigned long)pc, name);
    }
    *used = 1;
    *(config ? &image->config[n] : &image->program[n]) = word & 0xFFFFFFu;
    return 0;
}

/* Where the reset instruction leads; false if it is neither GOTO nor BRA. */
static bool reset_target(const image_t *image, uint32_t *target)
{
    uint32_t first = image->program[0];
    if ((first & 0xFF0001u) == GOTO) {
        *target = (first & 0xFFFEu) | ((image->program[1] & 0x7Fu) << 16);
        return image->programmed[1] != 0;
    }
    *target = (2u + 2u * (uint32_t)(int32_t)(int16_t)(uint16_t)first) & 0x7FFFFFu;
    return (first & 0xFF0000u) == BRA;
}

int image_check_reset(image_t *image, const char *name)
{
    uint32_t target = 0;
    if (image->programmed[0] == 0 || image->program[0] == IMAGE_ERASED) {
        return image_fail(image, "no reset vector at address 0, %s: link with the device's linker script", name);
    }
    if (!reset_target(image, &target)) {
        return image_fail(image, "0x%06lX at address 0 is no GOTO, %s: link with the device's linker script",
                          (unsigned long)image->program[0], name);
    }
    if (target >= IMAGE_PROGRAM_END || image->programmed[target / 2u] == 0) {
        return image_fail(image, "the reset vector leads to 0x%lX, where nothing is programmed, %s: build it again", (unsigned long)target, name);
    }
    return 0;
}

static int load_contents(image_t *image, const uint8_t *data, size_t size, const char *name)
{
    int result;
    if (size >= 4 && memcmp(data, "\177ELF", 4) == 0) {
        result = image_load_elf(image, data, size, name);
    } else if (size >= 1 && (data[0] == ':' || data[0] == '\r' || data[0] == '\n')) {
        result = image_load_hex(image, data, size, name);
    } else {
        return image_fail(image, "this is neither an ELF nor an Intel HEX file, %s: name what the linker or xc16-bin2hex wrote", name);
    }
    return result == 0 ? image_check_reset(image, name) : result;
}

/* The file's contents with a zero byte behind them; NULL with a text if it cannot be read. */
static uint8_t *read_file(image_t *image, FILE *file, const char *path, size_t *size)
{
    long length = -1;
    if (fseek(file, 0, SEEK_END) == 0) {
        length = ftell(file);
    }
    if (length < 0 || length > LARGEST_FILE || fseek(file, 0, SEEK_SET) != 0) {
        (void)image_fail(image, "the file cannot be read, %s: name an ELF or Intel HEX file", path);
        return NULL;
    }
    uint8_t *data = malloc((size_t)length + 1u);
    if (data == NULL) {
        (void)image_fail(image, "no memory for the file, %s: free some", path);
        return NULL;
    }
    *size = fread(data, 1, (size_t)length, file);
    data[*size] = 0;
    return data;
}

int image_load(image_t *image, const char *path)
{
    image_clear(image);
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return errno == ENOENT ? image_fail(image, "no such file, %s: build it with make firmware", path)
                               : image_fail(image, "the file cannot be opened (%s), %s: see that it can be read", strerror(errno), path);
    }
    size_t size = 0;
    uint8_t *data = read_file(image, file, path, &size);
    (void)fclose(file);
    if (data == NULL) {
        return -1;
    }
    int result = load_contents(image, data, size, path);
    free(data);
    return result;
}

const image_symbol_t *image_find(const image_t *image, image_space_t space, const char *name)
{
    for (size_t n = 0; n < image->symbol_count; n++) {
        if (image->symbols[n].space == space && strcmp(image->symbols[n].name, name) == 0) {
            return &image->symbols[n];
        }
    }
    return NULL;
}

const image_symbol_t *image_symbol_at(const image_t *image, image_space_t space, uint32_t address)
{
    size_t low = 0, high = image->symbol_count;
    while (low < high) { /* the first symbol that lies behind the address */
        size_t middle = low + (high - low) / 2u;
        const image_symbol_t *s = &image->symbols[middle];
        bool behind = s->space != space ? s->space > space : s->address > address;
        if (behind) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    if (low == 0 || image->symbols[low - 1u].space != space) {
        return NULL;
    }
    size_t n = low - 1u;
    while (n > 0 && image->symbols[n - 1u].space == space && image->symbols[n - 1u].address == image->symbols[n].address) {
        n--; /* functions come first */
    }
    const image_symbol_t *s = &image->symbols[n];
    return s->size == 0 || address - s->address < s->size ? s : NULL;
}
