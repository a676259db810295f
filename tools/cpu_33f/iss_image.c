/* A program's words and names from text. */
#include "iss_image.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINE = 512 };

static bool put_word(iss_image_t *image, uint32_t pc, uint32_t word)
{
    bool config = pc >= ISS_CONFIG_START;
    uint32_t n = (config ? pc - ISS_CONFIG_START : pc) / 2u;
    if ((pc & 1u) != 0 || n >= (config ? ISS_CONFIG_WORDS : ISS_PROGRAM_WORDS)) {
        return false;
    }
    *(config ? &image->config[n] : &image->program[n]) = word & 0xFFFFFFu;
    return true;
}

static bool put_symbol(iss_image_t *image, const char *space, uint32_t address, uint32_t size, const char *name)
{
    bool persistent = strcmp(space, "persistent") == 0;
    bool data = persistent || strcmp(space, "data") == 0;
    if (!data && strcmp(space, "code") != 0) {
        return false;
    }
    image->symbols[image->symbol_count] = (iss_symbol_t){malloc(strlen(name) + 1u), address, size, data, persistent};
    if (image->symbols[image->symbol_count].name == NULL) {
        return false;
    }
    memcpy(image->symbols[image->symbol_count++].name, name, strlen(name) + 1u);
    return true;
}

static bool put_line(iss_image_t *image, const char *line)
{
    char kind[16], name[LINE];
    unsigned long address = 0, size = 0;
    if (sscanf(line, "word %lx %lx", &address, &size) == 2) {
        return put_word(image, (uint32_t)address, (uint32_t)size);
    }
    return sscanf(line, "%15s %lx %lx %511s", kind, &address, &size, name) == 4
           && put_symbol(image, kind, (uint32_t)address, (uint32_t)size, name);
}

int iss_image_parse(iss_image_t *image, const char *text)
{
    size_t lines = 1;
    memset(image, 0, sizeof *image);
    for (size_t n = 0; n < ISS_PROGRAM_WORDS; n++) {
        image->program[n] = ISS_ERASED;
    }
    for (size_t n = 0; n < ISS_CONFIG_WORDS; n++) {
        image->config[n] = ISS_ERASED;
    }
    for (const char *c = text; *c != '\0'; c++) {
        lines += *c == '\n';
    }
    image->symbols = calloc(lines, sizeof *image->symbols);
    if (image->symbols == NULL) {
        return -1;
    }
    for (int number = 1; *text != '\0'; number++) {
        char line[LINE];
        size_t length = strcspn(text, "\n");
        if (length >= sizeof line) {
            return number;
        }
        memcpy(line, text, length);
        line[length] = '\0';
        if (!put_line(image, line)) {
            return number;
        }
        text += length + (text[length] == '\n');
    }
    return 0;
}

int iss_image_read(iss_image_t *image, const char *path)
{
    FILE *file = fopen(path, "rb");
    long size = -1;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
        size = ftell(file);
        rewind(file);
    }
    char *text = size >= 0 ? calloc(1, (size_t)size + 1u) : NULL;
    int result = text != NULL && fread(text, 1, (size_t)size, file) == (size_t)size ? iss_image_parse(image, text) : -1;
    free(text);
    if (file != NULL) {
        (void)fclose(file);
    }
    return result;
}

void iss_image_free(iss_image_t *image)
{
    for (size_t n = 0; n < image->symbol_count; n++) {
        free(image->symbols[n].name);
    }
    free(image->symbols);
    image->symbols = NULL;
    image->symbol_count = 0;
}

const iss_symbol_t *iss_image_find(const iss_image_t *image, const char *name)
{
    for (size_t n = 0; n < image->symbol_count; n++) {
        if (image->symbols[n].data && strcmp(image->symbols[n].name, name) == 0) {
            return &image->symbols[n];
        }
    }
    return NULL;
}

const char *iss_image_name(void *context, bool data, uint32_t address, uint32_t *offset)
{
    const iss_image_t *image = context;
    const iss_symbol_t *found = NULL;
    for (size_t n = 0; n < image->symbol_count; n++) { /* the first of those with the highest address that is not above */
        const iss_symbol_t *s = &image->symbols[n];
        if (s->data == data && s->address <= address && (found == NULL || s->address > found->address)) {
            found = s;
        }
    }
    if (found == NULL || (found->size != 0 && address - found->address >= found->size)) {
        return NULL;
    }
    *offset = address - found->address;
    return found->name;
}
