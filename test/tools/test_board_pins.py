"""The chip's pins: the table against the virtual chip, the firmware's choice, a board file's [pins], and builds with other pins."""

import re
import subprocess

import pytest
from tune_support import COMPILER
from support import refusal

from tools.common import board_file, paths, pins

MCLV = (paths.BOARDS / "mclv.toml").read_text(encoding="utf-8")
HEADER = pins.SOURCE.read_text(encoding="utf-8")


# ---- the table ---------------------------------------------------------------------------------------------------------------
def test_the_table_has_the_pins_that_the_virtual_chip_has():
    text = (paths.ROOT / "tools/chip/chip_ports.c").read_text(encoding="utf-8")
    bits = {port: sum(1 << int(name[2:]) for name in pins.chip() if name[1] == port) for port in "ABC"}
    implemented = re.search(r"implemented\[3\] = \{(.*?)\}", text)[1]
    assert list(bits.values()) == [int(mask, 16) for mask in implemented.split(",")]
    shifts, masks = (re.search(rf"{name}\[3\] = \{{(.*?)\}}", text)[1].split(",") for name in ("shift", "mask"))
    for port, shift, mask in zip("ABC", shifts, masks):
        analogue = {pin.an: int(name[2:]) for name, pin in pins.chip().items() if name[1] == port and pin.an is not None}
        assert analogue == {int(shift) + bit: bit for bit in range(16) if int(mask, 16) >> bit & 1}
    assert {pin.rp: name for name, pin in pins.chip().items() if pin.rp is not None} == {
        rp: f"RB{rp}" if rp < 16 else f"RC{rp - 16}" for rp in range(26)}


def test_each_change_notice_is_on_one_pin():
    assert sorted(pin.cn for pin in pins.chip().values() if pin.cn is not None) == list(range(31))
    assert [name for name, pin in pins.chip().items() if pin.cn is None] == ["RA10", "RA7", "RA8", "RA9"]


def test_no_pin_is_there_twice_and_the_pwm_s_are_rb10_to_15():
    numbers = [pin.number for pin in pins.chip().values()]
    assert len(set(numbers)) == len(numbers) == 35 and max(numbers) == 44
    found = {match[0]: name for name, pin in pins.chip().items() if (match := re.search(r"PWM1[HL]\d", pin.others))}
    assert found == {"PWM1H1": "RB14", "PWM1L1": "RB15", "PWM1H2": "RB12", "PWM1L2": "RB13", "PWM1H3": "RB10", "PWM1L3": "RB11"}


def test_the_firmware_s_pins_are_all_told():
    assert len(pins.firmware()) == len(re.findall(r"^#define BOARD_PIN_", HEADER, re.MULTILINE)) == 21
    assert (pins.firmware()["fault"].pin, pins.firmware()["fault"].known_from) == ("RB8", "published code")


def test_a_remappable_pin_s_output_is_chosen_in_the_register_of_its_rp_number():
    found = re.findall(r"#define PIN_([BC]\d+)_OUTPUT (\S+)", (paths.ROOT / "include/board/pin_table.h").read_text(encoding="utf-8"))
    assert found == [(name[1:], f"RPOR{pin.rp // 2}bits.RP{pin.rp}R") for name, pin in
                     sorted(pins.chip().items(), key=lambda item: item[1].rp or 0) if pin.rp is not None]


def test_the_page_tells_what_the_board_has_on_a_pin_and_on_the_low_side_of_its_bridge():
    told = {row[1]: row[5] for row in pins.page()}
    assert told["RB15"] == "PWM of phase A (M1), low side" and told["RC2"] == "potentiometer" and told["RB9"] == ""


# ---- a board file's pins -------------------------------------------------------------------------------------------------------
@pytest.fixture
def load(tmp_path):
    def of(lines: str) -> board_file.BoardFile:
        path = tmp_path / "file.toml"
        path.write_text(f"{MCLV}[pins]\n{lines}\n", encoding="utf-8")
        return board_file.load(str(path))
    return of


def test_a_pin_may_be_told_by_any_of_its_names_and_what_differs_is_a_line_of_mclv_h(load):
    found = load('fault = "RP9"\ncurrent_a = "AN3"\ncurrent_b = "RB2"\nbus = "AN5"\nuart_tx = "RC5"\ns2 = "RA8"\npwm_a = "PWM1H1"').pins
    assert found == {"fault": "RB9", "current_a": "RB1", "current_b": "RB2", "bus": "RB3", "uart_tx": "RC5", "s2": "RA8", "pwm_a": "RB14"}
    assert pins.differences(found) == ["#define BOARD_PIN_FAULT B, 9", "#define BOARD_PIN_CURRENT_A B, 1", "#define BOARD_PIN_CURRENT_B B, 2",
                                       "#define BOARD_PIN_BUS B, 3", "#define BOARD_PIN_UART_TX C, 5", "#define BOARD_OTHER_TX C, 3"]


@pytest.mark.parametrize("line, parts", [
    ('falt = "RB9"', ["unknown key 'falt'", "did you mean 'fault'?"]), ('fault = 8', ["'fault' is not a text"]), ('fault = "RD1"', ["'RD1' is no pin"]),
    ('fault = "RA8"', ["fault cannot be on RA8", "a pin with an RP number: RB9,"]), ('uart_rx = "RA9"', ["a pin with an RP number"]),
    ('direction = "RA7"', ["direction cannot be on RA7", "the chip's pull-up: any but RA7 to RA10"]), ('chopper = "RA4"', ["chopper and direction are both on RA4"]),
    ('pot = "RB8"', ["pot cannot be on RB8", "an analogue input: RA0,"]), ('s2 = "RA2"', ["the crystal is there"]),
    ('led_run = "RB15"', ["the PWM module drives this pin"]), ('pwm_b = "RB14"', ["the chip fixes its PWM pins"]),
    ('fault = "RA0"', ["an RP number"]), ('pot = "RA0"', ["pot and current_a are both on RA0"]), ('s2 = "RB4"', ["s2 and s3 are both on RB4"]),
    ('bus = "AN3"', ["current_a, current_b and bus are on RA0, RA1, RB1", "in this order"]),
    ('current_a = "AN1"\ncurrent_b = "AN0"', ["current_a, current_b and bus are on RA1, RA0, RB0"])])
def test_a_pin_that_cannot_do_it_is_refused_with_its_line(load, line, parts):
    refusal(lambda: load(line), "file.toml line 4", *parts)


# ---- builds --------------------------------------------------------------------------------------------------------------------
def built(folder, *changes: tuple[str, str], holds: str = "1", defines: tuple[str, ...] = ()) -> str:
    """What the compiler says to the firmware's pins with lines of mclv.h replaced, and to a condition on its registers."""
    text = HEADER
    for name, value in changes:
        text, count = re.subn(rf"^#define {name} .*$", f"#define {name} {value}", text, flags=re.MULTILINE)
        assert count == 1
    (folder / "board").mkdir(exist_ok=True)
    (folder / "board" / "mclv.h").write_text(text, encoding="utf-8")
    arguments = ["-std=gnu99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *defines, f"-I{folder}", "-Itools/cpu_host", "-Iinclude", "-I.",
                 "firmware/board/peripherals.c", "-xc", "-"]
    source = f'#include "board/mclv.h"\nPIN_NEEDS(registers, {holds});\n'
    return subprocess.run([*COMPILER, *arguments], input=source, cwd=paths.ROOT, capture_output=True, text=True, check=False).stderr


@pytest.mark.parametrize("changes, named", [
    ((("BOARD_PIN_FAULT", "B, 9"), ("BOARD_PIN_POT", "C, 0"), ("BOARD_PIN_LED_RUN", "A, 4"), ("BOARD_PIN_UART_TX", "C, 5"), ("BOARD_OTHER_TX", "C, 3")), ""),
    ((("BOARD_PIN_CURRENT_A", "B, 1"), ("BOARD_PIN_CURRENT_B", "B, 2"), ("BOARD_PIN_BUS", "B, 3")), ""),
    ((("BOARD_PIN_FAULT", "A, 8"),), "fault_input_has_an_RP_number"), ((("BOARD_PIN_UART_RX", "A, 9"),), "serial_line_has_RP_numbers"),
    ((("BOARD_PIN_POT", "B, 8"),), "potentiometer_and_NTCs_have_AN_numbers"), ((("BOARD_PIN_BUS", "B, 1"),), "currents_and_bus_are_AN0_to_2_or_AN3_to_5"),
    ((("BOARD_PIN_UART_TX", "C, 5"),), "BOARD_OTHER_TX_is_another_pin"), ((("BOARD_OTHER_TX", "A, 9"),), "BOARD_OTHER_TX_is_another_pin"),
    ((("BOARD_PIN_FAULT", "D, 1"),), "PIN_D1_RP")])
def test_firmware_for_other_pins_builds_and_what_the_chip_cannot_do_fails_by_name(tmp_path, changes, named):
    error = built(tmp_path, *changes)
    assert named in error and bool(error) == bool(named), error


@pytest.mark.parametrize("changes, registers", [
    ((), "BOARD_FLTA_RP == 8 && BOARD_UART_RX_RP == 20 && BOARD_AD1CHS0 == 8 && BOARD_AD1CHS123 == 0 && BOARD_AD1PCFGL == 0xFEF8"
         " && BOARD_TRIS(A) == 0xFFFF && BOARD_TRIS(B) == 0xFFFF && BOARD_TRIS(C) == 0xFF37"),
    ((("BOARD_PIN_CURRENT_A", "B, 1"), ("BOARD_PIN_CURRENT_B", "B, 2"), ("BOARD_PIN_BUS", "B, 3"), ("BOARD_PIN_POT", "A, 0"), ("BOARD_PIN_FAULT", "C, 9"),
      ("BOARD_PIN_LED_RUN", "A, 4")),
     "BOARD_FLTA_RP == 25 && BOARD_AD1CHS0 == 0 && BOARD_AD1CHS123 == 1 && BOARD_AD1PCFGL == 0xFFC6 && BOARD_TRIS(A) == 0xFFEF && BOARD_TRIS(C) == 0xFFB7")])
def test_the_registers_follow_from_the_pins(tmp_path, changes, registers):
    assert built(tmp_path, *changes, holds=registers) == ""
    assert "registers" in built(tmp_path, *changes, holds=f"!({registers})")


PRODUCT = ("-DDIRECTION_INPUT_USED=1", "-DFAULT_OUTPUT_USED=1", "-DRUNNING_OUTPUT_USED=1", "-DBRAKE_CHOPPER_V=26")


@pytest.mark.parametrize("changes, defines, registers", [
    ((), PRODUCT, "BOARD_TRIS(A) == 0xF97F && BOARD_TRIS(C) == 0xFF37 && BOARD_LAT(A) == 0 && BOARD_LAT(B) == 0 && BOARD_CNPU1 == 1 && BOARD_CNPU2 == 0"),
    ((), PRODUCT[1:2], "BOARD_TRIS(A) == 0xFF7F && BOARD_LAT(A) == 0 && BOARD_CNPU1 == 0"),
    ((), PRODUCT[2:3], "BOARD_TRIS(A) == 0xFBFF"), ((), PRODUCT[3:], "BOARD_TRIS(A) == 0xFDFF"), ((), PRODUCT[:1], "BOARD_TRIS(A) == 0xFFFF"),
    ((("BOARD_LEVEL_FAULT_OUTPUT", "1u"), ("BOARD_LEVEL_RUNNING_OUTPUT", "0u"), ("BOARD_LEVEL_CHOPPER", "0u"), ("BOARD_PIN_RUNNING_OUTPUT", "B, 7"),
      ("BOARD_PIN_CHOPPER", "C, 9"), ("BOARD_PIN_DIRECTION", "C, 8")), PRODUCT,
     "BOARD_TRIS(A) == 0xFF7F && BOARD_TRIS(B) == 0xFF7F && BOARD_TRIS(C) == 0xFD37 && BOARD_LAT(A) == 0x80 && BOARD_LAT(B) == 0x80 && BOARD_LAT(C) == 0x200"
     " && BOARD_CNPU1 == 0 && BOARD_CNPU2 == 0x10")])
def test_the_registers_of_a_product_s_pins_and_their_levels_at_power_up(tmp_path, changes, defines, registers):
    assert built(tmp_path, *changes, holds=registers, defines=defines) == ""
    assert "registers" in built(tmp_path, *changes, holds=f"!({registers})", defines=defines)


def test_a_direction_input_without_the_chip_s_pull_up_fails_by_name(tmp_path):
    pin = ("BOARD_PIN_DIRECTION", "A, 9")
    assert "direction_input_has_a_pull_up" in built(tmp_path, pin, defines=PRODUCT) and built(tmp_path, pin) == ""
