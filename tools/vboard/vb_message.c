/* What the board tells: the last call's error, and each problem of the configuration once. */
#include "vb_state.h"

#include <stdio.h>
#include <string.h>

int vb_fail(vb_t *vb, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    (void)vsnprintf(vb->error, sizeof vb->error, format, args);
    va_end(args);
    return -1;
}

const char *vb_error(const vb_t *vb)
{
    return vb->error;
}

/* Two texts from one place that name the same register are one problem. */
void vb_warn_list(vb_t *vb, const char *format, va_list args)
{
    char text[VB_TEXT];
    (void)vsnprintf(text, sizeof text, format, args);
    size_t name = strcspn(text, ":") + 1;
    for (unsigned n = 0; n < vb->warnings; n++) {
        if (vb->warning_format[n] == format && strncmp(vb->warning[n], text, name) == 0) {
            return;
        }
    }
    if (vb->warnings < VB_WARNINGS) {
        memcpy(vb->warning[vb->warnings], text, sizeof text);
        vb->warning_format[vb->warnings] = format;
        vb->warnings++;
    }
}

void vb_warn(vb_t *vb, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vb_warn_list(vb, format, args);
    va_end(args);
}

unsigned vb_warning_count(const vb_t *vb)
{
    return vb->warnings;
}

const char *vb_warning(const vb_t *vb, unsigned i)
{
    return i < vb->warnings ? vb->warning[i] : NULL;
}
