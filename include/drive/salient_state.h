/* What a salient motor adds to the parameters and to the state of a run: nothing where the header says that it is none. */
#ifndef DRIVE_SALIENT_STATE_H
#define DRIVE_SALIENT_STATE_H

#include "control/salience.h"
#include "drive/param_scaling.h" /* MOTOR_SALIENCY_UH */

#if MOTOR_SALIENCY_UH
#define SALIENT_PARAMS uint16_t salience_q13; /**< -i_d that doubles the flux, psi/(Lq - Ld) */
#define SALIENT_STATE salience_t salience;
#else
#define SALIENT_PARAMS
#define SALIENT_STATE
#endif

#endif
