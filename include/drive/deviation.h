/* What the drive reaches against what it asks for: speed and d current that stay off though no limit holds them mean a wrong signal. */
#ifndef DRIVE_DEVIATION_H
#define DRIVE_DEVIATION_H

#include "drive/drive.h"

/** Mean sizes of the deviations over half a second, Q16. All zero is a valid start. */
typedef struct {
    int32_t speed_q16; /**< of the estimated speed from the reference, electrical rpm */
    int32_t id_q16;    /**< of the d current from its reference, Q13 counts */
} deviation_t;

/** Every millisecond in the background. @param reasons of limits_reasons() at this moment
 *  @return 1 when one of them stays larger than dead time, noise and load steps make it */
uint16_t deviation_tick(deviation_t *v, const drive_t *d, const drive_params_t *p, uint16_t reasons);

#endif
