/* What the chip's peripherals take for true although no source at hand confirms it, or gives only as a range; printed by `make cycles`. */
#ifndef FOC33_CHIP_CHIP_ASSUMPTIONS_H
#define FOC33_CHIP_CHIP_ASSUMPTIONS_H

/* X(name, value, meaning, where it is used). */
#define CHIP_ASSUMPTIONS(X) \
    X(FRC_HZ, 7370000, "Hz of the fast RC oscillator", "chip_device.c chip_connect") \
    X(LPRC_HZ, 32000, "Hz of the low-power RC oscillator, which drives the watchdog", "chip_device.c chip_connect") \
    X(SECONDARY_HZ, 32768, "Hz of the secondary oscillator", "chip_clock.c source_hz") \
    X(PLL_LOCK_US, 1500, "us until the PLL has locked, after power-on and after a switch to it", "chip_clock.c ready_s") \
    X(CRYSTAL_START_PERIODS, 1024, "periods that the start-up timer of a crystal counts; an external clock needs none", "chip_clock.c ready_s") \
    X(UNLOCK_CYCLES, 2, "cycles within which each write of OSCCON's unlock sequence follows the one before", "chip_clock.c unlocked") \
    X(NVM_ERASE_US, 26500, "us that the erasing of a page of 512 words takes at most, the processor standing", "chip_nvm.c") \
    X(NVM_ROW_US, 1740, "us that programming a row of 64 words takes at most, the processor standing", "chip_nvm.c") \
    X(NVM_WORD_US, 56, "us that programming a word takes at most, the processor standing", "chip_nvm.c") \
    X(RESET_KEEPS_CLOCK, 1, "a reset other than power-on goes on with the running clock, without waiting for it anew", "chip_clock.c chip_clock_reset") \
    X(CAPTURE_TIMER_3, 0, "ICTMR of an input capture that takes timer 3; the other takes timer 2", "chip_capture.c capture") \
    X(CAPTURE_KEEPS_FIRST, 1, "a capture into a full FIFO of four is lost and sets ICOV, but not where every edge is one (ICM 1)", "chip_capture.c capture") \
    X(CAPTURE_DELAY_CYCLES, 0, "cycles from an edge at the pin to the count that is captured; the same for all edges", "chip_capture.c capture") \
    X(CAPTURE_OVERFLOW_ENDS, 1, "ICOV is cleared when the FIFO has been read empty, and with ICM 0", "chip_capture.c chip_capture_drop")

enum {
#define ASSUMPTION_VALUE(id, value, meaning, used_in) ASSUME_##id = (value),
    CHIP_ASSUMPTIONS(ASSUMPTION_VALUE)
#undef ASSUMPTION_VALUE
};

#endif
