/* XC16's ELF files: 32 bits, little endian; addresses of program memory are PC addresses, four bytes of the file are one word. */
#include "image.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    EM_DSPIC30F = 118,
    ET_EXEC = 2,
    PT_LOAD = 1,
    SHT_PROGBITS = 1,
    SHT_SYMTAB = 2,
    SHF_WRITE = 1,
    SHF_ALLOC = 2,
    SHF_PERSISTENT = 0x02000000, /* XC16's own */
    STT_OBJECT = 1,
    STT_FUNC = 2,
    HEADER = 52,
    SECTION = 40,
    SEGMENT = 32,
    SYMBOL = 16,
    SHN_LORESERVE = 0xFF00,
    SHN_ABS = 0xFFF1
};

typedef struct {
    uint32_t name, type, flags, address, offset, size, link;
} section_t;

typedef struct {
    image_t *image;
    const uint8_t *data;
    size_t size;
    const char *name;
    uint32_t section_table, segment_table;
    unsigned sections, segments, string_section;
} elf_t;

static unsigned get16(const uint8_t *p)
{
    return (unsigned)p[0] | (unsigned)p[1] << 8;
}

static uint32_t get32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

/* True if `count` entries of `each` bytes from `offset` on lie within the file. */
static bool within(const elf_t *elf, uint32_t offset, uint64_t count, uint64_t each)
{
    return (uint64_t)offset + count * each <= (uint64_t)elf->size;
}

static int truncated(elf_t *elf, const char *what)
{
    return image_fail(elf->image, "%s lies beyond the end of the ELF file, %s: the file is cut off or damaged, build it again", what, elf->name);
}

static int read_header(elf_t *elf)
{
    const uint8_t *h = elf->data;
    if (elf->size < HEADER) {
        return truncated(elf, "the header");
    }
    if (h[4] != 1 || h[5] != 1) {
        return image_fail(elf->image, "the ELF file is not 32 bits little endian, %s: name one that xc16-gcc linked", elf->name);
    }
    if (get16(h + 18) != EM_DSPIC30F) {
        return image_fail(elf->image, "the ELF file is for machine %u, a dsPIC is %d, %s: name one that xc16-gcc linked", get16(h + 18),
                          (int)EM_DSPIC30F, elf->name);
    }
    if (get16(h + 16) != ET_EXEC) {
        return image_fail(elf->image, "the ELF file is not linked (type %u), %s: name the linker's result", get16(h + 16), elf->name);
    }
    elf->segment_table = get32(h + 28);
    elf->section_table = get32(h + 32);
    elf->segments = get16(h + 44);
    elf->sections = get16(h + 48);
    elf->string_section = get16(h + 50);
    if ((elf->segments != 0 && get16(h + 42) != SEGMENT) || (elf->sections != 0 && get16(h + 46) != SECTION)) {
        return image_fail(elf->image, "the ELF header has entries of an odd size, %s: the file is damaged, build it again", elf->name);
    }
    if (!within(elf, elf->segment_table, elf->segments, SEGMENT) || !within(elf, elf->section_table, elf->sections, SECTION)) {
        return truncated(elf, "a table");
    }
    return elf->sections != 0 ? 0 : image_fail(elf->image, "the ELF file has no sections, %s: link it without stripping them", elf->name);
}

static section_t section_of(const elf_t *elf, unsigned n)
{
    const uint8_t *p = elf->data + elf->section_table + (size_t)n * SECTION;
    return (section_t){get32(p), get32(p + 4), get32(p + 8), get32(p + 12), get32(p + 16), get32(p + 20), get32(p + 24)};
}

/* The text at `offset` of a string section; "" if it is not a proper one. */
static const char *text_in(const elf_t *elf, unsigned section, uint32_t offset)
{
    if (section >= elf->sections) {
        return "";
    }
    section_t s = section_of(elf, section);
    if (!within(elf, s.offset, s.size, 1) || offset >= s.size) {
        return "";
    }
    const char *text = (const char *)elf->data + s.offset + offset;
    return memchr(text, 0, s.size - offset) != NULL ? text : "";
}

/* Where a section's contents are programmed: constants have the addresses of their data window, the segment knows the place in flash. */
static uint32_t load_address(const elf_t *elf, const section_t *s)
{
    for (unsigned n = 0; n < elf->segments; n++) {
        const uint8_t *p = elf->data + elf->segment_table + (size_t)n * SEGMENT;
        uint32_t offset = get32(p + 4), virtual = get32(p + 8), physical = get32(p + 12), file_size = get32(p + 16);
        if (get32(p) == PT_LOAD && s->offset >= offset && s->offset - offset < file_size && s->address >= virtual) {
            return s->address - virtual + physical;
        }
    }
    return s->address;
}

static int load_section(elf_t *elf, unsigned n)
{
    section_t s = section_of(elf, n);
    char where[160];
    (void)snprintf(where, sizeof where, "%.100s section %.40s", elf->name, text_in(elf, elf->string_section, s.name));
    if (!within(elf, s.offset, s.size, 1)) {
        return truncated(elf, "a section");
    }
    if (s.size % 4u != 0) {
        return image_fail(elf->image, "%lu bytes are no whole words, %s: the file is damaged, build it again", (unsigned long)s.size, where);
    }
    uint32_t pc = load_address(elf, &s);
    for (uint32_t k = 0; k < s.size / 4u; k++) {
        if (image_put(elf->image, pc + 2u * k, get32(elf->data + s.offset + 4u * (size_t)k), where) != 0) {
            return -1;
        }
    }
    return 0;
}

/* Program memory; the start values of variables are in .dinit once more, so their own sections stay out. */
static bool is_programmed(const section_t *s)
{
    return s->type == SHT_PROGBITS && (s->flags & SHF_ALLOC) != 0 && (s->flags & SHF_WRITE) == 0 && s->size != 0;
}

/* The assembler leaves an absolute symbol __33FJ32MC204 for the device that it was called for. */
static bool other_device(const char *name)
{
    if (strncmp(name, "__", 2) != 0 || strlen(name) < 9 || strlen(name) > 20) {
        return false;
    }
    const char *part = name + 2;
    bool family = strncmp(part, "33F", 3) == 0 || strncmp(part, "33E", 3) == 0 || strncmp(part, "33C", 3) == 0 || strncmp(part, "30F", 3) == 0
                  || strncmp(part, "24F", 3) == 0 || strncmp(part, "24H", 3) == 0 || strncmp(part, "24E", 3) == 0;
    return family && strcmp(part, "33FJ32MC204") != 0;
}

typedef struct {
    uint32_t name, value, size;
    unsigned info, section;
} raw_symbol_t;

static raw_symbol_t symbol_of(const elf_t *elf, const section_t *table, uint32_t n)
{
    const uint8_t *p = elf->data + table->offset + (size_t)n * SYMBOL;
    return (raw_symbol_t){get32(p), get32(p + 4), get32(p + 8), p[12], get16(p + 14)};
}

static int check_device(elf_t *elf, const section_t *table)
{
    for (uint32_t n = 0; n < table->size / SYMBOL; n++) {
        raw_symbol_t s = symbol_of(elf, table, n);
        const char *name = text_in(elf, table->link, s.name);
        if (s.section == SHN_ABS && other_device(name)) {
            return image_fail(elf->image, "the ELF file is for the %.18s, %s: build for the 33FJ32MC204", name + 2, elf->name);
        }
    }
    return 0;
}

static bool is_wanted(const elf_t *elf, const raw_symbol_t *s, const char *name)
{
    unsigned type = s->info & 15u;
    return s->section != 0 && s->section < SHN_LORESERVE && s->section < elf->sections && name[0] != '\0' && name[0] != '.' && type <= STT_FUNC;
}

static int compare_symbols(const void *a, const void *b)
{
    const image_symbol_t *x = a, *y = b;
    if (x->space != y->space) {
        return x->space < y->space ? -1 : 1;
    }
    if (x->address != y->address) {
        return x->address < y->address ? -1 : 1;
    }
    if (x->function != y->function) {
        return x->function ? -1 : 1;
    }
    return strcmp(x->name, y->name);
}

static void add_symbol(elf_t *elf, const raw_symbol_t *s, const char *name)
{
    section_t section = section_of(elf, s->section);
    bool data = (section.flags & SHF_WRITE) != 0 || ((section.flags & SHF_ALLOC) != 0 && s->value >= 0x8000u && s->value < 0x10000u);
    image_symbol_t *symbol = &elf->image->symbols[elf->image->symbol_count++];
    symbol->name = name[0] == '_' ? name + 1 : name;
    symbol->address = s->value;
    symbol->size = s->size;
    symbol->space = data ? IMAGE_DATA : IMAGE_CODE;
    symbol->persistent = data && (section.flags & SHF_PERSISTENT) != 0;
    symbol->function = (s->info & 15u) == STT_FUNC;
}

/* The names live as long as the image: a copy of the string section. */
static int copy_symbols(elf_t *elf, const section_t *table)
{
    image_t *image = elf->image;
    uint32_t count = table->size / SYMBOL;
    if (count == 0 || table->link >= elf->sections) {
        return 0;
    }
    section_t strings = section_of(elf, table->link);
    if (!within(elf, strings.offset, strings.size, 1) || strings.size == 0) {
        return truncated(elf, "the table of symbol names");
    }
    image->symbols = calloc(count, sizeof *image->symbols);
    image->names = malloc(strings.size);
    if (image->symbols == NULL || image->names == NULL) {
        return image_fail(image, "no memory for the symbols, %s: free some", elf->name);
    }
    memcpy(image->names, elf->data + strings.offset, strings.size);
    for (uint32_t n = 0; n < count; n++) {
        raw_symbol_t s = symbol_of(elf, table, n);
        const char *name = text_in(elf, table->link, s.name);
        if (is_wanted(elf, &s, name)) {
            add_symbol(elf, &s, image->names + s.name);
        }
    }
    qsort(image->symbols, image->symbol_count, sizeof *image->symbols, compare_symbols);
    return 0;
}

static int load_symbols(elf_t *elf)
{
    for (unsigned n = 0; n < elf->sections; n++) {
        section_t s = section_of(elf, n);
        if (s.type != SHT_SYMTAB) {
            continue;
        }
        if (!within(elf, s.offset, s.size, 1)) {
            return truncated(elf, "the symbol table");
        }
        return check_device(elf, &s) != 0 ? -1 : copy_symbols(elf, &s); /* there is one such table */
    }
    return 0;
}

int image_load_elf(image_t *image, const uint8_t *data, size_t size, const char *name)
{
    elf_t elf = {.image = image, .data = data, .size = size, .name = name};
    if (read_header(&elf) != 0 || load_symbols(&elf) != 0) {
        return -1;
    }
    for (unsigned n = 0; n < elf.sections; n++) {
        section_t s = section_of(&elf, n);
        if (is_programmed(&s) && load_section(&elf, n) != 0) {
            return -1;
        }
    }
    return 0;
}
