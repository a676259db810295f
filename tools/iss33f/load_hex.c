/* Intel HEX: byte address = 2 * PC address, four bytes a word, the fourth ("phantom") is always 0. */
#include "image.h"

#include <stdlib.h>
#include <string.h>

enum { TYPE_DATA = 0, TYPE_END = 1, TYPE_SEGMENT = 2, TYPE_START_SEGMENT = 3, TYPE_LINEAR = 4, TYPE_START_LINEAR = 5 };
enum { CELLS = IMAGE_WORDS + IMAGE_CONFIG_WORDS };

/* Words while they come in byte by byte: `have` has a bit for each of the four bytes. */
typedef struct {
    uint8_t byte[CELLS][4];
    uint8_t have[CELLS];
} bytes_t;

typedef struct {
    image_t *image;
    const char *name;
    bytes_t *bytes;
    unsigned long line;
    uint32_t base; /* added to the 16-bit addresses of data records */
    bool ended;
} reader_t;

typedef struct {
    unsigned count, type, address;
    uint8_t data[255];
} record_t;

static int hex_digit(uint8_t c)
{
    if (c >= '0' && c <= '9') {
        return c - '0';
    }
    if (c >= 'a' && c <= 'f') {
        return c - 'a' + 10;
    }
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* Two digits; -1 if there are none. */
static int hex_byte(const uint8_t *text)
{
    int high = hex_digit(text[0]);
    int low = hex_digit(text[1]);
    return high < 0 || low < 0 ? -1 : high * 16 + low;
}

static int damaged(reader_t *r, const char *what)
{
    return image_fail(r->image, "%s, %s line %lu: the file is damaged, make it again", what, r->name, r->line);
}

/* The line's bytes: count, address, type, data, checksum. */
static int parse_record(reader_t *r, const uint8_t *text, size_t length, record_t *record)
{
    uint8_t raw[260];
    if (text[0] != ':' || length % 2u != 1u || length < 11 || length > 2u * sizeof raw + 1u) {
        return damaged(r, "this is no Intel HEX record");
    }
    size_t bytes = (length - 1u) / 2u;
    unsigned sum = 0;
    for (size_t n = 0; n < bytes; n++) {
        int value = hex_byte(text + 1u + 2u * n);
        if (value < 0) {
            return damaged(r, "a character is no hexadecimal digit");
        }
        raw[n] = (uint8_t)value;
        sum += (unsigned)value;
    }
    if (bytes != raw[0] + 5u) {
        return damaged(r, "the record is shorter or longer than it says");
    }
    if ((sum & 0xFFu) != 0) {
        return damaged(r, "the checksum is wrong");
    }
    record->count = raw[0];
    record->address = (unsigned)raw[1] << 8 | raw[2];
    record->type = raw[3];
    memcpy(record->data, raw + 4, record->count);
    return 0;
}

static int put_byte(reader_t *r, uint32_t address, uint8_t value)
{
    uint32_t pc = (address / 4u) * 2u;
    if (!image_holds(pc)) {
        return image_fail(r->image, "address 0x%lX is outside the 33FJ32MC204, %s line %lu: build for that device", (unsigned long)pc, r->name,
                          r->line);
    }
    size_t cell = pc < IMAGE_PROGRAM_END ? pc / 2u : (size_t)IMAGE_WORDS + (pc - IMAGE_CONFIG_START) / 2u;
    uint8_t bit = (uint8_t)(1u << (address & 3u));
    if ((r->bytes->have[cell] & bit) != 0) {
        return image_fail(r->image, "address 0x%lX comes twice, %s line %lu: records overlap, make the file again", (unsigned long)pc, r->name,
                          r->line);
    }
    if (bit == 8u && value != 0) {
        return damaged(r, "the fourth byte of a word is not 0");
    }
    r->bytes->have[cell] = (uint8_t)(r->bytes->have[cell] | bit);
    r->bytes->byte[cell][address & 3u] = value;
    return 0;
}

static int take_data(reader_t *r, const record_t *record)
{
    for (unsigned n = 0; n < record->count; n++) {
        if (put_byte(r, r->base + record->address + n, record->data[n]) != 0) {
            return -1;
        }
    }
    return 0;
}

static int take_record(reader_t *r, const record_t *record)
{
    unsigned value = (unsigned)record->data[0] << 8 | record->data[1];
    switch (record->type) {
    case TYPE_DATA:
        return take_data(r, record);
    case TYPE_END:
        r->ended = true;
        return record->count == 0 ? 0 : damaged(r, "the end record has data");
    case TYPE_SEGMENT:
        r->base = value << 4;
        return record->count == 2 ? 0 : damaged(r, "the segment record has no two bytes");
    case TYPE_LINEAR:
        r->base = (uint32_t)value << 16;
        return record->count == 2 ? 0 : damaged(r, "the extended address record has no two bytes");
    case TYPE_START_SEGMENT:
    case TYPE_START_LINEAR:
        return 0; /* where a program starts on other machines */
    default:
        return damaged(r, "the record's type is unknown");
    }
}

static int read_lines(reader_t *r, const uint8_t *data, size_t size)
{
    for (size_t at = 0; at < size;) {
        size_t length = 0;
        while (at + length < size && data[at + length] != '\n') {
            length++;
        }
        const uint8_t *text = data + at;
        at += length + 1u;
        r->line++;
        while (length > 0 && (text[length - 1u] == '\r' || text[length - 1u] == ' ')) {
            length--;
        }
        if (length == 0) {
            continue;
        }
        if (r->ended) {
            return damaged(r, "there is text after the end record");
        }
        record_t record = {0};
        if (parse_record(r, text, length, &record) != 0 || take_record(r, &record) != 0) {
            return -1;
        }
    }
    return r->ended ? 0 : image_fail(r->image, "the end record is missing, %s line %lu: the file is cut off, make it again", r->name, r->line);
}

static int store_words(reader_t *r)
{
    for (size_t cell = 0; cell < CELLS; cell++) {
        uint32_t pc = (uint32_t)(cell < IMAGE_WORDS ? 2u * cell : (size_t)IMAGE_CONFIG_START + 2u * (cell - IMAGE_WORDS));
        const uint8_t *b = r->bytes->byte[cell];
        if (r->bytes->have[cell] == 0) {
            continue;
        }
        if ((r->bytes->have[cell] & 7u) != 7u) {
            return image_fail(r->image, "bytes are missing at address 0x%lX, %s: the file is damaged, make it again", (unsigned long)pc, r->name);
        }
        if (image_put(r->image, pc, (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16, r->name) != 0) {
            return -1;
        }
    }
    return 0;
}

int image_load_hex(image_t *image, const uint8_t *data, size_t size, const char *name)
{
    reader_t reader = {image, name, calloc(1, sizeof(bytes_t)), 0, 0, false};
    if (reader.bytes == NULL) {
        return image_fail(image, "no memory for the file, %s: free some", name);
    }
    int result = read_lines(&reader, data, size);
    if (result == 0) {
        result = store_words(&reader);
    }
    free(reader.bytes);
    return result;
}
