"""The chip's pins (include/board/pin_table.h), the firmware's choice of them (include/board/mclv.h), and the check of a board file's [pins]."""

import functools
import re
from dataclasses import dataclass

from .paths import ROOT
from .toml_file import Section
from .x_macro import rows

SOURCE = ROOT / "include" / "board" / "mclv.h"
CRYSTAL = ("RA2", "RA3")
CONVERTED = ("current_a", "current_b", "bus")
"""Sampled at once, in this order, on the converter's channels 1 to 3."""
PWM = {"pwm_a": "PWM1H1", "pwm_b": "PWM1H2", "pwm_c": "PWM1H3"}
REMAPPED = ("fault", "uart_tx", "uart_rx", "pulse")


@dataclass(frozen=True)
class Pin:
    """A pin of the chip."""

    number: int
    name: str
    """of the port, e.g. RB8"""
    an: int | None
    rp: int | None
    cn: int | None
    """change notice, with the chip's pull-up"""
    others: str

    @property
    def names(self) -> list[str]:
        """All that a board file may call it."""
        return [self.name, *([f"AN{self.an}"] if self.an is not None else []), *([f"RP{self.rp}"] if self.rp is not None else []),
                *re.findall(r"PWM1[HL]\d", self.others)]


@dataclass(frozen=True)
class Signal:
    """What the firmware has on a pin."""

    pin: str
    what: str
    known_from: str


@functools.cache
def chip() -> dict[str, Pin]:
    """Every pin by its port's name."""
    found = rows("include", "board/pin_table.h", "CHIP_PIN_TABLE", "#number #port #bit #an #rp #cn others")
    pins = (Pin(int(number), f"R{port}{bit}", *(None if int(text) < 0 else int(text) for text in (an, rp, cn)), others)
            for number, port, bit, an, rp, cn, others in found)
    return {pin.name: pin for pin in pins}


@functools.cache
def firmware() -> dict[str, Signal]:
    """The pins that the firmware is built for, by the key that a board file has for the signal."""
    found = re.findall(r"^#define BOARD_PIN_(\w+) (\w), (\d+) +/\* (.*?); (.*) \*/$", SOURCE.read_text(encoding="utf-8"), re.MULTILINE)
    return {name.lower(): Signal(f"R{port}{bit}", what, known_from) for name, port, bit, what, known_from in found}


def read(section: Section | None) -> dict[str, str]:
    """The [pins] of a board file as names of ports; each must be able to do what it is chosen for."""
    if section is None:
        return {}
    section.close(set(firmware()))
    found: dict[str, str] = {}
    for key in section.data:
        name = section.text(key)
        pin = next((pin for pin in chip().values() if name in pin.names), None)
        if pin is None:
            raise section.fail(key, f"'{name}' is no pin of the dsPIC33FJ32MC204", "write a port, RP or AN as in docs/pins.md: \"RB8\"")
        problem = _problem(key, pin)
        if problem:
            raise section.fail(key, f"{key} cannot be on {pin.name}", problem)
        found[key] = pin.name
    used = {**{key: signal.pin for key, signal in firmware().items()}, **found}
    for key, name in found.items():
        twin = next((other for other in used if other != key and used[other] == name), None)
        if twin:
            raise section.fail(key, f"{key} and {twin} are both on {name}", "choose another pin for one of them")
    converted = [used[key] for key in CONVERTED]
    if found and [chip()[name].an for name in converted] not in ([0, 1, 2], [3, 4, 5]):
        raise section.fail(next(iter(found)), f"current_a, current_b and bus are on {', '.join(converted)}",
                           "the converter samples AN0, AN1, AN2 or AN3, AN4, AN5 at once, in this order")
    return found


def _problem(key: str, pin: Pin) -> str:
    """Why a pin cannot carry a signal; "" if it can."""
    if pin.name in CRYSTAL:
        return "the crystal is there"
    if key in (*CONVERTED, "pot") and pin.an is None:
        return "choose a pin with an analogue input: " + ", ".join(other.name for other in chip().values() if other.an is not None)
    if key in REMAPPED and pin.rp is None:
        return "choose a pin with an RP number: " + ", ".join(other.name for other in chip().values() if other.rp is not None)
    if key == "direction" and pin.cn is None:
        return "choose a pin with the chip's pull-up: any but RA7 to RA10"
    if key in PWM and PWM[key] not in pin.others:
        return "the chip fixes its PWM pins: A on RB14 and RB15, B on RB12 and RB13, C on RB10 and RB11; swap the motor's wires instead"
    if key not in PWM and "PWM1" in pin.others:
        return "the PWM module drives this pin"
    return ""


def differences(pins: dict[str, str]) -> list[str]:
    """The lines of include/board/mclv.h to change before the firmware fits these pins."""
    changed = {f"BOARD_PIN_{key.upper()}": name for key, name in pins.items() if name != firmware()[key].pin}
    if pins.get("uart_tx") == _other_tx():
        changed["BOARD_OTHER_TX"] = firmware()["uart_tx"].pin
    return [f"#define {macro} {name[1]}, {name[2:]}" for macro, name in changed.items()]


def _other_tx() -> str:
    """The pin that BRINGUP tries beside the serial line's own."""
    port, bit = re.search(r"^#define BOARD_OTHER_TX (\w), (\d+)", SOURCE.read_text(encoding="utf-8"), re.MULTILINE).groups()
    return f"R{port}{bit}"


def page() -> list[list[str]]:
    """A row for each pin of the chip: number, port, analogue, remappable, other functions, what the MCLV has there, known from."""
    by_pin = {signal.pin: signal for signal in firmware().values()}
    for signal in [by_pin[firmware()[key].pin] for key in PWM]:
        low = f"{signal.pin[:2]}{int(signal.pin[2:]) + 1}"
        by_pin[low] = Signal(low, signal.what.replace("high", "low"), signal.known_from)
    result = []
    for pin in chip().values():
        signal = by_pin.get(pin.name, Signal(pin.name, "", ""))
        result.append([str(pin.number), pin.name, "" if pin.an is None else f"AN{pin.an}", "" if pin.rp is None else f"RP{pin.rp}", pin.others,
                       signal.what, signal.known_from])
    return result
