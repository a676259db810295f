"""A mistake in userparams.h is one line with the parameter, its value, the range and what to do: by the build and by the compiler alone,
on the PC and for the chip. What C allows in a header is not refused."""

import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import xc16

from tools.bench import build
from tools.common import paths
from tools.common.errors import UserError
from tools.common.param_rows import modes, parameters
from tools.common.x_macro import rows
from tools.image import image
from tuning import constants

HEADER = (paths.ROOT / "userparams.h").read_text(encoding="utf-8")
PC = [*shlex.split(os.environ.get("CC") or "gcc"), "-O2", "-ftrack-macro-expansion=0"]
CHIP = [xc16.COMPILER or "", "-mcpu=33FJ32MC204", "-omf=elf", "-O2", "-Werror", "-pedantic", "-Wconversion"]
COMPILERS = [pytest.param(PC, id="pc"), *[pytest.param(CHIP, id="chip", marks=xc16.MARKS)] * bool(xc16.COMPILER)]
CHECKS = ("firmware/drive/param_text.c", "firmware/drive/param_check.c")


def flags(folder: Path) -> list[str]:
    return ["-std=gnu99", "-Wall", "-Wextra", "-Wshadow", f"-I{folder}", "-Iinclude", "-I."]


def checked(folder: Path, compiler: list[str], text: str) -> tuple[int, list[str]]:
    """What the build says of a userparams.h with this text: exit code and lines."""
    (folder / "userparams.h").write_text(text, encoding="utf-8")
    done = subprocess.run(["tools/make/userparams.sh", folder / "stamp", *compiler, *flags(folder)], cwd=paths.ROOT, capture_output=True,
                          text=True, check=False)
    assert done.stdout == "" and (folder / "stamp").exists() == (done.returncode == 0)
    return done.returncode, [line.replace(f"{folder}/", "") for line in done.stderr.splitlines()]


def compiled(folder: Path, compiler: list[str], text: str) -> str:
    """The first error of the compiler alone, which is what a user of MPLAB X sees; "" if there is none."""
    (folder / "userparams.h").write_text(text, encoding="utf-8")
    for source in CHECKS:
        done = subprocess.run([*compiler, *flags(folder), "-c", source, "-o", folder / "out.o"], cwd=paths.ROOT, capture_output=True,
                              text=True, env=os.environ | {"LC_ALL": "C"}, check=False)
        if errors := [line for line in done.stderr.splitlines() if ": error: " in line]:
            return errors[0]
        assert done.returncode == 0, done.stderr
    return ""


def line_of(name: str) -> str:
    found = re.search(rf"^#define {name}\b.*\n", HEADER, re.MULTILINE)
    assert found, name
    return found[0]


def value(name: str, text: str) -> str:
    """userparams.h with another value."""
    return HEADER.replace(line_of(name), f"#define {name} {text}\n")


def range_of(name: str) -> str:
    p = parameters()[name]
    return f"{p.low} .. {p.high}{' ' * (p.unit != '1')}{p.unit if p.unit != '1' else ''} ({p.meaning})"


def place(text: str, name: str) -> str:
    found = re.search(rf"^#define {name}\b", text, re.MULTILINE)
    assert found, name
    return f"userparams.h:{text.count(chr(10), 0, found.start()) + 1}"


NUMBER = f"write one, {range_of('MOTOR_RS_OHM')}, with a decimal point and without a unit"
RS = line_of("MOTOR_RS_OHM")
DECIMALS = {name: number for name, number in re.findall(r"^#define (\w+) (\d+\.\d+)\b", HEADER, re.MULTILINE) if name in parameters()}
MODE = "/* #define TUNING */"
assert MODE in HEADER
# What is typed, the parameter it is about, and what the build and the compiler say of it.
MISTAKES = {
    **{f"no number {text}": (value("MOTOR_RS_OHM", text), "MOTOR_RS_OHM", f"MOTOR_RS_OHM = {text} is no number: {NUMBER}") for text in ("2,67", "(24 V)")},
    "a comma within the range": (value("MOTOR_KPHI_V_PER_KRPM", "7,24"), "MOTOR_KPHI_V_PER_KRPM",
                                 f"MOTOR_KPHI_V_PER_KRPM = 7,24 is no number: write one, {range_of('MOTOR_KPHI_V_PER_KRPM')}"),
    "a gain that is no number": (HEADER.replace(RS, RS + "#define SPEEDCNTR_PTERM 0,1\n"), "SPEEDCNTR_PTERM",
                                 "SPEEDCNTR_PTERM = 0,1 is no number: remove the line, or write a number"),
    **{f"a bridge of {text}": (HEADER.replace(RS, RS + f"#define BRIDGE_RS_OHM {text}\n"), "BRIDGE_RS_OHM", f"BRIDGE_RS_OHM {says}") for text, says in (
        ("abc", "= abc is no number: remove the line, or write a number"), ("1;", "= 1; ends in a semicolon: write 1"), ("-1", "= -1 must be 0 .. 1 ohm"))},
    "nothing": (value("MOTOR_RS_OHM", ""), "MOTOR_RS_OHM", f"MOTOR_RS_OHM has no value: write a number, {range_of('MOTOR_RS_OHM')}"),
    **{f"removed {name}": (HEADER.replace(line_of(name), ""), "",
                           f"{name} is missing: add #define {name} and a number, {range_of(name)}, or make tune")
       for name in ("MOTOR_RS_OHM", "LOAD_BANDWIDTH_HZ", "IDREF_SPEED7")},
    **{f"part of {name}": (value(name, text), name, f"{name} = {text} must be a whole number, {range_of(name)}")
       for name, text in (("NOPOLESPAIRS", "5.5"), ("LOCK_TIME", "4000.5"), ("KFILTER_ESDQ", "2000.1"), ("DATA_BUFFER_SIZE", "49.9"))},
    "no gain": (value("KCURRA", "0"), "KCURRA", "KCURRA = 0 must be 0.1 .. 0.6 or -0.6 .. -0.1: 0.5 is a gain of 1"),
    "a mode = 0": (HEADER.replace(MODE, "#define TUNING 0"), "TUNING",
                   "TUNING = 0 switches the mode on: write #define TUNING, or nothing for off"),
    "a mode = off": (HEADER.replace(MODE, "#define TUNING off"), "TUNING", "TUNING = off switches the mode on"),
    "a period the PWM cannot divide": (value("LOOPTIME_SEC", "0.0000501234"), "LOOPTIME_SEC",
                                       "LOOPTIME_SEC = 0.0000501234 must be a multiple of 50 ns, as 0.00005 is"),
    "a period that the law has no time for": (value("LOOPTIME_SEC", "0.0000245"), "LOOPTIME_SEC",
                                              f"LOOPTIME_SEC = 0.0000245 is outside {range_of('LOOPTIME_SEC')}"),
    "a mode that late duties have no time for": (value("LOOPTIME_SEC", "0.000025").replace(MODE, "#define IDENTIFY"), "LOOPTIME_SEC",
                                                 "LOOPTIME_SEC = 0.000025 must be at least 0.00004 with IDENTIFY"),
    **{f"whole numbers divided, {name} {text}": (value(name, text), name,
                                                 f"{name} = {text} divides whole numbers, of which C drops the fraction: write ")
       for name, text in (("LOOPTIME_SEC", "(1/20000)"), ("MOTOR_RS_OHM", "5/2"), ("MOTOR_RS_OHM", "(5 / 2)"), ("KCURRA", "-1/2"),
                          ("OVER_CURRENT_THRESHOLD_A", "38/10"), ("SNAPDELAY", "11/2"))},
    **{f"a division by 0, {text}": (value("MOTOR_RS_OHM", text), "MOTOR_RS_OHM",
                                    f"MOTOR_RS_OHM = {text} divides by 0: write a number, {range_of('MOTOR_RS_OHM')}") for text in ("1/0", "(2/0)", "1/0.0", "1.0/0.0f")},
    **{f"octal {text}": (value("MAXIMUM_SPEED_RPM", text), "MAXIMUM_SPEED_RPM",
                         f"MAXIMUM_SPEED_RPM = {text} is octal to C, for it begins with 0: write it without, {range_of('MAXIMUM_SPEED_RPM')}")
       for text in ("05500", "(05500)", "05500 + 1", "09")},
    "gains of two signs": (value("KCURRB", "0.5"), "KCURRB", "KCURRB = 0.5 must have the sign of KCURRA = -0.5: the amplifiers are alike"),
    **{f"1/Kphi of entry {i}": (value(f"INVKFI_SPEED{i}", "19750"), f"INVKFI_SPEED{i}",
                                f"INVKFI_SPEED{i} = 19750 must be 0.6 .. 1.6 of NORM_INVKFIBASE: write that") for i in (0, 1, 9, 17)},
    # these break relations, too, and the formulas of other files
    **{f"{name} out of range": (value(name, text), name, f"{name} = {text} is outside {range_of(name)}: correct it") for name, text in (
        ("MOTOR_RS_OHM", "99"), ("MAXIMUM_SPEED_RPM", "50000"), ("MOTOR_KPHI_V_PER_KRPM", "0.1"), ("NOPOLESPAIRS", "0"),
        ("NORM_CURRENT_CONST", "1e-7"))},
    "an L that overflows": (value("MOTOR_LS_MH", "25"), "MOTOR_LS_MH",
                              "MOTOR_LS_MH = 25 does not fit its Q format: use a smaller current range"),
    "a Kphi that overflows": (value("MOTOR_KPHI_V_PER_KRPM", "0.5"), "MOTOR_KPHI_V_PER_KRPM",
                              "MOTOR_KPHI_V_PER_KRPM = 0.5 does not fit 1/Kphi's Q format (1024 .. 32767): check its unit"),
    "a relation": (value("MINIMUM_SPEED_RPM", "2900"), "MINIMUM_SPEED_RPM",
                   "NOMINAL_SPEED_RPM = 2800 must be above MINIMUM_SPEED_RPM = 2900"),
}


def sampled(names, of_pc: int = 1) -> list:
    """Each name, or each of so many, with the PC's compiler and every sixth with the chip's: its build calls four compilations, and the words are those
    of one script."""
    pc, *others = COMPILERS
    names = list(names)
    every = [(name, pc) for name in names[::of_pc]] + [(name, other) for name in names[::6] for other in others]
    return [pytest.param(name, *compiler.values, id=f"{name}-{compiler.id}", marks=compiler.marks) for name, compiler in every]


@pytest.mark.parametrize("mistake, compiler", sampled(MISTAKES))
def test_a_mistake_is_one_line_of_the_build_with_its_place(tmp_path, mistake, compiler):
    text, name, told = MISTAKES[mistake]
    where = place(text, told.split()[0]) if name else "userparams.h"
    code, lines = checked(tmp_path, compiler, text)
    assert code == 2 and len(lines) == 1 and lines[0].startswith(f"foc33: {where}: {told}"), lines


# The build's words are those of this compilation.
@pytest.mark.parametrize("mistake, compiler", sampled(MISTAKES, 3))
def test_the_compiler_alone_says_the_same_first(tmp_path, mistake, compiler):
    assert f": userparams.h: {MISTAKES[mistake][2]}" in compiled(tmp_path, compiler, MISTAKES[mistake][0])


NO_NUMBERS = ("(2,67)", "two", '"2.67"', "'2'", "2.67 ohm", "2.67ohm", "= 2.67", "-two", "[2.67]", "2.67 1", "24V", "2.67\N{GREEK CAPITAL LETTER OMEGA}")


def test_whatever_is_no_number_is_a_line_each(tmp_path):
    wrong, text = dict(zip(DECIMALS, NO_NUMBERS, strict=False)), HEADER
    for name, number in wrong.items():
        text = text.replace(line_of(name), f"#define {name} {number}\n")
    code, lines = checked(tmp_path, PC, text)
    assert code == 2 and len(lines) == len(wrong) == len(NO_NUMBERS), lines
    for name, number in wrong.items():
        assert sum(line.startswith(f"foc33: {place(text, name)}: {name} = {number} is no number: write one, {range_of(name)}") for line in lines) == 1, (name, lines)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_several_mistakes_of_a_kind_are_a_line_each(tmp_path, compiler):
    text = value("MOTOR_RS_OHM", "99").replace(line_of("KFILTER_ESDQ"), "#define KFILTER_ESDQ 9\n")
    code, lines = checked(tmp_path, compiler, text)
    assert code == 2 and [line.split(" is outside ")[0] for line in lines] == [
        f"foc33: {place(text, 'MOTOR_RS_OHM')}: MOTOR_RS_OHM = 99", f"foc33: {place(text, 'KFILTER_ESDQ')}: KFILTER_ESDQ = 9"]


WRONG = {"MOTOR_RS_OHM": "5/2", "MOTOR_LS_MH": "two", "MOTOR_KPHI_V_PER_KRPM": None, "NOMINAL_SPEED_RPM": "02800", "KCURRB": "0.5", "LOCK_TIME": "(x)",
         "REGEN_LIMIT_V": "20", "SPEED_BANDWIDTH_HZ": "(12.6", "KFILTER_ESDQ": "9", "INVKFI_SPEED2": None, "IDREF_SPEED9": "1 /0", "SNAPDELAY": "(010)",
         "RETRY_COUNT": "99", "RETRY_PAUSE_SEC": "1.0 * (5/2)", "SAMPLE_WINDOW_SEC": "NORM_RS", "IDREF_SPEED3": "(unknown / 2)"}


def test_mistakes_of_all_kinds_are_told_in_one_build(tmp_path):
    text = HEADER.replace("#define KCURRA", "#define KCRURA")
    for name, wrong in WRONG.items():
        text = text.replace(line_of(name), "" if wrong is None else f"#define {name} {wrong}\n")
    code, lines = checked(tmp_path, PC, text)
    told = {line.split(": ", 2)[2].split()[0]: line for line in lines}
    # KCURRB needs the sign of a KCURRA that is missing
    assert code == 2 and sorted(told) == sorted({"KCRURA", *WRONG} - {"KCURRB"}) and len(lines) == len(told), lines
    for name, line in told.items():
        assert line.startswith(f"foc33: {place(text, name) if WRONG.get(name, 1) else 'userparams.h'}: {name} "), line


def lines_of(tmp_path: Path, **wrong: str) -> dict[str, str]:
    """Of a header with these values: what the build says, by each line's first word."""
    text = HEADER
    for name, number in wrong.items():
        text = text.replace(line_of(name), f"#define {name} {number}\n") if name in parameters() else text.replace(RS, f"{RS}#define {name} {number}\n")
    code, lines = checked(tmp_path, PC, text)
    assert code == 2 and all(line.startswith(f"foc33: {place(text, line.split(': ')[2].split()[0])}: ") for line in lines), lines
    return {line.split(": ", 2)[2].split()[0]: line.split(": ", 2)[2] for line in lines}


def test_values_that_do_not_fit_each_other_are_all_told_in_one_build(tmp_path):
    told = lines_of(tmp_path, SPEED_BANDWIDTH_HZ="50", MOTOR_INERTIA_KGM2="0.00000001", OVER_VOLTAGE_V="47", END_SPEED_RPM="4000", KCURRB="0.5", I2T_CURRENT_A="5",
                    SAMPLE_WINDOW_SEC="0.0000012", D_CURRCNTR_PTERM="2")
    assert set(told) == {"SPEED_BANDWIDTH_HZ", "MOTOR_INERTIA_KGM2", "OVER_VOLTAGE_V", "END_SPEED_RPM", "KCURRB", "I2T_CURRENT_A", "SAMPLE_WINDOW_SEC", "D_CURRCNTR_PTERM"}


def test_several_values_that_exceed_one_are_one_line_and_so_is_the_one_that_several_exceed(tmp_path):
    assert lines_of(tmp_path, Q_CURRENT_REF_OPENLOOP="3", I2T_CURRENT_A="3.5", IDREF_SPEED5="-3.2") == {
        "Q_CURRENT_REF_OPENLOOP": "Q_CURRENT_REF_OPENLOOP = 3, I2T_CURRENT_A = 3.5 and IDREF_SPEED5 = -3.2 must not exceed MAXIMUM_CURRENT_A = 2.75"}
    told = lines_of(tmp_path, MAXIMUM_CURRENT_A="0.5")
    assert len(told) == 1 and told["Q_CURRENT_REF_OPENLOOP"].endswith(" and 13 more must not exceed MAXIMUM_CURRENT_A = 0.5")


@pytest.mark.parametrize("wrong, told", [
    ({"UNDER_VOLTAGE_V": "30", "OVER_VOLTAGE_V": "20"}, {"OVER_VOLTAGE_V", "UNDER_VOLTAGE_V"}), # no NOMINAL_BUS_V would fit both
    ({"MINIMUM_SPEED_RPM": "2900", "MAXIMUM_SPEED_RPM": "2000"}, {"NOMINAL_SPEED_RPM", "MAXIMUM_SPEED_RPM"}),
    ({"OVER_VOLTAGE_V": "20"}, {"OVER_VOLTAGE_V"}), ({"NOMINAL_BUS_V": "12"}, {"UNDER_VOLTAGE_V"})])
def test_a_value_that_another_may_be_wrong_for_is_no_mistake_of_its_own(tmp_path, wrong, told):
    assert set(lines_of(tmp_path, **wrong)) == told


@pytest.mark.parametrize("text, told", [
    ("0,1", "= 0,1 is no number: remove the line"), ("", "has no value: remove the line, or write a number"), ("0x", "is no number ("), ("1/10", "= 1/10 divides whole numbers, of which C drops the fraction: write 1.0/10.0"),
    ("-0.1", "= -0.1 must be positive"), ("2", "must be below 1, its Q format: lower it where a line defines it, else CURRENT_BANDWIDTH_HZ = 1000")])
def test_a_wrong_gain_of_the_d_axis_is_one_line_that_accuses_no_other(tmp_path, text, told):
    lines = lines_of(tmp_path, D_CURRCNTR_PTERM=text)
    assert list(lines) == ["D_CURRCNTR_PTERM"] and lines["D_CURRCNTR_PTERM"].startswith(f"D_CURRCNTR_PTERM {told}")


def test_an_entry_of_1_kphi_is_told_beside_other_mistakes_unless_it_may_be_their_fault(tmp_path):
    wrong = value("INVKFI_SPEED3", "19750")
    code, lines = checked(tmp_path, PC, wrong.replace(line_of("LOCK_TIME"), "").replace(line_of("KFILTER_ESDQ"), "#define KFILTER_ESDQ 9\n"))
    assert code == 2 and sorted(line.split(": ", 2)[2].split()[0] for line in lines) == ["INVKFI_SPEED3", "KFILTER_ESDQ", "LOCK_TIME"], lines
    code, lines = checked(tmp_path, PC, wrong.replace(line_of("MOTOR_KPHI_V_PER_KRPM"), ""))
    assert code == 2 and len(lines) == 1 and "MOTOR_KPHI_V_PER_KRPM is missing" in lines[0], lines


WORDS = {
    "(two)": "uses two, which nothing defines: write a number, 0.01 .. 40 ohm",
    "(NORM_RS)": "uses NORM_RS, which follows from the parameters: write a number, 0.01 .. 40 ohm",
    "2 * RS_COLD": "uses RS_COLD, which nothing defines: write a number, 0.01 .. 40 ohm",
    "0.001 * MOTOR_LS": "uses MOTOR_LS, which nothing defines: did you mean MOTOR_LS_MH?",
    "MY_RS\n#define MY_RS (0.5 * NOTHING)": "uses NOTHING, which nothing defines: write a number, 0.01 .. 40 ohm",
    "MY_RS\n#define MY_RS (1.0 * MOTOR_RS_OHM)": "comes back to MOTOR_RS_OHM itself: write a number, 0.01 .. 40 ohm",
}


@pytest.mark.parametrize("text", WORDS)
def test_a_word_that_leads_nowhere_is_told_by_its_name_and_not_in_the_words_of_the_compiler(tmp_path, text):
    changed = value("MOTOR_RS_OHM", text)
    assert checked(tmp_path, PC, changed) == (2, [f"foc33: {place(changed, 'MOTOR_RS_OHM')}: MOTOR_RS_OHM = {text.splitlines()[0]} {WORDS[text]}"])


def test_what_is_computed_from_a_missing_parameter_is_no_mistake_of_its_own(tmp_path):
    code, lines = checked(tmp_path, PC, value("LOCK_TIME", "ALIGN\n#define ALIGN (2 * END_SPEED_RPM)").replace(line_of("END_SPEED_RPM"), ""))
    assert code == 2 and len(lines) == 1 and "END_SPEED_RPM is missing" in lines[0], lines


def test_every_name_that_a_header_does_not_have_is_told_in_one_build(tmp_path):
    code, lines = checked(tmp_path, PC, "#define NOPOLESPAIRS 5\n#define MY_NOTE 17616\n")
    assert code == 2 and [line.split()[2] for line in lines] == [name for name in parameters() if name != "NOPOLESPAIRS"]
    assert all(line.startswith("foc33: userparams.h: ") and " is missing: add #define " in line for line in lines)


def test_a_parameter_that_a_comment_or_an_if_has_swallowed_is_told_with_its_line(tmp_path):
    for text in (HEADER.replace(line_of("NOPOLESPAIRS"), "#define NOPOLESPAIRS 5 /* pole pairs\n"),
                 HEADER.replace(line_of("MOTOR_RS_OHM"), "#ifdef MOTOR_B\n" + line_of("MOTOR_RS_OHM") + "#endif\n")):
        assert checked(tmp_path, PC, text) == (2, [f"foc33: {place(text, 'MOTOR_RS_OHM')}: MOTOR_RS_OHM stands where the compiler does not read: close the comment "
                                                   "above it with */, or mend the #if around it"])


def test_poles_in_place_of_pole_pairs_are_told_by_that_name(tmp_path):
    text = value("NOPOLESPAIRS", "10")
    code, lines = checked(tmp_path, PC, text)
    assert code == 2 and len(lines) == 1 and lines[0].startswith(
        f"foc33: {place(text, 'NOPOLESPAIRS')}: the back-EMF's format overflows: check NOPOLESPAIRS = 10, half the number of poles, or lower "), lines


@pytest.mark.parametrize("text, remedy", [("5/2", "5.0/2.0"), ("1.0 * (5/2)", "1.0 * (5.0/2.0)"), ("2.5f/(2/1.5) + 7 / 9", "2.5f/(2.0/1.5) + 7.0 / 9.0")])
def test_a_quotient_is_told_with_what_to_write(tmp_path, text, remedy):
    code, lines = checked(tmp_path, PC, value("MOTOR_RS_OHM", text))
    assert code == 2 and len(lines) == 1 and lines[0].endswith(f"MOTOR_RS_OHM = {text} divides whole numbers, of which C drops the fraction: write {remedy}")


@pytest.mark.parametrize("name, text", [("MAXIMUM_SPEED_RPM", "05500"), ("MAXIMUM_SPEED_RPM", "(11 * 0500)"), ("MOTOR_RS_OHM", "5/2"), ("MOTOR_RS_OHM", "1.0 * (5/2)")])
def test_a_number_whose_meaning_is_plain_keeps_no_other_mistake_back(tmp_path, name, text):
    told = lines_of(tmp_path, **{name: text}, INVKFI_SPEED3="19750", KCURRB="0.5")
    assert set(told) == {name, "INVKFI_SPEED3", "KCURRB"}, told


def test_a_quotient_out_of_range_is_replaced_and_what_follows_from_it_is_no_mistake_of_its_own(tmp_path):
    told = lines_of(tmp_path, MOTOR_RS_OHM="1.0 * (198/2)", KCURRB="0.5")
    assert set(told) == {"MOTOR_RS_OHM", "KCURRB"} and "outside 0.01 .. 40 ohm" in told["MOTOR_RS_OHM"], told


def test_an_entry_computed_from_macros_is_told_in_one_short_line(tmp_path):
    told = lines_of(tmp_path, INVKFI_SPEED3="NORM_INVKFIBASE*2")
    assert told == {"INVKFI_SPEED3": "INVKFI_SPEED3 must be 0.6 .. 1.6 of NORM_INVKFIBASE: write that, or make tune-fw"}


def test_a_number_that_only_the_build_sees_is_octal_is_told(tmp_path):
    text = value("MAXIMUM_SPEED_RPM", "5000 + 0500")
    assert checked(tmp_path, PC, text) == (2, [
        f"foc33: {place(text, 'MAXIMUM_SPEED_RPM')}: MAXIMUM_SPEED_RPM = 5000 + 0500 has an octal number, 0500: write it without the 0 in front"])


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("text, told", [
    ("2.6.7", r"MOTOR_RS_OHM is no number \(too many decimal points in number\): write one, 0.01 \.\. 40 ohm"),
    ("(2.67", r"MOTOR_RS_OHM is no number \(.*\): write one, 0.01 \.\. 40 ohm"), ("2 +", r"MOTOR_RS_OHM is no number \(.*\): write one")])
def test_what_only_the_compiler_finds_is_told_with_the_parameter(tmp_path, compiler, text, told):
    code, lines = checked(tmp_path, compiler, value("MOTOR_RS_OHM", text))
    assert code == 2 and len(lines) == 1 and re.match(f"foc33: {place(HEADER, 'MOTOR_RS_OHM')}: {told}", lines[0]), lines


# ---- AN1292's own header and its examples ------------------------------------------------------------------------------------
EXAMPLE_2 = "#define NORM_CURRENT(current_real) (Q15(current_real/NORM_CURRENT_CONST/32768))\n"
FORMS = {"KCURRA": "Q15(-0.5)", "KCURRB": "Q15(-0.5)", "IDREF_SPEED1": "NORM_CURRENT(-0.09)", "Q_CURRENT_REF_OPENLOOP": "NORM_CURRENT(1.41)", "LS_OVER2LS0_SPEED1": "Q15(0.25)",
         "INVKFI_SPEED0": "7900"}
"""As AN1292 prints them, Examples 1, 2, 4, 5 and 6; parameters are fractions and ampere, not counts."""


def of_an1292(semicolon: str = "") -> str:
    text = HEADER.replace(RS, EXAMPLE_2 + RS).replace("/* #define OPEN_LOOP_FUNCTIONING */", "#define OPEN_LOOP_FUNCTIONING")
    for name, form in FORMS.items():
        text = text.replace(line_of(name), f"#define {name} {form}{semicolon if form.startswith('Q15(0') else ''}\n")
    return text


def test_the_forms_of_an1292_s_examples_are_the_numbers_in_their_brackets():
    plain = {name: re.sub(r".*\((.*)\)", r"\1", form) for name, form in FORMS.items()}
    others = {name: re.split(r"[ \t]+", line_of(name).strip())[2] for name in parameters() if name not in FORMS}
    macros = ("PARAM_Q15(KCURRA)", "CURRENT_Q13(IDREF_SPEED1)", "CURRENT_Q13(Q_CURRENT_REF_OPENLOOP)", "PARAM_LS_ENTRY(1)", "PARAM_INVKFI_ENTRY(0)")
    assert constants.evaluate(others | FORMS, *macros) == constants.evaluate(others | plain, *macros)
    assert constants.evaluate(others | FORMS, *macros)[0::3] == [-16384.0, 8192.0]


@pytest.mark.parametrize("compiler", COMPILERS)
def test_an1292_s_printed_examples_are_understood(tmp_path, compiler):
    assert checked(tmp_path, compiler, of_an1292()) == (0, []) and compiled(tmp_path, [*compiler, "-Werror"], of_an1292()) == ""


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name, form, number", [("LS_OVER2LS0_SPEED1", "Q15(0.25);", "0.25"), ("IDREF_SPEED3", "NORM_CURRENT( -0.27 ) ;", "-0.27"), ("MOTOR_RS_OHM", "2.67;", "2.67"),
                                                ("INVKFI_SPEED5", "Q15(0.24);", "Q15(0.24)")])
def test_a_semicolon_behind_a_number_is_one_line_with_the_number_to_write(tmp_path, compiler, name, form, number):
    text = value(name, form)
    assert checked(tmp_path, compiler, text) == (2, [f"foc33: {place(text, name)}: {name} = {form} ends in a semicolon: write {number}"])
    assert re.search(rf"userparams\.h: {name} = .*; ends in a semicolon: write the number without it", compiled(tmp_path, compiler, text))


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_header_of_an1292_is_answered_with_the_command_that_converts_it(tmp_path, compiler):
    code, lines = checked(tmp_path, compiler, "#define NOPOLESPAIRS 2\n#define NORM_RS 14361\n#define NORM_LSDTBASE 1397\n")
    assert code == 2 and lines == ["foc33: userparams.h:2: NORM_RS = 14361 is a constant of AN1292's header, here it follows from MOTOR_RS_OHM: remove it; "
                                   "of a whole header of AN1292's `make import HEADER=file` makes a motor file and a userparams.h"]
    assert "make import HEADER=file" in compiled(tmp_path, compiler, HEADER.replace(RS, RS + "#define NORM_DELTAT 1790\n"))


@pytest.mark.parametrize("name, follows", [("SPEEDREFRAMP", "SPEEDREFRAMP_RPM_PER_S"), ("D_ILIMIT_HS", "MAXIMUM_SPEED_RPM"), ("NORM_INVKFIBASE", "MOTOR_KPHI_V_PER_KRPM")])
def test_a_constant_of_an1292_beside_the_parameters_names_the_one_that_it_follows_from(tmp_path, name, follows):
    text = HEADER.replace(RS, RS + f"#define {name} 100\n")
    code, lines = checked(tmp_path, PC, text)
    assert code == 2 and len(lines) == 1 and lines[0].startswith(f"foc33: {place(text, name)}: {name} = 100 is a constant of AN1292's header, here it follows from {follows}: remove it")


def test_each_constant_of_an1292_beside_the_parameters_is_told_and_so_are_other_mistakes(tmp_path):
    told = lines_of(tmp_path, NORM_LSDTBASE="1397", SPEEDREFRAMP="Q15(0.00003)", D_ILIMIT_HS="1447", KCURRB="0.5")
    assert set(told) == {"NORM_LSDTBASE", "SPEEDREFRAMP", "D_ILIMIT_HS", "KCURRB"} and "follows from MOTOR_LS_MH" in told["NORM_LSDTBASE"]


# ---- names ---------------------------------------------------------------------------------------------------------------
NAMES = {
    "misspelt": (HEADER.replace("MOTOR_RS_OHM 2.67", "MOTOR_RS_OHMS 2.67"),
                 "MOTOR_RS_OHMS is no parameter: did you mean MOTOR_RS_OHM, 0.01 .. 40 ohm?"),
    "letters exchanged": (HEADER.replace("#define KCURRA", "#define KCRURA"),
                          "KCRURA is no parameter: did you mean KCURRA, -0.6 .. 0.6 1?"),
    "small letters": (HEADER.replace("MOTOR_RS_OHM 2.67", "motor_rs_ohm 2.67"),
                      "motor_rs_ohm is no parameter: did you mean MOTOR_RS_OHM, "),
    "no blank": (HEADER.replace("MOTOR_RS_OHM 2.67", "MOTOR_RS_OHM2.67"), "MOTOR_RS_OHM2 is no parameter: did you mean MOTOR_RS_OHM, "),
    "a mode": (HEADER.replace(MODE, "#define TUNNING"), "TUNNING is no parameter: did you mean TUNING?"),
    "a gain": (HEADER.replace(RS, RS + "#define D_CURCNTR_PTERM 0.2\n"), "D_CURCNTR_PTERM is no parameter: did you mean D_CURRCNTR_PTERM?"),
    "twice": (HEADER.replace(RS, RS + "#define MOTOR_RS_OHM 2.7\n"),
              f"MOTOR_RS_OHM = 2.7 is the second definition, the first stands in {place(HEADER, 'MOTOR_RS_OHM')}: keep one of the two"),
}


@pytest.mark.parametrize("mistake, compiler", sampled(NAMES))
def test_a_name_that_cannot_be_meant_is_one_line_with_its_place(tmp_path, mistake, compiler):
    text, told = NAMES[mistake]
    code, lines = checked(tmp_path, compiler, text)
    changed = {"a mode": MODE, "letters exchanged": line_of("KCURRA")}.get(mistake, RS)
    number = HEADER.count("\n", 0, HEADER.index(changed)) + 1 + (mistake in ("a gain", "twice"))
    assert code == 2 and len(lines) == 1 and lines[0].startswith(f"foc33: userparams.h:{number}: {told}"), lines


def test_without_python3_a_misspelt_name_is_not_found_and_the_build_says_so(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    for folder in ("/bin", "/usr/bin"): # all but python3
        for tool in Path(folder).iterdir():
            if not tool.name.startswith("python") and not (tmp_path / "bin" / tool.name).exists():
                (tmp_path / "bin" / tool.name).symlink_to(tool)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    assert checked(tmp_path, PC, HEADER.replace(MODE, "#define TUNNING")) == (0, ["foc33: no python3: a misspelt name in userparams.h is not looked for"])


def test_a_mode_that_the_header_and_the_command_line_switch_on_is_one_line(tmp_path):
    text = HEADER.replace(MODE, "#define TUNING")
    code, lines = checked(tmp_path, [*PC, "-DTUNING"], text)
    assert code == 2 and lines == [
        f"foc33: {place(text, 'TUNING')}: TUNING is the second definition, the first stands in DEFINES or the scenario: "
        "keep one of the two"]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("line, told", [("#defin A 1", "userparams.h:.*#defin.*: correct it"),
                                        ("MOTOR 2.67", "userparams.h:.*: correct it"),
                                        ("#error not for this motor", "userparams.h:.*not for this motor: correct it"),
                                        ("/* open", "userparams.h:.*unterminated.*: correct it")])
def test_what_is_no_header_is_the_compiler_s_first_line(tmp_path, compiler, line, told):
    code, lines = checked(tmp_path, compiler, HEADER + line + "\n")
    assert code == 2 and len(lines) == 1 and re.match(f"foc33: {told}", lines[0]), lines


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_a_header_in_utf_16_is_called_so(tmp_path, encoding):
    (tmp_path / "userparams.h").write_bytes(HEADER.encode(encoding))
    done = make("lib", "VARIANT=refused", f"USERPARAMS={tmp_path}")
    assert [line for line in done.stderr.splitlines() if not line.startswith("make")] == [f"foc33: {tmp_path}/userparams.h is UTF-16: save it as UTF-8"]
    assert done.returncode == 2 and done.stdout == ""


# ---- what C allows -------------------------------------------------------------------------------------------------------
FORMS_OF_ONE = ("{0}f", "{0}F", "({0})", "{0}e0", "({0} / 1)", "(float){0}", "(float)({0} / 1)", "{0} /* a comment, with a comma */", "{0} // and one",
                "{0} \\\n", "+{0}", "(1 ? {0} : 3)", "({0} > 0) * {0}", "((1.0) * ({0}))", "2*{0}/2", "0{0}", "(0 + {0})")


def many_forms(turn: int) -> str:
    """Every decimal number of the header in another form, so that in all turns each form has been at several."""
    text = HEADER
    for at, (name, number) in enumerate(DECIMALS.items()):
        text = text.replace(line_of(name), f"#define {name} {FORMS_OF_ONE[(at + turn) % len(FORMS_OF_ONE)].format(number)}\n")
    return text


LEGAL = {
    "as it is": HEADER, **{f"many forms, {turn}": many_forms(turn) for turn in (0, 9)},
    **{f"MOTOR_RS_OHM {text}": value("MOTOR_RS_OHM", text) for text in (".5", "3.", "3", "0x3", "3u", "5.34/2.", "1.0*5/2", "6/2", "5/2.")},
    "a whole quotient of counts": value("SNAPDELAY", "10/2"),
    "gains of two signs, on purpose": value("KCURRB", "0.5") + "#define KCURR_SIGNS_DIFFER\n",
    "a share of 1/Kphi": value("INVKFI_SPEED3", "(NORM_INVKFIBASE * 1.1)"),
    "a negative expression": value("KCURRA", "-(0.25 + 0.25)"),
    "an enum's constant and the compiler's": "enum { TURNS = 4 };\n#include <limits.h>\n" + value("LOCK_TIME", "(TURNS * 4000)").replace(
        line_of("END_SPEED_RPM"), "#define END_SPEED_RPM (CHAR_BIT * 125)\n"),
    "names of one's own": HEADER.replace(
        RS, "#define RS_COLD 2.5\n#define WARM(ohm, factor) ((ohm) * (factor))\n#define MOTOR_RS_OHM WARM(RS_COLD, 1.068)\n"),
    "one of one's own that resembles a parameter": HEADER.replace(
        RS, RS + "#define Q_CURRCNTR_PTERMS 0.2\n#define D_CURRCNTR_PTERM Q_CURRCNTR_PTERMS\n"),
    "one that nothing uses": HEADER.replace(RS, RS + "#define MY_NOTE 1\n#define MOTOR_RS_OHM_HOT 3.1\n"),
    "blocks": HEADER.replace(RS, "#define WARM\n#ifdef WARM\n#  define  MOTOR_RS_OHM\t2.67\n#else\n#define MOTOR_RS_OHM 2.2\n#endif\n"),
    "a value taken back": HEADER.replace(RS, "#define MOTOR_RS_OHM 2.2\n#undef MOTOR_RS_OHM\n" + RS),
    "twice the same": HEADER.replace(RS, RS + RS),
    "modes on": HEADER.replace(MODE, "#define TUNING\n#define SNAPSHOT 1"),
    "gains": HEADER.replace(RS, RS + "#define D_CURRCNTR_PTERM 0.2\n#define SPEEDCNTR_PTERM (0.1 / 2)\n"),
    "1/Kphi changed": value("INVKFI_SPEED3", "(NORM_INVKFIBASE + 100)").replace(
        line_of("INVKFI_SPEED4"), "#define INVKFI_SPEED4 NORM_INVKFIBASE - 100\n"),
    "no guard": re.sub(r"#(ifndef|define) USERPARAMS_H\n", "", HEADER).removesuffix("\n#endif\n"),
    "another file": '#include "more.h"\n' + HEADER.replace(RS, ""),
    "a header of the compiler": "#include <stdint.h>\n" + HEADER,
    "DOS line ends": HEADER.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("style, compiler", sampled(LEGAL))
def test_what_c_allows_is_not_refused(tmp_path, style, compiler):
    (tmp_path / "more.h").write_text(RS, encoding="utf-8")
    assert checked(tmp_path, compiler, LEGAL[style]) == (0, [])


@pytest.mark.parametrize("style, compiler", sampled(LEGAL, 3))
def test_what_c_allows_is_not_refused_by_the_compiler_alone(tmp_path, style, compiler):
    (tmp_path / "more.h").write_text(RS, encoding="utf-8")
    assert compiled(tmp_path, compiler, LEGAL[style]) == ""


def test_a_build_without_optimisation_refuses_nothing_more(tmp_path):
    assert compiled(tmp_path, [*PC, "-O0"], HEADER) == ""


@xc16.needs_compiler
def test_the_checks_cost_the_image_nothing():
    xc16.made("target-elf")
    folder = paths.ROOT / "build/target"
    xc16.made(f"build/target/{CHECKS[1].replace('.c', '.o')}")
    names = subprocess.run([xc16.program("nm"), folder / CHECKS[1].replace(".c", ".o")], capture_output=True, text=True,
                           check=True)
    assert "_range_of_MOTOR_RS_OHM" in names.stdout
    assert not [name for name in image.read_elf(folder / "foc33.elf").symbols if re.match(r"_(text_of|range_of|relations)", name)]


# ---- the build -----------------------------------------------------------------------------------------------------------
def make(*words: str) -> subprocess.CompletedProcess:
    own = ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "DEFINES", "USERPARAMS", "VARIANT")
    environment = {name: text for name, text in os.environ.items() if name not in own}
    return subprocess.run(["make", *words], cwd=paths.ROOT, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("words", [["lib"], pytest.param(["target-elf"], marks=xc16.MARKS)])
def test_nothing_is_compiled_with_a_header_that_is_refused_and_a_mended_one_is_looked_at_again(tmp_path, words):
    words = [*words, "VARIANT=refused", f"USERPARAMS={tmp_path}"]
    for kind in ("host", "target"):
        shutil.rmtree(paths.ROOT / f"build/{kind}-refused", ignore_errors=True)
    (tmp_path / "more.h").write_text("#define MOTOR_RS_OHM 99\n", encoding="utf-8")
    (tmp_path / "userparams.h").write_text(LEGAL["another file"], encoding="utf-8")
    for _ in range(2): # and again, for it is not forgotten
        done = make(*words)
        assert done.returncode == 2 and done.stdout == "", done.stdout
        assert [line for line in done.stderr.splitlines() if not line.startswith("make")] == [
            f"foc33: {tmp_path}/more.h:1: MOTOR_RS_OHM = 99 is outside {range_of('MOTOR_RS_OHM')}: correct it"]
    (tmp_path / "more.h").write_text(RS, encoding="utf-8")
    assert make(*words).returncode == 0
    (tmp_path / "more.h").write_text("#define MOTOR_RS_OHM two\n", encoding="utf-8")
    assert "MOTOR_RS_OHM = two is no number" in make(*words).stderr


@pytest.mark.parametrize("words", [["lib"], pytest.param(["target-elf"], marks=xc16.MARKS)])
def test_what_is_missing_is_told_with_the_user_s_own_path(tmp_path, words):
    folder = tmp_path / "my motor"
    folder.mkdir()
    (folder / "userparams.h").write_text(HEADER.replace(RS, "").replace(line_of("KCURRA"), "#define KCURRA 5\n"), encoding="utf-8")
    done = make(*words, "VARIANT=refused", f"USERPARAMS={folder}")
    lines = [line for line in done.stderr.splitlines() if line.startswith("foc33: ")]
    assert done.returncode == 2 and len(lines) == 2 and lines[0].startswith(f"foc33: {folder}/userparams.h: MOTOR_RS_OHM is missing: "), lines
    assert lines[1].startswith(f"foc33: {folder}/userparams.h:") and "KCURRA = 5 is outside -0.6 .. 0.6 (gain" in lines[1], lines


def test_who_runs_a_header_hears_of_every_mistake(tmp_path):
    (tmp_path / "userparams.h").write_text(HEADER.replace(RS, "").replace(line_of("KCURRA"), "#define KCURRA 5\n"), encoding="utf-8")
    with pytest.raises(UserError) as told:
        build.library([], tmp_path)
    assert ["MOTOR_RS_OHM is missing" in line for line in told.value.lines] == [True, False] and "KCURRA = 5 is outside" in told.value.lines[1]


def test_the_optional_numbers_are_those_that_have_a_default():
    scaling = "".join((paths.ROOT / f"include/drive/scaling/{name}.h").read_text(encoding="utf-8") for name in ("estimator", "controllers"))
    listed = [name for name, in rows("include", "drive/param_limits.h", "PARAM_OPTIONAL", "#name")]
    assert listed == re.findall(r"^#ifndef (\w+?)(?<!_H)\b", scaling, re.MULTILINE) and not set(listed) & (set(parameters()) | set(modes()))
