"""A header such as those of AN1292's forks: a pump of 1.1 ohm, 0.9 mH, 5.8 V/krpm and four pole pairs at 24 V, 20 kHz."""

CONSTANTS = {"NORM_RS": 7991, "NORM_LSDTBASE": 1022, "NORM_INVKFIBASE": 7945}
HEAD = """/* Circulation pump P7: numbers of the drive.
 * Change only what the worksheet says. */
#ifndef PUMP_PARMS_H
#define PUMP_PARMS_H
#include "general.h"

//#define TUNING
#define SNAPSHOT
#ifdef TUNING
  #define TUNING_DELAY_RAMPUP 0x1F   /* slower than usual */
#endif

#define LOOPTIME_SEC 0.00005
#define DEADTIME_SEC 0.000002        // driver stage of the pump
#define KCURRA Q15(-0.5)
#define KCURRB Q15(-0.5)
#define NOPOLESPAIRS 4
#define NOMINAL_SPEED_RPM 3200
#define MAXIMUM_SPEED_RPM 5200
#define ENDSPEED_ELECTR \\
    END_SPEED_RPM*NOPOLESPAIRS
#define PUMP_COLOUR 3
#define NORM_CURRENT_CONST 0.00018   /* measured with a probe */
#define NORM_CURRENT(current_real) (Q15(current_real/NORM_CURRENT_CONST/32768))
#define NORM_RS 7991
#define NORM_LSDTBASE 1022
#define NORM_INVKFIBASE 7945
#define NORM_DELTAT 1790
#define D_ILIMIT_HS 1136
#define D_ILIMIT_LS 5592
#define KFILTER_ESDQ 1200
#define KFILTER_VELESTIM 2*374
#define INITOFFSET_TRANS_OPEN_CLSD 0x2000
#define LOCK_TIME 5000
#define END_SPEED_RPM 600
#define OPENLOOP_RAMPSPEED_INCREASERATE 8
#define Q_CURRENT_REF_OPENLOOP NORM_CURRENT(1.8)
#define SPEEDREFRAMP Q15(0.00003)
#define D_CURRCNTR_PTERM (int)(0.02*32768)
#define SPEEDCNTR_OUTMAX 0x5000
"""
INVKFI = [7945 + 300 * i for i in range(18)]
"""The last two are more than 1.6 of the first: they end there."""
IDREF = ["0", "-0.3", "-0.6", "-0.85", "-1.1", "-1.35", "-1.6", "-1.8", "-2.0", "-2.15", "-2.3", "-2.4", "-2.5", "-2.6", "-2.6", "-2.6", "-2.6", "-2.6"]
LS = ["0.5", "0.48", "0.46", "0.44", "0.42", *["0.4"] * 13]
TABLES = "".join(f"#define {stem}{i} {form.format(value)}\n" for stem, form, column in (
    ("INVKFI_SPEED", "{}", INVKFI), ("IDREF_SPEED", "NORM_CURRENT({})", IDREF), ("LS_OVER2LS0_SPEED", "Q15({});", LS)) for i, value in enumerate(column))
HEADER = HEAD + TABLES + "#endif\n"


def changed(*changes: tuple[str, str], text: str = HEADER) -> str:
    """The header with texts replaced, each of which is there once."""
    for old, new in changes:
        assert text.count(old) == 1 or f"{old}\n" in text, old
        text = text.replace(old, new, 1)
    return text


LATER = changed(("#define SPEEDREFRAMP Q15(0.00003)", "#define SPEEDREFRAMP Q15(0.00003)\n#define SPEEDREFRAMP_COUNT 3"), ("NORM_RS 7991", "NORM_RS 999"))
"""The same drive in the form of 2022: R divided by 16, the reference's ramp in every fourth period."""
