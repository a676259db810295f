/* The d current against its reference: one that stays off though no limit holds it means a noisy or wrong signal. */
#ifndef DRIVE_DEVIATION_H
#define DRIVE_DEVIATION_H

#include "drive/drive.h"

/** Mean size of the d current's deviation over half a second. Zero is a valid start. */
typedef struct {
    int32_t id_q16; /**< Q13 counts with 16 fraction bits */
} deviation_t;

/** Every millisecond in the background. @param reasons of limits_reasons() at this moment
 *  @return 1 when it stays larger than dead time and noise make it */
uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p, uint16_t reasons);

#endif
