/* What the simulator takes for true although no source at hand confirms it, or gives only as a range; one line each, printed by `make cycles`. */
#ifndef FOC33_ISS33F_ASSUMPTIONS_H
#define FOC33_ISS33F_ASSUMPTIONS_H

/* X(name, value, meaning, where it is used). Those with the value 1 and no cycles are facts of the code, here to be named. */
#define ASSUMPTIONS(X) \
    X(INTERRUPT_ENTRY_CYCLES, 4, "cycles from the end of an instruction to the first one of a handler", "core_irq.c enter_exception") \
    X(RETFIE_PENDING_CYCLES, 2, "cycles of RETFIE when another exception is pending (3 otherwise)", "core_flow.c retfie") \
    X(PSV_READ_CYCLES, 1, "more cycles for each word read through the PSV window", "core_memory.c read_psv") \
    X(PSV_REPEAT_INNER_CYCLES, 0, "the same in the turns of REPEAT other than the first and the last", "core_memory.c read_psv") \
    X(RAW_STALL_CYCLES, 1, "more cycles when a source address uses a W register that the instruction before has written", "core.c hazard") \
    X(RAW_STALL_POINTER, 1, "a destination pointer changed by ++ or -- counts as written for the next source address (1 = yes)", "decode.c") \
    X(RAW_STALL_DESTINATION, 0, "destination addresses stall as source addresses do (1 = yes)", "decode.c") \
    X(RAW_STALL_RETURN, 0, "returns stall when the instruction before has written W15, as ULNK does (1 = yes)", "core_flow.c rows") \
    X(SOFT_TRAP_DELAY_CYCLES, 2, "cycles between a stack or math error and its trap", "core_irq.c iss_raise_trap") \
    X(SAME_TRAP_NESTS, 0, "an error inside the handler of its own trap traps again (1 = yes)", "core_irq.c pending_trap") \
    X(VECNUM_OFFSET, 8, "INTTREG.VECNUM is the place in the vector table less this; for traps, which come before 8, modulo 128", "core_irq.c enter_exception") \
    X(INTTREG_OWN_PRIORITY, 1, "INTTREG.ILR is the interrupt's own priority, also where NSTDIS makes it 7", "core_irq.c enter_exception") \
    X(WRONG_SPACE_VALUE, 0, "what a MAC-class prefetch reads from the other space than its own", "dsp.c fetch") \
    X(OUTSIDE_FLASH_VALUE, 0, "what table and PSV reads get beyond the flash", "core_memory.c") \
    X(CORCON_RESET, 0x0020, "CORCON after a reset", "core.c iss_reset") \
    X(UNKNOWN_W_BYTE_WRITE, 1, "a byte write makes a W register count as initialised", "decode.c to") \
    X(DIVIDE_LAST_TURN, 1, "W0, W1 and the flags of a division change in its last turn only", "core_multiply.c in_last_turn") \
    X(DIVIDE_ZERO_FIRST_TURN, 1, "a divisor of 0 raises its trap in the first turn of the division", "core_multiply.c in_last_turn") \
    X(DIVIDE_OVERFLOW, 1, "after an overflow W0 and W1 hold the low words of the exact quotient and remainder; C never changes", "core_multiply.c divide") \
    X(DIVF_ONE_OVERFLOWS, 1, "DIVF of equal numbers, which is 1.0, overflows", "core_multiply.c divf") \
    X(CP0_NO_BORROW, 1, "CP0 is f - 0: it sets C and DC", "core_alu.c COMPARE0") \
    X(DAW_LOW_CARRY, 1, "DAW looks at the high digit after the low digit's correction has carried into it", "core_alu.c daw") \
    X(MODULO_OFFSET, 1, "with [Wn+Wb] modulo addressing bends the address once and keeps the register", "core_memory.c iss_bent_address") \
    X(GUARD_AFTER_WRAP, 1, "after an overflow of bit 39 OA and OB are those of the wrapped value", "dsp.c result") \
    X(CLR_CLEARS_SATURATION, 1, "CLR of an accumulator clears its SA or SB, not the other's", "dsp.c clear") \
    X(SAC_DROPS_GUARD, 1, "a left shift of SAC drops what goes beyond bit 39 before SATDW looks", "dsp.c shifted_acc") \
    X(WRITE_BACK_ROUNDS, 1, "the accumulator's write-back follows RND and SATDW", "dsp.c MAC_CLASS") \
    X(DISTANCE_WRAPS, 1, "the difference that ED and EDAC leave wraps at 16 bits", "dsp.c distance") \
    X(FRC_HZ, 7370000, "Hz of the fast RC oscillator", "sfr_soc.c soc_create") \
    X(LPRC_HZ, 32000, "Hz of the low-power RC oscillator, which drives the watchdog", "sfr_soc.c soc_create") \
    X(SECONDARY_HZ, 32768, "Hz of the secondary oscillator", "sfr_clock.c source_hz") \
    X(PLL_LOCK_US, 1500, "us until the PLL has locked, after power-on and after a switch to it", "sfr_clock.c ready_s") \
    X(CRYSTAL_START_PERIODS, 1024, "periods that the start-up timer of a crystal counts; an external clock needs none", "sfr_clock.c ready_s") \
    X(UNLOCK_CYCLES, 2, "cycles within which each write of OSCCON's unlock sequence follows the one before", "sfr_clock.c unlocked") \
    X(RESET_KEEPS_CLOCK, 1, "a reset other than power-on goes on with the running clock, without waiting for it anew", "sfr_clock.c soc_clock_reset")

enum {
#define ASSUMPTION_VALUE(id, value, meaning, used_in) ASSUME_##id = (value),
    ASSUMPTIONS(ASSUMPTION_VALUE)
#undef ASSUMPTION_VALUE
};

#endif
