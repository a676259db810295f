"""make firmware as a user calls it: without the compiler one clear line; with it no warning, and a build that fails for a bad image."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from xc16 import ROOT, build_image, make, needs_compiler, program, warnings

from tools.image import device, image

TREE = ("Makefile", "userparams.h", "firmware", "include", "tools")
NEEDED = ("make", "python3", "sh", "env", "grep", "sed", "test", "cat", "rm", "mv", "mkdir", "cmp", "printf", "getconf", "echo", "dirname",
          "head", "tail", "id", "gcc", "ar", "wc", "sort", "cut", "expr", "awk", "find", "flock", "mktemp", "cp")


def our_lines(done: subprocess.CompletedProcess) -> list[str]:
    return [line for line in done.stderr.splitlines() if line.startswith("foc33: ")]


def compiler_free_path(folder: Path, *more: str) -> str:
    """A PATH that has everything but the compiler."""
    for name in (*NEEDED, *more):
        if found := shutil.which(name):
            (folder / name).symlink_to(found)
    return str(folder)


def test_the_compiler_s_folder_its_bin_and_its_program_are_the_same_compiler(tmp_path):
    program = tmp_path / "own tools" / "bin" / "xc16-gcc"
    program.parent.mkdir(parents=True)
    program.write_text("#!/bin/sh\n", encoding="utf-8")
    program.chmod(0o755)
    for place in (program.parent.parent, program.parent, program):
        done = make("find-xc16", f"XC16={place}")
        assert done.returncode == 0, (place, done.stderr)


# ---- without the compiler ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("words, expected", [
    ([], "no xc16-gcc, not on PATH: install Microchip's MPLAB XC16 .*XC16="),
    (["XC16=/nowhere/v2.10"], "XC16=/nowhere/v2.10 has no bin/xc16-gcc")])
def test_a_missing_compiler_is_one_line_that_says_what_to_install(tmp_path, words, expected):
    done = make("firmware", "VARIANT=none", *words, path=compiler_free_path(tmp_path))
    assert (done.returncode, len(our_lines(done))) == (2, 1), done.stderr
    assert re.search(expected, our_lines(done)[0])
    assert not (ROOT / "build/target-none/foc33.hex").exists()


@pytest.mark.parametrize("name", ["xc16-gcc", "xc-dsc-gcc"])
@pytest.mark.parametrize("end", ["", "/bin", "/bin/"])
def test_the_folder_of_the_compiler_s_programs_is_taken_for_its_own(tmp_path, name, end):
    path = compiler_free_path(tmp_path, "df")
    folder = tmp_path / "the compiler/bin"
    folder.mkdir(parents=True)
    (folder / name).symlink_to(shutil.which("true"))
    assert make("find-xc16", f"XC16={folder.parent}{end}", path=path).returncode == 0
    done = make("find-xc16", f"XC16={tmp_path}/none{end}", path=path)
    assert done.returncode == 2 and "has no bin/xc16-gcc" in our_lines(done)[0]


@pytest.mark.parametrize("word, expected", [
    ("OPT=-O7", "no such level, OPT=-O7: use -O1, -O2 or -O3"), ("OPT=", "no such level, OPT=: use"), ("OPT=-O1 -O2", "no such level"),
    ("OPT=fast", "no such level"), ("DFP=/nowhere", "no device pack for XC16, DFP=/nowhere: name"),
    ("DEFINES=-DTUNNING", "no mode -DTUNNING, DEFINES=-DTUNNING: use .*-DTUNING"), ("DEFINES=TUNING", "no mode TUNING"),
    ("DEFINES=-DTUNING=0", "no mode -DTUNING=0"), ("USERPARAMS=/nowhere", "no userparams.h, USERPARAMS=/nowhere: name a folder")])
def test_bad_input_is_one_line_that_says_what_to_give(tmp_path, word, expected):
    path = compiler_free_path(tmp_path)
    (tmp_path / "xc16-gcc").symlink_to(shutil.which("true"))
    done = make("firmware", "VARIANT=none", word, path=path)
    assert (done.returncode, len(our_lines(done))) == (2, 1), done.stderr
    assert re.search(expected, our_lines(done)[0]) and "No such file" not in done.stderr
    assert not list((ROOT / "build").glob("target-O7*")), "no folder for a level that is refused"


def test_a_misspelt_mode_is_refused_on_the_pc_too():
    done = make("lib", "VARIANT=none", "DEFINES=-DTUNNING")
    assert (done.returncode, len(our_lines(done))) == (2, 1) and "no mode -DTUNNING" in our_lines(done)[0]


@pytest.mark.parametrize("names, called, defined", [(["xc-dsc-gcc"], "xc-dsc-gcc", True), (["xc16-gcc", "xc-dsc-gcc"], "xc16-gcc", False)])
@pytest.mark.parametrize("folder", [False, True])
def test_the_successor_xc_dsc_is_found_by_its_own_names_where_there_is_no_xc16(tmp_path, names, called, defined, folder):
    path = compiler_free_path(tmp_path)
    place = tmp_path / "a folder/bin" if folder else tmp_path
    place.mkdir(parents=True, exist_ok=True)
    for name in names:
        (place / name).write_text(f'#!/bin/sh\necho {name} "$@" >>"{tmp_path}/calls"\nexit 1\n', encoding="utf-8")
        (place / name).chmod(0o755)
    done = make("firmware", "VARIANT=none", *([f"XC16={place.parent}"] if folder else []), path=path)
    assert done.returncode == 2 and re.fullmatch(r"foc33: the compiler cannot read userparams.h, .*gcc: .*", our_lines(done)[0]), done.stderr
    calls = (tmp_path / "calls").read_text(encoding="utf-8").splitlines()
    assert {call.split()[0] for call in calls} == {called}
    assert all(("-U__XC16__ -D__XC16__" in call) == defined for call in calls)


# ---- with it -------------------------------------------------------------------------------------------------------------
AFTER_NEG = re.compile(r"\b(?:neg|subbr)\.w [^\n]*\n[^\n]*\bbra +(?:LT|GE|GT|LE),", re.IGNORECASE)
"""XC16 takes the flags of a negation for those of a comparison with 0, also of a number that wraps: -32768 is then at least 0."""


def compares_what_wraps(elf: Path) -> list[str]:
    """The places of an image where a branch hangs on a negation's flags."""
    listing = subprocess.run([program("objdump"), "-d", elf], capture_output=True, text=True, check=True).stdout
    return AFTER_NEG.findall(listing)


@needs_compiler
@pytest.mark.parametrize("word", ["OPT=-O1", "OPT=-O3"])
def test_no_warning_and_a_good_image_at_every_level(word):
    build_image(word, "VARIANT=check")
    assert not compares_what_wraps(ROOT / f"build/target{word.removeprefix('OPT=')}-check/foc33.elf")


@needs_compiler
def test_a_branch_on_the_flags_of_a_number_that_wraps_is_found(tmp_path):
    (tmp_path / "a.c").write_text("int f(unsigned a) { int d = (int)(0u - a); return d >= 0 ? d : 7; }\n", encoding="utf-8")
    subprocess.run([program("gcc"), f"-mcpu={device.NAME}", "-omf=elf", "-O2", "-c", "a.c", "-o", "a.o"], cwd=tmp_path, check=True)
    assert compares_what_wraps(tmp_path / "a.o")


@needs_compiler
def test_the_hex_starts_the_program_and_serves_the_control_interrupt():
    build_image()
    elf, words = (read(ROOT / "build/target" / name) for read, name in ((image.read_elf, "foc33.elf"), (image.read_hex, "foc33.hex")))
    assert words[0] == 0x040000 | elf.symbols["__reset"]
    assert not compares_what_wraps(ROOT / "build/target/foc33.elf")
    for base in (device.IVT, device.AIVT):
        assert words[base + 2 * device.VECTORS.index("_ADC1Interrupt")] == elf.symbols["__ADC1Interrupt"]
        assert words[base + 2 * device.VECTORS.index("_T3Interrupt")] == elf.symbols["__DefaultInterrupt"]
    # starts on FRC; XT, clock switching, pin selection may be unlocked; watchdog always on, no window, 32 kHz / 32 / 16;
    # PWM pins inputs at reset, active high, 128 ms; PGD3, no JTAG
    for address, mask, value in ((0xF80006, 0x07, 0), (0xF80008, 0xE7, 0x45), (0xF8000A, 0xDF, 0xC4), (0xF8000C, 0xE7, 0xE7),
                                 (0xF8000E, 0x23, 0x01)):
        assert words[address] & mask == value


@needs_compiler
def test_a_compiler_under_xc_dsc_s_names_makes_the_same_image(tmp_path):
    (tmp_path / "bin").mkdir()
    for name in ("gcc", "bin2hex", "objdump", "ar", "nm"):
        (tmp_path / f"bin/xc-dsc-{name}").write_text(f'#!/bin/sh\nexec {program(name)} "$@"\n', encoding="utf-8")
        (tmp_path / f"bin/xc-dsc-{name}").chmod(0o755)
    build_image()
    build_image("VARIANT=check-dsc", f"XC16={tmp_path}")
    assert (ROOT / "build/target-check-dsc/foc33.hex").read_bytes() == (ROOT / "build/target/foc33.hex").read_bytes()


@needs_compiler
def test_other_flags_rebuild_and_the_same_flags_do_not():
    """One file of the image: all follow the same record of the flags."""
    file, times = "build/target-check/firmware/control/svm.o", []
    for words in ([], [], ["DEFINES=-DPARAMS_IN_RAM"]):
        assert make(file, "VARIANT=check", *words).returncode == 0
        times.append((ROOT / file).stat().st_mtime_ns)
    assert times[0] == times[1] != times[2]
    rules = (ROOT / "tools/make/image.mk").read_text(encoding="utf-8")
    assert all(re.search(rf"^\$X/{name}: .*\$X/flags", rules, re.MULTILINE) for name in (r"image\.o", r"app\.o", "%\\.o"))


@needs_compiler
def test_parameters_in_ram_by_the_header_are_compiled_as_by_defines(tmp_path):
    header = (ROOT / "userparams.h").read_text(encoding="utf-8")
    (tmp_path / "userparams.h").write_text(header.replace("/* #define PARAMS_IN_RAM */", "#define PARAMS_IN_RAM"), encoding="utf-8")
    records = []
    for words in (["DEFINES=-DPARAMS_IN_RAM"], [f"USERPARAMS={tmp_path}"], []):
        assert make("build/target-check/flags", "VARIANT=check", *words).returncode == 0
        records.append(re.findall(r"--param=max-inline-insns-auto=[^-]*(?:-fno-tree-copy-prop)?", (ROOT / "build/target-check/flags").read_text(encoding="utf-8")))
    assert records[0] == records[1] != records[2] and len(records[0]) == 1


# ---- sources with a mistake, in a copy of the project ----------------------------------------------------------------------
class Tree:
    def __init__(self, root: Path) -> None:
        self.root = root
        for name in TREE:
            source, target = ROOT / name, root / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)
        if (ROOT / "build/iss").exists(): # the simulator's decoder: no mistake is planted there
            shutil.copytree(ROOT / "build/iss", root / "build/iss")

    def change(self, file: str, old: str, new: str) -> None:
        path = self.root / file
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    def spoil(self, file: str, old: str, new: str) -> str:
        """The build fails. @return all that it says"""
        self.change(file, old, new)
        done = make("firmware", root=self.root)
        assert done.returncode == 2, done.stdout + done.stderr
        for name in ("checked", "foc33.hex"): # nothing that looks like an image to flash
            assert not (self.root / "build/target" / name).exists(), name
        return done.stderr


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path)


HEAD = "void firmware_background(void)\n{\n"
NOINLINE = "static __attribute__((noinline)) void"
RECURSIVE = (f"{NOINLINE} again(volatile uint16_t n);\n{NOINLINE} again(volatile uint16_t n)\n{{\n    if (n) {{\n"
             "        again((uint16_t)(n - 1u));\n        n = 3;\n    }\n}")


def _frame(name: str, calls: str) -> str:
    """A function with nearly as large a frame as the compiler lets pass."""
    return f"{NOINLINE} {name}(void)\n{{\n    volatile uint16_t some[62];\n    some[0] = 1;\n    {calls}\n    some[1] = 1;\n}}\n"


DEEP = _frame("deepest", "") + _frame("deeper", "deepest();") + _frame("deep", "deeper();")
LINE = r"firmware_background\(\) \(firmware/board/firmware.c, line [0-9]+\)"
NOT_CALCULABLE = (
    ("again(board_drive.ticks);", RECURSIVE, "stack: recursion: again -> again"),
    ("pointer();", "extern void (*volatile pointer)(void);\nvoid (*volatile pointer)(void) = pwm_init;",
     r"stack: \w+: call through a pointer at 0x[0-9a-f]+, firmware_background\(\) of firmware/board/firmware.c"))
TOO_MUCH = (
    ("spoil_a = (int32_t)((float)spoil_b * 1.5F);", "static volatile int32_t spoil_a, spoil_b;", rf"called by {LINE}: a float: use a Q format"),
    ("spoil_a = spoil_a / spoil_b;", "", rf"called by {LINE}: a division: use qm_divud"),
    ("spoil_c = spoil_c / board_drive.ticks;", "static volatile int64_t spoil_c;", rf"divdi3.* called by {LINE}: a division: use qm_divud"),
    ("board_drive.ticks = (uint16_t)(100u / board_drive.ticks);", "", rf"{LINE} divides by a variable"),
    ("spoil_ram[board_drive.ticks & 255u] = 1;", "static volatile int16_t spoil_ram[256];", "RAM: [0-9]+ bytes of a budget of [0-9]+"),
    ("board_drive.ticks = spoil_flash[board_drive.ticks & 255u];",
     "extern const uint16_t spoil_flash[256];\nconst uint16_t spoil_flash[256] = { 1 };",
     "flash: [0-9]+ bytes of a budget of [0-9]+"),
    ("deep();", DEEP, "stack: up to [0-9]+ bytes of [0-9]+"))


@needs_compiler
@pytest.mark.parametrize("mistakes", [NOT_CALCULABLE, TOO_MUCH], ids=["not calculable", "too much"])
def test_code_that_fails_the_build_is_told_with_its_place(tree, mistakes):
    bodies, before, told = zip(*mistakes)
    said = tree.spoil("firmware/board/firmware.c", HEAD, "\n".join([*before, HEAD, *bodies, ""]))
    assert [line for line in told if not re.search(line, said)] == [], said


CONFIGURATION = (("FWDTEN = ON", "FWDTEN = OFF", "ON"), ("WDTPOST = PS16", "WDTPOST = PS32768", "PS16"), ("WDTPRE = PR32", "WDTPRE = PR128", "PR32"),
                 ("WINDIS = OFF", "WINDIS = ON", "OFF"), ("PWMPIN = ON", "PWMPIN = OFF", "ON (PWM pins are inputs at reset)"))


@needs_compiler
@pytest.mark.parametrize("file, old, new, told", [
    ("main.c", "int main(void)\n{", "int main(void)\n{\n    int unused = 1;", "unused variable"),
    ("main.c", "int main(void)\n{", "void nowhere(void);\nint main(void)\n{\n    nowhere();",
     "foc33: the image does not link: undefined reference to `_nowhere' (more in build/target/foc33.memory)")])
def test_a_mistake_in_the_boards_files_fails_the_build(tree, file, old, new, told):
    assert told in tree.spoil(f"firmware/board/{file}", old, new)


@needs_compiler
def test_each_configuration_bit_that_the_board_does_not_bear_and_a_trap_that_is_not_served_are_told(tree):
    tree.change("firmware/board/isr.c", "void BOARD_ISR _MathError(void) ", "void BOARD_ISR _T3Interrupt(void) ")
    for old, new, _ in CONFIGURATION[1:]:
        tree.change("firmware/board/main.c", old, new)
    told = tree.spoil("firmware/board/main.c", *CONFIGURATION[0][:2])
    assert "the image has no _MathError" in told
    assert [wrong for _, wrong, right in CONFIGURATION if f"{wrong} in main.c, but the board needs {right}" not in told] == []


@needs_compiler
@pytest.mark.parametrize("old, new, budget", [("", "", r"--budget firmware/budget\.toml *--wcet"),
                                              ("/* #define IDENTIFY */", "#define IDENTIFY", r"foc33\.map --objdump \S+ *--wcet"),
                                              ("#define SCOPE 0 ", "#define SCOPE 1 ", r"--budget firmware/budget\.toml --other-header --wcet")])
def test_a_mode_in_userparams_h_is_not_held_to_the_budget_of_the_delivered_drive(tmp_path, old, new, budget):
    text = (ROOT / "userparams.h").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "userparams.h").write_text(text.replace(old, new), encoding="utf-8")
    done = make("-n", "build/target-unbuilt/checked", "VARIANT=unbuilt", f"USERPARAMS={tmp_path}")
    assert re.search(budget, done.stdout), done.stdout[-2000:]


@needs_compiler
def test_another_header_is_held_to_the_chip_and_to_the_deadline_only(tree):
    tree.change("userparams.h", "#define SCOPE 0 ", "#define SCOPE 1 ")
    done = make("firmware", root=tree.root)
    assert (done.returncode, warnings(done.stderr)) == (0, [])
    assert "of 33024 bytes of the chip" in done.stdout and "cycles to its return" in done.stdout
