/* The pins of the dsPIC33FJ32MC204 with 44 pins: the one table behind the board's pins (mclv.h), board files, docs/pins.md and tests. */
#ifndef BOARD_PIN_TABLE_H
#define BOARD_PIN_TABLE_H

/** X(number, port, bit, an, rp, cn, others): analogue input ANx, remappable RPx, change notice CNx with its pull-up; -1: none. 44-pin TQFP and QFN. */
#define CHIP_PIN_TABLE(X) \
    X(1, B, 9, -1, 9, 21, "SDA1") \
    X(2, C, 6, -1, 22, 18, "") \
    X(3, C, 7, -1, 23, 17, "") \
    X(4, C, 8, -1, 24, 20, "") \
    X(5, C, 9, -1, 25, 19, "") \
    X(8, B, 10, -1, 10, 16, "PWM1H3, PGED2") \
    X(9, B, 11, -1, 11, 15, "PWM1L3, PGEC2") \
    X(10, B, 12, -1, 12, 14, "PWM1H2") \
    X(11, B, 13, -1, 13, 13, "PWM1L2") \
    X(12, A, 10, -1, -1, -1, "TMS") \
    X(13, A, 7, -1, -1, -1, "TCK") \
    X(14, B, 14, -1, 14, 12, "PWM1H1") \
    X(15, B, 15, -1, 15, 11, "PWM1L1") \
    X(19, A, 0, 0, -1, 2, "VREF+") \
    X(20, A, 1, 1, -1, 3, "VREF-") \
    X(21, B, 0, 2, 0, 4, "PGED1") \
    X(22, B, 1, 3, 1, 5, "PGEC1") \
    X(23, B, 2, 4, 2, 6, "") \
    X(24, B, 3, 5, 3, 7, "") \
    X(25, C, 0, 6, 16, 8, "") \
    X(26, C, 1, 7, 17, 9, "") \
    X(27, C, 2, 8, 18, 10, "") \
    X(30, A, 2, -1, -1, 30, "OSC1") \
    X(31, A, 3, -1, -1, 29, "OSC2") \
    X(32, A, 8, -1, -1, -1, "TDO") \
    X(33, B, 4, -1, 4, 1, "SOSCI") \
    X(34, A, 4, -1, -1, 0, "SOSCO, T1CK") \
    X(35, A, 9, -1, -1, -1, "TDI") \
    X(36, C, 3, -1, 19, 28, "") \
    X(37, C, 4, -1, 20, 25, "") \
    X(38, C, 5, -1, 21, 26, "") \
    X(41, B, 5, -1, 5, 27, "ASDA1, PGED3") \
    X(42, B, 6, -1, 6, 24, "ASCL1, PGEC3") \
    X(43, B, 7, -1, 7, 23, "INT0") \
    X(44, B, 8, -1, 8, 22, "SCL1")

#define PIN_NUMBERS(number, port, bit, an, rp, cn, others) PIN_##port##bit##_AN = (an), PIN_##port##bit##_RP = (rp), PIN_##port##bit##_CN = (cn),
enum { CHIP_PIN_TABLE(PIN_NUMBERS) PIN_PORT_A = 0,
       PIN_PORT_B = 1,
       PIN_PORT_C = 2 };

/* Where a remappable pin's output is chosen; a test holds the RP numbers to those above. */
#define PIN_B0_OUTPUT RPOR0bits.RP0R
#define PIN_B1_OUTPUT RPOR0bits.RP1R
#define PIN_B2_OUTPUT RPOR1bits.RP2R
#define PIN_B3_OUTPUT RPOR1bits.RP3R
#define PIN_B4_OUTPUT RPOR2bits.RP4R
#define PIN_B5_OUTPUT RPOR2bits.RP5R
#define PIN_B6_OUTPUT RPOR3bits.RP6R
#define PIN_B7_OUTPUT RPOR3bits.RP7R
#define PIN_B8_OUTPUT RPOR4bits.RP8R
#define PIN_B9_OUTPUT RPOR4bits.RP9R
#define PIN_B10_OUTPUT RPOR5bits.RP10R
#define PIN_B11_OUTPUT RPOR5bits.RP11R
#define PIN_B12_OUTPUT RPOR6bits.RP12R
#define PIN_B13_OUTPUT RPOR6bits.RP13R
#define PIN_B14_OUTPUT RPOR7bits.RP14R
#define PIN_B15_OUTPUT RPOR7bits.RP15R
#define PIN_C0_OUTPUT RPOR8bits.RP16R
#define PIN_C1_OUTPUT RPOR8bits.RP17R
#define PIN_C2_OUTPUT RPOR9bits.RP18R
#define PIN_C3_OUTPUT RPOR9bits.RP19R
#define PIN_C4_OUTPUT RPOR10bits.RP20R
#define PIN_C5_OUTPUT RPOR10bits.RP21R
#define PIN_C6_OUTPUT RPOR11bits.RP22R
#define PIN_C7_OUTPUT RPOR11bits.RP23R
#define PIN_C8_OUTPUT RPOR12bits.RP24R
#define PIN_C9_OUTPUT RPOR12bits.RP25R

/* What follows from a pin that is written as "port, bit": #define BOARD_PIN_S2 A, 8. PIN_LOW: not 0 where it is. */
#define PIN_AN_OF(port, bit) PIN_##port##bit##_AN
#define PIN_RP_OF(port, bit) PIN_##port##bit##_RP
#define PIN_CN_OF(port, bit) PIN_##port##bit##_CN
#define PIN_LOW_OF(port, bit) ((uint16_t)((uint16_t)~PORT##port & (1u << (bit))))
#define PIN_LATCH_OF(port, bit) LAT##port##bits.LAT##port##bit
#define PIN_MASK_OF(port, bit, wanted) ((PIN_PORT_##port == PIN_PORT_##wanted) ? 1u << (bit) : 0u)
#define PIN_OUTPUT_OF(port, bit) PIN_##port##bit##_OUTPUT
#define PIN_AN(...) PIN_AN_OF(__VA_ARGS__)
#define PIN_RP(...) PIN_RP_OF(__VA_ARGS__)
#define PIN_CN(...) PIN_CN_OF(__VA_ARGS__)
#define PIN_LOW(...) PIN_LOW_OF(__VA_ARGS__)
#define PIN_LATCH(...) PIN_LATCH_OF(__VA_ARGS__)
/** The field that says which peripheral drives the pin. */
#define PIN_OUTPUT(...) PIN_OUTPUT_OF(__VA_ARGS__)
/** Its name as a text: "RC6". */
#define PIN_NAME_OF(port, bit) "R" #port #bit
#define PIN_NAME(...) PIN_NAME_OF(__VA_ARGS__)
/** PIN_MASK(pin, port): the pin's bit in a port's registers; 0 if it is on another port. */
#define PIN_MASK(...) PIN_MASK_OF(__VA_ARGS__)
#define PIN_AN_MASK(...) (1u << PIN_AN_OF(__VA_ARGS__))
/** PIN_CN_MASK(first, pin): the pin's bit in the register whose bit 0 is CN<first>, 0 if it is in the other one. */
#define PIN_CN_MASK(first, ...) ((PIN_CN(__VA_ARGS__) / 16 == (first) / 16) ? 1u << ((unsigned)PIN_CN(__VA_ARGS__) % 16u) : 0u)
/** Refuses a build: a declaration of a negative size names what does not hold. */
#define PIN_NEEDS(name, condition) typedef char name[(condition) ? 1 : -1]

#endif
