/* What the simulator takes for true although no source at hand confirms it, or gives only as a range; one line each, printed by `make cycles`. */
#ifndef FOC33_CPU_33F_ISS_ASSUMPTIONS_H
#define FOC33_CPU_33F_ISS_ASSUMPTIONS_H

#include "chip_assumptions.h"

/* X(name, value, meaning, where it is used), the chip's at the end. Those with the value 1 and no cycles are facts of the code, here to be named. */
#define ISS_ASSUMPTIONS(X) \
    X(INTERRUPT_ENTRY_CYCLES, 4, "cycles from the end of an instruction to the first one of a handler", "iss_irq.c enter_exception") \
    X(RETFIE_PENDING_CYCLES, 2, "cycles of RETFIE when another exception is pending (3 otherwise)", "iss_flow.c retfie") \
    X(PSV_READ_CYCLES, 1, "more cycles for each word read through the PSV window", "iss_memory.c read_psv") \
    X(PSV_REPEAT_INNER_CYCLES, 0, "the same in the turns of REPEAT other than the first and the last", "iss_memory.c read_psv") \
    X(RAW_STALL_CYCLES, 1, "more cycles when a source address uses a W register that the instruction before has written", "iss_core.c hazard") \
    X(RAW_STALL_POINTER, 1, "a destination pointer changed by ++ or -- counts as written for the next source address (1 = yes)", "iss_decode.c") \
    X(RAW_STALL_DESTINATION, 0, "destination addresses stall as source addresses do (1 = yes)", "iss_decode.c") \
    X(RAW_STALL_RETURN, 0, "returns stall when the instruction before has written W15, as ULNK does (1 = yes)", "iss_flow.c rows") \
    X(SOFT_TRAP_DELAY_CYCLES, 2, "cycles between a stack or math error and its trap", "iss_registers.c iss_raise_trap") \
    X(SAME_TRAP_NESTS, 0, "an error inside the handler of its own trap traps again (1 = yes)", "iss_irq.c pending_trap") \
    X(VECNUM_OFFSET, 8, "INTTREG.VECNUM is the place in the vector table less this; for traps, which come before 8, modulo 128", "iss_irq.c enter_exception") \
    X(INTTREG_OWN_PRIORITY, 1, "INTTREG.ILR is the interrupt's own priority, also where NSTDIS makes it 7", "iss_irq.c enter_exception") \
    X(WRONG_SPACE_VALUE, 0, "what a MAC-class prefetch reads from the other space than its own", "iss_dsp.c fetch") \
    X(OUTSIDE_FLASH_VALUE, 0, "what table and PSV reads get beyond the flash", "iss_memory.c") \
    X(CORCON_RESET, 0x0020, "CORCON after a reset", "iss_registers.c iss_reset") \
    X(UNKNOWN_W_BYTE_WRITE, 1, "a byte write makes a W register count as initialised", "iss_decode.c to") \
    X(DIVIDE_LAST_TURN, 1, "W0, W1 and the flags of a division change in its last turn only", "iss_multiply.c in_last_turn") \
    X(DIVIDE_ZERO_FIRST_TURN, 1, "a divisor of 0 raises its trap in the first turn of the division", "iss_multiply.c in_last_turn") \
    X(DIVIDE_OVERFLOW, 1, "after an overflow W0 and W1 hold the low words of the exact quotient and remainder; C never changes", "iss_multiply.c divide") \
    X(DIVF_ONE_OVERFLOWS, 1, "DIVF of equal numbers, which is 1.0, overflows", "iss_multiply.c divf") \
    X(CP0_NO_BORROW, 1, "CP0 is f - 0: it sets C and DC", "iss_alu.c COMPARE0") \
    X(DAW_LOW_CARRY, 1, "DAW looks at the high digit after the low digit's correction has carried into it", "iss_alu.c daw") \
    X(MODULO_OFFSET, 1, "with [Wn+Wb] modulo addressing bends the address once and keeps the register", "iss_memory.c iss_bent_address") \
    X(GUARD_AFTER_WRAP, 1, "after an overflow of bit 39 OA and OB are those of the wrapped value", "iss_dsp.c result") \
    X(CLR_CLEARS_SATURATION, 1, "CLR of an accumulator clears its SA or SB, not the other's", "iss_dsp.c clear") \
    X(SAC_DROPS_GUARD, 1, "a left shift of SAC drops what goes beyond bit 39 before SATDW looks", "iss_dsp.c shifted_acc") \
    X(WRITE_BACK_ROUNDS, 1, "the accumulator's write-back follows RND and SATDW", "iss_dsp.c MAC_CLASS") \
    X(DISTANCE_WRAPS, 1, "the difference that ED and EDAC leave wraps at 16 bits", "iss_dsp.c distance")

#define ASSUMPTIONS(X) ISS_ASSUMPTIONS(X) CHIP_ASSUMPTIONS(X)

enum {
#define ASSUMPTION_VALUE(id, value, meaning, used_in) ASSUME_##id = (value),
    ISS_ASSUMPTIONS(ASSUMPTION_VALUE)
#undef ASSUMPTION_VALUE
};

#endif
