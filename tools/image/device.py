"""The dsPIC33FJ32MC204 as an image sees it: memory, vectors, configuration words.

Addresses are the program counter's: 2 for each 24-bit word. Sources: the part's linker script and configuration data of XC16, and the data
sheet's tables of the same."""

from dataclasses import dataclass

NAME = "33FJ32MC204"
ELF_MACHINE = "EM_DSPIC30F"

VECTORS_END = 0x200                 # reset, IVT, AIVT; above them the program
PROGRAM = range(VECTORS_END, 0x5800, 2)
FLASH = range(0, 0x5800, 2)
KEPT = range(0x5000, 0x5800, 2)
"""Two pages for parameters that outlive a reset, with PARAMS_KEPT: KEPT_AT of include/board/kept.h."""
RAM = range(0x0800, 0x1000)
CONFIGURATION = range(0xF80000, 0xF80018, 2)
IVT, AIVT = 0x004, 0x104
ERASED = 0xFFFFFF
PSV_WINDOW = 0x8000                 # data addresses from here on are program memory: constants

TRAPS = ("_ReservedTrap0", "_OscillatorFail", "_AddressError", "_StackError", "_MathError", "_ReservedTrap5", "_ReservedTrap6",
         "_ReservedTrap7")
INTERRUPTS = {
    0: "INT0", 1: "IC1", 2: "OC1", 3: "T1", 5: "IC2", 6: "OC2", 7: "T2", 8: "T3", 9: "SPI1Err", 10: "SPI1", 11: "U1RX", 12: "U1TX",
    13: "ADC1", 16: "SI2C1", 17: "MI2C1", 19: "CN", 20: "INT1", 22: "IC7", 23: "IC8", 29: "INT2", 57: "MPWM1", 58: "QEI", 63: "FLTA1",
    65: "U1Err", 73: "MPWM2", 74: "FLTA2",
}
#: C names of the functions of all vectors, in the table's order; number n of the interrupts that the part lacks is _Interrupt<n>
VECTORS = (*TRAPS, *(f"_{INTERRUPTS[n]}Interrupt" if n in INTERRUPTS else f"_Interrupt{n}" for n in range(118)))
#: from this interrupt on the product leaves both tables erased (seen in a published image for a related part [?]); the chip has none
LEFT_ERASED = 80
DEFAULT_VECTOR = "_DefaultInterrupt"
#: without these the drive is not controlled, or does not stop when it must
REQUIRED = ("_OscillatorFail", "_AddressError", "_StackError", "_MathError", "_ADC1Interrupt", "_T2Interrupt", "_FLTA1Interrupt")


@dataclass(frozen=True)
class Field:
    """A setting inside a configuration word: its bits, and each value that `#pragma config` knows with its meaning."""

    word: int
    mask: int
    values: dict[str, tuple[int, str]]

    def meaning(self, bits: int) -> str:
        """Name and meaning of a word's bits in this field."""
        for name, (value, text) in self.values.items():
            if value == bits & self.mask:
                return f"{name} ({text})"
        return f"0x{bits & self.mask:02X} (no meaning known)"


WORDS = {0xF80000: "FBS", 0xF80004: "FGS", 0xF80006: "FOSCSEL", 0xF80008: "FOSC", 0xF8000A: "FWDT", 0xF8000C: "FPOR", 0xF8000E: "FICD"}

FIELDS = {
    "BWRP": Field(0xF80000, 0x01, {"WRPROTECT_ON": (0x00, "boot segment write-protected"),
                                   "WRPROTECT_OFF": (0x01, "boot segment may be written")}),
    "BSS": Field(0xF80000, 0x0E, {
        "LARGE_FLASH_HIGH": (0x00, "large boot segment, high security"), "MEDIUM_FLASH_HIGH": (0x02, "medium boot segment, high security"),
        "SMALL_FLASH_HIGH": (0x04, "small boot segment, high security"), "LARGE_FLASH_STD": (0x08, "large boot segment"),
        "MEDIUM_FLASH_STD": (0x0A, "medium boot segment"), "SMALL_FLASH_STD": (0x0C, "small boot segment"),
        "NO_FLASH": (0x0E, "no boot segment")}),
    "GWRP": Field(0xF80004, 0x01, {"ON": (0x00, "program write-protected"), "OFF": (0x01, "program may be written")}),
    "GSS": Field(0xF80004, 0x06, {"HIGH": (0x02, "code protection, high"), "STD": (0x04, "code protection"),
                                  "OFF": (0x06, "no code protection")}),
    "FNOSC": Field(0xF80006, 0x07, {
        "FRC": (0, "internal oscillator"), "FRCPLL": (1, "internal oscillator, PLL"), "PRI": (2, "crystal"), "PRIPLL": (3, "crystal, PLL"),
        "SOSC": (4, "secondary oscillator"), "LPRC": (5, "low-power oscillator"), "FRCDIV16": (6, "internal oscillator / 16"),
        "LPRCDIVN": (7, "internal oscillator / N")}),
    "IESO": Field(0xF80006, 0x80, {"OFF": (0x00, "stays with FNOSC's oscillator"), "ON": (0x80, "two-speed start")}),
    "POSCMD": Field(0xF80008, 0x03, {"EC": (0, "external clock"), "XT": (1, "crystal up to 10 MHz"), "HS": (2, "crystal above 10 MHz"),
                                     "NONE": (3, "no crystal")}),
    "OSCIOFNC": Field(0xF80008, 0x04, {"ON": (0x00, "OSC2 is a port pin"), "OFF": (0x04, "OSC2 is no port pin")}),
    "IOL1WAY": Field(0xF80008, 0x20, {"OFF": (0x00, "pin selection may be unlocked again"), "ON": (0x20, "pin selection only once")}),
    "FCKSM": Field(0xF80008, 0xC0, {"CSECME": (0x00, "clock switching, clock monitor"),
                                    "CSECMD": (0x40, "clock switching, no clock monitor"),
                                    "CSDCMD": (0x80, "no clock switching, no clock monitor")}),
    "WDTPOST": Field(0xF8000A, 0x0F, {f"PS{1 << n}": (n, f"watchdog / {1 << n}") for n in range(16)}),
    "WDTPRE": Field(0xF8000A, 0x10, {"PR32": (0x00, "watchdog clock / 32"), "PR128": (0x10, "watchdog clock / 128")}),
    "WINDIS": Field(0xF8000A, 0x40, {"ON": (0x00, "watchdog with a window"), "OFF": (0x40, "watchdog without a window")}),
    "FWDTEN": Field(0xF8000A, 0x80, {"OFF": (0x00, "watchdog by software"), "ON": (0x80, "watchdog always on")}),
    "FPWRT": Field(0xF8000C, 0x07, {"PWR1": (0, "no power-up delay"),
                                    **{f"PWR{1 << n}": (n, f"power-up delay {1 << n} ms") for n in range(1, 8)}}),
    "ALTI2C": Field(0xF8000C, 0x10, {"ON": (0x00, "I2C on ASDA1/ASCL1"), "OFF": (0x10, "I2C on SDA1/SCL1")}),
    "LPOL": Field(0xF8000C, 0x20, {"OFF": (0x00, "low sides active low"), "ON": (0x20, "low sides active high")}),
    "HPOL": Field(0xF8000C, 0x40, {"OFF": (0x00, "high sides active low"), "ON": (0x40, "high sides active high")}),
    "PWMPIN": Field(0xF8000C, 0x80, {"OFF": (0x00, "PWM pins driven at reset"), "ON": (0x80, "PWM pins are inputs at reset")}),
    "ICS": Field(0xF8000E, 0x03, {"PGD3": (1, "debugger on PGC3/PGD3"), "PGD2": (2, "debugger on PGC2/PGD2"),
                                  "PGD1": (3, "debugger on PGC1/PGD1")}),
    "JTAGEN": Field(0xF8000E, 0x20, {"OFF": (0x00, "no JTAG"), "ON": (0x20, "JTAG")}),
}

#: what the board needs, whatever firmware/board/main.c says
BOARD_NEEDS = {
    "FNOSC": "FRC", "FCKSM": "CSECMD", "POSCMD": "XT", "IOL1WAY": "OFF", "FWDTEN": "ON", "WINDIS": "OFF", "WDTPRE": "PR32",
    "WDTPOST": "PS16", "FPWRT": "PWR128", "PWMPIN": "ON", "HPOL": "ON", "LPOL": "ON", "ICS": "PGD3", "JTAGEN": "OFF",
               "BWRP": "WRPROTECT_OFF", "BSS": "NO_FLASH", "GSS": "OFF", "GWRP": "OFF",
}

#: with PARAMS_KEPT: the watchdog waits while a page is erased
KEPT_NEEDS = BOARD_NEEDS | {"WDTPOST": "PS64"}
