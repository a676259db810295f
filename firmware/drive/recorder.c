/* The fault recorder's slow side: what is kept over a reset, when it begins anew, and the order of its rows. */
#include "drive/recorder.h"

#ifdef MODE_WITHOUT_RECORDER
#pragma message(MODE_WITHOUT_RECORDER " takes the fault recorder's place in RAM: this build has no recorder, whatever RECORDER_PERIODS says")
#endif

#define RECORDER_CHECK 0x5Eu

void recorder_begin(recorder_t *r)
{
    drive_zero(r, sizeof *r); /* the test of the RAM reads it all */
    r->check = RECORDER_CHECK;
    r->next = RECORDER_FIRST;
    r->left = RECORDER_AFTER + 1u; /* last: from now on the control interrupt writes */
}

/** Whether a reset has left a recorder and no chance content of RAM. */
static uint16_t recorder_is_valid(const recorder_t *r)
{
    return (uint16_t)(r->check == RECORDER_CHECK && r->left <= RECORDER_AFTER + 1u && r->full <= 1u && r->fault < (uint16_t)FAULT_COUNT
                      && (uint16_t)r->next < sizeof r->row && (uint16_t)r->next % (uint16_t)RECORDER_BYTES == 0u);
}

void recorder_restart(recorder_t *r, uint16_t powered_up, drive_fault_t fault)
{
    if (!powered_up && recorder_is_valid(r)) {
        if (r->fault == (uint8_t)FAULT_NONE) {
            r->fault = (uint8_t)fault;
        }
        if (r->fault != (uint8_t)FAULT_NONE) {
            r->left = 0;
            return;
        }
    }
    recorder_begin(r);
}
