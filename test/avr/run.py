"""Builds unit tests with avr-gcc, where int has 16 bits, runs them in simavr, and compares every result with the PC's.

Each test is one image for an ATmega2560: its vectors stay in flash, its results come over the UART."""
import argparse
import os
import re
import shlex
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "golden"))
import to_c # noqa: E402

MCU = "atmega2560"
FLAGS = [f"-mmcu={MCU}", "-std=gnu99", "-O2", "-fno-ivopts", "-ffunction-sections", "-fdata-sections", "-DUNITY_INCLUDE_CONFIG_H",
         "-DGOLDEN_STORAGE=const __memx"]
WARNINGS = ["-Wall", "-Wextra"]
LARGEST_OBJECT = 32767      # of the compiler
SIMULATED_SECONDS = 60
SIMULATOR_FAILED = 255      # exit code of sim; below, it is the program's own
RESULT = re.compile(r"^[^:\n]*:\d+:(\w+(?:\([^\n]*?\))?):(PASS|FAIL|IGNORE)(.*)$", re.M)


class TestError(Exception):
    """A test that gives no results, and why."""


def run(argv, **options):
    done = subprocess.run(argv, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace",
                          check=False, **options)
    return done.returncode, done.stdout, done.stderr


def assembler_table(name, columns, rows):
    """A table that is longer than the compiler allows an object to be, declared without its length and defined in assembly."""
    if any(ctype not in ("s16", "u16") for _, ctype in columns):
        raise TestError(f"golden_{name} has 32-bit columns and more than {LARGEST_OBJECT} bytes: split the vectors")
    words = [", ".join(str(int(cell) & 0xFFFF) for cell in row) for row in rows]
    lines = [".pushsection .progmemx.golden, \\\"a\\\", @progbits", f".global golden_{name}", f"golden_{name}:"]
    lines += [f".word {row}" for row in words] + [".popsection"]
    return "\n".join([f"extern GOLDEN_STORAGE golden_{name}_t golden_{name}[];", "__asm__(", *(f'"{line}\\n"' for line in lines), ");"])


def write_vectors(vectors, out):
    """The vectors' headers for the AVR: those of to_c.py, but for tables that the compiler refuses."""
    out.mkdir(parents=True, exist_ok=True)
    for path in sorted(vectors.glob("*.txt")):
        columns, constants, rows = to_c.read(path)
        text = to_c.header(path.stem, columns, constants, rows)
        if len(rows) * sum(int(ctype[1:]) // 8 for _, ctype in columns) > LARGEST_OBJECT:
            begin, end = text.index("static GOLDEN_STORAGE"), text.index("};\n", text.index("static GOLDEN_STORAGE")) + 2
            text = text[:begin] + assembler_table(path.stem, columns, rows) + text[end:]
        target = out / f"golden_{path.stem}.h"
        if not target.exists() or target.read_text() != text:
            target.write_text(text)


class Builder:
    """Compiles into `out`; what all tests share is compiled once."""

    def __init__(self, arguments):
        self.out, self.unity, self.runners = Path(arguments.out), Path(arguments.unity), Path(arguments.runners)
        self.cc, self.sim = arguments.cc, self.out / "sim"
        self.includes = [f"-I{HERE}", "-Iinclude", "-I.", "-Itest/unit/support", f"-I{self.out}/golden", "-isystem", f"{self.unity}/src"]
        self.defines = shlex.split(arguments.defines)

    def compile(self, source, target, extra=()):
        target.parent.mkdir(parents=True, exist_ok=True)
        code, _, errors = run([self.cc, *FLAGS, *self.includes, *self.defines, *extra, "-c", str(source), "-o", str(target)])
        if code != 0:
            raise TestError(f"{source} does not compile: {errors.strip()}")
        return target

    def shared(self):
        """Simulator, Unity, console and the law's own .c files."""
        self.out.mkdir(parents=True, exist_ok=True)
        code, _, errors = run(["gcc", "-O2", "-Wall", "-Wextra", "-o", str(self.sim), str(HERE / "sim.c"), "-lsimavr", "-lelf"])
        if code != 0:
            print(f"foc33: the simulator does not build, test/avr/sim.c: install libsimavr-dev and libelf-dev ({errors.strip().splitlines()[0]})",
                  file=sys.stderr)
            sys.exit(2)
        write_vectors(HERE.parent / "golden/vectors", self.out / "golden")
        self.objects = [self.compile(self.unity / "src/unity.c", self.out / "unity.o", ["-w"]),
                        self.compile(HERE / "console.c", self.out / "console.o", WARNINGS)]
        firmware = [self.compile(source, self.out / source.with_suffix(".o"), [*WARNINGS, "-Wconversion"])
                    for folder in ("control", "drive") for source in sorted(Path("firmware", folder).glob("*.c"))]
        library = self.out / "libfirmware.a"
        library.unlink(missing_ok=True)
        run(["avr-ar", "rcs", str(library), *map(str, firmware)])
        self.objects.append(library) # last: what a test defines itself is not taken from it

    def image(self, name):
        source = Path(f"test/{name}.c")
        own = re.search(r"/\* defines: (.*?) \*/", "\n".join(source.read_text().splitlines()[:5]))
        extra = shlex.split(own.group(1)) if own else []
        stem = self.out / name
        test = self.compile(source, Path(f"{stem}.o"), [*WARNINGS, *extra])
        runner = self.compile(self.runners / f"{name}_runner.c", Path(f"{stem}_runner.o"), ["-w", "-Dmain=test_main", f"-I{source.parent}", *extra])
        program = Path(f"{stem}.elf")
        objects = [str(o) for o in (test, runner, *self.objects)]
        code, _, errors = run([self.cc, f"-mmcu={MCU}", "-Wl,--gc-sections", "-o", str(program), *objects, "-lm"])
        if code != 0:
            raise TestError(f"{name} does not link: {errors.strip()}")
        return program

    def simulate(self, name):
        """@return (Unity's output, remark of the simulator)"""
        program = self.image(name)
        _, symbols, _ = run(["avr-nm", str(program)])
        end = next(int(line.split()[0], 16) & 0xFFFF for line in symbols.splitlines() if line.endswith(" _end"))
        code, output, remark = run([str(self.sim), str(program), hex(end), str(SIMULATED_SECONDS)])
        Path(f"{program}.txt").write_text(output)
        if not re.search(r"^\d+ Tests \d+ Failures", output, re.M):
            last = RESULT.findall(output)[-1:]
            raise TestError(f"{name} stopped after {last[0][0] if last else 'the start'}: {remark.strip()}")
        if code == SIMULATOR_FAILED:
            raise TestError(remark.strip())
        return output, remark.strip()


def results(output):
    """{test: (verdict, message)} of Unity's output"""
    return {name: (verdict, message) for name, verdict, message in RESULT.findall(output)}


def told(result):
    if result is None:
        return "no result"
    verdict, message = result
    return "passes" if verdict == "PASS" else message.lstrip(": ") or verdict


def judge(name, builder, host_folder):
    """@return (lines to print, passed, failed)"""
    try:
        begin = time.monotonic()
        output, remark = builder.simulate(name)
    except TestError as error:
        return [f"{name}: FAIL: {error}"], 0, 1
    avr = results(output)
    _, host_output, _ = run([str(host_folder / name)])
    host = results(host_output)
    lines, passed, failed = [], 0, 0
    for test in sorted(avr.keys() | host.keys()):
        if avr.get(test) == host.get(test) and avr[test][0] == "PASS":
            passed += 1
            continue
        failed += 1
        lines.append(f"{name}: {test}: FAIL: {told(avr.get(test))} with 16-bit int, {told(host.get(test))} on the PC")
    lines.append(f"{name}: {passed} passed, {failed} failed ({remark}, {time.monotonic() - begin:.1f} s)")
    return lines, passed, failed


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--unity", required=True, help="Unity's folder")
    parser.add_argument("--runners", default="build/test", help="folder of the generated runners")
    parser.add_argument("--host", default="build/test", help="folder of the PC's executables")
    parser.add_argument("--out", default="build/avr")
    parser.add_argument("--cc", default="avr-gcc")
    parser.add_argument("--defines", default="", help="further compiler flags")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 2)
    parser.add_argument("tests", nargs="+", metavar="unit/test_x")
    arguments = parser.parse_args()
    builder = Builder(arguments)
    try:
        builder.shared()
    except TestError as error:
        print(f"FAIL: {error}\n0 passed, 1 failed")
        return 1
    except FileNotFoundError as error:
        print(f"foc33: {error.filename} not found, make test-avr: install gcc-avr, avr-libc and binutils-avr", file=sys.stderr)
        return 2
    passed = failed = 0
    with ThreadPoolExecutor(arguments.jobs) as pool:
        for lines, good, bad in pool.map(lambda name: judge(name, builder, Path(arguments.host)), arguments.tests):
            print("\n".join(lines), flush=True)
            passed, failed = passed + good, failed + bad
    print(f"{passed} passed, {failed} failed")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
