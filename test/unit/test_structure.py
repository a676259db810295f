"""What must hold between the rooms of the firmware: who may include whom, headers that stand alone, no stray files, fuses as in the facts."""

import graphlib
import importlib
import re

import pytest
from c_compiler import CFLAGS, ROOT, compiler

# A room's files may include these.
ROOMS = {
    "app": r"app/\w+\.h|drive/(faults|inputs|states)\.h|drive/scaling/current_voltage\.h|stdint\.h",
    "control": r"control/\w+\.h|stdint\.h",
    "drive": r"(control|drive|drive/modes|drive/scaling)/\w+\.h|userparams\.h|stdint\.h",
    "board": r"(app|control|drive|drive/modes|board|board/modes)/\w+\.h|version\.h|xc\.h|stdint\.h",
}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)


COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
FUNCTION = re.compile(r"^(?!typedef|struct|enum|union)(\w[^\n;{}#=]*?\b(\w+)\([^;{}]*\)(?: \w+\(.*?\))?)\s*\n\{\n.*?^\}", re.DOTALL | re.MULTILINE)


def sources(room: str = "") -> dict[str, str]:
    """Text of every C file of the firmware, or of one room, by path."""
    files = sorted(f for top in ("firmware", "include") for f in (ROOT / top / room).rglob("*.[ch]"))
    assert files, room
    return {str(f.relative_to(ROOT)): f.read_text(encoding="utf-8") for f in files}


def test_only_the_board_room_sees_the_device() -> None:
    seen = [path for path, text in sources().items() if "xc.h" in text]
    assert seen and all(path.split("/")[1] == "board" for path in seen), seen


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_includes_only_what_it_may(room: str) -> None:
    wrong = [(path, name) for path, text in sources(room).items() for name in INCLUDE.findall(text) if not re.fullmatch(ROOMS[room], name)]
    assert not wrong, wrong


def test_no_file_includes_itself_by_a_detour() -> None:
    graph = {path.removeprefix("include/"): INCLUDE.findall(text) for path, text in sources().items()}
    assert any(name in graph for names in graph.values() for name in names)
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        pytest.fail(f"a loop of files: {' <- '.join(error.args[1])}")


def functions(text: str) -> list[tuple[str, str, int]]:
    """Name, what stands before it, and length in lines of each function that a file defines."""
    code = COMMENT.sub(lambda comment: re.sub(r"[^\n]", " ", comment[0]), text)
    return [(found[2], found[1].split(found[2])[0], found[0].count("\n") + 1) for found in FUNCTION.finditer(code)]


def test_a_header_declares_and_a_c_file_defines() -> None:
    arithmetic = {"include/control/qmath.h", "include/control/transforms.h"}
    bodies = {path for path, text in sources().items() if path.endswith(".h") and functions(text)}
    assert bodies == arithmetic, bodies ^ arithmetic


def test_no_function_is_longer_than_45_lines() -> None:
    lengths = {(path, name): lines for path, text in sources().items() for name, _, lines in functions(text)}
    assert len(lengths) > 400
    assert not (long := {key: lines for key, lines in lengths.items() if lines > 45}), long


def test_a_source_includes_its_own_header_first() -> None:
    """What has none: what an application calls (app/, board/application.h), the interrupts, the loop with the fuses, BRINGUP's steps, and the texts of the parameters' check."""
    without = {f"firmware/{name}.c" for name in ("board/app_calls", "board/isr", "board/main", "drive/modes/bringup_steps", "drive/param_check", "drive/param_text")}
    own = {path: path.replace("firmware/", "").replace(".c", ".h") for path in sources() if path.startswith("firmware/")}
    assert {path for path, header in own.items() if f"include/{header}" not in sources() and "/app/" not in path} == without
    wrong = [path for path, header in own.items() if path not in without and "/app/" not in path and INCLUDE.findall(sources()[path])[0] != header]
    assert not wrong, wrong


PREFIXES = {
    "board/main": "main",
    "board/modes/mode_board": "mode",
    "board/peripherals": "adc clock pins pwm timer uart",
    "board/selftest_cpu": "board",
    "board/scope": "lnet scope",
    "board/status": "record status text",
    "control/current_control": "current pi vd voltage vq",
    "control/motor_model": "adaptation fieldweak salience",
    "control/soft_float": "root soft",
    "control/transforms": "forced qm trig",
    "drive/limits": "bus limits",
    "drive/model": "drive model salient",
    "drive/modes/bringup": "bringup mode",
    "drive/modes/identify": "identify mode",
    "drive/modes/modes": "mode snapshot",
    "drive/modes/profile": "mode profile",
    "drive/inputs": "button contact pot",
    "drive/request": "remote request retry",
    "drive/protection": "heat ntc overload protection",
    "drive/speed": "reference speed",
    "drive/startup": "calibration handover startup",
    "drive/states": "along drive idle states",
    "drive/tick": "dead deferred drive",
}
"""Of the functions of a file, where they are not its name's first word."""


def test_a_functions_name_leads_to_its_file() -> None:
    for path, text in sources().items():
        if path.endswith(".c"):
            known = ["app"] if path.startswith("firmware/app/") else PREFIXES.get(path.removeprefix("firmware/").removesuffix(".c"), path.rsplit("/", 1)[1].removesuffix(".c").split("_")[0]).split()
            names = [name for name, before, _ in functions(text) if "static" not in before and "QM_INLINE" not in before and name[0] != "_" and not name.isupper()]
            wrong = [name for name in names if not f"{name}_".startswith(tuple(f"{prefix}_" for prefix in known))]
            unused = [prefix for prefix in known if names and not any(f"{name}_".startswith(f"{prefix}_") for name in names)]
            assert not wrong and not unused, f"{path}: {wrong} {unused}"


def test_nothing_is_written_twice_for_the_proofs_or_the_compiler() -> None:
    found = [(path, word) for path, text in sources().items() for word in ("__FRAMAC__", "QM_KNOWN", "QM_CONSTANT") if word in text]
    assert not found, found


def test_the_firmware_grows_no_further_in_files_and_lines() -> None:
    files = [f for top in ("firmware", "include") for f in (ROOT / top).rglob("*") if f.is_file() and (ROOT / "firmware" / "app") not in f.parents]
    lines = sum(len(f.read_text(encoding="utf-8").splitlines()) for f in files)
    assert len(files) <= 99 and lines <= 15_893, f"{len(files)} files, {lines} lines: more than there were, so merge or shorten"


def test_one_header_alone_reads_userparams_h() -> None:
    readers = [path for path, text in sources().items() if "userparams.h" in INCLUDE.findall(text)]
    assert readers == ["include/drive/scaling/current_voltage.h"], readers


def test_control_and_drive_name_no_register_and_no_motor() -> None:
    registers = re.findall(r"\bX\((\w+), 0x", (ROOT / "tools/chip/chip_registers.h").read_text(encoding="utf-8"))
    assert len(registers) > 100
    pattern = re.compile(r"\b(" + "|".join([*registers, "Hurst", "MCLV"]) + r")(bits)?\b")
    for room in ("control", "drive"):
        for path, text in sources(room).items():
            code = re.sub(r"/\*.*?\*/|\"[^\"]*\"", "", text, flags=re.DOTALL)
            found = pattern.findall(code)
            assert not found, f"{path}: {found}"


def test_every_header_has_its_own_guard_and_compiles_alone() -> None:
    for path, text in sources().items():
        if path.endswith(".h"):
            guard = "_".join(path.removesuffix(".h").upper().split("/")[1:]) + "_H"
            assert f"#ifndef {guard}\n#define {guard}\n" in text, f"{path} wants {guard}"
            done = compiler([*CFLAGS, "-Wconversion", "-Wshadow", "-Werror", "-Itools/cpu_host", "-Iinclude", "-I.", "-fsyntax-only", "-xc", "-"],
                            f'#include "{path.removeprefix("include/")}"\n')
            assert done.returncode == 0, f"{path}: {done.stderr}"


def test_every_file_begins_with_a_sentence_about_itself() -> None:
    for path, text in sources().items():
        assert re.match(r"/\* [A-Z0-9].{20,}", text), f"{path}: {text[:40]!r}"


def test_a_function_that_a_comment_names_exists() -> None:
    comment = re.compile(r"/\*.*?\*/", re.DOTALL)
    code = "\n".join(comment.sub("", text) for text in sources().values())
    for path, text in sources().items():
        named = {name for part in comment.findall(text) for name in re.findall(r"\b([a-z]\w+)\(\)", part)}
        gone = sorted(name for name in named if not re.search(rf"\b{name}\(", code))
        assert not gone, f"{path}: {gone}"


def test_a_watch_variable_that_a_page_names_exists() -> None:
    structs = re.findall(r"typedef struct \{([^}]*)\} t(\w+Parm);", (ROOT / "include/board/watch.h").read_text(encoding="utf-8"))
    known = {f"{name}.{member}" for members, name in structs for member in re.findall(r"\w+", members)}
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "include/drive/faults.h"]
    for page in pages:
        gone = sorted(set(re.findall(r"\b\w+Parm\.\w+", page.read_text(encoding="utf-8"))) - known)
        assert not gone, f"{page.name}: {gone}"


def test_there_are_no_stray_files_in_the_firmware() -> None:
    stray = [str(f.relative_to(ROOT)) for top in ("firmware", "include") for f in (ROOT / top).rglob("*") if f.is_file() and f.suffix not in (".c", ".h")
             and f.name != "budget.toml"]
    assert not stray, stray


def test_the_watchdog_is_served_in_few_places() -> None:
    served = {path: text.count("ClrWdt()") for path, text in sources().items() if "ClrWdt()" in text}
    # bounded waits, the tests at a start and its end, an application that is late, the flash's programming; else only reset_serve_watchdog()
    assert served == {"firmware/board/application.c": 2, "firmware/board/firmware.c": 1, "firmware/board/kept.c": 1, "firmware/board/peripherals.c": 1, "firmware/board/reset.c": 1,
                      "firmware/board/selftest_run.c": 3}, served


def test_inline_assembly_is_in_one_file_only() -> None:
    found = [path for path, text in sources().items() if re.search(r"\b_*asm_*\b", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))]
    assert found == ["firmware/board/selftest_cpu.c"], found # no C can test a register of the processor


def test_what_outlives_a_reset_is_left_alone_by_the_start_up_code() -> None:
    text = sources("board")
    assert "#define BOARD_PERSISTENT __attribute__((persistent))" in text["include/board/reset.h"]
    kept = {path: re.findall(r"^.*?(\w+) BOARD_PERSISTENT;", code, re.MULTILINE) for path, code in text.items() if " BOARD_PERSISTENT;" in code}
    assert kept == {"firmware/board/reset.c": ["board_trap_intcon1", "kept_fault", "kept_inverse"], "firmware/board/status.c": ["board_recorder"],
                    "firmware/board/selftest_run.c": ["board_selftest_failed", "waited_counts"]}


def test_the_state_is_written_in_one_place() -> None:
    written = [(path, line) for path, text in sources().items() for line in re.findall(r".*(?<!\btold)(?:->|\.)state\s*=(?!=).*", text)]
    assert [path for path, _ in written] == ["firmware/drive/states.c"], written


@pytest.mark.parametrize("field, writer", [("catching.phase|c->phase", "firmware/drive/catch.c"), ("handover.phase|h->phase", "firmware/drive/startup.c"),
                                           ("probe_phase", "firmware/drive/protection.c"), ("held.phase|shaft->phase", "firmware/drive/held.c")])
def test_a_phase_is_written_in_one_place(field: str, writer: str) -> None:
    written = [path for path, text in sources().items() for _ in re.findall(rf"(?:->|\.|\b)(?:{field})\s*=(?!=)", text)]
    assert written == [writer], written


def test_a_modes_name_stands_in_the_modes_rooms_only() -> None:
    names = "IDENTIFY|BRINGUP|TUNING|TORQUE_MODE|TORQUE_PROFILE|SNAPSHOT|BIDIRECTIONAL_SPEED|OPEN_LOOP_FUNCTIONING|PARAMS_IN_RAM"
    condition = re.compile(rf"^\s*#\s*(?:if|ifdef|ifndef|elif)\b.*\b(?:{names})\b", re.MULTILINE)
    asked = [path for path, text in sources().items() if condition.search(text)]
    assert asked and all("/modes/" in path for path in asked), asked


FUSES = {
    "FNOSC": "FRC", "FCKSM": "CSECMD", "POSCMD": "XT", "IOL1WAY": "OFF", "FWDTEN": "ON",
    "WINDIS": "OFF", "WDTPRE": "PR32", "WDTPOST": "PS16", "FPWRT": "PWR128", "PWMPIN": "ON", "HPOL": "ON",
    "LPOL": "ON", "ICS": "PGD3", "JTAGEN": "OFF", "BWRP": "WRPROTECT_OFF", "BSS": "NO_FLASH", "GSS": "OFF", "GWRP": "OFF",
}


def test_configuration_words_are_those_of_the_board() -> None:
    text = (ROOT / "firmware/board/main.c").read_text(encoding="utf-8")
    text, choices = re.subn(r"^#if PARAMS_KEPT\n#pragma config WDTPOST = PS64\n#else\n(.*?)^#endif\n", r"\1", text, flags=re.MULTILINE | re.DOTALL)
    assert choices == 1, "what erases a page of flash has a longer watchdog, and that is all"
    words = re.findall(r"^#pragma config (\w+) = (\w+)$", text, re.MULTILINE)
    assert len(dict(words)) == len(words), "a word is set twice"
    wrong = {name: dict(words).get(name) for name, value in FUSES.items() if dict(words).get(name) != value}
    assert not wrong, wrong


def test_changes_that_no_test_can_notice_are_still_changes_of_this_code(monkeypatch) -> None:
    """make mutate stops at an entry that is none; nobody may know for long."""
    monkeypatch.syspath_prepend(str(ROOT / "test/mutate"))
    mutate = importlib.import_module("mutate")
    known = {mutant.key for found in mutate.all_mutants(ROOT, []).values() for mutant in found}
    assert sorted(set(mutate.read_equivalent(ROOT / "test/mutate/equivalent.txt")) - known) == []
