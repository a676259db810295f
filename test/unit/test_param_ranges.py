"""The build refuses a userparams.h that cannot work, by name, value and range; what it accepts fits every number format."""

import random
import re
import subprocess
import tempfile
from pathlib import Path

import pytest
from c_compiler import CFLAGS, ROOT, compiler

from tools.common.param_rows import FOLLOWS, Parameter, modes, parameters
from tools.common.tuned_rows import tuned
from tools.common.x_macro import rows

USERPARAMS = (ROOT / "userparams.h").read_text(encoding="utf-8")
PARAMETERS = list(parameters().values())
MODES = re.findall(r"^/\* #define (\w+) \*/", USERPARAMS, re.MULTILINE)


def below(p: Parameter) -> str:
    return f"{float(p.low) - 0.01 * (abs(float(p.low)) or float(p.high)):.9g}"


def above(p: Parameter) -> str:
    return f"{float(p.high) + 0.01 * (abs(float(p.high)) or -float(p.low)):.9g}"


def refusal(p: Parameter, value: str) -> str:
    return f"userparams.h: {p.name} = {value} is outside {p.low} .. {p.high} {p.unit}"


def relations(table: str = "PARAM_RELATION_TABLE") -> list[str]:
    """The messages of the relations between parameters."""
    return [message for _, message in rows("include", "drive/param_limits.h", table, "#condition message")]


def with_values(values: dict[str, str]) -> str:
    """userparams.h with other values; a name that it lacks is added."""
    text = USERPARAMS
    for name, value in values.items():
        changed, count = re.subn(rf"^(#define {name}[ \t]+)\S+", rf"\g<1>{value}", text, flags=re.MULTILINE)
        text = changed if count else text.replace("#define NOPOLESPAIRS", f"#define {name} {value}\n#define NOPOLESPAIRS", 1)
    return text


def build(values: dict[str, str], *options: str) -> tuple[int, str]:
    """Compiles param_check.c with these values and the compiler's options: exit code and messages."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "userparams.h").write_text(with_values(values), encoding="utf-8")
        done = compiler([*CFLAGS, *options, f"-I{folder}", "-Iinclude", "-I.", "-c", "firmware/drive/param_check.c", "-o", f"{folder}/out.o"])
        return done.returncode, done.stderr


def defines(values: dict[str, str]) -> list[str]:
    """Lines that give the names other values from here on."""
    return [line for name, value in values.items() for line in (f"#undef {name}", f"#define {name} {value}")]


def output_of(source: list[str]) -> list[str]:
    """Lines that a C program prints."""
    with tempfile.TemporaryDirectory() as folder:
        done = compiler(["-std=gnu99", "-w", "-O0", "-ftrack-macro-expansion=0", "-Iinclude", "-I.", "-xc", "-", "-o", f"{folder}/program"],
                        "\n".join(source))
        assert done.returncode == 0, done.stderr
        return subprocess.run([f"{folder}/program"], capture_output=True, text=True, check=True).stdout.splitlines()


def test_the_values_in_use_are_accepted() -> None:
    code, messages = build({})
    assert code == 0 and not messages, messages


@pytest.mark.parametrize("beyond", [below, above])
def test_each_value_outside_its_range_is_refused_by_name_value_and_range(beyond) -> None:
    code, messages = build({p.name: beyond(p) for p in PARAMETERS})
    missing = [refusal(p, beyond(p)) for p in PARAMETERS if refusal(p, beyond(p)) not in messages]
    assert code != 0 and not missing, missing


def test_the_ends_of_every_range_are_inside_it() -> None:
    for values in ({p.name: p.low for p in PARAMETERS}, {p.name: p.high for p in PARAMETERS}):
        messages = build(values)[1]
        assert "is outside" not in messages, messages


def test_one_wrong_value_alone_stops_the_build_with_one_message() -> None:
    for name in ("TUNING_DELAY_RAMPUP", "KFILTER_VELESTIM", "KFILTER_ESDQ", "INVKFI_SPEED9", "LS_OVER2LS0_SPEED17", "DATA_BUFFER_SIZE",
                 "SNAPDELAY"):
        parameter = parameters()[name]
        for value in (below(parameter), above(parameter)):
            code, messages = build({name: value})
            assert code != 0 and messages.count(": error:") == 1 and refusal(parameter, value) in messages, f"{name} = {value}: {messages}"


def case(name: str, breaks: str, keeps: str, **others: str) -> tuple[dict[str, str], dict[str, str]]:
    return {name: breaks} | others, {name: keeps} | others


LOOPS = ("D_CURRCNTR", "Q_CURRCNTR", "SPEEDCNTR")
# For each relation a value that breaks it, and one just inside. R, L and Kphi scale with 24 V, 50 us and 4.4 A.
RELATIONS = {
    "LOOPTIME_SEC must be at least 0.00004 with SCOPE": [case("SCOPE", "1", "0", LOOPTIME_SEC="0.000025"), case("LOOPTIME_SEC", "0.00003995", "0.00004", SCOPE="1")],
    "LOOPTIME_SEC must be a multiple of 50 ns": [
        case("LOOPTIME_SEC", "0.00005001", "0.00005"), case("LOOPTIME_SEC", "0.000050025", "0.00005005"), case("LOOPTIME_SEC", "0.00013993", "0.00013995")],
    **{f"{gain} must be 0.1 .. 0.6 or -0.6 .. -0.1": [case(gain, "0", "0.1"), case(gain, "-0.09", "-0.1"), case(gain, "0.09", "0.6")]
       for gain in ("KCURRA", "KCURRB")},
    "NOMINAL_SPEED_RPM must be above MINIMUM_SPEED_RPM": [case("MINIMUM_SPEED_RPM", "2800", "2799")],
    "MAXIMUM_SPEED_RPM must be at least NOMINAL_SPEED_RPM": [case("MAXIMUM_SPEED_RPM", "2799", "2800")],
    "FW_START_SPEED_RPM must be below MAXIMUM_SPEED_RPM": [case("FW_START_SPEED_RPM", "5500", "5499")],
    "MAXIMUM_SPEED_RPM times NOPOLESPAIRS must be at most 75000 electrical rpm": [
        case("MAXIMUM_SPEED_RPM", "15001", "15000"), case("NOPOLESPAIRS", "8", "7", MAXIMUM_SPEED_RPM="10500")],
    "MAXIMUM_SPEED_RPM times NOPOLESPAIRS must be at most 3.75 / LOOPTIME_SEC": [
        case("MAXIMUM_SPEED_RPM", "7501", "7500", LOOPTIME_SEC="0.0001"), case("MAXIMUM_SPEED_RPM", "6401", "6400", LOOPTIME_SEC="0.00014"),
        case("LOOPTIME_SEC", "0.00005005", "0.00005", MAXIMUM_SPEED_RPM="15000")],
    "NOMINAL_SPEED_RPM * NOPOLESPAIRS must be at most 27000": [
        case("NOMINAL_SPEED_RPM", "5401", "5400"), case("NOMINAL_SPEED_RPM", "10801", "10800", MAXIMUM_SPEED_RPM="12000")],
    "END_SPEED_RPM must be at most NOMINAL_SPEED_RPM": [case("END_SPEED_RPM", "2801", "2800")],
    "MOTOR_RS_OHM does not fit its Q format": [case("MOTOR_RS_OHM", "33", "32", NORM_CURRENT_CONST="0.0002")],
    "MOTOR_LS_MH does not fit its Q format": [case("MOTOR_LS_MH", "16.2", "16.0")],
    "MOTOR_RS_OHM rounds by more than 0.5 %": [case("MOTOR_RS_OHM", "0.0123", "0.0125", NORM_CURRENT_CONST="0.0001")],
    "MOTOR_KPHI_V_PER_KRPM does not fit 1/Kphi's Q format": [
        case("MOTOR_KPHI_V_PER_KRPM", "1.7", "1.8"), case("MOTOR_KPHI_V_PER_KRPM", "56.5", "56.1", SPEED_BANDWIDTH_HZ="4")],
    "INVKFI_SPEED0 must be 0.6 .. 1.6 of NORM_INVKFIBASE": [
        case("INVKFI_SPEED0", "4770", "4780"), case("INVKFI_SPEED0", "12740", "12720"), case("MAXIMUM_SPEED_RPM", "6401", "6400", INVKFI_SPEED0="7956")],
    **{f"INVKFI_SPEED{i} must be 0.6 .. 1.6 of NORM_INVKFIBASE": [case(f"INVKFI_SPEED{i}", "4770" if i % 2 else "12740", "4780" if i % 2 else "12720")]
       for i in range(1, 18)},
    "KCURRB must have the sign of KCURRA": [case("KCURRB", "0.5", "-0.5"), case("KCURRA", "0.1", "-0.1"), case("KCURRA", "-0.4", "0.4", KCURRB="0.4")],
    "MOTOR_SALIENCY_UH must be below 950 * MOTOR_LS_MH": [case("MOTOR_SALIENCY_UH", "1824", "1823")],
    "MOTOR_SALIENCY_UH times MAXIMUM_CURRENT_A must be 1/8 to 1 of": [
        case("MOTOR_SALIENCY_UH", "362", "364"), case("MOTOR_SALIENCY_UH", "1605", "1603", MOTOR_KPHI_V_PER_KRPM="4")],
    "Q_CURRENT_REF_OPENLOOP must not exceed MAXIMUM_CURRENT_A": [case("Q_CURRENT_REF_OPENLOOP", "2.76", "2.75")],
    "MAXIMUM_CURRENT_A must be below OVER_CURRENT_THRESHOLD_A": [case("MAXIMUM_CURRENT_A", "3.8", "3.79")],
    "I2T_CURRENT_A must not exceed MAXIMUM_CURRENT_A": [case("I2T_CURRENT_A", "2.76", "2.75")],
    "SUPPLY_CURRENT_LIMIT_A must be 0, for no limit, or 1/64 to 1 of MAXIMUM_CURRENT_A": [
        case("SUPPLY_CURRENT_LIMIT_A", "2.76", "2.75"), case("SUPPLY_CURRENT_LIMIT_A", "0.0429", "0.043"), case("SUPPLY_CURRENT_LIMIT_A", "0.01", "0")],
    "OVER_CURRENT_THRESHOLD_A must be at most 86.5 %": [case("OVER_CURRENT_THRESHOLD_A", "3.81", "3.8")],
    "MAXIMUM_CURRENT_A must be at least 6.3 %": [case("MAXIMUM_CURRENT_A", "0.277", "0.278")],
    "FW_TRIM_CURRENT_A must not exceed MAXIMUM_CURRENT_A": [case("FW_TRIM_CURRENT_A", "2.76", "2.75")],
    **{f"{loop}_CTERM must be 0.9 .. 0.9999": [case(f"{loop}_CTERM", "0.89", "0.9"), case(f"{loop}_CTERM", "1.0", "0.9999")]
       for loop in LOOPS[:2]},
    **{f"{loop}_PTERM must be positive": [case(f"{loop}_PTERM", "0.0", "0.001")] for loop in LOOPS},
    **{f"{loop}_ITERM must not be negative": [case(f"{loop}_ITERM", "-0.001", "0.0")] for loop in LOOPS[:2]},
    "the back-EMF's format overflows": [case("MOTOR_RS_OHM", "3.93", "3.86")],
    "OVER_VOLTAGE_V must be above NOMINAL_BUS_V": [case("OVER_VOLTAGE_V", "24.0", "24.1")],
    "OVER_VOLTAGE_V must be inside BUS_FULL_SCALE_V": [case("BUS_FULL_SCALE_V", "34.6", "34.8")],
    "OVER_VOLTAGE_V must be at most 1.9 * NOMINAL_BUS_V": [case("OVER_VOLTAGE_V", "45.7", "45.5")],
    "UNDER_VOLTAGE_V must be below NOMINAL_BUS_V": [case("UNDER_VOLTAGE_V", "24.0", "23.9")],
    "UNDER_VOLTAGE_V must be at least 0.3 * NOMINAL_BUS_V": [case("UNDER_VOLTAGE_V", "7.1", "7.3")],
    "DERATE_BELOW_V must be 0, for no derating, or at least UNDER_VOLTAGE_V + 1 V": [
        case("DERATE_BELOW_V", "12.9", "13"), case("DERATE_BELOW_V", "0.1", "0"), case("UNDER_VOLTAGE_V", "18.1", "18", DERATE_BELOW_V="19")],
    "DERATE_BELOW_V must be at most NOMINAL_BUS_V": [case("DERATE_BELOW_V", "24.1", "24")],
    **{f"{sensor}_DERATE_C must be at least 5 below {sensor}_TRIP_C": [case(f"{sensor}_TRIP_C", "94.9", "95", **{f"{sensor}_NTC_USED": "1", f"{sensor}_DERATE_C": "90"})]
       for sensor in ("MOTOR", "BRIDGE")},
    **{f"{sensor}_NTC_DIVIDER_OHM must be at least 1/65 of the NTC's resistance at -40": [
        case(f"{sensor}_NTC_DIVIDER_OHM", "3770", "3790", **{f"{sensor}_NTC_USED": "1"})] for sensor in ("MOTOR", "BRIDGE")},
    **{f"{sensor}_NTC_DIVIDER_OHM must be at most 85 times the NTC's resistance at 152": [
        case(f"{sensor}_NTC_DIVIDER_OHM", "27600", "27450", **{f"{sensor}_NTC_USED": "1"})] for sensor in ("MOTOR", "BRIDGE")},
    "REGEN_LIMIT_V must be above NOMINAL_BUS_V": [case("REGEN_LIMIT_V", "24.0", "24.1")],
    "REGEN_LIMIT_V + 2 V must be at most OVER_VOLTAGE_V": [case("REGEN_LIMIT_V", "32.1", "31.9")],
    "BRAKE_CHOPPER_V must be 0, for no brake resistor, or at least 1.05 * NOMINAL_BUS_V": [
        case("BRAKE_CHOPPER_V", "25.1", "25.2"), case("BRAKE_CHOPPER_V", "0.5", "0"), case("NOMINAL_BUS_V", "24.8", "24.7", BRAKE_CHOPPER_V="26")],
    "REGEN_LIMIT_V must be at least 1.02 * BRAKE_CHOPPER_V": [
        case("BRAKE_CHOPPER_V", "26.5", "26.4"), case("REGEN_LIMIT_V", "30.5", "30.7", BRAKE_CHOPPER_V="30")],
    "UNDER_VOLTAGE_V is too low for the modulator's division": [case("LOOPTIME_SEC", "0.0002", "0.00014")],
    "SAMPLE_WINDOW_SEC must be at least DEADTIME_SEC + 1 us": [
        case("DEADTIME_SEC", "0.00000213", "0.0000021"),
        case("SAMPLE_DELAY_CLOCKS", "39", "40", DEADTIME_SEC="0.000002", SAMPLE_WINDOW_SEC="0.000002"),
        case("SAMPLE_WINDOW_SEC", "0.00000248", "0.0000025", DEADTIME_SEC="0.000003")],
    "SAMPLE_WINDOW_SEC must be at least the SAMPLE_DELAY_CLOCKS": [
        case("SAMPLE_DELAY_CLOCKS", "81", "80", SAMPLE_WINDOW_SEC="0.000002"), case("SAMPLE_WINDOW_SEC", "0.00000158", "0.0000016", SAMPLE_DELAY_CLOCKS="64")],
    "BUS_FULL_SCALE_V is too large for NOMINAL_BUS_V": [case("BUS_FULL_SCALE_V", "329.9", "326", NOMINAL_BUS_V="20", OVER_CURRENT_THRESHOLD_A="3")],
    **{f"IDREF_SPEED{i} must not exceed MAXIMUM_CURRENT_A": [case(f"IDREF_SPEED{i}", "-2.76", "-2.75")] for i in range(18)},
    "D_CURRCNTR_PTERM must be below 1": [case("D_CURRCNTR_PTERM", "1.0", "0.99"), case("MOTOR_LS_MH", "4.0", "3.8", CURRENT_BANDWIDTH_HZ="2000")],
    "Q_CURRCNTR_PTERM must be below 1": [case("Q_CURRCNTR_PTERM", "1.0", "0.99")],
    **{f"{loop}_ITERM must be below 15.9": [case(f"{loop}_ITERM", "15.95", "15.85")] for loop in LOOPS[:2]},
    "BRIDGE_RS_OHM must be 0 .. 1 ohm": [case("BRIDGE_RS_OHM", "-0.001", "0"), case("BRIDGE_RS_OHM", "1.01", "0.021")],
    "SPEEDCNTR_PTERM must be below 1": [case("SPEEDCNTR_PTERM", "1.0", "0.99")],
    "MOTOR_INERTIA_KGM2 does not fit the load observer's format": [
        case("MOTOR_INERTIA_KGM2", "6.1e-7", "6.2e-7"), case("MOTOR_INERTIA_KGM2", "4.1e-2", "4.0e-2", SPEED_BANDWIDTH_HZ="0.2")],
    "LOAD_BANDWIDTH_HZ * LOOPTIME_SEC must be at most 0.0074": [
        case("LOAD_BANDWIDTH_HZ", "150", "148"), case("LOAD_BANDWIDTH_HZ", "75", "74", LOOPTIME_SEC="0.0001"),
        case("LOAD_BANDWIDTH_HZ", "150", "148", LOOPTIME_SEC="0.000025")],
    # 1126 * 24 * 2 us / 50 us / 7.24 = 149.3
    "END_SPEED_RPM must be at least 1126 * NOMINAL_BUS_V": [case("END_SPEED_RPM", "149", "150")],
    "MINIMUM_SPEED_RPM must be at least 1126 * NOMINAL_BUS_V": [case("MINIMUM_SPEED_RPM", "149", "150")],
    "SPEEDREF_DECEL_RPM_PER_S must be 0, for SPEEDREFRAMP_RPM_PER_S, or at least 1": [
        case("SPEEDREF_DECEL_RPM_PER_S", "0.99", "1"), case("SPEEDREF_DECEL_RPM_PER_S", "0.001", "0")],
    # 2.75 A * 2.67 ohm = 7.34 V, 1756 rpm, 1.5 times 1170.9
    "STOP_MODE must be 0 or 1 where MAXIMUM_CURRENT_A * MOTOR_RS_OHM is less than": [
        case("STOP_MODE", "2", "1", MINIMUM_SPEED_RPM="1172"), case("MINIMUM_SPEED_RPM", "1172", "1170", STOP_MODE="2")],
    "RECORDER_PERIODS must be 0, 2, 4": [case("RECORDER_PERIODS", "1", "2"), case("RECORDER_PERIODS", "3", "4"), case("RECORDER_PERIODS", "63", "64"),
                                         case("RECORDER_PERIODS", "5", "0")],
    "SPEED_BANDWIDTH_HZ must be at most 0.148 * LOAD_BANDWIDTH_HZ": [
        case("SPEED_BANDWIDTH_HZ", "16.4", "16.2", MINIMUM_SPEED_RPM="150"), case("SPEED_BANDWIDTH_HZ", "33.5", "33.2", MINIMUM_SPEED_RPM="1000")],
}
# The values that the cases above start from, so that a user's own userparams.h does not change what they mean.
BASE = {p.name: p.low if p.default in FOLLOWS else p.default for p in PARAMETERS} | dict(
    re.findall(r"^#define (\w+) (\S+)$", (ROOT / "test/unit/support/hurst_params.h").read_text(encoding="utf-8"), re.MULTILINE))


# Parameters that have a default in the scaling headers, with that default.
SCALING = "".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "include/drive/scaling").glob("*.h")))
DERIVED = dict(re.findall(r"^#ifndef (?:\w+).*\n#define (\w+) ((?:.*\\\n)*.*)", SCALING, re.MULTILINE))


def test_every_relation_has_a_case() -> None:
    in_table = relations()
    unknown = [key for key in RELATIONS if not any(message.startswith(key) for message in in_table)]
    untested = [message for message in in_table if not any(message.startswith(key) for key in RELATIONS)]
    assert not unknown and not untested, f"no such relation: {unknown}; not tested: {untested}"


def test_every_relation_is_broken_by_its_case_and_kept_just_inside() -> None:
    """One program says for each case which relations of the table's part hold: the macros take the values that they find at the place of use."""
    header = (ROOT / "include/drive/param_limits.h").read_text(encoding="utf-8")
    groups = {name: relations(name) for name in re.findall(r"(PARAM_RELATION_\w+)\(X\)", re.search(r"define PARAM_RELATION_TABLE\(X\)((?:.*\\\n)*.*)", header)[1])}
    assert [message for messages in groups.values() for message in messages] == relations()
    tried = [(message, values, holds) for message, pairs in RELATIONS.items() for pair in pairs
             for values, holds in zip(pair, (False, True), strict=True)]
    source = ["#include <stdio.h>", "#define USERPARAMS_H", *defines(BASE),
              '#include "drive/param_init.h"', '#include "drive/param_limits.h"',
              "#define HOLDS(condition, message) putchar((condition) ? '1' : '0');", "int main(void)", "{"]
    for message, values, _ in tried:
        source += [*defines(values), *(f"    {name}(HOLDS)" for name, texts in groups.items() if any(text.startswith(message) for text in texts)), "    puts(\"\");",
                   *defines({name: BASE.get(name) or DERIVED.get(name) or tuned()[name].value for name in values})]
    source += ["    return 0;", "}"]
    wrong = []
    for (message, values, should), line in zip(tried, output_of(source), strict=True):
        in_table = [text for texts in groups.values() if any(text.startswith(message) for text in texts) for text in texts]
        holds = all(bit == "1" for bit, text in zip(line, in_table, strict=True) if text.startswith(message))
        if holds != should:
            wrong.append(f"{values} {'breaks' if should else 'keeps'}: {message}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("values, message", [
    ({"END_SPEED_RPM": "2801"}, "END_SPEED_RPM = 2801 must be at most NOMINAL_SPEED_RPM = 2800"),
    ({"MOTOR_KPHI_V_PER_KRPM": "1.7"}, "MOTOR_KPHI_V_PER_KRPM = 1.7 does not fit 1/Kphi's Q format"),
    ({"IDREF_SPEED3": "-2.76"}, "IDREF_SPEED3 = -2.76 must not exceed MAXIMUM_CURRENT_A = 2.75"),
    # beyond 17.6 A, where Q13 ends, the counts wrap around
    ({"IDREF_SPEED0": "-18.0"}, "IDREF_SPEED0 = -18.0 must not exceed MAXIMUM_CURRENT_A = 2.75"),
    ({"IDREF_SPEED17": "-18.0"}, "IDREF_SPEED17 = -18.0 must not exceed MAXIMUM_CURRENT_A = 2.75"),
    ({"FW_TRIM_CURRENT_A": "18.0"}, "FW_TRIM_CURRENT_A = 18.0 must not exceed MAXIMUM_CURRENT_A = 2.75"),
    ({"MINIMUM_SPEED_RPM": "149"}, "MINIMUM_SPEED_RPM = 149 must be at least 1126 * NOMINAL_BUS_V * DEADTIME_SEC / LOOPTIME_SEC / MOTOR_KPHI"),
    ({"RECORDER_PERIODS": "1"}, "RECORDER_PERIODS = 1 must be 0, 2, 4, 8, 16, 32 or 64: the periods are counted in bits"),
    ({"STOP_MODE": "3"}, "STOP_MODE = 3 is outside 0 .. 2 mode"),
    ({"STOP_MODE": "2", "MINIMUM_SPEED_RPM": "1172", "END_SPEED_RPM": "1172"}, "STOP_MODE = 2 must be 0 or 1 where MAXIMUM_CURRENT_A * MOTOR_RS_OHM"),
    ({"SPEED_BANDWIDTH_HZ": "17"}, "SPEED_BANDWIDTH_HZ = 17 must be at most 0.148 * LOAD_BANDWIDTH_HZ"),
])
def test_a_broken_relation_stops_the_build_with_its_message(values: dict[str, str], message: str) -> None:
    code, messages = build(BASE | values)
    first = next(line for line in messages.splitlines() if "error:" in line)
    assert code != 0 and f"userparams.h: {message}" in first, messages


@pytest.mark.parametrize("a_count, option, refused", [("0.00391", "-DBRINGUP", True), ("0.00391", "-UBRINGUP", False), ("0.00389", "-DBRINGUP", False)])
def test_bringup_is_refused_on_boards_whose_milliamperes_do_not_fit_its_words(a_count: str, option: str, refused: bool) -> None:
    large = {"NORM_CURRENT_CONST": a_count, "MAXIMUM_CURRENT_A": "12", "OVER_CURRENT_THRESHOLD_A": "20",
             "MOTOR_RS_OHM": "0.1", "MOTOR_LS_MH": "0.1", "MOTOR_INERTIA_KGM2": "5e-5"}
    code, messages = build(BASE | large, option)
    message = f"userparams.h: NORM_CURRENT_CONST = {a_count} must be at most 0.0039 with BRINGUP, which counts milliamperes in 16 bits: leave BRINGUP out"
    assert (code != 0, message in messages) == (refused, refused), messages


@pytest.mark.parametrize("name", ["SPEEDCNTR_ITERM", "SPEEDCNTR_CTERM"])
def test_a_header_with_the_speed_integral_is_refused_in_one_line(name: str) -> None:
    code, messages = build({name: "0.001"})
    assert code != 0 and messages.count(": error:") == 1 and "takes the place of the integral, remove them" in messages, messages


def test_the_numbers_in_messages_are_those_of_the_header() -> None:
    text = "".join(relations())
    print_ = 'printf("%.0f %.3f", 1000 * PARAM_SQRT3 * PARAM_LOWEST_SHARE, PARAM_CALM_SHARE / PARAM_FULL_RATIO);'
    found = output_of(["#include <stdio.h>", *defines(BASE), "#define USERPARAMS_H", '#include "drive/param_scaling.h"', "int main(void)",
                       "{", print_, "return 0;", "}"])[0]
    lowest, calm = found.split()
    assert text.count(f"at least {lowest} * NOMINAL_BUS_V") == 2 and f"at most {calm} * LOAD_BANDWIDTH_HZ" in text, found


BOARD_INCLUDES = ["-Itools/vboard", "-Itools/chip", "-Itools/plant"]


def test_every_mode_of_userparams_is_off_and_used_by_the_firmware() -> None:
    assert sorted(MODES) == sorted(modes()), MODES
    sources = "".join(f.read_text(encoding="utf-8") for room in ("firmware", "include") for f in (ROOT / room).rglob("*.[ch]"))
    unused = [mode for mode in MODES if not re.search(rf"#if.*\b{mode}\b|#elif.*\b{mode}\b", sources)]
    assert not unused, unused


def test_a_mode_means_the_same_in_userparams_and_on_the_command_line() -> None:
    files = [str(f) for room in ("firmware", "tools/cpu_host") for f in sorted((ROOT / room).rglob("*.c"))]
    with tempfile.TemporaryDirectory() as folder:
        for mode in MODES:
            text = USERPARAMS.replace(f"/* #define {mode} */", f"#define {mode}")
            (Path(folder) / "userparams.h").write_text(text, encoding="utf-8")
            seen = [compiler([flag, *CFLAGS, "-Itools/cpu_host", *BOARD_INCLUDES, "-Iinclude", "-I.", "-E", "-P", *files])
                    for flag in (f"-I{folder}", f"-D{mode}")]
            assert not any(done.returncode for done in seen), seen[0].stderr + seen[1].stderr
            differing = [line for line in zip(*(done.stdout.splitlines() for done in seen)) if line[0] != line[1]]
            assert seen[0].stdout == seen[1].stdout, f"{mode}: {differing[:1]}"


# ---- every value that the build accepts fits its number format: the parameters once as they are, once with 64-bit integers ----

MEMBER = re.compile(r"^\s*(\w+) ([\w, \[\]]+);", re.MULTILINE)


def members(struct: str, headers: str, prefix: str = "") -> list[str]:
    """Paths of all numbers in a struct of the headers, array elements included."""
    body = re.search(rf"struct {struct.removesuffix('_t')} \{{([^}}]*)\}};|struct \{{([^}}]*)\}} {struct};", headers)
    found = []
    for kind, names in MEMBER.findall(body[1] or body[2]):
        for name in names.split(","):
            base, _, size = name.strip().rstrip("]").partition("[")
            if re.search(r"\} " + kind + ";", headers):
                found += members(kind, headers, f"{prefix}{base}.")
            else:
                found += [f"{prefix}{base}[{i}]" for i in (0, 17)] if size else [f"{prefix}{base}"]
    return found


FLAT = {f"IDREF_SPEED{i}": "0" for i in range(18)}


def cases() -> list[dict[str, str]]:
    """Parameter sets to try: every end of a range, some pairs that are known to matter, and random steps away from the motor in use."""
    table_middle = re.compile(r"_SPEED([1-9]|1[0-6])$")
    scalars = [p for p in PARAMETERS if not table_middle.search(p.name)]
    found = [{p.name: value} for p in scalars for value in (p.low, p.high)]
    found += [{"LOOPTIME_SEC": "0.00014", "UNDER_VOLTAGE_V": "15"}, {"NOMINAL_SPEED_RPM": "5400", "END_SPEED_RPM": "5000"},
              {"MAXIMUM_CURRENT_A": "0.2773", "FW_TRIM_CURRENT_A": "0", "Q_CURRENT_REF_OPENLOOP": "0.2"} | FLAT,
              {"NOPOLESPAIRS": "1", "MAXIMUM_SPEED_RPM": "30000", "NOMINAL_SPEED_RPM": "20000"}]
    dice = random.Random(1)
    for _ in range(100):
        chosen = dice.sample(scalars, dice.randint(2, 4))
        found.append(FLAT | {p.name: random_value(dice, p) for p in chosen})
    return found


def random_value(dice: random.Random, p: Parameter) -> str:
    """Between the ends, on a logarithmic scale for what cannot be negative."""
    low, high = float(p.low), float(p.high)
    value = low * (high / low) ** dice.random() if low > 0 else low + (high - low) * dice.random()
    return f"{value:.0f}" if re.fullmatch(r"\d+|0x[0-9A-F]+", BASE[p.name]) else f"{value:.6g}"


def numbers_in_counts(tried: list[dict[str, str]], wide: bool) -> tuple[list[str], list[list[str]]]:
    """The names of all numbers in the drive's parameters; for each case whether the build accepts it, and the numbers."""
    headers = "".join((ROOT / "include" / h).read_text(encoding="utf-8") for h in (
        "control/estimator.h", "control/transforms.h", "control/svm.h", "control/current_control.h", "control/observer.h",
        "control/motor_model.h", "drive/drive.h"))
    paths = members("drive_params_t", headers)
    assert len(paths) > 60, paths
    source = ["#include <stdint.h>", "#include <stdio.h>"]
    if wide:
        source += [f"#define {name}_t int64_t" for name in ("int16", "uint16", "int32", "uint32")]
    source += ["#define USERPARAMS_H", *defines(BASE), '#include "drive/param_init.h"', '#include "drive/param_limits.h"',
               "#define AND(condition, message) && (condition)",
               "static void show(int accepted, const drive_params_t *p)", "{", '    printf("%d", accepted);',
               *(f'    printf(" %lld", (long long)p->{path});' for path in paths), '    puts("");', "}"]
    for n, values in enumerate(tried):
        source += [*defines(values), f"static void case_{n}(void)", "{", "    static const drive_params_t p = DRIVE_PARAMS_INIT;",
                   "    show(1 PARAM_RELATION_TABLE(AND), &p);", "}", *defines({name: BASE[name] for name in values})]
    source += ["int main(void)", "{", *(f"    case_{n}();" for n in range(len(tried))), "    return 0;", "}"]
    return paths, [line.split() for line in output_of(source)]


def test_every_accepted_parameter_set_fits_the_drives_number_formats() -> None:
    paths, narrow = numbers_in_counts(cases(), wide=False)
    accepted = [(values, real) for values, real in zip(cases(), narrow, strict=True) if real[0] == "1"]
    _, wide = numbers_in_counts([values for values, _ in accepted], wide=True)
    wrong = []
    for (values, real), ideal in zip(accepted, wide, strict=True):
        wrong += [f"{ {k: v for k, v in values.items() if (k, v) not in FLAT.items()} }: {path} is {is_} instead of {should}"
                  for path, is_, should in zip(paths, real[1:], ideal[1:], strict=True) if is_ != should]
    assert len(accepted) > 60, f"only {len(accepted)} sets were accepted"
    assert not wrong, "\n".join(wrong)
