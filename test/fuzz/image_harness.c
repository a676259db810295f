/* Feeds files to the image loaders: one file and its message, many seeded mutations of files, or whatever libFuzzer thinks of. */
#include "image.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static image_t image;

/* Everything that can be asked about a loaded image must be in order, whatever the file was. */
static void inspect(void)
{
    for (size_t n = 0; n < image.symbol_count; n++) {
        const image_symbol_t *s = &image.symbols[n];
        if (strlen(s->name) > 1u << 24 || image_symbol_at(&image, s->space, s->address) == NULL) {
            (void)image_find(&image, s->space, s->name);
        }
    }
    if (strchr(image.error, '\n') != NULL || strlen(image.error) >= sizeof image.error) {
        abort();
    }
}

static int load(const uint8_t *data, size_t size)
{
    image_clear(&image);
    bool elf = size >= 4 && memcmp(data, "\177ELF", 4) == 0;
    int result = elf ? image_load_elf(&image, data, size, "fuzz") : image_load_hex(&image, data, size, "fuzz");
    if (result == 0) {
        result = image_check_reset(&image, "fuzz");
    }
    if ((result != 0) != (image.error[0] != '\0')) {
        abort(); /* a failure without a text, or the reverse */
    }
    inspect();
    image_free(&image);
    return result;
}

#ifdef LIBFUZZER
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    (void)load(data, size);
    return 0;
}
#else
static uint64_t state;

static uint32_t below(uint32_t limit)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(state >> 33) % limit;
}

/* One change: a bit, a byte, four bytes of an extreme number, a moved piece, or a cut. Returns the new size. */
static size_t mutate(uint8_t *data, size_t size)
{
    static const uint32_t odd[] = {0, 1, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFFFu, 0xFFFFFFF0u, 0x5800, 0xF80000u};
    size_t at = below((uint32_t)size);
    switch (below(6)) {
    case 0: data[at] = (uint8_t)(data[at] ^ (1u << below(8))); break;
    case 1: data[at] = (uint8_t)below(256); break;
    case 2:
        if (at + 4 <= size) {
            memcpy(data + at, &odd[below(8)], 4);
        }
        break;
    case 3: {
        size_t length = below((uint32_t)(size - at)) + 1u;
        memmove(data + below((uint32_t)(size - length + 1u)), data + at, length > 64 ? 64 : length);
        break;
    }
    case 4: data[at] = (uint8_t)"0123456789ABCDEF:\r\n"[below(19)]; break;
    default: return below(20) == 0 ? at + 1u : size;
    }
    return size;
}

static uint8_t *read_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    uint8_t *data = malloc(1u << 20);
    if (file == NULL || data == NULL) {
        abort();
    }
    *size = fread(data, 1, 1u << 20, file);
    (void)fclose(file);
    return data;
}

static void mutate_file(const char *path, unsigned count)
{
    size_t size = 0, accepted = 0;
    uint8_t *data = read_file(path, &size);
    for (unsigned n = 0; n < count; n++) {
        size_t length = size;
        uint8_t *copy = malloc(size);
        if (copy == NULL) {
            abort();
        }
        memcpy(copy, data, size);
        for (unsigned k = below(8) + 1u; k > 0 && length > 0; k--) {
            length = mutate(copy, length);
        }
        uint8_t *exact = realloc(copy, length); /* so that a byte too far is seen */
        accepted += exact != NULL && load(exact, length) == 0 ? 1u : 0u;
        free(exact);
    }
    free(data);
    printf("%s: %u mutations, %zu accepted\n", path, count, accepted);
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "--load") == 0) {
        int result = image_load(&image, argv[2]);
        if (result != 0) {
            fprintf(stderr, "foc33: %s\n", image.error);
        } else {
            const image_symbol_t *s = image_find(&image, IMAGE_CODE, "main");
            printf("0x%06lX 0x%06lX %s\n", (unsigned long)image.program[0], (unsigned long)image.config[IMAGE_FOSC], s != NULL ? s->name : "-");
        }
        image_free(&image);
        return result != 0 ? 2 : 0;
    }
    if (argc < 4) {
        return 1;
    }
    state = strtoull(argv[1], NULL, 0);
    for (int n = 3; n < argc; n++) {
        mutate_file(argv[n], (unsigned)strtoul(argv[2], NULL, 0));
    }
    return 0;
}
#endif
