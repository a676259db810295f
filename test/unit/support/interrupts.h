/* A period's interrupts as the chip runs them: the control interrupt, then the slow work that it raises. */
#ifndef TEST_INTERRUPTS_H
#define TEST_INTERRUPTS_H

#include <xc.h>

static inline void a_period(void)
{
    _ADC1Interrupt();
    if (IFS0bits.T2IF) {
        _T2Interrupt();
    }
}

#endif
