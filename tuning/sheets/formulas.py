"""Pieces of formulas: rounding by digits, and C conditions of param_table.h in the language of a spreadsheet."""

import re

RPM = "(2*PI()/60)"
"""rad/s per rpm"""


def significant(value: str, digits: int) -> str:
    """Rounded to significant digits; the value must not be 0."""
    return f"ROUND({value},{digits - 1}-INT(LOG10(ABS({value}))))"


def digits_down(value: str, digits: int) -> str:
    """Rounded down to significant digits; the value must be positive."""
    step = f"10^(INT(LOG10({value}))-{digits - 1})"
    return f"ROUND(INT({value}/{step}+0.000000001)*{step},10)"


def down(value: str, step: str) -> str:
    """The largest multiple of a step that is not above."""
    return f"(INT({value}/({step})+0.000000001)*({step}))"


_MACROS = {
    "PARAM_RS_FULL": "(MOTOR_RS_OHM*NORM_CURRENT_CONST/NORM_VOLTAGE_CONST*32768)",
    "PARAM_LS_FULL": "(MOTOR_LS_MH*0.001/LOOPTIME_SEC*NORM_CURRENT_CONST/NORM_VOLTAGE_CONST*4096)",
    "PARAM_INVKFI": "norm_invkfi_exact", "PARAM_EMF_MAX_V": "emf_max_v", "PARAM_VOLTAGE_PER_BUS": "voltage_per_bus",
    "DUTY_PER_VOLT_NUMERATOR": "duty_per_volt"}


def condition(c_text: str) -> str:
    """A C condition of comparisons joined by && as a formula's text."""
    text = re.sub(r"PARAM_F\((\w+)\)", r"\1", c_text)
    text = re.sub(r"PARAM_SPEED_KI\((\w+)\)", r"ROUND(\1*16384,0)", text)
    text = re.sub(r"BUS_Q15\((\w+)\)", r"ROUND(\1/BUS_FULL_SCALE_V*32768,0)", text)
    text = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?)F\b", r"\1", text)
    text = text.replace("PARAM_F(", "(")
    for macro, formula in _MACROS.items():
        text = re.sub(rf"\b{macro}\b", formula, text)
    parts = [part.strip() for part in text.split("&&")]
    return parts[0] if len(parts) == 1 else f"AND({','.join(parts)})"
