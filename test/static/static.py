"""Static checks of the firmware: compiler warnings in every mode; cppcheck, its MISRA addon and clang-tidy in enough modes for every line.

A finding passes only if docs/deviations.md lists it, with the check's name, the places and a reason; a line there that no finding needs
any more fails too, so the page stays true. Environment: CC, CLANG, CLANG_TIDY, CPPCHECK (the tools to use).
"""

import functools
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).parent
PAGE = "docs/deviations.md"
BUILD = Path("build/static")
MODE_TABLE = Path("include/drive/modes/mode_table.h")
PRODUCT = ("TORQUE_MODE", "PARAMS_IN_RAM", "PARAMS_KEPT", "APP_SERIAL", "APP_PULSE", "MOTOR_NTC_USED", "BRIDGE_NTC_USED", "DIRECTION_INPUT_USED",
           "FAULT_OUTPUT_USED", "RUNNING_OUTPUT_USED", "BRAKE_CHOPPER_V=26")
COMBINED = [PRODUCT, ("TORQUE_MODE", "BIDIRECTIONAL_SPEED"), ("TUNING", "SNAPSHOT"), ("OPEN_LOOP_FUNCTIONING", "BIDIRECTIONAL_SPEED"),
            ("TUNING", "SELFTEST_OFF"), ("TORQUE_PROFILE", "BIDIRECTIONAL_SPEED", "TORQUE_MODE"),
            ("TORQUE_MODE", "BIDIRECTIONAL_SPEED", "SCOPE"), ("OPEN_LOOP_FUNCTIONING", "BIDIRECTIONAL_SPEED", "SNAPSHOT")]
ON_TARGET = ("__XC16__", "PARAMS_IN_RAM", "PARAMS_KEPT")
GCC_FLAGS = """-std=gnu99 -O2 -Wall -Wextra -Wconversion -Wsign-conversion -Wshadow -Wundef -Wpointer-arith -Wcast-qual -Wcast-align
    -Wstrict-prototypes -Wmissing-prototypes -Wswitch-default -Wlogical-op -Wduplicated-cond -Wduplicated-branches -Wvla -Wtype-limits
    -Wfloat-equal -Wnull-dereference -Werror -c -o /dev/null""".split()
# msp430 is not our target, but clang knows it and its int has 16 bits like ours.
CLANG_16_BIT = "--target=msp430 -ffreestanding -std=gnu99".split()
# Every warning but those about C dialects, padding and style that the other checks own; what #pragma message says is meant for the user.
CLANG_FLAGS = """-Wall -Wextra -Wconversion -Wsign-conversion -Wshadow -Wundef -Wcast-qual -Wcomma -Wconditional-uninitialized
    -Wextra-semi -Wimplicit-fallthrough -Wmissing-prototypes -Wshift-sign-overflow -Wtautological-compare -Wunreachable-code
    -Wno-#pragma-messages -Werror -fsyntax-only""".split()
UNUSED = ("misra 2.3", "misra 2.4", "misra 2.5", "cppcheck unusedFunction")
CLANG = os.environ.get("CLANG", "clang-14")
INCLUDES = ["-Itools/cpu_host", "-Iinclude", "-I."]
# Text only, without code, for the compilers alone: cppcheck's preprocessor expands a parameter's name before ## and #, and clang-tidy takes a minute
# for each configuration. clang takes eight seconds: these have every relation between them, as test_static.py sees.
CHECKS_OF_PARAMETERS = ("firmware/drive/param_text.c", "firmware/drive/param_check.c")
PARAMETERS = "include/drive/param_init.h"
WHOLE = 4 # configurations of which cppcheck looks at the whole unit at once (of the first that is nearly so), for they use what the others do not
CHECKED = [PRODUCT, ("IDENTIFY",), ("BRINGUP",)]


@dataclass(frozen=True)
class Finding:
    check: str  # tool and rule, as docs/deviations.md names it: "misra 12.1"
    file: str
    line: int
    text: str


@dataclass
class Deviation:
    check: str
    places: list[str]
    reason: str
    used: int = 0

    def covers(self, finding: Finding) -> bool:
        return self.check == finding.check and any(fnmatch(finding.file, place) for place in self.places)


def read_deviations(page: Path) -> list[Deviation]:
    """The rows `| check | places | reason |` of every table on the page; places are files or patterns in backquotes."""
    deviations = []
    for line in page.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if line.startswith("| `") and len(cells) == 3:
            places = re.findall(r"`([^`]+)`", cells[1])
            if not places or not cells[2]:
                sys.exit(f"foc33: {page}, {cells[0]}: name the places in backquotes and a reason")
            deviations.append(Deviation(cells[0].strip("`"), places, cells[2]))
    return deviations


def run(command: list[str], **environment: str) -> str:
    """Standard output and error of the command; a tool that cannot run at all ends the program."""
    try:
        done = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, env=os.environ | environment)
    except OSError as error:
        print(f"foc33: {command[0]}, static checks: cannot be run ({error.strerror}); make static installs it", file=sys.stderr)
        sys.exit(2)
    if done.returncode < 0:
        print(f"foc33: {command[0]}, static checks: ended by signal {-done.returncode}; run them again", file=sys.stderr)
        sys.exit(2)
    if done.returncode != 0 and not done.stdout.strip():
        return f"{command[0]} ended with code {done.returncode}"
    return done.stdout


def each(function, items) -> list:
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(function, items))


@functools.cache
def relative(path: str) -> str:
    return os.path.relpath(path)


def configurations() -> list[tuple[str, ...]]:
    """Macros of each build that is looked at: as delivered, each mode alone, with the scope, with all that a product may have, some modes together."""
    modes = re.findall(r"^ *X\((\w+), ", MODE_TABLE.read_text(encoding="utf-8"), re.M)
    return [(), *((mode,) for mode in modes), ("SCOPE",), *COMBINED]


def wishes(application: str) -> tuple[str, ...]:
    """What an application asks of the board by what it includes, as in the Makefile."""
    text = Path(application).read_text(encoding="utf-8")
    return tuple(name for header, name in (("app/line.h", "APP_SERIAL"), ("app/pulse.h", "APP_PULSE")) if header in text)


def defines(configuration: tuple[str, ...]) -> list[str]:
    return [f"-D{name}" if "=" in name else f"-D{name}=1" for name in configuration]


@functools.cache
def preprocessed(source: str, options: tuple[str, ...]) -> frozenset[tuple[str, int, str]]:
    """Every line of the project's that these options leave: file, number, and text after expansion."""
    lines, file, number = set(), "", 0
    for line in run([CLANG, *CLANG_16_BIT, *INCLUDES, *options, "-w", "-E", "-dD", source]).splitlines():
        if marker := re.match(r'# (\d+) "(.*?)"', line):
            number, file = int(marker[1]), marker[2]
            continue
        if line.strip() and not os.path.isabs(file) and not file.startswith("<"):
            lines.add((relative(file), number, line))
        number += 1
    return frozenset(lines)


def distinct(source: str, of: list[tuple[str, ...]]) -> dict[tuple[str, ...], frozenset]:
    """The configurations that differ in this source's text, with their lines."""
    first: dict[frozenset, tuple[str, ...]] = {}
    for configuration, lines in zip(of, each(lambda configuration: preprocessed(source, tuple(defines(configuration))), of), strict=True):
        first.setdefault(lines, configuration)
    return {configuration: lines for lines, configuration in first.items()}


def cover(texts: dict[tuple[str, ...], frozenset]) -> list[tuple[str, ...]]:
    """As few configurations as have each line that any of them has."""
    chosen, missing = [], frozenset().union(*texts.values())
    while missing:
        chosen.append(max(texts, key=lambda configuration: len(texts[configuration] & missing)))
        missing -= texts[chosen[-1]]
    return chosen


def parts(name: str, texts: dict[tuple[str, ...], frozenset], *without: str) -> list[tuple[tuple[str, ...], str, frozenset]]:
    """The configurations of cover(), each with a unit of the files that have in it lines which none before it had, of the first that is nearly every
    file, without those that are named; and all lines of these files."""
    missing, found = frozenset().union(*texts.values()), []
    for number, configuration in enumerate(cover(texts)):
        files = {file for file, _, _ in texts[configuration] & missing}
        missing -= texts[configuration]
        unit = as_unit(f"{name}_{number}.c", sorted(file for file in files - set(without) if file.startswith(("firmware/", "include/"))))
        found.append((configuration, unit, frozenset(line for line in texts[configuration] if line[0] in files and (number == 0 or line[0] != "userparams.h"))))
    return found


def compiler(name: str, command: list[str], jobs: list[tuple[str, list[str]]]) -> list[Finding]:
    """One finding for each message in any mode; these compile clean, so the page has no row for them."""
    findings = set()
    for (source, options), output in zip(jobs, each(lambda job: run([*command, *INCLUDES, *job[1], job[0]]), jobs), strict=True):
        messages = [line for line in output.splitlines() if re.search(r"(error|warning|ended with code)", line)]
        findings |= {Finding(name, source, 0, " ".join([message, *options])) for message in messages}
    return sorted(findings, key=lambda f: (f.file, f.text))


def one_unit(sources: list[str]) -> str:
    """All sources as one, as the image is compiled: each header is looked at once, not with every source that includes it. Nothing is said of this
    file itself."""
    return as_unit("unit.c", [source for source in sources if source not in (*CHECKS_OF_PARAMETERS, *other_applications())])


def as_unit(name: str, files: list[str]) -> str:
    unit = BUILD / name
    unit.write_text("".join(f'#include "{file}"\n' for file in files))
    return str(unit)


def other_applications() -> list[str]:
    """Of the applications one is in a unit, the panel; the others are looked at alone, as delivered."""
    return sorted(str(path) for path in Path("firmware/app").glob("*.c") if path.name != "panel.c")


def cppcheck(unit: str, texts: dict[tuple[str, ...], frozenset], sources: list[str], deviations: list[Deviation]) -> list[Finding]:
    """Its own checks and those of its MISRA addon, with the target's type sizes: of each file, for some rules read its text only, what is delivered; of the
    unit in configurations that have every line between them, without the parameters' start values, which are most of the text: of each the files with lines of
    its own, but in some, and in more while something then seems unused, the whole unit."""
    sources = [source for source in sources if source not in CHECKS_OF_PARAMETERS]
    with TemporaryDirectory(prefix="cppcheck-", dir=BUILD) as folder:
        Path(folder, "drive").mkdir()
        Path(folder, "drive", "param_init.h").write_text("#define DRIVE_PARAMS_INIT {0}\n")

        def one(part: tuple[tuple[str, ...], str]) -> set[Finding]:
            return one_cppcheck(["-DANALYSED=1", f"-I{folder}", *defines(part[0])], [part[1]])

        of = parts("cppcheck", texts, PARAMETERS)
        whole = [(configuration, unit, texts[configuration]) for configuration, _, _ in of]
        runs = [of[0], *whole[1:WHOLE], *of[WHOLE:]]
        found = each(lambda job: job(), [lambda: one_cppcheck(["--max-configs=1"], sources), *(functools.partial(one, run[:2]) for run in runs)])
        lines = [texts[()], *(lines for _, _, lines in runs)]
        for run in whole[WHOLE:]:
            if not any(finding.check in UNUSED and not any(row.covers(finding) for row in deviations) for finding in of_all(found, lines)):
                break
            found.append(one(run[:2]))
            lines.append(run[2])
        found = of_all(found, lines)
    return sorted(found, key=lambda f: (f.check, f.file, f.line))


def of_all(found: list[set[Finding]], texts: list[frozenset]) -> set[Finding]:
    """What any run finds; but what is never used is so in the first, what is delivered, and in each other one that has its line; a
    macro's is looked at by its name, in whichever branch."""
    places = [{line[:2] for line in text} for text in texts]
    return {finding for finding in set().union(*found) if finding.check not in UNUSED
            or finding in found[0] and all(finding in run for run, lines in zip(found, places, strict=True)
                                         if (finding.check == "misra 2.5" and finding.file in {file for file, _ in lines}) or (finding.file, finding.line) in lines)}


def one_cppcheck(options: list[str], sources: list[str]) -> set[Finding]:
    with TemporaryDirectory(prefix="cppcheck-", dir=BUILD) as folder:  # else it writes beside the sources
        Path(folder, "sitecustomize.py").write_text("import gc\ngc.disable()\n") # the addon makes objects and ends
        output = run([os.environ.get("CPPCHECK", "cppcheck"), "--quiet", "--std=c99", f"--addon-python={sys.executable}", f"--platform={HERE}/dspic33f.xml",
                      f"--cppcheck-build-dir={folder}", f"-j{os.cpu_count()}", "--template={file}:{line}:{id}:{message}", "--inconclusive",
                      "--enable=warning,style,performance,portability,unusedFunction", "--addon=misra", *options, *INCLUDES, *sources],
                     PYTHONPATH=folder)
    return {Finding(f"cppcheck {check}".replace("cppcheck misra-c2012-", "misra "), relative(file), int(number), text)
            for file, number, check, text in re.findall(r"^(?!tools/)([^:\n]+):(\d+):([\w.-]+):(.*)$", output, re.M)}


def clang_tidy(jobs: list[tuple[str, list[str]]]) -> list[Finding]:
    def one(job: tuple[str, list[str]]) -> set[Finding]:
        output = run([os.environ.get("CLANG_TIDY", "clang-tidy-14"), "--quiet", f"--config-file={HERE}/clang-tidy.yaml",
                      "--header-filter=(include|firmware)/.*", job[0], "--", *CLANG_16_BIT, *INCLUDES, *job[1]])
        found = re.findall(r"^(.+?):(\d+):\d+: (?:warning|error): (.*) \[([\w.,-]+)\]$", output, re.M)
        return {Finding(f"tidy {check}", relative(file), int(number), text)
                for file, number, text, checks in found for check in checks.split(",")}

    return sorted(set().union(*each(one, jobs)), key=lambda f: (f.check, f.file, f.line))


def main() -> int:
    sources = sorted(str(path) for path in Path("firmware").rglob("*.c"))
    if not sources:
        print("foc33: firmware/, static checks: no sources here; run from the project's folder", file=sys.stderr)
        return 2
    deviations = read_deviations(Path(PAGE))
    BUILD.mkdir(parents=True, exist_ok=True)

    unit = one_unit(sources)
    texts = {unit: distinct(unit, configurations())} | {source: distinct(source, [wishes(source)]) for source in other_applications()}
    each_text = [(source, defines(configuration)) for source, its in texts.items() for configuration in its]
    each_line = [(source, defines(configuration)) for source, its in texts.items() for configuration in cover(its)]
    checks_of_parameters = [(source, defines(configuration)) for source in CHECKS_OF_PARAMETERS for configuration in CHECKED]
    checks = {
        "cppcheck": lambda: cppcheck(unit, distinct(unit, [*configurations(), ON_TARGET]), sources, deviations),
        "clang_tidy": lambda: clang_tidy([*((file, defines(configuration)) for configuration, file, _ in parts("clang_tidy", texts[unit])), *each_line[-len(other_applications()):]]),
        "clang_16_bit": lambda: compiler("clang", [CLANG, *CLANG_16_BIT, *CLANG_FLAGS], [*each_text, *checks_of_parameters]),
        "gcc": lambda: compiler("gcc", [os.environ.get("CC", "gcc"), *GCC_FLAGS], [*each_line, *checks_of_parameters]),
    }
    passed = failed = 0
    for name, findings in zip(checks, each(lambda check: check(), checks.values())):
        unlisted = []
        for finding in (f for f in findings if not f.file.startswith(f"{BUILD}/")):
            row = next((d for d in deviations if d.covers(finding)), None)
            if row:
                row.used += 1
            else:
                unlisted.append(finding)
                print(f"  {finding.file}:{finding.line}: [{finding.check}] {finding.text}")
        if unlisted:
            print(f"{name}: FAIL: {len(unlisted)} findings that {PAGE} does not list")
        else:
            print(f"{name}: PASS" + (f" ({len(findings)} findings, all listed)" if findings else ""))
        passed, failed = passed + (not unlisted), failed + bool(unlisted)
    stale = [d for d in deviations if not d.used]
    for d in stale:
        print(f"  {PAGE}: `{d.check}` at {' '.join(d.places)} is listed, but nothing reports it any more: delete the line")
    print("deviations_are_needed: " + (f"FAIL: {len(stale)} lines of {PAGE} are stale" if stale else "PASS"))
    passed, failed = passed + (not stale), failed + bool(stale)
    print(f"{passed} passed, {failed} failed")
    return int(failed != 0)


if __name__ == "__main__":
    sys.exit(main())
