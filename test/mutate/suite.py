"""The unit tests as mutation testing needs them: built once, then rebuilt and run only as far as one changed file reaches."""
import os
import re
import shlex
import shutil
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

# The tests of mutants: most take longer to compile than to run, so nothing is optimized or inlined.
FAST = ["-O0", "-g0", "-w", "-Dalways_inline=unused", "-DUNITY_TEST_ABORT()=_Exit(1)"] # the first failure ends the run
LONG = ["-O1", "-g0", "-w"]           # those that run longer than this:
LONG_SECONDS = 0.2
SHIPPED = ["-O2", "-g0", "-w"]        # the firmware, to see whether a change reaches it at all
SOURCES = ("include", "firmware", "tools/common", "tools/plant", "tools/chip", "tools/vboard", "tools/cpu_host", "test/unit",
           "test/behaviour", "test/chip", "docs", "tuning")
DEFINES = re.compile(r"/\* defines: (.*?) \*/")
FAILED_TEST = re.compile(r"^[^:\n]*:\d+:(\w+(?:\([^\n]*?\))?):FAIL", re.M)


class BuildError(Exception):
    """The unchanged sources do not build or do not pass."""


@dataclass
class Unit:
    """One translation unit: how it is compiled and what it reads."""
    source: str
    command: list
    object: str                 # path in the base tree
    deps: set = field(default_factory=set)
    content: bytes = b""


@dataclass
class Test:
    """One executable."""
    name: str                   # unit/test_svm
    fixed: list                 # objects that no mutant changes: runner, mocks, Unity
    units: list                 # the test itself and the firmware objects it needs
    seconds: float = 0.0
    argv: list = None           # a check that is a script: run instead of an executable

    def reads(self, file):
        return any(file in unit.deps for unit in self.units)


def run(argv, cwd, timeout=None):
    """@return (exit code, output); a timeout is exit code None"""
    try:
        done = subprocess.run(argv, cwd=cwd, timeout=timeout, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, errors="replace", check=False)
    except subprocess.TimeoutExpired:
        return None, ""
    return done.returncode, done.stdout


def listed(deps):
    """The files that the compiler's dependency file names."""
    return {os.path.normpath(path) for path in deps.read_text().replace("\\\n", " ").split(":", 1)[1].split()}


def copy_sources(root, tree):
    """The sources that a build reads, and what was generated for it, so that edits during a run do no harm."""
    for folder in SOURCES:
        shutil.copytree(root / folder, tree / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy2(root / "userparams.h", tree)
    for path in sorted((root / "build").rglob("*")):
        where = path.relative_to(root)
        if path.suffix in (".c", ".h", ".inc") and where.parts[1] not in ("gems", "mutate", "setup", "coverage", "host") or path.match("build/host/law.c"):
            (tree / where).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, tree / where)
    os.symlink((root / "build/gems").resolve(), tree / "build/gems")


class Suite:
    """Tests of the unchanged sources in `base`, and their results on a changed tree."""

    def __init__(self, root, base, compile_command, jobs):
        self.root, self.base, self.jobs = Path(root), Path(base), jobs
        self.compile_command = shlex.split(compile_command)
        self.tests, self.firmware, self.bench = [], {}, []
        self.shipped, self.lock = {}, threading.Lock()

    # ---- building the unchanged sources ----
    def unit(self, source, flags, optimize=None):
        optimize = optimize or FAST
        name = source.removesuffix(".c").replace("/", ".") + "".join((*flags, optimize[0])).replace("/", ".").replace(" ", "")
        return Unit(source, self.compile_command + flags + optimize + ["-c", source, "-o"], f"obj/{name}.o")

    def compile_base(self, unit):
        deps = self.base / (unit.object + ".d")
        code, output = run(unit.command + [unit.object, "-MD", "-MF", str(deps)], self.base)
        if code != 0:
            raise BuildError(f"{unit.source} does not compile:\n{output}")
        unit.deps = listed(deps)
        unit.content = (self.base / unit.object).read_bytes()
        return unit

    def prepare(self, names, behaviour=()):
        """Copies, builds and runs everything once. @param names such as unit/test_svm"""
        copy_sources(self.root, self.base)
        (self.base / "obj").mkdir()
        vendor = next(self.base.glob("build/gems/gems/ceedling-*/vendor"), None)
        if vendor is None:
            raise BuildError("no Unity: run make test first")
        vendor = os.path.relpath(vendor, self.base)
        frame = [self.unit(f"{vendor}/unity/src/unity.c", []), self.unit(f"{vendor}/cmock/src/cmock.c", [])]
        firmware = [str(p.relative_to(self.base)) for p in sorted(self.base.glob("firmware/**/*.c")) if p.parent.name != "app" or p.name == "panel.c"] + ["tools/cpu_host/xc.c"]
        self.firmware = {u.object: u for u in (self.unit(source, []) for source in firmware)}
        if behaviour: # the virtual board runs for minutes of motor time: all of it optimized
            board = [str(p.relative_to(self.base)) for p in sorted(self.base.glob("tools/*/*.c")) if p.name != "xc.c"]
            self.bench = [self.unit(source, [], SHIPPED) for source in (*board, *firmware) if not source.endswith("/main.c")]
        mocks, plans = {}, []
        for name in (*names, *behaviour):
            text = (self.base / f"test/{name}.c").read_text()
            own = DEFINES.search("\n".join(text.splitlines()[:5]))
            flags = shlex.split(own.group(1)) if own else []
            uses = sorted(set(re.findall(r"#include \"(mock_\w+)\.h\"", text)))
            for mock in uses:
                mocks.setdefault(mock, self.unit(f"build/test/mocks/{mock}.c", []))
            flags = [f"-Itest/{os.path.dirname(name)}", *flags, "-include", f"test/{name}.c"] # test and runner are one
            plans.append((name, [self.unit(f"build/test/{name}_runner.c", flags, o) for o in (FAST, LONG)], [mocks[m] for m in uses]))
        everything = [*frame, *self.firmware.values(), *mocks.values(), *self.bench]
        everything += [units[0] for _, units, _ in plans]
        with ThreadPoolExecutor(self.jobs) as pool:
            list(pool.map(self.compile_base, everything))
            run(["ar", "rcs", "obj/firmware.a", *self.firmware], self.base)
            linked = pool.map(lambda plan: self.link_base(plan, frame, plan[0] in behaviour), plans)
            self.tests = sorted(linked, key=lambda t: (t.name in behaviour, t.seconds))

    def link_base(self, plan, frame, on_board):
        """Links and runs a test; a unit test that takes long is built again so that it runs faster."""
        name, units, mocks = plan
        fixed = [u.object for u in (*mocks, *frame)]
        test = self.try_base(name, units[0], fixed, on_board)
        if test.seconds > LONG_SECONDS and not on_board:
            test = self.try_base(name, self.compile_base(units[1]), fixed, on_board)
        return test

    def pulled(self, link):
        """The firmware objects that a program needs, by the linker's own account."""
        code, output = run([*link, "obj/firmware.a", "-lm", "-Wl,-t,-t"], self.base)
        if code != 0:
            raise BuildError(f"{link[2]} does not link:\n{output}")
        members = set(re.findall(r"\(?obj/firmware\.a\)?\(?([\w.-]+\.o)\)?", output))
        return [u for path, u in self.firmware.items() if os.path.basename(path) in members]

    def try_base(self, name, unit, fixed, on_board):
        program = f"obj/{name.replace('/', '.')}"
        link = ["gcc", "-o", program, unit.object, *fixed]
        needed = self.bench if on_board else self.pulled(link)
        code, output = run([*link, *(u.object for u in needed), "-lm"], self.base)
        if code != 0:
            raise BuildError(f"{name} does not link:\n{output}")
        begin = time.monotonic()
        code, output = run([f"./{program}"], self.base, timeout=600)
        if code != 0:
            raise BuildError(f"{name} fails without any change:\n{output}")
        return Test(name, fixed, [unit, *needed], seconds=time.monotonic() - begin)

    def add_script(self, name, argv, deps):
        """A check that is a Python script and compiles by itself; it counts when it passes unchanged in the base tree."""
        begin = time.monotonic()
        code, output = run(argv, self.base, timeout=600)
        if code != 0:
            return f"{name} does not pass in a copy of the sources and takes no part: {output.strip().splitlines()[-1:]}"
        unit = Unit(name, [], "", set(deps))
        self.tests.append(Test(name, [], [unit], seconds=time.monotonic() - begin, argv=argv))
        return None

    def order(self, file, names):
        """The tests that read the file: those of its own module first, then the quick ones."""
        stem = Path(file).stem

        def key(test):
            module = os.path.basename(test.name).removeprefix("test_")
            related = module.startswith(stem) or stem.startswith(module)
            return module != stem, not related, test.seconds, test.name
        return sorted((t for t in self.tests if t.name in names and t.reads(file)), key=key)

    # ---- one changed tree ----
    def judge(self, tree, file, names, memory):
        """Runs the tests on `tree`, in which `file` differs from the base.
        @return ("killed", by) or ("timeout", by) or ("survived", "") or ("broken", why)"""
        for test in self.order(file, names):
            if test.argv:
                code, _ = run(test.argv, tree, timeout=20 * test.seconds + 10)
                if code != 0:
                    return "killed", test.name
                continue
            objects, changed = [], False
            for unit in test.units:
                state = self.compile_changed(tree, unit, memory) if file in unit.deps else "same"
                if state == "broken":
                    return "broken", unit.source
                changed |= state == "changed"
                objects.append(unit.object if state == "changed" else f"../base/{unit.object}")
            if not changed:
                continue
            fixed = [f"../base/{path}" for path in test.fixed]
            code, _ = run(["gcc", "-o", "obj/program", *objects, *fixed, "-lm"], tree)
            if code != 0:
                return "broken", f"link of {test.name}"
            code, output = run(["./obj/program"], tree, (10 if test.seconds < 1 else 5) * test.seconds + 2)
            if code is None:
                return "timeout", test.name
            if code != 0:
                failed = FAILED_TEST.search(output)
                return "killed", f"{test.name}: {failed[1] if failed else f'ended with {code}'}"
        return "survived", ""

    def compile_changed(self, tree, unit, memory):
        if unit.object not in memory:
            code, _ = run(unit.command + [unit.object], tree)
            same = code == 0 and (tree / unit.object).read_bytes() == unit.content
            memory[unit.object] = "same" if same else "changed" if code == 0 else "broken"
        return memory[unit.object]

    def shipped_base(self, unit, mode):
        """What the firmware's unit reads and its object code in one mode, without a change; compiled when first asked for."""
        key = (unit.source, tuple(mode))
        with self.lock:
            if key not in self.shipped:
                place = f"obj/shipped{len(self.shipped)}"
                code, output = run(self.shipped_command(unit, mode) + [f"{place}.o", "-MD", "-MF", f"{place}.d"], self.base)
                if code != 0:
                    raise BuildError(f"{unit.source} does not compile with {' '.join(mode)}:\n{output}")
                self.shipped[key] = (listed(self.base / f"{place}.d"), (self.base / f"{place}.o").read_bytes())
            return self.shipped[key]

    def shipped_command(self, unit, mode):
        return [*self.compile_command, *mode, *SHIPPED, "-c", unit.source, "-o"]

    def same_object_code(self, tree, file, modes):
        """Does the firmware compile to the same object code as without the change, in every mode?"""
        for unit in sorted(self.firmware.values(), key=lambda u: -len(u.content)): # the interrupts hold nearly all of it
            for mode in modes:
                deps, content = self.shipped_base(unit, mode)
                if file not in deps:
                    continue
                code, _ = run(self.shipped_command(unit, mode) + ["obj/shipped.o"], tree)
                if code != 0 or (tree / "obj/shipped.o").read_bytes() != content:
                    return False
        return True
