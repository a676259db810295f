/* The trace: rows of chosen keys, taken when the handler has finished with a sample. */
#include "vb_state.h"

#include <stdlib.h>
#include <string.h>

enum { NAME_SIZE = 80, FIRST_ROWS = 4096 };

void vb_trace_free(vb_t *vb)
{
    free(vb->trace.column);
    free(vb->trace.data);
    memset(&vb->trace, 0, sizeof vb->trace);
}

static int add_column(vb_t *vb, const char *name)
{
    vb_trace_t *t = &vb->trace;
    vb_access_t access;
    if (vb_keys_find(vb, name, &access) != 0) {
        return -1;
    }
    vb_access_t *column = realloc(t->column, (t->columns + 1) * sizeof *column);
    if (column == NULL) {
        return vb_fail(vb, "trace: out of memory");
    }
    t->column = column;
    t->column[t->columns++] = access;
    return 0;
}

static int add_columns(vb_t *vb, const char *names)
{
    while (*names != '\0') {
        size_t length = strcspn(names, ", \t\n");
        if (length >= NAME_SIZE) {
            return vb_fail(vb, "trace: a name of %zu characters is no key", length);
        }
        if (length > 0) {
            char name[NAME_SIZE];
            memcpy(name, names, length);
            name[length] = '\0';
            if (add_column(vb, name) != 0) {
                return -1;
            }
        }
        names += length + (names[length] != '\0' ? 1u : 0u);
    }
    return 0;
}

int vb_trace_config(vb_t *vb, const char *names, unsigned decimation)
{
    vb_trace_free(vb);
    if (decimation == 0) {
        return vb_fail(vb, "trace: decimation is 0: use 1 for a row each period");
    }
    if (add_columns(vb, names) != 0) {
        vb_trace_free(vb);
        return -1;
    }
    vb->trace.decimation = decimation;
    return 0;
}

static bool make_room(vb_trace_t *t)
{
    if (t->rows < t->capacity) {
        return true;
    }
    size_t capacity = t->capacity == 0 ? FIRST_ROWS : 2 * t->capacity;
    float *data = realloc(t->data, capacity * t->columns * sizeof *data);
    if (data == NULL) {
        return false;
    }
    t->data = data;
    t->capacity = capacity;
    return true;
}

/* One period has its row, if decimation lets it through. */
void vb_trace_row(vb_t *vb)
{
    vb_trace_t *t = &vb->trace;
    t->due = false;
    if (t->columns == 0) {
        return;
    }
    if (t->countdown > 0) {
        t->countdown--;
        return;
    }
    t->countdown = t->decimation - 1;
    if (!make_room(t)) {
        t->lost_rows += 1.0;
        return;
    }
    float *row = t->data + t->rows * t->columns;
    for (size_t n = 0; n < t->columns; n++) {
        row[n] = (float)vb_keys_read(vb, &t->column[n]);
    }
    t->rows++;
}

void vb_served(void *context)
{
    vb_t *vb = context;
    vb->awaits_handler = false;
    if (vb->trace.due) {
        vb_trace_row(vb);
    }
}

const float *vb_trace_data(const vb_t *vb, size_t *rows, size_t *cols)
{
    *rows = vb->trace.rows;
    *cols = vb->trace.columns;
    return vb->trace.data;
}

void vb_trace_clear(vb_t *vb)
{
    vb->trace.rows = 0;
    vb->trace.countdown = 0;
}
