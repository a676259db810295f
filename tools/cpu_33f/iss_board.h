/* The virtual board around an image of the target: the very program runs in the instruction-set simulator, and the firmware that is
 * linked with this library runs beside it, interrupt by interrupt, as the judge.
 *
 * Everything in vboard.h works as with the host's firmware; the signals "fw.*" come from the target's RAM by the names in its ELF file.
 * Lock-step: at each control interrupt the host's handler gets the same samples and commands; duties, overrides and all signals must be equal to the bit.
 */
#ifndef FOC33_CPU_33F_ISS_BOARD_H
#define FOC33_CPU_33F_ISS_BOARD_H

#include "iss.h"
#include "vboard.h"

/* A new board around the image, a text as iss_image.h describes it; NULL with one line "what, where: what to do" in `error`. The host's
 * firmware is a set of globals: one such board per process. */
vb_t *vb_create_iss(const char *image, char *error, size_t size);

/* 1 if the image says where the drive's variables are: signals "fw.*" and the comparison; 0: a HEX file has none. */
int vb_iss_has_names(vb_t *vb);

/* The core, for profiles. */
iss_t *vb_iss_core(vb_t *vb);

/* "" while both agree; otherwise where they first differed: tick, signal, both values. */
const char *vb_iss_difference(vb_t *vb);

/* Lock-step comparison on (default) or off, from the next power-up on. */
void vb_iss_lock_step(vb_t *vb, int on);

/* The 16-bit word at an address of data memory. */
int vb_iss_peek(vb_t *vb, unsigned address);

/* Read or write `count` 16-bit elements of a variable of the image. 0, or -1 if it has no such variable (vb_error()). */
int vb_iss_read(vb_t *vb, const char *name, int16_t *values, unsigned count);
int vb_iss_write(vb_t *vb, const char *name, const int16_t *values, unsigned count);

/* As probe_param_get() and probe_param_set(), in the target's RAM and in the host's firmware. */
int vb_iss_param_get(vb_t *vb, const char *name, double *value);
int vb_iss_param_set(vb_t *vb, const char *name, double value);

#endif
