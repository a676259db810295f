"""Runs unit tests of the control law where int has 16 bits, in the chip's simulator, and compares every result with the PC's.

A test is one image, or several where the flash does not hold all of it."""

import argparse
import os
import re
import shlex
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import golden_words # noqa: E402
from tools.image import load # noqa: E402

HERE = Path(__file__).resolve().parent
SIMULATOR_FAILED = 255  # exit code; below, it is the number of failed tests
MISSING_HEADER = re.compile(r"fatal error: (\S+): No such file")
DOES_NOT_FIT = re.compile(r"could not allocate|not enough|will not fit|overflow|out of (?:range|memory)|exceeds", re.IGNORECASE)
LISTED = re.compile(r'\.name = "(\w+)";\s*\S+\.line_num = (\d+);')
RESULT = re.compile(r"^[^:\n]*:\d+:(\w+(?:\([^\n]*?\))?):(PASS|FAIL|IGNORE)(.*)$", re.MULTILINE)


class TestError(Exception):
    """A test that gives no results, and why."""


def run_command(argv: list[str]) -> tuple[int, str, str]:
    """Exit code, stdout and stderr."""
    done = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", check=False)
    return done.returncode, done.stdout, done.stderr


def results(output: str) -> dict[str, tuple[str, str]]:
    """{test: (verdict, message)} of Unity's output"""
    return {name: (verdict, message) for name, verdict, message in RESULT.findall(output)}


def told(result: tuple[str, str] | None) -> str:
    if result is None:
        return "no result"
    verdict, message = result
    return "passes" if verdict == "PASS" else message.lstrip(": ") or verdict


@dataclass
class Outcome:
    """What one test file gave in the simulator."""
    results: dict[str, tuple[str, str]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list) # one an image


class Builder:
    """Compiles and links into `out`; what all tests share is compiled once."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.out, self.unity, self.runners = Path(options.out), Path(options.unity), Path(options.runners)
        self.compiler, self.linker = shlex.split(options.compile), shlex.split(options.link)
        self.library, self.simulator, self.cycles = options.library, options.simulator, options.cycles
        self.includes = [f"-I{HERE}", "-Itest/unit/support", f"-I{self.out}/golden", "-isystem", f"{self.unity}/src"]
        self.tables: list[Path] = []
        self.objects: list[Path] = []

    def compile(self, source: Path, target: Path, extra: list[str]) -> Path:
        target.parent.mkdir(parents=True, exist_ok=True)
        command = [self.compiler[0], *self.includes, *self.compiler[1:], "-DUNITY_INCLUDE_CONFIG_H", *extra]
        code, _, errors = run_command([*command, "-c", str(source), "-o", str(target)])
        if code != 0:
            missing = MISSING_HEADER.search(errors)
            raise TestError(f"the compiler has no <{missing[1]}>" if missing else f"{source} does not compile: {errors.strip()}")
        return target

    def shared(self) -> None:
        """Vectors, Unity and the console."""
        self.tables = golden_words.write(HERE.parent / "golden/vectors", self.out / "golden")
        self.objects = [self.compile(self.unity / "src/unity.c", self.out / "unity.o", ["-w"]),
                        self.compile(HERE / "console.c", self.out / "console.o", ["-Wall", "-Wextra"])]

    def test_object(self, name: str) -> tuple[Path, list[tuple[str, str]]]:
        """The compiled test, and its tests with their lines."""
        source = Path(f"test/{name}.c")
        text = source.read_text(encoding="utf-8")
        own = re.search(r"/\* defines: (.*?) \*/", "\n".join(text.splitlines()[:5]))
        extra = ["-Wall", "-Wextra", *(shlex.split(own[1]) if own else [])]
        runner = self.runners / f"{name}_runner.c"
        tests = LISTED.findall(runner.read_text(encoding="utf-8")) if runner.exists() else []
        if not tests:
            raise TestError(f"{runner}, the runner on the PC, lists no test")
        return self.compile(source, self.out / f"{name}.o", extra), tests

    def link(self, name: str, part: str, test: Path, tests: list[tuple[str, str]]) -> Path | None:
        """An image with these tests; None if it is too large."""
        runner = self.out / f"{name}{part}_runner.c"
        declared = "\n".join(f"void {test}(void);" for test, _ in tests)
        calls = "\n".join(f'    UnityDefaultTestRun({test}, "{test}", {line});' for test, line in tests)
        runner.write_text(f'#include "unity.h"\nint test_main(void);\n{declared}\nint test_main(void)\n{{\n'
                          f'    UnityBegin("test/{name}.c");\n{calls}\n    return UNITY_END();\n}}\n', encoding="utf-8")
        objects = [test, self.compile(runner, runner.with_suffix(".o"), ["-w"]), *self.objects, self.library]
        elf = self.out / f"{name}{part}.elf"
        command = []
        for word in self.linker:
            command += [str(item) for item in objects] if word == "{objects}" else [word.format(elf=elf, map=elf.with_suffix(".map"))]
        code, output, errors = run_command(command)
        if code == 0:
            return elf
        text = (output + errors).strip()
        if DOES_NOT_FIT.search(text) and not re.search("undefined reference", text):
            return None
        raise TestError(f"does not link: {text[-600:]}")

    def images(self, name: str) -> list[tuple[Path, int]]:
        """As few images as the flash allows, each with its number of tests."""
        test, tests = self.test_object(name)
        done, todo = [], [tests]
        while todo:
            part = todo.pop(0)
            elf = self.link(name, f".{len(done)}", test, part)
            if elf is not None:
                done.append((elf, len(part)))
            elif len(part) == 1:
                raise TestError(f"{part[0][0]} does not fit the flash")
            else:
                todo[:0] = [part[:len(part) // 2], part[len(part) // 2:]]
        return done

    def loadable(self, elf: Path) -> Path:
        """What the simulator reads."""
        image = elf.with_suffix(".image")
        image.write_text(load.text(load.load(elf)), encoding="utf-8")
        return image

    def simulate(self, name: str) -> Outcome:
        outcome = Outcome()
        for elf, count in self.images(name):
            code, output, remark = run_command([self.simulator, str(self.loadable(elf)), str(self.cycles), *map(str, self.tables)])
            elf.with_suffix(".txt").write_text(output, encoding="utf-8")
            if code == SIMULATOR_FAILED or not re.search(rf"^{count} Tests \d+ Failures", output, re.MULTILINE):
                last = RESULT.findall(output)[-1:]
                raise TestError(f"stopped after {last[0][0] if last else 'the start'}: {remark.strip() or 'no total'}")
            outcome.results |= results(output)
            outcome.remarks.append(remark.strip())
        return outcome


def judge(name: str, builder: Builder, host_folder: Path) -> tuple[list[str], list[str], int, int]:
    """@return (lines to print, results for the report, passed, failed)"""
    begin = time.monotonic()
    place = f"test/{name}.c"
    try:
        outcome = builder.simulate(name)
    except TestError as error:
        return [f"{name}: FAIL: {error}"], [f"{place}:all:FAIL: {error}"], 0, 1
    _, host_output, _ = run_command([str(host_folder / name)])
    host, target = results(host_output), outcome.results
    lines, report, passed = [], [], 0
    for test in sorted(target.keys() | host.keys()):
        if target.get(test) == host.get(test) and target[test][0] == "PASS":
            passed += 1
            report.append(f"{place}:{test}:PASS")
            continue
        text = f"{told(target.get(test))} on the target, {told(host.get(test))} on the PC"
        report.append(f"{place}:{test}:FAIL: {text}")
        lines.append(f"{name}: {test}: FAIL: {text}")
    failed = len(report) - passed
    images = f"{len(outcome.remarks)} images, " if len(outcome.remarks) > 1 else ""
    lines.append(f"{name}: {passed} passed, {failed} failed ({images}{'; '.join(outcome.remarks)}, {time.monotonic() - begin:.1f} s)")
    return lines, report, passed, failed


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--unity", required=True, help="Unity's folder")
    parser.add_argument("--compile", required=True, help="compiler with its flags; -c, source and object are added")
    parser.add_argument("--link", required=True, help="command with {objects}, {elf} and {map} in it")
    parser.add_argument("--library", required=True, help="archive of the control law for that chip")
    parser.add_argument("--simulator", required=True)
    parser.add_argument("--runners", required=True, help="folder of the generated runners")
    parser.add_argument("--host", required=True, help="folder of the PC's executables")
    parser.add_argument("--out", required=True)
    parser.add_argument("--cycles", type=int, default=4_000_000_000, help="longest run of an image")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 2)
    parser.add_argument("tests", nargs="+", metavar="unit/test_x")
    return parser.parse_args()


def main() -> int:
    options = arguments()
    builder = Builder(options)
    try:
        builder.shared()
    except TestError as error:
        print(f"FAIL: {error}\n0 passed, 1 failed")
        return 1
    passed = failed = 0
    report: list[str] = []
    with ThreadPoolExecutor(options.jobs) as pool:
        for lines, entries, good, bad in pool.map(lambda name: judge(name, builder, Path(options.host)), options.tests):
            print("\n".join(lines), flush=True)
            report += entries
            passed, failed = passed + good, failed + bad
    end, total = int(failed > 0 or passed == 0), f"{passed} passed, {failed} failed"
    Path(options.out, "report.txt").write_text("\n".join([*report, total, f"exit {end}"]) + "\n", encoding="utf-8")
    print(total)
    return end


if __name__ == "__main__":
    sys.exit(main())
